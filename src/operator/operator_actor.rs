//! The operator actor: it hears the bus, keeps its view of the fleet, and brings about what is wanted.
//!
//! It is told what came over the bus, whether anyone can be reached, what is wanted by hand, a script to follow, and that a
//! cue was done. It says orders, every 100 ms until State shows them, tasks, every 5 s until Report and Mission show them,
//! and its greeting, every 2 s, or every second while it holds a lease; marks, every 200 ms until the ground says that they
//! are stored; and how wants, marks and the script ended. It draws nothing (its holder id is given), decides nothing for a
//! vehicle, and hears no answers: what it waits for is State. It names a wanted emergency stop and hands it to the keeper
//! of the stops ([`super::stopping`]).
//!
//! ```text
//!           Want                    every State shows it, by hand
//!   (none) ──────► open ───────────────────────────────────────────► ended
//!                   │  └─time is up, overruled, refused, withdrawn────► ended
//!                   │ every State shows it, of a script              ▲
//!                   ▼                                                │ everybody has it from somebody else,
//!                 in force ──────────────────────────────────────────┘ or it is withdrawn
//!                   ▲ │ a vehicle was started anew: it is told again
//!                   └─┘
//! ```
//!
//! A later want takes the place of an earlier one on the vehicles that both name. By whose right it orders, and when
//! somebody else's order counts more, is said in [`super::ordering`].
//!
//! Deadlines: `greets`, `orders`, `tasks`, `marks`, and those of the script.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    EmergencyName, EmergencyStop, Hello, Lease, Message, OperatorId, Sender, StopScope,
};

use super::HeardMessage;
use super::fleet_view::FleetView;
use super::given_marks::{GivenMarks, MarkOutcome};
use super::given_tasks::GivenTasks;
pub use super::messages::{In, Key, OperatorSettings, Out};
use super::order_goal::{GoalId, OrderGoal, StopRequest};
use super::ordering::{FIRST_LEASE, Instruction, Ordering};
use super::outcome::OrderOutcome;
use super::script::{LastGoal, ScriptDue, ScriptOut, ScriptRun, ScriptView};
use super::stopping::StopBatch;
use crate::actor::{Actor, Fault};
use crate::time::{Deadline, Time};

/// It greets this often.
const GREETS_EVERY: Duration = Duration::from_secs(2);
/// Who holds a lease greets this often: ground stations plan under it as long as they hear its holder.
const HOLDER_GREETS_EVERY: Duration = Duration::from_secs(1);
/// While nothing new is heard, this is how often it checks for silent nodes.
const LOOKS_EVERY: Duration = Duration::from_millis(500);
/// After this long on the bus everyone who is there was heard.
const LISTEN: Duration = Duration::from_secs(2);

/// The operator actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Operator {
    settings: OperatorSettings,
    view: FleetView,
    /// Since when anyone can be reached.
    linked: Option<Time>,
    /// When it greeted last, and the lease that it named.
    greeted: Option<(Time, Option<Lease>)>,
    wants: BTreeMap<GoalId, ActiveGoal>,
    stops: BTreeMap<GoalId, StopBatch>,
    /// Names of emergency stops drawn so far.
    names: u32,
    tasks: GivenTasks,
    marks: GivenMarks,
    script: Option<ScriptRun>,
    last_want: LastGoal,
    script_wants: u32,
    next: Option<(Time, Due)>,
    /// When all was looked at last, if nothing follows from what is no news: every want is in force, and nobody doubts it.
    settled: Option<Time>,
}

/// A want that is brought about, or stands.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct ActiveGoal {
    want: OrderGoal,
    ordering: Ordering,
    is_in_force: bool,
}

/// What is due next.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
enum Due {
    Orders,
    Greets,
    Tasks,
    Marks,
    Script(ScriptDue),
}

/// What there is to say of a pursuit.
enum GoalProgress {
    GoesOn,
    InForce(OrderOutcome),
    Ended(OrderOutcome),
}

impl Operator {
    /// Makes an operator that has heard nothing yet.
    pub fn new(settings: OperatorSettings) -> Operator {
        Operator {
            settings,
            view: FleetView::default(),
            linked: None,
            greeted: None,
            wants: BTreeMap::new(),
            stops: BTreeMap::new(),
            names: 0,
            tasks: GivenTasks::default(),
            marks: GivenMarks::default(),
            script: None,
            last_want: LastGoal::Open,
            script_wants: 0,
            next: None,
            settled: None,
        }
    }

    /// Returns what is known of the fleet; for its face, to show.
    pub fn view(&self) -> &FleetView {
        &self.view
    }

    /// Takes what came over the bus; returns whether anything may follow from it.
    fn hear(&mut self, now: Time, heard: &HeardMessage) -> bool {
        let was_looked_at = self.settled.is_some_and(|at| now.since(at) < LOOKS_EVERY);
        let matters = !was_looked_at || self.view.is_news(heard);
        self.view.hear(now, heard);
        for pursuit in self.wants.values_mut() {
            match matters {
                true => pursuit.ordering.hear(now, heard),
                false => pursuit.ordering.look(now, heard),
            }
        }
        matters
    }

    /// Takes up a want; what it wants of vehicles counts more than what was wanted of them before.
    fn take_up(&mut self, now: Time, id: GoalId, want: OrderGoal, out: &mut Vec<Out>) {
        for pursuit in self.wants.values_mut() {
            let is_same = (pursuit.want.kind, pursuit.want.run) == (want.kind, want.run);
            if !is_same {
                pursuit.ordering.withdraw(now, &want.vehicles);
            }
        }
        self.give_up(now, |_, pursuit| pursuit.ordering.is_withdrawn(now), out);
        let has_listened = self.linked.is_some_and(|since| now.since(since) >= LISTEN);
        let ordering =
            Ordering::new(now, self.instruction(&want)).knowing(&self.view, has_listened);
        let ordering = match id {
            GoalId::Hand(_) => ordering,
            GoalId::Script(_) => ordering.standing(),
        };
        self.wants.insert(
            id,
            ActiveGoal {
                want,
                ordering,
                is_in_force: false,
            },
        );
    }

    fn instruction(&self, want: &OrderGoal) -> Instruction {
        let OrderGoal {
            kind,
            vehicles,
            run,
            begins,
            mission,
            ends_run,
            take_over,
            although_unheard,
            lifts_many,
            within,
        } = want.clone();
        let OperatorSettings {
            hello,
            greets: _,
            holder,
            expected,
        } = self.settings.clone();
        let (venue_hash, timeout) = (hello.venue_hash, within);
        Instruction {
            kind,
            begins,
            mission,
            vehicles,
            expected,
            run,
            ends_run,
            take_over,
            holder,
            venue_hash,
            although_unheard,
            lifts_many,
            timeout,
        }
    }

    /// Gives an emergency stop: what is still on its way to these vehicles is not wanted any more.
    fn stop(&mut self, now: Time, id: GoalId, wish: StopRequest, out: &mut Vec<Out>) {
        for pursuit in self
            .wants
            .values_mut()
            .filter(|pursuit| !pursuit.is_in_force)
        {
            pursuit.ordering.withdraw(now, &wish.vehicles);
        }
        self.give_up(now, |_, pursuit| pursuit.ordering.is_withdrawn(now), out);
        let scopes: Vec<StopScope> = match wish.vehicles.is_empty() {
            true => vec![StopScope::All],
            false => wish.vehicles.iter().map(|id| StopScope::One(*id)).collect(),
        };
        let stops: Vec<EmergencyStop> = scopes
            .into_iter()
            .map(|scope| self.new_stop(scope))
            .collect();
        out.push(Out::Give(stops.clone()));
        let has_listened = self.linked.is_some_and(|since| now.since(since) >= LISTEN);
        let expected = self.settings.expected.clone();
        self.stops
            .insert(id, StopBatch::new(now, stops, wish, expected, has_listened));
    }

    /// Returns a stop with a name that nobody else draws (SplitMix64 over the holder's id).
    fn new_stop(&mut self, scope: StopScope) -> EmergencyStop {
        let by = match self.settings.hello.node {
            Sender::Operator(id) => id,
            Sender::Ground | Sender::Vehicle(_) => OperatorId(0),
        };
        loop {
            self.names = self.names.wrapping_add(1);
            let mut mixed = self
                .settings
                .holder
                .wrapping_add(u64::from(self.names).wrapping_mul(0x9E37_79B9_7F4A_7C15));
            mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            let name = EmergencyName((mixed >> 32) as u32);
            if !name.is_many() {
                return EmergencyStop { name, scope, by };
            }
        }
    }

    /// Looks who shows the stops that were given.
    fn look_after_stops(&mut self, now: Time, out: &mut Vec<Out>) {
        let (view, is_linked) = (&self.view, self.linked.is_some());
        let mut over = Vec::new();
        for (id, stopping) in &mut self.stops {
            stopping.look(now, view, is_linked);
            over.extend(stopping.outcome(now, view).map(|outcome| (*id, outcome)));
        }
        for (id, outcome) in over {
            self.stops.remove(&id);
            self.end(id, outcome, out);
        }
    }

    /// Says the marks that are due, and ends those whose time is up and those in runs that there are not.
    fn look_after_marks(&mut self, now: Time, out: &mut Vec<Out>) {
        let mut over = self.marks.of_unknown_runs(now, &self.view);
        over.extend(self.marks.given_up(now, &self.view));
        out.extend(
            over.into_iter()
                .map(|(number, how)| Out::Marked(number, how)),
        );
        let due = self.marks.due(now, &self.view, self.linked.is_some());
        out.extend(
            due.into_iter()
                .map(|mark| Out::Publish(Message::Mark(mark))),
        );
    }

    /// Ends the wants of which that is so.
    fn give_up(
        &mut self,
        now: Time,
        is_over: impl Fn(GoalId, &ActiveGoal) -> bool,
        out: &mut Vec<Out>,
    ) {
        let over = self
            .wants
            .iter()
            .filter(|(id, pursuit)| is_over(**id, pursuit))
            .map(|(id, _)| *id);
        for id in over.collect::<Vec<GoalId>>() {
            if let Some(pursuit) = self.wants.remove(&id) {
                self.end(id, pursuit.ordering.outcome_so_far(now), out);
            }
        }
    }

    fn end(&mut self, id: GoalId, outcome: OrderOutcome, out: &mut Vec<Out>) {
        if self.is_last_of_script(id) && self.last_want == LastGoal::Open {
            self.last_want = LastGoal::Failed(outcome.undone());
        }
        out.push(Out::Ended(id, outcome));
    }

    fn is_last_of_script(&self, id: GoalId) -> bool {
        id == GoalId::Script(self.script_wants.saturating_sub(1))
    }

    /// Does all that is due: greets, orders, goes on with the script; then knows when something is due next.
    fn turn(&mut self, now: Time, out: &mut Vec<Out>) {
        let mut output = Vec::new();
        self.deliver_goals(now, &mut output);
        self.look_after_stops(now, &mut output);
        self.follow_script(now, &mut output);
        self.look_after_marks(now, &mut output);
        // A lease that is taken is named before the first order under it.
        self.greet(now, out);
        out.append(&mut output);
        self.next = self.due_next(now);
        let is_settled =
            self.stops.is_empty() && self.wants.values().all(|pursuit| pursuit.is_settled(now));
        self.settled = is_settled.then_some(now);
    }

    fn follow_script(&mut self, now: Time, out: &mut Vec<Out>) {
        while let Some(output) = self.go_on(now) {
            match output {
                ScriptOut::Task(wish) => {
                    self.tasks.give(wish);
                    self.give_tasks(now, out);
                }
                ScriptOut::Want(want) => {
                    let id = GoalId::Script(self.script_wants);
                    (self.script_wants, self.last_want) = (self.script_wants + 1, LastGoal::Open);
                    self.take_up(now, id, want, out);
                    self.deliver_goals(now, out);
                }
                ScriptOut::Announce(name) => out.push(Out::Announce(name)),
                ScriptOut::Ended(end) => {
                    self.script = None;
                    out.push(Out::ScriptEnded(end));
                }
            }
        }
    }

    /// Says the tasks that are due, by the right that is in force, or that this operator is taking.
    fn give_tasks(&mut self, now: Time, out: &mut Vec<Out>) {
        let is_linked = self.linked.is_some();
        for pursuit in self.wants.values_mut() {
            if let Some(wish) = pursuit.ordering.task(now, is_linked) {
                self.tasks.give(wish);
            }
        }
        let taken = self
            .wants
            .values()
            .filter_map(|pursuit| pursuit.ordering.lease())
            .max();
        let in_force = self.view.lease(now).max(taken.unwrap_or_default());
        let lease = match in_force.number {
            0 => Lease {
                number: FIRST_LEASE,
                holder: self.settings.holder,
            },
            _ => in_force,
        };
        let due = self.tasks.due(now, &self.view, lease);
        out.extend(
            due.into_iter()
                .map(|task| Out::Publish(Message::Task(task))),
        );
    }

    /// Returns the greatest lease of all, if this operator holds it.
    fn held_lease(&self, now: Time) -> Option<Lease> {
        let taken = self
            .wants
            .values()
            .filter_map(|pursuit| pursuit.ordering.lease())
            .max();
        let greatest = taken.into_iter().chain([self.view.lease(now)]).max();
        greatest.filter(|lease| lease.number > 0 && lease.holder == self.settings.holder)
    }

    fn go_on(&mut self, now: Time) -> Option<ScriptOut> {
        let sight = ScriptView {
            view: &self.view,
            last_want: &self.last_want,
        };
        self.script.as_mut()?.go_on(now, &sight)
    }

    fn greet(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(linked) = self.linked.filter(|_| self.settings.greets) else {
            return;
        };
        let lease = self.held_lease(now);
        if self
            .greeted
            .is_some_and(|(at, named)| named == lease && now.since(at) < greets_every(lease))
        {
            return;
        }
        self.greeted = Some((now, lease));
        let member_for_s = u32::try_from(now.since(linked).as_secs()).unwrap_or(u32::MAX);
        let hello = Hello {
            member_for_s,
            lease,
            ..self.settings.hello.clone()
        };
        out.push(Out::Publish(Message::Hello(hello)));
    }

    fn deliver_goals(&mut self, now: Time, out: &mut Vec<Out>) {
        self.give_tasks(now, out);
        let is_linked = self.linked.is_some();
        let mut turns = Vec::new();
        for (id, pursuit) in &mut self.wants {
            let due = pursuit.ordering.act(now, is_linked);
            out.extend(
                due.into_iter()
                    .map(|order| Out::Publish(Message::Order(order))),
            );
            turns.push((*id, pursuit.turn(now)));
        }
        for (id, turn) in turns {
            match turn {
                GoalProgress::GoesOn => {}
                GoalProgress::InForce(outcome) => {
                    if self.is_last_of_script(id) {
                        self.last_want = LastGoal::InForce;
                    }
                    out.push(Out::InForce(id, outcome));
                }
                GoalProgress::Ended(outcome) => {
                    self.wants.remove(&id);
                    self.end(id, outcome, out);
                }
            }
        }
    }

    fn due_next(&self, now: Time) -> Option<(Time, Due)> {
        let open = self
            .wants
            .values()
            .filter(|pursuit| !pursuit.is_settled(now));
        let orders = open.map(|pursuit| pursuit.ordering.next(now));
        let orders = orders
            .chain(self.stops.values().map(|stopping| stopping.next(now)))
            .min();
        let greets = self
            .greeted
            .filter(|_| self.linked.is_some() && self.settings.greets);
        let script = self.script.as_ref().and_then(ScriptRun::deadline);
        let all = [
            orders.map(|at| (at, Due::Orders)),
            greets.map(|(at, lease)| (at + greets_every(lease), Due::Greets)),
            self.tasks.next().map(|at| (at, Due::Tasks)),
            self.marks.next().map(|at| (at, Due::Marks)),
            script.map(|(at, due)| (at, Due::Script(due))),
        ];
        all.into_iter().flatten().min()
    }
}

fn greets_every(held: Option<Lease>) -> Duration {
    if held.is_some() {
        HOLDER_GREETS_EVERY
    } else {
        GREETS_EVERY
    }
}

impl Due {
    fn why(self) -> &'static str {
        match self {
            Due::Orders => "orders",
            Due::Greets => "greets",
            Due::Tasks => "tasks",
            Due::Marks => "marks",
            Due::Script(due) => due.why(),
        }
    }
}

impl ActiveGoal {
    /// Looks how it stands.
    fn turn(&mut self, now: Time) -> GoalProgress {
        if self.is_in_force {
            let is_lost = self.ordering.is_lost(now);
            return if is_lost {
                GoalProgress::Ended(self.ordering.outcome_so_far(now))
            } else {
                GoalProgress::GoesOn
            };
        }
        match self.ordering.outcome(now) {
            None => GoalProgress::GoesOn,
            Some(outcome) if self.ordering.stands() && outcome.is_done() => {
                self.is_in_force = true;
                GoalProgress::InForce(outcome)
            }
            Some(outcome) => GoalProgress::Ended(outcome),
        }
    }

    /// Returns whether there is nothing to do until something is heard.
    fn is_settled(&self, now: Time) -> bool {
        self.is_in_force && self.ordering.is_settled(now)
    }
}

impl Actor for Operator {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Bus(HeardMessage::Message(Sender::Ground, Message::Mark(mark))) => {
                let over = self.marks.stored(mark);
                out.extend(
                    over.into_iter()
                        .map(|(number, how)| Out::Marked(number, how)),
                );
            }
            In::Bus(heard) => {
                if !self.hear(now, &heard) {
                    return Ok(());
                }
            }
            In::Linked(is_linked) => {
                self.linked = self
                    .linked
                    .filter(|_| is_linked)
                    .or(is_linked.then_some(now));
            }
            In::Want(number, want) => self.take_up(now, GoalId::Hand(number), want, out),
            In::Stop(number, wish) => self.stop(now, GoalId::Hand(number), wish, out),
            In::Withdraw(number) => {
                if self.marks.withdraw(number) {
                    out.push(Out::Marked(number, MarkOutcome::Withdrawn));
                }
                self.give_up(now, |id, _| id == GoalId::Hand(number), out);
                if let Some(stopping) = self.stops.remove(&GoalId::Hand(number)) {
                    self.end(
                        GoalId::Hand(number),
                        stopping.outcome_so_far(now, &self.view),
                        out,
                    );
                }
            }
            In::Follow(steps) => {
                self.script = Some(ScriptRun::new(now, steps));
                self.last_want = LastGoal::Open;
            }
            // Nothing else follows from it.
            In::Fix(fix) => {
                out.push(Out::Publish(Message::Fix(fix)));
                return Ok(());
            }
            In::Mark(number, request) => self.marks.give(now, number, request),
            In::Ask(of, is_wanted) => {
                let interest = &mut self.settings.hello.interest;
                if interest.contains(&of) != is_wanted {
                    interest.retain(|other| *other != of);
                    interest.extend(is_wanted.then_some(of));
                    interest.sort_unstable();
                    // Nobody waits for what is not wanted any more.
                    self.greeted = self.greeted.filter(|_| !is_wanted);
                }
            }
            In::CueDone => {
                if let Some(script) = &mut self.script {
                    script.cue_done();
                }
            }
        }
        self.turn(now, out);
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        self.next.map(|(at, due)| Deadline { at, why: due.why() })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.turn(now, out);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
