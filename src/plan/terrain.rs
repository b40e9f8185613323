//! A grid as a search reads it: with a border all round, so that no step leaves it, and one byte a cell that tells
//! which of the eight cells around it are open.

use super::SearchGrid;
use super::steps::{HIGHEST_LEVEL, STEPS};
use crate::geom::Cell;
use crate::map::CellRect;

/// The cells around a start through which one may leave it, although they are too near to something.
#[derive(Clone, Copy, Debug)]
pub(super) struct Escape {
    pub(super) from: Cell,
    pub(super) reach_cells: f64,
}

/// What a search reads of a grid, row-major with one cell of border.
#[derive(Clone, Debug)]
pub(super) struct Terrain {
    area: CellRect,
    stride: usize,
    /// Bit k: the cell that step k leads to may be entered.
    around: Vec<u8>,
    /// How dear it is to enter each cell; `None`: every step costs its length.
    levels: Option<Vec<u8>>,
}

impl Terrain {
    /// Reads a grid; with an escape also the cells that it opens.
    pub(super) fn of_grid(grid: &SearchGrid, escape: Option<Escape>) -> Terrain {
        let (width, height) = grid.size();
        let stride = width + 2;
        let mut open = vec![0_u8; stride * (height + 2)];
        let mut levels = grid.has_levels().then(|| vec![0_u8; open.len()]);
        for y in 0..height {
            let start = (y + 1) * stride + 1;
            grid.write_open(y, &mut open[start..start + width]);
            if let Some(levels) = &mut levels {
                levels[start..start + width].copy_from_slice(grid.level_row(y));
            }
        }
        if let Some(escape) = escape {
            let levels = levels.get_or_insert_with(|| vec![0; open.len()]);
            escape.open(grid, stride, &mut open, levels);
        }
        let mut around = vec![0_u8; open.len()];
        for y in 1..=height {
            open_around(&open, stride, y, &mut around[y * stride + 1..][..width]);
        }
        Terrain {
            area: grid.area(),
            stride,
            around,
            levels,
        }
    }

    /// Returns the number of places, border included.
    pub(super) fn len(&self) -> usize {
        self.around.len()
    }

    /// Returns the place of a cell within the area.
    pub(super) fn place(&self, cell: Cell) -> usize {
        let (x, y) = (
            cell.x.abs_diff(self.area.low.x) as usize,
            cell.y.abs_diff(self.area.low.y) as usize,
        );
        (y + 1) * self.stride + x + 1
    }

    /// Returns the cell at a place.
    #[inline]
    pub(super) fn cell(&self, place: usize) -> Cell {
        let (place, stride) = (place as u32, self.stride as u32);
        Cell::new(
            (i64::from(self.area.low.x) + i64::from(place % stride) - 1) as i32,
            (i64::from(self.area.low.y) + i64::from(place / stride) - 1) as i32,
        )
    }

    /// Returns how far each step leads, in places.
    pub(super) fn offsets(&self) -> [isize; 8] {
        STEPS.map(|(dx, dy)| dy as isize * self.stride as isize + dx as isize)
    }

    /// Returns which cells around a place may be entered.
    #[inline]
    pub(super) fn around(&self, place: usize) -> u8 {
        self.around[place]
    }

    /// Returns how dear it is to enter each place; `None`: every step costs its length.
    pub(super) fn levels(&self) -> Option<&[u8]> {
        self.levels.as_deref()
    }
}

/// Gathers one row's open neighbours; `row` counts from the border.
fn open_around(open: &[u8], stride: usize, row: usize, around: &mut [u8]) {
    let width = around.len();
    let line = |row: usize, from: usize| &open[row * stride + from..][..width];
    let (east, north_east, north, north_west) = (
        line(row, 2),
        line(row + 1, 2),
        line(row + 1, 1),
        line(row + 1, 0),
    );
    let (west, south_west, south, south_east) = (
        line(row, 0),
        line(row - 1, 0),
        line(row - 1, 1),
        line(row - 1, 2),
    );
    for x in 0..width {
        let ahead = east[x] | north_east[x] << 1 | north[x] << 2 | north_west[x] << 3;
        let behind = west[x] | south_west[x] << 1 | south[x] << 2 | south_east[x] << 3;
        around[x] = ahead | behind << 4;
    }
}

impl Escape {
    /// Opens the cells near to something within reach, at the highest price.
    fn open(self, grid: &SearchGrid, stride: usize, open: &mut [u8], levels: &mut [u8]) {
        let (width, height) = grid.size();
        for index in (0..width * height).filter(|index| grid.only_near(*index)) {
            if self.reaches(grid.cell(index)) {
                let place = (index / width + 1) * stride + index % width + 1;
                (open[place], levels[place]) = (1, HIGHEST_LEVEL);
            }
        }
    }

    /// Returns whether a cell is within reach.
    pub(super) fn reaches(self, cell: Cell) -> bool {
        let (dx, dy) = (
            f64::from(cell.x - self.from.x),
            f64::from(cell.y - self.from.y),
        );
        dx * dx + dy * dy <= self.reach_cells * self.reach_cells
    }
}
