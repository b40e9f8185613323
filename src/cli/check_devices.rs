//! `tomoswarm check --devices FILE`: asks every device of a vehicle once, before the vehicle is started.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::error::CliError;
use super::read;
use crate::config::{self, Config, VehicleFile};
use crate::run::device_check::{DeviceCheck, DeviceFound};

/// What `check` does with devices.
#[derive(clap::Args, Debug, Default)]
pub(super) struct DeviceArgs {
    /// Open every device of a vehicle's file and ask it once: the autopilot for a heartbeat, each range sensor for an echo,
    /// the radio for its registers; the vehicle must not be running
    #[arg(long)]
    pub(super) devices: bool,
    /// Swing the servo once, from one end to the other and back
    #[arg(long = "move", requires = "devices")]
    pub(super) moves: bool,
    /// Record what the echo lines of ultrasonic sensors do, in new files of this folder
    #[arg(long, requires = "devices", value_name = "FOLDER")]
    pub(super) record_edges: Option<PathBuf>,
}

impl DeviceArgs {
    /// Asks the devices of one file; prints what each answers.
    ///
    /// # Errors
    /// The file is wrong or no vehicle's, or devices do not answer: each in a line.
    pub(super) fn run(&self, path: &Path, out: &mut dyn Write) -> Result<(), CliError> {
        let file = vehicle(path)?;
        let wrong_input = |reason: String| CliError::Input {
            path: path.to_owned(),
            reason,
        };
        let check = DeviceCheck {
            moves: self.moves,
            record_edges: self.record_edges.clone(),
        };
        let (mut wrong, mut unwritten) = (Vec::new(), None);
        let mut found = |DeviceFound { device, answer }: DeviceFound| match answer {
            Ok(answer) => {
                let written = writeln!(out, "{device}: {answer}").and_then(|()| out.flush());
                unwritten = written.err().or(unwritten.take());
            }
            Err(why) => wrong.push(wrong_input(format!("{device}: {why}"))),
        };
        check
            .run(&file, &mut found)
            .map_err(|error| wrong_input(error.to_string()))?;
        match (unwritten, wrong.is_empty()) {
            (Some(error), _) => Err(CliError::stdout(error)),
            (None, true) => Ok(()),
            (None, false) => Err(CliError::Several(wrong)),
        }
    }
}

fn vehicle(path: &Path) -> Result<VehicleFile, CliError> {
    let text = read::text(path)?;
    match config::read(&read::shown(path), &text, &mut read::around(path))? {
        Config::Vehicle(file) => Ok(*file),
        _ => Err(CliError::Input {
            path: path.to_owned(),
            reason: "is of another kind; kind = \"vehicle\" is needed with --devices".to_owned(),
        }),
    }
}
