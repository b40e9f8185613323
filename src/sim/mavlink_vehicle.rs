//! A simulated vehicle as its autopilot shows it over MAVLink: what clients say becomes its commands, what it knows of
//! itself their messages. It behaves like ArduPilot's where a client would notice. Pure: it is told what came and what time
//! it is, and says what goes out; bytes are [`super::mavlink_fleet`]'s matter.
//!
//! ```text
//!   message ─► hear ─► commands, missions, parameters, streams ─► flown vehicle (environment)
//!                                                        │
//!   messages ◄─ due ◄─ heartbeat, streams, telemetry, texts
//! ```
//!
//! Deliberately simple: values of parameters are kept and given back, and only those of failsafes and speeds change what it
//! does; there are no files, logs, fences, rally points or gimbals: who asks is told so.

#![allow(
    deprecated,
    reason = "clients still say what the dialect has superseded, and ArduPilot still takes it"
)]

mod commands;
mod flown;
mod ground_station;
mod missions;
mod parameters;
mod reboot;
mod remote_control;
mod targets;
mod telemetry;
#[cfg(test)]
mod tests;
mod texts;

pub use flown::FlownVehicle;
pub use parameters::that_keep_place;

use std::time::Duration;

use crate::autopilot::{Command, CommandAck, VehicleKind};
use crate::mavlink::asked_command::AskedCommand;
use crate::mavlink::client_link::{ClientId, Outgoing, Said};
use crate::mavlink::dialect::{self as d, MavMessage};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::frames::{AUTOPILOT, Content, Frame, MavAddress, target_of};
use crate::mavlink::parameter_table::ParameterTable;
use crate::mavlink::streams::{Streams, next_after};
use crate::time::Time;

use self::ground_station::GroundStation;
use self::missions::Missions;
use self::parameters::{defaults, on_low_battery, speed_mps};
use self::remote_control::RemoteControl;
use self::telemetry::Telemetry;

const HEARTBEAT_EVERY: Duration = Duration::from_secs(1);
/// Texts that it says by itself are looked for this often.
const TEXTS_EVERY: Duration = Duration::from_millis(100);

/// A vehicle behind MAVLink.
#[derive(Clone, Debug)]
pub struct MavlinkVehicle {
    address: MavAddress,
    kind: VehicleKind,
    frame: EarthFrame,
    /// When it was started, or will have been.
    booted: Time,
    heartbeat_due: Time,
    texts_due: Time,
    streams: Streams,
    missions: Missions,
    parameters: ParameterTable,
    remote_control: RemoteControl,
    ground_station: GroundStation,
    /// The last position target, until something else is commanded.
    target: Option<Command>,
}

impl MavlinkVehicle {
    /// Makes what shows a vehicle under a system id; places are in a frame.
    pub fn new(system: u8, kind: VehicleKind, frame: EarthFrame) -> MavlinkVehicle {
        MavlinkVehicle {
            address: MavAddress {
                system,
                component: AUTOPILOT,
            },
            kind,
            frame,
            booted: Time::ZERO,
            heartbeat_due: Time::ZERO,
            texts_due: Time::ZERO,
            streams: Streams::default(),
            missions: Missions::default(),
            parameters: defaults(kind, system),
            remote_control: RemoteControl::default(),
            ground_station: GroundStation::default(),
            target: None,
        }
    }

    /// Returns who it is.
    pub fn address(&self) -> MavAddress {
        self.address
    }

    /// Gives a parameter a value, and does what follows from it; returns what it is then, `None` when there is none of that
    /// name.
    pub fn set_parameter(
        &mut self,
        now: Time,
        name: &str,
        value: f32,
        vehicle: &mut FlownVehicle<'_>,
    ) -> Option<MavMessage> {
        let value = self.parameters.set(name, value);
        if let Some(speed_mps) = speed_mps(&self.parameters, name, self.kind) {
            vehicle.command(now, &Command::Speed(speed_mps));
        }
        vehicle.set_low_battery(on_low_battery(&self.parameters, self.kind));
        value
    }

    /// Somebody has come, and hears at once that it is there.
    pub fn joined(&mut self, now: Time) {
        self.heartbeat_due = self.heartbeat_due.min(now).max(self.booted);
    }

    /// Somebody is gone: whatever it had asked for is forgotten.
    pub fn left(&mut self, client: ClientId) {
        self.streams.forget(client);
        self.parameters.forget(client);
    }

    /// Returns when something is to be said next.
    pub fn deadline(&self) -> Time {
        [
            self.streams.deadline(),
            self.missions.deadline(),
            self.parameters.deadline(),
            self.ground_station.deadline(&self.parameters),
        ]
        .into_iter()
        .flatten()
        .fold(self.heartbeat_due.min(self.texts_due), Time::min)
        .max(self.booted)
    }

    /// Says what is due by now.
    pub fn due(&mut self, now: Time, vehicle: &mut FlownVehicle<'_>, out: &mut Vec<Outgoing>) {
        if self.is_starting(now) {
            return;
        }
        if self.texts_due <= now {
            self.texts_due = next_after(TEXTS_EVERY, now);
            self.say_texts(vehicle, out);
        }
        if let Some(command) = self.ground_station.due(now, self.kind, &self.parameters) {
            vehicle.command(now, &command);
            tell(out, None, texts::failsafe());
        }
        let mut answers = Vec::new();
        self.missions.due(now, &mut answers);
        self.parameters.due(now, &mut answers);
        for (client, message) in answers {
            tell(out, Some(client), message);
        }
        let is_heartbeat_due = self.heartbeat_due <= now;
        let due = self.streams.take_due(now);
        if !is_heartbeat_due && due.is_empty() {
            return;
        }
        let telemetry = self.telemetry(now, vehicle);
        let mut said = Vec::new();
        if is_heartbeat_due {
            said.extend(telemetry.said(0).map(|said| (None, said)));
        }
        for (client, number) in due {
            said.extend(telemetry.said(number).map(|said| (Some(client), said)));
        }
        if is_heartbeat_due {
            self.heartbeat_due = next_after(HEARTBEAT_EVERY, now);
        }
        out.extend(said.into_iter().map(|(to, said)| Outgoing { to, said }));
    }

    /// Hears what a client says; what is for another system is none of its business.
    pub fn hear(
        &mut self,
        now: Time,
        client: ClientId,
        frame: &Frame,
        vehicle: &mut FlownVehicle<'_>,
        out: &mut Vec<Outgoing>,
    ) {
        let message = match &frame.content {
            _ if self.is_starting(now) => return,
            Content::Message(message) => message,
            Content::EkfStatus(_) => return,
            Content::UnknownCommand {
                command,
                target_system,
            } => {
                if self.is_for_us(*target_system) {
                    out.push(Outgoing {
                        to: Some(client),
                        said: Said::Unsupported {
                            command: *command,
                            to: frame.from,
                        },
                    });
                }
                return;
            }
        };
        if target_of(message).is_some_and(|system| !self.is_for_us(system)) {
            return;
        }
        self.hear_message(now, (client, frame.from), message, vehicle, out);
    }

    fn hear_message(
        &mut self,
        now: Time,
        (client, from): (ClientId, MavAddress),
        message: &MavMessage,
        vehicle: &mut FlownVehicle<'_>,
        out: &mut Vec<Outgoing>,
    ) {
        match message {
            MavMessage::HEARTBEAT(heartbeat) => {
                self.ground_station
                    .hear(now, from, heartbeat, &self.parameters)
            }
            MavMessage::COMMAND_LONG(long) => {
                self.carry_out(
                    now,
                    (client, from),
                    &AskedCommand::of_long(long),
                    vehicle,
                    out,
                );
            }
            MavMessage::COMMAND_INT(int) => {
                self.carry_out(
                    now,
                    (client, from),
                    &AskedCommand::of_int(int),
                    vehicle,
                    out,
                );
            }
            MavMessage::SET_MODE(set) => {
                self.change_mode(now, set.custom_mode, vehicle);
            }
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(target) => {
                let command = targets::of_local(target, self.kind, &self.frame, vehicle, now);
                self.aim(now, command, vehicle);
            }
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(target) => {
                self.aim(
                    now,
                    targets::of_global(target, self.kind, &self.frame),
                    vehicle,
                );
            }
            MavMessage::REQUEST_DATA_STREAM(request) => {
                let rate_hz = f64::from(request.req_message_rate);
                let every = (request.start_stop == 1 && request.req_message_rate > 0)
                    .then(|| Duration::from_secs_f64(1.0 / rate_hz));
                self.streams
                    .set_group(now, client, request.req_stream_id as u8, every);
            }
            MavMessage::PARAM_REQUEST_LIST(_) => {
                tell(out, Some(client), texts::banner(self.kind));
                self.parameters.tell_all(client);
            }
            MavMessage::PARAM_REQUEST_READ(read) => {
                let name = read.param_id.to_str().unwrap_or_default();
                let value = self.parameters.read(name, read.param_index);
                value
                    .into_iter()
                    .for_each(|value| tell(out, Some(client), value));
            }
            MavMessage::PARAM_SET(set) => {
                let name = set.param_id.to_str().unwrap_or_default();
                let value = self.set_parameter(now, name, set.param_value, vehicle);
                // Every client keeps a copy.
                value.into_iter().for_each(|value| tell(out, None, value));
            }
            MavMessage::SET_GPS_GLOBAL_ORIGIN(_) => {
                let origin = self.telemetry(now, vehicle).message(49);
                origin
                    .into_iter()
                    .for_each(|origin| tell(out, None, origin));
            }
            MavMessage::RC_CHANNELS_OVERRIDE(channels) => self.remote_control.hear(channels),
            MavMessage::TIMESYNC(sync) if sync.tc1 == 0 => {
                let answer = d::TIMESYNC_DATA {
                    tc1: i64::try_from(now.as_nanos()).unwrap_or(i64::MAX),
                    ts1: sync.ts1,
                    target_system: from.system,
                    target_component: from.component,
                };
                tell(out, Some(client), MavMessage::TIMESYNC(answer));
            }
            MavMessage::PING(ping) if ping.target_system == 0 => {
                let answer = d::PING_DATA {
                    target_system: from.system,
                    target_component: from.component,
                    ..ping.clone()
                };
                tell(out, Some(client), MavMessage::PING(answer));
            }
            other => {
                let answers = self
                    .missions
                    .hear(now, (client, from), other, vehicle, &self.frame);
                answers
                    .into_iter()
                    .for_each(|answer| tell(out, Some(client), answer));
            }
        }
    }

    /// Goes for a position target; one that is said again changes nothing.
    fn aim(&mut self, now: Time, command: Option<Command>, vehicle: &mut FlownVehicle<'_>) {
        let is_velocity = matches!(command, Some(Command::Velocity(_)));
        if command.is_none() || (command == self.target && !is_velocity) {
            return;
        }
        if let Some(command) = &command {
            let obeyed = vehicle.command(now, command).result;
            self.target = (obeyed == CommandAck::Accepted).then(|| command.clone());
        }
    }

    /// Returns whether somebody speaks to this system, or to all.
    fn is_for_us(&self, system: u8) -> bool {
        system == 0 || system == self.address.system
    }

    /// Says what the autopilot has said by itself, to all.
    fn say_texts(&mut self, vehicle: &mut FlownVehicle<'_>, out: &mut Vec<Outgoing>) {
        for (_, text) in vehicle.status_texts() {
            for message in texts::messages(text) {
                tell(out, None, message);
            }
        }
    }

    fn telemetry(&self, now: Time, vehicle: &mut FlownVehicle<'_>) -> Telemetry<'_> {
        let shown = (self.missions.count(), self.remote_control.channels());
        let at = (now, self.booted);
        Telemetry::new(at, self.kind, vehicle.readout(now), &self.frame, shown)
    }
}

fn tell(out: &mut Vec<Outgoing>, to: Option<ClientId>, message: MavMessage) {
    out.push(Outgoing::message(to, message));
}
