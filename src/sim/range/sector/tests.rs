//! The exact answer against thousands of rays.

use super::*;
use proptest::prelude::*;

const SECTOR: Sector = Sector {
    slope: 0.268,
    max_m: 4.0,
    facing: 0.5,
};
const RAYS: usize = 4001;

fn straight(from: (f64, f64), to: (f64, f64), body: usize) -> Surface {
    Surface {
        form: Form::Straight(Vector::new(from.0, from.1), Vector::new(to.0, to.1)),
        always_faces: false,
        body: Body::Solid(body),
    }
}

fn round(x_m: f64, y_m: f64, radius_m: f64, body: usize) -> Surface {
    Surface {
        form: Form::Round(Vector::new(x_m, y_m), radius_m),
        always_faces: false,
        body: Body::Solid(body),
    }
}

fn hears_all(_: Body, _: f64, _: f64) -> bool {
    true
}

fn find(surfaces: &[Surface]) -> Option<f64> {
    nearest(&SECTOR, surfaces.iter().copied(), &hears_all).map(|heard| heard.distance_m)
}

/// Distance and cosine at which a ray meets a surface.
fn met(surface: &Surface, slope: f64) -> Option<(f64, f64)> {
    let along = Vector::new(1.0, slope) * (1.0 / (1.0 + slope * slope).sqrt());
    match surface.form {
        Form::Straight(a, b) => {
            let side = b - a;
            let across = along.cross(side);
            let distance_m = a.cross(side) / across;
            let share = a.cross(along) / across;
            let is_met = distance_m > 0.0 && (0.0..=1.0).contains(&share);
            is_met.then(|| (distance_m, across.abs() / side.length_m()))
        }
        Form::Round(centre, radius_m) => {
            let (ahead_m, beside_m) = (along.dot(centre), along.cross(centre));
            let square_m2 = radius_m * radius_m - beside_m * beside_m;
            (ahead_m > 0.0 && square_m2 >= 0.0)
                .then(|| (ahead_m - square_m2.sqrt(), square_m2.sqrt() / radius_m))
        }
    }
}

/// What one ray hears: of the first surface that it meets, if that faces it and `hears` allows.
fn ray(surfaces: &[Surface], slope: f64, hears: &dyn Fn(Body, f64) -> bool) -> Option<f64> {
    let hits = surfaces
        .iter()
        .filter_map(|surface| Some((met(surface, slope)?, surface)));
    let ((distance_m, cosine), surface) = hits.min_by(|a, b| a.0.0.total_cmp(&b.0.0))?;
    let faces = surface.always_faces || cosine >= SECTOR.facing;
    (faces && distance_m <= SECTOR.max_m && hears(surface.body, distance_m)).then_some(distance_m)
}

fn by_rays(surfaces: &[Surface], hears: &dyn Fn(Body, f64) -> bool) -> Option<f64> {
    let slope = |index: usize| SECTOR.slope * (2.0 * index as f64 / (RAYS - 1) as f64 - 1.0);
    (0..RAYS)
        .filter_map(|index| ray(surfaces, slope(index), hears))
        .min_by(f64::total_cmp)
}

#[test]
fn a_thin_pole_between_any_two_rays_is_heard() {
    for step in -100..=100 {
        let beside_m = 2.0 * SECTOR.slope * f64::from(step) / 101.0;
        let pole = round(2.0, beside_m, 0.001, 0);
        let expected = 2f64.hypot(beside_m) - 0.001;
        assert!(
            (find(&[pole]).unwrap() - expected).abs() < 1e-9,
            "{beside_m}"
        );
    }
    assert_eq!(find(&[round(2.0, 0.6, 0.001, 0)]), None);
}

#[test]
fn what_is_met_too_obliquely_is_silent_and_still_hides() {
    let oblique = straight((1.0, -1.0), (2.0, 1.5), 0);
    let grazing = straight((1.0, -0.1), (2.2, 0.1), 1);
    assert!(find(&[oblique]).is_some());
    assert_eq!(find(&[grazing]), None);
    let behind = straight((2.5, -0.01), (2.5, 0.01), 2);
    assert_eq!(find(&[grazing, behind]), None);
    assert!((find(&[behind]).unwrap() - 2.5).abs() < 1e-12);
}

#[test]
fn what_is_too_small_is_silent_and_casts_a_shadow_of_its_width() {
    let pole = round(1.0, 0.0, 0.05, 0);
    let deaf = |body: Body, _: f64, _: f64| body != Body::Solid(0);
    let read = |surfaces: &[Surface]| {
        nearest(&SECTOR, surfaces.iter().copied(), &deaf).map(|heard| heard.distance_m)
    };
    let wall = straight((2.0, -3.0), (2.0, 3.0), 1);
    let (sin, distance_m) = (0.05f64, 2.0);
    // The foot of the perpendicular lies in the shadow: its border is the nearest point left.
    let expected = distance_m / (1.0 - sin * sin).sqrt();
    assert!((read(&[pole, wall]).unwrap() - expected).abs() < 1e-6);
    assert_eq!(read(&[pole, straight((2.0, -0.09), (2.0, 0.09), 1)]), None);
    assert!(read(&[pole, straight((2.0, -0.11), (2.0, 0.09), 1)]).is_some());
}

#[test]
fn no_sound_passes_where_two_pieces_meet() {
    let corner = (1.5, 0.1 / 3.0);
    let front = [
        straight((1.0, -2.0), corner, 0),
        straight(corner, (1.0, 2.0), 0),
    ];
    let silent = |body: Body, _: f64, _: f64| body != Body::Solid(0);
    let wall = straight((3.0, -2.0), (3.0, 2.0), 1);
    let all = front.into_iter().chain([wall]);
    assert_eq!(nearest(&SECTOR, all, &silent), None);
}

#[test]
fn a_pillar_half_in_a_wall_is_heard_before_the_wall() {
    let (wall, pillar) = (
        straight((2.0, -3.0), (2.0, 3.0), 0),
        round(2.0, 0.2, 0.1, 1),
    );
    let expected = 2f64.hypot(0.2) - 0.1;
    assert!((find(&[wall, pillar]).unwrap() - expected).abs() < 1e-9);
}

#[test]
fn what_lies_inside_of_a_silent_pillar_does_not_answer_either() {
    let pillar = round(2.0, 0.0, 0.5, 0);
    let deaf = |body: Body, _: f64, _: f64| body != Body::Solid(0);
    // One lies before the pillar's chord, one crosses it; a third one leaves the pillar towards the sensor.
    for (to, answers) in [
        ((1.7, 0.2), false),
        ((1.95, 0.2), false),
        ((1.4, 0.1), true),
    ] {
        let inside = straight((1.7, -0.2), to, 1);
        let heard = nearest(&SECTOR, [pillar, inside].into_iter(), &deaf);
        assert_eq!(heard.is_some(), answers, "{to:?}");
    }
}

#[test]
fn what_is_farther_at_its_nearest_hides_the_farther_part_of_what_is_nearer() {
    let oblique = Surface {
        always_faces: true,
        ..straight((1.0, -0.25), (1.9, 0.5), 1)
    };
    let deaf = |body: Body, _: f64, _: f64| body == Body::Solid(1);
    let shades = [
        straight((0.9, -0.3), (0.9, -0.1), 0),
        straight((1.1, -0.15), (1.1, 0.05), 0),
    ];
    let all = shades.into_iter().chain([oblique]);
    let heard = nearest(&SECTOR, all, &deaf).unwrap();
    let slope: f64 = 0.05 / 1.1;
    let x_m = (0.25 + 0.75 / 0.9) / (0.75 / 0.9 - slope);
    let expected = x_m * (1.0 + slope * slope).sqrt();
    assert!((heard.distance_m - expected).abs() < 1e-9, "{heard:?}");
}

#[test]
fn a_circle_at_the_edge_is_heard_as_far_as_it_faces_the_sensor() {
    // The edge of the sector passes its middle at so many times its radius.
    let beside_m = |radius_m: f64, share: f64| {
        let stretch = (1.0 + SECTOR.slope * SECTOR.slope).sqrt();
        (share * radius_m * stretch) + SECTOR.slope
    };
    for (cosine, is_heard) in [(0.51f64, true), (0.49, false)] {
        let share = (1.0 - cosine * cosine).sqrt();
        let tower = round(1.0, beside_m(0.25, share), 0.25, 0);
        assert_eq!(find(&[tower]).is_some(), is_heard, "{cosine}");
    }
}

#[test]
fn inside_of_a_circle_the_sensor_hears_itself() {
    let around = round(0.1, 0.0, 0.3, 0);
    assert_eq!(find(&[around]), Some(0.0));
}

fn arbitrary_piece(body: usize) -> impl Strategy<Value = Surface> {
    let place = || (0.05..4.5f64, -1.5..1.5f64);
    prop_oneof![
        3 => (place(), place()).prop_map(move |(a, b)| straight(a, b, body)),
        1 => (place(), 0.002..0.3f64).prop_filter_map("outside", move |((x, y), radius_m)| {
            (x.hypot(y) > radius_m + 0.01).then(|| round(x, y, radius_m, body))
        }),
    ]
}

fn overlap(surfaces: &[Surface]) -> bool {
    let circles: Vec<(Vector, f64)> = surfaces
        .iter()
        .filter_map(|surface| match surface.form {
            Form::Round(centre, radius_m) => Some((centre, radius_m)),
            Form::Straight(..) => None,
        })
        .collect();
    circles.iter().enumerate().any(|(index, one)| {
        circles[..index]
            .iter()
            .any(|other| (one.0 - other.0).length_m() <= one.1 + other.1)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, ..ProptestConfig::default() })]
    #[test]
    fn the_answer_is_what_rays_without_number_would_find(
        surfaces in (1..12usize).prop_flat_map(|count| (0..count).map(arbitrary_piece).collect::<Vec<_>>()),
        radius_of in proptest::collection::vec(0.001..1.0f64, 12),
    ) {
        prop_assume!(!overlap(&surfaces));
        // Small bodies are heard from near only.
        let reach_m = |body: Body| match body {
            Body::Solid(index) => 4.0 * radius_of[index].sqrt(),
            Body::Object(_) | Body::Disc(_) => 0.0,
        };
        let hears = |body: Body, distance_m: f64| distance_m <= reach_m(body);
        let heard = nearest(&SECTOR, surfaces.iter().copied(), &|body, distance_m, _| hears(body, distance_m));
        // Never farther than any ray says.
        if let Some(rays_m) = by_rays(&surfaces, &hears) {
            prop_assert!(heard.is_some_and(|heard| heard.distance_m <= rays_m + 1e-9), "{heard:?} {rays_m}");
        }
        // Never nearer than what is there: a ray a hair to one side meets it.
        if let Some(heard) = heard {
            let tells = |slope: f64| {
                let nearly = |body: Body, distance_m: f64| distance_m <= reach_m(body) + 1e-5;
                ray(&surfaces, slope, &nearly).is_some_and(|ray_m| (ray_m - heard.distance_m).abs() < 1e-5)
            };
            let hairs = [0.0, 3e-10, -3e-10, 1e-8, -1e-8, 1e-7, -1e-7];
            // At the limit of incidence a ray to one side is just too oblique; then the other side says it.
            prop_assert!(hairs.iter().any(|hair| tells(heard.slope + hair)), "{heard:?}");
            prop_assert!(heard.slope.abs() <= SECTOR.slope * (1.0 + 1e-12));
        }
    }
}
