//! The deterministic log of a run: virtual time and facts, nothing of the machine it ran on.

use std::fmt::Write;
use std::hash::Hasher;

use fnv::FnvHasher;

use crate::time::Time;
use crate::tomo::Image;

/// Lines of text, each with the virtual time in seconds.
#[derive(Clone, Debug, Default)]
pub struct Log {
    text: String,
}

impl Log {
    /// Writes a line.
    pub fn line(&mut self, now: Time, who: &str, what: std::fmt::Arguments<'_>) {
        // Writing into a string cannot fail.
        let _ = writeln!(self.text, "{now} {who} {what}");
    }

    /// Returns the text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Takes the text out.
    pub fn into_text(self) -> String {
        self.text
    }
}

/// Returns a hash of an image's values in steps of 0.001 dB/m (FNV-1a), so that a log can hold all of it.
pub fn image_hash(image: &Image) -> u64 {
    hash(
        image
            .values
            .iter()
            .map(|value| libm::round(*value * 1e3) as i64 as u64),
    )
}

/// Returns the FNV-1a hash of numbers.
pub fn hash(numbers: impl Iterator<Item = u64>) -> u64 {
    let mut hash = FnvHasher::default();
    numbers.for_each(|number| hash.write(&number.to_le_bytes()));
    hash.finish()
}
