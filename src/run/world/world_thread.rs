//! The world's own thread: lets things happen when their time has come, hands words to the world in between, and what
//! it says to the connections. Who is connected is its matter; what is true in the world is not.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use tomoswarm_proto::{Boot, VehicleId};

use super::live_world::{LiveWorld, VehicleWord};
use super::outgoing::{FramePriority, Outgoing};
#[cfg(feature = "hw")]
use super::xbee_ptys::{FromHost, XbeePtys};
use crate::run::link::{FromWorld, LinkRefusal, ToWorld, Welcome, WorldStatus, encode};
use crate::run::mavlink_port::MavlinkPort;
use crate::run::mavlink_sockets::FromClient;
use crate::time::Time;

/// Something for the world's thread.
#[derive(Debug)]
pub(super) enum Inbound {
    /// A connection that has shown the token wants to drive a vehicle.
    Join {
        /// Number of the connection.
        connection: u64,
        /// Which vehicle.
        vehicle: VehicleId,
        /// Which start of its software.
        boot: Boot,
        /// Where answers go.
        outgoing: Arc<Outgoing>,
    },
    /// A connection that has shown the token wants to direct.
    Control {
        /// Number of the connection.
        connection: u64,
        /// Where answers go.
        outgoing: Arc<Outgoing>,
    },
    /// A connection has said something more.
    Word {
        /// Number of the connection.
        connection: u64,
        /// What it said.
        word: ToWorld,
    },
    /// A connection has ended.
    Gone {
        /// Its number.
        connection: u64,
    },
    /// A client of an autopilot has done something.
    Client(FromClient),
    /// The host of a vehicle's radio has done something.
    #[cfg(feature = "hw")]
    Host(usize, FromHost),
    /// The world shall end.
    End,
}

impl Inbound {
    /// Returns what a client of an autopilot has done, if it is that.
    pub(super) fn client(self) -> Option<FromClient> {
        match self {
            Inbound::Client(word) => Some(word),
            Inbound::Join { .. }
            | Inbound::Control { .. }
            | Inbound::Word { .. }
            | Inbound::Gone { .. }
            | Inbound::End => None,
            #[cfg(feature = "hw")]
            Inbound::Host(..) => None,
        }
    }
}

/// By what else than its socket a world is spoken with.
#[derive(Default)]
pub(super) struct Served {
    /// Autopilots, over MAVLink.
    pub port: Option<MavlinkPort>,
    /// Radios, by real frames.
    #[cfg(feature = "hw")]
    pub radios: Option<XbeePtys>,
}

/// What a connection is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Role {
    /// It drives the vehicle of this index.
    Drives(usize),
    /// It directs.
    Directs,
}

/// The world's thread.
pub(super) struct WorldThread {
    world: LiveWorld,
    began: Instant,
    connections: BTreeMap<u64, (Role, Arc<Outgoing>)>,
    output: Vec<VehicleWord>,
    is_ended: bool,
    /// Where autopilots are flown over MAVLink.
    port: Option<MavlinkPort>,
    /// Where radios are spoken to by real frames.
    #[cfg(feature = "hw")]
    radios: Option<XbeePtys>,
}

impl WorldThread {
    /// Begins the world's time.
    pub(super) fn new(world: LiveWorld, served: Served) -> WorldThread {
        WorldThread {
            port: served.port,
            #[cfg(feature = "hw")]
            radios: served.radios,
            world,
            began: Instant::now(),
            connections: BTreeMap::new(),
            output: Vec::new(),
            is_ended: false,
        }
    }

    /// Runs the world until it is ended; returns how it went.
    pub(super) fn run(mut self, inbox: &Receiver<Inbound>) -> WorldStatus {
        while !self.is_ended {
            let port_due = self
                .port
                .as_ref()
                .map_or(Time::NEVER, MavlinkPort::deadline);
            let due = self.world.next_at().min(port_due);
            #[cfg(feature = "hw")]
            let due = due.min(self.radios.as_ref().map_or(Time::NEVER, XbeePtys::deadline));
            let wait = due.since(self.now());
            let inbound = match inbox.recv_timeout(wait.min(Duration::from_secs(3600))) {
                Ok(inbound) => Some(inbound),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            let now = self.now();
            self.world.advance(now, &mut self.output);
            self.hand_out();
            if let Some(inbound) = inbound {
                self.take(inbound);
                self.hand_out();
            }
            if let Some(port) = &mut self.port {
                port.due(now, self.world.environment());
            }
            #[cfg(feature = "hw")]
            if let Some(radios) = &mut self.radios {
                radios.due(now, self.world.environment());
            }
        }
        self.connections
            .values()
            .for_each(|(_, outgoing)| outgoing.close());
        self.status()
    }

    /// Returns how it is going; beacons of real frames count as well.
    fn status(&mut self) -> WorldStatus {
        #[cfg_attr(not(feature = "hw"), allow(unused_mut, reason = "no radios add to it"))]
        let mut status = self.world.status();
        #[cfg(feature = "hw")]
        if let Some(radios) = &self.radios {
            radios.count(&mut status);
        }
        status
    }

    fn now(&self) -> Time {
        Time::ZERO + self.began.elapsed()
    }

    fn hand_out(&mut self) {
        for (index, word) in self.output.drain(..) {
            let role = Role::Drives(index);
            let driver = self
                .connections
                .values()
                .find(|(drives, _)| *drives == role);
            if let Some((_, outgoing)) = driver {
                say(outgoing, &word);
            }
        }
    }

    fn take(&mut self, inbound: Inbound) {
        match inbound {
            Inbound::Join {
                connection,
                vehicle,
                boot,
                outgoing,
            } => {
                self.join(connection, vehicle, boot, outgoing);
            }
            Inbound::Control {
                connection,
                outgoing,
            } => {
                let now_ns = self.now().as_nanos();
                say(
                    &outgoing,
                    &FromWorld::Welcome(Welcome {
                        now_ns,
                        start: None,
                    }),
                );
                self.connections
                    .insert(connection, (Role::Directs, outgoing));
            }
            Inbound::Word { connection, word } => match self.connections.get(&connection) {
                Some((Role::Drives(index), _)) => self.world.obey(*index, word, &mut self.output),
                Some((Role::Directs, outgoing)) => self.direct(word, &outgoing.clone()),
                // It was replaced or refused meanwhile.
                None => {}
            },
            Inbound::Gone { connection } => match self.connections.remove(&connection) {
                Some((Role::Drives(index), outgoing)) => {
                    outgoing.close();
                    self.world.leave(index);
                }
                Some((Role::Directs, outgoing)) => outgoing.close(),
                None => {}
            },
            Inbound::Client(word) => {
                let now = self.now();
                self.world.advance(now, &mut self.output);
                if let Some(port) = &mut self.port {
                    port.take(now, word, self.world.environment());
                }
            }
            #[cfg(feature = "hw")]
            Inbound::Host(vehicle, said) => {
                let now = self.now();
                if let Some(radios) = &mut self.radios {
                    radios.take(now, vehicle, said);
                }
            }
            Inbound::End => self.is_ended = true,
        }
    }

    fn join(&mut self, connection: u64, vehicle: VehicleId, boot: Boot, outgoing: Arc<Outgoing>) {
        let (index, welcome) = match self.world.join(vehicle, boot) {
            Ok(joined) => joined,
            Err(refused) => {
                refuse(&outgoing, refused);
                return;
            }
        };
        let role = Role::Drives(index);
        let replaced: Vec<u64> = self
            .connections
            .iter()
            .filter(|(_, (other, _))| *other == role)
            .map(|(key, _)| *key)
            .collect();
        for key in replaced {
            if let Some((_, old)) = self.connections.remove(&key) {
                refuse(&old, LinkRefusal::Replaced { vehicle, by: boot });
            }
        }
        say(&outgoing, &FromWorld::Welcome(welcome));
        self.connections.insert(connection, (role, outgoing));
    }

    fn direct(&mut self, word: ToWorld, outgoing: &Outgoing) {
        let answer = match word {
            ToWorld::Enter => {
                self.world.enter();
                FromWorld::Status(self.status())
            }
            ToWorld::Report => FromWorld::Status(self.status()),
            ToWorld::Track { vehicle, from } => FromWorld::Places(self.world.places(vehicle, from)),
            ToWorld::Stop => {
                self.is_ended = true;
                FromWorld::Status(self.status())
            }
            ToWorld::Join { .. }
            | ToWorld::Control { .. }
            | ToWorld::Autopilot(_)
            | ToWorld::Steer(_)
            | ToWorld::Ping(_)
            | ToWorld::Transmit(_) => FromWorld::Refused(LinkRefusal::Garbage),
        };
        say(outgoing, &answer);
    }
}

fn say(outgoing: &Outgoing, word: &FromWorld) {
    let worth = match word {
        FromWorld::Autopilot(_) => FramePriority::Report,
        FromWorld::Welcome(_)
        | FromWorld::Refused(_)
        | FromWorld::Ack(_)
        | FromWorld::Echo(_)
        | FromWorld::Heard { .. }
        | FromWorld::Unsent(_)
        | FromWorld::Status(_)
        | FromWorld::Places(_) => FramePriority::Word,
    };
    // Every word of ours can be written; one that could not would be missed like a lost one.
    if let Ok(frame) = encode(word) {
        outgoing.push(worth, frame);
    }
}

/// Says why a connection is ended; it ends when that is written.
pub(super) fn refuse(outgoing: &Outgoing, refused: LinkRefusal) {
    say(outgoing, &FromWorld::Refused(refused));
    outgoing.close();
}
