//! Finished pictures for tests: read back as pixels. Knows nothing of what they show.

/// Returns the width of a PNG without transparency, pixels, and its pixels row by row.
pub(crate) fn decoded(png: &[u8]) -> (usize, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png))
        .read_info()
        .unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut bytes).unwrap();
    assert_eq!(frame.color_type, png::ColorType::Rgb);
    let (pixels, rest) = bytes.as_chunks::<3>();
    assert!(rest.is_empty());
    (frame.width as usize, pixels.to_vec())
}
