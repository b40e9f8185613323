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

mod adopted;
mod peers;
mod pending;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Plan, Revision, RunId, Stop, StopId, VehicleId};

use self::adopted::Adopted;
use self::peers::{Edition, PeerFacts};
use self::pending::{AdoptingVehicle, PendingRevision};
use super::{FollowError, OfferResult, PlanRefusal, VehicleProgress, WaitsFor};
use crate::geom::Point;
use crate::time::{Deadline, Time};

/// Follows the newest revision of plans; see the module's page for the rules.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Follower {
    vehicle: VehicleId,
    tolerance_m: f64,
    rest: Option<Point>,
    adopted: Option<Adopted>,
    pending: PendingRevision,
    peers: PeerFacts,
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
            pending: PendingRevision::default(),
            peers: PeerFacts::default(),
        }
    }

    /// Takes a plan heard, own or a peer's; plans may come in any order and any number of times.
    pub fn offer(&mut self, plan: &Plan) -> OfferResult {
        if self.pending.collect(plan, self.adopted_edition()) {
            self.try_adopting()
        } else {
            OfferResult::Old
        }
    }

    /// Forgets a newer revision that is not adopted, as if it had not been heard: what is followed goes on. That is safe,
    /// since nobody was told that it is followed.
    pub fn give_up_pending(&mut self) {
        self.pending.give_up();
    }

    /// Takes a peer's progress, from the bus or by radio; late and repeated ones do no harm.
    pub fn hear(&mut self, now: Time, progress: &VehicleProgress) {
        if progress.vehicle == self.vehicle {
            return;
        }
        let is_latest = self.peers.hear(now, progress);
        let edition = (progress.run, progress.revision);
        let same = self
            .adopted
            .as_mut()
            .filter(|adopted| adopted.edition() == edition);
        if let Some(adopted) = same {
            adopted.hear(progress, is_latest);
        }
        self.wake(now);
    }

    /// Records that the vehicle stands at `at`, held in the middle of a leg or brought there off plan, so
    /// that it may change to a newer revision from there; true when it has changed, and the leg is given up.
    ///
    /// From now on also an offered plan may change the revision; [`Follower::resume`] must be called
    /// before the vehicle moves again, and does nothing when the leg was given up meanwhile.
    pub fn hold(&mut self, at: Point) -> bool {
        self.rest = Some(at);
        self.try_adopting() == OfferResult::Adopted
    }

    /// Records that a held vehicle goes on with the legs that it had entered.
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
        let adopted = self.adopted.as_ref();
        let adopted = adopted.filter(|_| self.pending.revision().is_none());
        adopted?.may_enter(ahead)
    }

    /// Returns why no leg may be entered now; `None` when [`Follower::next_leg`] gives one.
    pub fn waits_for(&self) -> Option<WaitsFor> {
        if let Some(revision) = self.pending.revision() {
            let refusal = self.refusal().cloned();
            return Some(WaitsFor::Revision { revision, refusal });
        }
        match &self.adopted {
            None => Some(WaitsFor::Plans),
            Some(adopted) => adopted.waits_for(),
        }
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
            adopted.enter();
            self.rest = None;
        }
        Ok(())
    }

    /// Records that the vehicle passes or has reached the stop whose leg it drives.
    ///
    /// With a dwell it begins; without one the stop is done at once. When no leg behind the stop was
    /// entered the vehicle must stand at `at`, and may change to a newer revision here.
    ///
    /// # Errors
    /// It is not the first stop that is entered and not done.
    pub fn arrive(&mut self, now: Time, stop: StopId, at: Point) -> Result<(), FollowError> {
        let adopted = self.adopted.as_mut().ok_or(FollowError::NotThere(stop))?;
        let (edition, peers) = (adopted.edition(), &self.peers);
        adopted.arrive(now, stop, |peer| peers.rests_under(peer, edition))?;
        if !adopted.is_driving() {
            self.rest = Some(at);
        }
        self.try_adopting();
        Ok(())
    }

    /// Returns when the dwell ends, if the vehicle dwells.
    pub fn deadline(&self) -> Option<Deadline> {
        let at = self.adopted.as_ref()?.dwell_ends()?;
        Some(Deadline {
            at,
            why: "the dwell at the stop ends",
        })
    }

    /// Ends a dwell whose time is over; true when a stop was done by that.
    pub fn wake(&mut self, now: Time) -> bool {
        let adopted = self.adopted.as_mut();
        adopted.is_some_and(|adopted| adopted.end_dwell(now))
    }

    /// Returns the progress to publish, on change and again and again, also before any plan is there; its boot is for the
    /// caller to fill in.
    pub fn progress(&self) -> VehicleProgress {
        let nothing = VehicleProgress {
            vehicle: self.vehicle,
            ..VehicleProgress::default()
        };
        self.adopted.as_ref().map_or(nothing, Adopted::progress)
    }

    /// Returns whether every stop of the revision followed is done and no newer revision is known.
    pub fn finished(&self) -> bool {
        let ended = |adopted: &Adopted| adopted.done() >= adopted.stops().len();
        self.pending.revision().is_none() && self.adopted.as_ref().is_some_and(ended)
    }

    /// Returns how many stops of its own plan are done, and how many it has; none of none before the first plan.
    pub fn stops_done(&self) -> (usize, usize) {
        let counts = |adopted: &Adopted| (adopted.done(), adopted.stops().len());
        self.adopted.as_ref().map_or((0, 0), counts)
    }

    /// Returns its own plan of the revision followed.
    pub fn plan(&self) -> Option<&Plan> {
        self.adopted.as_ref().map(Adopted::plan)
    }

    /// Returns the plans of all members of the revision followed; none before the first.
    #[cfg(test)]
    pub fn plans(&self) -> &[Plan] {
        self.adopted.as_ref().map_or(&[], Adopted::plans)
    }

    /// Returns the stops whose legs are entered and which are not done, the first the one driven to (or
    /// dwelt at).
    pub fn entered(&self) -> &[Stop] {
        self.adopted.as_ref().map_or(&[], Adopted::entered)
    }

    /// Returns why the newest revision is not followed, if it was refused.
    pub fn refusal(&self) -> Option<&PlanRefusal> {
        self.pending.refusal()
    }

    /// Returns run and revision of the plans that are being collected, newer than those followed.
    pub fn pending_edition(&self) -> Option<(RunId, Revision)> {
        self.pending.edition()
    }

    fn adopted_edition(&self) -> Option<Edition> {
        self.adopted.as_ref().map(Adopted::edition)
    }

    /// Adopts the pending revision when it is complete, fits, and the vehicle rests.
    fn try_adopting(&mut self) -> OfferResult {
        let plans = self.pending.adopt(AdoptingVehicle {
            vehicle: self.vehicle,
            rest: self.rest,
            tolerance_m: self.tolerance_m,
            follows: self.adopted.is_some(),
        });
        let plans = match plans {
            Ok(plans) => plans,
            Err(verdict) => return verdict,
        };
        let follows = |vehicle, edition| self.peers.follows(vehicle, edition);
        self.adopted = Some(Adopted::new(plans, self.vehicle, follows));
        OfferResult::Adopted
    }
}
