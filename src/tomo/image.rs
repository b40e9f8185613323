//! A reconstructed image.

use serde::{Deserialize, Serialize};

use crate::geom::PixelGrid;

/// Values on the pixels of a grid: row-major, rows from south to north, columns from west to east.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Image {
    /// Where the pixels lie.
    pub grid: PixelGrid,
    /// Attenuation, dB/m (positive = attenuation); as many as the grid has pixels.
    pub values: Vec<f64>,
}

impl Image {
    /// Makes an image of zeros.
    #[cfg(test)]
    pub fn zeros(grid: PixelGrid) -> Image {
        Image {
            grid,
            values: vec![0.0; grid.len()],
        }
    }
}
