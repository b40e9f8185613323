//! The colour bar: which colour means which value, and what lies beyond its ends.

use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::primitives::Rectangle;

use super::colour::{ColourMap, INK};
use super::raster::Picture;
use super::text::{SMALL, short, width_px, write};
use super::ticks::{number, ticks};

const GAP_PX: i32 = 26;
const BAR_PX: i32 = 18;
const LABEL_GAP_PX: i32 = 10;
const ARROW_PX: i32 = 9;

/// A colour bar from `low` to `high`.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Bar {
    pub(super) low: f64,
    pub(super) high: f64,
    /// The smallest value shown, when it lies below the bar.
    pub(super) lowest: Option<f64>,
    /// The largest value shown, when it lies above the bar.
    pub(super) highest: Option<f64>,
    pub(super) unit: String,
}

impl Bar {
    /// Makes the bar for values: the asked range when it is usable, else from zero to the largest value.
    pub(super) fn new(values: &[f64], asked: Option<(f64, f64)>, unit: &str) -> Bar {
        let finite = || values.iter().copied().filter(|value| value.is_finite());
        let lowest = finite().min_by(f64::total_cmp).unwrap_or(0.0);
        let highest = finite().max_by(f64::total_cmp).unwrap_or(0.0);
        let usable = asked.filter(|(low, high)| low < high && (high - low).is_finite());
        let (low, high) = usable.unwrap_or((0.0, if highest > 0.0 { highest } else { 1.0 }));
        Bar {
            low,
            high,
            lowest: Some(lowest).filter(|value| *value < low),
            highest: Some(highest).filter(|value| *value > high),
            unit: short(unit, 16),
        }
    }

    /// Returns the share of the bar at which a value lies; outside 0..1 beyond its ends.
    pub(super) fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// Returns the width it needs right of the plot, pixels.
    pub(super) fn side_px(&self) -> u32 {
        let labels = (1..=8)
            .flat_map(|most| ticks(self.low, self.high, most))
            .map(|tick| tick.label);
        let label_px = labels
            .map(|label| width_px(&label, SMALL))
            .max()
            .unwrap_or(0);
        let beside_px = (BAR_PX + LABEL_GAP_PX) as u32 + label_px;
        let notes = [
            self.note_above(),
            self.note_below(),
            Some(self.unit.clone()),
        ];
        let note_px = notes
            .iter()
            .flatten()
            .map(|note| width_px(note, SMALL))
            .max()
            .unwrap_or(0);
        GAP_PX as u32 + beside_px.max(note_px)
    }

    /// Draws the bar right of a plot and as high as it.
    pub(super) fn draw(&self, picture: &mut Picture, colours: &ColourMap, plot: Rectangle) {
        let left = plot.top_left.x + plot.size.width as i32 + GAP_PX;
        let bottom = plot.top_left.y + plot.size.height as i32;
        let line_px = SMALL.character_size.height as i32;
        let unit_up_px = if self.highest.is_some() {
            2 * line_px + 3
        } else {
            line_px + 6
        };
        write(
            picture,
            &self.unit,
            Point::new(left, plot.top_left.y - unit_up_px),
            SMALL,
            INK,
        );
        let room = |note: &Option<f64>| if note.is_some() { ARROW_PX + 3 } else { 0 };
        let top = plot.top_left.y + room(&self.highest);
        let height = (bottom - room(&self.lowest) - top).max(1);
        let body = Rectangle::new(
            Point::new(left, top),
            Size::new(BAR_PX as u32, height as u32),
        );
        for y in 0..height {
            let share = 1.0 - (f64::from(y) + 0.5) / f64::from(height);
            let line = Rectangle::new(Point::new(left, top + y), Size::new(BAR_PX as u32, 1));
            picture.fill(line, colours.at(share));
        }
        picture.frame(body, INK);
        self.ticks(picture, body);
        if let Some(note) = self.note_above() {
            arrow(picture, colours, Point::new(left, top - 3), -1, 1.0);
            write(
                picture,
                &note,
                Point::new(left, plot.top_left.y - line_px - 3),
                SMALL,
                INK,
            );
        }
        if let Some(note) = self.note_below() {
            arrow(picture, colours, Point::new(left, top + height + 2), 1, 0.0);
            write(picture, &note, Point::new(left, bottom + 8), SMALL, INK);
        }
    }

    fn ticks(&self, picture: &mut Picture, body: Rectangle) {
        let right = body.top_left.x + BAR_PX + 1;
        let height = body.size.height;
        for tick in ticks(self.low, self.high, (height / 40).clamp(1, 8) as usize) {
            let down = libm::floor((1.0 - self.share(tick.value)) * f64::from(height)) as i32;
            let y = body.top_left.y + down.clamp(0, height as i32 - 1);
            picture.fill(Rectangle::new(Point::new(right, y), Size::new(4, 1)), INK);
            write(
                picture,
                &tick.label,
                Point::new(right + LABEL_GAP_PX - 3, y - 7),
                SMALL,
                INK,
            );
        }
    }

    fn note_above(&self) -> Option<String> {
        self.highest.map(|value| format!("max {}", number(value)))
    }

    fn note_below(&self) -> Option<String> {
        self.lowest.map(|value| format!("min {}", number(value)))
    }
}

/// Draws a triangle from a base line; `step` -1 points up, 1 points down.
fn arrow(picture: &mut Picture, colours: &ColourMap, base: Point, step: i32, share: f64) {
    for i in 0..ARROW_PX {
        let line = Rectangle::new(
            base + Point::new(i, i * step),
            Size::new((BAR_PX - 2 * i) as u32, 1),
        );
        picture.fill(line, INK);
        let inner = Rectangle::new(
            line.top_left + Point::new(1, 0),
            Size::new(line.size.width.saturating_sub(2), 1),
        );
        if i > 0 {
            picture.fill(inner, colours.at(share));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_begins_at_zero_and_notes_what_is_below() {
        let bar = Bar::new(&[-0.5, 0.2, 2.0, f64::NAN, f64::INFINITY], None, "dB/m");
        assert_eq!(
            (bar.low, bar.high, bar.lowest, bar.highest),
            (0.0, 2.0, Some(-0.5), None)
        );
        assert_eq!(bar.note_below().as_deref(), Some("min -0.50"));
        assert_eq!(bar.share(1.0), 0.5);
    }

    #[test]
    fn an_unusable_range_is_replaced() {
        for asked in [
            (1.0, 1.0),
            (2.0, 1.0),
            (f64::NAN, 1.0),
            (-1e308, 1e308),
            (0.0, f64::INFINITY),
        ] {
            assert_eq!(Bar::new(&[4.0], Some(asked), "").high, 4.0);
        }
        assert_eq!(Bar::new(&[4.0], Some((-1.0, 3.0)), "").highest, Some(4.0));
        assert_eq!(Bar::new(&[-3.0, -3.0], None, "").high, 1.0);
        assert_eq!(Bar::new(&[], None, "").lowest, None);
    }
}
