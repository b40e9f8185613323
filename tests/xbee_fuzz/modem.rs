//! A modem under events of any kind.

use std::time::Duration;

use tomoswarm::hw::xbee_frame::{ApiMode, AtName, Decoder, Frame, encode};
use tomoswarm::hw::xbee_modem::{ModemOut, XbeeModem};
use tomoswarm::hw::xbee_registers::{ModuleSettings, READ};
use tomoswarm::time::Time;
use tomoswarm_proto::{Beacon, Boot, Message, VehicleId, codec};

use crate::chance::Chance;
use crate::frames;

pub const SETTINGS: ModuleSettings = ModuleSettings {
    vehicle: VehicleId(2),
    network: 0x1A2B,
    channel: 15,
    power_dbm: 8,
    mode: ApiMode::Escaped,
};

/// The values of an XBee 3 that is as wanted, in the order of [`READ`].
const GOOD: [&[u8]; 14] = [
    &[2],
    &[0x20, 0x14],
    &[0x42, 0x42],
    &[0, 0x13, 0xA2, 0],
    &[0x40, 0x11, 0x7E, 0x7D],
    &[0, 2],
    &[0x1A, 0x2B],
    &[15],
    &[4],
    &[8],
    &[114],
    &[2],
    &[0],
    &[0],
];

pub fn beacon(sender: u8, number: u32) -> Beacon {
    Beacon {
        sender: VehicleId(sender),
        boot: Boot(1),
        sequence: number,
        channel: 15,
        power_dbm: 8,
        ..Beacon::default()
    }
}

/// The radio actor's side: beacons are numbered, and each number is sent or comes back.
#[derive(Default)]
pub struct Numbers {
    pub last: u32,
    pub said: u64,
}

impl Numbers {
    pub fn next(&mut self) -> u32 {
        (self.last, self.said) = (self.last + 1, self.said + 1);
        self.last
    }

    pub fn take_back(&mut self, number: u32) {
        assert_eq!(
            number, self.last,
            "the last one that was said comes back first"
        );
        self.last -= 1;
    }
}

struct Session {
    modem: XbeeModem,
    now: Time,
    numbers: Numbers,
    /// Numbers of frames that ask for a word, and what they ask.
    asked: Vec<(u8, Option<AtName>)>,
}

impl Session {
    fn hear(&mut self, out: Vec<ModemOut>) {
        assert!(out.len() <= 400, "{} at once", out.len());
        for out in out {
            match out {
                ModemOut::Unsent(number) => self.numbers.take_back(number),
                ModemOut::Heard(heard) => {
                    assert!(heard.rssi_dbm < 0 && heard.beacon.sender != SETTINGS.vehicle);
                }
                ModemOut::Write(bytes) => self.read(&bytes),
            }
        }
        let health = self.modem.health();
        let open = self.numbers.said - health.sent - health.unsent;
        assert!(open <= 2, "{open} are neither sent nor given back");
        assert_eq!(u64::from(self.numbers.last), health.sent + open);
    }

    /// What the modem says to the module is a question or a beacon, and nothing that sets anything.
    fn read(&mut self, bytes: &[u8]) {
        for mode in [ApiMode::Escaped, ApiMode::Plain] {
            let before = self.asked.len();
            Decoder::new(mode).take(bytes, |frame| match frame {
                Frame::Command { id, name, value } => {
                    assert!(value.is_empty() && READ.contains(&name), "{name}");
                    self.asked.push((id, Some(name)));
                }
                Frame::Transmit16 {
                    id, to, payload, ..
                } => {
                    assert!(id != 0 && to == 0xFFFF && payload.len() <= 116);
                    self.asked.push((id, None));
                }
                other => panic!("{other:?}"),
            });
            if self.asked.len() > before {
                return;
            }
        }
        panic!("no frame: {bytes:?}");
    }

    /// The module says bytes.
    fn take(&mut self, bytes: &[u8]) {
        let mut out = Vec::new();
        self.modem.take(self.now, bytes, &mut out);
        self.hear(out);
    }

    fn frame(&mut self, frame: &Frame<'_>) {
        let mut bytes = Vec::new();
        encode(frame, ApiMode::Escaped, &mut bytes).unwrap();
        self.take(&bytes);
    }

    /// The module answers the newest question as it should.
    fn answer(&mut self, chance: &mut Chance) {
        let Some((id, name)) = self.asked.pop() else {
            return;
        };
        let Some(name) = name else {
            let status = chance.one_of(&[0, 0, 0, 2, 1, 0x74]);
            return self.frame(&Frame::TransmitStatus { id, status });
        };
        let index = READ.iter().position(|known| *known == name).unwrap();
        let mut value = GOOD[index].to_vec();
        if chance.happens(0.01) {
            frames::damage(chance, &mut value);
        }
        let status = if chance.happens(0.01) { 2 } else { 0 };
        self.frame(&Frame::CommandAnswer {
            id,
            name,
            status,
            value: &value,
        });
    }

    fn step(&mut self, chance: &mut Chance) {
        let mut out = Vec::new();
        match chance.below(100) {
            0..35 => return self.answer(chance),
            35..60 => {
                let number = self.numbers.next();
                let mut beacon = beacon(2, number);
                beacon.members = (0..chance.one_of(&[0, 3, 12, 90])).map(VehicleId).collect();
                self.modem.send(self.now, beacon, &mut out);
            }
            60..75 => {
                self.now = self.now + Duration::from_millis(chance.below(300) as u64);
                self.modem.due(self.now, &mut out);
                let is_late = |at: Time| at <= self.now;
                assert!(
                    !self.modem.deadline().is_some_and(is_late),
                    "woken for ever"
                );
            }
            75..85 => {
                let sender = chance.below(4) as u8;
                let mut payload = codec::encode(&Message::Beacon(beacon(sender, 7))).unwrap();
                if chance.happens(0.3) {
                    frames::damage(chance, &mut payload);
                }
                let from = chance.below(4) as u16;
                let rssi_dbm = -(chance.below(100) as i16);
                return self.frame(&Frame::Receive16 {
                    from,
                    rssi_dbm,
                    options: 2,
                    payload: &payload,
                });
            }
            85..92 => {
                let content = frames::bytes(chance, 60);
                let frame = frames::frame(chance, &content);
                return self.frame(&frame);
            }
            92..97 => {
                let bytes = frames::bytes(chance, 120);
                return self.take(&bytes);
            }
            97 => self.modem.closed(&mut out),
            _ => self.modem.opened(self.now, &mut out),
        }
        self.hear(out);
        let troubles = self.modem.troubles(self.now);
        assert!(
            troubles
                .iter()
                .all(|trouble| !trouble.to_string().is_empty())
        );
    }
}

/// Returns how many events there were.
pub fn any_events(chance: &mut Chance) -> u64 {
    let mut session = Session {
        modem: XbeeModem::new(SETTINGS),
        now: Time::ZERO,
        numbers: Numbers::default(),
        asked: Vec::new(),
    };
    let events = 20 + chance.below(200);
    for _ in 0..events {
        session.step(chance);
    }
    events as u64
}
