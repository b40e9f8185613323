//! How few packets of a real recording show who stands there, and how far that stands out.
//!
//! `cargo bench --no-default-features --bench recordings -- FILE.json X,Y`, a JSON recording of two rovers and where
//! somebody stands, in its cells: the error in cells of the strongest peak by `points`, of the first so many percent of the
//! packets in recorded order, without an empty recording; the smallest share from which on it stays within a cell; then, by
//! `tv`, the peak over the larger of the 98th percentile of the image beyond 5 cells and a robust standard deviation
//! (1.4826 times the median size) of the difference of images from the packets of even and of odd numbers.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Error below which somebody counts as found, cells.
const NEAR: f64 = 1.0;
/// Beyond this from the peak is the background, cells.
const AWAY: f64 = 5.0;

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    let [file, place] = &words[..] else {
        println!("skipped: no recording and place are named (FILE.json X,Y)");
        return;
    };
    let at: Vec<f64> = place.split(',').filter_map(|n| n.parse().ok()).collect();
    let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{file}: {error}"));
    let recording: Value =
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{file}: {error}"));
    let packets = recording["packets"].as_array().cloned().unwrap_or_default();
    let folder = std::env::temp_dir().join(format!("recordings-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder for temporary files");

    let mut since = 100;
    for percent in (1..=20).chain([30, 50, 100]) {
        let count = (packets.len() * percent).div_ceil(100);
        let some = with(&recording, packets[..count].to_vec());
        let peak = peak_of(&folder, &some, "points");
        let error = peak.map(|(x, y, _)| (x - at[0]).hypot(y - at[1]));
        match error {
            Some(error) if error <= NEAR => since = since.min(percent),
            _ => since = 100,
        }
        let words = error.map_or("nobody".to_owned(), |error| format!("{error:.2} cells off"));
        println!("first {percent} %: {words}");
    }
    println!("found from the first {since} % of the packets on");

    let parity = |odd: usize| {
        let of = packets.iter().enumerate().filter(|(k, _)| k % 2 == odd);
        with(&recording, of.map(|(_, packet)| packet.clone()).collect())
    };
    let Some((x, y, top)) = peak_of(&folder, &recording, "tv") else {
        println!("`tv` shows nobody");
        return;
    };
    let all = values_of(&folder, &recording, "tv");
    let side = (all.len() as f64).sqrt();
    let size = &recording["size"];
    let cell = |k: usize| size[k].as_f64().unwrap_or(1.0) / side;
    let far = |k: &usize| {
        let (column, row) = ((*k % side as usize) as f64, (*k / side as usize) as f64);
        let (px, py) = ((column + 0.5) * cell(1), (row + 0.5) * cell(0));
        (px - x).hypot(py - y) > AWAY
    };
    let mut beyond: Vec<f64> = (0..all.len()).filter(far).map(|k| all[k]).collect();
    beyond.sort_by(f64::total_cmp);
    let background = beyond[beyond.len() * 98 / 100];
    let halves = [0, 1].map(|odd| values_of(&folder, &parity(odd), "tv"));
    let mut apart: Vec<f64> = halves[0]
        .iter()
        .zip(&halves[1])
        .map(|(a, b)| (a - b).abs())
        .collect();
    apart.sort_by(f64::total_cmp);
    let noise = 1.4826 * apart[apart.len() / 2];
    println!(
        "`tv`: peak {top:.2} dB/cell, ({:.2}, {:.2}) cells off; beyond {AWAY} cells 98 % are at most {background:.4}, halves differ by {noise:.4}; contrast {:.1}",
        (x - at[0]).abs(),
        (y - at[1]).abs(),
        top / background.max(noise)
    );
    let _ = fs::remove_dir_all(&folder);
}

fn with(recording: &Value, packets: Vec<Value>) -> Value {
    let mut some = recording.clone();
    some["packets"] = Value::Array(packets);
    some
}

fn image(folder: &Path, recording: &Value, solver: &str, more: &[&str]) -> Option<String> {
    let path = folder.join("some.json");
    fs::write(&path, recording.to_string()).expect("a temporary file");
    let output = Command::new(env!("CARGO_BIN_EXE_tomoswarm"))
        .arg("image")
        .arg(&path)
        .args(["--solver", solver, "--peaks", "1"])
        .args(more)
        .output()
        .expect("the program");
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Returns the strongest peak: x, y, dB per cell.
fn peak_of(folder: &Path, recording: &Value, solver: &str) -> Option<(f64, f64, f64)> {
    let said = image(folder, recording, solver, &[])?;
    let line = said
        .lines()
        .find_map(|line| line.strip_prefix("peak at ("))?;
    let n: Vec<f64> = line
        .split([',', ')', ':', ' '])
        .filter_map(|word| word.parse().ok())
        .collect();
    Some((*n.first()?, *n.get(1)?, *n.get(2)?))
}

/// Returns the pixels of an image, rows from south to north.
fn values_of(folder: &Path, recording: &Value, solver: &str) -> Vec<f64> {
    let path = folder.join("some.npy");
    let file = path.to_str().expect("a name that is text").to_owned();
    image(folder, recording, solver, &["--npy", &file]).expect("an image");
    let bytes = fs::read(&path).expect("the image that was written");
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let (values, _) = bytes[header..].as_chunks::<4>();
    values
        .iter()
        .map(|four| f64::from(f32::from_le_bytes(*four)))
        .collect()
}
