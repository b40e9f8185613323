//! Steps and snapshots as the JSON messages of a recording, and back. Nothing here knows a file.
//!
//! A step is `{"now_ns": 1, "input": …, "outputs": […]}`, or with `"woken": "reason"` in place of `input`, and with `fault`
//! when the actor could not go on. JSON has no numbers that are infinite or none at all: an input with such numbers
//! shows `null` in their place and comes whole in `packed_input` (base64 of [`codec::pack`]).

use base64::prelude::{BASE64_STANDARD, Engine};
use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};
use tomoswarm_proto::codec;

use super::json_exactness::is_lossless;
use crate::actor::{RecordedStep, Snapshot, StepCause};
use crate::time::Time;

/// Why a message is none.
#[derive(Debug, thiserror::Error)]
pub enum MessageError {
    /// It is no JSON, or not of this kind.
    #[error("is no message of a recording: {0}")]
    Json(#[from] serde_json::Error),
    /// Packed bytes cannot be read.
    #[error("packed bytes cannot be read by this version: {0}")]
    Packed(String),
    /// It is of an actor that no such node has.
    #[error("there is no actor {0}")]
    NoActor(String),
}

/// Returns a step as JSON.
///
/// # Errors
/// A value that JSON cannot hold, which is a mistake of this program.
pub fn of_step<I, O>(step: &RecordedStep<I, O>) -> Result<String, MessageError>
where
    I: Serialize,
    O: Serialize,
{
    let mut text = format!("{{\"now_ns\":{}", step.now.as_nanos());
    match &step.cause {
        StepCause::Input(input) => {
            let json = serde_json::to_string(input)?;
            text += &format!(",\"input\":{json}");
            if json.contains("null") && !is_lossless(input) {
                let packed =
                    codec::pack(input).map_err(|error| MessageError::Packed(error.to_string()))?;
                text += &format!(",\"packed_input\":\"{}\"", BASE64_STANDARD.encode(&packed));
            }
        }
        StepCause::Woken(why) => text += &format!(",\"woken\":{}", serde_json::to_string(why)?),
    }
    text += &format!(",\"outputs\":{}", serde_json::to_string(&step.outputs)?);
    if let Some(fault) = &step.fault {
        text += &format!(",\"fault\":{}", serde_json::to_string(fault)?);
    }
    text.push('}');
    Ok(text)
}

/// What made an actor act, as recorded: when, and the input unless it was woken.
#[derive(Debug)]
pub struct Recorded<I> {
    /// When.
    pub now: Time,
    /// The input; `None` when it was woken.
    pub input: Option<I>,
}

#[derive(Deserialize)]
struct Frame {
    now_ns: u64,
    input: Option<IgnoredAny>,
    packed_input: Option<String>,
    woken: Option<IgnoredAny>,
}

#[derive(Deserialize)]
struct RecordedInput<I> {
    input: I,
}

/// Reads what made an actor act.
///
/// # Errors
/// It is no step, or not of this actor.
pub fn read_step<I: DeserializeOwned>(json: &[u8]) -> Result<Recorded<I>, MessageError> {
    let frame: Frame = serde_json::from_slice(json)?;
    let now = Time::from_nanos(frame.now_ns);
    if let Some(packed) = frame.packed_input {
        return Ok(Recorded {
            now,
            input: Some(unpacked(&packed)?),
        });
    }
    if frame.input.is_none() && frame.woken.is_some() {
        return Ok(Recorded { now, input: None });
    }
    let RecordedInput { input } = serde_json::from_slice(json)?;
    Ok(Recorded {
        now,
        input: Some(input),
    })
}

#[derive(Deserialize)]
struct RecordedOutputs<O> {
    now_ns: u64,
    outputs: Vec<O>,
}

/// Reads when an actor acted and what came of it; outputs with numbers that JSON cannot hold are left out.
///
/// # Errors
/// It is no step.
pub fn read_outputs<O: DeserializeOwned>(json: &[u8]) -> Result<(Time, Vec<O>), MessageError> {
    if let Ok(read) = serde_json::from_slice::<RecordedOutputs<O>>(json) {
        return Ok((Time::from_nanos(read.now_ns), read.outputs));
    }
    let read: RecordedOutputs<serde_json::Value> = serde_json::from_slice(json)?;
    let outputs = read.outputs.into_iter();
    let outputs = outputs.filter_map(|output| serde_json::from_value(output).ok());
    Ok((Time::from_nanos(read.now_ns), outputs.collect()))
}

/// Reads packed bytes in base64.
///
/// # Errors
/// They are none, or of another version.
pub fn unpacked<T: DeserializeOwned>(text: &str) -> Result<T, MessageError> {
    let bytes = BASE64_STANDARD
        .decode(text)
        .map_err(|error| MessageError::Packed(error.to_string()))?;
    codec::unpack(&bytes).map_err(|error| MessageError::Packed(error.to_string()))
}

/// A snapshot as JSON.
#[derive(Serialize, Deserialize)]
pub struct SnapshotMessage {
    /// When it was taken.
    pub now_ns: u64,
    /// What [`codec::pack`] made of the actor, in base64.
    pub packed: String,
}

/// Returns a snapshot as JSON.
///
/// # Errors
/// None that is not a mistake of this program.
pub fn of_snapshot(now: Time, snapshot: &Snapshot) -> Result<String, MessageError> {
    let kept = SnapshotMessage {
        now_ns: now.as_nanos(),
        packed: BASE64_STANDARD.encode(&snapshot.bytes),
    };
    Ok(serde_json::to_string(&kept)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Angle, Point, Pose};
    use crate::node::vehicle::{In, Motion, Out, Telemetry};
    use proptest::prelude::*;

    fn telemetry(x_m: f64, speed_mps: f64) -> In {
        let pose = Pose {
            at: Point::new(x_m, -0.0),
            heading: Angle::default(),
            sd_m: 0.1,
        };
        In::Telemetry(Telemetry {
            pose,
            flight_state: Default::default(),
            speed_mps,
            battery: Some(1.0),
            motion: Motion::Driving,
            is_armed: true,
            stored: None,
        })
    }

    fn step(cause: StepCause<In>) -> RecordedStep<In, Out> {
        RecordedStep {
            now: Time::from_nanos(u64::MAX),
            cause,
            outputs: Vec::new(),
            fault: None,
        }
    }

    proptest! {
        #[test]
        fn every_number_comes_back_to_the_last_bit(bits in any::<u64>(), more in any::<u64>()) {
            let input = telemetry(f64::from_bits(bits), f64::from_bits(more));
            let text = of_step(&step(StepCause::Input(input.clone()))).unwrap();
            let read = read_step::<In>(text.as_bytes()).unwrap();
            prop_assert_eq!(read.now, Time::from_nanos(u64::MAX));
            prop_assert_eq!(codec::pack(&read.input.unwrap()).unwrap(), codec::pack(&input).unwrap());
        }

        #[test]
        fn any_text_is_read_or_refused(text in ".{0,60}") {
            let _ = read_step::<In>(text.as_bytes());
        }
    }

    #[test]
    fn numbers_that_json_lacks_are_packed_and_others_are_not() {
        let text = |input| of_step(&step(StepCause::Input(input))).unwrap();
        assert!(!text(telemetry(1.0, 0.5)).contains("packed"));
        for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let text = text(telemetry(odd, 0.5));
            assert!(
                text.contains("\"x_m\":null") && text.contains("packed_input"),
                "{text}"
            );
            assert!(read_step::<In>(text.as_bytes()).is_ok());
        }
    }

    #[test]
    fn a_wake_tells_its_reason_and_reads_as_one() {
        let text = of_step(&step(StepCause::Woken("telemetry silent"))).unwrap();
        assert_eq!(
            text,
            "{\"now_ns\":18446744073709551615,\"woken\":\"telemetry silent\",\"outputs\":[]}"
        );
        assert!(read_step::<In>(text.as_bytes()).unwrap().input.is_none());
    }

    #[test]
    fn foreign_messages_are_refused() {
        for text in [
            "{}",
            "[]",
            "{\"now_ns\":1}",
            "{\"now_ns\":-1,\"woken\":\"a\"}",
            "{\"now_ns\":1,\"input\":7}",
        ] {
            assert!(read_step::<In>(text.as_bytes()).is_err(), "{text}");
        }
        assert!(read_step::<In>(b"{\"now_ns\":1,\"input\":7,\"packed_input\":\"!\"}").is_err());
    }
}
