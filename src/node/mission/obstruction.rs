//! What keeps a vehicle from going on along its way, as it is told to people: where, and what it was.
//!
//! Deliberately absent: what is done about it. Nothing is decided by what stands here but the place.

use serde::{Deserialize, Serialize};

use crate::geom::Point;
use crate::node::vehicle::CommandRefusal;

/// What keeps a vehicle from going on.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Obstruction {
    /// Where that is, east-north, metres; where the vehicle stands when it has no place of its own (see [`ObstructionKind`]).
    pub at: Point,
    /// What it is.
    pub kind: ObstructionKind,
}

/// What an obstruction is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum ObstructionKind {
    /// Something that the map shows, there.
    Obstacle,
    /// Something that made the reflex halt of late, there; the map need not show it.
    ReflexObstacle,
    /// Ground that nobody has seen, there; looking at it has not helped.
    UnseenGround,
    /// The vehicle refuses the commands that lead on. The place is where it stands.
    Refusal(CommandRefusal),
    /// It has driven back out of a dead end, and needs another way from where it stands.
    DeadEnd,
    /// No path home is known from where it stands.
    NoPathHome,
    /// It stands beside the end of its way.
    BesideItsWay,
    /// The vehicle has said that it stopped and not in front of what. The place is where it stands.
    Unreported,
}

impl Obstruction {
    /// Returns it in words, after a verb and with the preposition that belongs to that: "(stopped) in front of an obstacle at
    /// \[3.000, 4.000\]".
    pub(super) fn in_words(&self, preposition: &str) -> String {
        let Obstruction { at, kind } = self;
        match kind {
            ObstructionKind::Obstacle => format!("{preposition} an obstacle at {at}"),
            ObstructionKind::ReflexObstacle => {
                format!("{preposition} what its reflex halted for at {at}")
            }
            ObstructionKind::UnseenGround => {
                format!("{preposition} ground that is not seen yet at {at}")
            }
            ObstructionKind::Refusal(CommandRefusal::Fence) => {
                format!("at {at} {preposition} the fence")
            }
            ObstructionKind::Refusal(CommandRefusal::Separation(peer)) => {
                format!("at {at} {preposition} vehicle {peer} or its way")
            }
            ObstructionKind::Refusal(CommandRefusal::ReflexObstacle) => {
                format!("at {at} {preposition} what its reflex halted for")
            }
            ObstructionKind::Refusal(why) => format!("at {at}: {why}"),
            ObstructionKind::DeadEnd => format!("at {at}: it has come back out of a dead end"),
            ObstructionKind::NoPathHome => format!("at {at}: it knows no path home"),
            ObstructionKind::BesideItsWay => {
                format!("at {at}: it stands beside the end of its way")
            }
            ObstructionKind::Unreported => format!("at {at} {preposition} something"),
        }
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::VehicleId;

    use super::*;
    use crate::node::mission::{EndReason, MissionEvent};

    #[test]
    fn a_vehicle_that_stopped_says_in_front_of_what() {
        let at = Point::new(3.0, 4.5);
        for (kind, stopped, blocked) in [
            (
                ObstructionKind::Obstacle,
                "stopped in front of an obstacle at [3.000, 4.500]",
                "is blocked by an obstacle at [3.000, 4.500]",
            ),
            (
                ObstructionKind::ReflexObstacle,
                "stopped in front of what its reflex halted for at [3.000, 4.500]",
                "is blocked by what its reflex halted for at [3.000, 4.500]",
            ),
            (
                ObstructionKind::UnseenGround,
                "stopped in front of ground that is not seen yet at [3.000, 4.500]",
                "is blocked by ground that is not seen yet at [3.000, 4.500]",
            ),
            (
                ObstructionKind::Refusal(CommandRefusal::Fence),
                "stopped at [3.000, 4.500] in front of the fence",
                "is blocked at [3.000, 4.500] by the fence",
            ),
            (
                ObstructionKind::Refusal(CommandRefusal::Separation(VehicleId(2))),
                "stopped at [3.000, 4.500] in front of vehicle 2 or its way",
                "is blocked at [3.000, 4.500] by vehicle 2 or its way",
            ),
            (
                ObstructionKind::Refusal(CommandRefusal::ReflexObstacle),
                "stopped at [3.000, 4.500] in front of what its reflex halted for",
                "is blocked at [3.000, 4.500] by what its reflex halted for",
            ),
            (
                ObstructionKind::Refusal(CommandRefusal::PoseUncertain),
                "stopped at [3.000, 4.500]: its pose is too uncertain",
                "is blocked at [3.000, 4.500]: its pose is too uncertain",
            ),
            (
                ObstructionKind::Unreported,
                "stopped at [3.000, 4.500] in front of something",
                "is blocked at [3.000, 4.500] by something",
            ),
        ] {
            let obstruction = Obstruction { at, kind };
            assert_eq!(EndReason::Stopped(obstruction).to_string(), stopped);
            assert_eq!(MissionEvent::Blocked(obstruction).to_string(), blocked);
        }
    }
}
