//! Pictures as pure values: rasters with axes, colour bar and legend, encoded as PNG.
//!
//! Plots are [`HeatMap`] (an image in dB/m) through [`Picture::heat`], [`OccupancyMap`] (free, unknown, occupied cells)
//! through [`Picture::occupancy`], [`LinkMap`] (lines by their value), [`Scatter`] (points over an axis) and [`FloorPlan`]
//! (outlines by material) through [`Picture::floor`]; a view whose
//! pixels are given becomes a picture by [`Picture::photo`]. Plots show metres at one scale along both axes, y up, with
//! [`Overlay`]s and a legend that names what is used, so that the picture explains itself.
//!
//! A vehicle has one colour in all of them, that of [`vehicle_colour`].
//!
//! Deliberately absent: files, fonts from outside, knowledge of maps and solvers, and of vehicles more than their ids.
//! Equal specifications give equal bytes on every machine.

mod axes;
mod bar;
mod colour;
mod floor;
mod heat;
mod label;
mod layout;
mod legend;
mod links;
mod occupancy;
mod overlay;
mod paint;
mod photo;
mod raster;
mod scatter;
mod stroke;
mod text;
mod text_chunk;
mod ticks;
mod tracks;
mod vehicle_colour;

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) mod tests_support;

use thiserror::Error;

use crate::geom::Point;

pub use floor::{FloorPlan, FloorShape};
pub use heat::HeatMap;
pub use links::LinkMap;
pub use occupancy::{CellState, OccupancyMap};
pub use overlay::Overlay;
pub use photo::COLOURS;
pub use raster::Picture;
pub use scatter::Scatter;
pub use text_chunk::described;
pub use vehicle_colour::{VehicleColour, vehicle_colour};

/// Returns the colours of heat maps, for values from the least to the greatest of the range (sRGB, 0 to 255).
pub fn heat_colours() -> Vec<[u8; 3]> {
    colour::ColourMap::new().levels()
}

/// Where a picture, margins and all, lies in the plane that it shows.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Placement {
    /// The upper left corner of its first pixel, metres.
    pub corner: Point,
    /// Side of a pixel, metres; rows of pixels run against y.
    pub metres_per_px: f64,
}

/// Why a picture could not be made.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum DrawError {
    /// The number of values differs from the number of pixels or cells.
    #[error("expected {columns} x {rows} values, got {got}")]
    ValueCount {
        /// Columns of the grid.
        columns: usize,
        /// Rows of the grid.
        rows: usize,
        /// Values given.
        got: usize,
    },
    /// The area has a coordinate or a size that is no finite number.
    #[error(
        "the area to draw must be finite, got x {min_x_m} to {max_x_m} m and y {min_y_m} to {max_y_m} m"
    )]
    AreaNotFinite {
        /// West border, metres.
        min_x_m: f64,
        /// East border, metres.
        max_x_m: f64,
        /// South border, metres.
        min_y_m: f64,
        /// North border, metres.
        max_y_m: f64,
    },
    /// The cells of a map have no size.
    #[error("the side of a cell must be positive, got {cell_m} m")]
    CellSize {
        /// The side given, metres.
        cell_m: f64,
    },
    /// The PNG encoder refused the raster.
    #[error("the picture could not be encoded as png: {reason}")]
    Encoding {
        /// The encoder's own words.
        reason: String,
    },
}
