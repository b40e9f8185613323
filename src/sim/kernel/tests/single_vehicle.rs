//! One vehicle in the simulated world, without bus and ground, for tests that look at every moment: what it was
//! commanded, what it knew then, and where it truly is.

use std::time::Duration;

use tomoswarm_proto::{
    Boot, Have, Lease, Message, Order, OrderKind, Plan, Position, Revision, RunId, SeenState,
    Sender, Stop, StopId, VehicleId,
};

use crate::autopilot::{Ack, Command, NumberedCommand};
use crate::geom::{Angle, Cell, Lattice, Point, Rect};
use crate::map::{CellRect, Merged};
use crate::node::route::VehicleEvent;
use crate::node::sensor::Echo;
use crate::node::vehicle::SafetyEvent;
use crate::node::{
    BodySettings, Effect, Event, LookSettings, RadioSettings, Remembered, VehicleNode,
    VehicleSettings,
};
use crate::scene::{Attenuation, Scene, SceneParts, Up, read_vrml};
use crate::sim::body::DriveLimits;
use crate::sim::noise::Noise;
use crate::sim::radio_field::{RadioConstants, RadioField};
use crate::sim::range::{RangeModel, RangeSensor};
use crate::sim::world::{CommandResult, PredictedContact, VehicleBuild, World, WorldContents};
use crate::time::Time;

const RADIUS_M: f64 = 0.25;
const STEP: Duration = Duration::from_millis(10);

/// Boxes by middle and size, 1 m high.
fn stage(blocks: &[(f64, f64, f64, f64)]) -> WorldContents {
    let shape = |(x, y, width, depth): &(f64, f64, f64, f64)| {
        let shape = format!("Shape {{ geometry Box {{ size {width} {depth} 1 }} }}");
        format!("Transform {{ translation {x} {y} 0.5 children {shape} }}\n")
    };
    let text = blocks
        .iter()
        .fold("#VRML V2.0 utf8\n".to_owned(), |text, block| {
            text + &shape(block)
        });
    let shapes = read_vrml(&text, "boxes.wrl", Up::Z, &mut |_| Err("none".to_owned()))
        .unwrap()
        .shapes;
    let materials = Default::default();
    let scene = Scene::build(&SceneParts {
        shapes: &shapes,
        offset_m: [0.0; 3],
        materials: &materials,
        default_material: Default::default(),
        posts: &[],
        persons: &[],
    });
    let scene = scene.unwrap();
    let attenuation = Attenuation::new(&scene, 0.5, 0.125, 30.0);
    WorldContents { scene, attenuation }
}

fn settings() -> VehicleSettings {
    let degrees = [0.0, 25.0, -25.0, 50.0, -50.0];
    VehicleSettings {
        vehicle: VehicleId(1),
        boot: Boot(1),
        memory: Default::default(),
        stops: Default::default(),
        listens_for: Duration::ZERO,
        fence: Rect::new(Point::new(-4.0, -6.0), Point::new(14.0, 6.0)).polygon(),
        fence_room_m: 4.0,
        expected_sd_m: 0.02,
        home: Point::new(0.0, 0.0),
        lattice: Lattice::new(0.2),
        slice: 0,
        body: BodySettings {
            radius_m: RADIUS_M,
            speed_mps: 0.5,
            braking_mps2: 1.0,
        },
        look: LookSettings {
            is_blind: false,
            beams: degrees.map(Angle::from_degrees).to_vec(),
            half_angle: Angle::from_degrees(15.0),
            min_range_m: 0.02,
            max_range_m: 4.0,
            sure_range_m: 3.0,
            period: Duration::from_millis(100),
            settle: Duration::from_millis(30),
            mounts: crate::plan::Mounts::default(),
            smallest_post: None,
        },
        radio: RadioSettings {
            channel: 15,
            power_dbm: 0,
            slot: Duration::from_millis(50),
            successor: None,
        },
        carried_m: 0.0,
        safety: crate::config::Safety {
            padding_m: 0.1,
            ..Default::default()
        },
        swarm: crate::config::Swarm::default(),
        task: None,
        path_time: Duration::from_millis(50),
        autopilot: crate::autopilot::AutopilotLinkSettings::default(),
    }
}

struct SingleVehicle {
    now: Time,
    world: World,
    node: VehicleNode,
    beam: Angle,
    echoes: Vec<(Time, Echo)>,
    touches: Vec<PredictedContact>,
    /// What the vehicle knew when it was last commanded to drive.
    known: Merged,
    drives: usize,
    notes: Vec<VehicleEvent>,
}

impl SingleVehicle {
    /// Changes which boxes stand there.
    fn set_stage(&mut self, boxes: &[(f64, f64, f64, f64)]) {
        let touches = self.world.set_stage(stage(boxes), self.now);
        self.touches.extend(touches);
    }

    /// A vehicle at the origin that faces along x, with boxes around it.
    fn new(blocks: &[(f64, f64, f64, f64)], seed: u64, pose_sd_m: f64) -> SingleVehicle {
        let build = VehicleBuild {
            radius_m: RADIUS_M,
            height_m: 0.3,
            sensor_m: 0.3,
            limits: DriveLimits {
                speed_mps: 0.5,
                acceleration_mps2: 0.5,
                braking_mps2: 1.0,
                turn_rate_radps: 1.5,
            },
            pose_sd_m,
            pose_drift: Duration::from_secs(20),
            endurance_driving: Duration::from_secs(20_000),
            endurance_resting: Duration::from_secs(80_000),
        };
        let range = RangeModel {
            half_angle_rad: 15f64.to_radians(),
            incidence_max_rad: 60f64.to_radians(),
            ..RangeModel::default()
        };
        let noise = Noise::new(seed);
        let field = RadioField::new(noise, RadioConstants::default());
        let fence = settings().fence;
        let mut world = World::new(
            stage(blocks),
            build,
            fence,
            noise,
            field,
            RangeSensor::new(range),
        );
        world
            .place(VehicleId(1), Point::new(0.0, 0.0), Angle::default())
            .unwrap();
        SingleVehicle {
            now: Time::ZERO,
            world,
            node: VehicleNode::new(&settings()),
            beam: Angle::default(),
            echoes: Vec::new(),
            touches: Vec::new(),
            known: Merged::new(Lattice::new(0.2), None),
            drives: 0,
            notes: Vec::new(),
        }
    }

    /// Gives the vehicle a plan of stops and lets it begin.
    fn sweep(&mut self, stops: &[(f64, f64)]) {
        self.run(Duration::from_millis(300));
        for (revision, stops) in [(1, &[][..]), (2, stops)] {
            let plan = plan(revision, stops);
            self.tell(Event::Bus(Sender::Ground, Message::Plan(plan)));
        }
        let lease = Lease {
            number: 1,
            holder: 1,
        };
        let (vehicle, run, revision) = (VehicleId(1), RunId(1), Revision(1));
        let order = Order {
            vehicle,
            lease,
            run,
            revision,
            seen: Some(SeenState {
                boot: Boot(1),
                sequence: 1,
            }),
            kind: OrderKind::Start,
            ends: vec![],
        };
        self.tell(Event::Bus(Sender::Ground, Message::Order(order)));
    }

    fn run(&mut self, span: Duration) {
        self.watch(span, |_| {});
    }

    /// Runs until the vehicle has come so far east, metres.
    fn run_until_x(&mut self, x_m: f64) {
        while self.place().x_m < x_m {
            self.step();
            assert!(
                self.now < Time::from_secs_f64(120.0),
                "never comes so far: {:?}",
                self.place()
            );
        }
    }

    /// Runs for a while and looks at every hundredth of a second.
    fn watch(&mut self, span: Duration, mut look: impl FnMut(&SingleVehicle)) {
        let until = self.now + span;
        while self.now < until {
            self.step();
            look(self);
        }
    }

    fn step(&mut self) {
        self.now = self.now + STEP;
        let due: Vec<PredictedContact> = self
            .touches
            .extract_if(.., |touch| touch.at <= self.now)
            .collect();
        for touch in due {
            self.world.touch(&touch);
        }
        if self.now.as_nanos().is_multiple_of(100_000_000) {
            let report = self.world.report(0, self.now);
            self.tell(Event::Report(report));
            self.tell(Event::Bus(Sender::Ground, Message::Have(Have::default())));
        }
        let due: Vec<_> = self
            .echoes
            .extract_if(.., |(at, _)| *at <= self.now)
            .collect();
        for (_, echo) in due {
            self.tell(Event::Echo(echo));
        }
        let mut effects = Vec::new();
        self.node.wake(self.now, &mut effects).unwrap();
        self.carry_out(effects);
    }

    fn tell(&mut self, event: Event) {
        let mut effects = Vec::new();
        self.node.tell(self.now, event, &mut effects).unwrap();
        self.carry_out(effects);
    }

    fn carry_out(&mut self, effects: Vec<Effect>) {
        for effect in effects {
            match effect {
                Effect::Command(NumberedCommand { number, command }) => {
                    if matches!(command, Command::Route { .. }) {
                        self.known = self.node.known_ground().clone();
                        self.drives += 1;
                    }
                    let CommandResult {
                        result,
                        arm_refusal,
                        contacts,
                    } = self.world.command(0, self.now, &command);
                    self.touches.extend(contacts);
                    self.tell(Event::Ack(Ack {
                        number,
                        result,
                        arm_refusal,
                    }));
                }
                Effect::Steer(beam) => self.beam = beam,
                Effect::Ping(ping) => {
                    let range_m = self.world.range_m(0, self.now, self.beam, ping.number);
                    self.echoes.push((
                        self.now + STEP,
                        Echo {
                            number: ping.number,
                            range_m,
                        },
                    ));
                }
                Effect::VehicleEvent(note) => self.notes.push(note),
                Effect::Transmit(_) | Effect::Publish(_) | Effect::Fix(..) => {}
                Effect::Remember(memory) => {
                    self.tell(Event::Remembered(Remembered {
                        on_disk: memory,
                        tried: memory,
                    }));
                }
                Effect::Keep(..)
                | Effect::KeepStops(_)
                | Effect::Forget { .. }
                | Effect::Recall { .. } => {}
            }
        }
    }

    fn place(&self) -> Point {
        self.world.truth(0, self.now).at
    }

    fn halts(&self) -> usize {
        self.notes
            .iter()
            .filter(|note| matches!(note, VehicleEvent::Vehicle(SafetyEvent::Halted { .. })))
            .count()
    }

    /// The cells under the true body, by their middles.
    fn under(&self) -> impl Iterator<Item = Cell> {
        let (at, lattice) = (self.place(), Lattice::new(0.2));
        let middle = lattice.cell_at(at);
        let around = (-2..=2)
            .flat_map(move |x| (-2..=2).map(move |y| Cell::new(middle.x + x, middle.y + y)));
        around.filter(move |cell| lattice.centre(*cell).distance_to(at) <= RADIUS_M)
    }
}

fn plan(revision: u32, stops: &[(f64, f64)]) -> Plan {
    let stop = |(index, (x_m, y_m)): (usize, &(f64, f64))| Stop {
        id: StopId(index as u32 + 1),
        at: Position::from_metres(*x_m, *y_m, 0.0),
        route: vec![],
        dwell_ms: 0,
        dwell_limit_ms: 0,
        partners: vec![],
        after: vec![],
    };
    let (vehicle, run, revision) = (VehicleId(1), RunId(1), Revision(revision));
    let stops = stops.iter().enumerate().map(stop).collect();
    Plan {
        vehicle,
        run,
        revision,
        members: vec![vehicle],
        stops,
        ..Plan::default()
    }
}

#[test]
fn no_cell_is_entered_that_was_not_known_free_when_the_drive_was_commanded() {
    let lattice = Lattice::new(0.2);
    for seed in 1..6 {
        let mut vehicle =
            SingleVehicle::new(&[(4.0, 0.5, 0.4, 3.0), (7.0, -1.0, 0.1, 0.1)], seed, 0.05);
        vehicle.sweep(&[(3.0, 0.0), (6.0, 0.0), (9.0, 0.0), (9.0, 3.0)]);
        let start: Vec<Cell> = vehicle.under().collect();
        vehicle.watch(Duration::from_secs(240), |vehicle| {
            let view = vehicle.known.view(
                0,
                CellRect::around(lattice, &[vehicle.place()], 1.0).unwrap(),
            );
            // Of a cell that is not free the parts count that were not seen empty.
            let is_touched = |cell: &Cell| {
                let barred = view.barred(*cell).filter(|_| !start.contains(cell));
                let mut parts = barred
                    .into_iter()
                    .flat_map(|barred| barred.places(lattice, *cell));
                parts.any(|part| part.distance_to(vehicle.place()) <= RADIUS_M)
            };
            let entered = vehicle.under().find(is_touched);
            assert_eq!(
                entered,
                None,
                "seed {seed}: at {:?}, {}",
                vehicle.place(),
                vehicle.now
            );
        });
        assert!(
            vehicle.place().distance_to(Point::new(9.0, 3.0)) < 0.7,
            "seed {seed}: ends at {:?}: {:#?}",
            vehicle.place(),
            vehicle.notes
        );
        assert!(vehicle.world.collisions().is_empty());
    }
}

#[test]
fn what_appears_beyond_the_stopping_distance_is_never_touched_and_then_driven_around() {
    // 0.5 m/s for a cycle of five looks and 0.15 s of reaction, 0.125 m of braking, 0.1 m of margin.
    let room_m = 0.5 * 0.65 + 0.125 + 0.1;
    for tenth in 0..12 {
        let mut vehicle = SingleVehicle::new(&[], 1, 0.02);
        vehicle.sweep(&[(8.0, 0.0)]);
        vehicle.run_until_x(1.5);
        vehicle.run(Duration::from_millis(130 * tenth));
        let face_m = vehicle.place().x_m + RADIUS_M + room_m;
        assert!(
            (1.0..6.0).contains(&face_m),
            "{:?} at {}",
            vehicle.place(),
            vehicle.now
        );
        vehicle.set_stage(&[(face_m + 0.2, 0.0, 0.4, 1.0)]);
        vehicle.watch(Duration::from_secs(5), |vehicle| {
            assert!(
                vehicle.place().x_m + RADIUS_M < face_m,
                "touched at {}",
                vehicle.now
            );
        });
        assert!(vehicle.halts() > 0 || vehicle.place().x_m < face_m - RADIUS_M);
        vehicle.run(Duration::from_secs(150));
        assert!(vehicle.world.collisions().is_empty());
        assert!(
            vehicle.place().distance_to(Point::new(8.0, 0.0)) < 0.5,
            "ends at {:?}: {:#?}",
            vehicle.place(),
            vehicle.notes
        );
    }
}

#[test]
fn when_the_obstacle_is_gone_the_way_is_driven_on() {
    let mut vehicle = SingleVehicle::new(&[], 2, 0.02);
    vehicle.sweep(&[(8.0, 0.0)]);
    vehicle.run_until_x(1.5);
    let face_m = vehicle.place().x_m + 1.0;
    // From fence to fence: there is no way around.
    vehicle.set_stage(&[(face_m, 0.0, 0.2, 12.0)]);
    vehicle.run(Duration::from_secs(40));
    assert!(vehicle.place().x_m < face_m - RADIUS_M - 0.1);
    vehicle.set_stage(&[]);
    vehicle.run(Duration::from_secs(200));
    assert!(
        vehicle.place().distance_to(Point::new(8.0, 0.0)) < 0.5,
        "ends at {:?}: {:#?}",
        vehicle.place(),
        vehicle.notes
    );
}

#[test]
fn who_does_not_know_where_it_is_drives_and_maps_nothing() {
    let mut vehicle = SingleVehicle::new(&[(2.0, 0.0, 0.2, 4.0)], 3, 0.6);
    vehicle.sweep(&[(1.0, 0.0), (1.0, 2.0)]);
    vehicle.run(Duration::from_secs(30));
    assert_eq!(vehicle.drives, 0);
    assert_eq!(vehicle.node.map().layers().count(), 0);
    assert_eq!(vehicle.node.samples_made(RunId(1)), 0);
}
