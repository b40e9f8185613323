//! Faces of what stands that were never looked at from in front. A wall is silent to who looks at it at a slant, and the ground
//! on which its face stands is then taken for free; but what was heard of it from another side tells that it is there.
//!
//! Kept is from where the beams of this vehicle and its peers have swept. Which faces were met from in front is asked only when
//! nothing unknown is left to be looked at.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use super::frontier_candidates::{FrontierCandidate, sees};
use crate::geom::{Angle, Cell, Lattice, Point, Polygon, Vector};
use crate::map::{Occupancy, OccupancyGrid};
use crate::node::LookSettings;
use crate::time::Time;

/// A vehicle that has not moved or turned by more sweeps over the same again: metres, radians.
const SAME_M: f64 = 0.15;
const SAME_RAD: f64 = 0.2;
/// So far before the middle of what was heard the ground must be free, metres: just before it nothing is ever seen empty.
const BEFORE_M: f64 = 0.25;
/// The tangent of the angle to the normal up to which a look at a face is one from in front.
const SLOPE_MAX: f64 = 1.0;
/// Single cells are no face: another one lies this near beside, metres, and as deep but for so many cells.
const BESIDE_M: f64 = 0.4;
const DEPTH_CELLS: f64 = 2.5;
/// The directions in which a face may look, cells.
const SIDES: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// A place from which all beams were looked along.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Sweep {
    from: Point,
    heading: Angle,
    /// When it ended.
    at: Time,
}

/// From where beams have swept.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Sweeps {
    /// In the order in which they ended.
    all: Vec<Sweep>,
    /// The place of the last one of each vehicle.
    last: BTreeMap<VehicleId, usize>,
}

impl Sweeps {
    /// Notes where a vehicle is and heads: at most once in the time in which all beams are looked along, and once for a place and
    /// heading at which it stays.
    pub(super) fn note(
        &mut self,
        (of, look): (VehicleId, &LookSettings),
        now: Time,
        from: Point,
        heading: Angle,
    ) {
        let last = self.last.get(&of).map(|place| &self.all[*place]);
        let is_same = last.is_some_and(|last| {
            let turned_rad = (last.heading - heading).radians().abs();
            now.since(last.at) < look.cycle()
                || (last.from.distance_to(from) <= SAME_M && turned_rad <= SAME_RAD)
        });
        if !is_same {
            self.look(of, now, from, heading);
        }
    }

    /// Notes a look, for which all beams are looked along.
    pub(super) fn look(&mut self, of: VehicleId, at: Time, from: Point, heading: Angle) {
        self.last.insert(of, self.all.len());
        self.all.push(Sweep { from, heading, at });
    }

    /// Returns the faces, with free ground before them inside the fence, that were not looked at from in front from within
    /// `reach_m`; of each the ground before it.
    pub(super) fn unmet(
        &self,
        look: &LookSettings,
        fence: &Polygon,
        occupancy: &OccupancyGrid,
        lattice: Lattice,
        reach_m: f64,
    ) -> Vec<FrontierCandidate> {
        let is_met = |face: &FrontierCandidate| {
            self.all.iter().rev().any(|sweep| {
                sweep.from.distance_to(face.at) <= reach_m
                    && face.is_in_front(sweep.from)
                    && look.covers(sweep.from.angle_to(face.at) - sweep.heading)
                    && sees(occupancy, lattice, sweep.from, face.at)
            })
        };
        let faces = faces(occupancy, lattice).filter(|face| fence.contains(face.at));
        let unmet: Vec<FrontierCandidate> = faces.filter(|face| !is_met(face)).collect();
        let is_one_of_several = |face: &&FrontierCandidate| {
            let beside = |other: &&FrontierCandidate| {
                let to = other.at - face.at;
                face.normal.is_some_and(|normal| {
                    other.normal == face.normal
                        && to.cross(normal).abs() <= BESIDE_M
                        && to.dot(normal).abs() <= DEPTH_CELLS * lattice.cell_m()
                })
            };
            // It is beside itself too.
            unmet.iter().filter(beside).nth(1).is_some()
        };
        unmet.iter().filter(is_one_of_several).copied().collect()
    }
}

/// Returns the sides of occupied cells that have free ground before them.
fn faces(occupancy: &OccupancyGrid, lattice: Lattice) -> impl Iterator<Item = FrontierCandidate> {
    let before = (BEFORE_M / lattice.cell_m()).ceil().max(1.0) as i32;
    let stands = |cell: &Cell| occupancy.occupancy(*cell) == Occupancy::Occupied;
    let face = move |cell: Cell, (x, y): (i32, i32)| {
        let ahead = |steps: i32| Cell::new(cell.x + steps * x, cell.y + steps * y);
        let is_bare = (1..before).all(|steps| !stands(&ahead(steps)))
            && occupancy.occupancy(ahead(before)) == Occupancy::Free;
        is_bare.then(|| FrontierCandidate {
            cell: ahead(before),
            at: lattice.centre(ahead(before)),
            penalty_m: 0.0,
            normal: Some(Vector::new(f64::from(x), f64::from(y))),
        })
    };
    let cells = occupancy.area().cells().filter(stands);
    cells.flat_map(move |cell| SIDES.into_iter().filter_map(move |side| face(cell, side)))
}

impl FrontierCandidate {
    /// Returns whether it may be looked at from a place: a face only from in front.
    pub(super) fn is_in_front(&self, from: Point) -> bool {
        self.normal.is_none_or(|normal| {
            let to = from - self.at;
            let ahead_m = to.dot(normal);
            ahead_m > 0.0 && to.cross(normal).abs() <= SLOPE_MAX * ahead_m
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::map::{CellRect, Merged};
    use crate::node::mission::terrain::tests::tiles_of;
    use crate::node::tests_support::settings;

    const WALL_LOW_M: f64 = 2.0;

    /// Free ground with a wall from x = -1 m to 1 m, `deep` cells thick from y = 2 m on.
    fn occupancy(deep: i32) -> OccupancyGrid {
        let mut map = Merged::new(Lattice::new(0.2), None);
        for mut tile in tiles_of(|_, _| false) {
            let (left, low) = (tile.address.x * 32, tile.address.y * 32);
            let value = |index: usize| {
                let (x, y) = (left + index as i32 % 32, low + index as i32 / 32);
                let stands = (-5..5).contains(&x) && (10..10 + deep).contains(&y);
                if stands { 17 } else { -17 }
            };
            tile.cells = Arc::new(std::array::from_fn(value));
            map.join(&tile).unwrap();
        }
        let area = CellRect::new(Cell::new(-25, -25), Cell::new(25, 25));
        map.view(0, area).occupancy_grid(area)
    }

    /// The faces that are left after looks, each from a place along a heading: how many look along each side.
    fn unmet(looks: &[(f64, f64, f64)], deep: i32) -> [usize; 4] {
        let (settings, lattice) = (settings(1), Lattice::new(0.2));
        let mut sweeps = Sweeps::default();
        for (x_m, y_m, heading_deg) in looks {
            let (from, heading) = (Point::new(*x_m, *y_m), Angle::from_degrees(*heading_deg));
            sweeps.look(VehicleId(1), Time::ZERO, from, heading);
        }
        let left = sweeps.unmet(
            &settings.look,
            &settings.fence,
            &occupancy(deep),
            lattice,
            3.0,
        );
        SIDES.map(|(x, y)| {
            let normal = Vector::new(f64::from(x), f64::from(y));
            left.iter().filter(|one| one.normal == Some(normal)).count()
        })
    }

    #[test]
    fn a_face_is_met_by_who_looks_at_it_from_in_front_and_not_at_a_slant_or_from_behind() {
        let all = unmet(&[], 2);
        assert_eq!(all, [2, 10, 2, 10]);
        assert_eq!(unmet(&[(0.0, WALL_LOW_M - 2.0, 90.0)], 2), [2, 10, 2, 0]);
        assert_eq!(
            unmet(&[(0.0, WALL_LOW_M - 2.0, -90.0)], 2),
            all,
            "it looks elsewhere"
        );
        assert_eq!(
            unmet(&[(-3.0, WALL_LOW_M - 0.5, 0.0)], 2),
            [2, 10, 0, 10],
            "at a slant it is silent, and its end is not"
        );
        assert_eq!(unmet(&[(0.0, WALL_LOW_M - 4.0, 90.0)], 2), all, "too far");
    }

    #[test]
    fn single_cells_are_no_face() {
        // The ends of a wall that is one cell thick.
        assert_eq!(unmet(&[], 1), [0, 10, 0, 10]);
    }

    #[test]
    fn who_stays_where_it_is_has_swept_once_and_who_drives_once_a_round() {
        let settings = settings(1);
        let (round, look) = (settings.look.cycle(), &settings.look);
        let mut sweeps = Sweeps::default();
        let mut note = |rounds: u32, x_m: f64| {
            let now = Time::ZERO + round * rounds;
            sweeps.note((VehicleId(2), look), now, Point::new(x_m, 0.0), Angle::ZERO);
            sweeps.all.len()
        };
        assert_eq!(
            [
                note(1, 0.0),
                note(2, 0.1),
                note(5, 0.1),
                note(6, 1.0),
                note(6, 2.0)
            ],
            [1, 1, 1, 2, 2]
        );
    }
}
