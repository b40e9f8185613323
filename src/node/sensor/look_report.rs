//! What was heard of late, for operators who look through a vehicle's eyes: said a few times a second while one of them
//! asks for it, and nothing of it is kept otherwise. Nothing is decided by it.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Heading, LOOK_READINGS_MAX, Look, LookReading, Position, READING_AGE_MAX_MS, VehicleId,
};

use super::Scan;
use crate::node::LookSettings;
use crate::time::Time;

/// Who asks greets every two seconds: after so long nobody asks any more.
const ASKED_FOR: Duration = Duration::from_secs(10);
/// Between two looks.
const SAY_EVERY: Duration = Duration::from_millis(200);

/// Readings that were not said yet.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct LookReport {
    vehicle: VehicleId,
    half_angle: Heading,
    max_range_mm: u32,
    /// When an operator asked last.
    asked: Option<Time>,
    said: Option<Time>,
    /// The oldest first, each with when it was taken.
    readings: Vec<(Time, LookReading)>,
}

impl LookReport {
    /// Makes a report of a vehicle for which nobody has asked.
    pub(super) fn new(vehicle: VehicleId, settings: &LookSettings) -> LookReport {
        LookReport {
            vehicle,
            half_angle: Heading::from_radians(settings.half_angle.radians()),
            max_range_mm: in_millimetres(settings.max_range_m),
            asked: None,
            said: None,
            readings: Vec::new(),
        }
    }

    /// Takes that an operator asks.
    pub(super) fn ask(&mut self, now: Time) {
        self.asked = Some(now);
    }

    /// Takes a reading, at an altitude in metres; returns what is to be said, if somebody asks and it is time.
    pub(super) fn take(&mut self, now: Time, scan: &Scan, altitude_m: f64) -> Option<Look> {
        if self.asked.is_none_or(|at| now.since(at) >= ASKED_FOR) {
            self.readings.clear();
            return None;
        }
        self.readings.push((now, reading(scan, altitude_m)));
        if self.said.is_some_and(|at| now.since(at) < SAY_EVERY) {
            return None;
        }
        self.said = Some(now);
        let newest = std::mem::take(&mut self.readings).into_iter();
        let aged = newest.filter_map(|(at, reading)| {
            let age_ms = u16::try_from(now.since(at).as_millis()).ok()?;
            (age_ms <= READING_AGE_MAX_MS).then_some(LookReading { age_ms, ..reading })
        });
        let mut readings: Vec<LookReading> = aged.collect();
        let more = readings.len().saturating_sub(LOOK_READINGS_MAX);
        readings.drain(..more);
        Some(Look {
            vehicle: self.vehicle,
            half_angle: self.half_angle,
            max_range_mm: self.max_range_mm,
            readings,
        })
    }
}

/// Returns a scan as it travels, as one of this moment.
fn reading(scan: &Scan, altitude_m: f64) -> LookReading {
    let at = scan.pose.at;
    LookReading {
        at: Position::from_metres(at.x_m, at.y_m, altitude_m),
        toward: Heading::from_radians((scan.pose.heading + scan.beam).radians()),
        range_mm: scan.range_m.map(in_millimetres),
        is_suspect: scan.suspect,
        age_ms: 0,
    }
}

fn in_millimetres(range_m: f64) -> u32 {
    (range_m * 1000.0).round() as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Angle, Point, Pose};
    use crate::node::tests_support::settings;

    fn at(seconds: f64) -> Time {
        Time::from_secs_f64(seconds)
    }

    fn scan(range_m: Option<f64>) -> Scan {
        Scan {
            pose: Pose {
                at: Point::new(1.5, -2.25),
                heading: Angle::from_degrees(90.0),
                sd_m: 0.05,
            },
            beam: Angle::from_degrees(-30.0),
            range_m,
            suspect: false,
        }
    }

    #[test]
    fn nothing_is_said_unless_somebody_asks() {
        let mut report = LookReport::new(VehicleId(1), &settings(1).look);
        assert_eq!(report.take(at(1.0), &scan(None), 0.0), None);
        report.ask(at(2.0));
        assert!(report.take(at(2.1), &scan(None), 0.0).is_some());
        assert!(report.take(at(11.9), &scan(None), 0.0).is_some());
        assert_eq!(report.take(at(12.0), &scan(None), 0.0), None);
        assert!(report.readings.is_empty());
        report.ask(at(20.0));
        let look = report.take(at(20.0), &scan(Some(1.8304)), 2.0).unwrap();
        let expected = LookReading {
            at: Position::from_metres(1.5, -2.25, 2.0),
            toward: Heading::from_radians(60f64.to_radians()),
            range_mm: Some(1830),
            is_suspect: false,
            age_ms: 0,
        };
        assert_eq!(
            look.readings,
            [expected],
            "what nobody asked for is not said later"
        );
    }

    #[test]
    fn each_reading_is_said_once_with_its_age_and_not_more_than_fit() {
        let mut report = LookReport::new(VehicleId(1), &settings(1).look);
        report.ask(at(0.0));
        let mut said = Vec::new();
        for tick in 0..100u32 {
            let range_m = f64::from(tick) / 10.0;
            let look = report.take(at(range_m), &scan(Some(range_m)), 0.0);
            said.extend(look.map(|look| look.readings));
        }
        assert_eq!(said.len(), 50, "five times a second");
        assert!(said[1..].iter().all(|readings| readings.len() == 2));
        let ages: Vec<u16> = said[1].iter().map(|reading| reading.age_ms).collect();
        assert_eq!(ages, [100, 0]);
        let all: Vec<u32> = said.concat().iter().filter_map(|of| of.range_mm).collect();
        let expected: Vec<u32> = (0..99).map(|tick| tick * 100).collect();
        assert_eq!(all, expected);

        for tick in 0..40u32 {
            let now = at(9.9 + f64::from(tick) / 1000.0);
            assert_eq!(report.take(now, &scan(None), 0.0), None);
        }
        report.ask(at(10.0));
        let look = report.take(at(10.1), &scan(None), 0.0).unwrap();
        assert_eq!(look.readings.len(), LOOK_READINGS_MAX);
        assert_eq!(look.readings[LOOK_READINGS_MAX - 1].age_ms, 0);
        report.ask(at(15.0));
        report.said = Some(at(20.0));
        assert_eq!(report.take(at(17.0), &scan(None), 0.0), None);
        let look = report.take(at(20.2), &scan(None), 0.0).unwrap();
        assert_eq!(look.readings.len(), 1, "an old one is of no use");
    }
}
