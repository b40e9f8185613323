//! The vehicle's end of the link: connects to the world for ever anew, hands on what the devices say, and carries what
//! the vehicle wants done. It decides nothing, and keeps nothing while the world is away: an old order is no order.

use std::io;
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use tomoswarm_proto::codec::{self, Decoded};
use tomoswarm_proto::{Boot, Message, VehicleId};

use super::{FromWorld, LinkRefusal, ToWorld, Welcome, decode, encode, read_frame, write_frame};
use crate::node::radio::HeardBeacon;
use crate::node::{Effect, Event};

/// Between two tries to connect.
const RETRY: Duration = Duration::from_millis(250);
/// A try to connect takes at most this long, and so does the world's answer.
const CONNECT_WITHIN: Duration = Duration::from_secs(1);
/// A world that takes no word for this long is given up.
const WRITE_WITHIN: Duration = Duration::from_millis(100);

/// Where the world is, and who wants to move a body in it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct WorldLinkSettings {
    /// Where the world listens.
    pub address: SocketAddr,
    /// Its token.
    pub token: String,
    /// Which vehicle.
    pub vehicle: VehicleId,
    /// Which start of its software.
    pub boot: Boot,
}

/// How the link stands.
#[derive(Clone, PartialEq, Debug)]
pub enum LinkState {
    /// It is being made; with what went wrong last, if anything did.
    Connecting(Option<String>),
    /// The world listens.
    Joined(Welcome),
    /// The world does not want this vehicle now; it is asked again and again all the same.
    Refused(LinkRefusal),
}

/// A vehicle's link to the world; dropping it ends it.
pub struct WorldLink {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// Gets what the devices say.
type EventCallback = Box<dyn FnMut(Event) + Send>;

struct Shared {
    settings: WorldLinkSettings,
    events: Mutex<EventCallback>,
    now: Mutex<Now>,
    ended: Condvar,
}

struct Now {
    stream: Option<TcpStream>,
    state: LinkState,
    is_ended: bool,
}

impl WorldLink {
    /// Begins to connect, and goes on for ever. `told` gets what the autopilot says, echoes, and beacons heard or not sent,
    /// on the link's own thread or on that of who sends; while it runs nothing else is read, and it must not send a beacon.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn connect(
        settings: WorldLinkSettings,
        events: impl FnMut(Event) + Send + 'static,
    ) -> io::Result<WorldLink> {
        let now = Now {
            stream: None,
            state: LinkState::Connecting(None),
            is_ended: false,
        };
        let (events, now) = (
            Mutex::new(Box::new(events) as EventCallback),
            Mutex::new(now),
        );
        let shared = Arc::new(Shared {
            settings,
            events,
            now,
            ended: Condvar::new(),
        });
        let own = shared.clone();
        let thread = std::thread::Builder::new()
            .name("world link".to_owned())
            .spawn(move || own.run())?;
        Ok(WorldLink {
            shared,
            thread: Some(thread),
        })
    }

    /// Carries what concerns the simulated devices to the world, from any thread; the rest is not for the world. Returns
    /// whether it was carried: while the world is away it is dropped, and a beacon is told to be unsent.
    pub fn send(&self, effect: &Effect) -> bool {
        let frame = word(effect).and_then(|word| encode(&word).ok());
        let is_carried = frame.is_some_and(|frame| self.shared.write(&frame));
        if let (Effect::Transmit(beacon), false) = (effect, is_carried) {
            self.shared.tell(Event::Unsent(beacon.sequence));
        }
        is_carried
    }

    /// Returns how the link stands.
    pub fn state(&self) -> LinkState {
        self.shared.lock().state.clone()
    }
}

impl Drop for WorldLink {
    fn drop(&mut self) {
        self.shared.end();
        if let Some(thread) = self.thread.take()
            && thread.thread().id() != std::thread::current().id()
        {
            // A callback that panicked has ended its own thread; there is nothing left to do here.
            let _ = thread.join();
        }
    }
}

/// Returns the word for what a vehicle wants done, if the world does it.
fn word(effect: &Effect) -> Option<ToWorld> {
    match effect {
        Effect::Command(command) => Some(ToWorld::Autopilot(command.clone())),
        Effect::Steer(beam) => Some(ToWorld::Steer(*beam)),
        Effect::Ping(ping) => Some(ToWorld::Ping(*ping)),
        Effect::Transmit(beacon) => codec::encode(&Message::Beacon(beacon.clone()))
            .ok()
            .map(ToWorld::Transmit),
        Effect::Publish(_)
        | Effect::Fix(..)
        | Effect::Keep(..)
        | Effect::Forget { .. }
        | Effect::Recall { .. }
        | Effect::Remember(_)
        | Effect::KeepStops(_)
        | Effect::VehicleEvent(_) => None,
    }
}

/// Returns what a vehicle is told by a word of the world; `None` for what is not for its actors.
fn event(word: FromWorld) -> Option<Event> {
    match word {
        FromWorld::Autopilot(report) => Some(Event::Report(report)),
        FromWorld::Ack(ack) => Some(Event::Ack(ack)),
        FromWorld::Echo(echo) => Some(Event::Echo(echo)),
        FromWorld::Heard { frame, rssi_dbm } => match codec::decode(&frame) {
            Ok(Decoded::Message(Message::Beacon(beacon))) => {
                Some(Event::Heard(HeardBeacon { beacon, rssi_dbm }))
            }
            Ok(_) | Err(_) => None,
        },
        FromWorld::Unsent(sequence) => Some(Event::Unsent(sequence)),
        FromWorld::Welcome(_)
        | FromWorld::Refused(_)
        | FromWorld::Status(_)
        | FromWorld::Places(_) => None,
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Now> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, event: Event) {
        let mut events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
        (*events)(event);
    }

    fn run(&self) {
        loop {
            let state = match self.session() {
                Ok(refused) => LinkState::Refused(refused),
                Err(reason) => LinkState::Connecting(Some(reason)),
            };
            let mut now = self.lock();
            now.stream = None;
            now.state = state;
            let is_over = |now: &mut Now| !now.is_ended;
            let waited = self.ended.wait_timeout_while(now, RETRY, is_over);
            if waited.map_or_else(
                |broken| broken.into_inner().0.is_ended,
                |(now, _)| now.is_ended,
            ) {
                return;
            }
        }
    }

    /// One connection from its beginning to its end; returns why the world refused it, or what went wrong.
    fn session(&self) -> Result<LinkRefusal, String> {
        let mut stream = self
            .open()
            .map_err(|error| format!("{}: {error}", self.settings.address))?;
        loop {
            let frame = read_frame(&mut stream).map_err(|error| error.to_string())?;
            match decode(&frame).map_err(|error| error.to_string())? {
                FromWorld::Refused(refused) => return Ok(refused),
                FromWorld::Welcome(welcome) => {
                    self.welcome(&stream, welcome).map_err(|e| e.to_string())?
                }
                word => {
                    if let Some(event) = event(word) {
                        self.tell(event);
                    }
                }
            }
        }
    }

    fn open(&self) -> io::Result<TcpStream> {
        let WorldLinkSettings {
            address,
            token,
            vehicle,
            boot,
        } = &self.settings;
        let mut stream = TcpStream::connect_timeout(address, CONNECT_WITHIN)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(WRITE_WITHIN))?;
        stream.set_read_timeout(Some(CONNECT_WITHIN))?;
        let join = ToWorld::Join {
            vehicle: *vehicle,
            boot: *boot,
            token: token.clone().into_bytes(),
        };
        write_frame(&mut stream, &encode(&join).map_err(io::Error::other)?)?;
        Ok(stream)
    }

    fn welcome(&self, stream: &TcpStream, welcome: Welcome) -> io::Result<()> {
        // From now on the world may be silent: whether the autopilot is, the vehicle judges itself.
        stream.set_read_timeout(None)?;
        let mut now = self.lock();
        if now.is_ended {
            return Err(io::ErrorKind::Interrupted.into());
        }
        now.stream = Some(stream.try_clone()?);
        now.state = LinkState::Joined(welcome);
        Ok(())
    }

    fn write(&self, frame: &[u8]) -> bool {
        let mut now = self.lock();
        let Some(stream) = &mut now.stream else {
            return false;
        };
        if write_frame(stream, frame).is_ok() {
            return true;
        }
        // Half a frame may have gone out: nothing can follow it. The reader notices, and connects anew.
        let _ = stream.shutdown(Shutdown::Both);
        now.stream = None;
        false
    }

    fn end(&self) {
        let mut now = self.lock();
        now.is_ended = true;
        if let Some(stream) = now.stream.take() {
            // A connection that is gone already needs no end.
            let _ = stream.shutdown(Shutdown::Both);
        }
        self.ended.notify_all();
    }
}
