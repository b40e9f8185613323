//! Where known free ground ends, kept up to date with the map: what has not changed is not looked at again. It is made of the
//! map alone, so it is no part of a snapshot, and is made anew when it is lost.

use std::collections::BTreeSet;

use tomoswarm_proto::TileAddress;

use crate::geom::{Cell, Point};
use crate::map::{CellRect, Merged};
use crate::node::VehicleSettings;
use crate::plan::Frontiers;

/// The frontiers within the fence.
#[derive(Clone, Debug, Default)]
pub(super) struct KnownFrontiers {
    frontiers: Option<Frontiers>,
    /// Tiles that have changed since they were brought up to date.
    changed: BTreeSet<TileAddress>,
}

impl KnownFrontiers {
    /// Notes that a tile of the map has changed.
    pub(super) fn tile_changed(&mut self, address: TileAddress) {
        if self.frontiers.is_some() {
            self.changed.insert(address);
        }
    }

    /// Brings the frontiers up to date. There are none in a fence that is too large.
    pub(super) fn update(&mut self, map: &Merged, settings: &VehicleSettings) {
        match &mut self.frontiers {
            Some(frontiers) => {
                for address in std::mem::take(&mut self.changed) {
                    frontiers.update(map, CellRect::of_tile(address));
                }
            }
            None => self.frontiers = frontiers_of(map, settings),
        }
    }

    /// Returns whether a cell is a frontier.
    pub(super) fn contains(&self, cell: Cell) -> bool {
        self.frontiers
            .as_ref()
            .is_some_and(|frontiers| frontiers.contains(cell))
    }

    /// Returns the cells of all frontiers that have at least so many.
    pub(super) fn cells(&self, least: usize) -> impl Iterator<Item = Cell> + '_ {
        let clusters = self.frontiers.iter().flat_map(Frontiers::clusters);
        clusters
            .filter(move |cluster| cluster.size() >= least)
            .flat_map(|cluster| cluster.cells)
    }
}

fn frontiers_of(map: &Merged, settings: &VehicleSettings) -> Option<Frontiers> {
    let (lattice, fence) = (settings.lattice, &settings.fence);
    let area = CellRect::around(lattice, fence.corners(), 0.0)?;
    let is_inside = |at: Point| fence.contains(at);
    let mut frontiers = Frontiers::new(lattice, settings.slice, area, is_inside).ok()?;
    frontiers.update(map, area);
    Some(frontiers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::mission::terrain::tests::tiles_of;
    use crate::node::tests_support::settings;

    #[test]
    fn frontiers_follow_the_tiles_that_have_changed_and_the_small_ones_are_left_out() {
        let (settings, mut known) = (settings(1), KnownFrontiers::default());
        let mut map = Merged::new(settings.lattice, None);
        let tiles = tiles_of(|_, _| false);
        let (last, first) = tiles.split_last().unwrap();
        first.iter().for_each(|tile| {
            map.join(tile).unwrap();
        });
        let edge = settings.lattice.cell_at(Point::new(-0.1, 3.1));
        known.update(&map, &settings);
        assert!(known.contains(edge) && known.cells(9).any(|cell| cell == edge));
        assert_eq!(known.cells(9999).count(), 0);
        map.join(last).unwrap();
        known.update(&map, &settings);
        assert!(known.contains(edge), "nobody said that it has changed");
        known.tile_changed(last.address);
        known.update(&map, &settings);
        assert!(!known.contains(edge));
    }

    #[test]
    fn nothing_is_known_before_the_first_look_at_the_map() {
        let mut known = KnownFrontiers::default();
        known.tile_changed(tiles_of(|_, _| false)[0].address);
        assert!(
            known.changed.is_empty(),
            "it is made of all of the map anyway"
        );
        assert_eq!(known.cells(0).count(), 0);
    }
}
