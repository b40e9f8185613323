//! The pages of the manual and the completions of shells, made of the command line itself: what they say is what the program
//! takes. Made by the program when it runs, so that a build for another machine needs none of its own.

use std::io::Write;
use std::path::PathBuf;

use clap::CommandFactory;
use clap_complete::Shell;

use super::error::CliError;

/// Commands for who makes a package.
#[derive(clap::Subcommand, Debug)]
pub(super) enum ManualCommand {
    /// Print what completes commands and options in a shell.
    #[command(hide = true)]
    Completions {
        /// Which shell
        #[arg(value_name = "SHELL", value_enum)]
        shell: Shell,
    },
    /// Write the pages of the manual, one for each command, into a folder.
    #[command(hide = true)]
    Man {
        /// The folder; it must be there
        #[arg(value_name = "FOLDER")]
        folder: PathBuf,
    },
}

impl ManualCommand {
    /// Runs the command.
    ///
    /// # Errors
    /// The folder or standard output cannot be written.
    pub(super) fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let mut command = super::Cli::command();
        match self {
            ManualCommand::Completions { shell } => {
                let mut text = Vec::new();
                clap_complete::generate(*shell, &mut command, "tomoswarm", &mut text);
                out.write_all(&text).map_err(CliError::stdout)
            }
            ManualCommand::Man { folder } => {
                clap_mangen::generate_to(command, folder).map_err(|source| CliError::Write {
                    path: folder.clone(),
                    source,
                })
            }
        }
    }
}
