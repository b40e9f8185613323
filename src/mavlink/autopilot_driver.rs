//! What stands between the link to an autopilot and its bytes: commands in the link's terms become messages, what the autopilot
//! says becomes reports and answers. It decides nothing that the link decides: a command is said once each time that it is
//! told, and what nobody answers is the link's matter. Of its own it only says what keeps a connection alive: heartbeats,
//! which messages are wanted, and the target of a drive under way. A pure machine.
//!
//! ```text
//!   NumberedCommand ─► orders ─► messages ──────────────► autopilot
//!   Report, Ack     ◄─ heard  ◄─ messages ◄────────────── autopilot
//!   pulses          ─► servos ─► messages ──────────────► its servo
//!   Reading         ◄─ ranges ◄─ messages ◄────────────── its range sensors
//!                      setup: heartbeat, streams, origin ─► autopilot
//! ```

#![allow(
    deprecated,
    reason = "old firmware still asks and streams by what the dialect has superseded"
)]

mod attitude;
mod battery;
mod failsafes;
mod fixes;
mod health;
mod heard;
mod orders;
mod ranges;
mod servos;
mod setup;
#[cfg(test)]
mod tests_support;
mod upload;

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm_proto::{AutopilotHealth, FailsafeAction, Fix, Sender};

use super::dialect::{
    self as d, MavAutopilot, MavCmd, MavMessage, MavModeFlag, MavSeverity, MavState, MavType,
};
use super::earth_frame::EarthFrame;
use super::frames::{AUTOPILOT, Content, Frame, MavAddress};
use super::parameter_reads::ParameterReads;
use crate::autopilot::{Ack, AutopilotReport, Command, NumberedCommand, VehicleKind};
use crate::time::Time;

use self::fixes::Fixes;
use self::heard::Heard;
use self::orders::Orders;
use self::ranges::Ranges;
pub use self::ranges::{AutopilotReading, AutopilotSensor, RangeFault, RangeSettings, RangeTally};
use self::servos::Servo;
pub use self::servos::{ServoPulse, ServoTrouble};
use self::setup::Setup;

/// Our own heartbeats.
const HEARTBEAT_EVERY: Duration = Duration::from_secs(1);
/// Without a word of the autopilot for this long its state is stale.
const STALE: Duration = Duration::from_secs(1);
/// A text of the autopilot explains a refusal for this long.
const TEXT_EXPLAINS: Duration = Duration::from_secs(3);

/// From which messages the place is taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PlaceSource {
    /// GLOBAL_POSITION_INT: satellites, or whatever gives a place on the earth.
    Global,
    /// LOCAL_POSITION_NED, counted from GPS_GLOBAL_ORIGIN: indoors.
    Local,
}

/// Parameters that must be known and stay unanswered are asked for again after this time.
const PARAMETERS_AGAIN: Duration = Duration::from_secs(5);

/// What a driver is told before it starts.
#[derive(Clone, Debug)]
pub struct MavlinkDriverSettings {
    /// Who we are; its failsafe for a silent ground station listens to this system (`SYSID_MYGCS`).
    pub own: MavAddress,
    /// The autopilot's system.
    pub system: u8,
    /// What it is to be.
    pub kind: VehicleKind,
    /// Where the venue's frame lies.
    pub frame: EarthFrame,
    /// From which messages the place is taken.
    pub place: PlaceSource,
    /// The origin of its frame is set to the venue's datum, when it has none.
    pub sets_origin: bool,
    /// A place is never believed to be better known than this, metres.
    pub place_sd_min_m: f64,
    /// The switch of its remote control, if one is used.
    pub switch: Option<SwitchSettings>,
    /// It is armed even if its failsafes do not keep it where it is, or are not known.
    pub arms_without_failsafes: bool,
    /// Its place is measured from outside, and passed on to it.
    pub takes_fixes: bool,
    /// The range sensors that hang on it, if any do.
    pub ranges: Option<RangeSettings>,
}

/// A switch of a remote control.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SwitchSettings {
    /// Its channel, 1 to 18.
    pub channel: u8,
    /// The pulse width at which the vehicle is to stand, microseconds.
    pub hold_us: u16,
    /// The pulse width at which it is to go home, microseconds.
    pub return_us: u16,
}

/// What a driver says.
#[derive(Clone, PartialEq, Debug)]
pub enum DriverOut {
    /// To the autopilot.
    Say(Box<MavMessage>),
    /// To the link: what the autopilot says of itself.
    Report(AutopilotReport),
    /// To the link: what it answers.
    Ack(Ack),
    /// To the range driver: what a sensor on the autopilot has measured.
    Reading(AutopilotReading),
    /// To people: a line that it has said, and whether it is a warning.
    Text {
        /// The line.
        text: String,
        /// Whether it warns.
        warns: bool,
    },
}

/// What is wrong with an autopilot.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum DriverTrouble {
    /// Nothing was ever heard of it.
    #[error("system {system} was not heard{others}")]
    NeverHeard {
        /// Which system.
        system: u8,
        /// Who was heard, in words.
        others: String,
    },
    /// It has fallen silent.
    #[error("system {system} is silent for {silent_s:.0} s")]
    Silent {
        /// Which system.
        system: u8,
        /// For how long, seconds.
        silent_s: f64,
    },
    /// It is another kind of vehicle.
    #[error("it steers {found}, and the vehicle's file says {expected}")]
    Kind {
        /// What it is.
        found: String,
        /// What it is to be.
        expected: &'static str,
    },
    /// It is no ArduPilot.
    #[error("its firmware is no ArduPilot (MAV_AUTOPILOT {found}): its modes are not known")]
    Firmware {
        /// The number of its firmware.
        found: u8,
    },
    /// Two say the same system id.
    #[error("two autopilots say that they are system {system}: one needs another SYSID_THISMAV")]
    Duplicate {
        /// The system.
        system: u8,
    },
    /// It does not know where it is.
    #[error("it does not know where it is: {why}")]
    NoPlace {
        /// Why, in words.
        why: String,
    },
    /// Its place is to be measured from outside, and nobody does.
    #[error("nobody says where it is from outside (tomoswarm fix)")]
    NoFix,
    /// Two measure its place from outside.
    #[error("{believed} and {other} both say where it is; {believed} is believed")]
    TwoMeasure {
        /// Who is believed.
        believed: Sender,
        /// Who is not.
        other: Sender,
    },
    /// It does not arm.
    #[error("it says: {0}")]
    Refuses(String),
    /// It has said how its battery is charged, and does not any more.
    #[error("it does not say its battery's charge any more; it was {last_percent:.0} %")]
    NoCharge {
        /// What it said last, percent.
        last_percent: f64,
    },
}

/// The driver of an autopilot.
#[derive(Clone, Debug)]
pub struct MavlinkDriver {
    settings: MavlinkDriverSettings,
    heard: Heard,
    orders: Orders,
    fixes: Fixes,
    /// What its range sensors say; `None` when none is of interest.
    ranges: Option<Ranges>,
    servo: Servo,
    setup: Setup,
    /// Its failsafes; `None` before it was heard.
    parameters: Option<ParameterReads>,
    heartbeat_due: Time,
}

impl MavlinkDriver {
    /// Begins with an autopilot that has not been heard.
    pub fn new(settings: MavlinkDriverSettings) -> MavlinkDriver {
        MavlinkDriver {
            heard: Heard::default(),
            orders: Orders::default(),
            fixes: Fixes::default(),
            servo: Servo::default(),
            setup: Setup::new(settings.ranges.as_ref().map(|ranges| ranges.rate_hz)),
            ranges: settings.ranges.clone().map(Ranges::new),
            parameters: None,
            heartbeat_due: Time::ZERO,
            settings,
        }
    }

    /// Notes that the connection to the autopilot was opened anew: what got no answer may get one now.
    pub fn reconnected(&mut self, now: Time) {
        if let Some(parameters) = &mut self.parameters {
            parameters.begin_again(now);
        }
    }

    /// Returns when parameters are asked for again; `None` while they are asked for, or what must be known of them is.
    fn parameters_again(&self) -> Option<Time> {
        let parameters = self.parameters.as_ref()?;
        let since = parameters.left_since()?;
        let (kind, own) = (self.settings.kind, self.settings.own.system);
        let failsafes = failsafes::failsafes(kind, own, parameters.values());
        let is_unknown = |(_, action): &(&str, FailsafeAction)| *action == FailsafeAction::Unknown;
        let needed = failsafes.needed();
        needed
            .iter()
            .any(is_unknown)
            .then(|| since + PARAMETERS_AGAIN)
    }

    /// Returns who it speaks with.
    fn target(&self) -> MavAddress {
        MavAddress {
            system: self.settings.system,
            component: AUTOPILOT,
        }
    }

    /// Tells the autopilot what the link wants.
    pub fn command(&mut self, now: Time, command: &NumberedCommand, out: &mut Vec<DriverOut>) {
        if matches!(command.command, Command::Arm { .. }) && !self.may_be_armed(now, out) {
            return orders::refuse_to_arm(command.number, out);
        }
        match &command.command {
            Command::Upload(items) => self.heard.forget_stored(Some(items)),
            Command::SetCurrent(_) => self.heard.forget_stored(None),
            _ => {}
        }
        let target = self.target();
        self.orders
            .take(now, command, target, &self.settings, &self.heard, out);
    }

    /// Returns whether its failsafes let it be armed; says why not. While they are being read it is not.
    fn may_be_armed(&self, now: Time, out: &mut Vec<DriverOut>) -> bool {
        if self.settings.arms_without_failsafes {
            return true;
        }
        let is_read = self
            .parameters
            .as_ref()
            .is_some_and(ParameterReads::has_been_over);
        let health = self.health(now).filter(|_| is_read);
        let Some(AutopilotHealth { failsafes, .. }) = health else {
            return false;
        };
        let needed = failsafes.needed();
        let missing: Vec<&str> = needed
            .iter()
            .filter(|(_, action)| !action.keeps_place())
            .map(|(cause, _)| *cause)
            .collect();
        if !missing.is_empty() {
            let causes = missing.join(", ");
            let why = format!("not armed: its failsafes ({causes}) do not keep it where it is");
            text(out, why, true);
        }
        missing.is_empty()
    }

    /// Gives a servo on the autopilot its pulse.
    pub fn give_pulse(&mut self, now: Time, pulse: ServoPulse, out: &mut Vec<DriverOut>) {
        let target = self.target();
        self.servo.give(now, pulse, target, out);
    }

    /// Returns the pulse by which the servo stands; `None` while that is not known.
    pub fn given_pulse(&self) -> Option<ServoPulse> {
        self.servo.given()
    }

    /// Returns why the servo does not stand where it should.
    pub fn servo_trouble(&self, now: Time) -> Option<ServoTrouble> {
        self.servo.trouble(now)
    }

    /// Hears where something outside has measured the vehicle to be; only a driver that takes fixes passes it on.
    pub fn hear_fix(&mut self, now: Time, from: Sender, fix: &Fix, out: &mut Vec<DriverOut>) {
        if self.settings.takes_fixes {
            let known = (&self.settings, &self.heard);
            self.fixes.hear(now, from, fix, known, out);
        }
    }

    /// Hears a frame; what another system says concerns nobody here.
    pub fn hear(&mut self, now: Time, frame: &Frame, out: &mut Vec<DriverOut>) {
        if self.hear_distance(now, frame, out) {
            return;
        }
        if frame.from != self.target() {
            self.heard.note_other(frame.from);
            return;
        }
        let message = match &frame.content {
            Content::Message(message) => message,
            Content::EkfStatus(flags) => return self.heard.take_estimator(now, *flags),
            Content::UnknownCommand { .. } => return,
        };
        let has_rebooted = self.heard.take(now, message, &self.settings);
        if has_rebooted {
            self.orders.forget();
            self.setup.begin_again(now);
            self.servo.forget();
            self.parameters = None;
            text(out, "the autopilot has started anew".to_owned(), true);
        }
        match message.as_ref() {
            MavMessage::HEARTBEAT(_) => {
                self.setup.heard(now, self.heard.attitude.at());
                let target = self.target();
                self.parameters
                    .get_or_insert_with(|| ParameterReads::begin(now, target, &failsafes::NAMES));
                self.orders.mind_mode(self.heard.mode(self.settings.kind));
            }
            MavMessage::COMMAND_ACK(ack) if ack.command == MavCmd::MAV_CMD_DO_SET_SERVO => {
                self.servo.answer(now, ack);
            }
            MavMessage::COMMAND_ACK(ack) => {
                self.setup.take_ack(now, frame.from, ack, out);
                let explained = self.heard.explanation(now, TEXT_EXPLAINS);
                self.orders.answer(ack, explained, out);
            }
            MavMessage::PARAM_VALUE(value) => {
                if let Some(parameters) = &mut self.parameters {
                    parameters.hear(value);
                }
            }
            MavMessage::STATUSTEXT(said) => {
                let line = said.text.to_str().unwrap_or("(no text)").to_owned();
                let warns = (said.severity as u8) <= MavSeverity::MAV_SEVERITY_WARNING as u8;
                text(out, line, warns);
            }
            MavMessage::MISSION_REQUEST_INT(_)
            | MavMessage::MISSION_REQUEST(_)
            | MavMessage::MISSION_COUNT(_)
            | MavMessage::MISSION_ITEM_INT(_)
            | MavMessage::MISSION_ACK(_) => {
                self.orders.hear_mission(now, message, &self.settings, out);
            }
            MavMessage::GLOBAL_POSITION_INT(_) if self.settings.place == PlaceSource::Global => {
                self.report(now, out)
            }
            MavMessage::LOCAL_POSITION_NED(_) if self.settings.place == PlaceSource::Local => {
                self.report(now, out)
            }
            _ => {}
        }
    }

    /// Hears a distance, if it is one; a part of the autopilot's own system may have measured it, such as a depth camera.
    fn hear_distance(&mut self, now: Time, frame: &Frame, out: &mut Vec<DriverOut>) -> bool {
        let (Some(ranges), Content::Message(message)) = (&mut self.ranges, &frame.content) else {
            return false;
        };
        frame.from.system == self.settings.system && ranges.hear(now, frame.from, message, out)
    }

    fn report(&mut self, now: Time, out: &mut Vec<DriverOut>) {
        if let Some(report) = self.heard.report(now, &self.settings) {
            let target = self.target();
            self.orders.go_on(now, &report, target, &self.settings, out);
            out.push(DriverOut::Report(report));
        }
    }

    /// Returns when something is to be said next.
    pub fn deadline(&self) -> Time {
        let parameters = self.parameters.as_ref().and_then(ParameterReads::deadline);
        let servo = self.servo.deadline();
        [
            self.setup.deadline(),
            self.orders.deadline(),
            parameters,
            self.parameters_again(),
            servo,
        ]
        .into_iter()
        .flatten()
        .fold(self.heartbeat_due, Time::min)
    }

    /// Says what is due by now.
    pub fn due(&mut self, now: Time, out: &mut Vec<DriverOut>) {
        if now >= self.heartbeat_due {
            self.heartbeat_due = now + HEARTBEAT_EVERY;
            say(out, heartbeat());
        }
        let target = self.target();
        self.setup
            .due(now, target, &self.settings, &self.heard, out);
        self.orders.due(now, target, &self.settings, out);
        self.servo.due(now, target, out);
        let is_again = self.parameters_again().is_some_and(|at| at <= now);
        if let Some(parameters) = &mut self.parameters {
            if is_again {
                parameters.begin_again(now);
            }
            let mut said = Vec::new();
            parameters.due(now, &mut said);
            said.into_iter().for_each(|message| say(out, message));
        }
    }

    /// Returns what it has said of its health; `None` before it was heard.
    pub fn health(&self, now: Time) -> Option<AutopilotHealth> {
        let unread = BTreeMap::new();
        let parameters = self.parameters.as_ref();
        let values = parameters.map_or(&unread, ParameterReads::values);
        health::health(now, &self.heard, values, &self.settings)
    }

    /// Returns what became of what it said of distances, of each range sensor that it was heard of, by its number.
    pub fn range_tallies(&self) -> impl Iterator<Item = (usize, RangeTally)> {
        let tallies = self.ranges.iter().flat_map(Ranges::tallies);
        tallies.map(|(sensor, tally)| (*sensor, *tally))
    }

    /// Returns what is wrong with the autopilot, the worst first.
    pub fn trouble(&self, now: Time) -> Option<DriverTrouble> {
        let of_fixes = || {
            let takes_them = self.settings.takes_fixes;
            takes_them.then(|| self.fixes.trouble(now)).flatten()
        };
        match self.heard.trouble(now, STALE, &self.settings) {
            // Why it knows no place, or what is worse than a charge that is not known.
            Some(trouble @ (DriverTrouble::NoPlace { .. } | DriverTrouble::NoCharge { .. })) => {
                of_fixes().or(Some(trouble))
            }
            Some(trouble) => Some(trouble),
            None => of_fixes(),
        }
    }
}

/// Returns our own heartbeat: of a companion computer.
fn heartbeat() -> MavMessage {
    MavMessage::HEARTBEAT(d::HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    })
}

fn say(out: &mut Vec<DriverOut>, message: MavMessage) {
    out.push(DriverOut::Say(Box::new(message)));
}

fn text(out: &mut Vec<DriverOut>, text: String, warns: bool) {
    out.push(DriverOut::Text { text, warns });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failsafes_that_stay_unknown_are_asked_for_again_and_at_once_on_a_new_connection() {
        let mut driver = MavlinkDriver::new(tests_support::settings());
        let hear = |driver: &mut MavlinkDriver, at_s: f64, message| {
            let frame = Frame {
                from: driver.target(),
                sequence: 0,
                content: Content::Message(Box::new(message)),
            };
            driver.hear(Time::from_secs_f64(at_s), &frame, &mut Vec::new());
        };
        let asks = |driver: &mut MavlinkDriver, at_s: f64| {
            let mut out = Vec::new();
            driver.due(Time::from_secs_f64(at_s), &mut out);
            let is_asked = |said: &DriverOut| match said {
                DriverOut::Say(message) => {
                    matches!(message.as_ref(), MavMessage::PARAM_REQUEST_READ(_))
                }
                _ => false,
            };
            out.iter().any(is_asked)
        };
        let heartbeat = MavMessage::HEARTBEAT(d::HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_GROUND_ROVER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            ..d::HEARTBEAT_DATA::default()
        });
        hear(&mut driver, 1.0, heartbeat);
        for at_s in [1.0, 1.5, 2.0, 2.5] {
            assert!(asks(&mut driver, at_s), "{at_s}");
        }
        assert!(!asks(&mut driver, 3.0) && !asks(&mut driver, 7.9));
        assert!(asks(&mut driver, 8.0), "5 s after the last answer was due");
        driver.reconnected(Time::from_secs_f64(8.1));
        assert!(asks(&mut driver, 8.1), "at once");
        for (name, value) in [
            ("BATT_MONITOR", 0.0),
            ("FENCE_ENABLE", 0.0),
            ("FS_GCS_ENABLE", 0.0),
            ("SYSID_MYGCS", 255.0),
        ] {
            let value = MavMessage::PARAM_VALUE(d::PARAM_VALUE_DATA {
                param_id: name.into(),
                param_value: value,
                ..d::PARAM_VALUE_DATA::default()
            });
            hear(&mut driver, 8.2, value);
        }
        for at_s in [8.6, 9.1, 9.6] {
            assert!(asks(&mut driver, at_s), "some are unanswered: {at_s}");
        }
        assert!(!asks(&mut driver, 99.0), "what must be known is");
    }
}
