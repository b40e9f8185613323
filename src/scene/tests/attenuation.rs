//! Attenuation against a fine double integral that knows nothing of Green's theorem.

use super::*;
use crate::geom::Polygon;
use crate::scene::{Attenuation, Person};

const WAVELENGTH_M: f64 = 0.125;
/// Attenuation at which an object usually saturates, because energy leaks around it, dB.
pub(super) const LIMIT_DB: f64 = 30.0;

/// Length inside a union of convex polygons, averaged over the Fresnel zone: at every s the line across the
/// link is cut with each polygon, the cuts are joined, and each takes its share of the normal distribution.
fn fine_m(a: Point, b: Point, polygons: &[Polygon], steps: usize) -> f64 {
    let d = a.distance_to(b);
    let along = (b - a) * (1.0 / d);
    let local: Vec<Vec<(f64, f64)>> = polygons
        .iter()
        .map(|polygon| {
            polygon
                .corners()
                .iter()
                .map(|c| (along.dot(*c - a), along.cross(*c - a)))
                .collect()
        })
        .collect();
    let below = |h: f64, r: f64| libm::erfc(-h / r / std::f64::consts::SQRT_2) / 2.0;
    // The cuts jump at the corners only, so the steps are laid between them; s = d/2 (1 − cos θ) puts more
    // steps near the ends, where the zone is thin.
    let theta_of = |s: f64| (1.0 - 2.0 * s / d).acos();
    let mut marks: Vec<f64> = local
        .iter()
        .flatten()
        .map(|corner| corner.0.clamp(0.0, d))
        .collect();
    marks.extend([0.0, d]);
    marks.sort_by(f64::total_cmp);
    let spans = marks
        .windows(2)
        .map(|pair| (theta_of(pair[0]), theta_of(pair[1])));
    let thetas = spans.filter(|span| span.1 > span.0).flat_map(|(from, to)| {
        let width = (to - from) / steps as f64;
        (0..steps).map(move |step| (from + (step as f64 + 0.5) * width, width))
    });
    let mut sum = 0.0;
    for (theta, width) in thetas {
        let s = d / 2.0 * (1.0 - theta.cos());
        let weight = d / 2.0 * theta.sin() * width;
        let r = 0.5 * (WAVELENGTH_M * s * (d - s) / d).max(1e-18).sqrt();
        let mut cuts: Vec<(f64, f64)> = local
            .iter()
            .filter_map(|corners| cut_across(corners, s))
            .collect();
        cuts.sort_by(|x, y| x.0.total_cmp(&y.0));
        let mut reached = f64::NEG_INFINITY;
        for (low, high) in cuts {
            let low = low.max(reached);
            if high > low {
                sum += weight * (below(high, r) - below(low, r));
                reached = high;
            }
        }
    }
    sum
}

/// Where the line at s crosses a convex polygon.
fn cut_across(corners: &[(f64, f64)], s: f64) -> Option<(f64, f64)> {
    let next = corners.iter().cycle().skip(1);
    let crossed = corners
        .iter()
        .zip(next)
        .filter(|(p, q)| (p.0 > s) != (q.0 > s));
    let heights: Vec<f64> = crossed
        .map(|(p, q)| p.1 + (s - p.0) / (q.0 - p.0) * (q.1 - p.1))
        .collect();
    let low = heights.iter().copied().min_by(f64::total_cmp)?;
    let high = heights.iter().copied().max_by(f64::total_cmp)?;
    Some((low, high))
}

fn saturated(db: f64) -> f64 {
    (-10.0 * (10f64.powf(-db / 10.0) + 1e-3).log10()).max(0.0)
}

fn border(numbers: &mut Sequence) -> Point {
    let along = numbers.within(0.0, 20.0);
    match numbers.below(4) {
        0 => Point::new(along, 0.0),
        1 => Point::new(20.0, along),
        2 => Point::new(along, 20.0),
        _ => Point::new(0.0, along),
    }
}

fn check(attenuation: &Attenuation, a: Point, b: Point, expected_db: f64, tolerance_db: f64) {
    let got = attenuation.between(a, b);
    assert!(
        (got - expected_db).abs() < tolerance_db,
        "{a:?} {b:?}: {got} dB, expected {expected_db} dB"
    );
    assert_eq!(
        attenuation.between(b, a).to_bits(),
        got.to_bits(),
        "not reciprocal"
    );
}

#[test]
fn an_l_wall_agrees_with_a_fine_integral() {
    let attenuation = Attenuation::new(
        &scene_of(courtyard(), 20.0, &[]),
        0.5,
        WAVELENGTH_M,
        LIMIT_DB,
    );
    let arm =
        |x0, y0, x1, y1| crate::geom::Rect::new(Point::new(x0, y0), Point::new(x1, y1)).polygon();
    let wall = [arm(6.0, 5.0, 6.3, 13.0), arm(6.0, 5.0, 13.0, 5.3)];
    let mut numbers = Sequence(2);
    for _ in 0..150 {
        let (a, b) = (border(&mut numbers), border(&mut numbers));
        check(
            &attenuation,
            a,
            b,
            saturated(20.0 * fine_m(a, b, &wall, 600)),
            0.003,
        );
    }
}

#[test]
fn grazing_links_agree_with_a_fine_integral() {
    let attenuation = Attenuation::new(
        &scene_of(courtyard(), 1.0, &[]),
        0.5,
        WAVELENGTH_M,
        LIMIT_DB,
    );
    let arm =
        |x0, y0, x1, y1| crate::geom::Rect::new(Point::new(x0, y0), Point::new(x1, y1)).polygon();
    let wall = [arm(6.0, 5.0, 6.3, 13.0), arm(6.0, 5.0, 13.0, 5.3)];
    for offset in [-0.6, -0.1, -0.01, 0.0, 0.001, 0.1, 0.3, 0.31, 0.5, 2.0] {
        for tilt in [0.0, 1e-6, 0.01, 0.3] {
            for (from, to) in [(0.0, 20.0), (4.9999, 13.0), (8.0, 9.0), (5.0, 20.0)] {
                let (a, b) = (
                    Point::new(6.0 + offset, from),
                    Point::new(6.0 + offset + tilt, to),
                );
                check(
                    &attenuation,
                    a,
                    b,
                    saturated(fine_m(a, b, &wall, 4000)),
                    0.003,
                );
            }
        }
    }
}

#[test]
fn random_heaps_of_boxes_agree_with_a_fine_integral() {
    let mut numbers = Sequence(3);
    for _ in 0..12 {
        let mut body = String::new();
        let mut boxes = Vec::new();
        for _ in 0..5 {
            let (x, y) = (numbers.within(6.0, 14.0), numbers.within(6.0, 14.0));
            let (w, h, turn) = (
                numbers.within(0.1, 4.0),
                numbers.within(0.1, 2.0),
                numbers.within(0.0, 3.0),
            );
            body += &format!(
                "Transform {{ translation {x} {y} 0 rotation 0 0 1 {turn} children Shape {{ geometry Box {{ size {w} {h} 2 }} }} }}\n"
            );
            let corner = |(u, v): &(f64, f64)| {
                let (u, v) = (u * w / 2.0, v * h / 2.0);
                Point::new(
                    x + u * turn.cos() - v * turn.sin(),
                    y + u * turn.sin() + v * turn.cos(),
                )
            };
            boxes.push(Polygon::new(
                [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)]
                    .iter()
                    .map(corner)
                    .collect(),
            ));
        }
        // Weak, so that separate heaps do not saturate and may be summed here.
        let attenuation =
            Attenuation::new(&scene_of(&body, 0.01, &[]), 0.5, WAVELENGTH_M, LIMIT_DB);
        for _ in 0..15 {
            let (a, b) = (border(&mut numbers), border(&mut numbers));
            let expected_m = fine_m(a, b, &boxes, 300);
            let solids_m = attenuation.inside_m(a, b);
            assert!(
                (solids_m - expected_m).abs() * 20.0 < 0.003,
                "{a:?} {b:?}: {solids_m} m, {expected_m} m"
            );
        }
    }
}

/// Every ray bent through a normal offset, each a plain count of points inside.
#[test]
fn the_zone_means_what_it_says() {
    let scene = scene_of("", 0.0, &[person(10.0, 10.0)]);
    let attenuation = Attenuation::new(&scene, 0.5, WAVELENGTH_M, LIMIT_DB);
    let outline = scene.outlines(0.5).remove(0).polygon;
    for y in [10.0, 10.2, 10.4, 10.8] {
        let (steps, mut inside) = (400, 0.0);
        for i in 0..steps * 10 {
            let s = (f64::from(i) + 0.5) * 20.0 / f64::from(steps * 10);
            let r = 0.5 * (WAVELENGTH_M * s * (20.0 - s) / 20.0).sqrt();
            for j in 0..steps {
                let u = (f64::from(j) + 0.5) * 10.0 / f64::from(steps) - 5.0;
                let weight =
                    (-u * u / 2.0).exp() / std::f64::consts::TAU.sqrt() * 10.0 / f64::from(steps);
                if (s - 10.0).abs() < 0.4 && outline.contains(Point::new(s, y + u * r)) {
                    inside += weight * 20.0 / f64::from(steps * 10);
                }
            }
        }
        check(
            &attenuation,
            Point::new(0.0, y),
            Point::new(20.0, y),
            saturated(10.0 * inside),
            0.02,
        );
    }
}

#[test]
fn a_wall_across_the_middle_takes_its_thickness() {
    let wall = |db_per_m| {
        let body =
            "Transform { translation 10 10 1 children Shape { geometry Box { size 0.3 18 2 } } }";
        Attenuation::new(&scene_of(body, db_per_m, &[]), 0.5, WAVELENGTH_M, LIMIT_DB)
    };
    let (a, b) = (Point::new(0.0, 10.0), Point::new(20.0, 10.0));
    check(&wall(20.0), a, b, saturated(6.0), 1e-4);
    check(&wall(500.0), a, b, 30.0, 1e-4);
    check(&wall(0.0), a, b, 0.0, 1e-12);
    check(&wall(20.0), a, a, 0.0, 1e-12);
    check(&wall(20.0), a, Point::new(f64::NAN, 1.0), 0.0, 1e-12);
}

#[test]
fn each_object_saturates_by_itself_and_corners_count_once() {
    let two =
        "Transform { translation 5 10 0 children DEF B Shape { geometry Box { size 0.3 18 2 } } }
        Transform { translation 15 10 0 children USE B }";
    let crossed =
        "Transform { translation 5 10 0 children DEF B Shape { geometry Box { size 0.3 18 2 } } }
        Transform { translation 5.1 10 0 children USE B }";
    let (a, b) = (Point::new(0.0, 10.0), Point::new(20.0, 10.0));
    let of =
        |body: &str| Attenuation::new(&scene_of(body, 300.0, &[]), 0.5, WAVELENGTH_M, LIMIT_DB);
    check(&of(two), a, b, 60.0, 1e-3);
    check(&of(crossed), a, b, 30.0, 1e-3);
    let crossed = Attenuation::new(&scene_of(crossed, 20.0, &[]), 0.5, WAVELENGTH_M, LIMIT_DB);
    check(&crossed, a, b, saturated(20.0 * 0.4), 1e-4);
}

#[test]
fn height_decides_what_stands_in_the_way() {
    let persons = [Person {
        height_m: 1.0,
        ..person(10.0, 10.0)
    }];
    let scene = scene_of(courtyard(), 20.0, &persons);
    let (a, b) = (Point::new(0.0, 10.0), Point::new(20.0, 10.0));
    let at =
        |height_m: f64| Attenuation::new(&scene, height_m, WAVELENGTH_M, LIMIT_DB).between(a, b);
    assert!(at(0.5) > at(1.5) + 2.0 && at(1.5) > 5.0);
    assert_eq!(at(2.0), 0.0);
}

#[test]
fn a_box_written_as_faces_agrees_with_the_box() {
    let faces = "Transform { translation 10 10 1 rotation 0 0 1 0.4 children Shape { geometry IndexedFaceSet {
        coord Coordinate { point [ -1.5 -0.2 -1, 1.5 -0.2 -1, 1.5 0.2 -1, -1.5 0.2 -1, -1.5 -0.2 1, 1.5 -0.2 1, 1.5 0.2 1, -1.5 0.2 1 ] }
        coordIndex [ 3 2 1 0 -1 4 5 6 7 -1 0 1 5 4 -1 1 2 6 5 -1 2 3 7 6 -1 3 0 4 7 -1 ] } } }";
    let solid = "Transform { translation 10 10 1 rotation 0 0 1 0.4 children Shape { geometry Box { size 3 0.4 2 } } }";
    let of = |body: &str| Attenuation::new(&scene_of(body, 20.0, &[]), 0.7, WAVELENGTH_M, LIMIT_DB);
    let (faces, solid) = (of(faces), of(solid));
    let mut numbers = Sequence(5);
    let mut most_db: f64 = 0.0;
    for _ in 0..300 {
        let (a, b) = (border(&mut numbers), border(&mut numbers));
        most_db = most_db.max(solid.between(a, b));
        check(&faces, a, b, solid.between(a, b), 1e-4);
    }
    assert!(most_db > 8.0);
}

#[test]
fn a_hollow_mesh_takes_only_its_shell() {
    let shell = "DEF O Shape { geometry IndexedFaceSet { coord Coordinate { point [
        -2 -2 -2, 2 -2 -2, 2 2 -2, -2 2 -2, -2 -2 2, 2 -2 2, 2 2 2, -2 2 2,
        -1 -1 -1, 1 -1 -1, 1 1 -1, -1 1 -1, -1 -1 1, 1 -1 1, 1 1 1, -1 1 1 ] }
        coordIndex [ 3 2 1 0 -1 4 5 6 7 -1 0 1 5 4 -1 1 2 6 5 -1 2 3 7 6 -1 3 0 4 7 -1 ] } }";
    let attenuation = Attenuation::new(&scene_of(shell, 1.0, &[]), 0.0, WAVELENGTH_M, LIMIT_DB);
    check(
        &attenuation,
        Point::new(-9.0, 0.0),
        Point::new(9.0, 0.0),
        saturated(4.0),
        1e-3,
    );
}

#[test]
fn an_open_sheet_counts_by_the_crossing() {
    let sheet =
        "Shape { geometry IndexedFaceSet { coord Coordinate { point [ 10 0 0, 10 20 0, 10 20 2, 10 0 2 ] }
        coordIndex [ 0 1 2 3 -1 ] } }";
    let attenuation = Attenuation::new(&scene_of(sheet, 20.0, &[]), 0.5, WAVELENGTH_M, LIMIT_DB);
    check(
        &attenuation,
        Point::new(0.0, 10.0),
        Point::new(20.0, 10.0),
        saturated(6.0),
        1e-3,
    );
    check(
        &attenuation,
        Point::new(0.0, 3.0),
        Point::new(20.0, 17.0),
        saturated(6.0),
        1e-3,
    );
    check(
        &attenuation,
        Point::new(0.0, 10.0),
        Point::new(9.0, 10.0),
        0.0,
        1e-9,
    );
    // Through the very end of the sheet: half of the zone meets it.
    check(
        &attenuation,
        Point::new(0.0, 20.0),
        Point::new(20.0, 20.0),
        saturated(3.0),
        1e-3,
    );
}

#[test]
fn odd_links_give_numbers() {
    let scene = scene_of(courtyard(), 20.0, &[person(10.0, 10.0)]);
    let attenuation = Attenuation::new(&scene, 0.5, WAVELENGTH_M, LIMIT_DB);
    let mut numbers = Sequence(6);
    let places = [
        0.0,
        5.0,
        5.3,
        6.0,
        6.3,
        13.0,
        1e-300,
        1e-12,
        6.3 + 1e-15,
        1e6,
        -1e150,
        1e300,
        f64::INFINITY,
    ];
    for _ in 0..20_000 {
        let mut place = || {
            let mut pick = || places[numbers.below(places.len())];
            Point::new(pick(), pick())
        };
        let (a, b) = (place(), place());
        let got = attenuation.between(a, b);
        assert!((0.0..=60.0).contains(&got), "{a:?} {b:?}: {got}");
    }
}
