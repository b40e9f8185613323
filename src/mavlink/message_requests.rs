//! What a client asks of the messages of a vehicle by commands: one of them now, or how often it comes.

#![allow(
    deprecated,
    reason = "clients still say what the dialect has superseded, and ArduPilot still takes it"
)]

use std::time::Duration;

use super::asked_command::AskedCommand;
use super::client_link::{ClientId, Outgoing, Said};
use super::dialect::{MESSAGE_INTERVAL_DATA, MavCmd, MavMessage, MavResult};
use super::streams::{DEFAULT_EVERY, Streams};
use super::vehicle_messages::{AUTOPILOT_VERSION, HOME_POSITION};
use crate::time::Time;

/// The message that says how often another one comes.
const MESSAGE_INTERVAL: u32 = 244;

/// Returns what is said under a number; `None` for one under which nothing is.
pub type SaidOf<'a> = dyn Fn(u32) -> Option<Said> + 'a;

/// Answers a command that is about messages; `None` for any other.
pub fn answer_request(
    now: Time,
    client: ClientId,
    asked: &AskedCommand,
    streams: &mut Streams,
    said: &SaidOf<'_>,
    out: &mut Vec<Outgoing>,
) -> Option<MavResult> {
    let number = match asked.command {
        MavCmd::MAV_CMD_GET_HOME_POSITION => Some(HOME_POSITION),
        MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES => Some(AUTOPILOT_VERSION),
        MavCmd::MAV_CMD_REQUEST_MESSAGE => asked.whole(1),
        MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {
            return Some(set_interval(now, client, asked, streams, said));
        }
        MavCmd::MAV_CMD_GET_MESSAGE_INTERVAL => {
            return Some(tell_interval(client, asked, streams, said, out));
        }
        _ => return None,
    };
    let Some(number) = number else {
        return Some(MavResult::MAV_RESULT_DENIED);
    };
    let Some(said) = said(number) else {
        return Some(MavResult::MAV_RESULT_FAILED);
    };
    let to = Some(client);
    out.push(Outgoing { to, said });
    Some(MavResult::MAV_RESULT_ACCEPTED)
}

fn set_interval(
    now: Time,
    client: ClientId,
    asked: &AskedCommand,
    streams: &mut Streams,
    said: &SaidOf<'_>,
) -> MavResult {
    let (Some(number), Some(interval_us)) = (asked.whole(1), asked.number(2)) else {
        return MavResult::MAV_RESULT_DENIED;
    };
    if said(number).is_none() {
        return MavResult::MAV_RESULT_DENIED;
    }
    let every = match interval_us {
        us if us < 0.0 => None,
        0.0 => Some(DEFAULT_EVERY),
        us => Some(Duration::from_secs_f64(us.min(1e10) * 1e-6)),
    };
    streams.set(now, client, number, every);
    MavResult::MAV_RESULT_ACCEPTED
}

/// Says how often a message comes: as an interval, microseconds; -1 = not by itself, 0 = it is not known.
fn tell_interval(
    client: ClientId,
    asked: &AskedCommand,
    streams: &Streams,
    said: &SaidOf<'_>,
    out: &mut Vec<Outgoing>,
) -> MavResult {
    let Some(number) = asked.whole(1).and_then(|number| u16::try_from(number).ok()) else {
        return MavResult::MAV_RESULT_DENIED;
    };
    if u32::from(number) == MESSAGE_INTERVAL {
        return MavResult::MAV_RESULT_FAILED;
    }
    let interval_us = match streams.every(client, u32::from(number)) {
        Some(every) => i32::try_from(every.as_micros()).unwrap_or(i32::MAX),
        None if said(u32::from(number)).is_some() => -1,
        None => 0,
    };
    let interval = MESSAGE_INTERVAL_DATA {
        interval_us,
        message_id: number,
    };
    out.push(Outgoing::message(
        Some(client),
        MavMessage::MESSAGE_INTERVAL(interval),
    ));
    MavResult::MAV_RESULT_ACCEPTED
}
