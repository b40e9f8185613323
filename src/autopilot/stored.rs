//! The mission that the autopilot is to store and carry out: how far that has come. Which command serves it is the link's
//! matter.
//!
//! ```text
//!   any ──FollowStored──► [Uploading] ──accepted──► [Choosing] ──accepted──► [Entering] ──shows AUTO──► [UnderWay] ──► [Over]
//!                             │ └── stored already ──►  ▲                                          last item done
//!   [Uploading], [Choosing], [Entering] ── refused, or not answered ──► [Failed]
//!   any ──Stop, Drive, Turn, Disarm, somebody else has taken over──► [None]
//! ```
//!
//! What the autopilot was seen to take is not sent again, unless it may have been changed meanwhile: by a silence, a start, or
//! somebody else who steers.

use serde::{Deserialize, Serialize};

use super::command::{Command, FlightMode};
use super::item::Item;
use super::report::{StoredPhase, StoredProgress, StoredReport};
use super::steering::OLD_MODE_SHOWS;
use crate::time::Time;

/// A mission that the autopilot is to store.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct StoredMissionGoal {
    /// What it stores, as far as that is known.
    known: Option<Vec<Item>>,
    goal: Option<Goal>,
    /// When its mission was over last, or was told another item and may have been over by then.
    may_have_ended: Option<Time>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Goal {
    items: Vec<Item>,
    /// The item to begin with, then the one under way.
    item: usize,
    phase: Phase,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
enum Phase {
    Uploading,
    Choosing,
    Entering,
    UnderWay,
    Over,
    Failed,
}

impl StoredMissionGoal {
    /// Begins with an item of a mission.
    pub(super) fn follow(&mut self, items: Vec<Item>, from: usize) {
        let phase = match self.known.as_ref() == Some(&items) {
            true => Phase::Choosing,
            false => Phase::Uploading,
        };
        self.goal = Some(Goal {
            items,
            item: from,
            phase,
        });
    }

    /// Nothing is to be carried out any more.
    pub(super) fn drop_goal(&mut self) {
        self.goal = None;
    }

    /// What the autopilot stores may be something else by now.
    pub(super) fn doubt(&mut self) {
        self.known = None;
    }

    /// Returns what is to be told next; a change of mode is left out once it was told. One that carries out a mission is not
    /// given another one before it stands.
    pub(super) fn next_command(&self, own_mode: Option<FlightMode>) -> Option<Command> {
        let Goal { items, item, phase } = self.goal.as_ref()?;
        match phase {
            Phase::Uploading if own_mode == Some(FlightMode::Auto) => {
                Some(Command::Mode(FlightMode::Guided))
            }
            Phase::Uploading => Some(Command::Upload(items.clone())),
            Phase::Choosing => Some(Command::SetCurrent(*item)),
            Phase::Entering if own_mode != Some(FlightMode::Auto) => {
                Some(Command::Mode(FlightMode::Auto))
            }
            Phase::Entering | Phase::UnderWay | Phase::Over | Phase::Failed => None,
        }
    }

    /// The autopilot has accepted what it was told of it.
    pub(super) fn accepted(&mut self) {
        let Some(goal) = &mut self.goal else {
            return;
        };
        match goal.phase {
            Phase::Uploading => {
                self.known = Some(goal.items.clone());
                goal.phase = Phase::Choosing;
            }
            Phase::Choosing => goal.phase = Phase::Entering,
            Phase::Entering | Phase::UnderWay | Phase::Over | Phase::Failed => {}
        }
    }

    /// What has not begun does not begin.
    pub(super) fn fail(&mut self) {
        if let Some(goal) = &mut self.goal {
            match goal.phase {
                Phase::Uploading | Phase::Choosing | Phase::Entering => {
                    // It may have taken a part of it.
                    self.known = None;
                    goal.phase = Phase::Failed;
                }
                Phase::UnderWay | Phase::Over | Phase::Failed => {}
            }
        }
    }

    /// Takes what the autopilot shows, in a mode that is explained.
    pub(super) fn take(&mut self, now: Time, mode: FlightMode, stored: StoredReport) {
        let phase = self.goal.as_ref().map(|goal| goal.phase);
        if stored.is_over || phase == Some(Phase::Choosing) {
            self.may_have_ended = Some(now);
        }
        let Some(goal) = &mut self.goal else {
            return;
        };
        if goal.phase == Phase::Entering && mode == FlightMode::Auto {
            goal.phase = Phase::UnderWay;
        }
        if goal.phase == Phase::UnderWay {
            goal.item = usize::from(stored.item);
            if stored.is_over {
                goal.phase = Phase::Over;
            } else if mode != FlightMode::Auto {
                // It was over before it was told to go on.
                goal.phase = Phase::Failed;
            }
        }
    }

    /// Returns whether the autopilot may have left AUTO by itself: its mission is over, or was when it was told another item.
    pub(super) fn may_have_ended(&self, now: Time, stored: StoredReport) -> bool {
        let is_recent = |at: Time| now.since(at) <= OLD_MODE_SHOWS;
        stored.is_over || self.may_have_ended.is_some_and(is_recent)
    }

    /// Returns whether the autopilot carries it out.
    pub(super) fn is_under_way(&self) -> bool {
        let phase = self.goal.as_ref().map(|goal| goal.phase);
        phase == Some(Phase::UnderWay)
    }

    /// Returns how far it is; `None` = nothing is to be carried out.
    pub(super) fn progress(&self) -> Option<StoredProgress> {
        let Goal { item, phase, .. } = self.goal.as_ref()?;
        let (item, phase) = match phase {
            Phase::Uploading | Phase::Choosing | Phase::Entering => (0, StoredPhase::Preparing),
            Phase::UnderWay => (*item, StoredPhase::UnderWay),
            Phase::Over => (*item, StoredPhase::Over),
            Phase::Failed => (0, StoredPhase::Failed),
        };
        Some(StoredProgress {
            item: u16::try_from(item).unwrap_or(u16::MAX),
            phase,
        })
    }
}
