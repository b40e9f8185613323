//! `tomoswarm tap CONFIG`: the bus as JSON lines, for those who do not read bincode. Says nothing to anyone.

use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::PossibleValuesParser;
use tomoswarm_proto::VehicleId;

use super::error::CliError;
use super::operator::{OperatorContext, fault, seconds};
use super::standard_output::{StandardOutput, complain};
use super::stop::StopFlag;
use crate::run::tap::{Tapping, kinds};
use crate::time::Time;

/// Between two looks at whether the command shall end.
const LOOK: Duration = Duration::from_millis(100);

/// Write what travels on the bus as JSON lines.
///
/// One object a line: received_s (since the command joined), utc_s (this machine's clock), sender, kind, message. Greetings of
/// nodes of another wire version are told as far as they can be read.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct TapArgs {
    /// A file of kind "operator", or the ground station's own file; with certificates only the operator's (`tomoswarm enroll`)
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// Only this kind; may be given again
    #[arg(long = "kind", value_name = "K", value_parser = PossibleValuesParser::new(kinds()))]
    pub kinds: Vec<String>,
    /// Only from or for this vehicle; may be given again
    #[arg(long = "vehicle", value_name = "N", value_parser = clap::value_parser!(u8).range(1..=250))]
    pub vehicles: Vec<u8>,
    /// End after so many seconds
    #[arg(long = "for", value_name = "S", value_parser = seconds)]
    pub listen: Option<Duration>,
    /// End after so many lines
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,
    /// Write the 1024 cells of each tile; otherwise they are counted
    #[arg(long)]
    pub cells: bool,
}

const AFTER_HELP: &str = "\
Examples:
  tomoswarm tap operator.toml --kind state --vehicle 2
  tomoswarm tap operator.toml --for 60 > minute.jsonl
  tomoswarm tap operator.toml --kind report | jq .message.phase

Exit codes: 0 ended by --for, --count, Ctrl-C or a closed pipe; 1 the bus cannot be joined; 2 bad usage or configuration.";

impl TapArgs {
    /// Listens and writes until it shall end.
    ///
    /// # Errors
    /// A bad file, or lines that cannot be written.
    pub(crate) fn run(&self, out: &mut StandardOutput) -> Result<(), CliError> {
        let context = OperatorContext::read(&self.config)?;
        let tapping = Tapping {
            kinds: self.kinds.iter().cloned().collect(),
            vehicles: self.vehicles.iter().map(|id| VehicleId(*id)).collect(),
            with_cells: self.cells,
        };
        let stop = StopFlag::listen();
        let mut operator = context.open()?;
        let end = self
            .listen
            .map_or(Time::NEVER, |span| operator.now() + span);
        let mut left = self.count.unwrap_or(u64::MAX);
        while !stop.is_asked() && !out.is_closed() && operator.now() < end && left > 0 {
            let mut heard = Vec::new();
            let until = end.min(operator.now() + LOOK);
            operator
                .go_on(until, |at, what| heard.push((at, what.clone())))
                .map_err(fault)?;
            for (at, what) in heard {
                let utc_s = operator.session().utc_s(at);
                let line = tapping.line(at.as_secs_f64(), utc_s, &what);
                let Some(line) = line.filter(|_| left > 0) else {
                    continue;
                };
                left -= 1;
                out.write_all(format!("{line}\n").as_bytes())
                    .map_err(CliError::stdout)?;
            }
            out.flush().map_err(CliError::stdout)?;
        }
        let dropped = operator.session().dropped();
        if dropped > 0 {
            complain(&format!(
                "{dropped} messages came faster than they could be written"
            ));
        }
        operator.close();
        Ok(())
    }
}
