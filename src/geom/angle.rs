//! Directions: `Angle` counter-clockwise from x, `Bearing` clockwise from north. Both wrap.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::{Add, Neg, Sub};

use serde::{Deserialize, Serialize};

/// A sense of turning.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Turn {
    /// To the right.
    Clockwise,
    /// To the left.
    CounterClockwise,
}

/// A direction, counter-clockwise from the x axis, kept in (−π, π] radians.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Angle(f64);

impl Angle {
    /// Along the x axis.
    pub const ZERO: Angle = Angle(0.0);

    /// Makes an angle from radians; any finite value is wrapped into (−π, π].
    #[inline]
    pub fn from_radians(radians_rad: f64) -> Angle {
        if radians_rad > -PI && radians_rad <= PI {
            return Angle(radians_rad);
        }
        let wrapped = radians_rad - TAU * libm::floor(radians_rad / TAU);
        Angle(if wrapped > PI { wrapped - TAU } else { wrapped })
    }

    /// Makes an angle from degrees.
    #[inline]
    pub fn from_degrees(degrees: f64) -> Angle {
        Angle::from_radians(degrees.to_radians())
    }

    /// Returns the radians in (−π, π].
    #[inline]
    pub fn radians(self) -> f64 {
        self.0
    }

    /// Returns the degrees in (−180, 180].
    #[inline]
    pub fn degrees(self) -> f64 {
        self.0.to_degrees()
    }

    /// Returns the degrees in [0, 360).
    #[inline]
    pub fn positive_degrees(self) -> f64 {
        let degrees = self.degrees();
        if degrees < 0.0 {
            (degrees + 360.0) % 360.0
        } else {
            degrees
        }
    }

    /// Returns the periodic difference this − other in [−π, π) radians: at exactly half a turn it is negative, where
    /// the shortest turn (`-`) is positive.
    #[inline]
    pub fn difference_rad(self, other: Angle) -> f64 {
        let turn_rad = (self - other).radians();
        if turn_rad >= PI { -PI } else { turn_rad }
    }

    /// Returns whether the two directions differ by at most a tolerance, radians.
    #[inline]
    pub fn is_near(self, other: Angle, tolerance_rad: f64) -> bool {
        self.difference_rad(other).abs() <= tolerance_rad
    }

    /// Returns the quicker way to turn from this direction to another; counter-clockwise when both are equally quick.
    #[inline]
    pub fn turn_to(self, other: Angle) -> Turn {
        if self.difference_rad(other) > 0.0 {
            Turn::Clockwise
        } else {
            Turn::CounterClockwise
        }
    }

    /// Returns the compass bearing of this direction where the x axis points east.
    #[inline]
    pub fn bearing(self) -> Bearing {
        Bearing::from_radians(FRAC_PI_2 - self.0)
    }
}

impl Add for Angle {
    type Output = Angle;
    #[inline]
    fn add(self, other: Angle) -> Angle {
        Angle::from_radians(self.0 + other.0)
    }
}

/// The shortest turn from `other` to this angle.
impl Sub for Angle {
    type Output = Angle;
    #[inline]
    fn sub(self, other: Angle) -> Angle {
        Angle::from_radians(self.0 - other.0)
    }
}

impl Neg for Angle {
    type Output = Angle;
    #[inline]
    fn neg(self) -> Angle {
        Angle::from_radians(-self.0)
    }
}

/// A compass direction, clockwise from north, kept in [0, 2π) radians.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Bearing(f64);

impl Bearing {
    /// Makes a bearing from radians; any finite value is wrapped into [0, 2π).
    #[inline]
    pub fn from_radians(radians_rad: f64) -> Bearing {
        let wrapped = radians_rad - TAU * libm::floor(radians_rad / TAU);
        Bearing(if wrapped >= TAU { 0.0 } else { wrapped })
    }

    /// Makes a bearing from degrees.
    #[inline]
    pub fn from_degrees(degrees: f64) -> Bearing {
        Bearing::from_radians(degrees.to_radians())
    }

    /// Returns the radians in [0, 2π).
    #[inline]
    pub fn radians(self) -> f64 {
        self.0
    }

    /// Returns the degrees in [0, 360).
    #[inline]
    pub fn degrees(self) -> f64 {
        self.0.to_degrees()
    }

    /// Returns the direction where the x axis points east.
    #[inline]
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
                (Bearing::from_degrees(bearing).angle() - Angle::from_degrees(angle))
                    .radians()
                    .abs()
                    < 1e-9
            );
        }
    }

    #[test]
    fn the_quicker_turn_goes_the_shorter_way() {
        let turn = |from: f64, to: f64| Angle::from_degrees(from).turn_to(Angle::from_degrees(to));
        assert_eq!(
            (turn(0.0, 90.0), turn(90.0, 0.0)),
            (Turn::CounterClockwise, Turn::Clockwise)
        );
        assert_eq!(
            (turn(170.0, -170.0), turn(-170.0, 170.0)),
            (Turn::CounterClockwise, Turn::Clockwise)
        );
        assert_eq!(
            (turn(0.0, 180.0), turn(180.0, 0.0)),
            (Turn::CounterClockwise, Turn::CounterClockwise)
        );
    }

    #[test]
    fn directions_are_near_across_the_seam() {
        let (a, b) = (Angle::from_degrees(179.0), Angle::from_degrees(-179.0));
        assert!(a.is_near(b, 2.1_f64.to_radians()) && !a.is_near(b, 1.9_f64.to_radians()));
        assert_eq!((a.positive_degrees(), b.positive_degrees()), (179.0, 181.0));
        assert!((0.0..360.0).contains(&Angle::from_radians(-1e-300).positive_degrees()));
    }

    #[test]
    fn a_difference_is_the_shortest_turn() {
        let turn = Angle::from_degrees(-170.0) - Angle::from_degrees(170.0);
        assert!((turn.degrees() - 20.0).abs() < 1e-9);
    }
}
