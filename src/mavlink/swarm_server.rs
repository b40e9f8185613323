//! The swarm as ground stations see it over MAVLink: every vehicle that is heard is shown as an autopilot with its own
//! number as system id, and commands become orders for an operator, if that is allowed. A pure machine: it is told what
//! vehicles have said of themselves, what bytes came, how orders have ended and what time it is; it says bytes and the
//! orders that are wanted. It decides nothing for a vehicle, and knows neither sockets nor the bus.
//!
//! ```text
//!   states ─► due ─► heartbeats, streams, texts ─────────────────► bytes
//!   bytes ──► hear ─► answers, COMMAND_ACK ──────────────────────► bytes
//!                └──► order ─► (operator) ─► ended ─► COMMAND_ACK ─┘
//! ```
//!
//! A vehicle that is not heard says nothing, so that ground stations miss it. What steers is answered DENIED while commands are
//! off, and always when it is for all systems at once; what only asks is answered always. Deliberately absent: missions are
//! neither listed nor taken, parameters are not set.

#![allow(
    deprecated,
    reason = "clients still say what the dialect has superseded, and ArduPilot still takes it"
)]

mod commands;
mod notices;
mod readout;
mod served_vehicle;
#[cfg(test)]
mod tests;

pub use readout::VehicleReport;

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use tomoswarm_proto::{OrderKind, VehicleId};

use self::commands::{Asker, Taken, WantedOrder, wanted, wanted_by_mode};
use self::served_vehicle::ServedVehicle;
use super::asked_command::AskedCommand;
use super::client_link::{ClientBytes, ClientId, ClientLink, Outgoing, Said, bytes_for};
use super::dialect::{MavMessage, MavMissionResult, MavResult, MavSeverity, SET_MODE_DATA};
use super::earth_frame::EarthFrame;
use super::frames::{AUTOPILOT, Content, Frame, MavAddress, target_of};
use super::message_requests::answer_request;
use super::mission_upload::{mission_ack, mission_count};
use super::signing::KEY_BYTES;
use crate::geom::Point;
use crate::time::Time;

/// That commands are off is told no more often than this.
const OFF_EVERY: Duration = Duration::from_secs(10);

/// What a server is told before it begins.
#[derive(Clone, Debug)]
pub struct SwarmServerSettings {
    /// Where the venue's frame lies.
    pub frame: EarthFrame,
    /// The homes of vehicles 1, 2, …
    pub homes: Vec<Point>,
    /// Vehicles keep so far apart, metres.
    pub separation_m: f64,
    /// Whether commands become orders.
    pub commands: bool,
    /// The file that says so, for people.
    pub file: String,
    /// Only who signs with this key is heard.
    pub key: Option<[u8; KEY_BYTES]>,
}

/// An order that a ground station wants.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct OrderRequest {
    /// Its number here.
    pub number: u32,
    /// For whom.
    pub vehicle: VehicleId,
    /// What it shall do.
    pub kind: OrderKind,
    /// Whether a start may begin a new run.
    pub begins: bool,
}

/// How an order has ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum RequestEnd {
    /// The vehicle shows it.
    InForce,
    /// It was not given, for this reason.
    Refused(String),
    /// The vehicle does not show it, for this reason.
    Failed(String),
}

impl fmt::Display for RequestEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RequestEnd::InForce => write!(f, "in force"),
            RequestEnd::Refused(why) => write!(f, "not given: {why}"),
            RequestEnd::Failed(why) => write!(f, "not in force: {why}"),
        }
    }
}

/// What the server says.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ServerOutput {
    /// Bytes for clients.
    pub bytes: Vec<ClientBytes>,
    /// Orders that are wanted.
    pub requests: Vec<OrderRequest>,
    /// Lines for people.
    pub warnings: Vec<String>,
}

/// The swarm behind MAVLink.
pub struct SwarmServer {
    settings: SwarmServerSettings,
    vehicles: BTreeMap<VehicleId, ServedVehicle>,
    clients: BTreeMap<ClientId, Client>,
    /// Orders named so far.
    numbers: u32,
    has_warned: bool,
}

struct Client {
    link: ClientLink,
    /// When it was told last that commands are off.
    told_off: Option<Time>,
}

impl SwarmServer {
    /// Begins; nobody was heard.
    pub fn new(settings: SwarmServerSettings) -> SwarmServer {
        SwarmServer {
            settings,
            vehicles: BTreeMap::new(),
            clients: BTreeMap::new(),
            numbers: 0,
            has_warned: false,
        }
    }

    /// Somebody has come. `clock` is the time of signatures, units of 10 µs since 2015.
    pub fn joined(&mut self, now: Time, client: ClientId, clock: u64) {
        let link = ClientLink::new(self.settings.key, clock);
        let told_off = None;
        self.clients.insert(client, Client { link, told_off });
        for vehicle in self.vehicles.values_mut() {
            vehicle.joined(now, client);
        }
    }

    /// Somebody is gone.
    pub fn left(&mut self, client: ClientId) {
        self.clients.remove(&client);
        for vehicle in self.vehicles.values_mut() {
            vehicle.streams.forget(client);
            vehicle.parameters.forget(client);
        }
    }

    /// Hears bytes of a client.
    pub fn hear(&mut self, now: Time, client: ClientId, bytes: &[u8], out: &mut ServerOutput) {
        let Some(known) = self.clients.get_mut(&client) else {
            return;
        };
        known.link.push(bytes);
        while let Some(frame) = self.next_frame(client) {
            self.hear_frame(now, client, &frame, out);
        }
        let untrusted = self
            .clients
            .get(&client)
            .map(|known| known.link.untrusted());
        if untrusted.is_some_and(|count| count > 0) && !self.has_warned {
            self.has_warned = true;
            let text = "a ground station that does not sign with the key is not listened to";
            out.warnings.push(text.to_owned());
        }
        self.write(out);
    }

    /// Hears how an order has ended.
    pub fn ended(&mut self, number: u32, end: &RequestEnd, out: &mut ServerOutput) {
        let (result, why) = match end {
            RequestEnd::InForce => (MavResult::MAV_RESULT_ACCEPTED, None),
            RequestEnd::Refused(why) => (MavResult::MAV_RESULT_DENIED, Some(why)),
            RequestEnd::Failed(why) => (MavResult::MAV_RESULT_FAILED, Some(why)),
        };
        for vehicle in self.vehicles.values_mut() {
            for asker in vehicle.orders.ended(number, result) {
                vehicle.answer(asker, result);
                if let Some(why) = why {
                    vehicle.tell(Some(asker.client), MavSeverity::MAV_SEVERITY_WARNING, why);
                }
            }
        }
        self.write(out);
    }

    /// Returns when something is to be said next.
    pub fn deadline(&self) -> Time {
        let heard = self.vehicles.values().filter(|of| of.readout.is_some());
        heard
            .map(ServedVehicle::deadline)
            .min()
            .unwrap_or(Time::NEVER)
    }

    /// Takes what the vehicles have said that are heard, each once, and says what is due by now.
    pub fn due<'a>(
        &mut self,
        now: Time,
        reports: impl Iterator<Item = VehicleReport<'a>>,
        out: &mut ServerOutput,
    ) {
        let mut heard = BTreeMap::new();
        for report in reports {
            heard.insert(report.state.vehicle, report);
        }
        for (id, report) in &heard {
            self.see(now, *id, report);
        }
        for (id, vehicle) in &mut self.vehicles {
            if !heard.contains_key(id) {
                vehicle.readout = None;
            }
            vehicle.due(now, &self.settings.frame);
        }
        self.write(out);
    }

    fn see(&mut self, now: Time, id: VehicleId, report: &VehicleReport<'_>) {
        let index = usize::from(id.0).checked_sub(1);
        let home = index.and_then(|index| self.settings.homes.get(index).copied());
        let (clients, separation_m) = (&self.clients, self.settings.separation_m);
        let vehicle = self.vehicles.entry(id).or_insert_with(|| {
            let mut vehicle = ServedVehicle::new(id, separation_m);
            clients
                .keys()
                .for_each(|client| vehicle.joined(now, *client));
            vehicle
        });
        if vehicle.readout.is_none() {
            vehicle.heartbeat_due = now;
        }
        let readout = readout::readout(report, home);
        vehicle.kind = readout.kind;
        vehicle.readout = Some((report.at, readout));
        vehicle
            .parameters
            .set("TS_BOOT", report.state.boot.0 as f32);
        for (severity, text) in vehicle.notices.changed(report) {
            vehicle.tell(None, severity, &text);
        }
    }

    fn next_frame(&mut self, client: ClientId) -> Option<Frame> {
        self.clients.get_mut(&client)?.link.next_frame()
    }

    fn hear_frame(&mut self, now: Time, client: ClientId, frame: &Frame, out: &mut ServerOutput) {
        match &frame.content {
            Content::Message(message) => {
                let Some(target) = target_of(message) else {
                    return;
                };
                for id in self.addressed(target) {
                    self.hear_message(now, (client, frame.from), id, message, out);
                }
            }
            // Nobody asks a ground station for its estimator.
            Content::EkfStatus(_) => {}
            Content::UnknownCommand {
                command,
                target_system,
            } => {
                let said = Said::Unsupported {
                    command: *command,
                    to: frame.from,
                };
                for id in self.addressed(*target_system) {
                    if let Some(vehicle) = self.vehicles.get_mut(&id) {
                        vehicle.output.push(Outgoing {
                            to: Some(client),
                            said: said.clone(),
                        });
                    }
                }
            }
        }
    }

    /// Returns the vehicles that a target means; 0 = all.
    fn addressed(&self, target: u8) -> Vec<VehicleId> {
        let is_meant = |id: &VehicleId| target == 0 || target == id.0;
        self.vehicles.keys().copied().filter(is_meant).collect()
    }

    fn hear_message(
        &mut self,
        now: Time,
        (client, from): (ClientId, MavAddress),
        id: VehicleId,
        message: &MavMessage,
        out: &mut ServerOutput,
    ) {
        let Some(vehicle) = self.vehicles.get_mut(&id) else {
            return;
        };
        match message {
            MavMessage::COMMAND_LONG(long) if is_autopilot(long.target_component) => {
                let asked = AskedCommand::of_long(long);
                let is_for_all = long.target_system == 0;
                self.command(
                    now,
                    (client, from, id),
                    (&asked, long.confirmation, is_for_all),
                    out,
                );
            }
            MavMessage::COMMAND_INT(int) if is_autopilot(int.target_component) => {
                let (asked, is_for_all) = (AskedCommand::of_int(int), int.target_system == 0);
                self.command(now, (client, from, id), (&asked, 0, is_for_all), out);
            }
            MavMessage::SET_MODE(set) => self.set_mode(now, (client, from, id), set, out),
            MavMessage::REQUEST_DATA_STREAM(request) => {
                let rate_hz = f64::from(request.req_message_rate);
                let every = (request.start_stop == 1 && request.req_message_rate > 0)
                    .then(|| Duration::from_secs_f64(1.0 / rate_hz));
                vehicle
                    .streams
                    .set_group(now, client, request.req_stream_id as u8, every);
            }
            MavMessage::PARAM_REQUEST_LIST(_) => vehicle.parameters.tell_all(client),
            MavMessage::PARAM_REQUEST_READ(read) => {
                let name = read.param_id.to_str().unwrap_or_default();
                vehicle.tell_parameter(client, name, read.param_index);
            }
            // It is not set: whoever asked hears what it is.
            MavMessage::PARAM_SET(set) => {
                vehicle.tell_parameter(client, set.param_id.to_str().unwrap_or_default(), -1);
            }
            other => {
                let answer = about_missions(from, other);
                let answers = answer.map(|message| Outgoing::message(Some(client), message));
                vehicle.output.extend(answers);
            }
        }
    }

    /// Takes a command of whoever it is from, for one vehicle, with its confirmation and whether it is for all.
    fn command(
        &mut self,
        now: Time,
        (client, from, id): (ClientId, MavAddress, VehicleId),
        (asked, confirmation, is_for_all): (&AskedCommand, u8, bool),
        out: &mut ServerOutput,
    ) {
        let asker = Asker {
            client,
            from,
            command: Some(asked.command),
        };
        let frame = self.settings.frame;
        let Some(vehicle) = self.vehicles.get_mut(&id) else {
            return;
        };
        if is_for_all {
            return vehicle.answer(asker, MavResult::MAV_RESULT_DENIED);
        }
        let shown = vehicle.shown(&frame);
        let said = |number| {
            let message = shown.as_ref()?.message(number)?;
            Some(Said::Message(Box::new(message)))
        };
        let of_message = answer_request(
            now,
            client,
            asked,
            &mut vehicle.streams,
            &said,
            &mut vehicle.output,
        );
        if let Some(result) = of_message {
            return vehicle.answer(asker, result);
        }
        if !self.settings.commands {
            return self.refuse(now, asker, id);
        }
        match wanted(vehicle.kind, asked) {
            Ok(wanted) => self.order(now, (asker, id), wanted, confirmation, out),
            Err(result) => vehicle.answer(asker, result),
        }
    }

    /// Takes a mode, which is not answered but in words.
    fn set_mode(
        &mut self,
        now: Time,
        (client, from, id): (ClientId, MavAddress, VehicleId),
        set: &SET_MODE_DATA,
        out: &mut ServerOutput,
    ) {
        let asker = Asker {
            client,
            from,
            command: None,
        };
        if set.target_system == 0 {
            return;
        }
        if !self.settings.commands {
            return self.refuse(now, asker, id);
        }
        let Some(vehicle) = self.vehicles.get_mut(&id) else {
            return;
        };
        match wanted_by_mode(vehicle.kind, set.custom_mode) {
            Some(wanted) => self.order(now, (asker, id), wanted, 0, out),
            None => vehicle.tell(
                Some(client),
                MavSeverity::MAV_SEVERITY_WARNING,
                "this mode is not driven",
            ),
        }
    }

    fn order(
        &mut self,
        now: Time,
        (asker, id): (Asker, VehicleId),
        wanted: WantedOrder,
        confirmation: u8,
        out: &mut ServerOutput,
    ) {
        let Some(vehicle) = self.vehicles.get_mut(&id) else {
            return;
        };
        let taken = vehicle
            .orders
            .take(now, wanted, asker, confirmation, self.numbers);
        match taken {
            Taken::Order(number) => {
                self.numbers = self.numbers.wrapping_add(1);
                out.requests.push(OrderRequest {
                    number,
                    vehicle: id,
                    kind: wanted.kind,
                    begins: wanted.begins,
                });
                vehicle.answer(asker, MavResult::MAV_RESULT_IN_PROGRESS);
            }
            Taken::UnderWay => vehicle.answer(asker, MavResult::MAV_RESULT_IN_PROGRESS),
            Taken::Answered(result) => vehicle.answer(asker, result),
        }
    }

    /// Answers a command while commands are off.
    fn refuse(&mut self, now: Time, asker: Asker, id: VehicleId) {
        let Some(vehicle) = self.vehicles.get_mut(&id) else {
            return;
        };
        vehicle.answer(asker, MavResult::MAV_RESULT_DENIED);
        let Some(client) = self.clients.get_mut(&asker.client) else {
            return;
        };
        if client.told_off.is_none_or(|at| now.since(at) >= OFF_EVERY) {
            client.told_off = Some(now);
            let text = format!(
                "commands are off: set commands = true in {}",
                self.settings.file
            );
            vehicle.tell(Some(asker.client), MavSeverity::MAV_SEVERITY_WARNING, &text);
        }
    }

    /// Makes frames of what vehicles have said.
    fn write(&mut self, out: &mut ServerOutput) {
        for (id, vehicle) in &mut self.vehicles {
            let from = MavAddress {
                system: id.0,
                component: AUTOPILOT,
            };
            for outgoing in vehicle.output.drain(..) {
                for (client, known) in &mut self.clients {
                    if outgoing.to.is_none_or(|to| to == *client) {
                        let bytes = bytes_for(*client, &mut out.bytes);
                        known.link.write(from, &outgoing.said, bytes);
                    }
                }
            }
        }
    }
}

fn is_autopilot(component: u8) -> bool {
    component == 0 || component == AUTOPILOT
}

/// Answers what is about missions: there are none, and none is taken.
fn about_missions(from: MavAddress, message: &MavMessage) -> Option<MavMessage> {
    let refused = MavMissionResult::MAV_MISSION_UNSUPPORTED;
    match message {
        MavMessage::MISSION_REQUEST_LIST(request) => {
            Some(mission_count(from, request.mission_type, 0))
        }
        MavMessage::MISSION_COUNT(count) => Some(mission_ack(from, count.mission_type, refused)),
        MavMessage::MISSION_CLEAR_ALL(clear) => {
            Some(mission_ack(from, clear.mission_type, refused))
        }
        MavMessage::MISSION_REQUEST_INT(request) => Some(mission_ack(
            from,
            request.mission_type,
            MavMissionResult::MAV_MISSION_INVALID_SEQUENCE,
        )),
        _ => None,
    }
}
