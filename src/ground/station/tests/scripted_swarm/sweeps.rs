//! Sweeps come to their end whatever happens to vehicles, the station and the bus, and no sample is lost or doubled.

use super::*;

#[test]
fn a_sweep_is_driven_and_closed_and_every_sample_is_stored_once() {
    let mut swarm = Swarm::sweeping(3);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    swarm.seconds(2);
    assert_eq!(swarm.laps(), 2);
    assert_eq!(swarm.station.samples().count(RUN), swarm.measured() as u64);
    let report = swarm.report();
    assert_eq!(
        (report.phase, report.run, report.laps_done),
        (StationPhase::Idle, RUN, 2)
    );
    assert_eq!(
        (report.images, report.samples),
        (1, swarm.measured() as u64)
    );
    assert_eq!(swarm.haves.last().unwrap().closed, [RUN]);
    assert_eq!(report.troubles, [""; 0]);
    assert!(
        swarm.remembered < 30,
        "remembered {} times in {} s",
        swarm.remembered,
        swarm.now_s
    );
}

#[test]
fn killed_anywhere_the_station_goes_on_to_the_same_end_by_the_same_plans() {
    let mut whole = Swarm::sweeping(3);
    assert!(whole.is_closed(400));
    whole.seconds(30);
    for killed_s in 1..whole.now_s - 10 {
        // All, nothing, or only the first thing said in the last second got anywhere.
        let carried = [usize::MAX, 0, 1][killed_s as usize % 3];
        let mut swarm = Swarm::sweeping(3);
        swarm.seconds(killed_s - 1);
        swarm.second(carried);
        swarm.resume();
        // What was noted in the last second is lost with it.
        let is_closed = |swarm: &Swarm| swarm.haves.last().is_some_and(|have| have.closed == [RUN]);
        let ended = (0..400).any(|_| {
            swarm.second(usize::MAX);
            is_closed(&swarm)
        });
        assert!(ended, "killed after {killed_s} s: {:?}", swarm.notes);
        swarm.seconds(30);
        assert_eq!(
            swarm.count(|note| matches!(note, StationEvent::Replans(_))),
            0,
            "killed after {killed_s} s"
        );
        assert_eq!(swarm.plans, whole.plans, "killed after {killed_s} s");
        assert_eq!(
            swarm.last_jobs(),
            whole.last_jobs(),
            "killed after {killed_s} s"
        );
        assert_eq!(
            swarm.station.samples().count(RUN),
            whole.station.samples().count(RUN)
        );
        let (report, expected) = (swarm.report(), whole.report());
        assert_eq!(
            (report.laps_done, report.samples),
            (expected.laps_done, expected.samples)
        );
        assert_eq!(report.images, expected.images, "killed after {killed_s} s");
        assert_eq!(report.phase, StationPhase::Idle);
    }
}

#[test]
fn killed_again_and_again_it_still_comes_to_an_end() {
    let mut swarm = Swarm::sweeping(3);
    for killed_s in [5, 7, 9, 11, 13, 8, 6, 20, 3, 9] {
        swarm.seconds(killed_s);
        swarm.resume();
    }
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.laps(), 2);
    assert_eq!(swarm.station.samples().count(RUN), swarm.measured() as u64);
}

#[test]
fn the_others_take_over_a_lost_vehicles_work_and_back_it_works_again() {
    let mut swarm = Swarm::sweeping(4);
    swarm.seconds(30);
    swarm.rovers[2].is_dead = true;
    let (lost, lost_s) = (VehicleId(3), swarm.now_s);
    let plans_known = swarm.plans.len();
    assert!(swarm.until(60, |note| *note == StationEvent::Lost(lost)));
    swarm.seconds(2);
    assert_eq!(
        (swarm.report().phase, &swarm.report().lost[..]),
        (StationPhase::Stopping, &[lost][..])
    );
    assert!(
        swarm.plans.len() > plans_known,
        "an empty revision for the others"
    );
    while swarm.report().phase != StationPhase::Running {
        swarm.second(usize::MAX);
    }
    assert!(
        swarm.now_s - lost_s >= 65,
        "planned after {} s: it may still drive",
        swarm.now_s - lost_s
    );
    assert_eq!(swarm.report().members, [1, 2, 4].map(VehicleId));
    swarm.seconds(10);
    swarm.rovers[2].is_dead = false;
    swarm.rovers[2].restart();
    assert!(swarm.until(5, |note| *note == StationEvent::Found(lost)));
    swarm.seconds(10);
    assert_eq!(swarm.report().members, [1, 2, 3, 4].map(VehicleId));
    let before = swarm.rovers[2].kept.len();
    assert!(swarm.is_closed(600), "{:?}", swarm.notes);
    assert!(swarm.rovers[2].kept.len() > before, "it has got work again");
    assert_eq!(swarm.laps(), 2);
    assert_eq!(swarm.station.samples().count(RUN), swarm.measured() as u64);
}

#[test]
fn one_that_lost_only_the_bus_stands_before_others_are_planned_for() {
    let mut swarm = Swarm::sweeping(4);
    swarm.seconds(30);
    swarm.rovers[1].is_cut = true;
    let mut stood_at = swarm.rovers[1].at;
    while swarm
        .plans
        .values()
        .all(|plan| plan.stops.is_empty() || plan.members.len() == 4)
    {
        stood_at = swarm.rovers[1].at;
        swarm.second(usize::MAX);
        assert!(swarm.now_s < 300, "{:?}", swarm.notes);
    }
    assert!(swarm.is_closed(600), "{:?}", swarm.notes);
    assert_eq!(
        swarm.rovers[1].at, stood_at,
        "it has not moved since the others were planned for"
    );
}

#[test]
fn with_one_vehicle_left_the_sweep_waits_until_another_is_back() {
    let mut swarm = Swarm::sweeping(2);
    swarm.seconds(20);
    swarm.rovers[0].is_dead = true;
    assert!(
        swarm.until(60, |note| *note == StationEvent::Waits(RUN)),
        "{:?}",
        swarm.notes
    );
    swarm.seconds(1000);
    assert_eq!(
        swarm.count(|note| matches!(note, StationEvent::NoPlan(_) | StationEvent::Stalled(_))),
        0
    );
    assert_eq!(
        swarm.report().troubles.len(),
        2,
        "{:?}",
        swarm.report().troubles
    );
    swarm.rovers[0].is_dead = false;
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(
        swarm.count(|note| matches!(note, StationEvent::Waits(_))),
        1
    );
}

#[test]
fn when_the_ground_hears_nobody_nobody_is_lost_and_no_sweep_is_given_up() {
    for deaf_s in [100, 900] {
        let mut swarm = Swarm::sweeping(3);
        swarm.seconds(20);
        let cut = |swarm: &mut Swarm, is_cut| {
            swarm
                .rovers
                .iter_mut()
                .for_each(|rover| rover.is_cut = is_cut);
        };
        cut(&mut swarm, true);
        swarm.seconds(deaf_s);
        cut(&mut swarm, false);
        assert!(swarm.is_closed(400), "{:?}", swarm.notes);
        let is_trouble = |note: &StationEvent| {
            matches!(
                note,
                StationEvent::Lost(_) | StationEvent::Replans(_) | StationEvent::Stalled(_)
            )
        };
        assert_eq!(swarm.count(is_trouble), 0, "{deaf_s}");
    }
}

#[test]
fn a_restarted_vehicle_is_planned_for_anew_and_laps_done_stay_done() {
    let mut swarm = Swarm::sweeping(3);
    assert!(swarm.until(200, |note| matches!(
        note,
        StationEvent::LapDone { laps: 1, .. }
    )));
    swarm.seconds(10);
    swarm.rovers[1].restart();
    swarm.seconds(2);
    assert_eq!(swarm.count(|note| *note == StationEvent::Replans(RUN)), 1);
    let revisions = |swarm: &Swarm| swarm.plans.keys().map(|name| name.1).max();
    let empty = revisions(&swarm).unwrap();
    let is_empty = |(name, plan): (&(RunId, Revision, VehicleId), &Plan)| {
        name.1 != empty || plan.stops.is_empty()
    };
    assert!(swarm.plans.iter().all(is_empty), "first an empty revision");
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.laps(), 2);
    assert_eq!(swarm.station.samples().count(RUN), swarm.measured() as u64);
}

#[test]
fn a_vehicle_that_restarts_while_the_ground_is_down_is_planned_for_anew() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(40);
    swarm.rovers[1].restart();
    swarm.resume();
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.count(|note| *note == StationEvent::Replans(RUN)), 1);
}

#[test]
fn a_vehicle_that_died_while_the_ground_was_down_is_lost() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(40);
    swarm.rovers[1].is_dead = true;
    swarm.resume();
    assert!(swarm.is_closed(600), "{:?}", swarm.notes);
    assert_eq!(
        swarm.count(|note| *note == StationEvent::Lost(VehicleId(2))),
        1
    );
}

#[test]
fn an_operator_stops_and_starts_everyone_without_a_fight() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(30);
    order(&mut swarm, RUN, OrderKind::Hold);
    swarm.seconds(2);
    assert_eq!(swarm.report().in_force, Some(OrderKind::Hold));
    let places: Vec<Point> = swarm.rovers.iter().map(|rover| rover.at).collect();
    swarm.seconds(1000);
    assert_eq!(
        swarm
            .rovers
            .iter()
            .map(|rover| rover.at)
            .collect::<Vec<_>>(),
        places
    );
    order(&mut swarm, RUN, OrderKind::Start);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.report().in_force, None);
    assert_eq!(
        swarm.count(|note| matches!(note, StationEvent::Replans(_))),
        0
    );
}

#[test]
fn an_operators_start_begins_the_run_that_it_names() {
    let settings = StationSettings {
        lease: None,
        compare_with: Some(RunId(1)),
        ..settings(3)
    };
    let mut swarm = Swarm::new(3, settings);
    swarm.seconds(10);
    assert_eq!(
        swarm.station.leases.own(),
        Lease {
            number: 1,
            holder: 1
        }
    );
    order(&mut swarm, RunId(1), OrderKind::Start);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    swarm.notes.clear();
    order(&mut swarm, RunId(1), OrderKind::Start);
    swarm.seconds(20);
    assert!(
        swarm.notes.is_empty(),
        "that run was driven: {:?}",
        swarm.notes
    );
    order(&mut swarm, RunId(2), OrderKind::Start);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    let change = swarm.jobs.last().unwrap();
    let compared = swarm
        .jobs
        .iter()
        .rfind(|job| !job.empty.is_empty())
        .expect("a picture of changes");
    assert_eq!((compared.run, change.run), (RunId(2), RunId(2)));
}

#[test]
fn of_two_grounds_one_leads_and_the_other_takes_over_when_it_is_gone() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(30);
    let other = GroundReport {
        lease: Lease {
            number: 9,
            holder: 5,
        },
        ..GroundReport::default()
    };
    for _ in 0..20 {
        swarm.tell(In::Bus(Message::Report(other.clone())), usize::MAX);
        let (plans, haves) = (swarm.plans.len(), swarm.haves.len());
        swarm.second(usize::MAX);
        assert_eq!(
            (swarm.plans.len(), swarm.haves.len()),
            (plans, haves),
            "who stands by is silent"
        );
        assert_eq!(swarm.report().lease.number, 0);
        assert_eq!(
            swarm.report().troubles.len(),
            1,
            "{:?}",
            swarm.report().troubles
        );
    }
    assert_eq!(
        swarm.count(|note| matches!(note, StationEvent::StandsBy(_))),
        1
    );
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(
        swarm.station.leases.own(),
        Lease {
            number: 10,
            holder: 1
        }
    );
    assert_eq!(
        swarm.count(|note| matches!(note, StationEvent::Replans(_))),
        0,
        "nobody has given other plans"
    );
}

#[test]
fn a_resumed_station_leads_above_every_echo() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(30);
    swarm.resume();
    swarm.seconds(2);
    assert_eq!(swarm.report().lease, Lease::default(), "it listens first");
    swarm.seconds(3);
    assert_eq!(
        swarm.report().lease,
        Lease {
            number: 2,
            holder: 1
        }
    );
}

#[test]
fn a_vehicle_that_is_never_heard_does_not_keep_the_others_waiting() {
    let mut swarm = Swarm::sweeping(3);
    swarm.rovers[2].is_dead = true;
    swarm.seconds(29);
    assert_eq!(swarm.report().phase, StationPhase::Waiting);
    assert!(
        swarm.until(10, |note| *note == StationEvent::Lost(VehicleId(3))),
        "{:?}",
        swarm.notes
    );
    swarm.seconds(60);
    assert_eq!(swarm.report().members, [1, 2].map(VehicleId));
    swarm.rovers[2].switch_on();
    assert!(swarm.is_closed(600), "{:?}", swarm.notes);
    assert!(!swarm.rovers[2].kept.is_empty(), "it has joined in");
    let mut alone = Swarm::sweeping(3);
    alone.rovers[1].is_dead = true;
    alone.rovers[2].is_dead = true;
    alone.seconds(200);
    assert_eq!(
        alone.report().phase,
        StationPhase::Waiting,
        "one alone measures nothing"
    );
}

#[test]
fn a_lost_vehicle_that_was_stopped_comes_back_stopped() {
    let mut swarm = Swarm::sweeping(4);
    swarm.seconds(30);
    let revision = Revision(swarm.rovers[1].ordered.revision.0 + 1);
    let (vehicle, lease, kind) = (VehicleId(2), LEASE, OrderKind::Land);
    swarm.rovers[1].obey(&Order {
        vehicle,
        lease,
        run: RUN,
        revision,
        seen: None,
        kind,
        ends: vec![],
    });
    swarm.seconds(2);
    swarm.rovers[1].is_cut = true;
    assert!(
        swarm.until(60, |note| *note == StationEvent::Lost(vehicle)),
        "{:?}",
        swarm.notes
    );
    swarm.seconds(60);
    assert_eq!(
        (swarm.report().in_force, swarm.report().members.len()),
        (None, 3),
        "the others go on"
    );
    swarm.rovers[1].is_cut = false;
    swarm.seconds(20);
    assert_eq!(swarm.rovers[1].ordered.kind, Some(OrderKind::Land));
    assert_eq!(swarm.report().in_force, Some(OrderKind::Land));
}

#[test]
fn plans_and_pictures_that_get_lost_are_asked_for_again() {
    let mut swarm = Swarm::sweeping(3);
    while swarm.answers.is_empty() {
        swarm.second(usize::MAX);
    }
    swarm.answers.clear();
    swarm.seconds(32);
    assert!(
        swarm.until(5, |note| matches!(note, StationEvent::Planned { .. })),
        "{:?}",
        swarm.notes
    );
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(
        (
            swarm.answers.len(),
            swarm.count(|note| matches!(note, StationEvent::Replans(_)))
        ),
        (1, 0)
    );
    swarm.answers.clear();
    swarm.seconds(119);
    assert_eq!(swarm.jobs.len(), 1);
    swarm.seconds(5);
    assert_eq!(
        (
            swarm.jobs.len(),
            swarm.last_jobs().len(),
            swarm.report().images
        ),
        (2, 1, 1)
    );
    swarm.seconds(200);
    assert_eq!(swarm.jobs.len(), 2, "it was made");
}

#[test]
fn a_ground_with_an_empty_disk_begins_no_sweep_that_was_driven_long_ago() {
    let fresh = StationSettings {
        lease: None,
        holder: 5,
        ..settings(3)
    };
    for is_known in [false, true] {
        let mut swarm = Swarm::sweeping(3);
        assert!(swarm.is_closed(400));
        let lease = swarm.rovers[0].ordered.lease;
        if is_known {
            // A vehicle that was started anew has forgotten what it drove, but the store has not.
            swarm.rovers[1].follower = Follower::new(VehicleId(2), swarm.rovers[1].at, 0.5);
        }
        swarm.station = Station::new(fresh.clone());
        if is_known {
            swarm.station.recall_runs([(RUN, true)]);
        }
        (swarm.up_s, swarm.notes) = (0, Vec::new());
        swarm.seconds(60);
        assert_eq!(
            (swarm.report().phase, swarm.report().run),
            (StationPhase::Idle, RunId::default())
        );
        assert!(
            swarm
                .rovers
                .iter()
                .all(|rover| rover.ordered.lease == lease),
            "nobody was ordered anything"
        );
    }
}

/// A pure draw below `limit`.
fn draw(seed: u64, second: u64, purpose: u64, limit: u64) -> u64 {
    let mut state = seed
        ^ second.wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ purpose.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    for _ in 0..3 {
        state = (state ^ (state >> 30)).wrapping_mul(0x94d0_49bb_1331_11eb);
    }
    (state >> 20) % limit
}

/// Something may go wrong in this second.
fn suffer(swarm: &mut Swarm, seed: u64) {
    let rover = draw(seed, swarm.now_s, 1, swarm.rovers.len() as u64) as usize;
    match draw(seed, swarm.now_s, 2, 60) {
        0 => swarm.rovers[rover].restart(),
        1 => swarm.rovers[rover].is_dead = true,
        2 => swarm.rovers[rover].is_cut = true,
        3 | 4 => swarm.rovers[rover].switch_on(),
        5 | 6 => swarm.rovers[rover].is_cut = false,
        7 => order(swarm, RUN, OrderKind::Hold),
        8..11 => order(swarm, RUN, OrderKind::Start),
        11 if swarm.memory.is_some() => {
            swarm.second(draw(seed, swarm.now_s, 3, 4) as usize);
            swarm.resume();
        }
        _ => {}
    }
}

#[test]
fn whatever_goes_wrong_afterwards_the_sweep_ends_and_no_sample_is_lost_or_doubled() {
    for seed in 0..60 {
        let mut swarm = Swarm::sweeping(3 + seed as u8 % 2);
        for _ in 0..500 {
            suffer(&mut swarm, seed);
            swarm.second(usize::MAX);
        }
        for rover in &mut swarm.rovers {
            rover.is_cut = false;
            rover.switch_on();
        }
        swarm.seconds(20);
        order(&mut swarm, RUN, OrderKind::Start);
        let is_closed = |swarm: &Swarm| swarm.haves.last().is_some_and(|have| have.closed == [RUN]);
        let ended = (0..1500).any(|_| {
            swarm.second(usize::MAX);
            is_closed(&swarm)
        });
        assert!(
            ended,
            "seed {seed}: {:?}, {:?}",
            swarm.report(),
            swarm.notes
        );
        swarm.seconds(60);
        assert_eq!(
            swarm.station.samples().count(RUN),
            swarm.measured() as u64,
            "seed {seed}"
        );
        assert!(swarm.report().laps_done >= 2, "seed {seed}");
    }
}
