//! Words inside a finished PNG file: what it was made from, for whoever finds it alone.

/// The keyword of the words (PNG specification, 11.3.3.1).
const KEYWORD: &str = "Source";
/// Bytes of the signature and of the chunk IHDR, after which words may stand.
const HEADER_BYTES: usize = 8 + 25;

/// Returns a PNG file with words as a text chunk; what is not of Latin-1 becomes a question mark.
pub fn described(png: Vec<u8>, words: &str) -> Vec<u8> {
    if png.len() < HEADER_BYTES {
        return png;
    }
    let latin = words.chars().map(|c| u8::try_from(c).unwrap_or(b'?'));
    let mut chunk = b"tEXt".to_vec();
    chunk.extend(KEYWORD.bytes().chain([0]).chain(latin));
    let length = (chunk.len() - 4) as u32;
    let (header, rest) = png.split_at(HEADER_BYTES);
    let parts: [&[u8]; 5] = [
        header,
        &length.to_be_bytes(),
        &chunk,
        &checksum(&chunk).to_be_bytes(),
        rest,
    ];
    parts.concat()
}

/// Returns the checksum of a chunk (CRC-32 of ISO 3309).
fn checksum(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            let is_odd = crc & 1 == 1;
            crc >>= 1;
            if is_odd {
                crc ^= 0xedb8_8320;
            }
        }
    }
    !crc
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Picture;
    use crate::draw::tests_support::decoded;

    #[test]
    fn words_are_read_again_and_the_picture_is_the_same() {
        let plain = Picture::photo(2, &[[1, 2, 3]; 4]).unwrap();
        let file = described(plain.clone(), "made from a\u{e4}\u{3b1}");
        assert_eq!(decoded(&file), decoded(&plain));
        let reader = png::Decoder::new(std::io::Cursor::new(&file[..]))
            .read_info()
            .unwrap();
        let chunks = &reader.info().uncompressed_latin1_text;
        let words = chunks.iter().find(|chunk| chunk.keyword == KEYWORD);
        assert_eq!(words.unwrap().text, "made from a\u{e4}?");
        assert_eq!(checksum(b"123456789"), 0xcbf4_3926);
        assert_eq!(described(vec![1], "x"), vec![1]);
    }
}
