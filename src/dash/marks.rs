//! Where somebody truly stands: the marks that are known, by whom they are stored or only asked for, and those that pages have
//! asked for with how they fared. It judges no right ([`super::gate`] does), and stores nothing: the ground station does.
//!
//! A mark is known as stored once a ground station says it. What an operator says before is shown as asked for.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Mark, Position, RunId, Sender};

use super::given::{Given, GivenBook};
use crate::config::Venue;
use crate::geom::Point;
use crate::operator::given_marks::{MarkOutcome, MarkRequest};

/// Marks kept at most; those of the oldest run go first.
const MARKS_MAX: usize = 500;
/// A mark that no ground station has stored is given up after this time.
const MARK_WITHIN: Duration = Duration::from_secs(5);
/// A place is no further away than this, metres.
const FAR_M: f64 = 100_000.0;

/// A mark as a page asks for it: what `tomoswarm order CONFIG mark` takes.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MarkOrder {
    /// Where, metres in the venue's frame.
    pub at: [f64; 2],
    /// By which page.
    pub page: u32,
    /// In which run; `None` = the ground station's present or last one.
    #[serde(default)]
    pub run: Option<u32>,
    /// The mark there is taken back.
    #[serde(default)]
    pub take_back: bool,
}

impl MarkOrder {
    /// Reads what a page has posted, by the rules of the command line.
    ///
    /// # Errors
    /// It is no mark; in words.
    pub fn read(body: &[u8]) -> Result<MarkOrder, String> {
        let order: MarkOrder =
            serde_json::from_slice(body).map_err(|error| format!("not a mark: {error}"))?;
        if let Some(far) = order.at.iter().find(|metres| metres.abs() > FAR_M) {
            return Err(format!(
                "not a mark: {far} m is too far, at most {FAR_M} m are expected"
            ));
        }
        match order.run {
            Some(run) if run == 0 || run == u32::MAX => Err(format!(
                "not a mark: run {run} is none of 1 to {}",
                u32::MAX - 1
            )),
            _ => Ok(order),
        }
    }

    /// Returns it, unless it is a mark outside the fence; one may be taken back anywhere.
    ///
    /// # Errors
    /// Where the fence is, in words.
    pub fn within(self, venue: &Venue) -> Result<MarkOrder, String> {
        let [x_m, y_m] = self.at;
        match venue.refusal_of(Point::new(x_m, y_m)) {
            Some(outside) if !self.take_back => Err(format!("not marked: {outside}")),
            Some(_) | None => Ok(self),
        }
    }

    /// Returns what the operator is told.
    pub fn request(&self) -> MarkRequest {
        MarkRequest {
            run: self.run.map(RunId),
            at: self.place(),
            stands: !self.take_back,
            within: MARK_WITHIN,
        }
    }

    /// Returns the place as the bus has it.
    pub fn place(&self) -> Position {
        Position::from_metres(self.at[0], self.at[1], 0.0)
    }
}

/// How a mark is known.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MarkState {
    /// The ground station has stored it.
    Stored,
    /// Somebody has asked for it, and no ground station has said that it is stored.
    Asked,
    /// It is stored, and somebody has asked to take it back.
    TakingBack,
}

/// A mark that a page has asked for.
pub type GivenMark = Given<MarkOrder, MarkOutcome>;

/// The marks that are known, and the last ones that pages have asked for.
#[derive(Clone, Debug, Default)]
pub struct MarkBook {
    known: BTreeMap<(RunId, Position), MarkState>,
    /// The last ones that pages have asked for.
    pub given: GivenBook<MarkOrder, MarkOutcome>,
}

impl MarkBook {
    /// Takes a mark that was said; returns a line of what that changes, `None` = nothing.
    pub fn hear(&mut self, sender: Sender, mark: &Mark) -> Option<String> {
        let after = self.state_after(sender, mark);
        let key = (mark.run, mark.at);
        if self.known.get(&key).copied() == after {
            return None;
        }
        match after {
            Some(state) => self.known.insert(key, state),
            None => self.known.remove(&key),
        };
        if self.known.len() > MARKS_MAX {
            self.known.pop_first();
        }
        let (run, place) = (mark.run, in_metres(mark.at));
        Some(match after {
            Some(MarkState::Stored) => format!("run {run}: marked {place}"),
            Some(MarkState::Asked) => format!("run {run}: {place} is to be marked, says {sender}"),
            Some(MarkState::TakingBack) => {
                format!("run {run}: the mark at {place} is to be taken back, says {sender}")
            }
            None => format!("run {run}: the mark at {place} is taken back"),
        })
    }

    /// Returns whether what was said of a mark changes nothing.
    pub fn knows(&self, sender: Sender, mark: &Mark) -> bool {
        self.known.get(&(mark.run, mark.at)).copied() == self.state_after(sender, mark)
    }

    /// Returns how a place is known after something was said of it; `None` = it is no mark.
    fn state_after(&self, sender: Sender, mark: &Mark) -> Option<MarkState> {
        let before = self.known.get(&(mark.run, mark.at)).copied();
        let is_stored = matches!(before, Some(MarkState::Stored | MarkState::TakingBack));
        match (sender, mark.stands) {
            (Sender::Ground, true) => Some(MarkState::Stored),
            (Sender::Ground, false) => None,
            (Sender::Operator(_) | Sender::Vehicle(_), true) => match is_stored {
                true => Some(MarkState::Stored),
                false => Some(MarkState::Asked),
            },
            (Sender::Operator(_) | Sender::Vehicle(_), false) => {
                is_stored.then_some(MarkState::TakingBack)
            }
        }
    }

    /// Returns the marks that are known, by run and place.
    pub fn known(&self) -> impl Iterator<Item = (RunId, Position, MarkState)> {
        self.known
            .iter()
            .map(|((run, at), state)| (*run, *at, *state))
    }

    /// Returns whether there is nothing to show.
    pub fn is_empty(&self) -> bool {
        self.known.is_empty() && self.given.is_empty()
    }
}

/// Returns a place in words, metres.
pub fn in_metres(at: Position) -> String {
    format!("({}, {})", at.x_m(), at.y_m())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::OperatorId;

    const OPERATOR: Sender = Sender::Operator(OperatorId(3));

    fn mark(x_m: f64, stands: bool) -> Mark {
        Mark {
            run: RunId(2),
            at: Position::from_metres(x_m, 7.5, 0.0),
            stands,
        }
    }

    fn states(book: &MarkBook) -> Vec<(f64, MarkState)> {
        book.known()
            .map(|(_, at, state)| (at.x_m(), state))
            .collect()
    }

    #[test]
    fn a_mark_is_asked_for_until_the_ground_has_stored_it_and_each_change_is_a_line() {
        let mut book = MarkBook::default();
        let steps = [
            (
                OPERATOR,
                true,
                Some("run 2: (3.2, 7.5) is to be marked, says operator 3"),
            ),
            (OPERATOR, true, None),
            (Sender::Ground, true, Some("run 2: marked (3.2, 7.5)")),
            (OPERATOR, true, None),
            (
                OPERATOR,
                false,
                Some("run 2: the mark at (3.2, 7.5) is to be taken back, says operator 3"),
            ),
            (
                Sender::Ground,
                false,
                Some("run 2: the mark at (3.2, 7.5) is taken back"),
            ),
            (OPERATOR, false, None),
        ];
        let expected = [
            vec![(3.2, MarkState::Asked)],
            vec![(3.2, MarkState::Asked)],
            vec![(3.2, MarkState::Stored)],
            vec![(3.2, MarkState::Stored)],
            vec![(3.2, MarkState::TakingBack)],
            vec![],
            vec![],
        ];
        for ((sender, stands, line), known) in steps.into_iter().zip(expected) {
            let said = mark(3.2, stands);
            assert_eq!(book.knows(sender, &said), line.is_none(), "{said:?}");
            assert_eq!(book.hear(sender, &said).as_deref(), line);
            assert_eq!(states(&book), known);
        }
    }

    #[test]
    fn too_many_marks_let_those_of_the_oldest_run_go() {
        let mut book = MarkBook::default();
        for number in 0..=MARKS_MAX as u32 {
            let mark = Mark {
                run: RunId(number + 1),
                ..mark(1.0, true)
            };
            book.hear(Sender::Ground, &mark);
        }
        assert_eq!(book.known().count(), MARKS_MAX);
        assert_eq!(book.known().next().unwrap().0, RunId(2));
    }

    #[test]
    fn a_request_is_read_and_what_is_none_is_refused_with_a_reason() {
        let read = |body: &str| MarkOrder::read(body.as_bytes());
        let order = read(r#"{"at":[3.2,-7.5],"page":1,"run":4,"take_back":true}"#).unwrap();
        let expected = MarkRequest {
            run: Some(RunId(4)),
            at: Position::from_metres(3.2, -7.5, 0.0),
            stands: false,
            within: MARK_WITHIN,
        };
        assert_eq!(order.request(), expected);
        let plain = read(r#"{"at":[3,7],"page":1}"#).unwrap().request();
        assert_eq!((plain.run, plain.stands), (None, true));
        for (body, reason) in [
            ("", "EOF"),
            (r#"{"page":1}"#, "missing field `at`"),
            (r#"{"at":[1,2]}"#, "missing field `page`"),
            (r#"{"at":[1],"page":1}"#, "invalid length 1"),
            (r#"{"at":[1,null],"page":1}"#, "invalid type: null"),
            (r#"{"at":[1,1e6],"page":1}"#, "at most 100000 m"),
            (r#"{"at":[1,2],"page":1,"run":0}"#, "run 0"),
            (r#"{"at":[1,2],"page":1,"run":4294967295}"#, "none of 1 to"),
            (r#"{"at":[1,2],"page":1,"who":"me"}"#, "unknown field `who`"),
        ] {
            let refused = read(body).unwrap_err();
            assert!(refused.contains(reason), "{body}: {refused}");
        }
    }
}
