//! Grids over the bundled courtyard.

use std::collections::BTreeSet;

use proptest::collection::btree_set;
use proptest::prelude::*;
use tomoswarm_proto::TaskKind;

use super::*;
use crate::config::SimLines;
use crate::config::keys::{
    Flag, Form, KeyEntry, MaybeTable, NamedTables, Number, NumberBounds, Numbers, Others, Rowed,
    Rows, Whole, Word, Words,
};
use crate::config::overlay::FILES;
use crate::config::sim::SimTable;
use crate::config::task::MissionTable;
use crate::config::vehicle::SWARM;
use crate::config::{Config, bundled, read_experiment};
use crate::geom::Point;

const FILE: &str = "configs/trial.toml";

fn load(path: &str) -> Result<String, String> {
    match path {
        "configs/other.sim.toml" => Ok("kind = \"sim\"\nvenue = \"courtyard.venue.toml\"\n\
            scene = \"../scenes/courtyard.scene.toml\"\n[mission]\nkind = \"forward\"\ndistance_m = 3.0\n\
            [vehicles]\ncount = 2\nradius_m = 0.4\n"
            .to_owned()),
        "configs/broken.sim.toml" => Ok("kind = \"sim\"\nvenue = \"courtyard.venue.toml\"\n".to_owned()),
        path => bundled::load(path),
    }
}

fn grid(rest: &str) -> Experiment {
    read_experiment(
        FILE,
        &format!("kind = \"experiment\"\nsim = \"courtyard.sim.toml\"\n{rest}"),
    )
    .unwrap()
}

fn sim(grid: &Experiment, cell: usize) -> Sim {
    grid.sim(cell, &mut load).unwrap()
}

/// Returns what is wrong with an experiment's file, one line each.
fn wrong(rest: &str) -> String {
    let text = format!("kind = \"experiment\"\nsim = \"courtyard.sim.toml\"\n{rest}");
    read_experiment(FILE, &text).unwrap_err().to_string()
}

fn wrong_cell(grid: &Experiment, cell: usize) -> String {
    grid.sim(cell, &mut load).unwrap_err().to_string()
}

#[test]
fn without_axes_the_grid_is_the_simulation_itself() {
    let grid = grid("");
    assert_eq!((grid.runs(), grid.cells(), grid.seed_of(0)), (1, 1, None));
    let text = bundled::load("configs/courtyard.sim.toml").unwrap();
    let plain =
        crate::config::read_sim("configs/courtyard.sim.toml", &text, None, &mut load).unwrap();
    assert_eq!(sim(&grid, 0), plain);
    assert_eq!(grid.key(0, true), "scene=courtyard");
}

#[test]
fn the_last_axis_changes_fastest_and_every_value_reaches_its_key() {
    let grid = grid(
        "safety_distances_m = [0.3, 0.5]\ncells_m = [0.2, 0.25]\nseeds = [7, 9, 11]\nvehicles = [3]\n\
         [with.bus]\ndelay_ms = 33.0\n[[sensor]]\nname = \"narrow\"\nhalf_angle_deg = 5.0\n",
    );
    assert_eq!((grid.runs(), grid.cells(), grid.seeds()), (12, 4, 3));
    let keys: Vec<String> = [0, 1, 3, 11].map(|run| grid.key(run, true)).to_vec();
    assert_eq!(
        keys[0],
        "scene=courtyard safety_m=0.3 cell_m=0.2 sensor=narrow vehicles=3 seed=7"
    );
    assert!(keys[1].ends_with("cell_m=0.2 sensor=narrow vehicles=3 seed=9"));
    assert!(keys[2].contains("safety_m=0.3 cell_m=0.25"));
    assert!(keys[3].contains("safety_m=0.5 cell_m=0.25") && keys[3].ends_with("seed=11"));
    let last = sim(&grid, 3);
    // From the middle of a vehicle of 0.25 m.
    assert_eq!(last.safety.padding_m, 0.25);
    assert_eq!((last.venue.cell_m, last.vehicles.count), (0.25, 3));
    assert!((last.range.look.half_angle_rad() - 5f64.to_radians()).abs() < 1e-12);
    assert_eq!(last.bus.delay().as_millis(), 33);
    assert_eq!(sim(&grid, 0).safety.padding_m, 0.05);
}

#[test]
fn a_mission_takes_the_place_of_the_files_own() {
    let grid = grid(
        "[[mission]]\nkind = \"explore\"\n[[mission]]\nname = \"box\"\nkind = \"square\"\nsize_m = 4.0\n\
         [[scene]]\nsim = \"other.sim.toml\"\n[[scene]]\nname = \"yard\"\nsim = \"other.sim.toml\"\n\
         with.vehicles.radius_m = 0.3\n[scene.mission.box]\nsize_m = 6.0\n",
    );
    let tasks: Vec<TaskKind> = (0..4).filter_map(|cell| sim(&grid, cell).task).collect();
    assert_eq!(tasks[..2], [TaskKind::Explore, TaskKind::Explore]);
    let corner = |cell: usize, index: usize| Point::from(tasks[cell].places()[index]);
    let side_m = |cell: usize| corner(cell, 0).distance_to(corner(cell, 1));
    assert!((side_m(2) - 4.0).abs() < 1e-9 && (side_m(3) - 6.0).abs() < 1e-9);
    assert_eq!(
        (
            sim(&grid, 0).vehicles.body.radius_m,
            sim(&grid, 1).vehicles.body.radius_m
        ),
        (0.4, 0.3)
    );
    assert_eq!(grid.names(Axis::Mission), ["explore", "box"]);
    assert_eq!(grid.names(Axis::Scene), ["other", "yard"]);
}

#[test]
fn a_smaller_size_shrinks_the_area_about_its_centre_and_keeps_what_lies_beyond() {
    let grid = grid("sizes_m = [10.0]\n[with.sweep]\npositions = 40\n");
    let (small, plain) = (sim(&grid, 0).venue, sim(&self::grid(""), 0).venue);
    assert_eq!(
        (small.area.width_m(), small.area.centre()),
        (10.0, plain.area.centre())
    );
    let beyond_m = |area: Rect, at: Point| (area.min.x_m - at.x_m).max(at.x_m - area.max.x_m);
    for (new, old) in small
        .homes
        .iter()
        .zip(&plain.homes)
        .chain(small.fence.corners().iter().zip(plain.fence.corners()))
    {
        let (new_m, old_m) = (beyond_m(small.area, *new), beyond_m(plain.area, *old));
        assert!(
            old_m < 0.0 || (new_m - old_m).abs() < 1e-9,
            "{old:?} became {new:?}"
        );
    }
}

#[test]
fn what_is_laid_over_is_refused_where_it_stands() {
    let grid = grid(
        "cells_m = [0.2,\n  1.9]\n[[sensor]]\nname = \"blind\"\nsure_range_m = 900.0\nbeams = 3\n",
    );
    let text = wrong_cell(&grid, 0);
    assert!(
        text.contains("configs/trial.toml:7: range.sure_range_m = 900.0: is out of range"),
        "{text}"
    );
    assert!(
        text.contains("configs/trial.toml:8: range.beams: is not known"),
        "{text}"
    );
    let broken = self::grid("[[scene]]\nsim = \"broken.sim.toml\"\nscene = \"gone.toml\"\n");
    let text = wrong_cell(&broken, 0);
    assert!(
        text.contains(
            "configs/trial.toml:5: scene = \"gone.toml\": configs/gone.toml cannot be read"
        ),
        "{text}"
    );
    let broken = self::grid("[[scene]]\nsim = \"broken.sim.toml\"\n");
    let text = wrong_cell(&broken, 0);
    assert!(
        text.contains("configs/broken.sim.toml:1: scene: is missing"),
        "{text}"
    );
    let gone = self::grid("[[scene]]\nsim = \"gone.sim.toml\"\n");
    assert!(wrong_cell(&gone, 0).contains("configs/gone.sim.toml cannot be read"));
}

#[test]
fn a_bad_combination_is_told_from_the_good_ones() {
    let grid = grid("safety_distances_m = [0.2, 0.3, 5.0]\nsizes_m = [400.0]\n");
    let text = wrong_cell(&grid, 0);
    assert!(
        text.contains("configs/trial.toml:3: safety_distances_m = 0.2: is within the vehicle"),
        "{text}"
    );
    assert!(wrong_cell(&grid, 1).contains("trial.toml:4: sizes_m = 400: is more than the area"));
    let far = self::grid("safety_distances_m = [0.3, 5.0]\n");
    assert!(far.sim(0, &mut load).is_ok());
    assert!(
        wrong_cell(&far, 1).contains("the vehicle cannot look before it drives"),
        "{}",
        wrong_cell(&far, 1)
    );
}

#[test]
fn all_mistakes_of_a_cell_are_listed_at_once() {
    let grid = grid(
        "safety_distances_m = [0.2]\nsizes_m = [400.0]\n[with]\nspeed = 3\n[[mission]]\nname = \"a\"\nkind = \"fly\"\n\
         [[sensor]]\nbeams = 3\n",
    );
    let text = wrong_cell(&grid, 0);
    for part in [
        "trial.toml:3: safety_distances_m = 0.2: is within the vehicle",
        "trial.toml:4: sizes_m = 400: is more than the area",
        "trial.toml:6: speed: is not known",
        "trial.toml:9: mission.kind = \"fly\": is no choice",
        "trial.toml:11: range.beams: is not known",
    ] {
        assert!(text.contains(part), "{part} is missing in:\n{text}");
    }
    // Nothing is said of the radius of vehicles that nobody could read.
    let gone = self::grid("safety_distances_m = [0.2]\n[[scene]]\nsim = \"gone.sim.toml\"\n");
    let text = wrong_cell(&gone, 0);
    assert_eq!(text.lines().count(), 1, "{text}");
    assert!(
        text.contains("configs/gone.sim.toml cannot be read"),
        "{text}"
    );
}

#[test]
fn every_name_that_stands_twice_on_an_axis_is_listed() {
    let text = wrong("cells_m = [0.2, 0.5, 0.2, 0.2, 0.5]\n");
    for double in ["has 0.2 twice", "has 0.5 twice"] {
        assert_eq!(text.matches(double).count(), 1, "{text}");
    }
}

#[test]
fn all_mistakes_of_the_file_are_listed_at_once() {
    let text = wrong(
        "safety_distances_m = [0.3, \"far\",\n 99.0]\ncells_m = []\nvehicles = [0]\nseeds = -3\nspeed = 1\n\
         [[scene]]\nname = \"a\"\n[[scene]]\nname = \"a\"\n[scene.mission.none]\nx = 1\n[[mission]]\nname = \"a b\"\n\
         [[mission]]\nfault = [{ kind = \"bus\" }]\n",
    );
    for part in [
        "trial.toml:3: safety_distances_m = \"far\": is not allowed",
        "trial.toml:4: safety_distances_m = 99.0: is not allowed",
        "trial.toml:5: cells_m = []: is no such list",
        "trial.toml:6: vehicles = 0: is not allowed",
        "trial.toml:7: seeds = -3",
        "trial.toml:8: speed: is not known",
        "has a twice",
        "changes a mission none",
        "is no plain name",
        "is a list of tables",
    ] {
        assert!(text.contains(part), "{part} is missing in:\n{text}");
    }
}

#[test]
fn a_grid_without_end_is_refused() {
    let text = wrong("seeds = 100000\ncells_m = [0.2, 0.5]\n");
    assert!(
        text.contains("the grid has 200000 runs") && text.contains("at most 100000"),
        "{text}"
    );
    assert!(wrong("seeds = 1000000000\n").contains("seeds = 1000000000: is out of range"));
    assert_eq!(grid("seeds = 100000\n").runs(), 100_000);
}

#[test]
fn an_experiment_needs_a_simulation() {
    let text = read_experiment(FILE, "kind = \"experiment\"\n")
        .unwrap_err()
        .to_string();
    assert!(text.contains("sim: is missing"), "{text}");
    let text = read_experiment(FILE, "kind = \"experiment\"\n[[scene]]\nname = \"a\"\n")
        .unwrap_err()
        .to_string();
    assert!(text.contains("scene[0].sim: is missing"), "{text}");
}

/// Checks that two grids are the same: their runs by name, and every simulation.
pub(in crate::config) fn check_same_grid(
    first: &Experiment,
    second: &Experiment,
    loader: &mut Loader,
) {
    assert_eq!(
        (first.name(), first.runs(), first.cells()),
        (second.name(), second.runs(), second.cells())
    );
    for run in 0..first.runs() {
        assert_eq!(first.key(run, true), second.key(run, true));
        assert_eq!(first.seed_of(run), second.seed_of(run));
    }
    // Where things stand may differ.
    let without_lines = |sim: Sim| Sim {
        lines: SimLines::default(),
        ..sim
    };
    for cell in 0..first.cells() {
        match (first.sim(cell, loader), second.sim(cell, loader)) {
            (Ok(first), Ok(second)) => {
                assert_eq!(without_lines(first), without_lines(second), "cell {cell}");
            }
            // Mistakes name file and line.
            (Err(_), Err(_)) => {}
            (first, second) => panic!("cell {cell}: {first:?} and {second:?}"),
        }
    }
}

/// Returns a list of the numbers of a set as TOML, or nothing when it is empty.
fn axis(key: &str, values: &BTreeSet<u32>, per: f64) -> String {
    let list: Vec<String> = values
        .iter()
        .map(|value| (f64::from(*value) / per).to_string())
        .collect();
    if list.is_empty() {
        String::new()
    } else {
        format!("{key} = [{}]\n", list.join(", "))
    }
}

proptest! {
    /// What an experiment is written as has the same grid, whatever was given.
    #[test]
    fn a_random_experiment_is_read_back_as_it_was_written(
        safety_cm in btree_set(25u32..120, 0..3),
        cells_cm in btree_set(10u32..60, 0..3),
        sizes_m in btree_set(8u32..20, 0..3),
        vehicles in btree_set(1u32..5, 0..3),
        seeds in prop_oneof![
            Just(String::new()),
            (1u32..5).prop_map(|count| format!("seeds = {count}\n")),
            btree_set(0u32..1000, 1..4).prop_map(|seeds| axis("seeds", &seeds, 1.0)),
        ],
        angle_deg in proptest::option::of(3u32..40),
        with in prop_oneof![
            Just(""),
            Just("[with]\nuntil_s = 900\nvehicles.pose_sd_m = 0.03\n"),
            Just("[with.mission]\nkind = \"square\"\nsize_m = 5\n[with.safety]\nautonomy_s = 40\n"),
        ],
        missions in prop_oneof![
            Just(""),
            Just("[[mission]]\nkind = \"explore\"\n"),
            Just("[[mission]]\nname = \"box\"\nkind = \"square\"\nsize_m = 4\n[[mission]]\nkind = \"waypoints\"\nwaypoints_m = [[8, 8],\n  [9, 9]] # two\n"),
        ],
        scenes in prop_oneof![
            Just(""),
            Just("[[scene]]\nsim = \"other.sim.toml\"\n[[scene]]\nname = \"yard\"\nsim = \"other.sim.toml\"\nwith.vehicles.radius_m = 0.3\n"),
            Just("[[scene]]\nscene = \"../scenes/trees.scene.toml\"\nvenue = \"trees.venue.toml\"\n"),
        ],
    ) {
        let sensor = angle_deg.map(|angle| format!("[[sensor]]\nhalf_angle_deg = {angle}\n"));
        // Beside whole missions nothing is laid over one.
        let is_doubled = !missions.is_empty() && with.contains("[with.mission]");
        let with = if is_doubled { "" } else { with };
        let text = format!(
            "name = \"random\"\n{}{}{}{}{seeds}{with}{missions}{scenes}{}",
            axis(SAFETY, &safety_cm, 100.0),
            axis(CELLS, &cells_cm, 100.0),
            axis(SIZES, &sizes_m, 1.0),
            axis("vehicles", &vehicles, 1.0),
            sensor.unwrap_or_default(),
        );
        let first = grid(&text);
        let written = crate::config::to_toml(&Config::Experiment(Box::new(first.clone())));
        let second = read_experiment("-", &written).unwrap_or_else(|problems| panic!("{problems}\n{written}"));
        prop_assert_eq!(&crate::config::to_toml(&Config::Experiment(Box::new(second.clone()))), &written);
        check_same_grid(&first, &second, &mut load);
    }
}

#[test]
fn what_is_laid_over_a_mission_beside_whole_ones_is_refused() {
    let mission = "[[mission]]\nkind = \"pathfind\"\n";
    let laid = "[with.mission]\nwaypoints_m = [[8.0, 8.0]]\n";
    let row = "[[scene]]\nsim = \"a.sim.toml\"\n[scene.with.mission]\nrounds = 2\n";
    for (text, place) in [
        (
            format!("sim = \"a.sim.toml\"\n{mission}{laid}"),
            "e.toml:6: with.mission",
        ),
        (format!("{mission}{row}"), "e.toml:7: scene[0].with.mission"),
    ] {
        let text = format!("kind = \"experiment\"\n{text}");
        let problems = read_experiment("e.toml", &text).expect_err("it is refused");
        let expected = format!(
            "{place}: has no effect: each [[mission]] is a whole mission of its own; keys of a mission belong into \
             [[mission]], or into [scene.mission.NAME]"
        );
        assert!(problems.to_string().contains(&expected), "{problems}");
    }
}

/// Notes the keys whose texts are read with the folder of their file before them.
#[derive(Default)]
struct Files(BTreeSet<&'static str>);

impl Keys for Files {
    fn number(&mut self, _: &mut f64, _: Number) {}

    fn maybe_number(&mut self, _: &mut Option<f64>, _: NumberBounds<f64>) {}

    fn needed_number(&mut self, _: &mut f64, _: NumberBounds<f64>) {}

    fn whole(&mut self, _: &mut usize, _: Whole) {}

    fn maybe_whole(&mut self, _: &mut Option<usize>, _: NumberBounds<usize>) {}

    fn flag(&mut self, _: &mut bool, _: Flag) {}

    fn word(&mut self, _: &mut dyn Word, _: Words) {}

    fn numbers(&mut self, _: &mut Vec<f64>, _: Numbers) {}

    fn form(&mut self, value: &mut dyn Form, key: KeyEntry) {
        let text = format!("{} = \"named\"", key.name);
        let source = Source::new("folder/file", &text);
        let tree = source.parse();
        value.read(&Section::root(&source, &tree), key.name);
        if value.to_toml().as_deref() == Some("\"folder/named\"") {
            self.0.insert(key.name);
        }
    }

    fn moved(&mut self, _: &'static str, _: &'static str) {}

    fn table(&mut self, value: &mut dyn Keyed, _: KeyEntry) {
        value.keys(self);
    }

    fn maybe_table(&mut self, value: &mut dyn MaybeTable, _: KeyEntry) {
        value.fill().keys(self);
    }

    fn rows(&mut self, _: &mut dyn Rows, _: Rowed) {}

    fn named_tables(&mut self, _: &mut dyn NamedTables, _: KeyEntry) {}

    fn others(&mut self, _: &mut Layer, _: Others) {}
}

/// What is laid over a simulation or a mission is written with the folder of the experiment's file before it.
#[test]
fn the_files_that_may_be_laid_over_are_those_that_the_keys_declare() {
    let mut files = Files::default();
    SimTable {
        sim: &mut Sim::blank(),
        allowed: &SWARM,
        asked: None,
    }
    .keys(&mut files);
    MissionTable::each().for_each(|(_, mut mission)| mission.keys(&mut files));
    // A simulation opens its venue and its scene before it shows its keys.
    files.0.extend(["venue", "scene"]);
    assert_eq!(files.0, FILES.iter().copied().collect());
}
