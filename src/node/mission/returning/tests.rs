//! Whose turn it is to return, and what becomes of a return, without a vehicle that drives.

use tomoswarm_proto::{State, VehicleMode};

use super::*;
use crate::node::mission::AutonomyCause;
use crate::node::mission::goal::{Goal, GoalSource};
use crate::node::tests_support::state;

/// There is no place aside.
fn nowhere(_: u32) -> Option<Vec<Point>> {
    None
}

fn at(time_s: f64) -> Time {
    Time::from_secs_f64(time_s)
}

/// Peers of vehicle 2, each heard at a time (s), driving or not.
fn peers(heard: &[(u8, f64, bool)]) -> Peers {
    let mut peers = Peers::new(VehicleId(2));
    for (sequence, (id, heard_s, drives)) in (1..).zip(heard) {
        let mode = if *drives {
            VehicleMode::Driving
        } else {
            VehicleMode::Idle
        };
        let told = State {
            mode,
            sequence,
            ..state(*id, f64::from(*id), 5.0)
        };
        peers.take(at(*heard_s), &told);
    }
    peers
}

fn queue_since(since_s: f64) -> ReturnQueue {
    ReturnQueue {
        since: at(since_s),
        try_at: Time::ZERO,
        barred_since: None,
        has_stepped_back: false,
    }
}

/// A return of vehicle 2 that was ordered at second 1.
fn ordered() -> Return {
    let Goal::Returning(home) = Goal::go_home(at(1.0), GoalSource::Order) else {
        panic!("it returns")
    };
    home
}

/// The same, under way.
fn under_way(bold_since: Option<f64>, presses_on: bool) -> Return {
    let stage = ReturnStage::UnderWay {
        bold_since: bold_since.map(at),
        presses_on,
    };
    Return { stage, ..ordered() }
}

fn returning(now_s: f64, peers: &Peers, home: Return) -> Returning<'_> {
    Returning {
        now: at(now_s),
        own: VehicleId(2),
        peers,
        home,
        is_battery_low: home.by == GoalSource::Itself(AutonomyCause::BatteryLow),
    }
}

#[test]
fn lower_ids_go_first_and_higher_ones_are_waited_for_until_they_stand_or_for_a_while() {
    let is_its_turn = |now_s: f64, heard: &[(u8, f64, bool)]| {
        returning(now_s, &peers(heard), ordered()).is_its_turn(&queue_since(1.0))
    };
    assert!(is_its_turn(1.0, &[]), "it is alone");
    assert!(!is_its_turn(2.9, &[(1, 1.0, false)]) && is_its_turn(3.0, &[(1, 1.0, false)]));
    assert!(!is_its_turn(9.0, &[(1, 9.0, true)]), "a lower one drives");
    assert!(
        !is_its_turn(60.0, &[(3, 60.0, true)]),
        "a higher one drives"
    );
    assert!(is_its_turn(61.1, &[(3, 61.0, true)]) && is_its_turn(2.0, &[(3, 2.0, false)]));
    let hears = |now_s: f64| is_its_turn(now_s, &[(3, 1.5, false)]);
    assert!(
        !hears(1.9) && hears(2.0),
        "what its peers say of where they go now is waited for"
    );
}

#[test]
fn lower_ids_that_never_rest_are_waited_for_for_a_while_shorter_with_a_low_battery() {
    let low = Return {
        by: GoalSource::Itself(AutonomyCause::BatteryLow),
        ..ordered()
    };
    let is_its_turn = |now_s: f64, home: Return| {
        returning(now_s, &peers(&[(1, now_s, true)]), home).is_its_turn(&queue_since(1.0))
    };
    assert!(!is_its_turn(300.0, ordered()) && is_its_turn(301.1, ordered()));
    assert!(!is_its_turn(60.0, low) && is_its_turn(61.1, low));
    let mut homeward = peers(&[(1, 400.0, true)]);
    let said = tomoswarm_proto::MissionProgress {
        vehicle: VehicleId(1),
        boot: state(1, 1.0, 5.0).boot,
        phase: tomoswarm_proto::MissionPhase::Returning,
        goal: Some(tomoswarm_proto::Position::default()),
        ..tomoswarm_proto::MissionProgress::default()
    };
    homeward.note_goal(at(400.0), &said);
    for home in [ordered(), low] {
        let waits = !returning(400.0, &homeward, home).is_its_turn(&queue_since(1.0));
        assert!(waits, "one that drives home goes first");
    }
}

#[test]
fn who_lets_others_go_first_does_not_wait_for_long_until_they_stand() {
    let lets_first = Return {
        lets_first_since: Some(at(1.0)),
        ..ordered()
    };
    let drive = |now_s: f64| peers(&[(1, now_s, true), (3, now_s, true)]);
    let is_its_turn =
        |now_s: f64| returning(now_s, &drive(now_s), lets_first).is_its_turn(&queue_since(1.0));
    assert!(!is_its_turn(20.9) && is_its_turn(21.1));
}

#[test]
fn a_vehicle_that_has_stepped_back_waits_longer_unless_its_battery_is_low() {
    let peers = peers(&[(3, 100.0, true)]);
    let queue = ReturnQueue {
        has_stepped_back: true,
        ..queue_since(1.0)
    };
    let low = Return {
        by: GoalSource::Itself(AutonomyCause::BatteryLow),
        ..ordered()
    };
    assert!(!returning(100.0, &peers, ordered()).is_its_turn(&queue));
    assert!(returning(100.0, &peers, low).is_its_turn(&queue));
    let later = ReturnQueue {
        try_at: at(101.0),
        ..queue
    };
    assert!(
        !returning(100.0, &peers, low).is_its_turn(&later),
        "not yet"
    );
}

#[test]
fn a_known_way_is_driven_and_every_third_time_the_unknown_is_a_resort() {
    let peers = peers(&[]);
    let unknown = |tries: u32| {
        let home = Return { tries, ..ordered() };
        match returning(5.0, &peers, home).turn(
            &queue_since(1.0),
            (WayHome::Open, || Bars::Nobody),
            nowhere,
        ) {
            ReturnDecision::Drives(_, unknown) => unknown,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(
        [0, 1, 2, 3].map(unknown),
        [
            Unknown::Barred,
            Unknown::Barred,
            Unknown::LastResort,
            Unknown::Barred
        ]
    );
}

#[test]
fn behind_peers_it_waits_until_they_have_had_time_enough() {
    let peers = peers(&[(3, 5.0, false)]);
    let ReturnDecision::Waits(home) = returning(5.0, &peers, ordered()).turn(
        &queue_since(1.0),
        (WayHome::BehindPeers, || Bars::Nobody),
        nowhere,
    ) else {
        panic!("it waits")
    };
    let ReturnStage::InQueue(queue) = home.stage else {
        panic!("{home:?}")
    };
    assert_eq!((queue.barred_since, queue.try_at), (Some(at(5.0)), at(8.0)));
    let drives_at = |now_s: f64| {
        matches!(
            returning(now_s, &peers, home).turn(
                &queue,
                (WayHome::BehindPeers, || Bars::Nobody),
                nowhere
            ),
            ReturnDecision::Drives(_, Unknown::LastResort)
        )
    };
    // 15 s, and 2 s more for the peer.
    assert!(!drives_at(21.9) && drives_at(22.0));
}

/// What vehicle 2 does at a moment after tries in vain, when vehicle 3 bars its way since second 5; a place aside is said by
/// how often it is looked for in a row.
fn behind_peers(now_s: f64, tries: u32, drives: bool, way: (WayHome, Bars)) -> ReturnDecision {
    let peers = peers(&[(3, 5.0, drives)]);
    let home = Return { tries, ..ordered() };
    let queue = ReturnQueue {
        barred_since: Some(at(5.0)),
        ..queue_since(1.0)
    };
    let aside = |times: u32| Some(vec![Point::new(f64::from(times), 0.0)]);
    returning(now_s, &peers, home).turn(&queue, (way.0, || way.1), aside)
}

#[test]
fn behind_peers_it_goes_through_the_unknown_and_steps_aside_by_turns() {
    let steps_aside =
        |tries: u32| match behind_peers(30.0, tries, false, (WayHome::BehindPeers, Bars::Nobody)) {
            ReturnDecision::StepsAside(home, corners) => Some((home, corners[0].x_m)),
            ReturnDecision::Drives(..) => None,
            waits @ ReturnDecision::Waits(_) => panic!("{waits:?}"),
        };
    let times = [0, 1, 2, 3].map(|tries| steps_aside(tries).map(|(_, times)| times));
    assert_eq!(times, [None, Some(1.0), None, Some(2.0)]);
    let (home, _) = steps_aside(1).unwrap();
    let aside = under_way(None, false);
    assert_eq!(home, Return { tries: 1, ..aside });
    let none = peers(&[]);
    let back = returning(40.0, &none, home).after_refused_paths().unwrap();
    assert!(back.tries == 2 && !back.is_under_way(), "then it waits");
}

/// The same, when the way is open and the vehicle would bar the ways of others since a moment.
fn barring(now_s: f64, home: Return, bars: Bars) -> ReturnDecision {
    let peers = peers(&[(3, 5.0, true)]);
    let aside = |_| Some(vec![Point::new(1.0, 0.0)]);
    let way = (WayHome::Open, || bars);
    returning(now_s, &peers, home).turn(&queue_since(1.0), way, aside)
}

#[test]
fn who_would_bar_others_lets_them_go_home_first_and_steps_aside_where_it_bars_them_as_it_stands() {
    let waits = |decision| matches!(decision, ReturnDecision::Waits(_));
    let steps_aside = |decision| matches!(decision, ReturnDecision::StepsAside(..));
    assert!(waits(barring(6.0, ordered(), Bars::AtHome)));
    assert!(steps_aside(barring(6.0, ordered(), Bars::Here)));
    assert!(steps_aside(barring(6.0, ordered(), Bars::EachOther)));
    let goes = barring(6.0, ordered(), Bars::HereAlone);
    assert!(
        matches!(goes, ReturnDecision::Drives(..)),
        "by that it makes room, too"
    );
    let peers_stand = peers(&[(3, 5.0, false)]);
    let aside = |_| Some(vec![Point::new(1.0, 0.0)]);
    let way = (WayHome::BehindPeers, || Bars::HereAlone);
    let barred = returning(6.0, &peers_stand, ordered()).turn(&queue_since(1.0), way, aside);
    assert!(steps_aside(barred), "its own way is barred");
    let peers = peers(&[(3, 5.0, true)]);
    let no_room = |bars: Bars| {
        let way = (WayHome::Open, || bars);
        returning(6.0, &peers, ordered()).turn(&queue_since(1.0), way, nowhere)
    };
    assert!(waits(no_room(Bars::Here)), "until there is");
    let goes = no_room(Bars::EachOther);
    assert!(
        matches!(goes, ReturnDecision::Drives(..)),
        "both would wait for each other"
    );
}

#[test]
fn those_whom_it_would_bar_are_let_go_first_for_a_while_in_all() {
    let ReturnDecision::StepsAside(home, _) = barring(6.0, ordered(), Bars::Here) else {
        panic!("it steps aside")
    };
    // It comes back from there, and waits again: the time goes on.
    let back = home.stepped_back(at(60.0), at(63.0));
    let ReturnDecision::Waits(waits) = barring(63.0, back, Bars::AtHome) else {
        panic!("it waits")
    };
    assert_eq!(waits.lets_first_since, Some(at(6.0)));
    let drives = |now_s, home| {
        matches!(
            barring(now_s, home, Bars::AtHome),
            ReturnDecision::Drives(..)
        )
    };
    assert!(!drives(305.9, waits) && drives(306.0, waits));
    let tried = Return {
        tries: FAILURES_MAX,
        ..ordered()
    };
    let low = Return {
        by: GoalSource::Itself(AutonomyCause::BatteryLow),
        ..ordered()
    };
    assert!(drives(6.0, tried) && drives(6.0, low));
}

#[test]
fn who_lets_others_first_makes_more_room_when_they_have_not_come_home_for_long() {
    let peers = peers(&[(3, 5.0, true)]);
    let turn = |now_s: f64, barred_since: Option<f64>| {
        let queue = ReturnQueue {
            barred_since: barred_since.map(at),
            ..queue_since(1.0)
        };
        let aside = |_| Some(vec![Point::new(1.0, 0.0)]);
        let way = (WayHome::Open, || Bars::AtHome);
        returning(now_s, &peers, ordered()).turn(&queue, way, aside)
    };
    let waits = |decision| matches!(decision, ReturnDecision::Waits(_));
    let steps_aside = |decision| matches!(decision, ReturnDecision::StepsAside(..));
    assert!(waits(turn(90.0, None)), "it begins to");
    assert!(waits(turn(65.9, Some(6.0))));
    assert!(steps_aside(turn(66.0, Some(6.0))));
}

#[test]
fn who_bars_others_when_it_has_come_home_lets_them_go_first_after_all() {
    let none = peers(&[]);
    let since = |since_s: f64| Return {
        lets_first_since: Some(at(since_s)),
        ..under_way(None, false)
    };
    let back =
        |now_s: f64, bars: Bars| returning(now_s, &none, since(6.0)).lets_first_after_all(|| bars);
    assert_eq!(back(20.0, Bars::Nobody), None);
    let waits = back(20.0, Bars::Here).unwrap();
    assert!(!waits.is_under_way() && waits.lets_first_since == Some(at(6.0)));
    assert_eq!(back(306.0, Bars::Here), None, "long enough in all");
    let low = Return {
        by: GoalSource::Itself(AutonomyCause::BatteryLow),
        ..since(6.0)
    };
    let asked = || panic!("it waits for nobody");
    assert_eq!(
        returning(20.0, &none, low).lets_first_after_all(asked),
        None
    );
}

#[test]
fn whether_it_bars_others_is_asked_only_of_one_that_may_let_them_go_first() {
    let peers = peers(&[(3, 5.0, true)]);
    let home = Return {
        tries: FAILURES_MAX,
        ..ordered()
    };
    let asked = || panic!("it is a search");
    let way = (WayHome::Open, asked);
    let turn = returning(6.0, &peers, home).turn(&queue_since(1.0), way, nowhere);
    assert!(matches!(turn, ReturnDecision::Drives(..)));
}

#[test]
fn while_others_move_it_presses_on_whatever_the_way_looks_like() {
    let peers = peers(&[(3, 5.0, true)]);
    for way_home in [WayHome::Open, WayHome::BehindPeers, WayHome::Unknown] {
        let turn = returning(5.0, &peers, ordered()).turn(
            &queue_since(1.0),
            (way_home, || Bars::Nobody),
            nowhere,
        );
        let expected = under_way(Some(5.0), true);
        assert_eq!(turn, ReturnDecision::Drives(expected, Unknown::LastResort));
    }
}

#[test]
fn a_vehicle_that_finds_no_path_gives_way_unless_it_presses_on_or_nobody_has_moved() {
    let peers = peers(&[(3, 5.0, false)]);
    let gives_way = |home, failures| {
        returning(9.0, &peers, home)
            .after_failures(failures)
            .is_some()
    };
    assert!(
        gives_way(under_way(None, false), 1),
        "others may have to move"
    );
    assert!(gives_way(under_way(Some(4.0), false), 1), "one has moved");
    assert!(
        !gives_way(under_way(Some(6.0), false), 5) && gives_way(under_way(Some(6.0), false), 6)
    );
    assert!(!gives_way(under_way(None, true), 5) && gives_way(under_way(None, true), 6));
    assert!(!gives_way(ordered(), 9), "it is in the queue");
}

#[test]
fn on_its_way_it_yields_to_a_lower_id_that_drives() {
    let peers = peers(&[(1, 5.0, true), (3, 5.0, true), (4, 5.0, false)]);
    let yields = |home, id| {
        let refused_for = VehicleId(id);
        let back = returning(5.0, &peers, home).after_refusal_for(refused_for);
        back.map(|home| home.tries)
    };
    let drives = under_way(None, false);
    assert_eq!(
        [1, 3, 4, 9].map(|id| yields(drives, id)),
        [Some(0), None, None, None]
    );
    assert_eq!(yields(ordered(), 1), None, "it stands in the queue");
    let stands = self::peers(&[(1, 5.0, false)]);
    let back = returning(5.0, &stands, drives).after_refusal_for(VehicleId(1));
    assert_eq!(back, None);
}

#[test]
fn a_try_in_vain_is_counted_and_the_next_one_follows_later() {
    let peers = peers(&[]);
    let refused = |home| returning(9.0, &peers, home).after_refused_paths();
    let back = refused(under_way(None, false)).unwrap();
    let ReturnStage::InQueue(queue) = back.stage else {
        panic!("{back:?}")
    };
    assert_eq!(
        (back.tries, queue.since, queue.try_at),
        (1, at(9.0), at(12.0))
    );
    let low = Return {
        by: GoalSource::Itself(AutonomyCause::BatteryLow),
        ..under_way(None, true)
    };
    assert_eq!(refused(low), None, "it has no time to lose");
}
