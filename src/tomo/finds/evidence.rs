//! How well persons at some places explain what the links say: the likelihood, and the places and strengths that make it
//! greatest.
//!
//! ```text
//!   z_l  = (y_l − Σ_k a_k t_l(p_k)) / √(κ v_l)          ρ(z²) = (ν + 1)/2 · ln(1 + z²/ν)          ν = 4
//!   loss = Σ_l ρ(z_l²) + Σ_k ½ (ln(a_k / a₀) / s)²
//! ```
//!
//! A link at its receiver's floor says *at least y*: where persons explain more, it is explained, z = 0.
//!
//! y = attenuation of a link, v its variance, t its chord of a person ([`crate::tomo::person`]), a = strength. κ makes up for
//! variances that are wrong all together; it is found with the persons known.

use crate::geom::{Point, Rect};
use crate::tomo::calibrate::unexplained_db;
use crate::tomo::cholesky::Cholesky;
use crate::tomo::person::PersonLink;
use crate::tomo::student::{self, DEGREES};
use crate::tomo::{FindSettings, Observation};

/// Rounds of the refinement, and tries to take a step in one.
const ROUNDS: usize = 12;
const TRIES: usize = 5;
/// The longest step of a place, radii of a person, and when a step is small enough, metres and dB/m.
const LONGEST_STEP: f64 = 1.0;
const SMALLEST_STEP: f64 = 1e-3;
/// Half the step of the derivatives by place, radii of a person.
const HALF_STEP: f64 = 0.07;
/// Strengths lie within these shares of the expected one.
pub(super) const STRENGTHS: (f64, f64) = (0.04, 5.0);
/// Products are taken of so many terms before the logarithm, each of them below a million.
const TERMS: usize = 32;

/// A person who may stand there.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Target {
    pub at: Point,
    /// dB/m.
    pub strength: f64,
}

/// What the links say.
pub(super) struct Evidence<'a> {
    pub settings: &'a FindSettings,
    /// Places lie within it.
    pub area: Rect,
    pub links: Vec<PersonLink>,
    pub attenuation_db: Vec<f64>,
    variance_db2: Vec<f64>,
    /// Whether a link loses this or more.
    is_at_floor: Vec<bool>,
    /// √(κ v), dB.
    pub sd_db: Vec<f64>,
}

/// How the expectation of every link changes with all unknowns, three a target: x, y, strength.
pub(super) struct Derivatives(pub Vec<Vec<f64>>);

/// A link near a target, with the derivatives of its expectation by x, y and strength of that.
#[derive(Clone, Copy)]
struct Touched {
    link: usize,
    slopes: [f64; 3],
}

impl Touched {
    fn scaled(&self, factor: f64) -> Touched {
        Touched {
            slopes: self.slopes.map(|slope| slope * factor),
            ..*self
        }
    }
}

/// Returns the sums of products of derivatives over the links that are near both targets.
fn products(one: &[Touched], other: &[Touched]) -> [[f64; 3]; 3] {
    let mut sums = [[0.0; 3]; 3];
    let mut rest = other.iter().peekable();
    for a in one {
        while rest.next_if(|b| b.link < a.link).is_some() {}
        let Some(b) = rest.next_if(|b| b.link == a.link) else {
            continue;
        };
        for (line, slope) in sums.iter_mut().zip(a.slopes) {
            for (sum, with) in line.iter_mut().zip(b.slopes) {
                *sum += slope * with;
            }
        }
    }
    sums
}

impl<'a> Evidence<'a> {
    pub(super) fn new(
        observations: &[Observation],
        links: Vec<PersonLink>,
        area: Rect,
        settings: &'a FindSettings,
    ) -> Evidence<'a> {
        let mut evidence = Evidence {
            settings,
            area,
            links,
            attenuation_db: observations.iter().map(|one| one.attenuation_db).collect(),
            variance_db2: observations.iter().map(|one| one.variance_db2).collect(),
            is_at_floor: observations.iter().map(|one| one.is_at_floor).collect(),
            sd_db: Vec::new(),
        };
        evidence.scale_noise(&[]);
        evidence
    }

    /// Finds κ with some targets taken out.
    pub(super) fn scale_noise(&mut self, targets: &[Target]) {
        let residual_db = self.residual_db(targets);
        let links = residual_db.iter().zip(&self.variance_db2).enumerate();
        let squares: Vec<f64> = links
            .filter(|(link, (rest_db, _))| self.is_telling(*link, **rest_db))
            .map(|(_, (rest_db, variance_db2))| rest_db * rest_db / variance_db2)
            .collect();
        let kappa = student::most_probable_scale(&squares);
        self.sd_db = self
            .variance_db2
            .iter()
            .map(|variance_db2| (variance_db2 * kappa).sqrt())
            .collect();
    }

    /// Returns the chord of each link of a person at a place, metres.
    pub(super) fn chords_m(&self, at: Point) -> Vec<f64> {
        let person = &self.settings.person;
        self.links
            .iter()
            .map(|link| person.chord_m(link, at))
            .collect()
    }

    /// Returns what the targets do not explain, dB.
    pub(super) fn residual_db(&self, targets: &[Target]) -> Vec<f64> {
        let mut residual_db = self.attenuation_db.clone();
        for target in targets {
            for (rest_db, link) in residual_db.iter_mut().zip(&self.links) {
                *rest_db -= target.strength * self.settings.person.chord_m(link, target.at);
            }
        }
        for (link, rest_db) in residual_db.iter_mut().enumerate() {
            *rest_db = self.left_db(link, *rest_db);
        }
        residual_db
    }

    /// Returns what is left of a link, from its attenuation less what persons take: nothing where it is at the floor and they
    /// take more than it could show.
    pub(super) fn left_db(&self, link: usize, rest_db: f64) -> f64 {
        unexplained_db(rest_db, self.is_at_floor[link])
    }

    /// Returns which links say how much the targets take: all but those at the floor that the targets explain.
    pub(super) fn are_telling(&self, targets: &[Target]) -> Vec<bool> {
        let residual_db = self.residual_db(targets).into_iter().enumerate();
        residual_db
            .map(|(link, rest_db)| self.is_telling(link, rest_db))
            .collect()
    }

    fn is_telling(&self, link: usize, rest_db: f64) -> bool {
        !self.is_at_floor[link] || rest_db > 0.0
    }

    /// Returns the loss: minus the logarithm of the likelihood with the prior, but for a constant.
    pub(super) fn loss(&self, targets: &[Target]) -> f64 {
        let ratios = self
            .residual_db(targets)
            .into_iter()
            .zip(&self.sd_db)
            .map(|(rest_db, sd_db)| 1.0 + rest_db * rest_db / (sd_db * sd_db) / DEGREES);
        let prior: f64 = targets
            .iter()
            .map(|target| self.penalty(target.strength))
            .sum();
        (DEGREES + 1.0) / 2.0 * sum_of_logarithms(ratios) + prior
    }

    /// Returns the loss of a strength by its prior.
    pub(super) fn penalty(&self, strength: f64) -> f64 {
        let settings = self.settings;
        let off = libm::log(strength / settings.strength_db_per_m) / settings.strength_log_sd;
        0.5 * off * off
    }

    /// Returns the derivatives at some targets.
    pub(super) fn derivatives(&self, targets: &[Target]) -> Derivatives {
        let half_m = HALF_STEP * self.settings.person.radius_m;
        let mut rows = Vec::with_capacity(3 * targets.len());
        for target in targets {
            for (x_m, y_m) in [(half_m, 0.0), (0.0, half_m)] {
                let beside = |sign: f64| {
                    let at = Point::new(target.at.x_m + sign * x_m, target.at.y_m + sign * y_m);
                    self.chords_m(at)
                };
                let slope = target.strength / (2.0 * half_m);
                let steps = beside(1.0).into_iter().zip(beside(-1.0));
                rows.push(steps.map(|(more, less)| slope * (more - less)).collect());
            }
            rows.push(self.chords_m(target.at));
        }
        Derivatives(rows)
    }

    /// Returns the second derivative of a strength's prior.
    pub(super) fn prior_curvature(&self, strength: f64) -> f64 {
        let sd = strength * self.settings.strength_log_sd;
        1.0 / (sd * sd)
    }

    /// Improves all targets together, by Levenberg and Marquardt; returns them with their loss.
    pub(super) fn refined(&self, targets: &[Target]) -> (Vec<Target>, f64) {
        let mut best = targets.to_vec();
        let mut loss = self.loss(&best);
        let mut damping = 1e-2;
        for _ in 0..ROUNDS {
            if best.is_empty() {
                break;
            }
            let (gradient, curvature) = self.normal_equations(&best);
            let mut moved = None;
            for _ in 0..TRIES {
                let damped = Cholesky::of(gradient.len(), |i, j| {
                    let more = if i == j {
                        damping * (curvature[i][j] + 1e-9)
                    } else {
                        0.0
                    };
                    curvature[i][j] + more
                });
                let next = damped.map(|factor| {
                    let mut step = gradient.clone();
                    factor.solve(&mut step);
                    self.stepped(&best, &step)
                });
                if let Some(next) = next {
                    let next_loss = self.loss(&next);
                    if next_loss < loss {
                        moved = Some(longest_move(&best, &next));
                        (best, loss) = (next, next_loss);
                        damping = f64::max(damping / 5.0, 1e-6);
                        break;
                    }
                }
                damping *= 8.0;
            }
            if moved.is_none_or(|moved| moved < SMALLEST_STEP) {
                break;
            }
        }
        (best, loss)
    }

    /// Returns minus the gradient of the loss, and its curvature (Gauss–Newton with the weights of the noise).
    fn normal_equations(&self, targets: &[Target]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let touched: Vec<Vec<Touched>> = targets.iter().map(|one| self.touched(one)).collect();
        let mut residual_db = self.attenuation_db.clone();
        for (target, touched) in targets.iter().zip(&touched) {
            for one in touched {
                residual_db[one.link] -= target.strength * one.slopes[2];
            }
        }
        let mut gradient = Vec::with_capacity(3 * targets.len());
        let mut curvature: Vec<Vec<f64>> = Vec::with_capacity(3 * targets.len());
        for (k, own) in touched.iter().enumerate() {
            let weighted: Vec<Touched> = own
                .iter()
                .map(|one| one.scaled(self.weight(one.link, residual_db[one.link])))
                .collect();
            let mut slopes = [0.0; 3];
            for one in &weighted {
                for (sum, slope) in slopes.iter_mut().zip(one.slopes) {
                    *sum += slope * residual_db[one.link];
                }
            }
            gradient.extend(slopes);
            let mut lines = [const { Vec::new() }; 3];
            for other in &touched[..=k] {
                for (line, entries) in lines.iter_mut().zip(products(&weighted, other)) {
                    line.extend(entries);
                }
            }
            for (i, line) in lines.iter_mut().enumerate() {
                line.truncate(3 * k + i + 1);
            }
            curvature.extend(lines);
        }
        let settings = self.settings;
        for (k, target) in targets.iter().enumerate() {
            let i = 3 * k + 2;
            let off = libm::log(target.strength / settings.strength_db_per_m);
            let sd = settings.strength_log_sd;
            gradient[i] -= off / (sd * sd) / target.strength;
            curvature[i][i] += self.prior_curvature(target.strength);
        }
        (gradient, curvature)
    }

    /// Returns how much a link counts, with its attenuation less what persons take.
    fn weight(&self, link: usize, rest_db: f64) -> f64 {
        if !self.is_telling(link, rest_db) {
            return 0.0;
        }
        let sd_db = self.sd_db[link];
        let z = rest_db / sd_db;
        student::trust(z * z, DEGREES) / (sd_db * sd_db)
    }

    /// Returns the links that a target touches, or would beside its place, with the derivatives of [`Self::derivatives`].
    fn touched(&self, target: &Target) -> Vec<Touched> {
        let person = &self.settings.person;
        let half_m = HALF_STEP * person.radius_m;
        let slope = target.strength / (2.0 * half_m);
        let at = |x_m: f64, y_m: f64| Point::new(target.at.x_m + x_m, target.at.y_m + y_m);
        let beside = [
            [at(half_m, 0.0), at(-half_m, 0.0)],
            [at(0.0, half_m), at(0.0, -half_m)],
        ];
        let links = self.links.iter().enumerate();
        links
            .filter(|(_, link)| link.is_within_reach(target.at, 2.0 * half_m))
            .map(|(index, link)| {
                let of = |[more, less]: [Point; 2]| {
                    slope * (person.chord_m(link, more) - person.chord_m(link, less))
                };
                let [x, y] = beside.map(of);
                Touched {
                    link: index,
                    slopes: [x, y, person.chord_m(link, target.at)],
                }
            })
            .collect()
    }

    fn stepped(&self, targets: &[Target], step: &[f64]) -> Vec<Target> {
        let longest_m = step.chunks_exact(3).fold(1e-9, |longest_m: f64, of| {
            longest_m.max(of[0].abs()).max(of[1].abs())
        });
        let share = (LONGEST_STEP * self.settings.person.radius_m / longest_m).min(1.0);
        let expected = self.settings.strength_db_per_m;
        let (least, most) = (STRENGTHS.0 * expected, STRENGTHS.1 * expected);
        let inside = |at: Point| {
            Point::new(
                at.x_m.clamp(self.area.min.x_m, self.area.max.x_m),
                at.y_m.clamp(self.area.min.y_m, self.area.max.y_m),
            )
        };
        targets
            .iter()
            .zip(step.chunks_exact(3))
            .map(|(target, of)| Target {
                at: inside(Point::new(
                    target.at.x_m + share * of[0],
                    target.at.y_m + share * of[1],
                )),
                strength: (target.strength + share * of[2]).clamp(least, most),
            })
            .collect()
    }
}

/// Returns how far the unknowns have moved at most.
fn longest_move(from: &[Target], to: &[Target]) -> f64 {
    let of = |(a, b): (&Target, &Target)| {
        let off = b.at - a.at;
        off.x_m
            .abs()
            .max(off.y_m.abs())
            .max((b.strength - a.strength).abs())
    };
    from.iter().zip(to).map(of).fold(0.0, f64::max)
}

/// Returns the sum of the logarithms of terms of at least 1.
pub(super) fn sum_of_logarithms(terms: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut product, mut count) = (0.0, 1.0, 0);
    for term in terms {
        product *= term;
        count += 1;
        if count == TERMS || product > 1e200 {
            sum += libm::log(product);
            (product, count) = (1.0, 0);
        }
    }
    sum + libm::log(product)
}
