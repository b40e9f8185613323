//! The world as a process of its own, on real time: bodies, range sensors, radios and the referee for vehicles that are
//! other processes. It speaks with their simulated drivers over [`super::link`], never over the bus.
//!
//! One thread owns the world (`LiveWorld`, which reads no clock); each connection has a reader and a writer. Nothing a
//! connection does stops the world: what it says waits in a bounded queue, and what it does not read is dropped, oldest
//! telemetry first.
//!
//! ```text
//!   socket ─► reader ─► queue of words ─► the world's thread ─► outgoing queue ─► writer ─► socket
//! ```
//!
//! It does not keep anything: a world that is started again begins anew, with everybody at home.

mod connection_limit;
mod listener;
mod live_world;
mod outgoing;
#[cfg(test)]
mod tests;
mod world_thread;
#[cfg(feature = "hw")]
mod xbee_ptys;

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::link::{TOKEN_LIMIT, WorldStatus};
use super::mavlink_port::{MavlinkPort, PortError, PortSettings};
use super::mavlink_sockets::by_queue;
#[cfg(feature = "hw")]
use crate::sim::environment::Environment;
#[cfg(feature = "hw")]
use crate::sim::noise::Noise;
use crate::sim::{Scenario, ScenarioError};

use connection_limit::ConnectionLimit;
use listener::{Listener, connection_limit};
use live_world::LiveWorld;
use world_thread::{Inbound, Served, WorldThread};
#[cfg(feature = "hw")]
use xbee_ptys::{PtySettings, XbeePtys};

/// Words that wait for the world; whoever says more waits.
const WORDS_WAITING: usize = 1024;
/// Last words are written within this time, or not at all.
const ENDS_WITHIN: Duration = Duration::from_secs(1);

/// Why a world cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// It listens on this machine only.
    #[error("the world listens on a loopback address only, such as 127.0.0.1:0; got {address}")]
    NotLoopback {
        /// The address asked for.
        address: SocketAddr,
    },
    /// The token is too long.
    #[error("a token has at most {TOKEN_LIMIT} bytes, got {length}")]
    Token {
        /// Its length.
        length: usize,
    },
    /// The scenario is impossible.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// Autopilots cannot be served.
    #[error(transparent)]
    Port(#[from] PortError),
    /// There are no pseudo-terminals.
    #[error("{}: {source}", folder.display())]
    Radios {
        /// The folder for them.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// This build has none.
    #[error("this build has no serial ports")]
    NoRadios,
    /// The address is not free, or may not be used.
    #[error(
        "{address} cannot be listened on: {source}; choose another port, or 0 for any that is free"
    )]
    Listen {
        /// The address asked for.
        address: SocketAddr,
        /// Why.
        source: io::Error,
    },
    /// No thread can be started.
    #[error("the world has no thread: {0}")]
    Thread(io::Error),
}

/// A world that runs until it is ended; dropping it ends it.
pub struct WorldServer {
    address: SocketAddr,
    autopilots: Vec<SocketAddr>,
    stopper: WorldStopper,
    world: Option<JoinHandle<WorldStatus>>,
    listener: Option<JoinHandle<()>>,
    connections: Arc<ConnectionLimit>,
    is_ended: Arc<AtomicBool>,
}

/// Ends a world from anywhere.
#[derive(Clone)]
pub struct WorldStopper {
    words: SyncSender<Inbound>,
}

impl WorldStopper {
    /// Asks the world to end; [`WorldServer::wait`] returns soon after.
    pub fn stop(&self) {
        // A world that has ended already needs no word.
        let _ = self.words.send(Inbound::End);
    }
}

impl WorldServer {
    /// Begins the world of a scenario. Port 0 takes a free one. With a port for MAVLink all vehicles are just switched on;
    /// with a folder each has a radio at a pseudo-terminal in it.
    ///
    /// # Errors
    /// [`WorldError`].
    pub fn start(
        scenario: &Scenario,
        listen: SocketAddr,
        token: &str,
        port: Option<&PortSettings>,
        radios: Option<&Path>,
    ) -> Result<WorldServer, WorldError> {
        if !listen.ip().is_loopback() {
            return Err(WorldError::NotLoopback { address: listen });
        }
        if token.len() > TOKEN_LIMIT {
            return Err(WorldError::Token {
                length: token.len(),
            });
        }
        let mut world = LiveWorld::new(scenario, port.is_some())?;
        let listener = TcpListener::bind(listen).map_err(|source| WorldError::Listen {
            address: listen,
            source,
        })?;
        let (words, inbox) = sync_channel(WORDS_WAITING);
        let told = || by_queue(words.clone(), Inbound::Client, Inbound::client);
        let port = port
            .map(|settings| MavlinkPort::open(world.environment(), settings, told()))
            .transpose()?;
        #[cfg(not(feature = "hw"))]
        if radios.is_some() {
            return Err(WorldError::NoRadios);
        }
        let served = Served {
            port,
            #[cfg(feature = "hw")]
            radios: radios
                .map(|folder| open_radios(scenario, folder, world.environment(), &words))
                .transpose()?,
        };
        WorldServer::open(world, listener, token, (words, inbox), served)
            .map_err(WorldError::Thread)
    }

    fn open(
        world: LiveWorld,
        socket: TcpListener,
        token: &str,
        (words, inbox): (SyncSender<Inbound>, Receiver<Inbound>),
        served: Served,
    ) -> io::Result<WorldServer> {
        let address = socket.local_addr()?;
        let autopilots = served.port.as_ref().map(|port| port.addresses().to_vec());
        let is_ended = Arc::new(AtomicBool::new(false));
        let connections = Arc::new(connection_limit(world.vehicles()));
        let listener = Listener::new(
            token.as_bytes(),
            connections.clone(),
            words.clone(),
            is_ended.clone(),
        );
        let thread = std::thread::Builder::new()
            .name("world".to_owned())
            .spawn(move || WorldThread::new(world, served).run(&inbox))?;
        let mut server = WorldServer {
            address,
            autopilots: autopilots.unwrap_or_default(),
            stopper: WorldStopper { words },
            world: Some(thread),
            listener: None,
            connections,
            is_ended,
        };
        let named = std::thread::Builder::new().name("world listener".to_owned());
        server.listener = Some(named.spawn(move || listener.serve(&socket))?);
        Ok(server)
    }

    /// Returns where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns where its autopilots are flown over MAVLink, each vehicle in turn; empty = nowhere.
    pub fn autopilots(&self) -> &[SocketAddr] {
        &self.autopilots
    }

    /// Returns what ends it.
    pub fn stopper(&self) -> WorldStopper {
        self.stopper.clone()
    }

    /// Waits until it is ended, by its stopper or by a word of control; returns how it went.
    pub fn wait(mut self) -> WorldStatus {
        self.join()
    }

    fn join(&mut self) -> WorldStatus {
        let status = self
            .world
            .take()
            .and_then(|thread| thread.join().ok())
            .unwrap_or_default();
        self.is_ended.store(true, Ordering::Release);
        if let Some(listener) = self.listener.take() {
            // The listener waits for somebody to come; this is nobody, and it sees that the world has ended.
            let _ = TcpStream::connect(self.address);
            // The listener has nothing to tell.
            let _ = listener.join();
        }
        self.connections.wait_for_end(ENDS_WITHIN);
        status
    }
}

/// Opens a radio for each vehicle, as the scenario has them.
#[cfg(feature = "hw")]
fn open_radios(
    scenario: &Scenario,
    folder: &Path,
    environment: &Environment,
    words: &SyncSender<Inbound>,
) -> Result<XbeePtys, WorldError> {
    let sim = scenario.sim();
    let settings = PtySettings {
        folder: folder.to_owned(),
        venue: sim.venue.clone(),
        power_dbm: sim.radio.own.power_dbm,
        noise: Noise::new(sim.seed),
    };
    let words = words.clone();
    let told = move |vehicle, said| {
        // A world that has ended hears nothing.
        let _ = words.send(Inbound::Host(vehicle, said));
    };
    XbeePtys::open(&settings, environment, told).map_err(|source| WorldError::Radios {
        folder: folder.to_owned(),
        source,
    })
}

impl Drop for WorldServer {
    fn drop(&mut self) {
        if self.world.is_some() {
            self.stopper.stop();
            self.join();
        }
    }
}
