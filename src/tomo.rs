//! Radio tomography: samples, links, weights, solvers, images, peaks.
//!
//! Links are pooled ([`LinkBins`]), calibrated ([`calibrate()`]), and turned into an [`Image`] ([`reconstruct`], [`Imager`]).
//! Positive values are attenuation, dB/m; rows run from south to north, columns from west to east. Nothing here
//! reads files, knows vehicles or asks for the time.

mod bins;
mod box_grid;
mod calibrate;
mod censored;
mod cholesky;
mod dense;
mod deviation;
mod device_offsets;
mod displaced_ends;
mod empty_sweep;
mod error;
mod finds;
mod fresnel;
mod image;
mod imaged_links;
mod imager;
mod kriging;
mod lanes;
mod link;
mod link_ends;
mod link_noise;
mod links_csv;
mod map_solver;
mod npy;
mod padded_rows;
mod path_loss;
mod peaks;
mod person;
mod prior;
mod progress;
mod projector;
mod ring;
mod room;
mod samples_csv;
mod settings;
mod shares;
mod solvers;
mod streaming;
mod student;
#[cfg(test)]
mod tests_support;
mod tikhonov;
mod tracking;
mod tsvd;
mod volume;
mod weights;

pub use bins::{BIN_M, LinkBins, SPOT_M};
pub use calibrate::{
    Calibrated, DropReason, DroppedLinks, Observation, calibrate, runs_along_a_side,
};
pub use censored::CensoredMean;
pub use device_offsets::{DeviceOffsets, Devices};
pub use error::TomoError;
pub use finds::{Find, FindSettings, Finds};
pub use image::Image;
pub use imaged_links::{Coverage, DIRECTIONS, ImagedLink, coverage};
pub use imager::{Extras, Imager, MOST_PIXELS, Reconstruction, reconstruct};
pub use link::{Link, floor_dbm};
pub use links_csv::{LINKS_HEADER, MISSED_POWER, links_csv};
pub use map_solver::{MapProblem, MapSettings, MapSolution, Nuisance};
pub use npy::{npy_bytes, npy_of};
pub use path_loss::{ExponentPrior, LawBasis, PathLoss};
pub use peaks::{Peak, PeakSettings, SIGNIFICANT, peaks};
pub use person::PersonModel;
pub use prior::{Covariance, Prior, Workspace};
pub use progress::ImagingStep;
pub use ring::{ring_of, side_tolerance_m};
pub use samples_csv::{SAMPLES_HEADER, SampleLine, utc_text};
pub use settings::{ImagingSettings, NoiseModel, Solver};
pub use shares::{LinkShare, PixelShares};
pub use solvers::{Candidate, Candidates, Choice, Score, Sparse, Variation};
pub use streaming::{MOST_IN_PIXELS, StreamedLink, StreamingMap};
pub use tikhonov::tikhonov;
pub use tracking::{TrackedPerson, Tracker, TrackingSettings};
pub use tsvd::tsvd;
pub use volume::{
    MOST_VOLUME_LINKS, MOST_VOXELS, SpaceBins, SpaceCalibration, SpaceLink, Volume, VolumeError,
    VolumeLink, VoxelGrid, calibrate_in_space, reconstruct_volume,
};
pub use weights::{WeightModel, WeightRows};
