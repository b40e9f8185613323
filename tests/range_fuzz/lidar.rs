//! The reader of a lidar's frames under bytes of any kind.

use tomoswarm::config::{SensorCoverage, SerialProtocol, TfSensor};
use tomoswarm::hw::{DroppedReadings, RangeDecoder, RangeReading, TimedReading};
use tomoswarm::time::Time;

use crate::chance::Chance;

fn frame(chance: &mut Chance) -> Vec<u8> {
    let distance = chance.one_of(&[
        0, 19, 20, 100, 400, 401, 900, 1200, 2001, 0x5959, 0xFFFE, 0xFFFF,
    ]);
    let strength = chance.one_of(&[0, 19, 20, 99, 100, 1000, 0x5959, 0xFFFE, 0xFFFF]);
    let mut frame = vec![0x59, 0x59];
    frame.extend(u16::to_le_bytes(distance));
    frame.extend(u16::to_le_bytes(strength));
    frame.extend([chance.below(256) as u8, chance.below(256) as u8]);
    frame.push(
        frame
            .iter()
            .fold(0, |sum: u8, byte| sum.wrapping_add(*byte)),
    );
    frame
}

fn stream(chance: &mut Chance) -> Vec<u8> {
    let mut stream = Vec::new();
    for _ in 0..chance.below(8) {
        let mut piece = frame(chance);
        match chance.below(5) {
            0 => piece.truncate(chance.below(9)),
            1 => {
                let at = chance.below(9);
                piece[at] ^= 1 << chance.below(8);
            }
            2 => {
                piece = (0..chance.below(20))
                    .map(|_| chance.one_of(&[0x59, 0x59, 0, 7, 0xFF]))
                    .collect()
            }
            _ => {}
        }
        stream.extend(piece);
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

pub fn any_bytes(chance: &mut Chance) {
    let sensor = chance.one_of(&[TfSensor::Luna, TfSensor::Mini]);
    let weakest = if sensor == TfSensor::Luna { 100 } else { 20 };
    let look = SensorCoverage {
        min_range_m: 0.2,
        max_range_m: 4.0,
        ..SensorCoverage::default()
    };
    let decoder = RangeDecoder::new(&SerialProtocol::Tf(sensor), &look);
    let stream = stream(chance);
    let whole = read(&mut decoder.clone(), &[&stream]);
    let (first, second) = stream.split_at(chance.below(stream.len() + 1));
    assert_eq!(read(&mut decoder.clone(), &[first, second]), whole);
    // Every reading is a frame of the stream that the sensor trusts.
    let trusted = |frame: &&[u8]| {
        let sum = frame[..8]
            .iter()
            .fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
        let strength = u16::from_le_bytes([frame[4], frame[5]]);
        frame[..2] == [0x59, 0x59] && frame[8] == sum && (weakest..0xFFFF).contains(&strength)
    };
    let distances: Vec<f64> = stream
        .windows(9)
        .filter(trusted)
        .map(|frame| f64::from(u16::from_le_bytes([frame[2], frame[3]])) / 100.0)
        .collect();
    for timed in &whole.0 {
        match timed.reading {
            RangeReading::Range(range_m) => {
                assert!((0.2..=4.0).contains(&range_m) && distances.contains(&range_m));
            }
            RangeReading::Nothing => {
                assert!(
                    distances
                        .iter()
                        .any(|distance_m| (4.0..=20.0).contains(distance_m))
                );
            }
        }
    }
    // Behind all that a frame is found, at the latest when what it may be taken for has come.
    let last = [0x59, 0x59, 0x7B, 0x00, 0xE8, 0x03, 0x68, 0x09, 0x89];
    let (readings, _) = read(&mut decoder.clone(), &[&stream, &last, &last]);
    assert_eq!(
        readings.last().map(|timed| timed.reading),
        Some(RangeReading::Range(1.23))
    );
}
