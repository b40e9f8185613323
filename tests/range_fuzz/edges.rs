//! The reader of an HC-SR04's edges under edges, triggers and wakes of any kind.

use std::time::Duration;

use tomoswarm::hw::RangeReading;
use tomoswarm::hw::echo_edges::{EchoAnswer, EchoEdges, Edge};
use tomoswarm::time::Time;

use crate::chance::Chance;

/// No echo is farther, metres: 25 ms at 60 °C.
const FARTHEST_M: f64 = 4.6;

/// Draws a step in time, often one that decides something, nanoseconds; at times backwards.
fn step_ns(chance: &mut Chance) -> i64 {
    let decisive_us = [
        99, 100, 101, 999, 1000, 1001, 4999, 5000, 5001, 24_999, 25_000, 59_999, 60_000, 60_001,
    ];
    match chance.below(8) {
        0..3 => chance.one_of(&decisive_us) * 1000 + chance.below(3) as i64 - 1,
        3 => -(chance.below(70_000_000) as i64),
        4 => 0,
        _ => chance.below(70_000_000) as i64,
    }
}

/// What came since the last trigger.
#[derive(Default)]
struct Since {
    trigger: Option<Time>,
    edges: Vec<Edge>,
    readings: usize,
}

impl Since {
    /// Checks an answer: a reading is the first whole pulse after a trigger, and nothing is missing before it.
    fn check(&mut self, answer: Option<EchoAnswer>, before: Option<u32>) {
        let Some(EchoAnswer::Reading(reading)) = answer else {
            return;
        };
        self.readings += 1;
        assert_eq!(self.readings, 1, "a trigger has one reading");
        let trigger = self.trigger.expect("nobody asked");
        let [rise, fall, ..] = self.edges[..] else {
            panic!("no pulse")
        };
        let width = fall.at.since(rise.at);
        assert!(rise.is_rising && !fall.is_rising && rise.at >= trigger);
        assert!(rise.at.since(trigger) <= Duration::from_millis(5));
        assert!(before.is_none_or(|before| rise.number == before.wrapping_add(1)));
        assert_eq!(fall.number, rise.number.wrapping_add(1));
        match reading {
            RangeReading::Range(range_m) => {
                assert!(width < Duration::from_millis(25) && (0.0..FARTHEST_M).contains(&range_m));
            }
            RangeReading::Nothing => {
                assert!((Duration::from_millis(25)..=Duration::from_millis(60)).contains(&width));
            }
        }
    }
}

/// Returns how many events there were.
pub fn any_edges(chance: &mut Chance) -> u64 {
    let mut edges = EchoEdges::new(chance.between(-40.0, 60.0));
    let (mut now_ns, mut number) = (chance.below(1 << 40) as i64, chance.below(1 << 32) as u32);
    let (mut since, mut before, mut last) = (Since::default(), None, None);
    let (mut answers, mut triggers) = (0, 0_u64);
    let events = chance.below(30);
    for _ in 0..events {
        now_ns = (now_ns + step_ns(chance)).max(0);
        let now = Time::from_nanos(now_ns as u64);
        let answer = match chance.below(6) {
            0 => {
                triggers += 1;
                let is_high = chance.happens(0.2);
                (since, before) = (Since::default(), last);
                since.trigger = (!is_high).then_some(now);
                edges.trigger(now, is_high)
            }
            1 => edges.wake(now),
            2 if chance.happens(0.1) => {
                edges.restart();
                (since, before, last) = (Since::default(), None, None);
                None
            }
            _ => {
                number = number.wrapping_add(if chance.happens(0.05) { 2 } else { 1 });
                let is_rising = match chance.happens(0.1) {
                    true => chance.happens(0.5),
                    false => since.edges.last().is_none_or(|edge| !edge.is_rising),
                };
                let edge = Edge {
                    at: now,
                    is_rising,
                    number,
                };
                last = Some(number);
                since.edges.push(edge);
                edges.edge(edge)
            }
        };
        answers += u64::from(answer.is_some());
        since.check(answer, before);
        assert!(
            edges
                .deadline()
                .is_none_or(|deadline| deadline <= Time::from_nanos(1 << 50))
        );
    }
    let answer = edges.wake(Time::NEVER);
    since.check(answer, before);
    assert!(edges.deadline().is_none(), "it is quiet in the end");
    answers += u64::from(answer.is_some());
    assert!(answers <= triggers, "an answer is of a trigger");
    let faults = edges.faults();
    assert!(faults.silent + faults.stuck <= triggers);
    // The last one is the wake at the end.
    events as u64 + 1
}
