//! What an autopilot is asked for when it was heard: which messages, how often, and the origin of its frame. Said again
//! until it is answered, and from the beginning when it has started anew or was silent.
//!
//! ```text
//!   [not heard] ──heartbeat──► [asking: message after message] ──all answered──► [done]
//!        ▲                           │ refused: its group by REQUEST_DATA_STREAM      │
//!        └── 3 s without a heartbeat or what was asked for, started anew ─────────────┘
//! ```

use std::time::Duration;

use super::heard::Heard;
use super::ranges::DISTANCE_SENSOR;
use super::{DriverOut, MavlinkDriverSettings, say};
use crate::mavlink::command_call::{CallEnd, CommandCall};
use crate::mavlink::dialect::{
    self as d, COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavCmd, MavDataStream, MavMessage, MavResult,
};
use crate::mavlink::frames::MavAddress;
use crate::mavlink::wire_message::EKF_STATUS;
use crate::time::Time;

/// Messages that are wanted: their number, how often a second, and the group that REQUEST_DATA_STREAM has them in. The attitude
/// comes first: a place without one is not believed.
const WANTED: [(u32, u16, MavDataStream); 10] = [
    (30, 10, MavDataStream::MAV_DATA_STREAM_EXTRA1),
    (33, 10, MavDataStream::MAV_DATA_STREAM_POSITION),
    (32, 10, MavDataStream::MAV_DATA_STREAM_POSITION),
    (24, 2, MavDataStream::MAV_DATA_STREAM_EXTENDED_STATUS),
    (1, 2, MavDataStream::MAV_DATA_STREAM_EXTENDED_STATUS),
    (245, 2, MavDataStream::MAV_DATA_STREAM_EXTENDED_STATUS),
    (42, 5, MavDataStream::MAV_DATA_STREAM_EXTENDED_STATUS),
    (65, 5, MavDataStream::MAV_DATA_STREAM_RC_CHANNELS),
    (230, 2, MavDataStream::MAV_DATA_STREAM_EXTRA3),
    (EKF_STATUS, 2, MavDataStream::MAV_DATA_STREAM_EXTRA3),
];
/// Messages that are asked for once.
const ASKED_ONCE: [u32; 3] = [148, 49, 242];
/// A whole group is never asked for more often, so that a slow serial line carries it.
const GROUP_MOST_HZ: u16 = 10;
/// Without a heartbeat for this long it may have forgotten what it was asked for.
const FORGETS_AFTER: Duration = Duration::from_secs(3);
/// An origin that it does not take is said again after this time.
const ORIGIN_AGAIN: Duration = Duration::from_secs(1);

/// What is asked for.
#[derive(Clone, Debug)]
pub(super) struct Setup {
    /// Messages that are wanted, as in [`WANTED`].
    wanted: Vec<(u32, u16, MavDataStream)>,
    heard: Option<Time>,
    /// When it began to ask.
    begun: Option<Time>,
    /// How many of the questions are answered; `None` = not begun.
    answered: Option<usize>,
    call: Option<CommandCall>,
    origin_due: Option<Time>,
}

impl Setup {
    /// Begins with an autopilot that was not heard; distances are wanted so often a second, if they are.
    pub(super) fn new(distances_hz: Option<u16>) -> Setup {
        let group = MavDataStream::MAV_DATA_STREAM_EXTRA3;
        let distances = distances_hz.map(|rate_hz| (DISTANCE_SENSOR, rate_hz, group));
        Setup {
            wanted: WANTED.into_iter().chain(distances).collect(),
            heard: None,
            begun: None,
            answered: None,
            call: None,
            origin_due: None,
        }
    }

    /// Takes note of a heartbeat, and of when it last said something of what it was asked for.
    pub(super) fn heard(&mut self, now: Time, told: Option<Time>) {
        let is_long_ago = |at: Option<Time>| at.is_none_or(|at| now.since(at) > FORGETS_AFTER);
        let was_gone = is_long_ago(self.heard);
        // It has started anew so fast that no heartbeat was missed.
        let has_forgotten = self.is_done() && is_long_ago(told) && is_long_ago(self.begun);
        self.heard = Some(now);
        if was_gone || has_forgotten {
            self.begin_again(now);
        }
    }

    /// Begins from the beginning.
    pub(super) fn begin_again(&mut self, now: Time) {
        (self.answered, self.call, self.origin_due) = (Some(0), None, Some(now));
        self.begun = Some(now);
    }

    /// Returns whether everything was answered.
    fn is_done(&self) -> bool {
        self.answered
            .is_some_and(|answered| answered >= self.wanted.len() + ASKED_ONCE.len())
    }

    /// Takes an answer. One that does not set a message's rate, as old firmware, is asked for the message's whole group.
    pub(super) fn take_ack(
        &mut self,
        now: Time,
        from: MavAddress,
        ack: &COMMAND_ACK_DATA,
        out: &mut Vec<DriverOut>,
    ) {
        let Some(end) = self
            .call
            .as_mut()
            .and_then(|call| call.hear(now, from, ack))
        else {
            return;
        };
        let wanted = self.answered.and_then(|answered| self.wanted.get(answered));
        let is_set = end == CallEnd::Answered(MavResult::MAV_RESULT_ACCEPTED);
        if let (false, Some((_, rate_hz, group))) = (is_set, wanted) {
            let request = d::REQUEST_DATA_STREAM_DATA {
                req_message_rate: (*rate_hz).min(GROUP_MOST_HZ),
                target_system: from.system,
                target_component: from.component,
                req_stream_id: *group,
                start_stop: 1,
            };
            say(out, MavMessage::REQUEST_DATA_STREAM(request));
        }
        self.call = None;
        self.answered = self.answered.map(|answered| answered + 1);
    }

    /// Returns when something is to be said next.
    pub(super) fn deadline(&self) -> Option<Time> {
        let asks = match (&self.call, self.answered) {
            (Some(call), _) => Some(call.deadline()),
            (None, Some(_)) if !self.is_done() => self.heard,
            (None, _) => None,
        };
        [asks, self.origin_due].into_iter().flatten().min()
    }

    /// Says what is due by now.
    pub(super) fn due(
        &mut self,
        now: Time,
        target: MavAddress,
        settings: &MavlinkDriverSettings,
        heard: &Heard,
        out: &mut Vec<DriverOut>,
    ) {
        self.say_origin(now, target, settings, heard, out);
        let mut said = Vec::new();
        if let Some(call) = &mut self.call {
            if call.due(now, &mut said).is_some() {
                // It answers nothing: the next heartbeat begins again.
                (self.call, self.answered, self.heard) = (None, None, None);
            }
        } else if let Some(question) = self.answered.and_then(|index| self.question(index)) {
            self.call = Some(CommandCall::begin(now, target, question, &mut said));
        }
        said.into_iter().for_each(|message| say(out, message));
    }

    /// Gives it the origin of its frame, until it says that it has one.
    fn say_origin(
        &mut self,
        now: Time,
        target: MavAddress,
        settings: &MavlinkDriverSettings,
        heard: &Heard,
        out: &mut Vec<DriverOut>,
    ) {
        if !settings.sets_origin || heard.has_origin() {
            self.origin_due = None;
            return;
        }
        if self.origin_due.is_none_or(|due| now < due) {
            return;
        }
        self.origin_due = Some(now + ORIGIN_AGAIN);
        let datum = settings.frame.datum;
        say(
            out,
            MavMessage::SET_GPS_GLOBAL_ORIGIN(d::SET_GPS_GLOBAL_ORIGIN_DATA {
                latitude: (datum.latitude_deg * 1e7).round() as i32,
                longitude: (datum.longitude_deg * 1e7).round() as i32,
                altitude: (datum.altitude_m * 1e3).round() as i32,
                target_system: target.system,
                ..d::SET_GPS_GLOBAL_ORIGIN_DATA::default()
            }),
        );
    }

    /// Returns a question by its place in the order.
    fn question(&self, index: usize) -> Option<COMMAND_LONG_DATA> {
        if let Some((message, rate_hz, _)) = self.wanted.get(index) {
            return Some(COMMAND_LONG_DATA {
                command: MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
                param1: *message as f32,
                param2: 1e6 / f32::from(*rate_hz),
                ..COMMAND_LONG_DATA::default()
            });
        }
        let message = ASKED_ONCE.get(index - self.wanted.len())?;
        Some(COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_REQUEST_MESSAGE,
            param1: *message as f32,
            ..COMMAND_LONG_DATA::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_asked_for_as_often_as_they_are_wanted_and_a_group_never_floods_the_line() {
        assert_eq!(Setup::new(None).wanted.len(), WANTED.len());
        let mut setup = Setup::new(Some(40));
        setup.begin_again(Time::ZERO);
        setup.answered = Some(WANTED.len());
        let target = MavAddress {
            system: 1,
            component: 1,
        };
        let asked = setup.question(WANTED.len()).unwrap();
        assert_eq!((asked.param1, asked.param2), (132.0, 25_000.0));
        let mut said = Vec::new();
        setup.call = Some(CommandCall::begin(Time::ZERO, target, asked, &mut said));
        let refused = COMMAND_ACK_DATA {
            command: MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
            result: MavResult::MAV_RESULT_FAILED,
            ..COMMAND_ACK_DATA::default()
        };
        let mut out = Vec::new();
        setup.take_ack(Time::ZERO, target, &refused, &mut out);
        let [DriverOut::Say(message)] = &out[..] else {
            panic!("{out:?}")
        };
        let MavMessage::REQUEST_DATA_STREAM(request) = message.as_ref() else {
            panic!("{message:?}")
        };
        assert_eq!(
            (request.req_message_rate, request.req_stream_id),
            (10, MavDataStream::MAV_DATA_STREAM_EXTRA3)
        );
        assert_eq!(setup.answered, Some(WANTED.len() + 1));
    }
}
