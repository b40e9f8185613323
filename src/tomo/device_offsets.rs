//! By how much radios send and hear more or less strongly than others of the same make, found from squares that several
//! pairs of them have measured: there they differ by the radios alone, whatever stands between.
//!
//! ```text
//!   m_bp = µ_b + t_i + r_j + noise        bin b, packets from i to j; w_bp = n/(1 + n/4), n packets
//!   Σ_b Σ_p w (m_bp − m̄_b − (x_p − x̄_b)ᵀβ)²  +  ρ |β|²  →  least        β = (t, r), x_p = 1 at i and at j, means over a bin by w
//! ```
//!
//! What all radios have in common is no offset (it is the level of the path loss); the smallest β is taken of all that say the
//! same. Fades of neighbouring squares go together, so that chance makes offsets several times as large as independent noise
//! would: smaller ones than that are none.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use super::bins::Heard;
use super::cholesky::{Cholesky, dot};

/// Who sent and who heard.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub struct Devices {
    /// Who sent.
    pub transmitter: VehicleId,
    /// Who heard, or should have.
    pub receiver: VehicleId,
}

/// More packets of a pair in a square than this hardly say more: their fades are the same.
const WEIGHT_MOST: f64 = 4.0;
/// ρ: a packet's noise is about as large as offsets are, 3 dB.
const RIDGE: f64 = 1.0;
/// Offsets explain at least so many times what independent noise would by chance. Noise of neighbouring squares goes together:
/// equal radios have up to 4 in simulations of two to eight vehicles, offsets of 1 dB 3,700.
const LEAST_RATIO: f64 = 20.0;

/// The offsets of radios, dB.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct DeviceOffsets {
    sent_db: BTreeMap<VehicleId, f64>,
    heard_db: BTreeMap<VehicleId, f64>,
}

impl DeviceOffsets {
    /// Finds offsets from what pairs have heard in each bin; `None` when no bin tells them apart, or chance may have made them.
    pub(super) fn fit<'a>(
        bins: impl Iterator<Item = &'a [Heard]> + Clone,
    ) -> Option<DeviceOffsets> {
        let known = bins.clone().flatten().filter_map(|heard| heard.devices);
        let transmitters: BTreeSet<VehicleId> = known.clone().map(|one| one.transmitter).collect();
        let receivers: BTreeSet<VehicleId> = known.map(|one| one.receiver).collect();
        let indices = |set: &BTreeSet<VehicleId>, first: usize| -> BTreeMap<VehicleId, usize> {
            set.iter()
                .enumerate()
                .map(|(index, id)| (*id, first + index))
                .collect()
        };
        let sent = indices(&transmitters, 0);
        let heard = indices(&receivers, sent.len());
        let mut sums = Sums::new(sent.len() + heard.len());
        for bin in bins {
            let means = bin.iter().filter_map(|one| {
                let devices = one.devices?;
                let unknowns = [
                    *sent.get(&devices.transmitter)?,
                    *heard.get(&devices.receiver)?,
                ];
                Some(PairMean::of(one, unknowns))
            });
            sums.add(&means.flatten().collect::<Vec<_>>());
        }
        let offsets_db = sums.solved()?;
        let of = |indices: &BTreeMap<VehicleId, usize>| {
            indices
                .iter()
                .map(|(id, index)| (*id, offsets_db[*index]))
                .collect()
        };
        Some(DeviceOffsets {
            sent_db: of(&sent),
            heard_db: of(&heard),
        })
    }

    /// Returns by how much packets of a pair are stronger than those of others, dB; 0 when that is not known.
    pub(super) fn of(&self, devices: Option<Devices>) -> f64 {
        let Some(devices) = devices else { return 0.0 };
        let of = |offsets: &BTreeMap<VehicleId, f64>, id: VehicleId| {
            offsets.get(&id).copied().unwrap_or(0.0)
        };
        of(&self.sent_db, devices.transmitter) + of(&self.heard_db, devices.receiver)
    }

    /// Returns each radio with its offsets as a sender and as a receiver, dB; 0 = it did not, or it is not known.
    pub fn list(&self) -> Vec<(VehicleId, f64, f64)> {
        let ids: BTreeSet<VehicleId> = self
            .sent_db
            .keys()
            .chain(self.heard_db.keys())
            .copied()
            .collect();
        let of = |offsets: &BTreeMap<VehicleId, f64>, id: VehicleId| {
            offsets.get(&id).copied().unwrap_or(0.0)
        };
        let row = |id: VehicleId| (id, of(&self.sent_db, id), of(&self.heard_db, id));
        ids.into_iter().map(row).collect()
    }
}

/// What a pair has heard in a bin.
struct PairMean {
    mean_dbm: f64,
    weight: f64,
    /// Which offsets it has.
    unknowns: [usize; 2],
}

impl PairMean {
    fn of(heard: &Heard, unknowns: [usize; 2]) -> Option<PairMean> {
        let packets = f64::from(heard.packets);
        (heard.packets > 0).then(|| PairMean {
            mean_dbm: heard.sum_dbm / packets,
            weight: packets / (1.0 + packets / WEIGHT_MOST),
            unknowns,
        })
    }
}

/// The normal equations of all bins.
struct Sums {
    matrix: Vec<Vec<f64>>,
    right: Vec<f64>,
    /// Σ w (m − m̄)².
    squares: f64,
    /// How many differences there are.
    freedom: usize,
}

impl Sums {
    fn new(unknowns: usize) -> Sums {
        Sums {
            matrix: vec![vec![0.0; unknowns]; unknowns],
            right: vec![0.0; unknowns],
            squares: 0.0,
            freedom: 0,
        }
    }

    fn add(&mut self, pairs: &[PairMean]) {
        if pairs.len() < 2 {
            return;
        }
        let weight: f64 = pairs.iter().map(|pair| pair.weight).sum();
        let weighted = pairs.iter().map(|pair| pair.weight * pair.mean_dbm);
        let mean_dbm = weighted.sum::<f64>() / weight;
        for one in pairs {
            let off_db = one.mean_dbm - mean_dbm;
            self.squares += one.weight * off_db * off_db;
            for i in one.unknowns {
                self.right[i] += one.weight * off_db;
                for j in one.unknowns {
                    self.matrix[i][j] += one.weight;
                }
            }
            for other in pairs {
                let both = one.weight * other.weight / weight;
                for i in one.unknowns {
                    for j in other.unknowns {
                        self.matrix[i][j] -= both;
                    }
                }
            }
        }
        self.freedom += pairs.len() - 1;
    }

    /// Returns the unknowns; `None` when they are not told apart, or may be chance.
    fn solved(&self) -> Option<Vec<f64>> {
        let unknowns = self.right.len();
        // What all senders, and what all receivers, have in common is told by no bin.
        let told = unknowns.checked_sub(2).filter(|told| *told > 0)?;
        let freedom = self.freedom.checked_sub(told).filter(|rest| *rest > 0)?;
        let ridge = |i, j| if i == j { RIDGE } else { 0.0 };
        let factor = Cholesky::of(unknowns, |i, j| self.matrix[i][j] + ridge(i, j))?;
        let mut offsets_db = self.right.clone();
        factor.solve(&mut offsets_db);
        let explained = dot(&offsets_db, &self.right) / told as f64;
        let rest = (self.squares - dot(&offsets_db, &self.right)).max(0.0) / freedom as f64;
        (explained > LEAST_RATIO * rest).then_some(offsets_db)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tomo::tests_support::Noise;

    fn devices(transmitter: u8, receiver: u8) -> Option<Devices> {
        Some(Devices {
            transmitter: VehicleId(transmitter),
            receiver: VehicleId(receiver),
        })
    }

    /// Bins that are strong and weak, each measured by both directions of two of four pairs.
    fn bins(sent_db: [f64; 4], heard_db: [f64; 4], count: usize) -> Vec<Vec<Heard>> {
        let mut noise = Noise::new(3);
        let pairs = [(1, 2), (1, 3), (2, 3), (3, 4)];
        let bin = |index: usize| {
            let level_dbm = -60.0 + 10.0 * noise.normal();
            let both = [pairs[index % 4], pairs[(index + 1 + index / 4 % 3) % 4]];
            let directed = both.into_iter().flat_map(|(a, b)| [(a, b), (b, a)]);
            let heard = directed.map(|(from, to): (u8, u8)| {
                let offset_db = sent_db[usize::from(from) - 1] + heard_db[usize::from(to) - 1];
                let packets = 3;
                Heard {
                    devices: devices(from, to),
                    packets,
                    sum_dbm: f64::from(packets) * (level_dbm + offset_db + 2.0 * noise.normal()),
                    square_sum: 0.0,
                }
            });
            heard.collect()
        };
        (0..count).map(bin).collect()
    }

    fn fit(bins: &[Vec<Heard>]) -> Option<DeviceOffsets> {
        DeviceOffsets::fit(bins.iter().map(Vec::as_slice))
    }

    #[test]
    fn offsets_are_found_whatever_stands_between() {
        let (sent_db, heard_db) = ([2.0, -1.0, 0.5, -3.0], [0.0, 4.0, -2.0, 1.0]);
        let found = fit(&bins(sent_db, heard_db, 400)).unwrap();
        // What they have in common is no offset.
        let middle = |values: [f64; 4]| values.iter().sum::<f64>() / 4.0;
        let common_db = middle(sent_db) + middle(heard_db);
        for (from, to) in [(1, 2), (2, 1), (1, 4), (4, 3), (3, 1)] {
            let truth_db =
                sent_db[usize::from(from) - 1] + heard_db[usize::from(to) - 1] - common_db;
            let off_db = found.of(devices(from, to)) - truth_db;
            assert!(off_db.abs() < 0.4, "{from} to {to}: {off_db}, {found:?}");
        }
        assert_eq!(found.of(None), 0.0);
        assert_eq!(found.of(devices(8, 9)), 0.0);
    }

    #[test]
    fn radios_that_are_alike_and_bins_of_one_pair_have_no_offsets() {
        assert_eq!(fit(&bins([0.0; 4], [0.0; 4], 400)), None);
        let mut alone = bins([5.0, 0.0, 0.0, 0.0], [0.0; 4], 400);
        alone.iter_mut().for_each(|bin| bin.truncate(1));
        assert_eq!(fit(&alone), None);
        assert_eq!(fit(&[]), None);
    }
}
