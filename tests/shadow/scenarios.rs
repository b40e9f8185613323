//! The scenarios whose operator is shadowed, and what is wrong when it would order something else.

use std::path::Path;

use tomoswarm::config;
use tomoswarm::scene::{self, Up};
use tomoswarm::sim::{Scenario, ShadowRun};

/// A scenario of `configs/`.
pub struct Case {
    pub name: &'static str,
    pub file: &'static str,
    /// How many vehicles; `None` = as the file says.
    pub vehicles: Option<usize>,
    /// Text that is replaced, and by what; nothing, when it is empty.
    pub change: (&'static str, &'static str),
}

const COURTYARD: &str = "configs/courtyard.sim.toml";

/// Sweeps with and without faults, one without an empty sweep, and missions of the vehicles' own.
pub const CASES: [Case; 5] = [
    Case { name: "courtyard", file: COURTYARD, vehicles: None, change: ("", "") },
    Case { name: "no empty sweep, stays", file: COURTYARD, vehicles: None, change: STAYS },
    Case { name: "a vehicle restarts", file: COURTYARD, vehicles: Some(3), change: RESTART },
    Case { name: "a vehicle dies", file: COURTYARD, vehicles: Some(3), change: DEAD },
    Case { name: "explore", file: "configs/explore.sim.toml", vehicles: None, change: ("", "") },
];

const STAYS: (&str, &str) =
    ("empty_sweep = true\nuntil_s = 14400.0\nend = \"return\"", "until_s = 14400.0\nend = \"hold\"");
const RESTART: (&str, &str) =
    ("[sweep]", "[[fault]]\nkind = \"restart\"\nat_s = 90.0\nuntil_s = 95.0\nvehicles = [2]\n[sweep]");
const DEAD: (&str, &str) = ("[sweep]", "[[fault]]\nkind = \"dead\"\nat_s = 200.0\nvehicles = [3]\n[sweep]");

impl Case {
    fn scenario(&self, seed: u64) -> Scenario {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut loader =
            |name: &str| std::fs::read_to_string(root.join(name)).map_err(|error| format!("{name}: {error}"));
        let mut text = loader(self.file).expect("it is there");
        if !self.change.0.is_empty() {
            assert!(text.contains(self.change.0), "{}: nothing to change", self.name);
            text = text.replacen(self.change.0, self.change.1, 1);
        }
        let sim = config::read_sim(self.file, &text, self.vehicles, &mut loader)
            .unwrap_or_else(|problems| panic!("{}: {problems}", self.name));
        let shapes = match sim.scene.wrl.clone() {
            None => Vec::new(),
            Some(wrl) => {
                let text = loader(&wrl).expect("it is there");
                let read = scene::read_vrml(&text, &wrl, Up::Z, &mut |_| Err("none".to_owned()));
                read.expect("a scene").shapes
            }
        };
        Scenario::new(sim, shapes, seed).expect("the scenario is possible")
    }

    /// Runs a seed; returns what was ordered when the operator would have ordered the same, and otherwise what is wrong.
    pub fn compare(&self, seed: u64) -> Result<ShadowRun, String> {
        let (_, run) = self.scenario(seed).run_with_shadow().expect("it runs");
        let is_same = !run.script.is_empty() && run.script == run.operator;
        if is_same { Ok(run) } else { Err(format!("{}, seed {seed}: {run:?}", self.name)) }
    }
}
