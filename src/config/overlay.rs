//! Keys that are laid over a file before it is checked, so that what was changed goes through the same reader, with the
//! same limits, as what was written there. Every key remembers the line that it was taken from, for messages.
//!
//! Only values are laid over: a list of tables (`[[fault]]`) is not taken apart.

use std::collections::{BTreeMap, BTreeSet};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The keys that name a file, of all that can be laid over; a file is named relative to the one in which its name stands.
pub(super) const FILES: &[&str] = &["scene", "venue", "file"];

/// A value with the place that it was taken from.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Laid {
    /// As it stands in TOML; may have several lines.
    pub(super) raw: String,
    /// The same as it is seen from outside its file's folder, where that is another text.
    pub(super) outside: Option<String>,
    /// The line that it begins in.
    pub(super) line: usize,
}

/// What is laid over one file: values by their keys, a later one in place of an earlier one.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct Layer {
    values: BTreeMap<Vec<String>, Laid>,
    /// Tables of the file that do not count.
    cleared: BTreeSet<&'static str>,
}

impl Layer {
    /// Lays a value over a key, in place of an earlier one.
    pub(super) fn lay(&mut self, path: Vec<String>, laid: Laid) {
        self.values.insert(path, laid);
    }

    /// Lays a value over a key given as `"table.key"`.
    pub(super) fn lay_at(&mut self, key: &str, raw: &str, line: usize) {
        let path = key.split('.').map(str::to_owned).collect();
        self.lay(
            path,
            Laid {
                raw: raw.to_owned(),
                outside: None,
                line,
            },
        );
    }

    /// Takes a table of the file away, with all that was laid over it so far.
    pub(super) fn clear(&mut self, table: &'static str) {
        self.values
            .retain(|path, _| path.first().is_none_or(|first| first != table));
        self.cleared.insert(table);
    }

    /// Returns the line of the first value that is laid over something of a table.
    pub(super) fn line_in(&self, table: &str) -> Option<usize> {
        let mut of_table = self
            .values
            .iter()
            .filter(|(path, _)| path.first().is_some_and(|first| first == table));
        of_table.next().map(|(_, laid)| laid.line)
    }

    /// Lays all of another layer over this one.
    pub(super) fn lay_all(&mut self, other: &Layer) {
        self.cleared.extend(&other.cleared);
        self.values.extend(
            other
                .values
                .iter()
                .map(|(path, laid)| (path.clone(), laid.clone())),
        );
    }

    /// Returns the same values under a table.
    pub(super) fn under(&self, table: &[&str]) -> Layer {
        let moved = |path: &[String]| {
            table
                .iter()
                .map(|part| (*part).to_owned())
                .chain(path.to_vec())
                .collect()
        };
        let values = self
            .values
            .iter()
            .map(|(path, laid)| (moved(path), laid.clone()))
            .collect();
        Layer {
            values,
            cleared: BTreeSet::new(),
        }
    }

    /// Returns all keys with their values, as they are seen from outside their file's folder.
    pub(super) fn written(&self) -> impl Iterator<Item = (String, &str)> {
        self.values
            .iter()
            .map(|(path, laid)| (joined(path), laid.outside.as_deref().unwrap_or(&laid.raw)))
    }

    /// Returns the layer as TOML, and for each of its lines the one that it was taken from.
    fn text(&self) -> (String, Vec<usize>) {
        let (mut text, mut lines) = (String::new(), Vec::new());
        for (path, laid) in &self.values {
            lines.extend((0..laid.raw.lines().count().max(1)).map(|below| laid.line + below));
            text += &format!("{} = {}\n", joined(path), laid.raw);
        }
        (text, lines)
    }
}

/// Returns a key within tables as it may stand in any TOML file.
fn joined(path: &[String]) -> String {
    let is_bare = |part: &str| {
        !part.is_empty()
            && part
                .chars()
                .all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_'))
    };
    let parts: Vec<String> = path
        .iter()
        .map(|part| {
            if is_bare(part) {
                part.clone()
            } else {
                quoted(part)
            }
        })
        .collect();
    parts.join(".")
}

/// What is laid over a simulation file and over the venue that it names, and the file from which it comes.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct Overlay {
    /// The file in which the values stand.
    pub(super) file: String,
    /// What is laid over the simulation.
    pub(super) sim: Layer,
    /// What is laid over its venue.
    pub(super) venue: Layer,
}

impl Overlay {
    /// Returns what is laid over a file of a kind, if anything can be.
    pub(super) fn layer(&self, kind: &str) -> Option<&Layer> {
        match kind {
            "sim" => Some(&self.sim),
            "venue" => Some(&self.venue),
            _ => None,
        }
    }
}

/// A file's text with a layer below it, so that every value has one place in one text.
pub(super) struct OverlaidText {
    /// The text of the file, a line break, the layer.
    pub(super) text: String,
    /// The layer where it stands in `text`, with blanks before it.
    pub(super) layer: String,
    /// Where the layer begins, bytes.
    pub(super) from: usize,
    /// For each line of the layer the one that it was taken from.
    pub(super) lines: Vec<usize>,
    /// Tables of the text that do not count.
    pub(super) cleared: Vec<&'static str>,
}

impl OverlaidText {
    /// Puts a layer below a text.
    pub(super) fn new(text: &str, layer: &Layer) -> OverlaidText {
        let (below, lines) = layer.text();
        let from = text.len() + 1;
        OverlaidText {
            text: format!("{text}\n{below}"),
            layer: format!("{}{below}", " ".repeat(from)),
            from,
            lines,
            cleared: layer.cleared.iter().copied().collect(),
        }
    }
}

/// Puts the values of one tree into another, in place of those of the same key; tables are joined.
pub(super) fn merge<'t>(under: &mut DeTable<'t>, over: DeTable<'t>) {
    for (key, value) in over {
        let known = under.get_mut(&**key.get_ref()).map(Spanned::get_mut);
        let span = value.span();
        match (known, value.into_inner()) {
            (Some(DeValue::Table(known)), DeValue::Table(table)) => merge(known, table),
            (_, value) => {
                under.insert(key, Spanned::new(span, value));
            }
        }
    }
}

/// Returns a text as TOML writes it.
pub(crate) fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted += &format!("\\u{:04X}", u32::from(c)),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(values: &[(&str, &str, usize)]) -> Layer {
        let mut layer = Layer::default();
        values
            .iter()
            .for_each(|(key, raw, line)| layer.lay_at(key, raw, *line));
        layer
    }

    #[test]
    fn a_later_value_takes_the_place_of_an_earlier_one() {
        let mut under = layer(&[("a.b", "1", 3), ("c", "2", 4)]);
        under.lay_all(&layer(&[("a.b", "5", 9)]));
        assert_eq!(under.text(), ("a.b = 5\nc = 2\n".to_owned(), vec![9, 4]));
    }

    #[test]
    fn every_line_of_a_long_value_knows_where_it_stood() {
        let values = layer(&[("a", "[1,\n 2,\n]", 7), ("b", "3", 2)]);
        assert_eq!(values.text().1, [7, 8, 9, 2]);
    }

    #[test]
    fn tables_are_joined_and_values_replaced() {
        let (under, over) = (
            "x = 1\n[t]\na = 1\nb = 2\n[t.u]\nc = 3\n",
            "t.b = 9\nt.u.d = 4\nv.w = 5\nx = 2",
        );
        let mut tree = DeTable::parse(under).unwrap().into_inner();
        merge(&mut tree, DeTable::parse(over).unwrap().into_inner());
        let mut expected =
            toml::from_str::<toml::Table>("x = 2\nt.a = 1\nt.b = 9\nt.u.c = 3\nt.u.d = 4\nv.w = 5")
                .unwrap();
        for (key, value) in tree {
            let name = key.get_ref().to_string();
            assert_eq!(
                plain(value.get_ref()),
                expected.remove(&name).unwrap(),
                "{name}"
            );
        }
        assert!(expected.is_empty());
    }

    fn plain(value: &DeValue) -> toml::Value {
        match value {
            DeValue::Integer(whole) => toml::Value::Integer(whole.as_str().parse().unwrap()),
            DeValue::Table(table) => toml::Value::Table(
                table
                    .iter()
                    .map(|(key, value)| (key.get_ref().to_string(), plain(value.get_ref())))
                    .collect(),
            ),
            other => panic!("{other:?}"),
        }
    }
}
