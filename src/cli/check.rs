//! `tomoswarm check FILE...`: validates files and prints what was understood, so that a mistake is found
//! at the desk. Runs nothing and writes nothing but its answer.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

#[cfg(feature = "hw")]
use super::check_devices::DeviceArgs;
use super::describe::{Line, describe};
use super::error::CliError;
use super::experiment;
use super::image::{bounds, read_file, read_with};
use super::load;
use super::read;
use super::scenario_warnings;
use super::true_places::{self, TruePlaces, read_places};
use crate::config::{self, Config, SceneFile, Up, bundled};
use crate::scene::VrmlScene;
use crate::sim::staging;

/// DEF names that are listed.
const NAMES_SHOWN: usize = 30;

/// Validate configs, scenes and recordings; print what was understood.
///
/// Every mistake of a configuration is listed with file, line, key, value and what is allowed, of a recording the first with
/// its line. A configuration that is right is printed as
/// TOML with all its values, also those that were left out and have defaults; read back from the same folder it means the
/// same. Nothing is written.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct CheckArgs {
    /// Files to check, or - for a configuration from standard input: .toml (venue, scene, sim, vehicle, ground, operator,
    /// experiment), .wrl (shapes), .csv (links, samples, marks) and .json (recordings); or a bundled simulation by name
    #[arg(required_unless_present = "keys", value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Print the tables of all keys, as they stand in configs/README.md
    #[arg(long, conflicts_with = "files")]
    pub keys: bool,
    #[cfg(feature = "hw")]
    #[command(flatten)]
    devices: DeviceArgs,
}

const AFTER_HELP: &str = "\
A simulation is checked together with the venue, the scene and the shapes that it names, an experiment with every
simulation of its grid.

Examples:
  tomoswarm check configs/courtyard.sim.toml          a simulation and all that it names
  tomoswarm check my.sim.toml | tomoswarm check -     the same again: files are named as seen from here
  tomoswarm check scenes/courtyard.wrl                faces, triangles and DEF names of shapes
  tomoswarm check out/courtyard-1/links.csv           how many links, and where
  tomoswarm check --devices /etc/tomoswarm/vehicle.toml   asks the devices of this vehicle

Exit codes: 0 all files are right, and all devices answer that were asked; 2 any is not or does not.";

/// What a file is taken for, by its ending.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    /// A configuration of any kind.
    Config,
    /// Shapes (VRML97).
    Shapes,
    /// Links, a recording, or where persons stood.
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
        if self.keys {
            return print_keys(out);
        }
        #[cfg(feature = "hw")]
        if self.devices.devices {
            return self.ask_devices(out);
        }
        for path in &self.files {
            match understand(path) {
                Ok(understood) => {
                    let written = out.write_all(understood.as_bytes());
                    written.map_err(|source| CliError::Write {
                        path: "standard output".into(),
                        source,
                    })?;
                }
                Err(error) => wrong.push(error),
            }
        }
        if wrong.is_empty() {
            Ok(())
        } else {
            Err(CliError::Several(wrong))
        }
    }
}

#[cfg(feature = "hw")]
impl CheckArgs {
    fn ask_devices(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let asked = self.files.iter().map(|path| {
            read::check_regular(path)?;
            self.devices.run(path, out)
        });
        let wrong: Vec<CliError> = asked.filter_map(Result::err).collect();
        match wrong.is_empty() {
            true => Ok(()),
            false => Err(CliError::Several(wrong)),
        }
    }
}

/// Prints the tables of all keys between the lines that mark them in `configs/README.md`.
fn print_keys(out: &mut dyn Write) -> Result<(), CliError> {
    let text = config::keys_in_words();
    out.write_all(text.as_bytes()).map_err(CliError::stdout)
}

fn kind_of(path: &Path) -> Result<Kind, CliError> {
    if path.is_dir() {
        let source = std::io::ErrorKind::IsADirectory.into();
        return Err(CliError::Read {
            path: path.to_owned(),
            source,
        });
    }
    let ending = path
        .extension()
        .and_then(|ending| ending.to_str())
        .unwrap_or_default();
    match ending.to_ascii_lowercase().as_str() {
        "toml" => Ok(Kind::Config),
        "wrl" => Ok(Kind::Shapes),
        "csv" | "json" => Ok(Kind::Recording),
        _ if !path.exists() => Err(CliError::Read {
            path: path.to_owned(),
            source: std::io::ErrorKind::NotFound.into(),
        }),
        _ => Err(CliError::Input {
            path: path.to_owned(),
            reason: "nothing is known about this ending; .toml, .wrl, .csv and .json are checked"
                .to_owned(),
        }),
    }
}

fn understand(path: &Path) -> Result<String, CliError> {
    if path == Path::new(read::STANDARD_INPUT) {
        return understand_config(path, &read::standard_input()?, &mut read::around(path));
    }
    if let Some(example) = load::bundled_one(Some(path)) {
        let text = bundled::load(example).unwrap_or_default();
        return understand_config(Path::new(example), &text, &mut |name| bundled::load(name));
    }
    if let Some(wrong) = load::no_such_name(path) {
        return Err(wrong);
    }
    let kind = kind_of(path)?;
    read::check_regular(path)?;
    match kind {
        Kind::Config => understand_config(path, &read::text(path)?, &mut read::around(path)),
        Kind::Shapes => understand_shapes(path),
        Kind::Recording => understand_recording(path),
    }
}

/// Reads a configuration; a simulation also as far as it can be told without running it.
fn understand_config(
    path: &Path,
    text: &str,
    loader: &mut config::Loader<'_>,
) -> Result<String, CliError> {
    let config = config::read(&read::shown(path), text, loader)?;
    let mut shapes_said = Vec::new();
    match &config {
        Config::Sim(sim) => {
            let shapes = load::shapes_of(&sim.scene, loader)?;
            shapes_said = shapes_lines(&shapes);
            let scenario = load::scenario(
                load::LoadedSimulation::new(*sim.clone(), shapes),
                Some(path),
                None,
            )?;
            let warnings = scenario_warnings::warnings(&scenario);
            let warnings = warnings.map_err(|error| CliError::Input {
                path: path.to_owned(),
                reason: error.to_string(),
            })?;
            shapes_said.extend(warnings.into_iter().map(|warning| ("warning", warning)));
        }
        Config::Scene(scene) => {
            let shapes = load::shapes_of(scene, loader)?;
            check_materials(path, scene, &shapes)?;
            let persons: Vec<_> = scene.persons.iter().map(staging::person).collect();
            staging::build(scene, &shapes.shapes, &persons).map_err(|error| CliError::Input {
                path: path.to_owned(),
                reason: format!("scene: {error}"),
            })?;
            shapes_said = shapes_lines(&shapes);
        }
        Config::Experiment(_) => experiment::check(path, text)?,
        Config::Venue(_) | Config::Vehicle(_) | Config::Ground(_) | Config::Operator(_) => {}
    }
    Ok(describe(&read::shown(path), &config, &shapes_said))
}

/// Refuses materials for shapes that there are none of; a simulation is refused for them as well.
fn check_materials(path: &Path, scene: &SceneFile, shapes: &VrmlScene) -> Result<(), CliError> {
    let is_known = |name: &str| {
        shapes
            .shapes
            .iter()
            .any(|shape| shape.names.iter().any(|known| **known == *name))
    };
    let unknown = |name: &String| CliError::Input {
        path: path.to_owned(),
        reason: format!(
            "material.{name}: no shape lies in a DEF of this name; expected one of: {}",
            names_line(shapes)
        ),
    };
    let wrong: Vec<CliError> = scene
        .materials
        .keys()
        .filter(|name| !is_known(name))
        .map(unknown)
        .collect();
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(CliError::Several(wrong))
    }
}

/// Reads shapes as they are, z up: only a scene file knows better.
fn understand_shapes(path: &Path) -> Result<String, CliError> {
    let shapes = load::read_shapes(&read::shown(path), Up::Z, &mut read::around(path))?;
    let lines = shapes_lines(&shapes)
        .into_iter()
        .map(|(name, value)| format!("  {name:<12} {value}\n"));
    Ok(format!(
        "{}: shapes (VRML97)\n{}",
        path.display(),
        lines.collect::<String>()
    ))
}

fn shapes_lines(scene: &VrmlScene) -> Vec<Line> {
    let (faces, triangles) = scene
        .shapes
        .iter()
        .fold((0, 0), |(faces, triangles), shape| {
            (faces + shape.faces, triangles + shape.triangles)
        });
    let count = scene.shapes.len();
    let shapes = format!(
        "{count}, of {faces} faces, {triangles} triangles; DEF names: {}",
        names_line(scene)
    );
    let warnings = scene
        .warnings
        .iter()
        .map(|warning| ("warning", warning.clone()));
    std::iter::once(("shapes", shapes))
        .chain(warnings)
        .collect()
}

/// Lists the DEF names of a scene, the first of them if there are many.
fn names_line(scene: &VrmlScene) -> String {
    let names: BTreeSet<&str> = scene
        .shapes
        .iter()
        .flat_map(|shape| shape.names.iter().map(|name| &**name))
        .collect();
    let shown: Vec<&str> = names.iter().copied().take(NAMES_SHOWN).collect();
    match shown.len() {
        0 => "none".to_owned(),
        count if count < names.len() => format!("{}, …", shown.join(", ")),
        _ => shown.join(", "),
    }
}

fn understand_recording(path: &Path) -> Result<String, CliError> {
    if true_places::is_list(&read::text(path)?) {
        return understand_places(path);
    }
    let recording = read_file(path)?;
    let unit = recording.unit.word();
    let what = match recording.is_of_samples {
        true => "samples",
        false => "links",
    };
    let heard: u64 = recording
        .links
        .iter()
        .map(|link| u64::from(link.packets))
        .sum();
    let of = match recording.is_of_samples {
        true => format!("{heard} of them heard"),
        false => format!("of {heard} packets"),
    };
    let area = bounds(recording.links.iter());
    Ok(format!(
        "{}: a recording\n  {what:<12} {}, {of}\n  ends         x {:.2} to {:.2}, y {:.2} to {:.2} {unit}\n",
        path.display(),
        recording.links.len(),
        area.min.x_m,
        area.max.x_m,
        area.min.y_m,
        area.max.y_m
    ))
}

/// Reads where persons truly stood: the marks of a run, or a list by hand.
fn understand_places(path: &Path) -> Result<String, CliError> {
    let TruePlaces { run, places } = read_with(path, &mut Vec::new(), read_places)?;
    let of_run = run.map_or(String::new(), |run| format!(", marks of run {run}"));
    let lines: String = places
        .iter()
        .map(|at| format!("  stood at     x {:.2}, y {:.2}\n", at.x_m, at.y_m))
        .collect();
    Ok(format!(
        "{}: where persons truly stood{of_run}, for `tomoswarm image --marks`\n  places       {}\n{lines}",
        path.display(),
        places.len()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(files: &[&str]) -> (String, Result<(), CliError>) {
        let mut out = Vec::new();
        let result = CheckArgs {
            keys: false,
            files: files.iter().map(PathBuf::from).collect(),
            #[cfg(feature = "hw")]
            devices: DeviceArgs::default(),
        }
        .run(&mut out);
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
            "slot 0.05 s",
        ] {
            assert!(text.contains(part), "{part} is missing in:\n{text}");
        }
    }

    #[test]
    fn bundled_simulations_are_checked_by_name_and_other_names_are_refused() {
        let (text, result) = run(&["house"]);
        assert!(result.is_ok() && text.contains("scene house"), "{text}");
        let (_, result) = run(&["castel"]);
        let refused = result.unwrap_err().to_string();
        assert!(refused.contains("did you mean castle?"), "{refused}");
    }

    #[test]
    fn of_what_is_no_toml_at_all_a_few_lines_are_listed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let check = |lines: usize, listed: usize, last: &str| {
            std::fs::write(&path, "1.0,2.0,3\n".repeat(lines)).unwrap();
            let refused = run(&[path.to_str().unwrap()]).1.unwrap_err().to_string();
            assert_eq!(refused.lines().count(), listed, "{refused}");
            assert!(refused.ends_with(last), "{refused}");
        };
        check(200, 6, "a.toml:6: no valid TOML, nor are 194 lines below");
        check(6, 6, "a.toml:6: no valid TOML");
    }

    #[test]
    fn marks_that_were_exported_are_described_and_refused_with_their_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run-3-marks.csv");
        let text =
            "# made by tomoswarm\nrun,x_m,y_m,z_m,marked\n3,3.2,7.5,0,2026-05-01T10:00:00Z\n";
        std::fs::write(&path, text).unwrap();
        let (told, result) = run(&[path.to_str().unwrap()]);
        assert!(result.is_ok(), "{result:?}");
        for part in [
            "truly stood, marks of run 3",
            "places       1",
            "x 3.20, y 7.50",
        ] {
            assert!(told.contains(part), "{part} is missing in:\n{told}");
        }
        std::fs::write(&path, text.replace("7.5", "north")).unwrap();
        let refused = run(&[path.to_str().unwrap()]).1.unwrap_err().to_string();
        assert!(
            refused.contains("run-3-marks.csv:3: found \"north\""),
            "{refused}"
        );
    }

    #[test]
    fn persons_where_nobody_is_found_are_warned_of_and_not_refused() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path.display().to_string()
        };
        put(
            "a.venue.toml",
            "kind = \"venue\"\nname = \"yard\"\narea_m = [0.0, 0.0, 6.0, 6.0]\n\
             fence_m = [[-2.5, -2.5], [8.5, -2.5], [8.5, 8.5], [-2.5, 8.5]]\nhomes_m = [[-1.2, 3.0], [7.2, 3.0]]\n\
             [datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n",
        );
        put(
            "a.scene.toml",
            "kind = \"scene\"\nname = \"yard\"\n[[object]]\nname = \"block\"\n\
             outline_m = [[2.5, 1.5], [3.5, 1.5], [3.5, 4.5], [2.5, 4.5]]\n\
             [[person]]\nat_m = [3.0, 3.0]\n[[person]]\nat_m = [5.0, 3.0]\n",
        );
        let sim = put(
            "a.sim.toml",
            "kind = \"sim\"\nvenue = \"a.venue.toml\"\nscene = \"a.scene.toml\"\n",
        );
        let (text, result) = run(&[&sim]);
        assert!(result.is_ok(), "{result:?}");
        assert!(
            text.contains("#   warning      person person-1 at (3.00, 3.00) m stands inside block"),
            "{text}"
        );
        assert!(!text.contains("person-2 at"), "{text}");
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
        assert!(
            error.to_string().starts_with("gone.toml: cannot be read: "),
            "{error}"
        );
    }
}
