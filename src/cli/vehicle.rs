//! `tomoswarm vehicle CONFIG`: drives one vehicle.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;

use super::describe::describe;
use super::error::CliError;
use super::stop::Stop;
use super::{logging, read};
use crate::config::{self, Config, VehicleFile};
use crate::run::desk::Ending;
use crate::run::process::Finish;
use crate::run::vehicle_process::{self, Status};

/// Drive one vehicle: its actors, its drivers, its part of the bus.
///
/// CONFIG is a file of kind "vehicle" (see configs/README.md; `tomoswarm enroll` writes one with certificates). The
/// vehicle stands until the ground station sends a plan and an order starts it. What it measures is kept in its state_dir
/// until the ground has it. Logs go to standard error.
///
/// Ctrl-C or SIGTERM ends it in order: it brakes, writes what it holds, and leaves the bus.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct VehicleArgs {
    /// The vehicle's file
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// Only print what would be started
    #[arg(long)]
    pub check: bool,
    /// Log more
    #[arg(long)]
    pub verbose: bool,
    /// End when standard input ends
    #[arg(long, hide = true)]
    pub tied: bool,
}

const AFTER_HELP: &str = "\
Examples:
  tomoswarm vehicle vehicle-3.toml --check   what would be started, or everything that is wrong
  tomoswarm vehicle vehicle-3.toml           drive; a service manager may do it (deploy/)

Exit codes: 0 ended when asked; 1 a fault, start it anew; 2 bad usage or file, or refused: the id is in use, another
venue, another version of the wire.";

impl VehicleArgs {
    /// Drives the vehicle until it is asked to stop.
    ///
    /// # Errors
    /// Bad files, a refusal, a fault.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let name = read::shown(&self.config);
        let text = read::text(&self.config)?;
        let file: VehicleFile = config::read_vehicle(&name, &text, &mut read::around(&self.config))?;
        if self.check {
            let text = describe(&Config::Vehicle(Box::new(file)));
            return write!(out, "{name}: {text}").map_err(CliError::stdout);
        }
        logging::begin(self.verbose);
        let stop = Stop::listen();
        if self.tied {
            stop.end_with_input(|| {});
        }
        let is_terminal = std::io::stderr().is_terminal();
        let mut status = |status: &Status| {
            if is_terminal {
                line(status);
            }
        };
        let finish = vehicle_process::run(&file, &text, &|| stop.is_asked(), &mut status);
        answer(finish.map_err(|error| CliError::Usage(error.to_string()))?)
    }
}

/// Turns the end of a process into an exit code.
pub(super) fn answer(finish: Finish) -> Result<(), CliError> {
    match finish {
        Finish::Asked => Ok(()),
        Finish::Ending(Ending::Refused(reason)) => Err(CliError::Usage(format!("refused: {reason}"))),
        Finish::Ending(Ending::Fault(fault)) => Err(CliError::Fault(fault.to_string())),
    }
}

fn line(status: &Status) {
    let place = match &status.state {
        None => "the autopilot is silent".to_owned(),
        Some(state) => {
            let at = state.pose.at;
            let mode = format!("{:?}", state.mode).to_lowercase();
            format!("{mode} at {:.1}, {:.1} m, battery {:.0} %", at.x_m, at.y_m, state.battery * 100.0)
        }
    };
    let bus = if status.is_member { "on the bus" } else { "asks to join the bus" };
    let troubles = if status.troubles.is_empty() {
        String::new()
    } else {
        format!(", {} troubles", status.troubles.len())
    };
    // A status line that cannot be written is missed by nobody.
    let _ = write!(std::io::stderr(), "\r\x1b[K{place}, {bus} with {} links{troubles}", status.links);
}
