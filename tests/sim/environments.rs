//! The three bundled environments are what their documentation promises, whatever drives in them.

use std::collections::BTreeMap;

use tomoswarm::config::{self, Sim, bundled};
use tomoswarm::geom::{Point, Segment};
use tomoswarm::scene::{self, Scene, VrmlScene, read_vrml};
use tomoswarm::sim::{Scenario, staging};

const ALL: [&str; 3] = ["castle", "trees", "house"];
/// Radius of a rover and what it keeps around it at the widest setting, metres.
const WIDE_M: f64 = 0.25 + 1.5;
/// The same with the default padding and two deviations of its place.
const USUAL_M: f64 = 0.25 + 0.1 + 2.0 * 0.05;

const NONE: f64 = f64::NEG_INFINITY;

/// An object, and the area of its cut with the ends of the box around it.
type Figures = (usize, [f64; 5]);

fn loaded(name: &str) -> (Sim, VrmlScene) {
    let file = bundled::simulation(name).unwrap();
    let text = bundled::load(file).unwrap();
    let sim = config::read_sim(file, &text, None, &mut |path| bundled::load(path)).unwrap();
    let wrl = sim.scene.wrl.clone().unwrap();
    let up = match sim.scene.up {
        config::Up::Y => scene::Up::Y,
        config::Up::Z => scene::Up::Z,
    };
    let shapes = read_vrml(&bundled::load(&wrl).unwrap(), &wrl, up, &mut |_| {
        Err("none".into())
    })
    .unwrap();
    assert_eq!(
        shapes.warnings,
        Vec::<String>::new(),
        "everything in {name} is understood"
    );
    (sim, shapes)
}

fn built(name: &str) -> (Sim, Scene) {
    let (sim, shapes) = loaded(name);
    let scene = staging::build(&sim.scene, &shapes.shapes, &[]).unwrap();
    (sim, scene)
}

/// Returns whether a disc can be moved along a way without touching what a rover would touch.
fn passes(scene: &Scene, from: (f64, f64), to: (f64, f64), radius_m: f64) -> bool {
    let way = Segment::new(Point::new(from.0, from.1), Point::new(to.0, to.1));
    scene.first_contact(way, radius_m, 0.02, 0.3).is_none()
}

#[test]
fn what_a_rover_can_touch_rises_straight_from_the_ground_past_its_sensor() {
    for name in ALL {
        let (_, scene) = built(name);
        // By object, and no corners: a sheet's pieces and those in the middle of a straight side may lie elsewhere.
        let cut = |height_m: f64| -> Vec<Figures> {
            let mut objects: BTreeMap<usize, [f64; 5]> = BTreeMap::new();
            for outline in scene.outlines(height_m) {
                let sum = objects
                    .entry(outline.object)
                    .or_insert([0.0, NONE, NONE, NONE, NONE]);
                sum[0] += outline.polygon.area_m2();
                for corner in outline.polygon.corners() {
                    let ends = [corner.x_m, corner.y_m, -corner.x_m, -corner.y_m];
                    sum.iter_mut()
                        .skip(1)
                        .zip(ends)
                        .for_each(|(most, end)| *most = most.max(end));
                }
            }
            objects.into_iter().collect()
        };
        let low = cut(0.02);
        assert!(low.len() > 10);
        for height_m in [0.1, 0.2, 0.3, 0.4, 0.49] {
            let here = cut(height_m);
            let same = |(one, other): (&Figures, &Figures)| {
                one.0 == other.0 && one.1.iter().zip(other.1).all(|(a, b)| (a - b).abs() < 1e-6)
            };
            assert_eq!(here.len(), low.len(), "{name} at {height_m} m");
            assert!(here.iter().zip(&low).all(same), "{name} at {height_m} m");
        }
    }
}

#[test]
fn what_hangs_begins_above_every_rover() {
    for name in ALL {
        let (_, scene) = built(name);
        let low = scene.outlines(0.3);
        let hanging = |height_m: f64| {
            let objects: Vec<usize> = low.iter().map(|outline| outline.object).collect();
            scene
                .outlines(height_m)
                .into_iter()
                .filter(|one| !objects.contains(&one.object))
                .count()
        };
        assert!(
            (5..14).all(|tenth| hanging(f64::from(tenth) / 10.0) == 0),
            "{name}"
        );
        assert!(hanging(2.45) > 0, "{name} has an arch, a crown or a lintel");
    }
}

#[test]
fn the_ground_is_never_higher_than_the_wheels() {
    for name in ALL {
        let (sim, scene) = built(name);
        let mut lowest_m: f64 = 0.0;
        for step in 0..=240 {
            for other in 0..=240 {
                let (x, y) = (f64::from(step) / 10.0, f64::from(other) / 10.0);
                let is_free = scene.clearance_m(Point::new(x, y), 0.02, 0.3) > 0.0;
                let hit = scene
                    .cast([x, y, 0.02], [0.0, 0.0, -1.0], 5.0)
                    .filter(|_| is_free);
                let Some(hit) = hit else {
                    assert!(!is_free, "{name} has no ground at ({x}, {y})");
                    continue;
                };
                assert!(
                    hit.distance_m >= 0.02 - 1e-9,
                    "{name} at ({x}, {y}): {}",
                    0.02 - hit.distance_m
                );
                lowest_m = lowest_m.min(0.02 - hit.distance_m);
            }
        }
        assert_eq!(lowest_m < -0.05, name == "trees", "{name}: {lowest_m}");
        assert_eq!(sim.venue.fence.area_m2(), 576.0);
    }
}

#[test]
fn homes_and_the_way_around_leave_room_for_the_widest_margins() {
    for name in ALL {
        let (sim, scene) = built(name);
        assert_eq!(sim.venue.homes.len(), 8);
        for home in &sim.venue.homes {
            assert!(
                scene.clearance_m(*home, 0.02, 0.3) > WIDE_M,
                "{name}: {home:?}"
            );
            assert!(
                sim.venue.fence.contains_disc(*home, WIDE_M),
                "{name}: {home:?}"
            );
        }
        let corners = [
            (2.0, 2.0),
            (22.0, 2.0),
            (22.0, 22.0),
            (2.0, 22.0),
            (2.0, 2.0),
        ];
        assert!(
            corners
                .windows(2)
                .all(|way| passes(&scene, way[0], way[1], WIDE_M)),
            "{name}"
        );
        let corners = sim
            .venue
            .area
            .corners()
            .map(|corner| (corner.x_m, corner.y_m));
        let ring = corners.iter().zip(corners.iter().cycle().skip(1));
        assert!(
            ring.clone()
                .all(|(from, to)| passes(&scene, *from, *to, USUAL_M)),
            "{name}"
        );
    }
}

#[test]
fn gates_bridges_and_doorways_are_as_wide_as_they_are_said_to_be() {
    // Name, from, to, the radius that passes and one that does not.
    let ways = [
        ("castle", (12.0, 2.0), (12.0, 8.0), 2.19, 2.21),
        ("castle", (7.7, 22.0), (7.7, 15.0), 0.69, 0.71),
        ("trees", (2.0, 10.6), (22.0, 10.6), 1.85, 2.21),
        ("trees", (9.8, 16.1), (13.4, 16.1), 0.69, 0.71),
        ("house", (12.0, 2.0), (12.0, 14.0), 0.78, 0.91),
        ("house", (12.0, 6.8), (22.0, 6.8), 0.78, 0.91),
        ("house", (12.0, 6.8), (7.5, 6.8), 0.5, 0.91),
        ("house", (12.0, 10.2), (9.6, 10.2), 0.78, 0.91),
        ("house", (12.0, 10.2), (15.0, 10.2), 0.78, 0.91),
        ("house", (6.5, 7.4), (6.5, 9.6), 0.7, 0.91),
        ("house", (2.0, 15.2), (9.0, 15.2), 0.78, 0.91),
        ("house", (22.0, 16.2), (13.2, 16.2), 0.78, 0.91),
    ];
    for (name, from, to, fits_m, sticks_m) in ways {
        let (_, scene) = built(name);
        assert!(
            passes(&scene, from, to, fits_m),
            "{name}: {from:?} to {to:?}"
        );
        assert!(
            !passes(&scene, from, to, sticks_m),
            "{name}: {from:?} to {to:?}"
        );
    }
    let (_, castle) = built("castle");
    let around = [
        (12.0, 7.9),
        (15.9, 7.9),
        (15.9, 14.0),
        (14.0, 16.1),
        (7.9, 16.1),
        (7.9, 11.2),
    ];
    assert!(
        around
            .windows(2)
            .all(|way| passes(&castle, way[0], way[1], 1.75)),
        "the court is wide enough"
    );
}

#[test]
fn a_sweep_of_each_ends_and_hears_what_stands_there() {
    for name in ALL {
        let (sim, shapes) = loaded(name);
        let outcome = Scenario::new(sim, shapes.shapes, 1)
            .unwrap()
            .run(&mut |_| true)
            .unwrap();
        assert!(
            outcome.finished && outcome.collisions.is_empty() && outcome.fence_breaches == 0,
            "{name}"
        );
        // Free space takes 40 + 20 log10(d) dB: what is weaker by 10 dB has met something.
        let is_weak = |link: &&tomoswarm::tomo::Link| {
            let d_m = link.from.distance_to(link.to);
            d_m > 3.0 && link.mean_dbm < -40.0 - 20.0 * d_m.log10() - 10.0
        };
        let weak = outcome.links.iter().filter(is_weak).count();
        assert!(
            10 * weak > outcome.links.len(),
            "{name}: {weak} of {}",
            outcome.links.len()
        );
        assert!(outcome.links.len() > 1000, "{name}");
    }
}
