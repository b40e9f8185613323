//! Samples as the ground keeps them: each stored once, with a watermark per vehicle, boot and run.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, Have, HeardFrom, RunId, Sample, Samples, VehicleId};

use crate::geom::Point;
use crate::tomo::{Link, LinkBins};

type Source = (VehicleId, Boot, RunId);

/// What has been received of one source.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Received {
    /// Every sequence below is stored.
    below: u64,
    /// Stored sequences above a gap.
    beyond: BTreeSet<u64>,
}

impl Received {
    /// Records a sequence; gives whether it was new.
    fn take(&mut self, sequence: u64) -> bool {
        if sequence < self.below || !self.beyond.insert(sequence) {
            return false;
        }
        while self.beyond.remove(&self.below) {
            self.below += 1;
        }
        true
    }
}

/// All samples of all runs, binned into links.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SampleStore {
    store: u64,
    bin_m: f64,
    spot_m: f64,
    received: BTreeMap<Source, Received>,
    bins: BTreeMap<RunId, LinkBins>,
    count: BTreeMap<RunId, u64>,
}

impl SampleStore {
    /// Makes an empty store with an id of its own.
    pub fn new(store: u64, bin_m: f64, spot_m: f64) -> SampleStore {
        SampleStore {
            store,
            bin_m,
            spot_m,
            received: BTreeMap::new(),
            bins: BTreeMap::new(),
            count: BTreeMap::new(),
        }
    }

    /// Stores a batch; gives how many samples of it were new.
    pub fn take(&mut self, batch: &Samples) -> usize {
        let received = self.received.entry((batch.vehicle, batch.boot, batch.run)).or_default();
        let (bin_m, spot_m) = (self.bin_m, self.spot_m);
        let bins = self.bins.entry(batch.run).or_insert_with(|| LinkBins::new(bin_m, spot_m));
        let mut new = 0;
        for sample in batch.samples.iter().filter(|sample| received.take(sample.sequence)) {
            record(bins, sample);
            new += 1;
        }
        *self.count.entry(batch.run).or_default() += new as u64;
        new
    }

    /// Tells vehicles what they may forget.
    pub fn have(&self) -> Have {
        let mark = |((vehicle, boot, run), received): (&Source, &Received)| HeardFrom {
            vehicle: *vehicle,
            boot: *boot,
            run: *run,
            below: received.below,
        };
        Have { store: self.store, watermarks: self.received.iter().map(mark).collect(), closed: Vec::new() }
    }

    /// Gives how many samples of a run are stored.
    pub fn count(&self, run: RunId) -> u64 {
        self.count.get(&run).copied().unwrap_or_default()
    }

    /// Tells whether samples of a run are known to be missing.
    pub fn has_gaps(&self, run: RunId) -> bool {
        self.received.iter().any(|((_, _, of), received)| *of == run && !received.beyond.is_empty())
    }

    /// Gives the links of a run, in a fixed order.
    pub fn links(&self, run: RunId) -> Vec<Link> {
        self.bins.get(&run).map(LinkBins::links).unwrap_or_default()
    }
}

fn record(bins: &mut LinkBins, sample: &Sample) {
    let transmitter = Point::from(sample.transmitter_pose.at);
    let receiver = Point::from(sample.receiver_pose.at);
    bins.record(transmitter, receiver, sample.rssi_dbm);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batch(sequences: &[u64]) -> Samples {
        let sample = |sequence: &u64| Sample {
            sequence: *sequence,
            heard_at_ns: 0,
            transmitter: VehicleId(1),
            transmitter_pose: Default::default(),
            receiver_pose: tomoswarm_proto::PoseReport {
                at: tomoswarm_proto::Position { x_m: 9.0, y_m: 0.0, z_m: 0.0 },
                ..Default::default()
            },
            channel: 11,
            power_dbm: 0,
            rssi_dbm: Some(-60),
        };
        let samples = sequences.iter().map(sample).collect();
        Samples { vehicle: VehicleId(2), boot: Boot(1), run: RunId(1), samples }
    }

    fn below(store: &SampleStore) -> u64 {
        store.have().watermarks[0].below
    }

    #[test]
    fn late_and_doubled_batches_are_stored_once() {
        let mut store = SampleStore::new(7, 0.5, 0.0625);
        assert_eq!(store.take(&batch(&[3, 4])), 2);
        assert_eq!(below(&store), 0);
        assert_eq!(store.take(&batch(&[0, 1, 2, 3])), 3);
        assert_eq!(below(&store), 5);
        assert_eq!(store.take(&batch(&[0, 1, 2, 3, 4])), 0);
        assert_eq!(store.count(RunId(1)), 5);
        assert_eq!(store.links(RunId(1)).iter().map(|link| link.packets).sum::<u32>(), 5);
    }
}
