//! Images while vehicles drive: one is asked for whenever the last one is made and there are new samples. Which images a run
//! must have is not decided here.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::RunId;

use super::pictures::PictureName;
use crate::ground::imager::ImageStage;
use crate::time::Time;

/// An image that was not made after this long is not waited for.
const MADE_WITHIN: Duration = Duration::from_secs(60);

/// Which image was asked for last.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct OngoingImages {
    /// Of which run, and of how many samples.
    last: Option<(RunId, u64)>,
    /// When, while it is not made.
    asked_at: Option<Time>,
}

impl OngoingImages {
    /// Returns whether an image of a run with so many samples is to be asked for now; if so, it counts as asked for.
    pub(super) fn ask(&mut self, now: Time, run: RunId, samples: u64) -> bool {
        let is_waited_for = self.asked_at.is_some_and(|at| now.since(at) < MADE_WITHIN);
        let is_new = samples > 0 && self.last != Some((run, samples));
        if is_waited_for || !is_new {
            return false;
        }
        (self.last, self.asked_at) = (Some((run, samples)), Some(now));
        true
    }

    /// Records that an image was made.
    pub(super) fn take(&mut self, made: PictureName) {
        if made.stage == ImageStage::Ongoing {
            self.asked_at = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::imager::Subject;

    const RUN: RunId = RunId(2);

    fn at(at_s: u64) -> Time {
        Time::ZERO + Duration::from_secs(at_s)
    }

    fn made(stage: ImageStage) -> PictureName {
        PictureName {
            run: RUN,
            laps: 1,
            subject: Subject::Change,
            stage,
        }
    }

    #[test]
    fn an_image_is_asked_for_when_the_last_one_is_made_and_there_are_new_samples() {
        let mut images = OngoingImages::default();
        assert!(!images.ask(at(1), RUN, 0), "nothing was measured");
        assert!(images.ask(at(2), RUN, 5));
        assert!(!images.ask(at(3), RUN, 9), "it is being made");
        images.take(made(ImageStage::Lap));
        assert!(!images.ask(at(4), RUN, 9), "another one was made");
        images.take(made(ImageStage::Ongoing));
        assert!(!images.ask(at(5), RUN, 5), "nothing is new");
        assert!(images.ask(at(6), RUN, 9));
    }

    #[test]
    fn an_image_that_does_not_come_is_not_waited_for_for_ever() {
        let mut images = OngoingImages::default();
        assert!(images.ask(at(1), RUN, 5));
        assert!(!images.ask(at(60), RUN, 6));
        assert!(images.ask(at(61), RUN, 6));
    }
}
