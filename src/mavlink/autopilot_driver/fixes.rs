//! Places that are measured from outside (motion capture, ultra-wideband), passed on for the autopilot's own estimate as
//! VISION_POSITION_ESTIMATE. One who measures is believed at a time.

use std::time::Duration;

use tomoswarm_proto::{Fix, Sender};

use super::heard::Heard;
use super::{DriverOut, DriverTrouble, MavlinkDriverSettings, say};
use crate::geom::{Angle, Point};
use crate::mavlink::dialect::{self as d, MavMessage};
use crate::time::Time;

/// No more than one in this time is passed on: a slow serial line has to carry them.
const EVERY: Duration = Duration::from_millis(45);
/// Who has been silent for this long is believed no longer, and another one is.
const SILENT: Duration = Duration::from_secs(1);
/// Two who measure are told for this long.
const TWO_FOR: Duration = Duration::from_secs(3);

/// What has come from outside.
#[derive(Clone, Debug, Default)]
pub(super) struct Fixes {
    /// Who is believed, and when it was heard.
    source: Option<(Sender, Time)>,
    /// Another one that was heard meanwhile.
    other: Option<(Sender, Time)>,
    passed_on: Option<Time>,
}

impl Fixes {
    /// Passes a fix on, unless another one is believed, one was passed on just now, or its heading is known neither from it
    /// nor from the autopilot.
    pub(super) fn hear(
        &mut self,
        now: Time,
        from: Sender,
        fix: &Fix,
        (settings, heard): (&MavlinkDriverSettings, &Heard),
        out: &mut Vec<DriverOut>,
    ) {
        let believed = self.source.filter(|(_, at)| now.since(*at) < SILENT);
        if believed.is_some_and(|(source, _)| source != from) {
            self.other = Some((from, now));
            return;
        }
        self.source = Some((from, now));
        self.other.take_if(|(other, _)| *other == from);
        if self.passed_on.is_some_and(|at| now.since(at) < EVERY) {
            return;
        }
        let measured = fix
            .heading
            .map(|heading| Angle::from_radians(heading.radians()));
        let Some(heading) = measured.or_else(|| heard.attitude.heading(now, settings)) else {
            return;
        };
        self.passed_on = Some(now);
        let frame = &settings.frame;
        let place = Point::new(fix.at.x_m(), fix.at.y_m());
        let from_origin = place - heard.local_origin(settings);
        let (north_m, east_m) = frame.north_east(Point::default() + from_origin);
        // Of x, y and z, in the upper triangle of the matrix, row by row; the first is no number when none is known.
        let mut covariance = [0.0; 21];
        match fix.sd.metres() {
            Some(sd_m) => [0, 6, 11]
                .into_iter()
                .for_each(|index| covariance[index] = (sd_m * sd_m) as f32),
            None => covariance[0] = f32::NAN,
        }
        let measured_us = (now.as_nanos() / 1000).saturating_sub(u64::from(fix.age_ms) * 1000);
        let estimate = d::VISION_POSITION_ESTIMATE_DATA {
            usec: measured_us,
            x: north_m as f32,
            y: east_m as f32,
            z: -fix.at.z_m() as f32,
            yaw: frame.bearing_of(heading).radians() as f32,
            covariance,
            ..d::VISION_POSITION_ESTIMATE_DATA::default()
        };
        say(out, MavMessage::VISION_POSITION_ESTIMATE(estimate));
    }

    /// Returns what is wrong with those who measure.
    pub(super) fn trouble(&self, now: Time) -> Option<DriverTrouble> {
        let is_fresh = |(_, at): &(Sender, Time), within| now.since(*at) < within;
        let Some(source) = self.source.filter(|source| is_fresh(source, SILENT)) else {
            return Some(DriverTrouble::NoFix);
        };
        let other = self.other.filter(|other| is_fresh(other, TWO_FOR))?;
        Some(DriverTrouble::TwoMeasure {
            believed: source.0,
            other: other.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{Deviation, Heading, OperatorId, Position, VehicleId};

    use super::super::tests_support::settings;
    use super::*;
    use crate::geom::Bearing;

    const ONE: Sender = Sender::Operator(OperatorId(1));
    const TWO: Sender = Sender::Operator(OperatorId(2));

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    fn fix(heading: Option<f64>, sd: Deviation) -> Fix {
        let place = settings().frame.from_north_east(3.0, -2.0);
        Fix {
            vehicle: VehicleId(1),
            at: Position::from_metres(place.x_m, place.y_m, 1.5),
            heading: heading.map(Heading::from_radians),
            sd,
            age_ms: 500,
        }
    }

    fn said(out: &[DriverOut]) -> Vec<d::VISION_POSITION_ESTIMATE_DATA> {
        let estimate = |out: &DriverOut| match out {
            DriverOut::Say(message) => match message.as_ref() {
                MavMessage::VISION_POSITION_ESTIMATE(said) => Some(said.clone()),
                _ => None,
            },
            _ => None,
        };
        out.iter().filter_map(estimate).collect()
    }

    #[test]
    fn a_fix_is_passed_on_in_north_and_east_with_the_time_when_it_was_measured() {
        let (settings, heard) = (settings(), Heard::default());
        let heading = settings.frame.heading_of(Bearing::from_degrees(90.0));
        let mut out = Vec::new();
        let fix = fix(Some(heading.radians()), Deviation(100));
        Fixes::default().hear(at(2.0), ONE, &fix, (&settings, &heard), &mut out);
        let [said] = &said(&out)[..] else {
            panic!("{out:?}")
        };
        assert!(
            (said.x - 3.0).abs() < 1e-3 && (said.y + 2.0).abs() < 1e-3,
            "{said:?}"
        );
        assert_eq!((said.z, said.usec), (-1.5, 1_500_000));
        assert!(
            (said.yaw - std::f32::consts::FRAC_PI_2).abs() < 1e-3,
            "{said:?}"
        );
        let of = |index: usize| said.covariance[index];
        assert!((of(0) - 0.01).abs() < 1e-6 && (of(11) - 0.01).abs() < 1e-6 && of(1) == 0.0);
    }

    #[test]
    fn without_a_heading_it_waits_for_the_autopilots_own_and_an_unknown_deviation_stays_unknown() {
        let (settings, mut heard) = (settings(), Heard::default());
        let mut fixes = Fixes::default();
        let mut out = Vec::new();
        let bare = fix(None, Deviation::UNKNOWN);
        fixes.hear(at(1.0), ONE, &bare, (&settings, &heard), &mut out);
        assert!(out.is_empty(), "{out:?}");
        let attitude = MavMessage::ATTITUDE(d::ATTITUDE_DATA {
            yaw: 0.5,
            ..d::ATTITUDE_DATA::default()
        });
        heard.take(at(1.1), &attitude, &settings);
        fixes.hear(at(1.2), ONE, &bare, (&settings, &heard), &mut out);
        let [said] = &said(&out)[..] else {
            panic!("{out:?}")
        };
        assert!(
            (said.yaw - 0.5).abs() < 1e-6 && said.covariance[0].is_nan(),
            "{said:?}"
        );
    }

    #[test]
    fn of_two_who_measure_one_is_believed_until_it_is_silent_and_both_are_named() {
        let (settings, heard) = (settings(), Heard::default());
        let mut fixes = Fixes::default();
        let mut passed = Vec::new();
        assert_eq!(fixes.trouble(at(0.0)), Some(DriverTrouble::NoFix));
        for step in 0..30 {
            let now = at(f64::from(step) * 0.1);
            let mut out = Vec::new();
            // The first one falls silent after a second.
            if step <= 10 {
                fixes.hear(
                    now,
                    ONE,
                    &fix(Some(0.0), Deviation(10)),
                    (&settings, &heard),
                    &mut out,
                );
                passed.push((ONE, step, said(&out).len()));
            }
            let mut out = Vec::new();
            fixes.hear(
                now,
                TWO,
                &fix(Some(0.0), Deviation(10)),
                (&settings, &heard),
                &mut out,
            );
            passed.push((TWO, step, said(&out).len()));
            if step == 5 {
                let both = DriverTrouble::TwoMeasure {
                    believed: ONE,
                    other: TWO,
                };
                assert_eq!(fixes.trouble(now), Some(both));
            }
        }
        let when = |from| {
            let of_it = passed
                .iter()
                .filter(move |(one, _, count)| *one == from && *count == 1);
            of_it.map(|(_, step, _)| *step).collect::<Vec<i32>>()
        };
        assert_eq!(when(ONE), (0..=10).collect::<Vec<i32>>());
        assert_eq!(when(TWO), (20..30).collect::<Vec<i32>>());
        assert_eq!(fixes.trouble(at(2.95)), None);
        assert_eq!(fixes.trouble(at(4.0)), Some(DriverTrouble::NoFix));
    }

    #[test]
    fn more_than_a_serial_line_carries_are_left_out() {
        let (settings, heard) = (settings(), Heard::default());
        let (mut fixes, mut out) = (Fixes::default(), Vec::new());
        for step in 0..240 {
            let now = at(f64::from(step) / 240.0);
            fixes.hear(
                now,
                ONE,
                &fix(Some(0.0), Deviation(10)),
                (&settings, &heard),
                &mut out,
            );
        }
        let count = said(&out).len();
        assert!((18..=23).contains(&count), "{count} of 240");
    }
}
