//! Sockets at which clients of MAVLink are served: who comes, what bytes they say and that they are gone is told to whoever
//! owns the vehicles; what is to go out is handed back. What bytes mean is not known here.
//!
//! ```text
//!   TCP: one connection = one client          ┌─► Joined, Bytes, Left ─► owner
//!   UDP: one address that is heard = a client ─┤
//!                                             └◄─ send(client, bytes) ─── owner
//! ```
//!
//! A client that does not read loses what does not fit into its queue, and is ended when it takes nothing for
//! [`WRITE_WITHIN`]; one of UDP is gone when it was not heard for [`SILENT`].

use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio::io::AsyncReadExt;
use tokio::net::tcp::OwnedWriteHalf;
use tokio::net::{TcpListener, TcpStream, UdpSocket};
use tokio::runtime::Runtime;
use tokio::sync::mpsc;
use tokio::time::{Instant, timeout};

use super::mailbox::lock;
use crate::mavlink::client_link::ClientId;
use crate::mavlink::frames::fitting;

/// A client that takes nothing for this long is ended.
pub const WRITE_WITHIN: Duration = Duration::from_secs(5);
/// A client of UDP that was not heard for this long is gone.
pub const SILENT: Duration = Duration::from_secs(15);
/// Pieces that wait for a client; more are dropped.
const WAITING: usize = 256;
/// A packet of UDP holds so many bytes at most: whole frames.
const PACKET: usize = 1_400;
/// After a failure to take a connection the listener rests, so as not to spin.
const REST: Duration = Duration::from_millis(50);
/// So many connections an endpoint serves at a time.
const CLIENTS_MAX: usize = 32;

/// Which sockets are opened.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SocketKind {
    /// Clients connect.
    Tcp,
    /// Clients speak first.
    Udp,
    /// The other side listens there, and is spoken to from the beginning.
    UdpTo,
}

/// Returns what tells an owner by a queue; one that is gone is told nothing.
pub fn by_queue<T: Send + 'static>(
    queue: SyncSender<T>,
    wrap: fn(FromClient) -> T,
    unwrap: fn(T) -> Option<FromClient>,
) -> Told {
    Arc::new(move |word| match queue.try_send(wrap(word)) {
        Ok(()) | Err(TrySendError::Disconnected(_)) => Ok(()),
        Err(TrySendError::Full(back)) => unwrap(back).map_or(Ok(()), Err),
    })
}

/// What clients do.
#[derive(Debug)]
pub enum FromClient {
    /// Somebody has come.
    Joined {
        /// Its name here.
        client: ClientId,
        /// At which endpoint.
        endpoint: usize,
    },
    /// Somebody has said something.
    Bytes {
        /// Who.
        client: ClientId,
        /// What.
        bytes: Vec<u8>,
    },
    /// Somebody is gone.
    Left {
        /// Who.
        client: ClientId,
    },
}

/// Takes what clients do; gives it back while there is no room for it.
pub type Told = Arc<dyn Fn(FromClient) -> Result<(), FromClient> + Send + Sync>;

/// Where bytes for a client go.
#[derive(Clone)]
enum Way {
    Stream(StreamWay),
    Packets(Arc<UdpSocket>, SocketAddr),
}

/// Where bytes for a connection go: into it as long as it takes them, into its queue when it does not.
#[derive(Clone)]
struct StreamWay {
    /// The endpoint to which it was made.
    endpoint: usize,
    stream: Arc<OwnedWriteHalf>,
    queue: mpsc::Sender<Vec<u8>>,
    /// Pieces of the queue that are not written yet: nothing overtakes them.
    behind: Arc<AtomicUsize>,
}

impl StreamWay {
    /// Sends without waiting; what the queue does not hold is dropped. Called by one thread.
    fn send(&self, mut bytes: Vec<u8>) {
        if self.behind.load(Ordering::Acquire) == 0
            && let Ok(written) = self.stream.try_write(&bytes)
        {
            if written == bytes.len() {
                return;
            }
            bytes.drain(..written);
        }
        self.behind.fetch_add(1, Ordering::AcqRel);
        if self.queue.try_send(bytes).is_err() {
            self.behind.fetch_sub(1, Ordering::AcqRel);
        }
    }

    /// Writes what waits, until the connection is broken or takes nothing for [`WRITE_WITHIN`].
    async fn write_queued(&self, mut queued: mpsc::Receiver<Vec<u8>>) {
        while let Some(bytes) = queued.recv().await {
            let mut rest = &bytes[..];
            while !rest.is_empty() {
                match timeout(WRITE_WITHIN, self.stream.writable()).await {
                    Ok(Ok(())) => {}
                    Ok(Err(_)) | Err(_) => return,
                }
                match self.stream.try_write(rest) {
                    Ok(written) => rest = rest.get(written..).unwrap_or_default(),
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                    Err(_) => return,
                }
            }
            self.behind.fetch_sub(1, Ordering::AcqRel);
        }
    }
}

/// What all sockets share.
#[derive(Clone)]
struct Shared {
    told: Told,
    ways: Arc<Mutex<BTreeMap<ClientId, Way>>>,
    named: Arc<AtomicU32>,
}

/// Open sockets; dropping them ends all clients.
pub struct MavlinkSockets {
    addresses: Vec<SocketAddr>,
    shared: Shared,
    runtime: Option<Runtime>,
}

impl MavlinkSockets {
    /// Opens so many endpoints, at an address and the ports above it; port 0 takes free ones.
    ///
    /// # Errors
    /// An address cannot be used.
    pub fn open(
        kind: SocketKind,
        first: SocketAddr,
        count: usize,
        told: Told,
    ) -> Result<MavlinkSockets, (SocketAddr, io::Error)> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name("mavlink sockets")
            .enable_all()
            .build()
            .map_err(|error| (first, error))?;
        let shared = Shared {
            told,
            ways: Arc::default(),
            named: Arc::default(),
        };
        let mut addresses = Vec::new();
        for endpoint in 0..count {
            let address = nth(first, endpoint)
                .ok_or_else(|| (first, io::ErrorKind::AddrNotAvailable.into()))?;
            let opened = runtime.block_on(shared.clone().open(kind, address, endpoint));
            addresses.push(opened.map_err(|error| (address, error))?);
        }
        Ok(MavlinkSockets {
            addresses,
            shared,
            runtime: Some(runtime),
        })
    }

    /// Returns where it is served, each endpoint in turn.
    pub fn addresses(&self) -> &[SocketAddr] {
        &self.addresses
    }

    /// Sends frames to a client; what does not fit into its queue is dropped.
    pub fn send(&self, client: ClientId, bytes: Vec<u8>) {
        let way = lock(&self.shared.ways).get(&client).cloned();
        match way {
            // Who does not read loses it.
            Some(Way::Stream(stream)) => stream.send(bytes),
            Some(Way::Packets(socket, to)) => {
                let mut rest = &bytes[..];
                while !rest.is_empty() {
                    let (packet, more) = rest.split_at(fitting(rest, PACKET));
                    // A packet that the system does not take is lost like any other.
                    let _ = socket.try_send_to(packet, to);
                    rest = more;
                }
            }
            None => {}
        }
    }
}

impl Drop for MavlinkSockets {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// Returns the address whose port is so much higher; port 0 stays.
fn nth(first: SocketAddr, index: usize) -> Option<SocketAddr> {
    let mut address = first;
    if first.port() != 0 {
        address.set_port(first.port().checked_add(u16::try_from(index).ok()?)?);
    }
    Some(address)
}

impl Shared {
    async fn open(
        self,
        kind: SocketKind,
        address: SocketAddr,
        endpoint: usize,
    ) -> io::Result<SocketAddr> {
        match kind {
            SocketKind::Tcp => {
                let listener = TcpListener::bind(address).await?;
                let bound = listener.local_addr()?;
                tokio::spawn(self.accept(listener, endpoint));
                Ok(bound)
            }
            SocketKind::Udp => {
                let socket = Arc::new(UdpSocket::bind(address).await?);
                let bound = socket.local_addr()?;
                tokio::spawn(self.hear_packets(socket, endpoint, None));
                Ok(bound)
            }
            SocketKind::UdpTo => {
                let any = match address.ip() {
                    IpAddr::V4(_) => SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)),
                    IpAddr::V6(_) => SocketAddr::from((std::net::Ipv6Addr::UNSPECIFIED, 0)),
                };
                let socket = Arc::new(UdpSocket::bind(any).await?);
                tokio::spawn(self.hear_packets(socket, endpoint, Some(address)));
                Ok(address)
            }
        }
    }

    fn name(&self) -> ClientId {
        ClientId(self.named.fetch_add(1, Ordering::Relaxed))
    }

    /// Tells the owner. Where there is no room whoever speaks waits, and nobody else.
    async fn tell(&self, mut word: FromClient) {
        while let Err(back) = (self.told)(word) {
            word = back;
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }

    fn connections_to(&self, endpoint: usize) -> usize {
        let is_to = |way: &&Way| matches!(way, Way::Stream(way) if way.endpoint == endpoint);
        lock(&self.ways).values().filter(is_to).count()
    }

    async fn accept(self, listener: TcpListener, endpoint: usize) {
        loop {
            match listener.accept().await {
                Ok((stream, _)) if self.connections_to(endpoint) < CLIENTS_MAX => {
                    tokio::spawn(self.clone().serve(stream, endpoint));
                }
                // One too many is ended; out of descriptors, others may end meanwhile.
                Ok(_) => {}
                Err(_) => tokio::time::sleep(REST).await,
            }
        }
    }

    /// Carries bytes of a connection both ways until it ends.
    async fn serve(self, stream: TcpStream, endpoint: usize) {
        let client = self.name();
        // Without it telemetry comes in lumps.
        let _ = stream.set_nodelay(true);
        let (mut from, to) = stream.into_split();
        let (queue, queued) = mpsc::channel::<Vec<u8>>(WAITING);
        let way = StreamWay {
            endpoint,
            stream: Arc::new(to),
            queue,
            behind: Arc::default(),
        };
        lock(&self.ways).insert(client, Way::Stream(way.clone()));
        self.tell(FromClient::Joined { client, endpoint }).await;
        let writer = way.write_queued(queued);
        let reader = async {
            let mut buffer = vec![0; 16 * 1024];
            while let Ok(count) = from.read(&mut buffer).await {
                if count == 0 {
                    return;
                }
                let bytes = buffer[..count].to_vec();
                self.tell(FromClient::Bytes { client, bytes }).await;
            }
        };
        tokio::select! { () = writer => {}, () = reader => {} }
        lock(&self.ways).remove(&client);
        self.tell(FromClient::Left { client }).await;
    }

    /// Hears packets of whoever speaks to a socket; one who is spoken to stays a client for ever.
    async fn hear_packets(
        self,
        socket: Arc<UdpSocket>,
        endpoint: usize,
        listens: Option<SocketAddr>,
    ) {
        let mut clients: BTreeMap<SocketAddr, (ClientId, Instant)> = BTreeMap::new();
        if let Some(address) = listens {
            self.come(&mut clients, &socket, address, endpoint).await;
        }
        let mut buffer = vec![0; 64 * 1024];
        loop {
            let heard = timeout(Duration::from_secs(1), socket.recv_from(&mut buffer)).await;
            let gone: Vec<SocketAddr> = clients
                .iter()
                .filter(|(address, (_, heard))| {
                    listens != Some(**address) && heard.elapsed() > SILENT
                })
                .map(|(address, _)| *address)
                .collect();
            for address in gone {
                if let Some((client, _)) = clients.remove(&address) {
                    lock(&self.ways).remove(&client);
                    self.tell(FromClient::Left { client }).await;
                }
            }
            // A port that nobody listens at is told as an error of the next call.
            let Ok(Ok((count, address))) = heard else {
                continue;
            };
            if !clients.contains_key(&address) && clients.len() < CLIENTS_MAX {
                self.come(&mut clients, &socket, address, endpoint).await;
            }
            if let Some((client, at)) = clients.get_mut(&address) {
                *at = Instant::now();
                let (client, bytes) = (*client, buffer[..count].to_vec());
                self.tell(FromClient::Bytes { client, bytes }).await;
            }
        }
    }

    async fn come(
        &self,
        clients: &mut BTreeMap<SocketAddr, (ClientId, Instant)>,
        socket: &Arc<UdpSocket>,
        address: SocketAddr,
        endpoint: usize,
    ) {
        let client = self.name();
        clients.insert(address, (client, Instant::now()));
        lock(&self.ways).insert(client, Way::Packets(socket.clone(), address));
        self.tell(FromClient::Joined { client, endpoint }).await;
    }
}
