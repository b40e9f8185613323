//! The battery: its charge, and how far it has sunk. What uses it, and what an autopilot does when it is low, is not known
//! here.
//!
//! ```text
//!   [Enough] ──► [Low] ──► [Empty]      as the charge sinks, one step after the other
//!       ▲          ▲          │
//!       └──────────┴──────────┘         by a charge that is given by hand
//! ```

use std::time::Duration;

use super::messages::AutopilotSettings;
use crate::time::Time;

/// A battery.
#[derive(Clone, Debug)]
pub(super) struct Battery {
    charge: f64,
    level: ChargeLevel,
}

/// How far a battery has sunk, as far as its autopilot has noticed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum ChargeLevel {
    Enough,
    Low,
    Empty,
}

impl Battery {
    /// Makes one that is full.
    pub(super) fn full() -> Battery {
        Battery {
            charge: 1.0,
            level: ChargeLevel::Enough,
        }
    }

    /// Returns the charge left, 0 to 1.
    pub(super) fn charge(&self) -> f64 {
        self.charge
    }

    /// Returns how far it has sunk.
    pub(super) fn level(&self) -> ChargeLevel {
        self.level
    }

    /// Gives it a charge, 0 to 1. That it sinks by this is noticed later ([`Battery::sinks_at`]).
    pub(super) fn set(&mut self, charge: f64, settings: &AutopilotSettings) {
        self.charge = charge.clamp(0.0, 1.0);
        self.level = match self.level {
            ChargeLevel::Low | ChargeLevel::Empty if self.charge > settings.low_battery => {
                ChargeLevel::Enough
            }
            ChargeLevel::Empty if self.charge > 0.0 => ChargeLevel::Low,
            ChargeLevel::Enough | ChargeLevel::Low | ChargeLevel::Empty => self.level,
        };
    }

    /// Uses what a time takes in which the vehicle moves for this long, and then rests.
    pub(super) fn spend(&mut self, moves: Duration, whole: Duration, settings: &AutopilotSettings) {
        let (moves_s, all_s) = (moves.as_secs_f64(), whole.as_secs_f64());
        let used = moves_s / settings.endurance_driving.as_secs_f64()
            + (all_s - moves_s).max(0.0) / settings.endurance_resting.as_secs_f64();
        self.charge = (self.charge - used).max(0.0);
    }

    /// Returns when it will have sunk to the next level, if the vehicle moves for this long from now on and then rests;
    /// `None` = it is empty, or that never comes.
    pub(super) fn sinks_at(
        &self,
        now: Time,
        moves: Duration,
        settings: &AutopilotSettings,
    ) -> Option<Time> {
        let level = match self.level {
            ChargeLevel::Enough => settings.low_battery,
            ChargeLevel::Low => 0.0,
            ChargeLevel::Empty => return None,
        };
        let spare = self.charge - level;
        if spare < 0.0 || (spare == 0.0 && level > 0.0) {
            // Given by hand, or there already.
            return Some(now);
        }
        let moving_s = settings.endurance_driving.as_secs_f64() * spare;
        let moves_s = moves.as_secs_f64();
        let wait_s = if moving_s <= moves_s {
            moving_s
        } else {
            let left = spare - moves_s / settings.endurance_driving.as_secs_f64();
            moves_s + left * settings.endurance_resting.as_secs_f64()
        };
        (wait_s < 1e9).then(|| now + Duration::from_nanos(libm::ceil(wait_s * 1e9) as u64))
    }

    /// Sinks to the next level, and returns it.
    pub(super) fn sink(&mut self) -> ChargeLevel {
        self.level = match self.level {
            ChargeLevel::Enough => ChargeLevel::Low,
            ChargeLevel::Low | ChargeLevel::Empty => ChargeLevel::Empty,
        };
        self.level
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::tests::LIMITS;
    use super::*;
    use crate::actor::tests_support::drawn;
    use crate::autopilot::VehicleKind;

    fn settings() -> AutopilotSettings {
        AutopilotSettings {
            endurance_driving: Duration::from_secs(100),
            endurance_resting: Duration::from_secs(1000),
            low_battery: 0.25,
            ..AutopilotSettings::new(VehicleKind::Rover, LIMITS)
        }
    }

    fn word(level: ChargeLevel) -> &'static str {
        match level {
            ChargeLevel::Enough => "Enough",
            ChargeLevel::Low => "Low",
            ChargeLevel::Empty => "Empty",
        }
    }

    #[test]
    fn the_drawing_has_the_levels_that_there_are() {
        let levels = [ChargeLevel::Enough, ChargeLevel::Low, ChargeLevel::Empty];
        let words: BTreeSet<String> = levels.map(|level| word(level).to_owned()).into();
        assert_eq!(drawn(include_str!("battery.rs")), words);
    }

    #[test]
    fn it_lasts_as_long_as_moving_and_resting_let_it() {
        let (mut battery, settings) = (Battery::full(), settings());
        let secs = Duration::from_secs;
        battery.spend(secs(10), secs(110), &settings);
        assert!((battery.charge() - 0.8).abs() < 1e-12);
        let sinks_s = |moves_s: u64| {
            let at = battery.sinks_at(Time::from_secs_f64(5.0), secs(moves_s), &settings);
            at.map(|at| at.as_secs_f64()).unwrap()
        };
        assert!((sinks_s(1000) - 60.0).abs() < 1e-6, "{}", sinks_s(1000));
        assert!((sinks_s(0) - 555.0).abs() < 1e-6, "{}", sinks_s(0));
        assert!(
            (sinks_s(25) - (5.0 + 25.0 + 300.0)).abs() < 1e-6,
            "{}",
            sinks_s(25)
        );
    }

    #[test]
    fn it_sinks_step_by_step_and_no_further_than_empty() {
        let (mut battery, settings, now) = (Battery::full(), settings(), Time::from_secs_f64(7.0));
        battery.set(-1.0, &settings);
        for level in [ChargeLevel::Low, ChargeLevel::Empty] {
            assert_eq!(battery.sinks_at(now, Duration::ZERO, &settings), Some(now));
            assert_eq!(battery.sink(), level);
        }
        assert_eq!(battery.sinks_at(now, Duration::ZERO, &settings), None);
        assert_eq!(
            (battery.sink(), battery.charge()),
            (ChargeLevel::Empty, 0.0)
        );
    }

    #[test]
    fn a_charge_by_hand_lifts_it_as_far_as_it_goes() {
        let settings = settings();
        for (charge, level) in [
            (0.0, ChargeLevel::Empty),
            (0.25, ChargeLevel::Low),
            (0.26, ChargeLevel::Enough),
        ] {
            let mut battery = Battery::full();
            (0..2).for_each(|_| _ = battery.sink());
            battery.set(charge, &settings);
            assert_eq!(battery.level(), level, "{charge}");
        }
        let mut battery = Battery::full();
        battery.set(0.1, &settings);
        assert_eq!(
            battery.level(),
            ChargeLevel::Enough,
            "that is noticed later"
        );
    }
}
