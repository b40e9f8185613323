//! Where on the earth an image of `tomoswarm image` lies: a world file for its picture, and GeoJSON.

use std::path::Path;

use serde_json::json;

use super::earth::world_file;
use super::error::CliError;
use super::outputs::heat_map;
use super::read;
use super::recording::LengthUnit;
use crate::config::{self, Config, SourceFile, Venue};
use crate::dash::geojson::{Features, MadeImage};
use crate::draw::{Overlay, Placement};
use crate::tomo::Reconstruction;

/// The files as text.
pub(super) struct EarthFiles {
    /// The world file of the picture.
    pub(super) world: String,
    /// Area, fence, homes, peaks and finds.
    pub(super) geojson: String,
}

impl EarthFiles {
    /// Makes the files of an image, whose picture shows some overlays beside the usual ones; none without a venue.
    ///
    /// # Errors
    /// The picture cannot be laid out.
    pub(super) fn of(
        venue: Option<&Venue>,
        result: &Reconstruction,
        unit: LengthUnit,
        overlays: impl Iterator<Item = Overlay>,
    ) -> Result<Option<EarthFiles>, CliError> {
        let Some(venue) = venue else {
            return Ok(None);
        };
        let per_length = format!("dB/{}", unit.word());
        let mut heat = heat_map(result, unit, &per_length);
        heat.overlays.extend(overlays);
        let Placement {
            corner,
            metres_per_px,
        } = heat
            .placement()
            .map_err(|error| CliError::Fault(error.to_string()))?;
        let kind = if result.by_empty_sweep {
            "change"
        } else {
            "structure"
        };
        let mut features = Features::of_venue(venue);
        features.image(MadeImage {
            says: &json!({ "kind": kind }),
            peaks: &result.peaks,
            finds: result.finds.as_ref(),
        });
        Ok(Some(EarthFiles {
            world: world_file(&venue.plane(), corner, metres_per_px),
            geojson: features.text(),
        }))
    }
}

/// Reads the venue of a recording.
///
/// # Errors
/// It cannot be read, or is none.
pub(super) fn venue(
    path: Option<&Path>,
    made_from: &mut Vec<SourceFile>,
) -> Result<Option<Venue>, CliError> {
    let Some(path) = path else { return Ok(None) };
    let text = read::text(path)?;
    made_from.push(SourceFile::of(&read::shown(path), text.as_bytes()));
    let mut around = read::around(path);
    match config::read(&read::shown(path), &text, &mut around)? {
        Config::Venue(venue) => Ok(Some(venue)),
        Config::Scene(_)
        | Config::Sim(_)
        | Config::Experiment(_)
        | Config::Vehicle(_)
        | Config::Ground(_)
        | Config::Operator(_) => Err(CliError::Input {
            path: path.to_owned(),
            reason: "found another kind of file, expected kind = \"venue\"".to_owned(),
        }),
    }
}
