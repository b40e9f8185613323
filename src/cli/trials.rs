//! `tomoswarm sim --trials N`: the same scenario with many seeds on all cores, and whether the contracts held in
//! every one: no collision, no fence breach, an end as the file expects it (every sweep ends, all are home, or all are
//! held), and, where sweeps are to end, how often everybody was found.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::ops::RangeInclusive;
use std::sync::{Mutex, PoisonError};
use std::thread::ScopedJoinHandle;

use super::error::CliError;
use super::person_search;
use super::report;
use super::sim::{SimArgs, warn_of_scenario};
use super::stop::StopFlag;
use crate::config::{Expect, SEEDS};
use crate::sim::{NEAR_M, RunOutcome, RunView, Scenario};

/// Share of the seeds in which everybody must be found.
const FOUND_SHARE: f64 = 0.95;

/// What came of the search for persons.
#[derive(Clone, PartialEq, Debug)]
enum SearchResult {
    /// The scenario does not search.
    NotWanted,
    /// Nobody was searched for: the sweep was given up, or its links tell no places.
    NotDone,
    /// Per person, the distance to its find, metres; infinite without one.
    Done(Vec<f64>),
}

/// What one seed gave.
#[derive(Clone, Debug)]
struct Trial {
    /// It ended as it should, whatever went wrong on the way.
    has_ended_well: bool,
    /// Why the run failed, also by what went wrong on the way; `None` when it did not.
    failure: Option<String>,
    home: usize,
    held: usize,
    collisions: usize,
    fence_breaches: usize,
    min_separation_m: Option<f64>,
    simulated_s: f64,
    search: SearchResult,
    finds: usize,
    /// Finds that are nobody.
    nobodies: usize,
    log_hash: u64,
}

impl Trial {
    fn of(scenario: &Scenario, outcome: &RunOutcome) -> Trial {
        let found = outcome.found();
        let is_wanted = person_search::is_wanted(scenario.sim());
        Trial {
            has_ended_well: report::has_ended_well(scenario, outcome),
            failure: report::failure(scenario, outcome),
            home: outcome.home,
            held: outcome.held,
            collisions: outcome.collisions.len(),
            fence_breaches: outcome.fence_breaches,
            min_separation_m: outcome.min_separation_m,
            simulated_s: outcome.simulated.as_secs_f64(),
            search: match (is_wanted, outcome.has_searched()) {
                (false, _) => SearchResult::NotWanted,
                (true, false) => SearchResult::NotDone,
                (true, true) => SearchResult::Done(outcome.errors_m()),
            },
            finds: found.len(),
            nobodies: found.iter().filter(|find| !find.is_somebody()).count(),
            log_hash: crate::sim::log::hash(outcome.log.bytes().map(u64::from)),
        }
    }

    fn is_safe(&self) -> bool {
        self.failure.is_none()
    }

    fn has_searched(&self) -> bool {
        matches!(self.search, SearchResult::Done(_))
    }

    fn all_found(&self) -> bool {
        match &self.search {
            SearchResult::NotWanted | SearchResult::NotDone => false,
            SearchResult::Done(errors_m) => errors_m.iter().all(|error_m| *error_m <= NEAR_M),
        }
    }

    /// Returns how far each person's find is off, and how many finds there are, as the table shows it.
    fn found_in_words(&self) -> (String, String) {
        match &self.search {
            SearchResult::NotWanted => (String::new(), self.finds.to_string()),
            SearchResult::NotDone => ("not searched".to_owned(), "-".to_owned()),
            SearchResult::Done(errors_m) => {
                let errors = errors_m.iter().map(|error_m| format!("{error_m:.2}"));
                let errors: Vec<String> = errors.collect();
                (errors.join(" "), self.finds.to_string())
            }
        }
    }

    fn line(&self, seed: u64, word: &str) -> String {
        let (errors, finds) = self.found_in_words();
        let separation = self
            .min_separation_m
            .map_or("-".to_owned(), |metres| format!("{metres:.2}"));
        format!(
            "{seed:>6}  {:<8}  {:>7.0}  {:>4}  {:>4}  {:>10}  {:>6}  {separation:>10}  {errors:<14}  {finds:>5}  {:016x}",
            if self.has_ended_well { word } else { "NOT" },
            self.simulated_s,
            self.home,
            self.held,
            self.collisions,
            self.fence_breaches,
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
    warn_of_scenario(&scenario)?;
    let first = args.seed.unwrap_or(scenario.sim().seed);
    let expect = scenario.sim().expect;
    let word = word_of(expect);
    let last = first.checked_add(count - 1);
    let Some(last) = last.filter(|last| SEEDS.contains(last)) else {
        return Err(CliError::Usage(format!(
            "{count} seeds from {first} go beyond the last one, {}",
            SEEDS.end()
        )));
    };
    writeln!(
        out,
        "  seed  end       time/s  home  held  collisions  fence  separation  errors/m        finds  log"
    )
    .map_err(unwritten)?;
    let trials = run_all(args, first..=last, word, stop, out)?;
    let counts = TrialCounts::of(&trials);
    let finds = match expect {
        Expect::Finished if person_search::is_wanted(scenario.sim()) => counts.finds_in_words(),
        Expect::Finished | Expect::Home | Expect::Held => String::new(),
    };
    writeln!(
        out,
        "{} seeds: {} safe and {word} ({:.1} %){finds}",
        counts.run,
        counts.safe,
        percent(counts.safe, counts.run)
    )
    .map_err(unwritten)?;
    let is_search_judged = expect == Expect::Finished && person_search::is_wanted(scenario.sim());
    let first_failure = trials
        .iter()
        .find_map(|(seed, trial)| Some(format!("seed {seed}: {}", trial.failure.as_ref()?)));
    if (counts.run as u64) < count {
        let run = counts.run;
        return Err(CliError::Stopped(format!(
            "it was asked to stop after {run} of {count} seeds"
        )));
    }
    broken(&counts, is_search_judged, first_failure)
        .map_or(Ok(()), |reason| Err(CliError::Mission(reason)))
}

/// Returns a share in percent; of none, 0.
fn percent(good: usize, of: usize) -> f64 {
    100.0 * good as f64 / of.max(1) as f64
}

/// How many trials were how.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct TrialCounts {
    run: usize,
    safe: usize,
    searched: usize,
    all_found: usize,
    nobodies: usize,
}

impl TrialCounts {
    fn of(trials: &BTreeMap<u64, Trial>) -> TrialCounts {
        let count = |is: fn(&Trial) -> bool| trials.values().filter(|trial| is(trial)).count();
        TrialCounts {
            run: trials.len(),
            safe: count(Trial::is_safe),
            searched: count(Trial::has_searched),
            all_found: count(Trial::all_found),
            nobodies: trials.values().map(|trial| trial.nobodies).sum(),
        }
    }

    /// Returns how often everybody was found, of the seeds in which persons were searched.
    fn finds_in_words(&self) -> String {
        let (found, searched) = (self.all_found, self.searched);
        let share = percent(found, searched);
        let of = match self.run - searched {
            0 => format!("{found} ({share:.1} %)"),
            unsearched => {
                format!("{found} of {searched} ({share:.1} %), nobody searched for in {unsearched}")
            }
        };
        format!(
            ", everybody found within {NEAR_M} m in {of}, finds of nobody: {}",
            self.nobodies
        )
    }
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

/// Returns why the trials have failed, if they have; `first_failure` says of which seed, and why.
fn broken(
    counts: &TrialCounts,
    is_search_judged: bool,
    first_failure: Option<String>,
) -> Option<String> {
    let run = counts.run;
    if let Some(first) = first_failure {
        let failed = run - counts.safe;
        return Some(format!("{failed} of {run} seeds failed; {first}"));
    }
    if !is_search_judged {
        return None;
    }
    if counts.searched < run {
        let unsearched = run - counts.searched;
        return Some(format!(
            "nobody was searched for in {unsearched} of {run} seeds"
        ));
    }
    let is_rare = (counts.all_found as f64) < FOUND_SHARE * run as f64;
    is_rare.then(|| {
        format!(
            "everybody was found in {} of {run} seeds, which is less than {:.0} %",
            counts.all_found,
            100.0 * FOUND_SHARE
        )
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(search: SearchResult, failure: Option<&str>) -> Trial {
        Trial {
            has_ended_well: failure.is_none(),
            failure: failure.map(str::to_owned),
            home: 2,
            held: 0,
            collisions: 0,
            fence_breaches: 0,
            min_separation_m: None,
            simulated_s: 100.0,
            search,
            finds: 1,
            nobodies: 0,
            log_hash: 7,
        }
    }

    fn check(trials: &[Trial], words: &str, expected: Option<&str>) {
        let trials: BTreeMap<u64, Trial> = (3..).zip(trials.iter().cloned()).collect();
        let counts = TrialCounts::of(&trials);
        assert_eq!(counts.finds_in_words(), words);
        let first = trials
            .iter()
            .find_map(|(seed, trial)| Some(format!("seed {seed}: {}", trial.failure.as_ref()?)));
        let reason = broken(&counts, true, first);
        assert_eq!(reason.as_deref(), expected);
    }

    #[test]
    fn who_was_not_searched_for_is_counted_apart() {
        let found = || trial(SearchResult::Done(vec![0.2, 0.4]), None);
        let missed = || trial(SearchResult::Done(vec![0.2, f64::INFINITY]), None);
        let given_up = || trial(SearchResult::NotDone, Some("time is up"));
        check(
            &[found(), found()],
            ", everybody found within 1 m in 2 (100.0 %), finds of nobody: 0",
            None,
        );
        check(
            &[found(), missed()],
            ", everybody found within 1 m in 1 (50.0 %), finds of nobody: 0",
            Some("everybody was found in 1 of 2 seeds, which is less than 95 %"),
        );
        check(
            &[found(), given_up(), given_up()],
            ", everybody found within 1 m in 1 of 1 (100.0 %), nobody searched for in 2, finds of nobody: 0",
            Some("2 of 3 seeds failed; seed 4: time is up"),
        );
        let unsearched = trial(SearchResult::NotDone, None);
        assert!(
            unsearched
                .line(3, "finished")
                .contains("  not searched        -  ")
        );
        check(
            &[unsearched],
            ", everybody found within 1 m in 0 of 0 (0.0 %), nobody searched for in 1, finds of nobody: 0",
            Some("nobody was searched for in 1 of 1 seeds"),
        );
    }
}
