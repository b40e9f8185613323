//! The persons of a scenario who walk: whether they can, and the scene with them.

use super::{Scenario, ScenarioError};
use crate::geom::Point;
use crate::scene::{Person, Scene};
use crate::sim::walking::{Walk, WalkingScene};
use crate::sim::world::GROUND_CLEARANCE_M;
use crate::time::Time;

/// A walk is checked at places so far apart, metres.
const CHECKED_EVERY_M: f64 = 0.1;

impl Scenario {
    /// Checks that everybody can walk where the file says: through nothing, and within the fence.
    pub(super) fn check_walks(&self, structure: &Scene) -> Result<(), ScenarioError> {
        for (index, person) in self.sim.scene.persons.iter().enumerate() {
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
                    line: self.sim.lines.persons.get(index).cloned(),
                    index,
                    name: person.name.clone(),
                    at: (at.x_m, at.y_m),
                    reason,
                });
            }
        }
        Ok(())
    }

    /// Returns for each person where it has been until a moment, at places a little apart; of one who stands still its only
    /// place.
    pub fn ways(&self, until: Time) -> Vec<Vec<Point>> {
        let way = |(person, walk): (&Person, Option<Walk>)| match walk {
            Some(walk) => walk.places_until(until, CHECKED_EVERY_M).collect(),
            None => vec![person.at],
        };
        self.persons_with_walks().map(way).collect()
    }

    /// Returns everybody, each with a walk or without.
    fn persons_with_walks(&self) -> impl Iterator<Item = (&Person, Option<Walk>)> {
        // Those of the file come first; who is drawn from the seed stands still.
        let of_file = self.sim.scene.persons.iter().map(Walk::of);
        self.persons
            .iter()
            .zip(of_file.chain(std::iter::repeat(None)))
    }

    /// Returns the scene of those who walk; `None` when all stand still.
    pub(super) fn walking(&self) -> Option<WalkingScene> {
        let file = &self.sim.scene;
        let persons: Vec<_> = self
            .persons_with_walks()
            .map(|(person, walk)| (person.clone(), walk))
            .collect();
        let radio = &self.sim.radio;
        persons
            .iter()
            .any(|(_, walk)| walk.is_some())
            .then(|| WalkingScene {
                file: file.clone(),
                shapes: self.shapes.clone(),
                persons,
                antenna_height_m: self.antenna_m(),
                wavelength_m: radio.wavelength_m(),
                object_limit_db: radio.object_limit_db,
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{self, bundled};

    #[test]
    fn who_walks_was_everywhere_along_the_way_and_who_stands_at_one_place() {
        let scene = "kind = \"scene\"\nname = \"yard\"\n\
            [[person]]\nat_m = [5, 5]\npath_m = [[9, 5], [9, 8]]\n[[person]]\nat_m = [12, 12]\n";
        let name = "configs/courtyard.sim.toml";
        let mut loader = |file: &str| match file.ends_with("scene.toml") {
            true => Ok(scene.to_owned()),
            false => bundled::load(file),
        };
        let text = bundled::load(name).unwrap();
        let sim = config::read_sim(name, &text, None, &mut loader)
            .unwrap_or_else(|problems| panic!("{problems}"));
        let scenario = Scenario::new(sim, Vec::new(), 1).unwrap();
        let early = scenario.ways(Time::from_secs_f64(2.0));
        let last = early[0].last().unwrap();
        assert!(last.distance_to(Point::new(7.0, 5.0)) < 1e-9, "{last:?}");
        let ways = scenario.ways(Time::from_secs_f64(600.0));
        let [walked, stood] = &ways[..] else {
            panic!("{ways:?}");
        };
        assert_eq!(stood[..], [Point::new(12.0, 12.0)]);
        assert_eq!(walked.first(), Some(&Point::new(5.0, 5.0)));
        for at in [(7.0, 5.0), (9.0, 6.5), (9.0, 8.0)] {
            let at = Point::new(at.0, at.1);
            let away_m = walked.iter().map(|place| place.distance_to(at));
            assert!(away_m.fold(f64::INFINITY, f64::min) <= CHECKED_EVERY_M);
        }
    }
}
