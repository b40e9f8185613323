//! What holds of images of whatever links, by whatever solver, the calibration with an empty sweep included.

use proptest::prelude::*;

use super::*;
use crate::geom::Rect;
use crate::tomo::tests_support::Noise;

const AREA: Rect = Rect {
    min: Point::new(0.0, 0.0),
    max: Point::new(12.0, 12.0),
};
const LINKS: usize = 240;

/// Settings of a solver for a coarse image of the area.
fn settings(choose: impl FnOnce(&mut ImagingSettings)) -> ImagingSettings {
    let mut settings = ImagingSettings::for_change(AREA);
    (settings.grid.columns, settings.grid.rows) = (16, 16);
    choose(&mut settings);
    if settings.solver.is_non_negative() {
        settings.weights = settings.fresnel();
    }
    settings
}

/// All solvers, with their names.
fn all() -> [(&'static str, ImagingSettings); 7] {
    let sparse = ImagingSettings::sparse_for(AREA);
    let candidates = ImagingSettings::candidates_for(AREA);
    [
        ("map", settings(|_| ())),
        (
            "tikhonov",
            settings(|of| of.solver = ImagingSettings::tikhonov_for(AREA)),
        ),
        ("tsvd", settings(|of| of.solver = Solver::TSVD)),
        (
            "tv",
            settings(|of| of.solver = Solver::Variation(candidates)),
        ),
        ("nn", settings(|of| of.solver = Solver::NonNegative(sparse))),
        ("points", settings(|of| of.solver = Solver::Points(sparse))),
        ("auto", settings(|of| of.solver = Solver::Auto(candidates))),
    ]
}

/// A sweep with ends that were driven anywhere along the sides, with somebody inside or nobody.
fn sweep(seed: u64, person: Option<Point>) -> Vec<Link> {
    let mut noise = Noise::new(seed);
    let mut links = Vec::new();
    while links.len() < LINKS {
        let mut end = || {
            let along_m = 12.0 * noise.uniform();
            match (4.0 * noise.uniform()) as u8 {
                0 => Point::new(along_m, 0.0),
                1 => Point::new(12.0, along_m),
                2 => Point::new(along_m, 12.0),
                _ => Point::new(0.0, along_m),
            }
        };
        let (from, to) = (end(), end());
        let length_m = from.distance_to(to);
        if length_m < 3.0 {
            continue;
        }
        let along = (to - from) * (1.0 / length_m);
        let loss_db = person.map_or(0.0, |at| {
            let off = at - from;
            let beside_m = (off.y_m * along.x_m - off.x_m * along.y_m).abs();
            10.0 * 2.0 * (0.09 - beside_m * beside_m).max(0.0).sqrt()
        });
        let level_db = -40.0 - 20.0 * libm::log10(length_m) + 0.7 * noise.normal();
        links.push(Link {
            spots: 8,
            spread_db: 2.0,
            ..Link::fixed(from, to, 20, level_db - loss_db)
        });
    }
    links
}

fn moved_by(moved: fn(Point) -> Point, links: &[Link]) -> Vec<Link> {
    let of = |link: &Link| Link {
        from: moved(link.from),
        to: moved(link.to),
        ..*link
    };
    links.iter().map(of).collect()
}

fn image(
    settings: ImagingSettings,
    now: &[Link],
    empty: &[Link],
    extras: Extras,
) -> Reconstruction {
    let made = Imager::new(settings).and_then(|mut of| of.update(now, Some(empty), extras));
    made.unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    #[test]
    fn a_mirrored_or_turned_sweep_gives_the_mirrored_or_turned_image_and_finds(
        seed in any::<u64>(),
        (x_m, y_m) in (3.0..9.0, 3.0..9.0),
        is_turned in any::<bool>(),
    ) {
        let moved: fn(Point) -> Point = match is_turned {
            true => |at| Point::new(12.0 - at.y_m, at.x_m),
            false => |at| Point::new(12.0 - at.x_m, at.y_m),
        };
        let extras = Extras { persons: true, deviation: Some(256), ..Extras::default() };
        let empty = sweep(seed, None);
        let now = sweep(!seed, Some(Point::new(x_m, y_m)));
        for (name, settings) in all() {
            let here = image(settings, &now, &empty, extras);
            let there = image(settings, &moved_by(moved, &now), &moved_by(moved, &empty), extras);
            let grid = settings.grid;
            let pixel_of = |pixel: usize| grid.pixel_at(moved(grid.centre(pixel))).unwrap();
            let (mut off, mut size) = (0.0, 0.0);
            for pixel in 0..grid.len() {
                let (a, b) = (here.image.values[pixel], there.image.values[pixel_of(pixel)]);
                off += (a - b) * (a - b);
                size += a * a;
            }
            // Solvers end before all digits are known; an image that is empty but for traces has few of them.
            let error = (off / f64::max(size, 1.0)).sqrt();
            prop_assert!(error < 0.01, "{name}: {error:.2e}");
            for pixel in 0..grid.len() {
                let of = |made: &Reconstruction, pixel: usize| made.deviation.as_ref().unwrap()[pixel];
                let (a, b) = (of(&here, pixel), of(&there, pixel_of(pixel)));
                prop_assert!((a / b - 1.0).abs() < 0.01, "{name}: deviations {a} and {b}");
            }
            let (here, there) = (here.finds.unwrap(), there.finds.unwrap());
            prop_assert_eq!(here.found.len(), there.found.len(), "{}", name);
            for (a, b) in here.found.iter().zip(&there.found) {
                let off_m = moved(a.at).distance_to(b.at);
                prop_assert!(off_m < 1e-2, "{name}: {off_m} m");
            }
        }
    }

    #[test]
    fn the_shares_of_any_pixel_sum_to_its_value(
        seed in any::<u64>(),
        pixel in 0_usize..256,
        has_empty in any::<bool>(),
    ) {
        let now = sweep(seed, Some(Point::new(5.0, 7.0)));
        let empty = sweep(!seed, None);
        let extras = Extras { shares_of: Some(pixel), ..Extras::default() };
        let made = Imager::new(settings(|_| ()))
            .and_then(|mut of| of.update(&now, has_empty.then_some(&empty[..]), extras))
            .unwrap();
        let shares = made.shares.unwrap();
        let sum: f64 = shares.links.iter().map(|link| link.share).sum();
        let value = made.image.values[pixel];
        prop_assert!((sum - value).abs() < 1e-8 * (1.0 + value.abs()), "{sum} of {value}");
    }
}
