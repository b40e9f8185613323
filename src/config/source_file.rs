//! Which files something was made from, so that who has it can tell later whether it was these.

use serde::Serialize;
use sha2::{Digest, Sha256};

/// A file as it was read.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct SourceFile {
    /// Its name, as it was given; that of what is bundled with the program.
    pub file: String,
    /// Its size, bytes.
    pub bytes: usize,
    /// SHA-256 of its bytes, hexadecimal, as `sha256sum` prints it.
    pub sha256: String,
}

impl SourceFile {
    /// Notes what was read under a name.
    pub fn of(name: &str, content: &[u8]) -> SourceFile {
        let digest = Sha256::digest(content);
        let digits = digest.iter().map(|byte| format!("{byte:02x}"));
        SourceFile {
            file: name.to_owned(),
            bytes: content.len(),
            sha256: digits.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_is_that_of_sha256sum() {
        // FIPS 180-2, appendix B.1.
        let abc = SourceFile::of("abc.txt", b"abc");
        assert_eq!(
            abc.sha256,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
        assert_eq!((abc.bytes, abc.file.as_str()), (3, "abc.txt"));
    }
}
