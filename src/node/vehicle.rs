//! The vehicle actor: the last word before the autopilot, and the first to know where the vehicle is.
//!
//! It is told telemetry, who steers, scans, commands of the mission, orders, the peers' states and what the disk has. It
//! says what the autopilot is to do, its own `State`, what is to be remembered, orders that are obeyed, and events. It
//! checks every command against the envelope (a fresh and certain pose, a finite route that begins here, the fence, the
//! peers, what made the reflex halt) and always drives at the configured speed. It judges the age of orders and of
//! commands. Off plan, where no order of precedence protects it, it also yields: it stops as soon as a peer that moves
//! claims what lies ahead, and on plan for a peer that somebody else steers. It has the *reflex*: a scan nearer than the
//! stopping distance halts the vehicle without map, plan or network. It stops as soon as it no longer knows where it is. It
//! does not plan and does not know the map.
//!
//! Orders to stop are enforced here, not by the mission: an order to hold, to land or to return brakes at once, what the
//! mission had decided before it is not driven any more, and nothing is driven while an order to hold or to land stands.
//! Under an open emergency stop (`emergency.rs`), or an order to land, a rover holds at once and is disarmed as soon as it
//! rests; cutting the motors disarms it at once. A start arms it again. A stop and a disarming are said again until telemetry
//! shows them. An order out must answer a state made after the stop, and counts once the vehicle has listened for
//! every open stop (`readiness.rs`).
//!
//! An order is shown, handed on and, where it frees, obeyed once it is on the vehicle's disk; what stops or cuts the motors
//! does so at once, and is written then (`orders.rs`). So a vehicle that is started anew obeys nothing lower than it has
//! ever shown. It begins free all the same, and waits for a start.
//!
//! Seven machines run side by side; each has its file, which alone writes its fields. Two say what orders leave standing and
//! what the vehicle was told to do. The others are drawn in their files: what emergency stops do (`emergency.rs`), whether
//! somebody else has taken over (`take_over.rs`), how far a disarming has come (`disarming.rs`), whether enough was heard to
//! begin (`readiness.rs`), and whether the autopilot is heard (`last_telemetry.rs`).
//!
//! What orders leave standing (`restraint.rs`), at first nothing; a weaker order leads no way back:
//!
//! ```text
//!   [Free] ──Hold──► [Held] ──Land──► [Landing] ──CutMotors──► [MotorsCut]
//!     ▲ └── Hold, Land, CutMotors: from any to the one that they lead to here, if it lies to the right
//!     └──── Start from any, Return from any but MotorsCut
//! ```
//!
//! What the vehicle was told about moving (`movement.rs`), at first nothing. An accepted command and a stop lead from any
//! state; a stop is an order, a `Hold` of the mission, a place lost, or a peer that is yielded to:
//!
//! ```text
//!   any ──Drive──► [Driving] ──at rest──► [Idle]
//!   any ──Turn───► [Turning] ──at rest──► [Idle]
//!   any ──FollowStored─► [FollowingStored] ──its mission over or failed, and at rest──► [Idle]
//!   any ──stop───► [Stopped]                        but what the reflex has halted stays so
//!   any ──reflex─► [Halted]                         when telemetry shows driving
//!   any ──taken over─► [Idle]                       by remote control, or by the autopilot itself
//! ```
//!
//! A vehicle under a restraint accepts neither Drive nor Turn: it leaves Stopped and Halted only when it is free again.
//!
//! Deadline: `telemetry silent`.

mod braking;
mod disarming;
mod drift;
mod emergency;
mod envelope;
mod last_telemetry;
mod messages;
mod movement;
mod orders;
mod readiness;
mod reflex;
mod report;
mod restraint;
mod stored_way;
mod take_over;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Control, EmergencyStop, Order, OrderKind, Ordered, Revision, RunId, Sender, StandReason, State,
    VehicleId,
};

use self::drift::Drift;
use self::emergency::Emergency;
use self::last_telemetry::LastTelemetry;
use self::movement::MovementOrder;
use self::orders::{Accepted, Orders};
use self::readiness::Readiness;
use self::reflex::Reflex;
use self::report::Reports;
use self::take_over::TakeOver;
use super::memory::{Remembered, VehicleMemory};
use super::peers::{Peers, join_states};
use super::radio::BeaconReport;
use super::sensor::Scan;
use super::{OwnState, VehicleSettings};
use crate::actor::{Actor, Fault, Input, InputClass};
use crate::autopilot::{ControlStatus, RemoteSwitch};
use crate::geom::{Point, Track};
use crate::stops::first_that_stops;
use crate::time::{Deadline, Time};

pub use messages::{
    AutopilotCommand, CommandRefusal, Motion, MoveCommand, ReflexObstacle, SafetyEvent, Telemetry,
};
pub use orders::join_orders;

/// What the vehicle actor can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// Pose and motion.
    Telemetry(Telemetry),
    /// Who steers, and whether it is on the ground; told when it changes.
    Autopilot(ControlStatus),
    /// A range reading.
    Scan(Scan),
    /// What the mission wants, and when it decided that.
    Command(Time, MoveCommand),
    /// Why the mission stands still on its own until something changes, if it does.
    Holds(Option<StandReason>),
    /// What an operator or the ground station wants.
    Order(Sender, Order),
    /// Which emergency stops are open.
    Stops(Vec<EmergencyStop>),
    /// A node has told which emergency stops are open.
    StopsReported(Sender),
    /// The state of another vehicle.
    Peer(State),
    /// What a beacon tells of another vehicle.
    Sighted(BeaconReport),
    /// A ground station expects these vehicles.
    Expected(Vec<VehicleId>),
    /// The mission follows this plan now.
    Accepted(RunId, Revision),
    /// How it stands with what was to be remembered.
    Remembered(Remembered),
}

/// What the vehicle actor can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// To the autopilot.
    AutopilotCommand(AutopilotCommand),
    /// To the other actors of this vehicle, with every telemetry.
    State(OwnState),
    /// To the other nodes, less often, as it travels.
    Publish(State),
    /// This is to be remembered. What follows from it is said when it is.
    Remember(VehicleMemory),
    /// An order that is to be obeyed.
    Order(Order),
    /// Something that mission and operator should know.
    SafetyEvent(SafetyEvent),
}

/// The vehicle actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Vehicle {
    settings: VehicleSettings,
    telemetry: LastTelemetry,
    autopilot: ControlStatus,
    movement: MovementOrder,
    drift: Drift,
    orders: Orders,
    emergency: Emergency,
    take_over: TakeOver,
    readiness: Readiness,
    reflex: Reflex,
    peers: Peers,
    reports: Reports,
}

impl Vehicle {
    /// Makes the actor of a vehicle that has not yet heard its autopilot.
    pub fn new(settings: VehicleSettings) -> Vehicle {
        let mut emergency = Emergency::default();
        emergency.take(
            Time::ZERO,
            first_that_stops(&settings.stops.open, settings.vehicle),
        );
        Vehicle {
            peers: Peers::new(settings.vehicle),
            orders: Orders::remembering(settings.memory),
            emergency,
            take_over: TakeOver::default(),
            readiness: Readiness::default(),
            settings,
            telemetry: LastTelemetry::default(),
            autopilot: ControlStatus::default(),
            movement: MovementOrder::default(),
            drift: Drift::default(),
            reflex: Reflex::default(),
            reports: Reports::default(),
        }
    }

    fn telemetry(&mut self, now: Time, telemetry: Telemetry, out: &mut Vec<Out>) {
        self.telemetry.take(now, telemetry);
        if let Some(end) = self.movement.take(now, &telemetry) {
            let most_m = self.settings.carried_m;
            self.drift.learn(end, telemetry.pose.at, most_m);
        }
        self.stop_when_lost(now, &telemetry, out);
        self.stop_before_fence(now, &telemetry, out);
        if self.movement.is_stop_due_again(now, telemetry.motion) {
            self.stop(now, out);
        }
        let motors = self.orders.take(now, &telemetry);
        let disarms = self
            .emergency
            .disarms(now, &telemetry)
            .then_some(AutopilotCommand::Disarm);
        out.extend(motors.or(disarms).map(Out::AutopilotCommand));
        self.report(now, &telemetry, out);
    }

    /// Records who steers. Once somebody else steers, the old way is not claimed, and orders that answer an older state
    /// no longer send the vehicle out.
    fn autopilot(&mut self, now: Time, status: ControlStatus, out: &mut Vec<Out>) {
        let turned = status
            .switch
            .filter(|_| status.switch != self.autopilot.switch);
        self.autopilot = status;
        if let Some(switch) = turned {
            self.switch(now, switch, out);
        }
        if self.take_over.take(status.control) {
            self.orders.answer_from(now);
        }
        match status.control {
            Control::Remote => self.movement.let_go(),
            // It may have set out although it was to stand.
            Control::Own if self.is_held_back() => self.stop(now, out),
            Control::Own => self.movement.let_go(),
            Control::Ours => {}
            Control::Silent => self.report_silence(now, out),
        }
        self.reports.publish_next();
    }

    /// Does what a person beside the vehicle wants by the switch of the remote control: it stands at once, or goes home if
    /// nothing else holds it back. It moves on by a later start alone.
    fn switch(&mut self, now: Time, switch: RemoteSwitch, out: &mut Vec<Out>) {
        self.stop(now, out);
        out.push(Out::SafetyEvent(SafetyEvent::Switched(switch)));
        match switch {
            RemoteSwitch::Hold => self.orders.hold(now),
            RemoteSwitch::Return if self.emergency.stands() || self.take_over.stands() => {}
            RemoteSwitch::Return => {
                let (
                    motors,
                    Ordered {
                        lease,
                        revision,
                        run,
                        ..
                    },
                ) = self.orders.go_home(now);
                out.extend(motors.map(Out::AutopilotCommand));
                out.push(Out::Order(Order {
                    vehicle: self.settings.vehicle,
                    lease,
                    run,
                    revision,
                    seen: None,
                    kind: OrderKind::Return,
                    ends: Vec::new(),
                }));
            }
        }
    }

    /// Stops a vehicle that drives and no longer knows where it is; said once.
    fn stop_when_lost(&mut self, now: Time, telemetry: &Telemetry, out: &mut Vec<Out>) {
        let is_lost = telemetry.pose.sd_m > self.settings.swarm.pose_sd_max_m;
        if is_lost && telemetry.motion == Motion::Driving && !self.movement.is_stop() {
            self.stop(now, out);
            out.push(Out::SafetyEvent(SafetyEvent::Refused(
                CommandRefusal::PoseUncertain,
            )));
        }
    }

    /// Stops a vehicle whose place has become worse known on its way, when the rest of that keeps too little from the fence
    /// by now.
    fn stop_before_fence(&mut self, now: Time, telemetry: &Telemetry, out: &mut Vec<Out>) {
        let pose = telemetry.pose;
        if telemetry.motion != Motion::Driving || !self.settings.is_worse_known(pose) {
            return;
        }
        let route = self.movement.route_from(pose.at).and_then(Track::new);
        if route.is_some_and(|route| !self.stays_inside(&route, pose)) {
            self.stop(now, out);
            out.push(Out::SafetyEvent(SafetyEvent::Refused(
                CommandRefusal::Fence,
            )));
        }
    }

    fn command(&mut self, now: Time, decided: Time, command: MoveCommand, out: &mut Vec<Out>) {
        if let Err(refusal) = self.check(now, decided, &command) {
            out.push(Out::SafetyEvent(SafetyEvent::Refused(refusal)));
            if let CommandRefusal::Separation(peer) = refusal {
                self.stop_before(now, peer, out);
            }
            return;
        }
        match command {
            MoveCommand::Drive { is_off_plan, route } => {
                let Some(track) = Track::new(route) else {
                    return;
                };
                self.movement
                    .drive(now, is_off_plan, &track, self.braking(now));
                let corners: Vec<Point> = track.segments().map(|piece| piece.to).collect();
                out.push(Out::AutopilotCommand(AutopilotCommand::Drive {
                    corners: self.drift.corrected(&corners),
                    speed_mps: self.settings.body.speed_mps,
                }));
            }
            MoveCommand::Turn(heading) => {
                self.movement.turn(now);
                out.push(Out::AutopilotCommand(AutopilotCommand::Turn(heading)));
            }
            MoveCommand::FollowStored { items, from } => {
                self.movement
                    .follow_stored(now, &items, from, self.settings.home);
                out.push(Out::AutopilotCommand(AutopilotCommand::FollowStored {
                    items,
                    from,
                }));
            }
            MoveCommand::Hold => self.stop(now, out),
        }
    }

    fn scan(&mut self, now: Time, scan: &Scan, out: &mut Vec<Out>) {
        let halts_m = self.halts_for(scan);
        self.reflex.watch(now, &self.settings, scan);
        let Some(ahead_m) = halts_m else {
            return;
        };
        let obstacle = self
            .reflex
            .obstacle_of(&self.settings, &self.peers, now, scan);
        self.movement.halt(now, self.braking_end());
        self.reflex.remember(now, obstacle);
        out.push(Out::AutopilotCommand(AutopilotCommand::Stop));
        out.push(Out::SafetyEvent(SafetyEvent::Halted { ahead_m, obstacle }));
    }

    /// Returns how far ahead of the body a reading lies that the vehicle must halt for, metres.
    fn halts_for(&self, scan: &Scan) -> Option<f64> {
        let telemetry = self.telemetry.of_any_age()?;
        let (reflex, settings) = (&self.reflex, &self.settings);
        match telemetry.motion {
            Motion::Driving if self.movement.is_halted() => None,
            Motion::Driving => reflex.halts_for(settings, telemetry.speed_mps, scan),
            // What is so near that it would be halted for is not on the map, and it may not be looked at again in time.
            Motion::Turning if scan.suspect => {
                let heading = self.movement.sets_out_toward(scan.pose.at)?;
                let seen = Scan {
                    suspect: false,
                    ..scan.facing(heading)
                };
                reflex.halts_for(settings, settings.body.speed_mps, &seen)
            }
            Motion::Turning | Motion::Resting => None,
        }
    }

    fn order(&mut self, now: Time, sender: Sender, order: Order, out: &mut Vec<Out>) {
        let is_answer = self.reports.is_answer(
            now,
            self.settings.boot,
            order.seen,
            self.orders.answers_from(),
        );
        let is_own = order.vehicle == self.settings.vehicle;
        if !is_own
            || !self.orders.accepts(&order, is_answer)
            || !self.may_begin(now, sender, &order)
        {
            return;
        }
        if self.orders.awaits_disk(&order) {
            return self.orders.renew(order);
        }
        if orders::stops(order.kind) {
            self.stop(now, out);
        }
        let Accepted { motors, memory } = self.orders.accept(now, order);
        out.extend(motors.map(Out::AutopilotCommand));
        out.extend(memory.map(Out::Remember));
        self.obey(now, out);
    }

    /// Obeys the order that has waited for the disk, if it need not any more.
    fn obey(&mut self, now: Time, out: &mut Vec<Out>) {
        let (reports, boot, from) = (
            &self.reports,
            self.settings.boot,
            self.orders.answers_from(),
        );
        let is_answer = |order: &Order| reports.is_answer(now, boot, order.seen, from);
        let Some((order, motors)) = self.orders.obey(now, is_answer) else {
            return;
        };
        if order.kind == OrderKind::Start {
            self.emergency.start();
            out.extend(
                self.take_over
                    .end()
                    .then_some(Out::AutopilotCommand(AutopilotCommand::TakeBack)),
            );
        }
        out.extend(motors.map(Out::AutopilotCommand));
        out.push(Out::Order(order));
    }

    /// Returns whether an order may send the vehicle out, if that is what it does: neither an emergency stop nor somebody
    /// who has taken over stands in the way, and it has listened long enough.
    fn may_begin(&mut self, now: Time, sender: Sender, order: &Order) -> bool {
        match order.kind {
            OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors => true,
            OrderKind::Return => {
                !self.emergency.stands()
                    && !self.take_over.stands()
                    && self.autopilot.switch != Some(RemoteSwitch::Hold)
                    && self
                        .readiness
                        .look(now, self.settings.listens_for, &self.peers)
            }
            OrderKind::Start => {
                let is_of_operator = matches!(sender, Sender::Operator(_));
                let VehicleSettings { vehicle, boot, .. } = self.settings;
                self.emergency.lets_start(is_of_operator)
                    && self.autopilot.switch.is_none()
                    && self.take_over.lets_start(sender, order, vehicle, boot)
                    && self
                        .readiness
                        .look(now, self.settings.listens_for, &self.peers)
            }
        }
    }

    /// Records which emergency stops are open: it brakes at once for one, and for the lifting of all it does nothing.
    fn stops(&mut self, now: Time, open: &[EmergencyStop], out: &mut Vec<Out>) {
        let was_stopped = self.emergency.stop().is_some();
        if self
            .emergency
            .take(now, first_that_stops(open, self.settings.vehicle))
        {
            self.stop(now, out);
            self.orders.hold(now);
        } else if was_stopped && self.emergency.stop().is_none() {
            self.orders.answer_from(now);
        }
    }

    /// Returns whether an emergency stop or an order holds it back.
    fn is_held_back(&self) -> bool {
        self.emergency.stands() || self.orders.restraint().refusal().is_some()
    }

    fn stop(&mut self, now: Time, out: &mut Vec<Out>) {
        self.movement.stop(now, self.braking_end());
        out.push(Out::AutopilotCommand(AutopilotCommand::Stop));
    }
}

impl Actor for Vehicle {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Telemetry(telemetry) => self.telemetry(now, telemetry, out),
            In::Autopilot(status) => self.autopilot(now, status, out),
            In::Scan(scan) => {
                if let Some(aim) = self.settings.look.mounts.aim(scan.beam) {
                    self.reports.note_scan(now, aim.sensor);
                }
                self.scan(now, &scan, out);
            }
            In::Command(decided, command) => self.command(now, decided, command, out),
            In::Holds(holds) => self.reports.note_mission_holds(holds),
            In::Order(sender, order) => {
                self.readiness.hear(now);
                self.order(now, sender, order, out);
            }
            In::Stops(open) => self.stops(now, &open, out),
            In::StopsReported(by) => self.readiness.take_stops_reported(now, by),
            In::Peer(state) => {
                self.readiness.hear(now);
                self.peers.take(now, &state);
                self.yield_to(now, state.vehicle, out);
            }
            In::Sighted(sighting) => {
                // A beacon names a stop that is open, if there is one.
                self.readiness
                    .take_stops_reported(now, Sender::Vehicle(sighting.progress.vehicle));
                self.peers.sight(now, &sighting);
                self.yield_to(now, sighting.progress.vehicle, out);
            }
            In::Expected(vehicles) => self.peers.note_expected(now, &vehicles),
            In::Accepted(run, revision) => self.reports.note_accepted(run, revision),
            In::Remembered(remembered) => {
                self.orders.remembered(remembered);
                self.obey(now, out);
            }
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        self.telemetry.deadline()
    }

    fn wake(&mut self, _now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.telemetry.fall_silent();
        out.push(Out::SafetyEvent(SafetyEvent::AutopilotSilent));
        Ok(())
    }
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// Telemetry of the vehicle's autopilot.
    Telemetry,
    /// Who steers.
    Autopilot,
    /// The mission's command.
    Command,
    /// Orders to one vehicle join by strength; those to others are not obeyed, and replace none to this one.
    Order(VehicleId),
    /// The state of one peer.
    Peer(VehicleId),
    /// The beacon of one peer.
    Sighted(VehicleId),
    /// Whom a ground station expects.
    Expected,
    /// The accepted plan.
    Accepted,
    /// Whether the mission holds.
    Holds,
    /// How it stands with the disk.
    Remembered,
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> InputClass<Key> {
        match self {
            In::Telemetry(_) => InputClass::Latest(Key::Telemetry),
            In::Autopilot(_) => InputClass::Latest(Key::Autopilot),
            In::Scan(_) => InputClass::Queue,
            In::Command(..) => InputClass::Latest(Key::Command),
            In::Holds(_) => InputClass::Latest(Key::Holds),
            In::Order(_, order) => InputClass::Latest(Key::Order(order.vehicle)),
            In::Stops(_) | In::StopsReported(_) => InputClass::Queue,
            In::Peer(state) => InputClass::Latest(Key::Peer(state.vehicle)),
            In::Sighted(sighting) => InputClass::Latest(Key::Sighted(sighting.progress.vehicle)),
            In::Expected(_) => InputClass::Latest(Key::Expected),
            In::Accepted(..) => InputClass::Latest(Key::Accepted),
            In::Remembered(_) => InputClass::Latest(Key::Remembered),
        }
    }

    /// What peers repeat all the time is read a few at a time.
    fn may_wait(&self) -> bool {
        match self {
            In::Peer(_) | In::Sighted(_) => true,
            In::Telemetry(_)
            | In::Autopilot(_)
            | In::Scan(_)
            | In::Command(..)
            | In::Holds(_)
            | In::Order(..)
            | In::Stops(_)
            | In::StopsReported(_)
            | In::Expected(_)
            | In::Accepted(..)
            | In::Remembered(_) => false,
        }
    }

    fn join(unread: In, newer: In) -> In {
        match (unread, newer) {
            (In::Order(first, unread), In::Order(second, newer)) => {
                let is_newer = newer.lease > unread.lease
                    || newer.lease == unread.lease && newer.revision >= unread.revision;
                In::Order(
                    if is_newer { second } else { first },
                    join_orders(unread, newer),
                )
            }
            (In::Peer(unread), In::Peer(newer)) => In::Peer(join_states(unread, newer)),
            (_, newer) => newer,
        }
    }
}

#[cfg(test)]
mod tests;
