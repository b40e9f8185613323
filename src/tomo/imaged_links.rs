//! What an image says of the links it was made of, and what these say of it: how much each leaves unexplained, which pixels
//! they have seen, and from which directions.
//!
//! Nothing is calibrated or solved here.

use serde::{Deserialize, Serialize};

use super::calibrate::Observation;
use super::settings::ImagingSettings;
use super::solvers::Solved;
use super::weights::WeightRows;
use crate::geom::{PixelGrid, Point, Segment};

/// Directions that are told apart: sectors of 30° of a half turn, the first from east to 30° north of it.
pub const DIRECTIONS: usize = 6;

/// A link of an image.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ImagedLink {
    /// Mean place of its first end.
    pub from: Point,
    /// Mean place of its second end.
    pub to: Point,
    /// What it has lost beyond the empty sweep, or beyond free space where there is none, dB.
    pub attenuation_db: f64,
    /// Standard deviation of that, dB.
    pub sd_db: f64,
    /// What the image leaves unexplained of it, dB.
    pub residual_db: f64,
}

impl ImagedLink {
    /// Returns all links of an image, in their order.
    pub(super) fn all(observations: &[Observation], solved: &Solved) -> Vec<ImagedLink> {
        let of_link = |(link, residual_db): (&Observation, &f64)| ImagedLink {
            from: link.from,
            to: link.to,
            attenuation_db: link.attenuation_db,
            sd_db: link.variance_db2.sqrt(),
            residual_db: *residual_db,
        };
        let all = observations.iter().zip(&solved.residual_db);
        all.map(of_link).collect()
    }

    /// Returns the straight path.
    pub fn segment(&self) -> Segment {
        Segment::new(self.from, self.to)
    }

    /// Returns the length, metres.
    pub fn length_m(&self) -> f64 {
        self.from.distance_to(self.to)
    }
}

/// What the pixels of an image have seen of links.
#[derive(Clone, PartialEq, Debug)]
pub struct Coverage {
    /// Where the pixels lie.
    pub grid: PixelGrid,
    /// Length of links in each pixel by direction, as they weigh there, metres.
    pub by_direction_m: Vec<[f64; DIRECTIONS]>,
}

impl Coverage {
    /// Returns the length of links in each pixel, as they weigh there, metres.
    pub fn lengths_m(&self) -> Vec<f64> {
        let sum = |of_pixel: &[f64; DIRECTIONS]| of_pixel.iter().sum();
        self.by_direction_m.iter().map(sum).collect()
    }

    /// Returns the direction in which the fewest links ran through a pixel, radians from east towards north (the middle of its
    /// sector), and how much is missing there: 0 = as much as in the mean of all, 1 = nothing ran there. `None` where no
    /// link has been.
    pub fn least_covered(&self, pixel: usize) -> Option<(f64, f64)> {
        let of_pixel = self.by_direction_m.get(pixel)?;
        let mean_m = of_pixel.iter().sum::<f64>() / DIRECTIONS as f64;
        let least = (0..DIRECTIONS).min_by(|a, b| of_pixel[*a].total_cmp(&of_pixel[*b]))?;
        let middle_rad = (least as f64 + 0.5) * std::f64::consts::PI / DIRECTIONS as f64;
        (mean_m > 0.0).then(|| (middle_rad, 1.0 - of_pixel[least] / mean_m))
    }
}

/// Returns what the pixels of an image with these settings see of some links.
pub fn coverage<'a>(
    links: impl Iterator<Item = &'a ImagedLink>,
    settings: &ImagingSettings,
) -> Coverage {
    let grid = settings.grid;
    let mut by_direction_m = vec![[0.0; DIRECTIONS]; grid.len()];
    for link in links {
        let direction = direction_of(link.segment());
        let rows = WeightRows::rescaled([link.segment()], &grid, settings.weights);
        for (pixel, length_m) in rows.row(0) {
            by_direction_m[pixel][direction] += length_m;
        }
    }
    Coverage {
        grid,
        by_direction_m,
    }
}

/// Returns the sector in which a link runs, whichever end comes first.
fn direction_of(link: Segment) -> usize {
    let vector = link.vector();
    let turn = libm::atan2(vector.y_m, vector.x_m) / std::f64::consts::PI;
    let share = if turn < 0.0 { turn + 1.0 } else { turn };
    ((share * DIRECTIONS as f64) as usize) % DIRECTIONS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Rect;
    use crate::tomo::{Extras, Imager, Link, WeightModel};

    fn settings() -> ImagingSettings {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(10.0, 10.0));
        ImagingSettings {
            weights: WeightModel::Line,
            ..ImagingSettings::for_change(area)
        }
    }

    fn link(from: (f64, f64), to: (f64, f64)) -> ImagedLink {
        ImagedLink {
            from: Point::new(from.0, from.1),
            to: Point::new(to.0, to.1),
            attenuation_db: 0.0,
            sd_db: 1.0,
            residual_db: 0.0,
        }
    }

    #[test]
    fn all_of_a_link_lies_in_the_pixels_and_in_its_direction() {
        let links = [
            link((0.0, 4.1), (10.0, 4.1)),
            link((10.0, 4.1), (0.0, 4.1)),
            link((3.1, 10.0), (3.1, 0.0)),
        ];
        let coverage = coverage(links.iter(), &settings());
        let sum = |direction: usize| -> f64 {
            coverage.by_direction_m.iter().map(|of| of[direction]).sum()
        };
        for (direction, expected_m) in [(0, 20.0), (3, 10.0), (1, 0.0), (5, 0.0)] {
            assert!((sum(direction) - expected_m).abs() < 1e-9, "{direction}");
        }
        let at = |x_m, y_m| coverage.grid.pixel_at(Point::new(x_m, y_m)).unwrap();
        let (_, lack) = coverage.least_covered(at(8.0, 4.1)).unwrap();
        assert_eq!(lack, 1.0);
        assert_eq!(coverage.least_covered(at(8.0, 8.0)), None);
    }

    #[test]
    fn what_is_unexplained_of_the_links_has_the_rms_of_the_image() {
        let ends = (0..10).map(|k| f64::from(k) + 0.5);
        let now: Vec<Link> = ends
            .map(|x_m| {
                let strength_dbm = if x_m == 4.5 { -72.0 } else { -60.0 };
                Link::fixed(
                    Point::new(x_m, 0.0),
                    Point::new(10.0 - x_m, 10.0),
                    20,
                    strength_dbm,
                )
            })
            .collect();
        let extras = Extras {
            links: true,
            ..Extras::default()
        };
        let made = Imager::new(settings())
            .unwrap()
            .update(&now, None, extras)
            .unwrap();
        let links = made.links.unwrap();
        let squares: f64 = links.iter().map(|link| link.residual_db.powi(2)).sum();
        let rms_db = (squares / links.len() as f64).sqrt();
        assert_eq!((links.len(), rms_db), (made.used, made.residual_rms_db));
    }
}
