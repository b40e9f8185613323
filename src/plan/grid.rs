//! The ground of a search: a rectangle of cells, each with the reasons why a vehicle's middle may not be there.
//!
//! Occupied cells are inflated once, when the grid is made; the search then reads one byte a cell. Peers, fences
//! and the like are added by [`SearchGrid::close_within`] and [`SearchGrid::close_where`].

use thiserror::Error;

use super::barriers::{Barriers, Nearness, NodeSpacing};
use super::steps::{HIGHEST_LEVEL, LEVELS_PER_PRICE};
use super::swath::rows_within;
use super::{Clearance, RequiredClearance};
use crate::geom::{Cell, Lattice, Point, Polygon, Segment};
use crate::map::{Bar, CellRect, Occupancy, View};

/// A grid has at most this many cells (a search takes about 12 bytes for each).
pub const MAX_GRID_CELLS: u64 = 16_000_000;

/// A step to where it is nearer to something than is wished for costs half as much again.
const NEARER_LEVEL: u8 = 4;
/// The vehicle's disc may not touch it: occupied, or unknown where that is not allowed.
const SOLID: u8 = 1;
/// Too near to a solid cell.
const NEAR: u8 = 2;
/// Closed by the caller.
const CLOSED: u8 = 4;

/// Why a grid cannot be made.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum GridError {
    /// The rectangle is too large.
    #[error("{cells} cells are too many to search, at most {MAX_GRID_CELLS} are allowed")]
    TooLarge {
        /// How many it would have.
        cells: u64,
    },
    /// The clearance is not a distance.
    #[error("a clearance is from 0 to 100 cells, not {clearance_m} m")]
    Clearance {
        /// What was given, metres.
        clearance_m: f64,
    },
}

/// Returns the clearance between cell middles which makes every straight step between neighbours sweep free with
/// `half_width_m`: a step of length s between two places that far from an obstacle comes as near as
/// √(clearance² − s²/4), and the longest step is a cell's diagonal.
#[inline]
pub fn swept_clearance_m(half_width_m: f64, lattice: Lattice) -> f64 {
    (half_width_m * half_width_m + lattice.cell_m() * lattice.cell_m() / 2.0).sqrt()
}

/// A rectangle of cells to search in.
#[derive(Clone, Debug)]
pub struct SearchGrid {
    lattice: Lattice,
    area: CellRect,
    width: usize,
    height: usize,
    /// Half-width of the strip that a smoothed route sweeps, metres.
    half_width_m: f64,
    /// Row-major, x fastest.
    flags: Vec<u8>,
    /// How dear each cell is, as a level of [`super::steps::price`]; `None`: all are alike.
    levels: Option<Vec<u8>>,
    /// What bars the way part by part, in a grid that is finer than the map's cells.
    barriers: Option<Barriers>,
}

impl SearchGrid {
    /// Copies a rectangle of the map for a vehicle that sweeps `half_width_m` (radius + padding + pose
    /// deviation). Without `unknown_allowed`, unknown cells are as solid as occupied ones, and routes are released
    /// by a [`super::Corridor`] of that half-width as far as they go; with it (as the ground plans), they are never
    /// blocked.
    ///
    /// # Errors
    /// [`GridError`] when the rectangle is too large or the half-width impossible.
    pub fn of_map(
        view: &View<'_>,
        area: CellRect,
        half_width_m: f64,
        unknown_allowed: bool,
    ) -> Result<SearchGrid, GridError> {
        let lattice = view.lattice();
        let clearance_m = swept_clearance_m(half_width_m, lattice);
        let solid = |occupancy| match occupancy {
            Occupancy::Free => 0,
            Occupancy::Unknown if unknown_allowed => 0,
            Occupancy::Unknown | Occupancy::Occupied => SOLID,
        };
        let mut grid = SearchGrid::bare(lattice, area, clearance_m)?;
        grid.half_width_m = half_width_m;
        for (y, flags) in (area.low.y..=area.high.y).zip(grid.flags.chunks_exact_mut(grid.width)) {
            view.read_row(Cell::new(area.low.x, y), flags, solid);
        }
        grid.inflate(clearance_m / lattice.cell_m());
        Ok(grid)
    }

    /// Copies a rectangle of the map's cells, with nodes closer together than these, for a vehicle that keeps these
    /// distances from the parts of the cells that `bars` says bar, asked for the reason, and `stands` somewhere: what it is
    /// too near to already it may leave. A doorway is then as wide as it was seen; it takes several times as long as
    /// [`SearchGrid::of_map`].
    ///
    /// # Errors
    /// [`GridError`] when the rectangle is too large or the distances impossible.
    pub fn of_parts(
        view: &View<'_>,
        area: CellRect,
        clearance: RequiredClearance,
        bars: impl Fn(Cell, Bar) -> bool,
        stands: Point,
        spacing: NodeSpacing,
    ) -> Result<SearchGrid, GridError> {
        let per_cell = spacing.per_cell();
        let lattice = Lattice::new(view.lattice().cell_m() / f64::from(per_cell));
        let first = |cell: i32| cell.saturating_mul(per_cell);
        let last = |cell: i32| first(cell).saturating_add(per_cell - 1);
        let nodes = CellRect::new(
            Cell::new(first(area.low.x), first(area.low.y)),
            Cell::new(last(area.high.x), last(area.high.y)),
        );
        let mut grid = SearchGrid::bare(lattice, nodes, clearance.most_m())?;
        let barriers = Barriers::of_view(view, area, clearance, bars, stands, spacing);
        let width = grid.width;
        let mut levels = vec![0; grid.flags.len()];
        barriers.mark(|row, columns, nearness| {
            let flags = &mut grid.flags[row * width..][columns.clone()];
            match nearness {
                Nearness::Solid => flags.iter_mut().for_each(|flag| *flag |= SOLID | NEAR),
                Nearness::TooNear => flags.iter_mut().for_each(|flag| *flag |= NEAR),
                Nearness::Nearer => levels[row * width..][columns].fill(NEARER_LEVEL),
            }
        });
        grid.levels = Some(levels);
        grid.barriers = Some(barriers);
        Ok(grid)
    }

    /// Makes a grid from single cells. A cell is too near when its middle lies nearer than `clearance_m` to the
    /// middle of a solid one.
    ///
    /// # Errors
    /// [`GridError`] when the rectangle is too large or the clearance impossible.
    pub fn of_cells(
        lattice: Lattice,
        area: CellRect,
        clearance_m: f64,
        solid: impl Fn(Cell) -> bool,
    ) -> Result<SearchGrid, GridError> {
        let mut grid = SearchGrid::bare(lattice, area, clearance_m)?;
        for (cell, flag) in area.cells().zip(&mut grid.flags) {
            *flag = if solid(cell) { SOLID } else { 0 };
        }
        grid.inflate(clearance_m / lattice.cell_m());
        Ok(grid)
    }

    /// Makes a grid in which nothing stands.
    fn bare(lattice: Lattice, area: CellRect, clearance_m: f64) -> Result<SearchGrid, GridError> {
        let cells = area.width_cells().saturating_mul(area.height_cells());
        if cells > MAX_GRID_CELLS {
            return Err(GridError::TooLarge { cells });
        }
        if !(0.0..=100.0).contains(&(clearance_m / lattice.cell_m())) {
            return Err(GridError::Clearance { clearance_m });
        }
        let half_width_m = (square(clearance_m) - square(lattice.cell_m()) / 2.0)
            .max(0.0)
            .sqrt();
        let (width, height) = (area.width_cells() as usize, area.height_cells() as usize);
        Ok(SearchGrid {
            lattice,
            area,
            width,
            height,
            half_width_m,
            flags: vec![0; width * height],
            levels: None,
            barriers: None,
        })
    }

    /// Makes a grid from distances that are kept, for a vehicle that sweeps `half_width_m`: the same as
    /// [`SearchGrid::of_map`] where the map is known, but obstacles just outside the rectangle count too, and what lies
    /// outside the bounds of the distances is closed. It takes less time, since nothing is inflated.
    ///
    /// # Errors
    /// [`GridError`] when the rectangle is too large or the distances do not reach as far as the half-width needs.
    pub fn of_clearance(
        clearance: &Clearance,
        area: CellRect,
        half_width_m: f64,
    ) -> Result<SearchGrid, GridError> {
        let lattice = clearance.lattice();
        let clearance_m = swept_clearance_m(half_width_m, lattice);
        let clearance_cells = clearance_m / lattice.cell_m();
        let mut grid = SearchGrid::bare(lattice, area, 0.0)?;
        if !(0.0..=f64::from(clearance.reach_cells())).contains(&clearance_cells) {
            return Err(GridError::Clearance { clearance_m });
        }
        grid.half_width_m = half_width_m;
        let near2 = square(clearance_cells) * (1.0 - 1e-12);
        // The least whole square that is not too near.
        let apart = libm::ceil(near2).max(1.0) as u16;
        for (y, flags) in (area.low.y..=area.high.y).zip(grid.flags.chunks_exact_mut(grid.width)) {
            clearance.read_row(area.low.x, y, flags, |square| match square {
                None => CLOSED,
                Some(0) => SOLID | NEAR,
                Some(square) if square < apart => NEAR,
                Some(_) => 0,
            });
        }
        Ok(grid)
    }

    /// Makes the cells nearer than `wished_m` to something dearer: a step into a cell at distance d costs
    /// 1 + `extra` · (1 − d / `wished_m`) times as much, rounded to eighths; `extra` is at most 3, and the wish counts
    /// as far as the distances reach. Ways then keep their distance where that costs little.
    pub fn prefer_clearance(&mut self, clearance: &Clearance, wished_m: f64, extra: f64) {
        let wished_cells =
            (wished_m / clearance.lattice().cell_m()).min(f64::from(clearance.reach_cells()));
        if !(wished_cells > 0.0 && extra > 0.0) {
            self.levels = None;
            return;
        }
        let by_square: Vec<u8> = (0..=square(wished_cells) as u32)
            .map(|square| {
                level_of(1.0 + extra * (1.0 - f64::from(square).sqrt() / wished_cells).max(0.0))
            })
            .collect();
        let mut levels = vec![0; self.flags.len()];
        for (y, line) in
            (self.area.low.y..=self.area.high.y).zip(levels.chunks_exact_mut(self.width))
        {
            clearance.read_row(self.area.low.x, y, line, |square| {
                square
                    .and_then(|square| by_square.get(usize::from(square)).copied())
                    .unwrap_or(0)
            });
        }
        self.levels = Some(levels);
    }

    /// Returns the lattice of the cells.
    #[inline]
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Returns the searched rectangle.
    #[inline]
    pub fn area(&self) -> CellRect {
        self.area
    }

    /// Closes all cells whose middle lies within `radius_m` of a segment, e.g. a peer's leg. Closed cells are not
    /// inflated: the radius holds both vehicles.
    pub fn close_within(&mut self, along: Segment, radius_m: f64) {
        if !along.from.is_finite() || !along.to.is_finite() || !radius_m.is_finite() {
            return;
        }
        for (y, columns) in rows_within(self.lattice, along, radius_m, self.rows()) {
            for x in
                (*columns.start()).max(self.area.low.x)..=(*columns.end()).min(self.area.high.x)
            {
                let cell = Cell::new(x, y);
                if along.distance_to_point(self.lattice.centre(cell)) <= radius_m {
                    self.close(cell);
                }
            }
        }
    }

    /// Closes all cells in which a disc around the middle is not wholly inside a polygon, e.g. the fence: the same as
    /// [`SearchGrid::close_where`] with [`Polygon::contains_disc`], but each edge is asked only along itself.
    pub fn close_outside(&mut self, fence: &Polygon, radius_m: f64) {
        // Between neighbouring middles that lie this far from all edges there is no edge.
        let apart_m = radius_m.max(self.lattice.cell_m());
        let (lattice, width) = (self.lattice, self.width);
        let mut near = vec![false; self.flags.len()];
        for edge in fence
            .edges()
            .filter(|edge| edge.from.is_finite() && edge.to.is_finite())
        {
            for (y, columns) in rows_within(lattice, edge, apart_m, self.rows()) {
                let start = (y - self.area.low.y) as usize * width;
                for x in
                    (*columns.start()).max(self.area.low.x)..=(*columns.end()).min(self.area.high.x)
                {
                    let index = start + (x - self.area.low.x) as usize;
                    near[index] = true;
                    if edge.distance_to_point(lattice.centre(Cell::new(x, y))) < radius_m {
                        self.flags[index] |= CLOSED;
                    }
                }
            }
        }
        let rows = self.flags.chunks_exact_mut(width);
        for ((y, flags), near) in (self.area.low.y..).zip(rows).zip(near.chunks_exact(width)) {
            let (mut inside, mut is_known) = (false, false);
            for ((x, flag), near) in (self.area.low.x..).zip(flags).zip(near) {
                if *near && *flag & CLOSED != 0 {
                    is_known = false;
                    continue;
                }
                if *near || !is_known {
                    inside = fence.contains(lattice.centre(Cell::new(x, y)));
                }
                is_known = !near;
                if !inside {
                    *flag |= CLOSED;
                }
            }
        }
    }

    /// Closes all cells whose middle the predicate names, e.g. what lies outside the fence.
    #[inline]
    pub fn close_where(&mut self, closed: impl Fn(Point) -> bool) {
        for y in self.area.low.y..=self.area.high.y {
            for x in self.area.low.x..=self.area.high.x {
                let cell = Cell::new(x, y);
                if closed(self.lattice.centre(cell)) {
                    self.close(cell);
                }
            }
        }
    }

    /// Opens a cell that was closed; what stands there, or near it, bars it still.
    #[inline]
    pub fn reopen(&mut self, cell: Cell) {
        if let Some(index) = self.index(cell) {
            self.flags[index] &= !CLOSED;
        }
    }

    /// Takes a cell that was closed for one that is too near to something: a vehicle may leave it.
    #[inline]
    pub fn let_leave(&mut self, cell: Cell) {
        if let Some(flags) = self.index(cell).map(|index| &mut self.flags[index])
            && *flags & CLOSED != 0
        {
            *flags = *flags & !CLOSED | NEAR;
        }
    }

    /// Takes note of where the vehicle stands: nothing else stands there, and no closed cell holds it.
    #[inline]
    pub fn stand_on(&mut self, cell: Cell) {
        if let Some(index) = self.index(cell) {
            self.flags[index] &= !(CLOSED | SOLID);
        }
    }

    /// Opens the cells under a track that are too near to something, but for solid and closed ones: where a vehicle has
    /// driven there was room for it. Returns whether any was closed.
    pub fn open_along(&mut self, track: &[Point]) -> bool {
        let mut has_opened = false;
        for index in self.under(track) {
            has_opened |= self.flags[index] & NEAR != 0;
            self.flags[index] &= !NEAR;
        }
        has_opened
    }

    /// Opens the cells under a track, whatever bars them.
    pub fn open_wholly_along(&mut self, track: &[Point]) {
        for index in self.under(track) {
            self.flags[index] = 0;
        }
    }

    /// Closes all cells that do not lie under a track.
    pub fn close_beside(&mut self, track: &[Point]) {
        let mut is_under = vec![false; self.flags.len()];
        for index in self.under(track) {
            is_under[index] = true;
        }
        for (flags, is_under) in self.flags.iter_mut().zip(is_under) {
            *flags |= if is_under { 0 } else { CLOSED };
        }
    }

    /// Returns the cells of the rectangle that lie under a track, by their indices; some come more than once.
    fn under(&self, track: &[Point]) -> Vec<usize> {
        let segments = track
            .windows(2)
            .filter(|pair| pair[0].is_finite() && pair[1].is_finite())
            .map(|pair| Segment::new(pair[0], pair[1]));
        let cells = segments.flat_map(|segment| self.lattice.cells_under(segment));
        cells.filter_map(|cell| self.index(cell)).collect()
    }

    /// Returns whether a vehicle's middle may be in a cell; `false` outside the rectangle.
    #[inline]
    pub fn passable(&self, cell: Cell) -> bool {
        self.index(cell).is_some_and(|index| self.open(index))
    }

    /// Returns whether a vehicle's middle may be at a place, at the end of a way.
    pub fn has_room_at(&self, place: Point) -> bool {
        let cell = self.lattice.cell_at(place);
        self.passable(cell) && self.sweeps_clear(Segment::new(self.lattice.centre(cell), place))
    }

    /// Returns whether a cell bars only by being too near to something: one may leave it.
    #[inline]
    pub(super) fn only_near(&self, index: usize) -> bool {
        self.flags[index] == NEAR
    }

    /// Returns whether a vehicle may be in the cell of this index.
    #[inline]
    pub(super) fn open(&self, index: usize) -> bool {
        self.flags[index] == 0
    }

    /// Writes which cells of a row a vehicle may be in, as 0 and 1.
    #[inline]
    pub(super) fn write_open(&self, row: usize, open: &mut [u8]) {
        let flags = &self.flags[row * self.width..][..self.width];
        open.iter_mut()
            .zip(flags)
            .for_each(|(open, flags)| *open = u8::from(*flags == 0));
    }

    /// Returns whether some cells are dearer than others.
    #[inline]
    pub(super) fn has_levels(&self) -> bool {
        self.levels.is_some()
    }

    /// Returns how dear the cells of a row are; nothing where all are alike.
    #[inline]
    pub(super) fn level_row(&self, row: usize) -> &[u8] {
        self.levels
            .as_ref()
            .map_or(&[], |levels| &levels[row * self.width..][..self.width])
    }

    /// Returns how dear a cell is; 0 outside.
    #[inline]
    pub(super) fn level(&self, cell: Cell) -> u8 {
        let levels = self.levels.as_ref();
        levels
            .zip(self.index(cell))
            .map_or(0, |(levels, index)| levels[index])
    }

    /// Returns how dear the dearest cell under a segment is.
    #[inline]
    pub(super) fn highest_level(&self, along: Segment) -> u8 {
        if self.levels.is_none() {
            return 0;
        }
        self.lattice
            .cells_under(along)
            .map(|cell| self.level(cell))
            .max()
            .unwrap_or(0)
    }

    /// Returns whether the strip along a segment is clear: no solid middle nearer than the half-width, and no
    /// closed cell under it.
    pub(super) fn sweeps_clear(&self, along: Segment) -> bool {
        if let Some(barriers) = &self.barriers {
            return barriers.is_clear(along) && self.is_open_along(along);
        }
        let reach_m = self.half_width_m - 1e-9;
        for (y, columns) in rows_within(self.lattice, along, self.half_width_m, self.rows()) {
            for x in columns {
                let cell = Cell::new(x, y);
                let solid = self
                    .index(cell)
                    .is_some_and(|index| self.flags[index] & SOLID != 0);
                if solid && along.distance_to_point(self.lattice.centre(cell)) < reach_m {
                    return false;
                }
            }
        }
        self.is_open_along(along)
    }

    /// Returns whether no solid and no closed cell lies under a segment.
    fn is_open_along(&self, along: Segment) -> bool {
        let mut under = self.lattice.cells_under(along);
        under.all(|cell| {
            self.index(cell)
                .is_some_and(|index| self.flags[index] & (SOLID | CLOSED) == 0)
        })
    }

    /// Returns the place of a cell in the flags; `None` outside.
    #[inline]
    pub(super) fn index(&self, cell: Cell) -> Option<usize> {
        if !self.area.contains(cell) {
            return None;
        }
        let (x, y) = (
            (cell.x - self.area.low.x) as usize,
            (cell.y - self.area.low.y) as usize,
        );
        Some(y * self.width + x)
    }

    /// Returns the cell at a place in the flags.
    #[inline]
    pub(super) fn cell(&self, index: usize) -> Cell {
        Cell::new(
            self.area.low.x + (index % self.width) as i32,
            self.area.low.y + (index / self.width) as i32,
        )
    }

    /// Returns columns and rows.
    #[inline]
    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    #[inline]
    fn rows(&self) -> std::ops::RangeInclusive<i32> {
        self.area.low.y..=self.area.high.y
    }

    #[inline]
    fn close(&mut self, cell: Cell) {
        if let Some(index) = self.index(cell) {
            self.flags[index] |= CLOSED;
        }
    }

    /// Marks all cells nearer than `clearance_cells` to a solid one. Only the rims of obstacles are
    /// stamped: what is near to their inside is inside or near to their rim.
    fn inflate(&mut self, clearance_cells: f64) {
        let reach = clearance_cells.ceil() as i32;
        let near2 = square(clearance_cells) * (1.0 - 1e-12);
        let half = |dy: i32| {
            (0..=reach)
                .rev()
                .find(|dx| f64::from(dx * dx + dy * dy) < near2)
        };
        let rows: Vec<(i32, i32)> = (-reach..=reach)
            .filter_map(|dy| half(dy).map(|dx| (dy, dx)))
            .collect();
        for y in 0..self.height {
            for x in 0..self.width {
                if self.flags[y * self.width + x] & SOLID != 0 && self.on_rim(x, y) {
                    self.stamp(x, y, &rows);
                }
            }
        }
    }

    fn on_rim(&self, x: usize, y: usize) -> bool {
        if x == 0 || y == 0 || x + 1 == self.width || y + 1 == self.height {
            return true;
        }
        let index = y * self.width + x;
        ![index - 1, index + 1, index - self.width, index + self.width]
            .into_iter()
            .all(|beside| self.flags[beside] & SOLID != 0)
    }

    fn stamp(&mut self, x: usize, y: usize, rows: &[(i32, i32)]) {
        let (x, y) = (x as i32, y as i32);
        for (dy, dx) in rows {
            let row = y + dy;
            if row < 0 || row >= self.height as i32 {
                continue;
            }
            let (low, high) = (
                (x - dx).max(0) as usize,
                (x + dx).min(self.width as i32 - 1) as usize,
            );
            let start = row as usize * self.width;
            for flag in &mut self.flags[start + low..=start + high] {
                *flag |= NEAR;
            }
        }
    }
}

/// Returns the level of a price, as a multiple of the ordinary one.
#[inline]
fn level_of(times: f64) -> u8 {
    libm::round((times - 1.0) * LEVELS_PER_PRICE as f64).clamp(0.0, f64::from(HIGHEST_LEVEL)) as u8
}

#[inline]
fn square(value: f64) -> f64 {
    value * value
}

#[cfg(test)]
mod tests;
