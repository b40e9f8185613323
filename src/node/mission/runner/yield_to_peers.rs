//! Peers are in the way, and nothing else is to be done: wait, and after a while step aside, the highest id first, so
//! that of two that bar each other's way one makes room. Who stands on nobody's way waits longer before it steps aside: of
//! vehicles that wait for each other in a ring each one stands on the way of another.
//!
//! A place aside is off the ways of the others as far as they say where they are going. Their true ways may not be straight:
//! who steps aside again and again in vain keeps farther and farther away from them.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use crate::geom::{Cell, Point, Segment};
use crate::node::mission::terrain::RULES;
use crate::node::peers::{Peer, Peers};
use crate::plan::{Distances, SearchGrid};
use crate::time::Time;

/// After so many waits in a row the mission is given up.
const WAITS_MAX: u32 = 90;
/// So many waits before the highest id steps aside, and so many more for every higher id that is there.
const PATIENCE: u32 = 2;
const PATIENCE_MORE: u32 = 2;
/// Who stands on nobody's way waits so many times longer.
const PATIENCE_BESIDE: u32 = 4;
/// The vehicle gets on when it has come so much nearer to where it goes than it ever was, metres.
const GETS_ON_M: f64 = 0.5;
/// The longest way aside, metres.
const WAY_M: f64 = 8.0;
/// Beyond this distance more room between peers is worth nothing, metres.
const ROOM_M: f64 = 6.0;
/// The same from ways that are known, in separations; and so much more for every time that it has stepped aside in a row.
const ROOM_TO_WAY: f64 = 1.5;
/// Off the way of a peer is who keeps so many separations from it.
const OFF: f64 = 1.2;
/// What a metre of way must be worth in metres of room.
const WORTH: f64 = 0.15;
/// So much more room than here a place aside must have, metres.
const GAIN_M: f64 = 0.3;

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

/// Where a peer is, and where it wants to go from there: straight, as far as anybody knows.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct PeerWay {
    way: Segment,
    is_known: bool,
    separation_m: f64,
}

impl PeerWay {
    /// Makes the way of a peer; one that is not heard goes nowhere.
    pub(super) fn of(peer: &Peer, now: Time, separation_m: f64) -> PeerWay {
        let goal = peer.goal.filter(|_| !peer.is_silent(now));
        PeerWay {
            way: Segment::new(peer.at, goal.map_or(peer.at, |goal| goal.at)),
            is_known: goal.is_some(),
            separation_m,
        }
    }

    /// Returns whether a vehicle that stands at a place is in the way, or may be.
    pub(super) fn is_barred_from(&self, place: Point) -> bool {
        self.way.distance_to_point(place) < OFF * self.separation_m
    }
}

/// Who yields, and where.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Turn {
    /// The vehicle.
    pub own: VehicleId,
    /// How far it is from where it goes, metres.
    pub left_m: f64,
    /// Whether it stands on the way of a peer.
    pub is_in_the_way: bool,
}

/// Waits for peers in a row.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct YieldToPeers {
    waits: u32,
    /// The nearest that it has come to where it goes, metres.
    nearest_m: Option<f64>,
    /// How often it was to step aside in this row.
    asides: u32,
}

impl YieldToPeers {
    /// Returns what to do now that peers are in the way of a vehicle once more.
    pub(super) fn once_more(&mut self, turn: &Turn, peers: &Peers) -> Yield {
        self.waits += 1;
        self.nearest_m.get_or_insert(turn.left_m);
        let higher = peers.iter().filter(|(id, _)| *id > turn.own).count() as u32;
        let patience = PATIENCE + PATIENCE_MORE * higher;
        let patience = match turn.is_in_the_way {
            true => patience,
            false => patience * PATIENCE_BESIDE,
        };
        match self.waits {
            WAITS_MAX.. => Yield::InVain,
            waits if waits.is_multiple_of(patience) => {
                self.asides += 1;
                Yield::StepAside
            }
            _ => Yield::Wait,
        }
    }

    /// Returns how many waits there were in a row.
    pub(super) fn in_a_row(&self) -> u32 {
        self.waits
    }

    /// Records how far the vehicle that is on its way is from where it goes, metres: one that gets on begins a new row.
    pub(super) fn drive(&mut self, left_m: f64) {
        let gets_on = |nearest_m: f64| left_m < nearest_m - GETS_ON_M;
        if self.nearest_m.is_some_and(gets_on) {
            (self.waits, self.asides) = (0, 0);
            self.nearest_m = Some(left_m);
        }
    }

    /// Ends the row: something else is done.
    pub(super) fn end(&mut self) {
        *self = YieldToPeers::default();
    }

    /// Returns up to which distance room between the vehicle and peers on these ways is worth something, metres.
    pub(super) fn room_m(&self, ways: &[PeerWay]) -> f64 {
        let known = ways.iter().filter(|way| way.is_known);
        let to_ways =
            known.map(|way| ROOM_TO_WAY * way.separation_m * f64::from(self.asides.max(1)));
        match ways.iter().all(|way| way.is_known) {
            true => to_ways.fold(0.0, f64::max).min(ROOM_M),
            false => ROOM_M,
        }
    }
}

/// Returns the corners of a way to where the peers and their ways are farther away than from here, up to so far; `None` when
/// there is none near by that is worth it.
pub(super) fn way_aside(
    grid: &SearchGrid,
    from: Point,
    ways: &[PeerWay],
    enough_m: f64,
) -> Option<Vec<Point>> {
    let lattice = grid.lattice();
    let reached = Distances::from_start(grid, lattice.cell_at(from), &RULES).ok()?;
    let room_m = |at: Point| {
        let distances = ways.iter().map(|one| one.way.distance_to_point(at));
        distances.fold(enough_m, f64::min)
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
