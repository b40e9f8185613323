//! How a body lies in space, and where a direction of the body points then. Closed form, no filter; what makes a body
//! lean is not known here.

use crate::geom::{Angle, Vector};

/// Roll, pitch and heading of a body: applied in this order.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Attitude {
    /// Turn about the axis ahead, radians: positive lowers the right side.
    pub roll_rad: f64,
    /// Turn about the axis to the left, radians: positive lifts the nose.
    pub pitch_rad: f64,
    /// Where the body faces.
    pub heading: Angle,
}

/// Three perpendicular unit vectors of the local frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Axes {
    /// Along a beam.
    pub ahead: [f64; 3],
    /// To its left.
    pub left: [f64; 3],
    /// Above both.
    pub up: [f64; 3],
}

impl Attitude {
    /// Gives the attitude of a body that stands upright.
    pub fn level(heading: Angle) -> Attitude {
        Attitude { heading, ..Attitude::default() }
    }

    /// Gives the axes of a beam that lies in the plane of the body, counter-clockwise from its nose.
    pub fn axes(&self, beam: Angle) -> Axes {
        if self.roll_rad == 0.0 && self.pitch_rad == 0.0 {
            let axis = Vector::polar(self.heading + beam, 1.0);
            let (ahead, left) = ([axis.x_m, axis.y_m, 0.0], [-axis.y_m, axis.x_m, 0.0]);
            return Axes { ahead, left, up: [0.0, 0.0, 1.0] };
        }
        let (sin, cos) = libm::sincos(beam.radians());
        Axes {
            ahead: self.turned([cos, sin, 0.0]),
            left: self.turned([-sin, cos, 0.0]),
            up: self.turned([0.0, 0.0, 1.0]),
        }
    }

    /// Turns a direction of the body (ahead, left, up) into one of the local frame.
    pub fn turned(&self, direction: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = direction;
        let (sin, cos) = libm::sincos(self.roll_rad);
        let (y, z) = (y * cos - z * sin, y * sin + z * cos);
        let (sin, cos) = libm::sincos(self.pitch_rad);
        let (x, z) = (x * cos - z * sin, x * sin + z * cos);
        let (sin, cos) = libm::sincos(self.heading.radians());
        [x * cos - y * sin, x * sin + y * cos, z]
    }
}

impl Axes {
    /// Gives the direction of a ray that is given against these axes.
    pub fn along(&self, ray: [f64; 3]) -> [f64; 3] {
        let [ahead, left, up] = ray;
        std::array::from_fn(|axis| ahead * self.ahead[axis] + left * self.left[axis] + up * self.up[axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn attitude(roll_deg: f64, pitch_deg: f64, heading_deg: f64) -> Attitude {
        let [roll_rad, pitch_rad] = [roll_deg, pitch_deg].map(f64::to_radians);
        Attitude { roll_rad, pitch_rad, heading: Angle::from_degrees(heading_deg) }
    }

    fn check(attitude: Attitude, beam_deg: f64, expected: [f64; 3]) {
        let got = attitude.axes(Angle::from_degrees(beam_deg)).ahead;
        let near = got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near, "{attitude:?} {beam_deg}°: {got:?}");
    }

    #[test]
    fn a_nose_up_looks_up_and_a_roll_lowers_the_right_side() {
        let half = 0.5f64.sqrt();
        check(attitude(0.0, 0.0, 90.0), 0.0, [0.0, 1.0, 0.0]);
        check(attitude(0.0, 45.0, 90.0), 0.0, [0.0, half, half]);
        check(attitude(45.0, 0.0, 0.0), -90.0, [0.0, -half, -half]);
        check(attitude(45.0, 0.0, 0.0), 0.0, [1.0, 0.0, 0.0]);
        // Roll before pitch: the left wing goes up by the roll, and the pitch then tilts that backwards.
        check(attitude(90.0, 90.0, 0.0), 90.0, [-1.0, 0.0, 0.0]);
    }

    proptest! {
        #[test]
        fn beams_keep_unit_length_and_right_angles(
            roll in -80.0..80.0f64, pitch in -80.0..80.0f64, heading in -180.0..180.0f64, beam in -180.0..180.0f64,
        ) {
            let axes = attitude(roll, pitch, heading).axes(Angle::from_degrees(beam));
            let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            for axis in [axes.ahead, axes.left, axes.up] {
                prop_assert!((dot(axis, axis) - 1.0).abs() < 1e-12);
            }
            prop_assert!(dot(axes.ahead, axes.left).abs() < 1e-12 && dot(axes.left, axes.up).abs() < 1e-12);
            // How far a beam leaves the plane follows from the roll, the pitch and its direction alone.
            let (roll, pitch, beam) = (roll.to_radians(), pitch.to_radians(), beam.to_radians());
            let expected = beam.cos() * pitch.sin() + beam.sin() * roll.sin() * pitch.cos();
            prop_assert!((axes.ahead[2] - expected).abs() < 1e-12);
        }
    }
}
