//! Vehicles that fall silent, come back or are started anew while a sweep is under way: everyone else is stopped, and the
//! sweep goes on with those that are there. The laps done stay done. A vehicle is silent when it does not say its State,
//! whatever else it says; one that was never heard is waited for as long, and then counts as lost. A vehicle that somebody
//! has stopped stays stopped when it comes back.
//!
//! **Why a vehicle may be dropped.** No plan is proven against a vehicle that is no member of its revision, so it must
//! stand still before others drive under new plans. Let D be dropped from revision r, all others being members of the
//! empty revision e > r.
//!
//! 1. While the others come to rest under e and stand, D may go on under r: r is proven for every timing, a stand of
//!    any length of the others included (rule 2 of [`crate::sweep::Follower`]).
//! 2. What D may still enter under r is little: legs whose `after` are done, by the progress of r that the others have
//!    reported. Once all report e nobody adds to that, by bus or by radio; D runs into a wait and stops by itself.
//! 3. If D hears any plan of e or later it enters no leg any more, and is refused as no member.
//! 4. If D hears no plan at all its bus is lost, and it holds after its autonomy (the venue's `autonomy_s`), wherever it
//!    is. What moves after that does not follow a plan: it keeps clear of the others by itself, as on the way home.
//! 5. If D is dead it stands where its autopilot has stopped it, at the latest at the end of the leg that it had entered.
//!
//! By 3, 4 and 5, D stands still once it was not heard for its autonomy and the time to end a leg (5 s). So plans are
//! asked for only when all others report e *and* every dropped vehicle has been silent for this long, also one that was last
//! heard at rest: it may have heard of plans since. After a restart of the ground silence is counted anew. Where it stands
//! is known only roughly: the vehicles treat its last claimed leg as an obstacle, see it by their range sensors, and drive
//! around it by themselves; the planner does not know of it.
//!
//! Coming back, a vehicle is taken up again in the same way: all are stopped under an empty revision of which it is a
//! member, which it adopts first in any case (rule 6), then planned for.
//!
//! A vehicle that is heard, but says that it does not go on by itself (its battery is low, its range sensors do not answer,
//! or it has not known its place for a minute), is dropped in the same way, as soon as it says that it rests: it has left r
//! before, and enters and finishes nothing of it any more; on its way home it keeps clear of the others by itself. When it
//! may go on again it is taken up again.
//!
//! This says when silence means something; what follows from it for a sweep is decided by the execution.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use crate::ground::fleet::{Fleet, FleetMember};
use crate::time::Time;

/// Others were heard within this time: then the ground itself is not cut off.
const OTHERS_WITHIN: Duration = Duration::from_secs(2);
/// Time to end the leg entered, and to come to rest.
const ENDS_LEG: Duration = Duration::from_secs(5);
/// A sweep needs so many vehicles, if there are so many.
const FEWEST: usize = 2;

/// How long a silence must last until something follows from it.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct SilenceLimits {
    lost_after: Duration,
    autonomy: Duration,
}

impl SilenceLimits {
    /// Counts a vehicle as lost after `lost_after`; without a bus it carries on under its plan for `autonomy`.
    pub(super) fn new(lost_after: Duration, autonomy: Duration) -> SilenceLimits {
        SilenceLimits {
            lost_after,
            autonomy,
        }
    }

    /// Returns whether a silence is long enough that a vehicle counts as lost.
    pub(super) fn is_lost(self, silence: Duration) -> bool {
        silence > self.lost_after
    }

    /// Counts those as lost that have fallen silent while others were heard; returns them.
    pub(super) fn lose(self, now: Time, fleet: &mut Fleet) -> Vec<VehicleId> {
        fleet.lose(now, self.lost_after, OTHERS_WITHIN)
    }

    /// Returns the vehicles that have said their state not long ago, ascending.
    pub(super) fn there(self, now: Time, fleet: &Fleet) -> impl Iterator<Item = VehicleId> {
        let is_there = move |member: &FleetMember| {
            let heard_at = member.heard_at();
            heard_at.is_some_and(|at| !self.is_lost(now.since(at)))
        };
        let there = fleet.members().filter(move |(_, member)| is_there(member));
        there.map(|(id, _)| id)
    }

    /// Returns whether every vehicle that was dropped surely stands still; see the module's page.
    pub(super) fn do_absent_ones_rest(self, now: Time, fleet: &Fleet) -> bool {
        let rests_after = self.lost_after.max(self.autonomy + ENDS_LEG);
        let rests = |member: &FleetMember| {
            let heard_at = member.heard_at();
            let is_silent = heard_at.is_none_or(|at| now.since(at) >= rests_after);
            is_silent || (!member.dealings().is_lost() && member.rests())
        };
        let mut away = fleet.members().filter(|(_, member)| member.is_away());
        away.all(|(_, member)| rests(member))
    }
}

/// Returns whether too few vehicles are left for a sweep, which then waits until others are back.
pub(super) fn is_too_few(fleet: &Fleet) -> bool {
    fleet.present().len() < FEWEST.min(fleet.len())
}

/// Returns whether too few are left only since others are there and do not go on by themselves: that may never end.
pub(super) fn is_too_few_in_service(fleet: &Fleet) -> bool {
    is_too_few(fleet)
        && fleet.present().len() + fleet.out_of_service().len() >= FEWEST.min(fleet.len())
}

/// Returns whether enough vehicles have been heard that a sweep is worth beginning without the others.
pub(super) fn are_enough_heard(fleet: &Fleet) -> bool {
    let heard = fleet
        .members()
        .filter(|(_, member)| member.state().is_some() && !member.is_away());
    heard.count() >= FEWEST
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, Lease, State};

    fn at(at_s: u64) -> Time {
        Time::ZERO + Duration::from_secs(at_s)
    }

    /// Vehicles are lost after 30 s, and hold by themselves after the autonomy.
    fn limits(autonomy_s: u64) -> SilenceLimits {
        SilenceLimits::new(Duration::from_secs(30), Duration::from_secs(autonomy_s))
    }

    fn fleet(vehicles: u8) -> Fleet {
        let expected: Vec<VehicleId> = (1..=vehicles).map(VehicleId).collect();
        Fleet::new(&expected, Lease::default())
    }

    fn hear(fleet: &mut Fleet, at_s: u64, vehicle: u8) {
        let state = State {
            vehicle: VehicleId(vehicle),
            boot: Boot(1),
            sequence: 1 + at_s,
            ..State::default()
        };
        fleet.heard_state(at(at_s), state);
    }

    #[test]
    fn a_dropped_vehicle_stands_only_after_its_autonomy_and_a_leg() {
        for (autonomy_s, rests_s) in [(60, 65), (10, 30)] {
            let mut fleet = fleet(2);
            hear(&mut fleet, 0, 1);
            hear(&mut fleet, 31, 2);
            assert_eq!(limits(autonomy_s).lose(at(31), &mut fleet), [VehicleId(1)]);
            let rest = |at_s| limits(autonomy_s).do_absent_ones_rest(at(at_s), &fleet);
            assert!(rest(rests_s), "autonomy {autonomy_s} s");
            assert!(!rest(rests_s - 1), "autonomy {autonomy_s} s");
        }
    }

    #[test]
    fn nobody_is_lost_when_the_ground_hears_nobody() {
        let mut fleet = fleet(2);
        hear(&mut fleet, 0, 1);
        hear(&mut fleet, 0, 2);
        assert_eq!(limits(60).lose(at(100), &mut fleet), []);
    }

    #[test]
    fn who_said_its_state_not_long_ago_is_there() {
        let mut fleet = fleet(3);
        hear(&mut fleet, 0, 1);
        hear(&mut fleet, 5, 2);
        let there = |at_s| limits(60).there(at(at_s), &fleet).collect::<Vec<_>>();
        assert_eq!(there(30), [VehicleId(1), VehicleId(2)]);
        assert_eq!(there(31), [VehicleId(2)]);
    }

    #[test]
    fn a_sweep_needs_two_unless_there_is_only_one() {
        let mut alone = fleet(1);
        assert!(!is_too_few(&alone) && !are_enough_heard(&alone));
        hear(&mut alone, 0, 1);
        assert!(!are_enough_heard(&alone), "nothing is measured by one");
        let mut fleet = fleet(3);
        hear(&mut fleet, 0, 1);
        assert!(!are_enough_heard(&fleet));
        hear(&mut fleet, 0, 2);
        assert!(are_enough_heard(&fleet) && !is_too_few(&fleet));
        hear(&mut fleet, 31, 2);
        fleet.lose_unheard(at(0));
        limits(60).lose(at(31), &mut fleet);
        assert_eq!(fleet.present(), [VehicleId(2)]);
        assert!(is_too_few(&fleet) && !are_enough_heard(&fleet));
    }
}
