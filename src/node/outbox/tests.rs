//! What the outbox promises, told from outside: samples in, batches out.

use std::collections::{BTreeMap, BTreeSet};

use tomoswarm_proto::HeardFrom;

use super::held::BATCH;
use super::*;

const OWN: VehicleId = VehicleId(1);

fn sample(sequence: u64) -> Sample {
    Sample {
        sequence,
        heard_at_ns: 0,
        transmitter: VehicleId(2),
        transmitter_pose: Default::default(),
        receiver_pose: Default::default(),
        channel: 11,
        power_dbm: 0,
        rssi_dbm: Some(-60),
    }
}

fn kept(boot: u32, run: u32, sequence: u64) -> In {
    In::SampleStored((Boot(boot), RunId(run), sample(sequence)))
}

fn have(store: u64, marks: &[(u32, u32, u64)], closed: &[u32]) -> In {
    let mark = |(boot, run, below): &(u32, u32, u64)| HeardFrom {
        vehicle: OWN,
        boot: Boot(*boot),
        run: RunId(*run),
        below: *below,
    };
    let watermarks = marks.iter().map(mark).collect();
    In::Have(Have {
        store,
        watermarks,
        closed: closed.iter().map(|run| RunId(*run)).collect(),
    })
}

/// An outbox with the disk at its edge: everything kept, until it is forgotten.
struct Rig {
    outbox: Outbox,
    now: Time,
    disk: BTreeMap<SampleKey, Sample>,
    forgets: Vec<(u32, u32, u64)>,
    tally: OutboxCounts,
}

impl Rig {
    fn new() -> Rig {
        let (now, disk) = (Time::ZERO, BTreeMap::new());
        Rig {
            outbox: Outbox::new(OWN),
            now,
            disk,
            forgets: Vec::new(),
            tally: OutboxCounts::default(),
        }
    }

    /// Keeps samples of boot 1 and run 1 on disk and tells of them.
    fn keep(&mut self, sequences: impl Iterator<Item = u64>) {
        for sequence in sequences {
            self.on_disk(1, 1, sequence);
            self.tell(kept(1, 1, sequence));
        }
    }

    fn on_disk(&mut self, boot: u32, run: u32, sequence: u64) {
        self.disk.insert(
            SampleKey {
                boot: Boot(boot),
                run: RunId(run),
                sequence,
            },
            sample(sequence),
        );
    }

    fn tell(&mut self, input: In) {
        let mut out = Vec::new();
        self.outbox.handle(self.now, input, &mut out).unwrap();
        self.carry_out(out);
    }

    /// Answers what is wanted of the disk; returns what goes to the bus.
    fn carry_out(&mut self, out: Vec<Out>) -> Vec<Samples> {
        let mut published = Vec::new();
        for output in out {
            match output {
                Out::Publish(batch) => published.push(batch),
                Out::Forget { boot, run, below } => {
                    self.disk.retain(|place, _| {
                        (place.boot, place.run) != (boot, run) || place.sequence >= below
                    });
                    self.forgets.push((boot.0, run.0, below));
                }
                Out::Recall { after } => self.answer(after),
                Out::Tally(tally) => self.tally = tally,
            }
        }
        published
    }

    fn answer(&mut self, after: Option<SampleKey>) {
        let all = self
            .disk
            .iter()
            .filter(|(place, _)| after.is_none_or(|after| **place > after));
        let all: Vec<(Boot, RunId, Sample)> = all
            .map(|(place, sample)| (place.boot, place.run, *sample))
            .collect();
        let is_end = all.len() <= CHUNK;
        let samples = all.into_iter().take(CHUNK).collect();
        self.tell(In::Recalled(Recalled {
            after,
            samples,
            is_end,
        }));
    }

    /// Lets it act at its next deadline; returns the batches.
    fn flush(&mut self) -> Vec<Samples> {
        let Some(deadline) = self.outbox.deadline() else {
            return Vec::new();
        };
        self.now = self.now.max(deadline.at);
        let mut out = Vec::new();
        self.outbox.wake(self.now, &mut out).unwrap();
        self.carry_out(out)
    }

    /// Flushes for some seconds; returns the sequences in the order in which they were sent.
    fn sent(&mut self, seconds: usize) -> Vec<u64> {
        let batches: Vec<Samples> = (0..seconds).flat_map(|_| self.flush()).collect();
        batches
            .iter()
            .flat_map(|batch| batch.samples.iter().map(|sample| sample.sequence))
            .collect()
    }
}

#[test]
fn it_tells_how_many_samples_wait_until_none_does() {
    let mut rig = Rig::new();
    rig.keep(0..10);
    rig.flush();
    assert_eq!(
        rig.tally,
        OutboxCounts {
            waiting: 10,
            lost: 0
        }
    );
    rig.tell(have(1, &[(1, 1, 10)], &[]));
    rig.flush();
    assert_eq!(rig.tally.waiting, 0);
}

#[test]
fn what_the_ground_has_not_confirmed_is_sent_again() {
    let mut rig = Rig::new();
    rig.keep(0..300);
    assert_eq!(rig.sent(1), (0..300).collect::<Vec<_>>());
    rig.tell(have(1, &[(1, 1, 100)], &[]));
    assert_eq!(rig.sent(4), (100..300).collect::<Vec<_>>());
    rig.tell(have(1, &[(1, 1, 300)], &[]));
    assert!(rig.sent(9).is_empty());
    assert_eq!(rig.outbox.deadline(), None);
}

#[test]
fn after_a_cut_the_bus_is_not_flooded_and_all_arrives() {
    let mut rig = Rig::new();
    rig.keep(0..5000);
    let mut below = 0;
    for _ in 0..5 {
        let sent = rig.sent(1);
        assert!(sent.len() <= BATCHES * BATCH, "{} at once", sent.len());
        below = sent.last().map_or(below, |last| last + 1);
        rig.tell(have(1, &[(1, 1, below)], &[]));
    }
    assert_eq!(below, 5000);
}

#[test]
fn what_is_repeated_does_not_keep_back_what_is_new() {
    let mut rig = Rig::new();
    rig.keep(0..20_000);
    // Nothing is ever confirmed: repetitions wait until all has been sent.
    let seen: BTreeSet<u64> = rig.sent(20).into_iter().collect();
    assert_eq!(seen.len(), 20_000);
}

#[test]
fn repetitions_become_rare_while_nothing_gets_through() {
    let mut rig = Rig::new();
    rig.keep(0..128);
    rig.tell(have(1, &[], &[]));
    let batches = (0..1000).flat_map(|_| rig.flush()).count();
    assert!((5..=12).contains(&batches), "{batches} batches in 1000 s");
    // A ground that comes back is sent at once what it may have missed.
    rig.tell(have(1, &[], &[]));
    assert_eq!(rig.sent(1).len(), 128);
}

#[test]
fn a_new_store_is_sent_everything_that_is_kept() {
    let mut rig = Rig::new();
    rig.tell(have(1, &[], &[]));
    rig.keep(0..10);
    assert_eq!(rig.sent(2), (0..10).collect::<Vec<_>>());
    rig.tell(have(1, &[(1, 1, 10)], &[]));
    assert!(rig.sent(1).is_empty());
    // Another store is not listened to while the first one is heard.
    rig.tell(have(2, &[], &[]));
    assert!(rig.sent(1).is_empty());
    rig.now = rig.now + Duration::from_secs(6);
    rig.tell(have(2, &[], &[]));
    assert_eq!(rig.sent(2), (0..10).collect::<Vec<_>>());
}

#[test]
fn after_a_restart_samples_of_earlier_boots_are_sent_under_their_boots() {
    let mut rig = Rig::new();
    (0..300).for_each(|sequence| rig.on_disk(1, 7, sequence));
    (0..50).for_each(|sequence| rig.on_disk(2, 7, sequence));
    rig.tell(have(1, &[(1, 7, 200)], &[]));
    let batches: Vec<Samples> = (0..3).flat_map(|_| rig.flush()).collect();
    let sent: Vec<(u32, u64)> = batches
        .iter()
        .flat_map(|batch| {
            batch
                .samples
                .iter()
                .map(|sample| (batch.boot.0, sample.sequence))
        })
        .collect();
    let expected: Vec<(u32, u64)> = (200..300)
        .map(|sequence| (1, sequence))
        .chain((0..50).map(|sequence| (2, sequence)))
        .collect();
    assert_eq!(sent, expected);
}

#[test]
fn only_confirmed_samples_of_closed_runs_are_forgotten_and_that_is_said_rarely() {
    let mut rig = Rig::new();
    let say_at = |rig: &mut Rig, at_s: f64, closed: &[u32]| {
        rig.now = Time::from_secs_f64(at_s);
        rig.tell(have(1, &[(1, 1, 8)], closed));
        rig.forgets.len()
    };
    rig.keep(0..10);
    assert_eq!(say_at(&mut rig, 0.0, &[]), 0);
    assert_eq!(rig.disk.len(), 10);
    for (at_s, expected) in [(1.0, 0), (10.9, 0), (11.0, 1), (12.0, 1), (70.9, 1)] {
        assert_eq!(say_at(&mut rig, at_s, &[1]), expected, "{at_s} s");
    }
    assert_eq!((rig.disk.len(), &rig.forgets[..]), (2, &[(1, 1, 8)][..]));
    assert_eq!(
        say_at(&mut rig, 71.0, &[1]),
        2,
        "the edge may have been too busy"
    );
}

#[test]
fn nothing_is_forgotten_that_the_store_itself_does_not_go_on_confirming() {
    for contradicts in [
        have(1, &[(1, 1, 3)], &[]),
        have(1, &[(1, 1, 10)], &[]),
        have(2, &[], &[]),
    ] {
        let mut rig = Rig::new();
        rig.keep(0..10);
        for second in 0..60 {
            rig.now = Time::from_secs_f64(f64::from(second));
            rig.tell(have(1, &[(1, 1, u64::MAX)], &[1]));
            rig.tell(contradicts.clone());
        }
        assert_eq!(
            (rig.forgets.len(), rig.disk.len()),
            (0, 10),
            "{contradicts:?}"
        );
    }
}

#[test]
fn what_a_store_does_not_say_again_was_never_stored_and_is_sent() {
    let mut rig = Rig::new();
    rig.keep(0..10);
    rig.tell(have(1, &[(1, 1, 4)], &[]));
    rig.tell(have(1, &[(1, 1, u64::MAX)], &[]));
    assert!(rig.sent(3).is_empty());
    rig.keep(10..20);
    rig.now = Time::from_secs_f64(9.9);
    rig.tell(have(1, &[(1, 1, 4)], &[]));
    assert!(rig.sent(1).is_empty(), "a watermark may come late");
    rig.now = Time::from_secs_f64(10.0);
    rig.tell(have(1, &[(1, 1, 4)], &[]));
    let sent: BTreeSet<u64> = rig.sent(3).into_iter().collect();
    assert_eq!(sent, (4..20).collect());
}

#[test]
fn a_source_that_a_store_does_not_name_at_all_is_not_stored() {
    let mut rig = Rig::new();
    rig.tell(have(1, &[(1, 1, u64::MAX)], &[]));
    rig.keep(0..10);
    for second in 1..=10_u32 {
        assert!(rig.sent(1).is_empty(), "{second} s");
        rig.now = Time::from_secs_f64(f64::from(second));
        rig.tell(have(1, &[], &[]));
    }
    let sent: BTreeSet<u64> = rig.sent(3).into_iter().collect();
    assert_eq!(sent, (0..10).collect());
}

#[test]
fn memory_is_bounded_and_what_does_not_fit_is_sent_later() {
    let all = CAPACITY as u64 + 7000;
    let mut rig = Rig::new();
    rig.keep(0..all);
    assert_eq!(rig.outbox.waiting(), CAPACITY);
    let mut got = BTreeSet::new();
    for _ in 0..120 {
        got.extend(rig.sent(1));
        assert!(rig.outbox.waiting() <= CAPACITY);
        let below = (0..).find(|sequence| !got.contains(sequence)).unwrap();
        rig.tell(have(1, &[(1, 1, below)], &[]));
    }
    assert_eq!(got.len() as u64, all);
    assert_eq!(
        (rig.outbox.lost, rig.outbox.waiting(), rig.outbox.deadline()),
        (0, 0, None)
    );
}

#[test]
fn a_sample_that_went_by_unread_is_recalled() {
    let mut rig = Rig::new();
    rig.tell(have(1, &[], &[]));
    rig.sent(3);
    rig.on_disk(1, 1, 0);
    rig.on_disk(1, 1, 1);
    rig.keep(2..4);
    let sent: BTreeSet<u64> = rig.sent(3).into_iter().collect();
    assert_eq!(sent, (0..4).collect());
}

#[test]
fn what_the_edge_had_no_room_for_counts_as_lost_unless_it_is_held_or_confirmed() {
    let mut rig = Rig::new();
    rig.keep(10..20);
    rig.tell(have(1, &[(1, 1, 5)], &[]));
    let first = SampleKey {
        boot: Boot(1),
        run: RunId(1),
        sequence: 0,
    };
    rig.tell(In::Dropped(DroppedSamples { first, below: 15 }));
    assert_eq!(rig.outbox.lost, 5);
}

/// Returns what all batches of some seconds say is lost of boot 1 and run 1.
fn said_lost(rig: &mut Rig, seconds: usize) -> BTreeSet<(u64, u64)> {
    let batches = (0..seconds).flat_map(|_| rig.flush()).collect::<Vec<_>>();
    let ranges = batches.iter().flat_map(|batch| &batch.lost);
    ranges.map(|lost| (lost.from, lost.until)).collect()
}

#[test]
fn what_the_edge_never_had_is_said_to_be_lost_once_it_was_read() {
    let mut rig = Rig::new();
    rig.tell(have(1, &[], &[]));
    rig.keep(0..3);
    rig.keep(5..7);
    assert!(said_lost(&mut rig, 1).is_empty(), "it may be at the edge");
    assert_eq!(said_lost(&mut rig, 8), [(3, 5)].into());
    assert_eq!(rig.outbox.lost, 0, "the edge counts what it never had");
    rig.tell(have(1, &[(1, 1, 5)], &[]));
    rig.keep(7..8);
    assert!(said_lost(&mut rig, 8).is_empty(), "it was passed over");
}

#[test]
fn what_the_edge_had_no_room_for_is_said_to_be_lost_but_for_what_is_held() {
    let mut rig = Rig::new();
    rig.keep(10..20);
    let first = SampleKey {
        boot: Boot(1),
        run: RunId(1),
        sequence: 0,
    };
    rig.tell(In::Dropped(DroppedSamples { first, below: 15 }));
    assert_eq!(said_lost(&mut rig, 1), [(0, 10)].into());
}

#[test]
fn what_was_forgotten_for_another_store_does_not_hold_up_a_new_one() {
    let mut rig = Rig::new();
    rig.keep(0..10);
    rig.disk.retain(|place, _| place.sequence >= 6);
    rig.outbox = Outbox::new(OWN);
    rig.tell(have(2, &[], &[]));
    assert_eq!(said_lost(&mut rig, 3), [(0, 6)].into());
}

#[test]
fn an_answer_to_another_question_proves_nothing_lost() {
    let mut rig = Rig::new();
    rig.tell(have(1, &[], &[]));
    let mut out = Vec::new();
    rig.now = rig.outbox.deadline().unwrap().at;
    rig.outbox.wake(rig.now, &mut out).unwrap();
    assert!(out.contains(&Out::Recall { after: None }));
    let place = |sequence| SampleKey {
        boot: Boot(1),
        run: RunId(1),
        sequence,
    };
    let samples = vec![(Boot(1), RunId(1), sample(41))];
    rig.tell(In::Recalled(Recalled {
        after: Some(place(40)),
        samples,
        is_end: false,
    }));
    rig.keep(0..1);
    assert!(said_lost(&mut rig, 1).is_empty());
}
