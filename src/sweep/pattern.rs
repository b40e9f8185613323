//! The measurement patterns of 2016 for two vehicles on the border of a square lattice, and the square of one vehicle.
//!
//! A pattern says where both vehicles are after each step; they take every step together, and never meet: no step
//! brings both to one point or lets them swap. The links are those between the two points of each step. *Calibrate*
//! measures every pair of border points, *fan* every corner with the three sides that a vehicle drives around it, and
//! *fan-straight* every corner with its two opposite sides, and both pairs of sides straight across.
//!
//! Nothing here knows obstacles, time or plans, and nothing waits: whoever drives a pattern makes sure that a step
//! begins when the one before has ended.

use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::geom::{Point, Rect};

/// Fewest points along a side of a pattern.
pub const MIN_PATTERN_SIZE: usize = 2;
/// Most points along a side of a pattern (a calibration of this size has almost a million steps).
pub const MAX_PATTERN_SIZE: usize = 250;

/// Why there is no such pattern.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum PatternError {
    /// Too few or too many points along a side.
    #[error(
        "a pattern has from {MIN_PATTERN_SIZE} to {MAX_PATTERN_SIZE} points along a side, not {size}"
    )]
    Size {
        /// What was asked for.
        size: usize,
    },
    /// The side of the square is no length.
    #[error("the side of a square is more than 0 m, not {size_m} m")]
    Side {
        /// What was asked for, metres.
        size_m: f64,
    },
}

/// Which pattern is driven.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
pub enum PatternKind {
    /// One vehicle drives round to all points but the other's; then the other does.
    Calibrate,
    /// One vehicle stands on a corner while the other drives the three sides before it; then the other way about, and
    /// so on for the next corner.
    Fan,
    /// For each side: both drive along opposite sides, then one drives along the two sides opposite to the other's
    /// corner.
    FanStraight,
}

impl fmt::Display for PatternKind {
    /// Writes the name as it stands in configurations.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            PatternKind::Calibrate => "calibrate",
            PatternKind::Fan => "fan",
            PatternKind::FanStraight => "fan-straight",
        })
    }
}

/// A point of the lattice, in steps from its south-west corner.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct LatticePoint {
    /// Steps to the north, less than the pattern's size.
    pub north: usize,
    /// Steps to the east, less than the pattern's size.
    pub east: usize,
}

/// A pattern for two vehicles, of a given size.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pattern {
    kind: PatternKind,
    /// Steps along a side: one less than the points.
    side: usize,
}

/// Some steps in a row in which each vehicle goes the same way.
///
/// Places on the border are counted clockwise from the south-west corner: north along the west side first.
#[derive(Clone, Copy)]
struct Piece {
    steps: usize,
    /// By how many places each vehicle goes on in a step: 1 (clockwise), 0 or -1.
    by: [i64; 2],
}

impl Pattern {
    /// Makes a pattern with `size` points along each side.
    ///
    /// # Errors
    /// [`PatternError::Size`] when the size is not from 2 to 250.
    pub fn new(kind: PatternKind, size: usize) -> Result<Pattern, PatternError> {
        if !(MIN_PATTERN_SIZE..=MAX_PATTERN_SIZE).contains(&size) {
            return Err(PatternError::Size { size });
        }
        Ok(Pattern {
            kind,
            side: size - 1,
        })
    }

    /// Returns the number of points along a side.
    pub fn size(&self) -> usize {
        self.side + 1
    }

    /// Returns where the first and the second vehicle begin: on the south-west corner, and on the south side (beside
    /// the first for the calibration, else on the south-east corner).
    pub fn start(&self) -> [LatticePoint; 2] {
        self.start_places().map(|place| self.point(place))
    }

    /// Returns how many rounds of equally many steps it has: for the calibration one drive of either vehicle, else what is
    /// repeated for each side.
    pub fn round_count(&self) -> usize {
        match self.kind {
            PatternKind::Calibrate => 4 * self.side,
            PatternKind::Fan | PatternKind::FanStraight => 4,
        }
    }

    /// Returns how many steps it takes, the start not counted.
    pub fn step_count(&self) -> usize {
        self.round_count() * self.round(0).iter().map(|piece| piece.steps).sum::<usize>()
    }

    /// Returns where the first and the second vehicle are after each step.
    pub fn steps(&self) -> impl Iterator<Item = [LatticePoint; 2]> + use<> {
        let pattern = *self;
        let pieces = (0..self.round_count()).flat_map(move |round| pattern.round(round));
        let each = pieces.flat_map(|piece| std::iter::repeat_n(piece.by, piece.steps));
        each.scan(self.start_places(), move |at, by| {
            *at = [at[0] + by[0], at[1] + by[1]];
            Some(at.map(|place| pattern.point(place)))
        })
    }

    /// Returns where a point of this pattern lies when the lattice is laid over an area: its corners on the corners.
    pub fn place(&self, point: LatticePoint, area: Rect) -> Point {
        let share = |steps: usize| steps as f64 / self.side as f64;
        let x_m = area.min.x_m + share(point.east) * area.width_m();
        let y_m = area.min.y_m + share(point.north) * area.height_m();
        Point::new(x_m, y_m)
    }

    fn round(&self, round: usize) -> Vec<Piece> {
        let three_sides = 3 * self.side;
        let piece = |steps: usize, first: i64, second: i64| Piece {
            steps,
            by: [first, second],
        };
        match self.kind {
            // Up to one place before the other, which then does the same and ends one place before this one.
            PatternKind::Calibrate if round.is_multiple_of(2) => {
                vec![piece(4 * self.side - 2, 1, 0)]
            }
            PatternKind::Calibrate => vec![piece(4 * self.side - 2, 0, 1)],
            // The last step of each drive is the first one of the other: a corner is handed over.
            PatternKind::Fan => vec![
                piece(three_sides - 1, 1, 0),
                piece(1, 1, 1),
                piece(three_sides - 1, 0, 1),
                piece(1, 0, 0),
            ],
            PatternKind::FanStraight => vec![piece(self.side, 1, -1), piece(2 * self.side, -1, 0)],
        }
    }

    fn start_places(&self) -> [i64; 2] {
        match self.kind {
            PatternKind::Calibrate => [0, 4 * self.side as i64 - 1],
            PatternKind::Fan | PatternKind::FanStraight => [0, 3 * self.side as i64],
        }
    }

    fn point(&self, place: i64) -> LatticePoint {
        let side = self.side;
        let place = place.rem_euclid(4 * side as i64) as usize;
        let along = place % side;
        let (north, east) = match place / side {
            0 => (along, 0),
            1 => (side, along),
            2 => (side - along, side),
            _ => (0, side - along),
        };
        LatticePoint { north, east }
    }
}

/// Returns the square of one vehicle around a point: north-west, north-east, south-east, south-west and north-west again.
///
/// # Errors
/// [`PatternError::Side`] when the side is not a length above 0.
pub fn square(centre: Point, size_m: f64) -> Result<[Point; 5], PatternError> {
    if !(size_m.is_finite() && size_m > 0.0) {
        return Err(PatternError::Side { size_m });
    }
    let half_m = size_m / 2.0;
    let corner =
        |east: f64, north: f64| Point::new(centre.x_m + east * half_m, centre.y_m + north * half_m);
    let first = corner(-1.0, 1.0);
    Ok([
        first,
        corner(1.0, 1.0),
        corner(1.0, -1.0),
        corner(-1.0, -1.0),
        first,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    const KINDS: [PatternKind; 3] = [
        PatternKind::Calibrate,
        PatternKind::Fan,
        PatternKind::FanStraight,
    ];

    fn at(north: usize, east: usize) -> LatticePoint {
        LatticePoint { north, east }
    }

    fn pattern(kind: PatternKind, size: usize) -> Pattern {
        Pattern::new(kind, size).unwrap()
    }

    /// The points of one vehicle, as (north, east).
    fn track(kind: PatternKind, size: usize, vehicle: usize) -> Vec<(usize, usize)> {
        pattern(kind, size)
            .steps()
            .map(|both| (both[vehicle].north, both[vehicle].east))
            .collect()
    }

    /// All links measured: unordered pairs of points, of the start too.
    fn links(kind: PatternKind, size: usize) -> BTreeSet<[LatticePoint; 2]> {
        let pattern = pattern(kind, size);
        let mut links: BTreeSet<_> = pattern.steps().chain([pattern.start()]).collect();
        links = links
            .into_iter()
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        links
    }

    fn on_one_side([a, b]: [LatticePoint; 2], size: usize) -> bool {
        let border = |value: usize| value == 0 || value == size - 1;
        (a.north == b.north && border(a.north)) || (a.east == b.east && border(a.east))
    }

    #[test]
    fn the_second_vehicle_of_a_fan_takes_over_each_corner() {
        let second = track(PatternKind::Fan, 4, 1);
        assert!(second[..8].iter().all(|point| *point == (0, 3)));
        let drive = [
            (0, 2),
            (0, 1),
            (0, 0),
            (1, 0),
            (2, 0),
            (3, 0),
            (3, 1),
            (3, 2),
            (3, 3),
        ];
        assert_eq!(second[8..17], drive);
        assert!(second[17..26].iter().all(|point| *point == (3, 3)));
        assert_eq!((second.len(), second[71]), (72, (0, 3)));
        assert_eq!(track(PatternKind::Fan, 4, 0)[71], (0, 0));
    }

    #[test]
    fn the_second_vehicle_of_a_fan_straight_goes_along_and_then_stands() {
        let second = track(PatternKind::FanStraight, 3, 1);
        assert_eq!(second[..2], [(1, 2), (2, 2)]);
        assert!(second[2..6].iter().all(|point| *point == (2, 2)));
        assert_eq!(second[6..8], [(2, 1), (2, 0)]);
        assert_eq!(second[23], (0, 2));
    }

    #[test]
    fn a_calibration_measures_every_pair_of_border_points() {
        for size in 2..=9 {
            let border = 4 * (size - 1);
            let pairs = border * (border - 1) / 2;
            assert_eq!(
                links(PatternKind::Calibrate, size).len(),
                pairs,
                "size {size}"
            );
        }
    }

    #[test]
    fn a_fan_straight_of_twenty_points_has_its_182_useful_links() {
        // The number is that of the published comparison of planners, counted from the original.
        let useful = links(PatternKind::FanStraight, 20)
            .into_iter()
            .filter(|link| !on_one_side(*link, 20));
        assert_eq!(useful.count(), 182);
    }

    #[test]
    fn a_fan_joins_every_corner_with_both_opposite_sides() {
        for size in [2, 3, 7, 20] {
            let last = size - 1;
            let links = links(PatternKind::Fan, size);
            for corner in [at(0, 0), at(0, last), at(last, 0), at(last, last)] {
                for along in 0..size {
                    let opposite = [
                        at(last - corner.north, along),
                        at(along, last - corner.east),
                    ];
                    for point in opposite
                        .into_iter()
                        .filter(|point| !on_one_side([corner, *point], size))
                    {
                        assert!(
                            links.contains(&[corner.min(point), corner.max(point)]),
                            "{corner:?} {point:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_lattice_is_laid_over_the_whole_area() {
        let area = Rect::new(Point::new(-2.0, 1.0), Point::new(6.0, 5.0));
        let pattern = pattern(PatternKind::Fan, 5);
        assert_eq!(pattern.place(at(0, 0), area), area.min);
        assert_eq!(pattern.place(at(4, 4), area), area.max);
        assert_eq!(pattern.place(at(1, 2), area), Point::new(2.0, 2.0));
    }

    #[test]
    fn impossible_sizes_are_refused() {
        for size in [0, 1, 251, usize::MAX] {
            assert_eq!(
                Pattern::new(PatternKind::Fan, size),
                Err(PatternError::Size { size })
            );
        }
        for size_m in [0.0, -3.0, f64::INFINITY, f64::NAN] {
            assert!(square(Point::default(), size_m).is_err(), "{size_m}");
        }
        assert!(square(Point::default(), 20.0).is_ok());
    }

    proptest! {
        #[test]
        fn the_vehicles_never_meet_and_keep_to_the_border(which in 0..3usize, size in 2..40usize) {
            let pattern = pattern(KINDS[which], size);
            let (mut before, mut count) = (pattern.start(), 0);
            prop_assert_ne!(before[0], before[1]);
            for now in pattern.steps() {
                prop_assert_ne!(now[0], now[1], "both on one point in step {}", count);
                prop_assert!(now != [before[1], before[0]], "swapped in step {count}");
                for (from, to) in before.into_iter().zip(now) {
                    let moved = from.north.abs_diff(to.north) + from.east.abs_diff(to.east);
                    prop_assert!(moved <= 1, "a step is one side of a cell or none");
                    prop_assert!(to.north < size && to.east < size);
                    prop_assert!([to.north, to.east].iter().any(|v| *v == 0 || *v == size - 1));
                }
                (before, count) = (now, count + 1);
            }
            prop_assert_eq!(count, pattern.step_count());
        }
    }
}
