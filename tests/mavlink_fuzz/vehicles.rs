//! The driver of an autopilot and the simulated autopilot: each against the other over a bad link, and under strangers'
//! messages.

use std::time::Duration;

use tomoswarm::autopilot::{Command, FlightMode, Item, NumberedCommand, VehicleKind};
use tomoswarm::geom::{Angle, Bearing, Geodetic, Point, Vector};
use tomoswarm::mavlink::autopilot_driver::{
    AutopilotSensor, DriverOut, MavlinkDriver, MavlinkDriverSettings, PlaceSource, RangeSettings,
    ServoPulse, SwitchSettings,
};
use tomoswarm::mavlink::client_link::{ClientBytes, ClientId};
use tomoswarm::mavlink::earth_frame::EarthFrame;
use tomoswarm::mavlink::frames::{Content, FrameReader, FrameWriter, MavAddress};
use tomoswarm::sim::environment::Environment;
use tomoswarm::sim::free_space::free_space;
use tomoswarm::sim::mavlink_fleet::{Endpoints, MavlinkFleet};
use tomoswarm::time::Time;

use crate::chance::Chance;
use crate::channel::Channel;
use crate::noise;

const OWN: MavAddress = MavAddress {
    system: 255,
    component: 191,
};
const AUTOPILOT: MavAddress = MavAddress {
    system: 1,
    component: 1,
};
/// So many steps of time an input has.
const STEPS: usize = 300;
/// Nobody says more at a time: a whole list of parameters, and what was asked for at 500 Hz.
const SAID_MAX: usize = 400;

fn frame() -> EarthFrame {
    let datum = Geodetic {
        latitude_deg: 52.0,
        longitude_deg: 4.0,
        altitude_m: 3.0,
    };
    EarthFrame::new(datum, Bearing::from_degrees(40.0))
}

fn span(chance: &mut Chance) -> Duration {
    Duration::from_millis(chance.one_of(&[1, 5, 20, 100, 100, 600, 5_000]))
}

fn number(chance: &mut Chance) -> f64 {
    match chance.below(8) {
        0 => chance.one_of(&[f64::NAN, f64::INFINITY, -1e300, 0.0]),
        _ => chance.between(-30.0, 30.0),
    }
}

fn place(chance: &mut Chance) -> Point {
    Point::new(number(chance), number(chance))
}

fn any_command(chance: &mut Chance) -> Command {
    let modes = [
        FlightMode::Guided,
        FlightMode::Hold,
        FlightMode::Loiter,
        FlightMode::Auto,
        FlightMode::Manual,
        FlightMode::Return,
        FlightMode::Land,
    ];
    match chance.below(14) {
        0 => Command::Arm {
            force: chance.happens(0.3),
        },
        1 => Command::Disarm {
            force: chance.happens(0.3),
        },
        2 | 3 => Command::Mode(chance.one_of(&modes)),
        4 => Command::Takeoff {
            altitude_m: number(chance),
        },
        5 | 6 => Command::Route {
            corners: (0..chance.below(4)).map(|_| place(chance)).collect(),
            altitude_m: chance.happens(0.5).then(|| number(chance)),
            speed_mps: chance.happens(0.5).then(|| number(chance)),
        },
        7 => Command::Velocity(Vector::new(number(chance), number(chance))),
        8 => Command::Stop,
        9 => Command::Yaw(Angle::from_degrees(chance.between(-180.0, 180.0))),
        10 => Command::Upload((0..chance.below(12)).map(|_| any_item(chance)).collect()),
        11 => Command::SetCurrent(chance.one_of(&[0, 1, 70_000])),
        12 => Command::SetHome(place(chance)),
        _ => Command::Speed(number(chance)),
    }
}

fn any_item(chance: &mut Chance) -> Item {
    match chance.below(5) {
        0 => Item::Delay(Duration::from_millis(chance.below(5_000) as u64)),
        1 => Item::Jump {
            to: chance.below(12),
            times: chance.happens(0.5).then_some(2),
        },
        2 => Item::Speed(number(chance)),
        3 => Item::Return,
        _ => Item::Waypoint {
            at: place(chance),
            altitude_m: number(chance),
            delay: Duration::ZERO,
        },
    }
}

/// Simulated vehicles under a fleet.
struct Simulated {
    environment: Environment,
    fleet: MavlinkFleet,
    kind: VehicleKind,
    clients: usize,
}

impl Simulated {
    fn drawn(chance: &mut Chance, endpoints: Endpoints) -> Simulated {
        let kind = chance.one_of(&[VehicleKind::Rover, VehicleKind::Copter]);
        let mut environment = free_space(kind, 2, 7).unwrap();
        environment.begin(&mut Vec::new());
        let fleet = MavlinkFleet::new(&environment, frame(), endpoints, None);
        Simulated {
            environment,
            fleet,
            kind,
            clients: 0,
        }
    }

    fn join(&mut self, now: Time, endpoint: usize) {
        self.fleet
            .joined(now, ClientId(self.clients as u32), endpoint, 0);
        self.clients += 1;
    }

    fn go_on(&mut self, now: Time, answers: &mut Vec<ClientBytes>) {
        self.environment.wake(now, &mut Vec::new());
        self.fleet.due(now, &mut self.environment, answers);
        assert!(self.fleet.deadline() > now, "it asks to be woken at once");
        for index in 0..2 {
            let pose = self.environment.known(index, now).pose;
            assert!(
                pose.at.x_m.is_finite()
                    && pose.at.y_m.is_finite()
                    && pose.heading.radians().is_finite()
            );
        }
    }
}

/// Clients are told whole frames, and not too many.
fn check(answers: &[ClientBytes]) {
    for (_, bytes) in answers {
        let count = noise::count_frames(bytes).expect("they are told frames");
        assert!((1..SAID_MAX).contains(&count), "{count} frames at once");
    }
}

pub fn vehicle(chance: &mut Chance) {
    let endpoints = chance.one_of(&[Endpoints::OneEach, Endpoints::Shared]);
    let mut simulated = Simulated::drawn(chance, endpoints);
    let mut now = Time::ZERO;
    simulated.join(now, 0);
    let mut driver = driver_of(simulated.kind, PlaceSource::Global, true);
    let mut writer = FrameWriter::new(OWN);
    for sequence in 0..STEPS {
        now = now + span(chance);
        let mut answers = Vec::new();
        simulated.go_on(now, &mut answers);
        if chance.happens(0.02) && simulated.clients < 6 {
            simulated.join(now, chance.below(simulated.fleet.endpoints()));
        }
        if chance.happens(0.01) {
            simulated
                .fleet
                .left(ClientId(chance.below(simulated.clients) as u32));
        }
        let client = ClientId(chance.below(simulated.clients) as u32);
        let from = MavAddress {
            system: chance.one_of(&[255, 255, 1, 7]),
            component: chance.one_of(&[190, 1]),
        };
        let mut bytes = noise::payload(chance).framed(from, sequence as u8);
        if chance.happens(0.1) {
            noise::damage(chance, &mut bytes);
        }
        // Somebody who knows how leads it to where nonsense alone would not come.
        if chance.happens(0.3) {
            let mut out = Vec::new();
            let told = NumberedCommand {
                number: sequence as u32 + 1,
                command: any_command(chance),
            };
            driver.command(now, &told, &mut out);
            driver.due(now, &mut out);
            for said in out {
                if let DriverOut::Say(message) = said {
                    writer.write(&message, None, &mut bytes);
                }
            }
        }
        simulated.fleet.hear(
            now,
            client,
            &bytes,
            &mut simulated.environment,
            &mut answers,
        );
        check(&answers);
        // It answers the uploads of the one who knows how.
        let mut reader = FrameReader::default();
        answers.iter().for_each(|(_, bytes)| reader.push(bytes));
        while let Some(frame) = reader.next(None) {
            let mut out = Vec::new();
            driver.hear(now, &frame, &mut out);
            let mut bytes = Vec::new();
            for said in out {
                if let DriverOut::Say(message) = said {
                    writer.write(&message, None, &mut bytes);
                }
            }
            let mut more = Vec::new();
            simulated
                .fleet
                .hear(now, client, &bytes, &mut simulated.environment, &mut more);
            more.iter().for_each(|(_, bytes)| reader.push(bytes));
            check(&more);
        }
    }
}

fn driver_of(kind: VehicleKind, place: PlaceSource, arms_without_failsafes: bool) -> MavlinkDriver {
    MavlinkDriver::new(MavlinkDriverSettings {
        own: OWN,
        system: 1,
        kind,
        frame: frame(),
        place,
        sets_origin: place == PlaceSource::Local,
        place_sd_min_m: 0.01,
        switch: Some(SwitchSettings {
            channel: 7,
            hold_us: 1500,
            return_us: 1900,
        }),
        arms_without_failsafes,
        takes_fixes: false,
        ranges: Some(ranges()),
    })
}

/// Sensors ahead and to the left, and one on a servo astern; the first is known to say when it hears nothing.
fn ranges() -> RangeSettings {
    let sensor = |sensor, mounted_deg: f64, nothing_from_m| AutopilotSensor {
        sensor,
        mounted: Angle::from_degrees(mounted_deg),
        is_turned: sensor == 2,
        nothing_from_m,
        delay: Duration::from_millis(40),
    };
    RangeSettings {
        sensors: vec![
            sensor(0, 0.0, Some(6.0)),
            sensor(1, 90.0, None),
            sensor(2, 180.0, None),
        ],
        half_angle: Angle::from_degrees(15.0),
        max_range_m: 4.0,
        rate_hz: 20,
    }
}

pub fn driver(chance: &mut Chance) {
    let mut simulated = Simulated::drawn(chance, Endpoints::Shared);
    let place = chance.one_of(&[PlaceSource::Global, PlaceSource::Local]);
    let mut driver = driver_of(simulated.kind, place, chance.happens(0.8));
    let (mut there, mut back) = (
        Channel::<Vec<u8>>::drawn(chance),
        Channel::<Vec<u8>>::drawn(chance),
    );
    let (mut writer, mut reader, mut now) =
        (FrameWriter::new(OWN), FrameReader::default(), Time::ZERO);
    let noise_share = chance.one_of(&[0.0, 0.1, 1.0]);
    simulated.join(now, 0);
    for sequence in 0..STEPS {
        now = now + span(chance);
        let (mut answers, mut out) = (Vec::new(), Vec::new());
        simulated.go_on(now, &mut answers);
        for bytes in there.come(now) {
            simulated.fleet.hear(
                now,
                ClientId(0),
                &bytes,
                &mut simulated.environment,
                &mut answers,
            );
        }
        check(&answers);
        for (_, bytes) in answers {
            back.send(now, chance, bytes);
        }
        if chance.happens(noise_share) {
            let from = chance.one_of(&[
                AUTOPILOT,
                AUTOPILOT,
                AUTOPILOT,
                MavAddress {
                    system: 2,
                    component: 1,
                },
            ]);
            let mut bytes = noise::payload(chance).framed(from, sequence as u8);
            if chance.happens(0.05) {
                noise::damage(chance, &mut bytes);
            }
            back.send(now, chance, bytes);
        }
        back.come(now).iter().for_each(|bytes| reader.push(bytes));
        while let Some(frame) = reader.next(None) {
            let before = out.len();
            driver.hear(now, &frame, &mut out);
            assert!(out.len() - before < 8, "{:?}", &out[before..]);
            let is_ours = frame.from == AUTOPILOT && matches!(frame.content, Content::Message(_));
            assert!(
                is_ours || out.len() == before,
                "a stranger's words steer nothing"
            );
        }
        if chance.happens(0.1) {
            let told = NumberedCommand {
                number: sequence as u32 + 1,
                command: any_command(chance),
            };
            driver.command(now, &told, &mut out);
        }
        if chance.happens(0.1) {
            let width_us = chance.one_of(&[1000, 1500, 2000]);
            let pulse = ServoPulse {
                output: 9,
                width_us,
            };
            driver.give_pulse(now, pulse, &mut out);
        }
        let mut times = 0;
        while driver.deadline() <= now {
            driver.due(now, &mut out);
            times += 1;
            assert!(times < 30, "it asks to be woken at once");
        }
        check_driver(&driver, now, &out);
        for said in out {
            if let DriverOut::Say(message) = said {
                let mut bytes = Vec::new();
                writer.write(&message, None, &mut bytes);
                there.send(now, chance, bytes);
            }
        }
    }
}

/// What it says are numbers, and what is wrong has words.
fn check_driver(driver: &MavlinkDriver, now: Time, out: &[DriverOut]) {
    for said in out {
        if let DriverOut::Reading(reading) = said {
            let is_distance = |range_m: f64| (0.0..=655.35).contains(&range_m);
            assert!(
                reading.sensor < 3
                    && reading.measured <= now
                    && reading.range_m.is_none_or(is_distance),
                "{reading:?}"
            );
        }
        if let DriverOut::Report(report) = said {
            let pose = report.pose;
            let numbers = [
                pose.at.x_m,
                pose.at.y_m,
                pose.sd_m,
                report.flight_state.altitude_m,
                report.flight_state.climb_mps,
                report.speed_mps,
                report.battery.unwrap_or_default(),
                pose.heading.radians(),
            ];
            assert!(
                numbers.iter().all(|number| number.is_finite()),
                "{report:?}"
            );
            assert!(
                report
                    .battery
                    .is_none_or(|charge| (0.0..=1.0).contains(&charge))
                    && pose.sd_m >= 0.0
                    && report.speed_mps >= 0.0,
                "{report:?}"
            );
        }
    }
    let _ = driver.health(now);
    assert!(
        driver
            .trouble(now)
            .is_none_or(|trouble| !trouble.to_string().is_empty())
    );
}
