//! Benewake's lidars TF-Luna and TFmini (also TFmini-S and -Plus): frames of nine bytes, a hundred a second, in centimetres.
//!
//! ```text
//!   59 59 | distance, 2 bytes | strength, 2 bytes | 2 bytes (temperature; TFmini: mode, 0) | sum of all before
//! ```
//!
//! Numbers are little endian. A reading that is too weak or too bright is none: the sensor does not know what is there. So is a
//! distance that it cannot say; all that says that nothing is near is the echo of something farther away. Sources:
//! SJ-PM-TF-Luna A03 section 5.4, SJ-PM-TFmini-T-01 A03 5.4, SJ-PM-TFmini-S A01 5.4.

use std::time::Duration;

use super::{DroppedReadings, RangeReading, TimedReading};
use crate::config::{SensorCoverage, TfSensor};
use crate::time::Time;

/// A frame, bytes.
const FRAME: usize = 9;
/// Both first bytes.
const HEADER: u8 = 0x59;
/// A strength that stands for too bright.
const OVEREXPOSED: u16 = 0xFFFF;
/// The sensor averages over so long a time before it says a frame.
const AVERAGED: Duration = Duration::from_millis(10);

/// Turns frames into readings.
#[derive(Clone, Debug)]
pub struct TfDecoder {
    /// From here on a strength is trusted.
    weakest: u16,
    min_range_m: f64,
    max_range_m: f64,
    /// From here on a distance is none that the sensor measures, metres.
    farthest_m: f64,
    /// What may be the beginning of a frame: bytes and when they came at the earliest.
    begun: Vec<(Time, u8)>,
    /// Bytes of no frame since the last frame, modulo the length of one.
    skipped: usize,
    unreadable: u64,
    out_of_range: u64,
    unreliable: u64,
}

impl TfDecoder {
    /// Makes the decoder of a sensor that looks so far.
    pub fn new(sensor: TfSensor, look: &SensorCoverage) -> TfDecoder {
        let weakest = match sensor {
            TfSensor::Luna => 100,
            // Newer ones trust 100 and more, and say no distance of what is weaker.
            TfSensor::Mini => 20,
        };
        TfDecoder {
            weakest,
            min_range_m: look.min_range_m,
            max_range_m: look.max_range_m,
            farthest_m: 20.0,
            begun: Vec::with_capacity(FRAME),
            skipped: 0,
            unreadable: 0,
            out_of_range: 0,
            unreliable: 0,
        }
    }

    /// Begins anew: what was begun is never ended.
    pub fn restart(&mut self) {
        self.begun.clear();
        self.skipped = 0;
    }

    /// Takes bytes that came at `since` or later, and adds the readings that they end.
    pub fn take(&mut self, since: Time, bytes: &[u8], readings: &mut Vec<TimedReading>) {
        for byte in bytes {
            self.begun.push((since, *byte));
            while !self.may_be_frame() {
                self.skip();
            }
            if self.begun.len() == FRAME {
                readings.extend(self.frame());
            }
        }
    }

    /// Returns what was dropped so far. Nine bytes of no frame count as one.
    pub fn dropped(&self) -> DroppedReadings {
        DroppedReadings {
            too_long: 0,
            unreadable: self.unreadable,
            out_of_range: self.out_of_range,
            unreliable: self.unreliable,
        }
    }

    fn may_be_frame(&self) -> bool {
        let has_header = self.begun.iter().take(2).all(|(_, byte)| *byte == HEADER);
        let Some(((_, sum), before)) = self
            .begun
            .split_last()
            .filter(|_| self.begun.len() == FRAME)
        else {
            return has_header;
        };
        has_header
            && before
                .iter()
                .fold(0, |sum: u8, (_, byte)| sum.wrapping_add(*byte))
                == *sum
    }

    /// Leaves the first byte out.
    fn skip(&mut self) {
        self.begun.remove(0);
        self.skipped += 1;
        if self.skipped == FRAME {
            self.skipped = 0;
            self.unreadable += 1;
        }
    }

    /// Takes the frame that is whole.
    fn frame(&mut self) -> Option<TimedReading> {
        let number = |at: usize| u16::from_le_bytes([self.begun[at].1, self.begun[at + 1].1]);
        let (distance_cm, strength, since) = (number(2), number(4), self.begun[0].0);
        self.restart();
        if strength < self.weakest || strength == OVEREXPOSED {
            self.unreliable += 1;
            return None;
        }
        let range_m = f64::from(distance_cm) / 100.0;
        if !(self.min_range_m..=self.farthest_m).contains(&range_m) {
            self.out_of_range += 1;
            return None;
        }
        let reading = match range_m > self.max_range_m {
            true => RangeReading::Nothing,
            false => RangeReading::Range(range_m),
        };
        Some(TimedReading {
            measured: since - AVERAGED,
            reading,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn decoder(sensor: TfSensor) -> TfDecoder {
        let look = SensorCoverage {
            min_range_m: 0.2,
            max_range_m: 4.0,
            ..SensorCoverage::default()
        };
        TfDecoder::new(sensor, &look)
    }

    fn frame(distance_cm: u16, strength: u16) -> [u8; FRAME] {
        let ([dl, dh], [al, ah]) = (distance_cm.to_le_bytes(), strength.to_le_bytes());
        let mut frame = [HEADER, HEADER, dl, dh, al, ah, 0x68, 0x09, 0];
        frame[8] = frame.iter().fold(0, |sum, byte| sum.wrapping_add(*byte));
        frame
    }

    fn read(decoder: &mut TfDecoder, bytes: &[u8]) -> Vec<RangeReading> {
        let mut readings = Vec::new();
        decoder.take(Time::from_secs_f64(1.0), bytes, &mut readings);
        readings.iter().map(|timed| timed.reading).collect()
    }

    #[test]
    fn a_frame_is_a_distance_in_centimetres() {
        let mut decoder = decoder(TfSensor::Luna);
        // 59 59 | 100 cm | strength 1000 | 45 °C.
        let bytes = [0x59, 0x59, 0x64, 0x00, 0xE8, 0x03, 0x68, 0x09, 0x72];
        assert_eq!(read(&mut decoder, &bytes), [RangeReading::Range(1.0)]);
        assert_eq!(
            read(&mut decoder, &frame(399, 100)),
            [RangeReading::Range(3.99)]
        );
        assert_eq!(decoder.dropped().total(), 0);
    }

    #[test]
    fn what_is_too_weak_too_bright_or_no_distance_never_says_that_nothing_is_there() {
        for (sensor, distance_cm, strength, expected) in [
            (TfSensor::Luna, 900, 100, Some(RangeReading::Nothing)),
            (TfSensor::Luna, 900, 99, None),
            (TfSensor::Luna, 0, 99, None),
            (TfSensor::Luna, 100, 0xFFFF, None),
            (TfSensor::Luna, 0, 500, None),
            (TfSensor::Luna, 0xFFFF, 500, None),
            (TfSensor::Mini, 100, 20, Some(RangeReading::Range(1.0))),
            (TfSensor::Mini, 0xFFFF, 19, None),
            (TfSensor::Mini, 1200, 20, Some(RangeReading::Nothing)),
            (TfSensor::Mini, 0xFFFE, 2000, None),
            (TfSensor::Mini, 0xFFFC, 2000, None),
            (TfSensor::Mini, 0xFFFF, 2000, None),
        ] {
            let mut decoder = decoder(sensor);
            let found = read(&mut decoder, &frame(distance_cm, strength));
            assert_eq!(
                found,
                Vec::from_iter(expected),
                "{sensor:?} {distance_cm} {strength}"
            );
            assert_eq!(decoder.dropped().total() as usize, 1 - found.len());
        }
    }

    #[test]
    fn a_frame_is_found_behind_rubbish_and_behind_half_a_frame() {
        let mut decoder = decoder(TfSensor::Mini);
        let mut bytes = frame(150, 500)[4..].to_vec();
        bytes.extend(frame(200, 500));
        assert_eq!(read(&mut decoder, &bytes), [RangeReading::Range(2.0)]);
        assert_eq!(decoder.dropped().total(), 0, "its beginning was not heard");
        let mut damaged = frame(300, 500);
        damaged[3] ^= 1;
        let bytes = [damaged.as_slice(), &[HEADER], &frame(250, 500)].concat();
        assert_eq!(read(&mut decoder, &bytes), [RangeReading::Range(2.5)]);
        assert_eq!(decoder.dropped().unreadable, 1);
    }

    #[test]
    fn a_reading_is_older_than_its_frame_by_what_the_sensor_averages() {
        let (mut decoder, mut readings, bytes) =
            (decoder(TfSensor::Luna), Vec::new(), frame(100, 500));
        decoder.take(Time::from_secs_f64(2.0), &bytes[..1], &mut readings);
        decoder.take(Time::from_secs_f64(2.005), &bytes[1..], &mut readings);
        assert_eq!(readings[0].measured, Time::from_secs_f64(1.99));
    }

    proptest! {
        #[test]
        fn bytes_mean_the_same_however_they_are_cut(
            bytes in prop::collection::vec(prop_oneof![any::<u8>(), Just(HEADER)], 0..200), cut in 0..200_usize,
        ) {
            let mut whole = decoder(TfSensor::Luna);
            let found = read(&mut whole, &bytes);
            let (first, second) = bytes.split_at(cut.min(bytes.len()));
            let mut split = decoder(TfSensor::Luna);
            let mut pieces = read(&mut split, first);
            pieces.extend(read(&mut split, second));
            prop_assert_eq!(pieces, found);
            prop_assert_eq!(split.dropped(), whole.dropped());
            prop_assert!(split.begun.len() < FRAME);
        }
    }
}
