//! Points and vectors of the plane, metres, local frame.

use std::fmt;

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Position, Velocity};

use super::Angle;

/// A place in the local frame, metres.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Point {
    /// Metres along the venue's x axis.
    pub x_m: f64,
    /// Metres along the venue's y axis.
    pub y_m: f64,
}

/// To the millimetre, as files have places: `[1.250, -0.500]`.
impl fmt::Display for Point {
    #[inline]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{:.3}, {:.3}]", self.x_m, self.y_m)
    }
}

impl Point {
    /// Makes a point from its coordinates in metres.
    #[inline]
    pub const fn new(x_m: f64, y_m: f64) -> Point {
        Point { x_m, y_m }
    }

    /// Returns the distance to another point, metres.
    #[inline]
    pub fn distance_to(self, other: Point) -> f64 {
        (other - self).length_m()
    }

    /// Returns the point a share of the way to `other` (0 = here, 1 = there).
    #[inline]
    pub fn toward(self, other: Point, share: f64) -> Point {
        self + (other - self) * share
    }

    /// Returns the direction from here to `other`; angle zero when they coincide.
    #[inline]
    pub fn angle_to(self, other: Point) -> Angle {
        (other - self).angle()
    }

    /// Returns whether both coordinates are finite.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite()
    }
}

/// A displacement in the local frame, metres.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Vector {
    /// Metres along the venue's x axis.
    pub x_m: f64,
    /// Metres along the venue's y axis.
    pub y_m: f64,
}

impl Vector {
    /// Makes a vector from its components in metres.
    #[inline]
    pub const fn new(x_m: f64, y_m: f64) -> Vector {
        Vector { x_m, y_m }
    }

    /// Makes a vector of a length in a direction.
    #[inline]
    pub fn polar(angle: Angle, length_m: f64) -> Vector {
        let (sin, cos) = libm::sincos(angle.radians());
        Vector::new(cos * length_m, sin * length_m)
    }

    /// Returns the length, metres.
    #[inline]
    pub fn length_m(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Returns the distance along the axes (grid distance), metres.
    #[inline]
    pub fn grid_length_m(self) -> f64 {
        self.x_m.abs() + self.y_m.abs()
    }

    /// Returns the direction; zero for the null vector.
    #[inline]
    pub fn angle(self) -> Angle {
        Angle::from_radians(libm::atan2(self.y_m, self.x_m))
    }

    /// Returns the scalar product, m².
    #[inline]
    pub fn dot(self, other: Vector) -> f64 {
        self.x_m * other.x_m + self.y_m * other.y_m
    }

    /// Returns the z component of the cross product, m²; positive when `other` lies to the left.
    #[inline]
    pub fn cross(self, other: Vector) -> f64 {
        self.x_m * other.y_m - self.y_m * other.x_m
    }

    /// Returns this vector turned a quarter to the left.
    #[inline]
    pub fn left(self) -> Vector {
        Vector::new(-self.y_m, self.x_m)
    }
}

impl Sub for Point {
    type Output = Vector;
    #[inline]
    fn sub(self, other: Point) -> Vector {
        Vector::new(self.x_m - other.x_m, self.y_m - other.y_m)
    }
}

impl Add<Vector> for Point {
    type Output = Point;
    #[inline]
    fn add(self, by: Vector) -> Point {
        Point::new(self.x_m + by.x_m, self.y_m + by.y_m)
    }
}

impl Sub<Vector> for Point {
    type Output = Point;
    #[inline]
    fn sub(self, by: Vector) -> Point {
        self + -by
    }
}

impl AddAssign<Vector> for Point {
    #[inline]
    fn add_assign(&mut self, by: Vector) {
        *self = *self + by;
    }
}

impl Add for Vector {
    type Output = Vector;
    #[inline]
    fn add(self, other: Vector) -> Vector {
        Vector::new(self.x_m + other.x_m, self.y_m + other.y_m)
    }
}

impl Sub for Vector {
    type Output = Vector;
    #[inline]
    fn sub(self, other: Vector) -> Vector {
        self + -other
    }
}

impl Neg for Vector {
    type Output = Vector;
    #[inline]
    fn neg(self) -> Vector {
        Vector::new(-self.x_m, -self.y_m)
    }
}

impl Mul<f64> for Vector {
    type Output = Vector;
    #[inline]
    fn mul(self, by: f64) -> Vector {
        Vector::new(self.x_m * by, self.y_m * by)
    }
}

impl From<Position> for Point {
    #[inline]
    fn from(position: Position) -> Point {
        Point::new(position.x_m(), position.y_m())
    }
}

impl From<Point> for Position {
    /// Rounds to millimetres, on the ground.
    #[inline]
    fn from(point: Point) -> Position {
        Position::from_metres(point.x_m, point.y_m, 0.0)
    }
}

impl From<Velocity> for Vector {
    /// Returns the displacement within a second, in the plane.
    #[inline]
    fn from(velocity: Velocity) -> Vector {
        Vector::new(velocity.x_mps(), velocity.y_mps())
    }
}

impl From<Vector> for Velocity {
    /// Takes a displacement within a second, and rounds it to millimetres a second.
    #[inline]
    fn from(per_second: Vector) -> Velocity {
        Velocity::from_metres_per_second(per_second.x_m, per_second.y_m, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polar_vector_has_its_length_and_direction() {
        let vector = Vector::polar(Angle::from_degrees(120.0), 2.0);
        assert!((vector.length_m() - 2.0).abs() < 1e-12);
        assert!((vector.angle().degrees() - 120.0).abs() < 1e-9);
    }

    #[test]
    fn left_is_a_quarter_turn_counter_clockwise() {
        let east = Vector::new(1.0, 0.0);
        assert_eq!(east.left(), Vector::new(-0.0, 1.0));
        assert!(east.cross(east.left()) > 0.0);
    }

    #[test]
    fn places_and_velocities_travel_in_whole_millimetres() {
        let at = Point::new(1.23449, -2.0005);
        let position = Position::from(at);
        assert_eq!(
            (position.x_mm, position.y_mm, position.z_mm),
            (1234, -2001, 0)
        );
        assert!(Point::from(position).distance_to(at) < 1e-3);
        let velocity = Velocity::from(Vector::polar(Angle::from_degrees(90.0), 0.5));
        assert_eq!(
            (velocity.x_mmps, velocity.y_mmps, velocity.z_mmps),
            (0, 500, 0)
        );
        assert!((Vector::from(velocity).length_m() - 0.5).abs() < 1e-9);
    }
}
