//! How much memory an image would take, told before it is taken: too much would end the program without a word.

use super::{ImagingSettings, Observation, Solver, TomoError};
use crate::geom::Segment;
use crate::tomo::tsvd::MOST_VALUES;
use crate::tomo::weights::WeightRows;

/// Most memory of an image, gigabytes: the smallest ground stations have as much.
const MOST_GB: f64 = 2.0;
/// What a weight takes, bytes: those of the sweep and of what stood there are there at once. (What is kept of small images is
/// bounded by itself, and so are rounded copies.)
const BYTES_OF_WEIGHT: f64 = 20.0;
/// What a pixel takes, bytes: some dozens of images that solvers keep.
const BYTES_OF_PIXEL: f64 = 400.0;
/// What a number of a solver takes, bytes.
const BYTES_OF_NUMBER: f64 = 8.0;

/// Refuses an image of some links that would take too much memory.
///
/// # Errors
/// [`TomoError::TooLarge`].
pub(super) fn check_memory(
    links: &[Observation],
    settings: &ImagingSettings,
) -> Result<(), TomoError> {
    let grid = settings.grid;
    let segments = links.iter().map(|link| Segment::new(link.from, link.to));
    let weights = WeightRows::most_values(segments, &grid, settings.weights) as f64;
    let pixels = grid.len() as f64;
    let kept_images = match settings.solver {
        Solver::Tsvd { .. } => MOST_VALUES.min(links.len()) as f64,
        Solver::Map(..)
        | Solver::Tikhonov { .. }
        | Solver::Variation(_)
        | Solver::NonNegative(_)
        | Solver::Points(_)
        | Solver::Auto(_) => 0.0,
    };
    let of_pixel = BYTES_OF_PIXEL + BYTES_OF_NUMBER * kept_images;
    let needed_gb = 1e-9 * (BYTES_OF_WEIGHT * weights + of_pixel * pixels);
    if needed_gb <= MOST_GB {
        return Ok(());
    }
    Err(TomoError::TooLarge {
        links: links.len(),
        columns: grid.columns,
        rows: grid.rows,
        needed_gb,
        most_gb: MOST_GB,
    })
}
