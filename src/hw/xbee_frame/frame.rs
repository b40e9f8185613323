//! What a frame says, to its data and back: the frames that a host says to its module, and those that a module says to its
//! host. Knows neither where a frame begins nor how it is escaped.

use std::fmt;

use super::DATA_MOST;

/// The name of a register or command: two letters.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct AtName(pub [u8; 2]);

impl fmt::Display for AtName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.escape_ascii())
    }
}

impl fmt::Debug for AtName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "AT{self}")
    }
}

/// A frame. `id` 0 = no answer is wanted; addresses FFFF = everybody.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Frame<'a> {
    /// 0x00, to the module: send to a serial number.
    Transmit64 {
        /// The answer says it again.
        id: u8,
        /// To whom.
        to: u64,
        /// Bit 0 = it need not be acknowledged.
        options: u8,
        /// What to send.
        payload: &'a [u8],
    },
    /// 0x01, to the module: send to an address.
    Transmit16 {
        /// The answer says it again.
        id: u8,
        /// To whom.
        to: u16,
        /// Bit 0 = it need not be acknowledged.
        options: u8,
        /// What to send.
        payload: &'a [u8],
    },
    /// 0x08, to the module: read a register, set it, or carry out a command, at once.
    Command {
        /// The answer says it again.
        id: u8,
        /// What.
        name: AtName,
        /// The value, big endian; empty = read, or a command.
        value: &'a [u8],
    },
    /// 0x09, to the module: the same, but what is set takes effect later, with 0x08 or AC.
    QueuedCommand {
        /// The answer says it again.
        id: u8,
        /// What.
        name: AtName,
        /// The value, big endian; empty = read, or a command.
        value: &'a [u8],
    },
    /// 0x17, to the module: a command for another module.
    RemoteCommand {
        /// The answer says it again.
        id: u8,
        /// The other's serial number.
        to64: u64,
        /// Its address; FFFE = the serial number counts.
        to16: u16,
        /// Bit 1 = at once.
        options: u8,
        /// What.
        name: AtName,
        /// The value, big endian; empty = read, or a command.
        value: &'a [u8],
    },
    /// 0x80, from the module: heard from a module that has no address of its own, or all of it encrypted.
    Receive64 {
        /// Serial number of who spoke.
        from: u64,
        /// Received signal strength, dBm; 0 = not measured.
        rssi_dbm: i16,
        /// Bit 1 = it was for everybody.
        options: u8,
        /// What was heard.
        payload: &'a [u8],
    },
    /// 0x81, from the module: heard.
    Receive16 {
        /// Address of who spoke.
        from: u16,
        /// Received signal strength, dBm; 0 = not measured.
        rssi_dbm: i16,
        /// Bit 1 = it was for everybody.
        options: u8,
        /// What was heard.
        payload: &'a [u8],
    },
    /// 0x90, from the module: heard, without the strength.
    ReceiveWithoutRssi {
        /// Serial number of who spoke.
        from64: u64,
        /// Its address.
        from16: u16,
        /// Bit 1 = it was for everybody.
        options: u8,
        /// What was heard.
        payload: &'a [u8],
    },
    /// 0x88, from the module: the answer to a command.
    CommandAnswer {
        /// That of the command.
        id: u8,
        /// What.
        name: AtName,
        /// 0 = done, 1 = error, 2 = unknown command, 3 = impossible value, 4 = not sent.
        status: u8,
        /// The value that was read, big endian; empty when something was set, or went wrong.
        value: &'a [u8],
    },
    /// 0x97, from the module: another module's answer to a command.
    RemoteAnswer {
        /// That of the command.
        id: u8,
        /// The other's serial number.
        from64: u64,
        /// Its address.
        from16: u16,
        /// What.
        name: AtName,
        /// As in [`Frame::CommandAnswer`].
        status: u8,
        /// As in [`Frame::CommandAnswer`].
        value: &'a [u8],
    },
    /// 0x89, from the module: what became of something that was to be sent.
    TransmitStatus {
        /// That of the order to send.
        id: u8,
        /// 0 = on the air; 2 = the channel was busy; 0x74 = too long; others = not sent, too.
        status: u8,
    },
    /// 0x8A, from the module: what has happened to it; 0 = switched on, 1 = reset by its watchdog or an order.
    ModemStatus(u8),
    /// A frame that is known and of no use here: 0x10 (send, in other firmware), 0x82 and 0x83 (samples of pins), 0x8B (the
    /// answer to 0x10).
    Other {
        /// Its type.
        kind: u8,
        /// What follows the type.
        data: &'a [u8],
    },
}

/// Why data are no frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FrameError {
    /// There is nothing.
    #[error("a frame without data")]
    Empty,
    /// It is too short for its type, or too long.
    #[error("a frame of type {kind:#04x} has not {length} bytes")]
    Length {
        /// Its type.
        kind: u8,
        /// Its length, bytes.
        length: usize,
    },
    /// Its type is not known.
    #[error("a frame of type {kind:#04x}, which is not known")]
    UnknownType {
        /// Its type.
        kind: u8,
    },
}

/// Why a frame has no bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("a frame of {length} bytes is longer than {DATA_MOST}")]
pub struct EncodeError {
    /// Its length, bytes.
    pub length: usize,
}

impl<'a> Frame<'a> {
    /// Reads the data of a frame.
    ///
    /// # Errors
    /// It has a wrong length for its type, or an unknown type.
    pub fn parse(data: &'a [u8]) -> Result<Frame<'a>, FrameError> {
        let (&kind, fields) = data.split_first().ok_or(FrameError::Empty)?;
        if !KNOWN.contains(&kind) {
            return Err(FrameError::UnknownType { kind });
        }
        let length = data.len();
        Frame::of_fields(kind, fields).ok_or(FrameError::Length { kind, length })
    }

    fn of_fields(kind: u8, data: &'a [u8]) -> Option<Frame<'a>> {
        let mut fields = Fields(data);
        let frame = match kind {
            0x00 => Frame::Transmit64 {
                id: fields.byte()?,
                to: fields.serial()?,
                options: fields.byte()?,
                payload: fields.0,
            },
            0x01 => Frame::Transmit16 {
                id: fields.byte()?,
                to: fields.address()?,
                options: fields.byte()?,
                payload: fields.0,
            },
            0x08 => Frame::Command {
                id: fields.byte()?,
                name: AtName(fields.take()?),
                value: fields.0,
            },
            0x09 => Frame::QueuedCommand {
                id: fields.byte()?,
                name: AtName(fields.take()?),
                value: fields.0,
            },
            0x17 => Frame::RemoteCommand {
                id: fields.byte()?,
                to64: fields.serial()?,
                to16: fields.address()?,
                options: fields.byte()?,
                name: AtName(fields.take()?),
                value: fields.0,
            },
            0x80 => Frame::Receive64 {
                from: fields.serial()?,
                rssi_dbm: -i16::from(fields.byte()?),
                options: fields.byte()?,
                payload: fields.0,
            },
            0x81 => Frame::Receive16 {
                from: fields.address()?,
                rssi_dbm: -i16::from(fields.byte()?),
                options: fields.byte()?,
                payload: fields.0,
            },
            0x90 => Frame::ReceiveWithoutRssi {
                from64: fields.serial()?,
                from16: fields.address()?,
                options: fields.byte()?,
                payload: fields.0,
            },
            0x88 => Frame::CommandAnswer {
                id: fields.byte()?,
                name: AtName(fields.take()?),
                status: fields.byte()?,
                value: fields.0,
            },
            0x97 => Frame::RemoteAnswer {
                id: fields.byte()?,
                from64: fields.serial()?,
                from16: fields.address()?,
                name: AtName(fields.take()?),
                status: fields.byte()?,
                value: fields.0,
            },
            0x89 => {
                let [id, status] = fields.all()?;
                Frame::TransmitStatus { id, status }
            }
            0x8A => {
                let [status] = fields.all()?;
                Frame::ModemStatus(status)
            }
            kind => Frame::Other { kind, data },
        };
        Some(frame)
    }

    /// Returns its data: the type and what follows.
    pub(super) fn data(&self) -> Result<Vec<u8>, EncodeError> {
        let mut data = Vec::with_capacity(160);
        let rest = match *self {
            Frame::Transmit64 {
                id,
                to,
                options,
                payload,
            } => {
                data.extend([0x00, id]);
                data.extend(to.to_be_bytes());
                data.push(options);
                payload
            }
            Frame::Transmit16 {
                id,
                to,
                options,
                payload,
            } => {
                data.extend([0x01, id]);
                data.extend(to.to_be_bytes());
                data.push(options);
                payload
            }
            Frame::Command { id, name, value } => {
                data.extend([0x08, id, name.0[0], name.0[1]]);
                value
            }
            Frame::QueuedCommand { id, name, value } => {
                data.extend([0x09, id, name.0[0], name.0[1]]);
                value
            }
            Frame::RemoteCommand {
                id,
                to64,
                to16,
                options,
                name,
                value,
            } => {
                data.extend([0x17, id]);
                data.extend(to64.to_be_bytes());
                data.extend(to16.to_be_bytes());
                data.extend([options, name.0[0], name.0[1]]);
                value
            }
            Frame::Receive64 {
                from,
                rssi_dbm,
                options,
                payload,
            } => {
                data.push(0x80);
                data.extend(from.to_be_bytes());
                data.extend([rssi_byte(rssi_dbm), options]);
                payload
            }
            Frame::Receive16 {
                from,
                rssi_dbm,
                options,
                payload,
            } => {
                data.push(0x81);
                data.extend(from.to_be_bytes());
                data.extend([rssi_byte(rssi_dbm), options]);
                payload
            }
            Frame::ReceiveWithoutRssi {
                from64,
                from16,
                options,
                payload,
            } => {
                data.push(0x90);
                data.extend(from64.to_be_bytes());
                data.extend(from16.to_be_bytes());
                data.push(options);
                payload
            }
            Frame::CommandAnswer {
                id,
                name,
                status,
                value,
            } => {
                data.extend([0x88, id, name.0[0], name.0[1], status]);
                value
            }
            Frame::RemoteAnswer {
                id,
                from64,
                from16,
                name,
                status,
                value,
            } => {
                data.extend([0x97, id]);
                data.extend(from64.to_be_bytes());
                data.extend(from16.to_be_bytes());
                data.extend([name.0[0], name.0[1], status]);
                value
            }
            Frame::TransmitStatus { id, status } => {
                data.extend([0x89, id, status]);
                &[]
            }
            Frame::ModemStatus(status) => {
                data.extend([0x8A, status]);
                &[]
            }
            Frame::Other { kind, data: rest } => {
                data.push(kind);
                rest
            }
        };
        data.extend_from_slice(rest);
        match data.len() {
            length if length > DATA_MOST => Err(EncodeError { length }),
            _ => Ok(data),
        }
    }
}

/// The types that are known.
const KNOWN: [u8; 16] = [
    0x00, 0x01, 0x08, 0x09, 0x10, 0x17, 0x80, 0x81, 0x82, 0x83, 0x88, 0x89, 0x8A, 0x8B, 0x90, 0x97,
];

/// A strength as a module says it: without its sign, -255 to 0 dBm.
fn rssi_byte(rssi_dbm: i16) -> u8 {
    u8::try_from((-i32::from(rssi_dbm)).clamp(0, 255)).unwrap_or(u8::MAX)
}

/// What is left of a frame's data.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const COUNT: usize>(&mut self) -> Option<[u8; COUNT]> {
        let (field, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*field)
    }

    /// Takes all that is left, if it is so many bytes.
    fn all<const COUNT: usize>(&self) -> Option<[u8; COUNT]> {
        self.0.try_into().ok()
    }

    fn byte(&mut self) -> Option<u8> {
        self.take().map(|[byte]| byte)
    }

    fn address(&mut self) -> Option<u16> {
        self.take().map(u16::from_be_bytes)
    }

    fn serial(&mut self) -> Option<u64> {
        self.take().map(u64::from_be_bytes)
    }
}
