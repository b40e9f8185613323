//! How fast the frames of an XBee are read: `cargo bench --no-default-features --bench xbee`. Prints MB/s for both API modes,
//! of beacons as they come and of garbage made of beginnings, and judges nothing.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::hint::black_box;
use std::time::Instant;

use tomoswarm::hw::xbee_frame::{ApiMode, Decoder, Frame, encode};

/// Best of seven rounds; bytes come in pieces as a serial port gives them.
fn measure(name: &str, mode: ApiMode, bytes: &[u8]) {
    let (mut decoder, mut frames) = (Decoder::new(mode), 0_u64);
    let best = (0..7).map(|_| {
        let start = Instant::now();
        for piece in bytes.chunks(64) {
            decoder.take(black_box(piece), |frame| {
                black_box(frame);
                frames += 1;
            });
        }
        start.elapsed()
    });
    let best_s = best.min().unwrap_or_default().as_secs_f64();
    let rate = bytes.len() as f64 / 1e6 / best_s;
    println!("{name:<36} {rate:>9.1} MB/s, {frames} frames");
}

fn main() {
    for mode in [ApiMode::Plain, ApiMode::Escaped] {
        let mut beacons = Vec::new();
        for number in 0..100_000_u32 {
            let payload: Vec<u8> = (0..72_u32)
                .map(|index| (number.wrapping_mul(31) ^ (index * 37)) as u8)
                .collect();
            let frame = Frame::Receive16 {
                from: 2,
                rssi_dbm: -61,
                options: 2,
                payload: &payload,
            };
            encode(&frame, mode, &mut beacons).expect("it is short enough");
        }
        measure(&format!("beacons, {mode:?}"), mode, &beacons);
        // Each looks like the beginning of a frame of 126 bytes.
        let beginnings = [0x7E, 0x00].repeat(1_000_000);
        measure(&format!("beginnings alone, {mode:?}"), mode, &beginnings);
    }
}
