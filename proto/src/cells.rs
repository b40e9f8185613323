//! The cells of a tile as one piece of bytes where the format has bytes, and as numbers where people read it.
//!
//! The bytes are those of a sequence of `i8`; taking them in one piece makes a tile several times faster to read.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, Visitor};
use serde::ser::{Serialize, Serializer};

/// Writes cells.
pub(crate) fn serialize<S: Serializer>(cells: &[i8], serializer: S) -> Result<S::Ok, S::Error> {
    if serializer.is_human_readable() {
        return cells.serialize(serializer);
    }
    let bytes: Vec<u8> = cells.iter().map(|cell| cell.cast_unsigned()).collect();
    serializer.serialize_bytes(&bytes)
}

/// Reads cells.
pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<i8>, D::Error> {
    if deserializer.is_human_readable() {
        return Vec::deserialize(deserializer);
    }
    deserializer.deserialize_byte_buf(Cells)
}

struct Cells;

impl Visitor<'_> for Cells {
    type Value = Vec<i8>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the cells of a tile")
    }

    fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Vec<i8>, E> {
        Ok(bytes.iter().map(|byte| byte.cast_signed()).collect())
    }

    fn visit_byte_buf<E: Error>(self, bytes: Vec<u8>) -> Result<Vec<i8>, E> {
        self.visit_bytes(&bytes)
    }
}
