//! Where things lie: which metres are shown, on which pixels, and how large the picture becomes.

use embedded_graphics::geometry::{Point as Pixel, Size};
use embedded_graphics::primitives::Rectangle;

use crate::geom::{Point, Rect};

use super::DrawError;
use super::Placement;
use super::legend::Legend;
use super::overlay::Overlay;
use super::stroke::At;
use super::text::{SMALL, width_px};
use super::ticks::{Tick, ticks};

const PLOT_MOST: Size = Size::new(680, 600);
const TOP_PX: u32 = 64;
const TICK_PX: u32 = 6;
const PAD_PX: u32 = 14;
const LEAST_WIDTH_PX: u32 = 460;

/// A plot longer than this many times its width is shown with margin along its short side.
const ELONGATION_MOST: f64 = 5.0;

/// The layout of a picture with one plot.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// The metres shown.
    pub(super) view: Rect,
    /// The plot's pixels.
    pub(super) plot: Rectangle,
    /// The whole picture.
    pub(super) size: Size,
    /// Ticks along x.
    pub(super) x_ticks: Vec<Tick>,
    /// Ticks along y.
    pub(super) y_ticks: Vec<Tick>,
    /// Upper end of the legend, pixels.
    pub(super) legend_top: i32,
    scale_px_per_m: f64,
}

impl Layout {
    /// Lays out a picture of an area with its overlays, a column of `side_px` pixels right of the plot, and a legend.
    ///
    /// # Errors
    /// [`DrawError::AreaNotFinite`].
    pub(super) fn new(
        area: Rect,
        overlays: &[Overlay],
        side_px: u32,
        legend: &Legend,
    ) -> Result<Layout, DrawError> {
        Ok(Layout::of(view(area, overlays)?, side_px, legend, 1.0))
    }

    /// Lays out a plot whose axes have scales of their own: `stretch` units of the plane are one unit along y.
    ///
    /// # Errors
    /// [`DrawError::AreaNotFinite`].
    pub(super) fn stretched(
        area: Rect,
        stretch: f64,
        side_px: u32,
        legend: &Legend,
    ) -> Result<Layout, DrawError> {
        Ok(Layout::of(view(area, &[])?, side_px, legend, stretch))
    }

    fn of(view: Rect, side_px: u32, legend: &Legend, stretch: f64) -> Layout {
        let (width_m, height_m) = (view.width_m(), view.height_m());
        let scale_px_per_m =
            (f64::from(PLOT_MOST.width) / width_m).min(f64::from(PLOT_MOST.height) / height_m);
        let pixels = |length_m: f64| libm::round(length_m * scale_px_per_m).max(1.0) as u32;
        let shown = Size::new(pixels(width_m), pixels(height_m));
        let x_ticks = ticks(
            view.min.x_m,
            view.max.x_m,
            (shown.width / 50).clamp(1, 12) as usize,
        );
        let mut y_ticks = ticks(
            view.min.y_m / stretch,
            view.max.y_m / stretch,
            (shown.height / 50).clamp(1, 12) as usize,
        );
        y_ticks.iter_mut().for_each(|tick| tick.value *= stretch);
        let label_px = y_ticks
            .iter()
            .map(|tick| width_px(&tick.label, SMALL))
            .max()
            .unwrap_or(0);
        let left_px = PAD_PX + SMALL.character_size.height + 9 + label_px + TICK_PX + 4;
        let needed_px = left_px + shown.width + side_px + PAD_PX;
        let width = needed_px.max(LEAST_WIDTH_PX);
        // A narrow plot stands in the middle of what is needed for the title and the legend.
        let plot = Rectangle::new(
            Pixel::new((left_px + (width - needed_px) / 2) as i32, TOP_PX as i32),
            shown,
        );
        let axis_px = TICK_PX + 2 * SMALL.character_size.height + 16;
        let legend_top = TOP_PX + shown.height + axis_px;
        let size = Size::new(
            width,
            legend_top + legend.height_px(width - 2 * PAD_PX) + PAD_PX,
        );
        Layout {
            view,
            plot,
            size,
            x_ticks,
            y_ticks,
            legend_top: legend_top as i32,
            scale_px_per_m,
        }
    }

    /// Returns where the whole picture lies in the plane.
    pub(super) fn placement(&self) -> Placement {
        let metres_per_px = 1.0 / self.scale_px_per_m;
        let x_m = self.view.min.x_m - f64::from(self.plot.top_left.x) * metres_per_px;
        let y_m = self.view.max.y_m + f64::from(self.plot.top_left.y) * metres_per_px;
        Placement {
            corner: Point::new(x_m, y_m),
            metres_per_px,
        }
    }

    /// Returns the place in the picture of a point of the plane.
    pub(super) fn place(&self, point: Point) -> At {
        At::new(self.x_px(point.x_m), self.y_px(point.y_m))
    }

    /// Returns the pixel coordinate of an x coordinate.
    pub(super) fn x_px(&self, x_m: f64) -> f64 {
        f64::from(self.plot.top_left.x) + (x_m - self.view.min.x_m) * self.scale_px_per_m
    }

    /// Returns the pixel coordinate of a y coordinate; y grows upward in the plane and downward in the picture.
    pub(super) fn y_px(&self, y_m: f64) -> f64 {
        f64::from(self.plot.top_left.y) + (self.view.max.y_m - y_m) * self.scale_px_per_m
    }

    /// Returns a length in pixels.
    pub(super) fn length_px(&self, length_m: f64) -> f64 {
        length_m * self.scale_px_per_m
    }

    /// Returns, for each pixel column of the plot from the left, which columns of a grid it shows: the one under its
    /// middle, or all under it when the grid is the finer one; empty outside the grid.
    pub(super) fn columns(
        &self,
        west_m: f64,
        pitch_m: f64,
        count: usize,
    ) -> Vec<std::ops::Range<usize>> {
        let pitch_px = self.length_px(pitch_m);
        let start_px = self.x_px(west_m) - f64::from(self.plot.top_left.x);
        (0..self.plot.size.width)
            .map(|x| shown(f64::from(x) - start_px, pitch_px, count))
            .collect()
    }

    /// Returns the same for the pixel rows of the plot from the top; grid rows run from south to north.
    pub(super) fn rows(
        &self,
        south_m: f64,
        pitch_m: f64,
        count: usize,
    ) -> Vec<std::ops::Range<usize>> {
        let pitch_px = self.length_px(pitch_m);
        let start_px = self.y_px(south_m) - f64::from(self.plot.top_left.y);
        (0..self.plot.size.height)
            .map(|y| shown(start_px - f64::from(y) - 1.0, pitch_px, count))
            .collect()
    }
}

/// Returns the indices of cells of `pitch_px` pixels that a pixel from `offset_px` to `offset_px` + 1 shows.
fn shown(offset_px: f64, pitch_px: f64, count: usize) -> std::ops::Range<usize> {
    let middle = libm::floor((offset_px + 0.5) / pitch_px);
    if !(middle >= 0.0 && middle < count as f64) {
        return 0..0;
    }
    if pitch_px >= 1.0 {
        return middle as usize..middle as usize + 1;
    }
    let (first, end) = (
        libm::floor(offset_px / pitch_px),
        libm::floor((offset_px + 1.0) / pitch_px),
    );
    (first.max(0.0) as usize).min(middle as usize)..(end as usize).clamp(middle as usize + 1, count)
}

/// Returns the metres to show: the area, and the overlays that lie near it.
///
/// # Errors
/// [`DrawError::AreaNotFinite`].
pub(super) fn view(area: Rect, overlays: &[Overlay]) -> Result<Rect, DrawError> {
    let Rect { min, max } = area;
    let error = DrawError::AreaNotFinite {
        min_x_m: min.x_m,
        max_x_m: max.x_m,
        min_y_m: min.y_m,
        max_y_m: max.y_m,
    };
    let area = Rect::new(min, max);
    if !(min.is_finite() && max.is_finite()) {
        return Err(error);
    }
    let longer_m = area.width_m().max(area.height_m());
    let size_m = if longer_m > 0.0 { longer_m } else { 1.0 };
    let (reach, rim_m) = (area.shrunk(-0.25 * size_m), 0.025 * size_m);
    let mut view = area;
    for place in overlays
        .iter()
        .flat_map(Overlay::places)
        .filter(|place| reach.contains(*place))
    {
        view.min = Point::new(
            view.min.x_m.min(place.x_m - rim_m),
            view.min.y_m.min(place.y_m - rim_m),
        );
        view.max = Point::new(
            view.max.x_m.max(place.x_m + rim_m),
            view.max.y_m.max(place.y_m + rim_m),
        );
    }
    let view = at_least(view, least_m(view));
    let view = at_least(view, view.width_m().max(view.height_m()) / ELONGATION_MOST);
    let finite = view.min.is_finite() && view.max.is_finite();
    if finite && view.width_m().is_finite() && view.height_m().is_finite() {
        Ok(view)
    } else {
        Err(error)
    }
}

/// Returns the smallest side that still has distinct coordinates in f64.
fn least_m(view: Rect) -> f64 {
    let sizes = [view.min.x_m, view.min.y_m, view.max.x_m, view.max.y_m].map(f64::abs);
    let longer_m = view.width_m().max(view.height_m());
    let largest_m = sizes.into_iter().fold(0.0, f64::max);
    let least_m = (largest_m * 1e-9).max(1e-6);
    if longer_m > 0.0 {
        least_m
    } else {
        least_m.max(1.0)
    }
}

/// Widens a rectangle about its middle until both sides have a length.
fn at_least(rect: Rect, side_m: f64) -> Rect {
    let grown = |low: f64, high: f64| {
        let more = ((side_m - (high - low)) / 2.0).max(0.0);
        (low - more, high + more)
    };
    let (west, east) = grown(rect.min.x_m, rect.max.x_m);
    let (south, north) = grown(rect.min.y_m, rect.max.y_m);
    Rect {
        min: Point::new(west, south),
        max: Point::new(east, north),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn layout(x0: f64, y0: f64, x1: f64, y1: f64) -> Result<Layout, DrawError> {
        let area = Rect {
            min: Point::new(x0, y0),
            max: Point::new(x1, y1),
        };
        Layout::new(area, &[], 80, &Legend::default())
    }

    #[test]
    fn a_metre_is_as_long_along_x_as_along_y() {
        for (width_m, height_m) in [(20.0, 20.0), (40.0, 4.0), (1.0, 300.0), (5000.0, 0.0)] {
            let layout = layout(0.0, 0.0, width_m, height_m).unwrap();
            let (a, b) = (
                layout.place(Point::new(1.0, 1.0)),
                layout.place(Point::new(2.0, 2.0)),
            );
            assert!(((b.x_px - a.x_px) - (a.y_px - b.y_px)).abs() < 1e-9);
            assert!(
                layout.size.width >= 460 && layout.size.width <= 900 && layout.size.height <= 760
            );
            assert!(layout.plot.size.width >= 100 && layout.plot.size.height >= 100);
        }
    }

    #[test]
    fn overlays_near_the_area_are_shown_and_far_ones_are_not() {
        let dot = |x_m: f64| Overlay::Viewpoint {
            at: Point::new(x_m, 5.0),
        };
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(10.0, 10.0));
        let east_m = |x_m: f64| view(area, &[dot(x_m)]).unwrap().max.x_m;
        assert_eq!(east_m(5.0), 10.0);
        assert!(east_m(11.0) > 11.0);
        assert_eq!(east_m(1e9), 10.0);
        assert_eq!(east_m(f64::NAN), 10.0);
    }

    #[test]
    fn an_area_that_is_not_finite_is_refused() {
        assert!(layout(0.0, 0.0, f64::INFINITY, 1.0).is_err());
        assert!(layout(f64::NAN, 0.0, 1.0, 1.0).is_err());
        assert!(layout(-1e308, -1e308, 1e308, 1e308).is_err());
        assert!(layout(3.0, 3.0, 3.0, 3.0).is_ok());
    }

    proptest! {
        #[test]
        fn any_finite_area_gets_a_picture(x in -1e12..1e12f64, y in -1e12..1e12f64, e in -12..9i32, f in -12..9i32) {
            let layout = layout(x, y, x + 10f64.powi(e), y + 10f64.powi(f)).unwrap();
            prop_assert!(layout.size.width <= 960 && layout.size.height <= 760);
            let west = layout.columns(layout.view.min.x_m, layout.view.width_m() / 7.0, 7);
            prop_assert!(west.iter().all(|range| range.end <= 7));
        }
    }
}
