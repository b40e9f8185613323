//! Range sensors that say lines of text: `R1234` in millimetres as those of MaxBotix do, or a number a line. What is no
//! such line, or nothing that the sensor can have measured, is dropped and counted; nothing is guessed.

use std::time::Duration;

use super::lines::Lines;
use super::{DroppedReadings, RangeReading, TimedReading};
use crate::config::{SensorCoverage, SerialText, TextFormat};
use crate::time::Time;

/// No number is longer, bytes.
const LONGEST_NUMBER: usize = 16;

/// Turns lines of text into readings.
#[derive(Clone, Debug)]
pub struct TextDecoder {
    format: TextFormat,
    /// What the number 1 stands for, metres.
    unit_m: f64,
    min_range_m: f64,
    max_range_m: f64,
    /// From here on a reading says that nothing was heard, metres; infinite = none says so.
    nothing_from_m: f64,
    /// From measuring to the first byte of the line.
    delay: Duration,
    lines: Lines,
    unreadable: u64,
    out_of_range: u64,
}

impl TextDecoder {
    /// Makes the decoder of a sensor that looks so far.
    pub fn new(text: &SerialText, look: &SensorCoverage) -> TextDecoder {
        TextDecoder {
            format: text.format,
            unit_m: text.unit.metres(),
            min_range_m: look.min_range_m,
            max_range_m: look.max_range_m,
            nothing_from_m: text.nothing_from_m(look).unwrap_or(f64::INFINITY),
            delay: text.delay(),
            lines: Lines::new(),
            unreadable: 0,
            out_of_range: 0,
        }
    }

    /// Begins anew: what was begun is never ended.
    pub fn restart(&mut self) {
        self.lines.restart();
    }

    /// Takes bytes that came at `since` or later, and adds the readings that they end.
    pub fn take(&mut self, since: Time, bytes: &[u8], readings: &mut Vec<TimedReading>) {
        let TextDecoder {
            lines,
            format,
            unit_m,
            delay,
            unreadable,
            out_of_range,
            ..
        } = self;
        let limits = (self.min_range_m, self.max_range_m, self.nothing_from_m);
        lines.take(since, bytes, |since, line| {
            let Some(number) = number(*format, line) else {
                *unreadable += 1;
                return;
            };
            match judged(number * *unit_m, limits) {
                Some(reading) => readings.push(TimedReading {
                    measured: since - *delay,
                    reading,
                }),
                None => *out_of_range += 1,
            }
        });
    }

    /// Returns what was dropped so far.
    pub fn dropped(&self) -> DroppedReadings {
        let TextDecoder {
            lines,
            unreadable,
            out_of_range,
            ..
        } = self;
        DroppedReadings {
            too_long: lines.too_long(),
            unreadable: *unreadable,
            out_of_range: *out_of_range,
            unreliable: 0,
        }
    }
}

/// Returns what a distance says; `None` for one that the sensor cannot have measured.
fn judged(range_m: f64, (min_m, max_m, nothing_from_m): (f64, f64, f64)) -> Option<RangeReading> {
    if range_m >= nothing_from_m {
        return Some(RangeReading::Nothing);
    }
    (min_m..=max_m)
        .contains(&range_m)
        .then_some(RangeReading::Range(range_m))
}

/// Returns the number that a line says, finite; `None` when it says none.
fn number(format: TextFormat, line: &[u8]) -> Option<f64> {
    let line = line.trim_ascii();
    let digits = match format {
        TextFormat::MaxBotix => line
            .strip_prefix(b"R")
            .filter(|rest| rest.len() == 4 && rest.iter().all(u8::is_ascii_digit))?,
        TextFormat::Number => Some(line).filter(|line| is_plain(line))?,
    };
    std::str::from_utf8(digits)
        .ok()?
        .parse()
        .ok()
        .filter(|number: &f64| number.is_finite())
}

/// Returns whether a line is a number as people write it: no exponents, no words such as `inf`.
fn is_plain(line: &[u8]) -> bool {
    let is_part = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+');
    line.len() <= LONGEST_NUMBER && line.iter().all(is_part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::LengthUnit;
    use proptest::prelude::*;

    /// A sensor that hears from 0.3 m to 4 m.
    fn decoder(text: SerialText) -> TextDecoder {
        let look = SensorCoverage {
            min_range_m: 0.3,
            max_range_m: 4.0,
            ..SensorCoverage::default()
        };
        let mut decoder = TextDecoder::new(&text, &look);
        decoder.take(Time::ZERO, b"\r", &mut Vec::new());
        decoder
    }

    fn maxbotix() -> TextDecoder {
        decoder(SerialText::default())
    }

    fn numbers(unit: LengthUnit, nothing_from: Option<f64>) -> TextDecoder {
        decoder(SerialText {
            format: TextFormat::Number,
            unit,
            nothing_from,
            ..SerialText::default()
        })
    }

    fn read(decoder: &mut TextDecoder, bytes: &[u8]) -> Vec<RangeReading> {
        let mut readings = Vec::new();
        decoder.take(Time::ZERO, bytes, &mut readings);
        readings.into_iter().map(|timed| timed.reading).collect()
    }

    fn check(mut decoder: TextDecoder, line: &str, expected: Option<RangeReading>) {
        let found = read(&mut decoder, format!("{line}\r").as_bytes());
        match (found.as_slice(), expected) {
            ([RangeReading::Range(found_m)], Some(RangeReading::Range(m))) => {
                assert!((found_m - m).abs() < 1e-9, "{line}: {found_m}");
            }
            (found, expected) => assert_eq!(found, expected.as_slice(), "{line}"),
        }
        assert_eq!(
            decoder.dropped().total(),
            u64::from(expected.is_none()),
            "{line}"
        );
    }

    #[test]
    fn a_line_of_a_maxbotix_is_millimetres_and_its_farthest_is_nothing() {
        let range = |range_m| Some(RangeReading::Range(range_m));
        let nothing = Some(RangeReading::Nothing);
        for (line, expected) in [
            ("R1234", range(1.234)),
            (" R0300 ", range(0.3)),
            ("R3999", range(3.999)),
            ("R4000", nothing),
            ("R5000", nothing),
            ("R9999", nothing),
            ("R0299", None),
            ("R0000", None),
            ("R123", None),
            ("R12345", None),
            ("R-123", None),
            ("R1 23", None),
            ("R+123", None),
            ("r1234", None),
            ("1234", None),
            ("R1234P1", None),
            ("HRLV-MaxSonar", None),
            ("R12\u{660}", None),
        ] {
            check(maxbotix(), line, expected);
        }
    }

    #[test]
    fn a_number_counts_in_its_unit_and_beyond_the_range_it_is_no_emptiness() {
        let range = |range_m| Some(RangeReading::Range(range_m));
        for (unit, line, expected) in [
            (LengthUnit::Millimetres, "1234", range(1.234)),
            (LengthUnit::Centimetres, "123.4", range(1.234)),
            (LengthUnit::Metres, "+1.234", range(1.234)),
            (LengthUnit::Metres, "4", range(4.0)),
            (LengthUnit::Inches, "100", range(2.54)),
            (LengthUnit::Metres, ".5", range(0.5)),
            (LengthUnit::Metres, "4.001", None),
            (LengthUnit::Metres, "9999999999999999", None),
            (LengthUnit::Metres, "0", None),
            (LengthUnit::Metres, "-1", None),
            (LengthUnit::Metres, "-", None),
            (LengthUnit::Metres, "1.2.3", None),
            (LengthUnit::Metres, "1,5", None),
            (LengthUnit::Metres, "nan", None),
            (LengthUnit::Metres, "inf", None),
            (LengthUnit::Metres, "infinity", None),
            (LengthUnit::Metres, "1e0", None),
            (LengthUnit::Metres, "00000000000000001", None),
            (LengthUnit::Metres, "R1234", None),
        ] {
            check(numbers(unit, None), line, expected);
        }
        check(
            numbers(LengthUnit::Centimetres, Some(1200.0)),
            "1200",
            Some(RangeReading::Nothing),
        );
        check(numbers(LengthUnit::Centimetres, Some(1200.0)), "1199", None);
        check(
            numbers(LengthUnit::Centimetres, Some(1200.0)),
            "400",
            range(4.0),
        );
    }

    #[test]
    fn each_kind_of_rubbish_is_counted_by_its_name() {
        let mut decoder = maxbotix();
        let bytes = [
            b"R1000\rrubbish\r".as_slice(),
            &[b'x'; 10_000],
            b"\rR0001\r\xff\xfe\rR2000\r",
        ]
        .concat();
        assert_eq!(
            read(&mut decoder, &bytes),
            [RangeReading::Range(1.0), RangeReading::Range(2.0)]
        );
        assert_eq!(
            decoder.dropped(),
            DroppedReadings {
                too_long: 1,
                unreadable: 2,
                out_of_range: 1,
                unreliable: 0
            }
        );
        assert_eq!(
            decoder.dropped().to_string(),
            "1 too long, 2 unreadable, 1 out of range, 0 unreliable"
        );
    }

    #[test]
    fn a_reading_is_older_than_its_line_by_the_delay() {
        let mut decoder = decoder(SerialText {
            delay_s: 0.1,
            ..SerialText::default()
        });
        let mut readings = Vec::new();
        decoder.take(Time::from_secs_f64(2.0), b"R10", &mut readings);
        decoder.take(Time::from_secs_f64(2.01), b"00\r", &mut readings);
        assert_eq!(readings[0].measured, Time::from_secs_f64(1.9));
    }

    proptest! {
        #[test]
        fn no_bytes_make_a_reading_that_the_sensor_cannot_have_measured(
            chunks in prop::collection::vec(prop::collection::vec(
                prop_oneof![any::<u8>(), prop::sample::select(b"R0123456789.-+e\r\n".to_vec())], 0..300), 0..8),
            is_number: bool,
        ) {
            let mut decoder = if is_number { numbers(LengthUnit::Millimetres, None) } else { maxbotix() };
            for chunk in &chunks {
                for reading in read(&mut decoder, chunk) {
                    match reading {
                        RangeReading::Range(range_m) => prop_assert!((0.3..=4.0).contains(&range_m)),
                        RangeReading::Nothing => prop_assert!(!is_number),
                    }
                }
            }
        }

        #[test]
        fn every_line_is_a_reading_or_counted(mm in 0..10_000_u32, junk in "[ -Q]{1,120}") {
            let mut decoder = maxbotix();
            let found = read(&mut decoder, format!("{junk}\rR{mm:04}\r").as_bytes());
            prop_assert_eq!(found.len() as u64 + decoder.dropped().total(), 2);
        }
    }
}
