//! `tomoswarm status CONFIG`: listens for a moment and shows who is there and how they are. Says nothing to anyone.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::error::CliError;
use super::operator::{OperatorContext, fault, seconds};
use super::screen;
use super::standard_output::StandardOutput;
use super::status_text::{json, text};
use super::stop::StopFlag;
use crate::operator::fleet_view::FleetView;
use crate::operator::status::Expected;
use crate::run::live_operator::LiveOperator;
use crate::time::Time;

/// Between two looks at whether the command shall end.
const LOOK: Duration = Duration::from_millis(100);
/// Between two tables.
const WATCH: Duration = Duration::from_secs(1);

/// Show every vehicle and the ground station in one table.
///
/// Listens until everyone expected was heard with all that is said regularly, or the time is up. Expected are the ground
/// station, and the vehicles that the ground's file or its report names.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct StatusArgs {
    /// A file of kind "operator", or the ground station's own file; with certificates only the operator's (`tomoswarm enroll`)
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// Show it again every second, until Ctrl-C
    #[arg(long)]
    pub watch: bool,
    /// One JSON object, with all fields
    #[arg(long)]
    pub json: bool,
    /// Listen for so many seconds at most
    #[arg(long = "for", value_name = "S", default_value = "2.5", value_parser = seconds)]
    pub listen: Duration,
}

const AFTER_HELP: &str = "\
`mission` is what the vehicle is out for, what it does for it now, how much is done or left, and how it has ended; `runs` are the
last runs, and how each ended. `ordered` is the last order obeyed with its lease and revision; `waiting` are samples that the ground has not confirmed;
`hears` is whom it hears by radio; a dash is what was not reported.

Examples:
  tomoswarm status operator.toml                      one look
  tomoswarm status operator.toml --watch              every second
  tomoswarm status operator.toml --json | jq .        for a script

Exit codes: 0 all expected were heard, or --watch was ended by a closed pipe; 1 somebody was not; 2 bad usage or configuration.";

impl StatusArgs {
    /// Listens and shows.
    ///
    /// # Errors
    /// A bad file, or somebody who was not heard.
    pub(crate) fn run(&self, out: &mut StandardOutput) -> Result<(), CliError> {
        let context = OperatorContext::read(&self.config)?;
        let expected = Expected {
            vehicles: context.vehicles.clone(),
            ground: true,
        };
        let stop = StopFlag::listen();
        let mut operator = context.open()?;
        let is_done = |view: &FleetView, now: Time| {
            // Without a list it is only known at the end who is there.
            !expected.vehicles.is_empty()
                && expected.all_heard(view, now)
                && is_complete(view, &expected, now)
        };
        listen(&mut operator, self.listen, &stop, is_done)?;
        self.show(out, &operator, &expected)?;
        // Who has heard enough (`| head`) ends it.
        while self.watch && !stop.is_asked() && !out.is_closed() {
            listen(&mut operator, WATCH, &stop, |_, _| false)?;
            self.show(out, &operator, &expected)?;
        }
        let missing = expected.missing(operator.view(), operator.now());
        operator.close();
        if missing.is_empty() || self.watch && out.is_closed() {
            return Ok(());
        }
        Err(CliError::Swarm(format!(
            "not heard: {}",
            missing.join(", ")
        )))
    }

    fn show(
        &self,
        out: &mut StandardOutput,
        operator: &LiveOperator,
        expected: &Expected,
    ) -> Result<(), CliError> {
        let (view, now) = (operator.view(), operator.now());
        let is_terminal = std::io::stdout().is_terminal();
        let clear = if self.watch && is_terminal {
            "\x1b[H\x1b[2J"
        } else {
            ""
        };
        let text = match self.json {
            true => format!("{}\n", json(view, expected, now)),
            false => format!(
                "{clear}{}",
                text(view, expected, now, screen::columns_of_stdout())
            ),
        };
        out.write_all(text.as_bytes())
            .and_then(|()| out.flush())
            .map_err(CliError::stdout)
    }
}

/// Listens for a while, until it is enough, or until the command shall end.
pub(super) fn listen(
    operator: &mut LiveOperator,
    span: Duration,
    stop: &StopFlag,
    is_enough: impl Fn(&FleetView, Time) -> bool,
) -> Result<(), CliError> {
    let end = operator.now() + span;
    while operator.now() < end && !stop.is_asked() && !is_enough(operator.view(), operator.now()) {
        operator
            .go_on(end.min(operator.now() + LOOK), |_, _| {})
            .map_err(fault)?;
    }
    Ok(())
}

/// Returns whether all that is said regularly was heard of everyone.
fn is_complete(view: &FleetView, expected: &Expected, now: Time) -> bool {
    let is_whole = |id: VehicleId| view.vehicle(id).is_some_and(|seen| seen.health.is_some());
    expected.vehicles(view, now).into_iter().all(is_whole)
}
