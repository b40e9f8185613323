//! The operator's page on a port of this machine: an operator on the bus, what its pages are served ([`crate::dash`]), and a
//! server of HTTP (`http`, the only place that names its library). This loop carries words between them and decides nothing.
//!
//! ```text
//!   bus ◄──► operator ◄──► this loop: PageServer ◄──requests── server thread ◄──► pages
//!                                                ──frames───►
//! ```
//!
//! A request wakes the loop, so that an order waits for nothing that is heard.

mod files;
mod http;

use std::collections::BTreeMap;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use self::http::{HttpServer, LookWord, Outbound, Request, RequestSender};
use super::live_operator::LiveOperator;
use super::membership::{self, RandomUnavailable, SOFTWARE};
use crate::actor::Fault;
use crate::config::Venue;
use crate::dash::board::Board;
use crate::dash::gate::{Gate, OwnNames, PageId};
use crate::dash::page_server::{PageEffect, PageServer};
use crate::dash::texts::{Showing, place};
use crate::geom::Lattice;
use crate::operator::operator_actor::Out;

/// Requests that wait for the loop; who comes when there are more is refused.
const REQUESTS_WAITING: usize = 256;
/// The loop looks whether it shall end this often.
const LOOKS_EVERY: Duration = Duration::from_millis(100);

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum DashError {
    /// The port is not free, or may not be used.
    #[error(
        "127.0.0.1:{port} cannot be listened on: {source}; choose another port, or 0 for any that is free"
    )]
    Listen {
        /// Which port.
        port: u16,
        /// Why.
        source: io::Error,
    },
    /// There are no random numbers for the tokens.
    #[error(transparent)]
    Random(#[from] RandomUnavailable),
    /// The server's thread cannot be started.
    #[error("the server cannot be started: {0}")]
    Thread(io::Error),
}

/// An operator with its pages.
pub struct Dashboard {
    operator: LiveOperator,
    server: PageServer,
    requests: Receiver<Request>,
    pages: BTreeMap<PageId, tokio::sync::mpsc::Sender<Outbound>>,
    links: [String; 2],
    _http: HttpServer,
}

impl Dashboard {
    /// Listens on a port of this machine (0 = any), and serves the pages that are built in, or those of a folder.
    ///
    /// # Errors
    /// [`DashError`].
    pub fn start(
        operator: LiveOperator,
        venue: &Venue,
        port: u16,
        folder: Option<PathBuf>,
    ) -> Result<Dashboard, DashError> {
        let [look, operate] = [token()?, token()?];
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
        let listener = listener.map_err(|source| DashError::Listen { port, source })?;
        let port = listener.local_addr().map_or(port, |address| address.port());
        let link = |word: &str, token: &str| format!("http://127.0.0.1:{port}/#{word}={token}");
        let links = [link("look", &look), link("operate", &operate)];
        let board = Board::new(venue.hash(), Lattice::new(venue.cell_m));
        let place = place(venue, Showing::Live);
        let server = PageServer::new(place, venue.clone(), board, Gate::new(look, operate));
        let (told, requests) = sync_channel(REQUESTS_WAITING);
        let sender = RequestSender::new(told, operator.session().waker());
        let http = HttpServer::start(listener, OwnNames::on_port(port), sender, folder);
        Ok(Dashboard {
            operator,
            server,
            requests,
            pages: BTreeMap::new(),
            links,
            _http: http.map_err(DashError::Thread)?,
        })
    }

    /// Returns the link that may look, and the one that may order as well.
    pub fn links(&self) -> &[String; 2] {
        &self.links
    }

    /// Serves until it shall end.
    ///
    /// # Errors
    /// The operator cannot go on.
    pub fn run(mut self, should_end: impl Fn() -> bool) -> Result<(), Fault> {
        while !should_end() {
            self.turn()?;
        }
        self.operator.close();
        Ok(())
    }

    fn turn(&mut self) -> Result<(), Fault> {
        let requests: Vec<Request> = self.requests.try_iter().take(REQUESTS_WAITING).collect();
        for request in requests {
            self.take(request);
        }
        self.server.set_linked(self.operator.session().is_linked());
        self.carry_out();
        let now = self.operator.now();
        let until = self.server.deadline().min(now + LOOKS_EVERY);
        let server = &mut self.server;
        let said = self
            .operator
            .go_on(until, |at, heard| server.hear(at, heard))?;
        for out in said {
            note(&out);
            let now = self.operator.now();
            self.server.operator_said(now, &out);
        }
        Ok(())
    }

    fn take(&mut self, request: Request) {
        let now = self.operator.now();
        match request {
            Request::Open { frames, reply } => {
                let opened = self.server.open(now);
                if let Ok(id) = opened {
                    self.pages.insert(id, frames);
                }
                // A page that has gone meanwhile is told of as closed.
                let _ = reply.send(opened);
            }
            Request::PageSaid(id, text) => {
                if let Err(refusal) = self.server.page_said(now, id, &text) {
                    self.send(id, Outbound::Close(refusal));
                }
            }
            Request::Closed(id) => {
                self.pages.remove(&id);
                self.server.closed(id);
            }
            Request::Look {
                what,
                authorization,
                reply,
            } => {
                let token = authorization.as_deref();
                let text = match what {
                    LookWord::Metrics => self.server.metrics(now, token),
                    LookWord::Preflight => self.server.preflight(now, token, SOFTWARE),
                };
                let _ = reply.send(text);
            }
            Request::Order {
                authorization,
                body,
                reply,
            } => {
                let taken = self.server.order(now, authorization.as_deref(), &body);
                match &taken {
                    Ok(number) => tracing::info!("order {number} of a page: {}", shown(&body)),
                    Err(refusal) => tracing::warn!("an order of a page is refused: {refusal}"),
                }
                let _ = reply.send(taken);
            }
        }
    }

    fn carry_out(&mut self) {
        for effect in self.server.due(self.operator.now()) {
            match effect {
                PageEffect::Send(id, frame) => self.send(id, Outbound::Frame(frame)),
                PageEffect::Close(id, refusal) => self.send(id, Outbound::Close(refusal)),
                PageEffect::Tell(input) => self.operator.tell(input),
                PageEffect::Publish(message) => {
                    self.operator.session().publisher().publish(&message);
                }
            }
        }
    }

    /// Sends to a page; one that is gone says so itself.
    fn send(&self, id: PageId, outbound: Outbound) {
        if let Some(page) = self.pages.get(&id) {
            let _ = page.try_send(outbound);
        }
    }
}

/// Draws 128 random bits.
fn token() -> Result<String, RandomUnavailable> {
    let (high, low) = (membership::draw()?, membership::draw()?);
    Ok(format!("{high:016x}{low:016x}"))
}

/// Returns a body as one line of a log.
fn shown(body: &[u8]) -> String {
    String::from_utf8_lossy(body)
        .escape_debug()
        .take(200)
        .collect()
}

fn note(out: &Out) {
    if let Some(words) = out.in_words() {
        tracing::info!("{words}");
    }
}
