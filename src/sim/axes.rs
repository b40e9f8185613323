//! The axes of a beam in space: where a sensor's rays point when the vehicle that carries it leans. What makes it lean is
//! not known here.

use crate::geom::{Angle, Attitude, Vector};

/// Three perpendicular unit vectors of the local frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Axes {
    /// Along a beam.
    pub ahead: [f64; 3],
    /// To its left.
    pub left: [f64; 3],
    /// Above both.
    pub up: [f64; 3],
}

impl Axes {
    /// Returns the axes of a beam that lies in the plane of the vehicle, counter-clockwise from its nose.
    pub(super) fn of(attitude: Attitude, beam: Angle) -> Axes {
        if attitude.roll == Angle::ZERO && attitude.pitch == Angle::ZERO {
            let axis = Vector::polar(attitude.yaw + beam, 1.0);
            let (ahead, left) = ([axis.x_m, axis.y_m, 0.0], [-axis.y_m, axis.x_m, 0.0]);
            return Axes {
                ahead,
                left,
                up: [0.0, 0.0, 1.0],
            };
        }
        let (sin, cos) = libm::sincos(beam.radians());
        Axes {
            ahead: attitude.turned([cos, sin, 0.0]),
            left: attitude.turned([-sin, cos, 0.0]),
            up: attitude.turned([0.0, 0.0, 1.0]),
        }
    }

    /// Returns the direction of a ray that is given against these axes.
    pub(super) fn along(&self, ray: [f64; 3]) -> [f64; 3] {
        let [ahead, left, up] = ray;
        std::array::from_fn(|axis| {
            ahead * self.ahead[axis] + left * self.left[axis] + up * self.up[axis]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn axes_are_unit_vectors_at_right_angles_and_leave_the_plane_as_the_vehicle_leans(
            roll in -80.0..80.0f64, pitch in -80.0..80.0f64, yaw in -180.0..180.0f64, beam in -180.0..180.0f64,
        ) {
            let [turn, tilt, heading] = [roll, pitch, yaw].map(Angle::from_degrees);
            let attitude = Attitude { roll: turn, pitch: tilt, yaw: heading };
            let axes = Axes::of(attitude, Angle::from_degrees(beam));
            let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            for axis in [axes.ahead, axes.left, axes.up] {
                prop_assert!((dot(axis, axis) - 1.0).abs() < 1e-12);
            }
            prop_assert!(dot(axes.ahead, axes.left).abs() < 1e-12 && dot(axes.left, axes.up).abs() < 1e-12);
            let (roll, pitch, beam) = (roll.to_radians(), pitch.to_radians(), beam.to_radians());
            let expected = beam.cos() * pitch.sin() + beam.sin() * roll.sin() * pitch.cos();
            prop_assert!((axes.ahead[2] - expected).abs() < 1e-12);
        }

        #[test]
        fn a_level_vehicle_is_the_limit_of_one_that_hardly_leans(yaw in -180.0..180.0f64, beam in -180.0..180.0f64) {
            let (yaw, beam) = (Angle::from_degrees(yaw), Angle::from_degrees(beam));
            let level = Axes::of(Attitude::level(yaw), beam);
            let leaning = Axes::of(Attitude { roll: Angle::from_degrees(1e-9), ..Attitude::level(yaw) }, beam);
            for ray in [[1.0, 0.0, 0.0], [0.6, -0.8, 0.0], [0.0, 0.6, 0.8]] {
                for (a, b) in level.along(ray).iter().zip(leaning.along(ray)) {
                    prop_assert!((a - b).abs() < 1e-9);
                }
            }
        }
    }
}
