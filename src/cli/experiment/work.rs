//! Runs what is left of a grid on several threads. Results come back in the order in which they end; nothing that a run
//! gives depends on that order.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Sender, channel};

use super::grid::ExperimentGrid;
use super::row::{RowEnd, RunRow};
use super::seen::VisibleSceneCache;
use crate::cli::error::CliError;
use crate::cli::stop::StopFlag;
use crate::sim::{RunError, RunView};

/// Keeps a row, of all rows so far the last.
pub(super) type Keep<'a> = dyn FnMut(&RunRow, &[RunRow]) -> Result<(), CliError> + 'a;

/// What all threads share.
struct Shared<'a> {
    grid: &'a ExperimentGrid,
    left: &'a [usize],
    next: AtomicUsize,
    seen: VisibleSceneCache,
    stop: &'a StopFlag,
    /// Results cannot be kept any more.
    halt: AtomicBool,
}

/// Runs all runs that have no row yet, and hands each row to `keep`, with all rows so far, as soon as it is there; until
/// it is asked to stop, or `keep` fails.
///
/// # Errors
/// What `keep` says.
pub(super) fn run_rest(
    grid: &ExperimentGrid,
    threads: usize,
    stop: &StopFlag,
    rows: &mut Vec<RunRow>,
    keep: &mut Keep<'_>,
) -> Result<(), CliError> {
    let done: BTreeSet<usize> = rows.iter().map(|row| row.run).collect();
    let left: Vec<usize> = (0..grid.experiment().runs())
        .filter(|run| !done.contains(run))
        .collect();
    let (next, halt) = (AtomicUsize::new(0), AtomicBool::new(false));
    let shared = Shared {
        grid,
        left: &left,
        next,
        seen: VisibleSceneCache::default(),
        stop,
        halt,
    };
    let (sender, receiver) = channel();
    std::thread::scope(|scope| {
        for _ in 0..threads.min(left.len()) {
            let (shared, sender) = (&shared, sender.clone());
            scope.spawn(move || work(shared, &sender));
        }
        drop(sender);
        for row in receiver {
            rows.push(row);
            let Some(row) = rows.last() else { continue };
            keep(row, rows).inspect_err(|_| shared.halt.store(true, Ordering::Relaxed))?;
        }
        Ok(())
    })
}

/// Takes one run after the other.
fn work(shared: &Shared<'_>, sender: &Sender<RunRow>) {
    while let Some(run) = shared.left.get(shared.next.fetch_add(1, Ordering::Relaxed)) {
        if shared.is_over() {
            return;
        }
        let row = catch_unwind(AssertUnwindSafe(|| shared.run_one(*run)));
        let row = row.unwrap_or_else(|_| {
            Some(RunRow::without_figures(
                *run,
                RowEnd::Fault,
                "the program panicked".to_owned(),
            ))
        });
        // Who is asked to stop leaves the run for the next time.
        let Some(row) = row else { return };
        if sender.send(row).is_err() {
            return;
        }
    }
}

impl Shared<'_> {
    fn is_over(&self) -> bool {
        self.stop.is_asked() || self.halt.load(Ordering::Relaxed)
    }

    /// Runs one; `None` when it was asked to stop before the end.
    fn run_one(&self, run: usize) -> Option<RunRow> {
        let refused = |reason: String| Some(RunRow::without_figures(run, RowEnd::Refused, reason));
        let scenario = match self.grid.scenario(run) {
            Ok(scenario) => scenario,
            Err(error) => return refused(error.to_string()),
        };
        let seen = match self.seen.of(self.grid.experiment(), run, &scenario) {
            Ok(seen) => seen,
            Err(error) => return refused(error.to_string()),
        };
        let mut is_stopped = false;
        let mut watch = |_: &RunView<'_>| {
            is_stopped = self.is_over();
            !is_stopped
        };
        let outcome = scenario.run(&mut watch);
        if is_stopped {
            return None;
        }
        Some(match outcome {
            Ok(outcome) => RunRow::of(run, &scenario, &outcome, &seen),
            Err(RunError::Scenario(error)) => {
                RunRow::without_figures(run, RowEnd::Refused, error.to_string())
            }
            Err(RunError::Fault(fault)) => {
                RunRow::without_figures(run, RowEnd::Fault, fault.to_string())
            }
        })
    }
}
