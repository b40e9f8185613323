//! Measures what a scan costs the map, and a tile the wire. Run: `cargo bench --bench map`.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use tomoswarm::geom::{Angle, Lattice, Point, Segment};
use tomoswarm::map::{CellRect, Mapper, Merged, OwnDisc, PeerBody, ScanReading};
use tomoswarm::plan::{Corridor, RequiredClearance};
use tomoswarm_proto::{Boot, LayerId, Message, TileReport, VehicleId, codec};

const SCANS: usize = 60_000;

fn main() {
    let mut fresh_us: Vec<f64> = (0..5).map(|_| drive(|_, _| 0.0).0).collect();
    println!(
        "record, on the move:      {:.2} us a scan",
        median(&mut fresh_us)
    );
    let mut released_us: Vec<f64> = (0..5).map(|_| drive(release).1).collect();
    println!(
        "view and release of 4 m:  {:.2} us a question",
        median(&mut released_us)
    );
    let scanned = tile_of(&drive(|_, _| 0.0).2);
    let worst = TileReport {
        cells: Arc::new(std::array::from_fn(|index| (index % 7) as i8)),
        ..scanned.clone()
    };
    for (name, tile) in [("scanned tile", scanned), ("worst tile", worst)] {
        let (bytes, encode_us, decode_us) = wire(&Message::Tile(tile));
        println!(
            "{name:<24}  {bytes} bytes, encoded in {encode_us:.2} us, decoded in {decode_us:.2} us"
        );
    }
}

/// Returns the tile that takes the most bytes.
fn tile_of(map: &Merged) -> TileReport {
    let reports = map
        .layers()
        .flat_map(|(id, layer)| layer.tiles().map(move |(at, tile)| tile.report(id, at)));
    let bytes = |tile: &TileReport| {
        codec::encode(&Message::Tile(tile.clone())).map_or(0, |frame| frame.len())
    };
    reports
        .max_by_key(bytes)
        .unwrap_or_else(|| panic!("the drive left no tile"))
}

/// Returns the bytes of a message, and the time to write and to read it, µs.
fn wire(message: &Message) -> (usize, f64, f64) {
    let frame = codec::encode(message).unwrap_or_else(|error| panic!("{error}"));
    let timed = |work: &dyn Fn()| {
        let mut runs_us: Vec<f64> = (0..20)
            .map(|_| {
                let start = Instant::now();
                (0..1000).for_each(|_| work());
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        median(&mut runs_us)
    };
    let encode_us = timed(&|| drop(black_box(codec::encode(black_box(message)))));
    let decode_us = timed(&|| drop(black_box(codec::decode(black_box(&frame)))));
    (frame.len(), encode_us, decode_us)
}

/// Drives a 10 m ring past walls with a swinging beam; returns µs a scan, µs a question, and the map.
fn drive(mut ask: impl FnMut(&Merged, f64) -> f64) -> (f64, f64, Merged) {
    let own = LayerId {
        vehicle: VehicleId(1),
        boot: Boot(1),
    };
    let mut map = Merged::new(Lattice::new(0.2), Some(own));
    let mut mapper = Mapper::new(own, 0);
    let peer = [Point::new(-4.0, -5.0), Point::new(4.0, -5.0)];
    let (mut scan_us, mut asked) = (0.0, Vec::new());
    for count in 0..SCANS {
        let turn_rad = count as f64 / 1000.0;
        let at = Point::new(5.0 * libm::cos(turn_rad), 5.0 * libm::sin(turn_rad));
        let direction = Angle::from_radians(turn_rad + 1.57 + libm::sin(count as f64 * 0.7));
        let range_m = (count % 3 == 0).then(|| 1.0 + (count % 17) as f64 / 10.0);
        let scan = ScanReading {
            origin: at,
            direction,
            half_width_rad: 0.262,
            range_m,
            max_range_m: 3.0,
            sure_range_m: 3.0,
            min_range_m: 0.1,
            origin_sd_m: 0.0,
        };
        let peers = [PeerBody {
            leg: &peer,
            radius_m: 0.4,
        }];
        let start = Instant::now();
        black_box(mapper.record(&mut map, &scan, OwnDisc { at, radius_m: 0.25 }, &peers));
        scan_us += start.elapsed().as_secs_f64() * 1e6;
        if count % 20 == 0 {
            asked.push(ask(&map, turn_rad));
        }
    }
    (scan_us / SCANS as f64, median(&mut asked), map)
}

/// Asks how much of the next 4 m is released; returns µs.
fn release(map: &Merged, turn_rad: f64) -> f64 {
    let on_ring = |turn_rad: f64| Point::new(5.0 * libm::cos(turn_rad), 5.0 * libm::sin(turn_rad));
    let route: Vec<Point> = (0..5)
        .map(|step| on_ring(turn_rad + 0.2 * f64::from(step)))
        .collect();
    debug_assert!(Segment::new(route[0], route[4]).length_m() < 4.0);
    let start = Instant::now();
    for _ in 0..10 {
        let Some(rect) = CellRect::around(map.lattice(), &route, 0.7) else {
            return 0.0;
        };
        let view = map.view(0, rect);
        black_box(
            Corridor {
                clearance: RequiredClearance::everywhere(0.5),
                ahead_m: 4.0,
            }
            .released(&view, &route, route[0]),
        );
    }
    start.elapsed().as_secs_f64() * 1e5
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
