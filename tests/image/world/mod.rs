//! A small world for tests and benches of imaging: two rovers drive laps around a 20 m square with an L-shaped wall and two
//! persons. Independent of the project's own simulation and of its weights: attenuation is the mean chord of
//! five rays across the Fresnel zone, saturating at 30 dB; fades are Rician and differ from sweep to sweep.

use tomoswarm::geom::{Point, Segment};
use tomoswarm::tomo::{Devices, LinkBins};
use tomoswarm_proto::VehicleId;

/// The two rovers' radios.
const DEVICES: Devices = Devices {
    transmitter: VehicleId(1),
    receiver: VehicleId(2),
};
/// Side of the square, metres.
pub const SIDE_M: f64 = 20.0;
const GAPS: [f64; 8] = [38.0, 36.0, 33.0, 30.0, 26.0, 22.0, 35.0, 28.0];
const PACKETS_PER_LAP: u64 = 3_750;
const PERSON_RADIUS_M: f64 = 0.3;
const PERSON_DB_PER_M: f64 = 10.0;
const WALL_DB_PER_M: f64 = 20.0;
/// The wall: two rectangles (x0, y0, x1, y1), metres.
const WALL: [[f64; 4]; 2] = [[6.0, 5.0, 6.3, 13.0], [6.0, 5.0, 13.0, 5.3]];

/// A pure hash (splitmix64).
pub fn hash(words: &[u64]) -> u64 {
    words.iter().fold(0x9e37_79b9_7f4a_7c15, |state, word| {
        let mut z = (state ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

/// Uniform in (0, 1).
pub fn uniform(words: &[u64]) -> f64 {
    ((hash(words) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}

fn normal_pair(words: &[u64; 6]) -> (f64, f64) {
    let mut other = *words;
    other[5] ^= 0xabcdef;
    let radius = (-2.0 * uniform(words).ln()).sqrt();
    let angle = std::f64::consts::TAU * uniform(&other);
    (radius * angle.cos(), radius * angle.sin())
}

/// Places two persons by the seed: 2 m from the border, 1.5 m from the wall, 3 m apart.
pub fn persons(seed: u64) -> [Point; 2] {
    let place = |person: u64| {
        (0..)
            .map(move |trial| {
                let axis =
                    |axis: u64| 2.0 + (SIDE_M - 4.0) * uniform(&[seed, person, trial, axis, 77]);
                Point::new(axis(0), axis(1))
            })
            .filter(|at| wall_distance_m(*at) >= 1.5)
    };
    let first = place(0).next().unwrap();
    let second = place(1).find(|at| at.distance_to(first) >= 3.0).unwrap();
    [first, second]
}

fn wall_distance_m(at: Point) -> f64 {
    let outside = |[x0, y0, x1, y1]: [f64; 4]| {
        let (dx, dy) = (
            (x0 - at.x_m).max(at.x_m - x1).max(0.0),
            (y0 - at.y_m).max(at.y_m - y1).max(0.0),
        );
        dx.hypot(dy)
    };
    WALL.into_iter().map(outside).fold(f64::INFINITY, f64::min)
}

/// Returns the share of the wall in a square with the given south-west corner.
#[allow(
    dead_code,
    reason = "the bench that shares this world judges places only"
)]
pub fn wall_share(corner: Point, side_m: f64) -> f64 {
    let within =
        |low: f64, high: f64, start: f64| (high.min(start + side_m) - low.max(start)).max(0.0);
    let inside =
        |[x0, y0, x1, y1]: [f64; 4]| within(x0, x1, corner.x_m) * within(y0, y1, corner.y_m);
    // The two rectangles share a corner of 0.3 m by 0.3 m.
    let twice = inside([6.0, 5.0, 6.3, 5.3]);
    (WALL.into_iter().map(inside).sum::<f64>() - twice) / (side_m * side_m)
}

/// Drives the eight laps and records every packet; `sweep` tells the fades of two sweeps apart.
pub fn sweep(seed: u64, sweep: u64, persons: &[Point], laps: usize) -> LinkBins {
    let mut bins = LinkBins::default();
    for (lap, gap) in GAPS.iter().enumerate().take(laps) {
        drive_lap(&mut bins, [seed, sweep, lap as u64], *gap, persons);
    }
    bins
}

fn drive_lap(bins: &mut LinkBins, [seed, sweep, lap]: [u64; 3], gap: f64, persons: &[Point]) {
    let mut blocked_db = 0.0;
    // The gap sways slowly by up to two steps, differently in each lap of each sweep.
    let phase = std::f64::consts::TAU * uniform(&[seed, sweep, lap, 1]);
    let rate = 2.0 + 4.0 * uniform(&[seed, sweep, lap, 2]);
    for packet in 0..PACKETS_PER_LAP {
        let share = packet as f64 / PACKETS_PER_LAP as f64;
        let sway = 1.4 * (phase + rate * share * std::f64::consts::TAU).sin();
        let start = 9.5 * lap as f64;
        let (a, b) = (
            ring(start + 76.0 * share),
            ring(start + 76.0 * share + gap + sway),
        );
        if packet % 4 == 0 {
            blocked_db = attenuation_db(Segment::new(a, b), persons);
        }
        let fade_db = fade_db(seed, sweep, a, b);
        let noise_db = 2.0 * normal_pair(&[seed, sweep, lap, packet, 3, 3]).0;
        let strength_dbm =
            -40.0 - 20.0 * a.distance_to(b).log10() - blocked_db + fade_db + noise_db;
        let heard = (strength_dbm > -95.0).then(|| strength_dbm.round() as i16);
        let block = packet / 150;
        bins.record(
            DEVICES,
            reported(a, [seed, sweep, lap, block, 0]),
            reported(b, [seed, sweep, lap, block, 1]),
            heard,
        );
    }
}

/// The place that a vehicle believes: 5 cm off.
fn reported(at: Point, [seed, sweep, lap, block, vehicle]: [u64; 5]) -> Point {
    let (dx, dy) = normal_pair(&[seed, sweep, lap, block, vehicle, 5]);
    Point::new(at.x_m + 0.05 * dx, at.y_m + 0.05 * dy)
}

/// The border position after a number of steps (76 around), counter-clockwise from the south-west.
fn ring(steps: f64) -> Point {
    let along_m = steps.rem_euclid(76.0) * SIDE_M / 19.0;
    match along_m {
        s if s < SIDE_M => Point::new(s, 0.0),
        s if s < 2.0 * SIDE_M => Point::new(SIDE_M, s - SIDE_M),
        s if s < 3.0 * SIDE_M => Point::new(3.0 * SIDE_M - s, SIDE_M),
        s => Point::new(0.0, 4.0 * SIDE_M - s),
    }
}

/// Rician, K = 8, one fade for each pair of places half a wavelength apart.
fn fade_db(seed: u64, sweep: u64, a: Point, b: Point) -> f64 {
    const K: f64 = 8.0;
    let spot = |metres: f64| (metres / 0.0625).floor() as i64 as u64;
    let places = hash(&[spot(a.x_m), spot(a.y_m), spot(b.x_m), spot(b.y_m)]);
    let (re, im) = normal_pair(&[seed, sweep, places, 0, 0, 9]);
    let scattered = (2.0 * (K + 1.0)).sqrt().recip();
    20.0 * ((K / (K + 1.0)).sqrt() + re * scattered)
        .hypot(im * scattered)
        .max(1e-2)
        .log10()
}

/// Mean over the Fresnel zone (Gauss-Hermite), saturating at 30 dB.
fn attenuation_db(link: Segment, persons: &[Point]) -> f64 {
    const OFFSETS: [(f64, f64); 5] = [
        (-2.857, 0.01126),
        (-1.3556, 0.22208),
        (0.0, 0.53333),
        (1.3556, 0.22208),
        (2.857, 0.01126),
    ];
    let through: f64 = OFFSETS
        .iter()
        .map(|(offset, weight)| weight * chord_db(link, *offset, persons))
        .sum();
    -10.0 * (10f64.powf(-through / 10.0) + 1e-3).log10()
}

/// One ray, bent to pass each shape `offset` half Fresnel radii beside the straight path.
fn chord_db(link: Segment, offset: f64, persons: &[Point]) -> f64 {
    let d_m = link.length_m();
    let beside_m =
        |share: f64| 0.5 * (0.125 * d_m * share * (1.0 - share)).max(0.0).sqrt() * offset;
    let shifted = |share: f64| {
        let by = link.vector().left() * (beside_m(share) / d_m);
        Segment::new(link.from + by, link.to + by)
    };
    let mut sum_db = 0.0;
    for person in persons {
        let ray = shifted(link.nearest_share(*person));
        let miss_m = ray.distance_to_point(*person).min(PERSON_RADIUS_M);
        sum_db +=
            2.0 * (PERSON_RADIUS_M * PERSON_RADIUS_M - miss_m * miss_m).sqrt() * PERSON_DB_PER_M;
    }
    for rectangle in WALL {
        let [x0, y0, x1, y1] = rectangle;
        let ray = shifted(link.nearest_share(Point::new(0.5 * (x0 + x1), 0.5 * (y0 + y1))));
        sum_db += chord_m(ray, rectangle) * WALL_DB_PER_M;
    }
    sum_db
}

fn chord_m(ray: Segment, [x0, y0, x1, y1]: [f64; 4]) -> f64 {
    let along = ray.vector();
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for (start, step, low, high) in [
        (ray.from.x_m, along.x_m, x0, x1),
        (ray.from.y_m, along.y_m, y0, y1),
    ] {
        let (a, b) = ((low - start) / step, (high - start) / step);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (leave - enter).max(0.0) * ray.length_m()
}

/// Returns the larger of the two errors when each person is matched with one of the two places, metres.
pub fn worst_error_m(found: &[Point], truth: [Point; 2]) -> f64 {
    let [a, b] = found[..] else {
        return f64::INFINITY;
    };
    let straight = a.distance_to(truth[0]).max(b.distance_to(truth[1]));
    let crossed = a.distance_to(truth[1]).max(b.distance_to(truth[0]));
    straight.min(crossed)
}
