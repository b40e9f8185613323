//! Affine maps of space: what a VRML Transform does to the points below it.
//!
//! Only what the reader needs; no inverses, no projections.

/// A point or direction of space, metres.
pub(super) type Xyz = [f64; 3];

/// The map p ↦ linear · p + shift.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Affine {
    linear: [Xyz; 3],
    shift: Xyz,
}

impl Affine {
    /// The map that changes nothing.
    pub(super) const IDENTITY: Affine = Affine {
        linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        shift: [0.0; 3],
    };

    /// Makes a map from the images of the three axes' coordinates (rows) and no shift.
    pub(super) const fn from_rows(linear: [Xyz; 3]) -> Affine {
        Affine {
            linear,
            shift: [0.0; 3],
        }
    }

    /// Makes a translation.
    pub(super) const fn translation(shift: Xyz) -> Affine {
        Affine {
            shift,
            ..Affine::IDENTITY
        }
    }

    /// Makes a scaling along the axes.
    pub(super) const fn scaling([x, y, z]: Xyz) -> Affine {
        Affine::from_rows([[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]])
    }

    /// Makes a right-handed rotation about an axis (Rodrigues); an axis of no length turns nothing.
    pub(super) fn rotation(axis: Xyz, angle_rad: f64) -> Affine {
        let length = libm::hypot(libm::hypot(axis[0], axis[1]), axis[2]);
        if length == 0.0 || !length.is_finite() {
            return Affine::IDENTITY;
        }
        let [x, y, z] = axis.map(|part| part / length);
        let (sin, cos) = libm::sincos(angle_rad);
        let rest = 1.0 - cos;
        Affine::from_rows([
            [
                cos + x * x * rest,
                x * y * rest - z * sin,
                x * z * rest + y * sin,
            ],
            [
                y * x * rest + z * sin,
                cos + y * y * rest,
                y * z * rest - x * sin,
            ],
            [
                z * x * rest - y * sin,
                z * y * rest + x * sin,
                cos + z * z * rest,
            ],
        ])
    }

    /// Returns the map that first does `inner`, then this one.
    pub(super) fn after(&self, inner: &Affine) -> Affine {
        let mut linear = [[0.0; 3]; 3];
        for (row, out) in self.linear.iter().zip(&mut linear) {
            for (column, cell) in out.iter_mut().enumerate() {
                *cell = (0..3).map(|k| row[k] * inner.linear[k][column]).sum();
            }
        }
        Affine {
            linear,
            shift: self.apply(inner.shift),
        }
    }

    /// Returns the image of a point.
    pub(super) fn apply(&self, point: Xyz) -> Xyz {
        let [x, y, z] = self.turn(point);
        [x + self.shift[0], y + self.shift[1], z + self.shift[2]]
    }

    /// Returns the image of a direction (no shift).
    pub(super) fn turn(&self, direction: Xyz) -> Xyz {
        self.linear.map(|row| dot(row, direction))
    }
}

/// Returns the scalar product.
pub(super) fn dot(a: Xyz, b: Xyz) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the cross product.
pub(super) fn cross(a: Xyz, b: Xyz) -> Xyz {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Returns the sum a + b.
pub(super) fn add(a: Xyz, b: Xyz) -> Xyz {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Returns the difference a − b.
pub(super) fn sub(a: Xyz, b: Xyz) -> Xyz {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn check(map: &Affine, point: Xyz, expected: Xyz) {
        let got = map.apply(point);
        for axis in 0..3 {
            assert!(
                (got[axis] - expected[axis]).abs() < 1e-12,
                "{point:?} went to {got:?}"
            );
        }
    }

    #[test]
    fn a_quarter_turn_about_z_takes_x_to_y() {
        check(
            &Affine::rotation([0.0, 0.0, 7.0], FRAC_PI_2),
            [1.0, 0.0, 3.0],
            [0.0, 1.0, 3.0],
        );
        check(
            &Affine::rotation([1.0, 0.0, 0.0], FRAC_PI_2),
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        );
        check(
            &Affine::rotation([0.0, 1.0, 0.0], FRAC_PI_2),
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0],
        );
    }

    #[test]
    fn the_inner_map_comes_first() {
        let map = Affine::scaling([2.0, 2.0, 2.0]).after(&Affine::translation([1.0, 0.0, 0.0]));
        check(&map, [1.0, 1.0, 1.0], [4.0, 2.0, 2.0]);
    }
}
