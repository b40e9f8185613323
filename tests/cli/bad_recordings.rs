//! Recordings with broken lines, impossible values, or nothing to make an image of.

use super::program_runner::ProgramRunner;

const HEADER: &str = "tx_x_m,tx_y_m,rx_x_m,rx_y_m,packets,rssi_dbm\n";
const GOOD: &str = "0,0,8,8,3,-50\n";

/// A recording is refused by `check` and by `image`, as the sweep and as the empty sweep.
fn check(name: &str, content: impl AsRef<[u8]>, parts: &[&str]) {
    let runner = ProgramRunner::new();
    runner.write(name, content);
    runner.write("good.csv", format!("{HEADER}{GOOD}"));
    runner.write("i.png", "of an earlier run");
    let outputs = ["--png", "i.png", "--npy", "i.npy", "--json", "i.json"];
    for arguments in [
        vec!["check", name],
        vec!["image", name],
        vec!["image", "good.csv", "--empty", name],
    ] {
        let is_image = arguments[0] == "image";
        let arguments = [arguments, if is_image { outputs.to_vec() } else { vec![] }].concat();
        let err = runner.refused(&arguments, parts);
        assert!(err.contains(&format!("{name}:")), "{err}");
    }
}

#[test]
fn a_broken_line_is_refused() {
    check(
        "a.csv",
        format!("{HEADER}{GOOD}0,0,8\n"),
        &["3: ", "3 fields", "expected 6"],
    );
    check(
        "a.csv",
        format!("{HEADER}{GOOD}\n0,0,8,8,3,loud\n"),
        &["4: ", "\"loud\"", "expected dBm from"],
    );
    check(
        "a.csv",
        format!("{HEADER}0,0,8,8,-3,-50\n"),
        &["2: ", "\"-3\"", "expected a whole number"],
    );
    check("a.csv", GOOD, &["1: ", "expected the header tx_x_m"]);
    check("a.csv", HEADER, &["2: ", "the end of the file", "expected"]);
}

#[test]
fn impossible_values_are_refused() {
    for value in ["nan", "NaN", "inf", "300", "-1e9", ""] {
        check(
            "a.csv",
            format!("{HEADER}{GOOD}0,0,8,8,3,{value}\n"),
            &["3: ", "expected dBm from -200 to 40"],
        );
    }
    for value in ["nan", "-inf", "1e300"] {
        check(
            "a.csv",
            format!("{HEADER}{value},0,8,8,3,-50\n"),
            &["2: ", "expected a coordinate from"],
        );
    }
    let packet = |rssi: &str| {
        format!("{{\"packets\": [[1,2,3,true,4,5,true,-50],\n[1,2,3,true,4,5,true,{rssi}]]}}")
    };
    check(
        "a.json",
        packet("300"),
        &["packets[1]: ", "300", "expected dBm from -200 to 40"],
    );
    check(
        "a.json",
        packet("null"),
        &["packets[1]: ", "null", "expected dBm"],
    );
    check("a.json", packet("NaN"), &["2: ", "expected"]);
}

#[test]
fn truncated_empty_and_deep_recordings_are_refused() {
    check(
        "a.csv",
        "",
        &["1: ", "an empty file", "expected the header"],
    );
    check("a.json", "", &["1: ", "an empty file", "expected"]);
    check("a.csv", "# of a sweep\n", &["1: ", "nothing but comments"]);
    check(
        "a.json",
        "{\"packets\": [[1,2,3,true,4,5,true,-50],[1,2",
        &["1: ", "EOF", "expected"],
    );
    check("a.json", "{\"packets\": []}", &["no packets", "expected"]);
    check(
        "a.json",
        "{}",
        &["1: ", "missing field `packets`", "expected"],
    );
    check(
        "a.json",
        format!("{{\"packets\": {}", "[".repeat(100_000)),
        &["1: ", "recursion limit"],
    );
    check("a.json", "{\"a\": ".repeat(100_000), &["1: ", "expected"]);
}

#[test]
fn garbage_is_refused() {
    let garbage: Vec<u8> = (0..5000_u32)
        .map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8)
        .collect();
    check("a.csv", &garbage, &["UTF-8"]);
    check("a.json", &garbage, &["UTF-8"]);
}

#[test]
fn a_missing_file_and_a_folder_are_named() {
    let runner = ProgramRunner::new();
    for (command, words) in [
        ("image", "found a folder without links.csv"),
        ("check", "irectory"),
    ] {
        runner.refused(&[command, "gone.csv"], &["gone.csv: ", "No such file"]);
        runner.refused(&[command, "."], &[".: ", words]);
    }
}

#[test]
fn links_in_one_place_or_on_one_line_make_no_image() {
    let runner = ProgramRunner::new();
    runner.write("a.csv", format!("{HEADER}{}", "5,5,5,5,3,-50\n".repeat(50)));
    runner.refused(
        &["image", "a.csv", "--png", "i.png"],
        &["a.csv: ", "an area of positive size"],
    );
    let line: String = (0..50)
        .map(|n| format!("{n},0,{},0,3,-50\n", n + 5))
        .collect();
    runner.write("a.csv", format!("{HEADER}{line}"));
    runner.refused(
        &["image", "a.csv", "--png", "i.png"],
        &["a.csv: ", "an area of positive size"],
    );
}
