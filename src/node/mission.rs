//! The mission actor: decides where the vehicle goes next, as its plan, its operator and its peers let it.
//!
//! It is told its own and the peers' states, tiles, plans, tasks, progress, orders, the vehicle's events and what the disk
//! has. It says commands, progress, what it measures for, what is to be remembered, and events. What is known of the ground
//! is `terrain`; how a way is driven is decided by `pilot`; the vehicle actor has the last word on safety.
//!
//! What is wanted of the vehicle is one state, see `goal`; what it is out for is said by the operator's task or its file
//! (`assignment`): the ground's plan (`ground_plan`) or a mission of its own (`kind`), whose steps `runner` carries out.
//! Without an order it holds or returns when it hears nobody, has lost the bus or runs out of battery: see `autonomy`. How a
//! return goes on beside others that return is decided by `returning`. All of these only decide: the goal is changed here.
//!
//! A plan by a greater right than any before is taken once that lease is on the vehicle's disk: see `leases`. As long as
//! the vehicle does not know its place it stands, and nothing is made of where it seems to be: see `place_watch`. As long as
//! somebody or something else holds it back, its mission pauses: see `restraint`.
//!
//! Deadlines: `repeat progress`, `the dwell at the stop ends`, `path ready`, `search again`.

mod announcements;
mod aside;
mod assignment;
mod autonomy;
mod doubts;
mod goal;
mod ground_plan;
mod home;
mod homeward;
mod kind;
mod leases;
mod look_around;
mod messages;
mod obstruction;
mod pilot;
mod place_watch;
mod report;
mod restraint;
mod returning;
mod runner;
mod share;
mod taken_plans;
mod terrain;
mod way;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{EmergencyStop, Order, OrderKind, RunId, Task};

use self::announcements::Announcements;
use self::aside::BarringLooks;
use self::assignment::Assignment;
use self::autonomy::{Autonomy, Decision};
use self::goal::{Goal, GoalSource};
use self::ground_plan::GroundPlan;
use self::leases::PlanLeases;
use self::pilot::{Pilot, WayEvent};
use self::place_watch::PlaceWatch;
use self::runner::{RunnerContext, StepRunner};
use self::terrain::Terrain;
use super::memory::Remembered;
use super::peers::Peers;
use super::state_ages::StateAges;
use super::{OwnState, VehicleSettings};
use crate::actor::{Actor, Fault};
use crate::geom::Point;
use crate::stops::first_that_stops;
use crate::sweep::{VehicleProgress, WaitsFor};
use crate::time::{Deadline, Time};

pub use home::{HOME_M, farthest_m as home_farthest_m, is_at_home};
pub use messages::{AutonomyCause, EndReason, In, Key, MissionEvent, MissionStatus, Out};
pub use obstruction::{Obstruction, ObstructionKind};
pub(crate) use share::share;

/// Searches in vain before a stop is given up.
const FAILURES_MAX: u32 = 3;

/// The mission actor.
#[derive(Debug, Serialize, Deserialize)]
pub struct Mission {
    settings: VehicleSettings,
    state: Option<OwnState>,
    assignment: Assignment,
    plan: GroundPlan,
    terrain: Terrain,
    pilot: Pilot,
    /// What it does when the ground station does not plan for it.
    runner: Option<StepRunner>,
    goal: Goal,
    autonomy: Autonomy,
    place: PlaceWatch,
    peers: Peers,
    ages: StateAges,
    leases: PlanLeases,
    announcements: Announcements,
    /// Whether it bars the ways of others at home after a return.
    barring: BarringLooks,
}

impl Mission {
    /// Makes the actor of a vehicle that waits for plans and a start.
    pub fn new(settings: VehicleSettings) -> Mission {
        let leases = PlanLeases::remembering(settings.memory);
        Mission {
            terrain: Terrain::new(settings.clone()),
            pilot: Pilot::new(settings.clone()),
            assignment: Assignment::by_file(&settings),
            runner: StepRunner::of(&settings),
            peers: Peers::new(settings.vehicle),
            plan: GroundPlan::new(&settings),
            announcements: Announcements::new(settings.vehicle),
            place: PlaceWatch::new(settings.swarm.pose_sd_max_m),
            settings,
            state: None,
            goal: Goal::Waiting,
            autonomy: Autonomy::default(),
            ages: StateAges::default(),
            leases,
            barring: BarringLooks::default(),
        }
    }

    /// Returns why no leg may be entered now, for status lines.
    pub fn waits_for(&self) -> Option<WaitsFor> {
        self.plan.waits_for()
    }

    fn state(&mut self, now: Time, state: OwnState, out: &mut Vec<Out>) {
        self.ages.note(now, state.sequence);
        // Without its kind it is remembered, or only tried: what the disk has is told apart (`PlanLeases::remembered`).
        if state.ordered.kind.is_some() {
            self.leases.follow(state.ordered.lease);
        }
        let (pose, sees) = (state.pose, state.sees);
        let rests = state.is_at_rest && state.leg.is_none();
        let could_move = self.may_move();
        self.state = Some(state);
        self.watch_restraint(now, could_move);
        self.watch_place(now, pose.sd_m, sees, out);
        self.place.note_rest(rests, self.seems_home());
        if self.place.is_known() && self.plan.begin_at(pose.at) {
            self.pilot.give_up(pose.at);
        }
        self.go_on(now, out);
    }

    /// Goes on with whatever is wanted; called with every state and when something else has changed.
    fn go_on(&mut self, now: Time, out: &mut Vec<Out>) {
        self.look_after_itself(now, out);
        match self.goal {
            _ if !self.place.is_known() => self.wait_for_place(now, out),
            Goal::Following | Goal::Returning(_) if self.autonomy.is_alone() => {}
            Goal::Following | Goal::Returning(_) if !self.may_move() => self.stay(),
            Goal::Following => self.follow(now, out),
            Goal::Returning(home) => self.bring_home(now, home, out),
            Goal::Home(by) => {
                self.stay();
                self.make_room_at_home(now, by, out);
            }
            Goal::Held(_) | Goal::Waiting => self.stay(),
        }
        self.report(out);
    }

    /// Looks at peers, links and battery, before anything else is decided.
    fn look_after_itself(&mut self, now: Time, out: &mut Vec<Out>) {
        for decision in self.autonomy.watch_peers(now, &self.peers) {
            self.carry_out(now, decision, out);
        }
        let autonomy = self.settings.swarm.autonomy();
        for decision in self.autonomy.watch_links(now, autonomy, self.goal) {
            self.carry_out(now, decision, out);
        }
        let Some(state) = &self.state else { return };
        let safety = &self.settings.safety;
        let decision = self
            .autonomy
            .watch_battery(state.battery, safety, self.goal);
        if let Some(decision) = decision {
            self.carry_out(now, decision, out);
        }
    }

    /// Does what nobody has ordered.
    fn carry_out(&mut self, now: Time, decision: Decision, out: &mut Vec<Out>) {
        let was_following = self.goal == Goal::Following;
        // What forbids to drive on forbids nothing to a vehicle that has come home.
        if matches!(decision, Decision::Hold(_)) && self.end_return_at_home(out) {
            return;
        }
        let (goal, cause) = match decision {
            Decision::Say(event) => return out.push(Out::MissionEvent(event)),
            Decision::Stop => return self.stop(now, out),
            Decision::Hold(cause) => (Goal::Held(GoalSource::Itself(cause)), cause),
            Decision::Return(cause) => (Goal::go_home(now, GoalSource::Itself(cause)), cause),
        };
        self.goal = goal;
        match cause {
            // Whoever plans goes on without it: it moves again only under a newer plan.
            AutonomyCause::BatteryLow | AutonomyCause::BatteryEmpty | AutonomyCause::Blind => {
                self.plan.leave();
            }
            AutonomyCause::BusLost => {}
        }
        self.stop(now, out);
        out.push(Out::MissionEvent(MissionEvent::Decides(
            cause,
            self.status(),
        )));
        if was_following {
            self.end_own_mission(cause.into(), out);
        }
    }

    fn follow(&mut self, now: Time, out: &mut Vec<Out>) {
        if self.runner.is_some() {
            return self.run_steps(now, out);
        }
        if self.is_without_plan() {
            return self.stay();
        }
        if self.waits_to_see(now, out) {
            return self.stay();
        }
        self.plan.resume();
        self.enter_legs();
        self.drive(now, out);
        self.plan.wake(now);
        // A vehicle that cannot move asks the ground for a new plan from here; one that is asked to change its plan does so
        // where it rests.
        let commanded = out.iter().any(|output| matches!(output, Out::Command(..)));
        let is_asked = matches!(self.waits_for(), Some(WaitsFor::Revision { .. }));
        if (self.pilot.failures() >= FAILURES_MAX || is_asked) && !commanded {
            self.stay();
        }
    }

    fn run_steps(&mut self, now: Time, out: &mut Vec<Out>) {
        let met = self.advance(now, out);
        let (Some(state), Some(runner)) = (&self.state, &mut self.runner) else {
            return;
        };
        let mut scene = RunnerContext {
            now,
            state,
            terrain: &self.terrain,
            pilot: &mut self.pilot,
            peers: &self.peers,
            place: &mut self.place,
            out,
        };
        runner.go_on(&mut scene, &met);
        // What was chosen just now is begun at once.
        self.advance(now, out);
        if self.announcements.goal(self.goal_place()) {
            out.push(Out::Progress(self.on_wire()));
        }
    }

    /// Enters legs ahead as far as the plans allow.
    fn enter_legs(&mut self) {
        let no_path = self.pilot.failures() > 0;
        while let Some(stop) = self.plan.enter_next(self.pilot.way().length_m(), no_path) {
            let route = stop.route.iter().map(|corner| Point::from(*corner));
            self.pilot.append(route, stop.at.into(), Some(stop.id));
        }
    }

    fn drive(&mut self, now: Time, out: &mut Vec<Out>) {
        for met in self.advance(now, out) {
            self.meet(now, met, out);
        }
    }

    /// Lets the pilot go on; returns what it met.
    fn advance(&mut self, now: Time, out: &mut Vec<Out>) -> Vec<WayEvent> {
        let Some(state) = &self.state else {
            return Vec::new();
        };
        self.terrain
            .note_standing_peers(self.peers.standing_claims(now));
        self.terrain.note_place(state.pose.at);
        self.terrain.note_sight(state.sees);
        let mut met = Vec::new();
        let command = self.pilot.advance(now, state, &self.terrain, &mut met);
        out.extend(command.map(|command| Out::Command(now, command)));
        met
    }

    fn meet(&mut self, now: Time, met: WayEvent, out: &mut Vec<Out>) {
        match met {
            WayEvent::Stop(stop) => {
                let place = self.state.as_ref().map(|state| state.pose.at);
                self.plan.pass(now, stop, place.unwrap_or_default());
            }
            WayEvent::NoPath(failures) => {
                if failures >= FAILURES_MAX {
                    self.give_up_stop(now, out);
                }
                self.step_back(now, |returning| returning.after_failures(failures));
            }
            WayEvent::Blocked(_) if self.goal.drives_home() => self.end_way_aside(),
            WayEvent::Looks(_) | WayEvent::Blocked(_) | WayEvent::Path(_) => {}
        }
        out.push(Out::MissionEvent(met.into()));
    }

    /// Gives up the stop that comes next when the plan gets on only without it.
    fn give_up_stop(&mut self, now: Time, out: &mut Vec<Out>) {
        let (Some(state), Goal::Following) = (&self.state, self.goal) else {
            return;
        };
        let can_reach = |place: Point| self.terrain.can_reach(now, state.pose, place);
        if !self
            .plan
            .gives_up_stop(self.pilot.way().stops().count(), can_reach)
        {
            return;
        }
        let place = state.pose.at;
        for stop in self.pilot.skip(place) {
            out.push(Out::MissionEvent(MissionEvent::Skipped(stop)));
            self.plan.skip(now, stop, place);
        }
    }

    /// Without a way to drive: a newer revision may be adopted from where the vehicle rests.
    fn stay(&mut self) {
        let Some(state) = &self.state else { return };
        let at_rest = state.speed_mps == 0.0 && state.leg.is_none();
        if at_rest {
            self.plan.rest_at(state.pose.at);
        }
    }

    /// A new revision is followed: what was left of the old way is given up, unless that was none of a plan's.
    fn adopted(&mut self, progress: &VehicleProgress, out: &mut Vec<Out>) {
        let follows_own = self.goal == Goal::Following && self.assignment.is_own();
        let drives_itself = follows_own || self.goal.drives_home();
        if let Some(state) = self.state.as_ref().filter(|_| !drives_itself) {
            self.pilot.give_up(state.pose.at);
        }
        out.push(Out::Accepted(progress.run, progress.revision));
        out.push(Out::MissionEvent(MissionEvent::Adopted(
            progress.run,
            progress.revision,
        )));
    }

    fn hear(&mut self, now: Time, progress: &VehicleProgress, out: &mut Vec<Out>) {
        self.plan.hear(now, progress);
        self.report(out);
    }

    fn order(&mut self, now: Time, order: Order, out: &mut Vec<Out>) {
        self.leases.follow(order.lease);
        let (drove_home, is_start) = (self.goal.drives_home(), order.kind == OrderKind::Start);
        let stays_home_for = self.stays_home_for();
        self.goal = self.goal.ordered(now, order.kind, stays_home_for);
        if is_start {
            self.obeys_again();
        }
        let follows = is_start && self.goal == Goal::Following;
        if !is_start || (follows && drove_home) {
            self.stop(now, out);
        }
        // What keeps it at home ends a mission of its own at once.
        if is_start && matches!(self.goal, Goal::Following | Goal::Home(_)) {
            self.start(now, order.run, out);
        }
        self.go_on(now, out);
    }

    /// It is started in a run: what it is out for there is begun, or goes on.
    fn start(&mut self, now: Time, run: RunId, out: &mut Vec<Out>) {
        let was_own = self.assignment.is_own();
        if self.assignment.start(run) {
            self.take_up(now, was_own, out);
        }
    }

    /// An operator says what a run is.
    fn take_task(&mut self, now: Time, task: &Task, out: &mut Vec<Out>) {
        let was_own = self.assignment.is_own();
        if self.leases.are_above(task.lease) || !self.assignment.hear(task) {
            return;
        }
        self.take_up(now, was_own, out);
        self.go_on(now, out);
    }

    /// It is out for something new: what is left of the way of before is given up. Plans that it follows stay with it, but
    /// for those that a mission of its own leads it away from.
    fn take_up(&mut self, now: Time, was_own: bool, out: &mut Vec<Out>) {
        if !was_own && !self.assignment.is_own() {
            return;
        }
        if self.goal == Goal::Following && !self.pilot.way().is_empty() {
            self.stop(now, out);
        }
        // The way home stays.
        if let Some(state) = self.state.as_ref().filter(|_| !self.goal.drives_home()) {
            self.pilot.give_up(state.pose.at);
        }
        self.settings.task = self.assignment.task().ok().flatten().cloned();
        self.runner = StepRunner::of(&self.settings);
        self.place.end_wait();
        if self.assignment.is_own() {
            self.plan.leave();
        }
        let refusal = self
            .assignment
            .refusal()
            .map(|why| MissionEvent::Ended(EndReason::Refused(why)));
        out.extend(refusal.map(Out::MissionEvent));
        // What has kept it from its mission before it knew of it keeps it from it now.
        if let Some(cause) = self.goal.cause() {
            self.end_own_mission(cause.into(), out);
        }
        out.push(Out::Progress(self.on_wire()));
    }

    /// Records which emergency stops are open. One that stops the vehicle holds it as an order does, until a start.
    fn emergency(&mut self, now: Time, open: &[EmergencyStop], out: &mut Vec<Out>) {
        if first_that_stops(open, self.settings.vehicle).is_none() {
            return;
        }
        self.goal = Goal::Held(GoalSource::Order);
        self.stop(now, out);
        self.go_on(now, out);
    }

    /// Says progress and what is measured for, when they have changed.
    fn report(&mut self, out: &mut Vec<Out>) {
        if !self.plan.is_begun() {
            return;
        }
        let news = self.plan.news();
        if let Some(progress) = news.progress {
            if news.is_adopted {
                self.adopted(&progress, out);
            }
            out.push(Out::Progress(self.on_wire()));
        }
        out.extend(
            news.finished
                .map(|run| Out::MissionEvent(MissionEvent::Finished(run))),
        );
        let is_planned = self.goal == Goal::Following && !self.assignment.is_own();
        let measure = self.plan.measures_for().filter(|_| is_planned);
        out.extend(self.announcements.measure(measure));
        out.extend(self.announcements.holds(self.holds_for()));
    }

    /// Returns when what is driven, or what is done at a stop, goes on by itself.
    fn goal_deadline(&self) -> Option<Deadline> {
        let pilot = self.pilot.deadline();
        match (self.goal, &self.runner) {
            _ if self.autonomy.is_alone() || !self.place.is_known() || !self.may_move() => None,
            (Goal::Following, Some(runner)) => Deadline::earlier(
                self.plan.deadline(),
                Deadline::earlier(runner.deadline(), pilot),
            ),
            (Goal::Following, None) if self.is_without_plan() => self.plan.deadline(),
            (Goal::Following, None) if !self.place.sees() => None,
            (Goal::Following, None) => Deadline::earlier(self.plan.deadline(), pilot),
            (Goal::Returning(home), _) if home.is_under_way() => pilot,
            (Goal::Returning(_) | Goal::Waiting | Goal::Held(_) | Goal::Home(_), _) => None,
        }
    }

    /// Returns whether it follows no plan: it refuses its task, or has left the plan and waits for a newer one.
    fn is_without_plan(&self) -> bool {
        self.assignment.refusal().is_some() || self.plan.has_left()
    }
}

#[cfg(test)]
impl Mission {
    /// Returns the map as it is known.
    pub(crate) fn known_ground(&self) -> &crate::map::Merged {
        self.terrain.map()
    }
}

impl Actor for Mission {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::State(state) => self.state(now, state, out),
            In::Peer(state) => self.peers.take(now, &state),
            In::Tile(tile) => {
                self.terrain.learn(&tile);
                if let Some(runner) = &mut self.runner {
                    runner.learn(&tile);
                }
            }
            In::Plan(plan) => self.take_plan(now, &plan, out),
            In::Task(task) => self.take_task(now, &task, out),
            In::Progress(progress) => self.hear(now, &progress, out),
            In::PeerMission(mission) => self.peers.note_goal(now, &mission),
            In::Sighted(sighting) => {
                self.peers.sight(now, &sighting);
                self.autonomy.heard_radio(now);
                self.hear(now, &sighting.progress, out);
            }
            In::Expected(vehicles) => {
                self.peers.note_expected(now, &vehicles);
                self.autonomy.forget_strangers(&self.peers);
            }
            In::Heard(by) => self.autonomy.heard_bus(now, self.settings.vehicle, by),
            In::Order(order) => self.order(now, order, out),
            In::Stops(open) => self.emergency(now, &open, out),
            In::SafetyEvent(event) => self.take_safety_event(now, &event),
            In::Remembered(Remembered { on_disk, .. }) => {
                for plan in self.leases.remembered(on_disk) {
                    self.take_plan(now, &plan, out);
                }
            }
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let repeat = Some(self.announcements.deadline());
        Deadline::earlier(repeat, self.goal_deadline())
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        if self.announcements.repeats(now) {
            out.push(Out::Progress(self.on_wire()));
        }
        self.go_on(now, out);
        Ok(())
    }
}

#[cfg(test)]
mod autonomy_tests;
#[cfg(test)]
mod returning_tests;
#[cfg(test)]
mod tests;
