//! Facts about the measurement patterns; points are (north, east). The tracks are those of the first vehicle.

use serde_json::{Value, json};
use tomoswarm::geom::Point;
use tomoswarm::sweep::{Pattern, PatternKind, square};

use super::fact::{Checked, Fact};

fn pattern(fact: &Fact, kind: PatternKind) -> Result<Pattern, String> {
    let size = usize::try_from(fact.whole("size")?).map_err(|error| error.to_string())?;
    Pattern::new(kind, size).map_err(|error| error.to_string())
}

fn track(pattern: Pattern) -> Vec<Value> {
    pattern.steps().map(|[first, _]| json!([first.north, first.east])).collect()
}

/// Gives how often the first point of a track stands there, as a fact writes it.
fn waits(track: &[Value]) -> Value {
    let count = track.iter().take_while(|point| Some(*point) == track.first()).count();
    let Some(first) = track.first() else { return Value::Null };
    Value::from(format!("{count} x ({},{})", first[0], first[1]))
}

/// Checks a fact about the calibration.
pub fn check_calibrate(fact: &Fact) -> Checked {
    let pattern = pattern(fact, PatternKind::Calibrate)?;
    let track = track(pattern);
    let round = fact.output("first_round")?.as_array().map_or(0, Vec::len);
    let parts: Vec<&[Value]> = track.chunks(round.max(1)).collect();
    let [first, second, third, ..] = parts[..] else { return Err("there are too few rounds".to_owned()) };
    fact.expect("first_round", json!(first))?;
    fact.expect("second_round", waits(second))?;
    fact.expect("third_round", json!(third))?;
    fact.expect("rounds", json!(parts.len()))?;
    fact.expect("total", json!(pattern.step_count()))
}

/// Checks a fact about the fan.
pub fn check_fan(fact: &Fact) -> Checked {
    let track = track(pattern(fact, PatternKind::Fan)?);
    let round = fact.output("first_round")?.as_array().map_or(0, Vec::len);
    let (first, rest) = track.split_at(round.min(track.len()));
    fact.expect("first_round", json!(first))?;
    fact.expect("then", waits(rest))?;
    // A drive ends where the vehicle begins to stand: the stays are half of the rounds.
    let stands = track.windows(3).filter(|three| three[0] != three[1] && three[1] == three[2]).count();
    fact.expect("rounds", json!(2 * stands))
}

/// Checks a fact about the fan along opposite sides.
pub fn check_fan_straight(fact: &Fact) -> Checked {
    fact.expect("waypoints", json!(track(pattern(fact, PatternKind::FanStraight)?)))
}

/// Checks a fact about the square.
pub fn check_square(fact: &Fact) -> Checked {
    let corners = square(Point::default(), fact.number("size")?).map_err(|error| error.to_string())?;
    fact.expect("waypoints", corners.iter().map(|at| json!([at.y_m, at.x_m])).collect())
}
