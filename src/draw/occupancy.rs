//! The picture of a map: which cells are free, unknown, occupied.
//!
//! Where cells are finer than the picture, an occupied one wins over an unknown one and that over a free one: thin
//! walls do not vanish and nothing unseen looks free.

use std::ops::Range;

use embedded_graphics::geometry::Point as Pixel;
use embedded_graphics::pixelcolor::Rgb888;

use crate::geom::{Point, Rect};

use super::colour::{LIGHT, PAPER};
use super::heat::nothing;
use super::layout::Layout;
use super::legend::{Legend, LegendEntry, LegendSample};
use super::overlay::Overlay;
use super::raster::Picture;
use super::{DrawError, Placement, axes, paint};

const PAD_PX: u32 = 14;

/// What is known of a cell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum CellState {
    /// Seen, and empty.
    Free,
    /// Not seen.
    Unknown,
    /// Something stands there.
    Occupied,
}

impl CellState {
    fn colour(self) -> Rgb888 {
        match self {
            CellState::Free => Rgb888::new(255, 255, 255),
            CellState::Unknown => LIGHT.ground,
            CellState::Occupied => Rgb888::new(34, 34, 40),
        }
    }

    fn legend_text(self) -> &'static str {
        match self {
            CellState::Free => "free",
            CellState::Unknown => "unknown",
            CellState::Occupied => "occupied",
        }
    }
}

/// What an occupancy map shows.
#[derive(Clone, PartialEq, Debug)]
pub struct OccupancyMap<'a> {
    /// Written above the plot.
    pub title: String,
    /// The south-west corner of the first cell, local-frame metres.
    pub origin: Point,
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Cells from west to east.
    pub columns: usize,
    /// Cells from south to north.
    pub rows: usize,
    /// One state a cell, row-major, rows from south to north.
    pub cells: &'a [CellState],
    /// What is laid over the map: fence, area, tracks, vehicles.
    pub overlays: Vec<Overlay>,
}

impl OccupancyMap<'_> {
    fn area(&self) -> Rect {
        let Point { x_m, y_m } = self.origin;
        let end = Point::new(
            x_m + self.columns as f64 * self.cell_m,
            y_m + self.rows as f64 * self.cell_m,
        );
        Rect {
            min: self.origin,
            max: end,
        }
    }

    fn legend(&self) -> Legend {
        let states = [CellState::Free, CellState::Unknown, CellState::Occupied];
        let entry = |state: CellState| LegendEntry {
            sample: LegendSample::Fill(state.colour()),
            text: state.legend_text().to_string(),
        };
        Legend::new(states.map(entry).to_vec(), &self.overlays)
    }

    /// Returns where the picture lies.
    ///
    /// # Errors
    /// [`DrawError::AreaNotFinite`].
    pub fn placement(&self) -> Result<Placement, DrawError> {
        Layout::new(self.area(), &self.overlays, PAD_PX, &self.legend())
            .map(|layout| layout.placement())
    }
}

impl Picture {
    /// Draws an occupancy map and gives it as PNG bytes, north up.
    ///
    /// # Errors
    /// [`DrawError::CellSize`], [`DrawError::ValueCount`], [`DrawError::AreaNotFinite`].
    pub fn occupancy(map: &OccupancyMap) -> Result<Vec<u8>, DrawError> {
        let OccupancyMap { columns, rows, .. } = *map;
        // A cell size that is no number is refused below, with the area it makes.
        if map.cell_m <= 0.0 {
            return Err(DrawError::CellSize { cell_m: map.cell_m });
        }
        if columns.checked_mul(rows) != Some(map.cells.len()) {
            return Err(DrawError::ValueCount {
                columns,
                rows,
                got: map.cells.len(),
            });
        }
        let legend = map.legend();
        let layout = Layout::new(map.area(), &map.overlays, PAD_PX, &legend)?;
        let mut picture = Picture::new(layout.size, PAPER);
        picture.fill(layout.plot, LIGHT.ground);
        cells(&mut picture, &layout, map);
        if map.cells.is_empty() {
            nothing(&mut picture, &layout);
        }
        paint::overlays(&mut picture, &layout, &LIGHT, &map.overlays);
        axes::draw(&mut picture, &layout, &map.title, "m");
        let legend_at = Pixel::new(PAD_PX as i32, layout.legend_top);
        legend.draw(
            &mut picture,
            &LIGHT,
            legend_at,
            layout.size.width - 2 * PAD_PX,
        );
        picture.png()
    }
}

/// Paints the cells onto the plot.
fn cells(picture: &mut Picture, layout: &Layout, map: &OccupancyMap) {
    let across = layout.columns(map.origin.x_m, map.cell_m, map.columns);
    let down = layout.rows(map.origin.y_m, map.cell_m, map.rows);
    for (y, rows) in down.iter().enumerate() {
        for (x, columns) in across.iter().enumerate() {
            if let Some(state) = strongest(map, columns, rows) {
                picture.set(
                    layout.plot.top_left + Pixel::new(x as i32, y as i32),
                    state.colour(),
                );
            }
        }
    }
}

fn strongest(map: &OccupancyMap, columns: &Range<usize>, rows: &Range<usize>) -> Option<CellState> {
    let line =
        |row: usize| &map.cells[row * map.columns + columns.start..row * map.columns + columns.end];
    rows.clone().flat_map(line).copied().max()
}
