//! Peers are in the way, and nothing else is to be done: wait, and after a while step aside, the highest id first, so
//! that of two that bar each other's way one makes room.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use crate::geom::{Cell, Lattice, Point};
use crate::node::mission::terrain::RULES;
use crate::node::peers::Peers;
use crate::plan::{Distances, SearchGrid};

/// After so many waits in a row the mission is given up.
const WAITS_MAX: u32 = 90;
/// So many waits before the highest id steps aside, and so many more for every higher id that is there.
const PATIENCE: u32 = 2;
const PATIENCE_MORE: u32 = 2;
/// The longest way aside, metres.
const WAY_M: f64 = 8.0;
/// Beyond this distance more room between peers is worth nothing, metres.
const ROOM_M: f64 = 6.0;
/// What a metre of way must be worth in metres of room.
const WORTH: f64 = 0.15;
/// So much more room than here a place aside must have, metres.
const GAIN_M: f64 = 0.5;

/// What to do about peers that are in the way.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Yield {
    /// Wait for a while.
    Wait,
    /// Step aside if there is room, otherwise wait.
    StepAside,
    /// They have not made room for so long that they never will.
    InVain,
}

/// Waits for peers in a row.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct YieldToPeers {
    waits: u32,
}

impl YieldToPeers {
    /// Returns what to do now that peers are in the way of a vehicle once more.
    pub(super) fn once_more(&mut self, own: VehicleId, peers: &Peers) -> Yield {
        self.waits += 1;
        let higher = peers.iter().filter(|(id, _)| *id > own).count() as u32;
        match self.waits {
            WAITS_MAX.. => Yield::InVain,
            waits if waits.is_multiple_of(PATIENCE + PATIENCE_MORE * higher) => Yield::StepAside,
            _ => Yield::Wait,
        }
    }

    /// Returns how many waits there were in a row.
    pub(super) fn in_a_row(&self) -> u32 {
        self.waits
    }

    /// Ends the row: something else is done.
    pub(super) fn end(&mut self) {
        self.waits = 0;
    }
}

/// Returns the corners of a way to where the peers are farther away than from here; `None` when there is none near by
/// that is worth it.
pub(super) fn way_aside(
    grid: &SearchGrid,
    lattice: Lattice,
    from: Point,
    peers: &Peers,
) -> Option<Vec<Point>> {
    let reached = Distances::from_start(grid, lattice.cell_at(from), &RULES).ok()?;
    let room_m = |at: Point| {
        let distances = peers.iter().map(|(_, peer)| peer.at.distance_to(at));
        distances.fold(ROOM_M, f64::min)
    };
    let worth = |cell: Cell| {
        let way_m = reached.cost_m(cell).filter(|way_m| *way_m <= WAY_M)?;
        Some((room_m(lattice.centre(cell)) - WORTH * way_m, cell))
    };
    let best = grid
        .area()
        .cells()
        .filter_map(worth)
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    let to = lattice.centre(best.1);
    (best.0 > room_m(from) + GAIN_M)
        .then(|| reached.route_to(grid, from, to))
        .flatten()
        .map(|route| route.points[1..].to_vec())
}
