//! Whether the autopilot is heard, and who steers: this software, a person by remote control, or the autopilot by itself.
//! It commands nothing.
//!
//! ```text
//!   [NeverHeard] ──report──► [Heard] ──2 s without──► [Silent] ──report──► [Heard]
//!
//!   [Ours] ──a mode that nobody here has asked for──► [Remote]
//!      ▲ └── the same, while a failsafe is in force, the autopilot starts up, or after a silence ──► [Own]
//!      └──── TakeBack, by an operator's start that names it ──── [Remote], [Own]
//! ```
//!
//! One that is first heard in a mode in which it does not just stand was taken over before.
//! A heartbeat tells the mode a second late, and one may be lost: a mode of before that shows within 3 s of a change of our
//! own is no take-over. When it still shows after that, somebody has changed it back. In the same way a mode that was left
//! and is told again may show from before: for 3 s that is no sign that it was taken.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::command::FlightMode;
use super::report::SystemStatus;
use crate::time::{Deadline, Time};

/// Without a report for this long the autopilot is silent.
pub(super) const SILENT_AFTER: Duration = Duration::from_secs(2);
/// A mode of before may show for this long after a change of our own.
pub(super) const OLD_MODE_SHOWS: Duration = Duration::from_secs(3);

/// Whether the autopilot is heard.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum LinkHealth {
    /// It has not been heard yet.
    #[default]
    NeverHeard,
    /// It is.
    Heard {
        /// When the last report came.
        at: Time,
    },
    /// It was, and is not any more.
    Silent,
}

impl LinkHealth {
    /// Returns when it will be silent; `None` when it is, or was never heard.
    pub(super) fn deadline(self) -> Option<Deadline> {
        match self {
            LinkHealth::NeverHeard | LinkHealth::Silent => None,
            LinkHealth::Heard { at } => Some(Deadline {
                at: at + SILENT_AFTER,
                why: "autopilot silent",
            }),
        }
    }

    /// Takes note that it is silent, if it has become so by now.
    pub(super) fn look(&mut self, now: Time) {
        if self.deadline().is_some_and(|due| due.at <= now) {
            *self = LinkHealth::Silent;
        }
    }

    /// Returns whether it is heard.
    pub(super) fn is_heard(self) -> bool {
        match self {
            LinkHealth::Heard { at: _ } => true,
            LinkHealth::NeverHeard | LinkHealth::Silent => false,
        }
    }
}

/// Who steers.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) enum Steering {
    /// This software, as far as it has said anything.
    Ours(OwnModes),
    /// A person, until it is taken back.
    Remote,
    /// The autopilot by itself, until it is taken back.
    Own,
}

/// Which modes are explained by what was said here.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct OwnModes {
    /// The mode that it is in, or was told to take; `None` before it was heard.
    expected: Option<FlightMode>,
    /// When it was told last to change its mode.
    changed: Option<Time>,
    /// What became of that.
    change: ChangeOfMode,
    /// The modes that it was in before, or told to take, since modes change.
    before: Vec<FlightMode>,
}

/// What became of the last change of mode.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
enum ChangeOfMode {
    /// It was accepted, or has shown, or there was none.
    #[default]
    Accepted,
    /// It may take place.
    Told,
    /// It was refused or not answered; it may have taken place all the same.
    GivenUp,
}

impl Default for Steering {
    fn default() -> Steering {
        Steering::Ours(OwnModes::default())
    }
}

impl Steering {
    /// Takes what a report tells; `was_silent` when there was none for a while before it, `is_over` when the stored mission may
    /// be done, after which it stands in another mode. Returns whether somebody else has taken over just now.
    pub(super) fn take(
        &mut self,
        now: Time,
        (mode, status): (FlightMode, SystemStatus),
        was_silent: bool,
        is_over: bool,
    ) -> bool {
        let Steering::Ours(modes) = self else {
            return false;
        };
        if is_over {
            modes.take_end_of_auto(now, mode);
        }
        if modes.explain(now, mode) {
            return false;
        }
        *self = match status {
            SystemStatus::Critical | SystemStatus::Booting => Steering::Own,
            SystemStatus::Standby | SystemStatus::Active if was_silent => Steering::Own,
            SystemStatus::Standby | SystemStatus::Active => Steering::Remote,
        };
        true
    }

    /// Gives it back to this software, from the mode that shows: an operator's start has named the take-over.
    pub(super) fn take_back(&mut self, shown: Option<FlightMode>) {
        match self {
            Steering::Ours(_) => {}
            Steering::Remote | Steering::Own => {
                *self = Steering::Ours(OwnModes {
                    expected: shown,
                    ..OwnModes::default()
                });
            }
        }
    }

    /// Takes note that the autopilot is told now to change its mode.
    pub(super) fn change(&mut self, now: Time, to: FlightMode) {
        match self {
            Steering::Ours(modes) => modes.change(now, to),
            Steering::Remote | Steering::Own => {}
        }
    }

    /// Takes note that the autopilot has accepted the change.
    pub(super) fn change_accepted(&mut self) {
        match self {
            Steering::Ours(modes) => modes.change = ChangeOfMode::Accepted,
            Steering::Remote | Steering::Own => {}
        }
    }

    /// Takes note that the change was given up: the mode is the one that shows.
    pub(super) fn change_given_up(&mut self, shown: Option<FlightMode>) {
        match self {
            Steering::Ours(modes) => {
                modes.remember_expected();
                (modes.expected, modes.change) = (shown, ChangeOfMode::GivenUp);
            }
            Steering::Remote | Steering::Own => {}
        }
    }

    /// Returns the mode that the autopilot is in, as far as this software is concerned: the one that it was told last, or
    /// the one that shows. `None` while somebody else steers, or before it was heard.
    pub(super) fn own_mode(&self) -> Option<FlightMode> {
        match self {
            Steering::Ours(modes) => modes.expected,
            Steering::Remote | Steering::Own => None,
        }
    }

    /// Returns whether nobody else steers.
    pub(super) fn is_ours(&self) -> bool {
        match self {
            Steering::Ours(_) => true,
            Steering::Remote | Steering::Own => false,
        }
    }
}

/// Returns whether a vehicle that is in this mode when it is heard first waits for its companion. In any other one
/// somebody else has begun something.
fn stands(mode: FlightMode) -> bool {
    match mode {
        FlightMode::Hold | FlightMode::Guided | FlightMode::Land => true,
        FlightMode::Manual | FlightMode::Loiter | FlightMode::Auto | FlightMode::Return => false,
    }
}

impl OwnModes {
    /// Returns whether a mode that shows is explained by what was said here.
    fn explain(&mut self, now: Time, shown: FlightMode) -> bool {
        let Some(expected) = self.expected else {
            self.expected = Some(shown);
            return stands(shown);
        };
        let is_recent = self
            .changed
            .is_some_and(|at| now.since(at) <= OLD_MODE_SHOWS);
        let may_be_old = is_recent && self.before.contains(&shown);
        if shown == expected {
            if self.change == ChangeOfMode::Told && !may_be_old {
                self.change = ChangeOfMode::Accepted;
            }
            return true;
        }
        if !self.before.contains(&shown) {
            return false;
        }
        match self.change {
            ChangeOfMode::Accepted => is_recent,
            // What was neither accepted nor ever showed has not taken place.
            ChangeOfMode::Told => {
                if !is_recent {
                    self.expected = Some(shown);
                }
                true
            }
            // It may have taken place, or not: what shows is believed.
            ChangeOfMode::GivenUp => {
                self.remember_expected();
                self.expected = Some(shown);
                is_recent
            }
        }
    }

    /// Takes HOLD, into which a rover goes by itself when its mission is over. One of before may be older.
    fn take_end_of_auto(&mut self, now: Time, shown: FlightMode) {
        let is_recent = self
            .changed
            .is_some_and(|at| now.since(at) <= OLD_MODE_SHOWS);
        let may_be_old = is_recent && self.before.contains(&shown);
        if may_be_old || shown != FlightMode::Hold {
            return;
        }
        if self.expected == Some(FlightMode::Auto) && self.change != ChangeOfMode::Told {
            self.remember_expected();
            (self.expected, self.change) = (Some(shown), ChangeOfMode::Accepted);
        } else if self.before.contains(&FlightMode::Auto) && !self.before.contains(&shown) {
            self.before.push(shown);
        }
    }

    fn change(&mut self, now: Time, to: FlightMode) {
        let is_long_ago = self.changed.is_none_or(|at| now.since(at) > OLD_MODE_SHOWS);
        self.changed = Some(now);
        if self.expected == Some(to) {
            return;
        }
        // What never showed may not have taken place.
        if is_long_ago && self.change != ChangeOfMode::Told {
            self.before.clear();
        }
        self.remember_expected();
        (self.expected, self.change) = (Some(to), ChangeOfMode::Told);
    }

    fn remember_expected(&mut self) {
        let known = self.expected.filter(|mode| !self.before.contains(mode));
        self.before.extend(known);
    }
}
