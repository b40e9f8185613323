//! A sample of `cargo bench --bench tracking`, a real recording, and what `image` refuses of fixed networks.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::walk::Walk;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tomoswarm");

#[test]
fn who_walks_in_a_fixed_network_is_followed() {
    for (persons, most_m, least_right) in [(1, 0.3, 0.98), (2, 0.5, 0.6)] {
        let folder = tempfile::tempdir().unwrap();
        let result = Walk { persons, seed: 101 }.run(PROGRAM, folder.path());
        assert!(
            result.median_m() <= most_m,
            "{persons}: {}",
            result.median_m()
        );
        assert!(
            result.counted_right >= least_right,
            "{persons}: {}",
            result.counted_right
        );
    }
}

#[test]
fn in_a_real_recording_one_person_walks_the_same_square_twice() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/utah");
    if !data.is_dir() {
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: {} is missing\n", data.display()),
        );
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let track = folder.path().join("track.csv");
    let ended = Command::new(PROGRAM)
        .arg("image")
        .arg(data.join("dataset_one_person_moving_square.csv"))
        .arg("--nodes")
        .arg(data.join("nodes.csv"))
        .arg("--empty")
        .arg(data.join("dataset_empty.csv"))
        .arg("--track")
        .arg(&track)
        .output()
        .unwrap();
    assert!(
        ended.status.success(),
        "{}",
        String::from_utf8_lossy(&ended.stderr)
    );
    let text = fs::read_to_string(track).unwrap();
    let lines: Vec<Vec<f64>> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .map(|line| {
            line.split(',')
                .map(|field| field.parse().unwrap())
                .collect()
        })
        .collect();
    assert!(
        lines.len() > 100 && lines.iter().all(|line| line[1] == 1.0),
        "one person"
    );
    // Where the way was is not recorded; but it was walked twice, and both rounds must agree.
    let of = |first_s: f64, last_s: f64| {
        let within = lines
            .iter()
            .filter(move |line| (first_s..last_s).contains(&line[0]));
        within.map(|line| (line[2], line[3])).collect::<Vec<_>>()
    };
    let (first, second) = (of(1.0, 14.0), of(14.0, 28.0));
    let mut apart_m: Vec<f64> = second
        .iter()
        .map(|(x_m, y_m)| {
            let away = first.iter().map(|(x, y)| (x - x_m).hypot(y - y_m));
            away.fold(f64::INFINITY, f64::min)
        })
        .collect();
    apart_m.sort_by(f64::total_cmp);
    assert!(apart_m[apart_m.len() / 2] < 0.3, "{apart_m:?}");
}

#[test]
fn what_is_wrong_in_a_network_is_said_and_nothing_is_written() {
    let check = |nodes: &str, walk: &str, expected: &str| {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("nodes.csv"), nodes).unwrap();
        fs::write(folder.path().join("walk.csv"), walk).unwrap();
        let ended = Command::new(PROGRAM)
            .args([
                "image",
                "walk.csv",
                "--nodes",
                "nodes.csv",
                "--track",
                "track.csv",
            ])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(2), "{said}");
        assert!(said.contains(expected), "{said}");
        assert!(!folder.path().join("track.csv").exists());
    };
    let nodes = "id,x_m,y_m\n0,0,0\n1,6,0\n2,6,6\n";
    let round = "0, -45, -50, -60, 11, 29, 58\n";
    check(
        "id,x_m,y_m\n0,0,0\n2,6,6\n",
        round,
        "nodes.csv: found no node 1, but 2 nodes",
    );
    check(
        nodes,
        "3, -45, -50, -60, 11, 29, 58\n",
        "walk.csv:1: found receiver 3",
    );
    check(
        nodes,
        &format!("{round}1, NaN, -45, -50, 11, 29, 58\n"),
        "walk.csv:2: found NaN for node 0",
    );
    check("id,x_m,y_m\n0,1,1\n1,2,1\n2,3,1\n", round, "walk.csv: ");
    check(
        "id,x_m,y_m\n0,1,1\n1,2,2\n2,1,1\n",
        round,
        "nodes.csv:4: found node 2 at the place of node 0",
    );
    check(nodes, "", "walk.csv:1: found an empty file");
}
