//! What a swarm does when bus, radio, software, sensor or battery of its vehicles fail: it is safe, whatever happens,
//! and goes on when the ground can decide again.

use std::collections::BTreeSet;

use tomoswarm::sim::{SLICE, visible};

use crate::place::{Place, assert_settled};

fn place(vehicles: usize, root: &str, faults: &str) -> Place {
    let end = format!("end = \"return\"\n{root}");
    Place::new(12.0, 12.0)
        .vehicles(vehicles)
        .root(&end)
        .with(faults)
}

fn fault(kind: &str, lines: &str) -> String {
    format!("[[fault]]\nkind = \"{kind}\"\nat_s = 60.0\n{lines}\n")
}

#[test]
fn all_that_lose_the_bus_come_home_and_none_moves_without_the_radio_too() {
    let safety = "[safety]\nautonomy_s = 10.0\n";
    let bus = format!("{safety}{}", fault("bus", ""));
    let outcome = place(4, "until_s = 1000.0\nexpect = \"home\"", &bus).run_to_the_end();
    assert_eq!(
        (
            outcome.home,
            outcome
                .log
                .matches("returns by itself: the bus is lost")
                .count()
        ),
        (4, 4)
    );
    let both = format!("{bus}{}", fault("radio", ""));
    let outcome = place(4, "until_s = 200.0\nexpect = \"held\"", &both).run_to_the_end();
    assert_eq!((outcome.home, outcome.held), (0, 4));
    let last = outcome
        .log
        .lines()
        .filter(|line| line.contains("drives 0."))
        .filter(|line| !line.ends_with("0.000"));
    let moved_s = last
        .filter_map(|line| line.split(' ').next()?.parse::<f64>().ok())
        .fold(0.0, f64::max);
    assert!(
        (20.0..64.0).contains(&moved_s),
        "somebody drives after {moved_s} s"
    );
}

#[test]
fn the_others_sweep_on_without_a_vehicle_whose_battery_is_low_or_whose_sensors_are_silent() {
    for (kind, reason) in [
        ("battery", "returns by itself: the battery is low"),
        (
            "sensor",
            "returns by itself: its range sensors do not answer",
        ),
    ] {
        let faults = fault(kind, "vehicles = [2]");
        let outcome = place(3, "until_s = 3000.0", &faults).run_to_the_end();
        let said = |words: &str| outcome.log.matches(words).count();
        assert_eq!(said(reason), 1, "{kind}");
        assert_eq!(said("sees that vehicle 2 is out of service"), 1);
        assert_settled(&outcome);
    }
}

#[test]
fn a_vehicle_that_is_charged_again_is_taken_up_again_and_with_one_left_the_sweep_says_who_is_out() {
    let low = fault("battery", "vehicles = [2]");
    let charged = "[[fault]]\nkind = \"battery\"\nat_s = 200.0\nvehicles = [2]\ncharge = 1.0\n";
    let both = format!("{low}{charged}");
    let outcome = place(3, "until_s = 3000.0", &both).run_to_the_end();
    assert!(
        outcome
            .log
            .contains("sees that vehicle 2 is in service again")
    );
    assert_settled(&outcome);
    let outcome = place(2, "until_s = 3000.0", &low).run();
    let why = outcome.failure.as_deref().unwrap_or_default();
    assert!(
        why.ends_with("no vehicle gets on; out of service: vehicle 2"),
        "{why}"
    );
    assert!(outcome.collisions.is_empty());
}

#[test]
fn a_sweep_goes_on_when_the_bus_is_back() {
    let faults = format!(
        "[safety]\nautonomy_s = 10.0\n{}",
        fault("bus", "until_s = 250.0")
    );
    let outcome = place(3, "until_s = 3000.0", &faults).run_to_the_end();
    assert!(outcome.log.contains("returns by itself: the bus is lost"));
    assert_settled(&outcome);
}

#[test]
fn a_vehicle_that_restarts_is_planned_for_anew_and_no_sample_is_lost() {
    for seed in 1..4 {
        let faults = fault("restart", "vehicles = [2]");
        let outcome = place(3, "until_s = 3000.0", &faults)
            .seed(seed)
            .run_to_the_end();
        assert!(outcome.log.contains("its software starts, boot 2"));
        assert_settled(&outcome);
    }
}

#[test]
fn a_ground_station_that_restarts_goes_on_with_its_run_and_no_sample_is_lost() {
    let twice = [60.0, 120.0]
        .map(|at_s| format!("[[fault]]\nkind = \"restart\"\nat_s = {at_s}\nground = true\n"));
    for seed in 1..4 {
        let outcome = place(3, "until_s = 3000.0", &twice.concat())
            .seed(seed)
            .run_to_the_end();
        let log = &outcome.log;
        assert!(
            log.contains("ground its software starts, boot 3"),
            "{}",
            crate::place::tail(log)
        );
        assert_eq!(log.matches("ground closes run").count(), 1);
        assert_settled(&outcome);
    }
}

#[test]
fn vehicles_whose_ground_station_is_gone_drive_their_plan_to_its_end() {
    let outcome = place(3, "until_s = 600.0", &fault("dead", "ground = true")).run_safely();
    let log = &outcome.log;
    assert!(
        log.contains("ground its software ends") && !log.contains("ground its software starts")
    );
    assert_eq!(
        log.matches("has driven its plan").count(),
        3,
        "{}",
        crate::place::tail(log)
    );
    let maps = log
        .lines()
        .filter(|line| line.contains("vehicle") && line.contains(" holds map "));
    let maps: BTreeSet<_> = maps
        .filter_map(|line| line.split(" holds map ").nth(1)?.split(',').next())
        .collect();
    assert_eq!(maps.len(), 1, "they tell each other what they see");
    assert!(!outcome.finished);
}

#[test]
fn what_vehicles_have_seen_is_told_although_the_ground_station_is_dead_or_off_the_bus() {
    let seen = |faults: &str| {
        let explored = Place::new(8.0, 8.0)
            .block((4.0, 4.0, 1.0, 1.0))
            .root("end = \"hold\"\nuntil_s = 2000.0")
            .with(&format!("[mission]\nkind = \"explore\"\n{faults}"))
            .run_safely();
        visible::occupied(&explored.map, SLICE)
    };
    let ground = |kind: &str| format!("[[fault]]\nkind = \"{kind}\"\nat_s = 5.0\nground = true\n");
    let by_all = seen("");
    assert!(by_all > 10, "{by_all}");
    assert_eq!(seen(&ground("dead")), by_all);
    let apart = seen(&ground("bus"));
    assert!(10 * apart > 8 * by_all, "{apart} of {by_all}");
}

#[test]
fn the_others_end_the_sweep_of_a_vehicle_that_is_lost() {
    for seed in 1..4 {
        let outcome = place(3, "until_s = 3000.0", &fault("dead", "vehicles = [2]"))
            .seed(seed)
            .run_safely();
        assert!(
            outcome.log.contains("ground has lost vehicle 2"),
            "{}",
            crate::place::tail(&outcome.log)
        );
        assert!(
            outcome.finished,
            "{:?}: {}",
            outcome.failure,
            crate::place::tail(&outcome.log)
        );
    }
}

#[test]
fn a_vehicle_that_comes_back_gets_work_again() {
    let outcome = place(
        3,
        "until_s = 3000.0",
        &fault("restart", "until_s = 190.0\nvehicles = [2]"),
    )
    .run_to_the_end();
    let log = &outcome.log;
    assert!(
        log.contains("ground has lost vehicle 2") && log.contains("ground hears vehicle 2 again"),
        "{}",
        crate::place::tail(log)
    );
    let back = log
        .split("its software starts, boot 2")
        .nth(1)
        .unwrap_or_default();
    assert!(
        back.contains("vehicle 2 has done stop "),
        "it does stops again"
    );
    assert_settled(&outcome);
}

#[test]
fn nobody_touches_a_vehicle_that_is_dead_blind_or_goes_home_with_an_empty_battery() {
    let dead = place(3, "until_s = 400.0", &fault("dead", "vehicles = [2]")).run_safely();
    assert!(dead.log.contains("does not hear vehicle 2: "));
    place(3, "until_s = 400.0", &fault("sensor", "vehicles = [1]")).run_safely();
    let low = place(
        3,
        "until_s = 400.0",
        &fault("battery", "charge = 0.15\nvehicles = [1]"),
    )
    .run_safely();
    assert!(
        low.log.contains("vehicle 1 is home"),
        "{}",
        crate::place::tail(&low.log)
    );
    let empty = place(
        3,
        "until_s = 400.0",
        &fault("battery", "charge = 0.04\nvehicles = [1]"),
    )
    .run_safely();
    assert!(
        empty
            .log
            .contains("vehicle 1 holds by itself: the battery is nearly empty")
    );
    assert!(!empty.log.contains("vehicle 1 is home"));
}

#[test]
fn without_any_radio_a_sweep_is_driven_and_measures_nothing_more() {
    let outcome = place(2, "until_s = 2000.0", &fault("radio", "vehicles = [1]")).run_to_the_end();
    assert_settled(&outcome);
}

#[test]
fn a_run_whose_vehicles_are_gone_for_good_ends_and_one_that_is_back_soon_goes_on() {
    let dead = fault("dead", "vehicles = [2]");
    let outcome = place(2, "until_s = 3000.0", &dead).run_safely();
    let why = outcome.failure.as_deref().unwrap_or_default();
    assert!(why.contains("too few"), "{why}");
    assert!(outcome.simulated.as_secs_f64() < 100.0);
    let restarts = fault("restart", "vehicles = [1, 2]");
    place(2, "until_s = 3000.0", &restarts).run_to_the_end();
}

#[test]
fn nobody_waits_for_ever_for_vehicles_that_the_bus_never_reaches_again() {
    let cut = fault("bus", "vehicles = [1]");
    // It begins anew, so that it does not give up for the bus itself.
    let restarts = fault("restart", "vehicles = [1]");
    let mission = "[mission]\nkind = \"explore\"";
    for (vehicles, more, heard) in [(2, "", "1 of 2"), (1, mission, "0 of 1")] {
        let faults = format!("{more}\n{cut}{restarts}");
        let outcome = place(vehicles, "until_s = 5000.0", &faults).run_safely();
        let why = outcome.failure.as_deref().unwrap_or_default();
        assert!(
            why.starts_with(&format!("{heard} vehicles were heard within 900 s")),
            "{why}"
        );
        assert!(outcome.simulated.as_secs_f64() < 1100.0);
    }
}

#[test]
fn who_dies_with_its_mission_under_way_is_not_waited_for_whenever_it_dies() {
    // Without a place vehicle 2 stands until its software ends; the other one is home after half a minute.
    let mission = "[mission]\nkind = \"forward\"\ndistance_m = 2.0\n";
    for at_s in [5.0, 80.0] {
        let gone = format!(
            "[[fault]]\nkind = \"gps\"\nat_s = 0.0\nvehicles = [2]\n\
             [[fault]]\nkind = \"dead\"\nat_s = {at_s:?}\nvehicles = [2]\n"
        );
        let place = place(2, "until_s = 400.0", &format!("{mission}{gone}"));
        let outcome = place.run_to_the_end();
        assert_eq!(outcome.missions[1].1, None, "dead at {at_s} s");
        assert!(outcome.missions[0].1.is_some());
    }
}

#[test]
fn a_run_that_is_given_up_on_the_way_home_has_not_finished() {
    let mission = "[mission]\nkind = \"forward\"\ndistance_m = 4.0\n[safety]\nautonomy_s = 600.0\n";
    let run = |until_s: f64| place(1, &format!("until_s = {until_s:?}"), mission).run_safely();
    let whole = run(400.0);
    assert!(whole.finished, "{:?}", whole.failure);
    let (ended_at, _) = whole.missions[0].1.clone().expect("it ends");
    let (ended_s, home_s) = (ended_at.as_secs_f64(), whole.simulated.as_secs_f64());
    assert!(home_s > ended_s + 2.0, "{ended_s} {home_s}");
    let cut = run(ended_s + 1.0);
    assert!(cut.missions[0].1.is_some() && !cut.finished);
    let why = cut.failure.unwrap_or_default();
    assert!(
        why.starts_with("vehicles at home: only 0 of 1 when the run was given up"),
        "{why}"
    );
}
