//! Where the other vehicles are and what way they claim, as each of the actors needs it: the newest state of each,
//! however the network has shuffled them. What is done about them is decided elsewhere.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, Mode, State, VehicleId};

use crate::geom::Point;
use crate::time::Time;

/// One other vehicle, by its newest state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Peer {
    /// Start of its software, and which of its states this is.
    edition: (Boot, u64),
    /// Where it is.
    pub at: Point,
    /// Standard deviation of each coordinate, metres.
    pub sd_m: f64,
    /// Where it is, then the corners of the leg that it is committed to.
    pub claim: Vec<Point>,
    /// Whether it neither moves nor is about to.
    pub resting: bool,
    /// When it was last heard to move, or first heard.
    pub moved_at: Time,
}

/// All other vehicles heard so far.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Peers {
    own: VehicleId,
    newest: BTreeMap<VehicleId, Peer>,
}

impl Peers {
    /// Makes the table of a vehicle that has heard no other yet.
    pub fn new(own: VehicleId) -> Peers {
        Peers { own, newest: BTreeMap::new() }
    }

    /// Takes a state; the own one, and one older than the newest known, changes nothing.
    pub fn take(&mut self, now: Time, state: &State) {
        let known = self.newest.get(&state.vehicle);
        if state.vehicle == self.own || known.is_some_and(|known| known.edition >= edition(state)) {
            return;
        }
        let resting = state.leg.is_none() && !matches!(state.mode, Mode::Driving | Mode::Turning);
        let moved_at = known.filter(|_| resting).map_or(now, |known| known.moved_at);
        let at = Point::from(state.pose.at);
        let leg = state.leg.iter().flat_map(|leg| leg.route.iter().map(|corner| Point::from(*corner)));
        let claim = std::iter::once(at).chain(leg).collect();
        let peer = Peer { edition: edition(state), at, sd_m: state.pose.sd_m, claim, resting, moved_at };
        self.newest.insert(state.vehicle, peer);
    }

    /// Gives the others, ascending.
    pub fn iter(&self) -> impl Iterator<Item = (VehicleId, &Peer)> {
        self.newest.iter().map(|(id, peer)| (*id, peer))
    }
}

/// Joins two unread states of one vehicle: states may overtake each other, the newest stays.
pub(super) fn join_states(unread: State, newer: State) -> State {
    if edition(&unread) > edition(&newer) { unread } else { newer }
}

fn edition(state: &State) -> (Boot, u64) {
    (state.boot, state.sequence)
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::state;
    use super::*;

    #[test]
    fn a_state_that_was_overtaken_changes_nothing() {
        let mut peers = Peers::new(VehicleId(1));
        let driving = State { mode: Mode::Driving, sequence: 6, ..state(2, 3.0, 0.0) };
        peers.take(Time::from_secs_f64(2.0), &driving);
        peers.take(Time::from_secs_f64(3.0), &State { sequence: 5, ..state(2, 0.0, 0.0) });
        let (_, peer) = peers.iter().next().unwrap();
        assert!(!peer.resting);
        assert_eq!((peer.at, peer.moved_at), (Point::new(3.0, 0.0), Time::from_secs_f64(2.0)));
        peers.take(Time::from_secs_f64(4.0), &State { boot: Boot(2), sequence: 1, ..state(2, 4.0, 0.0) });
        assert_eq!(peers.iter().next().unwrap().1.at, Point::new(4.0, 0.0), "a restart counts anew");
    }

    #[test]
    fn the_own_state_is_no_peer() {
        let mut peers = Peers::new(VehicleId(1));
        peers.take(Time::ZERO, &state(1, 0.0, 0.0));
        assert_eq!(peers.iter().count(), 0);
    }
}
