//! An experiment's file as its keys say it. What is laid over a simulation is kept as it was written, with its line.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use toml::de::DeValue;

use crate::config::forms::{FileName, Name};
use crate::config::keys::{Form, KeyEntry, Keyed, Keys, List, Others, Rowed, quoted, written_list};
use crate::config::overlay::Layer;
use crate::config::section::{Section, number_of, whole_of};
use crate::config::sim::SEEDS;
use crate::config::source::ProblemClass;
use crate::config::vehicle::PARTY;

/// The most runs of an experiment.
pub const MOST_RUNS: usize = 100_000;
/// The key of the safety distances.
pub(super) const SAFETY: &str = "safety_distances_m";
/// The key of the sides of cells.
pub(super) const CELLS: &str = "cells_m";
/// The key of the venue's sizes.
pub(super) const SIZES: &str = "sizes_m";

/// The most values of an axis, seeds apart.
const MOST_VALUES: usize = 64;

/// The keys of an experiment's file.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct ExperimentFile {
    pub(super) name: String,
    pub(super) sim: Option<String>,
    pub(super) safety_distances_m: Vec<Given<f64>>,
    pub(super) cells_m: Vec<Given<f64>>,
    pub(super) sizes_m: Vec<Given<f64>>,
    pub(super) vehicles: Vec<Given<usize>>,
    pub(super) seeds: Seeds,
    with: Laid,
    pub(super) missions: Vec<Variant>,
    pub(super) scenes: Vec<SceneRow>,
    pub(super) sensors: Vec<Variant>,
}

/// A value of a list, with its line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Given<T> {
    pub(super) value: T,
    pub(super) line: usize,
}

/// The seeds of an experiment.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) enum Seeds {
    /// That of the simulation file.
    #[default]
    Own,
    /// So many, from 1 on.
    UpTo(usize),
    /// These.
    These(Vec<Given<usize>>),
}

/// A table of its own that is laid over another file.
#[derive(Clone, PartialEq, Debug, Default)]
struct Laid(Layer);

/// A named table of keys that are laid over another one.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct Variant {
    pub(super) name: String,
    pub(super) line: usize,
    pub(super) keys: Layer,
}

/// A simulation file, and what is changed in it.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct SceneRow {
    pub(super) name: String,
    pub(super) line: usize,
    sim: Option<String>,
    /// Other files than those that the simulation names.
    files: [Layer; 2],
    with: Laid,
    missions: BTreeMap<String, Laid>,
}

impl ExperimentFile {
    /// Returns what is laid over every simulation.
    pub(super) fn with(&self) -> &Layer {
        &self.with.0
    }

    /// Checks what several keys must obey together.
    pub(super) fn check(&self, root: &Section) {
        if self.scenes.is_empty() {
            root.require(
                "sim",
                "a simulation file is needed, or [[scene]] tables that each name one",
            );
        }
        self.check_missions_are_whole(root, "with.mission", &self.with.0);
        for (index, row) in self.scenes.iter().enumerate() {
            let key = format!("scene[{index}].with.mission");
            self.check_missions_are_whole(root, &key, &row.with.0);
            if self.sim_of(row).is_none() {
                let rule = "the name of a simulation file is needed, here or for all";
                root.source.note(
                    ProblemClass::Keys,
                    row.line,
                    &format!("scene[{index}].sim"),
                    "",
                    "is missing",
                    rule,
                );
            }
            let is_known = |name: &str| self.missions.iter().any(|mission| mission.name == name);
            for name in row.missions.keys().filter(|name| !is_known(name)) {
                let wrong = format!("changes a mission {name}, which there is not");
                root.refuse(
                    &format!("scene[{index}].mission"),
                    &wrong,
                    "names of [[mission]] are allowed",
                );
            }
        }
    }

    /// Refuses what is laid over a mission that each `[[mission]]` takes the place of.
    fn check_missions_are_whole(&self, root: &Section, key: &str, with: &Layer) {
        let Some(line) = with
            .line_in("mission")
            .filter(|_| !self.missions.is_empty())
        else {
            return;
        };
        let wrong = "has no effect: each [[mission]] is a whole mission of its own";
        let rule = "keys of a mission belong into [[mission]], or into [scene.mission.NAME]";
        root.source
            .note(ProblemClass::Keys, line, key, "", wrong, rule);
    }

    /// Returns the simulation file of a row, which may be that of all.
    pub(super) fn sim_of(&self, row: &SceneRow) -> Option<String> {
        row.sim.clone().or_else(|| self.sim.clone())
    }
}

impl SceneRow {
    /// Returns what is laid over its simulation.
    pub(super) fn with(&self) -> Layer {
        let mut with = self.with.0.clone();
        self.files.iter().for_each(|file| with.lay_all(file));
        with
    }

    /// Returns what is changed in `[mission]` for the missions of some names.
    pub(super) fn missions(&self) -> impl Iterator<Item = (&String, &Layer)> {
        self.missions.iter().map(|(name, laid)| (name, &laid.0))
    }
}

impl Keyed for ExperimentFile {
    fn keys(&mut self, to: &mut dyn Keys) {
        let ExperimentFile {
            name,
            sim,
            safety_distances_m,
            cells_m,
            sizes_m,
            vehicles,
            seeds,
            with,
            missions,
            scenes,
            sensors,
        } = self;
        let means = "part of the output folder's name";
        let mut plain = Name {
            name,
            default: "experiment".to_owned(),
        };
        to.form(
            &mut plain,
            KeyEntry {
                name: "name",
                left_out: "experiment",
                means,
            },
        );
        let (left_out, means) = (
            "needed, or in every `[[scene]]`",
            "the simulation file that is varied",
        );
        to.form(
            &mut FileName {
                name: sim,
                needed: None,
            },
            KeyEntry {
                name: "sim",
                left_out,
                means,
            },
        );
        let mut numbers = |values, name, allowed, left_out, means| {
            to.form(
                &mut Values { values, allowed },
                KeyEntry {
                    name,
                    left_out,
                    means,
                },
            );
        };
        let means = "axis: from the middle of a vehicle to everything; `safety.padding_m` becomes this less \
                     `vehicles.radius_m`. As in the thesis, whose vehicle was a point";
        numbers(safety_distances_m, SAFETY, 0.05..=7.0, "the file's", means);
        numbers(
            cells_m,
            CELLS,
            0.05..=2.0,
            "the venue's",
            "axis: the venue's `cell_m`",
        );
        let means = "axis: longer side of the area, which shrinks about its centre; what lies inside (fence, homes) keeps \
                     its share, what lies outside its distance from the border";
        numbers(sizes_m, SIZES, 1.0..=1000.0, "the venue's", means);
        let mut counts = Values {
            values: vehicles,
            allowed: PARTY,
        };
        let means = "axis: `vehicles.count`";
        to.form(
            &mut counts,
            KeyEntry {
                name: "vehicles",
                left_out: "the file's",
                means,
            },
        );
        let means = "axis: a number n (seeds 1 to n) or a list";
        to.form(
            seeds,
            KeyEntry {
                name: "seeds",
                left_out: "the file's",
                means,
            },
        );
        let means = "laid over every simulation";
        to.table(
            with,
            KeyEntry {
                name: "with",
                left_out: "",
                means,
            },
        );
        let keys = |row: &mut Variant, index, to: &mut dyn Keys| {
            let default =
                |section: &Section| section.text("kind").unwrap_or(numbered("mission", index));
            row.keys(
                to,
                "its `kind`",
                &default,
                "keys of `[mission]`, which take the place of the file's own",
            );
        };
        let means = "axis: what the vehicles are out for";
        to.rows(
            &mut List {
                list: missions,
                keys,
            },
            Rowed {
                name: "mission",
                most: MOST_VALUES,
                means,
            },
        );
        let keys = |row: &mut SceneRow, _, to: &mut dyn Keys| row.keys(sim.as_deref(), to);
        let means = "axis: where";
        to.rows(
            &mut List { list: scenes, keys },
            Rowed {
                name: "scene",
                most: MOST_VALUES,
                means,
            },
        );
        let keys = |row: &mut Variant, index, to: &mut dyn Keys| {
            let default = |_: &Section| numbered("sensor", index);
            row.keys(to, "sensor-N", &default, "keys laid over `[range]`");
        };
        let means = "axis: the range sensor";
        to.rows(
            &mut List {
                list: sensors,
                keys,
            },
            Rowed {
                name: "sensor",
                most: MOST_VALUES,
                means,
            },
        );
    }
}

fn numbered(name: &str, index: usize) -> String {
    format!("{name}-{}", index + 1)
}

impl Variant {
    fn keys(
        &mut self,
        to: &mut dyn Keys,
        left_out: &'static str,
        default: &dyn Fn(&Section) -> String,
        means: &'static str,
    ) {
        let Variant { name, line, keys } = self;
        let mut named = RowName {
            name,
            line,
            default,
        };
        to.form(
            &mut named,
            KeyEntry {
                name: "name",
                left_out,
                means: "a plain name",
            },
        );
        to.others(
            keys,
            Others {
                but: &["name"],
                means,
            },
        );
    }
}

impl SceneRow {
    fn keys(&mut self, sim_of_all: Option<&str>, to: &mut dyn Keys) {
        let SceneRow {
            name,
            line,
            sim,
            files: [scene, venue],
            with,
            missions,
        } = self;
        let default = |section: &Section| {
            let own = section.text("sim");
            stem(own.as_deref().or(sim_of_all).unwrap_or_default())
        };
        let mut named = RowName {
            name,
            line,
            default: &default,
        };
        let left_out = "the file's, up to the first dot";
        to.form(
            &mut named,
            KeyEntry {
                name: "name",
                left_out,
                means: "a plain name",
            },
        );
        let means = "its simulation file";
        let left_out = "that of all";
        to.form(
            &mut FileName {
                name: sim,
                needed: None,
            },
            KeyEntry {
                name: "sim",
                left_out,
                means,
            },
        );
        let means = "a scene in place of the simulation's";
        to.form(
            &mut OtherFile(scene),
            KeyEntry {
                name: "scene",
                left_out: "",
                means,
            },
        );
        let means = "a venue in place of the simulation's";
        to.form(
            &mut OtherFile(venue),
            KeyEntry {
                name: "venue",
                left_out: "",
                means,
            },
        );
        to.table(
            with,
            KeyEntry {
                name: "with",
                left_out: "",
                means: "laid over this simulation",
            },
        );
        let means = "laid over `[mission]` for the mission of this name only";
        to.named_tables(
            missions,
            KeyEntry {
                name: "mission",
                left_out: "",
                means,
            },
        );
    }
}

impl Keyed for Laid {
    fn keys(&mut self, to: &mut dyn Keys) {
        to.others(
            &mut self.0,
            Others {
                but: &[],
                means: "a key of that file or table",
            },
        );
    }
}

/// Returns a file's name without folders and endings.
pub(super) fn stem(file: &str) -> String {
    let name = file.rsplit('/').next().unwrap_or(file);
    name.split('.').next().unwrap_or(name).to_owned()
}

/// The name of a row, which also notes the row's line.
struct RowName<'a> {
    name: &'a mut String,
    line: &'a mut usize,
    default: &'a dyn Fn(&Section) -> String,
}

impl Form for RowName<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(quoted(self.name))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.line = section.line();
        *self.name = section.name(key, &(self.default)(section));
    }
}

/// A file in place of the one that the simulation names.
struct OtherFile<'a>(&'a mut Layer);

impl Form for OtherFile<'_> {
    fn to_toml(&self) -> Option<String> {
        self.0.written().map(|(_, value)| value.to_owned()).next()
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        if section.text(key).is_some() {
            *self.0 = section.single(key);
        }
    }
}

/// A number that may stand on an axis.
trait Value: Copy + PartialOrd + std::fmt::Display {
    /// What is told of a list of them.
    const ARE: &'static str;

    fn of(value: &DeValue<'_>) -> Option<Self>;
}

impl Value for f64 {
    const ARE: &'static str = "numbers";

    fn of(value: &DeValue<'_>) -> Option<f64> {
        number_of(value)
    }
}

impl Value for usize {
    const ARE: &'static str = "whole numbers";

    fn of(value: &DeValue<'_>) -> Option<usize> {
        whole_of(value)
    }
}

/// An axis: a list of numbers, none of them twice.
struct Values<'a, T> {
    values: &'a mut Vec<Given<T>>,
    allowed: RangeInclusive<T>,
}

impl<T: Value> Form for Values<'_, T> {
    fn to_toml(&self) -> Option<String> {
        (!self.values.is_empty()).then(|| written_values(self.values))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let rule = format!("a list of {} is allowed", Form::allowed(self));
        *self.values = read_values(section, key, MOST_VALUES, &rule, &self.allowed);
    }

    fn allowed(&self) -> String {
        let (from, to) = (self.allowed.start(), self.allowed.end());
        format!("1 to {MOST_VALUES} {} from {from} to {to}", T::ARE)
    }
}

impl Form for Seeds {
    fn to_toml(&self) -> Option<String> {
        match self {
            Seeds::Own => None,
            Seeds::UpTo(count) => Some(count.to_string()),
            Seeds::These(seeds) => Some(written_values(seeds)),
        }
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let rule = format!("a number of seeds or a list of them is allowed, up to {MOST_RUNS}");
        *self = if !section.has(key) {
            Seeds::Own
        } else if section.list(key).is_none() {
            Seeds::UpTo(section.whole(key, 1, 1..=MOST_RUNS))
        } else {
            Seeds::These(read_values(
                section,
                key,
                MOST_RUNS,
                &rule,
                &(*SEEDS.start() as usize..=*SEEDS.end() as usize),
            ))
        }
    }

    fn allowed(&self) -> String {
        format!("up to {MOST_RUNS}")
    }
}

fn written_values<T: Value>(values: &[Given<T>]) -> String {
    written_list(values.iter().map(|given| given.value.to_string()))
}

/// Reads a list of values, each with its line.
fn read_values<T: Value>(
    section: &Section<'_>,
    key: &'static str,
    most: usize,
    rule: &str,
    allowed: &RangeInclusive<T>,
) -> Vec<Given<T>> {
    if !section.has(key) {
        return Vec::new();
    }
    let source = section.source;
    let Some(list) = section
        .list(key)
        .filter(|list| (1..=most).contains(&list.len()))
    else {
        section.refuse(key, "is no such list", rule);
        return Vec::new();
    };
    let mut values = Vec::new();
    for entry in list {
        let line = source.line_of(entry.span());
        match T::of(entry.get_ref()).filter(|value| allowed.contains(value)) {
            Some(value) => values.push(Given { value, line }),
            None => source.note(
                ProblemClass::Value,
                line,
                key,
                &source.shown(entry),
                "is not allowed",
                rule,
            ),
        }
    }
    values
}
