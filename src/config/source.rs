//! One file while it is read: its text with line numbers, its tree, and the list of what is wrong.
//! Parses TOML once, with recovery, so that several syntax errors are found together. What is laid over it
//! ([`Overlay`]) is read as if it stood below, and its mistakes are said of the place that it comes from.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::overlay::{OverlaidText, Overlay, merge};
use super::{FileLine, Problem, Problems};

/// The longest text that is read, bytes; a hand-written file is far below.
const LIMIT_BYTES: usize = 1 << 20;
/// How much of a value is shown in a message, characters.
const SHOWN_CHARS: usize = 40;
/// What the reader of TOML says of a key that stands twice; the key itself is the span of the error.
const DUPLICATE: &str = "duplicate key";
/// So many lines that are no TOML are listed; of what is no TOML at all, each one would be.
const SYNTAX_MAX: usize = 5;

/// Why a problem was noted; decides what is still worth saying when the syntax is broken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum ProblemClass {
    /// The text is no TOML here.
    Syntax,
    /// A key is missing or not known: a consequence, perhaps, of broken syntax elsewhere.
    Keys,
    /// A value is not allowed.
    Value,
}

/// Where a value stands, for messages about it.
#[derive(Clone, Debug)]
struct Place {
    line: usize,
    value: String,
}

/// What is laid over a file.
struct Over<'t> {
    overlay: &'t Overlay,
    joined: &'t OverlaidText,
    /// The number of the first line of the layer, counted as those of the text are.
    first_line: usize,
}

/// A file while it is read.
pub(super) struct Source<'t> {
    file: String,
    text: &'t str,
    line_starts: Vec<usize>,
    over: Option<Over<'t>>,
    found: RefCell<Vec<(ProblemClass, Problem)>>,
    places: RefCell<BTreeMap<String, Place>>,
}

impl<'t> Source<'t> {
    /// Begins to read a text under a name.
    pub(super) fn new(file: &str, text: &'t str) -> Source<'t> {
        let breaks = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let line_starts = std::iter::once(0)
            .chain(breaks.map(|(at, _)| at + 1))
            .collect();
        let (found, places) = (RefCell::default(), RefCell::default());
        Source {
            file: file.to_owned(),
            text,
            line_starts,
            over: None,
            found,
            places,
        }
    }

    /// Begins to read a text with what is laid over it.
    pub(super) fn over(file: &str, joined: &'t OverlaidText, overlay: &'t Overlay) -> Source<'t> {
        let mut source = Source::new(file, &joined.text);
        let first_line = source.line_of(joined.from..joined.from);
        source.over = Some(Over {
            overlay,
            joined,
            first_line,
        });
        source
    }

    /// Returns what is laid over this file and those that it names.
    pub(super) fn overlay(&self) -> Option<&'t Overlay> {
        self.over.as_ref().map(|over| over.overlay)
    }

    /// Returns the name of the file in which a key's value stands: this one, unless it was laid over.
    pub(super) fn file_of(&self, key: &str) -> String {
        let line = self.places.borrow().get(key).map_or(1, |place| place.line);
        self.place_of(line).0.to_owned()
    }

    /// Returns where a key's value stands; the first line when it is not known.
    pub(super) fn line_of_key(&self, key: &str) -> FileLine {
        self.file_line(self.places.borrow().get(key).map_or(1, |place| place.line))
    }

    /// Returns the line of a file that a line of the text is.
    pub(super) fn file_line(&self, line: usize) -> FileLine {
        let (file, line) = self.place_of(line);
        let file = file.to_owned();
        FileLine { file, line }
    }

    /// Returns the file and the line of what stands in a line of the text.
    fn place_of(&self, line: usize) -> (&str, usize) {
        let laid = self.over.as_ref().and_then(|over| {
            let index = line.checked_sub(over.first_line)?;
            Some((over.overlay.file.as_str(), *over.joined.lines.get(index)?))
        });
        laid.unwrap_or((&self.file, line))
    }

    /// Returns the name of the file.
    pub(super) fn file(&self) -> &str {
        &self.file
    }

    /// Parses the text; what is no TOML is noted and left out of the tree.
    pub(super) fn parse(&self) -> Spanned<DeTable<'t>> {
        if self.text.len() > LIMIT_BYTES {
            let wrong = format!("the file has {} bytes", self.text.len());
            self.note(
                ProblemClass::Syntax,
                1,
                "",
                "",
                &wrong,
                &format!("at most {LIMIT_BYTES} are read"),
            );
            return Spanned::new(0..0, DeTable::new());
        }
        let Some(Over { joined, .. }) = &self.over else {
            return self.parse_part(self.text);
        };
        let mut tree = self.parse_part(&self.text[..joined.from]);
        for table in &joined.cleared {
            tree.get_mut().remove(*table);
        }
        merge(tree.get_mut(), self.parse_part(&joined.layer).into_inner());
        tree
    }

    /// Parses a text whose places are those of the whole.
    fn parse_part(&self, part: &'t str) -> Spanned<DeTable<'t>> {
        let (tree, errors) = DeTable::parse_recoverable(part);
        let mut lines = Vec::new();
        for error in errors {
            let line = self.line_of(error.span().unwrap_or(0..0));
            // What follows on the same line is mostly a consequence.
            if lines.last() == Some(&line) {
                continue;
            }
            lines.push(line);
            if lines.len() > SYNTAX_MAX {
                continue;
            }
            let message = error.message().lines().collect::<Vec<_>>().join(", ");
            let key = error.span().and_then(|span| part.get(span));
            let (wrong, allowed) = match key.filter(|_| message == DUPLICATE) {
                Some(key) => (format!("{DUPLICATE} {}", cut(key)), "once is allowed"),
                None => (message, ""),
            };
            let wrong = format!("no valid TOML: {wrong}");
            self.note(ProblemClass::Syntax, line, "", "", &wrong, allowed);
        }
        if let [first, others @ ..] = lines.get(SYNTAX_MAX..).unwrap_or_default() {
            let wrong = match others.len() {
                0 => "no valid TOML".to_owned(),
                more => format!("no valid TOML, nor are {more} lines below"),
            };
            self.note(ProblemClass::Syntax, *first, "", "", &wrong, "");
        }
        tree
    }

    /// Returns the number of the line in which a span begins, counted from 1.
    pub(super) fn line_of(&self, span: Range<usize>) -> usize {
        self.line_starts
            .partition_point(|start| *start <= span.start)
            .max(1)
    }

    /// Notes a problem.
    pub(super) fn note(
        &self,
        class: ProblemClass,
        line: usize,
        key: &str,
        value: &str,
        wrong: &str,
        allowed: &str,
    ) {
        let (file, line) = self.place_of(line);
        let problem = Problem {
            file: file.to_owned(),
            line,
            key: key.to_owned(),
            value: value.to_owned(),
            wrong: wrong.to_owned(),
            allowed: allowed.to_owned(),
        };
        self.found.borrow_mut().push((class, problem));
    }

    /// Remembers where a key's value stands.
    pub(super) fn remember(&self, key: &str, value: &Spanned<DeValue<'_>>) {
        let place = Place {
            line: self.line_of(value.span()),
            value: self.shown(value),
        };
        self.places.borrow_mut().insert(key.to_owned(), place);
    }

    /// Remembers what stands for a key that was left out or replaced.
    pub(super) fn remember_as(&self, key: &str, line: usize, value: String) {
        self.places
            .borrow_mut()
            .insert(key.to_owned(), Place { line, value });
    }

    /// Remembers what stands for a key that was left out and has a default that depends on others, by its full name.
    pub(super) fn remember_default(&self, key: &str, default: f64) {
        if !self.is_known(key) {
            self.remember_as(
                key,
                self.line_of_table(key),
                format!("{default} (the default)"),
            );
        }
    }

    /// Notes a problem of a value that was read before, by its full key.
    pub(super) fn refuse(&self, key: &str, wrong: &str, allowed: &str) {
        let place = self.places.borrow().get(key).cloned();
        let Place { line, value } = place.unwrap_or(Place {
            line: 1,
            value: String::new(),
        });
        self.note(ProblemClass::Value, line, key, &value, wrong, allowed);
    }

    /// Notes that a key must be there, by its full name.
    pub(super) fn require(&self, key: &str, rule: &str) {
        let line = self.line_of_table(key);
        self.note(ProblemClass::Keys, line, key, "", "is missing", rule);
    }

    /// Returns the number of the line in which the table of a key begins.
    fn line_of_table(&self, key: &str) -> usize {
        let table = key.rsplit_once('.').map_or("", |(table, _)| table);
        self.places
            .borrow()
            .get(table)
            .map_or(1, |place| place.line)
    }

    /// Returns whether a key was read so far: given or left out.
    pub(super) fn is_known(&self, key: &str) -> bool {
        self.places.borrow().contains_key(key)
    }

    /// Returns whether nothing is wrong with the given keys and what lies below them, so that a check
    /// of several values together makes sense.
    pub(super) fn is_sound(&self, keys: &[&str]) -> bool {
        let concerns = |problem: &Problem, key: &str| {
            let rest = problem.key.strip_prefix(key);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        let found = self.found.borrow();
        !found
            .iter()
            .any(|(_, problem)| keys.iter().any(|key| concerns(problem, key)))
    }

    /// Adds what is wrong in a file that this one names.
    pub(super) fn absorb(&self, problems: Problems) {
        let others = problems
            .into_list()
            .into_iter()
            .map(|problem| (ProblemClass::Value, problem));
        self.found.borrow_mut().extend(others);
    }

    /// Returns the value if nothing is wrong, and the problems otherwise.
    pub(super) fn finish<T>(&self, value: Option<T>) -> Result<T, Problems> {
        let found = self.found.take();
        let broken: Vec<usize> = found
            .iter()
            .filter(|(class, _)| *class == ProblemClass::Syntax)
            .map(|(_, p)| p.line)
            .collect();
        let is_worth_saying = |class: ProblemClass, problem: &Problem| match class {
            ProblemClass::Syntax => true,
            ProblemClass::Keys => broken.is_empty(),
            ProblemClass::Value => problem.file != self.file || !broken.contains(&problem.line),
        };
        let kept: Vec<Problem> = found
            .into_iter()
            .filter(|(class, problem)| is_worth_saying(*class, problem))
            .map(|(_, problem)| problem)
            .collect();
        match value {
            Some(value) if kept.is_empty() => Ok(value),
            Some(_) | None => Err(Problems::new(&self.file, kept)),
        }
    }

    /// Returns the text of a value as it stands in the file.
    pub(super) fn raw(&self, value: &Spanned<DeValue<'_>>) -> &'t str {
        self.text.get(value.span()).unwrap_or_default()
    }

    /// Returns the text of a value as it stands in the file, on one line and shortened.
    pub(super) fn shown(&self, value: &Spanned<DeValue<'_>>) -> String {
        cut(self.raw(value))
    }
}

/// Returns the beginning of a text on one line.
fn cut(text: &str) -> String {
    let printable = text.chars().map(|c| if c.is_control() { ' ' } else { c });
    let mut shown: String = printable.clone().take(SHOWN_CHARS).collect();
    if printable.count() > SHOWN_CHARS {
        shown.push('…');
    }
    shown
}

/// Returns the path of a file that is named in another one, relative to that one's folder.
pub fn beside(file_name: &str, named: &str) -> String {
    match file_name.rfind('/') {
        Some(end) if !named.starts_with('/') => format!("{}{named}", &file_name[..=end]),
        Some(_) | None => named.to_owned(),
    }
}
