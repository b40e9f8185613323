//! Why a pixel is dark: its value as a sum over the links, exact for the solver `map`.
//!
//! ```text
//!   x_p = Σ_i s_i        s_i = α_i (W D C D)_ip
//! ```
//!
//! α = the dual variables of the solution, W = weights, C = prior covariance, D = room for a change. A link far from the
//! pixel has a share as well, since the prior makes neighbours alike.

use serde::{Deserialize, Serialize};

use super::prior::{Covariance, Workspace};
use super::weights::WeightRows;
use crate::geom::Point;

/// What one link adds to a pixel.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct LinkShare {
    /// Mean place of its first end.
    pub from: Point,
    /// Mean place of its second end.
    pub to: Point,
    /// What it adds to the pixel, dB/m.
    pub share: f64,
    /// What it has lost, dB.
    pub attenuation_db: f64,
    /// Standard deviation of that, dB.
    pub sd_db: f64,
    /// What the whole image leaves unexplained of it, dB.
    pub residual_db: f64,
    /// Packets of it that were heard, both directions together.
    pub packets: u32,
    /// Packets of it that were expected and not heard.
    pub misses: u32,
}

/// A pixel and all that made it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct PixelShares {
    /// Which pixel of the image, row-major from the south-west.
    pub pixel: usize,
    /// Its middle.
    pub at: Point,
    /// Its value, dB/m: the sum of all shares.
    pub value: f64,
    /// All links, those that add or take most first.
    pub links: Vec<LinkShare>,
}

/// Returns what each link adds to a pixel, dB/m; `rows` hold W D, `room` D (empty = 1), `dual` α.
pub(super) fn shares(
    pixel: usize,
    rows: &WeightRows,
    covariance: &Covariance,
    room: &[f64],
    dual: &[f64],
) -> Vec<f64> {
    let mut unit = vec![0.0; covariance.pixels()];
    let mut alike = unit.clone();
    unit[pixel] = room.get(pixel).copied().unwrap_or(1.0);
    covariance.apply(&unit, &mut alike, &mut Workspace::default());
    let mut shares = vec![0.0; rows.len()];
    rows.forward(&alike, &mut shares);
    shares
        .iter_mut()
        .zip(dual)
        .for_each(|(share, dual)| *share *= dual);
    shares
}
