//! Who hears whom by radio, as the samples say that vehicles send to the ground station: of every pair the last strength, the
//! share of beacons missed in the last seconds, and how much weaker it is than the path loss of all pairs together.
//!
//! It fits its own path loss to the last samples of all; the images' own one is not said on the bus.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use tomoswarm_proto::{Boot, RunId, Sample, Samples, VehicleId};

use crate::geom::Point;
use crate::time::Time;
use crate::tomo::{ExponentPrior, Link, PathLoss};

/// Beacons are counted as missed over this time before the last one, by the receiver's clock.
pub const WINDOW: Duration = Duration::from_secs(5);
/// Samples of one pair kept at most.
const PAIR_SAMPLES: usize = 200;
/// Samples that the path loss is fitted to.
const FITTED: usize = 500;
/// Between two fits.
const FIT_EVERY: Duration = Duration::from_secs(2);

/// A receiver and a transmitter.
pub type Pair = (VehicleId, VehicleId);

/// What is known of one pair.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PairView {
    /// Last strength, dBm; `None` = never heard.
    pub rssi_dbm: Option<i16>,
    /// Share of beacons missed in the last [`WINDOW`], 0 to 1.
    pub loss: f64,
    /// How much weaker the last strength was than expected at its distance, dB; `None` = not known.
    pub excess_db: Option<f64>,
    /// How far they were apart, metres.
    pub distance_m: f64,
    /// When its last sample came.
    pub at: Time,
}

/// The newest samples of a pair.
#[derive(Clone, Debug, Default)]
struct PairSamples {
    /// When, by the receiver's clock, and whether it was heard; ascending.
    recent: VecDeque<(u64, bool)>,
    /// The last one heard: strength and gain, dBm and dB, and how far they were apart, metres.
    last: Option<(i16, f64, f64)>,
    distance_m: f64,
    at: Time,
}

/// Which samples are new: the newest one of each vehicle, by start, run and number; what is said again is not counted again,
/// also of an earlier start or run.
#[derive(Clone, Debug, Default)]
pub struct NewSamples {
    highest: BTreeMap<VehicleId, (Boot, RunId, u64)>,
}

impl NewSamples {
    /// Takes a sample of a batch; returns whether it is new.
    pub fn take(&mut self, batch: &Samples, sequence: u64) -> bool {
        let source = (batch.boot, batch.run, sequence);
        let known = self.highest.get(&batch.vehicle);
        let is_known = known.is_some_and(|highest| source <= *highest);
        if !is_known {
            self.highest.insert(batch.vehicle, source);
        }
        !is_known
    }
}

/// Who hears whom.
#[derive(Clone, Debug, Default)]
pub struct RadioView {
    pairs: BTreeMap<Pair, PairSamples>,
    new: NewSamples,
    fitted: VecDeque<Link>,
    law: Option<PathLoss>,
    fitted_at: Time,
}

impl RadioView {
    /// Takes samples; returns the pairs that they are of.
    pub fn hear(&mut self, now: Time, batch: &Samples) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for sample in &batch.samples {
            if self.new.take(batch, sample.sequence) {
                let pair = (batch.vehicle, sample.transmitter);
                self.take(now, pair, sample);
                pairs.push(pair);
            }
        }
        if now.since(self.fitted_at) >= FIT_EVERY || self.law.is_none() {
            self.fitted_at = now;
            let links = self.fitted.make_contiguous();
            self.law = PathLoss::fit(links, ExponentPrior::NEAR_FREE_SPACE);
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// Returns which samples would be new.
    pub fn new_samples(&self) -> &NewSamples {
        &self.new
    }

    /// Returns all pairs that a sample came of, ascending.
    pub fn pairs(&self) -> impl Iterator<Item = Pair> + '_ {
        self.pairs.keys().copied()
    }

    /// Returns what is known of a pair.
    pub fn pair(&self, pair: Pair) -> Option<PairView> {
        let known = self.pairs.get(&pair)?;
        let missed = known.recent.iter().filter(|(_, heard)| !heard).count();
        let excess_db = |(_, gain_db, distance_m): (i16, f64, f64)| {
            let law = self.law.filter(|_| distance_m > 0.0)?;
            Some(law.strength_dbm(distance_m) - gain_db)
        };
        Some(PairView {
            rssi_dbm: known.last.map(|(rssi_dbm, _, _)| rssi_dbm),
            loss: missed as f64 / known.recent.len().max(1) as f64,
            excess_db: known.last.and_then(excess_db),
            distance_m: known.distance_m,
            at: known.at,
        })
    }

    fn take(&mut self, now: Time, pair: Pair, sample: &Sample) {
        let place = |at: tomoswarm_proto::Position| Point::new(at.x_m(), at.y_m());
        let (from, to) = (
            place(sample.transmitter_pose.at),
            place(sample.receiver_pose.at),
        );
        let known = self.pairs.entry(pair).or_default();
        known.distance_m = from.distance_to(to);
        known.at = now;
        if known
            .recent
            .back()
            .is_some_and(|(last, _)| sample.heard_at_ns < *last)
        {
            // Its clock began anew.
            known.recent.clear();
        }
        known
            .recent
            .push_back((sample.heard_at_ns, sample.rssi_dbm.is_some()));
        let from_ns = sample.heard_at_ns.saturating_sub(WINDOW.as_nanos() as u64);
        while known.recent.len() > PAIR_SAMPLES
            || known.recent.front().is_some_and(|(at, _)| *at < from_ns)
        {
            known.recent.pop_front();
        }
        let Some(rssi_dbm) = sample.rssi_dbm else {
            return;
        };
        let gain_db = f64::from(rssi_dbm) - f64::from(sample.power_dbm);
        known.last = Some((rssi_dbm, gain_db, known.distance_m));
        self.fitted.push_back(Link::fixed(from, to, 1, gain_db));
        if self.fitted.len() > FITTED {
            self.fitted.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::tests_support::at;
    use tomoswarm_proto::{PoseReport, Position};

    fn sample(
        sequence: u64,
        at_s: f64,
        transmitter: u8,
        distance_m: f64,
        rssi_dbm: Option<i16>,
    ) -> Sample {
        let pose = |x_m| PoseReport {
            at: Position::from_metres(x_m, 0.0, 0.0),
            ..PoseReport::default()
        };
        Sample {
            sequence,
            heard_at_ns: (at_s * 1e9) as u64,
            transmitter: VehicleId(transmitter),
            transmitter_pose: pose(distance_m),
            receiver_pose: pose(0.0),
            channel: 20,
            power_dbm: 0,
            rssi_dbm,
        }
    }

    fn batch(samples: Vec<Sample>) -> Samples {
        Samples {
            vehicle: VehicleId(1),
            boot: Boot(1),
            run: RunId(1),
            samples,
            lost: Vec::new(),
        }
    }

    const PAIR: Pair = (VehicleId(1), VehicleId(2));

    #[test]
    fn what_was_missed_in_five_seconds_counts_and_what_is_said_again_does_not() {
        let mut radio = RadioView::default();
        let old = sample(1, 1.0, 2, 4.0, None);
        let heard = sample(2, 7.0, 2, 4.0, Some(-60));
        let missed = sample(3, 8.0, 2, 4.0, None);
        assert_eq!(radio.hear(at(9.0), &batch(vec![old, heard])), [PAIR]);
        assert_eq!(radio.hear(at(9.0), &batch(vec![heard, missed])), [PAIR]);
        assert_eq!(radio.hear(at(10.0), &batch(vec![heard, missed])), []);
        let known = radio.pair(PAIR).unwrap();
        assert_eq!(
            (known.rssi_dbm, known.loss, known.at),
            (Some(-60), 0.5, at(9.0))
        );
        assert!(
            radio.pair((VehicleId(2), VehicleId(1))).is_none(),
            "a pair has a direction"
        );
    }

    #[test]
    fn what_is_said_again_of_an_earlier_start_or_run_is_not_news() {
        let mut radio = RadioView::default();
        let of = |boot, run, sequence, rssi_dbm| Samples {
            boot: Boot(boot),
            run: RunId(run),
            ..batch(vec![sample(sequence, 7.0, 2, 4.0, Some(rssi_dbm))])
        };
        assert_eq!(radio.hear(at(1.0), &of(1, 1, 900, -70)), [PAIR]);
        assert_eq!(radio.hear(at(2.0), &of(1, 2, 0, -60)), [PAIR]);
        assert_eq!(radio.hear(at(3.0), &of(2, 2, 0, -50)), [PAIR]);
        for old in [of(1, 1, 900, -70), of(1, 1, 901, -70), of(1, 2, 1, -60)] {
            assert_eq!(radio.hear(at(4.0), &old), []);
        }
        let known = radio.pair(PAIR).unwrap();
        assert_eq!((known.rssi_dbm, known.at), (Some(-50), at(3.0)));
    }

    #[test]
    fn a_link_through_something_is_weaker_than_the_path_loss_of_the_others() {
        let mut radio = RadioView::default();
        let strength = |distance_m: f64| Some((-40.0 - 20.0 * distance_m.log10()).round() as i16);
        let free = (1..=60_u32).map(|n| {
            let distance_m = 1.0 + f64::from(n % 12);
            sample(n.into(), f64::from(n), 3, distance_m, strength(distance_m))
        });
        let mut all: Vec<Sample> = free.collect();
        all.push(sample(61, 61.0, 2, 5.0, strength(5.0).map(|dbm| dbm - 15)));
        radio.hear(at(1.0), &batch(all));
        let excess_db = |transmitter| {
            let pair = radio.pair((VehicleId(1), VehicleId(transmitter)));
            pair.unwrap().excess_db.unwrap()
        };
        assert!((excess_db(2) - 15.0).abs() < 1.5, "{}", excess_db(2));
        assert!(excess_db(3).abs() < 1.5, "{}", excess_db(3));
    }

    #[test]
    fn few_samples_and_vehicles_in_one_place_have_no_excess() {
        let mut radio = RadioView::default();
        radio.hear(at(1.0), &batch(vec![sample(1, 1.0, 2, 0.0, Some(-30))]));
        assert_eq!(radio.pair(PAIR).unwrap().excess_db, None);
        let far = (2..9).map(|n| sample(n, 1.0, 3, 4.0, Some(-50))).collect();
        radio.hear(at(4.0), &batch(far));
        assert_eq!(radio.pair(PAIR).unwrap().excess_db, None, "no distance");
    }

    #[test]
    fn what_is_kept_of_a_pair_is_bounded() {
        let mut radio = RadioView::default();
        let many = (1..5000)
            .map(|n| sample(n, 1.0, 2, 4.0, Some(-50)))
            .collect();
        radio.hear(at(1.0), &batch(many));
        assert_eq!(radio.pairs[&PAIR].recent.len(), PAIR_SAMPLES);
        assert_eq!(radio.fitted.len(), FITTED);
    }
}
