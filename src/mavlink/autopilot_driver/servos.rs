//! A servo on an output of the autopilot: DO_SET_SERVO with the newest pulse, said again until the autopilot confirms it.
//!
//! Who measures with what the servo turns must know where it stands: a pulse counts as given when it was confirmed in time, or
//! is requested once more after that. Until then a reading would be taken for a direction that the sensor does not look along.
//!
//! ```text
//!   [nothing requested] ──pulse──► [pending] ──accepted──► [accepted]
//!                                 │ ▲                   │ another pulse
//!                        150 ms: again └────────────────┘
//!                                 └──refused──► [refused] ──a pulse──► [pending]
//! ```
//!
//! An answer does not say of which pulse it is: answers are counted, and one that was lost would make every later one look like
//! that of the pulse before, as long as another pulse comes before this one is said again. After three tenths of a second
//! without a confirmed pulse none is said therefore until 150 ms after the last one, when what was not answered is lost.

use std::time::Duration;

use super::{DriverOut, say};
use crate::mavlink::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavCmd, MavMessage, MavResult};
use crate::mavlink::frames::MavAddress;
use crate::time::Time;

/// What nobody confirms is said again after this time.
const AGAIN: Duration = Duration::from_millis(150);
/// A servo that hears of its pulse later than this is not where it is expected when it has settled.
const CONFIRMED_WITHIN: Duration = Duration::from_millis(80);
/// When no pulse was confirmed for so long, the next one waits until those before it are answered or lost.
const COUNT_ANEW_AFTER: Duration = Duration::from_millis(300);
/// That no pulse is confirmed for so long is a trouble.
const TROUBLE_AFTER: Duration = Duration::from_secs(1);

/// A pulse of a servo.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ServoPulse {
    /// The number of the autopilot's output, 1 to 32.
    pub output: u8,
    /// The width of the pulse, microseconds.
    pub width_us: u16,
}

/// Why a servo does not stand where it should.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum ServoTrouble {
    /// The autopilot says nothing to it.
    #[error("output {output}: the autopilot does not confirm its pulse")]
    Silent {
        /// The number of the output.
        output: u8,
    },
    /// The autopilot confirms it too late.
    #[error("output {output}: the autopilot confirms its pulse after {after_s:.2} s only")]
    Late {
        /// The number of the output.
        output: u8,
        /// How long it took, seconds.
        after_s: f64,
    },
    /// The autopilot refuses it.
    #[error("output {output}: the autopilot refuses ({result:?}); is SERVO{output}_FUNCTION 0?")]
    Refused {
        /// The number of the output.
        output: u8,
        /// What it answers.
        result: MavResult,
    },
}

/// The servo of an autopilot.
#[derive(Clone, Debug, Default)]
pub(super) struct Servo {
    requested: Option<RequestedPulse>,
    /// When a pulse was requested first after the last one that was accepted or refused.
    unconfirmed_since: Option<Time>,
    /// That the last one accepted was late.
    late: Option<ServoTrouble>,
    /// What was answered to a pulse that was refused after the last one accepted.
    refused: Option<MavResult>,
}

#[derive(Clone, Copy, Debug)]
struct RequestedPulse {
    pulse: ServoPulse,
    /// When it was requested first.
    since: Time,
    state: State,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// It has no answer yet, or waits to be said: when the last one was said, this or one before it, and how many of them are
    /// not answered.
    Pending {
        at: Time,
        unanswered: u32,
        is_said: bool,
    },
    /// The autopilot gives it.
    Accepted { in_time: bool },
    /// The autopilot does not give it.
    Refused,
}

impl Servo {
    /// Says a pulse, unless the servo has it.
    pub(super) fn give(
        &mut self,
        now: Time,
        pulse: ServoPulse,
        target: MavAddress,
        out: &mut Vec<DriverOut>,
    ) {
        let since = *self.unconfirmed_since.get_or_insert(now);
        let mut pending = State::Pending {
            at: now,
            unanswered: 1,
            is_said: true,
        };
        if let Some(requested) = &mut self.requested {
            match &mut requested.state {
                // It has stood there since.
                State::Accepted { in_time } if requested.pulse == pulse => {
                    self.unconfirmed_since = None;
                    return *in_time = true;
                }
                State::Pending { .. } if requested.pulse == pulse => return,
                State::Pending { at, unanswered, .. } => {
                    let waits = now.since(since) >= COUNT_ANEW_AFTER && now < *at + AGAIN;
                    pending = State::Pending {
                        at: if waits { *at } else { now },
                        unanswered: *unanswered + u32::from(!waits),
                        is_said: !waits,
                    };
                }
                State::Accepted { .. } | State::Refused => {}
            }
        }
        let is_said = matches!(pending, State::Pending { is_said: true, .. });
        self.requested = Some(RequestedPulse {
            pulse,
            since: now,
            state: pending,
        });
        if is_said {
            say_pulse(pulse, target, out);
        }
    }

    /// Takes an answer.
    pub(super) fn answer(&mut self, now: Time, ack: &COMMAND_ACK_DATA) {
        let Some(RequestedPulse {
            pulse,
            since,
            state,
        }) = &mut self.requested
        else {
            return;
        };
        let State::Pending {
            unanswered,
            is_said,
            ..
        } = state
        else {
            return;
        };
        let is_accepted = ack.result == MavResult::MAV_RESULT_ACCEPTED;
        if !is_accepted {
            self.refused = Some(ack.result);
        }
        *unanswered = unanswered.saturating_sub(1);
        // Of a pulse before this one.
        if *unanswered > 0 || !*is_said {
            return;
        }
        self.unconfirmed_since = None;
        if !is_accepted {
            *state = State::Refused;
            return;
        }
        self.refused = None;
        let after = now.since(*since);
        let in_time = after <= CONFIRMED_WITHIN;
        self.late = (!in_time).then_some(ServoTrouble::Late {
            output: pulse.output,
            after_s: after.as_secs_f64(),
        });
        *state = State::Accepted { in_time };
    }

    /// Forgets what it has: the autopilot has started anew.
    pub(super) fn forget(&mut self) {
        (self.requested, self.unconfirmed_since, self.refused) = (None, None, None);
    }

    /// Returns when something is to be said again.
    pub(super) fn deadline(&self) -> Option<Time> {
        match self.requested?.state {
            State::Pending { at, .. } => Some(at + AGAIN),
            State::Accepted { .. } | State::Refused => None,
        }
    }

    /// Says what waits to be said, and again what nobody has confirmed.
    pub(super) fn due(&mut self, now: Time, target: MavAddress, out: &mut Vec<DriverOut>) {
        if self.deadline().is_none_or(|due| now < due) {
            return;
        }
        if let Some(requested) = &mut self.requested
            && let State::Pending { .. } = requested.state
        {
            // What was not answered until now is lost.
            requested.state = State::Pending {
                at: now,
                unanswered: 1,
                is_said: true,
            };
            say_pulse(requested.pulse, target, out);
        }
    }

    /// Returns the pulse by which the servo stands; `None` while that is not known.
    pub(super) fn given(&self) -> Option<ServoPulse> {
        let requested = self.requested?;
        matches!(requested.state, State::Accepted { in_time: true }).then_some(requested.pulse)
    }

    /// Returns why it does not stand where it should.
    pub(super) fn trouble(&self, now: Time) -> Option<ServoTrouble> {
        let requested = self.requested?;
        let output = requested.pulse.output;
        if let Some(result) = self.refused {
            return Some(ServoTrouble::Refused { output, result });
        }
        let is_silent = |since: Time| now.since(since) > TROUBLE_AFTER;
        match self.unconfirmed_since {
            Some(since) if is_silent(since) => Some(ServoTrouble::Silent { output }),
            _ => self.late,
        }
    }
}

fn say_pulse(pulse: ServoPulse, target: MavAddress, out: &mut Vec<DriverOut>) {
    let command = COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_DO_SET_SERVO,
        target_system: target.system,
        target_component: target.component,
        param1: f32::from(pulse.output),
        param2: f32::from(pulse.width_us),
        ..COMMAND_LONG_DATA::default()
    };
    say(out, MavMessage::COMMAND_LONG(command));
}

#[cfg(test)]
mod tests {
    use super::*;

    const TARGET: MavAddress = MavAddress {
        system: 1,
        component: 1,
    };

    fn at(time_ms: u64) -> Time {
        Time::from_nanos(time_ms * 1_000_000)
    }

    fn pulse(width_us: u16) -> ServoPulse {
        ServoPulse {
            output: 9,
            width_us,
        }
    }

    fn said(out: &mut Vec<DriverOut>) -> Vec<u16> {
        let width = |said: DriverOut| {
            let DriverOut::Say(message) = said else {
                panic!("{said:?}")
            };
            let MavMessage::COMMAND_LONG(command) = *message else {
                panic!("{message:?}")
            };
            assert_eq!(command.command, MavCmd::MAV_CMD_DO_SET_SERVO);
            assert_eq!((command.param1, command.target_system), (9.0, 1));
            command.param2 as u16
        };
        std::mem::take(out).into_iter().map(width).collect()
    }

    fn ack(result: MavResult) -> COMMAND_ACK_DATA {
        COMMAND_ACK_DATA {
            command: MavCmd::MAV_CMD_DO_SET_SERVO,
            result,
            ..COMMAND_ACK_DATA::default()
        }
    }

    fn accepted() -> COMMAND_ACK_DATA {
        ack(MavResult::MAV_RESULT_ACCEPTED)
    }

    #[test]
    fn a_pulse_is_said_at_once_and_again_until_it_is_confirmed() {
        let (mut servo, mut out) = (Servo::default(), Vec::new());
        assert_eq!(servo.deadline(), None);
        servo.give(at(0), pulse(1200), TARGET, &mut out);
        servo.give(at(10), pulse(1200), TARGET, &mut out);
        assert_eq!((said(&mut out), servo.given()), (vec![1200], None));
        servo.due(at(149), TARGET, &mut out);
        assert!(said(&mut out).is_empty());
        servo.due(at(150), TARGET, &mut out);
        assert_eq!(said(&mut out), [1200]);
        servo.answer(at(170), &accepted());
        assert_eq!(servo.deadline(), None);
        assert_eq!(servo.given(), None, "confirmed too late to measure by");
        servo.give(at(200), pulse(1200), TARGET, &mut out);
        assert_eq!(servo.given(), Some(pulse(1200)), "it has stood there since");
        assert!(said(&mut out).is_empty(), "it needs not be told");
        servo.give(at(300), pulse(1500), TARGET, &mut out);
        assert_eq!((said(&mut out), servo.given()), (vec![1500], None));
        servo.answer(at(350), &accepted());
        assert_eq!(servo.given(), Some(pulse(1500)));
        servo.forget();
        servo.give(at(400), pulse(1500), TARGET, &mut out);
        assert_eq!(said(&mut out), [1500], "it was started anew");
    }

    #[test]
    fn an_answer_to_the_pulse_before_confirms_nothing() {
        let (mut servo, mut out) = (Servo::default(), Vec::new());
        servo.give(at(0), pulse(1200), TARGET, &mut out);
        servo.give(at(20), pulse(1800), TARGET, &mut out);
        servo.answer(at(30), &accepted());
        assert_eq!(servo.given(), None);
        servo.answer(at(40), &accepted());
        assert_eq!(servo.given(), Some(pulse(1800)));
        servo.answer(at(41), &ack(MavResult::MAV_RESULT_FAILED));
        assert_eq!(servo.given(), Some(pulse(1800)), "nothing was asked");
    }

    #[test]
    fn one_that_is_silent_while_it_swings_is_a_trouble_as_well() {
        let (mut servo, mut out) = (Servo::default(), Vec::new());
        for turn in 0..12 {
            servo.give(at(100 * turn), pulse(1200 + turn as u16), TARGET, &mut out);
        }
        assert_eq!(servo.trouble(at(1000)), None);
        let silent = Some(ServoTrouble::Silent { output: 9 });
        assert_eq!(servo.trouble(at(1101)), silent);
        servo.answer(at(1110), &accepted());
        assert_eq!(servo.trouble(at(1120)), silent, "to a pulse before");
    }

    /// Swings every 100 ms for so many pulses, each answered 20 ms after it was said, but for the third one; returns how many
    /// were given in time, and the last trouble.
    fn swing_and_lose_an_answer(pulses: u64, answer: &COMMAND_ACK_DATA) -> (usize, Servo) {
        let (mut servo, mut out, mut given) = (Servo::default(), Vec::new(), 0);
        let (mut said_at, mut count): (Vec<u64>, usize) = (Vec::new(), 0);
        for ms in (0..100 * pulses).step_by(10) {
            servo.due(at(ms), TARGET, &mut out);
            if ms % 100 == 0 {
                let wanted = pulse(1200 + (ms / 100 % 2) as u16);
                servo.give(at(ms), wanted, TARGET, &mut out);
            }
            said_at.extend(said(&mut out).iter().map(|_| ms));
            while said_at.first().is_some_and(|said_at| ms >= said_at + 20) {
                said_at.remove(0);
                count += 1;
                if count != 3 {
                    servo.answer(at(ms), answer);
                }
            }
            given += usize::from(ms % 100 == 80 && servo.given().is_some());
        }
        (given, servo)
    }

    #[test]
    fn an_answer_that_is_lost_costs_a_few_pulses_and_no_more() {
        let (given, servo) = swing_and_lose_an_answer(40, &accepted());
        assert!((35..40).contains(&given), "{given} of 40");
        assert_eq!(servo.trouble(at(4000)), None);
    }

    #[test]
    fn a_refusal_is_a_trouble_until_a_pulse_is_accepted() {
        let (given, mut servo) =
            swing_and_lose_an_answer(40, &ack(MavResult::MAV_RESULT_UNSUPPORTED));
        assert_eq!(given, 0);
        let mut out = Vec::new();
        let is_refused =
            |servo: &Servo| matches!(servo.trouble(at(4010)), Some(ServoTrouble::Refused { .. }));
        assert!(is_refused(&servo));
        servo.give(at(4000), pulse(1300), TARGET, &mut out);
        assert!(is_refused(&servo), "also while the next one is pending");
        servo.answer(at(4010), &accepted());
        assert_eq!(servo.trouble(at(4010)), None);
    }

    #[test]
    fn an_answer_that_comes_when_the_next_pulse_waits_does_not_confirm_it() {
        let (mut servo, mut out) = (Servo::default(), Vec::new());
        for turn in 0..3 {
            servo.give(at(100 * turn), pulse(1200 + turn as u16), TARGET, &mut out);
        }
        assert_eq!(said(&mut out), [1200, 1201, 1202]);
        servo.give(at(300), pulse(1203), TARGET, &mut out);
        assert!(said(&mut out).is_empty(), "it waits");
        (0..3).for_each(|_| servo.answer(at(320), &accepted()));
        assert_eq!(servo.given(), None, "it was not said");
        servo.due(at(350), TARGET, &mut out);
        assert_eq!(said(&mut out), [1203]);
        servo.answer(at(370), &accepted());
        assert_eq!(servo.given(), Some(pulse(1203)));
    }

    #[test]
    fn one_that_is_silent_late_or_refuses_is_a_trouble() {
        let (mut servo, mut out) = (Servo::default(), Vec::new());
        assert_eq!(servo.trouble(at(0)), None);
        servo.give(at(0), pulse(1200), TARGET, &mut out);
        assert_eq!(servo.trouble(at(900)), None);
        let silent = servo.trouble(at(1100)).unwrap();
        assert_eq!(silent, ServoTrouble::Silent { output: 9 });
        servo.answer(at(1200), &accepted());
        let late = servo.trouble(at(1200)).unwrap().to_string();
        assert!(late.contains("after 1.20 s"), "{late}");
        servo.give(at(1300), pulse(1300), TARGET, &mut out);
        servo.answer(at(1310), &accepted());
        assert_eq!(servo.trouble(at(1310)), None);
        servo.give(at(1400), pulse(1400), TARGET, &mut out);
        servo.answer(at(1410), &ack(MavResult::MAV_RESULT_FAILED));
        let refused = servo.trouble(at(1410)).unwrap().to_string();
        assert!(refused.contains("SERVO9_FUNCTION"), "{refused}");
        assert_eq!((servo.given(), servo.deadline()), (None, None));
        out.clear();
        servo.give(at(1500), pulse(1400), TARGET, &mut out);
        assert_eq!(said(&mut out), [1400], "it is tried again");
    }
}
