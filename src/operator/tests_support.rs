//! What the operator's tests say in the name of vehicles and of the ground.

use tomoswarm_proto::{
    Boot, Deviation, GroundReport, Heading, Lease, Message, OpenStops, Order, OrderKind, Ordered,
    Permille, PoseReport, Position, Revision, RunId, Sender, State, StationPhase, VehicleId,
    VehicleMode,
};

use super::HeardMessage;
use crate::time::Time;

/// A moment, in seconds.
pub fn at(at_s: f64) -> Time {
    Time::from_secs_f64(at_s)
}

/// A message as the bus hands it on.
pub fn heard(message: Message) -> HeardMessage {
    let sender = message.author().unwrap_or(Sender::Ground);
    HeardMessage::Message(sender, message)
}

/// A sound state of a vehicle that stands at (its number, 1).
pub fn state(vehicle: u8) -> State {
    let at = Position::from_metres(f64::from(vehicle), 1.0, 0.0);
    State {
        vehicle: VehicleId(vehicle),
        boot: Boot(1),
        sequence: 1,
        pose: Some(PoseReport {
            at,
            heading: Heading(0),
            sd: Deviation(50),
        }),
        is_at_rest: true,
        mode: VehicleMode::Idle,
        battery: Some(Permille(900)),
        leg: None,
        accepted: (RunId(0), Revision(0)),
        ordered: Ordered::default(),
        ..State::default()
    }
}

/// A report of an idle ground station that holds lease 4.
pub fn report() -> GroundReport {
    GroundReport {
        boot: Boot(1),
        lease: Lease {
            number: 4,
            holder: 44,
        },
        store: 1,
        phase: StationPhase::Idle,
        members: vec![VehicleId(1), VehicleId(2)],
        ..GroundReport::default()
    }
}

/// A vehicle that obeys as the real one does: what is above its echo.
pub struct Rover {
    /// What it says.
    pub state: State,
}

impl Rover {
    /// Says that it knows of no emergency stop.
    pub fn say_stops(&self) -> HeardMessage {
        HeardMessage::Message(
            Sender::Vehicle(self.state.vehicle),
            Message::Standing(OpenStops::default()),
        )
    }

    /// A vehicle that was ordered nothing yet.
    pub fn new(vehicle: u8) -> Rover {
        Rover {
            state: state(vehicle),
        }
    }

    /// A vehicle that has obeyed this.
    pub fn ordered(vehicle: u8, lease: Lease, revision: u32, kind: OrderKind) -> Rover {
        let mut rover = Rover::new(vehicle);
        rover.state.ordered = Ordered {
            lease,
            revision: Revision(revision),
            run: RunId(1),
            kind: Some(kind),
        };
        rover
    }

    /// Obeys an order if it is above the echo.
    pub fn obey(&mut self, order: &Order) {
        let (edition, echo) = ((order.lease, order.revision), self.state.ordered);
        let is_again =
            edition == echo.edition() && echo.kind.is_none() && edition != Default::default();
        if order.vehicle == self.state.vehicle && (edition > echo.edition() || is_again) {
            let Order {
                lease,
                revision,
                run,
                kind,
                ..
            } = *order;
            self.state.ordered = Ordered {
                lease,
                revision,
                run,
                kind: Some(kind),
            };
        }
    }

    /// Says its state.
    pub fn say(&mut self) -> HeardMessage {
        self.state.sequence += 1;
        heard(Message::State(self.state.clone()))
    }

    /// Starts anew, and remembers by whose right it was ordered.
    pub fn restart_remembering(&mut self) {
        let remembered = Ordered {
            kind: None,
            ..self.state.ordered
        };
        self.restart();
        self.state.ordered = remembered;
    }

    /// Starts anew: nothing was ordered yet.
    pub fn restart(&mut self) {
        self.state.boot.0 += 1;
        self.state.sequence = 0;
        self.state.ordered = Ordered::default();
    }
}
