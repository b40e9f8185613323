//! From file names to a scenario: the simulation file, what it names, and the shapes. Without a file, the
//! bundled example.

use std::path::{Path, PathBuf};

use tomoswarm_proto::{Revision, RunId};

use super::error::CliError;
use super::read;
use crate::config::{self, FileLine, Problems, SceneFile, Sim, SourceFile, bundled};
use crate::ground::planner::{Request, plan};
use crate::scene::{self, Person, Scene, VrmlScene};
use crate::sim::{Scenario, ScenarioError};
use crate::sweep::{PlanError, PlannedSweep, Ring, SweepError};

/// A scene whose lowest point is higher above the ground than this stands on nothing.
const FLOATS_M: f64 = 0.5;

/// So many other numbers of positions are tried at most.
const REMEDIES: usize = 40;

/// A simulation as read, with what its scene file warned about.
pub(super) struct LoadedSimulation {
    /// The simulation.
    pub sim: Sim,
    /// Its shapes.
    pub shapes: VrmlScene,
    /// All files that were read for it, each once.
    pub made_from: Vec<SourceFile>,
}

/// A scene as read.
pub(super) struct LoadedScene {
    /// What it is called.
    pub(super) name: String,
    /// What its file says; all defaults for shapes alone.
    pub(super) file: SceneFile,
    /// Its shapes.
    pub(super) shapes: VrmlScene,
    /// Who stands there.
    pub(super) persons: Vec<Person>,
    /// Everything together.
    pub(super) scene: Scene,
    /// The simulation, if the file is one.
    pub(super) sim: Option<Sim>,
}

impl LoadedSimulation {
    /// Puts together a simulation and its shapes that were read elsewhere.
    pub(super) fn new(sim: Sim, shapes: VrmlScene) -> LoadedSimulation {
        LoadedSimulation {
            sim,
            shapes,
            made_from: Vec::new(),
        }
    }
}

/// What reads a simulation's file.
type Read = fn(&str, &str, Option<usize>, &mut config::Loader<'_>) -> Result<Sim, Problems>;

/// Returns the bundled simulation that is meant: the courtyard without a file, or the one whose plain name is given where no
/// such file lies; a folder of that name, as `sim castle --out castle` makes one, is none.
pub(super) fn bundled_one(file: Option<&Path>) -> Option<&'static str> {
    let Some(path) = file else {
        return Some(bundled::COURTYARD);
    };
    path.to_str()
        .and_then(bundled::simulation)
        .filter(|_| is_no_file(path))
}

fn is_no_file(path: &Path) -> bool {
    !path.exists() || path.is_dir()
}

/// Returns the text of a simulation file; the bundled example without one.
///
/// # Errors
/// The file cannot be read.
#[cfg(feature = "net")]
pub(super) fn text(file: Option<&Path>) -> Result<String, CliError> {
    match (bundled_one(file), file) {
        (None, Some(path)) => read::text(path),
        (name, _) => Ok(bundled::load(name.unwrap_or(bundled::COURTYARD)).unwrap_or_default()),
    }
}

/// Reads a simulation file and everything that it names; the bundled example without one.
///
/// # Errors
/// Everything that is wrong with the files.
pub(super) fn load(
    file: Option<&Path>,
    vehicles: Option<usize>,
) -> Result<LoadedSimulation, CliError> {
    load_as(config::read_sim, file, vehicles)
}

/// Does the same for a world, which may hold more vehicles than can sweep together.
///
/// # Errors
/// Everything that is wrong with the files.
#[cfg(feature = "net")]
pub(super) fn load_world(
    file: Option<&Path>,
    vehicles: Option<usize>,
) -> Result<LoadedSimulation, CliError> {
    load_as(config::read_world, file, vehicles)
}

fn load_as(
    read_sim: Read,
    file: Option<&Path>,
    vehicles: Option<usize>,
) -> Result<LoadedSimulation, CliError> {
    if let Some(example) = bundled_one(file) {
        return load_with(read_sim, example, vehicles, &mut |name| bundled::load(name));
    }
    let Some(path) = file else {
        return Err(CliError::Fault("no simulation is bundled".to_owned()));
    };
    load_with(
        read_sim,
        &read::shown(path),
        vehicles,
        &mut read::around(path),
    )
    .map_err(|error| match error {
        // The simulation file itself is named by the user, not by another file.
        CliError::Input {
            path: ref missing, ..
        } if *missing == Path::new(&read::shown(path)) => {
            no_such_name(path).unwrap_or_else(|| read::text(path).err().unwrap_or(error))
        }
        other => other,
    })
}

/// Returns what is wrong with a plain name that is neither a file's nor a bundled simulation's.
pub(super) fn no_such_name(path: &Path) -> Option<CliError> {
    let is_name = |name: &&str| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    let name = path.to_str().filter(is_name).filter(|_| is_no_file(path))?;
    let meant = config::nearest(name, bundled::NAMES)
        .map_or(String::new(), |near| format!("; did you mean {near}?"));
    let reason = format!(
        "is neither a file nor a bundled simulation{meant} (bundled are {})",
        bundled::NAMES.join(", ")
    );
    Some(CliError::Input {
        path: path.to_owned(),
        reason,
    })
}

fn load_with(
    read_sim: Read,
    name: &str,
    vehicles: Option<usize>,
    loader: &mut config::Loader<'_>,
) -> Result<LoadedSimulation, CliError> {
    let unreadable = |reason| CliError::Input {
        path: name.into(),
        reason,
    };
    let mut made_from: Vec<SourceFile> = Vec::new();
    let mut noted = |name: &str| {
        let text = loader(name)?;
        let source = SourceFile::of(name, text.as_bytes());
        if !made_from.contains(&source) {
            made_from.push(source);
        }
        Ok(text)
    };
    let text = noted(name).map_err(unreadable)?;
    let sim = read_sim(name, &text, vehicles, &mut noted)?;
    let shapes = shapes_of(&sim.scene, &mut noted)?;
    Ok(LoadedSimulation {
        sim,
        shapes,
        made_from,
    })
}

/// Reads the shapes that a scene names; none when it names no file.
///
/// # Errors
/// The file cannot be read, or makes no sense.
pub(super) fn shapes_of(
    scene: &SceneFile,
    loader: &mut config::Loader<'_>,
) -> Result<VrmlScene, CliError> {
    let Some(file) = &scene.wrl else {
        return Ok(VrmlScene::default());
    };
    let mut shapes = read_shapes(file, scene.up, loader).map_err(|error| match error {
        CliError::Input { path, reason } => CliError::Input {
            path,
            reason: format!("{reason}; the scene's key `wrl` names it"),
        },
        other => other,
    })?;
    let lowest_m = shapes.shapes.iter().fold(f64::INFINITY, |low_m, shape| {
        low_m.min(shape.shape.lowest_m())
    }) + scene.offset_m[2];
    if lowest_m.is_finite() && lowest_m > FLOATS_M {
        shapes.warnings.push(format!(
            "{file}: the lowest point of all is {lowest_m:.2} m above the ground, and nothing stands on it; \
             see `up` and `offset_m`"
        ));
    }
    Ok(shapes)
}

/// Reads a file of shapes, and the files that it names.
///
/// # Errors
/// The file cannot be read, or makes no sense.
pub(super) fn read_shapes(
    file: &str,
    up: config::Up,
    loader: &mut config::Loader<'_>,
) -> Result<VrmlScene, CliError> {
    let text = loader(file).map_err(|reason| CliError::Input {
        path: file.into(),
        reason: format!("cannot be read: {reason}"),
    })?;
    let up = match up {
        config::Up::Y => scene::Up::Y,
        config::Up::Z => scene::Up::Z,
    };
    let mut inline = |name: &str| loader(&config::beside(file, name));
    scene::read_vrml(&text, file, up, &mut inline).map_err(|error| {
        let scene::VrmlError { file, line, reason } = error;
        CliError::Line {
            path: file.into(),
            line,
            reason,
        }
    })
}

/// Makes a scenario of what was loaded.
///
/// # Errors
/// What the files alone could not tell, e.g. a vehicle that starts inside a wall, or a ring too small for the sweep.
pub(super) fn scenario(
    loaded: LoadedSimulation,
    file: Option<&Path>,
    seed: Option<u64>,
) -> Result<Scenario, CliError> {
    let seed = seed.unwrap_or(loaded.sim.seed);
    let path = file.map_or_else(|| bundled::COURTYARD.into(), Path::to_owned);
    let made = Scenario::new(loaded.sim, loaded.shapes.shapes, seed).map(|mut scenario| {
        scenario.made_from = loaded.made_from;
        scenario
    });
    match made {
        Err(error) => Err(refusal(&error, path)),
        Ok(scenario) if !scenario.sim().is_planned_by_ground() => Ok(scenario),
        Ok(scenario) => match planned(&scenario) {
            Err(error) => {
                let remedy = remedy(&scenario, &error);
                let reason = format!("no sweep can be planned: {error}{remedy}");
                Err(CliError::Input { path, reason })
            }
            Ok(_) => Ok(scenario),
        },
    }
}

/// Makes the scenario of a world: nothing is swept by itself.
///
/// # Errors
/// What the files alone could not tell, e.g. a vehicle that starts inside a wall.
#[cfg(feature = "net")]
pub(super) fn world(
    loaded: LoadedSimulation,
    file: Option<&Path>,
    seed: Option<u64>,
) -> Result<Scenario, CliError> {
    let seed = seed.unwrap_or(loaded.sim.seed);
    let path = file.map_or_else(|| bundled::COURTYARD.into(), Path::to_owned);
    Scenario::new(loaded.sim, loaded.shapes.shapes, seed).map_err(|error| refusal(&error, path))
}

/// Returns the refusal of a scenario: with the line that is to be mended where one is known, otherwise with its file.
pub(super) fn refusal(error: &ScenarioError, path: PathBuf) -> CliError {
    let reason = error.to_string();
    match error.line() {
        Some(FileLine { file, line }) => CliError::Line {
            path: file.into(),
            line: *line,
            reason,
        },
        None => CliError::Input { path, reason },
    }
}

/// Returns what helps a sweep in which vehicles would come too close: fewer positions, which lie farther apart.
fn remedy(scenario: &Scenario, error: &SweepError) -> String {
    if !matches!(error, SweepError::Unsafe(PlanError::TooClose { .. })) {
        return String::new();
    }
    let (ring, now) = (scenario.ring(), scenario.ring().positions());
    // Patterns need a multiple of 4.
    let step = (now / REMEDIES).max(4).next_multiple_of(4);
    let fewer = (4..now).rev().filter(|count| count.is_multiple_of(4));
    let can_be_driven = |count: &usize| {
        let ring = Ring::new(ring.area(), *count);
        ring.is_ok_and(|ring| planned_on(scenario, &ring).is_ok())
    };
    match fewer.step_by(step / 4).find(can_be_driven) {
        Some(count) => format!(
            "; fewer positions lie farther apart: sweep.positions = {count} in place of {now} can be driven"
        ),
        None => format!(
            "; fewer sweep.positions than {now} do not help, a larger area, other homes, or a smaller separation_m may"
        ),
    }
}

/// Plans the sweep of a scenario from its homes, as the ground station does when a run begins.
///
/// # Errors
/// No sweep can be planned.
pub(super) fn planned(scenario: &Scenario) -> Result<PlannedSweep, SweepError> {
    planned_on(scenario, scenario.ring())
}

/// Plans the same sweep over the positions of another ring.
fn planned_on(scenario: &Scenario, ring: &Ring) -> Result<PlannedSweep, SweepError> {
    let sim = scenario.sim();
    let places = sim
        .vehicle_ids()
        .filter_map(|id| Some((id, sim.home(id)?)))
        .collect();
    let request = Request {
        run: RunId(1),
        revision: Revision(1),
        places,
        first_lap: 0,
        task: None,
    };
    plan(
        ring,
        scenario.method(),
        sim.venue.swarm.separation_m,
        &request,
    )
}
