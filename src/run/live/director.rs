//! Plays the operator of a live swarm by the same script as a simulation in virtual time: when sweeps are wished, when the
//! persons enter, when everybody is sent home, and when it is over or has failed. It has what an operator has, the bus, and
//! what a stage manager has, the world's ear; it starts and ends no processes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration;

use tomoswarm_proto::{OrderKind, Report, RunId, Sender, VehicleId, codec};

use crate::geom::Point;
use crate::ground::imager::Subject;
use crate::ground::station::Note;
use crate::operator::names;
use crate::operator::operator_actor::{In, Out};
use crate::operator::script::is_at_home;
use crate::operator::status::Expected;
use crate::operator::want::{Want, WantId};
use crate::run::bus::Heard;
use crate::run::link::{Status, WorldControl};
use crate::run::live_operator::LiveOperator;
use crate::sim::bus::BytesByKind;
use crate::sim::log::Log;
use crate::sim::script::{Act, Next, Script, Step};
use crate::sim::{RUN, Scenario, ScenarioError};
use crate::store::ground::GroundStore;
use crate::time::Time;

/// Everybody is there within this time.
const THERE_WITHIN: Duration = Duration::from_secs(30);
/// An order is obeyed within this time.
const OBEYED_WITHIN: Duration = Duration::from_secs(15);
/// Pictures of a closed sweep that are not there after so long will not come any more.
const PICTURED_WITHIN: Duration = Duration::from_secs(60);
/// The store and the world are asked this often.
const LOOK: Duration = Duration::from_millis(500);
/// Longer than this nothing is waited for without a look at what else there is to do.
const WAIT: Duration = Duration::from_millis(100);

/// How it stands.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Going {
    /// It goes on.
    On,
    /// Everything is done.
    Over,
    /// It has failed, and why.
    Failed(String),
}

/// What was heard and written down on the way.
#[derive(Debug, Default)]
pub struct Diary {
    /// What happened when.
    pub log: Log,
    /// Bytes of the messages heard, by sender and kind.
    pub bytes: BTreeMap<Sender, BytesByKind>,
    /// Messages heard.
    pub messages: u64,
    /// What the world said last.
    pub world: Status,
    /// Whether the sweep that is wanted was driven to its end.
    pub sweep_done: bool,
    /// Vehicles that came home at the end.
    pub home: usize,
}

impl Diary {
    fn hear(&mut self, heard: &Heard) {
        let Heard::Message(sender, message) = heard else { return };
        let bytes = codec::encode(message).map_or(0, |frame| frame.len() as u64);
        *self.bytes.entry(*sender).or_default().entry(message.word()).or_default() += bytes;
        self.messages += 1;
    }
}

/// Plays the operator.
pub struct Director {
    operator: LiveOperator,
    control: WorldControl,
    store_path: PathBuf,
    store: Option<GroundStore>,
    script: Script,
    homes: BTreeMap<VehicleId, Point>,
    until: Time,
    /// Since when everybody is there.
    begun: Option<Time>,
    steps: Vec<(Time, Step)>,
    /// What is wanted of everybody and not brought about yet.
    wanted: Option<WantId>,
    wants: u32,
    looked: Time,
    /// When the sweep that is wanted was seen to be closed.
    closed: BTreeMap<RunId, Time>,
    is_pictured: bool,
    returns: bool,
    home: BTreeSet<VehicleId>,
    diary: Diary,
}

impl Director {
    /// Takes a seat on the bus and at the world's ear; `store_path` is the ground station's store.
    ///
    /// # Errors
    /// The scene cannot be built.
    pub fn new(
        scenario: &Scenario,
        operator: LiveOperator,
        control: WorldControl,
        store_path: PathBuf,
    ) -> Result<Director, ScenarioError> {
        let sim = scenario.sim();
        let homes = sim.vehicle_ids().filter_map(|id| Some((id, sim.home(id)?))).collect();
        Ok(Director {
            until: operator.now() + sim.until(),
            operator,
            control,
            store_path,
            store: None,
            script: scenario.script()?,
            homes,
            begun: None,
            steps: Vec::new(),
            wanted: None,
            wants: 0,
            looked: Time::ZERO,
            closed: BTreeMap::new(),
            is_pictured: false,
            returns: false,
            home: BTreeSet::new(),
            diary: Diary::default(),
        })
    }

    /// Goes on for a moment.
    pub fn go(&mut self) -> Going {
        let going = self.listen();
        if going != Going::On {
            return going;
        }
        let now = self.operator.now();
        if now > self.until {
            return Going::Failed("the sweep did not end in time".to_owned());
        }
        if self.begun.is_none() {
            return self.gather(now);
        }
        let mut going = self.take_steps(now);
        if going == Going::On && now.since(self.looked) >= LOOK {
            self.looked = now;
            going = self.look(now);
        }
        going
    }

    /// Asks the world where everybody was, and how it went; what it does not answer stays unknown.
    pub fn ask_world(&mut self) -> Vec<(VehicleId, Vec<Point>)> {
        if let Ok(status) = self.control.report() {
            self.diary.world = status;
        }
        let ids: Vec<VehicleId> = self.homes.keys().copied().collect();
        ids.into_iter().map(|id| (id, self.control.track(id).unwrap_or_default())).collect()
    }

    /// Writes a line into the log.
    pub fn note(&mut self, who: &str, what: &str) {
        let now = self.operator.now();
        self.diary.log.line(now, who, format_args!("{what}"));
    }

    /// Leaves the bus and gives what was written down.
    pub fn leave(self) -> Diary {
        let sweep_done = self.script.is_sweep_done();
        self.operator.close();
        Diary { sweep_done, home: self.home.len(), ..self.diary }
    }

    /// Says in one line how it stands.
    pub fn line(&self) -> String {
        let now = self.operator.now();
        let ground =
            self.operator.view().ground(now).map_or("the ground station is not heard".to_owned(), |report| {
                let Report { phase, run, laps_done, laps, samples, .. } = &report.value;
                let phase = format!("{phase:?}").to_lowercase();
                format!("{phase}, sweep {run}, lap {laps_done}/{laps}, {samples} samples")
            });
        let mode = |id: &VehicleId| {
            let state = self.operator.view().state(*id);
            format!(
                "{id} {}",
                state.map_or("-".to_owned(), |state| names::mode(state.value.mode).to_lowercase())
            )
        };
        let modes: Vec<String> = self.homes.keys().map(mode).collect();
        format!("{:>4.0} s  {ground}; {}", now.as_secs_f64(), modes.join(", "))
    }

    /// Hears and orders for a moment.
    fn listen(&mut self) -> Going {
        let diary = &mut self.diary;
        let said = self.operator.go_on(self.operator.now() + WAIT, |_, heard| diary.hear(heard));
        let said = match said {
            Ok(said) => said,
            Err(fault) => return Going::Failed(fault.to_string()),
        };
        for out in said {
            match out {
                Out::Ended(id, outcome) if self.wanted == Some(id) => {
                    self.wanted = None;
                    if !outcome.is_done() {
                        return Going::Failed(outcome.undone());
                    }
                }
                Out::Ended(..) | Out::Publish(_) | Out::InForce(..) | Out::Cue(_) | Out::ScriptEnded(_) => {}
            }
        }
        Going::On
    }

    /// Waits until everybody is there.
    fn gather(&mut self, now: Time) -> Going {
        let expected = Expected { vehicles: self.homes.keys().copied().collect(), ground: true };
        let missing = expected.missing(self.operator.view(), now);
        if missing.is_empty() {
            self.begun = Some(now);
            self.note("scenario", "everybody is there");
            let (after, step) = self.script.first();
            self.steps.push((now + after, step));
            return Going::On;
        }
        if now > Time::ZERO + THERE_WITHIN {
            return Going::Failed(format!("not heard: {}", missing.join(", ")));
        }
        Going::On
    }

    fn take_steps(&mut self, now: Time) -> Going {
        let due = self.steps.iter().position(|(at, _)| *at <= now);
        let Some((_, step)) = due.map(|index| self.steps.remove(index)) else { return Going::On };
        let (act, next) = self.script.step(step);
        let going = self.carry_out(act);
        if going == Going::On { self.follow(now, next) } else { going }
    }

    fn carry_out(&mut self, act: Act) -> Going {
        match act {
            Act::Sweep { run, empty: _ } => {
                // What it is compared with stands in the ground station's file.
                self.note("scenario", &format!("sweep {run} is wished"));
                self.begin(OrderKind::Start, Some(run))
            }
            Act::Start => {
                self.note("scenario", "the missions begin");
                self.begin(OrderKind::Start, None)
            }
            Act::Enter(_) => {
                self.note("scenario", "the persons enter");
                match self.control.enter() {
                    Ok(_) => Going::On,
                    Err(error) => Going::Failed(format!("the persons cannot enter: {error}")),
                }
            }
            Act::ReturnHome => {
                self.note("scenario", "everybody is sent home");
                self.returns = true;
                self.begin(OrderKind::Return, None)
            }
            Act::Fail(reason) => Going::Failed(reason),
        }
    }

    fn begin(&mut self, kind: OrderKind, run: Option<RunId>) -> Going {
        let want = Want {
            kind,
            vehicles: self.homes.keys().copied().collect(),
            run,
            begins: kind == OrderKind::Start,
            take_over: false,
            within: OBEYED_WITHIN,
        };
        self.operator.tell(In::Want(self.wants, want));
        self.wanted = Some(WantId::Hand(self.wants));
        self.wants += 1;
        Going::On
    }

    fn follow(&mut self, now: Time, next: Next) -> Going {
        match next {
            Next::Nothing => Going::On,
            Next::Step(after, step) => {
                self.steps.push((now + after, step));
                Going::On
            }
            Next::End => Going::Over,
            Next::Fail(reason) => Going::Failed(reason),
        }
    }

    /// Looks what has come about: sweeps closed, pictures made, vehicles home, contacts.
    fn look(&mut self, now: Time) -> Going {
        self.watch_world();
        if self.store.is_none() {
            self.store = GroundStore::open_to_read(&self.store_path).ok();
        }
        let mut going = self.look_for_closed(now);
        if going == Going::On && self.closed.contains_key(&RUN) && !self.is_pictured {
            going = self.look_for_picture(now);
        }
        if going == Going::On && self.returns && self.wanted.is_none() {
            going = self.look_for_home(now);
        }
        going
    }

    fn watch_world(&mut self) {
        // A world that is gone is noticed by who started it.
        let Ok(status) = self.control.report() else { return };
        let known = self.diary.world.collision_count;
        let world = std::mem::replace(&mut self.diary.world, status);
        let new: Vec<String> = self
            .diary
            .world
            .collisions
            .iter()
            .skip(world.collisions.len())
            .map(|contact| {
                let with = contact.with.map_or("the scene".to_owned(), |peer| format!("vehicle {peer}"));
                let (place, vehicle) = (contact.place, contact.vehicle);
                format!("vehicle {vehicle} touches {with} at {:.2}, {:.2} m", place.x_m, place.y_m)
            })
            .collect();
        for words in new {
            self.note("referee", &words);
        }
        if self.diary.world.collision_count > known {
            let count = self.diary.world.collision_count;
            self.note("referee", &format!("{count} collisions"));
        }
    }

    fn look_for_closed(&mut self, now: Time) -> Going {
        // Where the store cannot be read now it can the next time.
        let runs = self.store.as_ref().and_then(|store| store.runs().ok()).unwrap_or_default();
        let closed = runs.iter().filter(|run| run.closed_utc_s.is_some()).map(|run| run.run);
        let new: Vec<RunId> = closed.filter(|run| !self.closed.contains_key(run)).collect();
        for run in new {
            self.closed.insert(run, now);
            let samples = self.operator.view().ground(now).map_or(0, |report| report.value.samples);
            self.note("ground", &format!("sweep {run} is closed"));
            let next = self.script.hear(&Note::RunClosed { run, links: 0, samples });
            let going = self.follow(now, next);
            if going != Going::On {
                return going;
            }
        }
        Going::On
    }

    /// Looks whether the last pictures of the sweep that is wanted are there.
    fn look_for_picture(&mut self, now: Time) -> Going {
        let Some(store) = &self.store else { return Going::On };
        let runs = store.runs().unwrap_or_default();
        let closed_utc_s = runs.iter().find(|run| run.run == RUN).and_then(|run| run.closed_utc_s);
        let made = store.newest_images(RUN).unwrap_or_default();
        let is_last = |kind: &str| {
            made.iter().any(|image| image.kind == kind && Some(image.made_utc_s) >= closed_utc_s)
        };
        let since = self.closed.get(&RUN).copied().unwrap_or(now);
        if !is_last("structure") && now.since(since) < PICTURED_WITHIN {
            return Going::On;
        }
        self.is_pictured = true;
        let words = if is_last("structure") { "the last picture is made" } else { "no last picture is made" };
        self.note("ground", words);
        let next = self.script.picture(RUN, Subject::Structure);
        self.follow(now, next)
    }

    fn look_for_home(&mut self, now: Time) -> Going {
        let is_new = |(id, home): (&VehicleId, &Point)| {
            let state = &self.operator.view().state(*id)?.value;
            (!self.home.contains(id) && is_at_home(state, *home)).then_some(*id)
        };
        let new: Vec<VehicleId> = self.homes.iter().filter_map(is_new).collect();
        for id in new {
            self.home.insert(id);
            self.note(&format!("vehicle {id}"), "is home");
            let next = self.script.came_home(self.home.len(), self.homes.len());
            let going = self.follow(now, next);
            if going != Going::On {
                return going;
            }
        }
        Going::On
    }
}
