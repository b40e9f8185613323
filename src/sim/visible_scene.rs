//! What of a run's scene can be seen, by what its file says of bodies, sensors and the place. [`detected`] says what
//! a map has found of it.

use super::visible::{Room, SensorView, Visible, detected};
use super::{RunOutcome, Scenario, ScenarioError};
use crate::config::{Lobe, Sim};
use crate::geom::Lattice;
use crate::scene::Scene;

/// The slice of the map in which rovers see.
pub const SLICE: i16 = 0;
/// What stands in a scene above this height can be driven against, metres; as the referee has it.
const LOW_M: f64 = 0.02;

/// A scene without persons, and what can be seen of it.
#[derive(Debug)]
pub struct VisibleScene {
    /// What stands there.
    pub scene: Scene,
    /// The sensor.
    pub sight: SensorView,
    /// Radius of a vehicle's body, and the heights between which it can touch, metres.
    pub body: (f64, f64, f64),
    /// What can be seen.
    pub visible: Visible,
}

impl VisibleScene {
    /// Finds it for a scenario.
    ///
    /// # Errors
    /// The scene cannot be built.
    pub fn find(scenario: &Scenario) -> Result<VisibleScene, ScenarioError> {
        let (sim, scene) = (scenario.sim(), scenario.structure()?);
        let (room, sight) = (room(sim), sight(sim));
        let homes: Vec<_> = sim
            .vehicle_ids()
            .filter_map(|vehicle| sim.home(vehicle))
            .collect();
        let lattice = Lattice::new(sim.venue.cell_m);
        let visible = Visible::find(&scene, lattice, (&sim.venue.fence, &homes), &room, &sight);
        Ok(VisibleScene {
            scene,
            sight,
            body: (
                sim.vehicles.body.radius_m,
                LOW_M,
                sim.vehicles.body.height_m,
            ),
            visible,
        })
    }

    /// Returns how many of the cells that can be seen the map of an outcome has found.
    pub fn detected(&self, outcome: &RunOutcome) -> usize {
        detected(&outcome.map, SLICE, &self.visible.cells)
    }
}

fn room(sim: &Sim) -> Room {
    let keep_m = sim.vehicles.body.radius_m + sim.safety.padding_m + 2.0 * sim.vehicles.pose_sd_m;
    Room {
        keep_m,
        low_m: LOW_M,
        high_m: sim.vehicles.body.height_m,
    }
}

fn sight(sim: &Sim) -> SensorView {
    let range = &sim.range;
    SensorView {
        height_m: range.height_m,
        half_angle_rad: match range.lobe {
            Lobe::Beam => 0.0,
            // In the plane of the sensor a cone is a fan.
            Lobe::Fan | Lobe::Cone => range.look.half_angle_rad(),
        },
        min_m: range.look.min_range_m,
        max_m: range.look.max_range_m.min(range.look.farness_m),
        incidence_max_rad: range.incidence_limit_rad(),
    }
}
