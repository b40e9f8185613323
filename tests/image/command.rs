//! The `image` command: what it reads, what it refuses, and that a refusal leaves nothing behind.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

const HEADER: &str = "tx_x_m,tx_y_m,rx_x_m,rx_y_m,packets,rssi_dbm\n";

pub(super) fn tomoswarm(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tomoswarm"))
        .arg("image")
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Links between opposite sides of a 10 m square; a person at (x, y) takes 8 dB.
pub(super) fn sweep(person: Option<(f64, f64)>) -> String {
    let ring: Vec<(f64, f64)> = (0..40)
        .map(|k| match (k / 10, f64::from(k % 10)) {
            (0, s) => (s, 0.0),
            (1, s) => (10.0, s),
            (2, s) => (10.0 - s, 10.0),
            (_, s) => (0.0, 10.0 - s),
        })
        .collect();
    let mut text = HEADER.to_owned();
    for (i, a) in ring.iter().enumerate() {
        for b in &ring[..i] {
            let d = (a.0 - b.0).hypot(a.1 - b.1);
            let beside =
                |(x, y): (f64, f64)| ((b.0 - a.0) * (y - a.1) - (b.1 - a.1) * (x - a.0)).abs() / d;
            let blocked = person.map(beside).is_some_and(|beside| beside < 0.3);
            let rssi = -40.0 - 20.0 * d.log10() - if blocked { 8.0 } else { 0.0 };
            text += &format!("{},{},{},{},4,{rssi:.2}\n", a.0, a.1, b.0, b.1);
        }
    }
    text
}

pub(super) fn folder_with(files: &[(&str, &str)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    files
        .iter()
        .for_each(|(name, text)| fs::write(folder.path().join(name), text).unwrap());
    folder
}

pub(super) fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Runs on a bad file, with all outputs asked for: exit code 2, the words in the message, no new file.
fn check_refused(text: &str, words: &[&str]) {
    let folder = folder_with(&[("bad.csv", text)]);
    let output = tomoswarm(
        folder.path(),
        &[
            "bad.csv", "--json", "o.json", "--npy", "o.npy", "--png", "o.png",
        ],
    );
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    for word in words {
        assert!(message.contains(word), "no {word:?} in {message:?}");
    }
    assert_eq!(names(folder.path()), ["bad.csv"]);
}

#[test]
fn a_person_is_found_and_all_outputs_are_written() {
    let person = (3.3, 6.1);
    let folder = folder_with(&[
        ("now.csv", &sweep(Some(person))),
        ("empty.csv", &sweep(None)),
    ]);
    for empty in [&["--empty", "empty.csv"][..], &[]] {
        let mut arguments = vec![
            "now.csv", "--json", "o.json", "--npy", "o.npy", "--png", "o.png", "--peaks", "2",
        ];
        arguments.extend(empty);
        let output = tomoswarm(folder.path(), &arguments);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let report: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(folder.path().join("o.json")).unwrap())
                .unwrap();
        let peak = |axis: &str| report["peaks"][0][axis].as_f64().unwrap();
        assert!(
            (peak("x") - person.0).hypot(peak("y") - person.1) < 0.3,
            "{report}"
        );
        assert!(report["peaks"].as_array().unwrap().len() <= 2);
        assert!(report["links"]["used"].as_u64().unwrap() > 400);
        assert_eq!(
            fs::metadata(folder.path().join("o.npy")).unwrap().len(),
            128 + 4 * 40 * 40
        );
        assert!(
            fs::read(folder.path().join("o.png"))
                .unwrap()
                .starts_with(b"\x89PNG")
        );
        assert_eq!(
            names(folder.path()),
            ["empty.csv", "now.csv", "o.json", "o.npy", "o.png"]
        );
    }
}

#[test]
fn rows_of_the_values_run_from_south_to_north() {
    let folder = folder_with(&[
        ("now.csv", &sweep(Some((8.0, 2.0)))),
        ("empty.csv", &sweep(None)),
    ]);
    let arguments = [
        "now.csv",
        "--empty",
        "empty.csv",
        "--npy",
        "o.npy",
        "--pixels",
        "10x20",
        "--area",
        "0,0,10,10",
    ];
    assert!(tomoswarm(folder.path(), &arguments).status.success());
    let bytes = fs::read(folder.path().join("o.npy")).unwrap();
    assert!(String::from_utf8_lossy(&bytes[..128]).contains("'shape': (20, 10)"));
    let values: Vec<f32> = bytes[128..]
        .chunks(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect();
    let highest = (0..200)
        .max_by(|a, b| values[*a].total_cmp(&values[*b]))
        .unwrap();
    let (row, column) = (highest / 10, highest % 10);
    assert!(
        (3..=4).contains(&row) && (7..=8).contains(&column),
        "row {row}, column {column}"
    );
}

#[test]
fn files_whose_heads_say_another_area_are_pooled_with_a_warning() {
    let of = |area: &str| format!("# kind = \"links\"\n# area_m = {area}\n{}", sweep(None));
    let (own, other) = (of("[0.0, 0.0, 10.0, 10.0]"), of("[0.0, 0.0, 5.0, 10.0]"));
    let folder = folder_with(&[("a.csv", &own), ("b.csv", &own), ("c.csv", &other)]);
    for (file, is_warned) in [("b.csv", false), ("c.csv", true)] {
        let output = tomoswarm(folder.path(), &["a.csv", file, "--solver", "map"]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        let warning = format!("warning: {file}: its head says another area or [imaging]");
        assert_eq!(said.contains(&warning), is_warned, "{said}");
    }
}

#[test]
fn several_files_are_pooled_and_packets_may_be_missing() {
    let now = sweep(Some((6.0, 4.0)));
    let lines: Vec<&str> = now.lines().skip(1).collect();
    let part = |odd: usize| {
        let without = lines.iter().skip(odd).step_by(2).map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            [&fields[..4], &fields[5..]].concat().join(",")
        });
        format!(
            "tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm\n{}\n",
            without.collect::<Vec<_>>().join("\n")
        )
    };
    let folder = folder_with(&[
        ("a.csv", &part(0)),
        ("b.csv", &part(1)),
        ("empty.csv", &sweep(None)),
    ]);
    let output = tomoswarm(
        folder.path(),
        &["a.csv", "b.csv", "--empty", "empty.csv", "--json", "o.json"],
    );
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("o.json")).unwrap()).unwrap();
    let dropped: u64 = report["links"]["dropped"]
        .as_array()
        .unwrap()
        .iter()
        .map(|part| part["links"].as_u64().unwrap())
        .sum();
    assert_eq!(
        report["links"]["used"].as_u64().unwrap() + dropped,
        lines.len() as u64
    );
}

#[test]
fn bad_lines_are_named() {
    let line = "0,0,10,10,4,-60\n";
    check_refused(
        &format!("{HEADER}{line}0,0,10\n"),
        &["bad.csv:3:", "3 fields", "expected 6"],
    );
    check_refused(
        &format!("{HEADER}{line}0,NaN,10,10,4,-60\n"),
        &["bad.csv:3:", "NaN", "a coordinate"],
    );
    check_refused(
        &format!("{HEADER}{line}{line}0,0,10,10,4,300\n"),
        &["bad.csv:4:", "300", "dBm"],
    );
    check_refused(
        &format!("{HEADER}0,0,10,10,0,-60\n"),
        &["bad.csv:2:", "packets"],
    );
    check_refused(
        &format!("{HEADER}0,0,10,10,4,inf\n"),
        &["bad.csv:2:", "inf", "dBm"],
    );
    check_refused("x,y\n1,2\n", &["bad.csv:1:", "\"x\"", "tx_x_m"]);
    check_refused("tx_x_m,tx_y_m,rx_x_m,rx_y_m\n", &["bad.csv:1:", "rssi_dbm"]);
    check_refused("", &["bad.csv:1:", "an empty file"]);
    check_refused(HEADER, &["bad.csv:2:", "at least one line"]);
    check_refused(
        &format!("{HEADER}0,0,10,0,4,-60\n0,0,0,10,4,-60\n"),
        &["no link can be imaged", "2 along one side"],
    );
    check_refused(
        &format!("{HEADER}0,0,10,0,4,-60\n0,0,9,0,4,-60\n"),
        &["area"],
    );
}

#[test]
fn bad_dumps_are_named() {
    let dump =
        |packet: &str| format!("{{\"packets\": [[1, 0, 0, true, 5, 5, true, -40], {packet}]}}");
    check_refused(&dump("[1, 0]"), &["packets[1]:", "[1,0]", "8 fields"]);
    check_refused(
        &dump("[1, 0, 0, true, 5, 5, true, 300]"),
        &["packets[1]:", "300", "dBm"],
    );
    check_refused(
        &dump("[1, 0, 0, 7, 5, 5, true, -40]"),
        &["packets[1]:", "\"7\" in field 3", "true or false"],
    );
    check_refused(&dump("NaN"), &["bad.csv:1:"]);
    check_refused("{\"packets\": []}", &["no packets"]);
    check_refused("{\"size\": 3}", &["packets"]);
    let with = |more: &str| format!("{{{more}, \"packets\": [[1, 0, 0, true, 5, 5, true, -40]]}}");
    for bad in [
        "3",
        "[0, 0]",
        "[19]",
        "[19, 19, 19]",
        "[1e9, 1e9]",
        "[-5, 5]",
        "[\"a\", 5]",
    ] {
        check_refused(
            &with(&format!("\"size\": {bad}")),
            &["\"size\"", "two numbers from 1"],
        );
    }
    check_refused(
        &with("\"size\": [5, 5], \"origin\": [1e300, 0]"),
        &["\"origin\"", "1e+300", "two numbers"],
    );
    check_refused(&"{\"packets\":".repeat(100_000), &["bad.csv:1:"]);
    check_refused(
        &format!("{{\"packets\": {}", "[".repeat(100_000)),
        &["bad.csv:1:"],
    );
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let folder = folder_with(&[("now.csv", &sweep(None)), ("bytes.csv", "")]);
    fs::write(folder.path().join("bytes.csv"), b"tx\xff\xfe").unwrap();
    for (file, word) in [("none.csv", "none.csv"), (".", "."), ("bytes.csv", "UTF-8")] {
        for arguments in [
            vec![file, "--npy", "o.npy"],
            vec!["now.csv", "--empty", file, "--npy", "o.npy"],
        ] {
            let output = tomoswarm(folder.path(), &arguments);
            let message = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{message}");
            assert!(
                message.contains(word) && message.contains("expected"),
                "{message}"
            );
        }
    }
    assert_eq!(names(folder.path()), ["bytes.csv", "now.csv"]);
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_the_work() {
    let folder = folder_with(&[("now.csv", &sweep(None)), ("file", "")]);
    for output_path in ["no/such/folder/o.png", ".", "file/o.png"] {
        let output = tomoswarm(
            folder.path(),
            &["now.csv", "--npy", "o.npy", "--png", output_path],
        );
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(output_path), "{message}");
    }
    assert_eq!(names(folder.path()), ["file", "now.csv"]);
}

#[test]
fn bad_options_are_refused() {
    let folder = folder_with(&[("now.csv", &sweep(None))]);
    for bad in [
        ["--pixels", "0x9"],
        ["--pixels", "9"],
        ["--pixels", "99999x99999"],
        ["--area", "0,0,1"],
        ["--area", "5,0,1,9"],
        ["--area", "0,0,nan,9"],
        ["--solver", "magic"],
    ] {
        let output = tomoswarm(folder.path(), &["now.csv", bad[0], bad[1]]);
        assert_eq!(output.status.code(), Some(2), "{bad:?}");
    }
    let no_file = tomoswarm(folder.path(), &[]);
    assert_eq!(no_file.status.code(), Some(2));
}

/// A recording in the format of 2016, made for this test: a person at 12.3 east, 6.7 north, 520 pairs, two packets each.
#[test]
fn the_person_in_a_recording_of_our_own_is_found() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/two_rovers_2016.json");
    let folder = TempDir::new().unwrap();
    let output = tomoswarm(folder.path(), &[file.to_str().unwrap(), "--json", "o.json"]);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("o.json")).unwrap()).unwrap();
    let peak = |axis: &str| report["peaks"][0][axis].as_f64().unwrap();
    let error = (peak("x") - 12.3).hypot(peak("y") - 6.7);
    assert!(error < 0.7, "{error:.2} cells off: {report}");
    assert_eq!(report["settings"]["unit"], "cell");
}

#[test]
fn a_recording_names_its_area() {
    let packets: Vec<String> = (0..=12)
        .flat_map(|k| (0..=12).map(move |l| format!("[1, 0, {k}, true, 12, {l}, true, -50]")))
        .collect();
    let dump = |more: &str| format!("{{{more}\"packets\": [{}]}}", packets.join(", "));
    for (more, area) in [
        ("", [0.0, 0.0, 12.0, 12.0]),
        ("\"size\": [14, 16], ", [0.0, 0.0, 16.0, 14.0]),
        (
            "\"origin\": [-1, -2], \"size\": [14, 16], ",
            [-2.0, -1.0, 14.0, 13.0],
        ),
    ] {
        let folder = folder_with(&[("now.json", &dump(more))]);
        let output = tomoswarm(folder.path(), &["now.json", "--json", "o.json"]);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let report: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(folder.path().join("o.json")).unwrap())
                .unwrap();
        assert_eq!(
            report["settings"]["area"],
            serde_json::json!(area),
            "{more}"
        );
    }
}

/// The recordings lie beside the project; the places are those that all sound methods agree on.
#[test]
fn the_person_in_the_real_recordings_is_found() {
    let dumps = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/dumps");
    if !dumps.is_dir() {
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: {} is missing\n", dumps.display()),
        );
        return;
    }
    let path = |name: &str| dumps.join(name).into_os_string().into_string().unwrap();
    let empty = path("dump_empty.json");
    for (name, east, north) in [("center", 8.8, 10.8), ("top_left", 3.8, 16.5)] {
        let file = path(&format!("dump_one_person_standing_{name}.json"));
        for with_empty in [false, true] {
            let folder = TempDir::new().unwrap();
            let mut arguments = vec![file.as_str(), "--json", "o.json"];
            if with_empty {
                arguments.extend(["--empty", &empty]);
            }
            assert!(tomoswarm(folder.path(), &arguments).status.success());
            let json: PathBuf = folder.path().join("o.json");
            let report: serde_json::Value =
                serde_json::from_str(&fs::read_to_string(json).unwrap()).unwrap();
            let peak = |axis: &str| report["peaks"][0][axis].as_f64().unwrap();
            let error = (peak("x") - east).hypot(peak("y") - north);
            assert!(
                error < 0.3,
                "{name}, empty: {with_empty}: {error:.2} cells off"
            );
        }
    }
}

#[test]
fn the_shares_of_a_pixel_sum_to_its_value_and_only_map_knows_them() {
    let folder = folder_with(&[
        ("now.csv", &sweep(Some((4.0, 6.0)))),
        ("empty.csv", &sweep(None)),
    ]);
    let run = |options: &[&str]| {
        let mut arguments = vec!["now.csv", "--empty", "empty.csv", "--json", "out.json"];
        arguments.extend(options);
        tomoswarm(folder.path(), &arguments)
    };
    let done = run(&["--solver", "map", "--why", "4.1,5.9", "--npy", "image.npy"]);
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    let text = fs::read_to_string(folder.path().join("out.json")).unwrap();
    let why = &serde_json::from_str::<serde_json::Value>(&text).unwrap()["why"];
    let sum: f64 = why["links"]
        .as_array()
        .unwrap()
        .iter()
        .map(|link| link["share"].as_f64().unwrap())
        .sum();
    let npy = fs::read(folder.path().join("image.npy")).unwrap();
    let data = &npy[npy.len() - 4 * 1600..];
    // 40 × 40 pixels of 0.25 m: the pixel is the one in which the place lies.
    let pixel = (5.9 / 0.25) as usize * 40 + (4.1 / 0.25) as usize;
    let bytes = data.as_chunks::<4>().0[pixel];
    let value = f64::from(f32::from_le_bytes(bytes));
    assert!((value - sum).abs() < 1e-5, "{value} {sum}");
    assert!(
        sum > 0.3 && (why["value"].as_f64().unwrap() - sum).abs() < 1e-9,
        "{sum}"
    );
    let (x, y) = (why["x"].as_f64().unwrap(), why["y"].as_f64().unwrap());
    assert!(
        (x - 4.1).abs() <= 0.13 && (y - 5.9).abs() <= 0.13,
        "{x}, {y}"
    );
    for (options, said) in [
        (
            &["--solver", "tv", "--why", "4,6"][..],
            "only --solver map knows",
        ),
        (
            &["--solver", "map", "--why", "40,6"][..],
            "is outside the area of the image",
        ),
        (&["--why", "4"][..], "expected X,Y"),
    ] {
        let refused = run(options);
        assert_eq!(refused.status.code(), Some(2));
        let text = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(text.contains(said), "{text}");
    }
}

#[test]
fn the_json_says_all_that_an_image_was_made_with() {
    let folder = folder_with(&[("now.csv", &sweep(Some((4.0, 6.0))))]);
    let cells = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/two_rovers_2016.json");
    let settings_of = |arguments: &[&str]| {
        let output = tomoswarm(folder.path(), &[arguments, &["--json", "o.json"]].concat());
        assert!(output.status.success(), "{output:?}");
        let text = fs::read_to_string(folder.path().join("o.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        report["settings"].clone()
    };
    let usual = settings_of(&["now.csv"]);
    assert_eq!(usual["ring"], serde_json::json!([0.0, 0.0, 10.0, 10.0]));
    assert_eq!(usual["bin"], 0.5);
    assert_eq!(usual["sensitivity_dbm"], -95.0);
    assert_eq!(
        (&usual["most_peaks"], &usual["false_finds"]),
        (&5.into(), &0.02.into())
    );
    assert!(usual["cell_m"].is_null());
    let variations = usual["solver"]["variations"].as_array().unwrap();
    assert!(variations.len() == 3 && variations[0]["weight"].is_number());
    let sparse = settings_of(&["now.csv", "--solver", "nn"])["solver"].clone();
    assert!(sparse["prior_variance"].is_number() && sparse["sparsity"].is_number());
    let cells = cells.to_str().unwrap();
    let of_cells = settings_of(&[cells, "--cell", "0.4", "--solver", "map"]);
    assert_eq!(of_cells["cell_m"], 0.4);
}

#[test]
fn auto_decides_where_nothing_is_said_and_cells_have_a_size() {
    let folder = folder_with(&[("now.csv", &sweep(Some((4.0, 6.0))))]);
    let solver_of = |arguments: &[&str]| {
        let output = tomoswarm(folder.path(), arguments);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let text = fs::read_to_string(folder.path().join("o.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        report["settings"]["solver"]["name"].clone()
    };
    assert_eq!(solver_of(&["now.csv", "--json", "o.json"]), "auto");
    assert_eq!(
        solver_of(&["now.csv", "--json", "o.json", "--why", "4,6"]),
        "map"
    );
    for (cell, said) in [
        ("0.3", "the positions of this recording are in metres"),
        ("0", "expected metres"),
        ("-1", "expected metres"),
        ("NaN", "expected metres"),
    ] {
        let refused = tomoswarm(folder.path(), &["now.csv", "--cell", cell]);
        assert_eq!(refused.status.code(), Some(2));
        let text = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(text.contains(said), "{text}");
    }
}
