//! Whether a run may begin: checks of every vehicle and of the ground station, each by itself, from what they say of
//! themselves. Pure. What nobody reports is said to be not known, and refuses nothing but where it must be known.

mod devices;
mod disk;
mod machine;

use std::collections::BTreeSet;
use std::time::Duration;

use serde::Serialize;
use tomoswarm_proto::{
    BEACON_MEMBERS_MAX, Control, FailsafeAction, Failsafes, GroundReport, Health, Hello, Lease,
    OrderKind, PoseReport, RunEnd, StationPhase, VehicleId, VehicleMode,
};

pub use self::disk::{DISK_TROUBLE, disk_room};
use super::fleet_view::{FleetView, GROUND_LIVES, VehicleView};
use super::names::{self, listed};
use crate::geom::{Point, Polygon, Pose};
use crate::node::mission;
use crate::time::Time;

/// A vehicle whose state is older is not fresh: at rest two are said a second.
const FRESH: Duration = Duration::from_millis(1500);
/// Charge that a run begins with at least, 0 to 1.
const BATTERY: f64 = 0.5;
/// The pose deviation that is allowed where no file says it, metres.
pub const POSE_SD_MAX_M: f64 = 0.5;

/// What is looked for.
#[derive(Clone, PartialEq, Debug)]
pub struct Requirements {
    /// Who shall take part.
    pub vehicles: BTreeSet<VehicleId>,
    /// Hash of its own venue file.
    pub venue_hash: u64,
    /// Where vehicles may be.
    pub fence: Polygon,
    /// Where they begin; vehicle 1 at the first.
    pub homes: Vec<Point>,
    /// Deviation of a place that is allowed, metres; `None` = not known, then [`POSE_SD_MAX_M`].
    pub pose_sd_max_m: Option<f64>,
    /// Version of its own software.
    pub software: String,
}

/// How a check came out.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CheckStatus {
    /// As it should be.
    Go,
    /// Not reported; refuses nothing.
    Unknown,
    /// A run may not begin like this.
    NoGo,
}

/// One check.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Check {
    /// What was looked at, in a word.
    pub what: &'static str,
    /// How it came out.
    pub light: CheckStatus,
    /// What was found.
    pub found: String,
}

/// All checks of one node.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct NodeChecks {
    /// `vehicle 3`, `ground`, or `swarm` for what is one for all.
    pub node: String,
    /// Its checks, always the same ones in the same order.
    pub checks: Vec<Check>,
}

/// Looks at everyone.
pub fn inspect(view: &FleetView, needs: &Requirements, now: Time) -> Vec<NodeChecks> {
    let nothing = VehicleView::default();
    let vehicle = |id: &VehicleId| NodeChecks {
        node: format!("vehicle {id}"),
        checks: of_vehicle(*id, view.vehicle(*id).unwrap_or(&nothing), needs, now),
    };
    let mut nodes: Vec<NodeChecks> = needs.vehicles.iter().map(vehicle).collect();
    nodes.push(NodeChecks {
        node: "ground".to_owned(),
        checks: of_ground(view, needs, now),
    });
    nodes.push(NodeChecks {
        node: "swarm".to_owned(),
        checks: vec![stops(view, needs)],
    });
    nodes
}

/// Returns whether a run may begin.
pub fn is_go(nodes: &[NodeChecks]) -> bool {
    // The ground station alone is no swarm.
    nodes.iter().any(|node| node.node.starts_with("vehicle"))
        && nodes
            .iter()
            .flat_map(|node| &node.checks)
            .all(|check| check.light != CheckStatus::NoGo)
}

/// Judges the order that stands. Who was told to come home or down has done so when it is at its home, which is checked for
/// itself: the start that is to follow lifts it.
fn standing(report: &GroundReport) -> (bool, String) {
    let Some(kind) = report.in_force else {
        return (true, "nothing".to_owned());
    };
    let name = names::kind_name(kind);
    match kind {
        OrderKind::Hold | OrderKind::CutMotors => (false, name.to_owned()),
        OrderKind::Start | OrderKind::Return | OrderKind::Land => {
            (true, format!("{name}, until a start"))
        }
    }
}

fn check(what: &'static str, is_right: bool, found: String) -> Check {
    Check {
        what,
        light: if is_right {
            CheckStatus::Go
        } else {
            CheckStatus::NoGo
        },
        found,
    }
}

/// Checks what was said; what was not said is `silent`.
fn reported<T>(
    what: &'static str,
    value: Option<T>,
    silent: CheckStatus,
    look: impl Fn(T) -> (bool, String),
) -> Check {
    match value {
        None => Check {
            what,
            light: silent,
            found: "not reported".to_owned(),
        },
        Some(value) => {
            let (is_right, found) = look(value);
            check(what, is_right, found)
        }
    }
}

fn of_vehicle(id: VehicleId, seen: &VehicleView, needs: &Requirements, now: Time) -> Vec<Check> {
    let state = seen.state.as_ref().map(|state| &state.value);
    let health = seen.health.as_ref().map(|health| &health.value);
    let hello = seen.hello.as_ref().map(|hello| &hello.value);
    let age_s = seen.state.as_ref().map(|state| state.age(now));
    let on_bus = reported("bus", age_s, CheckStatus::NoGo, |age| {
        (
            age < FRESH,
            format!("newest state {:.1} s ago", age.as_secs_f64()),
        )
    });
    let no_go = CheckStatus::NoGo;
    let mut checks = vec![on_bus];
    checks.extend(of_hello(hello, needs));
    checks.push(devices::devices(hello, health));
    let placed = state.and_then(|state| state.pose);
    checks.push(reported("pose", placed, no_go, |placed| {
        pose(placed, needs)
    }));
    checks.push(reported("fence", placed, no_go, |placed| {
        let at = Point::from(placed.at);
        (
            needs.fence.contains(at),
            format!("at {:.2}, {:.2} m", at.x_m, at.y_m),
        )
    }));
    checks.push(reported("home", placed, no_go, |placed| {
        home(id, placed, &needs.homes)
    }));
    let battery = state.and_then(|state| state.battery);
    checks.push(reported("battery", battery, no_go, |battery| {
        let charge = battery.fraction();
        (
            charge > BATTERY,
            format!("{:.0} %, over {:.0} % needed", charge * 1e2, BATTERY * 1e2),
        )
    }));
    checks.push(reported("mode", state, no_go, |state| {
        (
            !matches!(
                state.mode,
                VehicleMode::Held | VehicleMode::Stopped | VehicleMode::MotorsCut
            ),
            names::mode(state.mode).to_owned(),
        )
    }));
    checks.push(reported("control", state, no_go, |state| {
        (
            state.control == Control::Ours,
            names::control(state.control).to_owned(),
        )
    }));
    checks.push(reported("radio", health, no_go, |health| {
        radio(id, health, needs)
    }));
    checks.push(disk::disk(health));
    checks.extend(machine::machine(health));
    checks.push(reported("samples", health, no_go, |health| {
        (
            health.samples_lost == 0,
            format!(
                "{} lost, {} waiting",
                health.samples_lost, health.samples_waiting
            ),
        )
    }));
    checks.push(reported("troubles", health, no_go, |health| {
        (
            health.troubles.is_empty(),
            names::troubles(&health.troubles),
        )
    }));
    checks.push(failsafes(health));
    checks
}

fn of_hello(hello: Option<&Hello>, needs: &Requirements) -> [Check; 2] {
    let software = reported("software", hello, CheckStatus::NoGo, |hello| {
        let found = match hello.software == needs.software {
            true => hello.software.clone(),
            false => format!("{}, here it is {}", hello.software, needs.software),
        };
        (hello.software == needs.software, found)
    });
    let venue = reported("venue", hello, CheckStatus::NoGo, |hello| {
        let (theirs, ours) = (hello.venue_hash, needs.venue_hash);
        let found = match theirs == ours {
            true => format!("hash {ours:016x}"),
            false => format!("another venue file: hash {theirs:016x}, here {ours:016x}"),
        };
        (theirs == ours, found)
    });
    [software, venue]
}

fn pose(placed: PoseReport, needs: &Requirements) -> (bool, String) {
    let most_m = needs.pose_sd_max_m.unwrap_or(POSE_SD_MAX_M);
    let assumed = if needs.pose_sd_max_m.is_none() {
        " (assumed: no file here says the limit)"
    } else {
        ""
    };
    let sd_m = Pose::from(placed).sd_m;
    (
        sd_m <= most_m,
        format!("± {sd_m:.2} m, at most {most_m:.2} m{assumed}"),
    )
}

fn home(id: VehicleId, placed: PoseReport, homes: &[Point]) -> (bool, String) {
    let Some(home) = usize::from(id.0)
        .checked_sub(1)
        .and_then(|index| homes.get(index))
    else {
        return (false, format!("the venue has no home of vehicle {id}"));
    };
    let pose = Pose::from(placed);
    let (away_m, most_m) = (home.distance_to(pose.at), mission::home_farthest_m(pose));
    (
        mission::is_at_home(pose, *home),
        format!("{away_m:.2} m away, at most {most_m:.2} m"),
    )
}

fn radio(id: VehicleId, health: &Health, needs: &Requirements) -> (bool, String) {
    let (hears_all, hears) = hearing(id, health, needs);
    match health.radio {
        None => (hears_all, hears),
        Some(radio) => {
            let (speaks, sends) = devices::radio(radio);
            (hears_all && speaks, format!("{hears}; {sends}"))
        }
    }
}

/// Whom a vehicle hears by radio, and whether that is everyone.
fn hearing(id: VehicleId, health: &Health, needs: &Requirements) -> (bool, String) {
    let is_missing = |other: &VehicleId| *other != id && !health.hears.contains(other);
    let missing: Vec<VehicleId> = needs.vehicles.iter().copied().filter(is_missing).collect();
    // A vehicle names no more than a beacon does: of the others it says nothing.
    if !missing.is_empty() && health.hears.len() >= BEACON_MEMBERS_MAX {
        return (
            true,
            format!("hears {} and may hear more", listed(&health.hears)),
        );
    }
    let found = match missing.is_empty() {
        true => format!("hears {}", listed(&health.hears)),
        false => format!("hears {}, not {}", listed(&health.hears), listed(&missing)),
    };
    (missing.is_empty(), found)
}

/// The autopilot's failsafes, as far as it says what it does. Those for its battery, its companion's silence and its fence
/// must be on, and keep it where it is: home in a straight line leads through walls. The others are named.
fn failsafes(health: Option<&Health>) -> Check {
    let autopilot = health.and_then(|health| health.autopilot.as_ref());
    let failsafes: Failsafes = autopilot
        .map(|autopilot| autopilot.failsafes)
        .unwrap_or_default();
    let others = [
        ("remote", failsafes.remote),
        ("estimator", failsafes.estimator),
    ];
    let said: Vec<String> = failsafes
        .needed()
        .iter()
        .chain(&others)
        .filter_map(|(cause, action)| Some(format!("{cause} {}", in_words(*action)?)))
        .collect();
    let wrong = failsafes
        .needed()
        .iter()
        .any(|(_, action)| *action != FailsafeAction::Unknown && !action.keeps_place());
    let said = (!said.is_empty()).then_some(said);
    reported("failsafes", said, CheckStatus::Unknown, |said| {
        (!wrong, said.join(", "))
    })
}

/// Returns what a failsafe does, in a word or two; `None` when it has not said so.
fn in_words(action: FailsafeAction) -> Option<&'static str> {
    match action {
        FailsafeAction::Unknown => None,
        FailsafeAction::Off => Some("off"),
        FailsafeAction::Hold => Some("holds"),
        FailsafeAction::Land => Some("lands"),
        FailsafeAction::Return => Some("returns in a straight line"),
        FailsafeAction::Other => Some("does something else"),
    }
}

/// Which emergency stops are open, who made them and who does not show them.
fn stops(view: &FleetView, needs: &Requirements) -> Check {
    let open = view.open_stops();
    let words: Vec<String> = open
        .iter()
        .map(|stop| view.stop_in_words(stop, &needs.vehicles))
        .collect();
    let found = if open.is_empty() {
        "none is open".to_owned()
    } else {
        words.join("; ")
    };
    check("emergency stops", open.is_empty(), found)
}

fn of_ground(view: &FleetView, needs: &Requirements, now: Time) -> Vec<Check> {
    let report = view.ground(now).map(|report| &report.value);
    let no_go = CheckStatus::NoGo;
    let live = view
        .grounds()
        .filter(|report| report.age(now) <= GROUND_LIVES)
        .count();
    let mut checks = vec![check(
        "bus",
        live == 1,
        format!("{live} live ground stations"),
    )];
    checks.extend(of_hello(
        view.ground_hello().map(|hello| &hello.value),
        needs,
    ));
    let lease = |report: &GroundReport| {
        let Lease { number, holder } = report.lease;
        let highest = view.lease(now);
        let found = match report.lease == highest {
            true => format!("{number} ({holder:016x})"),
            false => format!(
                "{number}, but vehicles obey {} ({:016x})",
                highest.number, highest.holder
            ),
        };
        (number > 0 && report.lease == highest, found)
    };
    checks.push(reported("lease", report, no_go, lease));
    checks.push(reported("phase", report, no_go, |report| {
        let is_free = matches!(report.phase, StationPhase::Idle | StationPhase::Waiting);
        (is_free, names::phase(report.phase).to_owned())
    }));
    checks.push(reported("standing", report, no_go, standing));
    checks.push(reported("vehicles", report, no_go, |report| {
        let unknown: Vec<VehicleId> = needs
            .vehicles
            .iter()
            .copied()
            .filter(|id| !report.members.contains(id))
            .collect();
        (
            unknown.is_empty(),
            format!(
                "plans for {}, not for {}",
                listed(&report.members),
                listed(&unknown)
            ),
        )
    }));
    checks.push(disk::of_ground(report));
    checks.push(reported("troubles", report, no_go, |report| {
        // That of its disk has a row of its own.
        let troubles: Vec<String> = (report.troubles.iter())
            .filter(|words| !disk::is_disk_trouble(words))
            .cloned()
            .collect();
        let is_over = |words: &String| is_of_last_run(report, words);
        (troubles.iter().all(is_over), names::troubles(&troubles))
    }));
    checks
}

/// Returns whether a trouble is that the last run has failed: the next one may begin all the same, and ends it.
fn is_of_last_run(report: &GroundReport, words: &str) -> bool {
    let last = report.runs.last();
    last.filter(|run| run.end == Some(RunEnd::Failed))
        .is_some_and(|run| words.starts_with(&format!("run {} ", run.run)))
}

#[cfg(test)]
mod tests;
