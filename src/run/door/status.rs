//! The fleet in one table, or as one JSON object. Pure.

use std::collections::BTreeSet;

use serde_json::{Value, json};
use tomoswarm_proto::codec::VERSION;
use tomoswarm_proto::{
    Mode, OrderKind, Ordered, PoseReport, Progress, Report, State, StationPhase, StopId, VehicleId,
};

use super::roll::{Fresh, Roll, Seen};
use super::table::{listed, table};
use crate::geom::Vector;
use crate::time::Time;

/// Who must be heard for the picture to be whole.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Expected {
    /// These vehicles; those that a ground station's report names come on top.
    pub vehicles: BTreeSet<VehicleId>,
    /// Whether a ground station is expected too.
    pub ground: bool,
}

impl Expected {
    /// Gives all vehicles that are expected or heard.
    pub fn vehicles(&self, roll: &Roll, now: Time) -> BTreeSet<VehicleId> {
        let named = roll.ground(now).into_iter().flat_map(|report| {
            report.said.members.iter().chain(&report.said.lost).copied().collect::<Vec<VehicleId>>()
        });
        let heard = roll.vehicles().map(|(id, _)| id);
        self.vehicles.iter().copied().chain(named).chain(heard).collect()
    }

    /// Tells whether the state of every vehicle, and the ground station if it is expected, was heard; of nobody at all
    /// never.
    pub fn all_heard(&self, roll: &Roll, now: Time) -> bool {
        let vehicles = self.vehicles(roll, now);
        let is_ground_heard = !self.ground || roll.ground(now).is_some();
        !vehicles.is_empty() && is_ground_heard && vehicles.iter().all(|id| roll.state(*id).is_some())
    }

    /// Names what was not heard.
    pub fn missing(&self, roll: &Roll, now: Time) -> Vec<String> {
        let silent = |id: &VehicleId| roll.state(*id).is_none();
        let vehicles = self.vehicles(roll, now);
        let mut missing: Vec<String> =
            vehicles.iter().filter(|id| silent(id)).map(|id| format!("vehicle {id}")).collect();
        if vehicles.is_empty() {
            missing.push("any vehicle".to_owned());
        }
        if self.ground && roll.ground(now).is_none() {
            missing.push("the ground station".to_owned());
        }
        missing
    }
}

const HEADING: [&str; 14] = [
    "vehicle",
    "boot",
    "mode",
    "x,y ± sd m",
    "m/s",
    "battery",
    "run/rev",
    "done",
    "leg",
    "ordered",
    "age s",
    "waiting",
    "hears",
    "troubles",
];

/// Gives the fleet as text: one line a vehicle, then the ground stations.
pub fn text(roll: &Roll, expected: &Expected, now: Time) -> String {
    let nothing = Seen::default();
    let vehicles = expected.vehicles(roll, now);
    let rows: Vec<Vec<String>> =
        vehicles.iter().map(|id| row(*id, roll.vehicle(*id).unwrap_or(&nothing), now)).collect();
    let mut text = if rows.is_empty() { "no vehicle was heard\n".to_owned() } else { table(&HEADING, &rows) };
    for report in roll.grounds() {
        text += &ground_lines(report, now);
    }
    if roll.grounds().next().is_none() {
        text += "ground  not heard\n";
    }
    for greeting in roll.foreign() {
        text += &format!(
            "refused  {} speaks wire version {}, here it is {VERSION}\n",
            greeting.node, greeting.version
        );
    }
    text
}

fn row(id: VehicleId, seen: &Seen, now: Time) -> Vec<String> {
    let Some(state) = &seen.state else {
        return vec![id.to_string(), "-".to_owned(), "not heard".to_owned()];
    };
    let said = &state.said;
    let dash = || "-".to_owned();
    let of_progress = |stop: fn(&Progress) -> Option<StopId>| {
        let stop = seen.mission.as_ref().and_then(|mission| stop(&mission.said.progress));
        stop.map_or_else(dash, |stop| stop.to_string())
    };
    let health = seen.health.as_ref().map(|health| &health.said);
    vec![
        id.to_string(),
        said.boot.0.to_string(),
        mode(said.mode).to_owned(),
        said.pose.map_or_else(dash, place),
        format!("{:.2}", Vector::from(said.velocity).length_m()),
        said.battery.map_or_else(dash, |battery| format!("{:.0} %", battery.fraction() * 100.0)),
        format!("{}/{}", said.accepted.0, said.accepted.1),
        of_progress(|progress| progress.done),
        of_progress(|progress| progress.leg),
        ordered(said.ordered),
        format!("{:.1}", state.age(now).as_secs_f64()),
        health.map_or_else(dash, |health| health.samples_waiting.to_string()),
        health.map_or_else(dash, |health| listed(&health.hears)),
        health.map_or_else(dash, |health| troubles(&health.troubles)),
    ]
}

/// Returns a place with its deviation, as far as that is known.
fn place(pose: PoseReport) -> String {
    let sd = pose.sd.metres().map_or_else(|| "?".to_owned(), |sd_m| format!("{sd_m:.2}"));
    format!("{:.2},{:.2} ± {sd}", pose.at.x_m(), pose.at.y_m())
}

fn ground_lines(report: &Fresh<Report>, now: Time) -> String {
    let Report { phase: at, run, laps_done, laps, samples, lease, .. } = &report.said;
    let held = match lease.number {
        0 => "no lease".to_owned(),
        number => format!("lease {number} ({:016x})", lease.holder),
    };
    let standing = report.said.in_force.map_or("nothing", kind_name);
    format!(
        "ground  {}: run {run}, lap {laps_done} of {laps}, {samples} samples, {held}, lost: {}, stands: {standing}, \
         troubles: {} ({:.1} s ago)\n",
        phase(*at),
        listed(&report.said.lost),
        troubles(&report.said.troubles),
        report.age(now).as_secs_f64(),
    )
}

/// Gives the fleet as one object.
pub fn json(roll: &Roll, expected: &Expected, now: Time) -> Value {
    let nothing = Seen::default();
    let vehicle = |id: &VehicleId| {
        let seen = roll.vehicle(*id).unwrap_or(&nothing);
        json!({
            "vehicle": id,
            "age_s": seen.state.as_ref().map(|state| state.age(now).as_secs_f64()),
            "state": seen.state.as_ref().map(|state: &Fresh<State>| &state.said),
            "mission": seen.mission.as_ref().map(|mission| &mission.said),
            "health": seen.health.as_ref().map(|health| &health.said),
            "hello": seen.hello.as_ref().map(|hello| &hello.said),
        })
    };
    let vehicles = expected.vehicles(roll, now);
    let ground =
        |report: &Fresh<Report>| json!({"age_s": report.age(now).as_secs_f64(), "report": report.said});
    let foreign: Vec<Value> = roll
        .foreign()
        .map(|greeting| json!({"node": greeting.node.prefix(), "wire_version": greeting.version}))
        .collect();
    json!({
        "all_heard": expected.all_heard(roll, now),
        "missing": expected.missing(roll, now),
        "vehicles": vehicles.iter().map(vehicle).collect::<Vec<Value>>(),
        "grounds": roll.grounds().map(ground).collect::<Vec<Value>>(),
        "refused": foreign,
    })
}

/// Gives what a vehicle was ordered last, and by whose right.
pub fn ordered(ordered: Ordered) -> String {
    let Ordered { lease, revision, kind, .. } = ordered;
    kind.map_or("-".to_owned(), |kind| format!("{} {}.{revision}", kind_name(kind), lease.number))
}

/// Gives the name of an order as it is typed.
pub fn kind_name(kind: OrderKind) -> &'static str {
    match kind {
        OrderKind::Start => "start",
        OrderKind::Hold => "hold",
        OrderKind::Return => "return",
        OrderKind::Land => "land",
        OrderKind::Emergency => "emergency",
        OrderKind::CutMotors => "cut-motors",
    }
}

/// Gives a mode in a word.
pub fn mode(mode: Mode) -> &'static str {
    match mode {
        Mode::Idle => "idle",
        Mode::Driving => "driving",
        Mode::Turning => "turning",
        Mode::Halted => "halted",
        Mode::Held => "held",
        Mode::TakingOff => "taking off",
        Mode::Climbing => "climbing",
        Mode::Landing => "landing",
        Mode::Stopped => "STOPPED",
        Mode::Emergency => "EMERGENCY",
    }
}

/// Gives what a ground station does in a word.
pub fn phase(phase: StationPhase) -> &'static str {
    match phase {
        StationPhase::Idle => "idle",
        StationPhase::Waiting => "waiting",
        StationPhase::Stopping => "stopping",
        StationPhase::Planning => "planning",
        StationPhase::Running => "running",
        StationPhase::Closing => "closing",
    }
}

/// Gives troubles in one cell.
pub fn troubles(troubles: &[String]) -> String {
    if troubles.is_empty() { "none".to_owned() } else { troubles.join("; ") }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{Rover, at, heard, report, state};
    use super::*;
    use tomoswarm_proto::{Health, Lease, Message, Mission, Revision, RunId};

    fn roll(messages: Vec<Message>) -> Roll {
        let mut roll = Roll::default();
        messages.into_iter().for_each(|message| roll.hear(at(1.0), &heard(message)));
        roll
    }

    fn expected(vehicles: &[u8]) -> Expected {
        Expected { vehicles: vehicles.iter().map(|id| VehicleId(*id)).collect(), ground: true }
    }

    #[test]
    fn a_vehicle_is_one_line_with_all_that_it_said() {
        let mut driving = Rover::ordered(1, Lease { number: 4, holder: 9 }, 7, OrderKind::Start).state;
        (driving.mode, driving.accepted) = (Mode::Driving, (RunId(6), Revision(2)));
        let progress = Progress { done: Some(StopId(12)), leg: Some(StopId(13)), ..Progress::default() };
        let (vehicle, boot) = (VehicleId(1), driving.boot);
        let mission = Mission { vehicle, boot, progress, ..Mission::default() };
        let health = Health {
            vehicle: VehicleId(1),
            boot: driving.boot,
            hears: vec![VehicleId(2), VehicleId(3)],
            samples_waiting: 55,
            troubles: vec!["disk: full".to_owned()],
            ..Health::default()
        };
        let roll = roll(vec![Message::State(driving), Message::Mission(mission), Message::Health(health)]);
        let text = text(&roll, &expected(&[]), at(1.3));
        let line = text.lines().nth(1).unwrap();
        let words: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(
            words,
            "1 1 driving 1.00,1.00 ± 0.05 0.00 90 % 6/2 12 13 start 4.7 0.3 55 2,3 disk: full"
                .split_whitespace()
                .collect::<Vec<&str>>()
        );
    }

    #[test]
    fn the_ground_says_what_it_does_and_by_which_right() {
        let said = Report {
            phase: StationPhase::Running,
            run: RunId(6),
            laps_done: 2,
            laps: 5,
            samples: 900,
            lost: vec![VehicleId(3)],
            in_force: Some(OrderKind::Hold),
            ..report()
        };
        let text = text(&roll(vec![Message::Report(said)]), &expected(&[]), at(1.0));
        let line = "ground  running: run 6, lap 2 of 5, 900 samples, lease 4 (000000000000002c), lost: 3, stands: hold, \
                    troubles: none (0.0 s ago)";
        assert!(text.lines().any(|found| found == line), "{text}");
    }

    #[test]
    fn all_are_heard_when_the_ground_and_everyone_it_names_are() {
        let (one, two) = (Message::State(state(1)), Message::State(state(2)));
        let ground = Message::Report(report());
        let check = |messages: Vec<Message>, vehicles: &[u8], is_whole: bool, missing: &[&str]| {
            let (roll, expected) = (roll(messages), expected(vehicles));
            assert_eq!(expected.all_heard(&roll, at(1.0)), is_whole);
            assert_eq!(expected.missing(&roll, at(1.0)), missing);
        };
        check(vec![one.clone(), two.clone(), ground.clone()], &[], true, &[]);
        check(vec![one.clone(), ground.clone()], &[], false, &["vehicle 2"]);
        check(vec![one.clone(), two.clone()], &[], false, &["the ground station"]);
        check(vec![one, two, ground], &[3], false, &["vehicle 3"]);
        check(vec![], &[], false, &["any vehicle", "the ground station"]);
    }

    #[test]
    fn as_json_every_field_of_the_messages_is_there() {
        let value = json(&roll(vec![Message::State(state(1))]), &expected(&[2]), at(1.5));
        assert_eq!(value["all_heard"], false);
        assert_eq!(value["vehicles"][0]["state"]["pose"]["sd"], 50);
        assert_eq!(value["vehicles"][0]["age_s"], 0.5);
        assert_eq!(value["vehicles"][1]["state"], Value::Null);
    }
}
