//! The map of all vehicles, merged, and its repair: what is missing of it is asked for, and what others miss is sent. The
//! station draws nothing in it itself.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Digest, Message, TileReport, TileRequest};

use crate::geom::Lattice;
use crate::map::{JoinResult, Merged, Repair};
use crate::time::Time;

/// The merged map, kept in repair.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct FleetMap {
    merged: Merged,
    repair: Repair,
    /// How often a tile has changed it.
    changes: u64,
}

impl FleetMap {
    /// Makes an empty map.
    pub(super) fn new(lattice: Lattice) -> FleetMap {
        FleetMap {
            merged: Merged::new(lattice, None),
            repair: Repair::new(None),
            changes: 0,
        }
    }

    /// Returns the merged map.
    pub(super) fn merged(&self) -> &Merged {
        &self.merged
    }

    /// Returns how often a tile has changed the map.
    pub(super) fn changes(&self) -> u64 {
        self.changes
    }

    /// Takes a tile. One that cannot be joined changes nothing; its sender keeps it, and repeats it.
    pub(super) fn join(&mut self, now: Time, tile: &TileReport) {
        let joined = self.merged.join(tile);
        self.changes += u64::from(joined.is_ok_and(|joined| joined != JoinResult::Known));
        self.repair.pass(now, &self.merged, tile);
    }

    /// Takes what another node holds.
    pub(super) fn hear_digest(&mut self, now: Time, digest: &Digest) {
        self.repair.hear_digest(now, &self.merged, digest);
    }

    /// Takes what another node asks for.
    pub(super) fn hear_want(&mut self, now: Time, want: &TileRequest) {
        self.repair.hear_want(now, &self.merged, want);
    }

    /// Asks for what is missing, and sends what others miss, as far as that is due.
    pub(super) fn mend(&mut self, now: Time) -> impl Iterator<Item = Message> + use<> {
        let mut messages = Vec::new();
        self.repair.wake(now, &self.merged, &mut messages);
        messages.into_iter()
    }

    /// Returns when something is to be asked for or sent.
    pub(super) fn deadline(&self) -> Option<Time> {
        self.repair.deadline()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::time::Duration;

    use super::*;
    use tomoswarm_proto::{Boot, LayerId, TILE_CELLS, TileAddress, VehicleId};

    fn tile(revision: u32) -> TileReport {
        TileReport {
            layer: LayerId {
                vehicle: VehicleId(1),
                boot: Boot(1),
            },
            address: TileAddress {
                slice: 0,
                x: 0,
                y: 0,
            },
            revision,
            cells: Arc::new([-17; TILE_CELLS]),
        }
    }

    fn at(at_ms: u64) -> Time {
        Time::ZERO + Duration::from_millis(at_ms)
    }

    /// Everything that a map asks for and sends within a second.
    fn published(map: &mut FleetMap) -> Vec<Message> {
        let mut out = Vec::new();
        while let Some(now) = map.deadline().filter(|deadline| *deadline < at(2000)) {
            out.extend(map.mend(now));
        }
        out
    }

    #[test]
    fn one_map_asks_another_for_what_it_lacks_and_gets_it() {
        let lattice = Lattice::new(0.2);
        let (mut full, mut empty) = (FleetMap::new(lattice), FleetMap::new(lattice));
        full.join(at(0), &tile(1));
        empty.hear_digest(at(1000), &full.merged().digest());
        let wants = published(&mut empty);
        let [Message::Want(want)] = &wants[..] else {
            panic!("{wants:?}");
        };
        full.hear_want(at(1500), want);
        let sent = published(&mut full);
        assert_eq!(sent, [Message::Tile(tile(1))]);
        empty.join(at(2000), &tile(1));
        assert_eq!(empty.merged(), full.merged());
    }

    #[test]
    fn a_tile_that_cannot_be_joined_changes_nothing() {
        let mut map = FleetMap::new(Lattice::new(0.2));
        map.join(at(0), &tile(1));
        let before = map.merged().clone();
        map.join(at(1), &tile(u32::MAX));
        assert_eq!(*map.merged(), before);
    }
}
