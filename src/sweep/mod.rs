//! Which positions to measure from, in which order, and who waits for whom.
