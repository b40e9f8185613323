//! Lines of CSV below a header: which column holds what, and numbers within limits.
//!
//! Every mistake names the line, what was found and what was expected.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::str::FromStr;

use toml::value::{Datetime, Offset};

use super::recording::{FARTHEST_M, RecordingError, quoted, wrong};
use crate::geom::Point;

/// Returns what was found in a file without a line that counts.
pub(super) fn nothing_in(text: &str) -> &'static str {
    match text.trim().is_empty() {
        true => "an empty file",
        false => "nothing but comments",
    }
}

/// The names of the columns.
pub(super) struct CsvHeader<'a> {
    number: usize,
    columns: BTreeMap<&'a str, usize>,
    /// What such a header looks like.
    expected: String,
}

impl<'a> CsvHeader<'a> {
    /// Reads the header in a line; the `known` columns are all that may be there, each once.
    ///
    /// # Errors
    /// Another column, or one twice.
    pub(super) fn read(
        number: usize,
        line: &'a str,
        known: &str,
        expected: String,
    ) -> Result<CsvHeader<'a>, RecordingError> {
        let mut columns = BTreeMap::new();
        for (column, name) in line.split(',').map(str::trim).enumerate() {
            let problem = if !names(known).any(|one| one == name) {
                format!("the column {}", quoted(name))
            } else if columns.insert(name, column).is_some() {
                format!("the column {} twice", quoted(name))
            } else {
                continue;
            };
            return Err(wrong(format!("{number}: "), problem, expected));
        }
        Ok(CsvHeader {
            number,
            columns,
            expected,
        })
    }

    /// Returns where a column is, if it is there.
    pub(super) fn column(&self, name: &str) -> Option<usize> {
        self.columns.get(name).copied()
    }

    /// Returns where a column is that must be there.
    ///
    /// # Errors
    /// It is not.
    pub(super) fn needed(&self, name: &str) -> Result<usize, RecordingError> {
        self.column(name).ok_or_else(|| {
            let found = format!("no column \"{name}\"");
            wrong(format!("{}: ", self.number), found, self.expected.clone())
        })
    }

    /// Parts a line below.
    ///
    /// # Errors
    /// It has more fields than the header, or fewer.
    pub(super) fn fields<'l>(
        &self,
        number: usize,
        line: &'l str,
    ) -> Result<CsvFields<'l>, RecordingError> {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        if fields.len() != self.columns.len() {
            let expected = format!("{} as the header has", self.columns.len());
            let found = format!("{} fields", fields.len());
            return Err(wrong(format!("{number}: "), found, expected));
        }
        Ok(CsvFields { number, fields })
    }
}

/// Returns the lines that hold something and are no comments, with their numbers.
pub(super) fn numbered(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.trim_start_matches('\u{feff}').lines().enumerate();
    lines
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Returns the names in a header.
pub(super) fn names(header: &str) -> impl Iterator<Item = &str> {
    header.split(',').map(str::trim)
}

/// A line below a header.
pub(super) struct CsvFields<'l> {
    number: usize,
    fields: Vec<&'l str>,
}

impl<'l> CsvFields<'l> {
    /// Returns a moment in UTC.
    ///
    /// # Errors
    /// It is none of ISO 8601 with the letter Z.
    pub(super) fn moment(&self, column: usize) -> Result<Datetime, RecordingError> {
        let is_utc = |moment: &Datetime| {
            moment.date.is_some() && moment.time.is_some() && moment.offset == Some(Offset::Z)
        };
        let expected = || "a moment in UTC such as 2026-11-20T09:05:00.250Z".to_owned();
        self.parsed(column, is_utc, expected)
    }

    /// Returns whether nothing stands in a column.
    pub(super) fn is_empty(&self, column: usize) -> bool {
        self.fields[column].is_empty()
    }

    /// Returns a number within limits.
    ///
    /// # Errors
    /// It is none.
    pub(super) fn ranged(
        &self,
        column: usize,
        (low, high): (f64, f64),
        what: &str,
    ) -> Result<f64, RecordingError> {
        self.parsed(
            column,
            |value| (low..=high).contains(value),
            || format!("{what} from {low} to {high}"),
        )
    }

    /// Returns a whole number of something, of at least a least one.
    ///
    /// # Errors
    /// It is none.
    pub(super) fn whole<N: FromStr + PartialOrd + Display>(
        &self,
        column: usize,
        least: N,
        what: &str,
    ) -> Result<N, RecordingError> {
        self.parsed(
            column,
            |value| *value >= least,
            || format!("a whole number of {what}, at least {least}"),
        )
    }

    /// Returns a place, of two columns.
    ///
    /// # Errors
    /// One is no coordinate.
    pub(super) fn place(&self, [x, y]: [usize; 2]) -> Result<Point, RecordingError> {
        let limits = (-FARTHEST_M, FARTHEST_M);
        let coordinate = |column| self.ranged(column, limits, "a coordinate");
        Ok(Point::new(coordinate(x)?, coordinate(y)?))
    }

    /// Returns a mistake in this line.
    pub(super) fn mistake(&self, found: String, expected: String) -> RecordingError {
        wrong(format!("{}: ", self.number), found, expected)
    }

    fn parsed<N: FromStr>(
        &self,
        column: usize,
        fits: impl Fn(&N) -> bool,
        expected: impl Fn() -> String,
    ) -> Result<N, RecordingError> {
        let field = self.fields[column];
        let value = field.parse::<N>().ok().filter(fits);
        value.ok_or_else(|| self.mistake(quoted(field), expected()))
    }
}
