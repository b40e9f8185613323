//! What a cone hears, and what a ray meets first. Which points are tried, and what that misses, is said in `range.rs`.

use super::{Body, DISC_CORNERS, Disc, HAIR_M, Plane, RangeSensor, SensorSurroundings, dot, sub};
use crate::geom::{Angle, Vector};
use crate::sim::axes::Axes;

/// How far from its border a point of a triangle is aimed at, as a share of the way to its middle: a ray to the border itself
/// may just miss.
const INSET: f64 = 1e-6;
/// A point is in the cone when the cosine of its angle from the axis is less by no more than this.
const HAIR: f64 = 1e-9;

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    /// How far away, metres.
    pub(super) distance_m: f64,
    /// Cosine of the angle between ray and normal; 1 for what always faces the sensor.
    pub(super) cosine: f64,
    /// What it belongs to.
    pub(super) body: Body,
}

/// Returns what a ray (a unit vector) meets first, within a distance.
pub(super) fn first_met(
    origin: [f64; 3],
    along: [f64; 3],
    max_m: f64,
    around: SensorSurroundings<'_>,
) -> Option<Met> {
    let hit = around.scene.cast(origin, along, max_m);
    let mut first = hit.map(|hit| Met {
        distance_m: hit.distance_m,
        cosine: dot(along, hit.normal).abs(),
        body: Body::Object(hit.object),
    });
    for (index, disc) in around.discs.iter().enumerate() {
        let Some(distance_m) = disc.cast(origin, along) else {
            continue;
        };
        if distance_m <= first.map_or(max_m, |first| first.distance_m) {
            first = Some(Met {
                distance_m,
                cosine: 1.0,
                body: Body::Disc(index),
            });
        }
    }
    first
}

/// Returns the axis of a cone and rings around it with six rays more on each: every ray is about as far from its neighbours.
pub(super) fn rings(half_angle_rad: f64, rays: usize) -> Vec<[f64; 3]> {
    let rings = rays / 2;
    let mut out = vec![[1.0, 0.0, 0.0]];
    for ring in 1..=rings {
        let (sin, cos) = libm::sincos(half_angle_rad * ring as f64 / rings as f64);
        let count = 6 * ring;
        out.extend((0..count).map(|index| {
            let around_rad = std::f64::consts::TAU * index as f64 / count as f64;
            [
                cos,
                sin * libm::cos(around_rad),
                sin * libm::sin(around_rad),
            ]
        }));
    }
    out
}

impl RangeSensor {
    pub(super) fn nearest_in_cone(
        &self,
        origin: [f64; 3],
        axes: &Axes,
        around: SensorSurroundings<'_>,
    ) -> Option<f64> {
        let mut best_m = None;
        let heard_m = |along: [f64; 3], limit_m: f64| {
            let met = first_met(origin, along, limit_m, around)?;
            let is_heard = met.cosine >= self.facing
                && self
                    .model
                    .posts
                    .hears(around.half_width_m(met.body, along), met.distance_m);
            is_heard.then_some(met.distance_m)
        };
        for ray in &self.rays {
            let limit_m = best_m.unwrap_or(self.model.max_m);
            best_m = heard_m(axes.along(*ray), limit_m).or(best_m);
        }
        let plane = Plane { origin, axes };
        let Vector { x_m: cos, y_m: sin } = self.edge;
        let limit_m = best_m.unwrap_or(self.model.max_m);
        let half_spaces = [
            plane.half_space([-1.0, 0.0, 0.0], HAIR_M),
            plane.half_space([1.0, 0.0, 0.0], limit_m),
            plane.half_space([-sin, cos, 0.0], HAIR_M),
            plane.half_space([-sin, -cos, 0.0], HAIR_M),
            plane.half_space([-sin, 0.0, cos], HAIR_M),
            plane.half_space([-sin, 0.0, -cos], HAIR_M),
        ];
        let near = around.scene.triangles_within(&half_spaces);
        let standing = near.map(|triangle| (Body::Object(triangle.object), triangle.corners));
        let discs = around.discs.iter().enumerate();
        let others = discs
            .filter(|(_, disc)| disc.may_lie_within(origin, limit_m))
            .flat_map(|(index, disc)| {
                disc.triangles()
                    .map(move |corners| (Body::Disc(index), corners))
            });
        let cone = Cone {
            axis: axes.ahead,
            cos,
            sin,
        };
        let mut tries: Vec<(f64, [f64; 3])> = Vec::new();
        for (body, corners) in standing.chain(others) {
            let triangle = corners.map(|corner| sub(corner, origin));
            let normal = unit_normal(&triangle);
            let echoes = |at: &[f64; 3]| {
                let distance_m = dot(*at, *at).sqrt();
                let always_faces = matches!(body, Body::Disc(_));
                // A hair more than is heard: the ray to it decides.
                (always_faces || dot(normal, *at).abs() >= (self.facing - HAIR) * distance_m)
                    && distance_m <= limit_m
                    && self
                        .model
                        .posts
                        .hears(around.half_width_m(body, *at), distance_m * (1.0 - HAIR))
            };
            let points = cone.near_points(&triangle).filter(echoes);
            tries.extend(points.map(|at| (dot(at, at).sqrt(), aimed(at, &triangle))));
        }
        tries.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (distance_m, along) in tries {
            let limit_m = best_m.unwrap_or(self.model.max_m);
            if distance_m >= limit_m {
                break;
            }
            best_m = heard_m(along, limit_m).or(best_m);
        }
        best_m
    }
}

/// The direction of a point of a triangle, a hair inside its border.
fn aimed(at: [f64; 3], triangle: &[[f64; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = triangle;
    let middle: [f64; 3] = std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0);
    let inside: [f64; 3] = std::array::from_fn(|axis| at[axis] + INSET * (middle[axis] - at[axis]));
    let length = dot(inside, inside).sqrt();
    inside.map(|part| part / length)
}

/// A triangle's unit normal, of either sign; zero when it has no area.
fn unit_normal([a, b, c]: &[[f64; 3]; 3]) -> [f64; 3] {
    let normal = cross(sub(*b, *a), sub(*c, *a));
    let length = dot(normal, normal).sqrt();
    normal.map(|part| if length > 0.0 { part / length } else { 0.0 })
}

/// A cone whose tip is at the origin.
struct Cone {
    axis: [f64; 3],
    cos: f64,
    sin: f64,
}

impl Cone {
    /// Returns points of a triangle in the cone; the one that comes nearest to the tip is among them. (Both are convex, so
    /// that it is the foot of the perpendicular, or lies on a side, or where the rim comes nearest to the plane.)
    fn near_points(&self, triangle: &[[f64; 3]; 3]) -> impl Iterator<Item = [f64; 3]> {
        let mut points: Vec<[f64; 3]> = Vec::with_capacity(17);
        for side in 0..3 {
            let (from, to) = (triangle[side], triangle[(side + 1) % 3]);
            let along = sub(to, from);
            let shares = self.shares(from, along);
            points.extend(
                shares
                    .into_iter()
                    .filter(|share| (0.0..=1.0).contains(share))
                    .map(|share| std::array::from_fn(|axis| from[axis] + share * along[axis])),
            );
        }
        let [a, b, c] = *triangle;
        let normal = cross(sub(b, a), sub(c, a));
        let square = dot(normal, normal);
        let offset = dot(normal, a);
        if square > 0.0 {
            let foot = normal.map(|part| part * offset / square);
            let facing = normal.map(|part| part * offset.signum() / square.sqrt());
            let tilt = dot(facing, self.axis);
            let beside: [f64; 3] =
                std::array::from_fn(|axis| facing[axis] - tilt * self.axis[axis]);
            let length = dot(beside, beside).sqrt();
            let rim: [f64; 3] = std::array::from_fn(|axis| {
                self.cos * self.axis[axis] + self.sin * beside[axis] / length.max(HAIR)
            });
            let reach = offset / dot(normal, rim);
            let met = rim.map(|part| part * reach);
            let inner = [(foot, true), (met, reach > 0.0)];
            points.extend(
                inner
                    .into_iter()
                    .filter(|(at, is_ahead)| *is_ahead && is_inside(*at, triangle, normal))
                    .map(|(at, _)| at),
            );
        }
        let (axis, cos) = (self.axis, self.cos);
        points.into_iter().filter(move |at| {
            let ahead_m = dot(axis, *at);
            let length_m = dot(*at, *at).sqrt();
            length_m > 0.0 && ahead_m >= (cos - HAIR) * length_m
        })
    }

    /// Shares of a straight piece at which it may come nearest to the tip: its ends, the foot of the perpendicular, and where
    /// it passes through the cone.
    fn shares(&self, from: [f64; 3], along: [f64; 3]) -> [f64; 5] {
        let foot = -dot(from, along) / dot(along, along);
        let (ahead, step) = (dot(self.axis, from), dot(self.axis, along));
        let square = self.cos * self.cos;
        let (a, b, c) = (
            step * step - square * dot(along, along),
            ahead * step - square * dot(from, along),
            ahead * ahead - square * dot(from, from),
        );
        let root = (b * b - a * c).sqrt();
        // No numbers, or infinite, where it does not pass: they fall away.
        [0.0, 1.0, foot, (-b - root) / a, (-b + root) / a]
    }
}

fn is_inside(at: [f64; 3], triangle: &[[f64; 3]; 3], normal: [f64; 3]) -> bool {
    (0..3).all(|side| {
        let (from, to) = (triangle[side], triangle[(side + 1) % 3]);
        dot(cross(sub(to, from), sub(at, from)), normal) >= 0.0
    })
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

impl Disc {
    fn may_lie_within(&self, origin: [f64; 3], reach_m: f64) -> bool {
        let (x_m, y_m) = (self.centre.x_m - origin[0], self.centre.y_m - origin[1]);
        (x_m * x_m + y_m * y_m).sqrt() <= reach_m + self.radius_m
    }

    /// Its surface as triangles: its side and both ends.
    fn triangles(&self) -> impl Iterator<Item = [[f64; 3]; 3]> {
        let disc = *self;
        let corner = move |index: usize, height_m: f64| {
            let turn = std::f64::consts::TAU * index as f64 / DISC_CORNERS as f64;
            let at = disc.centre + Vector::polar(Angle::from_radians(turn), disc.radius_m);
            [at.x_m, at.y_m, height_m]
        };
        (0..DISC_CORNERS).flat_map(move |index| {
            let [a, b] = [index, index + 1].map(|index| corner(index, disc.low_m));
            let [c, d] = [index, index + 1].map(|index| corner(index, disc.high_m));
            let middle = |height_m| [disc.centre.x_m, disc.centre.y_m, height_m];
            [
                [a, b, d],
                [a, d, c],
                [a, b, middle(disc.low_m)],
                [c, d, middle(disc.high_m)],
            ]
        })
    }
}
