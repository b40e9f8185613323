//! Out of the way of peers: where they go from where they are, as far as anybody knows, and a place near by where nobody
//! stands in their way. When a vehicle steps aside is decided by who drives: [`super::runner`], [`super::returning`].

use std::collections::BTreeMap;

use tomoswarm_proto::VehicleId;

use super::home::HOME_M;
use super::terrain::{Ground, PathSearch, RULES};
use crate::geom::{Cell, Point, Track};
use crate::node::peers::{Peer, Peers};
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

/// Places aside that are nearer to each other bar the same ways, metres.
const APART_M: f64 = 0.8;
/// Who is this near to a place stands there itself, metres.
const SAME_M: f64 = 0.4;
/// So many places aside are looked at until one bars nobody's way.
const PLACES_ASIDE: usize = 6;
/// Over which ground others go: what is known, if it leads there.
const GROUNDS: [Ground; 2] = [Ground::Known, Ground::UnknownToo];

/// Where a peer is, and where it wants to go from there: straight, unless its way was searched.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct PeerWay {
    way: Track,
    is_known: bool,
    separation_m: f64,
}

impl PeerWay {
    /// Makes the way of a peer; one that is not heard goes nowhere.
    pub(super) fn of(peer: &Peer, now: Time, separation_m: f64) -> PeerWay {
        let goal = peer.goal(now);
        PeerWay {
            way: Track::straight(peer.at, goal.map_or(peer.at, |goal| goal.at)),
            is_known: goal.is_some(),
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
    /// Where others stand who are where they want to be, or go nowhere that anybody knows of.
    stay: Vec<Point>,
}

impl Bound<'_> {
    /// Returns those that are heard, and are not yet where they said that they go.
    pub(super) fn all(peers: &Peers, now: Time) -> impl Iterator<Item = Bound<'_>> {
        peers.iter().filter_map(move |(id, peer)| {
            let to = goes_to(peer, now)?;
            let stay = |(other, peer): (VehicleId, &Peer)| {
                let stays = other != id && peer.stands(now) && goes_to(peer, now).is_none();
                stays.then_some(peer.at)
            };
            let stay = peers.iter().filter_map(stay).collect();
            Some(Bound { id, peer, to, stay })
        })
    }

    /// Returns whether it cannot get there as long as a vehicle stands at a place, and may if none does: over known ground, or, if
    /// that does not lead there anyway, over what nobody has seen; as the others stand, or, if these bar its way anyway, without
    /// them.
    pub(super) fn is_barred(&self, search: &PathSearch<'_>, place: Point) -> bool {
        is_barred(search, self.ends(), &self.stay, place)
    }

    /// Returns the way there: past those who stay if there is one, known if there is one.
    fn way(&self, search: &PathSearch<'_>) -> Option<Track> {
        let past = |stand: &[Point]| {
            let mut ways = GROUNDS.into_iter();
            ways.find_map(|ground| search.way_for(self.ends(), ground, stand))
        };
        past(&self.stay).or_else(|| past(&[]))
    }

    fn ends(&self) -> (Point, Point) {
        (self.peer.at, self.to)
    }
}

/// Returns whether a vehicle that stands at a place bars the way between two others, where some others stay; see
/// [`Bound::is_barred`].
pub(super) fn is_barred(
    search: &PathSearch<'_>,
    ends: (Point, Point),
    stay: &[Point],
    place: Point,
) -> bool {
    // Who stands there has left it before anybody else comes.
    if ends.0.distance_to(place) < SAME_M {
        return false;
    }
    let all: Vec<Point> = stay.iter().copied().chain([place]).collect();
    for ground in GROUNDS {
        let is_open = |stand: &[Point]| search.is_open_for(ends, ground, stand);
        if is_open(&all) {
            return false;
        }
        let is_barred_alone = || !stay.is_empty() && is_open(&[]) && !is_open(&[place]);
        if is_open(stay) || is_barred_alone() {
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
    let mut grounds = [false, true].into_iter();
    grounds.find_map(|unknown_allowed| search.path(to, unknown_allowed, &[]))
}

/// Returns where a peer goes that is not there yet.
fn goes_to(peer: &Peer, now: Time) -> Option<Point> {
    let to = peer.goal(now)?.at;
    (peer.at.distance_to(to) > HOME_M).then_some(to)
}

/// Returns the ways of peers, searched where the map knows one.
pub(super) fn ways_of_peers(
    peers: &Peers,
    now: Time,
    search: &PathSearch<'_>,
    separation_m: f64,
) -> Vec<PeerWay> {
    let way = |bound: Bound<'_>| Some((bound.id, bound.way(search)?));
    let searched: BTreeMap<VehicleId, Track> = Bound::all(peers, now).filter_map(way).collect();
    let way = |(id, peer): (VehicleId, &Peer)| {
        let straight = PeerWay::of(peer, now, separation_m);
        match searched.get(&id) {
            Some(way) => straight.along(way.clone()),
            None => straight,
        }
    };
    peers.iter().map(way).collect()
}

/// Returns up to which distance room between a vehicle and peers on these ways is worth something, metres, when it steps aside
/// for so many times in a row.
pub(super) fn enough_m(ways: &[PeerWay], times: u32) -> f64 {
    let known = ways.iter().filter(|way| way.is_known);
    let to_ways = known.map(|way| ROOM_TO_WAY * way.separation_m * f64::from(times.max(1)));
    match ways.iter().all(|way| way.is_known) {
        true => to_ways.fold(0.0, f64::max).min(ROOM_M),
        false => ROOM_M,
    }
}

/// Returns the corners of a way aside as [`way_aside`] does, to where the vehicle bars the ways of none of some peers; `None` when
/// there is none near by that is worth it.
pub(super) fn way_aside_for(
    search: &PathSearch<'_>,
    grid: &SearchGrid,
    (ways, enough_m): (&[PeerWay], f64),
    peers: &[Bound<'_>],
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
    ways: &[PeerWay],
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
