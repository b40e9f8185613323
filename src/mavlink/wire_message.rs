//! All messages that are read and written: those of the dialect, and the one of ArduPilot's own that is needed, the state
//! of its estimator (EKF_STATUS_REPORT, <https://mavlink.io/en/messages/ardupilotmega.html#EKF_STATUS_REPORT>). Its flags
//! are those of ESTIMATOR_STATUS.

use mavlink::error::ParserError;
use mavlink::{MavlinkVersion, Message};

use super::dialect::{EstimatorStatusFlags, MavMessage};

/// The number of EKF_STATUS_REPORT.
pub const EKF_STATUS: u32 = 193;
const EKF_STATUS_NAME: &str = "EKF_STATUS_REPORT";
/// What its checksum begins with.
const EKF_STATUS_EXTRA: u8 = 71;
/// Five variances of four bytes stand before its flags.
const FLAGS_AT: usize = 20;

/// A message of the dialect, or the state of an estimator.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum WireMessage {
    /// One of the dialect.
    Dialect(Box<MavMessage>),
    /// What ArduPilot's estimator knows.
    EkfStatus(EstimatorStatusFlags),
}

impl Message for WireMessage {
    fn message_id(&self) -> u32 {
        match self {
            WireMessage::Dialect(message) => message.message_id(),
            WireMessage::EkfStatus(_) => EKF_STATUS,
        }
    }

    fn message_name(&self) -> &'static str {
        match self {
            WireMessage::Dialect(message) => message.message_name(),
            WireMessage::EkfStatus(_) => EKF_STATUS_NAME,
        }
    }

    fn target_system_id(&self) -> Option<u8> {
        match self {
            WireMessage::Dialect(message) => message.target_system_id(),
            WireMessage::EkfStatus(_) => None,
        }
    }

    fn target_component_id(&self) -> Option<u8> {
        match self {
            WireMessage::Dialect(message) => message.target_component_id(),
            WireMessage::EkfStatus(_) => None,
        }
    }

    fn target_system_id_mut(&mut self) -> Option<&mut u8> {
        match self {
            WireMessage::Dialect(message) => message.target_system_id_mut(),
            WireMessage::EkfStatus(_) => None,
        }
    }

    fn target_component_id_mut(&mut self) -> Option<&mut u8> {
        match self {
            WireMessage::Dialect(message) => message.target_component_id_mut(),
            WireMessage::EkfStatus(_) => None,
        }
    }

    fn ser(&self, version: MavlinkVersion, bytes: &mut [u8]) -> usize {
        match self {
            WireMessage::Dialect(message) => message.ser(version, bytes),
            WireMessage::EkfStatus(flags) => {
                bytes[..FLAGS_AT].fill(0);
                bytes[FLAGS_AT..FLAGS_AT + 2].copy_from_slice(&flags.bits().to_le_bytes());
                FLAGS_AT + 2
            }
        }
    }

    fn parse(version: MavlinkVersion, id: u32, payload: &[u8]) -> Result<WireMessage, ParserError> {
        if id != EKF_STATUS {
            let message = MavMessage::parse(version, id, payload)?;
            return Ok(WireMessage::Dialect(Box::new(message)));
        }
        // MAVLink 2 leaves out zeros at the end.
        let byte = |at: usize| payload.get(at).copied().unwrap_or(0);
        let bits = u16::from_le_bytes([byte(FLAGS_AT), byte(FLAGS_AT + 1)]);
        let flags = EstimatorStatusFlags::from_bits_truncate(bits);
        Ok(WireMessage::EkfStatus(flags))
    }

    fn message_id_from_name(name: &str) -> Option<u32> {
        match name {
            EKF_STATUS_NAME => Some(EKF_STATUS),
            _ => MavMessage::message_id_from_name(name),
        }
    }

    fn default_message_from_id(id: u32) -> Option<WireMessage> {
        match id {
            EKF_STATUS => Some(WireMessage::EkfStatus(EstimatorStatusFlags::empty())),
            _ => {
                let message = MavMessage::default_message_from_id(id)?;
                Some(WireMessage::Dialect(Box::new(message)))
            }
        }
    }

    fn extra_crc(id: u32) -> u8 {
        match id {
            EKF_STATUS => EKF_STATUS_EXTRA,
            _ => MavMessage::extra_crc(id),
        }
    }
}
