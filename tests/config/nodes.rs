//! Files of nodes: what a vehicle, a ground station and an operator are told, and every way to get it wrong.

use std::time::Duration;

use tomoswarm::autopilot::VehicleKind;
use tomoswarm::config::{self, Config, Drivers, GroundFile, Safety, VehicleFile, bundled};
use tomoswarm::geom::Angle;
use tomoswarm::ground::from_config::ground_parts;
use tomoswarm::node::VehicleSettings;
use tomoswarm_proto::{
    AutopilotFamily, BodyKind, Boot, Capability, RadioKind, RangeSensorKind, RunId, ServoKind,
    VehicleId,
};

pub(super) const VEHICLE: &str = "\
kind = \"vehicle\"
venue = \"courtyard.venue.toml\"
id = 3
state_dir = \"state/3\"
autopilot.driver = \"sim\"
range.driver = \"sim\"
servo.driver = \"sim\"
radio.driver = \"sim\"
world.connect = \"127.0.0.1:7500\"
world.token = \"0123456789abcdef\"
";

const GROUND: &str = "\
kind = \"ground\"
venue = \"courtyard.venue.toml\"
vehicles = [3, 1, 2]
state_dir = \"/var/lib/tomoswarm\"
";

fn loaded(path: &str) -> Result<String, String> {
    bundled::load(path)
}

/// Returns a loader of the bundled venue with further lines.
fn in_venue(lines: &str) -> impl FnMut(&str) -> Result<String, String> {
    move |path| bundled::load(path).map(|text| format!("{text}{lines}"))
}

pub(super) fn vehicle(text: &str) -> VehicleFile {
    config::read_vehicle("configs/v.toml", text, &mut loaded)
        .unwrap_or_else(|error| panic!("{error}"))
}

fn ground(text: &str) -> GroundFile {
    config::read_ground("configs/g.toml", text, &mut loaded)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Checks that a vehicle's file that is printed and read again says the same.
pub(super) fn check_written(file: &VehicleFile) {
    let written = config::to_toml(&Config::Vehicle(Box::new(file.clone())));
    let read = config::read_vehicle("v.toml", &written, &mut |_| {
        bundled::load("configs/courtyard.venue.toml")
    });
    let read = read.unwrap();
    let (drivers, look) = (&read.drivers, &read.look);
    assert_eq!((drivers, look), (&file.drivers, &file.look), "{written}");
}

fn problems_of(text: &str) -> String {
    match config::read("configs/x.toml", text, &mut loaded) {
        Ok(config) => format!("accepted: {config:?}"),
        Err(problems) => problems.to_string(),
    }
}

/// Checks that a file of a vehicle with these further lines has exactly one problem, which says all the parts.
fn check_vehicle(lines: &str, parts: &[&str]) {
    check_one(&format!("{VEHICLE}{lines}"), parts);
}

fn check_ground(lines: &str, parts: &[&str]) {
    check_one(&format!("{GROUND}{lines}"), parts);
}

pub(super) fn check_one(text: &str, parts: &[&str]) {
    let output = problems_of(text);
    assert_eq!(output.lines().count(), 1, "{text}\n{output}");
    assert!(!output.starts_with("accepted"), "{text}\n{output}");
    for part in parts {
        assert!(
            output.contains(part),
            "{part} is missing in: {output}\n{text}"
        );
    }
}

pub(super) fn check_replaced(base: &str, old: &str, new: &str, parts: &[&str]) {
    assert!(base.contains(old), "{old}");
    check_one(&base.replace(old, new), parts);
}

#[test]
fn a_vehicles_file_gives_every_value_a_default() {
    let file = vehicle(VEHICLE);
    assert_eq!(
        (file.id, file.state_dir.as_str()),
        (VehicleId(3), "configs/state/3")
    );
    assert_eq!((file.home.x_m, file.home.y_m), (20.85, -0.85));
    assert_eq!(file.world.connect.to_string(), "127.0.0.1:7500");
    assert_eq!(file.record.limit_bytes(), Some(10_000_000_000));
    assert_eq!(file.pose.expected_sd_m, 0.05);
    let safety = Safety {
        padding_m: 0.1,
        battery_return: 0.2,
        battery_hold: 0.05,
        closeness_m: 0.0,
    };
    assert_eq!(file.safety, safety);
    let swarm = file.venue.swarm;
    assert_eq!((swarm.separation_m, swarm.pose_sd_max_m), (1.0, 0.5));
    assert_eq!(swarm.autonomy(), Duration::from_secs(60));
    assert_eq!(
        vehicle(&format!("{VEHICLE}record.limit_mb = 0\n"))
            .record
            .limit_bytes(),
        None
    );
}

#[test]
fn a_vehicle_is_told_the_same_by_its_own_file_as_by_a_simulation() {
    let text = bundled::load(bundled::COURTYARD).unwrap();
    let sim = config::read_sim(bundled::COURTYARD, &text, Some(3), &mut loaded).unwrap();
    let home = sim.home(VehicleId(3)).unwrap();
    let simulated = VehicleSettings::from_config(&sim, VehicleId(3), Boot(7), home);
    let live = VehicleSettings::from_vehicle_file(&vehicle(VEHICLE), Boot(7));
    assert_eq!(
        VehicleSettings {
            path_time: simulated.path_time,
            ..live.clone()
        },
        simulated
    );
    assert!(live.path_time > Duration::ZERO && live.path_time < simulated.path_time);
}

#[test]
fn every_value_of_a_vehicles_file_reaches_the_vehicle() {
    let lines = "vehicle.radius_m = 0.3
vehicle.max_speed_mps = 0.4
vehicle.braking_mps2 = 2
range.beams_deg = [0, 10]
range.half_angle_deg = 30
range.min_range_m = 0.1
range.max_range_m = 5
range.sure_range_m = 4
range.scan_period_s = 0.2
range.settle_s = 0.1
range.farness_m = 4.5
range.sensor = [{ mount_deg = 90, servo_from_deg = -100, servo_to_deg = 10, slew_s_per_60_deg = 0.12 }]
safety.closeness_m = 0.4
radio.power_dbm = -5
safety.padding_m = 0.2
";
    let swarm = "[swarm]
channel = 20
slot_ms = 80
separation_m = 1.5
pose_sd_max_m = 0.4
";
    let file = config::read_vehicle(
        "configs/v.toml",
        &format!("{VEHICLE}{lines}"),
        &mut in_venue(swarm),
    );
    let told = VehicleSettings::from_vehicle_file(&file.unwrap(), Boot(1));
    assert_eq!(
        (
            told.body.radius_m,
            told.body.speed_mps,
            told.body.braking_mps2
        ),
        (0.3, 0.4, 2.0)
    );
    assert_eq!(told.look.beams.len(), 2);
    assert!((told.look.half_angle.degrees() - 30.0).abs() < 1e-9);
    // What is farther than farness_m is ignored, whatever the sensor hears.
    assert_eq!(
        (
            told.look.min_range_m,
            told.look.max_range_m,
            told.look.sure_range_m
        ),
        (0.1, 4.5, 4.0)
    );
    let [mount] = told.look.mounts.all() else {
        panic!("{:?}", told.look.mounts)
    };
    assert!((mount.zero.degrees() - 90.0).abs() < 1e-9);
    assert!(
        (mount.from_rad.to_degrees() + 100.0).abs() < 1e-9
            && (mount.to_rad.to_degrees() - 10.0).abs() < 1e-9
    );
    // From 0° to 10° and back, at 0.12 s for 60°: 0.04 s beside two periods of 0.2 s.
    assert!(
        (told.look.cycle().as_secs_f64() - 0.44).abs() < 1e-6,
        "{:?}",
        told.look.cycle()
    );
    assert_eq!(told.safety.closeness_m, 0.4);
    assert_eq!(
        (told.look.period, told.look.settle),
        (Duration::from_millis(200), Duration::from_millis(100))
    );
    assert_eq!((told.radio.channel, told.radio.power_dbm), (20, -5));
    assert_eq!(told.radio.slot, Duration::from_millis(80));
    let safety = told.safety;
    assert_eq!(
        (
            safety.padding_m,
            told.swarm.separation_m,
            told.swarm.pose_sd_max_m
        ),
        (0.2, 1.5, 0.4)
    );
}

#[test]
fn a_grounds_file_gives_every_value_a_default() {
    let file = ground(GROUND);
    assert_eq!(file.vehicles, [VehicleId(1), VehicleId(2), VehicleId(3)]);
    assert_eq!(
        (
            file.compare_with,
            file.take_over,
            file.operators_note.as_str()
        ),
        (None, false, "")
    );
    let swarm = file.venue.swarm;
    assert_eq!(
        (swarm.lost_after(), swarm.separation_m),
        (Duration::from_secs(30), 1.0)
    );
    assert_eq!(file.reception.sensitivity_dbm, -100.0);
    let further = "compare_with = 4
take_over = true
operators_note = \"wet walls\"
radio.sensitivity_dbm = -92
";
    let swarm = "[swarm]\nlost_after_s = 12.5\nseparation_m = 1.2\n";
    let file = config::read_ground(
        "configs/g.toml",
        &format!("{GROUND}{further}"),
        &mut in_venue(swarm),
    )
    .unwrap();
    assert_eq!((file.compare_with, file.take_over), (Some(RunId(4)), true));
    let swarm = file.venue.swarm;
    assert_eq!(
        (swarm.lost_after(), swarm.separation_m),
        (Duration::from_millis(12_500), 1.2)
    );
    assert_eq!(
        (file.reception.sensitivity_dbm, file.operators_note.as_str()),
        (-92.0, "wet walls")
    );
}

#[test]
fn a_ground_station_is_made_of_its_file() {
    let parts = ground_parts(&ground(GROUND), Boot(4), 9, 77).unwrap();
    assert_eq!(
        (
            parts.station.lease,
            parts.station.holder,
            parts.station.store
        ),
        (None, 9, 77)
    );
    assert_eq!(
        parts.station.vehicles,
        [VehicleId(1), VehicleId(2), VehicleId(3)]
    );
    assert_eq!(parts.station.bin_m, 0.5);
}

#[test]
fn what_a_vehicle_cannot_do_without_is_asked_for() {
    let output = problems_of("kind = \"vehicle\"\n");
    for part in [
        "venue: is missing",
        "id: is missing",
        "state_dir: is missing",
    ] {
        assert!(output.contains(part), "{part} is missing in:\n{output}");
    }
    for driver in ["autopilot", "range", "servo", "radio"] {
        assert!(
            output.contains(&format!("{driver}.driver: is missing; driver = \"sim\"")),
            "{driver}:\n{output}"
        );
    }
    check_replaced(VEHICLE, "id = 3\n", "", &["id: is missing", "1 to 250"]);
    check_replaced(
        VEHICLE,
        "state_dir = \"state/3\"\n",
        "",
        &["state_dir: is missing", "folder"],
    );
    check_replaced(
        VEHICLE,
        "world.token = \"0123456789abcdef\"\n",
        "",
        &["world.token: is missing"],
    );
    check_replaced(
        VEHICLE,
        "world.connect = \"127.0.0.1:7500\"\n",
        "",
        &["world.connect: is missing"],
    );
    let no_world = VEHICLE.split("world.").next().unwrap();
    check_one(
        no_world,
        &["world: is missing", "drivers of the kind \"sim\""],
    );
}

#[test]
fn every_wrong_value_of_a_vehicle_is_refused() {
    for id in ["0", "251", "-1", "1.5", "\"one\""] {
        check_replaced(
            VEHICLE,
            "id = 3",
            &format!("id = {id}"),
            &["configs/x.toml:3: id = ", "1 to 250"],
        );
    }
    check_replaced(
        VEHICLE,
        "id = 3",
        "id = 9",
        &["id = 9: has no home: the venue has 8"],
    );
    check_replaced(VEHICLE, "\"state/3\"", "3", &["state_dir = 3: is no text"]);
    check_replaced(
        VEHICLE,
        "courtyard.venue",
        "gone.venue",
        &["venue = ", "cannot be read"],
    );
    check_vehicle("vehicle.count = 2", &["vehicle.count: is not known"]);
    check_vehicle(
        "vehicle.pose_sd_m = 0.1",
        &["vehicle.pose_sd_m: is not known"],
    );
    for key in [
        "radius_m",
        "height_m",
        "antenna_height_m",
        "max_speed_mps",
        "acceleration_mps2",
        "braking_mps2",
        "turn_rate_deg_per_s",
    ] {
        check_vehicle(
            &format!("vehicle.{key} = -1"),
            &[&format!("vehicle.{key} = -1: is out of range")],
        );
    }
    for key in ["padding_m", "battery_return", "battery_hold", "closeness_m"] {
        check_vehicle(
            &format!("safety.{key} = -1"),
            &[&format!("safety.{key} = -1: is out of range")],
        );
    }
    for key in [
        "half_angle_deg",
        "min_range_m",
        "max_range_m",
        "sure_range_m",
        "scan_period_s",
        "settle_s",
    ] {
        check_vehicle(
            &format!("range.{key} = -1"),
            &[&format!("range.{key} = -1: is out of range")],
        );
    }
    check_vehicle(
        "range.beams_deg = []",
        &["range.beams_deg = []: is no such list"],
    );
    check_vehicle("range.noise_sd_m = 0", &["range.noise_sd_m: is not known"]);
    for (line, part) in [
        (
            "radio.power_dbm = 0.5",
            "radio.power_dbm = 0.5: is no whole number",
        ),
        ("radio.p0_dbm = -40", "radio.p0_dbm: is not known"),
        ("pose.source = \"gps\"", "pose.source = \"gps\""),
        (
            "pose.source = \"external\"",
            "is of no use to a simulated autopilot, which knows its place; source = \"autopilot\" is allowed",
        ),
        (
            "pose.expected_sd_m = -1",
            "pose.expected_sd_m = -1: is out of range",
        ),
        (
            "pose.expected_sd_m = 0.6",
            "is above the pose_sd_max_m of the venue",
        ),
        (
            "record.limit_mb = -1",
            "record.limit_mb = -1: is no such number",
        ),
        ("record.limit_gb = 1", "record.limit_gb: is not known"),
        ("world.port = 1", "world.port: is not known"),
        (
            "vehicles.count = 2",
            "vehicles: is not known; did you mean vehicle?",
        ),
    ] {
        check_vehicle(line, &[part]);
    }
}

#[test]
fn a_speed_beyond_what_is_seen_is_refused() {
    check_vehicle(
        "vehicle.max_speed_mps = 5",
        &["vehicle.max_speed_mps = 5: the vehicle cannot look"],
    );
    check_vehicle(
        "pose.expected_sd_m = 0.45\nrange.sure_range_m = 1.2",
        &["range.sure_range_m = 1.2: "],
    );
    check_vehicle(
        "vehicle.radius_m = 0.6",
        &["vehicle.radius_m = 0.6: lets two vehicles touch: the separation_m of the venue is 1 m"],
    );
    let text = format!("{VEHICLE}vehicle.radius_m = 2\nsafety.padding_m = 0.2");
    let problems = config::read_vehicle(
        "configs/x.toml",
        &text,
        &mut in_venue("[swarm]\nseparation_m = 5\n"),
    )
    .unwrap_err();
    assert!(
        problems
            .to_string()
            .contains("home 3 is nearer than 2.20 m to the fence"),
        "{problems}"
    );
}

#[test]
fn drivers_that_are_not_built_in_are_refused_by_name() {
    let has_hw = cfg!(feature = "hw");
    let (ranges, servos) = match has_hw {
        true => (
            "\"sim\" or \"serial-text\" or \"tf-luna\" or \"tfmini\" or \"hcsr04\" or \"autopilot\" or \"none\"",
            "\"sim\" or \"pwm\" or \"gpio\" or \"autopilot\" or \"none\"",
        ),
        false if cfg!(feature = "net") => (
            "\"sim\" or \"autopilot\" or \"none\"",
            "\"sim\" or \"autopilot\" or \"none\"",
        ),
        false => ("\"sim\" or \"none\"", "\"sim\" or \"none\""),
    };
    let has_mavlink = cfg!(feature = "mavlink");
    let autopilots = if has_mavlink {
        "\"sim\" or \"mavlink\""
    } else {
        "\"sim\""
    };
    let radios = if has_hw {
        "\"sim\" or \"xbee\""
    } else {
        "\"sim\""
    };
    for (section, driver, built) in [
        ("autopilot", "mavlink", autopilots),
        ("servo", "pwm", servos),
        ("servo", "gpio", servos),
        ("range", "serial-text", ranges),
        ("range", "tf-luna", ranges),
        ("range", "tfmini", ranges),
        ("range", "hcsr04", ranges),
        ("radio", "xbee", radios),
    ] {
        let (old, new) = (
            format!("{section}.driver = \"sim\""),
            format!("{section}.driver = \"{driver}\""),
        );
        let output = format!(
            "{section}.driver = \"{driver}\": is not built into this program, only into the whole one; driver = {built} is allowed"
        );
        let is_built = match section {
            "autopilot" => has_mavlink,
            _ => has_hw,
        };
        if !is_built {
            check_replaced(VEHICLE, &old, &new, &[&output]);
        }
        let output = format!("\"usb\": is not known; driver = {built} is allowed");
        check_replaced(
            VEHICLE,
            &old,
            &format!("{section}.driver = \"usb\""),
            &[&output],
        );
    }
    // Each device has its own.
    check_replaced(
        VEHICLE,
        "radio.driver = \"sim\"",
        "radio.driver = \"gpio\"",
        &["is not known"],
    );
    check_replaced(
        VEHICLE,
        "radio.driver = \"sim\"",
        "radio.driver = \"none\"",
        &["is not known"],
    );
}

#[test]
fn a_vehicle_says_what_its_drivers_have() {
    let text = VEHICLE.replace("range.driver = \"sim\"", "range.driver = \"none\"");
    let text = text.replace("servo.driver = \"sim\"", "servo.driver = \"none\"");
    let blind = vehicle(&text);
    assert!(
        VehicleSettings::from_vehicle_file(&blind, Boot(1))
            .look
            .is_blind
    );
    assert!(
        !VehicleSettings::from_vehicle_file(&vehicle(VEHICLE), Boot(1))
            .look
            .is_blind
    );
    let autopilot = Capability::Autopilot(AutopilotFamily::Simulated, BodyKind::Rover);
    let radio = Capability::Radio(RadioKind::Simulated);
    assert_eq!(
        blind.drivers.capabilities(config::Craft::Rover),
        [autopilot, radio]
    );
    let (range, servo) = (
        Capability::RangeSensor(RangeSensorKind::Simulated),
        Capability::Servo(ServoKind::Simulated),
    );
    assert_eq!(
        Drivers::SIMULATED.capabilities(config::Craft::Rover),
        [autopilot, range, servo, radio]
    );
}

#[test]
fn without_a_servo_the_sensors_are_fixed_and_look_ahead() {
    let text = VEHICLE.replace("servo.driver = \"sim\"", "servo.driver = \"none\"");
    let text = format!("{text}vehicle.max_speed_mps = 0.2\n");
    let ahead = vehicle(&text).look;
    assert_eq!(
        (ahead.beams_deg.as_slice(), ahead.sensors.len()),
        ([0.0].as_slice(), 1)
    );
    assert_eq!(ahead.mounts().aim(Angle::from_degrees(1.0)), None);
    check_written(&vehicle(&text));
    let two = "range.beams_deg = [30, -30]\n[[range.sensor]]\nmount_deg = 30\n[[range.sensor]]\nmount_deg = -30\n";
    let fan = vehicle(&format!("{text}{two}")).look;
    assert_eq!(
        (fan.beams_deg.as_slice(), fan.sensors.len()),
        ([30.0, -30.0].as_slice(), 2)
    );
    check_one(
        &format!("{text}range.beams_deg = [0, 25]\n"),
        &["range.beams_deg", "25° is reached by no servo"],
    );
    check_one(
        &format!("{text}[[range.sensor]]\nservo_to_deg = 30\n"),
        &[
            "range.sensor[0].servo_to_deg",
            "needs a servo, and the servo's driver is \"none\"",
        ],
    );
}

#[test]
fn what_the_drivers_that_are_not_chosen_would_be_told_is_checked_and_left_alone() {
    let unused = format!("{VEHICLE}range.serial-text.port = \"/dev/ttyUSB0\"\n");
    assert_eq!(vehicle(&unused).drivers, Drivers::SIMULATED);
    check_one(
        &format!("{unused}range.serial-text.baud = 1\n"),
        &["range.serial-text.baud = 1: is out of range"],
    );
    check_one(
        &format!("{VEHICLE}range.serial-text.baud = 9600\n"),
        &["range.serial-text.port: is missing"],
    );
}

#[test]
fn the_simulated_world_is_on_this_machine_and_asks_for_a_word() {
    for (address, wrong) in [
        ("10.0.0.1:7500", "leaves this machine"),
        ("0.0.0.0:7500", "leaves this machine"),
        ("localhost:7500", "is no address with a port"),
        ("127.0.0.1", "is no address with a port"),
        ("127.0.0.1:0", "has port 0"),
    ] {
        check_replaced(
            VEHICLE,
            "127.0.0.1:7500",
            address,
            &["world.connect", wrong, "127.0.0.1:7500"],
        );
    }
    for token in ["short", "with space", &"x".repeat(129), "a/b/c/d/e/f"] {
        check_replaced(
            VEHICLE,
            "0123456789abcdef",
            token,
            &["world.token", "8 to 128"],
        );
    }
}

#[test]
fn what_others_may_read_of_a_vehicles_file_lets_no_driver_into_its_world() {
    let file = vehicle(VEHICLE);
    let shown = config::to_toml(&Config::Vehicle(Box::new(file.without_secrets())));
    assert!(
        !shown.contains(&file.world.token) && file.world.token.len() > 8,
        "{shown}"
    );
    assert!(
        shown.contains("token = \"hidden\"") && shown.contains("id = "),
        "{shown}"
    );
    // Should somebody use it as a file, it is none.
    let refused = problems_of(&VEHICLE.replace(&file.world.token, "hidden"));
    assert!(
        refused.contains("world.token") && !refused.contains("accepted"),
        "{refused}"
    );
}

#[test]
fn every_wrong_value_of_a_ground_station_is_refused() {
    for list in [
        "[0]",
        "[251]",
        "[1, 1]",
        "[1, \"2\"]",
        "3",
        "[1.5]",
        "[[1]]",
    ] {
        let output = format!("vehicles = {list}: is no such list");
        check_replaced(GROUND, "[3, 1, 2]", list, &[&output, "1 to 250"]);
    }
    check_replaced(
        GROUND,
        "[3, 1, 2]",
        "[1, 9]",
        &["has vehicle 9, but the venue has 8 homes"],
    );
    check_replaced(
        GROUND,
        "vehicles = [3, 1, 2]\n",
        "",
        &["vehicles: is missing"],
    );
    check_replaced(
        GROUND,
        "state_dir = \"/var/lib/tomoswarm\"\n",
        "",
        &["state_dir: is missing"],
    );
    for (line, part) in [
        (
            "sweep.positions = 4",
            "sweep.positions = 4: is out of range",
        ),
        ("sweep.positions = 500", "puts 4 steps into 0.64 m"),
        (
            "imaging.pixels = [1, 1]",
            "imaging.pixels = [1, 1]: is no such pair",
        ),
        ("safety.padding_m = 0.1", "safety.padding_m: is not known"),
        (
            "radio.sensitivity_dbm = 0",
            "radio.sensitivity_dbm = 0: is out of range",
        ),
        ("radio.channel = 15", "radio.channel: is not known"),
        ("compare_with = 0", "compare_with = 0: is out of range"),
        ("compare_with = 4294967295", "is out of range"),
        (
            "bus.lease_s = 30",
            "bus.lease_s = 30: is a silence that any link may have, but a vehicle is lost after 30 s",
        ),
        ("take_over = 1", "take_over = 1: is no yes or no"),
        ("operators_note = 7", "operators_note = 7: is no text"),
        (
            "record.limit_mb = 2000000",
            "record.limit_mb = 2000000: is out of range",
        ),
        ("seed = 1", "seed: is not known"),
    ] {
        check_ground(line, &[part]);
    }
    check_replaced(
        GROUND,
        "[3, 1, 2]",
        "[1, 2, 3, 4, 5, 6, 7, 8]\nsweep.positions = 31",
        &["is too few for 8 vehicles"],
    );
}

const OPERATOR: &str = "\
kind = \"operator\"
venue = \"courtyard.venue.toml\"
bus.connect = [\"tcp/127.0.0.1:7447\"]
";

#[test]
fn an_operator_has_a_number_and_is_the_first_unless_it_says_another() {
    let number = |line: &str| {
        let text = OPERATOR.replace("bus.connect", &format!("{line}bus.connect"));
        config::read_operator("configs/o.toml", &text, &mut loaded)
            .unwrap()
            .id
            .0
    };
    assert_eq!((number(""), number("id = 255\n")), (1, 255));
    for (id, part) in [
        ("0", "is out of range"),
        ("256", "is out of range"),
        ("1.5", "id = 1.5"),
    ] {
        let text = OPERATOR.replace("bus.connect", &format!("id = {id}\nbus.connect"));
        check_one(&text, &[&format!("id = {id}"), part]);
    }
}

#[test]
fn an_operator_is_told_where_the_swarm_is_shown() {
    let mavlink = |lines: &str| {
        let text = format!("{OPERATOR}[mavlink]\n{lines}");
        let file = config::read_operator("configs/o.toml", &text, &mut loaded).unwrap();
        file.mavlink.unwrap()
    };
    let shown = mavlink("address = \"127.0.0.1:14550\"");
    assert_eq!(shown.address, "127.0.0.1:14550".parse().ok());
    assert_eq!(
        (shown.listen, shown.commands, shown.key_file),
        (None, false, None)
    );
    let shown = mavlink("listen = \"0.0.0.0:14550\"\ncommands = true\nkey = \"k.hex\"");
    assert_eq!(shown.key_file.as_deref(), Some("configs/k.hex"));
    assert!(shown.commands && shown.listen.is_some());
    let file = config::read_operator("configs/o.toml", OPERATOR, &mut loaded).unwrap();
    assert_eq!(file.mavlink, None);
}

#[test]
fn where_the_swarm_is_shown_is_said_once_and_as_an_address() {
    let both = "either address (where a ground station listens) or listen";
    for (lines, parts) in [
        ("commands = true", ["mavlink.address: is missing", both]),
        (
            "address = \"127.0.0.1:1\"\nlisten = \"127.0.0.1:2\"",
            [
                "mavlink.listen = \"127.0.0.1:2\": is given beside address",
                both,
            ],
        ),
        (
            "address = \"localhost:1\"",
            [
                "mavlink.address = \"localhost:1\"",
                "is no address with a port",
            ],
        ),
        ("listen = \"127.0.0.1:0\"", ["mavlink.listen", "has port 0"]),
        (
            "address = \"127.0.0.1:1\"\ncommands = 1",
            ["mavlink.commands = 1", "is no yes or no"],
        ),
        (
            "address = \"127.0.0.1:1\"\nport = 1",
            ["mavlink.port", "is not known"],
        ),
    ] {
        check_one(&format!("{OPERATOR}[mavlink]\n{lines}\n"), &parts);
    }
}

#[test]
fn a_file_of_another_kind_is_refused() {
    for (read, kind) in [
        (
            config::read_vehicle("x.toml", GROUND, &mut loaded).err(),
            "vehicle",
        ),
        (
            config::read_ground("x.toml", VEHICLE, &mut loaded).err(),
            "ground",
        ),
        (
            config::read_operator("x.toml", GROUND, &mut loaded).err(),
            "operator",
        ),
    ] {
        let output = read.unwrap().to_string();
        assert!(
            output.contains(&format!("is of another kind; kind = \"{kind}\"")),
            "{output}"
        );
    }
}

#[test]
fn the_examples_are_read_as_what_they_say() {
    let root = env!("CARGO_MANIFEST_DIR");
    for kind in ["vehicle", "ground", "operator"] {
        let path = format!("{root}/configs/courtyard.{kind}.toml");
        let text = std::fs::read_to_string(&path).unwrap();
        let mut loader =
            |path: &str| std::fs::read_to_string(path).map_err(|error| error.to_string());
        let config = config::read(&path, &text, &mut loader).unwrap();
        let found = match config {
            Config::Vehicle(_) => "vehicle",
            Config::Ground(_) => "ground",
            Config::Operator(_) => "operator",
            Config::Venue(_) | Config::Scene(_) | Config::Sim(_) | Config::Experiment(_) => {
                "another"
            }
        };
        assert_eq!(found, kind);
    }
}

#[test]
fn what_the_swarm_agrees_on_is_refused_in_a_nodes_file_with_its_new_place() {
    for (key, value) in [
        ("safety.separation_m", "1.0"),
        ("safety.separation_up_m", "2.0"),
        ("safety.autonomy_s", "60"),
        ("safety.pose_sd_max_m", "0.5"),
        ("radio.slot_ms", "50"),
        ("radio.successor_ms", "3"),
        ("radio.channel", "15"),
    ] {
        let name = key.split('.').next_back().unwrap();
        let output = format!("{key} = {value}: {name} belongs into the venue file, table [swarm]");
        check_vehicle(&format!("{key} = {value}"), &[&output]);
        if key.starts_with("safety") {
            check_ground(&format!("{key} = {value}"), &[&output]);
        }
    }
    check_ground(
        "lost_after_s = 30",
        &["lost_after_s = 30: lost_after_s belongs into the venue file, table [swarm]"],
    );
}

#[test]
fn the_ground_reckons_with_the_autonomy_of_the_venue() {
    let day = config::read_ground(
        "configs/g.toml",
        GROUND,
        &mut in_venue("[swarm]\nautonomy_s = 86400\n"),
    )
    .unwrap();
    let parts = ground_parts(&day, Boot(1), 9, 77).unwrap();
    assert_eq!(parts.station.autonomy, Duration::from_secs(86_400));
    let parts = ground_parts(&ground(GROUND), Boot(1), 9, 77).unwrap();
    assert_eq!(parts.station.autonomy, Duration::from_secs(60));
}

#[test]
fn a_vehicle_may_be_a_copter_whose_margins_hold_the_wind() {
    let rover = vehicle(VEHICLE);
    assert_eq!(rover.flight.craft, config::Craft::Rover);
    let copter = |lines: &str| format!("{VEHICLE}[vehicle]\nkind = \"copter\"\n{lines}");
    let settings = |text: &str| VehicleSettings::from_vehicle_file(&vehicle(text), Boot(1));
    let (still, windy) = (
        settings(&copter("altitude_m = 3.0\n")),
        settings(&copter("wind_mps = 2.0\n")),
    );
    assert_eq!(
        (
            still.autopilot.kind,
            still.autopilot.altitude_m,
            still.carried_m
        ),
        (VehicleKind::Copter, 3.0, 0.0)
    );
    assert!((windy.carried_m - 0.1).abs() < 1e-9, "{}", windy.carried_m);
    for (lines, expected) in [
        (
            "altitude_m = 9.9",
            "vehicle.altitude_m = 9.9: with the height of a vehicle is above the ceiling",
        ),
        ("wind_mps = 6.0", "vehicle.wind_mps = 6.0: is out of range"),
    ] {
        let output = problems_of(&copter(&format!("{lines}\n")));
        assert!(output.contains(expected), "{lines}: {output}");
    }
    // What a speed leaves as its last centimetres is the wind's.
    let is_allowed = |tenths: u32, wind_mps: u32| {
        let speed_mps = f64::from(tenths) / 10.0;
        let lines = format!("max_speed_mps = {speed_mps}\nwind_mps = {wind_mps}.0\n");
        problems_of(&copter(&lines)).starts_with("accepted")
    };
    let fastest = (5..40).rev().find(|tenths| is_allowed(*tenths, 0)).unwrap();
    assert!(!is_allowed(fastest, 5), "{fastest}");
}
