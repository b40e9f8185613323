//! Images from outside: the command, recordings and phantoms of others, and two rovers around a wall.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[allow(dead_code, reason = "the bench uses more of it")]
#[path = "finds/trial.rs"]
mod trial;
#[allow(dead_code, reason = "the bench uses more of it")]
#[path = "walks/walk.rs"]
mod walk;

mod image {
    mod command;
    mod copters;
    mod finds;
    mod outputs;
    mod phantoms;
    mod score;
    mod tracking;
    mod two_persons;
    mod world;
}
