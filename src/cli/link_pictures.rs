//! Pictures of the links behind an image: what they have seen, what each has lost, and what the image leaves unexplained.

use super::counted::counted;
use super::error::CliError;
use super::pictures::drawn;
use crate::draw::{HeatMap, LinkMap, Overlay, Picture, Scatter};
use crate::geom::{Angle, Vector};
use crate::tomo::{Coverage, ImagedLink, ImagingSettings, coverage};

/// Directions are shown at so many places along the longer side.
const DIRECTIONS_SHOWN: usize = 14;
/// Less than this is missing of no direction.
const LEAST_LACK: f64 = 0.2;
/// The colours of links end at the value that this share of them is below.
const COLOURED: f64 = 0.99;

/// The links of an image.
#[derive(Clone, Copy)]
pub(super) struct LinkPictures<'a> {
    /// As the image explains them.
    pub(super) links: &'a [ImagedLink],
    /// How it was made.
    pub(super) settings: &'a ImagingSettings,
    /// The unit of lengths.
    pub(super) unit: &'a str,
    /// Whether an empty sweep was subtracted.
    pub(super) by_empty_sweep: bool,
}

impl LinkPictures<'_> {
    /// Draws how much of the links each pixel has seen, and from where least.
    ///
    /// # Errors
    /// The picture cannot be made.
    pub(super) fn coverage(&self) -> Result<Vec<u8>, CliError> {
        let seen = coverage(self.links.iter(), self.settings);
        drawn(Picture::heat(&HeatMap {
            title: format!(
                "What is seen of each pixel by {}",
                counted(self.links.len(), "link")
            ),
            grid: seen.grid,
            values: &seen.lengths_m(),
            unit: &format!("{} of links", self.unit),
            length_unit: self.unit,
            overlays: directions(&seen),
            range: None,
        }))
    }

    /// Draws the links in the colour of their loss.
    ///
    /// # Errors
    /// The picture cannot be made.
    pub(super) fn losses(&self) -> Result<Vec<u8>, CliError> {
        let losses = self
            .links
            .iter()
            .map(|link| (link.from, link.to, link.attenuation_db));
        let losses: Vec<_> = losses.collect();
        let mut sorted: Vec<f64> = losses.iter().map(|(_, _, loss_db)| *loss_db).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        let top_db = sorted.get((last as f64 * COLOURED) as usize).copied();
        let beyond = if self.by_empty_sweep {
            "the empty sweep"
        } else {
            "free space"
        };
        drawn(Picture::links(&LinkMap {
            title: format!(
                "Loss of {} beyond {beyond}",
                counted(self.links.len(), "link")
            ),
            area: self.settings.ring,
            links: &losses,
            unit: "dB",
            length_unit: self.unit,
            overlays: vec![Overlay::Area {
                rect: self.settings.grid.area,
            }],
            range: top_db
                .filter(|top_db| *top_db > 0.0)
                .map(|top_db| (0.0, top_db)),
        }))
    }

    /// Draws what the image leaves unexplained of each link over its length.
    ///
    /// # Errors
    /// The picture cannot be made.
    pub(super) fn residuals(&self) -> Result<Vec<u8>, CliError> {
        let points: Vec<(f64, f64)> = self
            .links
            .iter()
            .map(|link| (link.length_m(), link.residual_db))
            .collect();
        let squares: f64 = points
            .iter()
            .map(|(_, residual_db)| residual_db * residual_db)
            .sum();
        let rms_db = (squares / points.len().max(1) as f64).sqrt();
        drawn(Picture::scatter(&Scatter {
            title: format!("Unexplained loss over length, rms {rms_db:.2} dB"),
            x_name: &format!("length of the link ({})", self.unit),
            y_name: "measured - image (dB)",
            points: &points,
            meaning: &format!("a link, {} in all", points.len()),
        }))
    }
}

/// Returns the least covered directions at places on a coarse grid, the longer the more is missing.
fn directions(seen: &Coverage) -> Vec<Overlay> {
    let grid = seen.grid;
    let step = (grid.columns.max(grid.rows) / DIRECTIONS_SHOWN).max(1);
    let side_m = step as f64 * grid.dx_m().min(grid.dy_m());
    let of_pixel = |pixel: usize| {
        let (direction_rad, lack) = seen.least_covered(pixel)?;
        let half = Vector::polar(Angle::from_radians(direction_rad), 0.45 * side_m * lack);
        (lack >= LEAST_LACK).then(|| Overlay::Direction {
            at: grid.centre(pixel),
            half,
            meaning: "fewest links run this way",
        })
    };
    let middles = |count: usize| (step / 2..count).step_by(step);
    middles(grid.rows)
        .flat_map(|row| middles(grid.columns).map(move |column| grid.index(column, row)))
        .filter_map(of_pixel)
        .collect()
}
