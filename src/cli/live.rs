//! `tomoswarm sim --live`: the scenario of a simulation in real time, by processes of this program on this machine, with the
//! same output folder. What the swarm is made of and what is played is [`crate::run::live`]'s; here are the folder, the
//! terminal, and the end.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use tomoswarm_proto::{RunId, Sender, VehicleId};

use super::error::CliError;
use super::folder::OutputFolder;
use super::load;
use super::operator::OperatorContext;
#[cfg(feature = "dash")]
use super::page_process::PageProcess;
use super::pictures;
use super::progress_bar::progress_bar;
use super::report::FAMILY;
use super::sim::{SimArgs, default_folder, started};
use super::standard_output::complain;
use super::stop::{STOPPED, StopFlag};
use crate::config::{Expect, Sim, Topology, XBEE_POWERS_DBM, XbeePort};
use crate::geom::Point;
use crate::run::link::WorldControl;
use crate::run::live::files::{LiveAddresses, SCENARIO_OPERATOR};
use crate::run::live::gather;
use crate::run::live::processes::{Dead, Ended, ProcessEvent, Processes, Rank, free_ports};
use crate::run::live::scenario_runner::{RunLog, ScenarioRunner, ScenarioStatus};
use crate::sim::{EMPTY_RUN, RunOutcome, Scenario};
use crate::time::Time;

/// The state is shown this often.
const SHOWN_EVERY: Duration = Duration::from_secs(1);
/// Files of the swarm.
const VENUE: &str = "venue.toml";
const GROUND: &str = "ground.toml";
const OPERATOR: &str = "operator.toml";
/// The ground station's store.
const STORE: &str = "state/ground/ground.sqlite";

/// How the processes are joined.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
pub enum LiveTopology {
    /// Everyone with everyone
    Mesh,
    /// Everyone with the ground station
    Star,
}

/// Runs a scenario live.
///
/// # Errors
/// Bad files, a folder that cannot be written, a mission that failed.
pub(super) fn run(args: &SimArgs, out: &mut dyn Write) -> Result<(), CliError> {
    let loaded = args.loaded()?;
    let scenario = load::scenario(loaded, args.config.as_deref(), args.seed)?;
    if scenario.sim().expect != Expect::Finished {
        let refused =
            "a mission that is to fail (expect) is for virtual time; it cannot be run live";
        return Err(CliError::Usage(refused.to_owned()));
    }
    if args.xbee {
        check_xbees(scenario.sim())?;
    }
    let seed = args.seed.unwrap_or(scenario.sim().seed);
    let target = args
        .out
        .clone()
        .unwrap_or_else(|| default_folder(&scenario, seed));
    let stop = StopFlag::listen();
    let folder = OutputFolder::prepare(&target, FAMILY)?;
    let started = started();
    let live = folder.live()?;
    let mut outcome = {
        let mut swarm = Swarm::start(args, &scenario, seed, &live)?;
        #[cfg(feature = "dash")]
        let page = start_page(args, &live, out)?;
        let file = live.join(OPERATOR);
        writeln!(out, "while it lasts: tomoswarm status {}", file.display())
            .map_err(CliError::stdout)?;
        let failure = swarm.play(&stop, started);
        #[cfg(feature = "dash")]
        page.into_iter().for_each(PageProcess::end);
        swarm.end(&scenario, failure)?
    };
    if !args.no_pictures {
        pictures::add_links(&scenario, &mut outcome);
    }
    args.publish(folder, &scenario, &outcome, (seed, started.elapsed()), out)
}

/// Refuses what XBees cannot do, before anything is written.
///
/// # Errors
/// Slots that are too short for them, and a transmit power that none has.
fn check_xbees(sim: &Sim) -> Result<(), CliError> {
    let (slot_ms, least_ms) = (sim.venue.swarm.slot_ms, XbeePort::default().least_slot_ms());
    if slot_ms < least_ms {
        return Err(CliError::Usage(format!(
            "--xbee: found slots of {slot_ms} ms, expected slot_ms of at least {} in the table [swarm]: beacons take so long",
            least_ms.ceil()
        )));
    }
    let power_dbm = sim.radio.own.power_dbm;
    if !XBEE_POWERS_DBM.contains(&power_dbm) {
        return Err(CliError::Usage(format!(
            "--xbee: found a power of {power_dbm} dBm, expected one that an XBee has: {XBEE_POWERS_DBM:?}"
        )));
    }
    Ok(())
}

/// Serves the operator's page of a swarm, if it is wanted.
#[cfg(feature = "dash")]
fn start_page(
    args: &SimArgs,
    folder: &Path,
    out: &mut dyn Write,
) -> Result<Option<PageProcess>, CliError> {
    let (file, store) = (folder.join(OPERATOR), folder.join(STORE));
    let wanted = args
        .dash
        .then(|| PageProcess::start((&file, &store), args.port, out));
    wanted.transpose()
}

/// A swarm that runs.
struct Swarm {
    processes: Processes,
    scenario_runner: ScenarioRunner,
    store: std::path::PathBuf,
}

impl Swarm {
    /// Writes the files, and starts the processes.
    fn start(
        args: &SimArgs,
        scenario: &Scenario,
        seed: u64,
        folder: &Path,
    ) -> Result<Swarm, CliError> {
        let sim = scenario.sim();
        let fault = |source: std::io::Error| CliError::Fault(source.to_string());
        let mut processes = Processes::new(folder);
        let mut world = own_program("world")?;
        world
            .args(&args.config)
            .args(["--vehicles", &sim.vehicles.count.to_string()]);
        world.args(["--seed", &seed.to_string()]);
        let absolute = std::path::absolute(folder).map_err(fault)?;
        let xbees = args.xbee.then(|| absolute.join("ports"));
        if let Some(folder) = &xbees {
            world.arg("--xbee-pty").arg(folder);
        }
        let (address, token) = processes.start_world(world).map_err(fault)?;
        let mut ports = free_ports(sim.vehicles.count + 1).map_err(fault)?;
        let places = LiveAddresses {
            topology: match args.topology {
                LiveTopology::Mesh => Topology::Mesh,
                LiveTopology::Star => Topology::Star,
            },
            venue: VENUE.to_owned(),
            world: address,
            token: token.clone(),
            ground_port: ports.remove(0),
            vehicle_ports: ports,
            xbees,
        };
        let empty: Option<RunId> = sim.empty_sweep.then_some(EMPTY_RUN);
        write(folder, VENUE, &places.venue(sim))?;
        write(folder, OPERATOR, &places.operator(sim))?;
        write(folder, GROUND, &places.ground(sim, empty))?;
        let mut ground = own_program("ground")?;
        ground.arg(folder.join(GROUND));
        processes
            .start("ground", Rank::Ground, ground)
            .map_err(fault)?;
        for id in sim.vehicle_ids() {
            let name = vehicle_name(id);
            let file = format!("{name}.toml");
            write(folder, &file, &places.vehicle(sim, id))?;
            let mut vehicle = own_program("vehicle")?;
            vehicle.arg(folder.join(file));
            processes
                .start(&name, Rank::Vehicle, vehicle)
                .map_err(fault)?;
        }
        let mut operator = OperatorContext::read(&folder.join(OPERATOR))?;
        operator.settings.node = Sender::Operator(SCENARIO_OPERATOR);
        let operator = operator.open()?;
        let control = WorldControl::connect(address, &token);
        let control = control.map_err(|error| CliError::Swarm(error.to_string()))?;
        let store = folder.join(STORE);
        let scenario_runner = ScenarioRunner::new(scenario, operator, control);
        Ok(Swarm {
            processes,
            scenario_runner,
            store,
        })
    }

    /// Plays the script to its end; returns why it failed, if it did.
    fn play(&mut self, stop: &StopFlag, started: Instant) -> Option<String> {
        let bar = progress_bar("{spinner} {msg}");
        let mut shown = Duration::ZERO;
        let failure = loop {
            match self.scenario_runner.go() {
                ScenarioStatus::On => {}
                ScenarioStatus::Over => break None,
                ScenarioStatus::Failed(reason) => break Some(reason),
            }
            if stop.is_asked() {
                break Some(STOPPED.to_owned());
            }
            let now = started.elapsed();
            let since_start = Time::ZERO + now;
            let news = self.processes.look_after(since_start);
            if let Some(dead) = news
                .into_iter()
                .find_map(|news| self.report_event(news, &bar))
            {
                bar.suspend(|| {
                    complain(&format_args!(
                        "{}: its last lines:\n{}",
                        dead.name, dead.last_words
                    ))
                });
                break Some(dead.to_string());
            }
            if now >= shown {
                shown = now + SHOWN_EVERY;
                bar.set_message(self.scenario_runner.line());
                bar.tick();
            }
        };
        bar.finish_and_clear();
        failure
    }

    /// Returns what has happened to a process; returns one without which the mission has failed.
    fn report_event(&mut self, news: ProcessEvent, bar: &ProgressBar) -> Option<Dead> {
        match news {
            ProcessEvent::Died { dead, again_after } => {
                let again = format!("it is started again in {} s", again_after.as_secs());
                let words = format!("has ended: {}; {again}", dead.how);
                self.scenario_runner.note(&dead.name, &words);
                bar.suspend(|| complain(&format_args!("warning: {} {words}", dead.name)));
                None
            }
            ProcessEvent::Started(name) => {
                self.scenario_runner.note(&name, "is started again");
                None
            }
            ProcessEvent::Dead(dead) => {
                self.scenario_runner.note(
                    &dead.name,
                    &format!("has ended{}: {}", dead.limit(), dead.how),
                );
                Some(dead)
            }
        }
    }

    /// Ends everybody in order, and gathers what is left.
    fn end(self, scenario: &Scenario, failure: Option<String>) -> Result<RunOutcome, CliError> {
        let Swarm {
            mut processes,
            mut scenario_runner,
            store,
        } = self;
        scenario_runner.note("scenario", failure.as_deref().unwrap_or("the end"));
        report_ended(&processes.stop_those(Rank::Vehicle), &mut scenario_runner);
        // The referee has seen everybody come to rest.
        let tracks: Vec<(VehicleId, Vec<Point>)> = scenario_runner.ask_world();
        report_ended(&processes.stop(), &mut scenario_runner);
        let run_log: RunLog = scenario_runner.leave();
        gather::outcome(scenario, &store, run_log, tracks, failure).map_err(|error| match error {
            gather::GatherError::Store(error) => CliError::Store(error),
            gather::GatherError::Scenario(error) => CliError::Usage(error.to_string()),
        })
    }
}

/// Notes who had to be killed.
fn report_ended(ended: &[Ended], scenario_runner: &mut ScenarioRunner) {
    for killed in ended.iter().filter(|ended| ended.was_killed) {
        scenario_runner.note(
            &killed.name,
            "did not end when it was asked to, and was killed",
        );
        complain(&format_args!(
            "warning: {} did not end when it was asked to, and was killed",
            killed.name
        ));
    }
}

fn vehicle_name(id: VehicleId) -> String {
    format!("vehicle-{id}")
}

/// Returns the command that runs a part of this program, which ends when this process is gone.
fn own_program(part: &str) -> Result<Command, CliError> {
    let program = std::env::current_exe()
        .map_err(|error| CliError::Fault(format!("this program cannot be found: {error}")))?;
    let mut command = Command::new(program);
    command.args([part, "--tied"]);
    Ok(command)
}

fn write(folder: &Path, name: &str, text: &str) -> Result<(), CliError> {
    let path = folder.join(name);
    fs::write(&path, text).map_err(|source| CliError::Write { path, source })
}
