//! `sim --dash`: the operator's page of a simulation, while it runs and until Ctrl-C. It begins, feeds and ends the page;
//! what the page shows is `dash`'s, and the run is the same without it.

use std::cell::RefCell;
use std::io::Write;
use std::time::Instant;

use super::dash::{PAGE_PORT, refused};
use super::error::CliError;
use super::flight::{Flights, SEGMENT};
use super::sim::watched;
use super::stop::StopFlag;
use super::watch::{NAP, nap, wait_for};
use crate::run::dash::SimulationPage;
use crate::sim::{RunOutcome, RunView, Scenario};

/// Begins to serve, and prints the link.
///
/// # Errors
/// The port is in use, or the link cannot be printed.
pub(super) fn start(
    scenario: &Scenario,
    port: Option<u16>,
    out: &mut dyn Write,
) -> Result<SimulationPage, CliError> {
    let page = SimulationPage::start(scenario, port.unwrap_or(PAGE_PORT));
    let page = page.map_err(refused)?;
    let written = writeln!(out, "to look     {}", page.link()).and_then(|()| out.flush());
    written.map_err(CliError::stdout)?;
    Ok(page)
}

/// Runs the scenario, at a pace if one is given, lets the page listen, and records it if there are flights.
///
/// # Errors
/// The scenario is impossible, or the program is at fault.
pub(super) fn run(
    page: &SimulationPage,
    scenario: &Scenario,
    flights: Option<&RefCell<Flights>>,
    pace: Option<f64>,
    (stop, started): (&StopFlag, Instant),
) -> Result<RunOutcome, CliError> {
    watched(stop, started, None, |watch| {
        let mut paced = |shown: &RunView<'_>| {
            wait_for(shown.status.now, pace, started, stop);
            watch(shown)
        };
        let listener = page.listener();
        match flights {
            None => scenario.run_heard(&mut paced, listener),
            Some(flights) => {
                let mut paced =
                    |shown: &RunView<'_>| paced(shown) && !flights.borrow().is_in_trouble();
                let mut record = |entry| flights.borrow_mut().take(&entry);
                scenario.run_heard_and_recorded(&mut paced, listener, SEGMENT, &mut record)
            }
        }
    })
}

/// Serves until Ctrl-C, unless the run was ended by that, and returns how the run went.
///
/// # Errors
/// Those of the run.
pub(super) fn stay(
    page: SimulationPage,
    stop: &StopFlag,
    published: Result<(), CliError>,
) -> Result<(), CliError> {
    while !stop.is_asked() {
        nap(NAP);
    }
    drop(page);
    published
}
