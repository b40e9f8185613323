//! The table against the messages themselves and against what proto/README.md promises to others.

use tomoswarm_proto::{
    MessageSubject, MissionProgress, OperatorId, Order, OrderKind, Topic, VehicleId,
};

use super::super::examples::examples;
use super::*;

const README: &str = include_str!("../../../proto/README.md");
const OPERATOR: Sender = Sender::Operator(OperatorId(1));
const ROLES: [Sender; 3] = [Sender::Vehicle(VehicleId(2)), Sender::Ground, OPERATOR];

#[test]
fn every_message_has_its_row_under_its_own_word() {
    assert_eq!(MessageKind::ALL, TABLE.map(|row| row.kind));
    for (word, message) in examples() {
        let (topic, row) = (Topic::of(&message), row(message.kind()));
        assert_eq!((row.kind, row.kind.word()), (message.kind(), word));
        let addresses = [row.of_vehicle, row.of_ground, row.of_operator]
            .into_iter()
            .flatten()
            .any(|audience| audience.vehicles == VehicleSet::Addressed);
        let names_one = matches!(topic.about, MessageSubject::Vehicle(_));
        assert!(
            !addresses || names_one,
            "{word} is for a vehicle that it does not name"
        );
    }
}

#[test]
fn a_sender_may_say_what_its_row_allows_and_only_in_its_own_name() {
    for (word, message) in examples() {
        let allowed: Vec<Sender> = ROLES
            .into_iter()
            .filter(|role| may_say(*role, &message))
            .collect();
        let expected: &[Sender] = match word {
            "tile" | "digest" | "want" | "standing" => &ROLES,
            "order" | "mark" => &ROLES[1..],
            "task" | "fix" => &ROLES[2..],
            "plan" | "have" | "report" | "image" => &ROLES[1..2],
            // The example is of vehicle 2.
            _ => &ROLES[..1],
        };
        assert_eq!(allowed, expected, "{word}");
    }
    let of_three = Message::Mission(MissionProgress {
        vehicle: VehicleId(3),
        ..MissionProgress::default()
    });
    assert!(ROLES.iter().all(|role| !may_say(*role, &of_three)));
}

#[test]
fn who_may_say_a_kind_is_who_its_author_may_be() {
    // These say who they are of, and more than one role may say them.
    let of_several = ["hello", "log", "settings"];
    let examples = examples().into_iter();
    for (word, message) in examples.filter(|(word, _)| !of_several.contains(word)) {
        let Some(author) = message.author() else {
            continue;
        };
        for role in ROLES {
            let may = row(message.kind()).audience(role).is_some();
            assert_eq!(may, role == author, "{word} of {role}");
        }
    }
}

#[test]
fn an_order_is_heard_by_its_vehicle_alone_and_by_operators() {
    let about = Topic::of(&Message::Order(Order {
        vehicle: VehicleId(3),
        lease: Default::default(),
        run: Default::default(),
        revision: Default::default(),
        seen: None,
        kind: OrderKind::Hold,
        ends: vec![],
    }))
    .about;
    let audience = row(MessageKind::Order).audience(Sender::Ground).unwrap();
    let hears = |node| audience.includes(node, about);
    assert!(hears(Sender::Vehicle(VehicleId(3))) && hears(OPERATOR));
    assert!(!hears(Sender::Vehicle(VehicleId(2))) && !hears(Sender::Ground));
}

#[test]
fn what_can_be_said_on_the_bus_is_heard_by_operators() {
    for row in TABLE
        .into_iter()
        .filter(|row| row.kind != MessageKind::Beacon)
    {
        for audience in ROLES.into_iter().filter_map(|role| row.audience(role)) {
            assert!(audience.operators, "{}", row.kind);
        }
    }
}

/// Returns the senders that a cell of the README's table names.
fn senders(cell: &str) -> Vec<Sender> {
    match cell {
        "everyone" => ROLES.to_vec(),
        "vehicle" | "by radio only, vehicle" => vec![ROLES[0]],
        "ground" => vec![Sender::Ground],
        "operator" => vec![OPERATOR],
        "ground or operator" => vec![Sender::Ground, OPERATOR],
        "vehicle or ground" => vec![ROLES[0], Sender::Ground],
        other => panic!("{other} says something?"),
    }
}

/// Returns which vehicles, and whether ground stations, hear what a cell of the README's table names. Operators hear
/// everything on the bus.
fn receivers(cell: &str) -> (VehicleSet, bool) {
    match cell {
        "all" | "all, whatever their venue" | "ground, vehicles and operators" => {
            (VehicleSet::All, true)
        }
        "vehicles" | "vehicles and operators" => (VehicleSet::All, false),
        "the vehicle" => (VehicleSet::Addressed, false),
        "ground" | "ground and operators" => (VehicleSet::None, true),
        "whoever hears it" | "operators" => (VehicleSet::None, false),
        other => panic!("{other} hears something?"),
    }
}

fn priority(cell: &str) -> Option<Urgency> {
    match cell {
        "real-time, express" => Some(Urgency::Urgent),
        "high" => Some(Urgency::High),
        "normal" => Some(Urgency::Normal),
        "low" => Some(Urgency::Low),
        "none" => None,
        other => panic!("{other} is no priority"),
    }
}

#[test]
fn the_readme_of_the_wire_says_the_same() {
    let lines = README
        .lines()
        .skip_while(|line| !line.starts_with("| kind | message | sender"));
    let lines: Vec<&str> = lines
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .collect();
    assert_eq!(lines.len(), TABLE.len());
    for (row, line) in TABLE.iter().zip(lines) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        assert_eq!(cells[2].to_lowercase(), row.kind.word());
        assert_eq!(
            cells[5].trim_matches('`').split('/').next(),
            Some(row.kind.word()),
            "{line}"
        );
        // What follows a semicolon is about answers: those come from whoever holds the map.
        let (from, to) = cells[3]
            .split(';')
            .next()
            .unwrap()
            .split_once(" → ")
            .unwrap();
        let mut says: Vec<Sender> = ROLES
            .into_iter()
            .filter(|role| row.audience(*role).is_some())
            .collect();
        if cells[3].ends_with("; answers: whoever holds it") {
            assert_eq!(says, ROLES);
            says.truncate(1);
        }
        assert_eq!(says, senders(from), "{line}");
        let heard = says.iter().filter_map(|role| row.audience(*role));
        let widest = heard.fold((VehicleSet::None, false), |(vehicles, ground), audience| {
            let wider = if audience.vehicles == VehicleSet::None {
                vehicles
            } else {
                audience.vehicles
            };
            (wider, ground || audience.ground)
        });
        assert_eq!(widest, receivers(to), "{line}");
        assert_eq!(
            priority(cells[6]).unwrap_or(Urgency::Low),
            row.class,
            "{line}"
        );
    }
}
