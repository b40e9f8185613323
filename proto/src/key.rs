//! Under which key a message is published: `tomoswarm/<venue>/<sender>/<kind>[/…]`.

use crate::{Message, VehicleId};

/// Who publishes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Sender {
    /// The ground station.
    Ground,
    /// A vehicle.
    Vehicle(VehicleId),
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
        let who = match sender {
            Sender::Ground => "ground".to_owned(),
            Sender::Vehicle(vehicle) => format!("vehicle/{vehicle}"),
        };
        let what = match message {
            Message::Hello(_) => "hello".to_owned(),
            Message::State(_) => "state".to_owned(),
            Message::Tile(tile) => {
                let (layer, at) = (tile.layer, tile.address);
                format!("tile/{}/{}/{}/{}/{}", layer.vehicle, layer.boot, at.slice, at.x, at.y)
            }
            Message::Digest(_) => "digest".to_owned(),
            Message::Want(want) => format!("want/{}/{}", want.layer.vehicle, want.layer.boot),
            Message::Plan(plan) => format!("plan/{}", plan.vehicle),
            Message::Progress(_) => "progress".to_owned(),
            Message::Order(order) => format!("order/{}", order.vehicle),
            Message::Samples(_) => "samples".to_owned(),
            Message::Have(_) => "have".to_owned(),
            Message::Beacon(_) => "beacon".to_owned(),
        };
        Key(format!("{who}/{what}"))
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
}
