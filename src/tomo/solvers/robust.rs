//! What the solvers of non-negative images share: links that may be wild, saturate, or show a least value only become a few
//! linear problems, one after the other.
//!
//! ```text
//!   Σ_l ρ((y_l − shown((W x)_l) − (H b)_l)² / (κ v_l)) + penalty(x)        ρ(q) = (ν + 1)/2 · ln(1 + q/ν), ν = 4
//! ```
//!
//! Each round linearises `shown` at the last image and weighs the links by their residuals; κ, which makes up for variances
//! that are wrong all together, and b, the unknowns of the path loss, are found in between. A link at the receiver's floor
//! counts only while the image explains less than it shows.

use super::LinkProblem;
use super::response::shown;
use crate::tomo::calibrate::unexplained_db;
use crate::tomo::cholesky::{Cholesky, dot};
use crate::tomo::progress::ImagingStep;
use crate::tomo::student::{self, DEGREES};

/// κ is no less: links that are cleaner than they are said to be would otherwise make the few behind an obstacle wild.
const LEAST_NOISE_SCALE: f64 = 0.25;

/// Linear problems, a lane for each: least of ½ Σ_l (scale_l (W x)_l − data_l)² and the solver's penalty.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Linearised<const LANES: usize> {
    /// What a row of the weights is multiplied by: slope of what is shown over the deviation, 1/dB; 0 for a link left out.
    pub scale: Vec<[f64; LANES]>,
    /// Attenuation over the deviation.
    pub data: Vec<[f64; LANES]>,
}

/// What is known of the links besides the image.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct LinkState {
    /// What the image explains on the straight way, dB.
    pub straight_db: Vec<f64>,
    /// H b, dB.
    pub offset_db: Vec<f64>,
    /// b.
    pub nuisance: Vec<f64>,
    /// κ.
    pub noise_scale: f64,
}

impl LinkState {
    /// Returns the state of an image without attenuation.
    pub(super) fn new(problem: &LinkProblem<'_>) -> LinkState {
        let links = problem.observations.len();
        LinkState {
            straight_db: vec![0.0; links],
            offset_db: vec![0.0; links],
            nuisance: vec![0.0; problem.nuisance.len()],
            noise_scale: 1.0,
        }
    }

    /// Returns what each link shows beyond image and path loss, dB.
    pub(super) fn residual_db(&self, problem: &LinkProblem<'_>) -> Vec<f64> {
        let links = problem.observations.iter().enumerate();
        links
            .map(|(l, link)| {
                let explained_db = shown(self.straight_db[l]).attenuation_db + self.offset_db[l];
                unexplained_db(link.attenuation_db - explained_db, link.is_at_floor)
            })
            .collect()
    }
}

/// Solves in rounds, several images at once, a lane for each, with the links that are `used` in it. `improve` brings the images
/// nearer to the least of linear problems with their penalty.
pub(super) fn solve_robustly<const LANES: usize>(
    problem: &LinkProblem<'_>,
    used: &[Vec<bool>; LANES],
    rounds: usize,
    images: &mut [[f64; LANES]],
    mut improve: impl FnMut(&Linearised<LANES>, &mut [[f64; LANES]]),
) -> [LinkState; LANES] {
    let mut states: [LinkState; LANES] = std::array::from_fn(|_| LinkState::new(problem));
    explain(problem, images, &mut states);
    let links = problem.observations.len();
    let mut linearised = Linearised {
        scale: vec![[0.0; LANES]; links],
        data: vec![[0.0; LANES]; links],
    };
    for round in 0..rounds {
        problem.watch.tell(ImagingStep::Solving {
            done: round,
            of: rounds,
        });
        for (lane, (state, used)) in states.iter_mut().zip(used).enumerate() {
            let residual_db = state.residual_db(problem);
            let trust = if round == 0 {
                vec![1.0; residual_db.len()]
            } else {
                state.noise_scale = noise_scale(problem, used, &residual_db, state.noise_scale);
                trust(problem, &residual_db, state.noise_scale)
            };
            state.fit_nuisance(problem, used, &residual_db, &trust);
            for (l, (scale, data)) in state.linearised(problem, used, &trust).enumerate() {
                (linearised.scale[l][lane], linearised.data[l][lane]) = (scale, data);
            }
        }
        improve(&linearised, images);
        explain(problem, images, &mut states);
    }
    for (state, used) in states.iter_mut().zip(used) {
        let residual_db = state.residual_db(problem);
        state.noise_scale = noise_scale(problem, used, &residual_db, state.noise_scale);
    }
    states
}

/// Notes what images explain on the straight ways.
fn explain<const LANES: usize>(
    problem: &LinkProblem<'_>,
    images: &[[f64; LANES]],
    states: &mut [LinkState; LANES],
) {
    problem.projector.forward_lanes(images, |l, straight_db| {
        for lane in 0..LANES {
            states[lane].straight_db[l] = straight_db[lane];
        }
    });
}

impl LinkState {
    /// Returns the variance with which each link tells the attenuation on its straight way, dB²: by κ and its trust, and the
    /// larger the less is shown of one more decibel. A link at the receiver's floor that explains no more than it shows, and one
    /// behind which nothing is seen, tells nothing (infinite).
    pub(super) fn noise_db2(&self, problem: &LinkProblem<'_>) -> Vec<f64> {
        let residual_db = self.residual_db(problem);
        let trust = trust(problem, &residual_db, self.noise_scale);
        let used = vec![true; residual_db.len()];
        let links = self.linearised(problem, &used, &trust);
        links.map(|(scale, _)| 1.0 / (scale * scale)).collect()
    }

    /// Returns scale and data of each link ([`Linearised`]).
    fn linearised(
        &self,
        problem: &LinkProblem<'_>,
        used: &[bool],
        trust: &[f64],
    ) -> impl Iterator<Item = (f64, f64)> {
        let residual_db = self.residual_db(problem);
        let links = problem.observations.iter().enumerate();
        links.map(move |(l, link)| {
            let is_hidden = link.is_at_floor && residual_db[l] <= 0.0;
            if !used[l] || is_hidden {
                return (0.0, 0.0);
            }
            let slope = shown(self.straight_db[l]).slope;
            let per_db = (trust[l] / (link.variance_db2 * self.noise_scale)).sqrt();
            let data_db = residual_db[l] + slope * self.straight_db[l];
            (slope * per_db, data_db * per_db)
        })
    }

    /// Moves b to its most probable value with the image as it is.
    fn fit_nuisance(
        &mut self,
        problem: &LinkProblem<'_>,
        used: &[bool],
        residual_db: &[f64],
        trust: &[f64],
    ) {
        let columns = problem.nuisance;
        if columns.is_empty() {
            return;
        }
        let links = problem.observations.iter().enumerate();
        let precision: Vec<f64> = links
            .map(|(l, link)| {
                let is_counted = used[l] && !link.is_at_floor;
                f64::from(u8::from(is_counted)) * trust[l] / (link.variance_db2 * self.noise_scale)
            })
            .collect();
        let weighted = |column: &[f64]| -> Vec<f64> {
            column
                .iter()
                .zip(&precision)
                .map(|(of, p)| of * p)
                .collect()
        };
        let entry = |i: usize, j: usize| {
            let prior = f64::from(u8::from(i == j)) / columns[i].variance.max(1e-12);
            dot(&weighted(&columns[i].column), &columns[j].column) + prior
        };
        let mut step: Vec<f64> = columns
            .iter()
            .zip(&self.nuisance)
            .map(|(column, known)| {
                dot(&weighted(&column.column), residual_db) - known / column.variance.max(1e-12)
            })
            .collect();
        let Some(factor) = Cholesky::of(columns.len(), entry) else {
            return;
        };
        factor.solve(&mut step);
        for (k, column) in columns.iter().enumerate() {
            self.nuisance[k] += step[k];
            self.offset_db
                .iter_mut()
                .zip(&column.column)
                .for_each(|(offset_db, of)| *offset_db += step[k] * of);
        }
    }
}

/// Returns κ of the links that are used, from a start.
pub(super) fn noise_scale(
    problem: &LinkProblem<'_>,
    used: &[bool],
    residual_db: &[f64],
    start: f64,
) -> f64 {
    let squares: Vec<f64> = problem
        .observations
        .iter()
        .zip(residual_db)
        .zip(used)
        .filter(|((link, _), used)| **used && !link.is_at_floor)
        .map(|((link, residual_db), _)| residual_db * residual_db / link.variance_db2)
        .collect();
    student::noise_scale(&squares, start, LEAST_NOISE_SCALE)
}

fn trust(problem: &LinkProblem<'_>, residual_db: &[f64], noise_scale: f64) -> Vec<f64> {
    let links = problem.observations.iter().zip(residual_db);
    links
        .map(|(link, residual_db)| {
            let square = residual_db * residual_db / (noise_scale * link.variance_db2);
            student::trust(square, DEGREES)
        })
        .collect()
}
