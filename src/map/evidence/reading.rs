//! What a mapper is told with each reading, and what it says of it.

use tomoswarm_proto::TileAddress;

use crate::geom::{Angle, Point, Segment};

/// One range reading with the cone it was taken in.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ScanReading {
    /// Where the sensor was.
    pub origin: Point,
    /// Axis of the cone.
    pub direction: Angle,
    /// Half of the cone's opening, radians, 0 to π/2; 0 = a ray.
    pub half_width_rad: f64,
    /// Distance of the echo, metres; `None` = no echo.
    pub range_m: Option<f64>,
    /// An echo from farther away counts as none, metres.
    pub max_range_m: f64,
    /// Up to here everything gives an echo, at whatever angle it stands, metres. For walls not nearer than c to
    /// the vehicle that answer up to the incidence angle i, this is c / cos i. Cells are freed up to half of their
    /// diagonal less.
    pub sure_range_m: f64,
    /// Nothing is seen nearer than this, metres.
    pub min_range_m: f64,
    /// Deviation of the origin, metres.
    pub origin_sd_m: f64,
}

/// The disc that the vehicle itself covers.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OwnDisc {
    /// Its middle.
    pub at: Point,
    /// Its radius, metres.
    pub radius_m: f64,
}

/// Where a peer may be: on its leg, or at a single point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PeerBody<'a> {
    /// Corners of its last leg.
    pub leg: &'a [Point],
    /// Its radius plus pose deviations, metres.
    pub radius_m: f64,
}

/// What a reading changed in its own layer.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Changes {
    /// Tiles with a new revision, ascending.
    pub changed: Vec<TileAddress>,
    /// Those of them in which a merged cell became occupied: to be sent at once.
    pub newly_occupied: Vec<TileAddress>,
    /// Tiles of which more is known than before of parts of cells that are not free, ascending; see
    /// [`super::Mapper::cleared`].
    pub cleared: Vec<TileAddress>,
}

impl Changes {
    /// Returns whether nothing changed.
    pub fn is_empty(&self) -> bool {
        self.changed.is_empty() && self.cleared.is_empty()
    }
}

impl PeerBody<'_> {
    /// Returns whether the peer may come as near to a point as `spread_m`.
    pub(super) fn reaches(&self, point: Point, spread_m: f64) -> bool {
        let reach_m = self.radius_m + spread_m;
        let near = |leg: Segment| leg.distance_to_point(point) <= reach_m;
        match self.leg {
            [at] => at.distance_to(point) <= reach_m,
            corners => corners
                .windows(2)
                .any(|pair| near(Segment::new(pair[0], pair[1]))),
        }
    }
}
