//! The execution of a sweep: brings everyone to rest, asks for plans, lets the vehicles follow them, counts laps, and waits
//! for the last samples. It plans anew when the plans no longer suit the vehicles that are there, and gives a sweep up when
//! they make no progress. How far it is, as a drawing: [`Phase`].
//!
//! It is told what is heard, and once a second it looks at the [`Conditions`]. It says what must be done elsewhere
//! ([`SweepOutput`]): who is ordered what, for whom plans are needed, what has become of the run. It orders nobody itself,
//! keeps no samples, and does not choose which sweep comes next.

mod completion;
mod idle_time;
mod missing_plans;
mod next_step;
mod phase;
mod published_plans;
mod sweep;
mod visited_ground;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Lease, OrderKind, Plan, RunEnd, RunId, VehicleId};

use self::completion::{close, count_laps};
pub(super) use self::idle_time::IdleLimits;
use self::idle_time::IdleTime;
use self::missing_plans::{MissingPlans, MissingPlansStep, PlannedFrom};
use self::next_step::{NextStep, must_rest};
pub(super) use self::phase::ExecutionPhase;
pub(super) use self::published_plans::PublishedPlans;
pub(super) use self::sweep::SweepRun;
use self::visited_ground::VisitedGround;
use super::StationEvent;
use super::lost_vehicles::{SilenceLimits, is_too_few};
use super::run_registry::RequestedSweep;
use crate::geom::Point;
use crate::ground::fleet::{Fleet, FleetChange, FleetMember};
use crate::ground::planner::{NoPlan, PlannerAnswer, Request};
use crate::ground::samples::SampleStore;
use crate::sweep::{Succession, VehicleProgress};
use crate::time::Time;

/// A vehicle that is farther from a stop when it is over with it has given it up, metres.
const GIVEN_UP_M: f64 = 1.5;

/// What the execution depends on beside its own state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conditions<'a> {
    pub now: Time,
    pub fleet: &'a Fleet,
    pub samples: &'a SampleStore,
    /// How often the map of all vehicles has changed.
    pub map_changes: u64,
    pub silence: SilenceLimits,
    pub idle: IdleLimits,
    /// By which right plans are given.
    pub lease: Lease,
    /// Whether an order other than Start is in force: then nothing is begun, planned or timed.
    pub is_held: bool,
    /// Whether samples can be stored: while they cannot, no run is closed.
    pub stores_samples: bool,
    /// Whether no vehicle is heard just now: then nobody can be seen to get on.
    pub is_deaf: bool,
}

/// What follows from the execution for the other parts of the station.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum SweepOutput {
    /// To be said to log and operator.
    StationEvent(StationEvent),
    /// To be published: the plans in force.
    Plans(Vec<Plan>),
    /// A run is planned for: it begins, or goes on with new plans.
    Begun(SweepRun),
    /// Every vehicle is to be started that nobody has stopped.
    StartAll(RunId),
    /// Every vehicle is to be held.
    HoldAll(RunId),
    /// Plans are needed; how the run is to be swept is not known here.
    PlansNeeded(Request),
    /// All vehicles have done a lap.
    LapDone { sweep: SweepRun, is_last: bool },
    /// Everything is done, and the samples are in.
    Closed(SweepRun),
    /// It was given up.
    GivenUp {
        run: RunId,
        end: RunEnd,
        why: String,
    },
}

/// The execution of one sweep after another.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct SweepExecution {
    phase: ExecutionPhase,
    plans: PublishedPlans,
    visited: VisitedGround,
    idle: IdleTime,
    /// Plans that were asked for, and could not be made.
    missing: Option<MissingPlans>,
}

impl SweepExecution {
    /// Goes on where an earlier start of the station was; times are counted from [`SweepExecution::count_from`] on.
    pub(super) fn restored(
        phase: ExecutionPhase,
        succession: Option<Succession>,
    ) -> SweepExecution {
        SweepExecution {
            phase,
            plans: PublishedPlans::restored(succession),
            visited: VisitedGround::default(),
            idle: IdleTime::default(),
            missing: None,
        }
    }

    /// Returns how far it is.
    pub(super) fn phase(&self) -> &ExecutionPhase {
        &self.phase
    }

    /// Returns the plans in force.
    pub(super) fn plans(&self) -> &PublishedPlans {
        &self.plans
    }

    /// Takes what a message of a vehicle has shown: the plans no longer suit one that has forgotten them, or is back.
    pub(super) fn hear(&mut self, now: Time, shown: FleetChange) {
        if shown.made_progress {
            self.phase.note_progress(now);
            self.visited.clear();
        }
        if shown.left_stop {
            self.idle.clear();
        }
        if shown.restarted || shown.found {
            self.phase.disturb();
        }
    }

    /// Returns whether a vehicle that stands at a place has not done the stop that it says it is over with: one that it gave up
    /// is done for the plan, but brings nobody on.
    pub(super) fn has_given_up(&self, progress: &VehicleProgress, at: Option<Point>) -> bool {
        let stop = progress
            .done
            .and_then(|stop| self.plans.place_of(progress.vehicle, stop));
        stop.zip(at)
            .is_some_and(|(stop, at)| stop.distance_to(at) > GIVEN_UP_M)
    }

    /// Takes the progress of a vehicle, said by the newest start of its software.
    pub(super) fn hear_progress(&mut self, progress: &VehicleProgress) {
        self.plans.hear(progress);
    }

    /// Compares a run with another one from now on, if it is the one that is under way.
    pub(super) fn compare_with(&mut self, run: RunId, compared_with: Option<RunId>) {
        if let Some(sweep) = self.phase.sweep_mut().filter(|sweep| sweep.run() == run) {
            sweep.compare_with(compared_with);
        }
    }

    /// Records that a run is left to the vehicles: if it was begun as a sweep, it is none.
    pub(super) fn leave_to_vehicles(&mut self, run: RunId) {
        if self.phase.sweep().is_some_and(|sweep| sweep.run() == run) {
            self.phase.end();
        }
    }

    /// Goes on after a time without a lease, or after a restart: nothing was heard or driven wrongly meanwhile.
    pub(super) fn count_from(&mut self, now: Time) {
        self.phase.count_from(now);
    }

    /// Begins a sweep, if none is under way.
    pub(super) fn begin(
        &mut self,
        requested: RequestedSweep,
        at: &Conditions<'_>,
        out: &mut Vec<SweepOutput>,
    ) {
        if self.phase.sweep().is_none() {
            self.plans.begin_run(requested.run, at.fleet);
            self.phase.begin(at.now, SweepRun::new(requested));
            self.idle.clear();
            self.rest(at, out);
        }
    }

    /// Goes on after an order that has held everyone up: vehicles that it has sent elsewhere are planned for anew from there.
    pub(super) fn go_on(
        &mut self,
        lifted: OrderKind,
        at: &Conditions<'_>,
        out: &mut Vec<SweepOutput>,
    ) {
        self.phase.go_on(at.now);
        self.idle.clear();
        self.missing = None;
        let is_elsewhere = match lifted {
            OrderKind::Return | OrderKind::Land | OrderKind::CutMotors => true,
            OrderKind::Start | OrderKind::Hold => false,
        };
        if is_elsewhere && matches!(self.phase, ExecutionPhase::Running { .. }) {
            self.rest(at, out);
        }
    }

    /// Publishes the plans in force.
    pub(super) fn publish(&mut self, at: &Conditions<'_>, out: &mut Vec<SweepOutput>) {
        let plans = self.plans.publish(at.now, at.lease, at.fleet);
        out.push(SweepOutput::Plans(plans));
    }

    /// Looks for vehicles that follow plans that were not given here: they are outnumbered, or the sweep is given up when
    /// they belong to a higher run, which vehicles prefer.
    pub(super) fn outnumber_others(&mut self, at: &Conditions<'_>, out: &mut Vec<SweepOutput>) {
        let Some(run) = self.phase.driven().map(SweepRun::run) else {
            return;
        };
        if at.fleet.highest_run() > run {
            out.push(SweepOutput::StationEvent(StationEvent::Overtaken(run)));
            self.give_up(RunEnd::Stopped, "vehicles follow a higher run", out);
        } else if self.plans.go_above(at.fleet.highest_revision(run)) {
            self.phase.disturb();
        }
    }

    /// Begins plans that were asked for. If a vehicle has come, gone or been restarted meanwhile, they are passed over:
    /// everyone is stopped first.
    pub(super) fn take_answer(
        &mut self,
        answer: PlannerAnswer,
        at: &Conditions<'_>,
        out: &mut Vec<SweepOutput>,
    ) {
        let ExecutionPhase::Planning { sweep, .. } = self.phase else {
            return;
        };
        let run = sweep.run();
        let is_asked_for = (answer.run, Some(answer.revision)) == (run, self.plans.next_revision());
        if !is_asked_for || must_rest(&self.phase, &self.plans, at) {
            return;
        }
        let cannot_follow = |why| NoPlan {
            why,
            is_of_places: false,
        };
        let begin = |plans| self.plans.begin(plans).map_err(cannot_follow);
        match answer.plans.and_then(begin) {
            Err(no_plan) => self.go_without_plan(no_plan, at, out),
            Ok(stops) => {
                self.missing = None;
                let laps = answer.laps.len();
                out.push(SweepOutput::StationEvent(StationEvent::Planned {
                    run,
                    laps,
                    stops,
                }));
                out.push(SweepOutput::Begun(sweep));
                self.phase.run(at.now, answer.laps);
                self.publish(at, out);
            }
        }
    }

    /// Does what is due: repeats plans or has new ones made, counts laps, and closes the run.
    pub(super) fn advance(&mut self, at: &Conditions<'_>, out: &mut Vec<SweepOutput>) {
        self.watch_places(at);
        match self.next_step(at, out) {
            NextStep::Wait => {}
            NextStep::Repeat => self.publish(at, out),
            NextStep::Replan => {
                self.idle.clear();
                self.replan(at, out);
            }
            NextStep::Retry => self.retry(at, out),
            NextStep::Ask => self.ask(at, out),
        }
        out.extend(count_laps(&mut self.phase, &self.plans, at));
        out.extend(close(&mut self.phase, at));
    }

    /// Returns the next step. Plans that could not be made are asked for again when something has changed.
    fn next_step(&mut self, at: &Conditions<'_>, out: &mut Vec<SweepOutput>) -> NextStep {
        let step = NextStep::of(&self.phase, &self.plans, self.idle.total(), at);
        let is_asked_first = matches!(self.phase, ExecutionPhase::Stopping { .. });
        let Some(missing) = self
            .missing
            .as_ref()
            .filter(|_| step == NextStep::Ask && is_asked_first)
        else {
            return step;
        };
        match missing.step(at.now, &planned_from(at)) {
            MissingPlansStep::AskAgain => NextStep::Ask,
            MissingPlansStep::Wait => NextStep::repeat(&self.plans, at.now),
            MissingPlansStep::GiveUp => {
                let why = missing.why.clone();
                self.missing = None;
                self.give_up(RunEnd::Failed, why, out);
                NextStep::Wait
            }
        }
    }

    /// There is no plan: everyone rests on, and it is tried again when that may help.
    fn go_without_plan(
        &mut self,
        no_plan: NoPlan,
        at: &Conditions<'_>,
        out: &mut Vec<SweepOutput>,
    ) {
        let NoPlan { why, is_of_places } = no_plan;
        let is_news = self
            .missing
            .as_ref()
            .is_none_or(|missing| missing.why != why);
        if is_news {
            out.push(SweepOutput::StationEvent(StationEvent::NoPlan(why.clone())));
        }
        if !is_of_places {
            self.missing = None;
            return self.give_up(RunEnd::Failed, why, out);
        }
        let from = planned_from(at);
        match &mut self.missing {
            Some(missing) => missing.try_in_vain(at.now, from, why),
            None => self.missing = Some(MissingPlans::new(at.now, from, why)),
        }
        self.phase.stop(at.now);
    }

    /// A vehicle that comes to where it was not since the last stop was done gets on. While nobody is heard nobody can be seen
    /// to get on.
    fn watch_places(&mut self, at: &Conditions<'_>) {
        if at.is_deaf {
            self.phase.note_progress(at.now);
        }
        match self.phase {
            ExecutionPhase::Running { .. } if !at.is_held && !at.is_deaf => self.idle.go_on(at.now),
            _ => self.idle.pause(),
        }
        for (id, member) in at.fleet.members() {
            let is_new = |place| self.visited.visit(id, place);
            if member.place().is_some_and(is_new) {
                self.phase.note_progress(at.now);
            }
        }
    }

    /// Brings everyone to rest by an empty revision, before plans are made from where they rest.
    fn rest(&mut self, at: &Conditions<'_>, out: &mut Vec<SweepOutput>) {
        self.phase.stop(at.now);
        self.visited.clear();
        self.missing = None;
        let Some(run) = self.phase.driven().map(SweepRun::run) else {
            return;
        };
        self.plans.stop(&at.fleet.present());
        self.publish(at, out);
        out.push(SweepOutput::StartAll(run));
        if is_too_few(at.fleet) {
            out.push(SweepOutput::StationEvent(StationEvent::Waits(run)));
        }
    }

    fn replan(&mut self, at: &Conditions<'_>, out: &mut Vec<SweepOutput>) {
        out.extend(
            self.phase
                .driven()
                .map(|sweep| SweepOutput::StationEvent(StationEvent::Replans(sweep.run()))),
        );
        self.rest(at, out);
    }

    /// No vehicle makes progress: plans everyone anew from where they rest, or gives the sweep up when that was done before.
    fn retry(&mut self, at: &Conditions<'_>, out: &mut Vec<SweepOutput>) {
        let Some(sweep) = self.phase.sweep_mut() else {
            return;
        };
        let run = sweep.run();
        if sweep.retry() {
            self.replan(at, out);
        } else {
            out.push(SweepOutput::StationEvent(StationEvent::Stalled(run)));
            out.push(SweepOutput::HoldAll(run));
            let out_of_service: Vec<String> = at
                .fleet
                .out_of_service()
                .iter()
                .map(|id| format!("vehicle {id}"))
                .collect();
            let why = match &out_of_service[..] {
                [] => "it cannot be ended, no vehicle gets on".to_owned(),
                all => {
                    let all = all.join(", ");
                    format!("it cannot be ended, no vehicle gets on; out of service: {all}")
                }
            };
            self.give_up(RunEnd::Failed, why, out);
        }
    }

    /// Asks for plans from where the vehicles rest now.
    fn ask(&mut self, at: &Conditions<'_>, out: &mut Vec<SweepOutput>) {
        self.phase.plan(at.now);
        let Some((sweep, revision)) = self.phase.sweep().zip(self.plans.next_revision()) else {
            return;
        };
        out.push(SweepOutput::PlansNeeded(Request {
            run: sweep.run(),
            revision,
            places: planned_from(at).places,
            first_lap: sweep.laps_done(),
            task: None,
        }));
    }

    /// Gives up a sweep that vehicles are driving, since an operator has begun a later run.
    pub(super) fn make_way(&mut self, run: RunId, out: &mut Vec<SweepOutput>) {
        let driven = self.phase.driven().map(SweepRun::run);
        let Some(driven) = driven.filter(|driven| *driven < run) else {
            return;
        };
        let note = StationEvent::MadeWay {
            run: driven,
            next: run,
        };
        out.push(SweepOutput::StationEvent(note));
        let why = format!("run {run} was begun in its place");
        self.give_up(RunEnd::Stopped, why, out);
    }

    fn give_up(&mut self, end: RunEnd, why: impl Into<String>, out: &mut Vec<SweepOutput>) {
        let run = self.phase.sweep().map(SweepRun::run);
        let why = why.into();
        out.extend(run.map(|run| SweepOutput::GivenUp { run, end, why }));
        self.phase.end();
    }
}

/// Returns what plans are made from: where those rest that are there.
fn planned_from(at: &Conditions<'_>) -> PlannedFrom {
    let place = |(id, member): (VehicleId, &FleetMember)| {
        let place = member.place().filter(|_| !member.is_away());
        Some((id, place?))
    };
    PlannedFrom {
        places: at.fleet.members().filter_map(place).collect(),
        map_changes: at.map_changes,
    }
}

#[cfg(test)]
mod tests;
