//! Fields of thin poles in a yard: does a rover that explores touch one? By hand, a thousand fields at two speeds, with the
//! poles and contacts of every radius printed:
//!
//! `cargo test --release --no-default-features --test sim poles:: -- --ignored --nocapture`

use std::fmt::Write as _;

use tomoswarm::config::{self, Sim};
use tomoswarm::geom::Point;
use tomoswarm::sim::{RunOutcome, Scenario};

/// Where the rover begins, metres.
const HOME: Point = Point::new(1.0, 3.0);
/// Poles stand at least so far from there, metres.
const HOME_FREE_M: f64 = 1.0;
/// Side of the yard, metres.
const SIDE_M: f64 = 8.0;

/// A pole: where it stands, and its radius in centimetres.
#[derive(Clone, Copy, Debug)]
struct Pole {
    at: Point,
    radius_cm: usize,
}

/// A yard with poles.
struct Field {
    seed: u64,
    poles: Vec<Pole>,
}

/// Numbers from a seed, 0 to 1 (splitmix64).
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn whole(&mut self, from: usize, to: usize) -> usize {
        from + (self.next() * (to + 1 - from) as f64) as usize
    }
}

impl Field {
    /// 3 to 12 poles of 1 to 5 cm radius anywhere in the yard but near the home.
    fn of(seed: u64) -> Field {
        let mut chance = Chance(seed);
        let count = chance.whole(3, 12);
        let mut poles = Vec::new();
        while poles.len() < count {
            let (x, y) = (chance.next(), chance.next());
            let at = Point::new(SIDE_M * x - 1.0, SIDE_M * y - 1.0);
            let radius_cm = chance.whole(1, 5);
            if at.distance_to(HOME) > HOME_FREE_M {
                poles.push(Pole { at, radius_cm });
            }
        }
        Field { seed, poles }
    }

    fn scene(&self) -> String {
        let mut text = "kind = \"scene\"\nname = \"poles\"\n".to_owned();
        for Pole { at, radius_cm } in &self.poles {
            let radius_m = *radius_cm as f64 / 100.0;
            let _ = writeln!(
                text,
                "[[object]]\ncentre_m = [{:?}, {:?}]\nradius_m = {radius_m:?}",
                at.x_m, at.y_m
            );
        }
        text
    }

    fn sim(&self, lines: &str) -> Sim {
        let (low, high) = (-1.0, SIDE_M - 1.0);
        let venue = format!(
            "kind = \"venue\"\nname = \"poles\"\narea_m = [0.0, 0.0, 6.0, 6.0]\n\
             fence_m = [[{low:?}, {low:?}], [{high:?}, {low:?}], [{high:?}, {high:?}], [{low:?}, {high:?}]]\n\
             homes_m = [[{:?}, {:?}]]\n[datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n",
            HOME.x_m, HOME.y_m
        );
        let scene = self.scene();
        let text = format!(
            "kind = \"sim\"\nvenue = \"venue.toml\"\nscene = \"scene.toml\"\nuntil_s = 3600.0\n\
             mission.kind = \"explore\"\nvehicles.count = 1\n{lines}"
        );
        let mut loader = |name: &str| match name {
            "venue.toml" => Ok(venue.clone()),
            "scene.toml" => Ok(scene.clone()),
            other => Err(format!("no file {other}")),
        };
        config::read_sim("test.toml", &text, None, &mut loader)
            .unwrap_or_else(|problems| panic!("{problems}"))
    }

    fn run(&self, lines: &str) -> RunOutcome {
        let scenario = Scenario::new(self.sim(lines), Vec::new(), self.seed)
            .expect("the scenario is possible");
        scenario
            .run(&mut |_| true)
            .expect("the scenario can be run")
    }

    /// The pole that a run ended at.
    fn touched(&self, outcome: &RunOutcome) -> Option<Pole> {
        let at = outcome.collisions.first()?.place;
        let gap_m = |pole: &&Pole| at.distance_to(pole.at) - pole.radius_cm as f64 / 100.0;
        let nearest = self
            .poles
            .iter()
            .min_by(|a, b| gap_m(a).total_cmp(&gap_m(b)));
        nearest.copied()
    }
}

/// Poles and contacts by radius; index = centimetres.
#[derive(Clone, Copy, Default)]
struct Tally {
    poles: [usize; 6],
    contacts: [usize; 6],
}

/// Runs fields and counts.
fn tally(seeds: std::ops::Range<u64>, lines: &str) -> Tally {
    let mut tally = Tally::default();
    for field in seeds.map(Field::of) {
        let outcome = field.run(lines);
        for pole in &field.poles {
            tally.poles[pole.radius_cm] += 1;
        }
        if let Some(pole) = field.touched(&outcome) {
            println!("seed {}: {pole:?} is driven into", field.seed);
            tally.contacts[pole.radius_cm] += 1;
        }
    }
    tally
}

/// The thinnest radius that is covered, centimetres.
fn covered_cm(lines: &str) -> f64 {
    let post = Field::of(1).sim(lines).smallest_post();
    post.expect("a fan covers something").radius_m * 100.0
}

#[test]
fn fields_are_as_they_are_said_to_be() {
    for seed in 1..=200 {
        let field = Field::of(seed);
        assert!((3..=12).contains(&field.poles.len()));
        for Pole { at, radius_cm } in field.poles {
            assert!((1..=5).contains(&radius_cm) && at.distance_to(HOME) > HOME_FREE_M);
            assert!((-1.0..=7.0).contains(&at.x_m) && (-1.0..=7.0).contains(&at.y_m));
        }
    }
}

#[test]
fn poles_that_the_speed_covers_are_not_driven_into() {
    let tally = tally(1..11, "");
    let thinnest = covered_cm("").ceil() as usize;
    assert!(tally.poles[thinnest..].iter().sum::<usize>() > 20);
    assert_eq!(tally.contacts[thinnest..].iter().sum::<usize>(), 0);
}

#[test]
#[ignore = "takes long; by hand, as said above"]
fn a_thousand_fields_at_two_speeds() {
    for lines in ["", "vehicles.max_speed_mps = 0.25\n"] {
        let thinnest_cm = covered_cm(lines);
        let tally = tally(1..1001, lines);
        println!("{lines}covered from {thinnest_cm:.2} cm on");
        for radius_cm in 1..=5 {
            let is_covered = radius_cm as f64 >= thinnest_cm;
            println!(
                "  {radius_cm} cm: {} poles, {} driven into{}",
                tally.poles[radius_cm],
                tally.contacts[radius_cm],
                if is_covered { " (covered)" } else { "" }
            );
        }
    }
}
