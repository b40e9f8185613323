//! The world's listener: takes connections, lets in who knows the token and speaks the same version, and carries frames
//! between the socket and the world's thread. It decides nothing about vehicles.
//!
//! Whoever is let in may say as much as the world can take; whoever is not has two seconds and a short frame.

use std::io::{self, Read};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use super::connection_limit::{ConnectionLimit, CountedConnection};
use super::outgoing::Outgoing;
use super::world_thread::{Inbound, refuse};
use crate::run::link::{LinkRefusal, ToWorld, VERSION, WordError, decode, read_frame, write_frame};

/// A connection says who it is within this time.
const GREETS_WITHIN: Duration = Duration::from_secs(2);
/// A connection that takes nothing for this long is ended.
const WRITE_WITHIN: Duration = Duration::from_secs(5);
/// Connections at one time beside one a vehicle: directors, and those that have not greeted yet.
const SPARE_CONNECTIONS: usize = 32;
/// After a failure to take a connection the listener rests, so as not to spin.
const REST: Duration = Duration::from_millis(50);

/// The world's listener.
pub(super) struct Listener {
    token: Vec<u8>,
    limit: Arc<ConnectionLimit>,
    words: SyncSender<Inbound>,
    is_ended: Arc<AtomicBool>,
}

/// Returns the limit of connections of a world with so many vehicles.
pub(super) fn connection_limit(vehicles: u8) -> ConnectionLimit {
    ConnectionLimit::new(usize::from(vehicles) + SPARE_CONNECTIONS)
}

impl Listener {
    /// Makes the listener of a world.
    pub(super) fn new(
        token: &[u8],
        limit: Arc<ConnectionLimit>,
        words: SyncSender<Inbound>,
        is_ended: Arc<AtomicBool>,
    ) -> Listener {
        Listener {
            token: token.to_vec(),
            limit,
            words,
            is_ended,
        }
    }

    /// Takes connections until the world has ended.
    pub(super) fn serve(&self, listener: &TcpListener) {
        for connection in 0.. {
            let stream = listener.accept();
            if self.is_ended.load(Ordering::Acquire) {
                return;
            }
            match stream {
                Ok((stream, _)) => self.open(connection, stream),
                // Out of descriptors, for instance: others may end meanwhile.
                Err(_) => std::thread::sleep(REST),
            }
        }
    }

    /// Gives a connection its own thread, if there is room.
    fn open(&self, number: u64, stream: TcpStream) {
        let counted = CountedConnection::begin(&self.limit);
        let outgoing = Arc::new(Outgoing::default());
        let connection = Connection {
            number,
            token: self.token.clone(),
            words: self.words.clone(),
            outgoing: outgoing.clone(),
            _counted: counted,
        };
        if self.limit.is_exceeded() {
            refuse(&outgoing, LinkRefusal::Full);
            // A few bytes always fit into the buffer of a new connection; whether they arrive does not matter.
            let _ = stream
                .set_nonblocking(true)
                .and_then(|()| pour(&outgoing, stream));
            return;
        }
        let named = std::thread::Builder::new().name(format!("world connection {number}"));
        // Without a thread the connection ends here, and comes again.
        let _ = named.spawn(move || connection.attend(stream));
    }
}

/// One connection.
struct Connection {
    number: u64,
    token: Vec<u8>,
    words: SyncSender<Inbound>,
    outgoing: Arc<Outgoing>,
    _counted: CountedConnection,
}

impl Connection {
    /// Reads what the connection says, and lets a second thread write, until it ends.
    fn attend(self, mut stream: TcpStream) {
        let Ok(other) = prepare(&stream) else { return };
        let outgoing = self.outgoing.clone();
        let writer = std::thread::Builder::new().name(format!("world writer {}", self.number));
        let Ok(writer) = writer.spawn(move || pour(&outgoing, other)) else {
            return;
        };
        match self.greet(&mut stream) {
            Err(refused) => refuse(&self.outgoing, refused),
            Ok(inbound) => {
                // Without a world nobody listens; the writer is told below.
                let _ = self.words.send(inbound);
                if let Some(refused) = self.listen(&mut stream) {
                    refuse(&self.outgoing, refused);
                }
                let _ = self.words.send(Inbound::Gone {
                    connection: self.number,
                });
            }
        }
        self.outgoing.close();
        // It ends by itself, whatever went wrong with it.
        let _ = writer.join();
    }

    /// Reads the first word, and tells what it asks the world for.
    fn greet(&self, stream: &mut TcpStream) -> Result<Inbound, LinkRefusal> {
        let until = Instant::now() + GREETS_WITHIN;
        let frame = read_frame(&mut DeadlineStream { stream, until })
            .map_err(|_| LinkRefusal::NoGreeting)?;
        let word = decode(&frame).map_err(|error| match error {
            WordError::Version { found } => LinkRefusal::Version {
                expected: VERSION,
                found,
            },
            WordError::Body { .. } => LinkRefusal::NoGreeting,
        })?;
        // From now on it may be silent for as long as it likes.
        stream
            .set_read_timeout(None)
            .map_err(|_| LinkRefusal::NoGreeting)?;
        let (connection, outgoing) = (self.number, self.outgoing.clone());
        match word {
            ToWorld::Join { token, .. } | ToWorld::Control { token }
                if !is_same(&token, &self.token) =>
            {
                Err(LinkRefusal::Token)
            }
            ToWorld::Join { vehicle, boot, .. } => Ok(Inbound::Join {
                connection,
                vehicle,
                boot,
                outgoing,
            }),
            ToWorld::Control { .. } => Ok(Inbound::Control {
                connection,
                outgoing,
            }),
            ToWorld::Autopilot(_)
            | ToWorld::Steer(_)
            | ToWorld::Ping(_)
            | ToWorld::Transmit(_)
            | ToWorld::Enter
            | ToWorld::Report
            | ToWorld::Track { .. }
            | ToWorld::Stop => Err(LinkRefusal::NoGreeting),
        }
    }

    /// Hands on what is said until the connection ends; returns what it is told if that was its own fault.
    fn listen(&self, stream: &mut TcpStream) -> Option<LinkRefusal> {
        loop {
            let frame = match read_frame(stream) {
                Ok(frame) => frame,
                Err(crate::run::link::FrameError::TooLong { .. }) => {
                    return Some(LinkRefusal::Garbage);
                }
                Err(_gone) => return None,
            };
            let Ok(word) = decode(&frame) else {
                return Some(LinkRefusal::Garbage);
            };
            self.words
                .send(Inbound::Word {
                    connection: self.number,
                    word,
                })
                .ok()?;
        }
    }
}

fn prepare(stream: &TcpStream) -> io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(WRITE_WITHIN))?;
    stream.try_clone()
}

/// Writes what is to be written until that is closed or the connection fails, and ends the connection.
fn pour(outgoing: &Outgoing, mut stream: TcpStream) -> io::Result<()> {
    let mut result = Ok(());
    while let Some(frame) = outgoing.next() {
        result = write_frame(&mut stream, &frame);
        if result.is_err() {
            outgoing.close();
            break;
        }
    }
    // The reader wakes when both ways are shut; a connection that is gone already needs no end.
    let _ = stream.shutdown(Shutdown::Both);
    result
}

/// Compares without telling by its time how much was right.
fn is_same(one: &[u8], other: &[u8]) -> bool {
    let differing = one.iter().zip(other).fold(0, |sum, (a, b)| sum | (a ^ b));
    one.len() == other.len() && differing == 0
}

/// A stream that must have said everything by a moment.
struct DeadlineStream<'a> {
    stream: &'a mut TcpStream,
    until: Instant,
}

impl Read for DeadlineStream<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        self.stream.set_read_timeout(Some(left))?;
        self.stream.read(buffer)
    }
}
