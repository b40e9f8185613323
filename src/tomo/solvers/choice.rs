//! Which image predicts best the links that it was not told.
//!
//! The links are dealt into five parts; each candidate is solved five times without one of them, and scored by the
//! Student-t likelihood of the part left out, κ fitted over all parts. Persons are found once, from all links: for each of
//! their three numbers the likelihood is better by about one than if they had been found anew, and is lowered by that
//! (Akaike). The best wins; of total variations a weaker one, and in a change persons, win already when they are behind by
//! less than the standard error of that. Where all that stands is imaged, a wall can be told by a few discs, too: there
//! persons win only when they are ahead of every other by twice that error.

use serde::{Deserialize, Serialize};

use super::robust::{LinkState, noise_scale};
use super::total_variation::{PrimalDual, Variation};
use super::{Effort, LinkProblem, Persons, Sparse, descend, vary};
use crate::tomo::progress::{ImagingStep, Watch};
use crate::tomo::student::DEGREES;

/// Parts of the links.
const FOLDS: usize = 5;
/// Unknowns of a person.
const UNKNOWNS: usize = 3;
/// Standard errors by which somebody unexpected must be ahead.
const CLEARLY: f64 = 2.0;
/// For the first image of a part, and for those that start from a similar one.
const FIRST: Effort = Effort {
    rounds: 4,
    steps: 30,
};
const NEXT: Effort = Effort {
    rounds: 2,
    steps: 25,
};
/// For the images that are not of total variation.
const SPARSE: Effort = Effort {
    rounds: 3,
    steps: 25,
};

/// What is chosen from.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum Candidate {
    /// Those who were found, drawn over what is left.
    Points,
    /// The non-negative image under a smooth prior.
    NonNegative,
    /// Total variation with these weights.
    Variation(Variation),
}

/// How well a candidate predicts.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Score {
    /// Of whom.
    pub candidate: Candidate,
    /// Mean logarithm of the likelihood of a link that it was not told.
    pub likelihood: f64,
    /// How far that is behind the best one, and the standard error of this.
    pub behind: f64,
    /// See `behind`.
    pub behind_sd: f64,
}

/// A choice with its reasons.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Choice {
    /// Who was chosen.
    pub best: Candidate,
    /// All candidates, the preferred ones first.
    pub scores: Vec<Score>,
}

impl Candidate {
    /// Returns its name, with what tells it from others of its kind.
    pub fn words(&self) -> String {
        match self {
            Candidate::Points => "points".to_owned(),
            Candidate::NonNegative => "nn".to_owned(),
            Candidate::Variation(of) => format!("tv {}", (of.weight * 1e3).round() / 1e3),
        }
    }
}

impl Choice {
    /// Returns in one line who was chosen and how far the others are behind.
    pub fn words(&self) -> String {
        let others = self
            .scores
            .iter()
            .filter(|score| score.candidate != self.best);
        let other = |score: &Score| {
            format!(
                "{} {:.4} ± {:.4}",
                score.candidate.words(),
                score.behind,
                score.behind_sd
            )
        };
        let others: Vec<String> = others.map(other).collect();
        let own = self
            .scores
            .iter()
            .find(|score| score.candidate == self.best && score.behind > 0.0);
        let own = own.map_or(String::new(), |score| {
            let (behind, sd) = (score.behind, score.behind_sd);
            format!(" (itself {behind:.4} ± {sd:.4}, and preferred so near)")
        });
        format!(
            "solver: {}{own}, by the likelihood of links that it was not told; behind the best by (a link): {}",
            self.best.words(),
            others.join(", ")
        )
    }
}

/// Chooses from a list, in which weights of the total variation go up.
pub(super) fn choose(
    problem: &LinkProblem<'_>,
    sparse: Sparse,
    list: &[Candidate],
    persons: Option<&Persons>,
) -> Choice {
    let likelihoods: Vec<Vec<f64>> = untold_residuals_db(problem, sparse, list, persons)
        .iter()
        .zip(list)
        .map(|(residual_db, candidate)| {
            let unknowns = match (candidate, persons) {
                (Candidate::Points, Some(persons)) => UNKNOWNS * persons.found.len(),
                (Candidate::Points | Candidate::NonNegative | Candidate::Variation(_), _) => 0,
            };
            likelihoods(problem, residual_db, unknowns)
        })
        .collect();
    let means: Vec<f64> = likelihoods.iter().map(|of| mean(of)).collect();
    let highest = (0..means.len())
        .max_by(|a, b| means[*a].total_cmp(&means[*b]).then(b.cmp(a)))
        .unwrap_or(0);
    let scores_against = |reference: usize| -> Vec<Score> {
        let score = |k: usize| {
            let (behind, behind_sd) = behind(&likelihoods[reference], &likelihoods[k]);
            Score {
                candidate: list[k],
                likelihood: means[k],
                behind,
                behind_sd,
            }
        };
        (0..means.len()).map(score).collect()
    };
    let are_expected = persons.is_some_and(|persons| persons.are_expected);
    Choice {
        best: preferred(&scores_against, highest, are_expected),
        scores: scores_against(highest),
    }
}

/// Returns how far one is behind another on the mean, and the standard error of that.
fn behind(ahead: &[f64], own: &[f64]) -> (f64, f64) {
    let steps: Vec<f64> = ahead.iter().zip(own).map(|(a, b)| a - b).collect();
    let behind = mean(&steps);
    let squares = steps.iter().map(|step| (step - behind) * (step - behind));
    (
        behind,
        squares.sum::<f64>().sqrt() / steps.len().max(1) as f64,
    )
}

/// Returns who is taken when `highest` has the highest score: a tie goes to persons that are expected, and among total
/// variations to the weakest; persons that are not must be clearly ahead, else the best of the others is the highest.
/// `scores_against` returns how far all are behind one.
fn preferred(
    scores_against: &dyn Fn(usize) -> Vec<Score>,
    highest: usize,
    are_expected: bool,
) -> Candidate {
    let scores = scores_against(highest);
    let best = scores[highest].candidate;
    if best == Candidate::Points && !are_expected {
        let others = (0..scores.len()).filter(|k| scores[*k].candidate != Candidate::Points);
        let next = others.min_by(|a, b| scores[*a].behind.total_cmp(&scores[*b].behind));
        let is_clear = |next: &Score| next.behind > CLEARLY * next.behind_sd;
        return match next {
            Some(next) if !is_clear(&scores[next]) => {
                tied(&scores_against(next), scores[next].candidate, are_expected)
            }
            _ => best,
        };
    }
    tied(&scores, best, are_expected)
}

/// Returns who is taken of those that are behind the highest by less than can be told.
fn tied(scores: &[Score], highest: Candidate, are_expected: bool) -> Candidate {
    let is_variation = |of: Candidate| matches!(of, Candidate::Variation(_));
    let may_win = |score: &&Score| match score.candidate {
        Candidate::Points => are_expected,
        Candidate::NonNegative => highest == Candidate::NonNegative,
        Candidate::Variation(_) => is_variation(highest),
    };
    let tied = scores
        .iter()
        .filter(|score| score.behind <= score.behind_sd);
    tied.filter(may_win)
        .map(|score| score.candidate)
        .next()
        .unwrap_or(highest)
}

/// Returns what each candidate leaves of each link that it was not told, dB; a row for each candidate. All parts are left
/// out at once, a lane for each.
fn untold_residuals_db(
    problem: &LinkProblem<'_>,
    sparse: Sparse,
    list: &[Candidate],
    persons: Option<&Persons>,
) -> Vec<Vec<f64>> {
    let links = problem.observations.len();
    let rest = persons.map(|persons| persons.taken_out(problem.observations));
    // The links without the persons.
    let rest = rest.as_ref().map(|rest| LinkProblem {
        observations: rest,
        watch: Watch::NOBODY,
        ..*problem
    });
    // Of the rounds of each candidate nobody is told.
    let quiet = LinkProblem {
        watch: Watch::NOBODY,
        ..*problem
    };
    let mut told = Told {
        problem: &quiet,
        used: std::array::from_fn(|part| (0..links).map(|l| part_of(l) != part).collect()),
        sparse,
        earlier: None,
    };
    let mut rows: Vec<Vec<f64>> = list
        .iter()
        .rev()
        .enumerate()
        .map(|(done, candidate)| {
            let of = list.len();
            problem.watch.tell(ImagingStep::Choosing { done, of });
            match (candidate, &rest) {
                (Candidate::Variation(variation), _) => told.vary(*variation),
                (Candidate::Points, Some(rest)) => told.descend(rest),
                (Candidate::Points, None) | (Candidate::NonNegative, _) => told.descend(&quiet),
            }
        })
        .collect();
    rows.reverse();
    rows
}

/// What is told to candidates: all links but one part, for each part.
struct Told<'a> {
    problem: &'a LinkProblem<'a>,
    used: [Vec<bool>; FOLDS],
    sparse: Sparse,
    /// The total variation before: each starts from the next stronger one.
    earlier: Option<(PrimalDual<'a, FOLDS>, Vec<[f64; FOLDS]>)>,
}

impl Told<'_> {
    fn vary(&mut self, variation: Variation) -> Vec<f64> {
        let problem = self.problem;
        let effort = if self.earlier.is_some() { NEXT } else { FIRST };
        let (solver, images) = self.earlier.get_or_insert_with(|| {
            let solver = PrimalDual::new(problem.projector, problem.boxes, variation);
            (solver, vec![[0.0; FOLDS]; problem.boxes.len()])
        });
        solver.set_variation(variation);
        untold_db(problem, &vary(problem, &self.used, effort, solver, images))
    }

    fn descend(&self, problem: &LinkProblem<'_>) -> Vec<f64> {
        let mut images = vec![[0.0; FOLDS]; problem.boxes.len()];
        let states = descend(problem, &self.used, SPARSE, self.sparse, &mut images);
        untold_db(problem, &states)
    }
}

/// Returns of each link what is left of it by the image that it was not told, dB.
fn untold_db(problem: &LinkProblem<'_>, states: &[LinkState; FOLDS]) -> Vec<f64> {
    let by_part = states.each_ref().map(|state| state.residual_db(problem));
    let links = 0..problem.observations.len();
    links.map(|link| by_part[part_of(link)][link]).collect()
}

/// Returns the part of a link: without order, so that neighbours in the list lie in different ones.
fn part_of(link: usize) -> usize {
    let mixed = (link as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed >> 33) % FOLDS as u64) as usize
}

/// Returns the logarithm of the likelihood of each residual, lowered by what a number of unknowns gains.
fn likelihoods(problem: &LinkProblem<'_>, residual_db: &[f64], unknowns: usize) -> Vec<f64> {
    let all = vec![true; residual_db.len()];
    let kappa = noise_scale(problem, &all, residual_db, 1.0);
    let gained = unknowns as f64 / residual_db.len().max(1) as f64;
    let constant = libm::lgamma((DEGREES + 1.0) / 2.0)
        - libm::lgamma(DEGREES / 2.0)
        - 0.5 * libm::log(DEGREES * std::f64::consts::PI)
        - gained;
    let links = problem.observations.iter().zip(residual_db);
    links
        .map(|(link, residual_db)| {
            let variance_db2 = kappa * link.variance_db2;
            let square = residual_db * residual_db / variance_db2;
            constant
                - 0.5 * libm::log(variance_db2)
                - (DEGREES + 1.0) / 2.0 * libm::log1p(square / DEGREES)
        })
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const TV: Candidate = variation(0.06);

    const fn variation(weight: f64) -> Candidate {
        Candidate::Variation(Variation {
            weight,
            sparsity: 4.0,
        })
    }

    /// Returns scores against a candidate; each differs from the others by its own `behind`, with a standard error of 0.01.
    fn against(list: &[(Candidate, f64)], reference: usize) -> Vec<Score> {
        let score = |(candidate, behind): &(Candidate, f64)| Score {
            candidate: *candidate,
            likelihood: -2.0 - behind,
            behind: behind - list[reference].1,
            behind_sd: 0.01,
        };
        list.iter().map(score).collect()
    }

    fn taken(list: &[(Candidate, f64)], are_expected: bool) -> Candidate {
        let all = 0..list.len();
        let highest = all
            .min_by(|a, b| list[*a].1.total_cmp(&list[*b].1))
            .unwrap();
        preferred(&|reference| against(list, reference), highest, are_expected)
    }

    fn three(behind: [f64; 3]) -> Vec<(Candidate, f64)> {
        let list = [Candidate::Points, Candidate::NonNegative, TV];
        list.into_iter().zip(behind).collect()
    }

    #[test]
    fn persons_win_ties_in_a_change_and_must_be_clearly_ahead_elsewhere() {
        let tie = three([0.005, 0.2, 0.0]);
        assert_eq!(taken(&tie, true), Candidate::Points);
        assert_eq!(taken(&tie, false), TV);
        let narrow = three([0.0, 0.2, 0.015]);
        assert_eq!(taken(&narrow, true), Candidate::Points);
        assert_eq!(taken(&narrow, false), TV);
        let clear = three([0.0, 0.2, 0.03]);
        assert_eq!(taken(&clear, false), Candidate::Points);
    }

    #[test]
    fn a_tie_goes_to_the_weakest_variation_also_where_persons_are_not_clearly_ahead() {
        let of_variations = [(TV, 0.018), (variation(0.1), 0.012), (variation(2.0), 0.5)];
        assert_eq!(taken(&of_variations, false), TV);
        let with_persons = [&[(Candidate::Points, 0.0)][..], &of_variations].concat();
        assert_eq!(taken(&with_persons, false), TV);
        let apart = [
            (Candidate::Points, 0.0),
            (TV, 0.025),
            (variation(0.1), 0.012),
        ];
        assert_eq!(taken(&apart, false), variation(0.1));
    }

    #[test]
    fn the_words_say_by_how_much_the_chosen_one_is_behind_too() {
        let words = |behind: [f64; 3], best: Candidate| {
            let scores = against(&three(behind), 0);
            Choice { best, scores }.words()
        };
        let said = words([0.0, 0.2, 0.015], TV);
        assert!(
            said.starts_with("solver: tv 0.06 (itself 0.0150 ± 0.0100, and preferred so near), by"),
            "{said}"
        );
        let said = words([0.0, 0.2, 0.03], Candidate::Points);
        assert!(
            said.starts_with("solver: points, by the likelihood"),
            "{said}"
        );
    }
}
