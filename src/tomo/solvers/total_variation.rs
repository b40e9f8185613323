//! A non-negative image that is flat but for edges, and empty where nothing speaks against it:
//!
//! ```text
//!   least of ½ |S W x − d|² + weight · ∫ |∇x| dA + sparsity · ∫ x dA,   x ≥ 0
//! ```
//!
//! The gradient stands at the corners of the pixels: of the four differences between the pixels around one, those along an
//! axis count by half each. So a mirrored or turned sweep has the mirrored or turned image. At the border pixels go on beyond
//! it, and a corner there counts by half. In space it is the same with the twelve differences around a corner of voxels
//! ([`space_corners`]).
//!
//! By the primal-dual method of Chambolle and Pock with the diagonal preconditioning of Pock and Chambolle (2011, lemma 2 with
//! α = 1); no matrix is formed, and both variables stay for a warm start. The integrals make the weights independent of the
//! pixels.

use serde::{Deserialize, Serialize};

use super::robust::Linearised;
use crate::tomo::box_grid::BoxGrid;
use crate::tomo::projector::Projector;

use self::space_corners::SpaceCorners;

mod space_corners;

/// What a difference counts at each of its two corners, and a corner at the border.
const HALF: f64 = 0.5;

/// How much edges and attenuation itself cost.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Variation {
    /// Of the total variation, 1/dB; in space 1/(dB m).
    pub weight: f64,
    /// Of the sum of attenuation, 1/(dB m); in space 1/(dB m²).
    pub sparsity: f64,
}

/// The dual variables of several images, a lane for each, and memory that one step after another uses again.
#[derive(Clone, Debug)]
pub(super) struct PrimalDual<'a, const LANES: usize> {
    projector: &'a Projector<'a>,
    boxes: BoxGrid,
    variation: Variation,
    /// Sum of each row of the weights.
    row_sums: Vec<f64>,
    links: Vec<[f64; LANES]>,
    corners: Corners<LANES>,
    ahead: Vec<[f64; LANES]>,
    back: Vec<[f64; LANES]>,
}

/// The dual variables of the differences around corners.
#[derive(Clone, Debug)]
enum Corners<const LANES: usize> {
    /// Of the corners of all pixels, row by row from the south: of the differences to the east, in the south and in the north
    /// of the corner, and of those to the north, in its west and in its east.
    Flat(Vec<[[f64; LANES]; 4]>),
    /// Of the corners of voxels.
    Space(SpaceCorners<LANES>),
}

impl<'a, const LANES: usize> PrimalDual<'a, LANES> {
    pub(super) fn new(
        projector: &'a Projector<'a>,
        boxes: BoxGrid,
        variation: Variation,
    ) -> PrimalDual<'a, LANES> {
        let (links, pixels) = (projector.rows().len(), boxes.len());
        let [columns, of_column, _] = boxes.counts;
        let mut row_sums = vec![0.0; links];
        projector.forward(&vec![1.0; pixels], &mut row_sums);
        PrimalDual {
            projector,
            boxes,
            variation,
            row_sums,
            links: vec![[0.0; LANES]; links],
            corners: match boxes.is_flat {
                true => Corners::Flat(vec![[[0.0; LANES]; 4]; (columns + 1) * (of_column + 1)]),
                false => Corners::Space(SpaceCorners::new(boxes)),
            },
            ahead: vec![[0.0; LANES]; pixels],
            back: vec![[0.0; LANES]; pixels],
        }
    }

    /// Changes the weights; the variables stay.
    pub(super) fn set_variation(&mut self, variation: Variation) {
        self.variation = variation;
    }

    /// Takes some steps towards the solutions of linear problems.
    pub(super) fn improve(
        &mut self,
        problem: &Linearised<LANES>,
        images: &mut [[f64; LANES]],
        steps: usize,
    ) {
        let [dx_m, dy_m, _] = self.boxes.sides_m;
        self.projector
            .there_and_back(images, &mut self.back, |l, _| problem.scale[l]);
        let of_corners = match &self.corners {
            // A pixel has four corners, and at each of them a difference along either axis.
            Corners::Flat(_) => 4.0 * HALF.sqrt() * (dx_m + dy_m),
            Corners::Space(corners) => corners.most_drawn(),
        };
        let columns = self.back.iter();
        let image_steps: Vec<[f64; LANES]> = columns
            .map(|lanes| lanes.map(|column| 1.0 / (column + of_corners)))
            .collect();
        let corner_step = 1.0 / (2.0 * HALF.sqrt() * dx_m.max(dy_m));
        self.ahead.copy_from_slice(images);
        for _ in 0..steps {
            self.step_links(problem);
            match &mut self.corners {
                Corners::Flat(_) => self.step_corners(corner_step),
                Corners::Space(corners) => {
                    corners.step(self.variation.weight, &self.ahead, &mut self.back);
                }
            }
            self.step_images(&image_steps, images);
        }
    }

    /// Moves the dual variables of the links, and leaves Wᵀ of them in `back`.
    fn step_links(&mut self, problem: &Linearised<LANES>) {
        let (duals, row_sums) = (&mut self.links, &self.row_sums);
        self.projector
            .there_and_back(&self.ahead, &mut self.back, |l, straight_db| {
                let (scale, data) = (&problem.scale[l], &problem.data[l]);
                let dual = &mut duals[l];
                let mut back = [0.0; LANES];
                for lane in 0..LANES {
                    if scale[lane] <= 0.0 {
                        dual[lane] = 0.0;
                        continue;
                    }
                    let step = 1.0 / (scale[lane] * row_sums[l]).max(1e-9);
                    let off = scale[lane] * straight_db[lane] - data[lane];
                    dual[lane] = (dual[lane] + step * off) / (1.0 + step);
                    back[lane] = scale[lane] * dual[lane];
                }
                back
            });
    }

    /// Moves the dual variables of the corners, and adds to `back` what they draw at the pixels.
    fn step_corners(&mut self, step: f64) {
        let Corners::Flat(corners) = &mut self.corners else {
            return;
        };
        let [columns, rows, _] = self.boxes.counts;
        let [dx_m, dy_m, _] = self.boxes.sides_m;
        let root = HALF.sqrt();
        let (along_x, along_y) = (dy_m * root, dx_m * root);
        let (step_x, step_y) = (along_x * step, along_y * step);
        let whole = self.variation.weight;
        for row in 0..=rows {
            let (south, north) = (row.saturating_sub(1) * columns, row.min(rows - 1) * columns);
            let of_row = if south == north { HALF } else { 1.0 };
            for column in 0..=columns {
                let (west, east) = (column.saturating_sub(1), column.min(columns - 1));
                let most = whole * of_row * if west == east { HALF } else { 1.0 };
                let pixels = [south + west, south + east, north + west, north + east];
                let [sw, se, nw, ne] = pixels.map(|pixel| self.ahead[pixel]);
                let [in_south, in_north, in_west, in_east] =
                    &mut corners[row * (columns + 1) + column];
                let mut drawn = [[0.0; LANES]; 4];
                for lane in 0..LANES {
                    let x = in_south[lane] + step_x * (se[lane] - sw[lane]);
                    let x_north = in_north[lane] + step_x * (ne[lane] - nw[lane]);
                    let y = in_west[lane] + step_y * (nw[lane] - sw[lane]);
                    let y_east = in_east[lane] + step_y * (ne[lane] - se[lane]);
                    let size = ((x * x + x_north * x_north) + (y * y + y_east * y_east)).sqrt();
                    let share = if size > most { most / size } else { 1.0 };
                    let (x, x_north) = (x * share, x_north * share);
                    let (y, y_east) = (y * share, y_east * share);
                    (in_south[lane], in_north[lane]) = (x, x_north);
                    (in_west[lane], in_east[lane]) = (y, y_east);
                    drawn[0][lane] = -along_x * x - along_y * y;
                    drawn[1][lane] = along_x * x - along_y * y_east;
                    drawn[2][lane] = along_y * y - along_x * x_north;
                    drawn[3][lane] = along_x * x_north + along_y * y_east;
                }
                for (pixel, drawn) in pixels.into_iter().zip(drawn) {
                    let back = &mut self.back[pixel];
                    (0..LANES).for_each(|lane| back[lane] += drawn[lane]);
                }
            }
        }
    }

    fn step_images(&mut self, steps: &[[f64; LANES]], images: &mut [[f64; LANES]]) {
        let constant = self.boxes.of_box(self.variation.sparsity);
        let pixels = images.iter_mut().zip(&mut self.ahead);
        for (((image, ahead), back), steps) in pixels.zip(&self.back).zip(steps) {
            for lane in 0..LANES {
                let slope = back[lane] + constant;
                let next = (image[lane] - steps[lane] * slope).max(0.0);
                ahead[lane] = 2.0 * next - image[lane];
                image[lane] = next;
            }
        }
    }
}
