//! Where objects stand: the strongest places of an image.
//!
//! Greedy with non-maximum suppression; the local centroid says where in the highest pixel a peak lies. How many peaks are
//! objects is the caller's decision; each peak says how far it stands out of the image's noise.

use serde::{Deserialize, Serialize};

use crate::geom::Point;

use super::Image;

/// A strong place of the image.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Peak {
    /// Where, metres (or the units of the input): a place in the highest pixel, the one nearest to the local centroid.
    pub at: Point,
    /// The highest pixel, dB/m.
    pub strength: f64,
    /// The strength over the image's robust noise level (1.4826 times the median absolute value inside the rim).
    pub significance: f64,
}

/// Ratio of a peak to the image's noise under which it is faint, and no find. Over 240 seeds of the default scenario 4.2
/// kept all persons in 99.6 % and let a false one through in every fourth image; 3.5 keeps all, with three times as many
/// false ones.
pub const SIGNIFICANT: f64 = 4.2;

impl Peak {
    /// Returns whether it may well be noise, see [`SIGNIFICANT`].
    pub fn is_faint(&self) -> bool {
        self.significance < SIGNIFICANT
    }
}

/// How peaks are told apart.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct PeakSettings {
    /// Pixels nearer than this to the area's border hold no peak, metres.
    pub rim_m: f64,
    /// Peaks lie at least this far apart, metres.
    pub separation_m: f64,
    /// Most peaks that are listed.
    pub limit: usize,
}

/// Returns the peaks, strongest first; only positive ones.
pub fn peaks(image: &Image, settings: PeakSettings) -> Vec<Peak> {
    let inner = image.grid.area.shrunk(settings.rim_m);
    let mut open: Vec<usize> = (0..image.grid.len())
        .filter(|pixel| inner.contains(image.grid.centre(*pixel)))
        .collect();
    let noise = noise_level(
        open.iter()
            .map(|pixel| image.values[*pixel].abs())
            .collect(),
    );
    let mut found = Vec::new();
    while found.len() < settings.limit {
        let highest = open.iter().copied().max_by(|a, b| {
            // The first of equal pixels wins, so that the answer does not depend on the search.
            image.values[*a].total_cmp(&image.values[*b]).then(b.cmp(a))
        });
        let Some(highest) = highest.filter(|pixel| image.values[*pixel] > 0.0) else {
            break;
        };
        let (centre, strength) = (image.grid.centre(highest), image.values[highest]);
        let radius_m = settings.separation_m / 2.0;
        let centroid = centroid(image, &open, centre, radius_m, strength);
        found.push(Peak {
            at: within_pixel(image, centre, centroid),
            strength,
            significance: if noise > 0.0 {
                strength / noise
            } else {
                f64::MAX
            },
        });
        open.retain(|pixel| image.grid.centre(*pixel).distance_to(centre) >= settings.separation_m);
    }
    found
}

/// Returns the centroid of what rises above half the strength around a pixel.
fn centroid(image: &Image, open: &[usize], centre: Point, radius_m: f64, strength: f64) -> Point {
    let (mut sum, mut moment_x, mut moment_y) = (0.0, 0.0, 0.0);
    for pixel in open {
        let at = image.grid.centre(*pixel);
        let weight = (image.values[*pixel] - 0.5 * strength).max(0.0);
        if at.distance_to(centre) < radius_m {
            sum += weight;
            moment_x += weight * at.x_m;
            moment_y += weight * at.y_m;
        }
    }
    if sum > 0.0 {
        Point::new(moment_x / sum, moment_y / sum)
    } else {
        centre
    }
}

/// Returns the place in a pixel that is nearest to a point. A centroid may lie pixels away from the highest one, where
/// the rim or another peak cuts its surroundings off or they have a long tail; no object was seen there.
fn within_pixel(image: &Image, centre: Point, point: Point) -> Point {
    let (half_x_m, half_y_m) = (image.grid.dx_m() / 2.0, image.grid.dy_m() / 2.0);
    Point::new(
        point
            .x_m
            .clamp(centre.x_m - half_x_m, centre.x_m + half_x_m),
        point
            .y_m
            .clamp(centre.y_m - half_y_m, centre.y_m + half_y_m),
    )
}

fn noise_level(mut sizes: Vec<f64>) -> f64 {
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{PixelGrid, Rect};

    fn image_with(spots: &[(f64, f64, f64)]) -> Image {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 10.0));
        let mut image = Image::zeros(PixelGrid {
            area,
            columns: 40,
            rows: 20,
        });
        for pixel in 0..image.grid.len() {
            let at = image.grid.centre(pixel);
            let noise = 0.01 * ((pixel * 31 % 17) as f64 - 8.0) / 8.0;
            let bump = |(x_m, y_m, height): &(f64, f64, f64)| {
                height * (-at.distance_to(Point::new(*x_m, *y_m)).powi(2) / 0.5).exp()
            };
            image.values[pixel] = noise + spots.iter().map(bump).sum::<f64>();
        }
        image
    }

    const SETTINGS: PeakSettings = PeakSettings {
        rim_m: 1.5,
        separation_m: 3.0,
        limit: 2,
    };

    #[test]
    fn two_objects_are_found_strongest_first() {
        let found = peaks(&image_with(&[(5.1, 5.2, 1.0), (14.0, 3.9, 2.0)]), SETTINGS);
        assert_eq!(found.len(), 2);
        assert!(
            found[0].at.distance_to(Point::new(14.0, 3.9)) < 0.1,
            "{:?}",
            found[0]
        );
        assert!(
            found[1].at.distance_to(Point::new(5.1, 5.2)) < 0.1,
            "{:?}",
            found[1]
        );
        assert!(found[1].significance > 20.0);
    }

    #[test]
    fn the_rim_and_the_surroundings_of_a_peak_hold_no_peak() {
        let found = peaks(
            &image_with(&[
                (0.6, 5.0, 9.0),
                (8.0, 5.0, 2.0),
                (9.5, 5.0, 1.9),
                (15.0, 5.0, 1.0),
            ]),
            SETTINGS,
        );
        assert!(found[0].at.distance_to(Point::new(8.7, 5.0)) < 1.0);
        assert!(found[1].at.distance_to(Point::new(15.0, 5.0)) < 0.2);
    }

    #[test]
    fn a_peak_lies_in_its_highest_pixel_whatever_surrounds_it() {
        // A ridge that ends at its highest pixel, in every direction.
        for (step_x, step_y) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1)] {
            let mut image = image_with(&[]);
            let pixel = |step: i32| ((10 + step * step_y) * 40 + 20 + step * step_x) as usize;
            (0..4).for_each(|step| image.values[pixel(step)] = 0.9);
            image.values[pixel(0)] = 1.0;
            let off = peaks(&image, SETTINGS)[0].at - image.grid.centre(pixel(0));
            let (most_x_m, most_y_m) = (0.5001 * image.grid.dx_m(), 0.5001 * image.grid.dy_m());
            assert!(
                off.x_m.abs() <= most_x_m && off.y_m.abs() <= most_y_m,
                "{off:?}"
            );
            assert!(
                off.x_m * f64::from(step_x) + off.y_m * f64::from(step_y) > 0.2,
                "towards the ridge: {off:?}"
            );
        }
    }

    #[test]
    fn an_image_without_attenuation_has_no_peak() {
        let mut image = image_with(&[]);
        image.values.fill(-1.0);
        assert!(peaks(&image, SETTINGS).is_empty());
    }
}
