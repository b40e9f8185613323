//! The station actor: routes what it is told to its parts, and what follows from them to each other and to the outside. It
//! solves nothing and plans nothing itself, and each part keeps its own state.
//!
//! It is told messages of vehicles, operators and other grounds, plans, and pictures made, and says what [`Out`] names.
//!
//! | part | what it keeps |
//! | --- | --- |
//! | `Leases` | who may speak for the ground |
//! | `Fleet` | what the vehicles say, and what they were ordered |
//! | `FleetMap` | the merged map, and its repair |
//! | `SampleStore` | the samples of all runs |
//! | `OrderInForce` | the order that holds everything up until the next Start |
//! | `RunBook` | which sweep is requested, and what became of runs |
//! | `SweepExecution` | how far the sweep under way is (`execution/phase.rs` draws its states), and its plans |
//! | `Pictures` | which pictures are due |
//! | `Ticks` | when everything is looked at and repeated |
//!
//! `lost_vehicles` says when silence means something, `own_missions` reads what vehicles say of runs that no ground plans,
//! `memory` says what is stored for a station that is started anew, and `report` what is reported. No part holds another
//! one: it is given what it needs as an argument, and returns what follows.
//!
//! An order other than Start is *in force* until the next Start, whoever gave it (the station sees in State what a vehicle
//! was ordered): meanwhile whatever the phase, nothing is begun, planned or timed, and no Start is given. A Start seen
//! in State that names a run higher than any before begins that run. An operator's Task says what the run is: with which
//! one it is compared, how it is swept, or that no ground station plans it. It may come before the Start or after it.
//!
//! Only the station that holds the lease, or plans under an operator's, speaks: one that listens or stands by says its
//! Report, and keeps what it hears.
//!
//! Deadlines: `repeat` (state is published and repeated, nobody asks and waits), `ask for or send missing tiles`.

mod execution;
mod fleet_map;
pub mod leases;
mod lost_vehicles;
mod memory;
mod messages;
mod ongoing_images;
mod order_in_force;
mod own_missions;
mod pictures;
mod report;
mod run_registry;
mod runs;
mod ticks;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Lease, Message, MissionKind, MissionProgress, OrderKind, RunEnd, RunId, Samples, State, Task,
    TileReport,
};

use self::execution::{Conditions, IdleLimits, SweepExecution, SweepOutput, SweepRun};
use self::fleet_map::FleetMap;
use self::leases::{Change, Leases};
use self::lost_vehicles::are_enough_heard;
pub use self::memory::StationMemory;
use self::memory::{PartsToRemember, StoredState};
use self::messages::StationConstants;
pub use self::messages::{In, Key, Out, StationEvent, StationSettings};
use self::ongoing_images::OngoingImages;
use self::order_in_force::OrderInForce;
use self::own_missions::OwnMissions;
pub use self::pictures::PictureName;
use self::pictures::{Pictures, job_of_change, job_of_ongoing};
use self::report::PartsToReport;
use self::run_registry::RunRegistry;
use self::ticks::Ticks;
use super::fleet::Fleet;
use super::imager::{ImageStage, Job};
use super::planner::Request;
use super::samples::SampleStore;
use crate::actor::{Actor, Fault};
use crate::config::ImageTimes;
use crate::map::Merged;
use crate::sweep::VehicleProgress;
use crate::time::{Deadline, Time};

/// The station actor.
#[derive(Debug, Serialize, Deserialize)]
pub struct Station {
    constants: StationConstants,
    leases: Leases,
    fleet: Fleet,
    map: FleetMap,
    samples: SampleStore,
    order: OrderInForce,
    runs: RunRegistry,
    execution: SweepExecution,
    pictures: Pictures,
    ongoing_images: OngoingImages,
    ticks: Ticks,
    /// Whether samples can be stored. Otherwise it says no Have: a store that was silent is sent everything again.
    stores_samples: bool,
    /// Messages of vehicles that are not expected.
    strangers: u64,
    /// What is wrong with its process, in words.
    of_process: Vec<String>,
    /// What was remembered last.
    stored: Option<StoredState>,
}

impl Station {
    /// Makes a station that has heard nobody yet.
    pub fn new(settings: StationSettings) -> Station {
        let none = Lease {
            number: 0,
            holder: settings.holder,
        };
        let listening = Leases::listening(none, settings.take_over);
        let mut station = Station {
            constants: StationConstants::of(&settings),
            leases: settings.lease.map_or(listening, Leases::held),
            fleet: Fleet::new(&settings.vehicles, settings.lease.unwrap_or(none)),
            map: FleetMap::new(settings.lattice),
            samples: SampleStore::new(settings.store, settings.bin_m, settings.spot_m),
            order: OrderInForce::default(),
            runs: RunRegistry::default(),
            execution: SweepExecution::default(),
            pictures: Pictures::default(),
            ongoing_images: OngoingImages::default(),
            ticks: Ticks::default(),
            stores_samples: true,
            strangers: 0,
            of_process: Vec::new(),
            stored: None,
        };
        station.stored = Some(StoredState::of(station.parts_to_remember()));
        station
    }

    /// Makes a station that goes on where an earlier one was, with what was stored of samples and tiles, in any order.
    ///
    /// Of the settings, `lease` and `store` are not used: it listens, and its store is the one remembered.
    pub fn resume(
        settings: StationSettings,
        memory: StationMemory,
        samples: impl IntoIterator<Item = Samples>,
        tiles: impl IntoIterator<Item = TileReport>,
    ) -> Station {
        let parts = memory.restore();
        let last = Lease {
            number: parts.lease.number,
            holder: settings.holder,
        };
        let mut station = Station {
            leases: Leases::listening(last, settings.take_over),
            order: parts.order,
            runs: parts.runs,
            execution: parts.execution,
            pictures: parts.pictures,
            ..Station::new(StationSettings {
                store: parts.store,
                ..settings
            })
        };
        station.fleet.set_lease(last);
        station.fleet.recall(&parts.dealings);
        for batch in samples {
            station.samples.take(&batch);
        }
        for tile in tiles {
            station.map.join(Time::ZERO, &tile);
        }
        station.stored = Some(StoredState::of(station.parts_to_remember()));
        station
    }

    /// Makes a station that is started anew, with what was stored of samples and tiles, in any order: it goes on where an
    /// earlier one was, as far as that is remembered. Otherwise it begins, and no run counts as begun.
    pub fn restored(
        settings: StationSettings,
        memory: Option<StationMemory>,
        samples: impl IntoIterator<Item = Samples>,
        tiles: impl IntoIterator<Item = TileReport>,
    ) -> Station {
        if let Some(memory) = memory {
            return Station::resume(settings, memory, samples, tiles);
        }
        let mut station = Station::new(settings);
        let samples = samples.into_iter().map(Message::Samples);
        for message in samples.chain(tiles.into_iter().map(Message::Tile)) {
            // Nothing that is stored can stop a station, and nothing that it says of it is news.
            let _ = station.handle(Time::ZERO, In::Bus(message), &mut Vec::new());
        }
        station
    }

    /// Takes up which runs there were, when nothing else is remembered: none of them is begun again by an old order.
    pub fn recall_runs(&mut self, runs: impl IntoIterator<Item = (RunId, bool)>) {
        for (run, is_closed) in runs {
            self.runs.recall(run, is_closed);
        }
    }

    /// Returns the merged map.
    pub fn map(&self) -> &Merged {
        self.map.merged()
    }

    /// Returns the stored samples.
    pub fn samples(&self) -> &SampleStore {
        &self.samples
    }

    fn hear(&mut self, now: Time, message: Message, out: &mut Vec<Out>) {
        if messages::expected_author(&message).is_some_and(|vehicle| !self.fleet.expects(vehicle)) {
            self.strangers = self.strangers.saturating_add(1);
            return;
        }
        let mut change = None;
        match message {
            Message::State(state) => self.hear_state(now, state, out),
            Message::Mission(mission) => self.hear_mission(now, &mission, out),
            Message::Samples(batch) => {
                self.samples.take(&batch);
            }
            Message::Tile(report) => self.map.join(now, &report),
            Message::Digest(digest) => self.map.hear_digest(now, &digest),
            Message::Want(want) => {
                self.map.hear_want(now, &want);
                out.extend(self.map.mend(now).map(Out::Publish));
            }
            Message::Report(report) if report.store < self.samples.store() => {
                change = self.leases.heard_elder(now, report.lease);
            }
            Message::Report(report) => change = self.leases.heard_report(now, report.lease),
            Message::Plan(plan) => change = self.leases.heard(now, plan.lease),
            Message::Hello(hello) => change = self.leases.heard_hello(now, &hello),
            Message::Task(task) => self.take_task(&task),
            // It has been stored.
            Message::Mark(mark) => out.push(Out::Publish(Message::Mark(mark))),
            // What operators order shows in State, stops come from their keeper; the rest is of grounds, bus and radio.
            Message::Order(_)
            | Message::Have(_)
            | Message::Health(_)
            | Message::Beacon(_)
            | Message::Standing(_)
            | Message::Image(_)
            | Message::Fix(_)
            | Message::Look(_)
            | Message::Log(_)
            | Message::Settings(_) => {}
        }
        self.lease_changed(now, change, out);
    }

    fn hear_state(&mut self, now: Time, state: State, out: &mut Vec<Out>) {
        let (vehicle, lease) = (state.vehicle, state.ordered.lease);
        let shown = self.fleet.heard_state(now, state);
        out.extend(messages::notes_of(vehicle, shown));
        self.execution.hear(now, shown);
        if let Some(run) = shown.started {
            self.runs.start(now, run, self.constants.compare_with);
            if self.leases.holds() {
                let make_way =
                    |it: &mut SweepExecution, _: &Conditions<'_>, produced: &mut Vec<_>| {
                        it.make_way(run, produced);
                    };
                self.execute(now, make_way, out);
            }
        }
        let change = self.leases.heard(now, lease);
        self.lease_changed(now, change, out);
        self.update_order(now, out);
    }

    fn hear_mission(&mut self, now: Time, mission: &MissionProgress, out: &mut Vec<Out>) {
        self.fleet.heard_mission(mission);
        let run = mission.progress.run;
        if mission.kind != MissionKind::Sweep
            && self.runs.runs().is_sweep_without_task(run)
            && let Some(members) =
                OwnMissions::new(now, &self.fleet, self.constants.silence).members_of(run)
        {
            self.runs.leave_to(run, mission.kind, members);
            self.execution.leave_to_vehicles(run);
        }
        let progress = VehicleProgress::from(mission);
        let mut shown = self.fleet.heard_progress(now, progress);
        let place = self.fleet.place_of(mission.vehicle);
        if self.execution.has_given_up(&progress, place) {
            (shown.made_progress, shown.left_stop) = (false, false);
        }
        out.extend(messages::notes_of(mission.vehicle, shown));
        self.execution.hear(now, shown);
        if self.fleet.is_current(&progress) {
            self.execution.hear_progress(&progress);
        }
        let change = self.leases.heard(now, Lease::lowest(mission.lease_number));
        self.lease_changed(now, change, out);
    }

    /// Takes what an operator says that a run is; one that has no right to it any more is passed over.
    fn take_task(&mut self, task: &Task) {
        if task.lease < self.leases.highest() || !self.runs.take_task(task) {
            return;
        }
        self.execution.compare_with(task.run, task.compare_with);
        if !self.runs.runs().is_swept(task.run) {
            self.execution.leave_to_vehicles(task.run);
        }
    }

    fn lease_changed(&mut self, now: Time, change: Option<Change>, out: &mut Vec<Out>) {
        let lease = match change {
            None => return,
            Some(Change::StoodDown(lease)) => {
                return out.push(Out::StationEvent(StationEvent::StandsBy(lease)));
            }
            Some(Change::Renewed(lease) | Change::Taken(lease)) => lease,
        };
        out.push(Out::StationEvent(StationEvent::Leads(lease)));
        self.fleet.set_lease(lease);
        if let Some(Change::Taken(_)) = change {
            // Nothing was heard or driven wrongly while there was no lease.
            self.runs.count_from(now);
            self.execution.count_from(now);
            self.fleet.count_silence_from(now);
        }
        self.execute(now, SweepExecution::publish, out);
    }

    fn tick(&mut self, now: Time, out: &mut Vec<Out>) {
        let change = self.leases.tick(now);
        self.lease_changed(now, change, out);
        let missions = OwnMissions::new(now, &self.fleet, self.constants.silence);
        for (run, members) in self.runs.runs().left_to_vehicles() {
            if let Some((end, why)) = missions.end_of(run, &members) {
                self.runs.end(run, end, why);
            }
        }
        if self.leases.holds() {
            self.lead(now, out);
        }
        out.push(Out::Publish(Message::Report(
            self.parts_to_report(now).report(),
        )));
    }

    /// Does what only the holder of the lease does.
    fn lead(&mut self, now: Time, out: &mut Vec<Out>) {
        self.update_order(now, out);
        let lost = self.constants.silence.lose(now, &mut self.fleet);
        out.extend(lost.into_iter().map(messages::note_lost));
        self.execute(now, SweepExecution::outnumber_others, out);
        self.begin_requested(now, out);
        publish_orders(&mut self.fleet, out);
        if self.stores_samples {
            let have = self.samples.have(self.runs.closed(), self.ticks.count());
            out.push(Out::Publish(Message::Have(have)));
        }
        out.push(Out::Publish(Message::Digest(self.map.merged().digest())));
        self.execute(now, SweepExecution::advance, out);
        let jobs = self.pictures.ask_again(now, &self.samples);
        out.extend(jobs.into_iter().map(Out::Reconstruct));
        if self.constants.image_times == ImageTimes::Free {
            out.extend(self.ongoing_job(now).map(Out::Reconstruct));
        }
    }

    /// Returns the job for an image of the sweep under way, when there is time for one and something new to see.
    fn ongoing_job(&mut self, now: Time) -> Option<Job> {
        let sweep = self.execution.phase().sweep()?;
        let samples = self.samples.count(sweep.run());
        let is_asked = self.ongoing_images.ask(now, sweep.run(), samples);
        is_asked.then(|| job_of_ongoing(sweep, &self.samples))
    }

    /// Takes what the vehicles show to be in force; once that is lifted, what was held goes on.
    fn update_order(&mut self, now: Time, out: &mut Vec<Out>) {
        if !self.leases.holds() {
            return;
        }
        if let Some(lifted) = self.order.update(self.fleet.order_in_force()) {
            let go_on = |it: &mut SweepExecution, at: &Conditions<'_>, produced: &mut Vec<_>| {
                it.go_on(lifted, at, produced);
            };
            self.execute(now, go_on, out);
            self.begin_requested(now, out);
        }
    }

    /// Begins the requested sweep once it is known where every vehicle is and no other sweep is under way. A vehicle that was
    /// not heard at all for long counts as lost, if enough others are there.
    fn begin_requested(&mut self, now: Time, out: &mut Vec<Out>) {
        let is_free = self.execution.phase().sweep().is_none() && !self.order.is_any();
        let Some((requested, since)) = self.runs.requested().filter(|_| is_free) else {
            return;
        };
        if self.constants.silence.is_lost(now.since(since)) && are_enough_heard(&self.fleet) {
            let lost = self.fleet.lose_unheard(since);
            out.extend(lost.into_iter().map(messages::note_lost));
        }
        if self.fleet.are_placed() {
            self.runs.begin_requested();
            let begin = |it: &mut SweepExecution, at: &Conditions<'_>, produced: &mut Vec<_>| {
                it.begin(requested, at, produced);
            };
            self.execute(now, begin, out);
        }
    }

    /// Lets the execution of the sweep take a step, and does what follows from it.
    fn execute(
        &mut self,
        now: Time,
        step: impl FnOnce(&mut SweepExecution, &Conditions<'_>, &mut Vec<SweepOutput>),
        out: &mut Vec<Out>,
    ) {
        let at = Conditions {
            now,
            fleet: &self.fleet,
            samples: &self.samples,
            map_changes: self.map.changes(),
            silence: self.constants.silence,
            idle: IdleLimits::of(self.constants.fence_m, self.fleet.fastest_mps()),
            lease: self.leases.own(),
            is_held: self.order.is_any(),
            stores_samples: self.stores_samples,
            is_deaf: self.fleet.is_silent(now),
        };
        let mut outputs = Vec::new();
        step(&mut self.execution, &at, &mut outputs);
        for output in outputs {
            self.carry_out(now, output, out);
        }
    }

    fn carry_out(&mut self, now: Time, output: SweepOutput, out: &mut Vec<Out>) {
        match output {
            SweepOutput::StationEvent(note) => out.push(Out::StationEvent(note)),
            SweepOutput::Plans(plans) => {
                out.extend(plans.into_iter().map(Message::Plan).map(Out::Publish));
            }
            SweepOutput::Begun(sweep) => out.push(Out::BeginRun {
                run: sweep.run(),
                compared_with: sweep.compared_with(),
            }),
            SweepOutput::StartAll(run) => {
                self.fleet.start_all(run);
                publish_orders(&mut self.fleet, out);
            }
            SweepOutput::HoldAll(run) => {
                self.fleet.order_all(run, OrderKind::Hold);
                publish_orders(&mut self.fleet, out);
            }
            SweepOutput::PlansNeeded(request) => {
                let task = self.runs.runs().sweep(request.run);
                out.push(Out::Ask(Request { task, ..request }));
            }
            SweepOutput::LapDone { sweep, is_last } => self.finish_lap(sweep, is_last, out),
            SweepOutput::Closed(sweep) => self.close_run(now, sweep, out),
            SweepOutput::GivenUp { run, end, why } => self.runs.end(run, end, why),
        }
    }

    fn finish_lap(&self, sweep: SweepRun, is_last: bool, out: &mut Vec<Out>) {
        let (run, laps) = (sweep.run(), sweep.laps_done());
        out.push(Out::StationEvent(StationEvent::LapDone {
            run,
            laps,
            links: self.samples.link_count(run),
            samples: self.samples.count(run),
        }));
        if !is_last {
            out.extend(job_of_change(&sweep, &self.samples).map(Out::Reconstruct));
        }
    }

    fn close_run(&mut self, now: Time, sweep: SweepRun, out: &mut Vec<Out>) {
        let run = sweep.run();
        out.push(Out::StationEvent(StationEvent::RunClosed {
            run,
            links: self.samples.link_count(run),
            samples: self.samples.count(run),
        }));
        out.push(Out::EndRun(run));
        let (laps, compared_with) = (sweep.laps_done(), sweep.compared_with());
        let jobs = self
            .pictures
            .close(now, run, laps, compared_with, &self.samples);
        out.extend(jobs.into_iter().map(Out::Reconstruct));
        self.runs.close(run);
        self.begin_requested(now, out);
    }

    /// Ends a step in which all from `first` on was said: without the lease most of it is dropped, and what has changed is
    /// remembered ahead of it.
    fn finish_step(&mut self, first: usize, out: &mut Vec<Out>) {
        let first = first.min(out.len());
        if !self.leases.holds() {
            let own = out.split_off(first);
            out.extend(own.into_iter().filter(Out::is_said_without_lease));
        }
        if let Some(memory) =
            StationMemory::of_changes(self.stored.as_ref(), self.parts_to_remember())
        {
            self.stored = Some(memory.state().clone());
            out.insert(first, Out::Remember(Box::new(memory)));
        }
    }

    fn parts_to_remember(&self) -> PartsToRemember<'_> {
        PartsToRemember {
            store: self.samples.store(),
            lease: self.leases.own(),
            fleet: &self.fleet,
            order: self.order,
            runs: &self.runs,
            execution: &self.execution,
            pictures: &self.pictures,
        }
    }

    fn parts_to_report(&self, now: Time) -> PartsToReport<'_> {
        PartsToReport {
            now,
            boot: self.constants.boot,
            leases: &self.leases,
            fleet: &self.fleet,
            samples: &self.samples,
            order: self.order,
            runs: &self.runs,
            execution: &self.execution,
            strangers: self.strangers,
            of_process: &self.of_process,
        }
    }
}

impl Actor for Station {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        let first = out.len();
        match input {
            In::Bus(message) => self.hear(now, message, out),
            In::Planned(answer) if self.leases.holds() => {
                let take = |it: &mut SweepExecution, at: &Conditions<'_>, produced: &mut Vec<_>| {
                    it.take_answer(answer, at, produced);
                };
                self.execute(now, take, out);
            }
            In::Planned(_) => {}
            In::StoresSamples(can) => self.stores_samples = can,
            In::Troubles(of_process) => self.of_process = of_process,
            In::Stops(open) => {
                self.fleet.stop(&open);
                self.update_order(now, out);
            }
            In::Pictured { name, is_made } => {
                self.ongoing_images.take(name);
                self.runs.count_pictures(name.run, u32::from(is_made));
                if name.stage == ImageStage::Ongoing {
                    return Ok(());
                }
                if self.pictures.take(name) {
                    self.runs.end(name.run, RunEnd::Done, "");
                }
            }
        }
        self.finish_step(first, out);
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let tick = Deadline {
            at: self.ticks.next_at(),
            why: "repeat",
        };
        let repair = self.map.deadline().map(|at| Deadline {
            at,
            why: "ask for or send missing tiles",
        });
        Deadline::earlier(Some(tick), repair)
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        let first = out.len();
        if self.ticks.take_due(now) {
            self.tick(now, out);
        }
        out.extend(self.map.mend(now).map(Out::Publish));
        self.finish_step(first, out);
        Ok(())
    }
}

fn publish_orders(fleet: &mut Fleet, out: &mut Vec<Out>) {
    let orders = fleet.open_orders().into_iter().map(Message::Order);
    out.extend(orders.map(Out::Publish));
    fleet.note_said();
}

#[cfg(test)]
mod tests;
