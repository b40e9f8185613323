//! The raster: three bytes a pixel, a target for embedded-graphics, and its encoding as PNG.

use std::convert::Infallible;

use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::primitives::Rectangle;

use super::DrawError;
use super::colour::mix;

/// A picture of red, green and blue bytes; row 0 is the top one.
#[derive(Clone, PartialEq, Debug)]
pub struct Picture {
    width_px: usize,
    height_px: usize,
    rgb: Vec<u8>,
}

impl Picture {
    /// Makes a picture of one colour.
    pub(super) fn new(size: Size, colour: Rgb888) -> Picture {
        let (width_px, height_px) = (size.width as usize, size.height as usize);
        let rgb = [colour.r(), colour.g(), colour.b()].repeat(width_px * height_px);
        Picture {
            width_px,
            height_px,
            rgb,
        }
    }

    /// Draws a frame one pixel outside a rectangle.
    pub(super) fn frame(&mut self, inside: Rectangle, colour: Rgb888) {
        let Rectangle { top_left, size } = inside;
        let (width, height) = (size.width + 2, size.height + 2);
        let corner = top_left - Point::new(1, 1);
        let right = corner + Point::new(size.width as i32 + 1, 0);
        let below = corner + Point::new(0, size.height as i32 + 1);
        for (at, size) in [
            (corner, Size::new(width, 1)),
            (below, Size::new(width, 1)),
            (corner, Size::new(1, height)),
            (right, Size::new(1, height)),
        ] {
            self.fill(Rectangle::new(at, size), colour);
        }
    }

    /// Sets a pixel; one outside the picture is ignored.
    pub(super) fn set(&mut self, at: Point, colour: Rgb888) {
        if let Some(start) = self.start_of(at) {
            self.rgb[start..start + 3].copy_from_slice(&[colour.r(), colour.g(), colour.b()]);
        }
    }

    /// Lays a colour over a pixel with an opacity (0 to 1).
    pub(super) fn lay(&mut self, at: Point, colour: Rgb888, opacity: f64) {
        if let Some(under) = self.colour_at(at) {
            self.set(at, mix(under, colour, opacity));
        }
    }

    /// Returns the colour of a pixel; `None` outside the picture.
    pub(super) fn colour_at(&self, at: Point) -> Option<Rgb888> {
        self.start_of(at)
            .map(|start| Rgb888::new(self.rgb[start], self.rgb[start + 1], self.rgb[start + 2]))
    }

    /// Fills a rectangle.
    pub(super) fn fill(&mut self, rectangle: Rectangle, colour: Rgb888) {
        let Ok(()) = self.fill_solid(&rectangle, colour);
    }

    /// Encodes the picture as PNG (8-bit RGB, no time stamp: equal pictures give equal bytes).
    ///
    /// # Errors
    /// [`DrawError::Encoding`] when the encoder refuses, which a picture of nonzero size never causes.
    pub(super) fn png(&self) -> Result<Vec<u8>, DrawError> {
        let refused = |error: png::EncodingError| DrawError::Encoding {
            reason: error.to_string(),
        };
        let mut bytes = Vec::new();
        let mut encoder =
            png::Encoder::new(&mut bytes, self.width_px as u32, self.height_px as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        let software = concat!("tomoswarm ", env!("CARGO_PKG_VERSION"));
        encoder
            .add_text_chunk("Software".to_owned(), software.to_owned())
            .map_err(refused)?;
        let mut writer = encoder.write_header().map_err(refused)?;
        writer.write_image_data(&self.rgb).map_err(refused)?;
        writer.finish().map_err(refused)?;
        Ok(bytes)
    }

    fn start_of(&self, at: Point) -> Option<usize> {
        let (x, y) = (usize::try_from(at.x).ok()?, usize::try_from(at.y).ok()?);
        (x < self.width_px && y < self.height_px).then_some((y * self.width_px + x) * 3)
    }
}

impl OriginDimensions for Picture {
    fn size(&self) -> Size {
        Size::new(self.width_px as u32, self.height_px as u32)
    }
}

impl DrawTarget for Picture {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            self.set(at, colour);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_outside_the_picture_are_ignored() {
        let mut picture = Picture::new(Size::new(3, 2), Rgb888::WHITE);
        let white = picture.clone();
        for at in [
            Point::new(-1, 0),
            Point::new(3, 0),
            Point::new(0, 2),
            Point::new(i32::MAX, i32::MIN),
        ] {
            picture.set(at, Rgb888::BLACK);
            picture.lay(at, Rgb888::BLACK, 0.5);
        }
        assert_eq!(picture, white);
        picture.set(Point::new(2, 1), Rgb888::new(1, 2, 3));
        assert_eq!(picture.rgb[15..], [1, 2, 3]);
    }
}
