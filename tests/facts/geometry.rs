//! Facts about directions, distances and polygons of the plane; points are (north, east).

use serde_json::{Value, json};
use tomoswarm::geom::{Angle, Bearing, Polygon, Segment, Turn, Vector};

use super::fact::{Checked, Fact, place};
use super::geometry_3d;

/// Checks a fact about geometry.
pub fn check(fact: &Fact) -> Checked {
    match () {
        () if fact.has("bearing_deg") => {
            let bearing = Bearing::from_degrees(fact.number("bearing_deg")?);
            fact.expect("angle_deg", json!(bearing.angle().positive_degrees()))
        }
        () if fact.has("a1_deg") => two_angles(fact),
        () if fact.has("count") => geometry_3d::evenly_spaced_points(fact),
        () if fact.has("ray_from") || (fact.has("polygon") && !fact.has("point")) => {
            geometry_3d::face(fact)
        }
        () if fact.has("polygon") => {
            let polygon = Polygon::new(fact.table("polygon")?.into_iter().map(place).collect());
            fact.expect("inside", json!(polygon.contains(fact.place("point")?)))
        }
        () if fact.has("edge") => edge(fact),
        () if fact.has("offsets") => {
            let bearing =
                |[north, east]: [f64; 2]| Vector::new(east, north).angle().bearing().degrees();
            let bearings: Vec<f64> = fact.table("offsets")?.into_iter().map(bearing).collect();
            fact.expect("bearing_deg", json!(bearings))
        }
        () if fact.has("north") => offset(fact),
        () => Err("asks in an unknown way".to_owned()),
    }
}

fn two_angles(fact: &Fact) -> Checked {
    let (a1, a2) = (
        Angle::from_degrees(fact.number("a1_deg")?),
        Angle::from_degrees(fact.number("a2_deg")?),
    );
    let difference_deg = a1.difference_rad(a2).to_degrees();
    match () {
        () if fact.expects("abs_diff_deg") => {
            fact.expect("abs_diff_deg", json!(difference_deg.abs()))
        }
        () if fact.expects("diff_deg") => fact.expect("diff_deg", json!(difference_deg)),
        () if fact.expects("equal") => {
            let tolerance_rad = fact.number("tol_deg")?.to_radians();
            fact.expect("equal", json!(a1.is_near(a2, tolerance_rad)))
        }
        () => {
            let sign = match a1.turn_to(a2) {
                Turn::Clockwise => 1,
                Turn::CounterClockwise => -1,
            };
            fact.expect("direction", json!(sign))
        }
    }
}

/// A ray to the east against an edge, or a wall that stands on it.
fn edge(fact: &Fact) -> Checked {
    let ends: Vec<[f64; 2]> = fact.table("edge")?;
    let [from, to] = ends[..] else {
        return Err("an edge has two ends".to_owned());
    };
    let (from, to, point) = (place(from), place(to), fact.place("point")?);
    if fact.expects("intersects") {
        let is_met = Segment::new(from, to).is_met_along_x(point);
        return fact.expect("intersects", json!(is_met));
    }
    let met = geometry_3d::met_along_x_m([from, to], point)?;
    fact.expect(
        "distance",
        met.map_or(Value::Null, |distance| json!(distance)),
    )
}

fn offset(fact: &Fact) -> Checked {
    let offset = Vector::new(fact.number("east")?, fact.number("north")?);
    if fact.expects("angle_deg") {
        return fact.expect("angle_deg", json!(offset.angle().positive_degrees()));
    }
    let distance = match fact.text("metric")? {
        "straight" => offset.length_m(),
        "grid" => offset.grid_length_m(),
        other => return Err(format!("the metric {other} is not known")),
    };
    fact.expect("distance", json!(distance))
}
