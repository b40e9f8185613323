//! A vehicle: the list of its nine actors and how each is made, for every runtime. [`route`] says who hears whom.
//!
//! A fault of the range sensor's actor, or of that of its health, is mended by a fresh one. A fault of any other ends the
//! node, the radio's too: its samples are numbered, and a fresh one would count from the beginning under the same start.
//!
//! Nothing here knows a device or a network. What reaches a vehicle from outside is an [`Event`],
//! what it wants done outside is an [`Effect`]; drivers and the bus at the edge turn them into real things.

mod from_config;
pub mod health;
mod last_pose;
pub mod map;
pub mod memory;
pub mod mission;
pub mod outbox;
mod own_state;
mod peers;
pub mod radio;
pub mod route;
pub mod sensor;
mod settings;
mod state_ages;
#[cfg(test)]
mod tests_support;
pub mod vehicle;
mod vehicle_node;

use self::health::HealthActor;
use self::map::Map;
use self::mission::Mission;
use self::outbox::Outbox;
use self::radio::Radio;
use self::route::{Destination, Output, route};
use self::sensor::Sensor;
use self::vehicle::Vehicle;
use crate::actor::{ActingTime, Fill, Place, Recipient, RestartPolicy, Visitor, Wire, Wiring};
use crate::autopilot::AutopilotLink;
use crate::stops::{Stops, StopsSettings};
pub use memory::{Remembered, VehicleMemory};
pub use own_state::OwnState;
pub use route::{Effect, Event};
pub use settings::{BodySettings, LookSettings, RadioSettings, VehicleSettings};
pub use vehicle_node::VehicleNode;

/// How a vehicle is wired.
#[derive(Debug)]
pub enum VehicleWiring {}

/// A place for each actor of a vehicle.
#[derive(Clone, Debug)]
pub struct Actors<P: Place<VehicleWiring>> {
    pub(crate) stops: P::Of<Stops>,
    pub(crate) autopilot: P::Of<AutopilotLink>,
    pub(crate) vehicle: P::Of<Vehicle>,
    pub(crate) sensor: P::Of<Sensor>,
    pub(crate) map: P::Of<Map>,
    pub(crate) mission: P::Of<Mission>,
    pub(crate) radio: P::Of<Radio>,
    pub(crate) outbox: P::Of<Outbox>,
    pub(crate) health: P::Of<HealthActor>,
}

impl Wiring for VehicleWiring {
    const KIND: &'static str = "vehicle";
    type Source = VehicleSettings;
    type Event = Event;
    type Effect = Effect;
    type Output = Output;
    type Destination = Destination;
    type Actors<P: Place<Self>> = Actors<P>;

    fn fill<P: Place<Self>>(fill: &mut impl Fill<Self, P>) -> Actors<P> {
        Actors {
            stops: fill.actor(Wire {
                name: "stops",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Instant,
                make: |settings| {
                    let (kept, lease) = (settings.stops.clone(), settings.memory.lease());
                    Stops::new(&StopsSettings {
                        kept,
                        lease,
                        is_silent: false,
                    })
                },
                output: Output::Stops,
            }),
            // At once, on the thread of whoever tells it something: a stop does not wait for another thread.
            autopilot: fill.actor(Wire {
                name: "autopilot",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Instant,
                make: |settings| AutopilotLink::new(settings.autopilot),
                output: Output::Autopilot,
            }),
            vehicle: fill.actor(Wire {
                name: "vehicle",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Short,
                make: |settings| Vehicle::new(settings.clone()),
                output: Output::Vehicle,
            }),
            sensor: fill.actor(Wire {
                name: "sensor",
                restart: RestartPolicy::Restart,
                acting: ActingTime::Short,
                make: |settings| {
                    let (look, swarm) = (settings.look.clone(), &settings.swarm);
                    Sensor::new(settings.vehicle, look, swarm.pose_sd_max_m)
                },
                output: Output::Sensor,
            }),
            map: fill.actor(Wire {
                name: "map",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Instant,
                make: |settings| Map::new(settings.clone()),
                output: Output::Map,
            }),
            mission: fill.actor(Wire {
                name: "mission",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Short,
                make: |settings| Mission::new(settings.clone()),
                output: Output::Mission,
            }),
            radio: fill.actor(Wire {
                name: "radio",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Short,
                make: |settings| Radio::new(settings.clone()),
                output: Output::Radio,
            }),
            outbox: fill.actor(Wire {
                name: "outbox",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Short,
                make: |settings| Outbox::new(settings.vehicle),
                output: Output::Outbox,
            }),
            health: fill.actor(Wire {
                name: "health",
                restart: RestartPolicy::Restart,
                acting: ActingTime::Instant,
                make: |settings| HealthActor::new(settings.vehicle, settings.boot),
                output: Output::Health,
            }),
        }
    }

    fn visit<P: Place<Self>>(actors: &mut Actors<P>, visitor: &mut impl Visitor<Self, P>) {
        // Taken apart, so that none can be forgotten.
        let Actors {
            stops,
            autopilot,
            vehicle,
            sensor,
            map,
            mission,
            radio,
            outbox,
            health,
        } = actors;
        visitor.actor::<Stops>(stops);
        visitor.actor::<AutopilotLink>(autopilot);
        visitor.actor::<Vehicle>(vehicle);
        visitor.actor::<Sensor>(sensor);
        visitor.actor::<Map>(map);
        visitor.actor::<Mission>(mission);
        visitor.actor::<Radio>(radio);
        visitor.actor::<Outbox>(outbox);
        visitor.actor::<HealthActor>(health);
    }

    fn event(event: Event) -> Output {
        Output::Edge(event)
    }

    fn route(output: Output, to: &mut Vec<Destination>) {
        route(output, to);
    }

    fn deliver<P: Recipient<Self>>(
        actors: &mut Actors<P>,
        destination: Destination,
        carry_out: &mut impl FnMut(Effect),
    ) {
        match destination {
            Destination::Stops(input) => P::tell::<Stops>(&mut actors.stops, input),
            Destination::Autopilot(input) => P::tell::<AutopilotLink>(&mut actors.autopilot, input),
            Destination::Vehicle(input) => P::tell::<Vehicle>(&mut actors.vehicle, input),
            Destination::Sensor(input) => P::tell::<Sensor>(&mut actors.sensor, input),
            Destination::Map(input) => P::tell::<Map>(&mut actors.map, input),
            Destination::Mission(input) => P::tell::<Mission>(&mut actors.mission, input),
            Destination::Radio(input) => P::tell::<Radio>(&mut actors.radio, input),
            Destination::Outbox(input) => P::tell::<Outbox>(&mut actors.outbox, input),
            Destination::Health(input) => P::tell::<HealthActor>(&mut actors.health, input),
            Destination::Edge(effect) => carry_out(effect),
        }
    }

    fn published(effect: Effect) -> Option<tomoswarm_proto::Message> {
        match effect {
            Effect::Publish(message) => Some(message),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::node::VehicleNode;
    use crate::node::tests_support::settings;

    #[test]
    fn recordings_name_the_actors_in_the_order_of_the_datas_way() {
        let snapshots = VehicleNode::new(&settings(1)).snapshots().unwrap();
        let names: Vec<&str> = snapshots.iter().map(|snapshot| snapshot.actor).collect();
        assert_eq!(
            names,
            [
                "stops",
                "autopilot",
                "vehicle",
                "sensor",
                "map",
                "mission",
                "radio",
                "outbox",
                "health"
            ]
        );
    }
}
