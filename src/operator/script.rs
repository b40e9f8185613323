//! A script: what an operator does by itself, step after step. It waits for what the fleet shows, says what is wanted,
//! and gives cues for what happens outside the bus (people walk in). Every wait has a limit. It sends nothing: the
//! operator does.
//!
//! ```text
//!   step ─Task, Want, Delay, Cue─► next step …                    ─► done
//!     ├──Wait─► shown ─► next step; not shown within its limit, or a want that failed ─► gave up
//!     │         what it waits for cannot come any more: a run has failed, or too few
//!     │         of those who are to bring it about were heard for very long ───────────► gave up
//!     └──EndIf─► shown ─► done; otherwise the next step
//! ```

use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    GroundReport, MissionKind, MissionPhase, MissionProgress, OrderKind, RunEnd, RunId, RunReport,
    StationPhase, VehicleId,
};

use super::fleet_view::FleetView;
use super::given_tasks::TaskRequest;
use super::names::kind_name;
use super::order_goal::OrderGoal;
use super::status::Expected;
use crate::time::Time;

/// A vehicle that was not heard for this long does not come back any more. People read of it in docs/modules.md and in the help
/// of `sim`.
pub(crate) const GONE_AFTER: Duration = Duration::from_secs(900);

/// What is waited for.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Condition {
    /// These vehicles, and the ground station if it is expected, were heard.
    Heard(Expected),
    /// What the script wanted last is in force on every vehicle.
    InForce,
    /// Every stop of this run is done and all its samples are in; its images may still be made.
    Driven(RunId),
    /// Everything of this run is done, its last images too.
    Done(RunId),
    /// Every vehicle that is there has ended a mission of its own.
    MissionsEnded(LiveVehicles),
    /// Every vehicle that is there has come home and stays there.
    Home(LiveVehicles),
    /// One of these, or several.
    Any(Vec<Condition>),
}

/// Vehicles, as far as they are there: who has been silent for too long is not waited for.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct LiveVehicles {
    /// The vehicles.
    pub vehicles: BTreeSet<VehicleId>,
    /// For this long.
    pub lost_after: Duration,
}

/// One step.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum ScriptStep {
    /// Waits until the fleet shows something; gives up after `within`.
    Wait {
        /// What is waited for.
        until: Condition,
        /// For this long at most.
        within: Duration,
    },
    /// Lets time pass.
    Delay(Duration),
    /// Gives a task; it is repeated until it is shown.
    Task(TaskRequest),
    /// Wants something of the fleet; it stands.
    Want(OrderGoal),
    /// Ends the script if the fleet shows this now.
    EndIf(Condition),
    /// Asks for something that is not the fleet's to do, and waits until it is said to be done.
    Announce {
        /// What is asked for.
        name: String,
        /// For this long at most.
        within: Duration,
    },
}

/// How a script ended.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
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

impl fmt::Display for ScriptEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ScriptEnd::Done => f.write_str("done"),
            ScriptEnd::GaveUp { step, why } => write!(f, "gave up at step {step}: {why}"),
        }
    }
}

/// What a script says.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum ScriptOut {
    /// This run is to be as it says.
    Task(TaskRequest),
    /// This is wanted.
    Want(OrderGoal),
    /// This is to be done.
    Announce(String),
    /// It is over.
    Ended(ScriptEnd),
}

/// How it stands with what a script wanted last.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) enum LastGoal {
    /// It is on its way.
    Open,
    /// Every vehicle showed it.
    InForce,
    /// It has ended otherwise; why in words.
    Failed(String),
}

/// What a script waits for until a moment.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub(super) enum ScriptDue {
    /// The limit of a wait.
    GivesUp,
    /// The limit of a cue.
    CueNotDone,
    /// The end of a delay.
    GoesOn,
}

impl ScriptDue {
    /// Returns it in words.
    pub(super) fn why(self) -> &'static str {
        match self {
            ScriptDue::GivesUp => "script gives up",
            ScriptDue::CueNotDone => "cue not done",
            ScriptDue::GoesOn => "script goes on",
        }
    }
}

/// What a script can look at.
pub(super) struct ScriptView<'a> {
    /// What is known of the fleet.
    pub view: &'a FleetView,
    /// How it stands with what it wanted last.
    pub last_want: &'a LastGoal,
}

/// A script on its way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct ScriptRun {
    steps: Vec<ScriptStep>,
    at: usize,
    /// Since when it is at this step.
    since: Time,
    is_cue_said: bool,
    is_cue_done: bool,
}

impl ScriptRun {
    /// Begins.
    pub(super) fn new(now: Time, steps: Vec<ScriptStep>) -> ScriptRun {
        ScriptRun {
            steps,
            at: 0,
            since: now,
            is_cue_said: false,
            is_cue_done: false,
        }
    }

    /// Records that what a cue asked for is done.
    pub(super) fn cue_done(&mut self) {
        self.is_cue_done = self.is_cue_said;
    }

    /// Goes on as far as it gets without saying anything; returns what it says. After [`ScriptOut::Ended`] it is not
    /// asked again.
    pub(super) fn go_on(&mut self, now: Time, sight: &ScriptView) -> Option<ScriptOut> {
        if let LastGoal::Failed(why) = sight.last_want {
            return Some(self.give_up(why.clone()));
        }
        while let Some(step) = self.steps.get(self.at) {
            let waited = now.since(self.since);
            match step {
                ScriptStep::Want(want) => {
                    let want = want.clone();
                    self.next(now);
                    return Some(ScriptOut::Want(want));
                }
                ScriptStep::Task(wish) => {
                    let wish = wish.clone();
                    self.next(now);
                    return Some(ScriptOut::Task(wish));
                }
                ScriptStep::EndIf(shown) if shown.is_shown(now, sight) => break,
                ScriptStep::EndIf(_) => self.next(now),
                ScriptStep::Announce { name, .. } if !self.is_cue_said => {
                    self.is_cue_said = true;
                    return Some(ScriptOut::Announce(name.clone()));
                }
                ScriptStep::Announce { .. } if self.is_cue_done => self.next(now),
                ScriptStep::Announce { name, within } => {
                    let why =
                        || format!("{name:?} was not done within {:.1} s", within.as_secs_f64());
                    return (waited >= *within).then(|| self.give_up(why()));
                }
                ScriptStep::Wait { until, .. } if until.is_shown(now, sight) => self.next(now),
                ScriptStep::Wait { until, within } => {
                    let why = until.is_hopeless(now, sight);
                    if let Some(why) = why.or_else(|| self.too_few_heard(until, now, sight)) {
                        return Some(self.give_up(why));
                    }
                    let why = || until.missed(now, sight, *within, self.order_before());
                    return (waited >= *within).then(|| self.give_up(why()));
                }
                ScriptStep::Delay(span) if waited >= *span => self.next(now),
                ScriptStep::Delay(_) => return None,
            }
        }
        Some(ScriptOut::Ended(ScriptEnd::Done))
    }

    /// Returns when the present step is over at the latest, and why.
    pub(super) fn deadline(&self) -> Option<(Time, ScriptDue)> {
        match self.steps.get(self.at)? {
            ScriptStep::Wait { within, .. } => Some((self.since + *within, ScriptDue::GivesUp)),
            ScriptStep::Announce { within, .. } => {
                Some((self.since + *within, ScriptDue::CueNotDone))
            }
            ScriptStep::Delay(span) => Some((self.since + *span, ScriptDue::GoesOn)),
            ScriptStep::Task(_) | ScriptStep::Want(_) | ScriptStep::EndIf(_) => None,
        }
    }

    fn next(&mut self, now: Time) {
        self.at += 1;
        (self.since, self.is_cue_said, self.is_cue_done) = (now, false, false);
    }

    /// Returns in words that too few members of the task are left to do what is waited for; `None` = enough, or it need not be
    /// done by them.
    fn too_few_heard(&self, until: &Condition, now: Time, sight: &ScriptView) -> Option<String> {
        if !until.is_of_task() || now.since(self.since) < GONE_AFTER {
            return None;
        }
        let task = self.task_before()?;
        let heard = task.members.iter().filter(|id| {
            let state = sight.view.state(**id);
            state.is_some_and(|state| state.age(now) <= GONE_AFTER)
        });
        let (heard, members) = (heard.count(), task.members.len());
        let limit_s = GONE_AFTER.as_secs();
        (heard < task.least_members()).then(|| {
            format!("{heard} of {members} vehicles were heard within {limit_s} s, too few")
        })
    }

    /// Returns the task that was given last before the present step.
    fn task_before(&self) -> Option<&TaskRequest> {
        let before = self.steps.get(..self.at)?;
        before.iter().rev().find_map(|step| match step {
            ScriptStep::Task(task) => Some(task),
            ScriptStep::Wait { .. }
            | ScriptStep::Delay(_)
            | ScriptStep::Want(_)
            | ScriptStep::EndIf(_)
            | ScriptStep::Announce { .. } => None,
        })
    }

    /// Returns what was ordered right before the present step.
    fn order_before(&self) -> Option<OrderKind> {
        match self.steps.get(self.at.checked_sub(1)?)? {
            ScriptStep::Want(goal) => Some(goal.kind),
            ScriptStep::Wait { .. }
            | ScriptStep::Delay(_)
            | ScriptStep::Task(_)
            | ScriptStep::EndIf(_)
            | ScriptStep::Announce { .. } => None,
        }
    }

    fn give_up(&self, why: String) -> ScriptOut {
        ScriptOut::Ended(ScriptEnd::GaveUp { step: self.at, why })
    }
}

impl Condition {
    fn is_shown(&self, now: Time, sight: &ScriptView) -> bool {
        match self {
            Condition::Heard(expected) => expected.all_heard(sight.view, now),
            Condition::InForce => *sight.last_want == LastGoal::InForce,
            Condition::Driven(run) => sight
                .report(now)
                .is_some_and(|report| is_driven(report, *run)),
            Condition::Done(run) => sight
                .run(now, *run)
                .is_some_and(|run| run.end == Some(RunEnd::Done)),
            Condition::MissionsEnded(present) => present.all(now, sight.view, has_ended),
            Condition::Home(present) => present.all(now, sight.view, is_home),
            Condition::Any(conditions) => conditions.iter().any(|one| one.is_shown(now, sight)),
        }
    }

    /// Returns whether it comes about only by vehicles that do the task which was given.
    fn is_of_task(&self) -> bool {
        match self {
            Condition::Driven(_) | Condition::Done(_) | Condition::MissionsEnded(_) => true,
            Condition::Any(conditions) => conditions.iter().all(Condition::is_of_task),
            Condition::Heard(_) | Condition::InForce | Condition::Home(_) => false,
        }
    }

    /// Returns why it cannot come to be shown any more; `None` = it can.
    fn is_hopeless(&self, now: Time, sight: &ScriptView) -> Option<String> {
        match self {
            Condition::Driven(run) | Condition::Done(run) => {
                let end = sight.run(now, *run)?.end?;
                let how = match end {
                    RunEnd::Done => return None,
                    RunEnd::Stopped => "was given up",
                    RunEnd::Failed => "has failed",
                };
                let words = format!("run {run} {how}");
                // The ground station says why in words that begin so.
                let why = sight
                    .report(now)?
                    .troubles
                    .iter()
                    .find(|trouble| trouble.starts_with(&words));
                Some(why.cloned().unwrap_or(words))
            }
            Condition::Any(conditions) => {
                let reasons = conditions.iter().map(|one| one.is_hopeless(now, sight));
                reasons
                    .collect::<Option<Vec<String>>>()
                    .map(|reasons| reasons.join("; "))
            }
            Condition::Heard(_)
            | Condition::InForce
            | Condition::MissionsEnded(_)
            | Condition::Home(_) => None,
        }
    }

    /// Returns what was waited for in vain, and for how long; `order`: what was ordered right before.
    fn missed(
        &self,
        now: Time,
        sight: &ScriptView,
        within: Duration,
        order: Option<OrderKind>,
    ) -> String {
        let missing = match self {
            Condition::Heard(expected) => {
                format!(
                    "not heard: {}",
                    expected.missing(sight.view, now).join(", ")
                )
            }
            Condition::Home(present) => {
                let away = not_home(&present.without(now, sight.view, is_home));
                let since = order.map_or("waiting began".to_owned(), |order| {
                    format!("the order to {}", kind_name(order))
                });
                return format!("{away} {} s after {since}", within.as_secs_f64());
            }
            Condition::InForce
            | Condition::Driven(_)
            | Condition::Done(_)
            | Condition::MissionsEnded(_)
            | Condition::Any(_) => format!("not shown: {self}"),
        };
        format!("{missing}, within {:.1} s", within.as_secs_f64())
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Condition::Heard(_) => write!(f, "everybody is heard"),
            Condition::InForce => write!(f, "every vehicle shows the order"),
            Condition::Home(_) => write!(f, "everybody is at home"),
            Condition::Driven(run) => write!(f, "run {run} is driven to its end"),
            Condition::Done(run) => write!(f, "run {run} is done"),
            Condition::MissionsEnded(_) => write!(f, "every mission has ended"),
            Condition::Any(conditions) => {
                let words: Vec<String> = conditions.iter().map(Condition::to_string).collect();
                write!(f, "{}", words.join(", or "))
            }
        }
    }
}

impl ScriptView<'_> {
    fn report(&self, now: Time) -> Option<&GroundReport> {
        self.view.ground(now).map(|report| &report.value)
    }

    fn run(&self, now: Time, run: RunId) -> Option<&RunReport> {
        self.report(now)?
            .runs
            .iter()
            .find(|report| report.run == run)
    }
}

impl LiveVehicles {
    /// Returns whether that is so of all who are there, and somebody is.
    fn all(&self, now: Time, view: &FleetView, is_so: fn(&MissionProgress) -> bool) -> bool {
        self.there(now, view).next().is_some() && self.without(now, view, is_so).is_empty()
    }

    /// Returns of whom of those who are there that is not so.
    fn without(
        &self,
        now: Time,
        view: &FleetView,
        is_so: fn(&MissionProgress) -> bool,
    ) -> Vec<VehicleId> {
        let mission = |id: &VehicleId| view.vehicle(*id).and_then(|seen| seen.mission.as_ref());
        let is_open = |id: &VehicleId| !mission(id).is_some_and(|mission| is_so(&mission.value));
        self.there(now, view).filter(is_open).collect()
    }

    fn there(&self, now: Time, view: &FleetView) -> impl Iterator<Item = VehicleId> {
        let is_there = move |id: &&VehicleId| {
            view.state(**id)
                .is_some_and(|state| state.age(now) <= self.lost_after)
        };
        self.vehicles.iter().filter(is_there).copied()
    }
}

fn is_driven(report: &GroundReport, run: RunId) -> bool {
    let of_run = report.runs.iter().find(|report| report.run == run);
    of_run.is_some_and(|of_run| match of_run.end {
        None => report.run == run && report.phase == StationPhase::Idle && report.laps > 0,
        Some(RunEnd::Done) => true,
        Some(RunEnd::Stopped | RunEnd::Failed) => false,
    })
}

/// Returns who is away from home in words; nobody is when nobody is there.
fn not_home(away: &[VehicleId]) -> String {
    match away {
        [] => "no vehicle was heard to be home".to_owned(),
        [id] => format!("vehicle {id} was not home"),
        ids => {
            let ids: Vec<String> = ids.iter().map(VehicleId::to_string).collect();
            format!("vehicles {} were not home", ids.join(", "))
        }
    }
}

fn has_ended(mission: &MissionProgress) -> bool {
    mission.kind != MissionKind::Sweep && mission.end.is_some()
}

/// Returns whether a vehicle has come home and stays there.
pub fn is_home(mission: &MissionProgress) -> bool {
    mission.is_at_home && mission.phase == MissionPhase::Over
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_after_how_long_a_vehicle_does_not_come_back() {
        let limit = format!("heard within {} s", GONE_AFTER.as_secs());
        for text in [
            include_str!("../cli/sim.rs"),
            include_str!("../../docs/modules.md"),
        ] {
            assert!(text.contains(&limit));
        }
    }
}
