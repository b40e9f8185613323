//! The operator's page on a port of this machine: an operator on the bus, what its pages are served ([`crate::dash`]), and a
//! server of HTTP (`http` with its folder, `connections` and `tls`, which alone name its library). This loop carries words between
//! them and decides nothing.
//!
//! ```text
//!   bus ◄──► operator ◄──► this loop: PageServer ◄──requests── server thread ◄──► pages
//!                                                ──frames───►
//! ```
//!
//! A request wakes the loop, so that an order waits for nothing that is heard.

mod answers;
mod connections;
mod files;
mod foxglove;
mod http;
mod pages;
mod recorded;
mod simulated;
mod tls;
mod viewers;

use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::sync::Arc;

use tomoswarm_proto::Interest;

use self::pages::Pages;
pub use self::pages::SharedRunFiles;
pub use self::recorded::RecordedPage;
pub use self::simulated::SimulationPage;
pub use self::tls::PageCertificate;
use super::live_operator::LiveOperator;
use super::membership::{self, RandomUnavailable};
use crate::actor::Fault;
use crate::config::Venue;
use crate::dash::board::Board;
use crate::dash::gate::Gate;
use crate::dash::page_server::{PageEffect, PageServer};
use crate::dash::texts::{order_in_words, place};
use crate::dash::told::Showing;
use crate::geom::Lattice;
use crate::operator::operator_actor::{In, Out};
use crate::operator::order_goal::GoalId;
use crate::sim::ScenarioError;

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum DashError {
    /// The port is not free, or may not be used.
    #[error(
        "{address}:{port} cannot be listened on: {source}; choose another port, or 0 for any that is free"
    )]
    Listen {
        /// Where.
        address: IpAddr,
        /// Which port.
        port: u16,
        /// Why.
        source: io::Error,
    },
    /// Another address than that of this machine alone, without a certificate.
    #[error(
        "{0} can be reached from other machines, and the operator's file has no certificate for TLS: without one the page is \
         served on 127.0.0.1 only (`tomoswarm enroll` writes one; or use a tunnel, ssh -L)"
    )]
    NoCertificate(IpAddr),
    /// Another address than that of this machine alone, and a certificate that names no other machine.
    #[error(
        "{address} can be reached from other machines, but the operator's certificate names this one only ({hosts}), and browsers \
         elsewhere would refuse it: `tomoswarm enroll SWARM --venue FILE operator --host NAME --replace` names another"
    )]
    NotNamedElsewhere {
        /// Where.
        address: IpAddr,
        /// The names in the certificate.
        hosts: String,
    },
    /// A file of the certificate is refused.
    #[error("{}: {reason}", path.display())]
    Certificate {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The scene of a simulation cannot be built.
    #[error(transparent)]
    Scenario(Box<ScenarioError>),
    /// There are no random numbers for the tokens.
    #[error(transparent)]
    Random(#[from] RandomUnavailable),
    /// The server's thread cannot be started.
    #[error("the server cannot be started: {0}")]
    Thread(io::Error),
}

/// Where a page is served.
#[derive(Clone, Debug)]
pub struct PageAddress {
    /// The address that is listened on.
    pub address: IpAddr,
    /// The port; 0 = any.
    pub port: u16,
    /// The operator's certificate, if there is one.
    pub certificate: Option<PageCertificate>,
}

impl PageAddress {
    /// Returns a port of this machine alone.
    pub fn on_this_machine(port: u16) -> PageAddress {
        PageAddress {
            address: IpAddr::V4(Ipv4Addr::LOCALHOST),
            port,
            certificate: None,
        }
    }

    /// Judges whether a page may be served there, before anything begins.
    ///
    /// # Errors
    /// Other machines reach it, and there is no certificate.
    pub fn check(&self) -> Result<(), DashError> {
        match self.certificate {
            None if !self.address.is_loopback() => Err(DashError::NoCertificate(self.address)),
            _ => Ok(()),
        }
    }
}

/// An operator with its pages.
pub struct Dashboard {
    operator: LiveOperator,
    pages: Pages,
    links: [String; 2],
}

impl Dashboard {
    /// Listens on an address, by TLS unless it is of this machine alone, and serves the pages that are built in, or those of a
    /// folder.
    ///
    /// # Errors
    /// [`DashError`].
    pub fn start(
        mut operator: LiveOperator,
        venue: &Venue,
        at: &PageAddress,
        folder: Option<PathBuf>,
    ) -> Result<Dashboard, DashError> {
        let [look, operate] = [token()?, token()?];
        let listening = pages::listen(at)?;
        let links = [
            listening.link("look", &look),
            listening.link("operate", &operate),
        ];
        let board = Board::new(venue.hash(), Lattice::new(venue.cell_m));
        let place = place(venue, Showing::Live);
        let server = PageServer::new(place, venue.clone(), board, Gate::new(look, operate));
        // Both are little, and what was said before a page is opened is wanted as well.
        for of in [Interest::Log, Interest::Settings] {
            operator.tell(In::Ask(of, true));
        }
        let waker = operator.session().waker();
        let wake = Arc::new(move || waker.wake());
        Ok(Dashboard {
            pages: Pages::start(server, listening, folder, wake)?,
            operator,
            links,
        })
    }

    /// Takes the store of a ground station on this machine, whose runs pages can save.
    pub fn set_store(&mut self, store: SharedRunFiles) {
        self.pages.set_store(store);
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
        self.pages.answer(self.operator.now());
        let is_linked = self.operator.session().is_linked();
        let now = self.operator.now();
        self.pages.server.set_linked(now, is_linked);
        self.carry_out();
        let now = self.operator.now();
        let until = self.pages.until(now);
        let server = &mut self.pages.server;
        let said = self
            .operator
            .go_on(until, |at, heard| server.hear(at, heard))?;
        for out in said {
            let now = self.operator.now();
            self.pages.server.operator_said(now, &out);
            note(&out, self.pages.server.board());
        }
        Ok(())
    }

    fn carry_out(&mut self) {
        for effect in self.pages.send_due(self.operator.now()) {
            match effect {
                PageEffect::Tell(input) => self.operator.tell(input),
                PageEffect::Publish(message) => {
                    self.operator.session().publisher().publish(&message);
                }
                // These have gone.
                PageEffect::Send(..) | PageEffect::Close(..) => {}
            }
        }
    }
}

/// Draws 128 random bits.
fn token() -> Result<String, RandomUnavailable> {
    let (high, low) = (membership::draw()?, membership::draw()?);
    Ok(format!("{high:016x}{low:016x}"))
}

/// Writes down what the operator has brought about; of an order of a page by whom, by which lease, and its fate.
fn note(out: &Out, board: &Board) {
    let words = if let Out::Ended(GoalId::Hand(number), outcome) = out {
        Some(order_in_words(board, *number, outcome))
    } else {
        out.in_words()
    };
    if let Some(words) = words {
        tracing::info!("{words}");
    }
}
