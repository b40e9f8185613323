//! Takes the steps of a recording again: actors are restored from its snapshots, given the same inputs, and their
//! outputs are compared with the recorded ones. Nothing is written, and no device is touched.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use super::actors::{self, RestoredActor};
use super::message::SnapshotMessage;
use super::reader::{ReadError, Reader, RecordingContents};
use super::{FORMAT, VERSION};
use crate::time::Time;

/// Why a file cannot be replayed.
#[derive(Debug, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub struct ReplayError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong, and where.
    pub reason: String,
}

/// What became of the steps of one actor.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ReplayResult {
    /// Steps that were taken again, up to the first difference.
    pub steps: u64,
    /// The first difference.
    pub difference: Option<Difference>,
}

/// A step that came out differently.
#[derive(Clone, PartialEq, Debug)]
pub struct Difference {
    /// In which file.
    pub path: PathBuf,
    /// Which step of the actor in this file, from 1.
    pub number: u64,
    /// When it was taken.
    pub at: Time,
    /// The input, or that it was woken, as JSON.
    pub input: String,
    /// What came of it when it was recorded, as JSON.
    pub then: String,
    /// What came of it now, as JSON.
    pub now: String,
}

/// What became of a whole recording.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Replayed {
    /// By node and actor: `vehicle/1/mission`.
    pub actors: BTreeMap<String, ReplayResult>,
    /// Files that end unfinished, or with a gap; in words.
    pub notes: Vec<String>,
}

/// Replays a file into `replayed`; with `only`, the actors of this name alone.
///
/// # Errors
/// The file cannot be read, or is no recording of this version.
pub fn replay(path: &Path, only: Option<&str>, replayed: &mut Replayed) -> Result<(), ReplayError> {
    let refused = |reason: String| ReplayError {
        path: path.to_owned(),
        reason,
    };
    let file = File::open(path).map_err(|error| refused(format!("cannot be read: {error}")))?;
    let mut reader = Reader::new(file);
    let mut segment = Segment {
        path,
        only,
        is_known: false,
        actors: BTreeMap::new(),
    };
    loop {
        match reader.next_found() {
            Ok(None) => break,
            Ok(Some(found)) => {
                let offset = reader.offset();
                let at = |reason: String| refused(format!("before byte {offset}: {reason}"));
                segment.take(found, replayed).map_err(at)?;
            }
            Err(error @ ReadError::Truncated { .. }) if segment.is_known => {
                replayed
                    .notes
                    .push(format!("{}: {error}; replayed up to there", path.display()));
                break;
            }
            Err(error) => return Err(refused(error.to_string())),
        }
    }
    if segment.is_known {
        Ok(())
    } else {
        Err(refused(FOREIGN.to_owned()))
    }
}

pub(super) const FOREIGN: &str = "is no recording of tomoswarm";

/// Judges by which version a file was recorded.
pub(super) fn check_version(values: &BTreeMap<String, String>) -> Result<(), String> {
    let value = |key: &str| values.get(key).map_or("unknown", String::as_str);
    let (format, software) = (value("format"), value("software"));
    if (format, software) == (FORMAT, VERSION) {
        return Ok(());
    }
    Err(format!(
        "recorded by tomoswarm {software} (format {format}); this is {VERSION} (format {FORMAT}), and snapshots are read by \
         the same version only"
    ))
}

/// Says that a file ends with a gap, and why.
pub(super) fn gap_note(path: &Path, values: &BTreeMap<String, String>) -> String {
    let reason = values.get("reason").map_or("unknown", String::as_str);
    format!("{}: ends with a gap: {reason}", path.display())
}

/// A file being replayed.
struct Segment<'a> {
    path: &'a Path,
    only: Option<&'a str>,
    is_known: bool,
    /// Restored actors and how many steps they have taken; `None` once they have differed.
    actors: BTreeMap<String, (Option<RestoredActor>, u64)>,
}

impl Segment<'_> {
    fn take(&mut self, found: RecordingContents, replayed: &mut Replayed) -> Result<(), String> {
        match found {
            RecordingContents::Metadata { name, values } => self.metadata(&name, &values, replayed),
            RecordingContents::Message { topic, data } if self.is_known => {
                self.message(&topic, &data, replayed)
            }
            RecordingContents::Message { .. } => Err(FOREIGN.to_owned()),
        }
    }

    fn metadata(
        &mut self,
        name: &str,
        values: &BTreeMap<String, String>,
        replayed: &mut Replayed,
    ) -> Result<(), String> {
        match name {
            "tomoswarm" => {
                check_version(values)?;
                self.is_known = true;
            }
            "gap" => replayed.notes.push(gap_note(self.path, values)),
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, topic: &str, data: &[u8], replayed: &mut Replayed) -> Result<(), String> {
        let Some((name, kind)) = topic.trim_start_matches('/').rsplit_once('/') else {
            return Ok(());
        };
        let (node, actor) = name.rsplit_once('/').unwrap_or(("", name));
        if self.only.is_some_and(|only| only != actor && only != name) {
            return Ok(());
        }
        match kind {
            "snapshot" => self
                .restore(node, actor, data)
                .map_err(|error| format!("{topic} {error}")),
            "step" => self
                .step(name, data, replayed)
                .map_err(|error| format!("{topic} {error}")),
            _ => Ok(()),
        }
    }

    fn restore(&mut self, node: &str, actor: &str, data: &[u8]) -> Result<(), String> {
        let kept: SnapshotMessage =
            serde_json::from_slice(data).map_err(|error| error.to_string())?;
        let restored =
            actors::restore(node, actor, &kept.packed).ok_or("is of no actor of this version")?;
        let restored = restored.map_err(|error| error.to_string())?;
        let name = format!("{node}/{actor}");
        let steps = self.actors.get(&name).map_or(0, |(_, steps)| *steps);
        self.actors.insert(name, (Some(restored), steps));
        Ok(())
    }

    fn step(&mut self, name: &str, data: &[u8], replayed: &mut Replayed) -> Result<(), String> {
        let Some((restored, number)) = self.actors.get_mut(name) else {
            return Err("comes without a snapshot before it".to_owned());
        };
        let verdict = replayed.actors.entry(name.to_owned()).or_default();
        *number += 1;
        let Some(take) = restored else { return Ok(()) };
        if verdict.difference.is_some() {
            return Ok(());
        }
        verdict.steps += 1;
        if let Some((at, [input, then, now])) = take(data).map_err(|error| error.to_string())? {
            *restored = None;
            let (path, number) = (self.path.to_owned(), *number);
            verdict.difference = Some(Difference {
                path,
                number,
                at,
                input,
                then,
                now,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_whose_snapshots_have_another_shape_is_refused_by_its_format() {
        let begin = |format: &str| {
            let path = Path::new("flight.mcap");
            let mut segment = Segment {
                path,
                only: None,
                is_known: false,
                actors: BTreeMap::new(),
            };
            let words = [("format", format), ("software", VERSION)];
            let words = words.map(|(name, word)| (name.to_owned(), word.to_owned()));
            segment.metadata(
                "tomoswarm",
                &BTreeMap::from(words),
                &mut Replayed::default(),
            )
        };
        assert_eq!(begin(FORMAT), Ok(()));
        let reason = begin("1").unwrap_err();
        assert!(reason.contains("(format 1); this is"), "{reason}");
    }
}
