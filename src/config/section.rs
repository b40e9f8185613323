//! One table of a file, taken apart key by key: every question names the key, the default and what is
//! allowed, notes what is wrong, and answers with a usable value, so that reading always goes on.
//! Keys that nobody asked for are refused at the end.

use std::cell::{Cell, RefCell};
use std::fmt::Display;
use std::ops::RangeInclusive;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::nearest::nearest;
use super::overlay::{FILES, Laid, Layer, quoted};
use super::source::{ProblemClass, Source, beside};
use crate::geom::Point;

/// The range of a coordinate of the local frame, metres.
pub(super) const COORDINATE_M: RangeInclusive<f64> = -10_000.0..=10_000.0;

type Value<'s> = &'s Spanned<DeValue<'s>>;

/// A table while it is read.
pub(super) struct Section<'s> {
    /// The file to which it belongs.
    pub(super) source: &'s Source<'s>,
    prefix: String,
    line: usize,
    table: Option<&'s DeTable<'s>>,
    asked: RefCell<Vec<&'static str>>,
    moved: RefCell<Vec<&'static str>>,
    /// Whether keys that nobody asked for are another file's.
    has_others: Cell<bool>,
}

impl<'s> Section<'s> {
    /// Opens the whole file as a table.
    pub(super) fn root(source: &'s Source<'s>, tree: &'s Spanned<DeTable<'s>>) -> Section<'s> {
        Section::new(source, String::new(), 1, Some(tree.get_ref()))
    }

    fn new(
        source: &'s Source<'s>,
        prefix: String,
        line: usize,
        table: Option<&'s DeTable<'s>>,
    ) -> Section<'s> {
        let (asked, moved, has_others) = (RefCell::default(), RefCell::default(), Cell::default());
        Section {
            source,
            prefix,
            line,
            table,
            asked,
            moved,
            has_others,
        }
    }

    /// Returns the line in which it begins.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// Takes all values in it and in the tables in it, but for its own keys, to be laid over another file.
    pub(super) fn others(&self, own: &[&str]) -> Layer {
        self.has_others.set(true);
        let mut layer = Layer::default();
        if let Some(table) = self.table {
            self.take(table, &mut Vec::new(), own, &mut layer);
        }
        layer
    }

    /// Takes the value of one key, to be laid over another file.
    pub(super) fn single(&self, key: &'static str) -> Layer {
        let mut layer = Layer::default();
        if let Some(value) = self.value(key) {
            layer.lay(vec![key.to_owned()], self.laid(key, value));
        }
        layer
    }

    /// Returns a value as it stands in the file, and as it is seen from outside the file's folder.
    fn laid(&self, key: &str, value: Value<'s>) -> Laid {
        let named = value.get_ref().as_str().filter(|_| FILES.contains(&key));
        let outside = named.map(|named| quoted(&beside(self.source.file(), named)));
        let (raw, line) = (
            self.source.raw(value).to_owned(),
            self.source.line_of(value.span()),
        );
        Laid { raw, outside, line }
    }

    fn take(
        &self,
        table: &'s DeTable<'s>,
        path: &mut Vec<String>,
        own: &[&str],
        layer: &mut Layer,
    ) {
        for (key, value) in table.iter() {
            let name: &str = key.get_ref();
            if value.span().is_empty() || (path.is_empty() && own.contains(&name)) {
                continue;
            }
            path.push(name.to_owned());
            match value.get_ref() {
                DeValue::Table(inner) => self.take(inner, path, &[], layer),
                DeValue::Array(list)
                    if list
                        .iter()
                        .any(|entry| entry.get_ref().as_table().is_some()) =>
                {
                    self.refuse_value(
                        &path.join("."),
                        value,
                        "is a list of tables",
                        "single values are allowed",
                    );
                }
                DeValue::String(_)
                | DeValue::Integer(_)
                | DeValue::Float(_)
                | DeValue::Boolean(_)
                | DeValue::Datetime(_)
                | DeValue::Array(_) => {
                    layer.lay(path.clone(), self.laid(name, value));
                }
            }
            path.pop();
        }
    }

    /// Returns the full name of one of its keys.
    pub(super) fn full(&self, key: &str) -> String {
        format!("{}{key}", self.prefix)
    }

    /// Returns whether a key is given.
    pub(super) fn has(&self, key: &'static str) -> bool {
        self.value(key).is_some()
    }

    /// Returns a number; the default when it is left out or wrong.
    pub(super) fn number(
        &self,
        key: &'static str,
        default: f64,
        allowed: RangeInclusive<f64>,
    ) -> f64 {
        self.optional_number(key, allowed)
            .unwrap_or_else(|| self.fall_back(key, default))
    }

    /// Returns a number that must be there; the lower limit when it is not.
    pub(super) fn required_number(&self, key: &'static str, allowed: RangeInclusive<f64>) -> f64 {
        self.require(key, &number_rule(&allowed));
        self.optional_number(key, allowed.clone())
            .unwrap_or(*allowed.start())
    }

    /// Returns a number if it is there and right.
    pub(super) fn optional_number(
        &self,
        key: &'static str,
        allowed: RangeInclusive<f64>,
    ) -> Option<f64> {
        let value = self.value(key)?;
        let number = number_of(value.get_ref());
        let within = number.filter(|number| allowed.contains(number));
        if within.is_none() {
            let wrong = if number.is_some() {
                "is out of range"
            } else {
                "is no number"
            };
            self.refuse_value(key, value, wrong, &number_rule(&allowed));
        }
        within
    }

    /// Returns a whole number; the default when it is left out or wrong.
    pub(super) fn whole(
        &self,
        key: &'static str,
        default: usize,
        allowed: RangeInclusive<usize>,
    ) -> usize {
        let Some(value) = self.value(key) else {
            return self.fall_back(key, default);
        };
        let number = whole_of(value.get_ref());
        let within = number.filter(|number| allowed.contains(number));
        if within.is_none() {
            let wrong = if number.is_some() {
                "is out of range"
            } else {
                "is no such number"
            };
            self.refuse_value(key, value, wrong, &whole_rule(&allowed));
        }
        within.unwrap_or(default)
    }

    /// Notes that the command line replaces a whole number of a table of its, which must be in range as well.
    pub(super) fn replace_in(
        &self,
        table: &'static str,
        key: &'static str,
        by: usize,
        allowed: RangeInclusive<usize>,
    ) {
        let full = format!("{}.{key}", self.full(table));
        let table = self
            .table
            .and_then(|own| own.get(table))
            .filter(|table| !table.span().is_empty());
        let value = table
            .and_then(|table| table.get_ref().as_table())
            .and_then(|table| table.get(key));
        let stands = value.filter(|value| !value.span().is_empty()).or(table);
        let line = stands.map_or(self.line, |stands| self.source.line_of(stands.span()));
        self.source
            .remember_as(&full, line, format!("{by} (asked for)"));
        if !allowed.contains(&by) {
            self.source
                .refuse(&full, "is out of range", &whole_rule(&allowed));
        }
    }

    /// Returns a yes or no; the default when it is left out or wrong.
    pub(super) fn flag(&self, key: &'static str, default: bool) -> bool {
        let Some(value) = self.value(key) else {
            return self.fall_back(key, default);
        };
        let flag = value.get_ref().as_bool();
        if flag.is_none() {
            self.refuse_value(key, value, "is no yes or no", "true or false is allowed");
        }
        flag.unwrap_or(default)
    }

    /// Returns a text if it is there and no longer than 200 bytes.
    pub(super) fn text(&self, key: &'static str) -> Option<String> {
        let value = self.value(key)?;
        let text = value
            .get_ref()
            .as_str()
            .filter(|text| !text.is_empty() && text.len() <= 200);
        let allowed = "1 to 200 characters in quotes are allowed";
        if text.is_some_and(|text| text.contains('\0')) {
            self.refuse_value(key, value, "holds a NUL", allowed);
            return None;
        }
        if text.is_none() {
            self.refuse_value(key, value, "is no text", allowed);
        }
        text.map(str::to_owned)
    }

    /// Returns a name that can be part of a file's name; the default when it is left out or wrong.
    pub(super) fn name(&self, key: &'static str, default: &str) -> String {
        let Some(text) = self.text(key) else {
            return default.to_owned();
        };
        let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_');
        if text.len() <= 64 && text.chars().all(is_plain) {
            return text;
        }
        self.refuse(
            key,
            "is no plain name",
            "1 to 64 letters, digits, - and _ are allowed",
        );
        default.to_owned()
    }

    /// Returns one of several named values; the default when it is left out or wrong.
    pub(super) fn choice<T: Copy>(&self, key: &'static str, default: T, names: &[(&str, T)]) -> T {
        let Some(value) = self.value(key) else {
            return default;
        };
        let word = value.get_ref().as_str();
        let found = names.iter().find(|(name, _)| word == Some(name));
        if found.is_none() {
            let list: Vec<String> = names
                .iter()
                .map(|(name, _)| format!("\"{name}\""))
                .collect();
            self.refuse_value(
                key,
                value,
                "is no choice",
                &format!("{} is allowed", list.join(" or ")),
            );
        }
        found.map_or(default, |(_, value)| *value)
    }

    /// Returns a list of numbers if it is there and right, in its length too.
    pub(super) fn optional_numbers(
        &self,
        key: &'static str,
        length: RangeInclusive<usize>,
        allowed: RangeInclusive<f64>,
    ) -> Option<Vec<f64>> {
        let value = self.value(key)?;
        let numbers =
            numbers_of(value.get_ref(), &allowed).filter(|list| length.contains(&list.len()));
        if numbers.is_none() {
            let rule = format!(
                "a list of {} numbers is allowed, each from {} to {}",
                span(&length),
                allowed.start(),
                allowed.end()
            );
            self.refuse_value(key, value, "is no such list", &rule);
        }
        numbers
    }

    /// Returns a list of numbers; the default when it is left out or wrong.
    pub(super) fn numbers(
        &self,
        key: &'static str,
        default: &[f64],
        length: RangeInclusive<usize>,
        allowed: RangeInclusive<f64>,
    ) -> Vec<f64> {
        self.optional_numbers(key, length, allowed)
            .unwrap_or_else(|| default.to_vec())
    }

    /// Returns a place `[x, y]` that must be there; the datum when it is not.
    pub(super) fn required_point(&self, key: &'static str) -> Point {
        self.require(key, "a place [x, y] in metres is needed");
        let numbers = self.optional_numbers(key, 2..=2, COORDINATE_M);
        numbers.map_or(Point::default(), |pair| Point::new(pair[0], pair[1]))
    }

    /// Returns a list of places `[[x, y], …]` that must be there; nothing when it is wrong.
    pub(super) fn required_points(
        &self,
        key: &'static str,
        length: RangeInclusive<usize>,
    ) -> Vec<Point> {
        let rule = format!(
            "a list of {} places [x, y] in metres is needed",
            span(&length)
        );
        self.require(key, &rule);
        let Some(value) = self.value(key) else {
            return Vec::new();
        };
        let points = points_of(value.get_ref()).filter(|list| length.contains(&list.len()));
        if points.is_none() {
            self.refuse_value(key, value, "is no such list", &rule);
        }
        points.unwrap_or_default()
    }

    /// Opens a table; one that is left out answers with defaults only.
    pub(super) fn section(&self, key: &'static str) -> Section<'s> {
        self.optional_section(key).unwrap_or_else(|| {
            Section::new(self.source, self.full(&format!("{key}.")), self.line, None)
        })
    }

    /// Opens a table if it is there.
    pub(super) fn optional_section(&self, key: &'static str) -> Option<Section<'s>> {
        let value = self.value(key)?;
        let section = self.open(value, self.full(&format!("{key}.")));
        if section.is_none() {
            let rule = format!("a table [{}] is allowed", self.full(key));
            self.refuse_value(key, value, "is no table", &rule);
        }
        section
    }

    /// Opens every table of a list of tables, which may be left out.
    pub(super) fn sections(&self, key: &'static str, limit: usize) -> Vec<Section<'s>> {
        let Some(value) = self.value(key) else {
            return Vec::new();
        };
        let rule = format!("up to {limit} tables [[{}]] are allowed", self.full(key));
        let Some(list) = value
            .get_ref()
            .as_array()
            .filter(|list| list.len() <= limit)
        else {
            self.refuse_value(key, value, "is no such list", &rule);
            return Vec::new();
        };
        let mut opened = Vec::new();
        for (index, entry) in list.iter().enumerate() {
            match self.open(entry, self.full(&format!("{key}[{index}]."))) {
                Some(section) => opened.push(section),
                None => self.refuse_value(&format!("{key}[{index}]"), entry, "is no table", &rule),
            }
        }
        opened
    }

    /// Opens every table of a table whose keys are free names; in the order of the names.
    pub(super) fn entries(&self, key: &'static str) -> Vec<(String, Section<'s>)> {
        let Some(value) = self.value(key) else {
            return Vec::new();
        };
        let Some(table) = value.get_ref().as_table() else {
            let rule = format!("tables [{}.NAME] are allowed", self.full(key));
            self.refuse_value(key, value, "is no table", &rule);
            return Vec::new();
        };
        let mut opened = Vec::new();
        for (name, entry) in table.iter() {
            match self.open(entry, self.full(&format!("{key}.{}.", name.get_ref()))) {
                Some(section) => opened.push((name.get_ref().to_string(), section)),
                None => {
                    let wrong_key = format!("{key}.{}", name.get_ref());
                    let rule = format!("a table [{}] is allowed", self.full(&wrong_key));
                    self.refuse_value(&wrong_key, entry, "is no table", &rule);
                }
            }
        }
        opened
    }

    /// Returns the elements of a list, or `None` when the key is left out or is no list.
    pub(super) fn list(&self, key: &'static str) -> Option<&'s [Spanned<DeValue<'s>>]> {
        self.value(key)?.get_ref().as_array().map(|list| &list[..])
    }

    /// Notes that a key must be there, if it is not; `rule` says what it should be.
    pub(super) fn require(&self, key: &'static str, rule: &str) {
        if !self.has(key) {
            self.source.note(
                ProblemClass::Keys,
                self.line,
                &self.full(key),
                "",
                "is missing",
                rule,
            );
        }
    }

    /// Notes a problem of one of its keys.
    pub(super) fn refuse(&self, key: &str, wrong: &str, allowed: &str) {
        self.source.refuse(&self.full(key), wrong, allowed);
    }

    /// Refuses a key that has moved to another file, and names its new place.
    pub(super) fn refuse_moved(&self, key: &'static str, place: &str) {
        self.moved.borrow_mut().push(key);
        let value = self
            .table
            .and_then(|table| table.get(key))
            .filter(|value| !value.span().is_empty());
        if let Some(value) = value {
            let wrong = format!("{key} belongs into {place}");
            self.refuse_value(key, value, &wrong, "leave it out here");
        }
    }

    /// Refuses every key that was not asked for, unless it is another file's.
    pub(super) fn finish(&self) {
        if self.has_others.get() {
            return;
        }
        let asked = self.asked.borrow();
        for (key, _) in self.table.into_iter().flat_map(|table| table.iter()) {
            let name: &str = key.get_ref();
            if asked.contains(&name) || self.moved.borrow().contains(&name) {
                continue;
            }
            let advice = match nearest(name, &asked) {
                Some(known) => format!("did you mean {known}?"),
                None if asked.is_empty() => "no key is known here".to_owned(),
                None => format!("known here: {}", asked.join(", ")),
            };
            let shown: String = name.chars().filter(|c| !c.is_control()).take(64).collect();
            let line = self.source.line_of(key.span());
            self.source.note(
                ProblemClass::Keys,
                line,
                &self.full(&shown),
                "",
                "is not known",
                &advice,
            );
        }
    }

    fn open(&self, value: Value<'s>, prefix: String) -> Option<Section<'s>> {
        let table = value.get_ref().as_table()?;
        Some(Section::new(
            self.source,
            prefix,
            self.source.line_of(value.span()),
            Some(table),
        ))
    }

    fn value(&self, key: &'static str) -> Option<Value<'s>> {
        let mut asked = self.asked.borrow_mut();
        if !asked.contains(&key) {
            asked.push(key);
        }
        // What the parser left in place of a broken value stands nowhere in the text.
        let value = self
            .table?
            .get(key)
            .filter(|value| !value.span().is_empty())?;
        self.source.remember(&self.full(key), value);
        Some(value)
    }

    fn fall_back<T: Display>(&self, key: &'static str, default: T) -> T {
        if !self.has(key) {
            self.source.remember_as(
                &self.full(key),
                self.line,
                format!("{default} (the default)"),
            );
        }
        default
    }

    fn refuse_value(&self, key: &str, value: Value<'s>, wrong: &str, rule: &str) {
        let (line, shown) = (self.source.line_of(value.span()), self.source.shown(value));
        self.source.note(
            ProblemClass::Value,
            line,
            &self.full(key),
            &shown,
            wrong,
            rule,
        );
    }
}

fn number_rule(allowed: &RangeInclusive<f64>) -> String {
    format!(
        "a number from {} to {} is allowed",
        allowed.start(),
        allowed.end()
    )
}

fn whole_rule(allowed: &RangeInclusive<usize>) -> String {
    format!(
        "a whole number from {} to {} is allowed",
        allowed.start(),
        allowed.end()
    )
}

fn span(length: &RangeInclusive<usize>) -> String {
    if length.start() == length.end() {
        length.start().to_string()
    } else {
        format!("{} to {}", length.start(), length.end())
    }
}

/// Returns the number that a value is, whole or not; the limits are checked by the caller.
pub(super) fn number_of(value: &DeValue) -> Option<f64> {
    if let Some(float) = value.as_float() {
        return float.as_str().parse().ok();
    }
    let integer = value.as_integer()?;
    i64::from_str_radix(integer.as_str(), integer.radix())
        .ok()
        .map(|whole| whole as f64)
}

/// Returns the whole number from 0 upward that a value is.
pub(super) fn whole_of(value: &DeValue) -> Option<usize> {
    let integer = value.as_integer()?;
    usize::from_str_radix(integer.as_str(), integer.radix()).ok()
}

fn numbers_of(value: &DeValue, allowed: &RangeInclusive<f64>) -> Option<Vec<f64>> {
    let list = value.as_array()?;
    list.iter()
        .map(|entry| number_of(entry.get_ref()).filter(|number| allowed.contains(number)))
        .collect()
}

fn points_of(value: &DeValue) -> Option<Vec<Point>> {
    let list = value.as_array()?;
    let point = |entry: &Spanned<DeValue>| match numbers_of(entry.get_ref(), &COORDINATE_M)?[..] {
        [x_m, y_m] => Some(Point::new(x_m, y_m)),
        _ => None,
    };
    list.iter().map(point).collect()
}
