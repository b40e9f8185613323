//! The simulated module under words of any kind, and a modem or a set-up at its other end over a bad line.

use std::time::Duration;

use tomoswarm::hw::xbee_frame::{ApiMode, AtName, encode};
use tomoswarm::hw::xbee_modem::{ModemOut, XbeeModem};
use tomoswarm::hw::xbee_registers::{AP, BD, CH, ID, MY, ModuleKind, ModuleSettings, PL};
use tomoswarm::hw::xbee_setup::{SetupOut, SetupSettings, XbeeSetup};
use tomoswarm::sim::noise::Noise;
use tomoswarm::sim::xbee_module::{
    Content, ModuleFaults, ModuleOut, Packet, Recipient, XbeeModule,
};
use tomoswarm::time::Time;

use crate::chance::Chance;
use crate::frames;
use crate::modem::{Numbers, SETTINGS, beacon};

const KINDS: [ModuleKind; 5] = [
    ModuleKind::S1,
    ModuleKind::S1Pro,
    ModuleKind::S2c,
    ModuleKind::S2cPro,
    ModuleKind::Xbee3,
];

/// A module of some kind whose registers say anything.
fn any_module(chance: &mut Chance) -> XbeeModule {
    let noise = Noise::new(chance.below(1000) as u64);
    let mut module = XbeeModule::new(chance.one_of(&KINDS), chance.below(1 << 40) as u64, noise);
    for (name, below) in [(AP, 3), (BD, 9), (MY, 4), (CH, 30), (PL, 5), (ID, 70_000)] {
        let value = chance.below(below) as u32;
        let _ = module.set_register(name, &value.to_be_bytes());
    }
    let faults = ModuleFaults {
        busy: chance.one_of(&[0.0, 0.3]),
        doubled: chance.one_of(&[0.0, 0.3]),
    };
    module.set_faults(faults);
    module.switch_on(Time::ZERO);
    module
}

/// What the air carries to it.
fn any_packet(chance: &mut Chance) -> Packet {
    let payload = frames::bytes(chance, 120);
    let name = AtName(chance.one_of(&[*b"MY", *b"SH", *b"FR", *b"CH", *b"AP"]));
    let id = chance.below(256) as u8;
    let content = match chance.below(4) {
        0 => Content::Command {
            id,
            name,
            value: payload,
        },
        1 => Content::Answer {
            id,
            name,
            status: 0,
            value: payload,
        },
        _ => Content::Payload(payload),
    };
    Packet {
        from16: chance.one_of(&[0, 1, 2, 0xFFFE, 0xFFFF]),
        from64: 9,
        to: chance.one_of(&[
            Recipient::Address(0xFFFF),
            Recipient::Address(1),
            Recipient::Serial(9),
        ]),
        network: chance.one_of(&[0x3332, 0x1A2B]),
        channel: chance.one_of(&[12, 15]),
        power_dbm: 0,
        has_header: chance.one_of(&[true, false]),
        content,
    }
}

/// Returns how many events there were.
pub fn any_words(chance: &mut Chance) -> u64 {
    let mut module = any_module(chance);
    let mut now = Time::ZERO;
    let baud = chance.one_of(&[9_600, 57_600, 115_200, 230_400]);
    module.open(baud);
    let events = 20 + chance.below(100);
    for _ in 0..events {
        match chance.below(12) {
            0 | 1 => module.write(now, &frames::bytes(chance, 100)),
            2 => {
                let words = chance.one_of(&[
                    "+++", "ATAP2\r", "ATCN\r", "ATMY 5\r", "ATNI\r", "ATFR\r", "at\r", "ATBD 9\r",
                ]);
                module.write(now, words.as_bytes());
            }
            3..7 => {
                let content = frames::bytes(chance, 130);
                let frame = frames::frame(chance, &content);
                let mode = chance.one_of(&[ApiMode::Plain, ApiMode::Escaped]);
                let mut bytes = Vec::new();
                encode(&frame, mode, &mut bytes).unwrap();
                module.write(now, &bytes);
            }
            7 => {
                let packet = any_packet(chance);
                module.receive(now, &packet, -(chance.below(300) as i16));
            }
            8 if chance.happens(0.1) => module.switch_on(now),
            8 if chance.happens(0.1) => module.switch_off(now),
            9 if chance.happens(0.2) => module.close(),
            9 => module.open(baud),
            _ => now = now + Duration::from_millis(chance.one_of(&[1, 10, 200, 1_100])),
        }
        let mut out = Vec::new();
        module.due(now, chance.happens(0.3), &mut out);
        assert!(out.len() < 2_000);
        assert!(
            module.deadline().is_none_or(|at| at > now),
            "woken for ever"
        );
        for out in out {
            match out {
                ModuleOut::Host(bytes) => assert!(!bytes.is_empty()),
                ModuleOut::OnAir(packet, until) => {
                    assert!(until > now && packet.air_time() < Duration::from_millis(10));
                }
            }
        }
    }
    events as u64
}

/// The line between a module and its host: loses and damages pieces while it is bad.
fn over_line(chance: &mut Chance, bad: f64, mut bytes: Vec<u8>) -> Option<Vec<u8>> {
    if chance.happens(bad) {
        if chance.happens(0.5) {
            return None;
        }
        frames::damage(chance, &mut bytes);
    }
    Some(bytes)
}

/// Hands to the module and the radio actor what the modem says.
fn take_all(
    chance: &mut Chance,
    bad: f64,
    now: Time,
    out: &mut Vec<ModemOut>,
    module: &mut XbeeModule,
    numbers: &mut Numbers,
) {
    for said in out.drain(..) {
        match said {
            // Bytes to the module are lost and not damaged: a damaged question could set a register.
            ModemOut::Write(_) if chance.happens(bad) => {}
            ModemOut::Write(bytes) => module.write(now, &bytes),
            ModemOut::Unsent(number) => numbers.take_back(number),
            ModemOut::Heard(_) => panic!("nobody spoke"),
        }
    }
}

/// Returns how many events the modem was told of.
pub fn bad_line(chance: &mut Chance) -> u64 {
    let mut module = XbeeModule::new(ModuleKind::Xbee3, 7, Noise::new(chance.below(1000) as u64));
    let values = [(AP, 2), (BD, 7), (MY, 2), (ID, 0x1A2B), (CH, 15), (PL, 4)];
    for (name, value) in values {
        assert!(module.set_register(name, &u32::to_be_bytes(value)));
    }
    module.switch_on(Time::ZERO);
    module.open(115_200);
    let (mut modem, mut numbers, mut now, mut out) = (
        XbeeModem::new(SETTINGS),
        Numbers::default(),
        Time::ZERO,
        Vec::new(),
    );
    modem.opened(now, &mut out);
    take_all(chance, 0.0, now, &mut out, &mut module, &mut numbers);
    let good_from = Time::ZERO + Duration::from_millis(500 + chance.below(4_000) as u64);
    let bad = chance.one_of(&[0.02, 0.3, 0.9]);
    let end = good_from + Duration::from_secs(8);
    let mut next_beacon = now + Duration::from_millis(300);
    let mut events = 1;
    while now < end {
        let bad = if now < good_from { bad } else { 0.0 };
        let next = [module.deadline(), modem.deadline(), Some(next_beacon)]
            .into_iter()
            .flatten()
            .min();
        now = next.map_or(end, |at| at.min(end));
        let mut said = Vec::new();
        module.due(now, chance.happens(0.1), &mut said);
        for said in said {
            if let ModuleOut::Host(bytes) = said
                && let Some(bytes) = over_line(chance, bad, bytes)
            {
                modem.take(now, &bytes, &mut out);
                events += 1;
            }
        }
        modem.due(now, &mut out);
        events += 1;
        take_all(chance, bad, now, &mut out, &mut module, &mut numbers);
        if now == next_beacon {
            next_beacon = now + Duration::from_millis(20 + chance.below(200) as u64);
            modem.send(now, beacon(2, numbers.next()), &mut out);
            events += 1;
            take_all(chance, bad, now, &mut out, &mut module, &mut numbers);
            if bad > 0.0 && chance.happens(0.02) {
                module.switch_on(now);
            }
        }
    }
    assert!(modem.is_ready(), "{:?}", modem.troubles(now));
    assert!(modem.health().sent > 0);
    events
}

/// Returns how many events the set-up was told of.
pub fn set_up(chance: &mut Chance) -> u64 {
    let mut module = any_module(chance);
    let wanted = ModuleSettings {
        channel: chance.one_of(&[11, 12, 15, 26]),
        power_dbm: chance.one_of(&[-5, 0, 8, 18]),
        mode: chance.one_of(&[ApiMode::Plain, ApiMode::Escaped]),
        ..SETTINGS
    };
    let settings = SetupSettings {
        module: wanted,
        baud: chance.one_of(&[57_600, 115_200, 230_400]),
        keeps_power: chance.one_of(&[false, false, true]),
    };
    let level = module.register(PL);
    let bad = chance.one_of(&[0.0, 0.0, 0.02, 0.2, 1.0]);
    let (mut now, mut out, mut result) = (Time::ZERO, Vec::new(), None);
    let mut setup = XbeeSetup::begin(now, settings, &mut out);
    let mut events = 1;
    while result.is_none() {
        for said in out.split_off(0) {
            match said {
                SetupOut::Baud(baud) => module.open(baud),
                SetupOut::Write(bytes) => module.write(now, &bytes),
                SetupOut::Found { .. } => {}
                SetupOut::Ended(ended) => result = Some(ended),
            }
        }
        let Some(deadline) = setup.deadline() else {
            break;
        };
        now = module.deadline().map_or(deadline, |at| at.min(deadline));
        let mut said = Vec::new();
        module.due(now, false, &mut said);
        for said in said {
            if let ModuleOut::Host(bytes) = said
                && let Some(bytes) = over_line(chance, bad, bytes)
            {
                setup.take(now, &bytes, &mut out);
                events += 1;
            }
        }
        setup.due(now, &mut out);
        events += 1;
        assert!(now < Time::from_secs_f64(120.0), "it never ends");
    }
    match result.expect("it has ended") {
        Err(error) => assert!(!error.to_string().is_empty()),
        Ok(registers) => {
            let power_dbm = match settings.keeps_power {
                true => registers.power_dbm().expect("it has been set up"),
                false => wanted.power_dbm,
            };
            let wanted = ModuleSettings {
                power_dbm,
                ..wanted
            };
            assert_eq!(registers.mismatches(&wanted), []);
            if settings.keeps_power {
                assert_eq!(module.register(PL), level, "its power stays");
            }
            module.switch_on(now);
            module.due(now + Duration::from_secs(1), false, &mut Vec::new());
            let values = [
                (AP, u32::from(wanted.mode.register())),
                (MY, 2),
                (ID, 0x1A2B),
                (CH, wanted.channel.into()),
            ];
            for (name, value) in values {
                let has = module.register(name).expect("all know it");
                assert_eq!(
                    tomoswarm::hw::xbee_registers::value_of(&has),
                    value,
                    "{name}"
                );
            }
        }
    }
    events
}
