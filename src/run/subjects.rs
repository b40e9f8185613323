//! What a node of the bus between processes subscribes to and writes under: key expressions, without the venue's prefix.
//! How a key is written is the wire's ([`tomoswarm_proto::Key`]); who hears and says what is
//! [`crate::exchange::table`]'s.
//!
//! In key expressions `*` is one part, `**` any number.

use tomoswarm_proto::{MessageKind, Sender, VehicleId};

use crate::exchange::table::{Audience, MessageRule, TABLE, VehicleSet};

/// Returns who hears a kind of message from one role.
type Hearers = fn(&MessageRule) -> Option<Audience>;

/// Those who say something, as patterns of keys.
const ROLES: [(&str, Hearers); 3] = [
    ("vehicle/*", |row| row.of_vehicle),
    ("ground", |row| row.of_ground),
    ("operator/*", |row| row.of_operator),
];

/// Returns the key expressions under which a node writes: all that begin with its own name.
pub fn written_by(node: Sender) -> Vec<String> {
    vec![format!("{}/**", node.prefix())]
}

/// Returns the key expressions that concern a node. Who hears all that some kind of sender says listens to everything
/// under that sender's keys, and so also counts what it does not know.
pub fn heard_by(node: Sender) -> Vec<String> {
    let heard = ROLES.map(|(role, audience)| (role, heard_of(node, role, audience)));
    if heard
        .iter()
        .all(|(role, keys)| *keys == [everything_of(role)])
    {
        return vec!["**".to_owned()];
    }
    heard.into_iter().flat_map(|(_, keys)| keys).collect()
}

/// Returns the key expressions under which a node hears those of one role.
fn heard_of(node: Sender, role: &str, audience: Hearers) -> Vec<String> {
    let on_the_bus = TABLE
        .iter()
        .filter_map(|row| audience(row).map(|audience| (row, audience)));
    let on_the_bus: Vec<_> = on_the_bus
        .filter(|(_, audience)| !audience.is_nobody())
        .collect();
    let pattern = |(row, audience): &(&MessageRule, Audience)| match node {
        Sender::Vehicle(id) => heard_by_vehicle(id, role, row, audience.vehicles),
        Sender::Ground => audience.ground.then(|| about_anything(role, row)),
        Sender::Operator(_) => audience.operators.then(|| about_anything(role, row)),
    };
    let heard: Vec<String> = on_the_bus.iter().filter_map(pattern).collect();
    let hears_all = !matches!(node, Sender::Vehicle(_)) && heard.len() == on_the_bus.len();
    if hears_all {
        vec![everything_of(role)]
    } else {
        heard
    }
}

/// Returns the key expression of all that one role says: `vehicle/**`, `ground/**`.
fn everything_of(role: &str) -> String {
    format!("{}/**", role.trim_end_matches("/*"))
}

fn heard_by_vehicle(
    id: VehicleId,
    role: &str,
    row: &MessageRule,
    vehicles: VehicleSet,
) -> Option<String> {
    match vehicles {
        VehicleSet::None => None,
        VehicleSet::Addressed => Some(format!("{role}/{}/{id}", row.kind)),
        VehicleSet::All => Some(about_anything(role, row)),
    }
}

fn about_anything(role: &str, row: &MessageRule) -> String {
    let tail = match row.kind {
        MessageKind::Hello
        | MessageKind::State
        | MessageKind::Digest
        | MessageKind::Mission
        | MessageKind::Samples
        | MessageKind::Have
        | MessageKind::Beacon
        | MessageKind::Health
        | MessageKind::Report
        | MessageKind::Standing
        | MessageKind::Look
        | MessageKind::Log
        | MessageKind::Settings => "",
        MessageKind::Plan
        | MessageKind::Order
        | MessageKind::Task
        | MessageKind::Fix
        | MessageKind::Mark => "/*",
        MessageKind::Tile | MessageKind::Want | MessageKind::Image => "/**",
    };
    format!("{role}/{}{tail}", row.kind)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::exchange::examples::examples;
    use crate::exchange::table::{may_say, row};
    use tomoswarm_proto::{Key, OperatorId, Topic};

    const OPERATOR: Sender = Sender::Operator(OperatorId(1));
    const NODES: [Sender; 5] = [
        Sender::Vehicle(VehicleId(2)),
        Sender::Vehicle(VehicleId(3)),
        Sender::Ground,
        OPERATOR,
        Sender::Operator(OperatorId(2)),
    ];

    fn key(sender: Sender, topic: Topic) -> String {
        Key { sender, topic }.to_string()
    }

    /// Returns whether a key expression covers a key.
    fn covers(expression: &str, key: &str) -> bool {
        let (first, rest) = expression.split_once('/').unwrap_or((expression, ""));
        let (part, others) = key.split_once('/').unwrap_or((key, ""));
        match (first, key.is_empty()) {
            ("**", _) => true,
            (_, true) => expression.is_empty(),
            ("*", false) => covers(rest, others),
            (word, false) => word == part && covers(rest, others),
        }
    }

    fn any_covers(expressions: &[String], key: &str) -> bool {
        expressions.iter().any(|expression| covers(expression, key))
    }

    #[test]
    fn a_vehicle_hears_orders_to_itself_alone() {
        let heard = heard_by(Sender::Vehicle(VehicleId(3)));
        assert!(
            heard.contains(&"ground/order/3".to_owned())
                && heard.contains(&"operator/*/order/3".to_owned())
        );
        assert!(
            !heard.iter().any(|key| key == "ground/**"
                || key.ends_with("order/*")
                || key.ends_with("samples"))
        );
    }

    #[test]
    fn the_subscriptions_of_each_kind_of_node_are_these() {
        let of_vehicle = [
            "ground/hello",
            "ground/have",
            "ground/digest",
            "ground/report",
            "ground/plan/*",
            "ground/tile/**",
            "ground/want/**",
            "vehicle/*/hello",
            "vehicle/*/state",
            "vehicle/*/mission",
            "vehicle/*/digest",
            "vehicle/*/tile/**",
            "vehicle/*/want/**",
            "ground/order/3",
            "operator/*/order/3",
            "operator/*/hello",
            "operator/*/want/**",
            "ground/standing",
            "vehicle/*/standing",
            "operator/*/standing",
            "operator/*/task/*",
            "operator/*/fix/3",
        ];
        let of_ground = [
            "vehicle/**",
            "ground/hello",
            "ground/report",
            "ground/standing",
            "operator/*/hello",
            "operator/*/want/**",
            "operator/*/standing",
            "operator/*/task/*",
            "operator/*/mark/*",
        ];
        let check = |node, expected: &[&str]| {
            let heard = heard_by(node);
            let distinct: BTreeSet<&str> = heard.iter().map(String::as_str).collect();
            assert_eq!(distinct, expected.iter().copied().collect());
            assert_eq!(distinct.len(), heard.len(), "nothing is heard twice");
        };
        check(Sender::Vehicle(VehicleId(3)), &of_vehicle);
        check(Sender::Ground, &of_ground);
        check(OPERATOR, &["**"]);
    }

    #[test]
    fn a_key_is_what_the_wire_says_it_is() {
        for (word, message) in examples() {
            for sender in NODES {
                let text = key(sender, Topic::of(&message));
                assert_eq!(text, Key::of(sender, &message).to_string(), "{word}");
                assert_eq!(Key::sender(&text), Some(sender));
            }
        }
    }

    #[test]
    fn a_node_subscribes_to_what_the_table_says_that_it_hears_and_to_no_more_of_what_may_be_said() {
        for (word, message) in examples() {
            let topic = Topic::of(&message);
            for (sender, node) in NODES
                .into_iter()
                .flat_map(|sender| NODES.map(|node| (sender, node)))
            {
                let Some(audience) = row(topic.kind)
                    .audience(sender)
                    .filter(|audience| !audience.is_nobody())
                else {
                    continue;
                };
                let is_heard = any_covers(&heard_by(node), &key(sender, topic));
                assert_eq!(
                    is_heard,
                    audience.includes(node, topic.about),
                    "{word} of {sender} by {node}"
                );
            }
        }
    }

    #[test]
    fn a_node_writes_under_its_own_keys_all_that_it_may_say_and_nothing_of_others() {
        for (_, message) in examples() {
            for (sender, node) in NODES
                .into_iter()
                .flat_map(|sender| NODES.map(|node| (sender, node)))
            {
                let key = key(sender, Topic::of(&message));
                let is_written = any_covers(&written_by(node), &key);
                assert!(
                    !may_say(sender, &message) || sender != node || is_written,
                    "{node}: {key}"
                );
                assert!(sender == node || !is_written, "{node} writes {key}");
            }
        }
    }
}
