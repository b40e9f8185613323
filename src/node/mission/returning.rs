//! The way home: one vehicle after the other, lower ids first, as their states or their beacons tell. Who yields to a
//! lower id on its way steps back into the line.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::{Mission, Out, Remark, Wanted};
use crate::time::Time;

/// Before it returns, a vehicle waits until all lower ids have been quiet this long, for each of them.
const QUIET: Duration = Duration::from_secs(2);
/// Higher ids are waited for only until they stand, and no longer than this: they may still follow plans.
const HIGHER_WITHIN: Duration = Duration::from_secs(60);

impl Mission {
    pub(super) fn bring_home(&mut self, now: Time, since: Time, under_way: bool, out: &mut Vec<Out>) {
        let Some(state) = &self.state else { return };
        if !under_way {
            if state.leg.is_none() && self.is_its_turn(now, since) {
                self.pilot.go_home(now, state);
                self.is_off_plan = true;
                self.wanted = Wanted::Returning { since, under_way: true };
            }
            return;
        }
        self.drive(now, out);
        if self.pilot.way().is_empty() {
            self.wanted = Wanted::Home;
            out.push(Out::Remark(Remark::Home));
        }
    }

    /// Vehicles return one after the other: all lower ids have been at rest, longer the more there are, and the
    /// higher ones stand.
    fn is_its_turn(&self, now: Time, ordered: Time) -> bool {
        let own = self.settings.vehicle;
        let lower = || self.peers.iter().take_while(|(id, _)| *id < own).map(|(_, peer)| peer);
        let quiet = QUIET * lower().count() as u32;
        let mut higher = self.peers.iter().filter(|(id, _)| *id > own).map(|(_, peer)| peer);
        let higher_stand = higher.all(|peer| peer.resting || peer.is_silent(now));
        lower().all(|peer| peer.is_quiet(now, ordered, quiet))
            && (higher_stand || now.since(ordered) > HIGHER_WITHIN)
    }

    /// A command was refused, or given up, for a peer: when that is a lower id that drives, it goes first.
    pub(super) fn yields_to(&mut self, peer: VehicleId) {
        let drives = self.peers.get(peer).is_some_and(|peer| !peer.resting);
        if let Wanted::Returning { since, under_way: true } = self.wanted
            && drives
            && peer < self.settings.vehicle
        {
            self.wanted = Wanted::Returning { since, under_way: false };
        }
    }
}
