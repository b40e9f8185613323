//! The command that the vehicle was given last: where it ends, whether it has had time to take effect, whether another one
//! is due while the vehicle moves, and how often commands were refused.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleMode;

use crate::node::vehicle::CommandRefusal;
use crate::plan::Release;
use crate::time::Time;

/// A command must lead at least this far, unless it ends the way, metres.
pub(super) const GO_M: f64 = 0.3;
/// Between what is released and where the command ends, metres.
pub(super) const BACKOFF_M: f64 = 0.02;
/// A command is renewed when less than this is left of it and more is released, metres.
const RENEW_M: f64 = 1.0;
/// A command that ends before the way is renewed when the whole way is released and leads this much further, metres.
const END_M: f64 = 0.05;
/// A command that leads this much further than is released is shortened, metres.
pub(super) const SHORTEN_M: f64 = 0.05;
/// After a command that had no effect, wait this long.
const RETRY_AFTER: Duration = Duration::from_millis(600);
/// After so many refusals in a row, peers that stand are planned around.
const REFUSALS_MAX: u32 = 4;
/// So many paths in a row of which every command is refused, and the vehicle does not get on by itself.
const REFUSED_PATHS_MAX: u32 = 3;

/// The standing command.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct StandingCommand {
    /// Odometer at its end, metres; `None` = it is no command to drive, or stands no more.
    end_m: Option<f64>,
    given_at: Time,
    /// The way has changed since it was given.
    is_outdated: bool,
    /// The vehicle drives.
    is_driving: bool,
    /// Commands refused in a row.
    refusals: u32,
    /// Why the last of them was.
    last_refusal: Option<CommandRefusal>,
    /// Paths in a row of which nothing was driven, since all commands were refused.
    refused_paths: u32,
}

/// How far the way may be driven.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct FreeWay {
    /// Where on the way the vehicle is, metres along it.
    pub here_m: f64,
    /// Up to where a command may lead, metres along the way.
    pub until_m: f64,
    /// That is the end of the way.
    pub is_end: bool,
}

impl FreeWay {
    /// Returns how far a way of this length may be driven when so much of it is released.
    pub(super) fn of(release: &Release, length_m: f64) -> FreeWay {
        let is_end = release.free_until_m >= length_m - 1e-6;
        let until_m = if is_end {
            length_m
        } else {
            release.free_until_m - BACKOFF_M
        };
        FreeWay {
            here_m: release.here_m,
            until_m,
            is_end,
        }
    }

    /// Returns whether a vehicle at rest sets out for so little.
    pub(super) fn is_worth_a_start(&self) -> bool {
        let goes_m = self.until_m - self.here_m;
        goes_m >= GO_M || (self.is_end && goes_m > 0.0)
    }
}

impl StandingCommand {
    /// Records that a command to drive was given; the odometer will be `end_m` at its end, metres.
    pub(super) fn drive(&mut self, now: Time, end_m: f64) {
        (self.end_m, self.given_at) = (Some(end_m), now);
        self.is_outdated = false;
    }

    /// Records that a command to turn was given. (It is given at rest: the end of the last drive is of no use any more, and is
    /// not forgotten.)
    pub(super) fn turn(&mut self, now: Time) {
        self.given_at = now;
        self.is_outdated = false;
    }

    /// Records that the vehicle was stopped. Who waits for another one goes on waiting.
    pub(super) fn stop(&mut self, now: Time) {
        (self.end_m, self.given_at) = (None, self.given_at.max(now));
        self.is_outdated = false;
    }

    /// Records that the command was refused, or given up by the vehicle: one that drives goes on by the command before it, or
    /// brakes. Of two that brake for each other the one that `gives_way` waits until it has heard whether the other goes on.
    pub(super) fn refuse(&mut self, now: Time, why: CommandRefusal, gives_way: bool) {
        self.refusals += 1;
        self.last_refusal = Some(why);
        self.stop(now);
        self.is_outdated = self.is_driving;
        if self.is_driving && gives_way {
            self.given_at = now + RETRY_AFTER;
        }
    }

    /// Forgets where the command ends: the way has changed.
    pub(super) fn forget_end(&mut self) {
        self.is_outdated |= self.end_m.is_some();
        self.end_m = None;
    }

    /// Forgets command and refusals: the way is given up.
    pub(super) fn give_up_way(&mut self) {
        *self = StandingCommand {
            given_at: self.given_at,
            is_outdated: self.is_outdated || self.end_m.is_some(),
            is_driving: self.is_driving,
            ..StandingCommand::default()
        };
    }

    /// Takes what the vehicle does: one that moves refuses nothing, and one that rests has nothing left to drive.
    pub(super) fn watch(&mut self, mode: VehicleMode) {
        if mode.moves() {
            self.refusals = 0;
        } else {
            self.is_outdated = false;
        }
        self.is_driving = mode == VehicleMode::Driving;
        if mode == VehicleMode::Driving {
            self.refused_paths = 0;
        }
    }

    /// Records that the path is given up; one of which all commands were refused counts as refused.
    pub(super) fn give_up_path(&mut self) {
        self.refused_paths += u32::from(self.is_path_refused());
        self.refusals = 0;
    }

    /// Returns the odometer at the end of the command, metres.
    pub(super) fn end_m(&self) -> Option<f64> {
        self.end_m
    }

    /// Returns whether the vehicle still drives by it although the way has changed since.
    pub(super) fn is_outdated(&self) -> bool {
        self.is_outdated && self.is_driving
    }

    /// Returns whether the command has had time to show in the state.
    pub(super) fn is_settled(&self, now: Time) -> bool {
        now.since(self.given_at) >= RETRY_AFTER
    }

    /// Returns why the last command was refused when so many in a row were that another path is to be searched.
    pub(super) fn path_refusal(&self) -> Option<CommandRefusal> {
        self.last_refusal.filter(|_| self.is_path_refused())
    }

    /// Returns whether the vehicle refuses whatever path is found.
    pub(super) fn is_every_path_refused(&self) -> bool {
        self.refused_paths >= REFUSED_PATHS_MAX
    }

    fn is_path_refused(&self) -> bool {
        self.refusals >= REFUSALS_MAX
    }
}

/// Returns up to where a vehicle that moves is commanded anew, metres along the way, when its command leads `left_m`
/// further; `None` = that one stands.
pub(super) fn renewal_m(left_m: f64, free: &FreeWay) -> Option<f64> {
    let goes_m = free.until_m - free.here_m;
    if left_m > goes_m + SHORTEN_M {
        return Some(free.until_m.max(free.here_m));
    }
    let gain_m = if free.is_end { END_M } else { GO_M };
    (left_m < RENEW_M && goes_m > left_m + gain_m).then_some(free.until_m)
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::VehicleId;

    use super::*;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    /// A way that may be driven from 1 m along it.
    fn free(until_m: f64, is_end: bool) -> FreeWay {
        FreeWay {
            here_m: 1.0,
            until_m,
            is_end,
        }
    }

    #[test]
    fn a_command_that_leads_too_far_is_shortened_and_one_that_nearly_ends_is_renewed() {
        assert_eq!(renewal_m(2.0, &free(2.5, false)), Some(2.5), "too far");
        assert_eq!(renewal_m(2.0, &free(0.8, false)), Some(1.0), "never back");
        assert_eq!(renewal_m(2.0, &free(2.97, false)), None, "nearly the same");
        assert_eq!(renewal_m(0.9, &free(2.5, false)), Some(2.5), "nearly ends");
        assert_eq!(renewal_m(0.9, &free(2.1, false)), None, "not worth it");
        assert_eq!(renewal_m(0.9, &free(2.1, true)), Some(2.1), "it is the end");
        assert_eq!(renewal_m(1.1, &free(9.0, false)), None, "enough is left");
    }

    #[test]
    fn a_command_ends_a_little_before_what_is_not_free_and_at_the_end_of_the_way() {
        let release = Release {
            free_until_m: 3.0,
            here_m: 1.0,
            blocked: None,
            blocked_at_m: None,
            unknown: None,
            unknown_at_m: None,
        };
        assert_eq!(FreeWay::of(&release, 8.0), free(3.0 - BACKOFF_M, false));
        assert_eq!(FreeWay::of(&release, 3.0), free(3.0, true));
        assert!(free(1.3, false).is_worth_a_start() && !free(1.2, false).is_worth_a_start());
        assert!(free(1.01, true).is_worth_a_start() && !free(1.0, true).is_worth_a_start());
    }

    #[test]
    fn a_command_needs_a_moment_to_take_effect() {
        let mut command = StandingCommand::default();
        for give in [
            |command: &mut StandingCommand| command.drive(at(5.0), 3.0),
            |command: &mut StandingCommand| command.turn(at(5.0)),
            |command: &mut StandingCommand| command.stop(at(5.0)),
        ] {
            command.stop(at(1.0));
            give(&mut command);
            assert!(!command.is_settled(at(5.5)) && command.is_settled(at(5.6)));
        }
    }

    #[test]
    fn only_a_drive_leads_somewhere_and_a_turn_does_not_end_it() {
        let mut command = StandingCommand::default();
        command.drive(at(1.0), 3.0);
        command.turn(at(2.0));
        assert_eq!(command.end_m(), Some(3.0));
        command.refuse(at(3.0), CommandRefusal::Fence, false);
        assert_eq!(command.end_m(), None);
    }

    #[test]
    fn of_two_that_brake_for_each_other_one_waits_longer() {
        let separation = CommandRefusal::Separation(VehicleId(1));
        for (mode, gives_way, expected_s) in [
            (VehicleMode::Driving, true, 1.2),
            (VehicleMode::Driving, false, 0.6),
            (VehicleMode::Idle, true, 0.6),
        ] {
            let mut command = StandingCommand::default();
            command.drive(at(1.0), 3.0);
            command.watch(mode);
            command.refuse(at(5.0), separation, gives_way);
            let is_settled = |time_s: f64| command.is_settled(at(time_s));
            assert!(!is_settled(4.99 + expected_s), "{mode:?}, {gives_way}");
            let mut held = command;
            held.stop(at(5.1));
            let later_s = f64::max(expected_s, 0.7);
            assert!(!held.is_settled(at(4.99 + later_s)), "it is held as well");
            assert!(is_settled(5.01 + expected_s), "{mode:?}, {gives_way}");
        }
    }

    #[test]
    fn a_command_is_outdated_while_it_is_driven_after_the_way_has_changed() {
        let outdated = |change: fn(&mut StandingCommand)| {
            let mut command = StandingCommand::default();
            command.drive(at(1.0), 3.0);
            command.watch(VehicleMode::Driving);
            assert!(!command.is_outdated());
            change(&mut command);
            command
        };
        for change in [
            StandingCommand::forget_end as fn(&mut StandingCommand),
            StandingCommand::give_up_way,
            |command| command.refuse(at(2.0), CommandRefusal::Fence, false),
        ] {
            assert!(outdated(change).is_outdated());
            for end in [
                |command: &mut StandingCommand| command.drive(at(2.2), 3.0),
                |command: &mut StandingCommand| command.turn(at(2.2)),
                |command: &mut StandingCommand| command.stop(at(2.2)),
                |command: &mut StandingCommand| command.watch(VehicleMode::Idle),
            ] {
                let mut command = outdated(change);
                end(&mut command);
                command.watch(VehicleMode::Driving);
                assert!(!command.is_outdated());
            }
        }
        let stopped = outdated(|command| {
            command.stop(at(1.5));
            command.forget_end();
        });
        assert!(!stopped.is_outdated(), "there is none to be outdated");
    }

    fn refuse(command: &mut StandingCommand, times: u32) {
        (0..times).for_each(|_| command.refuse(at(1.0), CommandRefusal::Fence, false));
    }

    #[test]
    fn a_path_is_refused_after_some_commands_and_the_vehicle_after_some_paths() {
        let mut command = StandingCommand::default();
        for path in 0..REFUSED_PATHS_MAX {
            assert!(!command.is_every_path_refused(), "{path} paths");
            refuse(&mut command, REFUSALS_MAX - 1);
            assert!(!command.is_path_refused());
            refuse(&mut command, 1);
            assert!(command.is_path_refused());
            command.give_up_path();
        }
        assert!(command.is_every_path_refused() && !command.is_path_refused());
        command.give_up_way();
        assert!(!command.is_every_path_refused());
    }

    #[test]
    fn a_turn_ends_the_refusals_and_a_drive_those_of_the_paths_as_well() {
        let refused = || {
            let mut command = StandingCommand::default();
            for _ in 0..REFUSED_PATHS_MAX {
                refuse(&mut command, REFUSALS_MAX);
                command.give_up_path();
            }
            refuse(&mut command, REFUSALS_MAX);
            command
        };
        for (mode, expected) in [
            (VehicleMode::Idle, (true, true)),
            (VehicleMode::Turning, (false, true)),
            (VehicleMode::Driving, (false, false)),
        ] {
            let mut command = refused();
            command.watch(mode);
            let shown = (command.is_path_refused(), command.is_every_path_refused());
            assert_eq!(shown, expected, "{mode:?}");
        }
    }

    #[test]
    fn a_path_given_up_for_another_reason_is_not_refused() {
        let mut command = StandingCommand::default();
        for _ in 0..9 {
            refuse(&mut command, REFUSALS_MAX - 1);
            command.give_up_path();
        }
        assert!(!command.is_every_path_refused());
    }
}
