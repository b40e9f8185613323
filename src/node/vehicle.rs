//! The vehicle actor: the last word before the autopilot, and the first to know where the vehicle is.
//!
//! It is told telemetry, scans, commands of the mission, orders and the peers' states. It says what to
//! fly, its own `State`, accepted orders, and remarks. It checks every command against the envelope
//! (a fresh and certain pose, a finite route that begins here, the fence, the peers, what made the reflex halt) and
//! always drives at the configured speed. It judges the age of orders and of commands. Off plan, where no order of
//! precedence protects it, it also yields: it stops as soon as a peer that moves claims what lies ahead. It has the
//! *reflex*: a scan nearer than the stopping distance halts the
//! vehicle without map, plan or network. It stops as soon as it no longer knows where it is. It does not plan and does not
//! know the map.
//!
//! Orders to stop are enforced here, not by the mission: an order to hold, to land or to return brakes at once, what the
//! mission had decided before it is not driven any more, and nothing is driven while an order to hold or to land stands.
//! After an emergency, or an order to land, a rover holds at once and is disarmed as soon as it rests; cutting the
//! motors disarms it at once. A start arms it again. A stop and a disarming are said again until telemetry shows them.
//!
//! ```text
//!            Drive/Turn accepted          telemetry: at rest
//!   Idle ───────────────────────► Driving/Turning ─────────► Idle
//!                                     │ reflex                 ▲
//!                                     ▼        next command    │
//!                                   Halted ────────────────────┘        any ─Emergency─► Emergency ─Start─► Idle
//! ```
//!
//! Deadline: `telemetry silent`.

mod envelope;
mod orders;
mod rest;
mod words;

use std::collections::VecDeque;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{LegReport, Mode, Order, OrderKind, Ordered, Revision, RunId, State, VehicleId};

use super::Settings;
use super::ages::Ages;
use super::peers::{Peers, join_states};
use super::radio::Sighting;
use super::sensor::Scan;
use crate::actor::{Actor, Class, Fault, Input};
use crate::geom::{Point, Segment};
use crate::time::{Deadline, Time};

pub use orders::join_orders;
pub use words::{Bump, Command, Fly, Motion, Refusal, Remark, Telemetry};

/// Telemetry older than this makes the autopilot silent.
const SILENT_AFTER: Duration = Duration::from_secs(2);
/// States are published this often while the mode stays the same.
const PUBLISH_EVERY: Duration = Duration::from_millis(200);
/// Time from an echo to brakes that bite.
const REACTION_S: f64 = 0.15;
/// What the reflex leaves between the body and an object, metres.
const REFLEX_MARGIN_M: f64 = 0.1;
/// What made the reflex halt is kept clear of for this long, even if the map does not show it.
const BUMP_FOR: Duration = Duration::from_secs(60);
/// After this long a resting autopilot has ended the drive that it was told.
const REST_GRACE: Duration = Duration::from_millis(300);

/// What the vehicle actor can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// Pose and motion.
    Telemetry(Telemetry),
    /// A range reading.
    Scan(Scan),
    /// What the mission wants, and when it decided that.
    Command(Time, Command),
    /// Whether the mission stands still on its own until something changes.
    Holds(bool),
    /// What an operator wants.
    Order(Order),
    /// The state of another vehicle.
    Peer(State),
    /// What a beacon tells of another vehicle.
    Sighted(Sighting),
    /// The mission follows this plan now.
    Accepted(RunId, Revision),
}

/// What the vehicle actor can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// To the autopilot.
    Fly(Fly),
    /// To the other actors of this vehicle, with every telemetry.
    State(State),
    /// To the other nodes, less often.
    Publish(State),
    /// An order that is to be obeyed.
    Order(Order),
    /// Something that mission and operator should know.
    Remark(Remark),
}

/// The vehicle actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Vehicle {
    settings: Settings,
    telemetry: Option<(Time, Telemetry)>,
    leg: Option<Leg>,
    halted: bool,
    /// An order to hold or to land stands.
    held: bool,
    /// The mission stands still on its own.
    holds: bool,
    emergency: bool,
    /// Since when it is to be disarmed as soon as it rests.
    disarm_since: Option<Time>,
    is_disarmed: bool,
    /// When it was told to stop last; `None` once it was told to move.
    stop_said: Option<Time>,
    disarm_said: Option<Time>,
    /// When the last order to stop, or to return, was obeyed: what was decided before it is not driven.
    stopped_by_order: Time,
    accepted: (RunId, Revision),
    ordered: Ordered,
    sequence: u64,
    /// When recent states were made, to judge the age of orders by.
    made: Ages,
    published: Option<(Time, Mode)>,
    peers: Peers,
    bumps: Vec<Bump>,
    silent_reported: bool,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Leg {
    since: Time,
    /// It leads to no stop: nobody's plan says who goes first.
    is_off_plan: bool,
    corners: VecDeque<Point>,
}

impl Vehicle {
    /// Makes the actor of a vehicle that has not yet heard its autopilot.
    pub fn new(settings: Settings) -> Vehicle {
        Vehicle {
            peers: Peers::new(settings.vehicle),
            settings,
            telemetry: None,
            leg: None,
            halted: false,
            held: false,
            holds: false,
            emergency: false,
            disarm_since: None,
            is_disarmed: false,
            stop_said: None,
            disarm_said: None,
            stopped_by_order: Time::ZERO,
            accepted: Default::default(),
            ordered: Default::default(),
            sequence: 0,
            made: Ages::default(),
            published: None,
            bumps: Vec::new(),
            silent_reported: false,
        }
    }

    fn telemetry(&mut self, now: Time, telemetry: Telemetry, out: &mut Vec<Out>) {
        self.telemetry = Some((now, telemetry));
        self.silent_reported = false;
        self.trim_leg(now, telemetry);
        self.stop_when_lost(now, telemetry, out);
        self.disarm_at_rest(now, telemetry, out);
        self.say_again(now, telemetry, out);
        self.sequence += 1;
        self.made.note(now, self.sequence);
        let state = self.state(telemetry);
        let due =
            self.published.is_none_or(|(at, mode)| mode != state.mode || now.since(at) >= PUBLISH_EVERY);
        if due {
            self.published = Some((now, state.mode));
            out.push(Out::Publish(state.clone()));
        }
        out.push(Out::State(state));
    }

    /// Who no longer knows where it is does not drive on; said once.
    fn stop_when_lost(&mut self, now: Time, telemetry: Telemetry, out: &mut Vec<Out>) {
        let is_lost = telemetry.pose.sd_m > self.settings.swarm.pose_sd_max_m;
        if is_lost && telemetry.motion == Motion::Driving && self.stop_said.is_none() {
            self.stop(now, out);
            out.push(Out::Remark(Remark::Refused(Refusal::PoseUncertain)));
        }
    }

    /// Drops what was driven of the leg, and the leg itself once the vehicle rests.
    fn trim_leg(&mut self, now: Time, telemetry: Telemetry) {
        let Some(leg) = &mut self.leg else { return };
        while leg.corners.len() > 1 {
            let piece = Segment::new(leg.corners[0], leg.corners[1]);
            if piece.nearest_share(telemetry.pose.at) <= 0.0 {
                break;
            }
            leg.corners.pop_front();
        }
        if telemetry.motion == Motion::Resting && now.since(leg.since) > REST_GRACE {
            self.leg = None;
        }
    }

    fn state(&self, telemetry: Telemetry) -> State {
        let remaining = |leg: &Leg| {
            let route = std::iter::once(telemetry.pose.at).chain(leg.corners.iter().copied());
            LegReport { route: route.map(Into::into).collect() }
        };
        State {
            vehicle: self.settings.vehicle,
            boot: self.settings.boot,
            sequence: self.sequence,
            pose: telemetry.pose.into(),
            speed_mps: telemetry.speed_mps,
            mode: self.mode(telemetry),
            battery: telemetry.battery,
            leg: self.leg.as_ref().map(remaining),
            accepted: self.accepted,
            ordered: self.ordered,
        }
    }

    fn mode(&self, telemetry: Telemetry) -> Mode {
        if self.emergency {
            return Mode::Emergency;
        }
        match telemetry.motion {
            Motion::Driving => Mode::Driving,
            Motion::Turning => Mode::Turning,
            Motion::Resting if self.held || self.holds => Mode::Held,
            Motion::Resting if self.halted => Mode::Halted,
            Motion::Resting => Mode::Idle,
        }
    }

    fn command(&mut self, now: Time, decided: Time, command: Command, out: &mut Vec<Out>) {
        if let Err(refusal) = self.check(now, decided, &command) {
            out.push(Out::Remark(Remark::Refused(refusal)));
            return;
        }
        match command {
            Command::Drive { stop, route } => {
                (self.halted, self.stop_said) = (false, None);
                let corners: Vec<Point> = route.into_iter().skip(1).collect();
                let ahead = corners.iter().copied().collect();
                self.leg = Some(Leg { since: now, is_off_plan: stop.is_none(), corners: ahead });
                out.push(Out::Fly(Fly::Drive { corners, speed_mps: self.settings.body.speed_mps }));
            }
            Command::Turn(heading) => {
                (self.halted, self.stop_said) = (false, None);
                out.push(Out::Fly(Fly::Turn(heading)));
            }
            Command::Hold => self.stop(now, out),
        }
    }

    /// The reflex: halts when a reading in the driven strip is nearer than the vehicle can stop, or than the closeness that
    /// it was told.
    fn scan(&mut self, now: Time, scan: &Scan, out: &mut Vec<Out>) {
        let Some((_, telemetry)) = self.telemetry else { return };
        if telemetry.motion != Motion::Driving || self.halted {
            return;
        }
        let Some(ahead_m) = self.ahead_m(scan) else { return };
        let speed = telemetry.speed_mps;
        let needs_m = speed * REACTION_S + speed * speed / (2.0 * self.settings.body.braking_mps2);
        let is_close = scan.range_m.is_some_and(|range_m| range_m < self.settings.safety.closeness_m);
        if is_close || ahead_m < needs_m + REFLEX_MARGIN_M {
            self.stop(now, out);
            self.halted = true;
            let bump = self.bump(now, scan);
            self.bumps.retain(|known| known.until > now);
            self.bumps.push(bump);
            out.push(Out::Remark(Remark::Halted { ahead_m, bump }));
        }
    }

    fn bump(&self, now: Time, scan: &Scan) -> Bump {
        let range_m = scan.range_m.unwrap_or_default();
        let at = scan.pose.at + crate::geom::Vector::polar(scan.pose.heading + scan.beam, range_m);
        let spread_m = range_m * libm::sin(self.settings.look.half_angle.radians());
        let keep_m = self.settings.body.radius_m + REFLEX_MARGIN_M + spread_m;
        Bump { at, keep_m, until: now + BUMP_FOR }
    }

    /// Gives how far ahead of the body an echo may come from; `None` when it lies beside the strip.
    fn ahead_m(&self, scan: &Scan) -> Option<f64> {
        let range_m = scan.range_m?;
        let off_axis_rad = (scan.beam.radians().abs() - self.settings.look.half_angle.radians()).max(0.0);
        let (sin, cos) = libm::sincos(off_axis_rad);
        let strip_m = self.settings.body.radius_m + REFLEX_MARGIN_M;
        (range_m * sin <= strip_m).then_some(range_m * cos - self.settings.body.radius_m)
    }

    fn order(&mut self, now: Time, order: Order, out: &mut Vec<Out>) {
        let newer = (order.lease, order.revision) > self.ordered.edition();
        if order.vehicle != self.settings.vehicle || !newer || self.is_stale(now, order) {
            return;
        }
        let Order { lease, revision, run, kind, .. } = order;
        self.ordered = Ordered { lease, revision, run, kind: Some(kind) };
        if kind != OrderKind::Start {
            self.stopped_by_order = now;
            self.stop(now, out);
        }
        match kind {
            OrderKind::Emergency => {
                self.emergency = true;
                self.disarm_since = Some(now);
            }
            OrderKind::CutMotors => {
                self.emergency = true;
                self.disarm(now, out);
            }
            OrderKind::Start => {
                (self.emergency, self.held) = (false, false);
                self.arm(out);
            }
            OrderKind::Hold => self.held = true,
            OrderKind::Land => {
                self.held = true;
                self.disarm_since = Some(now);
            }
            OrderKind::Return => {
                self.held = false;
                if !self.emergency {
                    self.arm(out);
                }
            }
        }
        out.push(Out::Order(order));
    }

    /// An order is stale when it answers a state that was made too long ago; stopping is never stale.
    fn is_stale(&self, now: Time, order: Order) -> bool {
        match order.kind {
            OrderKind::Hold | OrderKind::Emergency | OrderKind::Land | OrderKind::CutMotors => false,
            OrderKind::Start | OrderKind::Return => !self.made.is_fresh(now, order.seen_state),
        }
    }
}

impl Actor for Vehicle {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Telemetry(telemetry) => self.telemetry(now, telemetry, out),
            In::Scan(scan) => self.scan(now, &scan, out),
            In::Command(decided, command) => self.command(now, decided, command, out),
            In::Holds(holds) => self.holds = holds,
            In::Order(order) => self.order(now, order, out),
            In::Peer(state) => {
                self.peers.take(now, &state);
                self.yield_to(now, state.vehicle, out);
            }
            In::Sighted(sighting) => {
                self.peers.sight(now, &sighting);
                self.yield_to(now, sighting.progress.vehicle, out);
            }
            In::Accepted(run, revision) => self.accepted = (run, revision),
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let (at, _) = self.telemetry?;
        (!self.silent_reported).then_some(Deadline { at: at + SILENT_AFTER, why: "telemetry silent" })
    }

    fn wake(&mut self, _now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.silent_reported = true;
        out.push(Out::Remark(Remark::AutopilotSilent));
        Ok(())
    }
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// Telemetry of the own autopilot.
    Telemetry,
    /// The mission's command.
    Command,
    /// Orders to one vehicle join by strength; those to others are not obeyed, and replace none to this one.
    Order(VehicleId),
    /// The state of one peer.
    Peer(VehicleId),
    /// The beacon of one peer.
    Sighted(VehicleId),
    /// The accepted plan.
    Accepted,
    /// Whether the mission holds.
    Holds,
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> Class<Key> {
        match self {
            In::Telemetry(_) => Class::Latest(Key::Telemetry),
            In::Scan(_) => Class::Queue,
            In::Command(..) => Class::Latest(Key::Command),
            In::Holds(_) => Class::Latest(Key::Holds),
            In::Order(order) => Class::Latest(Key::Order(order.vehicle)),
            In::Peer(state) => Class::Latest(Key::Peer(state.vehicle)),
            In::Sighted(sighting) => Class::Latest(Key::Sighted(sighting.progress.vehicle)),
            In::Accepted(..) => Class::Latest(Key::Accepted),
        }
    }

    fn join(unread: In, newer: In) -> In {
        match (unread, newer) {
            (In::Order(unread), In::Order(newer)) => In::Order(join_orders(unread, newer)),
            (In::Peer(unread), In::Peer(newer)) => In::Peer(join_states(unread, newer)),
            (_, newer) => newer,
        }
    }
}

#[cfg(test)]
mod tests;
