//! Geometry in the venue's local frame (x, y along the venue's axes, metres), and the lattices laid over its plane.
//! Pure values; no vehicle, no map and no image is known here, and no body in space.
//!
//! Transcendental functions come from `libm`, so that a seed gives the same bytes on every machine.

mod angle;
mod attitude;
mod decimal;
mod grid;
mod lattice;
mod point;
mod polygon;
mod pose;
mod rect;
mod segment;
mod track;
mod wgs84;

pub use angle::{Angle, Bearing, Turn};
pub use attitude::Attitude;
pub use decimal::without_dust;
pub use grid::PixelGrid;
pub use lattice::{Cell, CellsUnder, Lattice};
pub(crate) use lattice::{ceil_to_i32, floor_to_i32};
pub use point::{Point, Vector};
pub use polygon::Polygon;
pub use pose::{Pose, WORST_DEVIATIONS};
pub use rect::Rect;
pub use segment::Segment;
pub use track::Track;
pub use wgs84::{Geodetic, TangentPlane};
