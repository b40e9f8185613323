//! Takes the steps of a recording again: actors are restored from its snapshots, told what they were told, and what
//! they say is compared with what they said. Nothing is written, and no device is touched.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::message::{self, Kept, MessageError};
use super::reader::{Found, ReadError, Reader};
use super::{FORMAT, VERSION};
use crate::actor::{Actor, again};
use crate::ground::imager::Imager;
use crate::ground::planner::Planner;
use crate::ground::station::Station;
use crate::node::map::Map;
use crate::node::mission::Mission;
use crate::node::outbox::Outbox;
use crate::node::radio::Radio;
use crate::node::sensor::Sensor;
use crate::node::vehicle::Vehicle;
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
pub struct Verdict {
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
    /// What the actor was told, or that it was woken, as JSON.
    pub told: String,
    /// What came of it when it was recorded, as JSON.
    pub then: String,
    /// What came of it now, as JSON.
    pub now: String,
}

/// What became of a whole recording.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Replayed {
    /// By node and actor: `vehicle/1/mission`.
    pub actors: BTreeMap<String, Verdict>,
    /// Files that end unfinished, or with a gap; in words.
    pub notes: Vec<String>,
}

/// What one step came out as; `None` when as recorded.
type Outcome = Result<Option<(Time, [String; 3])>, MessageError>;
/// A restored actor, which takes a recorded step again.
type Restored = Box<dyn FnMut(&[u8]) -> Outcome>;

/// Replays a file into `replayed`; with `only`, the actors of this name alone.
///
/// # Errors
/// The file cannot be read, or is no recording of this version.
pub fn replay(path: &Path, only: Option<&str>, replayed: &mut Replayed) -> Result<(), ReplayError> {
    let refused = |reason: String| ReplayError { path: path.to_owned(), reason };
    let file = File::open(path).map_err(|error| refused(format!("cannot be read: {error}")))?;
    let mut reader = Reader::new(file);
    let mut segment = Segment { path, only, is_known: false, actors: BTreeMap::new() };
    loop {
        match reader.next_found() {
            Ok(None) => break,
            Ok(Some(found)) => {
                let offset = reader.offset();
                let at = |reason: String| refused(format!("before byte {offset}: {reason}"));
                segment.take(found, replayed).map_err(at)?;
            }
            Err(error @ ReadError::Truncated { .. }) if segment.is_known => {
                replayed.notes.push(format!("{}: {error}; replayed up to there", path.display()));
                break;
            }
            Err(error) => return Err(refused(error.to_string())),
        }
    }
    if segment.is_known { Ok(()) } else { Err(refused(FOREIGN.to_owned())) }
}

const FOREIGN: &str = "is no recording of tomoswarm";

/// A file being replayed.
struct Segment<'a> {
    path: &'a Path,
    only: Option<&'a str>,
    is_known: bool,
    /// Restored actors and how many steps they have taken; `None` once they have differed.
    actors: BTreeMap<String, (Option<Restored>, u64)>,
}

impl Segment<'_> {
    fn take(&mut self, found: Found, replayed: &mut Replayed) -> Result<(), String> {
        match found {
            Found::Metadata { name, values } => self.metadata(&name, &values, replayed),
            Found::Message { topic, data } if self.is_known => self.message(&topic, &data, replayed),
            Found::Message { .. } => Err(FOREIGN.to_owned()),
        }
    }

    fn metadata(
        &mut self,
        name: &str,
        values: &BTreeMap<String, String>,
        replayed: &mut Replayed,
    ) -> Result<(), String> {
        let value = |key: &str| values.get(key).map_or("unknown", String::as_str);
        match name {
            "tomoswarm" => {
                let (format, software) = (value("format"), value("software"));
                if (format, software) != (FORMAT, VERSION) {
                    return Err(format!(
                        "recorded by tomoswarm {software} (format {format}); this is {VERSION} (format {FORMAT}), and \
                         snapshots are read by the same version only"
                    ));
                }
                self.is_known = true;
            }
            "gap" => {
                replayed.notes.push(format!("{}: ends with a gap: {}", self.path.display(), value("reason")))
            }
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, topic: &str, data: &[u8], replayed: &mut Replayed) -> Result<(), String> {
        let Some((name, kind)) = topic.trim_start_matches('/').rsplit_once('/') else { return Ok(()) };
        let actor = name.rsplit('/').next().unwrap_or(name);
        if self.only.is_some_and(|only| only != actor && only != name) {
            return Ok(());
        }
        match kind {
            "snapshot" => self.restore(name, actor, data).map_err(|error| format!("{topic} {error}")),
            "step" => self.step(name, data, replayed).map_err(|error| format!("{topic} {error}")),
            _ => Ok(()),
        }
    }

    fn restore(&mut self, name: &str, actor: &str, data: &[u8]) -> Result<(), String> {
        let kept: Kept = serde_json::from_slice(data).map_err(|error| error.to_string())?;
        let restored = restore(actor, &kept.packed).ok_or("is of no actor of this version")?;
        let restored = restored.map_err(|error| error.to_string())?;
        let steps = self.actors.get(name).map_or(0, |(_, steps)| *steps);
        self.actors.insert(name.to_owned(), (Some(restored), steps));
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
        if let Some((at, [told, then, now])) = take(data).map_err(|error| error.to_string())? {
            *restored = None;
            let (path, number) = (self.path.to_owned(), *number);
            verdict.difference = Some(Difference { path, number, at, told, then, now });
        }
        Ok(())
    }
}

/// Restores an actor; `None` when there is none of this name.
fn restore(actor: &str, packed: &str) -> Option<Result<Restored, MessageError>> {
    Some(match actor {
        "vehicle" => restored::<Vehicle>(packed),
        "sensor" => restored::<Sensor>(packed),
        "map" => restored::<Map>(packed),
        "mission" => restored::<Mission>(packed),
        "radio" => restored::<Radio>(packed),
        "outbox" => restored::<Outbox>(packed),
        "station" => restored::<Station>(packed),
        "planner" => restored::<Planner>(packed),
        "imager" => restored::<Imager>(packed),
        _ => return None,
    })
}

fn restored<A>(packed: &str) -> Result<Restored, MessageError>
where
    A: Actor + DeserializeOwned + 'static,
    A::In: Clone + Serialize + DeserializeOwned,
    A::Out: Serialize,
{
    let mut actor: A = message::unpacked(packed)?;
    Ok(Box::new(move |recorded| take_again(&mut actor, recorded)))
}

fn take_again<A>(actor: &mut A, recorded: &[u8]) -> Outcome
where
    A: Actor,
    A::In: Clone + Serialize + DeserializeOwned,
    A::Out: Serialize,
{
    let step = message::read_step::<A::In>(recorded)?;
    let now = message::of_step(&again(actor, step.now, step.told))?;
    if now.as_bytes() == recorded {
        return Ok(None);
    }
    // Other tools may have written the same with other spaces.
    let (then, now): (Value, Value) = (serde_json::from_slice(recorded)?, serde_json::from_str(&now)?);
    if then == now {
        return Ok(None);
    }
    let told =
        if then["told"].is_null() { format!("woken: {}", then["woken"]) } else { then["told"].to_string() };
    Ok(Some((step.now, [told, came_of(&then), came_of(&now)])))
}

/// Gives what came of a step in words: what was said, the fault, and another cause.
fn came_of(step: &Value) -> String {
    let said = step["said"].to_string();
    let part = |name: &str| step.get(name).map(|value| format!(" {name}: {value}")).unwrap_or_default();
    format!("{said}{}{}", part("woken"), part("fault"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::{Cause, Fault, Step};
    use crate::time::Deadline;
    use serde::Deserialize;

    /// Multiplies what it is told by a constant, and adds what it was told before.
    #[derive(Serialize, Deserialize)]
    struct Scales<const BY: u64> {
        sum: u64,
    }

    impl<const BY: u64> Actor for Scales<BY> {
        type In = u64;
        type Out = u64;
        fn handle(&mut self, _now: Time, input: u64, out: &mut Vec<u64>) -> Result<(), Fault> {
            self.sum += input;
            out.push(self.sum * BY);
            Ok(())
        }
        fn deadline(&self) -> Option<Deadline> {
            None
        }
        fn wake(&mut self, _now: Time, _out: &mut Vec<u64>) -> Result<(), Fault> {
            Ok(())
        }
    }

    #[test]
    fn an_actor_with_another_constant_differs_where_it_matters() {
        let recorded = [(1, 0, 6), (2, 3, 12)].map(|(at, input, said)| {
            let now = Time::from_nanos(at);
            message::of_step(&Step { now, cause: Cause::Told(input), said: vec![said], fault: None }).unwrap()
        });
        let (mut same, mut other) = (Scales::<2> { sum: 3 }, Scales::<4> { sum: 3 });
        for text in &recorded {
            assert_eq!(take_again(&mut same, text.as_bytes()).unwrap(), None);
        }
        let (at, [told, then, now]) = take_again(&mut other, recorded[0].as_bytes()).unwrap().unwrap();
        assert_eq!(
            (at, told.as_str(), then.as_str(), now.as_str()),
            (Time::from_nanos(1), "0", "[6]", "[12]")
        );
    }

    #[test]
    fn a_recording_whose_snapshots_have_another_shape_is_refused_by_its_format() {
        let begin = |format: &str| {
            let path = Path::new("flight.mcap");
            let mut segment = Segment { path, only: None, is_known: false, actors: BTreeMap::new() };
            let words =
                [("format", format), ("software", VERSION)].map(|(name, word)| (name.into(), word.into()));
            segment.metadata("tomoswarm", &words.into(), &mut Replayed::default())
        };
        assert_eq!(begin(FORMAT), Ok(()));
        let reason = begin("1").unwrap_err();
        assert!(reason.contains("(format 1); this is"), "{reason}");
    }

    #[test]
    fn spaces_do_not_matter_and_a_wake_out_of_turn_does() {
        let mut scales = Scales::<2> { sum: 0 };
        let spaced = b"{ \"said\": [4], \"told\": 2, \"now_ns\": 5 }";
        assert_eq!(take_again(&mut scales, spaced).unwrap(), None);
        let woken = b"{\"now_ns\":6,\"woken\":\"tick\",\"said\":[]}";
        let (_, [told, _, now]) = take_again(&mut scales, woken).unwrap().unwrap();
        assert_eq!(told, "woken: \"tick\"");
        assert!(now.contains("nothing is due"), "{now}");
    }
}
