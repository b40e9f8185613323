//! Where things stand in files, for what can be judged only when the files have been read: with their shapes, or by a seed.

use std::fmt;

/// A line of a file.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct FileLine {
    /// Name of the file, as it was opened.
    pub file: String,
    /// The line, counted from 1.
    pub line: usize,
}

impl fmt::Display for FileLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file, self.line)
    }
}

/// Where what a simulation is made of stands in the files of its place and its world.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct SimLines {
    /// The homes, in their order.
    pub homes: Vec<FileLine>,
    /// The persons of the scene file, in their order: of who walks its path, otherwise its place.
    pub persons: Vec<FileLine>,
    /// The rules of the persons that are placed by the seed.
    pub random_persons: FileLine,
}
