//! A scenario as its operator follows it: when sweeps are given and started, when the persons enter, when everybody is
//! sent home. It knows the simulation's file and nothing of how a run goes; whatever it waits for it sees on the bus.
//!
//! ```text
//!   2 s ─► task 1, start 1 ─► driven ─2 s─► persons enter ─2 s─► task 2, start 2 ─► done ─┐
//!     ├──► (no empty sweep) ──────────────────────────────────► task 2, start 2 ─► done ─┼─► stay, or return ─► home
//!     └──► (own missions) ─────────────────────────────► task 1, start 1 ─► all have ended ─┘
//! ```

use std::collections::BTreeSet;
use std::time::Duration;

use tomoswarm_proto::{Boot, Hello, Interest, OperatorId, OrderKind, RunId, Sender, VehicleId};

use crate::config::{AfterSweep, Expect, GivenSweep, Sim};
use crate::operator::given_tasks::{TaskRequest, task_kind};
use crate::operator::operator_actor::OperatorSettings;
use crate::operator::order_goal::OrderGoal;
use crate::operator::script::{Condition, LiveVehicles, ScriptStep};

/// The first sweep of a scenario, with nobody inside; without an empty sweep it is not driven.
pub const EMPTY_RUN: RunId = RunId(1);
/// The sweep whose image is wanted.
pub const RUN: RunId = RunId(2);
/// The run of a scenario whose vehicles have missions of their own.
pub const MISSION_RUN: RunId = RunId(1);
/// What the environment is asked for when the persons shall walk in.
pub const PERSONS_ENTER: &str = "persons enter";
/// The operator of a scenario.
pub const SCENARIO_OPERATOR: OperatorId = OperatorId(0);

/// Everybody is heard before anything is given.
const BEGIN_AT: Duration = Duration::from_secs(2);
/// Between two sweeps people need this long to walk in, and so has what moves to come to rest.
const ENTER_TAKES: Duration = Duration::from_secs(2);
/// After the return at the end was ordered nothing is waited for any longer than this. People read of it in
/// configs/README.md and in the help of `sim`.
const HOME_WITHIN: Duration = Duration::from_secs(900);

/// Returns who the operator of a simulation is; `holder` is its id as the holder of a lease.
pub(super) fn settings(sim: &Sim, id: OperatorId, holder: u64) -> OperatorSettings {
    OperatorSettings {
        hello: Hello {
            is_member: true,
            interest: vec![Interest::Fleet],
            ..Hello::asking(Sender::Operator(id), Boot(1), sim.venue.hash(), holder)
        },
        greets: true,
        holder,
        expected: sim.vehicle_ids().collect(),
    }
}

/// Returns what the operator of a simulation does.
pub(super) fn steps(sim: &Sim) -> Vec<ScriptStep> {
    let scenario = ScenarioScript { sim };
    let mut steps = vec![ScriptStep::Delay(BEGIN_AT)];
    match sim.is_planned_by_ground() {
        true => scenario.sweeps(&mut steps),
        false => steps.extend([
            scenario.task(MISSION_RUN, None),
            scenario.want(OrderKind::Start, Some(MISSION_RUN)),
            scenario.wait_for_missions(),
        ]),
    }
    if sim.expect == Expect::Home {
        steps.push(ScriptStep::EndIf(scenario.home()));
    }
    match sim.end {
        AfterSweep::Hold => {}
        AfterSweep::Return => steps.extend([
            scenario.want(OrderKind::Return, None),
            ScriptStep::Wait {
                until: scenario.home(),
                within: HOME_WITHIN,
            },
        ]),
    }
    steps
}

struct ScenarioScript<'a> {
    sim: &'a Sim,
}

impl ScenarioScript<'_> {
    fn sweeps(&self, steps: &mut Vec<ScriptStep>) {
        let compare_with = self.sim.empty_sweep.then_some(EMPTY_RUN);
        if self.sim.empty_sweep {
            let name = PERSONS_ENTER.to_owned();
            steps.extend([
                self.task(EMPTY_RUN, None),
                self.want(OrderKind::Start, Some(EMPTY_RUN)),
                self.wait(Condition::Driven(EMPTY_RUN)),
                ScriptStep::Delay(ENTER_TAKES),
                ScriptStep::Announce {
                    name,
                    within: ENTER_TAKES,
                },
                ScriptStep::Delay(ENTER_TAKES),
            ]);
        }
        steps.extend([
            self.task(RUN, compare_with),
            self.want(OrderKind::Start, Some(RUN)),
            self.wait(Condition::Done(RUN)),
        ]);
    }

    fn wait_for_missions(&self) -> ScriptStep {
        self.wait(Condition::MissionsEnded(self.present()))
    }

    /// Waits as long as the simulation lasts. Where something else is expected of the vehicles a sweep need not end, and
    /// they may come home by themselves.
    fn wait(&self, shown: Condition) -> ScriptStep {
        let until = match self.sim.expect {
            Expect::Finished => shown,
            Expect::Home | Expect::Held => Condition::Any(vec![shown, self.home()]),
        };
        ScriptStep::Wait {
            until,
            within: self.sim.until(),
        }
    }

    fn home(&self) -> Condition {
        Condition::Home(self.present())
    }

    fn present(&self) -> LiveVehicles {
        LiveVehicles {
            vehicles: self.sim.vehicle_ids().collect(),
            lost_after: self.sim.venue.swarm.lost_after(),
        }
    }

    fn task(&self, run: RunId, compare_with: Option<RunId>) -> ScriptStep {
        let members: Vec<VehicleId> = self.sim.vehicle_ids().collect();
        ScriptStep::Task(TaskRequest {
            run,
            members,
            compare_with,
            kind: task_kind(self.sim.task.clone(), &GivenSweep::whole(&self.sim.sweep)),
        })
    }

    fn want(&self, kind: OrderKind, run: Option<RunId>) -> ScriptStep {
        let within = self.sim.until();
        let vehicles = BTreeSet::new();
        ScriptStep::Want(OrderGoal {
            run,
            ..OrderGoal::new(kind, vehicles, within)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_how_long_a_return_is_waited_for() {
        let limit = format!(" {} s", HOME_WITHIN.as_secs());
        for (text, line) in [
            (include_str!("../../configs/README.md"), "| `end` | return"),
            (
                include_str!("../cli/sim.rs"),
                "A run is given up at until_s",
            ),
            (
                include_str!("../../docs/modules.md"),
                "The script fails when",
            ),
        ] {
            let line = text.lines().find(|found| found.contains(line));
            assert!(line.is_some_and(|line| line.contains(&limit)), "{line:?}");
        }
    }
}
