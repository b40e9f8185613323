//! Pools the packets of vehicles that fly into bins with a height: a cube at each end of the radio path.
//!
//! Seen from above the bins are those of [`LinkBins`], which pools them: there is one of it for each pair of storeys, a storey
//! being as high as a bin is wide, with whole and half metres in the middle of one. A link that rises is another one than one
//! that falls between the same squares; one that is heard in both directions is one link. Spots are told apart as seen from
//! above. Nothing is calibrated here.

use std::collections::BTreeMap;

use crate::geom::Point;
use crate::tomo::bins::{BinKey, LinkBins, PlaceSum};
use crate::tomo::device_offsets::{DeviceOffsets, Devices};
use crate::tomo::{Link, SPOT_M};

/// A link between places with heights, of one packet or pooled.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SpaceLink {
    /// As it is seen from above.
    pub link: Link,
    /// How high its first end is, and its second one, metres.
    pub heights_m: [f64; 2],
}

impl SpaceLink {
    /// Returns both ends: east, north, up, metres.
    pub fn ends_m(&self) -> [[f64; 3]; 2] {
        let Link { from, to, .. } = self.link;
        let [from_z_m, to_z_m] = self.heights_m;
        [[from.x_m, from.y_m, from_z_m], [to.x_m, to.y_m, to_z_m]]
    }

    /// Returns the length in space, metres.
    pub fn length_m(&self) -> f64 {
        let [from_z_m, to_z_m] = self.heights_m;
        libm::hypot(self.link.length_m(), to_z_m - from_z_m)
    }
}

/// Which storey the end in the first square of a [`BinKey`] is in, and which the other one.
type Storeys = (i32, i32);

/// What was measured between two storeys.
#[derive(Clone, Debug)]
struct BetweenStoreys {
    bins: LinkBins,
    /// By the same keys as those have: records, and the sum of both heights, the first as x.
    heights: BTreeMap<BinKey, (u32, PlaceSum)>,
}

/// All that was heard between bins with a height.
#[derive(Clone, Debug)]
pub struct SpaceBins {
    bin_m: f64,
    storeys: BTreeMap<Storeys, BetweenStoreys>,
}

impl SpaceBins {
    /// Makes empty bins of this side, metres, positive.
    pub fn new(bin_m: f64) -> SpaceBins {
        SpaceBins {
            bin_m,
            storeys: BTreeMap::new(),
        }
    }

    /// Counts the packets of a link, as if each had been measured at the link's mean places; `devices` measured all of them,
    /// `None` = it is not known who. Places that are not finite are passed over.
    pub fn record(&mut self, devices: Option<Devices>, one: &SpaceLink) {
        let SpaceLink { link, heights_m } = one;
        if !one.ends_m().as_flattened().iter().all(|at| at.is_finite()) {
            return;
        }
        let (key, is_exchanged) = BinKey::of(link.from, link.to, self.bin_m);
        let [mut from_m, mut to_m] = *heights_m;
        // Above each other both ends have one square, and the lower one is the first.
        let is_upright = key.is_one_square();
        if is_exchanged || (is_upright && from_m > to_m) {
            (from_m, to_m) = (to_m, from_m);
        }
        // A float becomes the nearest whole number that fits, so no height overflows.
        let storey = |height_m: f64| libm::round(height_m / self.bin_m) as i32;
        let between = self
            .storeys
            .entry((storey(from_m), storey(to_m)))
            .or_insert_with(|| BetweenStoreys {
                bins: LinkBins::new(self.bin_m, SPOT_M),
                heights: BTreeMap::new(),
            });
        between.bins.record_link(devices, link);
        let records = link.packets.saturating_add(link.misses);
        let (count, sum) = between.heights.entry(key).or_default();
        *count = count.saturating_add(records);
        sum.add(Point::new(from_m, to_m), records);
    }

    /// Returns the links by their storeys and bins without what radios differ by, those of the empty sweep that they are
    /// compared with, too, and by how much radios differ; see [`LinkBins::links_against`].
    pub fn links_against(
        &self,
        empty: Option<&SpaceBins>,
    ) -> (
        Vec<SpaceLink>,
        Option<Vec<SpaceLink>>,
        Option<DeviceOffsets>,
    ) {
        let both = || [Some(self), empty].into_iter().flatten();
        let heard = || {
            let storeys = both().flat_map(|bins| bins.storeys.values());
            storeys.flat_map(|between| between.bins.all_heard())
        };
        let is_known = heard().flatten().all(|heard| heard.devices.is_some());
        let all: Vec<_> = heard().collect();
        let found = match empty.is_none() || is_known {
            true => DeviceOffsets::fit(all.iter().copied()),
            false => None,
        };
        let links = |bins: &SpaceBins| bins.links_without(found.as_ref());
        (links(self), empty.map(links), found)
    }

    fn links_without(&self, offsets: Option<&DeviceOffsets>) -> Vec<SpaceLink> {
        let of_storeys = |between: &BetweenStoreys| {
            let links = between.bins.links_without(offsets);
            let heights = between.heights.values().map(|(count, sum)| {
                let Point { x_m, y_m } = sum.mean(*count);
                [x_m, y_m]
            });
            let joined = |(link, heights_m)| SpaceLink { link, heights_m };
            links.into_iter().zip(heights).map(joined).collect()
        };
        let all: Vec<Vec<SpaceLink>> = self.storeys.values().map(of_storeys).collect();
        all.concat()
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::VehicleId;

    use super::*;

    fn packet(from_m: [f64; 3], to_m: [f64; 3], rssi_dbm: Option<f64>) -> SpaceLink {
        let place = |at: [f64; 3]| Point::new(at[0], at[1]);
        SpaceLink {
            link: Link::of_packet(place(from_m), place(to_m), 0.0, rssi_dbm),
            heights_m: [from_m[2], to_m[2]],
        }
    }

    fn links(packets: &[SpaceLink]) -> Vec<SpaceLink> {
        let mut bins = SpaceBins::new(0.5);
        packets.iter().for_each(|one| bins.record(None, one));
        bins.links_against(None).0
    }

    #[test]
    fn both_directions_are_one_link_and_storeys_are_told_apart() {
        let (a, b) = ([0.1, 0.2, 1.1], [10.1, 5.2, 3.9]);
        let pooled = links(&[
            packet(a, b, Some(-50.0)),
            packet(b, a, Some(-54.0)),
            packet([0.1, 0.2, 0.9], b, None),
        ]);
        assert_eq!(pooled.len(), 1);
        let Link {
            packets,
            misses,
            mean_dbm,
            ..
        } = pooled[0].link;
        assert_eq!((packets, misses, mean_dbm), (2, 1, -52.0));
        let [low_m, high_m] = pooled[0].heights_m;
        assert!((low_m - 3.1 / 3.0).abs() < 1e-9 && (high_m - 3.9).abs() < 1e-9);
        assert!((pooled[0].length_m() - libm::sqrt(125.0 + (high_m - low_m).powi(2))).abs() < 1e-9);
        let higher = packet([0.1, 0.2, 1.6], b, Some(-60.0));
        assert_eq!(links(&[packet(a, b, Some(-50.0)), higher]).len(), 2);
    }

    #[test]
    fn a_link_that_rises_is_another_one_than_one_that_falls() {
        let pooled = links(&[
            packet([0.0, 0.0, 1.0], [9.0, 0.0, 3.0], Some(-50.0)),
            packet([0.0, 0.0, 3.0], [9.0, 0.0, 1.0], Some(-70.0)),
        ]);
        let found: Vec<_> = pooled
            .iter()
            .map(|one| (one.heights_m, one.link.mean_dbm))
            .collect();
        assert_eq!(found, [([1.0, 3.0], -50.0), ([3.0, 1.0], -70.0)]);
    }

    #[test]
    fn who_flies_above_another_one_has_one_link_with_it() {
        let (low, high) = ([2.0, 2.1, 1.0], [2.0, 2.0, 3.0]);
        let pooled = links(&[
            packet(low, high, Some(-50.0)),
            packet(high, low, Some(-52.0)),
        ]);
        assert_eq!((pooled.len(), pooled[0].link.packets), (1, 2));
        assert_eq!(pooled[0].heights_m, [1.0, 3.0]);
    }

    #[test]
    fn what_radios_differ_by_is_taken_out_over_all_storeys() {
        let swept = |heard_more_db: f64| {
            let mut bins = SpaceBins::new(0.5);
            for step in 0..60 {
                let along_m = f64::from(step);
                for (transmitter, receiver) in [(1, 2), (2, 1), (1, 3), (3, 1), (2, 3), (3, 2)] {
                    let devices = Devices {
                        transmitter: VehicleId(transmitter),
                        receiver: VehicleId(receiver),
                    };
                    let more_db = if receiver == 3 { heard_more_db } else { 0.0 };
                    let height_m = 1.0 + f64::from(step % 3);
                    let (a, b) = ([along_m, 0.0, height_m], [0.0, 30.0, 2.0]);
                    let rssi_dbm = -60.0 - f64::from(step % 7) + more_db;
                    bins.record(Some(devices), &packet(a, b, Some(rssi_dbm)));
                }
            }
            bins
        };
        let (now, empty, offsets) = swept(6.0).links_against(Some(&swept(0.0)));
        assert!(offsets.is_none_or(|found| found.list().len() == 3));
        let (alone, _, offsets) = swept(6.0).links_against(None);
        assert!(offsets.is_some());
        assert_eq!(
            (now.len(), empty.map(|links| links.len()), alone.len()),
            (60, Some(60), 60)
        );
        // Without the offset of the third radio no packet of a bin differs from another one.
        assert!(alone.iter().all(|one| one.link.spread_db < 0.2));
    }
}
