//! Files of nodes: what a vehicle, a ground station and an operator are told, and every way to get it wrong.

use std::time::Duration;

use tomoswarm::autopilot::VehicleKind;
use tomoswarm::config::{self, Config, Drivers, GroundFile, Safety, VehicleFile, bundled};
#[cfg(feature = "hw")]
use tomoswarm::config::{
    HcSr04Lines, LengthUnit, RangeDriver, SerialProtocol, SerialSensor, SerialText, ServoDriver,
    ServoOutput, TextFormat, TfSensor,
};
use tomoswarm::geom::Angle;
use tomoswarm::ground::from_config::ground_parts;
use tomoswarm::node::VehicleSettings;
use tomoswarm_proto::{
    AutopilotFamily, BodyKind, Boot, Capability, RadioKind, RangeSensorKind, RunId, ServoKind,
    VehicleId,
};

const VEHICLE: &str = "\
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

fn vehicle(text: &str) -> VehicleFile {
    config::read_vehicle("configs/v.toml", text, &mut loaded)
        .unwrap_or_else(|error| panic!("{error}"))
}

fn ground(text: &str) -> GroundFile {
    config::read_ground("configs/g.toml", text, &mut loaded)
        .unwrap_or_else(|error| panic!("{error}"))
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

fn check_one(text: &str, parts: &[&str]) {
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

fn check_replaced(base: &str, old: &str, new: &str, parts: &[&str]) {
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
    assert_eq!(file.record.limit_bytes(), Some(256_000_000));
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
            "{section}.driver = \"{driver}\": is not built in; driver = {built} is allowed"
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
    let written = config::to_toml(&Config::Vehicle(Box::new(vehicle(&text))));
    let read = config::read_vehicle("v.toml", &written, &mut |_| {
        bundled::load("configs/courtyard.venue.toml")
    });
    assert_eq!(read.unwrap().look, ahead, "{written}");
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

/// A vehicle with a range sensor on a serial line.
#[cfg(feature = "hw")]
fn serial(lines: &str) -> String {
    let text = VEHICLE.replace("range.driver = \"sim\"", "range.driver = \"serial-text\"");
    let text = text.replace("servo.driver = \"sim\"", "servo.driver = \"none\"");
    format!("{text}vehicle.max_speed_mps = 0.2\nrange.serial-text.port = \"/dev/ttyUSB0\"\n{lines}")
}

#[cfg(feature = "hw")]
#[test]
fn a_range_sensor_on_a_serial_line_is_told_its_port_and_its_lines() {
    let file = vehicle(&serial(""));
    let text = SerialText::default();
    let port = "/dev/ttyUSB0".to_owned();
    let sensor = SerialSensor {
        port,
        baud: 9600,
        protocol: SerialProtocol::Text(text),
    };
    assert_eq!(
        file.drivers,
        Drivers {
            range: RangeDriver::Serial(sensor),
            own_range: Vec::new(),
            servo: ServoDriver::None,
            ..Drivers::SIMULATED
        }
    );
    assert_eq!(text.nothing_from_m(&file.look), Some(4.0));
    let kinds = file.drivers.capabilities(config::Craft::Rover);
    assert!(
        kinds.contains(&Capability::RangeSensor(RangeSensorKind::SerialText)),
        "{kinds:?}"
    );
    assert!(
        !kinds
            .iter()
            .any(|kind| matches!(kind, Capability::Servo(_))),
        "{kinds:?}"
    );
    let further = "range.serial-text.baud = 57600\nrange.serial-text.format = \"number\"\n\
        range.serial-text.unit = \"cm\"\nrange.serial-text.nothing_from = 1200\nrange.serial-text.delay_s = 0.05\n";
    let file = vehicle(&serial(further));
    let RangeDriver::Serial(SerialSensor {
        baud: 57_600,
        protocol: SerialProtocol::Text(text),
        ..
    }) = file.drivers.range
    else {
        panic!("{:?}", file.drivers)
    };
    assert_eq!(
        (text.format, text.unit, text.delay_s),
        (TextFormat::Number, LengthUnit::Centimetres, 0.05)
    );
    assert_eq!(text.nothing_from_m(&file.look), Some(12.0));
    // What is printed means the same.
    let file = vehicle(&serial(further));
    let written = config::to_toml(&Config::Vehicle(Box::new(file.clone())));
    let read = config::read_vehicle("v.toml", &written, &mut |_| {
        bundled::load("configs/courtyard.venue.toml")
    });
    assert_eq!(read.unwrap().drivers, file.drivers, "{written}");
}

#[cfg(feature = "hw")]
#[test]
fn every_wrong_value_of_a_range_sensor_on_a_serial_line_is_refused() {
    let table = "range.serial-text";
    for (lines, parts) in [
        (
            "baud = 299",
            ["baud = 299: is out of range", "300 to 4000000"],
        ),
        ("baud = 5000000", ["baud = 5000000: is out of range", ""]),
        (
            "format = \"nmea\"",
            [
                "format = \"nmea\": is no choice",
                "\"maxbotix\" or \"number\"",
            ],
        ),
        ("unit = \"ft\"", ["unit = \"ft\": is no choice", "\"in\""]),
        (
            "unit = \"cm\"",
            [
                "unit = \"cm\": is not what a line such as R1234 counts",
                "\"mm\"",
            ],
        ),
        (
            "nothing_from = 3999",
            [
                "nothing_from = 3999: is nearer than max_range_m",
                "taken for free",
            ],
        ),
        (
            "nothing_from = -1",
            ["nothing_from = -1: is out of range", ""],
        ),
        (
            "delay_s = 0.07",
            [
                "delay_s = 0.07: leaves no time for an answer",
                "scan_period_s",
            ],
        ),
        ("delay_s = -1", ["delay_s = -1: is out of range", ""]),
        ("pin = 4", ["pin: is not known", ""]),
    ] {
        check_one(&serial(&format!("{table}.{lines}\n")), &parts);
    }
    for port in ["ttyUSB0", "", "/dev/tty\\u0000"] {
        check_replaced(
            &serial(""),
            "/dev/ttyUSB0",
            port,
            &["range.serial-text.port"],
        );
    }
    let portless = serial("").replace("range.serial-text.port = \"/dev/ttyUSB0\"\n", "");
    check_one(
        &portless,
        &["range.serial-text: is missing", "with its port is needed"],
    );
    check_one(
        &format!("{portless}{table}.baud = 9600\n"),
        &["range.serial-text.port: is missing"],
    );
    check_one(
        &serial("range.max_range_m = 12\nrange.farness_m = 4\n"),
        &["range.max_range_m = 12: is farther than a line such as R9999 says"],
    );
    check_one(
        &serial("").replace("servo.driver = \"none\"", "servo.driver = \"sim\""),
        &[
            "servo.driver = \"sim\": turns no real range sensor",
            "or \"none\" for a sensor that is fixed",
        ],
    );
    let two = "range.beams_deg = [0]\n[[range.sensor]]\n[[range.sensor]]\nmount_deg = 9\n";
    check_one(&serial(two), &["range.sensor", "one port is one sensor"]);
}

/// A vehicle with these drivers of range sensor and servo.
#[cfg(feature = "hw")]
fn turned(range: &str, servo: &str, lines: &str) -> String {
    let text = VEHICLE.replace(
        "range.driver = \"sim\"",
        &format!("range.driver = \"{range}\""),
    );
    let text = text.replace(
        "servo.driver = \"sim\"",
        &format!("servo.driver = \"{servo}\""),
    );
    format!("{text}vehicle.max_speed_mps = 0.2\n{lines}")
}

#[cfg(feature = "hw")]
const PWM: &str = "servo.pwm.chip = \"/sys/class/pwm/pwmchip0\"\n";
#[cfg(feature = "hw")]
const ECHO: &str = "range.hcsr04.trigger = \"GPIO23\"\nrange.hcsr04.echo = \"GPIO24\"\n";

#[cfg(feature = "hw")]
#[test]
fn a_real_servo_turns_one_sensor_as_far_as_its_pulses_reach() {
    let file = vehicle(&turned("sim", "pwm", PWM));
    let ServoDriver::Real(servo) = &file.drivers.servo else {
        panic!("{:?}", file.drivers)
    };
    let chip = "/sys/class/pwm/pwmchip0".to_owned();
    assert_eq!(servo.output, ServoOutput::Pwm { chip, channel: 0 });
    assert_eq!(
        (&servo.scale.pulse_us[..], &servo.scale.angle_deg[..]),
        (&[1000.0, 2000.0][..], &[-90.0, 90.0][..])
    );
    let sensor = file.look.sensors[0];
    assert_eq!((sensor.servo_from_deg, sensor.servo_to_deg), (-90.0, 90.0));
    assert!(
        file.drivers
            .capabilities(config::Craft::Rover)
            .contains(&Capability::Servo(ServoKind::Pwm))
    );
    let written = config::to_toml(&Config::Vehicle(Box::new(file.clone())));
    let read = config::read_vehicle("v.toml", &written, &mut |_| {
        bundled::load("configs/courtyard.venue.toml")
    });
    let read = read.unwrap();
    assert_eq!(
        (&read.drivers, &read.look),
        (&file.drivers, &file.look),
        "{written}"
    );
    let pin = vehicle(&turned(
        "sim",
        "gpio",
        "servo.gpio.pin = \"GPIO18\"\nservo.gpio.angle_deg = [60, -60]\n",
    ));
    assert!(
        pin.drivers.in_words().contains("servo gpio on GPIO18"),
        "{}",
        pin.drivers.in_words()
    );
    assert_eq!(pin.look.sensors[0].servo_to_deg, 60.0);
}

#[cfg(feature = "hw")]
#[test]
fn every_wrong_value_of_a_real_servo_is_refused() {
    for (lines, part) in [
        (
            "servo.pwm.pulse_us = [2000, 1000]",
            "servo.pwm.pulse_us = [2000, 1000]: does not rise",
        ),
        ("servo.pwm.pulse_us = [1500, 1500]", "does not rise"),
        ("servo.pwm.pulse_us = [0, 2000]", "each from 300 to 3000"),
        ("servo.pwm.pulse_us = [1000]", "servo.pwm.pulse_us"),
        ("servo.pwm.angle_deg = [30, 30]", "is one angle"),
        ("servo.pwm.channel = 256", "is out of range"),
        (
            "servo.pwm.angle_deg = [-40, 90]\nrange.sensor = [{ servo_from_deg = -60, servo_to_deg = 60 }]",
            "is beyond what the servo's pulses reach",
        ),
        (
            "range.sensor = [{ servo_to_deg = 60, servo_from_deg = -60 }, { mount_deg = 180, servo_to_deg = 1 }]",
            "there is one servo",
        ),
    ] {
        check_one(&turned("sim", "pwm", &format!("{PWM}{lines}\n")), &[part]);
    }
    check_one(&turned("sim", "pwm", ""), &["servo.pwm: is missing"]);
    check_one(
        &turned("sim", "pwm", "servo.pwm.channel = 1\n"),
        &["servo.pwm.chip: is missing"],
    );
    check_one(
        &turned("sim", "pwm", "servo.pwm.chip = \"pwmchip0\"\n"),
        &["is no whole path"],
    );
    check_one(
        &turned("sim", "gpio", "servo.gpio.pin = \"\"\n"),
        &["servo.gpio.pin"],
    );
}

#[cfg(feature = "hw")]
#[test]
fn an_ultrasonic_sensor_is_told_its_lines_by_name() {
    let file = vehicle(&turned("hcsr04", "pwm", &format!("{PWM}{ECHO}")));
    let RangeDriver::HcSr04(lines) = &file.drivers.range else {
        panic!("{:?}", file.drivers)
    };
    let (trigger, echo) = ("GPIO23".to_owned(), "GPIO24".to_owned());
    let expected = HcSr04Lines {
        trigger,
        echo,
        power: None,
        air_temperature_c: 20.0,
    };
    assert_eq!(*lines, expected);
    assert!(
        file.drivers
            .capabilities(config::Craft::Rover)
            .contains(&Capability::RangeSensor(RangeSensorKind::HcSr04))
    );
    let whole =
        format!("{ECHO}range.hcsr04.power = \"GPIO17\"\nrange.hcsr04.air_temperature_c = -5\n");
    let file = vehicle(&turned("hcsr04", "none", &whole));
    let written = config::to_toml(&Config::Vehicle(Box::new(file.clone())));
    let read = config::read_vehicle("v.toml", &written, &mut |_| {
        bundled::load("configs/courtyard.venue.toml")
    });
    assert_eq!(read.unwrap().drivers, file.drivers, "{written}");
    for (lines, part) in [
        (
            "range.hcsr04.power = \"GPIO24\"",
            "range.hcsr04.power = \"GPIO24\": is another line of this sensor, too",
        ),
        ("range.hcsr04.air_temperature_c = 61", "is out of range"),
        (
            "range.max_range_m = 4.5",
            "range.max_range_m = 4.5: is farther than it hears",
        ),
        ("range.scan_period_s = 0.09", "leaves no time for an answer"),
        ("range.hcsr04.pin = 4", "is not known"),
    ] {
        check_one(
            &turned("hcsr04", "none", &format!("{ECHO}{lines}\n")),
            &[part],
        );
    }
    let doubled = ECHO.replace("GPIO24", "GPIO23");
    check_one(
        &turned("hcsr04", "none", &doubled),
        &["range.hcsr04.echo = \"GPIO23\": is another line"],
    );
    check_one(&turned("hcsr04", "none", ""), &["range.hcsr04: is missing"]);
    check_one(
        &turned("hcsr04", "none", "range.hcsr04.trigger = \"GPIO23\"\n"),
        &["range.hcsr04.echo: is missing"],
    );
    check_one(
        &turned("hcsr04", "sim", ECHO),
        &["turns no real range sensor"],
    );
}

#[cfg(feature = "hw")]
#[test]
fn sensors_on_an_autopilot_need_one_and_say_from_where_on_nothing_is_there() {
    let mavlink = |lines: &str| {
        let text = turned("autopilot", "none", lines);
        let (old, new) = (
            "autopilot.driver = \"sim\"",
            "autopilot.driver = \"mavlink\"\nautopilot.mavlink.connection = \"tcp:127.0.0.1:5760\"",
        );
        assert!(text.contains(old), "{text}");
        text.replace(old, new)
    };
    let lines = "range.autopilot.nothing_from_m = 7\nrange.beams_deg = [0, 90]\n\
                 range.sensor = [{ mount_deg = 0 }, { mount_deg = 90 }]\n";
    let file = vehicle(&mavlink(lines));
    let RangeDriver::Autopilot(range) = file.drivers.range else {
        panic!("{:?}", file.drivers)
    };
    assert_eq!((range.nothing_from_m, range.delay_s), (Some(7.0), 0.04));
    assert_eq!(range.rate_hz(&file.look), 40);
    assert!(
        file.drivers
            .capabilities(config::Craft::Rover)
            .contains(&Capability::RangeSensor(RangeSensorKind::Autopilot))
    );
    let written = config::to_toml(&Config::Vehicle(Box::new(file.clone())));
    let read = config::read_vehicle("v.toml", &written, &mut |_| {
        bundled::load("configs/courtyard.venue.toml")
    });
    assert_eq!(read.unwrap().drivers, file.drivers, "{written}");
    for (lines, part) in [
        (
            "range.autopilot.nothing_from_m = 3.9",
            "range.autopilot.nothing_from_m = 3.9: is nearer than max_range_m",
        ),
        ("range.autopilot.nothing_from_m = 700", "is out of range"),
        (
            "range.autopilot.delay_s = 0.05",
            "range.scan_period_s = 0.1 (the default): leaves no time for an answer: its messages",
        ),
        ("range.autopilot.port = \"/dev/ttyS0\"", "is not known"),
    ] {
        check_one(&mavlink(&format!("{lines}\n")), &[part]);
    }
    check_one(
        &turned("autopilot", "none", ""),
        &["range.driver = \"autopilot\": hangs on an autopilot that is simulated"],
    );
}

#[cfg(feature = "hw")]
#[test]
fn a_servo_on_an_autopilot_needs_one_and_time_for_the_way_to_it() {
    let turned_by = |lines: &str| {
        turned("sim", "autopilot", lines).replace(
            "autopilot.driver = \"sim\"",
            "autopilot.driver = \"mavlink\"\nautopilot.mavlink.connection = \"tcp:127.0.0.1:5760\"",
        )
    };
    let whole = "servo.autopilot.output = 9\nrange.settle_s = 0.11\nrange.scan_period_s = 0.15\n";
    let file = vehicle(&turned_by(whole));
    let ServoDriver::Real(servo) = &file.drivers.servo else {
        panic!("{:?}", file.drivers)
    };
    assert_eq!(servo.output, ServoOutput::Autopilot { output: 9 });
    assert_eq!(file.look.sensors[0].servo_to_deg, 90.0);
    assert!(
        file.drivers
            .capabilities(config::Craft::Rover)
            .contains(&Capability::Servo(ServoKind::Autopilot))
    );
    let written = config::to_toml(&Config::Vehicle(Box::new(file.clone())));
    let read = config::read_vehicle("v.toml", &written, &mut |_| {
        bundled::load("configs/courtyard.venue.toml")
    });
    assert_eq!(read.unwrap().drivers, file.drivers, "{written}");
    for (lines, part) in [
        ("", "servo.autopilot: is missing"),
        (
            "servo.autopilot.pulse_us = [1000, 2000]\n",
            "servo.autopilot.output: is missing",
        ),
        ("servo.autopilot.output = 0\n", "servo.autopilot.output = 0"),
        (
            "servo.autopilot.output = 33\n",
            "servo.autopilot.output = 33",
        ),
        (
            "servo.autopilot.output = 9\n",
            "range.settle_s = 0.03 (the default): leaves no time for the way to the autopilot",
        ),
    ] {
        check_one(&turned_by(lines), &[part]);
    }
    check_one(
        &turned("sim", "autopilot", whole),
        &["hangs on an autopilot that is simulated, and turns nothing"],
    );
}

#[cfg(feature = "hw")]
#[test]
fn range_sensors_of_several_kinds_are_read_each_by_its_own_driver() {
    let mixed = |second: &str| {
        format!(
            "{ECHO}range.beams_deg = [0, 90]\nrange.sensor = [{{ mount_deg = 0 }}, {{ mount_deg = 90, {second} }}]\n"
        )
    };
    let luna = "driver = \"tf-luna\", tf-luna = { port = \"/dev/serial0\" }";
    let file = vehicle(&turned("hcsr04", "none", &mixed(luna)));
    assert_eq!(file.look.sensors[1].mount_deg, 90.0);
    assert!(matches!(file.drivers.range_of(0), RangeDriver::HcSr04(_)));
    let RangeDriver::Serial(sensor) = file.drivers.range_of(1) else {
        panic!("{:?}", file.drivers)
    };
    assert_eq!(
        (sensor.port.as_str(), &sensor.protocol),
        ("/dev/serial0", &SerialProtocol::Tf(TfSensor::Luna))
    );
    let capabilities = file.drivers.capabilities(config::Craft::Rover);
    for kind in [RangeSensorKind::HcSr04, RangeSensorKind::TfLuna] {
        assert!(
            capabilities.contains(&Capability::RangeSensor(kind)),
            "{capabilities:?}"
        );
    }
    let words = file.drivers.in_words();
    assert!(
        words.contains("range hcsr04 on GPIO23 and GPIO24 and tf-luna on /dev/serial0"),
        "{words}"
    );
    let written = config::to_toml(&Config::Vehicle(Box::new(file.clone())));
    let read = config::read_vehicle("v.toml", &written, &mut |_| {
        bundled::load("configs/courtyard.venue.toml")
    });
    let read = read.unwrap();
    assert_eq!(
        (&read.drivers, &read.look),
        (&file.drivers, &file.look),
        "{written}"
    );
    for (second, part) in [
        (
            "driver = \"sim\"",
            "range.sensor[1].driver = \"sim\": is not known",
        ),
        (
            "driver = \"none\"",
            "range.sensor[1].driver = \"none\": is not known",
        ),
        (
            "driver = \"tf-luna\"",
            "range.sensor[1].tf-luna: is missing",
        ),
        (
            "driver = \"tf-luna\", tf-luna = { port = \"serial0\" }",
            "range.sensor[1].tf-luna.port = \"serial0\"",
        ),
        (
            "driver = \"hcsr04\", hcsr04 = { trigger = \"GPIO5\", echo = \"GPIO24\" }",
            "range.sensor[1].hcsr04.echo = \"GPIO24\": is of another range sensor, too",
        ),
        (
            "driver = \"hcsr04\", hcsr04 = { trigger = \"GPIO5\", echo = \"GPIO5\" }",
            "range.sensor[1].hcsr04.echo = \"GPIO5\": is another line of this sensor, too",
        ),
        ("servo_to_deg = 0", "one pair of lines is one sensor"),
        (
            "driver = \"autopilot\"",
            "hangs on an autopilot that is simulated",
        ),
    ] {
        check_one(&turned("hcsr04", "none", &mixed(second)), &[part]);
    }
    check_one(
        &turned("none", "none", &mixed(luna)),
        &["range.driver = \"none\": is none of a real sensor"],
    );
    // Three of one kind, each with lines of its own, and the farther looking one looks no farther than the other.
    let three = "range.sensor = [{}, { driver = \"hcsr04\", hcsr04 = { trigger = \"A\", echo = \"B\" } }, \
                 { driver = \"hcsr04\", hcsr04 = { trigger = \"C\", echo = \"D\" } }]\n";
    let file = vehicle(&turned("hcsr04", "none", &format!("{ECHO}{three}")));
    assert_eq!(file.drivers.own_range.len(), 3);
    let far = format!(
        "{}range.max_range_m = 6\nrange.farness_m = 4\n",
        mixed(luna)
    );
    check_one(
        &turned("hcsr04", "none", &far),
        &["range.max_range_m = 6: is farther than it hears"],
    );
}

#[cfg(feature = "hw")]
#[test]
fn a_lidar_is_told_its_port_and_looks_no_farther_than_it_can() {
    for (name, sensor, farthest_m) in [
        ("tf-luna", TfSensor::Luna, 8),
        ("tfmini", TfSensor::Mini, 12),
    ] {
        let port = format!("range.{name}.port = \"/dev/serial0\"\n");
        let file = vehicle(&turned(name, "none", &port));
        let expected = SerialSensor {
            port: "/dev/serial0".to_owned(),
            baud: 115_200,
            protocol: SerialProtocol::Tf(sensor),
        };
        assert_eq!(file.drivers.range, RangeDriver::Serial(expected));
        let far = format!("{port}range.max_range_m = 20\nrange.farness_m = 4\n");
        let allowed = format!("at most {farthest_m} m is allowed");
        check_one(
            &turned(name, "none", &far),
            &["range.max_range_m = 20: is farther", &allowed],
        );
        let fast = format!("{port}range.scan_period_s = 0.05\n");
        check_one(
            &turned(name, "none", &fast),
            &["range.scan_period_s = 0.05: leaves no time"],
        );
    }
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
