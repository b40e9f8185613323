//! What leads the pilot from one state to another, and that the drawing shows the states. The ground is known within 6.4 m
//! around the datum; beyond it nothing is.

use std::collections::BTreeSet;

use tomoswarm_proto::{VehicleId, VehicleMode};

use super::*;
use crate::node::mission::terrain::tests::{obstacle, terrain_of, tiles_of};
use crate::node::tests_support::{drawn, own_state, settings, variants};

const LEFT: Point = Point::new(-3.0, 0.0);

struct Rig {
    pilot: Pilot,
    terrain: Terrain,
    own: OwnState,
    now_s: f64,
}

fn blocked(at: Point, kind: ObstructionKind) -> WayEvent {
    WayEvent::Blocked(Obstruction { at, kind })
}

/// The word for a state in the drawing.
fn word(state: &State) -> &'static str {
    match state {
        State::Driving => "Driving",
        State::Looking(_) => "Looking",
        State::Planning { .. } => "Planning",
        State::Waiting { .. } => "Waiting",
    }
}

impl Rig {
    /// A vehicle at rest at (3, 0) that has driven there along x.
    fn new(is_solid: impl Fn(f64, f64) -> bool) -> Rig {
        let mut terrain = terrain_of(is_solid);
        (0..=15).for_each(|step| terrain.note_place(Point::new(0.2 * f64::from(step), 0.0)));
        let mut pilot = Pilot::new(settings(1));
        pilot.give_up(Point::new(3.0, 0.0));
        Rig {
            pilot,
            terrain,
            own: own_state(3.0, 0.0),
            now_s: 1.0,
        }
    }

    fn open() -> Rig {
        Rig::new(|_, _| false)
    }

    /// The same behind a wall across all that is known, which bars the way to the left.
    fn walled() -> Rig {
        Rig::new(|x_m, _| (1.0..1.4).contains(&x_m))
    }

    fn now(&self) -> Time {
        Time::from_secs_f64(self.now_s)
    }

    /// Goes on after a while; returns the command and what was met.
    fn after(&mut self, wait_s: f64) -> (Option<MoveCommand>, Vec<WayEvent>) {
        self.now_s += wait_s;
        let (now, mut met) = (self.now(), Vec::new());
        let command = self.pilot.advance(now, &self.own, &self.terrain, &mut met);
        (command, met)
    }

    fn word(&self) -> &'static str {
        word(&self.pilot.state)
    }

    /// Obeys every command to turn until another state is entered; returns what is met then.
    fn look_around(&mut self) -> Vec<WayEvent> {
        for _ in 0..600 {
            let (command, met) = self.after(0.1);
            if let Some(MoveCommand::Turn(heading)) = command {
                self.own.pose.heading = heading;
            }
            if self.word() != "Looking" {
                return met;
            }
        }
        panic!("a look ends");
    }

    /// Refuses the commands to drive, until another path is searched or something is said; returns what is met.
    fn refuse_path(&mut self, why: CommandRefusal) -> Vec<WayEvent> {
        let mut all = Vec::new();
        while self.word() == "Driving" && all.is_empty() {
            let (command, met) = self.after(0.7);
            all.extend(met);
            if command.is_some() {
                self.pilot.refused(self.now(), why);
            }
        }
        all
    }
}

#[test]
fn the_drawing_shows_the_states_and_no_others() {
    let shown = drawn(include_str!("../pilot.rs"));
    assert_eq!(shown, variants::<State>());
    let look = LookAround::toward(Angle::default(), Time::ZERO);
    let states = [
        State::Driving,
        State::Looking(look),
        State::Planning {
            ready: Time::ZERO,
            found: None,
        },
        State::Waiting { until: Time::ZERO },
    ];
    let words: BTreeSet<String> = states.iter().map(|state| word(state).to_owned()).collect();
    assert_eq!(shown, words);
}

#[test]
fn what_is_released_is_driven_and_the_end_of_the_way_is_reached_at_rest() {
    let mut rig = Rig::open();
    rig.pilot.append([], LEFT, Some(StopId(7)));
    let (command, met) = rig.after(1.0);
    let Some(MoveCommand::Drive { is_off_plan, route }) = command else {
        panic!("{command:?}")
    };
    assert_eq!((is_off_plan, met), (false, vec![]));
    let end_m = route.last().unwrap().distance_to(Point::new(3.0, 0.0));
    assert!(
        (3.0..=AHEAD_M).contains(&end_m),
        "no farther than is judged"
    );
    rig.own.pose.at = Point::new(-2.7, 0.0);
    rig.own.mode = VehicleMode::Driving;
    assert_eq!(rig.after(1.0).1, [], "it moves still");
    rig.own.mode = VehicleMode::Idle;
    assert_eq!(rig.after(1.0).1, [WayEvent::Stop(StopId(7))]);
    assert!(rig.pilot.way().is_empty() && rig.word() == "Driving");
}

#[test]
fn something_unknown_is_looked_at_and_driven_once_it_is_seen() {
    let mut rig = Rig::open();
    rig.own.pose.at = Point::new(5.9, 0.0);
    rig.pilot.give_up(rig.own.pose.at);
    rig.pilot.append([], Point::new(9.0, 0.0), None);
    let (command, met) = rig.after(1.0);
    assert!(
        matches!(command, Some(MoveCommand::Turn(_))) && matches!(met[..], [WayEvent::Looks(_)])
    );
    assert_eq!(rig.word(), "Looking");
    for y in -1..1 {
        let mut tile = tiles_of(|_, _| false).remove(0);
        (tile.address.x, tile.address.y) = (1, y);
        rig.terrain.learn(&tile.into());
    }
    assert!(matches!(rig.after(0.7).0, Some(MoveCommand::Drive { .. })));
    assert_eq!(rig.word(), "Driving");
}

#[test]
fn a_look_in_vain_leads_to_a_search_that_keeps_off_the_unknown() {
    let mut rig = Rig::open();
    rig.own.pose.at = Point::new(5.9, 0.0);
    rig.pilot.give_up(rig.own.pose.at);
    rig.pilot.append([], Point::new(9.0, 0.0), None);
    rig.after(1.0);
    assert_eq!(rig.look_around(), []);
    assert_eq!(rig.word(), "Driving");
    assert!(matches!(rig.after(0.7).1[..], [WayEvent::Blocked(_)]));
    assert_eq!(rig.word(), "Planning");
    assert_eq!(
        rig.after(0.1).1,
        [WayEvent::NoPath(1)],
        "but for the unknown"
    );
}

#[test]
fn a_blocked_way_is_planned_anew_and_the_path_is_driven_when_it_is_ready() {
    let mut rig = Rig::new(|x_m, y_m| (1.0..1.4).contains(&x_m) && y_m.abs() < 2.0);
    rig.pilot.append([], LEFT, None);
    rig.own.pose.at = Point::new(2.1, 0.0);
    let (command, met) = rig.after(1.0);
    assert!(command.is_none() && matches!(met[..], [WayEvent::Blocked(_)]));
    assert_eq!(rig.word(), "Planning");
    assert_eq!(rig.pilot.deadline().map(|due| due.why), Some("path ready"));
    assert_eq!(rig.after(0.01), (None, vec![]), "it takes its time");
    let (command, met) = rig.after(0.01);
    assert!(command.is_none() && matches!(met[..], [WayEvent::Path(length_m)] if length_m > 6.0));
    assert_eq!(rig.word(), "Driving");
    assert!(matches!(rig.after(0.1).0, Some(MoveCommand::Drive { .. })));
}

#[test]
fn without_a_path_it_waits_longer_and_longer_and_looks_again_every_second_time() {
    let mut rig = Rig::walled();
    rig.own.pose.at = Point::new(2.1, 0.0);
    // Behind the wall there is known ground, and no way around it within the fence is looked for so far off.
    rig.pilot.append([], LEFT, None);
    rig.after(1.0);
    assert_eq!(rig.after(0.1).1, [WayEvent::NoPath(1)]);
    assert_eq!(rig.word(), "Waiting");
    let due = rig.pilot.deadline().unwrap();
    assert_eq!(
        (due.why, due.at.since(rig.now())),
        ("search again", SEARCH_AGAIN)
    );
    assert_eq!(rig.after(2.9), (None, vec![]));
    assert!(matches!(rig.after(0.2).1[..], [WayEvent::Looks(_)]));
    rig.look_around();
    rig.after(0.7);
    assert_eq!(rig.word(), "Planning");
    assert_eq!(rig.after(0.1).1, [WayEvent::NoPath(2)]);
    let wait = rig.pilot.deadline().unwrap().at.since(rig.now());
    assert_eq!(wait, SEARCH_AGAIN * 2);
    assert_eq!(rig.after(6.1), (None, vec![]));
    assert_eq!(rig.word(), "Driving", "no look this time");
}

#[test]
fn a_path_that_is_blocked_before_anything_of_it_is_driven_counts_as_none() {
    let mut rig = Rig::new(|x_m, y_m| (1.0..1.4).contains(&x_m) && y_m.abs() < 2.0);
    rig.pilot.append([], LEFT, None);
    rig.own.pose.at = Point::new(2.1, 0.0);
    rig.after(1.0);
    rig.after(0.1);
    // Something that the search did not know of stands at once on the path.
    let next = rig.pilot.way().points()[1];
    let at = rig
        .own
        .pose
        .at
        .toward(next, 0.6 / rig.own.pose.at.distance_to(next));
    rig.terrain
        .note_obstacle(rig.now(), obstacle(at.x_m, at.y_m));
    let (_, met) = rig.after(0.7);
    assert!(
        matches!(met[..], [WayEvent::Blocked(_), WayEvent::NoPath(1)]),
        "{met:?}"
    );
    assert_eq!(rig.word(), "Waiting");
}

#[test]
fn what_blocks_a_given_route_is_said_and_no_other_is_searched() {
    let mut rig = Rig::walled();
    let place = Point::new(2.1, 0.0);
    rig.own.pose.at = place;
    rig.pilot.take_route(place, &[LEFT], RouteRoom::Kept);
    for _ in 0..5 {
        let (command, met) = rig.after(1.0);
        assert!(command.is_none() && matches!(met[..], [WayEvent::Blocked(_)]));
        assert_eq!(rig.word(), "Driving");
    }
}

/// What a vehicle says is in its way.
fn said(met: &[WayEvent]) -> Obstruction {
    match met {
        [WayEvent::Blocked(by), ..] => *by,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_vehicle_says_whether_map_or_reflex_or_the_unseen_keep_it_from_going_on() {
    let place = Point::new(2.1, 0.0);
    let begun = |mut rig: Rig, to: Point| {
        rig.own.pose.at = place;
        rig.pilot.take_route(place, &[to], RouteRoom::Kept);
        rig
    };
    let mut walled = begun(Rig::walled(), LEFT);
    let by = said(&walled.after(1.0).1);
    assert_eq!(by.kind, ObstructionKind::Obstacle);
    assert!((1.0..1.4).contains(&by.at.x_m), "{by:?}");

    let mut halted = begun(Rig::open(), LEFT);
    halted
        .terrain
        .note_obstacle(halted.now(), obstacle(1.5, 0.0));
    let expected = blocked(Point::new(1.5, 0.0), ObstructionKind::ReflexObstacle);
    assert_eq!(halted.after(1.0).1, [expected]);

    let mut unseen = Rig::open();
    unseen.own.pose.at = Point::new(5.9, 0.0);
    unseen
        .pilot
        .take_route(unseen.own.pose.at, &[Point::new(9.0, 0.0)], RouteRoom::Kept);
    unseen.after(1.0);
    unseen.look_around();
    let by = said(&unseen.after(0.7).1);
    assert_eq!(by.kind, ObstructionKind::UnseenGround);
    assert!(by.at.x_m > 6.3, "{by:?}");
}

#[test]
fn a_vehicle_whose_commands_are_refused_says_why() {
    for why in [
        CommandRefusal::Fence,
        CommandRefusal::Separation(VehicleId(2)),
        CommandRefusal::PoseUncertain,
    ] {
        let mut rig = Rig::open();
        let place = rig.own.pose.at;
        rig.pilot.take_route(place, &[LEFT], RouteRoom::Kept);
        let met = rig.refuse_path(why);
        assert_eq!(met, [blocked(place, ObstructionKind::Refusal(why))]);
    }
}

#[test]
fn a_narrow_route_is_driven_where_there_is_room_for_the_body_alone() {
    let has_gap = |x_m: f64, y_m: f64| (1.0..1.4).contains(&x_m) && y_m.abs() > 0.4;
    for room in [RouteRoom::Kept, RouteRoom::DrivenBefore] {
        let mut rig = Rig::new(has_gap);
        rig.pilot.take_route(Point::new(3.0, 0.0), &[LEFT], room);
        let Some(MoveCommand::Drive { route, .. }) = rig.after(1.0).0 else {
            panic!("as far as it is free")
        };
        let passes = route.last().unwrap().x_m < 1.0;
        assert_eq!(passes, room == RouteRoom::DrivenBefore);
    }
}

#[test]
fn a_way_that_is_given_up_leaves_nothing_to_be_done_about_it() {
    let looking = || {
        let mut rig = Rig::open();
        rig.pilot.append([], Point::new(9.0, 0.0), None);
        rig.own.pose.at = Point::new(5.9, 0.0);
        rig.after(1.0);
        rig
    };
    let planning = || {
        let mut rig = Rig::walled();
        rig.own.pose.at = Point::new(2.1, 0.0);
        rig.pilot.append([], LEFT, None);
        rig.after(1.0);
        rig
    };
    let waiting = || {
        let mut rig = planning();
        rig.after(0.1);
        rig
    };
    for (mut rig, from) in [
        (looking(), "Looking"),
        (planning(), "Planning"),
        (waiting(), "Waiting"),
    ] {
        assert_eq!(rig.word(), from);
        rig.pilot.give_up(rig.own.pose.at);
        assert_eq!((rig.word(), rig.pilot.deadline()), ("Driving", None));
        assert_eq!(rig.after(9.0), (None, vec![]), "from {from}");
        assert_eq!(rig.pilot.failures(), 0);
    }
}

#[test]
fn a_vehicle_that_refuses_every_command_of_every_path_is_refused() {
    let mut rig = Rig::open();
    rig.pilot.append([], LEFT, None);
    for path in 0..3 {
        assert!(!rig.pilot.is_refused(), "after {path} paths");
        rig.refuse_path(CommandRefusal::Fence);
        assert_eq!(rig.word(), "Planning");
        rig.after(0.1);
    }
    assert!(rig.pilot.is_refused());
}

#[test]
fn a_vehicle_that_is_hemmed_in_drives_back_first_and_searches_from_there() {
    let mut rig = Rig::open();
    let now = rig.now();
    rig.terrain.note_obstacle(now, obstacle(3.6, 0.0));
    rig.pilot.append([], Point::new(5.0, 0.0), None);
    rig.after(1.0);
    assert!(matches!(rig.after(0.1).1[..], [WayEvent::Path(_)]));
    assert!(matches!(rig.pilot.stretch, Stretch::Retreat { .. }));
    assert_eq!(rig.pilot.failures(), 1, "it does not lead on");
    let Some(MoveCommand::Drive { route, .. }) = rig.after(0.7).0 else {
        panic!("back")
    };
    let end = *route.last().unwrap();
    assert!((1.5..2.2).contains(&end.x_m), "{end:?}");
    rig.own.pose.at = end;
    assert_eq!(rig.after(0.7).1, [blocked(end, ObstructionKind::DeadEnd)]);
    assert_eq!(rig.word(), "Planning");
}

#[test]
fn the_way_home_is_a_wish_until_a_path_is_found_and_again_after_a_failure() {
    let mut rig = Rig::walled();
    let pose = rig.own.pose;
    rig.pilot
        .go_home(rig.now(), pose, &rig.terrain, Unknown::Barred);
    assert_eq!(rig.word(), "Planning");
    assert_eq!(rig.after(0.1).1, [WayEvent::NoPath(1)]);
    assert!(rig.pilot.purpose.needs_path());
    assert!(matches!(rig.after(3.1).1[..], [WayEvent::Looks(_)]));
    rig.look_around();
    let (command, met) = rig.after(0.7);
    let expected = blocked(pose.at, ObstructionKind::NoPathHome);
    assert_eq!((command, met), (None, vec![expected]));
    assert_eq!(rig.word(), "Planning", "although something is released");
}

/// A vehicle that drives to the left when its way is changed, and the command that it is given when a wall has come up at
/// this x, metres.
fn rerouted(change: impl Fn(&mut Pilot), wall_x_m: Option<f64>) -> Option<MoveCommand> {
    let mut rig = Rig::open();
    rig.pilot.append([], LEFT, None);
    assert!(matches!(rig.after(1.0).0, Some(MoveCommand::Drive { .. })));
    rig.own.mode = VehicleMode::Driving;
    assert_eq!(rig.after(0.1).0, None, "it goes on");
    change(&mut rig.pilot);
    if let Some(wall_x_m) = wall_x_m {
        rig.terrain = terrain_of(|x_m, _| (wall_x_m..wall_x_m + 0.4).contains(&x_m));
    }
    rig.after(0.1).0
}

#[test]
fn who_still_drives_by_its_last_command_stops_for_what_has_come_up_there() {
    let changes: [fn(&mut Pilot); 3] = [
        |pilot| pilot.give_up(Point::new(3.0, 0.0)),
        |pilot| {
            pilot.take_route(
                Point::new(3.0, 0.0),
                &[Point::new(3.0, 4.0)],
                RouteRoom::Kept,
            )
        },
        |pilot| {
            pilot.state = State::Waiting {
                until: Time::from_secs_f64(99.0),
            };
            pilot.command.forget_end();
        },
    ];
    for change in changes {
        assert_eq!(rerouted(change, None), None, "it is free still");
        assert_eq!(rerouted(change, Some(-2.5)), None, "beyond its end");
        assert_eq!(rerouted(change, Some(1.0)), Some(MoveCommand::Hold));
    }
}

#[test]
fn who_drives_on_after_a_refusal_stops_for_what_has_come_up_there() {
    let refused = |wall_x_m: Option<f64>| {
        let mut rig = Rig::open();
        rig.pilot.append([], LEFT, None);
        assert!(matches!(rig.after(1.0).0, Some(MoveCommand::Drive { .. })));
        (rig.own.mode, rig.own.pose.at) = (VehicleMode::Driving, Point::new(0.0, 0.0));
        let renewed = rig.after(1.0).0;
        assert!(matches!(renewed, Some(MoveCommand::Drive { .. })));
        rig.pilot.refused(rig.now(), CommandRefusal::ReflexObstacle);
        if let Some(wall_x_m) = wall_x_m {
            rig.terrain = terrain_of(|x_m, _| (wall_x_m..wall_x_m + 0.4).contains(&x_m));
        }
        rig.after(0.1).0
    };
    assert_eq!(refused(None), None, "it is free still");
    assert_eq!(
        refused(Some(-2.5)),
        None,
        "beyond the end of what it drives"
    );
    assert_eq!(refused(Some(-0.9)), Some(MoveCommand::Hold));
}
