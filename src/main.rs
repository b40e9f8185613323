//! The `tomoswarm` command.

<<<<<<< HEAD
fn main() -> std::process::ExitCode {
    tomoswarm::cli::run()
=======
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tomoswarm::cli::image::ImageCommand;

/// A few small rovers as one moving radio-tomography instrument.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Image(ImageCommand),
}

fn main() -> ExitCode {
    let Command::Image(command) = Arguments::parse().command;
    match command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
>>>>>>> w-tomo
}
