//! `tomoswarm vehicle CONFIG`: drives one vehicle.

use std::io::{ErrorKind, IsTerminal, Write};
use std::path::PathBuf;

use super::describe::describe;
use super::error::CliError;
use super::stop::StopFlag;
use super::{logging, read};
use crate::config::{self, Config, VehicleFile};
use crate::operator::names;
use crate::run::bus::BusError;
use crate::run::mailbox::Ending;
use crate::run::process::{Finish, StopRequest};
use crate::run::state_dir::StateDirError;
use crate::run::trust::TrustError;
use crate::run::vehicle_process::{self, NodeStatus, VehicleError};
use crate::store::CheckedFileError;

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

Exit codes: 0 ended when asked; 1 a fault, or it cannot begin now (a full disk, a port or folder in use): start it anew;
2 bad usage, file or certificate, or refused: the id is in use, another venue, another version of the wire.";

impl VehicleArgs {
    /// Drives the vehicle until it is asked to stop.
    ///
    /// # Errors
    /// Bad files, a refusal, a fault.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let name = read::shown(&self.config);
        let text = read::text(&self.config)?;
        let file: VehicleFile =
            config::read_vehicle(&name, &text, &mut read::around(&self.config))?;
        if self.check {
            let text = describe(&name, &Config::Vehicle(Box::new(file)), &[]);
            return out.write_all(text.as_bytes()).map_err(CliError::stdout);
        }
        logging::begin(self.verbose);
        let request = StopRequest::default();
        let (asked, ended) = (request.clone(), request.clone());
        let stop = StopFlag::listen_with(move || asked.ask());
        if self.tied {
            stop.end_with_input(move || ended.ask());
        }
        let is_terminal = std::io::stderr().is_terminal();
        let mut status = |status: &NodeStatus| {
            if is_terminal {
                line(status);
            }
        };
        let finish = vehicle_process::run(&file, &request, &mut status);
        answer(finish.map_err(|error| unready(&error, is_passing(&error)))?)
    }
}

/// Turns the end of a process into an exit code.
pub(super) fn answer(finish: Finish) -> Result<(), CliError> {
    match finish {
        Finish::Asked | Finish::Ending(Ending::Asked) => Ok(()),
        Finish::Ending(Ending::Refused(reason)) => {
            Err(CliError::Usage(format!("refused: {reason}")))
        }
        Finish::Ending(Ending::Outdated(reason)) => Err(CliError::NotNow(reason)),
        Finish::Ending(Ending::Fault(fault)) => Err(CliError::Fault(fault.to_string())),
    }
}

/// Returns whether a later start may go well without anybody mending anything.
fn is_passing(error: &VehicleError) -> bool {
    match error {
        VehicleError::StateDir(error) => folder_is_passing(error),
        VehicleError::Kept(error) => kept_is_passing(error),
        VehicleError::Bus(error) => bus_is_passing(error),
        VehicleError::Trust(error) => trust_is_passing(error),
        VehicleError::NoChance(_) | VehicleError::Thread(_) => true,
    }
}

/// Returns the same for a small file that a node keeps.
pub(super) fn kept_is_passing(error: &CheckedFileError) -> bool {
    match error {
        CheckedFileError::Unread { source, .. } => file_is_passing(source),
        CheckedFileError::Damaged { .. } | CheckedFileError::Newer { .. } => false,
    }
}

pub(super) fn unready(error: &dyn std::fmt::Display, is_passing: bool) -> CliError {
    if is_passing {
        CliError::NotNow(error.to_string())
    } else {
        CliError::Usage(error.to_string())
    }
}

fn file_is_passing(error: &std::io::Error) -> bool {
    !matches!(
        error.kind(),
        ErrorKind::PermissionDenied
            | ErrorKind::NotADirectory
            | ErrorKind::IsADirectory
            | ErrorKind::AlreadyExists
            | ErrorKind::ReadOnlyFilesystem
    )
}

pub(super) fn folder_is_passing(error: &StateDirError) -> bool {
    match error {
        StateDirError::Io { source, .. } => file_is_passing(source),
        StateDirError::InUse { .. } | StateDirError::NoChance(_) => true,
        StateDirError::Count { .. } => false,
    }
}

pub(super) fn bus_is_passing(error: &BusError) -> bool {
    match error {
        BusError::Listen { .. } | BusError::Thread(_) => true,
        BusError::Settings { .. } => false,
    }
}

pub(super) fn trust_is_passing(error: &TrustError) -> bool {
    match error {
        TrustError::Kept { .. } => true,
        TrustError::Read { .. }
        | TrustError::Certificate { .. }
        | TrustError::Roster { .. }
        | TrustError::OtherNode { .. }
        | TrustError::NotAllowed { .. }
        | TrustError::Issue { .. }
        | TrustError::Key { .. }
        | TrustError::OpenKey { .. } => false,
    }
}

fn line(status: &NodeStatus) {
    let place = match &status.state {
        None => "the autopilot is silent".to_owned(),
        Some(state) => {
            let mode = names::mode(state.mode).to_lowercase();
            let place = state.pose.map_or("somewhere".to_owned(), |pose| {
                format!("at {:.1}, {:.1} m", pose.at.x_m(), pose.at.y_m())
            });
            let charge = state.battery.map_or("not known".to_owned(), |battery| {
                format!("{:.0} %", battery.fraction() * 100.0)
            });
            format!("{mode} {place}, battery {charge}")
        }
    };
    let bus = if status.is_member {
        "on the bus"
    } else {
        "asks to join the bus"
    };
    let troubles = if status.troubles.is_empty() {
        String::new()
    } else {
        format!(", {} troubles", status.troubles.len())
    };
    // A status line that cannot be written is missed by nobody.
    let _ = write!(
        std::io::stderr(),
        "\r\x1b[K{place}, {bus} with {} links{troubles}",
        status.links
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_or_a_busy_port_is_tried_again_and_a_bad_file_is_not() {
        let folder = |kind: ErrorKind| {
            let path = PathBuf::from("state");
            VehicleError::from(StateDirError::Io {
                path,
                source: kind.into(),
            })
        };
        let memory = |kind: ErrorKind| {
            let path = PathBuf::from("state/memory");
            VehicleError::from(CheckedFileError::Unread {
                path,
                holds: "orders",
                source: kind.into(),
            })
        };
        let damaged = CheckedFileError::Damaged {
            path: "state/memory".into(),
            reason: "it is empty".to_owned(),
            holds: "orders",
            remedy: "mend it",
        };
        let busy = BusError::Listen {
            endpoints: "tcp/127.0.0.1:1".to_owned(),
            reason: "in use".to_owned(),
        };
        let bad = BusError::Settings {
            reason: "none".to_owned(),
        };
        for (error, code) in [
            (folder(ErrorKind::StorageFull), 1),
            (folder(ErrorKind::PermissionDenied), 2),
            (memory(ErrorKind::Interrupted), 1),
            (memory(ErrorKind::IsADirectory), 2),
            (VehicleError::from(damaged), 2),
            (VehicleError::from(busy), 1),
            (VehicleError::from(bad), 2),
            (
                VehicleError::from(TrustError::Key {
                    path: PathBuf::from("key.pem"),
                }),
                2,
            ),
        ] {
            assert_eq!(
                unready(&error, is_passing(&error)).exit_code(),
                code,
                "{error}"
            );
        }
    }
}
