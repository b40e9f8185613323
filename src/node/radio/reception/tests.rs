//! What is news, and which samples follow of beacons that come in order, twice, late or not at all.

use proptest::prelude::*;
use tomoswarm_proto::{Deviation, Heading, Position, Progress};

use super::*;
use crate::geom::{Angle, Point};
use crate::node::tests_support::beacon;

const RUN: RunId = RunId(4);

fn at(at_s: f64) -> Time {
    Time::from_secs_f64(at_s)
}

fn reception() -> Reception {
    Reception::new(0.5)
}

/// Lets it hear a beacon at the datum; returns the samples, none of one that is no news.
fn hear(reception: &mut Reception, now_s: f64, beacon: Beacon) -> Vec<Sample> {
    hear_at(reception, now_s, beacon, 0.0)
}

fn hear_at(reception: &mut Reception, now_s: f64, beacon: Beacon, y_m: f64) -> Vec<Sample> {
    let own = Pose {
        at: Point::new(0.0, y_m),
        heading: Angle::default(),
        sd_m: 0.05,
    };
    let (now, heard) = (
        at(now_s),
        HeardBeacon {
            beacon,
            rssi_dbm: -61,
        },
    );
    let is_news = reception.is_news(now, &heard.beacon);
    if is_news {
        reception.take(now, &heard, Some(own.into()), Some(RUN))
    } else {
        Vec::new()
    }
}

/// Lets it hear beacons of vehicle 2 (start of its software, sequence), each sent from as many metres east as its
/// sequence; returns of which beacon each sample is, and whether that was heard.
fn samples(reception: &mut Reception, beacons: &[(u32, u32)]) -> Vec<(u32, bool)> {
    let one = |(boot, sequence): &(u32, u32)| {
        let beacon = Beacon {
            boot: Boot(*boot),
            ..beacon(2, *sequence, f64::from(*sequence), vec![])
        };
        hear(reception, 0.0, beacon)
    };
    let of = |sample: Sample| {
        (
            sample.transmitter_pose.at.x_m().round() as u32,
            sample.rssi_dbm.is_some(),
        )
    };
    beacons.iter().flat_map(one).map(of).collect()
}

#[test]
fn every_beacon_heard_is_a_sample_and_every_gap_a_miss() {
    let mut reception = reception();
    let beacons = [(7, 0.0), (10, 3.0)].map(|(sequence, x_m)| beacon(2, sequence, x_m, vec![]));
    let made: Vec<(u64, f64, Option<i16>)> = beacons
        .into_iter()
        .flat_map(|beacon| hear(&mut reception, 0.0, beacon))
        .map(|sample| {
            (
                sample.sequence,
                sample.transmitter_pose.at.x_m(),
                sample.rssi_dbm,
            )
        })
        .collect();
    assert_eq!(
        made,
        [
            (0, 0.0, Some(-61)),
            (1, 1.0, None),
            (2, 2.0, None),
            (3, 3.0, Some(-61))
        ]
    );
    assert_eq!(
        (
            reception.samples_made(RUN),
            reception.samples_made(RunId(5))
        ),
        (4, 0)
    );
}

#[test]
fn of_a_miss_both_ends_are_where_they_were_then() {
    let mut reception = reception();
    let receivers: Vec<f64> = [(0.0, 7, 0.0), (0.3, 10, 3.0)]
        .into_iter()
        .flat_map(|(now_s, sequence, y_m)| {
            hear_at(&mut reception, now_s, beacon(2, sequence, 5.0, vec![]), y_m)
        })
        .map(|sample| sample.receiver_pose.at.y_m())
        .collect();
    assert_eq!(receivers, [0.0, 1.0, 2.0, 3.0]);
}

#[test]
fn of_misses_on_a_way_that_may_have_had_a_corner_only_those_near_its_ends_are_placed() {
    let mut reception = reception();
    let made: Vec<f64> = [(0.0, 1, 0.0), (8.0, 9, 8.0)]
        .into_iter()
        .flat_map(|(now_s, sequence, y_m)| {
            hear_at(&mut reception, now_s, beacon(2, sequence, 5.0, vec![]), y_m)
        })
        .map(|sample| sample.receiver_pose.at.y_m())
        .collect();
    assert_eq!(made, [0.0, 1.0, 7.0, 8.0], "it faces along x");
    let ends = [0.0, 8.0].map(|x_m| PoseReport {
        at: Position::from_metres(x_m, 0.0, x_m),
        heading: Heading::from_radians(0.17),
        ..PoseReport::default()
    });
    let halfway = between(ends[0], ends[1], 0.5).expect("it drove on");
    assert_eq!(halfway.at, Position::from_metres(4.0, 0.0, 4.0));
    let turned = PoseReport {
        heading: Heading::from_radians(1.57),
        ..ends[1]
    };
    assert_eq!(between(ends[0], turned, 0.5), None);
}

#[test]
fn what_was_missed_before_it_was_measured_is_no_sample() {
    let mut reception = reception();
    let before = HeardBeacon {
        beacon: beacon(2, 1, 5.0, vec![]),
        rssi_dbm: -61,
    };
    reception.take(at(0.0), &before, Some(PoseReport::default()), None);
    let made = hear(&mut reception, 1.0, beacon(2, 9, 5.0, vec![]));
    assert_eq!(made.len(), 1);
    assert_eq!(
        hear(&mut reception, 1.2, beacon(2, 11, 5.0, vec![])).len(),
        2
    );
}

#[test]
fn nothing_is_measured_of_another_run_or_of_a_place_that_is_unknown_or_uncertain() {
    let good = || beacon(2, 1, 0.0, vec![]);
    let uncertain = PoseReport {
        at: Position::default(),
        sd: Deviation(600),
        ..PoseReport::default()
    };
    for (bad, expected) in [
        (good(), 1),
        (
            Beacon {
                progress: Progress {
                    run: RunId(5),
                    ..Progress::default()
                },
                ..good()
            },
            0,
        ),
        (
            Beacon {
                pose: None,
                ..good()
            },
            0,
        ),
        (
            Beacon {
                pose: Some(uncertain),
                ..good()
            },
            0,
        ),
    ] {
        assert_eq!(hear(&mut reception(), 0.0, bad).len(), expected);
    }
    let heard = HeardBeacon {
        beacon: good(),
        rssi_dbm: -61,
    };
    assert_eq!(reception().take(at(0.0), &heard, None, Some(RUN)), []);
    assert_eq!(
        reception().take(at(0.0), &heard, Some(PoseReport::default()), None),
        []
    );
}

#[test]
fn those_heard_lately_are_the_twelve_that_were_heard_last() {
    let mut reception = reception();
    for id in 2..=20 {
        // The higher the number the longer ago.
        hear(
            &mut reception,
            3.0 - 0.1 * f64::from(id),
            beacon(id, 1, 0.0, vec![]),
        );
    }
    assert_eq!(
        reception.heard_lately(at(3.0)),
        (2..=13).map(VehicleId).collect::<Vec<_>>()
    );
    assert_eq!(reception.heard_lately(at(7.55)), [2, 3, 4].map(VehicleId));
}

#[test]
fn a_doubled_beacon_makes_no_second_sample() {
    let heard = samples(
        &mut reception(),
        &[(1, 7), (1, 7), (1, 8), (1, 7), (1, 8), (1, 9)],
    );
    assert_eq!(heard, [(7, true), (8, true), (9, true)]);
}

#[test]
fn a_beacon_that_comes_after_its_successor_makes_no_second_sample_and_no_further_miss() {
    let heard = samples(&mut reception(), &[(1, 6), (1, 8), (1, 7), (1, 9)]);
    assert_eq!(
        heard,
        [(6, true), (7, false), (8, true), (9, true)],
        "7 was called missed already"
    );
}

#[test]
fn a_sequence_does_not_wrap() {
    let mut reception = reception();
    let sequences = [u32::MAX - 1, u32::MAX, 0, 1];
    let made: usize = sequences
        .map(|sequence| samples(&mut reception, &[(1, sequence)]).len())
        .iter()
        .sum();
    assert_eq!(made, 2, "after the last one there is none");
}

#[test]
fn a_late_beacon_of_an_earlier_start_hides_no_miss() {
    let heard = samples(&mut reception(), &[(1, 40), (2, 1), (1, 41), (2, 3)]);
    assert_eq!(heard, [(40, true), (1, true), (2, false), (3, true)]);
}

#[test]
fn a_sender_that_lost_its_count_of_starts_is_heard_again_once_it_has_left_the_ring() {
    let mut reception = reception();
    let of = |boot, sequence| Beacon {
        boot: Boot(boot),
        ..beacon(2, sequence, 0.0, vec![])
    };
    hear(&mut reception, 0.0, of(9, 500));
    assert!(!reception.is_news(at(5.0), &of(1, 1)));
    assert!(reception.is_news(at(5.1), &of(1, 2)));
}

proptest! {
    #[test]
    fn every_sequence_from_the_first_heard_to_the_newest_is_one_sample(
        sequences in prop::collection::vec(1..60u32, 1..80),
    ) {
        let beacons: Vec<(u32, u32)> = sequences.iter().map(|sequence| (1, *sequence)).collect();
        let made = samples(&mut reception(), &beacons);
        let (first, newest) = (sequences[0], *sequences.iter().filter(|it| **it >= sequences[0]).max().unwrap());
        let of: Vec<u32> = made.iter().map(|(sequence, _)| *sequence).collect();
        prop_assert_eq!(of, (first..=newest).collect::<Vec<_>>());
        for (sequence, is_heard) in made {
            prop_assert!(!is_heard || sequences.contains(&sequence));
        }
    }
}
