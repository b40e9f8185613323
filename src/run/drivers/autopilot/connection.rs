//! One connection to an autopilot: bytes out by [`Connection::write`], bytes in by a thread of its own until it ends. What
//! bytes mean is not known here.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream, ToSocketAddrs, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::config::MavlinkEndpoint;
use crate::mavlink::frames::fitting;
#[cfg(feature = "hw")]
use crate::run::drivers::serial_port;
use crate::run::mailbox::lock;

/// A connection that is not made within this time is given up.
const CONNECT_WITHIN: Duration = Duration::from_secs(2);
/// A reader looks this often whether it shall end.
const READ_FOR: Duration = Duration::from_millis(100);
/// A packet of UDP holds so many bytes at most: whole frames.
const PACKET: usize = 1_400;

/// What a connection says.
pub(super) enum FromConnection {
    /// Bytes.
    Bytes(Vec<u8>),
    /// It has ended, with its reason.
    Ended(String),
}

/// An open connection; dropping it closes it.
pub(super) struct Connection {
    way: Way,
    is_closed: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
}

enum Way {
    #[cfg(feature = "hw")]
    Serial(serial2::SerialPort),
    Tcp(TcpStream),
    /// To whom packets go: for one that is waited for, whoever sent the last one.
    Udp(UdpSocket, Arc<Mutex<Option<SocketAddr>>>),
}

impl Connection {
    /// Opens a connection; `told` gets its bytes and its end, on a thread of its own.
    ///
    /// # Errors
    /// It is not there, or is not ours to open.
    pub(super) fn open(
        endpoint: &MavlinkEndpoint,
        baud: u32,
        told: impl Fn(FromConnection) + Send + 'static,
    ) -> io::Result<Connection> {
        let is_closed = Arc::<AtomicBool>::default();
        let (way, read): (Way, Reader) = match endpoint {
            MavlinkEndpoint::Serial(port) => serial(port, baud)?,
            MavlinkEndpoint::Tcp(address) => {
                let stream = TcpStream::connect_timeout(&resolve(address)?, CONNECT_WITHIN)?;
                // Without it commands wait for more.
                stream.set_nodelay(true)?;
                stream.set_read_timeout(Some(READ_FOR))?;
                stream.set_write_timeout(Some(CONNECT_WITHIN))?;
                let mut reader = stream.try_clone()?;
                (
                    Way::Tcp(stream),
                    Box::new(move |buffer| reader.read(buffer)),
                )
            }
            MavlinkEndpoint::UdpIn(address) => udp(UdpSocket::bind(resolve(address)?)?, None)?,
            MavlinkEndpoint::UdpOut(address) => {
                let to = resolve(address)?;
                let any = match to {
                    SocketAddr::V4(_) => "0.0.0.0:0",
                    SocketAddr::V6(_) => "[::]:0",
                };
                udp(UdpSocket::bind(any)?, Some(to))?
            }
        };
        let (is_over, is_packets) = (is_closed.clone(), matches!(way, Way::Udp(..)));
        let reader = std::thread::Builder::new()
            .name("autopilot bytes".to_owned())
            .spawn(move || listen(read, is_packets, &is_over, &told))?;
        Ok(Connection {
            way,
            is_closed,
            reader: Some(reader),
        })
    }

    /// Returns whether the thread that reads it has ended.
    pub(super) fn is_deaf(&self) -> bool {
        self.reader.as_ref().is_some_and(JoinHandle::is_finished)
    }

    /// Writes frames.
    ///
    /// # Errors
    /// The connection has ended.
    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match &mut self.way {
            #[cfg(feature = "hw")]
            Way::Serial(port) => port.write_all(bytes),
            Way::Tcp(stream) => stream.write_all(bytes),
            Way::Udp(socket, to) => {
                let Some(to) = *lock(to) else { return Ok(()) };
                let mut rest = bytes;
                while !rest.is_empty() {
                    let (packet, more) = rest.split_at(fitting(rest, PACKET));
                    // Nobody there yet is no end: it may come.
                    let _ = socket.send_to(packet, to);
                    rest = more;
                }
                Ok(())
            }
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.is_closed.store(true, Ordering::Release);
        if let Way::Tcp(stream) = &self.way {
            // One that has ended is shut down already.
            let _ = stream.shutdown(Shutdown::Both);
        }
        if let Some(reader) = self.reader.take() {
            // A thread that panicked has ended, too.
            let _ = reader.join();
        }
    }
}

/// Reads some bytes, for a while.
type Reader = Box<dyn FnMut(&mut [u8]) -> io::Result<usize> + Send>;

#[cfg(feature = "hw")]
fn serial(port: &str, baud: u32) -> io::Result<(Way, Reader)> {
    let mut opened = serial_port::open(port, serial_port::LineFormat::of_device(baud), READ_FOR)
        .map_err(|error| io::Error::new(error.kind(), serial_port::in_words(&error)))?;
    opened.set_write_timeout(CONNECT_WITHIN)?;
    let reader = opened.try_clone()?;
    let read = move |buffer: &mut [u8]| reader.read(buffer);
    Ok((Way::Serial(opened), Box::new(read)))
}

#[cfg(not(feature = "hw"))]
fn serial(_: &str, _: u32) -> io::Result<(Way, Reader)> {
    Err(io::Error::new(
        io::ErrorKind::Unsupported,
        "this build has no serial ports",
    ))
}

fn udp(socket: UdpSocket, to: Option<SocketAddr>) -> io::Result<(Way, Reader)> {
    socket.set_read_timeout(Some(READ_FOR))?;
    let reader = socket.try_clone()?;
    let is_waited_for = to.is_none();
    let to = Arc::new(Mutex::new(to));
    let learned = to.clone();
    let read = move |buffer: &mut [u8]| {
        let (count, from) = reader.recv_from(buffer)?;
        if is_waited_for {
            *lock(&learned) = Some(from);
        }
        Ok(count)
    };
    Ok((Way::Udp(socket, to), Box::new(read)))
}

fn resolve(address: &str) -> io::Result<SocketAddr> {
    let mut found = address.to_socket_addrs()?;
    found
        .next()
        .ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "no such host"))
}

fn listen(
    mut read: Reader,
    is_packets: bool,
    is_closed: &AtomicBool,
    told: &impl Fn(FromConnection),
) {
    let mut buffer = vec![0; 16 * 1024];
    while !is_closed.load(Ordering::Acquire) {
        match read(&mut buffer) {
            Ok(0) if !is_packets => return told(FromConnection::Ended("it was closed".to_owned())),
            Ok(count) => told(FromConnection::Bytes(buffer[..count].to_vec())),
            Err(error) if is_wait(&error) => {}
            // A packet to a port where nobody listens comes back as an error of the next read.
            Err(error) if is_packets && error.kind() == io::ErrorKind::ConnectionRefused => {}
            Err(error) => return told(FromConnection::Ended(error.to_string())),
        }
    }
}

fn is_wait(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
    )
}

#[cfg(all(test, feature = "hw"))]
mod tests {
    use std::net::TcpListener;

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    use super::*;

    fn fail(_: FromConnection) {
        panic!("as it shall");
    }

    #[test]
    fn a_connection_whose_reader_has_ended_is_deaf() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = MavlinkEndpoint::Tcp(listener.local_addr().unwrap().to_string());
        let connection = Connection::open(&endpoint, 57_600, fail).unwrap();
        let (mut stream, _) = listener.accept().unwrap();
        assert!(!connection.is_deaf());
        stream.write_all(b"word").unwrap();
        while !connection.is_deaf() {
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn a_serial_port_has_one_user_and_the_next_one_gets_it_when_that_has_ended() {
        let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&line).unwrap();
        unlockpt(&line).unwrap();
        let port = ptsname(&line, Vec::new()).unwrap().into_string().unwrap();
        let endpoint = MavlinkEndpoint::Serial(port);
        let open = || Connection::open(&endpoint, 57_600, |_| {});
        let first = open().unwrap();
        let second = open().err().map(|error| error.to_string());
        assert_eq!(second.as_deref(), Some("another program uses it"));
        drop(first);
        open().unwrap();
        let missing = MavlinkEndpoint::Serial("/dev/no-such-port".to_owned());
        let why = Connection::open(&missing, 57_600, |_| {}).err().unwrap();
        assert!(why.to_string().ends_with("(ls /dev/serial/by-id)"), "{why}");
    }
}
