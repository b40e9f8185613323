//! The page of a simulation in this process: it listens to the simulated bus and takes no orders. A thread of its own
//! serves, so that a page is answered while the run computes; the run waits for it when it cannot keep up, and is changed
//! by nothing.
//!
//! ```text
//!   simulated bus ──heard, virtual time──► this thread: PageServer ◄──requests── server thread ◄──► pages
//! ```

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use super::super::clock::Clock;
use super::pages::{self, Pages};
use super::{DashError, PageAddress, token};
use crate::config::{Config, Imaging, Solver, Venue};
use crate::dash::board::Board;
use crate::dash::gate::Gate;
use crate::dash::page_server::PageServer;
use crate::dash::scene_mesh::{scene_mesh, sensors};
use crate::dash::texts::{place, truth};
use crate::dash::told::{Place, Showing};
use crate::exchange::software::RELEASE;
use crate::geom::Lattice;
use crate::ground::from_config::image_settings;
use crate::ground::imager::Subject;
use crate::operator::HeardMessage;
use crate::sim::Scenario;
use crate::sim::bus::BusListener;
use crate::time::Time;
use crate::tomo::ImagingSettings;

/// What was heard and waits for the page; the run waits when there is more.
const WAITING: usize = 4096;
/// So much is taken before requests are looked at again.
const TAKEN_AT_ONCE: usize = 512;

/// What wakes the thread.
enum PageInput {
    /// Something was heard at a moment of virtual time.
    Heard(Time, Box<HeardMessage>),
    /// A request waits.
    Request,
    /// It shall end.
    End,
}

/// The page of a simulation; dropping it ends it.
pub struct SimulationPage {
    link: String,
    inputs: SyncSender<PageInput>,
    thread: Option<JoinHandle<()>>,
}

impl SimulationPage {
    /// Listens on a port of this machine (0 = any) and serves a scenario, with what truly stands there.
    ///
    /// # Errors
    /// [`DashError`].
    pub fn start(scenario: &Scenario, port: u16) -> Result<SimulationPage, DashError> {
        let venue = &scenario.sim().venue;
        let mut place = place(venue, Showing::Simulation);
        let outlines = scenario.outlines();
        let outlines = outlines.map_err(|error| DashError::Scenario(Box::new(error)))?;
        place.truth = Some(truth(&outlines, scenario.persons()));
        place.sensors = Some(sensors(&scenario.sim().range));
        let populated = scenario.populated();
        let populated = populated.map_err(|error| DashError::Scenario(Box::new(error)))?;
        let listening = pages::listen(&PageAddress::on_this_machine(port))?;
        let (mut server, look) = looking_only(venue, place)?;
        server.set_mesh(scene_mesh(&populated));
        server.set_settings(&Config::Sim(Box::new(scenario.sim().clone())));
        let [structure, change] =
            [Subject::Structure, Subject::Change].map(|of| images(scenario, of));
        server.set_imaging(structure, change);
        let link = listening.link("look", &look);
        let (inputs, waiting) = sync_channel(WAITING);
        let of_requests = inputs.clone();
        let wake = Arc::new(move || match of_requests.try_send(PageInput::Request) {
            // Who has much to take looks up soon anyway.
            Ok(()) | Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {}
        });
        let mut pages = Pages::start(server, listening, None, wake)?;
        pages.software = RELEASE;
        let thread = std::thread::Builder::new().name("simulation page".to_owned());
        let thread = thread.spawn(move || serve(pages, &waiting));
        Ok(SimulationPage {
            link,
            inputs,
            thread: Some(thread.map_err(DashError::Thread)?),
        })
    }

    /// Returns the link of the page.
    pub fn link(&self) -> &str {
        &self.link
    }

    /// Returns what listens to the bus of a run.
    pub fn listener(&self) -> BusListener {
        let inputs = self.inputs.clone();
        BusListener::new(move |now, heard| {
            // A page that has ended misses nothing.
            let _ = inputs.send(PageInput::Heard(now, Box::new(heard.clone())));
        })
    }
}

impl Drop for SimulationPage {
    fn drop(&mut self) {
        let _ = self.inputs.send(PageInput::End);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Makes a server without orders at the time zero, of a place ([`place`]); returns its token as well.
///
/// # Errors
/// [`DashError::Random`].
pub(super) fn looking_only(venue: &Venue, place: Place) -> Result<(PageServer, String), DashError> {
    let look = token()?;
    let board = Board::new(venue.hash(), Lattice::new(venue.cell_m));
    let gate = Gate::looking_only(look.clone());
    let mut server = PageServer::new(place, venue.clone(), board, gate);
    server.show_moment(Time::ZERO);
    // Whoever is shown is reached.
    server.set_linked(Time::ZERO, true);
    Ok((server, look))
}

/// Returns how a scenario's ground station images a subject, by the solver `map`, which knows what made a pixel.
fn images(scenario: &Scenario, subject: Subject) -> ImagingSettings {
    let sim = scenario.sim();
    let imaging = Imaging {
        solver: Solver::Map,
        ..sim.imaging
    };
    let sensitivity_dbm = sim.radio.reception.sensitivity_dbm;
    image_settings(&imaging, sim.venue.area, sensitivity_dbm, subject)
}

fn serve(mut pages: Pages, waiting: &Receiver<PageInput>) {
    let clock = Clock::start();
    loop {
        let Ok(first) = waiting.recv_timeout(pages.serve_looking(&clock)) else {
            continue;
        };
        for what in std::iter::once(first).chain(waiting.try_iter().take(TAKEN_AT_ONCE)) {
            match what {
                PageInput::Heard(at, heard) => {
                    pages.server.hear(at, &heard);
                    pages.server.show_moment(at);
                }
                PageInput::Request => {}
                PageInput::End => return,
            }
        }
    }
}
