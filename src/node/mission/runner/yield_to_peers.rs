//! Peers are in the way, and nothing else is to be done: wait, and after a while step aside, the highest id first, so
//! that of two that bar each other's way one makes room. Who stands on nobody's way waits longer before it steps aside: of
//! vehicles that wait for each other in a ring each one stands on the way of another.
//!
//! A place aside is off the ways of the others as far as they say where they are going. Their true ways may not be straight:
//! who steps aside again and again in vain keeps farther and farther away from them.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use crate::node::mission::aside::{PeerWay, enough_m};
use crate::node::peers::Peers;

/// After so many waits in a row the mission is given up.
const WAITS_MAX: u32 = 90;
/// So many waits before the highest id steps aside, and so many more for every higher id that is there.
const PATIENCE: u32 = 2;
const PATIENCE_MORE: u32 = 2;
/// Who stands on nobody's way waits so many times longer.
const PATIENCE_BESIDE: u32 = 4;
/// The vehicle gets on when it has come so much nearer to where it goes than it ever was, metres.
const GETS_ON_M: f64 = 0.5;

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
    pub(super) fn room_m<'a>(&self, ways: impl Iterator<Item = &'a PeerWay>) -> f64 {
        enough_m(ways, self.asides)
    }
}
