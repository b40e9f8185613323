//! Pools the packets of moving vehicles into bins: one square at each end of the radio path.
//!
//! Memory grows with the bins that were visited and the pairs that have met there, not with packets. Strengths are those of a
//! transmit power of 0 dBm ([`Link::of_packet`]). Nothing is calibrated or dropped here.

use std::borrow::Borrow;
use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Sample, VehicleId};

use crate::geom::Point;

use super::Link;
use super::device_offsets::{DeviceOffsets, Devices};

/// The default side of a bin, metres.
pub const BIN_M: f64 = 0.5;
/// The default side of a spot, metres: half a wavelength at 2.4 GHz.
pub const SPOT_M: f64 = 0.0625;
/// Spots beyond this number are not told apart; the fades are averaged well by then.
const MOST_SPOTS: usize = 64;

/// A bin pair: two packed square indices, the smaller one first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub(super) struct BinKey(u64, u64);

impl BinKey {
    /// Returns the key of a pair of places and whether the places were exchanged to make it direction-free.
    pub(super) fn of(from: Point, to: Point, bin_m: f64) -> (BinKey, bool) {
        let (a, b) = (square(from, bin_m), square(to, bin_m));
        let exchanged = a > b;
        let (low, high) = if exchanged { (b, a) } else { (a, b) };
        (BinKey(low, high), exchanged)
    }

    /// Returns whether both ends lie in one square.
    pub(super) fn is_one_square(self) -> bool {
        self.0 == self.1
    }

    /// Returns the key whose ends lie the given numbers of squares (x, y) away from this key's ends.
    pub(super) fn moved(self, low: (i32, i32), high: (i32, i32)) -> BinKey {
        let (a, b) = (shifted(self.0, low), shifted(self.1, high));
        BinKey(a.min(b), a.max(b))
    }
}

/// Returns the square around a place. The middles of squares are multiples of their side, since rings are laid out in whole and
/// half metres: along an edge of squares each link would be split among up to four bins.
fn square(at: Point, bin_m: f64) -> u64 {
    // A float becomes the nearest whole number that fits, so no place overflows.
    let index = |metres: f64| libm::round(metres / bin_m) as i32;
    packed(index(at.x_m), index(at.y_m))
}

/// Packs a row and a column so that the order of the numbers is the order of rows, then columns.
fn packed(x: i32, y: i32) -> u64 {
    let biased = |index: i32| u64::from(index.cast_unsigned() ^ 0x8000_0000);
    (biased(y) << 32) | biased(x)
}

fn shifted(square: u64, by: (i32, i32)) -> u64 {
    let unbiased = |index: u64| (index as u32 ^ 0x8000_0000).cast_signed();
    packed(
        unbiased(square).saturating_add(by.0),
        unbiased(square >> 32).saturating_add(by.1),
    )
}

/// Units of [`PlaceSum`] in a metre: 2^40, so that scaling is exact and rounding is below a picometre.
const UNITS_PER_M: f64 = 1_099_511_627_776.0;

/// The sum of places in whole units, so that it is the same in whatever order they come.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct PlaceSum {
    x: i128,
    y: i128,
}

impl PlaceSum {
    pub(super) fn add(&mut self, place: Point, times: u32) {
        // A float becomes the nearest whole number that fits, so no place overflows.
        let units = |metres: f64| {
            (libm::round(metres * UNITS_PER_M) as i128).saturating_mul(i128::from(times))
        };
        self.x = self.x.saturating_add(units(place.x_m));
        self.y = self.y.saturating_add(units(place.y_m));
    }

    pub(super) fn mean(&self, count: u32) -> Point {
        let metres = |units: i128| units as f64 / UNITS_PER_M / f64::from(count);
        Point::new(metres(self.x), metres(self.y))
    }
}

/// What a pair of radios has heard in a bin.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Heard {
    /// `None` = it is not known who.
    pub devices: Option<Devices>,
    pub packets: u32,
    /// Sum of the strengths, dBm.
    pub sum_dbm: f64,
    /// Sum of their squares.
    pub square_sum: f64,
}

impl Heard {
    fn nothing(devices: Option<Devices>) -> Heard {
        Heard {
            devices,
            packets: 0,
            sum_dbm: 0.0,
            square_sum: 0.0,
        }
    }

    /// Returns the same as if every packet had been so much weaker, dB.
    fn weaker(&self, by_db: f64) -> Heard {
        let packets = f64::from(self.packets);
        Heard {
            sum_dbm: self.sum_dbm - packets * by_db,
            square_sum: self.square_sum - 2.0 * by_db * self.sum_dbm + packets * by_db * by_db,
            ..*self
        }
    }
}

/// Running sums of one bin pair.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Bin {
    records: u32,
    from_sum: PlaceSum,
    to_sum: PlaceSum,
    /// By who sent and who heard.
    heard: Vec<Heard>,
    spots: Vec<u16>,
    /// Spots of pooled links beyond the one that their mean place stands for.
    further_spots: u32,
    /// Sum of what those packets were sent with that were not heard, dBm.
    missed_power_sum_dbm: f64,
}

/// All that was heard between bins.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LinkBins {
    bin_m: f64,
    spot_m: f64,
    bins: BTreeMap<BinKey, Bin>,
}

impl Default for LinkBins {
    fn default() -> LinkBins {
        LinkBins::new(BIN_M, SPOT_M)
    }
}

impl LinkBins {
    /// Returns the side of the squares in which links are pooled, metres.
    pub fn bin_m(&self) -> f64 {
        self.bin_m
    }

    /// Makes empty bins; both sides in metres, positive.
    pub fn new(bin_m: f64, spot_m: f64) -> LinkBins {
        debug_assert!(bin_m > 0.0 && spot_m > 0.0);
        LinkBins {
            bin_m,
            spot_m,
            bins: BTreeMap::new(),
        }
    }

    /// Counts a sample that `receiver` has measured. Places that are not finite are passed over.
    pub fn record_sample(&mut self, receiver: VehicleId, sample: &Sample) {
        let devices = Devices {
            transmitter: sample.transmitter,
            receiver,
        };
        let tx = Point::from(sample.transmitter_pose.at);
        let rx = Point::from(sample.receiver_pose.at);
        let rssi_dbm = sample.rssi_dbm.map(f64::from);
        let link = Link::of_packet(tx, rx, f64::from(sample.power_dbm), rssi_dbm);
        self.record_link(Some(devices), &link);
    }

    /// Counts one packet of two radios from `tx` to `rx` that was sent with 0 dBm: its strength in dBm, or `None` when it was
    /// expected and not heard. Places that are not finite are passed over.
    pub fn record(&mut self, devices: Devices, tx: Point, rx: Point, rssi_dbm: Option<i16>) {
        let link = Link::of_packet(tx, rx, 0.0, rssi_dbm.map(f64::from));
        self.record_link(Some(devices), &link);
    }

    /// Counts the pooled packets of a link, as if each had been recorded at the link's mean places; `devices` measured all of
    /// them, `None` = it is not known who. Places that are not finite are passed over.
    pub fn record_link(&mut self, devices: Option<Devices>, link: &Link) {
        if !link.from.is_finite() || !link.to.is_finite() {
            return;
        }
        let (key, exchanged) = BinKey::of(link.from, link.to, self.bin_m);
        let (from, to) = if exchanged {
            (link.to, link.from)
        } else {
            (link.from, link.to)
        };
        let spot = spot_code(from, to, self.bin_m, self.spot_m);
        self.bins
            .entry(key)
            .or_default()
            .add_link(devices, (from, to), link, spot);
    }

    /// Returns which vehicles have measured a link that was made here, by its mean places, ascending; none when it is not known.
    pub fn vehicles_between(&self, from: Point, to: Point) -> Vec<VehicleId> {
        let (key, _) = BinKey::of(from, to, self.bin_m);
        let heard = self.bins.get(&key).into_iter().flat_map(|bin| &bin.heard);
        let ends = heard
            .filter_map(|heard| heard.devices)
            .flat_map(|devices| [devices.transmitter, devices.receiver]);
        let vehicles: BTreeSet<VehicleId> = ends.collect();
        vehicles.into_iter().collect()
    }

    /// Returns the number of bin pairs.
    pub(crate) fn len(&self) -> usize {
        self.bins.len()
    }

    /// Returns the links in the order of their bins (rows, then columns, of the first and then of the second end), without what
    /// radios differ by.
    pub fn links(&self) -> Vec<Link> {
        self.links_and_offsets().0
    }

    /// Returns the same links with what radios differ by, as they were measured.
    pub fn measured_links(&self) -> Vec<Link> {
        self.links_without(None)
    }

    /// Returns the links without what radios differ by, and by how much these do; `None` when they are alike as far as bins
    /// that several pairs have measured say.
    pub fn links_and_offsets(&self) -> (Vec<Link>, Option<DeviceOffsets>) {
        let found = DeviceOffsets::fit(self.all_heard());
        (self.links_without(found.as_ref()), found)
    }

    /// Returns the links of a run and those of the empty one that it is compared with, without what radios differ by, and
    /// by how much these do. That is found from both together: each alone knows its radios against those that took part in
    /// it only, and the difference of what two fleets have in common would show as a change everywhere. Where one of them
    /// does not say who measured a link, all are taken as they were measured.
    pub fn links_against(&self, empty: &LinkBins) -> (Vec<Link>, Vec<Link>, Option<DeviceOffsets>) {
        let both = self.all_heard().chain(empty.all_heard());
        let is_known = both.clone().flatten().all(|heard| heard.devices.is_some());
        let found = if is_known {
            DeviceOffsets::fit(both)
        } else {
            None
        };
        let of = |bins: &LinkBins| bins.links_without(found.as_ref());
        (of(self), of(empty), found)
    }

    /// Returns the links of two of some runs, by what each has measured; of a run without samples there are none. See
    /// [`LinkBins::links_against`].
    pub fn links_of_runs<R: Ord>(
        runs: &BTreeMap<R, impl Borrow<LinkBins>>,
        now: &R,
        empty: &R,
    ) -> (Vec<Link>, Vec<Link>) {
        let nothing = LinkBins::default();
        let of = |run: &R| runs.get(run).map_or(&nothing, Borrow::borrow);
        let (now, empty, _) = of(now).links_against(of(empty));
        (now, empty)
    }

    pub(super) fn all_heard(&self) -> impl Iterator<Item = &[Heard]> + Clone {
        self.bins.values().map(|bin| bin.heard.as_slice())
    }

    /// Returns the links in the order of their bins without these offsets of radios; `None` = as they were measured.
    pub(super) fn links_without(&self, offsets: Option<&DeviceOffsets>) -> Vec<Link> {
        let alike = DeviceOffsets::default();
        let offsets = offsets.unwrap_or(&alike);
        self.bins.values().map(|bin| bin.link(offsets)).collect()
    }
}

impl Bin {
    /// Returns the sums of a pair of radios.
    fn heard(&mut self, devices: Option<Devices>) -> &mut Heard {
        let index = match self
            .heard
            .binary_search_by_key(&devices, |heard| heard.devices)
        {
            Ok(index) => index,
            Err(index) => {
                self.heard.insert(index, Heard::nothing(devices));
                index
            }
        };
        &mut self.heard[index]
    }

    fn add_link(
        &mut self,
        devices: Option<Devices>,
        (from, to): (Point, Point),
        link: &Link,
        spot: u16,
    ) {
        let (records, packets) = (
            link.packets.saturating_add(link.misses),
            f64::from(link.packets),
        );
        self.records = self.records.saturating_add(records);
        self.from_sum.add(from, records);
        self.to_sum.add(to, records);
        self.missed_power_sum_dbm += f64::from(link.misses) * link.missed_power_dbm;
        if link.packets == 0 {
            return;
        }
        let heard = self.heard(devices);
        heard.packets = heard.packets.saturating_add(link.packets);
        heard.sum_dbm += packets * link.mean_dbm;
        heard.square_sum += packets * link.mean_dbm * link.mean_dbm
            + (packets - 1.0) * link.spread_db * link.spread_db;
        if self.spots.len() < MOST_SPOTS && !self.spots.contains(&spot) {
            self.spots.push(spot);
            self.further_spots = self
                .further_spots
                .saturating_add(link.spots.saturating_sub(1));
        }
    }

    fn link(&self, offsets: &DeviceOffsets) -> Link {
        let (mut count, mut sum_dbm, mut square_sum) = (0_u32, 0.0, 0.0);
        for heard in &self.heard {
            let heard = heard.weaker(offsets.of(heard.devices));
            count = count.saturating_add(heard.packets);
            sum_dbm += heard.sum_dbm;
            square_sum += heard.square_sum;
        }
        let (packets, misses) = (f64::from(count), self.records.saturating_sub(count));
        let mean_dbm = sum_dbm / packets;
        let variance = (square_sum / packets - mean_dbm * mean_dbm).max(0.0);
        let unbiased = if count > 1 {
            variance * packets / (packets - 1.0)
        } else {
            0.0
        };
        Link {
            from: self.from_sum.mean(self.records),
            to: self.to_sum.mean(self.records),
            packets: count,
            spots: (self.spots.len() as u32)
                .saturating_add(self.further_spots)
                .clamp(1, MOST_SPOTS as u32),
            misses,
            mean_dbm,
            spread_db: unbiased.sqrt(),
            missed_power_dbm: self.missed_power_sum_dbm / f64::from(misses.max(1)),
        }
    }
}

/// Names the spots of both ends within their bins, 4 bits an axis.
fn spot_code(from: Point, to: Point, bin_m: f64, spot_m: f64) -> u16 {
    let within = |metres: f64| {
        let edge_m = bin_m * (libm::round(metres / bin_m) - 0.5);
        ((metres - edge_m) / spot_m).clamp(0.0, 15.0) as u16
    };
    (within(from.x_m) << 12) | (within(from.y_m) << 8) | (within(to.x_m) << 4) | within(to.y_m)
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{PoseReport, Position};

    use super::*;
    use crate::tomo::floor_dbm;

    const DEVICES: Devices = Devices {
        transmitter: VehicleId(1),
        receiver: VehicleId(2),
    };

    #[test]
    fn both_directions_fall_into_one_bin() {
        let mut bins = LinkBins::default();
        let (a, b) = (Point::new(-0.1, 0.2), Point::new(10.1, 5.2));
        bins.record(DEVICES, a, b, Some(-50));
        bins.record(DEVICES, b, a, Some(-54));
        bins.record(DEVICES, Point::new(0.1, 0.2), b, Some(-52));
        bins.record(DEVICES, a, b, None);
        let links = bins.links();
        assert_eq!(links.len(), 1);
        let link = links[0];
        assert_eq!(
            (link.packets, link.misses, link.spots, link.mean_dbm),
            (3, 1, 2, -52.0)
        );
        assert!((link.spread_db - 2.0).abs() < 1e-9);
        assert!(link.from.distance_to(Point::new(-0.05, 0.2)) < 1e-9);
        assert!(link.to.distance_to(b) < 1e-9);
    }

    /// A run of two vehicles of which one drives along the south side, heard by the other from 6 m on.
    fn run_of(power_dbm: i8) -> LinkBins {
        let pose = |x_m, y_m| PoseReport {
            at: Position::from_metres(x_m, y_m, 0.0),
            ..PoseReport::default()
        };
        let mut bins = LinkBins::default();
        for sequence in 0..120_u64 {
            let x_m = 0.1 * sequence as f64;
            let sample = Sample {
                sequence,
                heard_at_ns: 0,
                transmitter: VehicleId(1),
                transmitter_pose: pose(x_m, 0.2),
                receiver_pose: pose(6.2, 12.2),
                channel: 11,
                power_dbm,
                rssi_dbm: (x_m > 6.0).then_some(-60 - sequence as i16 + i16::from(power_dbm)),
            };
            bins.record_sample(VehicleId(2), &sample);
        }
        bins
    }

    #[test]
    fn a_run_with_another_power_shows_the_same_strengths() {
        let empty = run_of(0).links();
        assert!(
            empty
                .iter()
                .any(|link| link.packets == 0 && link.misses > 2)
        );
        for power_dbm in [-10, 8] {
            let now = run_of(power_dbm).links();
            assert_eq!(now.len(), empty.len());
            for (now, empty) in now.iter().zip(&empty) {
                assert!(
                    now.packets == 0 || now.mean_dbm == empty.mean_dbm,
                    "{now:?}"
                );
                assert_eq!((now.packets, now.misses), (empty.packets, empty.misses));
                // What was heard neither before nor now has not changed.
                let floor_dbm = floor_dbm([now, empty].into_iter(), -95.0);
                let [was, is] = [empty, now].map(|link| link.censored(floor_dbm, 2.5));
                assert_eq!(was, is, "{now:?}");
            }
        }
    }

    #[test]
    fn places_half_a_metre_apart_are_told_apart() {
        let mut bins = LinkBins::default();
        let far = Point::new(10.0, 0.0);
        bins.record(DEVICES, Point::new(0.2, 0.0), far, Some(-50));
        bins.record(DEVICES, Point::new(0.3, 0.0), far, Some(-50));
        bins.record(DEVICES, Point::new(f64::NAN, 0.0), far, Some(-50));
        assert_eq!(bins.len(), 2);
    }

    #[test]
    fn who_drives_along_a_whole_metre_a_little_to_both_sides_fills_one_row_of_bins() {
        let mut bins = LinkBins::default();
        let off_m = |step: i32| 0.05 * f64::from(step % 5 - 2);
        for step in 0..40 {
            let (from, to) = (
                Point::new(off_m(step), 6.0),
                Point::new(20.0, off_m(step + 2)),
            );
            bins.record(DEVICES, from, to, Some(-60));
        }
        assert_eq!(bins.len(), 1);
    }

    #[test]
    fn driving_half_a_metre_gives_eight_spots() {
        let mut bins = LinkBins::default();
        for step in 0..50 {
            bins.record(
                DEVICES,
                Point::new(-0.245 + 0.01 * f64::from(step), 0.0),
                Point::new(9.0, 9.0),
                Some(-60),
            );
        }
        assert_eq!(bins.links()[0].spots, 8);
    }

    #[test]
    fn the_order_of_packets_does_not_matter() {
        let place = |k: i32| Point::new(f64::from(k * 7 % 20), f64::from(k * 3 % 20));
        let (mut one, mut two) = (LinkBins::default(), LinkBins::default());
        for k in 0..40 {
            one.record(DEVICES, place(k), place(k + 5), Some(-50 - k as i16));
            let k = 39 - k;
            two.record(DEVICES, place(k + 5), place(k), Some(-50 - k as i16));
        }
        assert_eq!(one.links(), two.links());
    }

    /// Bins that all pairs of some radios have measured in both directions, at a level that goes up and down, each radio with
    /// its offset as a sender.
    fn bins_of(sent_db: &[(u8, i16)]) -> LinkBins {
        let mut bins = LinkBins::default();
        for step in 0..60_i16 {
            let (a, b) = (Point::new(f64::from(step), 0.2), Point::new(0.2, 30.2));
            for (from, offset_db) in sent_db {
                for (to, _) in sent_db.iter().filter(|(to, _)| to != from) {
                    let devices = Devices {
                        transmitter: VehicleId(*from),
                        receiver: VehicleId(*to),
                    };
                    let rssi_dbm = -60 - step % 7 + offset_db;
                    bins.record(devices, a, b, Some(rssi_dbm));
                    bins.record(devices, b, a, Some(rssi_dbm));
                }
            }
        }
        bins
    }

    /// The mean difference of two lists of links, dB.
    fn mean_change_db(now: &[Link], empty: &[Link]) -> f64 {
        assert_eq!(now.len(), empty.len());
        let changes = now.iter().zip(empty);
        changes
            .map(|(now, empty)| now.mean_dbm - empty.mean_dbm)
            .sum::<f64>()
            / now.len() as f64
    }

    #[test]
    fn two_fleets_are_compared_by_the_radios_of_both() {
        let (empty, now) = (
            bins_of(&[(1, -4), (2, -4), (3, 3), (4, 3)]),
            bins_of(&[(3, 3), (4, 3)]),
        );
        let (now_links, empty_links, found) = now.links_against(&empty);
        assert!(found.is_some());
        assert!(mean_change_db(&now_links, &empty_links).abs() < 0.1);
        let alone_db = mean_change_db(&now.links(), &empty.links());
        let measured_db = mean_change_db(&now.measured_links(), &empty.measured_links());
        assert!(
            alone_db > 3.0 && measured_db > 3.0,
            "{alone_db} {measured_db}"
        );
    }

    #[test]
    fn who_is_compared_with_links_of_nobody_is_taken_as_it_was_measured() {
        let now = bins_of(&[(1, -4), (2, 0), (3, 3)]);
        let mut empty = LinkBins::default();
        for link in now.measured_links() {
            empty.record_link(None, &link);
        }
        let (now_links, empty_links, found) = now.links_against(&empty);
        assert_eq!((found, now_links), (None, now.measured_links()));
        assert!(mean_change_db(&now.measured_links(), &empty_links).abs() < 1e-9);
        assert_ne!(now.links(), now.measured_links());
    }

    #[test]
    fn a_moved_key_is_the_key_of_the_moved_places() {
        let (a, b) = (Point::new(3.2, 0.1), Point::new(0.3, 7.7));
        let (key, exchanged) = BinKey::of(a, b, 0.5);
        assert!(!exchanged);
        let moved = key.moved((-1, 0), (0, 1));
        assert_eq!(
            moved,
            BinKey::of(Point::new(2.7, 0.1), Point::new(0.3, 8.2), 0.5).0
        );
    }
}
