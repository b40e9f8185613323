//! Whether a mission of its own gets on: it comes to places, or sees what nobody has seen. Neither can go on for ever, so
//! a mission that does neither for long will never end by itself. Times in which it is not gone on with (an order to hold,
//! no place) do not count.
//!
//! Deliberately absent: what is done about a mission that does not get on.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{TILE_SIDE, TileAddress, TileReport};

use crate::geom::Segment;
use crate::node::VehicleSettings;
use crate::time::Time;

/// So long a mission may do without anything new, and longer by the time for a way along the whole fence. People read of it
/// in docs/modules.md.
const STALLED_AFTER: Duration = Duration::from_secs(300);
/// What is less than this in all is nothing new, square metres.
const NEW_M2: f64 = 1.0;
/// When it was not gone on with for this long, that time does not count.
const PAUSE: Duration = Duration::from_secs(2);

/// When something new came last.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct ProgressWatch {
    within: Duration,
    /// So many cells that nobody had seen are something new.
    enough: usize,
    /// Which cells somebody has seen, a bit each.
    seen: BTreeMap<TileAddress, [u32; TILE_SIDE]>,
    /// Cells seen for the first time since something new came.
    fresh: usize,
    /// When something new came last, pauses left out, and when it was gone on with last.
    times: Option<(Time, Time)>,
}

impl ProgressWatch {
    /// Makes the watch of a mission that has not begun.
    pub(super) fn new(settings: &VehicleSettings) -> ProgressWatch {
        let cell_m = settings.lattice.cell_m();
        let around_m: f64 = settings.fence.edges().map(Segment::length_m).sum();
        let way_s = around_m / settings.body.speed_mps.max(1e-3);
        ProgressWatch {
            within: STALLED_AFTER + Duration::from_secs_f64(way_s.min(1e6)),
            enough: (NEW_M2 / (cell_m * cell_m)).ceil().max(1.0) as usize,
            seen: BTreeMap::new(),
            fresh: 0,
            times: None,
        }
    }

    /// Takes a tile of the map that has changed.
    pub(super) fn learn(&mut self, tile: &TileReport) {
        let seen = self.seen.entry(tile.address).or_insert([0; TILE_SIDE]);
        for (row, bits) in tile.cells.chunks(TILE_SIDE).zip(seen) {
            let known = row
                .iter()
                .enumerate()
                .filter(|(_, value)| **value != 0)
                .fold(0_u32, |known, (column, _)| known | 1 << column);
            self.fresh += (known & !*bits).count_ones() as usize;
            *bits |= known;
        }
    }

    /// Records that the mission goes on.
    pub(super) fn go_on(&mut self, now: Time) {
        let (mut since, last) = self.times.unwrap_or((now, now));
        let pause = now.since(last);
        if pause > PAUSE {
            since = since + pause;
        }
        if self.fresh >= self.enough {
            since = now;
            self.fresh = 0;
        }
        self.times = Some((since, now));
    }

    /// Records that the mission has got on: it has come to a place, gives one up, or looks at something from near.
    pub(super) fn get_on(&mut self, now: Time) {
        (self.times, self.fresh) = (Some((now, now)), 0);
    }

    /// Returns whether nothing new has come for too long.
    pub(super) fn is_stalled(&self) -> bool {
        self.times
            .is_some_and(|(since, last)| last.since(since) >= self.within)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::node::tests_support::settings;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    /// A fence of 120 m, driven along at 0.5 m/s: 240 s.
    const WITHIN_S: f64 = 300.0 + 240.0;

    /// A tile of which so many cells are known.
    fn tile(x: i32, known: usize) -> TileReport {
        TileReport {
            layer: Default::default(),
            address: TileAddress { slice: 0, x, y: 0 },
            revision: 1,
            cells: Arc::new(std::array::from_fn(|index| match index < known {
                true => -17,
                false => 0,
            })),
        }
    }

    /// Goes on every second from one moment to another; returns when it is found stalled.
    fn stalls_at(watch: &mut ProgressWatch, from_s: usize, until_s: usize) -> Option<usize> {
        (from_s..until_s).find(|now_s| {
            watch.go_on(at(*now_s as f64));
            watch.is_stalled()
        })
    }

    #[test]
    fn without_anything_new_it_is_stalled_after_the_time_for_a_way_around() {
        let mut watch = ProgressWatch::new(&settings(1));
        let stalled = stalls_at(&mut watch, 10, 2000).unwrap() as f64;
        assert!((stalled - 10.0 - WITHIN_S).abs() < 2.0, "{stalled}");
        watch.get_on(at(stalled));
        assert!(!watch.is_stalled());
    }

    #[test]
    fn cells_seen_for_the_first_time_are_new_and_no_others() {
        let mut watch = ProgressWatch::new(&settings(1));
        watch.learn(&tile(0, 40));
        assert_eq!(stalls_at(&mut watch, 0, 500), None);
        for known in [41, 47, 60] {
            watch.learn(&tile(0, known));
        }
        watch.learn(&tile(1, 5));
        assert_eq!(stalls_at(&mut watch, 500, 1000), None, "25 are new");
        watch.learn(&tile(0, 60));
        watch.learn(&tile(1, 29));
        assert!(stalls_at(&mut watch, 1000, 1100).is_some(), "24 are");
    }

    #[test]
    fn a_pause_does_not_count() {
        let mut watch = ProgressWatch::new(&settings(1));
        assert_eq!(stalls_at(&mut watch, 0, 500), None);
        assert_eq!(stalls_at(&mut watch, 5000, 5030), None);
        assert!(stalls_at(&mut watch, 5030, 5050).is_some());
    }
}
