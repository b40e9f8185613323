//! The ground station of a world: the real station and planner, a disk that takes its time, and what is judged of what it
//! says. As in a live process the station waits for its disk: what it says after something to be remembered goes out when
//! that is written, and nothing is read meanwhile.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use tomoswarm::actor::Actor;
use tomoswarm::config::ImageTimes;
use tomoswarm::geom::{Lattice, Point, Rect};
use tomoswarm::ground::planner::{Method, PlannerActor, PlannerAnswer};
use tomoswarm::ground::station::{In, Out, PictureName, Station, StationMemory, StationSettings};
use tomoswarm::sweep::Ring;
use tomoswarm::time::Time;
use tomoswarm_proto::{
    Boot, Lease, Message, Order, OrderKind, Plan, Revision, RunId, SeenState, State, VehicleId,
};

use super::nodes::VEHICLES;
use super::tally::Mistake;

/// An order below what the station was shown is not repeated for longer.
const LEARNS_WITHIN: Duration = Duration::from_millis(1500);
/// The planner takes so long.
const PLANS_FOR: Duration = Duration::from_millis(700);

/// By whom an order of an edition was given.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Giver {
    Operator,
    /// The ground station with this store.
    Ground(u64),
}

/// Every order that was given, by vehicle and edition.
#[derive(Default)]
pub struct Given(BTreeMap<(VehicleId, Lease, Revision), Vec<(OrderKind, Giver)>>);

impl Given {
    pub fn note(&mut self, order: &Order, giver: Giver) {
        let givers = self
            .0
            .entry((order.vehicle, order.lease, order.revision))
            .or_default();
        if !givers.contains(&(order.kind, giver)) {
            givers.push((order.kind, giver));
        }
    }

    /// Returns whether anyone of such has given an order.
    pub fn is_by(
        &self,
        vehicle: VehicleId,
        edition: (Lease, Revision),
        kind: OrderKind,
        is_such: impl Fn(Giver) -> bool,
    ) -> bool {
        let givers = self.0.get(&(vehicle, edition.0, edition.1));
        givers
            .into_iter()
            .flatten()
            .any(|(given, giver)| *given == kind && is_such(*giver))
    }
}

/// What the station knows, as far as it is judged by it.
#[derive(Clone, Default)]
struct Knowledge {
    newest: BTreeMap<VehicleId, SeenState>,
    /// The edition that each vehicle shows, and since when.
    shown: BTreeMap<VehicleId, (Time, (Lease, Revision))>,
    /// The vehicles on which the order of an operator stands.
    stopped: BTreeSet<VehicleId>,
}

impl Knowledge {
    fn take(&mut self, now: Time, store: u64, state: &State, given: &Given) {
        let State {
            vehicle, ordered, ..
        } = *state;
        let output = SeenState {
            boot: state.boot,
            sequence: state.sequence,
        };
        let key = |seen: &SeenState| (seen.boot, seen.sequence);
        if self
            .newest
            .get(&vehicle)
            .is_some_and(|newest| key(&output) <= key(newest))
        {
            return;
        }
        self.newest.insert(vehicle, output);
        if self
            .shown
            .get(&vehicle)
            .is_none_or(|(_, edition)| *edition != ordered.edition())
        {
            self.shown.insert(vehicle, (now, ordered.edition()));
        }
        let Some(kind) = ordered.kind else { return };
        let is_other = |giver| giver != Giver::Ground(store);
        if given.is_by(vehicle, ordered.edition(), kind, is_other) {
            match kind {
                // Nobody knows any more of a start by a station whose disk is lost that no operator gave it.
                OrderKind::Start => self.stopped.remove(&vehicle),
                OrderKind::Hold | OrderKind::Return | OrderKind::Land | OrderKind::CutMotors => {
                    self.stopped.insert(vehicle)
                }
            };
        }
    }
}

/// The ground station.
pub struct Ground {
    station: Station,
    planner: PlannerActor,
    /// Its software runs from here on; its clock begins there.
    up_from: Time,
    boot: Boot,
    starts: u64,
    store: u64,
    /// What is on its disk, and what the station knew then.
    disk: Option<(StationMemory, Knowledge)>,
    writing: Option<(Time, StationMemory, Knowledge)>,
    unread: VecDeque<In>,
    unsaid: VecDeque<Out>,
    known: Knowledge,
    /// Every plan that was ever given, but for its lease and what it answers.
    plans: BTreeMap<(u64, RunId, Revision, VehicleId), Plan>,
    mistake: Option<Mistake>,
}

/// What a turn of the ground station comes to.
pub enum Turn {
    /// Something was done inside.
    Acted,
    Publish(Box<Message>),
    /// It begins to write; [`Ground::write_until`] says how long.
    Writes,
    Wrong(String),
    /// There is nothing to do now.
    Rests,
}

impl Ground {
    /// Makes a ground station that was never there before.
    pub fn new(mistake: Option<Mistake>) -> Ground {
        Ground {
            station: Station::new(settings(Boot(1), 1, 1)),
            planner: planner(),
            up_from: Time::ZERO,
            boot: Boot(1),
            starts: 1,
            store: 1,
            disk: None,
            writing: None,
            unread: VecDeque::new(),
            unsaid: VecDeque::new(),
            known: Knowledge::default(),
            plans: BTreeMap::new(),
            mistake,
        }
    }

    /// Starts its software anew, which runs `down` later; what was being written is lost, and all of it with a new disk.
    pub fn restart(&mut self, now: Time, down: Duration, has_new_disk: bool) {
        self.starts += 1;
        self.boot.0 += 1;
        if has_new_disk {
            (self.boot, self.store, self.disk) = (Boot(1), self.starts, None);
        }
        (self.writing, self.planner, self.up_from) = (None, planner(), now + down);
        (self.unread, self.unsaid) = (VecDeque::new(), VecDeque::new());
        // Who holds a lease is drawn anew by every start.
        let settings = settings(self.boot, self.starts, self.store);
        (self.station, self.known) = match self.disk.clone() {
            None => (Station::new(settings), Knowledge::default()),
            Some((memory, known)) => {
                let known = Knowledge {
                    shown: BTreeMap::new(),
                    ..known
                };
                (Station::resume(settings, memory, [], []), known)
            }
        };
    }

    /// Returns the id of its store.
    pub fn store(&self) -> u64 {
        self.store
    }

    /// Takes what came over the bus.
    pub fn hear(&mut self, now: Time, message: Message) {
        if now >= self.up_from {
            self.unread.push_back(In::Bus(message));
        }
    }

    /// Says how long the disk takes for what is being written.
    pub fn write_until(&mut self, at: Time) {
        if let Some((until, ..)) = &mut self.writing {
            *until = at;
        }
    }

    /// Does one thing.
    pub fn turn(&mut self, now: Time, given: &Given) -> Turn {
        if now < self.up_from || !self.has_written(now) {
            return Turn::Rests;
        }
        if let Some(out) = self.unsaid.pop_front() {
            return self.carry_out(now, out);
        }
        let Some(output) = self.step(now, given) else {
            return Turn::Rests;
        };
        let output: Vec<Out> = output
            .into_iter()
            .map(|out| self.as_mistaken(out))
            .collect();
        let wrong = output.iter().find_map(|out| self.judge_order(now, out));
        self.unsaid.extend(output);
        wrong.map_or(Turn::Acted, Turn::Wrong)
    }

    /// Returns whether nothing is being written that has to be waited for.
    fn has_written(&mut self, now: Time) -> bool {
        let written = self.writing.take_if(|(until, ..)| *until <= now);
        if let Some((_, memory, known)) = written {
            self.disk = Some((memory, known));
        }
        self.writing.is_none() || self.mistake == Some(Mistake::GroundDoesNotWait)
    }

    fn carry_out(&mut self, now: Time, out: Out) -> Turn {
        match out {
            Out::Publish(message) => {
                let wrong = if let Message::Plan(plan) = &message {
                    self.judge_plan(plan)
                } else {
                    None
                };
                return wrong.map_or_else(|| Turn::Publish(Box::new(message)), Turn::Wrong);
            }
            Out::Remember(memory) => {
                self.writing = Some((now, *memory, self.known.clone()));
                return Turn::Writes;
            }
            Out::Ask(request) => {
                self.planner
                    .handle(self.clock(now), request, &mut Vec::new())
                    .unwrap();
            }
            Out::Reconstruct(job) => {
                let name = PictureName {
                    run: job.run,
                    laps: job.laps,
                    subject: job.subject,
                    stage: job.stage,
                };
                let is_made = true;
                self.unread.push_back(In::Pictured { name, is_made });
            }
            Out::StationEvent(_) | Out::BeginRun { .. } | Out::EndRun(_) => {}
        }
        Turn::Acted
    }

    fn clock(&self, now: Time) -> Time {
        Time::ZERO + now.since(self.up_from)
    }

    /// Lets planner and station do what is due first; `None` = nothing is.
    fn step(&mut self, now: Time, given: &Given) -> Option<Vec<Out>> {
        let clock = self.clock(now);
        if self
            .planner
            .deadline()
            .is_some_and(|deadline| deadline.at <= clock)
        {
            let mut answers: Vec<PlannerAnswer> = Vec::new();
            self.planner.wake(clock, &mut answers).unwrap();
            self.unread.extend(answers.into_iter().map(In::Planned));
        }
        let mut output = Vec::new();
        if self
            .station
            .deadline()
            .is_some_and(|deadline| deadline.at <= clock)
        {
            self.station.wake(clock, &mut output).unwrap();
            return Some(output);
        }
        let input = match self.unread.pop_front()? {
            In::Bus(Message::State(state)) => {
                self.known.take(now, self.store, &state, given);
                In::Bus(Message::State(self.as_seen(state)))
            }
            input @ (In::Bus(_)
            | In::Planned(_)
            | In::Pictured { .. }
            | In::Stops(_)
            | In::StoresSamples(_)
            | In::Troubles(_)) => input,
        };
        self.station.handle(clock, input, &mut output).unwrap();
        Some(output)
    }

    /// Returns a state as a mistaken station sees it.
    fn as_seen(&self, mut state: State) -> State {
        if self.mistake == Some(Mistake::GroundSeesNoStops)
            && self.known.stopped.contains(&state.vehicle)
        {
            state.ordered.kind = None;
        }
        state
    }

    /// Returns what a mistaken station says instead.
    fn as_mistaken(&self, mut out: Out) -> Out {
        if let Out::Publish(Message::Order(order)) = &mut out
            && self.mistake == Some(Mistake::GroundOrdersBelow)
            && self.starts > 1
        {
            order.lease.number = 1;
        }
        out
    }

    /// Judges an order by what the station knows: what an operator has stopped no ground station starts, and none goes on
    /// ordering below what it was shown.
    fn judge_order(&self, now: Time, out: &Out) -> Option<String> {
        let Out::Publish(Message::Order(order)) = out else {
            return None;
        };
        if order.kind == OrderKind::Start && self.known.stopped.contains(&order.vehicle) {
            return Some(format!(
                "the ground starts what an operator has stopped: {order:?}"
            ));
        }
        let (since, shown) = *self.known.shown.get(&order.vehicle)?;
        let is_below = (order.lease, order.revision) < shown && now.since(since) > LEARNS_WITHIN;
        is_below.then(|| format!("the ground orders {order:?} below {shown:?}"))
    }

    /// No edition of a plan is given twice, whatever was forgotten.
    fn judge_plan(&mut self, plan: &Plan) -> Option<String> {
        let name = (self.store, plan.run, plan.revision, plan.vehicle);
        let bare = Plan {
            lease: Lease::default(),
            seen: None,
            ..plan.clone()
        };
        let known = self.plans.insert(name, bare.clone());
        known
            .filter(|known| *known != bare)
            .map(|_| format!("two plans of one name: {name:?}"))
    }
}

fn planner() -> PlannerActor {
    let area = Rect::new(Point::new(0.0, 0.0), Point::new(12.0, 12.0));
    let ring = Ring::new(area, 16).unwrap();
    PlannerActor::new(ring, Method::RotatingGap { laps: Some(1) }, 1.2, PLANS_FOR)
}

fn settings(boot: Boot, start: u64, store: u64) -> StationSettings {
    StationSettings {
        vehicles: (1..=VEHICLES).map(VehicleId).collect(),
        lease: None,
        holder: 8 + start,
        take_over: false,
        boot,
        compare_with: None,
        // Short, so that vehicles are lost and found within a world.
        lost_after: Duration::from_secs(4),
        autonomy: Duration::from_secs(5),
        fence_m: 48.0,
        store,
        lattice: Lattice::new(0.2),
        image_times: ImageTimes::Lap,
        bin_m: 0.5,
        spot_m: 0.06,
    }
}
