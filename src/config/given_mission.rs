//! A mission as the command line gives it: the keys of `[mission]`, and for one that the ground station plans those of
//! `[sweep]`, each as `KEY=VALUE`. They go through the same reader as a file, with the same limits; mistakes are said of
//! the option in which they stand.

use std::time::Duration;

use tomoswarm_proto::TaskKind;

use super::Loader;
use super::keys::{DeclaredKey, KeyEntry, Keyed, Keys, keys_of, quoted, read_table};
use super::mission::{PlannerChoice, SweepConfig, SweepTable, check_sweep};
use super::problem::{Problem, Problems};
use super::section::Section;
use super::sim::check_task;
use super::source::Source;
use super::task::MissionTable;
use super::vehicle::SWARM;
use super::venue::Venue;

/// The option that names a mission.
const KIND_OPTION: &str = "--mission";
/// The option that sets a key of it.
const KEY_OPTION: &str = "--set";

/// A mission as it was given.
#[derive(Clone, PartialEq, Debug)]
pub struct GivenMission {
    /// What the vehicles are out for; `None` = a sweep.
    pub task: Option<TaskKind>,
    /// How it is swept, if it is a sweep.
    pub sweep: GivenSweep,
}

/// What is given of a sweep; `None` = as the ground station's file has it.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct GivenSweep {
    /// How the stops are chosen.
    pub planner: Option<PlannerChoice>,
    /// Positions on the border of the area.
    pub positions: Option<usize>,
    /// Laps or rounds.
    pub laps: Option<usize>,
    /// How long a vehicle stays at a stop.
    pub dwell: Option<Duration>,
    /// How long it stays at most while it waits for a partner.
    pub dwell_limit: Option<Duration>,
}

impl GivenSweep {
    /// Returns all of a sweep.
    pub fn whole(sweep: &SweepConfig) -> GivenSweep {
        GivenSweep::of(sweep, |_| true)
    }

    /// Returns those keys of a sweep that are given.
    fn of(sweep: &SweepConfig, is_given: impl Fn(&str) -> bool) -> GivenSweep {
        GivenSweep {
            planner: is_given("planner").then_some(sweep.planner),
            positions: is_given("positions").then_some(sweep.positions),
            laps: sweep.laps.filter(|_| is_given("laps")),
            dwell: is_given("dwell_s").then(|| sweep.dwell()),
            dwell_limit: is_given("dwell_limit_s").then(|| sweep.dwell_limit()),
        }
    }
}

impl GivenMission {
    /// Returns the words for the kinds of missions, in the order in which they are told.
    pub fn kinds() -> impl Iterator<Item = &'static str> {
        MissionTable::each().map(|(word, _)| word)
    }

    /// Returns the kinds of missions by their words, each with the keys that it may be given by.
    pub fn declared() -> impl Iterator<Item = (&'static str, Vec<DeclaredKey>)> {
        MissionTable::each().map(|(word, mut mission)| {
            let mut keys = if mission.is_planned_by_ground() {
                let mut sweep = SweepConfig::default();
                let mission = mission.planner();
                keys_of(&mut SweepTable {
                    sweep: &mut sweep,
                    mission,
                })
            } else {
                keys_of(&mut mission)
            };
            let is_said = |key: &DeclaredKey| {
                key.name == "kind" || key.name == "planner" && mission.planner().is_some()
            };
            keys.retain(|key| !is_said(key));
            if mission.is_planned_by_ground() {
                for key in &mut keys {
                    key.default = "as the ground station's file has it".to_owned();
                }
            }
            (word, keys)
        })
    }

    /// Reads a mission of a kind with its keys, each `KEY=VALUE`, for so many vehicles of a venue; `None` = for all,
    /// however many. A value is written as in TOML; a word or the name of a file needs no quotes.
    ///
    /// # Errors
    /// Every mistake, by its option.
    pub fn read(
        kind: &str,
        set: &[String],
        (venue, vehicles): (&Venue, Option<usize>),
        loader: &mut Loader,
    ) -> Result<GivenMission, Problems> {
        let is_planned = MissionTable::each()
            .any(|(word, mission)| word == kind && mission.is_planned_by_ground());
        let table = if is_planned { "sweep" } else { "mission" };
        let mut text = format!("mission.kind = {}\n", quoted(kind));
        for given in set {
            let (key, value) = pair(given)?;
            text += &format!("{table}.{key} = {value}\n");
        }
        let keys: Vec<&str> = given_keys(set).collect();
        read_text(&text, &keys, (venue, vehicles), loader)
            .map_err(|problems| of_options(kind, set, problems))
    }
}

/// The two tables that a mission may be given by.
#[derive(Default)]
struct Tables {
    mission: MissionTable,
    sweep: SweepConfig,
}

impl Keyed for Tables {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Tables { mission, sweep } = self;
        let table = |name| KeyEntry {
            name,
            left_out: "",
            means: "",
        };
        to.table(mission, table("mission"));
        to.table(
            &mut SweepTable {
                sweep,
                mission: mission.planner(),
            },
            table("sweep"),
        );
    }
}

fn read_text(
    text: &str,
    keys: &[&str],
    (venue, vehicles): (&Venue, Option<usize>),
    loader: &mut Loader,
) -> Result<GivenMission, Problems> {
    let source = Source::new(KIND_OPTION, text);
    let tree = source.parse();
    let root = Section::root(&source, &tree);
    let mut tables = Tables::default();
    read_table(&mut tables, &root);
    let Tables { mut mission, sweep } = tables;
    let task = mission.task(&source, Some(venue), loader);
    // Which vehicles it is for is not known here: each refuses what it has no room for.
    check_task(&root, task.as_ref(), venue, 0.0);
    if mission.is_of_one() && vehicles != Some(1) {
        let allowed = "one vehicle is to be named: its autopilot carries the mission out by itself";
        root.refuse("mission.kind", "is one vehicle's alone", allowed);
    }
    if mission.is_planned_by_ground() {
        // Of all vehicles there are two at least.
        check_sweep(
            &source,
            &sweep,
            vehicles.unwrap_or(*SWARM.start()),
            mission.planner(),
        );
    }
    // Calibrate and the like name their planner themselves.
    let is_given =
        |key: &str| keys.contains(&key) || (key == "planner" && mission.planner().is_some());
    let sweep = GivenSweep::of(&sweep, is_given);
    source.finish(Some(GivenMission { task, sweep }))
}

/// Returns the key and the value of an option, the value as TOML.
fn pair(given: &str) -> Result<(&str, String), Problems> {
    let refused = |wrong: &str| {
        let allowed = "KEY=VALUE is expected, such as size_m=4".to_owned();
        let (file, wrong) = (KEY_OPTION.to_owned(), format!("{given:?} {wrong}"));
        let problem = Problem {
            file,
            line: 0,
            key: String::new(),
            value: String::new(),
            wrong,
            allowed,
        };
        Problems::new(KEY_OPTION, vec![problem])
    };
    let (key, value) = given.split_once('=').ok_or_else(|| refused("has no ="))?;
    let (key, value) = (key.trim(), value.trim());
    if key.is_empty() || !key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return Err(refused("names no key"));
    }
    if key == "kind" {
        return Err(refused("is what --mission says"));
    }
    // One option is one line, so that its mistakes can be told from those of others.
    let is_toml = !value.contains(['\n', '\r'])
        && toml::from_str::<toml::Table>(&format!("v = {value}")).is_ok();
    Ok((
        key,
        if is_toml {
            value.to_owned()
        } else {
            quoted(value)
        },
    ))
}

fn given_keys(set: &[String]) -> impl Iterator<Item = &str> {
    let pairs = set.iter().filter_map(|given| given.split_once('='));
    pairs.map(|(key, _)| key.trim())
}

/// Says of each mistake in which option it stands.
fn of_options(kind: &str, set: &[String], problems: Problems) -> Problems {
    let keys: Vec<&str> = given_keys(set).collect();
    let of_option = |problem: Problem| {
        if problem.file != KIND_OPTION {
            return problem;
        }
        let key = problem
            .key
            .split_once('.')
            .map_or(problem.key.as_str(), |(_, key)| key)
            .to_owned();
        let by_line = problem
            .line
            .checked_sub(2)
            .and_then(|line| keys.get(line))
            .copied();
        let is_set = keys.contains(&key.as_str()) || by_line.is_some();
        let file = if is_set {
            KEY_OPTION.to_owned()
        } else {
            format!("{KIND_OPTION} {kind}")
        };
        let key = if key.is_empty() {
            by_line.unwrap_or_default().to_owned()
        } else {
            key
        };
        Problem {
            file,
            line: 0,
            key,
            ..problem
        }
    };
    Problems::new(
        KIND_OPTION,
        problems.into_list().into_iter().map(of_option).collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{PlannerChoice, bundled};
    use tomoswarm_proto::Position;

    fn read(kind: &str, set: &[&str]) -> Result<GivenMission, String> {
        let text = bundled::load(bundled::COURTYARD).unwrap();
        let venue = crate::config::read_sim(bundled::COURTYARD, &text, None, &mut |path| {
            bundled::load(path)
        })
        .unwrap()
        .venue;
        let set: Vec<String> = set.iter().map(|given| (*given).to_owned()).collect();
        let mut loader = |path: &str| match path {
            "places.waypoints" => Ok("QGC WPL 110\n".to_owned()),
            _ => Err("no such file".to_owned()),
        };
        GivenMission::read(kind, &set, (&venue, None), &mut loader)
            .map_err(|problems| problems.to_string())
    }

    #[test]
    fn every_kind_of_a_file_is_a_kind_of_the_command_line_with_the_same_defaults() {
        for kind in GivenMission::kinds().filter(|kind| !["waypoints", "stored"].contains(kind)) {
            let given = read(kind, &[]).unwrap();
            let is_sweep = ["sweep", "calibrate", "fan", "fan-straight"].contains(&kind);
            assert_eq!(given.task.is_none(), is_sweep, "{kind}");
        }
        assert_eq!(
            read("forward", &[]).unwrap().task,
            Some(TaskKind::Forward { distance_mm: 5000 })
        );
        assert_eq!(
            read("calibrate", &["positions=8"]).unwrap().sweep,
            GivenSweep {
                planner: Some(PlannerChoice::Calibrate),
                positions: Some(8),
                ..GivenSweep::default()
            }
        );
        assert_eq!(
            read("sweep", &[]).unwrap().sweep,
            GivenSweep::default(),
            "what is left out is the ground station's to know"
        );
    }

    #[test]
    fn keys_are_those_of_a_file_and_words_need_no_quotes() {
        let forward = read("forward", &["distance_m = 2.5"]).unwrap();
        assert_eq!(forward.task, Some(TaskKind::Forward { distance_mm: 2500 }));
        let places: Vec<Position> = [1.0, 2.0]
            .map(|x_m| Position::from_metres(x_m, 1.0, 0.0))
            .to_vec();
        let given = read("pathfind", &["waypoints_m=[[1, 1], [2, 1]]"]).unwrap();
        assert_eq!(
            given.task,
            Some(TaskKind::Pathfind {
                places: places.clone()
            })
        );
        let given = read("waypoints", &["waypoints_m=[[1, 1], [2, 1]]"]).unwrap();
        assert_eq!(given.task, Some(TaskKind::Legs { places }));
        assert_eq!(read("browse", &[]).unwrap().task, Some(TaskKind::Browse));
        let corners = [(8.0, 12.0), (12.0, 12.0), (12.0, 8.0), (8.0, 8.0)];
        let places = corners
            .map(|(x_m, y_m)| Position::from_metres(x_m, y_m, 0.0))
            .to_vec();
        let given = read("pathfind", &["size_m=4"]).unwrap();
        assert_eq!(
            given.task,
            Some(TaskKind::Pathfind { places }),
            "without places those of the square"
        );
        let given = read("sweep", &["planner=fan", "laps=3", "dwell_s=2"]).unwrap();
        assert_eq!(
            given.sweep,
            GivenSweep {
                planner: Some(PlannerChoice::Fan),
                laps: Some(3),
                dwell: Some(Duration::from_secs(2)),
                ..GivenSweep::default()
            }
        );
    }

    #[test]
    fn a_mistake_is_said_of_its_option_with_what_was_expected() {
        let mut failed = Vec::new();
        for (kind, set, expected) in [
            (
                "forward",
                &["distance_m=0"][..],
                "--set: distance_m = 0: is out of range; a number from 0.1 to 1000 is allowed",
            ),
            (
                "forward",
                &["distance_m=far"],
                "--set: distance_m = \"far\": is no number; a number from 0.1 to 1000 is allowed",
            ),
            ("explore", &["size_m=4"], "--set: size_m: is not known; "),
            (
                "square",
                &["sise_m=4"],
                "--set: sise_m: is not known; did you mean size_m?",
            ),
            ("square", &["size_m=400"], "--set: size_m = 400: leads to "),
            (
                "square",
                &["size_m"],
                "--set: \"size_m\" has no =; KEY=VALUE is expected, such as size_m=4",
            ),
            ("square", &["=4"], "--set: \"=4\" names no key; "),
            (
                "square",
                &["kind=browse"],
                "--set: \"kind=browse\" is what --mission says; ",
            ),
            (
                "waypoints",
                &[],
                "--mission waypoints: waypoints_m: is missing; ",
            ),
            (
                "waypoints",
                &["file=none.waypoints"],
                "--set: file = \"none.waypoints\": none.waypoints cannot be read: no such file; ",
            ),
            (
                "pathfind",
                &["waypoints_m=[[1, 1], [999, 1]]"],
                "--set: waypoints_m = [[1, 1], [999, 1]]: leads to (999, 1), outside the fence",
            ),
            (
                "calibrate",
                &["planner=fan"],
                "--set: planner = \"fan\": is another one than mission.kind says; ",
            ),
            (
                "sweep",
                &["positions=3"],
                "--set: positions = 3: is out of range; ",
            ),
        ] {
            let output = read(kind, set).unwrap_err();
            failed.extend((!output.starts_with(expected)).then(|| format!("{output}\n{expected}")));
        }
        assert_eq!(failed, Vec::<String>::new());
        let twice = read("square", &["size_m=4", "size_m=5"]).unwrap_err();
        assert!(
            twice.starts_with("--set: size_m: no valid TOML: ") && !twice.contains('\n'),
            "{twice}"
        );
        let line = read("pathfind", &["file=a\nb"]).unwrap_err();
        assert!(line.starts_with("--set: file = "), "{line}");
    }

    #[test]
    fn more_places_than_a_task_carries_are_refused() {
        let places: Vec<String> = (0..1001).map(|_| "[1, 1]".to_owned()).collect();
        let output = read(
            "waypoints",
            &[&format!("waypoints_m=[{}]", places.join(","))],
        )
        .unwrap_err();
        assert!(
            output.starts_with("--set: waypoints_m = ") && output.contains("1 to 1000"),
            "{output}"
        );
    }
}
