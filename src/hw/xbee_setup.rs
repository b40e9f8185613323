//! Sets a module up, once for its life: finds it at whatever baud rate and in whatever mode it is, sets its registers, saves
//! them, and reads back what it says then. A pure machine: it is told of bytes and the time, and says bytes, at which baud rate
//! the port is to be, and how it has ended.
//!
//! ```text
//!   search ─found─► AP ─► BD, the port follows ─► reads: is it one of ours? ─► MY, ID, CH … ─► PL ─► WR ─► reads: as wanted? ─► set up
//!     │               │                               │                          │         │       │          │
//!     └ nowhere ──────┴─ no answer, thrice ───────────┴─ another module ─────────┴ refused ┴───────┴ differs ─┴─► failed
//! ```
//!
//! Nothing lasts before WR: when it fails earlier, the module is as it was as soon as it is switched off and on.

mod search;

use std::collections::VecDeque;
use std::time::Duration;

use self::search::{Search, SearchEnd};
use super::xbee_frame::{ApiMode, AtName, Decoder};
use super::xbee_registers::{
    AO, AP, Answer, BD, CH, ID, MM, MY, Mismatches, ModuleSettings, PL, PP, ReadState,
    RegisterReads, Registers, command,
};
use crate::config::XBEE_BAUDS;
use crate::time::Time;

/// A command that is not answered is said again after this time; WR takes long.
const AGAIN: Duration = Duration::from_millis(600);
/// It is said so often at most.
const TRIES_MAX: u8 = 3;
/// Keep all registers.
const WR: AtName = AtName(*b"WR");
/// The module does not know the command.
const UNKNOWN: u8 = 2;
/// The modules that do not know these need not be told.
const OPTIONAL: [AtName; 3] = [AO, AtName(*b"A1"), MM];

/// What a module is to be set up as.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SetupSettings {
    /// What its registers are to say.
    pub module: ModuleSettings,
    /// At which baud rate it is to speak: one of those that modules have.
    pub baud: u32,
    /// Its power stays as it is, whatever is named there.
    pub keeps_power: bool,
}

/// What the set-up says.
#[derive(Clone, PartialEq, Debug)]
pub enum SetupOut {
    /// The port is to be at this baud rate from now on; what is in its queues is to be dropped.
    Baud(u32),
    /// To the module.
    Write(Vec<u8>),
    /// To people: where it was found.
    Found {
        /// Its baud rate.
        baud: u32,
        /// Its mode; `None` = it spoke no frames.
        mode: Option<ApiMode>,
    },
    /// It has ended, with what the module says of itself now.
    Ended(Result<Registers, SetupError>),
}

/// Why a module could not be set up.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SetupError {
    /// Modules have no such baud rate.
    #[error(
        "no module speaks at {baud} baud; allowed: 1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400"
    )]
    Baud {
        /// What was wanted.
        baud: u32,
    },
    /// Nothing answers.
    #[error("no module answers at any baud rate, neither to frames nor to +++")]
    NotFound,
    /// It has fallen silent.
    #[error("the module does not answer to {name} any more")]
    Silent {
        /// What it was told.
        name: AtName,
    },
    /// It does not take a value.
    #[error("the module refuses {name} = {} (status {status})", in_digits(value))]
    Refused {
        /// Which register.
        name: AtName,
        /// The value.
        value: Vec<u8>,
        /// What it answers.
        status: u8,
    },
    /// No power level gives the power.
    #[error("no power level of the module gives {wanted_dbm} dBm; it has {powers_dbm:?}")]
    NoLevel {
        /// The power that was wanted, dBm.
        wanted_dbm: i8,
        /// Those that it has, dBm.
        powers_dbm: Vec<i8>,
    },
    /// It is no module that can be used, or does not say what it was set to.
    #[error("{0}")]
    Differs(Mismatches),
}

/// The set-up of a module.
#[derive(Clone, Debug)]
pub struct XbeeSetup {
    settings: SetupSettings,
    decoder: Decoder,
    state: State,
}

#[derive(Clone, Debug)]
enum State {
    Search(Search),
    /// A register is set.
    Set(Step),
    /// What module it is, or what it says in the end.
    Read {
        reads: RegisterReads,
        is_set: bool,
    },
    Ended,
}

/// A command that waits for its answer, and what comes then.
#[derive(Clone, Debug)]
struct Step {
    call: Call,
    then: Then,
}

#[derive(Clone, Debug)]
struct Call {
    name: AtName,
    value: Vec<u8>,
    id: u8,
    tries: u8,
    due: Time,
}

#[derive(Clone, Debug)]
enum Then {
    /// The baud rate is set.
    SetBaud,
    /// The module is read.
    Identify,
    /// These are set, and then the power, if the module says its power itself.
    Write {
        rest: VecDeque<(AtName, Vec<u8>)>,
        asks_power: bool,
    },
    /// What power a level is, is asked; the levels before gave these.
    AskPower(Vec<i8>),
    /// The power is compared with the wanted one.
    ComparePower(Vec<i8>),
    /// The module is read again.
    ReadBack,
}

impl XbeeSetup {
    /// Begins to look for the module.
    pub fn begin(now: Time, settings: SetupSettings, out: &mut Vec<SetupOut>) -> XbeeSetup {
        let mut setup = XbeeSetup {
            settings,
            decoder: Decoder::new(settings.module.mode),
            state: State::Ended,
        };
        if XBEE_BAUDS.contains(&settings.baud) {
            setup.state = State::Search(Search::begin(now, out));
        } else {
            let baud = settings.baud;
            setup.end(Err(SetupError::Baud { baud }), out);
        }
        setup
    }

    /// Takes bytes of the module that have come now, in any pieces.
    pub fn take(&mut self, now: Time, bytes: &[u8], out: &mut Vec<SetupOut>) {
        if let State::Search(search) = &mut self.state {
            let end = search.take(now, bytes, out);
            return self.go_on_from_search(now, end, out);
        }
        let mut answers = Vec::new();
        self.decoder
            .take(bytes, |frame| answers.extend(Answer::of(&frame)));
        for answer in answers {
            self.hear(now, &answer, out);
        }
    }

    /// Returns when it is to be woken; `None` = it has ended.
    pub fn deadline(&self) -> Option<Time> {
        match &self.state {
            State::Search(search) => Some(search.deadline()),
            State::Set(step) => Some(step.call.due),
            State::Read { reads, .. } => Some(reads.deadline()),
            State::Ended => None,
        }
    }

    /// Goes on with what is due by now.
    pub fn due(&mut self, now: Time, out: &mut Vec<SetupOut>) {
        if self.deadline().is_none_or(|at| now < at) {
            return;
        }
        match &mut self.state {
            State::Search(search) => {
                let end = search.due(now, out);
                self.go_on_from_search(now, end, out);
            }
            State::Set(_) => self.say_again(now, out),
            State::Read { reads, .. } => {
                let mut bytes = Vec::new();
                let state = reads.due(now, &mut bytes);
                write(bytes, out);
                if state == ReadState::Silent {
                    self.end(Err(SetupError::Silent { name: AP }), out);
                }
            }
            State::Ended => {}
        }
    }

    fn go_on_from_search(&mut self, now: Time, end: Option<SearchEnd>, out: &mut Vec<SetupOut>) {
        match end {
            None => {}
            Some(SearchEnd::Nowhere) => self.end(Err(SetupError::NotFound), out),
            Some(SearchEnd::Found { mode }) => {
                self.decoder.restart(mode);
                let wanted = self.settings.module.mode.register();
                self.set(now, AP, vec![wanted], Then::SetBaud, out);
            }
        }
    }

    fn hear(&mut self, now: Time, answer: &Answer, out: &mut Vec<SetupOut>) {
        match &mut self.state {
            State::Search(_) | State::Ended => {}
            State::Read { reads, is_set } => {
                let mut bytes = Vec::new();
                let state = reads.hear(now, answer, &mut bytes);
                write(bytes, out);
                if state == ReadState::Read {
                    let (found, is_set) = (reads.found().clone(), *is_set);
                    self.judge(now, found, is_set, out);
                }
            }
            State::Set(Step { call, then }) => {
                if (answer.id, answer.name) != (call.id, call.name) {
                    return;
                }
                let is_skipped = answer.status == UNKNOWN && OPTIONAL.contains(&call.name);
                if answer.status != 0 && !is_skipped {
                    let (name, value, status) = (call.name, call.value.clone(), answer.status);
                    return self.end(
                        Err(SetupError::Refused {
                            name,
                            value,
                            status,
                        }),
                        out,
                    );
                }
                let then = then.clone();
                self.go_on(now, then, answer.value, out);
            }
        }
    }

    fn go_on(&mut self, now: Time, then: Then, value: Option<u32>, out: &mut Vec<SetupOut>) {
        let settings = self.settings;
        match then {
            Then::SetBaud => {
                self.decoder.restart(settings.module.mode);
                let code = XBEE_BAUDS.iter().position(|baud| *baud == settings.baud);
                let code = code
                    .and_then(|code| u8::try_from(code).ok())
                    .unwrap_or_default();
                self.set(now, BD, vec![code], Then::Identify, out);
            }
            Then::Identify => {
                out.push(SetupOut::Baud(settings.baud));
                self.read(now, false, out);
            }
            Then::Write {
                mut rest,
                asks_power,
            } => match rest.pop_front() {
                Some((name, value)) => {
                    self.set(now, name, value, Then::Write { rest, asks_power }, out)
                }
                None if asks_power => self.set(now, PL, vec![0], Then::AskPower(Vec::new()), out),
                None => self.set(now, WR, Vec::new(), Then::ReadBack, out),
            },
            Then::AskPower(before) => {
                self.set(now, PP, Vec::new(), Then::ComparePower(before), out)
            }
            Then::ComparePower(mut powers_dbm) => {
                let power_dbm = value.map_or(0, |power| power.to_be_bytes()[3].cast_signed());
                powers_dbm.push(power_dbm);
                let wanted_dbm = settings.module.power_dbm;
                match u8::try_from(powers_dbm.len()) {
                    _ if power_dbm == wanted_dbm => {
                        self.set(now, WR, Vec::new(), Then::ReadBack, out)
                    }
                    Ok(level @ 0..=4) => {
                        self.set(now, PL, vec![level], Then::AskPower(powers_dbm), out)
                    }
                    Ok(_) | Err(_) => self.end(
                        Err(SetupError::NoLevel {
                            wanted_dbm,
                            powers_dbm,
                        }),
                        out,
                    ),
                }
            }
            Then::ReadBack => self.read(now, true, out),
        }
    }

    /// Judges what was read: in the beginning whether the module can be set up, in the end whether it is.
    fn judge(&mut self, now: Time, found: Registers, is_set: bool, out: &mut Vec<SetupOut>) {
        if let (true, false, Some(power_dbm)) =
            (self.settings.keeps_power, is_set, found.power_dbm())
        {
            self.settings.module.power_dbm = power_dbm;
        }
        let mut mismatches = found.mismatches(&self.settings.module);
        if !is_set {
            mismatches.retain(|mismatch| !mismatch.can_be_set());
        }
        if !mismatches.is_empty() {
            return self.end(Err(SetupError::Differs(Mismatches(mismatches))), out);
        }
        if is_set {
            return self.end(Ok(found), out);
        }
        let asks_power = found.get(PP).is_some();
        let mut rest = values(&self.settings.module);
        if !asks_power {
            match self.level(&found) {
                Ok(level) => rest.push_back((PL, vec![level])),
                Err(error) => return self.end(Err(error), out),
            }
        }
        self.go_on(now, Then::Write { rest, asks_power }, None, out);
    }

    /// Returns the level of the wanted power, of a module that does not say what power a level is.
    fn level(&self, found: &Registers) -> Result<u8, SetupError> {
        let wanted_dbm = self.settings.module.power_dbm;
        let kind = found.kind();
        let powers_dbm = kind.map_or_else(Vec::new, |kind| kind.powers_dbm().to_vec());
        (0..)
            .zip(&powers_dbm)
            .find(|(_, power_dbm)| **power_dbm == wanted_dbm)
            .map(|(level, _)| level)
            .ok_or(SetupError::NoLevel {
                wanted_dbm,
                powers_dbm,
            })
    }

    /// Tells the module something; an empty value asks, or is a command.
    fn set(
        &mut self,
        now: Time,
        name: AtName,
        value: Vec<u8>,
        then: Then,
        out: &mut Vec<SetupOut>,
    ) {
        let call = Call {
            name,
            value,
            id: 0,
            tries: 0,
            due: now,
        };
        self.state = State::Set(Step { call, then });
        self.say(now, out);
    }

    fn say(&mut self, now: Time, out: &mut Vec<SetupOut>) {
        let mode = self.decoder.mode();
        if let State::Set(Step { call, .. }) = &mut self.state {
            (call.tries, call.id, call.due) = (call.tries + 1, call.id + 1, now + AGAIN);
            let mut bytes = Vec::new();
            command(call.id, call.name, &call.value, mode, &mut bytes);
            write(bytes, out);
        }
    }

    fn say_again(&mut self, now: Time, out: &mut Vec<SetupOut>) {
        let State::Set(Step { call, then }) = &self.state else {
            return;
        };
        if call.name == BD {
            // It may have answered at its new baud rate already.
            let then = then.clone();
            return self.go_on(now, then, None, out);
        }
        if call.tries == TRIES_MAX {
            let name = call.name;
            return self.end(Err(SetupError::Silent { name }), out);
        }
        self.say(now, out);
    }

    fn read(&mut self, now: Time, is_set: bool, out: &mut Vec<SetupOut>) {
        let mut bytes = Vec::new();
        let mode = self.settings.module.mode;
        let reads = RegisterReads::begin(now, mode, &mut bytes);
        self.decoder.restart(mode);
        self.state = State::Read { reads, is_set };
        write(bytes, out);
    }

    fn end(&mut self, result: Result<Registers, SetupError>, out: &mut Vec<SetupOut>) {
        self.state = State::Ended;
        out.push(SetupOut::Ended(result));
    }
}

/// Returns what is set beside mode, baud rate and power. What is for coordinators, sleepers, associations, encryption and
/// retries is off: all modules are alike and always awake, and a beacon is said once.
fn values(settings: &ModuleSettings) -> VecDeque<(AtName, Vec<u8>)> {
    let name = format!("tomoswarm-{}", settings.vehicle);
    let mut values = VecDeque::from([
        (MY, settings.address().to_be_bytes().to_vec()),
        (ID, settings.network.to_be_bytes().to_vec()),
        (CH, vec![settings.channel]),
        (AO, vec![2]),
        (MM, vec![0]),
        (AtName(*b"NI"), name.into_bytes()),
    ]);
    let off = [b"CE", b"A1", b"SM", b"EE", b"RR", b"RN"];
    values.extend(off.map(|name| (AtName(*name), vec![0])));
    values
}

/// Returns a value as a user would type it.
fn in_digits(value: &[u8]) -> String {
    value.iter().map(|byte| format!("{byte:02X}")).collect()
}

fn write(bytes: Vec<u8>, out: &mut Vec<SetupOut>) {
    if !bytes.is_empty() {
        out.push(SetupOut::Write(bytes));
    }
}
