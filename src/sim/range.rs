//! What an ultrasonic range sensor hears: the nearest surface in its lobe that faces it. The scene
//! is a ray-cast function of the caller; vehicles and persons are upright posts and always face the sensor.
//!
//! The lobe is an ideal beam, a flat fan or a cone, and leans with the vehicle. There is no crosstalk between sensors:
//! they ping in turn.

use std::time::Duration;

use super::axes::Axes;
use super::noise::{Noise, NoisePurpose};
use crate::geom::{Angle, Attitude, Point, Vector};
use crate::plan::{SOUND_MPS, echo_time_s};

/// Where a sensor listens.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Lobe {
    /// Along one ray: a laser, or an ideal sensor.
    Beam,
    /// In the plane of the vehicle, between the edges of the cone.
    Fan,
    /// In a cone; on rings around the axis, as far apart as the rays of the fan.
    Cone,
}

/// What a sensor can do.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RangeModel {
    /// Where it listens.
    pub lobe: Lobe,
    /// Half of the opening of the fan or cone, radians, under π/2.
    pub half_angle_rad: f64,
    /// Rays from one edge to the other, spread evenly; at least 1, an odd number for one along the axis.
    pub rays: usize,
    /// Nothing nearer gives an echo, and it hides what is behind, metres.
    pub min_m: f64,
    /// Nothing further gives an echo, metres.
    pub max_m: f64,
    /// Largest angle between ray and surface normal that returns an echo, radians.
    pub incidence_max_rad: f64,
    /// Standard deviation of a reading, metres.
    pub sd_m: f64,
    /// Share of the pings that are answered by something else: a distance anywhere in the range, 0 to 1.
    pub glitch_share: f64,
}

impl Default for RangeModel {
    /// An HC-SR04: 2 cm to 4 m, a fan of 15°, echoes from up to 50° off the normal.
    fn default() -> RangeModel {
        RangeModel {
            lobe: Lobe::Fan,
            half_angle_rad: 7.5f64.to_radians(),
            rays: 7,
            min_m: 0.02,
            max_m: 4.0,
            incidence_max_rad: 50f64.to_radians(),
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

/// A ray cast into what stands: origin, unit direction and greatest distance in; distance and unit
/// normal (of either sign) of the first hit out, metres.
pub type RayCast<'a> = &'a dyn Fn([f64; 3], [f64; 3], f64) -> Option<(f64, [f64; 3])>;

/// What a sensor can hear.
#[derive(Clone, Copy)]
pub struct SensorSurroundings<'a> {
    /// What stands.
    pub cast: RayCast<'a>,
    /// Other vehicles and persons, where they are now.
    pub discs: &'a [Disc],
}

/// A sensor with its rays laid out.
#[derive(Clone, Debug)]
pub struct RangeSensor {
    model: RangeModel,
    /// Unit vectors: along the axis, to its left, above it.
    rays: Vec<[f64; 3]>,
    facing: f64,
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
                Lobe::Beam => vec![[1.0, 0.0, 0.0]],
                Lobe::Fan => fan(&model),
                Lobe::Cone => cone(&model),
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
        let axes = Axes::of(eye.attitude, eye.beam);
        let mut best_m = None;
        for ray in &self.rays {
            let along = axes.along(*ray);
            let limit_m = best_m.unwrap_or(self.model.max_m);
            let Some((distance_m, normal)) = (around.cast)(eye.origin, along, limit_m) else {
                continue;
            };
            let cosine = along
                .iter()
                .zip(normal)
                .map(|(a, n)| a * n)
                .sum::<f64>()
                .abs();
            if cosine >= self.facing && distance_m <= limit_m {
                best_m = Some(distance_m);
            }
        }
        for disc in around.discs {
            let Some((distance_m, along)) = self.nearest_of(disc, eye, &axes) else {
                continue;
            };
            let hit = || (around.cast)(eye.origin, along, distance_m);
            let is_nearest = distance_m <= best_m.unwrap_or(self.model.max_m);
            if is_nearest && hit().is_none_or(|hit| hit.0 >= distance_m) {
                best_m = Some(distance_m);
            }
        }
        best_m
    }

    /// Distance and direction of the nearest point of a disc inside the lobe: exact where a level sensor lies between
    /// its ends, ray by ray where it leans or looks at it from above.
    fn nearest_of(&self, disc: &Disc, eye: &SensorPose, axes: &Axes) -> Option<(f64, [f64; 3])> {
        let is_between = (disc.low_m..=disc.high_m).contains(&eye.origin[2]);
        if axes.ahead[2] == 0.0 && axes.left[2] == 0.0 && is_between {
            let place = Point::new(eye.origin[0], eye.origin[1]);
            let (distance_m, along) =
                self.nearest_level(disc, place, Vector::new(axes.ahead[0], axes.ahead[1]))?;
            return Some((distance_m, [along.x_m, along.y_m, 0.0]));
        }
        let hits = self.rays.iter().map(|ray| axes.along(*ray));
        let hits = hits.filter_map(|along| Some((disc.cast(eye.origin, along)?, along)));
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn nearest_level(&self, disc: &Disc, place: Point, axis: Vector) -> Option<(f64, Vector)> {
        let away = disc.centre - place;
        let distance_m = away.length_m();
        if distance_m <= disc.radius_m {
            return Some((0.0, axis));
        }
        if away.dot(axis) >= self.edge.x_m * distance_m {
            return Some((distance_m - disc.radius_m, away * (1.0 / distance_m)));
        }
        // The middle lies outside the cone: the nearest point is where the cone's near edge enters.
        let left = axis.cross(away) >= 0.0;
        let edge = rotated(
            Vector::new(
                self.edge.x_m,
                if left { self.edge.y_m } else { -self.edge.y_m },
            ),
            axis,
        );
        let (ahead_m, beside_m) = (edge.dot(away), edge.cross(away));
        let square = disc.radius_m * disc.radius_m - beside_m * beside_m;
        (ahead_m > 0.0 && square >= 0.0).then(|| (ahead_m - square.sqrt(), edge))
    }
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

fn fan(model: &RangeModel) -> Vec<[f64; 3]> {
    let ray = |index: usize| {
        let share = if model.rays < 2 {
            0.0
        } else {
            2.0 * index as f64 / (model.rays - 1) as f64 - 1.0
        };
        let along = Vector::polar(Angle::from_radians(model.half_angle_rad * share), 1.0);
        [along.x_m, along.y_m, 0.0]
    };
    (0..model.rays.max(1)).map(ray).collect()
}

/// The axis, and rings around it with six rays more on each: every ray is about as far from its neighbours.
fn cone(model: &RangeModel) -> Vec<[f64; 3]> {
    let rings = model.rays / 2;
    let mut rays = vec![[1.0, 0.0, 0.0]];
    for ring in 1..=rings {
        let (sin, cos) = libm::sincos(model.half_angle_rad * ring as f64 / rings as f64);
        let count = 6 * ring;
        rays.extend((0..count).map(|index| {
            let around_rad = std::f64::consts::TAU * index as f64 / count as f64;
            [
                cos,
                sin * libm::cos(around_rad),
                sin * libm::sin(around_rad),
            ]
        }));
    }
    rays
}

/// Turns a direction by the direction of a unit vector.
fn rotated(ray: Vector, axis: Vector) -> Vector {
    Vector::new(
        ray.x_m * axis.x_m - ray.y_m * axis.y_m,
        ray.x_m * axis.y_m + ray.y_m * axis.x_m,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Hit = Option<(f64, [f64; 3])>;

    fn model() -> RangeModel {
        RangeModel {
            sd_m: 0.0,
            ..RangeModel::default()
        }
    }

    fn nothing(_: [f64; 3], _: [f64; 3], _: f64) -> Hit {
        None
    }

    /// An endless wall through (`ahead_m`, 0), its normal turned by `turn` from the x axis.
    fn wall(ahead_m: f64, turn_degrees: f64) -> impl Fn([f64; 3], [f64; 3], f64) -> Hit {
        let normal = Vector::polar(Angle::from_degrees(turn_degrees), 1.0);
        move |from, along, max_m| {
            let speed = normal.x_m * along[0] + normal.y_m * along[1];
            let gap_m = normal.x_m * (ahead_m - from[0]) - normal.y_m * from[1];
            let distance_m = gap_m / speed;
            (distance_m > 0.0 && distance_m <= max_m)
                .then_some((distance_m, [-normal.x_m, -normal.y_m, 0.0]))
        }
    }

    fn read(model: RangeModel, cast: RayCast<'_>, discs: &[Disc]) -> Option<f64> {
        let around = SensorSurroundings { cast, discs };
        RangeSensor::new(model).echo([0.0; 3], Angle::default(), around, &Noise::new(1), &[1])
    }

    fn disc(x_m: f64, y_m: f64) -> Disc {
        Disc {
            centre: Point::new(x_m, y_m),
            radius_m: 0.3,
            low_m: 0.0,
            high_m: 1.8,
        }
    }

    #[test]
    fn a_wall_ahead_is_read_at_its_distance() {
        assert!((read(model(), &wall(2.0, 0.0), &[]).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(read(model(), &wall(4.1, 0.0), &[]), None);
        assert_eq!(read(model(), &wall(0.015, 0.0), &[]), None);
        assert_eq!(read(model(), &nothing, &[]), None);
    }

    #[test]
    fn the_nearest_part_of_an_oblique_wall_in_the_cone_is_read() {
        // The ray nearest to the normal, 7.5° of the 30°: 2 m cos 30° / cos 22.5°.
        let expected = 2.0 * 30f64.to_radians().cos() / 22.5f64.to_radians().cos();
        assert!((read(model(), &wall(2.0, 30.0), &[]).unwrap() - expected).abs() < 1e-9);
    }

    #[test]
    fn without_an_echo_the_sensor_waits_for_its_farthest_one() {
        let far = RangeSensor::new(RangeModel {
            max_m: 8.0,
            ..model()
        });
        let seconds_s = |range_m| far.takes(range_m).as_secs_f64();
        assert!((seconds_s(None) - 16.0 / 343.0).abs() < 1e-6);
        assert!((seconds_s(Some(3.43)) - 0.02).abs() < 1e-6);
    }

    #[test]
    fn a_grazing_wall_gives_no_echo() {
        assert!(read(model(), &wall(2.0, 57.0), &[]).is_some());
        assert_eq!(read(model(), &wall(2.0, 58.0), &[]), None);
    }

    #[test]
    fn a_person_before_a_wall_is_read_and_one_behind_it_is_not() {
        assert!((read(model(), &wall(2.0, 0.0), &[disc(1.5, 0.0)]).unwrap() - 1.2).abs() < 1e-12);
        assert!((read(model(), &wall(2.0, 0.0), &[disc(2.5, 0.0)]).unwrap() - 2.0).abs() < 1e-12);
        // The grazing wall gives no echo of its own and still hides what is behind it.
        assert_eq!(read(model(), &wall(1.0, 70.0), &[disc(2.5, 0.0)]), None);
    }

    #[test]
    fn a_sensor_inside_a_disc_reads_nothing() {
        assert_eq!(read(model(), &wall(2.0, 0.0), &[disc(0.1, 0.0)]), None);
    }

    #[test]
    fn readings_scatter_by_their_deviation_and_stay_in_range() {
        let sensor = RangeSensor::new(RangeModel {
            sd_m: 0.05,
            ..model()
        });
        let (noise, wall_ahead) = (Noise::new(1), wall(2.0, 0.0));
        let around = SensorSurroundings {
            cast: &wall_ahead,
            discs: &[],
        };
        let readings: Vec<f64> = (0..10_000)
            .filter_map(|id| sensor.echo([0.0; 3], Angle::default(), around, &noise, &[id]))
            .collect();
        let mean = readings.iter().sum::<f64>() / 10_000.0;
        let square = readings
            .iter()
            .map(|reading| (reading - 2.0).powi(2))
            .sum::<f64>()
            / 10_000.0;
        assert!((mean - 2.0).abs() < 0.002 && (square.sqrt() - 0.05).abs() < 0.002);
        let close = SensorSurroundings {
            cast: &wall(0.021, 0.0),
            discs: &[],
        };
        for id in 0..100 {
            let near = sensor.echo([0.0; 3], Angle::default(), close, &noise, &[id]);
            assert!(near.is_some_and(|reading| reading >= 0.02));
        }
    }

    /// A level plate at a height; hit from either side.
    fn plate(at_m: f64) -> impl Fn([f64; 3], [f64; 3], f64) -> Hit {
        move |from, along, max_m| {
            let distance_m = (at_m - from[2]) / along[2];
            (distance_m > 0.0 && distance_m <= max_m).then_some((distance_m, [0.0, 0.0, 1.0]))
        }
    }

    fn read_at(
        model: RangeModel,
        eye: SensorPose,
        cast: RayCast<'_>,
        discs: &[Disc],
    ) -> Option<f64> {
        RangeSensor::new(model).echo_at(
            &eye,
            SensorSurroundings { cast, discs },
            &Noise::new(1),
            &[1],
        )
    }

    fn leaning(roll_deg: f64, pitch_deg: f64, height_m: f64, beam_deg: f64) -> SensorPose {
        let [roll, pitch] = [roll_deg, pitch_deg].map(Angle::from_degrees);
        let attitude = Attitude {
            roll,
            pitch,
            yaw: Angle::ZERO,
        };
        SensorPose {
            origin: [0.0, 0.0, height_m],
            attitude,
            beam: Angle::from_degrees(beam_deg),
        }
    }

    #[test]
    fn an_ideal_beam_reads_along_its_axis_only() {
        let ideal = RangeModel {
            lobe: Lobe::Beam,
            ..model()
        };
        let expected = 2.0 * 30f64.to_radians().cos() / 30f64.to_radians().cos();
        assert!((read(ideal, &wall(2.0, 30.0), &[]).unwrap() - expected).abs() < 1e-9);
        assert_eq!(read(ideal, &nothing, &[disc(2.0, 0.31)]), None);
        assert!(read(ideal, &nothing, &[disc(2.0, 0.29)]).is_some());
        assert!(read(model(), &nothing, &[disc(2.0, 0.31)]).is_some());
    }

    #[test]
    fn a_cone_hears_the_ground_that_a_fan_does_not() {
        let cone = RangeModel {
            lobe: Lobe::Cone,
            incidence_max_rad: 85f64.to_radians(),
            ..model()
        };
        let fan = RangeModel {
            lobe: Lobe::Fan,
            ..cone
        };
        let level = leaning(0.0, 0.0, 0.3, 0.0);
        let ground = read_at(cone, level, &plate(0.0), &[]).unwrap();
        // The lowest ray of the cone falls by 7.5°; on a ring of 18 none points straight down, the lowest 10° beside it.
        let steepest = 0.3 / (7.5f64.to_radians().sin() * 80f64.to_radians().sin());
        assert!((ground - steepest).abs() < 1e-9, "{ground} {steepest}");
        assert_eq!(read_at(fan, level, &plate(0.0), &[]), None);
    }

    #[test]
    fn in_the_plane_a_cone_hears_what_a_fan_hears() {
        let cone = RangeModel {
            lobe: Lobe::Cone,
            ..model()
        };
        for turn_deg in [-40.0, -10.0, 0.0, 25.0, 50.0] {
            let (a, b) = (
                read(cone, &wall(2.0, turn_deg), &[]),
                read(model(), &wall(2.0, turn_deg), &[]),
            );
            assert!(
                (a.unwrap() - b.unwrap()).abs() < 1e-9,
                "{turn_deg}°: {a:?} {b:?}"
            );
        }
    }

    #[test]
    fn a_sensor_that_leans_reads_along_its_own_plane() {
        let ideal = RangeModel {
            lobe: Lobe::Beam,
            ..model()
        };
        // Nose down by 30° at 1 m: the ground is 2 m away; a wall at 1 m is hit first, 1 m / cos 30° away.
        let down = leaning(0.0, -30.0, 1.0, 0.0);
        let steep = RangeModel {
            incidence_max_rad: 61f64.to_radians(),
            ..ideal
        };
        assert!((read_at(steep, down, &plate(0.0), &[]).unwrap() - 2.0).abs() < 1e-9);
        let expected = 1.0 / 30f64.to_radians().cos();
        assert!((read_at(ideal, down, &wall(1.0, 0.0), &[]).unwrap() - expected).abs() < 1e-9);
        assert_eq!(
            read_at(ideal, down, &plate(0.0), &[]),
            None,
            "60° off the normal"
        );
        // Rolled to the right: what looks right sees the ground, what looks left does not.
        let rolled = |beam_deg| read_at(steep, leaning(30.0, 0.0, 1.0, beam_deg), &plate(0.0), &[]);
        assert!((rolled(-90.0).unwrap() - 2.0).abs() < 1e-9);
        assert_eq!((rolled(0.0), rolled(90.0)), (None, None));
    }

    #[test]
    fn who_flies_over_a_rover_sees_it_only_when_it_leans_down() {
        let ideal = RangeModel {
            lobe: Lobe::Beam,
            ..model()
        };
        let rover = [Disc {
            centre: Point::new(2.0, 0.0),
            radius_m: 0.3,
            low_m: 0.0,
            high_m: 0.3,
        }];
        assert_eq!(
            read_at(ideal, leaning(0.0, 0.0, 1.3, 0.0), &nothing, &rover),
            None
        );
        // Falling by 27° from 1.3 m it meets the top, 1 m lower, after 1 m / sin 27°.
        let met_m = read_at(ideal, leaning(0.0, -27.0, 1.3, 0.0), &nothing, &rover).unwrap();
        assert!((met_m - 1.0 / 27f64.to_radians().sin()).abs() < 1e-9);
        // Falling by 40° it passes short of it; from lower down it hits the side.
        assert_eq!(
            read_at(ideal, leaning(0.0, -40.0, 1.3, 0.0), &nothing, &rover),
            None
        );
        let side_m = read_at(ideal, leaning(0.0, -5.0, 0.29, 0.0), &nothing, &rover).unwrap();
        assert!((side_m - 1.7 / 5f64.to_radians().cos()).abs() < 1e-9);
    }

    #[test]
    fn glitches_come_as_often_as_they_should_and_anywhere_in_range() {
        let sensor = RangeSensor::new(RangeModel {
            glitch_share: 0.1,
            ..model()
        });
        let around = SensorSurroundings {
            cast: &nothing,
            discs: &[],
        };
        let noise = Noise::new(4);
        let read = |id| sensor.echo([0.0; 3], Angle::default(), around, &noise, &[id]);
        let glitches: Vec<f64> = (0..20_000).filter_map(read).collect();
        assert!((1800..2200).contains(&glitches.len()), "{}", glitches.len());
        assert!(
            glitches
                .iter()
                .all(|range_m| (0.02..=4.0).contains(range_m))
        );
        assert!((glitches.iter().sum::<f64>() / glitches.len() as f64 - 2.01).abs() < 0.1);
    }

    proptest! {
        #[test]
        fn a_disc_is_read_at_its_nearest_point_inside_the_cone(
            x_m in -1.0..4.0f64, y_m in -2.0..2.0f64, radius_m in 0.05..0.6f64,
        ) {
            prop_assume!(x_m.hypot(y_m) > radius_m + 0.05);
            let sensor = RangeSensor::new(model());
            let disc = Disc { centre: Point::new(x_m, y_m), radius_m, low_m: 0.0, high_m: 1.0 };
            let got = sensor.nearest_level(&disc, Point::default(), Vector::new(1.0, 0.0));
            // Many rays over the cone, each against the circle.
            let half_rad = 7.5f64.to_radians();
            let nearest_m = (-2000..=2000)
                .filter_map(|index| {
                    let (sin, cos) = (half_rad * f64::from(index) / 2000.0).sin_cos();
                    let (ahead_m, beside_m) = (cos * x_m + sin * y_m, cos * y_m - sin * x_m);
                    let square = radius_m * radius_m - beside_m * beside_m;
                    (ahead_m > 0.0 && square > 0.0).then(|| ahead_m - square.sqrt())
                })
                .fold(f64::INFINITY, f64::min);
            match got {
                Some((distance_m, along)) => {
                    // Where the edge only touches the disc, rays within the cone may just miss it.
                    prop_assert!(nearest_m - distance_m > -1e-9);
                    prop_assert!(nearest_m - distance_m < 1e-3 || nearest_m.is_infinite());
                    prop_assert!((along * distance_m - (disc.centre - Point::default())).length_m() <= radius_m + 1e-9);
                    prop_assert!(along.x_m >= half_rad.cos() - 1e-9);
                }
                None => prop_assert!(nearest_m.is_infinite()),
            }
        }
    }
}
