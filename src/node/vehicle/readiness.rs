//! Whether a vehicle that was started has heard enough to be started out: for some seconds it listens, and from every
//! vehicle that it hears it must have learned which emergency stops are open, unless that one never tells. Hearing nobody it
//! stays.
//!
//! ```text
//!   [Alone] ──somebody is heard──► [Listening] ──time is up, and everyone heard has told──► [Ready]
//! ```

use std::collections::BTreeSet;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Sender, VehicleId};

use crate::node::peers::Peers;
use crate::time::Time;

/// A vehicle that has not told after this many listening times is not waited for: all tell within a second and a half.
/// The whole is less than an operator's order waits for.
const GIVES_UP_AFTER: u32 = 2;

/// Whether enough has been heard.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum Readiness {
    /// Nobody has been heard yet.
    #[default]
    Alone,
    /// Others are heard.
    Listening {
        /// Since when.
        since: Time,
        /// Who has told which stops are open.
        informed: BTreeSet<VehicleId>,
    },
    /// It may be started.
    Ready,
}

impl Readiness {
    /// Notes that somebody is heard.
    pub(super) fn hear(&mut self, now: Time) {
        if *self == Readiness::Alone {
            *self = Readiness::Listening {
                since: now,
                informed: BTreeSet::new(),
            };
        }
    }

    /// Notes that a node has told which stops are open.
    pub(super) fn take_stops_reported(&mut self, now: Time, by: Sender) {
        self.hear(now);
        if let (Readiness::Listening { informed: told, .. }, Sender::Vehicle(vehicle)) = (self, by)
        {
            told.insert(vehicle);
        }
    }

    /// Looks whether it may be started, after it has listened long enough. Peers that have fallen silent are not waited for.
    pub(super) fn look(&mut self, now: Time, listens_for: Duration, peers: &Peers) -> bool {
        if let Readiness::Listening {
            since,
            informed: told,
        } = self
        {
            let heard = peers.iter().filter(|(_, peer)| !peer.is_silent(now));
            let have_told = heard
                .into_iter()
                .all(|(vehicle, _)| told.contains(&vehicle));
            // Whoever is heard and never tells must not keep everyone from ever being started.
            let listened = now.since(*since);
            if have_told && listened >= listens_for || listened >= listens_for * GIVES_UP_AFTER {
                *self = Readiness::Ready;
            }
        }
        *self == Readiness::Ready
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::tests_support::{drawn, state, variants};
    use tomoswarm_proto::State;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    #[test]
    fn it_waits_two_seconds_and_for_everyone_whom_it_hears() {
        let mut peers = Peers::new(VehicleId(1));
        let mut readiness = Readiness::default();
        assert!(
            !readiness.look(at(9.0), Duration::from_secs(2), &peers),
            "it hears nobody"
        );
        peers.take(at(10.0), &state(2, 3.0, 3.0));
        readiness.take_stops_reported(at(10.0), Sender::Ground);
        peers.take(
            at(12.0),
            &State {
                sequence: 2,
                ..state(2, 3.0, 3.0)
            },
        );
        assert!(
            !readiness.look(at(12.1), Duration::from_secs(2), &peers),
            "vehicle 2 has not told"
        );
        readiness.take_stops_reported(at(12.1), Sender::Vehicle(VehicleId(2)));
        assert!(readiness.look(at(12.1), Duration::from_secs(2), &peers));
        let mut waits = Readiness::default();
        waits.hear(at(10.0));
        assert!(
            !waits.look(at(13.9), Duration::from_secs(2), &peers),
            "vehicle 2 has not told this one"
        );
        assert!(
            waits.look(at(14.0), Duration::from_secs(2), &peers),
            "it never tells"
        );
        assert_eq!(drawn(include_str!("readiness.rs")), variants::<Readiness>());
    }

    #[test]
    fn who_has_fallen_silent_is_not_waited_for() {
        let mut peers = Peers::new(VehicleId(1));
        let mut readiness = Readiness::default();
        peers.take(at(10.0), &state(2, 3.0, 3.0));
        readiness.hear(at(10.0));
        peers.take(
            at(11.0),
            &State {
                sequence: 2,
                ..state(2, 3.0, 3.0)
            },
        );
        assert!(
            !readiness.look(at(11.9), Duration::from_secs(2), &peers)
                && !readiness.look(at(12.9), Duration::from_secs(2), &peers)
        );
        assert!(readiness.look(at(13.1), Duration::from_secs(2), &peers));
    }
}
