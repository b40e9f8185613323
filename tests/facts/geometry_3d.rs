//! Facts about space; points are (north, east, up). What a ray meets is asked of the scene's ray caster, with faces
//! that come out of VRML text as those of a venue do.

use serde_json::{Value, json};
use tomoswarm::geom::Point;
use tomoswarm::scene::{Scene, Up, read_vrml};

use super::fact::{Checked, Fact};
use super::vrml::scene_of;

/// Beyond this nothing is met, metres.
const FARTHEST_M: f64 = 1000.0;

/// From (north, east, up) to the local frame; and back, since it swaps two.
fn swapped([a, b, up]: [f64; 3]) -> [f64; 3] {
    [b, a, up]
}

/// Checks points between two others. The program divides ways of the plane only, so height is a plane's second axis.
pub fn evenly_spaced_points(fact: &Fact) -> Checked {
    let count = fact.whole("count")?;
    let (start, end): ([f64; 3], [f64; 3]) = (fact.numbers("start")?, fact.numbers("end")?);
    let between = |a: usize, b: usize, share: f64| {
        Point::new(start[a], start[b]).toward(Point::new(end[a], end[b]), share)
    };
    let point = |place: i64| {
        let share = place as f64 / count as f64;
        let (flat, upright) = (between(0, 1, share), between(1, 2, share));
        [flat.x_m, flat.y_m, upright.y_m]
    };
    let points: Vec<[f64; 3]> = (1..=count).map(point).collect();
    fact.expect("points", json!(points))
}

/// Checks a ray against a face.
pub fn face(fact: &Fact) -> Checked {
    let corners: Vec<[f64; 3]> = fact.table("polygon")?.into_iter().map(swapped).collect();
    let from = swapped(fact.numbers("ray_from")?);
    let direction = unit_toward(from, swapped(fact.numbers("ray_through")?));
    let hit = scene_of_face(&corners)?.cast(from, direction, FARTHEST_M);
    fact.expect(
        "distance",
        hit.map_or(Value::Null, |hit| json!(hit.distance_m)),
    )?;
    if fact.expects("point") {
        let at = |distance_m: f64| [0, 1, 2].map(|axis| from[axis] + distance_m * direction[axis]);
        fact.expect(
            "point",
            hit.map_or(Value::Null, |hit| json!(swapped(at(hit.distance_m)))),
        )?;
    }
    Ok(())
}

/// Returns how far a look along x goes to a wall that stands on a segment, metres; `None` when it meets none.
pub fn met_along_x_m(ends: [Point; 2], from: Point) -> Result<Option<f64>, String> {
    let [a, b] = ends;
    let corners = [
        [a.x_m, a.y_m, 0.0],
        [b.x_m, b.y_m, 0.0],
        [b.x_m, b.y_m, 2.0],
        [a.x_m, a.y_m, 2.0],
    ];
    let hit = scene_of_face(&corners)?.cast([from.x_m, from.y_m, 0.5], [1.0, 0.0, 0.0], FARTHEST_M);
    Ok(hit.map(|hit| hit.distance_m))
}

/// Returns a scene that consists of one face, local frame.
fn scene_of_face(corners: &[[f64; 3]]) -> Result<Scene, String> {
    let points: Vec<String> = corners
        .iter()
        .map(|[x, y, z]| format!("{x} {y} {z}"))
        .collect();
    let indices: Vec<String> = (0..corners.len()).map(|index| index.to_string()).collect();
    let text = format!(
        "#VRML V2.0 utf8\nShape {{ geometry IndexedFaceSet {{ coord Coordinate {{ point [ {} ] }} \
         coordIndex [ {} -1 ] }} }}",
        points.join(", "),
        indices.join(" ")
    );
    let read = read_vrml(&text, "face.wrl", Up::Z, &mut |_| {
        Err("nothing is inlined".into())
    });
    scene_of(&read.map_err(|error| error.to_string())?.shapes, &[])
}

fn unit_toward(from: [f64; 3], through: [f64; 3]) -> [f64; 3] {
    let way = [0, 1, 2].map(|axis| through[axis] - from[axis]);
    let length = way.iter().map(|part| part * part).sum::<f64>().sqrt();
    way.map(|part| part / length)
}
