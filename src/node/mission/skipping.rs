//! Which stops are given up since they cannot be reached, so that nobody waits for them for ever.

use tomoswarm_proto::Stop;

use super::{Mission, Out, Remark, Wanted};
use crate::geom::Point;
use crate::time::Time;

/// So many stops at the end of a plan may be given up although nothing behind them can be reached.
const LAST_STOPS: usize = 4;
/// So many stops in a row may be given up: beyond that the ring is closed off.
const SKIPS_MAX: u32 = 16;
/// So many stops behind those entered are tried before one is given up.
const LOOK_STOPS: usize = 8;

impl Mission {
    /// Gives up the next stop when neither it nor another one that may be entered can be reached, but one behind
    /// them can: the others wait for this vehicle, and it would wait for them.
    pub(super) fn give_up_stop(&mut self, now: Time, out: &mut Vec<Out>) {
        let (Some(state), Wanted::Following) = (&self.state, self.wanted) else { return };
        let behind = self.stops_behind();
        let reach = |stop: &Stop| self.pilot.can_reach(now, state, stop.at.into());
        let is_end = behind.is_empty() && self.pilot.way().stops().count() <= LAST_STOPS;
        if self.skips >= SKIPS_MAX || (!is_end && !behind.iter().take(LOOK_STOPS).any(reach)) {
            return;
        }
        let place = Point::from(state.pose.at);
        self.skips += 1;
        for stop in self.pilot.skip(place) {
            out.push(Out::Remark(Remark::Skipped(stop)));
            self.done(now, stop, place);
        }
    }

    /// The stops of the plan behind those that are entered.
    fn stops_behind(&self) -> &[Stop] {
        let Some(follower) = &self.follower else { return &[] };
        let stops = follower.plan().map_or(&[][..], |plan| &plan.stops);
        let last = follower.entered().last().map(|stop| stop.id);
        let entered = stops.iter().position(|stop| Some(stop.id) == last);
        entered.map_or(&[], |index| &stops[index + 1..])
    }
}
