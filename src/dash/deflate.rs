//! Bytes that are kept for long, compressed: what vehicles say is much the same again and again.

use std::io::{Read as _, Write as _};

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;

/// Compresses bytes, fast.
pub(super) fn deflate(bytes: &[u8]) -> Box<[u8]> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    // A vector takes all that is written.
    written.unwrap_or_default().into_boxed_slice()
}

/// Puts in place of bytes those that [`deflate`] has compressed.
pub(super) fn inflate(compressed: &[u8], to: &mut Vec<u8>) {
    to.clear();
    // What was compressed here can be read.
    let _read = DeflateDecoder::new(compressed).read_to_end(to);
}
