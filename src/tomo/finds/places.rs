//! Where a person is searched: places on a lattice, with the chords of all links there, and how much one more person there
//! would explain.

use super::evidence::{Evidence, Target, sum_of_logarithms};
use crate::geom::{Point, Rect};
use crate::tomo::student::DEGREES;

/// Chords shorter than this are left out, radii of a person.
const LEAST_CHORD: f64 = 0.013;
/// Places nearer than this to a target are closed, radii of a person.
const SEPARATION: f64 = 2.0;
/// Strengths that are tried, shares of the expected one.
const STRENGTHS: [f64; 3] = [0.625, 1.0, 1.5];
/// Candidates of one search, and how far apart they are, radii of a person.
const CANDIDATES: usize = 3;
const APART: f64 = 3.3;

/// A place with the links that a person there would meet.
struct Place {
    at: Point,
    /// Link and chord, metres.
    chords: Vec<(u32, f64)>,
}

/// All places that are searched.
pub(super) struct Places(Vec<Place>);

impl Places {
    /// Lays out the places of an area, in rows from the south-west.
    pub(super) fn new(evidence: &Evidence<'_>, area: Rect, pitch_m: f64) -> Places {
        let count = |length_m: f64| libm::ceil(length_m / pitch_m - 1e-9).max(1.0) as usize;
        let (columns, rows) = (count(area.width_m()), count(area.height_m()));
        let middle = |index: usize, low_m: f64, length_m: f64, count: usize| {
            low_m + (index as f64 + 0.5) * length_m / count as f64
        };
        let at = |index: usize| {
            Point::new(
                middle(index % columns, area.min.x_m, area.width_m(), columns),
                middle(index / columns, area.min.y_m, area.height_m(), rows),
            )
        };
        let radius_m = evidence.settings.person.radius_m;
        let place = |at: Point| {
            let chords_m = evidence.chords_m(at);
            let chords = (0u32..)
                .zip(chords_m)
                .filter(|(_, chord_m)| *chord_m >= LEAST_CHORD * radius_m);
            Place {
                at,
                chords: chords.collect(),
            }
        };
        Places((0..columns * rows).map(|index| place(at(index))).collect())
    }

    /// Returns the places where one more person explains most beside some targets, the best first, if it gains at least this.
    pub(super) fn candidates(
        &self,
        evidence: &Evidence<'_>,
        targets: &[Target],
        least: f64,
    ) -> Vec<Target> {
        let residual_db = evidence.residual_db(targets);
        let scaled: Vec<(f64, f64)> = residual_db
            .iter()
            .zip(&evidence.sd_db)
            .map(|(rest_db, sd_db)| {
                let z = rest_db / sd_db;
                (z, 1.0 + z * z / DEGREES)
            })
            .collect();
        let radius_m = evidence.settings.person.radius_m;
        let is_open = |place: &&Place| {
            targets
                .iter()
                .all(|target| target.at.distance_to(place.at) >= SEPARATION * radius_m)
        };
        let mut found: Vec<(f64, Target)> = self
            .0
            .iter()
            .filter(is_open)
            .map(|place| place.best(evidence, &scaled))
            .filter(|(gain, _)| *gain >= least)
            .collect();
        // Stable: of equal places the first one counts.
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut chosen: Vec<Target> = Vec::new();
        for (_, target) in found {
            let is_apart = |other: &Target| other.at.distance_to(target.at) >= APART * radius_m;
            if chosen.len() < CANDIDATES && chosen.iter().all(is_apart) {
                chosen.push(target);
            }
        }
        chosen
    }
}

impl Place {
    /// Returns the strength with which a person here explains most, and how much: the gain of the logarithm of the likelihood.
    fn best(&self, evidence: &Evidence<'_>, scaled: &[(f64, f64)]) -> (f64, Target) {
        let gain = |strength: f64| {
            let without = self.chords.iter().map(|(link, _)| scaled[*link as usize].1);
            let with = self.chords.iter().map(|(link, chord_m)| {
                let link = *link as usize;
                let z = scaled[link].0 - strength * chord_m / evidence.sd_db[link];
                let z = evidence.left_db(link, z);
                1.0 + z * z / DEGREES
            });
            let gained = sum_of_logarithms(without) - sum_of_logarithms(with);
            (DEGREES + 1.0) / 2.0 * gained - evidence.penalty(strength)
        };
        let of_share = |share: f64| {
            let strength = share * evidence.settings.strength_db_per_m;
            (gain(strength), strength)
        };
        let best = STRENGTHS
            .map(of_share)
            .into_iter()
            .reduce(|best, next| if next.0 > best.0 { next } else { best });
        let (gain, strength) = best.unwrap_or((0.0, evidence.settings.strength_db_per_m));
        (
            gain,
            Target {
                at: self.at,
                strength,
            },
        )
    }
}
