//! Where the vehicles have been since one of them has done a stop. One that goes a long way round to its next stop gets on,
//! and comes to places where it was not; one that goes to and fro does not. It judges nothing.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use crate::geom::{Cell, Lattice, Point};

/// Side of the squares that are told apart, metres.
const SQUARE_M: f64 = 1.0;

/// The squares of ground that each vehicle has visited.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct VisitedGround {
    squares: BTreeMap<VehicleId, BTreeSet<Cell>>,
}

impl VisitedGround {
    /// Records where a vehicle is; returns whether it has come to where it was not. (Where it is first is nothing new.)
    pub(super) fn visit(&mut self, vehicle: VehicleId, at: Point) -> bool {
        let square = Lattice::new(SQUARE_M).cell_at(at);
        let squares = self.squares.entry(vehicle).or_default();
        let is_first = squares.is_empty();
        squares.insert(square) && !is_first
    }

    /// Forgets all: a stop was done.
    pub(super) fn clear(&mut self) {
        self.squares.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_new_once_for_each_vehicle_until_a_stop_is_done() {
        let mut ground = VisitedGround::default();
        let (one, two) = (VehicleId(1), VehicleId(2));
        let mut comes = |vehicle, x_m| ground.visit(vehicle, Point::new(x_m, 0.2));
        assert!(!comes(one, 0.2), "it was there");
        assert!(!comes(one, 0.8), "the same square");
        assert!(comes(one, -0.2) && !comes(two, 3.2) && comes(two, 0.2));
        assert!(!comes(one, 0.2) && !comes(one, -0.2), "to and fro");
        ground.clear();
        assert!(!ground.visit(one, Point::new(-0.2, 0.2)));
        assert!(ground.visit(one, Point::new(0.2, 0.2)));
    }
}
