//! A simulated XBee with 802.15.4 firmware, as its host sees it on the serial line and the others on the air: registers, API
//! modes 0, 1 and 2, `+++`, the time that every byte takes, carrier sense, statuses, resets and doubled packets. A pure
//! machine. What is on the air and how strongly it arrives is somebody else's matter: it says packets, and is told which have
//! arrived and whether its channel is busy.
//!
//! ```text
//!   host ─bytes─► serial line ─► frames ──► registers ──► answers ─► serial line ─bytes─► host
//!                    └ +++, AT… ─┘  └─► carrier sense ─► on the air, status ┘    ▲
//!                                          packet that has arrived ──────────────┘
//!   Off ─switched on─► Boots ─100 ms─► On ─ATFR─► Boots
//! ```
//!
//! Not simulated: acknowledgements (a packet for one module alone counts as sent when it was on the air), retries, encryption,
//! sleep, pins.

mod carrier;
mod command_mode;
mod orders;
mod packet;
mod registers;
mod serial;

use std::collections::VecDeque;
use std::time::Duration;

pub use self::packet::{Content, Packet, Recipient};

use self::carrier::{Draw, Progress, Sending};
use self::command_mode::CommandMode;
use self::registers::{CT, GT, ModuleRegisters, RN};
use self::serial::SerialLine;
use super::noise::{Noise, NoisePurpose};
use crate::hw::xbee_frame::{ApiMode, AtName, Decoder, Frame, encode};
use crate::hw::xbee_registers::{CH, ID, ModuleKind};
use crate::time::Time;

/// A module that was switched on or reset says so after this time.
const BOOTS: Duration = Duration::from_millis(100);
/// So many packets wait to be sent; what comes then is lost without a word.
const WAITING_MOST: usize = 2;
/// Another module's answer comes within this time.
const REMOTE_WITHIN: Duration = Duration::from_millis(300);
/// Its channel was busy.
const BUSY: u8 = 2;
/// The packet is longer than it takes.
const TOO_LONG: u8 = 0x74;
/// It has no answer of another module.
const NOT_SENT: u8 = 4;
/// Of an option byte: it was for everybody.
const FOR_ALL: u8 = 2;
/// What was said goes to the host, or what came from it.
const TO_HOST: u64 = 0;
const FROM_HOST: u64 = 1;

/// What goes wrong by chance, as shares of 0 to 1.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct ModuleFaults {
    /// Packets that find the channel busy whenever it listens.
    pub busy: f64,
    /// Packets that it says twice to its host.
    pub doubled: f64,
}

/// What a module says.
#[derive(Clone, PartialEq, Debug)]
pub enum ModuleOut {
    /// To its host: bytes, as they are read at the port's baud rate.
    Host(Vec<u8>),
    /// On the air, from now until then.
    OnAir(Packet, Time),
}

/// A module.
#[derive(Clone, Debug)]
pub struct XbeeModule {
    serial: u64,
    noise: Noise,
    faults: ModuleFaults,
    registers: ModuleRegisters,
    power: Power,
    /// The host's end of the line; `None` = nobody has opened the port.
    host_baud: Option<u32>,
    from_host: SerialLine,
    to_host: SerialLine,
    decoder: Decoder,
    command_mode: CommandMode,
    waiting: VecDeque<(Packet, u8)>,
    sending: Option<Sending>,
    remote: Vec<RemoteCall>,
    /// Packets sent and heard: by what chance is drawn.
    packets: u64,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Power {
    Off,
    /// It is on then, and says this status.
    Boots {
        until: Time,
        status: u8,
    },
    On,
}

/// A command for another module that waits for its answer.
#[derive(Clone, Copy, Debug)]
struct RemoteCall {
    id: u8,
    to64: u64,
    to16: u16,
    name: AtName,
    until: Time,
}

impl XbeeModule {
    /// Makes one as it comes from the factory, switched off; `serial` is its own.
    pub fn new(kind: ModuleKind, serial: u64, noise: Noise) -> XbeeModule {
        XbeeModule {
            serial,
            noise,
            faults: ModuleFaults::default(),
            registers: ModuleRegisters::new(kind, serial),
            power: Power::Off,
            host_baud: None,
            from_host: SerialLine::default(),
            to_host: SerialLine::default(),
            decoder: Decoder::new(ApiMode::Escaped),
            command_mode: CommandMode::default(),
            waiting: VecDeque::new(),
            sending: None,
            remote: Vec::new(),
            packets: 0,
        }
    }

    /// Sets what goes wrong by chance from now on.
    pub fn set_faults(&mut self, faults: ModuleFaults) {
        self.faults = faults;
    }

    /// Sets a register for good, as somebody did who had the module before; returns whether it takes such a value.
    pub fn set_register(&mut self, name: AtName, value: &[u8]) -> bool {
        let is_set = self.registers.write(name, value).is_ok();
        self.registers.save();
        self.take_effect();
        is_set
    }

    /// Returns a register as the module says it; `None` = it does not know it.
    pub fn register(&self, name: AtName) -> Option<Vec<u8>> {
        self.registers.read(name).ok()
    }

    /// Switches it on, or off and on.
    pub fn switch_on(&mut self, now: Time) {
        self.from_host.clear(now);
        self.to_host.clear(now);
        self.boot(now, 0);
    }

    /// Switches it off.
    pub fn switch_off(&mut self, now: Time) {
        self.switch_on(now);
        self.power = Power::Off;
    }

    /// The host opens the port at a baud rate, or sets another one; what is in its queue is lost.
    pub fn open(&mut self, baud: u32) {
        self.host_baud = Some(baud);
    }

    /// The host closes the port.
    pub fn close(&mut self) {
        self.host_baud = None;
    }

    /// The host says bytes.
    pub fn write(&mut self, now: Time, bytes: &[u8]) {
        if let Some(baud) = self.host_baud
            && !bytes.is_empty()
        {
            self.from_host.say(now, baud, bytes.to_vec());
        }
    }

    /// Returns its radio channel.
    pub fn channel(&self) -> u8 {
        self.registers.number(CH) as u8
    }

    /// A packet has arrived to its end, so strongly; returns whether its host is told of a payload by it.
    pub fn receive(&mut self, now: Time, packet: &Packet, rssi_dbm: i16) -> bool {
        let is_speaking = self.sending.as_ref().is_some_and(Sending::is_on_air);
        let is_on_its_air = packet.channel == self.channel() && packet.network == self.network();
        let is_meant = packet.to.includes(self.registers.address(), self.serial);
        let is_understood = packet.has_header == self.registers.has_header();
        let is_heard = is_on_its_air && is_meant && is_understood;
        if self.power != Power::On || is_speaking || !is_heard {
            return false;
        }
        self.packets += 1;
        self.registers.heard(rssi_dbm.unsigned_abs().min(255) as u8);
        match &packet.content {
            Content::Payload(payload) => {
                let times = if self.happens(NoisePurpose::PacketDuplicate, self.faults.doubled) {
                    2
                } else {
                    1
                };
                for _ in 0..times {
                    self.say_heard(now, packet, payload, rssi_dbm);
                }
            }
            Content::Command { id, name, value } => {
                self.answer_remote(now, packet, *id, *name, value)
            }
            Content::Answer {
                id,
                name,
                status,
                value,
            } => {
                self.remote.retain(|call| call.id != *id);
                let (from64, from16) = (packet.from64, packet.from16);
                let (id, name, status) = (*id, *name, *status);
                self.say(
                    now,
                    &Frame::RemoteAnswer {
                        id,
                        from64,
                        from16,
                        name,
                        status,
                        value,
                    },
                );
            }
        }
        matches!(packet.content, Content::Payload(_))
    }

    /// Returns when it is to be woken.
    pub fn deadline(&self) -> Option<Time> {
        let boots = match self.power {
            Power::Boots { until, .. } => Some(until),
            Power::Off | Power::On => None,
        };
        let sending = self.sending.as_ref().map(Sending::deadline);
        let remote = self.remote.iter().map(|call| call.until).min();
        let (guard, timeout) = self.pauses();
        let command_mode = self.command_mode.deadline(guard, timeout);
        [
            boots,
            sending,
            remote,
            command_mode,
            self.from_host.deadline(),
            self.to_host.deadline(),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Goes on with what is due by now; `is_busy` = somebody else is on its channel.
    pub fn due(&mut self, now: Time, is_busy: bool, out: &mut Vec<ModuleOut>) {
        while self.deadline().is_some_and(|at| at <= now) {
            self.go_on(now, is_busy, out);
        }
    }

    fn go_on(&mut self, now: Time, is_busy: bool, out: &mut Vec<ModuleOut>) {
        if let Power::Boots { until, status } = self.power
            && until <= now
        {
            self.power = Power::On;
            self.registers.reset();
            self.take_effect();
            self.say(now, &Frame::ModemStatus(status));
        }
        let baud = self.registers.baud();
        if let Some(come) = self
            .from_host
            .come(now, baud, self.noise, [self.serial, FROM_HOST])
            && self.power == Power::On
        {
            self.take(now, come);
        }
        // What nobody reads is lost.
        let host_baud = self.host_baud.unwrap_or_default();
        if let Some(come) = self
            .to_host
            .come(now, host_baud, self.noise, [self.serial, TO_HOST])
            && self.host_baud.is_some()
            && !come.bytes.is_empty()
        {
            out.push(ModuleOut::Host(come.bytes));
        }
        let (guard, timeout) = self.pauses();
        if self
            .command_mode
            .deadline(guard, timeout)
            .is_some_and(|at| at <= now)
        {
            self.turn_command_mode(now);
        }
        self.go_on_sending(now, is_busy, out);
        self.give_up_remote(now);
    }

    fn go_on_sending(&mut self, now: Time, is_busy: bool, out: &mut Vec<ModuleOut>) {
        let exponent = self.registers.number(RN);
        let draw = self.draw();
        let Some(sending) = self
            .sending
            .as_mut()
            .filter(|sending| sending.deadline() <= now)
        else {
            return;
        };
        let status = match sending.go_on(now, is_busy, exponent, draw) {
            Progress::Waits => return,
            Progress::Begins(until) => {
                return out.push(ModuleOut::OnAir(sending.packet.clone(), until));
            }
            Progress::Sent => 0,
            Progress::GivenUp => BUSY,
        };
        let id = sending.id;
        self.sending = None;
        self.say_status(now, id, status);
        if let Some((packet, id)) = self.waiting.pop_front() {
            self.begin_sending(now, packet, id);
        }
    }

    /// Sends a packet when those before it are sent.
    fn send(&mut self, now: Time, to: Recipient, content: Content, id: u8) {
        let packet = Packet {
            from16: self.registers.address(),
            from64: self.serial,
            to,
            network: self.network(),
            channel: self.channel(),
            power_dbm: self.registers.power_dbm(),
            has_header: self.registers.has_header(),
            content,
        };
        if packet.content.length() > self.registers.payload_most() {
            return self.say_status(now, id, TOO_LONG);
        }
        match self.sending {
            None => self.begin_sending(now, packet, id),
            Some(_) if self.waiting.len() < WAITING_MOST => self.waiting.push_back((packet, id)),
            Some(_) => {}
        }
    }

    fn begin_sending(&mut self, now: Time, packet: Packet, id: u8) {
        self.packets += 1;
        let is_blocked = self.happens(NoisePurpose::BusyChannel, self.faults.busy);
        let exponent = self.registers.number(RN);
        self.sending = Some(Sending::begin(
            now,
            packet,
            id,
            exponent,
            is_blocked,
            self.draw(),
        ));
    }

    fn say_status(&mut self, now: Time, id: u8, status: u8) {
        if id != 0 {
            self.say(now, &Frame::TransmitStatus { id, status });
        }
    }

    fn say_heard(&mut self, now: Time, packet: &Packet, payload: &[u8], rssi_dbm: i16) {
        let options = if packet.to.is_everybody() { FOR_ALL } else { 0 };
        let (from64, from16) = (packet.from64, packet.from16);
        let frame = match from16 {
            _ if !self.registers.says_rssi() => Frame::ReceiveWithoutRssi {
                from64,
                from16,
                options,
                payload,
            },
            0xFFFE.. => Frame::Receive64 {
                from: from64,
                rssi_dbm,
                options,
                payload,
            },
            _ => Frame::Receive16 {
                from: from16,
                rssi_dbm,
                options,
                payload,
            },
        };
        let bytes = match self.registers.mode() {
            Some(mode) => bytes_of(&frame, mode),
            None => payload.to_vec(),
        };
        if self.to_host.has_room(bytes.len()) {
            self.to_host.say(now, self.registers.baud(), bytes);
        }
    }

    /// Says a frame to the host, in a mode that has frames.
    fn say(&mut self, now: Time, frame: &Frame<'_>) {
        if let Some(mode) = self.registers.mode() {
            let bytes = bytes_of(frame, mode);
            self.to_host.say(now, self.registers.baud(), bytes);
        }
    }

    fn give_up_remote(&mut self, now: Time) {
        let over: Vec<RemoteCall> = self
            .remote
            .extract_if(.., |call| call.until <= now)
            .collect();
        for RemoteCall {
            id,
            to64,
            to16,
            name,
            ..
        } in over
        {
            let (from64, from16, status) = (to64, to16, NOT_SENT);
            self.say(
                now,
                &Frame::RemoteAnswer {
                    id,
                    from64,
                    from16,
                    name,
                    status,
                    value: &[],
                },
            );
        }
    }

    /// What was set takes effect.
    fn take_effect(&mut self) {
        let before = self.registers.mode();
        self.registers.apply();
        if let Some(mode) = self.registers.mode().filter(|mode| before != Some(*mode)) {
            self.decoder.restart(mode);
        }
    }

    /// Begins anew, when what it says now is said.
    fn boot(&mut self, now: Time, status: u8) {
        self.power = Power::Boots {
            until: self.to_host.is_free_at().max(now) + BOOTS,
            status,
        };
        self.decoder.restart(self.decoder.mode());
        self.command_mode = CommandMode::default();
        self.waiting.clear();
        self.sending = None;
        self.remote.clear();
    }

    fn network(&self) -> u16 {
        self.registers.number(ID) as u16
    }

    /// The silence around `+++`, and the one after which its command mode is left.
    fn pauses(&self) -> (Duration, Duration) {
        let guard = Duration::from_millis(self.registers.number(GT).into());
        let timeout = Duration::from_millis(100) * self.registers.number(CT);
        (guard, timeout)
    }

    fn happens(&self, purpose: NoisePurpose, share: f64) -> bool {
        self.noise.uniform(purpose, &[self.serial, self.packets]) < share
    }

    fn draw(&self) -> Draw {
        Draw {
            noise: self.noise,
            module: self.serial,
            number: self.packets,
        }
    }
}

fn bytes_of(frame: &Frame<'_>, mode: ApiMode) -> Vec<u8> {
    let mut bytes = Vec::new();
    // What fits into a packet fits into a frame.
    let _ = encode(frame, mode, &mut bytes);
    bytes
}
