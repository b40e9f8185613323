//! Where the other vehicles are and what way they claim, as each of the actors needs it: the newest of what their
//! states and beacons say, however the network has shuffled it. What is done about them is decided elsewhere.
//!
//! A state tells the way that a vehicle is committed to. A beacon tells its place alone: it counts when no state has
//! come for a while, and then a vehicle that moves claims some way ahead. Who is heard neither way is *silent*: what was
//! last known of it stays, an obstacle on its last leg; unless no ground station expects it. Where it is going is what it
//! said of its mission last: its goal may lie far beyond the way that it is committed to.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Boot, Control, MissionKind, MissionPhase, MissionProgress, StandReason, State, VehicleId,
};

use super::radio::BeaconReport;
use crate::geom::{Angle, Point, Pose, Track, Vector};
use crate::sweep::{LOWER_BOOT_AFTER, LowerNumbers};
use crate::time::Time;

/// A vehicle that no ground station expects is forgotten when it was not heard for this long.
const STRANGER_FOR: Duration = Duration::from_secs(60);
/// A vehicle of which neither state nor beacon was heard for this long is silent.
pub(super) const SILENT_AFTER: Duration = Duration::from_secs(2);
/// A vehicle of which nothing was heard for this long is not waited for.
const GONE_AFTER: Duration = Duration::from_secs(20);
/// A beacon tells a vehicle's place when no state has for this long; of one that rests, which says its state less often.
const STATE_COUNTS: Duration = Duration::from_secs(1);
const STATE_AT_REST_COUNTS: Duration = Duration::from_millis(1700);
/// A way that comes nearer to a peer by less than this comes no nearer, metres: rounding.
const NEARER_M: f64 = 1e-3;
/// A vehicle that moves and does not say whereto, since it is heard by radio alone or somebody else steers it, claims this much
/// ahead, metres: what it drives between two beacons and in braking, and more if it falls silent.
const AHEAD_M: f64 = 1.5;
/// Beacons that are further apart than this tell of a motion, metres: the place believed drifts by less in a while.
const MOVED_M: f64 = 0.25;
/// Beacons whose headings are further apart than this tell of a motion, radians.
const TURNED_RAD: f64 = 0.15;
/// By radio a vehicle rests when it has not moved for this long.
const RESTS_AFTER: Duration = Duration::from_millis(1500);
/// Where a vehicle is going is told every second; what was told longer ago than this counts no more.
const GOAL_FOR: Duration = Duration::from_secs(5);

/// One other vehicle, by what was heard of it last.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Peer {
    /// Start of its software, and which of its states this is.
    edition: (Boot, u64),
    /// Its states that came behind that one since.
    lower: LowerNumbers,
    /// When a state of it came last.
    state_at: Option<Time>,
    /// Whether that said that it is at rest.
    said_to_rest: bool,
    /// From where a motion is told by beacons.
    anchor: Pose,
    /// When its state or beacon was heard last.
    pub heard_at: Time,
    /// Where it is.
    pub at: Point,
    /// Where it faces.
    pub heading: Angle,
    /// Standard deviation of each coordinate, metres.
    pub sd_m: f64,
    /// Where it is, then the corners of the way that it is committed to.
    pub claim: Vec<Point>,
    /// Whether it neither moves nor is about to.
    pub resting: bool,
    /// Whether it moves while somebody else steers it: a person by remote control, or its autopilot by itself.
    pub is_steered: bool,
    /// Whether it said that it does not know its place: it stands, somewhere near to where it was when it knew.
    pub is_lost: bool,
    /// When it was last heard to move, or first heard.
    pub moved_at: Time,
    /// When a ground station said last that it expects it.
    expected_at: Option<Time>,
    /// Where it said last that it is going, and when.
    told: Option<(Time, PeerGoal)>,
}

/// What a peer goes somewhere for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) enum GoalPurpose {
    /// Its mission leads it to the place itself.
    Visit,
    /// Its mission is to see what is there.
    See,
    /// It goes home.
    Home,
}

/// Where a peer is going.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct PeerGoal {
    /// The place.
    pub at: Point,
    /// What it goes there for.
    pub purpose: GoalPurpose,
    /// It stands, or is aside, until others make room for it.
    pub waits: bool,
}

impl Peer {
    /// Returns whether it has been heard neither by bus nor by radio lately.
    pub(super) fn is_silent(&self, now: Time) -> bool {
        now.since(self.heard_at) > SILENT_AFTER
    }

    /// Returns whether nothing was heard of it for so long that nobody waits for it: its software has ended, or it has gone away.
    pub(super) fn is_gone(&self, now: Time) -> bool {
        now.since(self.heard_at) > GONE_AFTER
    }

    /// Returns where it is going, as it said lately. One that has fallen silent, does not know its place or is steered by somebody
    /// else goes nowhere that anybody knows of.
    pub(super) fn goal(&self, now: Time) -> Option<PeerGoal> {
        let goes = !self.is_silent(now) && !self.is_lost && !self.is_steered;
        let (told_at, goal) = self.told.filter(|_| goes)?;
        (now.since(told_at) <= GOAL_FOR).then_some(goal)
    }

    /// Returns whether it is on its way home.
    pub(super) fn goes_home(&self, now: Time) -> bool {
        self.goal(now)
            .is_some_and(|goal| goal.purpose == GoalPurpose::Home)
    }

    /// Returns whether it is an obstacle that does not move: it rests, or nothing is heard of it.
    pub(super) fn stands(&self, now: Time) -> bool {
        self.resting || self.is_silent(now)
    }

    /// Returns how far from where it was said to be a body of some radius may be met by a vehicle that knows its own place to a
    /// deviation, metres; `None`: it has lost its place, what is met there may be anything.
    pub(super) fn met_within_m(&self, body_m: f64, own_sd_m: f64) -> Option<f64> {
        (!self.is_lost).then_some(body_m + 2.0 * (own_sd_m + self.sd_m))
    }

    /// Returns whether something of a start comes too late: a later one was heard, not long ago.
    fn has_outlived(&self, now: Time, boot: Boot) -> bool {
        boot < self.edition.0 && now.since(self.heard_at) <= LOWER_BOOT_AFTER
    }

    /// Returns whether it has rested for a while, since a moment at least. One that drove when it fell silent is waited
    /// for longer: it hears nobody either, and stands by itself, or it is gone.
    pub(super) fn is_quiet(&self, now: Time, since: Time, quiet: Duration) -> bool {
        let rests = self.resting && now.since(self.moved_at.max(since)) >= quiet;
        rests || (!self.resting && now.since(self.heard_at.max(since)) >= quiet.max(GONE_AFTER))
    }
}

/// All other vehicles heard so far; as many as there are ids at most.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Peers {
    own: VehicleId,
    newest: BTreeMap<VehicleId, Peer>,
}

impl Peers {
    /// Makes the table of a vehicle that has heard no other yet.
    pub(super) fn new(own: VehicleId) -> Peers {
        Peers {
            own,
            newest: BTreeMap::new(),
        }
    }

    /// Takes a state; that of itself changes nothing, nor does one older than the newest known, unless such go on and nothing
    /// newer comes.
    pub(super) fn take(&mut self, now: Time, state: &State) {
        let is_late = |known: &mut Peer| match state.boot == known.edition.0 {
            true if state.sequence < known.edition.1 => !known.lower.go_on(now, state.sequence),
            true => known.edition.1 == state.sequence,
            false => known.has_outlived(now, state.boot),
        };
        if state.vehicle == self.own || self.newest.get_mut(&state.vehicle).is_some_and(is_late) {
            return;
        }
        let known = self.newest.get(&state.vehicle);
        let is_steered = is_steered(state);
        let resting = is_resting(state);
        let moved_at = known
            .filter(|_| resting)
            .map_or(now, |known| known.moved_at);
        // One that does not know its place stands where it was when it knew.
        let is_lost = has_lost_its_place(state);
        let knows = !is_lost || known.is_none();
        let Some(pose) = state.pose.filter(|_| knows).map(Pose::from) else {
            return self.take_without_place(now, state);
        };
        let leg = state
            .leg
            .iter()
            .flat_map(|leg| leg.route.iter().map(|corner| Point::from(*corner)));
        // Who steers it does not say whereto.
        let ahead = is_steered.then(|| way_ahead(pose));
        let peer = Peer {
            edition: edition(state),
            lower: LowerNumbers::default(),
            state_at: Some(now),
            said_to_rest: state.is_at_rest,
            anchor: pose,
            heard_at: now,
            at: pose.at,
            heading: pose.heading,
            sd_m: pose.sd_m,
            claim: std::iter::once(pose.at).chain(leg).chain(ahead).collect(),
            resting,
            is_steered,
            is_lost,
            moved_at,
            expected_at: known.and_then(|known| known.expected_at),
            told: known
                .filter(|known| known.edition.0 == state.boot)
                .and_then(|known| known.told),
        };
        self.newest.insert(state.vehicle, peer);
    }

    /// Takes a state that tells no place: a known place stays, and a vehicle never placed stays unknown.
    fn take_without_place(&mut self, now: Time, state: &State) {
        let Some(peer) = self.newest.get_mut(&state.vehicle) else {
            return;
        };
        (peer.edition, peer.state_at, peer.heard_at) = (edition(state), Some(now), now);
        peer.said_to_rest = state.is_at_rest;
        peer.lower = LowerNumbers::default();
        (peer.resting, peer.is_steered) = (is_resting(state), is_steered(state));
        peer.is_lost = has_lost_its_place(state);
        if peer.is_lost && peer.resting {
            peer.claim = ground_around(peer.at, peer.sd_m);
        }
        if !peer.resting {
            peer.moved_at = now;
        }
    }

    /// Takes where a vehicle says that it is going; of one that was never placed, and of another start of it than is known,
    /// nothing is taken.
    pub(super) fn note_goal(&mut self, now: Time, said: &MissionProgress) {
        let known = self
            .newest
            .get_mut(&said.vehicle)
            .filter(|peer| peer.edition.0 == said.boot);
        if let Some(peer) = known {
            // One that is held goes nowhere until somebody lets it.
            let goal = said.goal.filter(|_| said.phase != MissionPhase::Held);
            let goal = goal.map(|at| PeerGoal {
                at: at.into(),
                purpose: purpose(said),
                waits: said.phase == MissionPhase::Yielding,
            });
            peer.told = goal.map(|goal| (now, goal));
        }
    }

    /// Takes what a beacon tells; that of itself, and one of an earlier start of its sender, changes nothing.
    pub(super) fn sight(&mut self, now: Time, sighting: &BeaconReport) {
        let (vehicle, boot) = (sighting.progress.vehicle, sighting.progress.boot);
        if vehicle == self.own {
            return;
        }
        let Some(pose) = sighting.pose.map(Pose::from) else {
            return self.sight_without_place(now, vehicle, boot);
        };
        let unknown = Peer {
            edition: (boot, 0),
            lower: LowerNumbers::default(),
            state_at: None,
            said_to_rest: false,
            anchor: pose,
            heard_at: now,
            at: pose.at,
            heading: pose.heading,
            sd_m: pose.sd_m,
            claim: vec![pose.at],
            resting: false,
            is_steered: false,
            is_lost: false,
            moved_at: now,
            expected_at: self
                .newest
                .get(&vehicle)
                .and_then(|known| known.expected_at),
            told: None,
        };
        let peer = self
            .newest
            .entry(vehicle)
            .or_insert_with(|| unknown.clone());
        if peer.has_outlived(now, boot) {
            return;
        }
        if boot != peer.edition.0 {
            *peer = unknown;
        }
        peer.heard_at = now;
        // A beacon that shows it elsewhere is news as of any other.
        let state_counts = match peer.said_to_rest && !peer.is_elsewhere(pose) {
            true => STATE_AT_REST_COUNTS,
            false => STATE_COUNTS,
        };
        if peer.state_at.is_none_or(|at| now.since(at) > state_counts) {
            peer.place(now, pose);
        }
    }

    /// Takes a beacon that tells no place: its sender is heard, and what was known of its place stays.
    fn sight_without_place(&mut self, now: Time, vehicle: VehicleId, boot: Boot) {
        let known = self
            .newest
            .get_mut(&vehicle)
            .filter(|peer| peer.edition.0 == boot);
        if let Some(peer) = known {
            peer.heard_at = now;
        }
    }

    /// Records whom a ground station expects. A vehicle of the swarm that has fallen silent stays where it was last known to
    /// be, for ever; one that is none and is not heard any more was perhaps never there: it is forgotten.
    pub(super) fn note_expected(&mut self, now: Time, expected: &[VehicleId]) {
        for vehicle in expected {
            if let Some(peer) = self.newest.get_mut(vehicle) {
                peer.expected_at = Some(now);
            }
        }
        let is_recent = |at: Time| now.since(at) <= STRANGER_FOR;
        self.newest
            .retain(|_, peer| is_recent(peer.heard_at) || peer.expected_at.is_some_and(is_recent));
    }

    /// Returns whose table it is.
    pub(super) fn own(&self) -> VehicleId {
        self.own
    }

    /// Returns the others, ascending.
    pub(super) fn iter(&self) -> impl Iterator<Item = (VehicleId, &Peer)> {
        self.newest.iter().map(|(id, peer)| (*id, peer))
    }

    /// Returns what those claim that stand, ascending by their ids.
    pub(super) fn standing_claims(&self, now: Time) -> Vec<Vec<Point>> {
        let standing = self.newest.values().filter(|peer| peer.stands(now));
        standing.map(|peer| peer.claim.clone()).collect()
    }

    /// Returns what those claimed last of whom nothing was heard for so long that nobody waits for them.
    pub(super) fn claims_of_gone(&self, now: Time) -> Vec<Vec<Point>> {
        let gone = self.newest.values().filter(|peer| peer.is_gone(now));
        gone.map(|peer| peer.claim.clone()).collect()
    }

    /// Returns one of the others, if it was ever heard.
    pub(super) fn get(&self, vehicle: VehicleId) -> Option<&Peer> {
        self.newest.get(&vehicle)
    }
}

impl Peer {
    /// Returns whether a place tells of a motion.
    fn is_elsewhere(&self, pose: Pose) -> bool {
        let turned_rad = (pose.heading - self.anchor.heading).radians().abs();
        self.anchor.at.distance_to(pose.at) > MOVED_M || turned_rad > TURNED_RAD
    }

    /// Takes a place that only a beacon tells.
    fn place(&mut self, now: Time, pose: Pose) {
        if self.is_elsewhere(pose) {
            (self.anchor, self.moved_at) = (pose, now);
        }
        self.resting = now.since(self.moved_at) >= RESTS_AFTER;
        (self.at, self.heading, self.sd_m, self.claim) =
            (pose.at, pose.heading, pose.sd_m, vec![pose.at]);
        if !self.resting {
            self.claim.push(way_ahead(pose));
        }
    }
}

/// Joins two unread states of one vehicle: states may overtake each other, the newest stays.
pub(super) fn join_states(unread: State, newer: State) -> State {
    if edition(&unread) > edition(&newer) {
        unread
    } else {
        newer
    }
}

/// Returns whether a vehicle moves by somebody else's will, whatever stands against it here. One whose autopilot has fallen
/// silent meanwhile may be steered still.
fn is_steered(state: &State) -> bool {
    let is_ours = state.control == Control::Ours || state.leg.is_some();
    !is_ours && (state.mode.moves() || !state.is_at_rest)
}

/// Returns whether a vehicle neither moves nor is about to.
fn is_resting(state: &State) -> bool {
    state.leg.is_none() && !is_steered(state) && !state.mode.moves()
}

/// Returns what a vehicle goes for to where it says that it goes.
fn purpose(said: &MissionProgress) -> GoalPurpose {
    let has_ended = said.end.is_some() || said.phase == MissionPhase::Returning;
    match said.kind {
        _ if has_ended => GoalPurpose::Home,
        MissionKind::Explore | MissionKind::Search | MissionKind::Browse => GoalPurpose::See,
        MissionKind::Sweep
        | MissionKind::Legs
        | MissionKind::Forward
        | MissionKind::Pathfind
        | MissionKind::Patrol
        | MissionKind::Stored => GoalPurpose::Visit,
    }
}

/// Returns up to where one claims the ground that moves and does not say whereto.
fn way_ahead(pose: Pose) -> Point {
    pose.at + Vector::polar(pose.heading, AHEAD_M)
}

fn has_lost_its_place(state: &State) -> bool {
    state.stands_under == Some(StandReason::NoPlace)
}

/// Returns the corners of a cross over the ground where a vehicle stands that has lost its place, from its middle on.
fn ground_around(at: Point, sd_m: f64) -> Vec<Point> {
    let (along, across) = (Vector::new(sd_m, 0.0), Vector::new(0.0, sd_m));
    vec![at, at + along, at - along, at, at + across, at - across, at]
}

fn edition(state: &State) -> (Boot, u64) {
    (state.boot, state.sequence)
}

/// Returns whether a route keeps its distance from what a peer claims, a track that begins where the peer is, or at least leads
/// away from it: from a vehicle that is too near already, to farther away, and nowhere nearer to the claim or to the peer
/// itself, which may be at the other end of it.
pub(super) fn keeps_clear(from: Point, route: &Track, claim: &Track, separation_m: f64) -> bool {
    let nearest_m = route.distance_to(claim);
    if nearest_m >= separation_m {
        return true;
    }
    let (here_m, peer) = (claim.distance_to_point(from), claim.start());
    let least_m = separation_m.min(from.distance_to(peer));
    nearest_m >= here_m - NEARER_M
        && claim.distance_to_point(route.end()) > here_m
        && route.distance_to_point(peer) >= least_m - NEARER_M
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{LegReport, MissionEnd, VehicleMode};

    use super::super::tests_support::state;
    use super::*;
    use crate::sweep::VehicleProgress;

    fn at(seconds_s: f64) -> Time {
        Time::from_secs_f64(seconds_s)
    }

    fn sighting(boot: u32, x_m: f64) -> BeaconReport {
        let progress = VehicleProgress {
            vehicle: VehicleId(2),
            boot: Boot(boot),
            ..VehicleProgress::default()
        };
        BeaconReport {
            pose: state(2, x_m, 0.0).pose,
            progress,
        }
    }

    #[test]
    fn where_a_peer_goes_is_what_its_present_start_said_last() {
        let mut peers = Peers::new(VehicleId(1));
        let says = |peers: &mut Peers, boot: u32, x_m: Option<f64>, phase: MissionPhase| {
            let said = MissionProgress {
                vehicle: VehicleId(2),
                boot: Boot(boot),
                goal: x_m.map(|x_m| Point::new(x_m, 0.0).into()),
                phase,
                ..MissionProgress::default()
            };
            peers.note_goal(at(1.0), &said);
            let peer = peers.get(VehicleId(2)).and_then(|peer| peer.goal(at(1.0)));
            peer.map(|goal| (goal.at.x_m, goal.purpose))
        };
        let going = MissionPhase::Going;
        assert_eq!(says(&mut peers, 1, Some(5.0), going), None, "never placed");
        peers.take(at(1.0), &state(2, 3.0, 0.0));
        let visits = Some((5.0, GoalPurpose::Visit));
        assert_eq!(says(&mut peers, 1, Some(5.0), going), visits);
        let next = State {
            sequence: 2,
            ..state(2, 3.1, 0.0)
        };
        peers.take(at(1.2), &next);
        let old = says(&mut peers, 0, Some(9.0), going);
        assert_eq!(old, visits, "another start of it");
        let home = says(&mut peers, 1, Some(0.0), MissionPhase::Returning);
        assert_eq!(home, Some((0.0, GoalPurpose::Home)));
        assert_eq!(says(&mut peers, 1, None, going), None);
        let held = says(&mut peers, 1, Some(5.0), MissionPhase::Held);
        assert_eq!(held, None, "until somebody lets it");
        says(&mut peers, 1, Some(5.0), going);
        let restarted = State {
            boot: Boot(2),
            ..state(2, 3.1, 0.0)
        };
        peers.take(at(2.0), &restarted);
        assert_eq!(peers.get(VehicleId(2)).unwrap().goal(at(2.0)), None);
    }

    #[test]
    fn what_a_peer_goes_for_is_said_by_what_it_is_out_for() {
        let of = |kind: MissionKind, end: Option<MissionEnd>| {
            purpose(&MissionProgress {
                kind,
                end,
                ..MissionProgress::default()
            })
        };
        assert_eq!(of(MissionKind::Explore, None), GoalPurpose::See);
        assert_eq!(of(MissionKind::Patrol, None), GoalPurpose::Visit);
        let over = of(MissionKind::Explore, Some(MissionEnd::Done));
        assert_eq!(over, GoalPurpose::Home);
    }

    #[test]
    fn nobody_waits_for_a_peer_of_which_nothing_was_heard_for_long() {
        let mut peers = Peers::new(VehicleId(1));
        peers.take(at(1.0), &state(2, 3.0, 0.0));
        assert!(peers.claims_of_gone(at(21.0)).is_empty());
        let claimed = vec![vec![Point::new(3.0, 0.0)]];
        assert_eq!(peers.claims_of_gone(at(21.1)), claimed);
    }

    #[test]
    fn where_a_peer_goes_counts_while_it_tells_it_again_knows_its_place_and_steers_itself() {
        let told = |now_s: f64, control: Control, stands_under: Option<StandReason>| {
            let mut peers = Peers::new(VehicleId(1));
            peers.take(at(1.0), &state(2, 3.0, 0.0));
            let said = MissionProgress {
                vehicle: VehicleId(2),
                boot: state(2, 3.0, 0.0).boot,
                goal: Some(Point::new(5.0, 0.0).into()),
                phase: MissionPhase::Returning,
                ..MissionProgress::default()
            };
            peers.note_goal(at(1.0), &said);
            let newer = State {
                control,
                is_at_rest: control == Control::Ours,
                stands_under,
                sequence: 2,
                ..state(2, 3.0, 0.0)
            };
            peers.take(at(now_s), &newer);
            let peer = peers.get(VehicleId(2)).unwrap();
            assert!(peer.goal(at(now_s + 2.1)).is_none(), "it is silent");
            peer.goes_home(at(now_s))
        };
        assert!(told(5.9, Control::Ours, None), "it is told every second");
        assert!(!told(6.1, Control::Ours, None));
        assert!(!told(2.0, Control::Remote, None));
        assert!(!told(2.0, Control::Ours, Some(StandReason::NoPlace)));
    }

    #[test]
    fn of_one_at_rest_two_states_may_be_lost_before_its_beacons_tell_its_place() {
        for (is_at_rest, sighted_m, keeps_claim_until_s) in
            [(true, 3.0, 1.6), (true, 3.5, 1.0), (false, 3.0, 1.0)]
        {
            let mut peers = Peers::new(VehicleId(1));
            let corner = Point::new(6.0, 0.0);
            let leg = LegReport {
                route: vec![corner.into()],
            };
            let said = State {
                is_at_rest,
                leg: Some(leg),
                ..state(2, 3.0, 0.0)
            };
            peers.take(at(1.0), &said);
            let has_claim = |peers: &mut Peers, after_s: f64| {
                peers.sight(at(1.0 + after_s), &sighting(said.boot.0, sighted_m));
                let peer = peers.get(VehicleId(2)).unwrap();
                peer.claim.contains(&corner)
            };
            assert!(has_claim(&mut peers, keeps_claim_until_s));
            assert!(!has_claim(&mut peers, keeps_claim_until_s + 0.2));
        }
    }

    #[test]
    fn a_state_that_was_overtaken_changes_nothing() {
        let mut peers = Peers::new(VehicleId(1));
        let driving = State {
            mode: VehicleMode::Driving,
            sequence: 6,
            ..state(2, 3.0, 0.0)
        };
        peers.take(at(2.0), &driving);
        peers.take(
            at(3.0),
            &State {
                sequence: 5,
                ..state(2, 0.0, 0.0)
            },
        );
        let (_, peer) = peers.iter().next().unwrap();
        assert!(!peer.resting);
        assert_eq!((peer.at, peer.moved_at), (Point::new(3.0, 0.0), at(2.0)));
        peers.take(
            at(4.0),
            &State {
                boot: Boot(2),
                sequence: 1,
                ..state(2, 4.0, 0.0)
            },
        );
        assert_eq!(
            peers.iter().next().unwrap().1.at,
            Point::new(4.0, 0.0),
            "a restart counts anew"
        );
    }

    #[test]
    fn one_that_has_lost_its_place_is_where_it_was_and_one_that_never_had_one_where_it_says() {
        for (before, expected_m) in [(Some(state(2, 3.0, 0.0)), 3.0), (None, 9.0)] {
            let mut peers = Peers::new(VehicleId(1));
            before.iter().for_each(|state| peers.take(at(1.0), state));
            let lost = State {
                stands_under: Some(StandReason::NoPlace),
                sequence: 7,
                ..state(2, 9.0, 0.0)
            };
            peers.take(at(2.0), &lost);
            let (_, peer) = peers.iter().next().unwrap();
            assert_eq!(peer.at, Point::new(expected_m, 0.0));
            assert_eq!(peer.heard_at, at(2.0), "it is heard all the same");
            assert!(peer.is_lost);
        }
    }

    #[test]
    fn who_leaves_a_claim_does_not_pass_the_peer_at_its_other_end() {
        let track = |points: &[(f64, f64)]| {
            let points = points.iter().map(|(x_m, y_m)| Point::new(*x_m, *y_m));
            Track::new(points.collect()).unwrap()
        };
        // A peer at 0 claims 1.5 m ahead of it; somebody stands beside the end of that.
        let (from, claim) = (Point::new(1.4, 0.1), track(&[(0.0, 0.0), (1.5, 0.0)]));
        let leaves_to =
            |x_m, y_m| keeps_clear(from, &track(&[(1.4, 0.1), (x_m, y_m)]), &claim, 1.0);
        assert!(leaves_to(2.4, 1.5) && leaves_to(1.4, 1.5));
        assert!(!leaves_to(-3.0, 0.5), "past the peer");
        assert!(!leaves_to(1.4, -1.5), "over the claim");
    }

    #[test]
    fn one_that_has_lost_its_place_claims_the_ground_around_until_it_knows_it_again() {
        let mut peers = Peers::new(VehicleId(1));
        peers.take(at(1.0), &state(2, 3.0, 0.0));
        let sd_m = peers.get(VehicleId(2)).unwrap().sd_m;
        for (sequence, lost) in [(7, true), (8, true), (9, false)] {
            let told = State {
                stands_under: lost.then_some(StandReason::NoPlace),
                sequence,
                ..state(2, 3.0, 0.0)
            };
            peers.take(at(2.0), &told);
            let peer = peers.get(VehicleId(2)).unwrap();
            let reach = peer.claim.iter().map(|corner| corner.distance_to(peer.at));
            let reach_m = reach.fold(0.0, f64::max);
            let expected_m = if lost { sd_m } else { 0.0 };
            assert!(
                (reach_m - expected_m).abs() < 1e-9,
                "{sequence}: {reach_m} m"
            );
            assert_eq!(peer.is_lost, lost);
        }
    }

    #[test]
    fn one_that_somebody_else_steers_claims_some_way_ahead_while_it_moves() {
        for (mode, control, expected_m) in [
            (VehicleMode::Driving, Control::Remote, AHEAD_M),
            (VehicleMode::Driving, Control::Own, AHEAD_M),
            (VehicleMode::Driving, Control::Silent, AHEAD_M),
            (VehicleMode::Driving, Control::Ours, 0.0),
            (VehicleMode::Idle, Control::Remote, 0.0),
            // It is driven although it was stopped.
            (VehicleMode::Stopped, Control::Remote, AHEAD_M),
        ] {
            let mut peers = Peers::new(VehicleId(1));
            let told = State {
                mode,
                control,
                is_at_rest: mode == VehicleMode::Idle,
                ..state(2, 3.0, 0.0)
            };
            peers.take(at(1.0), &told);
            let peer = peers.get(VehicleId(2)).unwrap();
            let end = *peer.claim.last().unwrap();
            assert!((end.distance_to(peer.at) - expected_m).abs() < 1e-9);
            assert_eq!(peer.is_steered, expected_m > 0.0, "{mode:?}, {control:?}");
        }
    }

    #[test]
    fn the_own_state_is_no_peer() {
        let mut peers = Peers::new(VehicleId(2));
        peers.take(Time::ZERO, &state(2, 0.0, 0.0));
        peers.sight(Time::ZERO, &sighting(1, 0.0));
        assert_eq!(peers.iter().count(), 0);
    }

    #[test]
    fn a_beacon_tells_the_place_once_states_do_not_come() {
        let mut peers = Peers::new(VehicleId(1));
        let driving = State {
            mode: VehicleMode::Driving,
            ..state(2, 3.0, 0.0)
        };
        peers.take(at(1.0), &driving);
        peers.sight(at(1.5), &sighting(1, 3.2));
        assert_eq!(
            peers.get(VehicleId(2)).unwrap().at.x_m,
            3.0,
            "the state is fresh"
        );
        peers.sight(at(2.5), &sighting(1, 3.7));
        let peer = peers.get(VehicleId(2)).unwrap();
        assert_eq!(
            peer.claim,
            [Point::new(3.7, 0.0), Point::new(5.2, 0.0)],
            "what moves claims some way ahead"
        );
        peers.sight(at(4.5), &sighting(1, 3.8));
        let peer = peers.get(VehicleId(2)).unwrap();
        assert!(peer.resting);
        assert_eq!(peer.claim, [Point::new(3.8, 0.0)]);
    }

    #[test]
    fn who_is_heard_neither_way_is_silent_and_keeps_its_claim() {
        let mut peers = Peers::new(VehicleId(1));
        peers.take(at(1.0), &state(2, 3.0, 0.0));
        peers.sight(at(2.5), &sighting(1, 3.0));
        assert!(
            !peers.get(VehicleId(2)).unwrap().is_silent(at(4.4)),
            "a beacon is heard as well"
        );
        assert!(peers.get(VehicleId(2)).unwrap().is_silent(at(4.6)));
        assert!(!peers.get(VehicleId(2)).unwrap().claim.is_empty());
    }

    #[test]
    fn what_an_earlier_start_of_a_peer_said_does_not_count() {
        let mut peers = Peers::new(VehicleId(1));
        peers.sight(at(1.0), &sighting(2, 7.0));
        peers.sight(at(9.0), &sighting(1, 3.0));
        peers.take(
            at(9.0),
            &State {
                sequence: 900,
                ..state(2, 4.0, 0.0)
            },
        );
        let peer = peers.get(VehicleId(2)).unwrap();
        assert_eq!((peer.at.x_m, peer.heard_at), (7.0, at(1.0)));
    }

    #[test]
    fn a_peer_that_counts_its_starts_from_the_beginning_is_believed_after_a_silence() {
        let mut peers = Peers::new(VehicleId(1));
        let state_of = |boot: u32, sequence: u64, x_m: f64| State {
            boot: Boot(boot),
            sequence,
            ..state(2, x_m, 0.0)
        };
        peers.take(at(1.0), &state_of(40, 900, 1.0));
        peers.take(at(30.9), &state_of(3, 1, 2.0));
        peers.sight(at(30.9), &sighting(3, 2.0));
        assert_eq!(
            peers.get(VehicleId(2)).unwrap().at.x_m,
            1.0,
            "it was heard 29.9 s ago"
        );
        peers.take(at(31.5), &state_of(40, 899, 5.0));
        assert_eq!(
            peers.get(VehicleId(2)).unwrap().at.x_m,
            1.0,
            "of one start the order stays"
        );
        let mut by_radio = peers.clone();
        by_radio.sight(at(31.5), &sighting(3, 2.0));
        peers.take(at(31.5), &state_of(3, 1, 2.0));
        for peers in [by_radio, peers] {
            let peer = peers.get(VehicleId(2)).unwrap();
            assert_eq!((peer.at.x_m, peer.heard_at), (2.0, at(31.5)));
        }
    }

    #[test]
    fn a_state_that_a_peer_did_not_say_is_forgotten_when_its_own_go_on() {
        let mut peers = Peers::new(VehicleId(1));
        let state_of = |sequence: u64, x_m: f64| State {
            sequence,
            ..state(2, x_m, 0.0)
        };
        peers.take(at(0.0), &state_of(100, 1.0));
        peers.take(at(0.1), &state_of(u64::MAX, 9.0));
        for turn in 1..=50_u32 {
            let at = at(0.2 * f64::from(turn));
            peers.take(at, &state_of(100 + u64::from(turn), 1.0));
            peers.sight(at, &sighting(1, 1.0));
        }
        assert_eq!(
            peers.get(VehicleId(2)).unwrap().edition.1,
            u64::MAX,
            "a few may be late"
        );
        peers.take(at(10.2), &state_of(151, 2.0));
        assert_eq!(peers.get(VehicleId(2)).unwrap().at.x_m, 2.0);
        peers.take(at(10.3), &state_of(120, 1.0));
        assert_eq!(peers.get(VehicleId(2)).unwrap().at.x_m, 2.0);
    }

    #[test]
    fn a_silent_vehicle_stays_an_obstacle_unless_no_ground_station_expects_it() {
        let mut peers = Peers::new(VehicleId(1));
        for vehicle in [2, 3, 4] {
            peers.take(at(0.0), &state(vehicle, f64::from(vehicle), 0.0));
        }
        let known = |peers: &Peers| peers.iter().map(|(id, _)| id.0).collect::<Vec<_>>();
        for second in 0..200_u32 {
            let now = at(f64::from(second));
            peers.take(
                now,
                &State {
                    sequence: u64::from(second) + 2,
                    ..state(4, 4.0, 0.0)
                },
            );
            peers.note_expected(now, &[VehicleId(1), VehicleId(2)]);
            let expected = if second <= 60 {
                &[2, 3, 4][..]
            } else {
                &[2, 4]
            };
            assert_eq!(known(&peers), expected, "{second} s");
        }
        peers.note_expected(at(230.0), &[]);
        assert_eq!(
            known(&peers),
            [2, 4],
            "of several ground stations one may expect it"
        );
        peers.note_expected(at(260.1), &[]);
        assert_eq!(peers.iter().count(), 0);
    }

    #[test]
    fn a_peer_that_does_not_know_its_place_is_heard_and_stays_where_it_was_known_to_be() {
        let mut peers = Peers::new(VehicleId(1));
        let lost = |sequence| State {
            pose: None,
            sequence,
            ..state(2, 0.0, 0.0)
        };
        peers.take(at(0.5), &lost(1));
        peers.sight(
            at(0.6),
            &BeaconReport {
                pose: None,
                ..sighting(1, 0.0)
            },
        );
        assert_eq!(peers.iter().count(), 0, "nobody knows where it is");
        peers.take(
            at(1.0),
            &State {
                sequence: 2,
                ..state(2, 3.0, 0.0)
            },
        );
        peers.take(at(4.0), &lost(3));
        let peer = peers.get(VehicleId(2)).unwrap();
        assert_eq!((peer.at.x_m, peer.heard_at), (3.0, at(4.0)));
        peers.take(
            at(4.1),
            &State {
                sequence: 2,
                ..state(2, 9.0, 0.0)
            },
        );
        peers.sight(
            at(5.5),
            &BeaconReport {
                pose: None,
                ..sighting(1, 0.0)
            },
        );
        let peer = peers.get(VehicleId(2)).unwrap();
        assert_eq!((peer.at.x_m, peer.heard_at), (3.0, at(5.5)));
        assert!(!peer.is_silent(at(7.4)) && peer.is_silent(at(7.6)));
    }
}
