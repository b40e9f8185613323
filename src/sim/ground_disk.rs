//! The disk of a simulated ground station: what a live one's store holds of a run under way. It outlives a restart, never fails
//! and takes no time. Pictures are kept by the run's record.

use std::collections::BTreeMap;

use tomoswarm_proto::{LayerId, Message, OpenStops, Samples, TileAddress, TileReport};

use super::silence::HeardSeconds;
use crate::ground::from_config::GroundParts;
use crate::ground::station::{Station, StationMemory};
use crate::ground::{ActorSettings, MeasuredSample};
use crate::stops::StopsSettings;

/// What a ground station that is started anew goes on from.
#[derive(Clone, Debug, Default)]
pub(super) struct GroundDisk {
    /// Nothing is kept that nobody will read.
    is_read: bool,
    memory: Option<Box<StationMemory>>,
    stops: OpenStops,
    samples: Vec<Samples>,
    /// Kept always.
    heard: HeardSeconds,
    tiles: BTreeMap<(LayerId, TileAddress), TileReport>,
}

impl GroundDisk {
    /// Makes an empty one; `is_read` = the ground station will be started anew, or its samples are wanted.
    pub(super) fn new(is_read: bool) -> GroundDisk {
        GroundDisk {
            is_read,
            ..GroundDisk::default()
        }
    }

    /// Keeps what the station needs, in place of what it needed before.
    pub(super) fn remember(&mut self, memory: Box<StationMemory>) {
        self.memory = self.is_read.then_some(memory);
    }

    /// Keeps what emergency stops the ground station knows.
    pub(super) fn keep_stops(&mut self, stops: OpenStops) {
        self.stops = stops;
    }

    /// Keeps what a message brings of measurements and of the map.
    pub(super) fn keep(&mut self, message: &Message) {
        if let Message::Samples(batch) = message {
            self.heard.record(batch);
        }
        match message {
            _ if !self.is_read => {}
            Message::Samples(batch) => self.samples.push(batch.clone()),
            Message::Tile(tile) => {
                let place = (tile.layer, tile.address);
                if self
                    .tiles
                    .get(&place)
                    .is_none_or(|kept| kept.revision < tile.revision)
                {
                    self.tiles.insert(place, tile.clone());
                }
            }
            _ => {}
        }
    }

    /// Returns when beacons were heard, whether anything else is kept or not.
    pub(super) fn heard(&self) -> &HeardSeconds {
        &self.heard
    }

    /// Returns all samples, each once, in order.
    pub(super) fn samples(&self) -> Vec<MeasuredSample> {
        MeasuredSample::of_batches(self.samples.iter())
    }

    /// Returns what a ground station begins with that is started anew.
    pub(super) fn source(&self, parts: GroundParts) -> ActorSettings {
        let memory = self.memory.as_deref().cloned();
        let (samples, tiles) = (self.samples.iter().cloned(), self.tiles.values().cloned());
        let resumed = Station::restored(parts.station.clone(), memory, samples, tiles);
        let stops = StopsSettings {
            kept: self.stops.clone(),
            ..StopsSettings::default()
        };
        ActorSettings {
            parts,
            resumed: Some(resumed),
            stops,
        }
    }
}
