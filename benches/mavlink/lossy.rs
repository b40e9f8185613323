//! What takes several messages, over a link that loses some of them: parameters of an autopilot that tells them as fast as
//! ArduPilot does over a fast link, and missions of a simulated vehicle.

use std::time::Duration;

use tomoswarm::autopilot::Item;
use tomoswarm::geom::Point;
use tomoswarm::mavlink::dialect::{
    MISSION_ITEM_INT_DATA, MavMessage, MavMissionResult, PARAM_VALUE_DATA,
};
use tomoswarm::mavlink::frames::{Content, FrameReader, FrameWriter, MavAddress};
use tomoswarm::mavlink::items::to_wire;
use tomoswarm::mavlink::mission_download::MissionReader;
use tomoswarm::mavlink::mission_upload::{MissionSender, Received, UploadEnd};
use tomoswarm::mavlink::parameter_list::{ListEnd, ParameterList};
use tomoswarm::sim::environment::Environment;
use tomoswarm::sim::mavlink_fleet::MavlinkFleet;
use tomoswarm::time::Time;

use crate::chance::Chance;
use crate::channel::Channel;
use crate::hour::{CLIENT, OWN, frame, rovers};
use crate::median_and_worst;

const SEEDS: u64 = 20;
/// Each way.
const LOST: f64 = 0.05;
const LATENCY: Duration = Duration::from_millis(10);
const STEP: Duration = Duration::from_millis(1);
const PARAMETERS: u16 = 1_000;
const ITEMS: usize = 700;
const AUTOPILOT: MavAddress = MavAddress {
    system: 1,
    component: 1,
};
/// So many values it tells at a time, and how often.
const VALUES_AT_ONCE: usize = 5;
const VALUES_EVERY: u32 = 10;
/// Nothing may take longer.
const GIVEN_UP_S: u32 = 600;

pub fn lossy() {
    let lists: Vec<Option<f64>> = (0..SEEDS).map(list).collect();
    print("1,000 parameters", "in < 5 s", &lists);
    let missions: Vec<Mission> = (0..SEEDS).map(|seed| Trip::new(seed).mission()).collect();
    let uploads: Vec<Option<f64>> = missions.iter().map(|one| one.uploaded_s).collect();
    print("700 items stored", "all", &uploads);
    let whole: Vec<Option<f64>> = missions.iter().map(|one| one.verified_s).collect();
    print("700 items read back and the same", "all", &whole);
    let unanswered = missions.iter().filter(|one| !one.is_accepted).count();
    println!("lossy: of {SEEDS} uploads {unanswered} ended without the judgement: it was lost");
}

fn print(what: &str, wanted: &str, took_s: &[Option<f64>]) {
    let done: Vec<f64> = took_s.iter().flatten().copied().collect();
    let count = done.len();
    if count == 0 {
        return println!("lossy: {what}: 0 of {SEEDS} (wanted {wanted})");
    }
    let (median, worst) = median_and_worst(done);
    println!(
        "lossy: {what}: {count} of {SEEDS}, median {median:.2} s, worst {worst:.2} (wanted {wanted})"
    );
}

/// Returns how long the list takes, seconds; `None` when it does not come.
fn list(seed: u64) -> Option<f64> {
    let mut chance = Chance::new(seed);
    let (mut there, mut back) = (Channel::new(LOST, LATENCY), Channel::new(LOST, LATENCY));
    let (mut said, mut told) = (Vec::new(), Vec::new());
    let mut list = ParameterList::begin(Time::ZERO, AUTOPILOT, &mut said);
    for step in 1..GIVEN_UP_S * 1_000 {
        let now = Time::ZERO + STEP * step;
        for message in said.drain(..) {
            there.send(now, &mut chance, message);
        }
        for message in there.come(now) {
            match message {
                MavMessage::PARAM_REQUEST_LIST(_) => told.extend(0..PARAMETERS),
                MavMessage::PARAM_REQUEST_READ(read) => told.push(read.param_index as u16),
                _ => {}
            }
        }
        if step.is_multiple_of(VALUES_EVERY) {
            for index in told.drain(..told.len().min(VALUES_AT_ONCE)) {
                back.send(now, &mut chance, value(index));
            }
        }
        let heard = back.come(now);
        let end = heard.iter().find_map(|value| list.hear(now, value));
        match end.or_else(|| list.due(now, &mut said)) {
            Some(ListEnd::Whole(values)) => {
                let are_right = (0_u16..)
                    .zip(&values)
                    .all(|(index, one)| one.value == f32::from(index));
                assert!(are_right && values.len() == usize::from(PARAMETERS));
                return Some(now.as_secs_f64());
            }
            Some(ListEnd::Silent) => return None,
            None => {}
        }
    }
    None
}

fn value(index: u16) -> PARAM_VALUE_DATA {
    PARAM_VALUE_DATA {
        param_value: f32::from(index),
        param_count: PARAMETERS,
        param_index: index,
        param_id: format!("PARAMETER_{index}").as_str().into(),
        ..PARAM_VALUE_DATA::default()
    }
}

/// How a mission has fared.
struct Mission {
    /// When all was stored and that was known, or the last item was stored and the judgement lost, seconds.
    uploaded_s: Option<f64>,
    is_accepted: bool,
    /// When it was read back and found to be the same, seconds.
    verified_s: Option<f64>,
}

/// A simulated vehicle behind a bad link.
struct Trip {
    chance: Chance,
    now: Time,
    environment: Environment,
    fleet: MavlinkFleet,
    there: Channel<Vec<u8>>,
    back: Channel<Vec<u8>>,
    writer: FrameWriter,
}

impl Trip {
    fn new(seed: u64) -> Trip {
        let (environment, fleet) = rovers();
        Trip {
            chance: Chance::new(seed),
            now: Time::ZERO,
            environment,
            fleet,
            there: Channel::new(LOST, LATENCY),
            back: Channel::new(LOST, LATENCY),
            writer: FrameWriter::new(OWN),
        }
    }

    /// Lets a millisecond pass; each message is a packet of its own. Returns what has come.
    fn step(&mut self, said: &mut Vec<MavMessage>) -> Vec<MavMessage> {
        for message in said.drain(..) {
            let mut bytes = Vec::new();
            self.writer.write(&message, None, &mut bytes);
            self.there.send(self.now, &mut self.chance, bytes);
        }
        self.now = self.now + STEP;
        self.environment.wake(self.now, &mut Vec::new());
        let mut answers = Vec::new();
        self.fleet
            .due(self.now, &mut self.environment, &mut answers);
        for bytes in self.there.come(self.now) {
            let (now, environment) = (self.now, &mut self.environment);
            self.fleet
                .hear(now, CLIENT, &bytes, environment, &mut answers);
        }
        for (_, bytes) in answers {
            for bytes in frames_of(&bytes) {
                self.back.send(self.now, &mut self.chance, bytes.to_vec());
            }
        }
        let mut reader = FrameReader::default();
        self.back
            .come(self.now)
            .iter()
            .for_each(|bytes| reader.push(bytes));
        let of_ours =
            std::iter::from_fn(|| reader.next(None)).filter(|frame| frame.from == AUTOPILOT);
        let messages = of_ours.filter_map(|frame| match frame.content {
            Content::Message(message) => Some(*message),
            Content::EkfStatus(_) | Content::UnknownCommand { .. } => None,
        });
        messages.collect()
    }

    fn mission(mut self) -> Mission {
        let items: Vec<MISSION_ITEM_INT_DATA> = (0..ITEMS)
            .map(|index| {
                let item = Item::Waypoint {
                    at: Point::new(index as f64 * 0.5, 3.0),
                    altitude_m: 0.0,
                    delay: Duration::ZERO,
                };
                to_wire(&item, &frame()).unwrap()
            })
            .collect();
        let end = self.upload(items.clone());
        let uploaded_s = self.now.as_secs_f64();
        let stored = self.download();
        let place = |item: &MISSION_ITEM_INT_DATA| (item.command, item.x, item.y, item.z);
        let is_same =
            stored.is_some_and(|stored| stored.iter().map(place).eq(items.iter().map(place)));
        let is_accepted = end == Some(UploadEnd::Judged(MavMissionResult::MAV_MISSION_ACCEPTED));
        Mission {
            uploaded_s: is_same.then_some(uploaded_s),
            is_accepted,
            verified_s: is_same.then_some(self.now.as_secs_f64()),
        }
    }

    fn upload(&mut self, items: Vec<MISSION_ITEM_INT_DATA>) -> Option<UploadEnd> {
        let mut said = Vec::new();
        let mut sender = MissionSender::begin(self.now, AUTOPILOT, items, &mut said);
        for _ in 0..GIVEN_UP_S * 1_000 {
            let heard = self.step(&mut said);
            let end = heard
                .iter()
                .find_map(|message| sender.hear(self.now, message, &mut said));
            if let Some(end) = end.or_else(|| sender.due(self.now, &mut said)) {
                return Some(end);
            }
        }
        None
    }

    /// Reads what is stored.
    fn download(&mut self) -> Option<Vec<MISSION_ITEM_INT_DATA>> {
        let mut said = Vec::new();
        let mut reader = MissionReader::begin(self.now, AUTOPILOT, &mut said);
        for _ in 0..GIVEN_UP_S * 1_000 {
            let mut received = Received::Going;
            for message in self.step(&mut said) {
                if received == Received::Going {
                    received = reader.hear(self.now, &message, &mut said);
                }
            }
            if received == Received::Going {
                received = reader.due(self.now, &mut said);
            }
            match received {
                Received::Going => {}
                Received::Whole(items) => return Some(items),
                Received::Gone => return None,
            }
        }
        None
    }
}

/// Returns the frames that bytes are made of.
fn frames_of(mut bytes: &[u8]) -> Vec<&[u8]> {
    let mut frames = Vec::new();
    while !bytes.is_empty() {
        let (frame, rest) = bytes.split_at(tomoswarm::mavlink::frames::fitting(bytes, 1));
        frames.push(frame);
        bytes = rest;
    }
    frames
}
