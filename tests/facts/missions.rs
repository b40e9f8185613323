//! Facts about the measurement patterns; points are (north, east). The tracks are those of the first vehicle, unless a
//! fact names the other one.

use serde_json::{Value, json};
use tomoswarm::geom::Point;
use tomoswarm::sweep::{Pattern, PatternKind, square};

use super::fact::{Checked, Fact};

fn pattern(fact: &Fact, kind: PatternKind) -> Result<Pattern, String> {
    let size = usize::try_from(fact.whole("size")?).map_err(|error| error.to_string())?;
    Pattern::new(kind, size).map_err(|error| error.to_string())
}

/// Returns the track of the vehicle that a fact is about.
fn track(fact: &Fact, pattern: Pattern) -> Result<Vec<Value>, String> {
    let index = match fact
        .has("vehicle")
        .then(|| fact.whole("vehicle"))
        .transpose()?
    {
        None | Some(1) => 0,
        Some(2) => 1,
        Some(number) => return Err(format!("vehicle {number} of two")),
    };
    Ok(pattern
        .steps()
        .map(|both| json!([both[index].north, both[index].east]))
        .collect())
}

/// Returns a part of a track in the form in which a fact expects it: as places, or as a stay.
fn as_expected(expected: &Value, part: &[Value]) -> Value {
    if expected.is_string() {
        waits(part)
    } else {
        json!(part)
    }
}

/// Returns how often the first point of a track stands there, as a fact writes it.
fn waits(track: &[Value]) -> Value {
    let count = track
        .iter()
        .take_while(|point| Some(*point) == track.first())
        .count();
    let Some(first) = track.first() else {
        return Value::Null;
    };
    Value::from(format!("{count} x ({},{})", first[0], first[1]))
}

/// Checks a fact about the calibration. A round is as long as the one that is given place by place.
pub fn check_calibrate(fact: &Fact) -> Checked {
    let pattern = pattern(fact, PatternKind::Calibrate)?;
    let track = track(fact, pattern)?;
    let rounds = ["first_round", "second_round", "third_round"];
    let given = |name: &&str| {
        fact.output(name)
            .ok()
            .filter(|round| round.is_array() || round.is_string())
    };
    let length = rounds
        .iter()
        .filter_map(given)
        .filter_map(|round| round.as_array().map(Vec::len))
        .max();
    let parts: Vec<&[Value]> = track.chunks(length.unwrap_or(1)).collect();
    for (name, part) in rounds.iter().zip(&parts) {
        if let Some(expected) = given(name) {
            fact.expect(name, as_expected(expected, part))?;
        }
    }
    if fact.output("rounds").is_ok() {
        fact.expect("rounds", json!(parts.len()))?;
        fact.expect("total", json!(pattern.step_count()))?;
    }
    Ok(())
}

/// Checks a fact about the fan.
pub fn check_fan(fact: &Fact) -> Checked {
    let track = track(fact, pattern(fact, PatternKind::Fan)?)?;
    let round = fact.output("first_round")?.as_array().map_or(0, Vec::len);
    let (first, rest) = track.split_at(round.min(track.len()));
    fact.expect("first_round", json!(first))?;
    fact.expect("then", waits(rest))?;
    // A drive ends where the vehicle begins to stand: the stays are half of the rounds.
    let stands = track
        .windows(3)
        .filter(|three| three[0] != three[1] && three[1] == three[2])
        .count();
    fact.expect("rounds", json!(2 * stands))
}

/// Checks a fact about the fan along opposite sides.
pub fn check_fan_straight(fact: &Fact) -> Checked {
    fact.expect(
        "waypoints",
        json!(track(fact, pattern(fact, PatternKind::FanStraight)?)?),
    )
}

/// Checks a fact about the square.
pub fn check_square(fact: &Fact) -> Checked {
    let corners =
        square(Point::default(), fact.number("size")?).map_err(|error| error.to_string())?;
    fact.expect(
        "waypoints",
        corners.iter().map(|at| json!([at.y_m, at.x_m])).collect(),
    )
}
