//! What the server of the operator's page costs, without its sockets: `cargo bench --no-default-features --bench page`.
//!
//! - The feed of a page and the server's time with 8 and with 50 vehicles. The 50 are made of 8 simulated ones: what each says
//!   is said by up to six others as well.
//! - The server's time and memory with five pages after six hours (`-- 1` = one hour) of eight vehicles.
//!
//! Pages read at once, as one on the same machine does, so this is the most that they can be sent.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    reason = "no product code"
)]

#[path = "eight/mod.rs"]
mod eight;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{Read as _, Write as _};
use std::rc::Rc;
use std::time::{Duration, Instant};

use self::eight::{VEHICLES, scenario};
use serde_json::json;
use tomoswarm::dash::board::Board;
use tomoswarm::dash::frame::FrameKind;
use tomoswarm::dash::gate::{Gate, PageId};
use tomoswarm::dash::page_server::{PageEffect, PageServer};
use tomoswarm::dash::texts::place;
use tomoswarm::dash::told::Showing;
use tomoswarm::geom::Lattice;
use tomoswarm::operator::HeardMessage;
use tomoswarm::sim::Scenario;
use tomoswarm::sim::bus::BusListener;
use tomoswarm::time::Time;
use tomoswarm_proto::{Message, Sender, VehicleId, codec};

const LOOK: &str = "00112233445566778899aabbccddeeff";
const MANY: u8 = 50;
/// What is measured is said in this time, while all drive.
const FROM_S: f64 = 120.0;
const FOR_S: f64 = 60.0;
/// What the process is told that serves.
const SERVES: &str = "serve";
/// A page is sent what is due at most this often.
const TURN: Duration = Duration::from_millis(20);

/// The server of a live page.
fn server(scenario: &Scenario) -> PageServer {
    let venue = scenario.sim().venue.clone();
    let board = Board::new(venue.hash(), Lattice::new(venue.cell_m));
    let gate = Gate::new(LOOK.to_owned(), LOOK.replace('0', "1"));
    let place = place(&venue, Showing::Live);
    PageServer::new(place, venue, board, gate)
}

fn heard(scenario: &Scenario, mut hears: impl FnMut(Time, &HeardMessage) + 'static) {
    let listener = BusListener::new(move |now, heard| hears(now, heard));
    let ended = scenario.run_heard(&mut |_| true, listener);
    ended.expect("it runs");
}

/// What another vehicle says that is like one that was simulated; `None` of what is said by others, and for more than there
/// are.
fn as_said_by_another(heard: &HeardMessage, more: u8) -> Option<HeardMessage> {
    let HeardMessage::Message(Sender::Vehicle(sender), message) = heard else {
        return None;
    };
    let other = |id: VehicleId| VehicleId(id.0 + more);
    let mut message = message.clone();
    match &mut message {
        Message::State(state) => state.vehicle = other(state.vehicle),
        Message::Mission(mission) => mission.vehicle = other(mission.vehicle),
        Message::Health(health) => health.vehicle = other(health.vehicle),
        Message::Tile(tile) => tile.layer.vehicle = other(tile.layer.vehicle),
        Message::Log(log) => log.node = Sender::Vehicle(other(*sender)),
        Message::Samples(batch) => {
            batch.vehicle = other(batch.vehicle);
            for sample in &mut batch.samples {
                sample.transmitter = other(sample.transmitter);
            }
        }
        _ => return None,
    }
    let sender = other(*sender);
    (sender.0 <= MANY).then_some(HeardMessage::Message(Sender::Vehicle(sender), message))
}

/// Pages that read at once.
struct Readers {
    pages: Vec<PageId>,
    frames: u64,
    bytes: u64,
    /// Bytes of each kind of frame, by its number.
    kinds: BTreeMap<u8, u64>,
    /// What the server has computed for.
    spent: Duration,
}

impl Readers {
    fn open(server: &mut PageServer, now: Time, pages: usize) -> Readers {
        let opened = (0..pages).map(|_| {
            let page = server.open(now).expect("there is room");
            let token = json!({ "token": LOOK }).to_string();
            server.page_said(now, page, &token).expect("it may look");
            page
        });
        Readers {
            pages: opened.collect(),
            frames: 0,
            bytes: 0,
            kinds: BTreeMap::new(),
            spent: Duration::ZERO,
        }
    }

    /// Has all that is due sent and read.
    fn read(&mut self, server: &mut PageServer, now: Time) {
        let began = Instant::now();
        loop {
            let mut is_sent = false;
            for effect in server.due(now) {
                if let PageEffect::Send(page, frame) = effect {
                    self.frames += 1;
                    *self.kinds.entry(frame[0]).or_default() += frame.len() as u64;
                    self.bytes += frame.len() as u64;
                    is_sent = true;
                    let credit = r#"{"credit":1}"#;
                    server.page_said(now, page, credit).expect("it is open");
                }
            }
            if !is_sent {
                break;
            }
        }
        self.spent += began.elapsed();
    }

    /// Has a server hear what was said, and pages read meanwhile; returns how long that took by the clock of what was said.
    fn follow(&mut self, server: &mut PageServer, said: &[(Time, HeardMessage)]) -> f64 {
        let (began, ended) = (said[0].0, said[said.len() - 1].0);
        // A page that has just come is sent all that there is.
        self.read(server, began);
        (self.frames, self.bytes, self.spent) = (0, 0, Duration::ZERO);
        self.kinds.clear();
        let mut turn = began;
        for (at, heard) in said {
            while turn <= *at {
                self.read(server, turn);
                turn = turn + TURN;
            }
            let began = Instant::now();
            server.hear(*at, heard);
            self.spent += began.elapsed();
        }
        ended.since(began).as_secs_f64()
    }

    fn print(&self, vehicles: u8, seconds: f64) {
        let pages = self.pages.len() as f64;
        for (number, bytes) in &self.kinds {
            let kind = FrameKind::ALL
                .into_iter()
                .find(|kind| *kind as u8 == *number);
            let each = *bytes as f64 / seconds / pages / 1e3;
            let name = kind.map_or("?".to_owned(), |kind| format!("{kind:?}"));
            println!("  {name}: {each:.2} kB/s");
        }
        println!(
            "{vehicles} vehicles, {pages} pages: {:.1} kB/s a page, {:.1} frames/s; the server computes for {:.2} % of the time",
            self.bytes as f64 / seconds / pages / 1e3,
            self.frames as f64 / seconds / pages,
            self.spent.as_secs_f64() / seconds * 100.0
        );
    }
}

/// The memory that this process has now by a line of its status, bytes; `None` where the system does not say it.
fn memory(of: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(of))?;
    let kb: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kb * 1024.0)
}

fn main() {
    let hours: f64 = std::env::args()
        .filter_map(|arg| arg.parse().ok())
        .next()
        .unwrap_or(6.0);
    if std::env::args().any(|arg| arg == SERVES) {
        return serve(hours);
    }
    let from = Time::from_secs_f64(FROM_S);
    let of_eight = scenario(FROM_S + FOR_S);
    let said = Rc::new(RefCell::new(Vec::new()));
    let keep = said.clone();
    heard(&of_eight, move |now, heard| {
        keep.borrow_mut().push((now, heard.clone()));
    });
    let said = said.take();
    let many: Vec<(Time, HeardMessage)> = said
        .iter()
        .flat_map(|(at, heard)| {
            let others = (VEHICLES..MANY).step_by(VEHICLES.into());
            let others = others.filter_map(|more| as_said_by_another(heard, more));
            let all = std::iter::once(heard.clone()).chain(others);
            all.map(|heard| (*at, heard)).collect::<Vec<_>>()
        })
        .collect();
    for (vehicles, said) in [(VEHICLES, said), (MANY, many)] {
        let mut server = server(&of_eight);
        let split = said.partition_point(|(at, _)| *at < from);
        for (at, heard) in &said[..split] {
            server.hear(*at, heard);
        }
        let mut readers = Readers::open(&mut server, from, 1);
        let seconds = readers.follow(&mut server, &said[split..]);
        readers.print(vehicles, seconds);
    }

    serve_in_a_process_of_its_own(hours);
}

/// Simulates some hours and has another process serve them, so that its memory is the server's alone.
fn serve_in_a_process_of_its_own(hours: f64) {
    let program = std::env::current_exe().expect("it runs");
    let mut child = std::process::Command::new(program)
        .args([SERVES, &hours.to_string()])
        // As a ground station starts it.
        .env("MALLOC_MMAP_THRESHOLD_", "131072")
        .stdin(std::process::Stdio::piped())
        .spawn()
        .expect("it starts");
    let pipe = child.stdin.take().expect("it is piped");
    let mut pipe = std::io::BufWriter::new(pipe);
    heard(&scenario(hours * 3600.0), move |now, heard| {
        let said = codec::pack(&(now, heard)).expect("it can be packed");
        let length = (said.len() as u32).to_le_bytes();
        pipe.write_all(&length).expect("it reads");
        pipe.write_all(&said).expect("it reads");
    });
    assert!(child.wait().expect("it ends").success());
}

/// Serves what comes in, the last minute of it to five pages.
fn serve(hours: f64) {
    let split = Time::from_secs_f64(hours * 3600.0 - FOR_S);
    let mut server = server(&scenario(hours * 3600.0));
    let (before, mut after) = (memory("VmRSS:"), None);
    let mut last: Vec<(Time, HeardMessage)> = Vec::new();
    let (mut pipe, mut said, mut length) = (std::io::stdin().lock(), Vec::new(), [0; 4]);
    while pipe.read_exact(&mut length).is_ok() {
        said.resize(u32::from_le_bytes(length) as usize, 0);
        pipe.read_exact(&mut said).expect("it is whole");
        let (at, heard): (Time, HeardMessage) = codec::unpack(&said).expect("it was said");
        if at < split {
            server.hear(at, &heard);
        } else {
            // What is kept from here on is not the server's.
            after = after.or_else(|| memory("VmRSS:"));
            last.push((at, heard));
        }
    }
    let mut readers = Readers::open(&mut server, split, 5);
    let seconds = readers.follow(&mut server, &last);
    println!("after {hours} h:");
    readers.print(VEHICLES, seconds);
    if let (Some(before), Some(after)) = (before, after) {
        let kept = (after - before) / 1e6;
        println!("memory: {kept:.0} MB more than before the first message");
    }
    if let (Some(whole), Some(own)) = (memory("VmRSS:"), memory("RssAnon:")) {
        let (whole, own) = (whole / 1e6, own / 1e6);
        println!(
            "with the last minute and five pages: {whole:.0} MB, {own:.0} MB of them without pages of files"
        );
    }
}
