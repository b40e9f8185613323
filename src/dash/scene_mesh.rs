//! The triangles of a simulated scene as text (JSON), for a page that draws it; and where its vehicles' range sensors look.
//! It says what stands there and computes nothing.

use super::told::{ObjectMesh, SceneMesh, Sensors, as_text};
use crate::config::RangeSensor;
use crate::scene::{Object, Scene};

/// Corners are told in these parts of a metre.
const PARTS_PER_M: f64 = 1000.0;

/// Returns the triangles of a scene, object by object: corners once, in millimetres, x, y, z in turn, and three numbers of
/// corners a triangle.
pub fn scene_mesh(scene: &Scene) -> String {
    as_text(&SceneMesh {
        objects: scene.objects().iter().map(object).collect(),
    })
}

fn object(object: &Object) -> ObjectMesh {
    let mesh = object.shape.surface();
    let part = |of: &f64| (of * PARTS_PER_M).round() as i64;
    ObjectMesh {
        name: object.name.clone(),
        is_closed: object.closed,
        corners_mm: mesh.vertices().iter().flatten().map(part).collect(),
        triangles: mesh.triangles().iter().flatten().copied().collect(),
    }
}

/// Returns where the range sensors of simulated vehicles look, and how far.
pub fn sensors(range: &RangeSensor) -> Sensors {
    let beams = range.look.beams_deg.iter().map(|beam| beam.to_radians());
    Sensors {
        beams_rad: beams.collect(),
        half_angle_rad: range.look.half_angle_deg.to_radians(),
        max_range_m: range.look.max_range_m,
        height_m: range.height_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Point;
    use crate::scene::{Material, Person, SceneParts};
    use serde_json::Value;

    #[test]
    fn a_scene_is_told_by_its_corners_in_millimetres_and_by_its_triangles() {
        let person = Person {
            name: "<b>".to_owned(),
            at: Point::new(2.0, 3.0),
            path: Vec::new(),
            radius_m: 0.25,
            height_m: 1.8,
            db_per_m: 10.0,
        };
        let parts = SceneParts {
            shapes: &[],
            offset_m: [0.0; 3],
            materials: &Default::default(),
            default_material: Material::default(),
            posts: &[],
            persons: &[person],
        };
        let scene = Scene::build(&parts).unwrap();
        let said: Value = serde_json::from_str(&scene_mesh(&scene)).unwrap();
        let object = &said["objects"][0];
        assert_eq!(object["name"], "<b>");
        let corners: Vec<i64> = serde_json::from_value(object["corners_mm"].clone()).unwrap();
        let triangles: Vec<usize> = serde_json::from_value(object["triangles"].clone()).unwrap();
        assert!(corners.len().is_multiple_of(3) && triangles.len().is_multiple_of(3));
        assert!(triangles.len() > 30);
        assert!(triangles.iter().all(|corner| corner * 3 < corners.len()));
        for corner in corners.chunks(3) {
            let away_mm = f64::hypot(corner[0] as f64 - 2000.0, corner[1] as f64 - 3000.0);
            assert!((200.0..=300.0).contains(&away_mm), "{corner:?}");
            assert!(corner[2] == 0 || corner[2] == 1800, "{corner:?}");
        }
    }
}
