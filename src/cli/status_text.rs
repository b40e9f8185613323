//! The fleet for a terminal: one table, or one JSON object. Pure; who is missing is judged by [`Expected`].

use serde_json::{Value, json};
use tomoswarm_proto::codec::VERSION;
use tomoswarm_proto::{
    Control, GroundReport, MissionKind, MissionProgress, OperatorId, PoseReport, Progress,
    RunReport, State, StopId, VehicleId,
};

use super::table::table;
use crate::geom::Vector;
use crate::operator::fleet_view::{FleetView, Timestamped, VehicleView};
use crate::operator::names::{
    self, control, kind_name, listed, mission_phase, mode, ordered, phase, run_end, troubles,
};
use crate::operator::status::Expected;
use crate::time::Time;

const HEADING: [&str; 15] = [
    "vehicle",
    "boot",
    "mode",
    "x,y ± sd m",
    "m/s",
    "battery",
    "run/rev",
    "mission",
    "done",
    "leg",
    "ordered",
    "age s",
    "waiting",
    "hears",
    "troubles",
];

/// Returns the fleet as text: one line a vehicle, then the ground stations; `columns` is how wide the terminal is, if there
/// is one.
pub fn text(view: &FleetView, expected: &Expected, now: Time, columns: Option<usize>) -> String {
    let nothing = VehicleView::default();
    let vehicles = expected.vehicles(view, now);
    let rows: Vec<Vec<String>> = vehicles
        .iter()
        .map(|id| row(*id, view.vehicle(*id).unwrap_or(&nothing), now))
        .collect();
    let mut text = if rows.is_empty() {
        "no vehicle was heard\n".to_owned()
    } else {
        table(&HEADING, &rows, columns)
    };
    for id in &vehicles {
        let health = view.vehicle(*id).and_then(|seen| seen.health.as_ref());
        if let (None, Some(health)) = (view.state(*id), health) {
            let troubles = match health.value.troubles.is_empty() {
                true => "nothing is wrong but that".to_owned(),
                false => health.value.troubles.join("; "),
            };
            text += &format!(
                "software vehicle {id} runs, but its autopilot says nothing: {troubles}\n"
            );
        }
        let state = view.state(*id).map(|state| &state.value);
        if let Some(state) = state.filter(|state| state.control != Control::Ours) {
            text += &format!("control  vehicle {id}: {}\n", control(state.control));
        }
    }
    for stop in view.open_stops() {
        text += &format!("EMERGENCY STOP  {}\n", view.stop_in_words(&stop, &vehicles));
    }
    for report in view.grounds() {
        text += &ground_lines(report, now);
    }
    if view.grounds().next().is_none() {
        text += "ground  not heard\n";
    }
    for greeting in view.foreign() {
        text += &format!(
            "refused  {} speaks wire version {}, here it is {VERSION}\n",
            greeting.node, greeting.version
        );
    }
    for operator in view.shared_operators(now) {
        text += &format!("operator  two that are on the bus have the number {operator}\n");
    }
    text
}

fn row(id: VehicleId, seen: &VehicleView, now: Time) -> Vec<String> {
    let Some(state) = &seen.state else {
        return vec![id.to_string(), "-".to_owned(), "not heard".to_owned()];
    };
    let said = &state.value;
    let dash = || "-".to_owned();
    let of_progress = |stop: fn(&Progress) -> Option<StopId>| {
        let stop = seen
            .mission
            .as_ref()
            .and_then(|mission| stop(&mission.value.progress));
        stop.map_or_else(dash, |stop| stop.to_string())
    };
    let health = seen.health.as_ref().map(|health| &health.value);
    vec![
        id.to_string(),
        said.boot.0.to_string(),
        mode(said.mode).to_owned(),
        said.pose.map_or_else(dash, place),
        format!("{:.2}", Vector::from(said.velocity).length_m()),
        said.battery.map_or_else(dash, |battery| {
            format!("{:.0} %", battery.fraction() * 100.0)
        }),
        run(said, seen),
        seen.mission
            .as_ref()
            .map_or_else(dash, |said| how_far(&said.value)),
        of_progress(|progress| progress.done),
        of_progress(|progress| progress.leg),
        ordered(said.ordered),
        format!("{:.1}", state.age(now).as_secs_f64()),
        health.map_or_else(dash, |health| health.samples_waiting.to_string()),
        health.map_or_else(dash, |health| listed(&health.hears)),
        health.map_or_else(dash, |health| troubles(&health.troubles)),
    ]
}

/// Returns the run and the revision that a vehicle follows; a mission of its own has none.
fn run(state: &State, seen: &VehicleView) -> String {
    let own = seen
        .mission
        .as_ref()
        .map(|said| &said.value)
        .filter(|said| said.kind != MissionKind::Sweep);
    match own {
        Some(said) => format!("{}/-", said.progress.run),
        None => format!("{}/{}", state.accepted.0, state.accepted.1),
    }
}

/// Returns what a vehicle is out for, and how far it is or how it has ended.
fn how_far(said: &MissionProgress) -> String {
    let mut text = format!("{} {}", said.kind.word(), mission_phase(said.phase));
    if let Some(end) = said.end {
        return text + &format!(", {end}");
    }
    if let Some(share) = said.share {
        text += &format!(" {:.0} %", share.fraction() * 100.0);
    }
    if said.places_left > 0 {
        text += &format!(", {} left", said.places_left);
    }
    text
}

/// Returns a place with its deviation, as far as that is known.
fn place(pose: PoseReport) -> String {
    let sd = pose
        .sd
        .metres()
        .map_or_else(|| "?".to_owned(), |sd_m| format!("{sd_m:.2}"));
    format!("{:.2},{:.2} ± {sd}", pose.at.x_m(), pose.at.y_m())
}

fn ground_lines(report: &Timestamped<GroundReport>, now: Time) -> String {
    let GroundReport {
        phase: at,
        run,
        laps_done,
        laps,
        samples,
        lease,
        ..
    } = &report.value;
    let held = match lease.number {
        0 => "no lease".to_owned(),
        number => format!("lease {number} ({:016x})", lease.holder),
    };
    let standing = report.value.in_force.map_or("nothing", kind_name);
    format!(
        "ground  {}: run {run}, {}, {samples} samples, {held}, lost: {}, stands: {standing}, \
         troubles: {} ({:.1} s ago)\n",
        phase(*at),
        names::laps(*laps_done, *laps),
        listed(&report.value.lost),
        troubles(&report.value.troubles),
        report.age(now).as_secs_f64(),
    ) + &runs(&report.value.runs)
}

/// Returns in one line how the last runs ended; nothing of none.
fn runs(reports: &[RunReport]) -> String {
    let run = |report: &RunReport| {
        let RunReport {
            run,
            kind,
            compared_with,
            end,
            samples,
            images,
        } = report;
        let (kind_word, end) = (kind.word(), run_end(*end));
        if *kind != MissionKind::Sweep {
            return format!("{run} {kind_word} {end}");
        }
        let compared = compared_with.map_or(String::new(), |other| format!(" against {other}"));
        format!("{run} {kind_word}{compared} {end}, {samples} samples, {images} images")
    };
    let all: Vec<String> = reports.iter().map(run).collect();
    if all.is_empty() {
        String::new()
    } else {
        format!("runs  {}\n", all.join("; "))
    }
}

/// Returns the fleet as one object.
pub fn json(view: &FleetView, expected: &Expected, now: Time) -> Value {
    let nothing = VehicleView::default();
    let vehicle = |id: &VehicleId| {
        let seen = view.vehicle(*id).unwrap_or(&nothing);
        json!({
            "vehicle": id,
            "age_s": seen.state.as_ref().map(|state| state.age(now).as_secs_f64()),
            "state": seen.state.as_ref().map(|state: &Timestamped<State>| &state.value),
            "mission": seen.mission.as_ref().map(|mission| &mission.value),
            "health": seen.health.as_ref().map(|health| &health.value),
            "hello": seen.hello.as_ref().map(|hello| &hello.value),
        })
    };
    let vehicles = expected.vehicles(view, now);
    let ground = |report: &Timestamped<GroundReport>| json!({"age_s": report.age(now).as_secs_f64(), "report": report.value});
    let foreign: Vec<Value> = view
        .foreign()
        .map(|greeting| json!({"node": greeting.node.prefix(), "wire_version": greeting.version}))
        .collect();
    json!({
        "all_heard": expected.all_heard(view, now),
        "missing": expected.missing(view, now),
        "vehicles": vehicles.iter().map(vehicle).collect::<Vec<Value>>(),
        "grounds": view.grounds().map(ground).collect::<Vec<Value>>(),
        "emergency_stops": view.open_stops(),
        "refused": foreign,
        "shared_operators": view.shared_operators(now).collect::<Vec<OperatorId>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::tests_support::{Rover, at, heard, report, state};
    use tomoswarm_proto::{
        Boot, Health, Lease, Message, MissionEnd, MissionPhase, MissionRefusal, OrderKind,
        Permille, Revision, RunEnd, RunId, StationPhase, VehicleMode,
    };

    fn view(messages: Vec<Message>) -> FleetView {
        let mut view = FleetView::default();
        messages
            .into_iter()
            .for_each(|message| view.hear(at(1.0), &heard(message)));
        view
    }

    fn expected(vehicles: &[u8]) -> Expected {
        Expected {
            vehicles: vehicles.iter().map(|id| VehicleId(*id)).collect(),
            ground: true,
        }
    }

    #[test]
    fn a_vehicle_is_one_line_with_all_that_it_said() {
        let mut driving = Rover::ordered(
            1,
            Lease {
                number: 4,
                holder: 9,
            },
            7,
            OrderKind::Start,
        )
        .state;
        (driving.mode, driving.accepted) = (VehicleMode::Driving, (RunId(6), Revision(2)));
        let progress = Progress {
            done: Some(StopId(12)),
            leg: Some(StopId(13)),
            ..Progress::default()
        };
        let (vehicle, boot) = (VehicleId(1), driving.boot);
        let (phase, share) = (MissionPhase::Going, Some(Permille(450)));
        let mission = MissionProgress {
            vehicle,
            boot,
            progress,
            phase,
            share,
            places_left: 7,
            ..MissionProgress::default()
        };
        let health = Health {
            vehicle: VehicleId(1),
            boot: driving.boot,
            hears: vec![VehicleId(2), VehicleId(3)],
            samples_waiting: 55,
            troubles: vec!["disk: full".to_owned()],
            ..Health::default()
        };
        let view = view(vec![
            Message::State(driving),
            Message::Mission(mission),
            Message::Health(health),
        ]);
        let text = text(&view, &expected(&[]), at(1.3), None);
        let line = text.lines().nth(1).unwrap();
        let words: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(
            words,
            "1 1 driving 1.00,1.00 ± 0.05 0.00 90 % 6/2 sweep going 45 %, 7 left 12 13 start 4.7 0.3 55 2,3 disk: full"
                .split_whitespace()
                .collect::<Vec<&str>>()
        );
    }

    #[test]
    fn who_else_steers_a_vehicle_has_a_line() {
        let remote = State {
            control: Control::Remote,
            ..state(1)
        };
        let text = text(
            &view(vec![Message::State(remote), Message::State(state(2))]),
            &expected(&[]),
            at(1.0),
            None,
        );
        let lines: Vec<&str> = text
            .lines()
            .filter(|line| line.starts_with("control"))
            .collect();
        assert_eq!(lines, ["control  vehicle 1: somebody by remote control"]);
    }

    #[test]
    fn a_mission_of_its_own_is_said_with_its_run_and_how_it_ended() {
        let check = |mission: MissionProgress, wanted: &str| {
            let progress = Progress {
                run: RunId(5),
                ..Progress::default()
            };
            let mission = MissionProgress {
                vehicle: VehicleId(1),
                boot: Boot(1),
                progress,
                ..mission
            };
            let text = text(
                &view(vec![Message::State(state(1)), Message::Mission(mission)]),
                &expected(&[]),
                at(1.3),
                None,
            );
            let words: Vec<&str> = text.lines().nth(1).unwrap().split_whitespace().collect();
            let words = words.join(" ");
            assert!(words.contains(&format!("5/- {wanted} - - -")), "{words}");
        };
        let (kind, over) = (MissionKind::Pathfind, MissionPhase::Over);
        let said = MissionProgress {
            kind,
            ..MissionProgress::default()
        };
        check(
            MissionProgress {
                phase: MissionPhase::Looking,
                places_left: 3,
                ..said
            },
            "pathfind looking, 3 left",
        );
        let ended = |end| MissionProgress {
            phase: over,
            end: Some(end),
            ..said
        };
        check(ended(MissionEnd::Done), "pathfind over, done");
        check(ended(MissionEnd::NoWay(2)), "pathfind over, no way to 2");
        check(ended(MissionEnd::GaveUp(1)), "pathfind over, gave up 1");
        let outside = MissionEnd::Refused(MissionRefusal::OutsideFence);
        check(
            ended(outside),
            "pathfind over, refused: a place lies outside the fence",
        );
    }

    #[test]
    fn the_last_runs_are_one_line() {
        let swept = RunReport {
            run: RunId(3),
            compared_with: Some(RunId(1)),
            end: Some(RunEnd::Done),
            samples: 900,
            images: 2,
            ..RunReport::default()
        };
        let explored = RunReport {
            run: RunId(4),
            kind: MissionKind::Explore,
            ..RunReport::default()
        };
        let said = GroundReport {
            runs: vec![swept, explored],
            ..report()
        };
        let text = text(
            &view(vec![Message::Report(said)]),
            &expected(&[]),
            at(1.0),
            None,
        );
        let line = "runs  3 sweep against 1 done, 900 samples, 2 images; 4 explore open";
        assert!(text.lines().any(|found| found == line), "{text}");
    }

    #[test]
    fn the_ground_says_what_it_does_and_by_which_right() {
        let said = GroundReport {
            phase: StationPhase::Running,
            run: RunId(6),
            laps_done: 2,
            laps: 5,
            samples: 900,
            lost: vec![VehicleId(3)],
            in_force: Some(OrderKind::Hold),
            ..report()
        };
        let text = text(
            &view(vec![Message::Report(said)]),
            &expected(&[]),
            at(1.0),
            None,
        );
        let line = "ground  running: run 6, lap 2 of 5, 900 samples, lease 4 (000000000000002c), lost: 3, stands: hold, \
                    troubles: none (0.0 s ago)";
        assert!(text.lines().any(|found| found == line), "{text}");
    }

    #[test]
    fn as_json_every_field_of_the_messages_is_there() {
        let value = json(
            &view(vec![Message::State(state(1))]),
            &expected(&[2]),
            at(1.5),
        );
        assert_eq!(value["all_heard"], false);
        assert_eq!(value["vehicles"][0]["state"]["pose"]["sd"], 50);
        assert_eq!(value["vehicles"][0]["age_s"], 0.5);
        assert_eq!(value["vehicles"][1]["state"], Value::Null);
    }
}
