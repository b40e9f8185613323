//! The drawings in the module docs name exactly the variants of the enums that they draw.

use std::collections::BTreeSet;
use std::fmt::Debug;

use serde::Deserialize;
use serde::de::value::{Error, StrDeserializer};

use crate::node::vehicle::disarming::Disarming;
use crate::node::vehicle::last_telemetry::LastTelemetry;
use crate::node::vehicle::movement::Movement;
use crate::node::vehicle::restraint::Restraint;

/// Gives the name of a value's variant.
pub(in super::super) fn variant_of(value: &impl Debug) -> String {
    format!("{value:?}").chars().take_while(|letter| letter.is_alphanumeric()).collect()
}

/// Gives the names of all variants of an enum: serde lists them to whoever asks for one that is not there.
pub(super) fn variants<'a, T: Deserialize<'a> + Debug>() -> BTreeSet<String> {
    let refusal = T::deserialize(StrDeserializer::<Error>::new("none of them")).unwrap_err().to_string();
    refusal.split('`').skip(3).step_by(2).map(str::to_owned).collect()
}

/// Gives the names in brackets within the drawings of a file's doc.
fn drawn(source: &str) -> BTreeSet<String> {
    let doc: Vec<&str> = source.lines().map_while(|line| line.strip_prefix("//!")).collect();
    let doc = doc.join("\n");
    let drawings = doc.split("```").skip(1).step_by(2).flat_map(|drawing| drawing.split('[').skip(1));
    drawings.filter_map(|from| Some(from.split_once(']')?.0.to_owned())).collect()
}

#[test]
fn the_drawings_name_the_variants_and_no_others() {
    let both: BTreeSet<String> = variants::<Movement>().union(&variants::<Restraint>()).cloned().collect();
    assert_eq!(drawn(include_str!("../../vehicle.rs")), both);
    assert_eq!(drawn(include_str!("../disarming.rs")), variants::<Disarming>());
    assert_eq!(drawn(include_str!("../last_telemetry.rs")), variants::<LastTelemetry>());
}

#[test]
fn a_drawing_that_forgets_a_state_or_makes_one_up_is_noticed() {
    let known = ["Driving", "Halted", "Idle", "Stopped", "Turning"].map(str::to_owned);
    assert_eq!(variants::<Movement>(), BTreeSet::from(known));
    assert_eq!(variant_of(&Movement::default()), "Idle");
    let text = "//! See [Elsewhere].\n//! ```text\n//! [Idle] ──► [Gone]\n//! ```\nenum [Code]";
    assert_eq!(drawn(text), BTreeSet::from(["Gone", "Idle"].map(str::to_owned)));
}
