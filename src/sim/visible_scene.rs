//! What of a run's scene can be got to and seen, by what its file says of bodies, sensors and the place: the truth by which
//! missions are judged. [`VisibleScene::detected`] says what a map has found of it, and [`VisibleScene::count_places`] what
//! was made of the places to visit.
//!
//! Persons stand in the way, and are seen, like anything else.

use tomoswarm_proto::VehicleId;

use super::place_results::{PlaceFate, PlaceResult};
use super::reachable::{Reachable, Room};
use super::visible::{SensorView, Visible, detected};
use super::world::GROUND_CLEARANCE_M;
use super::{RunOutcome, Scenario, ScenarioError};
use crate::config::{Lobe, Sim};
use crate::geom::Lattice;
use crate::scene::Scene;

/// The slice of the map in which rovers see.
pub const SLICE: i16 = 0;
/// Who knows the world as a map of cells keeps so much more room on each side, cells: half of a cell's diagonal, and a
/// little.
const MAP_CELLS: f64 = 0.75;

/// A scene with its persons, and what can be got to and seen of it.
#[derive(Debug)]
pub struct VisibleScene {
    /// What stands there.
    pub scene: Scene,
    /// What of it stands there all the time: without persons who enter later, or walk.
    pub lasting: Scene,
    /// The sensor.
    pub sight: SensorView,
    /// Radius of a vehicle's body, and the heights between which it can touch, metres.
    pub body: (f64, f64, f64),
    /// Where vehicles can get to.
    pub reachable: Reachable,
    /// What can be seen from there.
    pub visible: Visible,
    /// The vehicles, in the order of the homes.
    vehicles: Vec<VehicleId>,
}

/// How many places there were to visit, and what was made of them by the truth.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PlaceCounts {
    /// Those that their vehicle can get to.
    pub reachable: usize,
    /// Those of the reachable ones that it visited.
    pub visited: usize,
    /// Those of the reachable ones of which it was ever said that no way leads there.
    pub false_no_way: usize,
}

impl VisibleScene {
    /// Finds it for a scenario.
    ///
    /// # Errors
    /// The scene cannot be built.
    pub fn find(scenario: &Scenario) -> Result<VisibleScene, ScenarioError> {
        let (sim, scene) = (scenario.sim(), scenario.populated()?);
        let (room, sight) = (room(sim), sight(sim));
        let (vehicles, homes): (Vec<_>, Vec<_>) = sim
            .vehicle_ids()
            .filter_map(|vehicle| Some((vehicle, sim.home(vehicle)?)))
            .unzip();
        let lattice = Lattice::new(sim.venue.cell_m);
        let reachable = Reachable::find(&scene, &sim.venue.fence, &homes, &room);
        let visible = Visible::find(&scene, lattice, &reachable, &sight);
        Ok(VisibleScene {
            scene,
            lasting: scenario.lasting()?,
            sight,
            body: (room.body_m, room.low_m, room.high_m),
            reachable,
            visible,
            vehicles,
        })
    }

    /// Returns how many of the cells that can be seen the map of an outcome has found.
    pub fn detected(&self, outcome: &RunOutcome) -> usize {
        detected(&outcome.map, SLICE, &self.visible.cells)
    }

    /// Returns whether the vehicle of a place can get there.
    pub fn is_reachable(&self, result: &PlaceResult) -> bool {
        let home = self.vehicles.iter().position(|id| *id == result.vehicle);
        home.is_some_and(|home| self.reachable.is_reachable(&self.scene, home, result.place))
    }

    /// Counts what was made of places by the truth.
    pub fn count_places(&self, results: &[PlaceResult]) -> PlaceCounts {
        let mut counts = PlaceCounts::default();
        for result in results.iter().filter(|result| self.is_reachable(result)) {
            counts.reachable += 1;
            counts.visited += usize::from(result.fate == PlaceFate::Visited);
            counts.false_no_way += usize::from(result.was_called_no_way);
        }
        counts
    }
}

/// Returns the width of the narrowest gap between things that stand still through which a vehicle gets for sure, metres: more
/// than twice the room that it needs on each side, in whole centimetres.
pub fn narrowest_gap_m(sim: &Sim) -> f64 {
    (libm::floor(200.0 * room(sim).keep_m + 1e-6) + 1.0) / 100.0
}
/// Returns the room by which is judged where vehicles can get to: the safety distance (radius and padding), by how much wind
/// carries them, two deviations of the place, and what a map of cells costs.
fn room(sim: &Sim) -> Room {
    let (body_m, altitude_m) = (
        sim.vehicles.body.radius_m,
        sim.vehicles.flight.way_altitude_m(),
    );
    let safety_m = body_m + sim.safety.padding_m + sim.vehicles.flight.carried_m();
    Room {
        keep_m: safety_m + 2.0 * sim.vehicles.pose_sd_m + MAP_CELLS * sim.venue.cell_m,
        body_m,
        low_m: altitude_m + GROUND_CLEARANCE_M,
        high_m: altitude_m + sim.vehicles.body.height_m,
    }
}

fn sight(sim: &Sim) -> SensorView {
    let range = &sim.range;
    let max_m = range.look.max_range_m.min(range.look.farness_m);
    SensorView {
        height_m: sim.sensor_height_m(),
        half_angle_rad: match range.lobe {
            Lobe::Beam => 0.0,
            // In the plane of the sensor a cone is a fan.
            Lobe::Fan | Lobe::Cone => range.look.half_angle_rad(),
        },
        min_m: range.look.min_range_m,
        max_m,
        incidence_max_rad: range.incidence_limit_rad(),
        posts: match range.lobe {
            Lobe::Beam => None,
            Lobe::Fan | Lobe::Cone => Some(range.look.post_detection(max_m)),
        },
    }
}

#[cfg(test)]
mod tests;
