//! The drawings in the module docs name exactly the variants of the enums that they draw.

use std::collections::BTreeSet;

use crate::node::tests_support::{drawn, variant_of, variants};
use crate::node::vehicle::disarming::DisarmingState;
use crate::node::vehicle::last_telemetry::LastTelemetry;
use crate::node::vehicle::movement::MovementOrder;
use crate::node::vehicle::restraint::Restraint;

#[test]
fn the_drawings_name_the_variants_and_no_others() {
    let both: BTreeSet<String> = variants::<MovementOrder>()
        .union(&variants::<Restraint>())
        .cloned()
        .collect();
    assert_eq!(drawn(include_str!("../../vehicle.rs")), both);
    assert_eq!(
        drawn(include_str!("../disarming.rs")),
        variants::<DisarmingState>()
    );
    assert_eq!(
        drawn(include_str!("../last_telemetry.rs")),
        variants::<LastTelemetry>()
    );
}

#[test]
fn a_drawing_that_forgets_a_state_or_makes_one_up_is_noticed() {
    let known = [
        "Driving",
        "FollowingStored",
        "Halted",
        "Idle",
        "Stopped",
        "Turning",
    ]
    .map(str::to_owned);
    assert_eq!(variants::<MovementOrder>(), BTreeSet::from(known));
    assert_eq!(variant_of(&MovementOrder::default()), "Idle");
    let text = "//! See [Elsewhere].\n//! ```text\n//! [Idle] ──► [Gone]\n//! ```\nenum [Code]";
    assert_eq!(
        drawn(text),
        BTreeSet::from(["Gone", "Idle"].map(str::to_owned))
    );
}
