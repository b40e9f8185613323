//! How the vehicles' clocks stand to UTC, estimated from samples that come fresh from the air. Pure: it is told both the
//! clocks of its own machine.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm_proto::{Boot, Samples, VehicleId};

use crate::store::ground::UtcOffset;

/// An estimate counts as better by this much, seconds.
const BETTER_S: f64 = 0.05;
/// Deviation of an estimate: how long a sample may be on its way, seconds.
const ERROR_S: f64 = 0.5;
/// When UTC steps by more than this against the time that has passed, all estimates begin anew, seconds.
const STEP_S: f64 = 1.0;

/// Estimates of the newest start of each vehicle.
#[derive(Debug, Default)]
pub(super) struct Clocks {
    /// UTC when this machine's steady clock showed zero, seconds.
    own_s: Option<f64>,
    known: BTreeMap<VehicleId, Known>,
}

#[derive(Debug)]
struct Known {
    boot: Boot,
    /// The vehicle's time of its newest sample, nanoseconds.
    newest_ns: Option<u64>,
    /// UTC when the vehicle's clock showed zero, seconds; the least seen, which was on its way for the shortest.
    offset_s: Option<f64>,
}

impl Clocks {
    /// Records that a vehicle's software was started; older starts give no estimate from now on.
    pub(super) fn hear(&mut self, vehicle: VehicleId, boot: Boot) {
        let known = self.known.entry(vehicle).or_insert(Known {
            boot,
            newest_ns: None,
            offset_s: None,
        });
        if known.boot < boot {
            *known = Known {
                boot,
                newest_ns: None,
                offset_s: None,
            };
        }
    }

    /// Takes a batch that came when the steady clock showed `steady` and it was `utc_s`; returns a better estimate of its
    /// sender's clock, if it is one. Samples that are told again, or of an older start, give none.
    pub(super) fn take(
        &mut self,
        steady: Duration,
        utc_s: f64,
        batch: &Samples,
    ) -> Option<UtcOffset> {
        self.look_for_step(utc_s - steady.as_secs_f64());
        let newest_ns = batch
            .samples
            .iter()
            .map(|sample| sample.heard_at_ns)
            .max()?;
        self.hear(batch.vehicle, batch.boot);
        let known = self
            .known
            .get_mut(&batch.vehicle)
            .filter(|known| known.boot == batch.boot)?;
        if known.newest_ns.is_some_and(|before| newest_ns <= before) {
            return None;
        }
        known.newest_ns = Some(newest_ns);
        let offset_s = utc_s - newest_ns as f64 * 1e-9;
        if known
            .offset_s
            .is_some_and(|before| before < offset_s + BETTER_S)
        {
            return None;
        }
        known.offset_s = Some(offset_s);
        Some(UtcOffset {
            offset_s,
            error_s: ERROR_S,
        })
    }

    fn look_for_step(&mut self, own_s: f64) {
        if self
            .own_s
            .is_some_and(|before| (own_s - before).abs() > STEP_S)
        {
            self.known
                .values_mut()
                .for_each(|known| known.offset_s = None);
            self.own_s = None;
        }
        self.own_s.get_or_insert(own_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{RunId, Sample};

    /// A batch whose newest sample was heard when the vehicle's clock showed `heard_s`.
    fn batch(boot: u32, heard_s: u64) -> Samples {
        let sample = Sample {
            sequence: 0,
            heard_at_ns: heard_s * 1_000_000_000,
            transmitter: VehicleId(2),
            transmitter_pose: Default::default(),
            receiver_pose: Default::default(),
            channel: 11,
            power_dbm: 0,
            rssi_dbm: None,
        };
        Samples {
            vehicle: VehicleId(1),
            boot: Boot(boot),
            run: RunId(1),
            samples: vec![sample],
            lost: vec![],
        }
    }

    fn offset_s(clocks: &mut Clocks, steady_s: u64, utc_s: f64, batch: &Samples) -> Option<f64> {
        clocks
            .take(Duration::from_secs(steady_s), utc_s, batch)
            .map(|clock| clock.offset_s)
    }

    #[test]
    fn the_least_offset_counts_and_samples_told_again_say_nothing() {
        let mut clocks = Clocks::default();
        assert_eq!(
            offset_s(&mut clocks, 10, 1010.0, &batch(3, 5)),
            Some(1005.0)
        );
        assert_eq!(
            offset_s(&mut clocks, 11, 1011.0, &batch(3, 8)),
            Some(1003.0),
            "it came quicker"
        );
        assert_eq!(
            offset_s(&mut clocks, 12, 1012.0, &batch(3, 9)),
            None,
            "worse"
        );
        assert_eq!(
            offset_s(&mut clocks, 13, 1013.0, &batch(3, 9)),
            None,
            "told again"
        );
        assert_eq!(
            offset_s(&mut clocks, 13, 1013.0, &batch(2, 999)),
            None,
            "an older start"
        );
        clocks.hear(VehicleId(1), Boot(4));
        assert_eq!(
            offset_s(&mut clocks, 14, 1014.0, &batch(3, 13)),
            None,
            "an older start by now"
        );
        assert_eq!(
            offset_s(&mut clocks, 15, 1015.0, &batch(4, 1)),
            Some(1014.0)
        );
    }

    #[test]
    fn when_the_system_clock_steps_estimates_begin_anew() {
        let mut clocks = Clocks::default();
        assert_eq!(
            offset_s(&mut clocks, 10, 1010.0, &batch(3, 5)),
            Some(1005.0)
        );
        assert_eq!(
            offset_s(&mut clocks, 11, 1_000_011.0, &batch(3, 6)),
            Some(1_000_005.0)
        );
        assert_eq!(
            offset_s(&mut clocks, 12, 1_000_012.0, &batch(3, 7)),
            None,
            "no better"
        );
        assert_eq!(
            offset_s(&mut clocks, 13, 1013.0, &batch(3, 8)),
            Some(1005.0)
        );
    }
}
