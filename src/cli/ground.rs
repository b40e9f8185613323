//! `tomoswarm ground CONFIG`: the ground station.

use std::io::{IsTerminal, Write};
#[cfg(feature = "dash")]
use std::path::Path;
use std::path::PathBuf;

use super::describe::{Line, describe};
use super::error::CliError;
#[cfg(feature = "dash")]
use super::operator::OperatorContext;
#[cfg(feature = "dash")]
use super::page_process::{PageFiles, PersistentPage};
use super::shown_swarm::ShownSwarm;
use super::stop::StopFlag;
use super::vehicle::{
    answer, bus_is_passing, folder_is_passing, kept_is_passing, trust_is_passing, unready,
};
use super::{logging, read};
use crate::config::{self, Config, GroundFile};
use crate::operator::names;
use crate::run::ground_process::{self, GroundError, GroundFiles, GroundStatus};
use crate::run::process::StopRequest;
use crate::store::StoreError;

/// Run the ground station: it gathers the data, plans the sweeps, and makes the images.
///
/// CONFIG is a file of kind "ground" (see configs/README.md; `tomoswarm enroll` writes one with certificates). Everything
/// is kept in its state_dir: after a crash it goes on with the run where it was. A sweep begins when `tomoswarm order
/// CONFIG start --run N` starts the vehicles. `tomoswarm export` takes the data out. Logs go to standard error.
///
/// Ctrl-C or SIGTERM ends it in order; vehicles go on with the plans they have, and keep what they measure.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct GroundArgs {
    /// The ground station's file
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// Show the swarm to ground stations of MAVLink (QGroundControl, MAVProxy), as the table [mavlink] of this operator's
    /// file says
    #[arg(long, value_name = "OPERATOR_FILE")]
    pub mavlink: Option<PathBuf>,
    /// Serve the operator's page as well, with this operator's file: a process of its own, as `tomoswarm dash OPERATOR_FILE`
    #[cfg(feature = "dash")]
    #[arg(long, value_name = "OPERATOR_FILE")]
    pub dash: Option<PathBuf>,
    /// The port of the page of --dash; 0 = any that is free [default: 8377]
    #[cfg(feature = "dash")]
    #[arg(long, value_name = "PORT", requires = "dash")]
    pub port: Option<u16>,
    /// Only print what would be started
    #[arg(long)]
    pub check: bool,
    /// Displace a ground station that gives orders already
    #[arg(long)]
    pub take_over: bool,
    /// Log more
    #[arg(long)]
    pub verbose: bool,
    /// End when standard input ends
    #[arg(long, hide = true)]
    pub tied: bool,
}

const AFTER_HELP: &str = "\
Examples:
  tomoswarm ground ground.toml --check         what would be started, or everything that is wrong
  tomoswarm ground ground.toml                 run it
  tomoswarm preflight ground.toml              is everybody there and ready?
  tomoswarm order ground.toml start --run 1    begin the sweep named 1
  tomoswarm ground ground.toml --mavlink operator.toml        QGroundControl shows the swarm
  tomoswarm ground ground.toml --dash operator.toml           a browser shows it; without the ground station, too

Ctrl-C ends the page of --dash as well; whatever else ends the ground station leaves it, since it can stop the vehicles.
A page that cannot begin (one that is left has its port) is no reason not to begin: it is warned of and tried again.

Exit codes: 0 ended when asked; 1 a fault, or it cannot begin now (a full disk, a port or store in use): start it anew;
2 bad usage, file, certificate or store, or refused: another venue, another version of the wire.";

impl GroundArgs {
    /// Runs the ground station until it is asked to stop.
    ///
    /// # Errors
    /// Bad files, a store that cannot be used, a refusal, a fault.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let name = read::shown(&self.config);
        let text = read::text(&self.config)?;
        let mut venue_text = String::new();
        let mut around = read::around(&self.config);
        // The only file that a ground station's file names is its venue.
        let mut loader = |file: &str| {
            let text = around(file)?;
            venue_text.clone_from(&text);
            Ok(text)
        };
        let mut file: GroundFile = config::read_ground(&name, &text, &mut loader)?;
        file.take_over |= self.take_over;
        let shown = self.mavlink.as_deref().map(ShownSwarm::read).transpose()?;
        #[cfg(feature = "dash")]
        self.dash
            .as_deref()
            .map(OperatorContext::read)
            .transpose()?;
        if self.check {
            let further: Vec<Line> = shown.iter().map(ShownSwarm::line).collect();
            let text = describe(&name, &Config::Ground(Box::new(file)), &further);
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
        let mut status = |status: &GroundStatus| {
            if is_terminal {
                line(status);
            }
        };
        let mavlink = shown.map(ShownSwarm::start).transpose()?;
        let files = GroundFiles {
            file: &file,
            text: &text,
            venue_text: &venue_text,
        };
        #[cfg(feature = "dash")]
        let store = Path::new(&file.state_dir).join(ground_process::STORE);
        #[cfg(feature = "dash")]
        let page = self.start_page(&store, out)?;
        let finish = ground_process::run(files, mavlink.as_ref(), &request, &mut status);
        #[cfg(feature = "dash")]
        if let Some(page) = page {
            match &finish {
                Ok(_) => page.leave(),
                Err(_) => page.end(),
            }
        }
        answer(finish.map_err(|error| unready(&error, is_passing(&error)))?)
    }
}

#[cfg(feature = "dash")]
impl GroundArgs {
    /// Starts the page, if it is wanted. One that cannot begin is tried again: the ground station goes on without it.
    fn start_page(
        &self,
        store: &Path,
        out: &mut dyn Write,
    ) -> Result<Option<PersistentPage>, CliError> {
        let start = |file: &PathBuf| {
            let files = PageFiles {
                operator_file: file.clone(),
                store: store.to_owned(),
                port: self.port,
            };
            PersistentPage::start(files, out)
        };
        self.dash.as_ref().map(start).transpose()
    }
}

/// Returns whether a later start may go well without anybody mending anything.
fn is_passing(error: &GroundError) -> bool {
    match error {
        GroundError::StateDir(error) => folder_is_passing(error),
        GroundError::Store(error) => match error {
            StoreError::Full { .. } | StoreError::InUse { .. } | StoreError::Database { .. } => {
                true
            }
            StoreError::ReadOnly { .. }
            | StoreError::Unopened { .. }
            | StoreError::Damaged { .. }
            | StoreError::NoStore { .. }
            | StoreError::Newer { .. }
            | StoreError::OtherVenue { .. } => false,
        },
        GroundError::Bus(error) => bus_is_passing(error),
        GroundError::Trust(error) => trust_is_passing(error),
        GroundError::Kept(error) => kept_is_passing(error),
        GroundError::Parts(_) => false,
        GroundError::NoChance(_) | GroundError::Thread(_) => true,
    }
}

fn line(status: &GroundStatus) {
    let doing = status
        .report
        .as_ref()
        .map_or("listens".to_owned(), |report| {
            let phase = names::phase(report.phase);
            let laps = names::laps(report.laps_done, report.laps);
            format!(
                "{phase}, run {}, {laps}, {} samples",
                report.run, report.samples
            )
        });
    let troubles = if status.troubles.is_empty() {
        String::new()
    } else {
        format!(", {} troubles", status.troubles.len())
    };
    // A status line that cannot be written is missed by nobody.
    let _ = write!(
        std::io::stderr(),
        "\r\x1b[K{doing}, {} links{troubles}",
        status.links
    );
}
