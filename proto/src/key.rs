//! Under which key a message is published: `tomoswarm/<venue>/<sender>/<kind>[/…]`.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{Message, VehicleId};

/// Who publishes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
pub enum Sender {
    /// The ground station.
    Ground,
    /// A vehicle.
    Vehicle(VehicleId),
    /// An operator's tool, beside the ground station.
    Operator,
}

impl Sender {
    /// Gives the part of the key that belongs to this sender alone: `ground`, `vehicle/3` or `operator`.
    pub fn prefix(self) -> String {
        match self {
            Sender::Ground => "ground".to_owned(),
            Sender::Vehicle(vehicle) => format!("vehicle/{vehicle}"),
            Sender::Operator => "operator".to_owned(),
        }
    }
}

impl fmt::Display for Sender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Sender::Ground => f.write_str("the ground station"),
            Sender::Vehicle(vehicle) => write!(f, "vehicle {vehicle}"),
            Sender::Operator => f.write_str("an operator"),
        }
    }
}

/// A key expression, without the venue's prefix.
///
/// A vehicle writes only under its own number, which is what access control can be hung on. Tiles
/// and plans end in what they are about, so that a later one replaces an earlier one of its kind.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Key(String);

impl Key {
    /// Gives the key of a message.
    pub fn of(sender: Sender, message: &Message) -> Key {
        let who = sender.prefix();
        let what = message.word();
        let about = match message {
            Message::Tile(tile) => {
                let (layer, at) = (tile.layer, tile.address);
                format!("/{}/{}/{}/{}/{}", layer.vehicle, layer.boot, at.slice, at.x, at.y)
            }
            Message::Want(want) => format!("/{}/{}", want.layer.vehicle, want.layer.boot),
            Message::Plan(plan) => format!("/{}", plan.vehicle),
            Message::Order(order) => format!("/{}", order.vehicle),
            Message::Hello(_)
            | Message::State(_)
            | Message::Digest(_)
            | Message::Progress(_)
            | Message::Samples(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Health(_)
            | Message::Report(_) => String::new(),
        };
        Key(format!("{who}/{what}{about}"))
    }

    /// Gives who wrote under a key (without the venue's prefix); `None` when no sender has such a key.
    pub fn sender(key: &str) -> Option<Sender> {
        let mut parts = key.split('/');
        match (parts.next()?, parts.next()?) {
            ("ground", _) => Some(Sender::Ground),
            ("operator", _) => Some(Sender::Operator),
            ("vehicle", number) => {
                parts.next()?;
                let id = number.parse().ok().filter(|id: &u8| id.to_string() == number)?;
                Some(Sender::Vehicle(VehicleId(id)))
            }
            _ => None,
        }
    }

    /// Gives the key as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Digest, Progress};

    #[test]
    fn a_vehicle_writes_only_under_its_own_number() {
        let key = Key::of(Sender::Vehicle(VehicleId(3)), &Message::Progress(Progress::default()));
        assert_eq!(key.as_str(), "vehicle/3/progress");
        assert_eq!(Key::of(Sender::Ground, &Message::Digest(Digest::default())).as_str(), "ground/digest");
    }

    #[test]
    fn a_key_tells_who_wrote_under_it() {
        for sender in
            [Sender::Ground, Sender::Operator, Sender::Vehicle(VehicleId(0)), Sender::Vehicle(VehicleId(255))]
        {
            let key = Key::of(sender, &Message::Digest(Digest::default()));
            assert_eq!(Key::sender(key.as_str()), Some(sender));
        }
        for foreign in
            ["", "ground", "vehicle/3", "vehicle/300/state", "vehicle/03/state", "vehicle/+3/state", "x/y"]
        {
            assert_eq!(Key::sender(foreign), None, "{foreign}");
        }
    }
}
