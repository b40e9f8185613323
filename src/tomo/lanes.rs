//! Numbers side by side: the transforms of the prior take several rows or columns at a time, each in a lane of its own.
//!
//! Every lane is computed as a number alone would be, to the last bit.

use std::array;
use std::ops::{Add, Div, Mul, Neg, Rem, Sub};

use rustfft::num_traits::{FromPrimitive, Num, One, Signed, Zero};

/// How many numbers stand side by side.
pub(super) const LANES: usize = 4;

/// Numbers that one operation is done to.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
#[repr(align(32))]
pub(super) struct Lanes(pub(super) [f64; LANES]);

macro_rules! lane_by_lane {
    ($operation:ident, $name:ident, $sign:tt) => {
        impl $operation for Lanes {
            type Output = Lanes;
            #[inline(always)]
            fn $name(self, other: Lanes) -> Lanes {
                Lanes(array::from_fn(|lane| self.0[lane] $sign other.0[lane]))
            }
        }
    };
}
lane_by_lane!(Add, add, +);
lane_by_lane!(Sub, sub, -);
lane_by_lane!(Mul, mul, *);
lane_by_lane!(Div, div, /);
lane_by_lane!(Rem, rem, %);

impl Lanes {
    /// The same number in every lane.
    pub(super) fn all(value: f64) -> Lanes {
        Lanes([value; LANES])
    }
}

impl Neg for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn neg(self) -> Lanes {
        Lanes(self.0.map(Neg::neg))
    }
}

impl Zero for Lanes {
    fn zero() -> Lanes {
        Lanes::default()
    }
    fn is_zero(&self) -> bool {
        self.0.iter().all(Zero::is_zero)
    }
}

impl One for Lanes {
    fn one() -> Lanes {
        Lanes::all(1.0)
    }
}

impl Num for Lanes {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;
    fn from_str_radix(text: &str, radix: u32) -> Result<Lanes, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Lanes::all)
    }
}

/// What a transform asks of its numbers; it uses none of these.
impl Signed for Lanes {
    fn abs(&self) -> Lanes {
        Lanes(self.0.map(f64::abs))
    }
    fn abs_sub(&self, other: &Lanes) -> Lanes {
        Lanes(array::from_fn(|lane| {
            Signed::abs_sub(&self.0[lane], &other.0[lane])
        }))
    }
    fn signum(&self) -> Lanes {
        Lanes(self.0.map(f64::signum))
    }
    fn is_positive(&self) -> bool {
        self.0.iter().all(Signed::is_positive)
    }
    fn is_negative(&self) -> bool {
        self.0.iter().all(Signed::is_negative)
    }
}

impl FromPrimitive for Lanes {
    fn from_i64(value: i64) -> Option<Lanes> {
        f64::from_i64(value).map(Lanes::all)
    }
    fn from_u64(value: u64) -> Option<Lanes> {
        f64::from_u64(value).map(Lanes::all)
    }
    fn from_f64(value: f64) -> Option<Lanes> {
        Some(Lanes::all(value))
    }
}
