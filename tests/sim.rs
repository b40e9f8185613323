//! Whole simulated missions: a scene, a fault, a claim. Every run here is checked by the referee of the simulated
//! world: nobody touches anything, nobody leaves the fence, nobody comes too near to another.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "sim/bus.rs"]
mod bus;
#[path = "sim/environments.rs"]
mod environments;
#[path = "sim/faults.rs"]
mod faults;
#[path = "sim/fleets.rs"]
mod fleets;
#[path = "sim/missions.rs"]
mod missions;
#[path = "sim/obstacles.rs"]
mod obstacles;
#[path = "sim/place.rs"]
mod place;
#[path = "sim/poles.rs"]
mod poles;
#[path = "sim/replay.rs"]
mod replay;
#[path = "sim/seeds.rs"]
mod seeds;
