//! What goes to the world and what is believed of it, where not every device is simulated: against a world that this test
//! plays.

use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use tomoswarm_proto::VehicleId;

use super::*;
use crate::autopilot::tests_support::resting_report;
use crate::autopilot::{Ack, CommandAck};
use crate::config::{self, bundled};
use crate::geom::Angle;
use crate::node::sensor::{Echo, Ping};
use crate::run::link::{FromWorld, ToWorld, Welcome, decode, encode, read_frame, write_frame};

/// Starts the devices of a vehicle with this file.
fn start_devices(text: &str) -> (VehicleDevices, Receiver<Event>) {
    let file =
        config::read_vehicle("configs/v.toml", text, &mut |path| bundled::load(path)).unwrap();
    let (sender, events) = channel();
    let told: EventSink = Arc::new(move |event| {
        // Nobody listens at the end.
        let _ = sender.send(event);
    });
    let devices = VehicleDevices::start(&file, Boot(1), Clock::start(), &told).unwrap();
    (devices, events)
}

/// The devices of a vehicle of the bundled place, with a range sensor by this driver, and the world that it found.
fn devices(range: &str) -> (VehicleDevices, Receiver<Event>, World) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let text = file(range, listener.local_addr().unwrap());
    let file =
        config::read_vehicle("configs/v.toml", &text, &mut |path| bundled::load(path)).unwrap();
    let (sender, events) = channel();
    let told: EventSink = Arc::new(move |event| sender.send(event).unwrap());
    let devices = VehicleDevices::start(&file, Boot(1), Clock::start(), &told).unwrap();
    let stream = listener.accept().unwrap().0;
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    let mut world = World(stream);
    assert!(matches!(
        world.hear(),
        ToWorld::Join {
            vehicle: VehicleId(1),
            ..
        }
    ));
    world.say(&FromWorld::Welcome(Welcome {
        now_ns: 0,
        start: None,
    }));
    let troubles = Troubles::default();
    loop {
        devices.watch(&troubles);
        if troubles.list().is_empty() {
            return (devices, events, world);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn file(range: &str, world: SocketAddr) -> String {
    format!(
        "kind = \"vehicle\"\nvenue = \"courtyard.venue.toml\"\nid = 1\nstate_dir = \"state\"\nvehicle.max_speed_mps = 0.2\n\
         autopilot.driver = \"sim\"\nradio.driver = \"sim\"\nservo.driver = \"none\"\nrange.driver = \"{range}\"\n\
         world.connect = \"{world}\"\nworld.token = \"secret-token\"\n"
    )
}

struct World(TcpStream);

impl World {
    fn hear(&mut self) -> ToWorld {
        decode(&read_frame(&mut self.0).unwrap()).unwrap()
    }

    fn say(&mut self, word: &FromWorld) {
        write_frame(&mut self.0, &encode(word).unwrap()).unwrap();
    }
}

/// A ping, a turn of the servo, and a stop at the end.
fn measure(devices: &VehicleDevices) {
    devices.carry_out(&Effect::Steer(Angle::ZERO));
    devices.carry_out(&Effect::Ping(Ping { number: 7 }));
    devices.stop();
}

#[test]
fn a_ping_goes_to_the_world_only_where_that_has_the_range_sensor() {
    for (range, has_ping) in [("sim", true), ("none", false)] {
        let (devices, _events, mut world) = devices(range);
        measure(&devices);
        assert!(
            matches!(world.hear(), ToWorld::Steer(_)),
            "{range}: the world hears that its companion lives"
        );
        if has_ping {
            assert!(
                matches!(world.hear(), ToWorld::Ping(Ping { number: 7 })),
                "{range}"
            );
        }
        let stop = NumberedCommand {
            number: 0,
            command: Command::Stop,
        };
        assert_eq!(world.hear(), ToWorld::Autopilot(stop), "{range}");
    }
}

#[test]
fn an_echo_of_the_world_is_no_echo_of_a_real_sensor() {
    for (range, has_echo) in [("sim", true), ("none", false)] {
        let (devices, events, mut world) = devices(range);
        measure(&devices);
        world.say(&FromWorld::Echo(Echo {
            number: 7,
            range_m: None,
        }));
        world.say(&FromWorld::Autopilot(resting_report()));
        world.say(&FromWorld::Ack(Ack {
            number: 9,
            result: CommandAck::Accepted,
            arm_refusal: None,
        }));
        world.say(&FromWorld::Unsent(3));
        let hear = || events.recv_timeout(Duration::from_secs(10)).unwrap();
        if has_echo {
            assert!(
                matches!(
                    hear(),
                    Event::Echo(Echo {
                        number: 7,
                        range_m: None
                    })
                ),
                "{range}"
            );
        }
        assert!(matches!(hear(), Event::Report(_)), "{range}");
        assert!(
            matches!(hear(), Event::Ack(Ack { number: 9, .. })),
            "{range}"
        );
        assert!(matches!(hear(), Event::Unsent(3)), "{range}");
        assert_eq!(
            devices.range_health().map(|health| health.faults),
            has_echo.then_some(0)
        );
    }
}

#[test]
fn a_world_that_is_away_is_a_trouble_and_its_pings_are_counted() {
    let (devices, _events, world) = devices("sim");
    drop(world);
    let troubles = Troubles::default();
    while !troubles
        .list()
        .iter()
        .any(|trouble| trouble.starts_with("world: "))
    {
        devices.watch(&troubles);
        std::thread::sleep(Duration::from_millis(5));
    }
    for number in 1..=3 {
        devices.carry_out(&Effect::Ping(Ping { number }));
    }
    assert_eq!(devices.range_health().unwrap().faults, 2);
}

#[test]
fn a_sensor_that_falls_silent_is_noticed_by_a_ping_and_is_news_until_it_is_named() {
    let (devices, events, mut world) = devices("sim");
    devices.carry_out(&Effect::Ping(Ping { number: 1 }));
    world.say(&FromWorld::Echo(Echo {
        number: 1,
        range_m: None,
    }));
    let heard = events.recv_timeout(Duration::from_secs(10)).unwrap();
    assert!(matches!(heard, Event::Echo(_)), "{heard:?}");
    let began = Instant::now();
    for number in 2.. {
        devices.carry_out(&Effect::Ping(Ping { number }));
        if devices.has_new_trouble() {
            break;
        }
        assert!(began.elapsed() < Duration::from_secs(10), "{number} pings");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(
        began.elapsed() >= Duration::from_millis(800),
        "that may be chance"
    );
    let troubles = Troubles::default();
    devices.watch(&troubles);
    assert_eq!(troubles.list(), ["range sensor: it answers nothing"]);
    assert!(!devices.has_new_trouble(), "it is named");
}

pub(in crate::run) mod on_autopilot;
#[cfg(feature = "hw")]
mod turned;
