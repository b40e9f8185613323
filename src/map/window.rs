//! A rectangle of the merged map, borrowed for fast reading: one index instead of a tree search per cell.

use tomoswarm_proto::{TILE_CELLS, TILE_SIDE, TileAddress};

use super::cleared::BarredCell;
use super::joined::JoinedTile;
use super::tile::{Occupancy, REACH_TILES, SIDE_BITS, index_in_tile, origin_of};
use crate::geom::{Cell, Lattice, Point, Rect};

/// A rectangle of cells; both corners belong to it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CellRect {
    /// The cell with the smallest column and row.
    pub low: Cell,
    /// The cell with the largest column and row.
    pub high: Cell,
}

impl CellRect {
    /// Makes a rectangle from two opposite cells, in any order.
    #[inline]
    pub fn new(a: Cell, b: Cell) -> CellRect {
        CellRect {
            low: Cell::new(a.x.min(b.x), a.y.min(b.y)),
            high: Cell::new(a.x.max(b.x), a.y.max(b.y)),
        }
    }

    /// Returns all cells that touch a rectangle of the plane.
    #[inline]
    pub fn covering(lattice: Lattice, rect: Rect) -> CellRect {
        CellRect::new(lattice.cell_at(rect.min), lattice.cell_at(rect.max))
    }

    /// Returns all cells that touch the smallest rectangle around points, widened by `margin_m` on every side;
    /// `None` without points.
    #[inline]
    pub fn around(lattice: Lattice, points: &[Point], margin_m: f64) -> Option<CellRect> {
        let first = *points.first()?;
        let bounds = points
            .iter()
            .fold(Rect::new(first, first), |bounds, point| Rect {
                min: Point::new(bounds.min.x_m.min(point.x_m), bounds.min.y_m.min(point.y_m)),
                max: Point::new(bounds.max.x_m.max(point.x_m), bounds.max.y_m.max(point.y_m)),
            });
        Some(CellRect::covering(lattice, bounds.shrunk(-margin_m)))
    }

    /// Returns whether a cell belongs to the rectangle.
    #[inline]
    pub fn contains(self, cell: Cell) -> bool {
        (self.low.x..=self.high.x).contains(&cell.x) && (self.low.y..=self.high.y).contains(&cell.y)
    }

    /// Returns the cells of a tile.
    #[inline]
    pub fn of_tile(address: TileAddress) -> CellRect {
        let low = origin_of(address);
        let last = TILE_SIDE as i32 - 1;
        CellRect {
            low,
            high: Cell::new(low.x.saturating_add(last), low.y.saturating_add(last)),
        }
    }

    /// Returns all cells, row by row.
    #[inline]
    pub fn cells(self) -> impl Iterator<Item = Cell> {
        let columns = self.low.x..=self.high.x;
        (self.low.y..=self.high.y).flat_map(move |y| columns.clone().map(move |x| Cell::new(x, y)))
    }

    /// Returns the number of columns.
    #[inline]
    pub fn width_cells(self) -> u64 {
        self.high.x.abs_diff(self.low.x) as u64 + 1
    }

    /// Returns the number of rows.
    #[inline]
    pub fn height_cells(self) -> u64 {
        self.high.y.abs_diff(self.low.y) as u64 + 1
    }

    /// Returns the smallest rectangle that holds both.
    #[inline]
    pub fn join(self, other: CellRect) -> CellRect {
        CellRect {
            low: Cell::new(self.low.x.min(other.low.x), self.low.y.min(other.low.y)),
            high: Cell::new(self.high.x.max(other.high.x), self.high.y.max(other.high.y)),
        }
    }

    /// Returns what both have in common.
    #[inline]
    pub fn overlap(self, other: CellRect) -> Option<CellRect> {
        let low = Cell::new(self.low.x.max(other.low.x), self.low.y.max(other.low.y));
        let high = Cell::new(self.high.x.min(other.high.x), self.high.y.min(other.high.y));
        (low.x <= high.x && low.y <= high.y).then_some(CellRect { low, high })
    }

    /// Returns the rectangle widened by so many cells on every side.
    pub fn grown(self, cells: i32) -> CellRect {
        CellRect {
            low: Cell::new(
                self.low.x.saturating_sub(cells),
                self.low.y.saturating_sub(cells),
            ),
            high: Cell::new(
                self.high.x.saturating_add(cells),
                self.high.y.saturating_add(cells),
            ),
        }
    }

    /// Returns the tile columns and rows that touch the rectangle and lie within the map's reach.
    #[inline]
    pub(super) fn tiles(self) -> (std::ops::Range<i32>, std::ops::Range<i32>) {
        let range = |low: i32, high: i32| {
            let first = (low >> SIDE_BITS).max(-REACH_TILES);
            first..((high >> SIDE_BITS) + 1).clamp(first, REACH_TILES.max(first))
        };
        (
            range(self.low.x, self.high.x),
            range(self.low.y, self.high.y),
        )
    }
}

/// A borrowed rectangle of the merged map at one altitude slice. Cells outside it read as unknown.
#[derive(Clone, Debug)]
pub struct View<'a> {
    pub(super) lattice: Lattice,
    /// Column and row of the first tile.
    pub(super) first: (i32, i32),
    pub(super) columns: usize,
    /// Row-major, each with the parts of its cells that are known to be empty; `None` where nothing is known.
    pub(super) tiles: Vec<Option<ViewTile<'a>>>,
}

/// What is known of the cells of a tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewTile<'a> {
    /// What all layers say together.
    pub(super) joined: &'a JoinedTile,
    /// The parts that are known to be empty.
    pub(super) cleared: Option<&'a [u16; TILE_CELLS]>,
}

impl View<'_> {
    /// Returns the lattice of the cells.
    #[inline]
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Returns what is known of a cell.
    #[inline]
    pub fn occupancy(&self, cell: Cell) -> Occupancy {
        match self.tile(cell) {
            Some(tile) => Occupancy::of_value(tile.joined.sums[index_in_tile(cell)]),
            None => Occupancy::Unknown,
        }
    }

    /// Returns whether nobody has seen a cell, as far as that is worth another look. What is unknown because vehicles
    /// contradict each other is not, where something stands beside it: the deviations of their places move a wall by a
    /// cell, and no look of one of them makes another say something else.
    #[inline]
    pub fn is_unseen(&self, cell: Cell) -> bool {
        self.occupancy(cell) == Occupancy::Unknown
            && !(self.is_disputed(cell) && self.has_occupied_beside(cell))
    }

    fn is_disputed(&self, cell: Cell) -> bool {
        let tile = self.tile(cell);
        tile.is_some_and(|tile| tile.joined.is_disputed(index_in_tile(cell)))
    }

    fn has_occupied_beside(&self, cell: Cell) -> bool {
        let around = CellRect::new(cell, cell).grown(1);
        around
            .cells()
            .any(|beside| self.occupancy(beside) == Occupancy::Occupied)
    }

    /// Fills a row, from a cell on, with what `judge` makes of what is known of the cells.
    pub fn read_row<T: Copy>(&self, from: Cell, line: &mut [T], judge: impl Fn(Occupancy) -> T) {
        let (mut x, mut rest) = (from.x, line);
        while !rest.is_empty() {
            let cell = Cell::new(x, from.y);
            let index = index_in_tile(cell);
            let count = (TILE_SIDE - index % TILE_SIDE).min(rest.len());
            let (part, others) = rest.split_at_mut(count);
            match self.tile(cell) {
                Some(tile) => {
                    let known = &tile.joined.sums[index..index + count];
                    for (one, sum) in part.iter_mut().zip(known) {
                        *one = judge(Occupancy::of_value(*sum));
                    }
                }
                None => part.fill(judge(Occupancy::Unknown)),
            }
            (x, rest) = (x.wrapping_add_unsigned(count as u32), others);
        }
    }

    /// Copies what is known of the cells of a rectangle.
    pub fn occupancy_grid(&self, area: CellRect) -> OccupancyGrid {
        let (width, height) = (area.width_cells() as usize, area.height_cells() as usize);
        let mut cells = vec![Occupancy::Unknown; width * height];
        for (y, line) in (area.low.y..=area.high.y).zip(cells.chunks_exact_mut(width)) {
            self.read_row(Cell::new(area.low.x, y), line, |occupancy| occupancy);
        }
        OccupancyGrid { area, width, cells }
    }

    /// Returns where in a cell something may stand; `None` when it is free.
    #[inline]
    pub fn barred(&self, cell: Cell) -> Option<BarredCell> {
        let Some(tile) = self.tile(cell) else {
            return BarredCell::of(Occupancy::Unknown, false, 0);
        };
        let index = index_in_tile(cell);
        let cleared = tile.cleared.map_or(0, |parts| parts[index]);
        let said = Occupancy::of_value(tile.joined.sums[index]);
        BarredCell::of(said, tile.joined.is_confirmed(index), cleared)
    }

    /// Returns whether somebody holds a cell for confirmed, although it may be unknown to the vehicle that drives by the map.
    pub fn is_confirmed_by_any(&self, cell: Cell) -> bool {
        let tile = self.tile(cell);
        tile.is_some_and(|tile| tile.joined.is_confirmed(index_in_tile(cell)))
    }

    #[inline]
    fn tile(&self, cell: Cell) -> Option<ViewTile<'_>> {
        let column = (cell.x >> SIDE_BITS).wrapping_sub(self.first.0) as usize;
        let row = (cell.y >> SIDE_BITS).wrapping_sub(self.first.1) as usize;
        if column >= self.columns {
            return None;
        }
        let place = row.saturating_mul(self.columns).saturating_add(column);
        self.tiles.get(place).copied().flatten()
    }
}

/// A rectangle of the merged map, copied for who reads its cells again and again. Those outside it are unknown.
#[derive(Clone, Debug)]
pub struct OccupancyGrid {
    area: CellRect,
    width: usize,
    /// Row-major, x fastest.
    cells: Vec<Occupancy>,
}

impl OccupancyGrid {
    /// Returns which cells it holds.
    pub fn area(&self) -> CellRect {
        self.area
    }

    /// Returns what is known of a cell.
    #[inline]
    pub fn occupancy(&self, cell: Cell) -> Occupancy {
        if !self.area.contains(cell) {
            return Occupancy::Unknown;
        }
        let (x, y) = (
            cell.x.abs_diff(self.area.low.x) as usize,
            cell.y.abs_diff(self.area.low.y) as usize,
        );
        self.cells[y * self.width + x]
    }

    /// Returns whether something stands within so many columns and rows of a cell.
    pub fn has_occupied_around(&self, cell: Cell, reach: i32) -> bool {
        let around = CellRect::new(cell, cell).grown(reach);
        let Some(part) = around.overlap(self.area) else {
            return false;
        };
        let column = |x: i32| x.abs_diff(self.area.low.x) as usize;
        let columns = column(part.low.x)..column(part.high.x) + 1;
        let first = part.low.y.abs_diff(self.area.low.y) as usize;
        let rows = self.cells.chunks_exact(self.width).skip(first);
        rows.take(part.height_cells() as usize)
            .any(|row| row[columns.clone()].contains(&Occupancy::Occupied))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_around_points_holds_them_with_its_margin() {
        let lattice = Lattice::new(0.2);
        let points = [Point::new(1.0, -1.0), Point::new(-0.5, 2.0)];
        let rect = CellRect::around(lattice, &points, 0.5).unwrap();
        assert_eq!((rect.low, rect.high), (Cell::new(-5, -8), Cell::new(7, 12)));
        assert_eq!((rect.width_cells(), rect.height_cells()), (13, 21));
        assert_eq!(CellRect::around(lattice, &[], 0.5), None);
    }

    #[test]
    fn rectangles_overlap_in_what_both_hold() {
        let rect = CellRect::new(Cell::new(0, 0), Cell::new(9, 9));
        let shared = rect.overlap(CellRect::new(Cell::new(9, -4), Cell::new(20, 3)));
        assert_eq!(
            shared,
            Some(CellRect::new(Cell::new(9, 0), Cell::new(9, 3)))
        );
        assert_eq!(
            rect.overlap(CellRect::new(Cell::new(10, 0), Cell::new(20, 3))),
            None
        );
        assert_eq!(
            rect.grown(2),
            CellRect::new(Cell::new(-2, -2), Cell::new(11, 11))
        );
        let all = CellRect::new(Cell::new(i32::MIN, i32::MIN), Cell::new(i32::MAX, i32::MAX));
        assert_eq!(all.grown(5), all);
    }

    #[test]
    fn a_rectangle_without_end_covers_only_tiles_within_reach() {
        let all = CellRect::new(Cell::new(i32::MIN, 0), Cell::new(i32::MAX, 31));
        assert_eq!(all.tiles(), (-1024..1024, 0..1));
        let beyond = CellRect::new(Cell::new(i32::MAX - 5, 0), Cell::new(i32::MAX, 31));
        assert!(beyond.tiles().0.is_empty());
    }
}
