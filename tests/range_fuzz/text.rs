//! The reader of lines of text under bytes of any kind.

use tomoswarm::config::{LengthUnit, SensorCoverage, SerialProtocol, SerialText, TextFormat};
use tomoswarm::hw::{DroppedReadings, RangeDecoder, RangeReading, TimedReading};
use tomoswarm::time::Time;

use crate::chance::Chance;

/// How far the sensor hears, metres.
const NEAREST_M: f64 = 0.3;
const FARTHEST_M: f64 = 4.0;
/// The longest line that is read, and the longest number, bytes.
const LONGEST_LINE: usize = 128;
const LONGEST_NUMBER: usize = 16;

/// Draws what a line may say, or what looks like it.
fn line(chance: &mut Chance, format: TextFormat) -> Vec<u8> {
    let number = match chance.below(4) {
        0 => chance.one_of(&[0, 299, 300, 301, 3999, 4000, 4001, 5000, 9999]),
        _ => chance.below(12_000),
    };
    let text = match chance.below(8) {
        0 => format!(" R{number:04}\t"),
        1 => format!("R{number}"),
        2 => format!("+{number}.{}", chance.below(100)),
        3 => chance
            .one_of(&["nan", "inf", "1e3", "-", ".", "", "R", "R12a4", "--5"])
            .to_owned(),
        4 => "7".repeat(chance.one_of(&[15, 16, 17, 127, 128, 129, 300])),
        _ if format == TextFormat::MaxBotix => format!("R{number:04}"),
        _ => number.to_string(),
    };
    text.into_bytes()
}

fn stream(chance: &mut Chance, format: TextFormat) -> Vec<u8> {
    let mut stream = Vec::new();
    for _ in 0..chance.below(10) {
        let mut piece = line(chance, format);
        match chance.below(6) {
            0 => piece.truncate(chance.below(6)),
            1 if !piece.is_empty() => {
                let at = chance.below(piece.len());
                piece[at] ^= 1 << chance.below(8);
            }
            2 => {
                piece = (0..chance.below(20))
                    .map(|_| chance.below(256) as u8)
                    .collect()
            }
            _ => {}
        }
        stream.extend(piece);
        stream.extend(chance.one_of(&["\r", "\n", "\r\n", "\r", ""]).bytes());
    }
    stream
}

fn read(decoder: &mut RangeDecoder, pieces: &[&[u8]]) -> (Vec<TimedReading>, DroppedReadings) {
    let mut readings = Vec::new();
    for piece in pieces {
        decoder.take(Time::from_secs_f64(1.0), piece, &mut readings);
    }
    (readings, decoder.dropped())
}

/// What each line behind the first end of a line says, read in another way: a distance, metres, or none.
fn distances(stream: &[u8], text: &SerialText) -> Vec<Option<f64>> {
    let ends = |byte: &u8| matches!(byte, b'\r' | b'\n');
    let mut lines: Vec<&[u8]> = stream.split(ends).skip(1).collect();
    // The last one has no end.
    lines.pop();
    let lines = lines.into_iter().filter(|line| !line.is_empty());
    lines.map(|line| distance_m(line, text)).collect()
}

fn distance_m(line: &[u8], text: &SerialText) -> Option<f64> {
    if line.len() > LONGEST_LINE {
        return None;
    }
    let said = std::str::from_utf8(line.trim_ascii()).ok()?;
    let digits = match text.format {
        TextFormat::MaxBotix => {
            let digits = said.strip_prefix('R')?;
            let is_right = digits.len() == 4 && digits.chars().all(|one| one.is_ascii_digit());
            is_right.then_some(digits)?
        }
        TextFormat::Number => {
            let is_right = said.len() <= LONGEST_NUMBER
                && said.chars().all(|one| "0123456789.+-".contains(one));
            is_right.then_some(said)?
        }
    };
    Some(digits.parse::<f64>().ok()? * text.unit.metres())
}

pub fn any_bytes(chance: &mut Chance) {
    let format = chance.one_of(&[TextFormat::MaxBotix, TextFormat::Number]);
    let text = SerialText {
        format,
        unit: match format {
            TextFormat::MaxBotix => LengthUnit::Millimetres,
            TextFormat::Number => chance.one_of(&[LengthUnit::Millimetres, LengthUnit::Inches]),
        },
        nothing_from: match format {
            TextFormat::MaxBotix => None,
            TextFormat::Number => chance.one_of(&[None, Some(5000.0)]),
        },
        ..SerialText::default()
    };
    let look = SensorCoverage {
        min_range_m: NEAREST_M,
        max_range_m: FARTHEST_M,
        ..SensorCoverage::default()
    };
    let decoder = RangeDecoder::new(&SerialProtocol::Text(text), &look);
    let stream = stream(chance, format);
    let whole = read(&mut decoder.clone(), &[&stream]);
    let (first, second) = stream.split_at(chance.below(stream.len() + 1));
    assert_eq!(read(&mut decoder.clone(), &[first, second]), whole);
    // Each line that says a distance within the range is a reading, one that says so is emptiness, and nothing else is either.
    let nothing_from_m = text.nothing_from_m(&look).unwrap_or(f64::INFINITY);
    let reading = |distance_m: f64| match distance_m {
        _ if distance_m >= nothing_from_m => Some(RangeReading::Nothing),
        _ if (NEAREST_M..=FARTHEST_M).contains(&distance_m) => {
            Some(RangeReading::Range(distance_m))
        }
        _ => None,
    };
    let said = distances(&stream, &text);
    let expected: Vec<RangeReading> = said.iter().flatten().copied().filter_map(reading).collect();
    let found: Vec<RangeReading> = whole.0.iter().map(|timed| timed.reading).collect();
    assert_eq!(found, expected);
    // What is no reading is counted; of a line that is too long and has no end yet as well.
    let unread = (said.len() - expected.len()) as u64;
    let dropped = whole.1.total();
    assert!(
        (unread..=unread + 1).contains(&dropped),
        "{dropped} of {unread}"
    );
    // Behind all that a line is read.
    let number = 1.2 / text.unit.metres();
    let last = match format {
        TextFormat::MaxBotix => format!("\rR{number:04.0}\r"),
        TextFormat::Number => format!("\r{number:.1}\r"),
    };
    let (readings, _) = read(&mut decoder.clone(), &[&stream, last.as_bytes()]);
    let last = readings.last().map(|timed| timed.reading);
    let is_read =
        matches!(last, Some(RangeReading::Range(range_m)) if (range_m - 1.2).abs() < 0.002);
    assert!(is_read, "{last:?}");
}
