//! Tests of sweeps as a whole: plans, followers and successions together.

mod random_worlds;
