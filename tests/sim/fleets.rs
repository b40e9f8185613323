//! Two to eight vehicles on areas of several shapes, by both planners, that stay or return at the end.

use crate::place::{Place, assert_settled};

#[test]
fn two_to_eight_vehicles_sweep_the_courtyard_and_all_come_home() {
    for vehicles in 2..=8 {
        let place = Place::new(20.0, 20.0)
            .positions(76)
            .vehicles(vehicles)
            .seed(vehicles as u64);
        let outcome = place
            .root("end = \"return\"\nuntil_s = 3000.0")
            .run_to_the_end();
        assert_eq!(outcome.log.matches(" is home\n").count(), vehicles);
        for (_, track) in &outcome.tracks {
            let home_m = track[0].distance_to(track[track.len() - 1]);
            assert!(
                home_m < 0.7,
                "{vehicles} vehicles: one ends {home_m:.2} m from home"
            );
        }
        assert_settled(&outcome);
    }
}

#[test]
fn a_long_area_is_swept_by_few_and_by_many() {
    for vehicles in [2, 4, 6] {
        Place::new(30.0, 12.0).vehicles(vehicles).run_to_the_end();
    }
}

#[test]
fn a_small_area_with_few_positions_is_swept() {
    for vehicles in [2, 3, 4] {
        let place = Place::new(8.0, 8.0).positions(24).vehicles(vehicles);
        place
            .root("end = \"return\"\nuntil_s = 3000.0")
            .run_to_the_end();
    }
}

#[test]
fn the_fan_ends_too() {
    for vehicles in [2, 3] {
        let place = Place::new(8.0, 8.0).positions(24).vehicles(vehicles);
        place.sweep("planner = \"fan\"\nlaps = 3").run_to_the_end();
    }
}

#[test]
fn all_gaps_of_a_sweep_are_driven() {
    let outcome = Place::new(12.0, 12.0).sweep("laps = 3").run_to_the_end();
    assert_eq!(outcome.log.matches("ground sees lap ").count(), 3);
    assert!(
        outcome.min_separation_m > Some(4.0),
        "gaps of at least 16 of 48 steps"
    );
}
