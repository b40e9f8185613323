//! Facts about the parts that this system took over from its predecessor: inputs, and the outputs that any correct
//! implementation gives. Every fact is dispatched by its area to the function of the library that must know it.
//!
//! `tests/data/facts.json` holds the facts in our own words. Where the shared collection lies beside the project, all
//! its facts of the same areas run through the same dispatcher. A fact of an unknown area, one that asks in an unknown
//! way, and one with a key that nobody read all fail.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

mod facts {
    mod astar;
    mod fact;
    mod geometry;
    mod geometry_3d;
    mod links;
    mod missions;
    mod shared;
    mod table;
    mod vehicle;
    mod vrml;
}
