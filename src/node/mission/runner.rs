//! Carries out the steps of a mission that the ground station does not plan: going, looking, making room for peers, and
//! going home when the mission has ended, so that the vehicle stands in nobody's way. It knows no kind of mission; the
//! pilot drives, the vehicle actor has the last word.
//!
//! ```text
//!   [Choosing] ─ a place, open ground, aside, or home ─► [Driving]
//!   [Choosing] ─ something to look at ─► [Looking]
//!   [Choosing] ─ what the autopilot stores ─► [Following] ─ over ─► [Over]; stopped ─► [Choosing]
//!   [Choosing] ─ peers are in the way: wait; the lowest id waits longest before it steps aside ─► [Choosing]
//!   [Driving]  ─ arrived: the mission says whether it looks or thinks ─► [Looking], [Choosing]
//!   [Driving]  ─ blocked, or what was to be seen is seen ─► [Choosing]
//!   [Looking]  ─ everything looked at ─► [Choosing]
//!   [Choosing] ─ the mission has ended, and no way leads home; [Driving] ─ home ─► [Over]
//!   [Over]     ─ at home, where it stands in a peer's way: aside ─► [Driving]
//! ```
//!
//! Nothing is done for ever: see `progress_watch`. Nothing is said to be done, seen or unreachable by a vehicle that knows its
//! place worse than it did: see [`super::place_watch`].
//!
//! Deliberately absent: where to go and what to look at, see [`super::kind`].

mod after_mission;
mod barred_places;
mod claims;
mod close_looks;
mod context;
mod own_mission;
mod peers_ahead;
mod progress_watch;
mod routes;
mod tries;
mod yield_to_peers;

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::MissionPhase;

use self::barred_places::BarredPlaces;
pub(super) use self::context::RunnerContext;
use self::own_mission::OwnMission;
use self::progress_watch::ProgressWatch;
use self::routes::RouteFinder;
use self::tries::Tries;
use self::yield_to_peers::YieldToPeers;
use super::aside::BarringLooks;
use super::doubts::Doubts;
use super::kind::{AnyBehaviour, DriveRoute, MissionInput, MissionStep, PassedOver, RouteRoom};
use super::look_around::{LookAround, Next, dwell};
use super::obstruction::Obstruction;
use super::pilot::WayEvent;
use super::{EndReason, MissionEvent, Out};
use crate::geom::{Cell, Point};
use crate::map::MapTile;
use crate::node::VehicleSettings;
use crate::node::vehicle::MoveCommand;
use crate::time::{Deadline, Time};

/// While driving, the mission is asked this often whether to go on.
const ASK_EVERY: Duration = Duration::from_secs(1);
/// When something is in the way, wait this long, or some times as long.
const WAIT: Duration = Duration::from_secs(2);
/// Who has stepped aside waits this long, so that those for whom it did have set out before it comes back.
const WAIT_ASIDE: Duration = Duration::from_secs(6);

/// Where the vehicle is going.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
enum Destination {
    /// A place of the mission, straight ahead.
    Straight(Point),
    /// A place of the mission, by a path that may be planned anew.
    ByPath(Point),
    /// Where the mission wants to look from.
    Viewpoint,
    /// Where to look from near at a cell that may bar the way to a place, and may not.
    Doubtful(Cell),
    /// Back to ground with room, from where it was hemmed in.
    OpenGround,
    /// Somewhere out of the way of peers.
    Aside,
    /// Home.
    Home,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Phase {
    /// It thinks, or waits.
    Choosing {
        from: Time,
    },
    Driving {
        to: Destination,
        asked: Time,
    },
    /// It looks at a cell, or all around.
    Looking {
        look: LookAround,
        at: Option<Cell>,
    },
    /// The autopilot carries out what it stores, unless the vehicle has refused it.
    Following {
        since: Time,
        is_refused: bool,
    },
    Over,
}

/// A mission under way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct StepRunner {
    settings: VehicleSettings,
    mission: OwnMission,
    phase: Phase,
    /// What was in the way to the present place of the mission.
    barred: BarredPlaces,
    /// What may be in the way there, and was looked at from near.
    doubts: Doubts,
    tries: Tries,
    yields: YieldToPeers,
    progress: ProgressWatch,
    /// The place of the mission that it goes for by paths.
    sought: Option<Point>,
    /// Whether it bars somebody's way at home.
    barring: BarringLooks,
}

impl StepRunner {
    /// Makes the runner of the mission that a vehicle is out for; `None` when the ground station plans.
    pub(super) fn of(settings: &VehicleSettings) -> Option<StepRunner> {
        Some(StepRunner {
            settings: settings.clone(),
            mission: OwnMission::UnderWay(AnyBehaviour::of(settings)?),
            phase: Phase::Choosing { from: Time::ZERO },
            barred: BarredPlaces::default(),
            doubts: Doubts::default(),
            tries: Tries::default(),
            yields: YieldToPeers::default(),
            progress: ProgressWatch::new(settings),
            sought: None,
            barring: BarringLooks::default(),
        })
    }

    /// Notes that a tile of the map has changed.
    pub(super) fn learn(&mut self, tile: &MapTile) {
        self.progress.learn(&tile.report);
        if let Some(mission) = self.mission.under_way() {
            mission.tile_changed(tile.report.address);
        }
    }

    /// Returns when to be asked again without any input.
    pub(super) fn deadline(&self) -> Option<Deadline> {
        match self.phase {
            Phase::Choosing { from } => Some(Deadline {
                at: from,
                why: "choose where to go",
            }),
            Phase::Driving { .. }
            | Phase::Looking { .. }
            | Phase::Following { .. }
            | Phase::Over => None,
        }
    }

    /// Returns what the vehicle does for the mission while it follows.
    pub(super) fn phase(&self) -> MissionPhase {
        match self.phase {
            Phase::Choosing { .. } if self.yields.in_a_row() > 0 => MissionPhase::Yielding,
            Phase::Choosing { .. } if self.end().is_some() => MissionPhase::Returning,
            Phase::Choosing { .. } => MissionPhase::Choosing,
            Phase::Driving {
                to: Destination::Aside,
                ..
            } => MissionPhase::Yielding,
            Phase::Driving {
                to: Destination::Home,
                ..
            } => MissionPhase::Returning,
            Phase::Driving {
                to:
                    Destination::Straight(_)
                    | Destination::ByPath(_)
                    | Destination::Viewpoint
                    | Destination::Doubtful(_)
                    | Destination::OpenGround,
                ..
            } => MissionPhase::Going,
            Phase::Looking { .. } => MissionPhase::Looking,
            Phase::Following { .. } => MissionPhase::Going,
            Phase::Over => MissionPhase::Over,
        }
    }

    /// Returns where it is going, or what it is going to see: its home once the mission has ended; `None` = nowhere.
    pub(super) fn goal(&self) -> Option<Point> {
        match (self.end(), self.phase) {
            (_, Phase::Over) => None,
            (Some(_), _) => Some(self.settings.home),
            (None, _) => self.mission.goal(),
        }
    }

    /// Returns how many places of the mission are still to be visited; one that has no list of places has none.
    pub(super) fn places_left(&self) -> usize {
        self.mission.places_left()
    }

    /// Returns how the mission ended; `None` = it has not.
    pub(super) fn end(&self) -> Option<&EndReason> {
        self.mission.end()
    }

    /// Ends the mission that is under way for a reason that does not lie in it; the vehicle goes home when it may go on.
    pub(super) fn end_for(&mut self, end: EndReason) {
        self.yields.end();
        self.tries.clear();
        self.sought = None;
        self.mission = OwnMission::Ended(end);
        self.choose_at(Time::ZERO);
    }

    /// Begins to think anew, after the vehicle was stopped or held.
    pub(super) fn interrupt(&mut self, now: Time) {
        if !matches!(self.phase, Phase::Over) {
            self.think(now);
        }
    }

    /// Notes that the vehicle has refused what it was told last.
    pub(super) fn refused(&mut self) {
        if let Phase::Following { is_refused, .. } = &mut self.phase {
            *is_refused = true;
        }
    }

    /// Goes on; `met` is what the pilot met.
    pub(super) fn go_on(&mut self, scene: &mut RunnerContext<'_>, met: &[WayEvent]) {
        self.progress.go_on(scene.now);
        if self.progress.is_stalled() && !matches!(self.phase, Phase::Over) {
            return self.stalled(scene);
        }
        if !scene.state.sees && self.waits_to_see(scene) {
            return;
        }
        if let Some(WayEvent::Blocked(by)) =
            met.iter().find(|met| matches!(met, WayEvent::Blocked(_)))
        {
            self.is_blocked(scene, *by);
        }
        if let Some(mission) = self.mission.under_way() {
            mission.watch(&scene.surroundings());
        }
        match self.phase {
            Phase::Choosing { from } if from <= scene.now => self.tell(scene, MissionInput::Ready),
            Phase::Choosing { .. } => {}
            Phase::Over => self.make_room(scene),
            Phase::Driving { to, .. } if scene.pilot.way().is_empty() => self.arrive(scene, to),
            Phase::Driving { to, asked } if scene.now.since(asked) >= ASK_EVERY => {
                self.ask(scene, to)
            }
            Phase::Driving { .. } => {}
            Phase::Looking { look, at } => self.look(scene, look, at),
            Phase::Following { since, is_refused } => {
                self.follow_stored(scene, since, is_refused);
            }
        }
    }

    /// Tells the mission how far the autopilot is with what it stores.
    fn follow_stored(&mut self, scene: &mut RunnerContext<'_>, since: Time, is_refused: bool) {
        self.progress.get_on(scene.now);
        if scene.now.since(since) >= ASK_EVERY {
            // What it says after a refusal is of the mission before.
            let stored = scene.state.stored.filter(|_| !is_refused);
            self.tell(scene, MissionInput::Autopilot(stored));
        }
    }

    /// Tells the mission what is seen, and does what it says; once it has ended the vehicle goes home.
    fn tell(&mut self, scene: &mut RunnerContext<'_>, seen: MissionInput) {
        let Some(mission) = self.mission.under_way() else {
            return self.head_home(scene);
        };
        let step = mission.next(seen, &scene.surroundings());
        match step {
            MissionStep::GoOn => {}
            MissionStep::Think => {
                self.yields.end();
                self.think(scene.now);
            }
            MissionStep::GoStraight(place) => self.drive_straight(scene, place),
            MissionStep::GoTo(place) => self.go_to(scene, place),
            MissionStep::GoAlong(course) => {
                self.yields.end();
                self.drive(scene, &course, Destination::Viewpoint);
            }
            MissionStep::LookAround => {
                let toward = scene.pose().heading;
                self.begin_look(scene, LookAround::toward(toward, scene.now), None);
            }
            MissionStep::LookAt(cell) | MissionStep::LookAtFace(cell) => {
                if matches!(step, MissionStep::LookAtFace(_)) {
                    // Each is looked at so often at most: this cannot go on for ever.
                    self.progress.get_on(scene.now);
                }
                self.yields.end();
                let toward = scene.pose().at.angle_to(self.settings.lattice.centre(cell));
                self.begin_look(scene, LookAround::once(toward, scene.now), Some(cell));
            }
            MissionStep::LookClosely(cell) => self.look_closely(scene, cell),
            MissionStep::TryAgain => self.try_again(scene),
            MissionStep::YieldToPeers => self.yield_to_peers(scene),
            MissionStep::Wait => self.choose_at(scene.now + WAIT),
            MissionStep::FollowStored { items, from } => {
                let command = MoveCommand::FollowStored { items, from };
                scene.out.push(Out::Command(scene.now, command));
                self.phase = Phase::Following {
                    since: scene.now,
                    is_refused: false,
                };
            }
            MissionStep::End(end) if self.may_claim(scene) => self.finish(scene, end),
            MissionStep::End(_) => {}
            MissionStep::EndHere(end) => {
                self.finish(scene, end);
                self.phase = Phase::Over;
            }
        }
    }

    /// For very long nothing new was seen and no place was come to: a place that it goes for is given up, or the mission; one
    /// that has ended is over where it is.
    fn stalled(&mut self, scene: &mut RunnerContext<'_>) {
        self.progress.get_on(scene.now);
        let place = scene.pose().at;
        scene.pilot.give_up(place);
        match (self.mission.under_way(), self.sought) {
            (None, _) => self.phase = Phase::Over,
            (Some(_), Some(sought)) => self.pass_over(scene, sought, PassedOver::GivenUp),
            (Some(mission), None) => {
                if mission.goes_on_without(scene.now) {
                    return self.think(scene.now);
                }
                let end = match mission.give_up() {
                    EndReason::NoRoom => EndReason::Stalled,
                    other => other,
                };
                self.finish(scene, end);
            }
        }
    }

    fn choose_at(&mut self, from: Time) {
        self.phase = Phase::Choosing { from };
    }

    fn think(&mut self, now: Time) {
        self.choose_at(now + self.settings.path_time);
    }

    /// Drives along a course.
    fn drive(&mut self, scene: &mut RunnerContext<'_>, course: &DriveRoute, to: Destination) {
        scene
            .pilot
            .take_route(scene.pose().at, &course.corners, course.room);
        self.phase = Phase::Driving {
            to,
            asked: scene.now,
        };
    }

    fn drive_straight(&mut self, scene: &mut RunnerContext<'_>, place: Point) {
        if self.is_barred_by_peers(scene, place) {
            return self.yield_to_peers(scene);
        }
        let course = DriveRoute {
            corners: vec![place],
            room: RouteRoom::Kept,
        };
        self.drive(scene, &course, Destination::Straight(place));
    }

    fn arrive(&mut self, scene: &mut RunnerContext<'_>, to: Destination) {
        match to {
            Destination::Straight(place) | Destination::ByPath(place) => {
                self.barred.clear();
                self.doubts.clear();
                self.sought = None;
                self.progress.get_on(scene.now);
                self.yields.end();
                scene.place.end_wait();
                scene.emit(MissionEvent::Visited(place));
                self.tell(scene, MissionInput::Arrived);
            }
            Destination::Viewpoint => self.tell(scene, MissionInput::Arrived),
            Destination::Doubtful(cell) => {
                self.doubts
                    .note(self.settings.lattice, cell, scene.pose().at);
                self.look_closely(scene, cell);
            }
            Destination::OpenGround => {
                self.progress.get_on(scene.now);
                self.think(scene.now);
            }
            Destination::Aside => self.choose_at(scene.now + WAIT_ASIDE),
            Destination::Home => self.phase = Phase::Over,
        }
    }

    /// Asks the mission, on the way to where it wants to be, whether to go on.
    fn ask(&mut self, scene: &mut RunnerContext<'_>, to: Destination) {
        self.phase = Phase::Driving {
            to,
            asked: scene.now,
        };
        match to {
            Destination::Straight(_) | Destination::ByPath(_) | Destination::Viewpoint => {
                self.yields.drive(self.left_m(scene.pose().at));
                self.tell(scene, MissionInput::UnderWay);
            }
            Destination::Home => self.yields.drive(self.left_m(scene.pose().at)),
            Destination::Doubtful(_) | Destination::OpenGround | Destination::Aside => {}
        }
    }

    /// Returns how far a place is from where the vehicle is going, metres.
    fn left_m(&self, place: Point) -> f64 {
        self.goal().map_or(0.0, |goal| goal.distance_to(place))
    }

    fn begin_look(&mut self, scene: &mut RunnerContext<'_>, look: LookAround, at: Option<Cell>) {
        let place = scene.pose().at;
        scene.pilot.give_up(place);
        scene
            .out
            .push(Out::Command(scene.now, MoveCommand::Turn(look.heading())));
        self.phase = Phase::Looking { look, at };
    }

    fn look(&mut self, scene: &mut RunnerContext<'_>, mut look: LookAround, at: Option<Cell>) {
        let pose = scene.pose();
        match look.next(
            scene.now,
            pose.heading,
            scene.rests(),
            dwell(&self.settings.look),
        ) {
            Next::Stay => self.phase = Phase::Looking { look, at },
            Next::Turn(heading) => {
                scene
                    .out
                    .push(Out::Command(scene.now, MoveCommand::Turn(heading)));
                self.phase = Phase::Looking { look, at };
            }
            // It has not turned, so it has not looked around.
            Next::Over if at.is_none() && !look.has_looked() => {
                self.tell(scene, MissionInput::Ready);
            }
            Next::Over => {
                self.tell(
                    scene,
                    MissionInput::Looked {
                        from: pose.at,
                        toward: look.toward_heading(),
                        at,
                    },
                );
            }
        }
    }

    /// Something is in the way.
    fn is_blocked(&mut self, scene: &mut RunnerContext<'_>, by: Obstruction) {
        let Phase::Driving { to, .. } = self.phase else {
            return;
        };
        let place = scene.pose().at;
        scene.pilot.give_up(place);
        match to {
            Destination::Straight(_)
            | Destination::ByPath(_)
            | Destination::Doubtful(_)
            | Destination::OpenGround
            | Destination::Home
                if self.is_a_peer(scene, by) =>
            {
                self.yield_to_peers(scene);
            }
            // What is barred is news for the next path.
            Destination::ByPath(_) if !scene.terrain.is_free(by.at) && self.barred.note(by.at) => {
                self.think(scene.now);
            }
            // It is barred there again.
            Destination::ByPath(_) if self.looks_at_bar(scene, by.at) => {}
            Destination::Straight(_) | Destination::ByPath(_) | Destination::Viewpoint => {
                self.tell(scene, MissionInput::Blocked(by));
            }
            Destination::Doubtful(cell) => {
                self.doubts.note(self.settings.lattice, cell, place);
                self.think(scene.now);
            }
            Destination::OpenGround => self.think(scene.now),
            Destination::Aside | Destination::Home => self.try_again(scene),
        }
    }

    fn try_again(&mut self, scene: &RunnerContext<'_>) {
        let waits = self.tries.again(scene.pose().at);
        let wait = if waits > 0 {
            WAIT * waits
        } else {
            self.settings.path_time
        };
        self.choose_at(scene.now + wait);
    }

    /// Goes to a place of the mission, or passes it over.
    fn go_to(&mut self, scene: &mut RunnerContext<'_>, place: Point) {
        self.sought = Some(place);
        if self.tries.are_spent() {
            return self.pass_over(scene, place, PassedOver::GivenUp);
        }
        let (courses, claims) = (self.courses(scene), scene.surroundings().claims());
        match courses.course_to(place, true, &claims) {
            Ok(course) => self.drive(scene, &course, Destination::ByPath(place)),
            Err(_) if !claims.is_empty() && courses.course_to(place, true, &[]).is_ok() => {
                self.yield_to_peers(scene);
            }
            // What the reflex has met keeps it from where it could look at what bars; that is forgotten again.
            Err(_) if courses.search.is_cut_off(&claims) => self.choose_at(scene.now + WAIT),
            // Only what the reflex has met bars the way.
            Err(_)
                if courses.search.regards_reflex()
                    && courses
                        .but_for_reflex()
                        .course_to(place, true, &claims)
                        .is_ok() =>
            {
                self.choose_at(scene.now + WAIT);
            }
            Err(_) if !self.may_claim(scene) => {}
            Err(_) if !self.barred.places().is_empty() => self.doubt_barred(scene, &claims),
            Err(_) => self.doubt(scene, place, &claims),
        }
    }

    fn pass_over(&mut self, scene: &mut RunnerContext<'_>, place: Point, why: PassedOver) {
        if let Some(mission) = self.mission.under_way() {
            mission.pass_over(why);
        }
        self.barred.clear();
        self.doubts.clear();
        self.tries.clear();
        self.yields.end();
        self.sought = None;
        self.progress.get_on(scene.now);
        scene.emit(MissionEvent::Passed(place));
        self.think(scene.now);
    }

    fn courses<'a>(&'a self, scene: &RunnerContext<'a>) -> RouteFinder<'a> {
        RouteFinder {
            search: scene.terrain.search(scene.now, scene.pose()),
            barred: &self.barred,
        }
    }

    fn finish(&mut self, scene: &mut RunnerContext<'_>, end: EndReason) {
        let place = scene.pose().at;
        scene.pilot.give_up(place);
        self.yields.end();
        self.tries.clear();
        self.sought = None;
        self.progress.get_on(scene.now);
        self.mission = OwnMission::Ended(end.clone());
        scene.emit(MissionEvent::Ended(end));
        self.think(scene.now);
    }
}

#[cfg(test)]
mod tests;
