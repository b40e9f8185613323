//! `tomoswarm dash CONFIG`: the operator's page, for a browser on this machine.

use std::io::{IsTerminal, Write};
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::CliError;
use super::export_target::StoreFiles;
use super::logging;
use super::operator::{OperatorContext, fault};
use super::qr_text::qr_text;
use super::read;
use super::replay::recordings;
use super::standard_output::{StandardOutput, complain};
use super::stop::StopFlag;
use crate::config::{self, Config, Venue};
use crate::dash::ghost::Ghost;
use crate::run::dash::{DashError, Dashboard, PageAddress, PageCertificate, RecordedPage};
use crate::store::recording::{RecordedRun, what_was_said};

/// The port of the page unless another one is asked for.
pub(super) const PAGE_PORT: u16 = 8377;

/// Show the swarm in a browser, and order from there.
///
/// Joins the bus as an operator and serves a page on this machine alone (127.0.0.1), with --listen to other machines by
/// TLS. Two links are printed: with one a page may look, with the other it may order as well. Without certificates a
/// browser on another machine reaches the page through a tunnel that ends here (ssh -L). Ending this command stops nobody.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct DashArgs {
    /// A file of kind "operator", or the ground station's own file; with certificates only the operator's (`tomoswarm enroll`)
    #[arg(value_name = "CONFIG", required_unless_present = "replay")]
    pub config: Option<PathBuf>,
    /// Show flight recordings in place of a swarm: a recording (.mcap), or a folder with those of all nodes of one run
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["config", "files"])]
    pub replay: Option<PathBuf>,
    /// Show the vehicles of another recorded run of the same venue beside this one, faintly: both from their first start on
    #[arg(long, value_name = "FOLDER", requires = "replay")]
    pub ghost: Option<PathBuf>,
    /// Serve other machines as well: an address of this one, or 0.0.0.0 for all of them, by TLS with the operator's
    /// certificate; without one it is refused [default: 127.0.0.1, this machine alone, without TLS]
    #[arg(long, value_name = "ADDRESS", conflicts_with = "replay")]
    pub listen: Option<IpAddr>,
    /// Also print both links as QR codes, for the camera of a phone [default: with --listen, on a terminal]
    #[arg(long, conflicts_with = "replay")]
    pub qr: bool,
    /// The port of the page; 0 = any that is free
    #[arg(long, value_name = "PORT", default_value_t = PAGE_PORT)]
    pub port: u16,
    /// The ground station's store on this machine (state_dir/ground.sqlite), of which pages save runs, as `tomoswarm export`
    /// does; `ground --dash` names its own [default: pages save what this program has heard]
    #[arg(long, value_name = "STORE", conflicts_with = "replay")]
    pub store: Option<PathBuf>,
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
  tomoswarm dash operator.toml --store ground.sqlite  beside the ground station's store: pages save whole runs
  tomoswarm dash --replay run/flight                  a recording: of each node what it said, at any moment and speed
  tomoswarm dash --replay run/flight --ghost earlier/flight       the same, with another run's vehicles beside it, faintly
  tomoswarm dash operator.toml --listen 0.0.0.0       for a tablet: its browser must be given the swarm's ca.pem
  ssh -L 8377:127.0.0.1:8377 ground                   the page of a ground station's machine, from elsewhere

Exit codes: 0 ended by Ctrl-C; 1 the bus cannot be joined, or a fault; 2 bad usage or configuration, a recording that cannot
be shown, or the port is in use.";

impl DashArgs {
    /// Serves until it shall end.
    ///
    /// # Errors
    /// A bad file, a bus that cannot be joined, a port that is in use.
    pub(super) fn run(&self, out: &mut StandardOutput) -> Result<(), CliError> {
        logging::begin(false);
        if let Some(folder) = &self.files {
            // What is no folder of the page, or may not be read, would be a page that is not there.
            read::text(&folder.join("index.html"))?;
        }
        if let Some(folder) = &self.replay {
            return self.replay(folder, out);
        }
        let Some(config) = &self.config else {
            return Err(CliError::Usage("CONFIG or --replay is expected".to_owned()));
        };
        let context = OperatorContext::read(config)?;
        let mut at = PageAddress::on_this_machine(self.port);
        at.address = self.listen.unwrap_or(at.address);
        at.certificate = context
            .settings
            .trust
            .as_ref()
            .map(|trust| PageCertificate {
                certificate: trust.certificate.clone(),
                key: trust.key.clone(),
                authority: trust.ca.clone(),
            });
        at.check().map_err(refused)?;
        let stop = StopFlag::listen();
        let operator = context.open()?;
        let started = Dashboard::start(operator, &context.venue, &at, self.files.clone());
        let mut dashboard = started.map_err(refused)?;
        if let Some(store) = &self.store {
            if !store.is_file() {
                let path = store.display();
                complain(&format_args!(
                    "warning: --store {path}: there is no such file yet; runs cannot be saved until it is there"
                ));
            }
            dashboard.set_store(Arc::new(StoreFiles::of(store)));
        }
        let [look, operate] = dashboard.links();
        let mut text = format!("to look     {look}\nto operate  {operate}\n");
        if self.shows_codes(at.address) {
            text += &codes(look, operate);
        }
        out.write_all(text.as_bytes())
            .and_then(|()| out.flush())
            .map_err(CliError::stdout)?;
        dashboard.run(|| stop.is_asked()).map_err(fault)
    }

    /// Returns whether the links are shown as codes, too: to phones that can reach them, or when that is asked for.
    fn shows_codes(&self, address: IpAddr) -> bool {
        self.qr || (!address.is_loopback() && std::io::stdout().is_terminal())
    }

    /// Serves a recording until it shall end.
    fn replay(&self, folder: &Path, out: &mut StandardOutput) -> Result<(), CliError> {
        let (venue, run) = recorded(folder)?;
        let ghost = self
            .ghost
            .as_ref()
            .map(|of| ghost(of, &venue))
            .transpose()?;
        let stop = StopFlag::listen();
        let page = RecordedPage::start(&venue, self.port, run.heard, ghost.as_ref());
        let page = page.map_err(refused)?;
        writeln!(out, "to look     {}", page.link())
            .and_then(|()| out.flush())
            .map_err(CliError::stdout)?;
        page.serve(|| stop.is_asked());
        Ok(())
    }
}

/// Returns both links as codes, each with its word.
fn codes(look: &str, operate: &str) -> String {
    let code = |(word, link): (&str, &str)| match qr_text(link) {
        Some(code) => format!("\n{word}\n{code}"),
        None => format!("\n{word}: the link is too long for a code\n"),
    };
    [("to look", look), ("to operate", operate)]
        .map(code)
        .concat()
}

/// Reads the recordings of a run, and the venue that they name.
fn recorded(folder: &Path) -> Result<(Venue, RecordedRun), CliError> {
    let files = recordings(&[folder.to_owned()])?;
    let run = what_was_said(&files).map_err(|error| CliError::Input {
        path: error.path,
        reason: error.reason,
    })?;
    run.notes
        .iter()
        .for_each(|note| complain(&format_args!("note: {note}")));
    if run.venue.is_empty() {
        let reason = match run.heard.is_empty() {
            true => {
                "holds nothing that any node has said: it was cut off soon after its beginning, lacks the part that begins it, or is of an older version"
            }
            false => "says no venue: it was recorded by an older version",
        };
        return Err(unusable(folder, reason.to_owned()));
    }
    let venue = match config::read("venue", &run.venue, &mut |name| Err(name.to_owned())) {
        Ok(Config::Venue(venue)) => venue,
        Ok(_) => return Err(unusable(folder, "says a venue that is none".to_owned())),
        Err(problems) => {
            let reason = format!("says a wrong venue: {problems}");
            return Err(unusable(folder, reason));
        }
    };
    if run.heard.is_empty() {
        let reason = "holds nothing that any node has said";
        return Err(unusable(folder, reason.to_owned()));
    }
    Ok((venue, run))
}

/// Reads the run that is shown beside another one of a venue.
fn ghost(folder: &Path, venue: &Venue) -> Result<Ghost, CliError> {
    let (own, run) = recorded(folder)?;
    if own.hash() != venue.hash() {
        let reason = format!(
            "is of the venue {:?} (or an edition of it), and the run beside which it is to be shown of {:?}: one file is expected",
            own.name, venue.name
        );
        return Err(unusable(folder, reason));
    }
    let nowhere = || unusable(folder, "no vehicle says where it is".to_owned());
    Ghost::of(folder.display().to_string(), &run.heard).ok_or_else(nowhere)
}

fn unusable(folder: &Path, reason: String) -> CliError {
    CliError::Input {
        path: folder.to_owned(),
        reason,
    }
}

/// Returns why there is no page, as an error of a command.
pub(super) fn refused(error: DashError) -> CliError {
    match error {
        DashError::Listen { .. }
        | DashError::NoCertificate(_)
        | DashError::NotNamedElsewhere { .. }
        | DashError::Certificate { .. }
        | DashError::Scenario(_) => CliError::Usage(error.to_string()),
        DashError::Random(_) | DashError::Thread(_) => CliError::Fault(error.to_string()),
    }
}
