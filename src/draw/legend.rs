//! The legend below the plot: one sample and one name for each kind of thing shown.

use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::primitives::Rectangle;

use super::colour::{INK, Theme};
use super::overlay::{Mark, Overlay};
use super::paint::sample;
use super::raster::Picture;
use super::text::{SMALL, short, width_px, write};

const TILE: Size = Size::new(34, 18);
const ROW_PX: u32 = 26;
const GAP_PX: u32 = 20;
const TRACKS_MOST: usize = 8;

/// A sample as the legend shows it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum LegendSample {
    /// A mark on the plot's ground.
    Mark(Mark),
    /// A colour of the plot.
    Fill(Rgb888),
}

/// One line of the legend.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct LegendEntry {
    pub(super) sample: LegendSample,
    pub(super) text: String,
}

/// The legend; empty when there is nothing to explain.
#[derive(Clone, Debug, Default)]
pub(super) struct Legend {
    entries: Vec<LegendEntry>,
}

impl Legend {
    /// Makes the legend from colours to explain and from the overlays that are drawn, each kind once, each vehicle's track
    /// once.
    pub(super) fn new<'a>(
        fills: Vec<LegendEntry>,
        overlays: impl IntoIterator<Item = &'a Overlay>,
    ) -> Legend {
        let mut marks: Vec<(Mark, String)> = overlays
            .into_iter()
            .filter(|overlay| overlay.is_drawn())
            .map(|overlay| (overlay.legend_mark(), short(&overlay.legend_text(), 32)))
            .collect();
        marks.sort();
        marks.dedup();
        let is_track = |mark: &Mark| matches!(mark, Mark::Track(_));
        if marks.iter().filter(|(mark, _)| is_track(mark)).count() > TRACKS_MOST {
            marks.retain(|(mark, _)| !is_track(mark));
            marks.push((
                Mark::Track(None),
                "tracks, in their vehicles' colours".to_string(),
            ));
        }
        let marks = marks.into_iter().map(|(mark, text)| LegendEntry {
            sample: LegendSample::Mark(mark),
            text,
        });
        Legend {
            entries: fills.into_iter().chain(marks).collect(),
        }
    }

    /// Returns the height when laid out within a width, pixels.
    pub(super) fn height_px(&self, width_px: u32) -> u32 {
        self.corners(width_px)
            .last()
            .map_or(0, |corner| corner.y as u32 + ROW_PX)
    }

    /// Draws the legend with its upper left corner at a place.
    pub(super) fn draw(&self, picture: &mut Picture, theme: &Theme, at: Point, width_px: u32) {
        for (entry, corner) in self.entries.iter().zip(self.corners(width_px)) {
            let tile = Rectangle::new(at + corner + Point::new(1, 3), TILE);
            match entry.sample {
                LegendSample::Mark(mark) => sample(picture, theme, mark, tile),
                LegendSample::Fill(colour) => picture.fill(tile, colour),
            }
            picture.frame(tile, INK);
            let text_at = tile.top_left + Point::new(TILE.width as i32 + 8, 2);
            write(picture, &entry.text, text_at, SMALL, INK);
        }
    }

    /// Returns the upper left corner of each entry, row after row.
    fn corners(&self, room_px: u32) -> Vec<Point> {
        let mut next = Point::zero();
        let mut corners = Vec::with_capacity(self.entries.len());
        for entry in &self.entries {
            let wide = (TILE.width + 10 + width_px(&entry.text, SMALL)) as i32;
            if next.x > 0 && next.x + wide > room_px as i32 {
                next = Point::new(0, next.y + ROW_PX as i32);
            }
            corners.push(next);
            next.x += wide + GAP_PX as i32;
        }
        corners
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom;
    use tomoswarm_proto::VehicleId;

    fn track(vehicle: u8) -> Overlay {
        Overlay::Track {
            points: vec![geom::Point::default()],
            vehicle: VehicleId(vehicle),
        }
    }

    #[test]
    fn each_kind_is_named_once() {
        let dot = |vehicle: u8| Overlay::Vehicle {
            at: geom::Point::default(),
            vehicle: VehicleId(vehicle),
        };
        let legend = Legend::new(Vec::new(), &[dot(1), track(2), dot(2), track(1), track(2)]);
        let texts: Vec<&str> = legend
            .entries
            .iter()
            .map(|entry| entry.text.as_str())
            .collect();
        assert_eq!(
            texts,
            [
                "track of vehicle 1",
                "track of vehicle 2",
                "vehicle, in its colour"
            ]
        );
    }

    #[test]
    fn what_is_not_drawn_is_not_named() {
        let nobody_drove = Overlay::Track {
            points: Vec::new(),
            vehicle: VehicleId(1),
        };
        let round = Overlay::Outline {
            polygon: geom::Polygon::new(vec![geom::Point::default()]),
            label: None,
        };
        let legend = Legend::new(Vec::new(), &[nobody_drove, round]);
        let texts: Vec<&str> = legend
            .entries
            .iter()
            .map(|entry| entry.text.as_str())
            .collect();
        assert_eq!(texts, ["true outline"]);
    }

    #[test]
    fn entries_stay_within_the_width() {
        let tracks: Vec<Overlay> = (1..8).map(track).collect();
        let legend = Legend::new(Vec::new(), &tracks);
        assert!(
            legend
                .corners(432)
                .iter()
                .all(|corner| corner.x + 44 + 7 * 18 <= 432)
        );
        assert!(legend.height_px(432) > legend.height_px(2000));
        let many: Vec<Overlay> = (1..50).map(track).collect();
        assert_eq!(Legend::new(Vec::new(), &many).entries.len(), 1);
    }
}
