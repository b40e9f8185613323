//! What an image costs that links are added to one by one.
//!
//! `cargo bench --no-default-features --bench streaming -- [WEIGHTS]` with WEIGHTS `inverse-area` (the default) or
//! `fresnel` prints, for some sizes: the time to take all links but the last 40 together, the times from one of those to
//! the new image (median, longest), the memory of the image, and how far it is from the one by conjugate gradients.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::time::Instant;

use tomoswarm::geom::{PixelGrid, Point, Rect, Segment};
use tomoswarm::tomo::{
    Covariance, ImagingSettings, MapProblem, MapSettings, StreamedLink, StreamingMap, WeightRows,
};

const SIDE_M: f64 = 20.0;
const LAST: usize = 40;

fn main() {
    let is_fresnel = std::env::args().any(|word| word == "fresnel");
    for (side, links) in [
        (40, 2_000),
        (40, 14_000),
        (100, 2_000),
        (200, 2_000),
        (200, 4_000),
    ] {
        measure(side, links, is_fresnel);
    }
}

/// Places around the area, no two links alike.
fn links(count: usize) -> Vec<Segment> {
    let at = |k: usize, turn: f64| {
        let share = (k as f64 * turn).fract() * SIDE_M;
        match k % 4 {
            0 => Point::new(share, 0.0),
            1 => Point::new(SIDE_M, share),
            2 => Point::new(share, SIDE_M),
            _ => Point::new(0.0, share),
        }
    };
    let link = |k: usize| Segment::new(at(k, 0.618_034), at(k + 1 + k / 4 % 3, 0.414_214));
    (0..count).map(link).collect()
}

fn measure(side: usize, count: usize, is_fresnel: bool) {
    let area = Rect::new(Point::new(0.0, 0.0), Point::new(SIDE_M, SIDE_M));
    let grid = PixelGrid {
        area,
        columns: side,
        rows: side,
    };
    let settings = ImagingSettings::for_area(area);
    let model = if is_fresnel {
        settings.fresnel()
    } else {
        settings.weights
    };
    let prior = ImagingSettings::prior_for(area);
    let links = links(count);
    let attenuation_db: Vec<f64> = (0..count).map(|k| (k * 29 % 13) as f64 - 3.0).collect();
    let variance_db2: Vec<f64> = (0..count).map(|k| 4.0 + (k % 5) as f64).collect();
    let rows = WeightRows::rescaled(links.iter().copied(), &grid, model);
    let first = WeightRows::rescaled(links[..count - LAST].iter().copied(), &grid, model);

    let start = Instant::now();
    let mut map = StreamingMap::new(&grid, prior, &[]);
    let known = count - LAST;
    let is_added = map.add(
        &first,
        &attenuation_db[..known],
        &variance_db2[..known],
        &[],
    );
    let cold_s = start.elapsed().as_secs_f64();
    let mut times_ms: Vec<f64> = (known..count)
        .map(|row| {
            let start = Instant::now();
            let is_pushed = map.push(StreamedLink {
                rows: &rows,
                row,
                effects: &[],
                attenuation_db: attenuation_db[row],
                variance_db2: variance_db2[row],
            });
            assert!(is_pushed && is_added);
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times_ms.sort_by(f64::total_cmp);
    let problem = MapProblem {
        rows: &rows,
        covariance: &Covariance::new(&grid, prior),
        attenuation_db: &attenuation_db,
        variance_db2: &variance_db2,
        nuisance: &[],
    };
    let start = Instant::now();
    let batch = problem.solve(
        MapSettings {
            student_degrees: None,
            reweightings: 0,
            tolerance: 1e-11,
            most_steps: 2_000,
        },
        None,
    );
    let batch_s = start.elapsed().as_secs_f64();
    let largest = batch
        .image
        .iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()));
    let apart = map
        .image()
        .iter()
        .zip(&batch.image)
        .map(|(a, b)| (a - b).abs());
    println!(
        "{side} x {side} pixels, {count} links of {} weights: {cold_s:.2} s together, then {:.2} ms a link (longest {:.2} ms), {} MB; {:.0e} of {largest:.1} dB/m from conjugate gradients ({batch_s:.2} s)",
        rows.values() / count,
        times_ms[LAST / 2],
        times_ms[LAST - 1],
        map.bytes() / 1_000_000,
        apart.fold(0.0, f64::max),
    );
}
