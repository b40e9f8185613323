//! Which samples the links of a recording are, so that one that is given twice counts once. Nothing is read here.

use std::collections::BTreeMap;
use std::iter;
use std::path::{Path, PathBuf};

use tomoswarm_proto::{RunId, VehicleId};

use super::recording::{Recording, RecordingError, wrong};
use crate::geom::Point;

/// What is one sample: there are no two alike.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct SampleKey {
    /// In which run it was measured.
    pub(super) run: RunId,
    /// Who measured it.
    pub(super) vehicle: VehicleId,
    /// In which start of its software.
    pub(super) boot: u32,
    /// Its number there.
    pub(super) sequence: u64,
}

impl SampleKey {
    /// Returns which sample it is, in words.
    fn in_words(self) -> String {
        let SampleKey {
            run,
            vehicle,
            boot,
            sequence,
        } = self;
        format!("sample {sequence} of vehicle {vehicle}, start {boot}, run {run}")
    }
}

/// A sample as a line says it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct KeyedSample {
    /// Which one it is.
    pub key: SampleKey,
    /// The number of the line.
    pub line: usize,
    /// When it was heard, by the clock of who measured.
    pub(super) heard_at_s: f64,
    /// Who sent it, as far as it is known.
    pub(super) transmitter: Option<VehicleId>,
    /// What was measured.
    pub(super) link: SeenLink,
    /// How high both ends are, metres, as far as it is known.
    pub(super) heights_m: (Option<f64>, Option<f64>),
}

/// Ends and strength of a link of one packet; without a strength it was missed.
pub(super) type SeenLink = (Point, Point, Option<f64>);

impl KeyedSample {
    /// Checks that another line with the same key says the same; `known_at` = where this one stands. Moments of UTC are passed
    /// over: a later export knows them better.
    ///
    /// # Errors
    /// It says something else.
    pub(super) fn check_same(
        &self,
        other: &KeyedSample,
        known_at: &str,
    ) -> Result<(), RecordingError> {
        let said = |one: &KeyedSample| (one.heard_at_s, one.transmitter, one.link, one.heights_m);
        if said(self) == said(other) {
            return Ok(());
        }
        Err(wrong(
            format!("{}: ", other.line),
            format!("{} otherwise than in {known_at}", other.key.in_words()),
            "the same again, or a key (run, vehicle, boot, sequence) of its own",
        ))
    }
}

impl Recording {
    /// Leaves out the samples that earlier files had, and notes those that stay in `known`, with their files.
    ///
    /// # Errors
    /// A sample that an earlier file had says something else here.
    pub(super) fn leave_out_known(
        &mut self,
        file: &Path,
        known: &mut BTreeMap<SampleKey, (PathBuf, KeyedSample)>,
    ) -> Result<(), RecordingError> {
        let mut is_new = Vec::with_capacity(self.keyed.len());
        for sample in &self.keyed {
            let earlier = known.get(&sample.key);
            if let Some((path, earlier)) = earlier {
                let known_at = format!("{}:{}", path.display(), earlier.line);
                earlier.check_same(sample, &known_at)?;
            }
            is_new.push(earlier.is_none());
        }
        let own = self.keyed.iter().map(|sample| {
            let sample = *sample;
            (sample.key, (file.to_owned(), sample))
        });
        let new = own.zip(&is_new).filter(|(_, is_new)| **is_new);
        known.extend(new.map(|(sample, _)| sample));
        // Where it is not known which samples they are, there is nothing to be left out.
        let mut keep = is_new.iter().copied().chain(iter::repeat(true));
        self.links.retain(|_| keep.next().unwrap_or(true));
        let mut keep = is_new.iter().copied().chain(iter::repeat(true));
        self.devices.retain(|_| keep.next().unwrap_or(true));
        let mut keep = is_new.iter().copied().chain(iter::repeat(true));
        self.heights_m.retain(|_| keep.next().unwrap_or(true));
        self.repeated += is_new.iter().filter(|is_new| !**is_new).count();
        self.keyed.clear();
        self.in_time.clear();
        Ok(())
    }
}
