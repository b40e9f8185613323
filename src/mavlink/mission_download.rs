//! The download of a stored mission (<https://mavlink.io/en/services/mission.html>): how many items there are, then one
//! after the other, each asked for again until it comes.
//!
//! ```text
//!   Counting ─ how many there are ─► Asking(item) … ─ the last ─► whole
//! ```
//!
//! A pure machine: it is told what came and what time it is. What the items mean is not known here.

use std::time::Duration;

use super::dialect::{MISSION_ACK_DATA, MISSION_REQUEST_LIST_DATA, MavMessage, MavMissionType};
use super::frames::MavAddress;
use super::mission_upload::{MissionReceiver, Received};
use crate::time::Time;

/// How many there are is asked for again after this time.
const ASK_AGAIN: Duration = Duration::from_millis(500);
/// Who does not say it for this long does not answer.
const COUNT_WITHIN: Duration = Duration::from_secs(5);

/// Reads a stored mission.
#[derive(Clone, Debug)]
pub struct MissionReader {
    of: MavAddress,
    phase: Phase,
}

#[derive(Clone, Debug)]
enum Phase {
    Counting { begun: Time, asked: Time },
    Asking(MissionReceiver),
}

impl MissionReader {
    /// Begins to read what somebody stores.
    pub fn begin(now: Time, of: MavAddress, out: &mut Vec<MavMessage>) -> MissionReader {
        ask_for_count(of, out);
        MissionReader {
            of,
            phase: Phase::Counting {
                begun: now,
                asked: now,
            },
        }
    }

    /// Hears what the one who stores it says.
    pub fn hear(&mut self, now: Time, message: &MavMessage, out: &mut Vec<MavMessage>) -> Received {
        let is_mission = |kind| kind == MavMissionType::MAV_MISSION_TYPE_MISSION;
        let received = match (&mut self.phase, message) {
            (Phase::Counting { .. }, MavMessage::MISSION_COUNT(count))
                if is_mission(count.mission_type) =>
            {
                if count.count > 0 {
                    let receiver = MissionReceiver::begin(now, self.of, count.count, out);
                    self.phase = Phase::Asking(receiver);
                    return Received::Going;
                }
                Received::Whole(Vec::new())
            }
            (Phase::Asking(receiver), MavMessage::MISSION_ITEM_INT(item))
                if is_mission(item.mission_type) =>
            {
                receiver.hear(now, item, out)
            }
            _ => Received::Going,
        };
        if let Received::Whole(_) = received {
            out.push(MavMessage::MISSION_ACK(MISSION_ACK_DATA {
                target_system: self.of.system,
                target_component: self.of.component,
                ..MISSION_ACK_DATA::default()
            }));
        }
        received
    }

    /// Returns when it is to be asked again without a message.
    pub fn deadline(&self) -> Time {
        match &self.phase {
            Phase::Counting { asked, .. } => *asked + ASK_AGAIN,
            Phase::Asking(receiver) => receiver.deadline(),
        }
    }

    /// Goes on when its deadline has come.
    pub fn due(&mut self, now: Time, out: &mut Vec<MavMessage>) -> Received {
        match &mut self.phase {
            Phase::Counting { begun, .. } if now.since(*begun) >= COUNT_WITHIN => Received::Gone,
            Phase::Counting { asked, .. } => {
                if now >= *asked + ASK_AGAIN {
                    *asked = now;
                    ask_for_count(self.of, out);
                }
                Received::Going
            }
            Phase::Asking(receiver) => receiver.due(now, out),
        }
    }
}

fn ask_for_count(of: MavAddress, out: &mut Vec<MavMessage>) {
    out.push(MavMessage::MISSION_REQUEST_LIST(
        MISSION_REQUEST_LIST_DATA {
            target_system: of.system,
            target_component: of.component,
            ..MISSION_REQUEST_LIST_DATA::default()
        },
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mavlink::dialect::{MISSION_COUNT_DATA, MISSION_ITEM_INT_DATA};

    const OF: MavAddress = MavAddress {
        system: 1,
        component: 1,
    };

    /// What one who stores so many items answers.
    fn answer(count: u16, message: &MavMessage) -> Option<MavMessage> {
        Some(match message {
            MavMessage::MISSION_REQUEST_LIST(_) => MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
                count,
                ..MISSION_COUNT_DATA::default()
            }),
            MavMessage::MISSION_REQUEST_INT(request) => {
                MavMessage::MISSION_ITEM_INT(MISSION_ITEM_INT_DATA {
                    seq: request.seq,
                    x: i32::from(request.seq),
                    ..MISSION_ITEM_INT_DATA::default()
                })
            }
            MavMessage::MISSION_ACK(_) => return None,
            other => panic!("{other:?}"),
        })
    }

    /// Reads so many items over a link that loses some messages; returns what came, how long it took, s, and whether the one
    /// who stores them was told that it is over.
    fn read(count: u16, is_lost: impl Fn(usize) -> bool) -> (Received, f64, bool) {
        let (mut said, mut sent) = (Vec::new(), 0);
        let mut reader = MissionReader::begin(Time::ZERO, OF, &mut said);
        for step in 1..100_000_u32 {
            let now = Time::ZERO + Duration::from_millis(20) * step;
            let mut received = reader.due(now, &mut said);
            for message in std::mem::take(&mut said) {
                sent += 1;
                let answered = (!is_lost(sent)).then(|| answer(count, &message)).flatten();
                sent += 1;
                if let Some(answered) = answered.filter(|_| !is_lost(sent)) {
                    received = reader.hear(now, &answered, &mut said);
                }
            }
            if received != Received::Going {
                let is_told = matches!(said.last(), Some(MavMessage::MISSION_ACK(_)));
                return (received, now.as_secs_f64(), is_told);
            }
        }
        panic!("it does not end")
    }

    #[test]
    fn all_items_come_in_their_order_over_a_link_that_loses_some() {
        for is_lost in [|_| false, |sent| sent % 20 == 7] {
            let (received, took_s, is_told) = read(300, is_lost);
            let Received::Whole(items) = received else {
                panic!("{received:?}")
            };
            assert!(items.iter().map(|item| item.x).eq(0..300));
            assert!(is_told && took_s < 15.0, "{took_s}");
        }
    }

    #[test]
    fn nothing_is_stored_and_nobody_answers_are_told_apart() {
        assert_eq!(read(0, |_| false).0, Received::Whole(Vec::new()));
        let (received, took_s, is_told) = read(3, |_| true);
        assert_eq!((received, is_told), (Received::Gone, false));
        assert!((4.9..5.5).contains(&took_s), "{took_s}");
        assert_eq!(read(300, |sent| sent > 100).0, Received::Gone);
    }
}
