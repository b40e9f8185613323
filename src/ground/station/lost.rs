//! Vehicles that fall silent, come back or are started anew while a sweep is under way: everyone else is stopped, and the
//! sweep goes on with those that are there. The laps done stay done. Silent is who does not say its State, whatever else
//! it says; who was never heard is waited for as long, and then lost. What somebody has stopped stays stopped when it
//! comes back.
//!
//! **Why a vehicle may be dropped.** Who is no member of a newer revision is proven against by nobody, so it must stand
//! still before others drive under new plans. Let D be dropped from revision r, all others being members of the empty
//! revision e > r.
//!
//! 1. While the others come to rest under e and stand, D may go on under r: r is proven for every timing, a stand of
//!    any length of the others included (rule 2 of [`crate::sweep::Follower`]).
//! 2. What D may still enter under r is little: legs whose `after` are done, by the progress of r that the others have
//!    reported. Once all report e nobody adds to that, by bus or by radio; D runs into a wait and stops by itself.
//! 3. If D hears any plan of e or later it enters no leg any more, and is refused as no member.
//! 4. If D hears no plan at all its bus is lost, and it holds after its autonomy (the venue's `autonomy_s`), wherever it is. What moves after
//!    that does not follow a plan: it keeps clear of the others by itself, as on the way home.
//! 5. If D is dead it stands where its autopilot has stopped it, at the latest at the end of the leg that it had entered.
//!
//! By 3, 4 and 5, D stands still once it was not heard for its autonomy and the time to end a leg (5 s). So plans are
//! asked for only when all others report e *and* every dropped vehicle has been silent for so long, also one that was last
//! heard at rest: it may have heard of plans since. After a restart of the ground silence is counted anew. Where it stands is known only roughly: the vehicles treat its last claimed leg as an obstacle, see it by their range
//! sensors, and drive around it by themselves; the planner does not know of it.
//!
//! Coming back, a vehicle is taken up again in the same way: all are stopped under an empty revision of which it is a
//! member, which it adopts first in any case (rule 6), then planned for.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::super::fleet::{FleetChange, FleetMember};
use super::{Out, Phase, Station, StationEvent};
use crate::sweep::{self, Succession};
use crate::time::Time;

/// Others were heard within this time: then the ground itself is not cut off.
const OTHERS_WITHIN: Duration = Duration::from_secs(2);
/// Time to end the leg entered, and to come to rest.
const ENDS_LEG: Duration = Duration::from_secs(5);
/// A sweep needs so many vehicles, if there are so many.
const FEWEST: usize = 2;

impl Station {
    /// Looks for vehicles that have fallen silent.
    pub(super) fn look_after_lost(&mut self, now: Time, out: &mut Vec<Out>) {
        for vehicle in self.fleet.lose(now, self.lost_after, OTHERS_WITHIN) {
            out.push(Out::StationEvent(StationEvent::Lost(vehicle)));
        }
    }

    /// Returns whether the present plans are for others than those who are there, or somebody has forgotten them.
    pub(super) fn must_rest(&self) -> bool {
        let members = self.succession.as_ref().map(Succession::members);
        self.disturbed || members != Some(&self.fleet.present()[..])
    }

    /// Returns whether a sweep waits for vehicles to come back.
    pub(super) fn waits_for_more(&self) -> bool {
        let stops = matches!(self.phase, Phase::Stopping(_));
        stops && self.fleet.present().len() < FEWEST.min(self.fleet.len())
    }

    /// Returns whether enough vehicles have been heard that a sweep is worth beginning.
    pub(super) fn has_enough(&self) -> bool {
        let heard = self
            .fleet
            .members()
            .filter(|(_, member)| member.state().is_some() && !member.dealings().is_lost());
        heard.count() >= FEWEST
    }

    /// Returns whether whoever was dropped surely stands still; see the module's page.
    fn lost_ones_rest(&self, now: Time) -> bool {
        let rests_after = self.lost_after.max(self.autonomy + ENDS_LEG);
        let rests = |member: &FleetMember| {
            member
                .heard_at()
                .is_none_or(|at| now.since(at) >= rests_after)
        };
        self.fleet
            .members()
            .filter(|(_, member)| member.dealings().is_lost())
            .all(|(_, member)| rests(member))
    }

    /// Says and remembers what a vehicle's message has shown; the sweep is planned anew at the next look.
    pub(super) fn shown(&mut self, vehicle: VehicleId, shown: FleetChange, out: &mut Vec<Out>) {
        if shown.found {
            out.push(Out::StationEvent(StationEvent::Found(vehicle)));
        }
        let is_driven = matches!(
            self.phase,
            Phase::Planning(_) | Phase::Running(..) | Phase::Stopping(_)
        );
        if shown.restarted {
            out.push(Out::StationEvent(StationEvent::Restarted(vehicle)));
            self.disturbed |= is_driven;
        }
        self.disturbed |= shown.found && is_driven;
    }

    /// Returns whether everyone has come to rest and plans may be made.
    pub(super) fn may_plan(&self, now: Time) -> bool {
        let stopped = self
            .succession
            .as_ref()
            .is_some_and(|known| known.phase() == sweep::Phase::Stopped);
        stopped && !self.waits_for_more() && self.lost_ones_rest(now) && self.fleet.are_placed()
    }
}
