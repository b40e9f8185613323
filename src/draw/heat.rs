//! The picture of an image: values in colour, each pixel of the image a plain rectangle of its one colour.
//!
//! No smoothing: what looks like a pixel is one. Where the image is finer than the picture, the mean is shown.

use std::ops::Range;

use embedded_graphics::geometry::Point;
use embedded_graphics::pixelcolor::Rgb888;

use crate::geom::PixelGrid;

use super::bar::Bar;
use super::colour::{ColourMap, DARK, INK, NOT_FINITE, PAPER};
use super::layout::{Layout, view};
use super::legend::{Legend, LegendEntry, LegendSample};
use super::overlay::Overlay;
use super::raster::Picture;
use super::text::{SMALL, width_px, write};
use super::{DrawError, Placement, axes, paint};

pub(super) const PAD_PX: u32 = 14;

/// What a heat map shows.
#[derive(Clone, PartialEq, Debug)]
pub struct HeatMap<'a> {
    /// Written above the plot.
    pub title: String,
    /// Where the pixels lie.
    pub grid: PixelGrid,
    /// One value a pixel, row-major, rows from south to north, columns from west to east, in `unit`. Values that are
    /// not finite get a colour of their own.
    pub values: &'a [f64],
    /// The unit written at the colour bar, such as "dB/m".
    pub unit: &'a str,
    /// The unit of the axes, such as "m".
    pub length_unit: &'a str,
    /// What is laid over the image.
    pub overlays: Vec<Overlay>,
    /// Values at the ends of the colour bar; values beyond take the end's colour and are noted at the bar. `None`
    /// means from 0 to the largest value.
    pub range: Option<(f64, f64)>,
}

impl HeatMap<'_> {
    /// Returns where the picture lies.
    ///
    /// # Errors
    /// [`DrawError::AreaNotFinite`].
    pub fn placement(&self) -> Result<Placement, DrawError> {
        let bar = Bar::new(self.values, self.range, self.unit);
        self.layout(&bar, &self.legend())
            .map(|layout| layout.placement())
    }

    fn legend(&self) -> Legend {
        // Of an area that cannot be shown there is no picture either.
        let view = view(self.grid.area, &self.overlays).unwrap_or(self.grid.area);
        let shown = self.overlays.iter();
        let shown = shown.filter(|overlay| !overlay.is_outside(view));
        Legend::new(not_finite_entry(self.values), shown)
    }

    fn layout(&self, bar: &Bar, legend: &Legend) -> Result<Layout, DrawError> {
        Layout::new(self.grid.area, &self.overlays, bar.side_px(), legend)
    }
}

impl Picture {
    /// Draws a heat map and gives it as PNG bytes, north up.
    ///
    /// # Errors
    /// [`DrawError::ValueCount`], [`DrawError::AreaNotFinite`].
    pub fn heat(map: &HeatMap) -> Result<Vec<u8>, DrawError> {
        Picture::of_heat(map)?.png()
    }

    /// Draws a heat map, north up.
    ///
    /// # Errors
    /// [`DrawError::ValueCount`], [`DrawError::AreaNotFinite`].
    pub fn of_heat(map: &HeatMap) -> Result<Picture, DrawError> {
        let PixelGrid {
            area,
            columns,
            rows,
        } = map.grid;
        if columns.checked_mul(rows) != Some(map.values.len()) {
            return Err(DrawError::ValueCount {
                columns,
                rows,
                got: map.values.len(),
            });
        }
        let bar = Bar::new(map.values, map.range, map.unit);
        let legend = map.legend();
        let layout = map.layout(&bar, &legend)?;
        let mut picture = Picture::new(layout.size, PAPER);
        picture.fill(layout.plot, DARK.ground);
        let colours = ColourMap::new();
        values(&mut picture, &layout, map, |value| {
            if value.is_finite() {
                colours.at(bar.share(value))
            } else {
                NOT_FINITE
            }
        });
        if map.values.is_empty() || area.width_m() <= 0.0 || area.height_m() <= 0.0 {
            nothing(&mut picture, &layout);
        }
        paint::overlays(&mut picture, &layout, &DARK, &map.overlays);
        axes::draw(&mut picture, &layout, &map.title, map.length_unit);
        bar.draw(&mut picture, &colours, layout.plot);
        let legend_at = Point::new(PAD_PX as i32, layout.legend_top);
        legend.draw(
            &mut picture,
            &DARK,
            legend_at,
            layout.size.width - 2 * PAD_PX,
        );
        Ok(picture)
    }
}

fn not_finite_entry(values: &[f64]) -> Vec<LegendEntry> {
    let text = "no value (not a finite number)".to_string();
    let entry = LegendEntry {
        sample: LegendSample::Fill(NOT_FINITE),
        text,
    };
    if values.iter().all(|value| value.is_finite()) {
        Vec::new()
    } else {
        vec![entry]
    }
}

/// Paints the values onto the plot.
fn values(picture: &mut Picture, layout: &Layout, map: &HeatMap, colour: impl Fn(f64) -> Rgb888) {
    let PixelGrid {
        area,
        columns,
        rows,
    } = map.grid;
    let across = layout.columns(area.min.x_m, map.grid.dx_m(), columns);
    let down = layout.rows(area.min.y_m, map.grid.dy_m(), rows);
    let colour_of = |columns_here: &Range<usize>, rows: &Range<usize>| {
        let shown = !columns_here.is_empty() && !rows.is_empty();
        shown.then(|| colour(mean(map.values, columns, columns_here, rows)))
    };
    let mut line: Vec<Option<Rgb888>> = Vec::new();
    let mut line_shows = None;
    for (y, rows) in down.iter().enumerate() {
        // Many pixel rows show the same row of the image; its colours are worked out once.
        if line_shows != Some(rows) {
            line = across
                .iter()
                .map(|columns_here| colour_of(columns_here, rows))
                .collect();
            line_shows = Some(rows);
        }
        for (x, colour) in line.iter().enumerate() {
            if let Some(colour) = colour {
                picture.set(
                    layout.plot.top_left + Point::new(x as i32, y as i32),
                    *colour,
                );
            }
        }
    }
}

/// Returns the mean over some columns and rows; not finite as soon as one value is not, so that it cannot hide.
fn mean(values: &[f64], pitch: usize, columns: &Range<usize>, rows: &Range<usize>) -> f64 {
    let lines = rows
        .clone()
        .map(|row| &values[row * pitch + columns.start..row * pitch + columns.end]);
    let count = columns.len() * rows.len();
    // Divided before summing, so that huge values do not overflow.
    lines.flatten().map(|value| value / count as f64).sum()
}

/// Says that there is nothing to show.
pub(super) fn nothing(picture: &mut Picture, layout: &Layout) {
    let text = "no data";
    let middle = layout.plot.center() - Point::new(width_px(text, SMALL) as i32 / 2, 7);
    let ground = picture.colour_at(middle).unwrap_or(PAPER);
    write(
        picture,
        text,
        middle,
        SMALL,
        if ground == DARK.ground { PAPER } else { INK },
    );
}
