//! The radio of a vehicle at a port that is not there, is none, is another program's, takes no bytes or has a silent module:
//! that is said, every beacon comes back, and as soon as the port is good beacons are sent. The module is played on a
//! pseudo-terminal.

use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use rustix::fs::{Mode, OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Action, tcflow};
use tomoswarm_proto::{Boot, VehicleId};

use super::*;
use crate::config::{self, XBEE_BAUDS, bundled};
use crate::hw::xbee_registers::{AP, BD, CH, ID, MY, ModuleKind, PL};
use crate::sim::noise::Noise;
use crate::sim::xbee_module::{ModuleOut, XbeeModule};

/// Whatever is waited for comes within this time.
const SOON: Duration = Duration::from_secs(20);
const BAUD: u32 = 115_200;

fn file(port: &Path) -> VehicleFile {
    let text = format!(
        "kind = \"vehicle\"\nvenue = \"courtyard.venue.toml\"\nid = 1\nstate_dir = \"state\"\nautopilot.driver = \"sim\"\n\
         range.driver = \"sim\"\nservo.driver = \"sim\"\nradio.driver = \"xbee\"\nradio.power_dbm = 8\nradio.xbee.port = {port:?}\n\
         world.connect = \"127.0.0.1:7500\"\nworld.token = \"secret-token\"\n"
    );
    config::read_vehicle("configs/v.toml", &text, &mut |path| bundled::load(path)).unwrap()
}

/// A module as the vehicle's file wants it.
fn module(file: &VehicleFile) -> XbeeModule {
    let wanted = ModuleSettings::of_venue(file.id, &file.venue, file.radio.power_dbm);
    let kind = ModuleKind::Xbee3;
    let powers = kind.powers_dbm();
    let level = powers.iter().position(|power| *power == wanted.power_dbm);
    let code = XBEE_BAUDS.iter().position(|known| *known == BAUD);
    let mut module = XbeeModule::new(kind, 0x0013_A200_4000_0001, Noise::new(5));
    for (name, value) in [
        (AP, u16::from(wanted.mode.register())),
        (BD, code.unwrap() as u16),
        (MY, wanted.address()),
        (ID, wanted.network),
        (CH, wanted.channel.into()),
        (PL, level.unwrap() as u16),
    ] {
        assert!(module.set_register(name, &value.to_be_bytes()), "{name}");
    }
    module.switch_on(Time::ZERO);
    module
}

/// A serial line, with nobody at its other end yet.
struct Line {
    main: OwnedFd,
    terminal: PathBuf,
}

impl Line {
    fn new() -> Line {
        let main = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&main).unwrap();
        unlockpt(&main).unwrap();
        fcntl_setfl(&main, OFlags::NONBLOCK).unwrap();
        let terminal = PathBuf::from(ptsname(&main, Vec::new()).unwrap().into_string().unwrap());
        Line { main, terminal }
    }

    /// Is found at a path.
    fn plug(&self, path: &Path) {
        std::os::unix::fs::symlink(&self.terminal, path).unwrap();
    }

    /// Holds the port's own end, without locking it.
    fn hold(&self) -> OwnedFd {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        rustix::fs::open(&self.terminal, flags, Mode::empty()).unwrap()
    }
}

/// A module at the other end of a line; dropping it unplugs the module, and the line goes with it.
struct Plugged {
    is_ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Plugged {
    fn start(line: Line, mut module: XbeeModule) -> Plugged {
        let is_ended = Arc::<AtomicBool>::default();
        let is_over = is_ended.clone();
        let thread = std::thread::spawn(move || {
            let (clock, mut bytes) = (Clock::start(), [0; 512]);
            while !is_over.load(Ordering::Acquire) {
                // Nothing there, or nobody has opened the port.
                let count = rustix::io::read(&line.main, &mut bytes).unwrap_or(0);
                if count > 0 {
                    module.open(BAUD);
                    module.write(clock.now(), &bytes[..count]);
                }
                let mut out = Vec::new();
                module.due(clock.now(), false, &mut out);
                for said in out {
                    if let ModuleOut::Host(bytes) = said {
                        let _ = rustix::io::write(&line.main, &bytes);
                    }
                }
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        Plugged {
            is_ended,
            thread: Some(thread),
        }
    }
}

impl Drop for Plugged {
    fn drop(&mut self) {
        self.is_ended.store(true, Ordering::Release);
        self.thread.take().unwrap().join().unwrap();
    }
}

/// The radio under test, and which beacons came back.
struct Driver {
    radio: XbeeRadio,
    file: VehicleFile,
    unsent: Arc<Mutex<Vec<u32>>>,
    /// Of its last beacon.
    number: u32,
}

impl Driver {
    fn start(port: &Path) -> Driver {
        let file = file(port);
        let crate::config::RadioDriver::Xbee(xbee) = &file.drivers.radio else {
            panic!("{:?}", file.drivers.radio);
        };
        let unsent = Arc::<Mutex<Vec<u32>>>::default();
        let back = unsent.clone();
        let events: EventSink = Arc::new(move |event| match event {
            Event::Unsent(number) => back.lock().unwrap().push(number),
            other => panic!("{other:?}"),
        });
        let radio = XbeeRadio::start(xbee, &file, Clock::start(), events).unwrap();
        Driver {
            radio,
            file,
            unsent,
            number: 0,
        }
    }

    fn transmit(&mut self) {
        self.number += 1;
        self.radio.transmit(&Beacon {
            sender: VehicleId(1),
            boot: Boot(1),
            sequence: self.number,
            channel: 15,
            power_dbm: 8,
            ..Beacon::default()
        });
    }

    /// Waits until its trouble is one with these words.
    fn until_said(&self, part: &str) {
        let began = Instant::now();
        loop {
            let trouble = self.radio.trouble();
            if trouble.as_ref().is_some_and(|said| said.contains(part)) {
                return;
            }
            assert!(began.elapsed() < SOON, "{part}: {trouble:?}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Sends a beacon, which comes back: the vehicle goes on, and nobody misses what never went on the air.
    fn gives_back(&mut self) {
        self.transmit();
        let began = Instant::now();
        while self.unsent.lock().unwrap().last() != Some(&self.number) {
            assert!(began.elapsed() < SOON, "{} did not come back", self.number);
            std::thread::sleep(Duration::from_millis(5));
        }
        assert_eq!(self.radio.health().sent, 0);
    }

    /// Sends beacons until one goes on the air.
    fn until_sent(&mut self) {
        let began = Instant::now();
        while self.radio.health().sent == 0 {
            self.transmit();
            assert!(began.elapsed() < SOON, "{:?}", self.radio.trouble());
            std::thread::sleep(Duration::from_millis(50));
        }
        assert_eq!(self.radio.trouble(), None);
    }

    /// A port that is no good is said so, and everything comes back; once a module is plugged in there beacons are sent.
    fn finds_module(&mut self, part: &str, port: &Path, clear: impl FnOnce()) {
        self.until_said(part);
        self.gives_back();
        let line = Line::new();
        clear();
        line.plug(port);
        let _plugged = Plugged::start(line, module(&self.file));
        self.until_sent();
    }
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("radio");
    (folder, port)
}

#[test]
fn a_port_that_is_missing_is_said_and_its_module_is_found_when_it_is_plugged_in() {
    let (_folder, port) = folder();
    let mut driver = Driver::start(&port);
    driver.until_said(port.to_str().unwrap());
    driver.finds_module("a serial port is needed", &port, || {});
}

#[test]
fn a_directory_or_a_file_in_place_of_a_port_is_said_and_what_replaces_it_is_found() {
    let (_folder, port) = folder();
    std::fs::create_dir(&port).unwrap();
    let remove = || std::fs::remove_dir(&port).unwrap();
    Driver::start(&port).finds_module("it is a directory, no serial port", &port, remove);
    std::fs::remove_file(&port).unwrap();
    std::fs::write(&port, "text").unwrap();
    let remove = || std::fs::remove_file(&port).unwrap();
    Driver::start(&port).finds_module("it is no serial port", &port, remove);
}

#[test]
fn a_port_that_another_program_uses_is_said_and_taken_when_that_has_ended() {
    let (_folder, port) = folder();
    let line = Line::new();
    line.plug(&port);
    let format = LineFormat::of_xbee(BAUD);
    let other = open(port.to_str().unwrap(), format, READ_FOR).unwrap();
    let mut driver = Driver::start(&port);
    driver.until_said("another program uses it");
    driver.gives_back();
    let _plugged = Plugged::start(line, module(&driver.file));
    driver.gives_back();
    drop(other);
    driver.until_sent();
}

#[test]
fn a_port_that_takes_no_bytes_is_said_and_used_again_when_it_does() {
    let (_folder, port) = folder();
    let line = Line::new();
    line.plug(&port);
    let end = line.hold();
    tcflow(&end, Action::OOff).unwrap();
    let mut driver = Driver::start(&port);
    driver.until_said("it takes no bytes");
    driver.gives_back();
    let _plugged = Plugged::start(line, module(&driver.file));
    driver.gives_back();
    driver.until_said("it takes no bytes");
    tcflow(&end, Action::OOn).unwrap();
    driver.until_sent();
    // Also one that has spoken before.
    tcflow(&end, Action::OOff).unwrap();
    let began = Instant::now();
    while driver.radio.trouble().is_none() {
        driver.transmit();
        assert!(began.elapsed() < SOON, "no trouble");
        std::thread::sleep(Duration::from_millis(50));
    }
    driver.until_said("it takes no bytes");
    tcflow(&end, Action::OOn).unwrap();
    let before = driver.radio.health().sent;
    let began = Instant::now();
    while driver.radio.health().sent == before {
        driver.transmit();
        assert!(began.elapsed() < SOON, "{:?}", driver.radio.trouble());
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_module_that_says_nothing_is_said_and_asked_again_until_it_answers() {
    let (_folder, port) = folder();
    let line = Line::new();
    line.plug(&port);
    let mut driver = Driver::start(&port);
    driver.until_said("the module does not answer");
    driver.gives_back();
    let _plugged = Plugged::start(line, module(&driver.file));
    driver.until_sent();
}
