//! How good the images of simulated sweeps are that others made, beside those of a reference program.
//!
//! `cargo bench --no-default-features --bench phantoms -- FOLDER [FIRST SEEDS]` images every `NAME.links.csv` in a folder
//! by the solver `auto` and prints, for each kind of phantom, relative error, structural similarity and overlap by Otsu's
//! threshold: mean and 95 % interval, those of the reference, and the paired differences. Then how well the deviation of
//! the pixels tells the error of the image: the share of the truth within the 90 % band (the image ± 1.645 deviations), and
//! the correlation of the size of the error with the deviation, means over the images of a kind. With FIRST and SEEDS the
//! phantoms and the reference's scores (`BASELINE.jsonl`) are made before, by the scripts in `../shared/tools/phantoms`;
//! these need a Python with numpy and scipy (`PYTHON=/path/to/python`). Without scripts or folder it says so and does
//! nothing.
//!
//! `… -- FOLDER [FIRST SEEDS] person` looks at phantoms of one person alone (`person_150`, `person_600`), without a reference:
//! the person's place by `points` is the strongest find or, where nobody is found, the best place that did not pass; how
//! often it lies within 0.5 m, how often it is found, and the error in metres.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    dead_code,
    reason = "no product code"
)]

#[path = "../tests/image/score.rs"]
mod score;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use score::{overlap_by_otsu, relative_error, structural_similarity};
use tomoswarm::geom::{Point, Rect};
use tomoswarm::tomo::{Extras, Imager, ImagingSettings, Link, Reconstruction, Solver};

/// The references of the kinds of phantoms.
const REFERENCES: [(&str, &str); 6] = [
    ("two_persons_600", "nntv"),
    ("two_persons_1800", "nntv"),
    ("l_wall_600", "nntv"),
    ("l_wall_1800", "nntv"),
    ("building_1800", "nntv"),
    ("blobs_1800", "nnmap"),
];
const COLUMNS: usize = 40;

/// Relative error, structural similarity, overlap.
type Scores = [f64; 3];

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    let Some(folder) = words.first().map(PathBuf::from) else {
        println!("skipped: no folder is named");
        return;
    };
    let numbers: Vec<u32> = words[1..]
        .iter()
        .filter_map(|word| word.parse().ok())
        .collect();
    let is_of_person = words[1..].iter().any(|word| word == "person");
    if let [first, seeds] = numbers[..]
        && !make(&folder, first, seeds, !is_of_person)
    {
        return;
    }
    let Ok(entries) = fs::read_dir(&folder) else {
        println!("skipped: {} is missing", folder.display());
        return;
    };
    let mut cases: Vec<String> = entries
        .flatten()
        .filter_map(|entry| {
            Some(
                entry
                    .file_name()
                    .to_str()?
                    .strip_suffix(".links.csv")?
                    .to_owned(),
            )
        })
        .collect();
    cases.sort();
    if is_of_person {
        cases.retain(|case| case.starts_with("person_"));
        place_persons(&folder, &cases);
        return;
    }
    let reference = references(&folder);
    let mut kinds: BTreeMap<String, Vec<(Scores, Option<Scores>)>> = BTreeMap::new();
    let mut bands: BTreeMap<String, Vec<[f64; 4]>> = BTreeMap::new();
    let mut seconds = 0.0;
    for case in &cases {
        let start = Instant::now();
        let Some(made) = image_of(
            &folder,
            case,
            Some(Solver::Auto(ImagingSettings::candidates_for(area()))),
        ) else {
            continue;
        };
        seconds += start.elapsed().as_secs_f64();
        let truth = truth(&folder.join(format!("{case}.truth.npy")));
        let scores = scores(&made.image.values, &truth);
        let chosen = made
            .choice
            .as_ref()
            .map_or_else(String::new, |choice| choice.words());
        println!(
            "{case} {:.3} {:.3} {:.3} {chosen}",
            scores[0], scores[1], scores[2]
        );
        let (kind, _) = case.rsplit_once('_').unwrap_or((case, ""));
        let of_map = image_of(&folder, case, None).and_then(|made| band(&made, &truth));
        if let (Some([share, along]), Some([map_share, map_along])) = (band(&made, &truth), of_map)
        {
            let rows = bands.entry(kind.to_owned()).or_default();
            rows.push([share, along, map_share, map_along]);
        }
        let other = reference.get(case).copied();
        kinds
            .entry(kind.to_owned())
            .or_default()
            .push((scores, other));
    }
    println!("{:.2} s an image", seconds / cases.len().max(1) as f64);
    kinds.iter().for_each(|(kind, rows)| print(kind, rows));
    for (kind, rows) in &bands {
        let of = |k: usize| rows.iter().map(|row| row[k]).collect::<Vec<f64>>();
        println!(
            "{kind}: within the 90 % band {:.3}, correlation of error with deviation {:+.3}; of `map` {:.3}, {:+.3}",
            mean(&of(0)),
            mean(&of(1)),
            mean(&of(2)),
            mean(&of(3))
        );
    }
}

/// Says how well the one person of each phantom is placed.
fn place_persons(folder: &Path, cases: &[String]) {
    let mut kinds: BTreeMap<&str, Vec<(f64, bool)>> = BTreeMap::new();
    for case in cases {
        let points = Solver::Points(ImagingSettings::candidates_for(area()).sparse);
        let finds = image_of(folder, case, Some(points)).and_then(|made| made.finds);
        let (Some(finds), Some(person)) = (finds, person_of(folder, case)) else {
            println!("{case}: no image, or no person is told");
            continue;
        };
        let best = finds.found.first().or(finds.next.as_ref());
        let error_m = best.map_or(f64::INFINITY, |find| find.at.distance_to(person));
        let (kind, _) = case.rsplit_once('_').unwrap_or((case, ""));
        let row = (error_m, !finds.found.is_empty());
        kinds.entry(kind).or_default().push(row);
    }
    for (kind, rows) in kinds {
        let mut errors_m: Vec<f64> = rows.iter().map(|(error_m, _)| *error_m).collect();
        errors_m.sort_by(f64::total_cmp);
        let share = |count: usize| count as f64 / rows.len() as f64;
        let near = errors_m.iter().filter(|error_m| **error_m < 0.5).count();
        let found = rows.iter().filter(|(_, is_found)| *is_found).count();
        println!(
            "{kind}: {} phantoms, within 0.5 m {:.3}, found {:.3}, error {:.2} m (median), {:.2} m (95 %)",
            rows.len(),
            share(near),
            share(found),
            errors_m[rows.len() / 2],
            errors_m[rows.len() * 95 / 100]
        );
    }
}

/// Returns where the first person of a phantom stands.
fn person_of(folder: &Path, case: &str) -> Option<Point> {
    let text = fs::read_to_string(folder.join(format!("{case}.truth.json"))).ok()?;
    let truth: serde_json::Value = serde_json::from_str(&text).ok()?;
    let at = |k: usize| truth["persons_m"][0][k].as_f64();
    Some(Point::new(at(0)?, at(1)?))
}

/// Makes phantoms and, if it is wanted, the reference; returns whether that worked.
fn make(folder: &Path, first: u32, seeds: u32, is_scored: bool) -> bool {
    let tools = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/tools/phantoms");
    if !tools.is_dir() {
        println!("skipped: {} is missing", tools.display());
        return false;
    }
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let numbers = (first..first + seeds).map(|seed| seed.to_string());
    let made = Command::new(&python)
        .arg(tools.join("make_phantoms.py"))
        .arg(folder)
        .args(numbers)
        .status();
    let is_made = made.is_ok_and(|status| status.success());
    if is_made && !is_scored {
        return true;
    }
    let scored = Command::new(&python)
        .arg(tools.join("baseline_phantoms.py"))
        .arg(folder)
        .args(["nntv", "nnmap"])
        .output();
    match scored {
        Ok(output) if is_made && output.status.success() => {
            fs::write(folder.join("BASELINE.jsonl"), output.stdout).is_ok()
        }
        _ => {
            println!("skipped: {python} cannot run the scripts (numpy and scipy are needed)");
            false
        }
    }
}

/// Reads the scores of each case by the reference of its kind.
fn references(folder: &Path) -> BTreeMap<String, Scores> {
    let text = fs::read_to_string(folder.join("BASELINE.jsonl")).unwrap_or_default();
    let mut found = BTreeMap::new();
    for line in text.lines() {
        let word = |key: &str| value_of(line, key).map(|text| text.trim_matches('"').to_owned());
        let number = |key: &str| value_of(line, key).and_then(|text| text.parse::<f64>().ok());
        let (Some(case), Some(method)) = (word("case"), word("method")) else {
            continue;
        };
        let is_wanted = REFERENCES
            .iter()
            .any(|(kind, of)| case.starts_with(kind) && *of == method);
        if let (true, Some(rel), Some(ssim), Some(iou)) =
            (is_wanted, number("rel"), number("ssim"), number("iou_otsu"))
        {
            found.insert(case, [rel, ssim, iou]);
        }
    }
    found
}

/// Returns the text of a value in a line of JSON without nesting.
fn value_of<'a>(line: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = line.split_once(&format!("\"{key}\":"))?;
    Some(rest.split([',', '}']).next()?.trim())
}

fn area() -> Rect {
    Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0))
}

fn links(path: &Path) -> Option<Vec<Link>> {
    let text = fs::read_to_string(path).ok()?;
    let link = |line: &str| {
        let n: Vec<f64> = line
            .split(',')
            .filter_map(|word| word.parse().ok())
            .collect();
        let [x0, y0, x1, y1, packets, dbm] = n[..] else {
            return None;
        };
        Some(Link::fixed(
            Point::new(x0, y0),
            Point::new(x1, y1),
            packets as u32,
            dbm,
        ))
    };
    text.lines().skip(1).map(link).collect()
}

/// Makes an image, by the solver `map` as it is by default unless another one is given.
fn image_of(folder: &Path, case: &str, solver: Option<Solver>) -> Option<Reconstruction> {
    let now = links(&folder.join(format!("{case}.links.csv")))?;
    let empty = links(&folder.join(format!("{case}.empty.csv")));
    let of_map = match empty {
        Some(_) => ImagingSettings::for_change(area()),
        None => ImagingSettings::for_area(area()),
    };
    let settings = solver.map_or(of_map, |solver| ImagingSettings {
        solver,
        weights: of_map.fresnel(),
        ..of_map
    });
    let extras = Extras {
        persons: true,
        deviation: Some(COLUMNS * COLUMNS),
        ..Extras::default()
    };
    let mut imager = Imager::new(settings).ok()?;
    imager.update(&now, empty.as_deref(), extras).ok()
}

/// Returns the share of the truth that lies within the 90 % band, and the correlation of the size of the error with the
/// deviation.
fn band(made: &Reconstruction, truth: &[f64]) -> Option<[f64; 2]> {
    let sd = made.deviation.as_ref()?;
    let errors = made.image.values.iter().zip(truth);
    let errors: Vec<f64> = errors.map(|(own, true_)| (own - true_).abs()).collect();
    let within = errors
        .iter()
        .zip(sd)
        .filter(|(error, sd)| **error <= 1.645 * **sd);
    Some([
        within.count() as f64 / errors.len() as f64,
        correlation(&errors, sd),
    ])
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let product = |x: &[f64], y: &[f64]| {
        let (x_mean, y_mean) = (mean(x), mean(y));
        x.iter()
            .zip(y)
            .map(|(x, y)| (x - x_mean) * (y - y_mean))
            .sum::<f64>()
    };
    product(a, b) / (product(a, a) * product(b, b)).sqrt()
}

/// The values of a truth file: little-endian f32 after the header.
fn truth(path: &Path) -> Vec<f64> {
    let bytes = fs::read(path).unwrap_or_default();
    let data = &bytes[bytes.len().saturating_sub(4 * COLUMNS * COLUMNS)..];
    let (values, _) = data.as_chunks::<4>();
    values
        .iter()
        .map(|b| f64::from(f32::from_le_bytes(*b)))
        .collect()
}

fn scores(image: &[f64], truth: &[f64]) -> Scores {
    [
        relative_error(image, truth),
        structural_similarity(image, truth, COLUMNS),
        overlap_by_otsu(image, truth),
    ]
}

fn print(kind: &str, rows: &[(Scores, Option<Scores>)]) {
    let own = |k: usize| rows.iter().map(|(own, _)| own[k]).collect::<Vec<f64>>();
    let pairs: Vec<(Scores, Scores)> = rows
        .iter()
        .filter_map(|(own, other)| Some((*own, (*other)?)))
        .collect();
    println!(
        "{kind}: {} images, {} with a reference",
        rows.len(),
        pairs.len()
    );
    for (k, name) in ["rel", "SSIM", "IoU-Otsu"].into_iter().enumerate() {
        let other: Vec<f64> = pairs.iter().map(|(_, other)| other[k]).collect();
        let apart: Vec<f64> = pairs.iter().map(|(own, other)| own[k] - other[k]).collect();
        let ratio = mean(&pairs.iter().map(|(own, _)| own[k]).collect::<Vec<f64>>()) / mean(&other);
        println!(
            "  {name:8} {:.3} ± {:.3}, reference {:.3} ± {:.3}, difference {:+.3} ± {:.3}, ratio {ratio:.3}",
            mean(&own(k)),
            interval(&own(k)),
            mean(&other),
            interval(&other),
            mean(&apart),
            interval(&apart),
        );
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Half the 95 % interval of the mean.
fn interval(values: &[f64]) -> f64 {
    let (mean, count) = (mean(values), values.len() as f64);
    let squares: f64 = values
        .iter()
        .map(|value| (value - mean) * (value - mean))
        .sum();
    1.96 * (squares / (count - 1.0) / count).sqrt()
}
