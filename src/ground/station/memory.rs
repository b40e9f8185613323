//! What a station that is started anew needs to go on where it was, and how it does so.
//!
//! The station says [`Out::Remember`] *before* everything else that it says in the same step, whenever something in it
//! has changed; the edge stores it before it publishes what follows. So no vehicle ever follows a revision or obeys an
//! order that a resumed station does not know, and a revision is never given twice. What can be heard again is not
//! kept: states, progress, who reports a revision. Samples and tiles come from their own tables.
//!
//! A resumed station listens first and takes a lease above the highest echo; the same plans go out under the new lease.
//! It plans anew only when something is wrong: a vehicle was restarted or lost meanwhile, or shows a revision that it
//! has not given. Plans that were being made are asked for again, and pictures that were due are made again.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Lease, Message, OrderKind, Revision, RunId, Samples, TileReport, VehicleId};

use super::super::fleet::Dealings;
use super::super::imager::{Picture, Subject};
use super::leases::Leases;
use super::runs::Runs;
use super::{In, Out, Phase, Station, StationSettings, Sweep, Wished};
use crate::actor::Actor;
use crate::sweep::Succession;
use crate::time::Time;

/// What a picture is named by.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct PictureName {
    /// Of which run.
    pub run: RunId,
    /// After how many laps.
    pub laps: usize,
    /// What is seen in it.
    pub subject: Subject,
}

impl PictureName {
    /// Names a picture that was made.
    pub fn of(picture: &Picture) -> PictureName {
        PictureName {
            run: picture.run,
            laps: picture.laps,
            subject: picture.subject,
        }
    }
}

/// All but the plans, which change only with the revision.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct Brief {
    store: u64,
    lease: Lease,
    phase: Phase,
    succession: Option<(RunId, Revision, Vec<VehicleId>)>,
    dealings: Vec<(VehicleId, Dealings)>,
    wished: Option<Wished>,
    newest_run: RunId,
    standing: Option<OrderKind>,
    closed: Vec<RunId>,
    last: Option<Sweep>,
    runs: Runs,
    stalled: bool,
    disturbed: bool,
    pictures: u32,
    due: Vec<(PictureName, Option<RunId>)>,
}

/// What a station that is started anew needs; only for the version of the program that wrote it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct StationMemory {
    brief: Brief,
    plans: Option<Succession>,
}

impl StationMemory {
    /// Returns the id of the store that it belongs to.
    pub fn store(&self) -> u64 {
        self.brief.store
    }

    /// Returns the run that is under way, if any.
    pub fn run(&self) -> Option<RunId> {
        self.brief.phase.sweep().map(|sweep| sweep.run)
    }

    /// Returns the runs that are closed, ascending.
    pub fn closed(&self) -> &[RunId] {
        &self.brief.closed
    }

    /// Returns the lease that was held last.
    pub fn lease(&self) -> Lease {
        self.brief.lease
    }
}

impl Brief {
    /// Returns whether it is the brief of a station as it is now. It is asked after every step, so nothing is copied.
    fn is_of(&self, station: &Station) -> bool {
        // Taken apart, so that none can be forgotten.
        let Brief {
            store,
            lease,
            phase,
            succession,
            dealings,
            wished,
            newest_run,
            standing,
            closed,
            last,
            runs,
            stalled,
            disturbed,
            pictures,
            due,
        } = self;
        let edition = succession
            .as_ref()
            .map(|(run, revision, members)| (*run, *revision, &members[..]));
        let dealings = dealings.iter().map(|(id, dealings)| (*id, dealings));
        *store == station.samples.store()
            && *lease == station.leases.own()
            && *phase == station.phase
            && edition == station.succession.as_ref().map(edition_of)
            && station
                .fleet
                .members()
                .map(|(id, member)| (id, member.dealings()))
                .eq(dealings)
            && *wished == station.wished
            && *newest_run == station.newest_run
            && *standing == station.standing
            && closed.iter().eq(&station.closed)
            && *last == station.last
            && *runs == station.runs
            && (*stalled, *disturbed) == (station.stalled, station.disturbed)
            && *pictures == station.pictures
            && *due == station.due
    }
}

/// Returns which plans a succession gives, and to whom.
fn edition_of(succession: &Succession) -> (RunId, Revision, &[VehicleId]) {
    (
        succession.run(),
        succession.revision(),
        succession.members(),
    )
}

impl Station {
    /// Makes a station that goes on where an earlier one was, with what was stored of samples and tiles, in any order.
    ///
    /// Of the settings, `lease` and `store` are not used: it listens, and its store is the one remembered.
    pub fn resume(
        settings: StationSettings,
        memory: StationMemory,
        samples: impl IntoIterator<Item = Samples>,
        tiles: impl IntoIterator<Item = TileReport>,
    ) -> Station {
        let StationMemory { brief, plans } = memory;
        let last = Lease {
            number: brief.lease.number,
            holder: settings.holder,
        };
        let leases = Leases::listening(last, settings.take_over);
        let mut station = Station::new(StationSettings {
            store: brief.store,
            ..settings
        });
        station.leases = leases;
        station.fleet.set_lease(last);
        station.fleet.recall(&brief.dealings);
        station.phase = brief.phase;
        station.succession = plans;
        station
            .succession
            .iter_mut()
            .for_each(Succession::forget_reports);
        (station.wished, station.newest_run) = (brief.wished, brief.newest_run);
        station.standing = brief.standing;
        station.closed = brief.closed.into_iter().collect();
        (station.last, station.stalled, station.disturbed) =
            (brief.last, brief.stalled, brief.disturbed);
        station.runs = brief.runs;
        (station.pictures, station.due) = (brief.pictures, brief.due);
        samples.into_iter().for_each(|batch| {
            station.samples.take(&batch);
        });
        tiles
            .into_iter()
            .for_each(|tile| station.join(Time::ZERO, &tile));
        station.remembered = Some(station.brief());
        station
    }

    /// Makes a station that is started anew, with what was stored of samples and tiles, in any order: it goes on where an
    /// earlier one was, as far as that is remembered. Otherwise it begins, and no run counts as begun.
    pub fn restored(
        settings: StationSettings,
        memory: Option<StationMemory>,
        samples: impl IntoIterator<Item = Samples>,
        tiles: impl IntoIterator<Item = TileReport>,
    ) -> Station {
        if let Some(memory) = memory {
            return Station::resume(settings, memory, samples, tiles);
        }
        let mut station = Station::new(settings);
        let samples = samples.into_iter().map(Message::Samples);
        for message in samples.chain(tiles.into_iter().map(Message::Tile)) {
            // Nothing that is stored can stop a station, and nothing that it says of it is news.
            let _ = station.handle(Time::ZERO, In::Bus(message), &mut Vec::new());
        }
        station
    }

    pub(super) fn brief(&self) -> Brief {
        let edition = self.succession.as_ref().map(edition_of);
        Brief {
            store: self.samples.store(),
            lease: self.leases.own(),
            phase: self.phase.clone(),
            succession: edition.map(|(run, revision, members)| (run, revision, members.to_vec())),
            dealings: self.fleet.dealings(),
            wished: self.wished,
            newest_run: self.newest_run,
            standing: self.standing,
            closed: self.closed.iter().copied().collect(),
            last: self.last,
            runs: self.runs.clone(),
            stalled: self.stalled,
            disturbed: self.disturbed,
            pictures: self.pictures,
            due: self.due.clone(),
        }
    }

    /// Remembers what a step has changed, ahead of all that it said from `first` on.
    pub(super) fn remember(&mut self, first: usize, out: &mut Vec<Out>) {
        let is_known = self
            .remembered
            .as_ref()
            .is_some_and(|brief| brief.is_of(self));
        debug_assert_eq!(is_known, self.remembered.as_ref() == Some(&self.brief()));
        if !is_known {
            let brief = self.brief();
            self.remembered = Some(brief.clone());
            let memory = StationMemory {
                brief,
                plans: self.succession.clone(),
            };
            out.insert(first.min(out.len()), Out::Remember(Box::new(memory)));
        }
    }

    /// Goes on after a time without a lease, or after a restart: nothing was heard or driven wrongly meanwhile.
    pub(super) fn count_from(&mut self, now: Time) {
        (self.planned_at, self.got_on_at, self.wished_at) = (now, now, now);
        self.fleet.count_silence_from(now);
        match &mut self.phase {
            // The answer was not heard, or came too late.
            Phase::Planning(sweep) => self.phase = Phase::Stopping(*sweep),
            Phase::Closing { since, .. } => *since = now,
            Phase::Idle | Phase::Running(..) | Phase::Stopping(_) => {}
        }
    }
}
