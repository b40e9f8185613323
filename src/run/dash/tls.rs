//! TLS of the page for browsers on other machines: the operator's certificate, and handshakes beside each other, so that
//! one that is slow keeps nobody waiting. Who may look or order is not judged here: a browser shows no certificate, its
//! page says a token.

use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use tokio::net::TcpListener;
use tokio::sync::mpsc;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::server::TlsStream;

use super::DashError;
use super::connections::{Connection, ConnectionLimit, ConnectionPlace};
use crate::run::trust::{Certificate, read_limited};

/// A handshake must be done within this time.
const HANDSHAKE_WITHIN: Duration = Duration::from_secs(5);
/// Connections whose handshakes are done wait for the server, so many at most.
const SHAKEN_MAX: usize = 32;

/// The files by which a browser knows the server.
#[derive(Clone, Debug)]
pub struct PageCertificate {
    /// The operator's certificate.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
    /// The authority's certificate, which the browser must be given.
    pub authority: PathBuf,
}

/// What TLS needs, and the names in the certificate.
pub(super) struct PageIdentity {
    pub(super) config: Arc<ServerConfig>,
    pub(super) hosts: Vec<String>,
}

impl PageCertificate {
    /// Reads the files.
    ///
    /// # Errors
    /// [`DashError::Certificate`].
    pub(super) fn read(&self) -> Result<PageIdentity, DashError> {
        let refused = |path: &Path, reason: String| DashError::Certificate {
            path: path.to_owned(),
            reason,
        };
        let text =
            |path: &Path| read_limited(path).map_err(|error| refused(path, error.to_string()));
        let own = text(&self.certificate)?;
        let said = Certificate::from_pem(&own);
        let hosts = said
            .map_err(|error| refused(&self.certificate, format!("the certificate {error}")))?
            .hosts;
        let mut chain = Vec::new();
        for (path, pem) in [
            (&self.certificate, own),
            (&self.authority, text(&self.authority)?),
        ] {
            let one = CertificateDer::from_pem_slice(pem.as_bytes());
            chain.push(one.map_err(|error| refused(path, error.to_string()))?);
        }
        let key = PrivateKeyDer::from_pem_slice(text(&self.key)?.as_bytes());
        let key = key.map_err(|error| refused(&self.key, error.to_string()))?;
        let provider = Arc::new(ring::default_provider());
        let config = ServerConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, key))
            .map_err(|error| refused(&self.certificate, error.to_string()))?;
        Ok(PageIdentity {
            config: Arc::new(config),
            hosts,
        })
    }
}

/// Connections whose handshakes are done.
pub(super) struct TlsListener {
    ready: mpsc::Receiver<(TlsStream<Connection>, SocketAddr)>,
    address: SocketAddr,
}

impl TlsListener {
    /// Accepts on a listener; runs within a runtime.
    ///
    /// # Errors
    /// The listener has no address.
    pub(super) fn start(
        listener: TcpListener,
        config: Arc<ServerConfig>,
    ) -> io::Result<TlsListener> {
        let address = listener.local_addr()?;
        let (done, ready) = mpsc::channel(SHAKEN_MAX);
        tokio::spawn(accept(listener, TlsAcceptor::from(config), done));
        Ok(TlsListener { ready, address })
    }
}

impl Listener for TlsListener {
    type Io = TlsStream<Connection>;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (TlsStream<Connection>, SocketAddr) {
        match self.ready.recv().await {
            Some(connection) => connection,
            // The task that accepts ends with the runtime only.
            None => std::future::pending().await,
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        Ok(self.address)
    }
}

impl Connected<IncomingStream<'_, TlsListener>> for ConnectionPlace {
    fn connect_info(stream: IncomingStream<'_, TlsListener>) -> ConnectionPlace {
        let (connection, _) = stream.io().get_ref();
        connection.place().clone()
    }
}

/// Accepts, and lets each connection shake hands by itself; there are no more of them than have a place.
async fn accept(
    listener: TcpListener,
    acceptor: TlsAcceptor,
    done: mpsc::Sender<(TlsStream<Connection>, SocketAddr)>,
) {
    let limit = ConnectionLimit::default();
    loop {
        let (stream, from) = limit.accept(&listener).await;
        let (acceptor, done) = (acceptor.clone(), done.clone());
        tokio::spawn(async move {
            let shaken = tokio::time::timeout(HANDSHAKE_WITHIN, acceptor.accept(stream)).await;
            if let Ok(Ok(stream)) = shaken {
                stream.get_ref().0.place().is_shaken();
                // A server that ends takes nobody any more.
                let _ = done.send((stream, from)).await;
            }
        });
    }
}
