//! What happened: a list of lines made of what nodes say anew of themselves, and of orders with how they fared. Bounded; the
//! oldest go first.
//!
//! It keeps no messages and judges nothing: a line says what has changed between two messages of one node. Lines of orders,
//! images and marks are its caller's, who knows what of them is new.

use std::collections::VecDeque;

use tomoswarm_proto::{GroundReport, Health, Message, MissionProgress, State, VehicleId};

use crate::operator::fleet_view::{FleetView, SILENT_AFTER};
use crate::operator::names::{mode, phase};
use crate::time::Time;

/// Events kept at most.
pub const EVENTS_MAX: usize = 400;

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
            self.events.pop_front();
        }
    }

    /// Takes a message, with what was known before it came.
    pub fn hear(&mut self, now: Time, message: &Message, known: &FleetView) {
        match message {
            Message::State(state) => self.state(now, state, known),
            Message::Mission(mission) => self.mission(now, mission, known),
            Message::Health(health) => self.health(now, health, known),
            Message::Report(report) => self.report(now, report, known),
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
            | Message::Look(_) => {}
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
                Some(why) => format!("stands: {}", super::records::stand_reason(why)),
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
            let (run, done, laps) = (report.run.0, report.laps_done, report.laps);
            let text = format!(
                "ground station: {}, run {run}, lap {done} of {laps}",
                phase(report.phase)
            );
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
            "change [VehicleId(1)] stands: held",
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
}
