//! A node's part of the bus inside this test, with what it heard; opened by the same settings as the programs use.

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tomoswarm::config::{self, BusFile, Config, Venue};
use tomoswarm::run::bus::{BusSession, BusSettings, HeardMessage, Publisher};
use tomoswarm::run::clock::Clock;
use tomoswarm::run::mailbox::Troubles;
use tomoswarm::run::membership;
use tomoswarm_proto::{Message, MissionProgress, Progress, RunId, Sender, VehicleId};

/// A node's part of the bus.
pub struct Member {
    pub publisher: Publisher,
    heard: Arc<Mutex<Vec<HeardMessage>>>,
    _bus: BusSession,
}

impl Member {
    /// Joins.
    pub fn join(settings: BusSettings) -> Member {
        let heard = Arc::new(Mutex::new(Vec::new()));
        let writes = heard.clone();
        let hear = move |what| writes.lock().unwrap().push(what);
        let bus = BusSession::open(settings, Clock::start(), Troubles::default(), hear).unwrap();
        let publisher = bus.publisher();
        publisher.speak();
        Member {
            publisher,
            heard,
            _bus: bus,
        }
    }

    /// Returns all that it heard of a node so far.
    pub fn heard_of(&self, node: Sender) -> Vec<HeardMessage> {
        let is_its = |heard: &&HeardMessage| match heard {
            HeardMessage::Message(sender, _) => *sender == node,
            HeardMessage::Greeting(greeting, _) => greeting.node == node,
            HeardMessage::Unknown(_) => false,
        };
        self.heard
            .lock()
            .unwrap()
            .iter()
            .filter(is_its)
            .cloned()
            .collect()
    }

    /// Returns how much it heard so far.
    pub fn heard_count(&self) -> usize {
        self.heard.lock().unwrap().len()
    }
}

/// Returns how the node of a file joins the bus, with its certificates.
pub fn settings(path: &Path) -> BusSettings {
    let (node, venue, bus) = read(path);
    let access = membership::access(node, &venue, &bus, None).unwrap();
    membership::bus_settings(node, &venue, &bus, access)
}

fn read(path: &Path) -> (Sender, Venue, BusFile) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut loader = |path: &str| std::fs::read_to_string(path).map_err(|error| error.to_string());
    match config::read(path.to_str().unwrap(), &text, &mut loader).unwrap() {
        Config::Vehicle(file) => (
            Sender::Vehicle(file.id),
            file.venue.clone(),
            file.bus.clone(),
        ),
        Config::Ground(file) => (Sender::Ground, file.venue.clone(), file.bus.clone()),
        Config::Operator(file) => (
            Sender::Operator(file.id),
            file.venue.clone(),
            file.bus.clone(),
        ),
        other => panic!("{other:?}"),
    }
}

/// Something harmless that a vehicle may say of itself.
pub fn progress(vehicle: u8, run: u32) -> Message {
    let progress = Progress {
        run: RunId(run),
        ..Progress::default()
    };
    Message::Mission(MissionProgress {
        vehicle: VehicleId(vehicle),
        progress,
        ..MissionProgress::default()
    })
}

/// Waits until something holds; `false` when it does not within the time.
pub fn within(limit: Duration, mut holds: impl FnMut() -> bool) -> bool {
    let began = Instant::now();
    loop {
        if holds() {
            return true;
        }
        if began.elapsed() > limit {
            return false;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}
