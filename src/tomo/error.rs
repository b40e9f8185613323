//! Why there is no image.

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
    /// The weights of pixels in links would fill the memory.
    #[error(
        "{links} links and {pixels} pixels have about {weights} weights, expected at most {most}: fewer pixels are needed"
    )]
    TooManyWeights {
        /// Links.
        links: usize,
        /// Pixels.
        pixels: usize,
        /// How many weights they have, about.
        weights: usize,
        /// How many there may be.
        most: usize,
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
