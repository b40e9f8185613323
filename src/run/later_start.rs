//! Whether others know a later start of this vehicle than this one, or more of this one than it has done. Then its folder is
//! an old one: deleted, restored from a copy, or on another card with a wrong clock. What this start measures would be taken
//! for late, or for samples that are stored already.
//!
//! ```text
//!   heard: a later start, or what this start has not done
//!     ├─ it only asks to take part ─► decided when it does: the other may be a twin, and then it is refused for that
//!     ├─ it begins                 ─► ends with the reason; whoever supervises it starts it again, above what was heard
//!     └─ later, or ended so 3 times in a row ─► goes on and shows a trouble
//! ```
//!
//! A start has begun after a minute, or once a ground station says that it has samples of this start, and not more than there
//! are: then nobody else has used its number.
//!
//! Nobody can prove such a word: where there are no certificates a stranger may say any of them, and make the vehicle begin
//! three times more, but not for ever. Requests for tiles and tiles are not listened to: both only follow a digest.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::mpsc::Sender;
use std::time::Duration;

use tomoswarm_proto::{Boot, HeardFrom, LayerId, Message, RunId, SeenState, VehicleId};

use super::mailbox::{Ending, RuntimeContext, Troubles, lock};
use super::state_dir::{StartCounts, StateDirError};
use crate::time::Time;

/// A start that has run for longer does not end by itself.
const BEGINS_FOR: Duration = Duration::from_secs(60);
/// So many starts in a row end by themselves at most.
const ENDS_IN_A_ROW: u32 = 3;
/// A higher number is nonsense: somebody's mistake must not use up all that are left.
const HIGHEST: Boot = Boot(u32::MAX - (1 << 28));

/// Listens for later starts of a vehicle.
pub(super) struct LaterStart {
    own: LayerId,
    counts: StartCounts,
    endings: Mutex<Sender<Ending>>,
    troubles: Troubles,
    heard: Mutex<Heard>,
}

#[derive(Default)]
struct Heard {
    done: Done,
    /// The latest start that was heard of; this one when others know what it has not done.
    latest: Option<Boot>,
    /// Whether this node takes part.
    is_member: bool,
    /// Whether a ground station has samples of this start and none that it has not measured.
    is_confirmed: bool,
    /// How many starts before this one ended by themselves, in a row.
    ended_before: u32,
    /// Whether this one does.
    is_ending: bool,
}

/// What a start has done under its number.
#[derive(Default)]
struct Done {
    /// How many samples it has measured in each run.
    measured: BTreeMap<RunId, u64>,
    /// The number of its newest State.
    said: u64,
}

impl Done {
    /// Returns whether a run has samples of this start that it has not measured.
    fn has_unmeasured(&self, run: RunId, below: u64) -> bool {
        below > self.measured.get(&run).copied().unwrap_or(0)
    }

    /// Returns whether a message says that samples of this start are stored, and none that it has not measured.
    fn is_confirmed(&self, own: LayerId, message: &Message) -> bool {
        let Message::Have(have) = message else {
            return false;
        };
        let of_own = |mark: &&HeardFrom| (mark.vehicle, mark.boot) == (own.vehicle, own.boot);
        let mut marks = have.watermarks.iter().filter(of_own);
        let has_some = marks.clone().any(|mark| mark.below > 0);
        has_some && marks.all(|mark| !self.has_unmeasured(mark.run, mark.below))
    }
}

impl LaterStart {
    /// Listens for those of a vehicle, whose folder counts its starts.
    pub(super) fn of(
        vehicle: VehicleId,
        counts: StartCounts,
        context: &RuntimeContext,
    ) -> LaterStart {
        let boot = counts.boot();
        let heard = Heard {
            ended_before: counts.early_ends(),
            ..Heard::default()
        };
        LaterStart {
            own: LayerId { vehicle, boot },
            counts,
            endings: Mutex::new(context.endings.clone()),
            troubles: context.troubles.clone(),
            heard: Mutex::new(heard),
        }
    }

    /// This start has measured a sample; told before anybody else can know it.
    pub(super) fn measure(&self, run: RunId, sequence: u64) {
        let mut heard = lock(&self.heard);
        let below = heard.done.measured.entry(run).or_default();
        *below = (*below).max(sequence.saturating_add(1));
    }

    /// This start says a State; told before anybody else can know it.
    pub(super) fn say(&self, sequence: u64) {
        lock(&self.heard).done.said = sequence;
    }

    /// Takes what another node says.
    pub(super) fn hear(&self, now: Time, message: &Message) {
        let mut heard = lock(&self.heard);
        let Some(boot) = later_start(self.own, &heard.done, message) else {
            heard.is_confirmed |= heard.is_member && heard.done.is_confirmed(self.own, message);
            return;
        };
        if heard.latest >= Some(boot) {
            return;
        }
        heard.latest = Some(boot);
        if heard.is_member {
            self.take_up(now, &mut heard, boot);
        }
    }

    /// The node takes part from now on: what was heard meanwhile counts.
    pub(super) fn join(&self, now: Time) {
        let mut heard = lock(&self.heard);
        heard.is_member = true;
        if let Some(boot) = heard.latest {
            self.take_up(now, &mut heard, boot);
        }
    }

    /// Ends the node or shows a trouble, with the start that was heard of.
    fn take_up(&self, now: Time, heard: &mut Heard, latest: Boot) {
        let own = self.own.boot;
        let known = match latest > own {
            true => {
                format!("others know start {latest} of this vehicle, and this is start {own}")
            }
            false => {
                format!("others know of start {own} of this vehicle what this one has not done")
            }
        };
        let reason = format!("{known}: its folder is an old one");
        if heard.ended_before >= ENDS_IN_A_ROW {
            let forged = format!("or somebody forges it: it began anew {ENDS_IN_A_ROW} times");
            self.troubles.raise("start", format!("{reason}, {forged}"));
        } else if is_under_way(now) || heard.is_confirmed || heard.is_ending {
            self.troubles
                .raise("start", format!("{reason}; start it anew"));
        } else if note(self.counts.keep_early_ends(heard.ended_before + 1)) {
            heard.is_ending = true;
            let ending = Ending::Outdated(format!("{reason}; the next start counts on from there"));
            lock(&self.endings).send(ending).unwrap_or_default();
        }
    }

    /// Ends the row of starts that ended by themselves, once this one has begun without doing so.
    pub(super) fn settle(&self, now: Time) {
        let mut heard = lock(&self.heard);
        if heard.ended_before > 0 && !heard.is_ending && is_under_way(now) {
            heard.ended_before = 0;
            note(self.counts.keep_early_ends(0));
        }
    }

    /// Lets the next start in the folder come after the latest that was heard of, if the node took part.
    pub(super) fn count(&self) {
        let heard = lock(&self.heard);
        if let Some(boot) = heard.latest.filter(|_| heard.is_member) {
            note(self.counts.count_on(boot));
        }
    }
}

/// Returns whether a node that began at the zero of its clock does not begin any more.
fn is_under_way(now: Time) -> bool {
    now.since(Time::ZERO) > BEGINS_FOR
}

/// Returns whether a number was kept, and says why not. A start whose end cannot be counted does not end by itself.
fn note(kept: Result<(), StateDirError>) -> bool {
    if let Err(error) = &kept {
        tracing::error!("{error}");
    }
    kept.is_ok()
}

/// Returns the latest start of a vehicle that a message speaks of, if it comes after its own one; its own one if the message
/// speaks of what that has not done.
fn later_start(own: LayerId, done: &Done, message: &Message) -> Option<Boot> {
    let is_own = |vehicle, boot| vehicle == own.vehicle && boot <= HIGHEST;
    match message {
        Message::Digest(digest) => {
            let layers = digest.layers.iter().map(|one| one.layer);
            let later = layers.filter(|one| is_own(one.vehicle, one.boot) && one.boot > own.boot);
            later.map(|one| one.boot).max()
        }
        Message::Have(have) => {
            let marks = have.watermarks.iter();
            let later = marks.filter(|mark| {
                let is_used = mark.boot == own.boot && done.has_unmeasured(mark.run, mark.below);
                is_own(mark.vehicle, mark.boot) && (mark.boot > own.boot || is_used)
            });
            later.map(|mark| mark.boot).max()
        }
        Message::Order(order) => seen_start(own, done, order.vehicle, order.seen),
        Message::Plan(plan) => seen_start(own, done, plan.vehicle, plan.seen),
        // These speak of their sender, of nobody's start, or follow from a digest.
        Message::Hello(_)
        | Message::State(_)
        | Message::Tile(_)
        | Message::Want(_)
        | Message::Mission(_)
        | Message::Samples(_)
        | Message::Beacon(_)
        | Message::Health(_)
        | Message::Report(_)
        | Message::Standing(_)
        | Message::Task(_)
        | Message::Image(_)
        | Message::Fix(_)
        | Message::Mark(_)
        | Message::Look(_)
        | Message::Log(_)
        | Message::Settings(_) => None,
    }
}

/// Returns the same for the newest State that somebody heard of a vehicle.
fn seen_start(
    own: LayerId,
    done: &Done,
    vehicle: VehicleId,
    seen: Option<SeenState>,
) -> Option<Boot> {
    let seen = seen.filter(|seen| vehicle == own.vehicle && seen.boot <= HIGHEST)?;
    let is_later = (seen.boot, seen.sequence) > (own.boot, done.said);
    is_later.then_some(seen.boot)
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::mpsc::{Receiver, channel};

    use tomoswarm_proto::{
        Digest, Have, LayerDigest, Lease, Order, OrderKind, Plan, Revision, State, TileRequest,
    };

    use super::*;
    use crate::run::clock::Clock;
    use crate::run::state_dir::StateDir;

    const OWN: LayerId = layer(3, 7);
    const BEGINNING: Time = Time::ZERO;
    const UNDER_WAY: Time = Time::from_nanos(61_000_000_000);

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

    /// Returns that the ground has samples of starts below a number, of run 1.
    fn have(marks: &[(LayerId, u64)]) -> Message {
        let watermarks = marks.iter().map(|(mark, below)| HeardFrom {
            vehicle: mark.vehicle,
            boot: mark.boot,
            run: RunId(1),
            below: *below,
        });
        Message::Have(Have {
            watermarks: watermarks.collect(),
            ..Have::default()
        })
    }

    fn seen(start: LayerId, sequence: u64) -> Option<SeenState> {
        Some(SeenState {
            boot: start.boot,
            sequence,
        })
    }

    fn order(vehicle: u8, seen: Option<SeenState>) -> Message {
        Message::Order(Order {
            vehicle: VehicleId(vehicle),
            lease: Lease::lowest(1),
            run: RunId(1),
            revision: Revision(1),
            seen,
            kind: OrderKind::Hold,
            ends: Vec::new(),
        })
    }

    fn plan(vehicle: u8, seen: Option<SeenState>) -> Message {
        Message::Plan(Plan {
            vehicle: VehicleId(vehicle),
            seen,
            ..Plan::default()
        })
    }

    #[test]
    fn only_later_starts_of_the_vehicle_itself_count_and_the_latest_of_them() {
        let many = [layer(3, 6), layer(3, 9), layer(3, 8), layer(4, 99), OWN];
        let stored = many.map(|layer| (layer, 0));
        let too_high = layer(3, u32::MAX);
        for (message, expected) in [
            (digest(&many), Some(9)),
            (have(&stored), Some(9)),
            (digest(&[OWN, layer(4, 99)]), None),
            (have(&[(too_high, 0)]), None),
            (digest(&[too_high, layer(3, HIGHEST.0)]), Some(HIGHEST.0)),
            (order(3, seen(layer(3, 8), 0)), Some(8)),
            (plan(3, seen(layer(3, 8), 0)), Some(8)),
            (order(4, seen(layer(4, 8), 0)), None),
            (plan(4, seen(layer(4, 8), 0)), None),
            (order(3, seen(layer(3, 6), 99)), None),
            (order(3, seen(too_high, 0)), None),
            (order(3, None), None),
            // Said by whoever believed a digest that this vehicle hears as well.
            (
                Message::Want(TileRequest {
                    layer: layer(3, 8),
                    known: Vec::new(),
                }),
                None,
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
            let said = later_start(OWN, &Done::default(), &message);
            assert_eq!(said, expected.map(Boot), "{message:?}");
        }
    }

    #[test]
    fn what_this_start_has_not_done_was_done_by_an_earlier_one_of_its_number() {
        let done = Done {
            measured: BTreeMap::from([(RunId(1), 20)]),
            said: 50,
        };
        for (message, is_used) in [
            (have(&[(OWN, 20)]), false),
            (have(&[(OWN, 21)]), true),
            (have(&[(layer(3, 6), 99), (layer(4, 7), 99)]), false),
            (order(3, seen(OWN, 50)), false),
            (order(3, seen(OWN, 51)), true),
            (plan(3, seen(OWN, 50)), false),
            (plan(3, seen(OWN, 51)), true),
        ] {
            let expected = is_used.then_some(OWN.boot);
            assert_eq!(later_start(OWN, &done, &message), expected, "{message:?}");
        }
        let nothing = Done::default();
        assert_eq!(later_start(OWN, &nothing, &have(&[(OWN, 0)])), None);
        assert_eq!(
            later_start(OWN, &nothing, &have(&[(OWN, 1)])),
            Some(OWN.boot)
        );
    }

    /// A start of vehicle 3 in a folder.
    struct Start {
        state_dir: StateDir,
        later: LaterStart,
        ended: Receiver<Ending>,
        troubles: Troubles,
    }

    impl Start {
        fn of(folder: &Path) -> Start {
            let state_dir = StateDir::open(folder).unwrap();
            let (endings, ended) = channel();
            let context = RuntimeContext {
                clock: Clock::start(),
                troubles: Troubles::default(),
                endings,
            };
            Start {
                later: LaterStart::of(VehicleId(3), state_dir.counts(), &context),
                state_dir,
                ended,
                troubles: context.troubles,
            }
        }

        /// Returns a start that is so much later.
        fn after(&self, starts: u32) -> LayerId {
            layer(3, self.state_dir.boot().0 + starts)
        }

        fn end(&self) -> Option<String> {
            match self.ended.try_recv() {
                Ok(Ending::Outdated(reason)) => Some(reason),
                Ok(other) => panic!("{other:?}"),
                Err(_) => None,
            }
        }
    }

    #[test]
    fn a_node_that_begins_ends_once_and_its_folder_counts_on() {
        let folder = tempfile::tempdir().unwrap();
        let start = Start::of(folder.path());
        let Boot(own) = start.state_dir.boot();
        start.later.join(BEGINNING);
        start.later.hear(BEGINNING, &digest(&[start.after(0)]));
        assert_eq!(start.end(), None, "that is this start");
        start.later.hear(BEGINNING, &digest(&[start.after(5)]));
        start.later.hear(BEGINNING, &have(&[(start.after(9), 0)]));
        let reason = start.end().unwrap();
        let said = format!("know start {} of", own + 5);
        assert!(reason.contains(&said), "{reason}");
        assert_eq!(start.end(), None, "once is enough");
        start.later.count();
        drop(start);
        let next = Start::of(folder.path());
        assert_eq!(next.state_dir.boot(), Boot(own + 10));
    }

    #[test]
    fn a_number_that_was_used_before_is_given_up_and_one_that_goes_on_with_its_own_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let start = Start::of(folder.path());
        let Boot(own) = start.state_dir.boot();
        start.later.join(BEGINNING);
        for sequence in 0..7 {
            start.later.measure(RunId(1), sequence);
        }
        start.later.say(40);
        let newest = seen(start.after(0), 40);
        start.later.hear(BEGINNING, &order(3, newest));
        assert_eq!(start.end(), None, "others know what it has done");
        start.later.hear(BEGINNING, &have(&[(start.after(0), 300)]));
        let reason = start.end().unwrap();
        let said = format!("of start {own} of this vehicle what this one has not done");
        assert!(reason.contains(&said), "{reason}");
        start.later.count();
        drop(start);
        assert!(Start::of(folder.path()).state_dir.boot() > Boot(own));
    }

    #[test]
    fn a_node_that_only_asks_decides_nothing_until_it_takes_part() {
        let folder = tempfile::tempdir().unwrap();
        let start = Start::of(folder.path());
        let Boot(own) = start.state_dir.boot();
        start.later.hear(BEGINNING, &digest(&[start.after(5)]));
        start.later.hear(BEGINNING, &digest(&[start.after(6)]));
        assert_eq!(start.end(), None, "it may be refused as a twin");
        start.later.count();
        start.later.join(BEGINNING);
        let reason = start.end().unwrap();
        let said = format!("know start {} of", own + 6);
        assert!(reason.contains(&said), "{reason}");
        assert_eq!(start.end(), None, "once is enough");
        drop(start);
        let next = Start::of(folder.path());
        let by_itself = next.state_dir.boot().0 - own;
        assert!(by_itself < 6, "a twin's number is its own");
    }

    #[test]
    fn a_forger_that_always_knows_a_later_start_ends_three_in_a_row_and_no_more() {
        let folder = tempfile::tempdir().unwrap();
        let begin = || {
            let start = Start::of(folder.path());
            start.later.join(BEGINNING);
            start.later.hear(BEGINNING, &digest(&[start.after(1)]));
            start
        };
        for _ in 0..3 {
            let start = begin();
            assert!(start.end().is_some());
            start.later.count();
        }
        for _ in 0..2 {
            let start = begin();
            assert_eq!(start.end(), None);
            let trouble = start.troubles.list().concat();
            assert!(trouble.contains("it began anew 3 times"), "{trouble}");
            start.later.settle(Time::from_nanos(59_000_000_000));
            start.later.count();
        }
        // One that has begun is not like those before: the next one may end by itself again.
        let start = begin();
        start.later.settle(UNDER_WAY);
        drop(start);
        assert!(begin().end().is_some());
    }

    #[test]
    fn a_start_whose_samples_are_stored_is_not_ended_by_what_is_forged_afterwards() {
        let folder = tempfile::tempdir().unwrap();
        let start = Start::of(folder.path());
        start.later.join(BEGINNING);
        start.later.measure(RunId(1), 0);
        start.later.hear(BEGINNING, &have(&[(start.after(0), 1)]));
        start.later.hear(BEGINNING, &have(&[(start.after(0), 9)]));
        assert_eq!(start.end(), None);
        assert!(!start.troubles.list().is_empty(), "it is shown");
    }

    #[test]
    fn that_a_ground_station_has_no_samples_of_a_start_says_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let start = Start::of(folder.path());
        start.later.join(BEGINNING);
        start.later.hear(BEGINNING, &have(&[(start.after(0), 0)]));
        start.later.hear(BEGINNING, &have(&[(start.after(0), 9)]));
        assert!(start.end().is_some());
    }

    #[test]
    fn a_node_under_way_goes_on_and_shows_the_trouble() {
        let folder = tempfile::tempdir().unwrap();
        let start = Start::of(folder.path());
        start.later.join(BEGINNING);
        start.later.hear(UNDER_WAY, &have(&[(start.after(0), 1)]));
        assert_eq!(start.end(), None);
        let trouble = start.troubles.list().concat();
        assert!(trouble.contains("start it anew"), "{trouble}");
        start.later.count();
        let after = start.after(1);
        drop(start);
        assert!(Start::of(folder.path()).state_dir.boot() >= after.boot);
    }
}
