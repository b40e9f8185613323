//! Who says what, who hears it, how much it presses, and what replaces it: one row for each kind of message. The simulated
//! bus, the subscriptions and access rules of the live one, the judge of what comes and the queue of what goes all read
//! this table, and nothing else says who hears whom between nodes.
//!
//! It says nothing about what is in a message. Kinds, what messages are about and their keys are the wire's own
//! ([`tomoswarm_proto::Topic`]).

use tomoswarm_proto::{About, Interest, Kind, Message, Sender};

/// How much a message presses; the lower goes first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Class {
    /// Orders, greetings and emergency stops: never waits.
    Urgent,
    /// Where somebody is and how far, and what others decide by when it is missing.
    High,
    /// The map, and how a vehicle fares.
    Normal,
    /// Samples and images: they are many, and are repeated.
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

/// What holds for all messages of one kind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Row {
    /// The kind.
    pub kind: Kind,
    /// Who hears it from a vehicle; `None` = a vehicle may not say it.
    pub of_vehicle: Option<Audience>,
    /// Who hears it from a ground station; `None` = it may not say it.
    pub of_ground: Option<Audience>,
    /// Who hears it from an operator; `None` = they may not say it.
    pub of_operator: Option<Audience>,
    /// How much it presses.
    pub class: Class,
    /// Whether a later one of the same sender and topic takes the place of one that was not sent yet.
    pub is_replaced: bool,
}

const ALL: Option<Audience> = Some(Audience {
    vehicles: Vehicles::All,
    ground: true,
    operators: true,
});
const VEHICLES: Option<Audience> = Some(Audience {
    vehicles: Vehicles::All,
    ground: false,
    operators: true,
});
const ADDRESSED: Option<Audience> = Some(Audience {
    vehicles: Vehicles::Addressed,
    ground: false,
    operators: true,
});
const GROUND: Option<Audience> = Some(Audience {
    vehicles: Vehicles::None,
    ground: true,
    operators: true,
});
const OPERATORS: Option<Audience> = Some(Audience {
    vehicles: Vehicles::None,
    ground: false,
    operators: true,
});
/// It may be said, but not on the bus.
const BY_RADIO: Option<Audience> = Some(Audience {
    vehicles: Vehicles::None,
    ground: false,
    operators: false,
});

/// The table, in the order of [`Kind`].
pub const TABLE: [Row; Kind::ALL.len()] = [
    Row {
        kind: Kind::Hello,
        of_vehicle: ALL,
        of_ground: ALL,
        of_operator: ALL,
        class: Class::Urgent,
        is_replaced: true,
    },
    Row {
        kind: Kind::State,
        of_vehicle: ALL,
        of_ground: None,
        of_operator: None,
        class: Class::High,
        is_replaced: true,
    },
    // Whoever holds a map may say tiles, digests and wants. Of two ground stations neither hears the other's: they learn
    // from the vehicles. What an operator says of a map only other operators would hear.
    Row {
        kind: Kind::Tile,
        of_vehicle: ALL,
        of_ground: VEHICLES,
        of_operator: OPERATORS,
        class: Class::Normal,
        is_replaced: true,
    },
    Row {
        kind: Kind::Digest,
        of_vehicle: ALL,
        of_ground: VEHICLES,
        of_operator: OPERATORS,
        class: Class::High,
        is_replaced: true,
    },
    // Two wants of one layer may ask for different tiles.
    Row {
        kind: Kind::Want,
        of_vehicle: ALL,
        of_ground: VEHICLES,
        of_operator: OPERATORS,
        class: Class::Normal,
        is_replaced: false,
    },
    // A plan counts only together with those of all members, so every vehicle hears all.
    Row {
        kind: Kind::Plan,
        of_vehicle: None,
        of_ground: VEHICLES,
        of_operator: None,
        class: Class::High,
        is_replaced: true,
    },
    Row {
        kind: Kind::Mission,
        of_vehicle: ALL,
        of_ground: None,
        of_operator: None,
        class: Class::High,
        is_replaced: true,
    },
    Row {
        kind: Kind::Order,
        of_vehicle: None,
        of_ground: ADDRESSED,
        of_operator: ADDRESSED,
        class: Class::Urgent,
        is_replaced: true,
    },
    Row {
        kind: Kind::Samples,
        of_vehicle: GROUND,
        of_ground: None,
        of_operator: None,
        class: Class::Low,
        is_replaced: false,
    },
    Row {
        kind: Kind::Have,
        of_vehicle: None,
        of_ground: VEHICLES,
        of_operator: None,
        class: Class::High,
        is_replaced: true,
    },
    Row {
        kind: Kind::Beacon,
        of_vehicle: BY_RADIO,
        of_ground: None,
        of_operator: None,
        class: Class::Low,
        is_replaced: true,
    },
    // Vehicles do not decide by how another one fares.
    Row {
        kind: Kind::Health,
        of_vehicle: GROUND,
        of_ground: None,
        of_operator: None,
        class: Class::Normal,
        is_replaced: true,
    },
    // The other ground's report says who holds the lease.
    Row {
        kind: Kind::Report,
        of_vehicle: None,
        of_ground: ALL,
        of_operator: None,
        class: Class::High,
        is_replaced: true,
    },
    // Every node says on which stops are open: no cut in the network may keep them from anyone.
    Row {
        kind: Kind::Standing,
        of_vehicle: ALL,
        of_ground: ALL,
        of_operator: ALL,
        class: Class::Urgent,
        is_replaced: true,
    },
    Row {
        kind: Kind::Task,
        of_vehicle: None,
        of_ground: None,
        of_operator: ALL,
        class: Class::High,
        is_replaced: true,
    },
    Row {
        kind: Kind::Image,
        of_vehicle: None,
        of_ground: OPERATORS,
        of_operator: None,
        class: Class::Low,
        is_replaced: true,
    },
];

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
        row(message.kind()).class
    }
}

/// Returns what an operator must be interested in to be told messages of a kind; `None` = it is told in any case.
pub fn interest(kind: Kind) -> Option<Interest> {
    match kind {
        Kind::State | Kind::Mission | Kind::Health | Kind::Plan => Some(Interest::Fleet),
        Kind::Tile | Kind::Digest | Kind::Want => Some(Interest::Map),
        Kind::Samples | Kind::Have => Some(Interest::Samples),
        Kind::Image => Some(Interest::Images),
        Kind::Hello | Kind::Order | Kind::Beacon | Kind::Report | Kind::Standing | Kind::Task => {
            None
        }
    }
}

/// Returns what holds for the messages of a kind.
pub fn row(kind: Kind) -> &'static Row {
    &TABLE[kind as usize]
}

impl Row {
    /// Returns who hears a message of this kind from a sender; `None` = the sender may not say it.
    pub fn audience(&self, sender: Sender) -> Option<Audience> {
        match sender {
            Sender::Vehicle(_) => self.of_vehicle,
            Sender::Ground => self.of_ground,
            Sender::Operator(_) => self.of_operator,
        }
    }
}

impl Audience {
    /// Returns whether nobody on the bus hears it.
    pub fn is_nobody(self) -> bool {
        self.vehicles == Vehicles::None && !self.ground && !self.operators
    }

    /// Returns whether a node is among those who hear what is about something.
    pub fn includes(self, node: Sender, about: About) -> bool {
        match (node, self.vehicles) {
            (Sender::Ground, _) => self.ground,
            (Sender::Operator(_), _) => self.operators,
            (Sender::Vehicle(_), Vehicles::All) => true,
            (Sender::Vehicle(_), Vehicles::None) => false,
            (Sender::Vehicle(vehicle), Vehicles::Addressed) => about == About::Vehicle(vehicle),
        }
    }
}

/// Returns whether a sender may say a message: its kind may come from such a sender, and it names no other author.
pub fn may_say(sender: Sender, message: &Message) -> bool {
    let is_author = message.author().is_none_or(|author| author == sender);
    is_author && row(message.kind()).audience(sender).is_some()
}

#[cfg(test)]
mod tests;
