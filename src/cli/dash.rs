//! `tomoswarm dash CONFIG`: the operator's page, for a browser on this machine.

use std::io::Write;
use std::path::PathBuf;

use super::error::CliError;
use super::logging;
use super::operator::{OperatorContext, fault};
use super::standard_output::StandardOutput;
use super::stop::StopFlag;
use crate::run::dash::{DashError, Dashboard};

/// The port of the page unless another one is asked for.
pub(super) const PAGE_PORT: u16 = 8377;

/// Show the swarm in a browser, and order from there.
///
/// Joins the bus as an operator and serves a page on this machine alone (127.0.0.1). Two links are printed: with one a page may
/// look, with the other it may order as well. A browser on another machine reaches the page through a tunnel that ends here
/// (ssh -L). Ending this command stops nobody.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct DashArgs {
    /// A file of kind "operator", or the ground station's own file; with certificates only the operator's (`tomoswarm enroll`)
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// The port of the page; 0 = any that is free
    #[arg(long, value_name = "PORT", default_value_t = PAGE_PORT)]
    pub port: u16,
    /// Serve the files of this folder instead of those that are built in; for whoever works on the page
    #[arg(long, value_name = "FOLDER")]
    pub files: Option<PathBuf>,
}

const AFTER_HELP: &str = "\
The page's Stop is the emergency stop of `tomoswarm order CONFIG emergency`, at once and without a question: it is no emergency
stop device, and works only while this program reaches the vehicles. Hold is `order CONFIG hold`.

GET /metrics answers Prometheus (Authorization: Bearer TOKEN, the token of one of the links; each start has new ones).

Examples:
  tomoswarm dash operator.toml                        then open one of the links
  tomoswarm dash operator.toml --port 0               on any free port
  ssh -L 8377:127.0.0.1:8377 ground                   the page of a ground station's machine, from elsewhere

Exit codes: 0 ended by Ctrl-C; 1 the bus cannot be joined, or a fault; 2 bad usage or configuration, or the port is in use.";

impl DashArgs {
    /// Serves until it shall end.
    ///
    /// # Errors
    /// A bad file, a bus that cannot be joined, a port that is in use.
    pub(super) fn run(&self, out: &mut StandardOutput) -> Result<(), CliError> {
        logging::begin(false);
        if let Some(folder) = self.files.as_ref().filter(|folder| !folder.is_dir()) {
            return Err(CliError::Input {
                path: folder.clone(),
                reason: "is no folder; one with index.html is expected".to_owned(),
            });
        }
        let context = OperatorContext::read(&self.config)?;
        let stop = StopFlag::listen();
        let operator = context.open()?;
        let started = Dashboard::start(operator, &context.venue, self.port, self.files.clone());
        let dashboard = started.map_err(refused)?;
        let [look, operate] = dashboard.links();
        let text = format!("to look     {look}\nto operate  {operate}\n");
        out.write_all(text.as_bytes())
            .and_then(|()| out.flush())
            .map_err(CliError::stdout)?;
        dashboard.run(|| stop.is_asked()).map_err(fault)
    }
}

/// Returns why there is no page, as an error of a command.
pub(super) fn refused(error: DashError) -> CliError {
    match error {
        DashError::Listen { .. } => CliError::Usage(error.to_string()),
        DashError::Random(_) | DashError::Thread(_) => CliError::Fault(error.to_string()),
    }
}
