//! The mission actor: decides where the vehicle goes next, as its plan, its operator and its peers let it.
//!
//! It is told the own and the peers' states, tiles, plans, progress, orders and the vehicle's remarks. It says
//! commands, progress, what it measures for, and remarks. Which leg may be entered is decided by
//! [`crate::sweep::Follower`], how a leg is driven by `pilot`; the last word on safety has the vehicle actor.
//!
//! ```text
//!            Start                     Hold / Emergency
//!   Waiting ───────► Following ◄──────────────────────► Held
//!                        │ Return        Start            │ Return
//!                        ▼                                ▼
//!                    Returning (lower ids first) ─► Home, at rest
//! ```
//!
//! Without an order it holds or returns when it hears nobody, has lost the bus or runs out of battery: see `autonomy`.
//! Once off its plan it moves again only under a newer revision, planned from where it is.
//!
//! Deadlines: `repeat progress`, `the dwell at the stop ends`, `path ready`, `search again`.

mod autonomy;
mod errand;
mod look;
mod pilot;
mod report;
mod returning;
mod skipping;
mod way;
mod words;

use std::collections::BTreeSet;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Lease, Order, OrderKind, Plan, Revision, RunId, SeenState, StandReason, StopId, VehicleId,
};

use self::autonomy::Links;
use self::errand::{Errand, Scene};
use self::pilot::{Met, Pilot};
use self::returning::Line;
use super::ages::Ages;
use super::peers::{Peer, Peers};
use super::vehicle::{self, Command};
use super::{OwnState, Settings};
use crate::actor::{Actor, Fault};
use crate::geom::Point;
use crate::sweep::{Follower, VehicleProgress, Verdict, WaitsFor};
use crate::time::{Deadline, Time};

pub use autonomy::Cause;
pub use errand::End;
pub use words::{In, Key, Out, Remark, Standing};

/// Progress is repeated this often.
const REPEAT_EVERY: Duration = Duration::from_secs(1);
/// Legs are entered ahead until the way is this long, metres, so that stops are driven through.
const ENTER_AHEAD_M: f64 = 3.0;
/// Legs are entered ahead this far when nothing nearer can be reached, metres.
const ENTER_FAR_M: f64 = 20.0;
/// Searches in vain before a stop is given up.
const FAILURES_MAX: u32 = 3;
/// A plan may begin at most this far from where the vehicle stands, metres.
const START_TOLERANCE_M: f64 = 0.5;

/// What is wanted of this vehicle, by its operator or by itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
enum Wanted {
    Waiting,
    Following,
    Held,
    /// Since when it is ordered to return, and whether it is on its way.
    Returning {
        since: Time,
        under_way: bool,
    },
    /// It came home.
    Home,
}

/// The mission actor.
#[derive(Debug, Serialize, Deserialize)]
pub struct Mission {
    settings: Settings,
    state: Option<OwnState>,
    follower: Option<Follower>,
    pilot: Pilot,
    /// What it does when the ground station does not plan for it.
    errand: Option<Errand>,
    wanted: Wanted,
    line: Line,
    /// Why it wants that, unless it was ordered.
    own: Option<Cause>,
    links: Links,
    is_battery_low: bool,
    /// It has left its plan, and goes on only under a newer one.
    is_off_plan: bool,
    peers: Peers,
    silent: BTreeSet<VehicleId>,
    ages: Ages,
    /// The highest right by which it was ordered or planned for.
    lease: Lease,
    said_holds: Option<StandReason>,
    said: VehicleProgress,
    said_measure: Option<RunId>,
    finished: bool,
    /// The plan last not taken, since it is old or leads out of the fence.
    not_taken: Option<(RunId, Revision)>,
    /// Stops given up since one was reached.
    skips: u32,
    repeat_at: Time,
}

impl Mission {
    /// Makes the actor of a vehicle that waits for plans and a start.
    pub fn new(settings: Settings) -> Mission {
        let said =
            VehicleProgress { vehicle: settings.vehicle, boot: settings.boot, ..VehicleProgress::default() };
        let repeat_at = Time::ZERO + REPEAT_EVERY + Duration::from_millis(53) * u32::from(settings.vehicle.0);
        Mission {
            pilot: Pilot::new(settings.clone()),
            errand: Errand::of(&settings),
            peers: Peers::new(settings.vehicle),
            settings,
            state: None,
            follower: None,
            wanted: Wanted::Waiting,
            line: Line::default(),
            own: None,
            links: Links::default(),
            is_battery_low: false,
            is_off_plan: false,
            silent: BTreeSet::new(),
            ages: Ages::default(),
            lease: Lease::default(),
            said_holds: None,
            said,
            said_measure: None,
            finished: false,
            not_taken: None,
            skips: 0,
            repeat_at,
        }
    }

    /// Says why no leg may be entered now, for status lines.
    pub fn waits_for(&self) -> Option<WaitsFor> {
        self.follower.as_ref().and_then(Follower::waits_for)
    }

    fn state(&mut self, now: Time, state: OwnState, out: &mut Vec<Out>) {
        let place = state.pose.at;
        if self.follower.is_none() {
            self.follower = Some(Follower::new(self.settings.vehicle, place, START_TOLERANCE_M));
            self.pilot.begin_at(place);
        }
        self.ages.note(now, state.sequence);
        self.lease = self.lease.max(state.ordered.lease);
        self.state = Some(state);
        self.go_on(now, out);
    }

    /// Goes on with whatever is wanted; called with every state and when something else has changed.
    fn go_on(&mut self, now: Time, out: &mut Vec<Out>) {
        self.look_after_itself(now, out);
        match self.wanted {
            Wanted::Following | Wanted::Returning { .. } if self.links.is_alone => {}
            Wanted::Following => self.follow(now, out),
            Wanted::Returning { since, under_way } => self.bring_home(now, since, under_way, out),
            Wanted::Held | Wanted::Waiting | Wanted::Home => self.stay(),
        }
        self.report(out);
    }

    fn follow(&mut self, now: Time, out: &mut Vec<Out>) {
        if self.errand.is_some() {
            return self.run_errand(now, out);
        }
        if self.is_off_plan {
            return self.stay();
        }
        if let Some(follower) = &mut self.follower {
            follower.resume();
        }
        self.enter_legs();
        self.drive(now, out);
        if let Some(follower) = &mut self.follower {
            follower.wake(now);
        }
        // Who gets nowhere lets the ground plan anew from here; who is asked to change its plan does so where it rests.
        let commanded = out.iter().any(|said| matches!(said, Out::Command(..)));
        let is_asked = matches!(self.waits_for(), Some(WaitsFor::Revision { .. }));
        if (self.pilot.failures() >= FAILURES_MAX || is_asked) && !commanded {
            self.stay();
        }
    }

    fn run_errand(&mut self, now: Time, out: &mut Vec<Out>) {
        let met = self.advance(now, out);
        let (Some(state), Some(errand)) = (&self.state, &mut self.errand) else { return };
        let mut scene = Scene { now, state, pilot: &mut self.pilot, peers: &self.peers, out };
        errand.go_on(&mut scene, &met);
        // What was chosen just now is begun at once.
        self.advance(now, out);
    }

    /// Enters legs ahead as far as the plans allow, so that stops without dwell are driven through.
    fn enter_legs(&mut self) {
        let Some(follower) = &mut self.follower else { return };
        let ahead_m = if self.pilot.failures() > 0 { ENTER_FAR_M } else { ENTER_AHEAD_M };
        while self.pilot.way().length_m() < ahead_m {
            let Some(stop) = follower.next_leg().cloned() else { return };
            if follower.enter(stop.id).is_err() {
                return;
            }
            let route = stop.route.iter().map(|corner| Point::from(*corner));
            self.pilot.append(route, stop.at.into(), Some(stop.id));
        }
    }

    fn done(&mut self, now: Time, stop: StopId, place: Point) {
        if let Some(follower) = &mut self.follower {
            // Only a stop of a plan that was given up meanwhile is refused: then nobody waits for it.
            let _ = follower.arrive(now, stop, place);
        }
    }

    fn drive(&mut self, now: Time, out: &mut Vec<Out>) {
        for met in self.advance(now, out) {
            self.meet(now, met, out);
        }
    }

    /// Lets the pilot go on; gives what it met.
    fn advance(&mut self, now: Time, out: &mut Vec<Out>) -> Vec<Met> {
        let Some(state) = &self.state else { return Vec::new() };
        let stands = |peer: &&Peer| peer.resting || peer.is_silent(now);
        let standing = self.peers.iter().map(|(_, peer)| peer).filter(stands).map(|peer| peer.claim.clone());
        self.pilot.keep_clear_of(standing.collect());
        let mut met = Vec::new();
        let command = self.pilot.advance(now, state, &mut met);
        out.extend(command.map(|command| Out::Command(now, command)));
        met
    }

    fn meet(&mut self, now: Time, met: Met, out: &mut Vec<Out>) {
        let remark = match met {
            Met::Stop(stop) => {
                let place = self.state.as_ref().map(|state| state.pose.at).unwrap_or_default();
                self.skips = 0;
                self.done(now, stop, place);
                Remark::Done(stop)
            }
            Met::Looks(at) => Remark::Looks(at),
            Met::Blocked(at) => Remark::Blocked(at),
            Met::Path(length_m) => Remark::Path(length_m),
            Met::NoPath(failures) => {
                if failures >= FAILURES_MAX {
                    self.give_up_stop(now, out);
                }
                self.finds_no_way_home(now, failures);
                Remark::NoPath(failures)
            }
        };
        out.push(Out::Remark(remark));
    }

    /// Without a way to drive: a newer revision may be adopted from where the vehicle rests.
    fn stay(&mut self) {
        let (Some(follower), Some(state)) = (&mut self.follower, &self.state) else { return };
        let at_rest = state.speed_mps == 0.0 && state.leg.is_none();
        if at_rest {
            // A newer revision may be adopted by that; `report` sees it.
            follower.hold(state.pose.at);
        }
    }

    fn plan(&mut self, now: Time, plan: &Plan, out: &mut Vec<Out>) {
        let edition = (plan.run, plan.revision);
        let outside = self.leads_outside(plan).map(Remark::Outside);
        let old = self.is_old(now, plan).then_some(Remark::OldPlan(plan.run, plan.revision));
        if let Some(remark) = old.or(outside) {
            if self.not_taken.replace(edition) != Some(edition) {
                out.push(Out::Remark(remark));
            }
            return;
        }
        self.lease = self.lease.max(plan.lease);
        self.resume_for(now, plan, out);
        let Some(follower) = &mut self.follower else { return };
        let before = follower.refusal().cloned();
        match follower.offer(plan) {
            Verdict::Refused(refusal) if before.as_ref() != Some(&refusal) => {
                out.push(Out::Remark(Remark::Refused(refusal)));
            }
            Verdict::Adopted | Verdict::Refused(_) | Verdict::Old | Verdict::Kept => {}
        }
        self.report(out);
    }

    /// Tells whether a plan has a lower right than another that was heard, or the own one answers a state that was made
    /// too long ago. (No state was made before the first; only what has heard none answers that.)
    fn is_old(&self, now: Time, plan: &Plan) -> bool {
        let is_own = plan.vehicle == self.settings.vehicle && plan.seen.is_some();
        plan.lease < self.lease || (is_own && !self.answers(now, plan))
    }

    /// Tells whether a plan answers a state that this start of the software made not long ago.
    fn answers(&self, now: Time, plan: &Plan) -> bool {
        let is_fresh =
            |seen: SeenState| seen.boot == self.settings.boot && self.ages.is_fresh(now, seen.sequence);
        plan.seen.is_some_and(is_fresh)
    }

    /// Gives the first place of the own plan that lies outside the fence.
    fn leads_outside(&self, plan: &Plan) -> Option<Point> {
        let own = plan.stops.iter().filter(|_| plan.vehicle == self.settings.vehicle);
        let mut places = own.flat_map(|stop| stop.route.iter().chain([&stop.at])).map(|at| Point::from(*at));
        places.find(|at| !self.settings.fence.contains(*at))
    }

    /// A new revision is followed: what was left of the old way is given up.
    fn adopted(&mut self, progress: VehicleProgress, out: &mut Vec<Out>) {
        (self.finished, self.is_off_plan) = (false, false);
        if let Some(state) = &self.state {
            self.pilot.give_up(state.pose.at);
        }
        out.push(Out::Accepted(progress.run, progress.revision));
        out.push(Out::Remark(Remark::Adopted(progress.run, progress.revision)));
    }

    fn hear(&mut self, now: Time, progress: &VehicleProgress, out: &mut Vec<Out>) {
        if let Some(follower) = &mut self.follower {
            follower.hear(now, progress);
            self.report(out);
        }
    }

    fn order(&mut self, now: Time, order: Order, out: &mut Vec<Out>) {
        self.lease = self.lease.max(order.lease);
        (self.own, self.line) = (None, Line::default());
        match order.kind {
            OrderKind::Start if self.wanted == Wanted::Home && self.is_battery_low => {}
            OrderKind::Start => {
                if matches!(self.wanted, Wanted::Returning { under_way: true, .. }) {
                    self.stop(now, out);
                }
                self.wanted = Wanted::Following;
            }
            OrderKind::Hold | OrderKind::Land | OrderKind::Emergency | OrderKind::CutMotors => {
                self.wanted = Wanted::Held;
                self.stop(now, out);
            }
            OrderKind::Return => {
                self.wanted = Wanted::Returning { since: now, under_way: false };
                self.stop(now, out);
            }
        }
        self.go_on(now, out);
    }

    fn stop(&mut self, now: Time, out: &mut Vec<Out>) {
        if let Some(errand) = &mut self.errand {
            errand.interrupt(now);
        }
        self.pilot.halted(now);
        out.push(Out::Command(now, Command::Hold));
    }

    fn remark(&mut self, now: Time, remark: &vehicle::Remark) {
        match remark {
            vehicle::Remark::Halted { bump, .. } => {
                self.pilot.bumped(now, *bump);
                self.pilot.halted(now);
            }
            vehicle::Remark::Refused(refusal) => {
                self.pilot.refused(now);
                if let vehicle::Refusal::Separation(peer) = refusal {
                    self.yields_to(now, *peer);
                }
            }
            vehicle::Remark::AutopilotSilent => {}
        }
    }

    /// Says progress and what is measured for, when they have changed.
    fn report(&mut self, out: &mut Vec<Out>) {
        let Some(follower) = &self.follower else { return };
        let progress = VehicleProgress { boot: self.settings.boot, ..follower.progress() };
        if progress != self.said {
            if (progress.run, progress.revision) != (self.said.run, self.said.revision) {
                self.adopted(progress, out);
            }
            self.said = progress;
            out.push(Out::Progress(self.on_wire()));
        }
        let following = self.wanted == Wanted::Following;
        let finished = self.follower.as_ref().is_some_and(Follower::finished);
        if finished && !self.finished && progress.done.is_some() {
            self.finished = true;
            out.push(Out::Remark(Remark::Finished(progress.run)));
        }
        let measure = (following && !finished && progress.run != RunId::default()).then_some(progress.run);
        if measure != self.said_measure {
            self.said_measure = measure;
            out.push(Out::Measure(measure));
        }
        if self.holds_for() != self.said_holds {
            self.said_holds = self.holds_for();
            out.push(Out::Holds(self.said_holds));
        }
    }

    /// The pilot wants to be woken only while something is being driven.
    fn pilot_deadline(&self) -> Option<Deadline> {
        match self.wanted {
            _ if self.links.is_alone => None,
            Wanted::Following if self.errand.is_some() => {
                let errand = self.errand.as_ref().and_then(Errand::deadline);
                Deadline::earlier(errand, self.pilot.deadline())
            }
            Wanted::Following if self.is_off_plan => None,
            Wanted::Following | Wanted::Returning { under_way: true, .. } => self.pilot.deadline(),
            Wanted::Waiting | Wanted::Held | Wanted::Home | Wanted::Returning { under_way: false, .. } => {
                None
            }
        }
    }

    fn dwell_deadline(&self) -> Option<Deadline> {
        let following = self.wanted == Wanted::Following && !self.is_off_plan && !self.links.is_alone;
        self.follower.as_ref().filter(|_| following).and_then(Follower::deadline)
    }
}

impl Actor for Mission {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::State(state) => self.state(now, state, out),
            In::Peer(state) => self.peers.take(now, &state),
            In::Tile(tile) => {
                self.pilot.learn(&tile);
                if let Some(errand) = &mut self.errand {
                    errand.learn(&tile);
                }
            }
            In::Plan(plan) => self.plan(now, &plan, out),
            In::Progress(progress) => self.hear(now, &progress, out),
            In::Sighted(sighting) => {
                self.peers.sight(now, &sighting);
                self.links.heard_radio(now);
                self.hear(now, &sighting.progress, out);
            }
            In::Heard(by) => self.links.heard_bus(now, self.settings.vehicle, by),
            In::Order(order) => self.order(now, order, out),
            In::Remark(remark) => self.remark(now, &remark),
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let repeat = Some(Deadline { at: self.repeat_at, why: "repeat progress" });
        [repeat, self.dwell_deadline(), self.pilot_deadline()].into_iter().fold(None, Deadline::earlier)
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        if self.repeat_at <= now {
            self.repeat_at = now + REPEAT_EVERY;
            out.push(Out::Progress(self.on_wire()));
        }
        self.go_on(now, out);
        Ok(())
    }
}

#[cfg(test)]
mod autonomy_tests;
#[cfg(test)]
mod returning_tests;
#[cfg(test)]
mod tests;
