//! The positions along the border of the area, in driving order.
//!
//! Positions are numbered counter-clockwise from the south-west corner; an index may be any number,
//! it is taken modulo the count. Whether a vehicle can really stand at a position is not known here.

use serde::{Deserialize, Serialize};

use super::SweepError;
use crate::geom::{Point, Rect};

/// Fewest positions of a ring.
pub const MIN_POSITIONS: usize = 4;
/// Most positions of a ring.
pub const MAX_POSITIONS: usize = 4000;

/// A side of the area.
#[cfg(test)]
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Side {
    /// Where y is smallest.
    South,
    /// Where x is largest.
    East,
    /// Where y is largest.
    North,
    /// Where x is smallest.
    West,
}

/// Evenly spaced positions along the border of an area, counter-clockwise from the south-west corner.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Ring {
    area: Rect,
    positions: usize,
}

impl Ring {
    /// Makes a ring of so many positions along the border of `area`.
    ///
    /// With 76 positions on a square every corner is a position and the pitch is a nineteenth of the side.
    ///
    /// # Errors
    /// The area has no inside or is not finite, or there are fewer than 4 or more than 4000 positions.
    pub fn new(area: Rect, positions: usize) -> Result<Ring, SweepError> {
        let sane = |length_m: f64| length_m.is_finite() && length_m > 0.0;
        if !sane(area.width_m()) || !sane(area.height_m()) {
            return Err(SweepError::EmptyArea {
                width_m: area.width_m(),
                height_m: area.height_m(),
            });
        }
        if !(MIN_POSITIONS..=MAX_POSITIONS).contains(&positions) {
            return Err(SweepError::Positions { positions });
        }
        Ok(Ring { area, positions })
    }

    /// Returns the area whose border it is.
    pub fn area(&self) -> Rect {
        self.area
    }

    /// Returns the number of positions.
    pub fn positions(&self) -> usize {
        self.positions
    }

    /// Returns the length of the border, metres.
    pub fn length_m(&self) -> f64 {
        2.0 * (self.area.width_m() + self.area.height_m())
    }

    /// Returns the distance along the border between two positions in a row, metres.
    pub fn pitch_m(&self) -> f64 {
        self.length_m() / self.positions as f64
    }

    /// Returns a position; the index is taken modulo the number of positions.
    pub fn position(&self, index: usize) -> Point {
        self.at_arc(self.arc_m(index % self.positions))
    }

    /// Returns the index of the position nearest to a point; the lowest on a tie.
    pub fn nearest(&self, point: Point) -> usize {
        let distance = |index: &usize| self.position(*index).distance_to(point);
        (0..self.positions)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap_or(0)
    }

    /// Returns the number of steps from one position counter-clockwise to another, below the count.
    pub fn steps_ahead(&self, from: usize, to: usize) -> usize {
        (to % self.positions + self.positions - from % self.positions) % self.positions
    }

    /// Returns the number of steps between two positions, the shorter way round.
    #[cfg(test)]
    pub fn steps_between(&self, one: usize, other: usize) -> usize {
        self.steps_ahead(one, other)
            .min(self.steps_ahead(other, one))
    }

    /// Returns the sides that a position lies on: one, or two at a corner.
    #[cfg(test)]
    pub fn sides(&self, index: usize) -> Vec<Side> {
        let arc_m = self.arc_m(index % self.positions);
        let [_, east_m, north_m, west_m] = self.corner_arcs_m();
        let mut sides = Vec::with_capacity(2);
        let spans = [
            (Side::South, 0.0, east_m),
            (Side::East, east_m, north_m),
            (Side::North, north_m, west_m),
        ];
        sides.extend(
            spans
                .iter()
                .filter(|span| (span.1..=span.2).contains(&arc_m))
                .map(|span| span.0),
        );
        if arc_m >= west_m || arc_m <= 0.0 {
            sides.push(Side::West);
        }
        sides
    }

    /// Returns whether two positions lie on a common side, so that the link between them runs along it.
    #[cfg(test)]
    pub fn share_a_side(&self, one: usize, other: usize) -> bool {
        let sides = self.sides(other);
        self.sides(one).iter().any(|side| sides.contains(side))
    }

    /// Returns the corners of the area between a position and the next one, without both ends.
    pub fn corners_after(&self, index: usize) -> Vec<Point> {
        let index = index % self.positions;
        let from_m = self.arc_m(index);
        let last = index + 1 == self.positions;
        let to_m = if last {
            self.length_m()
        } else {
            self.arc_m(index + 1)
        };
        let between = |arc_m: &f64| *arc_m > from_m && *arc_m < to_m;
        self.corner_arcs_m()
            .into_iter()
            .filter(between)
            .map(|arc_m| self.at_arc(arc_m))
            .collect()
    }

    /// Returns how far along the border (metres from the south-west corner) it comes nearest to a point.
    pub fn nearest_arc_m(&self, point: Point) -> f64 {
        let corners = self.area.corners();
        let along = |side: usize| {
            let segment = crate::geom::Segment::new(corners[side], corners[(side + 1) % 4]);
            let arc_m =
                self.corner_arcs_m()[side] + segment.nearest_share(point) * segment.length_m();
            (segment.distance_to_point(point), arc_m)
        };
        let nearest = (0..4).map(along).min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map_or(
            0.0,
            |(_, arc_m)| if arc_m >= self.length_m() { 0.0 } else { arc_m },
        )
    }

    /// Returns a way from a place to another one on the border: where the border is nearest, and then the corners that are
    /// passed along it, counter-clockwise or clockwise; without both ends.
    pub fn way_between(&self, from: Point, to: Point, clockwise: bool) -> Vec<Point> {
        let (begin_m, end_m) = (self.nearest_arc_m(from), self.nearest_arc_m(to));
        let ahead_m = |arc_m: f64| {
            let ahead_m = if clockwise {
                begin_m - arc_m
            } else {
                arc_m - begin_m
            };
            ahead_m - self.length_m() * libm::floor(ahead_m / self.length_m())
        };
        let corners = self.area.corners().into_iter().zip(self.corner_arcs_m());
        let mut passed: Vec<(f64, Point)> = corners
            .map(|(corner, arc_m)| (ahead_m(arc_m), corner))
            .filter(|(corner_m, _)| *corner_m > 1e-6 && *corner_m < ahead_m(end_m) - 1e-6)
            .collect();
        passed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let entry = self.at_arc(begin_m);
        let is_between =
            |point: &Point| point.distance_to(from) > 1e-6 && point.distance_to(to) > 1e-6;
        std::iter::once(entry)
            .chain(passed.into_iter().map(|(_, corner)| corner))
            .filter(is_between)
            .collect()
    }

    fn corner_arcs_m(&self) -> [f64; 4] {
        let (width_m, height_m) = (self.area.width_m(), self.area.height_m());
        [
            0.0,
            width_m,
            width_m + height_m,
            width_m + height_m + width_m,
        ]
    }

    /// Metres along the border; a position that lies on a corner but for rounding lies on it exactly.
    fn arc_m(&self, index: usize) -> f64 {
        let arc_m = self.length_m() * index as f64 / self.positions as f64;
        let near = |corner_m: &f64| (corner_m - arc_m).abs() < 1e-9 * self.length_m();
        self.corner_arcs_m().into_iter().find(near).unwrap_or(arc_m)
    }

    fn at_arc(&self, arc_m: f64) -> Point {
        let Rect { min, max } = self.area;
        let [_, east_m, north_m, west_m] = self.corner_arcs_m();
        if arc_m < east_m {
            Point::new(min.x_m + arc_m, min.y_m)
        } else if arc_m < north_m {
            Point::new(max.x_m, min.y_m + (arc_m - east_m))
        } else if arc_m < west_m {
            Point::new(max.x_m - (arc_m - north_m), max.y_m)
        } else {
            Point::new(min.x_m, max.y_m - (arc_m - west_m))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(width_m: f64, height_m: f64, positions: usize) -> Ring {
        let min = Point::new(-3.0, 2.0);
        Ring::new(
            Rect::new(min, Point::new(min.x_m + width_m, min.y_m + height_m)),
            positions,
        )
        .unwrap()
    }

    #[test]
    fn a_way_along_the_border_goes_either_way_round() {
        let ring = Ring::new(Rect::new(Point::new(0.0, 0.0), Point::new(10.0, 8.0)), 36).unwrap();
        let (from, to) = (Point::new(4.0, -1.0), Point::new(10.0, 8.0));
        let entry = Point::new(4.0, 0.0);
        assert_eq!(
            ring.way_between(from, to, false),
            [entry, Point::new(10.0, 0.0)]
        );
        assert_eq!(
            ring.way_between(from, to, true),
            [entry, Point::new(0.0, 0.0), Point::new(0.0, 8.0)]
        );
        assert_eq!(ring.way_between(entry, Point::new(6.0, 0.0), false), []);
        assert_eq!(ring.way_between(entry, entry, true), []);
    }

    #[test]
    fn the_corners_of_a_square_are_positions() {
        let ring = ring(20.0, 20.0, 76);
        for (index, corner) in [0, 19, 38, 57].into_iter().zip(ring.area.corners()) {
            assert_eq!(ring.position(index), corner);
            assert_eq!(ring.sides(index).len(), 2);
        }
        assert!((ring.pitch_m() - 20.0 / 19.0).abs() < 1e-12);
        assert!((0..76).all(|index| ring.corners_after(index).is_empty()));
    }

    #[test]
    fn positions_in_a_row_are_one_pitch_apart_along_the_border() {
        for ring in [
            ring(20.0, 20.0, 76),
            ring(13.0, 31.0, 50),
            ring(1.0, 40.0, 7),
            ring(7.0, 3.0, 4),
        ] {
            let count = ring.positions();
            let mut corners = 0;
            for index in 0..count {
                let mut way = vec![ring.position(index)];
                corners += ring.corners_after(index).len();
                way.extend(ring.corners_after(index));
                way.push(ring.position(index + 1));
                let length_m: f64 = way
                    .windows(2)
                    .map(|pair| pair[0].distance_to(pair[1]))
                    .sum();
                assert!(
                    (length_m - ring.pitch_m()).abs() < 1e-9,
                    "{index} of {count}: {length_m}"
                );
            }
            let on_corner = (0..count)
                .filter(|index| ring.sides(*index).len() == 2)
                .count();
            assert_eq!(corners + on_corner, 4);
        }
    }

    #[test]
    fn every_position_is_nearest_to_itself() {
        let ring = ring(13.0, 31.0, 50);
        for index in 0..50 {
            assert_eq!(ring.nearest(ring.position(index)), index);
            let arc_m = ring.pitch_m() * index as f64;
            assert!((ring.nearest_arc_m(ring.position(index)) - arc_m).abs() < 1e-9);
        }
        assert_eq!(ring.steps_ahead(48, 2), 4);
        assert_eq!(ring.steps_between(2, 48), 4);
    }

    #[test]
    fn sides_are_told_apart() {
        let ring = ring(20.0, 20.0, 76);
        assert_eq!(ring.sides(5), [Side::South]);
        assert_eq!(ring.sides(25), [Side::East]);
        assert_eq!(ring.sides(45), [Side::North]);
        assert_eq!(ring.sides(70), [Side::West]);
        assert_eq!(ring.sides(76), [Side::South, Side::West]);
        assert!(ring.share_a_side(0, 70) && !ring.share_a_side(5, 25));
    }

    #[test]
    fn an_area_without_inside_is_refused() {
        let flat = Rect::new(Point::new(0.0, 0.0), Point::new(5.0, 0.0));
        assert!(Ring::new(flat, 76).is_err());
        let infinite = Rect::new(Point::new(0.0, 0.0), Point::new(f64::INFINITY, 1.0));
        assert!(Ring::new(infinite, 76).is_err());
        assert!(Ring::new(Rect::new(Point::new(0.0, 0.0), Point::new(5.0, 5.0)), 3).is_err());
    }
}
