//! What an autopilot says of its battery (SYS_STATUS), the newest of it. It judges no charge.

use std::time::Duration;

use crate::mavlink::dialect::SYS_STATUS_DATA;
use crate::time::Time;

/// What it has said is believed for this long: it is asked to say it twice a second, and a slow line makes that four times as
/// slow while parameters or missions go over it.
const LASTS: Duration = Duration::from_secs(10);

/// The newest of it.
#[derive(Clone, Debug, Default)]
pub(super) struct HeardBattery {
    measured: Option<(Time, SYS_STATUS_DATA)>,
    /// The charge that it has named last, 0 to 1; an autopilot without a monitor never does.
    charge: Option<(Time, f64)>,
}

impl HeardBattery {
    /// Takes what is newer.
    pub(super) fn take(&mut self, now: Time, said: &SYS_STATUS_DATA) {
        if said.battery_remaining >= 0 {
            let charge = f64::from(said.battery_remaining) / 100.0;
            self.charge = Some((now, charge.min(1.0)));
        }
        self.measured = Some((now, said.clone()));
    }

    /// Returns what it has measured lately.
    pub(super) fn measured(&self, now: Time) -> Option<&SYS_STATUS_DATA> {
        let (at, said) = self.measured.as_ref()?;
        (now.since(*at) <= LASTS).then_some(said)
    }

    /// Returns the charge left, 0 to 1; `None` when it has ceased to say it. One without a monitor is not taken for empty.
    pub(super) fn charge(&self, now: Time) -> Option<f64> {
        let Some((at, charge)) = self.charge else {
            return Some(1.0);
        };
        (now.since(at) <= LASTS).then_some(charge)
    }

    /// Returns the charge that it has named last, if it has ceased to.
    pub(super) fn ceased_at(&self, now: Time) -> Option<f64> {
        let (at, charge) = self.charge?;
        (now.since(at) > LASTS).then_some(charge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    fn said(percent: i8) -> SYS_STATUS_DATA {
        SYS_STATUS_DATA {
            battery_remaining: percent,
            voltage_battery: 12_000,
            ..SYS_STATUS_DATA::default()
        }
    }

    #[test]
    fn a_charge_that_is_not_said_any_more_is_not_known_whether_the_rest_is_said_or_not() {
        for goes_on in [true, false] {
            let mut battery = HeardBattery::default();
            for half in 0..10 {
                battery.take(at(0.5 * f64::from(half)), &said(34));
            }
            assert_eq!(
                (battery.charge(at(14.5)), battery.ceased_at(at(14.5))),
                (Some(0.34), None)
            );
            if goes_on {
                battery.take(at(14.5), &said(-1));
            }
            assert_eq!(
                (battery.charge(at(14.6)), battery.ceased_at(at(14.6))),
                (None, Some(0.34))
            );
            assert_eq!(battery.measured(at(14.6)).is_some(), goes_on);
            battery.take(at(15.0), &said(33));
            assert_eq!(
                (battery.charge(at(15.0)), battery.ceased_at(at(15.0))),
                (Some(0.33), None)
            );
        }
    }

    #[test]
    fn one_without_a_monitor_is_not_empty_and_nothing_is_wrong_with_it() {
        let mut battery = HeardBattery::default();
        assert_eq!(
            (battery.charge(at(99.0)), battery.ceased_at(at(99.0))),
            (Some(1.0), None)
        );
        battery.take(at(1.0), &said(-1));
        assert_eq!(
            (battery.charge(at(99.0)), battery.ceased_at(at(99.0))),
            (Some(1.0), None)
        );
    }
}
