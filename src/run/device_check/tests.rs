//! Devices of a vehicle that this test plays: an autopilot over TCP, a lidar at a pseudo-terminal, a PWM chip in a folder.

use std::fs::{self, File};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::*;
use crate::config::{self, bundled};
use crate::mavlink::dialect::MavResult;
use crate::run::drivers::tests::on_autopilot::PlayedAutopilot;

fn vehicle(lines: &str) -> VehicleFile {
    let text = format!(
        "kind = \"vehicle\"\nvenue = \"courtyard.venue.toml\"\nid = 1\nstate_dir = \"state\"\nvehicle.max_speed_mps = 0.1\n\
         world.connect = \"127.0.0.1:9\"\nworld.token = \"secret-token\"\n{lines}"
    );
    config::read_vehicle("configs/v.toml", &text, &mut |path| bundled::load(path)).unwrap()
}

fn found(check: &DeviceCheck, file: &VehicleFile) -> Vec<DeviceFound> {
    let mut all = Vec::new();
    check.run(file, &mut |found| all.push(found)).unwrap();
    all
}

/// Returns what a device whose name begins like this answers.
fn answer<'a>(all: &'a [DeviceFound], device: &str) -> Result<&'a str, &'a str> {
    let found = all.iter().find(|found| found.device.starts_with(device));
    let found = found.unwrap_or_else(|| panic!("{device}: {all:?}"));
    found.answer.as_deref().map_err(String::as_str)
}

/// A lidar that says two metres for as long as this is kept.
struct Lidar(Arc<AtomicBool>);

impl Lidar {
    fn plug(path: &Path) -> Lidar {
        let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&line).unwrap();
        unlockpt(&line).unwrap();
        let terminal = ptsname(&line, Vec::new()).unwrap().into_string().unwrap();
        std::os::unix::fs::symlink(terminal, path).unwrap();
        let frame = [0x59u8, 0x59, 200, 0, 0xF4, 1, 0x48, 8];
        let sum = frame.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        let frame = [&frame[..], &[sum]].concat();
        let is_kept = Arc::new(AtomicBool::new(true));
        let (kept, mut line) = (is_kept.clone(), File::from(line));
        std::thread::spawn(move || {
            while kept.load(Ordering::Relaxed) {
                // Nobody reads it yet, or any more.
                let _ = line.write_all(&frame);
                std::thread::sleep(Duration::from_millis(10));
            }
        });
        Lidar(is_kept)
    }
}

impl Drop for Lidar {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Relaxed);
    }
}

/// The files of a PWM chip whose channel 0 is exported.
fn pwm_chip(folder: &Path) -> PathBuf {
    let chip = folder.join("pwmchip0");
    fs::create_dir_all(chip.join("pwm0")).unwrap();
    for file in ["export", "pwm0/period", "pwm0/duty_cycle", "pwm0/enable"] {
        fs::write(chip.join(file), "").unwrap();
    }
    chip
}

#[test]
fn every_device_is_asked_and_nothing_moves_unless_it_is_to() {
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("lidar");
    let (_lidar, chip) = (Lidar::plug(&port), pwm_chip(folder.path()));
    let file = || {
        vehicle(&format!(
            "autopilot.driver = \"mavlink\"\nautopilot.mavlink.connection = \"tcp:{}\"\nradio.driver = \"sim\"\n\
             servo.driver = \"pwm\"\nservo.pwm.chip = \"{}\"\nservo.pwm.angle_deg = [-60, 60]\n\
             range.driver = \"tf-luna\"\nrange.tf-luna.port = \"{}\"\n",
            PlayedAutopilot::start().address,
            chip.display(),
            port.display()
        ))
    };
    let duty = || fs::read_to_string(chip.join("pwm0/duty_cycle")).unwrap();
    let all = found(&DeviceCheck::default(), &file());
    let heartbeat = answer(&all, "autopilot").unwrap();
    assert!(heartbeat.contains("a heartbeat"), "{all:?}");
    assert_eq!(answer(&all, "range sensor 1 (tf-luna on "), Ok("2.00 m"));
    let servo = answer(&all, "servo (pwm on channel 0 of ").unwrap();
    assert!(
        servo.starts_with("it could be opened, and was left"),
        "{servo}"
    );
    assert_eq!(answer(&all, "radio"), Ok(SIMULATED));
    let period = fs::read_to_string(chip.join("pwm0/period")).unwrap();
    assert_eq!([duty(), period], ["", ""], "nothing is written");
    let check = DeviceCheck {
        moves: true,
        record_edges: None,
    };
    let all = found(&check, &file());
    let servo = answer(&all, "servo").unwrap();
    assert!(servo.starts_with("told to turn to -60°, 60°"), "{servo}");
    assert_eq!(duty(), "1500000", "it is back");
}

#[test]
fn a_servo_on_an_autopilot_swings_only_when_it_is_to() {
    let autopilot = PlayedAutopilot::start();
    let file = vehicle(&format!(
        "autopilot.driver = \"mavlink\"\nautopilot.mavlink.connection = \"tcp:{}\"\nradio.driver = \"sim\"\n\
         servo.driver = \"autopilot\"\nservo.autopilot.output = 9\nrange.driver = \"autopilot\"\n\
         range.settle_s = 0.11\nrange.scan_period_s = 0.2\n",
        autopilot.address
    ));
    autopilot.say([Some(150), None]);
    *autopilot.answers.lock().unwrap() = Some(MavResult::MAV_RESULT_ACCEPTED);
    let check = DeviceCheck {
        moves: true,
        record_edges: None,
    };
    let all = found(&check, &file);
    assert_eq!(answer(&all, "range sensor 1 (autopilot)"), Ok("1.50 m"));
    let servo = answer(&all, "servo (autopilot on output 9)").unwrap();
    assert!(servo.starts_with("told to turn to -90°, 90°"), "{servo}");
    let pulses = autopilot.pulses.lock().unwrap().clone();
    assert_eq!(pulses, [(9, 1000), (9, 2000), (9, 1500)]);
}

#[test]
fn every_device_that_does_not_answer_is_named_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let gone = |name: &str| folder.path().join(name).display().to_string();
    let file = vehicle(&format!(
        "autopilot.driver = \"mavlink\"\nautopilot.mavlink.connection = \"tcp:127.0.0.1:9\"\nradio.driver = \"xbee\"\n\
         radio.xbee.port = \"{}\"\nservo.driver = \"none\"\nrange.driver = \"tf-luna\"\nrange.tf-luna.port = \"{}\"\n\
         range.beams_deg = [0, 90]\nrange.sensor = [{{ mount_deg = 0 }}, {{ mount_deg = 90, driver = \"hcsr04\", \
         hcsr04 = {{ trigger = \"NO-SUCH-LINE\", echo = \"NOR-THIS\" }} }}]\n",
        gone("xbee"),
        gone("lidar")
    ));
    let check = DeviceCheck {
        moves: true,
        record_edges: Some(folder.path().join("edges")),
    };
    let all = found(&check, &file);
    for (device, part) in [
        ("echo line of range sensor 2", ""),
        ("autopilot", "127.0.0.1:9"),
        ("range sensor 1 (tf-luna on ", "lidar: "),
        (
            "range sensor 2 (hcsr04 on NO-SUCH-LINE and NOR-THIS)",
            "NO-SUCH-LINE",
        ),
        ("radio", "xbee: "),
    ] {
        let why = answer(&all, device).unwrap_err();
        assert!(why.contains(part), "{device}: {why}");
    }
    assert_eq!(answer(&all, "servo"), Ok("none"));
    assert!(!folder.path().join("edges").exists(), "nothing is written");
}

#[test]
fn a_radio_whose_adapter_holds_bytes_back_is_told_so_whatever_it_answers() {
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("xbee");
    // It says something, but no frames.
    let _lidar = Lidar::plug(&port);
    let file = vehicle(&format!(
        "autopilot.driver = \"sim\"\nradio.driver = \"xbee\"\nradio.xbee.port = \"{}\"\nservo.driver = \"none\"\n\
         range.driver = \"sim\"\n",
        port.display()
    ));
    let terminal = fs::canonicalize(&port).unwrap();
    let adapter = folder.path().join(terminal.file_name().unwrap());
    fs::create_dir(&adapter).unwrap();
    for (delay, is_told) in [("16\n", true), ("1\n", false)] {
        fs::write(adapter.join("latency_timer"), delay).unwrap();
        let why = look_at_radio(&file, folder.path()).unwrap_err();
        assert!(why.contains("no module answers at 115200 baud"), "{why}");
        let warning = "; warning: its USB adapter holds bytes back for 16 ms";
        assert_eq!(why.contains(warning), is_told, "{why}");
    }
}

#[test]
fn a_recording_is_never_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let recording = || EdgeRecording {
        sensor: "A and B".to_owned(),
        air_temperature_c: 20.0,
        pings: Vec::new(),
    };
    let path = folder.path().join("edges");
    let first = written(Ok(recording()), &path, 1).unwrap().unwrap();
    assert!(first.contains("recorded-2.txt"), "{first}");
    let error = written(Ok(recording()), &path, 1).unwrap_err();
    assert!(error.to_string().contains("recorded-2.txt: "), "{error}");
    let kept = fs::read_to_string(path.join("recorded-2.txt")).unwrap();
    assert_eq!(kept, "# recorded from A and B\nair 20.0\n");
}

#[test]
fn the_devices_of_a_vehicle_that_is_running_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = vehicle(
        "autopilot.driver = \"sim\"\nradio.driver = \"sim\"\nservo.driver = \"none\"\nrange.driver = \"sim\"\n",
    );
    file.state_dir = folder.path().display().to_string();
    let running = state_dir::StateDir::open(folder.path()).unwrap();
    let looked = |file| DeviceCheck::default().run(file, &mut |found| panic!("{found:?}"));
    let why = looked(&file).unwrap_err().to_string();
    assert!(why.contains("the vehicle is running"), "{why}");
    drop(running);
    assert_eq!(
        answer(&found(&DeviceCheck::default(), &file), "radio"),
        Ok(SIMULATED)
    );
}
