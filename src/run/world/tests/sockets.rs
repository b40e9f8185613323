//! The live world over real sockets: fake vehicles, strangers, and the client of the product.

use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use tomoswarm_proto::codec::Decoded;

use super::super::{WorldError, WorldServer};
use super::*;
use crate::node::route::VehicleEvent;
use crate::node::sensor::Ping;
use crate::node::{Effect, Event, mission};
use crate::run::link::{
    ControlError, FromWorld, LIMIT, LinkRefusal, LinkState, VERSION, WorldControl, WorldLink,
    WorldLinkSettings, WorldStatus, decode, encode, read_frame, write_frame,
};

const TOKEN: &str = "sesame";

fn begin(listen: &str) -> WorldServer {
    WorldServer::start(&scenario(), listen.parse().unwrap(), TOKEN, None, None).unwrap()
}

/// The drivers of a vehicle, as a test plays them.
struct Fake(TcpStream);

impl Fake {
    fn open(address: SocketAddr) -> Fake {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_nodelay(true).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(5)))
            .unwrap();
        Fake(stream)
    }

    fn join(address: SocketAddr, vehicle: VehicleId, boot: u32) -> Result<Fake, LinkRefusal> {
        let mut fake = Fake::open(address);
        fake.say(&ToWorld::Join {
            vehicle,
            boot: Boot(boot),
            token: TOKEN.into(),
        });
        match fake.hear().unwrap() {
            FromWorld::Welcome(_) => Ok(fake),
            FromWorld::Refused(refused) => Err(refused),
            other => panic!("{other:?}"),
        }
    }

    fn say(&mut self, word: &ToWorld) {
        write_frame(&mut self.0, &encode(word).unwrap()).unwrap();
    }

    /// The next word, or `None` when the connection has ended.
    fn hear(&mut self) -> Option<FromWorld> {
        read_frame(&mut self.0)
            .ok()
            .map(|frame| decode(&frame).unwrap())
    }

    /// The first word that is looked for.
    fn wait_for<T>(&mut self, wanted: impl Fn(FromWorld) -> Option<T>) -> T {
        std::iter::from_fn(|| self.hear())
            .find_map(wanted)
            .expect("it is said before the connection ends")
    }

    /// Why the world ends the connection.
    fn why_refused(&mut self) -> LinkRefusal {
        let why = self.wait_for(|word| {
            if let FromWorld::Refused(why) = word {
                Some(why)
            } else {
                None
            }
        });
        assert!(self.hear().is_none(), "nothing follows");
        why
    }
}

fn control(address: SocketAddr) -> WorldControl {
    WorldControl::connect(address, TOKEN).unwrap()
}

/// Asks until something is true, at most 3 s.
fn until(control: &mut WorldControl, is_true: impl Fn(&WorldStatus) -> bool) -> WorldStatus {
    let until = Instant::now() + Duration::from_secs(3);
    loop {
        let status = control.report().unwrap();
        if is_true(&status) {
            return status;
        }
        assert!(Instant::now() < until, "never: {status:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_vehicle_drives_and_sees_and_hears_another_one() {
    let server = begin("127.0.0.1:0");
    let mut one = Fake::join(server.address(), ONE, 1).unwrap();
    let mut two = Fake::join(server.address(), TWO, 1).unwrap();
    one.say(&ToWorld::Ping(Ping { number: 7 }));
    let echo = one.wait_for(|word| {
        if let FromWorld::Echo(echo) = word {
            Some(echo)
        } else {
            None
        }
    });
    assert_eq!(echo.number, 7);
    assert!((echo.range_m.unwrap() - WALL_M).abs() < 0.05, "{echo:?}");
    one.say(&beacon(ONE, 3));
    let heard = |word| match word {
        FromWorld::Heard { frame, rssi_dbm } => Some((codec::decode(&frame).unwrap(), rssi_dbm)),
        _other => None,
    };
    let (Decoded::Message(Message::Beacon(beacon)), rssi_dbm) = two.wait_for(heard) else {
        panic!("a beacon")
    };
    assert_eq!((beacon.sender, beacon.sequence), (ONE, 3));
    assert!(HEARD_DBM.contains(&rssi_dbm), "{rssi_dbm} dBm");
    two.say(&drive(5.0, -1.5));
    let arrived = Point::new(5.0, -1.5);
    two.wait_for(|word| match word {
        FromWorld::Autopilot(events) if events.pose.at.distance_to(arrived) < 0.01 => Some(()),
        _other => None,
    });
    assert!(two.0.peer_addr().unwrap().ip().is_loopback());
}

#[test]
fn strangers_are_told_why_and_do_no_harm() {
    let server = begin("127.0.0.1:0");
    let output = |bytes: &[u8]| {
        let mut fake = Fake::open(server.address());
        fake.0.write_all(bytes).unwrap();
        fake
    };
    let framed = |frame: &[u8]| {
        let mut bytes = Vec::new();
        write_frame(&mut bytes, frame).unwrap();
        bytes
    };
    let join = encode(&ToWorld::Join {
        vehicle: ONE,
        boot: Boot(9),
        token: b"wrong".to_vec(),
    })
    .unwrap();
    assert_eq!(output(&framed(&join)).why_refused(), LinkRefusal::Token);
    let mut other = join.clone();
    other[0] = VERSION + 1;
    let version = LinkRefusal::Version {
        expected: VERSION,
        found: VERSION + 1,
    };
    assert_eq!(output(&framed(&other)).why_refused(), version);
    assert_eq!(
        output(&framed(&encode(&ToWorld::Stop).unwrap())).why_refused(),
        LinkRefusal::NoGreeting
    );
    assert_eq!(
        output(b"GET / HTTP/1.1\r\n\r\n").why_refused(),
        LinkRefusal::NoGreeting
    );
    assert_eq!(
        output(&framed(&[VERSION; 500])).why_refused(),
        LinkRefusal::NoGreeting
    );
    // A length of 4 GB is not believed, and half a frame is not waited for.
    assert_eq!(output(&[0xff; 40]).why_refused(), LinkRefusal::NoGreeting);
    let mut half = output(&framed(&join)[..10]);
    assert_eq!(half.why_refused(), LinkRefusal::NoGreeting);
    assert!(matches!(
        WorldControl::connect(server.address(), "open"),
        Err(ControlError::Refused(LinkRefusal::Token))
    ));
    assert!(
        Fake::join(server.address(), ONE, 1).is_ok(),
        "nobody has taken the place"
    );
}

#[test]
fn a_driver_that_talks_garbage_is_ended_and_may_come_back() {
    let server = begin("127.0.0.1:0");
    let oversized = u32::try_from(LIMIT + 1).unwrap().to_le_bytes();
    for garbage in [
        &[3, 0, 0, 0, VERSION, 99, 99][..],
        &oversized[..],
        &[1, 0, 0, 0, VERSION + 1],
    ] {
        let mut one = Fake::join(server.address(), ONE, 1).unwrap();
        one.0.write_all(garbage).unwrap();
        assert_eq!(one.why_refused(), LinkRefusal::Garbage);
        until(&mut control(server.address()), |status| {
            status.vehicles[0].driver.is_none()
        });
    }
}

#[test]
fn the_body_of_a_vehicle_that_is_gone_stops() {
    let server = begin("127.0.0.1:0");
    let mut control = control(server.address());
    let mut two = Fake::join(server.address(), TWO, 1).unwrap();
    two.say(&drive(5.0, 8.0));
    until(&mut control, |status| status.vehicles[1].speed_mps > 0.9);
    drop(two);
    until(&mut control, |status| status.vehicles[1].driver.is_none());
    let status = until(&mut control, |status| status.vehicles[1].speed_mps == 0.0);
    assert!(status.vehicles[1].at.y_m < 1.0, "{:?}", status.vehicles[1]);
    let mut again = Fake::join(server.address(), TWO, 2).unwrap();
    let events = again.wait_for(|word| {
        if let FromWorld::Autopilot(events) = word {
            Some(events)
        } else {
            None
        }
    });
    assert!(events.pose.at.distance_to(status.vehicles[1].at) < 1e-6);
}

#[test]
fn a_contact_and_the_persons_show_in_the_status() {
    let server = begin("127.0.0.1:0");
    let mut control = control(server.address());
    let mut one = Fake::join(server.address(), ONE, 1).unwrap();
    one.say(&drive(0.5, 5.0));
    assert!(control.enter().unwrap().entered);
    let status = until(&mut control, |status| status.collision_count > 0);
    assert_eq!(
        (status.collisions[0].vehicle, status.persons.len()),
        (ONE, 1)
    );
    assert!(!control.track(ONE).unwrap().is_empty());
    assert_eq!(control.stop().unwrap().collision_count, 1);
    assert_eq!(server.wait().collision_count, 1);
    assert!(
        one.hear().is_none() || std::iter::from_fn(|| one.hear()).count() < 100,
        "the world has ended"
    );
}

#[test]
fn the_later_start_of_a_vehicle_takes_over() {
    let server = begin("127.0.0.1:0");
    let mut old = Fake::join(server.address(), ONE, 3).unwrap();
    let taken = |found| LinkRefusal::Taken {
        vehicle: ONE,
        present: Boot(3),
        found: Boot(found),
    };
    assert_eq!(Fake::join(server.address(), ONE, 3).err(), Some(taken(3)));
    assert_eq!(Fake::join(server.address(), ONE, 2).err(), Some(taken(2)));
    let mut new = Fake::join(server.address(), ONE, 4).unwrap();
    assert_eq!(
        old.why_refused(),
        LinkRefusal::Replaced {
            vehicle: ONE,
            by: Boot(4)
        }
    );
    new.say(&ToWorld::Ping(Ping { number: 1 }));
    new.wait_for(|word| {
        if let FromWorld::Echo(_) = word {
            Some(())
        } else {
            None
        }
    });
    assert_eq!(
        control(server.address()).report().unwrap().vehicles[0].driver,
        Some(Boot(4))
    );
}

#[test]
fn one_that_never_reads_does_not_stop_the_others() {
    let server = begin("127.0.0.1:0");
    let mut deaf = Fake::open(server.address());
    deaf.say(&ToWorld::Control {
        token: TOKEN.into(),
    });
    let ask = encode(&ToWorld::Report).unwrap();
    let mut asked = Vec::new();
    (0..50_000).for_each(|_| write_frame(&mut asked, &ask).unwrap());
    deaf.0.write_all(&asked).unwrap();
    let mut one = Fake::join(server.address(), ONE, 1).unwrap();
    one.say(&ToWorld::Ping(Ping { number: 1 }));
    one.wait_for(|word| {
        if let FromWorld::Echo(_) = word {
            Some(())
        } else {
            None
        }
    });
}

#[test]
fn only_this_machine_may_connect() {
    for address in ["0.0.0.0:0", "192.0.2.1:0", "[::]:0"] {
        let refused =
            WorldServer::start(&scenario(), address.parse().unwrap(), TOKEN, None, None).err();
        assert!(
            matches!(refused, Some(WorldError::NotLoopback { .. })),
            "{address}: {refused:?}"
        );
    }
}

#[test]
fn an_address_in_use_is_named_and_is_no_fault_of_a_thread() {
    let world = begin("127.0.0.1:0");
    let address = world.address();
    let refused = WorldServer::start(&scenario(), address, TOKEN, None, None).err();
    assert!(
        matches!(&refused, Some(error @ WorldError::Listen { .. })
            if error.to_string().starts_with(&format!("{address} cannot be listened on: "))),
        "{refused:?}"
    );
}

fn link(address: SocketAddr, token: &str) -> (WorldLink, Receiver<Event>) {
    let (tell, events) = channel();
    let settings = WorldLinkSettings {
        address,
        token: token.to_owned(),
        vehicle: ONE,
        boot: Boot(1),
    };
    let link =
        WorldLink::connect(settings, move |event| tell.send(event).unwrap_or_default()).unwrap();
    (link, events)
}

fn wait_for_state(link: &WorldLink, is_wanted: impl Fn(&LinkState) -> bool) {
    let until = Instant::now() + Duration::from_secs(3);
    while !is_wanted(&link.state()) {
        assert!(Instant::now() < until, "never: {:?}", link.state());
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn echo_of(link: &WorldLink, events: &Receiver<Event>, number: u64) -> Duration {
    let asked = Instant::now();
    assert!(link.send(&Effect::Ping(Ping { number })));
    loop {
        match events.recv_timeout(Duration::from_secs(2)).unwrap() {
            Event::Echo(echo) if echo.number == number => return asked.elapsed(),
            _other => {}
        }
    }
}

#[test]
fn the_link_comes_back_when_the_world_does() {
    let server = begin("127.0.0.1:0");
    let address = server.address();
    let (link, events) = link(address, TOKEN);
    wait_for_state(&link, |state| matches!(state, LinkState::Joined(_)));
    let took = echo_of(&link, &events, 1);
    assert!(took < Duration::from_millis(200), "{took:?}");
    assert!(
        !link.send(&Effect::VehicleEvent(VehicleEvent::Mission(
            mission::MissionEvent::Home
        ))),
        "not for the world"
    );
    drop(server);
    wait_for_state(&link, |state| {
        matches!(state, LinkState::Connecting(Some(_)))
    });
    assert!(
        !link.send(&Effect::Ping(Ping { number: 2 })),
        "what nobody can take is dropped"
    );
    let _server = begin(&address.to_string());
    wait_for_state(&link, |state| matches!(state, LinkState::Joined(_)));
    echo_of(&link, &events, 3);
    drop(link);
    assert!(
        std::iter::from_fn(|| events.recv_timeout(Duration::from_millis(500)).ok()).count() < 1000
    );
}

fn transmit(sequence: u32) -> Effect {
    let ToWorld::Transmit(frame) = beacon(ONE, sequence) else {
        panic!("a beacon")
    };
    let Ok(Decoded::Message(Message::Beacon(beacon))) = codec::decode(&frame) else {
        panic!("a beacon")
    };
    Effect::Transmit(beacon)
}

fn unsent(events: &Receiver<Event>) -> u32 {
    let of = |event| {
        if let Event::Unsent(sequence) = event {
            Some(sequence)
        } else {
            None
        }
    };
    std::iter::from_fn(|| events.recv_timeout(Duration::from_secs(2)).ok())
        .find_map(of)
        .expect("it comes back")
}

#[test]
fn a_beacon_that_was_not_sent_comes_back_from_a_busy_radio_and_from_a_link_that_is_down() {
    let server = begin("127.0.0.1:0");
    let (link, events) = link(server.address(), TOKEN);
    wait_for_state(&link, |state| matches!(state, LinkState::Joined(_)));
    // So many at once that the radio is still speaking at one of them.
    (1..=50).for_each(|sequence| assert!(link.send(&transmit(sequence))));
    assert!((2..=50).contains(&unsent(&events)));
    drop(server);
    wait_for_state(&link, |state| {
        matches!(state, LinkState::Connecting(Some(_)))
    });
    events.try_iter().for_each(drop);
    assert!(!link.send(&transmit(51)));
    assert_eq!(unsent(&events), 51);
}

#[test]
fn the_link_says_why_it_is_refused() {
    let server = begin("127.0.0.1:0");
    let (link, _told) = link(server.address(), "wrong");
    wait_for_state(&link, |state| {
        *state == LinkState::Refused(LinkRefusal::Token)
    });
}

#[cfg(feature = "hw")]
#[test]
fn two_worlds_show_no_modules_in_one_folder() {
    let folder = tempfile::tempdir().unwrap();
    let start = || {
        let address = "127.0.0.1:0".parse().unwrap();
        WorldServer::start(&scenario(), address, TOKEN, None, Some(folder.path()))
    };
    let first = start().unwrap();
    let words = start().err().unwrap().to_string();
    assert!(
        words.contains("another world shows its modules there"),
        "{words}"
    );
    assert!(folder.path().join("vehicle-1").is_symlink());
    drop(first);
    std::fs::remove_file(folder.path().join("vehicle-2")).ok();
    std::fs::write(folder.path().join("vehicle-2"), "mine").unwrap();
    let words = start().err().unwrap().to_string();
    assert!(
        words.contains("vehicle-2 cannot be made a link to a port"),
        "{words}"
    );
}
