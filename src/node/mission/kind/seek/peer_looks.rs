//! Looks of peers: who rests has looked along its heading. One that turns on the spot and rests again and again, all the while
//! toward where it says that it goes, looks at that closely. Their maps are shared, so what they have looked at in vain this
//! vehicle need not look at as well.
//!
//! Deliberately absent: what a look means, see [`LookHistory`](super::look_history::LookHistory) and
//! [`Doubts`](crate::node::mission::doubts::Doubts).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use crate::geom::{Angle, Point};
use crate::node::peers::{GoalPurpose, Peer, PeerGoal};
use crate::time::Time;

/// So many rests in a row at one place, toward one goal, are a close look.
const CLOSE_RESTS: u32 = 2;
/// Rests that are so near to each other are at one place, metres.
const SAME_PLACE_M: f64 = 0.15;
/// Who heads within this of its goal looks at it, radians: a close look sweeps over it.
const TOWARD_RAD: f64 = 0.5;

/// A look of a peer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct PeerLook {
    /// Where it stood.
    pub from: Point,
    /// Which way it looked.
    pub toward: Angle,
    /// What it has just looked at closely.
    pub closely: Option<Point>,
}

/// The last rest of each peer.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct PeerLooks {
    rests: BTreeMap<VehicleId, Rest>,
}

/// A rest of a peer.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Rest {
    /// Since when it does not move.
    since: Time,
    at: Point,
    /// Where its mission goes, if it heads there.
    toward: Option<Point>,
    /// Which in a row it is, at this place and toward this goal.
    count: u32,
}

impl PeerLooks {
    /// Takes a peer that rests for as long as a look takes; returns its look when that is a new one.
    pub(super) fn take(&mut self, now: Time, id: VehicleId, peer: &Peer) -> Option<PeerLook> {
        let last = self.rests.get(&id);
        if last.is_some_and(|last| last.since == peer.moved_at) {
            return None;
        }
        let looks_at = |goal: &PeerGoal| goal.purpose != GoalPurpose::Home && !goal.waits;
        let goal = peer.goal(now).filter(looks_at);
        let goal = goal.map(|goal| goal.at).filter(|goal| {
            let off = peer.at.angle_to(*goal) - peer.heading;
            off.radians().abs() <= TOWARD_RAD
        });
        let goes_on =
            |last: &&Rest| last.toward == goal && last.at.distance_to(peer.at) <= SAME_PLACE_M;
        let rest = Rest {
            since: peer.moved_at,
            at: peer.at,
            toward: goal,
            count: last.filter(goes_on).map_or(0, |last| last.count) + 1,
        };
        self.rests.insert(id, rest);
        Some(PeerLook {
            from: peer.at,
            toward: peer.heading,
            closely: goal.filter(|_| rest.count == CLOSE_RESTS),
        })
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{MissionPhase, MissionProgress, Position};

    use super::*;
    use crate::node::peers::Peers;
    use crate::node::tests_support::state;

    /// A peer that rests at a place since a second and says where it goes.
    fn resting(second: u32, x_m: f64, goal: Option<Point>) -> Peer {
        let now = Time::from_secs_f64(f64::from(second));
        let mut peers = Peers::new(VehicleId(1));
        peers.take(now, &state(2, x_m, 0.0));
        let said = MissionProgress {
            vehicle: VehicleId(2),
            boot: state(2, x_m, 0.0).boot,
            goal: goal.map(Position::from),
            phase: MissionPhase::Looking,
            ..MissionProgress::default()
        };
        peers.note_goal(now, &said);
        let (_, peer) = peers.iter().next().unwrap();
        peer.clone()
    }

    fn closely(peers: &[Peer]) -> Vec<Option<Point>> {
        let mut looks = PeerLooks::default();
        let look = |peer: &Peer| {
            looks
                .take(peer.heard_at, VehicleId(2), peer)
                .unwrap()
                .closely
        };
        peers.iter().map(look).collect()
    }

    #[test]
    fn who_rests_again_toward_one_goal_looks_at_it_closely_once() {
        let goal = Some(Point::new(1.0, 0.2));
        let rests = |xs_m: [f64; 4], goals: [Option<Point>; 4]| {
            let rests = xs_m.iter().zip(goals).zip(1..);
            let peers: Vec<Peer> = rests
                .map(|((x_m, goal), second)| resting(second, *x_m, goal))
                .collect();
            closely(&peers)
        };
        assert_eq!(rests([0.0; 4], [goal; 4]), [None, goal, None, None]);
        assert_eq!(rests([0.0, 0.3, 0.6, 0.9], [goal; 4]), [None; 4]);
        let other = Some(Point::new(1.0, -0.2));
        assert_eq!(
            rests([0.0; 4], [goal, other, other, goal]),
            [None, None, other, None]
        );
        let behind = Some(Point::new(-1.0, 0.0));
        assert_eq!(rests([0.0; 4], [behind; 4]), [None; 4]);
        assert_eq!(rests([0.0; 4], [None; 4]), [None; 4]);
    }

    #[test]
    fn a_rest_is_one_look() {
        let mut looks = PeerLooks::default();
        let peer = resting(1, 0.0, None);
        assert!(looks.take(peer.heard_at, VehicleId(2), &peer).is_some());
        assert_eq!(looks.take(peer.heard_at, VehicleId(2), &peer), None);
        assert!(looks.take(peer.heard_at, VehicleId(3), &peer).is_some());
    }
}
