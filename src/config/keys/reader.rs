//! Reading: sets every value that it is shown to what stands in a section of a file, or to its default. Limits are
//! checked, and mistakes are noted, by the section.

use super::super::overlay::Layer;
use super::super::section::Section;
use super::super::source::Source;
use super::{
    Flag, Form, KeyEntry, Keyed, Keys, MaybeTable, NamedTables, Number, NumberBounds, Numbers,
    Others, Rowed, Rows, Whole, Word, Words,
};

/// Reads a whole table: a key that was not shown is refused.
pub(in crate::config) fn read_table(table: &mut dyn Keyed, section: &Section<'_>) {
    read_values(table, section);
    section.finish();
}

/// Reads the keys of a table that holds others too.
pub(in crate::config) fn read_values(table: &mut dyn Keyed, section: &Section<'_>) {
    table.keys(&mut Reader { section });
}

/// Sets every value of a table to its default.
pub(in crate::config) fn read_defaults(table: &mut dyn Keyed) {
    let source = Source::new("", "");
    let tree = source.parse();
    read_values(table, &Section::root(&source, &tree));
}

/// Sets what it is shown.
struct Reader<'a, 's> {
    section: &'a Section<'s>,
}

impl Keys for Reader<'_, '_> {
    fn number(&mut self, value: &mut f64, key: Number) {
        *value = self.section.number(key.name, key.default, key.allowed);
    }

    fn maybe_number(&mut self, value: &mut Option<f64>, key: NumberBounds<f64>) {
        *value = self.section.optional_number(key.name, key.allowed);
    }

    fn needed_number(&mut self, value: &mut f64, key: NumberBounds<f64>) {
        *value = self.section.required_number(key.name, key.allowed);
    }

    fn whole(&mut self, value: &mut usize, key: Whole) {
        *value = self.section.whole(key.name, key.default, key.allowed);
    }

    fn maybe_whole(&mut self, value: &mut Option<usize>, key: NumberBounds<usize>) {
        let least = *key.allowed.start();
        let is_given = self.section.has(key.name);
        *value = is_given.then(|| self.section.whole(key.name, least, key.allowed));
    }

    fn flag(&mut self, value: &mut bool, key: Flag) {
        *value = self.section.flag(key.name, key.default);
    }

    fn word(&mut self, value: &mut dyn Word, key: Words) {
        let words = value.words();
        if key.default.is_empty() {
            self.section
                .require(key.name, &format!("one of {} is needed", words.join(", ")));
        }
        let pairs: Vec<(&str, &str)> = words.iter().map(|word| (*word, *word)).collect();
        let default = words
            .iter()
            .find(|word| **word == key.default)
            .or(words.first());
        value.choose(
            self.section
                .choice(key.name, default.copied().unwrap_or_default(), &pairs),
        );
    }

    fn numbers(&mut self, value: &mut Vec<f64>, key: Numbers) {
        *value = self
            .section
            .numbers(key.name, key.default, key.count, key.allowed);
    }

    fn form(&mut self, value: &mut dyn Form, key: KeyEntry) {
        value.read(self.section, key.name);
    }

    fn moved(&mut self, name: &'static str, place: &'static str) {
        self.section.refuse_moved(name, place);
    }

    fn table(&mut self, value: &mut dyn Keyed, key: KeyEntry) {
        read_table(value, &self.section.section(key.name));
    }

    fn maybe_table(&mut self, value: &mut dyn MaybeTable, key: KeyEntry) {
        if let Some(section) = self.section.optional_section(key.name) {
            read_table(value.fill(), &section);
        }
    }

    fn rows(&mut self, value: &mut dyn Rows, key: Rowed) {
        for section in self.section.sections(key.name, key.most) {
            let index = value.count();
            value.add();
            value.row(index, &mut Reader { section: &section });
            section.finish();
        }
    }

    fn named_tables(&mut self, value: &mut dyn NamedTables, key: KeyEntry) {
        for (name, section) in self.section.entries(key.name) {
            read_table(value.named(&name), &section);
        }
    }

    fn others(&mut self, value: &mut Layer, key: Others) {
        *value = self.section.others(key.but);
    }
}
