//! Parts of cells: a sixteenth each, 4 × 4. Of cells that are not free a vehicle knows by its own looks which parts are
//! empty all the same, so that a doorway between two cells is not narrower than it is. Nothing of this travels: of what
//! only others have seen whole cells count.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{TILE_CELLS, TileReport};

use super::tile::Occupancy;
use crate::geom::{Cell, Lattice, Point, Vector};

/// Parts along the side of a cell.
pub const PART_SIDE: u16 = 4;
/// Parts of a cell.
pub const PARTS: u16 = PART_SIDE * PART_SIDE;

/// Returns where the middle of a part lies, seen from that of its cell, metres; parts are counted row by row from below.
#[inline]
pub fn part_offset(part: u16, cell_m: f64) -> Vector {
    let from_middle_m = |index: u16| (f64::from(index) - 1.5) * 0.25 * cell_m;
    Vector::new(
        from_middle_m(part % PART_SIDE),
        from_middle_m(part / PART_SIDE),
    )
}

/// Which parts of the cells of a tile are empty although the cell is not free.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct ClearedParts(Vec<(u16, u16)>);

impl ClearedParts {
    /// Takes places of cells within the tile, ascending, each with its empty parts as bits, row by row from below.
    pub fn new(cells: Vec<(u16, u16)>) -> ClearedParts {
        ClearedParts(cells)
    }

    /// Returns the parts of all cells of the tile, row-major, x fastest. Places beyond the tile are left out.
    pub(super) fn by_cell(&self) -> Box<[u16; TILE_CELLS]> {
        let mut parts = Box::new([0; TILE_CELLS]);
        for (index, cleared) in &self.0 {
            if let Some(of_cell) = parts.get_mut(usize::from(*index)) {
                *of_cell = *cleared;
            }
        }
        parts
    }
}

/// A tile as one vehicle's map tells it to its mission.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct MapTile {
    /// The tile as it travels.
    pub report: TileReport,
    /// What is known of it more finely; `None` for a tile that somebody else has written.
    pub cleared: Option<ClearedParts>,
}

impl From<TileReport> for MapTile {
    /// Makes it of a tile that somebody else has written.
    fn from(report: TileReport) -> MapTile {
        MapTile {
            report,
            cleared: None,
        }
    }
}

/// Why a cell is not known to be free, the surest last.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Bar {
    /// Nobody has looked well enough.
    Unknown,
    /// Something was heard, and it explains that best.
    Doubtful,
    /// Something was heard, and nothing else can have given it.
    Confirmed,
}

/// A cell that is not known to be free, and where something may stand in it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BarredCell {
    /// Why.
    pub bar: Bar,
    /// The parts in which it may stand, as bits, row by row from below; never none.
    pub parts: u16,
}

impl BarredCell {
    /// Judges a cell of which some parts were seen empty; `None` when nothing of it bars the way.
    #[inline]
    pub(super) fn of(occupancy: Occupancy, is_confirmed: bool, cleared: u16) -> Option<BarredCell> {
        let bar = match (occupancy, is_confirmed) {
            (Occupancy::Free, _) => return None,
            (Occupancy::Unknown, _) => {
                let bar = Bar::Unknown;
                return (cleared != u16::MAX).then_some(BarredCell {
                    bar,
                    parts: !cleared,
                });
            }
            (Occupancy::Occupied, false) => Bar::Doubtful,
            (Occupancy::Occupied, true) => Bar::Confirmed,
        };
        // Something was heard, so it stands somewhere in it, whatever was seen empty.
        let parts = match cleared {
            u16::MAX => u16::MAX,
            cleared => !cleared,
        };
        Some(BarredCell { bar, parts })
    }

    /// Returns whether something was heard there.
    #[inline]
    pub fn is_occupied(self) -> bool {
        self.bar != Bar::Unknown
    }

    /// Returns the middles of the parts in which something may stand.
    pub fn places(self, lattice: Lattice, cell: Cell) -> impl Iterator<Item = Point> {
        let (middle, cell_m) = (lattice.centre(cell), lattice.cell_m());
        (0..PARTS)
            .filter(move |part| self.parts & (1 << part) != 0)
            .map(move |part| middle + part_offset(part, cell_m))
    }

    /// Returns how far the nearest of these middles is from a point, metres.
    pub fn distance_m(self, lattice: Lattice, cell: Cell, to: Point) -> f64 {
        let distances = self.places(lattice, cell).map(|part| part.distance_to(to));
        distances.fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_lie_evenly_in_their_cell() {
        let lattice = Lattice::new(0.2);
        let barred = BarredCell {
            bar: Bar::Confirmed,
            parts: 1 | 1 << 7 | 1 << 15,
        };
        let places: Vec<Point> = barred.places(lattice, Cell::new(5, -1)).collect();
        let expected = [(1.025, -0.175), (1.175, -0.125), (1.175, -0.025)];
        assert_eq!(places.len(), expected.len());
        for (place, (x_m, y_m)) in places.iter().zip(expected) {
            assert!(place.distance_to(Point::new(x_m, y_m)) < 1e-9, "{place}");
        }
    }

    #[test]
    fn a_cell_seen_empty_all_over_bars_only_if_something_was_heard_there() {
        let all = u16::MAX;
        assert_eq!(BarredCell::of(Occupancy::Free, false, 0), None);
        assert_eq!(BarredCell::of(Occupancy::Unknown, false, all), None);
        for (is_confirmed, bar) in [(false, Bar::Doubtful), (true, Bar::Confirmed)] {
            let occupied = BarredCell::of(Occupancy::Occupied, is_confirmed, all).unwrap();
            assert_eq!((occupied.bar, occupied.parts), (bar, all));
        }
        let unknown = BarredCell::of(Occupancy::Unknown, false, 0b11).unwrap();
        assert_eq!((unknown.bar, unknown.parts), (Bar::Unknown, !0b11));
    }

    #[test]
    fn parts_are_found_by_their_cell() {
        let parts = ClearedParts::new(vec![(3, 7), (1023, 1), (4000, 9)]).by_cell();
        assert_eq!((parts[3], parts[1023], parts[0]), (7, 1, 0));
    }
}
