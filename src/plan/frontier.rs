//! Where the known free ground ends: free cells beside one that nobody has seen, grouped into clusters.
//!
//! Kept up to date around what changed, never counted anew; the result is the same as from scratch. Whether a
//! vehicle can get to a frontier, and which one it should take, is not asked here.

use std::collections::{BTreeMap, BTreeSet};

use thiserror::Error;

use super::MAX_GRID_CELLS;
use crate::geom::{Cell, Lattice, Point};
use crate::map::{CellRect, Merged, Occupancy, View};

/// The cell may be driven to as far as bounds and fence go.
const INSIDE: u8 = 1;
/// The cell is a frontier.
const FRONTIER: u8 = 2;

/// Why frontiers cannot be kept.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
pub enum FrontierError {
    /// The bounds are too large.
    #[error(
        "{cells} cells are too many to keep frontiers of, at most {MAX_GRID_CELLS} are allowed"
    )]
    TooLarge {
        /// How many there would be.
        cells: u64,
    },
}

/// All frontiers within bounds.
#[derive(Clone, Debug)]
pub struct Frontiers {
    lattice: Lattice,
    slice: i16,
    bounds: CellRect,
    width: usize,
    height: usize,
    /// Row-major, x fastest.
    flags: Vec<u8>,
    /// The cluster that each frontier cell belongs to: its key in `clusters`; otherwise meaningless.
    owner: Vec<u32>,
    /// The cells of each cluster, ascending; by its lowest cell.
    clusters: BTreeMap<usize, Vec<usize>>,
}

/// A group of frontier cells that touch each other by side or corner.
#[derive(Clone, PartialEq, Debug)]
pub struct Cluster {
    /// Its cells, row by row.
    pub cells: Vec<Cell>,
    /// The mean of its cells' middles, metres; it may lie outside the cluster.
    pub centroid: Point,
}

impl Cluster {
    /// Returns the number of cells.
    pub fn size(&self) -> usize {
        self.cells.len()
    }
}

impl Frontiers {
    /// Makes frontiers of an empty map: none. Cells outside the bounds, or with a middle that is not `inside` (the
    /// fence), neither are frontiers nor make one by being unknown.
    ///
    /// # Errors
    /// [`FrontierError`] when the bounds are too large.
    pub fn new(
        lattice: Lattice,
        slice: i16,
        bounds: CellRect,
        inside: impl Fn(Point) -> bool,
    ) -> Result<Frontiers, FrontierError> {
        let cells = bounds.width_cells().saturating_mul(bounds.height_cells());
        if cells > MAX_GRID_CELLS {
            return Err(FrontierError::TooLarge { cells });
        }
        let (width, height) = (
            bounds.width_cells() as usize,
            bounds.height_cells() as usize,
        );
        let mut flags = Vec::with_capacity(width * height);
        for y in bounds.low.y..=bounds.high.y {
            let row = (bounds.low.x..=bounds.high.x).map(|x| lattice.centre(Cell::new(x, y)));
            flags.extend(row.map(|middle| if inside(middle) { INSIDE } else { 0 }));
        }
        let owner = vec![0; flags.len()];
        Ok(Frontiers {
            lattice,
            slice,
            bounds,
            width,
            height,
            flags,
            owner,
            clusters: BTreeMap::new(),
        })
    }

    /// Takes note of a change of the map: all cells that changed since the last update lie in `changed`.
    pub fn update(&mut self, map: &Merged, changed: CellRect) {
        let Some(area) = changed.grown(2).overlap(self.bounds) else {
            return;
        };
        let view = map.view(self.slice, area.grown(2));
        let mut loose = BTreeSet::new();
        for y in area.low.y..=area.high.y {
            for x in area.low.x..=area.high.x {
                self.judge(&view, Cell::new(x, y), &mut loose);
            }
        }
        self.group(loose);
    }

    /// Returns all clusters, by their lowest cell.
    pub fn clusters(&self) -> impl Iterator<Item = Cluster> + '_ {
        self.clusters.values().map(|members| self.cluster(members))
    }

    /// Returns whether a cell is a frontier.
    pub fn contains(&self, cell: Cell) -> bool {
        self.index(cell)
            .is_some_and(|index| self.flags[index] & FRONTIER != 0)
    }

    /// Judges one cell; when it changed, its clusters are dissolved into `loose` cells.
    fn judge(&mut self, view: &View<'_>, cell: Cell, loose: &mut BTreeSet<usize>) {
        let Some(index) = self.index(cell) else {
            return;
        };
        let is_frontier = self.is_frontier(view, cell, index);
        if is_frontier == (self.flags[index] & FRONTIER != 0) {
            return;
        }
        if is_frontier {
            for beside in self.around(index) {
                self.dissolve(beside, loose);
            }
            self.flags[index] |= FRONTIER;
            loose.insert(index);
        } else {
            self.dissolve(index, loose);
            self.flags[index] &= !FRONTIER;
            loose.remove(&index);
        }
    }

    fn is_frontier(&self, view: &View<'_>, cell: Cell, index: usize) -> bool {
        let Cell { x, y } = cell;
        let unknown = |dx: i32, dy: i32| {
            let beside = Cell::new(x.saturating_add(dx), y.saturating_add(dy));
            let inside = self
                .index(beside)
                .is_some_and(|index| self.flags[index] & INSIDE != 0);
            inside && view.is_unseen(beside)
        };
        self.flags[index] & INSIDE != 0
            && view.occupancy(cell) == Occupancy::Free
            && (unknown(1, 0) || unknown(0, 1) || unknown(-1, 0) || unknown(0, -1))
    }

    /// Takes the cluster of a frontier cell apart.
    fn dissolve(&mut self, index: usize, loose: &mut BTreeSet<usize>) {
        if self.flags[index] & FRONTIER != 0 && !loose.contains(&index) {
            loose.extend(
                self.clusters
                    .remove(&(self.owner[index] as usize))
                    .into_iter()
                    .flatten(),
            );
        }
    }

    /// Puts loose cells into clusters. All neighbours of a loose cell are loose.
    fn group(&mut self, mut loose: BTreeSet<usize>) {
        while let Some(first) = loose.pop_first() {
            let (mut members, mut next) = (vec![first], 0);
            while next < members.len() {
                let found = self
                    .around(members[next])
                    .filter(|beside| loose.remove(beside));
                members.extend(found.collect::<Vec<usize>>());
                next += 1;
            }
            members.sort_unstable();
            members
                .iter()
                .for_each(|member| self.owner[*member] = first as u32);
            self.clusters.insert(first, members);
        }
    }

    /// Returns the up to eight places around one.
    fn around(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.height);
        let (x, y) = (index % width, index / width);
        let rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
        let columns = x.saturating_sub(1)..=(x + 1).min(width - 1);
        rows.flat_map(move |row| columns.clone().map(move |column| row * width + column))
            .filter(move |beside| *beside != index)
    }

    fn cluster(&self, members: &[usize]) -> Cluster {
        let cells: Vec<Cell> = members.iter().map(|index| self.cell(*index)).collect();
        let (mut x_m, mut y_m) = (0.0, 0.0);
        for middle in cells.iter().map(|cell| self.lattice.centre(*cell)) {
            x_m += middle.x_m;
            y_m += middle.y_m;
        }
        let count = cells.len() as f64;
        Cluster {
            cells,
            centroid: Point::new(x_m / count, y_m / count),
        }
    }

    fn index(&self, cell: Cell) -> Option<usize> {
        let (x, y) = (
            cell.x.abs_diff(self.bounds.low.x) as usize,
            cell.y.abs_diff(self.bounds.low.y) as usize,
        );
        self.bounds.contains(cell).then(|| y * self.width + x)
    }

    fn cell(&self, index: usize) -> Cell {
        let (x, y) = ((index % self.width) as i32, (index / self.width) as i32);
        Cell::new(self.bounds.low.x + x, self.bounds.low.y + y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::sync::Arc;
    use tomoswarm_proto::{Boot, LayerId, TILE_CELLS, TileAddress, TileReport, VehicleId};

    const LATTICE: f64 = 0.5;

    fn bounds() -> CellRect {
        CellRect::new(Cell::new(-30, -20), Cell::new(40, 33))
    }

    fn fenced(place: Point) -> bool {
        place.x_m + place.y_m < 25.0
    }

    fn frontiers() -> Frontiers {
        Frontiers::new(Lattice::new(LATTICE), 0, bounds(), fenced).unwrap()
    }

    /// Writes a rectangle of one tile of a vehicle's layer; returns the tile's cells.
    fn write(
        map: &mut Merged,
        (vehicle, revision): (u8, u32),
        x: i32,
        y: i32,
        from: (usize, usize),
        to: (usize, usize),
        value: i8,
    ) -> CellRect {
        let layer = LayerId {
            vehicle: VehicleId(vehicle),
            boot: Boot(1),
        };
        let address = TileAddress { slice: 0, x, y };
        let mut cells: [i8; TILE_CELLS] = map
            .layer(layer)
            .and_then(|layer| layer.tile(address))
            .map_or([0; TILE_CELLS], |tile| *tile.cells);
        for row in from.1..=to.1 {
            cells[row * 32 + from.0..=row * 32 + to.0].fill(value);
        }
        map.join(&TileReport {
            layer,
            address,
            revision,
            cells: Arc::new(cells),
        })
        .unwrap();
        CellRect::new(
            Cell::new(32 * x, 32 * y),
            Cell::new(32 * x + 31, 32 * y + 31),
        )
    }

    /// Unknown; but not where one vehicle knows it and another one says otherwise, beside something that stands.
    fn is_unseen(map: &Merged, cell: Cell) -> bool {
        let (x, y) = (cell.x.div_euclid(32), cell.y.div_euclid(32));
        let address = TileAddress { slice: 0, x, y };
        let place = (cell.y.rem_euclid(32) * 32 + cell.x.rem_euclid(32)) as usize;
        let tiles = map.layers().filter_map(|(_, layer)| layer.tile(address));
        let is_known = |value: i8| !(-7..9).contains(&value);
        let is_disputed = tiles.into_iter().any(|tile| is_known(tile.cells[place]));
        let beside = CellRect::new(cell, cell).grown(1).cells();
        let mut occupied = beside.filter(|one| map.occupancy(0, *one) == Occupancy::Occupied);
        map.occupancy(0, cell) == Occupancy::Unknown && !(is_disputed && occupied.next().is_some())
    }

    /// The definition, said a second time: groups by joining sets until nothing touches.
    fn from_scratch(map: &Merged) -> Vec<Vec<Cell>> {
        let (area, lattice) = (bounds(), Lattice::new(LATTICE));
        let inside = |cell: Cell| area.contains(cell) && fenced(lattice.centre(cell));
        let all = (area.low.y..=area.high.y)
            .flat_map(|y| (area.low.x..=area.high.x).map(move |x| Cell::new(x, y)));
        let mut groups: Vec<Vec<Cell>> = Vec::new();
        for cell in all.filter(|cell| inside(*cell) && map.occupancy(0, *cell) == Occupancy::Free) {
            let beside = [(1, 0), (-1, 0), (0, 1), (0, -1)]
                .map(|(dx, dy)| Cell::new(cell.x + dx, cell.y + dy));
            if !beside.iter().any(|c| inside(*c) && is_unseen(map, *c)) {
                continue;
            }
            let touches =
                |other: &Cell| (other.x - cell.x).abs() <= 1 && (other.y - cell.y).abs() <= 1;
            let (near, mut far): (Vec<_>, Vec<_>) = groups
                .into_iter()
                .partition(|group| group.iter().any(touches));
            far.push(near.into_iter().flatten().chain([cell]).collect());
            groups = far;
        }
        groups
            .iter_mut()
            .for_each(|group| group.sort_by_key(|cell| (cell.y, cell.x)));
        groups.sort_by_key(|group| (group[0].y, group[0].x));
        groups
    }

    proptest! {
        #[test]
        fn kept_frontiers_are_those_counted_from_scratch(
            writes in proptest::collection::vec(
                (1..3u8, -1..2i32, -1..2i32, (0..32usize, 0..32usize), (0..32usize, 0..32usize), 0..5usize), 1..14,
            ),
        ) {
            let mut map = Merged::new(Lattice::new(LATTICE), None);
            let mut frontiers = frontiers();
            for (count, (vehicle, x, y, a, b, kind)) in writes.into_iter().enumerate() {
                let (from, to) = ((a.0.min(b.0), a.1.min(b.1)), (a.0.max(b.0), a.1.max(b.1)));
                let value = [-17, -17, -17, 17, 0][kind];
                let changed = write(&mut map, (vehicle, count as u32 + 1), x, y, from, to, value);
                frontiers.update(&map, changed);
                let kept: Vec<Vec<Cell>> = frontiers.clusters().map(|cluster| cluster.cells).collect();
                let expected = from_scratch(&map);
                prop_assert_eq!(kept, expected);
            }
        }
    }

    #[test]
    fn a_free_square_in_the_unknown_is_one_cluster_round_its_rim() {
        let mut map = Merged::new(Lattice::new(LATTICE), None);
        let mut frontiers = frontiers();
        let changed = write(&mut map, (1, 1), 0, 0, (4, 4), (8, 8), -17);
        frontiers.update(&map, changed);
        let clusters: Vec<Cluster> = frontiers.clusters().collect();
        assert_eq!((clusters.len(), clusters[0].size()), (1, 16));
        assert!(clusters[0].centroid.distance_to(Point::new(3.25, 3.25)) < 1e-9);
        assert!(frontiers.contains(Cell::new(4, 4)) && !frontiers.contains(Cell::new(6, 6)));
        let changed = write(&mut map, (1, 2), 0, 0, (0, 0), (31, 31), 17);
        frontiers.update(&map, changed);
        assert!(frontiers.clusters().next().is_none());
    }

    #[test]
    fn where_vehicles_contradict_each_other_beside_a_wall_is_no_frontier() {
        let mut map = Merged::new(Lattice::new(LATTICE), None);
        let mut frontiers = frontiers();
        write(&mut map, (1, 1), 0, 0, (0, 0), (31, 31), -17);
        write(&mut map, (2, 1), 0, 0, (0, 0), (31, 31), -12);
        let away = |frontiers: &Frontiers| {
            let inner = |cluster: &Cluster| cluster.cells.iter().all(|cell| cell.x > 8);
            frontiers.clusters().filter(inner).count()
        };
        // What one of them has met in the open, nobody else: that is worth a look.
        let changed = write(&mut map, (2, 2), 0, 0, (15, 15), (15, 15), 17);
        frontiers.update(&map, changed);
        assert_eq!(away(&frontiers), 1);
        // Both have met a wall beside it.
        write(&mut map, (1, 2), 0, 0, (16, 14), (16, 16), 17);
        let changed = write(&mut map, (2, 3), 0, 0, (16, 14), (16, 16), 17);
        frontiers.update(&map, changed);
        assert_eq!(away(&frontiers), 0);
    }

    #[test]
    fn unknown_ground_beyond_the_fence_is_no_frontier() {
        let mut map = Merged::new(Lattice::new(LATTICE), None);
        let area = CellRect::new(Cell::new(0, 0), Cell::new(31, 31));
        let mut frontiers = Frontiers::new(Lattice::new(LATTICE), 0, area, |_| true).unwrap();
        let changed = write(&mut map, (1, 1), 0, 0, (0, 0), (31, 31), -17);
        frontiers.update(&map, changed);
        assert!(frontiers.clusters().next().is_none());
        frontiers.update(
            &map,
            CellRect::new(Cell::new(i32::MIN, i32::MIN), Cell::new(i32::MAX, i32::MAX)),
        );
        assert!(frontiers.clusters().next().is_none());
        let all = CellRect::new(Cell::new(i32::MIN, 0), Cell::new(i32::MAX, 9));
        assert!(Frontiers::new(Lattice::new(LATTICE), 0, all, |_| true).is_err());
    }
}
