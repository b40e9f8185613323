//! What the echo line of an HC-SR04 did, as a text that `tests/edges.rs` reads: pings, stamped edges, and what they were
//! taken for. Whoever has a sensor that is read wrongly can send it in. Opens no line.

use std::fmt::Write as _;
use std::time::Duration;

use super::RangeReading;
use super::echo_edges::{EchoAnswer, EchoEdges, Edge};
use crate::time::Time;

/// The line is quiet for so long before the next trigger.
pub const QUIET: Duration = Duration::from_millis(100);

/// What the echo line of one sensor did.
#[derive(Clone, PartialEq, Debug)]
pub struct EdgeRecording {
    /// Which sensor, in words, for people.
    pub sensor: String,
    /// Temperature of the air, °C.
    pub air_temperature_c: f64,
    /// The pings, in order.
    pub pings: Vec<RecordedPing>,
}

/// A trigger and what came of it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RecordedPing {
    /// Edges since the last one that nobody asked for.
    pub unasked: Vec<Edge>,
    /// When the sensor was triggered.
    pub at: Time,
    /// Whether the line was high then; such a sensor is not triggered.
    pub is_high: bool,
    /// What the line did until it was quiet; its beginning alone where it never was.
    pub edges: Vec<Edge>,
}

impl EdgeRecording {
    /// Returns what the pings were taken for, each with all that was said of it.
    pub fn answers(&self) -> Vec<Vec<EchoAnswer>> {
        let mut edges = EchoEdges::new(self.air_temperature_c);
        self.pings
            .iter()
            .map(|ping| {
                let mut answers = Vec::new();
                for edge in &ping.unasked {
                    answers.extend(edges.edge(*edge));
                }
                answers.extend(edges.trigger(ping.at, ping.is_high));
                let mut last = ping.at;
                for edge in &ping.edges {
                    answers.extend(edges.edge(*edge));
                    last = last.max(edge.at);
                }
                answers.extend(edges.wake(last + QUIET));
                answers
            })
            .collect()
    }

    /// Returns it as the text of a file.
    pub fn to_text(&self) -> String {
        let mut text = format!(
            "# recorded from {}\nair {:?}\n",
            self.sensor, self.air_temperature_c
        );
        for (ping, answers) in self.pings.iter().zip(self.answers()) {
            ping.unasked.iter().for_each(|edge| write(&mut text, edge));
            let high = if ping.is_high { " high" } else { "" };
            // Writing to a string cannot fail.
            let _ = writeln!(text, "trigger {}{high}", ping.at.as_nanos());
            ping.edges.iter().for_each(|edge| write(&mut text, edge));
            let words: Vec<String> = answers.into_iter().map(in_words).collect();
            let _ = writeln!(text, "expect {}", words.join(" "));
        }
        text
    }
}

fn write(text: &mut String, edge: &Edge) {
    let word = if edge.is_rising { "rise" } else { "fall" };
    // As above.
    let _ = writeln!(text, "{word} {} {}", edge.at.as_nanos(), edge.number);
}

/// Returns an answer as a file has it.
pub fn in_words(answer: EchoAnswer) -> String {
    match answer {
        EchoAnswer::Reading(RangeReading::Range(range_m)) => format!("{range_m:.4}"),
        EchoAnswer::Reading(RangeReading::Nothing) => "nothing".to_owned(),
        EchoAnswer::Silent => "silent".to_owned(),
        EchoAnswer::Stuck => "stuck".to_owned(),
        EchoAnswer::Glitch => "glitch".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edge(at_us: u64, is_rising: bool, number: u32) -> Edge {
        Edge {
            at: Time::from_nanos(at_us * 1000),
            is_rising,
            number,
        }
    }

    #[test]
    fn pings_are_written_with_what_they_were_taken_for() {
        let ping = |at_us: u64, edges: Vec<Edge>| RecordedPing {
            unasked: Vec::new(),
            at: Time::from_nanos(at_us * 1000),
            is_high: false,
            edges,
        };
        let mut stuck = ping(900_000, Vec::new());
        stuck.is_high = true;
        let mut unasked = ping(700_000, Vec::new());
        unasked.unasked = vec![edge(600_000, true, 5), edge(600_500, false, 6)];
        let recording = EdgeRecording {
            sensor: "GPIO23 and GPIO24".to_owned(),
            air_temperature_c: 20.0,
            pings: vec![
                ping(
                    100_000,
                    vec![edge(100_500, true, 1), edge(106_324, false, 2)],
                ),
                ping(
                    300_000,
                    vec![edge(300_500, true, 3), edge(338_500, false, 4)],
                ),
                unasked,
                stuck,
            ],
        };
        let expected = "# recorded from GPIO23 and GPIO24\nair 20.0\n\
            trigger 100000000\nrise 100500000 1\nfall 106324000 2\nexpect 1.0000\n\
            trigger 300000000\nrise 300500000 3\nfall 338500000 4\nexpect nothing\n\
            rise 600000000 5\nfall 600500000 6\ntrigger 700000000\nexpect silent\n\
            trigger 900000000 high\nexpect stuck\n";
        assert_eq!(recording.to_text(), expected);
    }
}
