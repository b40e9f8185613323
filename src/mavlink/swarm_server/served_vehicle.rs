//! A vehicle of the swarm as clients see it: what is known of it, what each client is told by itself, and what it says.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::commands::{Asker, GivenOrders};
use super::notices::Notices;
use crate::autopilot::VehicleKind;
use crate::mavlink::asked_command::command_ack;
use crate::mavlink::client_link::{ClientId, Outgoing};
use crate::mavlink::dialect::{MavMessage, MavParamType, MavResult, MavSeverity};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::parameter_table::ParameterTable;
use crate::mavlink::status_text::lines;
use crate::mavlink::streams::{Streams, next_after};
use crate::mavlink::vehicle_messages::{HEARTBEAT, HOME_POSITION, VehicleMessages, VehicleReadout};
use crate::time::Time;

const HEARTBEAT_EVERY: Duration = Duration::from_secs(1);
/// Vehicles that move say their state so often: more often there is nothing new.
const FASTEST: Duration = Duration::from_millis(200);
/// What every client is told by itself, and how often, until it asks for something else.
const STREAMS: [(u32, Duration); 9] = [
    (1, Duration::from_secs(1)),
    (24, Duration::from_millis(500)),
    (30, FASTEST),
    (33, FASTEST),
    (42, Duration::from_secs(1)),
    (74, Duration::from_millis(500)),
    (147, Duration::from_secs(1)),
    (HOME_POSITION, Duration::from_secs(5)),
    (245, Duration::from_secs(1)),
];

/// A vehicle that was heard.
pub(super) struct ServedVehicle {
    /// What it has said, and when; `None` while it is not heard.
    pub readout: Option<(Time, VehicleReadout)>,
    /// What it is, as it said last.
    pub kind: VehicleKind,
    pub heartbeat_due: Time,
    pub streams: Streams,
    pub parameters: ParameterTable,
    pub orders: GivenOrders,
    pub notices: Notices,
    /// Names texts that come in pieces.
    texts: u16,
    pub output: Vec<Outgoing>,
}

impl ServedVehicle {
    /// Makes a vehicle of which nothing was heard.
    pub(super) fn new(id: VehicleId, separation_m: f64) -> ServedVehicle {
        let (whole, number) = (
            MavParamType::MAV_PARAM_TYPE_INT32,
            MavParamType::MAV_PARAM_TYPE_REAL32,
        );
        ServedVehicle {
            readout: None,
            kind: VehicleKind::Rover,
            heartbeat_due: Time::ZERO,
            streams: Streams::no_faster_than(FASTEST),
            parameters: ParameterTable::new([
                // The silence of a ground station changes nothing.
                ("FS_GCS_ENABLE", 0.0, whole),
                ("SYSID_THISMAV", f32::from(id.0), whole),
                ("TS_BOOT", 0.0, whole),
                ("TS_SEPARATION", separation_m as f32, number),
            ]),
            orders: GivenOrders::default(),
            notices: Notices::default(),
            texts: 0,
            output: Vec::new(),
        }
    }

    /// Somebody has come, and hears at once that it is there.
    pub(super) fn joined(&mut self, now: Time, client: ClientId) {
        self.heartbeat_due = self.heartbeat_due.min(now);
        for (number, every) in STREAMS {
            self.streams.set(now, client, number, Some(every));
        }
    }

    /// Returns when something is to be said next.
    pub(super) fn deadline(&self) -> Time {
        [self.streams.deadline(), self.parameters.deadline()]
            .into_iter()
            .flatten()
            .fold(self.heartbeat_due, Time::min)
    }

    /// Returns what is known of it as messages; `None` while it is not heard.
    pub(super) fn shown<'a>(&self, frame: &'a EarthFrame) -> Option<VehicleMessages<'a>> {
        let (at, readout) = self.readout.clone()?;
        Some(VehicleMessages { at, readout, frame })
    }

    /// Says what is due by now; of one that is not heard nothing is.
    pub(super) fn due(&mut self, now: Time, frame: &EarthFrame) {
        if self.readout.is_none() || now < self.deadline() {
            return;
        }
        let Some(shown) = self.shown(frame) else {
            return;
        };
        if self.heartbeat_due <= now {
            self.heartbeat_due = next_after(HEARTBEAT_EVERY, now);
            self.say(None, shown.message(HEARTBEAT));
        }
        for (client, number) in self.streams.take_due(now) {
            self.say(Some(client), shown.message(number));
        }
        let mut values = Vec::new();
        self.parameters.due(now, &mut values);
        for (client, value) in values {
            self.say(Some(client), Some(value));
        }
    }

    fn say(&mut self, to: Option<ClientId>, message: Option<MavMessage>) {
        let outgoing = message.map(|message| Outgoing::message(to, message));
        self.output.extend(outgoing);
    }

    /// Answers a command, if that was asked for.
    pub(super) fn answer(&mut self, asker: Asker, result: MavResult) {
        let ack = asker
            .command
            .map(|command| command_ack(asker.from, command, result));
        self.say(Some(asker.client), ack);
    }

    /// Tells people something.
    pub(super) fn tell(&mut self, to: Option<ClientId>, severity: MavSeverity, text: &str) {
        // 0 names a text that is whole.
        self.texts = self.texts.checked_add(1).unwrap_or(1);
        for message in lines(severity, text, self.texts) {
            self.say(to, Some(message));
        }
    }

    /// Says the value of a name, or when there is none of an index.
    pub(super) fn tell_parameter(&mut self, client: ClientId, name: &str, index: i16) {
        let value = self.parameters.read(name, index);
        self.say(Some(client), value);
    }
}
