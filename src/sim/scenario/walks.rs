//! The persons of a scenario who walk: whether they can, and the scene with them.

use super::{Scenario, ScenarioError};
use crate::scene::Scene;
use crate::sim::walking::{Walk, WalkingScene};
use crate::sim::world::GROUND_CLEARANCE_M;

/// A walk is checked at places so far apart, metres.
const CHECKED_EVERY_M: f64 = 0.1;

impl Scenario {
    /// Checks that everybody can walk where the file says: through nothing, and within the fence.
    pub(super) fn check_walks(&self, structure: &Scene) -> Result<(), ScenarioError> {
        for person in &self.sim.scene.persons {
            let Some(walk) = Walk::of(person) else {
                continue;
            };
            for at in walk.places(CHECKED_EVERY_M) {
                let clear_m = structure.clearance_m(at, GROUND_CLEARANCE_M, person.height_m);
                let reason = if clear_m < person.radius_m {
                    format!(
                        "{clear_m:.2} m from an object; at least the radius of {} m is needed",
                        person.radius_m
                    )
                } else if !self.sim.venue.fence.contains(at) {
                    "outside the fence of the venue; a way within it is needed".to_owned()
                } else {
                    continue;
                };
                return Err(ScenarioError::Walk {
                    name: person.name.clone(),
                    at: (at.x_m, at.y_m),
                    reason,
                });
            }
        }
        Ok(())
    }

    /// Returns the scene of those who walk; `None` when all stand still.
    pub(super) fn walking(&self) -> Option<WalkingScene> {
        let file = &self.sim.scene;
        // Those of the file come first; who is drawn from the seed stands still.
        let walks = file
            .persons
            .iter()
            .map(Walk::of)
            .chain(std::iter::repeat(None));
        let persons: Vec<_> = self.persons.iter().cloned().zip(walks).collect();
        let radio = &self.sim.radio;
        persons
            .iter()
            .any(|(_, walk)| walk.is_some())
            .then(|| WalkingScene {
                file: file.clone(),
                shapes: self.shapes.clone(),
                persons,
                antenna_height_m: self.sim.vehicles.body.antenna_height_m,
                wavelength_m: radio.wavelength_m(),
                object_limit_db: radio.object_limit_db,
            })
    }
}
