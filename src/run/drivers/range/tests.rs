//! A range sensor on a serial line, played on a pseudo-terminal: what is read, what is dropped, and what happens when it is
//! pulled out and plugged in again.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::*;
use crate::config::{SensorMount, SerialProtocol, SerialSensor, SerialText, TfSensor};
use crate::node::Event;
use crate::node::sensor::Echo;

/// Whatever is waited for comes within this time.
const SOON: Duration = Duration::from_secs(20);

/// A sensor: what it says comes out of a terminal.
struct Sensor {
    line: File,
    terminal: PathBuf,
}

impl Sensor {
    /// Plugs a sensor in, so that it is found at a path.
    fn plug(path: &Path) -> Sensor {
        let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&line).unwrap();
        unlockpt(&line).unwrap();
        let terminal = PathBuf::from(ptsname(&line, Vec::new()).unwrap().into_string().unwrap());
        let sensor = Sensor {
            line: File::from(line),
            terminal,
        };
        sensor.link(path);
        sensor
    }

    fn link(&self, path: &Path) {
        // What stood there before may be gone already.
        let _ = std::fs::remove_file(path);
        std::os::unix::fs::symlink(&self.terminal, path).unwrap();
    }

    fn say(&mut self, bytes: &[u8]) {
        self.line.write_all(bytes).unwrap();
    }
}

/// The driver under test and what it has told.
struct Driver {
    range: Range,
    echoes: Arc<Mutex<Vec<Echo>>>,
    pings: u64,
}

impl Driver {
    fn start(port: &Path) -> Driver {
        let sensor = SerialSensor {
            port: port.to_str().unwrap().to_owned(),
            baud: 9600,
            protocol: SerialProtocol::Text(SerialText::default()),
        };
        Driver::of(&RangeDriver::Serial(sensor))
    }

    fn of(driver: &RangeDriver) -> Driver {
        let drivers = Drivers {
            range: driver.clone(),
            ..Drivers::SIMULATED
        };
        Driver::with(&drivers, Vec::new())
    }

    fn with(drivers: &Drivers, sensors: Vec<SensorMount>) -> Driver {
        let echoes = Arc::<Mutex<Vec<Echo>>>::default();
        let heard = echoes.clone();
        let events: EventSink = Arc::new(move |event| match event {
            Event::Echo(echo) => heard.lock().unwrap().push(echo),
            other => panic!("{other:?}"),
        });
        let look = SensorCoverage {
            min_range_m: 0.3,
            max_range_m: 4.0,
            sensors,
            ..SensorCoverage::default()
        };
        let range = Range::start(drivers, &look, Clock::start(), &events).unwrap();
        Driver {
            range,
            echoes,
            pings: 0,
        }
    }

    fn ping(&mut self) {
        self.pings += 1;
        self.range.ping(Ping { number: self.pings });
    }

    fn echoes(&self) -> Vec<Echo> {
        self.echoes.lock().unwrap().clone()
    }

    /// Asks and lets the sensor say a line, until it answers; returns the answer to the last ping.
    fn measure(&mut self, sensor: &mut Sensor, line: &[u8]) -> Option<f64> {
        let began = Instant::now();
        loop {
            self.ping();
            std::thread::sleep(Duration::from_millis(20));
            sensor.say(line);
            std::thread::sleep(Duration::from_millis(20));
            let echo = self.echoes().pop();
            if let Some(echo) = echo.filter(|echo| echo.number == self.pings) {
                return echo.range_m;
            }
            assert!(began.elapsed() < SOON, "no answer: {:?}", self.trouble());
        }
    }

    /// What is wrong with the first sensor that is not in order.
    fn trouble(&self) -> Option<String> {
        self.range.troubles().next().map(|(_, what)| what)
    }

    fn until_trouble(&self, is_it: impl Fn(Option<&str>) -> bool) -> Duration {
        let began = Instant::now();
        while !is_it(self.trouble().as_deref()) {
            assert!(began.elapsed() < SOON, "still {:?}", self.trouble());
            std::thread::sleep(Duration::from_millis(5));
        }
        began.elapsed()
    }

    fn until_open(&self) -> Duration {
        self.until_trouble(|trouble| trouble.is_none())
    }

    fn glitches(&self) -> u64 {
        self.range.health().unwrap().glitches
    }
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("sensor");
    (folder, port)
}

#[test]
fn a_reading_answers_the_ping_before_it_and_the_farthest_one_says_that_nothing_is_there() {
    let (_folder, port) = folder();
    let mut sensor = Sensor::plug(&port);
    let mut driver = Driver::start(&port);
    assert_eq!(driver.measure(&mut sensor, b"R1234\r"), Some(1.234));
    assert_eq!(driver.measure(&mut sensor, b"R0500\r"), Some(0.5));
    assert_eq!(driver.measure(&mut sensor, b"R5000\r"), None);
    assert_eq!(
        driver.measure(&mut sensor, b"R0300\rR0750\r"),
        Some(0.75),
        "the newest counts"
    );
    let answered = driver.echoes().len() as u64;
    let health = driver.range.health().unwrap();
    assert_eq!(
        (health.glitches, health.faults),
        (0, driver.pings - answered)
    );
}

#[test]
fn a_lidar_answers_a_ping_and_what_it_does_not_trust_says_nothing() {
    let (_folder, port) = folder();
    let mut sensor = Sensor::plug(&port);
    let mut driver = Driver::of(&RangeDriver::Serial(SerialSensor {
        port: port.to_str().unwrap().to_owned(),
        baud: 115_200,
        protocol: SerialProtocol::Tf(TfSensor::Luna),
    }));
    // 1.00 m, strength 1000; the same with strength 50; 9.00 m, strength 1000.
    let near = [0x59, 0x59, 0x64, 0x00, 0xE8, 0x03, 0x68, 0x09, 0x72];
    let weak = [0x59, 0x59, 0x64, 0x00, 0x32, 0x00, 0x68, 0x09, 0xB9];
    let far = [0x59, 0x59, 0x84, 0x03, 0xE8, 0x03, 0x68, 0x09, 0x95];
    assert_eq!(driver.measure(&mut sensor, &near), Some(1.0));
    assert_eq!(driver.measure(&mut sensor, &far), None);
    let before = driver.echoes().len();
    driver.ping();
    sensor.say(&weak);
    let began = Instant::now();
    while driver.glitches() == 0 && began.elapsed() < SOON {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!((driver.glitches(), driver.echoes().len()), (1, before));
}

#[test]
fn what_was_said_before_the_ping_never_answers_it() {
    let (_folder, port) = folder();
    let mut sensor = Sensor::plug(&port);
    let mut driver = Driver::start(&port);
    driver.measure(&mut sensor, b"R1000\r");
    driver.echoes.lock().unwrap().clear();
    for _ in 0..40 {
        // It lies in the port's queue when the ping comes, or has just been read; every earlier ping has its answer.
        sensor.say(b"R2000\r");
        driver.ping();
        std::thread::sleep(Duration::from_millis(15));
        let began = Instant::now();
        while driver
            .echoes()
            .last()
            .is_none_or(|echo| echo.number != driver.pings)
        {
            sensor.say(b"R1000\r");
            std::thread::sleep(Duration::from_millis(2));
            assert!(began.elapsed() < SOON, "no answer");
        }
    }
    // The kernel hands bytes from one end of a pseudo-terminal to the other by a worker of its own, on a busy machine at
    // times after the ping; who takes old readings takes nearly all.
    let old = driver
        .echoes()
        .iter()
        .filter(|echo| echo.range_m == Some(2.0))
        .count();
    assert!(old <= 4, "{old} of 40");
}

#[test]
fn a_sensor_is_pulled_out_and_plugged_in_again() {
    let (_folder, port) = folder();
    let mut sensor = Sensor::plug(&port);
    let mut driver = Driver::start(&port);
    driver.measure(&mut sensor, b"R1000\r");
    for round in 1..=3 {
        drop(sensor);
        let gone = driver.until_trouble(|trouble| trouble.is_some());
        assert!(gone < Duration::from_secs(2), "{gone:?}");
        let trouble = driver.trouble().unwrap();
        let opened = if round == 1 {
            "once".to_owned()
        } else {
            format!("{round} times")
        };
        assert!(
            trouble.contains("sensor: ") && trouble.ends_with(&format!("opened {opened} before")),
            "{trouble}"
        );
        let before = driver.echoes().len();
        driver.ping();
        sensor = Sensor::plug(&port);
        let opened = driver.until_open();
        assert!(opened < Duration::from_secs(2), "{opened:?}");
        assert_eq!(driver.echoes().len(), before, "nothing was said");
        // The end of a line whose beginning nobody heard is no reading.
        sensor.say(b"R0400");
        sensor.say(b"\r");
        std::thread::sleep(Duration::from_millis(30));
        assert_eq!(driver.echoes().len(), before);
        assert_eq!(driver.measure(&mut sensor, b"R2000\r"), Some(2.0));
    }
}

#[test]
fn a_port_that_is_not_there_or_none_is_named_and_found_when_it_comes() {
    let (folder, port) = folder();
    let mut driver = Driver::start(&port);
    let named = port.to_str().unwrap().to_owned();
    driver.until_trouble(|trouble| {
        trouble
            .is_some_and(|trouble| trouble.starts_with(&named) && trouble.contains("No such file"))
    });
    let mut sensor = Sensor::plug(&port);
    driver.until_open();
    assert_eq!(driver.measure(&mut sensor, b"R1000\r"), Some(1.0));
    std::fs::write(folder.path().join("file"), "R1000\r").unwrap();
    for (path, wrong) in [
        (
            folder.path().to_owned(),
            "it is a directory, no serial port",
        ),
        (folder.path().join("file"), "it is no serial port"),
        (PathBuf::from("/dev/null"), "it is no serial port"),
    ] {
        let driver = Driver::start(&path);
        driver.until_trouble(|trouble| trouble.is_some_and(|trouble| trouble.contains(wrong)));
    }
}

#[test]
fn a_port_has_one_reader_and_the_next_one_gets_it_when_that_has_ended() {
    let (_folder, port) = folder();
    let mut sensor = Sensor::plug(&port);
    let mut first = Driver::start(&port);
    first.measure(&mut sensor, b"R1000\r");
    let mut second = Driver::start(&port);
    second.until_trouble(|trouble| {
        trouble.is_some_and(|trouble| trouble.contains("another program uses it"))
    });
    second.ping();
    assert_eq!(first.measure(&mut sensor, b"R1500\r"), Some(1.5));
    assert_eq!(second.echoes(), []);
    drop(first);
    second.until_open();
    assert_eq!(second.measure(&mut sensor, b"R2500\r"), Some(2.5));
}

#[test]
fn rubbish_is_counted_and_the_next_reading_comes_through() {
    let (_folder, port) = folder();
    let mut sensor = Sensor::plug(&port);
    let mut driver = Driver::start(&port);
    driver.measure(&mut sensor, b"R1000\r");
    let mut rubbish = vec![b'7'; 10_000];
    rubbish.extend(b"\r-1\rNaN\rR12\rR0001\r99999999999999999999\r\xff\xfe\x00\x7f\r");
    rubbish.extend(
        (0..=255)
            .filter(|byte| !matches!(byte, b'\r' | b'\n'))
            .cycle()
            .take(120),
    );
    rubbish.extend(b"\r");
    driver.ping();
    std::thread::sleep(Duration::from_millis(30));
    let before = driver.echoes().len();
    sensor.say(&rubbish);
    let began = Instant::now();
    while driver.glitches() < 8 && began.elapsed() < SOON {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!((driver.glitches(), driver.echoes().len()), (8, before));
    assert_eq!(driver.measure(&mut sensor, b"R3000\r"), Some(3.0));
}

#[test]
fn a_sensor_that_says_nothing_is_silent_and_no_echo_is_made_of_it() {
    let (_folder, port) = folder();
    let mut sensor = Sensor::plug(&port);
    let mut driver = Driver::start(&port);
    driver.until_open();
    sensor.say(b"\rno such thing\r");
    let began = Instant::now();
    while began.elapsed() < Duration::from_millis(3300) {
        driver.ping();
        std::thread::sleep(Duration::from_millis(50));
    }
    let trouble = driver.trouble().unwrap();
    assert!(
        trouble.starts_with("it answers nothing; ") && trouble.contains("1 unreadable"),
        "{trouble}"
    );
    assert_eq!(
        (driver.range.health().unwrap().faults, driver.echoes()),
        (driver.pings - 1, vec![])
    );
    driver.measure(&mut sensor, b"R1000\r");
    assert_eq!(driver.trouble(), None);
}

#[test]
fn a_vehicle_without_a_range_sensor_answers_nothing_and_misses_nothing() {
    let mut driver = Driver::of(&RangeDriver::None);
    driver.ping();
    assert_eq!(
        (driver.range.health(), driver.trouble(), driver.echoes()),
        (None, None, vec![])
    );
}

#[test]
fn of_several_sensors_the_one_that_looks_there_answers() {
    let folder = tempfile::tempdir().unwrap();
    let ports = ["ahead", "left"].map(|name| folder.path().join(name));
    let [mut ahead, mut left] = [Sensor::plug(&ports[0]), Sensor::plug(&ports[1])];
    let read = |port: &Path, protocol: SerialProtocol| {
        RangeDriver::Serial(SerialSensor {
            port: port.to_str().unwrap().to_owned(),
            baud: 9600,
            protocol,
        })
    };
    let drivers = Drivers {
        range: read(&ports[0], SerialProtocol::Text(SerialText::default())),
        own_range: vec![
            None,
            Some(read(&ports[1], SerialProtocol::Tf(TfSensor::Luna))),
        ],
        ..Drivers::SIMULATED
    };
    let mount = |mount_deg| SensorMount {
        mount_deg,
        ..SensorMount::default()
    };
    let mut driver = Driver::with(&drivers, vec![mount(0.0), mount(90.0)]);
    // Two metres, amplitude 500, 25 degrees.
    let lidar = [0x59, 0x59, 200, 0, 0xF4, 1, 0x48, 8];
    let sum = lidar.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    let frame = [&lidar[..], &[sum]].concat();
    for _ in 0..2 {
        driver.range.steer(Angle::from_degrees(90.0));
        left.say(&[]);
        assert_eq!(driver.measure(&mut left, &frame), Some(2.0));
        driver.range.steer(Angle::ZERO);
        assert_eq!(driver.measure(&mut ahead, b"R1500\r"), Some(1.5));
    }
    // What is not asked does not answer for the other.
    let count = driver.echoes().len();
    driver.ping();
    left.say(&frame);
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(driver.echoes().len(), count);
    drop(left);
    std::fs::remove_file(&ports[1]).unwrap();
    driver.until_trouble(|said| said.is_some_and(|said| said.starts_with("at 90°: ")));
    driver.range.steer(Angle::ZERO);
    assert_eq!(driver.measure(&mut ahead, b"R1600\r"), Some(1.6));
    drop(ahead);
    driver.until_trouble(|said| said.is_some_and(|said| said.starts_with("at 0°: ")));
    let in_trouble: Vec<usize> = driver.range.troubles().map(|(nth, _)| nth).collect();
    assert_eq!(in_trouble, [0, 1], "each by itself");
}
