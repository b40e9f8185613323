//! Images as the ground station says them to operators: in parts, when one was made, and all newest ones again every 30 s,
//! for who has come meanwhile. It makes no image, and says nothing of one that could not be made.
//!
//! Images of a run are counted over all starts of the software: the boot's number stands before the count.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm_proto::{
    Boot, Covariance, Find, IMAGE_PART_PIXELS, IMAGE_SIDE_MAX, Image, ImageSubject, Permille,
    Position, Rectangle,
};

use super::imager::{ReconstructedImage, Subject};
use crate::time::Time;
use crate::tomo::Reconstruction;

/// The newest images are said again after this time.
const AGAIN: Duration = Duration::from_secs(30);
/// Finds that are named at most.
const FINDS: usize = 32;
/// The largest number of a pixel.
const PIXEL_MOST: f64 = 127.0;

/// What is said of images.
#[derive(Debug)]
pub struct ImageReports {
    boot: Boot,
    made: u16,
    newest: BTreeMap<Subject, Vec<Image>>,
    again_at: Time,
}

impl ImageReports {
    /// Makes it for one start of the software.
    pub fn new(boot: Boot) -> ImageReports {
        ImageReports {
            boot,
            made: 0,
            newest: BTreeMap::new(),
            again_at: Time::ZERO,
        }
    }

    /// Takes an image that was made; returns its parts.
    pub fn made(&mut self, now: Time, image: &ReconstructedImage) -> Vec<Image> {
        let Ok(reconstruction) = &image.result else {
            return Vec::new();
        };
        self.made = self.made.saturating_add(1);
        let sequence = (self.boot.0 << 16) | u32::from(self.made);
        let parts = parts(image, reconstruction, sequence);
        self.again_at = now + AGAIN;
        self.newest.insert(image.subject, parts.clone());
        parts
    }

    /// Returns all parts that are to be said again.
    pub fn due(&mut self, now: Time) -> Vec<Image> {
        if now < self.again_at || self.newest.is_empty() {
            return Vec::new();
        }
        self.again_at = now + AGAIN;
        self.newest.values().flatten().cloned().collect()
    }
}

/// Returns the parts of an image; none of one that is larger than the wire carries.
fn parts(image: &ReconstructedImage, made: &Reconstruction, sequence: u32) -> Vec<Image> {
    let grid = made.image.grid;
    let side = |pixels: usize| u16::try_from(pixels).ok().filter(|n| *n <= IMAGE_SIDE_MAX);
    let (Some(columns), Some(rows)) = (side(grid.columns), side(grid.rows)) else {
        return Vec::new();
    };
    let most_udb = made
        .image
        .values
        .iter()
        .fold(0.0_f64, |most, value| most.max(value.abs()))
        * 1e6;
    let step_udb = (most_udb / PIXEL_MOST)
        .ceil()
        .clamp(1.0, f64::from(u32::MAX));
    let pixel = |value: &f64| (value * 1e6 / step_udb).round() as i8;
    let finds = finds(made);
    let pieces = made.image.values.chunks(IMAGE_PART_PIXELS);
    let count = pieces.len() as u16;
    let part = |(part, values): (usize, &[f64])| Image {
        run: image.run,
        sequence,
        laps: image.laps as u32,
        subject: match image.subject {
            Subject::Change => ImageSubject::Change,
            Subject::Structure => ImageSubject::Structure,
        },
        area: Rectangle {
            least: Position::from(grid.area.min),
            greatest: Position::from(grid.area.max),
        },
        columns,
        rows,
        part: part as u16,
        parts: count,
        mean_step_udb_per_m: step_udb as u32,
        mean: values.iter().map(pixel).collect(),
        deviation_step_udb_per_m: 1,
        deviation: None,
        finds: if part == 0 { finds.clone() } else { Vec::new() },
        links_used: made.used as u32,
        links_dropped: made.dropped.values().sum::<usize>() as u32,
    };
    pieces.enumerate().map(part).collect()
}

/// Returns who was found, or the places that are clearly above the noise where nobody is looked for.
fn finds(made: &Reconstruction) -> Vec<Find> {
    let udb = |strength: f64| (strength * 1e6) as i32;
    let mm2 = |m2: f64| m2 * 1e6;
    let finds: Vec<Find> = match &made.finds {
        Some(finds) => finds
            .found
            .iter()
            .map(|find| Find {
                at: Position::from(find.at),
                covariance: Some(Covariance {
                    xx_mm2: mm2(find.covariance_m2[0]) as u32,
                    xy_mm2: mm2(find.covariance_m2[1]) as i32,
                    yy_mm2: mm2(find.covariance_m2[2]) as u32,
                }),
                strength_udb_per_m: udb(find.strength),
                probability: Permille::from_fraction(find.probability),
            })
            .collect(),
        None => made
            .peaks
            .iter()
            .filter(|peak| !peak.is_faint())
            .map(|peak| Find {
                at: Position::from(peak.at),
                covariance: None,
                strength_udb_per_m: udb(peak.strength),
                probability: None,
            })
            .collect(),
    };
    finds.into_iter().take(FINDS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{PixelGrid, Point, Rect};
    use crate::tomo::{DroppedLinks, Peak};
    use tomoswarm_proto::{Message, RunId, codec};

    fn picture(columns: usize, rows: usize, values: Vec<f64>) -> ReconstructedImage {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(4.0, 2.0));
        let peak = |significance| Peak {
            at: Point::new(1.0, 1.0),
            strength: 2.0,
            significance,
        };
        let reconstruction = Reconstruction {
            image: crate::tomo::Image {
                grid: PixelGrid {
                    area,
                    columns,
                    rows,
                },
                values,
            },
            peaks: vec![peak(9.0), peak(1.0)],
            residual_rms_db: 1.0,
            used: 7,
            dropped: DroppedLinks::default(),
            path_loss: None,
            by_empty_sweep: false,
            finds: None,
        };
        ReconstructedImage {
            run: RunId(2),
            laps: 3,
            subject: Subject::Structure,
            result: Ok(reconstruction),
        }
    }

    fn at(at_s: f64) -> Time {
        Time::from_secs_f64(at_s)
    }

    #[test]
    fn the_parts_of_an_image_hold_all_pixels_within_half_a_step_and_travel() {
        let values: Vec<f64> = (0..100 * 60)
            .map(|i| f64::from(i % 50) / 20.0 - 0.3)
            .collect();
        let image = picture(100, 60, values.clone());
        let parts = ImageReports::new(Boot(3)).made(at(0.0), &image);
        assert_eq!(parts.len(), 2);
        let step = f64::from(parts[0].mean_step_udb_per_m) / 1e6;
        let read: Vec<f64> = parts
            .iter()
            .flat_map(|part| part.mean.iter().map(|pixel| f64::from(*pixel) * step))
            .collect();
        assert_eq!(read.len(), values.len());
        for (read, value) in read.iter().zip(&values) {
            assert!((read - value).abs() <= step / 2.0 + 1e-9, "{read} {value}");
        }
        for part in parts {
            codec::encode(&Message::Image(part)).unwrap();
        }
    }

    #[test]
    fn faint_peaks_are_no_finds_and_the_first_part_alone_names_them() {
        let parts = ImageReports::new(Boot(3)).made(at(0.0), &picture(100, 60, vec![0.1; 6000]));
        let finds: Vec<usize> = parts.iter().map(|part| part.finds.len()).collect();
        assert_eq!(finds, [1, 0]);
    }

    #[test]
    fn an_image_is_said_again_every_thirty_seconds_and_a_newer_one_counts_on() {
        let mut reports = ImageReports::new(Boot(1));
        assert_eq!(reports.due(at(99.0)), []);
        let first = reports.made(at(100.0), &picture(2, 2, vec![1.0; 4]));
        assert_eq!(reports.due(at(129.9)), []);
        assert_eq!(reports.due(at(130.0)), first);
        let second = reports.made(at(131.0), &picture(2, 2, vec![2.0; 4]));
        assert!(second[0].sequence > first[0].sequence);
        assert_eq!(reports.due(at(161.0)), second);
        let later = ImageReports::new(Boot(2)).made(at(0.0), &picture(2, 2, vec![1.0; 4]));
        assert!(later[0].sequence > second[0].sequence);
    }

    #[test]
    fn an_image_that_could_not_be_made_is_not_said() {
        let mut reports = ImageReports::new(Boot(1));
        let failed = ReconstructedImage {
            result: Err("no links".to_owned()),
            ..picture(1, 1, vec![0.0])
        };
        assert_eq!(reports.made(at(0.0), &failed), []);
    }
}
