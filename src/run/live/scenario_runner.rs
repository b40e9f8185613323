//! Plays the operator of a live swarm: the same operator by the same script as in virtual time. It has an operator's
//! bus, and a control connection to the world for what the script asks outside the bus; it starts and ends
//! no processes, and decides nothing about the mission.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tomoswarm_proto::{
    GroundReport, MissionEnd, MissionKind, RunEnd, RunId, RunReport, Sender, VehicleId, codec,
};

use crate::geom::Point;
use crate::node::mission::{EndReason, Obstruction, ObstructionKind};
use crate::operator::names;
use crate::operator::operator_actor::{In, Out};
use crate::operator::script::{Condition, ScriptEnd, ScriptStep, is_home};
use crate::operator::status::Expected;
use crate::run::bus::HeardMessage;
use crate::run::link::{WorldControl, WorldStatus};
use crate::run::live_operator::LiveOperator;
use crate::sim::bus::BytesByKind;
use crate::sim::log::Log;
use crate::sim::operator_script::PERSONS_ENTER;
use crate::sim::{EndedMission, RUN, Scenario, unended};
use crate::time::Time;

/// Everybody is there within this time.
const THERE_WITHIN: Duration = Duration::from_secs(30);
/// The world is asked this often.
const LOOK: Duration = Duration::from_millis(500);
/// The longest wait before looking at what else there is to do.
const WAIT: Duration = Duration::from_millis(100);

/// How it stands.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ScenarioStatus {
    /// It goes on.
    On,
    /// Everything is done.
    Over,
    /// It has failed, and why.
    Failed(String),
}

/// What was heard and written down on the way.
#[derive(Debug, Default)]
pub struct RunLog {
    /// What happened when.
    pub log: Log,
    /// Bytes of the messages heard, by sender and kind.
    pub bytes: BTreeMap<Sender, BytesByKind>,
    /// Messages heard.
    pub messages: u64,
    /// What the world said last.
    pub world: WorldStatus,
    /// Whether the sweep that is wanted was driven to its end, or every mission has ended.
    pub is_done: bool,
    /// When and how the mission of each vehicle ended, where they have missions of their own.
    pub missions: Vec<EndedMission>,
    /// Vehicles that came home at the end.
    pub home: usize,
}

impl RunLog {
    fn hear(&mut self, heard: &HeardMessage) {
        let HeardMessage::Message(sender, message) = heard else {
            return;
        };
        let bytes = codec::encode(message).map_or(0, |frame| frame.len() as u64);
        *self
            .bytes
            .entry(*sender)
            .or_default()
            .entry(message.word())
            .or_default() += bytes;
        self.messages += 1;
    }
}

/// Plays the operator.
pub struct ScenarioRunner {
    operator: LiveOperator,
    control: WorldControl,
    vehicles: Vec<VehicleId>,
    until: Time,
    /// How long the scenario may take.
    limit: Duration,
    looked: Time,
    /// What was reported of every run.
    runs: BTreeMap<RunId, RunReport>,
    home: BTreeSet<VehicleId>,
    /// A vehicle that was silent for longer is not waited for.
    lost_after: Duration,
    /// Whether the ground station plans for all.
    is_swept: bool,
    /// When and how missions ended.
    ended: BTreeMap<VehicleId, (Time, EndReason)>,
    /// Whether every mission had ended when the script did.
    are_missions_done: bool,
    run_log: RunLog,
}

impl ScenarioRunner {
    /// Joins the bus, and connects to the world, and begins: everybody is waited for, and then the scenario is
    /// followed.
    pub fn new(
        scenario: &Scenario,
        mut operator: LiveOperator,
        control: WorldControl,
    ) -> ScenarioRunner {
        let sim = scenario.sim();
        let vehicles: Vec<VehicleId> = sim.vehicle_ids().collect();
        let all = Expected {
            vehicles: vehicles.iter().copied().collect(),
            ground: true,
        };
        let mut steps = vec![ScriptStep::Wait {
            until: Condition::Heard(all),
            within: THERE_WITHIN,
        }];
        steps.extend(scenario.operator_steps());
        operator.tell(In::Follow(steps));
        ScenarioRunner {
            until: operator.now() + sim.until(),
            limit: sim.until(),
            operator,
            control,
            vehicles,
            looked: Time::ZERO,
            runs: BTreeMap::new(),
            home: BTreeSet::new(),
            lost_after: sim.venue.swarm.lost_after(),
            are_missions_done: false,
            is_swept: sim.is_planned_by_ground(),
            ended: BTreeMap::new(),
            run_log: RunLog::default(),
        }
    }

    /// Goes on for a moment.
    pub fn go(&mut self) -> ScenarioStatus {
        let run_log = &mut self.run_log;
        let output = match self
            .operator
            .go_on(self.operator.now() + WAIT, |_, heard| run_log.hear(heard))
        {
            Ok(output) => output,
            Err(fault) => return ScenarioStatus::Failed(fault.to_string()),
        };
        for out in output {
            let going = self.carry_out(out);
            if going != ScenarioStatus::On {
                // Now, while those that are there are heard: later all are stopped.
                self.are_missions_done = self.are_missions_ended();
                return going;
            }
        }
        let now = self.operator.now();
        if now > self.until {
            return ScenarioStatus::Failed(self.unended());
        }
        if now.since(self.looked) >= LOOK {
            self.looked = now;
            self.watch_world();
            self.watch_fleet(now);
        }
        ScenarioStatus::On
    }

    /// Asks the world where everybody was, and how it went; what it does not answer stays unknown.
    pub fn ask_world(&mut self) -> Vec<(VehicleId, Vec<Point>)> {
        if let Ok(status) = self.control.report() {
            self.run_log.world = status;
        }
        let control = &mut self.control;
        self.vehicles
            .iter()
            .map(|id| (*id, control.track(*id).unwrap_or_default()))
            .collect()
    }

    /// Writes a line into the log.
    pub fn note(&mut self, who: &str, what: &str) {
        let now = self.operator.now();
        self.run_log.log.line(now, who, format_args!("{what}"));
    }

    /// Leaves the bus and gives what was written down.
    pub fn leave(mut self) -> RunLog {
        self.watch_fleet(self.operator.now());
        let is_done = match self.is_swept {
            true => self
                .runs
                .get(&RUN)
                .is_some_and(|run| run.end == Some(RunEnd::Done)),
            false => self.are_missions_done || self.are_missions_ended(),
        };
        let mission = |id: &VehicleId| (*id, self.ended.get(id).cloned());
        let missions = self
            .vehicles
            .iter()
            .filter(|_| !self.is_swept)
            .map(mission)
            .collect();
        self.operator.close();
        RunLog {
            is_done,
            missions,
            home: self.home.len(),
            ..self.run_log
        }
    }

    /// Returns whether every vehicle that is there has ended its mission, as the script waits for it.
    fn are_missions_ended(&self) -> bool {
        let (view, now) = (self.operator.view(), self.operator.now());
        let is_there = |id: &&VehicleId| {
            view.state(**id)
                .is_some_and(|state| state.age(now) <= self.lost_after)
        };
        let mut there = self.vehicles.iter().filter(is_there).peekable();
        there.peek().is_some() && there.all(|id| self.ended.contains_key(id))
    }

    fn unended(&self) -> String {
        let open = self
            .vehicles
            .iter()
            .filter(|id| !self.ended.contains_key(id));
        let ids: Vec<VehicleId> = open.copied().collect();
        unended((!self.is_swept).then_some(&ids[..]), Some(self.limit))
    }

    /// Says in one line how it stands.
    pub fn line(&self) -> String {
        let now = self.operator.now();
        let ground = self.operator.view().ground(now).map_or(
            "the ground station is not heard".to_owned(),
            |report| {
                let GroundReport {
                    phase,
                    run,
                    laps_done,
                    laps,
                    samples,
                    ..
                } = &report.value;
                let phase = names::phase(*phase);
                match self.is_swept {
                    true => {
                        format!("{phase}, sweep {run}, lap {laps_done}/{laps}, {samples} samples")
                    }
                    false => format!("run {run}, {} missions ended", self.ended.len()),
                }
            },
        );
        let mode = |id: &VehicleId| {
            let state = self.operator.view().state(*id);
            format!(
                "{id} {}",
                state.map_or("-".to_owned(), |state| names::mode(state.value.mode)
                    .to_lowercase())
            )
        };
        let modes: Vec<String> = self.vehicles.iter().map(mode).collect();
        format!(
            "{:>4.0} s  {ground}; {}",
            now.as_secs_f64(),
            modes.join(", ")
        )
    }

    /// Carries out what the operator says beside its messages.
    fn carry_out(&mut self, out: Out) -> ScenarioStatus {
        if let Some(words) = out.in_words() {
            self.note("operator", &words);
        }
        match out {
            Out::Announce(name) if name == PERSONS_ENTER => {
                self.note("scenario", "the persons enter");
                if let Err(error) = self.control.enter() {
                    return ScenarioStatus::Failed(format!("the persons cannot enter: {error}"));
                }
                self.operator.tell(In::CueDone);
                ScenarioStatus::On
            }
            Out::ScriptEnded(ScriptEnd::Done) => ScenarioStatus::Over,
            Out::ScriptEnded(ScriptEnd::GaveUp { why, .. }) => ScenarioStatus::Failed(why),
            // What is not known here is not done, and the script gives up.
            Out::Announce(_)
            | Out::Publish(_)
            | Out::Give(_)
            | Out::StopEvent(_)
            | Out::InForce(..)
            | Out::Ended(..)
            | Out::Marked(..) => ScenarioStatus::On,
        }
    }

    /// Notes which runs have ended, and who has come home.
    fn watch_fleet(&mut self, now: Time) {
        let view = self.operator.view();
        let reported = view
            .ground(now)
            .map(|report| report.value.runs.clone())
            .unwrap_or_default();
        let is_there = |id: &VehicleId| {
            view.vehicle(*id)
                .and_then(|seen| seen.mission.as_ref())
                .is_some_and(|output| is_home(&output.value))
        };
        let home: BTreeSet<VehicleId> = self.vehicles.iter().copied().filter(is_there).collect();
        for run in reported {
            let known = self.runs.insert(run.run, run);
            if let Some(end) = run
                .end
                .filter(|_| known.and_then(|known| known.end) != run.end)
            {
                let RunReport {
                    run,
                    samples,
                    images,
                    ..
                } = run;
                let end = names::run_end(Some(end));
                self.note(
                    "ground",
                    &format!("run {run} is {end}: {samples} samples, {images} images"),
                );
            }
        }
        let ended = self
            .vehicles
            .iter()
            .filter_map(|id| Some((*id, self.ending(*id)?)));
        for (id, end) in ended.collect::<Vec<(VehicleId, Option<(MissionEnd, EndReason)>)>>() {
            self.take_end(now, id, end);
        }
        for id in home.difference(&self.home.clone()) {
            self.note(&format!("vehicle {id}"), "is home");
        }
        self.home = home;
    }

    /// Returns how a vehicle says that its own mission has ended, `Some(None)` when it says that it has not; `None` when it
    /// says nothing of one.
    fn ending(&self, id: VehicleId) -> Option<Option<(MissionEnd, EndReason)>> {
        let view = self.operator.view();
        let output = view
            .vehicle(id)?
            .mission
            .as_ref()
            .map(|output| output.value)?;
        if output.kind == MissionKind::Sweep {
            return None;
        }
        let pose = view.state(id).and_then(|state| state.value.pose);
        let place = pose.map(|pose| Point::from(pose.at)).unwrap_or_default();
        Some(output.end.map(|end| (end, end_of(end, place))))
    }

    /// Notes how a mission has ended, once; one that was begun anew has not.
    fn take_end(&mut self, now: Time, id: VehicleId, end: Option<(MissionEnd, EndReason)>) {
        match (end, self.ended.contains_key(&id)) {
            (Some((output, end)), false) => {
                self.ended.insert(id, (now, end));
                self.note(
                    &format!("vehicle {id}"),
                    &format!("its mission has ended: {output}"),
                );
            }
            (None, true) => {
                self.ended.remove(&id);
            }
            (Some(_), true) | (None, false) => {}
        }
    }

    fn watch_world(&mut self) {
        // A world that is gone is noticed by who started it.
        let Ok(status) = self.control.report() else {
            return;
        };
        let known = self.run_log.world.collision_count;
        let world = std::mem::replace(&mut self.run_log.world, status);
        let new: Vec<String> = self
            .run_log
            .world
            .collisions
            .iter()
            .skip(world.collisions.len())
            .map(|contact| {
                let with = contact
                    .with
                    .map_or("the scene".to_owned(), |peer| format!("vehicle {peer}"));
                let (place, vehicle) = (contact.place, contact.vehicle);
                format!(
                    "vehicle {vehicle} touches {with} at {:.2}, {:.2} m",
                    place.x_m, place.y_m
                )
            })
            .collect();
        for words in new {
            self.note("referee", &words);
        }
        if self.run_log.world.collision_count > known {
            let count = self.run_log.world.collision_count;
            self.note("referee", &format!("{count} collisions"));
        }
    }
}

/// Returns an end as a simulation writes it down; `place` is where the vehicle stands.
fn end_of(end: MissionEnd, place: Point) -> EndReason {
    match end {
        MissionEnd::Done => EndReason::Done,
        // The wire does not say in front of what.
        MissionEnd::Stopped => EndReason::Stopped(Obstruction {
            at: place,
            kind: ObstructionKind::Unreported,
        }),
        MissionEnd::NoWay(places) => EndReason::NoWay(places.into()),
        MissionEnd::GaveUp(places) => EndReason::GaveUp(places.into()),
        MissionEnd::Refused(why) => EndReason::Refused(why),
    }
}
