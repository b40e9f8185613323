//! The upload of a mission, both sides of it (<https://mavlink.io/en/services/mission.html>). The receiver asks for one
//! item after the other, and asks again; the sender answers whatever is asked, and ends when the receiver has judged.
//!
//! ```text
//!   sender:    Announcing ─ asked for an item ─► Answering ─ judged ─► over
//!   receiver:  Asking(item) ─ the item ─► Asking(next) … ─ the last ─► whole, to be judged
//! ```
//!
//! Pure machines: they are told what came and what time it is. What the items mean is not known here.

#![allow(deprecated, reason = "receivers still ask by MISSION_REQUEST")]

use std::time::Duration;

use super::dialect::{
    MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_ITEM_INT_DATA, MISSION_REQUEST_INT_DATA,
    MavMessage, MavMissionResult, MavMissionType,
};
use super::frames::MavAddress;
use crate::time::Time;

/// That a mission comes is said again after this time.
const ANNOUNCE_AGAIN: Duration = Duration::from_millis(500);
/// So often at most.
const ANNOUNCEMENTS_MAX: u32 = 10;
/// A receiver that does not ask for this long has gone.
const SENDER_WAITS: Duration = Duration::from_secs(10);
/// One that has asked for the last item has judged by then.
const JUDGED_WITHIN: Duration = Duration::from_secs(2);
/// An item that does not come is asked for again after this time.
const ASK_AGAIN: Duration = Duration::from_millis(200);
/// A sender of which nothing comes for this long has gone.
const RECEIVER_WAITS: Duration = Duration::from_secs(8);

/// How an upload has ended.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum UploadEnd {
    /// The receiver's judgement.
    Judged(MavMissionResult),
    /// All items were asked for, and no judgement has come: it may have been lost.
    Unjudged,
    /// It does not answer.
    Silent,
}

/// Sends a mission.
#[derive(Clone, Debug)]
pub struct MissionSender {
    to: MavAddress,
    items: Vec<MISSION_ITEM_INT_DATA>,
    /// When it was asked for something last.
    asked: Option<Time>,
    /// Whether that was the last item.
    is_last_asked: bool,
    announced: Time,
    announcements: u32,
}

impl MissionSender {
    /// Begins to send; the numbers of the items are set here.
    pub fn begin(
        now: Time,
        to: MavAddress,
        mut items: Vec<MISSION_ITEM_INT_DATA>,
        out: &mut Vec<MavMessage>,
    ) -> MissionSender {
        for (seq, item) in items.iter_mut().enumerate() {
            (item.target_system, item.target_component) = (to.system, to.component);
            item.seq = seq as u16;
        }
        let mut sender = MissionSender {
            to,
            items,
            asked: None,
            is_last_asked: false,
            announced: now,
            announcements: 0,
        };
        sender.announce(now, out);
        sender
    }

    fn announce(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        (self.announced, self.announcements) = (now, self.announcements + 1);
        out.push(MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
            target_system: self.to.system,
            target_component: self.to.component,
            count: self.items.len() as u16,
            ..MISSION_COUNT_DATA::default()
        }));
    }

    /// Hears what the receiver says; returns how it has ended, if it has.
    pub fn hear(
        &mut self,
        now: Time,
        message: &MavMessage,
        out: &mut Vec<MavMessage>,
    ) -> Option<UploadEnd> {
        let seq = match message {
            MavMessage::MISSION_REQUEST_INT(request) if is_mission(request.mission_type) => {
                request.seq
            }
            MavMessage::MISSION_REQUEST(request) if is_mission(request.mission_type) => request.seq,
            MavMessage::MISSION_ACK(ack) if is_mission(ack.mission_type) => {
                // One that came before anything was asked for answers an earlier upload, unless it refuses.
                let is_ours = self.asked.is_some()
                    || self.items.is_empty()
                    || ack.mavtype != MavMissionResult::MAV_MISSION_ACCEPTED;
                return is_ours.then_some(UploadEnd::Judged(ack.mavtype));
            }
            _ => return None,
        };
        self.asked = Some(now);
        self.is_last_asked = usize::from(seq) + 1 == self.items.len();
        if let Some(item) = self.items.get(usize::from(seq)) {
            out.push(MavMessage::MISSION_ITEM_INT(item.clone()));
        }
        None
    }

    /// Returns when it is to be asked again without a message.
    pub fn deadline(&self) -> Time {
        match self.asked {
            Some(asked) if self.is_last_asked => asked + JUDGED_WITHIN,
            Some(asked) => asked + SENDER_WAITS,
            None => self.announced + ANNOUNCE_AGAIN,
        }
    }

    /// Goes on when its deadline has come; returns how it has ended, if it has.
    pub fn due(&mut self, now: Time, out: &mut Vec<MavMessage>) -> Option<UploadEnd> {
        if now < self.deadline() {
            return None;
        }
        if self.is_last_asked {
            return Some(UploadEnd::Unjudged);
        }
        if self.asked.is_some() || self.announcements >= ANNOUNCEMENTS_MAX {
            return Some(UploadEnd::Silent);
        }
        self.announce(now, out);
        None
    }
}

/// What a receiver has come to.
#[derive(Clone, PartialEq, Debug)]
pub enum Received {
    /// It goes on.
    Going,
    /// All items are there, to be judged.
    Whole(Vec<MISSION_ITEM_INT_DATA>),
    /// The sender has gone.
    Gone,
}

/// Receives a mission.
#[derive(Clone, Debug)]
pub struct MissionReceiver {
    from: MavAddress,
    count: u16,
    items: Vec<MISSION_ITEM_INT_DATA>,
    asked: Time,
    heard: Time,
}

impl MissionReceiver {
    /// Begins to receive what a sender has announced.
    pub fn begin(
        now: Time,
        from: MavAddress,
        count: u16,
        out: &mut Vec<MavMessage>,
    ) -> MissionReceiver {
        let mut receiver = MissionReceiver {
            from,
            count,
            items: Vec::new(),
            asked: now,
            heard: now,
        };
        receiver.ask(now, out);
        receiver
    }

    /// Returns who sends.
    pub fn from(&self) -> MavAddress {
        self.from
    }

    /// Hears an item; one that was not asked for is refused by its number and changes nothing.
    pub fn hear(
        &mut self,
        now: Time,
        item: &MISSION_ITEM_INT_DATA,
        out: &mut Vec<MavMessage>,
    ) -> Received {
        self.heard = now;
        let wanted = self.items.len();
        let seq = usize::from(item.seq);
        if seq < wanted {
            // Said again, since our next request was lost.
            return Received::Going;
        }
        if seq > wanted {
            out.push(MavMessage::MISSION_ACK(MISSION_ACK_DATA {
                target_system: self.from.system,
                target_component: self.from.component,
                mavtype: MavMissionResult::MAV_MISSION_INVALID_SEQUENCE,
                ..MISSION_ACK_DATA::default()
            }));
            return Received::Going;
        }
        self.items.push(item.clone());
        if self.items.len() == usize::from(self.count) {
            return Received::Whole(std::mem::take(&mut self.items));
        }
        self.ask(now, out);
        Received::Going
    }

    /// Returns when it is to be asked again without a message.
    pub fn deadline(&self) -> Time {
        self.asked + ASK_AGAIN
    }

    /// Goes on when its deadline has come.
    pub fn due(&mut self, now: Time, out: &mut Vec<MavMessage>) -> Received {
        if now.since(self.heard) >= RECEIVER_WAITS {
            return Received::Gone;
        }
        if now >= self.deadline() {
            self.ask(now, out);
        }
        Received::Going
    }

    fn ask(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        self.asked = now;
        out.push(MavMessage::MISSION_REQUEST_INT(MISSION_REQUEST_INT_DATA {
            target_system: self.from.system,
            target_component: self.from.component,
            seq: self.items.len() as u16,
            ..MISSION_REQUEST_INT_DATA::default()
        }));
    }
}

fn is_mission(kind: MavMissionType) -> bool {
    kind == MavMissionType::MAV_MISSION_TYPE_MISSION
}

/// Returns the judgement of a mission.
pub fn mission_ack(
    to: MavAddress,
    mission_type: MavMissionType,
    result: MavMissionResult,
) -> MavMessage {
    MavMessage::MISSION_ACK(MISSION_ACK_DATA {
        target_system: to.system,
        target_component: to.component,
        mavtype: result,
        mission_type,
        ..MISSION_ACK_DATA::default()
    })
}

/// Returns how many items are stored, to whom asks for them.
pub fn mission_count(to: MavAddress, mission_type: MavMissionType, count: u16) -> MavMessage {
    MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
        count,
        target_system: to.system,
        target_component: to.component,
        mission_type,
        ..MISSION_COUNT_DATA::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENDER: MavAddress = MavAddress {
        system: 255,
        component: 190,
    };
    const RECEIVER: MavAddress = MavAddress {
        system: 1,
        component: 1,
    };

    fn items(count: usize) -> Vec<MISSION_ITEM_INT_DATA> {
        let item = |index: usize| MISSION_ITEM_INT_DATA {
            x: index as i32,
            ..Default::default()
        };
        (0..count).map(item).collect()
    }

    /// Sends so many items over a link with 10 ms of delay that loses some messages; returns the end, what was received and
    /// when.
    fn upload(count: usize, is_lost: impl Fn(usize) -> bool) -> (Option<UploadEnd>, Vec<i32>, f64) {
        let mut out = Vec::new();
        let mut sender = MissionSender::begin(Time::ZERO, RECEIVER, items(count), &mut out);
        let mut receiver: Option<MissionReceiver> = None;
        let (mut whole, mut end, mut sent) = (Vec::new(), None, 0);
        let mut on_the_way: Vec<(bool, MavMessage)> =
            out.drain(..).map(|message| (true, message)).collect();
        for step in 1..100_000_u32 {
            let now = Time::ZERO + Duration::from_millis(10) * step;
            let (mut to_sender, mut to_receiver) = (Vec::new(), Vec::new());
            for (is_senders, message) in std::mem::take(&mut on_the_way) {
                sent += 1;
                if is_lost(sent) {
                    continue;
                }
                match (is_senders, &message) {
                    (true, MavMessage::MISSION_COUNT(count)) => {
                        if receiver.is_none() {
                            receiver = Some(MissionReceiver::begin(
                                now,
                                SENDER,
                                count.count,
                                &mut to_sender,
                            ));
                        }
                    }
                    (true, MavMessage::MISSION_ITEM_INT(item)) => {
                        if let Some(heard) = &mut receiver
                            && let Received::Whole(items) = heard.hear(now, item, &mut to_sender)
                        {
                            whole = items.iter().map(|item| item.x).collect();
                            receiver = None;
                            to_sender.push(MavMessage::MISSION_ACK(MISSION_ACK_DATA::default()));
                        }
                    }
                    (false, message) => end = end.or(sender.hear(now, message, &mut to_receiver)),
                    other => panic!("{other:?}"),
                }
            }
            end = end.or(sender.due(now, &mut to_receiver));
            if let Some(asking) = &mut receiver
                && asking.due(now, &mut to_sender) == Received::Gone
            {
                receiver = None;
            }
            on_the_way.extend(to_receiver.into_iter().map(|message| (true, message)));
            on_the_way.extend(to_sender.into_iter().map(|message| (false, message)));
            if end.is_some() {
                return (end, whole, now.as_secs_f64());
            }
        }
        (end, whole, f64::INFINITY)
    }

    #[test]
    fn seven_hundred_items_come_over_a_link_that_loses_some() {
        let all: Vec<i32> = (0..700).collect();
        let accepted = Some(UploadEnd::Judged(MavMissionResult::MAV_MISSION_ACCEPTED));
        let (end, received, took_s) = upload(700, |_| false);
        assert_eq!((end, &received), (accepted, &all));
        assert!(took_s < 15.0, "{took_s}");
        let (end, received, took_s) = upload(700, |sent| sent % 20 == 7);
        assert_eq!((end, &received), (accepted, &all));
        assert!(took_s < 40.0, "{took_s}");
    }

    #[test]
    fn a_receiver_that_is_not_there_ends_the_upload() {
        let (end, received, took_s) = upload(3, |_| true);
        assert_eq!((end, received.len()), (Some(UploadEnd::Silent), 0));
        assert!((4.0..6.0).contains(&took_s), "{took_s}");
        let (end, ..) = upload(300, |sent| sent > 100);
        assert_eq!(end, Some(UploadEnd::Silent));
    }

    #[test]
    fn a_judgement_that_is_lost_is_told_from_a_receiver_that_is_gone() {
        // Of three items: the announcement, three times a request and an item, the judgement.
        let (end, received, took_s) = upload(3, |sent| sent > 7);
        assert_eq!((end, received.len()), (Some(UploadEnd::Unjudged), 3));
        assert!((2.0..2.5).contains(&took_s), "{took_s}");
    }
}
