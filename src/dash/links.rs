//! The links that were measured, run by run, for whoever asks what made a pixel: samples are pooled as the ground station pools them,
//! each once. It knows those that this server has heard; a server that began in the middle of a run lacks what came before.
//!
//! Memory is bounded whatever is sent: of one source so many sequences above a gap, so many sources, runs and links; the
//! samples themselves are kept as long as there is room ([`SampleBook`]).

use std::collections::{BTreeMap, BTreeSet};

use tomoswarm_proto::{Boot, RunId, Samples, VehicleId};

use super::sample_book::SampleBook;
use crate::geom::Point;
use crate::tomo::{Devices, Link, LinkBins};

/// Sources at most: starts of vehicles in runs.
const SOURCES_MAX: usize = 1024;
/// Sequences above a gap that are kept of one source.
const BEYOND_MAX: usize = 65_536;
/// Runs that are kept: the newest.
const RUNS_MAX: usize = 16;
/// Links of one run at most.
const LINKS_MAX: usize = 100_000;

/// The links of all runs.
#[derive(Clone, Debug, Default)]
pub struct LinkBook {
    received: BTreeMap<(RunId, VehicleId, Boot), Received>,
    bins: BTreeMap<RunId, LinkBins>,
    /// Those that are new, as they came.
    samples: SampleBook,
}

/// What has come of one source: everything below, and some beyond.
#[derive(Clone, Debug, Default)]
struct Received {
    below: u64,
    beyond: BTreeSet<u64>,
}

impl Received {
    /// Takes a sequence; returns whether it is new and there was room for it.
    fn take(&mut self, sequence: u64) -> bool {
        let is_room = sequence == self.below || self.beyond.len() < BEYOND_MAX;
        let is_new = sequence >= self.below && sequence != u64::MAX;
        if !is_room || !is_new || !self.beyond.insert(sequence) {
            return false;
        }
        while self.beyond.remove(&self.below) {
            self.below += 1;
        }
        true
    }
}

impl LinkBook {
    /// Takes a batch of samples.
    pub fn take(&mut self, batch: &Samples) {
        let source = (batch.run, batch.vehicle, batch.boot);
        let is_known = self.received.contains_key(&source);
        if !is_known && self.received.len() >= SOURCES_MAX {
            return;
        }
        let received = self.received.entry(source).or_default();
        let bins = self.bins.entry(batch.run).or_default();
        for sample in batch.samples.iter() {
            if bins.len() < LINKS_MAX && received.take(sample.sequence) {
                let from = Point::from(sample.transmitter_pose.at);
                let to = Point::from(sample.receiver_pose.at);
                let devices = Devices {
                    transmitter: sample.transmitter,
                    receiver: batch.vehicle,
                };
                bins.record(devices, from, to, sample.rssi_dbm);
                let who = (batch.vehicle, batch.boot);
                self.samples.take(batch.run, who, sample);
            }
        }
        if self.bins.len() > RUNS_MAX
            && let Some((oldest, _)) = self.bins.pop_first()
        {
            self.received.retain(|(run, ..), _| *run != oldest);
        }
    }

    /// Keeps no samples themselves from now on: whoever saves them has a store.
    pub fn keep_no_samples(&mut self) {
        self.samples = SampleBook::new(0);
    }

    /// Returns the samples themselves.
    pub fn samples(&self) -> &SampleBook {
        &self.samples
    }

    /// Returns the links of a run, in a fixed order, without what radios differ by.
    pub fn of(&self, run: RunId) -> Vec<Link> {
        self.bins.get(&run).map(LinkBins::links).unwrap_or_default()
    }

    /// Returns the links of a run and those of the empty run that it is compared with; see [`LinkBins::links_against`].
    pub fn against(&self, run: RunId, empty: RunId) -> (Vec<Link>, Vec<Link>) {
        LinkBins::links_of_runs(&self.bins, &run, &empty)
    }

    /// Returns the links of a run as they were measured, for a file.
    pub fn measured(&self, run: RunId) -> Vec<Link> {
        let bins = self.bins.get(&run);
        bins.map(LinkBins::measured_links).unwrap_or_default()
    }
}
