//! What stands between the radio actor and the bytes of an XBee: beacons out, beacons with their strength in, and for each
//! that never went on the air its number. A pure machine: it is told of the port, of bytes and of beacons to send, and says
//! bytes and facts. It reads the module's registers and never writes one: what differs is a trouble that names
//! `tomoswarm xbee setup`, and until it is put right nothing is sent or heard.
//!
//! ```text
//!   Closed ─opened─► Reading ─all as they are to be─► Ready ─module was reset, 3 statuses missing─► Reading
//!                     ▲   │ └──── some differ ─────► Refused ─after 5 s─► Reading
//!                     │   └──── no answer ─► Reading, and a trouble
//!                     └─ after 1 s                          any ─closed─► Closed
//! ```
//!
//! One beacon is *in flight* until the module says whether it went on the air. Another one waits meanwhile, of several the
//! newest. Peers take a gap between two numbers for a beacon that they have missed, so what goes on the air has none: a beacon
//! that comes in the place of another one that is not sent takes its number, and its own is given back. One that was numbered
//! before the radio actor had read that an earlier one came back is given back as well.

mod incoming;
mod troubles;

use std::time::Duration;

use tomoswarm_proto::{BEACON_BYTES_MAX, Beacon, Message, RadioHealth, codec};

use self::incoming::Incoming;
pub use self::troubles::ModemTrouble;
use self::troubles::RecentTroubles;
use super::xbee_frame::{ApiMode, Decoder, Frame, encode};
use super::xbee_registers::{
    Answer, Mismatches, ModuleSettings, ReadState, RegisterReads, Registers,
};
use crate::config::XbeePort;
use crate::node::radio::HeardBeacon;
use crate::time::Time;

/// Without a word of the module for so long, beside the time on the way, a beacon counts as not sent.
const STATUS_WITHIN: Duration = Duration::from_millis(200);
/// After so many of these one after the other the module is asked for its registers again.
const STATUSES_MISSING: u8 = 3;
/// Resets are counted for so long,
const RESETS_COUNTED: Duration = Duration::from_secs(60);
/// and this many in that time are a trouble: one comes with the supply, and one with whoever sets the module up.
const RESETS_MANY: u32 = 3;
/// A module that does not answer is asked again after this time.
const SILENT_AGAIN: Duration = Duration::from_secs(1);
/// A module that is not as it is to be is asked again after this time.
const REFUSED_AGAIN: Duration = Duration::from_secs(5);
/// So many beacons are given back because an earlier number is awaited; then the actor has not read that it is free.
const EARLY_MOST: u8 = 3;
/// To everybody in the network.
const EVERYBODY: u16 = 0xFFFF;
/// No acknowledgement is wanted: of a broadcast there is none.
const UNACKNOWLEDGED: u8 = 1;
/// The channel was busy.
const BUSY: u8 = 2;
/// The packet was longer than the module takes.
const TOO_LONG: u8 = 0x74;

/// What the modem says.
#[derive(Clone, PartialEq, Debug)]
pub enum ModemOut {
    /// To the module.
    Write(Vec<u8>),
    /// To the radio actor: a peer's beacon.
    Heard(HeardBeacon),
    /// To the radio actor: no beacon of this number went on the air.
    Unsent(u32),
}

/// The modem of a vehicle.
#[derive(Clone, Debug)]
pub struct XbeeModem {
    settings: ModuleSettings,
    status_within: Duration,
    decoder: Decoder,
    state: State,
    /// What was read of the module last.
    registers: Registers,
    in_flight: Option<InFlight>,
    waiting: Option<Beacon>,
    given_back: Option<GivenBack>,
    /// Of the last beacon that was sent.
    last_id: u8,
    statuses_missing: u8,
    /// Beacons since the last one of which it was said what became of it.
    unconfirmed: u32,
    resets: Resets,
    opened: u64,
    counts: RadioHealth,
    /// Packets that were heard and held no beacon.
    foreign: u64,
    troubles: RecentTroubles,
}

#[derive(Clone, Debug)]
enum State {
    /// The port is.
    Closed,
    /// Its registers are read.
    Reading {
        reads: RegisterReads,
        /// What was wrong before, and may still be.
        before: Option<ModemTrouble>,
    },
    /// It did not answer.
    Silent { until: Time },
    /// It is not as it is to be.
    Refused { found: Mismatches, until: Time },
    /// Beacons are sent and heard.
    Ready,
}

/// A beacon of which the module has not yet said whether it is sent.
#[derive(Clone, Copy, Debug)]
struct InFlight {
    id: u8,
    number: u32,
    until: Time,
}

/// How often the module was reset of late.
#[derive(Clone, Copy, Debug, Default)]
struct Resets {
    /// The first that is counted.
    since: Time,
    count: u32,
}

impl Resets {
    /// Notes one more; returns how many there were in the time for which they are counted.
    fn note(&mut self, now: Time) -> u32 {
        if now.since(self.since) > RESETS_COUNTED {
            *self = Resets {
                since: now,
                count: 0,
            };
        }
        self.count += 1;
        self.count
    }
}

/// Numbers that were given back and have not come again.
#[derive(Clone, Copy, Debug)]
struct GivenBack {
    /// The lowest of them.
    number: u32,
    /// So many beacons have come with a higher one since.
    early: u8,
}

impl XbeeModem {
    /// Begins with a closed port.
    pub fn new(settings: ModuleSettings) -> XbeeModem {
        XbeeModem {
            settings,
            status_within: STATUS_WITHIN,
            decoder: Decoder::new(settings.mode),
            state: State::Closed,
            registers: Registers::default(),
            in_flight: None,
            waiting: None,
            given_back: None,
            last_id: 0,
            statuses_missing: 0,
            unconfirmed: 0,
            resets: Resets::default(),
            opened: 0,
            counts: RadioHealth::default(),
            foreign: 0,
            troubles: RecentTroubles::default(),
        }
    }

    /// Takes the time that a beacon is on its way over this port, and over the air, for part of the wait for its status.
    #[must_use]
    pub fn on_port(self, port: &XbeePort) -> XbeeModem {
        let latency_ms = port.latency_ms(BEACON_BYTES_MAX);
        XbeeModem {
            status_within: STATUS_WITHIN + Duration::from_secs_f64(latency_ms / 1e3),
            ..self
        }
    }

    /// Notes that the port was opened, with nothing in its queues.
    pub fn opened(&mut self, now: Time, out: &mut Vec<ModemOut>) {
        self.opened += 1;
        self.drop_beacons(out);
        self.read_registers(now, None, out);
    }

    /// Notes that the port is gone.
    pub fn closed(&mut self, out: &mut Vec<ModemOut>) {
        self.drop_beacons(out);
        self.state = State::Closed;
    }

    /// Sends a beacon as soon as the one before it is sent, or says that it is not sent.
    pub fn send(&mut self, now: Time, beacon: Beacon, out: &mut Vec<ModemOut>) {
        if !self.is_ready() {
            return self.give_back(beacon.sequence, out);
        }
        if let Some(waiting) = &mut self.waiting {
            let (own, number) = (beacon.sequence, waiting.sequence);
            *waiting = Beacon {
                sequence: number,
                ..beacon
            };
            return self.give_back(own, out);
        }
        if self.is_early(&beacon) {
            return self.give_back(beacon.sequence, out);
        }
        match self.in_flight {
            None => self.transmit(now, beacon, out),
            Some(_) => self.waiting = Some(beacon),
        }
    }

    /// Takes bytes of the module that have come now, in any pieces.
    pub fn take(&mut self, now: Time, bytes: &[u8], out: &mut Vec<ModemOut>) {
        if matches!(self.state, State::Closed) {
            return;
        }
        let mut all = Vec::new();
        self.decoder
            .take(bytes, |frame| all.extend(Incoming::of(&frame)));
        for incoming in all {
            self.hear(now, incoming, out);
        }
    }

    /// Returns when it is to be woken.
    pub fn deadline(&self) -> Option<Time> {
        match &self.state {
            State::Closed => None,
            State::Reading { reads, .. } => Some(reads.deadline()),
            State::Silent { until } | State::Refused { until, .. } => Some(*until),
            State::Ready => self.in_flight.map(|beacon| beacon.until),
        }
    }

    /// Goes on with what is due by now.
    pub fn due(&mut self, now: Time, out: &mut Vec<ModemOut>) {
        if self.deadline().is_none_or(|at| now < at) {
            return;
        }
        match &mut self.state {
            State::Closed => {}
            State::Reading { reads, .. } => {
                let mut bytes = Vec::new();
                let state = reads.due(now, &mut bytes);
                write(bytes, out);
                if state == ReadState::Silent {
                    let until = now + SILENT_AGAIN;
                    self.state = State::Silent { until };
                }
            }
            State::Silent { .. } | State::Refused { .. } => {
                let before = self.trouble();
                self.read_registers(now, before, out);
            }
            State::Ready => self.status_is_missing(now, out),
        }
    }

    /// Returns whether beacons are sent and heard.
    pub fn is_ready(&self) -> bool {
        matches!(self.state, State::Ready)
    }

    /// Returns what was read of the module last.
    pub fn registers(&self) -> &Registers {
        &self.registers
    }

    /// Returns what the radio has done; bad are frames that cannot be read, and packets that hold no beacon or come without a
    /// strength.
    pub fn health(&self) -> RadioHealth {
        RadioHealth {
            bad: self.decoder.bad().total() + self.foreign,
            reopens: self.opened.saturating_sub(1),
            ..self.counts
        }
    }

    /// Returns what is wrong with the module, and was wrong on the air in the last 10 s; the worst first. Why a port is
    /// closed is not known here.
    pub fn troubles(&self, now: Time) -> Vec<ModemTrouble> {
        self.trouble()
            .into_iter()
            .chain(self.troubles.lately(now))
            .collect()
    }

    /// Returns what is wrong with the module.
    fn trouble(&self) -> Option<ModemTrouble> {
        match &self.state {
            State::Silent { .. } => Some(ModemTrouble::Silent),
            State::Refused { found, .. } => Some(ModemTrouble::Refused(found.clone())),
            State::Reading { before, .. } => before.clone(),
            State::Closed | State::Ready => None,
        }
    }

    fn hear(&mut self, now: Time, incoming: Incoming, out: &mut Vec<ModemOut>) {
        match incoming {
            Incoming::Answer(answer) => self.hear_answer(now, &answer, out),
            Incoming::Status { id, status } => self.hear_status(now, id, status, out),
            Incoming::Reset => {
                let times = self.resets.note(now);
                if times >= RESETS_MANY {
                    self.troubles.note(now, ModemTrouble::Resets { times });
                }
                self.drop_beacons(out);
                self.read_registers(now, None, out);
            }
            Incoming::Beacon { from, heard } if self.is_ready() => {
                self.hear_beacon(now, from, heard, out);
            }
            Incoming::WithoutRssi if self.is_ready() => {
                self.troubles.note(now, ModemTrouble::WithoutRssi);
            }
            Incoming::Foreign => self.foreign += 1,
            Incoming::Beacon { .. } | Incoming::WithoutRssi => {}
        }
    }

    fn hear_answer(&mut self, now: Time, answer: &Answer, out: &mut Vec<ModemOut>) {
        let State::Reading { reads, .. } = &mut self.state else {
            return;
        };
        let (mode, mut bytes) = (reads.mode(), Vec::new());
        let state = reads.hear(now, answer, &mut bytes);
        if reads.mode() != mode {
            self.decoder.restart(reads.mode());
        }
        write(bytes, out);
        if state != ReadState::Read {
            return;
        }
        self.registers = reads.found().clone();
        let found = self.registers.mismatches(&self.settings);
        self.state = match found.is_empty() {
            true => State::Ready,
            false => State::Refused {
                found: Mismatches(found),
                until: now + REFUSED_AGAIN,
            },
        };
        self.statuses_missing = 0;
    }

    fn hear_status(&mut self, now: Time, id: u8, status: u8, out: &mut Vec<ModemOut>) {
        let Some(beacon) = self.in_flight.take_if(|beacon| beacon.id == id) else {
            return;
        };
        (self.statuses_missing, self.unconfirmed) = (0, 0);
        match status {
            0 => self.counts.sent += 1,
            BUSY => self.counts.busy += 1,
            TOO_LONG => self.troubles.note(now, ModemTrouble::RefusesLength),
            _ => {}
        }
        self.send_next(now, (status != 0).then_some(beacon.number), out);
    }

    fn status_is_missing(&mut self, now: Time, out: &mut Vec<ModemOut>) {
        self.statuses_missing += 1;
        self.unconfirmed += 1;
        if self.unconfirmed >= u32::from(STATUSES_MISSING) {
            let beacons = self.unconfirmed;
            self.troubles
                .note(now, ModemTrouble::Unconfirmed { beacons });
        }
        if self.statuses_missing < STATUSES_MISSING {
            let beacon = self.in_flight.take();
            return self.send_next(now, beacon.map(|beacon| beacon.number), out);
        }
        self.drop_beacons(out);
        self.read_registers(now, None, out);
    }

    fn hear_beacon(
        &mut self,
        now: Time,
        from: Option<u16>,
        heard: HeardBeacon,
        out: &mut Vec<ModemOut>,
    ) {
        let (own, sender) = (self.settings.address(), heard.beacon.sender);
        if heard.beacon.sender == self.settings.vehicle {
            let vehicle = self.settings.vehicle;
            return self
                .troubles
                .note(now, ModemTrouble::OwnVehicle { vehicle });
        }
        match from {
            Some(address) if address == own => {
                self.troubles
                    .note(now, ModemTrouble::OwnAddress { address });
            }
            Some(address) if address != u16::from(sender.0) => {
                let trouble = ModemTrouble::OthersAddress { address, sender };
                self.troubles.note(now, trouble);
            }
            Some(_) | None => {}
        }
        out.push(ModemOut::Heard(heard));
    }

    /// Sends what waits behind a beacon; if that one was not sent, `unsent` is its number, which is free.
    fn send_next(&mut self, now: Time, unsent: Option<u32>, out: &mut Vec<ModemOut>) {
        match (self.waiting.take(), unsent) {
            (Some(beacon), Some(number)) => {
                self.give_back(beacon.sequence, out);
                let beacon = Beacon {
                    sequence: number,
                    ..beacon
                };
                self.transmit(now, beacon, out);
            }
            (Some(beacon), None) => self.transmit(now, beacon, out),
            (None, Some(number)) => self.give_back(number, out),
            (None, None) => {}
        }
    }

    fn transmit(&mut self, now: Time, beacon: Beacon, out: &mut Vec<ModemOut>) {
        let number = beacon.sequence;
        let id = self.last_id % u8::MAX + 1;
        let most = self.registers.payload_most();
        match frame_of(beacon, id, most, self.settings.mode) {
            Ok(bytes) => {
                self.last_id = id;
                let until = now + self.status_within;
                self.in_flight = Some(InFlight { id, number, until });
                out.push(ModemOut::Write(bytes));
            }
            Err(length) => {
                self.troubles
                    .note(now, ModemTrouble::TooLong { length, most });
                self.give_back(number, out);
            }
        }
    }

    fn drop_beacons(&mut self, out: &mut Vec<ModemOut>) {
        // The newest one first: so each is the last one that was said when it comes back.
        let waiting = self.waiting.take().map(|beacon| beacon.sequence);
        let in_flight = self.in_flight.take().map(|beacon| beacon.number);
        for number in waiting.into_iter().chain(in_flight) {
            self.give_back(number, out);
        }
    }

    /// Returns whether a beacon was numbered before its actor had read that an earlier number is free.
    fn is_early(&mut self, beacon: &Beacon) -> bool {
        if let Some(back) = &mut self.given_back
            && back.number < beacon.sequence
            && back.early < EARLY_MOST
        {
            back.early += 1;
            return true;
        }
        self.given_back = None;
        false
    }

    fn give_back(&mut self, number: u32, out: &mut Vec<ModemOut>) {
        self.counts.unsent += 1;
        if self.given_back.is_none_or(|back| number < back.number) {
            self.given_back = Some(GivenBack { number, early: 0 });
        }
        out.push(ModemOut::Unsent(number));
    }

    fn read_registers(&mut self, now: Time, before: Option<ModemTrouble>, out: &mut Vec<ModemOut>) {
        let mut bytes = Vec::new();
        let reads = RegisterReads::begin(now, self.settings.mode, &mut bytes);
        self.decoder.restart(self.settings.mode);
        self.state = State::Reading { reads, before };
        write(bytes, out);
    }
}

fn write(bytes: Vec<u8>, out: &mut Vec<ModemOut>) {
    if !bytes.is_empty() {
        out.push(ModemOut::Write(bytes));
    }
}

/// Returns the bytes that send a beacon, or how long it is when that is over the most that a packet carries.
fn frame_of(beacon: Beacon, id: u8, most: usize, mode: ApiMode) -> Result<Vec<u8>, usize> {
    let payload = codec::encode(&Message::Beacon(beacon)).map_err(|_| codec::LIMIT)?;
    if payload.len() > most {
        return Err(payload.len());
    }
    let frame = Frame::Transmit16 {
        id,
        to: EVERYBODY,
        options: UNACKNOWLEDGED,
        payload: &payload,
    };
    let mut bytes = Vec::with_capacity(2 * payload.len());
    encode(&frame, mode, &mut bytes).map_err(|error| error.length)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests;
