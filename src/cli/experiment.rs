//! `tomoswarm experiment CONFIG`: runs a grid of simulations on all cores, keeps every finished run, and makes a table.
//!
//! Every cell of the grid is checked before anything is run. Finished runs are appended to a journal, so that a
//! run that was stopped, or killed, goes on where it was. Tables are made of the journal alone: the same files give the
//! same tables, whatever the number of threads and however often it was stopped.

mod grid;
mod journal;
mod row;
mod seen;
mod table;
mod work;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;

use self::grid::ExperimentGrid;
use self::journal::{Header, Journal, JournalMode, RUNS, TABLE};
use self::row::{RowEnd, RunRow, csv};
use super::error::CliError;
use super::folder::OutputFolder;
use super::progress_bar::progress_bar;
use super::report::FAMILY;
use super::sim;
use super::stop::StopFlag;
use crate::config::{Axis, Experiment};

/// Run a grid of simulations on all cores, and make a table of them.
///
/// CONFIG (kind = "experiment") names simulations and what is varied: missions, scenes, safety distances, cell sizes,
/// sizes of the area, sensors, numbers of vehicles, seeds. Every cell of the grid is checked first; when one cannot be
/// run, all that are wrong are listed and nothing is run.
///
/// Finished runs are kept in a journal: Ctrl-C, or a machine that goes down, loses only the runs under way, and the
/// same command goes on. The tables are the same whatever the number of threads.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct ExperimentArgs {
    /// An experiment file; see configs/experiment-thesis.toml
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// Folder for the journal and the tables [default: out/NAME; with --only, which writes a run as `sim` does, out/NAME-run-N]
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Runs at the same time [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub threads: Option<u16>,
    /// Go on with an earlier run, and refuse to begin a new one [default: go on if there is one]
    #[arg(long, conflicts_with = "fresh")]
    pub resume: bool,
    /// Throw away what an earlier run has finished
    #[arg(long)]
    pub fresh: bool,
    /// Simulate only this run of the grid, by its number in runs.csv, and write its folder as `sim` does
    #[arg(long, value_name = "RUN", conflicts_with_all = ["resume", "fresh", "threads"])]
    pub only: Option<usize>,
    /// What the table has a row for
    #[arg(long, value_name = "AXES", value_delimiter = ',', default_values = ["mission", "scene"], value_parser = parse_axis)]
    pub by: Vec<Axis>,
}

const AFTER_HELP: &str = "\
The folder then holds
  runs.csv       a row for every run, in the order of the grid
  table.txt      the table that is printed, a row for every mission and scene, or what --by asks for
  journal.jsonl  the finished runs, in the order in which they ended; from it an experiment goes on

Axes for --by: mission, scene, safety_m (or distance), cell_m, size_m, sensor, vehicles, seed.

Examples:
  tomoswarm experiment configs/experiment-thesis.toml
  tomoswarm experiment configs/experiment-thesis.toml --by mission,safety_m
  tomoswarm experiment configs/experiment-thesis.toml --only 150   one run, with pictures and log
  tomoswarm experiment mine.toml --threads 1 --out mine --fresh

Exit codes: 0 every run of the grid has a row, however it ended; 1 it was stopped before, or the program was at fault; 2
bad usage, files or cells, or a folder that cannot be used. With --only as of `sim`.";

fn parse_axis(word: &str) -> Result<Axis, String> {
    let words = || Axis::ALL.map(Axis::word).join(", ");
    let is_meant = |axis: &Axis| {
        let is_distance = *axis == Axis::Safety && word == "distance";
        axis.word() == word || axis.word().trim_end_matches("_m") == word || is_distance
    };
    Axis::ALL
        .into_iter()
        .find(is_meant)
        .ok_or_else(|| format!("`{word}` is no axis; {} are", words()))
}

impl ExperimentArgs {
    /// Runs what is left of the experiment, and writes the tables.
    ///
    /// # Errors
    /// Bad files or cells, a folder that cannot be used, a fault, or a request to stop.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let grid = ExperimentGrid::load(&self.config)?;
        if let Some(run) = self.only {
            return self.run_only(&grid, run, out);
        }
        grid.check()?;
        let experiment = grid.experiment();
        let folder = self
            .out
            .clone()
            .unwrap_or_else(|| Path::new("out").join(experiment.name()));
        let header = Header::new(grid.hash(), experiment.runs());
        let (mut journal, mut rows) = Journal::open(&folder, &header, self.mode())?;
        let stop = StopFlag::listen();
        let bar = runs_bar(experiment.runs(), rows.len());
        let threads = self.threads.map_or_else(cores, usize::from);
        work::run_rest(&grid, threads, &stop, &mut rows, &mut |row, rows| {
            bar.set_position(rows.len() as u64);
            bar.set_message(message(rows));
            journal.record(row)
        })?;
        bar.finish_and_clear();
        rows.sort_by_key(|row| row.run);
        let text = write_tables(&folder, experiment, &rows, &self.by)?;
        out.write_all(text.as_bytes())
            .and_then(|()| out.flush())
            .map_err(CliError::stdout)?;
        judge(experiment, &rows)
    }

    /// Simulates one run of the grid, with pictures and a log.
    fn run_only(
        &self,
        grid: &ExperimentGrid,
        run: usize,
        out: &mut dyn Write,
    ) -> Result<(), CliError> {
        let experiment = grid.experiment();
        if run >= experiment.runs() {
            let last = experiment.runs() - 1;
            return Err(CliError::Usage(format!(
                "--only {run}: the grid has the runs 0 to {last}"
            )));
        }
        let scenario = grid.scenario(run)?;
        let name = format!("{}-run-{run}", experiment.name());
        let target = self
            .out
            .clone()
            .unwrap_or_else(|| Path::new("out").join(name));
        let (stop, folder) = (StopFlag::listen(), OutputFolder::prepare(&target, FAMILY)?);
        let started = sim::started();
        let outcome = sim::watched(&stop, started, None, |watch| scenario.run(watch))?;
        let output = writeln!(out, "run {run}: {}", experiment.key(run, true));
        output.map_err(CliError::stdout)?;
        let seed = experiment.seed_of(run).unwrap_or(scenario.sim().seed);
        sim::publish(
            folder,
            &scenario,
            &outcome,
            true,
            (seed, started.elapsed()),
            out,
        )
    }

    fn mode(&self) -> JournalMode {
        match (self.fresh, self.resume) {
            (true, _) => JournalMode::Fresh,
            (false, true) => JournalMode::Resume,
            (false, false) => JournalMode::Any,
        }
    }
}

/// Checks all cells of an experiment's grid, and runs nothing.
///
/// # Errors
/// Everything that is wrong, and where.
pub(super) fn check(config: &Path, text: &str) -> Result<(), CliError> {
    ExperimentGrid::read(config, text.to_owned())?.check()
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn message(rows: &[RunRow]) -> String {
    let count = |is: fn(&RunRow) -> bool| rows.iter().filter(|row| is(row)).count();
    let (failed, collided) = (
        count(|row| row.end != RowEnd::Finished),
        count(|row| row.collisions > 0),
    );
    format!("{failed} did not finish, {collided} collided")
}

fn runs_bar(runs: usize, done: usize) -> ProgressBar {
    let bar =
        progress_bar("{spinner} {bar:30} {pos}/{len} runs, {elapsed} gone, {eta} left  {msg}");
    bar.set_length(runs as u64);
    bar.set_position(done as u64);
    // Runs of an earlier day say nothing about how long this one takes.
    bar.reset_eta();
    bar
}

fn write_tables(
    folder: &Path,
    experiment: &Experiment,
    rows: &[RunRow],
    by: &[Axis],
) -> Result<String, CliError> {
    let text = table::text(experiment, rows, by);
    write_whole(&folder.join(RUNS), csv(experiment, rows).as_bytes())?;
    write_whole(&folder.join(TABLE), text.as_bytes())?;
    Ok(text)
}

/// Writes a file that is there whole, or as it was.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let partial = path.with_extension("partial");
    let written = fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, path));
    written.map_err(|source| CliError::Write {
        path: path.to_owned(),
        source,
    })
}

fn judge(experiment: &Experiment, rows: &[RunRow]) -> Result<(), CliError> {
    let (done, runs) = (rows.len(), experiment.runs());
    if done < runs {
        return Err(CliError::Stopped(format!(
            "it was asked to stop after {done} of {runs} runs; the same command goes on"
        )));
    }
    match rows.iter().find(|row| row.end == RowEnd::Fault) {
        Some(row) => Err(CliError::Fault(format!(
            "{}: {}",
            experiment.key(row.run, true),
            row.why
        ))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
