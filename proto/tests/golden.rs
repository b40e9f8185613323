//! The bytes of wire version 1, one file per kind of message. The files are never edited: when one of
//! these tests fails, other versions of the software in the field cannot read this one any more.

mod examples;

use examples::examples;
use tomoswarm_proto::codec::{decode, encode};
use tomoswarm_proto::{Boot, Message, Progress, Revision, RunId, StopId, VehicleId};

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn golden(name: &str) -> String {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/v1").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.split_whitespace().collect()
}

#[test]
fn every_kind_has_the_bytes_of_version_1() {
    for (name, message) in examples() {
        let bytes = hex(&encode(&message).unwrap());
        assert_eq!(bytes, golden(&format!("{name}.hex")), "{name}");
    }
}

#[test]
fn the_bytes_of_version_1_can_be_read() {
    for (name, message) in examples() {
        let text = golden(&format!("{name}.hex"));
        let digits = |at: usize| u8::from_str_radix(&text[at..at + 2], 16).unwrap();
        let frame: Vec<u8> = (0..text.len()).step_by(2).map(digits).collect();
        assert_eq!(decode(&frame), Ok(message), "{name}");
    }
}

#[test]
fn the_table_of_messages_names_every_kind_and_the_bytes_of_its_example() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let text = std::fs::read_to_string(path).unwrap();
    for (name, message) in examples() {
        let frame = encode(&message).unwrap();
        let row =
            text.lines().find(|line| line.starts_with(&format!("| {} | ", frame[3])) && line.contains(" → "));
        let row = row.unwrap_or_else(|| panic!("{name} is not in the table"));
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        assert_eq!(cells[2].to_lowercase(), name);
        assert!(cells[5].starts_with(&format!("`{name}")), "{name}: {}", cells[5]);
        assert!(
            cells[7].starts_with(&format!("{}; ", frame.len())),
            "{name} has {} bytes: {}",
            frame.len(),
            cells[7]
        );
    }
}

#[test]
fn every_kind_has_an_example() {
    let mut kinds: Vec<u8> = examples().iter().map(|(_, message)| encode(message).unwrap()[3]).collect();
    kinds.dedup();
    assert_eq!(kinds, (0..=12).collect::<Vec<u8>>());
}

#[test]
fn a_frame_is_laid_out_as_documented() {
    let progress = Progress {
        vehicle: VehicleId(3),
        boot: Boot(4),
        run: RunId(2),
        revision: Revision(300),
        done: Some(StopId(7)),
        leg: None,
    };
    let frame = encode(&Message::Progress(progress)).unwrap();
    // Magic, version, kind; kind again; vehicle, boot, run, revision as a 16-bit varint, Some(7), None.
    assert_eq!(hex(&frame), "74530106".to_owned() + "06" + "03" + "04" + "02" + "fb2c01" + "0107" + "00");
}
