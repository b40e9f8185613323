//! What an ultrasonic range sensor hears: the nearest surface in its cone that faces it. The scene
//! is a ray-cast function of the caller; vehicles and persons are discs and always face the sensor.
//!
//! The cone is flat (a fan of rays at the sensor's height) and there is no crosstalk between sensors.

use std::time::Duration;

use super::noise::{Noise, Purpose};
use crate::geom::{Angle, Point, Vector};

/// Speed of sound, m/s.
const SOUND_MPS: f64 = 343.0;

/// What a sensor can do.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RangeModel {
    /// Half of the cone's opening, radians, under π/2.
    pub half_angle_rad: f64,
    /// Rays of the fan, spread evenly over the cone; at least 1.
    pub rays: usize,
    /// Nothing nearer gives an echo, and it hides what is behind, metres.
    pub min_m: f64,
    /// Nothing further gives an echo, metres.
    pub max_m: f64,
    /// Largest angle between ray and surface normal that returns an echo, radians.
    pub incidence_max_rad: f64,
    /// Standard deviation of a reading, metres.
    pub sd_m: f64,
}

impl Default for RangeModel {
    /// An HC-SR04: 2 cm to 4 m, a cone of 15°, echoes from up to 50° off the normal.
    fn default() -> RangeModel {
        RangeModel {
            half_angle_rad: 7.5f64.to_radians(),
            rays: 7,
            min_m: 0.02,
            max_m: 4.0,
            incidence_max_rad: 50f64.to_radians(),
            sd_m: 0.01,
        }
    }
}

/// A round obstacle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Disc {
    /// Its middle.
    pub centre: Point,
    /// Its radius, metres.
    pub radius_m: f64,
}

/// A ray cast into what stands: origin, unit direction and greatest distance in; distance and unit
/// normal (of either sign) of the first hit out, metres.
pub type RayCast<'a> = &'a dyn Fn([f64; 3], [f64; 3], f64) -> Option<(f64, [f64; 3])>;

/// What a sensor can hear.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// What stands.
    pub cast: RayCast<'a>,
    /// Other vehicles and persons, where they are now.
    pub discs: &'a [Disc],
}

/// A sensor with its fan laid out.
#[derive(Clone, Debug)]
pub struct RangeSensor {
    model: RangeModel,
    fan: Vec<Vector>,
    facing: f64,
    edge: Vector,
}

impl RangeSensor {
    /// Makes a sensor.
    pub fn new(model: RangeModel) -> RangeSensor {
        let ray = |index: usize| {
            let share = if model.rays < 2 { 0.0 } else { 2.0 * index as f64 / (model.rays - 1) as f64 - 1.0 };
            Vector::polar(Angle::from_radians(model.half_angle_rad * share), 1.0)
        };
        RangeSensor {
            fan: (0..model.rays.max(1)).map(ray).collect(),
            facing: libm::cos(model.incidence_max_rad),
            edge: Vector::polar(Angle::from_radians(model.half_angle_rad), 1.0),
            model,
        }
    }

    /// Gives what the sensor can do.
    pub fn model(&self) -> &RangeModel {
        &self.model
    }

    /// Gives how long it takes until an echo from `range_m` is heard, or until none is waited for any longer.
    pub fn takes(&self, range_m: Option<f64>) -> Duration {
        Duration::from_secs_f64(2.0 * range_m.unwrap_or(self.model.max_m) / SOUND_MPS)
    }

    /// Gives the distance read from a place when looking along `beam`, metres, or `None` without an
    /// echo. `ids` name the reading; the same ids give the same error.
    pub fn echo(
        &self,
        origin: [f64; 3],
        beam: Angle,
        around: Surroundings<'_>,
        noise: &Noise,
        ids: &[u64],
    ) -> Option<f64> {
        let distance_m = self.nearest_m(origin, Vector::polar(beam, 1.0), around)?;
        if distance_m < self.model.min_m {
            return None;
        }
        let error_m = self.model.sd_m * noise.gaussian(Purpose::Range, ids);
        Some((distance_m + error_m).clamp(self.model.min_m, self.model.max_m))
    }

    /// Distance to the nearest surface that returns an echo, without noise and blind zone.
    fn nearest_m(&self, origin: [f64; 3], axis: Vector, around: Surroundings<'_>) -> Option<f64> {
        let mut best_m = None;
        for ray in &self.fan {
            let along = spatial(rotated(*ray, axis));
            let limit_m = best_m.unwrap_or(self.model.max_m);
            let Some((distance_m, normal)) = (around.cast)(origin, along, limit_m) else { continue };
            let cosine = along.iter().zip(normal).map(|(a, n)| a * n).sum::<f64>().abs();
            if cosine >= self.facing && distance_m <= limit_m {
                best_m = Some(distance_m);
            }
        }
        let place = Point::new(origin[0], origin[1]);
        for disc in around.discs {
            let Some((distance_m, along)) = self.nearest_of(disc, place, axis) else { continue };
            let hit = || (around.cast)(origin, spatial(along), distance_m);
            let is_nearest = distance_m <= best_m.unwrap_or(self.model.max_m);
            if is_nearest && hit().is_none_or(|hit| hit.0 >= distance_m) {
                best_m = Some(distance_m);
            }
        }
        best_m
    }

    /// Distance and direction of the nearest point of a disc inside the cone.
    fn nearest_of(&self, disc: &Disc, place: Point, axis: Vector) -> Option<(f64, Vector)> {
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
        let edge =
            rotated(Vector::new(self.edge.x_m, if left { self.edge.y_m } else { -self.edge.y_m }), axis);
        let (ahead_m, beside_m) = (edge.dot(away), edge.cross(away));
        let square = disc.radius_m * disc.radius_m - beside_m * beside_m;
        (ahead_m > 0.0 && square >= 0.0).then(|| (ahead_m - square.sqrt(), edge))
    }
}

/// Turns a direction by the direction of a unit vector.
fn rotated(ray: Vector, axis: Vector) -> Vector {
    Vector::new(ray.x_m * axis.x_m - ray.y_m * axis.y_m, ray.x_m * axis.y_m + ray.y_m * axis.x_m)
}

fn spatial(along: Vector) -> [f64; 3] {
    [along.x_m, along.y_m, 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Hit = Option<(f64, [f64; 3])>;

    fn model() -> RangeModel {
        RangeModel { sd_m: 0.0, ..RangeModel::default() }
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
            (distance_m > 0.0 && distance_m <= max_m).then_some((distance_m, [-normal.x_m, -normal.y_m, 0.0]))
        }
    }

    fn read(model: RangeModel, cast: RayCast<'_>, discs: &[Disc]) -> Option<f64> {
        let around = Surroundings { cast, discs };
        RangeSensor::new(model).echo([0.0; 3], Angle::default(), around, &Noise::new(1), &[1])
    }

    fn disc(x_m: f64, y_m: f64) -> Disc {
        Disc { centre: Point::new(x_m, y_m), radius_m: 0.3 }
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
        let far = RangeSensor::new(RangeModel { max_m: 8.0, ..model() });
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
        let sensor = RangeSensor::new(RangeModel { sd_m: 0.05, ..model() });
        let (noise, wall_ahead) = (Noise::new(1), wall(2.0, 0.0));
        let around = Surroundings { cast: &wall_ahead, discs: &[] };
        let readings: Vec<f64> = (0..10_000)
            .filter_map(|id| sensor.echo([0.0; 3], Angle::default(), around, &noise, &[id]))
            .collect();
        let mean = readings.iter().sum::<f64>() / 10_000.0;
        let square = readings.iter().map(|reading| (reading - 2.0).powi(2)).sum::<f64>() / 10_000.0;
        assert!((mean - 2.0).abs() < 0.002 && (square.sqrt() - 0.05).abs() < 0.002);
        let close = Surroundings { cast: &wall(0.021, 0.0), discs: &[] };
        for id in 0..100 {
            let near = sensor.echo([0.0; 3], Angle::default(), close, &noise, &[id]);
            assert!(near.is_some_and(|reading| reading >= 0.02));
        }
    }

    proptest! {
        #[test]
        fn a_disc_is_read_at_its_nearest_point_inside_the_cone(
            x_m in -1.0..4.0f64, y_m in -2.0..2.0f64, radius_m in 0.05..0.6f64,
        ) {
            prop_assume!(x_m.hypot(y_m) > radius_m + 0.05);
            let sensor = RangeSensor::new(model());
            let disc = Disc { centre: Point::new(x_m, y_m), radius_m };
            let got = sensor.nearest_of(&disc, Point::default(), Vector::new(1.0, 0.0));
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
