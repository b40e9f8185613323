//! What a frame of the module means to the modem. A payload that is no beacon is of a stranger, or damaged; a beacon without a
//! strength is none either, since no sample can be made of it.

use tomoswarm_proto::codec::{self, Decoded};
use tomoswarm_proto::{Beacon, Message};

use super::super::xbee_frame::Frame;
use super::super::xbee_registers::Answer;
use crate::node::radio::HeardBeacon;

/// What the module says.
#[derive(Clone, Debug)]
pub(super) enum Incoming {
    /// It answers a command.
    Answer(Answer),
    /// What became of a beacon.
    Status {
        /// Which one.
        id: u8,
        /// 0 = sent.
        status: u8,
    },
    /// It was switched on, or reset.
    Reset,
    /// A beacon was heard.
    Beacon {
        /// The sender's address; `None` = it has none.
        from: Option<u16>,
        /// What it says.
        heard: HeardBeacon,
    },
    /// Something was heard, and not how strongly.
    WithoutRssi,
    /// What was heard is no beacon.
    Foreign,
}

impl Incoming {
    /// Returns what a frame means; `None` = nothing.
    pub(super) fn of(frame: &Frame<'_>) -> Option<Incoming> {
        match *frame {
            Frame::CommandAnswer { .. } => Answer::of(frame).map(Incoming::Answer),
            Frame::TransmitStatus { id, status } => Some(Incoming::Status { id, status }),
            Frame::ModemStatus(0 | 1) => Some(Incoming::Reset),
            Frame::Receive16 {
                from,
                rssi_dbm,
                payload,
                ..
            } => Some(heard(Some(from), rssi_dbm, payload)),
            Frame::Receive64 {
                rssi_dbm, payload, ..
            } => Some(heard(None, rssi_dbm, payload)),
            Frame::ReceiveWithoutRssi { .. } => Some(Incoming::WithoutRssi),
            Frame::ModemStatus(_)
            | Frame::Other { .. }
            | Frame::RemoteAnswer { .. }
            | Frame::Transmit64 { .. }
            | Frame::Transmit16 { .. }
            | Frame::Command { .. }
            | Frame::QueuedCommand { .. }
            | Frame::RemoteCommand { .. } => None,
        }
    }
}

fn heard(from: Option<u16>, rssi_dbm: i16, payload: &[u8]) -> Incoming {
    match beacon(payload) {
        Some(beacon) if rssi_dbm < 0 => {
            let heard = HeardBeacon { beacon, rssi_dbm };
            Incoming::Beacon { from, heard }
        }
        Some(_) | None => Incoming::Foreign,
    }
}

fn beacon(payload: &[u8]) -> Option<Beacon> {
    match codec::decode(payload) {
        Ok(Decoded::Message(Message::Beacon(beacon))) => Some(beacon),
        Ok(_) | Err(_) => None,
    }
}
