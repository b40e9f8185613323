//! How fast and how well two persons behind a wall are found.
//!
//! `cargo bench --bench imaging -- SEEDS [FIRST]`: share of seeds with both persons within 1 m, the worst seeds,
//! and the median times of a cold and of a warm reconstruction, of binning a packet, of steps of the total variation, and of
//! drafts from as many links as eight vehicles have, with what finds and deviation add to them and what `auto` takes.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "../tests/image/world/mod.rs"]
mod image_world;

use std::time::Instant;

use image_world::{SIDE_M, persons, sweep, worst_error_m};
use tomoswarm::geom::{PixelGrid, Point, Rect, Segment};
use tomoswarm::ground::imager::MOST_BLOCKS;
use tomoswarm::tomo::{
    Candidates, Devices, Extras, Imager, ImagingSettings, Link, LinkBins, Solver,
};
use tomoswarm_proto::VehicleId;

#[expect(clippy::disallowed_methods, reason = "a bench measures time")]
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64() * 1e3)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn main() {
    let numbers: Vec<u64> = std::env::args()
        .skip(1)
        .filter_map(|word| word.parse().ok())
        .collect();
    let seeds = numbers.first().copied().unwrap_or(20);
    let first = numbers.get(1).copied().unwrap_or(0);
    let settings =
        ImagingSettings::for_change(Rect::new(Point::new(0.0, 0.0), Point::new(SIDE_M, SIDE_M)));
    let (mut cold_ms, mut warm_ms, mut links, mut missed) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut errors_m = Vec::new();
    for seed in first..first + seeds {
        let truth = persons(seed);
        let (empty, now) = (
            sweep(seed, 0, &[], 8).links(),
            sweep(seed, 1, &truth, 8).links(),
        );
        let before = sweep(seed, 1, &truth, 7).links();
        let Ok(mut imager) = Imager::new(settings) else {
            return;
        };
        let (result, cold) = timed(|| imager.update(&before, Some(&empty), Extras::default()));
        let (again, warm) = timed(|| imager.update(&now, Some(&empty), Extras::default()));
        let (Ok(_), Ok(result)) = (result, again) else {
            continue;
        };
        let places: Vec<Point> = result.peaks.iter().take(2).map(|peak| peak.at).collect();
        let error_m = worst_error_m(&places, truth);
        errors_m.push(error_m);
        if error_m > 1.0 {
            missed.push(format!(
                "{seed}: {error_m:.1} m, {truth:.1?}, peaks {:.1?}",
                result
                    .peaks
                    .iter()
                    .map(|peak| (peak.at.x_m, peak.at.y_m, peak.significance))
                    .collect::<Vec<_>>()
            ));
        }
        cold_ms.push(cold);
        warm_ms.push(warm);
        links.push(result.used as f64);
    }
    let found = errors_m.iter().filter(|error_m| **error_m <= 1.0).count();
    println!(
        "both persons within 1 m: {found} of {seeds} seeds ({:.1} %)",
        100.0 * found as f64 / seeds as f64
    );
    println!(
        "median error of the worse one: {:.2} m; median links: {}",
        median(errors_m),
        median(links)
    );
    println!(
        "median time: cold {:.1} ms (7 laps), warm {:.1} ms (8 laps)",
        median(cold_ms),
        median(warm_ms)
    );
    missed.iter().for_each(|line| println!("missed {line}"));
    bin_packets();
    vary();
    draft();
}

/// Returns the ends of a link across the area, one for each number.
fn across(k: usize) -> (Point, Point) {
    let at = |k: usize, turn: f64| {
        let share = (k as f64 * turn).fract() * SIDE_M;
        match k % 4 {
            0 => Point::new(share, 0.0),
            1 => Point::new(SIDE_M, share),
            2 => Point::new(share, SIDE_M),
            _ => Point::new(0.0, share),
        }
    };
    (at(k, 0.618_034), at(k + 1 + k / 4 % 3, 0.414_214))
}

/// Prints how many drafts a second there are while eight vehicles sweep: `map`, 40 x 40 pixels, warm; of fixed ends, and of driven
/// ones, which the empty sweep has to be kriged for. From one draft to the next a tenth of the links have heard something, or
/// 100, which is what eight vehicles hear in more than a second.
fn draft() {
    for every in [Some(10), None] {
        draft_of("fixed", every, |_, _| 0.0);
        draft_of("driven", every, |k, sweep| {
            0.3 * ((k + 31 * sweep) as f64 * 0.569_840).fract()
        });
    }
}

/// `moved_m`: by how much the ends of a link lie elsewhere in a sweep.
fn draft_of(ends: &str, every: Option<usize>, moved_m: impl Fn(usize, usize) -> f64) {
    let settings =
        ImagingSettings::for_change(Rect::new(Point::new(0.0, 0.0), Point::new(SIDE_M, SIDE_M)));
    let person = Point::new(7.0, 8.0);
    // In sweep 0 nobody stands there; in the others a link has heard something since the one before when it has moved.
    let link = |k: usize, sweep: usize, noise: usize, loss_db: f64| {
        let (from, to) = across(k);
        let moved_m = moved_m(k, sweep);
        let slid = |at: Point| match at.y_m {
            0.0 | SIDE_M => Point::new((at.x_m + moved_m).min(SIDE_M), at.y_m),
            _ => Point::new(at.x_m, (at.y_m + moved_m).min(SIDE_M)),
        };
        let (from, to) = (slid(from), slid(to));
        let way = Segment::new(from, to);
        let free_dbm = -40.0 - 20.0 * way.length_m().max(0.5).log10();
        let noise_db = ((noise as f64 * 0.754_877).fract() - 0.5) * 5.0;
        let lost_db = loss_db * f64::from(way.distance_to_point(person) < 0.4);
        Link {
            spots: if moved_m > 0.0 { 4 } else { 1 },
            ..Link::fixed(from, to, 8, free_dbm + noise_db - lost_db)
        }
    };
    for links in [3_000, 7_000, 14_000] {
        let empty: Vec<Link> = (0..links).map(|k| link(k, 0, k + 1, 0.0)).collect();
        let Ok(mut imager) = Imager::new(settings) else {
            return;
        };
        let every = every.unwrap_or(links / 100);
        let mut ms = Vec::new();
        let swept = |image: usize| -> Vec<Link> {
            let heard = |k: usize| usize::from(k % every < image);
            (0..links)
                .map(|k| link(k, 1 + heard(k), k + 2 + heard(k), 6.0))
                .collect()
        };
        for image in 0..8 {
            let now = swept(image);
            let (made, took) = timed(|| imager.update(&now, Some(&empty), Extras::default()));
            if made.is_ok() {
                ms.push(took);
            }
        }
        let cold = ms.remove(0);
        println!(
            "draft by map, 40 x 40 pixels, {links} links, ends {ends}, 1 in {every} has heard something: cold {cold:.0} ms, warm {:.0} ms, {:.1} images a second",
            median(ms.clone()),
            1e3 / median(ms)
        );
        print_beyond(&mut imager, &swept(8), &empty);
    }
}

/// Prints what finds and the deviation add to a warm draft, and how long the image takes that a sweep ends with.
fn print_beyond(imager: &mut Imager, now: &[Link], empty: &[Link]) {
    let mut draft_ms = |extras: Extras| {
        let took = (0..3).map(|_| timed(|| imager.update(now, Some(empty), extras)).1);
        median(took.collect())
    };
    let persons = Extras {
        persons: true,
        ..Extras::default()
    };
    let deviation = Extras {
        deviation: Some(MOST_BLOCKS),
        ..Extras::default()
    };
    let [alone_ms, persons_ms, deviation_ms] =
        [Extras::default(), persons, deviation].map(&mut draft_ms);
    let area = Rect::new(Point::new(0.0, 0.0), Point::new(SIDE_M, SIDE_M));
    let by = |solver: Solver| {
        let settings = ImagingSettings::for_change(area);
        let settings = ImagingSettings {
            solver,
            weights: settings.fresnel(),
            ..settings
        };
        let made = || Imager::new(settings)?.update(now, Some(empty), Extras::default());
        timed(made).1
    };
    let auto_ms = by(Solver::Auto(ImagingSettings::candidates_for(area)));
    let sparse_ms = by(Solver::NonNegative(ImagingSettings::sparse_for(area)));
    println!(
        "  beyond it: finds {:.0} ms, deviation {:.0} ms; from nothing by auto {auto_ms:.0} ms, by nn alone {sparse_ms:.0} ms",
        persons_ms - alone_ms,
        deviation_ms - alone_ms
    );
}

/// Prints what steps of the total variation cost on a fine grid, the making of the rows included.
fn vary() {
    let area = Rect::new(Point::new(0.0, 0.0), Point::new(SIDE_M, SIDE_M));
    let link = |k: usize| {
        let (from, to) = across(k);
        Link::fixed(from, to, 4, -70.0)
    };
    let links: Vec<Link> = (0..2_000).map(link).collect();
    let candidates = ImagingSettings::candidates_for(area);
    let settings = ImagingSettings {
        grid: PixelGrid {
            area,
            columns: 200,
            rows: 200,
        },
        solver: Solver::Variation(Candidates {
            variations: [candidates.variations[0]; 3],
            ..candidates
        }),
        weights: ImagingSettings::for_area(area).fresnel(),
        ..ImagingSettings::for_area(area)
    };
    let (made, ms) = timed(|| tomoswarm::tomo::reconstruct(&links, None, &settings));
    if let Ok(made) = made {
        println!(
            "total variation, 200 x 200 pixels, {} links: {ms:.0} ms for 480 steps and all else, {:.0} ms for 20 steps",
            made.used,
            ms / 24.0
        );
    }
}

/// Prints what binning a packet costs.
fn bin_packets() {
    let links: Vec<Link> = sweep(0, 0, &[], 8).links();
    let mut bins = LinkBins::default();
    let (transmitter, receiver) = (VehicleId(1), VehicleId(2));
    let devices = Devices {
        transmitter,
        receiver,
    };
    let ((), ms) = timed(|| {
        for round in 0..30 {
            links
                .iter()
                .for_each(|link| bins.record(devices, link.from, link.to, Some(-60 - round)));
        }
    });
    println!(
        "binning: {:.2} us a packet",
        1e3 * ms / (30.0 * links.len() as f64)
    );
}
