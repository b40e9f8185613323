//! Which paths are found on small maps that are known within 6.4 m around the datum.

use super::*;
use crate::geom::Track;
use crate::node::mission::terrain::tests::{obstacle, tiles_of};
use crate::node::tests_support::{own_state, settings};

/// All that a search looks at; it begins at (3, 0).
struct World {
    settings: VehicleSettings,
    map: Merged,
    obstacles: Vec<ReflexObstacle>,
    driven: Vec<Point>,
    is_on_track: bool,
    from: Point,
}

impl World {
    fn of(is_solid: impl Fn(f64, f64) -> bool) -> World {
        let settings = settings(1);
        let mut map = Merged::new(settings.lattice, None);
        for tile in tiles_of(is_solid) {
            map.join(&tile).unwrap();
        }
        World {
            settings,
            map,
            obstacles: Vec::new(),
            driven: Vec::new(),
            is_on_track: false,
            from: Point::new(3.0, 0.0),
        }
    }

    fn search(&self) -> PathSearch<'_> {
        PathSearch {
            settings: &self.settings,
            map: &self.map,
            obstacles: self.obstacles.clone(),
            driven: &self.driven,
            is_on_track: self.is_on_track,
            pose: own_state(self.from.x_m, self.from.y_m).pose,
        }
    }
}

const HOME: Point = Point::new(0.0, 0.0);

/// A wall across all that is known, between start and home.
fn is_wall(x_m: f64, _: f64) -> bool {
    (1.4..1.8).contains(&x_m)
}

/// The same wall with a gap of 0.6 m, in which there is room for the body and not for its padding.
fn is_wall_with_gap(x_m: f64, y_m: f64) -> bool {
    is_wall(x_m, y_m) && !(0.0..0.6).contains(&y_m)
}

#[test]
fn a_home_that_something_is_taken_for_standing_beside_by_now_is_come_to_over_the_own_track() {
    for is_on_track in [true, false] {
        let mut world =
            World::of(|x_m, y_m| (-0.4..0.0).contains(&x_m) && (0.2..0.6).contains(&y_m));
        world.is_on_track = is_on_track;
        assert_eq!(world.search().driven_path(HOME, &[]), None, "not driven");
        world.driven = (0..=15)
            .map(|step| Point::new(0.2 * f64::from(step), 0.0))
            .collect();
        let path = world.search().driven_path(HOME, &[]).unwrap();
        let end = path.last().unwrap().distance_to(HOME);
        assert!(end <= HOME_M, "{path:?}");
        let beside = Point::new(0.0, 0.1);
        assert_eq!(world.search().driven_path(beside, &[]), None, "no home");
    }
}

#[test]
fn no_way_home_ends_beside_it_where_the_vehicle_would_arrive_without_having_come_home() {
    let mut world = World::of(|x_m, y_m| (-0.4..0.0).contains(&x_m) && (0.2..0.6).contains(&y_m));
    world.driven = (0..=15)
        .map(|step| Point::new(0.2 * f64::from(step), 0.0))
        .collect();
    let mut ends = |from_m: f64| {
        world.from = Point::new(from_m, 0.0);
        world
            .search()
            .driven_path(HOME, &[])
            .map(|path| path[path.len() - 1])
    };
    let beside = ends(3.0).unwrap();
    assert!(beside.distance_to(HOME) > 0.1);
    assert_eq!(ends(beside.x_m + ARRIVED_M - 0.01), None);
    assert!(ends(beside.x_m + ARRIVED_M + 0.05).is_some());
}

#[test]
fn only_unknown_ground_leads_around_a_wall_and_the_way_home_may_be_the_long_way_round() {
    let world = World::of(is_wall);
    assert_eq!(world.search().path(HOME, false, &[]), None);
    let around = world.search().path(HOME, true, &[]).unwrap();
    assert!(around.iter().any(|corner| corner.y_m > 6.4), "{around:?}");
    let elsewhere = Point::new(0.0, -1.0);
    assert_eq!(
        world.search().path(elsewhere, true, &[]),
        None,
        "any other way is searched near by"
    );
}

#[test]
fn a_gap_too_narrow_for_the_padding_is_open_to_a_vehicle_that_came_through_it() {
    let mut world = World::of(is_wall_with_gap);
    assert_eq!(world.search().path(HOME, false, &[]), None);
    assert_eq!(world.search().driven_path(HOME, &[]), None);
    world.driven = vec![Point::new(0.5, 0.3), Point::new(3.0, 0.3)];
    assert_eq!(world.search().path(HOME, false, &[]), None);
    assert!(world.search().driven_path(HOME, &[]).is_some());
    let peer = vec![vec![Point::new(1.6, 0.3)]];
    assert_eq!(
        world.search().driven_path(HOME, &peer),
        None,
        "a peer is in it"
    );
}

#[test]
fn a_path_keeps_clear_of_a_peer_and_of_all_of_the_way_that_it_claims() {
    let world = World::of(|_, _| false);
    let separation_m = world.settings.swarm.separation_m;
    let claim = [Point::new(1.5, -1.0), Point::new(1.5, 1.0)];
    let path = world.search().path(HOME, false, &[claim.to_vec()]).unwrap();
    let (path, claim) = (
        Track::new(path).unwrap(),
        Track::new(claim.to_vec()).unwrap(),
    );
    assert!(path.distance_to(&claim) >= separation_m);
}

#[test]
fn a_vehicle_too_near_to_a_peer_may_leave_it_and_not_pass_it() {
    let mut world = World::of(|_, _| false);
    world.from = Point::new(0.9, 0.0);
    let peer = vec![vec![HOME]];
    let (away, past) = (Point::new(4.0, 0.0), Point::new(-4.0, 0.0));
    assert!(world.search().path(away, false, &peer).is_some());
    let around = world.search().path(past, false, &peer);
    let comes_nearer = around.is_some_and(|path| {
        path.windows(2)
            .any(|pair| Segment::new(pair[0], pair[1]).distance_to_point(HOME) < 0.899)
    });
    assert!(!comes_nearer);
}

#[test]
fn what_the_reflex_met_is_gone_around_and_hems_in_a_vehicle_that_is_near() {
    let mut world = World::of(|_, _| false);
    let straight = world.search().path(HOME, false, &[]).unwrap();
    world.obstacles = vec![obstacle(1.5, 0.0)];
    let around = world.search().path(HOME, false, &[]).unwrap();
    let nearest_m = |path: &[Point]| {
        let pieces = path.windows(2).map(|pair| Segment::new(pair[0], pair[1]));
        pieces
            .map(|piece| piece.distance_to_point(Point::new(1.5, 0.0)))
            .fold(f64::INFINITY, f64::min)
    };
    assert!(nearest_m(&straight) < 0.5 && nearest_m(&around) >= 0.5);
    let search = world.search();
    assert!(!search.hems_in(search.from()) && search.hems_in(Point::new(2.3, 0.0)));
}

#[test]
fn who_is_hemmed_in_goes_back_over_its_track_to_where_its_home_can_be_reached_from() {
    let mut world = World::of(is_wall_with_gap);
    world.from = Point::new(3.0, 0.3);
    assert_eq!(world.search().back_to_open(&[]), None, "no track");
    world.driven = (0..=15)
        .map(|step| Point::new(0.2 * f64::from(step), 0.3))
        .collect();
    let back = world.search().back_to_open(&[]).unwrap();
    assert_eq!(back[0], world.from);
    let end = *back.last().unwrap();
    assert!(
        (0.5..1.1).contains(&end.x_m),
        "just before the gap: {end:?}"
    );
    world.from = end;
    assert_eq!(world.search().back_to_open(&[]), None, "it is there");
}

#[test]
fn a_track_that_lies_too_near_to_the_fence_is_gone_back_over_beside_it() {
    let mut world = World::of(|_, _| false);
    // The fence is at −5; 0.4 m are kept from it.
    world.from = Point::new(3.0, -4.65);
    let track = |y_m: f64| vec![world.from, Point::new(2.0, y_m), Point::new(1.0, -4.0)];
    let moved = world.search().moved_off_fence(track(-4.7)).unwrap();
    assert_eq!((moved[0], moved[2]), (world.from, Point::new(1.0, -4.0)));
    assert_eq!(moved[1].x_m, 2.0);
    assert!((-4.6..-4.58).contains(&moved[1].y_m), "{moved:?}");
    assert_eq!(
        world.search().moved_off_fence(track(-4.5)),
        Some(track(-4.5))
    );
    let from = world.from;
    let mut world = World::of(|x_m, y_m| (1.8..2.2).contains(&x_m) && (-4.4..-4.2).contains(&y_m));
    world.from = from;
    assert_eq!(
        world.search().moved_off_fence(track(-4.7)),
        None,
        "no room beside it"
    );
}

#[test]
fn a_goal_near_the_fence_is_reached_and_nothing_else_comes_that_near() {
    let mut world = World::of(|_, _| false);
    // The fence is at −5; so near to it no path leads through on the way elsewhere.
    let near = Point::new(3.0, -4.5);
    assert!(world.search().path(near, false, &[]).is_some());
    assert_eq!(world.search().path(Point::new(3.0, -5.5), false, &[]), None);
    world.from = near;
    let out = world.search().path(HOME, false, &[]);
    assert!(out.is_some(), "it may leave");
    let deep = own_state(3.0, 0.0);
    let search = World::of(|_, _| false);
    let wished_m = keep_m(&search.settings, deep.pose);
    let fence_m = |goal| search.search().fence_m(wished_m, goal);
    assert!(fence_m(Some(near)) < fence_m(Some(HOME)));
    assert_eq!(fence_m(None), wished_m);
    // Wherever a goal lies that keeps body and 3 σ, it is reached, and nothing comes nearer than that.
    let least_m = search.settings.reach_m() + 3.0 * deep.pose.sd_m;
    let mut world = World::of(|_, _| false);
    for step in 0..40 {
        let goal = Point::new(
            3.0 + 0.013 * f64::from(step),
            -5.0 + least_m + 0.01 * f64::from(step),
        );
        assert!(fence_m(Some(goal)) >= least_m, "{goal:?}");
        world.from = Point::new(2.0, -2.0);
        let path = world.search().path(goal, false, &[]).expect("a path");
        let fence = &world.settings.fence;
        let keeps = |pair: &[Point]| {
            fence.contains_corridor(Segment::new(pair[0], pair[1]), least_m - 1e-6)
        };
        assert!(path.windows(2).all(keeps), "{goal:?}: {path:?}");
    }
}

#[test]
fn a_vehicle_is_cut_off_by_what_its_reflex_met_in_a_doorway_and_not_by_what_it_met_beside_one() {
    let is_wall_with_door = |x_m: f64, y_m: f64| is_wall(x_m, y_m) && !(-1.0..1.0).contains(&y_m);
    let mut world = World::of(is_wall_with_door);
    assert!(!world.search().is_cut_off(&[]));
    world.obstacles = vec![obstacle(3.0, 3.0)];
    assert!(!world.search().is_cut_off(&[]));
    world.obstacles = vec![obstacle(1.6, 0.4), obstacle(1.6, -0.4)];
    assert!(world.search().is_cut_off(&[]));
}
