//! The most probable non-negative image under a smooth prior, that prefers to be empty:
//!
//! ```text
//!   least of ½ |S W x − d|² + ½ ∫ (a x² + b |∇x|²) dA + sparsity · ∫ x dA,   x ≥ 0
//!   a = 1 / (2π σ² δ²),  b = 3/2 δ² a
//! ```
//!
//! The quadratic form is the inverse of the exponential covariance σ² exp(−r/δ) up to the second power of the wave number:
//! (1 + δ²k²)^(3/2) ≈ 1 + 3/2 δ²k². In space it is (1 + δ²k²)² ≈ 1 + 2 δ²k², a = 1 / (8π σ² δ³) and b = 2 δ² a. By FISTA (Beck and Teboulle 2009) with restart, each pixel with a step of its own: for
//! weights that are not negative, the row sums of the curvature bound it from above.

use serde::{Deserialize, Serialize};

use super::robust::Linearised;
use crate::tomo::box_grid::BoxGrid;
use crate::tomo::prior::Prior;
use crate::tomo::projector::Projector;

/// What is believed of a non-negative image.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Sparse {
    /// σ² and δ.
    pub prior: Prior,
    /// Cost of the sum of attenuation, 1/(dB m); in space 1/(dB m²).
    pub sparsity: f64,
}

/// Memory that one step after another uses again, of several images, a lane for each.
#[derive(Clone, Debug)]
pub(super) struct Descent<'a, const LANES: usize> {
    projector: &'a Projector<'a>,
    boxes: BoxGrid,
    sparse: Sparse,
    slope: Vec<[f64; LANES]>,
}

impl<'a, const LANES: usize> Descent<'a, LANES> {
    pub(super) fn new(
        projector: &'a Projector<'a>,
        boxes: BoxGrid,
        sparse: Sparse,
    ) -> Descent<'a, LANES> {
        Descent {
            projector,
            boxes,
            sparse,
            slope: vec![[0.0; LANES]; boxes.len()],
        }
    }

    /// Takes some steps towards the solutions of linear problems.
    pub(super) fn improve(
        &mut self,
        problem: &Linearised<LANES>,
        images: &mut [[f64; LANES]],
        steps: usize,
    ) {
        let step_sizes = self.step_sizes(problem);
        let mut ahead = images.to_vec();
        let mut momentum = [1.0; LANES];
        for _ in 0..steps {
            self.find_slope(problem, &ahead);
            let mut turned = [0.0; LANES];
            let next_momentum = momentum.map(|of| 0.5 * (1.0 + f64::sqrt(1.0 + 4.0 * of * of)));
            let mut push = [0.0; LANES];
            for lane in 0..LANES {
                push[lane] = (momentum[lane] - 1.0) / next_momentum[lane];
            }
            for pixel in 0..images.len() {
                let (image, ahead) = (&mut images[pixel], &mut ahead[pixel]);
                let (size, slope) = (&step_sizes[pixel], &self.slope[pixel]);
                for lane in 0..LANES {
                    let next = (ahead[lane] - size[lane] * slope[lane]).max(0.0);
                    let move_ = next - image[lane];
                    turned[lane] += (ahead[lane] - next) * move_;
                    ahead[lane] = next + push[lane] * move_;
                    image[lane] = next;
                }
            }
            momentum = next_momentum;
            for lane in (0..LANES).filter(|lane| turned[*lane] > 0.0) {
                // The momentum has carried it past the lowest point.
                momentum[lane] = 1.0;
                let places = ahead.iter_mut().zip(images.iter());
                places.for_each(|(ahead, image)| ahead[lane] = image[lane]);
            }
        }
    }

    /// Returns one over the row sums of the curvature.
    fn step_sizes(&self, problem: &Linearised<LANES>) -> Vec<[f64; LANES]> {
        let ones = vec![[1.0; LANES]; self.boxes.len()];
        let mut sums = vec![[0.0; LANES]; self.boxes.len()];
        self.projector
            .there_and_back(&ones, &mut sums, |l, mut sum| {
                let lanes = sum.iter_mut().zip(&problem.scale[l]);
                lanes.for_each(|(sum, scale)| *sum *= scale * scale);
                sum
            });
        let (own, [east, north, up]) = self.precisions();
        let of_prior = own + 4.0 * (east + north + up);
        let steps = sums.into_iter();
        steps
            .map(|lanes| lanes.map(|sum| 1.0 / (sum + of_prior)))
            .collect()
    }

    /// Returns the prior's cost of a pixel's square, and of the squares of the differences along each axis.
    fn precisions(&self) -> (f64, [f64; 3]) {
        let Prior { variance, length_m } = self.sparse.prior;
        let (own, smooth) = match self.boxes.is_flat {
            true => {
                let own = 1.0 / (2.0 * std::f64::consts::PI * variance * length_m * length_m);
                (own, 1.5 * length_m * length_m * own)
            }
            false => {
                let cube_m3 = length_m * length_m * length_m;
                let own = 1.0 / (8.0 * std::f64::consts::PI * variance * cube_m3);
                (own, 2.0 * length_m * length_m * own)
            }
        };
        (self.boxes.of_box(own), self.boxes.of_faces(smooth))
    }

    fn find_slope(&mut self, problem: &Linearised<LANES>, images: &[[f64; LANES]]) {
        self.projector
            .there_and_back(images, &mut self.slope, |l, mut straight_db| {
                let (scale, data) = (&problem.scale[l], &problem.data[l]);
                for lane in 0..LANES {
                    straight_db[lane] =
                        scale[lane] * (scale[lane] * straight_db[lane] - data[lane]);
                }
                straight_db
            });
        let (own, along) = self.precisions();
        let constant = self.boxes.of_box(self.sparse.sparsity);
        let slope = &mut self.slope;
        self.boxes.each_box(|here, next| {
            let lanes = slope[here].iter_mut().zip(&images[here]);
            lanes.for_each(|(slope, value)| *slope += constant + own * value);
            for (next, precision) in next.into_iter().zip(along) {
                if let Some(next) = next {
                    flow(slope, images, [here, next], precision);
                }
            }
        });
    }
}

/// Adds the slope of the square of the difference between two pixels.
#[inline]
fn flow<const LANES: usize>(
    slope: &mut [[f64; LANES]],
    images: &[[f64; LANES]],
    [from, to]: [usize; 2],
    precision: f64,
) {
    let lanes = images[from].iter().zip(&images[to]).enumerate();
    for (lane, (from_value, to_value)) in lanes {
        let flow = precision * (from_value - to_value);
        slope[from][lane] += flow;
        slope[to][lane] -= flow;
    }
}
