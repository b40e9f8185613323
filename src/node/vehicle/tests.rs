//! What the vehicle actor refuses, obeys and reports.

use super::super::tests_support::{settings, state};
use tomoswarm_proto::{
    Boot, Deviation, Lease, LegReport, OperatorId, Permille, SeenState, Tilt, VehicleMode,
};

use super::*;
use crate::autopilot::FlightState;
use crate::geom::Angle;
use crate::geom::Pose;

mod blind;
mod control;
mod drawings;
mod emergencies;
mod laws;
mod memory;
mod stored;

const LEASE: Lease = Lease {
    number: 3,
    holder: 50,
};

fn telemetry(x_m: f64, speed_mps: f64, sd_m: f64) -> In {
    let pose = Pose {
        at: Point::new(x_m, 0.0),
        heading: Angle::default(),
        sd_m,
    };
    let motion = if speed_mps > 0.0 {
        Motion::Driving
    } else {
        Motion::Resting
    };
    In::Telemetry(Telemetry {
        pose,
        flight_state: Default::default(),
        speed_mps,
        battery: Some(1.0),
        motion,
        is_armed: true,
        stored: None,
    })
}

fn at(time_s: f64) -> Time {
    Time::from_secs_f64(time_s)
}

/// A vehicle at rest at the datum that has heard its autopilot once, at 1 s.
fn vehicle() -> Vehicle {
    let mut vehicle = Vehicle::new(settings(1));
    vehicle.readiness = Readiness::Ready;
    fed(&mut vehicle, 1.0, telemetry(0.0, 0.0, 0.05));
    vehicle
}

/// Tells it something; its disk takes no time.
fn fed(vehicle: &mut Vehicle, time_s: f64, input: In) -> Vec<Out> {
    let mut out = Vec::new();
    handled(vehicle, at(time_s), input, &mut out);
    out
}

/// Lets it handle something, and its disk answer.
fn handled(vehicle: &mut Vehicle, now: Time, input: In, out: &mut Vec<Out>) {
    vehicle.handle(now, input, out).unwrap();
    let memory = out.iter().find_map(|out| {
        if let Out::Remember(memory) = out {
            Some(*memory)
        } else {
            None
        }
    });
    if let Some(memory) = memory {
        vehicle
            .handle(
                now,
                In::Remembered(Remembered {
                    on_disk: memory,
                    tried: memory,
                }),
                out,
            )
            .unwrap();
    }
}

fn drive(corners: &[(f64, f64)]) -> In {
    let route = corners
        .iter()
        .map(|(x_m, y_m)| Point::new(*x_m, *y_m))
        .collect();
    In::Command(
        Time::NEVER,
        MoveCommand::Drive {
            is_off_plan: true,
            route,
        },
    )
}

/// What an operator orders.
fn given(order: Order) -> In {
    In::Order(Sender::Operator(OperatorId(1)), order)
}

/// An order that answers a state of this number; 0 = none was heard.
fn order(kind: OrderKind, lease: Lease, revision: u32, sequence: u64) -> Order {
    let seen = Some(SeenState {
        boot: Boot(1),
        sequence,
    })
    .filter(|_| sequence > 0);
    let (vehicle, revision) = (VehicleId(1), Revision(revision));
    Order {
        vehicle,
        lease,
        run: RunId(1),
        revision,
        seen,
        kind,
        ends: vec![],
    }
}

fn scan(range_m: f64, beam_deg: f64) -> In {
    let pose = Pose {
        at: Point::new(0.0, 0.0),
        heading: Angle::default(),
        sd_m: 0.05,
    };
    In::Scan(Scan {
        pose,
        beam: Angle::from_degrees(beam_deg),
        range_m: Some(range_m),
        suspect: false,
    })
}

fn refusal(out: &[Out]) -> Option<CommandRefusal> {
    out.iter().find_map(|out| match out {
        Out::SafetyEvent(SafetyEvent::Refused(refusal)) => Some(*refusal),
        Out::SafetyEvent(_)
        | Out::AutopilotCommand(_)
        | Out::State(_)
        | Out::Publish(_)
        | Out::Remember(_)
        | Out::Order(_) => None,
    })
}

fn flies(out: &[Out]) -> bool {
    out.iter().any(|out| {
        matches!(
            out,
            Out::AutopilotCommand(AutopilotCommand::Drive { .. } | AutopilotCommand::Turn(_))
        )
    })
}

fn stops(out: &[Out]) -> bool {
    out.iter()
        .any(|out| matches!(out, Out::AutopilotCommand(AutopilotCommand::Stop)))
}

fn obeyed(out: &[Out]) -> bool {
    out.iter().any(|out| matches!(out, Out::Order(_)))
}

#[test]
fn a_route_out_of_the_envelope_is_refused() {
    let check = |corners: &[(f64, f64)], expected: Option<CommandRefusal>| {
        let mut vehicle = vehicle();
        fed(&mut vehicle, 1.0, In::Peer(state(2, 4.0, 0.0)));
        let out = fed(&mut vehicle, 1.1, drive(corners));
        assert_eq!(refusal(&out), expected, "{corners:?}");
        assert_eq!(flies(&out), expected.is_none(), "{corners:?}");
    };
    check(&[(0.0, 0.0), (0.0, 5.0)], None);
    check(&[(0.0, 0.0), (0.0, 24.8)], Some(CommandRefusal::Fence));
    check(
        &[(0.0, 0.0), (0.0, 30.0), (0.0, 5.0)],
        Some(CommandRefusal::Fence),
    );
    check(&[(3.0, 0.0), (0.0, 5.0)], Some(CommandRefusal::NotHere));
    check(&[(0.0, 0.0), (2.9, 0.0)], None);
    check(
        &[(0.0, 0.0), (3.2, 0.0)],
        Some(CommandRefusal::Separation(VehicleId(2))),
    );
}

#[test]
fn a_peers_route_is_kept_clear_of_and_only_left() {
    let mut peer = state(2, 5.0, 5.0);
    peer.leg = Some(LegReport {
        route: vec![Point::new(0.5, 5.0).into(), Point::new(0.5, 0.5).into()],
    });
    let mut vehicle = vehicle();
    fed(&mut vehicle, 1.0, In::Peer(peer));
    let across = fed(&mut vehicle, 1.1, drive(&[(0.0, 0.0), (2.0, 2.0)]));
    assert_eq!(
        refusal(&across),
        Some(CommandRefusal::Separation(VehicleId(2)))
    );
    assert!(flies(&fed(
        &mut vehicle,
        1.1,
        drive(&[(0.0, 0.0), (-2.0, -2.0)])
    )));
}

#[test]
fn who_does_not_know_where_it_is_does_not_drive() {
    let mut silent = Vehicle::new(settings(1));
    let out = fed(&mut silent, 1.0, drive(&[(0.0, 0.0), (1.0, 0.0)]));
    assert_eq!(refusal(&out), Some(CommandRefusal::NoPose));
    let mut vehicle = vehicle();
    let out = fed(&mut vehicle, 4.0, drive(&[(0.0, 0.0), (1.0, 0.0)]));
    assert_eq!(
        refusal(&out),
        Some(CommandRefusal::NoPose),
        "three seconds old"
    );
    fed(&mut vehicle, 5.0, telemetry(0.0, 0.0, 0.6));
    for command in [
        drive(&[(0.0, 0.0), (1.0, 0.0)]),
        In::Command(Time::NEVER, MoveCommand::Turn(Angle::default())),
    ] {
        assert_eq!(
            refusal(&fed(&mut vehicle, 5.0, command)),
            Some(CommandRefusal::PoseUncertain)
        );
    }
    assert!(
        stops(&fed(
            &mut vehicle,
            5.0,
            In::Command(Time::NEVER, MoveCommand::Hold)
        )),
        "holding is always allowed"
    );
}

#[test]
fn the_reflex_halts_for_what_is_near_ahead_and_then_keeps_clear_of_it() {
    // At 0.5 m/s: 0.075 m of reaction, 0.125 m of braking, 0.1 m of margin beyond a radius of 0.25 m.
    for (range_m, beam_deg, halts) in [(0.50, 0.0, true), (0.60, 0.0, false), (0.50, 80.0, false)] {
        let mut vehicle = vehicle();
        fed(&mut vehicle, 1.1, drive(&[(0.0, 0.0), (3.0, 0.0)]));
        fed(&mut vehicle, 1.2, telemetry(0.0, 0.5, 0.05));
        let out = fed(&mut vehicle, 1.2, scan(range_m, beam_deg));
        assert_eq!(stops(&out), halts, "{range_m} m at {beam_deg}°");
        fed(&mut vehicle, 2.0, telemetry(0.0, 0.0, 0.05));
        let again = fed(&mut vehicle, 2.0, drive(&[(0.0, 0.0), (3.0, 0.0)]));
        assert_eq!(
            refusal(&again),
            halts.then_some(CommandRefusal::ReflexObstacle)
        );
        assert!(
            flies(&fed(&mut vehicle, 2.0, drive(&[(0.0, 0.0), (-3.0, 0.0)]))),
            "away from it"
        );
        fed(&mut vehicle, 70.0, telemetry(0.0, 0.0, 0.05));
        assert!(
            flies(&fed(&mut vehicle, 70.0, drive(&[(0.0, 0.0), (3.0, 0.0)]))),
            "forgotten by then"
        );
    }
}

#[test]
fn what_the_reflex_met_where_a_peer_was_is_not_kept_clear_of_for_long() {
    for (is_peer, expected) in [(true, None), (false, Some(CommandRefusal::ReflexObstacle))] {
        let mut vehicle = vehicle();
        fed(&mut vehicle, 1.1, drive(&[(0.0, 0.0), (3.0, 0.0)]));
        if is_peer {
            fed(&mut vehicle, 1.1, In::Peer(state(2, 0.7, 0.0)));
        }
        fed(&mut vehicle, 1.2, telemetry(0.0, 0.5, 0.05));
        assert!(stops(&fed(&mut vehicle, 1.2, scan(0.5, 0.0))));
        let gone = State {
            sequence: 2,
            ..state(2, 0.7, 5.0)
        };
        fed(&mut vehicle, 2.0, In::Peer(gone));
        for (now_s, refused) in [(5.0, Some(CommandRefusal::ReflexObstacle)), (7.0, expected)] {
            fed(&mut vehicle, now_s, telemetry(0.0, 0.0, 0.05));
            let out = fed(&mut vehicle, now_s, drive(&[(0.0, 0.0), (3.0, 0.0)]));
            assert_eq!(refusal(&out), refused, "{is_peer}, {now_s} s");
        }
    }
}

#[test]
fn who_turns_at_a_corner_halts_for_what_has_come_up_suddenly_where_it_sets_out() {
    for (beam_deg, suspect, is_turning, halts) in [
        (90.0, true, true, true),
        (90.0, false, true, false),
        (0.0, true, true, false),
        (90.0, true, false, false),
    ] {
        let mut vehicle = vehicle();
        fed(
            &mut vehicle,
            1.1,
            drive(&[(0.0, 0.0), (0.05, 0.0), (0.05, 3.0)]),
        );
        let In::Telemetry(resting) = telemetry(0.0, 0.0, 0.05) else {
            unreachable!()
        };
        let motion = match is_turning {
            true => Motion::Turning,
            false => Motion::Resting,
        };
        fed(
            &mut vehicle,
            1.2,
            In::Telemetry(Telemetry { motion, ..resting }),
        );
        let In::Scan(scan) = scan(0.5, beam_deg) else {
            unreachable!()
        };
        let out = fed(&mut vehicle, 1.2, In::Scan(Scan { suspect, ..scan }));
        assert_eq!(stops(&out), halts, "{beam_deg}°, {suspect}, {is_turning}");
    }
}

#[test]
fn the_reflex_halts_for_what_has_come_up_suddenly_when_a_round_later_would_be_too_late() {
    // Three beams of 0.1 s each: 0.15 m more than for what is on the map.
    for (range_m, suspect, halts) in [
        (0.60, false, false),
        (0.60, true, true),
        (0.75, true, false),
    ] {
        let mut vehicle = vehicle();
        fed(&mut vehicle, 1.1, drive(&[(0.0, 0.0), (3.0, 0.0)]));
        fed(&mut vehicle, 1.2, telemetry(0.0, 0.5, 0.05));
        let In::Scan(scan) = scan(range_m, 0.0) else {
            unreachable!()
        };
        let out = fed(&mut vehicle, 1.2, In::Scan(Scan { suspect, ..scan }));
        assert_eq!(stops(&out), halts, "{range_m} m, suspect: {suspect}");
    }
}

#[test]
fn a_silent_autopilot_is_reported_once() {
    let mut vehicle = vehicle();
    let deadline = vehicle.deadline().unwrap();
    assert_eq!((deadline.at, deadline.why), (at(3.0), "telemetry silent"));
    let mut out = Vec::new();
    vehicle.wake(at(3.0), &mut out).unwrap();
    assert_eq!(out, [Out::SafetyEvent(SafetyEvent::AutopilotSilent)]);
    assert_eq!(vehicle.deadline(), None);
    fed(&mut vehicle, 9.0, telemetry(0.0, 0.0, 0.05));
    assert!(vehicle.deadline().is_some(), "it is heard again");
}

#[test]
fn higher_leases_and_revisions_win_and_old_orders_are_not_obeyed() {
    let check = |lease, revision, expected: bool| {
        let mut vehicle = vehicle();
        assert!(obeyed(&fed(
            &mut vehicle,
            1.0,
            given(order(OrderKind::Hold, LEASE, 5, 1))
        )));
        let out = fed(
            &mut vehicle,
            1.1,
            given(order(OrderKind::Start, lease, revision, 1)),
        );
        assert_eq!(obeyed(&out), expected, "{lease:?} {revision}");
    };
    check(LEASE, 6, true);
    check(LEASE, 5, false);
    check(LEASE, 4, false);
    check(
        Lease {
            number: 4,
            holder: 99,
        },
        1,
        true,
    );
    check(
        Lease {
            number: 2,
            holder: 1,
        },
        9,
        false,
    );
    check(
        Lease {
            number: 3,
            holder: 49,
        },
        1,
        true,
    );
    check(
        Lease {
            number: 3,
            holder: 51,
        },
        9,
        false,
    );
}

#[test]
fn a_start_that_answers_an_old_state_is_too_late_but_a_hold_never_is() {
    let mut vehicle = vehicle();
    fed(&mut vehicle, 30.0, telemetry(0.0, 0.0, 0.05));
    for kind in [OrderKind::Start, OrderKind::Return] {
        assert!(
            !obeyed(&fed(&mut vehicle, 30.0, given(order(kind, LEASE, 1, 1)))),
            "29 s old"
        );
        assert!(
            !obeyed(&fed(&mut vehicle, 30.0, given(order(kind, LEASE, 1, 77)))),
            "never made"
        );
    }
    assert!(obeyed(&fed(
        &mut vehicle,
        30.0,
        given(order(OrderKind::Hold, LEASE, 1, 1))
    )));
    assert!(obeyed(&fed(
        &mut vehicle,
        30.0,
        given(order(OrderKind::Start, LEASE, 2, 2))
    )));
}

#[test]
fn unread_orders_join_to_the_stronger_and_the_newer_revision() {
    let check = |unread: Order, newer: Order, expected: Order| {
        assert_eq!(join_orders(unread, newer), expected)
    };
    let of = |kind, revision| order(kind, LEASE, revision, 1);
    check(
        of(OrderKind::Hold, 1),
        of(OrderKind::Start, 2),
        of(OrderKind::Hold, 2),
    );
    check(
        of(OrderKind::Start, 2),
        of(OrderKind::Land, 1),
        of(OrderKind::Land, 2),
    );
    check(
        of(OrderKind::Return, 3),
        of(OrderKind::Land, 4),
        of(OrderKind::Land, 4),
    );
    let taken_over = order(
        OrderKind::Start,
        Lease {
            number: 4,
            holder: 9,
        },
        1,
        1,
    );
    check(
        of(OrderKind::Land, 1),
        taken_over.clone(),
        taken_over.clone(),
    );
    check(taken_over.clone(), of(OrderKind::Land, 1), taken_over);
}

#[test]
fn an_unread_emergency_is_not_lost_to_an_order_for_another_vehicle_or_run() {
    let check = |newer: Order| {
        let mut seat = crate::actor::ActorCell::new(vehicle());
        seat.push(given(order(OrderKind::Land, LEASE, 1, 0)));
        seat.push(given(newer.clone()));
        let mut out = Vec::new();
        seat.act(at(1.1), |output| out.push(output)).unwrap();
        assert!(stops(&out), "{newer:?}");
    };
    check(Order {
        vehicle: VehicleId(2),
        ..order(OrderKind::Start, LEASE, 2, 1)
    });
    check(Order {
        run: RunId(0),
        ..order(OrderKind::Start, LEASE, 2, 1)
    });
    check(Order {
        run: RunId(7),
        ..order(OrderKind::Hold, LEASE, 2, 1)
    });
}

#[test]
fn a_drive_without_a_way_never_reaches_the_autopilot() {
    let routes: [&[(f64, f64)]; 5] = [
        &[],
        &[(0.0, 0.0)],
        &[(0.0, 0.0), (f64::NAN, 1.0)],
        &[(f64::NAN, 0.0), (1.0, 0.0)],
        &[(0.0, 0.0), (1.0, f64::INFINITY)],
    ];
    for route in routes {
        let out = fed(&mut vehicle(), 1.1, drive(route));
        assert!(
            out.iter()
                .all(|out| !matches!(out, Out::AutopilotCommand(_))),
            "{route:?}: {out:?}"
        );
        assert!(refusal(&out).is_some(), "{route:?}");
    }
}

#[test]
fn a_held_vehicle_says_so_until_it_is_started_or_sent_home() {
    let mode = |vehicle: &mut Vehicle, speed_mps: f64| {
        let out = fed(vehicle, 1.2, telemetry(0.0, speed_mps, 0.05));
        out.iter()
            .find_map(|out| match out {
                Out::State(state) => Some(state.mode),
                Out::SafetyEvent(_)
                | Out::AutopilotCommand(_)
                | Out::Publish(_)
                | Out::Remember(_)
                | Out::Order(_) => None,
            })
            .unwrap()
    };
    for held in [OrderKind::Hold, OrderKind::Land] {
        for freed in [OrderKind::Start, OrderKind::Return] {
            let mut vehicle = vehicle();
            fed(&mut vehicle, 1.1, given(order(held, LEASE, 1, 1)));
            assert_eq!(
                mode(&mut vehicle, 0.3),
                VehicleMode::Driving,
                "it still brakes"
            );
            assert_eq!(mode(&mut vehicle, 0.0), VehicleMode::Held);
            fed(&mut vehicle, 1.2, given(order(freed, LEASE, 2, 1)));
            assert_eq!(mode(&mut vehicle, 0.0), VehicleMode::Idle);
        }
    }
}

#[test]
fn an_order_is_judged_by_the_age_of_its_state_however_often_states_are_made() {
    let mut vehicle = vehicle();
    for tick in 0..1000 {
        fed(
            &mut vehicle,
            2.0 + 0.01 * f64::from(tick),
            telemetry(0.0, 0.0, 0.05),
        );
    }
    assert!(
        obeyed(&fed(
            &mut vehicle,
            12.0,
            given(order(OrderKind::Start, LEASE, 1, 2))
        )),
        "10 s old"
    );
    assert!(
        !obeyed(&fed(
            &mut vehicle,
            18.0,
            given(order(OrderKind::Start, LEASE, 2, 2))
        )),
        "16 s old"
    );
}

fn flown(out: &[Out]) -> Vec<AutopilotCommand> {
    let fly = |out: &Out| match out {
        Out::AutopilotCommand(fly) => Some(fly.clone()),
        Out::SafetyEvent(_)
        | Out::State(_)
        | Out::Publish(_)
        | Out::Remember(_)
        | Out::Order(_) => None,
    };
    out.iter().filter_map(fly).collect()
}

#[test]
fn a_command_decided_long_ago_is_refused_and_a_late_hold_obeyed() {
    let route = vec![Point::new(0.0, 0.0), Point::new(2.0, 0.0)];
    let drive = MoveCommand::Drive {
        is_off_plan: true,
        route,
    };
    let mut vehicle = vehicle();
    let out = fed(&mut vehicle, 2.5, In::Command(at(1.4), drive.clone()));
    assert_eq!(refusal(&out), Some(CommandRefusal::Old));
    assert!(flies(&fed(&mut vehicle, 2.5, In::Command(at(1.6), drive))));
    assert!(stops(&fed(
        &mut vehicle,
        2.6,
        In::Command(at(1.0), MoveCommand::Hold)
    )));
}

#[test]
fn cutting_the_motors_disarms_at_once_and_nothing_is_driven_until_a_start() {
    let lease = Lease::default();
    let mut vehicle = vehicle();
    let out = fed(
        &mut vehicle,
        1.0,
        given(order(OrderKind::CutMotors, lease, 1, 1)),
    );
    assert_eq!(
        flown(&out),
        [AutopilotCommand::Stop, AutopilotCommand::Disarm]
    );
    let land = given(order(OrderKind::Start, lease, 2, 1));
    fed(&mut vehicle, 1.1, land);
    assert!(flies(&fed(
        &mut vehicle,
        1.2,
        drive(&[(0.0, 0.0), (3.0, 0.0)])
    )));
}

#[test]
fn a_landed_rover_holds_is_disarmed_and_refuses_to_drive() {
    let mut vehicle = vehicle();
    fed(
        &mut vehicle,
        1.0,
        given(order(OrderKind::Land, Lease::default(), 1, 1)),
    );
    assert_eq!(
        flown(&fed(&mut vehicle, 1.5, telemetry(0.0, 0.0, 0.05))),
        [AutopilotCommand::Disarm]
    );
    let out = fed(&mut vehicle, 1.6, drive(&[(0.0, 0.0), (3.0, 0.0)]));
    assert_eq!(refusal(&out), Some(CommandRefusal::Disarmed));
}

#[test]
fn off_plan_a_vehicle_stops_for_a_peer_that_drives_into_its_way_and_on_plan_it_does_not() {
    for is_off_plan in [true, false] {
        let mut vehicle = vehicle();
        let route = vec![Point::new(0.0, 0.0), Point::new(6.0, 0.0)];
        fed(
            &mut vehicle,
            1.0,
            In::Command(at(1.0), MoveCommand::Drive { is_off_plan, route }),
        );
        let resting = super::super::tests_support::state(2, 4.0, 3.0);
        assert!(!stops(&fed(&mut vehicle, 1.2, In::Peer(resting.clone()))));
        let corners = [(4.0, 3.0), (4.0, 0.0)].map(|(x, y)| Point::new(x, y).into());
        let leg = Some(LegReport {
            route: corners.to_vec(),
        });
        let driving = State {
            sequence: 2,
            mode: VehicleMode::Driving,
            leg,
            ..resting
        };
        let out = fed(&mut vehicle, 1.4, In::Peer(driving));
        assert_eq!(stops(&out), is_off_plan);
        let separation = Some(CommandRefusal::Separation(VehicleId(2)));
        assert_eq!(refusal(&out), separation.filter(|_| is_off_plan));
    }
}

#[test]
fn on_plan_as_well_a_vehicle_stops_for_a_peer_that_somebody_else_steers() {
    for (control, is_stopped) in [
        (Control::Ours, false),
        (Control::Remote, true),
        (Control::Own, true),
    ] {
        let mut vehicle = vehicle();
        let route = vec![Point::new(0.0, 0.0), Point::new(6.0, 0.0)];
        let is_off_plan = false;
        let command = MoveCommand::Drive { is_off_plan, route };
        assert!(flies(&fed(
            &mut vehicle,
            1.0,
            In::Command(at(1.0), command)
        )));
        // It drives toward the way, from 1.8 m beside it.
        let mut driven = super::super::tests_support::state(2, 4.0, 1.8);
        if let Some(pose) = &mut driven.pose {
            pose.heading = tomoswarm_proto::Heading::from_radians(-std::f64::consts::FRAC_PI_2);
        }
        (driven.mode, driven.control) = (VehicleMode::Driving, control);
        let out = fed(&mut vehicle, 1.4, In::Peer(driven));
        assert_eq!(stops(&out), is_stopped, "{control:?}");
    }
}

#[test]
fn a_leg_that_leads_to_a_peer_at_rest_is_not_driven_on_when_the_command_after_it_is_refused() {
    for (peer_x_m, is_stopped) in [(4.0, true), (9.0, false)] {
        let mut vehicle = vehicle();
        let command = |x_m: f64, decided_s: f64| {
            let route = vec![Point::new(0.0, 0.0), Point::new(x_m, 0.0)];
            let is_off_plan = false;
            In::Command(at(decided_s), MoveCommand::Drive { is_off_plan, route })
        };
        assert!(flies(&fed(&mut vehicle, 1.0, command(6.0, 1.0))));
        let peer = super::super::tests_support::state(2, peer_x_m, 0.0);
        assert!(!stops(&fed(&mut vehicle, 1.1, In::Peer(peer))));
        let out = fed(&mut vehicle, 1.2, command(8.5, 1.2));
        let separation = Some(CommandRefusal::Separation(VehicleId(2)));
        assert_eq!(
            (stops(&out), refusal(&out)),
            (is_stopped, separation),
            "{peer_x_m}"
        );
    }
}

fn moving(x_m: f64, speed_mps: f64, is_armed: bool) -> In {
    match telemetry(x_m, speed_mps, 0.05) {
        In::Telemetry(telemetry) => In::Telemetry(Telemetry {
            is_armed,
            ..telemetry
        }),
        other => other,
    }
}

#[test]
fn an_order_to_stop_brakes_at_once_and_what_was_decided_before_it_is_not_driven() {
    let decided = |time_s: f64| match drive(&[(0.5, 0.0), (3.0, 0.0)]) {
        In::Command(_, command) => In::Command(at(time_s), command),
        other => other,
    };
    for (kind, before, after) in [
        (
            OrderKind::Hold,
            CommandRefusal::Old,
            Some(CommandRefusal::Held),
        ),
        (
            OrderKind::Land,
            CommandRefusal::Old,
            Some(CommandRefusal::Held),
        ),
        (OrderKind::Return, CommandRefusal::Old, None),
    ] {
        let mut vehicle = vehicle();
        fed(&mut vehicle, 1.0, drive(&[(0.0, 0.0), (3.0, 0.0)]));
        fed(&mut vehicle, 2.0, telemetry(0.5, 0.5, 0.05));
        let out = fed(&mut vehicle, 2.1, given(order(kind, LEASE, 1, 1)));
        assert!(
            stops(&out) && obeyed(&out),
            "{kind:?}: without a word of the mission"
        );
        assert_eq!(
            refusal(&fed(&mut vehicle, 2.2, decided(2.0))),
            Some(before),
            "{kind:?}"
        );
        assert_eq!(
            refusal(&fed(&mut vehicle, 2.3, decided(2.2))),
            after,
            "{kind:?}"
        );
        fed(
            &mut vehicle,
            2.4,
            given(order(OrderKind::Start, LEASE, 2, 1)),
        );
        assert!(
            flies(&fed(&mut vehicle, 2.5, decided(2.45))),
            "{kind:?}, then a start"
        );
    }
}

#[test]
fn a_stop_that_was_lost_is_said_again_until_the_vehicle_rests() {
    for kind in [OrderKind::Hold, OrderKind::Land] {
        let mut vehicle = vehicle();
        fed(&mut vehicle, 1.0, drive(&[(0.0, 0.0), (9.0, 0.0)]));
        fed(&mut vehicle, 2.0, given(order(kind, LEASE, 1, 1)));
        let output = |vehicle: &mut Vehicle, tenth: u32, speed_mps: f64| {
            stops(&fed(
                vehicle,
                2.0 + 0.1 * f64::from(tenth),
                moving(0.5, speed_mps, true),
            ))
        };
        let again: Vec<u32> = (1..=10)
            .filter(|tenth| output(&mut vehicle, *tenth, 0.5))
            .collect();
        assert!(
            (3..=4).contains(&again.len()),
            "a few times a second: {again:?}"
        );
        assert!(
            !(11..=20).any(|tenth| output(&mut vehicle, tenth, 0.0)),
            "it rests"
        );
    }
}

#[test]
fn a_disarming_that_was_lost_is_said_again_until_telemetry_shows_it() {
    let mut vehicle = vehicle();
    fed(
        &mut vehicle,
        2.0,
        given(order(OrderKind::CutMotors, LEASE, 1, 1)),
    );
    let output = |vehicle: &mut Vehicle, tenth: u32, is_armed: bool| {
        let out = fed(
            vehicle,
            2.0 + 0.1 * f64::from(tenth),
            moving(0.0, 0.0, is_armed),
        );
        flown(&out).contains(&AutopilotCommand::Disarm)
    };
    let again: Vec<u32> = (1..=10)
        .filter(|tenth| output(&mut vehicle, *tenth, true))
        .collect();
    assert!((3..=4).contains(&again.len()), "{again:?}");
    assert!(
        !(11..=20).any(|tenth| output(&mut vehicle, tenth, false)),
        "it is disarmed"
    );
    fed(
        &mut vehicle,
        4.1,
        given(order(OrderKind::Start, LEASE, 2, 11)),
    );
    assert!(
        !(22..=30).any(|tenth| output(&mut vehicle, tenth, true)),
        "it was armed again"
    );
}

#[test]
fn what_is_nearer_than_the_closeness_halts_it_however_slow_it_is() {
    // At 0.1 m/s it could stop within 0.37 m of its middle.
    let halts = |closeness_m: f64, range_m: f64, beam_deg: f64| {
        let mut told_so = settings(1);
        told_so.safety.closeness_m = closeness_m;
        let mut vehicle = Vehicle::new(told_so);
        fed(&mut vehicle, 1.0, telemetry(0.0, 0.0, 0.05));
        fed(&mut vehicle, 1.1, drive(&[(0.0, 0.0), (3.0, 0.0)]));
        fed(&mut vehicle, 1.2, telemetry(0.0, 0.1, 0.05));
        let is_halted = stops(&fed(&mut vehicle, 1.2, scan(range_m, beam_deg)));
        fed(&mut vehicle, 2.0, telemetry(0.0, 0.0, 0.05));
        let again = refusal(&fed(&mut vehicle, 2.0, drive(&[(0.0, 0.0), (3.0, 0.0)])));
        assert_eq!(
            again,
            is_halted.then_some(CommandRefusal::ReflexObstacle),
            "and is not driven at again"
        );
        assert!(
            flies(&fed(&mut vehicle, 2.1, drive(&[(0.0, 0.0), (-3.0, 0.0)]))),
            "but can be left"
        );
        is_halted
    };
    assert!(!halts(0.0, 0.6, 0.0));
    assert!(halts(0.7, 0.6, 0.0) && !halts(0.7, 0.8, 0.0));
    assert!(
        !halts(0.7, 0.6, 70.0),
        "what is beside the way does not count"
    );
}

#[test]
fn who_loses_its_place_on_the_way_stops_once_and_drives_again_when_it_has_it_back() {
    let mut vehicle = vehicle();
    fed(&mut vehicle, 1.1, drive(&[(0.0, 0.0), (9.0, 0.0)]));
    assert!(
        !stops(&fed(&mut vehicle, 1.2, telemetry(0.1, 0.5, 0.4))),
        "0.5 m are allowed"
    );
    let out = fed(&mut vehicle, 1.3, telemetry(0.1, 0.5, 0.6));
    assert!(stops(&out));
    assert_eq!(refusal(&out), Some(CommandRefusal::PoseUncertain));
    assert_eq!(
        refusal(&fed(&mut vehicle, 1.4, telemetry(0.2, 0.4, 0.7))),
        None,
        "said once"
    );
    fed(&mut vehicle, 2.0, telemetry(0.2, 0.0, 0.8));
    assert_eq!(
        refusal(&fed(&mut vehicle, 2.1, drive(&[(0.2, 0.0), (9.0, 0.0)]))),
        Some(CommandRefusal::PoseUncertain)
    );
    fed(&mut vehicle, 2.2, telemetry(0.2, 0.0, 0.05));
    assert!(flies(&fed(
        &mut vehicle,
        2.3,
        drive(&[(0.2, 0.0), (9.0, 0.0)])
    )));
}

#[test]
fn a_pause_keeps_the_vehicle_where_it_is_and_a_start_lets_it_go_on() {
    let mut vehicle = vehicle();
    fed(&mut vehicle, 1.1, drive(&[(0.0, 0.0), (9.0, 0.0)]));
    fed(&mut vehicle, 2.0, telemetry(0.4, 0.5, 0.05));
    assert!(stops(&fed(
        &mut vehicle,
        2.0,
        given(order(OrderKind::Hold, LEASE, 1, 1))
    )));
    for second in 3..60 {
        let now_s = f64::from(second);
        fed(&mut vehicle, now_s, telemetry(0.5, 0.0, 0.05));
        let out = fed(&mut vehicle, now_s, drive(&[(0.5, 0.0), (9.0, 0.0)]));
        assert_eq!(
            (flies(&out), refusal(&out)),
            (false, Some(CommandRefusal::Held)),
            "after {second} s"
        );
    }
    let resume = order(OrderKind::Start, LEASE, 2, vehicle.reports.sequence());
    fed(&mut vehicle, 60.0, given(resume));
    assert!(flies(&fed(
        &mut vehicle,
        60.1,
        drive(&[(0.5, 0.0), (9.0, 0.0)])
    )));
}

/// Returns the state that is published, and the one that the other actors are told.
fn states(out: &[Out]) -> (Option<State>, Option<crate::node::OwnState>) {
    let published = out.iter().find_map(|out| {
        if let Out::Publish(state) = out {
            Some(state.clone())
        } else {
            None
        }
    });
    let told = out.iter().find_map(|out| {
        if let Out::State(state) = out {
            Some(state.clone())
        } else {
            None
        }
    });
    (published, told)
}

#[test]
fn what_travels_is_rounded_and_what_the_other_actors_are_told_is_not() {
    let mut vehicle = vehicle();
    let pose = Pose {
        at: Point::new(1.234_56, -0.000_4),
        heading: Angle::from_degrees(90.0),
        sd_m: 0.0512,
    };
    let told_of = Telemetry {
        pose,
        flight_state: Default::default(),
        speed_mps: 0.456_7,
        battery: Some(0.876_54),
        motion: Motion::Driving,
        is_armed: true,
        stored: None,
    };
    let (Some(state), Some(own)) = states(&fed(&mut vehicle, 2.0, In::Telemetry(told_of))) else {
        panic!("it says both")
    };
    assert_eq!(
        (own.pose, own.speed_mps, own.battery),
        (pose, 0.456_7, Some(0.876_54))
    );
    let report = state.pose.unwrap();
    assert_eq!((report.at.x_mm, report.at.y_mm, report.sd.0), (1235, 0, 51));
    assert_eq!(
        (
            report.heading.0,
            state.velocity.x_mmps,
            state.velocity.y_mmps
        ),
        (15_708, 0, 457)
    );
    assert_eq!(state.battery, Some(Permille(877)));
    assert_eq!(
        (state.roll, state.pitch),
        (Tilt::UNKNOWN, Tilt::UNKNOWN),
        "telemetry tells neither"
    );
    assert!(state.is_armed && state.is_landed && !state.is_at_rest);
    let flies = Telemetry {
        flight_state: FlightState {
            altitude_m: 2.5004,
            climb_mps: -0.25,
            course: Some(Angle::default()),
            tilt: Some((Angle::from_radians(0.1), Angle::from_radians(-0.02))),
        },
        ..told_of
    };
    let (Some(state), _) = states(&fed(&mut vehicle, 3.0, In::Telemetry(flies))) else {
        panic!("it says it")
    };
    assert_eq!(state.pose.unwrap().at.z_mm, 2500);
    assert_eq!(
        state.velocity,
        tomoswarm_proto::Velocity {
            x_mmps: 457,
            y_mmps: 0,
            z_mmps: -250
        },
        "it faces along y and moves along x"
    );
    assert_eq!((state.roll, state.pitch), (Tilt(1000), Tilt(-200)));
}

/// Feeds telemetry ten times a second from a moment on; returns how many states are published in so many seconds.
fn published_in(vehicle: &mut Vehicle, from_s: f64, span_s: u32, of: impl Fn(f64) -> In) -> usize {
    let ticks = (0..span_s * 10).map(|tick| from_s + f64::from(tick) / 10.0);
    ticks
        .filter(|now_s| states(&fed(vehicle, *now_s, of(*now_s))).0.is_some())
        .count()
}

#[test]
fn a_vehicle_at_rest_says_its_state_twice_a_second_and_news_at_once_or_with_the_next() {
    let telemetry_of = |x_m: f64, motion, sd_m| {
        In::Telemetry(Telemetry {
            pose: Pose {
                at: Point::new(x_m, 0.0),
                heading: Angle::default(),
                sd_m,
            },
            flight_state: Default::default(),
            speed_mps: 0.0,
            battery: Some(0.9),
            motion,
            is_armed: true,
            stored: None,
        })
    };
    let mut vehicle = vehicle();
    let rests = |now_s: f64| telemetry_of(0.03 * now_s.sin(), Motion::Resting, 0.05);
    assert_eq!(
        published_in(&mut vehicle, 2.0, 10, rests),
        20,
        "its place trembles"
    );
    let drives = |_| telemetry_of(0.0, Motion::Driving, 0.05);
    assert_eq!(published_in(&mut vehicle, 12.0, 10, drives), 50);
    let is_carried = |now_s: f64| telemetry_of(now_s, Motion::Resting, 0.05);
    let carried = published_in(&mut vehicle, 22.0, 10, is_carried);
    assert!(
        (49..=51).contains(&carried),
        "{carried}: it is somewhere else each time"
    );
    published_in(&mut vehicle, 32.0, 1, rests);
    let (nothing, _) = states(&fed(&mut vehicle, 33.0, rests(33.0)));
    let (arms, _) = states(&fed(
        &mut vehicle,
        33.1,
        telemetry_of(0.0, Motion::Turning, 0.05),
    ));
    assert!(
        nothing.is_some() && arms.is_some(),
        "another mode is said at once"
    );
}

#[test]
fn what_is_new_of_a_vehicle_at_rest_is_said_within_200_ms() {
    let In::Telemetry(resting) = telemetry(0.0, 0.0, 0.05) else {
        panic!("it is telemetry")
    };
    let rests = |_| In::Telemetry(resting);
    let posed = |at, heading, sd_m| Telemetry {
        pose: Pose { at, heading, sd_m },
        ..resting
    };
    let (home, ahead) = (Point::new(0.0, 0.0), Angle::default());
    let disarmed = Telemetry {
        is_armed: false,
        ..resting
    };
    let follows = In::Accepted(RunId(3), Revision(2));
    let cases = [
        ("nothing", None, resting),
        ("place", None, posed(Point::new(0.2, 0.0), ahead, 0.05)),
        ("heading", None, posed(home, Angle::from_radians(0.2), 0.05)),
        ("lost", None, posed(home, ahead, f64::INFINITY)),
        ("disarmed", None, disarmed),
        ("plan", Some(follows), resting),
        ("hold", Some(In::Holds(Some(StandReason::Battery))), resting),
    ];
    for (what, input, then) in cases {
        let mut vehicle = vehicle();
        assert_eq!(published_in(&mut vehicle, 2.0, 2, rests), 4);
        let is_said = |vehicle: &mut Vehicle, now_s, telemetry| {
            let out = fed(vehicle, now_s, In::Telemetry(telemetry));
            states(&out).0.is_some()
        };
        assert!(is_said(&mut vehicle, 4.0, resting) && !is_said(&mut vehicle, 4.1, resting));
        input
            .into_iter()
            .for_each(|input| drop(fed(&mut vehicle, 4.15, input)));
        assert_eq!(
            is_said(&mut vehicle, 4.2, then),
            what != "nothing",
            "{what}"
        );
    }
}

#[test]
fn a_state_says_why_the_vehicle_does_not_go_on() {
    let stands_under = |input: In| {
        let mut vehicle = vehicle();
        fed(&mut vehicle, 1.5, input);
        let (published, _) = states(&fed(&mut vehicle, 3.0, telemetry(0.0, 0.0, 0.05)));
        published.unwrap().stands_under
    };
    assert_eq!(stands_under(scan(3.0, 0.0)), None);
    for kind in [OrderKind::Hold, OrderKind::Land, OrderKind::CutMotors] {
        assert_eq!(
            stands_under(given(order(kind, LEASE, 1, 1))),
            Some(StandReason::Held),
            "{kind:?}"
        );
    }
    for reason in [StandReason::Alone, StandReason::Battery] {
        assert_eq!(stands_under(In::Holds(Some(reason))), Some(reason));
    }
    let mut vehicle = vehicle();
    let (published, _) = states(&fed(&mut vehicle, 3.0, telemetry(0.0, 0.0, f64::INFINITY)));
    let state = published.unwrap();
    assert_eq!(state.stands_under, Some(StandReason::NoPlace));
    assert_eq!(state.pose.unwrap().sd, Deviation::UNKNOWN);
}

#[test]
fn an_order_that_answers_a_state_of_another_start_moves_nobody() {
    for (boot, moves) in [(1, true), (2, false)] {
        let mut vehicle = vehicle();
        let seen = Some(SeenState {
            boot: Boot(boot),
            sequence: 1,
        });
        let start = Order {
            seen,
            ..order(OrderKind::Start, LEASE, 1, 1)
        };
        let out = fed(&mut vehicle, 1.1, given(start));
        assert_eq!(
            out.iter().any(|out| matches!(out, Out::Order(_))),
            moves,
            "boot {boot}"
        );
    }
}

/// A copter that wind may carry 0.2 m aside, at a place on x; the fence begins at 25 m.
fn copter(x_m: f64) -> Vehicle {
    let mut vehicle = Vehicle::new(VehicleSettings {
        carried_m: 0.2,
        ..settings(1)
    });
    vehicle.readiness = Readiness::Ready;
    fed(&mut vehicle, 1.0, telemetry(x_m, 0.0, 0.05));
    vehicle
}

/// Returns where the autopilot is told to go, or why not.
fn sent(
    vehicle: &mut Vehicle,
    time_s: f64,
    corners: &[(f64, f64)],
) -> Result<Vec<Point>, CommandRefusal> {
    let out = fed(vehicle, time_s, drive(corners));
    out.into_iter()
        .find_map(|output| match output {
            Out::AutopilotCommand(AutopilotCommand::Drive { corners, .. }) => Some(Ok(corners)),
            Out::SafetyEvent(SafetyEvent::Refused(why)) => Some(Err(why)),
            _ => None,
        })
        .expect("it drives or refuses")
}

#[test]
fn a_copter_keeps_what_wind_can_do_from_the_fence_and_comes_no_nearer_when_it_was_carried() {
    let refused = Err(CommandRefusal::Fence);
    let to = |from_m: f64, to: (f64, f64)| sent(&mut copter(from_m), 1.1, &[(from_m, 0.0), to]);
    assert!(
        to(20.0, (24.4, 0.0)).is_ok(),
        "0.25, 0.2 and 3 × 0.05 m are left"
    );
    assert_eq!(to(20.0, (24.45, 0.0)), refused);
    assert_eq!(
        to(24.7, (24.7, 3.0)),
        refused,
        "along the fence it would be carried nearer"
    );
    assert!(to(24.7, (24.4, 0.6)).is_ok(), "away from it");
    assert_eq!(to(24.7, (24.4, 3.0)), refused, "but slowly");
}

#[test]
fn a_vehicle_in_a_corner_of_the_fence_leaves_one_side_of_it_and_comes_no_nearer_to_the_other() {
    let refusal_from = |from: (f64, f64), to: (f64, f64)| {
        let mut vehicle = Vehicle::new(settings(1));
        vehicle.readiness = Readiness::Ready;
        let In::Telemetry(mut here) = telemetry(from.0, 0.0, 0.05) else {
            panic!("it is telemetry")
        };
        here.pose.at.y_m = from.1;
        fed(&mut vehicle, 1.0, In::Telemetry(here));
        let out = fed(&mut vehicle, 1.1, drive(&[from, to]));
        assert_ne!(flies(&out), refusal(&out).is_some());
        refusal(&out)
    };
    // 0.25 m and 3 × 0.05 m are kept from the sides at 25.
    let here = (24.3, 24.65);
    assert_eq!(refusal_from(here, (24.3, 24.2)), None);
    let nearer = Some(CommandRefusal::Fence);
    assert_eq!(
        refusal_from(here, (24.65, 24.3)),
        nearer,
        "as near to the other"
    );
    assert_eq!(
        refusal_from(here, (24.3, 24.63)),
        None,
        "a part of the way out"
    );
    assert_eq!(refusal_from(here, (20.0, 24.63)), nearer, "along it");
    assert_eq!(refusal_from(here, (23.35, 24.65)), nearer, "even a little");
    let outside = (24.3, 24.85);
    assert_eq!(
        refusal_from(outside, (24.3, 24.5)),
        None,
        "however near it is"
    );
}

#[test]
fn a_copter_that_rests_beside_where_it_was_sent_is_sent_there_the_next_time() {
    let mut copter = copter(0.0);
    assert_eq!(
        sent(&mut copter, 1.1, &[(0.0, 0.0), (2.0, 0.0)]),
        Ok(vec![Point::new(2.0, 0.0)])
    );
    fed(&mut copter, 1.2, telemetry(1.0, 0.5, 0.05));
    fed(&mut copter, 5.0, telemetry(2.15, 0.0, 0.05));
    let corners = sent(&mut copter, 5.1, &[(2.15, 0.0), (4.0, 0.0)]).unwrap();
    assert!((corners[0].x_m - 3.85).abs() < 1e-9, "{corners:?}");
}
