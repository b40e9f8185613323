//! The way home: one vehicle after the other, lower ids first, as their states or their beacons tell. Who yields to a
//! lower id on its way steps back into the line, and so does who is barred by peers that stand, or whose vehicle refuses
//! every path: their turn comes early, and the known way is tried anew after them. Only when nobody moves any more it goes through the unknown.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::goal::{Goal, Return, ReturnQueue, ReturnStage};
use super::pilot::{Unknown, WayHome};
use super::{AutonomyCause, Mission, MissionEvent, Out};
use crate::node::peers::Peer;
use crate::time::Time;

/// Before it returns, a vehicle waits until all lower ids have been quiet this long, for each of them.
const QUIET: Duration = Duration::from_secs(2);
/// Higher ids are waited for only until they stand, and no longer than this: they may still follow plans.
const HIGHER_WITHIN: Duration = Duration::from_secs(60);
/// The same for a vehicle that has stepped back into the line: now they drive home.
const LATER_HIGHER_WITHIN: Duration = Duration::from_secs(180);
/// After a try in vain to get home, the next one follows no earlier than this.
const TRY_AGAIN: Duration = Duration::from_secs(3);
/// A vehicle that is barred by its peers goes through the unknown when none of them has moved for this long, and longer
/// the more there are.
const PATIENCE: Duration = Duration::from_secs(15);
/// Its patience ends after this long, even if they go on moving.
const PATIENCE_MAX: Duration = Duration::from_secs(300);
/// So many searches in vain, and another vehicle has its turn.
const FAILURES_MAX: u32 = 6;
/// Every so many tries the unknown is a resort, although a known way seems to be open.
const TRIES: u32 = 3;

impl Mission {
    pub(super) fn bring_home(&mut self, now: Time, home: Return, out: &mut Vec<Out>) {
        match home.stage {
            ReturnStage::InQueue(queue) => self.wait_in_queue(now, home, queue),
            ReturnStage::UnderWay { .. } => self.drive_home(now, home, out),
        }
    }

    fn wait_in_queue(&mut self, now: Time, home: Return, queue: ReturnQueue) {
        let rests = self.state.as_ref().is_some_and(|state| state.leg.is_none());
        if rests && queue.try_at <= now && self.is_its_turn(now, &queue) {
            self.take_turn(now, home, queue);
        }
    }

    fn drive_home(&mut self, now: Time, home: Return, out: &mut Vec<Out>) {
        if self.state.is_none() {
            return;
        }
        self.drive(now, out);
        if self.pilot.way().is_empty() {
            self.goal = Goal::Home(home.by);
            out.push(Out::MissionEvent(MissionEvent::Home));
        } else if self.pilot.is_refused() && !self.is_low() {
            self.try_in_vain(now);
        }
    }

    /// Begins to drive home, or waits for those who bar the way.
    fn take_turn(&mut self, now: Time, home: Return, queue: ReturnQueue) {
        let Some(state) = &self.state else { return };
        let standing = self
            .peers
            .iter()
            .filter(|(_, peer)| peer.resting || peer.is_silent(now));
        self.pilot
            .keep_clear_of(standing.map(|(_, peer)| peer.claim.clone()).collect());
        let others_move = self
            .peers
            .iter()
            .any(|(_, peer)| !peer.resting && !peer.is_silent(now));
        let presses_on = others_move || self.is_low();
        let unknown = match self.pilot.way_home(now, state) {
            _ if presses_on => Unknown::LastResort,
            WayHome::Open if home.tries % TRIES != TRIES - 1 => Unknown::Barred,
            WayHome::BehindPeers if !self.has_waited(now, &queue) => {
                let barred_since = queue.barred_since.or(Some(now));
                let stage = ReturnStage::InQueue(ReturnQueue {
                    barred_since,
                    ..queue
                });
                self.goal = Goal::Returning(Return { stage, ..home });
                return self.step_back(now);
            }
            WayHome::Open | WayHome::BehindPeers | WayHome::Unknown => Unknown::LastResort,
        };
        self.pilot.go_home(now, state, unknown);
        self.plan.leave();
        let bold_since = (unknown == Unknown::LastResort).then_some(now);
        let stage = ReturnStage::UnderWay {
            bold_since,
            presses_on,
        };
        self.goal = Goal::Returning(Return { stage, ..home });
    }

    /// Lets the others have their turn.
    fn step_back(&mut self, now: Time) {
        if let Goal::Returning(home) = &mut self.goal {
            *home = home.stepped_back(now, now + TRY_AGAIN);
        }
    }

    /// Counts a try to get home, and lets the others have their turn.
    fn try_in_vain(&mut self, now: Time) {
        if let Goal::Returning(home) = &mut self.goal {
            home.tries += 1;
        }
        self.step_back(now);
    }

    /// On the way home no path was found, or the one found is blocked: others may have to move first. A vehicle that goes
    /// through the unknown goes on trying as long as none of them has moved.
    pub(super) fn finds_no_way_home(&mut self, now: Time, failures: u32) {
        let Goal::Returning(Return {
            stage:
                ReturnStage::UnderWay {
                    bold_since,
                    presses_on,
                },
            ..
        }) = self.goal
        else {
            return;
        };
        let has_moved = |since: Time| self.peers.iter().any(|(_, peer)| peer.moved_at > since);
        let gives_way = !presses_on && bold_since.is_none_or(has_moved);
        if failures >= FAILURES_MAX || gives_way {
            self.try_in_vain(now);
        }
    }

    /// Returns whether the peers that bar the way have had time enough.
    fn has_waited(&self, now: Time, queue: &ReturnQueue) -> bool {
        let Some(barred_since) = queue.barred_since else {
            return false;
        };
        let heard = self.peers.iter().filter(|(_, peer)| !peer.is_silent(now));
        let moved_at = heard.fold(barred_since, |latest, (_, peer)| latest.max(peer.moved_at));
        let count = self.peers.iter().count() + self.lower().count();
        now.since(moved_at) >= PATIENCE + QUIET * count as u32
            || now.since(barred_since) >= PATIENCE_MAX
    }

    fn is_low(&self) -> bool {
        self.goal.cause() == Some(AutonomyCause::BatteryLow)
    }

    fn lower(&self) -> impl Iterator<Item = &Peer> {
        self.peers
            .iter()
            .take_while(|(id, _)| *id < self.settings.vehicle)
            .map(|(_, peer)| peer)
    }

    /// Vehicles return one after the other: all lower ids have been at rest, longer the more there are, and the
    /// higher ones stand.
    fn is_its_turn(&self, now: Time, queue: &ReturnQueue) -> bool {
        let since = queue.since;
        let quiet = QUIET * self.lower().count() as u32;
        let mut higher = self
            .peers
            .iter()
            .filter(|(id, _)| *id > self.settings.vehicle);
        let higher_stand = higher.all(|(_, peer)| peer.resting || peer.is_silent(now));
        let is_later = queue.has_stepped_back && !self.is_low();
        let within = if is_later {
            LATER_HIGHER_WITHIN
        } else {
            HIGHER_WITHIN
        };
        self.lower().all(|peer| peer.is_quiet(now, since, quiet))
            && (higher_stand || now.since(since) > within)
    }

    /// A command was refused, or given up, for a peer: when that is a lower id that drives, it goes first.
    pub(super) fn yields_to(&mut self, now: Time, peer: VehicleId) {
        let drives = self.peers.get(peer).is_some_and(|peer| !peer.resting);
        if self.goal.drives_home() && drives && peer < self.settings.vehicle {
            self.step_back(now);
        }
    }
}
