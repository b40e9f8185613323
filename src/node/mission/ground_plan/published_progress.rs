//! How far the vehicle was with its plan when that was asked last, so that only news is told.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::RunId;

use crate::sweep::VehicleProgress;

/// What was told last.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct PublishedProgress {
    progress: VehicleProgress,
    /// It was told that all stops are done.
    is_end_told: bool,
}

/// What has changed since it was last asked.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(in crate::node::mission) struct PlanChanges {
    /// How far the vehicle is.
    pub progress: Option<VehicleProgress>,
    /// That is under another revision than before.
    pub is_adopted: bool,
    /// All stops of this run are done.
    pub finished: Option<RunId>,
}

impl PublishedProgress {
    /// Makes that of a vehicle that has told this, and no end.
    pub(super) fn new(progress: VehicleProgress) -> PublishedProgress {
        PublishedProgress {
            progress,
            is_end_told: false,
        }
    }

    /// Returns how far the vehicle was.
    pub(super) fn progress(&self) -> VehicleProgress {
        self.progress
    }

    /// Returns whether it was told that all stops of the plan are done.
    pub(super) fn is_end_told(&self) -> bool {
        self.is_end_told
    }

    /// Records how far the vehicle is, and whether all stops are done; returns what of it is news.
    pub(super) fn news(&mut self, progress: VehicleProgress, is_finished: bool) -> PlanChanges {
        let progress = VehicleProgress {
            boot: self.progress.boot,
            ..progress
        };
        let edition = |progress: &VehicleProgress| (progress.run, progress.revision);
        let is_adopted = edition(&progress) != edition(&self.progress);
        self.is_end_told &= !is_adopted;
        // An empty revision, which only brings everyone to rest, has no end to tell.
        let is_end = is_finished && !self.is_end_told && progress.done.is_some();
        self.is_end_told |= is_end;
        let is_news = progress != std::mem::replace(&mut self.progress, progress);
        PlanChanges {
            progress: is_news.then_some(progress),
            is_adopted,
            finished: is_end.then_some(progress.run),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, Revision, StopId};

    fn progress(revision: u32, done: Option<u32>) -> VehicleProgress {
        VehicleProgress {
            run: RunId(3),
            revision: Revision(revision),
            done: done.map(StopId),
            ..VehicleProgress::default()
        }
    }

    #[test]
    fn progress_and_end_are_news_once_in_each_revision() {
        let mut published = PublishedProgress::new(VehicleProgress {
            boot: Boot(7),
            ..VehicleProgress::default()
        });
        let news = published.news(progress(1, None), false);
        assert!(news.is_adopted && news.finished.is_none());
        assert_eq!(news.progress.map(|progress| progress.boot), Some(Boot(7)));
        assert_eq!(
            published.news(progress(1, None), false),
            PlanChanges::default()
        );
        assert_eq!(
            published.news(progress(1, None), true).finished,
            None,
            "of nothing"
        );
        let ended = published.news(progress(1, Some(4)), true);
        assert_eq!((ended.is_adopted, ended.finished), (false, Some(RunId(3))));
        assert!(published.is_end_told());
        assert_eq!(
            published.news(progress(1, Some(4)), true),
            PlanChanges::default()
        );
        assert!(published.news(progress(2, None), false).is_adopted && !published.is_end_told());
        assert_eq!(
            published.news(progress(2, Some(1)), true).finished,
            Some(RunId(3))
        );
    }
}
