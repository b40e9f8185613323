//! Directions: `Angle` counter-clockwise from x, `Bearing` clockwise from north. Both wrap.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::{Add, Neg, Sub};

use serde::{Deserialize, Serialize};

/// A direction, counter-clockwise from the x axis, kept in (−π, π] radians.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Angle(f64);

impl Angle {
    /// Along the x axis.
    pub const ZERO: Angle = Angle(0.0);

    /// Makes an angle from radians; any finite value is wrapped into (−π, π].
    pub fn from_radians(radians_rad: f64) -> Angle {
        if radians_rad > -PI && radians_rad <= PI {
            return Angle(radians_rad);
        }
        let wrapped = radians_rad - TAU * libm::floor(radians_rad / TAU);
        Angle(if wrapped > PI { wrapped - TAU } else { wrapped })
    }

    /// Makes an angle from degrees.
    pub fn from_degrees(degrees: f64) -> Angle {
        Angle::from_radians(degrees.to_radians())
    }

    /// Gives the radians in (−π, π].
    pub fn radians(self) -> f64 {
        self.0
    }

    /// Gives the degrees in (−180, 180].
    pub fn degrees(self) -> f64 {
        self.0.to_degrees()
    }

    /// Gives the compass bearing of this direction where the x axis points east.
    pub fn bearing(self) -> Bearing {
        Bearing::from_radians(FRAC_PI_2 - self.0)
    }
}

impl Add for Angle {
    type Output = Angle;
    fn add(self, other: Angle) -> Angle {
        Angle::from_radians(self.0 + other.0)
    }
}

/// The shortest turn from `other` to this angle.
impl Sub for Angle {
    type Output = Angle;
    fn sub(self, other: Angle) -> Angle {
        Angle::from_radians(self.0 - other.0)
    }
}

impl Neg for Angle {
    type Output = Angle;
    fn neg(self) -> Angle {
        Angle::from_radians(-self.0)
    }
}

/// A compass direction, clockwise from north, kept in [0, 2π) radians.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Bearing(f64);

impl Bearing {
    /// Makes a bearing from radians; any finite value is wrapped into [0, 2π).
    pub fn from_radians(radians_rad: f64) -> Bearing {
        let wrapped = radians_rad - TAU * libm::floor(radians_rad / TAU);
        Bearing(if wrapped >= TAU { 0.0 } else { wrapped })
    }

    /// Makes a bearing from degrees.
    pub fn from_degrees(degrees: f64) -> Bearing {
        Bearing::from_radians(degrees.to_radians())
    }

    /// Gives the radians in [0, 2π).
    pub fn radians(self) -> f64 {
        self.0
    }

    /// Gives the degrees in [0, 360).
    pub fn degrees(self) -> f64 {
        self.0.to_degrees()
    }

    /// Gives the direction where the x axis points east.
    pub fn angle(self) -> Angle {
        Angle::from_radians(FRAC_PI_2 - self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_angle(degrees: f64, expected: f64) {
        let got = Angle::from_degrees(degrees).degrees();
        assert!((got - expected).abs() < 1e-9, "{degrees} gave {got}");
    }

    #[test]
    fn angles_wrap_into_half_a_turn_either_way() {
        check_angle(190.0, -170.0);
        check_angle(-190.0, 170.0);
        check_angle(180.0, 180.0);
        check_angle(-180.0, 180.0);
        check_angle(725.0, 5.0);
    }

    #[test]
    fn bearings_run_clockwise_from_north() {
        for (angle, bearing) in [(90.0, 0.0), (0.0, 90.0), (-90.0, 180.0), (180.0, 270.0)] {
            assert!((Angle::from_degrees(angle).bearing().degrees() - bearing).abs() < 1e-9);
            assert!(
                (Bearing::from_degrees(bearing).angle() - Angle::from_degrees(angle)).radians().abs() < 1e-9
            );
        }
    }

    #[test]
    fn a_difference_is_the_shortest_turn() {
        let turn = Angle::from_degrees(-170.0) - Angle::from_degrees(170.0);
        assert!((turn.degrees() - 20.0).abs() < 1e-9);
    }
}
