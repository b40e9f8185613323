//! Laws of configurations: what the venue's hash is about, how files find each other, and that no text
//! at all makes the reader fall over.

use proptest::prelude::*;
use tomoswarm::config::{self, Config, Venue, bundled};
use tomoswarm::time::Time;
use tomoswarm_proto::{Sender, VehicleId};

fn venue(text: &str) -> Venue {
    match config::read("v.toml", text, &mut |path| {
        Err(format!("{path} is not needed"))
    }) {
        Ok(Config::Venue(venue)) => venue,
        other => panic!("not a venue: {other:?}"),
    }
}

fn courtyard() -> String {
    bundled::load("configs/courtyard.venue.toml").unwrap()
}

#[test]
fn the_hash_does_not_depend_on_layout_names_or_spelling() {
    let text = courtyard();
    let other = text
        .replace("name = \"courtyard\"", "name = \"yard\"\n# a remark")
        .replace("20.0", "2e1");
    assert_ne!(text, other);
    assert_eq!(venue(&text).hash(), venue(&other).hash());
    let signed = text.replace("[0.0, 0.0, 20.0, 20.0]", "[-0.0, 0.0, 20.0, 20.0]");
    assert_eq!(venue(&text).hash(), venue(&signed).hash());
}

#[test]
fn the_hash_depends_on_everything_that_nodes_must_share() {
    let text = courtyard();
    let changes = [
        ("latitude_deg = 52.3702", "latitude_deg = 52.3703"),
        ("longitude_deg = 4.8952", "longitude_deg = 4.8953"),
        ("altitude_m = 0.0", "altitude_m = 1.0"),
        ("x_axis_bearing_deg = 90.0", "x_axis_bearing_deg = 91.0"),
        ("[0.0, 0.0, 20.0, 20.0]", "[0.0, 0.0, 20.0, 19.0]"),
        ("[23.0, 23.0]", "[23.0, 24.0]"),
        ("[20.85, 20.85]", "[20.85, 20.95]"),
        ("cell_m = 0.2", "cell_m = 0.25"),
        (
            "altitude_slices_m = [0.0, 2.0]",
            "altitude_slices_m = [0.0, 1.0, 2.0]",
        ),
        ("ceiling_m = 10.0", "ceiling_m = 11.0"),
    ];
    let mut hashes = vec![venue(&text).hash()];
    for (old, new) in changes {
        assert!(text.contains(old), "{old}");
        hashes.push(venue(&text.replace(old, new)).hash());
    }
    hashes.sort();
    hashes.dedup();
    assert_eq!(hashes.len(), changes.len() + 1);
}

#[test]
fn the_hash_is_the_same_on_every_machine() {
    // Computed apart from this program, byte by byte.
    assert_eq!(
        format!("{:016x}", venue(&courtyard()).hash()),
        "e67707240105e76e"
    );
}

#[test]
fn a_named_file_lies_beside_the_file_that_names_it() {
    for (file, named, expected) in [
        ("a.toml", "v.toml", "v.toml"),
        ("configs/a.toml", "../v.toml", "configs/../v.toml"),
        ("/etc/a.toml", "v.toml", "/etc/v.toml"),
        ("configs/a.toml", "/etc/v.toml", "/etc/v.toml"),
    ] {
        assert_eq!(config::beside(file, named), expected);
    }
}

#[test]
fn a_partition_cuts_between_its_sides_while_it_lasts() {
    let text = "kind = \"sim\"
venue = \"courtyard.venue.toml\"
scene = \"../scenes/courtyard.scene.toml\"
vehicles.count = 3
[[bus.partition]]
from_s = 10
until_s = 20.5
sides = [[\"ground\", 1], [2]]
";
    let sim = config::read_sim("configs/a.toml", text, None, &mut |path| {
        bundled::load(path)
    })
    .unwrap();
    let partition = sim.bus.partitions[0].partition();
    let cuts =
        |second: f64, a: Sender, b: Sender| partition.cuts(Time::from_secs_f64(second), a, b);
    let vehicle = |id| Sender::Vehicle(VehicleId(id));
    assert!(cuts(10.0, Sender::Ground, vehicle(2)) && cuts(20.4, vehicle(2), vehicle(1)));
    assert!(!cuts(9.9, Sender::Ground, vehicle(2)) && !cuts(20.5, Sender::Ground, vehicle(2)));
    assert!(!cuts(15.0, Sender::Ground, vehicle(1)));
    assert!(
        cuts(15.0, vehicle(3), vehicle(2)),
        "nodes on no side are a side of their own"
    );
    assert!(!cuts(15.0, vehicle(3), vehicle(3)));
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_fall_over(text in "(\\PC|\n)*") {
        let _ = config::read("a.toml", &text, &mut |path| bundled::load(path));
    }

    /// Damaged files reach much deeper than random text.
    #[test]
    fn a_damaged_file_is_read_or_refused_in_its_own_words(
        file in prop::sample::select(vec![
            "configs/courtyard.sim.toml", "configs/courtyard.venue.toml", "scenes/courtyard.scene.toml",
        ]),
        cut in any::<prop::sample::Index>(),
        length in 0..40_usize,
        insert in "[-0-9a-z=\\[\\]{}\"',.#\n]{0,6}",
    ) {
        let mut text = bundled::load(file).unwrap();
        // Not within a character: a text is one of characters.
        let whole = |at: usize| (0..=at).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
        let from = whole(cut.index(text.len()));
        let until = whole((from + length).min(text.len()));
        text.replace_range(from..until, &insert);
        let lines = text.lines().count().max(1);
        if let Err(problems) = config::read(file, &text, &mut |path| bundled::load(path)) {
            prop_assert!(!problems.list().is_empty());
            for problem in problems.list() {
                prop_assert!(problem.file != file || (1..=lines + 1).contains(&problem.line), "{problem}");
                prop_assert!(!problem.wrong.is_empty());
            }
        }
    }
}
