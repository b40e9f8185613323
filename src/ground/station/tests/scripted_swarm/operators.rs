//! What operators say to the station, and what it tells them: tasks, leases, and how runs ended.

use tomoswarm_proto::{
    Hello, MissionEnd, MissionKind, MissionRefusal, OperatorId, RunReport, Sender, SweepPlanner,
    Task, TaskKind,
};

use super::*;
use crate::ground::imager::Subject;

fn lease(number: u32, holder: u64) -> Lease {
    Lease { number, holder }
}

fn task(run: RunId, compare_with: Option<RunId>, kind: TaskKind) -> In {
    let members = (1..=3).map(VehicleId).collect();
    In::Bus(Message::Task(Task {
        lease: LEASE,
        run,
        members,
        compare_with,
        kind,
    }))
}

fn one_lap() -> TaskKind {
    TaskKind::ConfiguredSweep {
        planner: Some(SweepPlanner::RotatingGap),
        positions: Some(16),
        laps: Some(1),
        dwell_ms: None,
        dwell_limit_ms: None,
    }
}

/// An operator that greets and says to hold a lease.
fn hello(operator: u8, held: Lease) -> In {
    let asking = Hello::asking(
        Sender::Operator(OperatorId(operator)),
        Boot(1),
        5,
        held.holder,
    );
    In::Bus(Message::Hello(Hello {
        is_member: true,
        member_for_s: 1,
        lease: Some(held),
        ..asking
    }))
}

/// Orders everyone to go on, by a lease that nobody has heard of before.
fn take_over(swarm: &mut Swarm, lease: Lease) {
    for rover in &mut swarm.rovers {
        let (run, revision, kind) = (RUN, Revision(1), OrderKind::Start);
        rover.obey(&Order {
            vehicle: rover.id,
            lease,
            run,
            revision,
            seen: None,
            kind,
            ends: vec![],
        });
    }
}

fn run(swarm: &Swarm, run: RunId) -> RunReport {
    *swarm
        .report()
        .runs
        .iter()
        .find(|report| report.run == run)
        .expect("the run is reported")
}

#[test]
fn a_task_says_what_a_run_is_compared_with_whether_it_comes_before_the_start_or_after() {
    let settings = StationSettings {
        compare_with: Some(RunId(1)),
        ..settings(3)
    };
    for (is_before, compare_with) in [(true, None), (false, None), (true, Some(RunId(7)))] {
        let mut swarm = Swarm::new(3, settings.clone());
        swarm.seconds(3);
        if is_before {
            swarm.tell(task(RUN, compare_with, one_lap()), usize::MAX);
        }
        order(&mut swarm, RUN, OrderKind::Start);
        swarm.second(usize::MAX);
        if !is_before {
            assert_eq!(
                run(&swarm, RUN).compared_with,
                Some(RunId(1)),
                "as the file says"
            );
            swarm.tell(task(RUN, compare_with, one_lap()), usize::MAX);
        }
        assert!(swarm.is_closed(400), "{:?}", swarm.notes);
        swarm.seconds(3);
        assert_eq!(swarm.begun, [(RUN, compare_with)]);
        assert_eq!(run(&swarm, RUN).compared_with, compare_with);
        assert_eq!(swarm.laps(), 1, "it is swept as the task says");
    }
}

#[test]
fn a_task_that_is_no_sweep_is_left_to_the_vehicles() {
    for is_before in [true, false] {
        let mut swarm = Swarm::new(3, settings(3));
        swarm.seconds(3);
        let explore = task(RUN, None, TaskKind::Explore);
        if is_before {
            swarm.tell(explore.clone(), usize::MAX);
        }
        order(&mut swarm, RUN, OrderKind::Start);
        swarm.second(usize::MAX);
        swarm.tell(explore, usize::MAX);
        swarm.seconds(60);
        assert_eq!(
            (swarm.report().phase, &swarm.begun[..]),
            (StationPhase::Idle, &[][..])
        );
        assert_eq!(run(&swarm, RUN).end, None);
    }
}

/// Three vehicles that explore by a task in [`RUN`].
fn exploring() -> Swarm {
    let mut swarm = Swarm::new(3, settings(3));
    swarm.seconds(3);
    swarm.tell(task(RUN, None, TaskKind::Explore), usize::MAX);
    order(&mut swarm, RUN, OrderKind::Start);
    end(&mut swarm, 1..=3, None);
    swarm.seconds(3);
    swarm
}

fn end(swarm: &mut Swarm, vehicles: std::ops::RangeInclusive<u8>, end: Option<MissionEnd>) {
    let of_those = swarm
        .rovers
        .iter_mut()
        .filter(|rover| vehicles.contains(&rover.id.0));
    of_those.for_each(|rover| rover.own = Some((MissionKind::Explore, end)));
}

#[test]
fn a_run_of_the_vehicles_is_done_when_all_that_are_there_have_ended_their_missions() {
    let mut swarm = exploring();
    assert_eq!((run(&swarm, RUN).end, swarm.report().run), (None, RUN));
    end(&mut swarm, 1..=2, Some(MissionEnd::Done));
    swarm.seconds(3);
    assert_eq!(run(&swarm, RUN).end, None, "vehicle 3 is under way");
    swarm.rovers[2].is_dead = true;
    swarm.seconds(20);
    assert_eq!(run(&swarm, RUN).end, None, "it may come back");
    swarm.seconds(20);
    let output = run(&swarm, RUN);
    assert_eq!(
        (output.kind, output.end),
        (MissionKind::Explore, Some(RunEnd::Done))
    );
    assert_eq!(
        (swarm.report().phase, &swarm.begun[..]),
        (StationPhase::Idle, &[][..])
    );
}

#[test]
fn a_run_in_which_a_vehicle_gives_up_or_refuses_has_failed_and_says_who_and_why() {
    let outside = MissionEnd::Refused(MissionRefusal::OutsideFence);
    for (last, why) in [
        (MissionEnd::NoWay(2), None),
        (
            MissionEnd::GaveUp(2),
            Some("run 2 has failed: vehicle 3 gave up 2"),
        ),
        (
            outside,
            Some("run 2 has failed: vehicle 3 refused: a place lies outside the fence"),
        ),
    ] {
        let mut swarm = exploring();
        end(&mut swarm, 1..=2, Some(MissionEnd::Stopped));
        end(&mut swarm, 3..=3, Some(last));
        swarm.seconds(3);
        let expected = if why.is_some() {
            RunEnd::Failed
        } else {
            RunEnd::Done
        };
        assert_eq!(run(&swarm, RUN).end, Some(expected), "{last:?}");
        let troubles = &swarm.report().troubles;
        assert_eq!(
            troubles
                .iter()
                .map(String::as_str)
                .find(|words| words.starts_with("run 2")),
            why
        );
    }
}

#[test]
fn without_a_task_a_run_is_left_to_vehicles_that_all_say_to_have_missions_of_their_own() {
    for all in [true, false] {
        let mut swarm = Swarm::new(3, settings(3));
        swarm.seconds(3);
        end(&mut swarm, if all { 1..=3 } else { 1..=2 }, None);
        order(&mut swarm, RUN, OrderKind::Start);
        swarm.seconds(60);
        let kind = if all {
            MissionKind::Explore
        } else {
            MissionKind::Sweep
        };
        assert_eq!(run(&swarm, RUN).kind, kind);
        assert_eq!(
            swarm.report().phase == StationPhase::Idle,
            all,
            "{:?}",
            swarm.report()
        );
    }
}

#[test]
fn images_are_counted_in_their_run_when_they_are_made_also_while_it_lasts() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(3);
    for (of_run, stage, is_made) in [
        (RUN, ImageStage::Ongoing, true),
        (RUN, ImageStage::Ongoing, true),
        (RUN, ImageStage::Ongoing, false),
        (RUN, ImageStage::Lap, true),
        (RUN, ImageStage::Lap, false),
        (RunId(77), ImageStage::Last, true),
    ] {
        let name = PictureName {
            run: of_run,
            laps: 0,
            subject: Subject::Structure,
            stage,
        };
        swarm.tell(In::Pictured { name, is_made }, usize::MAX);
    }
    swarm.seconds(1);
    assert_eq!((swarm.report().images, run(&swarm, RUN).images), (3, 3));
}

#[test]
fn a_run_is_done_when_its_last_images_are_made_and_not_before() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(3);
    let reported = run(&swarm, RUN);
    assert_eq!((reported.kind, reported.end), (MissionKind::Sweep, None));
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    let images = std::mem::take(&mut swarm.answers);
    swarm.seconds(5);
    assert_eq!(
        (swarm.report().phase, run(&swarm, RUN).end),
        (StationPhase::Idle, None)
    );
    swarm.answers = images;
    swarm.seconds(2);
    let (reported, samples) = (run(&swarm, RUN), swarm.measured() as u64);
    assert_eq!(
        (reported.end, reported.images, reported.samples),
        (Some(RunEnd::Done), 1, samples)
    );
    assert_eq!(swarm.report().expected, [1, 2, 3].map(VehicleId));
    let bytes = swarm.memory.clone().expect("something was remembered");
    let again = Station::resume(settings(3), bytes, [], []);
    assert_eq!(again.runs, swarm.station.runs, "it is remembered");
}

#[test]
fn a_run_that_cannot_be_planned_has_failed_and_its_reason_is_a_trouble() {
    let mut swarm = Swarm::new(3, settings(3));
    swarm.seconds(3);
    let TaskKind::ConfiguredSweep {
        planner,
        laps,
        dwell_ms,
        dwell_limit_ms,
        ..
    } = one_lap()
    else {
        unreachable!()
    };
    let impossible = TaskKind::ConfiguredSweep {
        planner,
        positions: Some(9),
        laps,
        dwell_ms,
        dwell_limit_ms,
    };
    swarm.tell(task(RUN, None, impossible), usize::MAX);
    order(&mut swarm, RUN, OrderKind::Start);
    assert!(
        swarm.until(60, |note| matches!(note, StationEvent::NoPlan(_))),
        "{:?}",
        swarm.notes
    );
    swarm.seconds(2);
    assert_eq!(run(&swarm, RUN).end, Some(RunEnd::Failed));
    let troubles = &swarm.report().troubles;
    assert!(
        troubles
            .iter()
            .any(|words| words.starts_with("run 2 has failed: ")),
        "{troubles:?}"
    );
}

#[test]
fn what_a_task_leaves_out_of_a_sweep_is_as_the_file_of_the_ground_station_has_it() {
    let as_the_file_has_it = TaskKind::ConfiguredSweep {
        planner: None,
        positions: None,
        laps: None,
        dwell_ms: None,
        dwell_limit_ms: None,
    };
    let mut planned = Vec::new();
    for task_of_run in [None, Some(as_the_file_has_it)] {
        let mut swarm = Swarm::new(3, settings(3));
        swarm.seconds(3);
        if let Some(kind) = task_of_run {
            swarm.tell(task(RUN, None, kind), usize::MAX);
        }
        order(&mut swarm, RUN, OrderKind::Start);
        assert!(swarm.until(60, |note| matches!(note, StationEvent::Planned { .. })));
        let of_plan = |note: &StationEvent| matches!(note, StationEvent::Planned { .. });
        planned.extend(swarm.notes.iter().find(|note| of_plan(note)).cloned());
    }
    assert_eq!(planned.len(), 2);
    assert_eq!(planned[0], planned[1]);
}

#[test]
fn a_sweep_makes_way_for_a_run_that_an_operator_begins_in_its_place() {
    for kind in [one_lap(), TaskKind::Explore] {
        let mut swarm = Swarm::sweeping(3);
        swarm.seconds(15);
        let (sweep, next) = (swarm.report().run, RunId(swarm.report().run.0 + 1));
        swarm.tell(task(next, None, kind.clone()), usize::MAX);
        order(&mut swarm, next, OrderKind::Start);
        swarm.seconds(5);
        assert_eq!(run(&swarm, sweep).end, Some(RunEnd::Stopped));
        let notes = &swarm.notes;
        let made_way = |note: &StationEvent| matches!(note, StationEvent::MadeWay { .. });
        assert!(notes.iter().any(made_way), "{notes:?}");
        assert_eq!(run(&swarm, next).end, None);
        if kind == TaskKind::Explore {
            assert_eq!(swarm.report().phase, StationPhase::Idle);
        } else {
            assert!(swarm.is_closed(400), "{:?}", swarm.notes);
            assert_eq!(swarm.begun.last(), Some(&(next, None)));
        }
    }
}

#[test]
fn a_take_over_between_operators_does_not_kill_the_sweep() {
    let mut undisturbed = Swarm::sweeping(3);
    assert!(undisturbed.is_closed(400), "{:?}", undisturbed.notes);
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(15);
    for (operator, held) in [(1, lease(2, 77)), (2, lease(3, 66))] {
        // The echo of its orders comes before its greeting.
        take_over(&mut swarm, held);
        for _ in 0..10 {
            swarm.second(usize::MAX);
            swarm.tell(hello(operator, held), usize::MAX);
        }
        assert_eq!(
            (swarm.report().lease, swarm.report().phase),
            (held, StationPhase::Running)
        );
        assert!(
            swarm.rovers.iter().all(|rover| rover.ordered.lease == held),
            "nobody else has ordered"
        );
    }
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(
        swarm.count(|note| matches!(note, StationEvent::Replans(_))),
        0
    );
    assert!(
        swarm.now_s <= undisturbed.now_s + 2,
        "{} s, {} s",
        swarm.now_s,
        undisturbed.now_s
    );
    assert_eq!(
        swarm.report().lease,
        lease(4, 1),
        "no operator lives: the ground holds a lease of its own"
    );
}

#[test]
fn of_two_grounds_under_one_operator_one_plans_and_the_other_takes_over_when_it_is_gone() {
    let new = |store, holder| {
        Station::new(StationSettings {
            store,
            holder,
            lease: None,
            ..settings(3)
        })
    };
    let mut grounds = [new(7, 1), new(8, 2)];
    let (held, mut leading) = (lease(5, 77), Vec::new());
    for second in 0..40 {
        let now = Time::ZERO + Duration::from_secs(second);
        let mut out: [Vec<Out>; 2] = Default::default();
        for (ground, out) in grounds.iter_mut().zip(&mut out) {
            ground.handle(now, hello(1, held), out).unwrap();
            ground.wake(now, out).unwrap();
        }
        // The first one dies after 20 s.
        for (from, to) in [(0, 1), (1, 0)]
            .into_iter()
            .filter(|(from, _)| *from == 1 || second < 20)
        {
            for output in &out[from] {
                if let Out::Publish(report @ Message::Report(_)) = output {
                    grounds[to]
                        .handle(now, In::Bus(report.clone()), &mut Vec::new())
                        .unwrap();
                }
            }
        }
        leading.push((
            second,
            grounds.each_ref().map(|ground| ground.leases.holds()),
        ));
        assert!(
            grounds
                .iter()
                .all(|ground| !ground.leases.holds() || ground.leases.own() == held)
        );
    }
    assert!(
        leading[5..20]
            .iter()
            .all(|(_, holds)| *holds == [true, false]),
        "{leading:?}"
    );
    assert!(
        leading[32..].iter().all(|(_, holds)| holds[1]),
        "{leading:?}"
    );
}
