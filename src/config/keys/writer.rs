//! Writing: a file as TOML, every key with its value, in the order of declaration; on demand with unit and meaning as a
//! comment. Read back, the text gives the same values.

use super::super::overlay::{Layer, quoted};
use super::unit::unit;
use super::{
    Flag, Form, KeyEntry, Keyed, Keys, MaybeTable, NamedTables, Number, NumberBounds, Numbers,
    Others, Rowed, Rows, Whole, Word, Words,
};

/// A text that grows with every key that is shown.
pub(in crate::config) struct Writer {
    /// The name of the table that is written, with a dot at its end; empty for the file itself.
    prefix: String,
    /// Keys of this table.
    lines: String,
    /// The tables within it, which TOML wants behind its keys.
    tables: String,
}

impl Writer {
    /// Returns the text of a file of a kind.
    pub(in crate::config) fn file(kind: &str, table: &mut dyn Keyed) -> String {
        let mut writer = Writer {
            prefix: String::new(),
            lines: String::new(),
            tables: String::new(),
        };
        writer.line("kind", &quoted(kind), "");
        table.keys(&mut writer);
        writer.lines + &writer.tables
    }

    fn line(&mut self, name: &str, value: &str, means: &str) {
        let comment = [unit(name).unwrap_or_default(), means];
        let comment: Vec<&str> = comment
            .into_iter()
            .filter(|part| !part.is_empty())
            .collect();
        self.lines += &format!("{name} = {value}");
        if !comment.is_empty() {
            self.lines += &format!(" # {}", comment.join(": "));
        }
        self.lines.push('\n');
    }

    /// Writes what a table shows under a header.
    fn under(&mut self, header: &str, name: &str, show: &mut dyn FnMut(&mut Writer)) {
        let prefix = format!("{name}.");
        let mut inner = Writer {
            prefix,
            lines: String::new(),
            tables: String::new(),
        };
        show(&mut inner);
        if inner.lines.is_empty() && inner.tables.is_empty() {
            return;
        }
        self.tables += &format!("\n{header}\n{}{}", inner.lines, inner.tables);
    }

    fn inner(&mut self, name: &str, table: &mut dyn Keyed) {
        let name = format!("{}{name}", self.prefix);
        self.under(&format!("[{name}]"), &name, &mut |inner| table.keys(inner));
    }
}

impl Keys for Writer {
    fn number(&mut self, value: &mut f64, key: Number) {
        self.line(key.name, &number(*value), key.means);
    }

    fn maybe_number(&mut self, value: &mut Option<f64>, key: NumberBounds<f64>) {
        if let Some(value) = value {
            self.line(key.name, &number(*value), key.means);
        }
    }

    fn needed_number(&mut self, value: &mut f64, key: NumberBounds<f64>) {
        self.line(key.name, &number(*value), key.means);
    }

    fn whole(&mut self, value: &mut usize, key: Whole) {
        self.line(key.name, &value.to_string(), key.means);
    }

    fn maybe_whole(&mut self, value: &mut Option<usize>, key: NumberBounds<usize>) {
        if let Some(value) = value {
            self.line(key.name, &value.to_string(), key.means);
        }
    }

    fn flag(&mut self, value: &mut bool, key: Flag) {
        self.line(key.name, &value.to_string(), key.means);
    }

    fn word(&mut self, value: &mut dyn Word, key: Words) {
        self.line(key.name, &quoted(value.chosen()), key.means);
    }

    fn numbers(&mut self, value: &mut Vec<f64>, key: Numbers) {
        self.line(
            key.name,
            &list(value.iter().map(|entry| number(*entry))),
            key.means,
        );
    }

    fn form(&mut self, value: &mut dyn Form, key: KeyEntry) {
        if let Some(written) = value.to_toml() {
            self.line(key.name, &written, key.means);
        }
    }

    fn moved(&mut self, _: &'static str, _: &'static str) {}

    fn table(&mut self, value: &mut dyn Keyed, key: KeyEntry) {
        self.inner(key.name, value);
    }

    fn maybe_table(&mut self, value: &mut dyn MaybeTable, key: KeyEntry) {
        if let Some(table) = value.get() {
            self.inner(key.name, table);
        }
    }

    fn rows(&mut self, value: &mut dyn Rows, key: Rowed) {
        let name = format!("{}{}", self.prefix, key.name);
        for index in 0..value.count() {
            self.under(&format!("[[{name}]]"), &name, &mut |inner| {
                value.row(index, inner)
            });
        }
    }

    fn named_tables(&mut self, value: &mut dyn NamedTables, key: KeyEntry) {
        for name in value.names() {
            let table = format!("{}.{}", key.name, quoted(&name));
            self.inner(&table, value.named(&name));
        }
    }

    fn others(&mut self, value: &mut Layer, _: Others) {
        for (name, value) in value.written() {
            self.line(&name, value, "");
        }
    }
}

/// Returns a number as TOML writes it, with all its digits.
pub(in crate::config) fn number(value: f64) -> String {
    format!("{value:?}")
}

/// Returns a list of values that are written already.
pub(in crate::config) fn list(values: impl Iterator<Item = String>) -> String {
    format!("[{}]", values.collect::<Vec<String>>().join(", "))
}
