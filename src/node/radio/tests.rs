//! The radio as a whole: a ring of radios that hear each other, and what one says of what it hears.

use std::collections::BTreeMap;
use std::time::Duration;

use super::super::tests_support::{beacon, own_state, settings};
use super::*;
use tomoswarm_proto::Boot;

/// Lets radios that hear each other perfectly talk for a while; returns who spoke when.
fn talk(ids: &[u8], until: Time) -> Vec<(Time, u8, Vec<Out>)> {
    let mut radios: Vec<Radio> = ids.iter().map(|id| Radio::new(settings(*id))).collect();
    let mut spoken = Vec::new();
    loop {
        let due = radios
            .iter()
            .map(|radio| radio.deadline().unwrap().at)
            .min()
            .unwrap();
        if due > until {
            return spoken;
        }
        let who = radios
            .iter()
            .position(|radio| radio.deadline().unwrap().at == due)
            .unwrap();
        let mut out = Vec::new();
        for (radio, id) in radios.iter_mut().zip(ids) {
            radio
                .handle(due, In::State(own_state(f64::from(*id), 0.0)), &mut out)
                .unwrap();
            let progress = Progress {
                run: RunId(1),
                ..Progress::default()
            };
            radio.handle(due, In::Progress(progress), &mut out).unwrap();
        }
        radios[who].wake(due, &mut out).unwrap();
        let Some(Out::Transmit(beacon)) = out.pop() else {
            continue;
        };
        for (index, radio) in radios
            .iter_mut()
            .enumerate()
            .filter(|(index, _)| *index != who)
        {
            let heard = HeardBeacon {
                beacon: beacon.clone(),
                rssi_dbm: -50,
            };
            let mut output = Vec::new();
            radio
                .handle(
                    due + Duration::from_millis(2),
                    In::Heard(heard),
                    &mut output,
                )
                .unwrap();
            spoken.push((due, ids[index], output));
        }
        spoken.push((due, ids[who], vec![Out::Transmit(beacon)]));
    }
}

fn speakers(spoken: &[(Time, u8, Vec<Out>)]) -> Vec<u8> {
    let sent =
        |(_, id, out): &(Time, u8, Vec<Out>)| matches!(out[..], [Out::Transmit(_)]).then_some(*id);
    spoken.iter().filter_map(sent).collect()
}

/// Lets radios talk over air on which two that overlap are lost; returns who was heard by all in each second.
fn talk_on_air(
    ids: &[u8],
    seconds: usize,
    successor: Option<Duration>,
) -> Vec<BTreeMap<u8, usize>> {
    let airtime = Duration::from_millis(4);
    let radio = |id: &u8| {
        let mut settings = settings(*id);
        settings.radio.successor = successor;
        Radio::new(settings)
    };
    let mut radios: Vec<Radio> = ids.iter().map(radio).collect();
    let mut air: Vec<(Time, usize, Beacon)> = Vec::new();
    let mut heard = vec![BTreeMap::new(); seconds];
    loop {
        let due = radios
            .iter()
            .map(|radio| radio.deadline().unwrap().at)
            .min()
            .unwrap();
        let ends = air
            .iter()
            .map(|(start, ..)| *start + airtime)
            .min()
            .filter(|end| *end <= due);
        let now = ends.unwrap_or(due);
        let Some(count) = heard.get_mut(now.as_secs_f64() as usize) else {
            return heard;
        };
        if ends.is_some() {
            let (start, who, beacon) = air.remove(0);
            let overlapped = air.iter().any(|(other, ..)| *other < start + airtime);
            let lost = overlapped || beacon.power_dbm == i8::MIN;
            if overlapped {
                // The other one is lost as well.
                air.iter_mut()
                    .for_each(|(_, _, other)| other.power_dbm = i8::MIN);
            }
            if !lost {
                *count.entry(ids[who]).or_default() += 1;
                for (radio, _) in radios
                    .iter_mut()
                    .zip(ids)
                    .filter(|(_, id)| **id != ids[who])
                {
                    let heard = HeardBeacon {
                        beacon: beacon.clone(),
                        rssi_dbm: -50,
                    };
                    radio
                        .handle(now, In::Heard(heard), &mut Vec::new())
                        .unwrap();
                }
            }
            continue;
        }
        let who = radios
            .iter()
            .position(|radio| radio.deadline().unwrap().at == due)
            .unwrap();
        let mut out = Vec::new();
        radios[who]
            .handle(
                now,
                In::State(own_state(f64::from(ids[who]), 0.0)),
                &mut out,
            )
            .unwrap();
        radios[who].wake(now, &mut out).unwrap();
        if let Some(Out::Transmit(beacon)) = out.pop() {
            air.push((now, who, beacon));
        }
    }
}

#[test]
fn a_ring_forms_although_overlapping_beacons_are_lost() {
    check_ring(None, 14);
}

#[test]
fn a_ring_whose_successors_do_not_wait_for_a_slot_forms_too_and_is_quick() {
    check_ring(Some(Duration::from_millis(3)), 80);
}

/// Checks that everybody is heard in every second but the first, nobody seldom, and that so many beacons are.
fn check_ring(successor: Option<Duration>, a_second: usize) {
    for ids in [
        &[1, 2][..],
        &[1, 2, 3],
        &[1, 2, 3, 4],
        &[3, 4, 9, 200, 201],
        &[1, 2, 3, 4, 5, 6, 7, 8],
    ] {
        let heard = talk_on_air(ids, 12, successor);
        for second in &heard[1..] {
            assert_eq!(
                second.len(),
                ids.len(),
                "of {ids:?} only {second:?} are heard"
            );
            let (least, most) = (
                second.values().min().unwrap(),
                second.values().max().unwrap(),
            );
            assert!(
                *least * 2 >= *most,
                "of {ids:?} some are heard seldom: {second:?}"
            );
            assert!(
                second.values().sum::<usize>() >= a_second,
                "the ring of {ids:?} is slow: {second:?}"
            );
        }
    }
}

#[test]
fn members_speak_in_turn() {
    let spoken = talk(&[2, 5, 9], Time::from_secs_f64(3.0));
    let order = speakers(&spoken);
    let steady = &order[order.len() - 9..];
    for three in steady.windows(3) {
        let mut sorted = three.to_vec();
        sorted.sort_unstable();
        assert_eq!(sorted, [2, 5, 9], "{order:?}");
    }
    assert!(order.len() > 45, "{} beacons in 3 s", order.len());
}

#[test]
fn a_lone_radio_keeps_speaking() {
    assert!(speakers(&talk(&[3], Time::from_secs_f64(1.0))).len() >= 8);
}

fn hear(radio: &mut Radio, now_s: f64, beacon: Beacon) -> Vec<Out> {
    let mut out = Vec::new();
    let heard = HeardBeacon {
        beacon,
        rssi_dbm: -61,
    };
    radio
        .handle(Time::from_secs_f64(now_s), In::Heard(heard), &mut out)
        .unwrap();
    out
}

#[test]
fn a_dead_radio_is_not_named_any_more() {
    let mut radios = [Radio::new(settings(1)), Radio::new(settings(2))];
    let everyone = (0..=255).map(VehicleId).collect();
    hear(&mut radios[0], 0.1, beacon(9, 1, 0.0, everyone));
    let mut last = Vec::new();
    for tick in 1..400 {
        let now_s = 0.1 * f64::from(tick);
        for who in 0..2 {
            let beacon = next_beacon(&mut radios[who], now_s);
            last = beacon.members.clone();
            hear(&mut radios[1 - who], now_s + 0.05, beacon);
        }
    }
    assert_eq!(last, [VehicleId(1)]);
}

#[test]
fn a_beacon_says_whom_it_heard_and_how_the_vehicle_is() {
    let mut radio = Radio::new(settings(1));
    hear(&mut radio, 0.1, beacon(4, 1, 0.0, vec![]));
    let output = next_beacon(&mut radio, 0.2);
    assert_eq!(
        (output.sender, output.boot, &output.members[..]),
        (VehicleId(1), Boot(1), &[VehicleId(4)][..])
    );
    assert!(output.is_at_rest && output.is_armed && !output.is_airborne);
}

#[test]
fn only_in_the_run_that_is_measured_what_is_heard_or_missed_is_a_sample() {
    for (run, expected) in [(None, 0), (Some(RunId(4)), 4), (Some(RunId(5)), 0)] {
        let mut radio = measuring();
        radio
            .handle(Time::ZERO, In::Measure(run), &mut Vec::new())
            .unwrap();
        let heard = [7, 10].map(|sequence| hear(&mut radio, 0.1, beacon(2, sequence, 0.0, vec![])));
        let of_run = |out: &&Out| matches!(out, Out::Sample(of, _) if Some(*of) == run);
        assert_eq!(
            heard.iter().flatten().filter(of_run).count(),
            expected,
            "{run:?}"
        );
        assert_eq!(radio.samples_made(RunId(4)), expected as u64);
    }
}

#[test]
fn a_beacon_without_a_place_is_heard_and_measures_nothing() {
    let mut radio = measuring();
    let out = hear(
        &mut radio,
        0.1,
        Beacon {
            pose: None,
            ..beacon(2, 1, 0.0, vec![])
        },
    );
    let [Out::Peer(sighting)] = &out[..] else {
        panic!("{out:?}")
    };
    assert_eq!(
        (sighting.progress.vehicle, sighting.pose),
        (VehicleId(2), None)
    );
    assert_eq!(next_beacon(&mut radio, 0.2).members, [VehicleId(2)]);
    let out = hear(&mut radio, 0.2, beacon(2, 2, 3.0, vec![]));
    assert_eq!(
        out.iter()
            .filter(|out| matches!(out, Out::Sample(..)))
            .count(),
        1
    );
}

/// A radio that measures at rest, in run 4.
fn measuring() -> Radio {
    let mut radio = Radio::new(settings(1));
    for input in [In::Measure(Some(RunId(4))), In::State(own_state(0.0, 0.0))] {
        radio.handle(Time::ZERO, input, &mut Vec::new()).unwrap();
    }
    radio
}

#[test]
fn a_doubled_beacon_does_not_restart_the_wait_for_the_own_slot() {
    let mut radio = measuring();
    hear(&mut radio, 1.0, beacon(2, 7, 0.0, vec![VehicleId(1)]));
    let slot = radio.deadline();
    assert!(hear(&mut radio, 1.02, beacon(2, 7, 0.0, vec![VehicleId(1)])).is_empty());
    assert_eq!(radio.deadline(), slot);
}

/// Lets it say its next beacon, at rest at the datum.
fn next_beacon(radio: &mut Radio, now_s: f64) -> Beacon {
    let (now, mut out) = (Time::from_secs_f64(now_s), Vec::new());
    radio
        .handle(now, In::State(own_state(0.0, 0.0)), &mut out)
        .unwrap();
    radio.wake(now, &mut out).unwrap();
    let Some(Out::Transmit(beacon)) = out.pop() else {
        panic!("silent")
    };
    beacon
}

#[test]
fn a_beacon_that_was_not_sent_gives_its_number_to_the_next_one() {
    let mut radio = Radio::new(settings(1));
    assert_eq!(
        [0.0, 0.1].map(|now_s| next_beacon(&mut radio, now_s).sequence),
        [1, 2]
    );
    radio
        .handle(Time::ZERO, In::Unsent(2), &mut Vec::new())
        .unwrap();
    assert_eq!(
        [0.2, 0.3].map(|now_s| next_beacon(&mut radio, now_s).sequence),
        [2, 3]
    );
}
