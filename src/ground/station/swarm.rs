//! A station with scripted vehicles that follow its plans by the real rules, one stop a second: they fall silent, come
//! back, are started anew, and the station is killed and resumed anywhere.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tomoswarm_proto::{
    Boot, Have, Mission, MissionEnd, MissionKind, Mode, Order, OrderKind, Ordered, Permille, Plan,
    PoseReport, Position, Progress, Report, Revision, RunId, Sample, Samples, State, StationPhase, VehicleId,
};

use super::super::imager::Job;
use super::super::planner::{Answer, Method, Planner, Request};
use super::*;
use crate::geom::{Lattice, Point, Rect};
use crate::sweep::{Follower, Ring};

mod operators;

const RUN: RunId = RunId(2);
const LEASE: Lease = Lease { number: 1, holder: 1 };

/// A vehicle that reaches the next stop within a second.
struct Rover {
    id: VehicleId,
    boot: Boot,
    at: Point,
    sequence: u64,
    ordered: Ordered,
    follower: Follower,
    kept: Vec<(Boot, RunId, Sample)>,
    /// What the ground has: everything below.
    marks: BTreeMap<(Boot, RunId), u64>,
    /// A mission of its own that it is out for, and how it ended.
    own: Option<(MissionKind, Option<MissionEnd>)>,
    /// Whether it is switched off.
    is_dead: bool,
    /// Whether it neither hears nor is heard on the bus.
    is_cut: bool,
}

impl Rover {
    fn new(id: u8) -> Rover {
        let (id, at) = (VehicleId(id), Point::new(2.0 * f64::from(id), -1.0));
        Rover {
            id,
            boot: Boot(1),
            at,
            sequence: 0,
            ordered: Ordered::default(),
            follower: Follower::new(id, at, 0.5),
            kept: Vec::new(),
            marks: BTreeMap::new(),
            own: None,
            is_dead: false,
            is_cut: false,
        }
    }

    fn restart(&mut self) {
        self.boot = Boot(self.boot.0 + 1);
        (self.sequence, self.ordered) = (0, Ordered::default());
        self.follower = Follower::new(self.id, self.at, 0.5);
    }

    fn switch_on(&mut self) {
        if std::mem::take(&mut self.is_dead) {
            self.restart();
        }
    }

    fn progress(&self) -> VehicleProgress {
        VehicleProgress { boot: self.boot, ..self.follower.progress() }
    }

    /// Drives to the next stop; one at which somebody else stands is given up, as a vehicle does that finds no way.
    fn drive(&mut self, now: Time, others: &[Point]) {
        self.follower.hold(self.at);
        if self.ordered.kind != Some(OrderKind::Start) {
            return;
        }
        self.follower.resume();
        let Some(stop) = self.follower.next_leg().cloned() else { return };
        self.follower.enter(stop.id).unwrap();
        let place = Point::from(stop.at);
        if others.iter().all(|other| other.distance_to(place) > 1.2) {
            self.at = place;
        }
        self.follower.arrive(now, stop.id, self.at).unwrap();
        let run = self.follower.progress().run;
        let sequence = self.kept.iter().filter(|kept| (kept.0, kept.1) == (self.boot, run)).count() as u64;
        let place = |seed: f64| Position::from_metres((seed * 3.7).fract() * 9.0, (seed * 1.3).fract(), 0.0);
        let pose = |seed: f64| PoseReport { at: place(seed), ..PoseReport::default() };
        let seed = 0.37 * sequence as f64 + f64::from(self.id.0);
        let sample = Sample {
            sequence,
            heard_at_ns: 0,
            transmitter: VehicleId(9),
            transmitter_pose: pose(seed),
            receiver_pose: pose(seed * 0.1 + 0.5),
            channel: 11,
            power_dbm: 0,
            rssi_dbm: Some(-50 - (sequence % 9) as i16),
        };
        self.kept.push((self.boot, run, sample));
    }

    fn says(&mut self) -> Vec<Message> {
        self.sequence += 1;
        let progress = self.progress();
        let state = State {
            vehicle: self.id,
            boot: self.boot,
            sequence: self.sequence,
            pose: Some(PoseReport { at: self.at.into(), ..PoseReport::default() }),
            is_at_rest: true,
            mode: Mode::Idle,
            battery: Some(Permille::WHOLE),
            leg: None,
            accepted: (progress.run, progress.revision),
            ordered: self.ordered,
            ..State::default()
        };
        let batch = |(boot, run, sample): &(Boot, RunId, Sample)| {
            let (vehicle, boot, run, samples) = (self.id, *boot, *run, vec![*sample]);
            Message::Samples(Samples { vehicle, boot, run, samples, lost: vec![] })
        };
        let mark = |boot: Boot, run: RunId| self.marks.get(&(boot, run)).copied().unwrap_or(0);
        let open = self.kept.iter().filter(|(boot, run, sample)| sample.sequence >= mark(*boot, *run));
        let batches = open.take(20).map(batch);
        let (vehicle, boot) = (self.id, self.boot);
        let mission = Mission { vehicle, boot, progress: progress.into(), ..Mission::default() };
        let mission = match self.own {
            Some((kind, end)) => {
                let progress = Progress { run: self.ordered.run, ..Progress::default() };
                Mission { progress, kind, end, ..mission }
            }
            None => mission,
        };
        batches.chain([Message::State(state), Message::Mission(mission)]).collect()
    }

    fn hears(&mut self, message: &Message) {
        match message {
            Message::Plan(plan) if plan.lease >= self.ordered.lease => {
                self.follower.offer(plan);
            }
            Message::Order(order) => self.obey(order),
            Message::Have(have) => {
                let own = have.watermarks.iter().filter(|mark| mark.vehicle == self.id);
                self.marks.extend(own.map(|mark| ((mark.boot, mark.run), mark.below)));
            }
            _ => {}
        }
    }

    fn obey(&mut self, order: &Order) {
        let Order { lease, revision, run, kind, .. } = *order;
        if order.vehicle == self.id && (lease, revision) > self.ordered.edition() {
            self.ordered = Ordered { lease, revision, run, kind: Some(kind) };
        }
    }
}

/// Everything around a station.
struct Swarm {
    station: Station,
    settings: StationSettings,
    planner: Planner,
    rovers: Vec<Rover>,
    /// Seconds since the beginning, and since the station was started.
    now_s: u64,
    up_s: u64,
    memory: Option<Memory>,
    remembered: usize,
    disk: BTreeMap<(VehicleId, Boot, RunId, u64), Sample>,
    answers: Vec<In>,
    notes: Vec<Note>,
    /// The runs that were begun, and what each is compared with.
    begun: Vec<(RunId, Option<RunId>)>,
    jobs: Vec<Job>,
    reports: Vec<Report>,
    haves: Vec<Have>,
    /// Every plan that was ever published; two of one name must be the same.
    plans: BTreeMap<(RunId, Revision, VehicleId), Plan>,
}

fn settings(vehicles: u8) -> StationSettings {
    StationSettings {
        vehicles: (1..=vehicles).map(VehicleId).collect(),
        lease: Some(LEASE),
        holder: 1,
        take_over: false,
        boot: Boot(1),
        compare_with: None,
        lost_after: Duration::from_secs(30),
        autonomy: Duration::from_secs(60),
        store: 7,
        lattice: Lattice::new(0.2),
        bin_m: 0.5,
        spot_m: 0.06,
    }
}

impl Swarm {
    fn new(vehicles: u8, settings: StationSettings) -> Swarm {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(12.0, 12.0));
        let ring = Ring::new(area, 24).unwrap();
        let method = Method::RotatingGap { laps: Some(2) };
        Swarm {
            station: Station::new(settings.clone()),
            settings,
            planner: Planner::new(ring, method, 1.2, Duration::from_millis(10)),
            rovers: (1..=vehicles).map(Rover::new).collect(),
            now_s: 0,
            up_s: 0,
            memory: None,
            remembered: 0,
            disk: BTreeMap::new(),
            answers: Vec::new(),
            notes: Vec::new(),
            begun: Vec::new(),
            jobs: Vec::new(),
            reports: Vec::new(),
            haves: Vec::new(),
            plans: BTreeMap::new(),
        }
    }

    fn sweeping(vehicles: u8) -> Swarm {
        let mut swarm = Swarm::new(vehicles, settings(vehicles));
        order(&mut swarm, RUN, OrderKind::Start);
        swarm
    }

    fn up(&self) -> Time {
        Time::ZERO + Duration::from_secs(self.up_s)
    }

    /// Tells the station something; of all that it says only the first `carried` things get anywhere.
    fn tell(&mut self, input: In, carried: usize) {
        let mut out = Vec::new();
        self.station.handle(self.up(), input, &mut out).unwrap();
        out.truncate(carried);
        self.carry_out(out);
    }

    fn carry_out(&mut self, out: Vec<Out>) {
        for said in out {
            match said {
                Out::Publish(message) => self.publish(&message),
                Out::Ask(request) => self.ask(request),
                Out::Reconstruct(job) => {
                    let Job { run, laps, subject, .. } = job;
                    self.answers.push(In::Pictured(PictureName { run, laps, subject }));
                    self.jobs.push(job);
                }
                Out::Note(note) => self.notes.push(note),
                Out::BeginRun { run, compared_with } => self.begun.push((run, compared_with)),
                Out::EndRun(_) => {}
                Out::Remember(memory) => {
                    self.remembered += 1;
                    let bytes = tomoswarm_proto::codec::pack(&*memory).unwrap();
                    self.memory = Some(tomoswarm_proto::codec::unpack(&bytes).unwrap());
                }
            }
        }
    }

    fn publish(&mut self, message: &Message) {
        match message {
            Message::Plan(plan) => {
                let name = (plan.run, plan.revision, plan.vehicle);
                let bare = Plan { lease: Lease::default(), seen: None, ..plan.clone() };
                let known = self.plans.insert(name, bare.clone());
                assert!(known.is_none_or(|known| known == bare), "two plans of one name: {name:?}");
            }
            Message::Report(report) => self.reports.push(report.clone()),
            Message::Have(have) => self.haves.push(have.clone()),
            _ => {}
        }
        for rover in self.rovers.iter_mut().filter(|rover| !rover.is_dead && !rover.is_cut) {
            rover.hears(message);
        }
    }

    fn ask(&mut self, request: Request) {
        let mut answers: Vec<Answer> = Vec::new();
        self.planner.handle(self.up(), request, &mut answers).unwrap();
        self.planner.wake(self.up(), &mut answers).unwrap();
        self.answers.extend(answers.into_iter().map(In::Planned));
    }

    /// One second, after which the station is killed if only `carried` of what it says at the end gets anywhere.
    fn second(&mut self, carried: usize) {
        (self.now_s, self.up_s) = (self.now_s + 1, self.up_s + 1);
        let now = Time::ZERO + Duration::from_secs(self.now_s);
        let heard: Vec<VehicleProgress> =
            self.rovers.iter().filter(|rover| !rover.is_dead).map(Rover::progress).collect();
        for index in 0..self.rovers.len() {
            let others = self.rovers.iter().enumerate().filter(|(other, _)| *other != index);
            let places: Vec<Point> = others.map(|(_, rover)| rover.at).collect();
            let rover = &mut self.rovers[index];
            if !rover.is_dead {
                heard.iter().for_each(|progress| rover.follower.hear(now, progress));
                rover.drive(now, &places);
            }
        }
        for answer in std::mem::take(&mut self.answers) {
            self.tell(answer, usize::MAX);
        }
        let is_heard = |rover: &&mut Rover| !rover.is_dead && !rover.is_cut;
        let said: Vec<Message> = self.rovers.iter_mut().filter(is_heard).flat_map(Rover::says).collect();
        for message in said {
            if let Message::Samples(batch) = &message {
                let key = |sample: &Sample| (batch.vehicle, batch.boot, batch.run, sample.sequence);
                self.disk.extend(batch.samples.iter().map(|sample| (key(sample), *sample)));
            }
            self.tell(In::Bus(message), usize::MAX);
        }
        let mut out = Vec::new();
        self.station.wake(self.up(), &mut out).unwrap();
        out.truncate(carried);
        self.carry_out(out);
    }

    fn seconds(&mut self, count: u64) {
        (0..count).for_each(|_| self.second(usize::MAX));
    }

    /// Starts the station anew from what was stored, samples newest first.
    fn resume(&mut self) {
        (self.up_s, self.answers) = (0, Vec::new());
        let batch = |((vehicle, boot, run, _), sample): (&(VehicleId, Boot, RunId, u64), &Sample)| Samples {
            vehicle: *vehicle,
            boot: *boot,
            run: *run,
            samples: vec![*sample],
            lost: vec![],
        };
        let samples: Vec<Samples> = self.disk.iter().rev().map(batch).collect();
        let settings = StationSettings { boot: Boot(2), ..self.settings.clone() };
        let memory = self.memory.clone().expect("something was remembered");
        self.station = Station::resume(settings, memory, samples, []);
    }

    fn until(&mut self, within_s: u64, is_so: impl Fn(&Note) -> bool) -> bool {
        for _ in 0..within_s {
            if self.notes.iter().any(&is_so) {
                return true;
            }
            self.second(usize::MAX);
        }
        false
    }

    fn is_closed(&mut self, within_s: u64) -> bool {
        self.until(within_s, |note| matches!(note, Note::RunClosed { .. }))
    }

    fn count(&self, is_so: impl Fn(&Note) -> bool) -> usize {
        self.notes.iter().filter(|note| is_so(note)).count()
    }

    fn laps(&self) -> usize {
        self.count(|note| matches!(note, Note::LapDone { .. }))
    }

    fn measured(&self) -> usize {
        self.rovers.iter().map(|rover| rover.kept.len()).sum()
    }

    fn report(&self) -> &Report {
        self.reports.last().expect("a report a second")
    }

    /// The last jobs of the run: what its pictures are made of.
    fn last_jobs(&self) -> BTreeSet<String> {
        self.jobs.iter().filter(|job| job.is_last).map(|job| format!("{job:?}")).collect()
    }
}

#[test]
fn a_sweep_is_driven_and_closed_and_every_sample_is_stored_once() {
    let mut swarm = Swarm::sweeping(3);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    swarm.seconds(2);
    assert_eq!(swarm.laps(), 2);
    assert_eq!(swarm.station.samples().count(RUN), swarm.measured() as u64);
    let report = swarm.report();
    assert_eq!((report.phase, report.run, report.laps_done), (StationPhase::Idle, RUN, 2));
    assert_eq!((report.images, report.samples), (1, swarm.measured() as u64));
    assert_eq!(swarm.haves.last().unwrap().closed, [RUN]);
    assert_eq!(report.troubles, [""; 0]);
    assert!(swarm.remembered < 30, "remembered {} times in {} s", swarm.remembered, swarm.now_s);
}

#[test]
fn killed_anywhere_the_station_goes_on_to_the_same_end_by_the_same_plans() {
    let mut whole = Swarm::sweeping(3);
    assert!(whole.is_closed(400));
    whole.seconds(30);
    for killed_s in 1..whole.now_s - 10 {
        // All, nothing, or only the first thing said in the last second got anywhere.
        let carried = [usize::MAX, 0, 1][killed_s as usize % 3];
        let mut swarm = Swarm::sweeping(3);
        swarm.seconds(killed_s - 1);
        swarm.second(carried);
        swarm.resume();
        // What was noted in the last second is lost with it.
        let is_closed = |swarm: &Swarm| swarm.haves.last().is_some_and(|have| have.closed == [RUN]);
        let ended = (0..400).any(|_| {
            swarm.second(usize::MAX);
            is_closed(&swarm)
        });
        assert!(ended, "killed after {killed_s} s: {:?}", swarm.notes);
        swarm.seconds(30);
        assert_eq!(swarm.count(|note| matches!(note, Note::Replans(_))), 0, "killed after {killed_s} s");
        assert_eq!(swarm.plans, whole.plans, "killed after {killed_s} s");
        assert_eq!(swarm.last_jobs(), whole.last_jobs(), "killed after {killed_s} s");
        assert_eq!(swarm.station.samples().count(RUN), whole.station.samples().count(RUN));
        let (report, expected) = (swarm.report(), whole.report());
        assert_eq!((report.laps_done, report.samples), (expected.laps_done, expected.samples));
        assert_eq!(report.images, expected.images, "killed after {killed_s} s");
        assert_eq!(report.phase, StationPhase::Idle);
    }
}

#[test]
fn killed_again_and_again_it_still_comes_to_an_end() {
    let mut swarm = Swarm::sweeping(3);
    for killed_s in [5, 7, 9, 11, 13, 8, 6, 20, 3, 9] {
        swarm.seconds(killed_s);
        swarm.resume();
    }
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.laps(), 2);
    assert_eq!(swarm.station.samples().count(RUN), swarm.measured() as u64);
}

#[test]
fn the_others_take_over_a_lost_vehicles_work_and_back_it_works_again() {
    let mut swarm = Swarm::sweeping(4);
    swarm.seconds(30);
    swarm.rovers[2].is_dead = true;
    let (lost, lost_s) = (VehicleId(3), swarm.now_s);
    let plans_known = swarm.plans.len();
    assert!(swarm.until(60, |note| *note == Note::Lost(lost)));
    swarm.seconds(2);
    assert_eq!((swarm.report().phase, &swarm.report().lost[..]), (StationPhase::Stopping, &[lost][..]));
    assert!(swarm.plans.len() > plans_known, "an empty revision for the others");
    while swarm.report().phase != StationPhase::Running {
        swarm.second(usize::MAX);
    }
    assert!(swarm.now_s - lost_s >= 65, "planned after {} s: it may still drive", swarm.now_s - lost_s);
    assert_eq!(swarm.report().members, [1, 2, 4].map(VehicleId));
    swarm.seconds(10);
    swarm.rovers[2].is_dead = false;
    swarm.rovers[2].restart();
    assert!(swarm.until(5, |note| *note == Note::Found(lost)));
    swarm.seconds(10);
    assert_eq!(swarm.report().members, [1, 2, 3, 4].map(VehicleId));
    let before = swarm.rovers[2].kept.len();
    assert!(swarm.is_closed(600), "{:?}", swarm.notes);
    assert!(swarm.rovers[2].kept.len() > before, "it has got work again");
    assert_eq!(swarm.laps(), 2);
    assert_eq!(swarm.station.samples().count(RUN), swarm.measured() as u64);
}

#[test]
fn one_that_lost_only_the_bus_stands_before_others_are_planned_for() {
    let mut swarm = Swarm::sweeping(4);
    swarm.seconds(30);
    swarm.rovers[1].is_cut = true;
    let mut stood_at = swarm.rovers[1].at;
    while swarm.plans.values().all(|plan| plan.stops.is_empty() || plan.members.len() == 4) {
        stood_at = swarm.rovers[1].at;
        swarm.second(usize::MAX);
        assert!(swarm.now_s < 300, "{:?}", swarm.notes);
    }
    assert!(swarm.is_closed(600), "{:?}", swarm.notes);
    assert_eq!(swarm.rovers[1].at, stood_at, "it has not moved since the others were planned for");
}

#[test]
fn with_one_vehicle_left_the_sweep_waits_until_another_is_back() {
    let mut swarm = Swarm::sweeping(2);
    swarm.seconds(20);
    swarm.rovers[0].is_dead = true;
    assert!(swarm.until(60, |note| *note == Note::Waits(RUN)), "{:?}", swarm.notes);
    swarm.seconds(1000);
    assert_eq!(swarm.count(|note| matches!(note, Note::NoPlan(_) | Note::Stalled(_))), 0);
    assert_eq!(swarm.report().troubles.len(), 2, "{:?}", swarm.report().troubles);
    swarm.rovers[0].is_dead = false;
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.count(|note| matches!(note, Note::Waits(_))), 1);
}

#[test]
fn when_the_ground_hears_nobody_nobody_is_lost() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(20);
    swarm.rovers.iter_mut().for_each(|rover| rover.is_cut = true);
    swarm.seconds(100);
    swarm.rovers.iter_mut().for_each(|rover| rover.is_cut = false);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.count(|note| matches!(note, Note::Lost(_) | Note::Replans(_))), 0);
}

#[test]
fn a_restarted_vehicle_is_planned_for_anew_and_laps_done_stay_done() {
    let mut swarm = Swarm::sweeping(3);
    assert!(swarm.until(200, |note| matches!(note, Note::LapDone { laps: 1, .. })));
    swarm.seconds(10);
    swarm.rovers[1].restart();
    swarm.seconds(2);
    assert_eq!(swarm.count(|note| *note == Note::Replans(RUN)), 1);
    let revisions = |swarm: &Swarm| swarm.plans.keys().map(|name| name.1).max();
    let empty = revisions(&swarm).unwrap();
    let is_empty =
        |(name, plan): (&(RunId, Revision, VehicleId), &Plan)| name.1 != empty || plan.stops.is_empty();
    assert!(swarm.plans.iter().all(is_empty), "first an empty revision");
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.laps(), 2);
    assert_eq!(swarm.station.samples().count(RUN), swarm.measured() as u64);
}

#[test]
fn a_vehicle_that_restarts_while_the_ground_is_down_is_planned_for_anew() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(40);
    swarm.rovers[1].restart();
    swarm.resume();
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.count(|note| *note == Note::Replans(RUN)), 1);
}

#[test]
fn a_vehicle_that_died_while_the_ground_was_down_is_lost() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(40);
    swarm.rovers[1].is_dead = true;
    swarm.resume();
    assert!(swarm.is_closed(600), "{:?}", swarm.notes);
    assert_eq!(swarm.count(|note| *note == Note::Lost(VehicleId(2))), 1);
}

/// An operator's order to every vehicle: by the station's lease, above each echo.
fn order(swarm: &mut Swarm, run: RunId, kind: OrderKind) {
    let lease = swarm.station.leases.own();
    for rover in &mut swarm.rovers {
        let revision = Revision(rover.ordered.revision.0 + 1);
        rover.obey(&Order { vehicle: rover.id, lease, run, revision, seen: None, kind, ends: vec![] });
    }
}

#[test]
fn an_operator_stops_and_starts_everyone_without_a_fight() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(30);
    order(&mut swarm, RUN, OrderKind::Hold);
    swarm.seconds(2);
    assert_eq!(swarm.report().in_force, Some(OrderKind::Hold));
    let places: Vec<Point> = swarm.rovers.iter().map(|rover| rover.at).collect();
    swarm.seconds(1000);
    assert_eq!(swarm.rovers.iter().map(|rover| rover.at).collect::<Vec<_>>(), places);
    order(&mut swarm, RUN, OrderKind::Start);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.report().in_force, None);
    assert_eq!(swarm.count(|note| matches!(note, Note::Replans(_))), 0);
}

#[test]
fn an_operators_start_begins_the_run_that_it_names() {
    let settings = StationSettings { lease: None, compare_with: Some(RunId(1)), ..settings(3) };
    let mut swarm = Swarm::new(3, settings);
    swarm.seconds(10);
    assert_eq!(swarm.station.leases.own(), Lease { number: 1, holder: 1 });
    order(&mut swarm, RunId(1), OrderKind::Start);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    swarm.notes.clear();
    order(&mut swarm, RunId(1), OrderKind::Start);
    swarm.seconds(20);
    assert!(swarm.notes.is_empty(), "that run was driven: {:?}", swarm.notes);
    order(&mut swarm, RunId(2), OrderKind::Start);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    let change = swarm.jobs.last().unwrap();
    let compared = swarm.jobs.iter().rfind(|job| !job.empty.is_empty()).expect("a picture of changes");
    assert_eq!((compared.run, change.run), (RunId(2), RunId(2)));
}

#[test]
fn of_two_grounds_one_leads_and_the_other_takes_over_when_it_is_gone() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(30);
    let other = Report { lease: Lease { number: 9, holder: 5 }, ..Report::default() };
    for _ in 0..20 {
        swarm.tell(In::Bus(Message::Report(other.clone())), usize::MAX);
        let (plans, haves) = (swarm.plans.len(), swarm.haves.len());
        swarm.second(usize::MAX);
        assert_eq!((swarm.plans.len(), swarm.haves.len()), (plans, haves), "who stands by is silent");
        assert_eq!(swarm.report().lease.number, 0);
        assert_eq!(swarm.report().troubles.len(), 1, "{:?}", swarm.report().troubles);
    }
    assert_eq!(swarm.count(|note| matches!(note, Note::StandsBy(_))), 1);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!(swarm.station.leases.own(), Lease { number: 10, holder: 1 });
    assert_eq!(swarm.count(|note| matches!(note, Note::Replans(_))), 0, "nobody has given other plans");
}

#[test]
fn a_resumed_station_leads_above_every_echo() {
    let mut swarm = Swarm::sweeping(3);
    swarm.seconds(30);
    swarm.resume();
    swarm.seconds(2);
    assert_eq!(swarm.report().lease, Lease::default(), "it listens first");
    swarm.seconds(3);
    assert_eq!(swarm.report().lease, Lease { number: 2, holder: 1 });
}

#[test]
fn a_vehicle_that_is_never_heard_does_not_keep_the_others_waiting() {
    let mut swarm = Swarm::sweeping(3);
    swarm.rovers[2].is_dead = true;
    swarm.seconds(29);
    assert_eq!(swarm.report().phase, StationPhase::Waiting);
    assert!(swarm.until(10, |note| *note == Note::Lost(VehicleId(3))), "{:?}", swarm.notes);
    swarm.seconds(60);
    assert_eq!(swarm.report().members, [1, 2].map(VehicleId));
    swarm.rovers[2].switch_on();
    assert!(swarm.is_closed(600), "{:?}", swarm.notes);
    assert!(!swarm.rovers[2].kept.is_empty(), "it has joined in");
    let mut alone = Swarm::sweeping(3);
    alone.rovers[1].is_dead = true;
    alone.rovers[2].is_dead = true;
    alone.seconds(200);
    assert_eq!(alone.report().phase, StationPhase::Waiting, "one alone measures nothing");
}

#[test]
fn a_lost_vehicle_that_was_stopped_comes_back_stopped() {
    let mut swarm = Swarm::sweeping(4);
    swarm.seconds(30);
    let revision = Revision(swarm.rovers[1].ordered.revision.0 + 1);
    let (vehicle, lease, kind) = (VehicleId(2), LEASE, OrderKind::Land);
    swarm.rovers[1].obey(&Order { vehicle, lease, run: RUN, revision, seen: None, kind, ends: vec![] });
    swarm.seconds(2);
    swarm.rovers[1].is_cut = true;
    assert!(swarm.until(60, |note| *note == Note::Lost(vehicle)), "{:?}", swarm.notes);
    swarm.seconds(60);
    assert_eq!((swarm.report().in_force, swarm.report().members.len()), (None, 3), "the others go on");
    swarm.rovers[1].is_cut = false;
    swarm.seconds(20);
    assert_eq!(swarm.rovers[1].ordered.kind, Some(OrderKind::Land));
    assert_eq!(swarm.report().in_force, Some(OrderKind::Land));
}

#[test]
fn plans_and_pictures_that_get_lost_are_asked_for_again() {
    let mut swarm = Swarm::sweeping(3);
    while swarm.answers.is_empty() {
        swarm.second(usize::MAX);
    }
    swarm.answers.clear();
    swarm.seconds(32);
    assert!(swarm.until(5, |note| matches!(note, Note::Planned { .. })), "{:?}", swarm.notes);
    assert!(swarm.is_closed(400), "{:?}", swarm.notes);
    assert_eq!((swarm.answers.len(), swarm.count(|note| matches!(note, Note::Replans(_)))), (1, 0));
    swarm.answers.clear();
    swarm.seconds(119);
    assert_eq!(swarm.jobs.len(), 1);
    swarm.seconds(5);
    assert_eq!((swarm.jobs.len(), swarm.last_jobs().len(), swarm.report().images), (2, 1, 1));
    swarm.seconds(200);
    assert_eq!(swarm.jobs.len(), 2, "it was made");
}

#[test]
fn a_ground_with_an_empty_disk_begins_no_sweep_that_was_driven_long_ago() {
    let fresh = StationSettings { lease: None, holder: 5, ..settings(3) };
    for is_known in [false, true] {
        let mut swarm = Swarm::sweeping(3);
        assert!(swarm.is_closed(400));
        let lease = swarm.rovers[0].ordered.lease;
        if is_known {
            // A vehicle that was started anew has forgotten what it drove, but the store has not.
            swarm.rovers[1].follower = Follower::new(VehicleId(2), swarm.rovers[1].at, 0.5);
        }
        swarm.station = Station::new(fresh.clone());
        if is_known {
            swarm.station.recall_runs([(RUN, true)]);
        }
        (swarm.up_s, swarm.notes) = (0, Vec::new());
        swarm.seconds(60);
        assert_eq!((swarm.report().phase, swarm.report().run), (StationPhase::Idle, RunId::default()));
        assert!(swarm.rovers.iter().all(|rover| rover.ordered.lease == lease), "nobody was ordered anything");
    }
}

/// A pure draw below `limit`.
fn draw(seed: u64, second: u64, purpose: u64, limit: u64) -> u64 {
    let mut state =
        seed ^ second.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ purpose.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    for _ in 0..3 {
        state = (state ^ (state >> 30)).wrapping_mul(0x94d0_49bb_1331_11eb);
    }
    (state >> 20) % limit
}

impl Swarm {
    /// Something may go wrong in this second.
    fn suffer(&mut self, seed: u64) {
        let rover = draw(seed, self.now_s, 1, self.rovers.len() as u64) as usize;
        match draw(seed, self.now_s, 2, 60) {
            0 => self.rovers[rover].restart(),
            1 => self.rovers[rover].is_dead = true,
            2 => self.rovers[rover].is_cut = true,
            3 | 4 => self.rovers[rover].switch_on(),
            5 | 6 => self.rovers[rover].is_cut = false,
            7 => order(self, RUN, OrderKind::Hold),
            8..11 => order(self, RUN, OrderKind::Start),
            11 if self.memory.is_some() => {
                self.second(draw(seed, self.now_s, 3, 4) as usize);
                self.resume();
            }
            _ => {}
        }
    }
}

#[test]
fn whatever_goes_wrong_afterwards_the_sweep_ends_and_no_sample_is_lost_or_doubled() {
    for seed in 0..60 {
        let mut swarm = Swarm::sweeping(3 + seed as u8 % 2);
        for _ in 0..500 {
            swarm.suffer(seed);
            swarm.second(usize::MAX);
        }
        for rover in &mut swarm.rovers {
            rover.is_cut = false;
            rover.switch_on();
        }
        swarm.seconds(20);
        order(&mut swarm, RUN, OrderKind::Start);
        let is_closed = |swarm: &Swarm| swarm.haves.last().is_some_and(|have| have.closed == [RUN]);
        let ended = (0..1500).any(|_| {
            swarm.second(usize::MAX);
            is_closed(&swarm)
        });
        assert!(ended, "seed {seed}: {:?}, {:?}", swarm.report(), swarm.notes);
        swarm.seconds(60);
        assert_eq!(swarm.station.samples().count(RUN), swarm.measured() as u64, "seed {seed}");
        assert!(swarm.report().laps_done >= 2, "seed {seed}");
    }
}
