//! A swarm for tests of the station: it, a real planner, and scripted vehicles that follow its plans by the real rules, one
//! stop a second. They fall silent, come back, are started anew, and the station is killed and resumed anywhere. The tests
//! are in the modules beside it: what becomes of sweeps, and what operators say.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tomoswarm_proto::{
    Boot, GroundReport, Have, MissionEnd, MissionKind, MissionProgress, Order, OrderKind, Ordered,
    Permille, Plan, PoseReport, Position, Progress, Revision, RunId, Sample, Samples, State,
    StationPhase, VehicleId, VehicleMode,
};

use super::super::*;
use crate::config::ImageTimes;
use crate::geom::{Lattice, Point, Rect};
use crate::ground::imager::{ImageStage, Job};
use crate::ground::planner::{Method, PlannerActor, PlannerAnswer, Request};
use crate::sweep::{Follower, Ring};

mod operators;
mod sweeps;

const RUN: RunId = RunId(2);
const LEASE: Lease = Lease {
    number: 1,
    holder: 1,
};

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
        VehicleProgress {
            boot: self.boot,
            ..self.follower.progress()
        }
    }

    /// Drives to the next stop; one at which somebody else stands is given up, as a vehicle does that finds no way.
    fn drive(&mut self, now: Time, others: &[Point]) {
        self.follower.hold(self.at);
        if self.ordered.kind != Some(OrderKind::Start) {
            return;
        }
        self.follower.resume();
        let Some(stop) = self.follower.next_leg().cloned() else {
            return;
        };
        self.follower.enter(stop.id).unwrap();
        let place = Point::from(stop.at);
        if others.iter().all(|other| other.distance_to(place) > 1.2) {
            self.at = place;
        }
        self.follower.arrive(now, stop.id, self.at).unwrap();
        let run = self.follower.progress().run;
        let sequence = self
            .kept
            .iter()
            .filter(|kept| (kept.0, kept.1) == (self.boot, run))
            .count() as u64;
        let place = |seed: f64| {
            Position::from_metres((seed * 3.7).fract() * 9.0, (seed * 1.3).fract(), 0.0)
        };
        let pose = |seed: f64| PoseReport {
            at: place(seed),
            ..PoseReport::default()
        };
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
            pose: Some(PoseReport {
                at: self.at.into(),
                ..PoseReport::default()
            }),
            is_at_rest: true,
            mode: VehicleMode::Idle,
            battery: Some(Permille::WHOLE),
            leg: None,
            accepted: (progress.run, progress.revision),
            ordered: self.ordered,
            ..State::default()
        };
        let batch = |(boot, run, sample): &(Boot, RunId, Sample)| {
            let (vehicle, boot, run, samples) = (self.id, *boot, *run, vec![*sample]);
            Message::Samples(Samples {
                vehicle,
                boot,
                run,
                samples,
                lost: vec![],
            })
        };
        let mark = |boot: Boot, run: RunId| self.marks.get(&(boot, run)).copied().unwrap_or(0);
        let open = self
            .kept
            .iter()
            .filter(|(boot, run, sample)| sample.sequence >= mark(*boot, *run));
        let batches = open.take(20).map(batch);
        let (vehicle, boot) = (self.id, self.boot);
        let mission = MissionProgress {
            vehicle,
            boot,
            progress: progress.into(),
            ..MissionProgress::default()
        };
        let mission = match self.own {
            Some((kind, end)) => {
                let progress = Progress {
                    run: self.ordered.run,
                    ..Progress::default()
                };
                MissionProgress {
                    progress,
                    kind,
                    end,
                    ..mission
                }
            }
            None => mission,
        };
        batches
            .chain([Message::State(state), Message::Mission(mission)])
            .collect()
    }

    fn hears(&mut self, message: &Message) {
        match message {
            Message::Plan(plan) if plan.lease >= self.ordered.lease => {
                self.follower.offer(plan);
            }
            Message::Order(order) => self.obey(order),
            Message::Have(have) => {
                let own = have
                    .watermarks
                    .iter()
                    .filter(|mark| mark.vehicle == self.id);
                self.marks
                    .extend(own.map(|mark| ((mark.boot, mark.run), mark.below)));
            }
            _ => {}
        }
    }

    fn obey(&mut self, order: &Order) {
        let Order {
            lease,
            revision,
            run,
            kind,
            ..
        } = *order;
        if order.vehicle == self.id && (lease, revision) > self.ordered.edition() {
            self.ordered = Ordered {
                lease,
                revision,
                run,
                kind: Some(kind),
            };
        }
    }
}

/// Everything around a station.
struct Swarm {
    station: Station,
    settings: StationSettings,
    planner: PlannerActor,
    rovers: Vec<Rover>,
    /// Seconds since the beginning, and since the station was started.
    now_s: u64,
    up_s: u64,
    memory: Option<StationMemory>,
    remembered: usize,
    disk: BTreeMap<(VehicleId, Boot, RunId, u64), Sample>,
    answers: Vec<In>,
    notes: Vec<StationEvent>,
    /// The runs that were begun, and what each is compared with.
    begun: Vec<(RunId, Option<RunId>)>,
    jobs: Vec<Job>,
    reports: Vec<GroundReport>,
    haves: Vec<Have>,
    /// Every plan that was ever published; two of one name must be the same.
    plans: BTreeMap<(RunId, Revision, VehicleId), Plan>,
}

pub(super) fn settings(vehicles: u8) -> StationSettings {
    StationSettings {
        vehicles: (1..=vehicles).map(VehicleId).collect(),
        lease: Some(LEASE),
        holder: 1,
        take_over: false,
        boot: Boot(1),
        compare_with: None,
        lost_after: Duration::from_secs(30),
        autonomy: Duration::from_secs(60),
        fence_m: 72.0,
        store: 7,
        lattice: Lattice::new(0.2),
        image_times: ImageTimes::Lap,
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
            planner: PlannerActor::new(ring, method, 1.2, Duration::from_millis(10)),
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
        for output in out {
            match output {
                Out::Publish(message) => self.publish(&message),
                Out::Ask(request) => self.ask(request),
                Out::Reconstruct(job) => {
                    let Job {
                        run,
                        laps,
                        subject,
                        stage,
                        ..
                    } = job;
                    let name = PictureName {
                        run,
                        laps,
                        subject,
                        stage,
                    };
                    let is_made = true;
                    self.answers.push(In::Pictured { name, is_made });
                    self.jobs.push(job);
                }
                Out::StationEvent(note) => self.notes.push(note),
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
                let bare = Plan {
                    lease: Lease::default(),
                    seen: None,
                    ..plan.clone()
                };
                let known = self.plans.insert(name, bare.clone());
                assert!(
                    known.is_none_or(|known| known == bare),
                    "two plans of one name: {name:?}"
                );
            }
            Message::Report(report) => self.reports.push(report.clone()),
            Message::Have(have) => self.haves.push(have.clone()),
            _ => {}
        }
        for rover in self
            .rovers
            .iter_mut()
            .filter(|rover| !rover.is_dead && !rover.is_cut)
        {
            rover.hears(message);
        }
    }

    fn ask(&mut self, request: Request) {
        let mut answers: Vec<PlannerAnswer> = Vec::new();
        self.planner
            .handle(self.up(), request, &mut answers)
            .unwrap();
        self.planner.wake(self.up(), &mut answers).unwrap();
        self.answers.extend(answers.into_iter().map(In::Planned));
    }

    /// One second, after which the station is killed if only `carried` of what it says at the end gets anywhere.
    fn second(&mut self, carried: usize) {
        (self.now_s, self.up_s) = (self.now_s + 1, self.up_s + 1);
        let now = Time::ZERO + Duration::from_secs(self.now_s);
        let heard: Vec<VehicleProgress> = self
            .rovers
            .iter()
            .filter(|rover| !rover.is_dead)
            .map(Rover::progress)
            .collect();
        for index in 0..self.rovers.len() {
            let others = self
                .rovers
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != index);
            let places: Vec<Point> = others.map(|(_, rover)| rover.at).collect();
            let rover = &mut self.rovers[index];
            if !rover.is_dead {
                heard
                    .iter()
                    .for_each(|progress| rover.follower.hear(now, progress));
                rover.drive(now, &places);
            }
        }
        for answer in std::mem::take(&mut self.answers) {
            self.tell(answer, usize::MAX);
        }
        let is_heard = |rover: &&mut Rover| !rover.is_dead && !rover.is_cut;
        let output: Vec<Message> = self
            .rovers
            .iter_mut()
            .filter(is_heard)
            .flat_map(Rover::says)
            .collect();
        for message in output {
            if let Message::Samples(batch) = &message {
                let key = |sample: &Sample| (batch.vehicle, batch.boot, batch.run, sample.sequence);
                self.disk
                    .extend(batch.samples.iter().map(|sample| (key(sample), *sample)));
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
        let batch =
            |((vehicle, boot, run, _), sample): (&(VehicleId, Boot, RunId, u64), &Sample)| {
                Samples {
                    vehicle: *vehicle,
                    boot: *boot,
                    run: *run,
                    samples: vec![*sample],
                    lost: vec![],
                }
            };
        let samples: Vec<Samples> = self.disk.iter().rev().map(batch).collect();
        let settings = StationSettings {
            boot: Boot(2),
            ..self.settings.clone()
        };
        let memory = self.memory.clone().expect("something was remembered");
        self.station = Station::resume(settings, memory, samples, []);
    }

    fn until(&mut self, within_s: u64, is_so: impl Fn(&StationEvent) -> bool) -> bool {
        for _ in 0..within_s {
            if self.notes.iter().any(&is_so) {
                return true;
            }
            self.second(usize::MAX);
        }
        false
    }

    fn is_closed(&mut self, within_s: u64) -> bool {
        self.until(within_s, |note| {
            matches!(note, StationEvent::RunClosed { .. })
        })
    }

    fn count(&self, is_so: impl Fn(&StationEvent) -> bool) -> usize {
        self.notes.iter().filter(|note| is_so(note)).count()
    }

    fn laps(&self) -> usize {
        self.count(|note| matches!(note, StationEvent::LapDone { .. }))
    }

    fn measured(&self) -> usize {
        self.rovers.iter().map(|rover| rover.kept.len()).sum()
    }

    fn report(&self) -> &GroundReport {
        self.reports.last().expect("a report a second")
    }

    /// The last jobs of the run: what its pictures are made of.
    fn last_jobs(&self) -> BTreeSet<String> {
        self.jobs
            .iter()
            .filter(|job| job.stage == ImageStage::Last)
            .map(|job| format!("{job:?}"))
            .collect()
    }
}

/// An operator's order to every vehicle: by the station's lease, above each echo.
fn order(swarm: &mut Swarm, run: RunId, kind: OrderKind) {
    let lease = swarm.station.leases.own();
    for rover in &mut swarm.rovers {
        let revision = Revision(rover.ordered.revision.0 + 1);
        rover.obey(&Order {
            vehicle: rover.id,
            lease,
            run,
            revision,
            seen: None,
            kind,
            ends: vec![],
        });
    }
}
