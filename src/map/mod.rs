//! Evidence, tiles, layers and their merge.
