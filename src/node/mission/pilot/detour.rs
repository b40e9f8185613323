//! Which path is searched when the way is blocked, or home is only a wish: to the next corners first, over the places driven
//! if home lies at the end, and back if nothing else helps: out of where it is shut in by what it knows, over its own
//! track. How one path is searched is said by [`PathSearch`].

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Segment};
use crate::node::mission::terrain::PathSearch;
use crate::node::mission::way::Way;

/// A place to go back to is at least this far away, metres.
const BACK_M: f64 = 1.0;
/// Of so many failures in a row the last one sends the vehicle far back.
const FAR_BACK_EVERY: u32 = 3;
/// After so many failures in a row the vehicle trusts its own track more than its map.
const OWN_TRACK_AFTER: u32 = 3;

/// How a path was found.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) enum FoundBy {
    /// It leads to a corner of the way.
    GoingOn,
    /// It leads home, over places where the vehicle has driven, however near to something these are.
    DrivenPlaces,
    /// It leads back, to where things look different.
    BackingOff,
    /// It leads back over the vehicle's own track, whatever the map shows there by now, to where a known way home begins.
    OwnTrack,
}

/// A path that was found.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct FoundPath {
    pub found_by: FoundBy,
    /// How many corners of the way it replaces, from the next one on.
    pub replaces: usize,
    /// Its corners, the first where the vehicle is.
    pub points: Vec<Point>,
}

/// What a path is searched with.
pub(super) struct Detour<'a> {
    pub search: PathSearch<'a>,
    pub way: &'a Way,
    /// Whether unknown ground may be crossed on the way on, try by try.
    pub unknown_tries: &'static [bool],
    /// What peers that stand claim.
    pub peers: &'a [Vec<Point>],
    /// The places that the vehicle has passed lately, oldest first.
    pub passed: Vec<Point>,
    /// Searches without a result so far.
    pub failures: u32,
    /// Whether nothing could be driven of any path that was found here.
    pub are_paths_barred: bool,
}

impl FoundPath {
    /// Returns its length, metres.
    pub(super) fn length_m(&self) -> f64 {
        self.points
            .windows(2)
            .map(|pair| Segment::new(pair[0], pair[1]).length_m())
            .sum()
    }

    /// Returns whether it leads on, and not only back.
    pub(super) fn leads_on(&self) -> bool {
        match self.found_by {
            FoundBy::GoingOn | FoundBy::DrivenPlaces => true,
            FoundBy::BackingOff | FoundBy::OwnTrack => false,
        }
    }
}

impl Detour<'_> {
    /// Searches the path that is driven next; `None` when there is none.
    pub(super) fn find(&self) -> Option<FoundPath> {
        self.off_an_obstacle()
            .or_else(|| self.back_over_own_track())
            .or_else(|| self.onward())
            .or_else(|| self.home_over_driven_places())
            .or_else(|| self.far_back())
    }

    /// Something that the map may not show is so near that no other path could be begun: the vehicle first backs off, to where
    /// nothing of that kind is as near. (To a place that is no better it would go back and forth for ever.)
    fn off_an_obstacle(&self) -> Option<FoundPath> {
        let is_better = |place: &&Point| !self.search.hems_in(**place);
        self.search
            .hems_in(self.search.from())
            .then(|| self.back_to_one_of(self.passed.iter().rev().filter(is_better)))
            .flatten()
    }

    /// To the first corner ahead that can be reached: what the way leads through before may be blocked. On the way home nothing
    /// counts but its end: where an earlier path led through may have no use from here.
    fn onward(&self) -> Option<FoundPath> {
        self.unknown_tries
            .iter()
            .find_map(|unknown_allowed| self.onward_over(*unknown_allowed))
    }

    fn onward_over(&self, unknown_allowed: bool) -> Option<FoundPath> {
        let is_homeward = self.search.is_home(self.way.end()) && self.way.stops().next().is_none();
        let passed_over = match is_homeward {
            true => self.way.ahead().count().saturating_sub(1),
            false => 0,
        };
        let mut corners = self.way.ahead().enumerate().skip(passed_over);
        corners.find_map(|(index, corner)| {
            let points = self.search.path(corner.at, unknown_allowed, self.peers)?;
            Some(FoundPath {
                found_by: FoundBy::GoingOn,
                replaces: index + 1,
                points,
            })
        })
    }

    /// The vehicle came through there, although the map may show no room any more: the map is coarse, and places drift.
    fn home_over_driven_places(&self) -> Option<FoundPath> {
        let home = self.way.end();
        if !self.search.is_home(home) {
            return None;
        }
        let points = self.search.driven_path(home, self.peers)?;
        Some(FoundPath {
            found_by: FoundBy::DrivenPlaces,
            replaces: self.way.ahead().count(),
            points,
        })
    }

    /// Again and again nothing was found, or what was found is barred, and no known way home begins here, or none that can be
    /// begun: places drift, and what vehicles heard in them closes a gap that it came through.
    fn back_over_own_track(&self) -> Option<FoundPath> {
        let home = self.way.end();
        let is_due = self.failures >= OWN_TRACK_AFTER || self.are_paths_barred;
        if !is_due || !self.search.is_home(home) {
            return None;
        }
        let at_least_m = self.are_paths_barred.then_some(BACK_M);
        let points = self.search.back_over_track(home, self.peers, at_least_m)?;
        Some(FoundPath {
            found_by: FoundBy::OwnTrack,
            replaces: 0,
            points,
        })
    }

    /// Again and again nothing was found: from farther back the vehicle may see another way.
    fn far_back(&self) -> Option<FoundPath> {
        (self.failures % FAR_BACK_EVERY == FAR_BACK_EVERY - 1)
            .then(|| self.back_to_one_of(self.passed.iter()))
            .flatten()
    }

    /// To the first of these places that is some way off and can be reached.
    fn back_to_one_of<'p>(&self, mut places: impl Iterator<Item = &'p Point>) -> Option<FoundPath> {
        let points = places.find_map(|place| {
            let is_far = place.distance_to(self.search.from()) >= BACK_M;
            is_far
                .then(|| self.search.path(*place, true, self.peers))
                .flatten()
        })?;
        Some(FoundPath {
            found_by: FoundBy::BackingOff,
            replaces: 0,
            points,
        })
    }
}

#[cfg(test)]
mod tests;
