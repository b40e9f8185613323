//! From one phase of a sweep to the next: when it begins, when everyone is planned for anew, when a lap and the run
//! are done. What is heard, stored and repeated is the station's business.

use std::time::Duration;

use tomoswarm_proto::{OrderKind, RunEnd, RunId, StopId, VehicleId};

use super::super::fleet::FleetMember;
use super::super::imager::{Job, Subject};
use super::super::planner::{PlannerAnswer, Request};
use super::{Out, Phase, PictureName, Station, StationEvent, Sweep};
use crate::sweep::Succession;
use crate::time::Time;

/// Plans are repeated this often until every vehicle shows them.
const PLAN_EVERY: Duration = Duration::from_secs(5);
/// Plans that every vehicle shows are repeated this often, for one that restarts.
const SHOWN_PLAN_EVERY: Duration = Duration::from_secs(60);
/// A revision that somebody does not follow after this long is replaced.
const ADOPTED_WITHIN: Duration = Duration::from_secs(30);
/// Plans that did not come after so long are asked for again.
const ANSWERED_WITHIN: Duration = Duration::from_secs(30);
/// Last pictures that did not come after so long are asked for again.
const PICTURED_WITHIN: Duration = Duration::from_secs(120);
/// When no vehicle has done a stop for so long, everyone is planned for anew; the second time, given up.
const STALLED_AFTER: Duration = Duration::from_secs(420);
/// Time for the last samples to come in after the last stop.
const CLOSING: Duration = Duration::from_secs(3);
/// Gaps in the samples are waited for at most this long.
const CLOSING_MAX: Duration = Duration::from_secs(60);

impl Station {
    /// Begins a wished sweep once every vehicle has been heard and none is under way; who is not heard at all for long
    /// is lost, when enough others are there.
    pub(super) fn begin(&mut self, now: Time, out: &mut Vec<Out>) {
        let is_free =
            matches!(self.phase, Phase::Idle) && self.standing.is_none() && self.leases.holds();
        if !is_free || self.wished.is_none() {
            return;
        }
        if now.since(self.wished_at) > self.lost_after && self.has_enough() {
            let lost = self.fleet.lose_unheard(self.wished_at);
            out.extend(
                lost.into_iter()
                    .map(|vehicle| Out::StationEvent(StationEvent::Lost(vehicle))),
            );
        }
        if !self.fleet.are_placed() {
            return;
        }
        let Some((run, empty)) = self.wished.take() else {
            return;
        };
        self.closed.remove(&run);
        let highest = self.fleet.highest_revision(run);
        self.succession = Some(Succession::new(run, &self.fleet.present(), highest));
        self.rest(
            now,
            Sweep {
                run,
                empty,
                laps_before: 0,
                laps_done: 0,
            },
            out,
        );
    }

    /// A Start for everyone: what was held goes on; who was sent elsewhere is planned for anew from there.
    pub(super) fn go_on(&mut self, now: Time, out: &mut Vec<Out>) {
        if !self.leases.holds() {
            return;
        }
        let stood = self.standing.take();
        self.planned_at = now;
        match (stood, &self.phase) {
            (
                Some(OrderKind::Return | OrderKind::Land | OrderKind::CutMotors),
                Phase::Running(sweep, _),
            ) => {
                let sweep = *sweep;
                self.rest(now, sweep, out);
            }
            (Some(_) | None, _) => self.begin(now, out),
        }
    }

    /// Brings everyone to rest by an empty revision, before plans are made from where they rest.
    fn rest(&mut self, now: Time, sweep: Sweep, out: &mut Vec<Out>) {
        if let Some(succession) = &mut self.succession {
            succession.set_members(&self.fleet.present());
            succession.stop();
        }
        self.fleet.start_all(sweep.run);
        self.phase = Phase::Stopping(sweep);
        (self.planned_at, self.disturbed) = (now, false);
        self.publish_plans(now, out);
        self.publish_orders(out);
        if self.waits_for_more() {
            out.push(Out::StationEvent(StationEvent::Waits(sweep.run)));
        }
    }

    /// Somebody follows plans that this station has not given: they are outnumbered, or the sweep is given up when
    /// they belong to a higher run, which vehicles prefer.
    pub(super) fn look_after_others_plans(&mut self, out: &mut Vec<Out>) {
        let is_driven = matches!(
            self.phase,
            Phase::Planning(_) | Phase::Running(..) | Phase::Stopping(_)
        );
        let Some(sweep) = self.phase.sweep().copied().filter(|_| is_driven) else {
            return;
        };
        if self.fleet.highest_run() > sweep.run {
            out.push(Out::StationEvent(StationEvent::Overtaken(sweep.run)));
            self.runs
                .end(sweep.run, RunEnd::Stopped, "vehicles follow a higher run");
            self.last = Some(sweep);
            self.phase = Phase::Idle;
            return;
        }
        let highest = self.fleet.highest_revision(sweep.run);
        if let Some(succession) = self
            .succession
            .as_mut()
            .filter(|known| known.revision() < highest)
        {
            succession.skip_to(highest);
            self.disturbed = true;
        }
    }

    /// Asks for plans from where the vehicles rest now.
    fn ask(&mut self, now: Time, sweep: Sweep, out: &mut Vec<Out>) {
        let Some(succession) = &self.succession else {
            return;
        };
        let place = |(id, member): (VehicleId, &FleetMember)| Some((id, member.place()?));
        let present = |(_, member): &(VehicleId, &FleetMember)| !member.dealings().is_lost();
        let places = self
            .fleet
            .members()
            .filter(present)
            .filter_map(place)
            .collect();
        let (run, revision, first_lap) = (sweep.run, succession.next_revision(), sweep.laps_done);
        let task = self.runs.sweep(run);
        out.push(Out::Ask(Request {
            run,
            revision,
            places,
            first_lap,
            task,
        }));
        self.phase = Phase::Planning(Sweep {
            laps_before: sweep.laps_done,
            ..sweep
        });
        self.planned_at = now;
    }

    pub(super) fn planned(&mut self, now: Time, answer: PlannerAnswer, out: &mut Vec<Out>) {
        // Somebody may have come, gone or been restarted meanwhile; then everyone is stopped first.
        let is_wanted = self.leases.holds() && !self.must_rest();
        let (Phase::Planning(sweep), Some(succession)) = (&self.phase, &mut self.succession) else {
            return;
        };
        let sweep = *sweep;
        if !is_wanted || (answer.run, answer.revision) != (sweep.run, succession.next_revision()) {
            return;
        }
        let begun = answer.plans.and_then(|plans| {
            let stops = plans.iter().map(|plan| plan.stops.len()).sum();
            succession
                .begin(plans)
                .map(|_| stops)
                .map_err(|error| error.to_string())
        });
        match begun {
            Err(reason) => {
                self.runs.end(sweep.run, RunEnd::Failed, reason.clone());
                out.push(Out::StationEvent(StationEvent::NoPlan(reason)));
                self.last = Some(sweep);
                self.phase = Phase::Idle;
            }
            Ok(stops) => {
                let laps = answer.laps.len();
                out.push(Out::StationEvent(StationEvent::Planned {
                    run: sweep.run,
                    laps,
                    stops,
                }));
                out.push(Out::BeginRun {
                    run: sweep.run,
                    compared_with: sweep.empty,
                });
                self.phase = Phase::Running(sweep, answer.laps);
                self.planned_at = now;
                self.publish_plans(now, out);
            }
        }
    }

    /// Repeats plans; stops everyone and plans anew when somebody cannot begin where its plan does.
    pub(super) fn look_after_plans(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(succession) = &self.succession else {
            return;
        };
        let shown = succession.missing().next().is_none();
        let is_free = self.standing.is_none();
        match &self.phase {
            Phase::Planning(sweep) | Phase::Running(sweep, _) | Phase::Stopping(sweep)
                if is_free && self.must_rest() =>
            {
                let sweep = *sweep;
                out.push(Out::StationEvent(StationEvent::Replans(sweep.run)));
                self.rest(now, sweep, out);
            }
            Phase::Running(sweep, _)
                if is_free && !shown && now.since(self.planned_at) > ADOPTED_WITHIN =>
            {
                let sweep = *sweep;
                out.push(Out::StationEvent(StationEvent::Replans(sweep.run)));
                self.rest(now, sweep, out);
            }
            Phase::Running(sweep, _)
                if is_free && now.since(self.got_on_at.max(self.planned_at)) > STALLED_AFTER =>
            {
                let sweep = *sweep;
                self.stall(now, sweep, out);
            }
            Phase::Stopping(sweep) if is_free && self.may_plan(now) => {
                let sweep = *sweep;
                self.ask(now, sweep, out);
            }
            // The request or the answer was lost.
            Phase::Planning(sweep) if is_free && now.since(self.planned_at) > ANSWERED_WITHIN => {
                let sweep = *sweep;
                self.ask(now, sweep, out);
            }
            Phase::Stopping(sweep)
                if is_free
                    && !self.waits_for_more()
                    && now.since(self.planned_at) > STALLED_AFTER =>
            {
                let sweep = *sweep;
                self.stall(now, sweep, out);
            }
            Phase::Running(..) | Phase::Stopping(_) => {
                let every = if shown { SHOWN_PLAN_EVERY } else { PLAN_EVERY };
                if now.since(self.plans_at) >= every {
                    self.publish_plans(now, out);
                }
            }
            Phase::Idle | Phase::Planning(_) | Phase::Closing { .. } => {}
        }
    }

    /// Nobody gets on: plans everyone anew from where they rest, or gives the sweep up when that was done before.
    fn stall(&mut self, now: Time, sweep: Sweep, out: &mut Vec<Out>) {
        if !self.stalled {
            self.stalled = true;
            out.push(Out::StationEvent(StationEvent::Replans(sweep.run)));
            self.rest(now, sweep, out);
            return;
        }
        self.stalled = false;
        out.push(Out::StationEvent(StationEvent::Stalled(sweep.run)));
        self.runs.end(
            sweep.run,
            RunEnd::Failed,
            "it cannot be ended, no vehicle gets on",
        );
        self.fleet.order_all(sweep.run, OrderKind::Hold);
        self.publish_orders(out);
        self.last = Some(sweep);
        self.phase = Phase::Idle;
    }

    pub(super) fn look_after_laps(&mut self, now: Time, out: &mut Vec<Out>) {
        let Phase::Running(sweep, laps) = &self.phase else {
            return;
        };
        let (mut sweep, wanted) = (*sweep, laps.len());
        let known = sweep.laps_done.saturating_sub(sweep.laps_before);
        let done = known
            + laps
                .iter()
                .skip(known)
                .take_while(|lap| self.is_done(sweep, lap))
                .count();
        let finished = done == wanted;
        if sweep.laps_before + done > sweep.laps_done {
            sweep.laps_done = sweep.laps_before + done;
            self.stalled = false;
            let links = self.samples.links(sweep.run);
            let (run, laps, samples) = (sweep.run, sweep.laps_done, self.samples.count(sweep.run));
            out.push(Out::StationEvent(StationEvent::LapDone {
                run,
                laps,
                links: links.len(),
                samples,
            }));
            if !finished && let Some(empty) = sweep.empty {
                out.push(Out::Reconstruct(self.change(sweep, links, empty)));
            }
        }
        if finished {
            self.phase = Phase::Closing { sweep, since: now };
        } else if let Phase::Running(running, _) = &mut self.phase {
            *running = sweep;
        }
    }

    /// Returns whether every vehicle has done its last stop of a lap, under the present plans. Stops come in the order of a
    /// plan, which is not that of their numbers.
    fn is_done(&self, sweep: Sweep, lap: &[(VehicleId, StopId)]) -> bool {
        let plans = || self.succession.iter().flat_map(Succession::plans);
        lap.iter().all(|(vehicle, stop)| {
            let plan = plans().find(|plan| plan.vehicle == *vehicle);
            let member = self.fleet.members().find(|(id, _)| id == vehicle);
            let progress = member.and_then(|(_, member)| member.progress());
            let (Some(plan), Some(progress)) = (plan, progress) else {
                return false;
            };
            let is_present = (progress.run, progress.revision) == (sweep.run, plan.revision);
            // The lap's last stop is the one that is done, or stands before it.
            let done = plan
                .stops
                .iter()
                .position(|known| Some(known.id) == progress.done);
            let is_done =
                done.is_some_and(|done| plan.stops[..=done].iter().any(|known| known.id == *stop));
            is_present && is_done
        })
    }

    fn change(&self, sweep: Sweep, now: Vec<crate::tomo::Link>, empty: RunId) -> Job {
        let empty = self.samples.links(empty);
        let subject = Subject::Change;
        Job {
            run: sweep.run,
            laps: sweep.laps_done,
            subject,
            now,
            empty,
            is_last: false,
        }
    }

    pub(super) fn close(&mut self, now: Time, out: &mut Vec<Out>) {
        let Phase::Closing { sweep, since } = self.phase else {
            return;
        };
        let waited = now.since(since);
        if waited < CLOSING || (self.samples.has_gaps(sweep.run) && waited < CLOSING_MAX) {
            return;
        }
        let links = self.samples.links(sweep.run).len();
        let (run, samples, laps) = (sweep.run, self.samples.count(sweep.run), sweep.laps_done);
        out.push(Out::StationEvent(StationEvent::RunClosed {
            run,
            links,
            samples,
        }));
        out.push(Out::EndRun(run));
        let subjects = sweep
            .empty
            .map(|_| Subject::Change)
            .into_iter()
            .chain([Subject::Structure]);
        for subject in subjects {
            let due = (PictureName { run, laps, subject }, sweep.empty);
            out.push(Out::Reconstruct(self.last_job(due)));
            self.due.push(due);
        }
        self.due_asked_at = Some(now);
        self.closed.insert(run);
        self.last = Some(sweep);
        self.phase = Phase::Idle;
        self.begin(now, out);
    }

    /// The last picture of a run and a subject, from all its samples.
    fn last_job(&self, (name, empty): (PictureName, Option<RunId>)) -> Job {
        let PictureName { run, laps, subject } = name;
        let empty = match subject {
            Subject::Change => empty
                .map(|empty| self.samples.links(empty))
                .unwrap_or_default(),
            Subject::Structure => Vec::new(),
        };
        Job {
            run,
            laps,
            subject,
            now: self.samples.links(run),
            empty,
            is_last: true,
        }
    }

    pub(super) fn pictured(&mut self, made: PictureName) {
        self.pictures = self.pictures.saturating_add(1);
        self.runs.imaged(made.run);
        let was_due = self.due.len();
        self.due.retain(|(name, _)| *name != made);
        if self.due.len() < was_due && !self.has_images_due(made.run) {
            self.runs.end(made.run, RunEnd::Done, "");
        }
    }

    /// Returns whether last images of a run are still to be made.
    pub(super) fn has_images_due(&self, run: RunId) -> bool {
        self.due.iter().any(|(name, _)| name.run == run)
    }

    /// Pictures that are due are asked for again after a restart, and when they do not come.
    pub(super) fn ask_again_for_pictures(&mut self, now: Time, out: &mut Vec<Out>) {
        if self
            .due_asked_at
            .is_none_or(|at| now.since(at) > PICTURED_WITHIN)
        {
            self.due_asked_at = Some(now);
            out.extend(
                self.due
                    .iter()
                    .map(|due| Out::Reconstruct(self.last_job(*due))),
            );
        }
    }
}
