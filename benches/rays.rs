//! How many rays and readings of a range sensor a second, and how long a radio link takes, on one core.
//!
//! `cargo bench --bench rays`. The bundled environments, and `../shared/data/vrml/castle.wrl` when it is there. Level rays as
//! the range sensor casts them, and rays in all directions from where a vehicle may be. Rates are those of one core that does
//! nothing else, where the system tells how long the bench had one; wall time elsewhere.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use tomoswarm::geom::{Angle, Attitude, Point, Vector};
use tomoswarm::scene::{Attenuation, LevelCut, Material, Person, Scene, SceneParts, Up, read_vrml};
use tomoswarm::sim::noise::Noise;
use tomoswarm::sim::range::{Lobe, RangeModel, RangeSensor, SensorPose, SensorSurroundings};

const RUNS: usize = 9;
const RAYS: usize = 400_000;
const READINGS: usize = 100_000;
const LINKS: usize = 200_000;

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let old_castle = root.join("../shared/data/vrml/castle.wrl");
    match load(&old_castle, Up::Z, &[]) {
        Some(scene) => rays("old castle", &scene, [0.0, 0.0, 4.0], 40.0, 1000.0),
        None => println!("old castle: skipped, {} is not there", old_castle.display()),
    }
    for (name, up) in [("castle", Up::Z), ("trees", Up::Y), ("house", Up::Z)] {
        match load(&root.join(format!("scenes/{name}.wrl")), up, &[]) {
            Some(scene) => {
                rays(name, &scene, [12.0, 12.0, 0.3], 11.5, 1000.0);
                readings(name, &scene, [12.0, 12.0, 0.3], 11.5);
            }
            None => println!("{name}: cannot be read"),
        }
    }
    let persons = [person("one", 8.0, 8.0), person("two", 14.0, 12.0)];
    let Some(scene) = load(&root.join("scenes/courtyard.wrl"), Up::Z, &persons) else {
        println!("courtyard: cannot be read");
        return;
    };
    rays("courtyard", &scene, [10.0, 10.0, 0.5], 9.0, 1000.0);
    links(&scene);
}

fn person(name: &str, x_m: f64, y_m: f64) -> Person {
    Person {
        name: name.into(),
        at: Point::new(x_m, y_m),
        path: Vec::new(),
        radius_m: 0.3,
        height_m: 1.8,
        db_per_m: 10.0,
    }
}

fn load(path: &Path, up: Up, persons: &[Person]) -> Option<Scene> {
    let text = std::fs::read_to_string(path).ok()?;
    let read = read_vrml(&text, &path.display().to_string(), up, &mut |_| {
        Err("none here".into())
    })
    .ok()?;
    let parts = SceneParts {
        shapes: &read.shapes,
        offset_m: [0.0; 3],
        materials: &BTreeMap::new(),
        default_material: Material {
            db_per_m: 20.0,
            db_per_crossing: 6.0,
        },
        posts: &[],
        persons,
    };
    Scene::build(&parts).ok()
}

/// Numbers spread evenly over 0..1 (golden ratio), the same in every run.
fn spread(index: usize, by: f64) -> f64 {
    (index as f64 * by).fract()
}

fn rays(name: &str, scene: &Scene, middle: [f64; 3], span_m: f64, most_m: f64) {
    let ray = |index: usize, is_level: bool| {
        let (sin, cos) = (spread(index, 0.618_033_988_75) * std::f64::consts::TAU).sin_cos();
        let x = middle[0] + span_m * (2.0 * spread(index, 0.754_877_666) - 1.0);
        let y = middle[1] + span_m * (2.0 * spread(index, 0.569_840_291) - 1.0);
        let rise: f64 = if is_level {
            0.0
        } else {
            2.0 * spread(index, 0.819_172_513) - 1.0
        };
        let across = (1.0 - rise * rise).sqrt();
        ([x, y, middle[2]], [cos * across, sin * across, rise])
    };
    for (word, is_level) in [("level", true), ("all-round", false)] {
        let rays: Vec<([f64; 3], [f64; 3])> = (0..RAYS).map(|index| ray(index, is_level)).collect();
        let mut hits = 0;
        let rates = measure(RAYS, || {
            let is_hit = |(origin, direction): &&([f64; 3], [f64; 3])| {
                scene.cast(*origin, *direction, most_m).is_some()
            };
            hits = rays.iter().filter(is_hit).count();
        });
        print_rates(
            &format!("{name}: {RAYS} {word} rays, {hits} hits"),
            "rays/s",
            &rates,
        );
    }
}

/// What a range sensor reads, and for comparison seven level rays, which a fan once was.
fn readings(name: &str, scene: &Scene, middle: [f64; 3], span_m: f64) {
    let start = Instant::now();
    let cut = LevelCut::of(scene, middle[2]);
    println!(
        "{name}: the cut takes {:.2} ms",
        start.elapsed().as_secs_f64() * 1e3
    );
    let eye = |index: usize, pitch_deg: f64| SensorPose {
        origin: [
            middle[0] + span_m * (2.0 * spread(index, 0.754_877_666) - 1.0),
            middle[1] + span_m * (2.0 * spread(index, 0.569_840_291) - 1.0),
            middle[2],
        ],
        attitude: Attitude {
            pitch: Angle::from_degrees(pitch_deg),
            ..Attitude::level(Angle::from_degrees(360.0 * spread(index, 0.618_033_988_75)))
        },
        beam: Angle::ZERO,
    };
    let around = SensorSurroundings {
        scene,
        cut: &cut,
        discs: &[],
    };
    let noise = Noise::new(1);
    for (word, lobe, pitch_deg, count) in [
        ("level fan", Lobe::Fan, 0.0, READINGS),
        ("leaning fan", Lobe::Fan, 3.0, READINGS),
        ("cone", Lobe::Cone, 0.0, READINGS / 10),
    ] {
        let sensor = RangeSensor::new(RangeModel {
            lobe,
            half_angle_rad: 15f64.to_radians(),
            incidence_max_rad: 60f64.to_radians(),
            ..RangeModel::default()
        });
        let mut heard = 0;
        let rates = measure(count, || {
            let is_heard = |index: &usize| {
                let eye = eye(*index, pitch_deg);
                sensor
                    .echo_at(&eye, around, &noise, &[*index as u64])
                    .is_some()
            };
            heard = (0..count).filter(is_heard).count();
        });
        print_rates(
            &format!("{name}: {count} readings, {word}, {heard} heard"),
            "readings/s",
            &rates,
        );
    }
    let mut heard = 0;
    let rates = measure(READINGS, || {
        let is_heard = |index: &usize| {
            let eye = eye(*index, 0.0);
            let mut best_m = None;
            for ray in -3..=3 {
                let turn = eye.attitude.yaw + Angle::from_degrees(5.0 * f64::from(ray));
                let along = Vector::polar(turn, 1.0);
                let along = [along.x_m, along.y_m, 0.0];
                if let Some(hit) = scene.cast(eye.origin, along, best_m.unwrap_or(4.0))
                    && (hit.normal[0] * along[0] + hit.normal[1] * along[1]).abs() >= 0.5
                {
                    best_m = Some(hit.distance_m);
                }
            }
            best_m.is_some()
        };
        heard = (0..READINGS).filter(is_heard).count();
    });
    print_rates(
        &format!("{name}: {READINGS} readings, seven rays, {heard} heard"),
        "readings/s",
        &rates,
    );
}

fn links(scene: &Scene) {
    let attenuation = Attenuation::new(scene, 0.5, 0.125, 30.0);
    let links: Vec<(Point, Point)> = (0..LINKS)
        .map(|index| {
            (
                border(spread(index, 0.618_033_988_75)),
                border(spread(index, 0.754_877_666)),
            )
        })
        .collect();
    let mut sum_db = 0.0;
    let rates = measure(LINKS, || {
        sum_db = links.iter().map(|(a, b)| attenuation.between(*a, *b)).sum()
    });
    let mean = sum_db / LINKS as f64;
    print_rates(
        &format!("courtyard: {LINKS} border links, mean {mean:.3} dB"),
        "links/s",
        &rates,
    );
}

/// A place on the border of the 20 m square.
fn border(share: f64) -> Point {
    let along = 80.0 * share;
    match along {
        _ if along < 20.0 => Point::new(along, 0.0),
        _ if along < 40.0 => Point::new(20.0, along - 20.0),
        _ if along < 60.0 => Point::new(60.0 - along, 20.0),
        _ => Point::new(0.0, 80.0 - along),
    }
}

#[expect(clippy::disallowed_methods, reason = "a bench measures the time")]
fn measure(count: usize, mut work: impl FnMut()) -> Vec<f64> {
    let mut rates: Vec<f64> = (0..RUNS)
        .map(|_| {
            let (start, start_s) = (Instant::now(), on_core_s());
            work();
            let on_core = start_s
                .zip(on_core_s())
                .map(|(start_s, end_s)| end_s - start_s);
            count as f64 / on_core.unwrap_or_else(|| start.elapsed().as_secs_f64())
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    rates
}

/// Time that this thread has had a core so far, seconds, as Linux counts it: what others do on the machine does not
/// count. `None` elsewhere.
fn on_core_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}

fn print_rates(what: &str, unit: &str, rates: &[f64]) {
    let (min, median, max) = (rates[0], rates[rates.len() / 2], rates[rates.len() - 1]);
    println!(
        "{what}: min {min:.3e}, median {median:.3e}, max {max:.3e} {unit} ({:.3} µs each)",
        1e6 / median
    );
}
