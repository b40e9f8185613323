//! What good runs leave: the same bytes for the same seed, figures under their promised names, plans that a
//! program can read; and files from other editors and other folders.

use serde_json::Value;

use super::program_runner::{ProgramOutput, ProgramRunner, SCENE, SHAPES, SIM, VENUE};

fn sim(runner: &ProgramRunner, more: &[&str]) -> ProgramOutput {
    runner.run(&[&["sim", "small.sim.toml"], more].concat())
}

fn summary(runner: &ProgramRunner, folder: &str) -> Value {
    serde_json::from_slice(&runner.read(&format!("{folder}/summary.json"))).unwrap()
}

#[test]
fn the_same_seed_gives_the_same_bytes_in_two_processes() {
    let runner = ProgramRunner::new();
    for folder in ["one", "some/where/else"] {
        assert_eq!(sim(&runner, &["--seed", "5", "--out", folder]).code, 0);
    }
    assert_eq!(sim(&runner, &["--seed", "6", "--out", "other"]).code, 0);
    let names = runner.names_in("one");
    assert_eq!(names, runner.names_in("some/where/else"));
    for name in names.iter().filter(|name| *name != "summary.json") {
        assert_eq!(
            runner.read(&format!("one/{name}")),
            runner.read(&format!("some/where/else/{name}")),
            "{name}"
        );
    }
    let without_wall = |folder: &str| {
        let mut summary = summary(&runner, folder);
        let figures = summary.as_object_mut().unwrap();
        assert!(figures.remove("wall_s").is_some() && figures.remove("speed_factor").is_some());
        summary
    };
    assert_eq!(without_wall("one"), without_wall("some/where/else"));
    assert_ne!(runner.read("one/run.log"), runner.read("other/run.log"));
}

#[test]
fn the_bundled_example_is_the_same_in_two_processes() {
    let runner = ProgramRunner::new();
    for folder in ["one", "two"] {
        let output = runner.run(&["sim", "--until", "60", "--out", folder]);
        assert_eq!(output.code, 1, "{output:?}");
        assert!(
            output.err.contains(
                "the sweep did not end in time: the run was given up after 60 s (until_s)"
            ),
            "{output:?}"
        );
    }
    for name in ["run.log", "empty.csv", "links.csv", "map.png"] {
        assert_eq!(
            runner.read(&format!("one/{name}")),
            runner.read(&format!("two/{name}")),
            "{name}"
        );
    }
    assert_eq!(summary(&runner, "one")["finished"], false);
}

#[test]
fn a_summary_holds_what_was_promised() {
    let runner = ProgramRunner::new();
    runner.change("small.sim.toml", "laps = 1", "laps = 6");
    runner.change("small.sim.toml", "until_s = 600.0", "until_s = 3600.0");
    let output = sim(&runner, &["--out", "run"]);
    assert_eq!((output.code, output.err.as_str()), (0, ""));
    let summary = summary(&runner, "run");
    assert_eq!(summary["finished"], true);
    for key in ["simulated_s", "wall_s", "speed_factor", "min_separation_m"] {
        assert!(
            summary[key].as_f64().is_some_and(|value| value > 0.0),
            "{key} in {summary}"
        );
    }
    assert!(
        summary["links"].as_u64().is_some_and(|links| links > 50),
        "{summary}"
    );
    assert_eq!(
        (&summary["collisions"], &summary["fence_breaches"]),
        (&Value::from(0), &Value::from(0))
    );
    let found = summary["found"].as_array().unwrap();
    assert!(!found.is_empty(), "{summary}");
    for find in found {
        for key in ["x_m", "y_m", "strength", "error_m"] {
            assert!(find[key].is_f64(), "{key} in {find}");
        }
    }
    let names = runner.names_in("run");
    let expected = [
        "coverage.png",
        "deviation.png",
        "empty.csv",
        "image.npy",
        "image.png",
        "links.csv",
        "links.png",
        "map.png",
        "residuals.png",
        "run.log",
        "structure.npy",
        "structure.png",
        "summary.json",
        "track-1.waypoints",
        "track-2.waypoints",
    ];
    assert_eq!(names, expected);
}

#[test]
fn without_an_empty_sweep_no_change_is_shown_and_the_summary_says_why() {
    let runner = ProgramRunner::new();
    runner.change(
        "small.sim.toml",
        "empty_sweep = true",
        "empty_sweep = false",
    );
    let persons = &SCENE[SCENE.find("[random_persons]").unwrap()..];
    runner.change("small.scene.toml", persons, "");
    let output = sim(&runner, &["--out", "run"]);
    assert_eq!(output.code, 0, "{output:?}");
    assert!(
        output.out.contains("not made          image: ") && output.out.contains("empty_sweep"),
        "{output:?}"
    );
    let names = runner.names_in("run");
    assert!(
        names
            .iter()
            .all(|name| !name.starts_with("image") && name != "empty.csv"),
        "{names:?}"
    );
    assert!(
        names.iter().any(|name| name == "structure.png"),
        "{names:?}"
    );
    assert_eq!(summary(&runner, "run")["found"], Value::Null);
}

#[test]
fn line_endings_and_byte_order_marks_of_other_systems_change_nothing() {
    let expected = ProgramRunner::new();
    assert_eq!(sim(&expected, &["--out", "run"]).code, 0);
    let runner = ProgramRunner::new();
    for (name, text) in [
        ("small.sim.toml", SIM),
        ("small.venue.toml", VENUE),
        ("small.scene.toml", SCENE),
        ("small.wrl", SHAPES),
    ] {
        runner.write(name, format!("\u{feff}{}", text.replace('\n', "\r\n")));
    }
    let output = sim(&runner, &["--out", "run"]);
    assert_eq!(output.code, 0, "{output:?}");
    assert_eq!(runner.read("run/run.log"), expected.read("run/run.log"));
    let links = String::from_utf8(runner.read("run/links.csv")).unwrap();
    let foreign = format!("\u{feff}{}", links.replace('\n', "\r\n"));
    runner.write("foreign.csv", foreign);
    for (links, npy) in [("run/links.csv", "a.npy"), ("foreign.csv", "b.npy")] {
        assert_eq!(runner.run(&["image", links, "--npy", npy]).code, 0);
    }
    assert_eq!(runner.read("a.npy"), runner.read("b.npy"));
}

#[test]
fn a_configuration_is_found_from_any_folder() {
    let runner = ProgramRunner::new();
    assert_eq!(sim(&runner, &["--out", "run"]).code, 0);
    std::fs::create_dir(runner.path("away")).unwrap();
    let absolute = runner.path("small.sim.toml");
    for (file, out) in [
        (absolute.to_str().unwrap(), "a"),
        ("../small.sim.toml", "b"),
        ("./../away/../small.sim.toml", "c"),
    ] {
        let mut program = runner.program(&["sim", file, "--out", out]);
        program.current_dir(runner.path("away"));
        let output = super::program_runner::output_of(program);
        assert_eq!(output.code, 0, "{output:?}");
        assert_eq!(
            runner.read("run/run.log"),
            runner.read(&format!("away/{out}/run.log"))
        );
    }
    runner.write(
        "small.sim.toml",
        SIM.replace(
            "small.venue.toml",
            runner.path("small.venue.toml").to_str().unwrap(),
        ),
    );
    assert_eq!(sim(&runner, &["--out", "run2"]).code, 0);
    assert_eq!(runner.read("run/run.log"), runner.read("run2/run.log"));
}

#[test]
fn the_links_of_a_run_give_its_images_again_and_all_are_accounted_for() {
    let runner = ProgramRunner::new();
    runner.change("small.sim.toml", "laps = 1", "laps = 6");
    runner.change("small.sim.toml", "until_s = 600.0", "until_s = 3600.0");
    assert_eq!(sim(&runner, &["--out", "run"]).code, 0);
    let image = |more: &[&str]| {
        let always = [
            "image",
            "run/links.csv",
            "--npy",
            "again.npy",
            "--json",
            "again.json",
        ];
        let output = runner.run(&[&always, more].concat());
        assert_eq!((output.code, output.err.as_str()), (0, ""));
        let again = std::fs::read(runner.path("again.npy")).unwrap();
        let json: serde_json::Value = serde_json::from_slice(&runner.read("again.json")).unwrap();
        let dropped = json["links"]["dropped"].as_array().unwrap().iter();
        let dropped: u64 = dropped.map(|of| of["links"].as_u64().unwrap()).sum();
        for peak in json["peaks"].as_array().unwrap() {
            // An image that is empty nearly everywhere has no noise to compare with.
            let is_faint = peak["significance"]
                .as_f64()
                .is_some_and(|ratio| ratio < 4.2);
            assert_eq!(peak["is_faint"].as_bool(), Some(is_faint), "{peak}");
        }
        let faint = output.out.matches("it may be noise").count();
        let peaks = json["peaks"].as_array().unwrap().iter();
        assert_eq!(faint, peaks.filter(|peak| peak["is_faint"] == true).count());
        (again, json["links"]["used"].as_u64().unwrap() + dropped)
    };
    let links = summary(&runner, "run")["links"].as_u64().unwrap();
    let (change, counted) = image(&["--empty", "run/empty.csv"]);
    assert_eq!(counted, links);
    assert!(change == std::fs::read(runner.path("run/image.npy")).unwrap());
    let (structure, _) = image(&[]);
    assert!(structure == std::fs::read(runner.path("run/structure.npy")).unwrap());
    assert!(
        image(&["--pixels", "20x20"]).0 != structure,
        "an option wins"
    );
}

#[test]
fn the_samples_of_a_run_give_its_image_again() {
    let runner = ProgramRunner::new();
    let arguments = ["--samples", "--no-pictures", "--out", "run"];
    assert_eq!(sim(&runner, &arguments).code, 0);
    let image = [
        "image",
        "run/samples.csv",
        "--empty",
        "run/empty-samples.csv",
    ];
    let output = runner.run(&[&image[..], &["--npy", "again.npy"]].concat());
    assert_eq!((output.code, output.err.as_str()), (0, ""));
    assert!(runner.read("again.npy") == runner.read("run/image.npy"));
    let samples = String::from_utf8(runner.read("run/samples.csv")).unwrap();
    let rows = samples.lines().filter(|line| !line.starts_with('#'));
    assert_eq!(
        rows.count() as u64,
        1 + summary(&runner, "run")["samples"].as_u64().unwrap()
    );
    // Of an earlier run that had them the next one leaves nothing.
    assert_eq!(sim(&runner, &["--no-pictures", "--out", "run"]).code, 0);
    let names = runner.names_in("run");
    assert!(
        !names.iter().any(|name| name.ends_with("samples.csv")),
        "{names:?}"
    );
}

#[test]
fn results_say_which_files_they_were_made_from() {
    let runner = ProgramRunner::new();
    assert_eq!(sim(&runner, &["--out", "run"]).code, 0);
    let names = |json: &Value| -> Vec<String> {
        let sources = json["made_from"].as_array().unwrap().iter();
        let checked = sources.map(|source| {
            let name = source["file"].as_str().unwrap();
            let size = runner.read(name).len() as u64;
            assert_eq!(source["bytes"].as_u64(), Some(size), "{source}");
            let sum = source["sha256"].as_str().unwrap();
            assert!(sum.len() == 64 && sum.chars().all(|one| one.is_ascii_hexdigit()));
            name.to_owned()
        });
        checked.collect()
    };
    let of_run = summary(&runner, "run");
    let files = [
        "small.sim.toml",
        "small.venue.toml",
        "small.scene.toml",
        "small.wrl",
    ];
    let mut said = names(&of_run);
    said.sort();
    let mut expected = files.map(str::to_owned).to_vec();
    expected.sort();
    assert_eq!(said, expected);

    let image = |json: &str| {
        let always = [
            "image",
            "run/links.csv",
            "--empty",
            "run/empty.csv",
            "--json",
            json,
        ];
        assert_eq!(runner.run(&always).code, 0);
        serde_json::from_slice::<Value>(&runner.read(json)).unwrap()
    };
    let first = image("first.json");
    assert_eq!(names(&first), ["run/links.csv", "run/empty.csv"]);
    assert_eq!(first["version"], env!("CARGO_PKG_VERSION"));
    // One byte more is another file.
    let mut links = runner.read("run/links.csv");
    links.push(b'\n');
    runner.write("run/links.csv", links);
    let second = image("second.json");
    assert_ne!(first["made_from"][0], second["made_from"][0]);
    assert_eq!(first["made_from"][1], second["made_from"][1]);
    assert_eq!(first["peaks"], second["peaks"]);
    let picture = runner.read("run/image.png");
    let says = format!("Software\0tomoswarm {}", env!("CARGO_PKG_VERSION"));
    assert!(
        picture
            .windows(says.len())
            .any(|part| part == says.as_bytes())
    );
}

#[test]
fn what_a_links_file_says_wrongly_of_its_image_is_refused_with_its_line() {
    let runner = ProgramRunner::new();
    assert_eq!(sim(&runner, &["--no-pictures", "--out", "run"]).code, 0);
    let good = String::from_utf8(runner.read("run/links.csv")).unwrap();
    for (from, to, output) in [
        ("bin_m = 0.5", "bin_m = -1.0", "bin_m = -1.0"),
        ("bin_m = 0.5", "bim_m = 0.5", "did you mean bin_m?"),
        ("# area_m = [", "# area_m = [9.0, ", "area_m"),
        ("# channel = 15", "# channel = 300", "channel = 300"),
    ] {
        assert!(good.contains(from), "{from}");
        runner.write("bad.csv", good.replacen(from, to, 1).as_str());
        let line = 1 + good[..good.find(from).unwrap()].matches('\n').count();
        let refused = runner.run(&["image", "bad.csv", "--npy", "bad.npy"]);
        let place = format!("bad.csv:{line}: ");
        assert_eq!(refused.code, 2, "{}", refused.err);
        assert!(
            refused.err.contains(&place) && refused.err.contains(output),
            "{}",
            refused.err
        );
        assert!(!runner.path("bad.npy").exists());
    }
    let empty = String::from_utf8(runner.read("run/empty.csv")).unwrap();
    assert!(empty.contains("# channel = 15"), "{empty}");
    runner.write(
        "other.csv",
        empty.replace("# channel = 15", "# channel = 26"),
    );
    let words = "image run/links.csv --npy bad.npy --empty";
    let with = |empty: &'static str| words.split(' ').chain([empty]).collect::<Vec<_>>();
    let said = "other.csv: found channel 26, expected an empty sweep on channel 15 as the sweep";
    runner.refused(&with("other.csv"), &[said]);
    assert!(!runner.path("bad.npy").exists());
    assert_eq!(runner.run(&with("run/empty.csv")).code, 0);
}

#[test]
fn the_default_folder_tells_scene_and_seed() {
    let runner = ProgramRunner::new();
    assert_eq!(sim(&runner, &["--seed", "9", "--no-pictures"]).code, 0);
    assert_eq!(summary(&runner, "out/small-9")["seed"], 9);
    assert_eq!(runner.names_in("out"), ["small-9"]);
}

#[test]
fn a_mission_that_is_no_sweep_has_no_laps_to_plan() {
    let runner = ProgramRunner::new();
    let places = "venue = \"small.venue.toml\"\nscene = \"small.scene.toml\"";
    for (kind, more) in [
        ("explore", ""),
        ("search", ""),
        ("browse", ""),
        ("waypoints", "waypoints_m = [[2.0, 1.0]]"),
        ("square", "size_m = 2.0"),
    ] {
        let file = format!("kind = \"sim\"\n{places}\n[mission]\nkind = \"{kind}\"\n{more}\n");
        runner.write("own.sim.toml", file);
        let said = format!("own.sim.toml: its mission is {kind}, which has no laps to plan");
        runner.refused(&["plan", "own.sim.toml"], &[&said]);
        runner.refused(&["plan", "own.sim.toml", "--stops"], &[&said]);
        assert_eq!(runner.run(&["check", "own.sim.toml"]).code, 0);
    }
}

#[test]
fn plans_for_two_to_eight_vehicles_can_be_read_by_a_program() {
    let runner = ProgramRunner::new();
    for count in 2..=8_usize {
        let output = runner.run(&["plan", "--vehicles", &count.to_string(), "--stops"]);
        assert_eq!((output.code, output.err.as_str()), (0, ""));
        check_stops(&output.out, count);
        let output = runner.run(&["plan", "--vehicles", &count.to_string()]);
        let lines_of = |word: &str| {
            output
                .out
                .lines()
                .filter(|line| line.starts_with(word))
                .count()
        };
        assert_eq!(
            (output.code, lines_of("vehicle ")),
            (0, count),
            "{}",
            output.out
        );
        assert!(
            lines_of("lap ") >= 1 && output.out.contains(" min at "),
            "{}",
            output.out
        );
    }
}

/// Every stop is in or around the courtyard's fence, and waits only for stops that there are.
fn check_stops(text: &str, vehicles: usize) {
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("vehicle,stop,x_m,y_m,dwell_ms,after"));
    let rows: Vec<(usize, u64, f64, f64, u64, String)> = lines
        .map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            let [vehicle, stop, x_m, y_m, dwell_ms, after] = fields[..] else {
                panic!("{line}")
            };
            let (vehicle, stop) = (vehicle.parse().unwrap(), stop.parse().unwrap());
            let (x_m, y_m) = (x_m.parse().unwrap(), y_m.parse().unwrap());
            (
                vehicle,
                stop,
                x_m,
                y_m,
                dwell_ms.parse().unwrap(),
                after.to_owned(),
            )
        })
        .collect();
    assert!(rows.len() > 4 * vehicles);
    let known: std::collections::BTreeSet<(usize, u64)> =
        rows.iter().map(|row| (row.0, row.1)).collect();
    assert_eq!(known.len(), rows.len(), "a stop is listed twice");
    let drivers: std::collections::BTreeSet<usize> = rows.iter().map(|row| row.0).collect();
    assert_eq!(drivers, (1..=vehicles).collect());
    for (_, _, x_m, y_m, _, after) in &rows {
        assert!(
            (-3.0..=23.0).contains(x_m) && (-3.0..=23.0).contains(y_m),
            "{x_m}, {y_m}"
        );
        for other in after.split_whitespace() {
            let (vehicle, stop) = other.split_once(':').unwrap();
            assert!(
                known.contains(&(vehicle.parse().unwrap(), stop.parse().unwrap())),
                "{other}"
            );
        }
    }
}

#[test]
fn a_scene_is_described_and_drawn_the_same_twice() {
    let runner = ProgramRunner::new();
    let pose = ["--pose", "3,-1,0.3,90", "--size", "120x80"];
    for folder in ["one", "two"] {
        let output =
            runner.run(&[&["scene", "small.sim.toml", "--out", folder], &pose[..]].concat());
        assert_eq!((output.code, output.err.as_str()), (0, ""), "{output:?}");
        for part in [
            "scene small",
            "1 shapes",
            "Wall: 20 dB/m",
            "person 1",
            "4 homes",
            "from (3.00, -1.00, 0.30)",
        ] {
            assert!(
                output.out.contains(part),
                "{part} is missing in {}",
                output.out
            );
        }
        assert_eq!(runner.names_in(folder), ["plan.png", "view.png"]);
    }
    for name in ["plan.png", "view.png"] {
        assert_eq!(
            runner.read(&format!("one/{name}")),
            runner.read(&format!("two/{name}")),
            "{name}"
        );
    }
    let rgb = |path: &str| {
        let mut reader = png::Decoder::new(std::io::Cursor::new(runner.read(path)))
            .read_info()
            .unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!((info.width, info.height), (120, 80));
        bytes
    };
    // The wall is 3.85 m ahead, 1 m to either side and 1.7 m up: (60 / tan 30 degrees) / 3.85 = 27 pixels to either side
    // of the middle, and higher than the picture.
    let (view, pixel) = (rgb("one/view.png"), |x: usize, y: usize| 3 * (y * 120 + x));
    let differ = |(x, y): (usize, usize), (u, v): (usize, usize)| {
        (0..3)
            .map(|channel| view[pixel(x, y) + channel].abs_diff(view[pixel(u, v) + channel]))
            .max()
            .unwrap()
    };
    assert!(differ((60, 38), (36, 2)) < 4 && differ((60, 38), (84, 30)) < 4);
    assert!(differ((60, 38), (30, 38)) > 20 && differ((60, 38), (90, 38)) > 20);
    let other = runner.run(&["scene", "small.wrl", "--out", "one"]);
    assert_eq!(other.code, 0, "{other:?}");
    assert_ne!(runner.read("one/view.png"), runner.read("two/view.png"));
    assert_eq!(runner.names_in("one"), ["plan.png", "view.png"]);
}

#[test]
fn a_patrol_without_limits_is_done_when_its_battery_is_low_and_warned_of_when_that_comes_too_late()
{
    let runner = ProgramRunner::new();
    let patrol = "kind = \"sim\"\nvenue = \"small.venue.toml\"\nscene = \"small.scene.toml\"\nuntil_s = 600.0\n\
                  [mission]\nkind = \"patrol\"\nrounds = 0\n[vehicles]\ncount = 1\n";
    runner.write("small.sim.toml", patrol);
    let warning = "the patrol goes on until the battery is low, after";
    let output = runner.run(&["sim", "small.sim.toml", "--no-pictures"]);
    assert!(output.err.contains(warning), "{output:?}");
    assert_eq!(output.code, 1, "{output:?}");
    runner.write(
        "small.sim.toml",
        format!("{patrol}endurance_driving_s = 200\n"),
    );
    let output = runner.run(&["sim", "small.sim.toml", "--no-pictures"]);
    assert!(!output.err.contains(warning), "{output:?}");
    assert_eq!(output.code, 0, "{output:?}");
    assert!(
        output.out.contains("missions done     1 of 1"),
        "{output:?}"
    );
}
