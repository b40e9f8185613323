//! The gradient at the corners of voxels, and its dual variables.
//!
//! Eight voxels meet at a corner, and between them are twelve differences, four along each axis: each counts by a quarter in the
//! square of the gradient. So a volume that is mirrored, or turned by a right angle, has the same variation. At the border
//! voxels go on beyond it, and a corner there counts by half for each border that it lies on.

use super::HALF;
use crate::tomo::box_grid::BoxGrid;

/// What a difference counts at each of its four corners, in the square of the gradient.
const QUARTER: f64 = 0.25;
/// Voxels at a corner by their place: east, north and up are 1, 2 and 4.
const EIGHT: usize = 8;
/// Differences at a corner: the four along an axis, one axis after the other.
const TWELVE: usize = 12;

/// The dual variables, a lane for each of several images.
#[derive(Clone, Debug)]
pub(super) struct SpaceCorners<const LANES: usize> {
    boxes: BoxGrid,
    /// Layer by layer from below, row by row from the south.
    duals: Vec<[[f64; LANES]; TWELVE]>,
}

impl<const LANES: usize> SpaceCorners<LANES> {
    pub(super) fn new(boxes: BoxGrid) -> SpaceCorners<LANES> {
        let corners: usize = boxes.counts.iter().map(|count| count + 1).product();
        SpaceCorners {
            boxes,
            duals: vec![[[0.0; LANES]; TWELVE]; corners],
        }
    }

    /// Returns what a difference along each axis draws for a unit of its dual variable, m².
    fn along(&self) -> [f64; 3] {
        let [x_m, y_m, z_m] = self.boxes.sides_m;
        [y_m * z_m, x_m * z_m, x_m * y_m].map(|face_m2| face_m2 * QUARTER.sqrt())
    }

    /// Returns the most that a unit of all dual variables draws at a voxel, m²: at each of its eight corners by a difference along
    /// each axis.
    pub(super) fn most_drawn(&self) -> f64 {
        EIGHT as f64 * self.along().iter().sum::<f64>()
    }

    /// Moves the dual variables, and adds to `back` what they draw at the voxels.
    pub(super) fn step(&mut self, weight: f64, ahead: &[[f64; LANES]], back: &mut [[f64; LANES]]) {
        let along = self.along();
        // A difference is between two voxels.
        let step = 1.0 / (2.0 * along.into_iter().fold(0.0, f64::max));
        let counts = self.boxes.counts;
        let mut corner = 0;
        for layer in 0..=counts[2] {
            for row in 0..=counts[1] {
                for column in 0..=counts[0] {
                    let (voxels, most) = around([column, row, layer], counts, weight);
                    let duals = &mut self.duals[corner];
                    corner += 1;
                    let values = voxels.map(|voxel| ahead[voxel]);
                    for lane in 0..LANES {
                        let mut square = 0.0;
                        for (difference, dual) in duals.iter_mut().enumerate() {
                            let (axis, low, high) = ends(difference);
                            dual[lane] +=
                                along[axis] * step * (values[high][lane] - values[low][lane]);
                            square += dual[lane] * dual[lane];
                        }
                        let size = square.sqrt();
                        if size > most {
                            duals.iter_mut().for_each(|dual| dual[lane] *= most / size);
                        }
                        for (difference, dual) in duals.iter().enumerate() {
                            let (axis, low, high) = ends(difference);
                            let drawn = along[axis] * dual[lane];
                            back[voxels[low]][lane] -= drawn;
                            back[voxels[high]][lane] += drawn;
                        }
                    }
                }
            }
        }
    }
}

/// Returns the eight voxels around a corner, those beyond the border being the last within, and the most that the dual variables
/// may be together.
fn around(corner: [usize; 3], counts: [usize; 3], weight: f64) -> ([usize; EIGHT], f64) {
    let below = corner.map(|at| at.saturating_sub(1));
    let above = [0, 1, 2].map(|axis: usize| corner[axis].min(counts[axis] - 1));
    let voxel = |place: usize| {
        let [column, row, layer] = [0, 1, 2].map(|axis| {
            if place >> axis & 1 == 1 {
                above[axis]
            } else {
                below[axis]
            }
        });
        (layer * counts[1] + row) * counts[0] + column
    };
    let borders = (0..3).filter(|axis| below[*axis] == above[*axis]).count();
    let most = (0..borders).fold(weight, |most, _| most * HALF);
    (std::array::from_fn(voxel), most)
}

/// Returns the axis of a difference, and the places of the voxels that it is between.
fn ends(difference: usize) -> (usize, usize, usize) {
    let (axis, which) = (difference / 4, difference % 4);
    // The place without the bit of the axis, which is put in between.
    let low_bits = which & ((1 << axis) - 1);
    let low = (which >> axis) << (axis + 1) | low_bits;
    (axis, low, low | 1 << axis)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_of_a_cube_is_a_difference_once() {
        let mut all: Vec<(usize, usize, usize)> = (0..TWELVE).map(ends).collect();
        for (axis, low, high) in &all {
            assert_eq!(low ^ high, 1 << axis);
            assert!(low < high && *high < EIGHT);
        }
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), TWELVE);
    }

    #[test]
    fn a_corner_within_has_eight_voxels_and_one_of_the_border_fewer_that_count_less() {
        let counts = [2, 2, 2];
        let (voxels, most) = around([1, 1, 1], counts, 3.0);
        assert_eq!((voxels, most), ([0, 1, 2, 3, 4, 5, 6, 7], 3.0));
        let (voxels, most) = around([0, 1, 2], counts, 8.0);
        assert_eq!((voxels, most), ([4, 4, 6, 6, 4, 4, 6, 6], 2.0));
    }
}
