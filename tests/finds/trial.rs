//! The courtyard with persons in other places, in other numbers and of other strengths: who is found, and who is found that is
//! nobody; and the table of many such runs.

use std::fmt::{self, Write as _};
use std::time::Instant;

use tomoswarm::config::{self, bundled};
use tomoswarm::geom::Point;
use tomoswarm::scene::{self, Up};
use tomoswarm::sim::{FoundObject, RunOutcome, Scenario};

/// Who stands there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Placement {
    /// As in the bundled scene: two, well apart and away from the wall.
    Default,
    Nobody,
    /// One 0.35 to 0.7 m from the face of the wall, and one elsewhere.
    AtTheWall,
    /// Two, 1.5 m apart.
    Pair,
    Three,
    Five,
    /// Two that attenuate half as much.
    Weak,
    /// Two in the bundled scene of that name, among or within what stands there.
    House,
    Castle,
}

/// All of them.
pub const PLACEMENTS: [Placement; 9] = [
    Placement::Default,
    Placement::Nobody,
    Placement::AtTheWall,
    Placement::Pair,
    Placement::Three,
    Placement::Five,
    Placement::Weak,
    Placement::House,
    Placement::Castle,
];

impl fmt::Display for Placement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Placement::Default => "default",
            Placement::Nobody => "nobody",
            Placement::AtTheWall => "wall",
            Placement::Pair => "pair",
            Placement::Three => "three",
            Placement::Five => "five",
            Placement::Weak => "weak",
            Placement::House => "house",
            Placement::Castle => "castle",
        })
    }
}

/// A run.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FindTrial {
    pub placement: Placement,
    pub vehicles: usize,
    pub seed: u64,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct FindResult {
    pub trial: FindTrial,
    pub persons: Vec<Point>,
    pub finds: Vec<FoundObject>,
    /// Of each person who was found, metres.
    pub errors_m: Vec<f64>,
    /// How many of these lie in their 90 % ellipse.
    pub in_ellipse: usize,
    /// Wall time, seconds.
    pub took_s: f64,
    pub links: usize,
}

impl FindResult {
    pub fn is_all_found(&self) -> bool {
        self.errors_m.len() == self.persons.len()
    }

    pub fn nobodies(&self) -> usize {
        self.finds.len() - self.errors_m.len()
    }
}

/// Numbers that look drawn from a seed, 0 to 1.
fn drawn(seed: u64, index: u64) -> f64 {
    let mut x =
        seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index.wrapping_mul(0xD1B5_4A32_D192_ED03);
    for _ in 0..3 {
        x ^= x >> 31;
        x = x.wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x ^= x >> 29;
    }
    (x >> 11) as f64 / (1u64 << 53) as f64
}

impl FindTrial {
    /// The bundled scene and simulation in which it happens.
    fn scene(&self) -> &'static str {
        match self.placement {
            Placement::House => "house",
            Placement::Castle => "castle",
            _ => "courtyard",
        }
    }

    fn persons_toml(&self) -> String {
        let from_objects_m = if self.scene() == "courtyard" {
            1.5
        } else {
            0.5
        };
        let random = |count: u32, apart_m: f64, db_per_m: f64| {
            format!(
                "[random_persons]\ncount = {count}\nkeep_from_border_m = 2.0\nkeep_from_objects_m = {from_objects_m:?}\n\
                 apart_m = {apart_m:?}\nradius_m = 0.3\nheight_m = 1.8\ndb_per_m = {db_per_m:?}\n"
            )
        };
        let fixed = |x_m: f64, y_m: f64| format!("[[person]]\nat_m = [{x_m:.3}, {y_m:.3}]\n");
        match self.placement {
            Placement::Default | Placement::House | Placement::Castle => random(2, 3.0, 10.0),
            Placement::Nobody => String::new(),
            Placement::Three => random(3, 3.0, 10.0),
            Placement::Five => random(5, 3.0, 10.0),
            Placement::Weak => random(2, 3.0, 5.0),
            Placement::AtTheWall => {
                // The arms lie in x 6.0 to 6.3, y 5 to 13, and x 6 to 13, y 5.0 to 5.3.
                let off_m = 0.35 + 0.35 * drawn(self.seed, 1) + 0.3;
                let along = drawn(self.seed, 2);
                let at = match (drawn(self.seed, 3) * 4.0) as u32 {
                    0 => (6.0 - off_m, 5.5 + 7.0 * along),
                    1 => (6.3 + off_m, 6.5 + 6.0 * along),
                    2 => (6.5 + 6.0 * along, 5.0 - off_m),
                    _ => (7.5 + 5.0 * along, 5.3 + off_m),
                };
                fixed(at.0, at.1) + &random(1, 3.0, 10.0)
            }
            Placement::Pair => {
                // In the open east and north, wherever the pair is turned to.
                let (x_m, y_m) = (
                    8.5 + 8.0 * drawn(self.seed, 1),
                    8.0 + 8.5 * drawn(self.seed, 2),
                );
                let turn = std::f64::consts::TAU * drawn(self.seed, 3);
                fixed(x_m, y_m) + &fixed(x_m + 1.5 * turn.cos(), y_m + 1.5 * turn.sin())
            }
        }
    }

    /// Returns the scenario.
    pub fn scenario(&self) -> Scenario {
        let of_place = match self.scene() {
            "courtyard" => {
                "kind = \"scene\"\nname = \"courtyard\"\nwrl = \"courtyard.wrl\"\nup = \"z\"\n\
                            [material.Wall]\ndb_per_m = 20.0\n"
                    .to_owned()
            }
            other => bundled::load(&format!("scenes/{other}.scene.toml")).expect("it is bundled"),
        };
        let scene = of_place + &self.persons_toml();
        let mut loader = |name: &str| match name.ends_with("scene.toml") {
            true => Ok(scene.clone()),
            false => bundled::load(name),
        };
        let name = format!("configs/{}.sim.toml", self.scene());
        let text = bundled::load(&name).expect("it is bundled");
        let text = text.replace(
            "count = 2\nradius_m",
            &format!("count = {}\nradius_m", self.vehicles),
        );
        let text = match self.scene() {
            "courtyard" => text,
            // Elsewhere an empty sweep is driven first, too, and takes its time.
            _ => text.replace(
                "kind = \"sim\"\n",
                "kind = \"sim\"\nempty_sweep = true\nuntil_s = 14400.0\n",
            ),
        };
        let sim = config::read_sim(&name, &text, None, &mut loader)
            .unwrap_or_else(|problems| panic!("{problems}"));
        let wrl = format!("{}.wrl", self.scene());
        let text = bundled::load(&format!("scenes/{wrl}")).expect("it is bundled");
        let shapes = scene::read_vrml(&text, &wrl, Up::Z, &mut |_| Err("none".to_owned()))
            .expect("it is a scene");
        Scenario::new(sim, shapes.shapes, self.seed).expect("it is possible")
    }

    /// Runs it.
    pub fn run(&self) -> FindResult {
        let began = Instant::now();
        let outcome = self.scenario().run(&mut |_| true).expect("it can be run");
        judged(*self, &outcome, began.elapsed().as_secs_f64())
    }
}

/// Says of each find which person it is, as every run does.
fn judged(trial: FindTrial, outcome: &RunOutcome, took_s: f64) -> FindResult {
    let persons: Vec<Point> = outcome.persons.iter().map(|person| person.at).collect();
    let finds = outcome.found();
    let (mut errors_m, mut in_ellipse) = (Vec::new(), 0);
    for (find, person) in finds.iter().filter_map(|find| Some((find, find.person?))) {
        errors_m.extend(find.error_m);
        let off = persons[person] - find.at;
        let [xx, xy, yy] = find.covariance_m2;
        let determinant = xx * yy - xy * xy;
        let square = (yy * off.x_m * off.x_m - 2.0 * xy * off.x_m * off.y_m
            + xx * off.y_m * off.y_m)
            / determinant;
        in_ellipse += usize::from(square <= 4.605);
    }
    FindResult {
        trial,
        persons,
        finds,
        errors_m,
        in_ellipse,
        took_s,
        links: outcome.change.as_ref().map_or(0, |change| change.used),
    }
}

/// Returns the table of many runs.
pub fn table(results: &[FindResult]) -> String {
    let mut text = String::from(
        "| persons | vehicles | runs | all found | persons found | nobody, per image | error median, 95 %, max (m) | in 90 % ellipse |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mut kinds: Vec<(Placement, usize)> = results
        .iter()
        .map(|one| (one.trial.placement, one.trial.vehicles))
        .collect();
    kinds.sort_unstable();
    kinds.dedup();
    for kind in kinds {
        let of: Vec<&FindResult> = results
            .iter()
            .filter(|one| (one.trial.placement, one.trial.vehicles) == kind)
            .collect();
        let runs = of.len() as f64;
        let all = of.iter().filter(|one| one.is_all_found()).count() as f64;
        let persons: usize = of.iter().map(|one| one.persons.len()).sum();
        let mut errors_m: Vec<f64> = of.iter().flat_map(|one| one.errors_m.clone()).collect();
        errors_m.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let index = (share * errors_m.len() as f64) as usize;
            errors_m
                .get(index.min(errors_m.len().saturating_sub(1)))
                .copied()
                .unwrap_or(f64::NAN)
        };
        let nobodies: usize = of.iter().map(|one| one.nobodies()).sum();
        let inside: usize = of.iter().map(|one| one.in_ellipse).sum();
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.3} | {:.3} | {:.3} | {:.3}, {:.3}, {:.2} | {:.3} |",
            kind.0,
            kind.1,
            of.len(),
            all / runs,
            errors_m.len() as f64 / persons.max(1) as f64,
            nobodies as f64 / runs,
            at(0.5),
            at(0.95),
            at(1.0),
            inside as f64 / errors_m.len().max(1) as f64,
        );
    }
    text
}
