//! What all solvers promise, most of all those of non-negative images.

use super::*;
use crate::geom::PixelGrid;
use crate::geom::{Point, Rect, Segment};
use crate::tomo::tests_support::Noise;
use crate::tomo::{
    Covariance, Find, FindSettings, ImagingSettings, MapProblem, MapSettings, Prior,
};

const AREA: Rect = Rect {
    min: Point::new(0.0, 0.0),
    max: Point::new(20.0, 20.0),
};
const GRID: PixelGrid = PixelGrid {
    area: AREA,
    columns: 20,
    rows: 20,
};

/// Links between the places of a ring, 2 m apart.
fn segments() -> Vec<Segment> {
    let at = |k: usize| match (k / 10, 2.0 * (k % 10) as f64) {
        (0, s) => Point::new(s, 0.0),
        (1, s) => Point::new(20.0, s),
        (2, s) => Point::new(20.0 - s, 20.0),
        (_, s) => Point::new(0.0, 20.0 - s),
    };
    (0..40)
        .flat_map(|i| (0..i).map(move |j| Segment::new(at(i), at(j))))
        .filter(|link| {
            let (along_x, along_y) = (link.vector().x_m.abs(), link.vector().y_m.abs());
            along_x > 1.0 && along_y > 1.0
        })
        .collect()
}

fn rows_of(segments: &[Segment]) -> WeightRows {
    let model = ImagingSettings::for_area(AREA).fresnel();
    WeightRows::rescaled(segments.iter().copied(), &GRID, model)
}

/// An image that is zero but on a rectangle of pixels.
fn block(columns: std::ops::Range<usize>, rows: std::ops::Range<usize>, value: f64) -> Vec<f64> {
    let is_inside = |pixel: usize| {
        columns.contains(&(pixel % GRID.columns)) && rows.contains(&(pixel / GRID.columns))
    };
    (0..GRID.len())
        .map(|pixel| if is_inside(pixel) { value } else { 0.0 })
        .collect()
}

/// What the links show of an image, with noise.
fn observed(segments: &[Segment], image: &[f64], sd_db: f64, seed: u64) -> Vec<Observation> {
    let mut straight_db = vec![0.0; segments.len()];
    rows_of(segments).forward(image, &mut straight_db);
    let mut noise = Noise::new(seed);
    segments
        .iter()
        .zip(straight_db)
        .map(|(link, db)| Observation {
            from: link.from,
            to: link.to,
            attenuation_db: response::shown(db).attenuation_db + sd_db * noise.normal(),
            variance_db2: 1.0,
            packets: 10,
            misses: 0,
            is_at_floor: false,
        })
        .collect()
}

fn relative_error(image: &[f64], truth: &[f64]) -> f64 {
    let off = image.iter().zip(truth).map(|(x, t)| (x - t) * (x - t));
    let size: f64 = truth.iter().map(|t| t * t).sum();
    (off.sum::<f64>() / size).sqrt()
}

/// Returns an image.
type Solve = fn(&LinkProblem<'_>) -> Vec<f64>;

fn by_variation(problem: &LinkProblem<'_>) -> Vec<f64> {
    variation(problem, &ImagingSettings::candidates_for(AREA)).image
}

fn by_sparse(problem: &LinkProblem<'_>) -> Vec<f64> {
    let sparse = Sparse {
        prior: Prior {
            variance: 30.0,
            length_m: 1.0,
        },
        sparsity: 0.1,
    };
    non_negative(problem, sparse).image
}

fn by_auto(problem: &LinkProblem<'_>) -> Vec<f64> {
    auto(problem, &ImagingSettings::candidates_for(AREA), None).image
}

/// Most probable under a wide prior, to the last digit that the tests can see.
fn by_map(problem: &LinkProblem<'_>) -> Vec<f64> {
    let prior = Prior {
        variance: 30.0,
        length_m: 1.0,
    };
    let observations = problem.observations.iter();
    let (attenuation_db, variance_db2): (Vec<f64>, Vec<f64>) = observations
        .map(|one| (one.attenuation_db, 1e-3 * one.variance_db2))
        .unzip();
    let settings = MapSettings {
        student_degrees: None,
        reweightings: 0,
        tolerance: 1e-10,
        most_steps: 3_000,
    };
    let map = MapProblem {
        rows: problem.projector.rows(),
        covariance: &Covariance::new(&GRID, prior),
        attenuation_db: &attenuation_db,
        variance_db2: &variance_db2,
        nuisance: problem.nuisance,
    };
    map.solve(settings, None).image
}

const ALL: [(&str, Solve); 4] = [
    ("tv", by_variation),
    ("nn", by_sparse),
    ("auto", by_auto),
    ("map", by_map),
];

fn solve(solve: Solve, segments: &[Segment], observations: &[Observation]) -> Vec<f64> {
    let rows = rows_of(segments);
    let projector = Projector::of(&rows, GRID.len(), KNOWN_TO);
    let problem = LinkProblem {
        projector: &projector,
        boxes: BoxGrid::of_pixels(&GRID),
        observations,
        nuisance: &[],
        watch: Watch::NOBODY,
    };
    solve(&problem)
}

#[test]
fn noise_free_links_give_the_image_back() {
    let segments = segments();
    let truth = block(6..9, 11..15, 1.5);
    let observations = observed(&segments, &truth, 0.0, 0);
    for (name, by) in ALL {
        let image = solve(by, &segments, &observations);
        let error = relative_error(&image, &truth);
        assert!(error < 0.1, "{name}: {error:.3}");
    }
}

#[test]
fn a_wall_that_shows_no_more_than_the_leak_is_seen_as_strong_as_it_is() {
    let segments = segments();
    // 8 m of 6 dB/m along it: 48 dB, of which 30 are shown.
    let truth = block(8..9, 6..14, 6.0);
    let observations = observed(&segments, &truth, 0.0, 0);
    let highest_db = observations.iter().map(|one| one.attenuation_db);
    assert!(highest_db.fold(0.0, f64::max) < 30.0);
    let image = solve(by_variation, &segments, &observations);
    let error = relative_error(&image, &truth);
    assert!(error < 0.15, "{error:.3}");
}

#[test]
fn a_mirrored_or_turned_sweep_gives_the_mirrored_or_turned_image() {
    let segments = segments();
    let mut truth = block(4..7, 11..14, 2.0);
    let more = block(12..18, 3..4, 3.0);
    truth.iter_mut().zip(more).for_each(|(x, more)| *x += more);
    let observations = observed(&segments, &truth, 0.7, 3);
    let mirror: fn(Point) -> Point = |at| Point::new(20.0 - at.x_m, at.y_m);
    let quarter_turn: fn(Point) -> Point = |at| Point::new(20.0 - at.y_m, at.x_m);
    for (name, by) in ALL {
        let image = solve(by, &segments, &observations);
        for moved in [mirror, quarter_turn] {
            let links: Vec<Segment> = segments
                .iter()
                .map(|link| Segment::new(moved(link.from), moved(link.to)))
                .collect();
            let seen: Vec<Observation> = observations
                .iter()
                .map(|one| Observation {
                    from: moved(one.from),
                    to: moved(one.to),
                    ..*one
                })
                .collect();
            let other = solve(by, &links, &seen);
            let pixel_of = |pixel| GRID.pixel_at(moved(GRID.centre(pixel))).unwrap();
            let back: Vec<f64> = (0..GRID.len())
                .map(|pixel| other[pixel_of(pixel)])
                .collect();
            let error = relative_error(&back, &image);
            assert!(error < 1e-6, "{name}: {error:.2e}");
        }
    }
}

#[test]
fn a_link_at_the_floor_says_at_least() {
    let segments = segments();
    let truth = block(8..12, 8..12, 4.0);
    let mut observations = observed(&segments, &truth, 0.0, 0);
    // Every other link ends at receivers whose floor hides all beyond 6 dB.
    for one in observations.iter_mut().step_by(2) {
        one.is_at_floor = one.attenuation_db > 6.0;
        one.attenuation_db = one.attenuation_db.min(6.0);
    }
    let told = solve(by_sparse, &segments, &observations);
    let measured = |one: &mut Observation| one.is_at_floor = false;
    observations.iter_mut().for_each(measured);
    let untold = solve(by_sparse, &segments, &observations);
    let (told, untold) = (
        relative_error(&told, &truth),
        relative_error(&untold, &truth),
    );
    assert!(told < 0.2 && untold > 2.0 * told, "{told:.3} {untold:.3}");
}

fn person(at: Point) -> Persons {
    Persons {
        found: vec![Find {
            at,
            strength: 10.0,
            covariance_m2: [0.01, 0.0, 0.01],
            evidence: 40.0,
            probability: 1.0,
        }],
        are_expected: true,
        model: FindSettings::IN_METRES.person,
        ring: AREA,
        smear_m: 0.0,
        grid: GRID,
    }
}

#[test]
fn a_person_is_drawn_as_a_disc_of_its_size() {
    let persons = person(Point::new(7.3, 11.2));
    let mut image = vec![0.0; GRID.len()];
    persons.draw(&mut image);
    let sum: f64 = image.iter().sum();
    let expected = 10.0 * std::f64::consts::PI * 0.3 * 0.3;
    assert!((sum / expected - 1.0).abs() < 0.05, "{sum}");
    assert!(image[11 * 20 + 7] > 2.0);
    assert_eq!(image.iter().filter(|value| **value > 0.0).count(), 2);
}

#[test]
fn auto_draws_the_person_who_is_there_and_not_the_one_who_is_not() {
    let segments = segments();
    let persons = person(Point::new(7.3, 11.2));
    let nobody = observed(&segments, &vec![0.0; GRID.len()], 1.0, 5);
    let cost = persons.taken_out(&nobody);
    let somebody: Vec<Observation> = nobody
        .iter()
        .zip(&cost)
        .map(|(one, without)| Observation {
            attenuation_db: 2.0 * one.attenuation_db - without.attenuation_db,
            ..*one
        })
        .collect();
    let rows = rows_of(&segments);
    let projector = Projector::of(&rows, GRID.len(), KNOWN_TO);
    let choice = |observations: &[Observation]| {
        let problem = LinkProblem {
            projector: &projector,
            boxes: BoxGrid::of_pixels(&GRID),
            observations,
            nuisance: &[],
            watch: Watch::NOBODY,
        };
        let candidates = ImagingSettings::candidates_for(AREA);
        auto(&problem, &candidates, Some(&persons)).choice.unwrap()
    };
    assert_eq!(choice(&somebody).best, Candidate::Points);
    assert_ne!(choice(&nobody).best, Candidate::Points);
    assert_eq!(choice(&somebody), choice(&somebody));
}
