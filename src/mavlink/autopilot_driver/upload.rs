//! A mission on its way into the autopilot: sent, then read back and compared, since an acknowledgement is no proof.
//!
//! ```text
//!   [Sending] ──judged good; not judged──► [Reading] ──all is as it was sent──► accepted
//!       └──refused; silent──► answered so      └──something else; silent──► failed
//! ```

use super::DriverOut;
use crate::autopilot::{CommandAck, Item};
use crate::mavlink::dialect::{MISSION_ITEM_INT_DATA, MavMessage, MavMissionResult};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::frames::MavAddress;
use crate::mavlink::items::{from_wire, is_same_command, is_stored_as, to_wire};
use crate::mavlink::mission_download::MissionReader;
use crate::mavlink::mission_upload::{MissionSender, Received, UploadEnd};
use crate::time::Time;

/// A mission under way.
#[derive(Clone, Debug)]
pub(super) struct Upload {
    /// Of the command that it answers.
    number: u32,
    to: MavAddress,
    items: Vec<Item>,
    phase: Phase,
}

#[derive(Clone, Debug)]
enum Phase {
    Sending(MissionSender),
    Reading(MissionReader),
}

/// How it has ended.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct UploadResult {
    /// Of the command that it answers.
    pub number: u32,
    /// The answer.
    pub ack: CommandAck,
    /// What was wrong, in words.
    pub complaint: Option<String>,
}

impl Upload {
    /// Begins to send; item 0 is home.
    ///
    /// # Errors
    /// How it ends at once: with a command that MAVLink does not have.
    pub(super) fn begin(
        now: Time,
        number: u32,
        items: &[Item],
        to: MavAddress,
        frame: &EarthFrame,
        out: &mut Vec<DriverOut>,
    ) -> Result<Upload, UploadResult> {
        let mut wire = Vec::with_capacity(items.len());
        for (index, item) in items.iter().enumerate() {
            let Some(item) = to_wire(item, frame) else {
                return Err(UploadResult {
                    number,
                    ack: CommandAck::Unsupported,
                    complaint: Some(format!("item {index} is no command of MAVLink: {item:?}")),
                });
            };
            wire.push(item);
        }
        let sender = said(out, |said| MissionSender::begin(now, to, wire, said));
        Ok(Upload {
            number,
            to,
            items: items.to_vec(),
            phase: Phase::Sending(sender),
        })
    }

    /// Returns the number of the command that it answers.
    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// Takes what the autopilot says of missions; returns how it has ended, if it has.
    pub(super) fn hear(
        &mut self,
        now: Time,
        message: &MavMessage,
        frame: &EarthFrame,
        out: &mut Vec<DriverOut>,
    ) -> Option<UploadResult> {
        match &mut self.phase {
            Phase::Sending(sender) => {
                let end = said(out, |said| sender.hear(now, message, said))?;
                self.sent(now, end, out)
            }
            Phase::Reading(reader) => {
                let received = said(out, |said| reader.hear(now, message, said));
                self.read(received, frame)
            }
        }
    }

    /// Returns when something is to be said next.
    pub(super) fn deadline(&self) -> Time {
        match &self.phase {
            Phase::Sending(sender) => sender.deadline(),
            Phase::Reading(reader) => reader.deadline(),
        }
    }

    /// Says what is due by now; returns how it has ended, if it has.
    pub(super) fn due(
        &mut self,
        now: Time,
        frame: &EarthFrame,
        out: &mut Vec<DriverOut>,
    ) -> Option<UploadResult> {
        match &mut self.phase {
            Phase::Sending(sender) => {
                let end = said(out, |said| sender.due(now, said))?;
                self.sent(now, end, out)
            }
            Phase::Reading(reader) => {
                let received = said(out, |said| reader.due(now, said));
                self.read(received, frame)
            }
        }
    }

    /// Goes on when all was sent.
    fn sent(
        &mut self,
        now: Time,
        end: UploadEnd,
        out: &mut Vec<DriverOut>,
    ) -> Option<UploadResult> {
        match end {
            UploadEnd::Judged(MavMissionResult::MAV_MISSION_ACCEPTED) | UploadEnd::Unjudged => {
                let reader = said(out, |said| MissionReader::begin(now, self.to, said));
                self.phase = Phase::Reading(reader);
                None
            }
            UploadEnd::Judged(MavMissionResult::MAV_MISSION_UNSUPPORTED) => {
                let complaint = "the mission has an item that the autopilot does not know";
                Some(self.end(CommandAck::Unsupported, Some(complaint.to_owned())))
            }
            UploadEnd::Judged(refusal) => {
                let complaint = format!("the autopilot refuses the mission: {refusal:?}");
                Some(self.end(CommandAck::Denied, Some(complaint)))
            }
            UploadEnd::Silent => {
                let complaint = "the autopilot does not take the mission: it does not answer";
                Some(self.end(CommandAck::Failed, Some(complaint.to_owned())))
            }
        }
    }

    /// Compares what is stored with what was sent, when all of it is there.
    fn read(&self, received: Received, frame: &EarthFrame) -> Option<UploadResult> {
        match received {
            Received::Going => None,
            Received::Gone => {
                let complaint = "the mission was sent, and could not be read back";
                Some(self.end(CommandAck::Failed, Some(complaint.to_owned())))
            }
            Received::Whole(stored) => Some(match difference(&self.items, &stored, frame) {
                None => self.end(CommandAck::Accepted, None),
                Some(complaint) => self.end(CommandAck::Failed, Some(complaint)),
            }),
        }
    }

    fn end(&self, ack: CommandAck, complaint: Option<String>) -> UploadResult {
        UploadResult {
            number: self.number,
            ack,
            complaint,
        }
    }
}

/// Returns in what a stored mission differs from the one that was sent, but for home: that is the autopilot's own.
fn difference(
    sent: &[Item],
    stored: &[MISSION_ITEM_INT_DATA],
    frame: &EarthFrame,
) -> Option<String> {
    // One that stores nothing may count its home nevertheless.
    if sent.len().max(1) != stored.len().max(1) {
        return Some(format!(
            "the autopilot stores {} items of a mission of {}",
            stored.len(),
            sent.len()
        ));
    }
    let differs = |(sent, stored): (&Item, &MISSION_ITEM_INT_DATA)| match sent {
        Item::Other { .. } => {
            !to_wire(sent, frame).is_some_and(|sent| is_same_command(&sent, stored))
        }
        _ => !from_wire(stored, frame).is_ok_and(|stored| is_stored_as(sent, &stored)),
    };
    let item = sent.iter().zip(stored).skip(1).position(differs)? + 1;
    Some(format!("the autopilot stores item {item} otherwise"))
}

/// Passes on what a machine says.
fn said<T>(out: &mut Vec<DriverOut>, act: impl FnOnce(&mut Vec<MavMessage>) -> T) -> T {
    let mut said = Vec::new();
    let result = act(&mut said);
    said.into_iter()
        .for_each(|message| super::say(out, message));
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Bearing, Geodetic, Point};
    use std::time::Duration;

    fn frame() -> EarthFrame {
        let datum = Geodetic {
            latitude_deg: 52.0,
            longitude_deg: 4.0,
            altitude_m: 0.0,
        };
        EarthFrame::new(datum, Bearing::from_degrees(90.0))
    }

    fn mission() -> Vec<Item> {
        let to = |x_m: f64, delay_s: f64| Item::Waypoint {
            at: Point::new(x_m, 3.0),
            altitude_m: 0.0,
            delay: Duration::from_secs_f64(delay_s),
        };
        vec![to(0.0, 0.0), to(4.0, 1.5), Item::Speed(0.5), to(6.0, 0.0)]
    }

    fn stored_of(items: &[Item]) -> Vec<MISSION_ITEM_INT_DATA> {
        let wire = items.iter().map(|item| to_wire(item, &frame()));
        wire.map(Option::unwrap).collect()
    }

    #[test]
    fn a_mission_is_stored_as_it_was_sent_up_to_what_an_autopilot_keeps() {
        let mut stored = stored_of(&mission());
        assert_eq!(difference(&mission(), &stored, &frame()), None);
        // Home is its own, and it keeps whole seconds.
        stored[0].x += 5_000;
        stored[1].param1 = 1.0;
        assert_eq!(difference(&mission(), &stored, &frame()), None);
        assert_eq!(difference(&[], &[], &frame()), None);
        assert_eq!(difference(&[], &stored[..1], &frame()), None);
    }

    #[test]
    fn a_mission_that_is_stored_otherwise_is_told_by_its_item() {
        let told = |change: fn(&mut Vec<MISSION_ITEM_INT_DATA>)| {
            let mut stored = stored_of(&mission());
            change(&mut stored);
            difference(&mission(), &stored, &frame()).unwrap()
        };
        for change in [
            |stored: &mut Vec<MISSION_ITEM_INT_DATA>| stored[2].param2 = 0.6,
            |stored: &mut Vec<MISSION_ITEM_INT_DATA>| stored.swap(2, 3),
            |stored: &mut Vec<MISSION_ITEM_INT_DATA>| stored[2].param2 = f32::NAN,
        ] {
            assert_eq!(told(change), "the autopilot stores item 2 otherwise");
        }
        assert!(told(|stored| stored[3].x += 10).contains("item 3"));
        let fewer = told(|stored| stored.truncate(3));
        assert_eq!(fewer, "the autopilot stores 3 items of a mission of 4");
    }
}
