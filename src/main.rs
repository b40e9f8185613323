//! The `tomoswarm` command.

use tomoswarm::{config, scene, sim};

fn main() {
    let text = std::fs::read_to_string("configs/courtyard.sim.toml").unwrap();
    let mut loader = |path: &str| std::fs::read_to_string(path).map_err(|e| e.to_string());
    let vehicles = std::env::args().nth(2).map(|s| s.parse().unwrap());
    let config = match config::read_sim("configs/courtyard.sim.toml", &text, vehicles, &mut loader) {
        Ok(c) => c,
        Err(p) => {
            println!("{p}");
            return;
        }
    };
    let wrl = config.scene.wrl.clone().unwrap();
    let vrml =
        scene::read_vrml(&std::fs::read_to_string(&wrl).unwrap(), &wrl, scene::Up::Z, &mut loader).unwrap();
    let seed = std::env::args().nth(1).map_or(1, |s| s.parse().unwrap());
    let scenario = sim::Scenario::new(config, vrml.shapes, seed).unwrap();
    #[allow(clippy::disallowed_methods)]
    let start = std::time::Instant::now();
    let outcome = scenario.run(&mut |_| true).unwrap();
    let wall = start.elapsed().as_secs_f64();
    std::fs::write("/tmp/run.log", &outcome.log).unwrap();
    println!(
        "wall {wall:.2} s, sim {} factor {:.0}, finished {} {:?} coll {} fence {} sep {:?} samples {} links {} {} counts {:?} bytes {}",
        outcome.simulated,
        outcome.simulated.as_secs_f64() / wall,
        outcome.finished,
        outcome.failure,
        outcome.collisions.len(),
        outcome.fence_breaches,
        outcome.min_separation_m,
        outcome.samples,
        outcome.links.len(),
        outcome.empty_links.len(),
        outcome.counts,
        outcome.bus_bytes
    );
    for p in &outcome.persons {
        println!("person {:?}", p.at);
    }
    for f in outcome.found() {
        println!("found {:?}", f);
    }
}
