//! What a node still has to send: kept by class and key while the budget is spent, so that a slow link never delays what
//! is urgent, and old news gives way to new. Pure: it is told the time, and sends nothing itself.
//!
//! Urgent frames go at once, whatever was sent before. Of the others the higher class goes first; of one key only the
//! newest is kept.

use std::collections::{BTreeMap, VecDeque};

use tomoswarm_proto::Message;

use super::allowance::Allowance;
use crate::time::Time;

/// Bytes that may wait at most; beyond that the lowest class loses its oldest.
const WAITING: usize = 1 << 20;
/// Batches of samples that may wait; further ones are dropped, since their vehicle repeats them.
const BATCHES: usize = 2;

/// How much a message presses.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Class {
    /// Orders and greetings: never waits.
    Urgent,
    /// Where somebody is and how far, and what others decide by when it is missing: State, Progress, plans, Report, Have,
    /// digests.
    High,
    /// The map, and how a vehicle fares.
    Normal,
    /// Samples: they are many, and are repeated until the ground has them.
    Low,
}

impl Class {
    /// Gives the class of a message.
    pub fn of(message: &Message) -> Class {
        match message {
            Message::Order(_) | Message::Hello(_) => Class::Urgent,
            Message::State(_)
            | Message::Progress(_)
            | Message::Plan(_)
            | Message::Report(_)
            | Message::Have(_)
            | Message::Digest(_) => Class::High,
            Message::Tile(_) | Message::Want(_) | Message::Health(_) => Class::Normal,
            Message::Samples(_) | Message::Beacon(_) => Class::Low,
        }
    }
}

/// A frame with its key.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Parcel {
    /// How much it presses.
    pub class: Class,
    /// Under which key it is published.
    pub key: String,
    /// Whether a later parcel of its key takes its place.
    pub is_state: bool,
    /// The frame.
    pub frame: Vec<u8>,
}

/// What waits to be sent.
#[derive(Debug)]
pub struct Egress {
    allowance: Allowance,
    waiting: BTreeMap<Class, VecDeque<Parcel>>,
    bytes: usize,
    dropped: u64,
}

impl Egress {
    /// Makes an egress for so many bytes a second.
    pub fn new(bytes_per_s: u32) -> Egress {
        let per_s = f64::from(bytes_per_s);
        let allowance = Allowance::new(per_s, per_s / 2.0);
        Egress { allowance, waiting: BTreeMap::new(), bytes: 0, dropped: 0 }
    }

    /// Takes a parcel: gives it back when it may go at once, otherwise keeps it.
    pub fn offer(&mut self, now: Time, parcel: Parcel) -> Option<Parcel> {
        if parcel.class == Class::Urgent {
            self.allowance.owe(now, parcel.frame.len());
            return Some(parcel);
        }
        let is_turn = self.waiting.range(..=parcel.class).all(|(_, waiting)| waiting.is_empty());
        if is_turn && self.allowance.spend(now, parcel.frame.len()) {
            return Some(parcel);
        }
        self.keep(parcel);
        None
    }

    /// Gives the next parcel that may go now.
    pub fn due(&mut self, now: Time) -> Option<Parcel> {
        let waiting = self.waiting.values_mut().find(|waiting| !waiting.is_empty())?;
        let bytes = waiting.front()?.frame.len();
        if !self.allowance.spend(now, bytes) {
            return None;
        }
        self.bytes -= bytes;
        waiting.pop_front()
    }

    /// Gives when the next parcel may go; `None` when nothing waits.
    pub fn next(&self) -> Option<Time> {
        (self.bytes > 0).then(|| self.allowance.next())
    }

    /// Tells how many parcels were dropped because too much waited, or too many batches of samples.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    fn keep(&mut self, parcel: Parcel) {
        let waiting = self.waiting.entry(parcel.class).or_default();
        let is_batch = |parcel: &Parcel| parcel.class == Class::Low && !parcel.is_state;
        if is_batch(&parcel) && waiting.iter().filter(|waiting| is_batch(waiting)).count() >= BATCHES {
            self.dropped += 1;
            return;
        }
        self.bytes += parcel.frame.len();
        let older = |known: &&mut Parcel| known.is_state && known.key == parcel.key;
        match waiting.iter_mut().find(older) {
            Some(known) => {
                self.bytes -= known.frame.len();
                *known = parcel;
            }
            None => waiting.push_back(parcel),
        }
        while self.bytes > WAITING {
            let Some(lowest) = self.waiting.values_mut().rev().find(|waiting| !waiting.is_empty()) else {
                return;
            };
            if let Some(lost) = lowest.pop_front() {
                self.bytes -= lost.frame.len();
                self.dropped += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parcel(class: Class, key: &str, bytes: usize) -> Parcel {
        Parcel { class, key: key.to_owned(), is_state: true, frame: vec![0; bytes] }
    }

    /// An egress whose budget is spent.
    fn spent() -> Egress {
        let mut egress = Egress::new(1000);
        assert!(egress.offer(Time::ZERO, parcel(Class::Low, "first", 1000)).is_some());
        assert!(egress.offer(Time::ZERO, parcel(Class::Low, "second", 10)).is_none());
        egress
    }

    fn all_due(egress: &mut Egress) -> Vec<String> {
        std::iter::from_fn(|| egress.due(egress.next()?)).map(|parcel| parcel.key).collect()
    }

    #[test]
    fn what_is_urgent_goes_at_once_also_when_the_budget_is_spent() {
        let mut egress = spent();
        assert!(egress.offer(Time::ZERO, parcel(Class::Urgent, "order", 100)).is_some());
        assert!(egress.offer(Time::ZERO, parcel(Class::High, "state", 100)).is_none());
    }

    #[test]
    fn the_higher_class_goes_first_and_of_a_key_only_the_newest() {
        let mut egress = spent();
        for (class, key, bytes) in [
            (Class::Normal, "tile/1", 5),
            (Class::Normal, "tile/2", 5),
            (Class::High, "state", 5),
            (Class::Normal, "tile/1", 7),
        ] {
            assert!(egress.offer(Time::ZERO, parcel(class, key, bytes)).is_none());
        }
        assert_eq!(all_due(&mut egress), ["state", "tile/1", "tile/2", "second"]);
        assert_eq!(egress.next(), None);
    }

    #[test]
    fn of_batches_of_samples_the_first_two_wait_behind_everything_else() {
        let mut egress = spent();
        for number in 1..=5 {
            let batch = Parcel { is_state: false, ..parcel(Class::Low, "samples", number) };
            assert!(egress.offer(Time::ZERO, batch).is_none());
        }
        assert!(egress.offer(Time::ZERO, parcel(Class::Normal, "tile", 5)).is_none());
        assert_eq!(egress.dropped(), 3);
        assert_eq!(all_due(&mut egress), ["tile", "second", "samples", "samples"]);
    }

    #[test]
    fn what_others_decide_by_goes_before_samples() {
        let (vehicle, boot) = (tomoswarm_proto::VehicleId(1), tomoswarm_proto::Boot(1));
        let batch =
            tomoswarm_proto::Samples { vehicle, boot, run: tomoswarm_proto::RunId(1), samples: vec![] };
        let samples = Class::of(&Message::Samples(batch));
        for message in [
            Message::Report(tomoswarm_proto::Report::default()),
            Message::Have(tomoswarm_proto::Have::default()),
            Message::Digest(tomoswarm_proto::Digest::default()),
            Message::Health(tomoswarm_proto::Health::default()),
        ] {
            assert!(Class::of(&message) < samples, "{}", message.word());
        }
    }

    #[test]
    fn what_waits_is_bounded_and_the_lowest_class_loses() {
        let mut egress = spent();
        for number in 0..3000 {
            egress.offer(Time::ZERO, parcel(Class::Normal, &format!("tile/{number}"), 1000));
        }
        assert!(egress.bytes <= WAITING);
        assert!(egress.dropped() > 1900);
        assert!(egress.offer(Time::ZERO, parcel(Class::High, "state", 1000)).is_none());
        assert_eq!(all_due(&mut egress)[0], "state");
    }
}
