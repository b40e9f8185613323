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

use super::autopilot_command::AutopilotCommand;
use crate::time::Time;

/// What could not be begun within this time is not begun any more: the vehicle decides anew.
pub(super) const BEGINS_WITHIN: Duration = Duration::from_secs(1);

/// What the autopilot is to do about moving.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum DriveUnderWay {
    /// Nothing more than what it was told.
    #[default]
    Idle,
    /// To set out.
    Waiting {
        /// A drive or a turn.
        fly: AutopilotCommand,
        /// Since when the vehicle wants that.
        since: Time,
    },
    /// To stand.
    Stopping(StopUnderWay),
}

/// A stop under way.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct StopUnderWay {
    /// When it was said last.
    pub sent_at: Option<Time>,
    /// Whether telemetry has shown rest since.
    pub is_shown: bool,
}

impl DriveUnderWay {
    /// Sets out.
    pub(super) fn wait(&mut self, now: Time, fly: AutopilotCommand) {
        *self = DriveUnderWay::Waiting { fly, since: now };
    }

    /// Stops. Wanted again, it is said again unless that was just done.
    pub(super) fn stop(&mut self, now: Time, again: Duration) {
        match self {
            DriveUnderWay::Stopping(stopping)
                if stopping
                    .sent_at
                    .is_some_and(|sent_at| now.since(sent_at) < again) => {}
            DriveUnderWay::Idle | DriveUnderWay::Waiting { .. } | DriveUnderWay::Stopping(_) => {
                *self = DriveUnderWay::Stopping(StopUnderWay::default());
            }
        }
    }

    /// Ends a drive or a turn that waits; a stop goes on.
    pub(super) fn give_up_waiting(&mut self) {
        match self {
            DriveUnderWay::Waiting { .. } => *self = DriveUnderWay::Idle,
            DriveUnderWay::Idle | DriveUnderWay::Stopping(_) => {}
        }
    }

    /// Takes whether telemetry shows rest.
    pub(super) fn take(&mut self, rests: bool) {
        if let DriveUnderWay::Stopping(stopping) = self {
            stopping.is_shown = rests;
        }
    }

    /// Takes note that a stop is said now.
    pub(super) fn stop_said(&mut self, now: Time) {
        if let DriveUnderWay::Stopping(stopping) = self {
            (stopping.sent_at, stopping.is_shown) = (Some(now), false);
        }
    }

    /// Returns when a stop is to be said: at once, or again as long as telemetry shows no rest.
    pub(super) fn stop_due(&self, again: Duration) -> Option<Time> {
        match self {
            DriveUnderWay::Stopping(StopUnderWay {
                sent_at: None,
                is_shown: false,
            }) => Some(Time::ZERO),
            DriveUnderWay::Stopping(StopUnderWay {
                sent_at: Some(sent_at),
                is_shown: false,
            }) => Some(*sent_at + again),
            DriveUnderWay::Idle | DriveUnderWay::Waiting { .. } | DriveUnderWay::Stopping(_) => {
                None
            }
        }
    }

    /// Returns when what waits is too old.
    pub(super) fn waits_until(&self) -> Option<Time> {
        match self {
            DriveUnderWay::Waiting { since, .. } => Some(*since + BEGINS_WITHIN),
            DriveUnderWay::Idle | DriveUnderWay::Stopping(_) => None,
        }
    }
}
