//! What a search says, on ground that is free for 6 m around the datum and unknown beyond; nothing new is ever seen.

use tomoswarm_proto::{State, VehicleMode};

use super::*;
use crate::geom::{Pose, Rect};
use crate::node::mission::In;
use crate::node::mission::kind::tests_support::obstacle;
use crate::node::mission::tests::tiles;
use crate::node::peers::Peers;
use crate::node::tests_support::{drawn, settings, state, variants};

/// A search with all that it may look at.
struct World {
    seek: Seek,
    terrain: Terrain,
    peers: Peers,
    at: Point,
}

impl World {
    fn new(prefers: Preference) -> World {
        let settings = settings(1);
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
        }
    }

    fn tell(&mut self, seen: MissionInput) -> MissionStep {
        let pose = Pose {
            at: self.at,
            heading: Angle::default(),
            sd_m: 0.05,
        };
        let now = Time::from_secs_f64(1.0);
        let around = MissionContext {
            now,
            pose,
            terrain: &self.terrain,
            peers: &self.peers,
        };
        self.seek.watch_peers(&around);
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
                MissionStep::LookAt(cell) => {
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
        assert_eq!(end, EndReason::Done);
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
fn it_goes_on_to_what_it_wants_to_see_as_long_as_that_is_unknown() {
    let mut world = World::new(Preference::NearObjects);
    let MissionStep::GoAlong(course) = world.begin() else {
        panic!("a frontier is 6 m away")
    };
    assert!(!course.is_narrow && !course.corners.is_empty());
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
                MissionStep::LookAt(_) | MissionStep::End(EndReason::Done)
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

#[test]
fn the_drawing_shows_the_stages_and_no_others() {
    let word = |stage: Stage| match stage {
        Stage::Fresh => "Fresh",
        Stage::Choosing => "Choosing",
        Stage::Going(_) => "Going",
        Stage::Doubting(_) => "Doubting",
    };
    let cell = Cell::new(0, 0);
    let stages = [
        Stage::Fresh,
        Stage::Choosing,
        Stage::Going(cell),
        Stage::Doubting(cell),
    ];
    let shown = drawn(include_str!("../seek.rs"));
    assert_eq!(shown, variants::<Stage>());
    assert!(stages.iter().all(|stage| shown.contains(word(*stage))));
}
