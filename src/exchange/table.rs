//! Who says what, who hears it, how much it presses, and what replaces it: one row for each kind of message. The simulated
//! bus, the subscriptions and access rules of the live one, the judge of what comes and the queue of what goes all read
//! this table, and nothing else says who hears whom between nodes.
//!
//! It says nothing about what is in a message. Kinds, what messages are about and their keys are the wire's own
//! ([`tomoswarm_proto::Topic`]).

use tomoswarm_proto::{Interest, Message, MessageKind, Sender};

/// How much a message presses; the lower goes first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Urgency {
    /// Orders, greetings and emergency stops: never waits.
    Urgent,
    /// Where somebody is and how far, how it fares, and what others decide by when it is missing.
    High,
    /// The map.
    Normal,
    /// Samples and images: they are many, and are repeated.
    Low,
}

/// Which vehicles hear something.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum VehicleSet {
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
    pub vehicles: VehicleSet,
    /// Whether ground stations do.
    pub ground: bool,
    /// Whether operators do.
    pub operators: bool,
}

/// Whether a message piggybacks: waits a moment for another one to travel with. What stands in one packet costs less than two,
/// and wakes whoever hears it once.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Piggyback {
    /// It goes by itself.
    Never,
    /// When it says again what was said a while ago; what is new, or is said again at once, goes by itself.
    Repeats,
    /// It is said again and again, and nobody acts on it within that moment.
    Always,
}

/// What holds for all messages of one kind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct MessageRule {
    /// The kind.
    pub kind: MessageKind,
    /// Who hears it from a vehicle; `None` = a vehicle may not say it.
    pub of_vehicle: Option<Audience>,
    /// Who hears it from a ground station; `None` = it may not say it.
    pub of_ground: Option<Audience>,
    /// Who hears it from an operator; `None` = they may not say it.
    pub of_operator: Option<Audience>,
    /// How much it presses.
    pub class: Urgency,
    /// Whether a later one of the same sender and topic takes the place of one that was not sent yet.
    pub is_replaced: bool,
    /// Whether it may wait a moment for another one to travel with.
    pub piggybacks: Piggyback,
}

const ALL: Option<Audience> = Some(Audience {
    vehicles: VehicleSet::All,
    ground: true,
    operators: true,
});
const VEHICLES: Option<Audience> = Some(Audience {
    vehicles: VehicleSet::All,
    ground: false,
    operators: true,
});
const ADDRESSED: Option<Audience> = Some(Audience {
    vehicles: VehicleSet::Addressed,
    ground: false,
    operators: true,
});
const GROUND: Option<Audience> = Some(Audience {
    vehicles: VehicleSet::None,
    ground: true,
    operators: true,
});
const OPERATORS: Option<Audience> = Some(Audience {
    vehicles: VehicleSet::None,
    ground: false,
    operators: true,
});
/// It may be said, but not on the bus.
const BY_RADIO: Option<Audience> = Some(Audience {
    vehicles: VehicleSet::None,
    ground: false,
    operators: false,
});

/// The table, in the order of [`MessageKind`].
pub const TABLE: [MessageRule; MessageKind::ALL.len()] = [
    MessageRule {
        kind: MessageKind::Hello,
        of_vehicle: ALL,
        of_ground: ALL,
        of_operator: ALL,
        class: Urgency::Urgent,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    MessageRule {
        kind: MessageKind::State,
        of_vehicle: ALL,
        of_ground: None,
        of_operator: None,
        class: Urgency::High,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    // Whoever holds a map may say tiles, digests and wants. Of two ground stations neither hears the other's: they learn
    // from the vehicles. An operator that shows the map asks everyone for what it lacks; it has nothing to tell of it.
    MessageRule {
        kind: MessageKind::Tile,
        of_vehicle: ALL,
        of_ground: VEHICLES,
        of_operator: OPERATORS,
        class: Urgency::Normal,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    MessageRule {
        kind: MessageKind::Digest,
        of_vehicle: ALL,
        of_ground: VEHICLES,
        of_operator: OPERATORS,
        class: Urgency::High,
        is_replaced: true,
        piggybacks: Piggyback::Always,
    },
    // Two wants of one layer may ask for different tiles.
    MessageRule {
        kind: MessageKind::Want,
        of_vehicle: ALL,
        of_ground: VEHICLES,
        of_operator: ALL,
        class: Urgency::Normal,
        is_replaced: false,
        piggybacks: Piggyback::Never,
    },
    // A plan counts only together with those of all members, so every vehicle hears all.
    MessageRule {
        kind: MessageKind::Plan,
        of_vehicle: None,
        of_ground: VEHICLES,
        of_operator: None,
        class: Urgency::High,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    MessageRule {
        kind: MessageKind::Mission,
        of_vehicle: ALL,
        of_ground: None,
        of_operator: None,
        class: Urgency::High,
        is_replaced: true,
        piggybacks: Piggyback::Repeats,
    },
    MessageRule {
        kind: MessageKind::Order,
        of_vehicle: None,
        of_ground: ADDRESSED,
        of_operator: ADDRESSED,
        class: Urgency::Urgent,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    MessageRule {
        kind: MessageKind::Samples,
        of_vehicle: GROUND,
        of_ground: None,
        of_operator: None,
        class: Urgency::Low,
        is_replaced: false,
        piggybacks: Piggyback::Never,
    },
    MessageRule {
        kind: MessageKind::Have,
        of_vehicle: None,
        of_ground: VEHICLES,
        of_operator: None,
        class: Urgency::High,
        is_replaced: true,
        piggybacks: Piggyback::Always,
    },
    MessageRule {
        kind: MessageKind::Beacon,
        of_vehicle: BY_RADIO,
        of_ground: None,
        of_operator: None,
        class: Urgency::Low,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    // Vehicles do not decide by how another one fares.
    MessageRule {
        kind: MessageKind::Health,
        of_vehicle: GROUND,
        of_ground: None,
        of_operator: None,
        class: Urgency::High,
        is_replaced: true,
        piggybacks: Piggyback::Always,
    },
    // The other ground's report says who holds the lease.
    MessageRule {
        kind: MessageKind::Report,
        of_vehicle: None,
        of_ground: ALL,
        of_operator: None,
        class: Urgency::High,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    // Every node says on which stops are open: no cut in the network may keep them from anyone.
    MessageRule {
        kind: MessageKind::Standing,
        of_vehicle: ALL,
        of_ground: ALL,
        of_operator: ALL,
        class: Urgency::Urgent,
        is_replaced: true,
        piggybacks: Piggyback::Repeats,
    },
    MessageRule {
        kind: MessageKind::Task,
        of_vehicle: None,
        of_ground: None,
        of_operator: ALL,
        class: Urgency::High,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    MessageRule {
        kind: MessageKind::Image,
        of_vehicle: None,
        of_ground: OPERATORS,
        of_operator: None,
        class: Urgency::Low,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    // Who measures places from outside is an operator. A late one is of no use.
    MessageRule {
        kind: MessageKind::Fix,
        of_vehicle: None,
        of_ground: None,
        of_operator: ADDRESSED,
        class: Urgency::High,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    // The ground station says a mark that it has stored. Two marks of one run are two places.
    MessageRule {
        kind: MessageKind::Mark,
        of_vehicle: None,
        of_ground: OPERATORS,
        of_operator: GROUND,
        class: Urgency::Normal,
        is_replaced: false,
        piggybacks: Piggyback::Never,
    },
    // Said only while an operator asks for it. A late one is of no use. The ground station makes nothing of it: it hears all
    // that vehicles say under one key, unknown kinds too.
    MessageRule {
        kind: MessageKind::Look,
        of_vehicle: GROUND,
        of_ground: None,
        of_operator: None,
        class: Urgency::Low,
        is_replaced: true,
        piggybacks: Piggyback::Never,
    },
    // As a Look. Each message has lines of its own, or another part.
    MessageRule {
        kind: MessageKind::Log,
        of_vehicle: GROUND,
        of_ground: OPERATORS,
        of_operator: None,
        class: Urgency::Low,
        is_replaced: false,
        piggybacks: Piggyback::Never,
    },
    MessageRule {
        kind: MessageKind::Settings,
        of_vehicle: GROUND,
        of_ground: OPERATORS,
        of_operator: None,
        class: Urgency::Low,
        is_replaced: false,
        piggybacks: Piggyback::Never,
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

impl Urgency {
    /// Returns the class of a message.
    pub fn of(message: &Message) -> Urgency {
        row(message.kind()).class
    }
}

/// Returns what an operator must be interested in to be told messages of a kind; `None` = it is told in any case.
pub fn interest(kind: MessageKind) -> Option<Interest> {
    match kind {
        MessageKind::State
        | MessageKind::Mission
        | MessageKind::Health
        | MessageKind::Plan
        | MessageKind::Fix => Some(Interest::Fleet),
        MessageKind::Tile | MessageKind::Digest | MessageKind::Want => Some(Interest::Map),
        MessageKind::Samples | MessageKind::Have => Some(Interest::Samples),
        MessageKind::Image => Some(Interest::Images),
        MessageKind::Look => Some(Interest::Looks),
        MessageKind::Log => Some(Interest::Log),
        MessageKind::Settings => Some(Interest::Settings),
        MessageKind::Hello
        | MessageKind::Order
        | MessageKind::Beacon
        | MessageKind::Report
        | MessageKind::Standing
        | MessageKind::Task
        | MessageKind::Mark => None,
    }
}

/// Returns what holds for the messages of a kind.
pub fn row(kind: MessageKind) -> &'static MessageRule {
    &TABLE[kind as usize]
}

impl MessageRule {
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
        self.vehicles == VehicleSet::None && !self.ground && !self.operators
    }

    /// Returns whether a node is among those who hear what is about something.
    #[cfg(test)]
    pub fn includes(self, node: Sender, about: tomoswarm_proto::MessageSubject) -> bool {
        match (node, self.vehicles) {
            (Sender::Ground, _) => self.ground,
            (Sender::Operator(_), _) => self.operators,
            (Sender::Vehicle(_), VehicleSet::All) => true,
            (Sender::Vehicle(_), VehicleSet::None) => false,
            (Sender::Vehicle(vehicle), VehicleSet::Addressed) => {
                about == tomoswarm_proto::MessageSubject::Vehicle(vehicle)
            }
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
