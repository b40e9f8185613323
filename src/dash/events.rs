//! What happened: a list of lines made of what nodes say anew of themselves, and of orders with how they fared. Bounded; the
//! oldest go first.
//!
//! It keeps no messages and judges nothing: a line says what has changed between two messages of one node. Lines of orders,
//! images and marks are its caller's, who knows what of them is new.

use std::collections::VecDeque;
use std::time::Duration;

use tomoswarm_proto::{
    GroundReport, Health, LogLine, LogLines, LogSeverity, Message, MissionProgress, Sender, State,
    VehicleId,
};

use crate::operator::fleet_view::{FleetView, SILENT_AFTER};
use crate::operator::names::{laps, mode, phase};
use crate::time::Time;

/// Events kept at most.
pub const EVENTS_MAX: usize = 400;
/// Starts of nodes' software of which is known which lines of their logs were told.
const STARTS_MAX: usize = 512;

/// What an event is about.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum EventKind {
    /// What a vehicle or the ground station does.
    Change,
    /// Something that is wrong.
    Trouble,
    /// An order, and how it fared.
    Order,
    /// An image has come.
    Image,
    /// Where somebody truly stands.
    Mark,
    /// A line of a node's own log.
    Note,
}

impl EventKind {
    /// Returns the word as people read it.
    pub fn word(self) -> &'static str {
        match self {
            EventKind::Change => "change",
            EventKind::Trouble => "trouble",
            EventKind::Order => "order",
            EventKind::Image => "image",
            EventKind::Mark => "mark",
            EventKind::Note => "note",
        }
    }
}

/// Something that happened.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Event {
    /// Counted from 1.
    pub number: u64,
    /// When it was heard.
    pub at: Time,
    /// Of which kind.
    pub kind: EventKind,
    /// Which vehicles it concerns; empty = the ground station, or all.
    pub vehicles: Vec<VehicleId>,
    /// What happened.
    pub text: String,
}

/// The last events.
#[derive(Clone, Debug, Default)]
pub struct EventList {
    events: VecDeque<Event>,
    last: u64,
    /// Which lines of logs were told, the newest start of a node's software last.
    said: VecDeque<ToldLines>,
}

/// Which lines of the log of one start of a node's software were told.
#[derive(Clone, Debug)]
struct ToldLines {
    node: Sender,
    instance: u64,
    last: u32,
    /// Those before the last one, which is bit 0; older ones count as told.
    told: u64,
}

impl ToldLines {
    fn is_of(&self, log: &LogLines) -> bool {
        (self.node, self.instance) == (log.node, log.instance)
    }

    fn is_told(&self, number: u32) -> bool {
        match self.last.checked_sub(number) {
            Some(back) => back >= u64::BITS || self.told >> back & 1 == 1,
            None => false,
        }
    }

    fn tell(&mut self, number: u32) {
        match number.checked_sub(self.last) {
            Some(ahead) => {
                self.told = self.told.checked_shl(ahead).unwrap_or(0) | 1;
                self.last = number;
            }
            None => self.told |= 1_u64.checked_shl(self.last - number).unwrap_or(0),
        }
    }
}

impl EventList {
    /// Returns the events behind a number, oldest first.
    pub fn after(&self, number: u64) -> impl Iterator<Item = &Event> {
        self.events
            .iter()
            .filter(move |event| event.number > number)
    }

    /// Returns the number of the newest event; 0 = none.
    pub fn last(&self) -> u64 {
        self.last
    }

    /// Returns the bytes that they take, about.
    pub fn bytes(&self) -> usize {
        let texts = self.events.iter().map(|event| event.text.len());
        texts.sum::<usize>() + self.events.len() * size_of::<Event>()
    }

    /// Adds an event.
    pub fn add(&mut self, now: Time, kind: EventKind, vehicles: Vec<VehicleId>, text: String) {
        self.last += 1;
        self.events.push_back(Event {
            number: self.last,
            at: now,
            kind,
            vehicles,
            text,
        });
        if self.events.len() > EVENTS_MAX {
            // Lines of logs are many: where they are more than half they go first.
            let is_note = |event: &Event| event.kind == EventKind::Note;
            let notes = self.events.iter().filter(|event| is_note(event)).count();
            let first_note = self.events.iter().position(is_note);
            let goes = first_note.filter(|_| notes > EVENTS_MAX / 2);
            self.events.remove(goes.unwrap_or_default());
        }
    }

    /// Takes a message, with what was known before it came.
    pub fn hear(&mut self, now: Time, message: &Message, known: &FleetView) {
        match message {
            Message::State(state) => self.state(now, state, known),
            Message::Mission(mission) => self.mission(now, mission, known),
            Message::Health(health) => self.health(now, health, known),
            Message::Report(report) => self.report(now, report, known),
            Message::Log(log) => self.log(now, log),
            Message::Standing(_)
            | Message::Hello(_)
            | Message::Tile(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Plan(_)
            | Message::Order(_)
            | Message::Samples(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Task(_)
            | Message::Image(_)
            | Message::Fix(_)
            | Message::Mark(_)
            | Message::Look(_)
            | Message::Settings(_) => {}
        }
    }

    /// Returns a log with those lines only that were not told before; `None` = there is none.
    pub fn news_of(&self, log: &LogLines) -> Option<LogLines> {
        let said = self.said.iter().find(|said| said.is_of(log));
        let is_new = |line: &&LogLine| said.is_none_or(|said| !said.is_told(line.number));
        let lines: Vec<LogLine> = log.lines.iter().filter(is_new).cloned().collect();
        (!lines.is_empty()).then(|| LogLines {
            lines,
            ..log.clone()
        })
    }

    fn log(&mut self, now: Time, log: &LogLines) {
        let Some(news) = self.news_of(log) else {
            return;
        };
        if !self.said.iter().any(|said| said.is_of(log)) {
            self.said.push_back(ToldLines {
                node: log.node,
                instance: log.instance,
                last: 0,
                told: 1,
            });
            if self.said.len() > STARTS_MAX {
                self.said.pop_front();
            }
        }
        for line in news.lines {
            let said = self.said.iter_mut().find(|said| said.is_of(log));
            said.into_iter().for_each(|said| said.tell(line.number));
            let at = now - Duration::from_millis(line.age_ms.into());
            let severity = match line.severity {
                LogSeverity::Info => "",
                LogSeverity::Warning => "warning: ",
                LogSeverity::Error => "error: ",
            };
            let (vehicles, who) = match log.node {
                Sender::Vehicle(vehicle) => (vec![vehicle], String::new()),
                Sender::Ground | Sender::Operator(_) => (Vec::new(), format!("{}: ", log.node)),
            };
            let text = format!("{who}{severity}{}", line.text);
            self.add(at, EventKind::Note, vehicles, text);
        }
    }

    fn state(&mut self, now: Time, state: &State, known: &FleetView) {
        let mut say = |kind, text: String| self.add(now, kind, vec![state.vehicle], text);
        let Some(known) = known.state(state.vehicle) else {
            return say(EventKind::Change, format!("is heard: {}", mode(state.mode)));
        };
        let before = &known.value;
        if before.boot != state.boot {
            say(EventKind::Trouble, "was started anew".to_owned());
        }
        if known.age(now) > SILENT_AFTER {
            let silent_s = known.age(now).as_secs();
            say(
                EventKind::Trouble,
                format!("is heard again after {silent_s} s"),
            );
        }
        if before.stands_under != state.stands_under {
            let text = match state.stands_under {
                Some(why) => format!("does not go on: {}", super::records::stand_reason(why)),
                None => "may go on".to_owned(),
            };
            say(EventKind::Change, text);
        }
        if before.is_landed != state.is_landed {
            let text = if state.is_landed {
                "has landed"
            } else {
                "is in the air"
            };
            say(EventKind::Change, text.to_owned());
        }
    }

    fn mission(&mut self, now: Time, mission: &MissionProgress, known: &FleetView) {
        let before = known
            .vehicle(mission.vehicle)
            .and_then(|seen| seen.mission.as_ref());
        let key = |mission: &MissionProgress| (mission.progress.run, mission.kind, mission.end);
        if before.is_some_and(|before| key(&before.value) == key(mission)) {
            return;
        }
        let (run, kind) = (mission.progress.run.0, mission.kind.word());
        let text = match &mission.end {
            Some(end) => format!("run {run}, {kind}: {end}"),
            None => format!("run {run}: {kind}"),
        };
        self.add(now, EventKind::Change, vec![mission.vehicle], text);
    }

    fn health(&mut self, now: Time, health: &Health, known: &FleetView) {
        let before = known
            .vehicle(health.vehicle)
            .and_then(|seen| seen.health.as_ref());
        let before = before.map_or(&[][..], |before| &before.value.troubles);
        self.troubles(now, vec![health.vehicle], before, &health.troubles);
    }

    fn report(&mut self, now: Time, report: &GroundReport, known: &FleetView) {
        let before = known
            .grounds()
            .find(|known| known.value.store == report.store);
        let before = before.map(|before| &before.value);
        let key = |report: &GroundReport| (report.phase, report.run, report.laps_done);
        if before.is_none_or(|before| key(before) != key(report)) {
            let (run, laps) = (report.run.0, laps(report.laps_done, report.laps));
            let text = format!("ground station: {}, run {run}, {laps}", phase(report.phase));
            self.add(now, EventKind::Change, Vec::new(), text);
        }
        let known_lost = before.map_or(&[][..], |before| &before.lost);
        for id in report.lost.iter().filter(|id| !known_lost.contains(id)) {
            self.add(
                now,
                EventKind::Trouble,
                vec![*id],
                "the ground station has lost it".to_owned(),
            );
        }
        let known = before.map_or(&[][..], |before| &before.troubles);
        self.troubles(now, Vec::new(), known, &report.troubles);
    }

    /// Adds the troubles that are new, and those that are gone.
    fn troubles(&mut self, now: Time, whose: Vec<VehicleId>, before: &[String], after: &[String]) {
        for trouble in after.iter().filter(|trouble| !before.contains(trouble)) {
            self.add(now, EventKind::Trouble, whose.clone(), trouble.clone());
        }
        for trouble in before.iter().filter(|trouble| !after.contains(trouble)) {
            self.add(
                now,
                EventKind::Change,
                whose.clone(),
                format!("no more: {trouble}"),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::tests_support::{at, heard, report, state};
    use tomoswarm_proto::{Boot, StandReason};

    /// Returns the events of messages, each with its time.
    fn lines(messages: Vec<(f64, Message)>) -> Vec<String> {
        let (mut events, mut view) = (EventList::default(), FleetView::default());
        for (at_s, message) in messages {
            events.hear(at(at_s), &message, &view);
            view.hear(at(at_s), &heard(message));
        }
        let line =
            |event: &Event| format!("{} {:?} {}", event.kind.word(), event.vehicles, event.text);
        events.after(0).map(line).collect()
    }

    fn later(sequence: u64, change: impl FnOnce(&mut State)) -> Message {
        let mut later = State {
            sequence,
            ..state(1)
        };
        change(&mut later);
        Message::State(later)
    }

    fn troubled(troubles: &[&str]) -> Message {
        Message::Health(Health {
            vehicle: VehicleId(1),
            boot: Boot(1),
            troubles: troubles.iter().map(|&text| text.to_owned()).collect(),
            ..Health::default()
        })
    }

    #[test]
    fn what_a_vehicle_says_anew_is_an_event_and_what_it_repeats_is_none() {
        let held = |state: &mut State| state.stands_under = Some(StandReason::Held);
        let told = vec![
            (1.0, later(1, |_| {})),
            (1.5, later(2, |_| {})),
            (2.0, later(3, held)),
            (2.5, later(4, held)),
            (12.5, later(5, |_| {})),
        ];
        let expected = [
            "change [VehicleId(1)] is heard: idle",
            "change [VehicleId(1)] does not go on: held",
            "trouble [VehicleId(1)] is heard again after 10 s",
            "change [VehicleId(1)] may go on",
        ];
        assert_eq!(lines(told), expected);
    }

    #[test]
    fn a_trouble_comes_and_goes_once() {
        let told = vec![
            (1.0, troubled(&["no echo"])),
            (2.0, troubled(&["no echo", "<img>"])),
            (3.0, troubled(&["<img>"])),
        ];
        let expected = [
            "trouble [VehicleId(1)] no echo",
            "trouble [VehicleId(1)] <img>",
            "change [VehicleId(1)] no more: no echo",
        ];
        assert_eq!(lines(told), expected);
    }

    #[test]
    fn a_lap_and_a_lost_vehicle_are_events_of_the_ground_station() {
        let after = GroundReport {
            laps_done: 1,
            lost: vec![VehicleId(2)],
            ..report()
        };
        let told = vec![
            (1.0, Message::Report(report())),
            (2.0, Message::Report(after)),
        ];
        let said = lines(told);
        assert_eq!(said.len(), 3, "{said:?}");
        assert!(said[1].contains("lap 1 of"), "{said:?}");
        assert_eq!(
            said[2],
            "trouble [VehicleId(2)] the ground station has lost it"
        );
    }

    #[test]
    fn old_events_make_room_and_numbers_go_on() {
        let mut events = EventList::default();
        for n in 0..EVENTS_MAX + 5 {
            events.add(at(1.0), EventKind::Order, Vec::new(), n.to_string());
        }
        assert_eq!(events.after(0).count(), EVENTS_MAX);
        assert_eq!(events.after(0).next().unwrap().number, 6);
        assert_eq!(events.after(events.last() - 1).count(), 1);
    }

    /// Lines of a vehicle's log, `ages_s` old.
    fn log(instance: u64, lines: &[(u32, LogSeverity, u32)]) -> Message {
        let line = |(number, severity, age_s): &(u32, LogSeverity, u32)| LogLine {
            number: *number,
            age_ms: age_s * 1000,
            severity: *severity,
            text: format!("line {number}"),
        };
        Message::Log(LogLines {
            node: Sender::Vehicle(VehicleId(1)),
            instance,
            lines: lines.iter().map(line).collect(),
        })
    }

    #[test]
    fn each_line_of_a_log_is_one_note_however_often_it_is_said() {
        use LogSeverity::{Error, Info, Warning};
        let told = vec![
            (5.0, log(1, &[(3, Info, 4), (4, Warning, 1)])),
            (6.0, log(1, &[(4, Warning, 2), (5, Error, 0)])),
            (7.0, log(1, &[(5, Error, 1)])),
            (9.0, log(2, &[(1, Info, 0)])),
        ];
        let expected = [
            "note [VehicleId(1)] line 3",
            "note [VehicleId(1)] warning: line 4",
            "note [VehicleId(1)] error: line 5",
            "note [VehicleId(1)] line 1",
        ];
        assert_eq!(lines(told.clone()), expected);
        let mut events = EventList::default();
        let news = told.iter().map(|(at_s, message)| {
            let Message::Log(log) = message else {
                unreachable!()
            };
            let is_news = events.news_of(log).is_some();
            events.hear(at(*at_s), message, &FleetView::default());
            is_news
        });
        assert_eq!(news.collect::<Vec<bool>>(), [true, true, false, true]);
        let written: Vec<Time> = events.after(0).map(|event| event.at).collect();
        assert_eq!(written, [at(1.0), at(4.0), at(6.0), at(9.0)]);
    }

    #[test]
    fn a_line_that_comes_after_later_ones_is_told_and_two_starts_have_lines_of_their_own() {
        let mut events = EventList::default();
        let mut tell = |instance, numbers: std::ops::RangeInclusive<u32>| {
            let before = events.last();
            let lines: Vec<_> = numbers
                .map(|number| (number, LogSeverity::Info, 0))
                .collect();
            events.hear(at(9.0), &log(instance, &lines), &FleetView::default());
            events.last() - before
        };
        assert_eq!(tell(1, 17..=40), 24, "the first message was lost");
        assert_eq!(tell(1, 1..=18), 16, "and comes again");
        assert_eq!(tell(1, 1..=40), 0);
        assert_eq!(
            tell(2, 1..=3),
            3,
            "another ground station, or another start"
        );
        assert_eq!(tell(1, 40..=41), 1);
        assert_eq!(tell(2, 1..=3), 0, "and they take turns");
        assert_eq!(tell(1, 200..=200), 1);
        assert_eq!(tell(1, 130..=201), 64, "older ones count as told");
        assert_eq!(tell(3, u32::MAX..=u32::MAX), 1);
        assert_eq!(tell(3, 1..=1), 0);
        for instance in 10..10 + STARTS_MAX as u64 {
            tell(instance, 1..=1);
        }
        assert_eq!(events.said.len(), STARTS_MAX);
    }

    #[test]
    fn lines_of_logs_crowd_out_nothing_that_is_rarer() {
        let mut events = EventList::default();
        let add = |events: &mut EventList, kind| events.add(at(1.0), kind, vec![], String::new());
        for _ in 0..150 {
            add(&mut events, EventKind::Order);
        }
        for _ in 0..5000 {
            add(&mut events, EventKind::Note);
        }
        let count = |events: &EventList, kind| {
            let of_kind = events.after(0).filter(|event| event.kind == kind);
            of_kind.count()
        };
        assert_eq!(count(&events, EventKind::Order), 150);
        assert_eq!(count(&events, EventKind::Note), 250);
        for _ in 0..1000 {
            add(&mut events, EventKind::Trouble);
        }
        assert_eq!(count(&events, EventKind::Order), 0, "they are the oldest");
        assert_eq!(events.after(0).count(), EVENTS_MAX);
    }
}
