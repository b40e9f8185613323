//! `tomoswarm sim --trials N`: the same scenario with many seeds on all cores, and whether the contracts held in
//! every one: no collision, no fence breach, an end as the file expects it (every sweep ends, all are home, or all are
//! held), and, where sweeps are to end, how often everybody was found.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::ops::RangeInclusive;
use std::sync::{Mutex, PoisonError};
use std::thread::ScopedJoinHandle;

use super::error::CliError;
use super::report;
use super::sim::SimArgs;
use super::stop::StopFlag;
use crate::config::{Expect, Sim};
use crate::sim::{NEAR_M, RunOutcome, RunView, Scenario};

/// Share of the seeds in which everybody must be found.
const FOUND_SHARE: f64 = 0.95;

/// What one seed gave.
#[derive(Clone, Debug)]
struct Trial {
    /// It ended as it should, whatever went wrong on the way.
    has_ended_well: bool,
    /// The same, and nothing went wrong on the way.
    is_safe: bool,
    home: usize,
    held: usize,
    collisions: usize,
    fence_breaches: usize,
    min_separation_m: Option<f64>,
    simulated_s: f64,
    /// Per person, the distance to the nearest find, metres; infinite without any.
    errors_m: Vec<f64>,
    finds: usize,
    /// Finds that are nobody.
    nobodies: usize,
    log_hash: u64,
}

impl Trial {
    fn of(scenario: &Scenario, outcome: &RunOutcome) -> Trial {
        let found = outcome.found();
        // Without an image of what has changed nobody is looked for.
        let errors_m = match finds_persons(scenario.sim()) {
            true => outcome.errors_m(),
            false => Vec::new(),
        };
        Trial {
            has_ended_well: report::has_ended_well(scenario, outcome),
            is_safe: report::failure(scenario, outcome).is_none(),
            home: outcome.home,
            held: outcome.held,
            collisions: outcome.collisions.len(),
            fence_breaches: outcome.fence_breaches,
            min_separation_m: outcome.min_separation_m,
            simulated_s: outcome.simulated.as_secs_f64(),
            errors_m,
            finds: found.len(),
            nobodies: found.iter().filter(|find| !find.is_somebody()).count(),
            log_hash: crate::sim::log::hash(outcome.log.bytes().map(u64::from)),
        }
    }

    fn all_found(&self) -> bool {
        self.errors_m.iter().all(|error_m| *error_m <= NEAR_M)
    }

    fn line(&self, seed: u64, word: &str) -> String {
        let errors: Vec<String> = self
            .errors_m
            .iter()
            .map(|error_m| format!("{error_m:.2}"))
            .collect();
        let separation = self
            .min_separation_m
            .map_or("-".to_owned(), |metres| format!("{metres:.2}"));
        format!(
            "{seed:>6}  {:<8}  {:>7.0}  {:>4}  {:>4}  {:>10}  {:>6}  {separation:>10}  {:<14}  {:>5}  {:016x}",
            if self.has_ended_well { word } else { "NOT" },
            self.simulated_s,
            self.home,
            self.held,
            self.collisions,
            self.fence_breaches,
            errors.join(" "),
            self.finds,
            self.log_hash,
        )
    }
}

/// Runs `count` seeds and prints a table.
///
/// # Errors
/// Bad files, a fault, or a contract that did not hold.
pub(super) fn run(
    args: &SimArgs,
    count: u64,
    stop: &StopFlag,
    out: &mut (dyn Write + Send),
) -> Result<(), CliError> {
    let scenario = args.scenario(None)?;
    let first = args.seed.unwrap_or(scenario.sim().seed);
    let expect = scenario.sim().expect;
    let word = word_of(expect);
    let Some(last) = first.checked_add(count - 1) else {
        return Err(CliError::Usage(format!(
            "{count} seeds from {first} go beyond the last one, {}",
            u64::MAX
        )));
    };
    writeln!(
        out,
        "  seed  end       time/s  home  held  collisions  fence  separation  errors/m        finds  log"
    )
    .map_err(unwritten)?;
    let trials = run_all(args, first..=last, word, stop, out)?;
    let share = |good: usize| 100.0 * good as f64 / trials.len().max(1) as f64;
    let (safe, found) = (
        count_of(&trials, |trial| trial.is_safe),
        count_of(&trials, Trial::all_found),
    );
    let nobodies: usize = trials.values().map(|trial| trial.nobodies).sum();
    let finds = match expect {
        Expect::Finished if finds_persons(scenario.sim()) => {
            format!(
                ", everybody found within {NEAR_M} m in {found} ({:.1} %), finds of nobody: {nobodies}",
                share(found)
            )
        }
        Expect::Finished | Expect::Home | Expect::Held => String::new(),
    };
    writeln!(
        out,
        "{} seeds: {safe} safe and {word} ({:.1} %){finds}",
        trials.len(),
        share(safe)
    )
    .map_err(unwritten)?;
    broken(expect, count, trials.len(), safe, found)
        .map_or(Ok(()), |reason| Err(CliError::Mission(reason)))
}

/// Returns whether a run makes an image of what has changed, in which persons are looked for.
fn finds_persons(sim: &Sim) -> bool {
    sim.is_planned_by_ground() && sim.empty_sweep
}

/// Returns the word for the end that a file expects.
fn word_of(expect: Expect) -> &'static str {
    match expect {
        Expect::Finished => "finished",
        Expect::Home => "home",
        Expect::Held => "held",
    }
}

fn unwritten(source: io::Error) -> CliError {
    CliError::Write {
        path: "standard output".into(),
        source,
    }
}

/// Returns which contract was broken, if any, when of `wanted` seeds `run` were run.
fn broken(expect: Expect, wanted: u64, run: usize, safe: usize, found: usize) -> Option<String> {
    if (run as u64) < wanted {
        return Some(format!(
            "it was asked to stop after {run} of {wanted} seeds"
        ));
    }
    if safe < run {
        return Some("a contract did not hold in every seed".to_owned());
    }
    let is_rare = expect == Expect::Finished && (found as f64) < FOUND_SHARE * run as f64;
    is_rare.then(|| {
        format!(
            "everybody was found in less than {:.0} %",
            100.0 * FOUND_SHARE
        )
    })
}

fn count_of(trials: &BTreeMap<u64, Trial>, is_good: fn(&Trial) -> bool) -> usize {
    trials.values().filter(|trial| is_good(trial)).count()
}

/// The trials that are done, and the table of them: each line as soon as all before it are there.
struct Table<'a> {
    done: BTreeMap<u64, Trial>,
    next: u64,
    word: &'static str,
    out: &'a mut (dyn Write + Send),
}

impl Table<'_> {
    fn record(&mut self, seed: u64, trial: Trial) -> io::Result<()> {
        self.done.insert(seed, trial);
        while let Some(trial) = self.done.get(&self.next) {
            writeln!(self.out, "{}", trial.line(self.next, self.word))?;
            self.next = self.next.saturating_add(1);
        }
        self.out.flush()
    }
}

/// Runs the seeds on all cores, until it is asked to stop.
fn run_all(
    args: &SimArgs,
    seeds: RangeInclusive<u64>,
    word: &'static str,
    stop: &StopFlag,
    out: &mut (dyn Write + Send),
) -> Result<BTreeMap<u64, Trial>, CliError> {
    let table = Mutex::new(Table {
        done: BTreeMap::new(),
        next: *seeds.start(),
        word,
        out,
    });
    let left = Mutex::new(seeds);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores)
            .map(|_| scope.spawn(|| work(args, &left, stop, &table)))
            .collect();
        let join = |worker: ScopedJoinHandle<'_, Result<(), CliError>>| match worker.join() {
            Ok(result) => result,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        workers.into_iter().try_for_each(join)
    })?;
    Ok(table
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner)
        .done)
}

/// Runs seeds until none is left.
fn work(
    args: &SimArgs,
    left: &Mutex<RangeInclusive<u64>>,
    stop: &StopFlag,
    table: &Mutex<Table<'_>>,
) -> Result<(), CliError> {
    loop {
        let Some(seed) = left.lock().unwrap_or_else(PoisonError::into_inner).next() else {
            return Ok(());
        };
        let Some(trial) = run_one(args, seed, stop)? else {
            return Ok(());
        };
        let mut table = table.lock().unwrap_or_else(PoisonError::into_inner);
        table.record(seed, trial).map_err(unwritten)?;
    }
}

/// Runs one seed; `None` when it was asked to stop before the end.
fn run_one(args: &SimArgs, seed: u64, stop: &StopFlag) -> Result<Option<Trial>, CliError> {
    let scenario = args.scenario(Some(seed))?;
    let mut is_stopped = false;
    let mut watch = |_: &RunView<'_>| {
        is_stopped = stop.is_asked();
        !is_stopped
    };
    let outcome = scenario
        .run(&mut watch)
        .map_err(|error| CliError::Fault(format!("seed {seed}: {error}")))?;
    Ok((!is_stopped).then(|| Trial::of(&scenario, &outcome)))
}
