//! `tomoswarm status CONFIG`: listens for a moment and shows who is there and how they are. Says nothing to anyone.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::error::CliError;
use super::operator::{Door, seconds};
use super::stop::Stop;
use crate::run::door::roll::Roll;
use crate::run::door::session::Session;
use crate::run::door::status::{Expected, json, text};
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
`ordered` is the last order obeyed with its lease and revision; `waiting` are samples that the ground has not confirmed;
`hears` is whom it hears by radio; a dash is what was not reported.

Examples:
  tomoswarm status operator.toml                      one look
  tomoswarm status operator.toml --watch              every second
  tomoswarm status operator.toml --json | jq .        for a script

Exit codes: 0 all expected were heard; 1 somebody was not; 2 bad usage or configuration.";

impl StatusArgs {
    /// Listens and shows.
    ///
    /// # Errors
    /// A bad file, or somebody who was not heard.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let door = Door::read(&self.config)?;
        let expected = Expected { vehicles: door.vehicles.clone(), ground: true };
        let stop = Stop::listen();
        let session = door.open()?;
        let mut roll = Roll::default();
        let is_done = |roll: &Roll, now: Time| {
            // Without a list it is only known at the end who is there.
            !expected.vehicles.is_empty()
                && expected.all_heard(roll, now)
                && is_complete(roll, &expected, now)
        };
        listen(&session, &mut roll, self.listen, &stop, is_done);
        self.show(out, &roll, &expected, session.now())?;
        while self.watch && !stop.is_asked() {
            listen(&session, &mut roll, WATCH, &stop, |_, _| false);
            self.show(out, &roll, &expected, session.now())?;
        }
        let now = session.now();
        session.close();
        let missing = expected.missing(&roll, now);
        if missing.is_empty() {
            return Ok(());
        }
        Err(CliError::Swarm(format!("not heard: {}", missing.join(", "))))
    }

    fn show(&self, out: &mut dyn Write, roll: &Roll, expected: &Expected, now: Time) -> Result<(), CliError> {
        let clear = if self.watch && std::io::stdout().is_terminal() { "\x1b[H\x1b[2J" } else { "" };
        let text = match self.json {
            true => format!("{}\n", json(roll, expected, now)),
            false => format!("{clear}{}", text(roll, expected, now)),
        };
        let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        written.map_err(|source| CliError::Write { path: "standard output".into(), source })
    }
}

/// Listens for a while, until it is enough, or until the command shall end.
pub(super) fn listen(
    session: &Session,
    roll: &mut Roll,
    span: Duration,
    stop: &Stop,
    is_enough: impl Fn(&Roll, Time) -> bool,
) {
    let end = session.now() + span;
    while session.now() < end && !stop.is_asked() {
        if let Some((at, heard)) = session.hear(end.min(session.now() + LOOK)) {
            roll.hear(at, &heard);
        }
        if is_enough(roll, session.now()) {
            return;
        }
    }
}

/// Tells whether all that is said regularly was heard of everyone.
fn is_complete(roll: &Roll, expected: &Expected, now: Time) -> bool {
    let is_whole = |id: VehicleId| roll.vehicle(id).is_some_and(|seen| seen.health.is_some());
    expected.vehicles(roll, now).into_iter().all(is_whole)
}
