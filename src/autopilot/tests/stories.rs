//! What the link says, word by word, in small stories.

use tomoswarm_proto::Control;

use super::super::link::{AutopilotLink, In, LinkEvent, Out, Reason};
use super::super::tests_support::resting_report;
use super::super::{
    Ack, ArmRefusal, AutopilotCommand, AutopilotLinkSettings, AutopilotReport, Command, CommandAck,
    CommandPurpose, ControlStatus, FlightMode, FlightState, Item, Motion, StoredPhase,
    StoredReport, SystemStatus, VehicleKind,
};
use crate::actor::Actor;
use crate::geom::{Angle, Point};
use crate::time::Time;

fn at(time_s: f64) -> Time {
    Time::from_secs_f64(time_s)
}

/// A link that has heard a report of a vehicle, at 1 s.
fn link(kind: VehicleKind, heard: AutopilotReport) -> AutopilotLink {
    let mut link = AutopilotLink::new(AutopilotLinkSettings {
        kind,
        altitude_m: 2.0,
    });
    fed(&mut link, 1.0, In::Report(heard));
    link
}

/// Tells it something, after what was due before; returns what it says.
fn fed(link: &mut AutopilotLink, time_s: f64, input: In) -> Vec<Out> {
    let mut out = Vec::new();
    while let Some(due) = link.deadline().filter(|due| due.at < at(time_s)) {
        link.wake(due.at, &mut out).unwrap();
    }
    link.handle(at(time_s), input, &mut out).unwrap();
    out
}

/// The commands among what was said.
fn commands(out: &[Out]) -> Vec<Command> {
    let of = |out: &Out| {
        if let Out::Command(sent_at) = out {
            Some(sent_at.command.clone())
        } else {
            None
        }
    };
    out.iter().filter_map(of).collect()
}

/// Tells it a want; returns what it commands.
fn wanted(link: &mut AutopilotLink, time_s: f64, fly: AutopilotCommand) -> Vec<Command> {
    commands(&fed(link, time_s, In::AutopilotCommand(fly)))
}

/// Answers the last command; returns what it says then.
fn answered(link: &mut AutopilotLink, time_s: f64, result: CommandAck) -> Vec<Out> {
    let number = link.number;
    let arm_refusal = (result == CommandAck::Failed).then_some(ArmRefusal::NoPlace);
    fed(
        link,
        time_s,
        In::Ack(Ack {
            number,
            result,
            arm_refusal,
        }),
    )
}

fn drive() -> AutopilotCommand {
    AutopilotCommand::Drive {
        corners: vec![Point::new(3.0, 0.0)],
        speed_mps: 0.5,
    }
}

fn event_of(out: &[Out]) -> Option<LinkEvent> {
    out.iter().find_map(|out| {
        if let Out::LinkEvent(event) = out {
            Some(*event)
        } else {
            None
        }
    })
}

fn control(out: &[Out]) -> Option<Control> {
    out.iter().find_map(|out| {
        if let Out::Status(status) = out {
            Some(status.control)
        } else {
            None
        }
    })
}

fn mission() -> Vec<Item> {
    let to = |x_m: f64| Item::Land {
        at: Some(Point::new(x_m, 0.0)),
    };
    vec![to(0.0), to(2.0), to(4.0)]
}

fn follow(from: usize) -> AutopilotCommand {
    AutopilotCommand::FollowStored {
        items: mission(),
        from,
    }
}

fn in_mode(mode: FlightMode, item: u16, is_over: bool) -> AutopilotReport {
    AutopilotReport {
        mode,
        stored: StoredReport { item, is_over },
        ..resting_report()
    }
}

/// How far the stored mission is, as the vehicle is told.
fn progress(out: &[Out]) -> Option<(u16, StoredPhase)> {
    out.iter().find_map(|out| match out {
        Out::Telemetry(telemetry) => telemetry.stored.map(|stored| (stored.item, stored.phase)),
        _ => None,
    })
}

/// A link whose autopilot carries out a mission, at 3 s.
fn followed(kind: VehicleKind) -> AutopilotLink {
    let mut link = link(kind, resting_report());
    wanted(&mut link, 1.1, follow(1));
    for time_s in [1.2, 1.3, 1.4] {
        answered(&mut link, time_s, CommandAck::Accepted);
    }
    fed(
        &mut link,
        3.0,
        In::Report(in_mode(FlightMode::Auto, 1, false)),
    );
    link
}

const ARM: Command = Command::Arm { force: false };
const GUIDED: Command = Command::Mode(FlightMode::Guided);

#[test]
fn a_start_brings_the_mode_then_the_motors_then_the_drive_that_waits() {
    let mut rover = link(
        VehicleKind::Rover,
        AutopilotReport {
            mode: FlightMode::Hold,
            is_armed: false,
            ..resting_report()
        },
    );
    assert_eq!(wanted(&mut rover, 1.1, AutopilotCommand::Arm), [GUIDED]);
    assert_eq!(wanted(&mut rover, 1.15, drive()), [], "one after the other");
    assert_eq!(
        commands(&answered(&mut rover, 1.2, CommandAck::Accepted)),
        [ARM]
    );
    let route = Command::Route {
        corners: vec![Point::new(3.0, 0.0)],
        altitude_m: None,
        speed_mps: Some(0.5),
    };
    assert_eq!(
        commands(&answered(&mut rover, 1.3, CommandAck::Accepted)),
        [route]
    );
    assert_eq!(answered(&mut rover, 1.4, CommandAck::Accepted), []);
    let out = fed(&mut rover, 1.5, In::Report(resting_report()));
    assert_eq!(commands(&out), []);
}

#[test]
fn one_that_is_armed_already_in_its_mode_is_told_nothing_by_a_start() {
    let mut rover = link(VehicleKind::Rover, resting_report());
    assert_eq!(wanted(&mut rover, 1.1, AutopilotCommand::Arm), []);
    assert_eq!(wanted(&mut rover, 1.2, drive()).len(), 1);
}

#[test]
fn arming_is_tried_three_times_and_given_up_with_its_reason() {
    let mut rover = link(
        VehicleKind::Rover,
        AutopilotReport {
            is_armed: false,
            ..resting_report()
        },
    );
    let mut out = fed(&mut rover, 1.1, In::AutopilotCommand(AutopilotCommand::Arm));
    for tenth in 12..60 {
        let now_s = f64::from(tenth) * 0.1;
        out.extend(answered(&mut rover, now_s, CommandAck::Failed));
        out.extend(fed(
            &mut rover,
            now_s,
            In::Report(AutopilotReport {
                is_armed: false,
                ..resting_report()
            }),
        ));
    }
    assert_eq!(commands(&out), [ARM, ARM, ARM]);
    let reason = Reason::WillNotArm(ArmRefusal::NoPlace);
    assert_eq!(
        event_of(&out),
        Some(LinkEvent::GivenUp(CommandPurpose::Arm, reason))
    );
    let out = fed(&mut rover, 6.1, In::AutopilotCommand(drive()));
    assert_eq!(
        out,
        [Out::LinkEvent(LinkEvent::GivenUp(
            CommandPurpose::Move,
            Reason::NotArmed
        ))]
    );
    assert_eq!(
        fed(&mut rover, 6.15, In::AutopilotCommand(drive())),
        [],
        "said once"
    );
    assert_eq!(
        wanted(&mut rover, 6.2, AutopilotCommand::Arm),
        [ARM],
        "another start"
    );
}

#[test]
fn a_stop_cancels_an_arming_until_the_vehicle_wants_to_move_again() {
    let off = AutopilotReport {
        is_armed: false,
        ..resting_report()
    };
    let mut rover = link(VehicleKind::Rover, off);
    assert_eq!(wanted(&mut rover, 1.1, AutopilotCommand::Arm), [ARM]);
    assert_eq!(commands(&answered(&mut rover, 1.2, CommandAck::Failed)), []);
    assert_eq!(
        wanted(&mut rover, 1.3, AutopilotCommand::Stop),
        [Command::Stop]
    );
    for tenth in 14..60 {
        assert_eq!(
            commands(&fed(&mut rover, f64::from(tenth) * 0.1, In::Report(off))),
            []
        );
    }
    let mut armed = wanted(&mut rover, 6.1, drive());
    for tenth in 62..120 {
        let now_s = f64::from(tenth) * 0.1;
        let mut out = answered(&mut rover, now_s, CommandAck::Failed);
        out.extend(fed(&mut rover, now_s, In::Report(off)));
        armed.extend(commands(&out));
    }
    assert_eq!(
        armed,
        [ARM, ARM],
        "three for one start, whatever stopped it meanwhile"
    );
}

#[test]
fn whoever_disarms_by_hand_is_not_overruled() {
    let mut rover = link(VehicleKind::Rover, resting_report());
    wanted(&mut rover, 1.1, AutopilotCommand::Arm);
    for tenth in 12..80 {
        let off = AutopilotReport {
            is_armed: false,
            ..resting_report()
        };
        assert_eq!(
            commands(&fed(&mut rover, f64::from(tenth) * 0.1, In::Report(off))),
            []
        );
    }
    assert_eq!(wanted(&mut rover, 9.0, drive()), []);
}

#[test]
fn a_stop_goes_past_what_waits_and_is_said_again_while_it_moves() {
    let mut rover = link(VehicleKind::Rover, resting_report());
    assert_eq!(wanted(&mut rover, 1.1, drive()).len(), 1);
    assert_eq!(
        wanted(&mut rover, 1.15, AutopilotCommand::Stop),
        [Command::Stop],
        "the drive is not answered yet"
    );
    assert_eq!(
        wanted(&mut rover, 1.2, AutopilotCommand::Stop),
        [],
        "it was just said"
    );
    let moves = AutopilotReport {
        motion: Motion::Driving,
        speed_mps: 0.5,
        ..resting_report()
    };
    let mut sent_at = 0;
    for tenth in 13..25 {
        let mut out = Vec::new();
        let now = at(f64::from(tenth) * 0.1);
        while let Some(due) = rover.deadline().filter(|due| due.at <= now) {
            rover.wake(due.at, &mut out).unwrap();
        }
        rover.handle(now, In::Report(moves), &mut out).unwrap();
        sent_at += commands(&out)
            .iter()
            .filter(|command| **command == Command::Stop)
            .count();
        assert!(
            commands(&out).iter().all(|command| !command.moves()),
            "the drive is forgotten"
        );
    }
    assert_eq!(sent_at, 4, "1.45, 1.75, 2.05, 2.35 s");
    fed(&mut rover, 2.5, In::Report(resting_report()));
    assert_eq!(
        rover.deadline().map(|due| due.why),
        Some("autopilot silent"),
        "it rests"
    );
}

#[test]
fn one_that_stands_in_its_mode_is_not_told_to_stand_and_changes_it_to_drive() {
    let mut rover = link(
        VehicleKind::Rover,
        AutopilotReport {
            mode: FlightMode::Hold,
            ..resting_report()
        },
    );
    assert_eq!(wanted(&mut rover, 1.1, AutopilotCommand::Stop), []);
    assert_eq!(
        rover.deadline().map(|due| due.why),
        Some("autopilot silent")
    );
    assert_eq!(wanted(&mut rover, 1.6, drive()), [GUIDED]);
    assert_eq!(answered(&mut rover, 1.7, CommandAck::Accepted).len(), 1);
}

#[test]
fn one_that_somebody_steers_when_it_is_first_heard_is_left_alone_until_it_is_taken_back() {
    for (mode, status, expected) in [
        (FlightMode::Manual, SystemStatus::Active, Control::Remote),
        (FlightMode::Auto, SystemStatus::Active, Control::Remote),
        (FlightMode::Manual, SystemStatus::Booting, Control::Own),
        (FlightMode::Return, SystemStatus::Critical, Control::Own),
    ] {
        let mut rover = AutopilotLink::new(AutopilotLinkSettings::default());
        assert_eq!(
            control(&fed(
                &mut rover,
                1.0,
                In::Report(AutopilotReport {
                    mode,
                    status,
                    ..resting_report()
                })
            )),
            Some(expected)
        );
        assert_eq!(wanted(&mut rover, 1.1, drive()), []);
        assert_eq!(wanted(&mut rover, 1.2, AutopilotCommand::Arm), []);
        assert_eq!(wanted(&mut rover, 1.3, AutopilotCommand::TakeBack), []);
        assert_eq!(wanted(&mut rover, 1.3, AutopilotCommand::Arm), [GUIDED]);
    }
}

#[test]
fn a_person_who_takes_over_is_left_alone_until_that_is_taken_back() {
    let mut rover = link(VehicleKind::Rover, resting_report());
    wanted(&mut rover, 1.1, drive());
    let manual = AutopilotReport {
        mode: FlightMode::Manual,
        motion: Motion::Driving,
        ..resting_report()
    };
    let out = fed(&mut rover, 1.2, In::Report(manual));
    assert_eq!(
        (control(&out), event_of(&out)),
        (
            Some(Control::Remote),
            Some(LinkEvent::TakenOver(FlightMode::Manual))
        )
    );
    for fly in [
        AutopilotCommand::Stop,
        drive(),
        AutopilotCommand::Turn(Angle::default()),
        AutopilotCommand::Stop,
    ] {
        assert_eq!(wanted(&mut rover, 1.3, fly), []);
    }
    assert_eq!(commands(&fed(&mut rover, 2.0, In::Report(manual))), []);
    assert_eq!(
        wanted(&mut rover, 2.1, AutopilotCommand::Disarm),
        [Command::Disarm { force: false }],
        "the motors alone"
    );
    assert_eq!(
        fed(
            &mut rover,
            2.15,
            In::AutopilotCommand(AutopilotCommand::Arm)
        ),
        [],
        "a start that does not name it"
    );
    assert_eq!(
        fed(
            &mut rover,
            2.2,
            In::AutopilotCommand(AutopilotCommand::TakeBack)
        ),
        [Out::Status(ControlStatus::default())]
    );
    assert_eq!(wanted(&mut rover, 2.2, AutopilotCommand::Arm), [GUIDED]);
    let out = fed(&mut rover, 2.3, In::Report(resting_report()));
    assert_eq!(control(&out), None);
}

#[test]
fn an_old_mode_is_no_take_over_for_three_seconds_and_one_after_that() {
    let start = |gap_s: f64| {
        let old = AutopilotReport {
            mode: FlightMode::Hold,
            ..resting_report()
        };
        let mut rover = link(VehicleKind::Rover, old);
        assert_eq!(wanted(&mut rover, 2.0, AutopilotCommand::Arm), [GUIDED]);
        answered(&mut rover, 2.0, CommandAck::Accepted);
        for time_s in [2.1, 3.0, 4.0] {
            fed(&mut rover, time_s, In::Report(resting_report()));
        }
        control(&fed(&mut rover, 2.0 + gap_s, In::Report(old)))
    };
    assert_eq!(start(2.5), None);
    assert_eq!(start(3.0), None);
    assert_eq!(start(3.1), Some(Control::Remote));
}

#[test]
fn a_mode_left_and_told_again_is_not_believed_by_what_shows_from_before() {
    let mut rover = followed(VehicleKind::Rover);
    assert_eq!(wanted(&mut rover, 4.0, drive()), [GUIDED]);
    answered(&mut rover, 4.1, CommandAck::Accepted);
    wanted(&mut rover, 4.2, follow(1));
    let auto = [Command::Mode(FlightMode::Auto)];
    // It gets lost, while the last heartbeat is of the AUTO before.
    assert_eq!(
        commands(&answered(&mut rover, 4.3, CommandAck::Accepted)),
        auto
    );
    fed(
        &mut rover,
        4.4,
        In::Report(in_mode(FlightMode::Auto, 1, false)),
    );
    assert_eq!(wanted(&mut rover, 4.5, follow(1)), [Command::SetCurrent(1)]);
    for time_s in [5.0, 6.0, 7.0, 7.5, 8.0, 9.0] {
        let out = fed(
            &mut rover,
            time_s,
            In::Report(in_mode(FlightMode::Guided, 1, false)),
        );
        assert_eq!(control(&out), None, "at {time_s} s");
    }
}

#[test]
fn a_failsafe_is_the_autopilots_own_and_a_rover_is_stopped_under_it() {
    let mut rover = link(VehicleKind::Rover, resting_report());
    let critical = AutopilotReport {
        mode: FlightMode::Return,
        status: SystemStatus::Critical,
        ..resting_report()
    };
    let out = fed(
        &mut rover,
        1.2,
        In::Report(AutopilotReport {
            motion: Motion::Driving,
            ..critical
        }),
    );
    assert_eq!(
        (control(&out), event_of(&out)),
        (
            Some(Control::Own),
            Some(LinkEvent::ActsByItself(FlightMode::Return))
        )
    );
    assert_eq!(wanted(&mut rover, 1.3, drive()), []);
    assert_eq!(
        wanted(&mut rover, 1.4, AutopilotCommand::Stop),
        [Command::Mode(FlightMode::Hold)],
        "straight home is no way"
    );
    let mut copter = link(
        VehicleKind::Copter,
        AutopilotReport {
            is_landed: false,
            ..resting_report()
        },
    );
    fed(
        &mut copter,
        1.2,
        In::Report(AutopilotReport {
            is_landed: false,
            ..critical
        }),
    );
    assert_eq!(
        wanted(&mut copter, 1.4, AutopilotCommand::Stop),
        [],
        "it comes down by itself"
    );
}

#[test]
fn silence_is_said_and_a_stop_is_said_into_it() {
    let mut rover = link(VehicleKind::Rover, resting_report());
    let due = rover.deadline().unwrap();
    assert_eq!((due.at, due.why), (at(3.0), "autopilot silent"));
    let mut out = Vec::new();
    rover.wake(due.at, &mut out).unwrap();
    assert_eq!(control(&out), Some(Control::Silent));
    assert_eq!(wanted(&mut rover, 4.0, drive()), []);
    assert_eq!(
        wanted(&mut rover, 4.1, AutopilotCommand::Stop),
        [Command::Stop]
    );
    let due = rover.deadline().unwrap();
    assert_eq!((due.at, due.why), (at(5.1), "stop not shown"));
    assert_eq!(
        control(&fed(&mut rover, 5.0, In::Report(resting_report()))),
        Some(Control::Ours)
    );
    let rebooted = AutopilotReport {
        mode: FlightMode::Manual,
        status: SystemStatus::Booting,
        ..resting_report()
    };
    assert_eq!(
        control(&fed(&mut rover, 5.1, In::Report(rebooted))),
        Some(Control::Own)
    );
}

#[test]
fn a_copter_takes_off_before_it_flies_and_lands_before_it_is_disarmed() {
    let mut copter = link(VehicleKind::Copter, resting_report());
    assert_eq!(
        wanted(&mut copter, 1.1, drive()),
        [Command::Takeoff { altitude_m: 2.0 }]
    );
    answered(&mut copter, 1.2, CommandAck::Accepted);
    let flies = AutopilotReport {
        is_landed: false,
        flight_state: FlightState {
            altitude_m: 1.0,
            ..FlightState::default()
        },
        ..resting_report()
    };
    fed(&mut copter, 1.3, In::Report(flies));
    let [
        Command::Route {
            altitude_m: Some(2.0),
            ..
        },
    ] = wanted(&mut copter, 1.4, drive())[..]
    else {
        panic!("it goes on to its altitude")
    };
    assert_eq!(
        wanted(&mut copter, 1.5, AutopilotCommand::Disarm),
        [Command::Mode(FlightMode::Land)]
    );
    assert_eq!(wanted(&mut copter, 1.6, drive()), [], "until a start");
    let lands = AutopilotReport {
        mode: FlightMode::Land,
        ..flies
    };
    assert_eq!(
        control(&fed(&mut copter, 1.9, In::Report(lands))),
        None,
        "its own mode"
    );
    let down = AutopilotReport {
        mode: FlightMode::Land,
        ..resting_report()
    };
    assert_eq!(
        commands(&fed(&mut copter, 6.0, In::Report(down))),
        [Command::Disarm { force: false }]
    );
    answered(&mut copter, 6.1, CommandAck::Accepted);
    let off = AutopilotReport {
        is_armed: false,
        ..down
    };
    assert_eq!(commands(&fed(&mut copter, 6.5, In::Report(off))), []);
    assert_eq!(wanted(&mut copter, 7.0, AutopilotCommand::Arm), [GUIDED]);
    assert_eq!(
        commands(&answered(&mut copter, 7.1, CommandAck::Accepted)),
        [ARM]
    );
}

#[test]
fn a_disarming_that_shows_late_is_not_taken_for_current_by_a_start_after_it() {
    let mut rover = link(VehicleKind::Rover, resting_report());
    assert_eq!(
        wanted(&mut rover, 1.1, AutopilotCommand::Disarm),
        [Command::Disarm { force: false }]
    );
    answered(&mut rover, 1.2, CommandAck::Accepted);
    fed(&mut rover, 1.3, In::Report(resting_report()));
    assert_eq!(wanted(&mut rover, 1.4, AutopilotCommand::Arm), [ARM]);
}

#[test]
fn a_change_of_mode_that_a_silence_has_cut_off_is_said_anew_before_it_is_armed() {
    let held = AutopilotReport {
        mode: FlightMode::Hold,
        is_armed: false,
        ..resting_report()
    };
    let mut rover = link(VehicleKind::Rover, held);
    assert_eq!(wanted(&mut rover, 2.9, AutopilotCommand::Arm), [GUIDED]);
    let out = fed(&mut rover, 4.0, In::Report(held));
    assert_eq!(
        control(&out),
        Some(Control::Silent),
        "at 3 s, before the second try"
    );
    assert_eq!(commands(&out), [GUIDED]);
}

#[test]
fn a_stored_mission_is_uploaded_then_its_item_chosen_then_begun_and_its_end_is_no_take_over() {
    let mut link = link(VehicleKind::Rover, resting_report());
    assert_eq!(
        wanted(&mut link, 1.1, follow(2)),
        [Command::Upload(mission())]
    );
    let mut out = Vec::new();
    for second in 2..=60 {
        out = fed(&mut link, f64::from(second), In::Report(resting_report()));
    }
    assert_eq!(
        progress(&out),
        Some((0, StoredPhase::Preparing)),
        "it takes its time"
    );
    assert_eq!(
        commands(&answered(&mut link, 60.1, CommandAck::Accepted)),
        [Command::SetCurrent(2)]
    );
    assert_eq!(
        commands(&answered(&mut link, 60.2, CommandAck::Accepted)),
        [Command::Mode(FlightMode::Auto)]
    );
    answered(&mut link, 60.3, CommandAck::Accepted);
    let out = fed(
        &mut link,
        61.0,
        In::Report(in_mode(FlightMode::Auto, 2, false)),
    );
    assert_eq!(progress(&out), Some((2, StoredPhase::UnderWay)));
    let out = fed(
        &mut link,
        62.0,
        In::Report(in_mode(FlightMode::Auto, 2, true)),
    );
    assert_eq!(progress(&out), Some((2, StoredPhase::Over)));
    let out = fed(
        &mut link,
        63.0,
        In::Report(in_mode(FlightMode::Hold, 2, true)),
    );
    assert_eq!((event_of(&out), control(&out)), (None, None));
    assert_eq!(wanted(&mut link, 63.1, drive()), [GUIDED]);
}

#[test]
fn what_is_stored_already_is_not_uploaded_again_unless_it_may_have_changed() {
    let mut known = followed(VehicleKind::Rover);
    let hold = Command::Mode(FlightMode::Hold);
    assert_eq!(wanted(&mut known, 3.1, AutopilotCommand::Stop), [hold]);
    fed(
        &mut known,
        4.0,
        In::Report(in_mode(FlightMode::Hold, 1, false)),
    );
    assert_eq!(wanted(&mut known, 4.1, follow(2)), [Command::SetCurrent(2)]);
    let mut silent = followed(VehicleKind::Rover);
    wanted(&mut silent, 3.1, AutopilotCommand::Stop);
    fed(
        &mut silent,
        9.0,
        In::Report(in_mode(FlightMode::Hold, 1, false)),
    );
    assert_eq!(
        wanted(&mut silent, 9.1, follow(2)),
        [Command::Upload(mission())],
        "it was silent"
    );
}

#[test]
fn another_item_is_chosen_while_it_goes_on_and_another_mission_when_it_stands() {
    let mut link = followed(VehicleKind::Rover);
    assert_eq!(wanted(&mut link, 3.1, follow(2)), [Command::SetCurrent(2)]);
    assert_eq!(
        commands(&answered(&mut link, 3.2, CommandAck::Accepted)),
        []
    );
    let mut link = followed(VehicleKind::Rover);
    let other = AutopilotCommand::FollowStored {
        items: mission()[..2].to_vec(),
        from: 1,
    };
    assert_eq!(wanted(&mut link, 3.1, other), [GUIDED]);
}

#[test]
fn a_stop_in_auto_is_said_again_until_another_mode_shows() {
    let mut link = followed(VehicleKind::Rover);
    let hold = [Command::Mode(FlightMode::Hold)];
    assert_eq!(wanted(&mut link, 3.1, AutopilotCommand::Stop), hold);
    let rests = in_mode(FlightMode::Auto, 1, false);
    assert_eq!(
        commands(&fed(&mut link, 3.5, In::Report(rests))),
        hold,
        "it may go on"
    );
    let holds = in_mode(FlightMode::Hold, 1, false);
    assert_eq!(commands(&fed(&mut link, 3.6, In::Report(holds))), []);
}

#[test]
fn a_person_who_holds_it_in_its_mission_has_taken_over() {
    let mut link = followed(VehicleKind::Rover);
    let out = fed(
        &mut link,
        9.0,
        In::Report(in_mode(FlightMode::Hold, 1, false)),
    );
    assert!(matches!(
        event_of(&out),
        Some(LinkEvent::TakenOver(FlightMode::Hold) | LinkEvent::ActsByItself(_))
    ));
    assert_eq!(wanted(&mut link, 9.1, follow(1)), []);
}

#[test]
fn a_mission_that_is_refused_or_never_answered_has_failed() {
    let mut refused = link(VehicleKind::Rover, resting_report());
    wanted(&mut refused, 1.1, follow(1));
    let out = answered(&mut refused, 1.2, CommandAck::Unsupported);
    let why = LinkEvent::GivenUp(
        CommandPurpose::Stored,
        Reason::Refused(CommandAck::Unsupported),
    );
    assert_eq!(event_of(&out), Some(why));
    let out = fed(&mut refused, 1.3, In::Report(resting_report()));
    assert_eq!(progress(&out), Some((0, StoredPhase::Failed)));
    let mut silent = link(VehicleKind::Rover, resting_report());
    wanted(&mut silent, 1.1, follow(1));
    let mut said = 0;
    let mut last = None;
    for step in 0..2000 {
        let out = fed(
            &mut silent,
            1.2 + 0.1 * f64::from(step),
            In::Report(resting_report()),
        );
        said += commands(&out).len();
        last = progress(&out);
    }
    assert_eq!(
        (said, last),
        (0, Some((0, StoredPhase::Failed))),
        "the driver asks again, not the link"
    );
}

#[test]
fn a_copter_that_is_stopped_in_its_mission_stands_in_guided() {
    let mut link = followed(VehicleKind::Copter);
    assert_eq!(wanted(&mut link, 3.1, AutopilotCommand::Stop), [GUIDED]);
    let holds = in_mode(FlightMode::Guided, 1, false);
    assert_eq!(commands(&fed(&mut link, 3.3, In::Report(holds))), []);
}
