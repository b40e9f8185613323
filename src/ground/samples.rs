//! Samples as the ground keeps them: each stored once, with a watermark per vehicle, boot and run. Who may send them is not
//! judged here.
//!
//! Memory is bounded whatever is sent: of one source so many sequences above a gap, and so many sources. What is refused
//! is not acknowledged, so its sender keeps it and sends it again. What its sender says is lost is waited for no longer.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Boot, Have, HeardFrom, RunId, Sample, Samples, VehicleId, WATERMARKS_ALWAYS,
};

use crate::exchange::sequences::ReceivedSequences;
use crate::tomo::{Link, LinkBins};

/// Sources at most; one for every start of a vehicle's software in every run.
const SOURCES_MAX: usize = 16_384;
/// Bin pairs of one run at most, 20 times those of a long sweep by eight vehicles.
const BINS_MAX: usize = 500_000;
/// Watermarks of the newest runs are told every time, [`WATERMARKS_ALWAYS`], and so many of the others, in turn: together
/// under 64 kB.
const MARKS_IN_TURN: usize = 1024;
/// Closed runs told of, the newest.
const CLOSED_MAX: usize = 1024;

type Source = (VehicleId, Boot, RunId);

/// A sample with all that tells it from others.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct MeasuredSample {
    /// Who measured.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// In which run.
    pub run: RunId,
    /// What was measured.
    pub sample: Sample,
    /// When, seconds since 1970, and its deviation, as far as known.
    pub utc_s: Option<(f64, f64)>,
}

impl MeasuredSample {
    /// Returns the samples of batches, each once, by run, vehicle, start and number; when they were heard is not known.
    pub(crate) fn of_batches<'a>(
        batches: impl Iterator<Item = &'a Samples>,
    ) -> Vec<MeasuredSample> {
        let measured = batches.flat_map(|batch| {
            batch.samples.iter().map(|sample| MeasuredSample {
                vehicle: batch.vehicle,
                boot: batch.boot,
                run: batch.run,
                sample: *sample,
                utc_s: None,
            })
        });
        let by_key: BTreeMap<_, _> = measured.map(|one| (one.key(), one)).collect();
        by_key.into_values().collect()
    }

    fn key(&self) -> (RunId, VehicleId, Boot, u64) {
        (self.run, self.vehicle, self.boot, self.sample.sequence)
    }
}

/// All samples of all runs, binned into links.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SampleStore {
    store: u64,
    bin_m: f64,
    spot_m: f64,
    received: BTreeMap<Source, ReceivedSequences>,
    bins: BTreeMap<RunId, LinkBins>,
    count: BTreeMap<RunId, u64>,
    /// Samples for which there was no room.
    refused: u64,
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
            refused: 0,
        }
    }

    /// Stores a batch; returns how many samples of it were new.
    pub fn take(&mut self, batch: &Samples) -> usize {
        let source = (batch.vehicle, batch.boot, batch.run);
        let is_known = self.received.contains_key(&source);
        if batch.samples.is_empty() || (!is_known && self.received.len() >= SOURCES_MAX) {
            self.refused = self.refused.saturating_add(batch.samples.len() as u64);
            return 0;
        }
        let received = self.received.entry(source).or_default();
        let (bin_m, spot_m) = (self.bin_m, self.spot_m);
        let bins = self
            .bins
            .entry(batch.run)
            .or_insert_with(|| LinkBins::new(bin_m, spot_m));
        let mut new = 0;
        for sample in batch.samples.iter() {
            if !received.is_new(sample.sequence) {
                continue;
            }
            if bins.len() < BINS_MAX && received.take(sample.sequence) {
                bins.record_sample(batch.vehicle, sample);
                new += 1;
            } else {
                self.refused = self.refused.saturating_add(1);
            }
        }
        received.pass_over(&batch.lost);
        *self.count.entry(batch.run).or_default() += new as u64;
        new
    }

    /// Tells vehicles what they may forget: of the newest runs at every `turn`, of more than fit in turn.
    pub fn have(&self, closed: &BTreeSet<RunId>, turn: u64) -> Have {
        let mut sources: Vec<(&Source, &ReceivedSequences)> = self.received.iter().collect();
        sources.sort_by_key(|((vehicle, boot, run), _)| std::cmp::Reverse((*run, *boot, *vehicle)));
        let older = sources.split_off(sources.len().min(WATERMARKS_ALWAYS));
        let pages = older.len().div_ceil(MARKS_IN_TURN).max(1) as u64;
        let page = usize::try_from(turn % pages).unwrap_or(0);
        sources.extend(
            older
                .into_iter()
                .skip(page * MARKS_IN_TURN)
                .take(MARKS_IN_TURN),
        );
        sources.sort_by_key(|(source, _)| **source);
        let mark = |((vehicle, boot, run), received): &(&Source, &ReceivedSequences)| HeardFrom {
            vehicle: *vehicle,
            boot: *boot,
            run: *run,
            below: received.below(),
        };
        let old = closed.len().saturating_sub(CLOSED_MAX);
        let closed = closed.iter().skip(old).copied().collect();
        Have {
            store: self.store,
            watermarks: sources.iter().map(mark).collect(),
            closed,
        }
    }

    /// Returns how many samples were not stored since there was no room.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Returns the id of the store.
    pub fn store(&self) -> u64 {
        self.store
    }

    /// Returns how many samples of a run are stored.
    pub fn count(&self, run: RunId) -> u64 {
        self.count.get(&run).copied().unwrap_or_default()
    }

    /// Returns whether samples of a run are known to be missing.
    pub fn has_gaps(&self, run: RunId) -> bool {
        self.received
            .iter()
            .any(|((_, _, of), received)| *of == run && received.has_gap())
    }

    /// Returns how many links a run has.
    pub fn link_count(&self, run: RunId) -> usize {
        self.bins.get(&run).map_or(0, LinkBins::len)
    }

    /// Returns the links of a run, in a fixed order, without what radios differ by.
    pub fn links(&self, run: RunId) -> Vec<Link> {
        self.bins.get(&run).map(LinkBins::links).unwrap_or_default()
    }

    /// Returns the links of a run and those of the empty run that it is compared with; see [`LinkBins::links_against`].
    pub fn links_against(&self, run: RunId, empty: RunId) -> (Vec<Link>, Vec<Link>) {
        LinkBins::links_of_runs(&self.bins, &run, &empty)
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::LostSamples;

    use super::*;
    use crate::exchange::sequences::BEYOND_MAX;
    use crate::geom::Point;

    fn batch(sequences: &[u64]) -> Samples {
        let sample = |sequence: &u64| Sample {
            sequence: *sequence,
            heard_at_ns: 0,
            transmitter: VehicleId(1),
            transmitter_pose: Default::default(),
            receiver_pose: tomoswarm_proto::PoseReport {
                at: tomoswarm_proto::Position::from_metres(9.0, 0.0, 0.0),
                ..Default::default()
            },
            channel: 11,
            power_dbm: 0,
            rssi_dbm: Some(-60),
        };
        let samples = sequences.iter().map(sample).collect();
        Samples {
            vehicle: VehicleId(2),
            boot: Boot(1),
            run: RunId(1),
            samples,
            lost: vec![],
        }
    }

    fn below(store: &SampleStore) -> u64 {
        store.have(&BTreeSet::new(), 0).watermarks[0].below
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
        assert_eq!(
            store
                .links(RunId(1))
                .iter()
                .map(|link| link.packets)
                .sum::<u32>(),
            5
        );
    }
    #[test]
    fn a_flood_above_a_gap_is_kept_only_so_far_and_not_acknowledged() {
        let mut store = SampleStore::new(7, 0.5, 0.0625);
        let flood: Vec<u64> = (1..100_000).collect();
        assert_eq!(store.take(&batch(&flood)), BEYOND_MAX);
        assert_eq!(below(&store), 0);
        assert_eq!(
            store.take(&batch(&[0])),
            1,
            "what fills the gap is always taken"
        );
        assert_eq!(below(&store), BEYOND_MAX as u64 + 1);
        assert_eq!(store.take(&batch(&flood)), 100_000 - 1 - BEYOND_MAX);
        assert_eq!(below(&store), 100_000);
        assert_eq!(store.count(RunId(1)), 100_000);
    }

    #[test]
    fn what_its_sender_has_lost_holds_nothing_up() {
        let mut store = SampleStore::new(7, 0.5, 0.0625);
        assert_eq!(store.take(&batch(&[0, 1, 4])), 3);
        assert!(store.has_gaps(RunId(1)));
        let lost = vec![LostSamples { from: 2, until: 4 }];
        let told = Samples {
            lost,
            ..batch(&[4, 5])
        };
        assert_eq!(store.take(&told), 1);
        assert_eq!((below(&store), store.count(RunId(1))), (6, 4));
        assert!(!store.has_gaps(RunId(1)));
    }

    #[test]
    fn more_sources_than_fit_are_told_of_in_turn_and_never_too_many() {
        let mut store = SampleStore::new(7, 0.5, 0.0625);
        for boot in 0..5000 {
            for run in 0..4 {
                store.take(&Samples {
                    boot: Boot(boot),
                    run: RunId(run),
                    ..batch(&[0])
                });
            }
        }
        let closed: BTreeSet<RunId> = (0..2000).map(RunId).collect();
        let mut reported = BTreeSet::new();
        for turn in 0..20 {
            let have = store.have(&closed, turn);
            assert_eq!(
                (have.watermarks.len(), have.closed.len()),
                (2048.min(have.watermarks.len()), 1024)
            );
            assert_eq!(have.closed.last(), Some(&RunId(1999)));
            let frame =
                tomoswarm_proto::codec::encode(&tomoswarm_proto::Message::Have(have.clone()))
                    .unwrap();
            assert!(frame.len() < 64_000, "{}", frame.len());
            reported.extend(have.watermarks.iter().map(|mark| (mark.boot, mark.run)));
        }
        assert_eq!(reported.len(), SOURCES_MAX);
    }

    #[test]
    fn links_are_the_same_to_the_last_bit_in_whatever_order_samples_came() {
        let make = |order: &[u64]| {
            let mut store = SampleStore::new(7, 0.5, 0.0625);
            for sequence in order {
                let mut one = batch(&[*sequence]);
                let share = *sequence as f64 / 7.0;
                one.samples[0].transmitter_pose.at = Point::new(share.fract() * 0.3, 0.0).into();
                one.samples[0].receiver_pose.at =
                    Point::new(9.0, (share * 3.3).fract() * 0.3).into();
                one.samples[0].rssi_dbm = Some(-60 - (*sequence % 7) as i16);
                store.take(&one);
            }
            store.links(RunId(1))
        };
        let forward: Vec<u64> = (0..500).collect();
        let backward: Vec<u64> = forward.iter().rev().copied().collect();
        assert_eq!(make(&forward), make(&backward));
    }
}
