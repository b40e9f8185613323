//! The samples that an outbox holds in memory until the ground has them: those that were never sent, and those that were.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::Sample;

use super::{SampleKey, Source};
use crate::time::Time;

/// What the ground has not confirmed after this long is sent again.
const REPEAT_AFTER: Duration = Duration::from_secs(4);
/// So often; then after twice as long, and so on: a bus that loses much gets it across before the run is closed without it,
/// and what a gap holds up for good costs little.
const REPEATS_SOON: u8 = 3;
/// The wait before a repetition is doubled so often at most: about four minutes.
const DOUBLINGS: u8 = 6;
/// Samples of one batch; about 10 kB.
pub(super) const BATCH: usize = 128;

/// A sample that was sent and is not confirmed.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Sent {
    sample: Sample,
    /// When it is sent again.
    due: Time,
    /// How often it was sent again.
    repeats: u8,
}

/// The samples.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct HeldSamples {
    /// Never sent.
    fresh: BTreeMap<SampleKey, Sample>,
    sent: BTreeMap<SampleKey, Sent>,
}

impl HeldSamples {
    /// Returns how many there are.
    pub(super) fn len(&self) -> usize {
        self.fresh.len() + self.sent.len()
    }

    /// Returns whether a sample is held that was sent.
    pub(super) fn is_sent(&self, place: SampleKey) -> bool {
        self.sent.contains_key(&place)
    }

    /// Holds a sample that was never sent.
    pub(super) fn add(&mut self, place: SampleKey, sample: Sample) {
        self.fresh.insert(place, sample);
    }

    /// Returns the sequences of a source that are held from one to another, exclusive, ascending.
    pub(super) fn between(&self, source: Source, from: u64, until: u64) -> Vec<u64> {
        let range = place(source, from)..place(source, until);
        let fresh = self.fresh.range(range.clone()).map(|(place, _)| place);
        let sent = self.sent.range(range).map(|(place, _)| place);
        let mut held: Vec<u64> = fresh.chain(sent).map(|place| place.sequence).collect();
        held.sort_unstable();
        held
    }

    /// Drops what a watermark covers.
    pub(super) fn confirm(&mut self, source: Source, below: u64) {
        drop_below(&mut self.fresh, source, below);
        drop_below(&mut self.sent, source, below);
    }

    /// Makes all that was sent due again.
    pub(super) fn repeat_all(&mut self, now: Time) {
        for sent in self.sent.values_mut() {
            (sent.due, sent.repeats) = (now, 0);
        }
    }

    /// Returns the batches that are due, at most so many, with what they are of: what was never sent goes first.
    pub(super) fn batches(&mut self, now: Time, most: usize) -> Vec<(Source, Vec<Sample>)> {
        let fresh = std::iter::from_fn(|| self.fresh_batch(now));
        let mut batches: Vec<_> = fresh.take(most).collect();
        if batches.len() < most {
            batches.extend(self.due_batches(now, most - batches.len()));
        }
        batches
    }

    /// Takes the next batch of what was never sent.
    fn fresh_batch(&mut self, now: Time) -> Option<(Source, Vec<Sample>)> {
        let (first, _) = self.fresh.first_key_value()?;
        let source = first.source();
        let mut samples = Vec::with_capacity(BATCH);
        while samples.len() < BATCH {
            let next = self.fresh.first_entry();
            let Some(next) = next.filter(|next| next.key().source() == source) else {
                break;
            };
            let (place, sample) = next.remove_entry();
            samples.push(sample);
            let due = now + REPEAT_AFTER;
            self.sent.insert(
                place,
                Sent {
                    sample,
                    due,
                    repeats: 0,
                },
            );
        }
        Some((source, samples))
    }

    /// Returns batches of what is due again, at most so many.
    fn due_batches(&mut self, now: Time, most: usize) -> Vec<(Source, Vec<Sample>)> {
        let mut batches: Vec<(Source, Vec<Sample>)> = Vec::new();
        for (place, sent) in self.sent.iter_mut().filter(|(_, sent)| sent.due <= now) {
            let source = place.source();
            let fits =
                |(of, samples): &(Source, Vec<Sample>)| *of == source && samples.len() < BATCH;
            if !batches.last().is_some_and(fits) {
                if batches.len() == most {
                    break;
                }
                batches.push((source, Vec::new()));
            }
            let Some((_, samples)) = batches.last_mut() else {
                break;
            };
            samples.push(sent.sample);
            sent.repeats = sent.repeats.saturating_add(1).min(REPEATS_SOON + DOUBLINGS);
            sent.due = now + REPEAT_AFTER * (1 << sent.repeats.saturating_sub(REPEATS_SOON));
        }
        batches
    }
}

fn place((boot, run): Source, sequence: u64) -> SampleKey {
    SampleKey {
        boot,
        run,
        sequence,
    }
}

/// Drops all of a source below a sequence.
fn drop_below<T>(places: &mut BTreeMap<SampleKey, T>, source: Source, below: u64) {
    while let Some(place) = places
        .range(place(source, 0)..place(source, below))
        .next()
        .map(|(place, _)| *place)
    {
        places.remove(&place);
    }
}
