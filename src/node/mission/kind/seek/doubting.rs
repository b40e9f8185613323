//! What it does when nothing is left to be looked at from where it can get to: it looks from near at what may bar the way
//! to more, waits for peers that bar the way to where it would, or ends.

use super::{MissionStep, Seek, Stage, UNSEEN_SHARE};
use crate::geom::Point;
use crate::node::mission::EndReason;
use crate::node::mission::doubts::{CloseLook, DoubtTry};
use crate::node::mission::terrain::{PathSearch, ReachedGround};

impl Seek {
    /// Nothing is left to be looked at from where it can get to: looks from near at what may bar the way to more, or ends.
    pub(super) fn doubt(
        &mut self,
        search: &PathSearch<'_>,
        reached: Option<ReachedGround>,
        claims: &[Vec<Point>],
    ) -> MissionStep {
        let reached = reached.or_else(|| search.reached_finely(claims));
        match self.doubts.toward_unseen(search, reached, claims) {
            // It chooses anew from there.
            Ok(DoubtTry::GoBack(route)) => MissionStep::GoAlong(route),
            Ok(DoubtTry::Look(look)) => self.look_closely(search, look),
            Err(unseen_share) if unseen_share > UNSEEN_SHARE => {
                match self.doubts.unseen_behind_peers(search, claims) {
                    Some(_) if self.peers_stay => MissionStep::End(EndReason::NoRoom),
                    Some(from) => self.wait_for_peers(from),
                    None => MissionStep::End(EndReason::ShutIn {
                        unseen_percent: (100.0 * unseen_share) as u8,
                    }),
                }
            }
            Err(_) => MissionStep::End(EndReason::Done),
        }
    }

    /// Waits until peers let it to where it would look from.
    pub(super) fn wait_for_peers(&mut self, from: Point) -> MissionStep {
        self.stage = Stage::Barred(from);
        MissionStep::YieldToPeers
    }

    pub(super) fn look_closely(&mut self, search: &PathSearch<'_>, look: CloseLook) -> MissionStep {
        let CloseLook { course, at } = look;
        self.stage = Stage::Doubting(at);
        self.peers_stay = false;
        match course {
            Some(course) => MissionStep::GoAlong(course),
            None => {
                self.doubts.note(self.settings.lattice, at, search.from());
                MissionStep::LookClosely(at)
            }
        }
    }
}
