//! What a node says of itself to operators who ask by their greetings: the lines of its log, and its settings. Nobody decides
//! anything by it, and nothing of it is said while nobody asks.
//!
//! A link may lose what it carries: a line is said again while it is young, and settings a second time.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use tomoswarm_proto::{
    Hello, Interest, LOG_LINES_MAX, LogLines, Message, NodeSettings, SETTINGS_PART_BYTES_MAX,
    SETTINGS_PARTS_MAX, Sender, fitted,
};

use super::log_book::LogBook;
use super::mailbox::lock;
use super::newcomers::Newcomers;

/// Who asks greets every two seconds: after so long nobody asks any more.
const ASKED_FOR: Duration = Duration::from_secs(10);
/// A line is said again until it is as old as this.
const SAID_AGAIN: Duration = Duration::from_millis(2500);
/// Nothing more is said before this time has passed: whoever calls more often (a device has failed) finds nothing due, and the
/// bus is not asked for more than it carries.
const EVERY: Duration = Duration::from_millis(500);
/// Messages with lines that are said at once at most; what is older then is not said.
const MESSAGES_MAX: usize = 4;

/// What one node says of itself.
pub(super) struct SelfReport {
    node: Sender,
    instance: u64,
    /// In parts, as they are said.
    settings: Vec<String>,
    book: LogBook,
    asked: Mutex<Asked>,
}

#[derive(Default)]
struct Asked {
    /// When somebody asked last for lines.
    for_lines: Option<Instant>,
    /// Who is told the last lines, and the settings, that were said before it came.
    newcomers: [Newcomers; 2],
    /// The last line that was said to all who ask.
    said: u32,
    /// The next part of the settings that is to be said, if one is.
    next_part: Option<usize>,
    /// When something was said last.
    said_at: Option<Instant>,
}

impl SelfReport {
    /// Makes the report of a node that nobody has asked, with the settings (TOML) that it runs with.
    pub(super) fn new(node: Sender, instance: u64, settings: &str, book: LogBook) -> SelfReport {
        SelfReport {
            node,
            instance,
            settings: parts_of(settings),
            book,
            asked: Mutex::default(),
        }
    }

    /// Takes a greeting.
    pub(super) fn hear(&self, now: Instant, sender: Sender, hello: &Hello) {
        if !matches!(sender, Sender::Operator(_)) {
            return;
        }
        let asked = &mut *lock(&self.asked);
        let [for_lines, for_settings] = &mut asked.newcomers;
        if hello.interest.contains(&Interest::Log) {
            // Nobody was told anything while nobody asked.
            let was_asked = asked.for_lines.is_some_and(|at| now - at < ASKED_FOR);
            if for_lines.greets(now, hello.instance) || !was_asked {
                let before_last = LOG_LINES_MAX as u32;
                asked.said = asked.said.min(self.book.last().saturating_sub(before_last));
            }
            asked.for_lines = Some(now);
        }
        if hello.interest.contains(&Interest::Settings) {
            // Whoever has come meanwhile is told the first parts the second time.
            if for_settings.greets(now, hello.instance) {
                asked.next_part = asked.next_part.or(Some(0));
            }
        }
    }

    /// Returns what is to be said now; called about once a second, or more often.
    pub(super) fn due(&self, now: Instant) -> Vec<Message> {
        let mut asked = lock(&self.asked);
        let mut said = Vec::new();
        if asked.said_at.is_some_and(|at| now - at < EVERY) {
            return said;
        }
        if asked.for_lines.is_some_and(|at| now - at < ASKED_FOR) {
            let lines = self.book.lines(now, asked.said, SAID_AGAIN);
            asked.said = lines
                .last()
                .map_or(asked.said, |line| line.number.max(asked.said));
            let more = lines.len().saturating_sub(MESSAGES_MAX * LOG_LINES_MAX);
            said.extend(lines[more..].chunks(LOG_LINES_MAX).map(|lines| {
                Message::Log(LogLines {
                    node: self.node,
                    instance: self.instance,
                    lines: lines.to_vec(),
                })
            }));
        } else {
            asked.said = self.book.last();
        }
        if let Some(part) = asked.next_part {
            asked.next_part = Some(part + 1).filter(|next| *next < self.settings.len());
            said.push(Message::Settings(NodeSettings {
                node: self.node,
                instance: self.instance,
                part: part as u8,
                parts: self.settings.len() as u8,
                text: self.settings[part].clone(),
            }));
        }
        if !said.is_empty() {
            asked.said_at = Some(now);
        }
        said
    }
}

/// Returns settings in parts of whole lines; of a text that is too long the first ones, and the last says that there are more.
fn parts_of(settings: &str) -> Vec<String> {
    const MORE: &str = "# There is more, too long to be said.\n";
    let mut parts = vec![String::new()];
    for line in settings.split_inclusive('\n') {
        let line = fitted(line.to_owned(), SETTINGS_PART_BYTES_MAX - MORE.len());
        let last = parts.last().map_or(0, String::len);
        if last + line.len() > SETTINGS_PART_BYTES_MAX - MORE.len() {
            if parts.len() == usize::from(SETTINGS_PARTS_MAX) {
                parts
                    .last_mut()
                    .into_iter()
                    .for_each(|part| part.push_str(MORE));
                break;
            }
            parts.push(String::new());
        }
        parts
            .last_mut()
            .into_iter()
            .for_each(|part| part.push_str(&line));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, LogSeverity, OperatorId, VehicleId};

    fn report(book: &LogBook) -> SelfReport {
        let node = Sender::Vehicle(VehicleId(2));
        SelfReport::new(node, 4, "id = 2\n", book.clone())
    }

    fn hello(instance: u64, interest: Vec<Interest>) -> Hello {
        let operator = Sender::Operator(OperatorId(1));
        Hello {
            interest,
            ..Hello::asking(operator, Boot(1), 7, instance)
        }
    }

    /// The numbers of the lines that are said.
    fn lines(said: &[Message]) -> Vec<u32> {
        let of = |message: &Message| match message {
            Message::Log(log) => log.lines.iter().map(|line| line.number).collect(),
            Message::Settings(_) => Vec::new(),
            other => panic!("{other:?}"),
        };
        said.iter().flat_map(of).collect()
    }

    fn settings(said: &[Message]) -> usize {
        let is_one = |message: &&Message| matches!(message, Message::Settings(_));
        said.iter().filter(is_one).count()
    }

    #[test]
    fn lines_are_said_to_whoever_asks_and_a_young_one_again() {
        let book = LogBook::default();
        let report = report(&book);
        let began = Instant::now();
        let at = |ms| began + Duration::from_millis(ms);
        let write = |ms| book.write(at(ms), LogSeverity::Info, "x".to_owned());
        let operator = Sender::Operator(OperatorId(1));
        (0..40).for_each(|_| write(0));
        assert_eq!(lines(&report.due(at(5000))), [0; 0], "nobody asks");
        report.hear(at(5000), operator, &hello(1, vec![Interest::Fleet]));
        assert_eq!(lines(&report.due(at(5000))), [0; 0], "nor now");
        let asks = hello(1, vec![Interest::Log]);
        report.hear(at(6000), Sender::Ground, &asks);
        assert_eq!(lines(&report.due(at(6000))), [0; 0], "only operators may");

        report.hear(at(6000), operator, &asks);
        assert_eq!(
            lines(&report.due(at(6000))),
            (25..=40).collect::<Vec<u32>>()
        );
        assert_eq!(lines(&report.due(at(6500))), [0; 0], "they are old");
        write(6600);
        assert_eq!(lines(&report.due(at(7000))), [41]);
        assert_eq!(lines(&report.due(at(8000))), [41], "once more");
        write(8500);
        assert_eq!(lines(&report.due(at(9000))), [41, 42]);
        assert_eq!(lines(&report.due(at(10_000))), [42]);
        // Another one comes, and is told what was said before; so is the first one anew.
        report.hear(at(10_500), operator, &hello(2, vec![Interest::Log]));
        assert_eq!(
            lines(&report.due(at(10_500))),
            (27..=42).collect::<Vec<u32>>()
        );
        assert_eq!(lines(&report.due(at(20_400))), [0; 0]);
        write(20_450);
        assert_eq!(
            lines(&report.due(at(20_600))),
            [0; 0],
            "nobody asks any more"
        );
        report.hear(at(30_000), operator, &asks);
        assert_eq!(
            lines(&report.due(at(30_000))),
            (28..=43).collect::<Vec<u32>>()
        );
    }

    #[test]
    fn a_flood_of_lines_is_bounded_in_each_message_and_in_all() {
        let book = LogBook::default();
        let report = report(&book);
        let now = Instant::now();
        let operator = Sender::Operator(OperatorId(1));
        report.hear(now, operator, &hello(1, vec![Interest::Log]));
        (0..1000).for_each(|_| book.write(now, LogSeverity::Info, "x".repeat(1000)));
        let said = report.due(now);
        assert_eq!(said.len(), MESSAGES_MAX);
        assert!(said.iter().all(|message| message.check().is_ok()));
        assert_eq!(lines(&said), (937..=1000).collect::<Vec<u32>>());
    }

    #[test]
    fn settings_are_said_twice_to_whoever_asks() {
        let book = LogBook::default();
        let report = report(&book);
        let began = Instant::now();
        let at = |ms| began + Duration::from_millis(ms);
        let operator = Sender::Operator(OperatorId(1));
        let mut said = Vec::new();
        for second in 0..20 {
            let now = at(second * 1000);
            report.hear(
                now,
                operator,
                &hello(1, vec![Interest::Log, Interest::Settings]),
            );
            said.extend(report.due(now));
        }
        assert_eq!(settings(&said), 2);
        let Some(Message::Settings(first)) = said.first() else {
            panic!("{said:?}");
        };
        let expected = (report.node, 4, (0, 1), "id = 2\n");
        let parts = (first.part, first.parts);
        assert_eq!(
            (first.node, first.instance, parts, first.text.as_str()),
            expected
        );
        report.hear(at(30_000), operator, &hello(2, vec![Interest::Settings]));
        assert_eq!(settings(&report.due(at(30_000))), 1, "another one");
    }

    #[test]
    fn settings_are_said_in_parts_of_whole_lines_one_at_a_time() {
        let long: String = (0..1000)
            .map(|number| format!("key_{number} = \"ä\"\n"))
            .collect();
        let report = SelfReport::new(Sender::Ground, 4, &long, LogBook::default());
        let now = Instant::now();
        let operator = Sender::Operator(OperatorId(1));
        report.hear(now, operator, &hello(1, vec![Interest::Settings]));
        let mut said = String::new();
        for expected in 0..4 {
            let at = now + EVERY * u32::from(expected);
            let messages = report.due(at);
            assert_eq!(report.due(at + EVERY / 2), [], "one at a time");
            let [Message::Settings(part)] = &messages[..] else {
                panic!("{messages:?}");
            };
            assert_eq!((part.part, part.parts), (expected, 4));
            assert!(messages[0].check().is_ok() && part.text.ends_with('\n'));
            said.push_str(&part.text);
        }
        assert_eq!(said, long);
        assert_eq!(report.due(now + EVERY * 4), []);
    }

    #[test]
    fn of_settings_without_end_the_first_parts_are_said_and_that_there_are_more() {
        let endless = parts_of(&"# ä\n".repeat(50_000));
        assert_eq!(endless.len(), usize::from(SETTINGS_PARTS_MAX));
        assert!(
            endless
                .iter()
                .all(|part| part.len() <= SETTINGS_PART_BYTES_MAX)
        );
        assert!(endless[15].ends_with("# ä\n# There is more, too long to be said.\n"));
        let of_one_line = parts_of(&"x".repeat(10_000));
        assert_eq!(of_one_line.len(), 1);
        assert!(of_one_line[0].ends_with("x…"));
        assert_eq!(parts_of(""), [""]);
    }
}
