//! Costs of the leaf parts of the simulation, nanoseconds a call: `cargo bench --bench radio`.
//! Prints one line each and judges nothing.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::hint::black_box;
use std::time::{Duration, Instant};

use tomoswarm::exchange::egress::OutboundFrame;
use tomoswarm::geom::{Angle, Point, Rect};
use tomoswarm::scene::{Footprint, LevelCut, Material, Post, Scene, SceneParts};
use tomoswarm::sim::body::{Body, DriveLimits};
use tomoswarm::sim::bus::{BusModel, NodeId, SimulatedBus};
use tomoswarm::sim::contact::{closest_approach, first_contact_of};
use tomoswarm::sim::noise::{Noise, NoisePurpose};
use tomoswarm::sim::queue::EventQueue;
use tomoswarm::sim::radio_field::{RadioConstants, RadioField, Transmission};
use tomoswarm::sim::range::{Disc, RangeModel, RangeSensor, SensorSurroundings};
use tomoswarm::time::Time;
use tomoswarm_proto::{Message, MissionProgress, VehicleId};

/// Best of seven rounds.
fn measure(name: &str, calls: u64, mut work: impl FnMut(u64)) {
    let best = (0..7).map(|_| {
        let start = Instant::now();
        (0..calls).for_each(&mut work);
        start.elapsed()
    });
    let best = best.min().unwrap_or_default();
    println!(
        "{name:<36} {:>9.1} ns",
        best.as_nanos() as f64 / calls as f64
    );
}

fn noise_and_radio() {
    let noise = Noise::new(1);
    measure("noise: uniform, 2 ids", 1_000_000, |id| {
        black_box(noise.uniform(NoisePurpose::Range, &[3, id]));
    });
    measure("noise: gaussian, 2 ids", 1_000_000, |id| {
        black_box(noise.gaussian(NoisePurpose::Range, &[3, id]));
    });
    measure("noise: smooth, 1 id", 1_000_000, |id| {
        let at = Time::from_nanos(id * 1_000_000);
        black_box(noise.smooth(NoisePurpose::PoseX, &[3], at, Duration::from_secs(20)));
    });
    let field = RadioField::new(noise, RadioConstants::default());
    let packet = |id: u64| {
        let (from, to) = (
            Point::new(id as f64 * 0.01, 3.0),
            Point::new(12.0, id as f64 * 0.02),
        );
        Transmission {
            from,
            to,
            channel: 11,
            power_dbm: 0,
        }
    };
    measure("radio: fading_db", 100_000, |id| {
        let packet = packet(id);
        black_box(field.fading_db(packet.from, packet.to, 11));
    });
    measure("radio: received", 100_000, |id| {
        black_box(field.received(&packet(id), 3.0, [1, 2, id, 3]));
    });
}

fn rover(x_m: f64, goal: Point) -> Body {
    let limits = DriveLimits {
        speed_mps: 0.5,
        acceleration_mps2: 0.5,
        braking_mps2: 1.0,
        turn_rate_radps: 1.5,
    };
    let start = Point::new(x_m, 0.0);
    let mut body =
        Body::at_rest(start, Angle::default(), limits).expect("the constants are possible");
    drive(&mut body, Time::ZERO, &[Point::new(x_m, 1.0), goal]);
    body
}

fn drive(body: &mut Body, now: Time, corners: &[Point]) {
    body.drive(now, corners, 0.5)
        .expect("the corners are possible");
}

fn bodies() {
    let (a, b) = (
        rover(0.0, Point::new(8.0, 5.0)),
        rover(9.0, Point::new(1.0, 6.0)),
    );
    measure("body: pose_at", 1_000_000, |id| {
        black_box(a.pose_at(Time::from_nanos(id * 20_000)));
    });
    let mut driven = a.clone();
    measure("body: drive, 2 corners", 100_000, |id| {
        drive(
            &mut driven,
            Time::from_nanos(id * 1000),
            &[Point::new(0.0, 1.0), Point::new(8.0, 5.0)],
        );
    });
    measure("contact: first_contact_of, 2 legs", 100_000, |_| {
        black_box(first_contact_of(&a, &b, Time::ZERO, Time::NEVER, 0.1));
    });
    measure("contact: closest_approach, 2 legs", 100_000, |_| {
        black_box(closest_approach(&a, &b, Time::ZERO, Time::NEVER));
    });
}

fn range() {
    let sensor = RangeSensor::new(RangeModel::default());
    let wall = Post {
        name: "wall".into(),
        footprint: Footprint::Corners(
            Rect::new(Point::new(3.0, -20.0), Point::new(3.2, 20.0)).polygon(),
        ),
        low_m: 0.0,
        high_m: 2.0,
        material: Material::default(),
    };
    let scene = Scene::build(&SceneParts {
        shapes: &[],
        offset_m: [0.0; 3],
        materials: &Default::default(),
        default_material: Material::default(),
        posts: &[wall],
        persons: &[],
    })
    .expect("a wall is a scene");
    let cut = LevelCut::of(&scene, 0.2);
    let noise = Noise::new(1);
    let discs = [Disc {
        centre: Point::new(2.0, 0.3),
        radius_m: 0.3,
        low_m: 0.0,
        high_m: 1.8,
    }];
    let around = SensorSurroundings {
        scene: &scene,
        cut: &cut,
        discs: &discs,
    };
    measure("range: echo, plane wall, 1 disc", 1_000_000, |id| {
        black_box(sensor.echo([0.0, 0.0, 0.2], Angle::default(), around, &noise, &[id]));
    });
}

fn bus_and_queue() {
    let mission = MissionProgress {
        vehicle: VehicleId(1),
        ..MissionProgress::default()
    };
    let outbound = OutboundFrame::of(&Message::Mission(mission)).expect("a Mission is short");
    let nodes = [1, 2, 3].map(|id| NodeId::Vehicle(VehicleId(id)));
    let mut bus = SimulatedBus::new(Noise::new(1), BusModel::default());
    measure("bus: send a Mission to 2, read both", 100_000, |_| {
        let sent = bus.send(Time::ZERO, nodes[0], &outbound, &nodes);
        sent.iter()
            .for_each(|delivery| drop(black_box(delivery.frame.read().clone())));
    });
    let mut queue = EventQueue::new(None);
    (0..1000u64).for_each(|id| queue.push(Time::from_nanos(id), id));
    measure("queue: pop and push at 1000 events", 1_000_000, |_| {
        if let Some((at, id)) = queue.pop() {
            queue.push(at + Duration::from_nanos(id * 7919 % 100_000), id);
        }
    });
}

fn main() {
    noise_and_radio();
    bodies();
    range();
    bus_and_queue();
}
