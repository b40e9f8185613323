//! The way home: one vehicle after the other, lower ids first, as their states or their beacons tell. A vehicle that yields
//! to a lower id on its way steps back into the line, and so does one that is barred by peers that stand, or that refuses
//! every path: their turn comes early, and the known way is tried anew after them. Only when nobody moves any more it goes
//! through the unknown; and when that is in vain it steps aside, since those that bar its way may wait for it. Who would bar
//! the way of others once it is at home lets them go first, for a while; who bars it where it stands steps aside for them,
//! although it is at home.
//!
//! Here is decided what becomes of a return; a vehicle drives, and its goal changes, in [`super::Mission`].

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::goal::{Return, ReturnQueue, ReturnStage};
use super::home::WayHome;
use super::pilot::Unknown;
use crate::geom::Point;
use crate::node::peers::{Peer, Peers};
use crate::time::Time;

/// Before it returns, a vehicle waits until all lower ids have been quiet this long, for each of them.
const QUIET: Duration = Duration::from_secs(2);
/// Before it returns, it waits this long for what its peers say of where they go now.
const HEARS_IN: Duration = Duration::from_secs(1);
/// Higher ids are waited for only until they stand, and no longer than this: they may still follow plans.
const HIGHER_WITHIN: Duration = Duration::from_secs(60);
/// The same for a vehicle that has stepped back into the line: now they drive home.
const LATER_HIGHER_WITHIN: Duration = Duration::from_secs(180);
/// Lower ids that are not on their way home are waited for no longer than this: their missions may never end.
const LOWER_WITHIN: Duration = Duration::from_secs(300);
/// After a try in vain to get home, the next one follows no earlier than this.
const TRY_AGAIN: Duration = Duration::from_secs(3);
/// A vehicle that is barred by its peers goes through the unknown when none of them has moved for this long, and longer
/// the more there are.
const PATIENCE: Duration = Duration::from_secs(15);
/// Its patience ends after this long, even if they go on moving.
const PATIENCE_MAX: Duration = Duration::from_secs(300);
/// Those whom it would bar at home go first for this long in all, however often it tries.
const LETS_FIRST_MAX: Duration = Duration::from_secs(300);
/// Who lets others go first waits no longer than this until they stand: it may have to make room for them.
const LETS_MOVE_WITHIN: Duration = Duration::from_secs(20);
/// Who lets others go first makes more room for them when they have not come home after this long.
pub(super) const MORE_ROOM_AFTER: Duration = Duration::from_secs(60);
/// So many searches in vain, and another vehicle has its turn.
const FAILURES_MAX: u32 = 6;
/// Every so many tries the unknown is a resort, although a known way seems to be open.
const TRIES: u32 = 3;

/// A return, and what is looked at to decide how it goes on.
pub(super) struct Returning<'a> {
    pub now: Time,
    pub own: VehicleId,
    pub peers: &'a Peers,
    pub home: Return,
    /// It waits for nobody longer than it must.
    pub is_battery_low: bool,
}

/// What a vehicle does whose turn it is.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum ReturnDecision {
    /// It waits for those who bar its way.
    Waits(Return),
    /// It drives.
    Drives(Return, Unknown),
    /// It steps aside for them, by these corners: they may wait for it.
    StepsAside(Return, Vec<Point>),
}

/// Whether others that go home cannot get there because of this vehicle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Bars {
    /// All can.
    Nobody,
    /// Some cannot once this one is at home.
    AtHome,
    /// Nor can some as it stands, or it cannot from here once some of higher ids are at home.
    Here,
    /// Some cannot as it stands, and can once it is at home.
    HereAlone,
    /// Some cannot once this one is at home, all of higher ids, and it cannot from here once any of them is.
    EachOther,
}

impl Returning<'_> {
    /// Returns whether a vehicle in the queue may drive: all lower ids have been at rest, longer the more there are, and the
    /// higher ones stand; or it has waited long enough for those that do not. Lower ones that drive home go first in any case.
    pub(super) fn is_its_turn(&self, queue: &ReturnQueue) -> bool {
        let quiet = QUIET * self.lower().count() as u32;
        let mut higher = self.peers.iter().filter(|(id, _)| *id > self.own);
        let higher_stand = higher.all(|(_, peer)| peer.stands(self.now));
        let (lower_within, higher_within) = match (self.is_battery_low, queue.has_stepped_back) {
            (true, _) => (HIGHER_WITHIN, HIGHER_WITHIN),
            (false, true) => (LOWER_WITHIN, LATER_HIGHER_WITHIN),
            (false, false) => (LOWER_WITHIN, HIGHER_WITHIN),
        };
        let has_waited = |within: Duration| self.now.since(queue.since) > within;
        let lets_first = self.home.lets_first_since.is_some() && has_waited(LETS_MOVE_WITHIN);
        let lets_go = |peer: &Peer| {
            let is_endless = lets_first || (has_waited(lower_within) && !peer.goes_home(self.now));
            is_endless || peer.is_quiet(self.now, queue.since, quiet)
        };
        let has_heard =
            self.peers.iter().next().is_none() || self.now.since(queue.since) >= HEARS_IN;
        has_heard
            && queue.try_at <= self.now
            && self.lower().all(lets_go)
            && (higher_stand || lets_first || has_waited(higher_within))
    }

    /// Returns what a vehicle does whose turn it is, as the way home looks, and as it bars the ways of others: these are let go
    /// first, as long as it waits for them at all. `way_aside` looks for a place aside, the so many-th time in a row.
    pub(super) fn turn(
        &self,
        queue: &ReturnQueue,
        (way_home, bars): (WayHome, impl FnOnce() -> Bars),
        way_aside: impl FnOnce(u32) -> Option<Vec<Point>>,
    ) -> ReturnDecision {
        let others_move = self.peers.iter().any(|(_, peer)| !peer.stands(self.now));
        let presses_on = others_move || self.is_battery_low;
        let bars = match self.lets_others_first() {
            true => bars(),
            false => Bars::Nobody,
        };
        let goes = bars == Bars::HereAlone && way_home == WayHome::Open;
        if bars != Bars::Nobody && !goes {
            let since = self.home.lets_first_since.or(Some(self.now));
            let home = Return {
                lets_first_since: since,
                ..self.home
            };
            let lets_first = Returning { home, ..*self };
            let waits = || ReturnDecision::Waits(lets_first.waits_behind_peers(queue));
            let drives = || lets_first.drives(Unknown::LastResort, presses_on);
            return match bars {
                Bars::AtHome if lets_first.waits_long(queue) => {
                    lets_first.steps_aside(way_aside).unwrap_or_else(waits)
                }
                Bars::Nobody | Bars::AtHome => waits(),
                Bars::Here | Bars::HereAlone => {
                    lets_first.steps_aside(way_aside).unwrap_or_else(waits)
                }
                Bars::EachOther => lets_first.steps_aside(way_aside).unwrap_or_else(drives),
            };
        }
        match way_home {
            _ if presses_on => self.drives(Unknown::LastResort, presses_on),
            WayHome::Open if self.home.tries % TRIES != TRIES - 1 => {
                self.drives(Unknown::Barred, presses_on)
            }
            WayHome::BehindPeers if !self.has_waited(queue) => {
                ReturnDecision::Waits(self.waits_behind_peers(queue))
            }
            WayHome::BehindPeers if self.home.tries % 2 == 1 => self
                .steps_aside(way_aside)
                .unwrap_or_else(|| self.drives(Unknown::LastResort, presses_on)),
            WayHome::Open | WayHome::BehindPeers | WayHome::Unknown => {
                self.drives(Unknown::LastResort, presses_on)
            }
        }
    }

    /// Returns the return of a vehicle that is at home and bars others there, if it lets them go first.
    pub(super) fn lets_first_after_all(&self, bars: impl FnOnce() -> Bars) -> Option<Return> {
        (self.lets_others_first() && bars() != Bars::Nobody)
            .then(|| self.home.stepped_back(self.now, self.now))
    }

    /// Returns whether it has waited for so long that those whom it lets go first may need more room than it takes them to.
    fn waits_long(&self, queue: &ReturnQueue) -> bool {
        let is_long = |since: Time| self.now.since(since) >= MORE_ROOM_AFTER;
        queue.barred_since.is_some_and(is_long)
    }

    /// Returns whether it still lets those go first whom it would bar at home.
    fn lets_others_first(&self) -> bool {
        let is_over = |since: Time| self.now.since(since) >= LETS_FIRST_MAX;
        !self.is_battery_low
            && self.home.tries < FAILURES_MAX
            && !self.home.lets_first_since.is_some_and(is_over)
    }

    fn steps_aside(
        &self,
        way_aside: impl FnOnce(u32) -> Option<Vec<Point>>,
    ) -> Option<ReturnDecision> {
        let corners = way_aside(self.home.tries / 2 + 1)?;
        let stage = ReturnStage::UnderWay {
            bold_since: None,
            presses_on: false,
        };
        let home = Return { stage, ..self.home };
        Some(ReturnDecision::StepsAside(home, corners))
    }

    fn drives(&self, unknown: Unknown, presses_on: bool) -> ReturnDecision {
        let bold_since = (unknown == Unknown::LastResort).then_some(self.now);
        let stage = ReturnStage::UnderWay {
            bold_since,
            presses_on,
        };
        let home = Return { stage, ..self.home };
        ReturnDecision::Drives(home, unknown)
    }

    fn waits_behind_peers(&self, queue: &ReturnQueue) -> Return {
        let queue = ReturnQueue {
            barred_since: queue.barred_since.or(Some(self.now)),
            ..*queue
        };
        let home = Return {
            stage: ReturnStage::InQueue(queue),
            ..self.home
        };
        home.stepped_back(self.now, self.now + TRY_AGAIN)
    }

    /// Returns the return after a search in vain, or after a path that was blocked at once, when others have their turn by
    /// that; `failures` = how many there were in a row.
    pub(super) fn after_failures(&self, failures: u32) -> Option<Return> {
        self.gives_way(failures).then(|| self.tried_in_vain())
    }

    /// Returns the return after the vehicle has refused whatever path was found, when others have their turn by that.
    pub(super) fn after_refused_paths(&self) -> Option<Return> {
        (!self.is_battery_low).then(|| self.tried_in_vain())
    }

    /// Returns the return after a command was refused, or given up, for a peer, when that goes first: a lower id that drives.
    pub(super) fn after_refusal_for(&self, peer: VehicleId) -> Option<Return> {
        let drives = self.peers.get(peer).is_some_and(|peer| !peer.resting);
        let yields = self.home.is_under_way() && drives && peer < self.own;
        yields.then(|| self.stepped_back())
    }

    /// Returns the return after a vehicle has let the others have their turn.
    fn stepped_back(&self) -> Return {
        self.home.stepped_back(self.now, self.now + TRY_AGAIN)
    }

    /// Returns the return after a try in vain to get home: the others have their turn.
    fn tried_in_vain(&self) -> Return {
        Return {
            tries: self.home.tries + 1,
            ..self.stepped_back()
        }
    }

    /// Returns whether a vehicle gives way that has found no path on its way home, or only one that is blocked: others may
    /// have to move first. One that goes through the unknown goes on trying as long as none of them has moved.
    fn gives_way(&self, failures: u32) -> bool {
        let ReturnStage::UnderWay {
            bold_since,
            presses_on,
        } = self.home.stage
        else {
            return false;
        };
        let has_moved = |since: Time| self.peers.iter().any(|(_, peer)| peer.moved_at > since);
        failures >= FAILURES_MAX || (!presses_on && bold_since.is_none_or(has_moved))
    }

    /// Returns whether the peers that bar the way have had time enough.
    fn has_waited(&self, queue: &ReturnQueue) -> bool {
        let Some(barred_since) = queue.barred_since else {
            return false;
        };
        let heard = self
            .peers
            .iter()
            .filter(|(_, peer)| !peer.is_silent(self.now));
        let moved_at = heard.fold(barred_since, |latest, (_, peer)| latest.max(peer.moved_at));
        let count = self.peers.iter().count() + self.lower().count();
        self.now.since(moved_at) >= PATIENCE + QUIET * count as u32
            || self.now.since(barred_since) >= PATIENCE_MAX
    }

    fn lower(&self) -> impl Iterator<Item = &Peer> {
        self.peers
            .iter()
            .take_while(|(id, _)| *id < self.own)
            .map(|(_, peer)| peer)
    }
}

#[cfg(test)]
mod tests;
