//! Persons of a scene who walk: where they are at a moment, and the world with them there.
//!
//! A walk leads from the person's place along its path and the same way back, again and again, at one speed, from the
//! beginning of virtual time on; so where somebody is follows from the moment alone. Nothing is put into the world here,
//! and nobody evades.

use super::staging;
use super::world::WorldContents;
use crate::config::{self, SceneFile};
use crate::geom::Point;
use crate::scene::{Attenuation, Person, SceneError, VrmlShape};
use crate::time::Time;

/// The way of a person.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Walk {
    /// Its corners; the first is where the person stands at the beginning.
    corners: Vec<Point>,
    speed_mps: f64,
}

impl Walk {
    /// Returns the walk of a person of a scene file; `None` when it stands still.
    pub(super) fn of(person: &config::Person) -> Option<Walk> {
        let corners: Vec<Point> = [person.at].into_iter().chain(person.path.clone()).collect();
        let walk = Walk {
            corners,
            speed_mps: person.speed_mps,
        };
        (walk.length_m() > 0.0).then_some(walk)
    }

    fn length_m(&self) -> f64 {
        let pairs = self.corners.windows(2);
        pairs.fold(0.0, |sum, pair| sum + pair[0].distance_to(pair[1]))
    }

    /// Returns where the person is.
    pub(super) fn at(&self, now: Time) -> Point {
        let length_m = self.length_m();
        let walked_m = now.as_secs_f64() * self.speed_mps % (2.0 * length_m);
        self.place(walked_m.min(2.0 * length_m - walked_m))
    }

    /// Returns the place so far along the way, metres.
    fn place(&self, along_m: f64) -> Point {
        let mut left_m = along_m;
        for pair in self.corners.windows(2) {
            let piece_m = pair[0].distance_to(pair[1]);
            if left_m < piece_m {
                return pair[0].toward(pair[1], left_m / piece_m);
            }
            left_m -= piece_m;
        }
        self.corners.last().copied().unwrap_or_default()
    }

    /// Returns places along the whole way, at most this far apart, metres.
    pub(super) fn places(&self, apart_m: f64) -> impl Iterator<Item = Point> + '_ {
        self.places_along(self.length_m(), apart_m)
    }

    /// Returns places where the person has been until a moment, at most this far apart, metres.
    pub(super) fn places_until(
        &self,
        until: Time,
        apart_m: f64,
    ) -> impl Iterator<Item = Point> + '_ {
        let walked_m = until.as_secs_f64() * self.speed_mps;
        self.places_along(walked_m.min(self.length_m()), apart_m)
    }

    fn places_along(&self, way_m: f64, apart_m: f64) -> impl Iterator<Item = Point> + '_ {
        let count = libm::ceil(way_m / apart_m).max(1.0) as usize;
        (0..=count).map(move |step| self.place(way_m * step as f64 / count as f64))
    }
}

/// What a world with walking persons is made of.
pub struct WalkingScene {
    pub(super) file: SceneFile,
    pub(super) shapes: Vec<VrmlShape>,
    /// Everybody, each with a walk or without.
    pub(super) persons: Vec<(Person, Option<Walk>)>,
    pub(super) antenna_height_m: f64,
    pub(super) wavelength_m: f64,
    pub(super) object_limit_db: f64,
}

impl WalkingScene {
    /// Returns the world with everybody where they are at a moment.
    ///
    /// # Errors
    /// The scene cannot be built, which it could when the run began.
    pub fn at(&self, now: Time) -> Result<WorldContents, SceneError> {
        let moved = |(person, walk): &(Person, Option<Walk>)| Person {
            at: walk.as_ref().map_or(person.at, |walk| walk.at(now)),
            ..person.clone()
        };
        let persons: Vec<Person> = self.persons.iter().map(moved).collect();
        let scene = staging::build(&self.file, &self.shapes, &persons)?;
        let attenuation = Attenuation::new(
            &scene,
            self.antenna_height_m,
            self.wavelength_m,
            self.object_limit_db,
        );
        Ok(WorldContents { scene, attenuation })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk(speed_mps: f64) -> Walk {
        let place = |x_m, y_m| Point::new(x_m, y_m);
        Walk::of(&config::Person {
            at: place(1.0, 1.0),
            path: vec![place(5.0, 1.0), place(5.0, 4.0)],
            speed_mps,
            ..config::Person::default()
        })
        .unwrap()
    }

    #[test]
    fn a_walk_leads_there_and_back_again_and_again() {
        let walk = walk(0.5);
        for (at_s, x_m, y_m) in [
            (0.0, 1.0, 1.0),
            (4.0, 3.0, 1.0),
            (10.0, 5.0, 2.0),
            (14.0, 5.0, 4.0),
            (18.0, 5.0, 2.0),
            (28.0, 1.0, 1.0),
            (32.0, 3.0, 1.0),
        ] {
            let off_m = walk
                .at(Time::from_secs_f64(at_s))
                .distance_to(Point::new(x_m, y_m));
            assert!(off_m < 1e-9, "{at_s}: {off_m}");
        }
        let places: Vec<Point> = walk.places(0.1).collect();
        assert!(
            places
                .windows(2)
                .all(|pair| pair[0].distance_to(pair[1]) <= 0.1 + 1e-9)
        );
        assert_eq!(places.last(), Some(&Point::new(5.0, 4.0)));
    }

    #[test]
    fn a_walk_to_where_one_stands_is_none() {
        let still = config::Person {
            path: vec![Point::default()],
            speed_mps: 1.0,
            ..config::Person::default()
        };
        assert_eq!(Walk::of(&still), None);
    }

    #[test]
    fn who_walks_blocks_links_and_range_sensors_where_it_is_and_nowhere_else() {
        let person = Person {
            name: "ada".to_owned(),
            at: Point::new(1.0, 1.0),
            path: Vec::new(),
            radius_m: 0.3,
            height_m: 1.8,
            db_per_m: 10.0,
        };
        let walking = WalkingScene {
            file: SceneFile::of_shapes(config::Up::Z),
            shapes: Vec::new(),
            persons: vec![(person, Some(walk(0.5)))],
            antenna_height_m: 0.5,
            wavelength_m: 0.125,
            object_limit_db: 30.0,
        };
        let stage = |at_s: f64| walking.at(Time::from_secs_f64(at_s)).unwrap();
        let across = |x_m: f64| (Point::new(x_m, -4.0), Point::new(x_m, 6.0));
        for (at_s, x_m) in [(0.0, 1.0), (4.0, 3.0)] {
            for place_m in [1.0, 3.0] {
                let stage = stage(at_s);
                let (from, to) = across(place_m);
                let lost_db = stage.attenuation.between(from, to);
                assert_eq!(lost_db > 1.0, place_m == x_m, "{at_s} {place_m}: {lost_db}");
                let echo = stage.scene.cast([place_m, -4.0, 0.5], [0.0, 1.0, 0.0], 9.0);
                assert_eq!(echo.is_some(), place_m == x_m, "{at_s} {place_m}");
            }
        }
    }
}
