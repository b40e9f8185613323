//! What is decided, without a vehicle that does it.

use super::*;
use crate::node::tests_support::state;

const AUTONOMY: Duration = Duration::from_secs(60);

fn at(time_s: f64) -> Time {
    Time::from_secs_f64(time_s)
}

/// A vehicle that has heard the ground station on the bus at second 1.
fn with_bus() -> Autonomy {
    let mut autonomy = Autonomy::default();
    autonomy.heard_bus(at(1.0), VehicleId(1), Sender::Ground);
    autonomy
}

#[test]
fn a_vehicle_that_never_joined_a_bus_misses_none_and_its_own_messages_do_not_count() {
    let mut autonomy = Autonomy::default();
    autonomy.heard_bus(at(1.0), VehicleId(1), Sender::Vehicle(VehicleId(1)));
    assert_eq!(
        autonomy.watch_links(at(99.0), AUTONOMY, Goal::Following),
        []
    );
    assert!(!autonomy.is_alone());
}

#[test]
fn a_vehicle_that_is_alone_stops_once_and_holds_when_the_bus_is_lost_for_good() {
    let mut autonomy = with_bus();
    assert_eq!(autonomy.watch_links(at(3.0), AUTONOMY, Goal::Following), []);
    let alone = [Decision::Say(MissionEvent::Alone), Decision::Stop];
    assert_eq!(
        autonomy.watch_links(at(3.1), AUTONOMY, Goal::Following),
        alone
    );
    assert_eq!(autonomy.watch_links(at(3.2), AUTONOMY, Goal::Following), []);
    let lost = [
        Decision::Say(MissionEvent::BusLost),
        Decision::Hold(AutonomyCause::BusLost),
    ];
    assert_eq!(
        autonomy.watch_links(at(61.1), AUTONOMY, Goal::Following),
        lost
    );
    let held = Goal::Held(GoalSource::Itself(AutonomyCause::BusLost));
    assert_eq!(autonomy.watch_links(at(61.2), AUTONOMY, held), []);
    autonomy.heard_radio(at(62.0));
    let back = [
        Decision::Say(MissionEvent::NotAlone),
        Decision::Return(AutonomyCause::BusLost),
    ];
    assert_eq!(autonomy.watch_links(at(62.0), AUTONOMY, held), back);
}

#[test]
fn a_vehicle_that_hears_peers_by_radio_returns_when_the_bus_is_lost_for_good() {
    let mut autonomy = with_bus();
    autonomy.heard_radio(at(61.0));
    let lost = [
        Decision::Say(MissionEvent::BusLost),
        Decision::Return(AutonomyCause::BusLost),
    ];
    assert_eq!(
        autonomy.watch_links(at(61.1), AUTONOMY, Goal::Following),
        lost
    );
    autonomy.heard_bus(at(62.0), VehicleId(1), Sender::Ground);
    let back = [Decision::Say(MissionEvent::BusBack)];
    assert_eq!(
        autonomy.watch_links(at(62.0), AUTONOMY, Goal::Following),
        back
    );
}

#[test]
fn what_is_ordered_or_not_begun_is_left_alone() {
    let returning = Goal::go_home(at(0.0), GoalSource::Order);
    for goal in [
        Goal::Waiting,
        Goal::Held(GoalSource::Order),
        Goal::Home(GoalSource::Order),
        returning,
    ] {
        let decisions = with_bus().watch_links(at(99.0), AUTONOMY, goal);
        let is_left = |decision: &Decision| {
            matches!(decision, Decision::Say(_))
                || (goal == returning && *decision == Decision::Stop)
        };
        assert!(decisions.iter().all(is_left), "{goal:?}: {decisions:?}");
    }
}

#[test]
fn a_low_battery_returns_an_empty_one_holds_and_it_is_low_until_it_is_charged() {
    let safety = Safety {
        battery_return: 0.3,
        battery_hold: 0.1,
        ..Safety::default()
    };
    let mut autonomy = Autonomy::default();
    let mut watch = |battery, goal| {
        let decision = autonomy.watch_battery(battery, &safety, goal);
        (decision, autonomy.is_battery_low())
    };
    let returns = Some(Decision::Return(AutonomyCause::BatteryLow));
    let holds = Some(Decision::Hold(AutonomyCause::BatteryEmpty));
    let returning = Goal::go_home(at(0.0), GoalSource::Order);
    assert_eq!(watch(Some(0.3), Goal::Following), (None, false));
    assert_eq!(watch(Some(0.29), Goal::Following), (returns, true));
    assert_eq!(watch(Some(0.29), returning), (None, true));
    assert_eq!(watch(Some(0.09), returning), (holds.clone(), true));
    assert_eq!(watch(Some(0.09), Goal::Following), (holds, true));
    assert_eq!(
        watch(Some(0.09), Goal::Held(GoalSource::Order)),
        (None, true)
    );
    assert_eq!(watch(Some(0.34), Goal::Waiting), (None, true));
    assert_eq!(watch(Some(0.35), Goal::Waiting), (None, false));
}

#[test]
fn a_battery_whose_charge_is_not_known_any_more_is_as_low_as_it_was() {
    let safety = Safety {
        battery_return: 0.3,
        battery_hold: 0.1,
        ..Safety::default()
    };
    let mut autonomy = Autonomy::default();
    let mut watch = |battery, goal| {
        let decision = autonomy.watch_battery(battery, &safety, goal);
        (decision, autonomy.is_battery_low())
    };
    let returns = Some(Decision::Return(AutonomyCause::BatteryLow));
    assert_eq!(watch(Some(0.5), Goal::Following), (None, false));
    assert_eq!(watch(None, Goal::Following), (None, false));
    assert_eq!(watch(Some(0.2), Goal::Waiting), (None, true));
    assert_eq!(watch(None, Goal::Waiting), (None, true));
    assert_eq!(watch(None, Goal::Following), (returns, true));
}

#[test]
fn a_silent_peer_is_said_once_and_a_forgotten_one_is_not_heard_again() {
    let mut peers = Peers::new(VehicleId(1));
    peers.take(at(1.0), &state(2, 3.0, 0.0));
    let mut autonomy = Autonomy::default();
    assert_eq!(autonomy.watch_peers(at(2.0), &peers), []);
    let silent = [Decision::Say(MissionEvent::Silent(VehicleId(2)))];
    assert_eq!(autonomy.watch_peers(at(4.0), &peers), silent);
    assert_eq!(autonomy.watch_peers(at(5.0), &peers), []);
    let again = tomoswarm_proto::State {
        sequence: 2,
        ..state(2, 3.0, 0.0)
    };
    peers.take(at(6.0), &again);
    let mut forgetful = autonomy.clone();
    let heard = [Decision::Say(MissionEvent::HeardAgain(VehicleId(2)))];
    assert_eq!(autonomy.watch_peers(at(6.0), &peers), heard);
    forgetful.forget_strangers(&Peers::new(VehicleId(1)));
    assert_eq!(forgetful.watch_peers(at(6.0), &peers), []);
}
