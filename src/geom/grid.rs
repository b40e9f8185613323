//! The pixels of an image: a rectangle cut into equal columns and rows.

use serde::{Deserialize, Serialize};

use super::{Point, Rect};

/// A rectangle of pixels; pixel 0 is the south-west one, x runs fastest (row-major, rows south to north).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct PixelGrid {
    /// What is imaged, metres (or the units of the input).
    pub area: Rect,
    /// Pixels from west to east.
    pub columns: usize,
    /// Pixels from south to north.
    pub rows: usize,
}

impl PixelGrid {
    /// Returns the number of pixels.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Returns a pixel's width, metres.
    #[inline]
    pub fn dx_m(&self) -> f64 {
        self.area.width_m() / self.columns as f64
    }

    /// Returns a pixel's height, metres.
    #[inline]
    pub fn dy_m(&self) -> f64 {
        self.area.height_m() / self.rows as f64
    }

    /// Returns the index of the pixel in a column and a row.
    #[inline]
    pub fn index(&self, column: usize, row: usize) -> usize {
        row * self.columns + column
    }

    /// Returns the middle of the pixel with an index.
    #[inline]
    pub fn centre(&self, index: usize) -> Point {
        let (column, row) = (index % self.columns, index / self.columns);
        Point::new(
            self.area.min.x_m + (column as f64 + 0.5) * self.dx_m(),
            self.area.min.y_m + (row as f64 + 0.5) * self.dy_m(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_run_from_the_south_west_along_the_row() {
        let area = Rect::new(Point::new(1.0, 2.0), Point::new(5.0, 4.0));
        let grid = PixelGrid {
            area,
            columns: 4,
            rows: 2,
        };
        assert_eq!(grid.centre(0), Point::new(1.5, 2.5));
        assert_eq!(grid.centre(grid.index(3, 1)), Point::new(4.5, 3.5));
        assert_eq!(grid.len(), 8);
    }
}
