//! The imager actor: turns the newest links into a picture. It is slow, so it works alone and its answer
//! takes a configured time; a job that waits while it works is replaced by a newer one.
//!
//! It is told jobs, it says pictures. It keeps the last solution of each kind, so that the next lap starts warm; the last
//! picture of a run is made without it, so that it depends on the samples alone, also after a restart. The solver `auto`
//! decides for that one; those before it are drafts, by `map`.
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
pub const MOST_BLOCKS: usize = 900;

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

/// How the pictures of a subject are made.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SubjectSettings {
    /// While a run lasts.
    pub draft: ImagingSettings,
    /// When it is closed.
    pub last: ImagingSettings,
}

/// Those who make the pictures of a subject.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Solvers {
    draft: Solver,
    /// `None` when drafts and last pictures are made alike.
    last: Option<Solver>,
}

/// The imager actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ImagerActor {
    change: Solvers,
    structure: Solvers,
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
        change: SubjectSettings,
        structure: SubjectSettings,
        takes: Duration,
        times: ImageTimes,
    ) -> Result<ImagerActor, TomoError> {
        let takes = takes.max(Duration::from_nanos(1));
        let (change, structure) = (Solvers::new(change)?, Solvers::new(structure)?);
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
        let (solvers, empty) = match job.subject {
            Subject::Change => (&mut self.change, Some(&job.empty[..])),
            Subject::Structure => (&mut self.structure, None),
        };
        let solver = solvers.of(job.stage);
        let is_last = job.stage == ImageStage::Last;
        let is_whole = is_last || self.times == ImageTimes::Free;
        let extras = Extras {
            persons: is_whole,
            deviation: is_whole.then_some(MOST_BLOCKS),
            shares_of: None,
            links: is_last,
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

impl Solvers {
    fn new(settings: SubjectSettings) -> Result<Solvers, TomoError> {
        let SubjectSettings { draft, last } = settings;
        Ok(Solvers {
            draft: Solver::new(draft)?,
            last: (last != draft).then(|| Solver::new(last)).transpose()?,
        })
    }

    /// Returns who makes the picture of a stage; the last one depends on nothing that was made before.
    fn of(&mut self, stage: ImageStage) -> &mut Solver {
        let is_last = stage == ImageStage::Last;
        let solver = match &mut self.last {
            Some(last) if is_last => last,
            _ => &mut self.draft,
        };
        if is_last {
            solver.forget();
        }
        solver
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect};

    fn picture(imager: &mut ImagerActor, stage: ImageStage) -> Reconstruction {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0));
        let ends = (0..10).map(|k| f64::from(k) * 2.0 + 1.0);
        let link = |x_m: f64| {
            let strength_dbm = if x_m == 9.0 { -72.0 } else { -60.0 };
            let (from, to) = (Point::new(x_m, 0.0), Point::new(20.0 - x_m, area.max.y_m));
            Link::fixed(from, to, 20, strength_dbm)
        };
        let job = Job {
            run: RunId(2),
            laps: 1,
            subject: Subject::Structure,
            now: ends.map(link).collect(),
            empty: Vec::new(),
            stage,
        };
        let mut out = Vec::new();
        imager.handle(Time::ZERO, job, &mut out).unwrap();
        let at = imager.deadline().unwrap().at;
        imager.wake(at, &mut out).unwrap();
        out.pop().unwrap().result.unwrap()
    }

    #[test]
    fn auto_decides_for_the_last_picture_and_those_before_are_drafts() {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0));
        let draft = ImagingSettings::for_area(area);
        let auto = crate::tomo::Solver::Auto(ImagingSettings::candidates_for(area));
        let last = ImagingSettings {
            solver: auto,
            weights: draft.fresnel(),
            ..draft
        };
        let of = |last| {
            let settings = SubjectSettings { draft, last };
            ImagerActor::new(settings, settings, Duration::ZERO, ImageTimes::Lap).unwrap()
        };
        let mut deciding = of(last);
        let lap = picture(&mut deciding, ImageStage::Lap);
        assert_eq!(lap.choice, None);
        assert!(picture(&mut deciding, ImageStage::Last).choice.is_some());
        // The last picture has left the drafts as they were.
        assert_eq!(picture(&mut of(draft), ImageStage::Lap), lap);
        assert_eq!(picture(&mut of(draft), ImageStage::Last).choice, None);
    }
}
