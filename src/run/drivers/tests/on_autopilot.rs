//! Devices that hang on an autopilot, against one that this test plays over TCP.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::super::*;
use super::start_devices;
use crate::geom::Angle;
use crate::mavlink::dialect::{
    COMMAND_ACK_DATA, DISTANCE_SENSOR_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage,
    MavResult, MavSensorOrientation, MavType,
};
use crate::mavlink::frames::{Content, FrameReader, FrameWriter, MavAddress};
use crate::node::sensor::{Echo, Ping};

const ADDRESS: MavAddress = MavAddress {
    system: 1,
    component: 1,
};
/// Whatever is waited for comes within this time.
const SOON: Duration = Duration::from_secs(20);

/// An autopilot with range sensors ahead and to the left, and with a servo.
pub(in crate::run) struct PlayedAutopilot {
    pub(in crate::run) address: SocketAddr,
    /// What the sensors say, centimetres; `None` = silent.
    distances: Arc<Mutex<[Option<u16>; 2]>>,
    /// What it answers to who turns the servo; `None` = nothing.
    pub(in crate::run) answers: Arc<Mutex<Option<MavResult>>>,
    /// Pulses that it was told: the output, and microseconds.
    pub(in crate::run) pulses: Arc<Mutex<Vec<(u8, u16)>>>,
}

impl PlayedAutopilot {
    pub(in crate::run) fn start() -> PlayedAutopilot {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let played = PlayedAutopilot {
            address: listener.local_addr().unwrap(),
            distances: Arc::default(),
            answers: Arc::default(),
            pulses: Arc::default(),
        };
        let distances = played.distances.clone();
        let (answers, pulses) = (played.answers.clone(), played.pulses.clone());
        std::thread::spawn(move || {
            let (stream, _) = listener.accept().unwrap();
            let says = stream.try_clone().unwrap();
            std::thread::spawn(move || say(says, &distances));
            hear(stream, &answers, &pulses);
        });
        played
    }

    pub(in crate::run) fn say(&self, distances: [Option<u16>; 2]) {
        *self.distances.lock().unwrap() = distances;
    }
}

/// Says that it is there, and what its sensors measure, until nobody listens.
fn say(mut stream: TcpStream, distances: &Mutex<[Option<u16>; 2]>) {
    let mut writer = FrameWriter::new(ADDRESS);
    let heartbeat = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_GROUND_ROVER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        ..HEARTBEAT_DATA::default()
    });
    let began = Instant::now();
    for step in 0u64.. {
        let mut bytes = Vec::new();
        if step.is_multiple_of(20) {
            writer.write(&heartbeat, None, &mut bytes);
        }
        let orientations = [
            MavSensorOrientation::MAV_SENSOR_ROTATION_NONE,
            MavSensorOrientation::MAV_SENSOR_ROTATION_YAW_270,
        ];
        let said = *distances.lock().unwrap();
        for (orientation, distance) in orientations.into_iter().zip(said) {
            let Some(current_distance) = distance else {
                continue;
            };
            let distance = MavMessage::DISTANCE_SENSOR(DISTANCE_SENSOR_DATA {
                time_boot_ms: began.elapsed().as_millis() as u32 + 1000,
                min_distance: 20,
                max_distance: 700,
                current_distance,
                orientation,
                ..DISTANCE_SENSOR_DATA::default()
            });
            writer.write(&distance, None, &mut bytes);
        }
        if stream.write_all(&bytes).is_err() {
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Hears of pulses, and answers.
fn hear(mut stream: TcpStream, answers: &Mutex<Option<MavResult>>, pulses: &Mutex<Vec<(u8, u16)>>) {
    let (mut reader, mut bytes) = (FrameReader::default(), [0; 4096]);
    let mut writer = FrameWriter::new(ADDRESS);
    while let Ok(count) = stream.read(&mut bytes) {
        if count == 0 {
            return;
        }
        reader.push(&bytes[..count]);
        while let Some(frame) = reader.next(None) {
            let Content::Message(message) = frame.content else {
                continue;
            };
            let MavMessage::COMMAND_LONG(command) = *message else {
                continue;
            };
            if command.command != MavCmd::MAV_CMD_DO_SET_SERVO {
                continue;
            }
            let pulse = (command.param1 as u8, command.param2 as u16);
            pulses.lock().unwrap().push(pulse);
            if let Some(result) = *answers.lock().unwrap() {
                let ack = MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
                    command: command.command,
                    result,
                    ..COMMAND_ACK_DATA::default()
                });
                let mut said = Vec::new();
                writer.write(&ack, None, &mut said);
                stream.write_all(&said).unwrap();
            }
        }
    }
}

/// The devices of a vehicle of the bundled place that has this autopilot; its radio has no world.
fn devices(autopilot: SocketAddr, lines: &str) -> (VehicleDevices, Receiver<Event>) {
    let text = format!(
        "kind = \"vehicle\"\nvenue = \"courtyard.venue.toml\"\nid = 1\nstate_dir = \"state\"\nvehicle.max_speed_mps = 0.1\n\
         autopilot.driver = \"mavlink\"\nautopilot.mavlink.connection = \"tcp:{autopilot}\"\nradio.driver = \"sim\"\n\
         world.connect = \"127.0.0.1:9\"\nworld.token = \"secret-token\"\n{lines}"
    );
    start_devices(&text)
}

/// Asks along a direction until an answer comes.
fn measure(devices: &VehicleDevices, events: &Receiver<Event>, beam_deg: f64) -> Option<f64> {
    devices.carry_out(&Effect::Steer(Angle::from_degrees(beam_deg)));
    let began = Instant::now();
    for number in 1_000 * beam_deg as u64.. {
        devices.carry_out(&Effect::Ping(Ping { number }));
        if let Ok(event) = events.recv_timeout(Duration::from_millis(150)) {
            let Event::Echo(Echo {
                number: answered,
                range_m,
            }) = event
            else {
                panic!("{event:?}")
            };
            assert_eq!(answered, number);
            return range_m;
        }
        assert!(began.elapsed() < SOON, "no answer");
    }
    None
}

#[test]
fn range_sensors_on_an_autopilot_answer_along_their_own_directions_only() {
    let autopilot = PlayedAutopilot::start();
    let (devices, events) = devices(
        autopilot.address,
        "servo.driver = \"none\"\nrange.driver = \"autopilot\"\nrange.beams_deg = [0, 90]\n\
         range.sensor = [{ mount_deg = 0 }, { mount_deg = 90 }]\n",
    );
    autopilot.say([Some(150), Some(320)]);
    assert_eq!(measure(&devices, &events, 0.0), Some(1.5));
    assert_eq!(measure(&devices, &events, 90.0), Some(3.2));
    assert_eq!(measure(&devices, &events, 0.0), Some(1.5));
    // The one to the left falls silent, the one ahead is blinded: neither says that nothing is there.
    autopilot.say([Some(700), None]);
    std::thread::sleep(Duration::from_millis(200));
    while events.try_recv().is_ok() {}
    let troubles = Troubles::default();
    let began = Instant::now();
    let is_told = |part: &str| troubles.list().iter().any(|said| said.contains(part));
    let mut number = 1_000_000;
    while !(is_told("outside of its 0.20 to 7.00 m") && is_told("at 90°: it answers nothing")) {
        assert!(began.elapsed() < SOON, "{:?}", troubles.list());
        for beam_deg in [0.0, 90.0] {
            number += 1;
            devices.carry_out(&Effect::Steer(Angle::from_degrees(beam_deg)));
            devices.carry_out(&Effect::Ping(Ping { number }));
            std::thread::sleep(Duration::from_millis(50));
        }
        devices.watch(&troubles);
    }
    assert!(events.try_recv().is_err(), "nothing has answered");
    assert!(devices.range_health().unwrap().glitches > 10);
}

/// A sensor on the autopilot that its servo turns.
const TURNED: &str = "servo.driver = \"autopilot\"\nservo.autopilot.output = 9\nservo.autopilot.pulse_us = [1000.5, 1999.5]\n\
                      servo.autopilot.angle_deg = [60, -60]\nrange.driver = \"autopilot\"\nrange.settle_s = 0.11\n\
                      range.scan_period_s = 0.2\n";

#[test]
fn a_sensor_is_asked_only_when_the_autopilot_has_turned_it() {
    let autopilot = PlayedAutopilot::start();
    let (devices, events) = devices(autopilot.address, TURNED);
    autopilot.say([Some(150), None]);
    let troubles = Troubles::default();
    let is_told = |part: &str| {
        devices.watch(&troubles);
        troubles.list().iter().any(|said| said.contains(part))
    };
    let turn = |beam_deg: f64, number: u64| {
        devices.carry_out(&Effect::Steer(Angle::from_degrees(beam_deg)));
        std::thread::sleep(Duration::from_millis(110));
        devices.carry_out(&Effect::Ping(Ping { number }));
        std::thread::sleep(Duration::from_millis(90));
    };
    let began = Instant::now();
    let mut number = 0;
    for (answer, trouble) in [
        (None, "servo: output 9: the autopilot does not confirm"),
        (
            Some(MavResult::MAV_RESULT_FAILED),
            "servo: output 9: the autopilot refuses",
        ),
    ] {
        *autopilot.answers.lock().unwrap() = answer;
        while !is_told(trouble) {
            assert!(began.elapsed() < SOON, "{:?}", troubles.list());
            number += 1;
            turn(25.0, number);
        }
    }
    assert!(events.try_recv().is_err(), "it looks who knows where");
    *autopilot.answers.lock().unwrap() = Some(MavResult::MAV_RESULT_ACCEPTED);
    for beam_deg in [60.0, -60.0, 0.0, 90.0, -180.0] {
        turn(beam_deg, 1);
    }
    let began = Instant::now();
    let mut has_answered = false;
    // This machine may be slow, and a pulse be confirmed late.
    while !has_answered || is_told("servo: ") {
        assert!(began.elapsed() < SOON, "{:?}", troubles.list());
        number += 1;
        turn(
            if number.is_multiple_of(2) {
                25.0
            } else {
                -25.0
            },
            number,
        );
        has_answered |= events.try_recv().is_ok();
    }
    let pulses = autopilot.pulses.lock().unwrap().clone();
    assert!(
        pulses.contains(&(9, 1001)) && pulses.contains(&(9, 1999)) && pulses.contains(&(9, 1500)),
        "{pulses:?}"
    );
    assert!(
        pulses
            .iter()
            .all(|(output, width_us)| *output == 9 && (1001..=1999).contains(width_us)),
        "{pulses:?}"
    );
}
