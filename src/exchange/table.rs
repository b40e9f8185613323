//! Who says what, who hears it, how much it presses, and what replaces it: one row for each kind of message. The simulated
//! bus, the subscriptions and access rules of the live one, the judge of what comes and the queue of what goes all read
//! this table, and nothing else says who hears whom between nodes.
//!
//! It says nothing about what is in a message, and names no key as text: a bus that has keys writes them itself.

use tomoswarm_proto::{LayerId, Message, Sender, TileAddress, VehicleId};

/// A kind of message.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
#[allow(missing_docs, reason = "each is named by the message that it is the kind of")]
pub enum Kind {
    Hello,
    State,
    Tile,
    Digest,
    Want,
    Plan,
    Progress,
    Order,
    Samples,
    Have,
    Beacon,
    Health,
    Report,
}

/// How much a message presses; the lower goes first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Class {
    /// Orders and greetings: never waits.
    Urgent,
    /// Where somebody is and how far, and what others decide by when it is missing.
    High,
    /// The map, and how a vehicle fares.
    Normal,
    /// Samples: they are many, and are repeated until the ground has them.
    Low,
}

/// Which vehicles hear something.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Vehicles {
    /// None of them.
    None,
    /// The one that it is about.
    Addressed,
    /// All of them.
    All,
}

/// Who hears something; never its own sender.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Audience {
    /// Which vehicles.
    pub vehicles: Vehicles,
    /// Whether ground stations do.
    pub ground: bool,
    /// Whether operators do.
    pub operators: bool,
}

/// What the messages of a kind are about, beside their sender.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Topic {
    /// The sender itself.
    Sender,
    /// A vehicle.
    Vehicle,
    /// A layer of the map.
    Layer,
    /// A tile of a layer.
    Tile,
}

/// What a message is about, beside its sender.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum About {
    /// The sender itself.
    Sender,
    /// A vehicle.
    Vehicle(VehicleId),
    /// A layer of the map.
    Layer(LayerId),
    /// A tile of a layer.
    Tile(LayerId, TileAddress),
}

/// What a message is and what it is about: what tells apart the messages of one sender. With the sender it is the key
/// under which a message is published.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Subject {
    /// Its kind.
    pub kind: Kind,
    /// What it is about.
    pub about: About,
}

/// What holds for all messages of one kind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Row {
    /// The kind.
    pub kind: Kind,
    /// The word that keys and tables name it by.
    pub word: &'static str,
    /// Who hears it from a vehicle; `None` = a vehicle may not say it.
    pub of_vehicle: Option<Audience>,
    /// Who hears it from a ground station; `None` = it may not say it.
    pub of_ground: Option<Audience>,
    /// Who hears it from an operator; `None` = they may not say it.
    pub of_operator: Option<Audience>,
    /// How much it presses.
    pub class: Class,
    /// What it is about.
    pub topic: Topic,
    /// Whether a later one of the same sender and subject takes the place of one that was not sent yet.
    pub is_replaced: bool,
}

const ALL: Option<Audience> = Some(Audience { vehicles: Vehicles::All, ground: true, operators: true });
const VEHICLES: Option<Audience> = Some(Audience { vehicles: Vehicles::All, ground: false, operators: true });
const ADDRESSED: Option<Audience> =
    Some(Audience { vehicles: Vehicles::Addressed, ground: false, operators: true });
const GROUND: Option<Audience> = Some(Audience { vehicles: Vehicles::None, ground: true, operators: true });
const OPERATORS: Option<Audience> =
    Some(Audience { vehicles: Vehicles::None, ground: false, operators: true });
/// It may be said, but not on the bus.
const BY_RADIO: Option<Audience> =
    Some(Audience { vehicles: Vehicles::None, ground: false, operators: false });

/// The table, in the order of [`Kind`].
pub const TABLE: [Row; 13] = [
    Row {
        kind: Kind::Hello,
        word: "hello",
        of_vehicle: ALL,
        of_ground: ALL,
        of_operator: ALL,
        class: Class::Urgent,
        topic: Topic::Sender,
        is_replaced: true,
    },
    Row {
        kind: Kind::State,
        word: "state",
        of_vehicle: ALL,
        of_ground: None,
        of_operator: None,
        class: Class::High,
        topic: Topic::Sender,
        is_replaced: true,
    },
    // Whoever holds a map may say tiles, digests and wants. Of two ground stations neither hears the other's: they learn
    // from the vehicles. What an operator says of a map only other operators would hear.
    Row {
        kind: Kind::Tile,
        word: "tile",
        of_vehicle: ALL,
        of_ground: VEHICLES,
        of_operator: OPERATORS,
        class: Class::Normal,
        topic: Topic::Tile,
        is_replaced: true,
    },
    Row {
        kind: Kind::Digest,
        word: "digest",
        of_vehicle: ALL,
        of_ground: VEHICLES,
        of_operator: OPERATORS,
        class: Class::High,
        topic: Topic::Sender,
        is_replaced: true,
    },
    // Two wants of one layer may ask for different tiles.
    Row {
        kind: Kind::Want,
        word: "want",
        of_vehicle: ALL,
        of_ground: VEHICLES,
        of_operator: OPERATORS,
        class: Class::Normal,
        topic: Topic::Layer,
        is_replaced: false,
    },
    // A plan counts only together with those of all members, so every vehicle hears all.
    Row {
        kind: Kind::Plan,
        word: "plan",
        of_vehicle: None,
        of_ground: VEHICLES,
        of_operator: None,
        class: Class::High,
        topic: Topic::Vehicle,
        is_replaced: true,
    },
    Row {
        kind: Kind::Progress,
        word: "progress",
        of_vehicle: ALL,
        of_ground: None,
        of_operator: None,
        class: Class::High,
        topic: Topic::Sender,
        is_replaced: true,
    },
    Row {
        kind: Kind::Order,
        word: "order",
        of_vehicle: None,
        of_ground: ADDRESSED,
        of_operator: ADDRESSED,
        class: Class::Urgent,
        topic: Topic::Vehicle,
        is_replaced: true,
    },
    Row {
        kind: Kind::Samples,
        word: "samples",
        of_vehicle: GROUND,
        of_ground: None,
        of_operator: None,
        class: Class::Low,
        topic: Topic::Sender,
        is_replaced: false,
    },
    Row {
        kind: Kind::Have,
        word: "have",
        of_vehicle: None,
        of_ground: VEHICLES,
        of_operator: None,
        class: Class::High,
        topic: Topic::Sender,
        is_replaced: true,
    },
    Row {
        kind: Kind::Beacon,
        word: "beacon",
        of_vehicle: BY_RADIO,
        of_ground: None,
        of_operator: None,
        class: Class::Low,
        topic: Topic::Sender,
        is_replaced: true,
    },
    // Vehicles do not decide by how another one fares.
    Row {
        kind: Kind::Health,
        word: "health",
        of_vehicle: GROUND,
        of_ground: None,
        of_operator: None,
        class: Class::Normal,
        topic: Topic::Sender,
        is_replaced: true,
    },
    // The other ground's report says who holds the lease.
    Row {
        kind: Kind::Report,
        word: "report",
        of_vehicle: None,
        of_ground: ALL,
        of_operator: None,
        class: Class::High,
        topic: Topic::Sender,
        is_replaced: true,
    },
];

/// The words of all kinds, in the order of the table.
pub const WORDS: [&str; TABLE.len()] = {
    let mut words = [""; TABLE.len()];
    let mut at = 0;
    while at < TABLE.len() {
        words[at] = TABLE[at].word;
        at += 1;
    }
    words
};

// A row out of order does not compile.
const _: () = {
    let mut at = 0;
    while at < TABLE.len() {
        assert!(TABLE[at].kind as usize == at);
        at += 1;
    }
};

impl Class {
    /// Returns the class of a message.
    pub fn of(message: &Message) -> Class {
        Kind::of(message).row().class
    }
}

impl Kind {
    /// Returns the kind of a message.
    pub fn of(message: &Message) -> Kind {
        match message {
            Message::Hello(_) => Kind::Hello,
            Message::State(_) => Kind::State,
            Message::Tile(_) => Kind::Tile,
            Message::Digest(_) => Kind::Digest,
            Message::Want(_) => Kind::Want,
            Message::Plan(_) => Kind::Plan,
            Message::Progress(_) => Kind::Progress,
            Message::Order(_) => Kind::Order,
            Message::Samples(_) => Kind::Samples,
            Message::Have(_) => Kind::Have,
            Message::Beacon(_) => Kind::Beacon,
            Message::Health(_) => Kind::Health,
            Message::Report(_) => Kind::Report,
        }
    }

    /// Returns what holds for the messages of this kind.
    pub fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }
}

impl Row {
    /// Returns who hears a message of this kind from a sender; `None` = the sender may not say it.
    pub fn audience(&self, sender: Sender) -> Option<Audience> {
        match sender {
            Sender::Vehicle(_) => self.of_vehicle,
            Sender::Ground => self.of_ground,
            Sender::Operator => self.of_operator,
        }
    }
}

impl Audience {
    /// Returns whether nobody on the bus hears it.
    pub fn is_nobody(self) -> bool {
        self.vehicles == Vehicles::None && !self.ground && !self.operators
    }

    /// Returns whether a node is among those who hear what is about a subject.
    pub fn includes(self, node: Sender, about: About) -> bool {
        match (node, self.vehicles) {
            (Sender::Ground, _) => self.ground,
            (Sender::Operator, _) => self.operators,
            (Sender::Vehicle(_), Vehicles::All) => true,
            (Sender::Vehicle(_), Vehicles::None) => false,
            (Sender::Vehicle(vehicle), Vehicles::Addressed) => about == About::Vehicle(vehicle),
        }
    }
}

impl Subject {
    /// Returns the subject of a message.
    pub fn of(message: &Message) -> Subject {
        let about = match message {
            Message::Tile(tile) => About::Tile(tile.layer, tile.address),
            Message::Want(want) => About::Layer(want.layer),
            Message::Plan(plan) => About::Vehicle(plan.vehicle),
            Message::Order(order) => About::Vehicle(order.vehicle),
            Message::Hello(_)
            | Message::State(_)
            | Message::Digest(_)
            | Message::Progress(_)
            | Message::Samples(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Health(_)
            | Message::Report(_) => About::Sender,
        };
        Subject { kind: Kind::of(message), about }
    }
}

/// Returns whether a sender may say a message: its kind may come from such a sender, and it names no other author.
pub fn may_say(sender: Sender, message: &Message) -> bool {
    let is_author = message.author().is_none_or(|author| author == sender);
    is_author && Kind::of(message).row().audience(sender).is_some()
}

#[cfg(test)]
mod tests;
