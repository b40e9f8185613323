//! What can be seen of a scene, kept for all runs that share it: it does not depend on the mission nor on the seed.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::config::{Axis, Experiment, Lobe, Sim};
use crate::geom::Lattice;
use crate::scene::Scene;
use crate::sim::visible::{Room, Sight, Visible};
use crate::sim::{Scenario, ScenarioError};

/// What stands in a scene above this height can be driven against, metres; as the referee has it.
const LOW_M: f64 = 0.02;

/// A scene without persons, and what can be seen of it.
pub(super) struct Seen {
    /// What stands there.
    pub(super) scene: Scene,
    /// The sensor.
    pub(super) sight: Sight,
    /// Radius of a vehicle's body, and the heights between which it can touch, metres.
    pub(super) body: (f64, f64, f64),
    /// What can be seen.
    pub(super) visible: Visible,
}

impl Seen {
    fn find(scenario: &Scenario) -> Result<Seen, ScenarioError> {
        let (sim, scene) = (scenario.sim(), scenario.structure()?);
        let (room, sight) = (room(sim), sight(sim));
        let homes: Vec<_> = sim.vehicle_ids().filter_map(|vehicle| sim.home(vehicle)).collect();
        let lattice = Lattice::new(sim.venue.cell_m);
        let visible = Visible::find(&scene, lattice, (&sim.venue.fence, &homes), &room, &sight);
        Ok(Seen {
            scene,
            sight,
            body: (sim.vehicles.body.radius_m, LOW_M, sim.vehicles.body.height_m),
            visible,
        })
    }
}

fn room(sim: &Sim) -> Room {
    let keep_m = sim.vehicles.body.radius_m + sim.safety.padding_m + 2.0 * sim.vehicles.pose_sd_m;
    Room { keep_m, low_m: LOW_M, high_m: sim.vehicles.body.height_m }
}

fn sight(sim: &Sim) -> Sight {
    let range = &sim.range;
    Sight {
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

type Kept = Arc<OnceLock<Result<Arc<Seen>, ScenarioError>>>;

/// What has been found so far, by the values of all axes that it depends on.
#[derive(Default)]
pub(super) struct Cache {
    known: Mutex<BTreeMap<Vec<String>, Kept>>,
}

impl Cache {
    /// Gives what can be seen in a run. Who asks for the same at the same time waits for the first.
    ///
    /// # Errors
    /// The scene cannot be built.
    pub(super) fn of(
        &self,
        experiment: &Experiment,
        run: usize,
        scenario: &Scenario,
    ) -> Result<Arc<Seen>, ScenarioError> {
        let matters = |axis: &Axis| !matches!(axis, Axis::Mission | Axis::Seed);
        let key = Axis::ALL
            .iter()
            .filter(|axis| matters(axis))
            .map(|axis| experiment.name_of(run, *axis).to_owned());
        let kept = self
            .known
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .entry(key.collect())
            .or_default()
            .clone();
        kept.get_or_init(|| Seen::find(scenario).map(Arc::new)).clone()
    }
}
