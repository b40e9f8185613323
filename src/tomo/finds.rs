//! Who in a sweep is a person: places are searched with the exact cost of a person to every link, and believed when their
//! evidence, divided by how much the links' noise goes together, exceeds what a wanted rate of false ones allows.
//!
//! | part | |
//! | --- | --- |
//! | `evidence` | the likelihood of persons at some places, and its maximum near by |
//! | `places` | where one more person would explain most |
//! | `place` | how far off a place may be |
//! | `correlation` | how much the noise of neighbouring links goes together |
//! | `threshold` | how strong evidence must be |
//!
//! Who stands where something solid stood in the empty sweep must be seen more surely ([`super::room`]).
//!
//! Persons are added one by one while each gains something, refined together each time; then the weakest ones are taken out
//! again, one by one, until all that are left pass.

mod correlation;
mod evidence;
mod place;
mod places;
mod threshold;

use serde::{Deserialize, Serialize};

use self::correlation::Correlation;
use self::evidence::{Derivatives, Evidence, Target};
use self::places::Places;
use self::threshold::FalseRate;
use super::cholesky::{Cholesky, dot};
use super::person::PersonModel;
use super::room::room_at;
use super::student::DEGREES;
use super::{Image, Observation};
use crate::geom::{Point, Rect};

/// A person is added while it gains this much, or as much as passes if that is less, a liberal measure: false ones soak up
/// clutter and go again.
const LEAST_GAIN: f64 = 8.0;
/// A place is looked at more closely from this share of it on.
const CANDIDATE_SHARE: f64 = 0.4;
/// So much gain marks those who are taken out when the noise is measured.
const STRONG_GAIN: f64 = 15.0;
/// The same when the correlation is measured.
const SURE_GAIN: f64 = 20.0;
/// Who passes and whose place is less sure than this, radii of a person, is not found: the links cannot tell where.
const LOCATED: f64 = 3.3;
/// Places are searched farther apart where there would be more, or more pairs of a place and a link; one pair in eight or so is
/// kept, 16 bytes. Eight vehicles around 20 x 20 m make 40 million.
const MOST_PLACES: f64 = 100_000.0;
const MOST_PAIRS: f64 = 100_000_000.0;
/// Most persons that are searched.
const MOST: usize = 12;

/// How persons are found.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct FindSettings {
    /// What is believed of a person.
    pub person: PersonModel,
    /// The expected attenuation of a person, dB/m.
    pub strength_db_per_m: f64,
    /// The deviation of its natural logarithm.
    pub strength_log_sd: f64,
    /// Nobody is searched nearer to the edge of the area than this, metres.
    pub rim_m: f64,
    /// Places are searched this far apart, metres.
    pub pitch_m: f64,
    /// How many places where nobody stands may be found in an image, on the mean.
    pub false_per_image: f64,
}

/// A place where a person may stand.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Find {
    /// Where, metres.
    pub at: Point,
    /// How strongly it attenuates, dB/m.
    pub strength: f64,
    /// Variance by x, covariance, variance by y of the place, m².
    pub covariance_m2: [f64; 3],
    /// Gain of the logarithm of the likelihood by this person, divided by how much the links' noise goes together, with the
    /// logarithm of how likely the place is for what stood there in the empty sweep.
    pub evidence: f64,
    /// Probability that an image of nobody shows no place as strong as this one; within what was solid, where evidence is
    /// lowered, at least that.
    pub probability: f64,
}

impl Find {
    /// Returns the larger of the deviations of the place by x and by y, metres.
    pub fn deviation_m(&self) -> f64 {
        larger_deviation_m(self.covariance_m2)
    }
}

/// Who was found in a sweep.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Finds {
    /// Those that pass, strongest evidence first.
    pub found: Vec<Find>,
    /// The strongest place that does not pass, or that passes and cannot be told well enough.
    pub next: Option<Find>,
    /// The evidence at which a place passes.
    pub threshold: f64,
    /// How many places where nobody stands may be found in an image, on the mean.
    pub false_per_image: f64,
}

impl Finds {
    /// Returns the strongest one that passes and whose place the links cannot tell: somebody is there, and nobody knows where.
    pub fn unlocated(&self, settings: &FindSettings) -> Option<&Find> {
        let passes =
            |next: &&Find| next.evidence >= self.threshold && !settings.locates(next.covariance_m2);
        self.next.as_ref().filter(passes)
    }
}

impl FindSettings {
    /// A person of 0.3 m radius, by radios of 2.4 GHz.
    pub const IN_METRES: FindSettings = FindSettings {
        person: PersonModel {
            radius_m: 0.3,
            wavelength_m: 0.125,
        },
        strength_db_per_m: 8.0,
        strength_log_sd: 0.5,
        rim_m: 0.8,
        pitch_m: 0.4,
        false_per_image: 0.02,
    };

    /// Returns whether a place of this covariance is known well enough.
    fn locates(&self, covariance_m2: [f64; 3]) -> bool {
        larger_deviation_m(covariance_m2) <= LOCATED * self.person.radius_m
    }

    /// Returns the same in cells of a lattice over an area; rim and pitch go by the area, which persons stand in as they can.
    pub fn in_cells(area: Rect, cell_m: f64) -> FindSettings {
        let metres = FindSettings::IN_METRES;
        FindSettings {
            person: PersonModel {
                radius_m: metres.person.radius_m / cell_m,
                wavelength_m: metres.person.wavelength_m / cell_m,
            },
            strength_db_per_m: metres.strength_db_per_m * cell_m,
            ..FindSettings::scaled_to(area)
        }
    }

    /// Returns the same in a unit of which an area has as many as one of 20 m has metres.
    pub fn scaled_to(area: Rect) -> FindSettings {
        let metres = FindSettings::IN_METRES;
        let scale = area.width_m().max(area.height_m()) / 20.0;
        FindSettings {
            person: PersonModel {
                radius_m: metres.person.radius_m * scale,
                wavelength_m: metres.person.wavelength_m * scale,
            },
            strength_db_per_m: metres.strength_db_per_m / scale,
            rim_m: metres.rim_m * scale,
            pitch_m: metres.pitch_m * scale,
            ..metres
        }
    }
}

/// How the ends of links were driven.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Driven {
    /// Along this.
    pub ring: Rect,
    /// Links are means over bins of this size, metres.
    pub bin_m: f64,
}

/// Where persons are sought.
#[derive(Clone, Copy, Debug)]
pub(super) struct SearchedGround<'a> {
    pub area: Rect,
    /// How the ends of the links were driven; `None` = they are fixed.
    pub driven: Option<Driven>,
    /// The image of the empty sweep, if there is one: what is solid there is nobody.
    pub structure: Option<&'a Image>,
}

/// Everything that a search needs.
struct Search<'a> {
    structure: Option<&'a Image>,
    evidence: Evidence<'a>,
    correlation: Correlation,
    rate: FalseRate,
    threshold: f64,
}

/// A target with what it gains, and that divided by how much the noise goes together, less by what stood at its place before.
#[derive(Clone, Copy)]
struct Judged {
    target: Target,
    gain: f64,
    evidence: f64,
}

/// Finds persons by calibrated links. They are sought only within what the links enclose, however large the area is: beyond
/// it no link says anything, and the mean of what links say would be that of places where they say nothing. `None` when
/// there is no place to search, no link, or nothing that tells one place from another.
pub(super) fn find_persons(
    observations: &[Observation],
    SearchedGround {
        area,
        driven,
        structure,
    }: SearchedGround<'_>,
    settings: &FindSettings,
) -> Option<Finds> {
    let person = settings.person;
    let enclosed = Rect::around(observations.iter().flat_map(|one| [one.from, one.to]))?;
    // Nobody stands nearer to the border, or to the outermost ends of links, than he is wide.
    let inner = area
        .shrunk(settings.rim_m.max(person.radius_m))
        .common_with(enclosed.shrunk(person.radius_m))?;
    let reachable = area.shrunk(person.radius_m).common_with(enclosed)?;
    let smear_m = driven.map_or(0.0, |driven| driven.bin_m / 12f64.sqrt());
    let ring = driven.map_or(area, |driven| driven.ring);
    let links = observations
        .iter()
        .map(|one| person.link(one.from, one.to, ring, smear_m))
        .collect();
    let evidence = Evidence::new(observations, links, reachable, settings);
    let rate = FalseRate::new(&evidence, inner)?;
    let mut search = Search {
        structure,
        threshold: rate.gain_for(settings.false_per_image),
        rate,
        correlation: Correlation::new(observations, driven),
        evidence,
    };
    let (kept, lost, beyond) = search.run(inner);
    let (found, vague) = search
        .finds(&kept)
        .into_iter()
        .partition::<Vec<Find>, _>(|find| settings.locates(find.covariance_m2));
    Some(Finds {
        found,
        next: vague
            .first()
            .copied()
            .or_else(|| search.strongest(&lost))
            .or_else(|| search.one_more(&kept, beyond?)),
        threshold: search.threshold,
        false_per_image: settings.false_per_image,
    })
}

impl Search<'_> {
    /// Returns the targets that pass, those that do not, and the best place of those that were not added.
    fn run(&mut self, inner: Rect) -> (Vec<Judged>, Vec<Judged>, Option<Target>) {
        let (targets, beyond) = self.added(inner);
        let first = self.gains(&targets);
        self.evidence
            .scale_noise(&targets_above(&first, STRONG_GAIN));
        let again: Vec<Target> = first.iter().map(|one| one.target).collect();
        let mut kept = self.gains(&again);
        self.learn_correlation(&targets_above(&kept, SURE_GAIN));
        self.weigh(&mut kept);
        let passing: Vec<Target> = kept
            .iter()
            .filter(|one| one.evidence >= self.threshold)
            .map(|one| one.target)
            .collect();
        self.learn_correlation(&passing);
        self.weigh(&mut kept);
        let mut lost = Vec::new();
        while let Some(weakest) = weakest(&kept).filter(|k| kept[*k].evidence < self.threshold) {
            lost.push(kept.remove(weakest));
            let rest: Vec<Target> = kept.iter().map(|one| one.target).collect();
            kept = self.gains(&rest);
            self.weigh(&mut kept);
        }
        kept.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        (kept, lost, beyond)
    }

    /// Adds persons one by one, each refined with all before it, while each gains enough; returns the best place that did not,
    /// too.
    fn added(&self, inner: Rect) -> (Vec<Target>, Option<Target>) {
        let evidence = &self.evidence;
        let pitch_m = places_apart_m(evidence.settings, inner, evidence.links.len());
        let places = Places::new(evidence, inner, pitch_m);
        let least_gain = LEAST_GAIN.min(self.threshold);
        let mut targets = Vec::new();
        let mut loss = evidence.loss(&targets);
        while targets.len() < MOST {
            let candidates = places.candidates(evidence, &targets, CANDIDATE_SHARE * least_gain);
            let refined = candidates.into_iter().map(|candidate| {
                let mut with = targets.clone();
                with.push(candidate);
                evidence.refined(&with)
            });
            let best = refined.reduce(|best, next| if next.1 < best.1 { next } else { best });
            match best {
                Some((with, with_loss)) if loss - with_loss >= least_gain => {
                    (targets, loss) = (with, with_loss);
                }
                best => return (targets, best.and_then(|(with, _)| with.last().copied())),
            }
        }
        (targets, None)
    }

    /// Returns a place that was not added, judged beside those that were.
    fn one_more(&self, kept: &[Judged], beyond: Target) -> Option<Find> {
        let before: Vec<Target> = kept.iter().map(|one| one.target).collect();
        let (with, loss) = self.evidence.refined(&[&before[..], &[beyond]].concat());
        let gain = self.evidence.loss(&before) - loss;
        let mut judged = [Judged {
            target: *with.last()?,
            gain,
            evidence: gain,
        }];
        self.weigh(&mut judged);
        self.strongest(&judged).filter(|_| gain > 0.0)
    }

    /// Refines targets together, and says what each of them gains: the others are refined without it.
    fn gains(&self, targets: &[Target]) -> Vec<Judged> {
        let (refined, loss) = self.evidence.refined(targets);
        let gain = |k: usize| {
            let mut without = refined.clone();
            without.remove(k);
            self.evidence.refined(&without).1 - loss
        };
        refined
            .iter()
            .enumerate()
            .map(|(k, target)| {
                let gain = gain(k);
                Judged {
                    target: *target,
                    gain,
                    evidence: gain,
                }
            })
            .collect()
    }

    fn learn_correlation(&mut self, known: &[Target]) {
        let residual_db = self.evidence.residual_db(known);
        let scaled = residual_db.iter().zip(&self.evidence.sd_db);
        let residuals: Vec<f64> = scaled.map(|(rest_db, sd_db)| rest_db / sd_db).collect();
        self.correlation.learn(&residuals);
    }

    /// Divides gains by how much the noise goes together, and adds the logarithm of how likely a place is for what stood there.
    fn weigh(&self, judged: &mut [Judged]) {
        for one in judged {
            let chords_m = self.evidence.chords_m(one.target.at);
            let scaled = chords_m.iter().zip(&self.evidence.sd_db);
            let u: Vec<f64> = scaled.map(|(chord_m, sd_db)| chord_m / sd_db).collect();
            let room = self
                .structure
                .map_or(1.0, |structure| room_at(structure, one.target.at));
            let evidence = one.gain / self.correlation.overdispersion(&u) + 2.0 * libm::log(room);
            one.evidence = evidence.max(0.0);
        }
    }

    fn strongest(&self, lost: &[Judged]) -> Option<Find> {
        let strongest = lost
            .iter()
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence))?;
        self.finds(&[*strongest]).pop()
    }

    /// Returns the targets with the covariances of their places ([`place`]), all together; by the curvature these are
    /// F⁻¹ (U (1 + R) Uᵀ + prior) F⁻¹ with U = J √w̄, F = U Uᵀ + prior, w̄ = (ν + 1) / (ν + 3) / (κ v), and F⁻¹ without R.
    fn finds(&self, judged: &[Judged]) -> Vec<Find> {
        let targets: Vec<Target> = judged.iter().map(|one| one.target).collect();
        let Derivatives(mut rows) = self.evidence.derivatives(&targets);
        let information = ((DEGREES + 1.0) / (DEGREES + 3.0)).sqrt();
        let are_telling = self.evidence.are_telling(&targets);
        let sd_db = self.evidence.sd_db.iter();
        let scales: Vec<f64> = sd_db
            .zip(are_telling)
            .map(|(sd_db, is_telling)| if is_telling { information / sd_db } else { 0.0 })
            .collect();
        for row in &mut rows {
            row.iter_mut()
                .zip(&scales)
                .for_each(|(value, scale)| *value *= scale);
        }
        let prior = |i: usize, j: usize| match i == j && i % 3 == 2 {
            true => self.evidence.prior_curvature(targets[i / 3].strength),
            false => 0.0,
        };
        let inner = |i: usize, j: usize| dot(&rows[i], &rows[j]) + prior(i, j);
        let factor = Cholesky::of(rows.len(), inner);
        let spread: Vec<Vec<f64>> = (0..rows.len())
            .map(|i| {
                let together =
                    |j: usize| inner(i, j) + self.correlation.product(&rows[i], &rows[j]);
                (0..rows.len()).map(together).collect()
            })
            .collect();
        let nowhere_m2 = self.evidence.area.width_m() * self.evidence.area.height_m();
        let covariance_m2 = |k: usize| {
            let Some(factor) = &factor else {
                return [nowhere_m2, 0.0, nowhere_m2];
            };
            let column = |index: usize| {
                let mut unit = vec![0.0; rows.len()];
                unit[index] = 1.0;
                factor.solve(&mut unit);
                unit
            };
            let (x, y) = (column(3 * k), column(3 * k + 1));
            let spread_by = |left: &[f64], right: &[f64]| {
                let turned: Vec<f64> = spread.iter().map(|line| dot(line, right)).collect();
                dot(left, &turned)
            };
            let curvature = [spread_by(&x, &x), spread_by(&x, &y), spread_by(&y, &y)];
            let independent = [x[3 * k], x[3 * k + 1], y[3 * k + 1]];
            // Of a place that no link tells there is nothing to follow.
            match self.evidence.settings.locates(curvature) {
                true => place::covariance(&self.evidence, &targets, k, curvature, independent),
                false => None,
            }
            .unwrap_or(curvature)
        };
        judged
            .iter()
            .enumerate()
            .map(|(k, one)| Find {
                at: one.target.at,
                strength: one.target.strength,
                covariance_m2: covariance_m2(k),
                evidence: one.evidence,
                probability: libm::exp(-self.rate.expected(one.evidence)),
            })
            .collect()
    }
}

/// Returns how far apart places are searched, metres: as is wanted, and farther where that would take too much memory.
fn places_apart_m(settings: &FindSettings, inner: Rect, links: usize) -> f64 {
    let most = MOST_PLACES.min(MOST_PAIRS / links.max(1) as f64);
    let finest_m = (inner.width_m() * inner.height_m() / most).sqrt();
    settings.pitch_m.max(finest_m)
}

fn larger_deviation_m([xx, _, yy]: [f64; 3]) -> f64 {
    xx.max(yy).max(0.0).sqrt()
}

fn targets_above(judged: &[Judged], gain: f64) -> Vec<Target> {
    let strong = judged.iter().filter(|one| one.gain >= gain);
    strong.map(|one| one.target).collect()
}

/// Returns the target with the weakest evidence.
fn weakest(judged: &[Judged]) -> Option<usize> {
    (0..judged.len()).min_by(|a, b| judged[*a].evidence.total_cmp(&judged[*b].evidence))
}

#[cfg(test)]
mod tests;
