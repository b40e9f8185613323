//! The imager actor: turns the newest links into a picture. It is slow, so it works alone and its answer
//! takes a configured time; a job that waits while it works is replaced by a newer one.
//!
//! It is told jobs, it says pictures. It keeps the last solution of each kind, so that the next lap starts warm; the last
//! picture of a run is made without it, so that it depends on the samples alone, also after a restart.
//!
//! Deadline: `picture ready`.

use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::RunId;

use crate::actor::{Actor, Fault, Input, InputClass};
use crate::config::ImageTimes;
use crate::time::{Deadline, Time};
use crate::tomo::{Extras, Imager as Solver, ImagingSettings, Link, Reconstruction, TomoError};

/// Deviations are computed for so many blocks of pixels at most: 30 ms and a few megabytes on a desk.
const MOST_BLOCKS: usize = 900;

/// What is to be seen in a picture.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum Subject {
    /// What changed since the empty sweep.
    Change,
    /// What stands there, from a fitted path loss.
    Structure,
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Subject::Change => "image of the change",
            Subject::Structure => "image of the structure",
        })
    }
}

/// When in a run a picture is made.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum ImageStage {
    /// While vehicles drive; it is shown, and not kept.
    Ongoing,
    /// After a lap.
    Lap,
    /// When the run is closed.
    Last,
}

/// A picture to be made.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Job {
    /// Of which run.
    pub run: RunId,
    /// After how many laps.
    pub laps: usize,
    /// What shall be seen in it.
    pub subject: Subject,
    /// Links of the run.
    pub now: Vec<Link>,
    /// Links of the empty sweep, for [`Subject::Change`].
    pub empty: Vec<Link>,
    /// When in the run.
    pub stage: ImageStage,
}

/// A picture that was made.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ReconstructedImage {
    /// Of which run.
    pub run: RunId,
    /// After how many laps.
    pub laps: usize,
    /// What is seen in it.
    pub subject: Subject,
    /// When in the run.
    pub stage: ImageStage,
    /// The picture, or why there is none.
    pub result: Result<Reconstruction, String>,
}

/// The imager actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ImagerActor {
    change: Solver,
    structure: Solver,
    takes: Duration,
    times: ImageTimes,
    waiting: Vec<Job>,
    working: Option<(Time, ReconstructedImage)>,
}

impl ImagerActor {
    /// Makes an imager whose pictures take `takes` to make, with settings for each subject. When they are made
    /// freely it searches persons and computes deviations in each, otherwise persons in the last one of a run.
    ///
    /// # Errors
    /// The settings name an impossible grid.
    pub fn new(
        change: ImagingSettings,
        structure: ImagingSettings,
        takes: Duration,
        times: ImageTimes,
    ) -> Result<ImagerActor, TomoError> {
        let takes = takes.max(Duration::from_nanos(1));
        let (change, structure) = (Solver::new(change)?, Solver::new(structure)?);
        Ok(ImagerActor {
            change,
            structure,
            takes,
            times,
            waiting: Vec::new(),
            working: None,
        })
    }

    fn begin(&mut self, now: Time) {
        if self.working.is_some() || self.waiting.is_empty() {
            return;
        }
        let job = self.waiting.remove(0);
        let (solver, empty) = match job.subject {
            Subject::Change => (&mut self.change, Some(&job.empty[..])),
            Subject::Structure => (&mut self.structure, None),
        };
        if job.stage == ImageStage::Last {
            solver.forget();
        }
        let is_free = self.times == ImageTimes::Free;
        let extras = Extras {
            persons: is_free || job.stage == ImageStage::Last,
            deviation: is_free.then_some(MOST_BLOCKS),
            shares_of: None,
        };
        let result = solver.update(&job.now, empty, extras);
        let result = result.map_err(|error| error.to_string());
        let picture = ReconstructedImage {
            run: job.run,
            laps: job.laps,
            subject: job.subject,
            stage: job.stage,
            result,
        };
        self.working = Some((now + self.takes, picture));
    }
}

impl Actor for ImagerActor {
    type In = Job;
    type Out = ReconstructedImage;

    fn handle(
        &mut self,
        now: Time,
        job: Job,
        _out: &mut Vec<ReconstructedImage>,
    ) -> Result<(), Fault> {
        self.waiting.retain(|waiting| waiting.key() != job.key());
        self.waiting.push(job);
        self.begin(now);
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let (at, _) = self.working.as_ref()?;
        Some(Deadline {
            at: *at,
            why: "picture ready",
        })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<ReconstructedImage>) -> Result<(), Fault> {
        out.extend(self.working.take().map(|(_, picture)| picture));
        self.begin(now);
        Ok(())
    }
}

impl Job {
    /// Returns what a newer job must share to replace it.
    fn key(&self) -> (RunId, Subject, ImageStage) {
        (self.run, self.subject, self.stage)
    }
}

impl Input for Job {
    type Key = (RunId, Subject, ImageStage);

    fn class(&self) -> InputClass<(RunId, Subject, ImageStage)> {
        InputClass::Latest(self.key())
    }
}
