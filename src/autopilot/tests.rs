//! What the link promises: drawings, stories, and laws that hold whatever happens between a vehicle and its autopilot.

mod laws;
mod stories;

use std::collections::BTreeSet;

use super::motors::Motors;
use super::movement::DriveUnderWay;
use super::steering::{LinkHealth, Steering};
use crate::actor::tests_support::{drawn, variants};

#[test]
fn the_drawings_name_the_variants_and_no_others() {
    assert_eq!(drawn(include_str!("motors.rs")), variants::<Motors>());
    assert_eq!(
        drawn(include_str!("movement.rs")),
        variants::<DriveUnderWay>()
    );
    let both: BTreeSet<String> = variants::<LinkHealth>()
        .union(&variants::<Steering>())
        .cloned()
        .collect();
    assert_eq!(drawn(include_str!("steering.rs")), both);
}
