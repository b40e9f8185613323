//! Whoever floods the page's server: with messages, long ones and many, with connections, and by never reading what comes. It goes on
//! answering, a stop of another page reaches the bus, and its memory stays bounded.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::json;
use tomoswarm_proto::VehicleId;

use crate::dash::{Dash, prepared};
use crate::page_figures::memory_mb;
use crate::swarm::Watch;
use crate::websocket::{text_message, upgrade};

/// So long the flood goes on before it is asked how the server fares.
const OVER: Duration = Duration::from_secs(2);
/// Whoever comes is answered within this time, and a stop is on the bus.
const WITHIN: Duration = Duration::from_secs(5);
/// The server takes at most so much more than before the flood, megabytes: each of 64 connections has buffers of its own.
const MORE_MB: f64 = 40.0;

/// What floods have brought about.
#[derive(Default)]
struct Counts {
    messages: AtomicU64,
    connections: AtomicU64,
}

/// Threads that flood until it is dropped.
struct Flood {
    ends: Arc<AtomicBool>,
    counts: Arc<Counts>,
    threads: Vec<JoinHandle<()>>,
}

impl Flood {
    fn new() -> Flood {
        Flood {
            ends: Arc::default(),
            counts: Arc::default(),
            threads: Vec::new(),
        }
    }

    /// Floods in a further thread, in rounds.
    fn with(&mut self, mut round: impl FnMut(&Counts) + Send + 'static) {
        let (ends, counts) = (self.ends.clone(), self.counts.clone());
        self.threads.push(std::thread::spawn(move || {
            while !ends.load(Ordering::Relaxed) {
                round(&counts);
            }
        }));
    }
}

impl Drop for Flood {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Opens the feed, as long as there is room.
fn feed(port: u16) -> Option<TcpStream> {
    let own = format!("127.0.0.1:{port}");
    let (stream, head) = upgrade(
        port,
        "/feed",
        &format!("Host: {own}\r\nOrigin: http://{own}\r\n"),
    );
    // Whoever is not read blocks no flood for ever.
    stream
        .set_write_timeout(Some(Duration::from_secs(1)))
        .ok()?;
    head.contains(" 101 ").then_some(stream)
}

/// Says a message again and again over a connection; returns how many of them went out before it was closed.
fn say(mut stream: &TcpStream, message: &[u8], times: u64) -> u64 {
    let said = (0..times).take_while(|_| stream.write_all(message).is_ok());
    said.count() as u64
}

/// Asks until there is an answer, as pages do, and returns it; `None` = it is refused because of the flood, or there was no room.
fn asked(port: u16, request: &str) -> Option<u16> {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
    stream.set_read_timeout(Some(WITHIN)).ok()?;
    stream.write_all(request.as_bytes()).ok()?;
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    let head = String::from_utf8_lossy(&answer);
    let status = head.split(' ').nth(1)?.parse().ok()?;
    (status != 429).then_some(status)
}

/// Asks again as pages do until it is answered; returns the status, how long it took, and how often it was said.
fn insisted(port: u16, request: &str) -> (u16, Duration, u32) {
    let (began, mut times) = (Instant::now(), 0);
    loop {
        times += 1;
        if let Some(status) = asked(port, request) {
            return (status, began.elapsed(), times);
        }
        assert!(began.elapsed() < WITHIN, "no answer: {request:.30}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn floods_keep_no_stop_out_and_take_little_memory() {
    let mut swarm = prepared();
    swarm.run();
    let dash = Dash::start(&mut swarm);
    let (port, look) = (dash.port, Dash::token(&dash.look).to_owned());
    swarm.until("all are there", 60, |watch| {
        (1..=2).all(|id| watch.view.state(VehicleId(id)).is_some())
    });
    let own = format!("127.0.0.1:{port}");
    let page = format!("GET / HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\n\r\n");
    let stop = r#"{"order":"stop","page":1}"#;
    let stop = format!(
        "POST /order HTTP/1.1\r\nHost: {own}\r\nOrigin: http://{own}\r\nAuthorization: Bearer {}\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n{stop}",
        Dash::token(&dash.operate),
        stop.len()
    );
    assert_eq!(insisted(port, &page).0, 200);
    let server = swarm.process_id("dash");
    let before_mb = memory_mb(server, "VmHWM");

    let mut flood = Flood::new();
    let hello = text_message(&json!({ "token": look }).to_string());
    let credit = text_message(r#"{"credit":1000}"#);
    let long = text_message(&"x".repeat(5000));
    // Three pages that never read, and say all the time that they have.
    for _ in 0..3 {
        let (hello, credit) = (hello.clone(), credit.clone());
        flood.with(move |counts| {
            let Some(stream) = feed(port) else {
                return;
            };
            let said = say(&stream, &hello, 1) + say(&stream, &credit, 5000);
            counts.messages.fetch_add(said, Ordering::Relaxed);
        });
    }
    // Long messages of one that has a token, and of one that has none.
    for first in [hello, Vec::new()] {
        let long = long.clone();
        flood.with(move |counts| {
            let Some(stream) = feed(port) else {
                return;
            };
            let said = say(&stream, &first, 1) + say(&stream, &long, 1000);
            counts.messages.fetch_add(said, Ordering::Relaxed);
        });
    }
    // Connections that say half of something, the last hundred of which are held.
    let mut held = std::collections::VecDeque::new();
    flood.with(move |counts| {
        let Ok(mut stream) = TcpStream::connect(("127.0.0.1", port)) else {
            return;
        };
        let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: ");
        held.push_back(stream);
        if held.len() > 100 {
            held.pop_front();
        }
        counts.connections.fetch_add(1, Ordering::Relaxed);
        std::thread::sleep(Duration::from_millis(1));
    });
    std::thread::sleep(OVER);

    let (status, page_took, page_times) = insisted(port, &page);
    assert_eq!(status, 200);
    let began = Instant::now();
    let (status, stop_took, stop_times) = insisted(port, &stop);
    assert_eq!(status, 200);
    let is_open = |watch: &Watch| !watch.view.open_stops().is_empty();
    while !swarm.look(is_open) {
        assert!(began.elapsed() < WITHIN, "no stop on the bus");
        std::thread::sleep(Duration::from_millis(1));
    }
    let on_bus = began.elapsed();
    let more_mb = memory_mb(server, "VmHWM") - before_mb;
    let [messages, connections] = [&flood.counts.messages, &flood.counts.connections]
        .map(|count| count.load(Ordering::Relaxed));
    println!(
        "{messages} messages, {connections} connections: the page is answered after {page_took:?} ({page_times} times asked), a stop \
         after {stop_took:?} ({stop_times}), on the bus after {on_bus:?}; {more_mb:.1} MB more than {before_mb:.1}"
    );
    assert!(messages > 2000 && connections > 300, "no flood");
    assert!(page_took < WITHIN && stop_took < WITHIN);
    assert!(more_mb < MORE_MB, "{more_mb} MB more");
}
