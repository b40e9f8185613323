//! The marks that an operator has given, and which of them are still to be said: each every 200 ms until the ground station
//! says the same, which is when it has stored it, or until its time is up. A mark without a run is one of the ground station's
//! present run, or of its last one; one in a run above all that it knows is refused, and so said only when it was heard. It
//! knows no lease: a mark moves nobody.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Mark, Position, RunId};

use super::fleet_view::FleetView;
use crate::time::Time;

/// A mark that is not stored yet is said again after this long.
const REPEAT: Duration = Duration::from_millis(200);

/// How the troubles begin that a ground station shows while it cannot store marks.
const STORE_TROUBLES: [&str; 3] = ["store of marks: ", "store: ", "folder: "];

/// A mark as an operator wants it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct MarkRequest {
    /// In which run; `None` = the ground station's present or last one.
    pub run: Option<RunId>,
    /// Where, in the venue's frame.
    pub at: Position,
    /// Whether it is a mark; `false` = the mark there is taken back.
    pub stands: bool,
    /// It is given up after so long.
    pub within: Duration,
}

/// How a mark ended.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum MarkOutcome {
    /// The ground station has stored it.
    Stored(Mark),
    /// No ground station was heard that names a run.
    NoRun,
    /// It was said, and no ground station has said that it is stored.
    NotStored(Mark),
    /// It was said, and the ground station shows why it stores no marks.
    StoreInTrouble {
        /// What was said.
        mark: Mark,
        /// What is wrong, in the ground station's words.
        trouble: String,
    },
    /// It was withdrawn before.
    Withdrawn,
    /// The ground station knows no such run, and so nothing was said.
    UnknownRun {
        /// The run that was named.
        run: RunId,
        /// The newest one that it knows; 0 = none.
        newest: RunId,
    },
}

impl fmt::Display for MarkOutcome {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MarkOutcome::Stored(mark) => {
                // What the ground station says is how it is now, also where nothing was marked before.
                let word = if mark.stands {
                    "marked"
                } else {
                    "not marked now"
                };
                write!(to, "run {}: {} is {word}", mark.run, place(mark))
            }
            MarkOutcome::NoRun => to.write_str("no ground station was heard that names a run"),
            MarkOutcome::NotStored(mark) => {
                let (run, place) = (mark.run, place(mark));
                write!(
                    to,
                    "no ground station has stored the mark at {place} of run {run} in time; one that has heard it, and whose disk is full, \
                     stores it once there is room"
                )
            }
            MarkOutcome::StoreInTrouble { mark, trouble } => {
                let (run, place) = (mark.run, place(mark));
                write!(
                    to,
                    "the ground station has not stored the mark at {place} of run {run} in time: {trouble}"
                )
            }
            MarkOutcome::Withdrawn => to.write_str("withdrawn"),
            MarkOutcome::UnknownRun { run, newest } => match newest.0 {
                0 => write!(
                    to,
                    "there is no run {run}: the ground station knows none yet"
                ),
                _ => write!(to, "there is no run {run}: the newest is {newest}"),
            },
        }
    }
}

fn place(mark: &Mark) -> String {
    let Position { x_mm, y_mm, .. } = mark.at;
    format!("({}, {})", f64::from(x_mm) / 1e3, f64::from(y_mm) / 1e3)
}

/// The marks that are not stored yet, by the numbers of their requests.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct GivenMarks(BTreeMap<u32, OpenMark>);

/// A mark that is not stored yet.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct OpenMark {
    request: MarkRequest,
    until: Time,
    /// What is said, and when it was said last, once the run is known.
    said: Option<(Mark, Time)>,
}

impl GivenMarks {
    /// Takes a mark up, in place of an earlier one with this number.
    pub(super) fn give(&mut self, now: Time, number: u32, request: MarkRequest) {
        let until = now + request.within;
        let given = OpenMark {
            request,
            until,
            said: None,
        };
        self.0.insert(number, given);
    }

    /// Takes what a ground station has stored; returns the numbers of the marks that ends.
    pub(super) fn stored(&mut self, stored: Mark) -> Vec<(u32, MarkOutcome)> {
        let is_it = |given: &OpenMark| given.said.is_some_and(|(mark, _)| mark == stored);
        let ended = self.take(is_it).into_iter();
        ended
            .map(|(number, _)| (number, MarkOutcome::Stored(stored)))
            .collect()
    }

    /// Takes out those of which that is so.
    fn take(&mut self, is_over: impl Fn(&OpenMark) -> bool) -> BTreeMap<u32, OpenMark> {
        let (over, open) = std::mem::take(&mut self.0)
            .into_iter()
            .partition(|(_, given)| is_over(given));
        self.0 = open;
        over
    }

    /// Gives a mark up; returns whether there was one.
    pub(super) fn withdraw(&mut self, number: u32) -> bool {
        self.0.remove(&number).is_some()
    }

    /// Returns what is to be said now, if anyone can be reached.
    pub(super) fn due(&mut self, now: Time, view: &FleetView, is_linked: bool) -> Vec<Mark> {
        let ground = view.ground(now).map(|report| &report.value);
        let present = ground.and_then(|report| {
            let last = report.runs.last().map(|run| run.run);
            let runs = [Some(report.run), last];
            runs.into_iter().flatten().find(|run| run.0 > 0)
        });
        let mut due = Vec::new();
        for given in self.0.values_mut().filter(|_| is_linked) {
            let run = given.said.map(|(mark, _)| mark.run);
            let is_judged = ground.is_some() || !given.request.stands;
            let named = given.request.run.filter(|_| is_judged);
            let Some(run) = run.or(named).or(present) else {
                continue;
            };
            if given.said.is_none_or(|(_, at)| now.since(at) >= REPEAT) {
                let MarkRequest { at, stands, .. } = given.request;
                let mark = Mark { run, at, stands };
                given.said = Some((mark, now));
                due.push(mark);
            }
        }
        due
    }

    /// Takes out the marks in runs above all that the ground station knows; one may be taken back in any run.
    pub(super) fn of_unknown_runs(
        &mut self,
        now: Time,
        view: &FleetView,
    ) -> Vec<(u32, MarkOutcome)> {
        let Some(report) = view.ground(now).map(|report| &report.value) else {
            return Vec::new();
        };
        let runs = report.runs.iter().map(|run| run.run);
        let newest = runs.fold(report.run, RunId::max);
        let named = |given: &OpenMark| given.request.run.filter(|run| *run > newest);
        let over = self
            .take(|given| given.said.is_none() && given.request.stands && named(given).is_some());
        let refused = |(number, given): (u32, OpenMark)| {
            let run = named(&given)?;
            Some((number, MarkOutcome::UnknownRun { run, newest }))
        };
        over.into_iter().filter_map(refused).collect()
    }

    /// Takes out the marks whose time is up.
    pub(super) fn given_up(&mut self, now: Time, view: &FleetView) -> Vec<(u32, MarkOutcome)> {
        let over = self.take(|given| now >= given.until).into_iter();
        let trouble = view.ground(now).and_then(|report| {
            let is_of_store = |trouble: &&String| {
                let mut names = STORE_TROUBLES.iter();
                names.any(|name| trouble.starts_with(name))
            };
            report.value.troubles.iter().find(is_of_store)
        });
        let outcome = |given: OpenMark| {
            let MarkRequest {
                run, at, stands, ..
            } = given.request;
            let named = run.map(|run| Mark { run, at, stands });
            match (given.said, trouble, named) {
                (Some((mark, _)), Some(trouble), _) => MarkOutcome::StoreInTrouble {
                    mark,
                    trouble: trouble.clone(),
                },
                (Some((mark, _)), None, _) | (None, _, Some(mark)) => MarkOutcome::NotStored(mark),
                (None, _, None) => MarkOutcome::NoRun,
            }
        };
        over.map(|(number, given)| (number, outcome(given)))
            .collect()
    }

    /// Returns when something is due next, while nothing is heard.
    pub(super) fn next(&self) -> Option<Time> {
        let next = |given: &OpenMark| match given.said {
            Some((_, at)) => given.until.min(at + REPEAT),
            None => given.until,
        };
        self.0.values().map(next).min()
    }
}

#[cfg(test)]
mod tests {
    use super::super::HeardMessage;
    use super::super::tests_support::{at, heard, report};
    use super::*;
    use tomoswarm_proto::{GroundReport, Message};

    const HERE: Position = Position {
        x_mm: 8000,
        y_mm: 12_250,
        z_mm: 0,
    };

    fn request(run: Option<RunId>) -> MarkRequest {
        MarkRequest {
            run,
            at: HERE,
            stands: true,
            within: Duration::from_secs(3),
        }
    }

    fn view_of(run: u32) -> FleetView {
        let mut view = FleetView::default();
        let report = GroundReport {
            run: RunId(run),
            ..report()
        };
        let said: HeardMessage = heard(Message::Report(report));
        view.hear(at(0.0), &said);
        view
    }

    #[test]
    fn a_mark_is_said_until_the_ground_says_the_same() {
        let (mut marks, view) = (GivenMarks::default(), view_of(4));
        marks.give(at(0.0), 7, request(None));
        assert_eq!(marks.due(at(0.0), &view, false), vec![]);
        let mark = Mark {
            run: RunId(4),
            at: HERE,
            stands: true,
        };
        assert_eq!(marks.due(at(0.1), &view, true), vec![mark]);
        assert_eq!(marks.due(at(0.2), &view, true), vec![]);
        assert_eq!(marks.next(), Some(at(0.3)));
        assert_eq!(marks.due(at(0.3), &view, true), vec![mark]);
        let other = Mark {
            stands: false,
            ..mark
        };
        assert_eq!(marks.stored(other), vec![]);
        assert_eq!(marks.stored(mark), vec![(7, MarkOutcome::Stored(mark))]);
        assert_eq!(
            (marks.next(), marks.given_up(at(9.0), &view)),
            (None, vec![])
        );
    }

    #[test]
    fn a_mark_stays_in_the_run_in_which_it_was_said_first() {
        let mut marks = GivenMarks::default();
        marks.give(at(0.0), 1, request(None));
        let first = marks.due(at(0.1), &view_of(4), true);
        let again = marks.due(at(0.5), &view_of(5), true);
        assert_eq!((first.len(), &first), (1, &again));
    }

    #[test]
    fn a_mark_in_a_run_above_all_that_the_ground_knows_is_refused_and_taken_back_all_the_same() {
        let (mut marks, view) = (GivenMarks::default(), view_of(4));
        let back = MarkRequest {
            stands: false,
            ..request(Some(RunId(9)))
        };
        marks.give(at(0.0), 1, request(Some(RunId(9))));
        marks.give(at(0.0), 2, request(Some(RunId(4))));
        marks.give(at(0.0), 3, back);
        let nobody = FleetView::default();
        assert_eq!(marks.of_unknown_runs(at(0.1), &nobody), vec![]);
        assert_eq!(
            marks.due(at(0.1), &nobody, true).len(),
            1,
            "what is taken back"
        );
        let (run, newest) = (RunId(9), RunId(4));
        let refused = MarkOutcome::UnknownRun { run, newest };
        assert_eq!(refused.to_string(), "there is no run 9: the newest is 4");
        assert_eq!(marks.of_unknown_runs(at(0.2), &view), vec![(1, refused)]);
        assert_eq!(marks.due(at(0.2), &view, true).len(), 1);
    }

    #[test]
    fn a_mark_that_nobody_stores_is_given_up_with_its_reason() {
        let mut marks = GivenMarks::default();
        marks.give(at(0.0), 1, request(None));
        marks.give(at(0.0), 2, request(Some(RunId(9))));
        assert_eq!(marks.due(at(0.1), &FleetView::default(), true), vec![]);
        let nobody = FleetView::default();
        assert_eq!(marks.given_up(at(2.9), &nobody), vec![]);
        let over = marks.given_up(at(3.0), &nobody);
        let is_of_run = |outcome: &MarkOutcome| matches!(outcome, MarkOutcome::NotStored(mark) if mark.run == RunId(9));
        assert_eq!(over[0], (1, MarkOutcome::NoRun));
        assert!(over[1].0 == 2 && is_of_run(&over[1].1));
    }

    #[test]
    fn a_mark_that_meets_a_full_disk_is_given_up_with_the_words_of_the_ground() {
        let full = "store of marks: g.sqlite: the disk is full";
        for (troubles, expected) in [
            (
                vec!["clock: off", full],
                "the ground station has not stored the mark at (8, 12.25) of run 4 in time: store of marks: g.sqlite: the disk \
                 is full",
            ),
            (
                vec!["store of samples: g.sqlite: the disk is full"],
                "no ground station has stored",
            ),
        ] {
            let (mut marks, mut view) = (GivenMarks::default(), view_of(4));
            marks.give(at(0.0), 1, request(None));
            assert_eq!(marks.due(at(0.1), &view, true).len(), 1);
            let report = GroundReport {
                run: RunId(4),
                troubles: troubles.into_iter().map(str::to_owned).collect(),
                ..report()
            };
            view.hear(at(1.0), &heard(Message::Report(report)));
            let over = marks.given_up(at(3.0), &view);
            assert_eq!(over.len(), 1);
            let said = over[0].1.to_string();
            assert!(said.starts_with(expected), "{said}");
        }
    }
}
