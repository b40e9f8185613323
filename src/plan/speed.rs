//! How fast a vehicle may drive so that its last look still leaves room to stop. Formula: a vehicle at speed v
//! first drives on for the time t (until the next look is taken, handled and obeyed), then brakes at a:
//! v·t + v²/2a ≤ range − margin.

use thiserror::Error;

/// What a vehicle sees, how often, and how it stops.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SensingLimits {
    /// Up to here free space is known for sure, metres: the sensor's sure range, not its maximum.
    pub range_m: f64,
    /// What must be left between the vehicle and the end of what is known, metres, measured like the range.
    pub margin_m: f64,
    /// Time for a full cycle of looks, seconds: every direction that matters has been looked at once.
    pub scan_period_s: f64,
    /// Time from a look to the first effect of the brakes, seconds.
    pub latency_s: f64,
    /// Braking, m/s², positive.
    pub braking_mps2: f64,
}

/// Why a vehicle with this sight cannot be driven as wanted.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum SpeedError {
    /// A value is negative or not finite.
    #[error("{name} must be a {allowed} number, not {found}")]
    Value {
        /// Which field.
        name: &'static str,
        /// What was given.
        found: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// The margin leaves nothing of the range.
    #[error(
        "a sure range of {range_m} m leaves nothing to drive in beyond a margin of {margin_m:.2} m"
    )]
    NoRoom {
        /// Sure range, metres.
        range_m: f64,
        /// Margin, metres.
        margin_m: f64,
    },
    /// The wanted speed cannot be stopped in time.
    #[error(
        "{wanted_mps} m/s needs {needed_m:.2} m to stop, but only {room_m:.2} m are surely seen ahead: it would \
         outrun its looks above {:.3} m/s",
        (highest_mps * 1000.0).floor() / 1000.0
    )]
    TooFast {
        /// Wanted speed, m/s.
        wanted_mps: f64,
        /// Distance it needs, metres.
        needed_m: f64,
        /// Distance there is, metres.
        room_m: f64,
        /// Highest speed that fits, m/s.
        highest_mps: f64,
    },
}

/// Returns the way to a stop from a speed, metres: first `delay_s` at that speed, then braking.
pub fn stopping_distance_m(speed_mps: f64, delay_s: f64, braking_mps2: f64) -> f64 {
    speed_mps * delay_s + speed_mps * speed_mps / (2.0 * braking_mps2)
}

impl SensingLimits {
    /// Returns the same of a vehicle that may be carried aside by so much, metres.
    #[must_use]
    pub fn carried(self, aside_m: f64) -> SensingLimits {
        SensingLimits {
            margin_m: self.margin_m + aside_m,
            ..self
        }
    }

    /// Returns the highest speed from which the vehicle stops within what it has seen, m/s.
    ///
    /// # Errors
    /// [`SpeedError`] when a value is impossible or the margin leaves no room.
    pub fn highest_speed_mps(&self) -> Result<f64, SpeedError> {
        self.check()?;
        let room_m = self.range_m - self.margin_m;
        if room_m <= 0.0 {
            return Err(SpeedError::NoRoom {
                range_m: self.range_m,
                margin_m: self.margin_m,
            });
        }
        Ok(self.speed_within_mps(room_m))
    }

    /// Returns whether a wanted cruising speed is safe.
    ///
    /// # Errors
    /// [`SpeedError`], with the highest speed that fits when it is too fast.
    pub fn allow(&self, wanted_mps: f64) -> Result<(), SpeedError> {
        check_value("speed", wanted_mps, wanted_mps > 0.0, "positive")?;
        let highest_mps = self.highest_speed_mps()?;
        let needed_m = stopping_distance_m(wanted_mps, self.delay_s(), self.braking_mps2);
        let room_m = self.range_m - self.margin_m;
        if needed_m <= room_m + 1e-9 {
            return Ok(());
        }
        Err(SpeedError::TooFast {
            wanted_mps,
            needed_m,
            room_m,
            highest_mps,
        })
    }

    /// Returns the speed from which the vehicle stops within `room_m`, looks and latency included, m/s; 0 without
    /// room. For values that [`SensingLimits::highest_speed_mps`] has accepted.
    pub fn speed_within_mps(&self, room_m: f64) -> f64 {
        let (delay_s, braking_mps2) = (self.delay_s(), self.braking_mps2);
        let root_s = (delay_s * delay_s + 2.0 * room_m.max(0.0) / braking_mps2).sqrt();
        braking_mps2 * (root_s - delay_s)
    }

    /// Returns the time that the vehicle may drive on before it brakes, seconds.
    pub fn delay_s(&self) -> f64 {
        self.scan_period_s + self.latency_s
    }

    fn check(&self) -> Result<(), SpeedError> {
        check_value("range", self.range_m, self.range_m > 0.0, "positive")?;
        check_value(
            "margin",
            self.margin_m,
            self.margin_m >= 0.0,
            "non-negative",
        )?;
        check_value(
            "scan period",
            self.scan_period_s,
            self.scan_period_s >= 0.0,
            "non-negative",
        )?;
        check_value(
            "latency",
            self.latency_s,
            self.latency_s >= 0.0,
            "non-negative",
        )?;
        check_value(
            "braking",
            self.braking_mps2,
            self.braking_mps2 > 0.0,
            "positive",
        )
    }
}

fn check_value(
    name: &'static str,
    found: f64,
    in_bounds: bool,
    allowed: &'static str,
) -> Result<(), SpeedError> {
    if found.is_finite() && in_bounds {
        Ok(())
    } else {
        Err(SpeedError::Value {
            name,
            found,
            allowed,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIGHT: SensingLimits = SensingLimits {
        range_m: 2.0,
        margin_m: 0.5,
        scan_period_s: 0.5,
        latency_s: 0.1,
        braking_mps2: 1.0,
    };

    /// Drives in small steps: until the next look is obeyed at full speed, then braking.
    fn driven_m(speed_mps: f64, sight: SensingLimits) -> f64 {
        let (step_s, mut speed, mut way_m, mut time_s) = (1e-4, speed_mps, 0.0, 0.0);
        while speed > 0.0 {
            way_m += speed * step_s;
            time_s += step_s;
            if time_s > sight.scan_period_s + sight.latency_s {
                speed -= sight.braking_mps2 * step_s;
            }
        }
        way_m
    }

    #[test]
    fn a_speed_that_cannot_be_stopped_in_time_is_refused() {
        let highest = SIGHT.highest_speed_mps().unwrap();
        assert!(SIGHT.allow(highest).is_ok());
        assert!(matches!(
            SIGHT.allow(highest * 1.01),
            Err(SpeedError::TooFast { .. })
        ));
        let blind = SensingLimits {
            range_m: 0.4,
            ..SIGHT
        };
        assert_eq!(
            blind.allow(0.1),
            Err(SpeedError::NoRoom {
                range_m: 0.4,
                margin_m: 0.5
            })
        );
        let loose = SensingLimits {
            braking_mps2: 0.0,
            ..SIGHT
        };
        assert!(matches!(
            loose.highest_speed_mps(),
            Err(SpeedError::Value {
                name: "braking",
                ..
            })
        ));
        assert!(matches!(
            SIGHT.allow(f64::NAN),
            Err(SpeedError::Value { name: "speed", .. })
        ));
        assert_eq!(SIGHT.speed_within_mps(-1.0), 0.0);
    }

    proptest! {
        #[test]
        fn the_highest_speed_stops_just_within_the_range(
            range_m in 0.6..5.0f64, scan_period_s in 0.0..2.0f64, braking_mps2 in 0.2..3.0f64,
        ) {
            let sight = SensingLimits { range_m, scan_period_s, braking_mps2, ..SIGHT };
            let way_m = driven_m(sight.highest_speed_mps().unwrap(), sight);
            prop_assert!((way_m - (range_m - 0.5)).abs() < 0.01, "{way_m}");
        }
    }
}
