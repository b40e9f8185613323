//! Connections of browsers, programs and strangers: how many there are at a time, of one address and in all, and how long
//! nothing may pass. Whoever opens many keeps neither a page from its stop nor this process from its other connections.

use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{Instant, Sleep, sleep};

/// Connections at a time: a process may open about a thousand files.
const CONNECTIONS_MAX: usize = 256;
/// Of one address: sixteen pages and what they ask beside their feeds.
const OF_ONE_MAX: usize = 64;
/// A connection on which nothing passes for so long is closed; feeds are asked more often whether they are there.
const SILENT_MAX: Duration = Duration::from_secs(90);
/// A listener that accepts nothing for the moment is tried again so soon.
const AGAIN: Duration = Duration::from_millis(50);

/// Lets so many connections in, and no more: who is connected, and how often.
#[derive(Clone, Debug, Default)]
pub(super) struct ConnectionLimit {
    connected: Arc<Mutex<BTreeMap<IpAddr, usize>>>,
}

impl ConnectionLimit {
    /// Lets an address in; `None` = there is no room for it. The permit is given back when it is dropped.
    fn admit(&self, address: IpAddr) -> Option<ConnectionPermit> {
        let mut connected = self
            .connected
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let all: usize = connected.values().sum();
        let of_it = connected.get(&address).copied().unwrap_or_default();
        if all >= CONNECTIONS_MAX || of_it >= OF_ONE_MAX {
            return None;
        }
        connected.insert(address, of_it + 1);
        Some(ConnectionPermit {
            limit: self.clone(),
            address,
        })
    }

    /// Accepts the next connection for which there is room; any other is closed at once.
    pub(super) async fn accept(&self, listener: &TcpListener) -> (Connection, SocketAddr) {
        loop {
            let Ok((stream, from)) = listener.accept().await else {
                sleep(AGAIN).await;
                continue;
            };
            if let Some(permit) = self.admit(from.ip()) {
                return (Connection::new(stream, permit, SILENT_MAX), from);
            }
        }
    }
}

/// The permit of one connection.
#[derive(Debug)]
struct ConnectionPermit {
    limit: ConnectionLimit,
    address: IpAddr,
}

impl Drop for ConnectionPermit {
    fn drop(&mut self) {
        let mut connected = self
            .limit
            .connected
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let left = connected.get(&self.address).map_or(0, |count| count - 1);
        match left {
            0 => connected.remove(&self.address),
            left => connected.insert(self.address, left),
        };
    }
}

/// A connection that has a permit, and ends when nothing passes.
#[derive(Debug)]
pub(super) struct Connection {
    stream: TcpStream,
    silent_max: Duration,
    silent: Pin<Box<Sleep>>,
    _permit: ConnectionPermit,
}

impl Connection {
    fn new(stream: TcpStream, permit: ConnectionPermit, silent_max: Duration) -> Connection {
        Connection {
            stream,
            silent_max,
            silent: Box::pin(sleep(silent_max)),
            _permit: permit,
        }
    }

    fn has_passed(&mut self) {
        let ends = Instant::now() + self.silent_max;
        self.silent.as_mut().reset(ends);
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
                self.has_passed();
                Poll::Ready(read)
            }
            Poll::Pending => match self.silent.as_mut().poll(context) {
                Poll::Ready(()) => Poll::Ready(Err(io::ErrorKind::TimedOut.into())),
                Poll::Pending => Poll::Pending,
            },
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        if written.is_ready() {
            self.has_passed();
        }
        written
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

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::AsyncReadExt as _;

    fn address(last: u8) -> IpAddr {
        IpAddr::from([10, 0, 0, last])
    }

    #[test]
    fn an_address_that_has_many_connections_keeps_no_other_one_out() {
        let limit = ConnectionLimit::default();
        let mut permits: Vec<ConnectionPermit> = (0..OF_ONE_MAX)
            .map(|_| limit.admit(address(1)).unwrap())
            .collect();
        assert!(limit.admit(address(1)).is_none(), "it has its share");
        assert!(limit.admit(address(2)).is_some());
        permits.pop();
        permits.push(limit.admit(address(1)).unwrap());
        for other in 2..10 {
            permits.extend((0..OF_ONE_MAX).map_while(|_| limit.admit(address(other))));
        }
        assert_eq!(permits.len(), CONNECTIONS_MAX);
        assert!(limit.admit(address(20)).is_none(), "all are taken");
        permits.clear();
        assert!(limit.connected.lock().unwrap().is_empty());
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_connection_on_which_nothing_passes_ends_and_gives_its_permit_back() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let other = TcpStream::connect(listener.local_addr().unwrap());
        let (other, accepted) = tokio::join!(other, listener.accept());
        let (other, (stream, from)) = (other.unwrap(), accepted.unwrap());
        let limit = ConnectionLimit::default();
        let permit = limit.admit(from.ip()).unwrap();
        let mut connection = Connection::new(stream, permit, Duration::from_millis(50));
        let read = connection.read_u8().await;
        assert_eq!(read.unwrap_err().kind(), io::ErrorKind::TimedOut);
        drop((connection, other));
        assert!(limit.connected.lock().unwrap().is_empty());
    }
}
