//! A script: what an operator does by itself, step after step. It waits for what the fleet shows, says what is wanted,
//! and gives cues for what happens outside the bus (people walk in). Every wait has a limit. It sends nothing: the
//! operator does.
//!
//! ```text
//!   step ─Want, Delay, Cue─► next step …                          ─► done
//!     └──Wait─► shown ─► next step; not shown within its limit, or a want that failed ─► gave up
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::time::Duration;

use tomoswarm_proto::{Mode, OrderKind, RunId, State, StationPhase, VehicleId};

use super::fleet_view::FleetView;
use super::status::Expected;
use super::want::Want;
use crate::geom::Point;
use crate::node::mission;
use crate::time::Time;

/// What is waited for.
#[derive(Clone, PartialEq, Debug)]
pub enum Condition {
    /// These vehicles, and the ground station if it is expected, were heard.
    Heard(Expected),
    /// What the script wanted last is in force on every vehicle.
    InForce,
    /// The ground station has driven this run to its end, and is idle.
    RunEnded(RunId),
    /// Every vehicle that was sent home rests there.
    AtHome(BTreeMap<VehicleId, Point>),
}

/// One step.
#[derive(Clone, PartialEq, Debug)]
pub enum Step {
    /// Waits until the fleet shows something; gives up after `within`.
    Wait {
        /// What is waited for.
        until: Condition,
        /// For so long at most.
        within: Duration,
    },
    /// Lets time pass.
    Delay(Duration),
    /// Wants something of the fleet; it stands.
    Want(Want),
    /// Asks for something that is not the fleet's to do, and waits until it is said to be done.
    Cue {
        /// What is asked for.
        name: String,
        /// For so long at most.
        within: Duration,
    },
}

/// How a script ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ScriptEnd {
    /// Every step was taken.
    Done,
    /// It gave up.
    GaveUp {
        /// At this step, counted from 0.
        step: usize,
        /// In words.
        why: String,
    },
}

/// What a script says.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum ScriptOut {
    /// This is wanted.
    Want(Want),
    /// This is to be done.
    Cue(String),
    /// It is over.
    Ended(ScriptEnd),
}

/// How it stands with what a script wanted last.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum LastWant {
    /// It is on its way.
    Open,
    /// Every vehicle showed it.
    InForce,
    /// It has ended otherwise; why in words.
    Failed(String),
}

/// What a script can look at.
pub(super) struct Sight<'a> {
    /// What is known of the fleet.
    pub view: &'a FleetView,
    /// How it stands with what it wanted last.
    pub last_want: &'a LastWant,
}

/// A script on its way.
#[derive(Clone, Debug)]
pub(super) struct ScriptRun {
    steps: Vec<Step>,
    at: usize,
    /// Since when it is at this step.
    since: Time,
    is_cue_said: bool,
    is_cue_done: bool,
}

impl ScriptRun {
    /// Begins.
    pub fn new(now: Time, steps: Vec<Step>) -> ScriptRun {
        ScriptRun { steps, at: 0, since: now, is_cue_said: false, is_cue_done: false }
    }

    /// Takes that what a cue asked for is done.
    pub fn cue_done(&mut self) {
        self.is_cue_done = self.is_cue_said;
    }

    /// Goes on as far as it gets without saying anything; returns what it says. After [`ScriptOut::Ended`] it is not
    /// asked again.
    pub fn go_on(&mut self, now: Time, sight: &Sight) -> Option<ScriptOut> {
        if let LastWant::Failed(why) = sight.last_want {
            return Some(self.give_up(why.clone()));
        }
        while let Some(step) = self.steps.get(self.at) {
            let waited = now.since(self.since);
            match step {
                Step::Want(want) => {
                    let want = want.clone();
                    self.next(now);
                    return Some(ScriptOut::Want(want));
                }
                Step::Cue { name, .. } if !self.is_cue_said => {
                    self.is_cue_said = true;
                    return Some(ScriptOut::Cue(name.clone()));
                }
                Step::Cue { .. } if self.is_cue_done => self.next(now),
                Step::Cue { name, within } => {
                    let why = || format!("{name:?} was not done within {:.1} s", within.as_secs_f64());
                    return (waited >= *within).then(|| self.give_up(why()));
                }
                Step::Wait { until, .. } if until.is_shown(now, sight) => self.next(now),
                Step::Wait { until, within } => {
                    let why = || until.missed(now, sight, *within);
                    return (waited >= *within).then(|| self.give_up(why()));
                }
                Step::Delay(span) if waited >= *span => self.next(now),
                Step::Delay(_) => return None,
            }
        }
        Some(ScriptOut::Ended(ScriptEnd::Done))
    }

    /// Returns when the present step is over at the latest, and why.
    pub fn deadline(&self) -> Option<(Time, &'static str)> {
        match self.steps.get(self.at)? {
            Step::Wait { within, .. } => Some((self.since + *within, "script gives up")),
            Step::Cue { within, .. } => Some((self.since + *within, "cue not done")),
            Step::Delay(span) => Some((self.since + *span, "script goes on")),
            Step::Want(_) => None,
        }
    }

    fn next(&mut self, now: Time) {
        self.at += 1;
        (self.since, self.is_cue_said, self.is_cue_done) = (now, false, false);
    }

    fn give_up(&self, why: String) -> ScriptOut {
        ScriptOut::Ended(ScriptEnd::GaveUp { step: self.at, why })
    }
}

impl Condition {
    fn is_shown(&self, now: Time, sight: &Sight) -> bool {
        match self {
            Condition::Heard(expected) => expected.all_heard(sight.view, now),
            Condition::InForce => *sight.last_want == LastWant::InForce,
            Condition::RunEnded(run) => sight.view.ground(now).is_some_and(|report| {
                let report = &report.value;
                report.run == *run && report.phase == StationPhase::Idle && report.laps > 0
            }),
            Condition::AtHome(homes) => away(homes, sight.view).is_empty(),
        }
    }

    /// Says what was waited for in vain.
    fn missed(&self, now: Time, sight: &Sight, within: Duration) -> String {
        let missing = match self {
            Condition::Heard(expected) => {
                format!("not heard: {}", expected.missing(sight.view, now).join(", "))
            }
            Condition::AtHome(homes) => {
                let away: Vec<String> =
                    away(homes, sight.view).iter().map(|id| format!("vehicle {id}")).collect();
                format!("not at home: {}", away.join(", "))
            }
            Condition::InForce | Condition::RunEnded(_) => format!("not shown: {self}"),
        };
        format!("{missing}, within {:.1} s", within.as_secs_f64())
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Condition::Heard(_) => write!(f, "everybody is heard"),
            Condition::InForce => write!(f, "every vehicle shows the order"),
            Condition::RunEnded(run) => write!(f, "run {run} has ended"),
            Condition::AtHome(_) => write!(f, "everybody is at home"),
        }
    }
}

/// Returns who is not at home yet.
fn away(homes: &BTreeMap<VehicleId, Point>, view: &FleetView) -> BTreeSet<VehicleId> {
    let is_there =
        |id: &VehicleId, home: &Point| view.state(*id).is_some_and(|state| is_at_home(&state.value, *home));
    homes.iter().filter(|(id, home)| !is_there(id, home)).map(|(id, _)| *id).collect()
}

/// Returns whether a vehicle that was sent home has come to rest there.
pub fn is_at_home(state: &State, home: Point) -> bool {
    let is_returning = state.ordered.kind == Some(OrderKind::Return);
    let rests = state.leg.is_none() && matches!(state.mode, Mode::Idle | Mode::Held);
    let is_there = state.pose.is_some_and(|pose| mission::is_at_home(pose.into(), home));
    is_returning && rests && is_there
}
