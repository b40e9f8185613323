//! The planner actor: makes the plans of a sweep. Its answer takes a configured time, never zero.
//!
//! It is told requests, it says answers. Which positions and in which order is decided by
//! [`crate::sweep`]; this actor only chooses the planner and waits.
//!
//! Deadline: `plan ready`.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Plan, Revision, RunId, StopId, SweepPlanner, TaskKind, VehicleId};

use crate::actor::{Actor, Fault, Input, InputClass};
use crate::config::SweepConfig;
use crate::geom::Point;
use crate::sweep::{
    self, FanRequest, GapRequest, Pattern, PatternKind, PatternRequest, PlannedSweep, Ring,
    SweepError,
};
use crate::time::{Deadline, Time};

/// Which planner, and its parameters.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum Method {
    /// Laps at a constant gap; how many of them.
    RotatingGap {
        /// Laps of the whole sweep; `None` = as many as suit the number of vehicles.
        laps: Option<usize>,
    },
    /// One stands, the others drive around it.
    Fan {
        /// Rounds of the whole sweep; `None` = one for every position.
        rounds: Option<usize>,
        /// Time at each stop.
        dwell: Duration,
        /// Time at each stop at most, when partners do not come.
        dwell_limit: Duration,
    },
    /// A measurement pattern of the original, over the lattice whose border the positions are.
    Pattern {
        /// Which.
        kind: PatternKind,
        /// Time at each stop.
        dwell: Duration,
        /// Time at each stop at most, when the partner does not come.
        dwell_limit: Duration,
    },
}

/// A sweep as an operator wants it.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct SweepTask {
    planner: Option<SweepPlanner>,
    positions: Option<usize>,
    laps: Option<usize>,
    dwell: Option<Duration>,
    dwell_limit: Option<Duration>,
}

impl SweepTask {
    /// Returns how a task is to be swept; `None` when nothing is swept in it.
    pub fn of(task: &TaskKind) -> Option<SweepTask> {
        let (planner, positions, laps, dwell_ms, dwell_limit_ms) = match *task {
            TaskKind::Sweep {
                planner,
                positions,
                laps,
                dwell_ms,
                dwell_limit_ms,
            } => (
                Some(planner),
                Some(positions),
                laps,
                Some(dwell_ms),
                Some(dwell_limit_ms),
            ),
            TaskKind::ConfiguredSweep {
                planner,
                positions,
                laps,
                dwell_ms,
                dwell_limit_ms,
            } => (planner, positions, laps, dwell_ms, dwell_limit_ms),
            TaskKind::Legs { .. }
            | TaskKind::Forward { .. }
            | TaskKind::Browse
            | TaskKind::Search
            | TaskKind::Pathfind { .. }
            | TaskKind::Explore
            | TaskKind::Patrol { .. }
            | TaskKind::Stored { .. } => return None,
        };
        let milliseconds = |number: u32| Duration::from_millis(number.into());
        Some(SweepTask {
            planner,
            positions: positions.map(usize::from),
            laps: laps.map(usize::from),
            dwell: dwell_ms.map(milliseconds),
            dwell_limit: dwell_limit_ms.map(milliseconds),
        })
    }

    /// Returns the positions on the border and the method, where the ground station has others of its own.
    fn over(&self, (positions, method): (usize, Method)) -> (usize, Method) {
        let usual = SweepConfig::default();
        let usual = (usual.dwell(), usual.dwell_limit());
        let (planner, laps, (dwell, dwell_limit)) = match method {
            Method::RotatingGap { laps } => (SweepPlanner::RotatingGap, laps, usual),
            Method::Fan {
                rounds,
                dwell,
                dwell_limit,
            } => (SweepPlanner::Fan, rounds, (dwell, dwell_limit)),
            Method::Pattern {
                kind,
                dwell,
                dwell_limit,
            } => {
                let planner = match kind {
                    PatternKind::Calibrate => SweepPlanner::Calibrate,
                    PatternKind::Fan => SweepPlanner::FanCorners,
                    PatternKind::FanStraight => SweepPlanner::FanStraight,
                };
                (planner, None, (dwell, dwell_limit))
            }
        };
        let laps = self.laps.or(laps);
        let dwell = self.dwell.unwrap_or(dwell);
        let dwell_limit = self.dwell_limit.unwrap_or(dwell_limit).max(dwell);
        let pattern = |kind| Method::Pattern {
            kind,
            dwell,
            dwell_limit,
        };
        let method = match self.planner.unwrap_or(planner) {
            SweepPlanner::RotatingGap => Method::RotatingGap { laps },
            SweepPlanner::Fan => Method::Fan {
                rounds: laps,
                dwell,
                dwell_limit,
            },
            SweepPlanner::Calibrate => pattern(PatternKind::Calibrate),
            SweepPlanner::FanCorners => pattern(PatternKind::Fan),
            SweepPlanner::FanStraight => pattern(PatternKind::FanStraight),
        };
        (self.positions.unwrap_or(positions), method)
    }
}

/// A sweep to be planned.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Request {
    /// Of which run.
    pub run: RunId,
    /// Of which revision.
    pub revision: Revision,
    /// Where the vehicles rest.
    pub places: Vec<(VehicleId, Point)>,
    /// Laps already done in this run.
    pub first_lap: usize,
    /// How an operator wants it to be swept; `None` = as the ground station's file says.
    pub task: Option<SweepTask>,
}

/// Why there is no plan.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct NoPlan {
    /// In words.
    pub why: String,
    /// Whether there may be one from other places.
    pub is_of_places: bool,
}

impl From<SweepError> for NoPlan {
    fn from(error: SweepError) -> NoPlan {
        NoPlan {
            why: error.to_string(),
            is_of_places: matches!(error, SweepError::Unsafe(_) | SweepError::NoApproach),
        }
    }
}

/// Plans, or why there are none.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct PlannerAnswer {
    /// Of which run.
    pub run: RunId,
    /// The revision that was asked for.
    pub revision: Revision,
    /// One plan for each vehicle, or why there is none.
    pub plans: Result<Vec<Plan>, NoPlan>,
    /// Per lap, the last stop of each vehicle.
    pub laps: Vec<Vec<(VehicleId, StopId)>>,
}

/// The planner actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PlannerActor {
    ring: Ring,
    method: Method,
    separation_m: f64,
    takes: Duration,
    ready: Option<(Time, PlannerAnswer)>,
}

impl PlannerActor {
    /// Makes a planner for a ring of positions whose answers take `takes`.
    pub fn new(ring: Ring, method: Method, separation_m: f64, takes: Duration) -> PlannerActor {
        PlannerActor {
            ring,
            method,
            separation_m,
            takes: takes.max(Duration::from_nanos(1)),
            ready: None,
        }
    }

    fn plan(&self, request: &Request) -> Result<PlannedSweep, SweepError> {
        match request.task {
            None => plan(&self.ring, self.method, self.separation_m, request),
            Some(task) => {
                let own = (self.ring.positions(), self.method);
                let (positions, method) = task.over(own);
                let ring = Ring::new(self.ring.area(), positions)?;
                plan(&ring, method, self.separation_m, request)
            }
        }
    }
}

/// Plans a sweep at once by a method, whatever the request's task says; what the actor does, and what `tomoswarm plan`
/// shows.
///
/// # Errors
/// Too few or too many vehicles, or an area in which the sweep cannot be driven.
pub fn plan(
    ring: &Ring,
    method: Method,
    separation_m: f64,
    request: &Request,
) -> Result<PlannedSweep, SweepError> {
    let Request {
        run,
        revision,
        places,
        first_lap,
        task: _,
    } = request.clone();
    let milliseconds = |span: Duration| u32::try_from(span.as_millis()).unwrap_or(u32::MAX);
    match method {
        Method::RotatingGap { laps } => {
            let default = sweep::default_laps(ring.positions(), places.len());
            // Fewer vehicles need more laps than more do; who is asked while the sweep goes on drives at least one.
            let end_lap = laps.unwrap_or(default).max(first_lap.saturating_add(1));
            let gaps = GapRequest {
                run,
                revision,
                vehicles: places,
                first_lap,
                end_lap,
                separation_m,
            };
            sweep::rotating_gap(ring, &gaps)
        }
        Method::Fan {
            rounds,
            dwell,
            dwell_limit,
        } => {
            let rounds = rounds
                .unwrap_or(ring.positions())
                .saturating_sub(first_lap)
                .max(1);
            let (dwell_ms, dwell_limit_ms) = (milliseconds(dwell), milliseconds(dwell_limit));
            let vehicles = places;
            let fan = FanRequest {
                run,
                revision,
                vehicles,
                rounds,
                dwell_ms,
                dwell_limit_ms,
                separation_m,
            };
            sweep::fan(ring, &fan)
        }
        Method::Pattern {
            kind,
            dwell,
            dwell_limit,
        } => {
            let pattern = Pattern::new(kind, ring.positions() / 4 + 1)?;
            let pattern_request = PatternRequest {
                run,
                revision,
                vehicles: places,
                area: ring.area(),
                first_round: first_lap,
                dwell_ms: milliseconds(dwell),
                dwell_limit_ms: milliseconds(dwell_limit),
                separation_m,
            };
            sweep::pattern_sweep(&pattern, &pattern_request)
        }
    }
}

fn answer(
    run: RunId,
    revision: Revision,
    planned: Result<PlannedSweep, SweepError>,
) -> PlannerAnswer {
    match planned {
        Ok(PlannedSweep { plans, schedule }) => {
            let last = |lap: &sweep::Lap| {
                lap.stops
                    .iter()
                    .map(|(vehicle, _, last)| (*vehicle, *last))
                    .collect()
            };
            PlannerAnswer {
                run,
                revision,
                plans: Ok(plans),
                laps: schedule.laps.iter().map(last).collect(),
            }
        }
        Err(error) => PlannerAnswer {
            run,
            revision,
            plans: Err(error.into()),
            laps: Vec::new(),
        },
    }
}

impl Actor for PlannerActor {
    type In = Request;
    type Out = PlannerAnswer;

    fn handle(
        &mut self,
        now: Time,
        request: Request,
        _out: &mut Vec<PlannerAnswer>,
    ) -> Result<(), Fault> {
        let is_asked_again = |(_, answer): &(Time, PlannerAnswer)| {
            (answer.run, answer.revision) == (request.run, request.revision)
        };
        if self.ready.as_ref().is_some_and(is_asked_again) {
            return Ok(());
        }
        let planned = self.plan(&request);
        self.ready = Some((
            now + self.takes,
            answer(request.run, request.revision, planned),
        ));
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let (at, _) = self.ready.as_ref()?;
        Some(Deadline {
            at: *at,
            why: "plan ready",
        })
    }

    fn wake(&mut self, _now: Time, out: &mut Vec<PlannerAnswer>) -> Result<(), Fault> {
        out.extend(self.ready.take().map(|(_, answer)| answer));
        Ok(())
    }
}

impl Input for Request {
    type Key = ();

    fn class(&self) -> InputClass<()> {
        InputClass::Latest(())
    }
}
