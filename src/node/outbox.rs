//! The outbox actor: keeps a vehicle's samples until the ground has them, and sends them in batches.
//!
//! It is told samples and the ground's `Have`; it says batches for the bus. A batch is repeated until it
//! is covered by a watermark, oldest first, so that nothing is lost and everything arrives once the
//! network lets it; the ground stores each sample once. It writes no disk: in the field a
//! driver at the edge stores samples before they get here.
//!
//! Deadline: `flush`.

use std::collections::VecDeque;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, Have, RunId, Sample, Samples, VehicleId};

use crate::actor::{Actor, Class, Fault, Input};
use crate::time::{Deadline, Time};

/// New samples are sent this often.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// What the ground has not confirmed after this long is sent again.
const REPEAT_AFTER: Duration = Duration::from_secs(4);
/// Batches sent at a time at most, so that what a long cut has left does not flood the bus: 80 kB/s.
const BATCHES: usize = 8;
/// Samples of one batch; about 10 kB.
const BATCH: usize = 128;
/// Samples kept at most; the oldest are dropped and counted.
const CAPACITY: usize = 200_000;

/// What the outbox can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// A new sample of a run.
    Sample((RunId, Sample)),
    /// What the ground has.
    Have(Have),
}

/// What the outbox can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// A batch for the ground.
    Publish(Samples),
}

/// The outbox actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outbox {
    vehicle: VehicleId,
    boot: Boot,
    kept: VecDeque<(RunId, Sample)>,
    /// How many of `kept`, from the front, have been sent at least once.
    sent: usize,
    /// How many of `kept` there were when the front was sent.
    round: usize,
    /// When the front was sent first or last.
    sent_at: Time,
    flush_at: Option<Time>,
    dropped: u64,
    /// The ground's store, once heard.
    store: Option<u64>,
}

impl Outbox {
    /// Makes an empty outbox.
    pub fn new(vehicle: VehicleId, boot: Boot) -> Outbox {
        let kept = VecDeque::new();
        Outbox {
            vehicle,
            boot,
            kept,
            sent: 0,
            round: 0,
            sent_at: Time::ZERO,
            flush_at: None,
            dropped: 0,
            store: None,
        }
    }

    /// Tells how many samples were lost because the outbox was full.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    fn keep(&mut self, now: Time, run: RunId, sample: Sample) {
        self.kept.push_back((run, sample));
        if self.kept.len() > CAPACITY {
            self.kept.pop_front();
            (self.sent, self.round) = (self.sent.saturating_sub(1), self.round.saturating_sub(1));
            self.dropped += 1;
        }
        self.flush_at.get_or_insert(now + FLUSH_EVERY);
    }

    /// Forgets what the ground has stored. A new store has nothing yet: what is still kept is sent to it from the
    /// beginning; what an older store had confirmed is its operator's to bring over.
    fn have(&mut self, have: &Have) {
        if self.store.replace(have.store).is_some_and(|known| known != have.store) {
            self.sent = 0;
        }
        let own = |mark: &&tomoswarm_proto::HeardFrom| (mark.vehicle, mark.boot) == (self.vehicle, self.boot);
        for mark in have.watermarks.iter().filter(own) {
            let covered = |(run, sample): &(RunId, Sample)| *run == mark.run && sample.sequence < mark.below;
            while self.kept.front().is_some_and(covered) {
                self.kept.pop_front();
                (self.sent, self.round) = (self.sent.saturating_sub(1), self.round.saturating_sub(1));
            }
        }
    }

    fn batch(&self, from: usize) -> Option<Samples> {
        let (run, _) = *self.kept.get(from)?;
        let of_run = self.kept.iter().skip(from).take(BATCH).take_while(|(other, _)| *other == run);
        let samples = of_run.map(|(_, sample)| *sample).collect();
        Some(Samples { vehicle: self.vehicle, boot: self.boot, run, samples })
    }
}

impl Actor for Outbox {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, _out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Sample((run, sample)) => self.keep(now, run, sample),
            In::Have(have) => self.have(&have),
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        self.flush_at.map(|at| Deadline { at, why: "flush" })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        // Only once all has had its turn: otherwise the oldest would keep back the rest for ever.
        if self.sent >= self.round && now.since(self.sent_at) >= REPEAT_AFTER {
            self.sent = 0;
        }
        if self.sent == 0 {
            (self.sent_at, self.round) = (now, self.kept.len());
        }
        for _ in 0..BATCHES {
            let Some(batch) = self.batch(self.sent) else { break };
            self.sent += batch.samples.len();
            out.push(Out::Publish(batch));
        }
        self.flush_at = (!self.kept.is_empty()).then_some(now + FLUSH_EVERY);
        Ok(())
    }
}

impl Input for In {
    type Key = ();

    fn class(&self) -> Class<()> {
        match self {
            In::Sample(_) => Class::Queue,
            In::Have(_) => Class::Latest(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::HeardFrom;

    fn sample(sequence: u64) -> In {
        let sample = Sample {
            sequence,
            heard_at_ns: 0,
            transmitter: VehicleId(2),
            transmitter_pose: Default::default(),
            receiver_pose: Default::default(),
            channel: 11,
            power_dbm: 0,
            rssi_dbm: Some(-60),
        };
        In::Sample((RunId(1), sample))
    }

    fn have(below: u64) -> In {
        let mark = HeardFrom { vehicle: VehicleId(1), boot: Boot(1), run: RunId(1), below };
        In::Have(Have { store: 1, watermarks: vec![mark], closed: vec![] })
    }

    fn sent(outbox: &mut Outbox) -> Vec<u64> {
        let mut out = Vec::new();
        outbox.wake(outbox.deadline().unwrap().at, &mut out).unwrap();
        out.iter()
            .flat_map(|Out::Publish(batch)| batch.samples.iter().map(|sample| sample.sequence))
            .collect()
    }

    #[test]
    fn what_the_ground_has_not_confirmed_is_sent_again() {
        let mut outbox = Outbox::new(VehicleId(1), Boot(1));
        for sequence in 0..300 {
            outbox.handle(Time::ZERO, sample(sequence), &mut Vec::new()).unwrap();
        }
        assert_eq!(sent(&mut outbox), (0..300).collect::<Vec<_>>());
        outbox.handle(Time::ZERO, have(100), &mut Vec::new()).unwrap();
        let again: Vec<u64> = (0..4).flat_map(|_| sent(&mut outbox)).collect();
        assert_eq!(again, (100..300).collect::<Vec<_>>());
        outbox.handle(Time::ZERO, have(300), &mut Vec::new()).unwrap();
        assert!(sent(&mut outbox).is_empty());
        assert_eq!(outbox.deadline(), None);
    }

    #[test]
    fn after_a_cut_the_bus_is_not_flooded_and_all_arrives() {
        let mut outbox = Outbox::new(VehicleId(1), Boot(1));
        for sequence in 0..5000 {
            outbox.handle(Time::ZERO, sample(sequence), &mut Vec::new()).unwrap();
        }
        let mut below = 0;
        for _ in 0..5 {
            let sent = sent(&mut outbox);
            assert!(sent.len() <= 8 * 128, "{} at once", sent.len());
            below = sent.last().map_or(below, |last| last + 1);
            outbox.handle(Time::ZERO, have(below), &mut Vec::new()).unwrap();
        }
        assert_eq!(below, 5000);
    }

    #[test]
    fn what_is_repeated_does_not_keep_back_what_is_new() {
        let mut outbox = Outbox::new(VehicleId(1), Boot(1));
        for sequence in 0..20_000 {
            outbox.handle(Time::ZERO, sample(sequence), &mut Vec::new()).unwrap();
        }
        // Nothing is ever confirmed: it begins anew only when all has been sent.
        let seen: std::collections::BTreeSet<u64> = (0..20).flat_map(|_| sent(&mut outbox)).collect();
        assert_eq!(seen.len(), 20_000);
    }

    #[test]
    fn a_new_store_is_sent_all_that_is_kept_at_once() {
        let mut outbox = Outbox::new(VehicleId(1), Boot(1));
        for sequence in 0..10 {
            outbox.handle(Time::ZERO, sample(sequence), &mut Vec::new()).unwrap();
        }
        outbox.handle(Time::ZERO, have(2), &mut Vec::new()).unwrap();
        assert_eq!(sent(&mut outbox), (2..10).collect::<Vec<_>>());
        let other = In::Have(Have { store: 2, watermarks: vec![], closed: vec![] });
        outbox.handle(Time::ZERO, other, &mut Vec::new()).unwrap();
        assert_eq!(sent(&mut outbox), (2..10).collect::<Vec<_>>());
    }
}
