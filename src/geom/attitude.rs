//! How a vehicle is tilted and turned.
//!
//! The body's frame: x forward, y to the left, z up. The local frame: z up. Which beams it carries is not known here.

use super::Angle;

/// Roll, pitch and yaw, applied in this order.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Attitude {
    /// About the forward axis; positive = the right side goes down.
    pub roll: Angle,
    /// About the left axis; positive = the nose goes up.
    pub pitch: Angle,
    /// About the up axis: the heading, counter-clockwise from the local x axis.
    pub yaw: Angle,
}

impl Attitude {
    /// Returns the attitude of a vehicle that stands level.
    pub fn level(yaw: Angle) -> Attitude {
        Attitude {
            yaw,
            ..Attitude::default()
        }
    }

    /// Turns a vector of the body's frame into the local frame; the length stays.
    pub fn turned(self, body: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = body;
        let (sin, cos) = libm::sincos(self.roll.radians());
        let (y, z) = (y * cos - z * sin, y * sin + z * cos);
        let (sin, cos) = libm::sincos(self.pitch.radians());
        let (x, z) = (x * cos - z * sin, x * sin + z * cos);
        let (sin, cos) = libm::sincos(self.yaw.radians());
        [x * cos - y * sin, x * sin + y * cos, z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn degrees(roll: f64, pitch: f64, yaw: f64) -> Attitude {
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::from_degrees);
        Attitude { roll, pitch, yaw }
    }

    fn check(attitude: Attitude, body: [f64; 3], expected: [f64; 3]) {
        let got = attitude.turned(body);
        let is_near = got
            .iter()
            .zip(expected)
            .all(|(got, expected)| (got - expected).abs() < 1e-12);
        assert!(is_near, "{attitude:?} turns {body:?} to {got:?}");
    }

    const AHEAD: [f64; 3] = [1.0, 0.0, 0.0];
    const LEFT: [f64; 3] = [0.0, 1.0, 0.0];
    const UP: [f64; 3] = [0.0, 0.0, 1.0];

    #[test]
    fn each_angle_turns_as_its_name_says() {
        check(degrees(0.0, 0.0, 90.0), AHEAD, LEFT);
        check(degrees(0.0, 90.0, 0.0), AHEAD, UP);
        check(degrees(90.0, 0.0, 0.0), LEFT, UP);
        check(degrees(90.0, 0.0, 0.0), AHEAD, AHEAD);
    }

    #[test]
    fn roll_comes_first_and_yaw_last() {
        // Rolled onto its right side, the nose goes up about the level axis, then all turns to the left.
        check(degrees(90.0, 90.0, 90.0), AHEAD, UP);
        check(degrees(90.0, 90.0, 90.0), LEFT, [0.0, -1.0, 0.0]);
        check(degrees(0.0, 30.0, 90.0), AHEAD, [0.0, 0.75_f64.sqrt(), 0.5]);
    }

    proptest! {
        #[test]
        fn a_turn_is_the_matrix_of_the_three_turns(
            angles in proptest::array::uniform5(-400.0..400.0f64),
        ) {
            let [roll, pitch, yaw, mount, elevation] = angles;
            let [r, p, y, m, e] = angles.map(f64::to_radians);
            let body = [m.cos() * e.cos(), m.sin() * e.cos(), e.sin()];
            let turned = degrees(roll, pitch, yaw).turned(body);
            let axis = |axis: [f64; 3], by: f64| nalgebra::Rotation3::new(nalgebra::Vector3::from(axis) * by);
            // Nose up is a turn about the right axis.
            let matrix = axis(UP, y) * axis([0.0, -1.0, 0.0], p) * axis(AHEAD, r);
            let expected = matrix * nalgebra::Vector3::from(body);
            for (got, expected) in turned.iter().zip(expected.iter()) {
                prop_assert!((got - expected).abs() < 1e-9, "{turned:?} {mount} {elevation}");
            }
        }
    }
}
