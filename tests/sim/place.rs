//! A place to simulate in, built in a few words: an area with a fence, things that stand there, a fleet, a seed,
//! and any key of the simulation file. Claims that hold for every run are made here, once.

use std::fmt::Write as _;

use tomoswarm::config;
use tomoswarm::scene::{self, Up};
use tomoswarm::sim::{RunOutcome, Scenario};

/// What stands in the world: middle and size of a box, metres; 1 m high.
pub type Block = (f64, f64, f64, f64);

/// A scenario in the making.
#[derive(Clone)]
pub struct Place {
    width_m: f64,
    height_m: f64,
    strip_m: f64,
    positions: usize,
    homes: Vec<(f64, f64)>,
    blocks: Vec<Block>,
    vehicles: usize,
    body: String,
    root: String,
    sections: String,
    sweep: String,
    /// Files beside the simulation's, by name.
    files: Vec<(String, String)>,
    seed: u64,
    shuffled: bool,
}

impl Place {
    /// A rectangle from (0, 0) with a strip of 3 m around it, a ring with steps of about 1 m, and two vehicles that
    /// drive one lap.
    pub fn new(width_m: f64, height_m: f64) -> Place {
        let (right_m, top_m) = (width_m + 1.2, height_m + 1.2);
        let (middle_m, half_m) = (width_m / 2.0, height_m / 2.0);
        let homes = vec![
            (-1.0, -1.0),
            (width_m + 1.0, height_m + 1.0),
            (width_m + 1.0, -1.0),
            (-1.0, height_m + 1.0),
            (middle_m, -1.2),
            (middle_m, top_m),
            (right_m, half_m),
            (-1.2, half_m),
        ];
        Place {
            width_m,
            height_m,
            strip_m: 3.0,
            positions: (2.0 * (width_m + height_m)) as usize,
            homes,
            blocks: Vec::new(),
            vehicles: 2,
            body: String::new(),
            root: "end = \"hold\"\nuntil_s = 2000.0".to_owned(),
            sections: String::new(),
            sweep: "laps = 1".to_owned(),
            files: Vec::new(),
            seed: 1,
            shuffled: false,
        }
    }

    /// Puts a box into the world.
    pub fn block(mut self, block: Block) -> Place {
        self.blocks.push(block);
        self
    }

    /// Returns how many vehicles there are.
    pub fn vehicles(mut self, vehicles: usize) -> Place {
        self.vehicles = vehicles;
        self
    }

    /// Adds lines to the section `[vehicles]`.
    pub fn body(mut self, lines: &str) -> Place {
        self.body = lines.to_owned();
        self
    }

    /// Returns how many positions the ring has.
    pub fn positions(mut self, positions: usize) -> Place {
        self.positions = positions;
        self
    }

    /// Returns where the vehicles begin.
    pub fn homes(&self) -> &[(f64, f64)] {
        &self.homes
    }

    /// Moves the home of a vehicle (from 1).
    pub fn home(mut self, vehicle: usize, at: (f64, f64)) -> Place {
        self.homes[vehicle - 1] = at;
        self
    }

    /// Replaces the lines of the section `[sweep]`, but for `positions`.
    pub fn sweep(mut self, lines: &str) -> Place {
        self.sweep = lines.to_owned();
        self
    }

    /// Replaces the lines at the top of the file: `end`, `until_s`.
    pub fn root(mut self, lines: &str) -> Place {
        self.root = lines.to_owned();
        self
    }

    /// Adds sections to the file.
    pub fn with(mut self, sections: &str) -> Place {
        self.sections.push_str(sections);
        self.sections.push('\n');
        self
    }

    /// Puts a file beside that of the simulation.
    pub fn file(mut self, name: &str, text: &str) -> Place {
        self.files.push((name.to_owned(), text.to_owned()));
        self
    }

    /// Returns which seed is run.
    pub fn seed(mut self, seed: u64) -> Place {
        self.seed = seed;
        self
    }

    /// Lets events of one moment happen in an order drawn by the seed.
    pub fn shuffled(mut self) -> Place {
        self.shuffled = true;
        self
    }

    /// Runs to the end.
    pub fn run(&self) -> RunOutcome {
        let mut scenario = self.scenario();
        scenario.shuffle_ties = self.shuffled;
        scenario
            .run(&mut |_| true)
            .expect("the scenario can be run")
    }

    /// Runs to the end and claims that it was safe, for vehicles of 0.25 m radius and 1 m of separation.
    pub fn run_safely(&self) -> RunOutcome {
        let outcome = self.run();
        assert_safe(&outcome);
        outcome
    }

    /// Runs to the end and claims that it was safe and that the sweep ended.
    pub fn run_to_the_end(&self) -> RunOutcome {
        let outcome = self.run_safely();
        assert!(
            outcome.finished,
            "{:?}\n{}",
            outcome.failure,
            tail(&outcome.log)
        );
        outcome
    }

    pub fn scenario(&self) -> Scenario {
        let mut loader = |name: &str| match name {
            "venue.toml" => Ok(self.venue()),
            "scene.toml" => Ok("kind = \"scene\"\nname = \"blocks\"\n".to_owned()),
            other => match self.files.iter().find(|(known, _)| known == other) {
                Some((_, text)) => Ok(text.clone()),
                None => Err(format!("no file {other}")),
            },
        };
        let sim = config::read_sim("test.toml", &self.text(), None, &mut loader)
            .unwrap_or_else(|problems| panic!("{problems}"));
        let shapes = scene::read_vrml(&self.wrl(), "test.wrl", Up::Z, &mut |_| {
            Err("none".to_owned())
        })
        .expect("the blocks are a scene");
        Scenario::new(sim, shapes.shapes, self.seed).expect("the scenario is possible")
    }

    fn text(&self) -> String {
        format!(
            "kind = \"sim\"\nvenue = \"venue.toml\"\nscene = \"scene.toml\"\n{}\n[vehicles]\ncount = {}\n{}\n\
             [imaging]\npixels = [8, 8]\n[sweep]\npositions = {}\n{}\n{}",
            self.root, self.vehicles, self.body, self.positions, self.sweep, self.sections
        )
    }

    fn venue(&self) -> String {
        let (low, right, top) = (
            -self.strip_m,
            self.width_m + self.strip_m,
            self.height_m + self.strip_m,
        );
        let homes: Vec<String> = self
            .homes
            .iter()
            .map(|(x, y)| format!("[{x:?}, {y:?}]"))
            .collect();
        format!(
            "kind = \"venue\"\nname = \"test\"\narea_m = [0.0, 0.0, {:?}, {:?}]\n\
             fence_m = [[{low:?}, {low:?}], [{right:?}, {low:?}], [{right:?}, {top:?}], [{low:?}, {top:?}]]\n\
             homes_m = [{}]\n[datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\naltitude_m = 0.0\n",
            self.width_m,
            self.height_m,
            homes.join(", ")
        )
    }

    fn wrl(&self) -> String {
        let mut text = "#VRML V2.0 utf8\n".to_owned();
        for (x, y, width, depth) in &self.blocks {
            let shape = format!("Shape {{ geometry Box {{ size {width} {depth} 1 }} }}");
            let _ = writeln!(
                text,
                "Transform {{ translation {x} {y} 0.5 children {shape} }}"
            );
        }
        text
    }
}

/// Nobody touched anything, nobody left the fence, and nobody came nearer than the separation less what the pose
/// errors (at most 3 deviations of 5 cm in each coordinate of both vehicles) can hide.
pub fn assert_safe(outcome: &RunOutcome) {
    assert!(
        outcome.collisions.is_empty(),
        "{:?}\n{}",
        outcome.collisions,
        tail(&outcome.log)
    );
    assert_eq!(outcome.fence_breaches, 0, "{}", tail(&outcome.log));
    let apart_m = outcome.min_separation_m.unwrap_or(f64::INFINITY);
    assert!(
        apart_m >= 0.8,
        "two vehicles came as near as {apart_m:.2} m\n{}",
        tail(&outcome.log)
    );
}

/// At the end all nodes hold the same map, and the ground has stored exactly the samples that were made.
pub fn assert_settled(outcome: &RunOutcome) {
    let holdings: Vec<&str> = outcome
        .log
        .lines()
        .filter(|line| line.contains(" holds map "))
        .collect();
    let word_after = |line: &&str, word: &str| {
        let mut words = line.split([' ', ',']).skip_while(|other| *other != word);
        words.nth(1).map(str::to_owned)
    };
    let maps: Vec<Option<String>> = holdings
        .iter()
        .map(|line| word_after(line, "map"))
        .collect();
    assert!(
        maps.len() >= 3 && maps.windows(2).all(|pair| pair[0] == pair[1]),
        "{holdings:#?}"
    );
    let count = |line, word| word_after(line, word).and_then(|number| number.parse::<u64>().ok());
    let made: u64 = holdings.iter().filter_map(|line| count(line, "made")).sum();
    let stored: u64 = holdings
        .iter()
        .filter_map(|line| count(line, "stored"))
        .sum();
    assert!(
        made > 0 && made == stored,
        "{made} samples were made, {stored} are stored: {holdings:#?}"
    );
}

/// The last lines of a log, for a failed claim.
pub fn tail(log: &str) -> String {
    let lines: Vec<&str> = log.lines().collect();
    lines[lines.len().saturating_sub(60)..].join("\n")
}
