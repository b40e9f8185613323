//! The way home around a known ring whose inside is unknown, with others standing on it.

use std::collections::VecDeque;
use std::sync::Arc;
use tomoswarm_proto::TileReport;

use tomoswarm_proto::{State, TileAddress, VehicleId, VehicleMode};

use super::super::tests_support::{own_state, settings, state};
use super::terrain::tests::{tiles_of, two_rooms};
use super::tests::{at, fed, order};
use super::*;
use crate::geom::Angle;
use crate::node::vehicle::{self, MoveCommand};

/// Side of the ring, metres; its south-west corner is the datum.
const SIDE_M: f64 = 20.0;
/// The ring is known to be free this far to both sides, metres.
const KNOWN_M: f64 = 1.4;
/// Where nobody is in the way.
const ASIDE: Point = Point {
    x_m: -3.5,
    y_m: -3.5,
};
const WEST: Point = Point {
    x_m: 0.0,
    y_m: 10.0,
};
const WEST_ROOM: Point = Point {
    x_m: -3.0,
    y_m: 0.0,
};
const EAST: Point = Point {
    x_m: 20.0,
    y_m: 10.0,
};

fn off_ring_m(place: Point) -> f64 {
    let edges = [
        (0.0, 0.0),
        (SIDE_M, 0.0),
        (SIDE_M, SIDE_M),
        (0.0, SIDE_M),
        (0.0, 0.0),
    ];
    let corners = edges.map(|(x, y)| Point::new(x, y));
    let sides = corners
        .windows(2)
        .map(|pair| crate::geom::Segment::new(pair[0], pair[1]));
    sides
        .map(|side| side.distance_to_point(place))
        .fold(f64::INFINITY, f64::min)
}

/// Nothing is known off the ring but a bay on its south side, with a wall behind: a dead end.
fn evidence(place: Point) -> i8 {
    let is_bay = (8.0..12.0).contains(&place.x_m) && (0.0..2.6).contains(&place.y_m);
    let is_wall = (4.0..16.0).contains(&place.x_m) && (2.6..3.0).contains(&place.y_m);
    match (off_ring_m(place) <= KNOWN_M || is_bay, is_wall) {
        (true, _) => -17,
        (false, true) => 17,
        (false, false) => 0,
    }
}

fn tile(x: i32, y: i32) -> In {
    let middle_m = |tile: i32, index: usize| (f64::from(tile * 32 + index as i32) + 0.5) * 0.2;
    let cell =
        |index: usize| evidence(Point::new(middle_m(x, index % 32), middle_m(y, index / 32)));
    let report = TileReport {
        layer: Default::default(),
        address: TileAddress { slice: 0, x, y },
        revision: 1,
        cells: Arc::new(std::array::from_fn(cell)),
    };
    In::Tile(report.into())
}

/// How far a route passes from a place, metres, sampled every centimetre.
fn passes_m(route: &[Point], place: Point) -> f64 {
    let sample = |pair: &[Point], step: u32| pair[0].toward(pair[1], f64::from(step) / 2000.0);
    let samples = route
        .windows(2)
        .flat_map(|pair| (0..=2000).map(move |step| sample(pair, step)));
    samples
        .map(|at| at.distance_to(place))
        .fold(f64::INFINITY, f64::min)
}

/// Vehicle 1 on the south side, ordered to its home on the north side, and its peers; whatever it looks at stays unknown.
/// Its vehicle drives nothing that passes a peer within 1 m.
struct Ring {
    mission: Mission,
    at: Point,
    heading: Angle,
    route: VecDeque<Point>,
    peers: Vec<Point>,
    tenth: u32,
    driven: Vec<Point>,
    /// The vehicle refuses everything, as it would for a peer of which the mission does not know.
    refuses: bool,
    refused: u32,
}

impl Ring {
    fn new(peers: &[Point]) -> Ring {
        let home = Point::new(10.0, SIDE_M);
        let mut mission = Mission::new(VehicleSettings {
            home,
            ..settings(1)
        });
        let tiles = (-1..5).flat_map(|x| (-1..5).map(move |y| tile(x, y)));
        tiles.for_each(|tile| drop(fed(&mut mission, 0.0, tile)));
        let (at, heading, peers) = (Point::new(10.0, 0.0), Angle::default(), peers.to_vec());
        let (route, driven) = (VecDeque::new(), Vec::new());
        let mut ring = Ring {
            mission,
            at,
            heading,
            route,
            peers,
            tenth: 0,
            driven,
            refuses: false,
            refused: 0,
        };
        ring.run(1);
        fed(&mut ring.mission, 1.0, order(OrderKind::Return));
        ring
    }

    fn run(&mut self, seconds: u32) {
        for _ in 0..seconds * 10 {
            self.tenth += 1;
            self.step(0.1 * f64::from(self.tenth));
        }
    }

    /// Drives on at 2 m/s, hears of everybody, and takes commands.
    fn step(&mut self, now_s: f64) {
        let mode = if self.route.is_empty() {
            VehicleMode::Idle
        } else {
            VehicleMode::Driving
        };
        if let Some(next) = self.route.front().copied() {
            let left_m = self.at.distance_to(next);
            self.at = if left_m > 0.2 {
                self.at.toward(next, 0.2 / left_m)
            } else {
                next
            };
            self.route = self.route.split_off(usize::from(left_m <= 0.2));
            self.driven.push(self.at);
        }
        let sequence = u64::from(self.tenth);
        for (index, peer) in self.peers.iter().enumerate() {
            let state = State {
                sequence,
                ..state(index as u8 + 2, peer.x_m, peer.y_m)
            };
            fed(&mut self.mission, now_s, In::Peer(state));
        }
        let mut out = Vec::new();
        if self
            .mission
            .deadline()
            .is_some_and(|deadline| deadline.at <= at(now_s))
        {
            self.mission.wake(at(now_s), &mut out).unwrap();
        }
        let mut own = OwnState {
            sequence,
            mode,
            ..own_state(self.at.x_m, self.at.y_m)
        };
        own.pose.heading = self.heading;
        out.extend(fed(&mut self.mission, now_s, In::State(own)));
        for output in out {
            match output {
                Out::Command(_, MoveCommand::Drive { route, .. }) => self.drive(now_s, route),
                Out::Command(_, MoveCommand::Turn(heading)) => self.heading = heading,
                Out::Command(_, MoveCommand::Hold | MoveCommand::FollowStored { .. }) => {
                    self.route.clear()
                }
                Out::Holds(_) | Out::Accepted(..) | Out::Progress(_) | Out::Measure(_) => {}
                Out::Remember(_) | Out::MissionEvent(_) => {}
            }
        }
    }

    /// Obeys a command, or refuses it as the vehicle actor would.
    fn drive(&mut self, now_s: f64, route: Vec<Point>) {
        let near = |peer: &&Point| passes_m(&route, **peer) < 0.99;
        if self.refuses || self.peers.iter().find(near).is_some() {
            self.refused += 1;
            let refusal = vehicle::CommandRefusal::Separation(VehicleId(2));
            fed(
                &mut self.mission,
                now_s,
                In::SafetyEvent(vehicle::SafetyEvent::Refused(refusal)),
            );
            return;
        }
        self.route = route.into_iter().skip(1).collect();
    }

    fn is_home(&self) -> bool {
        self.mission.status() == MissionStatus::Home
    }
}

#[test]
fn one_stander_on_the_ring_sends_it_the_other_way_round() {
    for (stander, other_side) in [(WEST, EAST), (EAST, WEST)] {
        let mut ring = Ring::new(&[stander]);
        ring.run(60);
        assert!(ring.is_home(), "{stander:?}: still at {:?}", ring.at);
        assert!(
            ring.driven
                .iter()
                .any(|place| place.distance_to(other_side) < 1.0)
        );
    }
}

#[test]
fn who_is_barred_on_both_sides_lets_the_others_go_first_and_keeps_to_the_known_ring() {
    let mut ring = Ring::new(&[WEST, EAST]);
    ring.run(15);
    assert!(ring.driven.is_empty(), "{:?}", ring.driven);
    ring.peers[0] = ASIDE;
    ring.run(60);
    assert!(ring.is_home(), "still at {:?}", ring.at);
    assert!(ring.driven.iter().all(|place| off_ring_m(*place) < KNOWN_M));
}

#[test]
fn who_got_stuck_in_the_unknown_goes_home_over_the_ring_once_the_others_have_left() {
    let mut ring = Ring::new(&[WEST, EAST]);
    ring.run(200);
    assert!(
        !ring.driven.is_empty(),
        "when nobody moves any more, it tries the unknown"
    );
    assert!(!ring.is_home());
    ring.peers[1] = ASIDE;
    ring.run(120);
    assert!(ring.is_home(), "still at {:?}", ring.at);
}

#[test]
fn beside_a_stander_it_plans_a_way_that_the_vehicle_does_not_refuse() {
    // From 1.02 to 1.2 m away, at both sides of the ring: it could pass at 0.9 m, or go round at 1.2 m.
    for (x_m, y_m) in [
        (10.75, 0.75),
        (10.8, 0.8),
        (10.8, 0.65),
        (9.2, 0.75),
        (10.75, -0.75),
        (9.2, -0.75),
    ] {
        let mut ring = Ring::new(&[Point::new(x_m, y_m)]);
        ring.run(60);
        assert!(ring.is_home(), "{x_m}, {y_m}: still at {:?}", ring.at);
        assert_eq!(ring.refused, 0, "{x_m}, {y_m}");
    }
}

#[test]
fn face_to_face_on_the_ring_it_turns_back_and_goes_the_other_way_round() {
    for ahead_m in [1.02, 1.1, 1.19, 1.35] {
        let mut ring = Ring::new(&[Point::new(10.0 + ahead_m, 0.0)]);
        ring.run(60);
        assert!(ring.is_home(), "{ahead_m}: still at {:?}", ring.at);
        assert_eq!(ring.refused, 0, "{ahead_m}");
    }
}

/// A vehicle at its home in a doorway between two rooms that is sent home, while a peer that is to go home through it stands
/// east of it; what it says within a while.
fn sent_home_in_a_doorway(battery: f64) -> Vec<MissionEvent> {
    in_a_doorway(battery, Goal::Waiting, 200)
}

/// The same for a while (0.1 s) with another goal to begin with; one that is not at home is sent home after a second.
fn in_a_doorway(battery: f64, goal: Goal, tenths: u32) -> Vec<MissionEvent> {
    let mut mission = Mission::new(VehicleSettings {
        home: Point::new(1.2, 0.0),
        ..settings(1)
    });
    mission.goal = goal;
    for tile in tiles_of(two_rooms(2.0)) {
        fed(&mut mission, 0.0, In::Tile(tile.into()));
    }
    let mut events = Vec::new();
    for tenth in 0..tenths {
        let now_s = 0.1 * f64::from(tenth);
        let sequence = u64::from(tenth);
        let peer = State {
            sequence,
            ..state(2, 4.0, 0.0)
        };
        let said = tomoswarm_proto::MissionProgress {
            vehicle: VehicleId(2),
            boot: peer.boot,
            goal: Some(WEST_ROOM.into()),
            phase: tomoswarm_proto::MissionPhase::Returning,
            ..tomoswarm_proto::MissionProgress::default()
        };
        let own = OwnState {
            sequence,
            battery: Some(battery),
            ..own_state(1.2, 0.0)
        };
        let mut out = fed(&mut mission, now_s, In::Peer(peer));
        out.extend(fed(&mut mission, now_s, In::PeerMission(said)));
        out.extend(fed(&mut mission, now_s, In::State(own)));
        if tenth == 10 && goal == Goal::Waiting {
            out.extend(fed(&mut mission, now_s, order(OrderKind::Return)));
        }
        events.extend(out.into_iter().filter_map(|output| match output {
            Out::MissionEvent(event) => Some(event),
            _ => None,
        }));
    }
    events
}

#[test]
fn who_is_home_makes_room_for_others_that_stand_because_of_it_unless_its_battery_is_low() {
    let steps_aside = |battery: f64, tenths: u32| {
        let events = in_a_doorway(battery, Goal::Home(GoalSource::Order), tenths);
        let is_aside = |event: &MissionEvent| matches!(event, MissionEvent::StepsAside(_));
        events.iter().any(is_aside)
    };
    assert!(!steps_aside(0.9, 190), "it takes its time");
    assert!(steps_aside(0.9, 400));
    assert!(!steps_aside(0.01, 400));
}

#[test]
fn who_is_sent_home_into_the_way_of_others_steps_aside_unless_its_battery_is_low() {
    let events = sent_home_in_a_doorway(0.9);
    let steps_aside = |event: &MissionEvent| matches!(event, MissionEvent::StepsAside(_));
    assert!(events.iter().any(steps_aside), "{events:?}");
    let low = sent_home_in_a_doorway(0.01);
    assert!(!low.iter().any(steps_aside), "{low:?}");
}

#[test]
fn who_is_refused_every_path_lets_the_others_go_first_and_tries_again() {
    let mut ring = Ring::new(&[ASIDE]);
    ring.refuses = true;
    let mut stepped_back = 0;
    for _ in 0..60 {
        ring.run(1);
        let waits = matches!(ring.mission.goal, Goal::Returning(home) if !home.is_under_way());
        stepped_back += u32::from(waits);
    }
    assert!(stepped_back > 2, "it never let others go");
    assert!(ring.refused > 4 && ring.driven.is_empty());
    ring.refuses = false;
    ring.run(90);
    assert!(ring.is_home(), "still at {:?}", ring.at);
}
