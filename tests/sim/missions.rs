//! Missions that no ground station plans, told as stories: they end, nobody is touched, and they have done what they
//! are for.

use std::time::Duration;

use tomoswarm::geom::{Cell, Point};
use tomoswarm::map::{CellRect, Occupancy};
use tomoswarm::node::mission::{EndReason, Obstruction, ObstructionKind};
use tomoswarm::node::vehicle::CommandRefusal;
use tomoswarm::sim::{PlaceFate, RunOutcome};
use tomoswarm::time::Time;

use super::place::{Place, tail};

/// A small yard with nothing in it but what a story adds; one rover that is home at the end.
fn yard(mission: &str) -> Place {
    Place::new(8.0, 8.0)
        .vehicles(1)
        .root("end = \"return\"\nuntil_s = 3600.0")
        .with(&format!("[mission]\n{mission}"))
}

fn end_of(outcome: &RunOutcome, vehicle: usize) -> &EndReason {
    let (_, end) = &outcome.missions[vehicle - 1];
    &end.as_ref().expect("every mission ends").1
}

/// How near the true track of a vehicle comes to a place, metres.
fn nearest_m(outcome: &RunOutcome, vehicle: usize, place: (f64, f64)) -> f64 {
    let place = Point::new(place.0, place.1);
    outcome.tracks[vehicle - 1]
        .1
        .iter()
        .map(|at| at.distance_to(place))
        .fold(f64::INFINITY, f64::min)
}

/// Where vehicle 1 was at a time that the log says it at.
fn place_at(outcome: &RunOutcome, at_s: f64) -> Point {
    let begins = format!("{at_s:.3} vehicle 1 at ");
    let line = outcome
        .log
        .lines()
        .find_map(|line| line.strip_prefix(&begins));
    let place = line.and_then(|line| line.split_once(' ')?.0.split_once(','));
    let (x_m, y_m) = place.expect("a place in the log");
    Point::new(x_m.parse().unwrap(), y_m.parse().unwrap())
}

fn occupancy(outcome: &RunOutcome, at: (f64, f64)) -> Occupancy {
    outcome
        .map
        .occupancy(0, outcome.map.lattice().cell_at(Point::new(at.0, at.1)))
}

#[test]
fn a_square_over_open_ground_is_driven_to_its_end() {
    let outcome = yard("kind = \"square\"\nsize_m = 6.0").run_to_the_end();
    assert_eq!(end_of(&outcome, 1), &EndReason::Done);
    for corner in [(1.0, 7.0), (7.0, 7.0), (7.0, 1.0), (1.0, 1.0)] {
        assert!(nearest_m(&outcome, 1, corner) < 0.4, "{corner:?}");
    }
    assert_eq!(outcome.home, 1);
}

#[test]
fn a_square_ends_in_front_of_what_stands_on_it_and_not_in_it() {
    let outcome = yard("kind = \"square\"\nsize_m = 6.0")
        .block((4.0, 7.0, 1.0, 1.0))
        .run_to_the_end();
    let EndReason::Stopped(Obstruction { at, kind }) = end_of(&outcome, 1) else {
        panic!("{:?}", end_of(&outcome, 1))
    };
    assert_eq!(*kind, ObstructionKind::Obstacle);
    assert!(
        (at.x_m - 3.5).abs() < 0.4 && (at.y_m - 7.0).abs() < 0.8,
        "{at:?}"
    );
    assert!(
        nearest_m(&outcome, 1, (7.0, 7.0)) > 3.0,
        "it goes no further"
    );
    assert_eq!(outcome.home, 1);
}

#[test]
fn forward_goes_as_far_as_it_is_told_or_until_something_stands_there() {
    let heading = std::f64::consts::FRAC_1_SQRT_2;
    let free = yard("kind = \"forward\"\ndistance_m = 4.0").run_to_the_end();
    assert_eq!(end_of(&free, 1), &EndReason::Done);
    let goal = (-1.0 + 4.0 * heading, -1.0 + 4.0 * heading);
    assert!(nearest_m(&free, 1, goal) < 0.4);
    let barred = yard("kind = \"forward\"\ndistance_m = 4.0")
        .block((2.0, 2.0, 1.5, 1.5))
        .run_to_the_end();
    assert!(matches!(end_of(&barred, 1), EndReason::Stopped(_)));
    assert!(nearest_m(&barred, 1, goal) > 0.5);
}

#[test]
fn a_vehicle_that_may_not_leave_the_fence_says_that_it_stopped_in_front_of_it() {
    let outcome = yard("kind = \"forward\"\ndistance_m = 40.0").run_to_the_end();
    let EndReason::Stopped(Obstruction { at, kind }) = end_of(&outcome, 1) else {
        panic!("{:?}", end_of(&outcome, 1))
    };
    assert_eq!(*kind, ObstructionKind::Refusal(CommandRefusal::Fence));
    assert!(
        nearest_m(&outcome, 1, (at.x_m, at.y_m)) < 0.1,
        "there it stands: {at:?}"
    );
}

#[test]
fn browse_sees_all_around_without_leaving_its_place() {
    let outcome = yard("kind = \"browse\"")
        .home(1, (4.0, 4.0))
        .block((6.0, 4.0, 0.4, 2.0))
        .run_to_the_end();
    assert_eq!(end_of(&outcome, 1), &EndReason::Done);
    assert!(
        outcome.tracks[0]
            .1
            .iter()
            .all(|at| at.distance_to(Point::new(4.0, 4.0)) < 0.3)
    );
    for at in [(2.2, 4.0), (4.0, 5.8), (4.0, 2.2), (5.4, 4.0)] {
        assert_eq!(occupancy(&outcome, at), Occupancy::Free, "{at:?}");
    }
    // Its surface lies on the border between two columns of cells.
    let wall = (0..6).map(|step| 3.5 + 0.2 * f64::from(step));
    let is_seen = |y_m: &f64| {
        [5.7, 5.9]
            .iter()
            .any(|x_m| occupancy(&outcome, (*x_m, *y_m)) == Occupancy::Occupied)
    };
    assert!(wall.filter(is_seen).count() >= 3);
}

#[test]
fn pathfind_visits_places_behind_a_wall() {
    let places = "kind = \"pathfind\"\nwaypoints_m = [[4.0, 6.5], [7.0, 1.0]]";
    let outcome = yard(places).block((4.0, 4.0, 7.0, 0.4)).run_to_the_end();
    assert_eq!(end_of(&outcome, 1), &EndReason::Done);
    assert!(nearest_m(&outcome, 1, (4.0, 6.5)) < 0.4 && nearest_m(&outcome, 1, (7.0, 1.0)) < 0.4);
}

#[test]
fn pathfind_proves_that_no_way_leads_into_a_closed_room_and_visits_the_rest() {
    let places = "kind = \"pathfind\"\nwaypoints_m = [[4.0, 4.0], [7.0, 7.5]]";
    let room = [
        (4.0, 2.5, 3.4, 0.4),
        (4.0, 5.5, 3.4, 0.4),
        (2.5, 4.0, 0.4, 3.4),
        (5.5, 4.0, 0.4, 3.4),
    ];
    let outcome = room
        .into_iter()
        .fold(yard(places), Place::block)
        .run_to_the_end();
    assert_eq!(end_of(&outcome, 1), &EndReason::NoWay(1));
    assert!(nearest_m(&outcome, 1, (7.0, 7.5)) < 0.4);
    assert!(outcome.log.contains("has found no way to "));
    let fates: Vec<PlaceFate> = outcome.places.iter().map(|place| place.fate).collect();
    assert_eq!(fates, [PlaceFate::NoWay, PlaceFate::Visited]);
}

#[test]
fn what_vehicles_visit_is_shared_among_them() {
    let places =
        "kind = \"pathfind\"\nwaypoints_m = [[1.0, 7.0], [7.0, 1.0], [2.0, 4.0], [6.0, 4.0]]";
    let outcome = yard(places).vehicles(2).run_to_the_end();
    assert_eq!((visits(&outcome, 1), visits(&outcome, 2)), (2, 2));
    assert_eq!(outcome.home, 2);
    // What the outcome tells of each place is what its own vehicle says.
    let told: Vec<(u8, f64, PlaceFate)> = outcome
        .places
        .iter()
        .map(|place| (place.vehicle.0, place.place.x_m, place.fate))
        .collect();
    let visited = |vehicle, x_m| (vehicle, x_m, PlaceFate::Visited);
    let whole = [
        visited(1, 1.0),
        visited(1, 2.0),
        visited(2, 7.0),
        visited(2, 6.0),
    ];
    assert_eq!(told, whole);
}

fn visits(outcome: &RunOutcome, vehicle: usize) -> usize {
    let who = format!("vehicle {vehicle} has visited ");
    outcome
        .log
        .lines()
        .filter(|line| line.contains(&who))
        .count()
}

#[test]
fn patrol_goes_round_behind_a_wall_as_often_as_it_is_told() {
    let places = "kind = \"patrol\"\nrounds = 3\nwaypoints_m = [[4.0, 6.5], [7.0, 1.0]]";
    let outcome = yard(places).block((4.0, 4.0, 7.0, 0.4)).run_to_the_end();
    assert_eq!(
        (end_of(&outcome, 1), visits(&outcome, 1), outcome.home),
        (&EndReason::Done, 6, 1)
    );
}

#[test]
fn patrol_of_two_begins_at_different_places_and_each_goes_to_all() {
    let places = "kind = \"patrol\"\nrounds = 1\nwaypoints_m = [[2, 2], [6, 2], [6, 6], [2, 6]]";
    let outcome = yard(places).vehicles(2).run_to_the_end();
    assert_eq!(
        (visits(&outcome, 1), visits(&outcome, 2), outcome.home),
        (4, 4, 2)
    );
    assert_eq!(
        (end_of(&outcome, 1), end_of(&outcome, 2)),
        (&EndReason::Done, &EndReason::Done)
    );
}

#[test]
fn patrol_ends_when_its_time_is_over_or_its_battery_low() {
    let places = "kind = \"patrol\"\nrounds = 0\nwaypoints_m = [[2, 2], [6, 6]]";
    let timed = yard(&format!("{places}\nduration_s = 300")).run_to_the_end();
    assert_eq!((end_of(&timed, 1), timed.home), (&EndReason::Done, 1));
    let took = timed.simulated.since(Time::ZERO);
    assert!(
        visits(&timed, 1) > 4 && took < Duration::from_secs(420),
        "{} visits, {took:?}",
        visits(&timed, 1)
    );
    let fault = "[[fault]]\nkind = \"battery\"\nat_s = 300.0\ncharge = 0.15\nvehicles = [1]";
    let low = yard(places).with(fault).run_safely();
    assert!(
        visits(&low, 1) > 4 && low.log.contains("the battery is low"),
        "{}",
        tail(&low.log)
    );
    assert!(low.log.contains("vehicle 1 is home"), "{}", tail(&low.log));
    assert_eq!((end_of(&low, 1), low.home), (&EndReason::BatteryLow, 1));
}

#[test]
fn vehicles_that_have_ended_their_mission_and_are_to_stay_hold() {
    let held = |mission: &str, vehicles: usize| {
        Place::new(8.0, 8.0)
            .vehicles(vehicles)
            .root("end = \"hold\"\nexpect = \"held\"\nuntil_s = 3600.0")
            .with(mission)
            .run_to_the_end()
            .held
    };
    assert_eq!(held("[mission]\nkind = \"explore\"", 2), 2);
    assert_eq!(
        held("[mission]\nkind = \"forward\"\ndistance_m = 1.0", 1),
        1
    );
    assert_eq!(held("", 2), 2, "a sweep");
}

/// Cells of the yard, fence included, that a rover could see and does not know.
fn unknown_share(outcome: &RunOutcome, is_hidden: impl Fn(Point) -> bool) -> f64 {
    let lattice = outcome.map.lattice();
    let cells = (-11..51).flat_map(|y| (-11..51).map(move |x| Cell::new(x, y)));
    let seen: Vec<Cell> = cells
        .filter(|cell| !is_hidden(lattice.centre(*cell)))
        .collect();
    let unknown = seen
        .iter()
        .filter(|cell| outcome.map.occupancy(0, **cell) == Occupancy::Unknown)
        .count();
    unknown as f64 / seen.len() as f64
}

#[test]
fn explore_and_search_know_everything_that_can_be_reached() {
    let is_hidden = |at: Point| (2.8..=5.2).contains(&at.x_m) && (2.8..=5.2).contains(&at.y_m);
    for mission in ["explore", "search"] {
        let outcome = yard(&format!("kind = \"{mission}\""))
            .block((4.0, 4.0, 2.0, 2.0))
            .run_to_the_end();
        assert_eq!(end_of(&outcome, 1), &EndReason::Done, "{mission}");
        let unknown = unknown_share(&outcome, is_hidden);
        assert!(unknown < 0.03, "{mission}: {unknown}");
        // The block's sides lie on the borders of cells: those inside of them, and a cell to each side.
        let sides = (15..25).flat_map(|at| [(at, 15), (at, 24), (15, at), (24, at)]);
        let sides: Vec<Cell> = sides.map(|(x, y)| Cell::new(x, y)).collect();
        let is_seen = |cell: Cell| {
            let around = CellRect::new(
                Cell::new(cell.x - 1, cell.y - 1),
                Cell::new(cell.x + 1, cell.y + 1),
            );
            around
                .cells()
                .any(|cell| outcome.map.occupancy(0, cell) == Occupancy::Occupied)
        };
        let seen = sides.iter().filter(|at| is_seen(**at)).count();
        assert!(
            seen * 100 >= sides.len() * 90,
            "{mission}: {seen} of {}",
            sides.len()
        );
    }
}

#[test]
fn two_explorers_share_the_work() {
    let ended_s = |vehicles: usize| {
        let yard = Place::new(16.0, 16.0).root("end = \"return\"\nuntil_s = 3600.0");
        let yard = yard
            .vehicles(vehicles)
            .with("[mission]\nkind = \"explore\"")
            .block((8.0, 8.0, 4.0, 4.0));
        let outcome = yard.run_to_the_end();
        assert_eq!(outcome.home, vehicles);
        let ends = outcome.missions.iter().filter_map(|(_, end)| end.as_ref());
        ends.map(|(at, _)| at.as_secs_f64()).fold(0.0, f64::max)
    };
    let (alone_s, both_s) = (ended_s(1), ended_s(2));
    assert!(both_s < 0.75 * alone_s, "{both_s} s against {alone_s} s");
}

#[test]
fn eight_explorers_behind_one_doorway_all_come_home() {
    // Two rooms; everybody starts in the one and all that is left to see is in the other.
    for seed in 1..4 {
        let outcome = yard("kind = \"explore\"")
            .vehicles(8)
            .seed(seed)
            .block((2.6, 1.0, 0.4, 8.0))
            .block((2.6, 9.0, 0.4, 4.0))
            .run_to_the_end();
        assert_eq!(outcome.home, 8, "seed {seed}");
    }
}

#[test]
fn a_mission_is_the_same_again_with_the_same_seed() {
    let place = yard("kind = \"explore\"")
        .vehicles(2)
        .block((4.0, 4.0, 2.0, 2.0));
    assert_eq!(place.run().log, place.run().log);
    assert_ne!(place.run().log, place.seed(2).run().log);
}

#[test]
fn who_is_started_anew_under_way_is_told_its_mission_again_and_ends_it() {
    let fault = "[[fault]]\nkind = \"restart\"\nat_s = 12.0\nuntil_s = 15.0\nvehicles = [2]";
    let mission = "kind = \"pathfind\"\nwaypoints_m = [[2, 2], [6, 6], [2, 6], [6, 2]]";
    let outcome = yard(mission).vehicles(2).with(fault).run_to_the_end();
    for (vehicle, places) in [(1, [(2.0, 2.0), (2.0, 6.0)]), (2, [(6.0, 6.0), (6.0, 2.0)])] {
        assert_eq!(end_of(&outcome, vehicle), &EndReason::Done);
        assert!(
            places
                .iter()
                .all(|place| nearest_m(&outcome, vehicle, *place) < 0.5),
            "vehicle {vehicle}"
        );
    }
    assert!(
        outcome
            .log
            .contains("vehicle 2 its software starts, boot 2"),
        "{}",
        outcome.log
    );
    assert_eq!(outcome.home, 2);
}

#[test]
fn a_mission_reaches_its_vehicles_over_a_bus_that_loses_a_third() {
    for seed in 1..=8 {
        let mission = "kind = \"pathfind\"\nwaypoints_m = [[2, 2], [6, 6]]";
        let outcome = yard(mission)
            .vehicles(2)
            .seed(seed)
            .with("[bus]\ndrop_share = 0.33")
            .run_to_the_end();
        assert!(
            nearest_m(&outcome, 1, (2.0, 2.0)) < 0.5 && nearest_m(&outcome, 2, (6.0, 6.0)) < 0.5
        );
    }
}

/// An exploration whose place, or sensor, is away from 20 s on until a moment.
fn explored_without(fault: &str, until_s: f64) -> RunOutcome {
    let lines = format!("[[fault]]\nkind = \"{fault}\"\nat_s = 20.0\nuntil_s = {until_s:?}");
    yard("kind = \"explore\"").with(&lines).run_safely()
}

#[test]
fn who_does_not_know_its_place_or_sees_nothing_has_not_explored_anything() {
    for (fault, reason) in [("gps", EndReason::NoPlace), ("sensor", EndReason::Blind)] {
        let outcome = explored_without(fault, 5000.0);
        assert_eq!(end_of(&outcome, 1), &reason, "{}", tail(&outcome.log));
        let (at, _) = outcome.missions[0].1.as_ref().expect("it ends");
        assert!(
            (300.0..400.0).contains(&at.as_secs_f64()),
            "{fault}: {at} s"
        );
    }
}

/// One narrow beam proves no way free that is as wide as the vehicle.
#[test]
fn who_sees_no_way_anywhere_has_not_explored_anything() {
    for mission in ["explore", "search"] {
        let place = yard(&format!("kind = \"{mission}\""));
        let place = place
            .body("max_speed_mps = 0.1")
            .with("[range]\nbeams_deg = [0]");
        let outcome = place.run();
        let EndReason::ShutIn { unseen_percent } = end_of(&outcome, 1) else {
            panic!("{mission}: {:?}", end_of(&outcome, 1));
        };
        assert!(*unseen_percent > 80, "{mission}: {unseen_percent} %");
    }
}

#[test]
fn who_sees_no_more_stands_within_a_moment_and_comes_home_over_its_own_track() {
    let outcome = explored_without("sensor", 5000.0);
    let stands: Vec<Point> = [30.0, 100.0, 200.0, 300.0]
        .iter()
        .map(|at_s| place_at(&outcome, *at_s))
        .collect();
    assert!(
        stands.iter().all(|at| at.distance_to(stands[0]) < 0.1),
        "{stands:?}"
    );
    let track = &outcome.tracks[0].1;
    let is_there = |at: &Point| at.distance_to(stands[0]) < 0.1;
    let (out, back) = track.split_at(track.iter().position(is_there).unwrap());
    let off_m = |at: &Point| {
        let away_m = out.iter().map(|before| before.distance_to(*at));
        away_m.fold(f64::INFINITY, f64::min)
    };
    let farthest_m = back.iter().map(off_m).fold(0.0, f64::max);
    assert!(out.len() > 20 && farthest_m < 0.5, "{farthest_m} m");
    assert_eq!(outcome.home, 1, "{}", tail(&outcome.log));
}

#[test]
fn who_knows_its_place_again_or_sees_again_explores_on_to_the_end() {
    for fault in ["gps", "sensor"] {
        let outcome = explored_without(fault, 200.0);
        assert_eq!((end_of(&outcome, 1), outcome.home), (&EndReason::Done, 1));
        let (at, _) = outcome.missions[0].1.as_ref().expect("it ends");
        assert!(at.as_secs_f64() > 200.0, "{fault}: {at} s");
    }
}

/// A mission for an autopilot: places in metres from the datum (52° N, 4° E), stays, a speed, a servo, a jump.
fn stored_mission() -> String {
    // One metre in degrees there.
    let (north, east) = (1.0 / 111_258.0, 1.0 / 68_680.0);
    let go = |x_m: f64, y_m: f64, stay_s: u32| {
        let (latitude, longitude) = (52.0 + y_m * north, 4.0 + x_m * east);
        format!("3\t16\t{stay_s}\t0\t0\t0\t{latitude:.8}\t{longitude:.8}\t0")
    };
    let plain = |command: u32, parameters: &str| format!("2\t{command}\t{parameters}\t0\t0\t0");
    let items = [
        "0\t16\t0\t0\t0\t0\t52\t4\t0".to_owned(),
        plain(178, "1\t0.4\t-1\t0"),
        go(1.0, 7.0, 2),
        plain(183, "9\t1700\t0\t0"),
        go(7.0, 7.0, 0),
        plain(177, "2\t1\t0\t0"),
        go(7.0, 1.0, 0),
    ];
    let lines: Vec<String> = items
        .iter()
        .enumerate()
        .map(|(index, item)| format!("{index}\t0\t{item}\t1\n"))
        .collect();
    format!("QGC WPL 110\n{}", lines.concat())
}

fn stored_yard(from: u32) -> Place {
    Place::new(8.0, 8.0)
        .vehicles(1)
        .root("end = \"hold\"\nuntil_s = 600.0")
        .file("yard.waypoints", &stored_mission())
        .with(&format!(
            "[mission]\nkind = \"stored\"\nfile = \"yard.waypoints\"\nfrom = {from}"
        ))
}

#[test]
fn an_autopilot_carries_out_a_stored_mission_with_its_jumps_and_stays_where_it_ends() {
    let outcome = stored_yard(1).run_to_the_end();
    assert_eq!(end_of(&outcome, 1), &EndReason::Done);
    for place in [(1.0, 7.0), (7.0, 7.0), (7.0, 1.0)] {
        assert!(nearest_m(&outcome, 1, place) < 0.4, "{place:?}");
    }
    let (_, track) = &outcome.tracks[0];
    let last = track.last().unwrap();
    assert!(last.distance_to(Point::new(7.0, 1.0)) < 0.4, "{last:?}");
    let length_m: f64 = track
        .windows(2)
        .map(|pair| pair[0].distance_to(pair[1]))
        .sum();
    assert!(length_m > 30.0, "the jump leads back once: {length_m} m");
    let from_last = stored_yard(6).run_to_the_end();
    assert!(
        nearest_m(&from_last, 1, (7.0, 7.0)) > 3.0,
        "it begins with the last item"
    );
}

#[test]
fn what_stands_on_the_way_of_a_stored_mission_halts_it_and_ends_it_when_it_stays() {
    let outcome = stored_yard(1).block((4.0, 7.0, 1.0, 1.0)).run();
    super::place::assert_safe(&outcome);
    assert_eq!(
        end_of(&outcome, 1),
        &EndReason::GaveUp(2),
        "{}",
        tail(&outcome.log)
    );
}

#[test]
fn a_rover_comes_out_again_by_a_doorway_within_centimetres_of_what_it_needs() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doors/experiment.toml");
    // Searches through doors of 1 m; with these seeds the rover halted at both posts on its way out, again and again.
    for run in ["120", "125"] {
        let folder = tempfile::tempdir().unwrap();
        let ended = std::process::Command::new(env!("CARGO_BIN_EXE_tomoswarm"))
            .args(["experiment", file, "--only", run, "--out"])
            .arg(folder.path().join("out"))
            .output()
            .unwrap();
        assert!(ended.status.success(), "run {run}: {ended:?}");
    }
}

/// Runs a simulation of the folder `tests`; returns its summary and its log.
fn run_file(file: &str, seed: u32) -> (serde_json::Value, String) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let file = format!("{}/tests/{file}", env!("CARGO_MANIFEST_DIR"));
    let seed = seed.to_string();
    std::process::Command::new(env!("CARGO_BIN_EXE_tomoswarm"))
        .args(["sim", &file, "--seed", &seed, "--no-pictures", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    let text = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let summary = serde_json::from_str(&text("summary.json")).unwrap();
    (summary, text("run.log"))
}

/// The share that was seen of what can be seen.
fn seen_share(summary: &serde_json::Value) -> f64 {
    let count = |name: &str| summary[name].as_f64().unwrap();
    count("detected_cells") / count("visible_cells")
}

fn breaches(file: &str, seed: u32) -> Option<u64> {
    run_file(file, seed).0["fence_breaches"].as_u64()
}

#[test]
fn who_is_hemmed_in_leaves_no_fence_and_calls_nothing_unreachable_that_is_not() {
    // A strip of 1 m between a block and the fence: with these seeds the body left the fence.
    for seed in [4, 9, 11, 12, 18] {
        assert_eq!(
            breaches("pens/strip.sim.toml", seed),
            Some(0),
            "seed {seed}"
        );
    }
    // A room behind a corridor of 1.25 m: with these seeds it was called unreachable.
    for seed in [10, 11] {
        let (summary, log) = run_file("pens/room.sim.toml", seed);
        assert_eq!(summary["fence_breaches"].as_u64(), Some(0));
        for place in ["[17.000, 7.500]", "[17.000, 12.500]", "[2.000, 17.000]"] {
            let wrong = format!("has found no way to {place}");
            assert!(!log.contains(&wrong), "seed {seed}: {wrong}");
        }
    }
}

#[test]
fn walls_that_are_drawn_off_to_both_sides_of_a_narrow_lane_prove_nothing() {
    // With these seeds two and three places were called unreachable.
    for seed in [2, 6] {
        let (summary, log) = run_file("pens/turns.sim.toml", seed);
        assert_eq!(summary["fence_breaches"].as_u64(), Some(0));
        assert!(!log.contains("has found no way to"), "seed {seed}");
    }
}

#[test]
fn who_knows_its_place_worse_than_expected_keeps_that_from_the_fence_although_its_home_is_nearer() {
    // With these seeds the body left the fence.
    for seed in [1, 2, 3, 8] {
        assert_eq!(breaches("pens/lost.sim.toml", seed), Some(0), "seed {seed}");
    }
}

#[test]
fn explorers_see_walls_that_are_thicker_than_a_cell_from_all_sides() {
    // With these seeds less than 80 % were seen.
    for seed in [3, 7, 9, 10] {
        let (summary, log) = run_file("slabs/fine.sim.toml", seed);
        let share = seen_share(&summary);
        assert!(
            log.contains("has ended its mission: did everything"),
            "seed {seed}"
        );
        assert!(share >= 0.95, "seed {seed}: {share}");
    }
}

#[test]
fn several_explorers_keep_in_the_map_what_one_of_them_has_heard_from_near() {
    // Silence of the others, who looked along it from afar, took a slab out of the map: with these seeds 31, 38, 13 and 50 %
    // were seen.
    for seed in [1, 4, 5, 13] {
        let (summary, _) = run_file("slabs/lone.sim.toml", seed);
        let share = seen_share(&summary);
        assert!(share >= 0.9, "seed {seed}: {share}");
    }
}

/// Whether a vehicle whose mission has ended makes room for others whose missions have not.
fn steps_aside_when_done(log: &str) -> bool {
    let mut done = Vec::new();
    for line in log.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [_, "vehicle", id, what @ ..] = &words[..] else {
            continue;
        };
        match what {
            ["has", "ended", "its", "mission:", ..] => done.push(*id),
            ["steps", "aside", ..] if done.len() < 4 && done.contains(id) => return true,
            _ => {}
        }
    }
    false
}

#[test]
fn homes_in_a_dead_end_are_filled_from_its_end_whoever_has_the_lowest_id() {
    // With these seeds two vehicles stood at their homes before those of the others and locked these out.
    for seed in [4, 7, 9] {
        let (_, log) = run_file("homes/corridor.sim.toml", seed);
        for vehicle in 1..=4 {
            let is_home = format!("vehicle {vehicle} is home");
            assert!(log.contains(&is_home), "seed {seed}: {is_home}");
        }
    }
}

#[test]
fn who_is_done_makes_room_at_a_door_and_goes_home_after_those_that_it_would_bar() {
    // A home before the only door of a house, and two in it: with these seeds vehicles 2 and 3 never came home.
    for seed in [1, 2, 4] {
        let (summary, log) = run_file("homes/patrol.sim.toml", seed);
        for vehicle in 1..=4 {
            let is_home = format!("vehicle {vehicle} is home");
            assert!(log.contains(&is_home), "seed {seed}: {is_home}");
        }
        assert!(steps_aside_when_done(&log), "seed {seed}");
        assert_eq!(summary["collisions"].as_u64(), Some(0), "seed {seed}");
    }
}
