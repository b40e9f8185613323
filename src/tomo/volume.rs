//! Images in three dimensions: voxels between links whose ends have heights, as of copters.
//!
//! The most probable volume under a smooth prior with robust noise, as the solver `map` does it for pixels, by the links:
//!
//! ```text
//!   K = W C Wᵀ + S        x = C Wᵀ K⁻¹ y        C = σ² exp(−√((Δx² + Δy²) / δ² + Δz² / δz²))
//! ```
//!
//! W = length of each link in each voxel (Siddon 1985), S = noise of the links, made larger for those that contradict the
//! volume (Student-t). Time grows with the cube of the links. Deliberately absent: path loss, other solvers, persons.

use super::cholesky::Cholesky;
use super::student::{DEGREES, trust};

/// Rounds of robust weights.
const ROUNDS: usize = 6;
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
}

/// What is believed of a volume before it is measured.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VolumePrior {
    /// σ², (dB/m)².
    pub variance: f64,
    /// δ: how far voxels of one layer are alike, metres.
    pub length_m: f64,
    /// δz: how far those above each other are, metres.
    pub height_m: f64,
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
    /// The numbers of the links leave no answer.
    #[error("the numbers of the links leave no answer")]
    NoAnswer,
}

/// Reconstructs a volume; links that do not touch it are passed over.
///
/// # Errors
/// [`VolumeError`].
pub fn reconstruct_volume(
    links: &[VolumeLink],
    grid: VoxelGrid,
    prior: VolumePrior,
) -> Result<Volume, VolumeError> {
    if grid.voxels() > MOST_VOXELS {
        return Err(VolumeError::TooManyVoxels);
    }
    let rows: Vec<(VolumeLink, Vec<(usize, f64)>)> = links
        .iter()
        .map(|link| (*link, voxels_of(link, &grid)))
        .filter(|(_, row)| !row.is_empty())
        .collect();
    match rows.len() {
        0 => return Err(VolumeError::NoLinks),
        links if links > MOST_VOLUME_LINKS => return Err(VolumeError::TooManyLinks { links }),
        _ => {}
    }
    let covariance = Covariance::new(&grid, prior);
    let gram = gram(&rows, &covariance);
    let mut trusts = vec![1.0; rows.len()];
    let mut dual = vec![0.0; rows.len()];
    let mut residuals_db = vec![0.0; rows.len()];
    for _ in 0..ROUNDS {
        let noise = |i: usize| rows[i].0.sd_db * rows[i].0.sd_db / trusts[i];
        let entry = |i: usize, j: usize| gram[i][j] + if i == j { noise(i) } else { 0.0 };
        let factor = Cholesky::of(rows.len(), entry).ok_or(VolumeError::NoAnswer)?;
        dual = rows.iter().map(|(link, _)| link.attenuation_db).collect();
        factor.solve(&mut dual);
        // What is left of y is S α.
        residuals_db = (0..rows.len()).map(|i| noise(i) * dual[i]).collect();
        for (trusted, (residual_db, (link, _))) in
            trusts.iter_mut().zip(residuals_db.iter().zip(&rows))
        {
            let share = residual_db / link.sd_db;
            *trusted = trust(share * share, DEGREES);
        }
    }
    let mut weighted = vec![0.0; grid.voxels()];
    for ((_, row), dual) in rows.iter().zip(&dual) {
        row.iter()
            .for_each(|(voxel, length_m)| weighted[*voxel] += dual * length_m);
    }
    let squares: f64 = residuals_db
        .iter()
        .map(|residual| residual * residual)
        .sum();
    Ok(Volume {
        grid,
        values: covariance.times(&weighted),
        residual_rms_db: (squares / rows.len() as f64).sqrt(),
        used: rows.len(),
    })
}

/// Returns W C Wᵀ, row by row up to the diagonal.
fn gram(rows: &[(VolumeLink, Vec<(usize, f64)>)], covariance: &Covariance) -> Vec<Vec<f64>> {
    let mut gram = Vec::with_capacity(rows.len());
    let mut spread = vec![0.0; covariance.grid.voxels()];
    for (i, (_, row)) in rows.iter().enumerate() {
        spread.fill(0.0);
        covariance.add(row, &mut spread);
        let product = |other: &[(usize, f64)]| -> f64 {
            other
                .iter()
                .map(|(voxel, length_m)| spread[*voxel] * length_m)
                .sum()
        };
        gram.push(rows[..=i].iter().map(|(_, other)| product(other)).collect());
    }
    gram
}

/// C, by how many voxels two lie apart along each axis.
struct Covariance {
    grid: VoxelGrid,
    table: Vec<f64>,
}

impl Covariance {
    fn new(grid: &VoxelGrid, prior: VolumePrior) -> Covariance {
        let value = |index: usize| {
            let apart = grid.place(index);
            let [x_m, y_m, z_m] = [0, 1, 2].map(|axis| apart[axis] as f64 * grid.side_m(axis));
            let flat = (x_m * x_m + y_m * y_m) / (prior.length_m * prior.length_m);
            let upright = z_m * z_m / (prior.height_m * prior.height_m);
            prior.variance * libm::exp(-(flat + upright).sqrt())
        };
        Covariance {
            grid: *grid,
            table: (0..grid.voxels()).map(value).collect(),
        }
    }

    /// Adds C w.
    fn add(&self, sparse: &[(usize, f64)], output: &mut [f64]) {
        let [columns, rows, layers] = self.grid.counts;
        for (voxel, weight) in sparse {
            let [column, row, layer] = self.grid.place(*voxel);
            for other_layer in 0..layers {
                for other_row in 0..rows {
                    let apart = [0, row.abs_diff(other_row), layer.abs_diff(other_layer)];
                    let near = &self.table[self.grid.index(apart)..][..columns];
                    let first = self.grid.index([0, other_row, other_layer]);
                    let line = &mut output[first..first + columns];
                    for (other, value) in line.iter_mut().enumerate() {
                        *value += weight * near[column.abs_diff(other)];
                    }
                }
            }
        }
    }

    /// Returns C v.
    fn times(&self, values: &[f64]) -> Vec<f64> {
        let mut output = vec![0.0; values.len()];
        let sparse: Vec<(usize, f64)> = values
            .iter()
            .copied()
            .enumerate()
            .filter(|(_, value)| *value != 0.0)
            .collect();
        self.add(&sparse, &mut output);
        output
    }
}

/// Returns the voxels under a link and its length in each, metres: cut at all walls between voxels (Siddon 1985).
fn voxels_of(link: &VolumeLink, grid: &VoxelGrid) -> Vec<(usize, f64)> {
    let step = [0, 1, 2].map(|axis| link.to_m[axis] - link.from_m[axis]);
    let length_m = step.iter().map(|side| side * side).sum::<f64>().sqrt();
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
        (grid.index(place), (pair[1] - pair[0]) * length_m)
    };
    shares
        .windows(2)
        .map(piece)
        .filter(|(_, length_m)| *length_m > 0.0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: VoxelGrid = VoxelGrid {
        low_m: [0.0; 3],
        high_m: [10.0, 10.0, 6.0],
        counts: [20, 20, 6],
    };
    const PRIOR: VolumePrior = VolumePrior {
        variance: 0.3,
        length_m: 1.0,
        height_m: 1.0,
    };

    /// A phantom: one box low in the west, one high in the east; 6 dB/m.
    fn truth(at: [f64; 3]) -> f64 {
        let is_in = |low: [f64; 3], high: [f64; 3]| {
            (0..3).all(|axis| at[axis] >= low[axis] && at[axis] < high[axis])
        };
        let low = is_in([2.0, 4.0, 0.0], [3.5, 6.0, 2.0]);
        let high = is_in([6.5, 5.0, 4.0], [8.0, 6.5, 6.0]);
        if low || high { 6.0 } else { 0.0 }
    }

    /// Links between copters at three heights around the box.
    fn links(truth: impl Fn([f64; 3]) -> f64) -> Vec<VolumeLink> {
        let mut ends = Vec::new();
        for z_m in [0.5, 2.5, 5.5] {
            for step in 0..8 {
                let along_m = 0.6 + 1.25 * f64::from(step);
                ends.push([along_m, -0.5, z_m]);
                ends.push([along_m, 10.5, z_m]);
                ends.push([-0.5, along_m, z_m]);
                ends.push([10.5, along_m, z_m]);
            }
        }
        let mut links = Vec::new();
        for (i, from) in ends.iter().enumerate() {
            for to in &ends[..i] {
                if from[0] == to[0] && (from[0] < 0.0 || from[0] > 10.0) {
                    continue;
                }
                // Every other link is enough.
                if (links.len() + i) % 5 != 0 && (from[2] == to[2]) == (i % 2 == 0) {
                    continue;
                }
                let mut link = VolumeLink {
                    from_m: *from,
                    to_m: *to,
                    attenuation_db: 0.0,
                    sd_db: 0.7,
                };
                let row = voxels_of(&link, &GRID);
                link.attenuation_db = row
                    .iter()
                    .map(|(voxel, length_m)| length_m * truth(GRID.centre(*voxel)))
                    .sum();
                links.push(link);
            }
        }
        links
    }

    #[test]
    fn the_pieces_of_a_link_sum_up_to_its_length_within() {
        let link = |from_m, to_m| VolumeLink {
            from_m,
            to_m,
            attenuation_db: 0.0,
            sd_db: 1.0,
        };
        for (from_m, to_m, expected_m) in [
            ([-1.0, 5.2, 3.3], [11.0, 5.2, 3.3], 10.0),
            ([0.3, 0.4, -1.0], [0.3, 0.4, 9.0], 6.0),
            ([0.0, 0.0, 0.0], [10.0, 10.0, 6.0], 236f64.sqrt()),
            ([-1.0, -1.0, 3.0], [-1.0, 9.0, 3.0], 0.0),
            ([2.0, 2.0, 2.0], [2.0, 2.0, 2.0], 0.0),
        ] {
            let row = voxels_of(&link(from_m, to_m), &GRID);
            let sum_m: f64 = row.iter().map(|(_, length_m)| length_m).sum();
            assert!((sum_m - expected_m).abs() < 1e-9, "{from_m:?}: {sum_m}");
        }
    }

    #[test]
    fn two_boxes_at_two_heights_are_told_apart() {
        let volume = reconstruct_volume(&links(truth), GRID, PRIOR).unwrap();
        let mean = |low: [f64; 3], high: [f64; 3]| {
            let inside = |index: &usize| {
                let at = GRID.centre(*index);
                (0..3).all(|axis| at[axis] > low[axis] && at[axis] < high[axis])
            };
            let all: Vec<f64> = (0..GRID.voxels())
                .filter(inside)
                .map(|index| volume.values[index])
                .collect();
            all.iter().sum::<f64>() / all.len() as f64
        };
        let (west, above_west) = (
            mean([2.0, 4.0, 0.0], [3.5, 6.0, 2.0]),
            mean([2.0, 4.0, 4.0], [3.5, 6.0, 6.0]),
        );
        let (east, below_east) = (
            mean([6.5, 5.0, 4.0], [8.0, 6.5, 6.0]),
            mean([6.5, 5.0, 0.0], [8.0, 6.5, 2.0]),
        );
        assert!(
            west > 2.0 && west > 4.0 * above_west.abs(),
            "{west} {above_west}"
        );
        assert!(
            east > 2.0 && east > 4.0 * below_east.abs(),
            "{east} {below_east}"
        );
        assert!(truth(GRID.centre(volume.strongest())) > 0.0);
        assert_eq!(volume.layer(5).len(), 400);
    }

    #[test]
    fn a_world_turned_upside_down_gives_the_image_upside_down() {
        let turned = |at: [f64; 3]| [at[0], at[1], 6.0 - at[2]];
        let upright = links(truth);
        let mirrored: Vec<VolumeLink> = upright
            .iter()
            .map(|link| VolumeLink {
                from_m: turned(link.from_m),
                to_m: turned(link.to_m),
                ..*link
            })
            .collect();
        let (one, other) = (
            reconstruct_volume(&upright[..300], GRID, PRIOR).unwrap(),
            reconstruct_volume(&mirrored[..300], GRID, PRIOR).unwrap(),
        );
        for index in 0..GRID.voxels() {
            let [column, row, layer] = GRID.place(index);
            let below = GRID.index([column, row, 5 - layer]);
            assert!((one.values[index] - other.values[below]).abs() < 1e-6);
        }
    }

    #[test]
    fn links_beside_the_volume_make_none() {
        let far = VolumeLink {
            from_m: [20.0; 3],
            to_m: [30.0; 3],
            attenuation_db: 3.0,
            sd_db: 1.0,
        };
        assert_eq!(
            reconstruct_volume(&[far], GRID, PRIOR),
            Err(VolumeError::NoLinks)
        );
        assert_eq!(
            reconstruct_volume(&[], GRID, PRIOR),
            Err(VolumeError::NoLinks)
        );
    }
}
