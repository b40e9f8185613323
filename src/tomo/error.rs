//! Why there is no image, in words.

/// Why there is no image.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum TomoError {
    /// The grid has no pixels, too many, or no size.
    #[error(
        "the image must have 1 to {most} pixels on an area of positive size, found {columns} x {rows} on {width} x {height}"
    )]
    BadGrid {
        /// Most pixels that are allowed.
        most: usize,
        /// Pixels from west to east.
        columns: usize,
        /// Pixels from south to north.
        rows: usize,
        /// Of the area.
        width: f64,
        /// Of the area.
        height: f64,
    },
    /// It would take more memory than an image is given.
    #[error(
        "{links} links of an image of {columns} x {rows} pixels would take {needed_gb:.1} GB, expected at most \
         {most_gb:.1} GB: fewer pixels take less"
    )]
    TooLarge {
        /// Links that are left.
        links: usize,
        /// Pixels from west to east.
        columns: usize,
        /// Pixels from south to north.
        rows: usize,
        /// What it would take, gigabytes.
        needed_gb: f64,
        /// Most that is allowed, gigabytes.
        most_gb: f64,
    },
    /// Nothing is left to image.
    #[error("no link can be imaged: {given} given, dropped: {dropped}")]
    NoLinks {
        /// Links given.
        given: usize,
        /// Reasons and counts, in words.
        dropped: String,
    },
}
