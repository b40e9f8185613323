//! A configuration as it is in force, as TOML: every key with its value, those that were left out with their defaults, and
//! as comments above it what follows from them. Read back it means the same; files are named as they were opened, so the
//! text is read from the same folder under a name without one (`tomoswarm check -`).

use super::counted::counted;
use crate::config::{
    self, Axis, Config, Experiment, GroundFile, RangeDriver, Sim, VehicleFile, Venue,
};
use crate::geom::without_dust;
use crate::plan::{ContactLimits, SmallestPost};
use crate::sim::narrowest_gap_m;

/// The most vehicles that a sweep is planned for.
const SWEEPING: std::ops::RangeInclusive<usize> = 2..=8;
/// Values of an axis that are listed.
const VALUES_SHOWN: usize = 20;

/// A name and what is said under it.
pub(super) type Line = (&'static str, String);

/// Describes the configuration of a file; ends in a line break. `further` is said above it too.
pub(super) fn describe(file: &str, config: &Config, further: &[Line]) -> String {
    let (what, mut lines) = match config {
        Config::Venue(venue) => ("a venue", venue_lines(venue)),
        Config::Scene(scene) => ("a scene", vec![("scene", format!("scene {}", scene.name))]),
        Config::Sim(sim) => ("a simulation", sim_lines(sim)),
        Config::Vehicle(file) => ("a vehicle's node", vehicle_lines(file)),
        Config::Ground(file) => ("a ground station's node", ground_lines(file)),
        Config::Operator(file) => ("an operator's commands", venue_lines(&file.venue)),
        Config::Experiment(experiment) => ("an experiment", experiment_lines(experiment)),
    };
    lines.extend_from_slice(further);
    let output = lines
        .iter()
        .map(|(name, value)| comment(&format!("  {name:<12} {value}")));
    let comments: String = std::iter::once(comment(&format!("{file}: {what}")))
        .chain(output)
        .collect();
    format!("{comments}{}", config::to_toml(config))
}

/// Returns a comment of one line, whatever the text.
fn comment(text: &str) -> String {
    let printable: String = text
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    format!("# {printable}\n")
}

fn venue_lines(venue: &Venue) -> Vec<Line> {
    let area = venue.area;
    vec![
        (
            "venue",
            format!("venue {}, hash {:016x}", venue.name, venue.hash()),
        ),
        (
            "area",
            format!(
                "{} m × {} m",
                without_dust(area.width_m()),
                without_dust(area.height_m())
            ),
        ),
        (
            "fence",
            format!(
                "{} corners, {:.1} m²",
                venue.fence.corners().len(),
                venue.fence.area_m2().abs()
            ),
        ),
        ("homes", venue.homes.len().to_string()),
    ]
}

fn sim_lines(sim: &Sim) -> Vec<Line> {
    let mut list = venue_lines(&sim.venue);
    list.push(("scene", format!("scene {}", sim.scene.name)));
    list.push(("vehicles", counted(sim.vehicles.count, "vehicle")));
    let look = &sim.range.look;
    list.push((
        "looks",
        format!("one round takes {} s", look.cycle().as_secs_f64()),
    ));
    list.push(posts_line(
        sim.contact_limits(),
        sim.smallest_post(),
        sim.vehicles.body.max_speed_mps,
    ));
    list.push((
        "gaps",
        format!(
            "of {:.2} m and more, in which nothing moves, a vehicle passes for sure; narrower ones perhaps",
            narrowest_gap_m(sim)
        ),
    ));
    list.push((
        "beacons",
        format!("slot {} s", sim.venue.swarm.slot().as_secs_f64()),
    ));
    let persons = sim
        .scene
        .random_persons
        .map(|random| format!("{} random persons", random.count));
    list.extend(persons.map(|persons| ("persons", persons)));
    list
}

fn vehicle_lines(file: &VehicleFile) -> Vec<Line> {
    let home = format!(
        "number {}, at home at ({}, {})",
        file.id, file.home.x_m, file.home.y_m
    );
    let mut list = vec![
        ("vehicle", home),
        (
            "looks",
            format!("one round takes {} s", file.look.cycle().as_secs_f64()),
        ),
    ];
    list.push(("drivers", file.drivers.in_words()));
    if file.drivers.range == RangeDriver::None {
        list.push((
            "warning",
            "without a range sensor it sees nothing, and is not driven".to_owned(),
        ));
    } else {
        list.push(posts_line(
            Some(file.contact_limits()),
            file.smallest_post(),
            file.body.max_speed_mps,
        ));
    }
    list.extend(venue_lines(&file.venue));
    list
}

/// Says which posts a vehicle of this speed does not touch.
fn posts_line(
    limits: Option<ContactLimits>,
    smallest: Option<SmallestPost>,
    speed_mps: f64,
) -> Line {
    let Some(limits) = limits else {
        let text =
            "a beam passes by what is thin: posts of any radius may be driven into".to_owned();
        return ("warning", text);
    };
    match smallest {
        Some(SmallestPost { radius_m, heard_m }) => {
            let radius_m = (radius_m * 1000.0 - 1e-6).ceil() / 1000.0;
            let text = format!(
                "from {radius_m} m of radius on, heard up to {heard_m:.2} m, they are not touched at {speed_mps} m/s"
            );
            ("posts", text)
        }
        None if limits.seen_from_m.is_infinite() => {
            let text =
                "the beams leave a gap straight ahead: posts of any radius may be driven into";
            ("warning", text.to_owned())
        }
        None => {
            let needed_m = limits.needed_m(speed_mps);
            let text = format!(
                "posts of any radius may be driven into: at {speed_mps} m/s one must be heard from {needed_m:.2} m, and none is"
            );
            ("warning", text)
        }
    }
}

fn ground_lines(file: &GroundFile) -> Vec<Line> {
    let mut list = venue_lines(&file.venue);
    let count = file.vehicles.len();
    if !SWEEPING.contains(&count) {
        let text =
            format!("no sweep is planned for {count} vehicles, only for 2 to 8; all else works");
        list.push(("warning", text));
    }
    list
}

fn experiment_lines(experiment: &Experiment) -> Vec<Line> {
    let runs = format!(
        "{} runs of experiment {}",
        experiment.runs(),
        experiment.name()
    );
    let mut list = vec![("grid", runs)];
    for axis in Axis::ALL.into_iter().filter(|axis| experiment.has(*axis)) {
        let names = experiment.names(axis);
        let rest = if names.len() > VALUES_SHOWN {
            " …"
        } else {
            ""
        };
        let shown = names[..names.len().min(VALUES_SHOWN)].join(" ");
        list.push((axis.word(), format!("{}: {shown}{rest}", names.len())));
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::bundled;

    /// The comments above a bundled simulation with further lines.
    fn comments(lines: &str) -> String {
        let text = "kind = \"sim\"\nvenue = \"courtyard.venue.toml\"\nscene = \"../scenes/courtyard.scene.toml\"\n";
        let read = |path: &str| bundled::load(path);
        let config = config::read("configs/a.toml", &format!("{text}{lines}"), &mut { read });
        let described = describe("a.toml", &config.unwrap(), &[]);
        let comments = described.lines().filter(|line| line.starts_with('#'));
        comments.collect::<Vec<_>>().join("\n")
    }

    fn check(lines: &str, expected: &str) {
        let found = comments(lines);
        assert!(
            found.contains(expected),
            "{expected} is missing in:\n{found}"
        );
    }

    #[test]
    fn it_says_how_narrow_a_gap_may_be() {
        // More than 2 x (0.25 + 0.1 + 2 x 0.05 + 0.75 x 0.2) m, by the defaults.
        check(
            "",
            "  gaps         of 1.21 m and more, in which nothing moves, a vehicle passes for sure",
        );
    }

    #[test]
    fn it_says_which_posts_are_not_touched_or_that_none_is_promised() {
        check(
            "",
            "  posts        from 0.027 m of radius on, heard up to 0.97 m, they are not touched at 0.5 m/s",
        );
        check(
            "range.smallest_radius_m = 0.05",
            "  posts        from 0.05 m of radius on, heard up to 1.19 m, they are not touched at 0.5 m/s",
        );
        check(
            "range.lobe = \"beam\"",
            "  warning      a beam passes by what is thin: posts of any radius may be driven into",
        );
        check(
            "range.beams_deg = [20, -20]",
            "  warning      the beams leave a gap straight ahead: posts of any radius may be driven into",
        );
        check(
            "range.dowel_radius_m = 1\nrange.dowel_range_m = 0.5",
            "  warning      posts of any radius may be driven into: at 0.5 m/s one must be heard from 0.97 m, and none is",
        );
    }
}
