//! How long frames are. The table in README.md names the bytes of every example and of the longest message that may be;
//! the figures that the design counts on are asserted here. Run with `--nocapture` to see what was measured.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

mod any;
mod examples;
mod extremes;

use std::path::Path;

use any::{beacon, message};
use examples::{examples, samples, variants};
use extremes::extremes;
use proptest::prelude::*;
use tomoswarm_proto::codec::{Decoded, LIMIT, decode, encode};
use tomoswarm_proto::*;

/// What an encrypted packet of the smallest module carries.
const ENCRYPTED_MAX: usize = 95;

fn bytes(message: &Message) -> usize {
    encode(message).unwrap().len()
}

/// The bytes of an example or a variant.
fn named(name: &str) -> usize {
    let all = || examples().into_iter().chain(variants());
    let (_, message) = all().find(|(other, _)| *other == name).unwrap();
    let length = bytes(&message);
    println!("{name}: {length} bytes");
    length
}

fn extreme(kind: MessageKind) -> usize {
    let message = extremes()
        .into_iter()
        .find(|message| message.kind() == kind)
        .unwrap();
    let length = bytes(&message);
    println!("{kind} at its extremes: {length} bytes");
    length
}

#[test]
fn the_longest_messages_may_be_handed_to_an_actor() {
    let messages = extremes();
    let kinds: Vec<MessageKind> = messages.iter().map(Message::kind).collect();
    assert_eq!(kinds, MessageKind::ALL);
    for message in messages {
        let kind = message.kind();
        let frame = encode(&message).unwrap();
        match decode(&frame) {
            Ok(decoded) => assert!(decoded == Decoded::Message(message), "{kind}"),
            Err(error) => panic!("{kind} of {} bytes: {error}", frame.len()),
        }
    }
}

/// The bytes of every example and of the longest message of its kind, as the table has them.
fn measured() -> Vec<(&'static str, MessageKind, String)> {
    let measure = |((name, message), longest): ((&'static str, Message), Message)| {
        // A plan that has all it may have is longer than a frame.
        let longest = if message.kind() == MessageKind::Plan {
            LIMIT
        } else {
            bytes(&longest)
        };
        println!("{name}: {} bytes; at most {longest}", bytes(&message));
        (
            name,
            message.kind(),
            format!("{}; {longest}", bytes(&message)),
        )
    };
    examples()
        .into_iter()
        .zip(extremes())
        .map(measure)
        .collect()
}

#[test]
fn the_table_of_messages_names_every_kind_and_the_bytes_of_its_example() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let text = std::fs::read_to_string(path).unwrap();
    for (name, kind, measured) in measured() {
        let is_its_row = |line: &&str| {
            line.starts_with(&format!("| {} | ", kind.number())) && line.contains(" → ")
        };
        let row = text
            .lines()
            .find(is_its_row)
            .unwrap_or_else(|| panic!("{name} is not in the table"));
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        assert_eq!(cells[2].to_lowercase(), name);
        assert!(
            cells[5].starts_with(&format!("`{name}")),
            "{name}: {}",
            cells[5]
        );
        assert_eq!(cells[7], measured, "{name}");
    }
}

#[test]
fn the_table_of_parts_says_what_is_measured() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let text = std::fs::read_to_string(path).unwrap();
    let check = |part: &str, expected: String| {
        println!("{part}: {expected} bytes");
        let row = text
            .lines()
            .find(|line| line.starts_with(&format!("| {part}")));
        let row = row.unwrap_or_else(|| panic!("{part} is not in the table"));
        assert_eq!(
            row.split('|')
                .nth(2)
                .unwrap()
                .split('(')
                .next()
                .unwrap()
                .trim(),
            expected,
            "{part}"
        );
    };
    let longest = |count| Message::Samples(extremes::samples(count));
    let (sample, longest_sample) = (grows(&batch(1), &batch(2)), grows(&longest(2), &longest(3)));
    check("a sample", format!("{sample}; {longest_sample}"));
    let full = bytes(&Message::Beacon(full_beacon()));
    check(
        "a beacon",
        format!(
            "{}; {full}; {}",
            named("beacon"),
            extreme(MessageKind::Beacon)
        ),
    );
    check(
        "a state",
        format!("{}; {}", named("state"), named("state-on-a-leg")),
    );
    check("a task", bytes(&Message::Task(long_task())).to_string());
    let parts: usize = (0..14)
        .map(|part| bytes(&Message::Image(part_of_200(part))))
        .sum();
    check("an image", format!("{}; {parts}", named("image")));
}

fn example<T>(pick: fn(Message) -> Option<T>) -> T {
    examples()
        .into_iter()
        .find_map(|(_, message)| pick(message))
        .unwrap()
}

/// Samples of a yard, an hour after the start.
fn batch(count: usize) -> Message {
    let sample = Sample {
        heard_at_ns: 3_600_000_000_000,
        ..samples(Some(-71)).samples[0]
    };
    Message::Samples(Samples {
        samples: vec![sample; count],
        ..Samples::default()
    })
}

/// A beacon of a yard with all that it may hold.
fn full_beacon() -> Beacon {
    let stop = EmergencyStop {
        name: EmergencyName(u32::MAX),
        scope: StopScope::One(VehicleId(255)),
        by: OperatorId(255),
    };
    Beacon {
        members: (1..=12).map(VehicleId).collect(),
        sequence: u32::MAX,
        boot: Boot(60_000),
        stop: Some(stop),
        tag: Some(BeaconTag([255; 4])),
        ..example(|message| {
            if let Message::Beacon(beacon) = message {
                Some(beacon)
            } else {
                None
            }
        })
    }
}

/// A task of as many places as one may have, in a yard.
fn long_task() -> Task {
    let place = |at: i32| Position {
        x_mm: 30 * at,
        y_mm: -32 * at,
        z_mm: 0,
    };
    Task {
        members: vec![VehicleId(1)],
        ..extremes::task((1..=1000).map(place).collect())
    }
}

/// A part of an image of 200 × 200 pixels.
fn part_of_200(part: u16) -> Image {
    let image = example(|message| {
        if let Message::Image(image) = message {
            Some(image)
        } else {
            None
        }
    });
    let here = (40_000 - usize::from(part) * IMAGE_PART_PIXELS).min(IMAGE_PART_PIXELS);
    let finds = if part == 0 {
        image.finds.clone()
    } else {
        vec![]
    };
    let (mean, deviation) = (vec![-1; here], Some(vec![1; here]));
    Image {
        columns: 200,
        rows: 200,
        part,
        parts: 14,
        mean,
        deviation,
        finds,
        ..image
    }
}

/// The bytes by which a second of something makes a message longer.
fn grows(one: &Message, two: &Message) -> usize {
    bytes(two) - bytes(one)
}

#[test]
fn a_pose_has_11_bytes_in_a_yard() {
    let beacon = |pose| {
        Message::Beacon(Beacon {
            pose,
            ..Beacon::default()
        })
    };
    assert_eq!(grows(&beacon(None), &beacon(Some(examples::pose()))), 11);
    let far = PoseReport {
        at: Position {
            x_mm: 32_767,
            y_mm: -32_768,
            z_mm: 0,
        },
        heading: Heading::LAST,
        sd: Deviation(250),
    };
    assert_eq!(grows(&beacon(None), &beacon(Some(far))), 11);
}

#[test]
fn a_sample_has_39_bytes_in_a_yard() {
    assert_eq!(grows(&batch(1), &batch(2)), 39);
}

#[test]
fn an_image_of_many_parts_is_one_that_may_be_sent() {
    for part in 0..14 {
        assert_eq!(
            Message::Image(part_of_200(part)).check(),
            Ok(()),
            "part {part}"
        );
    }
}

#[test]
fn a_beacon_fits_into_a_packet_at_its_extremes() {
    assert!(named("beacon") <= 47);
    let full = Message::Beacon(full_beacon());
    println!("a full beacon in a yard: {} bytes", bytes(&full));
    assert!(bytes(&full) <= 85);
    const { assert!(ENCRYPTED_MAX <= BEACON_BYTES_MAX) };
    assert!(extreme(MessageKind::Beacon) <= ENCRYPTED_MAX);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]
    #[test]
    fn no_message_is_longer_than_the_longest_of_its_kind(message in message()) {
        let longest = extremes().into_iter().find(|longest| longest.kind() == message.kind()).unwrap();
        prop_assert!(bytes(&message) <= bytes(&longest));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, ..ProptestConfig::default() })]
    #[test]
    fn any_beacon_fits_into_an_encrypted_packet(beacon in beacon()) {
        prop_assert!(bytes(&Message::Beacon(beacon)) <= ENCRYPTED_MAX);
    }
}

#[test]
fn a_hello_has_60_to_120_bytes() {
    assert!((60..=120).contains(&named("hello")));
    assert!((60..=120).contains(&named("hello-operator")));
    assert!((60..=120).contains(&named("hello-ground")));
}

#[test]
fn a_state_has_70_bytes_and_95_on_a_leg() {
    assert!(named("state") <= 70);
    assert!(named("state-on-a-leg") <= 95);
    assert!(named("state-stopped") <= 70);
}

#[test]
fn a_mission_has_30_bytes_and_an_order_25() {
    assert!(named("mission") <= 35);
    assert!(named("order") <= 25);
    assert!(extreme(MessageKind::Mission) <= 100);
}

#[test]
fn health_and_report_have_at_most_300_bytes() {
    assert!((30..=300).contains(&named("health")));
    assert!((80..=300).contains(&named("report")));
    let runs = (0..16).map(|run| RunReport {
        run: RunId(run),
        samples: 70_000,
        images: 12,
        ..RunReport::default()
    });
    let full = GroundReport {
        members: (1..=25).map(VehicleId).collect(),
        expected: (1..=25).map(VehicleId).collect(),
        runs: runs.collect(),
        ..GroundReport::default()
    };
    let length = bytes(&Message::Report(full));
    println!("a report of 25 vehicles and 16 runs: {length} bytes");
    assert!(length <= 300);
}

#[test]
fn what_stands_has_7_bytes_and_more_by_its_stops() {
    let none = bytes(&Message::Standing(OpenStops::default()));
    println!("a standing of nothing: {none} bytes");
    assert!(none <= 7);
    assert!(named("standing") <= 150);
    assert!(extreme(MessageKind::Standing) <= 500);
}

#[test]
fn a_task_of_1000_places_in_a_yard_has_under_9_kb() {
    assert!(named("task") <= 40);
    let task = long_task();
    println!(
        "a task of 1000 places: {} bytes",
        bytes(&Message::Task(task.clone()))
    );
    assert!(bytes(&Message::Task(task)) <= 9000);
}

#[test]
fn a_part_of_an_image_has_at_most_8_kb() {
    let length = named("image");
    assert!((3200..=3400).contains(&length));
    assert!(extreme(MessageKind::Image) <= 8 * 1024);
}
