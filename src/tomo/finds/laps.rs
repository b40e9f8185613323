//! Which links of a sweep are of one lap, and their order along it.
//!
//! Vehicles that drive along a ring one behind the other stay about as far from each other for a lap: the distance of a link's two
//! ends along the ring tells its lap, and the middle between them how far the lap had come.

use super::Driven;
use super::ring::Ring;
use crate::tomo::Observation;

/// A lap is apart from the next one by more than this, bins.
const APART_BINS: f64 = 1.5;

/// A link on its way into a lap.
#[derive(Clone, Copy)]
struct Placed {
    /// Its place in what was given.
    link: usize,
    apart_m: f64,
    middle_m: f64,
}

/// The laps of a sweep.
pub(super) struct Laps {
    /// Links in the order of laps and along each lap, by their places in what was given.
    order: Vec<usize>,
    /// In that order: how much farther along the ring the middle of the lap's next link is, bins; `None` at its end.
    steps: Vec<Option<f64>>,
}

impl Laps {
    /// Puts links into laps; `None` when the sweep was not driven along its ring.
    pub(super) fn of(observations: &[Observation], driven: Driven) -> Option<Laps> {
        let ring = Ring::of(observations, driven)?;
        let bin_m = driven.bin_m;
        let placed = |(link, one): (usize, &Observation)| {
            let (apart_m, middle_m) = ring.spans_m(one.from, one.to);
            Placed {
                link,
                apart_m,
                middle_m,
            }
        };
        let mut links: Vec<Placed> = observations.iter().enumerate().map(placed).collect();
        links.sort_by(|a, b| a.apart_m.total_cmp(&b.apart_m).then(a.link.cmp(&b.link)));
        let (mut order, mut steps) = (Vec::new(), Vec::new());
        let half_m = 0.5 * ring.length_m();
        for lap in links.chunk_by_mut(|a, b| b.apart_m - a.apart_m <= APART_BINS * bin_m) {
            // Half a ring apart either end may be the first: then both middles are one.
            if lap.iter().any(|one| one.apart_m >= half_m - bin_m) {
                lap.iter_mut().for_each(|one| one.middle_m %= half_m);
            }
            lap.sort_by(|a, b| a.middle_m.total_cmp(&b.middle_m).then(a.link.cmp(&b.link)));
            let onward = lap
                .windows(2)
                .map(|pair| Some((pair[1].middle_m - pair[0].middle_m) / bin_m));
            steps.extend(onward.chain([None]));
            order.extend(lap.iter().map(|one| one.link));
        }
        Some(Laps { order, steps })
    }

    /// Returns links in the order of laps.
    pub(super) fn ordered(&self, observations: &[Observation]) -> Vec<Observation> {
        let links = self.order.iter();
        links.map(|link| observations[*link]).collect()
    }

    /// Returns, for every link in that order, how much farther along the ring the middle of its lap's next link is, bins; `None`
    /// at the end of a lap.
    pub(super) fn steps(&self) -> &[Option<f64>] {
        &self.steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect};

    #[test]
    fn laps_are_told_by_how_far_apart_their_ends_are() {
        let driven = Driven {
            ring: Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0)),
            bin_m: 0.5,
        };
        let link = |from: Point, to: Point| Observation {
            from,
            to,
            attenuation_db: 0.0,
            variance_db2: 1.0,
            is_at_floor: false,
        };
        let (south, east, north) = (
            |x_m| Point::new(x_m, 0.0),
            |y_m| Point::new(20.0, y_m),
            |x_m| Point::new(x_m, 20.0),
        );
        // 30 m apart along the ring, the same, 40 m, the same by exchanged ends, and 34 m.
        let sweep = [
            link(south(2.0), east(12.0)),
            link(south(8.2), east(18.0)),
            link(south(5.0), north(15.0)),
            link(north(12.0), south(8.0)),
            link(south(6.0), north(20.0)),
        ];
        let laps = Laps::of(&sweep, driven).unwrap();
        assert_eq!(laps.order, [0, 1, 4, 2, 3]);
        let ordered = [0, 1, 4, 2, 3].map(|link: usize| sweep[link]);
        assert_eq!(laps.ordered(&sweep), ordered);
        // Middles at 17.0 and 23.1 m; at 25 and, with exchanged ends, 28 m.
        let tenths = |step: &Option<f64>| step.map_or(-1, |step| (10.0 * step).round() as i32);
        let steps: Vec<i32> = laps.steps().iter().map(tenths).collect();
        assert_eq!(steps, [122, -1, -1, 60, -1]);
        let inside = [link(Point::new(9.0, 9.0), south(1.0))];
        assert!(Laps::of(&inside, driven).is_none());
    }
}
