//! The pictures of runs: which jobs the imager is given, and which last pictures of closed runs are still due. A last picture
//! that does not come is asked for again, as it is after a restart.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::RunId;

use super::execution::SweepRun;
use crate::ground::imager::{ImageStage, Job, ReconstructedImage, Subject};
use crate::ground::samples::SampleStore;
use crate::time::Time;

/// Last pictures that did not come after this long are asked for again.
const PICTURED_WITHIN: Duration = Duration::from_secs(120);

/// What a picture is named by.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct PictureName {
    /// Of which run.
    pub run: RunId,
    /// After how many laps.
    pub laps: usize,
    /// What is seen in it.
    pub subject: Subject,
    /// When in the run.
    pub stage: ImageStage,
}

impl PictureName {
    /// Names a picture that was made, or that cannot be.
    pub fn of(picture: &ReconstructedImage) -> PictureName {
        PictureName {
            run: picture.run,
            laps: picture.laps,
            subject: picture.subject,
            stage: picture.stage,
        }
    }

    fn of_sweep(sweep: &SweepRun, subject: Subject, stage: ImageStage) -> PictureName {
        PictureName {
            run: sweep.run(),
            laps: sweep.laps_done(),
            subject,
            stage,
        }
    }

    /// Returns the job to make it; the links of `compared_with` are for changes only.
    fn job(self, compared_with: Option<RunId>, samples: &SampleStore) -> Job {
        let PictureName {
            run,
            laps,
            subject,
            stage,
        } = self;
        let compared_with = match subject {
            Subject::Change => compared_with,
            Subject::Structure => None,
        };
        let (now, empty) = match compared_with {
            Some(empty) => samples.links_against(run, empty),
            None => (samples.links(run), Vec::new()),
        };
        Job {
            run,
            laps,
            subject,
            now,
            empty,
            stage,
        }
    }
}

/// Returns the job for a picture of a sweep under way: of what has changed, if it is compared, otherwise of what stands there.
pub(super) fn job_of_ongoing(sweep: &SweepRun, samples: &SampleStore) -> Job {
    let subject = match sweep.compared_with() {
        Some(_) => Subject::Change,
        None => Subject::Structure,
    };
    PictureName::of_sweep(sweep, subject, ImageStage::Ongoing).job(sweep.compared_with(), samples)
}

/// Returns the job for a picture of what has changed, after a lap; `None` when the sweep is compared with none.
pub(super) fn job_of_change(sweep: &SweepRun, samples: &SampleStore) -> Option<Job> {
    let compared_with = sweep.compared_with()?;
    let name = PictureName::of_sweep(sweep, Subject::Change, ImageStage::Lap);
    Some(name.job(Some(compared_with), samples))
}

/// The pictures that are due.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct Pictures {
    /// How many have come that were not for a sweep under way only; that each is counted is remembered by this.
    taken: u32,
    /// Last pictures of runs that are not made yet, and the run that each is compared with.
    due: Vec<(PictureName, Option<RunId>)>,
    /// When they were asked for last; `None` = the station was started anew since.
    asked_at: Option<Time>,
}

impl Pictures {
    /// Goes on where an earlier start of the station was: what is due is asked for again.
    pub(super) fn restored(self) -> Pictures {
        Pictures {
            asked_at: None,
            ..self
        }
    }

    /// Returns the jobs for the last pictures of a run that is closed; they are due from now on.
    pub(super) fn close(
        &mut self,
        now: Time,
        run: RunId,
        laps: usize,
        compared_with: Option<RunId>,
        samples: &SampleStore,
    ) -> Vec<Job> {
        let change = compared_with.map(|_| Subject::Change);
        let subjects = change.into_iter().chain([Subject::Structure]);
        let names = subjects.map(|subject| PictureName {
            run,
            laps,
            subject,
            stage: ImageStage::Last,
        });
        let first = self.due.len();
        self.due.extend(names.map(|name| (name, compared_with)));
        self.asked_at = Some(now);
        jobs(&self.due[first..], samples)
    }

    /// Records that a picture was made or cannot be; returns whether it was the last one that was due of its run.
    pub(super) fn take(&mut self, taken: PictureName) -> bool {
        self.taken = self.taken.saturating_add(1);
        let was_due = self.due.len();
        self.due.retain(|(name, _)| *name != taken);
        self.due.len() < was_due && !self.due.iter().any(|(name, _)| name.run == taken.run)
    }

    /// Returns the jobs for all pictures that are due if they have not come in time, or the station was started anew.
    pub(super) fn ask_again(&mut self, now: Time, samples: &SampleStore) -> Vec<Job> {
        let is_in_time = |at: Time| now.since(at) <= PICTURED_WITHIN;
        if self.asked_at.is_some_and(is_in_time) {
            return Vec::new();
        }
        self.asked_at = Some(now);
        jobs(&self.due, samples)
    }

    /// Returns whether two are the same, whatever their times. Every field is named, so that none is forgotten.
    pub(super) fn is_same_but_for_times(&self, other: &Pictures) -> bool {
        let Pictures {
            taken,
            due,
            asked_at: _,
        } = self;
        *taken == other.taken && *due == other.due
    }
}

fn jobs(due: &[(PictureName, Option<RunId>)], samples: &SampleStore) -> Vec<Job> {
    due.iter()
        .map(|(name, compared_with)| name.job(*compared_with, samples))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::run_registry::RequestedSweep;
    use super::*;
    use tomoswarm_proto::{Boot, PoseReport, Position, Sample, Samples, VehicleId};

    const RUN: RunId = RunId(2);

    fn at(at_s: u64) -> Time {
        Time::ZERO + Duration::from_secs(at_s)
    }

    /// A store with a link of run 1 and two of run 2.
    fn samples() -> SampleStore {
        let mut store = SampleStore::new(7, 0.5, 0.06);
        for (run, sequence) in [(1, 0), (2, 0), (2, 1)] {
            let pose = |x_m: f64| PoseReport {
                at: Position::from_metres(x_m, 0.0, 0.0),
                ..PoseReport::default()
            };
            let sample = Sample {
                sequence,
                heard_at_ns: 0,
                transmitter: VehicleId(9),
                transmitter_pose: pose(2.0 + 2.0 * sequence as f64),
                receiver_pose: pose(0.0),
                channel: 11,
                power_dbm: 0,
                rssi_dbm: Some(-50),
            };
            store.take(&Samples {
                vehicle: VehicleId(1),
                boot: Boot(1),
                run: RunId(run),
                samples: vec![sample],
                lost: vec![],
            });
        }
        store
    }

    fn subjects(jobs: &[Job]) -> Vec<(Subject, usize, usize, ImageStage)> {
        let of = |job: &Job| (job.subject, job.now.len(), job.empty.len(), job.stage);
        jobs.iter().map(of).collect()
    }

    fn name(subject: Subject) -> PictureName {
        PictureName {
            run: RUN,
            laps: 3,
            subject,
            stage: ImageStage::Last,
        }
    }

    #[test]
    fn a_closed_run_has_a_picture_of_its_structure_and_one_of_changes_if_it_is_compared() {
        let mut pictures = Pictures::default();
        let compared = pictures.close(at(0), RUN, 3, Some(RunId(1)), &samples());
        assert_eq!(
            subjects(&compared),
            [
                (Subject::Change, 2, 1, ImageStage::Last),
                (Subject::Structure, 2, 0, ImageStage::Last)
            ]
        );
        let alone = pictures.close(at(0), RunId(1), 1, None, &samples());
        assert_eq!(
            subjects(&alone),
            [(Subject::Structure, 1, 0, ImageStage::Last)]
        );
        let sweep = |compared_with| {
            SweepRun::new(RequestedSweep {
                run: RUN,
                compared_with,
            })
        };
        let (compared, alone) = (sweep(Some(RunId(1))), sweep(None));
        let lap = job_of_change(&compared, &samples()).unwrap();
        let ongoing = [&compared, &alone].map(|sweep| job_of_ongoing(sweep, &samples()));
        assert_eq!(job_of_change(&alone, &samples()), None);
        assert_eq!(subjects(&[lap]), [(Subject::Change, 2, 1, ImageStage::Lap)]);
        assert_eq!(
            subjects(&ongoing),
            [
                (Subject::Change, 2, 1, ImageStage::Ongoing),
                (Subject::Structure, 2, 0, ImageStage::Ongoing)
            ]
        );
    }

    #[test]
    fn a_run_is_done_with_the_last_picture_that_is_due_and_not_by_others() {
        let mut pictures = Pictures::default();
        let lap = PictureName {
            laps: 1,
            stage: ImageStage::Lap,
            ..name(Subject::Change)
        };
        assert!(!pictures.take(lap), "none is due");
        pictures.close(at(0), RUN, 3, Some(RunId(1)), &samples());
        assert!(!pictures.take(lap));
        assert!(!pictures.take(name(Subject::Structure)));
        assert!(pictures.take(name(Subject::Change)));
        assert!(!pictures.take(name(Subject::Change)), "it was not due");
    }

    #[test]
    fn what_does_not_come_is_asked_for_again_and_after_a_restart_at_once() {
        let mut pictures = Pictures::default();
        pictures.close(at(0), RUN, 3, Some(RunId(1)), &samples());
        pictures.take(name(Subject::Change));
        let asks = |pictures: &mut Pictures, at_s: u64| {
            subjects(&pictures.ask_again(at(at_s), &samples())).len()
        };
        assert_eq!((asks(&mut pictures, 120), asks(&mut pictures, 121)), (0, 1));
        assert_eq!(asks(&mut pictures, 122), 0);
        let mut restored = pictures.clone().restored();
        assert!(restored.is_same_but_for_times(&pictures));
        assert_eq!(asks(&mut restored, 1), 1);
        restored.take(name(Subject::Structure));
        assert!(!restored.is_same_but_for_times(&pictures));
        assert_eq!(asks(&mut restored, 200), 0);
    }
}
