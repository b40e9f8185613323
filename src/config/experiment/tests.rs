//! Grids over the bundled courtyard.

use super::*;
use crate::config::{bundled, read_experiment};

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
    read_experiment(FILE, &format!("kind = \"experiment\"\nsim = \"courtyard.sim.toml\"\n{rest}")).unwrap()
}

fn sim(grid: &Experiment, cell: usize) -> Sim {
    grid.sim(cell, &mut load).unwrap()
}

/// Gives what is wrong with an experiment's file, one line each.
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
    let plain = crate::config::read_sim("configs/courtyard.sim.toml", &text, None, &mut load).unwrap();
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
    assert_eq!(keys[0], "scene=courtyard safety_m=0.3 cell_m=0.2 sensor=narrow vehicles=3 seed=7");
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
    let tasks: Vec<crate::config::Task> = (0..4).map(|cell| sim(&grid, cell).task).collect();
    assert_eq!(tasks[..2], [crate::config::Task::Explore, crate::config::Task::Explore]);
    let side_m = |cell: usize| tasks[cell].places()[0].distance_to(tasks[cell].places()[1]);
    assert!((side_m(2) - 4.0).abs() < 1e-9 && (side_m(3) - 6.0).abs() < 1e-9);
    assert_eq!((sim(&grid, 0).vehicles.body.radius_m, sim(&grid, 1).vehicles.body.radius_m), (0.4, 0.3));
    assert_eq!(grid.names(Axis::Mission), ["explore", "box"]);
    assert_eq!(grid.names(Axis::Scene), ["other", "yard"]);
}

#[test]
fn a_smaller_size_shrinks_the_area_about_its_centre_and_keeps_what_lies_beyond() {
    let grid = grid("sizes_m = [10.0]\n[with.sweep]\npositions = 40\n");
    let (small, plain) = (sim(&grid, 0).venue, sim(&self::grid(""), 0).venue);
    assert_eq!((small.area.width_m(), small.area.centre()), (10.0, plain.area.centre()));
    let beyond_m = |area: Rect, at: Point| (area.min.x_m - at.x_m).max(at.x_m - area.max.x_m);
    for (new, old) in
        small.homes.iter().zip(&plain.homes).chain(small.fence.corners().iter().zip(plain.fence.corners()))
    {
        let (new_m, old_m) = (beyond_m(small.area, *new), beyond_m(plain.area, *old));
        assert!(old_m < 0.0 || (new_m - old_m).abs() < 1e-9, "{old:?} became {new:?}");
    }
}

#[test]
fn what_is_laid_over_is_refused_where_it_stands() {
    let grid =
        grid("cells_m = [0.2,\n  1.9]\n[[sensor]]\nname = \"blind\"\nsure_range_m = 900.0\nbeams = 3\n");
    let text = wrong_cell(&grid, 0);
    assert!(text.contains("configs/trial.toml:7: range.sure_range_m = 900.0: is out of range"), "{text}");
    assert!(text.contains("configs/trial.toml:8: range.beams: is not known"), "{text}");
    let broken = self::grid("[[scene]]\nsim = \"broken.sim.toml\"\nscene = \"gone.toml\"\n");
    let text = wrong_cell(&broken, 0);
    assert!(
        text.contains("configs/trial.toml:5: scene = \"gone.toml\": configs/gone.toml cannot be read"),
        "{text}"
    );
    let broken = self::grid("[[scene]]\nsim = \"broken.sim.toml\"\n");
    let text = wrong_cell(&broken, 0);
    assert!(text.contains("configs/broken.sim.toml:1: scene: is missing"), "{text}");
    let gone = self::grid("[[scene]]\nsim = \"gone.sim.toml\"\n");
    assert!(wrong_cell(&gone, 0).contains("configs/gone.sim.toml cannot be read"));
}

#[test]
fn a_bad_combination_is_told_from_the_good_ones() {
    let grid = grid("safety_distances_m = [0.2, 0.3, 5.0]\nsizes_m = [400.0]\n");
    let text = wrong_cell(&grid, 0);
    assert!(text.contains("configs/trial.toml:3: safety_distances_m = 0.2: is within the vehicle"), "{text}");
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
    assert!(text.contains("the grid has 200000 runs") && text.contains("at most 100000"), "{text}");
    assert!(wrong("seeds = 1000000000\n").contains("seeds = 1000000000: is out of range"));
    assert_eq!(grid("seeds = 100000\n").runs(), 100_000);
}

#[test]
fn an_experiment_needs_a_simulation() {
    let text = read_experiment(FILE, "kind = \"experiment\"\n").unwrap_err().to_string();
    assert!(text.contains("sim: is missing"), "{text}");
    let text =
        read_experiment(FILE, "kind = \"experiment\"\n[[scene]]\nname = \"a\"\n").unwrap_err().to_string();
    assert!(text.contains("scene[0].sim: is missing"), "{text}");
}
