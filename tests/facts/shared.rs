//! The shared collection of facts: where it lies, and what its prose says beyond its inputs.

use std::path::Path;

use serde_json::{Value, json};

use super::fact::Fact;

/// Returns a text of the shared folder beside the project; `None`, said so, when it is not there.
pub fn shared_text(path: &str) -> Option<String> {
    let full = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared")
        .join(path);
    let text = std::fs::read_to_string(&full).ok();
    if text.is_none() {
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: {} is not there\n", full.display()),
        );
    }
    text
}

/// Adds to a fact's inputs what only its description says, under the names of our own collection.
pub fn complete(fact: &mut Fact, all: &[Fact]) {
    let (prose, given) = (fact.description.clone(), fact.inputs.clone());
    let mut add = |key: &str, value: Value| {
        fact.inputs.entry(key.to_owned()).or_insert(value);
    };
    match fact.area.as_str() {
        "servo" => {
            let (values, pulses) = (
                range_after(&prose, "range ("),
                range_after(&prose, "pwm range ("),
            );
            values
                .into_iter()
                .for_each(|values| add("servo_values", values));
            pulses
                .into_iter()
                .for_each(|pulses| add("servo_pwm", pulses));
        }
        "memory-map" => {
            add("size_m", json!(100));
            add("cells_per_m", json!(5));
        }
        "distance-sensor" if given.contains_key("pos_ne") => {
            add("blocks", json!([[100, 0], [0, 100], [-100, 0], [0, -100]]));
            add("block_side", json!(80));
            add("height", json!(10));
            add("pole", json!([40, -10, 2.5]));
        }
        "geometry" if fact.expected.contains_key("distance") && given.contains_key("north") => {
            add(
                "metric",
                json!(if prose.contains("Manhattan") {
                    "grid"
                } else {
                    "straight"
                }),
            );
        }
        "astar" if given.contains_key("turning_cost_per_rad") => {
            add("cells", json!(10));
            add("obstacles", json!("middle"));
        }
        "weights" if fact.expected.contains_key("accepted") => add("size", json!([4, 4])),
        "planning-objective" => {
            // The vehicles' way was found by an assignment that is not kept; the fact about it has the same pairs.
            let pairs = given.get("pairs");
            let assigned = all.iter().find(|other| {
                other.area == "greedy-assignment" && other.inputs.get("pairs") == pairs
            });
            let travel = assigned.and_then(|other| other.expected.get("total_distance").cloned());
            travel.into_iter().for_each(|travel| add("travel", travel));
        }
        _ => {}
    }
}

/// Reads "(a, b)" behind some words of a text.
fn range_after(text: &str, words: &str) -> Option<Value> {
    let begin = text.find(words)? + words.len();
    let inner = &text[begin..begin + text[begin..].find(')')?];
    let numbers: Option<Vec<f64>> = inner
        .split(',')
        .map(|number| number.trim().parse().ok())
        .collect();
    numbers
        .filter(|numbers| numbers.len() == 2)
        .map(Value::from)
}
