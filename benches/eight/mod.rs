//! Eight rovers that sweep the bundled courtyard.

use tomoswarm::config::{self, bundled};
use tomoswarm::scene::{self, Up};
use tomoswarm::sim::Scenario;

/// How many they are.
pub(crate) const VEHICLES: u8 = 8;

/// Makes what they do for some time.
pub(crate) fn scenario(for_s: f64) -> Scenario {
    let mut loader = |name: &str| bundled::load(name);
    let until_s = format!("until_s = {for_s:.1}");
    let text = loader(bundled::COURTYARD).expect("bundled");
    let text = text
        .replace("count = 2", &format!("count = {VEHICLES}"))
        .replace("until_s = 14400.0", &until_s)
        .replace("positions = 76", "positions = 76\nlaps = 40");
    let sim = config::read_sim(bundled::COURTYARD, &text, None, &mut loader)
        .unwrap_or_else(|problems| panic!("{problems}"));
    let wrl = sim.scene.wrl.clone().expect("the courtyard has walls");
    let text = loader(&wrl).expect("bundled");
    let shapes = scene::read_vrml(&text, &wrl, Up::Z, &mut |_| Err("none".to_owned()));
    Scenario::new(sim, shapes.expect("a scene").shapes, 1).expect("it is possible")
}
