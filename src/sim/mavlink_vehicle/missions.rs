//! The stored mission as clients see it: uploaded, downloaded, cleared, its current item. What is carried out is the
//! autopilot's; what was uploaded is kept as it came, so that it is read back byte for byte.

use super::FlownVehicle;
use crate::autopilot::item::{ITEMS_MAX, check_items};
use crate::autopilot::{Command, CommandAck, Item};
use crate::mavlink::client_link::ClientId;
use crate::mavlink::dialect::{
    MISSION_ITEM_INT_DATA, MavMessage, MavMissionResult, MavMissionType,
};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::frames::MavAddress;
use crate::mavlink::items::from_wire;
use crate::mavlink::mission_upload::{MissionReceiver, Received, mission_ack, mission_count};
use crate::time::Time;

/// Somebody who speaks over a connection.
pub(super) type Client = (ClientId, MavAddress);

/// The stored mission.
#[derive(Clone, Debug, Default)]
pub(super) struct Missions {
    /// As they were uploaded; item 0 is home.
    stored: Vec<MISSION_ITEM_INT_DATA>,
    /// What is being uploaded, and by whom.
    upload: Option<(ClientId, MissionReceiver)>,
}

impl Missions {
    /// Returns how many items are stored, home included.
    pub(super) fn count(&self) -> usize {
        self.stored.len()
    }

    /// Returns when something is to be asked for again.
    pub(super) fn deadline(&self) -> Option<Time> {
        self.upload
            .as_ref()
            .map(|(_, receiver)| receiver.deadline())
    }

    /// Asks again for what has not come; an upload whose sender has gone is forgotten, and the stored mission stays.
    pub(super) fn due(&mut self, now: Time, out: &mut Vec<(ClientId, MavMessage)>) {
        let Some((client, receiver)) = &mut self.upload else {
            return;
        };
        let (client, mut said) = (*client, Vec::new());
        if receiver.due(now, &mut said) == Received::Gone {
            let from = receiver.from();
            said.push(ack(from, MavMissionResult::MAV_MISSION_OPERATION_CANCELLED));
            self.upload = None;
        }
        out.extend(said.into_iter().map(|message| (client, message)));
    }

    /// Hears what is about missions; returns the answers.
    pub(super) fn hear(
        &mut self,
        now: Time,
        (client, from): Client,
        message: &MavMessage,
        vehicle: &mut FlownVehicle<'_>,
        frame: &EarthFrame,
    ) -> Vec<MavMessage> {
        let mut out = Vec::new();
        match message {
            MavMessage::MISSION_COUNT(count)
                if count.mission_type != MavMissionType::MAV_MISSION_TYPE_MISSION =>
            {
                out.push(mission_ack(
                    from,
                    count.mission_type,
                    MavMissionResult::MAV_MISSION_UNSUPPORTED,
                ));
            }
            MavMessage::MISSION_COUNT(count) if usize::from(count.count) > ITEMS_MAX => {
                out.push(ack(from, MavMissionResult::MAV_MISSION_NO_SPACE));
            }
            MavMessage::MISSION_COUNT(count) if count.count == 0 => {
                out.push(self.clear(now, from, vehicle))
            }
            MavMessage::MISSION_COUNT(count) => {
                self.upload = Some((
                    client,
                    MissionReceiver::begin(now, from, count.count, &mut out),
                ));
            }
            MavMessage::MISSION_ITEM_INT(item) => match &mut self.upload {
                Some((by, receiver)) if *by == client => {
                    if let Received::Whole(items) = receiver.hear(now, item, &mut out) {
                        self.upload = None;
                        out.push(ack(from, self.store(now, items, vehicle, frame)));
                    }
                }
                Some(_) | None => out.push(ack(from, MavMissionResult::MAV_MISSION_ERROR)),
            },
            MavMessage::MISSION_REQUEST_LIST(request) => {
                let count = match request.mission_type {
                    MavMissionType::MAV_MISSION_TYPE_MISSION => self.stored.len(),
                    _ => 0,
                };
                out.push(mission_count(from, request.mission_type, count as u16));
            }
            MavMessage::MISSION_REQUEST_INT(request) => out.push(self.item(from, request.seq)),
            MavMessage::MISSION_CLEAR_ALL(_) => out.push(self.clear(now, from, vehicle)),
            MavMessage::MISSION_SET_CURRENT(set) => {
                vehicle.command(now, &Command::SetCurrent(usize::from(set.seq)));
            }
            _ => {}
        }
        out
    }

    /// Returns an item as it was uploaded, or that there is none.
    fn item(&self, to: MavAddress, seq: u16) -> MavMessage {
        match self.stored.get(usize::from(seq)) {
            Some(item) => MavMessage::MISSION_ITEM_INT(MISSION_ITEM_INT_DATA {
                target_system: to.system,
                target_component: to.component,
                ..item.clone()
            }),
            None => ack(to, MavMissionResult::MAV_MISSION_ERROR),
        }
    }

    fn clear(&mut self, now: Time, by: MavAddress, vehicle: &mut FlownVehicle<'_>) -> MavMessage {
        vehicle.command(now, &Command::Clear);
        (self.stored, self.upload) = (Vec::new(), None);
        ack(by, MavMissionResult::MAV_MISSION_ACCEPTED)
    }

    fn store(
        &mut self,
        now: Time,
        wire: Vec<MISSION_ITEM_INT_DATA>,
        vehicle: &mut FlownVehicle<'_>,
        frame: &EarthFrame,
    ) -> MavMissionResult {
        let items: Result<Vec<Item>, MavMissionResult> =
            wire.iter().map(|item| from_wire(item, frame)).collect();
        let items = match items {
            Ok(items) => items,
            Err(refusal) => return refusal,
        };
        if let Err(refusal) = check_items(&items, vehicle.kind()) {
            return result_of(refusal.code());
        }
        match vehicle.command(now, &Command::Upload(items)).result {
            CommandAck::Accepted => {
                self.stored = wire;
                MavMissionResult::MAV_MISSION_ACCEPTED
            }
            CommandAck::Denied | CommandAck::Unsupported | CommandAck::Failed => {
                MavMissionResult::MAV_MISSION_DENIED
            }
        }
    }
}

/// Returns the judgement of a number.
fn result_of(code: u8) -> MavMissionResult {
    num_traits::FromPrimitive::from_u8(code).unwrap_or(MavMissionResult::MAV_MISSION_INVALID)
}

fn ack(to: MavAddress, result: MavMissionResult) -> MavMessage {
    mission_ack(to, MavMissionType::MAV_MISSION_TYPE_MISSION, result)
}
