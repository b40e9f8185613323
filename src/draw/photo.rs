//! A picture whose every pixel is given: views of a scene, rendered elsewhere.
//!
//! No axes, no legend, no text: what is seen is all there is.

use embedded_graphics::geometry::{Point as Pixel, Size};
use embedded_graphics::pixelcolor::Rgb888;

use super::DrawError;
use super::colour::PAPER;
use super::raster::Picture;

/// Colours for things that have none of their own, in the order in which they are given out: red, green, blue.
pub const COLOURS: [[u8; 3]; 10] = [
    [168, 150, 128],
    [122, 140, 158],
    [176, 122, 98],
    [140, 156, 112],
    [196, 172, 110],
    [134, 118, 150],
    [104, 146, 142],
    [186, 140, 150],
    [120, 120, 116],
    [214, 196, 170],
];

impl Picture {
    /// Returns a picture as PNG bytes; `rgb` are its pixels row by row from the top, left to right.
    ///
    /// # Errors
    /// [`DrawError::ValueCount`].
    pub fn photo(width_px: usize, rgb: &[[u8; 3]]) -> Result<Vec<u8>, DrawError> {
        let rows = rgb.len().checked_div(width_px).unwrap_or(0);
        if width_px == 0 || rows * width_px != rgb.len() || rgb.is_empty() {
            return Err(DrawError::ValueCount {
                columns: width_px,
                rows,
                got: rgb.len(),
            });
        }
        let mut picture = Picture::new(Size::new(width_px as u32, rows as u32), PAPER);
        for (index, [red, green, blue]) in rgb.iter().enumerate() {
            let at = Pixel::new((index % width_px) as i32, (index / width_px) as i32);
            picture.set(at, Rgb888::new(*red, *green, *blue));
        }
        picture.png()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::tests_support::decoded;

    #[test]
    fn every_pixel_is_where_it_was_given() {
        let rgb: Vec<[u8; 3]> = (0..12).map(|i| [i, 2 * i, 255 - i]).collect();
        let png = Picture::photo(4, &rgb).unwrap();
        assert_eq!(decoded(&png), (4, rgb));
    }

    #[test]
    fn pixels_that_make_no_rectangle_are_refused() {
        for (width_px, count) in [(4, 11), (0, 4), (3, 0), (0, 0), (5, 4)] {
            assert!(Picture::photo(width_px, &vec![[0; 3]; count]).is_err());
        }
    }
}
