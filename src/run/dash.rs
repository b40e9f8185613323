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
mod pages;
mod recorded;
mod simulated;

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use self::pages::Pages;
pub use self::recorded::RecordedPage;
pub use self::simulated::SimulationPage;
use super::live_operator::LiveOperator;
use super::membership::{self, RandomUnavailable};
use crate::actor::Fault;
use crate::config::Venue;
use crate::dash::board::Board;
use crate::dash::gate::Gate;
use crate::dash::page_server::{PageEffect, PageServer};
use crate::dash::texts::{Showing, place};
use crate::geom::Lattice;
use crate::operator::operator_actor::Out;
use crate::sim::ScenarioError;

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

/// An operator with its pages.
pub struct Dashboard {
    operator: LiveOperator,
    pages: Pages,
    links: [String; 2],
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
        let (listener, port) = pages::listen(port)?;
        let links = [
            pages::link(port, "look", &look),
            pages::link(port, "operate", &operate),
        ];
        let board = Board::new(venue.hash(), Lattice::new(venue.cell_m));
        let place = place(venue, Showing::Live);
        let server = PageServer::new(place, venue.clone(), board, Gate::new(look, operate));
        let waker = operator.session().waker();
        let wake = Arc::new(move || waker.wake());
        Ok(Dashboard {
            pages: Pages::start(server, (listener, port), folder, wake)?,
            operator,
            links,
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
            note(&out);
            let now = self.operator.now();
            self.pages.server.operator_said(now, &out);
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

fn note(out: &Out) {
    if let Some(words) = out.in_words() {
        tracing::info!("{words}");
    }
}
