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
#[path = "repro/cases.rs"]
mod cases;
#[path = "orders/chance.rs"]
mod chance;
#[path = "sim/environments.rs"]
mod environments;
#[path = "sim/faults.rs"]
mod faults;
#[path = "sim/fleets.rs"]
mod fleets;
#[path = "sim/floor_plans.rs"]
mod floor_plans;
#[path = "sim/missions.rs"]
mod missions;
#[path = "sim/obstacles.rs"]
mod obstacles;
#[path = "sim/place.rs"]
mod place;
#[path = "floor_plans/plan.rs"]
#[allow(dead_code, reason = "the bench writes plans into folders")]
mod plan;
#[path = "sim/poles.rs"]
mod poles;
#[path = "sim/random_obstacles.rs"]
mod random_obstacles;
#[path = "sim/replay.rs"]
mod replay;
#[path = "sim/repro.rs"]
mod repro;
#[path = "sim/seeds.rs"]
mod seeds;
#[path = "floor_plans/trial.rs"]
mod trial;
#[path = "yards/trial.rs"]
#[allow(dead_code, reason = "the bench prints a table of many")]
mod yard_trial;
#[path = "sim/yards.rs"]
mod yards;
