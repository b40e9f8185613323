//! What can be seen from a place: rays of a camera, what each of them meets, and how the sun lights it.
//!
//! Mixes no colours and writes no files. The ground is there even where the scene has none: the plane z = 0 that
//! vehicles drive on, seen from above only.

use super::affine::{Xyz, add, dot};
use super::build::Scene;
use crate::geom::Angle;

/// Nothing farther away is seen, metres.
const FARTHEST_M: f64 = 1e4;
/// Toward the sun: high in the south-west; a unit vector.
const SUN: Xyz = [-0.48, -0.64, 0.6];
/// Light that comes from everywhere.
const AMBIENT: f64 = 0.42;
/// How far a shadow's ray starts off the surface, metres.
const LIFT_M: f64 = 1e-6;

/// From where, and in which direction.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Viewpoint {
    /// The place, local frame, metres.
    pub at: [f64; 3],
    /// The direction in the plane, counter-clockwise from the x axis.
    pub yaw: Angle,
    /// The direction above (positive) or below the horizon, radians.
    pub pitch_rad: f64,
}

/// A camera without a lens: straight lines stay straight.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Camera {
    from: Xyz,
    ahead: Xyz,
    right: Xyz,
    up: Xyz,
    columns: f64,
    rows: f64,
    /// Half of what is seen from side to side at distance 1.
    reach: f64,
}

/// What a ray meets.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum RayHit {
    /// Nothing; `rise` is 0 at the horizon and 1 straight up.
    Sky {
        /// Sine of the height above the horizon, −1 to 1.
        rise: f64,
    },
    /// The plane z = 0 where the scene has nothing.
    Ground {
        /// Where, metres.
        at: [f64; 3],
        /// Light on it, 0 to 1.
        light: f64,
    },
    /// Something of the scene.
    Surface {
        /// Its place in [`Scene::objects`].
        object: usize,
        /// Where, metres.
        at: [f64; 3],
        /// Whether it lies level and looks up.
        is_level: bool,
        /// Light on it, 0 to 1.
        light: f64,
    },
}

impl Camera {
    /// Makes a camera for a picture of some columns and rows that sees `field_rad` from side to side (0 to π, both
    /// excluded).
    pub fn new(viewpoint: &Viewpoint, columns: usize, rows: usize, field_rad: f64) -> Camera {
        let (sin_yaw, cos_yaw) = libm::sincos(viewpoint.yaw.radians());
        let (sin_pitch, cos_pitch) = libm::sincos(viewpoint.pitch_rad);
        Camera {
            from: viewpoint.at,
            ahead: [cos_pitch * cos_yaw, cos_pitch * sin_yaw, sin_pitch],
            right: [sin_yaw, -cos_yaw, 0.0],
            up: [-sin_pitch * cos_yaw, -sin_pitch * sin_yaw, cos_pitch],
            columns: columns.max(1) as f64,
            rows: rows.max(1) as f64,
            reach: libm::tan(field_rad / 2.0),
        }
    }

    /// Returns where the rays begin, metres.
    pub fn from(&self) -> [f64; 3] {
        self.from
    }

    /// Returns the unit direction through a place of the picture: (0, 0) is its upper left corner, a pixel is 1 wide.
    pub fn direction(&self, x_px: f64, y_px: f64) -> [f64; 3] {
        let side = self.reach * (2.0 * x_px / self.columns - 1.0);
        let above = self.reach * (self.rows - 2.0 * y_px) / self.columns;
        let way = add(
            self.ahead,
            add(
                self.right.map(|part| part * side),
                self.up.map(|part| part * above),
            ),
        );
        let length = dot(way, way).sqrt();
        way.map(|part| part / length)
    }
}

impl Scene {
    /// Returns what a ray meets first, with the light on it; `direction` is a unit vector.
    pub fn seen(&self, from: [f64; 3], direction: [f64; 3]) -> RayHit {
        let place = |distance_m: f64| add(from, direction.map(|part| part * distance_m));
        if let Some(hit) = self.cast(from, direction, FARTHEST_M) {
            let at = place(hit.distance_m);
            let light = self.light(at, hit.normal);
            return RayHit::Surface {
                object: hit.object,
                at,
                is_level: hit.normal[2] > 0.95,
                light,
            };
        }
        let distance_m = -from[2] / direction[2];
        if from[2] > 0.0 && (0.0..FARTHEST_M).contains(&distance_m) {
            let at = place(distance_m);
            return RayHit::Ground {
                at,
                light: self.light(at, [0.0, 0.0, 1.0]),
            };
        }
        RayHit::Sky { rise: direction[2] }
    }

    /// Returns the light on a surface: from everywhere, a little more from above, and from the sun where it shines.
    fn light(&self, at: Xyz, normal: Xyz) -> f64 {
        let around = AMBIENT + 0.08 * normal[2] - 0.05 * normal[0];
        let facing = dot(normal, SUN);
        let lifted = add(at, normal.map(|part| part * LIFT_M));
        if facing <= 0.0 || self.cast(lifted, SUN, FARTHEST_M).is_some() {
            return around;
        }
        (around + (1.0 - AMBIENT) * facing).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Up, read_vrml};
    use std::collections::BTreeMap;

    /// A wall 2 m high from (5, −1) to (5.2, 1).
    fn wall() -> Scene {
        let text = "#VRML V2.0 utf8\nTransform { translation 5.1 0 1 children Shape { geometry Box { size 0.2 2 2 } } }";
        let read = read_vrml(text, "wall.wrl", Up::Z, &mut |_| Err("none".into())).unwrap();
        Scene::build(&crate::scene::SceneParts {
            shapes: &read.shapes,
            offset_m: [0.0; 3],
            materials: &BTreeMap::new(),
            default_material: crate::scene::Material::default(),
            posts: &[],
            persons: &[],
        })
        .unwrap()
    }

    fn camera(at: Xyz, yaw_degrees: f64, pitch_degrees: f64) -> Camera {
        let viewpoint = Viewpoint {
            at,
            yaw: Angle::from_degrees(yaw_degrees),
            pitch_rad: pitch_degrees.to_radians(),
        };
        Camera::new(&viewpoint, 200, 100, 90f64.to_radians())
    }

    fn check_direction(camera: &Camera, x_px: f64, y_px: f64, expected: Xyz) {
        let got = camera.direction(x_px, y_px);
        let length = dot(expected, expected).sqrt();
        assert!(
            (0..3).all(|axis| (got[axis] - expected[axis] / length).abs() < 1e-12),
            "{got:?}"
        );
    }

    #[test]
    fn the_middle_looks_ahead_and_the_sides_as_far_as_the_field() {
        let east = camera([0.0; 3], 0.0, 0.0);
        check_direction(&east, 100.0, 50.0, [1.0, 0.0, 0.0]);
        check_direction(&east, 0.0, 50.0, [1.0, 1.0, 0.0]);
        check_direction(&east, 200.0, 50.0, [1.0, -1.0, 0.0]);
        check_direction(&east, 100.0, 0.0, [1.0, 0.0, 0.5]);
        let north = camera([0.0; 3], 90.0, 0.0);
        check_direction(&north, 200.0, 50.0, [1.0, 1.0, 0.0]);
        check_direction(&camera([0.0; 3], 0.0, -45.0), 100.0, 50.0, [1.0, 0.0, -1.0]);
        check_direction(&camera([0.0; 3], 0.0, 90.0), 100.0, 50.0, [0.0, 0.0, 1.0]);
    }

    #[test]
    fn a_wall_is_seen_before_the_ground_and_the_sky_above_both() {
        let (scene, eye) = (wall(), [0.0, 0.0, 0.3]);
        let RayHit::Surface {
            object: 0,
            at,
            is_level: false,
            ..
        } = scene.seen(eye, [1.0, 0.0, 0.0])
        else {
            panic!("no wall")
        };
        assert!((at[0] - 5.0).abs() < 1e-9 && (at[2] - 0.3).abs() < 1e-9);
        assert_eq!(scene.seen(eye, [0.0, 0.0, 1.0]), RayHit::Sky { rise: 1.0 });
        let down = scene.seen(eye, [0.6, 0.0, -0.8]);
        assert!(
            matches!(down, RayHit::Ground { at, .. } if (at[0] - 0.225).abs() < 1e-9 && at[2].abs() < 1e-9)
        );
        // From under the ground there is no ground.
        assert!(matches!(
            scene.seen([0.0, 0.0, -1.0], [0.6, 0.0, -0.8]),
            RayHit::Sky { .. }
        ));
    }

    #[test]
    fn the_side_away_from_the_sun_and_its_shadow_are_darker() {
        let scene = wall();
        let light = |from: Xyz, direction: Xyz| match scene.seen(from, direction) {
            RayHit::Surface { light, .. } | RayHit::Ground { light, .. } => light,
            RayHit::Sky { .. } => panic!("nothing is there"),
        };
        let (lit, dark) = (
            light([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]),
            light([9.0, 0.0, 1.0], [-1.0, 0.0, 0.0]),
        );
        assert!(lit > dark + 0.2, "{lit} {dark}");
        let (sunny, shaded) = (
            light([4.0, 0.0, 9.0], [0.0, 0.0, -1.0]),
            light([5.4, 0.4, 9.0], [0.0, 0.0, -1.0]),
        );
        assert!(sunny > shaded + 0.2, "{sunny} {shaded}");
    }
}
