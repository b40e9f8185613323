//! Configuration files from outside: what is bundled, what holds for all of them, and what is refused.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

mod config {
    mod bundled;
    mod bus;
    #[cfg(feature = "hw")]
    mod devices;
    #[cfg(feature = "hw")]
    mod field;
    mod laws;
    mod missions;
    mod nodes;
    mod posts;
    mod problems;
    mod readme;
    mod silence;
    mod slots;
}
