//! The way home: one vehicle after the other, lower ids first.

use std::time::Duration;

use super::{Mission, Out, Remark, Wanted};
use crate::time::Time;

/// Before it returns, a vehicle waits until all lower ids have been quiet this long, for each of them.
const QUIET: Duration = Duration::from_secs(2);

impl Mission {
    pub(super) fn bring_home(&mut self, now: Time, since: Time, under_way: bool, out: &mut Vec<Out>) {
        let Some(state) = &self.state else { return };
        if !under_way {
            if state.leg.is_none() && self.lower_ids_are_quiet(now, since) {
                self.pilot.go_home(now, state);
                self.wanted = Wanted::Returning { since, under_way: true };
            }
            return;
        }
        self.drive(now, out);
        if self.pilot.way().is_empty() {
            self.wanted = Wanted::Waiting;
            out.push(Out::Remark(Remark::Home));
        }
    }

    /// Vehicles return one after the other: all lower ids have been at rest, longer the more there are.
    fn lower_ids_are_quiet(&self, now: Time, ordered: Time) -> bool {
        let own = self.settings.vehicle;
        let lower = || self.peers.iter().take_while(|(id, _)| *id < own).map(|(_, peer)| peer);
        let quiet = QUIET * lower().count() as u32;
        lower().all(|peer| peer.resting && now.since(peer.moved_at.max(ordered)) >= quiet)
    }
}
