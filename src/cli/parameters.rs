//! `tomoswarm parameters CONFIG`: the parameters of a vehicle's autopilot, read and set.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::error::CliError;
use super::read;
use crate::config::{self, AutopilotDriver, MavlinkConnection, VehicleFile};
use crate::mavlink::parameter_list::Parameter;
use crate::mavlink::parameter_visit::{ChangedParameter, VisitEnd};
use crate::run::drivers::autopilot::parameters::visit;

/// Read and set the parameters of a vehicle's autopilot.
///
/// CONFIG is the vehicle's own file; its autopilot is reached as the vehicle reaches it, so a serial port must be free. Prints
/// lines NAME,VALUE as Mission Planner and MAVProxy read them. What is set is said to the autopilot, and what it answers is
/// shown: NAME,VALUE and what it was.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct ParametersArgs {
    /// The vehicle's file
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// Print only these; FS_* are all that begin with FS_ [default: all, or none when some are set]
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
    /// Give a parameter a value, such as FS_GCS_ENABLE=1
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = parse_parameter)]
    pub changes: Vec<(String, f32)>,
    /// Give those in a file their values: lines NAME,VALUE or NAME VALUE; what follows a # is no matter
    #[arg(long, value_name = "FILE")]
    pub set_from: Option<PathBuf>,
}

const AFTER_HELP: &str = "\
Examples:
  tomoswarm parameters vehicle-3.toml > before.param
  tomoswarm parameters vehicle-3.toml 'FS_*' 'FENCE_*'
  tomoswarm parameters vehicle-3.toml --set FS_GCS_ENABLE=1 --set FS_GCS_TIMEOUT=3
  tomoswarm parameters vehicle-3.toml --set-from before.param

Exit codes: 0 done; 1 the autopilot cannot be reached, or has kept another value; 2 bad usage, file or name.";

/// Reads NAME=VALUE.
///
/// # Errors
/// It is something else.
pub(super) fn parse_parameter(text: &str) -> Result<(String, f32), String> {
    let parsed = text
        .split_once('=')
        .and_then(|(name, value)| parameter(name, value));
    parsed.ok_or_else(|| "expected NAME=VALUE, such as FS_GCS_ENABLE=1".to_owned())
}

fn parameter(name: &str, value: &str) -> Option<(String, f32)> {
    let value: f32 = value.trim().parse().ok()?;
    (!name.trim().is_empty() && value.is_finite()).then(|| (name.trim().to_owned(), value))
}

impl ParametersArgs {
    /// Reads, sets and prints.
    ///
    /// # Errors
    /// A bad file or name, an autopilot that cannot be reached, or one that keeps another value.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let (connection, state_dir) = self.connection()?;
        let end = visit(&connection, Path::new(&state_dir), self.all_changes()?)
            .map_err(|error| CliError::Swarm(error.to_string()))?;
        let system = connection.system;
        let why = match end {
            VisitEnd::Done {
                parameters,
                changed,
            } => return self.show(&parameters, &changed, out),
            VisitEnd::Unknown(names) => {
                let names = names.join(", ");
                return Err(CliError::Usage(format!(
                    "system {system} has no parameter {names}; nothing was set"
                )));
            }
            VisitEnd::NeverHeard { others } if others.is_empty() => {
                format!("system {system} was not heard, nor was anybody else")
            }
            VisitEnd::NeverHeard { others } => {
                format!("system {system} was not heard, but these were: {others:?}")
            }
            VisitEnd::Silent => format!("system {system} does not tell its parameters"),
            VisitEnd::Firmware { found } => format!(
                "the firmware of system {system} is no ArduPilot (MAV_AUTOPILOT {found}): its values are not understood"
            ),
        };
        let endpoint = connection.endpoint.in_words();
        Err(CliError::Swarm(format!("{endpoint}: {why}")))
    }

    /// Returns how the autopilot is reached, and the folder of what the vehicle keeps.
    fn connection(&self) -> Result<(MavlinkConnection, String), CliError> {
        let text = read::text(&self.config)?;
        let name = read::shown(&self.config);
        let file: VehicleFile =
            config::read_vehicle(&name, &text, &mut read::around(&self.config))?;
        match file.drivers.autopilot {
            AutopilotDriver::Mavlink(connection) => Ok((*connection, file.state_dir)),
            AutopilotDriver::Simulated => Err(CliError::Input {
                path: self.config.clone(),
                reason: "a simulated autopilot has no parameters; expected [autopilot] driver = \"mavlink\"".to_owned(),
            }),
        }
    }

    /// Returns what is to be set; what is said on the command line is above what is in the file.
    fn all_changes(&self) -> Result<Vec<(String, f32)>, CliError> {
        let mut changes = BTreeMap::new();
        if let Some(path) = &self.set_from {
            for (index, line) in read::text(path)?.lines().enumerate() {
                let line = line.split('#').next().unwrap_or_default().trim();
                if line.is_empty() {
                    continue;
                }
                let parts = line.split_once([',', ' ', '\t']);
                let (name, value) = parts
                    .and_then(|(name, value)| parameter(name, value))
                    .ok_or_else(|| CliError::Line {
                        path: path.clone(),
                        line: index + 1,
                        reason: format!("is {line:?}; expected NAME,VALUE"),
                    })?;
                changes.insert(name, value);
            }
        }
        changes.extend(self.changes.iter().cloned());
        Ok(changes.into_iter().collect())
    }

    fn show(
        &self,
        parameters: &[Parameter],
        changed: &[ChangedParameter],
        out: &mut dyn Write,
    ) -> Result<(), CliError> {
        let (mut text, mut unlike) = (String::new(), Vec::new());
        for one in changed {
            let ChangedParameter {
                name, was, asked, ..
            } = one;
            match one.is {
                Some(is) if is == *asked => {
                    // Writing to a string cannot fail.
                    let _ = writeln!(text, "{name},{is} # was {was}");
                }
                Some(is) => unlike.push(format!("{name} is {is}, not {asked}")),
                None => unlike.push(format!("{name}: no answer")),
            }
        }
        let prints_all =
            self.names.is_empty() && self.changes.is_empty() && self.set_from.is_none();
        for parameter in parameters {
            if prints_all
                || self
                    .names
                    .iter()
                    .any(|name| is_named(&parameter.name, name))
            {
                let _ = writeln!(text, "{},{}", parameter.name, parameter.value);
            }
        }
        out.write_all(text.as_bytes()).map_err(CliError::stdout)?;
        if !unlike.is_empty() {
            let unlike = unlike.join("; ");
            return Err(CliError::Swarm(format!(
                "the autopilot has not set all: {unlike}"
            )));
        }
        let is_missing = |name: &&String| !parameters.iter().any(|one| is_named(&one.name, name));
        match self.names.iter().find(is_missing) {
            Some(name) => Err(CliError::Usage(format!("it has no parameter {name}"))),
            None => Ok(()),
        }
    }
}

fn is_named(name: &str, pattern: &str) -> bool {
    match pattern.strip_suffix('*') {
        Some(beginning) => name.starts_with(beginning),
        None => name == pattern,
    }
}
