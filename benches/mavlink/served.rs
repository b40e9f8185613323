//! The process `mock-autopilot` and its clients.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tomoswarm::mavlink::dialect::{
    COMMAND_LONG_DATA, MavCmd, MavDataStream, MavMessage, MavResult, REQUEST_DATA_STREAM_DATA,
};
use tomoswarm::mavlink::frames::{Content, Frame, FrameReader, FrameWriter, MavAddress};

use crate::median_and_worst;
use crate::processor::{share_of_core, waited_for_core};

/// Starts of the process.
const STARTS: usize = 21;
/// What is measured of a process at work lasts so long, so often.
const LASTS: Duration = Duration::from_secs(20);
const TIMES: usize = 3;
const VEHICLES: usize = 60;
/// How often a second each message comes that a vehicle says by itself.
const RATE_HZ: u16 = 10;
/// So many messages it says by itself when it is asked for all.
const MESSAGES: usize = 12;

/// A process that serves vehicles.
struct Mock {
    child: Child,
    began: Instant,
    addresses: Vec<SocketAddr>,
}

impl Mock {
    fn start(arguments: &[&str], endpoints: usize) -> Mock {
        let began = Instant::now();
        let mut child = Command::new(env!("CARGO_BIN_EXE_tomoswarm"))
            .args(["mock-autopilot", "--tcp", "127.0.0.1:0", "--tied"])
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let address = |line: String| line.strip_prefix("autopilot ").unwrap().parse().unwrap();
        let addresses = lines
            .take(endpoints)
            .map(|line| address(line.unwrap()))
            .collect();
        Mock {
            child,
            began,
            addresses,
        }
    }
}

impl Drop for Mock {
    fn drop(&mut self) {
        // One that has ended is ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A ground station.
struct Client {
    stream: TcpStream,
    reader: FrameReader,
    writer: FrameWriter,
}

impl Client {
    fn connect(address: SocketAddr) -> Client {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_nodelay(true).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_millis(10)))
            .unwrap();
        let from = MavAddress {
            system: 255,
            component: 190,
        };
        Client {
            stream,
            reader: FrameReader::default(),
            writer: FrameWriter::new(from),
        }
    }

    fn say(&mut self, message: &MavMessage) {
        let mut bytes = Vec::new();
        self.writer.write(message, None, &mut bytes);
        self.stream.write_all(&bytes).unwrap();
    }

    /// Asks a vehicle for the messages of a group.
    fn ask_for(&mut self, system: usize, group: MavDataStream) {
        self.say(&MavMessage::REQUEST_DATA_STREAM(REQUEST_DATA_STREAM_DATA {
            req_message_rate: RATE_HZ,
            target_system: system as u8,
            target_component: 1,
            req_stream_id: group,
            start_stop: 1,
        }));
    }

    /// Returns what comes within 10 ms; `None` when the connection has ended.
    fn hear(&mut self) -> Option<Vec<Frame>> {
        let mut buffer = [0; 16 * 1024];
        match self.stream.read(&mut buffer) {
            Ok(0) => return None,
            Ok(count) => self.reader.push(&buffer[..count]),
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(_) => return None,
        }
        Some(std::iter::from_fn(|| self.reader.next(None)).collect())
    }

    /// Waits for a message.
    fn wait_for(&mut self, is_it: impl Fn(&MavMessage) -> bool) {
        while !self.hears(&is_it) {}
    }

    fn hears(&mut self, is_it: &impl Fn(&MavMessage) -> bool) -> bool {
        let frames = self.hear().expect("it serves");
        let mut messages = frames.iter().filter_map(|frame| match &frame.content {
            Content::Message(message) => Some(message),
            Content::EkfStatus(_) | Content::UnknownCommand { .. } => None,
        });
        messages.any(|message| is_it(message))
    }
}

pub fn heartbeat() {
    let (mut heartbeats, mut waits, mut arms) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..STARTS {
        let mock = Mock::start(&[], 1);
        let mut client = Client::connect(mock.addresses[0]);
        client.wait_for(|message| matches!(message, MavMessage::HEARTBEAT(_)));
        heartbeats.push(mock.began.elapsed().as_secs_f64() * 1e3);
        waits.push(waited_for_core(mock.child.id()).as_secs_f64() * 1e3);
        let is_armed = |message: &MavMessage| match message {
            MavMessage::COMMAND_ACK(ack) => ack.result == MavResult::MAV_RESULT_ACCEPTED,
            _ => false,
        };
        loop {
            client.say(&MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
                command: MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
                param1: 1.0,
                target_system: 1,
                target_component: 1,
                ..COMMAND_LONG_DATA::default()
            }));
            if client.hears(&is_armed) {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        arms.push(mock.began.elapsed().as_secs_f64());
    }
    let (median, worst) = median_and_worst(heartbeats);
    let (waited, _) = median_and_worst(waits);
    println!(
        "heartbeat: first one after the start: median {median:.1} ms, worst {worst:.0} of {STARTS} (wanted < 200 ms); \
         its threads waited {waited:.1} ms for a core"
    );
    let (median, worst) = median_and_worst(arms);
    println!(
        "heartbeat: armed after the start: median {median:.2} s, worst {worst:.2} (wanted < 1 s)"
    );
}

/// What clients have heard.
#[derive(Default)]
struct Heard {
    messages: AtomicU64,
    /// The time of vehicle 1, milliseconds.
    boot_ms: AtomicU32,
}

/// Keeps count of what a client hears, on a thread of its own.
fn count(mut client: Client, heard: &Arc<Heard>) {
    let heard = heard.clone();
    std::thread::spawn(move || {
        while let Some(frames) = client.hear() {
            heard
                .messages
                .fetch_add(frames.len() as u64, Ordering::Relaxed);
            for frame in frames {
                if let (1, Content::Message(message)) = (frame.from.system, frame.content)
                    && let MavMessage::ATTITUDE(attitude) = *message
                {
                    heard
                        .boot_ms
                        .store(attitude.time_boot_ms, Ordering::Relaxed);
                }
            }
        }
    });
}

/// How a process fares.
struct Fared {
    share_of_core: f64,
    messages_per_s: f64,
    /// Seconds of the vehicles in a second of ours.
    pace: f64,
}

fn fare(mock: &Mock, heard: &Heard) -> Fared {
    std::thread::sleep(Duration::from_secs(2));
    let now = || {
        (
            Instant::now(),
            heard.messages.load(Ordering::Relaxed),
            heard.boot_ms.load(Ordering::Relaxed),
        )
    };
    let before = now();
    let share_of_core = share_of_core(mock.child.id(), &[], LASTS);
    let after = now();
    let took_s = after.0.duration_since(before.0).as_secs_f64();
    Fared {
        share_of_core,
        messages_per_s: (after.1 - before.1) as f64 / took_s,
        pace: f64::from(after.2 - before.2) * 1e-3 / took_s,
    }
}

/// Prints the medians.
fn print(what: &str, wanted: &str, all: Vec<Fared>) {
    let median = |of: fn(&Fared) -> f64| median_and_worst(all.iter().map(of).collect()).0;
    println!(
        "{what}: {:.3} of a core, worst {:.3} of {} times {} s (wanted <= {wanted}), {:.0} messages/s, time goes {:.2} times as fast",
        median(|one| one.share_of_core),
        median_and_worst(all.iter().map(|one| one.share_of_core).collect()).1,
        all.len(),
        LASTS.as_secs(),
        median(|one| one.messages_per_s),
        median(|one| one.pace),
    );
}

pub fn sixty() {
    for (arguments, what) in [
        (&["--one-link"][..], "on one link"),
        (&[], "on sixty ports"),
    ] {
        let run = || {
            let endpoints = if arguments.is_empty() { VEHICLES } else { 1 };
            let mock = Mock::start(&[&["--count", "60"], arguments].concat(), endpoints);
            let heard = Arc::<Heard>::default();
            for (index, address) in mock.addresses.iter().enumerate() {
                let mut client = Client::connect(*address);
                let systems = match endpoints {
                    1 => 1..=VEHICLES,
                    _ => index + 1..=index + 1,
                };
                systems
                    .for_each(|system| client.ask_for(system, MavDataStream::MAV_DATA_STREAM_ALL));
                count(client, &heard);
            }
            fare(&mock, &heard)
        };
        let all = (0..TIMES).map(|_| run()).collect();
        let expected = VEHICLES * (MESSAGES * usize::from(RATE_HZ) + 1);
        print(
            &format!("sixty: {what}, {expected} messages/s asked for"),
            "0.5",
            all,
        );
    }
}

pub fn speedup() {
    for (what, group) in [
        ("attitude", MavDataStream::MAV_DATA_STREAM_EXTRA1),
        ("all messages", MavDataStream::MAV_DATA_STREAM_ALL),
    ] {
        let run = || {
            let mock = Mock::start(&["--speedup", "100"], 1);
            let heard = Arc::<Heard>::default();
            let mut client = Client::connect(mock.addresses[0]);
            client.ask_for(1, group);
            count(client, &heard);
            fare(&mock, &heard)
        };
        let all = (0..TIMES).map(|_| run()).collect();
        print(
            &format!("speedup: 100 times, {what} ten times in each of its seconds"),
            "0.1",
            all,
        );
    }
}
