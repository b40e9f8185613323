//! Brings the vehicle along its way: *look before you drive*, look around where something is unknown, and
//! plan anew around what blocks the way. It knows the map and the vehicle, but no plan and no peer's progress.
//!
//! ```text
//!   Driving ─release ends at unknown, at rest─► Looking ─seen─► Driving
//!      │  ▲                                        └─everything looked at─► Planning (unknown counts as barred)
//!      │  └─────────── path ready ── Planning ◄── release ends at an obstacle
//!      │                             └─nothing found─► Waiting ─► Looking, Driving
//!      └─ end of the way reached ─► at rest
//! ```

mod search;

pub use search::RULES;

use std::collections::VecDeque;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{StopId, TileReport, VehicleMode};

use super::super::vehicle::{MoveCommand, ReflexObstacle};
use super::super::{OwnState, VehicleSettings};
use super::look_around::{LookAround, Next};
use super::way::Way;
use crate::geom::{Angle, Point, Pose, Rect, Segment};
use crate::map::{CellRect, Merged};
use crate::plan::{Corridor, Release};
use crate::time::{Deadline, Time};

/// How far ahead the strip is judged, metres.
const AHEAD_M: f64 = 4.0;
/// A command must lead at least this far, unless it ends the way, metres.
const GO_M: f64 = 0.3;
/// A command is renewed when less than this is left of it and more is released, metres.
const RENEW_M: f64 = 1.0;
/// A command that leads this much further than is released is shortened, metres.
const SHORTEN_M: f64 = 0.05;
/// At rest this near to the end, the end is reached, metres.
pub const ARRIVED_M: f64 = 0.35;
/// Between what is released and where the command ends, metres.
const BACKOFF_M: f64 = 0.02;
/// After a command that had no effect, wait this long.
const RETRY_AFTER: Duration = Duration::from_millis(600);
/// After a search without a result, wait this long; longer after every further one.
const SEARCH_AGAIN: Duration = Duration::from_secs(3);
/// The longest such wait, in shortest ones.
const LONGEST_WAIT: u32 = 4;
/// Looks at one place before what is unknown counts as barred.
const LOOKS_MAX: u32 = 4;
/// Places remembered to go back to, and how far apart they are, metres.
const TRAIL: usize = 16;
const TRAIL_STEP_M: f64 = 0.5;
/// All places driven that are remembered, and how far apart they are, metres.
const DRIVEN: usize = 8192;
const DRIVEN_STEP_M: f64 = 0.2;
/// After so many refusals in a row, peers that stand are planned around.
const REFUSALS_MAX: u32 = 4;
/// So many paths in a row of which every command is refused, and the vehicle does not get on by itself.
const REFUSED_PATHS_MAX: u32 = 3;
/// Bumps are looked for along the way in steps of this length, metres.
const STEP_M: f64 = 0.1;

/// What the pilot met.
#[derive(Clone, PartialEq, Debug)]
pub enum WayEvent {
    /// A stop was passed or reached.
    Stop(StopId),
    /// The way is looked at, since something on it is unknown.
    Looks(Point),
    /// Something stands on the way; a path around it is searched.
    Blocked(Point),
    /// A path was found; its length, metres.
    Path(f64),
    /// There is no path, at least not now; searches in vain in a row.
    NoPath(u32),
}

#[derive(Clone, Debug, Serialize, Deserialize)]
enum Doing {
    Driving,
    Looking(LookAround),
    /// A path search that takes its time: the corners, and how many corners of the way they replace.
    Planning {
        ready: Time,
        found: Option<(usize, Vec<Point>)>,
    },
    Waiting {
        until: Time,
    },
}

/// What a search does with unknown cells, once looking at them has not helped they always count as barred.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Unknown {
    /// They are as good as free: the way is looked at before it is driven.
    Free,
    /// They are crossed only when no path leads around them.
    LastResort,
    /// They are barred.
    Barred,
}

/// How the way home looks, over what is known to be free.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WayHome {
    /// It can be driven.
    Open,
    /// Only peers that stand are in the way.
    BehindPeers,
    /// Nothing known leads home, even without peers.
    Unknown,
}

/// Drives along a way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pilot {
    settings: VehicleSettings,
    map: Merged,
    way: Way,
    doing: Doing,
    /// Odometer at the end of the standing command, metres.
    commanded_m: Option<f64>,
    commanded_at: Time,
    /// What searches do with unknown cells on this way.
    unknown: Unknown,
    /// Unknown cells count as barred in the next search: looking did not help.
    looked: bool,
    /// Peers that stand or are silent, each with the way that it claims: they are planned around.
    peers: Vec<Vec<Point>>,
    /// What made the reflex halt lately, whether the map shows it or not.
    bumps: Vec<ReflexObstacle>,
    /// The way is only a wish: nothing of it is driven before a path is found.
    needs_path: bool,
    /// A path was found, and nothing of it has been driven.
    path_is_fresh: bool,
    /// The way leads over places where the vehicle has driven: its body must have room there, its padding need not.
    is_narrow: bool,
    /// The way is driven as it is: what blocks it is said, and no other is searched.
    is_strict: bool,
    /// Looks since the last drive.
    looks: u32,
    /// Where the vehicle has been, oldest first: the way back out of a dead end.
    trail: VecDeque<Point>,
    /// Where the vehicle has driven, oldest first.
    driven: Vec<Point>,
    /// On the way back out of a dead end: the odometer at its end, metres. There a path is searched, whatever is
    /// released.
    retreat_m: Option<f64>,
    /// Commands refused in a row.
    refusals: u32,
    /// Paths in a row of which nothing was driven, since all commands were refused.
    refused_paths: u32,
    /// Searches without a result in a row.
    failures: u32,
}

impl Pilot {
    /// Makes a pilot that knows nothing of the world.
    pub fn new(settings: VehicleSettings) -> Pilot {
        Pilot {
            map: Merged::new(settings.lattice, None),
            settings,
            way: Way::default(),
            doing: Doing::Driving,
            commanded_m: None,
            commanded_at: Time::ZERO,
            unknown: Unknown::Free,
            looked: false,
            peers: Vec::new(),
            bumps: Vec::new(),
            needs_path: false,
            path_is_fresh: false,
            is_narrow: false,
            is_strict: false,
            driven: Vec::new(),
            looks: 0,
            trail: VecDeque::new(),
            retreat_m: None,
            refusals: 0,
            refused_paths: 0,
            failures: 0,
        }
    }

    /// Takes a tile of the map actor.
    pub fn learn(&mut self, tile: &TileReport) {
        // The map actor has checked it; one that is known already changes nothing.
        let _ = self.map.join(tile);
    }

    /// Returns the way ahead.
    pub fn way(&self) -> &Way {
        &self.way
    }

    /// Adds a leg at the end of the way.
    pub fn append(
        &mut self,
        route: impl IntoIterator<Item = Point>,
        to: Point,
        stop: Option<StopId>,
    ) {
        self.way.append(route, to, stop);
    }

    /// Gives up the way, and whatever was being done about it.
    pub fn give_up(&mut self, place: Point) {
        self.way.clear(place);
        self.doing = Doing::Driving;
        (self.commanded_m, self.retreat_m) = (None, None);
        (self.refusals, self.refused_paths, self.failures) = (0, 0, 0);
        (self.unknown, self.needs_path) = (Unknown::Free, false);
        (self.is_strict, self.is_narrow) = (false, false);
    }

    /// Takes a route, corners after where the vehicle is, that is driven as it is: what blocks it is said, and whoever
    /// gave it decides. What is unknown on it is looked at as on every way.
    /// A narrow route leads over places where the vehicle has driven, see [`Pilot::driven`].
    pub fn take_route(&mut self, place: Point, corners: &[Point], is_narrow: bool) {
        let Some((end, corners)) = corners.split_last() else {
            return;
        };
        self.give_up(place);
        self.way.append(corners.iter().copied(), *end, None);
        (self.is_strict, self.is_narrow) = (true, is_narrow);
        (self.looked, self.looks) = (false, 0);
    }

    /// Returns how far the middle of the vehicle keeps from what stands there, metres.
    pub fn keep_m(&self, pose: Pose) -> f64 {
        self.half_width_m(pose)
    }

    /// Returns what is known of the world.
    pub fn map(&self) -> &Merged {
        &self.map
    }

    /// Returns how many searches in a row have found nothing on the way that can be reached.
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// Returns whether the vehicle refuses whatever path is found.
    pub fn is_refused(&self) -> bool {
        self.refused_paths >= REFUSED_PATHS_MAX
    }

    /// Returns up the way to the next stop, which cannot be reached; returns the stops at it.
    pub fn skip(&mut self, place: Point) -> Vec<StopId> {
        (self.commanded_m, self.retreat_m) = (None, None);
        self.way.skip(place)
    }

    /// Remembers what made the reflex halt.
    pub fn bumped(&mut self, now: Time, bump: ReflexObstacle) {
        self.bumps.retain(|known| known.until > now);
        self.bumps.push(bump);
    }

    /// Forgets the standing command, which was refused.
    pub fn refused(&mut self, now: Time) {
        self.refusals += 1;
        self.halted(now);
    }

    /// Takes what peers that stand or are silent claim, to be planned around.
    pub fn keep_clear_of(&mut self, peers: Vec<Vec<Point>>) {
        self.peers = peers;
    }

    /// Begins the way home.
    pub fn go_home(&mut self, now: Time, state: &OwnState, unknown: Unknown) {
        let pose = state.pose;
        self.give_up(pose.at);
        self.way.append([], self.settings.home, None);
        (self.unknown, self.looked, self.looks) = (unknown, false, 0);
        self.search(now, pose);
    }

    /// Returns how the way home looks.
    pub fn way_home(&self, now: Time, state: &OwnState) -> WayHome {
        let (pose, home) = (state.pose, self.settings.home);
        let is_open = |peers| {
            self.path(now, pose, home, false, peers).is_some()
                || self.driven_path(now, pose, home, peers).is_some()
        };
        if home.distance_to(pose.at) <= ARRIVED_M || is_open(&self.peers) {
            WayHome::Open
        } else if is_open(&[]) {
            WayHome::BehindPeers
        } else {
            WayHome::Unknown
        }
    }

    /// Begins a way at a place; only at rest.
    pub fn begin_at(&mut self, place: Point) {
        if self.way.is_empty() {
            self.way.clear(place);
        }
    }

    /// Forgets the standing command: the vehicle was stopped.
    pub fn halted(&mut self, now: Time) {
        self.commanded_m = None;
        self.commanded_at = now;
    }

    /// Returns when to be asked again without any input.
    pub fn deadline(&self) -> Option<Deadline> {
        match &self.doing {
            Doing::Planning { ready, .. } => Some(Deadline {
                at: *ready,
                why: "path ready",
            }),
            Doing::Waiting { until } => Some(Deadline {
                at: *until,
                why: "search again",
            }),
            Doing::Driving | Doing::Looking(_) => None,
        }
    }

    /// Goes on with what the vehicle says of itself; returns a command, if one is due.
    pub fn advance(
        &mut self,
        now: Time,
        state: &OwnState,
        met: &mut Vec<WayEvent>,
    ) -> Option<MoveCommand> {
        let pose = state.pose;
        let resting = !matches!(state.mode, VehicleMode::Driving | VehicleMode::Turning);
        self.remember(pose.at);
        if !resting {
            self.refusals = 0;
        }
        if state.mode == VehicleMode::Driving {
            self.refused_paths = 0;
        }
        self.pass(now, pose, resting, met);
        if self.way.is_empty() {
            self.commanded_m = None;
            self.doing = Doing::Driving;
            return None;
        }
        match &mut self.doing {
            Doing::Driving => self.drive(now, pose, resting, met),
            Doing::Looking(_) => self.look(now, pose, resting, met),
            Doing::Planning { .. } => self.take_path(now, pose, met),
            Doing::Waiting { until } if now < *until => None,
            // What was taken for an obstacle is looked at again, in every second try.
            Doing::Waiting { .. } if self.failures % 2 == 1 && resting => {
                Some(self.look_around(now, pose.at.angle_to(self.way.end()), pose.at, met))
            }
            Doing::Waiting { .. } => {
                self.doing = Doing::Driving;
                None
            }
        }
    }

    fn pass(&mut self, now: Time, pose: Pose, resting: bool, met: &mut Vec<WayEvent>) {
        let mut passed = self.way.pass(pose.at);
        if resting && self.way.end().distance_to(pose.at) <= ARRIVED_M && self.is_settled(now) {
            passed.extend(self.way.arrive());
        }
        if !passed.is_empty() {
            self.failures = 0;
        }
        met.extend(passed.into_iter().map(WayEvent::Stop));
    }

    /// Returns whether the last command has had time to show in the state.
    fn is_settled(&self, now: Time) -> bool {
        now.since(self.commanded_at) >= RETRY_AFTER
    }

    fn release(&self, now: Time, pose: Pose) -> Release {
        let mut points = self.way.points();
        if let Some(end_m) = self.retreat_m {
            // The way on lies over the way back: only the latter is judged, until its end is reached.
            points = self.way.until(points[0], 0.0, self.way.along_m(end_m));
        }
        let half_width_m = match self.is_narrow {
            true => self.settings.body.radius_m + 2.0 * pose.sd_m,
            false => self.half_width_m(pose),
        };
        let view = self
            .map
            .view(self.settings.slice, self.around(pose.at, AHEAD_M + 2.0));
        let mut release = Corridor {
            half_width_m,
            ahead_m: AHEAD_M,
        }
        .released(&view, &points, pose.at);
        for bump in self.bumps.iter().filter(|bump| bump.until > now) {
            self.hold_before(bump, pose, &mut release);
        }
        release
    }

    /// Ends a release where the way would lead to what made the reflex halt.
    fn hold_before(&self, bump: &ReflexObstacle, pose: Pose, release: &mut Release) {
        let (here_m, bump_m) = (release.here_m, bump.at.distance_to(pose.at));
        let steps = (release.ahead_m() / STEP_M).ceil() as usize;
        let leads_there = |step: &usize| {
            let until_m = (here_m + *step as f64 * STEP_M).min(release.free_until_m);
            let route = self.way.until(pose.at, here_m, until_m);
            route
                .windows(2)
                .any(|pair| !bump.is_passed_by(Segment::new(pair[0], pair[1]), bump_m))
        };
        if let Some(step) = (1..=steps).find(leads_there) {
            let at_m = here_m + (step - 1) as f64 * STEP_M;
            release.free_until_m = at_m;
            (release.blocked, release.blocked_at_m) = (Some(bump.at), Some(at_m));
        }
    }

    fn half_width_m(&self, pose: Pose) -> f64 {
        self.settings.corridor_m(pose.sd_m)
            + self.settings.lattice.cell_m() * std::f64::consts::FRAC_1_SQRT_2
    }

    fn around(&self, place: Point, margin_m: f64) -> CellRect {
        CellRect::covering(
            self.settings.lattice,
            Rect::new(place, place).shrunk(-margin_m),
        )
    }

    fn drive(
        &mut self,
        now: Time,
        pose: Pose,
        resting: bool,
        met: &mut Vec<WayEvent>,
    ) -> Option<MoveCommand> {
        let release = self.release(now, pose);
        let whole_m = self.way.length_m();
        let ends_way = release.free_until_m >= whole_m - 1e-6;
        let until_m = if ends_way {
            whole_m
        } else {
            release.free_until_m - BACKOFF_M
        };
        let left_m = self
            .commanded_m
            .map(|odometer_m| self.way.along_m(odometer_m) - release.here_m);
        let goes_m = until_m - release.here_m;
        if let Some(left_m) = left_m.filter(|_| !resting) {
            if left_m > goes_m + SHORTEN_M {
                return self.command(now, pose, release.here_m, until_m.max(release.here_m));
            }
            let renew = left_m < RENEW_M && goes_m > left_m + GO_M.min(0.5 * AHEAD_M);
            let ends = left_m < RENEW_M && ends_way && goes_m > left_m + 0.05;
            return (renew || ends)
                .then(|| self.command(now, pose, release.here_m, until_m))
                .flatten();
        }
        if !self.is_settled(now) {
            return None;
        }
        if self.refusals >= REFUSALS_MAX || self.has_retreated(&release) || self.needs_path {
            self.refused_paths += u32::from(self.refusals >= REFUSALS_MAX);
            self.refusals = 0;
            self.retreat_m = None;
            met.push(WayEvent::Blocked(pose.at));
            if !self.is_strict {
                self.search(now, pose);
            }
            return None;
        }
        if goes_m >= GO_M || (ends_way && goes_m > 0.0) {
            self.looked = false;
            self.looks = 0;
            self.path_is_fresh = false;
            return self.command(now, pose, release.here_m, until_m);
        }
        resting
            .then(|| self.overcome(now, pose, &release, met))
            .flatten()
    }

    /// Commands the route to a length along the way.
    fn command(&mut self, now: Time, pose: Pose, here_m: f64, until_m: f64) -> Option<MoveCommand> {
        let route = self.way.until(pose.at, here_m, until_m);
        self.commanded_at = now;
        if route.len() < 2 {
            self.commanded_m = None;
            return Some(MoveCommand::Hold);
        }
        self.commanded_m = Some(self.way.odometer_m(until_m));
        let stop = self
            .way
            .ahead()
            .find_map(|corner| corner.stops.first().copied());
        Some(MoveCommand::Drive { stop, route })
    }

    /// At rest, and nothing is released: looks at what is unknown, or plans around what is in the way.
    fn overcome(
        &mut self,
        now: Time,
        pose: Pose,
        release: &Release,
        met: &mut Vec<WayEvent>,
    ) -> Option<MoveCommand> {
        let blocked_m = release.blocked_at_m.unwrap_or(f64::INFINITY);
        match release
            .unknown
            .filter(|_| release.unknown_at_m.is_some_and(|at_m| at_m <= blocked_m))
        {
            Some(unknown) if !self.looked && self.looks < LOOKS_MAX => {
                self.looks += 1;
                Some(self.look_around(now, pose.at.angle_to(unknown), unknown, met))
            }
            unknown => {
                met.push(WayEvent::Blocked(
                    release.blocked.or(unknown).unwrap_or(pose.at),
                ));
                match (self.is_strict, self.path_is_fresh) {
                    (true, _) => {}
                    (false, true) => self.fail(now, met),
                    (false, false) => self.search(now, pose),
                }
                self.path_is_fresh = false;
                None
            }
        }
    }

    /// Begins to look around, first in a direction.
    fn look_around(
        &mut self,
        now: Time,
        toward: Angle,
        at: Point,
        met: &mut Vec<WayEvent>,
    ) -> MoveCommand {
        met.push(WayEvent::Looks(at));
        let look = LookAround::toward(toward, now);
        self.doing = Doing::Looking(look);
        self.commanded_at = now;
        MoveCommand::Turn(look.heading())
    }

    fn look(
        &mut self,
        now: Time,
        pose: Pose,
        resting: bool,
        met: &mut Vec<WayEvent>,
    ) -> Option<MoveCommand> {
        let release = self.release(now, pose);
        let Doing::Looking(look) = &mut self.doing else {
            return None;
        };
        if resting && release.ahead_m() >= GO_M + BACKOFF_M && !self.needs_path {
            self.doing = Doing::Driving;
            return self.drive(now, pose, resting, met);
        }
        let cycle = self.settings.look.cycle();
        match look.next(now, pose.heading, resting, cycle * 3) {
            Next::Turn(heading) => {
                self.commanded_at = now;
                Some(MoveCommand::Turn(heading))
            }
            Next::Stay => None,
            Next::Over => {
                self.looked = !self.needs_path;
                self.doing = Doing::Driving;
                None
            }
        }
    }

    /// Returns whether the way back out of a dead end has been driven.
    fn has_retreated(&self, release: &Release) -> bool {
        self.retreat_m
            .is_some_and(|end_m| self.way.along_m(end_m) - release.here_m < GO_M)
    }

    fn remember(&mut self, place: Point) {
        if self
            .trail
            .back()
            .is_none_or(|last| last.distance_to(place) >= TRAIL_STEP_M)
        {
            self.trail.push_back(place);
        }
        if self.trail.len() > TRAIL {
            self.trail.pop_front();
        }
        if self
            .driven
            .last()
            .is_none_or(|last| last.distance_to(place) >= DRIVEN_STEP_M)
        {
            self.driven.push(place);
        }
        if self.driven.len() > DRIVEN {
            // The older half is kept in larger steps.
            let old = DRIVEN / 2;
            let thinned: Vec<Point> = self.driven[..old].iter().copied().step_by(2).collect();
            self.driven.splice(..old, thinned);
        }
    }

    fn take_path(&mut self, now: Time, pose: Pose, met: &mut Vec<WayEvent>) -> Option<MoveCommand> {
        let Doing::Planning { ready, found } = &mut self.doing else {
            return None;
        };
        if now < *ready {
            return None;
        }
        let Some((count, points)) = found.take() else {
            self.fail(now, met);
            return None;
        };
        if count == 0 {
            self.failures += 1;
        }
        (self.path_is_fresh, self.needs_path) = (true, false);
        let length_m: f64 = points
            .windows(2)
            .map(|pair| Segment::new(pair[0], pair[1]).length_m())
            .sum();
        met.push(WayEvent::Path(length_m));
        self.way.replace(pose.at, count, &points[1..]);
        self.retreat_m = (count == 0).then(|| self.way.odometer_m(length_m));
        self.commanded_m = None;
        self.doing = Doing::Driving;
        None
    }

    /// Nothing was found, or what was found is blocked at once: waits, each time longer.
    fn fail(&mut self, now: Time, met: &mut Vec<WayEvent>) {
        (self.looked, self.needs_path) = (false, self.unknown != Unknown::Free);
        self.failures += 1;
        met.push(WayEvent::NoPath(self.failures));
        let wait = SEARCH_AGAIN * self.failures.min(LONGEST_WAIT);
        self.doing = Doing::Waiting { until: now + wait };
    }
}
