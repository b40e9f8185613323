//! What a host tells a simulated module: frames, words in its command mode, or in transparent mode what is to be sent.

use super::command_mode::{HostWords, Order};
use super::registers::{DH, DL};
use super::serial::Come;
use super::{Content, Packet, REMOTE_WITHIN, Recipient, RemoteCall, XbeeModule};
use crate::hw::xbee_frame::{AtName, Frame};
use crate::time::Time;

/// A module was reset by an order.
const RESET: u8 = 1;
/// An address that says that the serial number counts.
const BY_SERIAL: u16 = 0xFFFE;
/// What does something instead of being set.
const APPLY: AtName = AtName(*b"AC");
const LEAVE: AtName = AtName(*b"CN");
const FORGET: AtName = AtName(*b"RE");
const RESTART: AtName = AtName(*b"FR");
const SAVE: AtName = AtName(*b"WR");

/// What a host tells its module in a frame.
enum Told {
    /// A command, and whether what it sets takes effect at once.
    Command {
        id: u8,
        name: AtName,
        value: Vec<u8>,
        is_at_once: bool,
    },
    /// To send something.
    Send {
        id: u8,
        to: Recipient,
        payload: Vec<u8>,
    },
    /// A command for another module.
    Remote {
        id: u8,
        to64: u64,
        to16: u16,
        name: AtName,
        value: Vec<u8>,
    },
}

impl XbeeModule {
    /// Takes bytes of the host.
    pub(super) fn take(&mut self, now: Time, come: Come) {
        if self.registers.mode().is_none() {
            return self.take_words(now, come);
        }
        // A frame may change the mode of what follows, which is then read in the old one: nobody says both without a pause.
        let mut all = Vec::new();
        self.decoder
            .take(&come.bytes, |frame| all.extend(told(&frame)));
        for told in all {
            self.carry_out(now, told);
        }
    }

    /// The command mode is entered or left.
    pub(super) fn turn_command_mode(&mut self, now: Time) {
        match self.command_mode.go_on(now) {
            true => self.say_words(now, b"OK"),
            false => self.take_effect(),
        }
    }

    /// Answers a command of another module.
    pub(super) fn answer_remote(
        &mut self,
        now: Time,
        packet: &Packet,
        id: u8,
        name: AtName,
        value: &[u8],
    ) {
        let (status, value) = self.execute(name, value);
        self.take_effect();
        let to = Recipient::Serial(packet.from64);
        let answer = Content::Answer {
            id,
            name,
            status,
            value,
        };
        self.send(now, to, answer, 0);
    }

    fn carry_out(&mut self, now: Time, told: Told) {
        match told {
            Told::Send { id, to, payload } => self.send(now, to, Content::Payload(payload), id),
            Told::Remote {
                id,
                to64,
                to16,
                name,
                value,
            } => {
                let to = match to16 {
                    BY_SERIAL => Recipient::Serial(to64),
                    to16 => Recipient::Address(to16),
                };
                let until = now + REMOTE_WITHIN;
                self.remote.push(RemoteCall {
                    id,
                    to64,
                    to16,
                    name,
                    until,
                });
                self.send(now, to, Content::Command { id, name, value }, 0);
            }
            Told::Command {
                id,
                name,
                value,
                is_at_once,
            } => {
                let (status, value) = self.execute(name, &value);
                if id != 0 {
                    let value = value.as_slice();
                    self.say(
                        now,
                        &Frame::CommandAnswer {
                            id,
                            name,
                            status,
                            value,
                        },
                    );
                }
                self.finish(now, name, is_at_once);
            }
        }
    }

    /// Reads or sets a register, or carries out a command; returns the status and what was read. What ends what is said now
    /// comes later, in [`XbeeModule::finish`].
    fn execute(&mut self, name: AtName, value: &[u8]) -> (u8, Vec<u8>) {
        match name {
            APPLY | LEAVE | RESTART => return (0, Vec::new()),
            SAVE => {
                self.registers.save();
                return (0, Vec::new());
            }
            FORGET => {
                self.registers.forget_all();
                return (0, Vec::new());
            }
            _ => {}
        }
        let result = match value {
            [] => self.registers.read(name),
            value => self.registers.write(name, value).map(|()| Vec::new()),
        };
        result.map_or_else(|error| (error.status(), Vec::new()), |value| (0, value))
    }

    /// Does what follows the answer to a command.
    fn finish(&mut self, now: Time, name: AtName, is_at_once: bool) {
        match name {
            RESTART => self.boot(now, RESET),
            _ if is_at_once || name == APPLY => self.take_effect(),
            _ => {}
        }
    }

    fn take_words(&mut self, now: Time, come: Come) {
        let (guard, _) = self.pauses();
        match self.command_mode.take(come.begins, now, guard, come.bytes) {
            HostWords::Nothing => {}
            HostWords::Payload(payload) => {
                let serial = (u64::from(self.registers.number(DH)) << 32)
                    | u64::from(self.registers.number(DL));
                let to = match u16::try_from(serial) {
                    Ok(address) => Recipient::Address(address),
                    Err(_) => Recipient::Serial(serial),
                };
                self.send(now, to, Content::Payload(payload), 0);
            }
            HostWords::Lines(orders) => orders.into_iter().for_each(|order| self.obey(now, order)),
        }
    }

    fn obey(&mut self, now: Time, order: Order) {
        let Order::Command(name, value) = order else {
            return self.say_words(now, b"ERROR");
        };
        let (status, read) = self.execute(name, &value);
        match (status, read.as_slice()) {
            (0, []) => self.say_words(now, b"OK"),
            (0, text) if name == AtName(*b"NI") => self.say_words(now, text),
            (0, number) => {
                let digits: String = number.iter().map(|byte| format!("{byte:02X}")).collect();
                let digits = digits.trim_start_matches('0');
                let shown = if digits.is_empty() { "0" } else { digits };
                self.say_words(now, shown.as_bytes());
            }
            _ => self.say_words(now, b"ERROR"),
        }
        if name == LEAVE {
            self.command_mode.leave();
        }
        self.finish(now, name, name == LEAVE);
    }

    fn say_words(&mut self, now: Time, words: &[u8]) {
        let line = [words, b"\r"].concat();
        self.to_host.say(now, self.registers.baud(), line);
    }
}

/// Returns what a frame tells a module; `None` = nothing.
fn told(frame: &Frame<'_>) -> Option<Told> {
    match *frame {
        Frame::Command { id, name, value } | Frame::QueuedCommand { id, name, value } => {
            Some(Told::Command {
                id,
                name,
                value: value.to_vec(),
                is_at_once: matches!(frame, Frame::Command { .. }),
            })
        }
        Frame::Transmit16 {
            id, to, payload, ..
        } => Some(Told::Send {
            id,
            to: Recipient::Address(to),
            payload: payload.to_vec(),
        }),
        Frame::Transmit64 {
            id, to, payload, ..
        } => Some(Told::Send {
            id,
            to: Recipient::Serial(to),
            payload: payload.to_vec(),
        }),
        Frame::RemoteCommand {
            id,
            to64,
            to16,
            name,
            value,
            ..
        } => Some(Told::Remote {
            id,
            to64,
            to16,
            name,
            value: value.to_vec(),
        }),
        Frame::Receive64 { .. }
        | Frame::Receive16 { .. }
        | Frame::ReceiveWithoutRssi { .. }
        | Frame::CommandAnswer { .. }
        | Frame::RemoteAnswer { .. }
        | Frame::TransmitStatus { .. }
        | Frame::ModemStatus(_)
        | Frame::Other { .. } => None,
    }
}
