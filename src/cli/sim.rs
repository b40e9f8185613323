//! `tomoswarm sim [CONFIG]`: simulates a swarm in virtual time, and writes a folder with pictures and data.

#[cfg(feature = "net")]
use std::cell::RefCell;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use super::error::CliError;
#[cfg(feature = "net")]
use super::flight::{Flights, SEGMENT};
use super::folder::OutputFolder;
use super::load::{self, LoadedSimulation};
use super::pictures::write_pictures;
use super::progress_bar::progress_bar;
use super::report::{FAMILY, RunFigures, failure, write_data};
use super::scenario_warnings;
use super::standard_output::complain;
use super::stop::{STOPPED, StopFlag};
use super::trials;
use super::watch::{self, Watching};
use crate::config::{SEEDS, UNTIL_S};
use crate::sim::{RunError, RunOutcome, RunProgress, RunView, Scenario};

/// Simulate a swarm: rovers sweep an area, and the image of what stands in it is drawn.
///
/// Without CONFIG the bundled example runs: two rovers, a courtyard with an L-shaped wall, first empty, then with two
/// persons at places drawn from the seed. Everything happens in virtual time, hundreds of times faster than real time; the
/// same files and seed give the same run, byte for byte. Lengths are metres, x to the east, y to the north.
///
/// A run shows its progress on a terminal. Ctrl-C ends it in order: what was measured until then is written, with
/// "finished": false. Nothing is written by a run that is refused.
#[derive(clap::Args, Debug)]
#[command(after_help = after_help())]
pub struct SimArgs {
    /// A simulation file (kind = "sim"), see configs/courtyard.sim.toml; or a bundled one by name: courtyard, castle, trees, house
    #[arg(value_name = "CONFIG")]
    pub config: Option<PathBuf>,
    /// Seed of everything that is random [default: the file's, or 1]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    pub seed: Option<u64>,
    /// Number of vehicles, 2 to 8 (1 to 8 when they do not sweep), in place of the file's; the venue must have a home for each
    #[arg(short = 'n', long, value_name = "N", allow_negative_numbers = true)]
    pub vehicles: Option<usize>,
    /// Give up after this much virtual time, in place of the file's; the mission has failed then
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_seconds)]
    pub until: Option<Duration>,
    /// Folder for pictures and data; a run in it is replaced, other files stay [default: out/SCENE-SEED]
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Write the data but draw no pictures
    #[arg(long)]
    pub no_pictures: bool,
    /// Record what every actor is told and says, for `tomoswarm replay` and Foxglove: flight/NODE/*.mcap
    #[cfg(feature = "net")]
    #[arg(long, conflicts_with = "trials")]
    pub record: bool,
    /// In real time, by real processes on this machine: a world, a ground station, and each vehicle one
    #[cfg(feature = "net")]
    #[arg(long, conflicts_with_all = ["trials", "record", "watch", "pace"])]
    pub live: bool,
    /// How the processes are joined
    #[cfg(feature = "net")]
    #[arg(
        long,
        value_enum,
        value_name = "SHAPE",
        default_value = "mesh",
        requires = "live"
    )]
    pub topology: super::live::LiveTopology,
    /// With --live: every radio is an XBee at a pseudo-terminal, and what speaks with it is the driver of the field
    #[cfg(feature = "net")]
    #[arg(long, requires = "live")]
    pub xbee: bool,
    /// Write every beacon heard or missed as well: samples.csv, and empty-samples.csv of the empty sweep
    #[arg(long, conflicts_with = "trials")]
    pub samples: bool,
    /// Draw the map and the vehicles in the terminal while the simulation runs
    #[arg(long, group = "shown", conflicts_with = "trials")]
    pub watch: bool,
    /// Serve the operator's page of this simulation on this machine (127.0.0.1), without orders, until Ctrl-C: also after the
    /// run; with --live the page of the swarm, with orders, until the run has ended
    #[cfg(feature = "dash")]
    #[arg(long, group = "shown", conflicts_with_all = ["trials", "watch"])]
    pub dash: bool,
    /// The port of the page of --dash; 0 = any that is free [default: 8377]
    #[cfg(feature = "dash")]
    #[arg(long, value_name = "PORT", requires = "dash")]
    pub port: Option<u16>,
    /// With --watch or --dash: not faster than X times real time [default: as fast as it goes]
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = parse_pace, requires = "shown")]
    pub pace: Option<f64>,
    /// Run this many seeds, beginning with --seed, on all cores; print a table and write no folder
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000_000),
        conflicts_with_all = ["out", "no_pictures"]
    )]
    pub trials: Option<u64>,
}

const FOLDER_AND_EXAMPLES: &str = "\
The folder then holds
  image.png      what changed since the empty sweep: the persons (with the truth, for comparison)
  structure.png  what stands there, from a fitted path loss: the wall
  coverage.png, links.png, residuals.png, deviation.png   what is behind that image: what the links have seen, what each has lost,
                 what the image leaves unexplained of it, and how sure the image is
  map.png        what the range sensors saw, where the vehicles drove, and who stood there
  image.npy, structure.npy   the same values: f32, rows from south to north, columns from west to east, dB/m
  links.csv, empty.csv       every link measured; `tomoswarm image` reads them
  samples.csv, empty-samples.csv   with --samples: every beacon heard or missed; `tomoswarm image` reads them as well
  summary.json   finished (and failure: why not), simulated_s, links, collisions, found [{x_m, y_m, strength, error_m, person}] (null
                 when nobody was searched for; not_searched says why) and more
  track-N.waypoints  where vehicle N drove, as a mission that QGroundControl and [mission] file read
  run.log        what happened when, in virtual time
Without an empty sweep (empty_sweep = true in CONFIG) there is no image.png: nothing to compare with. A find is a person when it is
within 1 m of it and no nearer pair takes either of them; a person left over is missed. Persons are searched in the last image: a
sweep that is given up has searched for nobody, and has missed nobody.
Of an exploration `seen` counts what can be seen from ground to which a vehicle gets for sure, through gaps of the width that it names
(and `tomoswarm check`): twice the safety distance, two deviations of the place and three quarters of a map cell. It is what the
ground station and all vehicles whose software still runs know together, as map.png shows it, whoever is off the bus at the end.

Examples:
  tomoswarm sim --seed 7                        the persons stand elsewhere
  tomoswarm sim --vehicles 4 --out four         four rovers, written to the folder four
  tomoswarm sim --trials 20                     20 seeds, one line each
  tomoswarm sim --watch --pace 20               look on, at 20 times real time
  tomoswarm sim castle                          another bundled place; also trees, house
  tomoswarm sim configs/courtyard.sim.toml      a file of your own: copy it with its venue and scene
  tomoswarm sim configs/explore.sim.toml        four rovers explore a castle: [mission] kind = \"explore\"
";

const DASH_EXAMPLE: &str = "  tomoswarm sim --dash --pace 10                look on in a browser, at 10 times real time, until Ctrl-C
";

const LIVE_EXAMPLES: &str = "  tomoswarm sim configs/small.sim.toml --live   a short scenario in real time, by real processes (about 2 minutes)
  tomoswarm sim --live -n 8 --topology star     eight vehicle processes joined by the ground station
";

const EXIT_CODES: &str = "
A run is given up at until_s (--until), and before that when a vehicle is not home 900 s after the operator has ordered the return
at its end, or when too few vehicles for its task were heard within 900 s; the reason names the limit.

Exit codes: 0 done; 1 a collision, a breach of the fence, a sweep or mission that did not end or was stopped, a sweep that shows
nothing, a vehicle that did not come home, missions of which no vehicle did everything, or in --trials too many persons missed; 2 bad
usage, bad files, or a folder that cannot be written.";

fn after_help() -> String {
    let live = if cfg!(feature = "net") {
        LIVE_EXAMPLES
    } else {
        ""
    };
    let dash = if cfg!(feature = "dash") {
        DASH_EXAMPLE
    } else {
        ""
    };
    format!("{FOLDER_AND_EXAMPLES}{dash}{live}{EXIT_CODES}")
}

fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds: Option<f64> = text.parse().ok();
    let (least_s, most_s) = (UNTIL_S.start(), UNTIL_S.end());
    seconds
        .filter(|seconds| UNTIL_S.contains(seconds))
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("expected a number of seconds from {least_s} to {most_s}"))
}

fn parse_pace(text: &str) -> Result<f64, String> {
    let pace: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if !(0.01..=1e6).contains(&pace) {
        return Err(format!(
            "`{text}` times real time is out of range; 0.01 to 1000000 are allowed"
        ));
    }
    Ok(pace)
}

impl SimArgs {
    /// Runs the simulation.
    ///
    /// # Errors
    /// Bad files, a folder that cannot be written, a mission that failed.
    pub fn run(&self, out: &mut (dyn Write + Send)) -> Result<(), CliError> {
        if let Some(count) = self.trials {
            return trials::run(self, count, &StopFlag::listen(), out);
        }
        #[cfg(feature = "net")]
        if self.live {
            return super::live::run(self, out);
        }
        if self.watch {
            watch::check()?;
        }
        let mut scenario = self.scenario(self.seed)?;
        warn_of_scenario(&scenario)?;
        if self.watch || self.pace.is_some() {
            scenario.shown_every = watch::shown_every(self.pace);
        }
        let seed = self.seed.unwrap_or(scenario.sim().seed);
        let target = self
            .out
            .clone()
            .unwrap_or_else(|| default_folder(&scenario, seed));
        let stop = StopFlag::listen();
        #[cfg(feature = "dash")]
        if self.dash {
            let page = super::sim_page::start(&scenario, self.port, out)?;
            let folder = OutputFolder::prepare(&target, FAMILY)?;
            let started = started();
            let outcome = self.recorded(&scenario, &folder, |flights| {
                let when = (&stop, started);
                super::sim_page::run(&page, &scenario, flights, self.pace, when)
            })?;
            let took = (seed, started.elapsed());
            let published = self.publish(folder, &scenario, &outcome, took, out);
            return super::sim_page::stay(page, &stop, published);
        }
        let folder = OutputFolder::prepare(&target, FAMILY)?;
        let started = started();
        let outcome = self.outcome(&scenario, &folder, &stop, started)?;
        self.publish(folder, &scenario, &outcome, (seed, started.elapsed()), out)
    }

    /// Writes everything that a run leaves behind, and says how it went.
    ///
    /// # Errors
    /// A file cannot be written, or the mission failed.
    pub(super) fn publish(
        &self,
        folder: OutputFolder,
        scenario: &Scenario,
        outcome: &RunOutcome,
        took: (u64, Duration),
        out: &mut dyn Write,
    ) -> Result<(), CliError> {
        publish(folder, scenario, outcome, !self.no_pictures, took, out)
    }

    #[cfg(not(feature = "net"))]
    fn outcome(
        &self,
        scenario: &Scenario,
        _folder: &OutputFolder,
        stop: &StopFlag,
        started: Instant,
    ) -> Result<RunOutcome, CliError> {
        watched(stop, started, self.watching(scenario), |watch| {
            scenario.run(watch)
        })
    }

    /// Runs the scenario, and records it when that is asked for.
    #[cfg(feature = "net")]
    fn outcome(
        &self,
        scenario: &Scenario,
        folder: &OutputFolder,
        stop: &StopFlag,
        started: Instant,
    ) -> Result<RunOutcome, CliError> {
        self.recorded(scenario, folder, |flights| {
            watched(stop, started, self.watching(scenario), |watch| {
                let Some(flights) = flights else {
                    return scenario.run(watch);
                };
                let mut watch =
                    |shown: &RunView<'_>| watch(shown) && !flights.borrow().is_in_trouble();
                scenario.run_recorded(&mut watch, SEGMENT, &mut |entry| {
                    flights.borrow_mut().take(&entry)
                })
            })
        })
    }

    /// Begins a recording when that is asked for, lets `run` fill it, and ends it.
    #[cfg(feature = "net")]
    fn recorded(
        &self,
        scenario: &Scenario,
        folder: &OutputFolder,
        run: impl FnOnce(Option<&RefCell<Flights>>) -> Result<RunOutcome, CliError>,
    ) -> Result<RunOutcome, CliError> {
        if !self.record {
            return run(None);
        }
        let settings = load::text(self.config.as_deref())?;
        let flights = RefCell::new(Flights::new(folder.recordings()?, settings, scenario.sim()));
        let outcome = run(Some(&flights))?;
        flights.into_inner().end()?;
        Ok(outcome)
    }

    /// Begins to draw the run, when that is asked for.
    fn watching<'a>(&self, scenario: &'a Scenario) -> Option<Watching<'a>> {
        self.watch
            .then(|| Watching::begin(&scenario.sim().venue, self.pace))
    }

    /// Loads the files and makes the scenario of a seed.
    ///
    /// # Errors
    /// Everything that is wrong with the files.
    pub(super) fn scenario(&self, seed: Option<u64>) -> Result<Scenario, CliError> {
        let mut scenario = load::scenario(self.loaded()?, self.config.as_deref(), seed)?;
        scenario.keeps_samples = self.samples;
        Ok(scenario)
    }

    /// Loads the files.
    ///
    /// # Errors
    /// Everything that is wrong with them.
    pub(super) fn loaded(&self) -> Result<LoadedSimulation, CliError> {
        let mut loaded: LoadedSimulation = load::load(self.config.as_deref(), self.vehicles)?;
        for warning in &loaded.shapes.warnings {
            complain(&format_args!("warning: {warning}"));
        }
        if let Some(until) = self.until {
            loaded.sim.until_s = until.as_secs_f64();
        }
        Ok(loaded)
    }
}

/// Says what is to be known of a scenario before it is run.
///
/// # Errors
/// The scene cannot be built.
pub(super) fn warn_of_scenario(scenario: &Scenario) -> Result<(), CliError> {
    let warnings = scenario_warnings::warnings(scenario);
    for warning in warnings.map_err(|error| CliError::Usage(error.to_string()))? {
        complain(&format_args!("warning: {warning}"));
    }
    Ok(())
}

/// Writes everything that a run leaves behind, and says how it went.
///
/// # Errors
/// A file cannot be written, or the mission failed.
pub(super) fn publish(
    mut folder: OutputFolder,
    scenario: &Scenario,
    outcome: &RunOutcome,
    with_pictures: bool,
    (seed, wall): (u64, Duration),
    out: &mut dyn Write,
) -> Result<(), CliError> {
    write_data(&mut folder, scenario, outcome)?;
    if with_pictures {
        write_pictures(&mut folder, scenario, outcome)?;
    }
    let report = RunFigures::new(scenario, outcome, seed, wall)
        .map_err(|error| CliError::Fault(error.to_string()))?;
    report.write(&mut folder)?;
    let target = folder.publish()?;
    let kinds = if with_pictures {
        "pictures and data"
    } else {
        "data"
    };
    let text = format!("{}written: {} ({kinds})\n", report.text(), target.display());
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written.map_err(|source| CliError::Write {
        path: "standard output".into(),
        source,
    })?;
    failure(scenario, outcome).map_or(Ok(()), |reason| Err(CliError::of_run(reason)))
}

/// Reads a seed, as the files allow it.
pub(super) fn parse_seed(text: &str) -> Result<u64, String> {
    let seed: Option<u64> = text.parse().ok();
    let (first, last) = (SEEDS.start(), SEEDS.end());
    seed.filter(|seed| SEEDS.contains(seed))
        .ok_or_else(|| format!("expected a whole number from {first} to {last}"))
}

pub(super) fn default_folder(scenario: &Scenario, seed: u64) -> PathBuf {
    Path::new("out").join(format!("{}-{seed}", scenario.sim().scene.name))
}

#[allow(
    clippy::disallowed_methods,
    reason = "the shell measures how long a run took, pictures included; no decision hangs on it"
)]
pub(super) fn started() -> Instant {
    Instant::now()
}

/// Runs with a progress line, or drawn, until it is asked to stop.
///
/// # Errors
/// The scenario is impossible, or the program is at fault.
pub(super) fn watched(
    stop: &StopFlag,
    started: Instant,
    mut watching: Option<Watching<'_>>,
    run: impl FnOnce(&mut dyn FnMut(&RunView<'_>) -> bool) -> Result<RunOutcome, RunError>,
) -> Result<RunOutcome, CliError> {
    let bar = if watching.is_some() {
        ProgressBar::hidden()
    } else {
        progress_bar("{spinner} {bar:30} lap {pos}/{len}  {msg}")
    };
    let mut is_stopped = false;
    let mut watch = |shown: &RunView<'_>| {
        let status = &shown.status;
        match &mut watching {
            Some(watching) => watching.show(shown, stop),
            None => {
                bar.set_length(status.laps.max(1) as u64);
                bar.set_position(status.laps_done as u64);
                bar.set_message(line(status, started.elapsed()));
            }
        }
        is_stopped = stop.is_asked();
        !is_stopped
    };
    let mut outcome = run(&mut watch).map_err(|error| match error {
        RunError::Scenario(error) => CliError::Usage(error.to_string()),
        RunError::Fault(fault) => CliError::Fault(fault.to_string()),
    })?;
    bar.finish_and_clear();
    drop(watching);
    if is_stopped {
        outcome.finished = false;
        outcome.failure = Some(STOPPED.to_owned());
    }
    Ok(outcome)
}

/// How a run gets on, for who watches it: the lap as well, where there are laps.
pub(super) fn progress(status: &RunProgress, wall: Duration) -> String {
    let line = line(status, wall);
    match (status.laps_done, status.laps) {
        (_, 0) => line.trim_start().to_owned(),
        (done, laps) => format!("lap {done}/{laps}  {}", line.trim_start()),
    }
}

fn line(status: &RunProgress, wall: Duration) -> String {
    let simulated_s = status.now.as_secs_f64();
    let factor = simulated_s / wall.as_secs_f64().max(1e-3);
    format!(
        "{:>5.1} min simulated, {} samples, {factor:.0} x real time",
        simulated_s / 60.0,
        status.samples
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Time;

    #[test]
    fn who_watches_a_run_without_laps_reads_of_none() {
        let status = |laps| RunProgress {
            now: Time::from_secs_f64(90.0),
            laps_done: 1,
            laps,
            samples: 7,
        };
        let output = |laps| progress(&status(laps), Duration::from_secs(9));
        assert_eq!(output(0), "1.5 min simulated, 7 samples, 10 x real time");
        assert_eq!(
            output(3),
            "lap 1/3  1.5 min simulated, 7 samples, 10 x real time"
        );
    }
}
