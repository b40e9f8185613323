//! What is recorded of a run is enough to take every step again: every actor restored from a snapshot of any moment
//! has the outputs of the original, and is what the original was when the next snapshot was taken.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm::actor::{ActorStep, NodeActor, Snapshot, StepCause, again};
use tomoswarm::autopilot::AutopilotLink;
use tomoswarm::ground::image_publisher::ImagePublisher;
use tomoswarm::ground::{imager::ImagerActor, planner::PlannerActor, station::Station};
use tomoswarm::node::health::HealthActor;
use tomoswarm::node::map::Map;
use tomoswarm::node::mission::Mission;
use tomoswarm::node::outbox::Outbox;
use tomoswarm::node::radio::Radio;
use tomoswarm::node::sensor::Sensor;
use tomoswarm::node::vehicle::Vehicle;
use tomoswarm::operator::operator_actor::Operator;
use tomoswarm::sim::RecordingEntry;
use tomoswarm::sim::bus::NodeId;
use tomoswarm::stops::Stops;
use tomoswarm_proto::VehicleId;
use tomoswarm_proto::codec::{pack, unpack};

use crate::place::Place;

/// An actor that lives again.
struct Again<A> {
    actor: Option<A>,
    steps: usize,
    restored: usize,
}

impl<A> Default for Again<A> {
    fn default() -> Again<A> {
        Again {
            actor: None,
            steps: 0,
            restored: 0,
        }
    }
}

impl<A: NodeActor> Again<A> {
    fn restore(&mut self, snapshot: &Snapshot) {
        if let Some(actor) = &self.actor {
            assert!(
                pack(actor).unwrap() == snapshot.bytes,
                "{} is another by now",
                snapshot.actor
            );
        }
        self.actor = Some(unpack(&snapshot.bytes).unwrap());
        self.restored += 1;
    }

    fn take(&mut self, step: &ActorStep) {
        let step = step.of::<A>().unwrap();
        let input = match step.cause.clone() {
            StepCause::Input(input) => Some(input),
            StepCause::Woken(_) => None,
        };
        let now = again(self.actor.as_mut().unwrap(), step.now, input);
        assert_eq!(
            pack(&now.outputs).unwrap(),
            pack(&step.outputs).unwrap(),
            "at {}",
            step.now
        );
        assert_eq!(now.fault, step.fault);
        self.steps += 1;
    }
}

#[derive(Default)]
struct Rover {
    stops: Again<Stops>,
    autopilot: Again<AutopilotLink>,
    vehicle: Again<Vehicle>,
    sensor: Again<Sensor>,
    map: Again<Map>,
    mission: Again<Mission>,
    radio: Again<Radio>,
    outbox: Again<Outbox>,
    health: Again<HealthActor>,
}

impl Rover {
    fn restore(&mut self, snapshot: &Snapshot) {
        match snapshot.actor {
            "stops" => self.stops.restore(snapshot),
            "autopilot" => self.autopilot.restore(snapshot),
            "vehicle" => self.vehicle.restore(snapshot),
            "sensor" => self.sensor.restore(snapshot),
            "map" => self.map.restore(snapshot),
            "mission" => self.mission.restore(snapshot),
            "radio" => self.radio.restore(snapshot),
            "outbox" => self.outbox.restore(snapshot),
            "health" => self.health.restore(snapshot),
            other => panic!("{other} is no actor of a vehicle"),
        }
    }

    fn take(&mut self, step: &ActorStep) {
        match step.actor {
            "stops" => self.stops.take(step),
            "autopilot" => self.autopilot.take(step),
            "vehicle" => self.vehicle.take(step),
            "sensor" => self.sensor.take(step),
            "map" => self.map.take(step),
            "mission" => self.mission.take(step),
            "radio" => self.radio.take(step),
            "outbox" => self.outbox.take(step),
            "health" => self.health.take(step),
            other => panic!("{other} is no actor of a vehicle"),
        }
    }
}

#[derive(Default)]
struct Ground {
    stops: Again<Stops>,
    station: Again<Station>,
    planner: Again<PlannerActor>,
    imager: Again<ImagerActor>,
    image_publisher: Again<ImagePublisher>,
}

impl Ground {
    fn restore(&mut self, snapshot: &Snapshot) {
        match snapshot.actor {
            "stops" => self.stops.restore(snapshot),
            "station" => self.station.restore(snapshot),
            "planner" => self.planner.restore(snapshot),
            "imager" => self.imager.restore(snapshot),
            "image_publisher" => self.image_publisher.restore(snapshot),
            other => panic!("{other} is no actor of the ground station"),
        }
    }

    fn take(&mut self, step: &ActorStep) {
        match step.actor {
            "stops" => self.stops.take(step),
            "station" => self.station.take(step),
            "planner" => self.planner.take(step),
            "imager" => self.imager.take(step),
            "image_publisher" => self.image_publisher.take(step),
            other => panic!("{other} is no actor of the ground station"),
        }
    }
}

#[derive(Default)]
struct Person {
    stops: Again<Stops>,
    operator: Again<Operator>,
}

impl Person {
    fn restore(&mut self, snapshot: &Snapshot) {
        match snapshot.actor {
            "stops" => self.stops.restore(snapshot),
            "operator" => self.operator.restore(snapshot),
            other => panic!("{other} is no actor of an operator"),
        }
    }

    fn take(&mut self, step: &ActorStep) {
        match step.actor {
            "stops" => self.stops.take(step),
            "operator" => self.operator.take(step),
            other => panic!("{other} is no actor of an operator"),
        }
    }
}

#[test]
fn an_actor_restored_at_any_moment_goes_on_as_the_original() {
    for (seed, segment_s) in [(1, 2.3), (2, 7.1), (3, 41.0)] {
        let place = Place::new(8.0, 8.0)
            .block((4.0, 3.0, 2.0, 0.4))
            .block((-1.0, 4.0, 0.4, 0.6))
            .seed(seed);
        let place = place.root("end = \"return\"\nempty_sweep = true\nuntil_s = 2000.0");
        let (mut rovers, mut ground) = (BTreeMap::<_, Rover>::new(), Ground::default());
        let mut person = Person::default();
        let mut record = |entry: RecordingEntry| match entry {
            RecordingEntry::Segment {
                node: NodeId::Vehicle(id),
                snapshots,
                ..
            } => {
                snapshots
                    .iter()
                    .for_each(|snapshot| rovers.entry(id).or_default().restore(snapshot));
            }
            RecordingEntry::Segment {
                node: NodeId::Ground,
                snapshots,
                ..
            } => snapshots
                .iter()
                .for_each(|snapshot| ground.restore(snapshot)),
            RecordingEntry::Segment {
                node: NodeId::Operator(_),
                snapshots,
                ..
            } => snapshots
                .iter()
                .for_each(|snapshot| person.restore(snapshot)),
            RecordingEntry::Step(NodeId::Vehicle(id), step) => {
                rovers.entry(id).or_default().take(&step)
            }
            RecordingEntry::Step(NodeId::Ground, step) => ground.take(&step),
            RecordingEntry::Step(NodeId::Operator(_), step) => person.take(&step),
        };
        let recorded = place.scenario().run_recorded(
            &mut |_| true,
            Duration::from_secs_f64(segment_s),
            &mut record,
        );
        assert_eq!(
            recorded.unwrap().log,
            place.run().log,
            "a run is the same when it is recorded"
        );
        assert_eq!(rovers.len(), 2);
        for rover in rovers.values() {
            assert!(rover.mission.steps > 500 && rover.map.steps > 200 && rover.outbox.steps > 50);
            assert!(rover.health.steps > 50);
            assert!(rover.autopilot.steps > 500 && rover.autopilot.restored > 2);
            assert!(
                rover.vehicle.steps > 500 && rover.sensor.steps > 500 && rover.radio.steps > 500
            );
            assert!(rover.mission.restored > 2 && rover.stops.steps > 500);
        }
        assert!(
            person.operator.steps > 500 && person.operator.restored > 2 && person.stops.steps > 500
        );
        assert!(
            ground.station.steps > 500 && ground.planner.steps >= 2 && ground.imager.steps >= 2
        );
    }
}

#[test]
fn who_is_started_anew_is_recorded_from_there() {
    let restart = "[[fault]]\nkind = \"restart\"\nat_s = 30.0\nground = true\nvehicles = [2]\n";
    let place = Place::new(8.0, 8.0).root("until_s = 60.0").with(restart);
    let (mut rovers, mut ground) = (BTreeMap::<_, Rover>::new(), Ground::default());
    let mut segments = Vec::new();
    let mut record = |entry: RecordingEntry| match entry {
        RecordingEntry::Segment {
            node: node @ NodeId::Vehicle(id),
            now,
            snapshots,
        } => {
            segments.push((node, now.as_secs_f64()));
            rovers.insert(id, Rover::default());
            snapshots
                .iter()
                .for_each(|snapshot| rovers.entry(id).or_default().restore(snapshot));
        }
        RecordingEntry::Segment {
            node: NodeId::Ground,
            now,
            snapshots,
        } => {
            segments.push((NodeId::Ground, now.as_secs_f64()));
            ground = Ground::default();
            snapshots
                .iter()
                .for_each(|snapshot| ground.restore(snapshot))
        }
        RecordingEntry::Step(NodeId::Vehicle(id), step) => {
            rovers.entry(id).or_default().take(&step)
        }
        RecordingEntry::Step(NodeId::Ground, step) => ground.take(&step),
        RecordingEntry::Segment {
            node: NodeId::Operator(_),
            ..
        }
        | RecordingEntry::Step(NodeId::Operator(_), _) => {}
    };
    let long = Duration::from_secs(1000);
    place
        .scenario()
        .run_recorded(&mut |_| true, long, &mut record)
        .unwrap();
    let of = |node| {
        segments
            .iter()
            .filter(|(of, _)| *of == node)
            .map(|(_, at_s)| *at_s)
            .collect::<Vec<_>>()
    };
    assert_eq!(of(NodeId::Vehicle(VehicleId(1))), [0.0]);
    assert_eq!(of(NodeId::Vehicle(VehicleId(2))), [0.0, 33.0]);
    assert_eq!(of(NodeId::Ground), [0.0, 33.0]);
    assert!(
        ground.station.steps > 100 && rovers[&VehicleId(2)].vehicle.steps > 100,
        "both go on"
    );
}
