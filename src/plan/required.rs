//! How far the middle of a vehicle keeps from what is not known to be free.
//!
//! Distances are to the middles of *parts* of cells ([`BarredCell`]). Beside a known wall stays a strip that no cone can see
//! empty; the safety distance is kept from what was heard, and from what nobody has seen only so much that the body cannot
//! touch what may stand there.

use serde::{Deserialize, Serialize};

use crate::map::BarredCell;

/// What is heard may be so much nearer than the safety distance asks, cells: its parts reach out from their middles.
const TOLERANCE_CELLS: f64 = 0.15;
/// Between the body with the deviation of its place and the middle of a part there is at least this, cells: half of the
/// diagonal of a part, and a little.
const PART_CELLS: f64 = 0.2;
/// A straight step between two places that keep a distance comes so much nearer at most, cells.
const SAG_CELLS: f64 = 0.05;
/// Between the body and what nobody has seen stays at least this, metres.
const UNSEEN_M: f64 = 0.05;
/// What an optimist keeps less: what was heard may stand that much farther from the way than it is drawn,
const OPTIMISM_CELLS: f64 = 0.35;
/// or by so many deviations of the place: of many echoes those are drawn nearest to the way that were heard with the largest
/// errors.
const OPTIMISM_DEVIATIONS: f64 = 3.0;
/// Half of the side of a part, cells.
const HALF_PART_CELLS: f64 = 0.125;
/// A released way may come so much nearer than a planned one, cells: straight steps between places that keep their distance.
const RELEASE_CELLS: f64 = 0.1;

/// Distances that the middle of a vehicle keeps from the middles of parts of cells, metres.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct RequiredClearance {
    /// From those in which something was heard.
    pub occupied_m: f64,
    /// From those that nobody has seen.
    pub unknown_m: f64,
    /// From any, also by who stands too near already and leaves: the body never touches a part.
    pub least_m: f64,
    /// Nearer than this nobody can be: the body would be in a part.
    pub body_m: f64,
}

impl RequiredClearance {
    /// Returns what a planned way keeps for a vehicle with a body of this radius, a safety distance measured from its
    /// middle, and an allowance for the deviation of its place, all in metres, on a map with cells of this side.
    pub fn planned(body_m: f64, safety_m: f64, deviation_m: f64, cell_m: f64) -> RequiredClearance {
        let least_m = body_m + deviation_m + PART_CELLS * cell_m;
        let planned_m = RequiredClearance::with_sag(least_m, cell_m);
        let wished_m = safety_m + deviation_m - TOLERANCE_CELLS * cell_m;
        RequiredClearance {
            occupied_m: wished_m.max(planned_m),
            unknown_m: wished_m.min(body_m + UNSEEN_M + deviation_m).max(planned_m),
            least_m,
            body_m: body_m + HALF_PART_CELLS * cell_m,
        }
    }

    /// Returns what a vehicle keeps that drives where it has driven before, with a body of this radius and an allowance for
    /// the deviation of its place, metres: room for its body alone, since it came through there.
    pub fn driven_before(body_m: f64, deviation_m: f64, cell_m: f64) -> RequiredClearance {
        RequiredClearance::everywhere(body_m + HALF_PART_CELLS * cell_m + deviation_m)
    }

    /// Returns what must be free of a way that is driven and was planned to keep this.
    pub fn released(self, cell_m: f64) -> RequiredClearance {
        let least_m = self.least_m;
        let released_m = |planned_m: f64| (planned_m - RELEASE_CELLS * cell_m).max(least_m);
        RequiredClearance {
            occupied_m: released_m(self.occupied_m),
            unknown_m: released_m(self.unknown_m),
            ..self
        }
    }

    /// Returns what an optimist keeps, who asks only whether a way may exist: from what is confirmed, since everything else
    /// may turn out to be free. Less than what a planned way keeps from what was heard, by a third of a cell or by three
    /// standard deviations of the place, and never less than half of the body. (That has been where the vehicle has driven,
    /// however badly what bars is drawn.)
    pub fn optimistic(self, body_m: f64, sd_m: f64, cell_m: f64) -> RequiredClearance {
        let off_m = (OPTIMISM_CELLS * cell_m).max(OPTIMISM_DEVIATIONS * sd_m);
        let kept_m = (self.occupied_m - off_m).max(body_m / 2.0);
        RequiredClearance {
            body_m: body_m / 2.0,
            ..RequiredClearance::everywhere(kept_m)
        }
    }

    /// Returns what two places keep so that a straight step between them keeps a distance, metres.
    #[inline]
    pub fn with_sag(distance_m: f64, cell_m: f64) -> f64 {
        distance_m + SAG_CELLS * cell_m
    }

    /// Returns how near a vehicle that stands `here_m` from something, too near already, may come to it on its way, metres: a
    /// little nearer, so that it can get to where its path begins, but not so near that its body might touch it.
    #[inline]
    pub fn leaving_m(&self, here_m: f64, nearer_m: f64) -> f64 {
        (here_m - nearer_m).max(self.least_m).min(here_m)
    }

    /// Returns the same distance from everything.
    pub fn everywhere(distance_m: f64) -> RequiredClearance {
        RequiredClearance {
            occupied_m: distance_m,
            unknown_m: distance_m,
            least_m: distance_m,
            body_m: distance_m,
        }
    }

    /// Returns what is kept from the parts of a barred cell, metres.
    #[inline]
    pub fn from_cell_m(&self, barred: BarredCell) -> f64 {
        if barred.is_occupied() {
            self.occupied_m
        } else {
            self.unknown_m
        }
    }

    /// Returns the larger of both, metres.
    #[inline]
    pub fn most_m(&self) -> f64 {
        self.occupied_m.max(self.unknown_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_safety_distance_is_kept_from_what_was_heard_and_the_body_from_what_was_not_seen() {
        let wide = RequiredClearance::planned(0.25, 0.9, 0.04, 0.2);
        assert!((wide.occupied_m - 0.91).abs() < 1e-9 && (wide.unknown_m - 0.34).abs() < 1e-9);
        let released = wide.released(0.2);
        assert!((released.occupied_m - 0.89).abs() < 1e-9);
        assert!((released.unknown_m - 0.33).abs() < 1e-9);
    }

    #[test]
    fn an_optimist_keeps_less_the_worse_the_place_is_known_but_not_less_than_half_of_the_body() {
        let kept_m = |sd_m: f64| {
            let planned = RequiredClearance::planned(0.25, 0.35, 2.0 * sd_m, 0.2);
            planned.occupied_m - planned.optimistic(0.25, sd_m, 0.2).occupied_m
        };
        assert!((kept_m(0.0) - 0.07).abs() < 1e-9 && (kept_m(0.02) - 0.07).abs() < 1e-9);
        assert!((kept_m(0.05) - 0.15).abs() < 1e-9);
        let far_off = RequiredClearance::planned(0.25, 0.35, 0.8, 0.2).optimistic(0.25, 0.4, 0.2);
        assert!((far_off.occupied_m - 0.125).abs() < 1e-9);
    }

    #[test]
    fn the_body_never_touches_a_part() {
        for safety_m in [0.25, 0.3, 0.6, 1.5] {
            for cell_m in [0.1, 0.2, 0.5] {
                let planned = RequiredClearance::planned(0.25, safety_m, 0.04, cell_m);
                let released = planned.released(cell_m);
                let half_diagonal_m = cell_m * 2f64.sqrt() / 8.0;
                for kept in [planned, released] {
                    let least_m = kept.occupied_m.min(kept.unknown_m);
                    assert!(
                        least_m >= 0.25 + 0.04 + half_diagonal_m,
                        "{safety_m} {cell_m}"
                    );
                }
            }
        }
    }
}
