//! The examples of a swarm with real devices are files that the program takes as they are.

use std::collections::BTreeMap;
use std::fs;

use tomoswarm::config::{self, Config, RadioDriver, RangeDriver, ServoDriver, Venue};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/field");

/// Returns the text of each file, by its name.
fn files() -> BTreeMap<String, String> {
    let all = fs::read_dir(FOLDER).unwrap().map(|entry| {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        (name, fs::read_to_string(entry.path()).unwrap())
    });
    all.collect()
}

fn read(name: &str, text: &str) -> Result<Config, String> {
    let mut loader = |path: &str| fs::read_to_string(path).map_err(|error| error.to_string());
    config::read(&format!("{FOLDER}/{name}"), text, &mut loader).map_err(|error| error.to_string())
}

fn venue() -> Venue {
    match read("yard.venue.toml", &files()["yard.venue.toml"]) {
        Ok(Config::Venue(venue)) => venue,
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_field_example_is_what_its_name_says() {
    let files = files();
    let kinds: Vec<&str> = files
        .iter()
        .map(|(name, text)| match read(name, text) {
            Ok(Config::Venue(_)) => "venue",
            Ok(Config::Vehicle(_)) => "vehicle",
            Ok(Config::Ground(_)) => "ground",
            Ok(Config::Operator(_)) => "operator",
            Ok(Config::Scene(_)) => "scene",
            Ok(Config::Sim(_)) => "sim",
            other => panic!("{name}: {other:?}"),
        })
        .collect();
    assert_eq!(
        kinds,
        ["ground", "operator", "vehicle", "scene", "sim", "venue"]
    );
    for (name, kind) in files.keys().zip(kinds) {
        assert!(name.ends_with(&format!(".{kind}.toml")), "{name}");
    }
}

#[test]
fn the_field_has_a_home_for_each_vehicle_and_successors_that_speak_at_once() {
    let venue = venue();
    assert_eq!(venue.swarm.successor_ms, Some(3.0));
    let text = &files()["laptop.ground.toml"];
    let Ok(Config::Ground(ground)) = read("laptop.ground.toml", text) else {
        panic!("{text}")
    };
    assert_eq!(ground.vehicles.len(), venue.homes.len());
    let text = &files()["yard.sim.toml"];
    let Ok(Config::Sim(sim)) = read("yard.sim.toml", text) else {
        panic!("{text}")
    };
    // Else nobody would hear anybody in the rehearsal: a module's network follows from the venue's hash.
    assert_eq!(sim.venue.hash(), venue.hash());
    assert_eq!(sim.vehicles.count, venue.homes.len());
}

#[test]
fn the_rover_has_real_devices_and_may_have_the_others_that_its_comments_name() {
    let text = &files()["rover.vehicle.toml"];
    let vehicle = |text: &str| match read("rover.vehicle.toml", text) {
        Ok(Config::Vehicle(file)) => *file,
        other => panic!("{other:?}"),
    };
    let drivers = vehicle(text).drivers;
    assert!(matches!(drivers.range, RangeDriver::HcSr04(_)));
    assert!(matches!(drivers.servo, ServoDriver::Real(_)));
    assert!(matches!(drivers.radio, RadioDriver::Xbee(_)));
    let slow = text.replace("baud = 115200", "baud = 57600");
    assert_ne!(&slow, text);
    vehicle(&slow);
    let laser = text.replace("driver = \"hcsr04\"\nmax_range_m = 4.0", LASER);
    let laser = laser.replace("# [range.tf-luna]\n# port", "[range.tf-luna]\nport");
    let drivers = vehicle(&laser).drivers;
    assert!(matches!(drivers.range, RangeDriver::Serial(_)), "{laser}");
}

const LASER: &str =
    "driver = \"tf-luna\"\nmax_range_m = 8.0\nhalf_angle_deg = 1.0\nmin_range_m = 0.2";

#[test]
fn the_package_holds_the_field_examples_and_what_is_set_on_its_machines() {
    let manifest = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")).unwrap();
    let asset = "[\"configs/field/*.toml\", \"usr/share/doc/tomoswarm/examples/field/\", \"644\"]";
    assert!(manifest.contains(asset));
    let asset = "[\"deploy/machine/*\", \"usr/share/doc/tomoswarm/examples/machine/\", \"644\"]";
    assert!(manifest.contains(asset));
}
