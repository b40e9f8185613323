//! What it does when nothing is left to be looked at from where it can get to: it looks from near at what may bar the way
//! to more, waits for peers that bar the way to where it would, or ends.

use super::{MissionStep, PEERS_STAY, Seek, Stage, UNSEEN_SHARE};
use crate::geom::Point;
use crate::node::mission::EndReason;
use crate::node::mission::doubts::{BehindPeers, CloseLook, DoubtTry};
use crate::node::mission::terrain::{PathSearch, ReachedGround};
use crate::time::Time;

impl Seek {
    /// Nothing is left to be looked at from where it can get to: looks from near at what may bar the way to more, or ends. `gone`
    /// is what those claim for whom nobody waits.
    pub(super) fn doubt(
        &mut self,
        now: Time,
        search: &PathSearch<'_>,
        reached: Option<ReachedGround>,
        (claims, gone): (&[Vec<Point>], &[Vec<Point>]),
    ) -> MissionStep {
        let reached = reached.or_else(|| search.reached_finely(claims));
        match self.doubts.toward_unseen(search, reached, claims) {
            // It chooses anew from there.
            Ok(DoubtTry::GoBack(route)) => MissionStep::GoAlong(route),
            Ok(DoubtTry::Look(look)) => self.look_closely(search, look),
            Err(unseen_share) if unseen_share > UNSEEN_SHARE => {
                let peers_stay = self.peers_stay(now);
                match self.doubts.unseen_behind_peers(search, claims, gone) {
                    Some(BehindPeers { from, may_go: true }) if !peers_stay => {
                        self.wait_for_peers(from)
                    }
                    Some(_) => MissionStep::End(EndReason::NoRoom),
                    None => MissionStep::End(EndReason::ShutIn {
                        unseen_percent: (100.0 * unseen_share) as u8,
                    }),
                }
            }
            Err(_) => MissionStep::End(EndReason::Done),
        }
    }

    /// Returns whether peers that bar its way are taken to stay: it waited for them in vain not long ago.
    pub(super) fn peers_stay(&self, now: Time) -> bool {
        self.waited_in_vain
            .is_some_and(|since| now.since(since) < PEERS_STAY)
    }

    /// Waits until peers let it to where it would look from.
    pub(super) fn wait_for_peers(&mut self, from: Point) -> MissionStep {
        self.stage = Stage::Barred(from);
        MissionStep::YieldToPeers
    }

    pub(super) fn look_closely(&mut self, search: &PathSearch<'_>, look: CloseLook) -> MissionStep {
        let CloseLook { course, at } = look;
        self.stage = Stage::Doubting(at);
        match course {
            Some(course) => MissionStep::GoAlong(course),
            None => {
                self.doubts.note(self.settings.lattice, at, search.from());
                MissionStep::LookClosely(at)
            }
        }
    }
}
