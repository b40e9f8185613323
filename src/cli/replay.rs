//! `tomoswarm replay FILE_OR_FOLDER`: takes the steps of a recording again and says where the first one differs.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::error::CliError;
use super::standard_output::complain;
use crate::store::recording::{Difference, ReplayResult, Replayed, replay};

/// Folders in folders are looked through so deep.
const DEPTH: usize = 4;
/// A value of a step is shown this long at most, characters; `--json` shows all.
const SHOWN: usize = 400;

/// Take the steps of a flight recording again, and say where an actor now does something else.
///
/// Every vehicle and ground station records the inputs of its actors and their outputs. Here fresh actors are restored
/// from the recording's snapshots, given the same inputs, and their outputs are compared, actor by actor. A folder stands
/// for all recordings (.mcap) in it. A file of a process that was killed is replayed up to its last whole chunk.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct ReplayArgs {
    /// A recording (.mcap), or a folder with recordings
    #[arg(value_name = "FILE_OR_FOLDER", required = true)]
    pub paths: Vec<PathBuf>,
    /// Only this actor: its name (mission), or with its node (vehicle/1/mission)
    #[arg(long, value_name = "ACTOR")]
    pub actor: Option<String>,
    /// Print JSON, with every value in full
    #[arg(long)]
    pub json: bool,
}

const AFTER_HELP: &str = "\
Examples:
  tomoswarm sim --record --out run              record a simulated run
  tomoswarm replay run/flight                   replay all of its nodes
  tomoswarm replay run/flight --actor mission   only the missions of all vehicles

Exit codes: 0 all identical; 1 a step differs; 2 bad usage, or a file that cannot be replayed.";

impl ReplayArgs {
    /// Replays.
    ///
    /// # Errors
    /// A step differs, or a file cannot be replayed.
    pub fn run(&self, out: &mut (dyn Write + Send)) -> Result<(), CliError> {
        let files = recordings(&self.paths)?;
        let (mut replayed, mut refused) = (Replayed::default(), Vec::new());
        for file in &files {
            if let Err(error) = replay(file, self.actor.as_deref(), &mut replayed) {
                refused.push(CliError::Input {
                    path: error.path,
                    reason: error.reason,
                });
            }
        }
        replayed
            .notes
            .iter()
            .for_each(|note| complain(&format_args!("note: {note}")));
        let text = if self.json {
            format!("{:#}\n", in_json(&replayed))
        } else {
            in_words(&replayed)
        };
        let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        written.map_err(|source| CliError::Write {
            path: "standard output".into(),
            source,
        })?;
        if !refused.is_empty() {
            return Err(CliError::Several(refused));
        }
        if let (Some(actor), true) = (&self.actor, replayed.actors.is_empty()) {
            return Err(CliError::Usage(format!(
                "no actor `{actor}` took a step in what was recorded"
            )));
        }
        if replayed.actors.is_empty() {
            let reason = "no actor took a step in what was recorded: it was cut off soon after its beginning, or lacks the part that begins it";
            return Err(CliError::Usage(reason.to_owned()));
        }
        let differing = replayed
            .actors
            .values()
            .filter(|verdict| verdict.difference.is_some())
            .count();
        let of = replayed.actors.len();
        if differing > 0 {
            Err(CliError::Differs(format!("{differing} of {of} actors")))
        } else {
            Ok(())
        }
    }
}

/// Lists the recordings at some paths, in order.
///
/// # Errors
/// A path cannot be read, or holds none.
pub(super) fn recordings(paths: &[PathBuf]) -> Result<Vec<PathBuf>, CliError> {
    let mut files = Vec::new();
    for path in paths {
        let before = files.len();
        collect(path, DEPTH, &mut files)?;
        if files.len() == before {
            let reason = "holds no recording; files that end in .mcap are expected".to_owned();
            return Err(CliError::Input {
                path: path.clone(),
                reason,
            });
        }
    }
    Ok(files)
}

/// Lists the recordings at a path, in order.
fn collect(path: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), CliError> {
    if !path.is_dir() {
        files.push(path.to_owned());
        return Ok(());
    }
    let unreadable = |source| CliError::Read {
        path: path.to_owned(),
        source,
    };
    let entries = std::fs::read_dir(path).map_err(unreadable)?;
    let mut inside: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    inside.sort();
    for inner in inside {
        let is_recording = inner
            .extension()
            .is_some_and(|extension| extension == "mcap");
        if inner.is_dir() && depth > 0 {
            collect(&inner, depth - 1, files)?;
        } else if is_recording && inner.is_file() {
            files.push(inner);
        }
    }
    Ok(())
}

fn in_words(replayed: &Replayed) -> String {
    let width = replayed.actors.keys().map(String::len).max().unwrap_or(0);
    let mut text = String::new();
    for (actor, ReplayResult { steps, difference }) in &replayed.actors {
        let verdict = if difference.is_some() {
            "differs"
        } else {
            "identical"
        };
        // Writing to a string does not fail.
        let _ = writeln!(text, "{actor:width$}  {steps:>9} steps  {verdict}");
        if let Some(difference) = difference {
            text += &shown(difference);
        }
    }
    text
}

fn shown(difference: &Difference) -> String {
    let Difference {
        path,
        number,
        at,
        input,
        then,
        now,
    } = difference;
    format!(
        "  {}: step {number}, at {at} s\n    input            {}\n    outputs recorded {}\n    outputs now      {}\n",
        path.display(),
        cut(input),
        cut(then),
        cut(now)
    )
}

fn cut(text: &str) -> String {
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{} … ({} bytes)", &text[..end], text.len()),
        None => text.to_owned(),
    }
}

fn in_json(replayed: &Replayed) -> Value {
    let difference = |difference: &Difference| {
        json!({
            "file": difference.path.to_string_lossy(),
            "step": difference.number,
            "at_ns": difference.at.as_nanos(),
            "input": difference.input,
            "outputs_recorded": difference.then,
            "outputs_now": difference.now,
        })
    };
    let actor = |(name, verdict): (&String, &ReplayResult)| {
        let first = verdict.difference.as_ref().map(difference);
        json!({"actor": name, "steps": verdict.steps, "identical": first.is_none(), "first_difference": first})
    };
    let actors: Vec<Value> = replayed.actors.iter().map(actor).collect();
    json!({"actors": actors, "notes": replayed.notes})
}
