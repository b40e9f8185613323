//! The radio actor: beacons in turn by a token ring without common clocks, and samples of what is heard.
//!
//! It is told what the radio driver heard or could not send, where the vehicle is, how far the mission is, and for which
//! run to measure. It says
//! beacons, samples, and what peers' beacons tell. It never waits for the bus: a gap costs samples, nothing else. Its
//! beacons name an emergency stop that is open, and go out without a place too.
//!
//! Beacons are numbered without gaps, so that a gap is a miss: data of a link that was too weak. A beacon that never went
//! on the air gives its number back; one that comes twice, or after a newer one, is no news. What was called missed when
//! a newer one came stays so.
//!
//! Members of the ring are the ids heard, or listed in a heard beacon, in the last 5 s, and oneself, ascending. A
//! beacon lists only those heard directly, so that one that has fallen silent leaves everybody's ring.
//! After hearing m, member k speaks in slot distance(m, k) · T plus jitter; each newly heard beacon restarts
//! the wait; own silence is at most (members + 1) · T.
//!
//! ```text
//!   Waiting ─own slot─► speak ─► Waiting (silence limit)      Waiting ─beacon heard─► Waiting (slot after it)
//! ```
//!
//! Deadline: `own slot`.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    BEACON_MEMBERS_MAX, Beacon, Boot, EmergencyStop, PoseReport, Progress, RunId, Sample, VehicleId,
};

use super::place::Place;
use super::{OwnState, Settings};
use crate::actor::{Actor, Class, Fault, Input};
use crate::geom::Pose;
use crate::sweep::VehicleProgress;
use crate::time::{Deadline, Time};

/// Members not heard of for this long leave the ring.
const MEMBER_FOR: Duration = Duration::from_secs(5);
/// Shares of a slot between which somebody who is not listed yet speaks, so as not to meet a member.
const JOIN_FROM: f64 = 0.15;
const JOIN_UNTIL: f64 = 0.85;
/// A gap of more beacons than this is a new start, not that many misses.
const MISSES_MAX: u32 = 200;
/// So many beacons that were not sent are remembered while newer ones were said already.
const UNSENT_MAX: usize = 16;

/// A beacon that came in.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Heard {
    /// What it said.
    pub beacon: Beacon,
    /// Received signal strength, dBm.
    pub rssi_dbm: i16,
}

/// What the radio actor can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// A beacon came in.
    Heard(Heard),
    /// The beacon of this sequence never went on the air.
    Unsent(u32),
    /// Where the vehicle is.
    State(OwnState),
    /// How far the mission is.
    Progress(Progress),
    /// For which run to measure; `None` = not at all.
    Measure(Option<RunId>),
    /// Which emergency stops are open.
    Stops(Vec<EmergencyStop>),
}

/// What the radio actor can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// Send this.
    Transmit(Beacon),
    /// A beacon heard, or missed, in a run.
    Sample(RunId, Sample),
    /// What a peer's beacon tells of it.
    Peer(Sighting),
    /// A peer's beacon names an emergency stop.
    Stop(VehicleId, EmergencyStop),
}

/// What a beacon tells of its sender, whatever it was measured for.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Sighting {
    /// Where it believes to be; `None` = it does not know.
    pub pose: Option<PoseReport>,
    /// How far it is with its plan; also tells who it is, and the start of its software.
    pub progress: VehicleProgress,
}

/// The radio actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Radio {
    settings: Settings,
    place: Place,
    /// Whether the vehicle was at rest, and whether its motors had current, when it was heard of last.
    is_at_rest: bool,
    is_armed: bool,
    progress: Progress,
    measures: Option<RunId>,
    /// The emergency stops that are open; each beacon names one of them.
    stops: Vec<EmergencyStop>,
    /// When each member was last heard, or heard of.
    members: BTreeMap<VehicleId, Time>,
    heard: BTreeMap<VehicleId, Last>,
    /// Of the last beacon said that has not been taken back.
    sequence: u32,
    /// Beacons that were not sent, but newer ones were said before that was known.
    unsent: BTreeSet<u32>,
    /// When somebody last listed this vehicle among those heard.
    listed_at: Option<Time>,
    draws: u64,
    samples: BTreeMap<RunId, u64>,
    slot_at: Time,
}

/// The last beacon of a peer.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Last {
    boot: Boot,
    sequence: u32,
    /// When it was heard.
    at: Time,
    /// Where it believed to be, if it knew.
    pose: Option<PoseReport>,
    /// Where the receiver was then, if it knew.
    receiver: Option<Pose>,
}

impl Radio {
    /// Makes the actor; it speaks for the first time after its own share of the first round.
    pub fn new(settings: Settings) -> Radio {
        let slot_at = Time::ZERO + settings.radio.slot * (1 + u32::from(settings.vehicle.0));
        Radio {
            place: Place::unknown(settings.swarm.pose_sd_max_m),
            stops: settings.stops.open.clone(),
            settings,
            is_at_rest: false,
            is_armed: false,
            progress: Progress::default(),
            measures: None,
            members: BTreeMap::new(),
            heard: BTreeMap::new(),
            sequence: 0,
            unsent: BTreeSet::new(),
            listed_at: None,
            draws: 0,
            samples: BTreeMap::new(),
            slot_at,
        }
    }

    /// Gives how many samples of a run were made.
    pub fn samples_made(&self, run: RunId) -> u64 {
        self.samples.get(&run).copied().unwrap_or_default()
    }

    fn heard(&mut self, now: Time, heard: Heard, out: &mut Vec<Out>) {
        let beacon = heard.beacon;
        if beacon.sender == self.settings.vehicle || !self.is_news(now, &beacon) {
            return;
        }
        let own = self.settings.vehicle;
        for member in beacon.members.iter().chain([&beacon.sender]).filter(|member| **member != own) {
            self.members.insert(*member, now);
        }
        if beacon.members.contains(&own) {
            self.listed_at = Some(now);
        }
        out.extend(beacon.stop.map(|stop| Out::Stop(beacon.sender, stop)));
        let progress = VehicleProgress::of(beacon.sender, beacon.boot, beacon.progress);
        out.push(Out::Peer(Sighting { pose: beacon.pose, progress }));
        self.sample(now, &beacon, heard.rssi_dbm, out);
        let (boot, sequence, pose) = (beacon.boot, beacon.sequence, beacon.pose);
        let last = Last { boot, sequence, at: now, pose, receiver: self.place.pose(now) };
        self.heard.insert(beacon.sender, last);
        self.slot_at = now + self.wait_after(now, beacon.sender);
    }

    /// Returns whether a beacon is newer than all that were heard of its sender. A start of the sender's software that is
    /// lower than the one heard last counts again when that one has left the ring.
    fn is_news(&self, now: Time, beacon: &Beacon) -> bool {
        self.heard.get(&beacon.sender).is_none_or(|last| {
            let has_left = beacon.boot < last.boot && now.since(last.at) > MEMBER_FOR;
            (beacon.boot, beacon.sequence) > (last.boot, last.sequence) || has_left
        })
    }

    /// Takes the number of a beacon back that was not sent, so that peers see no gap: at once when nothing was said since,
    /// or else when all that was said since comes back as well. Behind one that was sent it stays a gap.
    fn take_back(&mut self, sequence: u32) {
        if sequence == 0 || sequence > self.sequence {
            return;
        }
        self.unsent.insert(sequence);
        while self.unsent.remove(&self.sequence) {
            self.sequence -= 1;
        }
        if self.unsent.len() > UNSENT_MAX {
            self.unsent.pop_first();
        }
    }

    /// Returns whose own beacons were heard lately, ascending; of more than a beacon names, those heard last.
    fn heard_lately(&self, now: Time) -> Vec<VehicleId> {
        let lately = self.heard.iter().filter(|(_, last)| now.since(last.at) <= MEMBER_FOR);
        let mut lately: Vec<(Time, VehicleId)> = lately.map(|(id, last)| (last.at, *id)).collect();
        lately.sort_unstable_by(|a, b| b.cmp(a));
        lately.truncate(BEACON_MEMBERS_MAX);
        let mut members: Vec<VehicleId> = lately.into_iter().map(|(_, id)| id).collect();
        members.sort_unstable();
        members
    }

    /// Returns the open stop that the next beacon names: one after the other.
    fn named_stop(&self) -> Option<EmergencyStop> {
        let count = u32::try_from(self.stops.len()).unwrap_or(u32::MAX);
        let index = self.sequence.checked_rem(count)?;
        self.stops.get(index as usize).copied()
    }

    /// Gives how long to wait after a member has spoken: its distance in the ring, in slots.
    fn wait_after(&mut self, now: Time, speaker: VehicleId) -> Duration {
        self.members.retain(|_, at| now.since(*at) <= MEMBER_FOR);
        let own = self.settings.vehicle;
        let between = |from: VehicleId, to: VehicleId| {
            self.members.keys().filter(|member| **member > from && **member < to).count()
        };
        let distance = if speaker < own {
            between(speaker, own) + 1
        } else {
            self.members.len() - between(own, speaker)
        };
        if self.is_listed(now) {
            return self.settings.radio.slot * distance as u32 + self.jitter();
        }
        self.wait_to_join()
    }

    /// Tells whether somebody has listed this vehicle lately, so that the others leave its slot free.
    fn is_listed(&self, now: Time) -> bool {
        self.listed_at.is_some_and(|at| now.since(at) <= MEMBER_FOR)
    }

    /// Gives a wait that ends in the middle of a slot, drawn anew each time. The members of a ring speak at the
    /// beginnings of all slots, and all who do not know of each other yet would answer in the same one.
    fn wait_to_join(&mut self) -> Duration {
        let share = (self.draw() >> 11) as f64 / (1u64 << 53) as f64;
        self.settings.radio.slot.mul_f64(JOIN_FROM + (JOIN_UNTIL - JOIN_FROM) * share)
    }

    /// Gives up to a tenth of a slot, drawn anew each time.
    fn jitter(&mut self) -> Duration {
        self.settings.radio.slot * ((self.draw() >> 56) as u32) / 2560
    }

    /// Draws the next of a sequence of numbers of its own (SplitMix64).
    fn draw(&mut self) -> u64 {
        self.draws += 1;
        let own = (u64::from(self.settings.vehicle.0) << 32) | u64::from(self.settings.boot.0);
        let mut mixed = own.wrapping_add(self.draws).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    fn sample(&mut self, now: Time, beacon: &Beacon, rssi_dbm: i16, out: &mut Vec<Out>) {
        let Some(receiver_pose) = self.place.pose(now) else { return };
        let Some(run) = self.measures else { return };
        if beacon.progress.run != run {
            return; // the two are not of one run: nobody would know what was measured
        }
        let Some(transmitter_pose) = beacon.pose else { return }; // and here not from where
        let missed = self.misses(beacon);
        let last = self.heard.get(&beacon.sender);
        let last_pose = last.and_then(|last| last.pose).unwrap_or(transmitter_pose);
        let last_receiver = last.and_then(|last| last.receiver).unwrap_or(receiver_pose);
        for share in 1..=missed {
            let along = f64::from(share) / f64::from(missed + 1);
            let transmitter_then = between(last_pose.into(), transmitter_pose.into(), along).into();
            let receiver_then = between(last_receiver, receiver_pose, along);
            self.say(now, run, beacon, transmitter_then, receiver_then, None, out);
        }
        if Pose::from(transmitter_pose).sd_m <= self.settings.swarm.pose_sd_max_m {
            self.say(now, run, beacon, transmitter_pose, receiver_pose, Some(rssi_dbm), out);
        }
    }

    /// Gives how many beacons of the sender were missed since the last one heard.
    fn misses(&self, beacon: &Beacon) -> u32 {
        let Some(last) = self.heard.get(&beacon.sender) else { return 0 };
        let gap = beacon.sequence.saturating_sub(last.sequence).saturating_sub(1);
        if last.boot == beacon.boot && gap <= MISSES_MAX { gap } else { 0 }
    }

    #[allow(clippy::too_many_arguments, reason = "one sample is made of all of these")]
    fn say(
        &mut self,
        now: Time,
        run: RunId,
        beacon: &Beacon,
        transmitter_pose: PoseReport,
        receiver_pose: Pose,
        rssi_dbm: Option<i16>,
        out: &mut Vec<Out>,
    ) {
        let count = self.samples.entry(run).or_default();
        let sample = Sample {
            sequence: *count,
            heard_at_ns: now.as_nanos(),
            transmitter: beacon.sender,
            transmitter_pose,
            receiver_pose: receiver_pose.into(),
            channel: beacon.channel,
            power_dbm: beacon.power_dbm,
            rssi_dbm,
        };
        *count += 1;
        out.push(Out::Sample(run, sample));
    }
}

fn between(from: Pose, to: Pose, share: f64) -> Pose {
    Pose { at: from.at.toward(to.at, share), ..to }
}

impl Actor for Radio {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Heard(heard) => self.heard(now, heard, out),
            In::Unsent(sequence) => self.take_back(sequence),
            In::State(state) => {
                self.place.take(now, &state);
                (self.is_at_rest, self.is_armed) = (state.is_at_rest, state.is_armed);
            }
            In::Progress(progress) => self.progress = progress,
            In::Measure(run) => self.measures = run,
            In::Stops(open) => self.stops = open,
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        Some(Deadline { at: self.slot_at, why: "own slot" })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.members.retain(|_, at| now.since(*at) <= MEMBER_FOR);
        let ring = self.members.len() as u32 + 1;
        let silence = self.settings.radio.slot * (ring + 1);
        self.slot_at = now + silence - self.jitter();
        self.sequence = self.sequence.saturating_add(1);
        out.push(Out::Transmit(Beacon {
            sender: self.settings.vehicle,
            boot: self.settings.boot,
            sequence: self.sequence,
            pose: self.place.pose(now).map(Into::into),
            channel: self.settings.radio.channel,
            power_dbm: self.settings.radio.power_dbm,
            is_at_rest: self.is_at_rest,
            is_armed: self.is_armed,
            is_airborne: false,
            members: self.heard_lately(now),
            progress: self.progress,
            stop: self.named_stop(),
            tag: None,
        }));
        Ok(())
    }
}

impl Input for In {
    type Key = u8;

    fn class(&self) -> Class<u8> {
        match self {
            In::Heard(_) | In::Unsent(_) => Class::Queue,
            In::State(_) => Class::Latest(0),
            In::Progress(_) => Class::Latest(1),
            In::Measure(_) => Class::Latest(2),
            In::Stops(_) => Class::Latest(3),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{own_state, settings, state};
    use super::*;
    use proptest::prelude::*;

    /// Lets radios that hear each other perfectly talk for a while; gives who spoke when.
    fn talk(ids: &[u8], until: Time) -> Vec<(Time, u8, Vec<Out>)> {
        let mut radios: Vec<Radio> = ids.iter().map(|id| Radio::new(settings(*id))).collect();
        let mut spoken = Vec::new();
        loop {
            let due = radios.iter().map(|radio| radio.deadline().unwrap().at).min().unwrap();
            if due > until {
                return spoken;
            }
            let who = radios.iter().position(|radio| radio.deadline().unwrap().at == due).unwrap();
            let mut out = Vec::new();
            for (radio, id) in radios.iter_mut().zip(ids) {
                radio.handle(due, In::State(own_state(f64::from(*id), 0.0)), &mut out).unwrap();
                let progress = Progress { run: RunId(1), ..Progress::default() };
                radio.handle(due, In::Progress(progress), &mut out).unwrap();
            }
            radios[who].wake(due, &mut out).unwrap();
            let Some(Out::Transmit(beacon)) = out.pop() else { continue };
            for (index, radio) in radios.iter_mut().enumerate().filter(|(index, _)| *index != who) {
                let heard = Heard { beacon: beacon.clone(), rssi_dbm: -50 };
                let mut said = Vec::new();
                radio.handle(due + Duration::from_millis(2), In::Heard(heard), &mut said).unwrap();
                spoken.push((due, ids[index], said));
            }
            spoken.push((due, ids[who], vec![Out::Transmit(beacon)]));
        }
    }

    fn speakers(spoken: &[(Time, u8, Vec<Out>)]) -> Vec<u8> {
        let sent = |(_, id, out): &(Time, u8, Vec<Out>)| matches!(out[..], [Out::Transmit(_)]).then_some(*id);
        spoken.iter().filter_map(sent).collect()
    }

    /// Lets radios talk over air on which two that overlap are lost; gives who was heard by all in each second.
    fn talk_on_air(ids: &[u8], seconds: usize) -> Vec<BTreeMap<u8, usize>> {
        let airtime = Duration::from_millis(4);
        let mut radios: Vec<Radio> = ids.iter().map(|id| Radio::new(settings(*id))).collect();
        let mut air: Vec<(Time, usize, Beacon)> = Vec::new();
        let mut heard = vec![BTreeMap::new(); seconds];
        loop {
            let due = radios.iter().map(|radio| radio.deadline().unwrap().at).min().unwrap();
            let ends = air.iter().map(|(start, ..)| *start + airtime).min().filter(|end| *end <= due);
            let now = ends.unwrap_or(due);
            let Some(count) = heard.get_mut(now.as_secs_f64() as usize) else { return heard };
            if ends.is_some() {
                let (start, who, beacon) = air.remove(0);
                let overlapped = air.iter().any(|(other, ..)| *other < start + airtime);
                let lost = overlapped || beacon.power_dbm == i8::MIN;
                if overlapped {
                    // The other one is lost as well.
                    air.iter_mut().for_each(|(_, _, other)| other.power_dbm = i8::MIN);
                }
                if !lost {
                    *count.entry(ids[who]).or_default() += 1;
                    for (radio, _) in radios.iter_mut().zip(ids).filter(|(_, id)| **id != ids[who]) {
                        let heard = Heard { beacon: beacon.clone(), rssi_dbm: -50 };
                        radio.handle(now, In::Heard(heard), &mut Vec::new()).unwrap();
                    }
                }
                continue;
            }
            let who = radios.iter().position(|radio| radio.deadline().unwrap().at == due).unwrap();
            let mut out = Vec::new();
            radios[who].handle(now, In::State(own_state(f64::from(ids[who]), 0.0)), &mut out).unwrap();
            radios[who].wake(now, &mut out).unwrap();
            if let Some(Out::Transmit(beacon)) = out.pop() {
                air.push((now, who, beacon));
            }
        }
    }

    #[test]
    fn a_ring_forms_although_overlapping_beacons_are_lost() {
        for ids in [&[1, 2][..], &[1, 2, 3], &[1, 2, 3, 4], &[3, 4, 9, 200, 201], &[1, 2, 3, 4, 5, 6, 7, 8]] {
            let heard = talk_on_air(ids, 12);
            for second in &heard[1..] {
                assert_eq!(second.len(), ids.len(), "of {ids:?} only {second:?} are heard");
                let (least, most) = (second.values().min().unwrap(), second.values().max().unwrap());
                assert!(*least * 2 >= *most, "of {ids:?} some are heard seldom: {second:?}");
                assert!(second.values().sum::<usize>() >= 14, "the ring of {ids:?} is slow: {second:?}");
            }
        }
    }

    #[test]
    fn members_speak_in_turn() {
        let spoken = talk(&[2, 5, 9], Time::from_secs_f64(3.0));
        let order = speakers(&spoken);
        let steady = &order[order.len() - 9..];
        for three in steady.windows(3) {
            let mut sorted = three.to_vec();
            sorted.sort_unstable();
            assert_eq!(sorted, [2, 5, 9], "{order:?}");
        }
        assert!(order.len() > 45, "{} beacons in 3 s", order.len());
    }

    #[test]
    fn every_beacon_heard_is_a_sample_and_every_gap_a_miss() {
        let mut radio = Radio::new(settings(1));
        let mut out = Vec::new();
        radio.handle(Time::ZERO, In::State(own_state(0.0, 0.0)), &mut out).unwrap();
        let progress = Progress { run: RunId(4), ..Progress::default() };
        radio.handle(Time::ZERO, In::Progress(progress), &mut out).unwrap();
        radio.handle(Time::ZERO, In::Measure(Some(RunId(4))), &mut out).unwrap();
        for (sequence, x_m) in [(7, 0.0), (10, 3.0)] {
            let beacon = Beacon {
                sender: VehicleId(2),
                boot: Boot(1),
                sequence,
                pose: state(2, x_m, 0.0).pose,
                channel: 11,
                power_dbm: 0,
                members: vec![],
                progress: Progress { run: RunId(4), ..Progress::default() },
                ..Beacon::default()
            };
            let heard = Heard { beacon, rssi_dbm: -61 };
            radio.handle(Time::ZERO, In::Heard(heard), &mut out).unwrap();
        }
        let samples: Vec<(u64, f64, Option<i16>)> = out
            .iter()
            .filter_map(|out| match out {
                Out::Sample(_, sample) => {
                    Some((sample.sequence, sample.transmitter_pose.at.x_m(), sample.rssi_dbm))
                }
                Out::Transmit(_) | Out::Peer(_) | Out::Stop(..) => None,
            })
            .collect();
        assert_eq!(samples, [(0, 0.0, Some(-61)), (1, 1.0, None), (2, 2.0, None), (3, 3.0, Some(-61))]);
    }

    #[test]
    fn a_lone_radio_keeps_speaking() {
        assert!(speakers(&talk(&[3], Time::from_secs_f64(1.0))).len() >= 8);
    }

    fn beacon(sender: u8, sequence: u32, x_m: f64, members: Vec<VehicleId>) -> Beacon {
        Beacon {
            sender: VehicleId(sender),
            boot: Boot(1),
            sequence,
            pose: state(sender, x_m, 0.0).pose,
            channel: 11,
            power_dbm: 0,
            members,
            progress: Progress { run: RunId(4), ..Progress::default() },
            ..Beacon::default()
        }
    }

    fn hear(radio: &mut Radio, now_s: f64, beacon: Beacon) -> Vec<Out> {
        let mut out = Vec::new();
        let heard = Heard { beacon, rssi_dbm: -61 };
        radio.handle(Time::from_secs_f64(now_s), In::Heard(heard), &mut out).unwrap();
        out
    }

    #[test]
    fn a_dead_radio_leaves_the_ring_of_those_that_live() {
        let mut radios = [Radio::new(settings(1)), Radio::new(settings(2))];
        let everyone = (0..=255).map(VehicleId).collect();
        hear(&mut radios[0], 0.1, beacon(9, 1, 0.0, everyone));
        let mut last = Vec::new();
        for tick in 1..400 {
            let now_s = 0.1 * f64::from(tick);
            for who in 0..2 {
                let mut out = Vec::new();
                let place = own_state(0.0, 0.0);
                radios[who].handle(Time::from_secs_f64(now_s), In::State(place), &mut out).unwrap();
                radios[who].wake(Time::from_secs_f64(now_s), &mut out).unwrap();
                let Some(Out::Transmit(beacon)) = out.pop() else { panic!("silent") };
                last = beacon.members.clone();
                hear(&mut radios[1 - who], now_s + 0.05, beacon);
            }
        }
        assert_eq!(last, [VehicleId(1)]);
        assert_eq!(radios[0].members.len(), 1, "{:?}", radios[0].members);
    }

    #[test]
    fn of_a_miss_both_ends_are_where_they_were_then() {
        let mut radio = Radio::new(settings(1));
        radio.handle(Time::ZERO, In::Measure(Some(RunId(4))), &mut Vec::new()).unwrap();
        let mut said = Vec::new();
        for (now_s, sequence, y_m) in [(0.0, 7, 0.0), (0.3, 10, 3.0)] {
            let own = In::State(own_state(0.0, y_m));
            radio.handle(Time::from_secs_f64(now_s), own, &mut Vec::new()).unwrap();
            said.extend(hear(&mut radio, now_s, beacon(2, sequence, 5.0, vec![])));
        }
        let receivers: Vec<f64> = said
            .iter()
            .filter_map(|out| match out {
                Out::Sample(_, sample) => Some(sample.receiver_pose.at.y_m()),
                Out::Transmit(_) | Out::Peer(_) | Out::Stop(..) => None,
            })
            .collect();
        assert_eq!(receivers, [0.0, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn a_beacon_names_the_twelve_that_were_heard_last() {
        let mut radio = Radio::new(settings(1));
        for id in 2..=20 {
            // The higher the number the longer ago.
            hear(&mut radio, 3.0 - 0.1 * f64::from(id), beacon(id, 1, 0.0, vec![]));
        }
        let mut out = Vec::new();
        radio.handle(Time::from_secs_f64(3.0), In::State(own_state(0.0, 0.0)), &mut out).unwrap();
        radio.wake(Time::from_secs_f64(3.0), &mut out).unwrap();
        let Some(Out::Transmit(beacon)) = out.pop() else { panic!("silent") };
        assert_eq!(beacon.members, (2..=13).map(VehicleId).collect::<Vec<_>>());
        assert!(beacon.is_at_rest && beacon.is_armed && !beacon.is_airborne);
    }

    #[test]
    fn a_beacon_without_a_place_is_heard_and_measures_nothing() {
        let mut radio = measuring();
        let out = hear(&mut radio, 0.1, Beacon { pose: None, ..beacon(2, 1, 0.0, vec![]) });
        let [Out::Peer(sighting)] = &out[..] else { panic!("{out:?}") };
        assert_eq!((sighting.progress.vehicle, sighting.pose), (VehicleId(2), None));
        assert_eq!(radio.heard_lately(Time::from_secs_f64(0.2)), [VehicleId(2)]);
        let out = hear(&mut radio, 0.2, beacon(2, 2, 3.0, vec![]));
        assert_eq!(out.iter().filter(|out| matches!(out, Out::Sample(..))).count(), 1);
    }

    /// A radio that measures at rest, in run 4.
    fn measuring() -> Radio {
        let mut radio = Radio::new(settings(1));
        for input in [In::Measure(Some(RunId(4))), In::State(own_state(0.0, 0.0))] {
            radio.handle(Time::ZERO, input, &mut Vec::new()).unwrap();
        }
        radio
    }

    /// Lets it hear beacons of vehicle 2 (start of its software, sequence), each sent from as many metres east as its
    /// sequence; gives of which beacon each sample is, and whether that was heard.
    fn samples(radio: &mut Radio, beacons: &[(u32, u32)]) -> Vec<(u32, bool)> {
        let one = |(boot, sequence): &(u32, u32)| {
            let beacon = Beacon { boot: Boot(*boot), ..beacon(2, *sequence, f64::from(*sequence), vec![]) };
            hear(radio, 0.0, beacon)
        };
        let of = |out| match out {
            Out::Sample(_, sample) => {
                Some((sample.transmitter_pose.at.x_m().round() as u32, sample.rssi_dbm.is_some()))
            }
            Out::Transmit(_) | Out::Peer(_) | Out::Stop(..) => None,
        };
        beacons.iter().flat_map(one).filter_map(of).collect()
    }

    #[test]
    fn a_doubled_beacon_makes_no_second_sample() {
        let heard = samples(&mut measuring(), &[(1, 7), (1, 7), (1, 8), (1, 7), (1, 8), (1, 9)]);
        assert_eq!(heard, [(7, true), (8, true), (9, true)]);
    }

    #[test]
    fn a_beacon_that_comes_after_its_successor_makes_no_second_sample_and_no_further_miss() {
        let heard = samples(&mut measuring(), &[(1, 6), (1, 8), (1, 7), (1, 9)]);
        assert_eq!(heard, [(6, true), (7, false), (8, true), (9, true)], "7 was called missed already");
    }

    #[test]
    fn a_doubled_beacon_does_not_restart_the_wait_for_the_own_slot() {
        let mut radio = measuring();
        hear(&mut radio, 1.0, beacon(2, 7, 0.0, vec![VehicleId(1)]));
        let slot = radio.deadline();
        assert!(hear(&mut radio, 1.02, beacon(2, 7, 0.0, vec![VehicleId(1)])).is_empty());
        assert_eq!(radio.deadline(), slot);
    }

    #[test]
    fn a_sequence_does_not_wrap() {
        let mut radio = measuring();
        let sequences = [u32::MAX - 1, u32::MAX, 0, 1];
        let made: usize = sequences.map(|sequence| samples(&mut radio, &[(1, sequence)]).len()).iter().sum();
        assert_eq!(made, 2, "after the last one there is none");
    }

    #[test]
    fn a_late_beacon_of_an_earlier_start_hides_no_miss() {
        let heard = samples(&mut measuring(), &[(1, 40), (2, 1), (1, 41), (2, 3)]);
        assert_eq!(heard, [(40, true), (1, true), (2, false), (3, true)]);
    }

    #[test]
    fn a_sender_that_lost_its_count_of_starts_is_heard_again_once_it_has_left_the_ring() {
        let mut radio = measuring();
        let of = |boot, sequence| Beacon { boot: Boot(boot), ..beacon(2, sequence, 0.0, vec![]) };
        hear(&mut radio, 0.0, of(9, 500));
        assert!(hear(&mut radio, 5.0, of(1, 1)).is_empty());
        assert!(!hear(&mut radio, 5.1, of(1, 2)).is_empty());
    }

    /// Lets it say its next beacon; gives the number.
    fn number(radio: &mut Radio, now_s: f64) -> u32 {
        let (now, mut out) = (Time::from_secs_f64(now_s), Vec::new());
        radio.handle(now, In::State(own_state(0.0, 0.0)), &mut out).unwrap();
        radio.wake(now, &mut out).unwrap();
        let Some(Out::Transmit(beacon)) = out.pop() else { panic!("silent") };
        beacon.sequence
    }

    fn take_back(radio: &mut Radio, sequence: u32) {
        radio.handle(Time::ZERO, In::Unsent(sequence), &mut Vec::new()).unwrap();
    }

    #[test]
    fn a_beacon_that_was_not_sent_gives_its_number_to_the_next_one() {
        let mut radio = Radio::new(settings(1));
        assert_eq!((number(&mut radio, 0.0), number(&mut radio, 0.1)), (1, 2));
        take_back(&mut radio, 2);
        assert_eq!((number(&mut radio, 0.2), number(&mut radio, 0.3)), (2, 3));
        take_back(&mut radio, 9);
        take_back(&mut radio, 0);
        assert_eq!(number(&mut radio, 0.4), 4, "what it never said cannot come back");
    }

    #[test]
    fn behind_a_beacon_that_was_sent_no_number_comes_back() {
        let mut radio = Radio::new(settings(1));
        (1..=3).for_each(|tenth| assert_eq!(number(&mut radio, 0.1 * f64::from(tenth)), tenth));
        take_back(&mut radio, 2);
        assert_eq!(number(&mut radio, 0.4), 4, "3 is on the air: it stays what it is");
    }

    #[test]
    fn beacons_queued_behind_one_that_was_not_sent_come_back_with_it() {
        for order in [[2, 3], [3, 2]] {
            let mut radio = Radio::new(settings(1));
            (1..=3).for_each(|tenth| assert_eq!(number(&mut radio, 0.1 * f64::from(tenth)), tenth));
            order.iter().for_each(|sequence| take_back(&mut radio, *sequence));
            assert_eq!(number(&mut radio, 0.4), 2, "{order:?}");
        }
    }

    proptest! {
        #[test]
        fn every_sequence_from_the_first_heard_to_the_newest_is_one_sample(
            sequences in prop::collection::vec(1..60u32, 1..80),
        ) {
            let beacons: Vec<(u32, u32)> = sequences.iter().map(|sequence| (1, *sequence)).collect();
            let made = samples(&mut measuring(), &beacons);
            let (first, newest) = (sequences[0], *sequences.iter().filter(|it| **it >= sequences[0]).max().unwrap());
            let of: Vec<u32> = made.iter().map(|(sequence, _)| *sequence).collect();
            prop_assert_eq!(of, (first..=newest).collect::<Vec<_>>());
            for (sequence, is_heard) in made {
                prop_assert!(!is_heard || sequences.contains(&sequence));
            }
        }

        #[test]
        fn numbers_on_the_air_rise_and_what_was_not_sent_leaves_a_gap_only_before_one_that_was(
            tries in prop::collection::vec((any::<bool>(), 0..3usize), 1..60),
        ) {
            let mut radio = Radio::new(settings(1));
            // What was not sent since something was last sent, and whether that is known; what is not known yet.
            let (mut open, mut late) = (Vec::<(u32, bool)>::new(), Vec::<(usize, u32)>::new());
            let (mut on_air, mut gaps) = (Vec::new(), 0);
            for (index, (is_sent, delay)) in tries.iter().enumerate() {
                for (_, sequence) in late.extract_if(.., |(at, _)| *at <= index) {
                    take_back(&mut radio, sequence);
                    open.iter_mut().filter(|(of, _)| *of == sequence).for_each(|(_, is_known)| *is_known = true);
                    while open.pop_if(|(_, is_known)| *is_known).is_some() {}
                }
                let sequence = number(&mut radio, 0.1 * index as f64);
                if *is_sent {
                    gaps += open.drain(..).count() as u32;
                    on_air.push(sequence);
                } else {
                    open.push((sequence, false));
                    late.push((index + 1 + delay, sequence));
                }
            }
            prop_assert!(on_air.is_sorted_by(|one, next| one < next), "{:?}", on_air);
            prop_assert_eq!(on_air.last().map_or(0, |last| last - on_air.len() as u32), gaps);
        }
    }
}
