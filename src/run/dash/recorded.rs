//! The page of a recording in this process: what was said is told to the page's server, and then pages look at any moment
//! of it, perhaps beside another run.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};

use super::super::clock::Clock;
use super::pages::{self, Pages};
use super::{DashError, PageAddress, simulated};
use crate::config::Venue;
use crate::dash::ghost::{self, Ghost};
use crate::dash::texts::place;
use crate::dash::told::Showing;
use crate::operator::HeardMessage;
use crate::time::Time;

/// The page of a recording; dropping it ends it.
pub struct RecordedPage {
    link: String,
    pages: Pages,
    requests: Receiver<()>,
}

impl RecordedPage {
    /// Listens on a port of this machine (0 = any) and serves what was said in a run, ascending in time, beside another run if
    /// there is one.
    ///
    /// # Errors
    /// [`DashError`].
    pub fn start(
        venue: &Venue,
        port: u16,
        run: Vec<(Time, HeardMessage)>,
        other: Option<&Ghost>,
    ) -> Result<RecordedPage, DashError> {
        let listening = pages::listen(&PageAddress::on_this_machine(port))?;
        let (mut server, look) = simulated::looking_only(venue, place(venue, Showing::Replay))?;
        if let Some(other) = other {
            server.set_ghost(other, ghost::began(&run));
        }
        for (at, heard) in run {
            server.hear(at, &heard);
            server.show_moment(at);
        }
        server.end_history();
        let (woken, requests) = sync_channel(1);
        let wake = Arc::new(move || {
            // One that waits is enough.
            let _ = woken.try_send(());
        });
        Ok(RecordedPage {
            link: listening.link("look", &look),
            pages: Pages::start(server, listening, None, wake)?,
            requests,
        })
    }

    /// Returns the link of the page.
    pub fn link(&self) -> &str {
        &self.link
    }

    /// Serves until it shall end.
    pub fn serve(mut self, should_end: impl Fn() -> bool) {
        let clock = Clock::start();
        while !should_end() {
            let wait = self.pages.serve_looking(&clock);
            // Whether it was woken or has waited long enough is the same.
            let _ = self.requests.recv_timeout(wait);
        }
    }
}
