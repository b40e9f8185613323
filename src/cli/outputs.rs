//! The files that `tomoswarm image` writes: the picture, the values and the report.
//!
//! Whether they can be written is tried before the work; they appear under their names only when all are complete.

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::earth_files::EarthFiles;
use super::error::CliError;
use super::image::{ImageCommand, ImageError};
use super::image_text::LinkCounts;
use super::link_pictures::LinkPictures;
use super::pictures::{colour_range, drawn, heat_title, marks};
use super::recording::LengthUnit;
use super::reference::Reference;
use super::true_places::{Named, circles};
use crate::config::SourceFile;
use crate::draw::{HeatMap, Picture, described};
use crate::geom::{Point, Rect};
use crate::tomo::{
    Candidates, Choice, DropReason, DroppedLinks, Find, FindSettings, Finds, Image,
    ImagingSettings, LinkShare, Peak, PixelShares, Reconstruction, Score, Solver, Sparse,
    Variation, WeightModel, npy_bytes,
};

/// The files to be written, open under temporary names.
#[derive(Default)]
pub(super) struct Outputs {
    png: Option<PendingFile>,
    npy: Option<PendingFile>,
    json: Option<PendingFile>,
    track: Option<PendingFile>,
    deviation: Option<PendingFile>,
    coverage: Option<PendingFile>,
    links: Option<PendingFile>,
    residuals: Option<PendingFile>,
    progress: Option<PendingFile>,
    world: Option<PendingFile>,
    geojson: Option<PendingFile>,
}

/// What is written.
pub(super) struct Made<'a> {
    /// The image.
    pub(super) result: &'a Reconstruction,
    /// How it was made.
    pub(super) settings: &'a ImagingSettings,
    /// How many links there were.
    pub(super) counts: LinkCounts,
    /// The unit of lengths.
    pub(super) unit: LengthUnit,
    /// How long that is, metres.
    pub(super) unit_m: f64,
    /// Where persons truly stood, as far as that is known.
    pub(super) stood: &'a [Point],
    /// Of which files.
    pub(super) made_from: &'a [SourceFile],
    /// Where persons were, as CSV.
    pub(super) track: Option<&'a str>,
    /// How the image grew, as a picture.
    pub(super) progress: Option<&'a [u8]>,
    /// Where it lies on the earth.
    pub(super) earth: Option<&'a EarthFiles>,
}

impl Outputs {
    /// Opens all files that a command asks for.
    ///
    /// # Errors
    /// One cannot be written.
    pub(super) fn open(command: &ImageCommand) -> Result<Outputs, ImageError> {
        let open = |path: &Option<PathBuf>| path.as_deref().map(PendingFile::open).transpose();
        Ok(Outputs {
            png: open(&command.png)?,
            npy: open(&command.npy)?,
            json: open(&command.json)?,
            track: open(&command.track)?,
            deviation: open(&command.deviation)?,
            coverage: open(&command.coverage)?,
            links: open(&command.links)?,
            residuals: open(&command.residuals)?,
            progress: open(&command.progress)?,
            world: open(&command.world_file())?,
            geojson: open(&command.geojson)?,
        })
    }

    /// Writes all; none has its name yet.
    ///
    /// # Errors
    /// One cannot be written or drawn; then none gets its name.
    pub(super) fn filled(mut self, made: &Made<'_>) -> Result<Outputs, CliError> {
        let Made {
            result,
            settings,
            unit,
            unit_m,
            stood,
            made_from,
            ..
        } = *made;
        let about = about(made_from);
        let per_length = format!("dB/{}", unit.word());
        let text = |text: Option<&str>| Ok(text.unwrap_or_default().as_bytes().to_vec());
        fill(&mut self.png, || {
            let mut heat = heat_map(result, unit, &per_length);
            heat.overlays.extend(circles(stood, unit_m));
            Ok(described(drawn(Picture::heat(&heat))?, &about))
        })?;
        fill(&mut self.npy, || Ok(npy_bytes(&result.image)))?;
        fill(&mut self.json, || {
            let mut report = report(made);
            let named = Named::of(result.finds.as_ref(), &result.peaks);
            report["marks"] = (!stood.is_empty()).then(|| named.json(stood)).into();
            Ok(format!("{report:#}\n").into_bytes())
        })?;
        fill(&mut self.track, || {
            let of = format!("# {about}\n{}", made.track.unwrap_or_default());
            Ok(of.into_bytes())
        })?;
        let is_picture = |file: &Option<PendingFile>| {
            let path = file.as_ref().map(|file| &file.path);
            path.is_some_and(|path| path.extension().is_some_and(|end| end == "png"))
        };
        let is_drawn = is_picture(&self.deviation);
        fill(&mut self.deviation, || {
            let deviation = deviation_of(result)?;
            Ok(match is_drawn {
                true => described(deviation_picture(&deviation, unit.word())?, &about),
                false => npy_bytes(&deviation),
            })
        })?;
        let of_links = LinkPictures {
            links: result.links.as_deref().unwrap_or_default(),
            settings,
            unit: unit.word(),
            by_empty_sweep: result.by_empty_sweep,
        };
        fill(&mut self.coverage, || {
            Ok(described(of_links.coverage()?, &about))
        })?;
        fill(&mut self.links, || {
            Ok(described(of_links.losses()?, &about))
        })?;
        fill(&mut self.residuals, || {
            Ok(described(of_links.residuals()?, &about))
        })?;
        fill(&mut self.progress, || {
            Ok(described(
                made.progress.unwrap_or_default().to_vec(),
                &about,
            ))
        })?;
        fill(&mut self.world, || {
            text(made.earth.map(|earth| earth.world.as_str()))
        })?;
        fill(&mut self.geojson, || {
            text(made.earth.map(|earth| earth.geojson.as_str()))
        })?;
        Ok(self)
    }

    /// Gives all their names.
    ///
    /// # Errors
    /// One cannot be renamed.
    pub(super) fn finish(self) -> Result<(), ImageError> {
        self.all().try_for_each(PendingFile::finish)
    }

    fn all(self) -> impl Iterator<Item = PendingFile> {
        [
            self.png,
            self.npy,
            self.json,
            self.track,
            self.deviation,
            self.coverage,
            self.links,
            self.residuals,
            self.progress,
            self.world,
            self.geojson,
        ]
        .into_iter()
        .flatten()
    }
}

/// Writes a file, if it is wanted.
fn fill(
    file: &mut Option<PendingFile>,
    bytes: impl Fn() -> Result<Vec<u8>, CliError>,
) -> Result<(), CliError> {
    match file {
        Some(file) => Ok(file.fill(&bytes()?)?),
        None => Ok(()),
    }
}

/// Returns in a line which program has made something of which files.
pub(super) fn about(made_from: &[SourceFile]) -> String {
    let file = |file: &SourceFile| format!("{} (SHA-256 {})", file.file, file.sha256);
    let files: Vec<String> = made_from.iter().map(file).collect();
    let version = env!("CARGO_PKG_VERSION");
    format!("made by tomoswarm {version} from {}", files.join(", "))
}

/// A file under a temporary name in its folder; it gets its name when complete and vanishes otherwise.
pub(super) struct PendingFile {
    path: PathBuf,
    /// `None` for a device or a pipe, which is written as it is.
    temporary: Option<PathBuf>,
    file: fs::File,
}

impl PendingFile {
    /// Opens a file under its temporary name, or a device as it is.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn open(path: &Path) -> Result<PendingFile, ImageError> {
        let failed = |source| ImageError::Unwritable {
            path: path.to_owned(),
            source,
        };
        let name = path
            .file_name()
            .ok_or_else(|| failed(std::io::ErrorKind::IsADirectory.into()))?;
        if path.is_dir() {
            return Err(failed(std::io::ErrorKind::IsADirectory.into()));
        }
        if is_device(path) {
            let file = fs::File::options().write(true).open(path).map_err(failed)?;
            return Ok(PendingFile {
                path: path.to_owned(),
                temporary: None,
                file,
            });
        }
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}.part", std::process::id()));
        let temporary = path.with_file_name(hidden);
        let file = fs::File::create(&temporary).map_err(failed)?;
        Ok(PendingFile {
            path: path.to_owned(),
            temporary: Some(temporary),
            file,
        })
    }

    /// Writes what is in it.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn fill(&mut self, bytes: &[u8]) -> Result<(), ImageError> {
        let path = self.path.clone();
        self.file
            .write_all(bytes)
            .map_err(|source| ImageError::Unwritable { path, source })
    }

    /// Gives it its name.
    ///
    /// # Errors
    /// It cannot be renamed.
    pub(super) fn finish(self) -> Result<(), ImageError> {
        let path = self.path.clone();
        let Some(temporary) = &self.temporary else {
            return Ok(());
        };
        fs::rename(temporary, &self.path).map_err(|source| ImageError::Unwritable { path, source })
    }
}

impl Drop for PendingFile {
    fn drop(&mut self) {
        // After the renaming there is nothing left to remove, and that is fine.
        let _ = self.temporary.as_ref().map(fs::remove_file);
    }
}

/// Returns what the picture of an image shows, with the strongest places marked.
pub(super) fn heat_map<'a>(
    result: &'a Reconstruction,
    unit: LengthUnit,
    per_length: &'a str,
) -> HeatMap<'a> {
    let Image { grid, values } = &result.image;
    let seen = if result.by_empty_sweep {
        "What changed since the empty sweep"
    } else {
        "What stands there"
    };
    HeatMap {
        title: heat_title(seen, result.used, result.finds.as_ref()),
        grid: *grid,
        values,
        unit: per_length,
        length_unit: unit.word(),
        overlays: marks(result.finds.as_ref(), &result.peaks),
        range: colour_range(&result.image),
    }
}

/// Returns the deviation of an image as an image.
fn deviation_of(result: &Reconstruction) -> Result<Image, CliError> {
    let none = || CliError::Fault("the numbers of the links leave no deviation".to_owned());
    Ok(Image {
        grid: result.image.grid,
        values: result.deviation.clone().ok_or_else(none)?,
    })
}

/// Returns the picture of a deviation.
pub(super) fn deviation_picture(deviation: &Image, unit: &str) -> Result<Vec<u8>, CliError> {
    let values = || deviation.values.iter().copied();
    let (least, most) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    // They differ little: the colours begin at the least of them.
    let range = (least < most).then_some((least, most));
    drawn(Picture::heat(&HeatMap {
        title: "How sure the image is: standard deviation".to_owned(),
        grid: deviation.grid,
        values: &deviation.values,
        unit: &format!("dB/{unit}"),
        length_unit: unit,
        overlays: Vec::new(),
        range,
    }))
}

/// Returns the content of the JSON output.
fn report(made: &Made<'_>) -> Value {
    let Made {
        result,
        settings,
        unit,
        unit_m,
        counts,
        made_from,
        ..
    } = *made;
    let peak = |peak: &Peak| {
        json!({"x": peak.at.x_m, "y": peak.at.y_m, "strength": peak.strength, "significance": peak.significance,
            "is_faint": peak.is_faint()})
    };
    let law = result.path_loss.map(|law| {
        json!({"p0_dbm": law.p0_dbm, "exponent": law.exponent, "residual_db": law.residual_db, "links": law.links})
    });
    json!({
        "finds": finds_json(result.finds.as_ref(), &settings.finds),
        "peaks": result.peaks.iter().map(peak).collect::<Vec<_>>(),
        "residual_rms_db": result.residual_rms_db,
        "links": {"used": result.used, "dropped": dropped_json(&result.dropped), "repeated_samples": counts.repeated},
        "path_loss": law,
        "reference": Reference::of(counts.empty, result.path_loss).map(Reference::to_json),
        "why": result.shares.as_ref().map(shares_json),
        "choice": result.choice.as_ref().map(choice_json),
        "settings": settings_json(settings, (unit, unit_m), result.by_empty_sweep),
        "version": env!("CARGO_PKG_VERSION"),
        "made_from": made_from,
    })
}

/// Returns how many links were left out as the JSON output shows it.
pub(super) fn dropped_json(dropped: &DroppedLinks) -> Value {
    let of_reason =
        |(reason, count): (&DropReason, &usize)| json!({"reason": reason.words(), "links": count});
    dropped.iter().map(of_reason).collect()
}

/// Returns who was found as the JSON output shows it; nothing without an empty sweep. The next one `passes` where somebody is
/// there and the links cannot tell where.
fn finds_json(finds: Option<&Finds>, settings: &FindSettings) -> Value {
    let Some(finds) = finds else {
        return Value::Null;
    };
    let find = |find: &Find| {
        let [xx, xy, yy] = find.covariance_m2;
        json!({"x": find.at.x_m, "y": find.at.y_m, "strength": find.strength, "covariance": [[xx, xy], [xy, yy]],
            "evidence": find.evidence, "probability": find.probability})
    };
    let next = finds.next.as_ref().map(|next| {
        let mut shown = find(next);
        shown["passes"] = finds.unlocated(settings).is_some().into();
        shown
    });
    json!({
        "found": finds.found.iter().map(find).collect::<Vec<_>>(),
        "next": next,
        "threshold": finds.threshold,
        "false_per_image": finds.false_per_image,
    })
}

/// Returns what made a pixel as the JSON output shows it.
fn shares_json(shares: &PixelShares) -> Value {
    let link = |link: &LinkShare| {
        json!({"from": [link.from.x_m, link.from.y_m], "to": [link.to.x_m, link.to.y_m], "share": link.share,
            "attenuation_db": link.attenuation_db, "sd_db": link.sd_db, "residual_db": link.residual_db,
            "packets": link.packets, "misses": link.misses})
    };
    json!({"x": shares.at.x_m, "y": shares.at.y_m, "value": shares.value,
        "links": shares.links.iter().map(link).collect::<Vec<_>>()})
}

/// Returns a choice as the JSON output shows it.
pub(super) fn choice_json(choice: &Choice) -> Value {
    let score = |score: &Score| {
        json!({"solver": score.candidate.words(), "likelihood": score.likelihood,
            "behind": score.behind, "behind_sd": score.behind_sd})
    };
    json!({"solver": choice.best.words(), "scores": choice.scores.iter().map(score).collect::<Vec<_>>()})
}

/// Returns a solver as the JSON output shows it, with what it believes.
pub(super) fn solver_json(solver: &Solver) -> Value {
    let sparse = |name: &str, of: Sparse| {
        let Sparse { prior, sparsity } = of;
        let (variance, length_m) = (prior.variance, prior.length_m);
        json!({"name": name, "prior_variance": variance, "prior_length": length_m, "sparsity": sparsity})
    };
    let variations = |candidates: &Candidates| -> Vec<Value> {
        let of = |one: &Variation| json!({"weight": one.weight, "sparsity": one.sparsity});
        candidates.variations.iter().map(of).collect()
    };
    match *solver {
        Solver::Map(prior, _) => {
            json!({"name": "map", "prior_variance": prior.variance, "prior_length": prior.length_m})
        }
        Solver::Tikhonov { alpha_m2 } => json!({"name": "tikhonov", "alpha": alpha_m2}),
        Solver::Tsvd { share } => json!({"name": "tsvd", "share": share}),
        Solver::Variation(candidates) => {
            json!({"name": "tv", "variations": variations(&candidates)})
        }
        Solver::NonNegative(prior) => sparse("nn", prior),
        Solver::Points(prior) => sparse("points", prior),
        Solver::Auto(candidates) => {
            let mut auto = sparse("auto", candidates.sparse);
            auto["variations"] = variations(&candidates).into();
            auto
        }
    }
}

/// Returns the settings as the JSON output shows them.
fn settings_json(
    settings: &ImagingSettings,
    (unit, unit_m): (LengthUnit, f64),
    by_empty_sweep: bool,
) -> Value {
    let corners = |area: Rect| [area.min.x_m, area.min.y_m, area.max.x_m, area.max.y_m];
    let cell_m = match unit {
        LengthUnit::Metre => None,
        LengthUnit::Cell => Some(unit_m),
    };
    let weights = match settings.weights {
        WeightModel::Line => json!({"name": "line"}),
        WeightModel::Ellipse { width_m } => json!({"name": "ellipse", "width": width_m}),
        WeightModel::InverseArea { width_m } => json!({"name": "inverse-area", "width": width_m}),
        WeightModel::Gaussian { sd_m } => json!({"name": "gaussian", "sd": sd_m}),
        WeightModel::Exponential { decay_m } => json!({"name": "exponential", "decay": decay_m}),
        WeightModel::Fresnel { wavelength_m } => {
            json!({"name": "fresnel", "wavelength": wavelength_m})
        }
    };
    json!({
        "unit": unit.word(),
        "cell_m": cell_m,
        "area": corners(settings.grid.area),
        "ring": corners(settings.ring),
        "pixels": [settings.grid.columns, settings.grid.rows],
        "bin": settings.pairing_m,
        "sensitivity_dbm": settings.noise.sensitivity_dbm,
        "solver": solver_json(&settings.solver),
        "weights": weights,
        "empty_sweep": by_empty_sweep,
        "shortest_link": settings.shortest_link_m,
        "rim": settings.peaks.rim_m,
        "peak_separation": settings.peaks.separation_m,
        "most_peaks": settings.peaks.limit,
        "false_finds": settings.finds.false_per_image,
    })
}

/// Returns whether two names lead to the same file, also as hard links to it; one that does not exist yet has only its own
/// name.
pub(super) fn is_same_file(one: &Path, other: &Path) -> bool {
    let real = |path: &Path| {
        let folder = path
            .parent()
            .filter(|folder| *folder != Path::new(""))
            .unwrap_or(Path::new("."));
        let beside = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
        path.canonicalize().ok().or_else(beside)
    };
    let number = |path: &Path| path.metadata().ok().map(|known| (known.dev(), known.ino()));
    let is_one_file = number(one).is_some_and(|one| number(other) == Some(one));
    is_one_file || real(one).is_some_and(|one| real(other) == Some(one))
}

/// Returns whether something is there that is neither a file nor a folder.
pub(super) fn is_device(path: &Path) -> bool {
    path.metadata()
        .is_ok_and(|known| !known.is_file() && !known.is_dir())
}
