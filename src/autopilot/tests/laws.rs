//! What holds whatever the vehicle wants and whatever the autopilot does: random wants, commands and answers that are lost,
//! doubled or late, refusals to arm, take-overs, failsafes, silences. A model of an autopilot, which shares nothing with the
//! simulated one, obeys; a witness sees only what goes in and out of the link. That the witness can fail is shown by
//! mistakes that are planted between the two.

use std::time::Duration;

use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use tomoswarm_proto::Control;

use super::super::link::{AutopilotLink, In, Out};
use super::super::{
    Ack, ArmRefusal, AutopilotCommand, AutopilotLinkSettings, AutopilotReport, Command, CommandAck,
    FlightMode, FlightState, Item, Motion, NumberedCommand, StoredReport, SystemStatus,
};
use crate::actor::Actor;
use crate::geom::{Angle, Point, Pose};
use crate::time::Time;

const REPORTS_EVERY: Duration = Duration::from_millis(100);
const HEARTBEATS_EVERY: Duration = Duration::from_secs(1);
const AGAIN: Duration = Duration::from_millis(300);

/// What happens next.
#[derive(Clone, Debug)]
enum Happening {
    Want(AutopilotCommand),
    /// From now on so many of ten commands, and of ten answers, are lost; answers take so long, and come twice.
    Line {
        commands_lost: u8,
        acks_lost: u8,
        takes: Duration,
        doubles: bool,
    },
    /// From now on it refuses to arm.
    RefusesToArm(bool),
    /// A person chooses a mode.
    Person(FlightMode),
    /// A person takes the current away.
    DisarmedByHand,
    /// The autopilot goes home by itself.
    Failsafe,
    /// Nothing is reported for this long.
    Silence(Duration),
    Nothing,
}

fn drive() -> AutopilotCommand {
    AutopilotCommand::Drive {
        corners: vec![Point::new(3.0, 1.0)],
        speed_mps: 0.5,
    }
}

fn any_want() -> impl Strategy<Value = Happening> {
    prop_oneof![
        4 => Just(drive()),
        2 => Just(AutopilotCommand::Turn(Angle::default())),
        2 => (1..3usize).prop_map(|from| AutopilotCommand::FollowStored { items: mission(), from }),
        3 => Just(AutopilotCommand::Stop),
        3 => Just(AutopilotCommand::Arm),
        3 => Just(AutopilotCommand::TakeBack),
        2 => Just(AutopilotCommand::Disarm),
    ]
    .prop_map(Happening::Want)
}

fn mission() -> Vec<Item> {
    [0.0, 1.0, 2.0]
        .map(|x_m| Item::Waypoint {
            at: Point::new(x_m, 0.0),
            altitude_m: 0.0,
            delay: Duration::ZERO,
        })
        .to_vec()
}

fn any_line() -> impl Strategy<Value = Happening> {
    (0..10u8, 0..10u8, 0..900u64, any::<bool>()).prop_map(
        |(commands_lost, acks_lost, takes_ms, doubles)| Happening::Line {
            commands_lost,
            acks_lost,
            takes: Duration::from_millis(takes_ms),
            doubles,
        },
    )
}

fn any_happening(with_others: bool) -> impl Strategy<Value = Happening> {
    let modes = [
        FlightMode::Manual,
        FlightMode::Hold,
        FlightMode::Loiter,
        FlightMode::Auto,
        FlightMode::Return,
    ];
    let others = prop_oneof![
        3 => prop::sample::select(modes.to_vec()).prop_map(Happening::Person),
        1 => Just(Happening::Failsafe),
        1 => (500..4000u64).prop_map(|ms| Happening::Silence(Duration::from_millis(ms))),
    ];
    prop_oneof![
        14 => any_want(),
        2 => any_line(),
        1 => any::<bool>().prop_map(Happening::RefusesToArm),
        1 => Just(Happening::DisarmedByHand),
        4 => Just(Happening::Nothing),
        if with_others { 3 } else { 0 } => others,
    ]
}

/// Happenings, each some time after the one before.
fn any_sequence(with_others: bool) -> impl Strategy<Value = Vec<(Duration, Happening)>> {
    let gap_ms = prop_oneof![6 => 0..400u64, 3 => 400..1500u64, 1 => 1500..6000u64];
    prop::collection::vec(
        (
            gap_ms.prop_map(Duration::from_millis),
            any_happening(with_others),
        ),
        1..60,
    )
}

/// A rover's autopilot, as far as the link can notice.
struct Model {
    mode: FlightMode,
    is_armed: bool,
    moves_until: Time,
    is_critical: bool,
    refuses_to_arm: bool,
    stored: Vec<Item>,
    is_over: bool,
    /// Mode, armed, status as the last heartbeat said.
    heartbeat: (FlightMode, bool, SystemStatus),
    heartbeat_due: Time,
}

impl Model {
    fn new() -> Model {
        Model {
            mode: FlightMode::Hold,
            is_armed: false,
            moves_until: Time::ZERO,
            is_critical: false,
            refuses_to_arm: false,
            stored: Vec::new(),
            is_over: false,
            heartbeat: (FlightMode::Hold, false, SystemStatus::Standby),
            heartbeat_due: Time::ZERO,
        }
    }

    fn brake(&mut self, now: Time) {
        self.moves_until = self.moves_until.min(now + Duration::from_millis(500));
    }

    fn obey(&mut self, now: Time, command: &Command) -> (CommandAck, Option<ArmRefusal>) {
        let may_move = self.mode == FlightMode::Guided && self.is_armed;
        let result = match command {
            Command::Mode(FlightMode::Auto) if self.stored.is_empty() => CommandAck::Failed,
            Command::Mode(mode) => {
                (self.mode, self.is_critical) = (*mode, false);
                self.brake(now);
                if *mode == FlightMode::Auto && self.is_armed {
                    self.moves_until = now + Duration::from_secs(4);
                }
                CommandAck::Accepted
            }
            Command::Upload(items) => {
                (self.stored, self.is_over) = (items.clone(), false);
                CommandAck::Accepted
            }
            Command::SetCurrent(item) if *item < self.stored.len() => {
                self.is_over = false;
                CommandAck::Accepted
            }
            Command::Arm { .. } if self.refuses_to_arm && !self.is_armed => {
                return (CommandAck::Failed, Some(ArmRefusal::NoPlace));
            }
            Command::Arm { .. } => {
                self.is_armed = true;
                CommandAck::Accepted
            }
            Command::Disarm { .. } => {
                self.is_armed = false;
                self.brake(now);
                CommandAck::Accepted
            }
            Command::Route { .. } | Command::Yaw(_) if may_move => {
                self.moves_until = now + Duration::from_secs(4);
                CommandAck::Accepted
            }
            Command::Stop if may_move => {
                self.brake(now);
                CommandAck::Accepted
            }
            _ => CommandAck::Failed,
        };
        (result, None)
    }

    fn report(&mut self, now: Time) -> AutopilotReport {
        // Its mission is over, and it holds.
        if self.mode == FlightMode::Auto && self.is_armed && now >= self.moves_until {
            (self.mode, self.is_over) = (FlightMode::Hold, true);
        }
        if now >= self.heartbeat_due {
            let status = if self.is_critical {
                SystemStatus::Critical
            } else {
                SystemStatus::Active
            };
            self.heartbeat = (self.mode, self.is_armed, status);
            self.heartbeat_due = now + HEARTBEATS_EVERY;
        }
        let (mode, is_armed, status) = self.heartbeat;
        let moves = now < self.moves_until;
        AutopilotReport {
            pose: Pose {
                at: Point::default(),
                heading: Angle::default(),
                sd_m: 0.1,
            },
            flight_state: FlightState::default(),
            speed_mps: if moves { 0.5 } else { 0.0 },
            battery: Some(1.0),
            motion: if moves {
                Motion::Driving
            } else {
                Motion::Resting
            },
            is_landed: true,
            mode,
            is_armed,
            status,
            switch: None,
            stored: StoredReport {
                item: 1,
                is_over: self.is_over,
            },
        }
    }
}

/// A mistake that is planted between link and witness.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Mistake {
    /// Stops are said at a report only.
    StopWaits,
    /// A stop is said once.
    StopIsSaidOnce,
    /// A drive is said again after a stop.
    DrivesAfterStop,
    /// An arming goes on after a stop.
    ArmsAfterStop,
    /// Arming is tried as long as it takes.
    ArmsForEver,
    /// Whoever disarms by hand is overruled.
    OverrulesHands,
    Forces,
    /// The mode is taken back from a person.
    FightsTakeOver,
    /// A start takes it back from whoever steers, though it names no take-over.
    StartTakesBack,
    /// Any mode that was not just asked for is a take-over.
    OldModeIsTakeOver,
    /// What was not answered is said for ever.
    SaysForEver,
    /// A disarming is said once.
    DisarmIsSaidOnce,
}

/// What the link is to know of the vehicle's wants, as the witness sees them.
struct Witness {
    link: AutopilotLink,
    model: Model,
    now: Time,
    mistake: Option<Mistake>,
    line: (u8, u8, Duration, bool),
    /// Counts draws, for what is lost.
    draws: u64,
    answers: Vec<(Time, Ack)>,
    silent_until: Time,
    report_due: Time,
    control: Control,
    /// A person steers, heard or not.
    is_remote: bool,
    /// Somebody else steers, heard or not.
    is_taken: bool,
    last_report: Option<AutopilotReport>,
    /// The vehicle wants to move since then, and has not stopped since.
    wants_to_move: Option<Time>,
    /// The autopilot is to carry out what it stores.
    wants_stored: bool,
    wants_to_stop: bool,
    /// It has wanted to stand, and nothing that moves was said since.
    may_stop: bool,
    /// The last stop, if nothing that moves was said since.
    stop_said: Option<Time>,
    wants_to_disarm: Option<Option<Time>>,
    wants_to_arm: bool,
    /// It was stopped since the start, and has not wanted to move since.
    arming_waits: bool,
    arm_tries: usize,
    /// It was seen armed, or its arming accepted, since the start.
    was_armed: bool,
    arm_numbers: Vec<u32>,
    disarm_said: Option<Time>,
    /// Number, times said, when last.
    ordinary: Option<(NumberedCommand, usize, Time)>,
    last_drive: Option<NumberedCommand>,
    stops: usize,
    taken_over: usize,
}

impl Witness {
    fn new(mistake: Option<Mistake>) -> Witness {
        Witness {
            link: AutopilotLink::new(AutopilotLinkSettings::default()),
            model: Model::new(),
            now: Time::ZERO,
            mistake,
            line: (0, 0, Duration::ZERO, false),
            draws: 0,
            answers: Vec::new(),
            silent_until: Time::ZERO,
            report_due: Time::ZERO,
            control: Control::Ours,
            is_remote: false,
            is_taken: false,
            last_report: None,
            wants_to_move: None,
            wants_stored: false,
            wants_to_stop: false,
            may_stop: false,
            stop_said: None,
            wants_to_disarm: None,
            wants_to_arm: false,
            arming_waits: false,
            arm_tries: 0,
            was_armed: false,
            arm_numbers: Vec::new(),
            disarm_said: None,
            ordinary: None,
            last_drive: None,
            stops: 0,
            taken_over: 0,
        }
    }

    fn loses(&mut self, of_ten: u8) -> bool {
        self.draws = self
            .draws
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.draws >> 33) % 10 < u64::from(of_ten)
    }

    fn see(&mut self, gap: Duration, happening: &Happening) {
        self.go_on_until(self.now + gap);
        match happening {
            Happening::Want(fly) => self.want(fly.clone()),
            Happening::Line {
                commands_lost,
                acks_lost,
                takes,
                doubles,
            } => {
                self.line = (*commands_lost, *acks_lost, *takes, *doubles);
            }
            Happening::RefusesToArm(refuses) => self.model.refuses_to_arm = *refuses,
            Happening::Person(mode) => {
                self.model.mode = *mode;
                self.model.moves_until = self.now + Duration::from_secs(2);
            }
            Happening::DisarmedByHand => {
                self.model.is_armed = false;
                self.model.brake(self.now);
            }
            Happening::Failsafe => {
                (self.model.mode, self.model.is_critical) = (FlightMode::Return, true);
                self.model.moves_until = self.now + Duration::from_secs(3);
            }
            Happening::Silence(span) => self.silent_until = self.now + *span,
            Happening::Nothing => {}
        }
    }

    /// Lets reports, answers and wakes come, each at its time.
    fn go_on_until(&mut self, until: Time) {
        loop {
            let wake = self.link.deadline().map(|due| due.at.max(self.now));
            let answer = self.answers.iter().map(|(at, _)| *at).min();
            let next = [wake, answer, Some(self.report_due)]
                .into_iter()
                .flatten()
                .min()
                .unwrap();
            if next > until {
                self.now = until;
                return;
            }
            self.now = self.now.max(next);
            if wake == Some(next) {
                let mut out = Vec::new();
                self.link.wake(next, &mut out).unwrap();
                let later = self.link.deadline();
                assert!(
                    later.is_none_or(|later| later.at > next),
                    "woken in vain: {later:?}"
                );
                self.hear(out, false);
            } else if answer == Some(next) {
                let index = self.answers.iter().position(|(at, _)| *at == next).unwrap();
                let (_, ack) = self.answers.remove(index);
                self.was_armed |=
                    self.arm_numbers.contains(&ack.number) && ack.result == CommandAck::Accepted;
                if self
                    .ordinary
                    .as_ref()
                    .is_some_and(|(sent_at, ..)| sent_at.number == ack.number)
                {
                    self.ordinary = None;
                }
                self.tell(In::Ack(ack), false);
            } else {
                self.report_due = self.now + REPORTS_EVERY;
                if self.now >= self.silent_until {
                    self.report();
                }
            }
        }
    }

    fn report(&mut self) {
        let report = self.model.report(self.now);
        self.last_report = Some(report);
        let is_old = |sent_at: Time| self.now.since(sent_at) <= Duration::from_secs(3);
        if self.arm_tries > 0 && report.is_armed && !self.disarm_said.is_some_and(is_old) {
            self.was_armed = true;
        }
        self.tell(In::Report(report), true);
        self.check_owed(&report);
    }

    fn want(&mut self, fly: AutopilotCommand) {
        match fly {
            AutopilotCommand::Drive { .. } | AutopilotCommand::Turn(_) => {
                (self.wants_to_move, self.wants_to_stop) = (Some(self.now), false);
                (self.wants_stored, self.arming_waits) = (false, false);
            }
            AutopilotCommand::FollowStored { .. } => {
                (self.wants_to_move, self.wants_to_stop) = (None, false);
                (self.wants_stored, self.arming_waits) = (true, false);
            }
            AutopilotCommand::Stop => {
                (self.wants_to_move, self.wants_to_stop) = (None, true);
                self.wants_stored = false;
                (self.may_stop, self.arming_waits) = (true, true);
            }
            // It is for nobody who has been taken over.
            AutopilotCommand::Arm if self.is_taken => {}
            AutopilotCommand::Arm => {
                (self.wants_to_disarm, self.wants_to_arm) = (None, true);
                (self.arm_tries, self.was_armed, self.arming_waits) = (0, false, false);
                self.arm_numbers.clear();
            }
            AutopilotCommand::TakeBack => {
                if self.is_taken && self.control != Control::Silent {
                    self.control = Control::Ours;
                }
                // What was wanted of one that somebody else steers is not wanted any more.
                self.wants_to_stop &= !self.is_taken;
                (self.is_remote, self.is_taken) = (false, false);
            }
            AutopilotCommand::Disarm => {
                (self.wants_to_move, self.wants_to_arm) = (None, false);
                self.wants_stored = false;
                self.wants_to_disarm.get_or_insert(None);
            }
        }
        let before = self.stops;
        self.ordinary = None;
        self.tell(In::AutopilotCommand(fly.clone()), false);
        if fly == AutopilotCommand::Stop && !self.is_remote {
            let is_recent = self.stop_said.is_some_and(|at| self.now.since(at) < AGAIN);
            // One that shows the mode in which it stands need not be told.
            let stands = self
                .last_report
                .is_some_and(|report| report.mode == FlightMode::Hold);
            let is_on_its_way = self.stops > before || is_recent || stands;
            assert!(is_on_its_way, "a stop that was wanted is not on its way");
        }
    }

    fn tell(&mut self, input: In, is_report: bool) {
        let mut out = Vec::new();
        self.link.handle(self.now, input, &mut out).unwrap();
        self.hear(out, is_report);
    }

    /// Hears what the link says, lets the model obey, and checks the laws.
    fn hear(&mut self, mut out: Vec<Out>, is_report: bool) {
        self.tamper(&mut out, is_report);
        for sent_at in out {
            match sent_at {
                Out::Command(command) => {
                    self.check(&command);
                    self.carry(&command);
                }
                Out::Status(status) => {
                    if matches!(status.control, Control::Remote | Control::Own) {
                        self.taken_over += 1;
                        self.is_taken = true;
                        (self.wants_to_move, self.wants_to_stop, self.wants_to_arm) =
                            (None, false, false);
                        self.wants_stored = false;
                        self.ordinary = None;
                    }
                    if status.control == Control::Silent {
                        self.ordinary = None;
                    } else {
                        self.is_remote = status.control == Control::Remote;
                    }
                    self.control = status.control;
                }
                Out::Telemetry(_) | Out::LinkEvent(_) | Out::Fix(..) => {}
            }
        }
    }

    fn carry(&mut self, numbered: &NumberedCommand) {
        let (commands_lost, acks_lost, takes, doubles) = self.line;
        if self.loses(commands_lost) {
            return;
        }
        let (result, arm_refusal) = self.model.obey(self.now, &numbered.command);
        let ack = Ack {
            number: numbered.number,
            result,
            arm_refusal,
        };
        for take in [Some(takes), doubles.then_some(takes * 2)]
            .into_iter()
            .flatten()
        {
            if !self.loses(acks_lost) {
                self.answers
                    .push((self.now + take + Duration::from_millis(1), ack));
            }
        }
    }

    fn check(&mut self, numbered: &NumberedCommand) {
        let NumberedCommand { number, command } = numbered;
        if self.is_remote {
            let disarms = matches!(command, Command::Disarm { force: false });
            assert!(
                disarms && self.wants_to_disarm.is_some(),
                "{command:?} although a person steers"
            );
        }
        assert!(
            !command.moves() || self.control == Control::Ours,
            "{command:?} under {:?}",
            self.control
        );
        match command {
            Command::Arm { force } => {
                assert!(!force, "arming is forced");
                assert!(!self.is_taken, "it is armed against who steers");
                self.arm_tries += 1;
                assert!(
                    self.wants_to_arm && self.arm_tries <= 3,
                    "try {} to arm",
                    self.arm_tries
                );
                assert!(!self.was_armed, "it was armed, and is armed again");
                assert!(!self.arming_waits, "it is armed although it was stopped");
                self.arm_numbers.push(*number);
            }
            Command::Disarm { force } => {
                assert!(
                    !force && self.wants_to_disarm.is_some(),
                    "disarmed for nothing"
                );
                self.wants_to_disarm = Some(Some(self.now));
                self.disarm_said = Some(self.now);
            }
            Command::Route { .. } | Command::Yaw(_) => {
                let since = self
                    .wants_to_move
                    .expect("it moves although nobody wants that");
                assert!(
                    self.now.since(since) <= Duration::from_secs(1),
                    "it sets out too late"
                );
                assert!(
                    self.wants_to_disarm.is_none(),
                    "it moves although it is to be disarmed"
                );
                self.last_drive = Some(numbered.clone());
                (self.may_stop, self.stop_said) = (false, None);
            }
            Command::Stop | Command::Mode(FlightMode::Hold) => {
                assert!(self.may_stop, "it stops for nothing");
                self.stops += 1;
                self.stop_said = Some(self.now);
                return;
            }
            Command::Upload(_) | Command::SetCurrent(_) | Command::Mode(FlightMode::Auto) => {
                assert!(self.wants_stored, "it follows what nobody wants followed");
                assert!(
                    self.wants_to_disarm.is_none(),
                    "it moves although it is to be disarmed"
                );
                if let Command::Mode(_) = &numbered.command {
                    (self.may_stop, self.stop_said) = (false, None);
                }
            }
            Command::Mode(FlightMode::Guided) => {}
            other => panic!("{other:?} was never wanted"),
        }
        self.check_one_at_a_time(numbered);
    }

    /// What waits for an answer is said three times at most, not too often, and nothing else meanwhile.
    fn check_one_at_a_time(&mut self, numbered: &NumberedCommand) {
        if matches!(numbered.command, Command::Disarm { .. }) {
            return;
        }
        self.ordinary = Some(match self.ordinary.take() {
            Some((before, times, sent_at)) if before.number == numbered.number => {
                assert!(
                    before == *numbered && times < 3 && self.now.since(sent_at) >= AGAIN,
                    "{numbered:?}"
                );
                (before, times + 1, self.now)
            }
            Some((before, times, sent_at)) => {
                let is_over = times >= 3 || matches!(before.command, Command::Arm { .. });
                let is_late = self.now.since(sent_at) >= AGAIN;
                assert!(is_over && is_late, "{numbered:?} past {before:?}");
                (numbered.clone(), 1, self.now)
            }
            None => (numbered.clone(), 1, self.now),
        });
    }

    /// What a report does not show was said again by now.
    fn check_owed(&self, report: &AutopilotReport) {
        let is_older =
            |sent_at: Option<Time>| sent_at.is_none_or(|sent_at| self.now.since(sent_at) >= AGAIN);
        if self.wants_to_stop
            && !self.is_remote
            && report.motion != Motion::Resting
            && report.mode != FlightMode::Hold
        {
            assert!(
                !is_older(self.stop_said),
                "it moves and is not told to stop again"
            );
        }
        if let Some(sent_at) = self.wants_to_disarm {
            let late = sent_at
                .is_none_or(|sent_at| self.now.since(sent_at) >= Duration::from_millis(1200));
            assert!(
                !(report.is_armed && late),
                "armed, and not told to disarm again"
            );
        }
    }

    /// Plants a mistake into what the link says.
    fn tamper(&mut self, out: &mut Vec<Out>, is_report: bool) {
        let Some(mistake) = self.mistake else { return };
        let is_stop = |out: &Out| {
            let stops = |command: &Command| {
                matches!(command, Command::Stop | Command::Mode(FlightMode::Hold))
            };
            matches!(out, Out::Command(NumberedCommand { command, .. }) if stops(command))
        };
        let say = |number: u32, command: Command| Out::Command(NumberedCommand { number, command });
        let was_said = self.wants_to_stop && self.stop_said.is_some();
        match mistake {
            Mistake::StopWaits => out.retain(|sent_at| is_report || !is_stop(sent_at)),
            Mistake::StopIsSaidOnce => out.retain(|sent_at| !(was_said && is_stop(sent_at))),
            Mistake::DrivesAfterStop if was_said => {
                out.extend(self.last_drive.take().map(Out::Command));
            }
            Mistake::ArmsAfterStop if self.arming_waits && self.wants_to_arm && is_report => {
                let goes_on = (1..3).contains(&self.arm_tries) && !self.was_armed;
                out.extend(goes_on.then(|| say(9999, Command::Arm { force: false })));
            }
            Mistake::ArmsForEver if self.arm_tries == 3 && is_report => {
                out.push(say(9999, Command::Arm { force: false }));
            }
            Mistake::OverrulesHands if self.was_armed && is_report => {
                let is_shown = self.last_report.is_some_and(|report| !report.is_armed);
                out.extend(is_shown.then(|| say(9999, Command::Arm { force: false })));
            }
            Mistake::Forces => out.iter_mut().for_each(|sent_at| {
                if let Out::Command(NumberedCommand {
                    command: Command::Arm { force },
                    ..
                }) = sent_at
                {
                    *force = true;
                }
            }),
            Mistake::StartTakesBack if self.is_taken && is_report => {
                out.push(say(9999, Command::Arm { force: false }));
            }
            Mistake::FightsTakeOver if self.is_remote => {
                out.push(say(9999, Command::Mode(FlightMode::Guided)));
            }
            Mistake::OldModeIsTakeOver => {
                let shown = self.last_report.map(|report| report.mode);
                let expected = self.link.steering.own_mode();
                if shown != expected && expected.is_some() {
                    let status = super::super::ControlStatus {
                        switch: None,
                        control: Control::Remote,
                        is_landed: true,
                    };
                    out.push(Out::Status(status));
                }
            }
            Mistake::SaysForEver if is_report => {
                let again = self.ordinary.as_ref().filter(|(_, times, _)| *times >= 2);
                out.extend(again.map(|(command, ..)| Out::Command(command.clone())));
            }
            Mistake::DisarmIsSaidOnce => {
                let was_said = self
                    .wants_to_disarm
                    .is_some_and(|sent_at| sent_at.is_some());
                out.retain(|sent_at| {
                    let disarms = matches!(
                        sent_at,
                        Out::Command(NumberedCommand {
                            command: Command::Disarm { .. },
                            ..
                        })
                    );
                    !(was_said && disarms)
                });
            }
            Mistake::DrivesAfterStop
            | Mistake::ArmsAfterStop
            | Mistake::ArmsForEver
            | Mistake::OverrulesHands
            | Mistake::FightsTakeOver
            | Mistake::StartTakesBack
            | Mistake::SaysForEver => {}
        }
    }
}

fn watch(mistake: Option<Mistake>, sequence: &[(Duration, Happening)]) -> Witness {
    let mut witness = Witness::new(mistake);
    for (gap, happening) in sequence {
        witness.see(*gap, happening);
    }
    witness.go_on_until(witness.now + Duration::from_secs(5));
    witness
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn the_laws_hold_whatever_comes(sequence in any_sequence(true)) {
        watch(None, &sequence);
    }

    #[test]
    fn where_nobody_takes_over_nobody_has(sequence in any_sequence(false)) {
        prop_assert_eq!(watch(None, &sequence).taken_over, 0);
    }

    #[test]
    fn who_takes_over_is_noticed_and_left_alone(
        sequence in any_sequence(false),
        mode in prop::sample::select(vec![FlightMode::Manual, FlightMode::Loiter, FlightMode::Return]),
    ) {
        let mut witness = watch(None, &sequence);
        // A stop that was lost for seconds may still be on its way.
        let line = std::mem::take(&mut witness.line);
        witness.go_on_until(witness.now + Duration::from_secs(2));
        witness.line = line;
        // These modes are never its own.
        witness.see(Duration::ZERO, &Happening::Person(mode));
        witness.go_on_until(witness.now + Duration::from_millis(1200));
        prop_assert_eq!(witness.control, Control::Remote);
        let stops = witness.stops;
        witness.see(Duration::from_millis(100), &Happening::Want(AutopilotCommand::Stop));
        witness.see(Duration::from_millis(100), &Happening::Want(drive()));
        witness.go_on_until(witness.now + Duration::from_secs(5));
        prop_assert_eq!((witness.model.mode, witness.stops), (mode, stops));
        witness.line = (0, 0, Duration::ZERO, false);
        witness.see(Duration::from_millis(100), &Happening::Want(AutopilotCommand::Arm));
        witness.go_on_until(witness.now + Duration::from_secs(5));
        prop_assert_eq!((witness.model.mode, witness.control), (mode, Control::Remote));
        witness.see(Duration::from_millis(100), &Happening::Want(AutopilotCommand::TakeBack));
        witness.see(Duration::ZERO, &Happening::Want(AutopilotCommand::Arm));
        witness.go_on_until(witness.now + Duration::from_secs(5));
        prop_assert_eq!((witness.model.mode, witness.control), (FlightMode::Guided, Control::Ours));
    }
}

#[test]
fn every_mistake_that_is_planted_is_noticed() {
    let mistakes = [
        Mistake::StopWaits,
        Mistake::StopIsSaidOnce,
        Mistake::DrivesAfterStop,
        Mistake::ArmsAfterStop,
        Mistake::ArmsForEver,
        Mistake::OverrulesHands,
        Mistake::Forces,
        Mistake::FightsTakeOver,
        Mistake::StartTakesBack,
        Mistake::SaysForEver,
        Mistake::DisarmIsSaidOnce,
    ];
    let noticed = |mistake: Mistake, with_others: bool| {
        let mut runner = TestRunner::deterministic();
        (0..300).any(|_| {
            let sequence = any_sequence(with_others)
                .new_tree(&mut runner)
                .unwrap()
                .current();
            let watched = std::panic::catch_unwind(|| watch(Some(mistake), &sequence).taken_over);
            watched.map_or(true, |taken_over| !with_others && taken_over > 0)
        })
    };
    let unnoticed: Vec<Mistake> = mistakes
        .into_iter()
        .filter(|mistake| !noticed(*mistake, true))
        .collect();
    let old_mode = noticed(Mistake::OldModeIsTakeOver, false);
    assert_eq!(unnoticed, []);
    assert!(old_mode);
}
