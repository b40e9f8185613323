//! One visit to an autopilot for its parameters (<https://mavlink.io/en/services/parameter.html>): all are read, some are
//! set, and what the autopilot answers is what counts. It says no heartbeat: a ground station that is heard and then leaves
//! would trip the autopilot's failsafe. A pure machine.
//!
//! ```text
//!   Listing ─ all there, and an ArduPilot was heard ─► Setting (one after the other) ─► over
//! ```

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use super::dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, PARAM_SET_DATA, PARAM_VALUE_DATA};
use super::frames::{Content, Frame, MavAddress};
use super::parameter_list::{ListEnd, Parameter, ParameterList};
use crate::time::Time;

/// It must have been heard within this time.
const HEARD_WITHIN: Duration = Duration::from_secs(10);
/// A value that is not confirmed is said again after this time.
const AGAIN: Duration = Duration::from_millis(500);
/// So often at most.
const TIMES_MAX: u32 = 6;
/// So often, when it has answered with another value: that may have been an older answer.
const TIMES_OTHER: u32 = 2;

/// What a parameter was, and has become.
#[derive(Clone, PartialEq, Debug)]
pub struct ChangedParameter {
    /// Its name.
    pub name: String,
    /// What it was.
    pub was: f32,
    /// What it was to be.
    pub asked: f32,
    /// What the autopilot says that it is; `None` when it does not answer.
    pub is: Option<f32>,
}

/// How a visit has ended.
#[derive(Clone, PartialEq, Debug)]
pub enum VisitEnd {
    /// All is read, and what was to be set was said to the autopilot.
    Done {
        /// All parameters as they are now, in the autopilot's order.
        parameters: Vec<Parameter>,
        /// What was to be set.
        changed: Vec<ChangedParameter>,
    },
    /// Nothing was set, since it has none of these.
    Unknown(Vec<String>),
    /// It was not heard; other systems were.
    NeverHeard {
        /// Those, by their ids.
        others: BTreeSet<u8>,
    },
    /// It was heard, but does not tell its parameters.
    Silent,
    /// It is no ArduPilot: what its values mean is not known.
    Firmware {
        /// The number of its firmware (MAV_AUTOPILOT).
        found: u8,
    },
}

/// A visit to an autopilot.
#[derive(Clone, Debug)]
pub struct ParameterVisit {
    of: MavAddress,
    /// What is to be set.
    changes: Vec<(String, f32)>,
    /// When it is given up, unless it was heard.
    heard_by: Time,
    is_ardupilot: bool,
    others: BTreeSet<u8>,
    stage: Stage,
}

#[derive(Clone, Debug)]
enum Stage {
    Listing(ParameterList),
    /// All are read; its heartbeat is awaited.
    Listed(Vec<Parameter>),
    Setting(Setting),
}

#[derive(Clone, Debug)]
struct Setting {
    parameters: Vec<Parameter>,
    /// Where in `parameters` they stand, and what they are to be; the first one is being set.
    left: VecDeque<(usize, f32)>,
    changed: Vec<ChangedParameter>,
    due: Time,
    times: u32,
    /// What it has answered for the first one, although something else was asked.
    kept: Option<f32>,
}

impl ParameterVisit {
    /// Asks an autopilot for its parameters, to set some of them then.
    pub fn begin(
        now: Time,
        of: MavAddress,
        changes: Vec<(String, f32)>,
        out: &mut Vec<MavMessage>,
    ) -> ParameterVisit {
        ParameterVisit {
            of,
            changes,
            heard_by: now + HEARD_WITHIN,
            is_ardupilot: false,
            others: BTreeSet::new(),
            stage: Stage::Listing(ParameterList::begin(now, of, out)),
        }
    }

    /// Hears a frame; returns how the visit has ended, if it has.
    pub fn hear(
        &mut self,
        now: Time,
        frame: &Frame,
        out: &mut Vec<MavMessage>,
    ) -> Option<VisitEnd> {
        if frame.from != self.of {
            self.others.insert(frame.from.system);
            return None;
        }
        let Content::Message(message) = &frame.content else {
            return None;
        };
        match message.as_ref() {
            MavMessage::HEARTBEAT(heartbeat) => self.take_heartbeat(now, heartbeat, out),
            MavMessage::PARAM_VALUE(value) => self.take_value(now, value, out),
            _ => None,
        }
    }

    /// Returns when it is to be told the time next.
    pub fn deadline(&self) -> Time {
        match &self.stage {
            Stage::Listing(list) => list.deadline(),
            Stage::Listed(_) => self.heard_by,
            Stage::Setting(setting) => setting.due,
        }
    }

    /// Goes on when its deadline has come; returns how it has ended, if it has.
    pub fn due(&mut self, now: Time, out: &mut Vec<MavMessage>) -> Option<VisitEnd> {
        if now < self.deadline() {
            return None;
        }
        match &mut self.stage {
            Stage::Listing(list) => match list.due(now, out)? {
                ListEnd::Silent if self.is_ardupilot => Some(VisitEnd::Silent),
                ListEnd::Silent if now >= self.heard_by => Some(self.never_heard()),
                ListEnd::Silent => {
                    self.stage = Stage::Listing(ParameterList::begin(now, self.of, out));
                    None
                }
                ListEnd::Whole(parameters) => self.listed(now, parameters, out),
            },
            Stage::Listed(_) => Some(self.never_heard()),
            Stage::Setting(setting) => setting.due(now, self.of, out),
        }
    }

    fn never_heard(&self) -> VisitEnd {
        VisitEnd::NeverHeard {
            others: self.others.clone(),
        }
    }

    fn take_heartbeat(
        &mut self,
        now: Time,
        heartbeat: &HEARTBEAT_DATA,
        out: &mut Vec<MavMessage>,
    ) -> Option<VisitEnd> {
        if heartbeat.autopilot != MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA {
            return Some(VisitEnd::Firmware {
                found: heartbeat.autopilot as u8,
            });
        }
        self.is_ardupilot = true;
        let Stage::Listed(parameters) = &mut self.stage else {
            return None;
        };
        let parameters = std::mem::take(parameters);
        self.begin_to_set(now, parameters, out)
    }

    fn take_value(
        &mut self,
        now: Time,
        value: &PARAM_VALUE_DATA,
        out: &mut Vec<MavMessage>,
    ) -> Option<VisitEnd> {
        match &mut self.stage {
            Stage::Listing(list) => match list.hear(now, value)? {
                ListEnd::Whole(parameters) => self.listed(now, parameters, out),
                ListEnd::Silent => None,
            },
            Stage::Listed(_) => None,
            Stage::Setting(setting) => setting.hear(now, value, self.of, out),
        }
    }

    fn listed(
        &mut self,
        now: Time,
        parameters: Vec<Parameter>,
        out: &mut Vec<MavMessage>,
    ) -> Option<VisitEnd> {
        if self.is_ardupilot {
            return self.begin_to_set(now, parameters, out);
        }
        self.stage = Stage::Listed(parameters);
        None
    }

    fn begin_to_set(
        &mut self,
        now: Time,
        parameters: Vec<Parameter>,
        out: &mut Vec<MavMessage>,
    ) -> Option<VisitEnd> {
        let mut left = VecDeque::new();
        let mut unknown = Vec::new();
        for (name, value) in &self.changes {
            match parameters.iter().position(|one| one.name == *name) {
                Some(index) => left.push_back((index, *value)),
                None => unknown.push(name.clone()),
            }
        }
        if !unknown.is_empty() {
            return Some(VisitEnd::Unknown(unknown));
        }
        let mut setting = Setting {
            parameters,
            left,
            changed: Vec::new(),
            due: now,
            times: 0,
            kept: None,
        };
        let end = setting.due(now, self.of, out);
        self.stage = Stage::Setting(setting);
        end
    }
}

impl Setting {
    /// Says the value of the first one again, or gives it up.
    fn due(&mut self, now: Time, of: MavAddress, out: &mut Vec<MavMessage>) -> Option<VisitEnd> {
        let is_enough =
            self.times >= TIMES_MAX || (self.kept.is_some() && self.times >= TIMES_OTHER);
        if is_enough {
            let kept = self.kept;
            return self.next(now, kept, of, out);
        }
        let Some((index, value)) = self.left.front() else {
            return Some(VisitEnd::Done {
                parameters: std::mem::take(&mut self.parameters),
                changed: std::mem::take(&mut self.changed),
            });
        };
        let parameter = &self.parameters[*index];
        (self.due, self.times) = (now + AGAIN, self.times + 1);
        out.push(MavMessage::PARAM_SET(PARAM_SET_DATA {
            param_value: *value,
            target_system: of.system,
            target_component: of.component,
            param_id: parameter.name.as_str().into(),
            param_type: parameter.kind,
        }));
        None
    }

    fn hear(
        &mut self,
        now: Time,
        value: &PARAM_VALUE_DATA,
        of: MavAddress,
        out: &mut Vec<MavMessage>,
    ) -> Option<VisitEnd> {
        let (index, asked) = *self.left.front()?;
        if value.param_id.to_str().ok() != Some(self.parameters[index].name.as_str()) {
            return None;
        }
        if value.param_value == asked {
            return self.next(now, Some(asked), of, out);
        }
        self.kept = Some(value.param_value);
        None
    }

    /// Notes what the first one is, and goes on with the next one.
    fn next(
        &mut self,
        now: Time,
        is: Option<f32>,
        of: MavAddress,
        out: &mut Vec<MavMessage>,
    ) -> Option<VisitEnd> {
        if let Some((index, asked)) = self.left.pop_front() {
            let parameter = &mut self.parameters[index];
            let was = parameter.value;
            parameter.value = is.unwrap_or(was);
            self.changed.push(ChangedParameter {
                name: parameter.name.clone(),
                was,
                asked,
                is,
            });
        }
        (self.times, self.kept) = (0, None);
        self.due(now, of, out)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::mavlink::dialect::MavType;

    const OF: MavAddress = MavAddress {
        system: 3,
        component: 1,
    };

    /// An autopilot that may lose what is said to it, keeps some values, and rounds.
    struct Autopilot {
        values: BTreeMap<&'static str, f32>,
        firmware: MavAutopilot,
        system: u8,
        says_values: bool,
        /// It hears nothing of this many messages.
        deaf_for: u32,
        read_only: &'static str,
    }

    impl Autopilot {
        fn new() -> Autopilot {
            Autopilot {
                values: BTreeMap::from([
                    ("ARMING_CHECK", 1.0),
                    ("CRUISE_SPEED", 2.0),
                    ("STAT_RUNTIME", 7.0),
                ]),
                firmware: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                system: 3,
                says_values: true,
                deaf_for: 0,
                read_only: "STAT_RUNTIME",
            }
        }

        fn frame(&self, message: MavMessage) -> Frame {
            Frame {
                from: MavAddress {
                    system: self.system,
                    component: 1,
                },
                sequence: 0,
                content: Content::Message(Box::new(message)),
            }
        }

        fn value(&self, index: usize, is_of_list: bool) -> Frame {
            let (name, value) = self.values.iter().nth(index).unwrap();
            self.frame(MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
                param_id: (*name).into(),
                param_value: *value,
                param_count: self.values.len() as u16,
                param_index: if is_of_list { index as u16 } else { u16::MAX },
                ..PARAM_VALUE_DATA::default()
            }))
        }

        fn answer(&mut self, said: &MavMessage) -> Vec<Frame> {
            if self.deaf_for > 0 {
                self.deaf_for -= 1;
                return Vec::new();
            }
            match said {
                MavMessage::PARAM_REQUEST_LIST(_) if self.says_values => (0..self.values.len())
                    .map(|index| self.value(index, true))
                    .collect(),
                MavMessage::PARAM_SET(set) => {
                    let index = self
                        .values
                        .keys()
                        .position(|name| set.param_id.to_str() == Ok(name))
                        .unwrap();
                    let name = *self.values.keys().nth(index).unwrap();
                    if name != self.read_only {
                        self.values.insert(name, set.param_value.round());
                    }
                    vec![self.value(index, false)]
                }
                _ => Vec::new(),
            }
        }

        /// Carries a visit to its end; returns that, and how long it took, seconds.
        fn visited(&mut self, changes: &[(&str, f32)]) -> (VisitEnd, f64) {
            let changes = changes
                .iter()
                .map(|(name, value)| ((*name).to_owned(), *value))
                .collect();
            let mut said = Vec::new();
            let mut visit = ParameterVisit::begin(Time::ZERO, OF, changes, &mut said);
            for step in 0..4_000_u32 {
                let now = Time::from_secs_f64(f64::from(step) * 0.01);
                let mut heard: Vec<Frame> = std::mem::take(&mut said)
                    .iter()
                    .flat_map(|said| self.answer(said))
                    .collect();
                if step % 100 == 50 {
                    heard.push(self.frame(MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                        mavtype: MavType::MAV_TYPE_GROUND_ROVER,
                        autopilot: self.firmware,
                        ..HEARTBEAT_DATA::default()
                    })));
                }
                let end = heard
                    .iter()
                    .find_map(|frame| visit.hear(now, frame, &mut said));
                if let Some(end) = end.or_else(|| visit.due(now, &mut said)) {
                    return (end, now.as_secs_f64());
                }
            }
            panic!("it never ends");
        }
    }

    #[test]
    fn all_are_read_and_what_was_asked_is_set_although_messages_are_lost() {
        for lost in 0..5 {
            let mut autopilot = Autopilot::new();
            autopilot.deaf_for = lost;
            let (end, _) = autopilot.visited(&[("CRUISE_SPEED", 3.0)]);
            let VisitEnd::Done {
                parameters,
                changed,
            } = end
            else {
                panic!("{end:?}");
            };
            let shown: Vec<_> = parameters
                .iter()
                .map(|one| (one.name.as_str(), one.value))
                .collect();
            assert_eq!(
                shown,
                [
                    ("ARMING_CHECK", 1.0),
                    ("CRUISE_SPEED", 3.0),
                    ("STAT_RUNTIME", 7.0)
                ]
            );
            let one = ChangedParameter {
                name: "CRUISE_SPEED".to_owned(),
                was: 2.0,
                asked: 3.0,
                is: Some(3.0),
            };
            assert_eq!(changed, [one]);
            assert_eq!(autopilot.values["CRUISE_SPEED"], 3.0);
        }
    }

    #[test]
    fn what_an_autopilot_keeps_or_rounds_is_told_and_the_rest_is_set() {
        let (end, _) = Autopilot::new().visited(&[
            ("STAT_RUNTIME", 0.0),
            ("ARMING_CHECK", 0.4),
            ("CRUISE_SPEED", 1.0),
        ]);
        let VisitEnd::Done { changed, .. } = end else {
            panic!("{end:?}");
        };
        let shown: Vec<_> = changed.iter().map(|one| (one.asked, one.is)).collect();
        assert_eq!(
            shown,
            [(0.0, Some(7.0)), (0.4, Some(0.0)), (1.0, Some(1.0))]
        );
    }

    #[test]
    fn an_unknown_name_keeps_everything_as_it_is() {
        let mut autopilot = Autopilot::new();
        let (end, _) = autopilot.visited(&[("CRUISE_SPEED", 3.0), ("CRUSE_SPEED", 3.0)]);
        assert_eq!(end, VisitEnd::Unknown(vec!["CRUSE_SPEED".to_owned()]));
        assert_eq!(autopilot.values["CRUISE_SPEED"], 2.0);
    }

    #[test]
    fn one_that_is_silent_or_another_is_given_up_with_its_reason() {
        let mut silent = Autopilot::new();
        silent.says_values = false;
        assert_eq!(silent.visited(&[]).0, VisitEnd::Silent);
        let mut other = Autopilot::new();
        other.system = 4;
        let (end, after_s) = other.visited(&[]);
        assert_eq!(
            end,
            VisitEnd::NeverHeard {
                others: BTreeSet::from([4])
            }
        );
        assert!((9.0..15.0).contains(&after_s), "{after_s}");
        let mut px4 = Autopilot::new();
        px4.firmware = MavAutopilot::MAV_AUTOPILOT_PX4;
        assert_eq!(
            px4.visited(&[("CRUISE_SPEED", 3.0)]).0,
            VisitEnd::Firmware { found: 12 }
        );
        assert_eq!(px4.values["CRUISE_SPEED"], 2.0);
    }
}
