//! What the vehicle makes of somebody else who steers, and of an autopilot that has fallen silent.

use tomoswarm_proto::{Control, EmergencyName};

use super::*;

fn steered(control: Control) -> In {
    In::Autopilot(ControlStatus {
        switch: None,
        control,
        is_landed: true,
    })
}

/// Returns what was published last of who steers, why it stands, and whether it claims a way.
fn published(out: &[Out]) -> Option<(Control, Option<StandReason>, bool)> {
    let state = states(out).0?;
    Some((state.control, state.stands_under, state.leg.is_some()))
}

#[test]
fn what_somebody_else_steers_drives_nothing_claims_nothing_and_says_so_at_once() {
    for (control, reason) in [
        (Control::Remote, StandReason::Remote),
        (Control::Own, StandReason::Autopilot),
    ] {
        let mut vehicle = vehicle();
        assert!(flies(&fed(
            &mut vehicle,
            1.1,
            drive(&[(0.0, 0.0), (3.0, 0.0)])
        )));
        assert_eq!(fed(&mut vehicle, 1.15, steered(control)), []);
        let out = fed(&mut vehicle, 1.16, moving(0.1, 0.5, true));
        assert_eq!(
            published(&out),
            Some((control, Some(reason), false)),
            "not 0.2 s after the last one"
        );
        let out = fed(&mut vehicle, 1.2, drive(&[(0.1, 0.0), (3.0, 0.0)]));
        assert_eq!(
            (flies(&out), refusal(&out)),
            (false, Some(CommandRefusal::NotInControl))
        );
        let start = names_it(start(&vehicle, 1));
        assert_eq!(
            flown(&fed(&mut vehicle, 1.3, given(start))),
            [AutopilotCommand::TakeBack, AutopilotCommand::Arm]
        );
        fed(&mut vehicle, 1.3, steered(Control::Ours));
        assert!(flies(&fed(
            &mut vehicle,
            1.4,
            drive(&[(0.1, 0.0), (3.0, 0.0)])
        )));
    }
}

/// A start that answers the newest state.
fn start(vehicle: &Vehicle, revision: u32) -> Order {
    order(
        OrderKind::Start,
        LEASE,
        revision,
        vehicle.reports.sequence(),
    )
}

/// The same order, which names the take-over.
fn names_it(order: Order) -> Order {
    Order {
        ends: vec![EmergencyName::of_take_over(VehicleId(1), Boot(1))],
        ..order
    }
}

#[test]
fn a_take_over_ends_only_by_an_operators_start_that_names_it_and_answers_a_later_state() {
    let mut vehicle = vehicle();
    let before = names_it(start(&vehicle, 1));
    fed(&mut vehicle, 1.2, steered(Control::Remote));
    fed(&mut vehicle, 1.3, telemetry(0.0, 0.0, 0.05));
    let after = start(&vehicle, 1);
    let of_another_start = vec![EmergencyName::of_take_over(VehicleId(1), Boot(2))];
    for (sender, order, why) in [
        (
            Sender::Operator(OperatorId(1)),
            before,
            "it answers a state of before",
        ),
        (
            Sender::Operator(OperatorId(1)),
            after.clone(),
            "it names nothing",
        ),
        (
            Sender::Operator(OperatorId(1)),
            Order {
                ends: of_another_start,
                ..after.clone()
            },
            "another one",
        ),
        (
            Sender::Ground,
            names_it(after.clone()),
            "the ground ends nothing",
        ),
        (
            Sender::Operator(OperatorId(1)),
            Order {
                kind: OrderKind::Return,
                ..after.clone()
            },
            "no start",
        ),
    ] {
        assert_eq!(
            fed(&mut vehicle, 1.4, In::Order(sender, order)),
            [],
            "{why}"
        );
    }
    // One that has fallen silent is still taken over.
    fed(&mut vehicle, 1.45, steered(Control::Silent));
    assert_eq!(
        fed(&mut vehicle, 1.5, In::Order(Sender::Ground, after.clone())),
        []
    );
    assert_eq!(
        flown(&fed(&mut vehicle, 1.6, given(names_it(after)))),
        [AutopilotCommand::TakeBack, AutopilotCommand::Arm]
    );
    let next = Order {
        revision: Revision(2),
        ..start(&vehicle, 2)
    };
    assert_eq!(
        flown(&fed(&mut vehicle, 1.7, given(next))),
        [AutopilotCommand::Arm],
        "it is over"
    );
}

#[test]
fn what_was_on_its_way_before_it_was_taken_back_does_not_keep_it() {
    let mut vehicle = vehicle();
    for control in [Control::Remote, Control::Silent] {
        fed(&mut vehicle, 1.1, steered(control));
    }
    fed(&mut vehicle, 1.2, telemetry(0.0, 0.0, 0.05));
    let start = names_it(start(&vehicle, 1));
    assert!(flown(&fed(&mut vehicle, 1.3, given(start))).contains(&AutopilotCommand::TakeBack));
    // The autopilot was heard again just before that, and the link's answer to it comes after.
    for control in [Control::Remote, Control::Ours] {
        fed(&mut vehicle, 1.3, steered(control));
    }
    assert!(flies(&fed(
        &mut vehicle,
        1.4,
        drive(&[(0.0, 0.0), (3.0, 0.0)])
    )));
}

#[test]
fn an_autopilot_that_acts_by_itself_is_stopped_where_the_vehicle_is_to_stand() {
    for (control, stops) in [(Control::Own, true), (Control::Remote, false)] {
        let mut vehicle = vehicle();
        fed(
            &mut vehicle,
            1.1,
            given(order(OrderKind::Hold, LEASE, 1, 1)),
        );
        assert_eq!(
            flown(&fed(&mut vehicle, 1.2, steered(control))).contains(&AutopilotCommand::Stop),
            stops,
            "{control:?}"
        );
        let out = fed(&mut vehicle, 1.6, moving(0.1, 0.5, true));
        assert_eq!(
            flown(&out).contains(&AutopilotCommand::Stop),
            stops,
            "again while it moves"
        );
    }
}

#[test]
fn an_order_that_stands_is_named_before_somebody_who_steers() {
    let mut vehicle = vehicle();
    fed(&mut vehicle, 1.1, steered(Control::Remote));
    fed(
        &mut vehicle,
        1.2,
        given(order(OrderKind::Hold, LEASE, 1, 1)),
    );
    let out = fed(&mut vehicle, 1.3, telemetry(0.0, 0.0, 0.05));
    assert_eq!(
        published(&out),
        Some((Control::Remote, Some(StandReason::Held), false))
    );
}

#[test]
fn that_the_autopilot_has_fallen_silent_is_published_without_telemetry() {
    let mut vehicle = vehicle();
    let out = fed(&mut vehicle, 3.0, steered(Control::Silent));
    assert_eq!(
        published(&out),
        Some((Control::Silent, Some(StandReason::Autopilot), false))
    );
    assert!(
        states(&out).1.is_none(),
        "the other actors are told nothing old"
    );
    assert_eq!(
        fed(
            &mut Vehicle::new(settings(1)),
            3.0,
            steered(Control::Silent)
        ),
        [],
        "never heard"
    );
}

#[test]
fn one_that_flies_is_not_landed() {
    let mut vehicle = vehicle();
    fed(
        &mut vehicle,
        1.1,
        In::Autopilot(ControlStatus {
            switch: None,
            control: Control::Ours,
            is_landed: false,
        }),
    );
    let (state, _) = states(&fed(&mut vehicle, 1.2, telemetry(0.0, 0.0, 0.05)));
    assert!(!state.unwrap().is_landed);
}

/// The switch of the remote control stands here.
fn switched(switch: Option<RemoteSwitch>) -> In {
    In::Autopilot(ControlStatus {
        switch,
        ..ControlStatus::default()
    })
}

#[test]
fn the_switch_of_a_remote_control_holds_until_it_is_let_go_and_a_start_comes() {
    let mut vehicle = vehicle();
    assert!(flies(&fed(
        &mut vehicle,
        1.1,
        drive(&[(0.0, 0.0), (3.0, 0.0)])
    )));
    let out = fed(&mut vehicle, 1.2, switched(Some(RemoteSwitch::Hold)));
    assert_eq!(flown(&out), [AutopilotCommand::Stop]);
    let (state, _) = states(&fed(&mut vehicle, 1.25, moving(0.1, 0.0, false)));
    assert_eq!(state.unwrap().stands_under, Some(StandReason::Remote));
    let refused = fed(&mut vehicle, 1.3, drive(&[(0.1, 0.0), (3.0, 0.0)]));
    assert_eq!(refusal(&refused), Some(CommandRefusal::Held));
    let early = start(&vehicle, 1);
    assert_eq!(
        fed(&mut vehicle, 1.4, given(early)),
        [],
        "it stands at hold"
    );
    assert_eq!(flown(&fed(&mut vehicle, 1.5, switched(None))), []);
    assert!(!flies(&fed(
        &mut vehicle,
        1.6,
        drive(&[(0.1, 0.0), (3.0, 0.0)])
    )));
    fed(&mut vehicle, 1.8, moving(0.1, 0.0, false));
    let late = start(&vehicle, 2);
    assert_eq!(
        flown(&fed(&mut vehicle, 1.9, given(late))),
        [AutopilotCommand::Arm]
    );
}

#[test]
fn the_switch_of_a_remote_control_sends_home_what_nothing_else_holds() {
    let home = |out: &[Out]| {
        let order = |out: &Out| match out {
            Out::Order(order) => Some(order.kind),
            _ => None,
        };
        out.iter().find_map(order)
    };
    let mut free = vehicle();
    let out = fed(&mut free, 1.1, switched(Some(RemoteSwitch::Return)));
    assert_eq!(
        (flown(&out), home(&out)),
        (
            vec![AutopilotCommand::Stop, AutopilotCommand::Arm],
            Some(OrderKind::Return)
        )
    );
    assert_eq!(
        fed(&mut free, 1.2, switched(Some(RemoteSwitch::Return))),
        []
    );
    let mut taken = vehicle();
    fed(&mut taken, 1.1, steered(Control::Remote));
    let out = fed(
        &mut taken,
        1.2,
        In::Autopilot(ControlStatus {
            control: Control::Remote,
            is_landed: true,
            switch: Some(RemoteSwitch::Return),
        }),
    );
    assert_eq!(
        (flown(&out), home(&out)),
        (vec![AutopilotCommand::Stop], None)
    );
}

#[test]
fn its_state_says_whether_the_vehicle_obeys_its_mission() {
    let may_move = |vehicle: &mut Vehicle, time_s: f64| {
        let out = fed(vehicle, time_s, telemetry(0.0, 0.0, 0.05));
        states(&out).1.map(|own| own.may_move)
    };
    let mut taken = vehicle();
    assert_eq!(may_move(&mut taken, 1.1), Some(true));
    fed(&mut taken, 1.2, steered(Control::Remote));
    assert_eq!(may_move(&mut taken, 1.3), Some(false));
    let named = names_it(start(&taken, 1));
    let of_operator = In::Order(Sender::Operator(OperatorId(1)), named);
    fed(&mut taken, 1.4, of_operator);
    assert_eq!(may_move(&mut taken, 1.5), Some(true));

    let mut held = vehicle();
    fed(&mut held, 1.1, given(order(OrderKind::Hold, LEASE, 1, 1)));
    assert_eq!(may_move(&mut held, 1.2), Some(false));
    let resume = order(OrderKind::Start, LEASE, 2, held.reports.sequence());
    fed(&mut held, 1.3, given(resume));
    assert_eq!(may_move(&mut held, 1.4), Some(true));
}
