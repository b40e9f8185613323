//! What is known of one radio path: where its ends were, how strong it was, how well that is known.
//!
//! A link is direction-free: packets of both directions are pooled before (reciprocity holds within 0.9 dB).
//! Strengths are those of a transmit power of 0 dBm, whatever packets were sent with ([`Link::of_packet`]), so that runs can be
//! compared.

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Segment};

use super::censored::{CensoredMean, FEWEST_MISSES, censored_mean};

/// The pooled measurements between two places (one bin at each end, or two fixed positions).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
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
    /// Mean signal strength of the packets heard, dBm, as if they had been sent with 0 dBm; not a number when none was heard.
    pub mean_dbm: f64,
    /// Standard deviation of a single packet about the mean, dB; 0 when unknown.
    pub spread_db: f64,
    /// Mean transmit power of the packets that were not heard, dBm; 0 when all were heard. See [`floor_dbm`].
    pub missed_power_dbm: f64,
}

impl Link {
    /// Makes a link between two fixed places from the mean of some packets; one spot, no miss.
    pub fn fixed(from: Point, to: Point, packets: u32, mean_dbm: f64) -> Link {
        Link {
            from,
            to,
            packets,
            spots: 1,
            misses: 0,
            mean_dbm,
            spread_db: 0.0,
            missed_power_dbm: 0.0,
        }
    }

    /// Makes a link of one packet: what it was sent with, dBm, and how strongly it was heard, dBm; `None` when it was expected
    /// and not heard.
    pub fn of_packet(from: Point, to: Point, power_dbm: f64, rssi_dbm: Option<f64>) -> Link {
        match rssi_dbm {
            Some(rssi_dbm) => Link::fixed(from, to, 1, rssi_dbm - power_dbm),
            None => Link {
                misses: 1,
                missed_power_dbm: power_dbm,
                ..Link::fixed(from, to, 0, f64::NAN)
            },
        }
    }

    /// Returns the length, metres.
    pub fn length_m(&self) -> f64 {
        self.from.distance_to(self.to)
    }

    /// Returns the straight path.
    pub fn segment(&self) -> Segment {
        Segment::new(self.from, self.to)
    }

    /// Returns whether both say the same, strength and spread within so much, dB; two that were never heard have no strength,
    /// and say the same of it.
    fn is_same(&self, other: &Link, within_db: f64) -> bool {
        let but_for_strength = |link: &Link| Link {
            mean_dbm: 0.0,
            spread_db: 0.0,
            ..*link
        };
        let is_near = |own_db: f64, its_db: f64| {
            (own_db - its_db).abs() <= within_db || (own_db.is_nan() && its_db.is_nan())
        };
        is_near(self.mean_dbm, other.mean_dbm)
            && is_near(self.spread_db, other.spread_db)
            && but_for_strength(self) == but_for_strength(other)
    }

    /// Returns whether links say the same as others, one to one; see [`Self::is_same`].
    pub(super) fn are_same(links: &[Link], others: &[Link], within_db: f64) -> bool {
        let mut pairs = links.iter().zip(others);
        links.len() == others.len() && pairs.all(|(own, its)| own.is_same(its, within_db))
    }

    /// Returns the pooled packets of this link and another one whose ends lie near this one's, in this order.
    pub fn pooled(&self, other: &Link) -> Link {
        let share =
            |own: u32, its: u32| f64::from(its) / (f64::from(own) + f64::from(its)).max(1.0);
        let records = |link: &Link| link.packets.saturating_add(link.misses);
        let place = share(records(self), records(other));
        let (packets, mean_dbm) = (
            self.packets.saturating_add(other.packets),
            self.pooled_mean_dbm(other),
        );
        let squares = |link: &Link| {
            let (count, apart_db) = (f64::from(link.packets), link.mean_dbm - mean_dbm);
            if link.packets == 0 {
                return 0.0;
            }
            (count - 1.0) * link.spread_db * link.spread_db + count * apart_db * apart_db
        };
        let freedom = (f64::from(packets) - 1.0).max(1.0);
        Link {
            from: self.from + (other.from - self.from) * place,
            to: self.to + (other.to - self.to) * place,
            packets,
            spots: self.spots.saturating_add(other.spots),
            misses: self.misses.saturating_add(other.misses),
            mean_dbm,
            spread_db: ((squares(self) + squares(other)) / freedom).sqrt(),
            missed_power_dbm: self.pooled_missed_power_dbm(other),
        }
    }

    /// Returns the mean transmit power over what was not heard of both.
    fn pooled_missed_power_dbm(&self, other: &Link) -> f64 {
        let (own, its) = (f64::from(self.misses), f64::from(other.misses));
        (own * self.missed_power_dbm + its * other.missed_power_dbm) / (own + its).max(1.0)
    }

    /// Returns the mean over the packets of both; not a number when neither was heard.
    fn pooled_mean_dbm(&self, other: &Link) -> f64 {
        match (self.packets, other.packets) {
            (_, 0) => self.mean_dbm,
            (0, _) => other.mean_dbm,
            (own, its) => {
                let (own, its) = (f64::from(own), f64::from(its));
                (own * self.mean_dbm + its * other.mean_dbm) / (own + its)
            }
        }
    }

    /// Returns whether it was never heard, and missed often enough to say so: it is weaker than the receiver's floor.
    pub fn is_silent(&self) -> bool {
        self.packets == 0 && self.misses >= FEWEST_MISSES
    }

    /// Returns the mean strength by what was heard and missed, by a receiver with this floor ([`floor_dbm`]), if one packet
    /// varies by so much; `None` when nothing is known. Of a silent link it is the bound below which it lies.
    pub fn censored(&self, floor_dbm: f64, packet_sd_db: f64) -> Option<CensoredMean> {
        let heard = (self.packets, self.mean_dbm);
        censored_mean(heard, self.misses, floor_dbm, packet_sd_db)
    }
}

/// Returns the strength below which nothing of some links that are compared is heard, dBm: a receiver's sensitivity, for
/// the least power with which a packet was sent that was missed. One floor for all, since a floor for each power would show
/// a change where nothing was heard, before and now.
pub fn floor_dbm<'a>(links: impl Iterator<Item = &'a Link>, sensitivity_dbm: f64) -> f64 {
    let silent = links.filter(|link| link.is_silent());
    let least_dbm = silent.map(|link| link.missed_power_dbm).reduce(f64::min);
    sensitivity_dbm - least_dbm.unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pooled_links_have_the_moments_of_all_packets() {
        // Packets of -60, -62 and -64 dBm here, of -70 and -74 dBm there.
        let (here, there) = (Point::new(0.0, 0.0), Point::new(10.0, 0.0));
        let one = Link {
            spread_db: 2.0,
            ..Link::fixed(here, there, 3, -62.0)
        };
        let moved = Point::new(0.5, 0.0);
        let two = Link {
            spread_db: 8f64.sqrt(),
            misses: 1,
            ..Link::fixed(moved, there, 2, -72.0)
        };
        let both = one.pooled(&two);
        assert_eq!(
            (both.packets, both.misses, both.spots, both.mean_dbm),
            (5, 1, 2, -66.0)
        );
        // The squares of 6, 4, 2, -4 and -8 sum up to 136.
        assert!((both.spread_db - 34f64.sqrt()).abs() < 1e-9);
        assert!(both.from.distance_to(Point::new(0.25, 0.0)) < 1e-12 && both.to == there);
        let silent = Link {
            misses: 4,
            ..Link::fixed(here, there, 0, f64::NAN)
        };
        assert_eq!(silent.pooled(&two).mean_dbm, -72.0);
        assert!(
            silent.pooled(&silent).mean_dbm.is_nan() && silent.pooled(&silent).spread_db == 0.0
        );
    }

    #[test]
    fn a_packet_says_the_same_whatever_it_was_sent_with() {
        let (here, there) = (Point::new(0.0, 0.0), Point::new(10.0, 0.0));
        let of = |power_dbm, rssi_dbm| Link::of_packet(here, there, power_dbm, rssi_dbm);
        assert_eq!(of(8.0, Some(-52.0)), of(0.0, Some(-60.0)));
        assert_eq!(of(-10.0, Some(-70.0)), of(0.0, Some(-60.0)));
        // Of three packets that were sent with 5, 5 and 8 dBm the floor lies 6 dB lower, beside others of 0 dBm it does not.
        let missed = of(5.0, None).pooled(&of(5.0, None)).pooled(&of(8.0, None));
        let alone_dbm = floor_dbm([&missed].into_iter(), -95.0);
        let silent = Link {
            misses: 4,
            ..Link::fixed(here, there, 0, f64::NAN)
        };
        assert_eq!((missed.misses, alone_dbm), (3, -101.0));
        assert_eq!(floor_dbm([&missed, &silent].into_iter(), -95.0), -95.0);
        let bound = missed.censored(alone_dbm, 1e-9).unwrap();
        assert!((bound.mean_dbm + 101.0).abs() < 1e-6, "{bound:?}");
    }
}
