//! What a vehicle does when the ground station does not plan for it: straight legs, a look around, visits, a search, an
//! exploration. It chooses where to go next and where to look; the pilot drives, the vehicle actor has the last word.
//! Every errand ends: places are visited or given up, and every look at something makes further ones there fewer. Then
//! the vehicle goes home, so that it stands in nobody's way.
//!
//! ```text
//!   Choosing ─a place─► Driving ─arrived─► Looking ─► Choosing ─nothing left─► (going home) ─► Over
//!      ▲  ▲                │ blocked, or what was to be seen is seen                 │
//!      │  └────────────────┘                                                         │
//!      └─ peers are in the way: wait, step aside, the lowest id last ────────────────┘
//! ```
//!
//! Deliberately absent: claims of goals on the wire. Who goes where is judged by the peers' places and ways.

mod aside;
mod choice;
mod looks;
mod visit;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Mode, TileAddress, TileReport, VehicleId};

use super::look::{Look, Next};
use super::pilot::{Met, Pilot};
use super::{Out, Remark};
use crate::geom::{Cell, Point, Pose, Vector};
use crate::node::peers::Peers;
use crate::node::vehicle::Command;
use crate::node::{OwnState, Settings, Task};
use crate::plan::{Frontiers, NoRoute};
use crate::time::{Deadline, Time};

use self::looks::Looks;

/// While driving, what is driven for is judged anew this often.
const JUDGE_EVERY: Duration = Duration::from_secs(1);
/// When only peers are in the way, wait this long.
const WAIT: Duration = Duration::from_secs(2);
/// After so many such waits in a row the errand is given up.
const WAITS_MAX: u32 = 90;
/// The same on the way home: then the return in order is waited for.
const HOME_WAITS_MAX: u32 = 30;
/// So often in a row something may be in the way without the vehicle having moved.
const TRIES_MAX: u32 = 16;
/// The longest wait after something was in the way, in shortest ones.
const WAIT_MAX: u32 = 5;
/// The vehicle has moved when it is this far from where something was in the way, metres.
const MOVED_M: f64 = 0.5;
/// This near to home is at home, metres.
const HOME_M: f64 = 0.35;

/// How an errand ended.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum End {
    /// Everything was done.
    Done,
    /// It stopped in front of something.
    Stopped(Point),
    /// No way leads to so many of its places: all that can be reached was searched. The others were visited.
    NoWay(usize),
    /// So many of its places were given up although a way may lead there, or its peers never made room.
    GaveUp(usize),
}

/// What the vehicle is going for.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
enum Aim {
    /// A place of the mission.
    Place(Point),
    /// A place to look from at a cell.
    Sight(Cell),
    /// Somewhere out of the way.
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
        aim: Aim,
        judged: Time,
    },
    /// It looks at a cell, or all around.
    Looking {
        look: Look,
        at: Option<Cell>,
    },
    Over,
}

/// An errand under way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Errand {
    settings: Settings,
    phase: Phase,
    /// Places that are still to be visited.
    places: VecDeque<Point>,
    /// It has been told where ahead is.
    is_begun: bool,
    looks: Looks,
    /// Where known free ground ends; made anew when it is lost.
    #[serde(skip)]
    frontiers: Option<Frontiers>,
    /// When each peer last came to rest, as far as its look from there is noted.
    peers_looked: BTreeMap<VehicleId, Time>,
    /// Tiles that have changed since the frontiers were kept.
    #[serde(skip)]
    changed: BTreeSet<TileAddress>,
    /// What was looked at on the way to a place and never seen free.
    barred: Vec<Point>,
    /// Where something was in the way last, and how often since the vehicle has moved.
    blocked: (Point, u32),
    /// Waits for peers in a row.
    waits: u32,
    no_way: usize,
    given_up: usize,
    end: Option<End>,
}

/// What an errand is told and may use.
pub struct Scene<'a> {
    /// Now.
    pub now: Time,
    /// The own state.
    pub state: &'a OwnState,
    /// Who drives, and what is known of the world.
    pub pilot: &'a mut Pilot,
    /// The others.
    pub peers: &'a Peers,
    /// What is said.
    pub out: &'a mut Vec<Out>,
}

impl Scene<'_> {
    fn pose(&self) -> Pose {
        Pose::from(self.state.pose)
    }

    fn rests(&self) -> bool {
        self.state.leg.is_none() && !matches!(self.state.mode, Mode::Driving | Mode::Turning)
    }

    /// What peers claim, whether they move or not.
    fn claims(&self) -> Vec<Vec<Point>> {
        self.peers.iter().map(|(_, peer)| peer.claim.clone()).collect()
    }

    fn remark(&mut self, remark: Remark) {
        self.out.push(Out::Remark(remark));
    }
}

impl Errand {
    /// Makes the errand of a task; `None` when the ground station plans.
    pub fn of(settings: &Settings) -> Option<Errand> {
        let places = match &settings.task {
            Task::Plan => return None,
            Task::Legs(places) | Task::Pathfind(places) => places.iter().copied().collect(),
            Task::Forward(_) | Task::Browse | Task::Search | Task::Explore => VecDeque::new(),
        };
        Some(Errand {
            settings: settings.clone(),
            phase: Phase::Choosing { from: Time::ZERO },
            places,
            is_begun: false,
            looks: Looks::new(settings.lattice),
            frontiers: None,
            peers_looked: BTreeMap::new(),
            changed: BTreeSet::new(),
            barred: Vec::new(),
            blocked: (Point::default(), 0),
            waits: 0,
            no_way: 0,
            given_up: 0,
            end: None,
        })
    }

    /// Notes that a tile of the map has changed.
    pub fn learn(&mut self, tile: &TileReport) {
        if self.frontiers.is_some() {
            self.changed.insert(tile.address);
        }
    }

    /// Gives when to be asked again without any input.
    pub fn deadline(&self) -> Option<Deadline> {
        match self.phase {
            Phase::Choosing { from } => Some(Deadline { at: from, why: "choose where to go" }),
            Phase::Driving { .. } | Phase::Looking { .. } | Phase::Over => None,
        }
    }

    /// Begins to think anew, after the vehicle was stopped or held.
    pub fn interrupt(&mut self, now: Time) {
        if !matches!(self.phase, Phase::Over) {
            self.choose_at(now + self.settings.path_time);
        }
    }

    /// Goes on; `met` is what the pilot met.
    pub fn go_on(&mut self, scene: &mut Scene<'_>, met: &[Met]) {
        if let Some(Met::Blocked(at)) = met.iter().find(|met| matches!(met, Met::Blocked(_))) {
            self.is_blocked(scene, *at);
        }
        if self.settings.task == Task::Explore && !matches!(self.phase, Phase::Over) {
            self.note_peers(scene);
        }
        match self.phase {
            Phase::Choosing { from } if from <= scene.now => self.choose(scene),
            Phase::Choosing { .. } | Phase::Over => {}
            Phase::Driving { aim, .. } if scene.pilot.way().is_empty() => self.arrive(scene, aim),
            Phase::Driving { aim, judged } => self.judge(scene, aim, judged),
            Phase::Looking { look, at } => self.look(scene, look, at),
        }
    }

    fn choose_at(&mut self, from: Time) {
        self.phase = Phase::Choosing { from };
    }

    fn think(&mut self, now: Time) {
        self.choose_at(now + self.settings.path_time);
    }

    fn choose(&mut self, scene: &mut Scene<'_>) {
        if self.end.is_some() {
            return self.head_home(scene);
        }
        match self.settings.task.clone() {
            Task::Plan => self.phase = Phase::Over,
            Task::Legs(_) => self.next_leg(scene),
            Task::Forward(distance_m) => {
                if !std::mem::replace(&mut self.is_begun, true) {
                    let pose = scene.pose();
                    self.places.push_back(pose.at + Vector::polar(pose.heading, distance_m));
                }
                self.next_leg(scene);
            }
            Task::Browse if self.is_begun => self.finish(scene, End::Done),
            Task::Browse => {
                self.is_begun = true;
                self.look_around(scene);
            }
            Task::Pathfind(_) | Task::Search | Task::Explore if !self.is_begun => {
                self.is_begun = true;
                self.look_around(scene);
            }
            Task::Pathfind(_) => self.visit_next(scene),
            Task::Search | Task::Explore => self.seek(scene),
        }
    }

    fn next_leg(&mut self, scene: &mut Scene<'_>) {
        match self.places.front().copied() {
            Some(place) => self.drive(scene, &[place], false, Aim::Place(place)),
            None => self.finish(scene, End::Done),
        }
    }

    /// Drives along corners after where the vehicle is.
    fn drive(&mut self, scene: &mut Scene<'_>, corners: &[Point], is_narrow: bool, aim: Aim) {
        scene.pilot.take_route(scene.pose().at, corners, is_narrow);
        self.phase = Phase::Driving { aim, judged: scene.now };
    }

    fn arrive(&mut self, scene: &mut Scene<'_>, aim: Aim) {
        match aim {
            Aim::Place(place) => {
                self.places.pop_front();
                self.barred.clear();
                scene.remark(Remark::Visited(place));
                match self.settings.task {
                    Task::Pathfind(_) => self.look_around(scene),
                    _ => self.think(scene.now),
                }
            }
            Aim::Sight(cell) => self.look_at(scene, cell),
            Aim::Aside => self.choose_at(scene.now + WAIT),
            Aim::Home => self.phase = Phase::Over,
        }
    }

    /// Judges, while driving, whether what is to be seen has been seen meanwhile.
    fn judge(&mut self, scene: &mut Scene<'_>, aim: Aim, judged: Time) {
        if scene.now.since(judged) < JUDGE_EVERY {
            return;
        }
        self.phase = Phase::Driving { aim, judged: scene.now };
        match aim {
            Aim::Sight(cell) if !self.is_frontier(scene.pilot, cell) => self.choose(scene),
            Aim::Sight(_) | Aim::Place(_) | Aim::Aside | Aim::Home => {}
        }
    }

    fn look_around(&mut self, scene: &mut Scene<'_>) {
        let look = Look::toward(scene.pose().heading, scene.now);
        self.begin_look(scene, look, None);
    }

    fn look_at(&mut self, scene: &mut Scene<'_>, cell: Cell) {
        let toward = scene.pose().at.angle_to(self.settings.lattice.centre(cell));
        self.begin_look(scene, Look::once(toward, scene.now), Some(cell));
    }

    fn begin_look(&mut self, scene: &mut Scene<'_>, look: Look, at: Option<Cell>) {
        let place = scene.pose().at;
        scene.pilot.give_up(place);
        scene.out.push(Out::Command(scene.now, Command::Turn(look.heading())));
        self.phase = Phase::Looking { look, at };
    }

    fn look(&mut self, scene: &mut Scene<'_>, mut look: Look, at: Option<Cell>) {
        let dwell = self.dwell();
        match look.next(scene.now, scene.pose().heading, scene.rests(), dwell) {
            Next::Stay => self.phase = Phase::Looking { look, at },
            Next::Turn(heading) => {
                scene.out.push(Out::Command(scene.now, Command::Turn(heading)));
                self.phase = Phase::Looking { look, at };
            }
            Next::Over => {
                if let Some(cell) = at {
                    let from = scene.pose().at;
                    self.note_look(scene.pilot, from, look.toward_heading(), Some(cell));
                }
                self.think(scene.now);
            }
        }
    }

    /// Gives how long a look takes: every beam twice.
    fn dwell(&self) -> Duration {
        let look = &self.settings.look;
        2 * look.cycle() + look.period
    }

    /// Notes what peers look at, so that it is not looked at by all of them in vain.
    fn note_peers(&mut self, scene: &Scene<'_>) {
        let dwell = self.dwell();
        for (id, peer) in scene.peers.iter() {
            let has_looked = peer.resting && scene.now.since(peer.moved_at) >= dwell;
            if has_looked && self.peers_looked.get(&id) != Some(&peer.moved_at) {
                self.peers_looked.insert(id, peer.moved_at);
                self.note_look(scene.pilot, peer.at, peer.heading, None);
            }
        }
    }

    /// Something is in the way.
    fn is_blocked(&mut self, scene: &mut Scene<'_>, at: Point) {
        let Phase::Driving { aim, .. } = self.phase else { return };
        let place = scene.pose().at;
        scene.pilot.give_up(place);
        if matches!(self.settings.task, Task::Legs(_) | Task::Forward(_)) && matches!(aim, Aim::Place(_)) {
            return self.finish(scene, End::Stopped(at));
        }
        let is_new = match aim {
            Aim::Place(_) => self.note_barred(scene, at),
            Aim::Sight(cell) => {
                self.looks.note(&[cell], place);
                false
            }
            Aim::Aside | Aim::Home => false,
        };
        if is_new {
            return self.think(scene.now);
        }
        let (before, times) = self.blocked;
        let times = if before.distance_to(place) <= MOVED_M { times + 1 } else { 1 };
        self.blocked = (place, times);
        let wait = if times > 2 { WAIT * (times - 2).min(WAIT_MAX) } else { self.settings.path_time };
        self.choose_at(scene.now + wait);
    }

    /// Tells whether the vehicle has been stopped so often at one place that it must give up what it is going for.
    fn is_stuck(&self) -> bool {
        self.blocked.1 >= TRIES_MAX
    }

    fn finish(&mut self, scene: &mut Scene<'_>, end: End) {
        let place = scene.pose().at;
        scene.pilot.give_up(place);
        (self.waits, self.blocked.1) = (0, 0);
        self.end = Some(end.clone());
        scene.remark(Remark::Ended(end));
        self.think(scene.now);
    }

    /// The errand has ended: the vehicle goes home over what is known, if it can; otherwise it stays until it is sent.
    fn head_home(&mut self, scene: &mut Scene<'_>) {
        let (pose, home) = (scene.pose(), self.settings.home);
        if home.distance_to(pose.at) <= HOME_M || self.is_stuck() {
            self.phase = Phase::Over;
            return;
        }
        match self.route(scene, home, false) {
            Ok((corners, is_narrow)) => self.drive(scene, &corners, is_narrow, Aim::Home),
            Err(_) if self.waits < HOME_WAITS_MAX => self.wait(scene),
            Err(_) => self.phase = Phase::Over,
        }
    }

    /// Gives the corners of a route to a place, clear of peers; unknown ground may be crossed or not.
    fn route(
        &self,
        scene: &Scene<'_>,
        goal: Point,
        unknown_allowed: bool,
    ) -> Result<(Vec<Point>, bool), NoRoute> {
        self.route_clear_of(scene, goal, unknown_allowed, &scene.claims())
    }
}
