//! What is written is read back with the same values: for every bundled file, and for random values drawn from the
//! declarations themselves by a visitor that knows nothing of any particular key.

use std::collections::{BTreeMap, BTreeSet};

use proptest::prelude::*;

use super::super::experiment::tests::check_same_grid;
use super::super::sim::{Sim, SimTable};
use super::super::vehicle::SWARM;
use super::super::{Config, GroundFile, OperatorFile, VehicleFile, bundled, read, to_toml};
use super::*;

/// Draws new values for some of the keys that it is shown.
struct Draw {
    /// A state of the generator (splitmix64).
    state: u64,
    /// One key in so many is changed.
    one_in: u64,
    /// The name of the table.
    prefix: String,
    /// What was changed.
    changed: Vec<String>,
}

impl Draw {
    fn new(seed: u64, one_in: u64) -> Draw {
        Draw {
            state: seed,
            one_in,
            prefix: String::new(),
            changed: Vec::new(),
        }
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// Returns whether a key is to be changed, and notes it.
    fn takes(&mut self, name: &str) -> bool {
        let is_taken = self.next().is_multiple_of(self.one_in);
        if is_taken {
            self.changed.push(format!("{}{name}", self.prefix));
        }
        is_taken
    }

    /// Draws a number, often from the middle of what is allowed and sometimes a limit itself.
    fn within(&mut self, present: f64, allowed: &RangeInclusive<f64>) -> f64 {
        let share = (self.next() >> 11) as f64 / (1u64 << 53) as f64;
        let (least, most) = (*allowed.start(), *allowed.end());
        match self.next() % 8 {
            0 => least,
            1 => most,
            2 => least + (most - least) * share,
            _ => (present * (0.8 + 0.4 * share)).clamp(least, most),
        }
    }

    fn whole_within(&mut self, allowed: &RangeInclusive<usize>) -> usize {
        let (least, most) = (*allowed.start() as u64, *allowed.end() as u64);
        let room = (most - least).min(20) + 1;
        (least + self.next() % room) as usize
    }

    fn inside(&mut self, name: &str, show: &mut dyn FnMut(&mut Draw)) {
        let before = self.prefix.clone();
        self.prefix = format!("{before}{name}.");
        show(self);
        self.prefix = before;
    }
}

impl Keys for Draw {
    fn number(&mut self, value: &mut f64, key: Number) {
        if self.takes(key.name) {
            *value = self.within(*value, &key.allowed);
        }
    }

    fn maybe_number(&mut self, value: &mut Option<f64>, key: NumberBounds<f64>) {
        if value.is_some() && self.takes(key.name) {
            *value = value.map(|value| self.within(value, &key.allowed));
        }
    }

    fn needed_number(&mut self, value: &mut f64, key: NumberBounds<f64>) {
        if self.takes(key.name) {
            *value = self.within(*value, &key.allowed);
        }
    }

    fn whole(&mut self, value: &mut usize, key: Whole) {
        if self.takes(key.name) {
            *value = self.whole_within(&key.allowed);
        }
    }

    fn maybe_whole(&mut self, value: &mut Option<usize>, key: NumberBounds<usize>) {
        if self.takes(key.name) {
            let whole = self.whole_within(&key.allowed);
            *value = self.next().is_multiple_of(2).then_some(whole);
        }
    }

    fn flag(&mut self, value: &mut bool, key: Flag) {
        if self.takes(key.name) {
            *value = !*value;
        }
    }

    fn word(&mut self, value: &mut dyn Word, key: Words) {
        if self.takes(key.name) {
            let words = value.words();
            value.choose(words[self.next() as usize % words.len()]);
        }
    }

    fn numbers(&mut self, value: &mut Vec<f64>, key: Numbers) {
        if self.takes(key.name) {
            for entry in value.iter_mut() {
                *entry = self.within(*entry, &key.allowed);
            }
        }
    }

    fn form(&mut self, _: &mut dyn Form, _: KeyEntry) {}

    fn moved(&mut self, _: &'static str, _: &'static str) {}

    fn table(&mut self, value: &mut dyn Keyed, key: KeyEntry) {
        self.inside(key.name, &mut |inner| value.keys(inner));
    }

    fn maybe_table(&mut self, value: &mut dyn MaybeTable, key: KeyEntry) {
        if let Some(table) = value.get() {
            self.inside(key.name, &mut |inner| table.keys(inner));
        }
    }

    fn rows(&mut self, value: &mut dyn Rows, key: Rowed) {
        for index in 0..value.count() {
            self.inside(key.name, &mut |inner| value.row(index, inner));
        }
    }

    fn named_tables(&mut self, value: &mut dyn NamedTables, key: KeyEntry) {
        for name in value.names() {
            self.inside(key.name, &mut |inner| value.named(&name).keys(inner));
        }
    }

    fn others(&mut self, _: &mut Layer, _: Others) {}
}

/// Changes some values of a configuration, and returns which.
fn draw(config: &mut Config, seed: u64, one_in: u64) -> Vec<String> {
    let mut draw = Draw::new(seed, one_in);
    match config {
        Config::Venue(venue) => venue.keys(&mut draw),
        Config::Scene(scene) => scene.keys(&mut draw),
        Config::Sim(sim) => SimTable {
            sim,
            allowed: &SWARM,
            asked: None,
        }
        .keys(&mut draw),
        Config::Vehicle(file) => VehicleFile::keys(file, &mut draw),
        Config::Ground(file) => GroundFile::keys(file, &mut draw),
        Config::Operator(file) => OperatorFile::keys(file, &mut draw),
        Config::Experiment(experiment) => experiment.keys(&mut draw),
    }
    draw.changed
}

/// A simulation with everything that may stand in one.
const RICH: &str = "kind = \"sim\"
venue = \"courtyard.venue.toml\"
scene = \"../scenes/courtyard.scene.toml\"
[vehicles]
count = 3
kind = \"copter\"
[[range.sensor]]
servo_from_deg = -60
servo_to_deg = 60
slew_s_per_60_deg = 0.01
[safety]
separation_m = 1.1
[radio]
slot_ms = 45
[[bus.partition]]
from_s = 10
until_s = 20
sides = [[\"ground\"], [1, 2]]
[[fault]]
kind = \"battery\"
charge = 0.3
at_s = 5
vehicles = [2]
[[fault]]
kind = \"restart\"
at_s = 7
[sweep]
planner = \"fan\"
laps = 9
";
const SQUARE: &str = "kind = \"sim\"
venue = \"courtyard.venue.toml\"
scene = \"../scenes/courtyard.scene.toml\"
[mission]
kind = \"square\"
centre_m = [9, 10.5]
size_m = 6
";
const SCENE: &str = "kind = \"scene\"
offset_m = [1, 2, 3]
[material.\"a b\"]
colour = \"#8a5a2b\"
db_per_m = 3
[[person]]
at_m = [1, 2]
[[object]]
centre_m = [1, 2]
radius_m = 0.5
[[object]]
outline_m = [[0, 0], [4, 0], [4, 4]]
[random_persons]
count = 3
";

/// Returns every bundled file, and some that use what those do not.
fn samples() -> Vec<(String, String)> {
    let root = env!("CARGO_MANIFEST_DIR");
    let mut all = Vec::new();
    for folder in ["configs", "configs/faults", "scenes"] {
        for entry in std::fs::read_dir(format!("{root}/{folder}")).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|ending| ending == "toml") {
                let name = path.to_str().unwrap().to_owned();
                all.push((name, std::fs::read_to_string(&path).unwrap()));
            }
        }
    }
    all.sort();
    for (name, text) in [("rich", RICH), ("square", SQUARE), ("scene", SCENE)] {
        all.push((format!("{root}/configs/{name}.toml"), text.to_owned()));
    }
    all
}

fn loaded(path: &str) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|error| error.to_string())
}

/// Reads what a configuration is written as; under a name without a folder, as from standard input.
fn read_back(config: &Config) -> (String, Config) {
    let text = to_toml(config);
    let back =
        read("-", &text, &mut loaded).unwrap_or_else(|problems| panic!("{problems}\n{text}"));
    (text, back)
}

fn check_round_trip(config: &Config) {
    let (text, back) = read_back(config);
    assert_eq!(to_toml(&back), text);
    match (config, &back) {
        // An experiment knows the lines of its file, and its name: what it means are its simulations.
        (Config::Experiment(first), Config::Experiment(second)) => {
            check_same_grid(first, second, &mut loaded);
        }
        (first, second) => assert_eq!(first, second, "{text}"),
    }
}

#[test]
fn every_bundled_file_is_read_back_as_it_was_written() {
    let samples = samples();
    assert!(samples.len() > 25, "{}", samples.len());
    for (name, text) in samples {
        let config =
            read(&name, &text, &mut loaded).unwrap_or_else(|problems| panic!("{problems}"));
        check_round_trip(&config);
    }
}

#[test]
fn random_values_are_accepted_often_enough_to_say_something_and_every_key_is_varied() {
    let mut shown: BTreeMap<String, usize> = BTreeMap::new();
    let (mut accepted, mut tried) = (0, 0);
    for (number, (name, text)) in samples().into_iter().enumerate() {
        let config = read(&name, &text, &mut loaded).unwrap();
        for key in draw(&mut config.clone(), 0, 1) {
            shown.entry(key).or_default();
        }
        for seed in 0..120 {
            let mut other = config.clone();
            let changed = draw(&mut other, (number as u64) << 32 | seed, 12);
            tried += 1;
            let Ok(other) = read("-", &to_toml(&other), &mut loaded) else {
                continue;
            };
            accepted += 1;
            for key in changed {
                *shown.entry(key).or_default() += 1;
            }
            check_round_trip(&other);
        }
    }
    assert!(accepted * 5 > tried, "{accepted} of {tried}");
    let never: BTreeSet<&String> = shown
        .iter()
        .filter(|(_, times)| **times == 0)
        .map(|(key, _)| key)
        .collect();
    assert!(never.is_empty(), "never accepted: {never:?}");
}

proptest! {
    /// As above, from anywhere in the space of values.
    #[test]
    fn random_valid_values_are_read_back_as_they_were_written(seed in any::<u64>(), one_in in 1u64..30, which in 0usize..40) {
        let samples = samples();
        let (name, text) = &samples[which % samples.len()];
        let mut config = read(name, text, &mut loaded).unwrap();
        draw(&mut config, seed, one_in);
        if let Ok(config) = read("-", &to_toml(&config), &mut loaded) {
            check_round_trip(&config);
        }
    }
}

#[test]
fn a_written_simulation_says_units_meanings_and_defaults() {
    let root = env!("CARGO_MANIFEST_DIR");
    let name = format!("{root}/configs/courtyard.sim.toml");
    let text = to_toml(&read(&name, &loaded(&name).unwrap(), &mut loaded).unwrap());
    assert!(text.starts_with("kind = \"sim\"\n"), "{text}");
    let line = "battery_hold = 0.05 # below this charge it stays where it is\n";
    assert!(text.contains(line), "{text}");
    assert!(
        text.contains("padding_m = 0.1 # m: room around the body that must be known free\n"),
        "{text}"
    );
}

#[test]
fn a_simulation_says_the_swarms_contract_for_its_venue() {
    let read_sim = |lines: &str| {
        let text = format!("{}{lines}", SQUARE.split("[mission]").next().unwrap());
        let config = read("configs/a.toml", &text, &mut |path| bundled::load(path));
        let Ok(Config::Sim(sim)) = config else {
            panic!("{config:?}")
        };
        *sim
    };
    let plain: Sim = read_sim("");
    let laid = read_sim("[safety]\nautonomy_s = 15\n[radio]\nchannel = 20\n");
    assert_eq!(
        (laid.venue.swarm.autonomy_s, laid.venue.swarm.channel()),
        (15.0, 20)
    );
    assert_eq!(
        laid.venue.swarm.separation_m,
        plain.venue.swarm.separation_m
    );
    assert_ne!(
        laid.venue.hash(),
        plain.venue.hash(),
        "all nodes must agree on what is in force"
    );
    assert_eq!(
        read_sim("[safety]\nautonomy_s = 60\n").venue.hash(),
        plain.venue.hash()
    );
    // Its venue, written, has what is in force.
    let (_, back) = read_back(&Config::Venue(laid.venue.clone()));
    assert_eq!(back, Config::Venue(laid.venue));
}

#[test]
fn an_empty_table_reads_as_the_defaults_that_are_hashed_as_nothing() {
    let mut swarm = super::super::Swarm {
        separation_m: 7.0,
        ..super::super::Swarm::default()
    };
    assert!(swarm.hashed().is_some());
    read_defaults(&mut swarm);
    assert_eq!(swarm, super::super::Swarm::default());
    assert_eq!(swarm.hashed(), None);
}
