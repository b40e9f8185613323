//! Peers are in the way, and nothing else is to be done: wait, and after a while step aside, the highest id first, so
//! that of two that bar each other's way one makes room.

use super::{Aim, End, Errand, Scene, WAIT, WAITS_MAX};
use crate::geom::{Cell, Point};
use crate::node::mission::pilot::RULES;
use crate::plan::Distances;

/// So many waits before the highest id steps aside, and so many more for every higher id that is there.
const PATIENCE: u32 = 2;
const PATIENCE_MORE: u32 = 2;
/// The longest way aside, metres.
const WAY_M: f64 = 8.0;
/// Beyond this distance more room between peers is worth nothing, metres.
const ROOM_M: f64 = 6.0;
/// What a metre of way must be worth in metres of room.
const WORTH: f64 = 0.15;

impl Errand {
    /// Waits for peers to make room; steps aside when that takes long, and gives up when it takes too long.
    pub(super) fn wait(&mut self, scene: &mut Scene<'_>) {
        self.waits += 1;
        if self.waits >= WAITS_MAX && self.end.is_none() {
            return self.finish(scene, End::GaveUp(self.places.len()));
        }
        let higher = scene.peers.iter().filter(|(id, _)| *id > self.settings.vehicle).count() as u32;
        let patience = PATIENCE + PATIENCE_MORE * higher;
        let steps_aside = self.waits.is_multiple_of(patience);
        if let Some(corners) = steps_aside.then(|| self.way_aside(scene)).flatten() {
            return self.drive(scene, &corners, false, Aim::Aside);
        }
        self.choose_at(scene.now + WAIT);
    }

    /// Gives a way over known ground to where the peers are farther away than here.
    fn way_aside(&self, scene: &Scene<'_>) -> Option<Vec<Point>> {
        let (pose, lattice) = (scene.pose(), self.settings.lattice);
        let grid = self.ground(scene, None, false, &scene.claims())?;
        let reached = Distances::from_start(&grid, lattice.cell_at(pose.at), &RULES).ok()?;
        let room_m = |at: Point| {
            let distances = scene.peers.iter().map(|(_, peer)| peer.at.distance_to(at));
            distances.fold(ROOM_M, f64::min)
        };
        let worth = |cell: Cell| {
            let way_m = reached.cost_m(cell).filter(|way_m| *way_m <= WAY_M)?;
            Some((room_m(lattice.centre(cell)) - WORTH * way_m, cell))
        };
        let best = grid.area().cells().filter_map(worth).max_by(|a, b| a.0.total_cmp(&b.0))?;
        let to = lattice.centre(best.1);
        (best.0 > room_m(pose.at) + 0.5)
            .then(|| reached.route_to(&grid, pose.at, to))
            .flatten()
            .map(|route| route.points[1..].to_vec())
    }
}
