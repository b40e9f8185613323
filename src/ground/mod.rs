//! The ground station: station, planner and imager actors, and how they are wired.
