//! Straight pieces between two points, and distances to them.

use super::{Point, Vector};

/// A straight piece from one point to another; both may coincide.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Segment {
    /// Where it starts.
    pub from: Point,
    /// Where it ends.
    pub to: Point,
}

impl Segment {
    /// Makes a segment.
    #[inline]
    pub const fn new(from: Point, to: Point) -> Segment {
        Segment { from, to }
    }

    /// Returns the displacement from start to end.
    #[inline]
    pub fn vector(self) -> Vector {
        self.to - self.from
    }

    /// Returns what of it lies up to a length from its start, metres, and what lies beyond, each unless there is none.
    pub fn split_at(self, length_m: f64) -> (Option<Segment>, Option<Segment>) {
        let whole_m = self.length_m();
        if length_m >= whole_m {
            return (Some(self), None);
        }
        if length_m <= 0.0 {
            return (None, Some(self));
        }
        let at = self.from.toward(self.to, length_m / whole_m);
        (
            Some(Segment::new(self.from, at)),
            Some(Segment::new(at, self.to)),
        )
    }

    /// Returns the length, metres.
    #[inline]
    pub fn length_m(self) -> f64 {
        self.vector().length_m()
    }

    /// Returns the share of the way (0 to 1) at which the segment comes nearest to a point.
    #[inline]
    pub fn nearest_share(self, point: Point) -> f64 {
        let along = self.vector();
        let square = along.dot(along);
        if square <= 0.0 {
            return 0.0;
        }
        ((point - self.from).dot(along) / square).clamp(0.0, 1.0)
    }

    /// Returns the distance to a point, metres.
    #[inline]
    pub fn distance_to_point(self, point: Point) -> f64 {
        self.from
            .toward(self.to, self.nearest_share(point))
            .distance_to(point)
    }

    /// Returns the smallest distance between two segments, metres; 0 when they touch.
    #[inline]
    pub fn distance_to(self, other: Segment) -> f64 {
        if self.crosses(other) {
            return 0.0;
        }
        self.distance_to_point(other.from)
            .min(self.distance_to_point(other.to))
            .min(other.distance_to_point(self.from))
            .min(other.distance_to_point(self.to))
    }

    /// Returns how much longer the way over a point is than the segment itself, metres (the excess path of a link).
    #[inline]
    pub fn excess_path_m(self, over: Point) -> f64 {
        (self.from.distance_to(over) + over.distance_to(self.to) - self.length_m()).max(0.0)
    }

    /// Returns whether a ray from a point along x meets the segment, for counting crossings: the upper of its ends (by
    /// y) does not belong to it, so that a ray through a corner is counted once or twice as it passes or touches. A
    /// point on the segment meets it.
    #[inline]
    pub fn is_met_along_x(self, from: Point) -> bool {
        if (self.from.y_m > from.y_m) == (self.to.y_m > from.y_m) {
            return false;
        }
        let share = (from.y_m - self.from.y_m) / (self.to.y_m - self.from.y_m);
        from.x_m <= self.from.x_m + share * (self.to.x_m - self.from.x_m)
    }

    /// Returns whether the two segments cross in one inner point of both.
    #[inline]
    pub fn crosses(self, other: Segment) -> bool {
        let (a, b) = (self.vector(), other.vector());
        let from_here = a.cross(other.from - self.from) * a.cross(other.to - self.from);
        let from_there = b.cross(self.from - other.from) * b.cross(self.to - other.from);
        from_here < 0.0 && from_there < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(x0: f64, y0: f64, x1: f64, y1: f64) -> Segment {
        Segment::new(Point::new(x0, y0), Point::new(x1, y1))
    }

    #[test]
    fn distances_are_taken_to_the_nearest_part() {
        let base = segment(0.0, 0.0, 2.0, 0.0);
        assert_eq!(base.distance_to_point(Point::new(1.0, 3.0)), 3.0);
        assert_eq!(base.distance_to_point(Point::new(5.0, 4.0)), 5.0);
        assert_eq!(base.distance_to(segment(1.0, -1.0, 1.0, 1.0)), 0.0);
        assert_eq!(base.distance_to(segment(0.0, 2.0, 2.0, 2.0)), 2.0);
        assert_eq!(base.distance_to(segment(3.0, 0.0, 4.0, 0.0)), 1.0);
    }

    #[test]
    fn the_way_over_a_point_is_never_shorter() {
        let link = segment(0.0, 0.0, 6.0, 0.0);
        assert_eq!(link.excess_path_m(Point::new(2.0, 0.0)), 0.0);
        assert_eq!(link.excess_path_m(Point::new(3.0, 4.0)), 4.0);
    }

    #[test]
    fn the_parts_of_a_split_segment_are_the_segment() {
        let whole = segment(1.0, 1.0, 4.0, 5.0);
        let middle = Point::new(2.2, 2.6);
        let (first, rest) = whole.split_at(2.0);
        assert!(first.unwrap().to.distance_to(middle) < 1e-12);
        assert_eq!(
            (first.unwrap().from, rest.unwrap().to),
            (whole.from, whole.to)
        );
        assert_eq!(first.unwrap().to, rest.unwrap().from);
        assert_eq!(whole.split_at(5.0), (Some(whole), None));
        assert_eq!(whole.split_at(-1.0), (None, Some(whole)));
        let dot = segment(1.0, 1.0, 1.0, 1.0);
        assert_eq!(dot.split_at(0.0), (Some(dot), None));
    }

    #[test]
    fn a_segment_of_no_length_is_a_point() {
        let dot = segment(1.0, 1.0, 1.0, 1.0);
        assert_eq!(dot.distance_to_point(Point::new(1.0, 3.0)), 2.0);
        assert_eq!(dot.distance_to(segment(0.0, 0.0, 2.0, 0.0)), 1.0);
    }
}
