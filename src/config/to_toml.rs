//! What is made of the declared keys besides reading: a configuration as text, and the tables of the documentation.

use super::keys::{Tables, Writer};
use super::sim::{Sim, SimTable};
use super::task::MissionTable;
use super::vehicle::SWARM;
use super::{Config, Experiment, GroundFile, OperatorFile, SceneFile, Up, VehicleFile, Venue};

/// Returns a configuration as TOML: every key with its value, defaults included, and with unit and meaning as a comment.
///
/// Read back under a name without a folder it means the same: files are named as they were opened.
pub fn to_toml(config: &Config) -> String {
    match config {
        Config::Venue(venue) => Writer::file("venue", &mut venue.clone()),
        Config::Scene(scene) => Writer::file("scene", &mut scene.clone()),
        Config::Sim(sim) => Writer::file("sim", &mut sim_table(&mut sim.clone())),
        Config::Vehicle(file) => Writer::file("vehicle", &mut *file.clone()),
        Config::Ground(file) => Writer::file("ground", &mut *file.clone()),
        Config::Operator(file) => Writer::file("operator", &mut *file.clone()),
        Config::Experiment(experiment) => Writer::file("experiment", &mut *experiment.clone()),
    }
}

fn sim_table(sim: &mut Sim) -> SimTable<'_> {
    SimTable {
        sim,
        allowed: &SWARM,
        asked: None,
    }
}

/// Returns the tables of all keys as one text (Markdown), each between the lines that mark it in `configs/README.md`.
pub fn keys_in_words() -> String {
    let tables = key_tables().into_iter();
    tables
        .map(|(kind, tables)| {
            format!("<!-- keys of {kind} -->\n\n{tables}<!-- end of keys -->\n\n")
        })
        .collect()
}

/// Returns the tables of all keys, as Markdown, by the kind of file.
pub fn key_tables() -> Vec<(&'static str, String)> {
    vec![
        ("venue", Tables::of(&mut [&mut Venue::blank()])),
        ("scene", Tables::of(&mut [&mut SceneFile::of_shapes(Up::Y)])),
        ("sim", Tables::of(&mut [&mut sim_table(&mut Sim::blank())])),
        ("mission", Tables::of_kinds(MissionTable::each())),
        ("experiment", Tables::of(&mut [&mut Experiment::blank()])),
        ("vehicle", Tables::of(&mut [&mut VehicleFile::blank()])),
        ("ground", Tables::of(&mut [&mut GroundFile::blank()])),
        ("operator", Tables::of(&mut [&mut OperatorFile::blank()])),
    ]
}
