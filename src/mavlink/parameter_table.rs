//! The parameters that a vehicle shows to clients: listed, read and set by name
//! (<https://mavlink.io/en/services/parameter.html>). What a value changes is not known here.

use std::collections::VecDeque;
use std::time::Duration;

use super::client_link::ClientId;
use super::dialect::{MavMessage, MavParamType, PARAM_VALUE_DATA};
use crate::time::Time;

/// So many values go out at once, while a list is told.
const AT_ONCE: usize = 20;
/// And then again after this time.
const EVERY: Duration = Duration::from_millis(5);
/// The index of a value that nobody asked for by its index.
const NO_INDEX: u16 = u16::MAX;

#[derive(Clone, Debug)]
struct Parameter {
    name: &'static str,
    value: f32,
    kind: MavParamType,
}

/// The parameters of a vehicle that is served, by name.
#[derive(Clone, Debug)]
pub struct ParameterTable {
    all: Vec<Parameter>,
    /// Whom the list is told, and from which value on.
    telling: VecDeque<(ClientId, usize)>,
    told: Time,
}

impl ParameterTable {
    /// Makes a table of names, values and types.
    pub fn new(
        values: impl IntoIterator<Item = (&'static str, f32, MavParamType)>,
    ) -> ParameterTable {
        let parameter = |(name, value, kind)| Parameter { name, value, kind };
        let mut all: Vec<Parameter> = values.into_iter().map(parameter).collect();
        all.sort_by_key(|parameter| parameter.name);
        ParameterTable {
            all,
            telling: VecDeque::new(),
            told: Time::ZERO,
        }
    }

    /// Begins to tell a client all of them.
    pub fn tell_all(&mut self, client: ClientId) {
        self.telling.retain(|(other, _)| *other != client);
        self.telling.push_back((client, 0));
    }

    /// Forgets a client that is gone.
    pub fn forget(&mut self, client: ClientId) {
        self.telling.retain(|(other, _)| *other != client);
    }

    /// Returns when more of a list is to be told.
    pub fn deadline(&self) -> Option<Time> {
        (!self.telling.is_empty()).then(|| self.told + EVERY)
    }

    /// Tells the next values of each list.
    pub fn due(&mut self, now: Time, out: &mut Vec<(ClientId, MavMessage)>) {
        if self.deadline().is_none_or(|at| now < at) {
            return;
        }
        self.told = now;
        for (client, from) in std::mem::take(&mut self.telling) {
            let until = (from + AT_ONCE).min(self.all.len());
            out.extend((from..until).map(|index| (client, self.value(index, index as u16))));
            if until < self.all.len() {
                self.telling.push_back((client, until));
            }
        }
    }

    /// Returns the value of a name, or when there is none of an index; `None` when there is neither.
    pub fn read(&self, name: &str, index: i16) -> Option<MavMessage> {
        let of_index = usize::try_from(index).ok();
        let index = of_index.or_else(|| self.index_of(name))?;
        (index < self.all.len()).then(|| self.value(index, index as u16))
    }

    /// Gives a parameter a value and returns what it is then; `None` when there is none of that name. One that is no number
    /// is not taken.
    pub fn set(&mut self, name: &str, value: f32) -> Option<MavMessage> {
        let index = self.index_of(name)?;
        if value.is_finite() {
            self.all[index].value = value;
        }
        Some(self.value(index, NO_INDEX))
    }

    /// Returns the value of a name.
    pub fn value_of(&self, name: &str) -> Option<f32> {
        let index = self.index_of(name)?;
        Some(self.all[index].value)
    }

    fn index_of(&self, name: &str) -> Option<usize> {
        self.all
            .binary_search_by_key(&name, |parameter| parameter.name)
            .ok()
    }

    fn value(&self, index: usize, param_index: u16) -> MavMessage {
        let parameter = &self.all[index];
        MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
            param_value: parameter.value,
            param_count: self.all.len() as u16,
            param_index,
            param_id: parameter.name.into(),
            param_type: parameter.kind,
        })
    }
}
