//! Boxes of one size side by side, as the solvers of images see them: pixels, or voxels.

use super::volume::VoxelGrid;
use crate::geom::PixelGrid;

/// How many boxes there are along each axis, and how large one is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct BoxGrid {
    /// From west to east, from south to north, from low to high; of pixels one layer.
    pub counts: [usize; 3],
    /// Metres; of pixels 1 upward, so that volumes are areas and faces are edges.
    pub sides_m: [f64; 3],
    /// Whether it is one of pixels: a single layer of voxels is none, it has a height.
    pub is_flat: bool,
}

impl BoxGrid {
    /// Returns pixels as boxes.
    pub(super) fn of_pixels(grid: &PixelGrid) -> BoxGrid {
        BoxGrid {
            counts: [grid.columns, grid.rows, 1],
            sides_m: [grid.dx_m(), grid.dy_m(), 1.0],
            is_flat: true,
        }
    }

    /// Returns voxels as boxes.
    pub(super) fn of_voxels(grid: &VoxelGrid) -> BoxGrid {
        BoxGrid {
            counts: grid.counts,
            sides_m: [0, 1, 2].map(|axis| grid.side_m(axis)),
            is_flat: false,
        }
    }

    /// Returns the number of boxes.
    pub(super) fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// Returns what a box costs when a cubic metre costs so much; of pixels a square metre.
    pub(super) fn of_box(&self, cost: f64) -> f64 {
        let [x_m, y_m, z_m] = self.sides_m;
        cost * x_m * y_m * z_m
    }

    /// Returns what the square of a difference between neighbours along each axis costs in cost · ∫ |∇x|² dV: by the face
    /// between them over their distance; nothing upward where there is one layer.
    pub(super) fn of_faces(&self, cost: f64) -> [f64; 3] {
        let [x_m, y_m, z_m] = self.sides_m;
        [
            cost * y_m / x_m * z_m,
            cost * x_m / y_m * z_m,
            if self.counts[2] > 1 {
                cost * x_m / z_m * y_m
            } else {
                0.0
            },
        ]
    }

    /// Calls with each box, in their order, and its neighbours to the east, to the north and above.
    pub(super) fn each_box(&self, mut call: impl FnMut(usize, [Option<usize>; 3])) {
        let [columns, rows, layers] = self.counts;
        for layer in 0..layers {
            for row in 0..rows {
                for column in 0..columns {
                    let here = (layer * rows + row) * columns + column;
                    let next = [
                        (column + 1 < columns).then_some(here + 1),
                        (row + 1 < rows).then_some(here + columns),
                        (layer + 1 < layers).then_some(here + columns * rows),
                    ];
                    call(here, next);
                }
            }
        }
    }
}
