//! From links to an image with its peaks: calibration, weights, solver and peaks in their order.
//!
//! [`Imager`] keeps the last solution and starts the next one from it; [`reconstruct`] does it once.

mod empty_scene;
mod known_rows;
mod memory;

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Segment};

use self::empty_scene::EmptyScene;
use self::known_rows::KnownRows;
use self::memory::check_memory;
use super::box_grid::BoxGrid;
use super::calibrate::{Calibrated, DropReason, DroppedLinks, Observation, calibrate_around};
use super::deviation::{DeviationInputs, deviation};
use super::empty_sweep::{EmptyLinks, KnownSweep};
use super::error::TomoError;
use super::finds::{Driven, Finds, SearchedGround, find_persons};
use super::imaged_links::ImagedLink;
use super::map_solver::{MapProblem, MapSettings, MapStart, Nuisance};
use super::path_loss::PathLoss;
use super::peaks::{Peak, peaks};
use super::prior::Covariance;
use super::progress::{ImagingStep, Watch};
use super::room::room_for_change;
use super::settings::{ImagingSettings, Solver};
use super::shares::{LinkShare, PixelShares, shares};
use super::solvers::{self, Choice, LinkProblem, Persons, Solved};
use super::weights::WeightRows;
use super::{Image, Link};

/// An empty sweep is taken as it was for the image before while its links differ by no more than this, dB: what radios differ
/// by, which is taken out of them, is found anew from the links of every image.
const SAME_SCENE_DB: f64 = 0.2;
/// Most pixels that are imaged; more would take minutes and show nothing new.
pub const MOST_PIXELS: usize = 1 << 20;

/// What is wanted beside an image; each takes longer than the image.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Extras {
    /// Whether persons are searched in a change.
    pub persons: bool,
    /// For how many pixels at most the deviation is computed; of a larger image for blocks of pixels. `None` = it is not.
    pub deviation: Option<usize>,
    /// The pixel whose links are asked for; only the solver `map` knows them.
    pub shares_of: Option<usize>,
    /// Whether the links come with it as the image explains them.
    pub links: bool,
}

/// An image and how it came about.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Reconstruction {
    /// The image, dB/m.
    pub image: Image,
    /// Strong places, strongest first.
    pub peaks: Vec<Peak>,
    /// Root mean square of what the image does not explain, dB.
    pub residual_rms_db: f64,
    /// Links in the image.
    pub used: usize,
    /// Links left out.
    pub dropped: DroppedLinks,
    /// The law that was fitted, if any.
    pub path_loss: Option<PathLoss>,
    /// Whether an empty sweep was subtracted.
    pub by_empty_sweep: bool,
    /// Who is there that was not in the empty sweep; `None` without one, and where nobody was searched.
    pub finds: Option<Finds>,
    /// Standard deviation of every pixel, dB/m, in the order of the image; `None` when it was not wanted.
    pub deviation: Option<Vec<f64>>,
    /// What made the pixel that was asked for; `None` when none was, and by another solver than `map`.
    pub shares: Option<PixelShares>,
    /// Why this image and no other, when the solver chose.
    pub choice: Option<Choice>,
    /// The links used, when they were wanted; recordings leave them out.
    #[serde(skip)]
    pub links: Option<Vec<ImagedLink>>,
}

/// Reconstructs once. Without an empty sweep the path loss is fitted and the whole structure is imaged.
///
/// # Errors
/// [`TomoError::BadGrid`], [`TomoError::NoLinks`] and [`TomoError::TooLarge`].
pub fn reconstruct(
    now: &[Link],
    empty: Option<&[Link]>,
    settings: &ImagingSettings,
) -> Result<Reconstruction, TomoError> {
    let extras = Extras {
        persons: true,
        ..Extras::default()
    };
    Imager::new(*settings)?.update(now, empty, extras)
}

/// Reconstructs again and again while links are added; each time starts from the last solution.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "ImagerSnapshot", into = "ImagerSnapshot")]
pub struct Imager {
    settings: ImagingSettings,
    covariance: Covariance,
    /// What the last solution by `map` has come to, where the next one begins.
    last: Option<MapStart>,
    standing: Option<EmptyScene>,
    /// What the empty sweep has said, and the weights of the links before: what follows from them is the same without them.
    sweep: KnownSweep,
    rows: KnownRows,
}

/// What a snapshot keeps of an imager; the covariance follows from the settings.
#[derive(Serialize, Deserialize)]
struct ImagerSnapshot {
    settings: ImagingSettings,
    last: Option<MapStart>,
    standing: Option<EmptyScene>,
}

impl From<Imager> for ImagerSnapshot {
    fn from(
        Imager {
            settings,
            covariance: _,
            last,
            standing,
            sweep: _,
            rows: _,
        }: Imager,
    ) -> ImagerSnapshot {
        ImagerSnapshot {
            settings,
            last,
            standing,
        }
    }
}

impl TryFrom<ImagerSnapshot> for Imager {
    type Error = TomoError;

    fn try_from(
        ImagerSnapshot {
            settings,
            last,
            standing,
        }: ImagerSnapshot,
    ) -> Result<Imager, TomoError> {
        Ok(Imager {
            last,
            standing,
            ..Imager::new(settings)?
        })
    }
}

impl Imager {
    /// Makes an imager; the covariance is transformed once.
    ///
    /// # Errors
    /// [`TomoError::BadGrid`].
    pub fn new(settings: ImagingSettings) -> Result<Imager, TomoError> {
        let (grid, area) = (settings.grid, settings.grid.area);
        let (width, height) = (area.width_m(), area.height_m());
        let is_sized = width.is_finite() && height.is_finite() && width > 0.0 && height > 0.0;
        let pixels = grid.columns.saturating_mul(grid.rows);
        if !is_sized || pixels == 0 || pixels > MOST_PIXELS {
            let (columns, rows) = (grid.columns, grid.rows);
            return Err(TomoError::BadGrid {
                most: MOST_PIXELS,
                columns,
                rows,
                width,
                height,
            });
        }
        let (prior, _) = settings.belief();
        let covariance = Covariance::new(&grid, prior);
        Ok(Imager {
            settings,
            covariance,
            last: None,
            standing: None,
            sweep: KnownSweep::default(),
            rows: KnownRows::default(),
        })
    }

    /// Forgets the last solution: the next one depends on its links alone, to the last bit.
    pub fn forget(&mut self) {
        self.last = None;
        self.forget_known();
    }

    /// Forgets what saves time alone.
    fn forget_known(&mut self) {
        self.sweep.forget();
        self.rows.forget();
    }

    /// Reconstructs from all links so far.
    ///
    /// # Errors
    /// [`TomoError::NoLinks`] and [`TomoError::TooLarge`].
    pub fn update(
        &mut self,
        now: &[Link],
        empty: Option<&[Link]>,
        extras: Extras,
    ) -> Result<Reconstruction, TomoError> {
        self.update_watched(now, empty, extras, &|_| {})
    }

    /// Does as [`Self::update`], and tells `watch` of each step when it begins.
    ///
    /// # Errors
    /// As [`Self::update`].
    pub fn update_watched(
        &mut self,
        now: &[Link],
        empty: Option<&[Link]>,
        extras: Extras,
        watch: &dyn Fn(ImagingStep),
    ) -> Result<Reconstruction, TomoError> {
        let watch = Watch(watch);
        if empty.is_some() {
            watch.tell(ImagingStep::Structure);
        }
        let scene = match empty.map(|empty| self.find_scene(empty)) {
            None => None,
            Some(Ok(())) => self.standing.as_ref(),
            // Images that are never negative do without: they are not kept out of anything.
            Some(Err(_)) if self.settings.solver.is_non_negative() => None,
            Some(Err(problem)) => return Err(problem),
        };
        let of_empty = empty.map(|links| match scene {
            Some(scene) => scene.links(),
            None => EmptyLinks {
                links,
                structure: None,
            },
        });
        let mut calibrated = calibrate_around(now, of_empty, &self.settings, &mut self.sweep);
        let structure = scene.and_then(|scene| scene.structure.clone());
        let mut rows = self.rows(&mut calibrated)?;
        if calibrated.observations.is_empty() {
            return Err(TomoError::NoLinks {
                given: now.len(),
                dropped: words(&calibrated.dropped, self.settings.shortest_link_m),
            });
        }
        let are_drawn = self.settings.solver.draws_persons();
        let are_sought = extras.persons && (empty.is_some() || are_drawn);
        if are_sought {
            watch.tell(ImagingStep::Persons);
        }
        let finds = are_sought
            .then(|| self.finds(&calibrated, structure.as_ref()))
            .flatten();
        let are_kept_out = !self.settings.solver.is_non_negative();
        let room = structure.as_ref().filter(|_| are_kept_out);
        let room = room.map_or(Vec::new(), room_for_change);
        rows.scale_pixels(&room);
        let is_exact = extras.shares_of.is_some();
        let solved = self.solve(&rows, &mut calibrated, finds.as_ref(), is_exact, watch);
        if self.last.is_none() {
            // Images that always begin cold are seldom made.
            self.forget_known();
        }
        if extras.deviation.is_some() {
            watch.tell(ImagingStep::Deviation);
        }
        let deviation = extras
            .deviation
            .and_then(|most| self.deviation(most, &rows, &calibrated, &solved, &room));
        let shares = extras
            .shares_of
            .and_then(|pixel| self.shares(pixel, &rows, &calibrated, &solved, &room));
        let links = extras
            .links
            .then(|| ImagedLink::all(&calibrated.observations, &solved));
        let (mut values, residual_db) = (solved.image, solved.residual_db);
        values
            .iter_mut()
            .zip(&room)
            .for_each(|(value, room)| *value *= room);
        let image = Image {
            grid: self.settings.grid,
            values,
        };
        let squares: f64 = residual_db.iter().map(|residual| residual * residual).sum();
        let mut peaks = peaks(&image, self.settings.peaks);
        if let Some(drawn) = finds.as_ref().filter(|_| solved.are_persons_drawn) {
            peaks.iter_mut().for_each(|peak| self.settle(peak, drawn));
        }
        Ok(Reconstruction {
            peaks,
            image,
            residual_rms_db: (squares / residual_db.len() as f64).sqrt(),
            used: calibrated.observations.len(),
            dropped: calibrated.dropped,
            path_loss: calibrated.path_loss,
            by_empty_sweep: calibrated.by_empty_sweep,
            // Whatever stands there would look like persons.
            finds: finds.filter(|_| empty.is_some()),
            deviation,
            shares,
            choice: solved.choice,
            links,
        })
    }

    /// Moves a peak on a disc to where the person was found: the disc itself is flat.
    fn settle(&self, peak: &mut Peak, drawn: &Finds) {
        let grid = &self.settings.grid;
        let reach_m = self.settings.finds.person.radius_m + grid.dx_m().max(grid.dy_m());
        let near = drawn.found.iter().map(|find| find.at);
        let nearest = near.min_by(|a, b| {
            let (a_m, b_m) = (a.distance_to(peak.at), b.distance_to(peak.at));
            a_m.total_cmp(&b_m)
        });
        if let Some(at) = nearest.filter(|at| at.distance_to(peak.at) <= reach_m) {
            peak.at = at;
        }
    }

    /// Searches persons.
    fn finds(&self, calibrated: &Calibrated, structure: Option<&Image>) -> Option<Finds> {
        let ground = SearchedGround {
            area: self.settings.grid.area,
            driven: self.driven(calibrated),
            structure,
        };
        find_persons(&calibrated.observations, ground, &self.settings.finds)
    }

    fn driven(&self, calibrated: &Calibrated) -> Option<Driven> {
        calibrated.is_driven.then_some(Driven {
            ring: self.settings.ring,
            bin_m: self.settings.pairing_m,
        })
    }

    /// Returns those who were found as the solvers meet them; `None` when nobody was.
    fn persons(&self, calibrated: &Calibrated, finds: Option<&Finds>) -> Option<Persons> {
        let driven = self.driven(calibrated);
        let found = finds.map(|finds| finds.found.clone())?;
        (!found.is_empty()).then_some(Persons {
            found,
            are_expected: calibrated.by_empty_sweep,
            model: self.settings.finds.person,
            ring: self.settings.ring,
            smear_m: driven.map_or(0.0, |driven| driven.bin_m / 12f64.sqrt()),
            grid: self.settings.grid,
        })
    }

    /// Sees to it that the scene at hand is that of an empty sweep.
    ///
    /// # Errors
    /// [`TomoError::TooLarge`].
    fn find_scene(&mut self, empty: &[Link]) -> Result<(), TomoError> {
        // An image that begins cold depends on its links alone.
        let within_db = if self.last.is_none() {
            0.0
        } else {
            SAME_SCENE_DB
        };
        let known = self.standing.as_ref();
        if !known.is_some_and(|one| one.is_of(empty, within_db)) {
            self.standing = Some(EmptyScene::of(empty, &self.settings)?);
        }
        Ok(())
    }

    /// Builds the weights, and drops links that do not touch the area.
    fn rows(&mut self, calibrated: &mut Calibrated) -> Result<WeightRows, TomoError> {
        check_memory(&calibrated.observations, &self.settings)?;
        let settings = &self.settings;
        let segment = |link: &Observation| Segment::new(link.from, link.to);
        let known = &mut self.rows;
        let mut build = |links: &[Observation]| {
            known.rows(links.iter().map(segment), &settings.grid, settings.weights)
        };
        let rows = build(&calibrated.observations);
        let touches: Vec<bool> = (0..rows.len())
            .map(|row| rows.row(row).any(|(_, weight)| weight > 0.0))
            .collect();
        let outside = touches.iter().filter(|touches| !**touches).count();
        if outside == 0 {
            return Ok(rows);
        }
        drop(rows);
        calibrated.dropped.insert(DropReason::OutsideArea, outside);
        let mut keep = touches.into_iter();
        calibrated
            .observations
            .retain(|_| keep.next().unwrap_or(false));
        Ok(build(&calibrated.observations))
    }

    /// Returns what made a pixel.
    fn shares(
        &self,
        pixel: usize,
        rows: &WeightRows,
        calibrated: &Calibrated,
        solved: &Solved,
        room: &[f64],
    ) -> Option<PixelShares> {
        let links = &calibrated.observations;
        let (Solver::Map(..), true) = (self.settings.solver, pixel < solved.image.len()) else {
            return None;
        };
        let shares = shares(pixel, rows, &self.covariance, room, &solved.dual);
        let of_link = |((link, residual_db), share): ((&Observation, &f64), &f64)| LinkShare {
            from: link.from,
            to: link.to,
            share: *share,
            attenuation_db: link.attenuation_db,
            sd_db: link.variance_db2.sqrt(),
            residual_db: *residual_db,
            packets: link.packets,
            misses: link.misses,
        };
        let all = links.iter().zip(&solved.residual_db).zip(&shares);
        let mut of_links: Vec<LinkShare> = all.map(of_link).collect();
        of_links.sort_by(|a, b| b.share.abs().total_cmp(&a.share.abs()));
        Some(PixelShares {
            pixel,
            at: self.settings.grid.centre(pixel),
            value: shares.iter().sum(),
            links: of_links,
        })
    }

    /// Returns the deviation of every pixel under the prior of `map`, and of an image that is mostly zero under one that knows
    /// it; each link tells as much as it told the solver.
    fn deviation(
        &self,
        most_blocks: usize,
        rows: &WeightRows,
        calibrated: &Calibrated,
        solved: &Solved,
        room: &[f64],
    ) -> Option<Vec<f64>> {
        let given = DeviationInputs {
            settings: &self.settings,
            most_blocks,
            rows,
            room,
            nuisance: &nuisance_of(calibrated),
        };
        deviation(&given, &solved.noise_db2, &solved.image)
    }

    fn solve(
        &mut self,
        rows: &WeightRows,
        calibrated: &mut Calibrated,
        finds: Option<&Finds>,
        is_exact: bool,
        watch: Watch<'_>,
    ) -> Solved {
        let nuisance = nuisance_of(calibrated);
        let pixels = self.settings.grid.len();
        let projector = solvers::projector(&self.settings.solver, rows, pixels);
        let problem = LinkProblem {
            projector: &projector,
            boxes: BoxGrid::of_pixels(&self.settings.grid),
            observations: &calibrated.observations,
            nuisance: &nuisance,
            watch,
        };
        let persons = self.persons(calibrated, finds);
        let solved = match self.settings.solver {
            Solver::Map(_, settings) if is_exact => self.solve_map(&problem, settings.exact()),
            Solver::Map(_, settings) => self.solve_map(&problem, settings),
            Solver::Tikhonov { alpha_m2 } => solvers::tikhonov(&problem, alpha_m2),
            Solver::Tsvd { share } => solvers::tsvd(&problem, share),
            Solver::Variation(candidates) => solvers::variation(&problem, &candidates),
            Solver::NonNegative(sparse) => solvers::non_negative(&problem, sparse),
            Solver::Points(sparse) => match persons {
                Some(persons) => solvers::points(&problem, sparse, &persons),
                None => solvers::non_negative(&problem, sparse),
            },
            Solver::Auto(candidates) => solvers::auto(&problem, &candidates, persons.as_ref()),
        };
        if let (Some(law), [level, slope]) = (calibrated.path_loss.as_mut(), &solved.nuisance[..]) {
            *law = law.corrected(-level, *slope);
        }
        solved
    }

    fn solve_map(&mut self, problem: &LinkProblem<'_>, settings: MapSettings) -> Solved {
        problem.watch.tell(ImagingStep::Solving { done: 0, of: 1 });
        let links = problem.observations;
        let attenuation_db: Vec<f64> = links.iter().map(|link| link.attenuation_db).collect();
        let variance_db2: Vec<f64> = links.iter().map(|link| link.variance_db2).collect();
        let problem = MapProblem {
            rows: problem.projector.rows(),
            covariance: &self.covariance,
            attenuation_db: &attenuation_db,
            variance_db2: &variance_db2,
            nuisance: problem.nuisance,
        };
        let solution = problem.solve(settings, self.last.as_ref());
        self.last = Some(solution.start);
        let variances = variance_db2.iter().zip(&solution.trust);
        Solved {
            noise_db2: variances.map(|(s2, trust)| s2 / trust).collect(),
            image: solution.image,
            residual_db: solution.residual_db,
            nuisance: solution.nuisance,
            dual: solution.dual,
            choice: None,
            are_persons_drawn: false,
        }
    }
}

/// Returns the unknowns of the path loss, of which an empty sweep leaves none.
fn nuisance_of(calibrated: &Calibrated) -> Vec<Nuisance> {
    match calibrated.path_loss {
        Some(law) if !calibrated.by_empty_sweep => {
            let links = calibrated.observations.iter();
            law.nuisance(links.map(|link| Point::distance_to(link.from, link.to)))
        }
        Some(_) | None => Vec::new(),
    }
}

/// Returns reasons and counts in words, and under which length links are too short.
fn words(dropped: &DroppedLinks, shortest_m: f64) -> String {
    if dropped.is_empty() {
        return "none".to_owned();
    }
    let part = |(reason, count): (&DropReason, &usize)| match reason {
        DropReason::TooShort => format!("{count} {} (under {shortest_m:.2})", reason.words()),
        DropReason::SameSide
        | DropReason::NeverHeard
        | DropReason::NoEmptyPartner
        | DropReason::NoPathLoss
        | DropReason::OutsideArea
        | DropReason::SilentBefore => format!("{count} {}", reason.words()),
    };
    dropped.iter().map(part).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod properties;
#[cfg(test)]
mod tests;
