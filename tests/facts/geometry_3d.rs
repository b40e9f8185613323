//! Facts about space; points are (north, east, up).

use serde_json::{Value, json};
use tomoswarm::geom::{Face, Ray, evenly_spaced};

use super::fact::{Checked, Fact};

/// From (north, east, up) to the local frame; and back, since it swaps two.
fn swapped([a, b, up]: [f64; 3]) -> [f64; 3] {
    [b, a, up]
}

/// Checks points between two others.
pub fn evenly_spaced_points(fact: &Fact) -> Checked {
    let count = usize::try_from(fact.whole("count")?).map_err(|error| error.to_string())?;
    let (start, end) = (
        swapped(fact.numbers("start")?),
        swapped(fact.numbers("end")?),
    );
    let points: Vec<[f64; 3]> = evenly_spaced(start, end, count).map(swapped).collect();
    fact.expect("points", json!(points))
}

/// Checks a ray against a face.
pub fn face(fact: &Fact) -> Checked {
    let corners = fact.table("polygon")?.into_iter().map(swapped).collect();
    let (from, through) = (fact.numbers("ray_from")?, fact.numbers("ray_through")?);
    let ray = Ray::through(swapped(from), swapped(through)).ok_or("the ray has no direction")?;
    let met = Face::new(corners).and_then(|face| face.met_after_m(ray));
    fact.expect(
        "distance",
        met.map_or(Value::Null, |distance| json!(distance)),
    )?;
    if fact.expects("point") {
        fact.expect(
            "point",
            met.map_or(Value::Null, |distance| json!(swapped(ray.at(distance)))),
        )?;
    }
    Ok(())
}
