//! The same seed gives the same bytes; seeds that once failed are run for ever; and the bundled example ends with
//! many seeds.

use std::path::Path;

use tomoswarm::config::{self, bundled};
use tomoswarm::scene::{self, Up};
use tomoswarm::sim::Scenario;

use crate::place::{Place, assert_safe, tail};

/// The bundled example, with a line changed in its simulation file.
fn example(seed: u64, from: &str, to: &str) -> Scenario {
    let mut loader = |name: &str| bundled::load(name);
    let text = loader(bundled::COURTYARD)
        .expect("bundled")
        .replace(from, to);
    let sim = config::read_sim(bundled::COURTYARD, &text, None, &mut loader)
        .unwrap_or_else(|problems| panic!("{problems}"));
    let wrl = sim.scene.wrl.clone().expect("the courtyard has walls");
    let text = loader(&wrl).expect("bundled");
    let shapes =
        scene::read_vrml(&text, &wrl, Up::Z, &mut |_| Err("none".to_owned())).expect("a scene");
    Scenario::new(sim, shapes.shapes, seed).expect("the example is possible")
}

#[test]
fn the_same_seed_gives_the_same_log_byte_for_byte() {
    let run = |seed| {
        Place::new(12.0, 12.0)
            .vehicles(3)
            .seed(seed)
            .block((6.0, 0.0, 1.0, 1.0))
            .run()
            .log
    };
    assert!(run(7) == run(7), "the same log twice");
    assert!(run(7) != run(8), "the seed matters");
}

#[test]
fn the_bundled_example_is_safe_and_ends() {
    // In full only where it is quick; else one lap of each sweep.
    let (seeds, from, to) = if cfg!(debug_assertions) {
        (1..3, "positions = 76", "positions = 76\nlaps = 1")
    } else {
        (1..21, "positions = 76", "positions = 76")
    };
    for seed in seeds {
        let outcome = example(seed, from, to).run(&mut |_| true).expect("it runs");
        assert_safe(&outcome);
        assert!(
            outcome.finished,
            "seed {seed}: {:?}\n{}",
            outcome.failure,
            tail(&outcome.log)
        );
    }
}

#[test]
fn seeds_that_once_failed_do_not_fail_again() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/seeds.txt");
    let text = std::fs::read_to_string(file).expect("the list of seeds is there");
    for line in text
        .lines()
        .filter(|line| !line.starts_with('#') && !line.is_empty())
    {
        let numbers: Vec<f64> = line
            .split_whitespace()
            .map(|word| word.parse().expect("a number"))
            .collect();
        let [vehicles, seed, blocks @ ..] = &numbers[..] else {
            panic!("too short: {line}")
        };
        let place = Place::new(12.0, 12.0)
            .home(5, (2.0, -1.2))
            .vehicles(*vehicles as usize)
            .seed(*seed as u64);
        let (blocks, rest) = blocks.as_chunks::<4>();
        assert!(rest.is_empty(), "four numbers a block: {line}");
        let place = blocks.iter().fold(place, |place, [x, y, width, depth]| {
            place.block((*x, *y, *width, *depth))
        });
        place.run_to_the_end();
    }
}
