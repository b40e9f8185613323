//! Pictures as pure values: rasters with axes and colour bars, encoded as PNG.
