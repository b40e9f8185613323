//! The mission that the ground station plans: stops in an order that all vehicles of a revision share. It is told plans,
//! peers' progress, which stops were passed and where the vehicle rests, and says which leg is driven next and what is
//! given up. Which leg may be entered is decided by [`crate::sweep::Follower`].
//!
//! It is there whatever the vehicle is out for: a revision is adopted by everyone, or by nobody. Once the vehicle has left
//! its plan it moves again only under a newer revision, planned from where it is.
//!
//! Deliberately absent: how a leg is driven, see `pilot`, and whether the vehicle is to follow at all, see `goal`.

mod published_progress;
mod refusals;

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{MissionPhase, Plan, RunId, Stop, StopId, VehicleId};

use self::published_progress::{PlanChanges, PublishedProgress};
use self::refusals::Refusals;
use super::MissionEvent;
use crate::geom::Point;
use crate::node::VehicleSettings;
use crate::sweep::{Follower, OfferResult, VehicleProgress, WaitsFor};
use crate::time::{Deadline, Time};

/// Legs are entered ahead until the way is this long, metres, so that stops are driven through.
const ENTER_AHEAD_M: f64 = 3.0;
/// Legs are entered ahead this far when nothing nearer can be reached, metres.
const ENTER_FAR_M: f64 = 20.0;
/// A plan may begin at most this far from where the vehicle stands, metres.
const START_TOLERANCE_M: f64 = 0.5;
/// So many stops at the end of a plan may be given up although nothing behind them can be reached.
const LAST_STOPS: usize = 4;
/// So many stops in a row may be given up: beyond that the ring is closed off.
const SKIPS_MAX: u32 = 16;
/// So many stops behind those entered are tried before one is given up.
const LOOK_STOPS: usize = 8;
/// A revision that was not heard for this long while an earlier one is given is nobody's: a ground station says its newest
/// one alone, and no plan is that long on its way.
const UNHEARD_AFTER: Duration = Duration::from_secs(15);

/// The plan that a vehicle follows, or may follow.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct GroundPlan {
    vehicle: VehicleId,
    /// `None` as long as the vehicle does not know where it is.
    follower: Option<Follower>,
    /// The vehicle has left the plan, and goes on only under a newer one.
    has_left: bool,
    refusals: Refusals,
    /// When a plan of the revision that is not adopted yet was heard last.
    pending_at: Time,
    /// Stops given up since one was reached.
    skips: u32,
    published: PublishedProgress,
}

impl GroundPlan {
    /// Makes the plan of a vehicle that has heard of none.
    pub(super) fn new(settings: &VehicleSettings) -> GroundPlan {
        GroundPlan {
            vehicle: settings.vehicle,
            follower: None,
            has_left: false,
            refusals: Refusals::new(settings.vehicle, settings.fence.clone()),
            pending_at: Time::ZERO,
            skips: 0,
            published: PublishedProgress::new(VehicleProgress {
                vehicle: settings.vehicle,
                boot: settings.boot,
                ..VehicleProgress::default()
            }),
        }
    }

    /// Records where the vehicle is; returns whether that was not known before.
    pub(super) fn begin_at(&mut self, place: Point) -> bool {
        let is_new = self.follower.is_none();
        self.follower
            .get_or_insert_with(|| Follower::new(self.vehicle, place, START_TOLERANCE_M));
        is_new
    }

    /// Returns whether the vehicle knows where it is, so that plans can be followed.
    pub(super) fn is_begun(&self) -> bool {
        self.follower.is_some()
    }

    /// Returns how far the vehicle was when that was last asked.
    pub(super) fn progress(&self) -> VehicleProgress {
        self.published.progress()
    }

    /// Returns how many stops of the plan are done, and how many it has; none of none while there is no plan.
    pub(super) fn stops_done(&self) -> (usize, usize) {
        self.follower.as_ref().map_or((0, 0), Follower::stops_done)
    }

    /// Returns whether all stops of a plan are done.
    pub(super) fn is_done(&self) -> bool {
        self.published.is_end_told()
    }

    /// Returns what the vehicle does for the plan while it follows.
    pub(super) fn phase(&self) -> MissionPhase {
        match (&self.follower, self.waits_for()) {
            _ if self.has_left => MissionPhase::Waiting,
            (Some(follower), _) if follower.deadline().is_some() => MissionPhase::Dwelling,
            _ if self.progress().leg.is_some() => MissionPhase::Going,
            (_, Some(WaitsFor::Plans | WaitsFor::Revision { .. } | WaitsFor::Member { .. })) => {
                MissionPhase::Waiting
            }
            (_, Some(WaitsFor::Stop { .. })) => MissionPhase::Yielding,
            (_, Some(WaitsFor::Dwell { .. })) => MissionPhase::Dwelling,
            // An empty revision only brings everyone to rest: the next one says where to go.
            (_, Some(WaitsFor::Nothing)) if self.stops_done().1 == 0 => MissionPhase::Waiting,
            (_, Some(WaitsFor::Nothing)) => MissionPhase::Over,
            (Some(_), None) => MissionPhase::Going,
            (None, None) => MissionPhase::Waiting,
        }
    }

    /// Returns why no leg may be entered now.
    pub(super) fn waits_for(&self) -> Option<WaitsFor> {
        self.follower.as_ref().and_then(Follower::waits_for)
    }

    /// Records that the vehicle leaves its plan.
    pub(super) fn leave(&mut self) {
        self.has_left = true;
    }

    /// Returns whether the vehicle has left its plan.
    pub(super) fn has_left(&self) -> bool {
        self.has_left
    }

    /// Returns why a plan is not taken, the first time that it comes; `is_old` = it answers a state that is too old, or
    /// has a lower right than others.
    pub(super) fn refuse(&mut self, plan: &Plan, is_old: bool) -> Result<(), Option<MissionEvent>> {
        self.refusals.judge(plan, is_old)
    }

    /// Returns whether a plan is the vehicle's own and newer than the one followed.
    pub(super) fn is_newer(&self, plan: &Plan) -> bool {
        let followed = self.follower.as_ref().and_then(Follower::plan);
        let edition = (plan.run, plan.revision);
        plan.vehicle == self.vehicle
            && followed.is_none_or(|known| edition > (known.run, known.revision))
    }

    /// Takes a plan, own or a peer's; returns why the revision does not fit, when that is news.
    pub(super) fn offer(&mut self, now: Time, plan: &Plan) -> Option<MissionEvent> {
        let follower = self.follower.as_mut()?;
        let edition = (plan.run, plan.revision);
        match follower.pending_edition() {
            Some(pending) if edition < pending => {
                if now.since(self.pending_at) >= UNHEARD_AFTER {
                    follower.give_up_pending();
                    self.pending_at = now;
                }
            }
            Some(_) | None => self.pending_at = now,
        }
        let before = follower.refusal().cloned();
        match follower.offer(plan) {
            OfferResult::Refused(refusal) => {
                (before.as_ref() != Some(&refusal)).then_some(MissionEvent::Refused(refusal))
            }
            OfferResult::Adopted | OfferResult::Old | OfferResult::Unchanged => None,
        }
    }

    /// Records how far a peer is.
    pub(super) fn hear(&mut self, now: Time, progress: &VehicleProgress) {
        if let Some(follower) = &mut self.follower {
            follower.hear(now, progress);
        }
    }

    /// Records that a vehicle that was held goes on.
    pub(super) fn resume(&mut self) {
        if let Some(follower) = &mut self.follower {
            follower.resume();
        }
    }

    /// Enters the next leg and returns it: stops without dwell are driven through, so legs are entered ahead of a way that
    /// is still `way_m` long. Farther ahead when there is `no_path` to what was entered.
    pub(super) fn enter_next(&mut self, way_m: f64, no_path: bool) -> Option<Stop> {
        let ahead_m = if no_path { ENTER_FAR_M } else { ENTER_AHEAD_M };
        let follower = self.follower.as_mut().filter(|_| way_m < ahead_m)?;
        let stop = follower.next_leg().cloned()?;
        follower.enter(stop.id).is_ok().then_some(stop)
    }

    /// Records that a stop was passed or reached.
    pub(super) fn pass(&mut self, now: Time, stop: StopId, place: Point) {
        self.skips = 0;
        self.done(now, stop, place);
    }

    /// Records that a stop is given up.
    pub(super) fn skip(&mut self, now: Time, stop: StopId, place: Point) {
        self.done(now, stop, place);
    }

    fn done(&mut self, now: Time, stop: StopId, place: Point) {
        if let Some(follower) = &mut self.follower {
            // Only a stop of a plan that was given up meanwhile is refused: then nobody waits for it.
            let _ = follower.arrive(now, stop, place);
        }
    }

    /// Records that time goes on while the vehicle follows.
    pub(super) fn wake(&mut self, now: Time) {
        if let Some(follower) = &mut self.follower {
            follower.wake(now);
        }
    }

    /// Records that the vehicle rests at a place without a way to drive: a newer revision may be adopted from there.
    pub(super) fn rest_at(&mut self, place: Point) {
        if let Some(follower) = &mut self.follower {
            // Whether one was adopted shows in the news.
            follower.hold(place);
        }
    }

    /// Returns whether the next stop is given up, `ahead` of those entered being left: neither it nor another one that may
    /// be entered can be reached, but one behind them can; the others wait for this vehicle, and it would wait for them.
    pub(super) fn gives_up_stop(
        &mut self,
        ahead: usize,
        can_reach: impl Fn(Point) -> bool,
    ) -> bool {
        let behind = self.stops_behind();
        let is_end = behind.is_empty() && ahead <= LAST_STOPS;
        let leads_on = || {
            is_end
                || behind
                    .iter()
                    .take(LOOK_STOPS)
                    .any(|stop| can_reach(stop.at.into()))
        };
        let gives_up = self.skips < SKIPS_MAX && leads_on();
        self.skips += u32::from(gives_up);
        gives_up
    }

    /// The stops of the plan behind those that are entered.
    fn stops_behind(&self) -> &[Stop] {
        let Some(follower) = &self.follower else {
            return &[];
        };
        let stops = follower.plan().map_or(&[][..], |plan| &plan.stops);
        let last = follower.entered().last().map(|stop| stop.id);
        let entered = stops.iter().position(|stop| Some(stop.id) == last);
        entered.map_or(&[], |index| &stops[index + 1..])
    }

    /// Returns what has changed since it was last asked.
    pub(super) fn news(&mut self) -> PlanChanges {
        let Some(follower) = &self.follower else {
            return PlanChanges::default();
        };
        let news = self
            .published
            .news(follower.progress(), follower.finished());
        self.has_left &= !news.is_adopted;
        news
    }

    /// Returns the run for which is measured while the plan is followed.
    pub(super) fn measures_for(&self) -> Option<RunId> {
        let follower = self
            .follower
            .as_ref()
            .filter(|follower| !follower.finished())?;
        Some(follower.progress().run).filter(|run| *run != RunId::default())
    }

    /// Returns when the dwell at a stop ends.
    pub(super) fn deadline(&self) -> Option<Deadline> {
        self.follower
            .as_ref()
            .filter(|_| !self.has_left)
            .and_then(Follower::deadline)
    }
}

#[cfg(test)]
mod tests;
