//! What a path keeps from the fence. Wherever there is room it keeps as much as from anything else; nowhere less than the
//! vehicle itself insists on, but to leave the fence.

use std::f64::consts::FRAC_1_SQRT_2;

use super::search::PathSearch;
use crate::geom::{Cell, Point};
use crate::map::{Bar, CellRect};
use crate::plan::SearchGrid;

/// A path keeps this much more from the fence than the vehicle insists on, metres: it does not drive exactly on it.
pub(super) const SPARE_M: f64 = 0.05;
/// The same of a way back over the own track, which leads past what it has come past.
const TRACK_SPARE_M: f64 = 0.01;

impl PathSearch<'_> {
    /// Closes what lies too near to the fence for a path to a goal, if it has one, on which `keep_m` is kept from what stands
    /// there. To be called before anything else is closed.
    pub(super) fn close_fence(&self, grid: &mut SearchGrid, keep_m: f64, goal: Option<Point>) {
        let (fence, nodes) = (&self.settings.fence, grid.lattice());
        let (here, closed_m) = (self.pose.at, self.fence_m(keep_m, goal));
        grid.close_outside(fence, closed_m);
        // The middle of the goal's node may be nearer to it than the goal.
        let insisted_m = self.settings.fence_reach_m(self.pose);
        if let Some(goal) = goal.filter(|goal| fence.contains_disc(*goal, insisted_m)) {
            grid.reopen(nodes.cell_at(goal));
        }
        // Who is too near may leave, and comes no nearer to any side.
        let here_m = fence.distance_to_edge(here);
        if !fence.contains(here) || here_m >= closed_m + nodes.cell_m() {
            return;
        }
        let leaves_m = self.settings.leaves_fence_m(self.pose, here_m);
        let Some(around) = CellRect::around(nodes, &[here], leaves_m) else {
            return;
        };
        for node in around.cells() {
            let at = nodes.centre(node);
            let share = at.distance_to(here) / leaves_m;
            let leaves = || {
                fence.edges().all(|edge| {
                    let here_m = edge.distance_to_point(here);
                    let lacking_m = (insisted_m - here_m).max(0.0);
                    edge.distance_to_point(at) >= here_m.min(insisted_m) + share * lacking_m
                })
            };
            if share <= 1.0 && fence.contains(at) && leaves() {
                grid.let_leave(node);
            }
        }
    }

    /// Closes what lies so near to the fence that the vehicle itself could not be there, if its place were exact.
    pub(super) fn close_fence_at_body(&self, grid: &mut SearchGrid) {
        let (fence, reach_m) = (&self.settings.fence, self.settings.reach_m());
        grid.close_outside(fence, reach_m.min(fence.distance_to_edge(self.pose.at)));
    }

    /// Returns a way back over the own track as the vehicle may drive it: where it was believed to be nearer to the fence than
    /// the vehicle insists on by now, it leads just beside, if there is room for the body; `None` if there is not.
    pub(super) fn moved_off_fence(&self, mut track: Vec<Point>) -> Option<Vec<Point>> {
        let fence = &self.settings.fence;
        let insisted_m = self.settings.fence_reach_m(self.pose);
        let kept_m = insisted_m + TRACK_SPARE_M;
        for place in track.iter_mut().skip(1) {
            let was = *place;
            for edge in fence.edges() {
                let nearest = edge.from.toward(edge.to, edge.nearest_share(*place));
                let away_m = nearest.distance_to(*place);
                if away_m > 0.0 && away_m < kept_m {
                    *place = nearest.toward(*place, kept_m / away_m);
                }
            }
            if *place != was
                && !(fence.contains_disc(*place, insisted_m) && self.has_room_for_body(*place))
            {
                return None;
            }
        }
        Some(track)
    }

    /// Returns whether nothing that was heard stands where the body would be at a place.
    fn has_room_for_body(&self, place: Point) -> bool {
        let (lattice, reach_m) = (self.settings.lattice, self.settings.reach_m());
        let Some(area) = CellRect::around(lattice, &[place], reach_m + lattice.cell_m()) else {
            return false;
        };
        let view = self.map.view(self.settings.slice, area);
        let touches = |cell: Cell| {
            let barred = view
                .barred(cell)
                .filter(|barred| barred.bar >= Bar::Confirmed);
            barred.is_some_and(|barred| barred.distance_m(lattice, cell, place) < reach_m)
        };
        !area.cells().any(touches)
    }

    /// Returns how far to keep from the fence, metres. A vehicle, or its goal, may be nearer to it than wished: then that much
    /// must do.
    pub(super) fn fence_m(&self, keep_m: f64, goal: Option<Point>) -> f64 {
        let fence = &self.settings.fence;
        let insisted_m = self.settings.fence_reach_m(self.pose);
        // Past a corner that points inwards a straight way comes nearer than the nodes that it joins.
        let spare_m = match fence.is_convex() {
            true => SPARE_M,
            false => SPARE_M.max(self.settings.lattice.cell_m() * FRAC_1_SQRT_2),
        };
        let least_m = insisted_m + spare_m;
        let from_cells_m = |at: Point| fence.distance_to_edge(at) - self.settings.lattice.cell_m();
        // A goal may lie near the fence; but nobody comes nearer to it step by step, or than the goal asks for.
        let goal_m =
            |goal: Point| from_cells_m(goal).max(least_m.min(fence.distance_to_edge(goal)));
        keep_m
            .min(from_cells_m(self.pose.at).max(least_m))
            .min(goal.map_or(f64::INFINITY, goal_m))
            .max(insisted_m)
    }
}
