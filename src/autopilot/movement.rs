//! What the autopilot is to do about moving: the vehicle's newest want, until the autopilot has taken it, or for as long as
//! it is to stand. Which command serves it is the link's matter.
//!
//! ```text
//!   any ──Drive, Turn──► [Waiting] ──accepted, refused, not answered three times, or 1 s old──► [Idle]
//!   any ──Stop─────────► [Stopping]     said again whenever telemetry shows motion; until the next Drive or Turn
//!   [Waiting], [Stopping] ──somebody else has taken over──► [Idle]
//! ```

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::fly::Fly;
use crate::time::Time;

/// What could not be begun within this time is not begun any more: the vehicle decides anew.
pub(super) const BEGINS_WITHIN: Duration = Duration::from_secs(1);

/// What the autopilot is to do about moving.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum Movement {
    /// Nothing more than what it was told.
    #[default]
    Idle,
    /// To set out.
    Waiting {
        /// A drive or a turn.
        fly: Fly,
        /// Since when the vehicle wants that.
        since: Time,
    },
    /// To stand.
    Stopping(Stopping),
}

/// A stop under way.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct Stopping {
    /// When it was said last.
    pub said: Option<Time>,
    /// Whether telemetry has shown rest since.
    pub is_shown: bool,
}

impl Movement {
    /// Sets out.
    pub fn wait(&mut self, now: Time, fly: Fly) {
        *self = Movement::Waiting { fly, since: now };
    }

    /// Stops. Wanted again, it is said again unless that was just done.
    pub fn stop(&mut self, now: Time, again: Duration) {
        match self {
            Movement::Stopping(stopping)
                if stopping.said.is_some_and(|said| now.since(said) < again) => {}
            Movement::Idle | Movement::Waiting { .. } | Movement::Stopping(_) => {
                *self = Movement::Stopping(Stopping::default());
            }
        }
    }

    /// Ends a drive or a turn that waits; a stop goes on.
    pub fn give_up_waiting(&mut self) {
        match self {
            Movement::Waiting { .. } => *self = Movement::Idle,
            Movement::Idle | Movement::Stopping(_) => {}
        }
    }

    /// Takes whether telemetry shows rest.
    pub fn take(&mut self, rests: bool) {
        if let Movement::Stopping(stopping) = self {
            stopping.is_shown = rests;
        }
    }

    /// Takes note that a stop is said now.
    pub fn stop_said(&mut self, now: Time) {
        if let Movement::Stopping(stopping) = self {
            (stopping.said, stopping.is_shown) = (Some(now), false);
        }
    }

    /// Returns when a stop is to be said: at once, or again as long as telemetry shows no rest.
    pub fn stop_due(&self, again: Duration) -> Option<Time> {
        match self {
            Movement::Stopping(Stopping {
                said: None,
                is_shown: false,
            }) => Some(Time::ZERO),
            Movement::Stopping(Stopping {
                said: Some(said),
                is_shown: false,
            }) => Some(*said + again),
            Movement::Idle | Movement::Waiting { .. } | Movement::Stopping(_) => None,
        }
    }

    /// Returns when what waits is too old.
    pub fn waits_until(&self) -> Option<Time> {
        match self {
            Movement::Waiting { since, .. } => Some(*since + BEGINS_WITHIN),
            Movement::Idle | Movement::Stopping(_) => None,
        }
    }
}
