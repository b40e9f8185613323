//! Reading some parameters by their names (<https://mavlink.io/en/services/parameter.html>). An autopilot says nothing of a
//! name that it has not, so one that stays unanswered is asked for a few times and then left, until it is asked for anew. A
//! pure machine.
//!
//! ```text
//!   Asking (all that are left, again and again) ─ all answered, or asked often enough ─► over
//!     ▲                                                                                 │
//!     └────────────────────────────── begun again, some left ───────────────────────────┘
//! ```

use std::collections::BTreeMap;
use std::time::Duration;

use super::dialect::{MavMessage, PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA};
use super::frames::MavAddress;
use crate::time::Time;

/// What is unanswered is asked for again after this time.
const AGAIN: Duration = Duration::from_millis(500);
/// So often at most.
const TIMES_MAX: u32 = 4;

/// Reads some parameters.
#[derive(Clone, Debug)]
pub struct ParameterReads {
    of: MavAddress,
    left: Vec<&'static str>,
    values: BTreeMap<&'static str, f32>,
    due: Time,
    times: u32,
    /// It was over before it was begun again.
    was_over: bool,
}

impl ParameterReads {
    /// Begins; nothing is asked for before [`ParameterReads::due`].
    pub fn begin(now: Time, of: MavAddress, names: &[&'static str]) -> ParameterReads {
        ParameterReads {
            of,
            left: names.to_vec(),
            values: BTreeMap::new(),
            due: now,
            times: 0,
            was_over: false,
        }
    }

    /// Asks for what is unanswered as in the beginning.
    pub fn begin_again(&mut self, now: Time) {
        self.was_over |= self.is_over();
        (self.due, self.times) = (now, 0);
    }

    /// Returns since when nothing is asked for although some are unanswered; `None` while they are, and when there are none.
    pub fn left_since(&self) -> Option<Time> {
        (!self.left.is_empty() && self.is_over()).then_some(self.due)
    }

    /// Returns whether it is over, or was before it was begun again.
    pub fn has_been_over(&self) -> bool {
        self.was_over || self.is_over()
    }

    /// Hears a value; one that nobody asked for changes nothing. Values change while others set them: the newest counts.
    pub fn hear(&mut self, value: &PARAM_VALUE_DATA) {
        let said = value.param_id.to_str().unwrap_or_default();
        if let Some(index) = self.left.iter().position(|name| *name == said) {
            self.values
                .insert(self.left.swap_remove(index), value.param_value);
        } else if let Some(known) = self.values.get_mut(said) {
            *known = value.param_value;
        }
    }

    /// Returns when something is to be asked for next; `None` when it is over.
    pub fn deadline(&self) -> Option<Time> {
        (!self.is_over()).then_some(self.due)
    }

    /// Asks for what is unanswered, when its time has come.
    pub fn due(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        if self.is_over() || now < self.due {
            return;
        }
        (self.due, self.times) = (now + AGAIN, self.times + 1);
        out.extend(self.left.iter().map(|name| {
            MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
                param_index: -1,
                target_system: self.of.system,
                target_component: self.of.component,
                param_id: (*name).into(),
            })
        }));
    }

    /// Returns whether all are answered, or were asked for often enough.
    pub fn is_over(&self) -> bool {
        self.left.is_empty() || self.times >= TIMES_MAX
    }

    /// Returns what is known so far, by name.
    pub fn values(&self) -> &BTreeMap<&'static str, f32> {
        &self.values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OF: MavAddress = MavAddress {
        system: 3,
        component: 1,
    };

    fn value(name: &str, value: f32) -> PARAM_VALUE_DATA {
        PARAM_VALUE_DATA {
            param_id: name.into(),
            param_value: value,
            ..PARAM_VALUE_DATA::default()
        }
    }

    fn asked(reads: &mut ParameterReads, now: Time) -> Vec<String> {
        let mut out = Vec::new();
        reads.due(now, &mut out);
        let name = |message: MavMessage| match message {
            MavMessage::PARAM_REQUEST_READ(read) => {
                assert_eq!((read.param_index, read.target_system), (-1, 3));
                read.param_id.to_str().unwrap().to_owned()
            }
            other => panic!("{other:?}"),
        };
        out.into_iter().map(name).collect()
    }

    #[test]
    fn what_is_lost_is_asked_for_again_and_what_does_not_exist_is_left() {
        let mut reads =
            ParameterReads::begin(Time::ZERO, OF, &["FS_ACTION", "NO_SUCH", "BATT_MONITOR"]);
        assert_eq!(
            asked(&mut reads, Time::ZERO),
            ["FS_ACTION", "NO_SUCH", "BATT_MONITOR"]
        );
        reads.hear(&value("FS_ACTION", 2.0));
        reads.hear(&value("WP_SPEED", 9.0));
        assert_eq!(asked(&mut reads, Time::from_secs_f64(0.4)), [""; 0]);
        assert_eq!(
            asked(&mut reads, Time::from_secs_f64(0.5)),
            ["BATT_MONITOR", "NO_SUCH"]
        );
        reads.hear(&value("BATT_MONITOR", 4.0));
        reads.hear(&value("FS_ACTION", 1.0));
        for second in [1.0, 1.5] {
            assert_eq!(asked(&mut reads, Time::from_secs_f64(second)), ["NO_SUCH"]);
        }
        assert!(reads.is_over() && reads.deadline().is_none());
        assert_eq!(reads.left_since(), Some(Time::from_secs_f64(2.0)));
        assert_eq!(asked(&mut reads, Time::from_secs_f64(9.0)), [""; 0]);
        reads.begin_again(Time::from_secs_f64(10.0));
        assert!(!reads.is_over() && reads.has_been_over() && reads.left_since().is_none());
        for second in [10.0, 10.5, 11.0, 11.5] {
            assert_eq!(asked(&mut reads, Time::from_secs_f64(second)), ["NO_SUCH"]);
        }
        assert!(reads.is_over());
        let known: Vec<(&str, f32)> = reads
            .values()
            .iter()
            .map(|(name, value)| (*name, *value))
            .collect();
        assert_eq!(known, [("BATT_MONITOR", 4.0), ("FS_ACTION", 1.0)]);
    }
}
