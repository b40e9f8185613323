//! What the range sensors of a vehicle heard of late, by its looks: for a page that rides with it.

use std::collections::VecDeque;
use std::time::Duration;

use tomoswarm_proto::{Look, LookReading, READING_AGE_MAX_MS, VehicleId};

use super::told::{ToldLook, as_text};
use crate::time::Time;

/// A reading is shown for so long.
const SHOWN_FOR: Duration = Duration::from_millis(READING_AGE_MAX_MS as u64);
/// Readings of one vehicle that are kept at most.
const READINGS_MAX: usize = 64;

/// The newest readings of one vehicle.
#[derive(Clone, Debug)]
pub struct LookView {
    half_angle_rad: f64,
    max_range_m: f64,
    /// The oldest first, each with when it was taken, as far as its look says that.
    readings: VecDeque<(Time, LookReading)>,
}

impl LookView {
    /// Makes what a first look says.
    pub fn new(now: Time, look: &Look) -> LookView {
        let mut view = LookView {
            half_angle_rad: 0.0,
            max_range_m: 0.0,
            readings: VecDeque::new(),
        };
        view.hear(now, look);
        view
    }

    /// Takes a look.
    pub fn hear(&mut self, now: Time, look: &Look) {
        self.half_angle_rad = look.half_angle.radians();
        self.max_range_m = f64::from(look.max_range_mm) / 1000.0;
        let taken_at = |reading: &LookReading| now - Duration::from_millis(reading.age_ms.into());
        let heard = look.readings.iter();
        self.readings
            .extend(heard.map(|reading| (taken_at(reading), *reading)));
        self.readings.retain(|(at, _)| is_shown(now, *at));
        let more = self.readings.len().saturating_sub(READINGS_MAX);
        self.readings.drain(..more);
    }

    /// Returns how many bytes it takes, about.
    pub fn bytes(&self) -> usize {
        size_of::<LookView>() + self.readings.len() * size_of::<(Time, LookReading)>()
    }

    /// Returns them as text, with their ages at a moment.
    pub fn text(&self, now: Time, id: VehicleId) -> String {
        let thousandths = |value: f64| libm::round(value * 1000.0) / 1000.0;
        let reading = |(at, of): &(Time, LookReading)| {
            let range_m = of.range_mm.map(|range_mm| f64::from(range_mm) / 1000.0);
            let toward_rad = thousandths(of.toward.radians());
            let age_s = thousandths(now.since(*at).as_secs_f64());
            let [x_m, y_m, z_m] = [of.at.x_m(), of.at.y_m(), of.at.z_m()];
            (x_m, y_m, z_m, toward_rad, range_m, age_s, of.is_suspect)
        };
        let shown = self.readings.iter().filter(|(at, _)| is_shown(now, *at));
        as_text(&ToldLook {
            id: id.0,
            half_angle_rad: thousandths(self.half_angle_rad),
            max_range_m: self.max_range_m,
            readings: shown.map(reading).collect(),
        })
    }
}

fn is_shown(now: Time, taken_at: Time) -> bool {
    now.since(taken_at) <= SHOWN_FOR
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};
    use tomoswarm_proto::{Heading, Position};

    fn look(count: u16, age_ms: u16) -> Look {
        let reading = |number| LookReading {
            at: Position::from_metres(1.0, 2.0, 0.0),
            toward: Heading::from_radians(0.5),
            range_mm: Some(u32::from(number)),
            is_suspect: false,
            age_ms,
        };
        Look {
            vehicle: VehicleId(3),
            half_angle: Heading::from_radians(0.25),
            max_range_mm: 4000,
            readings: (0..count).map(reading).collect(),
        }
    }

    #[test]
    fn readings_are_shown_with_their_ages_until_they_are_old() {
        let at = Time::from_secs_f64;
        let mut view = LookView::new(at(10.0), &look(1, 300));
        let late: Value = serde_json::from_str(&view.text(at(11.8), VehicleId(3))).unwrap();
        assert_eq!(late["readings"], json!([]));
        let expected = r#"{"halfAngle_rad":0.25,"id":3,"maxRange_m":4.0,"readings":[[1.0,2.0,0.0,0.5,0.0,0.8,false]]}"#;
        let text: Value = serde_json::from_str(&view.text(at(10.5), VehicleId(3))).unwrap();
        assert_eq!(text, serde_json::from_str::<Value>(expected).unwrap());
        view.hear(at(11.7), &look(1, 0));
        assert_eq!(view.readings.len(), 2, "it is two seconds old");
        view.hear(at(11.8), &look(1, 0));
        assert_eq!(view.readings.len(), 2, "the first one has gone");
        for _ in 0..10 {
            view.hear(at(11.8), &look(16, 0));
        }
        assert_eq!(view.readings.len(), READINGS_MAX);
        // A clock that was just started: nothing was before its beginning.
        let early = LookView::new(Time::ZERO, &look(1, 2000));
        assert_eq!(early.readings.len(), 1);
    }
}
