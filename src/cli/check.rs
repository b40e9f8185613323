//! `tomoswarm check FILE...`: validates files and prints what was understood, so that a mistake is found
//! at the desk. Runs nothing and writes nothing but its answer.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::describe::describe;
use super::error::CliError;
use super::experiment;
use super::image::{bounds, read_file};
use super::load;
use super::read;
use crate::config::{self, Config, SceneFile, Up};
use crate::scene::VrmlScene;
use crate::sim::staging;

/// DEF names that are listed.
const NAMES_SHOWN: usize = 30;

/// Validate configs, scenes and recordings; print what was understood.
///
/// Every mistake is listed with file, line, key, value and what is allowed. What is right is shown with all its values,
/// also those that were left out and have defaults. Nothing is written.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct CheckArgs {
    /// Files to check: .toml (venue, scene, sim, vehicle, ground, operator, experiment), .wrl (shapes), .csv and .json (recordings)
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
}

const AFTER_HELP: &str = "\
A simulation is checked together with the venue, the scene and the shapes that it names, an experiment with every
simulation of its grid.

Examples:
  tomoswarm check configs/courtyard.sim.toml          a simulation and all that it names
  tomoswarm check scenes/courtyard.wrl                faces, triangles and DEF names of shapes
  tomoswarm check out/courtyard-1/links.csv           how many links, and where

Exit codes: 0 all files are right; 2 any is not.";

/// What a file is taken for, by its ending.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    /// A configuration of any kind.
    Config,
    /// Shapes (VRML97).
    Shapes,
    /// Links or a recording.
    Recording,
}

impl CheckArgs {
    /// Checks all files, prints what is right with each, and returns what is wrong with any.
    ///
    /// # Errors
    ///
    /// Everything that is wrong, after all files were looked at.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let mut wrong = Vec::new();
        for path in &self.files {
            match understand(path) {
                Ok(understood) => {
                    let written = write!(out, "{}: {understood}", path.display());
                    written.map_err(|source| CliError::Write { path: "standard output".into(), source })?;
                }
                Err(error) => wrong.push(error),
            }
        }
        if wrong.is_empty() { Ok(()) } else { Err(CliError::Several(wrong)) }
    }
}

fn kind_of(path: &Path) -> Result<Kind, CliError> {
    if path.is_dir() {
        let source = std::io::ErrorKind::IsADirectory.into();
        return Err(CliError::Read { path: path.to_owned(), source });
    }
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    match ending.to_ascii_lowercase().as_str() {
        "toml" => Ok(Kind::Config),
        "wrl" => Ok(Kind::Shapes),
        "csv" | "json" => Ok(Kind::Recording),
        _ => Err(CliError::Input {
            path: path.to_owned(),
            reason: "nothing is known about this ending; .toml, .wrl, .csv and .json are checked".to_owned(),
        }),
    }
}

fn understand(path: &Path) -> Result<String, CliError> {
    match kind_of(path)? {
        Kind::Config => understand_config(path),
        Kind::Shapes => understand_shapes(path),
        Kind::Recording => understand_recording(path),
    }
}

/// Reads a configuration; a simulation also as far as it can be told without running it.
fn understand_config(path: &Path) -> Result<String, CliError> {
    let text = read::text(path)?;
    let loader = &mut read::around(path);
    let config = config::read(&read::shown(path), &text, loader)?;
    let mut understood = describe(&config);
    match &config {
        Config::Sim(_) => {
            let loaded = load::load(Some(path), None)?;
            understood += &shapes_lines(&loaded.shapes);
            load::scenario(loaded, Some(path), None)?;
        }
        Config::Scene(scene) => {
            let shapes = load::shapes_of(scene, loader)?;
            check_materials(path, scene, &shapes)?;
            let persons: Vec<_> = scene.persons.iter().map(staging::person).collect();
            staging::build(scene, &shapes.shapes, &persons).map_err(|error| CliError::Input {
                path: path.to_owned(),
                reason: format!("scene: {error}"),
            })?;
            understood += &shapes_lines(&shapes);
        }
        Config::Experiment(_) => experiment::check(path)?,
        Config::Venue(_) | Config::Vehicle(_) | Config::Ground(_) | Config::Operator(_) => {}
    }
    Ok(understood)
}

/// Refuses materials for shapes that there are none of; a simulation is refused for them as well.
fn check_materials(path: &Path, scene: &SceneFile, shapes: &VrmlScene) -> Result<(), CliError> {
    let is_known =
        |name: &str| shapes.shapes.iter().any(|shape| shape.names.iter().any(|known| **known == *name));
    let unknown = |name: &String| CliError::Input {
        path: path.to_owned(),
        reason: format!(
            "material.{name}: no shape lies in a DEF of this name; expected one of: {}",
            names_line(shapes)
        ),
    };
    let wrong: Vec<CliError> = scene.materials.keys().filter(|name| !is_known(name)).map(unknown).collect();
    if wrong.is_empty() { Ok(()) } else { Err(CliError::Several(wrong)) }
}

/// Reads shapes as they are, z up: only a scene file knows better.
fn understand_shapes(path: &Path) -> Result<String, CliError> {
    let shapes = load::read_shapes(&read::shown(path), Up::Z, &mut read::around(path))?;
    Ok(format!("shapes (VRML97)\n{}", shapes_lines(&shapes)))
}

fn shapes_lines(scene: &VrmlScene) -> String {
    let (faces, triangles) = scene
        .shapes
        .iter()
        .fold((0, 0), |(faces, triangles), shape| (faces + shape.faces, triangles + shape.triangles));
    let mut text = format!(
        "  shapes       {}, of {faces} faces, {triangles} triangles; DEF names: {}\n",
        scene.shapes.len(),
        names_line(scene)
    );
    for warning in &scene.warnings {
        text += &format!("  warning      {warning}\n");
    }
    text
}

/// Lists the DEF names of a scene, the first of them if there are many.
fn names_line(scene: &VrmlScene) -> String {
    let names: BTreeSet<&str> =
        scene.shapes.iter().flat_map(|shape| shape.names.iter().map(|name| &**name)).collect();
    let shown: Vec<&str> = names.iter().copied().take(NAMES_SHOWN).collect();
    match shown.len() {
        0 => "none".to_owned(),
        count if count < names.len() => format!("{}, …", shown.join(", ")),
        _ => shown.join(", "),
    }
}

fn understand_recording(path: &Path) -> Result<String, CliError> {
    let recording = read_file(path)?;
    let unit = recording.unit.word();
    let packets: u64 = recording.links.iter().map(|link| u64::from(link.packets)).sum();
    let area = bounds(recording.links.iter());
    Ok(format!(
        "a recording\n  links        {} of {packets} packets\n  ends         x {:.2} to {:.2}, y {:.2} to {:.2} {unit}\n",
        recording.links.len(),
        area.min.x_m,
        area.max.x_m,
        area.min.y_m,
        area.max.y_m
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(files: &[&str]) -> (String, Result<(), CliError>) {
        let mut out = Vec::new();
        let result = CheckArgs { files: files.iter().map(PathBuf::from).collect() }.run(&mut out);
        (String::from_utf8(out).unwrap(), result)
    }

    #[test]
    fn a_good_simulation_is_described_with_its_defaults() {
        let root = env!("CARGO_MANIFEST_DIR");
        let (text, result) = run(&[&format!("{root}/configs/courtyard.sim.toml")]);
        assert!(result.is_ok(), "{result:?}");
        for part in [
            "a simulation",
            "2 vehicles",
            "venue courtyard",
            "scene courtyard",
            "2 random persons",
            "slot 50ms",
        ] {
            assert!(text.contains(part), "{part} is missing in:\n{text}");
        }
    }

    #[test]
    fn all_files_are_looked_at_although_one_is_wrong() {
        let root = env!("CARGO_MANIFEST_DIR");
        let venue = format!("{root}/configs/courtyard.venue.toml");
        let (text, result) = run(&["gone.toml", "a.xyz", &venue]);
        let error = result.unwrap_err();
        assert!(text.contains("a venue"), "{text}");
        assert_eq!(error.exit_code(), 2);
        assert_eq!(error.to_string().lines().count(), 2, "{error}");
        assert!(error.to_string().starts_with("gone.toml: cannot be read: "), "{error}");
    }
}
