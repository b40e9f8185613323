//! A TCP relay with a rate, a delay, a cut, a freeze and damage, so that links are shaped without root. It knows nothing of
//! what it carries.
//!
//! ```text
//!   one end ──► socket ─► reader ─► queue of a few kB ─► writer ─► socket ──► other end     (and the same back)
//!                                                          └ waits for the rate and the delay
//! ```

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use socket2::{Domain, Protocol, Socket, Type};

/// Bytes read at once, and how many such pieces may wait in one direction.
const PIECE: usize = 2048;
const PIECES: usize = 16;
/// The kernel's own buffers, bytes: small, so that what waits waits in the sender.
const SOCKET_BUFFER: usize = 16 << 10;
/// A thread of the relay looks up this often.
const LOOK: Duration = Duration::from_millis(10);

/// What a link lets through.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
enum Way {
    #[default]
    Open,
    /// Connections end, and new ones end at once.
    Cut,
    /// Connections stay, and nothing goes through them.
    Frozen,
}

#[derive(Clone, Copy, Debug, Default)]
struct Shape {
    way: Way,
    bytes_per_s: Option<f64>,
    delay: Duration,
    /// One byte of so many is another one, on the average.
    damages_one_of: Option<u64>,
    /// These bytes become those.
    rewrites: Option<(&'static [u8], &'static [u8])>,
}

#[derive(Default)]
struct Line {
    shape: Mutex<Shape>,
    /// Counts the cuts: a connection of before a cut never goes on.
    cuts: AtomicU64,
    carried: AtomicU64,
    damaged: AtomicU64,
    is_over: AtomicBool,
}

/// A relay to one address.
pub struct Relay {
    address: SocketAddr,
    line: Arc<Line>,
}

impl Relay {
    /// Begins to relay to an address, of which nobody need listen yet.
    pub fn start(target: SocketAddr) -> Relay {
        let socket = Socket::new(Domain::IPV4, Type::STREAM, Some(Protocol::TCP)).unwrap();
        socket.set_recv_buffer_size(SOCKET_BUFFER).unwrap();
        socket
            .bind(&SocketAddr::from(([127, 0, 0, 1], 0)).into())
            .unwrap();
        socket.listen(64).unwrap();
        let listener: TcpListener = socket.into();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap();
        let line = Arc::new(Line::default());
        let of_thread = line.clone();
        std::thread::spawn(move || accept(&listener, target, &of_thread));
        Relay { address, line }
    }

    /// Returns where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns how many bytes it has carried, both ways together.
    pub fn carried(&self) -> u64 {
        self.line.carried.load(Ordering::Relaxed)
    }

    /// Lets so many bytes a second through each way, each of them so late.
    pub fn shape(&self, bytes_per_s: f64, delay: Duration) {
        let mut shape = self.line.shape.lock().unwrap();
        (shape.bytes_per_s, shape.delay) = (Some(bytes_per_s), delay);
    }

    /// Changes one byte of so many, on the average; `None` = none.
    pub fn damage(&self, one_of: Option<u64>) {
        self.line.shape.lock().unwrap().damages_one_of = one_of;
    }

    /// Makes other bytes of some, wherever they come in one piece; `None` = leaves them.
    pub fn rewrite(&self, bytes: Option<(&'static [u8], &'static [u8])>) {
        self.line.shape.lock().unwrap().rewrites = bytes;
    }

    /// Returns how many bytes were changed, both ways together.
    pub fn damaged(&self) -> u64 {
        self.line.damaged.load(Ordering::Relaxed)
    }

    /// Ends all connections; new ones end at once.
    pub fn cut(&self) {
        self.set(Way::Cut);
        self.line.cuts.fetch_add(1, Ordering::Relaxed);
    }

    /// Lets nothing through any more, without a word to either end.
    pub fn freeze(&self) {
        self.set(Way::Frozen);
    }

    /// Lets everything through again.
    pub fn restore(&self) {
        self.set(Way::Open);
    }

    fn set(&self, way: Way) {
        self.line.shape.lock().unwrap().way = way;
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.line.is_over.store(true, Ordering::Relaxed);
    }
}

impl Line {
    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    fn shape(&self) -> Shape {
        *self.shape.lock().unwrap()
    }

    /// Changes some bytes of a piece, those that chance names.
    fn damage(&self, piece: &mut [u8], chance: &mut u64) {
        if let Some((from, to)) = self.shape().rewrites {
            let is_from = |bytes: &[u8]| bytes == from;
            while let Some(at) = piece.windows(from.len()).position(is_from) {
                piece[at..at + to.len()].copy_from_slice(to);
                self.damaged.fetch_add(1, Ordering::Relaxed);
            }
        }
        let Some(one_of) = self.shape().damages_one_of else {
            return;
        };
        for byte in piece {
            // An xorshift generator (Marsaglia 2003): any one does.
            *chance ^= *chance << 13;
            *chance ^= *chance >> 7;
            *chance ^= *chance << 17;
            if chance.is_multiple_of(one_of) {
                *byte ^= 1 << ((*chance >> 32) % 8);
                self.damaged.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// Waits while it is frozen.
    fn thaw(&self) {
        while self.shape().way == Way::Frozen && !self.is_over() {
            std::thread::sleep(LOOK);
        }
    }
}

fn accept(listener: &TcpListener, target: SocketAddr, line: &Arc<Line>) {
    while !line.is_over() {
        line.thaw();
        let Ok((near, _)) = listener.accept() else {
            std::thread::sleep(LOOK);
            continue;
        };
        if line.shape().way == Way::Cut {
            continue;
        }
        let Ok(far) = connect(target) else {
            continue;
        };
        let cuts = line.cuts.load(Ordering::Relaxed);
        for (from, to) in [(&near, &far), (&far, &near)] {
            let (from, to) = (from.try_clone().unwrap(), to.try_clone().unwrap());
            // Sockets that are taken from a listener that does not wait may not wait either.
            from.set_nonblocking(false).unwrap();
            from.set_nodelay(true).unwrap();
            from.set_read_timeout(Some(LOOK)).unwrap();
            pass(from, to, line.clone(), cuts);
        }
    }
}

/// Connects to the far end, with as little room for what comes from there as for what comes from the near one: the kernel
/// would let it grow to megabytes, which no link has.
fn connect(target: SocketAddr) -> std::io::Result<TcpStream> {
    let socket = Socket::new(Domain::IPV4, Type::STREAM, Some(Protocol::TCP))?;
    socket.set_recv_buffer_size(SOCKET_BUFFER)?;
    socket.connect_timeout(&target.into(), Duration::from_secs(1))?;
    Ok(socket.into())
}

/// Carries one direction of a connection, by two threads.
fn pass(from: TcpStream, to: TcpStream, line: Arc<Line>, cuts: u64) {
    let (pieces, waiting) = sync_channel(PIECES);
    let of_reader = line.clone();
    std::thread::spawn(move || read(from, &of_reader, cuts, &pieces));
    std::thread::spawn(move || write(to, &line, cuts, &waiting));
}

type Piece = (Instant, Vec<u8>);

fn goes_on(line: &Line, cuts: u64) -> bool {
    !line.is_over() && line.cuts.load(Ordering::Relaxed) == cuts
}

fn read(mut from: TcpStream, line: &Line, cuts: u64, pieces: &SyncSender<Piece>) {
    let mut buffer = [0; PIECE];
    while goes_on(line, cuts) {
        line.thaw();
        match from.read(&mut buffer) {
            Ok(0) => break,
            Ok(count) => {
                if pieces
                    .send((Instant::now(), buffer[..count].to_vec()))
                    .is_err()
                {
                    break;
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => break,
        }
    }
    let _ = from.shutdown(Shutdown::Read);
}

fn write(mut to: TcpStream, line: &Line, cuts: u64, pieces: &Receiver<Piece>) {
    let mut free_at = Instant::now();
    let mut chance =
        0x9E37_79B9_7F4A_7C15 ^ u64::from(to.local_addr().map_or(1, |address| address.port()));
    while goes_on(line, cuts) {
        let (read_at, mut piece) = match pieces.recv_timeout(LOOK) {
            Ok(piece) => piece,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => break,
        };
        let shape = line.shape();
        let takes = shape
            .bytes_per_s
            .map_or(0.0, |bytes_per_s| piece.len() as f64 / bytes_per_s);
        free_at = free_at.max(read_at) + Duration::from_secs_f64(takes);
        std::thread::sleep((free_at + shape.delay).saturating_duration_since(Instant::now()));
        line.thaw();
        line.damage(&mut piece, &mut chance);
        if !goes_on(line, cuts) || to.write_all(&piece).is_err() {
            break;
        }
        line.carried
            .fetch_add(piece.len() as u64, Ordering::Relaxed);
    }
    let _ = to.shutdown(Shutdown::Both);
}
