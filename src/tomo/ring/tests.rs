//! Tests of the ring on which links end.

use super::*;

const SIDE_M: f64 = 5.0;

/// A number from -1 to 1, the same for the same `k`.
fn noise(k: u32) -> f64 {
    2.0 * (f64::from(k) * 0.618_034 + 0.5).fract() - 1.0
}

/// Ends along a ring of a size, each moved by up to `jitter_m`.
fn ends(count: u32, (width_m, height_m): (f64, f64), jitter_m: f64) -> Vec<Point> {
    let one = |k: u32| {
        let along_m = f64::from(k) / f64::from(count) * 2.0 * (width_m + height_m);
        let (dx_m, dy_m) = (jitter_m * noise(k), jitter_m * noise(7 * k + 3));
        let (x_m, y_m) = match along_m {
            at if at < width_m => (at, 0.0),
            at if at < width_m + height_m => (width_m, at - width_m),
            at if at < 2.0 * width_m + height_m => (2.0 * width_m + height_m - at, height_m),
            at => (0.0, 2.0 * (width_m + height_m) - at),
        };
        Point::new(x_m + dx_m, y_m + dy_m)
    };
    (0..count).map(one).collect()
}

fn links(ends: &[Point]) -> Vec<Link> {
    let steps = [5, 11, 17];
    let link =
        |(k, step): (usize, usize)| Link::fixed(ends[k], ends[(k + step) % ends.len()], 4, -60.0);
    let all = (0..ends.len()).flat_map(|k| steps.map(|step| (k, step)));
    all.map(link).collect()
}

fn is_near(ring: Rect, (width_m, height_m): (f64, f64), within_m: f64) -> bool {
    let off_m = [
        ring.min.x_m,
        ring.min.y_m,
        ring.max.x_m - width_m,
        ring.max.y_m - height_m,
    ];
    off_m.iter().all(|off_m| off_m.abs() <= within_m)
}

#[test]
fn ends_that_lie_on_a_ring_give_that_ring_exactly() {
    for size in [(20.0, 20.0), (20.0, 10.0), (60.0, 6.0)] {
        let ring = ring_of(links(&ends(96, size, 0.0)).iter()).unwrap();
        assert!(is_near(ring, size, 1e-9), "{size:?}: {ring:?}");
    }
}

#[test]
fn stray_places_and_jitter_move_no_side() {
    for (size, jitter_m) in [
        ((SIDE_M, SIDE_M), 0.2),
        ((20.0, 20.0), 0.2),
        ((20.0, 8.0), 0.3),
    ] {
        let mut places = ends(96, size, jitter_m);
        places[3] = Point::new(-5.0, 2.0);
        places[40] = Point::new(2.0, size.1 + 5.0);
        let ring = ring_of(links(&places).iter()).unwrap();
        assert!(is_near(ring, size, 0.6 * jitter_m), "{size:?}: {ring:?}");
    }
}

#[test]
fn ends_without_sides_are_enclosed() {
    let everywhere: Vec<Point> = (0..90)
        .map(|k| Point::new(10.0 * noise(k), 10.0 * noise(5 * k + 1)))
        .collect();
    let all = links(&everywhere);
    assert_eq!(ring_of(all.iter()), Rect::around(everywhere));
    let pair = [Link::fixed(
        Point::new(0.0, 1.0),
        Point::new(20.0, 20.0),
        4,
        -60.0,
    )];
    let around = Rect::new(Point::new(0.0, 1.0), Point::new(20.0, 20.0));
    assert_eq!(ring_of(pair.iter()), Some(around));
    assert_eq!(ring_of([].iter()), None);
    let one = [Link::fixed(Point::default(), Point::default(), 4, -60.0)];
    assert_eq!(ring_of(one.iter()), Rect::around([Point::default()]));
}

#[test]
fn the_tolerance_follows_how_far_ends_lie_beside_their_side() {
    let ring = Rect::new(Point::default(), Point::new(SIDE_M, SIDE_M));
    let tolerance = |jitter_m: f64| {
        let places = ends(96, (SIDE_M, SIDE_M), jitter_m);
        side_tolerance_m(links(&places).iter(), ring, 0.125)
    };
    assert_eq!(tolerance(0.0), 0.125);
    assert!((0.2..=0.5).contains(&tolerance(0.2)), "{}", tolerance(0.2));
    assert_eq!(tolerance(2.0), 0.5);
    assert_eq!(side_tolerance_m([].iter(), ring, 0.125), 0.125);
    // One link that runs not far from a side makes that side no wider.
    let near = [Link::fixed(
        Point::new(0.0, 0.4),
        Point::new(SIDE_M, 0.4),
        4,
        -60.0,
    )];
    assert_eq!(side_tolerance_m(near.iter(), ring, 0.125), 0.125);
}
