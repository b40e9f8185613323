//! Where the vehicle might be if nothing stood but what is confirmed: by its own map, or by what anybody has confirmed.

use super::search::{JUMP_M, PathSearch, planned};
use crate::geom::{Cell, Point};
use crate::map::{Bar, View};
use crate::plan::{NodeSpacing, SearchGrid};

impl PathSearch<'_> {
    /// Returns where the vehicle might be in all of the fence if nothing stood but what is confirmed; `None` when the fence is
    /// too large to search. Peers and what only the reflex has met are not regarded: they come and go. `doubted`
    /// (ascending) are cells that are taken for free although they are confirmed.
    pub(crate) fn optimistic_ground(
        &self,
        goal: Option<Point>,
        doubted: &[Cell],
    ) -> Option<SearchGrid> {
        self.optimistic(goal, |_, cell, bar| {
            bar >= Bar::Confirmed && doubted.binary_search(&cell).is_err()
        })
    }

    /// The same with what any peer has confirmed, although the vehicle has not, kept clear of.
    pub(crate) fn optimistic_by_all(&self) -> Option<SearchGrid> {
        self.optimistic(None, |view, cell, bar| {
            bar >= Bar::Confirmed || view.is_confirmed_by_any(cell)
        })
    }

    fn optimistic(
        &self,
        goal: Option<Point>,
        bars: impl Fn(&View<'_>, Cell, Bar) -> bool,
    ) -> Option<SearchGrid> {
        let area = self.fenced(goal.unwrap_or(self.pose.at))?;
        let (body_m, cell_m) = (self.settings.body.radius_m, self.settings.lattice.cell_m());
        let planned = planned(self.settings, self.pose);
        let clearance = planned.optimistic(body_m, self.pose.sd_m, cell_m);
        let view = self.map.view(self.settings.slice, area);
        let nodes = NodeSpacing::HalfCell;
        let bars = |cell: Cell, bar| bars(&view, cell, bar);
        let mut grid =
            SearchGrid::of_parts(&view, area, clearance, bars, self.pose.at, nodes).ok()?;
        self.close_fence_at_body(&mut grid);
        // It came through there, whatever the map says now.
        for pair in self.driven.windows(2) {
            if pair[0].distance_to(pair[1]) <= JUMP_M {
                grid.open_wholly_along(pair);
            }
        }
        grid.stand_on(grid.lattice().cell_at(self.pose.at));
        Some(grid)
    }

    /// Returns all confirmed cells of the fence, ascending.
    pub(crate) fn confirmed_cells(&self) -> Vec<Cell> {
        let Some(area) = self.fenced(self.pose.at) else {
            return Vec::new();
        };
        let view = self.map.view(self.settings.slice, area);
        let is_confirmed = |cell: &Cell| {
            view.barred(*cell)
                .is_some_and(|barred| barred.bar == Bar::Confirmed)
        };
        let mut confirmed: Vec<Cell> = area.cells().filter(is_confirmed).collect();
        confirmed.sort_unstable();
        confirmed
    }
}
