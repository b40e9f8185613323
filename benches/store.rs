//! Measures how many samples a second the ground's store takes, durably as it does live: groups of batches, each group
//! one transaction that is on disk when it returns. Run: `cargo bench --bench store`.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[cfg(feature = "net")]
fn main() {
    let folder = std::env::current_dir()
        .unwrap_or_default()
        .join("target")
        .join("bench-store");
    for (words, batches) in [
        ("a single batch", 1),
        ("what 100 ms bring at 20,000/s", 16),
        ("half a second of it", 78),
    ] {
        let mut rates: Vec<f64> = (0..5)
            .map(|_| bench::rate_per_s(&folder, batches))
            .collect();
        rates.sort_by(f64::total_cmp);
        println!(
            "{:>6} samples a commit ({words}): median {:.0} samples/s (slowest {:.0}, fastest {:.0})",
            batches * bench::BATCH,
            rates[2],
            rates[0],
            rates[4]
        );
    }
    // What is left does no harm.
    let _ = std::fs::remove_dir_all(folder);
}

#[cfg(not(feature = "net"))]
fn main() {
    println!("the store is part of the feature net");
}

#[cfg(feature = "net")]
mod bench {
    use std::path::Path;
    use std::time::Instant;

    use tomoswarm::store::ground::{GroundStore, Start};
    use tomoswarm_proto::{Boot, RunId, Sample, Samples, VehicleId};

    /// Samples of a batch, as vehicles send them.
    pub const BATCH: usize = 128;
    /// Samples of one measurement at least.
    const SAMPLES: usize = 40_000;

    /// Returns samples a second into a fresh store, from eight vehicles in turn.
    pub fn rate_per_s(folder: &Path, batches: usize) -> f64 {
        let _ = std::fs::remove_dir_all(folder);
        std::fs::create_dir_all(folder).expect("a folder to write to");
        let mut store =
            GroundStore::open(&folder.join("swarm.db"), &Start::default()).expect("a new store");
        let mut next = [0; 8];
        let groups: Vec<Vec<Samples>> = (0..SAMPLES.div_ceil(batches * BATCH))
            .map(|group| {
                (0..batches)
                    .map(|index| batch(&mut next, group * batches + index))
                    .collect()
            })
            .collect();
        let start = Instant::now();
        let new: usize = groups
            .iter()
            .map(|group| store.take(group).expect("room"))
            .sum();
        new as f64 / start.elapsed().as_secs_f64()
    }

    fn batch(next: &mut [u64; 8], index: usize) -> Samples {
        let vehicle = index % next.len();
        let first = next[vehicle];
        next[vehicle] += BATCH as u64;
        let samples = (first..next[vehicle]).map(sample).collect();
        Samples {
            vehicle: VehicleId(vehicle as u8),
            boot: Boot(1),
            run: RunId(1),
            samples,
            lost: vec![],
        }
    }

    fn sample(sequence: u64) -> Sample {
        let mut receiver_pose = tomoswarm_proto::PoseReport::default();
        receiver_pose.at.x_mm = (sequence % 1_000_000) as i32 * 13;
        Sample {
            sequence,
            heard_at_ns: sequence * 50_000_000,
            transmitter: VehicleId(9),
            transmitter_pose: receiver_pose,
            receiver_pose,
            channel: 26,
            power_dbm: 0,
            rssi_dbm: Some(-60 - (sequence % 30) as i16),
        }
    }
}
