//! The echo line of an HC-SR04: what each file of `tests/data/edges` did is read as it says, however late its edges are taken.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::fs;
use std::path::Path;
use std::time::Duration;

use tomoswarm::hw::RangeReading;
use tomoswarm::hw::echo_edges::{EchoAnswer, EchoEdges, Edge};
use tomoswarm::hw::edge_recording::{EdgeRecording, RecordedPing};
use tomoswarm::time::Time;

/// When edges are taken.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Taken {
    /// As they come; what is due between them is said before.
    AtOnce,
    /// All together, when the line is quiet.
    Late,
}

/// Returns what is wrong with an answer, if it is.
fn mistake(answer: EchoAnswer, expected: &str) -> Option<String> {
    let is_right = match (answer, expected) {
        (EchoAnswer::Reading(RangeReading::Nothing), word) => word == "nothing",
        (EchoAnswer::Reading(RangeReading::Range(range_m)), word) => word
            .parse()
            .is_ok_and(|expected_m: f64| (range_m - expected_m).abs() <= 0.001),
        (EchoAnswer::Silent, word) => word == "silent",
        (EchoAnswer::Stuck, word) => word == "stuck",
        (EchoAnswer::Glitch, word) => word == "glitch",
    };
    (!is_right).then(|| format!("{answer:?}, not {expected}"))
}

/// Plays a file; returns how many answers were as it says.
fn play(text: &str, taken: Taken) -> Result<usize, String> {
    let (mut edges, mut answers, mut right) = (EchoEdges::new(20.0), Vec::new(), 0);
    let mut now = Time::ZERO;
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |index: usize| words[index].parse::<u64>().unwrap();
        match words[0] {
            "air" => edges = EchoEdges::new(words[1].parse().unwrap()),
            "trigger" => {
                now = Time::from_nanos(number(1));
                answers.extend(edges.trigger(now, words.get(2) == Some(&"high")));
            }
            "rise" | "fall" => {
                now = Time::from_nanos(number(1));
                if taken == Taken::AtOnce {
                    answers.extend(edges.wake(now));
                }
                answers.extend(edges.edge(Edge {
                    at: now,
                    is_rising: words[0] == "rise",
                    number: number(2).try_into().unwrap(),
                }));
            }
            "expect" => {
                answers.extend(edges.wake(now + Duration::from_millis(100)));
                let expected = &words[1..];
                if answers.len() != expected.len() {
                    return Err(format!("{answers:?}, not {expected:?}"));
                }
                let mistakes = answers.drain(..).zip(expected);
                if let Some(wrong) = mistakes
                    .filter_map(|(is, wanted)| mistake(is, wanted))
                    .next()
                {
                    return Err(wrong);
                }
                right += expected.len();
            }
            other => return Err(format!("{other} is no word")),
        }
    }
    Ok(right)
}

#[test]
fn every_fixture_is_read_as_it_says_whenever_its_edges_are_taken() {
    let folder = Path::new("tests/data/edges");
    let mut files = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|ending| ending != "txt") {
            continue;
        }
        files += 1;
        let text = fs::read_to_string(&path).unwrap();
        for taken in [Taken::AtOnce, Taken::Late] {
            let right = play(&text, taken);
            assert!(
                right.as_ref().is_ok_and(|count| *count > 0),
                "{path:?}, {taken:?}: {right:?}"
            );
        }
    }
    assert!(files >= 40, "{files}");
}

#[test]
fn what_is_recorded_from_a_sensor_is_read_as_it_says() {
    let mut number = 0;
    let mut edge = |at_us: u64, is_rising| {
        number += 1;
        Edge {
            at: Time::from_nanos(at_us * 1000),
            is_rising,
            number,
        }
    };
    let mut ping = |at_us: u64, edges_us: &[u64]| RecordedPing {
        unasked: Vec::new(),
        at: Time::from_nanos(at_us * 1000),
        is_high: false,
        edges: edges_us
            .iter()
            .enumerate()
            .map(|(index, at_us)| edge(*at_us, index % 2 == 0))
            .collect(),
    };
    let mut pings = vec![
        ping(100_000, &[100_500, 112_148]),
        ping(300_000, &[300_500, 338_500]),
        ping(500_000, &[]),
        ping(700_000, &[700_500, 700_530]),
        ping(900_000, &[900_500]),
        ping(1_100_000, &[]),
    ];
    pings[5].is_high = true;
    let recording = EdgeRecording {
        sensor: "GPIO23 and GPIO24".to_owned(),
        air_temperature_c: 12.5,
        pings,
    };
    for taken in [Taken::AtOnce, Taken::Late] {
        assert_eq!(play(&recording.to_text(), taken), Ok(6), "{taken:?}");
    }
}
