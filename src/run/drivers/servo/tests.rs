//! A servo at a PWM chip that a temporary folder plays: what is written, in which order, and what happens when it cannot be.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use super::sysfs_pwm::{Chip, Files, SysfsPwm};
use super::*;
use crate::config::{SensorMount, ServoOutput, ServoScale};

/// Whatever is waited for comes within this time.
const SOON: Duration = Duration::from_secs(20);

/// Notes what is written, and refuses what it is told to.
#[derive(Clone, Default)]
pub(super) struct Recorder(Arc<Mutex<Recorded>>);

#[derive(Default)]
struct Recorded {
    written: Vec<(String, String)>,
    /// Files and how they refuse the next write to each.
    refused: Vec<(&'static str, io::ErrorKind)>,
}

impl Recorder {
    pub(super) fn write(&self, file: &Path, text: &str) -> io::Result<()> {
        let name = file.file_name().unwrap().to_str().unwrap();
        let mut recorded = self.0.lock().unwrap();
        if recorded
            .refused
            .first()
            .is_some_and(|(refused, _)| *refused == name)
        {
            return Err(recorded.refused.remove(0).1.into());
        }
        match name {
            "export" if file.exists() => {
                let channel = file.with_file_name(format!("pwm{text}"));
                std::fs::create_dir(&channel).unwrap();
                for file in ["period", "duty_cycle", "enable"] {
                    std::fs::write(channel.join(file), "0").unwrap();
                }
            }
            _ if file.exists() => std::fs::write(file, text).unwrap(),
            _ => return Err(io::ErrorKind::NotFound.into()),
        }
        recorded.written.push((name.to_owned(), text.to_owned()));
        Ok(())
    }

    fn written(&self) -> Vec<String> {
        let recorded = self.0.lock().unwrap();
        let line = |(name, text): &(String, String)| format!("{name} {text}");
        recorded.written.iter().map(line).collect()
    }
}

fn look() -> SensorCoverage {
    SensorCoverage {
        sensors: vec![SensorMount {
            servo_from_deg: -60.0,
            servo_to_deg: 60.0,
            ..SensorMount::default()
        }],
        ..SensorCoverage::default()
    }
}

fn real(chip: &Path, channel: usize) -> RealServo {
    let chip = chip.to_str().unwrap().to_owned();
    RealServo {
        output: ServoOutput::Pwm { chip, channel },
        scale: ServoScale {
            pulse_us: vec![1000.0, 2000.0],
            angle_deg: vec![-90.0, 90.0],
        },
    }
}

/// A servo on channel 1 of a chip that a test plays.
struct PwmFolder {
    _folder: tempfile::TempDir,
    chip: PathBuf,
    recorder: Recorder,
    servo: Servo,
}

impl PwmFolder {
    fn new(refused: &[(&'static str, io::ErrorKind)]) -> PwmFolder {
        let folder = tempfile::tempdir().unwrap();
        let chip = folder.path().join("pwmchip0");
        std::fs::create_dir(&chip).unwrap();
        std::fs::write(chip.join("export"), "").unwrap();
        std::fs::write(chip.join("npwm"), "1\n").unwrap();
        let recorder = Recorder::default();
        recorder.0.lock().unwrap().refused.extend(refused);
        let pulses = Pulses::new(&real(&chip, 1), &look()).unwrap();
        let output = Output::Sysfs(
            Chip {
                folder: chip.clone(),
                channel: 1,
            },
            Files::Recorded(recorder.clone()),
        );
        let output = OutputServo::start(output, pulses.at_rest()).unwrap();
        PwmFolder {
            _folder: folder,
            chip,
            recorder,
            servo: Servo {
                device: Device::Output(pulses, output),
            },
        }
    }

    fn until(&self, what: &str, is_so: impl Fn(&PwmFolder) -> bool) {
        let began = Instant::now();
        while !is_so(self) {
            let (trouble, written) = (self.servo.trouble(), self.recorder.written());
            assert!(began.elapsed() < SOON, "{what}: {trouble:?}, {written:?}");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn until_written(&self, line: &str) {
        self.until(line, |pwm| {
            pwm.recorder.written().iter().any(|written| written == line)
        });
    }
}

const FIRST: [&str; 4] = [
    "export 1",
    "period 20000000",
    "duty_cycle 1500000",
    "enable 1",
];

#[test]
fn a_channel_is_exported_and_gets_period_pulse_and_enable_in_this_order() {
    let pwm = PwmFolder::new(&[]);
    pwm.until_written("enable 1");
    assert_eq!(pwm.recorder.written(), FIRST);
    for (beam_deg, expected) in [
        (45.0, "duty_cycle 1750000"),
        (-60.0, "duty_cycle 1166667"),
        (60.0, "duty_cycle 1833333"),
    ] {
        pwm.servo.steer(Angle::from_degrees(beam_deg));
        pwm.until_written(expected);
    }
    // Out of its limits the vehicle has to turn.
    pwm.servo.steer(Angle::from_degrees(80.0));
    pwm.servo.steer(Angle::from_degrees(-60.0));
    pwm.until("the last pulse", |pwm| {
        let written = pwm.recorder.written();
        written
            .iter()
            .filter(|line| *line == "duty_cycle 1166667")
            .count()
            == 2
    });
    let channel = pwm.chip.join("pwm1");
    drop(pwm.servo);
    let left = std::fs::read_to_string(channel.join("enable")).unwrap();
    assert_eq!(left, "1", "it holds the sensor");
}

#[test]
fn the_files_of_a_channel_may_be_another_program_s_for_a_moment() {
    use io::ErrorKind::{NotFound, PermissionDenied};
    let pwm = PwmFolder::new(&[
        ("period", NotFound),
        ("period", PermissionDenied),
        ("period", PermissionDenied),
    ]);
    pwm.until_written("enable 1");
    assert_eq!(pwm.recorder.written(), FIRST);
}

#[test]
fn files_that_stay_another_program_s_are_a_trouble_that_says_who_may_write_and_ends_with_it() {
    // More often than they are tried at one opening.
    let pwm = PwmFolder::new(&[("period", io::ErrorKind::PermissionDenied); 150]);
    pwm.until("a trouble", |pwm| {
        pwm.servo.trouble().is_some_and(|trouble| {
            trouble.contains("pwm1/period: ")
                && trouble.ends_with("who is in its group may write it (mostly gpio)")
        })
    });
    pwm.until_written("enable 1");
    assert_eq!(pwm.recorder.written(), FIRST);
    pwm.until("the end of the trouble", |pwm| {
        pwm.servo.trouble().is_none()
    });
}

#[test]
fn what_somebody_has_left_in_a_channel_is_undone() {
    let pwm = PwmFolder::new(&[("period", io::ErrorKind::InvalidInput)]);
    pwm.until_written("enable 1");
    let expected = [
        "export 1",
        "duty_cycle 0",
        "period 20000000",
        "duty_cycle 1500000",
        "enable 1",
    ];
    assert_eq!(pwm.recorder.written(), expected);
}

#[test]
fn a_pulse_that_the_chip_refuses_is_a_trouble_that_says_which_and_what_to_look_at() {
    for file in ["duty_cycle", "enable"] {
        let pwm = PwmFolder::new(&[(file, io::ErrorKind::InvalidInput); 3]);
        let place = format!("pwm1/{file}: ");
        pwm.until("a trouble", |pwm| {
            pwm.servo.trouble().is_some_and(|trouble| {
                let which = "; pulse 1500000 ns of 20000000 ns: does another program set period?";
                trouble.contains(&place) && trouble.contains(which)
            })
        });
        pwm.until_written("enable 1");
        pwm.until("the end of the trouble", |pwm| {
            pwm.servo.trouble().is_none()
        });
    }
}

#[test]
fn a_polarity_that_somebody_has_left_is_undone_while_no_pulse_is_given() {
    let left = |polarity: &str, refused| {
        let folder = tempfile::tempdir().unwrap();
        let channel = folder.path().join("pwm1");
        std::fs::create_dir(&channel).unwrap();
        for (file, text) in [
            ("period", "0"),
            ("duty_cycle", "0"),
            ("enable", "1"),
            ("polarity", polarity),
        ] {
            std::fs::write(channel.join(file), text).unwrap();
        }
        let recorder = Recorder::default();
        recorder.0.lock().unwrap().refused.extend(refused);
        let chip = Chip {
            folder: folder.path().to_owned(),
            channel: 1,
        };
        SysfsPwm::open(&chip, &Files::Recorded(recorder.clone()), |_| true).unwrap();
        recorder.written()
    };
    assert_eq!(left("normal\n", None), ["period 20000000"]);
    let expected = ["period 20000000", "polarity normal"];
    assert_eq!(left("inversed\n", None), expected);
    let expected = ["period 20000000", "enable 0", "polarity normal"];
    let busy = Some(("polarity", io::ErrorKind::ResourceBusy));
    assert_eq!(left("inversed\n", busy), expected);
}

#[test]
fn whether_a_channel_could_be_opened_is_seen_without_a_write() {
    let folder = tempfile::tempdir().unwrap();
    let could = |channel| {
        let driver = ServoDriver::Real(real(folder.path(), channel));
        Servo::could_be_opened(&driver)
    };
    let why = could(0).unwrap_err();
    assert!(why.contains(": it is no PWM chip; "), "{why}");
    std::fs::write(folder.path().join("export"), "").unwrap();
    std::fs::write(folder.path().join("npwm"), "2\n").unwrap();
    assert_eq!(could(1), Ok(()));
    let why = could(2).unwrap_err();
    assert!(why.ends_with("it has no channel 2; it has 0 to 1"), "{why}");
    std::fs::create_dir(folder.path().join("pwm0")).unwrap();
    let why = could(0).unwrap_err();
    assert!(why.contains("pwm0/period: "), "{why}");
    for file in ["period", "duty_cycle", "enable"] {
        std::fs::write(folder.path().join("pwm0").join(file), "7").unwrap();
    }
    assert_eq!(could(0), Ok(()));
    let left = std::fs::read_to_string(folder.path().join("pwm0/enable"));
    assert_eq!(left.unwrap(), "7");
}

#[test]
fn a_chip_without_the_channel_is_named_and_a_servo_that_comes_back_gets_its_pulse() {
    let pwm = PwmFolder::new(&[("export", io::ErrorKind::InvalidInput)]);
    pwm.until("a trouble", |pwm| {
        pwm.servo.trouble().is_some_and(|trouble| {
            trouble.ends_with("pwmchip0: it has no channel 1; it has 0 to 0")
        })
    });
    pwm.servo.steer(Angle::from_degrees(45.0));
    pwm.until_written("duty_cycle 1750000");
    assert_eq!(pwm.servo.trouble(), None);
    std::fs::remove_dir_all(pwm.chip.join("pwm1")).unwrap();
    pwm.servo.steer(Angle::from_degrees(-45.0));
    pwm.until("it is gone", |pwm| pwm.servo.trouble().is_some());
    pwm.until_written("duty_cycle 1250000");
}

#[test]
fn a_folder_that_is_no_chip_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for chip in [folder.path().join("pwmchip7"), folder.path().to_owned()] {
        let driver = ServoDriver::Real(real(&chip, 0));
        let servo = Servo::start(&driver, &look()).unwrap();
        let began = Instant::now();
        let place = format!("{}: it is no PWM chip", chip.display());
        let named = |trouble: String| trouble.starts_with(&place) && trouble.contains("`export`");
        while !servo.trouble().is_some_and(named) {
            assert!(began.elapsed() < SOON, "{:?}", servo.trouble());
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

#[test]
fn a_pin_is_refused_where_there_is_no_raspberry_pi() {
    if rppal::system::DeviceInfo::new().is_ok() {
        return;
    }
    let mut servo = real(Path::new("/nowhere"), 0);
    servo.output = ServoOutput::Gpio {
        pin: "GPIO18".to_owned(),
    };
    let servo = Servo::start(&ServoDriver::Real(servo), &look()).unwrap();
    let began = Instant::now();
    let named = |trouble: String| trouble == "GPIO18: this machine is no Raspberry Pi";
    while !servo.trouble().is_some_and(named) {
        assert!(began.elapsed() < SOON, "{:?}", servo.trouble());
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_sensor_that_is_fixed_is_never_turned() {
    let mut look = look();
    look.sensors.push(SensorMount {
        mount_deg: 180.0,
        ..SensorMount::default()
    });
    let pulses = Pulses::new(&real(Path::new("/nowhere"), 0), &look).unwrap();
    assert_eq!(pulses.to(Angle::from_degrees(180.0)), None);
    assert_eq!(pulses.at_rest(), Some(Duration::from_micros(1500)));
}
