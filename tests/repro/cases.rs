//! Cases that once went wrong, kept outside of this repository: a folder each with `x.sim.toml` and what it names. Runs one
//! and says how it ends; whether that is right is for the reader, and for the test that uses it.

use std::fmt;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tomoswarm::config;
use tomoswarm::sim::{PlaceFate, Scenario, VisibleScene};

/// Vehicles and seed of cases that need others than their file says.
const GIVEN: [(&str, Option<usize>, Option<u64>); 3] = [
    ("waypoints_peers", Some(4), None),
    ("copter_wall", None, Some(4)),
    ("copter_fence", None, Some(5)),
];

/// How a case ended.
pub struct CaseEnd {
    pub name: String,
    /// Whether the program panicked.
    pub has_panicked: bool,
    pub collisions: usize,
    pub fence_breaches: usize,
    /// All of it in words.
    words: String,
    took: Duration,
}

impl fmt::Display for CaseEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ({:.1} s): {}",
            self.name,
            self.took.as_secs_f64(),
            self.words
        )
    }
}

/// Returns the folder of the cases beside the project; `None`, said so, when it is not there.
pub fn folder_beside() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/repro");
    if folder.is_dir() {
        return Some(folder);
    }
    let _ = std::io::Write::write_fmt(
        &mut std::io::stderr(),
        format_args!("skipped: {} is not there\n", folder.display()),
    );
    None
}

/// Returns the cases of a folder, by name.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let cases = entries.filter(|entry| entry.path().join("x.sim.toml").is_file());
    let mut names: Vec<String> = cases
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Runs a case, at most so long.
pub fn run(folder: &Path, name: &str, limit: Duration) -> CaseEnd {
    let began = Instant::now();
    let mut end = CaseEnd {
        name: name.to_owned(),
        has_panicked: false,
        collisions: 0,
        fence_breaches: 0,
        words: String::new(),
        took: Duration::ZERO,
    };
    let run = AssertUnwindSafe(|| end.run(&folder.join(name), began + limit));
    if let Err(panic) = catch_unwind(run) {
        end.has_panicked = true;
        let why = panic.downcast_ref::<String>().map(String::as_str);
        end.words = format!("PANICKED: {}", why.unwrap_or("without words"));
    }
    end.took = began.elapsed();
    end
}

impl CaseEnd {
    fn run(&mut self, folder: &Path, until: Instant) {
        let scenario = match scenario(folder, &self.name) {
            Ok(scenario) => scenario,
            Err(why) => return self.words = format!("refused: {why}"),
        };
        let mut is_late = false;
        let ran = scenario.run(&mut |_| {
            is_late = Instant::now() > until;
            !is_late
        });
        let outcome = match ran {
            Ok(outcome) => outcome,
            Err(why) => return self.words = format!("fault: {why}"),
        };
        (self.collisions, self.fence_breaches) = (outcome.collisions.len(), outcome.fence_breaches);
        let mut words = vec![if is_late {
            "stopped because it took too long".to_owned()
        } else {
            outcome.failure.clone().unwrap_or("finished".to_owned())
        }];
        words.push(format!(
            "{:.0} s simulated",
            outcome.simulated.as_secs_f64()
        ));
        for (vehicle, mission) in &outcome.missions {
            if let Some((at, end)) = mission {
                words.push(format!(
                    "vehicle {vehicle} {end} after {:.0} s",
                    at.as_secs_f64()
                ));
            }
        }
        let counted = [
            (self.collisions, "contacts"),
            (self.fence_breaches, "breaches of the fence"),
        ];
        words.extend(
            counted
                .iter()
                .filter(|(count, _)| *count > 0)
                .map(|(count, what)| format!("{count} {what}")),
        );
        if !outcome.places.is_empty() {
            let seen = VisibleScene::find(&scenario).expect("the scene was built once");
            let counts = seen.count_places(&outcome.places);
            let untried = outcome
                .places
                .iter()
                .filter(|place| place.fate == PlaceFate::NotTried);
            words.push(format!(
                "of {} places {} can be got to, {} of them were visited, {} called unreachable; {} not tried",
                outcome.places.len(),
                counts.reachable,
                counts.visited,
                counts.false_no_way,
                untried.count()
            ));
        }
        self.words = words.join("; ");
    }
}

/// Reads a case.
fn scenario(folder: &Path, name: &str) -> Result<Scenario, String> {
    let (vehicles, seed) = GIVEN
        .iter()
        .find(|(given, ..)| *given == name)
        .map_or((None, None), |(_, vehicles, seed)| (*vehicles, *seed));
    let mut loader = |file: &str| {
        fs::read_to_string(folder.join(file)).map_err(|error| format!("{file}: {error}"))
    };
    let text = loader("x.sim.toml")?;
    let sim = config::read_sim("x.sim.toml", &text, vehicles, &mut loader)
        .map_err(|problems| problems.to_string())?;
    if sim.scene.wrl.is_some() {
        return Err("cases with a file of shapes are not read here".to_owned());
    }
    let seed = seed.unwrap_or(sim.seed);
    Scenario::new(sim, Vec::new(), seed).map_err(|error| error.to_string())
}
