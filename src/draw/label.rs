//! Labels beside their marks, placed so that none covers a mark, another label or the plot's border.

use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::primitives::Rectangle;

use super::text::{SMALL, short, width_px};

/// Beyond this many the plot is too full to read anyway.
const MOST: usize = 300;

/// A label that found its place.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Placed {
    pub(super) text: String,
    pub(super) at: Point,
    pub(super) colour: Rgb888,
}

/// Places for labels within a plot.
#[derive(Clone, Debug)]
pub(super) struct Labels {
    plot: Rectangle,
    taken: Vec<Rectangle>,
    placed: Vec<Placed>,
}

impl Labels {
    /// Starts with an empty plot.
    pub(super) fn new(plot: Rectangle) -> Labels {
        Labels {
            plot,
            taken: Vec::new(),
            placed: Vec::new(),
        }
    }

    /// Keeps a rectangle free of labels.
    pub(super) fn keep_free(&mut self, mark: Rectangle) {
        if self.taken.len() < 8 * MOST {
            self.taken.push(mark);
        }
    }

    /// Places a label beside a mark, first to its sides or first above and below; leaves it out when all places near
    /// the mark are taken.
    pub(super) fn place(&mut self, mark: Rectangle, text: &str, colour: Rgb888, sides_first: bool) {
        let text = short(text, 32);
        if text.trim().is_empty() || self.placed.len() >= MOST {
            return;
        }
        let size = Size::new(width_px(&text, SMALL), SMALL.character_size.height);
        let rings = [4, 10, 19];
        let free = rings
            .into_iter()
            .flat_map(|gap_px| around(mark, size, gap_px, sides_first))
            .find(|candidate| {
                let inside = candidate.intersection(&self.plot) == *candidate;
                inside
                    && self
                        .taken
                        .iter()
                        .all(|taken| taken.intersection(candidate).size.width == 0)
            });
        if let Some(rectangle) = free {
            self.taken.push(rectangle);
            self.placed.push(Placed {
                text,
                at: rectangle.top_left,
                colour,
            });
        }
    }

    /// Returns the labels that found a place.
    pub(super) fn placed(&self) -> &[Placed] {
        &self.placed
    }
}

/// Returns eight rectangles of a size around a mark, at a gap.
fn around(mark: Rectangle, size: Size, gap_px: i32, sides_first: bool) -> [Rectangle; 8] {
    let Rectangle {
        top_left,
        size: marked,
    } = mark;
    let (width, height) = (size.width as i32, size.height as i32);
    let east = top_left.x + marked.width as i32 + gap_px;
    let west = top_left.x - width - gap_px;
    let below = top_left.y + marked.height as i32 + gap_px;
    let above = top_left.y - height - gap_px;
    let middle_x = top_left.x + (marked.width as i32 - width) / 2;
    let middle_y = top_left.y + (marked.height as i32 - height) / 2;
    let sides = [(east, middle_y), (west, middle_y)];
    let ends = [(middle_x, above), (middle_x, below)];
    let (first, then) = if sides_first {
        (sides, ends)
    } else {
        (ends, sides)
    };
    let corners = [(east, above), (east, below), (west, above), (west, below)];
    let place = |(x, y): (i32, i32)| Rectangle::new(Point::new(x, y), size);
    [
        first[0], first[1], then[0], then[1], corners[0], corners[1], corners[2], corners[3],
    ]
    .map(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_graphics::pixelcolor::RgbColor;

    fn mark(x: i32, y: i32) -> Rectangle {
        Rectangle::new(Point::new(x, y), Size::new(10, 10))
    }

    #[test]
    fn labels_never_overlap_and_stay_in_the_plot() {
        let plot = Rectangle::new(Point::new(50, 50), Size::new(300, 200));
        let mut labels = Labels::new(plot);
        let marks: Vec<Rectangle> = (0..40)
            .map(|i| mark(45 + i * 37 % 300, 48 + i * 53 % 200))
            .collect();
        marks.iter().for_each(|mark| labels.keep_free(*mark));
        marks
            .iter()
            .for_each(|mark| labels.place(*mark, "label", Rgb888::WHITE, true));
        let placed: Vec<Rectangle> = labels
            .placed()
            .iter()
            .map(|label| Rectangle::new(label.at, Size::new(35, 14)))
            .collect();
        assert!(placed.len() > 20, "{}", placed.len());
        for (i, label) in placed.iter().enumerate() {
            assert_eq!(label.intersection(&plot), *label);
            let others = marks.iter().chain(&placed[..i]);
            assert!(
                others
                    .clone()
                    .all(|other| other.intersection(label).size.width == 0)
            );
        }
    }

    #[test]
    fn a_mark_at_the_right_border_is_labelled_on_its_left() {
        let mut labels = Labels::new(Rectangle::new(Point::zero(), Size::new(300, 200)));
        labels.place(mark(288, 100), "rover", Rgb888::WHITE, true);
        assert_eq!(labels.placed()[0].at.x, 288 - 4 - 35);
    }
}
