//! Values with a form of their own that several kinds of files have: names, texts, files, places. Each is read by the
//! section and written as TOML; forms of one table only stand beside that table.

use super::keys::{Form, number, quoted, written_list};
use super::section::{COORDINATE_M, Section};
use super::source::beside;
use crate::geom::Point;
use crate::time::Time;
use std::ops::RangeInclusive;
use std::time::Duration;

/// A name that can be part of a file's name.
pub(super) struct Name<'a> {
    /// The name.
    pub(super) name: &'a mut String,
    /// What it is when it is left out.
    pub(super) default: String,
}

impl Form for Name<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(quoted(self.name))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.name = section.name(key, &self.default);
    }
}

/// A text that may be left out.
pub(super) struct Text<'a>(pub(super) &'a mut Option<String>);

impl Form for Text<'_> {
    fn to_toml(&self) -> Option<String> {
        self.0.as_deref().map(quoted)
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.0 = section.text(key);
    }
}

/// A file or folder, named relative to the file in which it stands and kept with that one's folder before it.
pub(super) struct FileName<'a> {
    /// Its name.
    pub(super) name: &'a mut Option<String>,
    /// What is said when it is missing; `None` when it may be.
    pub(super) needed: Option<&'static str>,
}

impl Form for FileName<'_> {
    fn to_toml(&self) -> Option<String> {
        self.name.as_deref().map(quoted)
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        if let Some(rule) = self.needed {
            section.require(key, rule);
        }
        let named = section.text(key);
        *self.name = named.map(|named| beside(&section.source.file_of(&section.full(key)), &named));
    }
}

/// A file that was loaded before the keys are read: its name is known already.
pub(super) struct LoadedFile<'a>(pub(super) &'a str);

impl Form for LoadedFile<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(quoted(self.0))
    }

    fn read(&mut self, _: &Section<'_>, _: &'static str) {}
}

/// A place that must be there.
pub(super) struct RequiredPlace<'a>(pub(super) &'a mut Point);

impl Form for RequiredPlace<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(place(self.0))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.0 = section.required_point(key);
    }
}

/// A place that may be left out.
pub(super) struct MaybePlace<'a>(pub(super) &'a mut Option<Point>);

impl Form for MaybePlace<'_> {
    fn to_toml(&self) -> Option<String> {
        self.0.as_ref().map(place)
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let pair = section.optional_numbers(key, 2..=2, COORDINATE_M);
        *self.0 = pair.map(|pair| Point::new(pair[0], pair[1]));
    }
}

/// A list of places that must be there.
pub(super) struct RequiredPlaces<'a> {
    /// The places.
    pub(super) places: &'a mut Vec<Point>,
    /// How many there may be.
    pub(super) count: RangeInclusive<usize>,
}

impl Form for RequiredPlaces<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(places(self.places))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.places = section.required_points(key, self.count.clone());
    }
}

/// Returns a place as TOML.
pub(super) fn place(point: &Point) -> String {
    format!("[{}, {}]", number(point.x_m), number(point.y_m))
}

/// Returns a list of places as TOML.
pub(super) fn places(points: &[Point]) -> String {
    written_list(points.iter().map(place))
}

/// Returns a span of time.
pub(super) fn seconds(seconds_s: f64) -> Duration {
    Time::from_secs_f64(seconds_s).since(Time::ZERO)
}

/// The name that the kernel has for a GPIO line.
pub(super) struct LineName<'a> {
    /// The name.
    pub(super) line: &'a mut Option<String>,
    /// What is said when it is missing; `None` when it may be.
    pub(super) needed: Option<&'static str>,
}

/// The kernel keeps no longer name, bytes.
const LONGEST_LINE_NAME: usize = 31;

impl Form for LineName<'_> {
    fn to_toml(&self) -> Option<String> {
        self.line.as_deref().map(quoted)
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        if let Some(rule) = self.needed {
            section.require(key, rule);
        }
        *self.line = section.text(key);
        let is_name = |name: &String| {
            (1..=LONGEST_LINE_NAME).contains(&name.len()) && !name.contains(char::is_control)
        };
        if self.line.as_ref().is_some_and(|name| !is_name(name)) {
            let allowed = "a name such as \"GPIO23\" is allowed";
            section.refuse(key, "is no name of a line", allowed);
            *self.line = None;
        }
    }
}

/// The name of a serial port.
pub(super) struct PortName<'a>(pub(super) &'a mut String);

impl Form for PortName<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(quoted(self.0))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let rule = "the whole path of a port such as \"/dev/serial/by-id/usb-…\" is needed";
        section.require(key, rule);
        let Some(port) = section.text(key) else {
            return;
        };
        if port.starts_with('/') && !port.contains(char::is_control) {
            *self.0 = port;
        } else {
            section.refuse(key, "is no whole path", rule);
        }
    }
}
