//! What the autopilot told last, and whether it still tells. It judges no pose.
//!
//! ```text
//!   [NeverHeard] ──telemetry──► [Heard] ──2 s without──► [Silent] ──telemetry──► [Heard]
//! ```

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::messages::Telemetry;
use crate::time::{Deadline, Time};

/// Telemetry older than this makes the autopilot silent.
const SILENT_AFTER: Duration = Duration::from_secs(2);

/// The last telemetry.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum LastTelemetry {
    /// There was none yet.
    #[default]
    NeverHeard,
    /// It is told often enough.
    Heard {
        /// When it came.
        at: Time,
        /// What it said.
        telemetry: Telemetry,
    },
    /// It was the last for too long, which has been reported.
    Silent {
        /// When it came.
        at: Time,
        /// What it said.
        telemetry: Telemetry,
    },
}

impl LastTelemetry {
    /// Records new telemetry.
    pub(super) fn take(&mut self, now: Time, telemetry: Telemetry) {
        *self = LastTelemetry::Heard { at: now, telemetry };
    }

    /// Takes note that the autopilot has fallen silent, so that it is reported once.
    pub(super) fn fall_silent(&mut self) {
        match *self {
            LastTelemetry::NeverHeard | LastTelemetry::Silent { .. } => {}
            LastTelemetry::Heard { at, telemetry } => {
                *self = LastTelemetry::Silent { at, telemetry }
            }
        }
    }

    /// Returns the last telemetry, however old it is.
    pub(super) fn of_any_age(&self) -> Option<&Telemetry> {
        match self {
            LastTelemetry::NeverHeard => None,
            LastTelemetry::Heard { at: _, telemetry }
            | LastTelemetry::Silent { at: _, telemetry } => Some(telemetry),
        }
    }

    /// Returns the last telemetry if it is young enough to act on.
    pub(super) fn fresh(&self, now: Time) -> Option<&Telemetry> {
        match self {
            LastTelemetry::NeverHeard => None,
            LastTelemetry::Heard { at, telemetry } | LastTelemetry::Silent { at, telemetry } => {
                (now.since(*at) <= SILENT_AFTER).then_some(telemetry)
            }
        }
    }

    /// Returns when silence is to be reported; `None` while there is nothing new to report.
    pub(super) fn deadline(&self) -> Option<Deadline> {
        match self {
            LastTelemetry::NeverHeard | LastTelemetry::Silent { .. } => None,
            LastTelemetry::Heard { at, telemetry: _ } => Some(Deadline {
                at: *at + SILENT_AFTER,
                why: "telemetry silent",
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Angle, Point, Pose};
    use crate::node::vehicle::Motion;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    #[test]
    fn silence_is_due_once_after_each_telemetry() {
        let pose = Pose {
            at: Point::new(0.0, 0.0),
            heading: Angle::default(),
            sd_m: 0.05,
        };
        let telemetry = Telemetry {
            pose,
            flight_state: Default::default(),
            speed_mps: 0.0,
            battery: Some(1.0),
            motion: Motion::Resting,
            is_armed: true,
            stored: None,
        };
        let mut last = LastTelemetry::default();
        assert_eq!(
            (last.deadline(), last.of_any_age(), last.fresh(at(0.0))),
            (None, None, None)
        );
        for told_s in [1.0, 10.0] {
            last.take(at(told_s), telemetry);
            assert_eq!(last.deadline().map(|due| due.at), Some(at(told_s + 2.0)));
            last.fall_silent();
            assert_eq!(last.deadline(), None);
            assert_eq!(last.of_any_age(), Some(&telemetry));
        }
        assert_eq!(last.fresh(at(12.0)), Some(&telemetry));
        assert_eq!(last.fresh(at(12.1)), None);
    }
}
