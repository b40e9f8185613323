//! A sample of the runs of `cargo bench --bench finds`: who stands in the courtyard is found, and nobody else.

use crate::trial::{FindTrial, Placement};

fn check(placement: Placement, seed: u64) {
    let trial = FindTrial {
        placement,
        vehicles: 2,
        seed,
    };
    let result = trial.run();
    assert!(
        result.is_all_found() && result.nobodies() == 0,
        "{:?}: {:?}, {:?}",
        trial,
        result.persons,
        result.finds
    );
}

#[test]
fn two_persons_in_the_courtyard_are_found_and_nobody_else() {
    check(Placement::Default, 20_001);
}

#[test]
fn a_person_at_the_wall_is_found() {
    check(Placement::AtTheWall, 20_002);
}

#[test]
fn two_persons_side_by_side_are_two() {
    check(Placement::Pair, 20_003);
}

#[test]
fn where_nobody_stands_nobody_is_found() {
    check(Placement::Nobody, 20_004);
}
