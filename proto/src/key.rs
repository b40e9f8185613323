//! Under which key a message is published: `tomoswarm/<venue>/<sender>/<kind>[/…]`.
//!
//! Inside a program a key is a value that is compared and copied. It becomes text by `Display`, where a transport wants
//! text, and nowhere else. Key expressions with wildcards, and who hears what, are not known here.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{LayerId, Message, MessageKind, OperatorId, RunId, TileAddress, VehicleId};

/// Who publishes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
pub enum Sender {
    /// The ground station.
    Ground,
    /// A vehicle.
    Vehicle(VehicleId),
    /// An operator, beside the ground station.
    Operator(OperatorId),
}

impl Sender {
    /// Returns the part of the key that belongs to this sender alone: `ground`, `vehicle/3` or `operator/1`.
    pub fn prefix(self) -> String {
        Prefix(self).to_string()
    }
}

impl fmt::Display for Sender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Sender::Ground => f.write_str("the ground station"),
            Sender::Vehicle(vehicle) => write!(f, "vehicle {vehicle}"),
            Sender::Operator(operator) => write!(f, "operator {operator}"),
        }
    }
}

/// A sender as the beginning of a key.
struct Prefix(Sender);

impl fmt::Display for Prefix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Sender::Ground => f.write_str("ground"),
            Sender::Vehicle(vehicle) => write!(f, "vehicle/{vehicle}"),
            Sender::Operator(operator) => write!(f, "operator/{operator}"),
        }
    }
}

/// What a message is about, as far as messages of one kind and sender do not replace each other.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum MessageSubject {
    /// The sender itself, or everything that it knows: the newest message replaces all before.
    Whole,
    /// A vehicle.
    Vehicle(VehicleId),
    /// A run.
    Run(RunId),
    /// A layer of the map.
    Layer(LayerId),
    /// A tile of a layer.
    Tile(LayerId, TileAddress),
    /// A part of a run's image.
    Part(RunId, u16),
}

/// The kind of a message and what it is about: a later message of one sender and topic replaces an earlier one.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Topic {
    /// The kind of message.
    pub kind: MessageKind,
    /// What it is about.
    pub about: MessageSubject,
}

impl Topic {
    /// Returns the topic of a message.
    pub fn of(message: &Message) -> Topic {
        let about = match message {
            Message::Tile(tile) => MessageSubject::Tile(tile.layer, tile.address),
            Message::Want(want) => MessageSubject::Layer(want.layer),
            Message::Plan(plan) => MessageSubject::Vehicle(plan.vehicle),
            Message::Order(order) => MessageSubject::Vehicle(order.vehicle),
            Message::Fix(fix) => MessageSubject::Vehicle(fix.vehicle),
            Message::Task(task) => MessageSubject::Run(task.run),
            Message::Mark(mark) => MessageSubject::Run(mark.run),
            Message::Image(image) => MessageSubject::Part(image.run, image.part),
            Message::Hello(_)
            | Message::State(_)
            | Message::Digest(_)
            | Message::Mission(_)
            | Message::Samples(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Health(_)
            | Message::Report(_)
            | Message::Standing(_)
            | Message::Look(_)
            | Message::Log(_)
            | Message::Settings(_) => MessageSubject::Whole,
        };
        Topic {
            kind: message.kind(),
            about,
        }
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = self.kind;
        match self.about {
            MessageSubject::Whole => write!(f, "{kind}"),
            MessageSubject::Vehicle(vehicle) => write!(f, "{kind}/{vehicle}"),
            MessageSubject::Run(run) => write!(f, "{kind}/{run}"),
            MessageSubject::Layer(layer) => write!(f, "{kind}/{}/{}", layer.vehicle, layer.boot),
            MessageSubject::Tile(layer, at) => {
                write!(
                    f,
                    "{kind}/{}/{}/{}/{}/{}",
                    layer.vehicle, layer.boot, at.slice, at.x, at.y
                )
            }
            MessageSubject::Part(run, part) => write!(f, "{kind}/{run}/{part}"),
        }
    }
}

/// A key, without the venue's prefix. A node writes only under its own prefix, which is what access control can be
/// hung on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Key {
    /// Who publishes.
    pub sender: Sender,
    /// What it is.
    pub topic: Topic,
}

impl Key {
    /// Returns the key of a message.
    pub fn of(sender: Sender, message: &Message) -> Key {
        Key {
            sender,
            topic: Topic::of(message),
        }
    }

    /// Returns who wrote under a key (as text, without the venue's prefix); `None` when no sender has such a key. Keys
    /// of kinds that this version does not know have a sender like all others.
    pub fn sender(key: &str) -> Option<Sender> {
        let mut parts = key.split('/');
        let sender = match parts.next()? {
            "ground" => Sender::Ground,
            "vehicle" => Sender::Vehicle(VehicleId(number(parts.next()?)?)),
            "operator" => Sender::Operator(OperatorId(number(parts.next()?)?)),
            _ => return None,
        };
        parts.next().map(|_| sender)
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", Prefix(self.sender), self.topic)
    }
}

/// Returns a number written the only way it is: without sign or leading zeros.
fn number(text: &str) -> Option<u8> {
    text.parse()
        .ok()
        .filter(|number: &u8| number.to_string() == text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Boot, Digest, MissionProgress};

    #[test]
    fn a_vehicle_writes_only_under_its_own_number() {
        let key = Key::of(
            Sender::Vehicle(VehicleId(3)),
            &Message::Mission(MissionProgress::default()),
        );
        assert_eq!(key.to_string(), "vehicle/3/mission");
        let digest = Message::Digest(Digest::default());
        assert_eq!(
            Key::of(Sender::Ground, &digest).to_string(),
            "ground/digest"
        );
        assert_eq!(
            Key::of(Sender::Operator(OperatorId(7)), &digest).to_string(),
            "operator/7/digest"
        );
    }

    #[test]
    fn a_key_tells_who_wrote_under_it() {
        for sender in [
            Sender::Ground,
            Sender::Operator(OperatorId(0)),
            Sender::Operator(OperatorId(255)),
            Sender::Vehicle(VehicleId(0)),
            Sender::Vehicle(VehicleId(255)),
        ] {
            let key = Key::of(sender, &Message::Digest(Digest::default()));
            assert_eq!(Key::sender(&key.to_string()), Some(sender));
        }
        for foreign in [
            "",
            "ground",
            "vehicle/3",
            "vehicle/300/state",
            "vehicle/03/state",
            "vehicle/+3/state",
            "operator/1",
            "operator/01/order/2",
            "x/y",
        ] {
            assert_eq!(Key::sender(foreign), None, "{foreign}");
        }
    }

    #[test]
    fn an_operator_without_a_number_is_no_sender() {
        assert_eq!(Key::sender("operator/hello"), None);
        assert_eq!(Key::sender("operator/order/2"), None);
    }

    #[test]
    fn a_key_of_an_unknown_kind_has_a_sender() {
        assert_eq!(
            Key::sender("vehicle/3/fix/7"),
            Some(Sender::Vehicle(VehicleId(3)))
        );
    }

    #[test]
    fn topics_are_written_as_documented() {
        let layer = LayerId {
            vehicle: VehicleId(2),
            boot: Boot(70_000),
        };
        let at = TileAddress {
            slice: -1,
            x: -300,
            y: 4,
        };
        let check =
            |kind, about, expected: &str| assert_eq!(Topic { kind, about }.to_string(), expected);
        check(
            MessageKind::Tile,
            MessageSubject::Tile(layer, at),
            "tile/2/70000/-1/-300/4",
        );
        check(
            MessageKind::Want,
            MessageSubject::Layer(layer),
            "want/2/70000",
        );
        check(
            MessageKind::Order,
            MessageSubject::Vehicle(VehicleId(3)),
            "order/3",
        );
        check(MessageKind::Task, MessageSubject::Run(RunId(9)), "task/9");
        check(MessageKind::Mark, MessageSubject::Run(RunId(9)), "mark/9");
        check(
            MessageKind::Fix,
            MessageSubject::Vehicle(VehicleId(3)),
            "fix/3",
        );
        check(
            MessageKind::Image,
            MessageSubject::Part(RunId(9), 12),
            "image/9/12",
        );
        check(MessageKind::Standing, MessageSubject::Whole, "standing");
    }
}
