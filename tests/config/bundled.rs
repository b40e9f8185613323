//! The bundled example is what the documentation says it is.

use tomoswarm::config::{self, AfterSweep, Config, PlannerChoice, bundled};
use tomoswarm::geom::{Point, Rect};

fn courtyard(vehicles: Option<usize>) -> config::Sim {
    let text = bundled::load(bundled::COURTYARD).unwrap();
    config::read_sim(bundled::COURTYARD, &text, vehicles, &mut |path| {
        bundled::load(path)
    })
    .unwrap()
}

#[test]
fn the_bundled_courtyard_has_the_constants_of_the_phantoms() {
    let sim = courtyard(None);
    assert_eq!(sim.vehicles.count, 2);
    assert!(sim.empty_sweep);
    assert_eq!(sim.end, AfterSweep::Return);
    assert_eq!(
        (sim.sweep.planner, sim.sweep.positions),
        (PlannerChoice::RotatingGap, 76)
    );
    assert_eq!(sim.sweep.laps, None);
    assert_eq!(
        sim.venue.area,
        Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0))
    );
    assert_eq!((sim.radio.rician_k, sim.radio.packet_sd_db), (8.0, 2.0));
    assert_eq!(
        (
            sim.radio.p0_dbm,
            sim.radio.exponent,
            sim.radio.reception.sensitivity_dbm
        ),
        (-40.0, 2.0, -100.0)
    );
    assert_eq!(sim.vehicles.pose_sd_m, 0.05);
    let persons = sim.scene.random_persons.unwrap();
    assert_eq!(
        (persons.count, persons.radius_m, persons.db_per_m),
        (2, 0.3, 10.0)
    );
    assert_eq!(
        (
            persons.keep_from_border_m,
            persons.keep_from_objects_m,
            persons.apart_m
        ),
        (2.0, 1.5, 3.0)
    );
    assert!(
        sim.scene
            .materials
            .values()
            .all(|material| material.db_per_m == 20.0)
    );
    let shapes = bundled::load(&sim.scene.wrl.unwrap()).unwrap();
    for name in sim.scene.materials.keys() {
        assert!(
            shapes.contains(&format!("DEF {name} ")),
            "{name} is no shape of the scene"
        );
    }
}

#[test]
fn the_courtyard_has_room_for_two_to_eight_vehicles() {
    for count in 2..=8 {
        let sim = courtyard(Some(count));
        assert_eq!(sim.vehicle_ids().count(), count);
        assert!(sim.vehicle_ids().all(|id| sim.home(id).is_some()));
    }
}

#[test]
fn a_number_from_the_command_line_is_checked_like_one_in_the_file() {
    let text = bundled::load(bundled::COURTYARD).unwrap();
    let problems = config::read_sim(bundled::COURTYARD, &text, Some(9), &mut |path| {
        bundled::load(path)
    })
    .unwrap_err();
    assert_eq!(
        problems.to_string(),
        "configs/courtyard.sim.toml:12: vehicles.count = 9 (asked for): is out of range; \
         a whole number from 2 to 8 is allowed"
    );
}

#[test]
fn a_simulation_needs_only_a_venue_and_a_scene() {
    let text = "kind = \"sim\"\nvenue = \"courtyard.venue.toml\"\nscene = \"../scenes/courtyard.scene.toml\"\n";
    let config = config::read("configs/mine.sim.toml", text, &mut |path| {
        bundled::load(path)
    })
    .unwrap();
    let Config::Sim(sim) = config else {
        panic!("a sim file is a simulation")
    };
    // The bundled file spells out defaults, except that it sweeps the empty scene first.
    assert_eq!(
        config::Sim {
            empty_sweep: true,
            ..*sim
        },
        courtyard(None)
    );
}

#[test]
fn every_bundled_experiment_can_be_run() {
    let root = env!("CARGO_MANIFEST_DIR");
    let mut loader =
        |path: &str| std::fs::read_to_string(path).map_err(|error| format!("{path}: {error}"));
    let mut count = 0;
    for folder in ["configs", "tests/doors", "tests/pens", "tests/slabs"] {
        for entry in std::fs::read_dir(format!("{root}/{folder}")).unwrap() {
            let path = entry.unwrap().path();
            let name = path.to_str().unwrap().to_owned();
            if !name.contains("/experiment") {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let Config::Experiment(grid) = config::read(&name, &text, &mut loader).unwrap() else {
                panic!("{name} is no experiment")
            };
            for cell in 0..grid.cells() {
                let sim = grid.sim(cell, &mut loader);
                assert!(sim.is_ok(), "{name}: {}", sim.unwrap_err());
            }
            count += 1;
        }
    }
    assert!(count >= 8, "{count}");
}
