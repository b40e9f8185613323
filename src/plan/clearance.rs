//! How far it is from every cell to the nearest one that bars the way, kept up to date around what changed.
//!
//! Distances are exact, between cell middles, up to a reach; beyond it they are only known to be greater. From it a
//! [`super::SearchGrid`] for any clearance up to the reach is made by comparing, without looking at the map.

use super::grid::{GridError, MAX_GRID_CELLS};
use crate::geom::{Cell, Lattice};
use crate::map::{CellRect, Merged, Occupancy};

/// Farther than the reach.
const FAR: u16 = u16::MAX;
/// No solid cell in this column within the reach.
const NONE: u8 = u8::MAX;
/// The longest reach, cells: its square fits into 16 bits.
const MAX_REACH_CELLS: f64 = 100.0;

/// Distances to the nearest solid cell within bounds. Solid is what is occupied, and by choice what is unknown.
/// What lies outside the bounds is not seen: it neither has distances nor causes any.
#[derive(Clone, Debug)]
pub struct Clearance {
    lattice: Lattice,
    slice: i16,
    bounds: CellRect,
    unknown_is_solid: bool,
    reach_cells: i32,
    /// What has been looked at so far, with the reach around it; all else within bounds is unknown. It grows.
    window: Option<CellRect>,
    /// Squared distances over the window, cells²; row-major, x fastest; 0 = solid.
    squares: Vec<u16>,
}

impl Clearance {
    /// Makes the clearance of an empty map. `reach_m` is the largest clearance that will be asked for.
    ///
    /// # Errors
    /// [`GridError`] when the bounds are too large or the reach is no distance up to 100 cells.
    pub fn new(
        lattice: Lattice,
        slice: i16,
        bounds: CellRect,
        reach_m: f64,
        unknown_is_solid: bool,
    ) -> Result<Clearance, GridError> {
        let cells = bounds.width_cells().saturating_mul(bounds.height_cells());
        if cells > MAX_GRID_CELLS {
            return Err(GridError::TooLarge { cells });
        }
        let reach_cells = reach_m / lattice.cell_m();
        if !(0.0..=MAX_REACH_CELLS).contains(&reach_cells) {
            return Err(GridError::Clearance {
                clearance_m: reach_m,
            });
        }
        let reach_cells = libm::ceil(reach_cells) as i32;
        Ok(Clearance {
            lattice,
            slice,
            bounds,
            unknown_is_solid,
            reach_cells,
            window: None,
            squares: Vec::new(),
        })
    }

    /// Takes note of a change of the map: all cells that changed since the last update lie in `changed`.
    pub fn update(&mut self, map: &Merged, changed: CellRect) {
        let Some(area) = changed.overlap(self.bounds) else {
            return;
        };
        let Some(window) = area.grown(self.reach_cells).overlap(self.bounds) else {
            return;
        };
        self.widen(window);
        let turned = self.turned(map, area);
        for cell in &turned {
            if let Some(place) = self.place(*cell) {
                self.squares[place] = if self.squares[place] == 0 { FAR } else { 0 };
            }
        }
        let around = turned
            .iter()
            .map(|cell| CellRect {
                low: *cell,
                high: *cell,
            })
            .reduce(CellRect::join);
        if let Some(region) =
            around.and_then(|around| around.grown(self.reach_cells).overlap(self.bounds))
        {
            self.measure(region);
        }
    }

    /// Returns the distance from a cell's middle to that of the nearest solid cell, metres; `None`: farther than the
    /// reach, or outside the bounds.
    pub fn distance_m(&self, cell: Cell) -> Option<f64> {
        let square = self.square(cell);
        let near = square != FAR && self.bounds.contains(cell);
        near.then(|| f64::from(square).sqrt() * self.lattice.cell_m())
    }

    /// Returns the lattice of the cells.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Returns the reach, cells: the distance wished, rounded up.
    pub(super) fn reach_cells(&self) -> i32 {
        self.reach_cells
    }

    /// Fills a row of bytes, from a cell on, with what `judge` makes of the squared distances (cells², [`FAR`] beyond
    /// the reach; `None` outside the bounds).
    pub(super) fn read_row(
        &self,
        x: i32,
        y: i32,
        line: &mut [u8],
        judge: impl Fn(Option<u16>) -> u8,
    ) {
        let row = CellRect::new(
            Cell::new(x, y),
            Cell::new(x.saturating_add_unsigned(line.len() as u32 - 1), y),
        );
        let part_of =
            |part: CellRect| part.low.x.abs_diff(x) as usize..=part.high.x.abs_diff(x) as usize;
        line.fill(judge(None));
        if let Some(part) = row.overlap(self.bounds) {
            line[part_of(part)].fill(judge(Some(self.unseen())));
        }
        let Some(part) = self.window.and_then(|window| row.overlap(window)) else {
            return;
        };
        if let Some(place) = self.place(part.low) {
            let kept = &self.squares[place..];
            line[part_of(part)]
                .iter_mut()
                .zip(kept)
                .for_each(|(byte, square)| *byte = judge(Some(*square)));
        }
    }

    /// Returns what counts for cells within bounds that have never been looked at.
    fn unseen(&self) -> u16 {
        if self.unknown_is_solid { 0 } else { FAR }
    }

    /// Returns the squared distance of a cell, cells²: the one kept, or what counts for all others.
    fn square(&self, cell: Cell) -> u16 {
        match self.place(cell) {
            Some(place) => self.squares[place],
            None if self.bounds.contains(cell) => self.unseen(),
            None => FAR,
        }
    }

    fn place(&self, cell: Cell) -> Option<usize> {
        let window = self.window.filter(|window| window.contains(cell))?;
        let (x, y) = (
            cell.x.abs_diff(window.low.x) as usize,
            cell.y.abs_diff(window.low.y) as usize,
        );
        Some(y * window.width_cells() as usize + x)
    }

    /// Widens the window so that it holds a rectangle within the bounds.
    fn widen(&mut self, needed: CellRect) {
        let window = self.window.map_or(needed, |window| window.join(needed));
        if self.window == Some(window) {
            return;
        }
        let (width, height) = (
            window.width_cells() as usize,
            window.height_cells() as usize,
        );
        let mut squares = vec![self.unseen(); width * height];
        if let Some(old) = self.window {
            let old_width = old.width_cells() as usize;
            let left = old.low.x.abs_diff(window.low.x) as usize;
            let below = old.low.y.abs_diff(window.low.y) as usize;
            for (row, line) in self.squares.chunks_exact(old_width).enumerate() {
                squares[(row + below) * width + left..][..old_width].copy_from_slice(line);
            }
        }
        (self.window, self.squares) = (Some(window), squares);
    }

    /// Returns the cells of an area that were solid and are not, or the other way round.
    fn turned(&self, map: &Merged, area: CellRect) -> Vec<Cell> {
        let view = map.view(self.slice, area);
        let (mut turned, mut solid) = (Vec::new(), vec![0; area.width_cells() as usize]);
        for y in area.low.y..=area.high.y {
            self.read_row(area.low.x, y, &mut solid, |square| {
                u8::from(square == Some(0))
            });
            for (x, was_solid) in (area.low.x..=area.high.x).zip(&solid) {
                let cell = Cell::new(x, y);
                let is_solid = match view.occupancy(cell) {
                    Occupancy::Free => false,
                    Occupancy::Unknown => self.unknown_is_solid,
                    Occupancy::Occupied => true,
                };
                if is_solid != (*was_solid != 0) {
                    turned.push(cell);
                }
            }
        }
        turned
    }

    /// Measures the distances of all cells in a region of the window anew: first along the columns, then from
    /// these along the rows (Saito and Toriwaki 1994), as far as the reach.
    fn measure(&mut self, region: CellRect) {
        let Some(wide) = region.grown(self.reach_cells).overlap(self.bounds) else {
            return;
        };
        let columns = CellRect {
            low: Cell::new(wide.low.x, region.low.y),
            high: Cell::new(wide.high.x, region.high.y),
        };
        let width = columns.width_cells() as usize;
        let heights = self.measured_columns(columns, wide);
        let first = region.low.x.abs_diff(columns.low.x) as usize;
        for (line, y) in heights
            .chunks_exact(width)
            .zip(region.low.y..=region.high.y)
        {
            let Some(start) = self.place(Cell::new(region.low.x, y)) else {
                return;
            };
            let squares = &mut self.squares[start..start + region.width_cells() as usize];
            measure_row(line, first, self.reach_cells as usize, squares);
        }
    }

    /// Returns the distance of each cell to the nearest solid one in its column, cells; solid cells are looked for in
    /// `wide`.
    fn measured_columns(&self, columns: CellRect, wide: CellRect) -> Vec<u8> {
        let width = columns.width_cells() as usize;
        let mut heights = vec![NONE; width * columns.height_cells() as usize];
        let (mut since, mut solid) = (vec![NONE; width], vec![0; width]);
        let reach = self.reach_cells as u8;
        let mut pass = |since: &mut Vec<u8>, y: i32| {
            self.read_row(columns.low.x, y, &mut solid, |square| {
                u8::from(square == Some(0))
            });
            for (solid, since) in solid.iter().zip(since.iter_mut()) {
                let farther = if *since < reach { *since + 1 } else { NONE };
                *since = if *solid != 0 { 0 } else { farther };
            }
            if (columns.low.y..=columns.high.y).contains(&y) {
                let row = y.abs_diff(columns.low.y) as usize * width;
                let line = &mut heights[row..row + width];
                line.iter_mut()
                    .zip(since.iter())
                    .for_each(|(height, since)| *height = (*height).min(*since));
            }
        };
        (wide.low.y..=columns.high.y).for_each(|y| pass(&mut since, y));
        since.fill(NONE);
        (columns.low.y..=wide.high.y)
            .rev()
            .for_each(|y| pass(&mut since, y));
        heights
    }
}

/// Writes the squared distances of one row from its cells' distances along their columns; the row's first cell
/// stands at `first` of these.
fn measure_row(heights: &[u8], first: usize, reach: usize, squares: &mut [u16]) {
    if heights.iter().all(|height| *height == NONE) {
        squares.fill(FAR);
        return;
    }
    let square_at = |at: usize, across: usize| match heights.get(at) {
        Some(&height) if height != NONE => {
            usize::from(height) * usize::from(height) + across * across
        }
        Some(_) | None => usize::MAX,
    };
    for (x, square) in squares.iter_mut().enumerate() {
        let at = first + x;
        let mut least = square_at(at, 0);
        for across in 1..=reach {
            if across * across >= least {
                break;
            }
            least = least
                .min(square_at(at + across, across))
                .min(square_at(at.wrapping_sub(across), across));
        }
        *square = if least <= reach * reach {
            least as u16
        } else {
            FAR
        };
    }
}

#[cfg(test)]
mod tests;
