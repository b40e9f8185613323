//! Tasks, leases that are held, and scripts that wait for runs and missions.

use tomoswarm_proto::{
    MissionEnd, MissionKind, MissionPhase, MissionProgress, MissionRefusal, Progress, RunEnd,
    RunReport, TaskKind,
};

use super::super::super::given_tasks::{TaskRequest, task_kind};
use super::super::super::order_goal::MissionRequest;
use super::super::super::outcome::OrderRefusal;
use super::super::super::script::{GONE_AFTER, LiveVehicles};
use super::*;
use crate::config::GivenSweep;

const RUN: RunId = RunId(3);

fn task() -> ScriptStep {
    let (members, kind) = (vec![VehicleId(1)], TaskKind::Browse);
    ScriptStep::Task(TaskRequest {
        run: RUN,
        members,
        compare_with: Some(RunId(2)),
        kind,
    })
}

fn wait(until: Condition) -> ScriptStep {
    ScriptStep::Wait {
        until,
        within: Duration::from_secs(60),
    }
}

/// A report of a run that has so ended; the ground station is idle.
fn run_ended(end: Option<RunEnd>, troubles: &[&str]) -> GroundReport {
    let of_run = RunReport {
        run: RUN,
        kind: MissionKind::Browse,
        compared_with: Some(RunId(2)),
        end,
        ..RunReport::default()
    };
    let troubles = troubles.iter().map(|words| (*words).to_owned()).collect();
    GroundReport {
        run: RUN,
        laps: 4,
        laps_done: 4,
        runs: vec![of_run],
        troubles,
        ..of_one()
    }
}

fn script_end(world: &World) -> Option<&ScriptEnd> {
    world.output.iter().find_map(|out| {
        if let Out::ScriptEnded(end) = out {
            Some(end)
        } else {
            None
        }
    })
}

#[test]
fn a_task_is_said_before_the_start_that_follows_it_and_again_until_it_is_shown() {
    let mut world = World::new(vec![Rover::new(1)]);
    world.report = Some(of_one());
    world.run(2.0);
    follow(
        &mut world,
        &[
            task(),
            ScriptStep::Want(OrderGoal {
                run: Some(RUN),
                ..want(Kind::Start)
            }),
        ],
    );
    world.run(4.0);
    assert_eq!(
        (world.tasks.len(), world.tasks[0].1.lease),
        (1, of_one().lease)
    );
    assert!(world.tasks[0].0 <= world.orders[0].0);
    world.run(2.0);
    assert_eq!(world.tasks.len(), 2, "no report has shown it for 5 s");
    world.report = Some(run_ended(None, &[]));
    world.run(5.0);
    assert_eq!(world.tasks.len(), 3, "the vehicle has not shown it");
    out_for(&mut world, 1, RUN, None);
    world.run(20.0);
    assert_eq!(world.tasks.len(), 3);
}

/// A vehicle says that it is out to browse in a run.
fn out_for(world: &mut World, vehicle: u8, run: RunId, end: Option<MissionEnd>) {
    let progress = Progress {
        run,
        ..Progress::default()
    };
    let (vehicle, kind, boot) = (VehicleId(vehicle), MissionKind::Browse, Boot(1));
    let mission = MissionProgress {
        vehicle,
        boot,
        progress,
        kind,
        end,
        ..MissionProgress::default()
    };
    world.tell(In::Bus(heard(Message::Mission(mission))));
}

/// A start that begins to browse.
fn browse() -> OrderGoal {
    let mission = MissionRequest {
        kind: TaskKind::Browse,
        compare_with: None,
    };
    OrderGoal {
        mission: Some(mission),
        ..want(Kind::Start)
    }
}

#[test]
fn a_start_that_begins_a_mission_gives_its_task_first_in_a_run_above_all_that_are_known() {
    for given in [None, Some(RunId(7))] {
        let mut world = World::new(vec![
            Rover::new(1),
            Rover::ordered(2, of_one().lease, 3, Kind::Hold),
        ]);
        let runs = given.map(|run| RunReport {
            run,
            kind: MissionKind::Search,
            ..RunReport::default()
        });
        world.report = Some(GroundReport {
            runs: runs.into_iter().collect(),
            ..of_one()
        });
        world.tell(In::Want(1, browse()));
        world.run(3.0);
        let run = RunId(given.map_or(2, |run| run.0 + 1));
        let (at, task) = &world.tasks[0];
        assert_eq!(
            (task.run, &task.members[..]),
            (run, &[1, 2].map(VehicleId)[..])
        );
        assert_eq!(
            (task.lease, &task.kind, task.compare_with),
            (of_one().lease, &TaskKind::Browse, None)
        );
        assert!(
            world
                .orders
                .iter()
                .all(|(sent, order)| sent >= at && order.run == run)
        );
        assert!(
            world.ended().is_empty(),
            "nobody shows that it is out for it"
        );
        out_for(&mut world, 1, run, None);
        out_for(
            &mut world,
            2,
            run,
            Some(MissionEnd::Refused(MissionRefusal::OutsideFence)),
        );
        world.run(0.2);
        let outcome = &world.ended()[0].1;
        assert!(outcome.vehicles[&VehicleId(1)].is_done() && !outcome.is_done());
        let why = "vehicle 2 refuses the mission: a place lies outside the fence";
        assert_eq!((outcome.undone().as_str(), outcome.run), (why, Some(run)));
    }
}

#[test]
fn who_obeys_the_start_of_a_mission_and_does_not_show_it_is_named_in_the_end() {
    let mut world = World::new(vec![Rover::new(1)]);
    world.report = Some(of_one());
    world.tell(In::Want(1, browse()));
    out_for(&mut world, 1, RunId(0), None);
    world.run(6.0);
    assert_eq!(
        world.ended()[0].1.undone(),
        "vehicle 1 has started, but does not show the mission"
    );
}

#[test]
fn a_mission_is_not_begun_while_the_ground_station_drives_a_sweep_and_no_task_is_given() {
    let mut world = World::new(vec![Rover::new(1)]);
    world.report = Some(GroundReport {
        phase: StationPhase::Running,
        run: RunId(4),
        ..of_one()
    });
    world.tell(In::Want(1, browse()));
    world.run(3.0);
    let refused = OrderRefusal::UnderWay {
        under_way: RunId(4),
        asked: RunId(5),
    };
    assert_eq!(world.ended()[0].1.refused, Some(refused));
    assert!(world.tasks.is_empty() && world.orders.is_empty());
}

#[test]
fn a_start_goes_on_with_a_mission_that_is_open_and_begins_a_run_after_one_that_has_ended() {
    for (end, run) in [(None, RunId(1)), (Some(RunEnd::Done), RunId(2))] {
        let mut world = World::new(vec![Rover::ordered(1, of_one().lease, 3, Kind::Hold)]);
        let of_run = RunReport {
            run: RunId(1),
            kind: MissionKind::Browse,
            end,
            ..RunReport::default()
        };
        world.report = Some(GroundReport {
            run: RunId(1),
            runs: vec![of_run],
            ..of_one()
        });
        world.tell(In::Want(1, want(Kind::Start)));
        world.run(3.0);
        assert_eq!(world.orders[0].1.run, run);
    }
}

#[test]
fn a_run_that_has_ended_is_not_started_again() {
    let of_run = |run, end| RunReport {
        run: RunId(run),
        end,
        ..RunReport::default()
    };
    let start = |run| OrderGoal {
        run: Some(RunId(run)),
        ..want(Kind::Start)
    };
    // The first is older than those that are told of.
    for (asked, is_refused) in [(1, true), (2, true), (3, false), (4, false)] {
        let mut world = World::new(vec![Rover::new(1)]);
        world.report = Some(GroundReport {
            run: RunId(3),
            runs: vec![of_run(2, Some(RunEnd::Done)), of_run(3, None)],
            ..of_one()
        });
        world.tell(In::Want(1, start(asked)));
        world.run(3.0);
        let refused = is_refused.then_some(OrderRefusal::Ended(RunId(asked)));
        assert_eq!(world.ended()[0].1.refused, refused);
        assert_eq!(world.orders.is_empty(), is_refused, "run {asked}");
    }
}

#[test]
fn who_holds_a_lease_names_it_at_once_and_every_second_until_it_is_displaced() {
    let mut world = World::new(vec![Rover::new(1)]);
    world.report = Some(of_one());
    world.run(3.0);
    assert!(world.hellos.iter().all(|(_, lease)| lease.is_none()));
    world.tell(In::Want(
        1,
        OrderGoal {
            take_over: true,
            ..want(Kind::Hold)
        },
    ));
    world.tick();
    let own = Lease {
        number: 5,
        holder: OWN,
    };
    assert_eq!(
        world.hellos.last(),
        Some(&(world.orders[0].0, Some(own))),
        "before its first order"
    );
    world.hellos.clear();
    world.run(10.0);
    assert!(
        (10..=11).contains(&world.hellos.len()),
        "{:?}",
        world.hellos
    );
    world.report = Some(GroundReport {
        lease: Lease {
            number: 6,
            holder: 2,
        },
        ..of_one()
    });
    world.run(3.0);
    assert_eq!(world.hellos.last().map(|(_, lease)| *lease), Some(None));
}

#[test]
fn a_run_is_driven_before_it_is_done_and_one_that_failed_ends_the_script_with_its_reason() {
    let gave_up = |why: &str| {
        Some(ScriptEnd::GaveUp {
            step: 0,
            why: why.to_owned(),
        })
    };
    let check = |until: Condition, report: GroundReport, end: Option<ScriptEnd>| {
        let mut world = World::new(vec![Rover::new(1)]);
        world.report = Some(report);
        follow(&mut world, &[wait(until)]);
        world.run(3.0);
        assert_eq!(script_end(&world), end.as_ref());
    };
    let open = run_ended(None, &[]);
    check(Condition::Driven(RUN), open.clone(), Some(ScriptEnd::Done));
    check(
        Condition::Driven(RUN),
        GroundReport {
            phase: StationPhase::Closing,
            ..open.clone()
        },
        None,
    );
    check(Condition::Done(RUN), open, None);
    check(
        Condition::Done(RUN),
        run_ended(Some(RunEnd::Done), &[]),
        Some(ScriptEnd::Done),
    );
    let failed = run_ended(
        Some(RunEnd::Failed),
        &["too hot", "run 3 has failed: no vehicle gets on"],
    );
    check(
        Condition::Done(RUN),
        failed.clone(),
        gave_up("run 3 has failed: no vehicle gets on"),
    );
    check(
        Condition::Driven(RUN),
        run_ended(Some(RunEnd::Stopped), &[]),
        gave_up("run 3 was given up"),
    );
    let or_else = Condition::Any(vec![Condition::Done(RUN), Condition::InForce]);
    check(or_else, failed, None);
}

#[test]
fn missions_and_ways_home_are_awaited_of_those_who_are_there() {
    let vehicles: BTreeSet<VehicleId> = [1, 2].map(VehicleId).into();
    let present = LiveVehicles {
        vehicles,
        lost_after: Duration::from_secs(3),
    };
    let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
    let steps = [
        ScriptStep::EndIf(Condition::Home(present.clone())),
        wait(Condition::MissionsEnded(present.clone())),
        wait(Condition::Home(present)),
    ];
    follow(&mut world, &steps);
    let say = |world: &mut World, vehicle: u8, phase: MissionPhase, end: Option<MissionEnd>| {
        let kind = MissionKind::Browse;
        let (vehicle, is_at_home) = (VehicleId(vehicle), true);
        let mission = MissionProgress {
            vehicle,
            boot: Boot(1),
            kind,
            phase,
            end,
            is_at_home,
            ..MissionProgress::default()
        };
        world.tell(In::Bus(heard(Message::Mission(mission))));
        world.run(1.0);
    };
    say(&mut world, 1, MissionPhase::Waiting, Some(MissionEnd::Done));
    say(&mut world, 1, MissionPhase::Over, Some(MissionEnd::Done));
    assert_eq!(
        script_end(&world),
        None,
        "vehicle 2 is there, and not at home"
    );
    // It falls silent, and is not waited for any more.
    world.rovers.truncate(1);
    world.run(4.0);
    assert_eq!(script_end(&world), Some(&ScriptEnd::Done));
}

#[test]
fn who_is_not_home_in_time_is_named_with_the_limit_and_what_it_began_with() {
    let present = LiveVehicles {
        vehicles: [VehicleId(1), VehicleId(2)].into(),
        lost_after: Duration::from_secs(30),
    };
    let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
    let within = Duration::from_secs(9);
    let home = |until| ScriptStep::Wait { until, within };
    let all = OrderGoal::new(Kind::Return, [].into(), Duration::from_secs(60));
    follow(
        &mut world,
        &[ScriptStep::Want(all), home(Condition::Home(present))],
    );
    world.run(10.0);
    let end = ScriptEnd::GaveUp {
        step: 1,
        why: "vehicles 1, 2 were not home 9 s after the order to return".to_owned(),
    };
    assert_eq!(script_end(&world), Some(&end));
}

#[test]
fn a_task_for_which_too_few_are_heard_for_very_long_is_not_waited_for() {
    let members = vec![VehicleId(1), VehicleId(2)];
    let sweep = task_kind(None, &GivenSweep::default());
    let check = |kind: TaskKind, until: Condition, rovers: usize, expected: Option<&str>| {
        let within = GONE_AFTER * 2;
        let request = TaskRequest {
            run: RUN,
            members: members.clone(),
            compare_with: None,
            kind,
        };
        let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
        follow(
            &mut world,
            &[
                ScriptStep::Task(request),
                ScriptStep::Wait { until, within },
            ],
        );
        world.run(100.0);
        world.rovers.truncate(rovers);
        world.run(GONE_AFTER.as_secs_f64() - 2.0);
        assert_eq!(script_end(&world), None, "they may come back");
        world.run(6.0);
        let end = expected.map(|why| ScriptEnd::GaveUp {
            step: 1,
            why: why.to_owned(),
        });
        assert_eq!(script_end(&world), end.as_ref());
    };
    let missions = || Condition::MissionsEnded(one_present());
    let (one, nobody) = (
        Some("1 of 2 vehicles were heard within 900 s, too few"),
        Some("0 of 2 vehicles were heard within 900 s, too few"),
    );
    check(sweep.clone(), Condition::Done(RUN), 1, one);
    check(sweep.clone(), Condition::Driven(RUN), 0, nobody);
    check(sweep.clone(), Condition::Done(RUN), 2, None);
    check(TaskKind::Browse, missions(), 0, nobody);
    check(TaskKind::Browse, missions(), 1, None);
    let or_home = Condition::Any(vec![Condition::Done(RUN), Condition::Home(one_present())]);
    check(sweep, or_home, 0, None);
}
