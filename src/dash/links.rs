//! The links that were measured, run by run, for whoever asks what made a pixel: samples are pooled in squares of 0.5 m, as
//! by a ground station whose file says no other `bin_m`, each once. It knows those that this server has heard; a server
//! that began in the middle of a run lacks what came before.
//!
//! Of each image it is known how many samples had come before it ([`SamplesHeard`]), so that the links can be had as they
//! were when an earlier image came.
//!
//! Memory is bounded whatever is sent: of one source so many sequences above a gap, so many sources, runs, links and images;
//! the samples themselves are kept as long as there is room ([`SampleBook`]).

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use tomoswarm_proto::{Boot, RunId, Samples, VehicleId};

use super::sample_book::SampleBook;
use crate::exchange::sequences::ReceivedSequences;
use crate::geom::Point;
use crate::tomo::{Link, LinkBins};

/// Sources at most: starts of vehicles in runs.
const SOURCES_MAX: usize = 1024;
/// Runs that are kept: the newest.
const RUNS_MAX: usize = 16;
/// Links of one run at most.
const LINKS_MAX: usize = 100_000;
/// Images of which it is known what had come before them, at most: the newest.
const IMAGES_MAX: usize = 4096;

/// An image: its run, and its number in the run.
type Edition = (RunId, u32);

/// How many samples of each run had been heard at a moment.
pub type SamplesHeard = BTreeMap<RunId, u64>;

/// The links of all runs, and which samples have come.
#[derive(Clone, Debug, Default)]
pub struct LinkBook {
    received: BTreeMap<(RunId, VehicleId, Boot), ReceivedSequences>,
    heard: HeardLinks,
    /// What had come before each image, in the order in which those came.
    images: VecDeque<(Edition, SamplesHeard)>,
}

/// The links of all runs. A copy costs nothing: it shares all of them until more comes, so that a thread can have one.
#[derive(Clone, Debug, Default)]
pub struct HeardLinks {
    bins: BTreeMap<RunId, Arc<LinkBins>>,
    /// The samples that are new, as they came.
    samples: SampleBook,
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
        let HeardLinks { bins, samples } = &mut self.heard;
        let of_run = Arc::make_mut(bins.entry(batch.run).or_default());
        for sample in batch.samples.iter() {
            if of_run.len() < LINKS_MAX && is_taken(received, sample.sequence) {
                of_run.record_sample(batch.vehicle, sample);
                let who = (batch.vehicle, batch.boot);
                samples.take(batch.run, who, sample);
            }
        }
        received.pass_over(&batch.lost);
        if bins.len() > RUNS_MAX
            && let Some((oldest, _)) = bins.pop_first()
        {
            self.received.retain(|(run, ..), _| *run != oldest);
        }
    }

    /// Takes that an image has come, or a part of one.
    pub fn image_came(&mut self, image: Edition) {
        if self.before_image(image).is_some() {
            return;
        }
        let HeardLinks { bins, samples } = &self.heard;
        let heard = bins.keys().map(|run| (*run, samples.heard(*run)));
        self.images.push_back((image, heard.collect()));
        if self.images.len() > IMAGES_MAX {
            self.images.pop_front();
        }
    }

    /// Returns what had come before an image; `None` = that is not known, or not any more.
    pub fn before_image(&self, image: Edition) -> Option<&SamplesHeard> {
        let (_, heard) = self.images.iter().rev().find(|(of, _)| *of == image)?;
        Some(heard)
    }

    /// Returns what has come of links.
    pub fn heard(&self) -> &HeardLinks {
        &self.heard
    }
}

/// Takes a sequence; returns whether it is new. Where too many have come above a gap, what is missing stays away: whoever shows
/// this confirms nothing, and began perhaps in the middle.
fn is_taken(received: &mut ReceivedSequences, sequence: u64) -> bool {
    // The last number of all is never taken, and passes over no gap.
    if sequence == u64::MAX || !received.is_new(sequence) {
        return false;
    }
    received.take(sequence) || {
        received.pass_gap();
        received.take(sequence)
    }
}

impl HeardLinks {
    /// Returns the samples themselves.
    pub fn samples(&self) -> &SampleBook {
        &self.samples
    }

    /// Makes links of what each run has measured.
    pub fn of_runs(bins: impl IntoIterator<Item = (RunId, LinkBins)>) -> HeardLinks {
        let shared = |(run, bins)| (run, Arc::new(bins));
        HeardLinks {
            bins: bins.into_iter().map(shared).collect(),
            samples: SampleBook::default(),
        }
    }

    /// Returns the links of some runs as they were when so many samples had been heard.
    ///
    /// # Errors
    /// Some of those samples had no room; in words.
    pub fn when(
        &self,
        heard: &SamplesHeard,
        runs: impl IntoIterator<Item = RunId>,
    ) -> Result<HeardLinks, String> {
        let mut links = Vec::new();
        for run in runs {
            let count = heard.get(&run).copied().unwrap_or_default();
            let kept = self.samples.kept(run);
            if kept < count {
                return Err(format!(
                    "of the {count} samples of run {run} before this image only {kept} are kept: there was no room"
                ));
            }
            let mut bins = LinkBins::default();
            let samples = self.samples.of(run).zip(0..count);
            for ((vehicle, _, sample), _) in samples {
                bins.record_sample(vehicle, &sample);
            }
            links.push((run, bins));
        }
        Ok(HeardLinks::of_runs(links))
    }

    /// Returns what a run has measured; `None` = nothing was heard of it.
    pub fn bins(&self, run: RunId) -> Option<&LinkBins> {
        self.bins.get(&run).map(Arc::as_ref)
    }

    /// Returns whether anything was heard of the links of a run.
    pub fn has(&self, run: RunId) -> bool {
        self.bins.get(&run).is_some_and(|bins| bins.len() > 0)
    }

    /// Returns the links of a run, in a fixed order, without what radios differ by.
    pub fn of(&self, run: RunId) -> Vec<Link> {
        let bins = self.bins.get(&run);
        bins.map(|bins| bins.links()).unwrap_or_default()
    }

    /// Returns which vehicles have measured a link of a run, by its mean places, ascending; none when it is not known.
    pub fn vehicles_between(&self, run: RunId, from: Point, to: Point) -> Vec<VehicleId> {
        let bins = self.bins.get(&run);
        bins.map(|bins| bins.vehicles_between(from, to))
            .unwrap_or_default()
    }

    /// Returns the links of a run and those of the empty run that it is compared with; see [`LinkBins::links_against`].
    pub fn against(&self, run: RunId, empty: RunId) -> (Vec<Link>, Vec<Link>) {
        LinkBins::links_of_runs(&self.bins, &run, &empty)
    }

    /// Returns the links of a run as they were measured, for a file.
    pub fn measured(&self, run: RunId) -> Vec<Link> {
        let bins = self.bins.get(&run);
        bins.map(|bins| bins.measured_links()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exchange::sequences::BEYOND_MAX;

    #[test]
    fn sequences_go_on_being_taken_when_too_many_have_come_above_a_gap() {
        let mut received = ReceivedSequences::default();
        let most = BEYOND_MAX as u64;
        assert!(is_taken(&mut received, 0));
        assert!(
            (2..2 + 3 * most).all(|sequence| is_taken(&mut received, sequence)),
            "1 is missing"
        );
        for old in [0, 1, 2, 1 + 3 * most, u64::MAX] {
            assert!(!is_taken(&mut received, old), "{old}");
        }
        assert_eq!(received.below(), 2 + 3 * most);
        assert!(is_taken(&mut received, 4 + 3 * most));
        assert!(!is_taken(&mut received, u64::MAX));
        assert!(is_taken(&mut received, 2 + 3 * most), "its gap is open");
    }
}
