//! What came over the bus as one JSON object, for those who do not read bincode; and which of it is wanted. Pure: the times
//! are told.

use std::collections::BTreeSet;

use serde_json::{Value, json};
use tomoswarm_proto::codec::Greeting;
use tomoswarm_proto::{Message, MessageKind, Sender, VehicleId};

use super::bus::HeardMessage;

/// Returns the kinds of messages as they are named on the command line and in the lines.
pub fn kinds() -> [&'static str; MessageKind::ALL.len()] {
    MessageKind::ALL.map(MessageKind::word)
}

/// What is wanted of all that is heard.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Tapping {
    /// Of these kinds only; empty = of all.
    pub kinds: BTreeSet<String>,
    /// From or for these vehicles only; empty = all, and what concerns no vehicle.
    pub vehicles: BTreeSet<VehicleId>,
    /// Whether tiles are written with their cells; otherwise their numbers are counted.
    pub with_cells: bool,
}

impl Tapping {
    /// Returns what was heard as an object if it is wanted; `received_s` counts from the tool's start, `utc_s` from 1970 by
    /// the clock of this machine.
    pub fn line(&self, received_s: f64, utc_s: f64, heard: &HeardMessage) -> Option<Value> {
        let (sender, kind, message) = match heard {
            HeardMessage::Message(sender, message) => {
                (*sender, message.word(), self.written(message))
            }
            HeardMessage::Greeting(greeting, Some(hello)) => (
                greeting.node,
                "hello",
                written(&Message::Hello(hello.clone())),
            ),
            HeardMessage::Greeting(greeting, None) => (greeting.node, "hello", foreign(greeting)),
            HeardMessage::Unknown(_) => return None,
        };
        let is_kind = self.kinds.is_empty() || self.kinds.contains(kind);
        let concerned = [of_sender(sender), addressee(heard)];
        let is_vehicle = self.vehicles.is_empty()
            || concerned
                .into_iter()
                .flatten()
                .any(|vehicle| self.vehicles.contains(&vehicle));
        (is_kind && is_vehicle).then(|| {
            json!({
                "received_s": thousandths(received_s),
                "utc_s": thousandths(utc_s),
                "sender": sender.prefix(),
                "kind": kind,
                "message": message,
            })
        })
    }

    fn written(&self, message: &Message) -> Value {
        let mut value = written(message);
        if let (Message::Tile(tile), false) = (message, self.with_cells) {
            let count =
                |wanted: fn(i8) -> bool| tile.cells.iter().filter(|cell| wanted(**cell)).count();
            value["cells"] = json!({
                "occupied": count(|cell| cell > 0),
                "free": count(|cell| cell < 0),
                "unknown": count(|cell| cell == 0),
            });
        }
        value
    }
}

/// Returns the fields of a message, without its kind around them.
fn written(message: &Message) -> Value {
    match serde_json::to_value(message) {
        Ok(Value::Object(named)) => named
            .into_iter()
            .next()
            .map_or(Value::Null, |(_, fields)| fields),
        Ok(_) | Err(_) => Value::Null,
    }
}

/// A greeting of which nothing more can be read.
fn foreign(greeting: &Greeting) -> Value {
    json!({
        "wire_version": greeting.version,
        "node": greeting.node,
        "boot": greeting.boot,
        "venue_hash": greeting.venue_hash,
    })
}

fn of_sender(sender: Sender) -> Option<VehicleId> {
    match sender {
        Sender::Vehicle(vehicle) => Some(vehicle),
        Sender::Ground | Sender::Operator(_) => None,
    }
}

/// Returns for which vehicle a message is.
fn addressee(heard: &HeardMessage) -> Option<VehicleId> {
    match heard {
        HeardMessage::Message(_, Message::Order(order)) => Some(order.vehicle),
        HeardMessage::Message(_, Message::Plan(plan)) => Some(plan.vehicle),
        HeardMessage::Message(_, Message::Fix(fix)) => Some(fix.vehicle),
        HeardMessage::Message(..) | HeardMessage::Greeting(..) | HeardMessage::Unknown(_) => None,
    }
}

fn thousandths(seconds_s: f64) -> f64 {
    (seconds_s * 1e3).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::tests_support::{heard, report, state};
    use tomoswarm_proto::{
        Boot, GroundReport, LayerId, Order, OrderKind, TILE_CELLS, TileAddress, TileReport,
    };

    fn line(tapping: &Tapping, message: Message) -> Option<Value> {
        tapping.line(1.0, 2.0, &heard(message))
    }

    #[test]
    fn a_line_says_when_who_what_and_all_fields() {
        let line = line(&Tapping::default(), Message::State(state(3))).unwrap();
        assert_eq!(line["sender"], "vehicle/3");
        assert_eq!(
            (&line["kind"], &line["received_s"], &line["utc_s"]),
            (&json!("state"), &json!(1.0), &json!(2.0))
        );
        assert_eq!(
            (
                &line["message"]["pose"]["at"]["x_mm"],
                &line["message"]["mode"]
            ),
            (&json!(3000), &json!("Idle"))
        );
    }

    #[test]
    fn what_is_not_asked_for_is_left_out() {
        let order = Message::Order(Order {
            vehicle: VehicleId(2),
            lease: Default::default(),
            run: Default::default(),
            revision: Default::default(),
            seen: None,
            kind: OrderKind::Hold,
            ends: vec![],
        });
        let states = Tapping {
            kinds: ["state".to_owned()].into(),
            ..Tapping::default()
        };
        assert!(
            line(&states, Message::State(state(1))).is_some()
                && line(&states, order.clone()).is_none()
        );
        let of_two = Tapping {
            vehicles: [VehicleId(2)].into(),
            ..Tapping::default()
        };
        assert!(
            line(&of_two, Message::State(state(2))).is_some() && line(&of_two, order).is_some()
        );
        let fix = Message::Fix(tomoswarm_proto::Fix {
            vehicle: VehicleId(2),
            at: Default::default(),
            heading: None,
            sd: Default::default(),
            age_ms: 0,
        });
        assert!(line(&of_two, fix).is_some());
        assert!(line(&of_two, Message::State(state(1))).is_none());
        assert!(line(&of_two, Message::Report(GroundReport { ..report() })).is_none());
    }

    #[test]
    fn tiles_are_counted_unless_their_cells_are_asked_for() {
        let mut cells = [0; TILE_CELLS];
        (cells[0], cells[1], cells[2]) = (9, -4, -4);
        let layer = LayerId {
            vehicle: VehicleId(1),
            boot: Boot(1),
        };
        let tile = Message::Tile(TileReport {
            layer,
            address: TileAddress::default(),
            revision: 1,
            cells: std::sync::Arc::new(cells),
        });
        let counted = line(&Tapping::default(), tile.clone()).unwrap();
        assert_eq!(
            counted["message"]["cells"],
            json!({"occupied": 1, "free": 2, "unknown": TILE_CELLS - 3})
        );
        let whole = line(
            &Tapping {
                with_cells: true,
                ..Tapping::default()
            },
            tile,
        )
        .unwrap();
        let runs = whole["message"]["cells"].as_array().unwrap();
        assert_eq!(
            runs.iter().map(|run| run[0].as_u64().unwrap()).sum::<u64>(),
            TILE_CELLS as u64
        );
    }

    #[test]
    fn a_greeting_of_another_version_is_told_as_far_as_it_can_be_read() {
        let node = Sender::Vehicle(VehicleId(3));
        let greeting = Greeting {
            version: 9,
            node,
            boot: Boot(2),
            venue_hash: 5,
        };
        let line = Tapping::default()
            .line(0.0, 0.0, &HeardMessage::Greeting(greeting, None))
            .unwrap();
        assert_eq!(
            (&line["kind"], &line["message"]["wire_version"]),
            (&json!("hello"), &json!(9))
        );
    }

    #[test]
    fn every_kind_can_be_asked_for() {
        assert!(kinds().contains(&Message::Report(report()).word()));
        assert_eq!(kinds().len(), 21);
    }
}
