//! `tomoswarm check FILE...`: validates files and prints what was understood, so that a mistake is found
//! at the desk. Runs nothing and writes nothing but its answer.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::describe::describe;
use super::error::CliError;
use super::image::bounds;
use super::load;
use super::read;
use super::recording::read_recording;
use crate::config::{self, Config, Up};
use crate::scene::VrmlScene;

/// DEF names that are listed.
const NAMES_SHOWN: usize = 30;

/// Validate configs, scenes and recordings; print what was understood.
///
/// Every mistake is listed with file, line, key, value and what is allowed. Exit code 2 if there is any.
#[derive(clap::Args, Debug)]
pub struct CheckArgs {
    /// Files to check: .toml (venue, scene, sim), .wrl, .csv, .json
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
}

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
                    written.map_err(|source| CliError::Write { path: "the answer".into(), source })?;
                }
                Err(error) => wrong.push(error),
            }
        }
        if wrong.is_empty() { Ok(()) } else { Err(CliError::Several(wrong)) }
    }
}

fn kind_of(path: &Path) -> Result<Kind, CliError> {
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
    let name = path.to_string_lossy();
    let config = config::read(&name, &text, &mut read::named_in_config)?;
    let mut understood = describe(&config);
    match &config {
        Config::Sim(_) => {
            let loaded = load::load(Some(path), None)?;
            understood += &shapes_lines(&loaded.shapes);
            load::scenario(loaded, Some(path), None)?;
        }
        Config::Scene(scene) => {
            understood += &shapes_lines(&load::shapes_of(scene, &mut read::named_in_config)?);
        }
        Config::Venue(_) => {}
    }
    Ok(understood)
}

/// Reads shapes as they are, z up: only a scene file knows better.
fn understand_shapes(path: &Path) -> Result<String, CliError> {
    let shapes = load::read_shapes(&path.to_string_lossy(), Up::Z, &mut read::named_in_config)?;
    Ok(format!("shapes (VRML97)\n{}", shapes_lines(&shapes)))
}

fn shapes_lines(scene: &VrmlScene) -> String {
    let (faces, triangles) = scene
        .shapes
        .iter()
        .fold((0, 0), |(faces, triangles), shape| (faces + shape.faces, triangles + shape.triangles));
    let names: BTreeSet<&str> =
        scene.shapes.iter().flat_map(|shape| shape.names.iter().map(|name| &**name)).collect();
    let shown: Vec<&str> = names.iter().copied().take(NAMES_SHOWN).collect();
    let more = if names.len() > shown.len() { ", …" } else { "" };
    let mut text = format!(
        "  shapes       {}, of {faces} faces, {triangles} triangles; DEF names: {}{more}\n",
        scene.shapes.len(),
        shown.join(", ")
    );
    for warning in &scene.warnings {
        text += &format!("  warning      {warning}\n");
    }
    text
}

fn understand_recording(path: &Path) -> Result<String, CliError> {
    let text = read::text(path)?;
    let recording = read_recording(text.as_bytes())
        .map_err(|problem| CliError::Input { path: path.to_owned(), reason: problem.to_string() })?;
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
