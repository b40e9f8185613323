//! Radio tomography: samples, links, weights, solvers, images, peaks.
