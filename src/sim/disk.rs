//! The disk of a simulated vehicle: what it has measured and the ground may not have yet, by whose right it was ordered and
//! planned for, and which emergency stops it knows. It outlives a restart, never fails and takes no time.

use std::collections::BTreeMap;

use tomoswarm_proto::{Boot, OpenStops, RunId, Sample};

use crate::node::outbox::{CHUNK, Recalled, SampleKey};
use crate::node::{Remembered, VehicleMemory};

/// Samples by their places, and what must not be forgotten.
#[derive(Clone, Debug, Default)]
pub(super) struct Disk {
    kept: BTreeMap<SampleKey, Sample>,
    memory: VehicleMemory,
    stops: OpenStops,
}

impl Disk {
    /// Remembers this as well; returns how it stands then.
    pub(super) fn remember(&mut self, memory: VehicleMemory) -> Remembered {
        self.memory = self.memory.join(memory);
        Remembered {
            on_disk: self.memory,
            tried: self.memory,
        }
    }

    /// Returns all that was remembered.
    pub(super) fn memory(&self) -> VehicleMemory {
        self.memory
    }

    /// Keeps what emergency stops the vehicle knows.
    pub(super) fn keep_stops(&mut self, stops: OpenStops) {
        self.stops = stops;
    }

    /// Returns them.
    pub(super) fn stops(&self) -> OpenStops {
        self.stops.clone()
    }

    /// Keeps a sample.
    pub(super) fn keep(&mut self, boot: Boot, run: RunId, sample: Sample) {
        self.kept.insert(
            SampleKey {
                boot,
                run,
                sequence: sample.sequence,
            },
            sample,
        );
    }

    /// Forgets the samples of a boot and run below a sequence.
    pub(super) fn forget(&mut self, boot: Boot, run: RunId, below: u64) {
        let from = SampleKey {
            boot,
            run,
            sequence: 0,
        };
        let gone: Vec<SampleKey> = self
            .kept
            .range(
                from..SampleKey {
                    boot,
                    run,
                    sequence: below,
                },
            )
            .map(|(place, _)| *place)
            .collect();
        for place in gone {
            self.kept.remove(&place);
        }
    }

    /// Returns what is kept after a place.
    pub(super) fn recall(&self, after: Option<SampleKey>) -> Recalled {
        let beyond = |place: &SampleKey| after.is_none_or(|after| *place > after);
        let from = after.unwrap_or(SampleKey {
            boot: Boot(0),
            run: RunId(0),
            sequence: 0,
        });
        let mut left = self.kept.range(from..).filter(|(place, _)| beyond(place));
        let sample = |(place, sample): (&SampleKey, &Sample)| (place.boot, place.run, *sample);
        let samples = left.by_ref().take(CHUNK).map(sample).collect();
        Recalled {
            after,
            samples,
            is_end: left.next().is_none(),
        }
    }
}
