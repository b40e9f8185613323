//! What the referee of a simulation writes down: contacts, and ways that lead over the fence. It judges nothing.

use tomoswarm_proto::VehicleId;

use crate::geom::Point;
use crate::time::Time;

/// A contact, as the referee writes it down.
#[derive(Clone, PartialEq, Debug)]
pub struct Collision {
    /// When.
    pub at: Time,
    /// Who.
    pub vehicle: VehicleId,
    /// With which other vehicle; `None` = with the scene.
    pub with: Option<VehicleId>,
    /// Where the vehicle's middle was.
    pub place: Point,
}

/// A command that led a body over the fence, as the referee writes it down.
#[derive(Clone, PartialEq, Debug)]
pub struct FenceBreach {
    /// When the way was begun.
    pub at: Time,
    /// Who.
    pub vehicle: VehicleId,
    /// The end of the first piece of the way on which the body does not stay inside.
    pub place: Point,
}

impl FenceBreach {
    /// Returns who left the fence, when and where.
    pub fn in_words(&self) -> String {
        let FenceBreach { at, vehicle, place } = self;
        format!("vehicle {vehicle} near {place} at {at} s")
    }
}

impl Collision {
    /// Returns who touched what, when and where.
    pub fn in_words(&self) -> String {
        let with = self
            .with
            .map_or("the scene".to_owned(), |peer| format!("vehicle {peer}"));
        let (after_s, at) = (self.at.as_secs_f64(), self.place);
        format!(
            "vehicle {} touched {with} after {after_s:.0} s at {:.2}, {:.2} m",
            self.vehicle, at.x_m, at.y_m
        )
    }
}
