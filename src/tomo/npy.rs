//! Images as NumPy files (format version 1.0), as bytes; writing the file is the caller's work.

use super::Image;

/// Returns the bytes of a `.npy` file: little-endian f32, C order, shape (rows, columns), rows from south to north.
pub fn npy_bytes(image: &Image) -> Vec<u8> {
    let (rows, columns) = (image.grid.rows, image.grid.columns);
    npy_of(&format!("{rows}, {columns}"), &image.values)
}

/// Returns the bytes of such a file for values of any shape, written as its numbers with commas between.
pub fn npy_of(shape: &str, values: &[f64]) -> Vec<u8> {
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
    // Magic (6), version (2) and length (2) come before; the data begin at a multiple of 64.
    let padding = 63 - (10 + header.len()) % 64;
    header.push_str(&" ".repeat(padding));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(
        values
            .iter()
            .flat_map(|value| (*value as f32).to_le_bytes()),
    );
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{PixelGrid, Point, Rect};

    #[test]
    fn a_small_image_has_the_bytes_that_numpy_writes() {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(2.0, 1.0));
        let image = Image {
            grid: PixelGrid {
                area,
                columns: 2,
                rows: 1,
            },
            values: vec![1.0, -2.5],
        };
        let bytes = npy_bytes(&image);
        assert_eq!(&bytes[..10], b"\x93NUMPY\x01\x00\x76\x00");
        assert!(
            bytes[10..128]
                .starts_with(b"{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }   ")
        );
        assert_eq!(bytes[127], b'\n');
        assert_eq!(&bytes[128..], [0, 0, 0x80, 0x3f, 0, 0, 0x20, 0xc0]);
    }
}
