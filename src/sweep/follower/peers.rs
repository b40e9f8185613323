//! What is known of the other vehicles, whatever they follow: which revision each follows by its latest start, and whether it
//! rests. Plans are not known here.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, Revision, RunId, VehicleId};

use crate::sweep::{LOWER_BOOT_AFTER, VOID_AFTER, VehicleProgress};
use crate::time::Time;

/// A revision of a run; a higher run is newer than any revision of a lower one.
pub(super) type Edition = (RunId, Revision);

/// All peers that were heard.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct PeerFacts {
    heard: BTreeMap<VehicleId, Peer>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Peer {
    boot: Boot,
    newest: Edition,
    at_rest: bool,
    /// When this start of it was heard last.
    heard_at: Time,
    /// When it was heard to be there, at this revision, last.
    newest_at: Time,
}

impl PeerFacts {
    /// Takes a peer's progress; returns whether it is of its latest start, as far as known.
    pub(super) fn hear(&mut self, now: Time, progress: &VehicleProgress) -> bool {
        let newest = (progress.run, progress.revision);
        let (boot, at_rest) = (progress.boot, progress.leg.is_none());
        let heard = Peer {
            boot,
            newest,
            at_rest,
            heard_at: now,
            newest_at: now,
        };
        let peer = self.heard.entry(progress.vehicle).or_insert(heard);
        let begins_anew = heard.boot != peer.boot && now.since(peer.heard_at) > LOWER_BOOT_AFTER;
        // A revision that it never says again is none that it follows.
        let is_void = heard.boot == peer.boot && now.since(peer.newest_at) > VOID_AFTER;
        if begins_anew || is_void || (heard.boot, heard.newest) >= (peer.boot, peer.newest) {
            *peer = heard;
        } else if heard.boot == peer.boot {
            peer.heard_at = now;
        }
        peer.boot <= boot
    }

    /// Returns whether a peer was heard to follow an edition, and nothing newer since.
    pub(super) fn follows(&self, vehicle: VehicleId, edition: Edition) -> bool {
        let peer = self.heard.get(&vehicle);
        peer.is_some_and(|peer| peer.newest == edition)
    }

    /// Returns whether a peer was heard to rest under an edition, and nothing newer since.
    pub(super) fn rests_under(&self, vehicle: VehicleId, edition: Edition) -> bool {
        let peer = self.heard.get(&vehicle);
        peer.is_some_and(|peer| peer.at_rest && peer.newest == edition)
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{Revision, RunId, StopId};

    use super::*;

    const PEER: VehicleId = VehicleId(2);

    fn edition(revision: u32) -> Edition {
        (RunId(1), Revision(revision))
    }

    fn heard(boot: u32, revision: u32, leg: Option<u32>) -> VehicleProgress {
        VehicleProgress {
            vehicle: PEER,
            boot: Boot(boot),
            run: RunId(1),
            revision: Revision(revision),
            leg: leg.map(StopId),
            ..VehicleProgress::default()
        }
    }

    fn second(seconds: f64) -> Time {
        Time::from_secs_f64(seconds)
    }

    #[test]
    fn what_was_said_before_does_no_harm_when_it_comes_late() {
        let mut peers = PeerFacts::default();
        assert!(peers.hear(second(1.0), &heard(2, 5, None)));
        assert!(peers.hear(second(1.1), &heard(2, 4, Some(1))));
        assert!(peers.follows(PEER, edition(5)) && !peers.follows(PEER, edition(4)));
        assert!(peers.rests_under(PEER, edition(5)));
        assert!(
            !peers.hear(second(1.2), &heard(1, 9, None)),
            "an earlier start"
        );
        assert!(!peers.follows(PEER, edition(9)));
        assert!(!peers.follows(VehicleId(3), edition(5)));
    }

    #[test]
    fn who_drives_follows_and_does_not_rest() {
        let mut peers = PeerFacts::default();
        peers.hear(second(1.0), &heard(1, 5, Some(2)));
        assert!(peers.follows(PEER, edition(5)) && !peers.rests_under(PEER, edition(5)));
    }

    #[test]
    fn a_revision_that_is_not_said_again_is_void_and_so_is_a_start() {
        for (after_s, is_believed) in [(10.0, false), (10.1, true)] {
            let mut peers = PeerFacts::default();
            peers.hear(second(0.0), &heard(1, 900, None));
            peers.hear(second(after_s), &heard(1, 5, None));
            assert_eq!(peers.follows(PEER, edition(5)), is_believed, "{after_s}");
        }
        for (after_s, is_believed) in [(30.0, false), (30.1, true)] {
            let mut peers = PeerFacts::default();
            peers.hear(second(0.0), &heard(40, 5, None));
            assert_eq!(peers.hear(second(after_s), &heard(3, 5, None)), is_believed);
        }
    }
}
