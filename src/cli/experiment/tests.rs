//! Small experiments in the courtyard, from file to table.

use std::path::Path;

use super::*;

/// A quick sweep, and rovers that drive straight ahead.
const SIM: &str = "kind = \"sim\"\nvenue = \"yard.venue.toml\"\nscene = \"yard.scene.toml\"\nuntil_s = 300.0\n\
    [vehicles]\ncount = 2\n[mission]\nkind = \"forward\"\ndistance_m = 2.0\n";
const VENUE: &str = "kind = \"venue\"\nname = \"yard\"\narea_m = [0.0, 0.0, 6.0, 6.0]\n\
    fence_m = [[-2.5, -2.5], [8.5, -2.5], [8.5, 8.5], [-2.5, 8.5]]\nhomes_m = [[-1.2, 3.0], [7.2, 3.0]]\n\
    [datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n";
const SCENE: &str = "kind = \"scene\"\nname = \"yard\"\n[[object]]\noutline_m = [[2.5, 1.5], [3.5, 1.5], [3.5, 4.5], [2.5, 4.5]]\n";

fn folder(experiment: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    put("yard.sim.toml", SIM);
    put("yard.venue.toml", VENUE);
    put("yard.scene.toml", SCENE);
    put(
        "e.toml",
        &format!("kind = \"experiment\"\nname = \"e\"\nsim = \"yard.sim.toml\"\n{experiment}"),
    );
    folder
}

fn run(
    folder: &Path,
    out: &str,
    change: impl Fn(&mut ExperimentArgs),
) -> (String, Result<(), CliError>) {
    let mut args = ExperimentArgs {
        config: folder.join("e.toml"),
        out: Some(folder.join(out)),
        threads: Some(1),
        resume: false,
        fresh: false,
        only: None,
        by: vec![Axis::Mission],
    };
    change(&mut args);
    let mut text = Vec::new();
    let result = args.run(&mut text);
    (String::from_utf8(text).unwrap(), result)
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap()
}

const GRID: &str = "seeds = 2\nsafety_distances_m = [0.3, 0.5]\n[[mission]]\nname = \"ahead\"\nkind = \"forward\"\n\
    distance_m = 1.5\n[[mission]]\nname = \"against\"\nkind = \"forward\"\ndistance_m = 8.0\n";

#[test]
fn the_table_is_the_same_with_one_thread_with_three_and_after_a_stop() {
    let folder = folder(GRID);
    let (table, result) = run(folder.path(), "one", |_| {});
    assert!(result.is_ok(), "{result:?}");
    let (again, _) = run(folder.path(), "three", |args| args.threads = Some(3));
    assert_eq!(table, again);
    let csv = read(folder.path(), "one/runs.csv");
    assert_eq!(csv, read(folder.path(), "three/runs.csv"));
    assert_eq!(csv.lines().count(), 1 + 8);
    // As if it had been killed in the middle of the fourth row.
    let journal = read(folder.path(), "one/journal.jsonl");
    let kept: usize = journal.lines().take(4).map(|line| line.len() + 1).sum();
    fs::create_dir(folder.path().join("killed")).unwrap();
    fs::write(
        folder.path().join("killed/journal.jsonl"),
        &journal[..kept + 20],
    )
    .unwrap();
    let (resumed, result) = run(folder.path(), "killed", |args| args.resume = true);
    assert!(result.is_ok(), "{result:?}");
    assert_eq!(
        (resumed, read(folder.path(), "killed/runs.csv")),
        (table, csv)
    );
    assert_eq!(read(folder.path(), "killed/journal.jsonl"), journal);
}

#[test]
fn figures_are_those_of_the_run() {
    let folder = folder("[[mission]]\nname = \"ahead\"\nkind = \"forward\"\ndistance_m = 1.5\n");
    let (table, result) = run(folder.path(), "out", |_| {});
    assert!(result.is_ok(), "{result:?}\n{table}");
    let csv = read(folder.path(), "out/runs.csv");
    let (head, row) = (csv.lines().next().unwrap(), csv.lines().nth(1).unwrap());
    let value = |name: &str| {
        let index = head.split(',').position(|known| known == name).unwrap();
        row.split(',').nth(index).unwrap().to_owned()
    };
    let number = |name: &str| value(name).parse::<f64>().unwrap();
    assert_eq!(
        (
            value("end").as_str(),
            value("mission_end").as_str(),
            value("collisions").as_str()
        ),
        ("finished", "done", "0")
    );
    // Two vehicles drive 1.5 m ahead and come back.
    assert!((number("path_m") - 6.0).abs() < 1.0, "{csv}");
    // From 3.7 m before the block to 2.2 m, less the radius; the place is believed within 0.15 m.
    assert!((number("min_clearance_m") - 1.95).abs() < 0.2, "{csv}");
    // The block is 1 m by 3 m on the lattice of 0.2 m, its border between two cells: 6 by 16 or 5 by 15 cells around.
    assert!((32.0..=40.0).contains(&number("visible_cells")), "{csv}");
    assert!(
        number("route_cells") <= number("visible_cells")
            && number("detected_cells") <= number("visible_cells")
    );
    assert!(
        table.contains("1 done") && table.ends_with("1 of 1 runs of e\n"),
        "{table}"
    );
}

/// Returns a column of a folder's runs, by its name.
fn column(folder: &Path, file: &str, name: &str) -> Vec<String> {
    let csv = read(folder, file);
    let words = |line: &str| -> Vec<String> { line.split(',').map(str::to_owned).collect() };
    let index = words(csv.lines().next().unwrap())
        .iter()
        .position(|known| known == name)
        .unwrap();
    csv.lines()
        .skip(1)
        .map(|line| words(line)[index].clone())
        .collect()
}

#[test]
fn places_are_judged_by_the_truth_of_the_scene() {
    // The second one lies inside the block; with the wider distance, the fourth lies too near to it.
    let folder = folder(
        "safety_distances_m = [0.3, 0.8]\n[with]\nuntil_s = 900.0\n[with.vehicles]\ncount = 1\npose_sd_m = 0.02\n\
         [[mission]]\nkind = \"pathfind\"\n\
         waypoints_m = [[3.0, 0.0], [3.0, 3.0], [7.0, 3.0], [4.4, 3.0]]\n\
         [[mission]]\nkind = \"explore\"\n",
    );
    let (table, result) = run(folder.path(), "out", |_| {});
    assert!(result.is_ok(), "{result:?}\n{table}");
    let of = |name: &str| column(folder.path(), "out/runs.csv", name);
    assert_eq!(of("mission_end")[..2], ["no way", "no way"], "{table}");
    assert_eq!(of("places_reachable"), ["3", "2", "0", "0"], "{table}");
    let (visited, wrong) = (of("places_visited"), of("false_no_way"));
    assert_eq!((visited[2].as_str(), wrong[2].as_str()), ("0", "0"));
    assert_eq!(
        (&visited[..2], &wrong[..2]),
        (
            &["3".to_owned(), "2".to_owned()][..],
            &["0".to_owned(), "0".to_owned()][..]
        )
    );
    let lines: Vec<&str> = table.lines().collect();
    assert!(
        lines[1].starts_with("pathfind") && lines[1].contains(" 5 "),
        "{table}"
    );
}

#[test]
fn persons_by_chance_are_judged_seed_by_seed() {
    let folder = folder("seeds = 3\n[with.vehicles]\ncount = 1\n[[mission]]\nkind = \"browse\"\n");
    let persons =
        "[random_persons]\ncount = 1\nkeep_from_objects_m = 0.2\nkeep_from_border_m = 0.2\n";
    fs::write(
        folder.path().join("yard.scene.toml"),
        format!("{SCENE}{persons}"),
    )
    .unwrap();
    let (_, result) = run(folder.path(), "out", |_| {});
    assert!(result.is_ok(), "{result:?}");
    let cells: std::collections::BTreeSet<String> =
        column(folder.path(), "out/runs.csv", "visible_cells")
            .into_iter()
            .collect();
    assert!(cells.len() > 1, "{cells:?}");
}

#[test]
fn a_cell_that_cannot_be_run_is_named_before_anything_is() {
    let folder = folder(
        "safety_distances_m = [0.3, 6.0]\n[[mission]]\nkind = \"browse\"\n[[mission]]\nkind = \"search\"\n",
    );
    let (text, result) = run(folder.path(), "out", |_| {});
    let error = result.unwrap_err();
    assert_eq!((text.as_str(), error.exit_code()), ("", 2));
    let output = error.to_string();
    assert!(
        output.contains("in 2 of 4 cells: mission=browse scene=yard safety_m=6; mission=search"),
        "{output}"
    );
    assert!(!folder.path().join("out").exists());
}

#[test]
fn a_changed_file_is_refused_until_one_begins_anew() {
    let folder = folder("[[mission]]\nkind = \"browse\"\n");
    assert!(run(folder.path(), "out", |_| {}).1.is_ok());
    fs::write(
        folder.path().join("yard.scene.toml"),
        SCENE.replace("4.5", "4.4"),
    )
    .unwrap();
    let error = run(folder.path(), "out", |_| {}).1.unwrap_err();
    assert!(
        error.exit_code() == 2 && error.to_string().contains("--fresh"),
        "{error}"
    );
    assert!(
        run(folder.path(), "out", |args| args.fresh = true)
            .1
            .is_ok()
    );
}

#[test]
fn one_run_alone_is_the_run_of_the_grid() {
    let folder = folder(GRID);
    assert!(run(folder.path(), "grid", |_| {}).1.is_ok());
    let (text, result) = run(folder.path(), "alone", |args| args.only = Some(5));
    // It drives against a wall, and stops before it.
    let why = result.unwrap_err().to_string();
    assert!(why.ends_with("no vehicle did its mission"), "{why}");
    assert!(
        text.starts_with("run 5: mission=against scene=yard safety_m=0.3 seed=2\n"),
        "{text}"
    );
    let log = read(folder.path(), "alone/run.log");
    let hash = format!("{:016x}", crate::sim::log::hash(log.bytes().map(u64::from)));
    let csv = read(folder.path(), "grid/runs.csv");
    let row = csv.lines().nth(6).unwrap();
    assert!(row.ends_with(&hash), "{csv}");
    assert!(
        row.contains(",failed,no vehicle did its mission,"),
        "as sim says it: {csv}"
    );
    let beyond = run(folder.path(), "alone", |args| args.only = Some(8))
        .1
        .unwrap_err();
    assert!(
        beyond.exit_code() == 2 && beyond.to_string().contains("0 to 7"),
        "{beyond}"
    );
}

#[test]
fn an_axis_has_its_own_name_and_that_of_what_it_measures() {
    for (word, axis) in [
        ("mission", Axis::Mission),
        ("safety_m", Axis::Safety),
        ("safety", Axis::Safety),
        ("distance", Axis::Safety),
        ("cell", Axis::Cell),
        ("cell_m", Axis::Cell),
    ] {
        assert_eq!(super::parse_axis(word), Ok(axis));
    }
    assert!(super::parse_axis("distances").is_err());
}
