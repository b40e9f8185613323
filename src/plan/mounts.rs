//! Which range sensor looks where: sensors sit on the vehicle at fixed angles, each on a servo (or on none) that turns
//! it within limits. A wanted direction is looked along by the sensor that can reach it; for one that none reaches the
//! vehicle has to turn, which is not decided here.
//!
//! The choice is a function of the direction alone, so that the vehicle and the driver of its servos agree without a
//! word. Pulse widths are not known here, nor what is seen.

use std::f64::consts::{PI, TAU};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::geom::Angle;

/// Directions this near are the same, radians.
const SAME_RAD: f64 = 1e-9;

/// One sensor: where it sits and how far its servo turns it.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Mount {
    /// Direction of the servo's zero, against the vehicle's heading.
    pub zero: Angle,
    /// The servo turns from here, radians against its zero, counter-clockwise, −π to π.
    pub from_rad: f64,
    /// The servo turns up to here, radians, −π to π, at least `from_rad`; the same for a sensor without a servo.
    pub to_rad: f64,
    /// Time that the servo needs for a radian, seconds; 0 = none beyond settling.
    pub slew_s_per_rad: f64,
}

impl Mount {
    /// A sensor that can be pointed anywhere, and at once.
    pub const ANYWHERE: Mount = Mount {
        zero: Angle::ZERO,
        from_rad: -PI,
        to_rad: PI,
        slew_s_per_rad: 0.0,
    };

    /// Returns where its servo must stand to look along a direction, radians; `None` when it cannot.
    pub fn reach(&self, beam: Angle) -> Option<f64> {
        let offset_rad = (beam - self.zero).radians();
        // Straight behind the zero is −π as well as π.
        [offset_rad, offset_rad - TAU]
            .into_iter()
            .find(|offset_rad| {
                (self.from_rad - SAME_RAD..=self.to_rad + SAME_RAD).contains(offset_rad)
            })
            .map(|offset_rad| offset_rad.clamp(self.from_rad, self.to_rad))
    }

    /// Returns the direction that it looks along when its servo stands there, against the vehicle's heading.
    pub fn beam(&self, offset_rad: f64) -> Angle {
        self.zero + Angle::from_radians(offset_rad)
    }

    /// Returns the time that the servo needs between two of its positions; it never turns beyond its limits.
    pub fn slew(&self, from_rad: f64, to_rad: f64) -> Duration {
        Duration::from_secs_f64((to_rad - from_rad).abs() * self.slew_s_per_rad)
    }

    /// Returns where the servo stands some time after it was sent from one of its positions to another, radians.
    pub fn position(&self, from_rad: f64, to_rad: f64, after: Duration) -> f64 {
        let whole_s = self.slew(from_rad, to_rad).as_secs_f64();
        if after.as_secs_f64() >= whole_s {
            return to_rad;
        }
        from_rad + (to_rad - from_rad) * (after.as_secs_f64() / whole_s)
    }

    /// Returns the position nearest to the middle of the range in which the servo begins: its zero, if it can.
    pub fn rest_rad(&self) -> f64 {
        0f64.clamp(self.from_rad, self.to_rad)
    }

    fn middle_rad(&self) -> f64 {
        (self.from_rad + self.to_rad) / 2.0
    }
}

/// A sensor and where its servo stands.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Aim {
    /// Index of the sensor.
    pub sensor: usize,
    /// Position of its servo, radians against its zero.
    pub offset_rad: f64,
}

/// The range sensors of a vehicle; at least one.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Mounts(Vec<Mount>);

impl Default for Mounts {
    /// One sensor that can be pointed anywhere.
    fn default() -> Mounts {
        Mounts(vec![Mount::ANYWHERE])
    }
}

impl Mounts {
    /// Takes the sensors of a vehicle; without any it has one that can be pointed anywhere.
    pub fn new(mounts: Vec<Mount>) -> Mounts {
        if mounts.is_empty() {
            Mounts::default()
        } else {
            Mounts(mounts)
        }
    }

    /// Returns the sensors in order.
    pub fn all(&self) -> &[Mount] {
        &self.0
    }

    /// Returns the sensor that looks along a direction (against the heading): of those that reach it the one that turns
    /// least from the middle of its range, of equals the first; `None` when none reaches it.
    pub fn aim(&self, beam: Angle) -> Option<Aim> {
        let reaching = |(sensor, mount): (usize, &Mount)| {
            let offset_rad = mount.reach(beam)?;
            Some((
                (offset_rad - mount.middle_rad()).abs(),
                Aim { sensor, offset_rad },
            ))
        };
        let aims = self.0.iter().enumerate().filter_map(reaching);
        aims.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, aim)| aim)
    }

    /// Returns the time that servos turn while every beam is looked along once, in a round that is repeated.
    pub fn slew_of_round(&self, beams: &[Angle]) -> Duration {
        let aims: Vec<Aim> = beams.iter().filter_map(|beam| self.aim(*beam)).collect();
        let turned = |(index, mount): (usize, &Mount)| {
            let own: Vec<f64> = aims
                .iter()
                .filter(|aim| aim.sensor == index)
                .map(|aim| aim.offset_rad)
                .collect();
            let next = own.iter().cycle().skip(1);
            own.iter()
                .zip(next)
                .map(|(from, to)| mount.slew(*from, *to))
                .sum::<Duration>()
        };
        self.0.iter().enumerate().map(turned).sum()
    }
}

/// Where the servos of a vehicle stand, as they are told one after the other.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Pointing {
    mounts: Mounts,
    /// Of each sensor, where its servo was sent from and to, radians, and how long ago it counts from.
    ways: Vec<(f64, f64, Duration)>,
    sensor: usize,
}

impl Pointing {
    /// All servos stand at rest.
    pub fn new(mounts: Mounts) -> Pointing {
        let rest = |mount: &Mount| (mount.rest_rad(), mount.rest_rad(), Duration::ZERO);
        Pointing {
            ways: mounts.all().iter().map(rest).collect(),
            mounts,
            sensor: 0,
        }
    }

    /// Points the sensor that reaches a direction, at a moment (time since any fixed one); returns how long its servo
    /// turns. Nothing moves when none reaches it.
    pub fn steer(&mut self, now: Duration, beam: Angle) -> Duration {
        let Some(aim) = self.mounts.aim(beam) else {
            return Duration::ZERO;
        };
        let from_rad = self.position(now, aim.sensor);
        self.sensor = aim.sensor;
        let Some(way) = self.ways.get_mut(aim.sensor) else {
            return Duration::ZERO;
        };
        *way = (from_rad, aim.offset_rad, now);
        self.mounts.all()[aim.sensor].slew(from_rad, aim.offset_rad)
    }

    /// Returns the direction (against the heading) that the sensor steered last looks along at a moment.
    pub fn beam(&self, now: Duration) -> Angle {
        self.mounts.all()[self.sensor].beam(self.position(now, self.sensor))
    }

    fn position(&self, now: Duration, sensor: usize) -> f64 {
        let (from_rad, to_rad, since) = self.ways[sensor];
        self.mounts.all()[sensor].position(from_rad, to_rad, now.saturating_sub(since))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mount(zero_deg: f64, from_deg: f64, to_deg: f64) -> Mount {
        Mount {
            zero: Angle::from_degrees(zero_deg),
            from_rad: from_deg.to_radians(),
            to_rad: to_deg.to_radians(),
            // 60° in 0.15 s.
            slew_s_per_rad: 0.15 / 60f64.to_radians(),
        }
    }

    /// Two servos ahead and astern, ±45° each, and a fixed sensor to the left.
    fn mounts() -> Mounts {
        Mounts::new(vec![
            mount(0.0, -45.0, 45.0),
            mount(180.0, -45.0, 45.0),
            mount(90.0, 0.0, 0.0),
        ])
    }

    fn secs(seconds_s: f64) -> Duration {
        Duration::from_secs_f64(seconds_s)
    }

    #[test]
    fn a_direction_is_looked_along_by_the_servo_that_can_reach_it() {
        for (beam_deg, sensor, offset_deg) in [
            (0.0, 0, 0.0),
            (45.0, 0, 45.0),
            (-30.0, 0, -30.0),
            (170.0, 1, -10.0),
            (-150.0, 1, 30.0),
            (90.0, 2, 0.0),
        ] {
            let aim = mounts().aim(Angle::from_degrees(beam_deg)).unwrap();
            assert_eq!(aim.sensor, sensor, "{beam_deg}°");
            assert!(
                (aim.offset_rad.to_degrees() - offset_deg).abs() < 1e-9,
                "{beam_deg}°: {aim:?}"
            );
        }
        for beam_deg in [50.0, -60.0, -100.0, 80.0] {
            assert_eq!(mounts().aim(Angle::from_degrees(beam_deg)), None);
        }
    }

    #[test]
    fn of_two_that_reach_it_the_one_that_turns_less_looks() {
        let wide = Mounts::new(vec![mount(0.0, -90.0, 90.0), mount(60.0, -90.0, 90.0)]);
        let sensor = |beam_deg| wide.aim(Angle::from_degrees(beam_deg)).unwrap().sensor;
        assert_eq!([20.0, 29.0, 31.0, 90.0].map(sensor), [0, 0, 1, 1]);
        assert_eq!(sensor(30.0), 0, "of equals the first");
    }

    #[test]
    fn a_full_turn_reaches_everything_and_both_sides_of_straight_behind() {
        for degrees in -360..=360 {
            assert!(
                Mounts::default()
                    .aim(Angle::from_degrees(f64::from(degrees)))
                    .is_some()
            );
        }
        let right = mount(0.0, -180.0, -90.0);
        assert!((right.reach(Angle::from_degrees(180.0)).unwrap() + PI).abs() < 1e-9);
    }

    #[test]
    fn a_servo_takes_its_angle_over_its_slew_rate_and_turns_evenly() {
        let mut pointing = Pointing::new(mounts());
        assert_eq!(
            pointing.steer(secs(1.0), Angle::from_degrees(40.0)),
            secs(0.1)
        );
        assert!((pointing.beam(secs(1.025)).degrees() - 10.0).abs() < 1e-6);
        assert!((pointing.beam(secs(2.0)).degrees() - 40.0).abs() < 1e-9);
        // Turned round on the way: from where it is, not from where it was sent.
        pointing.steer(secs(2.0), Angle::from_degrees(-40.0));
        assert_eq!(
            pointing.steer(secs(2.1), Angle::from_degrees(40.0)),
            secs(0.1)
        );
        // Another sensor; the first goes on turning meanwhile.
        pointing.steer(secs(2.12), Angle::from_degrees(180.0));
        assert_eq!(
            (pointing.sensor, pointing.beam(secs(2.13)).degrees()),
            (1, 180.0)
        );
        assert_eq!(
            pointing.steer(secs(3.0), Angle::from_degrees(40.0)),
            Duration::ZERO
        );
    }

    #[test]
    fn a_round_takes_the_turns_of_every_servo_and_back() {
        let beams = [-20.0, 160.0, 20.0, 200.0].map(Angle::from_degrees);
        // Each servo turns 40° and back: four turns of 0.1 s.
        let round = mounts().slew_of_round(&beams);
        assert!((round.as_secs_f64() - 0.4).abs() < 1e-6, "{round:?}");
        assert_eq!(Mounts::default().slew_of_round(&beams), Duration::ZERO);
        assert_eq!(mounts().slew_of_round(&beams[..1]), Duration::ZERO);
    }

    proptest! {
        #[test]
        fn a_sensor_that_reaches_a_direction_looks_there_within_its_limits(
            zeros in prop::collection::vec((-180.0..180.0f64, -180.0..0.0f64, 0.0..180.0f64), 1..4),
            wanted_deg in -180.0..180.0f64,
        ) {
            let mounts = Mounts::new(zeros.iter().map(|(zero, from, to)| mount(*zero, *from, *to)).collect());
            let wanted = Angle::from_degrees(wanted_deg);
            let is_reached = mounts.all().iter().any(|mount| mount.reach(wanted).is_some());
            let aim = mounts.aim(wanted);
            prop_assert_eq!(aim.is_some(), is_reached);
            if let Some(aim) = aim {
                let used = mounts.all()[aim.sensor];
                prop_assert!((used.from_rad..=used.to_rad).contains(&aim.offset_rad));
                prop_assert!((used.beam(aim.offset_rad) - wanted).radians().abs() < 1e-8);
            }
        }
    }
}
