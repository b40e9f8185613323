//! Brings the vehicle along its way: *look before you drive*, look around where something is unknown, and plan anew around
//! what blocks the way. It is a state machine; what a state needs to know beside the state has a part of its own:
//!
//! | part | |
//! | --- | --- |
//! | `way` | the corners ahead, with the stops |
//! | `purpose` | what the way is for: may it be replaced, may it cross the unknown |
//! | `stretch` | what of it is driven now, and with how much room |
//! | `standing_command` | what the vehicle was told last, and whether it obeys |
//! | `attempts` | what was tried in vain: looks, searches |
//! | `detour` | which path is searched when the way is blocked |
//!
//! ```text
//!   [Driving]  ─ at rest, and something unknown is next ─► [Looking]
//!   [Driving]  ─ at rest, and something is in the way, or looking has not helped ─► [Planning]
//!   [Driving]  ─ the same, right after a path was found ─► [Waiting]
//!   [Driving]  ─ every command is refused, the way back out of a dead end was driven, or home is but a wish ─► [Planning]
//!   [Looking]  ─ seen, or everything looked at ─► [Driving]
//!   [Planning] ─ path ready ─► [Driving]
//!   [Planning] ─ nothing found ─► [Waiting]
//!   [Waiting]  ─ after a while ─► [Driving], every second time [Looking]
//!   any state  ─ the way is given up, or its end is reached ─► [Driving], at rest
//!   any state  ─ the way home begins ─► [Planning]
//! ```
//!
//! Deliberately absent: what is known of the world (see `terrain`), plans, and how far peers are.

mod attempts;
mod detour;
mod purpose;
mod standing_command;
mod stretch;

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::StopId;

pub(super) use self::purpose::Unknown;

use self::attempts::Attempts;
use self::detour::{Detour, FoundPath};
use self::purpose::WayPurpose;
use self::standing_command::{BACKOFF_M, FreeWay, GO_M, SHORTEN_M, StandingCommand, renewal_m};
use self::stretch::Stretch;
use super::kind::RouteRoom;
use super::look_around::{LookAround, Next};
use super::obstruction::{Obstruction, ObstructionKind};
use super::terrain::{Strip, Terrain};
use super::way::Way;
use crate::geom::{Angle, Point, Pose};
use crate::node::vehicle::{CommandRefusal, MoveCommand};
use crate::node::{OwnState, VehicleSettings};
use crate::plan::{Corridor, Release, RequiredClearance};
use crate::time::{Deadline, Time};

/// How far ahead the strip is judged, metres.
pub(super) const AHEAD_M: f64 = 4.0;
/// At rest this near to the end, the end is reached, metres.
pub(super) const ARRIVED_M: f64 = 0.35;
/// After a search without a result, wait this long; longer after every further one.
const SEARCH_AGAIN: Duration = Duration::from_secs(3);
/// Standard deviation of a place up to which a track is driven again whatever the map shows, metres: two of it are what the
/// reflex leaves.
const TRACK_SD_M: f64 = 0.05;
/// The longest such wait, in shortest ones.
const LONGEST_WAIT: u32 = 4;

/// What the pilot met.
#[derive(Clone, PartialEq, Debug)]
pub enum WayEvent {
    /// A stop was passed or reached.
    Stop(StopId),
    /// The way is looked at, since something on it is unknown.
    Looks(Point),
    /// Something keeps it from going on; a path around it is searched.
    Blocked(Obstruction),
    /// A path was found; its length, metres.
    Path(f64),
    /// There is no path, at least not now; searches in vain in a row.
    NoPath(u32),
}

/// What the pilot is doing about its way.
#[derive(Clone, Debug, Serialize, Deserialize)]
enum State {
    /// It drives as far as is released, or rests without a way.
    Driving,
    /// It looks around on the spot.
    Looking(LookAround),
    /// A path search takes its time.
    Planning {
        ready: Time,
        found: Option<FoundPath>,
    },
    /// Nothing was found.
    Waiting { until: Time },
}

/// Drives along a way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Pilot {
    settings: VehicleSettings,
    state: State,
    way: Way,
    purpose: WayPurpose,
    stretch: Stretch,
    command: StandingCommand,
    /// What was commanded last and was not refused, as far as is known.
    commanded: Option<Commanded>,
    /// What was commanded before that: driven on if that is refused.
    before: Option<Commanded>,
    attempts: Attempts,
}

/// A route that was commanded.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Commanded {
    way: Way,
    stretch: Stretch,
}

impl Commanded {
    fn along(route: &[Point], stretch: Stretch) -> Option<Commanded> {
        let [from, corners @ .., end] = route else {
            return None;
        };
        let mut way = Way::default();
        way.clear(*from);
        way.append(corners.iter().copied(), *end, None);
        Some(Commanded { way, stretch })
    }
}

/// What the pilot sees in one step, and what it meets.
struct Situation<'a> {
    now: Time,
    pose: Pose,
    is_resting: bool,
    terrain: &'a Terrain,
    met: &'a mut Vec<WayEvent>,
}

impl Pilot {
    /// Makes a pilot that has nowhere to go.
    pub(super) fn new(settings: VehicleSettings) -> Pilot {
        Pilot {
            settings,
            state: State::Driving,
            way: Way::default(),
            purpose: WayPurpose::Plan,
            stretch: Stretch::Ordinary,
            command: StandingCommand::default(),
            commanded: None,
            before: None,
            attempts: Attempts::default(),
        }
    }

    /// Returns the way ahead.
    pub(super) fn way(&self) -> &Way {
        &self.way
    }

    /// Returns how many searches in a row have found nothing on the way that can be reached.
    pub(super) fn failures(&self) -> u32 {
        self.attempts.failures()
    }

    /// Returns whether the vehicle refuses whatever path is found.
    pub(super) fn is_refused(&self) -> bool {
        self.command.is_every_path_refused()
    }

    /// Returns whether it drives a route as it is: what blocks that is for its giver to decide about.
    pub(super) fn drives_route(&self) -> bool {
        !self.purpose.is_replaceable()
    }

    /// Returns when to be asked again without any input.
    pub(super) fn deadline(&self) -> Option<Deadline> {
        let (at, why) = match &self.state {
            State::Driving | State::Looking(_) => return None,
            State::Planning { ready, .. } => (*ready, "path ready"),
            State::Waiting { until } => (*until, "search again"),
        };
        Some(Deadline { at, why })
    }

    /// Adds a leg at the end of the way.
    pub(super) fn append(
        &mut self,
        route: impl IntoIterator<Item = Point>,
        to: Point,
        stop: Option<StopId>,
    ) {
        self.way.append(route, to, stop);
    }

    /// Takes a route, corners after where the vehicle is, that is driven as it is: what blocks it is said, and the
    /// giver of the route decides. What is unknown on it is looked at as on every way.
    pub(super) fn take_route(&mut self, place: Point, corners: &[Point], room: RouteRoom) {
        let Some((end, corners)) = corners.split_last() else {
            return;
        };
        self.give_up(place);
        self.way.append(corners.iter().copied(), *end, None);
        self.purpose = WayPurpose::Route;
        self.stretch = match room {
            RouteRoom::Kept => Stretch::Ordinary,
            RouteRoom::DrivenBefore => Stretch::DrivenBefore,
            RouteRoom::OwnTrack => Stretch::OwnTrack {
                end_m: self.way.odometer_m(self.way.length_m()),
            },
        };
        self.attempts.begin_way();
    }

    /// Begins the way home from where the vehicle is.
    pub(super) fn go_home(&mut self, now: Time, pose: Pose, terrain: &Terrain, unknown: Unknown) {
        self.give_up(pose.at);
        self.way.append([], self.settings.home, None);
        self.purpose = WayPurpose::home(unknown);
        self.attempts.begin_way();
        self.search(now, pose, terrain);
    }

    /// Gives up the way, and whatever was being done about it.
    pub(super) fn give_up(&mut self, place: Point) {
        self.state = State::Driving;
        self.way.clear(place);
        (self.purpose, self.stretch) = (WayPurpose::Plan, Stretch::Ordinary);
        self.command.give_up_way();
        self.attempts.give_up_way();
    }

    /// Leaves out the way to the next stop, which cannot be reached; returns the stops at it.
    pub(super) fn skip(&mut self, place: Point) -> Vec<StopId> {
        self.command.forget_end();
        self.stretch.end_retreat();
        self.way.skip(place)
    }

    /// Forgets the standing command: the vehicle was stopped.
    pub(super) fn halted(&mut self, now: Time) {
        self.command.stop(now);
    }

    /// Forgets the standing command, which was refused: what the vehicle drives still is the one before it.
    pub(super) fn refused(&mut self, now: Time, why: CommandRefusal) {
        let gives_way =
            matches!(why, CommandRefusal::Separation(peer) if peer < self.settings.vehicle);
        // A refusal comes at once; later the vehicle gives up what it had accepted.
        if !self.command.is_settled(now) {
            self.commanded = self.before.take();
        }
        self.command.refuse(now, why, gives_way);
    }

    /// Goes on with what the vehicle says of itself; returns a command, if one is due.
    pub(super) fn advance(
        &mut self,
        now: Time,
        state: &OwnState,
        terrain: &Terrain,
        met: &mut Vec<WayEvent>,
    ) -> Option<MoveCommand> {
        self.command.watch(state.mode);
        let mut situation = Situation {
            now,
            pose: state.pose,
            is_resting: !state.mode.moves(),
            terrain,
            met,
        };
        self.pass(&mut situation);
        if self.way.is_empty() {
            self.command.forget_end();
            self.state = State::Driving;
            return self.watch_old_way(&situation);
        }
        match &self.state {
            State::Driving => self.drive(&mut situation),
            State::Looking(_) => self.look(&mut situation),
            State::Planning { ready, .. } if now < *ready => self.watch_old_way(&situation),
            State::Planning { .. } => self.take_path(&mut situation),
            State::Waiting { until } if now < *until => self.watch_old_way(&situation),
            State::Waiting { .. } => self.try_again(&mut situation),
        }
    }

    /// Stops a vehicle that still drives by its last command although its way has changed, when what that leads over is
    /// free no more.
    fn watch_old_way(&mut self, situation: &Situation<'_>) -> Option<MoveCommand> {
        let old = self.commanded.as_ref()?;
        if !self.command.is_outdated() {
            return None;
        }
        let release = self.judged(situation, &old.way, old.way.points(), old.stretch);
        if release.free_until_m + SHORTEN_M >= old.way.length_m() {
            return None;
        }
        self.command.stop(situation.now);
        Some(MoveCommand::Hold)
    }

    /// Passes corners and stops, and ends the way at its end.
    fn pass(&mut self, situation: &mut Situation<'_>) {
        let place = situation.pose.at;
        let mut passed = self.way.pass(place);
        let is_there = situation.is_resting && self.way.end().distance_to(place) <= ARRIVED_M;
        if is_there && self.command.is_settled(situation.now) {
            passed.extend(self.way.arrive());
        }
        if !passed.is_empty() {
            self.attempts.pass_stop();
        }
        situation.met.extend(passed.into_iter().map(WayEvent::Stop));
    }

    fn release(&self, situation: &Situation<'_>) -> Release {
        let route = self.stretch.route(&self.way);
        self.judged(situation, &self.way, route, self.stretch)
    }

    /// Returns how much of a way, or of its first part, is released.
    fn judged(
        &self,
        situation: &Situation<'_>,
        way: &Way,
        route: Vec<Point>,
        stretch: Stretch,
    ) -> Release {
        let released = situation.terrain.released(situation.pose);
        let driven_before = RequiredClearance::driven_before(
            self.settings.reach_m(),
            2.0 * situation.pose.sd_m,
            self.settings.lattice.cell_m(),
        );
        // Who is not where it was when it believes to be there has room on its track only where the map shows some.
        let own_track = match situation.pose.sd_m <= TRACK_SD_M {
            true => RequiredClearance::everywhere(0.0),
            false => RequiredClearance::driven_before(
                self.settings.reach_m(),
                0.0,
                self.settings.lattice.cell_m(),
            ),
        };
        let strip = Strip {
            way,
            route,
            corridor: Corridor {
                clearance: stretch.clearance(released, driven_before, own_track),
                ahead_m: AHEAD_M,
            },
        };
        situation
            .terrain
            .release(situation.now, situation.pose, &strip)
    }

    fn drive(&mut self, situation: &mut Situation<'_>) -> Option<MoveCommand> {
        let release = self.release(situation);
        let free = FreeWay::of(&release, self.way.length_m());
        let end_m = self.command.end_m().filter(|_| !situation.is_resting);
        if let Some(end_m) = end_m {
            let left_m = self.way.along_m(end_m) - free.here_m;
            return renewal_m(left_m, &free)
                .map(|until_m| self.command_to(situation, free.here_m, until_m));
        }
        if !self.command.is_settled(situation.now) {
            return self.watch_old_way(situation);
        }
        if let Some(kind) = self.gives_up_path(free.here_m) {
            self.command.give_up_path();
            let at = situation.pose.at;
            self.search_around(situation, Obstruction { at, kind });
            return None;
        }
        if free.is_worth_a_start() {
            self.attempts.drive();
            return Some(self.command_to(situation, free.here_m, free.until_m));
        }
        if situation.is_resting {
            self.overcome(situation, &release)
        } else {
            self.watch_old_way(situation)
        }
    }

    /// Returns why another path is searched from where the vehicle is, `here_m` along the way, whatever is released; `None` =
    /// the way is gone on with.
    fn gives_up_path(&self, here_m: f64) -> Option<ObstructionKind> {
        let refusal = self.command.path_refusal().map(ObstructionKind::Refusal);
        let has_retreated = self.stretch.has_retreated(&self.way, here_m);
        refusal
            .or(has_retreated.then_some(ObstructionKind::DeadEnd))
            .or(self
                .purpose
                .needs_path()
                .then_some(ObstructionKind::NoPathHome))
    }

    /// Commands the route to a length along the way.
    fn command_to(&mut self, situation: &Situation<'_>, here_m: f64, until_m: f64) -> MoveCommand {
        let route = self.way.until(situation.pose.at, here_m, until_m);
        if route.len() < 2 {
            self.command.stop(situation.now);
            return MoveCommand::Hold;
        }
        self.command
            .drive(situation.now, self.way.odometer_m(until_m));
        let commanded = Commanded::along(&route, self.stretch);
        self.before = std::mem::replace(&mut self.commanded, commanded);
        let is_off_plan = self.way.is_off_plan();
        MoveCommand::Drive { is_off_plan, route }
    }

    /// At rest, and nothing is released: looks at what is unknown, or plans around what is in the way.
    fn overcome(
        &mut self,
        situation: &mut Situation<'_>,
        release: &Release,
    ) -> Option<MoveCommand> {
        let unknown = unknown_first(release);
        if let Some(unknown) = unknown
            && self.attempts.look_once_more()
        {
            let toward = situation.pose.at.angle_to(unknown);
            return Some(self.look_around(situation, toward, unknown));
        }
        let obstruction = obstruction_of(situation, release.blocked, unknown);
        let is_path_blocked = self.attempts.is_blocked_at_once();
        if is_path_blocked && self.purpose.is_replaceable() {
            situation.met.push(WayEvent::Blocked(obstruction));
            self.fail(situation);
        } else {
            self.search_around(situation, obstruction);
        }
        None
    }

    /// Says that something is in the way, and searches a path around it if that is the pilot's to do.
    fn search_around(&mut self, situation: &mut Situation<'_>, by: Obstruction) {
        situation.met.push(WayEvent::Blocked(by));
        if self.purpose.is_replaceable() {
            self.search(situation.now, situation.pose, situation.terrain);
        }
    }

    /// Searches a path; the result may be used later.
    fn search(&mut self, now: Time, pose: Pose, terrain: &Terrain) {
        let looked = self.attempts.has_looked_in_vain();
        let detour = Detour {
            search: terrain.search(now, pose),
            way: &self.way,
            unknown_tries: self.purpose.unknown().tries(looked),
            peers: terrain.standing_peers(),
            passed: terrain.passed_lately().collect(),
            failures: self.attempts.failures(),
            are_paths_barred: self.attempts.are_paths_barred(),
        };
        self.state = State::Planning {
            ready: now + self.settings.path_time,
            found: detour.find(),
        };
        self.stretch = Stretch::Ordinary;
    }

    /// Begins to look around, first in a direction.
    fn look_around(
        &mut self,
        situation: &mut Situation<'_>,
        toward: Angle,
        at: Point,
    ) -> MoveCommand {
        situation.met.push(WayEvent::Looks(at));
        let look = LookAround::toward(toward, situation.now);
        self.state = State::Looking(look);
        self.command.turn(situation.now);
        MoveCommand::Turn(look.heading())
    }

    fn look(&mut self, situation: &mut Situation<'_>) -> Option<MoveCommand> {
        let is_seen = self.release(situation).ahead_m() >= GO_M + BACKOFF_M;
        if situation.is_resting && is_seen && !self.purpose.needs_path() {
            self.state = State::Driving;
            return self.drive(situation);
        }
        let State::Looking(look) = &mut self.state else {
            return None;
        };
        let dwell = self.settings.look.cycle() * 3;
        match look.next(
            situation.now,
            situation.pose.heading,
            situation.is_resting,
            dwell,
        ) {
            Next::Turn(heading) => {
                self.command.turn(situation.now);
                Some(MoveCommand::Turn(heading))
            }
            Next::Stay => None,
            Next::Over => {
                // Without a path nothing says that what was looked at lies on the way.
                self.attempts.end_look(!self.purpose.needs_path());
                self.state = State::Driving;
                None
            }
        }
    }

    /// The search is over: drives along the path from the next step on, if there is one.
    fn take_path(&mut self, situation: &mut Situation<'_>) -> Option<MoveCommand> {
        let State::Planning { found, .. } = &mut self.state else {
            return None;
        };
        let Some(path) = found.take() else {
            self.fail(situation);
            return None;
        };
        let length_m = path.length_m();
        situation.met.push(WayEvent::Path(length_m));
        self.attempts.find_path(path.leads_on());
        self.purpose.path_found();
        self.way
            .replace(situation.pose.at, path.replaces, &path.points[1..]);
        self.stretch = Stretch::of_path(path.found_by, length_m, &self.way);
        self.command.forget_end();
        self.state = State::Driving;
        None
    }

    /// Nothing was found, or what was found is blocked at once: waits, each time longer.
    fn fail(&mut self, situation: &mut Situation<'_>) {
        let failures = self.attempts.fail();
        self.purpose.path_failed();
        situation.met.push(WayEvent::NoPath(failures));
        let wait = SEARCH_AGAIN * failures.min(LONGEST_WAIT);
        self.state = State::Waiting {
            until: situation.now + wait,
        };
    }

    /// The wait is over. What was taken for an obstacle is looked at again, in every second try.
    fn try_again(&mut self, situation: &mut Situation<'_>) -> Option<MoveCommand> {
        if self.attempts.failures() % 2 == 1 && situation.is_resting {
            let toward = situation.pose.at.angle_to(self.way.end());
            return Some(self.look_around(situation, toward, situation.pose.at));
        }
        self.state = State::Driving;
        None
    }
}

/// Returns what is unknown on the way, if that comes before what blocks it.
fn unknown_first(release: &Release) -> Option<Point> {
    let blocked_m = release.blocked_at_m.unwrap_or(f64::INFINITY);
    release
        .unknown
        .filter(|_| release.unknown_at_m.is_some_and(|at_m| at_m <= blocked_m))
}

/// Returns what keeps a vehicle at rest that may not drive on: what blocks its way, otherwise what is unknown on it.
fn obstruction_of(
    situation: &Situation<'_>,
    blocked: Option<Point>,
    unknown: Option<Point>,
) -> Obstruction {
    let (at, kind) = match (blocked, unknown) {
        (Some(at), _) => (at, situation.terrain.kind_of_obstacle(situation.now, at)),
        (None, Some(at)) => (at, ObstructionKind::UnseenGround),
        (None, None) => (situation.pose.at, ObstructionKind::BesideItsWay),
    };
    Obstruction { at, kind }
}

#[cfg(test)]
mod tests;
