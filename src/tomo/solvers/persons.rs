//! Persons who were found, as a picture: discs on the pixels, and what they cost the links.

use crate::geom::{PixelGrid, Point, Rect};
use crate::tomo::person::PersonModel;
use crate::tomo::{Find, Observation};

/// A pixel's share of a disc is counted by so many places along each of its sides.
const PLACES: usize = 16;

/// Those who were found, and how links meet them.
#[derive(Clone, PartialEq, Debug)]
pub(in crate::tomo) struct Persons {
    pub found: Vec<Find>,
    /// Whether what was found is likely to be persons: in a change.
    pub are_expected: bool,
    pub model: PersonModel,
    /// The ring that was driven along.
    pub ring: Rect,
    /// Deviation of where in its bin an end was, metres.
    pub smear_m: f64,
    /// The pixels that they are drawn on.
    pub grid: PixelGrid,
}

impl Persons {
    /// Returns the links without what the persons cost them.
    pub(super) fn taken_out(&self, observations: &[Observation]) -> Vec<Observation> {
        let cost_db = |link: &Observation| -> f64 {
            let met = self.model.link(link.from, link.to, self.ring, self.smear_m);
            let of = |find: &Find| find.strength * self.model.chord_m(&met, find.at);
            self.found.iter().map(of).sum()
        };
        let without = |link: &Observation| Observation {
            attenuation_db: link.attenuation_db - cost_db(link),
            ..*link
        };
        observations.iter().map(without).collect()
    }

    /// Draws a disc for each person: its strength where it is more than what is there, by the share of the pixel that it
    /// covers.
    pub(super) fn draw(&self, image: &mut [f64]) {
        for find in &self.found {
            for (pixel, value) in image.iter_mut().enumerate() {
                let share = self.share(self.grid.centre(pixel), find.at);
                *value += share * (find.strength - *value).max(0.0);
            }
        }
    }

    /// Returns the share of a pixel that a disc covers.
    fn share(&self, centre: Point, at: Point) -> f64 {
        let radius_m = self.model.radius_m;
        let (dx_m, dy_m) = (self.grid.dx_m(), self.grid.dy_m());
        if centre.distance_to(at) > radius_m + dx_m + dy_m {
            return 0.0;
        }
        let off = |step: usize| (step as f64 + 0.5) / PLACES as f64 - 0.5;
        let is_covered = |x: usize, y: usize| {
            let place = Point::new(centre.x_m + off(x) * dx_m, centre.y_m + off(y) * dy_m);
            place.distance_to(at) <= radius_m
        };
        let covered = (0..PLACES * PLACES)
            .filter(|place| is_covered(place % PLACES, place / PLACES))
            .count();
        covered as f64 / (PLACES * PLACES) as f64
    }
}
