//! Out of the way of peers: where they go from where they are, as far as anybody knows, and a place near by where nobody
//! stands in their way. When a vehicle steps aside is decided by who drives: [`super::runner`], [`super::returning`].

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use super::home::HOME_M;
use super::terrain::{Ground, PathSearch, RULES, Trip};
use crate::geom::{Cell, Point, Track};
use crate::node::peers::{GoalPurpose, Peer, PeerGoal, Peers};
use crate::plan::{Distances, SearchGrid};
use crate::time::Time;

/// The longest way aside, metres.
const WAY_M: f64 = 12.0;
/// Off the way of a peer is who keeps so many separations from it.
const OFF: f64 = 1.2;
/// What a metre of way must be worth in metres of room.
const WORTH: f64 = 0.15;
/// So much more room than here a place aside must have, metres.
const GAIN_M: f64 = 0.3;
/// Beyond this distance more room between peers is worth nothing, metres.
const ROOM_M: f64 = 6.0;
/// The same from ways that are known, in separations; and so much more for every time that it has stepped aside in a row.
const ROOM_TO_WAY: f64 = 1.5;

/// Who is at rest for nothing is left to be done makes room for others when so many looks in a row have shown that it bars them.
pub(super) const ROOM_AFTER_LOOKS: u32 = 3;

/// Places aside that are nearer to each other bar the same ways, metres.
const APART_M: f64 = 0.8;
/// Who is this near to a place stands there itself, metres.
const SAME_M: f64 = 0.4;
/// Who goes to see something gives that for its goal, and comes so near to it, metres.
const SEES_M: f64 = 0.7;
/// Who visits a place is on its way to that very place: its map may differ by this, metres.
const AT_PLACE_M: f64 = 0.1;
/// So many places aside are looked at until one bars nobody's way.
const PLACES_ASIDE: usize = 6;
/// Over which ground others go: what is known, if it leads there.
const GROUNDS: [Ground; 2] = [Ground::Known, Ground::UnknownToo];

/// Who is at rest for nothing is left to be done looks this often whether it bars somebody's way.
const LOOK_EVERY: Duration = Duration::from_secs(10);

/// What a vehicle at rest has seen of whether it bars the ways of others.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
pub(super) struct BarringLooks {
    next_at: Time,
    in_a_row: u32,
}

impl BarringLooks {
    /// Returns whether it is to look again.
    pub(super) fn are_due(&self, now: Time) -> bool {
        self.next_at <= now
    }

    /// Records what it has seen; returns how many looks in a row have shown that it bars somebody's way.
    pub(super) fn note(&mut self, now: Time, bars: bool) -> u32 {
        self.next_at = now + LOOK_EVERY;
        self.in_a_row = if bars { self.in_a_row + 1 } else { 0 };
        self.in_a_row
    }

    /// It makes room: what it has seen before counts no more.
    pub(super) fn begin_anew(&mut self) {
        self.in_a_row = 0;
    }
}

/// Where a peer is, and where it wants to go from there: straight, unless its way was searched.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct PeerWay {
    way: Track,
    is_known: bool,
    separation_m: f64,
}

impl PeerWay {
    /// Makes the way of a peer; one that is not heard any more goes nowhere.
    pub(super) fn of(peer: &Peer, now: Time, separation_m: f64) -> PeerWay {
        let goal = peer.goal(now);
        PeerWay {
            way: Track::straight(peer.at, goal.map_or(peer.at, |goal| goal.at)),
            is_known: goal.is_some() || peer.is_silent(now),
            separation_m,
        }
    }

    /// Returns the same of a peer whose way to where it goes was searched.
    pub(super) fn along(self, searched: Track) -> PeerWay {
        PeerWay {
            way: searched,
            ..self
        }
    }

    /// Returns whether a vehicle that stands at a place is in the way, or may be.
    pub(super) fn is_barred_from(&self, place: Point) -> bool {
        self.way.distance_to_point(place) < OFF * self.separation_m
    }
}

/// A peer that is going somewhere.
#[derive(Clone, Debug)]
pub(super) struct Bound<'a> {
    pub id: VehicleId,
    pub peer: &'a Peer,
    /// Where it goes.
    pub to: Point,
    /// It is there when it is so near, metres; where it says that for two things, it is one of the two.
    beside_m: &'static [f64],
    /// Where others stand who are where they want to be, or go nowhere that anybody knows of.
    stay: Vec<Point>,
}

impl Bound<'_> {
    /// Returns those that are heard, and are not yet where they said that they go.
    pub(super) fn all(peers: &Peers, now: Time) -> impl Iterator<Item = Bound<'_>> {
        peers.iter().filter_map(move |(id, peer)| {
            let goal = goes_to(peer, now)?;
            let stay = |(other, peer): (VehicleId, &Peer)| {
                let stays = other != id && peer.stands(now) && goes_to(peer, now).is_none();
                stays.then_some(peer.at)
            };
            let stay = peers.iter().filter_map(stay).collect();
            Some(Bound {
                id,
                peer,
                to: goal.at,
                beside_m: beside_m(&goal),
                stay,
            })
        })
    }

    /// Returns whether it cannot get there as long as a vehicle stands at a place, and may if none does: over known ground, or, if
    /// that does not lead there anyway, over what nobody has seen; as the others stand, or, if these bar its way anyway, without
    /// them.
    pub(super) fn is_barred(&self, search: &PathSearch<'_>, place: Point) -> bool {
        self.trips()
            .any(|trip| is_barred(search, &trip, &self.stay, place))
    }

    /// Returns whether somebody else cannot get somewhere once this one is where it goes, as the others stand.
    pub(super) fn bars_there(&self, search: &PathSearch<'_>, trip: &Trip) -> bool {
        is_barred(search, trip, &self.stay, self.to)
    }

    /// Returns where others stand who are where they want to be, or go nowhere that anybody knows of.
    pub(super) fn stay(&self) -> &[Point] {
        &self.stay
    }

    /// Returns the way there: past those who stay if there is one, known if there is one.
    fn way(&self, search: &PathSearch<'_>) -> Option<Track> {
        let past = |stand: &[Point]| {
            let mut ways = GROUNDS.into_iter();
            ways.find_map(|ground| {
                self.trips()
                    .find_map(|trip| search.way_for(&trip, ground, stand))
            })
        };
        past(&self.stay).or_else(|| past(&[]))
    }

    fn trips(&self) -> impl Iterator<Item = Trip> {
        self.beside_m.iter().map(|beside_m| Trip {
            from: self.peer.at,
            to: self.to,
            beside_m: *beside_m,
        })
    }
}

/// Returns whether a vehicle that stands at a place bars a way of somebody else, where some others stay; see
/// [`Bound::is_barred`].
fn is_barred(search: &PathSearch<'_>, trip: &Trip, stay: &[Point], place: Point) -> bool {
    // Who stands there has left it before anybody else comes.
    if trip.from.distance_to(place) < SAME_M {
        return false;
    }
    let all: Vec<Point> = stay.iter().copied().chain([place]).collect();
    for ground in GROUNDS {
        let is_open = |stand: &[Point]| search.is_open_for(trip, ground, stand);
        if is_open(&all) {
            return false;
        }
        // Of those who bar it together all make room that stand on one way.
        let is_on_the_way = || {
            let way = search
                .way_for(trip, ground, &[])
                .filter(|_| !stay.is_empty());
            way.is_some_and(|way| way.distance_to_point(place) < search.separation_of_others_m())
        };
        if is_open(stay) || is_on_the_way() {
            return true;
        }
    }
    false
}

/// Returns the peers that stand, or claim to drive, on the way to a place as it would be without them: known if there is such a
/// way.
pub(super) fn peers_on_way(search: &PathSearch<'_>, to: Point, peers: &Peers) -> Vec<VehicleId> {
    let Some(way) = way_without_peers(search, to) else {
        return Vec::new();
    };
    let is_on_it = |(_, peer): &(VehicleId, &Peer)| !search.is_way_clear_of(&way, &peer.claim);
    peers.iter().filter(is_on_it).map(|(id, _)| id).collect()
}

/// Returns the way to a place as it would be without peers: known if there is such a way.
pub(super) fn way_without_peers(search: &PathSearch<'_>, to: Point) -> Option<Vec<Point>> {
    way_past(search, to, &[])
}

/// Returns the way to a place as it would be if of all peers only those were there that claim this: known if there is such a way.
pub(super) fn way_past(
    search: &PathSearch<'_>,
    to: Point,
    stay: &[Vec<Point>],
) -> Option<Vec<Point>> {
    let mut grounds = [false, true].into_iter();
    grounds.find_map(|unknown_allowed| search.path(to, unknown_allowed, stay))
}

/// Returns where a peer goes that is not there yet.
fn goes_to(peer: &Peer, now: Time) -> Option<PeerGoal> {
    let is_off = |goal: &PeerGoal| peer.at.distance_to(goal.at) > HOME_M;
    peer.goal(now).filter(is_off)
}

/// Returns how near somebody is to its goal when it is there, metres. Who waits to see something says what that is, or from where
/// it would look.
fn beside_m(goal: &PeerGoal) -> &'static [f64] {
    match (goal.purpose, goal.waits) {
        (GoalPurpose::Visit, _) => &[AT_PLACE_M],
        (GoalPurpose::See, true) => &[AT_PLACE_M, SEES_M],
        (GoalPurpose::See, false) => &[SEES_M],
        (GoalPurpose::Home, _) => &[HOME_M],
    }
}

/// Returns the ways of peers, searched where the map knows one.
pub(super) fn ways_of_peers(
    peers: &Peers,
    now: Time,
    search: &PathSearch<'_>,
    separation_m: f64,
) -> BTreeMap<VehicleId, PeerWay> {
    let way = |bound: Bound<'_>| Some((bound.id, bound.way(search)?));
    let searched: BTreeMap<VehicleId, Track> = Bound::all(peers, now).filter_map(way).collect();
    let way = |(id, peer): (VehicleId, &Peer)| {
        let straight = PeerWay::of(peer, now, separation_m);
        let way = match searched.get(&id) {
            Some(way) => straight.along(way.clone()),
            None => straight,
        };
        (id, way)
    };
    peers.iter().map(way).collect()
}

/// Returns the ways that count for who looks for a place aside for some of so many peers that go somewhere: theirs, or, when these
/// are all, those of peers that stand as well.
pub(super) fn ways_of<'a>(
    ways: &'a BTreeMap<VehicleId, PeerWay>,
    first: &[&Bound<'_>],
    all: usize,
) -> Vec<&'a PeerWay> {
    let counts = |id: &VehicleId| first.len() == all || first.iter().any(|peer| peer.id == *id);
    let ways = ways.iter().filter(|(id, _)| counts(id));
    ways.map(|(_, way)| way).collect()
}

/// Returns up to which distance room between a vehicle and peers on these ways is worth something, metres, when it steps aside
/// for so many times in a row.
pub(super) fn enough_m<'a>(ways: impl Iterator<Item = &'a PeerWay>, times: u32) -> f64 {
    let (known, unknown): (Vec<&PeerWay>, Vec<&PeerWay>) = ways.partition(|way| way.is_known);
    let to_ways = known
        .iter()
        .map(|way| ROOM_TO_WAY * way.separation_m * f64::from(times.max(1)));
    match unknown.is_empty() {
        true => to_ways.fold(0.0, f64::max).min(ROOM_M),
        false => ROOM_M,
    }
}

/// Returns the way to a place at which a vehicle bars nobody's way; or no lower id's, since these go first where all bar each other;
/// or not that of one peer, the lowest ids first. `way_for` looks for one. Who `may_stay` does so where it bars none of those that
/// go first.
pub(super) fn aside_in_turn(
    search: &PathSearch<'_>,
    own: VehicleId,
    peers: &[Bound<'_>],
    may_stay: bool,
    mut way_for: impl FnMut(&[&Bound<'_>]) -> Option<Vec<Point>>,
) -> Option<Vec<Point>> {
    let bars = |first: &[&Bound<'_>]| {
        let mut first = first.iter();
        first.any(|peer| peer.is_barred(search, search.from()))
    };
    for (turn, first) in in_turn(own, peers).into_iter().enumerate() {
        // Otherwise it would go to and fro between places at each of which it bars somebody.
        if turn > 0 && may_stay && !bars(&first) {
            return None;
        }
        if let Some(corners) = way_for(&first) {
            return Some(corners);
        }
    }
    None
}

/// Returns for whom it looks, try by try.
fn in_turn<'a, 'b>(own: VehicleId, peers: &'b [Bound<'a>]) -> Vec<Vec<&'b Bound<'a>>> {
    let lower = peers.iter().filter(|peer| peer.id < own).collect();
    let mut tries = vec![peers.iter().collect(), lower];
    tries.extend(peers.iter().map(|peer| vec![peer]));
    tries.retain(|peers: &Vec<_>| !peers.is_empty());
    tries.dedup_by_key(|peers| peers.iter().map(|peer| peer.id).collect::<Vec<_>>());
    tries
}

/// Returns the corners of a way aside as [`way_aside`] does, to where the vehicle bars the ways of none of some peers; `None` when
/// there is none near by that is worth it.
pub(super) fn way_aside_for(
    search: &PathSearch<'_>,
    grid: &SearchGrid,
    (ways, enough_m): (&[&PeerWay], f64),
    peers: &[&Bound<'_>],
    may_stand: impl Fn(Point) -> bool,
) -> Option<Vec<Point>> {
    let bars = |place: Point| peers.iter().any(|peer| peer.is_barred(search, place));
    // Who bars somebody's way as it stands has to go, however little it gains by that.
    let here = Some(search.from()).filter(|at| bars(*at));
    let mut barring: Vec<Point> = here.into_iter().collect();
    for _ in 0..PLACES_ASIDE {
        let is_elsewhere = |place: Point| barring.iter().all(|at| at.distance_to(place) > APART_M);
        let may_stand_there = |place: Point| may_stand(place) && is_elsewhere(place);
        let corners = way_aside(grid, search.from(), ways, enough_m, may_stand_there)?;
        let end = *corners.last()?;
        if !bars(end) {
            return Some(corners);
        }
        barring.push(end);
    }
    None
}

/// Returns the corners of a way to where the peers and their ways are farther away than from here, up to so far; `None` when
/// there is none near by that is worth it. Only places that `may_stand` allows count.
pub(super) fn way_aside(
    grid: &SearchGrid,
    from: Point,
    ways: &[&PeerWay],
    enough_m: f64,
    may_stand: impl Fn(Point) -> bool,
) -> Option<Vec<Point>> {
    let lattice = grid.lattice();
    let reached = Distances::from_start(grid, lattice.cell_at(from), &RULES).ok()?;
    let room_m = |at: Point| {
        let distances = ways.iter().map(|one| one.way.distance_to_point(at));
        distances.fold(enough_m, f64::min)
    };
    let worth = |cell: Cell| {
        let way_m = reached.cost_m(cell).filter(|way_m| *way_m <= WAY_M)?;
        let middle = lattice.centre(cell);
        may_stand(middle).then(|| (room_m(middle) - WORTH * way_m, cell))
    };
    let best = grid
        .area()
        .cells()
        .filter_map(worth)
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    let to = lattice.centre(best.1);
    (!may_stand(from) || best.0 > room_m(from) + GAIN_M)
        .then(|| reached.route_to(grid, from, to))
        .flatten()
        .map(|route| route.points[1..].to_vec())
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::MissionProgress;

    use super::*;
    use crate::node::tests_support::state;

    #[test]
    fn all_come_before_the_lower_ids_and_these_before_each_alone() {
        let now = Time::from_secs_f64(1.0);
        let mut peers = Peers::new(VehicleId(3));
        for id in [1, 2, 4] {
            let heard = state(id, 2.0 * f64::from(id), 0.0);
            peers.take(now, &heard);
            let said = MissionProgress {
                vehicle: heard.vehicle,
                boot: heard.boot,
                goal: Some(Point::new(0.0, 9.0).into()),
                ..MissionProgress::default()
            };
            peers.note_goal(now, &said);
        }
        let bound: Vec<Bound<'_>> = Bound::all(&peers, now).collect();
        let turns = |own: u8| -> Vec<Vec<u8>> {
            let ids = |first: Vec<&Bound<'_>>| first.iter().map(|peer| peer.id.0).collect();
            in_turn(VehicleId(own), &bound)
                .into_iter()
                .map(ids)
                .collect()
        };
        let alone = [vec![1], vec![2], vec![4]];
        let before = |first: &[&[u8]]| -> Vec<Vec<u8>> {
            let first = first.iter().map(|ids| ids.to_vec());
            first.chain(alone.clone()).collect()
        };
        assert_eq!(turns(3), before(&[&[1, 2, 4], &[1, 2]]));
        assert_eq!(turns(9), before(&[&[1, 2, 4]]), "all are lower");
        assert_eq!(turns(0), before(&[&[1, 2, 4]]), "none is");
    }

    #[test]
    fn looks_are_apart_and_only_those_in_a_row_count() {
        let at = Time::from_secs_f64;
        let mut looks = BarringLooks::default();
        assert!(looks.are_due(at(0.0)));
        assert_eq!(looks.note(at(0.0), true), 1);
        assert!(!looks.are_due(at(9.9)) && looks.are_due(at(10.0)));
        assert_eq!(looks.note(at(10.0), true), 2);
        assert_eq!(looks.note(at(20.0), false), 0);
        assert_eq!(looks.note(at(30.0), true), 1);
        looks.begin_anew();
        assert_eq!(looks.note(at(40.0), true), 1);
    }
}
