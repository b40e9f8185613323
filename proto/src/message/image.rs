//! Images for whoever shows them. They are rounded to a byte a pixel: whoever reconstructs anew takes the samples.

use serde::{Deserialize, Serialize};

use crate::{Position, RunId};

/// Pixels of a part of an image; the last part may have fewer.
pub const IMAGE_PART_PIXELS: usize = 3072;
/// Most finds of an image.
pub const IMAGE_FINDS_MAX: usize = 32;
/// Most columns, and most rows, of an image.
pub const IMAGE_SIDE_MAX: u16 = 400;

/// What an image shows.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum ImageSubject {
    /// All that stands there.
    Structure,
    /// What has come or gone since the run that it is compared with.
    Change,
}

/// The rectangle that an image covers, along the axes of the venue's local frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Rectangle {
    /// The corner with the least coordinates.
    pub least: Position,
    /// The corner with the greatest coordinates, at the same height.
    pub greatest: Position,
}

/// How uncertain a place is: the covariance of its coordinates, mm².
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Covariance {
    /// Variance along the x axis.
    pub xx_mm2: u32,
    /// Covariance of both.
    pub xy_mm2: i32,
    /// Variance along the y axis.
    pub yy_mm2: u32,
}

/// Something that was found in an image.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Find {
    /// Where.
    pub at: Position,
    /// How uncertain its place is; `None` = not known.
    pub covariance: Option<Covariance>,
    /// The highest pixel, 1e-6 dB/m.
    pub strength_udb_per_m: i32,
    /// How probable it is that something is there; `None` = not known.
    pub probability: Option<crate::Permille>,
}

/// A part of an image: [`IMAGE_PART_PIXELS`] pixels, the last part the rest. Pixels go row by row, from south to north,
/// each row from west to east; positive values are attenuation.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Image {
    /// Of which run.
    pub run: RunId,
    /// Counts the images of the run; parts of the same count belong together.
    pub sequence: u32,
    /// Laps done when it was made.
    pub laps: u32,
    /// What it shows.
    pub subject: ImageSubject,
    /// What it covers.
    pub area: Rectangle,
    /// Columns, from west to east.
    pub columns: u16,
    /// Rows, from south to north.
    pub rows: u16,
    /// Which part this is, from 0.
    pub part: u16,
    /// Of how many.
    pub parts: u16,
    /// One unit of `mean`, 1e-6 dB/m.
    pub mean_step_udb_per_m: u32,
    /// The attenuation of each pixel of this part.
    pub mean: Vec<i8>,
    /// One unit of `deviation`, 1e-6 dB/m.
    pub deviation_step_udb_per_m: u32,
    /// The standard deviation of each pixel of this part; `None` = not known.
    pub deviation: Option<Vec<u8>>,
    /// What was found, strongest first; in the first part only.
    pub finds: Vec<Find>,
    /// Links in the image.
    pub links_used: u32,
    /// Links left out.
    pub links_dropped: u32,
}
