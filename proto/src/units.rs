//! Quantities as they travel: whole numbers in small units, and the only conversions from and to metres and radians.
//!
//! The types hold exactly what is on the wire, so writing and reading a value again changes nothing. Precision is lost
//! in one place only, when a value is made from an `f64`, by these rules:
//!
//! | type | unit | rounding | too large | not finite |
//! | --- | --- | --- | --- | --- |
//! | [`Position`], [`Velocity`] | mm, mm/s | nearest, halves away from zero | the nearest `i32` but its least | `i32::MIN` |
//! | [`Heading`] | 1e-4 rad | wrapped into a turn, then nearest | wraps | `u16::MAX` |
//! | [`Tilt`] | 1e-4 rad | nearest, halves away from zero | unknown | unknown |
//! | [`Deviation`] | mm | nearest | unknown, and so is what is negative | unknown |
//! | [`Permille`] | 1/1000 | nearest | 0 or 1000 | none |
//!
//! A value under its bound comes back within half a unit, and converting what came back gives the same whole number.
//! What a place, a velocity or a heading cannot say is beyond the bounds of `Message::check`, so a node that does not
//! know where it is cannot pass for one at the datum. Deliberately absent: arithmetic and geometry.

use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

/// Units of an angle in a radian.
const PER_RADIAN: f64 = 1e4;

/// A place in the venue's local frame, millimetres.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct Position {
    /// Along the venue's x axis.
    pub x_mm: i32,
    /// Along the venue's y axis.
    pub y_mm: i32,
    /// Above the datum; 0 for what drives on the ground.
    pub z_mm: i32,
}

impl Position {
    /// Returns the place at these coordinates.
    pub fn from_metres(x_m: f64, y_m: f64, z_m: f64) -> Position {
        Position {
            x_mm: to_thousandths(x_m),
            y_mm: to_thousandths(y_m),
            z_mm: to_thousandths(z_m),
        }
    }

    /// Returns the coordinate along the x axis, metres; not a number for what was none.
    pub fn x_m(self) -> f64 {
        from_thousandths(self.x_mm)
    }

    /// Returns the coordinate along the y axis, metres; not a number for what was none.
    pub fn y_m(self) -> f64 {
        from_thousandths(self.y_mm)
    }

    /// Returns the height above the datum, metres; not a number for what was none.
    pub fn z_m(self) -> f64 {
        from_thousandths(self.z_mm)
    }
}

/// A velocity along the axes of the venue's local frame, millimetres a second.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct Velocity {
    /// Along the venue's x axis.
    pub x_mmps: i32,
    /// Along the venue's y axis.
    pub y_mmps: i32,
    /// Upward.
    pub z_mmps: i32,
}

impl Velocity {
    /// Returns the velocity with these components.
    pub fn from_metres_per_second(x_mps: f64, y_mps: f64, z_mps: f64) -> Velocity {
        Velocity {
            x_mmps: to_thousandths(x_mps),
            y_mmps: to_thousandths(y_mps),
            z_mmps: to_thousandths(z_mps),
        }
    }

    /// Returns the component along the x axis, m/s; not a number for what was none.
    pub fn x_mps(self) -> f64 {
        from_thousandths(self.x_mmps)
    }

    /// Returns the component along the y axis, m/s; not a number for what was none.
    pub fn y_mps(self) -> f64 {
        from_thousandths(self.y_mmps)
    }

    /// Returns the upward component, m/s; not a number for what was none.
    pub fn z_mps(self) -> f64 {
        from_thousandths(self.z_mmps)
    }
}

/// A direction in the plane, counter-clockwise from the x axis, 0 to [`Heading::LAST`] in 1e-4 rad.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct Heading(pub u16);

impl Heading {
    /// The last direction before a full turn.
    pub const LAST: Heading = Heading(62_831);
    /// What a number of radians that is none becomes; no message may hold it.
    const NONE: Heading = Heading(u16::MAX);

    /// Returns the direction of an angle.
    pub fn from_radians(angle_rad: f64) -> Heading {
        if !angle_rad.is_finite() {
            return Heading::NONE;
        }
        let units = (angle_rad.rem_euclid(TAU) * PER_RADIAN).round() as u16;
        // Within half a unit of a full turn is direction 0.
        if units > Heading::LAST.0 {
            Heading(0)
        } else {
            Heading(units)
        }
    }

    /// Returns the angle, from 0 to under 2π rad; not a number for what was none.
    pub fn radians(self) -> f64 {
        if self > Heading::LAST {
            f64::NAN
        } else {
            f64::from(self.0) / PER_RADIAN
        }
    }
}

/// A roll or a pitch, 1e-4 rad, within half a turn to either side; or not known.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct Tilt(pub i16);

impl Tilt {
    /// The largest tilt to either side: half a turn.
    pub const LAST: Tilt = Tilt(31_416);
    /// A tilt that is not known.
    pub const UNKNOWN: Tilt = Tilt(i16::MIN);

    /// Returns the tilt by an angle; unknown beyond half a turn.
    pub fn from_radians(angle_rad: f64) -> Tilt {
        if angle_rad.abs() <= PI {
            Tilt((angle_rad * PER_RADIAN).round() as i16)
        } else {
            Tilt::UNKNOWN
        }
    }

    /// Returns the angle, radians; `None` when it is not known. Half a turn is π itself.
    pub fn radians(self) -> Option<f64> {
        (self != Tilt::UNKNOWN).then(|| (f64::from(self.0) / PER_RADIAN).clamp(-PI, PI))
    }
}

/// The standard deviation of each coordinate of a place, millimetres up to 65.534 m; or not known.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct Deviation(pub u16);

impl Deviation {
    /// A deviation that is not known, or larger than can be said; it sorts behind all others.
    pub const UNKNOWN: Deviation = Deviation(u16::MAX);

    /// Returns a deviation; unknown when it is negative, too large, or not a number.
    pub fn from_metres(sd_m: f64) -> Deviation {
        let millimetres = (sd_m * 1000.0).round();
        let is_known = (0.0..f64::from(Deviation::UNKNOWN.0)).contains(&millimetres);
        if is_known {
            Deviation(millimetres as u16)
        } else {
            Deviation::UNKNOWN
        }
    }

    /// Returns the deviation, metres; `None` when it is not known.
    pub fn metres(self) -> Option<f64> {
        (self != Deviation::UNKNOWN).then(|| f64::from(self.0) / 1000.0)
    }
}

/// A share of a whole, 0 to 1000 thousandths.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct Permille(pub u16);

impl Permille {
    /// The whole.
    pub const WHOLE: Permille = Permille(1000);

    /// Returns the share nearest to a fraction; `None` when it is not a number.
    pub fn from_fraction(fraction: f64) -> Option<Permille> {
        (!fraction.is_nan()).then(|| Permille((fraction.clamp(0.0, 1.0) * 1000.0).round() as u16))
    }

    /// Returns the share as a fraction of one.
    pub fn fraction(self) -> f64 {
        f64::from(self.0) / 1000.0
    }
}

/// A pose as a vehicle knows it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct PoseReport {
    /// The place.
    pub at: Position,
    /// Where the front points.
    pub heading: Heading,
    /// Standard deviation of each coordinate of the place.
    pub sd: Deviation,
}

/// Returns thousandths; the least number stands for what is none.
fn to_thousandths(value: f64) -> i32 {
    if !value.is_finite() {
        return i32::MIN;
    }
    // A conversion to i32 goes to the nearest one.
    ((value * 1000.0).round() as i32).max(-i32::MAX)
}

fn from_thousandths(thousandths: i32) -> f64 {
    if thousandths == i32::MIN {
        f64::NAN
    } else {
        f64::from(thousandths) / 1000.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NOT_FINITE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

    /// The shortest way between two directions, radians.
    fn apart_rad(a_rad: f64, b_rad: f64) -> f64 {
        let turn_rad = (a_rad - b_rad).rem_euclid(TAU);
        turn_rad.min(TAU - turn_rad)
    }

    proptest! {
        #[test]
        fn a_place_comes_back_within_half_a_millimetre(metres in prop::array::uniform3(-1e6..1e6)) {
            let [x_m, y_m, z_m] = metres;
            let at = Position::from_metres(x_m, y_m, z_m);
            for (before_m, after_m) in [(x_m, at.x_m()), (y_m, at.y_m()), (z_m, at.z_m())] {
                prop_assert!((before_m - after_m).abs() <= 0.0005 + 1e-9, "{before_m} {after_m}");
            }
            prop_assert_eq!(Position::from_metres(at.x_m(), at.y_m(), at.z_m()), at);
        }

        #[test]
        fn every_place_of_whole_millimetres_is_kept(x_mm in any::<i32>(), y_mm in any::<i32>(), z_mm in any::<i32>()) {
            let at = Position { x_mm, y_mm, z_mm };
            prop_assert_eq!(Position::from_metres(at.x_m(), at.y_m(), at.z_m()), at);
        }

        #[test]
        fn a_velocity_comes_back_within_half_a_millimetre_a_second(mps in prop::array::uniform3(-1e3..1e3)) {
            let [x_mps, y_mps, z_mps] = mps;
            let velocity = Velocity::from_metres_per_second(x_mps, y_mps, z_mps);
            let back = [velocity.x_mps(), velocity.y_mps(), velocity.z_mps()];
            for (before_mps, after_mps) in mps.into_iter().zip(back) {
                prop_assert!((before_mps - after_mps).abs() <= 0.0005 + 1e-12);
            }
            prop_assert_eq!(Velocity::from_metres_per_second(back[0], back[1], back[2]), velocity);
        }

        #[test]
        fn a_heading_comes_back_within_half_a_unit(angle_rad in -1e3..1e3) {
            let heading = Heading::from_radians(angle_rad);
            prop_assert!(heading <= Heading::LAST);
            prop_assert!(apart_rad(heading.radians(), angle_rad) <= 0.5e-4 + 1e-9);
            prop_assert_eq!(Heading::from_radians(heading.radians()), heading);
        }

        #[test]
        fn a_tilt_comes_back_within_half_a_unit(angle_rad in -PI..=PI) {
            let tilt = Tilt::from_radians(angle_rad);
            let back_rad = tilt.radians().unwrap();
            prop_assert!((back_rad - angle_rad).abs() <= 0.5e-4 + 1e-12);
            prop_assert_eq!(Tilt::from_radians(back_rad), tilt);
        }

        #[test]
        fn a_deviation_comes_back_within_half_a_millimetre(sd_m in 0.0..65.534) {
            let sd = Deviation::from_metres(sd_m);
            prop_assert!((sd.metres().unwrap() - sd_m).abs() <= 0.0005 + 1e-12);
        }

        #[test]
        fn a_share_comes_back_within_half_a_thousandth(fraction in 0.0..=1.0) {
            let share = Permille::from_fraction(fraction).unwrap();
            prop_assert!((share.fraction() - fraction).abs() <= 0.0005 + 1e-12);
        }
    }

    #[test]
    fn every_whole_number_of_a_small_type_is_kept() {
        for units in 0..=Heading::LAST.0 {
            let heading = Heading(units);
            assert_eq!(Heading::from_radians(heading.radians()), heading);
        }
        for units in (-Tilt::LAST.0..=Tilt::LAST.0).map(Tilt) {
            assert_eq!(Tilt::from_radians(units.radians().unwrap()), units);
        }
        for sd in (0..u16::MAX).map(Deviation) {
            assert_eq!(Deviation::from_metres(sd.metres().unwrap()), sd);
        }
        for share in (0..=Permille::WHOLE.0).map(Permille) {
            assert_eq!(Permille::from_fraction(share.fraction()), Some(share));
        }
    }

    #[test]
    fn what_is_no_place_does_not_become_the_datum() {
        for coordinate_m in NOT_FINITE {
            let at = Position::from_metres(0.0, coordinate_m, 0.0);
            assert_eq!(at.y_mm, i32::MIN);
            assert!(at.y_m().is_nan());
            let velocity = Velocity::from_metres_per_second(coordinate_m, 0.0, 0.0);
            assert_eq!(velocity.x_mmps, i32::MIN);
        }
    }

    #[test]
    fn places_beyond_the_wire_go_to_its_rim() {
        let at = Position::from_metres(1e12, -1e12, -2_147_483.648);
        assert_eq!(
            at,
            Position {
                x_mm: i32::MAX,
                y_mm: -i32::MAX,
                z_mm: -i32::MAX
            }
        );
        assert_eq!(Position::from_metres(at.x_m(), at.y_m(), at.z_m()), at);
    }

    #[test]
    fn halves_are_rounded_away_from_zero() {
        assert_eq!(
            Position::from_metres(0.0625 / 2.0, -0.0625 / 2.0, 0.5e-3),
            Position {
                x_mm: 31,
                y_mm: -31,
                z_mm: 1
            }
        );
        assert_eq!(
            Position::from_metres(0.0125, -0.0125, 0.0),
            Position {
                x_mm: 13,
                y_mm: -13,
                z_mm: 0
            }
        );
    }

    #[test]
    fn headings_wrap_and_what_is_none_stays_none() {
        assert_eq!(Heading::from_radians(-1e-4), Heading(62_831));
        assert_eq!(Heading::from_radians(TAU), Heading(0));
        assert_eq!(Heading::from_radians(TAU - 1e-5), Heading(0));
        assert_eq!(Heading::from_radians(-1e-30), Heading(0));
        for angle_rad in NOT_FINITE {
            let none = Heading::from_radians(angle_rad);
            assert!(none > Heading::LAST && none.radians().is_nan());
        }
    }

    #[test]
    fn tilts_and_deviations_that_cannot_be_said_are_unknown() {
        for angle_rad in NOT_FINITE.into_iter().chain([3.2, -3.2]) {
            assert_eq!(Tilt::from_radians(angle_rad), Tilt::UNKNOWN);
        }
        assert_eq!(Tilt::UNKNOWN.radians(), None);
        for sd_m in NOT_FINITE.into_iter().chain([-0.001, 65.535, 1e9]) {
            assert_eq!(Deviation::from_metres(sd_m), Deviation::UNKNOWN);
        }
        assert_eq!(Deviation::UNKNOWN.metres(), None);
        assert_eq!(Deviation::from_metres(-0.0), Deviation(0));
    }

    #[test]
    fn shares_beyond_the_whole_are_the_whole() {
        assert_eq!(Permille::from_fraction(1.2), Some(Permille::WHOLE));
        assert_eq!(
            Permille::from_fraction(f64::INFINITY),
            Some(Permille::WHOLE)
        );
        assert_eq!(Permille::from_fraction(-0.1), Some(Permille(0)));
        assert_eq!(Permille::from_fraction(f64::NAN), None);
    }
}
