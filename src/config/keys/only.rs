//! Keys of one table that stand in another one as well: a simulation may give in its own tables what the venue says.
//! What the venue says is the default there.

use super::super::overlay::Layer;
use super::{
    Flag, Form, KeyEntry, Keyed, Keys, MaybeTable, NamedTables, Number, NumberBounds, Numbers,
    Others, Rowed, Rows, Whole, Word, Words,
};

/// Passes on the keys of some names, each with its present value as its default.
pub(in crate::config) struct Only<'a> {
    /// The names.
    pub(in crate::config) names: &'a [&'static str],
    /// Who is shown them.
    pub(in crate::config) to: &'a mut dyn Keys,
}

impl Only<'_> {
    fn has(&self, name: &str) -> bool {
        self.names.contains(&name)
    }
}

impl Keys for Only<'_> {
    fn number(&mut self, value: &mut f64, key: Number) {
        if self.has(key.name) {
            let default = *value;
            self.to.number(value, Number { default, ..key });
        }
    }

    fn maybe_number(&mut self, value: &mut Option<f64>, key: NumberBounds<f64>) {
        if self.has(key.name) {
            let before = *value;
            self.to.maybe_number(value, key);
            *value = value.or(before);
        }
    }

    fn needed_number(&mut self, value: &mut f64, key: NumberBounds<f64>) {
        if self.has(key.name) {
            let NumberBounds {
                name,
                left_out: _,
                allowed,
                means,
            } = key;
            let default = *value;
            self.to.number(
                value,
                Number {
                    name,
                    default,
                    allowed,
                    means,
                },
            );
        }
    }

    fn whole(&mut self, value: &mut usize, key: Whole) {
        if self.has(key.name) {
            let default = *value;
            self.to.whole(value, Whole { default, ..key });
        }
    }

    fn maybe_whole(&mut self, value: &mut Option<usize>, key: NumberBounds<usize>) {
        if self.has(key.name) {
            let before = *value;
            self.to.maybe_whole(value, key);
            *value = value.or(before);
        }
    }

    fn flag(&mut self, value: &mut bool, key: Flag) {
        if self.has(key.name) {
            let default = *value;
            self.to.flag(value, Flag { default, ..key });
        }
    }

    fn word(&mut self, value: &mut dyn Word, key: Words) {
        if self.has(key.name) {
            let default = value.chosen();
            self.to.word(value, Words { default, ..key });
        }
    }

    fn numbers(&mut self, _: &mut Vec<f64>, _: Numbers) {}

    fn form(&mut self, _: &mut dyn Form, _: KeyEntry) {}

    fn moved(&mut self, _: &'static str, _: &'static str) {}

    fn table(&mut self, _: &mut dyn Keyed, _: KeyEntry) {}

    fn maybe_table(&mut self, _: &mut dyn MaybeTable, _: KeyEntry) {}

    fn rows(&mut self, _: &mut dyn Rows, _: Rowed) {}

    fn named_tables(&mut self, _: &mut dyn NamedTables, _: KeyEntry) {}

    fn others(&mut self, _: &mut Layer, _: Others) {}
}
