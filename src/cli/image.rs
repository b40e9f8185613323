//! `tomoswarm image`: reconstructs an image from recorded links.
//!
//! Files in, files out; the work is done by `tomo`, the files are written by `outputs`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::config::{LinksFile, SourceFile};
use crate::geom::{Point, Rect};
use crate::tomo::{Extras, Imager, ImagingSettings, Link, Solver, TomoError};
use clap::Args;

use super::earth_files::{self, EarthFiles};
use super::error::CliError;
use super::image_checks::{warning_of_itself, warning_of_short};
use super::image_settings::warning_of_part;
use super::image_text::{LinkCounts, offsets_in_words, summary};
use super::image_values::{SolverName, WeightsName};
use super::image_values::{parse_area, parse_cell, parse_pixels, parse_place, parse_rate};
use super::network_recording::{NetworkRecording, Tracks};
use super::outputs::{Made, Outputs, PendingFile, is_device, is_same_file};
use super::progress;
use super::progress_bar::with_steps;
use super::read;
use super::recorded;
use super::recording::{LengthUnit, Recording, RecordingError, read_recording};
use super::standard_output::complain;
use super::stop::StopFlag;
use super::true_places::{Named, TruePlaces, circles, read_places};
use super::volume;

/// Reconstructs an image from recorded links.
///
/// Reads CSV files (header tx_x_m,tx_y_m,rx_x_m,rx_y_m,packets,rssi_dbm; packets may be missing), links.csv and
/// samples.csv files written by tomoswarm, runs of a ground station's store (swarm.db:N, in the build that has stores),
/// with --nodes recordings of a fixed network, and JSON recordings of the 2016 two-rover system. Several files are
/// pooled. With --empty the image shows what changed since the empty sweep, and persons are searched in that; without
/// it, all that stands in the area.
#[derive(Args, Clone, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct ImageCommand {
    /// Recordings of the sweep; a folder of `tomoswarm sim` stands for its links.csv
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// A recording of the same area while nobody was inside; may be given several times. A folder of `tomoswarm sim` stands for
    /// the sweep of that earlier run (links.csv), the folder of the run itself for its empty sweep (empty.csv)
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
    /// How pixels weigh in links [default: as the recording says, for tv, nn, points and auto fresnel; else what suits the
    /// solver: inverse-area for map, line for tikhonov and tsvd, fresnel for the others]
    #[arg(long, value_enum)]
    pub weights: Option<WeightsName>,
    /// Pixels from west to east and from south to north [default: as the recording says, with --area of another shape as many
    /// along the longer side, and square; else 40 along the longer side]
    #[arg(long, value_name = "WxH", value_parser = parse_pixels)]
    pub pixels: Option<(usize, usize)>,
    /// What is imaged, in the units of the input; all else stays as the recording says [default: what the recording names, else
    /// what the positions enclose]
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_area, allow_hyphen_values = true)]
    pub area: Option<Rect>,
    /// How large a cell is when the recording counts in cells of a lattice, metres: what persons and the radio's waves are
    /// compared with [default: 0.3]
    #[arg(long, value_name = "METRES", value_parser = parse_cell, allow_negative_numbers = true)]
    pub cell: Option<f64>,
    /// Makes an image in three dimensions, of so many layers between the lowest and the highest end, with every --solver but
    /// points; --png and --npy then hold all layers, --json the strongest voxel. Takes samples.csv of copters that flew at several
    /// altitudes, and links with heights (the columns tx_z_m and rx_z_m); an empty sweep of such links is one between the same
    /// places. Knows no zones around links (--weights) and no finds, and of samples neither how far places are off nor an image of
    /// what stood in the empty sweep
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub layers: Option<u16>,
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
    /// Draws how much of the links each pixel has seen, and the direction in which the fewest ran there
    #[arg(long, value_name = "FILE")]
    pub coverage: Option<PathBuf>,
    /// Draws the links in the colour of what each has lost, dB
    #[arg(long, value_name = "FILE")]
    pub links: Option<PathBuf>,
    /// Draws what the image leaves unexplained of each link over its length
    #[arg(long, value_name = "FILE")]
    pub residuals: Option<PathBuf>,
    /// Draws how the image grew: an animated PNG of the images from the first 5, 10, 20, ... 100 % of the packets in recorded
    /// order. Needs one recording of single packets: samples.csv, or JSON
    #[arg(long, value_name = "FILE", conflicts_with = "nodes")]
    pub progress: Option<PathBuf>,
    /// The venue of the recording: says where on the earth it lies. Beside the picture of --png a world file is written then
    #[arg(long, value_name = "FILE")]
    pub venue: Option<PathBuf>,
    /// Writes area, fence, homes, peaks and finds for maps of the earth (WGS84)
    #[arg(long, value_name = "FILE", requires = "venue")]
    pub geojson: Option<PathBuf>,
    /// Writes finds, peaks, residual, links used and dropped, and settings
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Where persons truly stood: the marks of the run (run-N-marks.csv of `tomoswarm export`), or a list with the header
    /// x_m,y_m, in the units of the recording. Says how far the nearest find, or without an empty sweep peak, is from each, and
    /// draws them in the picture
    #[arg(long, value_name = "FILE", conflicts_with = "layers")]
    pub marks: Option<PathBuf>,
    /// Most peaks that are listed [default: as the recording says, else 5]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(0..=10_000))]
    pub peaks: Option<u16>,
    /// How many places where nobody stands may be found in an image of a change, on the mean, 0.000001 to 1 [default: as
    /// the recording says, else 0.02]
    #[arg(long, value_name = "RATE", value_parser = parse_rate, allow_negative_numbers = true)]
    pub false_finds: Option<f64>,
}

/// A cell of a lattice whose size nobody says, metres: the rovers that follow its lines are about so wide.
pub(super) const CELL_M: f64 = 0.3;
/// The deviation is exact up to so many pixels: a second or two, and 40 MB.
const MOST_BLOCKS: usize = 1600;

const AFTER_HELP: &str = "\
Positions, areas and peaks are in the units of the input: metres in CSV files, cells of the lattice in JSON recordings.
Positive values are attenuation, dB per unit of length.

Examples:
  tomoswarm image links.csv --empty empty.csv --png image.png        what has changed
  tomoswarm image links.csv --pixels 80x80 --area 0,0,20,20 --npy structure.npy
  tomoswarm image out/courtyard-7 --empty out/courtyard-7 --png again.png   folders of runs; --empty may be another one
  tomoswarm image dump.json --json result.json --peaks 1             the strongest peak, for a script
  tomoswarm image flight/samples.csv --empty flight/empty-samples.csv --layers 6 --png slices.png
  tomoswarm image walk.csv --nodes nodes.csv --empty empty.csv --track track.csv

Exit codes: 0 done; 2 bad usage or recordings, or a file that cannot be written.";

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
        let resolved = self.resolved()?;
        resolved.check_files()?;
        match self.layers {
            Some(layers) => volume::run(&resolved, layers.into(), out),
            None => resolved.make(out),
        }
    }

    /// Returns the command with files in place of folders.
    fn resolved(&self) -> Result<ImageCommand, CliError> {
        let sweep = |path: &PathBuf| recorded::sweep_of(path);
        let empty = |path: &PathBuf| recorded::empty_of(path, &self.files);
        Ok(ImageCommand {
            files: self.files.iter().map(sweep).collect::<Result<_, _>>()?,
            empty: self.empty.iter().map(empty).collect::<Result<_, _>>()?,
            ..self.clone()
        })
    }

    fn make(&self, out: &mut dyn std::io::Write) -> Result<(), CliError> {
        let mut made_from = Vec::new();
        let venue = earth_files::venue(self.venue.as_deref(), &mut made_from)?;
        let network = self.network(&mut made_from)?;
        let stood = match &self.marks {
            Some(marks) => read_with(marks, &mut made_from, read_places)?,
            None => TruePlaces::default(),
        };
        let of_now = made_from.len();
        let mut of_empty = of_now;
        let (now, empty) = match &network {
            Some(network) => (network.now(), network.empty()),
            None => {
                let any = |_: &Path, _: &Recording| Ok(());
                let now = read_files(&self.files, None, &mut made_from, &any)?;
                of_empty = made_from.len();
                let empty = read_files(&self.empty, Some(now.unit), &mut made_from, &any)?;
                self.check_alike(&now, &empty)?;
                (now, empty)
            }
        };
        if let Some(warning) =
            warning_of_itself(&made_from[of_now..of_empty], &made_from[of_empty..])
        {
            complain(&warning);
        }
        self.check_run(&now, &stood)?;
        let stood = stood.places;
        let unit = now.unit;
        self.check_venue(unit, venue.is_some())?;
        if unit == LengthUnit::Metre && self.cell.is_some() {
            let reason = "--cell: the positions of this recording are in metres".to_owned();
            return Err(CliError::Usage(reason));
        }
        let mut settings = self.settings(now.links.iter().chain(&empty.links), &now);
        if let Some(network) = &network {
            settings.pairing_m = settings.pairing_m.min(network.bin_m());
        }
        self.check_area(settings.grid.area)?;
        if let Some(warning) = warning_of_part(self.area, settings.ring) {
            complain(&warning);
        }
        let (count, repeated) = (now.links.len(), now.repeated + empty.repeated);
        let empty_recording = (!self.empty.is_empty()).then_some(empty);
        let (now, empty, offsets) = now.pooled_for(empty_recording.as_ref(), settings.pairing_m);
        let empty = empty.as_deref();
        let extras = Extras {
            persons: true,
            deviation: self.deviation.as_ref().map(|_| MOST_BLOCKS),
            shares_of: self.pixel_asked_for(&settings)?,
            links: true,
        };
        let made = with_steps(|watch| {
            Imager::new(settings)
                .and_then(|mut imager| imager.update_watched(&now, empty, extras, watch))
        });
        let result = made.map_err(|problem| ImageError::NoImage {
            path: self.files[0].clone(),
            problem,
        })?;
        if network.is_none() {
            self.check_partners(result.used, &result.dropped)?;
        }
        self.check_links(result.used, &result.dropped)?;
        let shortest = format!("{:.2} {}", settings.shortest_link_m, unit.word());
        warning_of_short(result.used, &result.dropped, &shortest)
            .iter()
            .for_each(|warning| complain(warning));
        let tracks = network
            .filter(|_| self.track.is_some())
            .map(|network| network.track(settings.grid.area));
        let progress = match self.progress {
            Some(_) => Some(progress::animation(
                &self.files,
                empty_recording.as_ref(),
                &settings,
                &result,
            )?),
            None => None,
        };
        let unit_m = match unit {
            LengthUnit::Metre => 1.0,
            LengthUnit::Cell => self.cell.unwrap_or(CELL_M),
        };
        let earth = EarthFiles::of(venue.as_ref(), &result, unit, circles(&stood, unit_m))?;
        // Until here Ctrl-C ends the program at once and leaves nothing; what is begun now is ended.
        let _stop = StopFlag::listen();
        let track = tracks.as_ref().map(Tracks::csv);
        let counts = LinkCounts {
            read: count,
            repeated,
            pooled: now.len(),
            empty: empty.map(<[_]>::len),
        };
        let made = Made {
            result: &result,
            settings: &settings,
            counts,
            unit,
            unit_m,
            stood: &stood,
            made_from: &made_from,
            track: track.as_deref(),
            progress: progress.as_deref(),
            earth: earth.as_ref(),
        };
        let files = Outputs::open(self)?.filled(&made)?;
        let mut text = summary(&result, counts, unit, &settings);
        text.extend(offsets.map(|offsets| offsets_in_words(&offsets)));
        let named = Named::of(result.finds.as_ref(), &result.peaks);
        text.extend(stood.iter().map(|at| named.words(*at, unit.word()) + "\n"));
        text.extend(tracks.as_ref().map(Tracks::words));
        // A command that ends with an error leaves no file.
        print(out, &text)?;
        Ok(files.finish()?)
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

    /// Returns the world file of the picture, when it is known where on the earth that lies.
    pub(super) fn world_file(&self) -> Option<PathBuf> {
        let png = self
            .png
            .as_ref()
            .filter(|png| self.venue.is_some() && !is_device(png))?;
        Some(png.with_extension("pgw"))
    }

    fn outputs<'a>(&'a self, world: Option<&'a PathBuf>) -> Vec<&'a PathBuf> {
        [
            &self.png,
            &self.npy,
            &self.json,
            &self.track,
            &self.deviation,
            &self.coverage,
            &self.links,
            &self.residuals,
            &self.progress,
            &self.geojson,
        ]
        .into_iter()
        .flatten()
        .chain(world)
        .collect()
    }

    /// Tries whether all outputs can be written, to files of their own.
    fn check_files(&self) -> Result<(), CliError> {
        let world = self.world_file();
        let outputs = self.outputs(world.as_ref());
        let recordings = self.files.iter().chain(&self.empty);
        let inputs: Vec<PathBuf> = recordings
            .flat_map(|path| recorded::files_of(path))
            .collect();
        for (index, output) in outputs.iter().enumerate() {
            let mut others = inputs
                .iter()
                .chain(&self.nodes)
                .chain(&self.venue)
                .chain(&self.marks)
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
}

/// Prints a summary.
///
/// # Errors
/// Standard output takes no more.
pub(super) fn print(out: &mut dyn std::io::Write, text: &str) -> Result<(), CliError> {
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written.map_err(|source| CliError::Write {
        path: "standard output".into(),
        source,
    })
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
    let text = recorded::text(path)?;
    made_from.push(SourceFile::of(&read::shown(path), text.as_bytes()));
    let wrong = |problem| ImageError::Recording {
        path: path.to_owned(),
        problem,
    };
    Ok(parse(&text).map_err(wrong)?)
}

/// Reads files that must all have one unit, the given one, else that of the first, and pass a check. The area is that of the
/// first file that names one.
///
/// # Errors
/// A file that cannot be read, is no recording, or not one as the others are; what the check says of one.
pub(super) fn read_files(
    paths: &[PathBuf],
    expected: Option<LengthUnit>,
    made_from: &mut Vec<SourceFile>,
    check: &dyn Fn(&Path, &Recording) -> Result<(), CliError>,
) -> Result<Recording, CliError> {
    let (mut links, mut unit, mut area, mut imaging) = (Vec::new(), expected, None, None);
    let (mut pooled_in_m, mut channels, mut devices) = (None, BTreeSet::new(), Vec::new());
    let (mut is_without_offsets, mut runs) = (!paths.is_empty(), BTreeSet::new());
    let (mut known, mut repeated) = (BTreeMap::new(), 0);
    let (mut heights_m, mut is_of_samples) = (Vec::new(), false);
    for path in paths {
        let mut recording = read_with(path, made_from, |text| read_recording(text.as_bytes()))?;
        check(path, &recording)?;
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
        recording
            .leave_out_known(path, &mut known)
            .map_err(|problem| ImageError::Recording {
                path: path.clone(),
                problem,
            })?;
        repeated += recording.repeated;
        devices.resize(links.len(), None);
        links.extend(recording.links);
        heights_m.extend(recording.heights_m);
        is_of_samples |= recording.is_of_samples;
        devices.extend(recording.devices);
        channels.extend(recording.channels);
        runs.extend(recording.runs);
        is_without_offsets &= recording.is_without_offsets;
        area = area.or(recording.area);
        let own = recording.imaging.as_ref();
        let is_other = |first: &LinksFile| {
            own.is_some_and(|own| own.area != first.area || own.imaging != first.imaging)
        };
        if imaging.as_ref().is_some_and(is_other) {
            let (path, first) = (path.display(), paths[0].display());
            complain(&format_args!(
                "warning: {path}: its head says another area or [imaging] than the files before it, from {first} on, which count"
            ));
        }
        imaging = imaging.or(recording.imaging);
        pooled_in_m = recording.pooled_in_m.filter(|_| paths.len() == 1);
    }
    // Without those of one file nobody knows which link the others are of.
    heights_m.truncate(if heights_m.len() == links.len() {
        links.len()
    } else {
        0
    });
    Ok(Recording {
        links,
        unit: unit.unwrap_or(LengthUnit::Metre),
        area,
        imaging,
        pooled_in_m,
        is_without_offsets,
        is_of_samples,
        runs,
        channels,
        heights_m,
        without_heights: None,
        in_time: Vec::new(),
        devices,
        keyed: Vec::new(),
        repeated,
    })
}

/// Returns the smallest rectangle around all ends.
pub(super) fn bounds<'a>(links: impl Iterator<Item = &'a Link>) -> Rect {
    let ends = links.flat_map(|link| [link.from, link.to]);
    Rect::around(ends).unwrap_or(Rect::new(Point::default(), Point::default()))
}
