//! Range sensors and servos in a vehicle's file: what their drivers are told, and every way to get it wrong.

use tomoswarm::config::{
    self, Drivers, HcSr04Lines, LengthUnit, RangeDriver, SerialProtocol, SerialSensor, SerialText,
    ServoDriver, ServoOutput, TextFormat, TfSensor,
};
use tomoswarm_proto::{Capability, RangeSensorKind, ServoKind};

use super::nodes::{VEHICLE, check_one, check_replaced, check_written, vehicle};

/// A vehicle with a range sensor on a serial line.
fn serial(lines: &str) -> String {
    let text = VEHICLE.replace("range.driver = \"sim\"", "range.driver = \"serial-text\"");
    let text = text.replace("servo.driver = \"sim\"", "servo.driver = \"none\"");
    format!("{text}vehicle.max_speed_mps = 0.2\nrange.serial-text.port = \"/dev/ttyUSB0\"\n{lines}")
}

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
    check_written(&file);
}

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

const PWM: &str = "servo.pwm.chip = \"/sys/class/pwm/pwmchip0\"\n";
const ECHO: &str = "range.hcsr04.trigger = \"GPIO23\"\nrange.hcsr04.echo = \"GPIO24\"\n";

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
    check_written(&file);
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
    check_written(&file);
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
    check_written(&file);
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
    check_written(&file);
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
    check_written(&file);
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

#[test]
fn a_port_or_a_line_is_of_one_device() {
    let pin = "servo.gpio.pin = \"GPIO24\"\n";
    check_one(
        &turned("hcsr04", "gpio", &format!("{ECHO}{pin}")),
        &["servo.gpio.pin = \"GPIO24\": is that of range.hcsr04.echo, too"],
    );
    let xbee = |port: &str| {
        let text = serial(&format!("radio.xbee.port = \"{port}\"\n"));
        text.replace("radio.driver = \"sim\"", "radio.driver = \"xbee\"")
    };
    check_one(
        &xbee("/dev/ttyUSB0"),
        &["radio.xbee.port = \"/dev/ttyUSB0\": is that of range.serial-text.port, too"],
    );
    let flown = |radio_port: &str| {
        let autopilot = "autopilot.driver = \"mavlink\"\nautopilot.mavlink.connection = \"serial:/dev/ttyACM0\"";
        xbee(radio_port).replace("autopilot.driver = \"sim\"", autopilot)
    };
    check_one(
        &flown("/dev/ttyACM0"),
        &["radio.xbee.port = \"/dev/ttyACM0\": is that of autopilot.mavlink.connection, too"],
    );
    check_written(&vehicle(&flown("/dev/ttyUSB1")));
}

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
