//! Random floor plans, explored and with a place to visit in each room: what they are like, that the judge of places agrees
//! with a plain search, and a sample of runs. Many more, with a table: `cargo bench --bench floor_plans -- 200`.

use std::collections::BTreeSet;

use tomoswarm::geom::{Cell, Lattice};
use tomoswarm::map::Merged;
use tomoswarm::sim::{PlaceCounts, PlaceFate, PlaceResult, RunView, VisibleScene};
use tomoswarm_proto::VehicleId;

use crate::plan::{Demand, FloorPlan, POSE_SD_M, Thing};
use crate::trial::{self, TrialMission, TrialResult, demand_in_turn, rooms_entered, table};

/// Thinner poles are driven into today.
const THINNEST_M: f64 = 0.05;

fn plan(seed: u64) -> FloorPlan {
    FloorPlan::draw(seed, demand_in_turn(seed, THINNEST_M))
}

#[test]
fn plans_are_as_they_are_described() {
    let mut offsets = BTreeSet::new();
    for seed in 0..24 {
        let plan = plan(seed);
        let door_m = plan.demand.door_m();
        assert!((4..=6).contains(&plan.rooms.len()));
        assert_eq!(plan.places.len(), plan.rooms.len());
        for (room, place) in plan.rooms.iter().zip(&plan.places) {
            let is_long = |metres: f64| (3.199..=6.001).contains(&metres);
            assert!(
                is_long(room.width_m()) && is_long(room.height_m()),
                "{room:?}"
            );
            assert!(room.contains(*place));
        }
        assert!(plan.rooms.iter().any(|room| room.contains(plan.home)));
        assert!(plan.doors.len() >= plan.rooms.len() - 1);
        for door in &plan.doors {
            let is_gap = plan.clearance_m(door.at) - door_m / 2.0;
            assert!(is_gap.abs() < 2e-3, "plan {seed}: {door:?}, {is_gap}");
            let [before, beyond] = door.rooms.map(|number| plan.rooms[number]);
            let (along_m, across_m) = if door.is_along_x {
                let across_m = beyond.min.x_m - before.max.x_m;
                (door.at.y_m - before.min.y_m, across_m)
            } else {
                let across_m = beyond.min.y_m - before.max.y_m;
                (door.at.x_m - before.min.x_m, across_m)
            };
            assert!((0.099..=0.201).contains(&across_m), "{across_m}");
            assert!(along_m > door_m / 2.0);
            offsets.insert(((along_m - door_m / 2.0) * 1000.0).round() as i64);
        }
        let is_thick = |thing: &Thing| match thing {
            Thing::Pole(_, radius_m) => (THINNEST_M..=0.1).contains(radius_m),
            Thing::Block(_) => true,
        };
        assert!(plan.things.iter().all(is_thick));
        assert!(plan.is_open(door_m / 2.0 - 0.05), "plan {seed}");
        assert!(!plan.is_open(door_m / 2.0 + 0.01), "plan {seed}");
    }
    assert!(
        offsets.len() > 40,
        "doors are anywhere in their walls: {offsets:?}"
    );
}

#[test]
fn a_seed_gives_the_same_plan_again_and_every_distance_and_door_has_its_turn() {
    assert_eq!(plan(5).files(), plan(5).files());
    assert_ne!(plan(5).rooms, plan(17).rooms);
    let demands: BTreeSet<String> = (0..12)
        .map(|seed| format!("{:?}", plan(seed).demand))
        .collect();
    assert_eq!(demands.len(), 12);
    let poles = (0..24).flat_map(|seed| FloorPlan::draw(seed, demand_in_turn(seed, 0.01)).things);
    let thin = poles.filter(|thing| matches!(thing, Thing::Pole(_, radius_m) if *radius_m < 0.05));
    assert!(thin.count() > 5);
}

/// Returns a plan with bare rooms whose doors are so much wider than the least, and to which of its places a vehicle can get
/// by the judge.
fn judged(seed: u64, extra_m: f64) -> (FloorPlan, Vec<bool>) {
    let demand = Demand {
        extra_m,
        ..demand_in_turn(seed, 0.01)
    };
    let mut plan = FloorPlan::draw(seed, demand);
    plan.things.clear();
    let seen = VisibleScene::find(&trial::scenario(&plan, TrialMission::Pathfind)).unwrap();
    let of = |place| PlaceResult {
        vehicle: VehicleId(1),
        place,
        fate: PlaceFate::NotTried,
        was_called_no_way: false,
    };
    let reachable = plan
        .places
        .iter()
        .map(|place| seen.is_reachable(&of(*place)));
    let reachable = reachable.collect();
    (plan, reachable)
}

#[test]
fn the_judge_of_places_agrees_with_a_plain_search() {
    for seed in 0..6 {
        // With cells of 0.2 m the judge wants 0.3 m more than twice the distance and two deviations.
        let (plan, reachable) = judged(seed, 0.4);
        let keep_m = plan.demand.distance_m + 2.0 * POSE_SD_M + 0.15;
        assert!(
            plan.is_open(keep_m) && reachable.iter().all(|is| *is),
            "plan {seed}: {reachable:?}"
        );
        let (plan, reachable) = judged(seed, 0.28);
        let home = plan
            .rooms
            .iter()
            .position(|room| room.contains(plan.home))
            .unwrap();
        let expected: Vec<bool> = (0..plan.rooms.len()).map(|room| room == home).collect();
        assert_eq!(reachable, expected, "plan {seed}");
    }
}

/// What holds today of a plan for every distance and door: nobody touches anything, and every mission ends.
fn run_all(mission: TrialMission) -> Vec<TrialResult> {
    let run = |seed: u64| {
        let result = trial::run(&plan(seed), mission);
        let mishaps = (result.collisions, result.fence_breaches);
        assert_eq!(mishaps, (0, 0), "plan {seed}");
        assert!(result.end.is_some(), "plan {seed}");
        assert!((1..=result.rooms).contains(&result.entered), "{result:?}");
        assert!(result.share > 0.0 && result.share <= 1.0, "{result:?}");
        result
    };
    (0..12).map(run).collect()
}

#[test]
fn exploring_floor_plans_is_safe_and_ends() {
    let results = run_all(TrialMission::Explore);
    assert!(
        results
            .iter()
            .all(|result| result.places == PlaceCounts::default())
    );
}

#[test]
fn visiting_a_place_in_each_room_is_safe_and_ends_and_is_judged() {
    for result in run_all(TrialMission::Pathfind) {
        let PlaceCounts {
            reachable,
            visited,
            false_no_way,
        } = result.places;
        assert!(
            visited + false_no_way <= reachable && false_no_way <= result.no_way,
            "{result:?}"
        );
        if result.demand.extra_m > 0.35 {
            assert_eq!(reachable, result.rooms, "{result:?}");
        }
    }
}

#[test]
fn all_rooms_can_be_seen_whatever_room_a_map_of_cells_leaves_at_the_doors() {
    for seed in [0, 5, 10] {
        let plan = plan(seed);
        let scenario = trial::scenario(&plan, TrialMission::Explore);
        let seen = VisibleScene::find(&scenario).unwrap();
        let all = trial::visible_from_all_rooms(&plan, &scenario, &seen);
        let lattice = Lattice::new(0.2);
        for room in &plan.rooms {
            let inside = |cell: &&Cell| room.shrunk(-0.2).contains(lattice.centre(**cell));
            let sides = all.iter().filter(inside).count();
            assert!(sides > 20, "plan {seed}: {sides} cells of {room:?}");
        }
    }
}

#[test]
fn a_room_is_entered_by_the_track_or_by_what_the_map_knows_and_not_by_itself() {
    let plan = plan(8);
    let (scenario, mut shown) = (trial::scenario(&plan, TrialMission::Explore), 0);
    let mut for_a_while = |_: &RunView<'_>| {
        shown += 1;
        shown < 400
    };
    let mut outcome = scenario.run(&mut for_a_while).unwrap();
    let entered = rooms_entered(&plan, &outcome);
    assert!(entered >= 1);
    let tracks = std::mem::take(&mut outcome.tracks);
    let known = rooms_entered(&plan, &outcome);
    assert!((1..=entered).contains(&known), "by the map alone");
    outcome.map = Merged::new(Lattice::new(0.2), None);
    assert_eq!(rooms_entered(&plan, &outcome), 0);
    outcome.tracks = tracks;
    let driven = rooms_entered(&plan, &outcome);
    assert!((1..=entered).contains(&driven), "by the track alone");
}

#[test]
fn the_table_has_a_line_for_each_mission_distance_and_door() {
    let result = |seed: u64, share: f64, no_way: usize| TrialResult {
        seed,
        mission: TrialMission::Pathfind,
        demand: demand_in_turn(seed, THINNEST_M),
        rooms: 4,
        entered: 3,
        share,
        places: PlaceCounts {
            reachable: 4,
            visited: 4 - no_way,
            false_no_way: no_way,
        },
        no_way,
        collisions: 2 * no_way,
        fence_breaches: 0,
        end: (no_way == 0).then(|| "did everything".to_owned()),
        simulated_s: 100.0,
        took_s: 0.5,
    };
    let results = [
        result(1, 0.5, 1),
        result(13, 0.9, 0),
        result(25, 1.0, 0),
        result(2, 1.0, 0),
    ];
    let text = table(&results);
    let lines: Vec<Vec<&str>> = text
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect();
    assert_eq!(lines.len(), 3);
    let first = [
        "pathfind", "0.35", "0.2", "3", "12", "75.0", "50.0", "90.0", "1", "12", "91.7", "1", "1",
        "1", "1", "100", "0.50",
    ];
    assert_eq!(lines[1], first);
    assert_eq!(lines[2][..4], ["pathfind", "0.60", "0.2", "1"]);
}
