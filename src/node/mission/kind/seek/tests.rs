//! What a search says, on ground that is free for 6 m around the datum and unknown beyond; nothing new is ever seen.

use tomoswarm_proto::{MissionPhase, MissionProgress, Position, State, VehicleMode};

use super::*;
use crate::geom::{Pose, Rect};
use crate::node::mission::In;
use crate::node::mission::kind::tests_support::obstacle;
use crate::node::mission::tests::tiles;
use crate::node::peers::Peers;
use crate::node::tests_support::{drawn, settings, state, variants};
use crate::time::Time;

/// A search with all that it may look at.
struct World {
    seek: Seek,
    terrain: Terrain,
    peers: Peers,
    at: Point,
    now_s: f64,
}

impl World {
    fn new(prefers: Preference) -> World {
        World::of(VehicleId(1), prefers)
    }

    fn of(vehicle: VehicleId, prefers: Preference) -> World {
        let settings = settings(vehicle.0);
        let mut terrain = Terrain::new(settings.clone());
        for tile in tiles(None) {
            let In::Tile(tile) = tile else { continue };
            terrain.learn(&tile);
        }
        let peers = Peers::new(settings.vehicle);
        World {
            seek: Seek::new(&settings, prefers),
            terrain,
            peers,
            at: Point::default(),
            now_s: 1.0,
        }
    }

    fn tell(&mut self, seen: MissionInput) -> MissionStep {
        let pose = Pose {
            at: self.at,
            heading: Angle::default(),
            sd_m: 0.05,
        };
        let now = Time::from_secs_f64(self.now_s);
        let around = MissionContext {
            now,
            pose,
            terrain: &self.terrain,
            peers: &self.peers,
        };
        self.seek.watch(&around);
        self.seek.next(seen, &around)
    }

    /// Looks around where it begins; returns the first step after that.
    fn begin(&mut self) -> MissionStep {
        assert_eq!(self.tell(MissionInput::Ready), MissionStep::LookAround);
        let looked = MissionInput::Looked {
            from: self.at,
            toward: Angle::default(),
            at: None,
        };
        assert_eq!(self.tell(looked), MissionStep::Think);
        self.tell(MissionInput::Ready)
    }

    /// Does what the search says until it ends; returns the end and how many looks it took.
    fn run(&mut self) -> (EndReason, usize) {
        let (mut step, mut looks) = (self.begin(), 0);
        for _ in 0..2000 {
            step = match step {
                MissionStep::End(end) => return (end, looks),
                MissionStep::GoAlong(course) => {
                    self.at = *course.corners.last().unwrap();
                    self.tell(MissionInput::Arrived)
                }
                MissionStep::LookAt(cell) | MissionStep::LookAtFace(cell) => {
                    looks += 1;
                    let toward = self.at.angle_to(self.terrain.map().lattice().centre(cell));
                    self.tell(MissionInput::Looked {
                        from: self.at,
                        toward,
                        at: Some(cell),
                    })
                }
                MissionStep::LookClosely(_) => {
                    looks += 1;
                    self.tell(MissionInput::Looked {
                        from: self.at,
                        toward: Angle::ZERO,
                        at: None,
                    })
                }
                MissionStep::Think | MissionStep::TryAgain => self.tell(MissionInput::Ready),
                step @ (MissionStep::GoOn
                | MissionStep::GoStraight(_)
                | MissionStep::GoTo(_)
                | MissionStep::LookAround
                | MissionStep::YieldToPeers
                | MissionStep::FollowStored { .. }
                | MissionStep::EndHere(_)
                | MissionStep::Wait) => panic!("{step:?}"),
            };
        }
        panic!("it never ends");
    }
}

#[test]
fn what_stays_unknown_after_some_looks_is_left_and_the_search_ends() {
    for prefers in [Preference::NearObjects, Preference::FarFromPeers] {
        let (end, looks) = World::new(prefers).run();
        // The map stays as it is whatever is looked at, most of it unknown.
        assert_eq!(end, EndReason::ShutIn { unseen_percent: 85 });
        assert!((20..500).contains(&looks), "{looks} looks");
    }
}

#[test]
fn what_cannot_be_searched_at_all_is_said() {
    let mut world = World::new(Preference::NearObjects);
    let far = Rect::new(Point::new(-9e4, -9e4), Point::new(9e4, 9e4)).polygon();
    let settings = VehicleSettings {
        fence: far,
        ..settings(1)
    };
    (world.terrain, world.seek) = (
        Terrain::new(settings.clone()),
        Seek::new(&settings, Preference::NearObjects),
    );
    assert_eq!(world.begin(), MissionStep::End(EndReason::TooLarge));
    assert_eq!(
        world.seek.give_up(),
        EndReason::NoRoom,
        "it has no places to give up"
    );
}

#[test]
fn who_has_waited_for_peers_in_vain_goes_on_without_what_they_bar_for_a_while_or_until_it_gets_on()
{
    let at = Time::from_secs_f64;
    let mut world = World::new(Preference::FarFromPeers);
    assert!(!world.seek.goes_on_without(at(1.0)), "it does not wait");
    let from = Point::new(3.0, 0.0);
    world.seek.stage = Stage::Barred(from);
    assert!(world.seek.goes_on_without(at(200.0)), "once");
    world.seek.stage = Stage::Barred(from);
    assert!(!world.seek.goes_on_without(at(379.0)), "in vain again");
    assert!(
        world.seek.goes_on_without(at(381.0)),
        "they may have gone meanwhile"
    );
    // Something can be looked at after all.
    world.seek.stage = Stage::Choosing;
    assert!(matches!(
        world.tell(MissionInput::Ready),
        MissionStep::GoAlong(_)
    ));
    world.seek.stage = Stage::Barred(from);
    assert!(world.seek.goes_on_without(at(382.0)));
}

#[test]
fn it_goes_on_to_what_it_wants_to_see_as_long_as_that_is_unknown() {
    let mut world = World::new(Preference::NearObjects);
    let MissionStep::GoAlong(course) = world.begin() else {
        panic!("a frontier is 6 m away")
    };
    assert!(course.room == RouteRoom::Kept && !course.corners.is_empty());
    assert_eq!(world.tell(MissionInput::UnderWay), MissionStep::GoOn);
    assert!(matches!(
        world.tell(MissionInput::Arrived),
        MissionStep::LookAt(_)
    ));
}

#[test]
fn what_cannot_be_got_at_is_looked_at_from_elsewhere_and_then_left() {
    let mut world = World::new(Preference::NearObjects);
    let mut step = world.begin();
    let mut tried = 0;
    while let MissionStep::GoAlong(_) = step {
        tried += 1;
        assert!(tried < 2000, "it never ends");
        assert_eq!(
            world.tell(MissionInput::Blocked(obstacle(world.at.x_m, world.at.y_m))),
            MissionStep::TryAgain
        );
        step = world.tell(MissionInput::Ready);
    }
    assert!(
        tried > 4
            && matches!(
                step,
                MissionStep::LookAt(_) | MissionStep::End(EndReason::ShutIn { .. })
            ),
        "{step:?}"
    );
}

#[test]
fn an_explorer_leaves_to_a_peer_what_the_peer_is_near_to_and_a_search_does_not() {
    let ends = |prefers: Preference| {
        let mut world = World::new(prefers);
        let alone = world.begin();
        let MissionStep::GoAlong(alone) = alone else {
            panic!("{alone:?}")
        };
        let alone = *alone.corners.last().unwrap();
        let mut world = World::new(prefers);
        let beyond =
            Point::default().toward(alone, 1.0 + 2.5 / alone.distance_to(Point::default()));
        let peer = State {
            mode: VehicleMode::Driving,
            ..state(2, beyond.x_m, beyond.y_m)
        };
        world.peers.take(Time::from_secs_f64(1.0), &peer);
        let beside = world.begin();
        let MissionStep::GoAlong(beside) = beside else {
            panic!("{beside:?}")
        };
        beside.corners.last().unwrap().distance_to(alone)
    };
    let (search_m, explore_m) = (
        ends(Preference::NearObjects),
        ends(Preference::FarFromPeers),
    );
    assert!(
        explore_m > search_m && explore_m > 2.0,
        "{search_m} m, {explore_m} m"
    );
}

/// A peer that has moved lately, and that says where it goes.
fn goes(world: &mut World, id: u8, from: Point, goal: Option<Point>, phase: MissionPhase) {
    let peer = State {
        mode: VehicleMode::Driving,
        ..state(id, from.x_m, from.y_m)
    };
    world.peers.take(Time::from_secs_f64(1.0), &peer);
    let said = MissionProgress {
        vehicle: peer.vehicle,
        boot: peer.boot,
        goal: goal.map(Position::from),
        phase,
        ..MissionProgress::default()
    };
    world.peers.note_goal(Time::from_secs_f64(1.0), &said);
}

/// How far from what it looks at first when it is alone a vehicle looks, beside peers.
fn leaves_m(prefers: Preference, peers: impl Fn(&mut World, Point)) -> f64 {
    let mut world = World::new(prefers);
    world.begin();
    let alone = world.seek.goal().expect("there is something to see");
    let mut world = World::new(prefers);
    peers(&mut world, alone);
    world.begin();
    let beside = world.seek.goal().expect("there is something to see");
    beside.distance_to(alone)
}

#[test]
fn where_a_peer_goes_that_has_less_way_there_nobody_else_goes() {
    use MissionPhase::{Going, Returning};
    for prefers in [Preference::NearObjects, Preference::FarFromPeers] {
        // A peer this far beyond what is looked at first, seen from the vehicle; that itself is less than 6 m away.
        let peer = |beyond_m: f64, phase: MissionPhase| {
            leaves_m(prefers, |world, goal| {
                let away_m = goal.distance_to(Point::default());
                let from = Point::default().toward(goal, 1.0 + beyond_m / away_m);
                goes(world, 2, from, Some(goal), phase);
            })
        };
        assert!(peer(3.0, Going) > SAME_GOAL_M, "{prefers:?}: it is nearer");
        assert_eq!(peer(9.0, Going), 0.0, "{prefers:?}: it has more way");
        assert_eq!(peer(3.0, Returning), 0.0, "{prefers:?}: it goes home");
        let silent = |at_s: f64| {
            leaves_m(prefers, |world, goal| {
                goes(world, 2, goal, Some(goal), Going);
                world.now_s = at_s;
            })
        };
        assert!(silent(1.5) > SAME_GOAL_M, "{prefers:?}");
        assert!(silent(9.0) < 0.5, "{prefers:?}: it is not heard");
    }
}

#[test]
fn of_two_with_equal_ways_to_one_goal_the_lower_id_has_it() {
    let equal = |own: u8| {
        let mut world = World::of(VehicleId(own), Preference::NearObjects);
        world.begin();
        let goal = world.seek.goal().expect("there is something to see");
        let from = world.at;
        goes(&mut world, 2, from, Some(goal), MissionPhase::Going);
        let pose = Pose {
            at: world.at,
            heading: Angle::default(),
            sd_m: 0.05,
        };
        let around = MissionContext {
            now: Time::from_secs_f64(1.0),
            pose,
            terrain: &world.terrain,
            peers: &world.peers,
        };
        has_a_peers_goal(&around, goal)
    };
    assert!(!equal(1) && equal(3));
}

#[test]
fn an_explorer_says_what_it_wants_to_see_until_it_chooses_anew() {
    let mut world = World::new(Preference::FarFromPeers);
    assert_eq!(world.seek.goal(), None);
    let MissionStep::GoAlong(course) = world.begin() else {
        panic!("a frontier is 6 m away")
    };
    let goal = world.seek.goal().expect("it goes somewhere");
    let from = course.corners[course.corners.len() - 1];
    assert!(goal.distance_to(from) <= world.seek.settings.look.sure_range_m);
    world.at = from;
    world.tell(MissionInput::Arrived);
    assert_eq!(world.seek.goal(), Some(goal), "it looks");
}

#[test]
fn the_drawing_shows_the_stages_and_no_others() {
    let word = |stage: Stage| match stage {
        Stage::Fresh => "Fresh",
        Stage::Choosing => "Choosing",
        Stage::Going(_) => "Going",
        Stage::Facing(_) => "Facing",
        Stage::Doubting(_) => "Doubting",
        Stage::Barred(_) => "Barred",
    };
    let cell = Cell::new(0, 0);
    let stages = [
        Stage::Fresh,
        Stage::Choosing,
        Stage::Going(cell),
        Stage::Facing(cell),
        Stage::Doubting(cell),
        Stage::Barred(Point::new(0.0, 0.0)),
    ];
    let shown = drawn(include_str!("../seek.rs"));
    assert_eq!(shown, variants::<Stage>());
    assert!(stages.iter().all(|stage| shown.contains(word(*stage))));
}
