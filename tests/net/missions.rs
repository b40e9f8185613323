//! Missions that an operator gives on the command line to a swarm of separate processes.

use std::time::Duration;

use tomoswarm_proto::{
    MissionEnd, MissionKind, MissionPhase, MissionProgress, RunEnd, RunId, VehicleId,
};

use crate::swarm::{Size, Swarm, Watch, vehicle};

/// Two vehicles and a ground station that hear each other.
fn two() -> Swarm {
    let swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    swarm.until("all are there", 20, |watch| {
        let all = (1..=2).all(|id| watch.view.state(VehicleId(id)).is_some());
        all && watch.view.grounds().next().is_some()
    });
    swarm
}

fn shown(watch: &Watch, id: u8) -> Option<MissionProgress> {
    watch
        .view
        .vehicle(VehicleId(id))?
        .mission
        .as_ref()
        .map(|said| said.value)
}

fn is_out(watch: &Watch, id: u8, run: u32, kind: MissionKind) -> bool {
    shown(watch, id).is_some_and(|said| (said.progress.run, said.kind) == (RunId(run), kind))
}

fn has_ended(watch: &Watch, run: u32, end: RunEnd) -> bool {
    watch
        .report()
        .runs
        .iter()
        .any(|known| known.run == RunId(run) && known.end == Some(end))
}

#[test]
fn a_mission_is_begun_held_gone_on_with_and_ended_and_status_says_so() {
    let swarm = two();
    swarm.order(&[
        "start",
        "--mission",
        "pathfind",
        "--set",
        "waypoints_m=[[1, 1], [5, 5]]",
    ]);
    swarm.until("both are out for it", 5, |watch| {
        (1..=2).all(|id| is_out(watch, id, 1, MissionKind::Pathfind))
    });
    swarm.order(&["hold"]);
    swarm.until("both are held", 5, |watch| {
        (1..=2).all(|id| shown(watch, id).is_some_and(|said| said.phase == MissionPhase::Held))
    });
    assert!(
        swarm
            .tool(&["status", "operator.toml"])
            .contains("pathfind held, 1 left")
    );
    swarm.order(&["start"]);
    swarm.until("the run is done", 120, |watch| {
        has_ended(watch, 1, RunEnd::Done)
    });
    swarm.look(|watch| {
        assert!(
            (1..=2).all(|id| is_out(watch, id, 1, MissionKind::Pathfind)),
            "it was the same run"
        );
        assert!(
            (1..=2)
                .all(|id| shown(watch, id).is_some_and(|said| said.end == Some(MissionEnd::Done)))
        );
    });
    let status = swarm.tool(&["status", "operator.toml"]);
    assert!(
        status.contains("1/-") && status.contains(", done"),
        "{status}"
    );
    assert!(
        status.lines().any(|line| line == "runs  1 pathfind done"),
        "{status}"
    );
}

#[test]
fn a_mission_for_one_leaves_the_others_alone_and_who_is_started_anew_is_given_another() {
    let mut swarm = two();
    swarm.order(&["start", "2", "--mission", "explore"]);
    swarm.until("vehicle 2 explores", 5, |watch| {
        is_out(watch, 2, 1, MissionKind::Explore)
    });
    assert!(swarm.look(|watch| is_out(watch, 1, 0, MissionKind::Sweep)));
    std::thread::sleep(Duration::from_secs(3));
    swarm.kill("vehicle-2");
    swarm.restart(vehicle(2));
    swarm.until("it is back, and out for nothing", 20, |watch| {
        is_out(watch, 2, 0, MissionKind::Sweep)
    });
    std::thread::sleep(Duration::from_secs(3));
    swarm.order(&["start", "2", "--mission", "browse"]);
    swarm.until("it browses", 5, |watch| {
        is_out(watch, 2, 2, MissionKind::Browse)
    });
    swarm.until("the run is done", 60, |watch| {
        has_ended(watch, 2, RunEnd::Done)
    });
    assert!(swarm.look(|watch| has_ended(watch, 1, RunEnd::Stopped)));
}

#[test]
fn a_mission_that_makes_no_sense_is_refused_with_the_option_before_anything_is_said() {
    let swarm = two();
    for (words, expected) in [
        (
            &["hold", "--mission", "explore"][..],
            "--mission belongs to start only",
        ),
        (
            &["start", "--mission", "dance"],
            "[possible values: sweep, calibrate, fan, fan-straight, square, waypoints",
        ),
        (
            &["start", "--mission", "forward", "--set", "distance_m=9999"],
            "--set: distance_m = 9999: is out of range",
        ),
        (
            &["start", "--mission", "waypoints", "--set", "file=none.plan"],
            "--set: file = \"none.plan\": none.plan cannot be read",
        ),
        (&["start", "--set", "size_m=4"], "--mission <KIND>"),
        (
            &["start", "--mission", "explore", "--run", "4"],
            "cannot be used with",
        ),
    ] {
        let said = swarm.refused(words);
        assert!(said.contains(expected), "{said}");
    }
    assert!(swarm.look(|watch| watch.report().runs.is_empty()));
}
