//! The outbox actor: keeps a vehicle's samples until the ground has them, and sends them in batches.
//!
//! It is told samples that are kept at the edge (`SampleStored`), chunks of what was kept before (`Recalled`) and the
//! ground's `Have`; it says batches for the bus, what the edge may forget, and what it wants to be told again. What was
//! never sent goes first, oldest first; then what was sent and not confirmed in time is repeated, each time after
//! twice as long. The ground stores each sample once. It writes no disk, and holds only so much in memory: the rest
//! stays at the edge and is asked for when there is room.
//!
//! Only samples that a store has confirmed *and* whose run is closed are forgotten for good: a ground station
//! that comes back with another store is sent everything again. Both must stand for some seconds in which the store says
//! nothing else, and no other store speaks. A watermark that a store replaces by lower ones was not sent by it: what
//! it covers is read from the edge once more.
//!
//! Deadline: `flush`.

mod held;
mod lost;

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Boot, Have, HeardFrom, RunId, Sample, Samples, VehicleId, WATERMARKS_ALWAYS,
};

use crate::actor::{Actor, Fault, Input, InputClass};
use crate::sweep::VOID_AFTER;
use crate::time::{Deadline, Time};

use held::HeldSamples;
use lost::LostRanges;

/// Samples are sent this often.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// A ground that was not heard for this long may have missed what was sent meanwhile.
const SILENT_AFTER: Duration = Duration::from_secs(5);
/// Batches sent at a time at most, so that what a long cut has left does not flood the bus: 80 kB/s.
const BATCHES: usize = 8;
/// Samples held in memory at most, about 8 MB; more stay at the edge.
const CAPACITY: usize = 50_000;
/// Samples asked for at a time.
pub const CHUNK: usize = 2048;
/// What was asked for and did not come for this long is asked for again.
const RECALL_AFTER: Duration = Duration::from_secs(10);
/// For this long a store must say that it has samples of a closed run before they are forgotten for good.
const STANDS_FOR: Duration = Duration::from_secs(10);
/// The edge is told again to forget while the ground says that a run is closed, this often: it may have been too busy.
const FORGET_AGAIN: Duration = Duration::from_secs(60);

/// Where a sample stands among all of its vehicle: in the order of boots, runs and sequences.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub struct SampleKey {
    /// Start of the software that made it.
    pub boot: Boot,
    /// In which run.
    pub run: RunId,
    /// Its number within boot and run.
    pub sequence: u64,
}

impl SampleKey {
    fn source(&self) -> Source {
        (self.boot, self.run)
    }
}

/// A chunk of what is kept at the edge.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Recalled {
    /// After which place they were asked for; `None` = from the beginning.
    pub after: Option<SampleKey>,
    /// Samples in ascending order of their places, at most [`CHUNK`] of them.
    pub samples: Vec<(Boot, RunId, Sample)>,
    /// Whether nothing is kept beyond them.
    pub is_end: bool,
}

/// Samples that the edge no longer keeps although nobody let it forget them: there was no room.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct DroppedSamples {
    /// The first of them.
    pub first: SampleKey,
    /// Every sequence of the same boot and run from the first up to here, exclusive.
    pub below: u64,
}

/// What the outbox can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// A new sample that is kept at the edge.
    SampleStored((Boot, RunId, Sample)),
    /// A part of what was kept before.
    Recalled(Recalled),
    /// The edge had no room.
    Dropped(DroppedSamples),
    /// What the ground has.
    Have(Have),
}

/// What the outbox can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// A batch for the ground.
    Publish(Samples),
    /// The edge may forget samples for good.
    Forget {
        /// Start of the software that made them.
        boot: Boot,
        /// Their run, which is closed.
        run: RunId,
        /// All with a lower sequence.
        below: u64,
    },
    /// The edge shall tell again what it keeps: the next [`CHUNK`] samples after a place, or the first ones.
    Recall {
        /// The place; `None` = from the beginning.
        after: Option<SampleKey>,
    },
    /// How many samples wait and how many were lost, when that has changed.
    Tally(OutboxCounts),
}

/// How an outbox fares.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct OutboxCounts {
    /// Samples that the ground has not confirmed, as far as they are known here; at least one when more are at the edge.
    pub waiting: u64,
    /// Samples lost since nothing could keep them.
    pub lost: u64,
}

/// Names who counts sequences.
type Source = (Boot, RunId);

/// What a store says that it has.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Mark {
    /// Every sequence below.
    below: u64,
    /// When that was said: for the last time, or, of a closed run, first.
    at: Time,
}

/// A reading of what is kept at the edge, from its beginning to its end.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Reading {
    after: Option<SampleKey>,
    /// When more was asked for, and after which place.
    asked: Option<(Time, Option<SampleKey>)>,
}

/// The outbox actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outbox {
    vehicle: VehicleId,
    held: HeldSamples,
    /// The ground's store and when it was last heard.
    store: Option<(u64, Time)>,
    /// What that store has.
    marks: BTreeMap<Source, Mark>,
    /// What it has of closed runs, since when it says nothing else.
    closed: BTreeMap<Source, Mark>,
    /// What the edge was told to forget, and when: every sequence below.
    forgotten: BTreeMap<Source, (u64, Time)>,
    /// The sequence that is expected next of each source.
    next: BTreeMap<Source, u64>,
    reading: Option<Reading>,
    /// Whether something is kept at the edge that was passed over here.
    is_behind: bool,
    /// How many were lost.
    lost: u64,
    /// Which the edge has no more and are not held here: lost ones, and those that another store has.
    gone: LostRanges,
    flush_at: Option<Time>,
    /// What was told last of how it fares.
    tallied: OutboxCounts,
}

impl Outbox {
    /// Makes an empty outbox.
    pub fn new(vehicle: VehicleId) -> Outbox {
        Outbox {
            vehicle,
            held: HeldSamples::default(),
            store: None,
            marks: BTreeMap::new(),
            closed: BTreeMap::new(),
            forgotten: BTreeMap::new(),
            next: BTreeMap::new(),
            reading: None,
            is_behind: false,
            lost: 0,
            gone: LostRanges::default(),
            flush_at: None,
            tallied: OutboxCounts::default(),
        }
    }

    /// Returns how many samples are held that the ground has not confirmed.
    pub fn waiting(&self) -> usize {
        self.held.len()
    }

    fn tally(&mut self, out: &mut Vec<Out>) {
        let waiting = self.waiting() as u64 + u64::from(self.is_behind);
        let tally = OutboxCounts {
            waiting,
            lost: self.lost,
        };
        if tally != self.tallied {
            self.tallied = tally;
            out.push(Out::Tally(tally));
        }
    }

    fn kept(&mut self, boot: Boot, run: RunId, sample: Sample) {
        let next = self.next.entry((boot, run)).or_default();
        // One that was dropped unread on its way here is at the edge still.
        self.is_behind |= sample.sequence > *next;
        *next = (*next).max(sample.sequence.saturating_add(1));
        self.hold(boot, run, sample);
    }

    fn hold(&mut self, boot: Boot, run: RunId, sample: Sample) {
        let place = SampleKey {
            boot,
            run,
            sequence: sample.sequence,
        };
        if self.has(place) || self.held.is_sent(place) {
            return;
        }
        if self.waiting() >= CAPACITY {
            self.is_behind = true;
            return;
        }
        self.held.add(place, sample);
    }

    /// Returns up to where the ground has the samples of a source.
    fn below(&self, source: Source) -> Option<u64> {
        self.marks.get(&source).map(|mark| mark.below)
    }

    /// Returns whether the ground has a sample.
    fn has(&self, place: SampleKey) -> bool {
        self.below((place.boot, place.run))
            .is_some_and(|below| place.sequence < below)
    }

    fn recalled(&mut self, chunk: Recalled) {
        let Some(reading) = &mut self.reading else {
            return;
        };
        if reading.asked.is_none_or(|(_, after)| after != chunk.after) {
            return; // an answer that came too late, to a question that was asked again or of an earlier reading
        }
        reading.asked = None;
        let mut read_to = reading.after;
        let last = chunk.samples.last().map(|(boot, run, sample)| SampleKey {
            boot: *boot,
            run: *run,
            sequence: sample.sequence,
        });
        reading.after = last.or(reading.after);
        if chunk.is_end || last.is_none() {
            self.reading = None;
        }
        for (boot, run, sample) in chunk.samples {
            let source = (boot, run);
            // The edge is read in order: it has none between two that follow each other.
            let from = match read_to {
                Some(place) if place.source() == source => place.sequence + 1,
                Some(_) | None => 0,
            };
            self.gone(source, from, sample.sequence);
            self.hold(boot, run, sample);
            read_to = Some(SampleKey {
                boot,
                run,
                sequence: sample.sequence,
            });
        }
    }

    /// Notes that the edge has none from one sequence of a source to another, exclusive; returns how many of them are neither
    /// held here nor confirmed.
    fn gone(&mut self, source: Source, from: u64, until: u64) -> u64 {
        let from = from.max(self.below(source).unwrap_or(0));
        if from >= until {
            return 0;
        }
        let held = self.held.between(source, from, until);
        self.gone.add(source, from, until, held.into_iter())
    }

    fn dropped(&mut self, dropped: DroppedSamples) {
        let SampleKey {
            boot,
            run,
            sequence,
        } = dropped.first;
        self.lost += self.gone((boot, run), sequence, dropped.below);
    }

    /// Takes in what the ground has. A store that was not heard before has nothing yet: it is sent everything that is
    /// kept, from the beginning. While one store is heard another one is not listened to.
    fn have(&mut self, now: Time, have: &Have, out: &mut Vec<Out>) {
        let is_silent = |at: Time| now.since(at) >= SILENT_AFTER;
        match self.store {
            Some((store, at)) if store != have.store && !is_silent(at) => {
                return self.closed.clear();
            }
            Some((store, at)) if store == have.store => {
                if is_silent(at) {
                    self.held.repeat_all(now);
                }
            }
            Some(_) | None => self.begin_store(now),
        }
        self.store = Some((have.store, now));
        let own = self.vehicle;
        let marks = have
            .watermarks
            .iter()
            .filter(|mark| mark.vehicle == own)
            .copied();
        for mark in marks.chain(self.not_named(have)) {
            self.take_mark(now, &mark);
            self.forget(now, &mark, have, out);
        }
    }

    /// Returns the sources of which a store was believed to have something, and which it does not name though it names all.
    fn not_named(&self, have: &Have) -> Vec<HeardFrom> {
        let tells_all = have.watermarks.len() < WATERMARKS_ALWAYS;
        let nothing = |(boot, run): &Source| HeardFrom {
            vehicle: self.vehicle,
            boot: *boot,
            run: *run,
            below: 0,
        };
        let known = self.marks.keys().filter(|_| tells_all).map(nothing);
        let is_of = |mark: &HeardFrom, other: &HeardFrom| {
            (mark.vehicle, mark.boot, mark.run) == (other.vehicle, other.boot, other.run)
        };
        known
            .filter(|mark| !have.watermarks.iter().any(|named| is_of(mark, named)))
            .collect()
    }

    fn begin_store(&mut self, now: Time) {
        self.marks.clear();
        self.closed.clear();
        self.held.repeat_all(now);
        self.reading = Some(Reading::default());
        self.is_behind = false;
    }

    fn take_mark(&mut self, now: Time, mark: &HeardFrom) {
        let sent_at = Mark {
            below: mark.below,
            at: now,
        };
        let source = (mark.boot, mark.run);
        let known = self.marks.entry(source).or_insert(sent_at);
        if mark.below >= known.below {
            *known = sent_at;
            self.held.confirm(source, mark.below);
            self.gone.confirm(source, mark.below);
        } else if now.since(known.at) >= VOID_AFTER {
            *known = sent_at;
            self.reading = Some(Reading::default());
        }
    }

    /// Lets the edge forget what is confirmed of a closed run, again and again: deleting what is gone costs next to nothing.
    fn forget(&mut self, now: Time, mark: &HeardFrom, have: &Have, out: &mut Vec<Out>) {
        let HeardFrom {
            vehicle: _,
            boot,
            run,
            below,
        } = *mark;
        let source = (boot, run);
        if have.closed.binary_search(&run).is_err() || Some(below) < self.below(source) {
            self.closed.remove(&source);
            return;
        }
        let closed = self.closed.entry(source).or_insert(Mark { below, at: now });
        if now.since(closed.at) < STANDS_FOR {
            return;
        }
        // What it has more since then has to stand for as long.
        let settled = closed.below;
        if below > settled {
            *closed = Mark { below, at: now };
        }
        let sent_at = self.forgotten.get(&source);
        if sent_at.is_none_or(|(sent_at, at)| *sent_at < settled || now.since(*at) >= FORGET_AGAIN)
            && settled > 0
        {
            self.forgotten.insert(source, (settled, now));
            out.push(Out::Forget {
                boot,
                run,
                below: settled,
            });
        }
    }

    /// Asks for more of what is kept at the edge, when there is room.
    fn recall(&mut self, now: Time, out: &mut Vec<Out>) {
        if self.waiting() + CHUNK > CAPACITY {
            return;
        }
        if self.reading.is_none() && std::mem::take(&mut self.is_behind) {
            self.reading = Some(Reading::default());
        }
        let marks = &self.marks;
        let Some(reading) = &mut self.reading else {
            return;
        };
        if reading
            .asked
            .is_some_and(|(at, _)| now.since(at) < RECALL_AFTER)
        {
            return;
        }
        // What the ground has need not be read.
        let beyond = |place: SampleKey| match marks.get(&(place.boot, place.run)) {
            Some(mark) => SampleKey {
                sequence: place.sequence.max(mark.below.saturating_sub(1)),
                ..place
            },
            None => place,
        };
        let after = reading.after.map(beyond);
        reading.asked = Some((now, after));
        out.push(Out::Recall { after });
    }

    fn has_work(&self) -> bool {
        self.waiting() > 0 || self.reading.is_some() || self.is_behind
    }
}

impl Actor for Outbox {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::SampleStored((boot, run, sample)) => self.kept(boot, run, sample),
            In::Recalled(chunk) => self.recalled(chunk),
            In::Dropped(dropped) => self.dropped(dropped),
            In::Have(have) => {
                self.have(now, &have, out);
                self.tally(out);
            }
        }
        if self.has_work() {
            self.flush_at.get_or_insert(now + FLUSH_EVERY);
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        self.flush_at.map(|at| Deadline { at, why: "flush" })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        let batches = self.held.batches(now, BATCHES);
        out.extend(batches.into_iter().map(|(source, samples)| {
            Out::Publish(Samples {
                vehicle: self.vehicle,
                boot: source.0,
                run: source.1,
                samples,
                lost: self.gone.first_of(source),
            })
        }));
        self.recall(now, out);
        self.tally(out);
        self.flush_at = self.has_work().then_some(now + FLUSH_EVERY);
        Ok(())
    }
}

impl Input for In {
    type Key = ();

    fn class(&self) -> InputClass<()> {
        match self {
            In::SampleStored(_) | In::Recalled(_) | In::Dropped(_) => InputClass::Queue,
            In::Have(_) => InputClass::Latest(()),
        }
    }
}

#[cfg(test)]
mod tests;
