//! The station actor: keeps the fleet table, the merged map and the samples, and brings one sweep after
//! another from its start to its links.
//!
//! It is told messages of vehicles, operators and other grounds, plans, and pictures made; it says plans, orders,
//! watermarks, reports and map repairs for the bus, requests for the planner, jobs for the imager, notes, and what must be
//! remembered. It solves nothing and plans nothing itself.
//!
//! ```text
//!   Idle ─Start seen, all heard*──► Stopping ─all at rest─► Planning ─plans─► Running ─every stop done─► Closing
//!    ▲                                 ▲ │ ▲                   │                 │                         │
//!    │                   too few: waits└─┘ └───────────────────┴─────────────────┘                         │
//!    │                                      a vehicle is lost, is back, was restarted,                     │
//!    │                                      cannot begin, or nobody gets on                                │
//!    └────────────────────────────────────────────── samples in ───────────────────────────────────────────┘
//! ```
//!
//! (* or lost: who is not heard at all for long enough, when two are.)
//!
//! An order other than Start *stands* until the next Start, whoever gave it (the station sees in State what a vehicle
//! was ordered): meanwhile whatever the phase, nothing is begun, planned or timed, and no Start is given. A Start seen
//! in State that names a run higher than any before begins that run. An operator's Task says what the run is: with which
//! one it is compared, how it is swept, or that no ground station plans it. It may come before the Start or after it.
//!
//! Only who holds the lease, or plans under that of an operator, speaks (`leases`): a station that listens or stands by
//! says its Report, and keeps what it hears. `phases` brings a sweep on, `missions` watches runs that it does not plan, `lost` says what happens when vehicles come and
//! go, `runs` what became of each run, `memory` how a station is started anew, `report` what it says of itself.
//!
//! Deadlines: `repeat` (state is published and repeated, nobody asks and waits), `ask for or send missing tiles`.

pub mod leases;
mod lost;
mod memory;
mod messages;
mod missions;
mod phases;
mod report;
mod runs;

use std::collections::BTreeSet;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Boot, Hello, Lease, Message, MissionProgress, OrderKind, RunEnd, RunId, Samples, Sender, State,
    StopId, Task, TileReport, VehicleId,
};

use self::leases::{Change, Leases};
use self::memory::Brief;
pub use self::memory::{PictureName, StationMemory};
pub use self::messages::{In, Key, Out, StationEvent, StationSettings};
use self::runs::Runs;
use super::fleet::Fleet;
use super::samples::SampleStore;
use crate::actor::{Actor, Fault};
use crate::map::{Merged, Repair};
use crate::sweep::{Succession, VehicleProgress};
use crate::time::{Deadline, Time};

/// Everything is looked at and repeated this often.
const TICK: Duration = Duration::from_secs(1);

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
enum Phase {
    Idle,
    Planning(Sweep),
    Running(Sweep, Laps),
    /// Everyone is brought to rest, to be planned for anew.
    Stopping(Sweep),
    Closing {
        sweep: Sweep,
        since: Time,
    },
}

impl Phase {
    fn sweep(&self) -> Option<&Sweep> {
        match self {
            Phase::Idle => None,
            Phase::Planning(sweep)
            | Phase::Running(sweep, _)
            | Phase::Stopping(sweep)
            | Phase::Closing { sweep, .. } => Some(sweep),
        }
    }

    fn sweep_mut(&mut self) -> Option<&mut Sweep> {
        match self {
            Phase::Idle => None,
            Phase::Planning(sweep)
            | Phase::Running(sweep, _)
            | Phase::Stopping(sweep)
            | Phase::Closing { sweep, .. } => Some(sweep),
        }
    }
}

/// Per lap still to be driven, the last stop of each vehicle.
type Laps = Vec<Vec<(VehicleId, StopId)>>;

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
struct Sweep {
    run: RunId,
    empty: Option<RunId>,
    /// Laps done before the present plans were made.
    laps_before: usize,
    laps_done: usize,
}

/// A sweep to be begun: its run, and the run that it is compared with.
type Wished = (RunId, Option<RunId>);

/// The station actor.
#[derive(Debug, Serialize, Deserialize)]
pub struct Station {
    boot: Boot,
    compare_with: Option<RunId>,
    lost_after: Duration,
    autonomy: Duration,
    leases: Leases,
    fleet: Fleet,
    map: Merged,
    repair: Repair,
    samples: SampleStore,
    phase: Phase,
    succession: Option<Succession>,
    wished: Option<Wished>,
    /// Since when the wished sweep waits for those who have not been heard.
    wished_at: Time,
    /// The highest run that was ever wished.
    newest_run: RunId,
    /// What was ordered and not ended by a Start; the strongest since nothing stood.
    standing: Option<OrderKind>,
    /// Runs that are closed.
    closed: BTreeSet<RunId>,
    /// The sweep that was closed or given up last.
    last: Option<Sweep>,
    runs: Runs,
    planned_at: Time,
    /// When a vehicle was last heard to have got on with its plan.
    got_on_at: Time,
    /// Whether plans were made anew because nobody got on, since a lap was done.
    stalled: bool,
    /// Whether a vehicle has come or was started anew since everyone was brought to rest.
    disturbed: bool,
    plans_at: Time,
    tick_at: Time,
    /// Counts the ticks.
    turn: u64,
    /// Pictures made.
    pictures: u32,
    /// Last pictures of runs that are not made yet, and the run that each is compared with.
    due: Vec<(PictureName, Option<RunId>)>,
    /// When they were asked for last; `None` = the station was started anew since.
    due_asked_at: Option<Time>,
    /// Messages of vehicles that are not expected.
    strangers: u64,
    remembered: Option<Brief>,
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
            boot: settings.boot,
            compare_with: settings.compare_with,
            lost_after: settings.lost_after,
            autonomy: settings.autonomy,
            leases: settings.lease.map_or(listening, Leases::held),
            fleet: Fleet::new(&settings.vehicles, settings.lease.unwrap_or(none)),
            map: Merged::new(settings.lattice, None),
            repair: Repair::new(None),
            samples: SampleStore::new(settings.store, settings.bin_m, settings.spot_m),
            phase: Phase::Idle,
            succession: None,
            wished: None,
            wished_at: Time::ZERO,
            newest_run: RunId::default(),
            standing: None,
            closed: BTreeSet::new(),
            last: None,
            runs: Runs::default(),
            planned_at: Time::ZERO,
            got_on_at: Time::ZERO,
            stalled: false,
            disturbed: false,
            plans_at: Time::ZERO,
            tick_at: Time::ZERO + TICK,
            turn: 0,
            pictures: 0,
            due: Vec::new(),
            due_asked_at: None,
            strangers: 0,
            remembered: None,
        };
        station.remembered = Some(station.brief());
        station
    }

    /// Takes up which runs there were, when nothing else is remembered: none of them is begun again by an old order.
    pub fn recall_runs(&mut self, runs: impl IntoIterator<Item = (RunId, bool)>) {
        for (run, is_closed) in runs {
            self.newest_run = self.newest_run.max(run);
            if is_closed {
                self.closed.insert(run);
            }
            self.runs.recall(
                run,
                if is_closed {
                    RunEnd::Done
                } else {
                    RunEnd::Stopped
                },
            );
        }
    }

    /// Returns the fleet table.
    pub fn fleet(&self) -> &Fleet {
        &self.fleet
    }

    /// Returns the merged map.
    pub fn map(&self) -> &Merged {
        &self.map
    }

    /// Returns the stored samples.
    pub fn samples(&self) -> &SampleStore {
        &self.samples
    }

    fn hear(&mut self, now: Time, message: Message, out: &mut Vec<Out>) {
        match message {
            Message::State(state) => self.hear_state(now, state, out),
            Message::Mission(mission) => self.hear_mission(now, &mission, out),
            Message::Samples(batch) => self.store(&batch),
            Message::Tile(report) => self.join(now, &report),
            Message::Digest(digest) => self.repair.hear_digest(now, &self.map, &digest),
            Message::Want(want) => {
                self.repair.hear_want(now, &self.map, &want);
                self.mend(now, out);
            }
            Message::Report(report) => {
                let change = match report.store < self.samples.store() {
                    true => self.leases.heard_elder(now, report.lease),
                    false => self.leases.heard_report(now, report.lease),
                };
                self.lease_changed(now, change, out);
            }
            Message::Plan(plan) => {
                let change = self.leases.heard(now, plan.lease);
                self.lease_changed(now, change, out);
            }
            Message::Hello(hello) => {
                let change = self.hear_operator(now, &hello);
                self.lease_changed(now, change, out);
            }
            Message::Task(task) => self.take_task(&task),
            // What an operator orders shows in State, which stops are open comes from their keeper; the rest is said by
            // grounds, or the bus's and the radio's business.
            Message::Order(_)
            | Message::Have(_)
            | Message::Health(_)
            | Message::Beacon(_)
            | Message::Standing(_)
            | Message::Image(_) => {}
        }
    }

    fn hear_operator(&mut self, now: Time, hello: &Hello) -> Option<Change> {
        match hello.node {
            Sender::Operator(_) => self.leases.heard_operator(now, hello.lease?),
            Sender::Ground | Sender::Vehicle(_) => None,
        }
    }

    fn hear_state(&mut self, now: Time, state: State, out: &mut Vec<Out>) {
        if !self.knows(state.vehicle) {
            return;
        }
        let (vehicle, lease) = (state.vehicle, state.ordered.lease);
        let shown = self.fleet.heard_state(now, state);
        self.shown(vehicle, shown, out);
        if let Some(run) = shown.started.filter(|run| *run > self.newest_run) {
            self.started(now, run);
        }
        let change = self.leases.heard(now, lease);
        self.lease_changed(now, change, out);
        self.look_after_standing(now, out);
    }

    fn hear_mission(&mut self, now: Time, mission: &MissionProgress, out: &mut Vec<Out>) {
        if !self.knows(mission.vehicle) {
            return;
        }
        self.fleet.heard_mission(mission);
        self.look_after_kind(now, mission);
        self.hear_progress(now, mission.into(), out);
        let change = self.leases.heard(now, Lease::lowest(mission.lease_number));
        self.lease_changed(now, change, out);
    }

    fn hear_progress(&mut self, now: Time, progress: VehicleProgress, out: &mut Vec<Out>) {
        let shown = self.fleet.heard_progress(now, progress);
        self.shown(progress.vehicle, shown, out);
        if shown.got_on {
            self.got_on_at = now;
        }
        let is_current = self.fleet.is_current(&progress);
        if let Some(succession) = self.succession.as_mut().filter(|_| is_current) {
            succession.hear(&progress);
        }
    }

    /// Returns whether a vehicle is expected; counts it otherwise.
    fn knows(&mut self, vehicle: VehicleId) -> bool {
        let is_known = self.fleet.expects(vehicle);
        self.strangers = self.strangers.saturating_add(u64::from(!is_known));
        is_known
    }

    fn store(&mut self, batch: &Samples) {
        if self.knows(batch.vehicle) {
            self.samples.take(batch);
        }
    }

    fn join(&mut self, now: Time, report: &TileReport) {
        // A tile that cannot be joined changes nothing; its sender keeps it, and repeats it.
        let _ = self.map.join(report);
        self.repair.pass(now, &self.map, report);
    }

    /// Asks for what is missing of the map, and sends what others miss.
    fn mend(&mut self, now: Time, out: &mut Vec<Out>) {
        let mut messages = Vec::new();
        self.repair.wake(now, &self.map, &mut messages);
        out.extend(messages.into_iter().map(Out::Publish));
    }

    fn want(&mut self, now: Time, run: RunId, empty: Option<RunId>) {
        (self.wished, self.wished_at) = (Some((run, empty)), now);
        self.open(run, empty);
    }

    /// An operator has started a run that is higher than any before.
    fn started(&mut self, now: Time, run: RunId) {
        let by_file = self.compare_with.filter(|empty| *empty != run);
        let empty = self.runs.task_compares_with(run).unwrap_or(by_file);
        match self.runs.is_swept(run) {
            true => self.want(now, run, empty),
            // The vehicles know by themselves what to do.
            false => self.open(run, empty),
        }
    }

    fn open(&mut self, run: RunId, empty: Option<RunId>) {
        let Station { runs, closed, .. } = self;
        runs.open(run, empty, |earlier| closed.contains(&earlier));
        self.newest_run = self.newest_run.max(run);
    }

    /// An operator says what a run is, before it is started or after. One that it has no right to any more is passed over.
    fn take_task(&mut self, task: &Task) {
        if task.lease < self.leases.highest() || task.run < self.newest_run {
            return;
        }
        self.runs.take(task);
        let (run, empty) = (task.run, task.compare_with);
        if let Some(wished) = self.wished.as_mut().filter(|wished| wished.0 == run) {
            wished.1 = empty;
        }
        if let Some(sweep) = self.phase.sweep_mut().filter(|sweep| sweep.run == run) {
            sweep.empty = empty;
        }
        if !self.runs.is_swept(run) {
            self.leave_to_vehicles(run);
        }
    }

    /// A run that was begun as a sweep is none: its task came after its start.
    fn leave_to_vehicles(&mut self, run: RunId) {
        self.wished = self.wished.filter(|wished| wished.0 != run);
        if let Some(sweep) = self.phase.sweep().copied().filter(|sweep| sweep.run == run) {
            (self.last, self.phase) = (Some(sweep), Phase::Idle);
        }
    }

    /// What was ordered by anyone stands, and is lifted when every vehicle has been started since.
    fn look_after_standing(&mut self, now: Time, out: &mut Vec<Out>) {
        if !self.leases.holds() {
            return;
        }
        let stands = self.fleet.standing();
        match self.standing {
            Some(_) if stands.is_none() => self.go_on(now, out),
            Some(_) | None => self.stands_now(stands),
        }
    }

    /// What is ordered stands, if it is stronger than what does already.
    fn stands_now(&mut self, kind: Option<OrderKind>) {
        self.standing = self
            .standing
            .into_iter()
            .chain(kind)
            .reduce(OrderKind::stronger);
    }

    fn publish_plans(&mut self, now: Time, out: &mut Vec<Out>) {
        let lease = self.leases.own();
        for plan in self.succession.iter().flat_map(Succession::plans) {
            let seen = self.fleet.newest_state(plan.vehicle);
            out.push(Out::Publish(Message::Plan(tomoswarm_proto::Plan {
                lease,
                seen,
                ..plan.clone()
            })));
        }
        self.plans_at = now;
    }

    fn publish_orders(&mut self, out: &mut Vec<Out>) {
        out.extend(
            self.fleet
                .open_orders()
                .into_iter()
                .map(|order| Out::Publish(Message::Order(order))),
        );
        self.fleet.note_said();
    }

    fn lease_changed(&mut self, now: Time, change: Option<Change>, out: &mut Vec<Out>) {
        match change {
            None => {}
            Some(Change::StoodDown(lease)) => {
                out.push(Out::StationEvent(StationEvent::StandsBy(lease)))
            }
            Some(Change::Renewed(lease)) => {
                out.push(Out::StationEvent(StationEvent::Leads(lease)));
                self.fleet.set_lease(lease);
                self.publish_plans(now, out);
            }
            Some(Change::Taken(lease)) => {
                out.push(Out::StationEvent(StationEvent::Leads(lease)));
                self.fleet.set_lease(lease);
                self.count_from(now);
                self.publish_plans(now, out);
            }
        }
    }

    fn tick(&mut self, now: Time, out: &mut Vec<Out>) {
        self.turn += 1;
        let change = self.leases.tick(now);
        self.lease_changed(now, change, out);
        self.look_after_missions(now);
        if self.leases.holds() {
            self.lead(now, out);
        }
        out.push(self.report());
    }

    /// What only the holder of the lease does.
    fn lead(&mut self, now: Time, out: &mut Vec<Out>) {
        self.look_after_standing(now, out);
        self.look_after_lost(now, out);
        self.look_after_others_plans(out);
        self.begin(now, out);
        self.publish_orders(out);
        out.push(Out::Publish(Message::Have(
            self.samples.have(&self.closed, self.turn),
        )));
        out.push(Out::Publish(Message::Digest(self.map.digest())));
        self.look_after_plans(now, out);
        self.look_after_laps(now, out);
        self.close(now, out);
        self.ask_again_for_pictures(now, out);
    }

    /// Who does not hold the lease says nothing but its report, and what it remembers and notes.
    fn be_silent(&self, first: usize, out: &mut Vec<Out>) {
        if self.leases.holds() {
            return;
        }
        let is_said = |said: &Out| match said {
            Out::Publish(message) => matches!(message, Message::Report(_)),
            Out::Ask(_) | Out::Reconstruct(_) => false,
            Out::StationEvent(_) | Out::BeginRun { .. } | Out::EndRun(_) | Out::Remember(_) => true,
        };
        let own = out.split_off(first.min(out.len()));
        out.extend(own.into_iter().filter(is_said));
    }
}

impl Actor for Station {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        let first = out.len();
        match input {
            In::Bus(message) => self.hear(now, message, out),
            In::Planned(answer) => self.planned(now, answer, out),
            In::Stops(open) => {
                self.fleet.stop(&open);
                self.look_after_standing(now, out);
            }
            In::Pictured(name) => self.pictured(name),
        }
        self.be_silent(first, out);
        self.remember(first, out);
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let tick = Deadline {
            at: self.tick_at,
            why: "repeat",
        };
        let repair = self.repair.deadline().map(|at| Deadline {
            at,
            why: "ask for or send missing tiles",
        });
        Deadline::earlier(Some(tick), repair)
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        let first = out.len();
        if self.tick_at <= now {
            self.tick_at = now + TICK;
            self.tick(now, out);
        }
        self.mend(now, out);
        self.be_silent(first, out);
        self.remember(first, out);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
