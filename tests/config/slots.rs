//! How soon vehicles speak after each other: slots, what a direct successor waits instead, and what a radio needs of both.

use std::time::Duration;

use tomoswarm::config::{self, Config, Venue, bundled};
use tomoswarm::node::VehicleSettings;
use tomoswarm_proto::{Boot, VehicleId};

const VENUE: &str = "configs/courtyard.venue.toml";
const SIM: &str = "kind = \"sim\"
venue = \"courtyard.venue.toml\"
scene = \"../scenes/courtyard.scene.toml\"
[radio]
";

fn in_venue(lines: &str) -> impl FnMut(&str) -> Result<String, String> {
    move |path| match bundled::load(path) {
        Ok(text) if path == VENUE => Ok(format!("{text}[swarm]\n{lines}")),
        text => text,
    }
}

fn venue(lines: &str) -> Venue {
    let text = in_venue(lines)(VENUE).unwrap();
    match config::read(VENUE, &text, &mut |path| Err(path.to_owned())) {
        Ok(Config::Venue(venue)) => venue,
        other => panic!("{other:?}"),
    }
}

fn problems_of(file: &str, text: &str, lines: &str) -> String {
    match config::read(file, text, &mut in_venue(lines)) {
        Ok(config) => format!("accepted: {config:?}"),
        Err(problems) => problems.to_string(),
    }
}

#[test]
fn the_hash_is_about_what_a_successor_waits_unless_that_is_a_slot() {
    assert_eq!(venue("").hash(), venue("successor_ms = 50\n").hash());
    let said = ["", "successor_ms = 3\n", "successor_ms = 4\n"];
    let mut hashes = said.map(|lines| venue(lines).hash()).to_vec();
    hashes.extend(said.map(|lines| venue(&format!("slot_ms = 40\n{lines}")).hash()));
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), 6);
}

#[test]
fn a_simulation_may_say_what_a_successor_waits_and_has_its_venues_value_else() {
    for (lines, own, slot_ms, successor_ms) in [
        ("", "", 50, None),
        ("successor_ms = 3\n", "", 50, Some(3)),
        ("successor_ms = 3\n", "successor_ms = 7\n", 50, Some(7)),
        ("", "slot_ms = 20\n", 20, None),
    ] {
        let text = format!("{SIM}{own}");
        let sim = config::read_sim("configs/a.toml", &text, None, &mut in_venue(lines)).unwrap();
        let home = sim.home(VehicleId(1)).unwrap();
        let radio = VehicleSettings::from_config(&sim, VehicleId(1), Boot(1), home).radio;
        assert_eq!(radio.slot, Duration::from_millis(slot_ms));
        assert_eq!(radio.successor, successor_ms.map(Duration::from_millis));
    }
}

#[test]
fn a_successor_that_waits_longer_than_a_slot_is_refused_where_that_is_said() {
    let text = bundled::load(VENUE).unwrap() + "[swarm]\nsuccessor_ms = 60\n";
    let said = problems_of(VENUE, &text, "");
    let wrong = "swarm.successor_ms = 60: a successor waits 60 ms, longer than a slot of 50 ms; successor_ms may be at most slot_ms";
    assert!(said.ends_with(wrong), "{said}");
    for (own, key) in [
        (
            "successor_ms = 60\n",
            "configs/a.toml:5: radio.successor_ms = 60: ",
        ),
        ("slot_ms = 2\n", "configs/a.toml:5: radio.slot_ms = 2: "),
    ] {
        let said = problems_of(
            "configs/a.toml",
            &format!("{SIM}{own}"),
            "successor_ms = 3\n",
        );
        assert!(said.starts_with(key), "{said}");
    }
}

#[cfg(feature = "hw")]
#[test]
fn a_slot_in_which_a_beacon_of_an_xbee_is_not_heard_is_refused() {
    let vehicle = |baud: &str| {
        format!(
            "kind = \"vehicle\"
venue = \"courtyard.venue.toml\"
id = 3
state_dir = \"state/3\"
autopilot.driver = \"sim\"
range.driver = \"sim\"
servo.driver = \"sim\"
radio.driver = \"xbee\"
radio.xbee.port = \"/dev/ttyUSB0\"
{baud}world.connect = \"127.0.0.1:7500\"
world.token = \"0123456789abcdef\"
"
        )
    };
    // 1.15 times two lines of 109 bytes, of 11 and of 10 bits each, and 12.576 ms on the air, and 2 ms more.
    for (baud, needed_ms) in [(57_600, 62.2), (115_200, 39.3), (230_400, 27.9)] {
        let text = vehicle(&format!("radio.xbee.baud = {baud}\n"));
        for (slot_ms, is_right) in [(needed_ms - 0.2, false), (needed_ms + 0.2, true)] {
            let said = problems_of("configs/v.toml", &text, &format!("slot_ms = {slot_ms}\n"));
            assert_eq!(said.starts_with("accepted"), is_right, "{baud}: {said}");
        }
    }
    let slow = vehicle("radio.xbee.baud = 57600\n");
    let wrong = "configs/v.toml:10: radio.xbee.baud = 57600: a slot of 50 ms is too short: at this baud rate beacons are heard \
                 up to 52.3 ms after they are sent; slot_ms of at least 63 is needed in configs/courtyard.venue.toml, table \
                 [swarm], or a higher baud rate";
    assert_eq!(problems_of("configs/v.toml", &slow, ""), wrong);
    let said = problems_of("configs/v.toml", &vehicle(""), "slot_ms = 38\n");
    assert!(said.contains("radio.xbee.baud = 115200"), "{said}");
    let power = vehicle("radio.power_dbm = 7\n");
    let said = problems_of("configs/v.toml", &power, "");
    assert!(
        said.contains("radio.power_dbm = 7: is none that an XBee has; allowed: -10, "),
        "{said}"
    );
    let power = vehicle("radio.power_dbm = 8\n");
    assert!(problems_of("configs/v.toml", &power, "").starts_with("accepted"));
    let unknown = vehicle("radio.xbee.baud = 12345\n");
    let said = problems_of("configs/v.toml", &unknown, "");
    let wrong = "configs/v.toml:10: radio.xbee.baud = 12345: is none that a module has";
    assert!(said.starts_with(wrong), "{said}");
}
