//! Simulated sweeps that others made: the persons are found, and the images are no worse than the reference method.
//!
//! The scores are those of the scoring script beside the data, computed anew in `score`.

use std::fs;
use std::path::{Path, PathBuf};

use super::score::{overlap_by_otsu, relative_error, structural_similarity};
use tomoswarm::cli::recording::read_recording;
use tomoswarm::geom::{Point, Rect};
use tomoswarm::tomo::{ImagingSettings, Link, Solver, reconstruct};

fn phantoms() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/phantoms");
    if !folder.is_dir() {
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: {} is missing\n", folder.display()),
        );
        return None;
    }
    Some(folder)
}

fn links(path: &Path) -> Vec<Link> {
    read_recording(&fs::read(path).unwrap()).unwrap().links
}

fn image_of(folder: &Path, case: &str) -> tomoswarm::tomo::Reconstruction {
    let area = Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0));
    let empty = folder.join(format!("{case}.empty.csv"));
    let now = links(&folder.join(format!("{case}.links.csv")));
    if empty.exists() {
        return reconstruct(
            &now,
            Some(&links(&empty)),
            &ImagingSettings::for_change(area),
        )
        .unwrap();
    }
    reconstruct(&now, None, &ImagingSettings::for_area(area)).unwrap()
}

/// The image by the solver `auto`, with the words of its choice.
fn auto_image_of(folder: &Path, case: &str) -> (Vec<f64>, String) {
    let area = Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0));
    let usual = ImagingSettings::for_area(area);
    let settings = ImagingSettings {
        solver: Solver::Auto(ImagingSettings::candidates_for(area)),
        weights: usual.fresnel(),
        ..usual
    };
    let empty = folder.join(format!("{case}.empty.csv"));
    let empty = empty.exists().then(|| links(&empty));
    let now = links(&folder.join(format!("{case}.links.csv")));
    let made = reconstruct(&now, empty.as_deref(), &settings).unwrap();
    (made.image.values, made.choice.unwrap().words())
}

/// The 1600 values of a truth file: little-endian f32 after the header.
fn truth(path: &Path) -> Vec<f64> {
    let bytes = fs::read(path).unwrap();
    let data = &bytes[bytes.len() - 4 * 1600..];
    data.chunks(4)
        .map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())))
        .collect()
}

/// A number after a key in one line of the reference scores.
fn score(line: &str, key: &str) -> f64 {
    let value: serde_json::Value = serde_json::from_str(line).unwrap();
    value[key].as_f64().unwrap()
}

#[test]
fn images_are_as_good_as_the_reference_method() {
    let Some(folder) = phantoms() else { return };
    let scores = fs::read_to_string(folder.join("BASELINE.jsonl")).unwrap();
    let mut cases = 0;
    for line in scores.lines().filter(|line| line.contains("\"map\"")) {
        let value: serde_json::Value = serde_json::from_str(line).unwrap();
        let case = value["case"].as_str().unwrap();
        if !["l_wall", "building", "blobs"]
            .iter()
            .any(|name| case.starts_with(name))
        {
            continue;
        }
        let result = image_of(&folder, case);
        let truth = truth(&folder.join(format!("{case}.truth.npy")));
        let (error, rel) = (
            relative_error(&result.image.values, &truth),
            score(line, "rel"),
        );
        assert!(
            error <= 1.05 * rel,
            "{case}: error {error:.3}, reference {rel}"
        );
        let (similarity, ssim) = (
            structural_similarity(&result.image.values, &truth, 40),
            score(line, "ssim"),
        );
        assert!(
            similarity >= 0.95 * ssim,
            "{case}: similarity {similarity:.3}, reference {ssim}"
        );
        cases += 1;
    }
    assert!(cases >= 10, "only {cases} cases");
}

#[test]
fn what_auto_chooses_beats_total_variation_of_others() {
    let Some(folder) = phantoms() else { return };
    let reference = fs::read_to_string(folder.join("BASELINE.jsonl")).unwrap();
    for (case, expected, most) in [
        ("two_persons_600_1000", "solver: points", 1.0),
        ("l_wall_1800_1000", "solver: tv", 0.9),
        ("building_1800_1000", "solver: tv", 1.0),
    ] {
        let mut lines = reference.lines();
        let line = lines.find(|line| line.contains(case) && line.contains("\"nntv\""));
        let other = |key: &str| score(line.unwrap(), key);
        let truth = truth(&folder.join(format!("{case}.truth.npy")));
        let (image, words) = auto_image_of(&folder, case);
        assert!(words.starts_with(expected), "{case}: {words}");
        let error = relative_error(&image, &truth);
        assert!(error < most * other("rel"), "{case}: error {error:.3}");
        let overlap = overlap_by_otsu(&image, &truth);
        // Of single seeds the overlap scatters; the bench prints its mean.
        assert!(
            overlap > 0.9 * other("iou_otsu"),
            "{case}: overlap {overlap:.3}"
        );
    }
}

#[test]
fn persons_are_found_within_half_a_metre() {
    let Some(folder) = phantoms() else { return };
    for case in ["person_600", "two_persons_600", "two_persons_1800"] {
        for seed in [1000, 1001] {
            let stem = format!("{case}_{seed}");
            let text = fs::read_to_string(folder.join(format!("{stem}.truth.json"))).unwrap();
            let truth: serde_json::Value = serde_json::from_str(&text).unwrap();
            let persons = truth["persons_m"].as_array().unwrap();
            let found: Vec<Point> = image_of(&folder, &stem)
                .peaks
                .iter()
                .take(persons.len())
                .map(|peak| peak.at)
                .collect();
            let errors_m = persons.iter().map(|person| {
                let at = Point::new(person[0].as_f64().unwrap(), person[1].as_f64().unwrap());
                found
                    .iter()
                    .map(|peak| peak.distance_to(at))
                    .fold(f64::INFINITY, f64::min)
            });
            let mean_m = errors_m.sum::<f64>() / persons.len() as f64;
            assert!(mean_m < 0.5, "{stem}: {mean_m:.2} m off");
        }
    }
}
