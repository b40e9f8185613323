//! A range sensor on a pseudo-terminal, which says something all the time, and the servo that turns it, at a PWM chip that
//! a folder plays.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::super::*;
use super::start_devices;
use crate::geom::Angle;
use crate::node::sensor::Ping;

/// Whatever is waited for comes within this time.
const SOON: Duration = Duration::from_secs(20);
/// What stays away for so long does not come: a sensor that is asked answers within 50 ms.
const AWAY: Duration = Duration::from_millis(600);

/// A sensor that says 1.5 m for ever, and where it is found.
fn talking_sensor() -> String {
    let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&line).unwrap();
    unlockpt(&line).unwrap();
    let port = ptsname(&line, Vec::new()).unwrap().into_string().unwrap();
    let mut line = File::from(line);
    std::thread::spawn(move || {
        while line.write_all(b"R1500\r").is_ok() {
            std::thread::sleep(Duration::from_millis(10));
        }
    });
    port
}

/// The devices of a vehicle with that sensor on a servo at channel 0 of a chip, and with another, fixed one astern.
fn devices(chip: &Path) -> (VehicleDevices, Receiver<Event>) {
    let (ahead, astern) = (talking_sensor(), talking_sensor());
    let chip = chip.display();
    let text = format!(
        "kind = \"vehicle\"\nvenue = \"courtyard.venue.toml\"\nid = 1\nstate_dir = \"state\"\nvehicle.max_speed_mps = 0.05\n\
         autopilot.driver = \"sim\"\nradio.driver = \"sim\"\nworld.connect = \"127.0.0.1:9\"\nworld.token = \"secret-token\"\n\
         servo.driver = \"pwm\"\nservo.pwm.chip = \"{chip}\"\n\
         range.driver = \"serial-text\"\nrange.serial-text.port = \"{ahead}\"\nrange.beams_deg = [-40, 0, 40, 180]\n\
         range.scan_period_s = 0.2\nrange.settle_s = 0.1\nrange.sensor = [\n\
         {{ mount_deg = 0, servo_from_deg = -60, servo_to_deg = 60 }},\n\
         {{ mount_deg = 180, driver = \"serial-text\", serial-text.port = \"{astern}\" }}]\n"
    );
    start_devices(&text)
}

/// Turns to each direction in turn and asks there, until an answer comes or the time is over; returns whether one came.
fn is_answered(
    devices: &VehicleDevices,
    events: &Receiver<Event>,
    beams_deg: &[f64],
    within: Duration,
) -> bool {
    while events.try_recv().is_ok() {}
    let began = Instant::now();
    for (number, beam_deg) in (1..).zip(beams_deg.iter().cycle()) {
        if began.elapsed() > within {
            return false;
        }
        devices.carry_out(&Effect::Steer(Angle::from_degrees(*beam_deg)));
        std::thread::sleep(Duration::from_millis(40));
        devices.carry_out(&Effect::Ping(Ping { number }));
        if events.recv_timeout(Duration::from_millis(100)).is_ok() {
            return true;
        }
    }
    false
}

#[test]
fn a_sensor_on_a_servo_of_this_machine_is_asked_only_where_that_has_turned_it() {
    let folder = tempfile::tempdir().unwrap();
    let channel = folder.path().join("pwm0");
    let (devices, events) = devices(folder.path());
    let astern = |devices| is_answered(devices, &events, &[180.0], SOON);
    let turned = |devices, within| is_answered(devices, &events, &[40.0, -40.0], within);
    assert!(astern(&devices), "the fixed one needs no servo");
    assert!(
        !turned(&devices, AWAY),
        "there is no chip: it looks who knows where"
    );
    std::fs::create_dir(&channel).unwrap();
    for file in ["period", "duty_cycle", "enable"] {
        std::fs::write(channel.join(file), "0").unwrap();
    }
    assert!(turned(&devices, SOON), "it is turned");
    let pulse = std::fs::read_to_string(channel.join("duty_cycle")).unwrap();
    assert!(["1722222", "1277778"].contains(&pulse.as_str()), "{pulse}");
    std::fs::remove_dir_all(&channel).unwrap();
    devices.carry_out(&Effect::Steer(Angle::ZERO));
    let began = Instant::now();
    while devices.servo.trouble().is_none() {
        assert!(began.elapsed() < SOON, "its pulse cannot be given");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(!turned(&devices, AWAY), "it stands where it stood");
    assert!(astern(&devices), "the fixed one goes on");
}
