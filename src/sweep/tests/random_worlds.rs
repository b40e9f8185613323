//! A small continuous-time world for random plans, driven by real followers over a bad network.
//!
//! Motion is linear between ticks, so the closest approach of two vehicles within a tick is exact.
//! Nothing of `precedence` or `separation` is used to judge: only where the vehicles are.

use std::collections::BTreeMap;

use tomoswarm_proto::{Plan, Position, Revision, RunId, Stop, StopId, VehicleId};

use crate::geom::{Point, Track};
use crate::sweep::{
    Follower, RevisionPhase, Succession, VehicleProgress, WaitsFor, check_separation, order_legs,
};
use crate::time::Time;

/// Middle to middle, metres, as planned and as claimed.
const SEPARATION_M: f64 = 1.2;
/// Side of the square in which the vehicles drive, metres.
const FIELD_M: f64 = 9.0;
const TICK_S: f64 = 1.0;
/// Plans are said again after so many ticks.
const REPEAT: u64 = 5;
const MOST_TICKS: u64 = 1500;

/// What is broken on purpose, to see that the judge notices.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Fault {
    None,
    /// Every stop forgets what it waits for.
    NoAfter,
    /// Every other `after` is forgotten.
    HalfAfter,
    /// Everyone is made to believe that all others follow the newest revision.
    NoBarrier,
    /// A plan is adopted from anywhere.
    NoTolerance,
    /// A restarted vehicle believes that it has just adopted an empty revision.
    NoStopFirst,
}

/// splitmix64: a pure sequence of a seed.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, count: u64) -> u64 {
        self.roll() % count
    }

    fn chance(&mut self, percent: u64) -> bool {
        self.below(100) < percent
    }

    fn metres(&mut self) -> f64 {
        self.below(10_001) as f64 * 1e-4 * FIELD_M
    }

    /// Returns a point of whole millimetres, as points of plans are.
    fn point(&mut self) -> Point {
        Position::from(Point::new(self.metres(), self.metres())).into()
    }
}

struct Body {
    follower: Follower,
    at: Point,
    /// What is left to drive: points, and the stop that each ends at, if it is one.
    way: Vec<(Point, Option<StopId>)>,
    stalled_until: u64,
    speed_mps: f64,
    held: bool,
    /// Restarting: it stands, hears nothing and says nothing.
    off_until: u64,
}

/// A message on its way: when it comes, to whom, and what.
enum Letter {
    Plan(usize, usize),
    Progress(usize, VehicleProgress),
    ToGround(VehicleProgress),
}

struct World {
    dice: Dice,
    fault: Fault,
    bodies: Vec<Body>,
    ground: Succession,
    /// All plans ever published; letters name them by index.
    published: Vec<Plan>,
    current: Vec<usize>,
    post: BTreeMap<u64, Vec<Letter>>,
    tick: u64,
    replans_left: u64,
    restarts_left: u64,
    begun: u64,
    moves: u64,
    closest_m: f64,
}

/// Plans from where the vehicles rest: random moves that can be driven one at a time.
fn random_plans(dice: &mut Dice, rests: &[Point], moves: u64) -> Vec<Plan> {
    let members: Vec<VehicleId> = (0..rests.len()).map(vehicle).collect();
    let mut places = rests.to_vec();
    let mut sequence = Vec::new();
    let mut plans: Vec<Plan> = rests
        .iter()
        .zip(&members)
        .map(|(rest, member)| Plan {
            vehicle: *member,
            run: RunId(1),
            revision: Revision(0),
            members: members.clone(),
            start: (*rest).into(),
            ..Plan::default()
        })
        .collect();
    for number in 0..moves {
        let mover = dice.below(rests.len() as u64) as usize;
        let mut points = vec![places[mover]];
        if dice.chance(40) {
            points.push(dice.point());
        }
        // Going back to the start makes a restarted vehicle stand where its plan begins.
        let to = if dice.chance(20) {
            rests[mover]
        } else {
            dice.point()
        };
        points.push(to);
        let track = Track::new(points.clone()).unwrap();
        let clear = |(other, place): (usize, &Point)| {
            other == mover || track.distance_to_point(*place) >= SEPARATION_M + 1e-6
        };
        if !places.iter().enumerate().all(clear) {
            continue;
        }
        places[mover] = to;
        sequence.push(members[mover]);
        let dwell_ms = if dice.chance(25) { 1500 } else { 0 };
        plans[mover].stops.push(Stop {
            id: StopId(number as u32),
            at: to.into(),
            route: points[1..points.len() - 1]
                .iter()
                .map(|p| Position::from(*p))
                .collect(),
            dwell_ms,
            dwell_limit_ms: 4000,
            partners: vec![members[dice.below(rests.len() as u64) as usize]],
            after: Vec::new(),
        });
    }
    order_legs(&mut plans, &sequence, SEPARATION_M).expect("feasible by construction");
    plans
}

fn vehicle(index: usize) -> VehicleId {
    VehicleId(index as u8 + 1)
}

impl World {
    fn new(seed: u64, fault: Fault) -> World {
        let mut dice = Dice(seed);
        let count = 2 + dice.below(5) as usize;
        let mut rests: Vec<Point> = Vec::new();
        while rests.len() < count {
            let place = dice.point();
            if rests
                .iter()
                .all(|other| other.distance_to(place) >= SEPARATION_M + 1e-6)
            {
                rests.push(place);
            }
        }
        let members: Vec<VehicleId> = (0..count).map(vehicle).collect();
        let body = |(index, at): (usize, &Point)| Body {
            follower: Follower::new(
                vehicle(index),
                *at,
                if fault == Fault::NoTolerance {
                    1e6
                } else {
                    1e-3
                },
            ),
            at: *at,
            way: Vec::new(),
            stalled_until: 0,
            speed_mps: 1.0,
            held: false,
            off_until: 0,
        };
        let replans_left = dice.below(4);
        let restarts_left = dice.below(5).saturating_sub(2);
        let mut world = World {
            bodies: rests.iter().enumerate().map(body).collect(),
            moves: 3 + dice.below(12),
            dice,
            fault,
            ground: Succession::new(RunId(1), &members, Revision(0)),
            published: Vec::new(),
            current: Vec::new(),
            post: BTreeMap::new(),
            tick: 0,
            replans_left,
            restarts_left,
            begun: 0,
            closest_m: f64::INFINITY,
        };
        world.ground.stop();
        world.publish();
        world
    }

    fn begin(&mut self, rests: &[Point]) {
        let mut plans = random_plans(&mut self.dice, rests, self.moves);
        check_separation(&plans, SEPARATION_M).expect("derived precedence keeps everyone apart");
        for (number, stop) in plans
            .iter_mut()
            .flat_map(|plan| &mut plan.stops)
            .enumerate()
        {
            match self.fault {
                Fault::NoAfter => stop.after.clear(),
                Fault::HalfAfter if number % 2 == 0 => stop.after.clear(),
                Fault::HalfAfter
                | Fault::None
                | Fault::NoBarrier
                | Fault::NoTolerance
                | Fault::NoStopFirst => {}
            }
        }
        self.ground.begin(plans).expect("valid plans");
        self.begun += 1;
        self.publish();
    }

    fn publish(&mut self) {
        let first = self.published.len();
        self.published.extend_from_slice(self.ground.plans());
        self.current = (first..self.published.len()).collect();
        self.send_plans();
    }

    fn send_plans(&mut self) {
        for plan in self.current.clone() {
            for to in 0..self.bodies.len() {
                self.send(|| Letter::Plan(to, plan));
            }
        }
    }

    /// Loses some letters, doubles some, and delays all by different spans, so that they overtake.
    fn send(&mut self, letter: impl Fn() -> Letter) {
        if self.dice.chance(25) {
            return;
        }
        let copies = if self.dice.chance(10) { 2 } else { 1 };
        for _ in 0..copies {
            let long = self.dice.chance(5);
            let delay = 1 + self.dice.below(if long { 40 } else { 4 });
            self.post
                .entry(self.tick + delay)
                .or_default()
                .push(letter());
        }
    }

    fn now(&self) -> Time {
        Time::from_secs_f64(self.tick as f64 * TICK_S)
    }

    fn deliver(&mut self) {
        let now = self.now();
        for letter in self.post.remove(&self.tick).unwrap_or_default() {
            match letter {
                Letter::Plan(to, _) | Letter::Progress(to, _)
                    if self.tick < self.bodies[to].off_until => {}
                Letter::Plan(to, plan) => {
                    self.bodies[to].follower.offer(&self.published[plan]);
                }
                Letter::Progress(to, progress) => self.bodies[to].follower.hear(now, &progress),
                Letter::ToGround(progress) => self.ground.hear(&progress),
            }
        }
        if self.fault == Fault::NoBarrier {
            for body in &mut self.bodies {
                let revision = body.follower.progress().revision;
                for plan in self.current.iter().map(|index| &self.published[*index]) {
                    let lie = VehicleProgress {
                        vehicle: plan.vehicle,
                        run: RunId(1),
                        revision,
                        ..VehicleProgress::default()
                    };
                    body.follower.hear(now, &lie);
                }
            }
        }
    }

    /// Restarts a vehicle where it stands; it forgets everything, for longer than any letter takes.
    fn restart(&mut self) {
        if self.restarts_left == 0 || !self.dice.chance(3) {
            return;
        }
        self.restarts_left -= 1;
        let index = self.dice.below(self.bodies.len() as u64) as usize;
        let body = &mut self.bodies[index];
        body.follower = Follower::new(vehicle(index), body.at, 1e-3);
        body.way.clear();
        body.held = false;
        body.off_until = self.tick + 45;
        if self.fault == Fault::NoStopFirst {
            let stale = self
                .published
                .iter()
                .take_while(|plan| plan.revision == self.published[0].revision);
            for plan in stale {
                body.follower.offer(plan);
            }
        }
    }

    /// Lets one vehicle decide: go on, pass through, stop; as a mission would.
    fn decide(&mut self, index: usize) {
        let now = self.now();
        let (stall, slow) = (self.dice.chance(6), self.dice.below(100));
        let span = 1 + self.dice.below(12);
        let eager = self.dice.chance(50);
        let body = &mut self.bodies[index];
        body.follower.wake(now);
        if stall {
            body.stalled_until = self.tick + span;
        }
        body.speed_mps = 0.3 + 0.02 * slow as f64;
        let newer = matches!(body.follower.waits_for(), Some(WaitsFor::Revision { .. }));
        if body.held || (newer && !body.way.is_empty() && self.tick < body.stalled_until) {
            body.held = !body.follower.hold(body.at) && newer;
            if body.follower.entered().is_empty() {
                body.way.clear();
            }
            if !body.held {
                body.follower.resume();
            }
        }
        let ahead = if eager { 3 } else { 1 };
        while body.follower.entered().len() < ahead {
            let Some(stop) = body.follower.next_leg().cloned() else {
                break;
            };
            body.follower.enter(stop.id).expect("it was offered");
            body.way
                .extend(stop.route.iter().map(|corner| (Point::from(*corner), None)));
            body.way.push((stop.at.into(), Some(stop.id)));
        }
    }

    /// Drives every vehicle for one tick: straight, at most to the next corner or stop.
    fn drive(&mut self) {
        let from: Vec<Point> = self.bodies.iter().map(|body| body.at).collect();
        let now = self.now();
        for body in &mut self.bodies {
            if body.held || self.tick < body.stalled_until {
                continue;
            }
            if self.tick < body.off_until {
                continue;
            }
            let Some(&(to, stop)) = body.way.first() else {
                continue;
            };
            let (left_m, step_m) = (body.at.distance_to(to), body.speed_mps * TICK_S);
            if step_m < left_m {
                body.at = body.at.toward(to, step_m / left_m);
                continue;
            }
            body.at = to;
            body.way.remove(0);
            if let Some(stop) = stop {
                body.follower
                    .arrive(now, stop, to)
                    .expect("the stop driven to");
            }
        }
        for (one, other) in (0..from.len()).flat_map(|a| (0..a).map(move |b| (a, b))) {
            let closest = closest_m(
                (from[one], self.bodies[one].at),
                (from[other], self.bodies[other].at),
            );
            self.closest_m = self.closest_m.min(closest);
        }
    }

    fn talk(&mut self) {
        for from in 0..self.bodies.len() {
            if self.tick < self.bodies[from].off_until {
                continue;
            }
            let progress = self.bodies[from].follower.progress();
            for to in (0..self.bodies.len()).filter(|to| *to != from) {
                self.send(|| Letter::Progress(to, progress));
            }
            self.send(|| Letter::ToGround(progress));
        }
        if self.tick.is_multiple_of(REPEAT) {
            self.send_plans();
        }
    }

    /// The ground plans anew at random moments: directly from where it believes that everyone will
    /// rest next, which may be wrong by the time it is heard, or after an empty revision.
    fn replan(&mut self) {
        match self.ground.phase() {
            RevisionPhase::Stopped => {
                let rests: Vec<Point> = self.bodies.iter().map(|body| body.at).collect();
                self.begin(&rests);
            }
            RevisionPhase::Driving if self.replans_left > 0 && self.dice.chance(5) => {
                self.replans_left -= 1;
                let end = |body: &Body| {
                    body.follower
                        .entered()
                        .last()
                        .map_or(body.at, |stop| stop.at.into())
                };
                let rests: Vec<Point> = self.bodies.iter().map(end).collect();
                let apart = (0..rests.len())
                    .all(|a| (0..a).all(|b| rests[a].distance_to(rests[b]) >= SEPARATION_M + 1e-6));
                if apart && self.dice.chance(60) {
                    self.begin(&rests);
                } else {
                    self.ground.stop();
                    self.publish();
                }
            }
            RevisionPhase::Driving => {
                let refused = self
                    .bodies
                    .iter()
                    .any(|body| body.follower.refusal().is_some());
                if refused && self.dice.chance(10) {
                    self.ground.stop();
                    self.publish();
                }
            }
            RevisionPhase::Resting | RevisionPhase::Stopping => {}
        }
    }

    fn run(mut self) -> Outcome {
        while self.tick < MOST_TICKS && self.closest_m >= SEPARATION_M - 1e-6 {
            self.tick += 1;
            self.deliver();
            self.restart();
            for index in 0..self.bodies.len() {
                if self.tick >= self.bodies[index].off_until {
                    self.decide(index);
                }
            }
            self.drive();
            self.talk();
            let newest = self.ground.plans()[0].revision;
            let ended = |body: &Body| {
                body.follower.finished() && body.follower.progress().revision == newest
            };
            if self.ground.phase() == RevisionPhase::Driving && self.bodies.iter().all(ended) {
                return Outcome {
                    finished: true,
                    closest_m: self.closest_m,
                    plans: self.begun,
                    ticks: self.tick,
                };
            }
            self.replan();
        }
        Outcome {
            finished: false,
            closest_m: self.closest_m,
            plans: self.begun,
            ticks: self.tick,
        }
    }
}

struct Outcome {
    finished: bool,
    closest_m: f64,
    plans: u64,
    ticks: u64,
}

/// The closest approach of two steady straight motions over the same time, metres.
fn closest_m(one: (Point, Point), other: (Point, Point)) -> f64 {
    let apart = one.0 - other.0;
    let drift = (one.1 - other.1) - apart;
    let square = drift.dot(drift);
    let share = if square > 0.0 {
        (-apart.dot(drift) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (apart + drift * share).length_m()
}

fn collisions(seeds: std::ops::Range<u64>, fault: Fault) -> usize {
    let outcomes = seeds.map(|seed| World::new(seed, fault).run());
    outcomes
        .filter(|outcome| outcome.closest_m < SEPARATION_M - 1e-6)
        .count()
}

#[test]
fn ten_thousand_random_plans_end_without_collision_or_deadlock() {
    let (mut plans, mut ticks, mut longest) = (0, 0, 0);
    for seed in 0..5000 {
        let outcome = World::new(seed, Fault::None).run();
        assert!(
            outcome.closest_m >= SEPARATION_M - 1e-6,
            "seed {seed}: {} m",
            outcome.closest_m
        );
        assert!(
            outcome.finished,
            "seed {seed}: not finished after {} ticks",
            outcome.ticks
        );
        plans += outcome.plans;
        ticks += outcome.ticks;
        longest = longest.max(outcome.ticks);
    }
    println!("{plans} sets of plans, {ticks} ticks, longest {longest}");
    assert!(plans >= 10_000, "{plans} sets of plans");
}

#[test]
fn forgotten_precedence_is_noticed_as_a_collision() {
    assert!(collisions(0..100, Fault::NoAfter) > 10);
    assert!(collisions(0..200, Fault::HalfAfter) > 5);
}

#[test]
fn a_forgotten_barrier_is_noticed_as_a_collision() {
    assert!(collisions(0..600, Fault::NoBarrier) > 0);
}

#[test]
fn a_plan_from_elsewhere_is_noticed_as_a_collision() {
    assert!(collisions(0..300, Fault::NoTolerance) > 0);
}

#[test]
fn a_restart_that_begins_its_plan_again_is_noticed_as_a_collision() {
    assert!(collisions(0..3000, Fault::NoStopFirst) > 0);
}
