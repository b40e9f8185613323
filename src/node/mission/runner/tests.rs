//! How steps are carried out, whoever says them: a vehicle at a place, on ground that is free for 6 m around the datum.

use std::collections::BTreeSet;

use tomoswarm_proto::{Boot, LayerId, MissionProgress, State, TaskKind, VehicleId, VehicleMode};

use super::yield_to_peers::{Turn, Yield};
use super::*;
use crate::autopilot::{StoredPhase, StoredProgress};
use crate::node::OwnState;
use crate::node::mission::In;
use crate::node::mission::aside::{PeerWay, way_aside};
use crate::node::mission::kind::tests_support::obstacle;
use crate::node::mission::obstruction::ObstructionKind;
use crate::node::mission::pilot::Pilot;
use crate::node::mission::place_watch::PlaceWatch;
use crate::node::mission::terrain::tests::{terrain_of, tiles_valued, two_rooms};
use crate::node::mission::terrain::{Resolution, Terrain};
use crate::node::mission::tests::{at, tiles};
use crate::node::peers::Peers;
use crate::node::tests_support::{drawn, own_state, settings, state, variants};
use crate::node::vehicle::CommandRefusal;

struct Rig {
    runner: StepRunner,
    terrain: Terrain,
    pilot: Pilot,
    peers: Peers,
    place: PlaceWatch,
    own: OwnState,
    now_s: f64,
}

impl Rig {
    fn new(task: TaskKind) -> Rig {
        let settings = VehicleSettings {
            task: Some(task),
            ..settings(1)
        };
        let mut terrain = Terrain::new(settings.clone());
        for tile in tiles(None) {
            let In::Tile(tile) = tile else { continue };
            terrain.learn(&tile);
        }
        let runner = StepRunner::of(&settings).expect("it is no task of the ground's");
        Rig {
            runner,
            terrain,
            pilot: Pilot::new(settings.clone()),
            peers: Peers::new(settings.vehicle),
            place: PlaceWatch::new(settings.swarm.pose_sd_max_m),
            own: own_state(3.0, 0.0),
            now_s: 1.0,
        }
    }

    /// Goes on a tenth of a second later; returns what is said.
    fn go_on(&mut self, met: &[WayEvent]) -> Vec<Out> {
        self.now_s += 0.1;
        let mut out = Vec::new();
        let mut scene = RunnerContext {
            now: at(self.now_s),
            state: &self.own,
            terrain: &self.terrain,
            pilot: &mut self.pilot,
            peers: &self.peers,
            place: &mut self.place,
            out: &mut out,
        };
        self.runner.go_on(&mut scene, met);
        out
    }

    /// Stands at the end of the way that is driven.
    fn arrive(&mut self) {
        let end = self.pilot.way().end();
        self.own.pose.at = end;
        self.pilot.give_up(end);
    }

    /// Obeys every turn at once, for a while; returns the remarks.
    fn run(&mut self, tenths: usize) -> Vec<MissionEvent> {
        let mut events = Vec::new();
        for _ in 0..tenths {
            for output in self.go_on(&[]) {
                match output {
                    Out::Command(_, MoveCommand::Turn(heading)) => self.own.pose.heading = heading,
                    Out::MissionEvent(event) => events.push(event),
                    Out::Command(..)
                    | Out::Holds(_)
                    | Out::Accepted(..)
                    | Out::Progress(_)
                    | Out::Remember(_)
                    | Out::Measure(_) => {}
                }
            }
        }
        events
    }
}

#[test]
fn a_place_that_is_reached_is_said_and_after_the_last_one_the_vehicle_goes_home() {
    let place = Point::new(3.0, 2.0);
    let mut rig = Rig::new(TaskKind::Legs {
        places: vec![place.into()],
    });
    rig.go_on(&[]);
    assert_eq!(rig.pilot.way().end(), place);
    rig.arrive();
    assert_eq!(
        rig.run(2),
        [
            MissionEvent::Visited(place),
            MissionEvent::Ended(EndReason::Done)
        ]
    );
    rig.run(2);
    assert_eq!(rig.pilot.way().end(), Point::new(0.0, 0.0), "home");
    rig.arrive();
    assert_eq!(rig.run(20), []);
    assert!(matches!(rig.runner.phase, Phase::Over) && rig.pilot.way().is_empty());
}

#[test]
fn a_step_that_was_interrupted_is_begun_again() {
    let place = Point::new(3.0, 2.0);
    let mut rig = Rig::new(TaskKind::Legs {
        places: vec![place.into()],
    });
    rig.go_on(&[]);
    rig.pilot.give_up(Point::new(3.0, 0.0));
    rig.runner.interrupt(at(rig.now_s));
    assert!(
        rig.runner.deadline().is_some(),
        "it wants to be asked again"
    );
    rig.go_on(&[]);
    assert_eq!(rig.pilot.way().end(), place);
}

#[test]
fn a_look_around_turns_once_around_and_then_the_mission_goes_on() {
    let mut rig = Rig::new(TaskKind::Browse);
    let out = rig.go_on(&[]);
    assert!(
        matches!(out[..], [Out::Command(_, MoveCommand::Turn(_))]),
        "{out:?}"
    );
    assert_eq!(rig.run(10), [], "it takes its time");
    assert_eq!(rig.run(100), [MissionEvent::Ended(EndReason::Done)]);
}

#[test]
fn what_stands_in_the_way_of_a_straight_leg_ends_it_there() {
    let mut rig = Rig::new(TaskKind::Forward { distance_mm: 2000 });
    rig.go_on(&[]);
    let wall = obstacle(4.0, 0.0);
    let out = rig.go_on(&[WayEvent::Blocked(wall)]);
    assert!(
        out.contains(&Out::MissionEvent(MissionEvent::Ended(EndReason::Stopped(
            wall
        )))),
        "{out:?}"
    );
    assert!(rig.pilot.way().is_empty());
}

#[test]
fn a_place_to_which_no_way_leads_is_passed_over() {
    let (outside, inside) = (Point::new(30.0, 0.0), Point::new(3.0, 2.0));
    let mut rig = Rig::new(TaskKind::Pathfind {
        places: vec![outside.into(), inside.into()],
    });
    let events = rig.run(100);
    assert!(
        matches!(
            events[..],
            [MissionEvent::NoWay(..), MissionEvent::Passed(_)]
        ),
        "{events:?}"
    );
    assert_eq!(rig.pilot.way().end(), inside);
    rig.arrive();
    let events = rig.run(100);
    assert_eq!(
        events,
        [
            MissionEvent::Visited(inside),
            MissionEvent::Ended(EndReason::NoWay(1))
        ]
    );
}

#[test]
fn who_is_stopped_again_and_again_without_moving_gives_the_place_up() {
    let place = Point::new(3.0, 2.0);
    let mut rig = Rig::new(TaskKind::Pathfind {
        places: vec![place.into()],
    });
    let mut events = Vec::new();
    for _ in 0..100 {
        events.extend(rig.run(120));
        rig.go_on(&[WayEvent::Blocked(obstacle(3.0, 1.0))]);
    }
    assert_eq!(
        events,
        [
            MissionEvent::Passed(place),
            MissionEvent::Ended(EndReason::GaveUp(1))
        ]
    );
}

#[test]
fn peers_that_never_make_room_end_the_mission_at_last() {
    let place = Point::new(3.0, 2.0);
    let mut rig = Rig::new(TaskKind::Pathfind {
        places: vec![place.into()],
    });
    let mut events = Vec::new();
    for sequence in 1..400 {
        let peer = State {
            sequence,
            ..state(2, place.x_m, place.y_m)
        };
        rig.peers.take(at(rig.now_s), &peer);
        events.extend(rig.run(10));
        if !rig.pilot.way().is_empty() {
            assert!(
                rig.pilot.way().end().distance_to(place) > 1.0,
                "aside, or home"
            );
            rig.arrive();
        }
    }
    let [waits, MissionEvent::StepsAside(to), ends @ ..] = &events[..] else {
        panic!("{events:?}")
    };
    assert!(*waits == waits_for_vehicle_2() && to.distance_to(place) > 1.0);
    assert_eq!(
        ends,
        [
            MissionEvent::Passed(place),
            MissionEvent::Ended(EndReason::GaveUp(1))
        ]
    );
}

#[test]
fn a_place_on_which_a_vehicle_stands_whose_software_has_ended_is_soon_passed_over() {
    let place = Point::new(3.0, 2.0);
    let mut rig = Rig::new(TaskKind::Pathfind {
        places: vec![place.into()],
    });
    rig.peers
        .take(at(rig.now_s), &state(2, place.x_m, place.y_m));
    let mut events = Vec::new();
    let begun_s = rig.now_s;
    while !events.contains(&MissionEvent::Passed(place)) {
        events.extend(rig.run(10));
        if !rig.pilot.way().is_empty() {
            rig.arrive();
        }
        assert!(rig.now_s < begun_s + 150.0, "{events:?}");
    }
    assert!(rig.now_s > begun_s + 20.0, "it may speak again: {events:?}");
}

fn waits_for_vehicle_2() -> MissionEvent {
    MissionEvent::WaitsForPeers(vec![VehicleId(2)])
}

/// A straight leg east, from (3, 0), with a peer that stands on it.
fn behind_a_peer() -> Rig {
    let mut rig = Rig::new(TaskKind::Legs {
        places: vec![Point::new(5.5, 0.0).into()],
    });
    rig.peers.take(at(1.0), &state(2, 4.5, 0.0));
    rig
}

#[test]
fn a_straight_leg_waits_for_a_peer_and_is_gone_on_with_from_where_the_vehicle_is() {
    let mut rig = behind_a_peer();
    let yields = |rig: &Rig| rig.runner.phase() == MissionPhase::Yielding;
    assert_eq!(rig.run(30), [waits_for_vehicle_2()]);
    assert!(rig.pilot.way().is_empty() && yields(&rig));
    let gone = State {
        sequence: 2,
        ..state(2, 4.5, 3.0)
    };
    rig.peers.take(at(rig.now_s), &gone);
    rig.own.pose.at = Point::new(3.0, -1.0);
    rig.run(30);
    assert_eq!(rig.pilot.way().end(), Point::new(5.5, 0.0));
    // On the way the vehicle refuses, or something is seen or not seen where the peer is: it is the peer.
    let separation = Obstruction {
        at: Point::new(3.0, -1.0),
        kind: ObstructionKind::Refusal(CommandRefusal::Separation(VehicleId(2))),
    };
    let body = obstacle(4.4, 2.9);
    let shadow = Obstruction {
        at: Point::new(4.9, 4.1),
        kind: ObstructionKind::UnseenGround,
    };
    for by in [separation, body, shadow] {
        rig.go_on(&[WayEvent::Blocked(by)]);
        assert!(rig.pilot.way().is_empty() && yields(&rig), "{by:?}");
        assert_eq!(rig.run(30), [], "{by:?}");
        assert_eq!(rig.pilot.way().end(), Point::new(5.5, 0.0), "{by:?}");
    }
}

#[test]
fn beside_a_peer_the_world_ends_a_straight_leg_at_once_as_ever() {
    let beside = State {
        sequence: 2,
        ..state(2, 4.5, 3.0)
    };
    // Beside it, and behind it.
    for wall in [obstacle(4.4, 1.0), obstacle(5.4, 4.8)] {
        let mut rig = behind_a_peer();
        rig.peers.take(at(1.0), &beside);
        rig.go_on(&[]);
        let out = rig.go_on(&[WayEvent::Blocked(wall)]);
        let ended = MissionEvent::Ended(EndReason::Stopped(wall));
        assert!(out.contains(&Out::MissionEvent(ended)), "{out:?}");
    }
}

#[test]
fn a_straight_leg_that_a_peer_never_frees_is_given_up() {
    let mut rig = behind_a_peer();
    let mut events = Vec::new();
    for sequence in 2..400 {
        let stands = State {
            sequence,
            ..state(2, 4.5, 0.0)
        };
        rig.peers.take(at(rig.now_s), &stands);
        events.extend(rig.run(10));
        if rig.runner.end().is_some() {
            break;
        }
        if !rig.pilot.way().is_empty() {
            // Aside, and back to where it waited.
            rig.arrive();
            rig.run(1);
            rig.own.pose.at = Point::new(3.0, 0.0);
        }
    }
    events.retain(|event| !matches!(event, MissionEvent::StepsAside(_)));
    let ended = MissionEvent::Ended(EndReason::GaveUp(1));
    assert_eq!(events, [waits_for_vehicle_2(), ended]);
    assert!((180.0..320.0).contains(&rig.now_s), "{} s", rig.now_s);
}

#[test]
fn where_it_goes_is_its_place_also_while_it_waits_and_then_its_home() {
    let mut rig = behind_a_peer();
    rig.run(30);
    assert_eq!(rig.runner.goal(), Some(Point::new(5.5, 0.0)));
    rig.runner.end_for(EndReason::BatteryLow);
    assert_eq!(rig.runner.goal(), Some(rig.runner.settings.home));
    rig.runner.phase = Phase::Over;
    assert_eq!(rig.runner.goal(), None);
}

/// What a peer at a place says of where it goes.
fn way_of(peers: &mut Peers, vehicle: u8, from: (f64, f64), to: Option<(f64, f64)>) -> PeerWay {
    peers.take(at(1.0), &state(vehicle, from.0, from.1));
    let said = MissionProgress {
        vehicle: VehicleId(vehicle),
        boot: Boot(1),
        goal: to.map(|(x_m, y_m)| Point::new(x_m, y_m).into()),
        ..MissionProgress::default()
    };
    peers.note_goal(at(1.0), &said);
    let peer = peers.get(VehicleId(vehicle)).expect("it was heard");
    PeerWay::of(peer, at(1.5), 1.0)
}

#[test]
fn a_place_aside_is_off_the_way_that_a_peer_wants_to_go_and_no_farther_than_it_must_be() {
    let rig = behind_a_peer();
    let search = rig.terrain.search(at(1.0), own_state(3.0, 0.0).pose);
    let grid = search
        .ground(None, Resolution::Cells, false, &[])
        .expect("the fence is small");
    let mut peers = Peers::new(VehicleId(1));
    let from = Point::new(3.0, 0.0);
    let aside = |way: PeerWay| {
        let mut yields = YieldToPeers::default();
        let rooms = [1, 2].map(|_| {
            yields.once_more(&turn(1, true), &Peers::new(VehicleId(1)));
            yields.once_more(&turn(1, true), &Peers::new(VehicleId(1)));
            yields.room_m(std::iter::once(&way))
        });
        rooms.map(|room_m| {
            let corners = way_aside(&grid, from, &[&way], room_m, |_| true).expect("there is room");
            *corners.last().expect("it leads somewhere")
        })
    };
    let known = way_of(&mut peers, 2, (5.0, 0.0), Some((-2.0, 0.0)));
    assert!(known.is_barred_from(from) && !known.is_barred_from(Point::new(3.0, 1.3)));
    let [first, second] = aside(known);
    assert!(
        (1.3..1.7).contains(&first.y_m.abs()) && (first.x_m - 3.0).abs() < 0.5,
        "{first:?}"
    );
    assert!(second.y_m.abs() > 2.5, "again, and farther: {second:?}");
    let unknown = way_of(&mut peers, 3, (5.0, 0.0), None);
    let [first, _] = aside(unknown);
    assert!(first.x_m < 0.0, "away from where it is: {first:?}");
}

fn turn(own: u8, is_in_the_way: bool) -> Turn {
    Turn {
        own: VehicleId(own),
        left_m: 5.0,
        is_in_the_way,
    }
}

#[test]
fn who_stands_on_nobodys_way_waits_longer_and_who_gets_on_begins_anew() {
    let peers = Peers::new(VehicleId(1));
    let waits = |is_in_the_way: bool| {
        let mut yields = YieldToPeers::default();
        (1..90).find(|_| yields.once_more(&turn(1, is_in_the_way), &peers) == Yield::StepAside)
    };
    assert_eq!((waits(true), waits(false)), (Some(2), Some(8)));
    let mut yields = YieldToPeers::default();
    yields.once_more(&turn(1, true), &peers);
    yields.drive(4.6);
    assert_eq!(yields.in_a_row(), 1);
    yields.drive(4.4);
    assert_eq!(yields.in_a_row(), 0);
    // Where it has been before it does not get on.
    yields.once_more(&turn(1, true), &peers);
    yields.drive(4.1);
    assert_eq!(yields.in_a_row(), 1);
}

#[test]
fn the_highest_id_steps_aside_first_and_patience_has_an_end() {
    let asks = |own: u8| {
        let mut peers = Peers::new(VehicleId(own));
        (1..4).for_each(|id| peers.take(at(1.0), &state(id, f64::from(id), 5.0)));
        let mut yields = YieldToPeers::default();
        (0..90)
            .map(|_| yields.once_more(&turn(own, true), &peers))
            .collect::<Vec<_>>()
    };
    let first = |yields: &[Yield]| {
        yields
            .iter()
            .position(|one| *one == Yield::StepAside)
            .unwrap()
    };
    let (low, middle, high) = (asks(1), asks(2), asks(3));
    assert!(first(&high) < first(&middle) && first(&middle) < first(&low));
    for yields in [low, middle, high] {
        assert_eq!(yields.last(), Some(&Yield::InVain));
        assert!(!yields[..89].contains(&Yield::InVain));
    }
}

#[test]
fn the_drawing_shows_the_phases_and_no_others() {
    let word = |phase: &Phase| match phase {
        Phase::Choosing { .. } => "Choosing",
        Phase::Driving { .. } => "Driving",
        Phase::Looking { .. } => "Looking",
        Phase::Following { .. } => "Following",
        Phase::Over => "Over",
    };
    let look = LookAround::toward(Default::default(), Time::ZERO);
    let phases = [
        Phase::Choosing { from: Time::ZERO },
        Phase::Driving {
            to: Destination::Home,
            asked: Time::ZERO,
        },
        Phase::Looking { look, at: None },
        Phase::Following {
            since: Time::ZERO,
            is_refused: false,
        },
        Phase::Over,
    ];
    let words: BTreeSet<String> = phases.iter().map(|phase| word(phase).to_owned()).collect();
    let shown = drawn(include_str!("../runner.rs"));
    assert_eq!((&shown, &shown), (&words, &variants::<Phase>()));
}

#[test]
fn a_place_that_is_gone_for_in_vain_is_given_up_however_much_the_vehicle_moves() {
    let place = Point::new(-3.0, 0.0);
    let mut rig = Rig::new(TaskKind::Pathfind {
        places: vec![place.into()],
    });
    let mut events = rig.run(300);
    for step in 0..200 {
        rig.own.pose.at.x_m = if step % 2 == 0 { 3.0 } else { 2.0 };
        let blocked = WayEvent::Blocked(obstacle(2.5, 0.0));
        rig.go_on(&[blocked]);
        events.extend(rig.run(40));
    }
    assert_eq!(
        events,
        [
            MissionEvent::Passed(place),
            MissionEvent::Ended(EndReason::GaveUp(1))
        ]
    );
}

#[test]
fn a_search_that_sees_nothing_new_is_given_up_and_what_cannot_come_home_stays() {
    let mut rig = Rig::new(TaskKind::Explore);
    // It turns to nothing, and drives nowhere.
    let mut ends = Vec::new();
    for _ in 0..12_000 {
        for output in rig.go_on(&[]) {
            if let Out::MissionEvent(MissionEvent::Ended(end)) = output {
                ends.push((rig.now_s, end));
            }
        }
    }
    let [(at_s, EndReason::Stalled)] = ends[..] else {
        panic!("{ends:?}");
    };
    assert!((530.0..560.0).contains(&at_s), "{at_s} s");
    assert!(matches!(rig.runner.phase, Phase::Over), "not home either");
}

#[test]
fn a_stored_mission_that_is_refused_is_not_over_because_the_one_before_was() {
    let items = vec![tomoswarm_proto::StoredItem::Waypoint {
        at: Point::new(5.0, 0.0).into(),
        stay_ms: 0,
    }];
    for is_refused in [false, true] {
        let mut rig = Rig::new(TaskKind::Stored {
            items: items.clone(),
            from: 1,
        });
        rig.own.stored = Some(StoredProgress {
            item: 1,
            phase: StoredPhase::Over,
        });
        let begins = |out: &Out| matches!(out, Out::Command(_, MoveCommand::FollowStored { .. }));
        assert!(rig.go_on(&[]).iter().any(begins));
        if is_refused {
            rig.runner.refused();
        }
        let events = rig.run(20);
        let is_done = events.contains(&MissionEvent::Ended(EndReason::Done));
        assert_eq!(is_done, !is_refused, "{events:?}");
    }
}

#[test]
fn a_look_around_of_a_vehicle_that_does_not_turn_is_none() {
    let mut rig = Rig::new(TaskKind::Browse);
    let mut events = Vec::new();
    for _ in 0..6000 {
        for out in rig.go_on(&[]) {
            if let Out::MissionEvent(event) = out {
                events.push(event);
            }
        }
    }
    assert_eq!(events, [MissionEvent::Ended(EndReason::Stalled)]);
}

#[test]
fn who_is_blocked_by_a_peer_on_its_way_to_a_close_look_has_not_looked() {
    let blocked = |by: CommandRefusal| {
        let mut rig = behind_a_peer();
        rig.go_on(&[]);
        let cell = rig.runner.settings.lattice.cell_at(Point::new(9.0, 0.0));
        rig.runner.phase = Phase::Driving {
            to: Destination::Doubtful(cell),
            asked: at(rig.now_s),
        };
        rig.go_on(&[WayEvent::Blocked(Obstruction {
            at: Point::new(4.0, 0.0),
            kind: ObstructionKind::Refusal(by),
        })]);
        rig.runner.doubts == Doubts::default()
    };
    assert!(blocked(CommandRefusal::Separation(VehicleId(2))));
    assert!(!blocked(CommandRefusal::NoPose));
}

/// A vehicle that is done, at its home in the doorway between two rooms, and a peer that wants to get through it.
struct Doorway {
    rig: Rig,
    sequence: u64,
}

impl Doorway {
    fn new() -> Doorway {
        let mut rig = Rig::new(TaskKind::Pathfind { places: Vec::new() });
        rig.terrain = terrain_of(two_rooms(2.0));
        rig.runner.settings.home = Point::new(1.2, 0.0);
        rig.own = own_state(1.2, 0.0);
        rig.runner.mission = OwnMission::Ended(EndReason::Done);
        rig.runner.phase = Phase::Over;
        Doorway { rig, sequence: 0 }
    }

    /// So many seconds later, when the peer has rested, or driven, west of the doorway all the while; returns the remarks.
    fn wait(&mut self, seconds: u32, mode: VehicleMode, phase: MissionPhase) -> Vec<MissionEvent> {
        let mut events = Vec::new();
        for _ in 0..seconds {
            self.sequence += 1;
            let peer = State {
                mode,
                sequence: self.sequence,
                ..state(2, -3.0, 0.0)
            };
            let now = at(self.rig.now_s);
            self.rig.peers.take(now, &peer);
            let said = MissionProgress {
                vehicle: VehicleId(2),
                boot: peer.boot,
                goal: Some(Point::new(4.0, 0.0).into()),
                phase,
                ..MissionProgress::default()
            };
            self.rig.peers.note_goal(now, &said);
            events.extend(self.rig.run(10));
        }
        events
    }
}

#[test]
fn who_knows_of_no_place_aside_comes_nearer_where_it_sees_more_and_not_near_to_peers() {
    // A corridor along x, known up to somewhere, in which a peer stands at the place of the mission.
    let nearer = |known_to_m: f64, peer_m: f64| {
        let place = Point::new(peer_m, 0.0);
        let mut rig = Rig::new(TaskKind::Pathfind {
            places: vec![place.into()],
        });
        rig.own = own_state(-3.0, 0.0);
        let value = |x_m: f64, y_m: f64| match y_m.abs() {
            _ if x_m > known_to_m => 0,
            off_m if off_m < 0.8 => -17,
            _ => 17,
        };
        rig.terrain = Terrain::new(settings(1));
        let tiles = tiles_valued(LayerId::default(), value);
        tiles
            .into_iter()
            .for_each(|tile| rig.terrain.learn(&tile.into()));
        for sequence in 1..60 {
            let peer = State {
                sequence,
                ..state(2, peer_m, 0.0)
            };
            rig.peers.take(at(rig.now_s), &peer);
            rig.run(10);
            if !rig.pilot.way().is_empty() {
                return Some(rig.pilot.way().end().x_m);
            }
        }
        None
    };
    let end_m = nearer(1.0, 9.0).unwrap();
    assert!((-1.0..1.0).contains(&end_m), "{end_m}");
    let separation_m = settings(1).swarm.separation_m;
    let end_m = nearer(3.0, 4.0).unwrap();
    assert!(end_m <= 4.0 - 2.0 * separation_m && end_m > -1.0, "{end_m}");
    assert_eq!(nearer(7.0, 4.0), None, "it sees no more there");
}

#[test]
fn who_is_done_makes_room_for_a_peer_that_has_waited_and_goes_home_again() {
    let mut doorway = Doorway::new();
    // It has stood there for very long, which says nothing of what begins now.
    doorway.rig.now_s = 5000.0;
    let waits = MissionPhase::Yielding;
    assert_eq!(
        doorway.wait(15, VehicleMode::Idle, waits),
        [],
        "not at once"
    );
    let events = doorway.wait(20, VehicleMode::Idle, waits);
    let [MissionEvent::StepsAside(to)] = &events[..] else {
        panic!("{events:?}")
    };
    assert!(to.distance_to(Point::new(1.2, 0.0)) > 1.0, "{to}");
    doorway.rig.arrive();
    // The peer has come through.
    doorway.rig.peers = Peers::new(VehicleId(1));
    assert_eq!(doorway.rig.run(100), []);
    let end = doorway.rig.pilot.way().end();
    assert!(
        end.distance_to(doorway.rig.runner.settings.home) < 0.4,
        "{end}"
    );
}

#[test]
fn nobody_makes_room_for_a_peer_that_goes_on_or_when_its_motors_are_off_or_away_from_home() {
    let stays = |mode: VehicleMode, phase: MissionPhase, change: fn(&mut Rig)| {
        let mut doorway = Doorway::new();
        change(&mut doorway.rig);
        let events = doorway.wait(60, mode, phase);
        events.is_empty() && doorway.rig.pilot.way().is_empty()
    };
    let (drives, stands) = (VehicleMode::Driving, VehicleMode::Idle);
    let (goes, waits) = (MissionPhase::Going, MissionPhase::Yielding);
    assert!(stays(drives, goes, |_| ()));
    assert!(!stays(stands, goes, |_| ()), "it stands there");
    assert!(!stays(drives, waits, |_| ()), "it comes nearer, or aside");
    assert!(stays(stands, waits, |rig| rig.own.is_armed = false));
    assert!(stays(stands, waits, |rig| {
        rig.runner.settings.home = Point::new(4.0, 3.0);
    }));
}
