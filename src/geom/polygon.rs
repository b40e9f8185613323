//! Simple polygons of the local frame: fences, footprints.

use serde::{Deserialize, Serialize};

use super::{Point, Segment};

/// A simple polygon given by its corners, in order; the last is joined to the first.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Polygon {
    corners: Vec<Point>,
}

impl Polygon {
    /// Makes a polygon from its corners, in order around it.
    #[inline]
    pub fn new(corners: Vec<Point>) -> Polygon {
        Polygon { corners }
    }

    /// Returns the corners.
    #[inline]
    pub fn corners(&self) -> &[Point] {
        &self.corners
    }

    /// Returns the edges, in order.
    #[inline]
    pub fn edges(&self) -> impl Iterator<Item = Segment> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners
            .iter()
            .zip(next)
            .map(|(a, b)| Segment::new(*a, *b))
    }

    /// Returns the signed area, m²; positive when the corners run counter-clockwise.
    #[inline]
    pub fn area_m2(&self) -> f64 {
        let origin = Point::default();
        self.edges()
            .map(|edge| (edge.from - origin).cross(edge.to - origin))
            .sum::<f64>()
            / 2.0
    }

    /// Returns whether all corners turn the same way and enclose something.
    #[inline]
    pub fn is_convex(&self) -> bool {
        let edges: Vec<Segment> = self.edges().collect();
        let next = edges.iter().cycle().skip(1);
        let sign = self.area_m2().signum();
        let bends_back = edges
            .iter()
            .zip(next)
            .any(|(a, b)| a.vector().cross(b.vector()) * sign < 0.0);
        self.area_m2() != 0.0 && !bends_back
    }

    /// Returns whether a point lies inside (even-odd rule, so that an inner ring may follow the outer one).
    #[inline]
    pub fn contains(&self, point: Point) -> bool {
        self.edges()
            .filter(|edge| edge.is_met_along_x(point))
            .count()
            % 2
            == 1
    }

    /// Returns the distance from a point to the nearest edge, metres; infinite without corners.
    #[inline]
    pub fn distance_to_edge(&self, point: Point) -> f64 {
        self.edges()
            .map(|edge| edge.distance_to_point(point))
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns whether a disc around a point lies wholly inside.
    #[inline]
    pub fn contains_disc(&self, centre: Point, radius_m: f64) -> bool {
        let is_clear = |edge: Segment| edge.distance_to_point(centre) >= radius_m;
        self.contains(centre) && self.edges().all(is_clear)
    }

    /// Returns whether a disc moved along a segment stays wholly inside.
    #[inline]
    pub fn contains_corridor(&self, along: Segment, radius_m: f64) -> bool {
        self.contains(along.from)
            && self.contains(along.to)
            && self.edges().all(|edge| edge.distance_to(along) >= radius_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ell() -> Polygon {
        let corners = [
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 1.0),
            (1.0, 1.0),
            (1.0, 4.0),
            (0.0, 4.0),
        ];
        Polygon::new(corners.iter().map(|(x, y)| Point::new(*x, *y)).collect())
    }

    #[test]
    fn a_concave_polygon_knows_its_inside() {
        assert!(ell().contains(Point::new(0.5, 3.0)));
        assert!(!ell().contains(Point::new(2.0, 2.0)));
        assert!((ell().area_m2() - 7.0).abs() < 1e-12);
        assert!(!ell().is_convex());
    }

    #[test]
    fn a_corridor_across_the_notch_leaves_the_polygon() {
        let from = Point::new(0.5, 3.5);
        assert!(!ell().contains_corridor(Segment::new(from, Point::new(3.5, 0.5)), 0.1));
        assert!(ell().contains_corridor(Segment::new(from, Point::new(0.5, 0.5)), 0.4));
        assert!(!ell().contains_corridor(Segment::new(from, Point::new(0.5, 0.5)), 0.6));
    }
}
