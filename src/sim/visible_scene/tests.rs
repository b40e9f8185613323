//! A yard with a wall, and what is made of places on both sides of it.

use super::*;
use crate::config;
use crate::geom::Point;

const VENUE: &str = "kind = \"venue\"\nname = \"yard\"\narea_m = [0.0, 0.0, 8.0, 4.0]\n\
    fence_m = [[-2.0, -2.0], [10.0, -2.0], [10.0, 6.0], [-2.0, 6.0]]\nhomes_m = [[-1.0, 2.0], [9.0, 2.0]]\n\
    [datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n";

/// A wall across the yard with a door of a width in the middle, and things; the rovers' place is known to 2 cm.
fn found(door_m: f64, things: &str, vehicles: &str) -> VisibleScene {
    let vehicles = format!("pose_sd_m = 0.02\n{vehicles}");
    found_in(VENUE, (door_m, things), &vehicles)
}

fn found_in(venue: &str, (door_m, things): (f64, &str), vehicles: &str) -> VisibleScene {
    let (low_m, high_m) = (2.0 - door_m / 2.0, 2.0 + door_m / 2.0);
    let scene = format!(
        "kind = \"scene\"\nname = \"yard\"\n\
         [[object]]\noutline_m = [[4.0, -3.0], [4.2, -3.0], [4.2, {low_m:?}], [4.0, {low_m:?}]]\n\
         [[object]]\noutline_m = [[4.0, {high_m:?}], [4.2, {high_m:?}], [4.2, 7.0], [4.0, 7.0]]\n{things}"
    );
    let sim = format!(
        "kind = \"sim\"\nvenue = \"venue.toml\"\nscene = \"scene.toml\"\n\
         [mission]\nkind = \"explore\"\n[vehicles]\ncount = 2\n{vehicles}"
    );
    let mut loader = |name: &str| match name {
        "venue.toml" => Ok(venue.to_owned()),
        "scene.toml" => Ok(scene.clone()),
        other => Err(format!("no file {other}")),
    };
    let sim = config::read_sim("a.toml", &sim, None, &mut loader)
        .unwrap_or_else(|problems| panic!("{problems}"));
    VisibleScene::find(&Scenario::new(sim, Vec::new(), 1).unwrap()).unwrap()
}

fn place(vehicle: u8, x_m: f64, fate: PlaceFate) -> PlaceResult {
    PlaceResult {
        vehicle: VehicleId(vehicle),
        place: Point::new(x_m, 2.0),
        fate,
        was_called_no_way: fate == PlaceFate::NoWay,
    }
}

fn is_open(seen: &VisibleScene) -> bool {
    seen.is_reachable(&place(1, 7.0, PlaceFate::NotTried))
}

#[test]
fn the_room_is_the_safety_distance_two_deviations_and_three_quarters_of_a_cell() {
    // 0.25 + 0.1 + 2 × 0.02 + 0.75 × 0.2 m on each side.
    assert!(is_open(&found(1.08 + 0.06, "", "")) && !is_open(&found(1.08, "", "")));
    let wider = "[safety]\npadding_m = 0.35\n";
    assert!(is_open(&found(1.58 + 0.06, "", wider)) && !is_open(&found(1.58, "", wider)));
    let vaguer = |door_m: f64| is_open(&found_in(VENUE, (door_m, ""), "pose_sd_m = 0.1\n"));
    assert!(vaguer(1.4 + 0.06) && !vaguer(1.4));
    let coarser = VENUE.replace("[datum]", "cell_m = 0.4\n[datum]");
    let coarser = |door_m: f64| is_open(&found_in(&coarser, (door_m, ""), "pose_sd_m = 0.02\n"));
    assert!(coarser(1.38 + 0.06) && !coarser(1.38));
}

#[test]
fn a_person_stands_in_the_way_and_is_seen() {
    let person = "[[person]]\nat_m = [4.1, 2.0]\nradius_m = 0.3\n";
    let (empty, manned) = (found(1.6, "", ""), found(1.6, person, ""));
    assert!(is_open(&empty) && !is_open(&manned));
    let around = |seen: &VisibleScene| {
        let lattice = Lattice::new(0.2);
        let near = |cell: &crate::geom::Cell| {
            lattice.centre(*cell).distance_to(Point::new(4.1, 2.0)) < 0.45
        };
        seen.visible.cells.iter().filter(|cell| near(cell)).count()
    };
    assert_eq!(around(&empty), 0);
    assert!(around(&manned) >= 4, "{}", around(&manned));
}

#[test]
fn who_walks_is_not_among_what_stands_all_the_time() {
    let person = "[[person]]\nat_m = [4.1, 2.0]\nradius_m = 0.3\n";
    let clear_m = |person: &str| {
        let seen = found(1.6, person, "");
        let here = Point::new(4.1, 2.0);
        (
            seen.lasting.clearance_m(here, 0.1, 0.5),
            seen.scene.clearance_m(here, 0.1, 0.5),
        )
    };
    let (lasting_m, all_m) = clear_m(person);
    assert!(lasting_m <= 0.0 && all_m <= 0.0, "it stands: {lasting_m}");
    let (lasting_m, all_m) = clear_m(&format!("{person}path_m = [[4.1, 2.4]]\nspeed_mps = 0.5\n"));
    assert!(lasting_m > 0.5 && all_m <= 0.0, "it walks: {lasting_m}");
}

#[test]
fn only_places_that_their_own_vehicle_can_get_to_count() {
    use PlaceFate::{GivenUp, NoWay, NotTried, Visited};
    let results = [
        place(1, 1.0, Visited),
        place(1, 2.0, NoWay),
        place(1, 3.0, GivenUp),
        place(1, 0.0, NotTried),
        place(1, 7.0, NoWay),
        place(2, 7.0, NoWay),
        place(2, 8.0, Visited),
        place(2, 1.0, Visited),
        place(3, 1.0, Visited),
    ];
    let counts = found(0.5, "", "").count_places(&results);
    let (reachable, visited, false_no_way) = (6, 2, 2);
    assert_eq!(
        counts,
        PlaceCounts {
            reachable,
            visited,
            false_no_way
        }
    );
    // With the door open, the other side is theirs as well.
    let counts = found(2.0, "", "").count_places(&results);
    let (reachable, visited, false_no_way) = (8, 3, 3);
    assert_eq!(
        counts,
        PlaceCounts {
            reachable,
            visited,
            false_no_way
        }
    );
}

#[test]
fn what_was_called_unreachable_counts_even_when_it_was_visited_later() {
    let late = PlaceResult {
        was_called_no_way: true,
        ..place(1, 1.0, PlaceFate::Visited)
    };
    let counts = found(0.5, "", "").count_places(&[late]);
    assert_eq!((counts.visited, counts.false_no_way), (1, 1));
}

#[test]
fn copters_are_judged_at_their_altitude() {
    let low =
        "[[object]]\noutline_m = [[4.0, 0.0], [4.2, 0.0], [4.2, 4.0], [4.0, 4.0]]\ntop_m = 0.5\n";
    assert!(!is_open(&found(3.0, low, "")));
    assert!(is_open(&found(
        3.0,
        low,
        "kind = \"copter\"\naltitude_m = 1.5\n"
    )));
}

#[test]
fn copters_need_the_room_that_wind_takes() {
    let copter = |wind_mps: f64| {
        let vehicles = format!("kind = \"copter\"\naltitude_m = 0.5\nwind_mps = {wind_mps:?}\n");
        is_open(&found(1.5, "", &vehicles))
    };
    assert!(copter(0.0) && !copter(5.0));
}
