//! How an image grew: one of the first packets, of more, of all, as an animated picture.

use std::path::{Path, PathBuf};

use super::counted::counted;
use super::error::CliError;
use super::image::ImageError;
use super::outputs::heat_map;
use super::pictures::colour_range;
use super::recorded;
use super::recording::{LengthUnit, Recording, read_share};
use crate::draw::Picture;
use crate::tomo::{Candidate, Extras, Imager, ImagingSettings, Reconstruction, Solver, TomoError};

/// Shares of the packets, percent.
const PERCENT: [u16; 11] = [5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100];
/// How long an image is shown, and the last one, milliseconds.
const SHOWN_MS: u16 = 500;
const LAST_MS: u16 = 2500;

/// Returns the animation of one recording, which has made the image `last` with these settings. Every image is made as that one
/// was, and has its colours. The first picture of the file, for programs that know no animations, is the last one.
///
/// # Errors
/// Several files, or one without single packets.
pub(super) fn animation(
    files: &[PathBuf],
    empty: Option<&Recording>,
    settings: &ImagingSettings,
    last: &Reconstruction,
) -> Result<Vec<u8>, CliError> {
    let [path] = files else {
        let reason = format!("--progress: found {} recordings, expected one", files.len());
        return Err(CliError::Usage(reason));
    };
    let text = recorded::text(path)?;
    let settings = ImagingSettings {
        solver: decided(settings.solver, last),
        ..*settings
    };
    let (mut frames, mut top) = (Vec::new(), 0.0);
    for percent in PERCENT.into_iter().rev() {
        let wrong = |problem| ImageError::Recording {
            path: path.clone(),
            problem,
        };
        let share = read_share(&text, f64::from(percent) / 100.0).map_err(wrong)?;
        let Some(recording) = share else {
            let reason = "holds pooled links, but --progress needs single packets in their order: \
                          samples.csv (`sim --samples`, `export`) or a JSON recording";
            return Err(CliError::Input {
                path: path.clone(),
                reason: reason.to_owned(),
            });
        };
        let Some((made, unit)) = image(recording, empty, &settings, path)? else {
            continue;
        };
        if percent == 100 {
            let largest = || made.image.values.iter().copied().fold(0.0, f64::max);
            top = colour_range(&made.image).map_or_else(largest, |(_, top)| top);
        }
        let shown_ms = if percent == 100 { LAST_MS } else { SHOWN_MS };
        frames.push((picture(&made, unit, (percent, top))?, shown_ms));
    }
    frames.reverse();
    Picture::animation(&frames).map_err(|error| CliError::Fault(error.to_string()))
}

/// Returns the solver that has made an image: what `auto` decided.
fn decided(solver: Solver, made: &Reconstruction) -> Solver {
    let (Solver::Auto(candidates), Some(choice)) = (solver, &made.choice) else {
        return solver;
    };
    match choice.best {
        Candidate::Points => Solver::Points(candidates.sparse),
        Candidate::NonNegative => Solver::NonNegative(candidates.sparse),
        Candidate::Variation(of) => Solver::Variation(crate::tomo::Candidates {
            variations: candidates.variations.map(|_| of),
            ..candidates
        }),
    }
}

/// Returns the image of some of the packets; `None` when they make none yet.
fn image(
    recording: Recording,
    empty: Option<&Recording>,
    settings: &ImagingSettings,
    path: &Path,
) -> Result<Option<(Reconstruction, LengthUnit)>, CliError> {
    let unit = recording.unit;
    let (links, empty, _) = recording.pooled_for(empty, settings.pairing_m);
    let extras = Extras {
        persons: true,
        ..Extras::default()
    };
    let made = Imager::new(*settings)
        .and_then(|mut imager| imager.update(&links, empty.as_deref(), extras));
    match made {
        Ok(made) => Ok(Some((made, unit))),
        Err(TomoError::NoLinks { .. }) => Ok(None),
        Err(problem) => Err(ImageError::NoImage {
            path: path.to_owned(),
            problem,
        }
        .into()),
    }
}

fn picture(
    made: &Reconstruction,
    unit: LengthUnit,
    (percent, top): (u16, f64),
) -> Result<Picture, CliError> {
    let per_length = format!("dB/{}", unit.word());
    let mut map = heat_map(made, unit, &per_length);
    map.title = format!(
        "The first {percent} % of the packets: {}",
        counted(made.used, "link")
    );
    map.range = (top > 0.0).then_some((0.0, top));
    Picture::of_heat(&map).map_err(|error| CliError::Fault(error.to_string()))
}
