//! Connections of browsers, programs and strangers: how many there are at a time, of one address and in all, and how long one
//! may take. Whoever opens many keeps neither a page from its stop nor this process from its other connections: one that has
//! shown no token gives way to whoever comes. Tokens are not judged here; the server says of a connection what it
//! has seen of it.
//!
//! ```text
//!   Head (5 s) ──whole head──► Request ──answer──► Idle ──first byte──► Head …
//!                                 └──upgrade──► Feed
//! ```

use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::time::{Instant, Sleep, sleep, sleep_until};

/// Connections at a time: a process may open about a thousand files.
const CONNECTIONS_MAX: usize = 256;
/// Of one address: sixteen pages and what they ask beside their feeds.
const OF_ONE_MAX: usize = 64;
/// Places are short when three quarters of them are taken.
const CONNECTIONS_MANY: usize = CONNECTIONS_MAX / 4 * 3;
/// So are those of one address.
const OF_ONE_MANY: usize = OF_ONE_MAX / 4 * 3;
/// A listener that accepts nothing for the moment is tried again so soon.
const AGAIN: Duration = Duration::from_millis(50);

/// How long connections may take.
#[derive(Clone, Copy, Debug)]
struct ConnectionWaits {
    /// A connection on which nothing passes for so long is closed; feeds are asked more often whether they are there.
    silent: Duration,
    /// So is one that has not sent the whole head of a request since it came, or since the first byte of a further request.
    head: Duration,
    /// Where places are short, so is one on which nothing has passed between two requests.
    idle: Duration,
}

impl Default for ConnectionWaits {
    fn default() -> ConnectionWaits {
        ConnectionWaits {
            silent: Duration::from_secs(90),
            head: Duration::from_secs(5),
            idle: Duration::from_secs(5),
        }
    }
}

/// What a connection is at.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stage {
    /// It has not sent the whole head of a request since then.
    Head(Instant),
    /// A request of it is answered.
    Request,
    /// It was answered, and has sent nothing since.
    Idle,
    /// It is one of frames.
    Feed,
}

/// The place of a connection.
#[derive(Debug)]
struct Place {
    address: IpAddr,
    stage: Stage,
    /// When something has passed.
    passed: Instant,
    has_token: bool,
    /// Dropped with the place, which wakes the connection to its end.
    _ends: oneshot::Sender<()>,
}

/// All places that are taken, by a number that grows: the first is the oldest.
#[derive(Debug, Default)]
struct Places {
    taken: BTreeMap<u64, Place>,
    last: u64,
}

impl Places {
    /// Takes a place for an address; `None` = there is no room for it. The number is the place's; the receiver hears when it
    /// must be given up.
    fn admit(
        &mut self,
        now: Instant,
        address: IpAddr,
        idle_max: Duration,
    ) -> Option<(u64, oneshot::Receiver<()>)> {
        self.close_idle(now, address, idle_max);
        if self.of(address) >= OF_ONE_MAX {
            self.displace(|place| place.address == address)?;
        }
        if self.taken.len() >= CONNECTIONS_MAX {
            self.displace(|_| true)?;
        }
        let (ends, displaced) = oneshot::channel();
        self.last += 1;
        self.taken.insert(
            self.last,
            Place {
                address,
                stage: Stage::Head(now),
                passed: now,
                has_token: false,
                _ends: ends,
            },
        );
        Some((self.last, displaced))
    }

    fn of(&self, address: IpAddr) -> usize {
        self.taken
            .values()
            .filter(|place| place.address == address)
            .count()
    }

    /// Closes connections between two requests, if places are short.
    fn close_idle(&mut self, now: Instant, address: IpAddr, idle_max: Duration) {
        let (all, own) = (
            self.taken.len() >= CONNECTIONS_MANY,
            self.of(address) >= OF_ONE_MANY,
        );
        self.taken.retain(|_, place| {
            let is_meant = all || (own && place.address == address);
            let is_idle = place.stage == Stage::Idle && now - place.passed >= idle_max;
            !(is_meant && is_idle)
        });
    }

    /// Ends the oldest connection of these that has shown no token; `None` = all have shown one.
    fn displace(&mut self, is_meant: impl Fn(&Place) -> bool) -> Option<()> {
        let mut places = self.taken.iter();
        let (oldest, _) = places.find(|(_, place)| !place.has_token && is_meant(place))?;
        let oldest = *oldest;
        self.taken.remove(&oldest).map(drop)
    }
}

/// Lets so many connections in, and no more.
#[derive(Clone, Debug, Default)]
pub(super) struct ConnectionLimit {
    places: Arc<Mutex<Places>>,
    waits: ConnectionWaits,
}

impl ConnectionLimit {
    fn places(&self) -> MutexGuard<'_, Places> {
        self.places.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets a connection of an address in; `None` = there is no room for it.
    fn admit(&self, stream: TcpStream, address: IpAddr) -> Option<Connection> {
        let now = Instant::now();
        let (id, displaced) = self.places().admit(now, address, self.waits.idle)?;
        Some(Connection {
            stream,
            place: ConnectionPlace {
                limit: self.clone(),
                id,
            },
            displaced,
            ends: Box::pin(sleep_until(now + self.waits.head)),
        })
    }

    /// Accepts the next connection for which there is room; any other is closed at once.
    pub(super) async fn accept(&self, listener: &TcpListener) -> (Connection, SocketAddr) {
        loop {
            let Ok((stream, from)) = listener.accept().await else {
                sleep(AGAIN).await;
                continue;
            };
            if let Some(connection) = self.admit(stream, from.ip()) {
                return (connection, from);
            }
        }
    }
}

/// By which the server says of a connection what it has seen of it. A connection that has ended is told nothing.
#[derive(Clone, Debug)]
pub(super) struct ConnectionPlace {
    limit: ConnectionLimit,
    id: u64,
}

impl ConnectionPlace {
    /// Takes that its handshake is done: its time for the head of a request begins.
    pub(super) fn is_shaken(&self) {
        self.change(|place, now| place.stage = Stage::Head(now));
    }

    /// Takes that the whole head of a request has come.
    pub(super) fn has_asked(&self) {
        self.change(|place, _| place.stage = Stage::Request);
    }

    /// Takes that the request is answered, or has made a feed of the connection.
    pub(super) fn is_answered(&self, is_feed: bool) {
        self.change(|place, now| {
            place.stage = if is_feed { Stage::Feed } else { Stage::Idle };
            place.passed = now;
        });
    }

    /// Takes that it has shown a token of this server: it gives way to nobody.
    pub(super) fn has_shown_token(&self) {
        self.change(|place, _| place.has_token = true);
    }

    fn has_passed(&self, is_read: bool) {
        self.change(|place, now| {
            place.passed = now;
            if is_read && place.stage == Stage::Idle {
                place.stage = Stage::Head(now);
            }
        });
    }

    fn change(&self, change: impl FnOnce(&mut Place, Instant)) {
        if let Some(place) = self.limit.places().taken.get_mut(&self.id) {
            change(place, Instant::now());
        }
    }

    /// Returns when the connection ends unless something happens on it; `None` = it has ended.
    fn ends_at(&self) -> Option<Instant> {
        let places = self.limit.places();
        let place = places.taken.get(&self.id)?;
        let waits = self.limit.waits;
        let silent = place.passed + waits.silent;
        Some(match place.stage {
            Stage::Head(since) => silent.min(since + waits.head),
            Stage::Request | Stage::Idle | Stage::Feed => silent,
        })
    }
}

/// A connection that has a place, and ends when it loses it or takes too long.
#[derive(Debug)]
pub(super) struct Connection {
    stream: TcpStream,
    place: ConnectionPlace,
    displaced: oneshot::Receiver<()>,
    ends: Pin<Box<Sleep>>,
}

impl Connection {
    /// Returns by what it is told what was seen of it.
    pub(super) fn place(&self) -> &ConnectionPlace {
        &self.place
    }

    /// Waits for its end; returns why it has come.
    fn poll_end(&mut self, context: &mut Context<'_>) -> Poll<io::Error> {
        let Some(ends) = self.place.ends_at() else {
            return Poll::Ready(io::ErrorKind::ConnectionAborted.into());
        };
        if Pin::new(&mut self.displaced).poll(context).is_ready() {
            return Poll::Ready(io::ErrorKind::ConnectionAborted.into());
        }
        if self.ends.deadline() != ends {
            self.ends.as_mut().reset(ends);
        }
        let is_over = self.ends.as_mut().poll(context);
        is_over.map(|()| io::ErrorKind::TimedOut.into())
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.place.limit.places().taken.remove(&self.place.id);
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        match Pin::new(&mut self.stream).poll_read(context, buffer) {
            Poll::Ready(read) => {
                self.place.has_passed(true);
                Poll::Ready(read)
            }
            Poll::Pending => self.poll_end(context).map(Err),
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        match Pin::new(&mut self.stream).poll_write(context, bytes) {
            Poll::Ready(written) => {
                self.place.has_passed(false);
                Poll::Ready(written)
            }
            Poll::Pending => self.poll_end(context).map(Err),
        }
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

/// Accepts connections without encryption.
pub(super) struct PlainListener {
    listener: TcpListener,
    limit: ConnectionLimit,
}

impl PlainListener {
    /// Makes one of a listener.
    pub(super) fn new(listener: TcpListener) -> PlainListener {
        PlainListener {
            listener,
            limit: ConnectionLimit::default(),
        }
    }
}

impl Listener for PlainListener {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        self.limit.accept(&self.listener).await
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

impl Connected<IncomingStream<'_, PlainListener>> for ConnectionPlace {
    fn connect_info(stream: IncomingStream<'_, PlainListener>) -> ConnectionPlace {
        stream.io().place().clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};

    const IDLE_MAX: Duration = Duration::from_secs(5);

    fn address(last: u8) -> IpAddr {
        IpAddr::from([10, 0, 0, last])
    }

    /// Lets so many connections of an address in at a time; returns whose place each has.
    fn fill(places: &mut Places, now: Instant, of: IpAddr, count: usize) -> Vec<u64> {
        let admitted = (0..count).map(|_| places.admit(now, of, IDLE_MAX).unwrap().0);
        admitted.collect()
    }

    #[test]
    fn the_oldest_connection_without_a_token_gives_way_and_one_with_a_token_to_nobody() {
        let (mut places, now) = (Places::default(), Instant::now());
        let own = fill(&mut places, now, address(1), OF_ONE_MAX);
        let other = fill(&mut places, now, address(2), 1);
        places.taken.get_mut(&own[0]).unwrap().has_token = true;
        let (newest, _) = places.admit(now, address(1), IDLE_MAX).unwrap();
        assert_eq!(places.of(address(1)), OF_ONE_MAX);
        assert!(places.taken.contains_key(&own[0]), "it has shown a token");
        assert!(!places.taken.contains_key(&own[1]), "the oldest without");
        assert!(places.taken.contains_key(&newest) && places.taken.contains_key(&other[0]));
        for place in places.taken.values_mut() {
            place.has_token = true;
        }
        assert!(places.admit(now, address(1), IDLE_MAX).is_none());
        assert!(places.admit(now, address(2), IDLE_MAX).is_some());
    }

    #[test]
    fn all_places_are_never_more_than_there_may_be_and_somebody_new_gets_one() {
        let (mut places, now) = (Places::default(), Instant::now());
        for other in 1..=8 {
            fill(&mut places, now, address(other), OF_ONE_MAX);
            assert!(places.taken.len() <= CONNECTIONS_MAX);
        }
        fill(&mut places, now, address(20), 1);
        assert_eq!(places.taken.len(), CONNECTIONS_MAX);
        assert_eq!(places.of(address(20)), 1);
    }

    #[test]
    fn connections_between_two_requests_end_only_where_places_are_short() {
        let (mut places, now) = (Places::default(), Instant::now());
        let idle = fill(&mut places, now, address(1), OF_ONE_MANY - 1);
        for id in &idle {
            let place = places.taken.get_mut(id).unwrap();
            (place.stage, place.has_token) = (Stage::Idle, true);
        }
        let later = now + IDLE_MAX;
        fill(&mut places, later, address(1), 1);
        assert_eq!(places.of(address(1)), OF_ONE_MANY, "there was room");
        fill(&mut places, later - Duration::from_millis(1), address(1), 1);
        assert_eq!(places.of(address(1)), OF_ONE_MANY + 1, "not yet");
        fill(&mut places, later, address(1), 1);
        assert_eq!(places.of(address(1)), 3, "all that were idle have ended");
    }

    /// Returns a connection and its other side.
    async fn connected(waits: ConnectionWaits) -> (ConnectionLimit, Connection, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let limit = ConnectionLimit {
            waits,
            ..ConnectionLimit::default()
        };
        let other = TcpStream::connect(listener.local_addr().unwrap());
        let (other, (connection, _)) = tokio::join!(other, limit.accept(&listener));
        (limit, connection, other.unwrap())
    }

    fn waits(silent_ms: u64, head_ms: u64) -> ConnectionWaits {
        ConnectionWaits {
            silent: Duration::from_millis(silent_ms),
            head: Duration::from_millis(head_ms),
            idle: IDLE_MAX,
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_connection_on_which_nothing_passes_ends_and_gives_its_place_back() {
        let (limit, mut connection, other) = connected(waits(50, 60_000)).await;
        let read = connection.read_u8().await;
        assert_eq!(read.unwrap_err().kind(), io::ErrorKind::TimedOut);
        drop((connection, other));
        assert!(limit.places().taken.is_empty());
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn bytes_of_a_head_give_no_time_and_a_whole_one_does() {
        let (_limit, mut connection, mut other) = connected(waits(60_000, 300)).await;
        other.write_u8(b'G').await.unwrap();
        assert_eq!(connection.read_u8().await.unwrap(), b'G');
        let read = connection.read_u8().await;
        assert_eq!(read.unwrap_err().kind(), io::ErrorKind::TimedOut);

        let (_limit, mut connection, mut other) = connected(waits(60_000, 300)).await;
        connection.place().has_asked();
        let late = tokio::time::timeout(Duration::from_millis(600), connection.read_u8()).await;
        assert!(late.is_err(), "it waits for its answer");
        connection.place().is_answered(false);
        other.write_u8(b'G').await.unwrap();
        assert_eq!(connection.read_u8().await.unwrap(), b'G');
        let read = connection.read_u8().await;
        assert_eq!(read.unwrap_err().kind(), io::ErrorKind::TimedOut);
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_connection_that_waits_for_bytes_is_woken_when_its_place_is_taken() {
        let (limit, mut connection, _other) = connected(waits(60_000, 60_000)).await;
        let take = async {
            sleep(Duration::from_millis(50)).await;
            limit.places().displace(|_| true).unwrap();
        };
        let (read, ()) = tokio::join!(connection.read_u8(), take);
        assert_eq!(read.unwrap_err().kind(), io::ErrorKind::ConnectionAborted);
        let again = connection.read_u8().await;
        assert_eq!(again.unwrap_err().kind(), io::ErrorKind::ConnectionAborted);
    }
}
