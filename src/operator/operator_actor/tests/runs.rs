//! Tasks, leases that are held, and scripts that wait for runs and missions.

use tomoswarm_proto::{Mission, MissionEnd, MissionKind, MissionPhase, RunEnd, RunReport, TaskKind};

use super::super::super::given_tasks::TaskWish;
use super::super::super::script::Present;
use super::*;

const RUN: RunId = RunId(3);

fn task() -> Step {
    let (members, kind) = (vec![VehicleId(1)], TaskKind::Browse);
    Step::Task(TaskWish { run: RUN, members, compare_with: Some(RunId(2)), kind })
}

fn wait(until: Condition) -> Step {
    Step::Wait { until, within: Duration::from_secs(60) }
}

/// A report of a run that has so ended; the ground station is idle.
fn run_ended(end: Option<RunEnd>, troubles: &[&str]) -> Report {
    let of_run = RunReport {
        run: RUN,
        kind: MissionKind::Browse,
        compared_with: Some(RunId(2)),
        end,
        ..RunReport::default()
    };
    let troubles = troubles.iter().map(|words| (*words).to_owned()).collect();
    Report { run: RUN, laps: 4, laps_done: 4, runs: vec![of_run], troubles, ..of_one() }
}

fn script_end(world: &World) -> Option<&ScriptEnd> {
    world.said.iter().find_map(|out| if let Out::ScriptEnded(end) = out { Some(end) } else { None })
}

#[test]
fn a_task_is_said_before_the_start_that_follows_it_and_again_until_it_is_shown() {
    let mut world = World::new(vec![Rover::new(1)]);
    world.report = Some(of_one());
    world.run(2.0);
    follow(&mut world, &[task(), Step::Want(Want { run: Some(RUN), ..want(Kind::Start) })]);
    world.run(4.0);
    assert_eq!((world.tasks.len(), world.tasks[0].1.lease), (1, of_one().lease));
    assert!(world.tasks[0].0 <= world.orders[0].0);
    world.run(2.0);
    assert_eq!(world.tasks.len(), 2, "no report has shown it for 5 s");
    world.report = Some(run_ended(None, &[]));
    world.run(20.0);
    assert_eq!(world.tasks.len(), 2);
}

#[test]
fn who_holds_a_lease_names_it_at_once_and_every_second_until_it_is_displaced() {
    let mut world = World::new(vec![Rover::new(1)]);
    world.report = Some(of_one());
    world.run(3.0);
    assert!(world.hellos.iter().all(|(_, lease)| lease.is_none()));
    world.tell(In::Want(1, Want { take_over: true, ..want(Kind::Hold) }));
    world.tick();
    let own = Lease { number: 5, holder: OWN };
    assert_eq!(world.hellos.last(), Some(&(world.orders[0].0, Some(own))), "before its first order");
    world.hellos.clear();
    world.run(10.0);
    assert!((10..=11).contains(&world.hellos.len()), "{:?}", world.hellos);
    world.report = Some(Report { lease: Lease { number: 6, holder: 2 }, ..of_one() });
    world.run(3.0);
    assert_eq!(world.hellos.last().map(|(_, lease)| *lease), Some(None));
}

#[test]
fn a_run_is_driven_before_it_is_done_and_one_that_failed_ends_the_script_with_its_reason() {
    let gave_up = |why: &str| Some(ScriptEnd::GaveUp { step: 0, why: why.to_owned() });
    let check = |until: Condition, report: Report, end: Option<ScriptEnd>| {
        let mut world = World::new(vec![Rover::new(1)]);
        world.report = Some(report);
        follow(&mut world, &[wait(until)]);
        world.run(3.0);
        assert_eq!(script_end(&world), end.as_ref());
    };
    let open = run_ended(None, &[]);
    check(Condition::Driven(RUN), open.clone(), Some(ScriptEnd::Done));
    check(Condition::Driven(RUN), Report { phase: StationPhase::Closing, ..open.clone() }, None);
    check(Condition::Done(RUN), open, None);
    check(Condition::Done(RUN), run_ended(Some(RunEnd::Done), &[]), Some(ScriptEnd::Done));
    let failed = run_ended(Some(RunEnd::Failed), &["too hot", "run 3 has failed: no vehicle gets on"]);
    check(Condition::Done(RUN), failed.clone(), gave_up("run 3 has failed: no vehicle gets on"));
    check(Condition::Driven(RUN), run_ended(Some(RunEnd::Stopped), &[]), gave_up("run 3 was given up"));
    let or_else = Condition::Any(vec![Condition::Done(RUN), Condition::InForce]);
    check(or_else, failed, None);
}

#[test]
fn missions_and_ways_home_are_awaited_of_those_who_are_there() {
    let vehicles: BTreeSet<VehicleId> = [1, 2].map(VehicleId).into();
    let present = Present { vehicles, lost_after: Duration::from_secs(3) };
    let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
    let steps = [
        Step::EndIf(Condition::Home(present.clone())),
        wait(Condition::MissionsEnded(present.clone())),
        wait(Condition::Home(present)),
    ];
    follow(&mut world, &steps);
    let say = |world: &mut World, vehicle: u8, phase: MissionPhase, end: Option<MissionEnd>| {
        let kind = MissionKind::Browse;
        let (vehicle, is_at_home) = (VehicleId(vehicle), true);
        let mission = Mission { vehicle, boot: Boot(1), kind, phase, end, is_at_home, ..Mission::default() };
        world.tell(In::Bus(heard(Message::Mission(mission))));
        world.run(1.0);
    };
    say(&mut world, 1, MissionPhase::Waiting, Some(MissionEnd::Done));
    say(&mut world, 1, MissionPhase::Over, Some(MissionEnd::Done));
    assert_eq!(script_end(&world), None, "vehicle 2 is there, and not at home");
    // It falls silent, and is not waited for any more.
    world.rovers.truncate(1);
    world.run(4.0);
    assert_eq!(script_end(&world), Some(&ScriptEnd::Done));
}
