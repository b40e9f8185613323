//! What an ultrasonic range sensor hears: the nearest surface in its lobe that is not hidden, faces it and is large enough to
//! be heard from there. What is not heard still hides what is behind it.
//!
//! The lobe is an ideal beam, a flat fan or a cone, and leans with the vehicle. There is no crosstalk between sensors:
//! they ping in turn. What is exact:
//!
//! - **beam**: one ray. It hears whatever it meets, however small; what it passes by it does not hear.
//! - **fan**: all of the outline in the sensor's plane (`range/sector.rs`), round bodies as circles. Of one that leans the
//!   plane is cut through the scene's triangles: round bodies have the corners of their triangles, vehicles 32.
//! - **cone**: the nearest point of every triangle in it, as far as a ray to that point, or to another one at the edges of the
//!   triangle or the rim of the cone, meets the triangle; besides, what rays on rings around the axis meet
//!   (`range/cone.rs`). So nothing that stands free is missed, and of what is partly hidden the nearest visible point may be.
//!
//! How wide something is counts across the line of sight, for a level fan of all that hangs together at the sensor's height; a
//! fan that leans and a cone take the widest part of the object there, or the whole of one that does not reach that height.

use std::time::Duration;

mod cone;
mod sector;

use self::sector::{Form, Sector, Surface};
use super::axes::Axes;
use super::noise::{Noise, NoisePurpose};
use crate::geom::{Angle, Attitude, Point, Vector};
use crate::plan::{PostDetection, SOUND_MPS, echo_time_s};
use crate::scene::{Circle, CutForm, LevelCut, Scene};

/// What lies beside a plane by less is in it, metres.
const HAIR_M: f64 = 1e-9;
/// Corners of a vehicle for a sensor that leans.
const DISC_CORNERS: usize = 32;

/// Where a sensor listens.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Lobe {
    /// Along one ray: a laser, or an ideal sensor.
    Beam,
    /// In the plane of the vehicle, between the edges of the cone.
    Fan,
    /// In a cone.
    Cone,
}

/// What a sensor can do.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RangeModel {
    /// Where it listens.
    pub lobe: Lobe,
    /// Half of the opening of the fan or cone, radians, under π/2.
    pub half_angle_rad: f64,
    /// Rays from one edge of a cone to the other, on rings around its axis: they find what is partly hidden.
    pub rays: usize,
    /// Nothing nearer gives an echo, and it hides what is behind, metres.
    pub min_m: f64,
    /// Nothing further gives an echo, metres.
    pub max_m: f64,
    /// Largest angle between ray and surface normal that returns an echo, radians.
    pub incidence_max_rad: f64,
    /// How far away posts are heard, and whatever is as wide; not asked by a beam.
    pub posts: PostDetection,
    /// Standard deviation of a reading, metres.
    pub sd_m: f64,
    /// Share of the pings that are answered by something else: a distance anywhere in the range, 0 to 1.
    pub glitch_share: f64,
}

impl Default for RangeModel {
    /// An HC-SR04: 2 cm to 4 m, a fan of 15°, echoes from up to 50° off the normal, a post of 1 cm heard up to 0.7 m.
    fn default() -> RangeModel {
        RangeModel {
            lobe: Lobe::Fan,
            half_angle_rad: 7.5f64.to_radians(),
            rays: 7,
            min_m: 0.02,
            max_m: 4.0,
            incidence_max_rad: 50f64.to_radians(),
            posts: PostDetection::measured(0.01, 0.7, 4.0),
            sd_m: 0.01,
            glitch_share: 0.0,
        }
    }
}

/// A round upright obstacle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Disc {
    /// Its middle.
    pub centre: Point,
    /// Its radius, metres.
    pub radius_m: f64,
    /// Its lower end (z), metres.
    pub low_m: f64,
    /// Its upper end (z), metres.
    pub high_m: f64,
}

/// Where a sensor is and how it lies.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SensorPose {
    /// Its place, local frame, metres.
    pub origin: [f64; 3],
    /// How the vehicle lies.
    pub attitude: Attitude,
    /// Where it is pointed, in the plane of the vehicle, counter-clockwise from its nose.
    pub beam: Angle,
}

impl SensorPose {
    fn axes(&self) -> Axes {
        Axes::of(self.attitude, self.beam)
    }

    /// Returns the direction in which the sensor looks, a unit vector of the local frame.
    pub fn direction(&self) -> [f64; 3] {
        self.axes().ahead
    }
}

/// What a sensor can hear.
#[derive(Clone, Copy)]
pub struct SensorSurroundings<'a> {
    /// What stands.
    pub scene: &'a Scene,
    /// Its cut at the sensor's height.
    pub cut: &'a LevelCut,
    /// Other vehicles, where they are now; they echo whatever the angle at which they are met.
    pub discs: &'a [Disc],
}

/// Something that is heard as a whole, by its number among its kind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Body {
    /// A solid of the level cut.
    Solid(usize),
    /// An object of the scene.
    Object(usize),
    /// Another vehicle.
    Disc(usize),
}

impl SensorSurroundings<'_> {
    /// Half of the width of a body as seen along a direction of the local frame, metres.
    fn half_width_m(&self, body: Body, along: [f64; 3]) -> f64 {
        let flat = Vector::new(along[0], along[1]);
        let length = flat.length_m();
        let along = match length > 0.0 {
            true => flat * (1.0 / length),
            false => Vector::new(1.0, 0.0),
        };
        match body {
            Body::Solid(solid) => self.cut.half_width_m(solid, along),
            Body::Object(object) => self.cut.object_half_width_m(object, along),
            Body::Disc(disc) => self.discs.get(disc).map_or(0.0, |disc| disc.radius_m),
        }
    }
}

/// A sensor, made ready.
#[derive(Clone, Debug)]
pub struct RangeSensor {
    model: RangeModel,
    /// Rays of a cone, unit vectors: along the axis, to its left, above it.
    rays: Vec<[f64; 3]>,
    /// Cosine of the largest angle between ray and normal that returns an echo.
    facing: f64,
    /// The edge of the lobe: cosine and sine of half its opening.
    edge: Vector,
}

impl RangeSensor {
    /// Makes a sensor.
    pub fn new(model: RangeModel) -> RangeSensor {
        let half_angle_rad = if model.lobe == Lobe::Beam {
            0.0
        } else {
            model.half_angle_rad
        };
        RangeSensor {
            rays: match model.lobe {
                Lobe::Beam | Lobe::Fan => Vec::new(),
                Lobe::Cone => cone::rings(model.half_angle_rad, model.rays),
            },
            facing: libm::cos(model.incidence_max_rad),
            edge: Vector::polar(Angle::from_radians(half_angle_rad), 1.0),
            model,
        }
    }

    /// Returns how long it takes until an echo from `range_m` is heard, or until none is waited for any longer.
    pub fn takes(&self, range_m: Option<f64>) -> Duration {
        let farthest_m = range_m.unwrap_or(self.model.max_m);
        Duration::from_secs_f64(echo_time_s(farthest_m, SOUND_MPS))
    }

    /// Returns the distance read by a sensor that lies level, along `beam` (local frame): see [`RangeSensor::echo_at`].
    pub fn echo(
        &self,
        origin: [f64; 3],
        beam: Angle,
        around: SensorSurroundings<'_>,
        noise: &Noise,
        ids: &[u64],
    ) -> Option<f64> {
        let eye = SensorPose {
            origin,
            attitude: Attitude::default(),
            beam,
        };
        self.echo_at(&eye, around, noise, ids)
    }

    /// Returns the distance read, along the beam, metres, or `None` without an echo. `ids` name the reading; the same ids
    /// give the same error.
    pub fn echo_at(
        &self,
        eye: &SensorPose,
        around: SensorSurroundings<'_>,
        noise: &Noise,
        ids: &[u64],
    ) -> Option<f64> {
        let model = &self.model;
        if model.glitch_share > 0.0 && noise.uniform(NoisePurpose::Glitch, ids) < model.glitch_share
        {
            let share = noise.uniform(NoisePurpose::GlitchRange, ids);
            return Some(model.min_m + share * (model.max_m - model.min_m));
        }
        let distance_m = self.nearest_m(eye, around)?;
        if distance_m < model.min_m {
            return None;
        }
        let error_m = model.sd_m * noise.gaussian(NoisePurpose::Range, ids);
        Some((distance_m + error_m).clamp(model.min_m, model.max_m))
    }

    /// Distance to the nearest surface that returns an echo, without noise and blind zone.
    fn nearest_m(&self, eye: &SensorPose, around: SensorSurroundings<'_>) -> Option<f64> {
        let axes = eye.axes();
        match self.model.lobe {
            Lobe::Beam => {
                let met = cone::first_met(eye.origin, axes.ahead, self.model.max_m, around)?;
                (met.cosine >= self.facing).then_some(met.distance_m)
            }
            Lobe::Fan => self.nearest_in_fan(eye.origin, &axes, around),
            Lobe::Cone => self.nearest_in_cone(eye.origin, &axes, around),
        }
    }

    fn nearest_in_fan(
        &self,
        origin: [f64; 3],
        axes: &Axes,
        around: SensorSurroundings<'_>,
    ) -> Option<f64> {
        let sector = Sector {
            slope: self.edge.y_m / self.edge.x_m,
            max_m: self.model.max_m,
            facing: self.facing,
        };
        let hears = |body, distance_m, slope| {
            let along = axes.along([1.0, slope, 0.0]);
            let radius_m = around.half_width_m(body, along);
            self.model.posts.hears(radius_m, distance_m)
        };
        let heard = if axes.ahead[2] == 0.0 && axes.left[2] == 0.0 {
            let level = LevelView::new(origin, axes, self.edge);
            let pieces = level.surfaces(around, self.model.max_m);
            sector::nearest(&sector, pieces, &hears)
        } else {
            let pieces = self.leaning_surfaces(origin, axes, around);
            sector::nearest(&sector, pieces.into_iter(), &hears)
        };
        heard.map(|heard| heard.distance_m)
    }

    /// The cut of the plane of a sensor that leans through what may lie in its fan.
    fn leaning_surfaces(
        &self,
        origin: [f64; 3],
        axes: &Axes,
        around: SensorSurroundings<'_>,
    ) -> Vec<Surface> {
        let plane = Plane { origin, axes };
        let Vector { x_m: cos, y_m: sin } = self.edge;
        let half_spaces = [
            plane.half_space([0.0, 0.0, 1.0], HAIR_M),
            plane.half_space([0.0, 0.0, -1.0], HAIR_M),
            plane.half_space([-sin, cos, 0.0], HAIR_M),
            plane.half_space([-sin, -cos, 0.0], HAIR_M),
            plane.half_space([1.0, 0.0, 0.0], self.model.max_m),
        ];
        let near = around.scene.triangles_within(&half_spaces);
        let cuts = near.filter_map(|triangle| {
            let (from, to) = plane.cut(triangle.corners)?;
            Some(Surface {
                form: Form::Straight(from, to),
                always_faces: false,
                body: Body::Object(triangle.object),
            })
        });
        let mut surfaces: Vec<Surface> = cuts.collect();
        for (index, disc) in around.discs.iter().enumerate() {
            let rim = plane.cut_disc(disc);
            let sides = rim.iter().zip(rim.iter().cycle().skip(1));
            surfaces.extend(sides.map(|(from, to)| Surface {
                form: Form::Straight(*from, *to),
                always_faces: true,
                body: Body::Disc(index),
            }));
        }
        surfaces
    }
}

/// A level plane with a sensor in it.
struct LevelView {
    place: Point,
    height_m: f64,
    axis: Vector,
    /// The left and the right edge of the fan, unit vectors of the local frame.
    edges: [Vector; 2],
}

impl LevelView {
    fn new(origin: [f64; 3], axes: &Axes, edge: Vector) -> LevelView {
        let axis = Vector::new(axes.ahead[0], axes.ahead[1]);
        let side = axis.left() * edge.y_m;
        LevelView {
            place: Point::new(origin[0], origin[1]),
            height_m: origin[2],
            axis,
            edges: [axis * edge.x_m + side, axis * edge.x_m - side],
        }
    }

    fn surfaces<'a>(
        &'a self,
        around: SensorSurroundings<'a>,
        max_m: f64,
    ) -> impl Iterator<Item = Surface> + 'a {
        let pieces = around.cut.in_sector(self.place, self.edges, max_m);
        let standing = pieces.map(|piece| Surface {
            form: match piece.form {
                CutForm::Straight(piece) => {
                    Form::Straight(self.seen(piece.from), self.seen(piece.to))
                }
                CutForm::Round(Circle { centre, radius_m }) => {
                    Form::Round(self.seen(centre), radius_m)
                }
            },
            always_faces: false,
            body: Body::Solid(piece.solid),
        });
        let is_cut =
            |(_, disc): &(usize, &Disc)| (disc.low_m..=disc.high_m).contains(&self.height_m);
        let discs = around.discs.iter().enumerate().filter(is_cut);
        standing.chain(discs.map(|(index, disc)| Surface {
            form: Form::Round(self.seen(disc.centre), disc.radius_m),
            always_faces: true,
            body: Body::Disc(index),
        }))
    }

    /// A place as the sensor sees it: ahead and to the left, metres.
    fn seen(&self, at: Point) -> Vector {
        let away = at - self.place;
        Vector::new(self.axis.dot(away), self.axis.cross(away))
    }
}

/// A plane with a sensor in it, however it lies.
struct Plane<'a> {
    origin: [f64; 3],
    axes: &'a Axes,
}

impl Plane<'_> {
    /// The half-space that ends so far from the sensor in a direction against its axes: outward normal and end, metres from
    /// the origin of the frame.
    fn half_space(&self, outward: [f64; 3], end_m: f64) -> ([f64; 3], f64) {
        let outward = self.axes.along(outward);
        (outward, dot(outward, self.origin) + end_m)
    }

    /// A place as the sensor sees it: ahead, to the left and above its plane, metres.
    fn seen(&self, at: [f64; 3]) -> [f64; 3] {
        let away = sub(at, self.origin);
        [self.axes.ahead, self.axes.left, self.axes.up].map(|axis| dot(axis, away))
    }

    /// The straight piece in which a triangle is cut; a corner in the plane counts as above.
    fn cut(&self, corners: [[f64; 3]; 3]) -> Option<(Vector, Vector)> {
        let seen = corners.map(|corner| self.seen(corner));
        let mut ends = (0..3).filter_map(|side| {
            let (a, b) = (seen[side], seen[(side + 1) % 3]);
            if (a[2] >= 0.0) == (b[2] >= 0.0) {
                return None;
            }
            let share = a[2] / (a[2] - b[2]);
            Some(Vector::new(
                a[0] + share * (b[0] - a[0]),
                a[1] + share * (b[1] - a[1]),
            ))
        });
        Some((ends.next()?, ends.next()?))
    }

    /// The outline in which a vehicle is cut; no corners when it is not.
    fn cut_disc(&self, disc: &Disc) -> Vec<Vector> {
        let up = self.axes.up;
        let height_m = |at: &Point| {
            let (x_m, y_m) = (at.x_m - self.origin[0], at.y_m - self.origin[1]);
            self.origin[2] - (up[0] * x_m + up[1] * y_m) / up[2]
        };
        let corner = |index: usize| {
            let turn =
                Angle::from_radians(std::f64::consts::TAU * index as f64 / DISC_CORNERS as f64);
            disc.centre + Vector::polar(turn, disc.radius_m)
        };
        let rim: Vec<Point> = (0..DISC_CORNERS).map(corner).collect();
        let rim = kept(&rim, &|at| height_m(at) - disc.low_m);
        let rim = kept(&rim, &|at| disc.high_m - height_m(at));
        let seen = rim
            .iter()
            .map(|at| self.seen([at.x_m, at.y_m, height_m(at)]));
        seen.map(|[ahead_m, left_m, _]| Vector::new(ahead_m, left_m))
            .collect()
    }
}

/// Returns the part of a convex outline in which something linear is not negative.
fn kept(rim: &[Point], inside: &dyn Fn(&Point) -> f64) -> Vec<Point> {
    let mut out = Vec::with_capacity(rim.len() + 1);
    for (here, next) in rim.iter().zip(rim.iter().cycle().skip(1)) {
        let (at_here, at_next) = (inside(here), inside(next));
        if at_here >= 0.0 {
            out.push(*here);
        }
        if (at_here >= 0.0) != (at_next >= 0.0) {
            out.push(here.toward(*next, at_here / (at_here - at_next)));
        }
    }
    out
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

impl Disc {
    /// Returns the distance along a ray (unit vector) to its side or one of its ends, metres; 0 from inside.
    fn cast(&self, origin: [f64; 3], along: [f64; 3]) -> Option<f64> {
        let (from_m, until_m) = self.crossed(origin, along)?;
        let (low_m, high_m) = (self.low_m - origin[2], self.high_m - origin[2]);
        let (enters_m, leaves_m) = if along[2] == 0.0 {
            if low_m > 0.0 || high_m < 0.0 {
                return None;
            }
            (f64::NEG_INFINITY, f64::INFINITY)
        } else {
            let ends = [low_m / along[2], high_m / along[2]];
            (ends[0].min(ends[1]), ends[0].max(ends[1]))
        };
        let (enters_m, leaves_m) = (from_m.max(enters_m), until_m.min(leaves_m));
        (leaves_m >= 0.0 && enters_m <= leaves_m).then_some(enters_m.max(0.0))
    }

    /// The part of a line that lies within the circle, as distances along it, metres.
    fn crossed(&self, origin: [f64; 3], along: [f64; 3]) -> Option<(f64, f64)> {
        let away = self.centre - Point::new(origin[0], origin[1]);
        let flat = Vector::new(along[0], along[1]);
        let square = flat.dot(flat);
        if square <= 0.0 {
            let is_inside = away.length_m() <= self.radius_m;
            return is_inside.then_some((f64::NEG_INFINITY, f64::INFINITY));
        }
        let middle_m = away.dot(flat) / square;
        let beside_m = flat.cross(away) / square.sqrt();
        let half_square = (self.radius_m * self.radius_m - beside_m * beside_m) / square;
        (half_square >= 0.0).then(|| (middle_m - half_square.sqrt(), middle_m + half_square.sqrt()))
    }
}

#[cfg(test)]
mod tests;
