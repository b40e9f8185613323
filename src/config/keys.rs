//! A configuration key is declared once: a table shows every one of its keys, with name, default, what is allowed and
//! what it means, to a visitor. Reading a file, writing one, and the tables of `configs/README.md` are visitors.
//!
//! ```text
//!   Keyed::keys ──shows──► dyn Keys:  Reader   sets each value from a Section, or to its default
//!                                     Writer   writes each value as TOML
//!                                     Tables   lists name, default, range, meaning
//!                                     Only     passes on some keys of a table that stand in another one
//! ```
//!
//! A declaration opens its struct with a pattern without `..`, so that a forgotten key is an unused variable. The unit is
//! read off the name's suffix. Values are kept as they were written. What several keys must obey together is not said
//! here: it is checked after reading.

mod only;
mod reader;
mod tables;
mod unit;
mod writer;

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use super::overlay::Layer;
use super::section::Section;

pub(crate) use super::overlay::quoted;
pub(super) use only::Only;
pub(super) use reader::{read_defaults, read_table, read_values};
pub use tables::DeclaredKey;
pub(super) use tables::{Tables, keys_of};
pub(super) use writer::{Writer, list as written_list, number};

/// A table of a configuration file.
pub(super) trait Keyed {
    /// Shows every key to a visitor, which may set its value.
    fn keys(&mut self, to: &mut dyn Keys);
}

/// Who is shown the keys of a table, one after the other; a key that depends on earlier ones may ask their values.
pub(super) trait Keys {
    /// A number that has a default.
    fn number(&mut self, value: &mut f64, key: Number);
    /// A number that may be left out.
    fn maybe_number(&mut self, value: &mut Option<f64>, key: NumberBounds<f64>);
    /// A number that must be there.
    fn needed_number(&mut self, value: &mut f64, key: NumberBounds<f64>);
    /// A whole number that has a default.
    fn whole(&mut self, value: &mut usize, key: Whole);
    /// A whole number that may be left out.
    fn maybe_whole(&mut self, value: &mut Option<usize>, key: NumberBounds<usize>);
    /// A yes or no.
    fn flag(&mut self, value: &mut bool, key: Flag);
    /// One of several words.
    fn word(&mut self, value: &mut dyn Word, key: Words);
    /// A list of numbers that has a default.
    fn numbers(&mut self, value: &mut Vec<f64>, key: Numbers);
    /// A value with a form of its own, such as a place or a file.
    fn form(&mut self, value: &mut dyn Form, key: KeyEntry);
    /// A key that has moved: said to whoever still gives it here.
    fn moved(&mut self, name: &'static str, place: &'static str);
    /// A table within this one.
    fn table(&mut self, value: &mut dyn Keyed, key: KeyEntry);
    /// A table within this one that may be left out.
    fn maybe_table(&mut self, value: &mut dyn MaybeTable, key: KeyEntry);
    /// A list of tables.
    fn rows(&mut self, value: &mut dyn Rows, key: Rowed);
    /// Tables within a table, under free names.
    fn named_tables(&mut self, value: &mut dyn NamedTables, key: KeyEntry);
    /// All other keys of the table and the tables in it: they are another file's, and are checked there.
    fn others(&mut self, value: &mut Layer, key: Others);
}

/// A number that has a default.
#[derive(Clone, Debug)]
pub(super) struct Number {
    pub(super) name: &'static str,
    pub(super) default: f64,
    pub(super) allowed: RangeInclusive<f64>,
    pub(super) means: &'static str,
}

impl Number {
    /// Makes a key from its name, its default, what is allowed and what it means.
    pub(super) fn new(
        name: &'static str,
        default: f64,
        allowed: RangeInclusive<f64>,
        means: &'static str,
    ) -> Number {
        Number {
            name,
            default,
            allowed,
            means,
        }
    }
}

/// A number without a default.
#[derive(Clone, Debug)]
pub(super) struct NumberBounds<T> {
    pub(super) name: &'static str,
    /// What it is when it is left out, for the documentation.
    pub(super) left_out: &'static str,
    pub(super) allowed: RangeInclusive<T>,
    pub(super) means: &'static str,
}

/// A whole number that has a default.
#[derive(Clone, Debug)]
pub(super) struct Whole {
    pub(super) name: &'static str,
    pub(super) default: usize,
    pub(super) allowed: RangeInclusive<usize>,
    pub(super) means: &'static str,
}

/// A yes or no.
#[derive(Clone, Debug)]
pub(super) struct Flag {
    pub(super) name: &'static str,
    pub(super) default: bool,
    pub(super) means: &'static str,
}

/// A choice between words.
#[derive(Clone, Debug)]
pub(super) struct Words {
    pub(super) name: &'static str,
    /// The word when it is left out; empty: it must be there.
    pub(super) default: &'static str,
    pub(super) means: &'static str,
}

/// A list of numbers that has a default.
#[derive(Clone, Debug)]
pub(super) struct Numbers {
    pub(super) name: &'static str,
    pub(super) default: &'static [f64],
    pub(super) count: RangeInclusive<usize>,
    pub(super) allowed: RangeInclusive<f64>,
    pub(super) means: &'static str,
}

/// A table, or a value with a form of its own.
#[derive(Clone, Debug)]
pub(super) struct KeyEntry {
    pub(super) name: &'static str,
    /// What it is when it is left out, for the documentation.
    pub(super) left_out: &'static str,
    pub(super) means: &'static str,
}

/// A list of tables.
#[derive(Clone, Debug)]
pub(super) struct Rowed {
    pub(super) name: &'static str,
    /// The most tables.
    pub(super) most: usize,
    pub(super) means: &'static str,
}

/// The other keys of a table.
#[derive(Clone, Debug)]
pub(super) struct Others {
    /// The table's own keys.
    pub(super) but: &'static [&'static str],
    pub(super) means: &'static str,
}

/// A value that is written as one of several words.
pub(super) trait WordChoice: Copy + PartialEq + 'static {
    /// The words and what they stand for.
    const WORDS: &'static [(&'static str, Self)];

    /// Returns the word of a value.
    fn word(self) -> &'static str {
        Self::WORDS
            .iter()
            .find(|(_, value)| *value == self)
            .map_or("", |(word, _)| word)
    }
}

/// A choice as a visitor sees it.
pub(super) trait Word {
    /// Returns all words.
    fn words(&self) -> Vec<&'static str>;
    /// Returns the word that is chosen.
    fn chosen(&self) -> &'static str;
    /// Chooses a word, if it is one.
    fn choose(&mut self, word: &str);
}

impl<T: WordChoice> Word for T {
    fn words(&self) -> Vec<&'static str> {
        T::WORDS.iter().map(|(word, _)| *word).collect()
    }

    fn chosen(&self) -> &'static str {
        self.word()
    }

    fn choose(&mut self, word: &str) {
        if let Some((_, value)) = T::WORDS.iter().find(|(known, _)| *known == word) {
            *self = *value;
        }
    }
}

/// A value with a form of its own.
pub(super) trait Form {
    /// Returns it as TOML; `None` when it is left out.
    fn to_toml(&self) -> Option<String>;
    /// Reads it; what is wrong is noted at the section.
    fn read(&mut self, section: &Section<'_>, name: &'static str);
    /// Returns what is allowed, for the documentation.
    fn allowed(&self) -> String {
        String::new()
    }
}

/// A table that may be left out.
pub(super) trait MaybeTable {
    /// Returns the table, if it is there.
    fn get(&mut self) -> Option<&mut dyn Keyed>;
    /// Returns the table, which is there from now on.
    fn fill(&mut self) -> &mut dyn Keyed;
}

impl<T: Keyed + Default> MaybeTable for Option<T> {
    fn get(&mut self) -> Option<&mut dyn Keyed> {
        self.as_mut().map(|table| table as &mut dyn Keyed)
    }

    fn fill(&mut self) -> &mut dyn Keyed {
        self.insert(T::default())
    }
}

/// A list of tables as a visitor sees it.
pub(super) trait Rows {
    /// Returns how many there are.
    fn count(&self) -> usize;
    /// Adds a blank one.
    fn add(&mut self);
    /// Shows the keys of one.
    fn row(&mut self, index: usize, to: &mut dyn Keys);
}

/// A list of tables, with a function that shows the keys of one of them and may know its number.
pub(super) struct List<'a, T, F: FnMut(&mut T, usize, &mut dyn Keys)> {
    /// The list.
    pub(super) list: &'a mut Vec<T>,
    /// Shows the keys of one.
    pub(super) keys: F,
}

impl<T: Default, F: FnMut(&mut T, usize, &mut dyn Keys)> Rows for List<'_, T, F> {
    fn count(&self) -> usize {
        self.list.len()
    }

    fn add(&mut self) {
        self.list.push(T::default());
    }

    fn row(&mut self, index: usize, to: &mut dyn Keys) {
        if let Some(row) = self.list.get_mut(index) {
            (self.keys)(row, index, to);
        }
    }
}

/// Tables under free names, as a visitor sees them.
pub(super) trait NamedTables {
    /// Returns the names.
    fn names(&self) -> Vec<String>;
    /// Returns the table of a name, which is there from now on.
    fn named(&mut self, name: &str) -> &mut dyn Keyed;
}

impl<T: Keyed + Default> NamedTables for BTreeMap<String, T> {
    fn names(&self) -> Vec<String> {
        self.keys().cloned().collect()
    }

    fn named(&mut self, name: &str) -> &mut dyn Keyed {
        self.entry(name.to_owned()).or_default()
    }
}

#[cfg(test)]
mod tests;
