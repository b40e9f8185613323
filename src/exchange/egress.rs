//! What a node still has to send: kept by class and topic while the budget is spent, so that a slow link never delays what
//! is urgent, and old news gives way to new. Pure: it is told the time, and sends nothing itself.
//!
//! Urgent frames go at once, whatever was sent before. Of the others the higher class goes first, and while a lower one
//! waits it leaves that an eighth of what it sends: a map that is repaired for minutes holds up no samples. Of one topic only
//! the newest is kept.
//!
//! What is said again and again *piggybacks*: it waits for the next frame that goes at once, and goes with it, or after half
//! a second by itself. A Health that names a trouble does not.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use tomoswarm_proto::codec::{EncodeError, encode};
use tomoswarm_proto::{Message, Topic};

use super::plausibility::Numbers;
use super::table::{Piggyback, Urgency, row};
use super::token_bucket::TokenBucket;
use crate::time::Time;

/// Bytes that may wait at most; beyond that the class that keeps most of them loses its oldest, of equal ones the lower.
const WAITING: usize = 1 << 20;
/// Batches of samples that may wait; further ones are dropped, since their vehicle repeats them. So are lines of its log,
/// and parts of its settings.
const BATCHES: usize = 2;
/// What waits for company goes by itself after this long.
const PIGGYBACKS_WITHIN: Duration = Duration::from_millis(500);
/// It presses as much as a state, with which it travels mostly: classes do not share a packet.
const PIGGYBACK_CLASS: Urgency = Urgency::High;
/// What says the same as this long ago is a repeat.
const REPEATS_AFTER: Duration = Duration::from_millis(750);
/// Of what a class sends, one part in so many is left to each class below that waits.
const SHARE_BELOW: usize = 8;

/// A frame that a node says, with what is to be known to send it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct OutboundFrame {
    /// How much it presses.
    pub class: Urgency,
    /// Of which kind and what about: with the sender, the key under which it is published.
    pub topic: Topic,
    /// Whether a later frame of its topic takes its place.
    pub is_replaced: bool,
    /// Whether it may wait a moment for another one to travel with.
    pub piggybacks: Piggyback,
    /// What others count on from.
    pub numbers: Numbers,
    /// The frame.
    pub frame: Vec<u8>,
}

impl OutboundFrame {
    /// Encodes a message.
    ///
    /// # Errors
    /// It is too long for a frame.
    pub fn of(message: &Message) -> Result<OutboundFrame, EncodeError> {
        let (frame, topic) = (encode(message)?, Topic::of(message));
        let row = row(topic.kind);
        let piggybacks = match message {
            // Who did not hear that it shall stop waits for nothing.
            Message::Standing(stops) if !stops.open.is_empty() => Piggyback::Never,
            // Somebody may have to act on it.
            Message::Health(health) if !health.troubles.is_empty() => Piggyback::Never,
            _ => row.piggybacks,
        };
        Ok(OutboundFrame {
            class: row.class,
            topic,
            is_replaced: row.is_replaced,
            piggybacks,
            numbers: Numbers::of(message),
            frame,
        })
    }
}

/// What waits of one class.
#[derive(Debug, Default)]
struct WaitingClass {
    frames: VecDeque<OutboundFrame>,
    bytes: usize,
    /// Bytes that it may send before what presses more.
    credit: usize,
}

impl WaitingClass {
    fn push(&mut self, offered: OutboundFrame) {
        let older = |known: &&mut OutboundFrame| known.is_replaced && known.topic == offered.topic;
        self.bytes += offered.frame.len();
        match self.frames.iter_mut().find(older) {
            Some(known) => {
                self.bytes -= known.frame.len();
                *known = offered;
            }
            None => self.frames.push_back(offered),
        }
    }

    fn withdraw(&mut self, topic: Topic) {
        self.frames.retain(|frame| frame.topic != topic);
        self.bytes = self.frames.iter().map(|frame| frame.frame.len()).sum();
    }

    fn pop(&mut self) -> Option<OutboundFrame> {
        let frame = self.frames.pop_front()?;
        self.bytes -= frame.frame.len();
        Some(frame)
    }

    /// Returns the length of what goes next.
    fn next_bytes(&self) -> Option<usize> {
        Some(self.frames.front()?.frame.len())
    }

    /// Returns whether it may go before what presses more.
    fn has_credit(&self) -> bool {
        self.next_bytes().is_some_and(|bytes| bytes <= self.credit)
    }
}

/// What waits to be sent.
#[derive(Debug)]
pub struct Egress {
    budget: TokenBucket,
    waiting: BTreeMap<Urgency, WaitingClass>,
    /// What waits for another frame to travel with, and until when.
    for_company: VecDeque<(Time, OutboundFrame)>,
    /// What was said last, and when, of each topic that may piggyback.
    said: BTreeMap<Topic, (Time, Vec<u8>)>,
    dropped: u64,
}

impl Egress {
    /// Makes an egress for so many bytes a second.
    pub fn new(bytes_per_s: u32) -> Egress {
        let per_s = f64::from(bytes_per_s);
        let budget = TokenBucket::new(per_s, per_s / 2.0);
        Egress {
            budget,
            waiting: BTreeMap::new(),
            for_company: VecDeque::new(),
            said: BTreeMap::new(),
            dropped: 0,
        }
    }

    /// Takes a frame: returns it when it may go at once, and what may go with it after it; otherwise keeps it.
    pub fn offer(&mut self, now: Time, offered: OutboundFrame) -> Vec<OutboundFrame> {
        let is_repeat = self.note_said(now, &offered);
        let waits = match offered.piggybacks {
            Piggyback::Never => false,
            Piggyback::Repeats => is_repeat,
            Piggyback::Always => true,
        };
        if waits {
            self.wait_for_company(now, offered);
            return Vec::new();
        }
        if row(offered.topic.kind).piggybacks != Piggyback::Never {
            self.withdraw_older(&offered);
        }
        let mut goes = Vec::from_iter(self.offer_alone(now, offered));
        if !goes.is_empty() {
            let company = std::mem::take(&mut self.for_company).into_iter();
            goes.extend(company.filter_map(|(_, frame)| self.offer_alone(now, frame)));
        }
        goes
    }

    /// Returns whether something newer was offered in the place of a frame: another thread may still be about to send that one.
    pub fn is_outdated(&self, frame: &OutboundFrame) -> bool {
        let newest = self.said.get(&frame.topic);
        newest.is_some_and(|(_, newest)| *newest != frame.frame)
    }

    /// Drops what has waited for company of a topic: what goes by itself is newer. What waits for the budget in the class of the
    /// newer one leaves its place to it ([`WaitingClass::push`]).
    fn withdraw_older(&mut self, newer: &OutboundFrame) {
        self.for_company
            .retain(|(_, frame)| frame.topic != newer.topic);
        if let Some(waiting) = self.waiting.get_mut(&PIGGYBACK_CLASS)
            && newer.class != PIGGYBACK_CLASS
        {
            waiting.withdraw(newer.topic);
        }
    }

    /// Notes what is said of a kind that may piggyback; returns whether it was said a while ago.
    fn note_said(&mut self, now: Time, offered: &OutboundFrame) -> bool {
        if row(offered.topic.kind).piggybacks == Piggyback::Never {
            return false;
        }
        let said = (now, offered.frame.clone());
        let last = self.said.insert(offered.topic, said);
        last.is_some_and(|(at, frame)| frame == offered.frame && now.since(at) >= REPEATS_AFTER)
    }

    /// Keeps a frame until another one goes; of one topic only the newest, for as long as the first one of it would have been.
    fn wait_for_company(&mut self, now: Time, offered: OutboundFrame) {
        let offered = OutboundFrame {
            class: PIGGYBACK_CLASS,
            ..offered
        };
        let mut waiting = self.for_company.iter_mut();
        match waiting.find(|(_, known)| known.topic == offered.topic) {
            Some((_, known)) => *known = offered,
            None => self
                .for_company
                .push_back((now + PIGGYBACKS_WITHIN, offered)),
        }
    }

    fn offer_alone(&mut self, now: Time, offered: OutboundFrame) -> Option<OutboundFrame> {
        if offered.class == Urgency::Urgent {
            self.budget.owe(now, offered.frame.len());
            return Some(offered);
        }
        let is_turn = !self.waiting.iter().any(|(class, waiting)| {
            let goes_first = *class <= offered.class || waiting.has_credit();
            goes_first && !waiting.frames.is_empty()
        });
        if is_turn && self.budget.spend(now, offered.frame.len()) {
            self.give_credit(offered.class, offered.frame.len());
            return Some(offered);
        }
        self.keep(offered);
        None
    }

    /// Returns the next frame that may go now.
    pub fn due(&mut self, now: Time) -> Option<OutboundFrame> {
        let waits_until = self.for_company.front().map(|(until, _)| *until);
        if waits_until.is_some_and(|until| until <= now) {
            let alone = std::mem::take(&mut self.for_company);
            alone.into_iter().for_each(|(_, frame)| self.keep(frame));
        }
        let class = self.next_class()?;
        let waiting = self.waiting.get_mut(&class)?;
        if !self.budget.spend(now, waiting.next_bytes()?) {
            return None;
        }
        let frame = waiting.pop()?;
        let bytes = frame.frame.len();
        // What has waited in vain pays with what it was given meanwhile; who has nothing to send is owed nothing.
        waiting.credit = match waiting.frames.is_empty() {
            true => 0,
            false => waiting.credit.saturating_sub(bytes),
        };
        self.give_credit(class, bytes);
        Some(frame)
    }

    /// Returns when the next frame may go; `None` when nothing waits.
    pub fn next(&self) -> Option<Time> {
        let waiting = self.next_class().map(|_| self.budget.next());
        let for_company = self.for_company.front().map(|(until, _)| *until);
        waiting.into_iter().chain(for_company).min()
    }

    /// Returns how many frames were dropped because too much waited, or too many batches of one kind.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Returns which class goes next: the lowest one whose share covers what it has, or else the highest.
    fn next_class(&self) -> Option<Urgency> {
        let on_credit = self.waiting.iter().rev().find(|(_, of)| of.has_credit());
        let highest = || self.waiting.iter().find(|(_, of)| !of.frames.is_empty());
        on_credit.or_else(highest).map(|(class, _)| *class)
    }

    /// Leaves the classes below one, where they wait, their share of what it sends.
    fn give_credit(&mut self, class: Urgency, bytes: usize) {
        for (below, waiting) in &mut self.waiting {
            if *below > class && !waiting.frames.is_empty() {
                waiting.credit += bytes.div_ceil(SHARE_BELOW);
            }
        }
    }

    fn keep(&mut self, offered: OutboundFrame) {
        let waiting = self.waiting.entry(offered.class).or_default();
        let is_alike =
            |frame: &&OutboundFrame| !frame.is_replaced && frame.topic.kind == offered.topic.kind;
        let is_batch = offered.class == Urgency::Low && !offered.is_replaced;
        if is_batch && waiting.frames.iter().filter(is_alike).count() >= BATCHES {
            self.dropped += 1;
            return;
        }
        waiting.push(offered);
        while self.bytes() > WAITING {
            let fullest = self.waiting.values_mut().max_by_key(|of| of.bytes);
            if fullest.and_then(WaitingClass::pop).is_none() {
                return;
            }
            self.dropped += 1;
        }
    }

    fn bytes(&self) -> usize {
        self.waiting.values().map(|of| of.bytes).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{LayerId, MessageKind, MessageSubject, TileAddress, VehicleId};

    /// The names of topics below, apart from tiles.
    const NAMES: [&str; 6] = ["first", "second", "order", "state", "samples", "tile"];

    /// Returns a topic of its own for every name; `tile/7` is a tile.
    fn topic(name: &str) -> Topic {
        let about = match name.strip_prefix("tile/") {
            Some(number) => {
                let address = TileAddress {
                    x: number.parse().unwrap(),
                    ..TileAddress::default()
                };
                MessageSubject::Tile(LayerId::default(), address)
            }
            None => MessageSubject::Vehicle(VehicleId(
                NAMES.iter().position(|known| *known == name).unwrap() as u8,
            )),
        };
        Topic {
            kind: MessageKind::Tile,
            about,
        }
    }

    fn name(topic: Topic) -> String {
        match topic.about {
            MessageSubject::Tile(_, address) => format!("tile/{}", address.x),
            MessageSubject::Vehicle(number) => NAMES[usize::from(number.0)].to_owned(),
            MessageSubject::Whole
            | MessageSubject::Layer(_)
            | MessageSubject::Run(_)
            | MessageSubject::Part(..) => {
                panic!("{topic:?} has no name here")
            }
        }
    }

    fn frame(class: Urgency, name: &str, bytes: usize) -> OutboundFrame {
        let (topic, numbers) = (topic(name), Numbers::default());
        OutboundFrame {
            class,
            topic,
            is_replaced: true,
            piggybacks: Piggyback::Never,
            numbers,
            frame: vec![0; bytes],
        }
    }

    /// An egress whose budget is spent.
    fn spent() -> Egress {
        let mut egress = Egress::new(1000);
        assert!(
            egress
                .offer(Time::ZERO, frame(Urgency::Low, "first", 1000))
                .len()
                == 1
        );
        assert!(
            egress
                .offer(Time::ZERO, frame(Urgency::Low, "second", 10))
                .is_empty()
        );
        egress
    }

    fn all_due(egress: &mut Egress) -> Vec<String> {
        std::iter::from_fn(|| egress.due(egress.next()?))
            .map(|frame| name(frame.topic))
            .collect()
    }

    #[test]
    fn what_is_urgent_goes_at_once_also_when_the_budget_is_spent() {
        let mut egress = spent();
        assert!(
            egress
                .offer(Time::ZERO, frame(Urgency::Urgent, "order", 100))
                .len()
                == 1
        );
        assert!(
            egress
                .offer(Time::ZERO, frame(Urgency::High, "state", 100))
                .is_empty()
        );
    }

    #[test]
    fn the_higher_class_goes_first_and_of_a_key_only_the_newest() {
        let mut egress = spent();
        for (class, key, bytes) in [
            (Urgency::Normal, "tile/1", 5),
            (Urgency::Normal, "tile/2", 5),
            (Urgency::High, "state", 5),
            (Urgency::Normal, "tile/1", 7),
        ] {
            assert!(
                egress
                    .offer(Time::ZERO, frame(class, key, bytes))
                    .is_empty()
            );
        }
        assert_eq!(
            all_due(&mut egress),
            ["state", "tile/1", "tile/2", "second"]
        );
        assert_eq!(egress.next(), None);
    }

    #[test]
    fn of_batches_of_samples_the_first_two_wait_behind_everything_else() {
        let mut egress = spent();
        for number in 1..=5 {
            let batch = OutboundFrame {
                is_replaced: false,
                ..frame(Urgency::Low, "samples", number)
            };
            assert!(egress.offer(Time::ZERO, batch).is_empty());
        }
        assert!(
            egress
                .offer(Time::ZERO, frame(Urgency::Normal, "tile", 5))
                .is_empty()
        );
        assert_eq!(egress.dropped(), 3);
        assert_eq!(
            all_due(&mut egress),
            ["tile", "second", "samples", "samples"]
        );
    }

    #[test]
    fn batches_of_one_kind_take_no_room_from_those_of_another() {
        let mut egress = spent();
        for kind in [
            MessageKind::Log,
            MessageKind::Samples,
            MessageKind::Settings,
        ] {
            for number in 1..=5 {
                let mut batch = OutboundFrame {
                    is_replaced: false,
                    ..frame(Urgency::Low, "samples", number)
                };
                batch.topic.kind = kind;
                assert!(egress.offer(Time::ZERO, batch).is_empty());
            }
        }
        assert_eq!(egress.dropped(), 9);
        assert_eq!(
            all_due(&mut egress).len(),
            7,
            "two of each, and what filled it"
        );
    }

    #[test]
    fn what_others_decide_by_goes_before_samples() {
        let samples = Urgency::of(&Message::Samples(tomoswarm_proto::Samples::default()));
        for message in [
            Message::Report(tomoswarm_proto::GroundReport::default()),
            Message::Have(tomoswarm_proto::Have::default()),
            Message::Digest(tomoswarm_proto::Digest::default()),
            Message::Health(tomoswarm_proto::Health::default()),
        ] {
            assert!(Urgency::of(&message) < samples, "{}", message.word());
        }
    }

    #[test]
    fn of_a_map_that_is_sent_for_long_samples_get_their_share() {
        let mut egress = spent();
        for number in 0..300 {
            let tile = frame(Urgency::Normal, &format!("tile/{number}"), 1000);
            assert!(egress.offer(Time::ZERO, tile).is_empty());
        }
        let mut sent = BTreeMap::new();
        for second in 1..=200 {
            let now = Time::from_secs_f64(f64::from(second));
            let batch = OutboundFrame {
                is_replaced: false,
                ..frame(Urgency::Low, "samples", 2000)
            };
            let went = egress.offer(now, batch).into_iter();
            // What another vehicle asks for again goes as soon as there is anything left of the budget.
            let again = frame(Urgency::Normal, &format!("tile/{}", second + 300), 1000);
            let went = went.chain(egress.offer(now, again)).collect::<Vec<_>>();
            let due = std::iter::from_fn(|| egress.due(now)).collect::<Vec<_>>();
            for frame in went.into_iter().chain(due) {
                *sent.entry(frame.class).or_insert(0) += frame.frame.len();
            }
        }
        let (tiles, samples) = (sent[&Urgency::Normal], sent[&Urgency::Low]);
        assert!((190_000..=210_000).contains(&(tiles + samples)), "{sent:?}");
        assert!(samples * 9 > tiles && samples * 7 < tiles, "{sent:?}");
    }

    #[test]
    fn a_flood_of_one_class_takes_no_room_from_another() {
        let mut egress = spent();
        for number in 0..3000 {
            let tile = frame(Urgency::Normal, &format!("tile/{number}"), 1000);
            egress.offer(Time::ZERO, tile);
        }
        let all = all_due(&mut egress);
        assert!(all.contains(&"second".to_owned()), "{}", all.len());
    }

    #[test]
    fn what_waits_is_bounded_and_the_lowest_class_loses() {
        let mut egress = spent();
        for number in 0..3000 {
            egress.offer(
                Time::ZERO,
                frame(Urgency::Normal, &format!("tile/{number}"), 1000),
            );
        }
        assert!(egress.bytes() <= WAITING);
        assert!(egress.dropped() > 1900);
        assert!(
            egress
                .offer(Time::ZERO, frame(Urgency::High, "state", 1000))
                .is_empty()
        );
        assert_eq!(all_due(&mut egress)[0], "state");
    }

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    fn mission(places_left: u16) -> OutboundFrame {
        let message = Message::Mission(tomoswarm_proto::MissionProgress {
            places_left,
            ..tomoswarm_proto::MissionProgress::default()
        });
        OutboundFrame::of(&message).unwrap()
    }

    fn have(store: u64) -> OutboundFrame {
        OutboundFrame::of(&Message::Have(tomoswarm_proto::Have {
            store,
            ..tomoswarm_proto::Have::default()
        }))
        .unwrap()
    }

    #[test]
    fn what_is_new_goes_at_once_and_a_repeat_of_old_news_not_after_it() {
        let mut egress = Egress::new(64_000);
        let mut goes = |time_s: f64, frame| egress.offer(at(time_s), frame).len();
        assert_eq!(goes(1.0, mission(5)), 1);
        assert_eq!(goes(1.2, mission(5)), 1, "it is said again on purpose");
        assert_eq!(goes(2.0, mission(5)), 0, "a repeat");
        assert_eq!(goes(2.1, mission(4)), 1);
        assert_eq!(egress.next(), None, "the repeat was withdrawn");
        assert!(egress.is_outdated(&mission(5)) && !egress.is_outdated(&mission(4)));
        assert!(!egress.is_outdated(&have(0)));
    }

    #[test]
    fn what_another_thread_carries_is_outdated_once_something_newer_waits() {
        let mut egress = Egress::new(64_000);
        assert_eq!(egress.offer(at(1.0), have(1)), []);
        let carried = egress.offer(at(1.1), mission(5));
        assert_eq!(carried.len(), 2);
        assert!(!carried.iter().any(|frame| egress.is_outdated(frame)));
        assert_eq!(egress.offer(at(1.2), have(2)), []);
        let is_outdated: Vec<bool> = carried.iter().map(|of| egress.is_outdated(of)).collect();
        assert_eq!(is_outdated, [false, true]);
    }

    #[test]
    fn news_that_wait_for_the_budget_keep_the_place_of_older_ones() {
        let mut egress = spent();
        egress.offer(at(0.0), mission(5));
        egress.offer(at(0.0), frame(Urgency::High, "state", 500));
        egress.offer(at(0.0), mission(4));
        let all = std::iter::from_fn(|| egress.due(egress.next()?));
        let classes: Vec<_> = all.map(|frame| (frame.class, frame.frame.len())).collect();
        let of_mission = mission(4).frame.len();
        assert_eq!(
            classes[..2],
            [(Urgency::High, of_mission), (Urgency::High, 500)]
        );
    }

    #[test]
    fn a_health_with_a_trouble_goes_at_once_and_an_older_one_not_after_it() {
        let health = |troubles: &[&str]| {
            let troubles = troubles.iter().map(ToString::to_string).collect();
            let health = tomoswarm_proto::Health {
                troubles,
                ..tomoswarm_proto::Health::default()
            };
            OutboundFrame::of(&Message::Health(health)).unwrap()
        };
        let mut egress = Egress::new(64_000);
        assert_eq!(egress.offer(at(1.0), health(&[])), []);
        let failed = health(&["radio: it has gone"]);
        assert_eq!(egress.offer(at(1.1), failed.clone()), [failed]);
        assert_eq!(egress.next(), None, "what waited was withdrawn");
        assert_eq!(egress.offer(at(1.2), health(&[])), []);
    }

    #[test]
    fn a_repeat_that_the_budget_holds_back_is_not_said_after_news_that_it_does_not() {
        let stop = tomoswarm_proto::EmergencyStop {
            name: tomoswarm_proto::EmergencyName(0x1_0000),
            scope: tomoswarm_proto::StopScope::All,
            by: tomoswarm_proto::OperatorId(1),
        };
        let standing = |open: &[tomoswarm_proto::EmergencyStop]| {
            let stops = tomoswarm_proto::OpenStops {
                open: open.to_vec(),
                lifted: Vec::new(),
            };
            OutboundFrame::of(&Message::Standing(stops)).unwrap()
        };
        let mut egress = Egress::new(1000);
        egress.offer(at(0.0), standing(&[]));
        assert_eq!(egress.offer(at(1.0), standing(&[])), []);
        egress.offer(at(1.0), frame(Urgency::Low, "first", 1000));
        egress.offer(at(1.0), frame(Urgency::Urgent, "order", 3000));
        assert_eq!(egress.due(at(1.5)), None, "the budget is spent");
        assert_eq!(egress.offer(at(1.6), standing(&[stop])).len(), 1);
        let all = std::iter::from_fn(|| egress.due(egress.next()?));
        let later: Vec<_> = all.map(|frame| frame.topic.kind).collect();
        assert!(!later.contains(&MessageKind::Standing), "{later:?}");
    }
}
