//! A plot of points over an axis, with their mean and deviation in bins of it.

use embedded_graphics::geometry::Point as Pixel;
use embedded_graphics::pixelcolor::Rgb888;

use super::colour::{LIGHT, PAPER};
use super::heat::{PAD_PX, nothing};
use super::layout::Layout;
use super::legend::{Legend, LegendEntry, LegendSample};
use super::raster::Picture;
use super::stroke::{At, Pen, Sheet};
use super::{DrawError, axes};
use crate::geom::{Point, Rect};

const POINT: Rgb888 = Rgb888::new(70, 120, 180);
const MEAN: Rgb888 = Rgb888::new(200, 30, 40);
const ZERO: Rgb888 = Rgb888::new(120, 120, 126);
/// Bins along x, each with at least so many points to show a mean.
const BINS: usize = 16;
const FEWEST: usize = 5;
/// Height of the plot over its width.
const SHAPE: f64 = 0.6;

/// What such a plot shows.
#[derive(Clone, PartialEq, Debug)]
pub struct Scatter<'a> {
    /// Written above the plot.
    pub title: String,
    /// The name of the axis along x, with its unit.
    pub x_name: &'a str,
    /// The name of the axis along y, with its unit.
    pub y_name: &'a str,
    /// x and y of each point; one that is not finite is left out.
    pub points: &'a [(f64, f64)],
    /// What the legend calls a point.
    pub meaning: &'a str,
}

/// Mean and deviation of the points of a bin.
struct Bin {
    x: f64,
    mean: f64,
    sd: f64,
}

impl Picture {
    /// Draws points and gives them as PNG bytes.
    ///
    /// # Errors
    /// [`DrawError::AreaNotFinite`]: the points span more than numbers hold.
    pub fn scatter(plot: &Scatter<'_>) -> Result<Vec<u8>, DrawError> {
        let points: Vec<(f64, f64)> = plot
            .points
            .iter()
            .copied()
            .filter(|(x, y)| x.is_finite() && y.is_finite())
            .collect();
        let (left, right) = span(&points);
        let reach = points
            .iter()
            .fold(0.0, |reach, (_, y)| f64::max(reach, y.abs()));
        let reach = if reach > 0.0 { 1.05 * reach } else { 1.0 };
        let stretch = SHAPE * (right - left) / (2.0 * reach);
        let high = reach * stretch;
        let area = Rect::new(Point::new(left, -high), Point::new(right, high));
        let legend = legend(plot.meaning);
        let layout = Layout::stretched(area, stretch, PAD_PX, &legend)?;
        let mut picture = Picture::new(layout.size, PAPER);
        let place = |x: f64, y: f64| layout.place(Point::new(x, y * stretch));
        let mut sheet = Sheet::new(layout.plot);
        let mut draw =
            |picture: &mut Picture,
             path: &[At],
             (width_px, colour, dash_px): (f64, Rgb888, Option<(f64, f64)>)| {
                let pen = Pen {
                    width_px,
                    colour,
                    opacity: 1.0,
                    dash_px,
                };
                sheet.path(picture, path, pen);
            };
        for (x, y) in &points {
            dot(&mut picture, &layout, place(*x, *y));
        }
        let zero = [place(left, 0.0), place(right, 0.0)];
        draw(&mut picture, &zero, (1.0, ZERO, None));
        let bins = bins(&points, (left, right));
        let line = |of: fn(&Bin) -> f64| -> Vec<At> {
            bins.iter().map(|bin| place(bin.x, of(bin))).collect()
        };
        draw(&mut picture, &line(|bin| bin.mean), (2.2, MEAN, None));
        for side in [line(|bin| bin.mean - bin.sd), line(|bin| bin.mean + bin.sd)] {
            draw(&mut picture, &side, (1.4, MEAN, Some((6.0, 4.0))));
        }
        if points.is_empty() {
            nothing(&mut picture, &layout);
        }
        axes::draw_named(
            &mut picture,
            &layout,
            &plot.title,
            [plot.x_name, plot.y_name],
        );
        let legend_at = Pixel::new(PAD_PX as i32, layout.legend_top);
        legend.draw(
            &mut picture,
            &LIGHT,
            legend_at,
            layout.size.width - 2 * PAD_PX,
        );
        picture.png()
    }
}

fn legend(meaning: &str) -> Legend {
    let entry = |colour: Rgb888, text: &str| LegendEntry {
        sample: LegendSample::Fill(colour),
        text: text.to_owned(),
    };
    let entries = vec![
        entry(POINT, meaning),
        entry(MEAN, "mean, dashed: one standard deviation"),
    ];
    Legend::new(entries, &[])
}

/// Draws a point of 3 pixels, so faint that many of them show how many they are.
fn dot(picture: &mut Picture, layout: &Layout, at: At) {
    let middle = Pixel::new(at.x_px as i32, at.y_px as i32);
    for (dx, dy, opacity) in [
        (0, 0, 0.6),
        (-1, 0, 0.3),
        (1, 0, 0.3),
        (0, -1, 0.3),
        (0, 1, 0.3),
    ] {
        let pixel = middle + Pixel::new(dx, dy);
        if layout.plot.contains(pixel) {
            picture.lay(pixel, POINT, opacity);
        }
    }
}

/// Returns where the axis along x begins and ends: at zero, unless all points lie far from it.
fn span(points: &[(f64, f64)]) -> (f64, f64) {
    let all = || points.iter().map(|(x, _)| *x);
    let (least, most) = (
        all().fold(f64::INFINITY, f64::min),
        all().fold(0.0, f64::max),
    );
    match most > 0.0 {
        true if least > 0.3 * most => (0.97 * least, 1.02 * most),
        true => (least.min(0.0), 1.02 * most),
        false => (0.0, 1.0),
    }
}

fn bins(points: &[(f64, f64)], (left, right): (f64, f64)) -> Vec<Bin> {
    let mut sums = [(0usize, 0.0, 0.0, 0.0); BINS];
    for (x, y) in points {
        let bin = &mut sums[(((x - left) / (right - left) * BINS as f64) as usize).min(BINS - 1)];
        *bin = (bin.0 + 1, bin.1 + x, bin.2 + y, bin.3 + y * y);
    }
    sums.iter()
        .filter(|(count, ..)| *count >= FEWEST)
        .map(|(count, x, y, squares)| {
            let count = *count as f64;
            let mean = y / count;
            Bin {
                x: x / count,
                mean,
                sd: (squares / count - mean * mean).max(0.0).sqrt(),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::tests_support::decoded;

    fn check(points: &[(f64, f64)]) -> usize {
        let png = Picture::scatter(&Scatter {
            title: "points".to_owned(),
            x_name: "length (m)",
            y_name: "residual (dB)",
            points,
            meaning: "a link",
        })
        .unwrap();
        let (_, pixels) = decoded(&png);
        pixels
            .iter()
            .filter(|pixel| **pixel == [200, 30, 40])
            .count()
    }

    #[test]
    fn bins_have_the_mean_and_the_deviation_of_their_points() {
        let points: Vec<(f64, f64)> = (0..40)
            .map(|k| (f64::from(k) / 4.0, if k % 2 == 0 { 3.0 } else { -1.0 }))
            .collect();
        let bins = bins(&points, (0.0, 10.0));
        assert!(bins.is_empty(), "fewer than five a bin");
        let twice = [points.clone(), points].concat();
        let bins = super::bins(&twice, (0.0, 40.0));
        assert!(
            bins.iter()
                .all(|bin| (bin.mean - 1.0).abs() < 0.5 && (bin.sd - 2.0).abs() < 0.2)
        );
    }

    #[test]
    fn odd_points_are_left_out_and_few_have_no_mean() {
        let sample = check(&[]);
        assert_eq!(check(&[(f64::NAN, 1.0), (2.0, f64::INFINITY)]), sample);
        let many: Vec<(f64, f64)> = (0..200).map(|k| (f64::from(k), 1.0)).collect();
        assert!(check(&many) > sample + 300);
    }
}
