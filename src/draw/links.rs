//! The picture of links: thin lines in the colour of their value, the greatest on top.

use embedded_graphics::geometry::Point as Pixel;
use embedded_graphics::pixelcolor::Rgb888;

use super::bar::Bar;
use super::colour::{ColourMap, DARK, PAPER};
use super::heat::{PAD_PX, nothing};
use super::layout::Layout;
use super::legend::Legend;
use super::overlay::Overlay;
use super::raster::Picture;
use super::stroke::At;
use super::{DrawError, axes, paint};
use crate::geom::{Point, Rect};

/// How much of a line covers what lies under it: the least value faint, the greatest full.
const OPACITY: (f64, f64) = (0.15, 0.95);

/// What a picture of links shows.
#[derive(Clone, PartialEq, Debug)]
pub struct LinkMap<'a> {
    /// Written above the plot.
    pub title: String,
    /// What is shown.
    pub area: Rect,
    /// Both ends and the value of each; one that is not finite is left out.
    pub links: &'a [(Point, Point, f64)],
    /// The unit written at the colour bar, such as "dB".
    pub unit: &'a str,
    /// The unit of the axes, such as "m".
    pub length_unit: &'a str,
    /// What is laid over the links.
    pub overlays: Vec<Overlay>,
    /// Values at the ends of the colour bar; `None` means from 0 to the largest value.
    pub range: Option<(f64, f64)>,
}

impl Picture {
    /// Draws links and gives them as PNG bytes, north up.
    ///
    /// # Errors
    /// [`DrawError::AreaNotFinite`].
    pub fn links(map: &LinkMap<'_>) -> Result<Vec<u8>, DrawError> {
        let values: Vec<f64> = map.links.iter().map(|(_, _, value)| *value).collect();
        let bar = Bar::new(&values, map.range, map.unit);
        let legend = Legend::new(Vec::new(), &map.overlays);
        let layout = Layout::new(map.area, &map.overlays, bar.side_px(), &legend)?;
        let mut picture = Picture::new(layout.size, PAPER);
        let colours = ColourMap::new();
        picture.fill(layout.plot, colours.at(0.0));
        let mut ordered: Vec<&(Point, Point, f64)> = map
            .links
            .iter()
            .filter(|(from, to, value)| from.is_finite() && to.is_finite() && value.is_finite())
            .collect();
        ordered.sort_by(|a, b| a.2.total_cmp(&b.2));
        if ordered.is_empty() {
            nothing(&mut picture, &layout);
        }
        for (from, to, value) in ordered {
            let share = bar.share(*value).clamp(0.0, 1.0);
            let opacity = OPACITY.0 + (OPACITY.1 - OPACITY.0) * share;
            // A link without a loss shows that it is there, too.
            let colour = colours.at(share.max(0.25));
            let ends = (layout.place(*from), layout.place(*to));
            line(&mut picture, &layout, ends, (colour, opacity));
        }
        paint::overlays(&mut picture, &layout, &DARK, &map.overlays);
        axes::draw(&mut picture, &layout, &map.title, map.length_unit);
        bar.draw(&mut picture, &colours, layout.plot);
        let legend_at = Pixel::new(PAD_PX as i32, layout.legend_top);
        let room_px = layout.size.width - 2 * PAD_PX;
        legend.draw(&mut picture, &DARK, legend_at, room_px);
        picture.png()
    }
}

/// Draws a line one pixel wide, each step shared by the two pixels nearest to it (Wu 1991).
fn line(
    picture: &mut Picture,
    layout: &Layout,
    (from, to): (At, At),
    (colour, opacity): (Rgb888, f64),
) {
    let (dx, dy) = (to.x_px - from.x_px, to.y_px - from.y_px);
    let is_steep = dy.abs() > dx.abs();
    let (start, end, slope, other) = match (is_steep, dx + dy == 0.0 && dx == 0.0) {
        (_, true) => return,
        (true, _) => (from.y_px, to.y_px, dx / dy, from.x_px),
        (false, _) => (from.x_px, to.x_px, dy / dx, from.y_px),
    };
    let corner = layout.plot.top_left;
    let size = layout.plot.size;
    let (first, length) = match is_steep {
        true => (corner.y, size.height as i32),
        false => (corner.x, size.width as i32),
    };
    let inside = |value: f64| value.clamp(f64::from(first), f64::from(first + length)) as i32;
    let (low, high) = (inside(start.min(end)), inside(start.max(end)));
    for step in low..high {
        let across = other + (f64::from(step) + 0.5 - start) * slope - 0.5;
        let nearest = libm::floor(across);
        for (place, share) in [
            (nearest, 1.0 - (across - nearest)),
            (nearest + 1.0, across - nearest),
        ] {
            let at = match is_steep {
                true => Pixel::new(place as i32, step),
                false => Pixel::new(step, place as i32),
            };
            if layout.plot.contains(at) {
                picture.lay(at, colour, share * opacity);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::tests_support::decoded;

    fn picture(links: &[(Point, Point, f64)]) -> Vec<[u8; 3]> {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(10.0, 10.0));
        let png = Picture::links(&LinkMap {
            title: "links".to_owned(),
            area,
            links,
            unit: "dB",
            length_unit: "m",
            overlays: Vec::new(),
            range: Some((0.0, 10.0)),
        });
        decoded(&png.unwrap()).1
    }

    #[test]
    fn the_greatest_value_lies_on_top_whatever_comes_first() {
        let (low, high) = (Point::new(1.0, 5.0), Point::new(9.0, 5.0));
        let (south, north) = (Point::new(5.0, 1.0), Point::new(5.0, 9.0));
        let (strong, weak) = ((low, high, 10.0), (south, north, 1.0));
        assert_eq!(picture(&[strong, weak]), picture(&[weak, strong]));
        assert_ne!(picture(&[strong, weak]), picture(&[weak]));
    }

    #[test]
    fn odd_links_are_left_out() {
        let at = Point::new(5.0, 5.0);
        let odd = [
            (Point::new(f64::NAN, 1.0), at, 3.0),
            (at, at, 3.0),
            (at, Point::new(2.0, 2.0), f64::NAN),
        ];
        assert_eq!(picture(&odd), picture(&[(at, at, 3.0)]));
        assert_eq!(picture(&[]).len(), picture(&odd).len());
    }

    #[test]
    fn ends_far_outside_stay_within_the_plot() {
        let far = [(Point::new(-1e9, 5.0), Point::new(1e9, 5.0), 10.0)];
        let near = [(Point::new(-1.0, 5.0), Point::new(11.0, 5.0), 10.0)];
        assert_eq!(picture(&far), picture(&near));
    }
}
