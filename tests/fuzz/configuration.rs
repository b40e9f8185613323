//! A random simulation: a venue of any shape with homes, a scene with what stands there, bodies, sensors, cells, a mission,
//! a fleet, wind, and faults. It may be one that `check` refuses.

use std::fmt::Write as _;

use super::chance::Chance;

/// The files of a simulation.
pub struct Configuration {
    pub seed: u64,
    pub kind: &'static str,
    /// The radius of the thinnest thing that stands there, metres.
    pub thinnest_m: f64,
    venue: String,
    scene: String,
    sim: String,
}

/// A place being drawn.
struct Ground {
    width_m: f64,
    height_m: f64,
    strip_m: f64,
    homes: Vec<(f64, f64)>,
}

const MISSIONS: [&str; 10] = [
    "sweep",
    "sweep",
    "explore",
    "explore",
    "search",
    "pathfind",
    "pathfind",
    "square",
    "patrol",
    "waypoints",
];

impl Configuration {
    /// Draws the configuration of a number; small ones are run in an instant.
    pub fn drawn(seed: u64, is_small: bool) -> Configuration {
        let mut chance = Chance::new(seed);
        let kind = match chance.happens(0.05) {
            true => chance.one_of(&["browse", "forward"]),
            false => chance.one_of(&MISSIONS),
        };
        let count = 1 + chance.below(4);
        let count = count.max(if kind == "sweep" { 2 } else { 1 });
        let ground = Ground::drawn(&mut chance, count, is_small);
        let (scene, thinnest_m) = ground.scene(&mut chance);
        Configuration {
            seed,
            kind,
            thinnest_m,
            venue: ground.venue(&mut chance, kind),
            scene,
            sim: ground.sim(&mut chance, kind, count, seed),
        }
    }

    /// Returns the names of its files and what stands in them.
    pub fn files(&self) -> [(&'static str, &str); 3] {
        [
            ("x.sim.toml", &self.sim),
            ("v.toml", &self.venue),
            ("s.toml", &self.scene),
        ]
    }
}

impl Ground {
    fn drawn(chance: &mut Chance, count: usize, is_small: bool) -> Ground {
        let most_m = if is_small { 8.0 } else { 16.0 };
        let (width_m, height_m) = (chance.between(3.0, most_m), chance.between(3.0, most_m));
        let strip_m = chance.between(1.2, 3.0);
        let mut homes: Vec<(f64, f64)> = Vec::new();
        for _ in 0..200 {
            let out_m = strip_m - 0.7;
            let at = (
                chance.between(-out_m, width_m + out_m),
                chance.between(-out_m, height_m + out_m),
            );
            let is_near = |home: &(f64, f64)| (home.0 - at.0).hypot(home.1 - at.1) < 1.3;
            if homes.len() < count && !homes.iter().any(is_near) {
                homes.push(at);
            }
        }
        Ground {
            width_m,
            height_m,
            strip_m,
            homes,
        }
    }

    fn place(&self, chance: &mut Chance) -> (f64, f64) {
        (
            chance.between(0.0, self.width_m),
            chance.between(0.0, self.height_m),
        )
    }

    /// A fence around the strip: whole, with a corner cut off, or with a corner cut out.
    fn venue(&self, chance: &mut Chance, kind: &str) -> String {
        let (low, right, top) = (
            -self.strip_m,
            self.width_m + self.strip_m,
            self.height_m + self.strip_m,
        );
        let cut_m = match kind {
            "sweep" => 0.5 * self.strip_m,
            _ => chance.between(0.5, 0.4 * self.width_m.min(self.height_m)),
        };
        let last = match chance.below(4) {
            0 => vec![(right, top - cut_m), (right - cut_m, top)],
            1 => vec![
                (right, top - cut_m),
                (right - cut_m, top - cut_m),
                (right - cut_m, top),
            ],
            _ => vec![(right, top)],
        };
        let corners = [(low, low), (right, low)]
            .into_iter()
            .chain(last)
            .chain([(low, top)]);
        let cell_m = chance.one_of(&[0.2, 0.2, 0.2, 0.1, 0.3, 0.4]);
        format!(
            "kind = \"venue\"\nname = \"fuzz\"\narea_m = [0.0, 0.0, {:?}, {:?}]\nfence_m = {}\nhomes_m = {}\n\
             cell_m = {cell_m:?}\n[datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n",
            self.width_m,
            self.height_m,
            listed(corners),
            listed(self.homes.iter().copied()),
        )
    }

    fn scene(&self, chance: &mut Chance) -> (String, f64) {
        let mut text = "kind = \"scene\"\nname = \"fuzz\"\n".to_owned();
        let mut thinnest_m = f64::INFINITY;
        for index in 0..chance.below(6) {
            let (x, y) = self.place(chance);
            let _ = writeln!(text, "[[object]]\nname = \"o{index}\"");
            match chance.below(4) {
                0 => {
                    let radius_m = chance.one_of(&[0.03, 0.05, 0.1, 0.3, 0.6]);
                    thinnest_m = thinnest_m.min(radius_m);
                    let _ = writeln!(text, "centre_m = [{x:?}, {y:?}]\nradius_m = {radius_m:?}");
                }
                1 => {
                    let (width, depth) = (chance.between(0.3, 2.0), chance.between(0.3, 2.0));
                    text += &outline(x, y, x + width, y + depth);
                }
                // A wall from one side, with room at its other end.
                2 => text += &outline(x, -self.strip_m, x + 0.2, self.height_m - 0.5),
                _ => text += &outline(-self.strip_m, y, self.width_m - 0.5, y + 0.2),
            }
        }
        for index in 0..chance.below(3) {
            let (x, y) = self.place(chance);
            let _ = writeln!(
                text,
                "[[person]]\nname = \"p{index}\"\nat_m = [{x:?}, {y:?}]"
            );
        }
        (text, thinnest_m)
    }

    fn sim(&self, chance: &mut Chance, kind: &'static str, count: usize, seed: u64) -> String {
        let end = chance.one_of(&["hold", "return"]);
        let mut text = format!(
            "kind = \"sim\"\nvenue = \"v.toml\"\nscene = \"s.toml\"\nuntil_s = 4000.0\nseed = {seed}\nend = \"{end}\"\n"
        );
        let _ = writeln!(text, "{}", self.mission(chance, kind));
        let _ = writeln!(text, "[vehicles]\ncount = {count}");
        for (key, values) in [
            ("radius_m", &[0.15, 0.25, 0.35][..]),
            ("max_speed_mps", &[0.2, 0.3, 0.5, 0.8]),
            ("braking_mps2", &[0.5, 1.0, 2.0]),
            ("acceleration_mps2", &[0.5, 2.0]),
            ("pose_sd_m", &[0.0, 0.02, 0.05, 0.1]),
        ] {
            let _ = writeln!(text, "{key} = {:?}", chance.one_of(values));
        }
        if chance.happens(0.3) {
            let (wind_mps, from_deg) = (chance.between(0.0, 5.0), chance.below(360));
            let _ = writeln!(
                text,
                "kind = \"copter\"\naltitude_m = 1.0\nwind_mps = {wind_mps:?}\nwind_from_deg = {from_deg}.0"
            );
        }
        let padding_m = chance.one_of(&[0.05, 0.1, 0.2]);
        let _ = writeln!(text, "[safety]\npadding_m = {padding_m:?}");
        text += &range(chance);
        if kind == "sweep" {
            let positions = 4 * (3 + chance.below(10));
            let _ = writeln!(text, "[sweep]\nlaps = 1\npositions = {positions}");
            text += "[imaging]\npixels = [8, 8]\n";
        }
        if chance.happens(0.3) {
            let _ = writeln!(text, "[bus]\ndrop_share = {:?}", chance.between(0.0, 0.2));
        }
        for _ in 0..[0, 0, 0, 1, 2][chance.below(5)] {
            text += &fault(chance, count);
        }
        text
    }

    fn mission(&self, chance: &mut Chance, kind: &str) -> String {
        if kind == "sweep" {
            return String::new();
        }
        let mut text = format!("[mission]\nkind = \"{kind}\"\n");
        match kind {
            "pathfind" | "waypoints" | "patrol" => {
                let places = 1 + chance.below(4);
                let places: Vec<_> = (0..places).map(|_| self.place(chance)).collect();
                let _ = writeln!(text, "waypoints_m = {}", listed(places.into_iter()));
            }
            "square" => {
                let size_m = chance.between(1.0, self.width_m.min(self.height_m));
                let _ = writeln!(text, "size_m = {size_m:?}");
            }
            "forward" => {
                let _ = writeln!(text, "distance_m = {:?}", chance.between(1.0, 30.0));
            }
            _ => {}
        }
        text
    }
}

/// A range sensor, of which some see far, seldom, or through one servo.
fn range(chance: &mut Chance) -> String {
    let mut text = "[range]\n".to_owned();
    if chance.happens(0.3) {
        let max_m = chance.one_of(&[3.0, 5.0, 8.0, 12.0, 30.0]);
        let sure_m = chance.between(0.5, 1.0) * max_m;
        let _ = writeln!(text, "max_range_m = {max_m:?}\nsure_range_m = {sure_m:?}");
    }
    if chance.happens(0.3) {
        let period_s = chance.one_of(&[0.05, 0.1, 0.2, 0.5]);
        let settle_s = chance.one_of(&[0.0, 0.01, 0.03]);
        let _ = writeln!(
            text,
            "scan_period_s = {period_s:?}\nsettle_s = {settle_s:?}"
        );
    }
    if chance.happens(0.2) {
        let beams = chance.one_of(&[
            "[0.0]",
            "[0.0, 30.0, -30.0]",
            "[0.0, 45.0, -45.0, 90.0, -90.0]",
        ]);
        let _ = writeln!(text, "beams_deg = {beams}");
    }
    if chance.happens(0.2) {
        let slew_s = chance.one_of(&[0.0, 0.1, 0.3]);
        let _ = writeln!(
            text,
            "[[range.sensor]]\nservo_from_deg = -90.0\nservo_to_deg = 90.0\nslew_s_per_60_deg = {slew_s:?}"
        );
    }
    text
}

fn fault(chance: &mut Chance, count: usize) -> String {
    let kind = chance.one_of(&[
        "gps", "gps", "sensor", "bus", "radio", "restart", "dead", "battery",
    ]);
    let at_s = chance.between(0.0, 200.0);
    let vehicle = 1 + chance.below(count);
    let mut text =
        format!("[[fault]]\nkind = \"{kind}\"\nat_s = {at_s:?}\nvehicles = [{vehicle}]\n");
    match kind {
        "battery" => text += &format!("charge = {:?}\n", chance.between(0.0, 0.3)),
        "dead" => {}
        _ if chance.happens(0.6) => {
            text += &format!("until_s = {:?}\n", at_s + chance.between(1.0, 400.0));
        }
        _ => {}
    }
    text
}

fn outline(left: f64, bottom: f64, right: f64, top: f64) -> String {
    let corners = [(left, bottom), (right, bottom), (right, top), (left, top)];
    format!("outline_m = {}\n", listed(corners.into_iter()))
}

fn listed(points: impl Iterator<Item = (f64, f64)>) -> String {
    let points: Vec<String> = points.map(|(x, y)| format!("[{x:?}, {y:?}]")).collect();
    format!("[{}]", points.join(", "))
}
