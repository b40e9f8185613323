//! Which path is chosen on small maps that are known within 6.4 m around the datum.

use tomoswarm_proto::StopId;

use super::*;
use crate::geom::Pose;
use crate::node::mission::pilot::Unknown;
use crate::node::mission::terrain::Terrain;
use crate::node::mission::terrain::tests::{obstacle, terrain_of};
use crate::node::tests_support::own_state;
use crate::time::Time;

const HOME: Point = Point::new(0.0, 0.0);

/// A vehicle at (3, 0) that has come along y = 0.3 from x = 0.5; its way leads to two corners.
struct Rig {
    terrain: Terrain,
    way: Way,
    unknown: Unknown,
    failures: u32,
    are_paths_barred: bool,
}

impl Rig {
    fn new(corners: [Point; 2], is_solid: impl Fn(f64, f64) -> bool) -> Rig {
        let mut terrain = terrain_of(is_solid);
        (0..=25).for_each(|step| {
            terrain.note_place(Point::new(0.5 + 0.1 * f64::from(step), 0.3));
        });
        let mut way = Way::default();
        way.append([corners[0]], corners[1], None);
        Rig {
            terrain,
            way,
            unknown: Unknown::Free,
            failures: 0,
            are_paths_barred: false,
        }
    }

    fn find(&self) -> Option<FoundPath> {
        let pose: Pose = own_state(3.0, 0.0).pose;
        let detour = Detour {
            search: self.terrain.search(Time::from_secs_f64(1.0), pose),
            way: &self.way,
            unknown_tries: self.unknown.tries(false),
            peers: &[],
            passed: self.terrain.passed_lately().collect(),
            failures: self.failures,
            are_paths_barred: self.are_paths_barred,
        };
        detour.find()
    }

    /// How the path was found, how many corners it replaces, and where it ends.
    fn found(&self) -> Option<(FoundBy, usize, Point)> {
        let path = self.find()?;
        Some((path.found_by, path.replaces, *path.points.last()?))
    }
}

/// A wall across all that is known.
fn is_wall(x_m: f64, _: f64) -> bool {
    (1.4..1.8).contains(&x_m)
}

#[test]
fn a_corner_that_cannot_be_reached_is_left_out() {
    let (barred, free) = (Point::new(5.0, 0.1), Point::new(3.0, 3.0));
    let rig = Rig::new([barred, free], |x_m, y_m| {
        (x_m - 5.0).abs() < 0.3 && y_m.abs() < 0.3
    });
    assert_eq!(rig.found(), Some((FoundBy::GoingOn, 2, free)));
}

#[test]
fn on_the_way_home_where_an_earlier_path_led_through_does_not_count() {
    let corner = Point::new(4.0, 3.0);
    let home = Rig::new([corner, HOME], |_, _| false);
    assert_eq!(home.found(), Some((FoundBy::GoingOn, 2, HOME)));
    let mut plan = Rig::new([corner, corner], |_, _| false);
    plan.way.append([], HOME, Some(StopId(1)));
    assert_eq!(plan.found(), Some((FoundBy::GoingOn, 1, corner)));
}

#[test]
fn unknown_ground_is_crossed_at_once_as_a_last_resort_or_not_at_all() {
    // The first corner lies in unknown ground, the second one does not.
    let (unknown, known) = (Point::new(8.0, 0.0), Point::new(3.0, 3.0));
    let mut rig = Rig::new([unknown, known], |_, _| false);
    assert_eq!(rig.found(), Some((FoundBy::GoingOn, 1, unknown)));
    rig.unknown = Unknown::LastResort;
    assert_eq!(rig.found(), Some((FoundBy::GoingOn, 2, known)));
    let mut rig = Rig::new([unknown, unknown], |_, _| false);
    rig.unknown = Unknown::LastResort;
    assert_eq!(rig.found(), Some((FoundBy::GoingOn, 1, unknown)));
    rig.unknown = Unknown::Barred;
    assert_eq!(rig.found(), None);
}

#[test]
fn a_vehicle_that_is_hemmed_in_backs_off_to_the_nearest_place_before_anything_else() {
    let mut rig = Rig::new([Point::new(4.0, 3.0), Point::new(5.0, 3.0)], |_, _| false);
    let now = Time::from_secs_f64(1.0);
    rig.terrain.note_obstacle(now, obstacle(3.6, 0.0));
    let (found_by, replaces, end) = rig.found().unwrap();
    assert_eq!((found_by, replaces), (FoundBy::BackingOff, 0));
    let away_m = end.distance_to(Point::new(3.0, 0.0));
    assert!((BACK_M..BACK_M + 0.6).contains(&away_m), "{away_m} m");
}

#[test]
fn a_vehicle_that_is_hemmed_in_backs_off_to_where_it_is_no_more_or_goes_on() {
    let mut rig = Rig::new([Point::new(4.0, 3.0), Point::new(5.0, 3.0)], |_, _| false);
    let now = Time::from_secs_f64(1.0);
    rig.terrain.note_obstacle(now, obstacle(3.6, 0.0));
    rig.terrain.note_obstacle(now, obstacle(1.6, 0.8));
    let (found_by, _, end) = rig.found().unwrap();
    assert_eq!(found_by, FoundBy::BackingOff);
    assert!(end.x_m < 1.0, "past the other obstacle: {end}");
    rig.terrain.note_obstacle(now, obstacle(0.4, 0.8));
    rig.terrain.note_obstacle(now, obstacle(-0.2, 0.8));
    let (found_by, _, _) = rig.found().unwrap();
    assert_eq!(found_by, FoundBy::GoingOn, "all places are as bad");
}

#[test]
fn home_is_reached_over_places_driven_when_nothing_else_leads_there() {
    let has_gap = |x_m: f64, y_m: f64| is_wall(x_m, y_m) && !(0.0..0.6).contains(&y_m);
    let aside = Point::new(0.0, 1.0);
    let mut rig = Rig::new([aside, HOME], has_gap);
    rig.unknown = Unknown::Barred;
    assert_eq!(rig.found(), Some((FoundBy::DrivenPlaces, 2, HOME)));
    let mut rig = Rig::new([HOME, aside], has_gap);
    rig.unknown = Unknown::Barred;
    assert_eq!(rig.found(), None, "home is not the end of the way");
}

#[test]
fn who_is_shut_in_by_what_it_knows_goes_back_over_its_own_track_after_three_failures() {
    let mut rig = Rig::new([Point::new(0.0, 1.0), HOME], is_wall);
    rig.unknown = Unknown::Barred;
    rig.failures = OWN_TRACK_AFTER - 1;
    let found_by = |rig: &Rig| rig.found().map(|(found_by, _, _)| found_by);
    assert_ne!(found_by(&rig), Some(FoundBy::OwnTrack), "not yet");
    rig.failures = OWN_TRACK_AFTER;
    let (found_by_now, replaces, end) = rig.found().unwrap();
    assert_eq!((found_by_now, replaces), (FoundBy::OwnTrack, 0));
    assert!(
        end.x_m < 1.2 && (end.y_m - 0.3).abs() < 1e-9,
        "beyond the wall: {end}"
    );
    let mut open = Rig::new([Point::new(0.0, 1.0), HOME], |_, _| false);
    (open.unknown, open.failures) = (Unknown::Barred, OWN_TRACK_AFTER);
    assert_eq!(
        found_by(&open),
        Some(FoundBy::GoingOn),
        "a known way begins here"
    );
    open.are_paths_barred = true;
    let (found_by_now, _, end) = open.found().unwrap();
    assert_eq!(found_by_now, FoundBy::OwnTrack, "that could not be begun");
    assert!(end.distance_to(Point::new(3.0, 0.0)) >= BACK_M, "{end}");
    let mut other = Rig::new([HOME, Point::new(0.0, 1.0)], is_wall);
    (other.unknown, other.failures) = (Unknown::Barred, OWN_TRACK_AFTER);
    assert_eq!(found_by(&other), None, "home is not the end of the way");
}

#[test]
fn every_third_failure_sends_the_vehicle_far_back() {
    let is_wall_ahead = |x_m: f64, _: f64| (-1.8..-1.4).contains(&x_m);
    let ahead = [Point::new(-3.0, 0.0), Point::new(-3.0, 1.0)];
    let mut rig = Rig::new(ahead, is_wall_ahead);
    rig.unknown = Unknown::Barred;
    for failures in 0..7 {
        rig.failures = failures;
        let found = rig.found().map(|(found_by, _, _)| found_by);
        let expected = (failures % 3 == 2).then_some(FoundBy::BackingOff);
        assert_eq!(found, expected, "after {failures} failures");
    }
}

#[test]
fn a_path_is_as_long_as_its_pieces_and_only_one_back_does_not_lead_on() {
    let path = |found_by| FoundPath {
        found_by,
        replaces: 1,
        points: vec![HOME, Point::new(3.0, 0.0), Point::new(3.0, 2.0)],
    };
    assert_eq!(path(FoundBy::GoingOn).length_m(), 5.0);
    assert!(path(FoundBy::GoingOn).leads_on() && path(FoundBy::DrivenPlaces).leads_on());
    assert!(!path(FoundBy::BackingOff).leads_on());
}
