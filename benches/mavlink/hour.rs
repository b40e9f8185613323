//! The driver and a simulated autopilot for an hour of their time.

use std::time::Duration;

use tomoswarm::autopilot::{Command, FlightMode, Item, NumberedCommand, VehicleKind};
use tomoswarm::geom::{Bearing, Geodetic, Point};
use tomoswarm::mavlink::autopilot_driver::{
    DriverOut, MavlinkDriver, MavlinkDriverSettings, PlaceSource,
};
use tomoswarm::mavlink::client_link::{ClientBytes, ClientId};
use tomoswarm::mavlink::earth_frame::EarthFrame;
use tomoswarm::mavlink::frames::{FrameReader, FrameWriter, MavAddress};
use tomoswarm::sim::environment::Environment;
use tomoswarm::sim::free_space::free_space;
use tomoswarm::sim::mavlink_fleet::{Endpoints, MavlinkFleet};
use tomoswarm::time::Time;

use crate::memory::live_bytes;

pub const OWN: MavAddress = MavAddress {
    system: 255,
    component: 191,
};
pub const CLIENT: ClientId = ClientId(1);
const STEP: Duration = Duration::from_millis(10);
/// Steps.
const TEN_MINUTES: u32 = 60_000;
/// The driver is told something every ten seconds, and begins again after six times.
const COMMAND_EVERY: u32 = 1_000;

pub fn frame() -> EarthFrame {
    let datum = Geodetic {
        latitude_deg: 52.0,
        longitude_deg: 4.0,
        altitude_m: 3.0,
    };
    EarthFrame::new(datum, Bearing::from_degrees(40.0))
}

/// Two simulated rovers; the driver speaks with the first and hears both.
pub fn rovers() -> (Environment, MavlinkFleet) {
    let mut environment = free_space(VehicleKind::Rover, 2, 7).unwrap();
    environment.begin(&mut Vec::new());
    let mut fleet = MavlinkFleet::new(&environment, frame(), Endpoints::Shared, None);
    fleet.joined(Time::ZERO, CLIENT, 0, 0);
    (environment, fleet)
}

struct Pair {
    driver: MavlinkDriver,
    environment: Environment,
    fleet: MavlinkFleet,
    reader: FrameReader,
    writer: FrameWriter,
    frames: u64,
    reports: u64,
    acks: u64,
}

impl Pair {
    fn new() -> Pair {
        let (environment, fleet) = rovers();
        let settings = MavlinkDriverSettings {
            own: OWN,
            system: 1,
            kind: VehicleKind::Rover,
            frame: frame(),
            place: PlaceSource::Global,
            sets_origin: false,
            place_sd_min_m: 0.01,
            switch: None,
            arms_without_failsafes: true,
            takes_fixes: false,
            ranges: None,
        };
        Pair {
            driver: MavlinkDriver::new(settings),
            environment,
            fleet,
            reader: FrameReader::default(),
            writer: FrameWriter::new(OWN),
            frames: 0,
            reports: 0,
            acks: 0,
        }
    }

    fn step(&mut self, now: Time, command: Option<NumberedCommand>) {
        self.environment.wake(now, &mut Vec::new());
        let mut answers = Vec::new();
        self.fleet.due(now, &mut self.environment, &mut answers);
        self.tell(now, answers);
        let mut out = Vec::new();
        if let Some(command) = command {
            self.driver.command(now, &command, &mut out);
        }
        self.driver.due(now, &mut out);
        self.take(now, out);
    }

    fn tell(&mut self, now: Time, answers: Vec<ClientBytes>) {
        for (_, bytes) in answers {
            self.reader.push(&bytes);
        }
        while let Some(frame) = self.reader.next(None) {
            self.frames += 1;
            let mut out = Vec::new();
            self.driver.hear(now, &frame, &mut out);
            self.take(now, out);
        }
    }

    fn take(&mut self, now: Time, out: Vec<DriverOut>) {
        let (mut bytes, mut answers) = (Vec::new(), Vec::new());
        for said in out {
            match said {
                DriverOut::Say(message) => self.writer.write(&message, None, &mut bytes),
                DriverOut::Report(_) => self.reports += 1,
                DriverOut::Ack(_) => self.acks += 1,
                // No range sensor hangs on it.
                DriverOut::Reading(_) => {}
                DriverOut::Text { .. } => {}
            }
        }
        if !bytes.is_empty() {
            self.fleet
                .hear(now, CLIENT, &bytes, &mut self.environment, &mut answers);
            self.tell(now, answers);
        }
    }
}

/// What a vehicle is told in turn: it drives, stores missions, stops and is switched off.
fn command(turn: u32) -> Command {
    let far = 20.0 + f64::from(turn % 13);
    match turn % 6 {
        0 => Command::Mode(FlightMode::Guided),
        1 => Command::Arm { force: false },
        2 => Command::Route {
            corners: vec![Point::new(far, 0.0), Point::new(far, -far)],
            altitude_m: None,
            speed_mps: Some(1.0),
        },
        3 => Command::Upload(
            (0..50)
                .map(|index| Item::Waypoint {
                    at: Point::new(far, f64::from(index)),
                    altitude_m: 0.0,
                    delay: Duration::ZERO,
                })
                .collect(),
        ),
        4 => Command::Stop,
        _ => Command::Disarm { force: false },
    }
}

pub fn hour() {
    let before = live_bytes();
    let mut pair = Pair::new();
    let (mut most, mut in_use) = (0, Vec::new());
    for step in 1..=6 * TEN_MINUTES {
        let told = step.is_multiple_of(COMMAND_EVERY).then(|| NumberedCommand {
            number: step,
            command: command(step / COMMAND_EVERY - 1),
        });
        pair.step(Time::ZERO + STEP * step, told);
        most = most.max(live_bytes() - before);
        if step.is_multiple_of(TEN_MINUTES) {
            in_use.push(live_bytes() - before);
        }
    }
    println!(
        "hour: bytes in use every ten minutes: {in_use:?} (wanted: no growth), at most {most}; \
         {} messages in, {} reports and {} answers out",
        pair.frames, pair.reports, pair.acks
    );
}
