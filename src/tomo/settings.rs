//! What a reconstruction may be told. The defaults follow from the area alone and are the same for data in
//! other units: a recording in lattice cells and the same recording in metres give the same picture.

use serde::{Deserialize, Serialize};

use crate::geom::{PixelGrid, Rect};

use super::bins::BIN_M;
use super::finds::FindSettings;
use super::map_solver::MapSettings;
use super::path_loss::ExponentPrior;
use super::peaks::PeakSettings;
use super::prior::Prior;
use super::solvers::{Candidates, Sparse, Variation};
use super::weights::WeightModel;

/// How the image is found from the links: a variant here, an arm in `imager.rs`, a function in `solvers.rs`.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum Solver {
    /// Maximum a posteriori with an exponential covariance.
    Map(Prior, MapSettings),
    /// Least squares with smoothness, the classical reference.
    Tikhonov {
        /// Weight of the smoothness, m².
        alpha_m2: f64,
    },
    /// Least squares by the large singular values alone, the other one.
    Tsvd {
        /// Those above this share of the largest.
        share: f64,
    },
    /// Non-negative total variation.
    Variation(Candidates),
    /// Non-negative and sparse, under a smooth prior.
    NonNegative(Sparse),
    /// Those who were found, drawn over what the links show without them.
    Points(Sparse),
    /// The one of the three before that predicts best the links that it was not told.
    Auto(Candidates),
}

impl Solver {
    /// The truncated singular values as usual: those above a tenth of the largest.
    pub const TSVD: Solver = Solver::Tsvd { share: 0.1 };

    /// Returns whether its images are never negative. They need the weights of the Fresnel zone, and are not kept out of what
    /// stood there in the empty sweep.
    pub fn is_non_negative(&self) -> bool {
        match self {
            Solver::Map(..) | Solver::Tikhonov { .. } | Solver::Tsvd { .. } => false,
            Solver::Variation(_) | Solver::NonNegative(_) | Solver::Points(_) | Solver::Auto(_) => {
                true
            }
        }
    }
}

impl Solver {
    /// Returns whether those who were found may be drawn into its images.
    pub fn draws_persons(&self) -> bool {
        matches!(self, Solver::Points(_) | Solver::Auto(_))
    }
}

/// How well links are known, dB.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct NoiseModel {
    /// s_t: of one packet.
    pub packet_sd_db: f64,
    /// s_F: of the fade at one place, as Rician K = 8 and the real recordings have it.
    pub fading_sd_db: f64,
    /// What remains of a fade when both sweeps stood at the very same places.
    pub matched_fading_sd_db: f64,
    /// What the straight-line model itself gets wrong.
    pub model_sd_db: f64,
    /// Share of the standing structure's change from bin to bin that stays between two sweeps.
    pub match_share: f64,
    /// Share of the spread within a bin, beyond that of packets and fades, that stays in its mean.
    pub spread_share: f64,
    /// Weakest packet that a receiver hears, dBm.
    pub sensitivity_dbm: f64,
}

impl Default for NoiseModel {
    fn default() -> NoiseModel {
        NoiseModel {
            packet_sd_db: 2.5,
            fading_sd_db: 3.1,
            matched_fading_sd_db: 1.0,
            model_sd_db: 0.5,
            match_share: 2.0,
            spread_share: 1.0,
            sensitivity_dbm: -95.0,
        }
    }
}

/// Everything that a reconstruction is told besides the links.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ImagingSettings {
    /// The pixels.
    pub grid: PixelGrid,
    /// The ring on which the links end; links along one of its sides see nothing and calibrate the path loss.
    pub ring: Rect,
    /// How pixels weigh in links.
    pub weights: WeightModel,
    /// How the image is found.
    pub solver: Solver,
    /// How well links are known.
    pub noise: NoiseModel,
    /// What is believed of the path-loss exponent.
    pub exponent: ExponentPrior,
    /// Links shorter than this are dropped, metres.
    pub shortest_link_m: f64,
    /// Both ends within this distance of one side of the ring: the link runs along that side, metres.
    pub side_tolerance_m: f64,
    /// Places of the two sweeps are paired within this distance at each end, metres.
    pub pairing_m: f64,
    /// How peaks are told apart.
    pub peaks: PeakSettings,
    /// How persons are found in a change.
    pub finds: FindSettings,
}

impl ImagingSettings {
    /// Returns the defaults for an area: 40 pixels along its longer side.
    ///
    /// Lengths are those that work for 20 m (pixel 0.5 m, correlation 1 m, excess path 0.3 m, links over 3 m),
    /// scaled with the area; the rim (1.5 m) and the separation of peaks (3 m) do not grow beyond those values.
    pub fn for_area(area: Rect) -> ImagingSettings {
        const PIXELS: f64 = 40.0;
        let extent_m = area.width_m().max(area.height_m());
        let scale = extent_m / 20.0;
        let count = |length_m: f64| (libm::round(PIXELS * length_m / extent_m) as usize).max(2);
        let grid = PixelGrid {
            area,
            columns: count(area.width_m()),
            rows: count(area.height_m()),
        };
        ImagingSettings {
            grid,
            ring: area,
            weights: WeightModel::InverseArea {
                width_m: 0.3 * scale,
            },
            solver: Solver::Map(ImagingSettings::prior_for(area), MapSettings::default()),
            noise: NoiseModel::default(),
            exponent: ExponentPrior::NEAR_FREE_SPACE,
            shortest_link_m: 3.0 * scale,
            side_tolerance_m: 0.5 * scale,
            pairing_m: BIN_M * scale,
            peaks: PeakSettings {
                rim_m: (0.15 * extent_m).min(1.5),
                separation_m: (0.2 * extent_m).min(3.0),
                limit: 5,
            },
            finds: FindSettings::scaled_to(area),
        }
    }

    /// Returns the defaults for an image of what changed since an empty sweep: persons are smaller than walls, so
    /// neighbouring pixels are less alike (σ² = 0.2 (dB/m)², δ = 0.5 m for 20 m).
    pub fn for_change(area: Rect) -> ImagingSettings {
        let scale = area.width_m().max(area.height_m()) / 20.0;
        let prior = Prior {
            variance: 0.2 / (scale * scale),
            length_m: 0.5 * scale,
        };
        ImagingSettings {
            solver: Solver::Map(prior, MapSettings::default()),
            ..ImagingSettings::for_area(area)
        }
    }

    /// Returns the prior of standing structure for an area: σ² = 0.3 (dB/m)² and δ = 1 m for 20 m.
    pub fn prior_for(area: Rect) -> Prior {
        let scale = area.width_m().max(area.height_m()) / 20.0;
        Prior {
            variance: 0.3 / (scale * scale),
            length_m: scale,
        }
    }

    /// Returns what is believed of image and noise by solvers that do not say it themselves, too.
    pub(super) fn belief(&self) -> (Prior, MapSettings) {
        match self.solver {
            Solver::Map(prior, map) => (prior, map),
            Solver::Tikhonov { .. }
            | Solver::Tsvd { .. }
            | Solver::Variation(_)
            | Solver::NonNegative(_)
            | Solver::Points(_)
            | Solver::Auto(_) => {
                let prior = ImagingSettings::prior_for(self.grid.area);
                (prior, MapSettings::default())
            }
        }
    }

    /// Returns what is believed of a sparse image of an area: σ² = 0.2 (dB/m)², δ = 0.5 m, 2 / (dB m) for 20 m.
    pub fn sparse_for(area: Rect) -> Sparse {
        let scale = area.width_m().max(area.height_m()) / 20.0;
        Sparse {
            prior: Prior {
                variance: 0.2 / (scale * scale),
                length_m: 0.5 * scale,
            },
            sparsity: 2.0 / scale,
        }
    }

    /// Returns what the solver `auto` chooses from: narrow walls, wide ones, and smooth things.
    pub fn candidates_for(area: Rect) -> Candidates {
        let scale = area.width_m().max(area.height_m()) / 20.0;
        let variation = |weight: f64, sparsity: f64| Variation {
            weight,
            sparsity: sparsity / scale,
        };
        Candidates {
            sparse: ImagingSettings::sparse_for(area),
            variations: [
                variation(0.06, 4.0),
                variation(0.1, 8.0),
                variation(2.0, 2.0),
            ],
        }
    }

    /// Returns the weights that suit the solvers of non-negative images: the Fresnel zone of the radios that find persons.
    pub fn fresnel(&self) -> WeightModel {
        WeightModel::Fresnel {
            wavelength_m: self.finds.person.wavelength_m,
        }
    }

    /// Returns the smoothness weight of the Tikhonov solver for an area: 20 m² for 20 m.
    pub fn tikhonov_for(area: Rect) -> Solver {
        let scale = area.width_m().max(area.height_m()) / 20.0;
        Solver::Tikhonov {
            alpha_m2: 20.0 * scale * scale,
        }
    }
}
