//! The reading half of an experiment's file: its axes, each value with its line.

use std::ops::RangeInclusive;

use toml::Spanned;
use toml::de::DeValue;

use super::{Axis, CELLS, Change, Choice, Experiment, MOST_RUNS, SAFETY, SIZES, SceneChange};
use crate::config::beside;
use crate::config::keys::quoted;
use crate::config::overlay::Layer;
use crate::config::section::{Section, number_of, whole_of};
use crate::config::source::Class;
use crate::config::vehicle::PARTY;

/// The most values of an axis, seeds apart.
const MOST_CHOICES: usize = 64;

impl Experiment {
    /// Reads an experiment; the simulations that it names are not read yet.
    pub(in crate::config) fn read(root: &Section) -> Experiment {
        let sim = root.text("sim").map(|named| beside(root.source.file(), &named));
        let missions = read_missions(root);
        let axes = vec![
            read_scenes(root, sim, &missions),
            read_numbers(root, SAFETY, 0.05..=7.0, Change::Safety),
            read_numbers(root, CELLS, 0.05..=2.0, Change::Cell),
            read_numbers(root, SIZES, 1.0..=1000.0, Change::Size),
            read_sensors(root),
            read_counts(root),
            read_seeds(root),
        ];
        let axes = std::iter::once(missions).chain(axes).map(or_nothing).collect();
        let with = root.optional_section("with").map(|section| section.layer(&[])).unwrap_or_default();
        let experiment = Experiment {
            name: root.name("name", "experiment"),
            file: root.source.file().to_owned(),
            text: seen_from_outside(root),
            with,
            axes,
        };
        root.finish();
        experiment.check_size(root);
        experiment
    }

    fn check_size(&self, root: &Section) {
        let lengths = self.axes.iter().map(|axis| axis.len() as u128);
        let runs: u128 = lengths.product();
        if runs > MOST_RUNS as u128 {
            let counts: Vec<String> = Axis::ALL
                .iter()
                .zip(&self.axes)
                .map(|(axis, list)| format!("{} {}", list.len(), axis.word()))
                .collect();
            let wrong = format!("the grid has {runs} runs ({})", counts.join(" × "));
            root.refuse("kind", &wrong, &format!("at most {MOST_RUNS} runs are allowed"));
        }
    }
}

/// Returns the text of a file, with the folder of the file before the names of those that it names.
fn seen_from_outside(root: &Section) -> String {
    let mut text = root.source.text().to_owned();
    let mut named = root.texts_of(&["sim", "scene", "venue", "file"]);
    named.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    for (span, name) in named {
        text.replace_range(span, &quoted(&beside(root.source.file(), &name)));
    }
    text
}

fn or_nothing(choices: Vec<Choice>) -> Vec<Choice> {
    if !choices.is_empty() {
        return choices;
    }
    vec![Choice { name: "-".to_owned(), line: 1, change: Change::Nothing }]
}

fn read_missions(root: &Section) -> Vec<Choice> {
    let sections = root.sections("mission", MOST_CHOICES);
    let read = |(index, section): (usize, &Section)| {
        let default = section.text("kind").unwrap_or_else(|| format!("mission-{}", index + 1));
        Choice {
            name: section.name("name", &default),
            line: section.line(),
            change: Change::Mission(section.layer(&["name"])),
        }
    };
    let missions: Vec<Choice> = sections.iter().enumerate().map(read).collect();
    refuse_doubles(root, "mission", &missions);
    missions
}

fn read_scenes(root: &Section, sim: Option<String>, missions: &[Choice]) -> Vec<Choice> {
    let sections = root.sections("scene", MOST_CHOICES);
    if sections.is_empty() {
        root.require("sim", "a simulation file is needed, or [[scene]] tables that each name one");
    }
    let whole = sim.iter().filter(|_| sections.is_empty()).map(|sim| {
        let change = SceneChange { sim: sim.clone(), with: Layer::default(), missions: Vec::new() };
        Choice { name: stem(sim), line: 1, change: Change::Scene(Box::new(change)) }
    });
    let read = |section: &Section| read_scene(section, sim.as_ref(), missions);
    let scenes: Vec<Choice> = whole.chain(sections.iter().map(read)).collect();
    refuse_doubles(root, "scene", &scenes);
    scenes
}

fn read_scene(section: &Section, sim: Option<&String>, missions: &[Choice]) -> Choice {
    if sim.is_none() {
        section.require("sim", "the name of a simulation file is needed, here or for all");
    }
    let own = section.text("sim").map(|named| beside(section.source.file(), &named));
    let sim = own.or_else(|| sim.cloned()).unwrap_or_default();
    let mut with = section.optional_section("with").map(|table| table.layer(&[])).unwrap_or_default();
    // The two files may be replaced; their names are checked by the simulation's own reader.
    let files = ["name", "sim", "with", "mission"];
    let named = section.layer(&files);
    for key in ["scene", "venue"] {
        section.text(key);
    }
    with.lay_all(&named);
    let changes = section.entries("mission");
    for (name, _) in changes.iter().filter(|(name, _)| !missions.iter().any(|mission| mission.name == *name))
    {
        section.refuse(
            "mission",
            &format!("changes a mission {name}, which there is not"),
            "names of [[mission]] are allowed",
        );
    }
    let missions = changes.iter().map(|(name, table)| (name.clone(), table.layer(&[]))).collect();
    let name = section.name("name", &stem(&sim));
    section.finish();
    Choice {
        name,
        line: section.line(),
        change: Change::Scene(Box::new(SceneChange { sim, with, missions })),
    }
}

/// Gives a file's name without folders and endings.
fn stem(file: &str) -> String {
    let name = file.rsplit('/').next().unwrap_or(file);
    name.split('.').next().unwrap_or(name).to_owned()
}

fn read_sensors(root: &Section) -> Vec<Choice> {
    let sections = root.sections("sensor", MOST_CHOICES);
    let read = |(index, section): (usize, &Section)| Choice {
        name: section.name("name", &format!("sensor-{}", index + 1)),
        line: section.line(),
        change: Change::Sensor(section.layer(&["name"])),
    };
    let sensors: Vec<Choice> = sections.iter().enumerate().map(read).collect();
    refuse_doubles(root, "sensor", &sensors);
    sensors
}

fn read_numbers(
    root: &Section,
    key: &'static str,
    allowed: RangeInclusive<f64>,
    change: fn(f64) -> Change,
) -> Vec<Choice> {
    let rule = format!(
        "a list of 1 to {MOST_CHOICES} numbers from {} to {} is allowed",
        allowed.start(),
        allowed.end()
    );
    let number = |value: &DeValue| number_of(value).filter(|number| allowed.contains(number));
    read_values(root, key, MOST_CHOICES, &rule, |value| {
        number(value).map(|value| (value.to_string(), change(value)))
    })
}

fn read_counts(root: &Section) -> Vec<Choice> {
    let rule = format!("a list of numbers of vehicles from {} to {} is allowed", PARTY.start(), PARTY.end());
    read_values(root, "vehicles", MOST_CHOICES, &rule, |value| {
        let count = whole_of(value).filter(|count| PARTY.contains(count))?;
        Some((count.to_string(), Change::Vehicles(count)))
    })
}

fn read_seeds(root: &Section) -> Vec<Choice> {
    let rule = format!("a number of seeds or a list of them is allowed, up to {MOST_RUNS}");
    if root.has("seeds") && root.list("seeds").is_none() {
        let count = root.whole("seeds", 1, 1..=MOST_RUNS);
        let seed =
            |seed: usize| Choice { name: seed.to_string(), line: 1, change: Change::Seed(seed as u64) };
        return (1..=count).map(seed).collect();
    }
    read_values(root, "seeds", MOST_RUNS, &rule, |value| {
        let seed = whole_of(value).filter(|seed| *seed <= i64::MAX as usize)?;
        Some((seed.to_string(), Change::Seed(seed as u64)))
    })
}

/// Reads a list of values, each with its line.
fn read_values(
    root: &Section,
    key: &'static str,
    most: usize,
    rule: &str,
    read: impl Fn(&DeValue) -> Option<(String, Change)>,
) -> Vec<Choice> {
    if !root.has(key) {
        return Vec::new();
    }
    let choice = |value: &Spanned<DeValue>| {
        let line = root.source.line_of(value.span());
        let read = read(value.get_ref());
        if read.is_none() {
            root.source.note(Class::Value, line, key, &root.source.shown(value), "is not allowed", rule);
        }
        read.map(|(name, change)| Choice { name, line, change })
    };
    let Some(list) = root.list(key).filter(|list| (1..=most).contains(&list.len())) else {
        root.refuse(key, "is no such list", rule);
        return Vec::new();
    };
    let choices: Vec<Choice> = list.iter().filter_map(choice).collect();
    refuse_doubles(root, key, &choices);
    choices
}

fn refuse_doubles(root: &Section, key: &str, choices: &[Choice]) {
    let mut names: Vec<&str> = choices.iter().map(|choice| choice.name.as_str()).collect();
    names.sort_unstable();
    if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        root.refuse(key, &format!("has {} twice", pair[0]), "each may stand there once");
    }
}
