//! Bodies of three dimensions as exact formulas: plane faces, upright prisms and cylinders, met by rays.
//!
//! The rays and corners are of the local frame, metres, z up. For a few bodies at a time: scenes of many triangles
//! belong to `scene`, which sorts them.

use super::{Point, Polygon, Vector};

/// A half line with a direction of unit length.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ray {
    from_m: [f64; 3],
    direction: [f64; 3],
}

impl Ray {
    /// Makes a ray in a direction of any length; `None` when the direction has none, or a number is not finite.
    pub fn new(from_m: [f64; 3], direction: [f64; 3]) -> Option<Ray> {
        let length = dot(direction, direction).sqrt();
        let is_sane =
            length > 0.0 && length.is_finite() && from_m.iter().all(|part| part.is_finite());
        is_sane.then(|| Ray {
            from_m,
            direction: direction.map(|part| part / length),
        })
    }

    /// Makes a ray through a second point; `None` when both coincide.
    pub fn through(from_m: [f64; 3], through_m: [f64; 3]) -> Option<Ray> {
        Ray::new(from_m, sub(through_m, from_m))
    }

    /// Returns the point so far along the ray.
    pub fn at(self, distance_m: f64) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.from_m[axis] + distance_m * self.direction[axis])
    }
}

/// A flat polygon in space.
#[derive(Clone, PartialEq, Debug)]
pub struct Face {
    corners_m: Vec<[f64; 3]>,
    /// Not of unit length: twice the area.
    normal: [f64; 3],
}

impl Face {
    /// Makes a face from its corners, in order around it; `None` with fewer than three, or without an area.
    ///
    /// Corners that do not lie in one plane are taken as if moved to it along its steepest axis.
    pub fn new(corners_m: Vec<[f64; 3]>) -> Option<Face> {
        let first = *corners_m.first()?;
        let spans = corners_m
            .windows(2)
            .map(|pair| cross(sub(pair[0], first), sub(pair[1], first)));
        let normal = spans.fold([0.0; 3], |sum, part| {
            [0, 1, 2].map(|axis| sum[axis] + part[axis])
        });
        let area = dot(normal, normal);
        (corners_m.len() >= 3 && area > 0.0 && area.is_finite())
            .then_some(Face { corners_m, normal })
    }

    /// Returns how far a ray goes until it meets the face, from either side, metres; `None` when it passes by, or runs
    /// within its plane.
    pub fn met_after_m(&self, ray: Ray) -> Option<f64> {
        let slope = dot(self.normal, ray.direction);
        if slope.abs() <= 1e-12 * dot(self.normal, self.normal).sqrt() {
            return None;
        }
        let distance_m = dot(self.normal, sub(self.corners_m[0], ray.from_m)) / slope;
        (distance_m >= 0.0 && self.holds(ray.at(distance_m))).then_some(distance_m)
    }

    /// Returns whether a point of its plane lies inside, seen along the normal's largest part.
    fn holds(&self, at: [f64; 3]) -> bool {
        let [x, y, z] = self.normal.map(f64::abs);
        let flat = |point: &[f64; 3]| match (x > y && x > z, y > z) {
            (true, _) => Point::new(point[1], point[2]),
            (false, true) => Point::new(point[0], point[2]),
            (false, false) => Point::new(point[0], point[1]),
        };
        Polygon::new(self.corners_m.iter().map(flat).collect()).contains(flat(&at))
    }
}

/// A polygon of the plane that stands upright from one height to another.
#[derive(Clone, PartialEq, Debug)]
pub struct Prism {
    /// Seen from above.
    pub outline: Polygon,
    /// Its lowest and highest z, metres.
    pub heights_m: [f64; 2],
}

impl Prism {
    /// Returns how far a ray goes until it meets a wall, the top or the bottom, from outside or inside, metres.
    pub fn met_after_m(&self, ray: Ray) -> Option<f64> {
        let [low_m, high_m] = self.heights_m;
        let flat = Vector::new(ray.direction[0], ray.direction[1]);
        let from = Point::new(ray.from_m[0], ray.from_m[1]);
        let walls = self.outline.edges().filter_map(|edge| {
            // Along the ray's shadow on the ground.
            let distance_m = edge.met_after_m(from, flat.angle())? / flat.length_m();
            let z_m = ray.at(distance_m)[2];
            (distance_m.is_finite() && z_m >= low_m && z_m <= high_m).then_some(distance_m)
        });
        let ends = [low_m, high_m].into_iter().filter_map(|z_m| {
            let distance_m = level_after_m(ray, z_m)?;
            let [x_m, y_m, _] = ray.at(distance_m);
            self.outline
                .contains(Point::new(x_m, y_m))
                .then_some(distance_m)
        });
        walls.chain(ends).min_by(f64::total_cmp)
    }
}

/// An upright round pole.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Cylinder {
    /// The middle, seen from above.
    pub centre: Point,
    /// Metres.
    pub radius_m: f64,
    /// Its lowest and highest z, metres.
    pub heights_m: [f64; 2],
}

impl Cylinder {
    /// Returns how far a ray goes until it meets the mantle, the top or the bottom, from outside or inside, metres.
    pub fn met_after_m(&self, ray: Ray) -> Option<f64> {
        let [low_m, high_m] = self.heights_m;
        let flat = Vector::new(ray.direction[0], ray.direction[1]);
        let offset = Point::new(ray.from_m[0], ray.from_m[1]) - self.centre;
        let mantle = roots(
            flat.dot(flat),
            flat.dot(offset),
            offset.dot(offset) - self.radius_m * self.radius_m,
        );
        let mantle = mantle.into_iter().filter(|distance_m| {
            let z_m = ray.at(*distance_m)[2];
            *distance_m >= 0.0 && z_m >= low_m && z_m <= high_m
        });
        let ends = [low_m, high_m].into_iter().filter_map(|z_m| {
            let distance_m = level_after_m(ray, z_m)?;
            let [x_m, y_m, _] = ray.at(distance_m);
            (self.centre.distance_to(Point::new(x_m, y_m)) <= self.radius_m).then_some(distance_m)
        });
        mantle.chain(ends).min_by(f64::total_cmp)
    }
}

/// Returns places between two points, evenly spaced: the start is not among them, the end is the last.
pub fn evenly_spaced(
    from_m: [f64; 3],
    to_m: [f64; 3],
    count: usize,
) -> impl Iterator<Item = [f64; 3]> {
    (1..=count).map(move |place| {
        let share = place as f64 / count as f64;
        let between = |axis: usize| from_m[axis] + share * (to_m[axis] - from_m[axis]);
        if place == count {
            to_m
        } else {
            [0, 1, 2].map(between)
        }
    })
}

/// How far a ray goes to a height.
fn level_after_m(ray: Ray, z_m: f64) -> Option<f64> {
    let distance_m = (z_m - ray.from_m[2]) / ray.direction[2];
    (distance_m.is_finite() && distance_m >= 0.0).then_some(distance_m)
}

/// The real roots of a t² + 2 b t + c; none where it is not quadratic.
fn roots(a: f64, half_b: f64, c: f64) -> Vec<f64> {
    let square = half_b * half_b - a * c;
    if a <= 1e-24 || square < 0.0 {
        return Vec::new();
    }
    // The root that does not cancel, and the other by their product.
    let far = -(half_b + square.sqrt().copysign(half_b));
    if far == 0.0 {
        vec![0.0]
    } else {
        vec![far / a, c / far]
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Rect;
    use proptest::prelude::*;

    fn check(got_m: Option<f64>, expected_m: Option<f64>) {
        match (got_m, expected_m) {
            (Some(got), Some(expected)) => {
                assert!((got - expected).abs() < 1e-9, "{got} instead of {expected}")
            }
            (got, expected) => assert_eq!(got, expected),
        }
    }

    fn ray(from_m: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray::new(from_m, direction).unwrap()
    }

    fn block() -> Prism {
        let outline = Rect::new(Point::new(10.0, -5.0), Point::new(20.0, 5.0)).polygon();
        Prism {
            outline,
            heights_m: [0.0, 10.0],
        }
    }

    #[test]
    fn a_distance_is_in_metres_whatever_the_direction_s_length() {
        let face = Face::new(vec![
            [2.0, 1.0, 3.0],
            [4.0, 1.0, 3.0],
            [4.0, 1.0, 9.0],
            [2.0, 1.0, 9.0],
        ])
        .unwrap();
        check(
            face.met_after_m(Ray::through([3.0, 0.0, 6.0], [3.0, 0.1, 6.0]).unwrap()),
            Some(1.0),
        );
        check(
            face.met_after_m(Ray::through([3.0, 0.0, 6.0], [3.0, -0.1, 6.0]).unwrap()),
            None,
        );
        check(
            face.met_after_m(ray([3.0, 0.0, 2.0], [0.0, 7.0, 0.0])),
            None,
        );
        check(
            face.met_after_m(ray([0.0, 1.0, 6.0], [1.0, 0.0, 0.0])),
            None,
        );
        check(
            face.met_after_m(ray([3.0, 5.0, 2.0], [0.0, -4.0, 3.0])),
            Some(5.0),
        );
    }

    #[test]
    fn what_has_no_area_or_direction_is_nothing() {
        assert_eq!(Face::new(vec![[0.0; 3], [1.0, 0.0, 0.0]]), None);
        assert_eq!(
            Face::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),
            None
        );
        assert_eq!(Ray::new([0.0; 3], [0.0; 3]), None);
        assert_eq!(Ray::new([f64::NAN, 0.0, 0.0], [1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn a_prism_is_met_on_walls_top_and_bottom() {
        check(
            block().met_after_m(ray([0.0, 0.0, 5.0], [1.0, 0.0, 0.0])),
            Some(10.0),
        );
        check(
            block().met_after_m(ray([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])),
            Some(10.0),
        );
        check(
            block().met_after_m(ray([0.0, 0.0, 10.5], [1.0, 0.0, 0.0])),
            None,
        );
        check(
            block().met_after_m(ray([15.0, 0.0, 30.0], [0.0, 0.0, -1.0])),
            Some(20.0),
        );
        check(
            block().met_after_m(ray([15.0, 0.0, 5.0], [0.0, 0.0, 1.0])),
            Some(5.0),
        );
        check(
            block().met_after_m(ray([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])),
            None,
        );
        // Up by 3 for 4 ahead: the wall at 10 m is met at 7.5 m height.
        check(
            block().met_after_m(ray([0.0, 0.0, 0.0], [4.0, 0.0, 3.0])),
            Some(12.5),
        );
        check(
            block().met_after_m(ray([0.0, 0.0, 4.0], [4.0, 0.0, 3.0])),
            None,
        );
    }

    #[test]
    fn a_cylinder_is_met_on_mantle_and_ends() {
        let pole = Cylinder {
            centre: Point::new(-10.0, 40.0),
            radius_m: 2.5,
            heights_m: [0.0, 3.0],
        };
        check(
            pole.met_after_m(ray([-10.0, 0.0, 0.0], [0.0, 2.0, 0.0])),
            Some(37.5),
        );
        check(
            pole.met_after_m(ray([-10.0, 40.0, 1.0], [1.0, 0.0, 0.0])),
            Some(2.5),
        );
        check(
            pole.met_after_m(ray([-9.0, 41.0, 9.0], [0.0, 0.0, -1.0])),
            Some(6.0),
        );
        check(
            pole.met_after_m(ray([-10.0, 0.0, 3.1], [0.0, 1.0, 0.0])),
            None,
        );
        check(
            pole.met_after_m(ray([-13.0, 0.0, 1.0], [0.0, 1.0, 0.0])),
            None,
        );
        check(
            pole.met_after_m(ray([-10.0, 50.0, 1.0], [0.0, 1.0, 0.0])),
            None,
        );
    }

    #[test]
    fn places_are_spread_from_after_the_start_to_the_end() {
        let places: Vec<[f64; 3]> = evenly_spaced([6.0, 6.0, 0.0], [0.0, 3.0, 9.0], 3).collect();
        assert_eq!(places, [[4.0, 5.0, 3.0], [2.0, 4.0, 6.0], [0.0, 3.0, 9.0]]);
        assert_eq!(evenly_spaced([0.0; 3], [1.0; 3], 0).count(), 0);
    }

    proptest! {
        #[test]
        fn a_hit_lies_on_the_body_and_nothing_before_it_does(
            from in proptest::array::uniform3(-30.0..30.0f64), direction in proptest::array::uniform3(-1.0..1.0f64),
        ) {
            let Some(ray) = Ray::new(from, direction) else { return Ok(()) };
            let pole = Cylinder { centre: Point::new(3.0, -2.0), radius_m: 4.0, heights_m: [-6.0, 7.0] };
            let in_block = |[x, y, z]: [f64; 3]| {
                block().outline.contains(Point::new(x, y)) && (0.0..=10.0).contains(&z)
            };
            let in_pole = |[x, y, z]: [f64; 3]| {
                pole.centre.distance_to(Point::new(x, y)) <= 4.0 && (-6.0..=7.0).contains(&z)
            };
            // Walks along the ray in small steps and looks where inside and outside change.
            let walked = |inside: &dyn Fn([f64; 3]) -> bool| {
                (1..10_000).map(|step| f64::from(step) * 0.01).find(|s| inside(ray.at(*s)) != inside(ray.at(*s - 0.01)))
            };
            for (met, walked) in [
                (block().met_after_m(ray), walked(&in_block)), (pole.met_after_m(ray), walked(&in_pole)),
            ] {
                match (met, walked) {
                    (Some(met), Some(walked)) => prop_assert!(met <= walked + 1e-9, "{met} {walked}"),
                    // A corner may be cut between two steps.
                    (None, Some(walked)) => prop_assert!(false, "missed at {walked}"),
                    (Some(_) | None, None) => {}
                }
            }
            for met in [block().met_after_m(ray), pole.met_after_m(ray)].into_iter().flatten().filter(|m| *m > 1e-3) {
                let sides = [met - 1e-6, met + 1e-6].map(|s| (in_block(ray.at(s)), in_pole(ray.at(s))));
                prop_assert!(sides[0] != sides[1], "nothing changes at {met}");
            }
        }
    }
}
