//! The raster: three bytes a pixel, a target for embedded-graphics, and its encoding as PNG.

use std::convert::Infallible;

use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::primitives::Rectangle;

use super::DrawError;
use super::colour::{PAPER, mix};

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
        encoded(std::slice::from_ref(self), &[])
    }

    /// Encodes pictures as an animated PNG that shows each for its time (milliseconds) and begins anew; programs that know no
    /// animations show the last. Smaller pictures are filled up with paper at their right and lower ends.
    ///
    /// # Errors
    /// [`DrawError::Encoding`]: no picture at all.
    pub fn animation(frames: &[(Picture, u16)]) -> Result<Vec<u8>, DrawError> {
        let size = |of: fn(&Picture) -> usize| frames.iter().map(|(frame, _)| of(frame)).max();
        let width_px = size(|frame| frame.width_px).unwrap_or(0);
        let height_px = size(|frame| frame.height_px).unwrap_or(0);
        let filled: Vec<Picture> = frames
            .last()
            .into_iter()
            .chain(frames)
            .map(|(frame, _)| frame.filled_up(width_px, height_px))
            .collect();
        let times_ms: Vec<u16> = frames.iter().map(|(_, time_ms)| *time_ms).collect();
        encoded(&filled, &times_ms)
    }

    /// Encodes pictures as one, so many beside each other, row by row.
    ///
    /// # Errors
    /// [`DrawError::Encoding`]: no picture at all.
    pub fn tiled(pictures: &[Picture], beside: usize) -> Result<Vec<u8>, DrawError> {
        let size = |of: fn(&Picture) -> usize| pictures.iter().map(of).max().unwrap_or(0);
        let (width_px, height_px) = (size(|one| one.width_px), size(|one| one.height_px));
        let columns = beside.clamp(1, pictures.len().max(1));
        let rows = pictures.len().div_ceil(columns);
        let all = Size::new((columns * width_px) as u32, (rows * height_px) as u32);
        let mut tiled = Picture::new(all, PAPER);
        for (index, picture) in pictures.iter().enumerate() {
            let (left, top) = (index % columns * width_px, index / columns * height_px);
            for (row, line) in picture.rgb.chunks(3 * picture.width_px.max(1)).enumerate() {
                let start = 3 * ((top + row) * tiled.width_px + left);
                tiled.rgb[start..start + line.len()].copy_from_slice(line);
            }
        }
        tiled.png()
    }

    fn filled_up(&self, width_px: usize, height_px: usize) -> Picture {
        let size = Size::new(width_px as u32, height_px as u32);
        let mut larger = Picture::new(size, PAPER);
        for (row, line) in self.rgb.chunks(3 * self.width_px.max(1)).enumerate() {
            let start = 3 * row * width_px;
            larger.rgb[start..start + line.len()].copy_from_slice(line);
        }
        larger
    }

    fn start_of(&self, at: Point) -> Option<usize> {
        let (x, y) = (usize::try_from(at.x).ok()?, usize::try_from(at.y).ok()?);
        (x < self.width_px && y < self.height_px).then_some((y * self.width_px + x) * 3)
    }
}

/// Encodes pictures of one size: one as it is; of several the first is what programs show that know no animations.
fn encoded(frames: &[Picture], times_ms: &[u16]) -> Result<Vec<u8>, DrawError> {
    let refused = |error: png::EncodingError| DrawError::Encoding {
        reason: error.to_string(),
    };
    let (width_px, height_px) = frames
        .first()
        .map_or((0, 0), |first| (first.width_px, first.height_px));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width_px as u32, height_px as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    if frames.len() > 1 {
        let count = frames.len() as u32 - 1;
        encoder.set_animated(count, 0).map_err(refused)?;
        encoder.set_sep_def_img(true).map_err(refused)?;
    }
    let software = concat!("tomoswarm ", env!("CARGO_PKG_VERSION"));
    encoder
        .add_text_chunk("Software".to_owned(), software.to_owned())
        .map_err(refused)?;
    let mut writer = encoder.write_header().map_err(refused)?;
    for (index, frame) in frames.iter().enumerate() {
        let shown_ms = index.checked_sub(1).and_then(|frame| times_ms.get(frame));
        if let Some(time_ms) = shown_ms {
            writer.set_frame_delay(*time_ms, 1000).map_err(refused)?;
        }
        writer.write_image_data(&frame.rgb).map_err(refused)?;
    }
    writer.finish().map_err(refused)?;
    Ok(bytes)
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

    #[test]
    fn an_animation_holds_all_pictures_at_the_size_of_the_largest() {
        let red = Picture::new(Size::new(3, 2), Rgb888::RED);
        let blue = Picture::new(Size::new(2, 4), Rgb888::BLUE);
        let bytes = Picture::animation(&[(red, 200), (blue, 900)]).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes[..]))
            .read_info()
            .unwrap();
        let control = reader.info().animation_control.unwrap();
        assert_eq!((control.num_frames, control.num_plays), (2, 0));
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels[..3], [0, 0, 255], "the last one stands for all");
        for (at, colour, delay_ms) in [(0, [255, 0, 0], 200), (9, [0, 0, 255], 900)] {
            let frame = reader.next_frame(&mut pixels).unwrap();
            assert_eq!((frame.width, frame.height), (3, 4));
            assert_eq!(pixels[3 * at..3 * at + 3], colour);
            let shown = reader.info().frame_control.unwrap();
            assert_eq!((shown.delay_num, shown.delay_den), (delay_ms, 1000));
        }
        assert_eq!(pixels[6..9], [255; 3], "filled up");
        assert!(Picture::animation(&[]).is_err());
    }
}
