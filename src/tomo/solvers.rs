//! Solvers of images that are not negative, and what they share: one function for each kind, all told the same problem.
//!
//! | part | |
//! | --- | --- |
//! | `response` | what a radio shows of a strong attenuation |
//! | `robust` | rounds of linear problems; noise, floor, path loss |
//! | `total_variation` | flat images with edges |
//! | `non_negative` | smooth images that prefer to be empty |
//! | `persons` | discs for those who were found |
//! | `choice` | which of them predicts best what it was not told |
//!
//! The solvers `map` and `tikhonov` ([`super::map_solver`], [`super::tikhonov`]) know neither sign nor saturation.

mod choice;
mod non_negative;
mod persons;
mod response;
mod robust;
mod total_variation;

pub use self::choice::{Candidate, Choice, Score};
pub use self::non_negative::Sparse;
pub(super) use self::persons::Persons;
pub use self::total_variation::Variation;

use serde::{Deserialize, Serialize};

use self::non_negative::Descent;
use self::robust::{LinkState, solve_robustly};
use self::total_variation::PrimalDual;
use super::Observation;
use super::box_grid::BoxGrid;
use super::map_solver::Nuisance;
use super::progress::Watch;
use super::projector::Projector;
use super::settings::Solver;
use super::student::doubted;
use super::tikhonov::smoothed;
use super::weights::WeightRows;

/// What images may be chosen from.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Candidates {
    /// Of the solver `nn`, and of what is left when persons are taken out.
    pub sparse: Sparse,
    /// Of the solver `tv`, from the weakest to the strongest.
    pub variations: [Variation; 3],
}

/// What is measured, and how it depends on the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinkProblem<'a> {
    /// Rows = links, columns = pixels or voxels, metres.
    pub projector: &'a Projector<'a>,
    pub boxes: BoxGrid,
    pub observations: &'a [Observation],
    /// The unknowns of the path loss.
    pub nuisance: &'a [Nuisance],
    /// Who is told how it gets on.
    pub watch: Watch<'a>,
}

/// A solved problem.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Solved {
    /// dB/m.
    pub image: Vec<f64>,
    /// What each link shows beyond the image, dB.
    pub residual_db: Vec<f64>,
    /// The variance with which each link was taken for a measurement of the attenuation on its straight way, dB²; infinite where
    /// it tells nothing of it.
    pub noise_db2: Vec<f64>,
    /// The coefficients of the nuisance columns.
    pub nuisance: Vec<f64>,
    /// The dual variable of each link; empty where the solver has none.
    pub dual: Vec<f64>,
    /// How it was chosen, if it was.
    pub choice: Option<Choice>,
    /// Whether those who were found are drawn into the image.
    pub are_persons_drawn: bool,
}

/// How long a solver works.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Effort {
    /// Linear problems, one after the other.
    rounds: usize,
    /// Of one linear problem.
    steps: usize,
}

/// For an image that is shown.
const THOROUGH: Effort = Effort {
    rounds: 8,
    steps: 60,
};

/// To what share of it an image is known when [`THOROUGH`] ends, about.
const KNOWN_TO: f64 = 1e-3;

/// Returns the projector that a solver takes on so many pixels or voxels: its weights are rounded where it ends after a number of
/// steps. (The solver `map` makes its own by where it is to end.)
pub(super) fn projector<'a>(solver: &Solver, rows: &'a WeightRows, pixels: usize) -> Projector<'a> {
    let known_to = match solver {
        Solver::Map(..) | Solver::Tikhonov { .. } | Solver::Tsvd { .. } => 0.0,
        Solver::Variation(_) | Solver::NonNegative(_) | Solver::Points(_) | Solver::Auto(_) => {
            KNOWN_TO
        }
    };
    Projector::of(rows, pixels, known_to)
}

/// Solves by smoothness; all links weigh the same.
pub(super) fn tikhonov(problem: &LinkProblem<'_>, alpha: f64) -> Solved {
    let links = problem.observations.iter();
    let attenuation_db: Vec<f64> = links.map(|link| link.attenuation_db).collect();
    let image = smoothed(
        problem.projector.rows(),
        &problem.boxes,
        &attenuation_db,
        alpha,
    );
    linearly_solved(problem, image)
}

/// Solves by the large singular values; all links weigh the same.
pub(super) fn tsvd(problem: &LinkProblem<'_>, share: f64) -> Solved {
    let links = problem.observations.iter();
    let attenuation_db: Vec<f64> = links.map(|link| link.attenuation_db).collect();
    let rows = problem.projector.rows();
    let image = super::tsvd(rows, problem.boxes.len(), &attenuation_db, share);
    linearly_solved(problem, image)
}

/// Solves by total variation, with the weights that predict best.
pub(super) fn variation(problem: &LinkProblem<'_>, candidates: &Candidates) -> Solved {
    if let [first, rest @ ..] = candidates.variations
        && rest.iter().all(|of| *of == first)
    {
        return vary_thoroughly(problem, first);
    }
    chosen(problem, candidates, &candidates.variations(), None)
}

/// Solves by the one of all candidates that predicts best.
pub(super) fn auto(
    problem: &LinkProblem<'_>,
    candidates: &Candidates,
    persons: Option<&Persons>,
) -> Solved {
    let mut list: Vec<Candidate> = persons.map(|_| Candidate::Points).into_iter().collect();
    list.push(Candidate::NonNegative);
    list.extend(candidates.variations());
    chosen(problem, candidates, &list, persons)
}

/// Solves by the non-negative image under a smooth prior.
pub(super) fn non_negative(problem: &LinkProblem<'_>, sparse: Sparse) -> Solved {
    let used = [vec![true; problem.observations.len()]];
    let mut image = vec![[0.0]; problem.boxes.len()];
    let states = descend(problem, &used, THOROUGH, sparse, &mut image);
    solved(problem, &states, &image)
}

/// Draws the persons over what the links show without them.
pub(super) fn points(problem: &LinkProblem<'_>, sparse: Sparse, persons: &Persons) -> Solved {
    let rest = persons.taken_out(problem.observations);
    let problem = LinkProblem {
        observations: &rest,
        ..*problem
    };
    let mut solved = non_negative(&problem, sparse);
    persons.draw(&mut solved.image);
    solved.are_persons_drawn = true;
    solved
}

impl Candidates {
    fn variations(&self) -> Vec<Candidate> {
        self.variations.map(Candidate::Variation).to_vec()
    }
}

fn chosen(
    problem: &LinkProblem<'_>,
    candidates: &Candidates,
    list: &[Candidate],
    persons: Option<&Persons>,
) -> Solved {
    let choice = choice::choose(problem, candidates.sparse, list, persons);
    let mut solved = match (choice.best, persons) {
        (Candidate::Variation(of), _) => vary_thoroughly(problem, of),
        (Candidate::Points, Some(persons)) => points(problem, candidates.sparse, persons),
        (Candidate::Points, None) | (Candidate::NonNegative, _) => {
            non_negative(problem, candidates.sparse)
        }
    };
    solved.choice = Some(choice);
    solved
}

fn vary_thoroughly(problem: &LinkProblem<'_>, variation: Variation) -> Solved {
    let used = [vec![true; problem.observations.len()]];
    let mut image = vec![[0.0]; problem.boxes.len()];
    let mut solver = PrimalDual::new(problem.projector, problem.boxes, variation);
    let states = vary(problem, &used, THOROUGH, &mut solver, &mut image);
    solved(problem, &states, &image)
}

/// Improves several images at once, a lane for each: they differ in the links that are used.
fn vary<const LANES: usize>(
    problem: &LinkProblem<'_>,
    used: &[Vec<bool>; LANES],
    effort: Effort,
    solver: &mut PrimalDual<'_, LANES>,
    images: &mut [[f64; LANES]],
) -> [LinkState; LANES] {
    solve_robustly(
        problem,
        used,
        effort.rounds,
        images,
        |linearised, images| {
            solver.improve(linearised, images, effort.steps);
        },
    )
}

/// The same, of smooth images.
fn descend<const LANES: usize>(
    problem: &LinkProblem<'_>,
    used: &[Vec<bool>; LANES],
    effort: Effort,
    sparse: Sparse,
    images: &mut [[f64; LANES]],
) -> [LinkState; LANES] {
    let mut solver = Descent::new(problem.projector, problem.boxes, sparse);
    solve_robustly(
        problem,
        used,
        effort.rounds,
        images,
        |linearised, images| {
            solver.improve(linearised, images, effort.steps);
        },
    )
}

/// Returns a solution of what is linear in the image, without path loss.
fn linearly_solved(problem: &LinkProblem<'_>, image: Vec<f64>) -> Solved {
    let mut explained_db = vec![0.0; problem.observations.len()];
    let rows = problem.projector.rows();
    rows.forward(&image, &mut explained_db);
    let links = problem.observations.iter().zip(explained_db);
    let residual_db: Vec<f64> = links
        .map(|(link, explained_db)| link.attenuation_db - explained_db)
        .collect();
    let links = problem.observations.iter().zip(&residual_db);
    let noise_db2 = links.map(|(link, residual_db)| doubted(link.variance_db2, *residual_db));
    Solved {
        noise_db2: noise_db2.collect(),
        residual_db,
        image,
        nuisance: Vec::new(),
        dual: Vec::new(),
        choice: None,
        are_persons_drawn: false,
    }
}

fn solved(problem: &LinkProblem<'_>, [state]: &[LinkState; 1], image: &[[f64; 1]]) -> Solved {
    Solved {
        image: image.as_flattened().to_vec(),
        residual_db: state.residual_db(problem),
        noise_db2: state.noise_db2(problem),
        nuisance: state.nuisance.clone(),
        dual: Vec::new(),
        choice: None,
        are_persons_drawn: false,
    }
}

#[cfg(test)]
mod tests;
