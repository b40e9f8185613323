//! Projection of an image onto the links, W x, and back, Wᵀ a: over the rows of weights as they are, or over copies of them that
//! are faster and rounded ([`super::padded_rows`]).

use super::padded_rows::{self, PaddedRows};
use super::weights::WeightRows;

/// Weights are rounded where a solve ends this far above what that changes.
const LEAST_OVER_ROUNDING: f64 = 1000.0;

/// A matrix of weights: rows = links, columns = pixels or voxels, metres.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Projector<'a> {
    rows: &'a WeightRows,
    /// The rows again, where passing over these is faster.
    padded: Option<PaddedRows>,
}

impl<'a> Projector<'a> {
    /// Makes one of an image of so many pixels, for a solver that ends when its image is known to this share: rounded where
    /// that leaves it as it is.
    pub(super) fn of(rows: &'a WeightRows, pixels: usize, tolerance: f64) -> Projector<'a> {
        let may_round = tolerance >= LEAST_OVER_ROUNDING * padded_rows::ROUNDING;
        let padded = match may_round {
            true => PaddedRows::of(rows, pixels),
            false => None,
        };
        Projector { rows, padded }
    }

    /// Returns the rows as they are.
    pub(super) fn rows(&self) -> &'a WeightRows {
        self.rows
    }

    /// Computes W x: one value per link.
    pub(super) fn forward(&self, image: &[f64], links: &mut [f64]) {
        self.forward_lanes(image.as_chunks().0, |link, [there]| links[link] = there);
    }

    /// Computes Wᵀ a: one value per pixel.
    pub(super) fn backward(&self, links: &[f64], image: &mut [f64]) {
        match &self.padded {
            Some(padded) => padded.backward(links, image),
            None => self.rows.backward(links, image),
        }
    }

    /// Computes W x of several images at once, one lane for each.
    pub(super) fn forward_lanes<const LANES: usize>(
        &self,
        images: &[[f64; LANES]],
        of_link: impl FnMut(usize, [f64; LANES]),
    ) {
        match &self.padded {
            Some(padded) => padded.forward_lanes(images, of_link),
            None => {
                let all = 0..self.rows.len();
                self.rows.forward_lanes(all, images, of_link);
            }
        }
    }

    /// Computes Wᵀ f(W x) in one pass over the weights, of several images at once, one lane for each: `of_link` is told each link
    /// with its values, and says what goes back.
    pub(super) fn there_and_back<const LANES: usize>(
        &self,
        images: &[[f64; LANES]],
        output: &mut [[f64; LANES]],
        of_link: impl FnMut(usize, [f64; LANES]) -> [f64; LANES],
    ) {
        match &self.padded {
            Some(padded) => padded.there_and_back(images, output, of_link),
            None => self.rows.there_and_back(images, output, of_link),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{PixelGrid, Point, Rect, Segment};
    use crate::tomo::WeightModel;

    #[test]
    fn rows_are_rounded_only_for_who_does_not_see_it() {
        let grid = PixelGrid {
            area: Rect::new(Point::new(0.0, 0.0), Point::new(6.0, 5.0)),
            columns: 12,
            rows: 10,
        };
        let link = Segment::new(Point::new(0.0, 2.2), Point::new(6.0, 3.1));
        let rows = WeightRows::rescaled([link], &grid, WeightModel::Line);
        let is_rounded = |tolerance| Projector::of(&rows, grid.len(), tolerance).padded.is_some();
        assert!(is_rounded(1e-3) && is_rounded(6.1e-5));
        assert!(!is_rounded(1e-6) && !is_rounded(1e-11));
    }
}
