//! Rectangles along the axes of the local frame.

use serde::{Deserialize, Serialize};

use super::{Point, Polygon, Segment};

/// A rectangle along the axes, metres; `min` is its south-west corner.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Rect {
    /// The corner with the smallest coordinates.
    pub min: Point,
    /// The corner with the largest coordinates.
    pub max: Point,
}

impl Rect {
    /// Makes a rectangle from two opposite corners, in any order.
    #[inline]
    pub fn new(a: Point, b: Point) -> Rect {
        Rect {
            min: Point::new(a.x_m.min(b.x_m), a.y_m.min(b.y_m)),
            max: Point::new(a.x_m.max(b.x_m), a.y_m.max(b.y_m)),
        }
    }

    /// Returns the width (along x), metres.
    #[inline]
    pub fn width_m(self) -> f64 {
        self.max.x_m - self.min.x_m
    }

    /// Returns the height (along y), metres.
    #[inline]
    pub fn height_m(self) -> f64 {
        self.max.y_m - self.min.y_m
    }

    /// Returns the middle.
    #[inline]
    pub fn centre(self) -> Point {
        self.min.toward(self.max, 0.5)
    }

    /// Returns whether a point lies inside or on the border.
    #[inline]
    pub fn contains(self, point: Point) -> bool {
        (self.min.x_m..=self.max.x_m).contains(&point.x_m)
            && (self.min.y_m..=self.max.y_m).contains(&point.y_m)
    }

    /// Returns the rectangle moved inward by `by_m` on every side (outward when negative).
    #[inline]
    pub fn shrunk(self, by_m: f64) -> Rect {
        Rect {
            min: Point::new(self.min.x_m + by_m, self.min.y_m + by_m),
            max: Point::new(self.max.x_m - by_m, self.max.y_m - by_m),
        }
    }

    /// Returns the smallest rectangle around points; `None` without any.
    pub fn around(points: impl IntoIterator<Item = Point>) -> Option<Rect> {
        let rects = points.into_iter().map(|at| Rect { min: at, max: at });
        rects.reduce(|a, b| Rect {
            min: Point::new(a.min.x_m.min(b.min.x_m), a.min.y_m.min(b.min.y_m)),
            max: Point::new(a.max.x_m.max(b.max.x_m), a.max.y_m.max(b.max.y_m)),
        })
    }

    /// Returns what two rectangles have in common; `None` when that has no size.
    #[inline]
    pub fn common_with(self, other: Rect) -> Option<Rect> {
        let common = Rect {
            min: Point::new(
                self.min.x_m.max(other.min.x_m),
                self.min.y_m.max(other.min.y_m),
            ),
            max: Point::new(
                self.max.x_m.min(other.max.x_m),
                self.max.y_m.min(other.max.y_m),
            ),
        };
        (common.width_m() > 0.0 && common.height_m() > 0.0).then_some(common)
    }

    /// Returns the shares of a segment at which the endless line through it enters and leaves the rectangle (Liang and
    /// Barsky 1984); `None` when it passes by, or touches a corner only.
    pub fn line_shares(self, line: Segment) -> Option<(f64, f64)> {
        let vector = line.vector();
        let axes = [
            (line.from.x_m, vector.x_m, self.min.x_m, self.max.x_m),
            (line.from.y_m, vector.y_m, self.min.y_m, self.max.y_m),
        ];
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for (start, step, low, high) in axes {
            if step == 0.0 {
                if start < low || start > high {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low - start) / step, (high - start) / step);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter < leave).then_some((enter, leave))
    }

    /// Returns the four corners, counter-clockwise from the south-west.
    #[inline]
    pub fn corners(self) -> [Point; 4] {
        let Rect { min, max } = self;
        [
            min,
            Point::new(max.x_m, min.y_m),
            max,
            Point::new(min.x_m, max.y_m),
        ]
    }

    /// Returns the rectangle as a polygon.
    #[inline]
    pub fn polygon(self) -> Polygon {
        Polygon::new(self.corners().to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shrinking_keeps_the_centre() {
        let rect = Rect::new(Point::new(4.0, 2.0), Point::new(0.0, 0.0));
        assert_eq!(rect.shrunk(0.5).centre(), rect.centre());
        assert_eq!(rect.shrunk(0.5).width_m(), 3.0);
        assert!(rect.contains(rect.max) && !rect.contains(Point::new(4.1, 1.0)));
    }

    #[test]
    fn the_smallest_rectangle_around_points_touches_the_outermost() {
        let points = [(3.0, -1.0), (-2.0, 4.0), (0.0, 0.0)].map(|(x, y)| Point::new(x, y));
        let expected = Rect::new(Point::new(-2.0, -1.0), Point::new(3.0, 4.0));
        assert_eq!(Rect::around(points), Some(expected));
        assert_eq!(Rect::around([]), None);
    }

    #[test]
    fn what_two_rectangles_have_in_common_lies_in_both() {
        let rect = |x: f64, y: f64, far_x: f64, far_y: f64| {
            Rect::new(Point::new(x, y), Point::new(far_x, far_y))
        };
        let one = rect(0.0, 0.0, 4.0, 2.0);
        let common = one.common_with(rect(1.0, -5.0, 9.0, 1.5));
        assert_eq!(common, Some(rect(1.0, 0.0, 4.0, 1.5)));
        assert_eq!(one.common_with(one), Some(one));
        assert_eq!(one.common_with(rect(4.0, 0.0, 9.0, 2.0)), None);
        assert_eq!(one.common_with(one.shrunk(1.0)), None);
    }
}
