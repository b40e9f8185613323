//! An input of a history as it is kept, and what a later one of the same replaces.

use tomoswarm_proto::codec;
use tomoswarm_proto::{LayerId, Message, Sender, TileAddress, VehicleId};

use crate::dash::board::BoardInput;
use crate::operator::HeardMessage;
use crate::time::Time;

/// Time, length and whether it stays, before each input.
const HEADER_BYTES: usize = 13;

/// An input as it is kept.
pub(super) struct PackedInput<'a> {
    /// When it was told.
    pub at: Time,
    /// It made an event.
    pub stays: bool,
    /// It is samples: they are read without the others.
    pub is_samples: bool,
    /// The input.
    pub bytes: &'a [u8],
}

/// What a later input of the same replaces.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Replaced {
    State(VehicleId),
    Mission(VehicleId),
    Health(VehicleId),
    Look(VehicleId),
    Samples(VehicleId),
    Plan(VehicleId),
    Report(u64),
    Tile(LayerId, TileAddress),
    Standing(Sender),
    Greeting(Sender),
}

impl PackedInput<'_> {
    /// Adds it to others; returns how many bytes that took.
    pub(super) fn write(&self, to: &mut Vec<u8>) -> usize {
        let before = to.len();
        to.extend(self.at.as_nanos().to_le_bytes());
        to.extend((self.bytes.len() as u32).to_le_bytes());
        to.push(u8::from(self.stays) | u8::from(self.is_samples) << 1);
        to.extend(self.bytes);
        to.len() - before
    }

    /// Takes the first of several.
    pub(super) fn read<'a>(rest: &mut &'a [u8]) -> Option<PackedInput<'a>> {
        let (header, body) = rest.split_first_chunk::<HEADER_BYTES>()?;
        let (at, header) = header.split_first_chunk()?;
        let (length, header) = header.split_first_chunk()?;
        let (bytes, after) = body.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        *rest = after;
        Some(PackedInput {
            at: Time::from_nanos(u64::from_le_bytes(*at)),
            stays: header.first().is_some_and(|flags| flags & 1 != 0),
            is_samples: header.first().is_some_and(|flags| flags & 2 != 0),
            bytes,
        })
    }

    /// Reads what was packed here.
    pub(super) fn input(&self) -> Option<BoardInput> {
        codec::unpack(self.bytes).ok()
    }
}

/// Returns what a later input of the same kind replaces; `None` = it stands for itself.
pub(super) fn replaced(input: &BoardInput) -> Option<Replaced> {
    let BoardInput::Heard(heard) = input else {
        return None;
    };
    let (sender, message) = match heard {
        HeardMessage::Message(sender, message) => (sender, message),
        HeardMessage::Greeting(greeting, _) => return Some(Replaced::Greeting(greeting.node)),
        HeardMessage::Unknown(_) => return None,
    };
    match message {
        Message::State(state) => Some(Replaced::State(state.vehicle)),
        Message::Mission(mission) => Some(Replaced::Mission(mission.vehicle)),
        Message::Health(health) => Some(Replaced::Health(health.vehicle)),
        Message::Look(look) => Some(Replaced::Look(look.vehicle)),
        Message::Samples(batch) => Some(Replaced::Samples(batch.vehicle)),
        Message::Plan(plan) => Some(Replaced::Plan(plan.vehicle)),
        Message::Report(report) => Some(Replaced::Report(report.store)),
        Message::Tile(tile) => Some(Replaced::Tile(tile.layer, tile.address)),
        Message::Standing(_) => Some(Replaced::Standing(*sender)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::tests_support::heard;

    #[test]
    fn of_what_a_vehicle_hears_the_later_look_replaces_the_one_before() {
        let look = |id| {
            BoardInput::Heard(heard(Message::Look(tomoswarm_proto::Look {
                vehicle: VehicleId(id),
                half_angle: tomoswarm_proto::Heading(2618),
                max_range_mm: 4000,
                readings: Vec::new(),
            })))
        };
        assert!(replaced(&look(1)).is_some() && replaced(&look(1)) == replaced(&look(1)));
        assert!(replaced(&look(1)) != replaced(&look(2)));
    }
}
