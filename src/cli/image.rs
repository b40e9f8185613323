//! `tomoswarm image`: reconstructs an image from recorded links.
//!
//! Files in, files out; the work is done by `tomo`, the files are written by `outputs`.

use std::path::{Path, PathBuf};

use crate::config::SourceFile;
use crate::geom::{PixelGrid, Point, Rect};
use crate::ground::from_config::image_settings;
use crate::ground::imager::Subject;
use crate::tomo::{
    Extras, FindSettings, Imager, ImagingSettings, Link, LinkBins, MOST_PIXELS, SPOT_M, Solver,
    TomoError, WeightModel,
};
use clap::{Args, ValueEnum};

use super::error::CliError;
use super::image_text::summary;
use super::network_recording::{NetworkRecording, Tracks};
use super::outputs::{Outputs, PendingFile, is_device};
use super::read;
use super::recording::{LengthUnit, Recording, RecordingError, read_recording};
use super::stop::StopFlag;

/// Reconstructs an image from recorded links.
///
/// Reads CSV files (header tx_x_m,tx_y_m,rx_x_m,rx_y_m,packets,rssi_dbm; packets may be missing), links.csv files
/// written by tomoswarm, and JSON recordings of the 2016 two-rover system. Several files are pooled. With --empty
/// the image shows what changed since the empty sweep, and persons are searched in that; without it, all that stands
/// in the area.
#[derive(Args, Clone, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct ImageCommand {
    /// Recordings of the sweep
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// A recording of the same area while nobody was inside; may be given several times
    #[arg(long, value_name = "FILE")]
    pub empty: Vec<PathBuf>,
    /// The places of a fixed network, header id,x_m,y_m: the recordings then have a line for each round of a receiver, its id,
    /// the strength of each node, hour, minute, second
    #[arg(long, value_name = "FILE")]
    pub nodes: Option<PathBuf>,
    /// Follows persons who walk within a fixed network, and writes where they were: time_s, person, x_m, y_m, sd_x_m, sd_y_m,
    /// probability
    #[arg(long, value_name = "FILE", requires = "nodes")]
    pub track: Option<PathBuf>,
    /// How the image is found [default: as the recording says, else auto; with --why map]
    #[arg(long, value_enum)]
    pub solver: Option<SolverName>,
    /// How pixels weigh in links [default: as the recording says, else what suits the solver:
    /// inverse-area for map, line for tikhonov and tsvd, fresnel for the others]
    #[arg(long, value_enum)]
    pub weights: Option<WeightsName>,
    /// Pixels from west to east and from south to north [default: as the recording says, else 40 along the longer side]
    #[arg(long, value_name = "WxH", value_parser = parse_pixels)]
    pub pixels: Option<(usize, usize)>,
    /// What is imaged, in the units of the input [default: what the recording names, else what the positions enclose]
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_area, allow_hyphen_values = true)]
    pub area: Option<Rect>,
    /// How large a cell is when the recording counts in cells of a lattice, metres: what persons and the radio's waves are
    /// compared with [default: 0.3]
    #[arg(long, value_name = "METRES", value_parser = parse_cell, allow_negative_numbers = true)]
    pub cell: Option<f64>,
    /// Writes a picture
    #[arg(long, value_name = "FILE")]
    pub png: Option<PathBuf>,
    /// Writes the values: f32, rows from south to north, columns from west to east, dB per unit of length
    #[arg(long, value_name = "FILE")]
    pub npy: Option<PathBuf>,
    /// Says which links made the pixel at a place, with --json all of them; only the solver map knows
    #[arg(long, value_name = "X,Y", value_parser = parse_place, allow_hyphen_values = true)]
    pub why: Option<Point>,
    /// Writes how sure the image is: the standard deviation of every pixel, as a picture if the name ends with .png, otherwise
    /// as values; it takes a second or two longer
    #[arg(long, value_name = "FILE")]
    pub deviation: Option<PathBuf>,
    /// Writes finds, peaks, residual, links used and dropped, and settings
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Most peaks that are listed [default: as the recording says, else 5]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub peaks: Option<usize>,
    /// How many places where nobody stands may be found in an image of a change, on the mean, 0.000001 to 1 [default: as
    /// the recording says, else 0.02]
    #[arg(long, value_name = "RATE", value_parser = parse_rate, allow_negative_numbers = true)]
    pub false_finds: Option<f64>,
}

/// A cell of a lattice whose size nobody says, metres: the rovers that follow its lines are about so wide.
const CELL_M: f64 = 0.3;
/// The deviation is exact up to so many pixels: a second or two, and 40 MB.
const MOST_BLOCKS: usize = 1600;

const AFTER_HELP: &str = "\
Positions, areas and peaks are in the units of the input: metres in CSV files, cells of the lattice in JSON recordings.
Positive values are attenuation, dB per unit of length.

Examples:
  tomoswarm image links.csv --empty empty.csv --png image.png        what has changed
  tomoswarm image links.csv --pixels 80x80 --area 0,0,20,20 --npy structure.npy
  tomoswarm image dump.json --json result.json --peaks 1             the strongest peak, for a script
  tomoswarm image walk.csv --nodes nodes.csv --empty empty.csv --track track.csv

Exit codes: 0 done; 2 bad usage or recordings, or a file that cannot be written.";

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
    /// Sets the solver, and the weights that suit it; a prior of `map` that a recording names stays.
    fn choose(self, settings: &mut ImagingSettings) {
        let area = settings.grid.area;
        let usual = ImagingSettings::for_area(area);
        (settings.solver, settings.weights) = match self {
            SolverName::Map if matches!(settings.solver, Solver::Map(..)) => return,
            SolverName::Map => (usual.solver, usual.weights),
            SolverName::Tikhonov => (ImagingSettings::tikhonov_for(area), WeightModel::Line),
            SolverName::Tsvd => (Solver::TSVD, WeightModel::Line),
            SolverName::Tv | SolverName::Nn | SolverName::Points | SolverName::Auto => {
                (self.non_negative(area), settings.fresnel())
            }
        };
    }

    fn non_negative(self, area: Rect) -> Solver {
        let sparse = ImagingSettings::sparse_for(area);
        let candidates = ImagingSettings::candidates_for(area);
        match self {
            SolverName::Tv => Solver::Variation(candidates),
            SolverName::Nn => Solver::NonNegative(sparse),
            SolverName::Points => Solver::Points(sparse),
            SolverName::Map | SolverName::Tikhonov | SolverName::Tsvd | SolverName::Auto => {
                Solver::Auto(candidates)
            }
        }
    }
}

impl WeightsName {
    /// Returns the model with the width that suits 40 pixels on the longer side of an area.
    fn model(self, settings: &ImagingSettings) -> WeightModel {
        let area = settings.grid.area;
        let width_m = 0.015 * area.width_m().max(area.height_m());
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

/// Why there is no image. Each ends the program with exit code 2.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// A file that is not as expected.
    #[error("{}:{}{problem}", path.display(), problem.gap())]
    Recording {
        /// The file.
        path: PathBuf,
        /// Line, what was found, what was expected.
        problem: RecordingError,
    },
    /// Files in different units.
    #[error("{}: found positions in {found}, expected {expected} as in the first file", path.display())]
    MixedUnits {
        /// The file.
        path: PathBuf,
        /// Its unit.
        found: &'static str,
        /// The first file's unit.
        expected: &'static str,
    },
    /// An output that cannot be written.
    #[error("{}: {source}, expected a file that can be written", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Data without an image.
    #[error("{}: {problem}", path.display())]
    NoImage {
        /// The first file.
        path: PathBuf,
        /// Why.
        problem: TomoError,
    },
}

impl ImageCommand {
    /// Reads, reconstructs, writes, and prints a summary.
    ///
    /// # Errors
    /// Files that cannot be read or written, [`ImageError`]; nothing is written then.
    pub fn run(&self, out: &mut dyn std::io::Write) -> Result<(), CliError> {
        self.check_files()?;
        let mut made_from = Vec::new();
        let network = self.network(&mut made_from)?;
        let (now, empty) = match &network {
            Some(network) => (network.now(), network.empty()),
            None => {
                let now = read_files(&self.files, None, &mut made_from)?;
                let empty = read_files(&self.empty, Some(now.unit), &mut made_from)?;
                (now, empty)
            }
        };
        let unit = now.unit;
        if unit == LengthUnit::Metre && self.cell.is_some() {
            let reason = "--cell: the positions of this recording are in metres".to_owned();
            return Err(CliError::Usage(reason));
        }
        let mut settings = self.settings(now.links.iter().chain(&empty.links), &now);
        if let Some(network) = &network {
            settings.pairing_m = settings.pairing_m.min(network.bin_m());
        }
        let count = now.links.len();
        let now = pooled(now, settings.pairing_m);
        let empty = pooled(empty, settings.pairing_m);
        let empty = (!self.empty.is_empty()).then_some(empty.as_slice());
        let extras = Extras {
            persons: true,
            deviation: self.deviation.as_ref().map(|_| MOST_BLOCKS),
            shares_of: self.pixel_asked_for(&settings)?,
        };
        let result = Imager::new(settings)
            .and_then(|mut imager| imager.update(&now, empty, extras))
            .map_err(|problem| ImageError::NoImage {
                path: self.files[0].clone(),
                problem,
            })?;
        let tracks = network
            .filter(|_| self.track.is_some())
            .map(|network| network.track(settings.grid.area));
        // Until here Ctrl-C ends the program at once and leaves nothing; what is begun now is ended.
        let _stop = StopFlag::listen();
        let track = tracks.as_ref().map(Tracks::csv);
        Outputs::open(self)?.write(&result, &settings, (unit, &made_from), track.as_deref())?;
        let mut text = summary(&result, (count, now.len()), unit);
        text.extend(tracks.as_ref().map(Tracks::words));
        let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        written.map_err(|source| CliError::Write {
            path: "standard output".into(),
            source,
        })
    }

    /// Returns the pixel whose links are asked for.
    fn pixel_asked_for(&self, settings: &ImagingSettings) -> Result<Option<usize>, CliError> {
        let Some(at) = self.why else { return Ok(None) };
        let refused = |reason: String| Err(CliError::Usage(format!("--why: {reason}")));
        if !matches!(settings.solver, Solver::Map(..)) {
            return refused("only --solver map knows which links made a pixel".to_owned());
        }
        match settings.grid.pixel_at(at) {
            Some(pixel) => Ok(Some(pixel)),
            None => refused(format!(
                "({}, {}) is outside the area of the image",
                at.x_m, at.y_m
            )),
        }
    }

    fn network(
        &self,
        made_from: &mut Vec<SourceFile>,
    ) -> Result<Option<NetworkRecording>, CliError> {
        let Some(nodes) = &self.nodes else {
            return Ok(None);
        };
        NetworkRecording::read(nodes, &self.files, &self.empty, made_from).map(Some)
    }

    /// Tries whether all outputs can be written, to files of their own.
    fn check_files(&self) -> Result<(), CliError> {
        let outputs: Vec<&PathBuf> = [
            &self.png,
            &self.npy,
            &self.json,
            &self.track,
            &self.deviation,
        ]
        .into_iter()
        .flatten()
        .collect();
        for (index, output) in outputs.iter().enumerate() {
            let mut others = self
                .files
                .iter()
                .chain(&self.empty)
                .chain(&self.nodes)
                .chain(outputs[..index].iter().copied());
            if others.any(|other| is_same_file(output, other)) {
                let reason =
                    "is to be written, but is an input or another output as well".to_owned();
                return Err(CliError::Input {
                    path: output.to_path_buf(),
                    reason,
                });
            }
        }
        // A device or a pipe is opened only once: whoever reads it may take the first end for the last.
        let mut tried = outputs.into_iter().filter(|output| !is_device(output));
        tried
            .try_for_each(|output| PendingFile::open(output).map(drop))
            .map_err(CliError::from)
    }

    /// Returns how the image is made: as the options say, else as the recordings say, else as usual for what the ends of
    /// the links enclose.
    fn settings<'a>(
        &self,
        links: impl Iterator<Item = &'a Link>,
        recording: &Recording,
    ) -> ImagingSettings {
        let output = recording.imaging.as_ref().filter(|_| self.area.is_none());
        let ring = bounds(links);
        let area = self.area.or(recording.area).unwrap_or(ring);
        let subject = if self.empty.is_empty() {
            Subject::Structure
        } else {
            Subject::Change
        };
        let mut settings = match (output, subject) {
            (Some(output), subject) => image_settings(
                &output.imaging,
                area,
                output.reception.sensitivity_dbm,
                subject,
            ),
            (None, Subject::Structure) => ImagingSettings::for_area(area),
            (None, Subject::Change) => ImagingSettings::for_change(area),
        };
        if output.is_none() {
            settings.ring = ring;
        }
        if let Some((columns, rows)) = self.pixels {
            settings.grid = PixelGrid {
                area,
                columns,
                rows,
            };
        }
        if output.is_none() {
            settings.finds = match recording.unit {
                LengthUnit::Metre => FindSettings::IN_METRES,
                LengthUnit::Cell => FindSettings::in_cells(area, self.cell.unwrap_or(CELL_M)),
            };
        }
        let usual = match (self.why, output) {
            (Some(_), _) => Some(SolverName::Map),
            (None, Some(_)) => None,
            (None, None) => Some(SolverName::Auto),
        };
        if let Some(name) = self.solver.or(usual) {
            name.choose(&mut settings);
        }
        if let Some(weights) = self.weights {
            settings.weights = weights.model(&settings);
        }
        if let Some(limit) = self.peaks {
            settings.peaks.limit = limit;
        }
        if let Some(rate) = self.false_finds {
            settings.finds.false_per_image = rate;
        }
        settings
    }
}

fn parse_pixels(text: &str) -> Result<(usize, usize), String> {
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

fn parse_place(text: &str) -> Result<Point, String> {
    let numbers = text.split(',').map(|part| part.trim().parse::<f64>());
    match numbers.collect::<Result<Vec<f64>, _>>().as_deref() {
        Ok([x, y]) if (x + y).is_finite() => Ok(Point::new(*x, *y)),
        _ => Err("expected X,Y such as 8.5,12".to_owned()),
    }
}

fn parse_cell(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|cell_m| (0.001..=1000.0).contains(cell_m))
        .ok_or_else(|| "expected metres, a number from 0.001 to 1000".to_owned())
}

fn parse_rate(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|rate| (1e-6..=1.0).contains(rate))
        .ok_or_else(|| "expected a number from 0.000001 to 1".to_owned())
}

fn parse_area(text: &str) -> Result<Rect, String> {
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

/// Reads a recording.
///
/// # Errors
/// The file cannot be read, or is no recording.
pub(super) fn read_file(path: &Path) -> Result<Recording, CliError> {
    read_with(path, &mut Vec::new(), |text| {
        read_recording(text.as_bytes())
    })
}

/// Reads a file by a parser, and notes that it was read.
///
/// # Errors
/// The file cannot be read, or the parser refuses it.
pub(super) fn read_with<T>(
    path: &Path,
    made_from: &mut Vec<SourceFile>,
    parse: impl Fn(&str) -> Result<T, RecordingError>,
) -> Result<T, CliError> {
    let text = read::text(path)?;
    made_from.push(SourceFile::of(&read::shown(path), text.as_bytes()));
    let wrong = |problem| ImageError::Recording {
        path: path.to_owned(),
        problem,
    };
    Ok(parse(&text).map_err(wrong)?)
}

/// Returns whether two names lead to the same file; one that does not exist yet has only its own name.
fn is_same_file(one: &Path, other: &Path) -> bool {
    let real = |path: &Path| {
        let folder = path
            .parent()
            .filter(|folder| *folder != Path::new(""))
            .unwrap_or(Path::new("."));
        let beside = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
        path.canonicalize().ok().or_else(beside)
    };
    real(one).is_some_and(|one| real(other) == Some(one))
}

/// Reads files that must all have one unit: the given one, else that of the first. The area is that of the first file
/// that names one.
fn read_files(
    paths: &[PathBuf],
    expected: Option<LengthUnit>,
    made_from: &mut Vec<SourceFile>,
) -> Result<Recording, CliError> {
    let (mut links, mut unit, mut area, mut imaging) = (Vec::new(), expected, None, None);
    let mut pooled_in_m = None;
    for path in paths {
        let recording = read_with(path, made_from, |text| read_recording(text.as_bytes()))?;
        let expected = *unit.get_or_insert(recording.unit);
        if recording.unit != expected {
            let (found, expected) = (recording.unit.word(), expected.word());
            return Err(ImageError::MixedUnits {
                path: path.clone(),
                found,
                expected,
            }
            .into());
        }
        links.extend(recording.links);
        area = area.or(recording.area);
        imaging = imaging.or(recording.imaging);
        pooled_in_m = recording.pooled_in_m.filter(|_| paths.len() == 1);
    }
    Ok(Recording {
        links,
        unit: unit.unwrap_or(LengthUnit::Metre),
        area,
        imaging,
        pooled_in_m,
    })
}

/// Returns the smallest rectangle around all ends.
pub(super) fn bounds<'a>(links: impl Iterator<Item = &'a Link>) -> Rect {
    let ends = links.flat_map(|link| [link.from, link.to]);
    ends.map(|at| Rect::new(at, at))
        .reduce(|a, b| {
            let low = Point::new(a.min.x_m.min(b.min.x_m), a.min.y_m.min(b.min.y_m));
            Rect::new(
                low,
                Point::new(a.max.x_m.max(b.max.x_m), a.max.y_m.max(b.max.y_m)),
            )
        })
        .unwrap_or(Rect::new(Point::default(), Point::default()))
}

/// Pools what lies in the same bins, unless it is pooled in such already.
fn pooled(recording: Recording, bin_m: f64) -> Vec<Link> {
    let Recording {
        links, pooled_in_m, ..
    } = recording;
    if pooled_in_m == Some(bin_m) || bin_m <= 0.0 {
        return links;
    }
    let mut bins = LinkBins::new(bin_m, SPOT_M.min(bin_m / 8.0));
    links.iter().for_each(|link| bins.record_link(link));
    bins.links()
}
