//! Vehicles whose devices are not all simulated: a real process with a range sensor on a pseudo-terminal and all else
//! simulated, and one that has no range sensor.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use tomoswarm_proto::{Capability, Health, RangeSensorKind, State, VehicleId};

use crate::swarm::{Size, Swarm, Watch, vehicle};

/// A sensor that says a line twenty times a second while it is not mute, until it is dropped: then it is pulled out.
struct Sensor {
    is_mute: Arc<AtomicBool>,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Makes a serial port that has this path; what is written into it comes out there.
pub fn serial_port(path: &Path) -> File {
    let port = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&port).unwrap();
    unlockpt(&port).unwrap();
    let _ = std::fs::remove_file(path);
    let terminal = ptsname(&port, Vec::new()).unwrap().into_string().unwrap();
    std::os::unix::fs::symlink(terminal, path).unwrap();
    File::from(port)
}

impl Sensor {
    fn plug(path: &Path, line: &'static [u8]) -> Sensor {
        let [is_mute, is_over] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let (mute, seen, mut port) = (is_mute.clone(), is_over.clone(), serial_port(path));
        let thread = std::thread::spawn(move || {
            while !seen.load(Ordering::Relaxed) {
                if !mute.load(Ordering::Relaxed) {
                    port.write_all(line).unwrap();
                }
                std::thread::sleep(Duration::from_millis(50));
            }
        });
        Sensor {
            is_mute,
            is_over,
            thread: Some(thread),
        }
    }
}

impl Drop for Sensor {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
    }
}

fn health(watch: &Watch, id: u8) -> Option<&Health> {
    Some(&watch.view.vehicle(VehicleId(id))?.health.as_ref()?.value)
}

fn state(watch: &Watch, id: u8) -> Option<&State> {
    watch.view.state(VehicleId(id)).map(|state| &state.value)
}

/// Returns whether a vehicle has a range sensor of this kind, by its own word.
fn has_range(watch: &Watch, id: u8, kind: Option<RangeSensorKind>) -> bool {
    let hello = watch
        .view
        .vehicle(VehicleId(id))
        .and_then(|view| view.hello.as_ref());
    hello.is_some_and(|hello| {
        let kinds = hello.value.capabilities.iter().filter_map(|one| match one {
            Capability::RangeSensor(kind) => Some(*kind),
            _ => None,
        });
        !hello.value.capabilities.is_empty() && kinds.collect::<Vec<_>>() == Vec::from_iter(kind)
    })
}

fn has_mapped(watch: &Watch, id: u8) -> bool {
    let digest = watch.digests.get(&vehicle(id));
    digest.is_some_and(|(_, digest)| {
        digest
            .layers
            .iter()
            .any(|layer| layer.layer.vehicle == VehicleId(id))
    })
}

fn away_m(watch: &Watch, id: u8, home: [f64; 2]) -> f64 {
    let at = state(watch, id).unwrap().pose.unwrap().at;
    (at.x_m() - home[0]).hypot(at.y_m() - home[1])
}

/// Writes the file of a vehicle anew: its range sensor is read by another driver, and is fixed.
pub fn with_range(swarm: &Swarm, id: u8, range: &str) {
    let name = format!("vehicle-{id}.toml");
    let text = std::fs::read_to_string(swarm.path(&name)).unwrap();
    let text = text.replace("[range]\ndriver = \"sim\"\n", range);
    swarm.write(
        &name,
        &text.replace(
            "[servo]\ndriver = \"sim\"\n",
            "[servo]\ndriver = \"none\"\n",
        ),
    );
}

/// Waits until vehicle 1 says that something is wrong with its range sensor, or that nothing is; returns after how long.
fn until_said(swarm: &Swarm, is_wrong: bool) -> Duration {
    let began = Instant::now();
    loop {
        let is_said = swarm.look(|watch| {
            let mut troubles = health(watch, 1)?.troubles.iter();
            Some(troubles.any(|trouble| trouble.starts_with("range sensor")))
        });
        if is_said == Some(is_wrong) {
            return began.elapsed();
        }
        assert!(began.elapsed() < Duration::from_secs(20), "it is not said");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Returns the one in the middle: single ones are left to a busy machine.
pub fn median(mut times: Vec<Duration>) -> Duration {
    times.sort();
    times[times.len() / 2]
}

#[test]
fn a_sensor_that_falls_silent_or_is_pulled_out_is_missed_soon() {
    let mut swarm = Swarm::prepare(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    let port = swarm.path("sensor");
    let settings = "scan_period_s = 0.1\nsettle_s = 0.01\nhalf_angle_deg = 30.0\n";
    let table = format!("[range.serial-text]\nport = \"{}\"\n", port.display());
    with_range(
        &swarm,
        1,
        &format!("[range]\ndriver = \"serial-text\"\n{settings}{table}"),
    );
    let mut sensor = Sensor::plug(&port, b"R5000\r");
    swarm.run();
    let (mut silent_after, mut gone_after) = (Vec::new(), Vec::new());
    for turn in 0..5 {
        until_said(&swarm, false);
        // At any moment between the looks of every second.
        std::thread::sleep(Duration::from_millis(1500 + 170 * turn));
        sensor.is_mute.store(true, Ordering::Relaxed);
        let silent = until_said(&swarm, true);
        sensor.is_mute.store(false, Ordering::Relaxed);
        until_said(&swarm, false);
        std::thread::sleep(Duration::from_millis(300 + 170 * turn));
        drop(sensor);
        let gone = until_said(&swarm, true);
        sensor = Sensor::plug(&port, b"R5000\r");
        swarm.note(&format!(
            "silent: missed after {silent:?}; pulled out: missed after {gone:?}"
        ));
        silent_after.push(silent);
        gone_after.push(gone);
    }
    // The ninth ping without an answer, or the one after it, shows that it is silent, a second after the last one with an
    // answer at most; any ping shows that it is gone. With the looks of every second alone it would take half a second more.
    let [silent, gone] = [silent_after, gone_after].map(median);
    assert!(silent < Duration::from_millis(1250), "{silent:?}");
    assert!(gone < Duration::from_millis(300), "{gone:?}");
    swarm.end_in_order();
}

#[test]
fn a_real_sensor_drives_a_simulated_body_and_without_one_nobody_drives() {
    let mut swarm = Swarm::prepare(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    let port = swarm.path("sensor");
    let table = format!("[range.serial-text]\nport = \"{}\"\n", port.display());
    // Two readings a round are there to be taken; a narrower cone would hear no wall beside the vehicle.
    let settings = "scan_period_s = 0.15\nsettle_s = 0.01\nhalf_angle_deg = 30.0\n";
    with_range(
        &swarm,
        1,
        &format!("[range]\ndriver = \"serial-text\"\n{settings}{table}"),
    );
    with_range(&swarm, 2, "[range]\ndriver = \"none\"\n");
    let sensor = Sensor::plug(&port, b"R5000\r");
    swarm.run();
    swarm.until("both say what they have", 30, |watch| {
        has_range(watch, 1, Some(RangeSensorKind::SerialText)) && has_range(watch, 2, None)
    });
    swarm.until("what the sensor says is on the map", 20, |watch| {
        has_mapped(watch, 1)
    });
    let is_sound =
        |watch: &Watch| health(watch, 1).is_some_and(|health| health.troubles.is_empty());
    swarm.until("all is well", 20, is_sound);
    // What one is heard of first is chance.
    swarm.until("both have told their health", 20, |watch| {
        health(watch, 2).is_some()
    });
    swarm.look(|watch| {
        assert!(!has_mapped(watch, 2), "it sees nothing");
        assert_eq!(health(watch, 2).unwrap().range, None);
        assert_eq!(health(watch, 1).unwrap().range.unwrap().glitches, 0);
    });
    // On a machine that has much else to do it takes longer until everybody is heard.
    let preflight = swarm.tool(&[
        "preflight",
        "operator.toml",
        "--vehicles",
        "1,2",
        "--for",
        "12",
    ]);
    let mut devices = preflight.lines().filter(|line| line.contains("devices"));
    let is_refused = devices.any(|line| {
        let says = ["vehicle 2", "NO-GO", "no range sensor: it sees nothing"];
        says.into_iter().all(|words| line.contains(words))
    });
    assert!(is_refused, "{preflight}");
    swarm.begin();
    // Longer than a simulated autopilot drives without a word of its companion.
    swarm.until("the one that sees drives", 90, |watch| {
        away_m(watch, 1, [-1.5, -1.5]) > 2.0
    });
    swarm.look(|watch| {
        assert!(
            away_m(watch, 2, [7.5, -1.5]) < 0.3,
            "the blind one has moved"
        )
    });
    drop(sensor);
    let is_gone = |trouble: &String| {
        trouble.starts_with("range sensor: ") && trouble.contains("opened once before")
    };
    swarm.until("the sensor is missed", 10, |watch| {
        health(watch, 1).unwrap().troubles.iter().any(is_gone)
    });
    let _sensor = Sensor::plug(&port, b"\xff\rR5000\r");
    swarm.until(
        "it is back, and what it says besides is counted",
        15,
        |watch| is_sound(watch) && health(watch, 1).unwrap().range.unwrap().glitches > 0,
    );
    swarm.end_in_order();
    let output = swarm.log_of(vehicle(2));
    assert!(
        output.contains("there is no range sensor: this vehicle sees nothing, and is not driven"),
        "{output}"
    );
}
