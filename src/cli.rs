//! Subcommands as types, one file each; the only layer that touches files and the terminal.
//!
//! [`run`] parses the command line, runs the command, prints what went wrong and gives the exit code: 0 done,
//! 1 fault or mission failed, 2 bad usage, config or scene.

#![cfg_attr(
    all(feature = "vehicle", not(feature = "whole")),
    allow(dead_code, reason = "commands that a build for vehicles leaves out")
)]

#[cfg(feature = "net")]
pub mod accept;
#[cfg(feature = "net")]
mod accept_files;
pub mod check;
#[cfg(feature = "hw")]
mod check_devices;
mod counted;
mod csv;
#[cfg(feature = "dash")]
pub mod dash;
mod describe;
mod earth;
mod earth_files;
#[cfg(feature = "net")]
pub mod enroll;
#[cfg(feature = "net")]
mod enroll_advice;
#[cfg(feature = "net")]
mod enroll_checks;
#[cfg(feature = "net")]
mod enroll_files;
#[cfg(feature = "net")]
mod enroll_pending;
pub mod error;
pub mod experiment;
#[cfg(feature = "net")]
pub mod export;
#[cfg(feature = "net")]
mod export_target;
#[cfg(feature = "net")]
pub mod fix;
mod fixed_network;
#[cfg(feature = "net")]
mod flight;
mod folder;
mod frame;
#[cfg(feature = "net")]
pub mod ground;
pub mod image;
mod image_checks;
mod image_settings;
mod image_text;
mod image_values;
mod imaging_comments;
mod keyed_samples;
mod link_pictures;
#[cfg(feature = "net")]
mod live;
mod load;
#[cfg(feature = "net")]
mod logging;
#[cfg(feature = "whole")]
mod manual;
#[cfg(feature = "net")]
pub mod mock_autopilot;
mod network_recording;
#[cfg(feature = "net")]
mod operator;
#[cfg(feature = "net")]
pub mod order;
mod outputs;
#[cfg(feature = "dash")]
mod page_process;
#[cfg(feature = "net")]
pub mod parameters;
mod person_checks;
mod person_search;
mod pictures;
pub mod plan;
#[cfg(feature = "net")]
pub mod preflight;
pub mod preflight_text;
mod progress;
mod progress_bar;
#[cfg(feature = "dash")]
mod qr_text;
mod read;
mod recorded;
pub mod recording;
mod reference;
#[cfg(feature = "net")]
pub mod replay;
mod report;
mod samples_csv;
mod scenario_warnings;
pub mod scene;
mod scene_pictures;
mod scene_text;
mod screen;
#[cfg(feature = "net")]
mod shown_swarm;
pub mod sim;
#[cfg(feature = "dash")]
mod sim_page;
mod standard_output;
#[cfg(any(feature = "whole", not(feature = "vehicle")))]
mod station_command;
#[cfg(feature = "net")]
pub mod status;
pub mod status_text;
mod stop;
#[cfg(feature = "net")]
mod stored_run;
#[cfg(feature = "net")]
mod swarm_folder;
mod table;
#[cfg(feature = "net")]
pub mod tap;
mod tracks;
mod trials;
mod true_places;
#[cfg(feature = "net")]
pub mod vehicle;
mod volume;
mod volume_links;
mod watch;
mod whole_build;
#[cfg(feature = "net")]
pub mod world;
#[cfg(feature = "hw")]
pub mod xbee;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use self::error::CliError;
use self::standard_output::{StandardOutput, complain};
use crate::exchange::software::SOFTWARE;

/// Turns a few small rovers into one moving radio-tomography instrument.
///
/// Rovers drive around an area, measure radio signal strength between them, avoid what their range sensors see, and a
/// ground station turns the attenuations into a picture of what stands inside.
#[derive(Parser, Debug)]
#[command(name = "tomoswarm", version = SOFTWARE, after_help = after_help())]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "Begin with:
  tomoswarm sim                                  two rovers find two persons in the bundled courtyard
  tomoswarm image out/courtyard-1/links.csv --empty out/courtyard-1/empty.csv --png again.png
  tomoswarm check configs/courtyard.sim.toml     what a file says, or everything that is wrong with it

Exit codes: 0 done; 1 a fault, or the mission failed; 2 bad usage, configuration, scene or recording.";

fn after_help() -> String {
    match whole_build::note() {
        None => AFTER_HELP.to_owned(),
        Some(note) if cfg!(feature = "vehicle") => note,
        Some(note) => format!("{AFTER_HELP}\n\n{note}"),
    }
}

#[derive(Subcommand, Debug)]
enum Command {
    #[cfg(any(feature = "whole", not(feature = "vehicle")))]
    #[command(flatten)]
    Station(Box<station_command::StationCommand>),
    Check(check::CheckArgs),
    #[cfg(feature = "net")]
    Vehicle(vehicle::VehicleArgs),
    #[cfg(feature = "net")]
    Accept(accept::AcceptArgs),
    #[cfg(feature = "net")]
    Parameters(parameters::ParametersArgs),
    #[cfg(feature = "hw")]
    Xbee(xbee::XbeeArgs),
    #[cfg(feature = "whole")]
    #[command(flatten)]
    Manual(manual::ManualCommand),
}

/// Runs the program as the command line says, and returns its exit code.
pub fn run() -> ExitCode {
    let command = match Cli::try_parse() {
        Ok(cli) => cli.command,
        Err(error) => {
            let line: Vec<String> = std::env::args_os()
                .map(|word| word.to_string_lossy().into_owned())
                .collect();
            if let Some(text) = whole_build::explain(&error, &line) {
                return fail(&CliError::Usage(text));
            }
            // Nothing can be done when even the message cannot be printed.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let mut answer = StandardOutput::on_stdout();
    let result = match command {
        #[cfg(any(feature = "whole", not(feature = "vehicle")))]
        Command::Station(station) => station.run(&mut answer),
        Command::Check(check) => check.run(&mut answer),
        #[cfg(feature = "net")]
        Command::Vehicle(vehicle) => vehicle.run(&mut answer),
        #[cfg(feature = "net")]
        Command::Accept(accept) => accept.run(&mut answer),
        #[cfg(feature = "net")]
        Command::Parameters(parameters) => parameters.run(&mut answer),
        #[cfg(feature = "hw")]
        Command::Xbee(xbee) => xbee.run(&mut answer),
        #[cfg(feature = "whole")]
        Command::Manual(manual) => manual.run(&mut answer),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error),
    }
}

fn fail(error: &CliError) -> ExitCode {
    complain(error);
    ExitCode::from(error.exit_code())
}
