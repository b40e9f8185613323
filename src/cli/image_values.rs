//! Values of options of `tomoswarm image`: how they are written, and what they mean for the settings.

use clap::ValueEnum;

use crate::config;
use crate::geom::{Point, Rect};
use crate::tomo::{ImagingSettings, MOST_PIXELS, Solver, WeightModel};

/// The solvers by name.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum SolverName {
    /// Most probable image under a smooth prior, with robust noise
    Map,
    /// Least squares with smoothness, the classical reference
    Tikhonov,
    /// Least squares by the large singular values, the other reference
    Tsvd,
    /// Non-negative total variation: walls
    Tv,
    /// Non-negative and sparse: persons
    Nn,
    /// The persons found, drawn over what is left
    Points,
    /// The one of tv, nn and points that predicts best the links that it was not told
    Auto,
}

/// The weight models by name.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum WeightsName {
    /// Length of the link in the pixel
    Line,
    /// Pixels within a narrow ellipse
    Ellipse,
    /// One over the area of the ellipse through the pixel
    InverseArea,
    /// A bell around the link
    Gaussian,
    /// An exponential fall from the link
    Exponential,
    /// A bell half as wide as the first Fresnel zone
    Fresnel,
}

impl SolverName {
    /// Returns the solver as a file names it.
    pub(super) fn in_files(self) -> config::Solver {
        match self {
            SolverName::Map => config::Solver::Map,
            SolverName::Tikhonov => config::Solver::Tikhonov,
            SolverName::Tsvd => config::Solver::Tsvd,
            SolverName::Tv => config::Solver::Tv,
            SolverName::Nn => config::Solver::Nn,
            SolverName::Points => config::Solver::Points,
            SolverName::Auto => config::Solver::Auto,
        }
    }

    /// Sets the solver, and the weights that suit it, where no recording says how it is imaged; the settings are the usual
    /// ones of their subject, by `map`.
    pub(super) fn choose(self, settings: &mut ImagingSettings) {
        let area = settings.grid.area;
        let sparse = ImagingSettings::sparse_for(area);
        let candidates = ImagingSettings::candidates_for(area);
        settings.solver = match self {
            SolverName::Map => return,
            SolverName::Tikhonov => ImagingSettings::tikhonov_for(area),
            SolverName::Tsvd => Solver::TSVD,
            SolverName::Tv => Solver::Variation(candidates),
            SolverName::Nn => Solver::NonNegative(sparse),
            SolverName::Points => Solver::Points(sparse),
            SolverName::Auto => Solver::Auto(candidates),
        };
        settings.weights = match settings.solver.is_non_negative() {
            true => settings.fresnel(),
            false => WeightModel::Line,
        };
    }
}

impl WeightsName {
    /// Returns the model with a tuning width, else with the one that suits 40 pixels on the longer side of the area.
    pub(super) fn model(self, settings: &ImagingSettings, width_m: Option<f64>) -> WeightModel {
        let area = settings.grid.area;
        let width_m = width_m.unwrap_or(0.015 * area.width_m().max(area.height_m()));
        match self {
            WeightsName::Fresnel => settings.fresnel(),
            WeightsName::Line => WeightModel::Line,
            WeightsName::Ellipse => WeightModel::Ellipse { width_m },
            WeightsName::InverseArea => WeightModel::InverseArea { width_m },
            WeightsName::Gaussian => WeightModel::Gaussian { sd_m: width_m },
            WeightsName::Exponential => WeightModel::Exponential {
                decay_m: width_m / 3.0,
            },
        }
    }
}

/// Reads the value of an option.
pub(super) fn parse_pixels(text: &str) -> Result<(usize, usize), String> {
    let expected =
        || format!("expected WIDTHxHEIGHT such as 40x40, 1 to {MOST_PIXELS} pixels in all");
    let (columns, rows) = text.split_once(['x', 'X']).ok_or_else(expected)?;
    let count = |part: &str| {
        part.trim()
            .parse::<usize>()
            .ok()
            .filter(|count| *count > 0)
            .ok_or_else(expected)
    };
    let (columns, rows) = (count(columns)?, count(rows)?);
    let pixels = columns
        .checked_mul(rows)
        .filter(|pixels| *pixels <= MOST_PIXELS);
    pixels.map(|_| (columns, rows)).ok_or_else(expected)
}

/// Reads the value of an option.
pub(super) fn parse_place(text: &str) -> Result<Point, String> {
    let numbers = text.split(',').map(|part| part.trim().parse::<f64>());
    match numbers.collect::<Result<Vec<f64>, _>>().as_deref() {
        Ok([x, y]) if (x + y).is_finite() => Ok(Point::new(*x, *y)),
        _ => Err("expected X,Y such as 8.5,12".to_owned()),
    }
}

/// Reads the value of an option.
pub(super) fn parse_cell(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|cell_m| (0.001..=1000.0).contains(cell_m))
        .ok_or_else(|| "expected metres, a number from 0.001 to 1000".to_owned())
}

/// Reads the value of an option.
pub(super) fn parse_rate(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|rate| (1e-6..=1.0).contains(rate))
        .ok_or_else(|| "expected a number from 0.000001 to 1".to_owned())
}

/// Reads the value of an option.
pub(super) fn parse_area(text: &str) -> Result<Rect, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .filter_map(|part| part.trim().parse().ok())
        .collect();
    match numbers[..] {
        [x0, y0, x1, y1]
            if text.split(',').count() == 4
                && x0 < x1
                && y0 < y1
                && (x1 - x0 + y1 - y0).is_finite() =>
        {
            Ok(Rect::new(Point::new(x0, y0), Point::new(x1, y1)))
        }
        _ => Err("expected X0,Y0,X1,Y1 such as 0,0,20,20, the south-west corner first".to_owned()),
    }
}
