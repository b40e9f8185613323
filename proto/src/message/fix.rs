//! Where something outside knows a vehicle to be. This is the form on the wire.

use serde::{Deserialize, Serialize};

use crate::{Deviation, Heading, Position, VehicleId};

/// An older fix is of no use to an autopilot, milliseconds.
pub const FIX_AGE_MAX_MS: u16 = 2000;

/// A place of a vehicle that was measured from outside, such as by motion capture or ultra-wideband; its autopilot joins it
/// with what it measures itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Fix {
    /// Whose.
    pub vehicle: VehicleId,
    /// Where it was, in the venue's frame.
    pub at: Position,
    /// Where its front pointed; `None` = that is not measured.
    pub heading: Option<Heading>,
    /// Standard deviation of each coordinate of the place.
    pub sd: Deviation,
    /// How long ago that was when it was said, milliseconds; at most [`FIX_AGE_MAX_MS`].
    pub age_ms: u16,
}
