//! The machines of protocols, each against a plain other side over a bad link, with strangers' messages between.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm::mavlink::command_call::CommandCall;
use tomoswarm::mavlink::dialect::{
    COMMAND_LONG_DATA, MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_ITEM_INT_DATA, MavCmd,
    MavMessage, MavMissionResult, PARAM_VALUE_DATA,
};
use tomoswarm::mavlink::frames::MavAddress;
use tomoswarm::mavlink::mission_download::MissionReader;
use tomoswarm::mavlink::mission_upload::{MissionReceiver, MissionSender, Received, UploadEnd};
use tomoswarm::mavlink::parameter_list::{ListEnd, ParameterList};
use tomoswarm::mavlink::parameter_reads::ParameterReads;
use tomoswarm::time::Time;

use crate::chance::Chance;
use crate::channel::Channel;
use crate::noise::message_of;

const OTHER: MavAddress = MavAddress {
    system: 1,
    component: 1,
};
const STEP: Duration = Duration::from_millis(10);
/// After so many steps nobody says anything more.
const SILENT_AFTER: u32 = 2_000;
/// All have ended by then: the longest wait is one of 12 tries or of 10 s.
const OVER_AFTER: u32 = SILENT_AFTER + 1_600;

/// Steps of time; whether anybody but the machine speaks.
fn steps() -> impl Iterator<Item = (Time, bool)> {
    (1..OVER_AFTER).map(|step| (Time::ZERO + STEP * step, step < SILENT_AFTER))
}

pub fn command(chance: &mut Chance) {
    let asked = COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_NAV_LAND,
        ..COMMAND_LONG_DATA::default()
    };
    let mut said = Vec::new();
    let mut call = CommandCall::begin(Time::ZERO, OTHER, asked, &mut said);
    let often = chance.one_of(&[0.0, 0.01, 0.2]);
    for (now, speaks) in steps() {
        if speaks && chance.happens(often) {
            let MavMessage::COMMAND_ACK(mut ack) = message_of(chance, &[77]) else {
                unreachable!()
            };
            if chance.happens(0.3) {
                ack.command = MavCmd::MAV_CMD_NAV_LAND;
            }
            let from = MavAddress {
                component: 1 + chance.below(2) as u8,
                ..OTHER
            };
            if call.hear(now, from, &ack).is_some() {
                assert_eq!((from, ack.command), (OTHER, MavCmd::MAV_CMD_NAV_LAND));
                return;
            }
        }
        if call.due(now, &mut said).is_some() {
            return;
        }
        assert!(call.deadline() > now && said.len() <= 4);
    }
    panic!("it does not end");
}

/// Who receives a mission, as an autopilot would.
#[derive(Default)]
struct Receiving {
    receiver: Option<MissionReceiver>,
    whole: Option<Vec<MISSION_ITEM_INT_DATA>>,
}

impl Receiving {
    fn hear(&mut self, now: Time, message: &MavMessage, out: &mut Vec<MavMessage>) {
        let judged = || {
            MavMessage::MISSION_ACK(MISSION_ACK_DATA {
                mavtype: MavMissionResult::MAV_MISSION_ACCEPTED,
                ..Default::default()
            })
        };
        match (message, &mut self.receiver) {
            (MavMessage::MISSION_COUNT(count), _) if count.count == 0 => {
                (self.receiver, self.whole) = (None, Some(Vec::new()));
                out.push(judged());
            }
            (MavMessage::MISSION_COUNT(count), receiver) => {
                *receiver = Some(MissionReceiver::begin(now, OTHER, count.count, out))
            }
            (MavMessage::MISSION_ITEM_INT(item), Some(receiver)) => {
                if let Received::Whole(items) = receiver.hear(now, item, out) {
                    (self.receiver, self.whole) = (None, Some(items));
                    out.push(judged());
                }
            }
            _ => {}
        }
    }

    fn due(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        let Some(receiver) = &mut self.receiver else {
            return;
        };
        if receiver.due(now, out) == Received::Gone {
            self.receiver = None;
        } else {
            assert!(receiver.deadline() > now);
        }
    }
}

pub fn upload(chance: &mut Chance) {
    let items: Vec<MISSION_ITEM_INT_DATA> = (0..chance.below(40))
        .map(|_| MISSION_ITEM_INT_DATA {
            x: chance.below(1 << 30) as i32,
            ..Default::default()
        })
        .collect();
    let noise = chance.one_of(&[0.0, 0.0, 0.01, 0.2]);
    let (mut there, mut back) = (Channel::drawn(chance), Channel::drawn(chance));
    let (mut said, mut answers) = (Vec::new(), Vec::new());
    let mut sender = MissionSender::begin(Time::ZERO, OTHER, items.clone(), &mut said);
    let (mut receiving, mut end) = (Receiving::default(), None);
    for (now, speaks) in steps() {
        said.drain(..)
            .for_each(|message| there.send(now, chance, message));
        for message in there.come(now).into_iter().filter(|_| speaks) {
            receiving.hear(now, &message, &mut answers);
        }
        receiving.due(now, &mut answers);
        if speaks && chance.happens(noise) {
            receiving.hear(now, &message_of(chance, &[44, 73]), &mut answers);
            answers.push(message_of(chance, &[40, 51, 47, 44, 73]));
        }
        assert!(answers.len() < 10);
        answers
            .drain(..)
            .for_each(|message| back.send(now, chance, message));
        for message in back.come(now).into_iter().filter(|_| speaks) {
            end = end.or(sender.hear(now, &message, &mut said));
        }
        end = end.or(sender.due(now, &mut said));
        if end.is_some() {
            break;
        }
        assert!(sender.deadline() > now);
    }
    let end = end.expect("it does not end");
    if end == UploadEnd::Judged(MavMissionResult::MAV_MISSION_ACCEPTED) && noise == 0.0 {
        let places = |items: Vec<MISSION_ITEM_INT_DATA>| {
            items
                .into_iter()
                .map(|item| (item.seq, item.x))
                .collect::<Vec<_>>()
        };
        let sent = items
            .into_iter()
            .enumerate()
            .map(|(seq, item)| (seq as u16, item.x))
            .collect::<Vec<_>>();
        assert_eq!(receiving.whole.map(places), Some(sent));
    }
}

pub fn download(chance: &mut Chance) {
    let places: Vec<i32> = (0..chance.below(40))
        .map(|_| chance.below(1 << 30) as i32)
        .collect();
    let noise = chance.one_of(&[0.0, 0.0, 0.01, 0.2]);
    let (mut there, mut back) = (Channel::drawn(chance), Channel::drawn(chance));
    let mut said = Vec::new();
    let mut reader = MissionReader::begin(Time::ZERO, OTHER, &mut said);
    for (now, speaks) in steps() {
        assert!(said.len() < 10);
        said.drain(..)
            .for_each(|message| there.send(now, chance, message));
        for message in there.come(now).into_iter().filter(|_| speaks) {
            let answer = match message {
                MavMessage::MISSION_REQUEST_LIST(_) => {
                    MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
                        count: places.len() as u16,
                        ..Default::default()
                    })
                }
                MavMessage::MISSION_REQUEST_INT(request) => {
                    MavMessage::MISSION_ITEM_INT(MISSION_ITEM_INT_DATA {
                        seq: request.seq,
                        x: places.get(usize::from(request.seq)).copied().unwrap_or(0),
                        ..Default::default()
                    })
                }
                _ => continue,
            };
            back.send(now, chance, answer);
        }
        let mut heard = back.come(now);
        if speaks && chance.happens(noise) {
            heard.push(message_of(chance, &[44, 73, 47, 51]));
        }
        let mut end = Received::Going;
        for message in heard {
            if end == Received::Going {
                end = reader.hear(now, &message, &mut said);
            }
        }
        if end == Received::Going {
            end = reader.due(now, &mut said);
        }
        match end {
            Received::Going => assert!(reader.deadline() > now),
            Received::Whole(items) if noise == 0.0 => {
                return assert!(items.iter().map(|item| item.x).eq(places));
            }
            Received::Whole(_) | Received::Gone => return,
        }
    }
    panic!("it does not end");
}

fn value(index: u16, count: u16) -> PARAM_VALUE_DATA {
    PARAM_VALUE_DATA {
        param_index: index,
        param_count: count,
        param_value: f32::from(index),
        param_id: format!("P{index}").as_str().into(),
        ..Default::default()
    }
}

pub fn list(chance: &mut Chance) {
    let count = chance.one_of(&[0, 1, 20, 300]);
    let noise = chance.one_of(&[0.0, 0.0, 0.01, 0.2]);
    let (mut there, mut back) = (Channel::drawn(chance), Channel::drawn(chance));
    let (mut said, mut told) = (Vec::new(), Vec::new());
    let mut list = ParameterList::begin(Time::ZERO, OTHER, &mut said);
    for (now, speaks) in steps() {
        assert!(said.len() <= 20);
        said.drain(..)
            .for_each(|message| there.send(now, chance, message));
        for message in there.come(now) {
            match message {
                MavMessage::PARAM_REQUEST_LIST(_) => told.extend(0..count),
                MavMessage::PARAM_REQUEST_READ(read) => told.extend(
                    u16::try_from(read.param_index)
                        .ok()
                        .filter(|index| *index < count),
                ),
                other => panic!("{other:?}"),
            }
        }
        for index in told.drain(..told.len().min(5)).filter(|_| speaks) {
            back.send(now, chance, value(index, count));
        }
        let mut heard = back.come(now);
        if speaks
            && chance.happens(noise)
            && let MavMessage::PARAM_VALUE(value) = message_of(chance, &[22])
        {
            heard.push(value);
        }
        let end = heard
            .iter()
            .fold(None, |end, value| end.or_else(|| list.hear(now, value)));
        match end.or_else(|| list.due(now, &mut said)) {
            Some(ListEnd::Whole(values)) if noise == 0.0 => {
                let values: Vec<f32> = values.iter().map(|parameter| parameter.value).collect();
                let expected: Vec<f32> = (0..count).map(f32::from).collect();
                assert_eq!(values, expected);
                return;
            }
            Some(_) => return,
            None => assert!(list.deadline() > now),
        }
    }
    panic!("it does not end");
}

pub fn reads(chance: &mut Chance) {
    let names = &[
        "FS_ACTION",
        "BATT_MONITOR",
        "NO_SUCH",
        "WP_SPEED",
        "SYSID_MYGCS",
    ][..1 + chance.below(5)];
    let noise = chance.one_of(&[0.0, 0.05]);
    let (mut there, mut back) = (Channel::drawn(chance), Channel::drawn(chance));
    let (mut reads, mut known) = (
        ParameterReads::begin(Time::ZERO, OTHER, names),
        BTreeMap::<String, Vec<f32>>::new(),
    );
    for (now, speaks) in steps() {
        let mut said = Vec::new();
        reads.due(now, &mut said);
        assert!(said.len() <= names.len());
        said.into_iter()
            .for_each(|message| there.send(now, chance, message));
        for message in there.come(now).into_iter().filter(|_| speaks) {
            let MavMessage::PARAM_REQUEST_READ(read) = message else {
                panic!("{message:?}")
            };
            let name = read.param_id.to_str().unwrap();
            if name != "NO_SUCH" {
                let value = PARAM_VALUE_DATA {
                    param_id: name.into(),
                    param_value: chance.below(9) as f32,
                    ..Default::default()
                };
                back.send(now, chance, value);
            }
        }
        let mut heard = back.come(now);
        if speaks
            && chance.happens(noise)
            && let MavMessage::PARAM_VALUE(value) = message_of(chance, &[22])
        {
            heard.push(value);
        }
        for value in heard {
            known
                .entry(value.param_id.to_str().unwrap_or_default().to_owned())
                .or_default()
                .push(value.param_value);
            reads.hear(&value);
        }
        for (name, value) in reads.values() {
            let last = known[*name].last().unwrap();
            assert!(last.to_bits() == value.to_bits(), "{name}");
        }
        let Some(deadline) = reads.deadline() else {
            return assert!(reads.is_over());
        };
        assert!(deadline > now);
    }
    panic!("it does not end");
}
