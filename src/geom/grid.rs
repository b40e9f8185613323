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

    /// Returns the index of the pixel that a place lies in; `None` outside of the area.
    pub fn pixel_at(&self, at: Point) -> Option<usize> {
        let step = |along: f64, pitch: f64, count: usize| {
            let index = libm::floor(along / pitch);
            // The far border belongs to the last pixel.
            (along >= 0.0 && index <= count as f64).then(|| (index as usize).min(count - 1))
        };
        let Rect { min, max } = self.area;
        let is_inside = at.x_m <= max.x_m && at.y_m <= max.y_m;
        let column = step(at.x_m - min.x_m, self.dx_m(), self.columns)?;
        let row = step(at.y_m - min.y_m, self.dy_m(), self.rows)?;
        is_inside.then(|| self.index(column, row))
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

    #[test]
    fn every_place_of_the_area_lies_in_the_pixel_of_its_middle() {
        let area = Rect::new(Point::new(1.0, 2.0), Point::new(5.0, 4.0));
        let grid = PixelGrid {
            area,
            columns: 7,
            rows: 3,
        };
        for pixel in 0..grid.len() {
            assert_eq!(grid.pixel_at(grid.centre(pixel)), Some(pixel));
        }
        assert_eq!(grid.pixel_at(area.max), Some(grid.len() - 1));
        assert_eq!(grid.pixel_at(area.min), Some(0));
        for outside in [
            (0.9, 3.0),
            (5.1, 3.0),
            (3.0, 1.9),
            (3.0, 4.1),
            (f64::NAN, 3.0),
        ] {
            assert_eq!(grid.pixel_at(Point::new(outside.0, outside.1)), None);
        }
    }
}
