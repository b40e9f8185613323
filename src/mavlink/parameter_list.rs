//! Reading all parameters of an autopilot (<https://mavlink.io/en/services/parameter.html>): it is asked for the list, and
//! when it has fallen silent for every value that was lost. A pure machine.
//!
//! ```text
//!   Listing ─ silent for a while ─► Filling (a few that are missing at a time) ─ all there ─► over
//! ```

use std::collections::BTreeMap;
use std::time::Duration;

use super::dialect::{
    MavMessage, MavParamType, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA,
};
use super::frames::MavAddress;
use crate::time::Time;

/// No value for this long, and what is missing is asked for.
const QUIET: Duration = Duration::from_millis(250);
/// So many that are missing are asked for at a time.
const AT_A_TIME: usize = 20;
/// So often without any answer at most.
const TRIES_MAX: u32 = 12;

/// A parameter.
#[derive(Clone, PartialEq, Debug)]
pub struct Parameter {
    /// Up to 16 letters.
    pub name: String,
    /// As ArduPilot sends it: a number, whatever its type.
    pub value: f32,
    /// Its type.
    pub kind: MavParamType,
}

/// How far a list has come.
#[derive(Clone, PartialEq, Debug)]
pub enum ListEnd {
    /// All values, in their order.
    Whole(Vec<Parameter>),
    /// It does not answer.
    Silent,
}

/// Reads the list of parameters.
#[derive(Clone, Debug)]
pub struct ParameterList {
    of: MavAddress,
    /// How many there are, once one has come.
    count: Option<u16>,
    values: BTreeMap<u16, Parameter>,
    /// When a value came, or was asked for, last.
    active: Time,
    tries: u32,
}

impl ParameterList {
    /// Asks for the list.
    pub fn begin(now: Time, of: MavAddress, out: &mut Vec<MavMessage>) -> ParameterList {
        let list = ParameterList {
            of,
            count: None,
            values: BTreeMap::new(),
            active: now,
            tries: 1,
        };
        list.ask_for_all(out);
        list
    }

    /// Hears a value; returns the list when it is whole.
    pub fn hear(&mut self, now: Time, value: &PARAM_VALUE_DATA) -> Option<ListEnd> {
        // An answer to somebody's PARAM_SET has no index.
        if value.param_index >= value.param_count {
            return None;
        }
        (self.count, self.active, self.tries) = (Some(value.param_count), now, 0);
        let parameter = Parameter {
            name: value.param_id.to_str().unwrap_or_default().to_owned(),
            value: value.param_value,
            kind: value.param_type,
        };
        self.values.insert(value.param_index, parameter);
        let is_whole = self.values.len() >= usize::from(value.param_count);
        is_whole.then(|| ListEnd::Whole(std::mem::take(&mut self.values).into_values().collect()))
    }

    /// Returns when it is to be asked again without a value.
    pub fn deadline(&self) -> Time {
        self.active + QUIET
    }

    /// Goes on when its deadline has come; returns how it has ended, if it has.
    pub fn due(&mut self, now: Time, out: &mut Vec<MavMessage>) -> Option<ListEnd> {
        if now < self.deadline() {
            return None;
        }
        if self.tries >= TRIES_MAX {
            return Some(ListEnd::Silent);
        }
        (self.active, self.tries) = (now, self.tries + 1);
        match self.count {
            None => self.ask_for_all(out),
            Some(count) => {
                let missing = (0..count).filter(|index| !self.values.contains_key(index));
                out.extend(missing.take(AT_A_TIME).map(|index| self.ask_for(index)));
            }
        }
        None
    }

    fn ask_for_all(&self, out: &mut Vec<MavMessage>) {
        out.push(MavMessage::PARAM_REQUEST_LIST(PARAM_REQUEST_LIST_DATA {
            target_system: self.of.system,
            target_component: self.of.component,
        }));
    }

    fn ask_for(&self, index: u16) -> MavMessage {
        MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index: index as i16,
            target_system: self.of.system,
            target_component: self.of.component,
            ..PARAM_REQUEST_READ_DATA::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OF: MavAddress = MavAddress {
        system: 1,
        component: 1,
    };

    fn value(index: u16, count: u16) -> PARAM_VALUE_DATA {
        PARAM_VALUE_DATA {
            param_index: index,
            param_count: count,
            param_value: f32::from(index),
            param_id: format!("P{index}").as_str().into(),
            ..Default::default()
        }
    }

    /// Reads so many values that come five every 10 ms, of which some are lost; returns the end and how long it took, seconds.
    fn read(count: u16, is_lost: impl Fn(usize) -> bool) -> (ListEnd, f64) {
        let mut out = Vec::new();
        let mut list = ParameterList::begin(Time::ZERO, OF, &mut out);
        let (mut sent, mut queue) = (0, Vec::new());
        for step in 1..100_000_u32 {
            let now = Time::ZERO + Duration::from_millis(10) * step;
            for request in std::mem::take(&mut out) {
                sent += 1;
                match request {
                    _ if is_lost(sent) => {}
                    MavMessage::PARAM_REQUEST_LIST(_) => queue.extend(0..count),
                    MavMessage::PARAM_REQUEST_READ(read) => queue.push(read.param_index as u16),
                    other => panic!("{other:?}"),
                }
            }
            for index in queue.drain(..queue.len().min(5)) {
                sent += 1;
                if !is_lost(sent)
                    && let Some(end) = list.hear(now, &value(index, count))
                {
                    return (end, now.as_secs_f64());
                }
            }
            if let Some(end) = list.due(now, &mut out) {
                return (end, now.as_secs_f64());
            }
        }
        panic!("it never ends")
    }

    #[test]
    fn a_thousand_values_come_over_a_link_that_loses_some() {
        for every in [usize::MAX, 20, 7] {
            let (end, took_s) = read(1000, |sent| sent % every == every / 2);
            let ListEnd::Whole(values) = end else {
                panic!("{end:?}")
            };
            let names: Vec<String> = (0..1000).map(|index| format!("P{index}")).collect();
            assert_eq!(
                values
                    .iter()
                    .map(|one| one.name.clone())
                    .collect::<Vec<_>>(),
                names
            );
            assert!(took_s < 5.0 || every == 7, "{took_s}");
        }
    }

    #[test]
    fn one_that_says_nothing_and_one_that_falls_silent_end_it() {
        let (end, took_s) = read(10, |_| true);
        assert_eq!(end, ListEnd::Silent);
        assert!((2.0..5.0).contains(&took_s), "{took_s}");
        assert_eq!(read(1000, |sent| sent > 400).0, ListEnd::Silent);
        assert_eq!(
            ParameterList::begin(Time::ZERO, OF, &mut Vec::new()).hear(Time::ZERO, &value(7, 7)),
            None
        );
    }
}
