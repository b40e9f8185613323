//! What is known of one radio path: where its ends were, how strong it was, how well that is known.
//!
//! A link is direction-free: packets of both directions are pooled before (reciprocity holds within 0.9 dB).

use crate::geom::{Point, Segment};

/// The pooled measurements between two places (one bin at each end, or two fixed positions).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Link {
    /// Mean place of the first end, metres (or the units of the input).
    pub from: Point,
    /// Mean place of the second end, metres (or the units of the input).
    pub to: Point,
    /// Packets heard, both directions together.
    pub packets: u32,
    /// Distinct pairs of places, half a wavelength apart, among the packets: the number of independent fades.
    pub spots: u32,
    /// Packets that were expected and not heard.
    pub misses: u32,
    /// Mean signal strength of the packets heard, dBm; not a number when none was heard.
    pub mean_dbm: f64,
    /// Standard deviation of a single packet about the mean, dB; 0 when unknown.
    pub spread_db: f64,
}

impl Link {
    /// Makes a link between two fixed places from the mean of some packets; one spot, no miss.
    pub fn fixed(from: Point, to: Point, packets: u32, mean_dbm: f64) -> Link {
        Link { from, to, packets, spots: 1, misses: 0, mean_dbm, spread_db: 0.0 }
    }

    /// Gives the length, metres.
    pub fn length_m(&self) -> f64 {
        self.from.distance_to(self.to)
    }

    /// Gives the straight path.
    pub fn segment(&self) -> Segment {
        Segment::new(self.from, self.to)
    }

    /// Gives the mean strength with misses counted at the receiver's sensitivity, dBm; `None` when nothing is known.
    ///
    /// A miss says "at most this strong" (censored data). A few misses are collisions and are passed over; when there are
    /// at least as many misses as packets, each counts as one packet at the sensitivity, which bounds the
    /// attenuation from below. A link that was never heard needs three misses to count.
    pub fn censored_mean_dbm(&self, sensitivity_dbm: f64) -> Option<f64> {
        const FEWEST_MISSES: u32 = 3;
        let (heard, missed) = (f64::from(self.packets), f64::from(self.misses));
        if self.packets == 0 {
            return (self.misses >= FEWEST_MISSES).then_some(sensitivity_dbm);
        }
        if self.misses < self.packets.max(FEWEST_MISSES) {
            return Some(self.mean_dbm);
        }
        Some((heard * self.mean_dbm + missed * sensitivity_dbm.min(self.mean_dbm)) / (heard + missed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(packets: u32, misses: u32, expected: Option<f64>) {
        let mut link = Link::fixed(Point::new(0.0, 0.0), Point::new(3.0, 4.0), packets, -60.0);
        link.misses = misses;
        assert_eq!(link.censored_mean_dbm(-90.0), expected);
    }

    #[test]
    fn many_misses_pull_the_mean_to_the_sensitivity() {
        check(4, 0, Some(-60.0));
        check(4, 3, Some(-60.0));
        check(4, 4, Some(-75.0));
        check(0, 2, None);
        check(0, 3, Some(-90.0));
    }
}
