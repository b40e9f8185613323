//! Persons who walk in a simulated fixed network of 28 nodes around a room, recorded as the classical networks do it, and
//! followed by `tomoswarm image --track`: the project's own radio field and attenuation, another fade and another way each
//! seed.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use tomoswarm::geom::Point;
use tomoswarm::scene::{Attenuation, Material, Person, Scene, SceneParts};
use tomoswarm::sim::noise::{Noise, NoisePurpose};
use tomoswarm::sim::radio_field::{RadioConstants, RadioField, Transmission};

/// Side of the room, metres.
const SIDE_M: f64 = 6.4;
const NODES: u32 = 28;
/// One round of all receivers, seconds.
const ROUND_S: f64 = 0.4;
/// Rounds of the empty room, and with persons.
const EMPTY_ROUNDS: u32 = 20;
const ROUNDS: u32 = 150;
/// Errors count from here on, seconds: nobody is found at once.
const SETTLED_S: f64 = 4.0;
/// A person is said to be there when somebody is followed as near as this, metres.
const NEAR_M: f64 = 1.0;
/// Persons this far from each other are apart, metres.
const APART_M: f64 = 1.5;

/// Some persons who walk.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Walk {
    pub persons: u64,
    pub seed: u64,
}

/// How right the tracks are.
#[derive(Clone, PartialEq, Debug)]
pub struct WalkResult {
    /// Distance from each person to the nearest one that is followed, at each time, metres.
    pub errors_m: Vec<f64>,
    /// Share of the times at which as many are followed as are there, of those at which all are apart: who pass each other look
    /// like one.
    pub counted_right: f64,
}

impl WalkResult {
    pub fn median_m(&self) -> f64 {
        let mut sorted = self.errors_m.clone();
        sorted.sort_by(f64::total_cmp);
        sorted
            .get(sorted.len() / 2)
            .copied()
            .unwrap_or(f64::INFINITY)
    }

    /// Share of the times at which a person is followed at all.
    pub fn near(&self) -> f64 {
        let near = self.errors_m.iter().filter(|error_m| **error_m <= NEAR_M);
        near.count() as f64 / self.errors_m.len().max(1) as f64
    }
}

impl Walk {
    /// Records the walk into a folder, follows it with the program, and compares.
    pub fn run(&self, program: &str, folder: &Path) -> WalkResult {
        let write = |name: &str, text: String| std::fs::write(folder.join(name), text).unwrap();
        write("nodes.csv", nodes_csv());
        write("empty.csv", self.recording(EMPTY_ROUNDS, 0, 1));
        write("walk.csv", self.recording(ROUNDS, self.persons, 2));
        let ended = Command::new(program)
            .args([
                "image",
                "walk.csv",
                "--nodes",
                "nodes.csv",
                "--empty",
                "empty.csv",
            ])
            .args(["--track", "track.csv"])
            .current_dir(folder)
            .output()
            .unwrap();
        assert!(
            ended.status.success(),
            "{}",
            String::from_utf8_lossy(&ended.stderr)
        );
        self.compared(&std::fs::read_to_string(folder.join("track.csv")).unwrap())
    }

    /// Where a person is: from one place of the room to the next, at 0.5 to 1.2 m/s.
    fn at(&self, person: u64, at_s: f64) -> Point {
        let draw = |step: u64, what: u64| uniform(&[self.seed, person, step, what]);
        let place = |step: u64| {
            let coordinate = |what: u64| 0.6 + (SIDE_M - 1.2) * draw(step, what);
            Point::new(coordinate(0), coordinate(1))
        };
        let mut left_s = at_s;
        for step in 0.. {
            let (from, to) = (place(step), place(step + 1));
            let takes_s = from.distance_to(to) / (0.5 + 0.7 * draw(step, 2));
            if left_s < takes_s {
                return from + (to - from) * (left_s / takes_s);
            }
            left_s -= takes_s;
        }
        unreachable!("a walk goes on for ever")
    }

    fn are_apart(&self, at_s: f64) -> bool {
        let places: Vec<Point> = (0..self.persons)
            .map(|person| self.at(person, at_s))
            .collect();
        let pairs = places.iter().enumerate().flat_map(|(index, one)| {
            places[index + 1..]
                .iter()
                .map(|other| one.distance_to(*other))
        });
        pairs.into_iter().all(|apart_m| apart_m >= APART_M)
    }

    fn recording(&self, rounds: u32, persons: u64, run: u64) -> String {
        let noise = Noise::new(self.seed);
        let field = RadioField::new(noise, RadioConstants::default());
        let nodes = nodes();
        let mut text = String::new();
        for round in 0..rounds {
            for receiver in 0..NODES {
                let at_s = (f64::from(round) + f64::from(receiver) / f64::from(NODES)) * ROUND_S;
                let attenuation = self.attenuation(persons, at_s);
                let strength = |transmitter: u32| {
                    if transmitter == receiver {
                        return -45;
                    }
                    let packet = Transmission {
                        from: nodes[transmitter as usize],
                        to: nodes[receiver as usize],
                        channel: 11,
                        power_dbm: 0,
                    };
                    let lost_db = attenuation.between(packet.from, packet.to);
                    let ids = [run, round.into(), receiver.into(), transmitter.into()];
                    field.received(&packet, lost_db, ids).unwrap_or(-100)
                };
                let heard: Vec<String> =
                    (0..NODES).map(|node| strength(node).to_string()).collect();
                let second = at_s as u32;
                let _ = writeln!(
                    text,
                    "{receiver}, {}, 11, {}, {}",
                    heard.join(", "),
                    second / 60,
                    second % 60
                );
            }
        }
        text
    }

    fn attenuation(&self, persons: u64, at_s: f64) -> Attenuation {
        let person = |person: u64| Person {
            name: format!("person {person}"),
            at: self.at(person, at_s),
            path: Vec::new(),
            radius_m: 0.3,
            height_m: 1.8,
            db_per_m: 10.0,
        };
        let persons: Vec<Person> = (0..persons).map(person).collect();
        let scene = Scene::build(&SceneParts {
            shapes: &[],
            offset_m: [0.0; 3],
            materials: &BTreeMap::new(),
            default_material: Material::default(),
            posts: &[],
            persons: &persons,
        });
        Attenuation::new(&scene.unwrap(), 1.0, 0.125, 30.0)
    }

    fn compared(&self, track: &str) -> WalkResult {
        let mut times: BTreeMap<u64, Vec<Point>> = BTreeMap::new();
        let last_s = f64::from(ROUNDS) * ROUND_S - 1.0;
        // Whoever is not followed at all has no line: every half second counts.
        for half in (2.0 * SETTLED_S) as u64..(2.0 * last_s) as u64 {
            times.insert(half, Vec::new());
        }
        let lines = track.lines().filter(|line| !line.starts_with('#'));
        for line in lines.skip(1) {
            let fields: Vec<f64> = line
                .split(',')
                .map(|field| field.parse().unwrap())
                .collect();
            let half = (2.0 * fields[0]) as u64;
            let is_first = |at_s: f64| at_s - half as f64 / 2.0 < 0.2;
            if let Some(there) = times.get_mut(&half).filter(|_| is_first(fields[0])) {
                there.push(Point::new(fields[2], fields[3]));
            }
        }
        let (mut errors_m, mut apart, mut right) = (Vec::new(), 0u32, 0u32);
        for (half, there) in &times {
            let at_s = *half as f64 / 2.0 + 0.1;
            if self.are_apart(at_s) {
                apart += 1;
                right += u32::from(there.len() as u64 == self.persons);
            }
            for person in 0..self.persons {
                let at = self.at(person, at_s);
                let away_m = there.iter().map(|one| one.distance_to(at));
                errors_m.push(away_m.fold(f64::INFINITY, f64::min));
            }
        }
        WalkResult {
            errors_m,
            counted_right: f64::from(right) / f64::from(apart.max(1)),
        }
    }
}

fn nodes() -> Vec<Point> {
    let step_m = SIDE_M / 7.0;
    (0..NODES)
        .map(|node| {
            let along_m = f64::from(node % 7) * step_m;
            match node / 7 {
                0 => Point::new(0.0, along_m),
                1 => Point::new(along_m, SIDE_M),
                2 => Point::new(SIDE_M, SIDE_M - along_m),
                _ => Point::new(SIDE_M - along_m, 0.0),
            }
        })
        .collect()
}

fn nodes_csv() -> String {
    let line = |(id, at): (usize, Point)| format!("{id},{:.4},{:.4}\n", at.x_m, at.y_m);
    let lines: String = nodes().into_iter().enumerate().map(line).collect();
    format!("id,x_m,y_m\n{lines}")
}

fn uniform(ids: &[u64]) -> f64 {
    Noise::new(7).uniform(NoisePurpose::Start, ids)
}
