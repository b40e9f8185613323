//! Images in three dimensions: voxels between links whose ends have heights, as of copters.
//!
//! A link weighs by its length in each voxel (Siddon 1985). The solvers are those of pixels ([`super::solvers`]), but for the most
//! probable volume ([`map`]); `auto` chooses by what predicts best the links that it was not told. Links come from samples by
//! [`space_bins`] and [`calibration`]. Deliberately absent: zones around links, persons.

mod calibration;
mod in_space;
mod map;
mod space_bins;

pub use calibration::{SpaceCalibration, calibrate_in_space};
pub use space_bins::{SpaceBins, SpaceLink};

use super::Observation;
use super::box_grid::BoxGrid;
use super::path_loss::PathLoss;
use super::progress::{ImagingStep, Watch};
use super::settings::Solver;
use super::solvers::{self, Choice, LinkProblem};
use super::weights::WeightRows;
use crate::geom::Point;

/// Most links, and most voxels: a minute and a gigabyte.
pub const MOST_VOLUME_LINKS: usize = 6000;
/// See [`MOST_VOLUME_LINKS`].
pub const MOST_VOXELS: usize = 1 << 17;

/// Boxes of one size in a larger one.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VoxelGrid {
    /// The corner that lies west, south and lowest, metres.
    pub low_m: [f64; 3],
    /// The corner that lies east, north and highest, metres.
    pub high_m: [f64; 3],
    /// Voxels from west to east, from south to north, from low to high.
    pub counts: [usize; 3],
}

impl VoxelGrid {
    /// Returns the number of voxels.
    pub fn voxels(&self) -> usize {
        self.counts.iter().product()
    }

    /// Returns the side of a voxel along an axis, metres.
    pub fn side_m(&self, axis: usize) -> f64 {
        (self.high_m[axis] - self.low_m[axis]) / self.counts[axis] as f64
    }

    /// Returns the index of a voxel: layer by layer from below, each row by row from the south.
    pub fn index(&self, [column, row, layer]: [usize; 3]) -> usize {
        (layer * self.counts[1] + row) * self.counts[0] + column
    }

    /// Returns which voxel an index means.
    pub fn place(&self, index: usize) -> [usize; 3] {
        let [columns, rows, _] = self.counts;
        [
            index % columns,
            index / columns % rows,
            index / columns / rows,
        ]
    }

    /// Returns the middle of a voxel, metres.
    pub fn centre(&self, index: usize) -> [f64; 3] {
        let place = self.place(index);
        [0, 1, 2].map(|axis| self.low_m[axis] + (place[axis] as f64 + 0.5) * self.side_m(axis))
    }
}

/// A calibrated link between places with heights.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VolumeLink {
    /// The first end: east, north, up, metres.
    pub from_m: [f64; 3],
    /// The second end.
    pub to_m: [f64; 3],
    /// What it has lost, dB.
    pub attenuation_db: f64,
    /// Standard deviation of that, dB.
    pub sd_db: f64,
    /// Whether the receiver's floor hides how much more it may be.
    pub is_at_floor: bool,
}

impl VolumeLink {
    /// Returns its length, metres.
    fn length_m(&self) -> f64 {
        let step = [0, 1, 2].map(|axis| self.to_m[axis] - self.from_m[axis]);
        step.iter().map(|side| side * side).sum::<f64>().sqrt()
    }

    /// Returns it as solvers take it, which know of no places.
    fn observation(&self) -> Observation {
        let on_ground = |[x_m, y_m, _]: [f64; 3]| Point::new(x_m, y_m);
        Observation {
            from: on_ground(self.from_m),
            to: on_ground(self.to_m),
            attenuation_db: self.attenuation_db,
            variance_db2: self.sd_db * self.sd_db,
            packets: 0,
            misses: 0,
            is_at_floor: self.is_at_floor,
        }
    }
}

/// Values on voxels.
#[derive(Clone, PartialEq, Debug)]
pub struct Volume {
    /// Where they lie.
    pub grid: VoxelGrid,
    /// Attenuation, dB/m, in the order of [`VoxelGrid::index`].
    pub values: Vec<f64>,
    /// Root mean square of what the volume does not explain, dB.
    pub residual_rms_db: f64,
    /// Links that touch it.
    pub used: usize,
    /// How it was chosen, if it was.
    pub choice: Option<Choice>,
}

impl Volume {
    /// Returns the values of a layer, row by row from the south.
    pub fn layer(&self, layer: usize) -> &[f64] {
        let size = self.grid.counts[0] * self.grid.counts[1];
        &self.values[layer * size..(layer + 1) * size]
    }

    /// Returns the voxel of the greatest value.
    pub fn strongest(&self) -> usize {
        let all = 0..self.values.len();
        all.max_by(|a, b| self.values[*a].total_cmp(&self.values[*b]))
            .unwrap_or(0)
    }
}

/// Why there is no volume.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum VolumeError {
    /// The grid has more than [`MOST_VOXELS`].
    #[error("more than {MOST_VOXELS} voxels")]
    TooManyVoxels,
    /// No link touches the volume.
    #[error("no link touches the volume")]
    NoLinks,
    /// More than [`MOST_VOLUME_LINKS`] touch it.
    #[error("{links} links, expected at most {MOST_VOLUME_LINKS}")]
    TooManyLinks {
        /// So many do.
        links: usize,
    },
    /// Persons are drawn on pixels only.
    #[error("persons are sought in images of pixels only")]
    Persons,
    /// The numbers of the links leave no answer.
    #[error("the numbers of the links leave no answer")]
    NoAnswer,
}

/// Reconstructs a volume; links that do not touch it are passed over. What a solver believes is said as for pixels: what is
/// alike in one layer so far is so as far upward. `law` is the path loss that the links are compared with, whose level and exponent
/// are found with the volume; `None` = they are compared with an empty sweep. `watch` is told each step when it begins.
///
/// # Errors
/// [`VolumeError`].
pub fn reconstruct_volume(
    links: &[VolumeLink],
    law: Option<PathLoss>,
    grid: VoxelGrid,
    solver: &Solver,
    watch: &dyn Fn(ImagingStep),
) -> Result<Volume, VolumeError> {
    if grid.voxels() > MOST_VOXELS {
        return Err(VolumeError::TooManyVoxels);
    }
    let (mut rows, mut observations, mut used_m) = (WeightRows::new(), Vec::new(), Vec::new());
    for link in links {
        let lengths_m = voxels_of(link, &grid);
        if !lengths_m.is_empty() {
            rows.push_row(lengths_m);
            observations.push(link.observation());
            used_m.push(link.length_m());
        }
    }
    match observations.len() {
        0 => return Err(VolumeError::NoLinks),
        links if links > MOST_VOLUME_LINKS => return Err(VolumeError::TooManyLinks { links }),
        _ => {}
    }
    let nuisance = law.map_or_else(Vec::new, |law| law.nuisance(used_m.into_iter()));
    let projector = solvers::projector(solver, &rows, grid.voxels());
    let problem = LinkProblem {
        projector: &projector,
        boxes: BoxGrid::of_voxels(&grid),
        observations: &observations,
        nuisance: &nuisance,
        watch: Watch(watch),
    };
    let solved = match *solver {
        Solver::Map(prior, _) => map::solve(&problem, &grid, prior).ok_or(VolumeError::NoAnswer)?,
        Solver::Tikhonov { alpha_m2 } => solvers::tikhonov(&problem, alpha_m2),
        Solver::Tsvd { share } => solvers::tsvd(&problem, share),
        Solver::Variation(of) => solvers::variation(&problem, &in_space::candidates(of)),
        Solver::NonNegative(of) => solvers::non_negative(&problem, in_space::sparse(of)),
        Solver::Auto(of) => solvers::auto(&problem, &in_space::candidates(of), None),
        Solver::Points(_) => return Err(VolumeError::Persons),
    };
    if !solved.image.iter().all(|value| value.is_finite()) {
        return Err(VolumeError::NoAnswer);
    }
    let squares: f64 = solved.residual_db.iter().map(|rest| rest * rest).sum();
    Ok(Volume {
        grid,
        values: solved.image,
        residual_rms_db: (squares / observations.len() as f64).sqrt(),
        used: observations.len(),
        choice: solved.choice,
    })
}

/// Returns the voxels under a link and its length in each, metres: cut at all walls between voxels (Siddon 1985).
fn voxels_of(link: &VolumeLink, grid: &VoxelGrid) -> Vec<(u32, f64)> {
    let step = [0, 1, 2].map(|axis| link.to_m[axis] - link.from_m[axis]);
    let length_m = link.length_m();
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    let mut shares = Vec::new();
    for (axis, step) in step.into_iter().enumerate() {
        let (from, low, high) = (link.from_m[axis], grid.low_m[axis], grid.high_m[axis]);
        if step == 0.0 {
            if from < low || from > high {
                return Vec::new();
            }
            continue;
        }
        let (a, b) = ((low - from) / step, (high - from) / step);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
        let wall = |index: usize| (low + index as f64 * grid.side_m(axis) - from) / step;
        shares.extend((0..=grid.counts[axis]).map(wall));
    }
    if !(length_m.is_finite() && length_m > 0.0 && enter < leave) {
        return Vec::new();
    }
    shares.retain(|share| *share > enter && *share < leave);
    shares.extend([enter, leave]);
    shares.sort_by(f64::total_cmp);
    let piece = |pair: &[f64]| {
        let middle = 0.5 * (pair[0] + pair[1]);
        let place = [0, 1, 2].map(|axis| {
            let inside_m = link.from_m[axis] + middle * step[axis] - grid.low_m[axis];
            ((inside_m / grid.side_m(axis)).max(0.0) as usize).min(grid.counts[axis] - 1)
        });
        (grid.index(place) as u32, (pair[1] - pair[0]) * length_m)
    };
    shares
        .windows(2)
        .map(piece)
        .filter(|(_, length_m)| *length_m > 0.0)
        .collect()
}

#[cfg(test)]
mod tests;
