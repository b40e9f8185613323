//! The ends of a link to the last bit, as a key of what was worked out for it.

use crate::geom::Segment;

/// Where a link begins and ends.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) struct LinkEnds([u64; 4]);

impl LinkEnds {
    pub(super) fn of(link: Segment) -> LinkEnds {
        let Segment { from, to } = link;
        LinkEnds([from.x_m, from.y_m, to.x_m, to.y_m].map(f64::to_bits))
    }
}
