//! What a vehicle knows of the ground around it: the map, what made its reflex halt, the peers that stand, and where it has
//! driven itself. Which strip is free, where the vehicle may be and which path leads where follows from these alone.
//!
//! Deliberately absent: the way that is driven (see `pilot`), and the ways of peers that drive: a mission that keeps clear
//! of them hands their claims to its search.

mod driven_places;
mod fence_clearance;
mod optimistic;
mod others;
mod peer_clearance;
mod reflex_obstacles;
mod search;

use serde::{Deserialize, Serialize};

pub(super) use self::others::{Ground, Trip};
pub(super) use self::search::{
    OpenGround, PathSearch, RULES, ReachedGround, Resolution, WAYS, is_small,
};

use self::driven_places::DrivenPlaces;
use self::reflex_obstacles::{ReflexObstacles, hold_before};
use super::obstruction::ObstructionKind;
use super::way::Way;
use crate::geom::{Cell, Point, Pose, Rect};
use crate::map::{Bar, CellRect, MapTile, Merged, Occupancy};
use crate::node::VehicleSettings;
use crate::node::vehicle::ReflexObstacle;
use crate::plan::{Corridor, Release, RequiredClearance};
use crate::time::Time;

/// The map is looked at this much farther than the strip is judged, metres: the strip has a width.
const VIEW_MARGIN_M: f64 = 2.0;

/// What is known of the ground.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Terrain {
    settings: VehicleSettings,
    map: Merged,
    reflex_obstacles: ReflexObstacles,
    /// Peers that stand or are silent, each with the way that it claims: they are planned around.
    standing_peers: Vec<Vec<Point>>,
    driven_places: DrivenPlaces,
    /// Whether the range sensors answer. Without them only the vehicle's own track is driven: what was seen from afar may
    /// be wrong, and nothing else would halt it.
    sees: bool,
}

/// A strip of a way of which a release is wanted.
pub(super) struct Strip<'a> {
    /// The way that the strip belongs to.
    pub way: &'a Way,
    /// The corners of the strip: the way, or the first part of it.
    pub route: Vec<Point>,
    /// How wide it is, and how far ahead it is judged.
    pub corridor: Corridor,
}

impl Terrain {
    /// Makes the terrain of a vehicle that knows nothing of the world.
    pub(super) fn new(settings: VehicleSettings) -> Terrain {
        Terrain {
            map: Merged::trusting(settings.lattice, settings.layer()),
            settings,
            reflex_obstacles: ReflexObstacles::default(),
            standing_peers: Vec::new(),
            driven_places: DrivenPlaces::default(),
            sees: true,
        }
    }

    /// Takes a tile of the map actor.
    pub(super) fn learn(&mut self, tile: &MapTile) {
        // The map actor has checked it; one that is known already changes nothing.
        let _ = self.map.learn(tile);
    }

    /// Remembers what made the reflex halt.
    pub(super) fn note_obstacle(&mut self, now: Time, obstacle: ReflexObstacle) {
        self.reflex_obstacles.note(now, obstacle);
    }

    /// Returns what it is that blocks a way at a place: what made the reflex halt there of late, or else what the map shows.
    pub(super) fn kind_of_obstacle(&self, now: Time, at: Point) -> ObstructionKind {
        match self.reflex_obstacles.present(now).any(|one| one.at == at) {
            true => ObstructionKind::ReflexObstacle,
            false => ObstructionKind::Obstacle,
        }
    }

    /// Takes what peers that stand or are silent claim, to be planned around.
    pub(super) fn note_standing_peers(&mut self, claims: Vec<Vec<Point>>) {
        self.standing_peers = claims;
    }

    /// Remembers where the vehicle is.
    pub(super) fn note_place(&mut self, place: Point) {
        self.driven_places.note(place);
    }

    /// Remembers whether the range sensors answer.
    pub(super) fn note_sight(&mut self, sees: bool) {
        self.sees = sees;
    }

    /// Returns the map.
    pub(super) fn map(&self) -> &Merged {
        &self.map
    }

    /// Returns whether a place is known to be free.
    pub(super) fn is_free(&self, place: Point) -> bool {
        let cell = self.settings.lattice.cell_at(place);
        self.map.occupancy(self.settings.slice, cell) == Occupancy::Free
    }

    /// Returns what peers that stand or are silent claim.
    pub(super) fn standing_peers(&self) -> &[Vec<Point>] {
        &self.standing_peers
    }

    /// Returns the places where the vehicle has driven, in order.
    pub(super) fn driven(&self) -> &[Point] {
        self.driven_places.all()
    }

    /// Returns the places that the vehicle has passed lately, oldest first: the way back out of a dead end.
    pub(super) fn passed_lately(&self) -> impl DoubleEndedIterator<Item = Point> {
        self.driven_places.recent()
    }

    /// Returns what must be free of a way that a vehicle at a pose drives.
    pub(super) fn released(&self, pose: Pose) -> RequiredClearance {
        let settings = &self.settings;
        search::planned(settings, pose).released(settings.lattice.cell_m())
    }

    /// Returns the search for paths of a vehicle at a pose.
    pub(super) fn search(&self, now: Time, pose: Pose) -> PathSearch<'_> {
        PathSearch {
            settings: &self.settings,
            map: &self.map,
            obstacles: self.obstacles(now),
            driven: self.driven(),
            is_on_track: !self.sees,
            pose,
        }
    }

    /// Returns whether a place could be reached, as far as is known; unknown cells count as free.
    pub(super) fn can_reach(&self, now: Time, pose: Pose, place: Point) -> bool {
        self.search(now, pose)
            .path(place, true, &self.standing_peers)
            .is_some()
    }

    /// Returns how far a strip may be driven by a vehicle at a pose: as far as the map knows it to be free, and nothing on
    /// it has made the reflex halt; by one that does not see no farther than it has driven before.
    pub(super) fn release(&self, now: Time, pose: Pose, strip: &Strip<'_>) -> Release {
        let margin_m = strip.corridor.ahead_m + VIEW_MARGIN_M;
        let around = Rect::new(pose.at, pose.at).shrunk(-margin_m);
        let area = CellRect::covering(self.settings.lattice, around);
        let view = self.map.view(self.settings.slice, area);
        let mut release = strip.corridor.released(&view, &strip.route, pose.at);
        hold_before(&self.obstacles(now), pose.at, strip.way, &mut release);
        if !self.sees {
            self.hold_on_track(pose.at, strip.way, &mut release);
        }
        release
    }

    /// Returns what made the reflex halt of late. What the map is sure of on the arc of its echo keeps its clearance by the
    /// map: then the rest of the arc, which may reach across a doorway that the vehicle has come in by, is taken for free.
    fn obstacles(&self, now: Time) -> Vec<ReflexObstacle> {
        let present = self.reflex_obstacles.present(now).copied();
        let by_map = |obstacle: ReflexObstacle| match self.is_on_map(&obstacle) {
            true => obstacle.in_the_middle(),
            false => obstacle,
        };
        present.map(by_map).collect()
    }

    /// Returns whether the map is sure that something stands on the arc of an echo that made the reflex halt.
    fn is_on_map(&self, obstacle: &ReflexObstacle) -> bool {
        let lattice = self.settings.lattice;
        let near_m = obstacle.keep_m - obstacle.middle_keep_m + lattice.cell_m() / 2.0;
        let Some(area) = CellRect::around(lattice, &[obstacle.at], near_m + lattice.cell_m())
        else {
            return false;
        };
        let view = self.map.view(self.settings.slice, area);
        let is_sure = |cell: Cell| {
            let barred = view.barred(cell);
            let sure = barred.filter(|barred| barred.bar == Bar::Confirmed);
            sure.is_some_and(|barred| barred.distance_m(lattice, cell, obstacle.at) <= near_m)
        };
        area.cells().any(is_sure)
    }

    /// Ends a release where the way leaves what the vehicle has driven.
    fn hold_on_track(&self, place: Point, way: &Way, release: &mut Release) {
        let here_m = release.here_m;
        let route = way.until(place, here_m, release.free_until_m);
        if let Some((until_m, at)) = self.driven_places.leaves_track_at(&route) {
            let until_m = (here_m + until_m).min(release.free_until_m);
            release.free_until_m = until_m;
            (release.unknown, release.unknown_at_m) = (Some(at), Some(until_m));
        }
    }
}

#[cfg(test)]
pub(super) mod tests;
