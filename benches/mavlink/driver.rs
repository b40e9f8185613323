//! The driver of a vehicle's autopilot, as it runs live, and an autopilot that says much.

use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tomoswarm::config::{self, bundled};
use tomoswarm::mavlink::dialect::{
    self as d, COMMAND_ACK_DATA, HEARTBEAT_DATA, MavAutopilot, MavMessage, MavResult, MavType,
    PARAM_VALUE_DATA,
};
use tomoswarm::mavlink::frames::{Content, FrameReader, FrameWriter, MavAddress};
use tomoswarm::node::Event;
use tomoswarm::run::clock::Clock;
use tomoswarm::run::drivers::EventSink;
use tomoswarm::run::drivers::autopilot::Autopilot;

use crate::median_and_worst;
use crate::processor::share_of_core;

/// Messages a second.
const RATE_HZ: u32 = 400;
const LASTS: Duration = Duration::from_secs(20);
const TIMES: usize = 3;
/// The driver's thread, and the one that reads the connection.
const THREADS: [&str; 2] = ["autopilot", "autopilot bytes"];

pub fn driver() {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let driver_at = UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let text = format!(
        "kind = \"vehicle\"\nvenue = \"courtyard.venue.toml\"\nid = 1\nstate_dir = \"state\"\n\
         autopilot.driver = \"mavlink\"\nautopilot.mavlink.connection = \"udp-in:{driver_at}\"\n\
         radio.driver = \"sim\"\nservo.driver = \"none\"\nrange.driver = \"sim\"\n\
         world.connect = \"127.0.0.1:1\"\nworld.token = \"secret-token\"\n"
    );
    let file =
        config::read_vehicle("configs/v.toml", &text, &mut |path| bundled::load(path)).unwrap();
    let reports = Arc::<AtomicU64>::default();
    let counted = reports.clone();
    let events: EventSink = Arc::new(move |event| {
        if let Event::Report(_) = event {
            counted.fetch_add(1, Ordering::Relaxed);
        }
    });
    socket.connect(driver_at).unwrap();
    let is_over = Arc::<AtomicBool>::default();
    let ends = is_over.clone();
    let autopilot = std::thread::spawn(move || say_much(&socket, &ends));
    let driver = Autopilot::start(&file, Clock::start(), &events, None).unwrap();
    std::thread::sleep(Duration::from_secs(3));
    assert_eq!(driver.trouble(), None);
    let (began, before) = (Instant::now(), reports.load(Ordering::Relaxed));
    let shares = (0..TIMES)
        .map(|_| share_of_core(std::process::id(), &THREADS, LASTS))
        .collect();
    let reports_per_s =
        (reports.load(Ordering::Relaxed) - before) as f64 / began.elapsed().as_secs_f64();
    is_over.store(true, Ordering::Relaxed);
    let said_per_s = autopilot.join().unwrap();
    let (median, worst) = median_and_worst(shares);
    println!(
        "driver: {:.2} % of a core, worst {:.2} of {TIMES} times {} s (wanted < 3 %), {said_per_s:.0} messages/s in, {reports_per_s:.0} reports/s out",
        median * 100.0,
        worst * 100.0,
        LASTS.as_secs(),
    );
}

/// Says messages in packets of their own, and answers what it is asked; returns how many it has said a second.
fn say_much(socket: &UdpSocket, is_over: &AtomicBool) -> f64 {
    socket.set_nonblocking(true).unwrap();
    let (began, mut said) = (Instant::now(), 0_u32);
    let mut writer = FrameWriter::new(MavAddress {
        system: 1,
        component: 1,
    });
    let mut reader = FrameReader::default();
    let mut buffer = [0; 2048];
    while !is_over.load(Ordering::Relaxed) {
        let mut bytes = Vec::new();
        writer.write(&message(said, began.elapsed()), None, &mut bytes);
        // Before the driver listens nobody hears it.
        let _ = socket.send(&bytes);
        said += 1;
        while let Ok(count) = socket.recv(&mut buffer) {
            reader.push(&buffer[..count]);
        }
        while let Some(frame) = reader.next(None) {
            bytes.clear();
            if let Content::Message(asked) = frame.content
                && let Some(answer) = answer(&asked)
            {
                writer.write(&answer, None, &mut bytes);
                let _ = socket.send(&bytes);
            }
        }
        let next = Duration::from_secs(1) * said / RATE_HZ;
        std::thread::sleep(next.saturating_sub(began.elapsed()));
    }
    f64::from(said) / began.elapsed().as_secs_f64()
}

/// What it says as its so-manieth message: places a quarter each, attitude a quarter, and the rest in turn.
fn message(number: u32, since_start: Duration) -> MavMessage {
    let boot_ms = since_start.as_millis() as u32;
    match number % 4 {
        0 => MavMessage::GLOBAL_POSITION_INT(d::GLOBAL_POSITION_INT_DATA {
            time_boot_ms: boot_ms,
            lat: 520_000_000,
            lon: 40_000_000,
            ..d::GLOBAL_POSITION_INT_DATA::default()
        }),
        1 => MavMessage::LOCAL_POSITION_NED(d::LOCAL_POSITION_NED_DATA {
            time_boot_ms: boot_ms,
            x: 3.0,
            ..d::LOCAL_POSITION_NED_DATA::default()
        }),
        2 => MavMessage::ATTITUDE(d::ATTITUDE_DATA {
            time_boot_ms: boot_ms,
            yaw: 1.0,
            ..d::ATTITUDE_DATA::default()
        }),
        _ => match number / 4 % 5 {
            0 => MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                mavtype: MavType::MAV_TYPE_GROUND_ROVER,
                autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                ..HEARTBEAT_DATA::default()
            }),
            1 => MavMessage::GPS_RAW_INT(d::GPS_RAW_INT_DATA {
                fix_type: d::GpsFixType::GPS_FIX_TYPE_3D_FIX,
                h_acc: 300,
                ..d::GPS_RAW_INT_DATA::default()
            }),
            2 => MavMessage::SYS_STATUS(d::SYS_STATUS_DATA {
                voltage_battery: 12_000,
                battery_remaining: 80,
                ..d::SYS_STATUS_DATA::default()
            }),
            3 => MavMessage::VFR_HUD(d::VFR_HUD_DATA {
                heading: 57,
                ..d::VFR_HUD_DATA::default()
            }),
            _ => MavMessage::EXTENDED_SYS_STATE(d::EXTENDED_SYS_STATE_DATA::default()),
        },
    }
}

fn answer(asked: &MavMessage) -> Option<MavMessage> {
    Some(match asked {
        MavMessage::COMMAND_LONG(long) => MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
            command: long.command,
            result: MavResult::MAV_RESULT_ACCEPTED,
            ..COMMAND_ACK_DATA::default()
        }),
        MavMessage::PARAM_REQUEST_READ(read) => MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
            param_id: read.param_id,
            ..PARAM_VALUE_DATA::default()
        }),
        _ => return None,
    })
}
