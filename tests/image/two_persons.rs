//! Two rovers drive laps around a yard with a wall: both persons inside are found.

use super::score::{correlation, structural_similarity};
use super::world::{SIDE_M, persons, sweep, wall_share, worst_error_m};
use tomoswarm::geom::{Point, Rect};
use tomoswarm::tomo::{ImagingSettings, reconstruct};

fn area() -> Rect {
    Rect::new(Point::new(0.0, 0.0), Point::new(SIDE_M, SIDE_M))
}

/// `cargo bench --bench imaging -- 200` measures the share over many seeds.
#[test]
fn two_persons_behind_a_wall_are_the_two_strongest_peaks() {
    const SEEDS: u64 = 10;
    let errors_m: Vec<f64> = (0..SEEDS)
        .map(|seed| {
            let truth = persons(seed);
            let (empty, now) = (
                sweep(seed, 0, &[], 8).links(),
                sweep(seed, 1, &truth, 8).links(),
            );
            let result =
                reconstruct(&now, Some(&empty), &ImagingSettings::for_change(area())).unwrap();
            let places: Vec<Point> = result.peaks.iter().take(2).map(|peak| peak.at).collect();
            worst_error_m(&places, truth)
        })
        .collect();
    let missed = errors_m.iter().filter(|error_m| **error_m > 1.0).count();
    assert!(missed <= 1, "errors: {errors_m:.2?}");
}

#[test]
fn without_the_empty_sweep_the_wall_is_what_is_seen() {
    let now = sweep(3, 0, &[], 8).links();
    let result = reconstruct(&now, None, &ImagingSettings::for_area(area())).unwrap();
    let law = result.path_loss.unwrap();
    assert!((law.exponent - 2.0).abs() < 0.3, "{law:?}");
    assert!(
        (law.strength_dbm(15.0) - -64.0).abs() < 2.5,
        "{} {law:?}",
        law.strength_dbm(15.0)
    );
    let mean = |x0: f64, y0: f64, x1: f64, y1: f64| {
        let area = Rect::new(Point::new(x0, y0), Point::new(x1, y1));
        let inside: Vec<f64> = (0..result.image.values.len())
            .filter(|pixel| area.contains(result.image.grid.centre(*pixel)))
            .map(|pixel| result.image.values[pixel])
            .collect();
        inside.iter().sum::<f64>() / inside.len() as f64
    };
    let background = mean(9.0, 8.0, 18.0, 18.0);
    assert!(
        mean(6.0, 6.0, 6.5, 12.0) > 8.0 * background.abs(),
        "west wall, {background}"
    );
    assert!(
        mean(7.0, 5.0, 12.0, 5.5) > 8.0 * background.abs(),
        "south wall, {background}"
    );
}

/// The share of the wall in each of 40 by 40 pixels.
fn wall() -> Vec<f64> {
    let pixel_m = SIDE_M / 40.0;
    let at = |index: usize| pixel_m * index as f64;
    (0..1600)
        .map(|k| wall_share(Point::new(at(k % 40), at(k / 40)), pixel_m))
        .collect()
}

#[test]
fn the_image_of_the_structure_looks_like_the_wall() {
    let truth = wall();
    for seed in [3, 4, 5] {
        let now = sweep(seed, 0, &[], 8).links();
        let image = reconstruct(&now, None, &ImagingSettings::for_area(area()))
            .unwrap()
            .image;
        let (alike, similar) = (
            correlation(&image.values, &truth),
            structural_similarity(&image.values, &truth, 40),
        );
        println!("seed {seed}: correlation {alike:.3}, similarity {similar:.3}");
        assert!(
            alike > 0.5 && similar > 0.6,
            "seed {seed}: correlation {alike:.3}, similarity {similar:.3}"
        );
    }
}
