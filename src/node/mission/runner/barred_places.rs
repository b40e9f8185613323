//! What the pilot did not pass on the way to a place of the mission: something stands there, or it was looked at and is
//! still unknown. The next courses keep away from it. Pure bookkeeping.

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Segment};
use crate::plan::SearchGrid;

/// Places that are taken for barred.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct BarredPlaces {
    places: Vec<Point>,
}

impl BarredPlaces {
    /// Takes a place for barred; returns whether that is news.
    pub(super) fn note(&mut self, at: Point) -> bool {
        let is_new = !self.places.contains(&at);
        if is_new {
            self.places.push(at);
        }
        is_new
    }

    /// Returns them.
    pub(super) fn places(&self) -> &[Point] {
        &self.places
    }

    /// Forgets all of them: the vehicle goes for something else.
    pub(super) fn clear(&mut self) {
        self.places.clear();
    }

    /// Closes what lies within `keep_m` of them, but not where the vehicle has driven: that is its way back.
    pub(super) fn close(&self, grid: &mut SearchGrid, keep_m: f64, driven: &[Point]) {
        if self.places.is_empty() {
            return;
        }
        let lattice = grid.lattice();
        let track = driven.windows(2).map(|pair| Segment::new(pair[0], pair[1]));
        let mut driven: Vec<(i32, i32)> = track
            .flat_map(|piece| lattice.cells_under(piece))
            .map(|cell| (cell.y, cell.x))
            .collect();
        driven.sort_unstable();
        let is_driven = |place: Point| {
            let cell = lattice.cell_at(place);
            driven.binary_search(&(cell.y, cell.x)).is_ok()
        };
        let is_near = |place: Point| self.places.iter().any(|at| at.distance_to(place) <= keep_m);
        grid.close_where(|place| is_near(place) && !is_driven(place));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Cell;
    use crate::geom::Lattice;
    use crate::map::CellRect;

    #[test]
    fn what_is_near_a_barred_place_is_closed_but_for_the_way_back() {
        let lattice = Lattice::new(0.2);
        let area = CellRect::new(Cell::new(0, 0), Cell::new(20, 20));
        let mut grid = SearchGrid::of_cells(lattice, area, 0.0, |_| false).unwrap();
        let mut barred = BarredPlaces::default();
        barred.note(Point::new(2.0, 2.0));
        let driven = [Point::new(2.1, 0.1), Point::new(2.1, 1.9)];
        barred.close(&mut grid, 0.5, &driven);
        let is_open = |x_m, y_m| grid.passable(lattice.cell_at(Point::new(x_m, y_m)));
        assert!(!is_open(1.9, 1.9) && !is_open(2.3, 2.3), "near");
        assert!(is_open(2.1, 1.7), "driven");
        assert!(is_open(2.7, 2.1) && is_open(0.1, 0.1), "far");
    }

    #[test]
    fn a_place_is_news_once_until_all_are_forgotten() {
        let (mut barred, place) = (BarredPlaces::default(), Point::new(1.0, 2.0));
        assert!(barred.note(place) && !barred.note(place));
        barred.clear();
        assert!(barred.note(place));
    }
}
