//! The pulse widths of a servo's angles. Which angle is wanted, and how long the servo turns, `plan::Mounts` knows; which
//! pin or autopilot output moves it is the driver's.
//!
//! Angles of a servo are in degrees as its scale is marked; they do not wrap.

use std::time::Duration;

use thiserror::Error;

use crate::config::ServoScale;

/// From one pulse to the next: 50 Hz.
pub const PERIOD: Duration = Duration::from_millis(20);
/// The longest pulse, microseconds: a whole period.
const LONGEST_PULSE_US: f64 = 20_000.0;

/// Why a servo cannot be, or cannot do that.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum ServoError {
    /// The angles are no range.
    #[error(
        "a servo turns from one angle to a greater one, at most 360 degrees further, not from {low_deg} to {high_deg}"
    )]
    Angles {
        /// First angle, degrees.
        low_deg: f64,
        /// Last angle, degrees.
        high_deg: f64,
    },
    /// The pulse widths are no range.
    #[error(
        "pulse widths are two different ones from 0 to {LONGEST_PULSE_US} us, not {first_us} and {last_us}"
    )]
    Pulses {
        /// At the first angle, microseconds.
        first_us: f64,
        /// At the last angle, microseconds.
        last_us: f64,
    },
    /// The angle is out of reach.
    #[error("{angle_deg} degrees are out of reach, the servo turns from {low_deg} to {high_deg}")]
    Angle {
        /// What was asked for, degrees.
        angle_deg: f64,
        /// First angle, degrees.
        low_deg: f64,
        /// Last angle, degrees.
        high_deg: f64,
    },
    /// No angle has this pulse width.
    #[error("a pulse of {pulse_us} us is out of range, the servo takes {first_us} to {last_us}")]
    Pulse {
        /// What was given, microseconds.
        pulse_us: f64,
        /// At the first angle, microseconds.
        first_us: f64,
        /// At the last angle, microseconds.
        last_us: f64,
    },
}

/// The reach of a servo, and the pulse widths at its two ends.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ServoRange {
    angle_deg: [f64; 2],
    pulse_us: [f64; 2],
}

impl ServoRange {
    /// Makes the range of a servo from its two ends; pulse widths may fall while angles rise.
    ///
    /// # Errors
    /// [`ServoError::Angles`] or [`ServoError::Pulses`] when there is no such servo.
    pub fn new(angle_deg: [f64; 2], pulse_us: [f64; 2]) -> Result<ServoRange, ServoError> {
        let ([low_deg, high_deg], [first_us, last_us]) = (angle_deg, pulse_us);
        let span_deg = high_deg - low_deg;
        if !(low_deg.abs() <= 720.0 && span_deg > 0.0 && span_deg <= 360.0) {
            return Err(ServoError::Angles { low_deg, high_deg });
        }
        let is_pulse = |us: f64| (0.0..=LONGEST_PULSE_US).contains(&us);
        if !(is_pulse(first_us) && is_pulse(last_us) && first_us != last_us) {
            return Err(ServoError::Pulses { first_us, last_us });
        }
        Ok(ServoRange {
            angle_deg,
            pulse_us,
        })
    }

    /// Makes the range of a servo from what its file says.
    ///
    /// # Errors
    /// [`ServoError::Angles`] or [`ServoError::Pulses`] when there is no such servo.
    pub fn of(scale: &ServoScale) -> Result<ServoRange, ServoError> {
        let ends = |list: &[f64]| match list {
            [first, last] => [*first, *last],
            _ => [f64::NAN; 2],
        };
        let ([first_deg, last_deg], [shortest_us, longest_us]) =
            (ends(&scale.angle_deg), ends(&scale.pulse_us));
        match first_deg > last_deg {
            true => ServoRange::new([last_deg, first_deg], [longest_us, shortest_us]),
            false => ServoRange::new([first_deg, last_deg], [shortest_us, longest_us]),
        }
    }

    /// Returns the pulse for an angle, to a nanosecond; never beyond the pulses at its ends.
    ///
    /// # Errors
    /// [`ServoError::Angle`] when the angle is out of reach.
    pub fn pulse(&self, angle_deg: f64) -> Result<Duration, ServoError> {
        let [first_us, last_us] = self.pulse_us;
        let (shortest_us, longest_us) = (first_us.min(last_us), first_us.max(last_us));
        let pulse_us = self.pulse_us(angle_deg)?.clamp(shortest_us, longest_us);
        Ok(Duration::from_nanos(libm::round(pulse_us * 1000.0) as u64))
    }

    /// Returns the pulse for the angle within reach that is next to one; `None` for what is no number.
    pub fn nearest_pulse(&self, angle_deg: f64) -> Option<Duration> {
        let [low_deg, high_deg] = self.angle_deg;
        self.pulse(angle_deg.clamp(low_deg, high_deg)).ok()
    }

    /// Returns the pulse width for an angle, microseconds.
    ///
    /// # Errors
    /// [`ServoError::Angle`] when the angle is out of reach.
    pub fn pulse_us(&self, angle_deg: f64) -> Result<f64, ServoError> {
        let [low_deg, high_deg] = self.angle_deg;
        if !(low_deg..=high_deg).contains(&angle_deg) {
            return Err(ServoError::Angle {
                angle_deg,
                low_deg,
                high_deg,
            });
        }
        Ok(between(
            (angle_deg - low_deg) / (high_deg - low_deg),
            self.pulse_us,
        ))
    }

    /// Returns the angle that a pulse width stands for, degrees.
    ///
    /// # Errors
    /// [`ServoError::Pulse`] when the pulse width is out of range.
    pub fn angle_deg(&self, pulse_us: f64) -> Result<f64, ServoError> {
        let [first_us, last_us] = self.pulse_us;
        let share = (pulse_us - first_us) / (last_us - first_us);
        if !(0.0..=1.0).contains(&share) {
            return Err(ServoError::Pulse {
                pulse_us,
                first_us,
                last_us,
            });
        }
        Ok(between(share, self.angle_deg))
    }
}

fn between(share: f64, [from, to]: [f64; 2]) -> f64 {
    from + share * (to - from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn servo(low_deg: f64, high_deg: f64) -> ServoRange {
        ServoRange::new([low_deg, high_deg], [1000.0, 2000.0]).unwrap()
    }

    #[test]
    fn a_servo_mounted_upside_down_counts_backward() {
        let servo = ServoRange::new([0.0, 180.0], [2000.0, 1000.0]).unwrap();
        assert_eq!(servo.pulse_us(45.0), Ok(1750.0));
        assert_eq!(servo.angle_deg(1250.0), Ok(135.0));
    }

    #[test]
    fn a_servo_that_turns_the_other_way_has_falling_angles() {
        let scale = |angle_deg: [f64; 2]| ServoScale {
            pulse_us: vec![1000.0, 2000.0],
            angle_deg: angle_deg.to_vec(),
        };
        for (angles, angle_deg, expected_us) in [
            ([-90.0, 90.0], -90.0, 1000),
            ([-90.0, 90.0], 45.0, 1750),
            ([90.0, -90.0], 45.0, 1250),
            ([90.0, -90.0], -90.0, 2000),
        ] {
            let servo = ServoRange::of(&scale(angles)).unwrap();
            assert_eq!(
                servo.pulse(angle_deg),
                Ok(Duration::from_micros(expected_us))
            );
        }
        assert!(ServoRange::of(&ServoScale::default()).is_err());
    }

    #[test]
    fn what_is_out_of_reach_is_refused() {
        let servo = servo(45.0, 135.0);
        assert!(matches!(
            servo.pulse_us(135.1),
            Err(ServoError::Angle { .. })
        ));
        assert!(matches!(
            servo.pulse_us(f64::NAN),
            Err(ServoError::Angle { .. })
        ));
        assert!(matches!(
            servo.angle_deg(999.0),
            Err(ServoError::Pulse { .. })
        ));
    }

    #[test]
    fn impossible_servos_are_refused() {
        for angles in [
            [90.0, 90.0],
            [90.0, 0.0],
            [0.0, 361.0],
            [f64::NAN, 1.0],
            [0.0, f64::INFINITY],
        ] {
            assert!(matches!(
                ServoRange::new(angles, [1000.0, 2000.0]),
                Err(ServoError::Angles { .. })
            ));
        }
        for pulses in [
            [1000.0, 1000.0],
            [-1.0, 2000.0],
            [0.0, 1e9],
            [f64::NAN, 1.0],
        ] {
            assert!(matches!(
                ServoRange::new([0.0, 180.0], pulses),
                Err(ServoError::Pulses { .. })
            ));
        }
    }

    proptest! {
        #[test]
        fn no_angle_gives_a_pulse_beyond_the_ends(angle in -200.0..200.0f64, first in 300.0..3000.0f64, last in 300.0..3000.0f64) {
            let scale = ServoScale { pulse_us: vec![first, last], angle_deg: vec![-90.0, 90.0] };
            let Ok(servo) = ServoRange::of(&scale) else { return Ok(()) };
            let ns = |us: f64| (us * 1000.0).round() as u128;
            match servo.pulse(angle) {
                Ok(pulse) => prop_assert!((ns(first.min(last))..=ns(first.max(last))).contains(&pulse.as_nanos())),
                Err(_) => prop_assert!(angle.abs() > 90.0),
            }
        }

        #[test]
        fn pulse_and_angle_are_each_other_s_inverse(low in -90.0..90.0f64, span in 1.0..360.0f64, share in 0.0..1.0f64) {
            let servo = servo(low, low + span);
            let angle_deg = low + share * span;
            let back = servo.angle_deg(servo.pulse_us(angle_deg).unwrap()).unwrap();
            prop_assert!((back - angle_deg).abs() < 1e-9);
        }
    }
}
