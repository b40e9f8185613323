//! The weights of the links of the last image: while image follows image, most links stay where they are, and their weights
//! are the same to the last bit.

use std::collections::BTreeMap;

use crate::geom::{PixelGrid, Segment};
use crate::tomo::link_ends::LinkEnds;
use crate::tomo::weights::{WeightModel, WeightRows};

/// No more than this is kept.
const MOST_BYTES: usize = 32 << 20;

/// The weights of links in an image of always the same pixels, by one model. A copy knows none: they save time alone.
#[derive(Debug, Default)]
pub(super) struct KnownRows {
    rows: WeightRows,
    row_of: BTreeMap<LinkEnds, usize>,
}

impl Clone for KnownRows {
    fn clone(&self) -> KnownRows {
        KnownRows::default()
    }
}

impl KnownRows {
    /// Returns what [`WeightRows::rescaled`] gives, and keeps it.
    pub(super) fn rows(
        &mut self,
        links: impl Iterator<Item = Segment>,
        grid: &PixelGrid,
        model: WeightModel,
    ) -> WeightRows {
        let mut rows = WeightRows::new();
        let mut row_of = BTreeMap::new();
        for (row, link) in links.enumerate() {
            let ends = LinkEnds::of(link);
            match self.row_of.get(&ends) {
                Some(known) => rows.append(&self.rows, *known),
                None => rows.push_rescaled(link, grid, model),
            }
            row_of.insert(ends, row);
        }
        *self = if rows.bytes() <= MOST_BYTES {
            let rows = rows.clone();
            KnownRows { rows, row_of }
        } else {
            KnownRows::default()
        };
        rows
    }

    /// Forgets them.
    pub(super) fn forget(&mut self) {
        *self = KnownRows::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect};

    #[test]
    fn links_that_come_go_and_move_have_the_weights_that_they_have_alone() {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(8.0, 6.0));
        let grid = PixelGrid {
            area,
            columns: 16,
            rows: 12,
        };
        let model = WeightModel::InverseArea { width_m: 0.3 };
        let link = |k: u32, moved_m: f64| {
            let at_m = f64::from(k % 11) * 0.5 + moved_m;
            Segment::new(Point::new(0.0, at_m), Point::new(8.0, 6.0 - at_m))
        };
        let mut known = KnownRows::default();
        for image in 0..6 {
            let moves = |k: u32| f64::from(u32::from(k % 4 == image % 4) * image) * 0.01;
            let links: Vec<Segment> = (image..30 - image).map(|k| link(k, moves(k))).collect();
            let got = known.rows(links.iter().copied(), &grid, model);
            assert_eq!(got, WeightRows::rescaled(links, &grid, model));
        }
        known.forget();
        assert!(known.row_of.is_empty());
    }
}
