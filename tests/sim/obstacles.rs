//! Things that stand on the ring, beside it, at its corners and across it: they are driven around, what they cover
//! is given up, and a ring that is closed off is said to be.

use crate::place::{Block, Place, tail};

/// A small courtyard with things in it.
fn courtyard(blocks: &[Block]) -> Place {
    // Homes that none of the blocks below covers.
    let place = Place::new(12.0, 12.0).home(5, (2.0, -1.2));
    blocks
        .iter()
        .fold(place, |place, block| place.block(*block))
}

/// Sweeps with several fleets and seeds, and claims that every sweep was safe and ended.
fn ends(blocks: &[Block]) {
    for (vehicles, seed) in [(2, 1), (2, 2), (3, 3), (5, 4)] {
        courtyard(blocks)
            .vehicles(vehicles)
            .seed(seed)
            .run_to_the_end();
    }
}

#[test]
fn a_box_on_the_ring_is_driven_around() {
    ends(&[(6.0, 0.0, 1.0, 1.0)]);
}

#[test]
fn a_box_half_a_metre_beside_the_ring_holds_nobody_up() {
    ends(&[(6.0, 0.9, 1.0, 1.0)]);
    ends(&[(12.9, 6.0, 1.0, 1.0)]);
}

#[test]
fn a_box_on_a_corner_is_driven_around() {
    ends(&[(12.0, 12.0, 0.8, 0.8)]);
}

#[test]
fn boxes_on_all_corners_are_driven_around() {
    ends(&[
        (0.0, 0.0, 0.6, 0.6),
        (12.0, 0.0, 0.6, 0.6),
        (12.0, 12.0, 0.6, 0.6),
        (0.0, 12.0, 0.6, 0.6),
    ]);
}

#[test]
fn a_wall_across_the_ring_is_driven_around_on_the_side_that_is_open() {
    ends(&[(6.0, -1.0, 0.3, 4.0)]);
    ends(&[(11.0, 6.0, 4.0, 0.3)]);
}

#[test]
fn thin_poles_are_seen_in_time() {
    ends(&[
        (6.0, 0.0, 0.1, 0.1),
        (12.0, 3.0, 0.1, 0.1),
        (3.0, 12.3, 0.1, 0.1),
    ]);
}

#[test]
fn a_wall_beside_a_home_is_left_behind() {
    ends(&[(-1.0, -0.3, 1.0, 0.3)]);
}

#[test]
fn who_drove_into_a_dead_end_comes_out_of_it() {
    for (vehicles, seed) in [(2, 1), (2, 2), (3, 3)] {
        courtyard(&[
            (6.0, 1.0, 0.3, 3.0),
            (4.0, 1.5, 4.0, 0.3),
            (4.0, -1.5, 4.0, 0.3),
        ])
        .vehicles(vehicles)
        .seed(seed)
        .run_to_the_end();
    }
}

#[test]
fn stops_under_a_long_box_are_given_up_and_the_sweep_ends() {
    for (vehicles, seed) in [(2, 1), (3, 2), (5, 3)] {
        let outcome = courtyard(&[(6.0, 0.0, 3.2, 0.8)])
            .vehicles(vehicles)
            .seed(seed)
            .run_to_the_end();
        let stood_inside = outcome.tracks.iter().flat_map(|(_, track)| track);
        assert!(
            stood_inside
                .clone()
                .all(|at| (at.x_m - 6.0).abs() > 1.8 || at.y_m.abs() > 0.6)
        );
        assert!(outcome.samples > 500, "{} samples", outcome.samples);
    }
}

#[test]
fn a_ring_that_is_closed_off_from_fence_to_fence_ends_in_words() {
    for (vehicles, seed) in [(2, 1), (3, 2), (4, 3), (6, 1)] {
        let outcome = courtyard(&[(6.0, 1.0, 0.3, 8.0), (6.0, 9.0, 0.3, 12.0)])
            // Nobody begins inside the wall.
            .home(6, (8.0, 13.2))
            .vehicles(vehicles)
            .seed(seed)
            .root("end = \"hold\"\nuntil_s = 6000.0")
            .run_safely();
        assert!(
            !outcome.finished && outcome.log.contains("has found no path"),
            "{}",
            tail(&outcome.log)
        );
        let reason = outcome.failure.unwrap_or_default();
        assert!(reason.contains("cannot be"), "{reason}");
        let said_s = |words: &str| {
            let line = outcome.log.lines().rfind(|line| line.contains(words))?;
            line.split(' ').next()?.parse::<f64>().ok()
        };
        let from_s = said_s("has done stop").unwrap_or(0.0);
        let took_s = said_s("cannot end run").expect("it is said") - from_s;
        // Stops that are given up do not count, nor does it that somebody looks for a way where nobody was.
        assert!(took_s <= 300.0, "{took_s} s after the last stop");
    }
}
