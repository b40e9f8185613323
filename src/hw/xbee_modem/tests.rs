//! The modem and a module that is played by a few lines: it answers what it is asked, and says what a test wants.

use proptest::prelude::*;
use tomoswarm_proto::{Boot, VehicleId};

use super::*;
use crate::hw::xbee_frame::AtName;
use crate::hw::xbee_registers::{AO, AP, MY, NP, READ};

const SETTINGS: ModuleSettings = ModuleSettings {
    vehicle: VehicleId(2),
    network: 0x1A2B,
    channel: 15,
    power_dbm: 8,
    mode: ApiMode::Escaped,
};

fn at_ms(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

fn beacon(sender: u8, number: u32) -> Beacon {
    Beacon {
        sender: VehicleId(sender),
        boot: Boot(7),
        sequence: number,
        channel: 15,
        power_dbm: 8,
        ..Beacon::default()
    }
}

fn bytes_of(frame: &Frame<'_>, mode: ApiMode) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(frame, mode, &mut bytes).unwrap();
    bytes
}

/// A modem with its module.
struct Rig {
    modem: XbeeModem,
    mode: ApiMode,
    registers: Vec<(AtName, Option<Vec<u8>>)>,
    /// Whether it answers questions.
    answers: bool,
    /// Numbers of frames and beacons that the modem has said and nobody has answered.
    sent: Vec<(u8, u32)>,
    unsent: Vec<u32>,
    heard: Vec<HeardBeacon>,
}

impl Rig {
    fn new(changed: &[(AtName, Option<&[u8]>)]) -> Rig {
        let good: [&[u8]; 14] = [
            &[2],
            &[0x20, 0x14],
            &[0x41, 0x42],
            &[0, 0x13, 0xA2, 0],
            &[0x7E, 0x7D, 0x11, 0x13],
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
        let mut registers: Vec<(AtName, Option<Vec<u8>>)> = READ
            .into_iter()
            .zip(good)
            .map(|(name, value)| (name, Some(value.to_vec())))
            .collect();
        for (name, value) in changed {
            registers.retain(|(other, _)| other != name);
            registers.push((*name, value.map(<[u8]>::to_vec)));
        }
        Rig {
            modem: XbeeModem::new(SETTINGS),
            mode: ApiMode::Escaped,
            registers,
            answers: true,
            sent: Vec::new(),
            unsent: Vec::new(),
            heard: Vec::new(),
        }
    }

    /// One whose modem is ready.
    fn ready() -> Rig {
        let mut rig = Rig::new(&[]);
        rig.open(0);
        assert!(rig.modem.is_ready());
        rig
    }

    fn open(&mut self, ms: u64) {
        let mut out = Vec::new();
        self.modem.opened(at_ms(ms), &mut out);
        self.settle(ms, out);
    }

    fn close(&mut self, ms: u64) {
        let mut out = Vec::new();
        self.modem.closed(&mut out);
        self.settle(ms, out);
    }

    fn send(&mut self, ms: u64, number: u32) {
        let mut out = Vec::new();
        self.modem.send(at_ms(ms), beacon(2, number), &mut out);
        self.settle(ms, out);
    }

    fn due(&mut self, ms: u64) {
        let mut out = Vec::new();
        self.modem.due(at_ms(ms), &mut out);
        self.settle(ms, out);
    }

    /// The module says a frame.
    fn say(&mut self, ms: u64, frame: &Frame<'_>) {
        let mut out = Vec::new();
        self.modem
            .take(at_ms(ms), &bytes_of(frame, self.mode), &mut out);
        self.settle(ms, out);
    }

    /// The module says what became of the frame that was said last.
    fn status(&mut self, ms: u64, status: u8) {
        let (id, _) = *self.sent.last().expect("something was sent");
        self.say(ms, &Frame::TransmitStatus { id, status });
    }

    fn peer(&mut self, ms: u64, from: u16, sender: u8) {
        let payload = codec::encode(&Message::Beacon(beacon(sender, 9))).unwrap();
        let frame = Frame::Receive16 {
            from,
            rssi_dbm: -61,
            options: 2,
            payload: &payload,
        };
        self.say(ms, &frame);
    }

    /// Carries out what the modem says until it says nothing more.
    fn settle(&mut self, ms: u64, mut out: Vec<ModemOut>) {
        while !out.is_empty() {
            let mut answers = Vec::new();
            for said in out.drain(..) {
                match said {
                    ModemOut::Write(bytes) => answers.extend(self.answer(&bytes)),
                    ModemOut::Heard(heard) => self.heard.push(heard),
                    ModemOut::Unsent(number) => self.unsent.push(number),
                }
            }
            for answer in answers {
                self.modem.take(at_ms(ms), &answer, &mut out);
            }
        }
    }

    fn answer(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let (mut answers, mode) = (Vec::new(), self.mode);
        Decoder::new(mode).take(bytes, |frame| match frame {
            Frame::Command {
                id,
                name,
                value: [],
            } if self.answers => {
                let known = self.registers.iter().find(|(other, _)| *other == name);
                let value = known.and_then(|(_, value)| value.clone());
                let status = if value.is_some() { 0 } else { 2 };
                let value = value.as_deref().unwrap_or(&[]);
                answers.push(bytes_of(
                    &Frame::CommandAnswer {
                        id,
                        name,
                        status,
                        value,
                    },
                    mode,
                ));
            }
            Frame::Command { value: [], .. } => {}
            Frame::Transmit16 {
                id,
                to: 0xFFFF,
                payload,
                ..
            } => {
                let Ok(codec::Decoded::Message(Message::Beacon(beacon))) = codec::decode(payload)
                else {
                    panic!("no beacon");
                };
                self.sent.push((id, beacon.sequence));
            }
            other => panic!("the modem must not say {other:?}"),
        });
        answers
    }

    fn numbers(&self) -> Vec<u32> {
        self.sent.iter().map(|(_, number)| *number).collect()
    }

    fn troubles(&self, ms: u64) -> Vec<String> {
        let troubles = self.modem.troubles(at_ms(ms));
        troubles.iter().map(ModemTrouble::to_string).collect()
    }
}

#[test]
fn a_module_that_is_as_wanted_is_ready_and_its_registers_are_known() {
    let rig = Rig::ready();
    assert_eq!(rig.modem.registers().get(NP), Some(114));
    assert_eq!(rig.modem.deadline(), None);
    assert!(rig.troubles(0).is_empty());
}

#[test]
fn a_module_that_differs_is_not_used_until_it_is_put_right() {
    let mut rig = Rig::new(&[(MY, Some(&[0, 5]))]);
    rig.open(0);
    let told = "the module is not as wanted: MY is 5, wanted 2: `tomoswarm xbee setup` sets it";
    assert_eq!(rig.troubles(0), [told]);
    rig.send(1, 1);
    rig.peer(2, 3, 3);
    assert_eq!(
        (rig.unsent.as_slice(), rig.heard.len()),
        ([1].as_slice(), 0)
    );
    rig.answers = false;
    rig.due(5_000);
    assert_eq!(rig.troubles(5_000), [told], "it is being asked again");
    (rig.registers, rig.answers) = (Rig::new(&[]).registers, true);
    rig.due(5_200);
    assert!(rig.modem.is_ready() && rig.troubles(5_000).is_empty());
}

#[test]
fn a_module_in_the_other_mode_is_known_as_such() {
    let mut rig = Rig::new(&[(AP, Some(&[1])), (AO, None)]);
    rig.mode = ApiMode::Plain;
    rig.open(0);
    let told = "the module is not as wanted: AP is 1, wanted 2: `tomoswarm xbee setup` sets it";
    assert_eq!(rig.troubles(0), [told]);
}

#[test]
fn a_module_that_does_not_answer_is_asked_for_ever_and_found_when_it_does() {
    let mut rig = Rig::new(&[]);
    rig.answers = false;
    rig.open(0);
    assert!(rig.troubles(500).is_empty(), "it may still answer");
    for ms in (0..60_000).step_by(100) {
        rig.due(ms);
    }
    assert!(rig.troubles(60_000)[0].starts_with("the module does not answer"));
    rig.answers = true;
    for ms in (60_000..62_000).step_by(100) {
        rig.due(ms);
    }
    assert!(rig.modem.is_ready() && rig.troubles(62_000).is_empty());
}

#[test]
fn beacons_are_sent_one_after_the_other_as_the_module_says_that_they_are() {
    let mut rig = Rig::ready();
    for number in 1..=600 {
        rig.send(1, number);
        assert_eq!(rig.numbers().len(), number as usize);
        rig.status(2, 0);
    }
    assert!(
        rig.sent.iter().all(|(id, _)| *id != 0),
        "0 asks for no status"
    );
    assert_eq!(
        rig.modem.health(),
        RadioHealth {
            sent: 600,
            ..RadioHealth::default()
        }
    );
}

#[test]
fn a_beacon_that_did_not_go_on_the_air_gives_its_number_back() {
    let mut rig = Rig::ready();
    rig.send(1, 1);
    rig.status(2, 2);
    rig.send(3, 1);
    rig.status(4, 4);
    rig.send(5, 1);
    rig.due(204);
    assert_eq!(rig.unsent, [1, 1]);
    rig.due(205);
    assert_eq!(rig.unsent, [1, 1, 1]);
    rig.status(206, 0);
    let expected = RadioHealth {
        unsent: 3,
        busy: 1,
        ..RadioHealth::default()
    };
    assert_eq!(
        rig.modem.health(),
        expected,
        "a status that comes too late is none"
    );
    rig.send(300, 1);
    rig.close(301);
    rig.send(302, 1);
    assert_eq!(rig.unsent, [1; 5]);
}

#[test]
fn a_status_of_a_frame_that_was_not_sent_says_nothing_of_the_beacon_in_flight() {
    let mut rig = Rig::ready();
    rig.send(1, 1);
    let (id, _) = rig.sent[0];
    for (other, status) in [(0, 0), (id + 1, 0), (id + 7, 2), (255, 0x74)] {
        rig.say(2, &Frame::TransmitStatus { id: other, status });
    }
    assert_eq!(rig.modem.health(), RadioHealth::default());
    assert!(rig.unsent.is_empty() && rig.troubles(2).is_empty());
    rig.send(3, 2);
    assert_eq!(rig.numbers(), [1], "the second one waits for the first");
    rig.status(4, 0);
    assert_eq!(rig.numbers(), [1, 2]);
    let expected = RadioHealth {
        sent: 1,
        ..RadioHealth::default()
    };
    assert_eq!(rig.modem.health(), expected);
}

#[test]
fn of_beacons_that_come_while_one_is_in_flight_the_newest_is_sent_without_a_gap() {
    let mut rig = Rig::ready();
    for number in 1..=3 {
        rig.send(number.into(), number);
    }
    assert_eq!((rig.numbers(), rig.unsent.clone()), (vec![1], vec![3]));
    rig.status(5, 0);
    assert_eq!(
        rig.numbers(),
        [1, 2],
        "the third one, under the number that is free"
    );
    rig.send(6, 3);
    rig.status(7, 2);
    assert_eq!(
        (rig.numbers(), rig.unsent.clone()),
        (vec![1, 2, 2], vec![3, 3])
    );
}

#[test]
fn a_beacon_that_was_numbered_before_its_actor_read_what_came_back_leaves_no_gap() {
    let mut rig = Rig::ready();
    rig.send(1, 1);
    rig.status(2, 2);
    rig.send(3, 2);
    assert_eq!((rig.numbers(), rig.unsent.clone()), (vec![1], vec![1, 2]));
    rig.send(4, 1);
    assert_eq!(rig.numbers(), [1, 1], "the actor has read both");
    rig.status(5, 0);
    rig.send(6, 2);
    assert_eq!(rig.numbers(), [1, 1, 2]);
}

#[test]
fn an_actor_that_never_reads_what_came_back_is_not_silenced() {
    let mut rig = Rig::ready();
    rig.send(1, 1);
    rig.status(2, 2);
    for number in 2..10 {
        rig.send(10 * u64::from(number), number);
        rig.status(10 * u64::from(number) + 1, 0);
    }
    assert_eq!(rig.numbers(), [1, 5, 6, 7, 8, 9]);
}

#[test]
fn a_module_that_was_reset_is_asked_again_and_sends_nothing_meanwhile() {
    for status in [0, 1] {
        let mut rig = Rig::ready();
        rig.send(1, 1);
        rig.send(2, 2);
        rig.answers = false;
        rig.say(3, &Frame::ModemStatus(status));
        assert_eq!(rig.unsent, [2, 1], "the newest one first");
        assert!(!rig.modem.is_ready());
        rig.say(4, &Frame::ModemStatus(status));
        rig.answers = true;
        rig.due(204);
        assert!(rig.modem.is_ready());
    }
}

#[test]
fn a_module_that_says_no_status_thrice_is_asked_for_its_registers() {
    let mut rig = Rig::ready();
    for time in 1..=3 {
        rig.send(300 * time, 1);
        rig.answers = time < 3;
        rig.due(300 * time + 200);
        assert_eq!(rig.modem.is_ready(), time < 3);
    }
    assert_eq!(rig.unsent, [1; 3]);
}

#[test]
fn a_module_that_answers_and_says_no_status_is_in_trouble_until_it_says_one() {
    let mut rig = Rig::ready();
    for time in 1..=7 {
        rig.send(300 * time, 1);
        rig.due(300 * time + 200);
        assert!(rig.modem.is_ready(), "its registers are read at once");
        assert_eq!(rig.troubles(300 * time + 200).len(), usize::from(time >= 3));
    }
    let told = rig.troubles(2_300);
    assert!(told[0].contains("what became of 7 beacons"), "{told:?}");
    rig.send(2_400, 1);
    rig.status(2_401, 0);
    rig.send(2_700, 2);
    rig.due(2_900);
    assert_eq!(rig.troubles(12_301), [""; 0], "one alone is none");
}

#[test]
fn a_module_that_is_reset_again_and_again_is_in_trouble() {
    let mut rig = Rig::ready();
    for (ms, troubles) in [
        (1_000, 0),
        (40_000, 0),
        (70_000, 0),
        (75_000, 0),
        (80_000, 1),
    ] {
        rig.say(ms, &Frame::ModemStatus(1));
        assert!(rig.modem.is_ready());
        assert_eq!(rig.troubles(ms).len(), troubles, "{ms}");
    }
    let told = rig.troubles(90_000);
    assert!(told[0].contains("was reset 3 times"), "{told:?}");
    assert_eq!(rig.troubles(90_001), [""; 0]);
}

#[test]
fn a_status_may_take_as_long_as_a_slow_port_needs() {
    for (baud, most_ms) in [(115_200, 232), (2_400, 1_166)] {
        let mut rig = Rig::ready();
        let port = XbeePort {
            baud,
            ..XbeePort::default()
        };
        rig.modem = rig.modem.clone().on_port(&port);
        rig.send(1, 1);
        rig.due(most_ms);
        assert_eq!(rig.unsent, [0; 0], "{baud}");
        rig.due(most_ms + 2);
        assert_eq!(rig.unsent, [1], "{baud}");
    }
}

#[test]
fn a_port_that_is_opened_again_is_counted_and_read_anew() {
    let mut rig = Rig::ready();
    rig.close(1);
    assert_eq!((rig.modem.is_ready(), rig.modem.deadline()), (false, None));
    rig.peer(2, 3, 3);
    assert!(rig.heard.is_empty());
    rig.open(1_000);
    assert!(rig.modem.is_ready());
    assert_eq!(rig.modem.health().reopens, 1);
}

#[test]
fn a_peers_beacon_is_heard_with_its_strength() {
    let mut rig = Rig::ready();
    rig.peer(1, 3, 3);
    let payload = codec::encode(&Message::Beacon(beacon(4, 9))).unwrap();
    rig.say(
        2,
        &Frame::Receive64 {
            from: 77,
            rssi_dbm: -80,
            options: 2,
            payload: &payload,
        },
    );
    let heard: Vec<(u8, i16)> = rig
        .heard
        .iter()
        .map(|heard| (heard.beacon.sender.0, heard.rssi_dbm))
        .collect();
    assert_eq!(heard, [(3, -61), (4, -80)]);
    assert!(rig.troubles(2).is_empty());
}

#[test]
fn what_is_no_beacon_is_counted_and_dropped() {
    let mut rig = Rig::ready();
    let good = codec::encode(&Message::Beacon(beacon(3, 9))).unwrap();
    let state = codec::encode(&Message::State(Default::default())).unwrap();
    let (cut, padded) = (&good[..good.len() - 1], [good.as_slice(), &[0]].concat());
    for payload in [b"hello".as_slice(), &[], &state, cut, &padded] {
        rig.say(
            1,
            &Frame::Receive16 {
                from: 3,
                rssi_dbm: -61,
                options: 2,
                payload,
            },
        );
    }
    rig.say(
        2,
        &Frame::Receive16 {
            from: 3,
            rssi_dbm: 0,
            options: 2,
            payload: &good,
        },
    );
    // A frame of one byte, and one with a wrong checksum.
    for frame in [[0x7E, 0, 1, 0x8A, 0x75], [0x7E, 0, 1, 0x8A, 0x76]] {
        rig.modem.take(at_ms(3), &frame, &mut Vec::new());
    }
    assert_eq!((rig.heard.len(), rig.modem.health().bad), (0, 8));
}

#[test]
fn what_is_wrong_on_the_air_is_told_for_10_s() {
    let mut rig = Rig::ready();
    let payload = codec::encode(&Message::Beacon(beacon(3, 9))).unwrap();
    rig.peer(1, 9, 2);
    rig.peer(1, 2, 3);
    rig.peer(1, 4, 3);
    rig.say(
        1,
        &Frame::ReceiveWithoutRssi {
            from64: 7,
            from16: 3,
            options: 2,
            payload: &payload,
        },
    );
    let told = rig.troubles(10_001);
    let expected = [
        "another radio says that it is vehicle 2",
        "another module has the address 2 (MY) of this one",
        "vehicle 3 speaks from the address 4 (MY) of another one",
        "the module says what it hears without the strength: AO=2 is needed",
    ];
    assert_eq!(told.len(), expected.len());
    assert!(
        told.iter()
            .zip(expected)
            .all(|(told, expected)| told.starts_with(expected)),
        "{told:?}"
    );
    let senders: Vec<u8> = rig
        .heard
        .iter()
        .map(|heard| heard.beacon.sender.0)
        .collect();
    assert_eq!(senders, [3, 3], "its own id is nobody else's");
    assert!(rig.troubles(10_002).is_empty());
}

#[test]
fn a_beacon_that_no_packet_carries_is_not_sent() {
    let mut rig = Rig::new(&[(NP, Some(&[60]))]);
    rig.open(0);
    let mut long = beacon(2, 1);
    long.members = (10..60).map(VehicleId).collect();
    let mut out = Vec::new();
    rig.modem.send(at_ms(1), long.clone(), &mut out);
    let length = codec::encode(&Message::Beacon(long)).unwrap().len();
    assert_eq!(out, [ModemOut::Unsent(1)]);
    let told = format!("a beacon of {length} bytes was not sent: a packet carries 60 (NP)");
    assert_eq!(rig.troubles(1), [told]);
    rig.send(2, 1);
    rig.status(3, 0x74);
    assert_eq!(rig.unsent, [1]);
    assert!(
        rig.troubles(3)
            .contains(&"the module sends no packets as long as it says (NP)".to_owned())
    );
}

/// What happens to a modem.
#[derive(Clone, Copy, Debug)]
enum Step {
    Send,
    Status(u8),
    Late,
    Reset,
    Replug,
    Mute(bool),
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        5 => Just(Step::Send),
        3 => Just(Step::Status(0)),
        2 => Just(Step::Status(2)),
        1 => Just(Step::Late),
        1 => Just(Step::Reset),
        1 => Just(Step::Replug),
        1 => any::<bool>().prop_map(Step::Mute),
    ];
    prop::collection::vec(step, 1..120)
}

proptest! {
    #[test]
    fn beacons_on_the_air_have_numbers_without_gaps_and_each_said_is_sent_or_given_back(steps in steps()) {
        let mut rig = Rig::ready();
        let (mut last, mut on_air, mut said, mut ms) = (0, Vec::new(), 0, 1);
        for step in steps {
            ms += 10;
            match step {
                Step::Send => {
                    said += 1;
                    last += 1;
                    rig.send(ms, last);
                }
                Step::Status(status) if !rig.sent.is_empty() => {
                    let (_, number) = rig.sent[rig.sent.len() - 1];
                    let before = rig.modem.health().sent;
                    rig.status(ms, status);
                    on_air.extend((rig.modem.health().sent > before).then_some(number));
                }
                Step::Late => {
                    ms += 1_100;
                    rig.due(ms);
                }
                Step::Reset => rig.say(ms, &Frame::ModemStatus(0)),
                Step::Replug => {
                    rig.close(ms);
                    rig.open(ms);
                }
                Step::Mute(is_mute) => rig.answers = !is_mute,
                Step::Status(_) => {}
            }
            for number in rig.unsent.drain(..) {
                prop_assert_eq!(number, last, "the last one that was said comes back first");
                last -= 1;
            }
        }
        prop_assert!(on_air.iter().copied().eq(1..=on_air.len() as u32), "{:?}", on_air);
        let health = rig.modem.health();
        prop_assert_eq!(u64::from(last) - health.sent, said - health.sent - health.unsent);
    }
}
