//! What a simulated module answers to its host and to the others, as the manuals say.

use std::time::Duration;

use tomoswarm::hw::xbee_frame::{ApiMode, AtName, Decoder, Frame, encode};
use tomoswarm::hw::xbee_registers::{AO, MY, ModuleKind, NP, PL};
use tomoswarm::sim::noise::Noise;
use tomoswarm::sim::xbee_module::{
    Content, ModuleFaults, ModuleOut, Packet, Recipient, XbeeModule,
};
use tomoswarm::time::Time;

use crate::field::{module, wanted};

fn at_ms(ms: f64) -> Time {
    Time::from_secs_f64(ms / 1000.0)
}

/// A module that is on, and its host.
struct Host {
    module: XbeeModule,
    mode: ApiMode,
    now: Time,
    packets: Vec<(Time, Packet, Time)>,
}

impl Host {
    fn of(module: XbeeModule, mode: ApiMode) -> Host {
        let mut host = Host {
            module,
            mode,
            now: Time::ZERO,
            packets: Vec::new(),
        };
        host.pass(200.0, false);
        host
    }

    fn new(kind: ModuleKind) -> Host {
        let power_dbm = kind.powers_dbm()[4];
        let wanted = tomoswarm::hw::xbee_registers::ModuleSettings {
            power_dbm,
            ..wanted(2)
        };
        Host::of(module(kind, &wanted, 115_200), ApiMode::Escaped)
    }

    /// Lets time pass; returns pieces of bytes and when they came.
    fn pass(&mut self, ms: f64, is_busy: bool) -> Vec<(Time, Vec<u8>)> {
        let (until, mut said) = (self.now + Duration::from_secs_f64(ms / 1000.0), Vec::new());
        while let Some(at) = self.module.deadline().filter(|at| *at <= until) {
            self.now = at.max(self.now);
            let mut out = Vec::new();
            self.module.due(self.now, is_busy, &mut out);
            for out in out {
                match out {
                    ModuleOut::Host(bytes) => said.push((self.now, bytes)),
                    ModuleOut::OnAir(packet, until) => self.packets.push((self.now, packet, until)),
                }
            }
        }
        self.now = until;
        said
    }

    /// Says a frame; returns what is answered within 50 ms, in words.
    fn say(&mut self, frame: &Frame<'_>) -> Vec<String> {
        let mut bytes = Vec::new();
        encode(frame, self.mode, &mut bytes).unwrap();
        self.module.write(self.now, &bytes);
        self.frames(50.0, false)
    }

    fn frames(&mut self, ms: f64, is_busy: bool) -> Vec<String> {
        let (mut decoder, mut found) = (Decoder::new(self.mode), Vec::new());
        for (_, bytes) in self.pass(ms, is_busy) {
            decoder.take(&bytes, |frame| found.push(format!("{frame:?}")));
        }
        assert_eq!(decoder.bad().total(), 0);
        found
    }

    fn command(&mut self, name: &[u8; 2], value: &[u8]) -> Vec<String> {
        self.say(&Frame::Command {
            id: 9,
            name: AtName(*name),
            value,
        })
    }
}

fn answer(name: &[u8; 2], status: u8, value: &[u8]) -> Vec<String> {
    let name = AtName(*name);
    vec![format!(
        "{:?}",
        Frame::CommandAnswer {
            id: 9,
            name,
            status,
            value
        }
    )]
}

fn status(id: u8, status: u8) -> Vec<String> {
    vec![format!("{:?}", Frame::TransmitStatus { id, status })]
}

fn beacon(payload: &[u8]) -> Frame<'_> {
    Frame::Transmit16 {
        id: 5,
        to: 0xFFFF,
        options: 1,
        payload,
    }
}

fn packet(payload: &[u8]) -> Packet {
    Packet {
        from16: 3,
        from64: 0x0013_A200_4000_0003,
        to: Recipient::Address(0xFFFF),
        network: 0x1A2B,
        channel: 15,
        power_dbm: 8,
        has_header: true,
        content: Content::Payload(payload.to_vec()),
    }
}

#[test]
fn registers_are_read_and_set_and_what_is_impossible_is_refused() {
    let mut host = Host::new(ModuleKind::Xbee3);
    assert_eq!(host.command(b"MY", &[]), answer(b"MY", 0, &[0, 2]));
    assert_eq!(host.command(b"SL", &[]), answer(b"SL", 0, &[0x40, 0, 0, 2]));
    assert_eq!(host.command(b"HV", &[]), answer(b"HV", 0, &[0x42, 0x42]));
    assert_eq!(host.command(b"PL", &[0]), answer(b"PL", 0, &[]));
    assert_eq!(host.command(b"PP", &[]), answer(b"PP", 0, &[0xFB]));
    assert_eq!(host.command(b"PL", &[5]), answer(b"PL", 3, &[]));
    assert_eq!(host.command(b"CH", &[27]), answer(b"CH", 3, &[]));
    assert_eq!(host.command(b"HV", &[1]), answer(b"HV", 2, &[]));
    assert_eq!(host.command(b"ZZ", &[]), answer(b"ZZ", 2, &[]));
    assert_eq!(host.command(b"MY", &[0, 0, 0, 0, 1]), answer(b"MY", 3, &[]));
    let mut first = Host::new(ModuleKind::S1);
    for name in [b"AO", b"PP"] {
        assert_eq!(first.command(name, &[]), answer(name, 2, &[]));
    }
    assert_eq!(first.module.register(NP), Some(vec![100]));
    let silent = Frame::Command {
        id: 0,
        name: MY,
        value: &[],
    };
    assert!(
        first.say(&silent).is_empty(),
        "without a number nothing is answered"
    );
}

#[test]
fn what_is_queued_takes_effect_later_and_what_is_saved_outlives_a_reset() {
    let mut host = Host::new(ModuleKind::Xbee3);
    let queued = Frame::QueuedCommand {
        id: 9,
        name: AtName(*b"CH"),
        value: &[20],
    };
    assert_eq!(host.say(&queued), answer(b"CH", 0, &[]));
    assert_eq!(host.module.channel(), 15);
    assert_eq!(host.command(b"AC", &[]), answer(b"AC", 0, &[]));
    assert_eq!(host.module.channel(), 20);
    let again = [answer(b"FR", 0, &[]), vec!["ModemStatus(1)".to_owned()]].concat();
    let mut said = host.command(b"FR", &[]);
    said.extend(host.frames(200.0, false));
    assert_eq!((said, host.module.channel()), (again, 15));
    host.command(b"CH", &[20]);
    host.command(b"WR", &[]);
    host.module.switch_on(host.now);
    assert_eq!(host.frames(200.0, false), ["ModemStatus(0)"]);
    assert_eq!(host.module.channel(), 20);
    host.command(b"RE", &[]);
    assert_eq!(host.module.channel(), 12);
}

#[test]
fn every_byte_takes_its_time_on_the_line_and_on_the_air() {
    let mut host = Host::new(ModuleKind::Xbee3);
    let began = host.now;
    let payload = [7; 62];
    assert_eq!(host.say(&beacon(&payload)), status(5, 0));
    let (begins, packet, ends) = host.packets[0].clone();
    assert_eq!(packet.content, Content::Payload(payload.to_vec()));
    // 71 bytes on the line, 1 ms in the module, and it listens.
    let expected_ms = 71.0 * 10.0 / 115.2 + 1.0 + 0.128;
    let took_ms = begins.since(began).as_secs_f64() * 1000.0;
    assert!((took_ms - expected_ms).abs() < 0.001, "{took_ms}");
    let air_ms = ends.since(begins).as_secs_f64() * 1000.0;
    assert!((air_ms - (0.416 + 0.032 * 62.0)).abs() < 0.001, "{air_ms}");
}

#[test]
fn a_busy_channel_is_waited_for_and_given_up_within_what_the_maker_says() {
    let mut host = Host::new(ModuleKind::Xbee3);
    let mut slowest_ms = 0.0_f64;
    for _ in 0..200 {
        let mut bytes = Vec::new();
        encode(&beacon(&[1]), ApiMode::Escaped, &mut bytes).unwrap();
        let began = host.now;
        host.module.write(began, &bytes);
        let said = host.pass(50.0, true);
        assert_eq!(said.len(), 1);
        assert_eq!(said[0].1[4..6], [5, 2], "it says so");
        slowest_ms = slowest_ms.max(said[0].0.since(began).as_secs_f64() * 1000.0);
    }
    assert!(host.packets.is_empty());
    // Both ways on the line and 1 ms in the module; the rest is the maker's 9.376 ms less what it is on the air.
    let line_ms = (10.0 + 7.0) * 10.0 / 115.2 + 1.0;
    let waited_ms = slowest_ms - line_ms;
    assert!((6.0..=9.0).contains(&waited_ms), "{waited_ms}");
    host.module.set_faults(ModuleFaults {
        busy: 1.0,
        doubled: 0.0,
    });
    assert_eq!(host.say(&beacon(&[1])), status(5, 2));
}

#[test]
fn packets_that_are_too_long_or_too_many_are_not_sent() {
    let mut host = Host::new(ModuleKind::S1);
    assert_eq!(host.say(&beacon(&[7; 100])), status(5, 0));
    assert_eq!(host.say(&beacon(&[7; 101])), status(5, 0x74));
    let mut bytes = Vec::new();
    for _ in 0..9 {
        encode(&beacon(&[7; 20]), ApiMode::Escaped, &mut bytes).unwrap();
    }
    host.module.write(host.now, &bytes);
    assert_eq!(
        host.frames(200.0, false).len(),
        3,
        "one is sent while two wait"
    );
}

#[test]
fn what_is_heard_is_said_as_the_registers_want_it() {
    let payload = b"abc".as_slice();
    let mut host = Host::new(ModuleKind::Xbee3);
    let options = 2;
    let heard = |host: &mut Host, packet: &Packet| {
        host.module.receive(host.now, packet, -61);
        host.frames(20.0, false)
    };
    let short = Frame::Receive16 {
        from: 3,
        rssi_dbm: -61,
        options,
        payload,
    };
    assert_eq!(heard(&mut host, &packet(payload)), [format!("{short:?}")]);
    assert_eq!(host.command(b"DB", &[]), answer(b"DB", 0, &[61]));
    let from64 = packet(payload).from64;
    let long = Frame::Receive64 {
        from: from64,
        rssi_dbm: -61,
        options,
        payload,
    };
    let nameless = Packet {
        from16: 0xFFFE,
        ..packet(payload)
    };
    assert_eq!(heard(&mut host, &nameless), [format!("{long:?}")]);
    let elsewhere = [
        Packet {
            network: 1,
            ..packet(payload)
        },
        Packet {
            channel: 16,
            ..packet(payload)
        },
        Packet {
            to: Recipient::Address(9),
            ..packet(payload)
        },
        Packet {
            has_header: false,
            ..packet(payload)
        },
    ];
    assert!(
        elsewhere
            .iter()
            .all(|packet| heard(&mut host, packet).is_empty())
    );
    assert!(host.module.set_register(AO, &[0]));
    let without = Frame::ReceiveWithoutRssi {
        from64,
        from16: 3,
        options,
        payload,
    };
    assert_eq!(heard(&mut host, &packet(payload)), [format!("{without:?}")]);
    host.command(b"AP", &[0]);
    host.module.receive(host.now, &packet(payload), -61);
    assert_eq!(host.pass(20.0, false)[0].1, payload);
}

#[test]
fn who_speaks_does_not_hear_and_who_hears_much_says_what_there_is_room_for() {
    let mut host = Host::new(ModuleKind::Xbee3);
    let mut bytes = Vec::new();
    encode(&beacon(&[7; 60]), ApiMode::Escaped, &mut bytes).unwrap();
    host.module.write(host.now, &bytes);
    host.pass(8.0, false);
    assert_eq!(host.packets.len(), 1);
    host.module.receive(host.now, &packet(b"abc"), -61);
    assert_eq!(host.frames(20.0, false), status(5, 0));
    for _ in 0..9 {
        host.module.receive(host.now, &packet(&[7; 60]), -61);
    }
    assert_eq!(host.frames(100.0, false).len(), 2);
}

#[test]
fn another_module_is_asked_over_the_air_and_one_that_is_not_there_has_no_answer() {
    let (mut one, mut two) = (Host::new(ModuleKind::Xbee3), Host::new(ModuleKind::S1));
    assert!(two.module.set_register(MY, &[0, 3]));
    let name = AtName(*b"SH");
    let ask = Frame::RemoteCommand {
        id: 4,
        to64: 0,
        to16: 3,
        options: 2,
        name,
        value: &[],
    };
    assert!(one.say(&ask).is_empty());
    let (_, question, _) = one.packets.pop().unwrap();
    two.module.receive(two.now, &question, -50);
    assert!(two.frames(20.0, false).is_empty(), "its host is not asked");
    let (_, said, _) = two.packets.pop().unwrap();
    one.module.receive(one.now, &said, -50);
    let value = &[0, 0x13, 0xA2, 0];
    let from64 = 0x0013_A200_4000_0002;
    let expected = Frame::RemoteAnswer {
        id: 4,
        from64,
        from16: 3,
        name,
        status: 0,
        value,
    };
    assert_eq!(one.frames(500.0, false), [format!("{expected:?}")], "once");
    one.say(&ask);
    let nobody = Frame::RemoteAnswer {
        id: 4,
        from64: 0,
        from16: 3,
        name,
        status: 4,
        value: &[],
    };
    assert_eq!(one.frames(500.0, false), [format!("{nobody:?}")]);
}

#[test]
fn words_work_in_its_command_mode_alone() {
    let mut module = XbeeModule::new(ModuleKind::S1, 77, Noise::new(1));
    module.switch_on(Time::ZERO);
    module.open(9_600);
    let mut host = Host::of(module, ApiMode::Plain);
    let mut words = |text: &str, ms: f64| {
        host.module.write(host.now, text.as_bytes());
        let said = host
            .pass(ms, false)
            .into_iter()
            .flat_map(|(_, bytes)| bytes)
            .collect();
        (String::from_utf8(said).unwrap(), host.packets.len())
    };
    assert_eq!(
        words("ATMY\r", 1_500.0),
        (String::new(), 1),
        "it is sent on the air"
    );
    assert_eq!(words("+++", 900.0).0, "");
    assert_eq!(words("", 300.0).0, "OK\r");
    assert_eq!(
        words(
            "ATMY 1F\rATMY\rATSH\rATNIbox\rATNI\rATZZ\rATCH 99\rhello\r",
            500.0
        )
        .0,
        "OK\r1F\r0\rOK\rbox\rERROR\rERROR\rERROR\r"
    );
    assert_eq!(words("ATCN\r", 100.0), ("OK\r".to_owned(), 1));
    assert_eq!(words("ATMY\r", 1_500.0).1, 2);
    words("+++", 1_200.0);
    words("", 10_100.0);
    assert_eq!(
        words("ATMY\r", 100.0).1,
        3,
        "it is left when nothing is said for long"
    );
    assert_eq!(host.module.register(PL), Some(vec![4]));
}

#[test]
fn at_another_baud_rate_bytes_are_garbage_or_nothing() {
    let mut host = Host::new(ModuleKind::Xbee3);
    host.module.open(57_600);
    let mut bytes = Vec::new();
    for _ in 0..100 {
        encode(
            &Frame::Command {
                id: 9,
                name: MY,
                value: &[],
            },
            ApiMode::Escaped,
            &mut bytes,
        )
        .unwrap();
        host.module.receive(host.now, &packet(&[7; 60]), -61);
        let heard: Vec<u8> = host
            .pass(10.0, false)
            .into_iter()
            .flat_map(|(_, bytes)| bytes)
            .collect();
        assert!(
            (10..70).contains(&heard.len()) && heard != [7; 60],
            "{}",
            heard.len()
        );
    }
    host.module.write(host.now, &bytes);
    let (mut decoder, mut frames) = (Decoder::new(ApiMode::Escaped), 0);
    for (_, bytes) in host.pass(5_000.0, false) {
        decoder.take(&bytes, |_| frames += 1);
    }
    assert_eq!(frames, 0);
    assert!(host.now > at_ms(0.0));
}
