//! The link of a vehicle to its autopilot: makes commands of what the vehicle wants, and sees them through.
//!
//! It is told what the vehicle wants, the autopilot's reports and its answers. It says commands, telemetry with every
//! report, the status when it changes, and events for people. It plans nothing, and does not judge what the vehicle wants.
//!
//! ```text
//!   want: Stop, Disarm ─────────────────► a command at once, past what waits; again until telemetry shows it
//!   want: Arm ──► mode, then arm ──┐
//!   want: Drive, Turn ──► mode, then ├──► one command at a time; again until it is answered, three times at most
//!                      route, turn ──┤
//!   want: FollowStored ──► upload, item, mode AUTO ──┘
//!   report ──► telemetry, status; who steers, what was reached
//! ```
//!
//! Laws: nothing that moves the vehicle is said after a stop before the vehicle wants to move again, nor while somebody
//! else steers, nor while a disarming stands; nor is anything armed after a stop before that; arming is never forced, is
//! tried three times for one start, and not again once it was seen. A person who has taken over by remote control is not
//! braked either; an autopilot that acts by itself is, unless it comes down.
//!
//! Its parts are machines of their own, each drawn in its file: who steers (`steering.rs`), the motors (`motors.rs`), moving
//! (`movement.rs`), a stored mission (`stored.rs`). Deadlines: `autopilot silent`, `answer late`, `stop not shown`,
//! `disarming not shown`, `arming`, `too late to set out`.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::Control;

use super::AutopilotLinkSettings;
use super::autopilot_command::AutopilotCommand;
use super::command::{Ack, Command, CommandAck, FlightMode, NumberedCommand, VehicleKind};
pub use super::messages::{CommandPurpose, In, LinkEvent, Out, Reason};
use super::motors::Motors;
use super::movement::DriveUnderWay;
use super::pending::Pending;
use super::report::{AutopilotReport, ControlStatus, Motion, SystemStatus};
use super::steering::{LinkHealth, Steering};
use super::stored::StoredMissionGoal;
use crate::actor::{Actor, Fault};
use crate::time::{Deadline, Time};

/// What was not answered, or does not show, is said again after this time.
pub(super) const RESEND_AFTER: Duration = Duration::from_millis(300);
/// To an autopilot that is silent a stop is said this often.
const RESEND_AFTER_INTO_SILENCE: Duration = Duration::from_secs(1);
/// That a drive was given up for one reason is said this often at most.
const REMARK_AGAIN: Duration = Duration::from_secs(10);

/// The link of a vehicle to its autopilot.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct AutopilotLink {
    settings: AutopilotLinkSettings,
    /// The number of the last command.
    pub(super) number: u32,
    hearing: LinkHealth,
    pub(super) steering: Steering,
    report: Option<AutopilotReport>,
    pub(super) motors: Motors,
    pub(super) movement: DriveUnderWay,
    stored: StoredMissionGoal,
    pending: Option<Pending>,
    /// What the vehicle knows.
    status: ControlStatus,
    /// The last remark about something that was given up.
    emitted: Option<(Time, LinkEvent)>,
}

impl AutopilotLink {
    /// Makes the link to an autopilot that has not been heard yet.
    pub fn new(settings: AutopilotLinkSettings) -> AutopilotLink {
        AutopilotLink {
            settings,
            number: 0,
            hearing: LinkHealth::default(),
            steering: Steering::default(),
            report: None,
            motors: Motors::default(),
            movement: DriveUnderWay::default(),
            stored: StoredMissionGoal::default(),
            pending: None,
            status: ControlStatus::default(),
            emitted: None,
        }
    }

    fn want(&mut self, now: Time, fly: AutopilotCommand) {
        match fly {
            AutopilotCommand::Drive { .. } | AutopilotCommand::Turn(_) => {
                if self.may_steer() && !self.motors.is_disarming() {
                    self.drop_pending_move();
                    self.stored.drop_goal();
                    self.motors.go_on();
                    self.movement.wait(now, fly);
                }
            }
            AutopilotCommand::FollowStored { items, from } => {
                if self.may_steer() && !self.motors.is_disarming() {
                    self.drop_pending_move();
                    self.motors.go_on();
                    self.movement = DriveUnderWay::Idle;
                    self.stored.follow(items, from);
                }
            }
            AutopilotCommand::Stop => {
                self.pending.take_if(|pending| pending.ends_by_a_stop());
                self.stored.drop_goal();
                self.motors.postpone();
                match self.steering {
                    Steering::Ours(_) | Steering::Own => self.movement.stop(now, RESEND_AFTER),
                    Steering::Remote => self.movement.give_up_waiting(),
                }
            }
            AutopilotCommand::TakeBack => self.steering.take_back(self.shown_mode()),
            // Nobody is armed against who steers: the vehicle may not know yet of one who has taken over just now.
            AutopilotCommand::Arm if !self.steering.is_ours() => {}
            AutopilotCommand::Arm => {
                // A change of mode that waits for its answer serves the start as well.
                self.pending
                    .take_if(|pending| pending.purpose != CommandPurpose::ChangeMode);
                self.motors.start(now);
            }
            AutopilotCommand::Disarm => {
                self.drop_pending();
                self.movement.give_up_waiting();
                self.stored.drop_goal();
                self.motors.disarm();
            }
        }
    }

    fn report(&mut self, now: Time, report: AutopilotReport, out: &mut Vec<Out>) {
        let was_silent = self.report.is_some() && !self.hearing.is_heard();
        self.hearing = LinkHealth::Heard { at: now };
        self.report = Some(report);
        if was_silent || report.status == SystemStatus::Booting {
            self.stored.doubt();
        }
        let is_over = self.stored.may_have_ended(now, report.stored);
        if self
            .steering
            .take(now, (report.mode, report.status), was_silent, is_over)
        {
            self.let_go(report.mode, out);
        }
        self.stored.take(now, report.mode, report.stored);
        self.motors.take(now, report.is_armed);
        // In AUTO it may rest for a moment only, and go on by itself.
        self.movement
            .take(report.motion == Motion::Resting && report.mode != FlightMode::Auto);
        self.say_status(out);
        out.push(Out::Telemetry(report.telemetry(self.stored.progress())));
    }

    /// Somebody else has taken over: what was wanted is not wanted any more, but for a disarming.
    fn let_go(&mut self, mode: FlightMode, out: &mut Vec<Out>) {
        self.drop_pending();
        self.movement = DriveUnderWay::Idle;
        self.stored.drop_goal();
        self.stored.doubt();
        self.motors.let_go();
        out.push(Out::LinkEvent(match self.steering {
            Steering::Own => LinkEvent::ActsByItself(mode),
            Steering::Ours(_) | Steering::Remote => LinkEvent::TakenOver(mode),
        }));
    }

    fn answer(&mut self, now: Time, ack: Ack, out: &mut Vec<Out>) {
        self.motors.disarm_answered(ack.number, ack.result);
        // To whichever try: one that was accepted late was accepted.
        self.motors.arm_answered(now, &ack);
        let Some(pending) = self
            .pending
            .take_if(|pending| pending.sent.number == ack.number)
        else {
            return;
        };
        match (pending.purpose, ack.result) {
            (CommandPurpose::Arm, _) => {}
            (CommandPurpose::ChangeMode, CommandAck::Accepted) => self.steering.change_accepted(),
            (CommandPurpose::Move, CommandAck::Accepted) => self.movement.give_up_waiting(),
            (CommandPurpose::Stored, CommandAck::Accepted) => self.stored.accepted(),
            (
                purpose @ (CommandPurpose::ChangeMode
                | CommandPurpose::Move
                | CommandPurpose::Stored),
                refused,
            ) => {
                self.give_up(now, purpose, Reason::Refused(refused), out);
            }
        }
    }

    /// Says what is due now: stops and disarmings first, and past what waits for an answer. By what is begun then a stop
    /// may have become possible that was not before.
    fn act(&mut self, now: Time, out: &mut Vec<Out>) {
        self.stop_or_disarm(now, out);
        if !self.may_steer() {
            self.drop_pending();
            self.movement.give_up_waiting();
            self.stored.fail();
            return;
        }
        self.see_through(now, out);
        if self.pending.is_none() {
            self.begin_next(now, out);
        }
        self.stop_or_disarm(now, out);
    }

    fn stop_or_disarm(&mut self, now: Time, out: &mut Vec<Out>) {
        if self.stop_due().is_some_and(|at| at <= now) {
            self.say_stop(now, out);
        }
        if self.disarm_due().is_some_and(|at| at <= now) {
            self.say_disarm(now, out);
        }
    }

    fn say_stop(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(command) = self.stop_command() else {
            return;
        };
        self.say(now, command, out);
        self.movement.stop_said(now);
    }

    /// Returns how the vehicle is brought to rest; `None` when that is not this software's to do (a person steers), or
    /// nothing is left to say: it comes down, or shows the mode already in which it stands. One that moves in that mode is
    /// being taken over by somebody, which its next heartbeat will tell.
    fn stop_command(&self) -> Option<Command> {
        let stay = match (self.settings.kind, &self.steering) {
            (VehicleKind::Rover, _) => FlightMode::Hold,
            // In LOITER a stick decides over its height, where there is one.
            (VehicleKind::Copter, Steering::Ours(_)) => FlightMode::Guided,
            (VehicleKind::Copter, _) => FlightMode::Loiter,
        };
        let mode = match self.steering {
            Steering::Ours(_) => self.steering.own_mode(),
            Steering::Own => self.shown_mode(),
            Steering::Remote => return None,
        };
        match (mode, self.settings.kind) {
            (Some(FlightMode::Land), _) => None,
            (Some(FlightMode::Return), VehicleKind::Copter) if !self.steering.is_ours() => None,
            (Some(FlightMode::Guided) | None, _) => Some(Command::Stop),
            (Some(mode), _) => {
                (mode != stay || self.shown_mode() != Some(stay)).then_some(Command::Mode(stay))
            }
        }
    }

    fn say_disarm(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(command) = self.disarm_command() else {
            return;
        };
        let number = self.say(now, command, out);
        self.motors.disarm_said(now, number);
    }

    /// Returns how the motors lose their current: in the air only after a landing. `None` while it comes down, and as long
    /// as a person flies it.
    fn disarm_command(&self) -> Option<Command> {
        let is_landed = self.report.is_none_or(|report| report.is_landed);
        match (is_landed, &self.steering) {
            (true, _) => Some(Command::Disarm { force: false }),
            (false, Steering::Remote) => None,
            (false, Steering::Ours(_) | Steering::Own)
                if self.shown_mode() == Some(FlightMode::Land) =>
            {
                None
            }
            (false, Steering::Ours(_) | Steering::Own) => Some(Command::Mode(FlightMode::Land)),
        }
    }

    /// Says again what was not answered, or gives it up.
    fn see_through(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(pending) = self.pending.take_if(|pending| pending.due() <= now) else {
            return;
        };
        match pending.purpose {
            // Each try to arm is counted on its own.
            CommandPurpose::Arm => {}
            CommandPurpose::Move
                if self.movement.waits_until().is_none_or(|until| until <= now) =>
            {
                self.give_up(now, CommandPurpose::Move, Reason::TooLate, out);
            }
            CommandPurpose::ChangeMode | CommandPurpose::Move | CommandPurpose::Stored
                if pending.may_be_said_again() =>
            {
                self.send(now, pending.purpose, pending.sent, pending.tries + 1, out);
            }
            purpose @ (CommandPurpose::ChangeMode
            | CommandPurpose::Move
            | CommandPurpose::Stored) => self.give_up(now, purpose, Reason::NotDone, out),
        }
    }

    /// Begins what is to be done next, if anything is.
    fn begin_next(&mut self, now: Time, out: &mut Vec<Out>) {
        if let Some(due) = self.motors.arm_due() {
            if due <= now {
                self.arm(now, out);
            }
            if matches!(self.motors, Motors::Arming(_)) {
                self.give_up_when_late(now, out);
                return;
            }
        }
        self.give_up_when_late(now, out);
        let DriveUnderWay::Waiting { fly, .. } = &self.movement else {
            return self.go_on_with_stored(now, out);
        };
        if !self.has_current() {
            self.give_up(now, CommandPurpose::Move, Reason::NotArmed, out);
        } else if self.steering.own_mode() != Some(FlightMode::Guided) {
            self.change_mode(now, out);
        } else {
            let command = self.move_command(fly);
            self.begin(now, CommandPurpose::Move, command, out);
        }
    }

    /// Takes the next step toward a stored mission.
    fn go_on_with_stored(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(command) = self.stored.next_command(self.steering.own_mode()) else {
            return;
        };
        if !self.has_current() {
            return self.give_up(now, CommandPurpose::Stored, Reason::NotArmed, out);
        }
        let purpose = match command {
            Command::Mode(_) => CommandPurpose::ChangeMode,
            _ => CommandPurpose::Stored,
        };
        self.begin(now, purpose, command, out);
    }

    /// Takes the next step of an arming: the mode first.
    fn arm(&mut self, now: Time, out: &mut Vec<Out>) {
        if let Some(reason) = self.motors.is_given_up(now) {
            let reason = reason.map_or(Reason::NotDone, Reason::WillNotArm);
            self.give_up(now, CommandPurpose::Arm, reason, out);
        } else if self.steering.own_mode() != Some(FlightMode::Guided) && !self.is_out() {
            self.change_mode(now, out);
        } else {
            self.motors
                .take(now, self.report.is_some_and(|report| report.is_armed));
            if let Motors::Arming(_) = self.motors {
                let fresh = self.next_number();
                let number = self.motors.tried(now, fresh);
                let sent = NumberedCommand {
                    number,
                    command: Command::Arm { force: false },
                };
                self.send(now, CommandPurpose::Arm, sent, 1, out);
            }
        }
    }

    /// Returns whether it carries out what it stores, and has current: a start said again changes nothing.
    fn is_out(&self) -> bool {
        self.stored.is_under_way() && self.report.is_some_and(|report| report.is_armed)
    }

    fn give_up_when_late(&mut self, now: Time, out: &mut Vec<Out>) {
        if self
            .movement
            .waits_until()
            .is_some_and(|until| until <= now)
        {
            self.give_up(now, CommandPurpose::Move, Reason::TooLate, out);
        }
    }

    fn change_mode(&mut self, now: Time, out: &mut Vec<Out>) {
        self.begin(
            now,
            CommandPurpose::ChangeMode,
            Command::Mode(FlightMode::Guided),
            out,
        );
    }

    fn move_command(&self, fly: &AutopilotCommand) -> Command {
        let is_copter = self.settings.kind == VehicleKind::Copter;
        let altitude_m = self.settings.altitude_m;
        match fly {
            AutopilotCommand::Drive { .. }
                if is_copter && self.report.is_some_and(|report| report.is_landed) =>
            {
                Command::Takeoff { altitude_m }
            }
            // One that is sent on while it climbs goes on to its altitude.
            AutopilotCommand::Drive { corners, speed_mps } => Command::Route {
                corners: corners.clone(),
                altitude_m: is_copter.then_some(altitude_m),
                speed_mps: Some(*speed_mps),
            },
            AutopilotCommand::Turn(heading) => Command::Yaw(*heading),
            AutopilotCommand::Stop
            | AutopilotCommand::Arm
            | AutopilotCommand::TakeBack
            | AutopilotCommand::FollowStored { .. }
            | AutopilotCommand::Disarm => Command::Stop,
        }
    }

    fn give_up(&mut self, now: Time, purpose: CommandPurpose, reason: Reason, out: &mut Vec<Out>) {
        match purpose {
            CommandPurpose::ChangeMode => {
                self.steering.change_given_up(self.shown_mode());
                if matches!(self.motors, Motors::Arming(_)) {
                    self.motors = Motors::GivenUp;
                }
                self.movement.give_up_waiting();
                self.stored.fail();
            }
            CommandPurpose::Arm => self.motors = Motors::GivenUp,
            CommandPurpose::Move => self.movement.give_up_waiting(),
            CommandPurpose::Stored => self.stored.fail(),
        }
        // A vehicle that may not move tries again and again.
        let event = LinkEvent::GivenUp(purpose, reason);
        let was_said = |(at, sent_at)| sent_at == event && now.since(at) < REMARK_AGAIN;
        if purpose != CommandPurpose::Move || !self.emitted.is_some_and(was_said) {
            self.emitted = Some((now, event));
            out.push(Out::LinkEvent(event));
        }
    }

    fn begin(&mut self, now: Time, purpose: CommandPurpose, command: Command, out: &mut Vec<Out>) {
        let number = self.next_number();
        self.send(now, purpose, NumberedCommand { number, command }, 1, out);
    }

    fn send(
        &mut self,
        now: Time,
        purpose: CommandPurpose,
        sent: NumberedCommand,
        tries: u8,
        out: &mut Vec<Out>,
    ) {
        self.note_mode(now, &sent.command);
        out.push(Out::Command(sent.clone()));
        self.pending = Some(Pending {
            purpose,
            sent,
            sent_at: now,
            tries,
        });
    }

    /// Says a command that waits for no answer; returns its number.
    fn say(&mut self, now: Time, command: Command, out: &mut Vec<Out>) -> u32 {
        let number = self.next_number();
        self.note_mode(now, &command);
        out.push(Out::Command(NumberedCommand { number, command }));
        number
    }

    fn note_mode(&mut self, now: Time, command: &Command) {
        if let Command::Mode(mode) = command {
            self.steering.change(now, *mode);
        }
    }

    fn next_number(&mut self) -> u32 {
        self.number = self.number.wrapping_add(1).max(1);
        self.number
    }

    /// Forgets what waits for its answer; a change of mode may take place, or not.
    fn drop_pending(&mut self) {
        if self
            .pending
            .take()
            .is_some_and(|pending| pending.purpose == CommandPurpose::ChangeMode)
        {
            self.steering.change_given_up(self.shown_mode());
        }
    }

    /// Forgets a drive, a turn or a step toward a stored mission that waits for its answer.
    fn drop_pending_move(&mut self) {
        self.pending.take_if(|pending| pending.sets_out());
    }

    fn say_status(&mut self, out: &mut Vec<Out>) {
        let control = match self.steering {
            _ if !self.hearing.is_heard() => Control::Silent,
            Steering::Ours(_) => Control::Ours,
            Steering::Remote => Control::Remote,
            Steering::Own => Control::Own,
        };
        let status = ControlStatus {
            control,
            is_landed: self.report.is_none_or(|report| report.is_landed),
            switch: self.report.and_then(|report| report.switch),
        };
        if status != self.status {
            self.status = status;
            out.push(Out::Status(status));
        }
    }

    /// Returns whether the autopilot is heard, and nobody else steers.
    fn may_steer(&self) -> bool {
        self.hearing.is_heard() && self.steering.is_ours()
    }

    /// Returns whether the motors have current, as far as is known; what was accepted shows later.
    fn has_current(&self) -> bool {
        match self.motors {
            Motors::Accepted { since: _ } => true,
            Motors::Disarming(_) => false,
            Motors::Unasked
            | Motors::Arming(_)
            | Motors::Postponed(_)
            | Motors::Armed
            | Motors::GivenUp => self.report.is_some_and(|report| report.is_armed),
        }
    }

    fn shown_mode(&self) -> Option<FlightMode> {
        self.report.map(|report| report.mode)
    }

    fn again(&self) -> Duration {
        if self.hearing.is_heard() {
            RESEND_AFTER
        } else {
            RESEND_AFTER_INTO_SILENCE
        }
    }

    fn stop_due(&self) -> Option<Time> {
        self.movement
            .stop_due(self.again())
            .filter(|_| self.stop_command().is_some())
    }

    fn disarm_due(&self) -> Option<Time> {
        let is_armed = self.report.is_none_or(|report| report.is_armed);
        self.motors
            .disarm_due(is_armed, self.again())
            .filter(|_| self.disarm_command().is_some())
    }
}

impl Actor for AutopilotLink {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::AutopilotCommand(fly) => {
                self.want(now, fly);
                self.say_status(out);
            }
            In::Report(report) => self.report(now, report, out),
            In::Ack(ack) => self.answer(now, ack, out),
            In::Fix(from, fix) => out.push(Out::Fix(from, fix)),
        }
        self.act(now, out);
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let due = |at: Option<Time>, why: &'static str| at.map(|at| Deadline { at, why });
        let urgent = [
            self.hearing.deadline(),
            due(self.stop_due(), "stop not shown"),
            due(self.disarm_due(), "disarming not shown"),
        ];
        let pending = self.pending.as_ref().map(Pending::due);
        let is_free = self.may_steer() && pending.is_none();
        let ordinary = [
            due(pending, "answer late"),
            due(self.motors.arm_due().filter(|_| is_free), "arming"),
            due(
                self.movement.waits_until().filter(|_| is_free),
                "too late to set out",
            ),
        ];
        urgent
            .into_iter()
            .chain(ordinary)
            .fold(None, Deadline::earlier)
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.hearing.look(now);
        self.say_status(out);
        self.act(now, out);
        Ok(())
    }
}
