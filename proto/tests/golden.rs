//! The bytes of the wire, one folder a version. The files are never edited: when one of these tests fails, other
//! versions of the software in the field cannot read this one any more.

mod examples;

use std::path::{Path, PathBuf};

use examples::{examples, variants};
use tomoswarm_proto::codec::{DecodeError, Decoded, Greeting, decode, encode, greeting};
use tomoswarm_proto::{
    Boot, Message, MessageKind, MissionKind, MissionPhase, MissionProgress, Position, Progress,
    Revision, RunId, Sender, StopId, VehicleId,
};

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn folder(version: u8) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/v{version}"))
}

fn golden(version: u8, name: &str) -> String {
    let path = folder(version).join(format!("{name}.hex"));
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.split_whitespace().collect()
}

fn golden_frame(version: u8, name: &str) -> Vec<u8> {
    let text = golden(version, name);
    let digits = |at: usize| u8::from_str_radix(&text[at..at + 2], 16).unwrap();
    (0..text.len()).step_by(2).map(digits).collect()
}

/// The names of the files of a version, sorted.
fn names(version: u8) -> Vec<String> {
    let entries = std::fs::read_dir(folder(version)).unwrap();
    let stem = |entry: std::fs::DirEntry| {
        entry
            .path()
            .file_stem()
            .unwrap()
            .to_str()
            .unwrap()
            .to_owned()
    };
    let mut names: Vec<String> = entries.map(|entry| stem(entry.unwrap())).collect();
    names.sort();
    names
}

fn all() -> impl Iterator<Item = (&'static str, Message)> {
    examples().into_iter().chain(variants())
}

#[test]
fn every_kind_has_the_bytes_of_version_2() {
    for (name, message) in all() {
        let bytes = hex(&encode(&message).unwrap());
        assert_eq!(bytes, golden(2, name), "{name}");
    }
}

#[test]
fn the_bytes_of_version_2_can_be_read() {
    for (name, message) in all() {
        assert_eq!(
            decode(&golden_frame(2, name)),
            Ok(Decoded::Message(message)),
            "{name}"
        );
    }
}

#[test]
fn every_file_of_version_2_is_compared() {
    let mut compared: Vec<String> = all().map(|(name, _)| name.to_owned()).collect();
    compared.sort();
    assert_eq!(names(2), compared);
}

#[test]
fn the_bytes_of_version_1_are_refused_by_name() {
    let names = names(1);
    assert_eq!(names.len(), 13);
    for name in names {
        let refused = decode(&golden_frame(1, &name)).unwrap_err();
        assert_eq!(refused, DecodeError::Version { found: 1 }, "{name}");
        assert_eq!(refused.to_string(), "frame of wire version 1, expected 2");
    }
}

#[test]
fn the_greeting_of_version_1_can_be_read() {
    let expected = Greeting {
        version: 1,
        node: Sender::Vehicle(VehicleId(2)),
        boot: Boot(5),
        venue_hash: 0x0123_4567_89ab_cdef,
    };
    assert_eq!(greeting(&golden_frame(1, "hello")), Ok(expected));
}

#[test]
fn both_versions_greet_with_the_same_bytes() {
    let (old, new) = (golden_frame(1, "hello"), golden_frame(2, "hello"));
    assert_eq!((old[2], new[2]), (1, 2));
    assert_eq!((&old[..2], &old[3..18]), (&new[..2], &new[3..18]));
}

#[test]
fn every_kind_has_an_example() {
    let kinds: Vec<MessageKind> = examples()
        .iter()
        .map(|(_, message)| message.kind())
        .collect();
    assert_eq!(kinds, MessageKind::ALL);
    for (name, message) in examples() {
        assert_eq!(name, message.word());
    }
}

#[test]
fn a_frame_is_laid_out_as_documented() {
    let mission = MissionProgress {
        vehicle: VehicleId(3),
        boot: Boot(4),
        progress: Progress {
            run: RunId(2),
            revision: Revision(300),
            done: Some(StopId(7)),
            leg: None,
        },
        kind: MissionKind::Sweep,
        phase: MissionPhase::Going,
        share: None,
        places_left: 12,
        goal: Some(Position {
            x_mm: 1000,
            y_mm: -5,
            z_mm: 0,
        }),
        slice: 0,
        end: None,
        is_at_home: false,
        lease_number: 6,
    };
    let frame = encode(&Message::Mission(mission)).unwrap();
    // Magic, version, kind; vehicle, boot, run, revision as a 16-bit varint, Some(7), None; kind of mission, phase,
    // no share, places left; Some(x as a 16-bit zigzag, y, z); slice, no end, not at home, the number of the lease.
    let progress = ["03", "04", "02", "fb2c01", "0107", "00"].concat();
    let mission = [
        "00", "02", "00", "0c", "01", "fbd007", "09", "00", "00", "00", "00", "06",
    ]
    .concat();
    assert_eq!(hex(&frame), ["74530206", &progress, &mission].concat());
}
