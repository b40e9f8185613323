//! A board at another time than the present: at a moment of the history, standing or going on at some speed. It is told the
//! time and keeps no clock; long ways through the history are gone in steps, so that whoever calls it can do other things
//! between.

use std::time::Duration;

use super::board::Board;
use super::history::{History, InflatedPart};
use crate::time::Time;

/// Inputs that are told at once; some milliseconds, and some more where a part of the history is inflated first.
pub const STEP_INPUTS: usize = 2000;
/// The fastest, in seconds of the history a second.
pub const SPEED_MAX: f64 = 1000.0;
/// What goes on is looked at this often.
const LOOKS_EVERY: Duration = Duration::from_millis(50);

/// A board at another time.
#[derive(Debug)]
pub struct Playback {
    board: Board,
    inflated: InflatedPart,
    /// The board was told everything before this moment.
    told_until: Time,
    /// When it began to go on, by the caller's clock, and from which moment.
    begun: (Time, Time),
    speed: f64,
    /// It was not yet told everything when it went on last.
    is_behind: bool,
}

impl Playback {
    /// Begins at a moment of the history, or at its nearest end; `None` = there is no history.
    pub fn begin(history: &History, now: Time, at: Time, speed: f64) -> Option<Playback> {
        let (from, to) = history.span()?;
        let at = at.clamp(from, to);
        let (board, told_until) = history.board_before(at)?;
        Some(Playback {
            board: board.board(),
            inflated: InflatedPart::default(),
            told_until,
            begun: (now, at),
            speed: speed.clamp(0.0, SPEED_MAX),
            is_behind: true,
        })
    }

    /// Goes to another moment.
    pub fn go_to(&mut self, history: &History, now: Time, at: Time, speed: f64) {
        let Some((from, to)) = history.span() else {
            return;
        };
        let at = at.clamp(from, to);
        (self.begun, self.speed) = ((now, at), speed.clamp(0.0, SPEED_MAX));
        self.is_behind = true;
        // What is kept is nearer, or it would have to go back.
        if let Some((board, until)) = history.board_before(at)
            && (at < self.told_until || until > self.told_until)
        {
            (self.board, self.told_until) = (board.board(), until);
        }
    }

    /// Returns which moment is to be shown.
    pub fn moment(&self, history: &History, now: Time) -> Time {
        let (began, at) = self.begun;
        let gone_s = now.since(began).as_secs_f64() * self.speed;
        let moment = at + Duration::try_from_secs_f64(gone_s).unwrap_or(Duration::MAX);
        history.span().map_or(moment, |(_, to)| moment.min(to))
    }

    /// Returns the speed, in seconds of the history a second; 0 = it stands.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Returns whether it has come to the newest that there is.
    pub fn is_at_end(&self, history: &History, now: Time) -> bool {
        let last = history.span().map(|(_, to)| to);
        last.is_none_or(|last| self.moment(history, now) >= last)
    }

    /// Goes a step on; returns whether the board is as it was at the moment that is to be shown. `is_over`: nothing more
    /// will be told at the last moment of the history.
    pub fn go_on(&mut self, history: &History, now: Time, is_over: bool) -> bool {
        let moment = self.moment(history, now);
        let last = history.span().map_or(Time::ZERO, |(_, to)| to);
        let after = moment + Duration::from_nanos(1);
        // More may come with the time of the newest.
        let until = if is_over { after } else { after.min(last) };
        if until > self.told_until {
            let from = self.told_until;
            let (board, inflated) = (&mut self.board, &mut self.inflated);
            self.told_until = history.tell_again(board, inflated, from, until, STEP_INPUTS);
        }
        self.is_behind = self.told_until < until;
        !self.is_behind
    }

    /// Returns the board.
    pub fn board(&self) -> &Board {
        &self.board
    }

    /// Returns the board, to be asked what has changed.
    pub fn board_mut(&mut self) -> &mut Board {
        &mut self.board
    }

    /// Returns when to go on; `None` = it stands where it shall, or at the end.
    pub fn deadline(&self, history: &History, now: Time) -> Option<Time> {
        if self.is_behind {
            return Some(now);
        }
        let moves = self.speed > 0.0 && !self.is_at_end(history, now);
        moves.then_some(now + LOOKS_EVERY)
    }
}

#[cfg(test)]
mod tests;
