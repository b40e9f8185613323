//! The tables of `configs/README.md`: every key with its default, what is allowed and what it means, as Markdown.

use serde::Serialize;

use super::super::overlay::Layer;
use super::unit::unit;
use super::writer::{list, number};
use super::{
    Flag, Form, KeyEntry, Keyed, Keys, MaybeTable, NamedTables, Number, NumberBounds, Numbers,
    Others, Rowed, Rows, Whole, Word, Words,
};

const HEAD: &str = "| key | default | allowed | meaning |\n| --- | --- | --- | --- |\n";

/// Rows of one table, and the tables within it.
#[derive(Default)]
pub(in crate::config) struct Tables {
    prefix: String,
    rows: Vec<Row>,
    inner: String,
}

/// A key of a table with what is to be known of it, as people read it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct DeclaredKey {
    /// Its name, with its unit.
    pub name: String,
    /// What it is when it is left out, in words or as a value.
    pub default: String,
    /// What it may be, with its unit.
    pub allowed: String,
    /// What it means.
    pub means: String,
}

/// A key as it is shown.
#[derive(Clone, PartialEq)]
struct Row {
    name: String,
    default: String,
    allowed: String,
    means: String,
}

impl Row {
    fn text(&self) -> String {
        let Row {
            name,
            default,
            allowed,
            means,
        } = self;
        format!("| {name} | {default} | {allowed} | {means} |\n")
    }
}

impl Tables {
    /// Returns the tables of a kind of file; what depends on a choice is shown by further values of the same kind.
    pub(in crate::config) fn of(shown: &mut [&mut dyn Keyed]) -> String {
        let mut tables = Tables::default();
        for table in shown {
            table.keys(&mut tables);
        }
        tables.text()
    }

    /// Returns one table of the keys of all kinds of a table, each with its word: the meaning of a key begins with the
    /// words of the kinds that have it, unless all do.
    pub(in crate::config) fn of_kinds<T: Keyed>(
        kinds: impl Iterator<Item = (&'static str, T)>,
    ) -> String {
        let (mut count, mut rows) = (0, Vec::<(Row, Vec<String>)>::new());
        for (word, mut kind) in kinds {
            count += 1;
            let mut tables = Tables::default();
            kind.keys(&mut tables);
            for row in tables.rows {
                match rows.iter_mut().find(|(known, _)| *known == row) {
                    Some((_, words)) => words.push(format!("`{word}`")),
                    None => rows.push((row, vec![format!("`{word}`")])),
                }
            }
        }
        let with_words = |(row, words): (Row, Vec<String>)| match words.len() == count {
            true => row,
            false => Row {
                means: format!("{}: {}", words.join(", "), row.means),
                ..row
            },
        };
        let rows = rows.into_iter().map(with_words).collect();
        Tables {
            rows,
            ..Tables::default()
        }
        .text()
    }

    fn text(self) -> String {
        let rows: String = self.rows.iter().map(Row::text).collect();
        match rows.is_empty() {
            true => self.inner,
            false => format!("{HEAD}{rows}\n{}", self.inner),
        }
    }

    fn row(&mut self, name: &str, default: &str, allowed: &str, means: &str) {
        let unit = unit(name)
            .map(|unit| format!(" {unit}"))
            .unwrap_or_default();
        let default = if default.is_empty() { "none" } else { default }.to_owned();
        let (allowed, means) = (format!("{allowed}{unit}"), means.replace('|', "\\|"));
        let row = Row {
            name: format!("`{name}`"),
            default,
            allowed,
            means,
        };
        // A key that two kinds of a table share is shown once.
        if !self.rows.contains(&row) {
            self.rows.push(row);
        }
    }

    fn span(&mut self, name: &str, default: &str, (from, to): (String, String), means: &str) {
        self.row(name, default, &format!("{from} to {to}"), means);
    }

    fn under(
        &mut self,
        name: &str,
        header: &str,
        key: (&str, &str),
        show: &mut dyn FnMut(&mut Tables),
    ) {
        let mut inner = Tables {
            prefix: format!("{name}."),
            ..Tables::default()
        };
        show(&mut inner);
        let (left_out, means) = key;
        let left_out = if left_out.is_empty() {
            String::new()
        } else {
            format!(" ({left_out})")
        };
        let inner = inner.text();
        if inner.is_empty() {
            return;
        }
        let text = format!("`{header}`{left_out}: {means}\n\n{inner}");
        if !self.inner.contains(&text) {
            self.inner += &text;
        }
    }
}

/// Returns the keys of one table, without the tables in it.
pub(in crate::config) fn keys_of(table: &mut dyn Keyed) -> Vec<DeclaredKey> {
    let mut tables = Tables::default();
    table.keys(&mut tables);
    let declared = |row: Row| DeclaredKey {
        name: row.name.trim_matches('`').to_owned(),
        default: row.default,
        allowed: row.allowed,
        means: row.means.replace("\\|", "|"),
    };
    tables.rows.into_iter().map(declared).collect()
}

/// Returns a number as a person writes it.
fn short(value: f64) -> String {
    if value.abs() >= 1e7 {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

impl Keys for Tables {
    fn number(&mut self, _: &mut f64, key: Number) {
        let span = (short(*key.allowed.start()), short(*key.allowed.end()));
        self.span(key.name, &short(key.default), span, key.means);
    }

    fn maybe_number(&mut self, _: &mut Option<f64>, key: NumberBounds<f64>) {
        let span = (short(*key.allowed.start()), short(*key.allowed.end()));
        self.span(key.name, key.left_out, span, key.means);
    }

    fn needed_number(&mut self, _: &mut f64, key: NumberBounds<f64>) {
        let span = (short(*key.allowed.start()), short(*key.allowed.end()));
        self.span(key.name, key.left_out, span, key.means);
    }

    fn whole(&mut self, _: &mut usize, key: Whole) {
        let span = (
            key.allowed.start().to_string(),
            key.allowed.end().to_string(),
        );
        self.span(key.name, &key.default.to_string(), span, key.means);
    }

    fn maybe_whole(&mut self, _: &mut Option<usize>, key: NumberBounds<usize>) {
        let span = (
            key.allowed.start().to_string(),
            key.allowed.end().to_string(),
        );
        self.span(key.name, key.left_out, span, key.means);
    }

    fn flag(&mut self, _: &mut bool, key: Flag) {
        self.row(key.name, &key.default.to_string(), "true, false", key.means);
    }

    fn word(&mut self, value: &mut dyn Word, key: Words) {
        let default = if key.default.is_empty() {
            "needed"
        } else {
            key.default
        };
        self.row(key.name, default, &value.words().join(", "), key.means);
    }

    fn numbers(&mut self, _: &mut Vec<f64>, key: Numbers) {
        let (from, to) = (key.count.start(), key.count.end());
        let count = if from == to {
            from.to_string()
        } else {
            format!("{from} to {to}")
        };
        let (least, most) = (short(*key.allowed.start()), short(*key.allowed.end()));
        let default = list(key.default.iter().map(|entry| number(*entry)));
        self.row(
            key.name,
            &default,
            &format!("{count} numbers, {least} to {most}"),
            key.means,
        );
    }

    fn form(&mut self, value: &mut dyn Form, key: KeyEntry) {
        self.row(key.name, key.left_out, &value.allowed(), key.means);
    }

    fn moved(&mut self, _: &'static str, _: &'static str) {}

    fn table(&mut self, value: &mut dyn Keyed, key: KeyEntry) {
        let name = format!("{}{}", self.prefix, key.name);
        let about = (key.left_out, key.means);
        self.under(&name, &format!("[{name}]"), about, &mut |inner| {
            value.keys(inner)
        });
    }

    fn maybe_table(&mut self, value: &mut dyn MaybeTable, key: KeyEntry) {
        self.table(value.fill(), key);
    }

    fn rows(&mut self, value: &mut dyn Rows, key: Rowed) {
        let name = format!("{}{}", self.prefix, key.name);
        let about = format!("up to {}", key.most);
        let index = value.count();
        value.add();
        self.under(
            &name,
            &format!("[[{name}]]"),
            (&about, key.means),
            &mut |inner| value.row(index, inner),
        );
    }

    fn named_tables(&mut self, value: &mut dyn NamedTables, key: KeyEntry) {
        let (left_out, means) = (key.left_out, key.means);
        let name = format!("{}{}.NAME", self.prefix, key.name);
        let table = value.named("NAME");
        self.under(
            &name,
            &format!("[{name}]"),
            (left_out, means),
            &mut |inner| table.keys(inner),
        );
    }

    fn others(&mut self, _: &mut Layer, key: Others) {
        let which = if key.but.is_empty() {
            "any"
        } else {
            "any other"
        };
        let (name, means) = (which.to_owned(), key.means.to_owned());
        self.rows.push(Row {
            name,
            default: String::new(),
            allowed: String::new(),
            means,
        });
    }
}
