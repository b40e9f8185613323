//! Recording and replaying as users meet it: a simulated run recorded, replayed, tampered with, cut off and damaged.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::program_runner::{ProgramOutput, ProgramRunner};

const RECORD: [&str; 6] = [
    "sim",
    "small.sim.toml",
    "--no-pictures",
    "--record",
    "--out",
    "run",
];
const ROVER: &str = "run/flight/vehicle-1/flight-000001.mcap";

fn recorded() -> ProgramRunner {
    let runner = ProgramRunner::new();
    let output = runner.run(&RECORD);
    assert_eq!(output.code, 0, "{output:?}");
    runner
}

/// A message of a file, as it may be changed: topic and text.
type Message = (String, String);

/// Writes a recording anew with its metadata and messages changed.
fn rewrite(
    path: &Path,
    mut change: impl FnMut(&mut BTreeMap<String, String>),
    mut keep: impl FnMut(usize, &mut Message) -> bool,
) {
    let bytes = std::fs::read(path).unwrap();
    let mut writer = mcap::WriteOptions::new()
        .compression(None)
        .create(std::fs::File::create(path).unwrap())
        .unwrap();
    for record in mcap::read::LinearReader::new(&bytes).unwrap() {
        if let mcap::records::Record::Metadata(mut found) = record.unwrap() {
            change(&mut found.metadata);
            writer.write_metadata(&found).unwrap();
        }
    }
    let mut numbers = BTreeMap::<String, usize>::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let topic = message.channel.topic.clone();
        let number = numbers.entry(topic.clone()).or_default();
        *number += 1;
        let mut changed = (topic, String::from_utf8(message.data.to_vec()).unwrap());
        if keep(*number, &mut changed) {
            let data = changed.1.into_bytes().into();
            let channel = match changed.0 == message.channel.topic {
                true => message.channel.clone(),
                false => renamed(&message.channel, changed.0),
            };
            writer
                .write(&mcap::Message {
                    data,
                    channel,
                    ..message
                })
                .unwrap();
        }
    }
    writer.finish().unwrap();
}

/// A channel of another topic; one topic only may be renamed in a file.
fn renamed<'a>(channel: &mcap::Channel<'a>, topic: String) -> Arc<mcap::Channel<'a>> {
    Arc::new(mcap::Channel {
        id: channel.id + 1000,
        topic,
        ..channel.clone()
    })
}

fn replay(runner: &ProgramRunner, path: &str) -> ProgramOutput {
    runner.run(&["replay", path])
}

#[test]
fn a_recorded_run_replays_identically_and_is_the_same_bytes_again() {
    let runner = recorded();
    let output = replay(&runner, "run/flight");
    assert_eq!(
        (output.code, output.err.as_str()),
        (0, ""),
        "{}",
        output.out
    );
    assert_eq!(output.out.lines().count(), 2 * 9 + 5 + 2, "{}", output.out);
    assert!(
        output
            .out
            .lines()
            .all(|line| line.ends_with(" steps  identical")),
        "{}",
        output.out
    );
    let first = runner.files();
    assert_eq!(runner.run(&RECORD).code, 0);
    let again = runner.files();
    let recordings = |files: &BTreeMap<_, Vec<u8>>| {
        files
            .iter()
            .filter(|(path, _): &(&std::path::PathBuf, _)| {
                path.extension().is_some_and(|end| end == "mcap")
            })
            .map(|(path, bytes)| (path.clone(), bytes.clone()))
            .collect::<Vec<_>>()
    };
    assert_eq!(recordings(&first).len(), 4);
    assert!(
        recordings(&first) == recordings(&again),
        "the same seed records the same bytes"
    );
}

#[test]
fn a_run_without_a_recording_takes_an_older_one_away() {
    let runner = recorded();
    assert!(runner.path(ROVER).exists());
    assert_eq!(
        runner
            .run(&["sim", "small.sim.toml", "--no-pictures", "--out", "run"])
            .code,
        0
    );
    assert!(!runner.path("run/flight").exists());
}

#[test]
fn a_changed_input_is_named_with_what_came_of_it() {
    let runner = recorded();
    let mut which = 0;
    rewrite(
        &runner.path(ROVER),
        |_| {},
        |number, (topic, text)| {
            if topic == "/vehicle/1/vehicle/step"
                && which == 0
                && number > 40
                && text.contains("\"input\":{\"Telemetry\"")
            {
                let (input, output) = text.split_once(",\"outputs\":").unwrap();
                let at = input.find("\"battery\":").unwrap() + "\"battery\":".len();
                let rest = &input[at..];
                let end = rest.find([',', '}']).unwrap();
                *text = format!("{}0.125{},\"outputs\":{output}", &input[..at], &rest[end..]);
                which = number;
            }
            true
        },
    );
    let output = replay(&runner, "run/flight");
    assert_eq!(output.code, 1, "{output:?}");
    assert!(
        output.err.contains("the replay differs: 1 of 25 actors"),
        "{}",
        output.err
    );
    let lines: Vec<&str> = output.out.lines().collect();
    let first = lines
        .iter()
        .position(|line| line.contains("differs"))
        .unwrap();
    assert!(
        lines[first].starts_with("vehicle/1/vehicle ")
            && lines[first].contains(&format!(" {which} steps"))
    );
    assert!(
        lines[first + 1].contains(ROVER)
            && lines[first + 1].contains(&format!("step {which}, at "))
    );
    assert!(lines[first + 2].contains("input") && lines[first + 2].contains("0.125"));
    assert!(
        lines[first + 4].contains("outputs now") && !lines[first + 3].contains("\"battery\":0.125")
    );
    let only = runner.run(&["replay", "run/flight", "--actor", "mission"]);
    assert_eq!((only.code, only.out.lines().count()), (0, 2), "{only:?}");
    let json = runner.run(&["replay", ROVER, "--json"]);
    let value: serde_json::Value = serde_json::from_str(&json.out).unwrap();
    let vehicle = value["actors"]
        .as_array()
        .unwrap()
        .iter()
        .find(|actor| actor["identical"] == false)
        .unwrap();
    assert_eq!(
        (&vehicle["actor"], &vehicle["first_difference"]["step"]),
        (&"vehicle/1/vehicle".into(), &which.into())
    );
    assert_eq!(json.code, 1);
}

#[test]
fn a_file_that_was_cut_off_is_replayed_up_to_there() {
    let runner = recorded();
    let bytes = runner.read(ROVER);
    runner.write(ROVER, &bytes[..bytes.len() * 2 / 3]);
    let output = replay(&runner, ROVER);
    assert_eq!(output.code, 0, "{output:?}");
    assert!(
        output.err.contains("ends unfinished at byte")
            && output.err.contains("replayed up to there"),
        "{}",
        output.err
    );
    assert!(output.out.contains("identical"));
}

/// Returns a place in the middle of the largest chunk: what lies between chunks has no checksum, and is not read.
fn middle_of_a_chunk(bytes: &[u8]) -> usize {
    // Behind 8 bytes of magic come records: a byte that says which, 8 bytes of length, and what it holds.
    let (mut at, mut largest) = (8, 0..0);
    while let Some(length) = bytes.get(at + 1..at + 9) {
        let length = u64::from_le_bytes(length.try_into().unwrap()) as usize;
        if bytes[at] == 0x06 && length > largest.len() {
            largest = at + 9..at + 9 + length;
        }
        at += 9 + length;
    }
    assert!(!largest.is_empty());
    largest.start + largest.len() / 2
}

#[test]
fn what_is_no_recording_of_this_version_is_refused() {
    let runner = recorded();
    runner.write("text.mcap", "no recording");
    runner.refused(&["replay", "text.mcap"], &["text.mcap", "is no MCAP file"]);
    runner.write("empty.mcap", "");
    runner.refused(
        &["replay", "empty.mcap"],
        &["empty.mcap", "is no MCAP file"],
    );
    runner.refused(&["replay", "gone.mcap"], &["gone.mcap", "cannot be read"]);
    std::fs::create_dir(runner.path("nothing")).unwrap();
    runner.refused(&["replay", "nothing"], &["nothing", "holds no recording"]);
    let mut damaged = runner.read(ROVER);
    let middle = middle_of_a_chunk(&damaged);
    damaged[middle] ^= 0x55;
    runner.write("damaged.mcap", damaged);
    let output = replay(&runner, "damaged.mcap");
    assert_eq!(output.code, 2, "{output:?}");
    assert!(
        output.err.contains("damaged.mcap: is damaged before byte"),
        "{}",
        output.err
    );
    let copy = |name: &str| runner.write(name, runner.read(ROVER));
    copy("old.mcap");
    let older = |words: &mut BTreeMap<String, String>| {
        if let Some(version) = words.get_mut("software") {
            "0.0.9".clone_into(version);
        }
    };
    rewrite(&runner.path("old.mcap"), older, |_, _| true);
    runner.refused(
        &["replay", "old.mcap"],
        &["recorded by tomoswarm 0.0.9", "same version"],
    );
    copy("foreign.mcap");
    rewrite(
        &runner.path("foreign.mcap"),
        |words| words.clear(),
        |_, _| true,
    );
    runner.refused(
        &["replay", "foreign.mcap"],
        &["foreign.mcap", "recorded by tomoswarm unknown"],
    );
    copy("torn.mcap");
    rewrite(
        &runner.path("torn.mcap"),
        |_| {},
        |_, (topic, _)| topic != "/vehicle/1/map/snapshot",
    );
    let output = replay(&runner, "torn.mcap");
    assert_eq!(output.code, 2);
    assert!(
        output
            .err
            .contains("/vehicle/1/map/step comes without a snapshot before it"),
        "{}",
        output.err
    );
    copy("json.mcap");
    rewrite(
        &runner.path("json.mcap"),
        |_| {},
        |number, (topic, text)| {
            if topic == "/vehicle/1/radio/step" && number == 3 {
                "{\"now_ns\":\"soon\"}".clone_into(text);
            }
            true
        },
    );
    let output = replay(&runner, "json.mcap");
    assert_eq!(output.code, 2);
    assert!(
        output
            .err
            .contains("/vehicle/1/radio/step is no message of a recording"),
        "{}",
        output.err
    );
}

#[test]
fn an_actor_that_is_unknown_of_another_kind_or_of_an_older_shape_is_refused_by_name() {
    let runner = recorded();
    let rename = |name: &str, to: &'static str| {
        runner.write(name, runner.read(ROVER));
        rewrite(
            &runner.path(name),
            |_| {},
            |_, (topic, _)| {
                if topic == "/vehicle/1/map/snapshot" {
                    to.clone_into(topic);
                }
                true
            },
        );
    };
    rename("unknown.mcap", "/vehicle/1/compass/snapshot");
    runner.refused(
        &["replay", "unknown.mcap"],
        &["unknown.mcap", "/vehicle/1/compass/snapshot is of no actor"],
    );
    rename("ground.mcap", "/vehicle/1/station/snapshot");
    runner.refused(
        &["replay", "ground.mcap"],
        &["ground.mcap", "/vehicle/1/station/snapshot is of no actor"],
    );
    rename("kind.mcap", "/balloon/1/map/snapshot");
    runner.refused(
        &["replay", "kind.mcap"],
        &["kind.mcap", "/balloon/1/map/snapshot is of no actor"],
    );
    runner.write("older.mcap", runner.read(ROVER));
    rewrite(
        &runner.path("older.mcap"),
        |_| {},
        |_, (topic, text)| {
            if topic == "/vehicle/1/radio/snapshot" {
                // As if the actor had had only its first field.
                let (before, packed) = text.split_once("\"packed\":\"").unwrap();
                *text = format!("{before}\"packed\":\"{}\"}}", &packed[..4]);
            }
            true
        },
    );
    let expected = [
        "older.mcap",
        "/vehicle/1/radio/snapshot packed bytes cannot be read by this version",
    ];
    runner.refused(&["replay", "older.mcap"], &expected);
}
