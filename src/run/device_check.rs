//! Looks at the devices of a vehicle without its node: opens each, asks it once, and says what it answers. Nothing moves unless
//! that is asked for, no beacon is sent, and no register is written.
//!
//! Simulated devices are named and not looked at.

#[cfg(test)]
mod tests;

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use super::clock::Clock;
use super::drivers::EventSink;
use super::drivers::autopilot::Autopilot;
use super::drivers::radio::xbee_tool;
use super::drivers::range::{Range, record_edges};
use super::drivers::servo::{Servo, ServoPlace, WantedPulse};
use super::drivers::usb_adapter::{self, USB_SERIAL};
use super::state_dir;
use crate::config::{
    AutopilotDriver, HcSr04Lines, RadioDriver, RangeDriver, VehicleFile, XbeePort,
};
use crate::hw::edge_recording::{EdgeRecording, in_words};
use crate::hw::xbee_registers::{Mismatches, ModuleSettings};
use crate::node::Event;
use crate::node::sensor::{Echo, Ping};

/// A device is there when it answers within this time.
const ANSWERS_WITHIN: Duration = Duration::from_secs(5);
/// It is looked at this often.
const LOOKS_EVERY: Duration = Duration::from_millis(20);
/// From one ping to the next.
const PING_EVERY: Duration = Duration::from_millis(200);
/// A servo has settled so long after it has turned.
const SETTLES: Duration = Duration::from_millis(300);

/// What is done beside looking.
#[derive(Clone, Debug, Default)]
pub struct DeviceCheck {
    /// The servo swings once, from one end to the other and back.
    pub moves: bool,
    /// A folder that gets what the echo lines of ultrasonic sensors do.
    pub record_edges: Option<PathBuf>,
}

/// One device.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DeviceFound {
    /// Which one.
    pub device: String,
    /// What it answers, or why it does not.
    pub answer: Result<String, String>,
}

impl DeviceCheck {
    /// Looks at all devices of a vehicle, one after the other; `found` is told of each.
    ///
    /// # Errors
    /// The vehicle is running: its devices are its own. No thread can be started, or a recording cannot be written.
    pub fn run(&self, file: &VehicleFile, found: &mut dyn FnMut(DeviceFound)) -> io::Result<()> {
        let mut say = |device: String, answer| found(DeviceFound { device, answer });
        match state_dir::is_in_use(Path::new(&file.state_dir)) {
            Ok(false) => {}
            Ok(true) => return Err(io::Error::other(running(&file.state_dir))),
            Err(error) => say("vehicle".to_owned(), Ok(unknown(&file.state_dir, &error))),
        }
        for (index, lines) in ultrasonic(file) {
            if let Some(folder) = &self.record_edges {
                let recording = record_edges(lines);
                let device = format!("echo line of range sensor {}", index + 1);
                say(device, written(recording, folder, index)?);
            }
        }
        let clock = Clock::start();
        let (sender, events) = channel();
        let sink: EventSink = Arc::new(move |event| {
            // Nobody listens at the end.
            let _ = sender.send(event);
        });
        let range = Range::start(&file.drivers, &file.look, clock, &sink)?;
        let autopilot = Autopilot::start(file, clock, &sink, range.on_autopilot())?;
        say("autopilot".to_owned(), look_at_autopilot(file, &autopilot));
        for sensor in 0..range.count() {
            let driver = file.drivers.range_of(sensor).in_words();
            let device = format!("range sensor {} ({driver})", sensor + 1);
            say(device, look_at_sensor(file, &range, sensor, &events));
        }
        let device = format!("servo ({})", file.drivers.servo.in_words());
        say(device, self.look_at_servo(file, &autopilot)?);
        say(
            "radio".to_owned(),
            look_at_radio(file, Path::new(USB_SERIAL)),
        );
        Ok(())
    }

    fn look_at_servo(
        &self,
        file: &VehicleFile,
        autopilot: &Autopilot,
    ) -> io::Result<Result<String, String>> {
        match ServoPlace::of(&file.drivers.servo) {
            ServoPlace::Nowhere => return Ok(Ok("none".to_owned())),
            ServoPlace::World => return Ok(Ok(SIMULATED.to_owned())),
            ServoPlace::Autopilot if !self.moves => {
                return Ok(Ok("not asked, since that would move it (--move)".to_owned()));
            }
            // Opening it would stop its pulses, and let the sensor swing.
            ServoPlace::Machine if !self.moves => {
                let could = Servo::could_be_opened(&file.drivers.servo);
                return Ok(
                    could.map(|()| "it could be opened, and was left as it is (--move)".to_owned())
                );
            }
            ServoPlace::Autopilot | ServoPlace::Machine => {}
        }
        let servo = Servo::start_still(&file.drivers.servo, &file.look)?;
        let is_open = until(|| servo.trouble().is_none());
        if let (false, Some(trouble)) = (is_open, servo.trouble()) {
            return Ok(Err(trouble));
        }
        Ok(swing(file, &servo, autopilot))
    }
}

fn running(state_dir: &str) -> String {
    format!(
        "{state_dir} is in use: the vehicle is running, and its devices are its own; stop it first (systemctl stop \
         tomoswarm-vehicle)"
    )
}

fn unknown(state_dir: &str, error: &io::Error) -> String {
    format!(
        "whether it is running is not known ({state_dir}: {error}); its own user can see that (runuser -u tomoswarm)"
    )
}

const SIMULATED: &str = "simulated, not looked at";

/// Returns the ultrasonic sensors, with their numbers.
fn ultrasonic(file: &VehicleFile) -> impl Iterator<Item = (usize, &HcSr04Lines)> {
    let count = file.look.sensors.len().max(1);
    (0..count).filter_map(move |sensor| match file.drivers.range_of(sensor) {
        RangeDriver::HcSr04(lines) => Some((sensor, lines)),
        RangeDriver::Simulated
        | RangeDriver::Serial(_)
        | RangeDriver::Autopilot(_)
        | RangeDriver::None => None,
    })
}

/// Writes a recording into a folder; what is there stays.
fn written(
    recording: Result<EdgeRecording, String>,
    folder: &Path,
    sensor: usize,
) -> io::Result<Result<String, String>> {
    let recording = match recording {
        Ok(recording) => recording,
        Err(why) => return Ok(Err(why)),
    };
    let path = folder.join(format!("recorded-{}.txt", sensor + 1));
    let in_words = |error: io::Error| {
        let why = format!("{}: {error}", path.display());
        io::Error::new(error.kind(), why)
    };
    std::fs::create_dir_all(folder).map_err(in_words)?;
    let new = OpenOptions::new().write(true).create_new(true).open(&path);
    let text = recording.to_text();
    new.and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(in_words)?;
    let pings = recording.pings.len();
    Ok(Ok(format!(
        "{pings} pings in {}: {}",
        path.display(),
        answers(&recording)
    )))
}

fn answers(recording: &EdgeRecording) -> String {
    let all = recording.answers().into_iter().flatten().map(in_words);
    all.collect::<Vec<String>>().join(" ")
}

fn look_at_autopilot(file: &VehicleFile, autopilot: &Autopilot) -> Result<String, String> {
    let connection = match &file.drivers.autopilot {
        AutopilotDriver::Simulated => return Ok(SIMULATED.to_owned()),
        AutopilotDriver::Mavlink(connection) => connection.endpoint.in_words(),
    };
    if !until(|| autopilot.health().is_some()) {
        let why = autopilot.trouble();
        return Err(why.unwrap_or_else(|| format!("{connection}: it says nothing")));
    }
    let health = autopilot.health().unwrap_or_default();
    let firmware = match health.firmware.as_str() {
        "" => String::new(),
        firmware => format!(" of firmware {firmware}"),
    };
    let volts = health.battery_mv.map(|battery_mv| {
        let volts = f64::from(battery_mv) * 1e-3;
        format!(", {volts:.1} V")
    });
    let trouble = autopilot.trouble().map(|trouble| format!("; {trouble}"));
    Ok(format!(
        "{connection}: a heartbeat{firmware}{}{}",
        volts.unwrap_or_default(),
        trouble.unwrap_or_default()
    ))
}

fn look_at_sensor(
    file: &VehicleFile,
    range: &Range,
    sensor: usize,
    events: &Receiver<Event>,
) -> Result<String, String> {
    match file.drivers.range_of(sensor) {
        RangeDriver::Simulated => return Ok(SIMULATED.to_owned()),
        RangeDriver::None => return Ok("none: the vehicle is not driven".to_owned()),
        RangeDriver::Serial(_) | RangeDriver::HcSr04(_) | RangeDriver::Autopilot(_) => {}
    }
    range.aim(sensor);
    let began = Instant::now();
    let first = 1_000_000 * (sensor as u64 + 1);
    for number in first.. {
        range.ping(Ping { number });
        if let Some(range_m) = echo(events, number) {
            return Ok(match range_m {
                Some(range_m) => format!("{range_m:.2} m"),
                None => "it hears nothing within its range".to_owned(),
            });
        }
        if began.elapsed() > ANSWERS_WITHIN {
            break;
        }
    }
    let why = range.trouble_of(sensor);
    Err(why.unwrap_or_else(|| "it answers nothing".to_owned()))
}

/// Waits for the echo of a ping.
fn echo(events: &Receiver<Event>, asked: u64) -> Option<Option<f64>> {
    let until = Instant::now() + PING_EVERY;
    loop {
        let left = until.saturating_duration_since(Instant::now());
        match events.recv_timeout(left).ok()? {
            Event::Echo(Echo { number, range_m }) if number == asked => return Some(range_m),
            _ => {}
        }
    }
}

/// Turns the servo to both ends and back.
fn swing(file: &VehicleFile, servo: &Servo, autopilot: &Autopilot) -> Result<String, String> {
    let mounts = file.look.mounts();
    let turned = mounts.all().iter();
    let Some(mount) = turned.clone().find(|mount| mount.from_rad != mount.to_rad) else {
        return Ok("open; it turns no sensor".to_owned());
    };
    for offset_rad in [mount.from_rad, mount.to_rad, mount.rest_rad()] {
        let pulse = servo.steer(mount.beam(offset_rad));
        if let Some(WantedPulse::Autopilot(pulse)) = pulse {
            let is_given = || {
                // One that was confirmed late is given once it is wanted again.
                autopilot.give_pulse(pulse);
                autopilot.given_pulse() == Some(pulse)
            };
            if !until(is_given) {
                let why = autopilot.servo_trouble();
                return Err(why.unwrap_or_else(|| "its pulse is not confirmed".to_owned()));
            }
        }
        std::thread::sleep(mount.slew(mount.from_rad, mount.to_rad) + SETTLES);
        if let Some(trouble) = servo.trouble() {
            return Err(trouble);
        }
    }
    let late = autopilot.servo_trouble();
    Ok(format!(
        "told to turn to {:.0}°, {:.0}° and back: see whether it did{}",
        mount.from_rad.to_degrees(),
        mount.to_rad.to_degrees(),
        late.map(|late| format!("; {late}")).unwrap_or_default()
    ))
}

/// Asks the radio for its registers; `adapters` is the folder in which the kernel has the ports of USB adapters.
fn look_at_radio(file: &VehicleFile, adapters: &Path) -> Result<String, String> {
    let xbee = match &file.drivers.radio {
        RadioDriver::Simulated => return Ok(SIMULATED.to_owned()),
        RadioDriver::Xbee(xbee) => xbee,
    };
    let answer = look_at_registers(file, xbee);
    let Some(delay) = usb_adapter::delay_in_words(&xbee.port, adapters) else {
        return answer;
    };
    let warned = |said: String| format!("{said}; warning: {delay}");
    answer.map(warned).map_err(warned)
}

fn look_at_registers(file: &VehicleFile, xbee: &XbeePort) -> Result<String, String> {
    let found = xbee_tool::registers(&xbee.port, xbee.baud).map_err(|error| error.to_string())?;
    let wanted = ModuleSettings::of_venue(file.id, &file.venue, file.radio.power_dbm);
    match found.mismatches(&wanted) {
        wrong if wrong.is_empty() => {
            let kind = found.kind().map(|kind| format!("{kind:?}, "));
            let kind = kind.unwrap_or_default();
            Ok(format!("{}: {kind}all registers are right", xbee.port))
        }
        wrong => Err(format!("{}: {}", xbee.port, Mismatches(wrong))),
    }
}

/// Waits until something holds; returns whether it does in time.
fn until(holds: impl Fn() -> bool) -> bool {
    let began = Instant::now();
    while began.elapsed() < ANSWERS_WITHIN {
        if holds() {
            return true;
        }
        std::thread::sleep(LOOKS_EVERY);
    }
    holds()
}
