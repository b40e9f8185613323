//! The floor plan: what stands at one height, filled by material, and faintly what hangs or rises above it.
//!
//! Knows outlines and colours, no scene: whoever cuts the scene decides at which height.

use std::ops::Range;

use embedded_graphics::geometry::{Point as Pixel, Size};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::primitives::Rectangle;

use crate::geom::{Polygon, Rect};

use super::colour::{INK, LIGHT, PAPER, mix};
use super::heat::nothing;
use super::layout::Layout;
use super::legend::{Legend, LegendEntry, LegendSample};
use super::overlay::Overlay;
use super::raster::Picture;
use super::stroke::{At, Pen, Sheet};
use super::text::{SMALL, width_px, write_rimmed};
use super::{DrawError, axes, paint};

const PAD_PX: u32 = 14;
/// How much of its colour something above the plan's height keeps.
const FAINT: f64 = 0.28;
const BAR_PX: u32 = 5;

/// An outline on a floor plan.
#[derive(Clone, PartialEq, Debug)]
pub struct FloorShape {
    /// Its border, metres; two corners are a wall without a thickness.
    pub polygon: Polygon,
    /// What is not part of it inside the border.
    pub holes: Vec<Polygon>,
    /// What it is made of, by its place in [`FloorPlan::materials`].
    pub material: usize,
    /// Whether it is only above the plan's height.
    pub is_above: bool,
}

/// What a floor plan shows.
#[derive(Clone, PartialEq, Debug)]
pub struct FloorPlan<'a> {
    /// Written above the plot.
    pub title: String,
    /// What is shown, local frame, metres.
    pub area: Rect,
    /// Name and colour (red, green, blue) of every material.
    pub materials: &'a [(String, [u8; 3])],
    /// The outlines; later ones lie on earlier ones, and all at the plan's height on those above it.
    pub shapes: &'a [FloorShape],
    /// What is laid over the plan: fence, area, homes, persons.
    pub overlays: Vec<Overlay>,
}

impl Picture {
    /// Draws a floor plan with scale and legend, and returns it as PNG bytes, north up.
    ///
    /// # Errors
    /// [`DrawError::AreaNotFinite`].
    pub fn floor(plan: &FloorPlan<'_>) -> Result<Vec<u8>, DrawError> {
        let legend = legend(plan);
        let layout = Layout::new(plan.area, &plan.overlays, PAD_PX, &legend)?;
        let mut picture = Picture::new(layout.size, PAPER);
        picture.fill(layout.plot, Rgb888::new(250, 250, 248));
        for is_above in [true, false] {
            for shape in plan
                .shapes
                .iter()
                .filter(|shape| shape.is_above == is_above)
            {
                draw(&mut picture, &layout, plan, shape);
            }
        }
        if plan.shapes.is_empty() {
            nothing(&mut picture, &layout);
        }
        scale_bar(&mut picture, &layout);
        paint::overlays(&mut picture, &layout, &LIGHT, &plan.overlays);
        axes::draw(&mut picture, &layout, &plan.title, "m");
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

fn colour(plan: &FloorPlan<'_>, shape: &FloorShape) -> Rgb888 {
    let [red, green, blue] = plan
        .materials
        .get(shape.material)
        .map_or([128; 3], |(_, colour)| *colour);
    let full = Rgb888::new(red, green, blue);
    if shape.is_above {
        mix(PAPER, full, FAINT)
    } else {
        full
    }
}

/// Returns the legend: every material that is seen, and once what is above.
fn legend(plan: &FloorPlan<'_>) -> Legend {
    let is_used = |index: usize, is_above: bool| {
        plan.shapes
            .iter()
            .any(|shape| shape.material == index && shape.is_above == is_above)
    };
    let mut fills = Vec::new();
    for is_above in [false, true] {
        for (index, (name, rgb)) in plan.materials.iter().enumerate() {
            let [red, green, blue] = *rgb;
            let full = Rgb888::new(red, green, blue);
            if is_used(index, is_above) && !(is_above && is_used(index, false)) {
                let (colour, text) = match is_above {
                    false => (full, name.clone()),
                    true => (mix(PAPER, full, FAINT), format!("{name} (above)")),
                };
                fills.push(LegendEntry {
                    sample: LegendSample::Fill(colour),
                    text,
                });
            }
        }
    }
    Legend::new(fills, &plan.overlays)
}

fn draw(picture: &mut Picture, layout: &Layout, plan: &FloorPlan<'_>, shape: &FloorShape) {
    let colour = colour(plan, shape);
    let contours: Vec<Vec<At>> = std::iter::once(&shape.polygon)
        .chain(&shape.holes)
        .map(|contour| {
            contour
                .corners()
                .iter()
                .map(|corner| layout.place(*corner))
                .collect()
        })
        .collect();
    fill(picture, layout.plot, &contours, colour);
    if shape.is_above {
        return;
    }
    let is_sheet = shape.polygon.corners().len() == 2;
    let (width_px, edge) = if is_sheet {
        (2.6, colour)
    } else {
        (1.1, mix(colour, INK, 0.55))
    };
    let pen = Pen {
        width_px,
        colour: edge,
        opacity: 1.0,
        dash_px: None,
    };
    let mut sheet = Sheet::new(layout.plot);
    for contour in &contours {
        let closed: Vec<At> = contour.iter().chain(contour.first()).copied().collect();
        sheet.path(picture, &closed, pen);
    }
}

/// Fills what lies within an odd number of contours, pixel by its middle.
fn fill(picture: &mut Picture, plot: Rectangle, contours: &[Vec<At>], colour: Rgb888) {
    for row in 0..plot.size.height as i32 {
        let y_px = f64::from(plot.top_left.y + row) + 0.5;
        let mut crossings: Vec<f64> = contours
            .iter()
            .flat_map(|contour| crossings_of(contour, y_px))
            .collect();
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let columns = columns_between(pair[0], pair[1], plot);
            let at = Pixel::new(columns.start, plot.top_left.y + row);
            let size = Size::new((columns.end - columns.start).max(0) as u32, 1);
            picture.fill(Rectangle::new(at, size), colour);
        }
    }
}

/// Returns where a contour's sides cross a row.
fn crossings_of(contour: &[At], y_px: f64) -> impl Iterator<Item = f64> {
    let next = contour.iter().cycle().skip(1);
    contour.iter().zip(next).filter_map(move |(from, to)| {
        let is_crossed = (from.y_px <= y_px) != (to.y_px <= y_px);
        is_crossed
            .then(|| from.x_px + (y_px - from.y_px) / (to.y_px - from.y_px) * (to.x_px - from.x_px))
    })
}

/// Returns the columns of the plot whose middles lie between two places.
fn columns_between(from_px: f64, to_px: f64, plot: Rectangle) -> Range<i32> {
    let (left, right) = (plot.top_left.x, plot.top_left.x + plot.size.width as i32);
    let column = |at_px: f64| (libm::ceil(at_px - 0.5) as i32).clamp(left, right);
    column(from_px)..column(to_px)
}

/// Draws a bar of a round length into the lower left corner, with that length beside it.
fn scale_bar(picture: &mut Picture, layout: &Layout) {
    let most_m = layout.view.width_m() / 4.0;
    let decade_m = libm::pow(10.0, libm::floor(libm::log10(most_m)));
    let steps = [5.0, 2.0, 1.0];
    let length_m = steps
        .iter()
        .map(|step| step * decade_m)
        .find(|length_m| *length_m <= most_m)
        .unwrap_or(most_m);
    let length_px = libm::round(layout.length_px(length_m)) as u32;
    let Rectangle { top_left, size } = layout.plot;
    let at = top_left + Pixel::new(20, size.height as i32 - 26);
    picture.fill(
        Rectangle::new(at - Pixel::new(1, 1), Size::new(length_px + 2, BAR_PX + 2)),
        INK,
    );
    picture.fill(Rectangle::new(at, Size::new(length_px / 2, BAR_PX)), PAPER);
    let text = format!("{length_m} m");
    let text_at = at
        + Pixel::new(
            (length_px as i32 - width_px(&text, SMALL) as i32).max(0) / 2,
            -18,
        );
    write_rimmed(picture, &text, text_at, INK, PAPER);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Point;

    fn square(low: f64, high: f64) -> Polygon {
        Rect::new(Point::new(low, low), Point::new(high, high)).polygon()
    }

    fn shape(polygon: Polygon, holes: Vec<Polygon>) -> FloorShape {
        FloorShape {
            polygon,
            holes,
            material: 0,
            is_above: false,
        }
    }

    #[test]
    fn an_outline_covers_its_area_without_its_holes() {
        let plot = Rectangle::new(Pixel::new(10, 20), Size::new(200, 100));
        let at = |x: f64, y: f64| At::new(10.0 + x, 20.0 + y);
        let border = vec![
            at(10.0, 10.0),
            at(90.0, 10.0),
            at(90.0, 60.0),
            at(10.0, 60.0),
        ];
        let hole = vec![
            at(30.0, 20.0),
            at(30.0, 40.0),
            at(70.0, 40.0),
            at(70.0, 20.0),
        ];
        let far = vec![
            at(150.0, -500.0),
            at(900.0, -500.0),
            at(900.0, 900.0),
            at(150.0, 900.0),
        ];
        let count = |contours: &[Vec<At>]| {
            let mut picture = Picture::new(Size::new(220, 140), PAPER);
            fill(&mut picture, plot, contours, INK);
            let pixels = (0..140).flat_map(|y| (0..220).map(move |x| Pixel::new(x, y)));
            pixels
                .filter(|pixel| picture.colour_at(*pixel) == Some(INK))
                .count()
        };
        assert_eq!(count(std::slice::from_ref(&border)), 80 * 50);
        assert_eq!(count(&[border, hole]), 80 * 50 - 40 * 20);
        assert_eq!(count(&[far]), 50 * 100);
        assert_eq!(
            count(&[vec![
                at(f64::NAN, 0.0),
                at(1.0, 5.0),
                at(9.0, f64::INFINITY)
            ]]),
            0
        );
    }

    #[test]
    fn plans_become_pictures_and_odd_ones_are_refused() {
        let materials = [
            ("stone".to_owned(), [120, 120, 120]),
            ("leaves".to_owned(), [40, 120, 40]),
        ];
        let shapes = [
            shape(square(2.0, 8.0), vec![square(3.0, 4.0)]),
            shape(
                Polygon::new(vec![Point::new(1.0, 1.0), Point::new(9.0, 1.0)]),
                Vec::new(),
            ),
            FloorShape {
                material: 1,
                is_above: true,
                ..shape(square(5.0, 9.0), Vec::new())
            },
            FloorShape {
                material: 7,
                ..shape(square(f64::NAN, 1.0), Vec::new())
            },
        ];
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(10.0, 10.0));
        let plan = |area: Rect, shapes| FloorPlan {
            title: "a plan".into(),
            area,
            materials: &materials,
            shapes,
            overlays: Vec::new(),
        };
        let png = Picture::floor(&plan(area, &shapes)).unwrap();
        assert_eq!(&png[1..4], b"PNG");
        assert_eq!(png, Picture::floor(&plan(area, &shapes)).unwrap());
        assert_ne!(png, Picture::floor(&plan(area, &[])).unwrap());
        let endless = Rect {
            max: Point::new(f64::INFINITY, 1.0),
            ..area
        };
        assert!(Picture::floor(&plan(endless, &shapes)).is_err());
    }
}
