//! A vehicle's side of following plans that wait for each other: what it may drive now, what it
//! waits for, and when it changes to the next revision. No route, no map, no speed is known here.
//!
//! ```text
//!            all plans of a newer revision there, at rest at its start
//!  following r ───────────────────────────────────────────► behind the barrier of r'
//!   ▲   │ any plan of a newer revision heard: no leg is        │ every member was heard
//!   │   └► entered any more; entered legs are finished or held │ reporting exactly r'
//!   └──────────────────────────────────────────────────────────┘
//! ```
//!
//! **Why mixed revisions are safe.** Everything believed of a peer is a fact that stays true, so a
//! late, doubled or reordered Progress does no harm and a lost one costs time only: "it has adopted
//! revision r", "it has done the first k stops of r". Facts of another revision are never used.
//!
//! 1. A vehicle adopts r only at rest, at the start that r gives it, and reports r only then. Before
//!    it may move, everyone must have been heard reporting r. So when the first vehicle moves under r,
//!    all have stopped, each at its start, and all later motion obeys the `after` of r.
//! 2. A vehicle that has left r for r' stands where r let it rest last (or held on a leg of r that it
//!    never reports done), and stays there until all report r'. Whoever still drives under r keeps
//!    clear of that place, since the plans of r are proven for every timing, a stand of any length included.
//! 3. The barrier asks for exactly r, not "r or higher": a peer that jumped from r−1 to r+1 was perhaps
//!    never at its start of r. That costs nothing: who hears of r+1 stands at the barrier, and adopts r+1.
//! 4. Plans of a revision may come in any order, doubled, with some lost and repeated later. Only the
//!    newest revision heard of is collected; from then on no leg is entered under the old one, also
//!    when the new one never becomes complete or does not fit (`start` is elsewhere): the vehicle
//!    rests, and the ground can plan from where it rests. It is void, as if nobody had given it, when a plan of a greater
//!    right comes, or when nobody gives it any more (that is for the caller to see).
//! 5. Several legs may be entered ahead to drive through stops; all entered legs count as begun.
//! 6. What a vehicle has done before a restart stays done, and where it has stopped it stands: such facts are kept.
//!    Whether it is at rest, and at which revision, is what its latest start says; what an earlier one said of that is
//!    void. A restarted vehicle has forgotten what it did. If it stands by chance at the start of the current
//!    revision (a lap ends where it began) it must not begin that revision again, since the others
//!    count its stops as done. Hence the first revision that it adopts must be an empty one (no stops
//!    for anyone): the ground's answer to a restart, and how it begins every run. This supposes that
//!    a restart takes longer than a message.
//!    A start is later when its count is higher, or when nothing was heard of the other one for 30 s: a vehicle whose
//!    count was lost begins anew. What was done stays done in both cases.
//! 7. Who is no member of a newer revision stops for good. A ground that drops a member must know that
//!    it stands still; that cannot be checked here.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, Plan, Revision, RunId, Stop, StopId, VehicleId};

use super::{
    FollowError, LOWER_BOOT_AFTER, PlanRefusal, PlanVerdict, VOID_AFTER, VehicleProgress, WaitsFor,
    validate,
};
use crate::geom::Point;
use crate::time::{Deadline, Time};

/// A revision of a run; a higher run is newer than any revision of a lower one.
type Edition = (RunId, Revision);

fn edition_of(plan: &Plan) -> Edition {
    (plan.run, plan.revision)
}

/// What is known of a peer, whatever it follows.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Peer {
    boot: Boot,
    newest: Edition,
    at_rest: bool,
    /// When this start of it was heard last.
    heard_at: Time,
    /// When it was heard to be there, at this revision, last.
    newest_at: Time,
}

/// What is known of a member in the revision followed; only ever grows.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Member {
    order: BTreeMap<StopId, usize>,
    adopted: bool,
    done: usize,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Dwell {
    since: Time,
    missing: BTreeSet<VehicleId>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Adopted {
    plans: Vec<Plan>,
    own: usize,
    members: BTreeMap<VehicleId, Member>,
    done: usize,
    entered: usize,
    dwell: Option<Dwell>,
}

/// Follows the newest revision of plans; see the module's page for the rules.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Follower {
    vehicle: VehicleId,
    tolerance_m: f64,
    rest: Option<Point>,
    adopted: Option<Adopted>,
    pending: BTreeMap<VehicleId, Plan>,
    refusal: Option<PlanRefusal>,
    peers: BTreeMap<VehicleId, Peer>,
}

impl Follower {
    /// Makes the follower of a vehicle that stands at `rest`; `tolerance_m` is how far from a plan's
    /// start it may stand to begin it, metres.
    pub fn new(vehicle: VehicleId, rest: Point, tolerance_m: f64) -> Follower {
        Follower {
            vehicle,
            tolerance_m,
            rest: Some(rest),
            adopted: None,
            pending: BTreeMap::new(),
            refusal: None,
            peers: BTreeMap::new(),
        }
    }

    /// Takes a plan heard, own or a peer's; plans may come in any order and any number of times.
    pub fn offer(&mut self, plan: &Plan) -> PlanVerdict {
        let edition = edition_of(plan);
        // What a lower right has given and nobody here follows yet is void, whatever its revision. Two grounds may also give
        // one edition to different plans: those of the higher right are kept, never mixed.
        let lease = self.pending.values().next().map(|pending| pending.lease);
        if lease.is_some_and(|lease| lease < plan.lease) {
            self.give_up_pending();
        }
        let newest = self.pending_edition().or(self.adopted_edition());
        let known = self
            .adopted_edition()
            .is_some_and(|adopted| adopted >= edition);
        if known || newest.is_some_and(|newest| newest > edition) {
            return PlanVerdict::Old;
        }
        if newest == Some(edition) && lease.is_some_and(|lease| lease > plan.lease) {
            return PlanVerdict::Old;
        }
        if newest != Some(edition) {
            self.give_up_pending();
        }
        self.pending
            .entry(plan.vehicle)
            .or_insert_with(|| plan.clone());
        self.try_adopting()
    }

    /// Forgets a newer revision that is not adopted, as if it had not been heard: what is followed goes on. That is safe,
    /// since nobody was told that it is followed.
    pub fn give_up_pending(&mut self) {
        self.pending.clear();
        self.refusal = None;
    }

    /// Takes a peer's progress, from the bus or by radio; late and repeated ones do no harm.
    pub fn hear(&mut self, now: Time, progress: &VehicleProgress) {
        if progress.vehicle == self.vehicle {
            return;
        }
        self.note_member(progress);
        self.note_peer(now, progress);
        let is_latest = self
            .peers
            .get(&progress.vehicle)
            .is_none_or(|peer| peer.boot <= progress.boot);
        let same = is_latest && self.adopted_edition() == Some((progress.run, progress.revision));
        let dwell = self
            .adopted
            .as_mut()
            .and_then(|adopted| adopted.dwell.as_mut());
        if let Some(dwell) = dwell.filter(|_| same && progress.leg.is_none()) {
            dwell.missing.remove(&progress.vehicle);
        }
        self.wake(now);
    }

    fn note_member(&mut self, progress: &VehicleProgress) {
        if self.adopted_edition() != Some((progress.run, progress.revision)) {
            return;
        }
        let member = self
            .adopted
            .as_mut()
            .and_then(|adopted| adopted.members.get_mut(&progress.vehicle));
        let Some(member) = member else { return };
        member.adopted = true;
        let done = progress
            .done
            .and_then(|stop| member.order.get(&stop))
            .map_or(0, |index| index + 1);
        member.done = member.done.max(done);
    }

    fn note_peer(&mut self, now: Time, progress: &VehicleProgress) {
        let newest = (progress.run, progress.revision);
        let (boot, at_rest) = (progress.boot, progress.leg.is_none());
        let heard = Peer {
            boot,
            newest,
            at_rest,
            heard_at: now,
            newest_at: now,
        };
        let peer = self.peers.entry(progress.vehicle).or_insert(heard);
        let begins_anew = heard.boot != peer.boot && now.since(peer.heard_at) > LOWER_BOOT_AFTER;
        // A revision that it never says again is none that it follows.
        let is_void = heard.boot == peer.boot && now.since(peer.newest_at) > VOID_AFTER;
        if begins_anew || is_void || (heard.boot, heard.newest) >= (peer.boot, peer.newest) {
            *peer = heard;
        } else if heard.boot == peer.boot {
            peer.heard_at = now;
        }
    }

    /// Tells that the vehicle stands at `at`, held in the middle of a leg or brought there off plan, so
    /// that it may change to a newer revision from there; true when it has changed, and the leg is given up.
    ///
    /// From now on also an offered plan may change the revision; [`Follower::resume`] must be called
    /// before the vehicle moves again, and does nothing when the leg was given up meanwhile.
    pub fn hold(&mut self, at: Point) -> bool {
        self.rest = Some(at);
        self.try_adopting() == PlanVerdict::Adopted
    }

    /// Tells that a held vehicle goes on with the legs that it had entered.
    pub fn resume(&mut self) {
        if self.adopted.as_ref().is_some_and(Adopted::is_driving) {
            self.rest = None;
        }
    }

    /// Returns the next leg, if it may be entered now.
    pub fn next_leg(&self) -> Option<&Stop> {
        self.may_enter(0)
    }

    /// Returns the leg `ahead` legs behind the last one entered (0 = the next), if it and all before it
    /// may be entered now without a dwell between.
    ///
    /// What it says stays true until a plan of a newer revision is offered.
    pub fn may_enter(&self, ahead: usize) -> Option<&Stop> {
        let adopted = self.adopted.as_ref()?;
        let target = adopted.entered.checked_add(ahead)?;
        let stop = adopted.stops().get(target)?;
        self.obstacle_up_to(adopted, target)
            .is_none()
            .then_some(stop)
    }

    /// The first reason why not all legs up to `target` may be entered.
    fn obstacle_up_to(&self, adopted: &Adopted, target: usize) -> Option<WaitsFor> {
        if let Some(revision) = self.newer_revision() {
            return Some(WaitsFor::Revision {
                revision,
                refusal: self.refusal.clone(),
            });
        }
        let waiting = adopted
            .members
            .iter()
            .find(|(vehicle, member)| **vehicle != self.vehicle && !member.adopted);
        if let Some((&vehicle, _)) = waiting {
            return Some(WaitsFor::Member { vehicle });
        }
        let stops = adopted.stops();
        let dwelling = stops[adopted.done..target]
            .iter()
            .find(|stop| stop.dwell_ms > 0);
        if let Some(stop) = dwelling {
            return Some(WaitsFor::Dwell { stop: stop.id });
        }
        let after = stops[adopted.entered..=target]
            .iter()
            .flat_map(|stop| &stop.after);
        let missing = after
            .into_iter()
            .find(|(vehicle, stop)| !adopted.is_done(*vehicle, *stop));
        missing.map(|(vehicle, stop)| WaitsFor::Stop {
            vehicle: *vehicle,
            stop: *stop,
        })
    }

    /// Returns why no leg may be entered now; `None` when [`Follower::next_leg`] gives one.
    pub fn waits_for(&self) -> Option<WaitsFor> {
        let Some(adopted) = &self.adopted else {
            let revision = self.newer_revision();
            let waits = |revision| WaitsFor::Revision {
                revision,
                refusal: self.refusal.clone(),
            };
            return Some(revision.map_or(WaitsFor::Plans, waits));
        };
        if self.newer_revision().is_none() && adopted.entered >= adopted.stops().len() {
            let dwelling = adopted
                .dwell
                .as_ref()
                .and_then(|_| adopted.stops().get(adopted.done));
            return Some(
                dwelling.map_or(WaitsFor::Nothing, |stop| WaitsFor::Dwell { stop: stop.id }),
            );
        }
        self.obstacle_up_to(adopted, adopted.entered)
    }

    /// Enters the next leg: from now on it will be driven to its end, or held on it.
    ///
    /// A vehicle that cannot brake before a stop any more must have entered the leg behind it.
    ///
    /// # Errors
    /// It is not the next leg, or may not be entered now.
    pub fn enter(&mut self, stop: StopId) -> Result<(), FollowError> {
        if self.next_leg().map(|next| next.id) != Some(stop) {
            return Err(FollowError::NotYet(stop));
        }
        if let Some(adopted) = &mut self.adopted {
            adopted.entered += 1;
            self.rest = None;
        }
        Ok(())
    }

    /// Tells that the vehicle passes or has reached the stop whose leg it drives.
    ///
    /// With a dwell it begins; without one the stop is done at once. When no leg behind the stop was
    /// entered the vehicle must stand at `at`, and may change to a newer revision here.
    ///
    /// # Errors
    /// It is not the first stop that is entered and not done.
    pub fn arrive(&mut self, now: Time, stop: StopId, at: Point) -> Result<(), FollowError> {
        let peers = &self.peers;
        let driven = self.adopted.as_mut().filter(|adopted| adopted.is_driving());
        let Some(adopted) = driven.filter(|adopted| adopted.stops()[adopted.done].id == stop)
        else {
            return Err(FollowError::NotThere(stop));
        };
        let reached = &adopted.stops()[adopted.done];
        if reached.dwell_ms > 0 {
            let edition = edition_of(&adopted.plans[adopted.own]);
            let resting = |partner: &VehicleId| {
                peers
                    .get(partner)
                    .is_some_and(|peer| peer.at_rest && peer.newest == edition)
            };
            let missing = reached
                .partners
                .iter()
                .filter(|partner| !resting(partner))
                .copied()
                .collect();
            adopted.dwell = Some(Dwell {
                since: now,
                missing,
            });
        } else {
            adopted.done += 1;
        }
        if !adopted.is_driving() {
            self.rest = Some(at);
        }
        self.try_adopting();
        Ok(())
    }

    /// Returns when the dwell ends, if the vehicle dwells.
    pub fn deadline(&self) -> Option<Deadline> {
        let adopted = self.adopted.as_ref()?;
        let dwell = adopted.dwell.as_ref()?;
        let stop = &adopted.stops()[adopted.done];
        let limit_ms = stop.dwell_limit_ms.max(stop.dwell_ms);
        let stay_ms = if dwell.missing.is_empty() {
            stop.dwell_ms
        } else {
            limit_ms
        };
        let at = dwell.since + Duration::from_millis(u64::from(stay_ms));
        Some(Deadline {
            at,
            why: "the dwell at the stop ends",
        })
    }

    /// Ends a dwell whose time is over; true when a stop was done by that.
    pub fn wake(&mut self, now: Time) -> bool {
        let over = self.deadline().is_some_and(|deadline| deadline.at <= now);
        let Some(adopted) = self.adopted.as_mut().filter(|_| over) else {
            return false;
        };
        adopted.dwell = None;
        adopted.done += 1;
        true
    }

    /// Returns the progress to publish, on change and again and again, also before any plan is there; its boot is for the
    /// caller to fill in.
    pub fn progress(&self) -> VehicleProgress {
        let nothing = VehicleProgress {
            vehicle: self.vehicle,
            ..VehicleProgress::default()
        };
        let Some(adopted) = &self.adopted else {
            return nothing;
        };
        let (run, revision) = edition_of(&adopted.plans[adopted.own]);
        let id = |count: usize| count.checked_sub(1).map(|last| adopted.stops()[last].id);
        let leg = if adopted.is_driving() {
            id(adopted.entered)
        } else {
            None
        };
        let done = id(adopted.done);
        VehicleProgress {
            run,
            revision,
            done,
            leg,
            ..nothing
        }
    }

    /// Returns whether every stop of the revision followed is done and no newer revision is known.
    pub fn finished(&self) -> bool {
        let ended = |adopted: &Adopted| adopted.done >= adopted.stops().len();
        self.newer_revision().is_none() && self.adopted.as_ref().is_some_and(ended)
    }

    /// Returns how many stops of the own plan are done, and how many it has; none of none before the first plan.
    pub fn stops_done(&self) -> (usize, usize) {
        self.adopted
            .as_ref()
            .map_or((0, 0), |adopted| (adopted.done, adopted.stops().len()))
    }

    /// Returns the own plan of the revision followed.
    pub fn plan(&self) -> Option<&Plan> {
        self.adopted
            .as_ref()
            .map(|adopted| &adopted.plans[adopted.own])
    }

    /// Returns the plans of all members of the revision followed; none before the first.
    pub fn plans(&self) -> &[Plan] {
        self.adopted.as_ref().map_or(&[], |adopted| &adopted.plans)
    }

    /// Returns the stops whose legs are entered and which are not done, the first the one driven to (or
    /// dwelt at).
    pub fn entered(&self) -> &[Stop] {
        self.adopted.as_ref().map_or(&[], |adopted| {
            &adopted.stops()[adopted.done..adopted.entered]
        })
    }

    /// Returns why the newest revision is not followed, if it was refused.
    pub fn refusal(&self) -> Option<&PlanRefusal> {
        self.refusal.as_ref()
    }

    fn adopted_edition(&self) -> Option<Edition> {
        self.plan().map(edition_of)
    }

    /// Returns run and revision of the plans that are being collected, newer than those followed.
    pub fn pending_edition(&self) -> Option<(RunId, Revision)> {
        self.pending.values().next().map(edition_of)
    }

    fn newer_revision(&self) -> Option<Revision> {
        self.pending_edition().map(|(_, revision)| revision)
    }

    /// Adopts the pending revision when it is complete, fits, and the vehicle rests.
    fn try_adopting(&mut self) -> PlanVerdict {
        let Some(sample) = self.pending.values().next() else {
            return PlanVerdict::Old;
        };
        let members = sample.members.clone();
        if !members.contains(&self.vehicle) {
            return self.refuse(PlanRefusal::NotMember {
                revision: sample.revision,
            });
        }
        if let Some(refusal @ PlanRefusal::Invalid { .. }) = &self.refusal {
            return PlanVerdict::Refused(refusal.clone());
        }
        let complete = members
            .iter()
            .all(|member| self.pending.contains_key(member));
        let (Some(rest), true) = (self.rest, complete) else {
            return PlanVerdict::Unchanged;
        };
        let Some(own) = self.pending.get(&self.vehicle) else {
            return PlanVerdict::Unchanged;
        };
        let (edition, revision) = (edition_of(own), own.revision);
        let distance_m = rest.distance_to(own.start.into());
        // A vehicle without stops of its own is in the way of the others all the same.
        let all_stop = self.pending.values().all(|plan| plan.stops.is_empty());
        if !all_stop && self.adopted.is_none() {
            return self.refuse(PlanRefusal::NotStopped { revision });
        }
        if !all_stop && distance_m > self.tolerance_m {
            return self.refuse(PlanRefusal::Elsewhere {
                revision,
                distance_m,
            });
        }
        let plans: Vec<Plan> = self.pending.values().cloned().collect();
        if let Err(error) = validate(&plans) {
            return self.refuse(PlanRefusal::Invalid { revision, error });
        }
        self.pending.clear();
        self.refusal = None;
        self.adopted = Some(Adopted::new(plans, self.vehicle, edition, &self.peers));
        PlanVerdict::Adopted
    }

    fn refuse(&mut self, refusal: PlanRefusal) -> PlanVerdict {
        self.refusal = Some(refusal.clone());
        PlanVerdict::Refused(refusal)
    }
}

impl Adopted {
    fn new(
        plans: Vec<Plan>,
        vehicle: VehicleId,
        edition: Edition,
        peers: &BTreeMap<VehicleId, Peer>,
    ) -> Adopted {
        let member = |plan: &Plan| {
            let order = plan
                .stops
                .iter()
                .enumerate()
                .map(|(index, stop)| (stop.id, index))
                .collect();
            let adopted = peers
                .get(&plan.vehicle)
                .is_some_and(|peer| peer.newest == edition);
            (
                plan.vehicle,
                Member {
                    order,
                    adopted,
                    done: 0,
                },
            )
        };
        let members = plans.iter().map(member).collect();
        let own = plans
            .iter()
            .position(|plan| plan.vehicle == vehicle)
            .unwrap_or(0);
        Adopted {
            plans,
            own,
            members,
            done: 0,
            entered: 0,
            dwell: None,
        }
    }

    fn stops(&self) -> &[Stop] {
        &self.plans[self.own].stops
    }

    fn is_driving(&self) -> bool {
        self.entered > self.done && self.dwell.is_none()
    }

    fn is_done(&self, vehicle: VehicleId, stop: StopId) -> bool {
        let Some(member) = self.members.get(&vehicle) else {
            return false;
        };
        member
            .order
            .get(&stop)
            .is_some_and(|index| *index < member.done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::Position;

    const ONE: VehicleId = VehicleId(1);
    const TWO: VehicleId = VehicleId(2);

    /// A plan along the x axis, one metre a stop, from x = 0 in its vehicle's own lane.
    fn plan(vehicle: VehicleId, revision: u32, stops: u32) -> Plan {
        let lane_m = 5.0 * f64::from(vehicle.0);
        let stop = |number: u32| Stop {
            id: StopId(number),
            at: Position::from_metres(f64::from(number), lane_m, 0.0),
            route: vec![],
            dwell_ms: 0,
            dwell_limit_ms: 0,
            partners: vec![],
            after: vec![],
        };
        Plan {
            vehicle,
            run: RunId(1),
            revision: Revision(revision),
            members: vec![ONE, TWO],
            start: Position::from_metres(0.0, lane_m, 0.0),
            stops: (1..=stops).map(stop).collect(),
            ..Plan::default()
        }
    }

    fn peer(revision: u32, done: Option<u32>, leg: Option<u32>) -> VehicleProgress {
        let (run, revision) = (RunId(1), Revision(revision));
        let (done, leg) = (done.map(StopId), leg.map(StopId));
        VehicleProgress {
            vehicle: TWO,
            run,
            revision,
            done,
            leg,
            ..VehicleProgress::default()
        }
    }

    fn at(x_m: f64) -> Point {
        Point::new(x_m, 5.0)
    }

    fn second(seconds: f64) -> Time {
        Time::from_secs_f64(seconds)
    }

    /// A follower of vehicle 1 that has adopted the empty revision 1.
    fn stopped() -> Follower {
        let mut follower = Follower::new(ONE, at(0.0), 0.3);
        assert_eq!(follower.offer(&plan(ONE, 1, 0)), PlanVerdict::Unchanged);
        assert_eq!(follower.offer(&plan(TWO, 1, 0)), PlanVerdict::Adopted);
        follower
    }

    /// A follower of vehicle 1 under revision 2, with the given plan of its own and 5 stops of vehicle 2.
    fn following(own: &Plan) -> Follower {
        let mut follower = stopped();
        follower.offer(&plan(TWO, 2, 5));
        assert_eq!(follower.offer(own), PlanVerdict::Adopted);
        follower
    }

    #[test]
    fn nobody_moves_before_all_report_the_revision() {
        let mut follower = following(&plan(ONE, 2, 3));
        assert_eq!(
            follower.waits_for(),
            Some(WaitsFor::Member { vehicle: TWO })
        );
        follower.hear(second(1.0), &peer(1, None, None));
        assert!(follower.next_leg().is_none());
        follower.hear(second(1.0), &peer(3, None, None));
        assert!(
            follower.next_leg().is_none(),
            "a peer beyond the revision may never have been at its start"
        );
        follower.hear(second(1.0), &peer(2, None, None));
        assert_eq!(follower.next_leg().map(|stop| stop.id), Some(StopId(1)));
    }

    #[test]
    fn a_leg_waits_for_what_it_is_after_and_late_progress_takes_nothing_back() {
        let mut own = plan(ONE, 2, 3);
        own.stops[1].after = vec![(TWO, StopId(3))];
        let mut follower = following(&own);
        follower.hear(second(1.0), &peer(2, Some(2), Some(3)));
        assert_eq!(follower.may_enter(0).map(|stop| stop.id), Some(StopId(1)));
        assert!(follower.may_enter(1).is_none());
        follower.enter(StopId(1)).unwrap();
        assert_eq!(
            follower.waits_for(),
            Some(WaitsFor::Stop {
                vehicle: TWO,
                stop: StopId(3)
            })
        );
        assert_eq!(
            follower.enter(StopId(2)),
            Err(FollowError::NotYet(StopId(2)))
        );
        follower.hear(second(2.0), &peer(2, Some(4), None));
        follower.hear(second(2.0), &peer(2, Some(1), None));
        follower.hear(second(2.0), &peer(1, None, None));
        follower.hear(second(2.0), &peer(2, Some(99), None));
        follower.enter(StopId(2)).unwrap();
        assert_eq!(follower.may_enter(0).map(|stop| stop.id), Some(StopId(3)));
        assert_eq!(
            follower.progress(),
            VehicleProgress {
                vehicle: ONE,
                leg: Some(StopId(2)),
                ..peer(2, None, None)
            }
        );
        follower.arrive(second(3.0), StopId(1), at(1.0)).unwrap();
        assert_eq!(follower.progress().done, Some(StopId(1)));
        assert_eq!(
            follower.arrive(second(3.0), StopId(3), at(3.0)),
            Err(FollowError::NotThere(StopId(3)))
        );
    }

    #[test]
    fn a_begun_leg_is_ended_before_the_next_revision() {
        let mut follower = following(&plan(ONE, 2, 3));
        follower.hear(second(1.0), &peer(2, None, None));
        follower.enter(StopId(1)).unwrap();
        assert_eq!(follower.offer(&plan(TWO, 3, 0)), PlanVerdict::Unchanged);
        assert!(
            follower.next_leg().is_none(),
            "half a revision heard is enough to stop"
        );
        assert_eq!(follower.offer(&plan(ONE, 3, 0)), PlanVerdict::Unchanged);
        assert_eq!(follower.progress().revision, Revision(2));
        follower.arrive(second(2.0), StopId(1), at(1.0)).unwrap();
        assert_eq!(
            follower.progress(),
            VehicleProgress {
                vehicle: ONE,
                ..peer(3, None, None)
            }
        );
        assert!(follower.finished());
        assert_eq!(follower.offer(&plan(ONE, 2, 3)), PlanVerdict::Old);
    }

    #[test]
    fn a_held_leg_may_be_given_up_for_the_next_revision() {
        let mut follower = following(&plan(ONE, 2, 3));
        follower.hear(second(1.0), &peer(2, None, None));
        follower.enter(StopId(1)).unwrap();
        assert!(!follower.hold(at(0.5)), "there is nothing to change to");
        follower.resume();
        follower.offer(&plan(TWO, 3, 0));
        follower.offer(&plan(ONE, 3, 0));
        assert!(follower.hold(at(0.7)));
        assert!(follower.entered().is_empty());
        let mut next = plan(ONE, 4, 1);
        next.start = Position::from_metres(0.8, 5.0, 0.0);
        follower.offer(&plan(TWO, 4, 1));
        assert_eq!(follower.offer(&next), PlanVerdict::Adopted);
    }

    #[test]
    fn a_revision_from_elsewhere_is_refused_and_holds() {
        let mut follower = following(&plan(ONE, 2, 3));
        follower.hear(second(1.0), &peer(2, None, None));
        let mut next = plan(ONE, 3, 0);
        next.start.x_mm = 2000;
        follower.offer(&next);
        let verdict = follower.offer(&plan(TWO, 3, 4));
        assert!(
            matches!(verdict, PlanVerdict::Refused(PlanRefusal::Elsewhere { .. })),
            "{verdict:?}"
        );
        assert!(follower.next_leg().is_none());
        assert_eq!(follower.progress().revision, Revision(2));
    }

    #[test]
    fn invalid_and_foreign_revisions_are_refused_and_hold() {
        let mut circle = plan(ONE, 3, 2);
        circle.stops[0].after = vec![(TWO, StopId(2))];
        let mut other = plan(TWO, 3, 2);
        other.stops[0].after = vec![(ONE, StopId(2))];
        let mut follower = stopped();
        follower.offer(&circle);
        assert!(matches!(
            follower.offer(&other),
            PlanVerdict::Refused(PlanRefusal::Invalid { .. })
        ));
        let mut without = plan(TWO, 4, 2);
        without.members = vec![TWO];
        assert!(matches!(
            follower.offer(&without),
            PlanVerdict::Refused(PlanRefusal::NotMember { .. })
        ));
        assert_eq!(follower.progress().revision, Revision(1));
        follower.offer(&plan(TWO, 5, 2));
        assert_eq!(follower.offer(&plan(ONE, 5, 2)), PlanVerdict::Adopted);
    }

    #[test]
    fn a_restarted_vehicle_begins_nothing_before_an_empty_revision() {
        let mut follower = Follower::new(ONE, at(0.0), 0.3);
        follower.offer(&plan(TWO, 7, 2));
        let verdict = follower.offer(&plan(ONE, 7, 2));
        assert!(
            matches!(
                verdict,
                PlanVerdict::Refused(PlanRefusal::NotStopped { .. })
            ),
            "{verdict:?}"
        );
        assert_eq!(
            follower.progress(),
            VehicleProgress {
                vehicle: ONE,
                ..VehicleProgress::default()
            }
        );
    }

    #[test]
    fn a_dwell_ends_when_the_partner_was_there_or_at_its_limit() {
        for (heard, ends_s) in [(true, 12.0), (false, 16.0)] {
            let mut own = plan(ONE, 2, 2);
            own.stops[0].dwell_ms = 2000;
            own.stops[0].dwell_limit_ms = 6000;
            own.stops[0].partners = vec![TWO];
            let mut follower = following(&own);
            follower.hear(second(1.0), &peer(2, None, Some(1)));
            assert!(
                follower.may_enter(1).is_none(),
                "nobody drives through a dwell"
            );
            follower.enter(StopId(1)).unwrap();
            follower.arrive(second(10.0), StopId(1), at(1.0)).unwrap();
            assert_eq!(
                follower.waits_for(),
                Some(WaitsFor::Dwell { stop: StopId(1) })
            );
            assert_eq!(follower.progress().leg, None, "who dwells is at rest");
            if heard {
                follower.hear(second(10.5), &peer(2, Some(1), None));
                follower.hear(second(10.7), &peer(2, Some(1), Some(2)));
            }
            assert_eq!(
                follower.deadline().map(|deadline| deadline.at),
                Some(second(ends_s))
            );
            assert!(!follower.wake(second(ends_s - 0.1)) && follower.wake(second(ends_s)));
            assert_eq!(follower.next_leg().map(|stop| stop.id), Some(StopId(2)));
        }
    }

    #[test]
    fn plans_of_two_grounds_under_one_edition_are_not_mixed() {
        let of = |plan: Plan, number: u32| Plan {
            lease: tomoswarm_proto::Lease { number, holder: 7 },
            ..plan
        };
        let mut follower = stopped();
        assert_eq!(
            follower.offer(&of(plan(ONE, 2, 3), 1)),
            PlanVerdict::Unchanged
        );
        assert_eq!(
            follower.offer(&of(plan(TWO, 2, 5), 2)),
            PlanVerdict::Unchanged,
            "the own one is of the lower right"
        );
        assert_eq!(follower.offer(&of(plan(ONE, 2, 3), 1)), PlanVerdict::Old);
        assert_eq!(
            follower.offer(&of(plan(ONE, 2, 4), 2)),
            PlanVerdict::Adopted
        );
        assert!(follower.plans().iter().all(|plan| plan.lease.number == 2));
    }

    #[test]
    fn what_a_lower_right_has_given_and_nobody_follows_is_void_whatever_its_revision() {
        let of = |plan: Plan, number: u32| Plan {
            lease: tomoswarm_proto::Lease { number, holder: 7 },
            ..plan
        };
        let mut follower = following(&plan(ONE, 2, 3));
        follower.hear(second(1.0), &peer(2, None, None));
        assert_eq!(
            follower.offer(&of(plan(ONE, 900, 0), 1)),
            PlanVerdict::Unchanged
        );
        assert!(follower.next_leg().is_none());
        assert_eq!(
            follower.offer(&of(plan(ONE, 3, 0), 2)),
            PlanVerdict::Unchanged
        );
        assert_eq!(follower.pending_edition(), Some((RunId(1), Revision(3))));
        assert_eq!(
            follower.offer(&of(plan(TWO, 900, 0), 1)),
            PlanVerdict::Unchanged,
            "a later one is collected"
        );
        assert_eq!(
            follower.offer(&of(plan(ONE, 2, 3), 3)),
            PlanVerdict::Old,
            "it is followed already"
        );
        assert_eq!(
            follower.next_leg().map(|stop| stop.id),
            Some(StopId(1)),
            "and nothing is newer"
        );
    }

    #[test]
    fn a_revision_that_a_peer_does_not_say_again_is_none_that_it_follows() {
        for (heard_s, rests) in [(10.9, false), (11.1, true)] {
            let mut own = plan(ONE, 2, 1);
            (own.stops[0].dwell_ms, own.stops[0].dwell_limit_ms) = (1000, 60_000);
            own.stops[0].partners = vec![TWO];
            let mut follower = following(&own);
            follower.hear(second(0.9), &peer(2, None, None));
            follower.hear(second(1.0), &peer(900, None, None));
            follower.hear(second(heard_s), &peer(2, None, None));
            follower.enter(StopId(1)).unwrap();
            follower.arrive(second(12.0), StopId(1), at(1.0)).unwrap();
            let stays_s = if rests { 1.0 } else { 60.0 };
            assert_eq!(
                follower.deadline().map(|deadline| deadline.at),
                Some(second(12.0 + stays_s))
            );
        }
    }

    #[test]
    fn a_peer_that_lost_its_count_of_starts_is_believed_after_a_silence() {
        let of = |boot: u32, leg: Option<u32>| VehicleProgress {
            boot: Boot(boot),
            ..peer(2, None, leg)
        };
        for (heard_s, rests) in [(30.9, false), (31.1, true)] {
            let mut own = plan(ONE, 2, 1);
            (own.stops[0].dwell_ms, own.stops[0].dwell_limit_ms) = (1000, 60_000);
            own.stops[0].partners = vec![TWO];
            let mut follower = following(&own);
            follower.hear(second(1.0), &of(40, Some(1)));
            follower.enter(StopId(1)).unwrap();
            follower.arrive(second(2.0), StopId(1), at(1.0)).unwrap();
            follower.hear(second(heard_s), &of(3, None));
            let stays_s = if rests { 1.0 } else { 60.0 };
            let expected = (!rests).then(|| second(2.0 + stays_s));
            assert_eq!(
                follower.deadline().map(|deadline| deadline.at),
                expected,
                "{heard_s}"
            );
        }
    }
}
