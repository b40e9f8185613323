//! The last lines of this process's log, as whoever watches from elsewhere may be told them. There is one log in a process, and
//! so one book: [`LogBookLayer`] writes into it what is logged, whoever logs it. Bounded; the oldest lines go first.

use std::collections::VecDeque;
use std::fmt::{Debug, Write};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

use tomoswarm_proto::{LOG_LINE_BYTES_MAX, LogLine, LogSeverity, fitted};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

use super::mailbox::lock;

/// Lines that are kept.
const KEPT_MAX: usize = 128;

/// The book of this process.
static OF_PROCESS: OnceLock<LogBook> = OnceLock::new();

/// Lines of a log, the last ones; a handle.
#[derive(Clone, Debug, Default)]
pub struct LogBook(Arc<Mutex<Lines>>);

#[derive(Debug, Default)]
struct Lines {
    kept: VecDeque<(Instant, LogLine)>,
    last: u32,
}

impl LogBook {
    /// Returns that of this process.
    pub fn of_process() -> &'static LogBook {
        OF_PROCESS.get_or_init(LogBook::default)
    }

    /// Writes a line; a longer one is cut.
    pub fn write(&self, now: Instant, severity: LogSeverity, text: String) {
        let mut lines = lock(&self.0);
        lines.last = lines.last.saturating_add(1);
        let line = LogLine {
            number: lines.last,
            age_ms: 0,
            severity,
            text: fitted(text, LOG_LINE_BYTES_MAX),
        };
        lines.kept.push_back((now, line));
        if lines.kept.len() > KEPT_MAX {
            lines.kept.pop_front();
        }
    }

    /// Returns the number of the last line; 0 = there is none.
    pub fn last(&self) -> u32 {
        lock(&self.0).last
    }

    /// Returns the lines that are kept and are above a number, or younger than an age; with their ages, ascending.
    pub fn lines(&self, now: Instant, above: u32, younger: Duration) -> Vec<LogLine> {
        let lines = lock(&self.0);
        let aged = lines.kept.iter().filter_map(|(written, line)| {
            let age = now.saturating_duration_since(*written);
            let is_wanted = line.number > above || age < younger;
            let age_ms = u32::try_from(age.as_millis()).unwrap_or(u32::MAX);
            is_wanted.then(|| LogLine {
                age_ms,
                ..line.clone()
            })
        });
        aged.collect()
    }
}

/// Writes what is logged into a book.
pub struct LogBookLayer(pub LogBook);

impl<S: Subscriber> Layer<S> for LogBookLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut words = Words::default();
        event.record(&mut words);
        let severity = match *event.metadata().level() {
            Level::ERROR => LogSeverity::Error,
            Level::WARN => LogSeverity::Warning,
            _ => LogSeverity::Info,
        };
        self.0
            .write(Instant::now(), severity, words.message + &words.others);
    }
}

/// The message of an event, and what is named beside it.
#[derive(Default)]
struct Words {
    message: String,
    others: String,
}

impl Visit for Words {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        // Nothing can fail to be written into a text.
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name => write!(self.others, " {name}={value:?}"),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracing_subscriber::layer::SubscriberExt;

    #[test]
    fn the_last_lines_are_kept_with_their_numbers_and_ages() {
        let book = LogBook::default();
        let began = Instant::now();
        let at = |seconds| began + Duration::from_secs(seconds);
        assert_eq!(
            (book.last(), book.lines(began, 0, Duration::MAX)),
            (0, vec![])
        );
        for second in 0..100 {
            book.write(at(second), LogSeverity::Info, format!("line {second}"));
        }
        let numbers = |now, above, younger_s| -> Vec<u32> {
            let lines = book.lines(now, above, Duration::from_secs(younger_s));
            lines.iter().map(|line| line.number).collect()
        };
        assert_eq!(book.last(), 100);
        assert_eq!(numbers(at(99), 0, 0), (1..=100).collect::<Vec<u32>>());
        assert_eq!(numbers(at(99), 98, 0), [99, 100]);
        assert_eq!(numbers(at(99), 100, 3), [98, 99, 100], "also old news");
        (100..300).for_each(|_| book.write(at(99), LogSeverity::Info, String::new()));
        let kept = numbers(at(99), 0, 0);
        assert_eq!(
            (kept.len(), kept.last()),
            (KEPT_MAX, Some(&300)),
            "the last ones"
        );
        book.write(at(99), LogSeverity::Info, "line 99".to_owned());
        let last = book.lines(at(101), 300, Duration::ZERO).remove(0);
        assert_eq!((last.age_ms, last.text.as_str()), (2000, "line 99"));
    }

    #[test]
    fn a_long_line_is_cut_between_two_letters() {
        let book = LogBook::default();
        let now = Instant::now();
        book.write(now, LogSeverity::Error, "ä".repeat(400));
        book.write(now, LogSeverity::Error, format!("x{}", "ä".repeat(400)));
        let lines = book.lines(now, 0, Duration::ZERO);
        let ends = |line: &LogLine| (line.text.len(), line.text.ends_with("ä…"));
        assert_eq!(ends(&lines[0]), (LOG_LINE_BYTES_MAX - 1, true));
        assert_eq!(ends(&lines[1]), (LOG_LINE_BYTES_MAX, true));
    }

    #[test]
    fn what_is_logged_is_in_the_book_with_what_is_named_beside_it() {
        let book = LogBook::default();
        let subscriber = tracing_subscriber::registry().with(LogBookLayer(book.clone()));
        tracing::subscriber::with_default(subscriber, || {
            tracing::info!("takes part in the {}", "bus");
            tracing::warn!(port = 7, "nobody listens");
            tracing::error!("it has failed");
        });
        let lines = book.lines(Instant::now(), 0, Duration::ZERO);
        let said: Vec<_> = lines
            .iter()
            .map(|line| (line.severity, line.text.as_str()))
            .collect();
        let expected = [
            (LogSeverity::Info, "takes part in the bus"),
            (LogSeverity::Warning, "nobody listens port=7"),
            (LogSeverity::Error, "it has failed"),
        ];
        assert_eq!(said, expected);
    }
}
