//! Text in embedded-graphics' built-in fonts (ISO 8859-1; other characters appear as question marks).

use embedded_graphics::Drawable;
use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{Dimensions, OriginDimensions, Point};
use embedded_graphics::mono_font::iso_8859_1::{FONT_7X14, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::primitives::Rectangle;
use embedded_graphics::text::{Baseline, Text};

use super::raster::Picture;

/// For ticks, labels and the legend.
pub(super) const SMALL: &MonoFont = &FONT_7X14;

/// For the title.
pub(super) const LARGE: &MonoFont = &FONT_10X20;

/// Returns the width of a text, pixels.
pub(super) fn width_px(text: &str, font: &MonoFont) -> u32 {
    text.chars().count() as u32 * (font.character_size.width + font.character_spacing)
}

/// Returns a text on one line, cut to `most` characters with an ellipsis.
pub(super) fn short(text: &str, most: usize) -> String {
    let line = |c: char| if c.is_control() { ' ' } else { c };
    let cut = text.chars().nth(most).is_some();
    let kept = if cut { most.saturating_sub(3) } else { most };
    text.chars()
        .take(kept)
        .map(line)
        .chain("...".chars().take(if cut { 3 } else { 0 }))
        .collect()
}

/// Writes a text with its upper left corner at a place.
pub(super) fn write(picture: &mut Picture, text: &str, at: Point, font: &MonoFont, colour: Rgb888) {
    let style = MonoTextStyle::new(font, colour);
    let Ok(_) = Text::with_baseline(text, at, style, Baseline::Top).draw(picture);
}

/// Writes a text with a rim of another colour, so that it reads on any ground.
pub(super) fn write_rimmed(
    picture: &mut Picture,
    text: &str,
    at: Point,
    colour: Rgb888,
    rim: Rgb888,
) {
    for by in [
        (-1, -1),
        (0, -1),
        (1, -1),
        (-1, 0),
        (1, 0),
        (-1, 1),
        (0, 1),
        (1, 1),
    ] {
        write(picture, text, at + Point::new(by.0, by.1), SMALL, rim);
    }
    write(picture, text, at, SMALL, colour);
}

/// Writes a text that runs upward; `foot` is where its upper left corner lies when read with the head to the left.
pub(super) fn write_upward(
    picture: &mut Picture,
    text: &str,
    foot: Point,
    font: &MonoFont,
    colour: Rgb888,
) {
    let style = MonoTextStyle::new(font, colour);
    let Ok(_) = Text::with_baseline(text, Point::zero(), style, Baseline::Top)
        .draw(&mut Upward { picture, foot });
}

/// A target that turns what is drawn a quarter to the left.
struct Upward<'a> {
    picture: &'a mut Picture,
    foot: Point,
}

impl Dimensions for Upward<'_> {
    fn bounding_box(&self) -> Rectangle {
        Rectangle::new(Point::zero(), self.picture.size())
    }
}

impl DrawTarget for Upward<'_> {
    type Color = Rgb888;
    type Error = std::convert::Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Self::Error> {
        for Pixel(at, colour) in pixels {
            self.picture
                .set(self.foot + Point::new(at.y, -at.x), colour);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_and_broken_text_becomes_one_short_line() {
        assert_eq!(short("two\nlines", 20), "two lines");
        assert_eq!(short("abcdefghij", 10), "abcdefghij");
        assert_eq!(short("abcdefghijk", 10), "abcdefg...");
        assert_eq!(width_px("äö", SMALL), 14);
    }
}
