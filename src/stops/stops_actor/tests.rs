//! One actor that is told things by hand, and several that hear each other over a bus that loses.

use super::*;
use crate::actor::tests_support::{drawn, variants};
use tomoswarm_proto::{OperatorId, Revision, RunId, StopScope};

const OPERATOR: Sender = Sender::Operator(OperatorId(1));

fn name(number: u32) -> EmergencyName {
    EmergencyName(EmergencyName::LOWEST_DRAWN + number)
}

fn stop(number: u32) -> EmergencyStop {
    EmergencyStop {
        name: name(number),
        scope: StopScope::All,
        by: OperatorId(1),
    }
}

fn standing(open: &[u32], lifted: &[u32]) -> OpenStops {
    OpenStops {
        open: open.iter().map(|number| stop(*number)).collect(),
        lifted: lifted.iter().map(|number| name(*number)).collect(),
    }
}

fn lease(number: u32) -> Lease {
    Lease { number, holder: 7 }
}

fn start(number: u32, ends: &[u32]) -> Order {
    Order {
        vehicle: VehicleId(1),
        lease: lease(number),
        run: RunId(1),
        revision: Revision(1),
        seen: None,
        kind: OrderKind::Start,
        ends: ends.iter().map(|number| name(*number)).collect(),
    }
}

fn at(time_s: f64) -> Time {
    Time::from_secs_f64(time_s)
}

fn tell(stops: &mut Stops, now: Time, input: In) -> Vec<Out> {
    let mut out = Vec::new();
    stops.handle(now, input, &mut out).unwrap();
    out
}

fn open(out: &[Out]) -> Option<Vec<EmergencyName>> {
    let open = |output: &Out| match output {
        Out::Open(open) => Some(open.iter().map(|stop| stop.name).collect()),
        _ => None,
    };
    out.iter().find_map(open)
}

#[test]
fn a_stop_is_told_the_node_first_then_everyone_then_the_disk() {
    let mut stops = Stops::new(&StopsSettings::default());
    stops.state = State::Calm;
    let out = tell(
        &mut stops,
        at(1.0),
        In::Standing(OPERATOR, standing(&[1], &[])),
    );
    let known = standing(&[1], &[]);
    assert_eq!(
        out,
        [
            Out::Heard(OPERATOR),
            Out::Open(known.open.clone()),
            Out::Publish(known.clone()),
            Out::Remember(known.clone()),
            Out::StopEvent(StopEvent::Opened(stop(1), OPERATOR)),
        ]
    );
    assert_eq!(
        tell(&mut stops, at(1.1), In::Standing(OPERATOR, known)),
        [],
        "no news"
    );
    assert_eq!(
        open(&tell(
            &mut stops,
            at(1.2),
            In::Beacon(VehicleId(2), stop(2))
        )),
        Some(vec![name(1), name(2)])
    );
}

#[test]
fn what_is_new_is_said_every_25_ms_for_half_a_second_and_then_once_a_second() {
    let mut stops = Stops::new(&StopsSettings::default());
    let mut output = Vec::new();
    stops.state = State::Calm;
    tell(&mut stops, at(0.5), In::Beacon(VehicleId(2), stop(1)));
    while let Some(deadline) = stops.deadline().filter(|deadline| deadline.at < at(4.0)) {
        let mut out = Vec::new();
        stops.wake(deadline.at, &mut out).unwrap();
        assert!(stops.deadline().unwrap().at > deadline.at);
        output.push(deadline.at.as_secs_f64() - 0.5);
    }
    let early = output.iter().filter(|at_s| **at_s <= 0.5).count();
    assert_eq!((early, output.len()), (20, 22), "{output:?}");
}

#[test]
fn what_the_disk_has_kept_is_open_from_the_beginning() {
    let kept = standing(&[3], &[1]);
    let mut stops = Stops::new(&StopsSettings {
        kept,
        lease: lease(4),
        is_silent: false,
    });
    let mut out = Vec::new();
    stops.wake(Time::ZERO, &mut out).unwrap();
    assert_eq!(open(&out), Some(vec![name(3)]));
    assert_eq!(
        open(&tell(
            &mut stops,
            at(1.0),
            In::Beacon(VehicleId(2), stop(1))
        )),
        None,
        "it was lifted"
    );
    let out = tell(&mut stops, at(1.0), In::Order(OPERATOR, start(3, &[3])));
    assert_eq!(
        out,
        [Out::StopEvent(StopEvent::LowerLease(lease(4)))],
        "it has followed a higher lease"
    );
}

#[test]
fn only_an_operators_start_in_a_lease_not_below_the_highest_lifts_what_it_names() {
    let after = |input: In| {
        let mut stops = Stops::new(&StopsSettings::default());
        tell(
            &mut stops,
            at(1.0),
            In::Standing(OPERATOR, standing(&[1, 2], &[])),
        );
        tell(&mut stops, at(1.0), In::Lease(lease(5)));
        tell(&mut stops, at(1.0), input);
        stops.set.open().map(|stop| stop.name).collect::<Vec<_>>()
    };
    let both = vec![name(1), name(2)];
    assert_eq!(after(In::Order(OPERATOR, start(5, &[1]))), [name(2)]);
    assert_eq!(after(In::Order(OPERATOR, start(6, &[1, 2]))), []);
    assert_eq!(
        after(In::Order(OPERATOR, start(4, &[1]))),
        both,
        "an old lease"
    );
    assert_eq!(
        after(In::Order(Sender::Ground, start(5, &[1]))),
        both,
        "a ground station"
    );
    assert_eq!(
        after(In::Order(OPERATOR, start(5, &[9]))),
        both,
        "a stop that nobody knows"
    );
    assert_eq!(after(In::Order(OPERATOR, start(5, &[]))), both);
    let hold = Order {
        kind: OrderKind::Hold,
        ..start(5, &[1])
    };
    assert_eq!(after(In::Order(OPERATOR, hold)), both);
    assert_eq!(
        after(In::Beacon(VehicleId(2), stop(1))),
        both,
        "a beacon cannot lift"
    );
    assert_eq!(
        after(In::Standing(
            Sender::Vehicle(VehicleId(2)),
            standing(&[], &[1])
        )),
        [name(2)]
    );
}

#[test]
fn a_lease_far_above_the_highest_heard_does_not_keep_stops_from_being_lifted() {
    let mut stops = Stops::new(&StopsSettings::default());
    tell(
        &mut stops,
        at(1.0),
        In::Standing(OPERATOR, standing(&[1], &[])),
    );
    let forged = tell(&mut stops, at(1.0), In::Lease(lease(u32::MAX)));
    assert_eq!(
        forged,
        [Out::StopEvent(StopEvent::LeaseTooHigh(lease(u32::MAX)))]
    );
    assert_eq!(
        open(&tell(
            &mut stops,
            at(1.0),
            In::Order(OPERATOR, start(1, &[1]))
        )),
        Some(vec![])
    );
}

#[test]
fn more_than_eight_new_names_a_minute_of_one_sender_stand_for_many() {
    let mut stops = Stops::new(&StopsSettings::default());
    let forger = Sender::Vehicle(VehicleId(9));
    for number in 0..100 {
        let now = at(1.0 + f64::from(number) * 0.1);
        // Each is lifted at once: nine are never open together.
        tell(
            &mut stops,
            now,
            In::Standing(forger, standing(&[number], &[])),
        );
        tell(&mut stops, now, In::Order(OPERATOR, start(1, &[number])));
    }
    let many: Vec<EmergencyName> = stops.set.open().map(|stop| stop.name).collect();
    assert!(matches!(many[..], [name] if name.is_many()), "{many:?}");
    // Another one may still, and the same one after a minute.
    tell(
        &mut stops,
        at(12.0),
        In::Standing(OPERATOR, standing(&[200], &[])),
    );
    tell(
        &mut stops,
        at(80.0),
        In::Standing(forger, standing(&[300], &[])),
    );
    assert!(stops.set.named(name(200)).is_some() && stops.set.named(name(300)).is_some());
}

#[test]
fn unread_words_of_one_sender_are_joined() {
    let (first, second) = (standing(&[1], &[]), standing(&[2], &[1]));
    let joined = In::join(
        In::Standing(OPERATOR, first),
        In::Standing(OPERATOR, second),
    );
    assert_eq!(joined, In::Standing(OPERATOR, standing(&[2], &[1])));
    let (low, high) = (In::Lease(lease(2)), In::Lease(lease(3)));
    assert_eq!(In::join(high.clone(), low), high);
}

#[test]
fn the_drawing_shows_the_states() {
    assert_eq!(
        drawn(include_str!("../stops_actor.rs")),
        variants::<State>()
    );
}

#[test]
fn who_does_not_know_an_open_stop_is_told_at_once() {
    let mut stops = Stops::new(&StopsSettings::default());
    tell(
        &mut stops,
        at(1.0),
        In::Standing(OPERATOR, standing(&[1, 2], &[])),
    );
    stops.state = State::Calm;
    let other = Sender::Vehicle(VehicleId(2));
    let knows_all = tell(
        &mut stops,
        at(5.0),
        In::Standing(other, standing(&[1, 2], &[])),
    );
    assert_eq!(knows_all, [Out::Heard(other)]);
    let knows_one = tell(
        &mut stops,
        at(6.0),
        In::Standing(other, standing(&[2], &[])),
    );
    assert_eq!(knows_one, [Out::Publish(standing(&[1, 2], &[]))]);
    assert_eq!(stops.deadline().unwrap().at, at(6.025));
}
