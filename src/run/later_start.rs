//! Whether others know a later start of this vehicle than this one. Then its folder is an old one: restored from a copy, or on
//! another card with a wrong clock. What this start measures would be taken for late, and its numbers may come again.
//!
//! The node begins anew above it: at its beginning at once, by ending with the reason, so that whoever supervises it starts it
//! again; later, when others come into reach, it goes on with what it is doing and says so. As long as it only asks to take
//! part nothing is decided: the later start may be another node that runs under this id, and then it is refused for that.

use std::sync::Mutex;
use std::sync::mpsc::Sender;
use std::time::Duration;

use tomoswarm_proto::{Boot, LayerId, Message, VehicleId};

use super::clock::Clock;
use super::mailbox::{Ending, RuntimeContext, Troubles, lock};
use super::state_dir::StateDir;
use crate::time::Time;

/// A node that has run for longer does not end by itself.
const BEGINS_FOR: Duration = Duration::from_secs(60);
/// A higher number is nonsense: somebody's mistake must not use up all that are left.
const HIGHEST: Boot = Boot(u32::MAX - (1 << 28));

/// Listens for later starts of a vehicle.
pub(super) struct LaterStart {
    own: LayerId,
    clock: Clock,
    endings: Mutex<Sender<Ending>>,
    troubles: Troubles,
    heard: Mutex<Heard>,
}

#[derive(Default)]
struct Heard {
    /// The latest start that was heard of.
    latest: Option<Boot>,
    /// Whether this node takes part.
    is_member: bool,
}

impl LaterStart {
    /// Listens for those of the vehicle that began this start.
    pub(super) fn of(vehicle: VehicleId, boot: Boot, context: &RuntimeContext) -> LaterStart {
        LaterStart {
            own: LayerId { vehicle, boot },
            clock: context.clock,
            endings: Mutex::new(context.endings.clone()),
            troubles: context.troubles.clone(),
            heard: Mutex::default(),
        }
    }

    /// Takes what another node says.
    pub(super) fn hear(&self, message: &Message) {
        let Some(boot) = later_start(self.own, message) else {
            return;
        };
        let mut heard = lock(&self.heard);
        if heard.latest >= Some(boot) {
            return;
        }
        let is_first = heard.latest.replace(boot).is_none();
        if heard.is_member {
            self.say(boot, is_first);
        }
    }

    /// The node takes part from now on: what was heard meanwhile counts.
    pub(super) fn join(&self) {
        let mut heard = lock(&self.heard);
        heard.is_member = true;
        if let Some(boot) = heard.latest {
            self.say(boot, true);
        }
    }

    /// Ends the node or says it, with the later start that was heard of.
    fn say(&self, later: Boot, is_first: bool) {
        let reason = format!(
            "others know start {later} of this vehicle, and this is start {}: its folder is an old one",
            self.own.boot
        );
        if self.clock.now().since(Time::ZERO) > BEGINS_FOR {
            self.troubles
                .raise("start", format!("{reason}; start it anew"));
        } else if is_first {
            let ending = Ending::Outdated(format!("{reason}; the next start counts on from there"));
            lock(&self.endings).send(ending).unwrap_or_default();
        }
    }

    /// Lets the next start in the folder come after the latest that was heard of, if the node took part.
    pub(super) fn count(&self, state_dir: &StateDir) {
        let heard = lock(&self.heard);
        if let Some(boot) = heard.latest.filter(|_| heard.is_member)
            && let Err(error) = state_dir.count_on(boot)
        {
            tracing::error!("{error}");
        }
    }
}

/// Returns the latest start of a vehicle that a message speaks of, if it comes after its own one.
fn later_start(own: LayerId, message: &Message) -> Option<Boot> {
    let later = |said: LayerId| {
        let is_later = said.vehicle == own.vehicle && said.boot > own.boot && said.boot <= HIGHEST;
        is_later.then_some(said.boot)
    };
    match message {
        Message::Digest(digest) => digest
            .layers
            .iter()
            .filter_map(|one| later(one.layer))
            .max(),
        Message::Tile(tile) => later(tile.layer),
        Message::Want(want) => later(want.layer),
        Message::Have(have) => {
            let marks = have.watermarks.iter();
            let starts = marks.map(|mark| LayerId {
                vehicle: mark.vehicle,
                boot: mark.boot,
            });
            starts.filter_map(later).max()
        }
        // These speak of their sender, or of nobody's start.
        Message::Hello(_)
        | Message::State(_)
        | Message::Plan(_)
        | Message::Mission(_)
        | Message::Order(_)
        | Message::Samples(_)
        | Message::Beacon(_)
        | Message::Health(_)
        | Message::Report(_)
        | Message::Standing(_)
        | Message::Task(_)
        | Message::Image(_)
        | Message::Fix(_)
        | Message::Mark(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, channel};

    use tomoswarm_proto::{Digest, Have, HeardFrom, LayerDigest, State, TileRequest};

    use super::*;

    const OWN: LayerId = layer(3, 7);

    const fn layer(vehicle: u8, boot: u32) -> LayerId {
        LayerId {
            vehicle: VehicleId(vehicle),
            boot: Boot(boot),
        }
    }

    fn digest(layers: &[LayerId]) -> Message {
        let layers = layers.iter().map(|layer| LayerDigest {
            layer: *layer,
            tiles: 1,
            revisions: 1,
            hash: 5,
        });
        Message::Digest(Digest {
            layers: layers.collect(),
        })
    }

    fn have(marks: &[LayerId]) -> Message {
        let watermarks = marks.iter().map(|mark| HeardFrom {
            vehicle: mark.vehicle,
            boot: mark.boot,
            run: tomoswarm_proto::RunId(1),
            below: 0,
        });
        Message::Have(Have {
            watermarks: watermarks.collect(),
            ..Have::default()
        })
    }

    #[test]
    fn only_later_starts_of_the_vehicle_itself_count_and_the_latest_of_them() {
        let many = [layer(3, 6), layer(3, 9), layer(3, 8), layer(4, 99), OWN];
        for (message, expected) in [
            (digest(&many), Some(Boot(9))),
            (have(&many), Some(Boot(9))),
            (digest(&[OWN, layer(4, 99)]), None),
            (have(&[layer(3, u32::MAX)]), None),
            (
                digest(&[layer(3, u32::MAX), layer(3, HIGHEST.0)]),
                Some(HIGHEST),
            ),
            (
                Message::Want(TileRequest {
                    layer: layer(3, 8),
                    known: Vec::new(),
                }),
                Some(Boot(8)),
            ),
            (
                Message::State(State {
                    vehicle: VehicleId(3),
                    boot: Boot(12),
                    ..State::default()
                }),
                None,
            ),
        ] {
            assert_eq!(later_start(OWN, &message), expected, "{message:?}");
        }
    }

    /// Returns one that listens, and where its endings arrive.
    fn listening(state_dir: &StateDir) -> (LaterStart, Receiver<Ending>) {
        let (endings, ended) = channel();
        let context = RuntimeContext {
            clock: Clock::start(),
            troubles: Troubles::default(),
            endings,
        };
        let later = LaterStart::of(VehicleId(3), state_dir.boot(), &context);
        (later, ended)
    }

    #[test]
    fn a_node_that_begins_ends_once_and_its_folder_counts_on() {
        let folder = tempfile::tempdir().unwrap();
        let state_dir = StateDir::open(folder.path()).unwrap();
        let Boot(own) = state_dir.boot();
        let (later, ended) = listening(&state_dir);
        later.join();
        later.hear(&digest(&[layer(3, own)]));
        assert!(ended.try_recv().is_err(), "that is this start");
        later.hear(&digest(&[layer(3, own + 5)]));
        later.hear(&have(&[layer(3, own + 9)]));
        let Ok(Ending::Outdated(reason)) = ended.try_recv() else {
            panic!("it goes on");
        };
        assert!(
            reason.contains(&format!("know start {}", own + 5)),
            "{reason}"
        );
        assert!(ended.try_recv().is_err(), "once is enough");
        later.count(&state_dir);
        drop(state_dir);
        let next = StateDir::open(folder.path()).unwrap();
        assert_eq!(next.boot(), Boot(own + 10));
    }

    #[test]
    fn a_node_that_only_asks_decides_nothing_until_it_takes_part() {
        let folder = tempfile::tempdir().unwrap();
        let state_dir = StateDir::open(folder.path()).unwrap();
        let Boot(own) = state_dir.boot();
        let (later, ended) = listening(&state_dir);
        later.hear(&digest(&[layer(3, own + 5)]));
        later.hear(&digest(&[layer(3, own + 6)]));
        assert!(ended.try_recv().is_err(), "it may be refused as a twin");
        later.count(&state_dir);
        later.join();
        let Ok(Ending::Outdated(reason)) = ended.try_recv() else {
            panic!("it goes on");
        };
        assert!(
            reason.contains(&format!("know start {}", own + 6)),
            "{reason}"
        );
        assert!(ended.try_recv().is_err(), "once is enough");
        drop(state_dir);
        let state_dir = StateDir::open(folder.path()).unwrap();
        assert_eq!(
            state_dir.boot(),
            Boot(own + 1),
            "a twin's number is its own"
        );
    }
}
