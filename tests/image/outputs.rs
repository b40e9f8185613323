//! What the `image` command writes beside image and report, and what it refuses to make an image of.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::command::{folder_with, names, sweep, tomoswarm};

/// The sweep of a person as single packets.
fn samples(person: Option<(f64, f64)>, channel: u8) -> String {
    samples_at(0.0, person, channel)
}

/// The same so many metres farther east.
fn samples_at(east_m: f64, person: Option<(f64, f64)>, channel: u8) -> String {
    let mut text = "run,tx_x_m,tx_y_m,rx_x_m,rx_y_m,channel,rssi_dbm\n".to_owned();
    for line in sweep(person).lines().skip(1) {
        let fields: Vec<f64> = line
            .split(',')
            .map(|field| field.parse().unwrap())
            .collect();
        let (tx_x_m, rx_x_m) = (fields[0] + east_m, fields[2] + east_m);
        let (tx_y_m, rx_y_m, strength_dbm) = (fields[1], fields[3], fields[5]);
        text += &format!("2,{tx_x_m},{tx_y_m},{rx_x_m},{rx_y_m},{channel},{strength_dbm:.0}\n");
    }
    text
}

pub(super) fn check_refused(files: &[(&str, &str)], arguments: &[&str], words: &[&str]) {
    let folder = folder_with(files);
    let before = names(folder.path());
    let outputs = ["--png", "o.png", "--json", "o.json"];
    let output = tomoswarm(folder.path(), &[arguments, &outputs].concat());
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    for word in words {
        assert!(message.contains(word), "no {word:?} in {message:?}");
    }
    assert_eq!(names(folder.path()), before);
}

fn is_png(folder: &Path, name: &str) -> bool {
    fs::read(folder.join(name)).unwrap().starts_with(b"\x89PNG")
}

#[test]
fn what_is_behind_an_image_is_drawn_and_says_what_it_is_made_from() {
    let folder = folder_with(&[
        ("now.csv", &samples(Some((6.0, 4.0)), 11)),
        ("empty.csv", &samples(None, 11)),
    ]);
    let output = tomoswarm(
        folder.path(),
        &[
            "now.csv",
            "--empty",
            "empty.csv",
            "--solver",
            "map",
            "--coverage",
            "coverage.png",
            "--links",
            "links.png",
            "--residuals",
            "residuals.png",
            "--progress",
            "progress.png",
        ],
    );
    assert!(output.status.success(), "{output:?}");
    for name in ["coverage.png", "links.png", "residuals.png", "progress.png"] {
        assert!(is_png(folder.path(), name), "{name}");
        let bytes = fs::read(folder.path().join(name)).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.contains("from now.csv (SHA-256 "), "{name}");
        assert_eq!(text.contains("acTL"), name == "progress.png", "{name}");
    }
}

#[test]
fn a_venue_says_where_on_the_earth_the_image_lies() {
    let venue = include_str!("../../configs/courtyard.venue.toml");
    let folder = folder_with(&[("now.csv", &sweep(Some((6.0, 4.0)))), ("venue.toml", venue)]);
    let asked = ["now.csv", "--solver", "map", "--venue", "venue.toml"];
    let outputs = ["--png", "now.png", "--geojson", "now.geojson"];
    let output = tomoswarm(folder.path(), &[&asked[..], &outputs].concat());
    assert!(output.status.success(), "{output:?}");
    let world = fs::read_to_string(folder.path().join("now.pgw")).unwrap();
    assert_eq!(world.lines().count(), 6);
    let text = fs::read_to_string(folder.path().join("now.geojson")).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    let features = file["features"].as_array().unwrap();
    let peak = features
        .iter()
        .find(|feature| feature["properties"]["what"] == "peak")
        .unwrap();
    let latitude = peak["geometry"]["coordinates"][1].as_f64().unwrap();
    // 4 m north of the datum; a degree of latitude has 111 260 m there.
    assert!(
        (latitude - 52.3702 - 4.0 / 111_260.0).abs() < 1e-5,
        "{latitude}"
    );
}

#[test]
fn where_a_person_truly_stood_is_compared_with_what_the_image_names() {
    let marks = "run,x_m,y_m,z_m,marked\n2,6.1,4,0,\n";
    let folder = folder_with(&[("now.csv", &sweep(Some((6.0, 4.0)))), ("marks.csv", marks)]);
    let asked = ["now.csv", "--solver", "map"];
    let made = |more: &[&str]| {
        let output = tomoswarm(folder.path(), &[&asked[..], more].concat());
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let text = made(&[
        "--marks",
        "marks.csv",
        "--json",
        "o.json",
        "--png",
        "with.png",
    ]);
    let line = "marked (6.1, 4): the nearest peak is 0.";
    assert!(text.contains(line), "{text}");
    let text = fs::read_to_string(folder.path().join("o.json")).unwrap();
    let report: Value = serde_json::from_str(&text).unwrap();
    let marks = &report["marks"];
    let away = marks["places"][0]["nearest"].as_f64().unwrap();
    assert!(marks["of"] == "peak" && away < 0.5, "{marks}");
    assert!(text.contains("marks.csv"), "it says what it is made from");
    let text = made(&["--json", "o.json", "--png", "without.png"]);
    assert!(!text.contains("marked"), "{text}");
    let picture = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert_ne!(picture("with.png"), picture("without.png"));
    let files = [("now.csv", &*sweep(None)), ("m.csv", "x_m,y_m\n1,x\n")];
    let words = ["m.csv:2: found \"x\", expected a coordinate"];
    check_refused(&files, &["now.csv", "--marks", "m.csv"], &words);
}

#[test]
fn an_empty_sweep_of_another_place_or_channel_is_refused() {
    let now = samples(Some((6.0, 4.0)), 11);
    let far = samples_at(500.0, None, 11);
    let files = [("now.csv", now.as_str()), ("far.csv", far.as_str())];
    let words = [
        "far.csv: found links from",
        "expected an empty sweep of the same place",
    ];
    check_refused(&files, &["now.csv", "--empty", "far.csv"], &words);
    let beside = samples_at(5.0, None, 11);
    let files = [("now.csv", now.as_str()), ("beside.csv", beside.as_str())];
    let words = [
        "beside.csv: found links where",
        "expected an empty sweep of the same place, with most of them",
    ];
    check_refused(&files, &["now.csv", "--empty", "beside.csv"], &words);
    let other = samples(None, 26);
    let files = [("now.csv", now.as_str()), ("other.csv", other.as_str())];
    let words = ["other.csv: found channel 26, expected an empty sweep on channel 11"];
    check_refused(&files, &["now.csv", "--empty", "other.csv"], &words);
}

#[test]
fn what_makes_no_image_is_refused_with_the_reason() {
    let header = "tx_x_m,tx_y_m,rx_x_m,rx_y_m,packets,rssi_dbm\n";
    let one = format!("{header}0,0,10,10,5,-60\n");
    let words = ["one.csv: no link can be imaged"];
    check_refused(&[("one.csv", &one)], &["one.csv"], &words);
    let short = "4,4,4.5,4.5,5,-60\n".repeat(3);
    let used = format!(
        "{header}0,1,10,9,5,-60\n0,0,10,0,5,-60\n0,10,10,10,5,-61\n0,0,0,10,5,-60\n{short}"
    );
    let words = [
        "used.csv: found 1 link that can be imaged (left out: 1 too short, 3 along one side), expected several",
    ];
    check_refused(&[("used.csv", &used)], &["used.csv"], &words);
    let sides = format!("{header}0,0,10,0,5,-60\n0,10,10,10,5,-61\n0,0,0,10,5,-60\n");
    let words = ["sides.csv: no link can be imaged", "3 along one side"];
    check_refused(&[("sides.csv", &sides)], &["sides.csv"], &words);
    let line = format!("{header}0,0,10,0,5,-60\n0,0,9,0,5,-61\n");
    let words = [
        "line.csv: found all links on one line, (0.0, 0.0) to (10.0, 0.0)",
        "an area of positive size",
    ];
    check_refused(&[("line.csv", &line)], &["line.csv"], &words);
    let short = format!("{header}0,0,10,0,5,-60\n0,10,10,10,5,-61\n4,4,5,5,5,-60\n");
    let words = ["1 too short (under 1.50)"];
    check_refused(&[("short.csv", &short)], &["short.csv"], &words);
    let words = ["list.json:2: found a list, expected an object"];
    check_refused(&[("list.json", "\n[]")], &["list.json"], &words);
    let rounds = "0,-45,-50,-60,11,29,58\n";
    let words = ["missed_power_dbm,tx_z_m,rx_z_m; a recording of a fixed network needs --nodes"];
    check_refused(&[("rounds.csv", rounds)], &["rounds.csv"], &words);
    let words = ["1 to 1048576 pixels in all"];
    let sizes = ["now.csv", "--pixels", "20000x20000"];
    check_refused(&[("now.csv", &sweep(None))], &sizes, &words);
    let nan = samples(None, 11).replacen(",11,-", ",11,NaN-", 1);
    let words = ["nan.csv:2: found \"NaN-", "expected dBm from"];
    check_refused(&[("nan.csv", &nan)], &["nan.csv"], &words);
    // Also where no image asks for it.
    for (column, expected) in [
        ("tx_sd_m", "expected metres from 0 to"),
        ("rx_z_m", "expected metres from -"),
        ("tx_heading_rad", "expected radians from"),
        ("utc_error_s", "expected seconds from 0 to"),
    ] {
        let nan: String = samples(None, 11)
            .lines()
            .enumerate()
            .map(|(line, text)| match line {
                0 => format!("{text},{column}\n"),
                7 => format!("{text},NaN\n"),
                _ => format!("{text},\n"),
            })
            .collect();
        let words = ["nan.csv:8: found \"NaN\"", expected];
        check_refused(&[("nan.csv", &nan)], &["nan.csv"], &words);
    }
}

#[test]
fn progress_needs_one_recording_of_single_packets() {
    let pooled = sweep(Some((6.0, 4.0)));
    let asked = ["now.csv", "--progress", "p.png", "--solver", "map"];
    let words = ["now.csv: holds pooled links", "samples.csv"];
    check_refused(&[("now.csv", &pooled)], &asked, &words);
    let single = samples(Some((6.0, 4.0)), 11);
    let files = [("now.csv", single.as_str()), ("more.csv", single.as_str())];
    let words = ["--progress: found 2 recordings, expected one"];
    check_refused(&files, &[&asked[..], &["more.csv"]].concat(), &words);
}

#[test]
fn an_earlier_run_is_the_empty_sweep_of_another() {
    let folder = folder_with(&[("expected.csv", &sweep(None))]);
    for (run, person) in [("one", None), ("two", Some((6.0, 4.0)))] {
        fs::create_dir(folder.path().join(run)).unwrap();
        fs::write(folder.path().join(run).join("links.csv"), sweep(person)).unwrap();
    }
    let image = |empty: &str, output: &str| {
        let asked = ["two", "--empty", empty, "--solver", "map", "--npy", output];
        let ended = tomoswarm(folder.path(), &asked);
        assert!(ended.status.success(), "{ended:?}");
        fs::read(folder.path().join(output)).unwrap()
    };
    assert_eq!(image("one", "a.npy"), image("expected.csv", "b.npy"));
    check_refused(
        &[("now.csv", &sweep(None))],
        &["now.csv", "--empty", "."],
        &["without empty.csv"],
    );
}

/// Links at two heights around a square of 10 m; what stands at (4, 6), at most 2 m high, takes 6 dB of what meets it.
fn with_heights(is_empty: bool) -> String {
    let mut ends: Vec<[f64; 3]> = Vec::new();
    for z_m in [1.0, 3.0] {
        for step in 0..9 {
            let along_m = 1.0 + f64::from(step);
            ends.extend([[along_m, 0.0, z_m], [along_m, 10.0, z_m]]);
            ends.extend([[0.0, along_m, z_m], [10.0, along_m, z_m]]);
        }
    }
    let mut text = "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,packets,rssi_dbm\n".to_owned();
    for (i, from) in ends.iter().enumerate() {
        for to in &ends[..i] {
            let meets = (0..=100).any(|step| {
                let share = f64::from(step) / 100.0;
                let at = [0, 1, 2].map(|axis| from[axis] + share * (to[axis] - from[axis]));
                (at[0] - 4.0).hypot(at[1] - 6.0) < 0.5 && at[2] < 2.0
            });
            let strength = if meets && !is_empty { -66 } else { -60 };
            let [[a, b, c], [d, e, f]] = [from, to];
            text += &format!("{a},{b},{c},{d},{e},{f},9,{strength}\n");
        }
    }
    text
}

#[test]
fn links_with_heights_make_a_volume() {
    let folder = folder_with(&[
        ("now.csv", &with_heights(false)),
        ("empty.csv", &with_heights(true)),
    ]);
    let asked = ["now.csv", "--empty", "empty.csv", "--layers", "2"];
    let outputs = ["--npy", "v.npy", "--png", "v.png", "--json", "v.json"];
    let output = tomoswarm(folder.path(), &[&asked[..], &outputs].concat());
    assert!(output.status.success(), "{output:?}");
    let text = fs::read_to_string(folder.path().join("v.json")).unwrap();
    let report: Value = serde_json::from_str(&text).unwrap();
    let at: Vec<f64> = report["strongest"]["at_m"]
        .as_array()
        .unwrap()
        .iter()
        .map(|metres| metres.as_f64().unwrap())
        .collect();
    assert!((at[0] - 4.0).hypot(at[1] - 6.0) < 0.8, "{at:?}");
    assert_eq!(at[2], 1.5);
    assert_eq!(report["solver"]["name"], "auto");
    assert!(report["choice"]["scores"].as_array().unwrap().len() == 4);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("solver: "), "{said}");
    for solver in ["map", "tikhonov", "tsvd", "nn", "tv"] {
        let by = ["--solver", solver, "--json", "v.json"];
        let output = tomoswarm(folder.path(), &[&asked[..], &by].concat());
        assert!(output.status.success(), "{solver}: {output:?}");
        let text = fs::read_to_string(folder.path().join("v.json")).unwrap();
        let report: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(report["solver"]["name"], solver);
    }
    let points = [&asked[..], &["--solver", "points"]].concat();
    let (now, empty) = (with_heights(false), with_heights(true));
    let files = [("now.csv", now.as_str()), ("empty.csv", empty.as_str())];
    check_refused(&files, &points, &["--solver points is not for --layers"]);
    let npy = fs::read(folder.path().join("v.npy")).unwrap();
    assert!(String::from_utf8_lossy(&npy[..128]).contains("(2, 20, 20)"));
    assert_eq!(npy.len(), 128 + 4 * 800);
    assert!(is_png(folder.path(), "v.png"));
    let flat = sweep(None);
    let files = [("now.csv", flat.as_str()), ("empty.csv", flat.as_str())];
    check_refused(
        &files,
        &asked,
        &["now.csv: found links without heights", "tx_z_m"],
    );
    let single = samples(None, 11);
    let files = [("now.csv", single.as_str()), ("empty.csv", single.as_str())];
    check_refused(
        &files,
        &asked,
        &[
            "now.csv: found a sample without altitudes in line 2",
            "tx_z_m and rx_z_m",
        ],
    );
}

#[test]
fn a_volume_needs_several_links_that_the_empty_sweep_has_and_few_layers_in_its_picture() {
    let (now, empty) = (with_heights(false), with_heights(true));
    let asked = ["now.csv", "--empty", "empty.csv", "--layers", "2"];
    let first = |text: &str, lines: usize| -> String {
        text.lines()
            .take(lines + 1)
            .map(|line| line.to_owned() + "\n")
            .collect()
    };
    let check = |now: &str, empty: &str, words: &[&str]| {
        check_refused(&[("now.csv", now), ("empty.csv", empty)], &asked, words);
    };
    let words = [
        "empty.csv: found links where 200 of the",
        "of the same place",
    ];
    check(&now, &first(&empty, 200), &words);
    let words = ["now.csv: found 1 link, expected several"];
    check(&first(&now, 1), &first(&empty, 1), &words);
    let files = [("now.csv", now.as_str()), ("empty.csv", empty.as_str())];
    let many = ["now.csv", "--empty", "empty.csv", "--layers", "101"];
    let words = ["--png: found 101 layers, expected at most 100 in a picture"];
    check_refused(&files, &many, &words);
    let fine = [
        "now.csv",
        "--empty",
        "empty.csv",
        "--layers",
        "100",
        "--pixels",
        "50x40",
    ];
    let words = [
        "found 50 x 40 x 100 = 200000 voxels, expected at most 131072: fewer --layers or --pixels",
    ];
    check_refused(&files, &fine, &words);
    let beside = [
        "now.csv",
        "--empty",
        "empty.csv",
        "--layers",
        "2",
        "--area",
        "90,90,99,99",
    ];
    let words = ["found no link through the volume"];
    check_refused(&files, &beside, &words);
}

/// Nobody can write to a full device, and what is said there is lost.
#[cfg(target_os = "linux")]
#[test]
fn an_answer_that_cannot_be_printed_leaves_no_files() {
    let folder = folder_with(&[
        ("now.csv", &with_heights(false)),
        ("empty.csv", &with_heights(true)),
    ]);
    let before = names(folder.path());
    for more in [&["--solver", "map"][..], &["--layers", "2"]] {
        let asked = ["image", "now.csv", "--empty", "empty.csv", "--npy", "o.npy"];
        let ended = std::process::Command::new(env!("CARGO_BIN_EXE_tomoswarm"))
            .args(asked)
            .args(more)
            .current_dir(folder.path())
            .stdout(
                fs::OpenOptions::new()
                    .write(true)
                    .open("/dev/full")
                    .unwrap(),
            )
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(2), "{said}");
        assert!(said.contains("standard output"), "{said}");
        assert_eq!(names(folder.path()), before);
    }
}

#[test]
fn an_area_without_room_for_persons_says_that_they_are_not_searched() {
    let folder = folder_with(&[
        ("now.csv", &sweep(Some((6.0, 4.0)))),
        ("empty.csv", &sweep(None)),
    ]);
    let said = |area: &str| {
        let asked = [
            "now.csv",
            "--empty",
            "empty.csv",
            "--solver",
            "map",
            "--area",
            area,
        ];
        let ended = tomoswarm(folder.path(), &asked);
        assert!(ended.status.success(), "{ended:?}");
        String::from_utf8(ended.stdout).unwrap()
    };
    let none = said("5,3,6.5,9");
    assert!(
        none.contains("persons are not searched: nobody is sought within 0.80 m of the border"),
        "{none}"
    );
    assert!(!said("0,0,10,10").contains("persons are not searched"));
}

#[test]
fn the_world_file_is_that_of_the_picture_with_its_marks() {
    let venue = include_str!("../../configs/courtyard.venue.toml");
    let marks = "x_m,y_m\n-2,4\n";
    let folder = folder_with(&[
        ("now.csv", &sweep(Some((6.0, 4.0)))),
        ("venue.toml", venue),
        ("marks.csv", marks),
    ]);
    let asked = [
        "now.csv",
        "--solver",
        "map",
        "--venue",
        "venue.toml",
        "--png",
        "o.png",
    ];
    let west_deg = |more: &[&str]| -> f64 {
        let output = tomoswarm(folder.path(), &[&asked[..], more].concat());
        assert!(output.status.success(), "{output:?}");
        let world = fs::read_to_string(folder.path().join("o.pgw")).unwrap();
        world.lines().nth(4).unwrap().parse().unwrap()
    };
    // A degree of longitude has about 68 km there; the mark is 2 m west of the area, and the picture grows by a little more.
    let moved_m = (west_deg(&[]) - west_deg(&["--marks", "marks.csv"])) * 68_000.0;
    assert!((1.5..6.0).contains(&moved_m), "{moved_m}");
}

#[test]
fn marks_of_another_run_than_the_samples_are_refused() {
    let now = samples(Some((6.0, 4.0)), 11);
    let of_run = |run: u32| format!("run,x_m,y_m\n{run},6,4\n");
    let files = [("now.csv", now.as_str()), ("marks.csv", &of_run(3))];
    let asked = ["now.csv", "--solver", "map", "--marks", "marks.csv"];
    let words = ["marks.csv: found marks of run 3, expected run 2 as in now.csv"];
    check_refused(&files, &asked, &words);
    let folder = folder_with(&[("now.csv", &now), ("marks.csv", &of_run(2))]);
    assert!(tomoswarm(folder.path(), &asked).status.success());
}

#[test]
fn a_sample_that_a_second_file_gives_again_counts_once() {
    let keyed = |text: &str| -> String {
        let line = |(number, line): (usize, &str)| match number {
            0 => format!("vehicle,boot,sequence,{line}\n"),
            number => format!("1,1,{number},{line}\n"),
        };
        text.lines().enumerate().map(line).collect()
    };
    let all = keyed(&samples(Some((6.0, 4.0)), 11));
    let count = all.lines().count() - 1;
    let first: String = all
        .lines()
        .take(9)
        .map(|line| format!("{line}\n"))
        .collect();
    let folder = folder_with(&[("now.csv", &all), ("first.csv", &first)]);
    let image = |files: &[&str]| {
        let options = ["--npy", "o.npy", "--json", "o.json", "--solver", "map"];
        let output = tomoswarm(folder.path(), &[files, &options].concat());
        assert!(output.status.success(), "{output:?}");
        let values = fs::read(folder.path().join("o.npy")).unwrap();
        let json = fs::read_to_string(folder.path().join("o.json")).unwrap();
        let json: Value = serde_json::from_str(&json).unwrap();
        let said = String::from_utf8(output.stdout).unwrap();
        (values, json["links"]["repeated_samples"].as_u64(), said)
    };
    let (once, none, _) = image(&["now.csv"]);
    let (again, left_out, said) = image(&["now.csv", "first.csv"]);
    assert_eq!((none, left_out), (Some(0), Some(8)));
    assert!(once == again, "the same image");
    assert!(
        said.contains("  8 samples left out: given already\n"),
        "{said}"
    );
    assert!(said.starts_with(&format!("links: {count}")), "{said}");
    let other = first.replacen(",11,-", ",11,-1", 1);
    let files = [("now.csv", all.as_str()), ("other.csv", &other)];
    let words = [
        "other.csv:2: found sample 1 of vehicle 1, start 1, run 2 otherwise than in now.csv:2, expected the same again",
    ];
    check_refused(&files, &["now.csv", "other.csv"], &words);
}

#[test]
fn a_sweep_that_is_its_own_empty_sweep_is_warned_of() {
    let folder = folder_with(&[("now.csv", &sweep(None))]);
    let arguments = ["now.csv", "--empty", "now.csv", "--solver", "map"];
    let output = tomoswarm(folder.path(), &arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    let words = "warning: now.csv is given as the sweep and as its own empty sweep";
    assert!(said.contains(words), "{said}");
}

#[test]
fn an_output_that_is_a_hard_link_to_an_input_is_refused() {
    let folder = folder_with(&[("now.csv", &sweep(None))]);
    let path = |name: &str| folder.path().join(name);
    fs::hard_link(path("now.csv"), path("o.json")).unwrap();
    let output = tomoswarm(folder.path(), &["now.csv", "--json", "o.json"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("o.json: is to be written, but is an input"),
        "{said}"
    );
    assert_eq!(fs::read_to_string(path("o.json")).unwrap(), sweep(None));
}
