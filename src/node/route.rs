//! Who hears whom inside a vehicle: the only place that knows.
//!
//! ```text
//!  range driver ─Echo─► sensor ──Scan──► map ──Tiles──► mission ──MoveCommand──► vehicle ──AutopilotCommand──► autopilot
//!                         ├──────Scan (reflex stop)────────────────────────► vehicle
//!                         └──────Look──► bus              bus ──an operator's Hello asks for looks──► sensor
//!  autopilot driver ─Report, Ack─► autopilot ──Telemetry, ControlStatus──► vehicle      autopilot ──Command──► autopilot driver
//!  vehicle ──State──► sensor, mission, radio, bus
//!  map ──Tiles──► bus                      bus ──peers' Tiles, Digest, Want──► map
//!  radio driver ─Heard, Unsent─► radio ──Keep──► disk ──SampleStored──► outbox ──Samples──► bus
//!                                        disk ◄─Forget, Recall─ outbox      bus ──Have──► outbox
//!  bus ──Fix──► autopilot ──► autopilot driver
//!  bus ──Plan, Task, peers' State and Mission──► mission ──Mission──► radio (its progress, in beacons), bus
//!  radio ──what peers' beacons tell──► mission, vehicle      bus ──whoever is heard──► mission
//!  bus ──Order, peers' State──► vehicle ──Order (once it may be obeyed)──► mission
//!  vehicle, mission ──Remember──► disk ──Remembered──► vehicle, mission
//!  bus ──Standing, Order──► stops ──which stops are open──► vehicle, mission, radio      stops ──Standing──► bus, disk
//!  radio ──a peer's beacon names a stop──► stops
//!  edge ──Facts──► health ◄── State, what the link meets, beacons' members, how the outbox fares      health ──Health──► bus
//! ```

use std::fmt;

use tomoswarm_proto::{
    Beacon, Boot, Control, Fix, Interest, Message, OpenStops, RunId, Sample, Sender,
};

use super::memory::{Remembered, VehicleMemory};
use super::{health, map, mission, outbox, radio, sensor, vehicle};
use crate::autopilot::{self, Ack, AutopilotReport, NumberedCommand, link};
use crate::geom::Angle;
use crate::stops;

/// What reaches a vehicle from outside.
#[derive(Clone, Debug)]
pub enum Event {
    /// The autopilot driver reports what the autopilot says of itself.
    Report(AutopilotReport),
    /// The autopilot driver has the answer to a command.
    Ack(Ack),
    /// The range driver answers a ping.
    Echo(sensor::Echo),
    /// The radio driver heard a beacon.
    Heard(radio::HeardBeacon),
    /// The radio driver has not sent the beacon of this sequence: it never went on the air.
    Unsent(u32),
    /// The bus delivered a message that another node said.
    Bus(Sender, Message),
    /// A sample is kept: it will be told again when it is recalled, also after a restart.
    SampleStored(Boot, RunId, Sample),
    /// A chunk of what was kept before, as recalled.
    Recalled(outbox::Recalled),
    /// There was no room for what was kept.
    Dropped(outbox::DroppedSamples),
    /// How it stands with what was to be remembered.
    Remembered(Remembered),
    /// What the edge knows of the machine and its devices, once a second.
    Facts(Box<health::HealthFacts>),
}

/// What a vehicle wants done outside.
#[derive(Clone, PartialEq, Debug)]
pub enum Effect {
    /// The autopilot shall obey; the answer is an [`Event::Ack`].
    Command(NumberedCommand),
    /// The autopilot shall take this into its own estimate of its place: somebody has measured it from outside.
    Fix(Sender, Fix),
    /// The servo shall point the range sensor, relative to the heading.
    Steer(Angle),
    /// The range sensor shall measure.
    Ping(sensor::Ping),
    /// The radio shall send a beacon.
    Transmit(Beacon),
    /// The bus shall carry a message to the other nodes.
    Publish(Message),
    /// A sample shall be kept, on disk where there is one; it comes back as [`Event::SampleStored`].
    Keep(RunId, Sample),
    /// What was kept may be forgotten for good: the ground has it and its run is closed.
    Forget {
        /// Start of the software that made the samples.
        boot: Boot,
        /// Their run.
        run: RunId,
        /// All with a lower sequence.
        below: u64,
    },
    /// What was kept shall be told again: the next [`outbox::CHUNK`] samples after a place, or the first ones. They
    /// come back as one [`Event::Recalled`].
    Recall {
        /// The place; `None` = from the beginning.
        after: Option<outbox::SampleKey>,
    },
    /// This shall outlive the software, joined with what does already; the answer is an [`Event::Remembered`].
    Remember(VehicleMemory),
    /// These emergency stops shall outlive the software, in place of those that did before.
    KeepStops(OpenStops),
    /// Something worth a line in the log.
    VehicleEvent(VehicleEvent),
}

/// What a vehicle did or met, for logs and the operator.
#[derive(Clone, PartialEq, Debug)]
pub enum VehicleEvent {
    /// The autopilot does not obey, or somebody else steers.
    Autopilot(autopilot::LinkEvent),
    /// The reflex or the envelope of the vehicle spoke.
    Vehicle(vehicle::SafetyEvent),
    /// The mission changed what it does.
    Mission(mission::MissionEvent),
    /// Emergency stops were opened or lifted.
    Stops(stops::StopEvent),
    /// The autopilot is silent, or no more.
    Health(health::HealthEvent),
}

impl fmt::Display for VehicleEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            VehicleEvent::Autopilot(event) => write!(f, "autopilot: {event}"),
            VehicleEvent::Vehicle(event) => event.fmt(f),
            VehicleEvent::Mission(event) => event.fmt(f),
            VehicleEvent::Stops(event) => event.fmt(f),
            VehicleEvent::Health(event) => event.fmt(f),
        }
    }
}

/// Whatever is said inside a vehicle or at its edge.
#[derive(Debug)]
pub enum Output {
    /// From outside.
    Edge(Event),
    /// By the keeper of the emergency stops.
    Stops(stops::Out),
    /// By the link to the autopilot.
    Autopilot(link::Out),
    /// By the vehicle actor.
    Vehicle(vehicle::Out),
    /// By the sensor.
    Sensor(sensor::Out),
    /// By the map.
    Map(map::Out),
    /// By the mission.
    Mission(mission::Out),
    /// By the radio.
    Radio(radio::Out),
    /// By the outbox.
    Outbox(outbox::Out),
    /// By the health actor.
    Health(health::Out),
}

/// Where it goes.
#[derive(Debug)]
pub enum Destination {
    /// To the keeper of the emergency stops.
    Stops(stops::In),
    /// To the link to the autopilot.
    Autopilot(link::In),
    /// To the vehicle actor.
    Vehicle(vehicle::In),
    /// To the sensor.
    Sensor(sensor::In),
    /// To the map.
    Map(map::In),
    /// To the mission.
    Mission(mission::In),
    /// To the radio.
    Radio(radio::In),
    /// To the outbox.
    Outbox(outbox::In),
    /// To the health actor.
    Health(health::In),
    /// To the outside.
    Edge(Effect),
}

/// Says where something goes; destinations are in the order in which they are told.
pub(crate) fn route(output: Output, to: &mut Vec<Destination>) {
    match output {
        Output::Edge(Event::Report(report)) => {
            to.push(Destination::Autopilot(link::In::Report(report)))
        }
        Output::Edge(Event::Ack(ack)) => to.push(Destination::Autopilot(link::In::Ack(ack))),
        Output::Autopilot(out) => route_autopilot(out, to),
        Output::Edge(Event::Echo(echo)) => to.push(Destination::Sensor(sensor::In::Echo(echo))),
        Output::Edge(Event::Heard(heard)) => to.push(Destination::Radio(radio::In::Heard(heard))),
        Output::Edge(Event::Unsent(sequence)) => {
            to.push(Destination::Radio(radio::In::Unsent(sequence)))
        }
        Output::Edge(Event::Bus(sender, message)) => route_message(sender, message, to),
        Output::Edge(Event::SampleStored(boot, run, sample)) => {
            to.push(Destination::Outbox(outbox::In::SampleStored((
                boot, run, sample,
            ))));
        }
        Output::Edge(Event::Recalled(chunk)) => {
            to.push(Destination::Outbox(outbox::In::Recalled(chunk)))
        }
        Output::Edge(Event::Dropped(dropped)) => {
            to.push(Destination::Outbox(outbox::In::Dropped(dropped)))
        }
        Output::Edge(Event::Remembered(remembered)) => {
            to.push(Destination::Vehicle(vehicle::In::Remembered(remembered)));
            to.push(Destination::Mission(mission::In::Remembered(remembered)));
        }
        Output::Edge(Event::Facts(facts)) => to.push(Destination::Health(health::In::Facts(facts))),
        Output::Stops(out) => route_stops(out, to),
        Output::Vehicle(out) => route_vehicle(out, to),
        Output::Sensor(sensor::Out::Steer(beam)) => to.push(Destination::Edge(Effect::Steer(beam))),
        Output::Sensor(sensor::Out::Ping(ping)) => to.push(Destination::Edge(Effect::Ping(ping))),
        Output::Sensor(sensor::Out::Scan(scan)) => {
            to.push(Destination::Vehicle(vehicle::In::Scan(scan.clone())));
            to.push(Destination::Map(map::In::Scan(scan)));
        }
        Output::Sensor(sensor::Out::Look(look)) => {
            to.push(Destination::Edge(Effect::Publish(Message::Look(look))))
        }
        Output::Map(map::Out::Tiles(tiles)) => {
            to.extend(
                tiles
                    .into_iter()
                    .map(|tile| Destination::Mission(mission::In::Tile(tile))),
            );
        }
        Output::Map(map::Out::Publish(message)) => {
            to.push(Destination::Edge(Effect::Publish(message)))
        }
        Output::Mission(out) => route_mission(out, to),
        Output::Radio(radio::Out::Transmit(beacon)) => {
            let members = beacon.members.clone();
            to.push(Destination::Edge(Effect::Transmit(beacon)));
            to.push(Destination::Health(health::In::Hears(members)));
        }
        Output::Radio(radio::Out::Sample(run, sample)) => {
            to.push(Destination::Edge(Effect::Keep(run, sample)));
        }
        Output::Radio(radio::Out::Peer(sighting)) => {
            to.push(Destination::Vehicle(vehicle::In::Sighted(sighting)));
            to.push(Destination::Mission(mission::In::Sighted(sighting)));
        }
        Output::Radio(radio::Out::Stop(by, stop)) => {
            to.push(Destination::Stops(stops::In::Beacon(by, stop)))
        }
        Output::Outbox(out) => to.push(route_outbox(out)),
        Output::Health(health::Out::Publish(health)) => {
            to.push(Destination::Edge(Effect::Publish(Message::Health(*health))))
        }
        Output::Health(health::Out::HealthEvent(event)) => {
            to.push(Destination::Edge(Effect::VehicleEvent(
                VehicleEvent::Health(event),
            )));
        }
    }
}

fn route_autopilot(out: link::Out, to: &mut Vec<Destination>) {
    let destination = match out {
        link::Out::Command(command) => Destination::Edge(Effect::Command(command)),
        link::Out::Fix(from, fix) => Destination::Edge(Effect::Fix(from, fix)),
        link::Out::Telemetry(telemetry) => Destination::Vehicle(vehicle::In::Telemetry(telemetry)),
        link::Out::Status(status) => Destination::Vehicle(vehicle::In::Autopilot(status)),
        link::Out::LinkEvent(event) => {
            to.push(Destination::Health(health::In::Link(event)));
            Destination::Edge(Effect::VehicleEvent(VehicleEvent::Autopilot(event)))
        }
    };
    to.push(destination);
}

fn route_outbox(out: outbox::Out) -> Destination {
    Destination::Edge(match out {
        outbox::Out::Publish(samples) => Effect::Publish(Message::Samples(samples)),
        outbox::Out::Forget { boot, run, below } => Effect::Forget { boot, run, below },
        outbox::Out::Recall { after } => Effect::Recall { after },
        outbox::Out::Tally(tally) => return Destination::Health(health::In::Tally(tally)),
    })
}

fn route_message(sender: Sender, message: Message, to: &mut Vec<Destination>) {
    to.push(Destination::Mission(mission::In::Heard(sender)));
    match message {
        Message::State(state) => {
            to.push(Destination::Vehicle(vehicle::In::Peer(state.clone())));
            to.push(Destination::Map(map::In::Peer(state.clone())));
            to.push(Destination::Mission(mission::In::Peer(state)));
        }
        Message::Tile(report) => to.push(Destination::Map(map::In::Tile(report))),
        Message::Digest(digest) => to.push(Destination::Map(map::In::Digest(digest))),
        Message::Want(want) => to.push(Destination::Map(map::In::Want(want))),
        Message::Plan(plan) => {
            to.push(Destination::Stops(stops::In::Lease(plan.lease)));
            to.push(Destination::Mission(mission::In::Plan(plan)));
        }
        Message::Mission(mission) => {
            to.push(Destination::Mission(mission::In::Progress(
                (&mission).into(),
            )));
            to.push(Destination::Mission(mission::In::PeerMission(mission)));
        }
        Message::Order(order) => {
            to.push(Destination::Stops(stops::In::Order(sender, order.clone())));
            to.push(Destination::Vehicle(vehicle::In::Order(sender, order)));
        }
        Message::Standing(standing) => {
            to.push(Destination::Stops(stops::In::Standing(sender, standing)))
        }
        Message::Hello(hello) => {
            to.extend(
                hello
                    .lease
                    .map(|lease| Destination::Stops(stops::In::Lease(lease))),
            );
            let is_operator = matches!(sender, Sender::Operator(_));
            if is_operator && hello.interest.contains(&Interest::Looks) {
                to.push(Destination::Sensor(sensor::In::Asked));
            }
        }
        Message::Report(report) => {
            to.push(Destination::Stops(stops::In::Lease(report.lease)));
            to.push(Destination::Vehicle(vehicle::In::Expected(
                report.expected.clone(),
            )));
            to.push(Destination::Map(map::In::Expected(report.expected.clone())));
            to.push(Destination::Mission(mission::In::Expected(report.expected)));
        }
        Message::Have(have) => to.push(Destination::Outbox(outbox::In::Have(have))),
        Message::Task(task) => to.push(Destination::Mission(mission::In::Task(task))),
        Message::Fix(fix) => to.push(Destination::Autopilot(link::In::Fix(sender, fix))),
        // Samples and marks are the ground's business, images operators'; beacons come by radio.
        Message::Samples(_)
        | Message::Beacon(_)
        | Message::Health(_)
        | Message::Image(_)
        | Message::Mark(_)
        | Message::Look(_)
        | Message::Log(_)
        | Message::Settings(_) => {}
    }
}

fn route_stops(out: stops::Out, to: &mut Vec<Destination>) {
    match out {
        stops::Out::Open(open) => {
            to.push(Destination::Vehicle(vehicle::In::Stops(open.clone())));
            to.push(Destination::Mission(mission::In::Stops(open.clone())));
            to.push(Destination::Radio(radio::In::Stops(open)));
        }
        stops::Out::Heard(by) => to.push(Destination::Vehicle(vehicle::In::StopsReported(by))),
        stops::Out::Publish(standing) => {
            to.push(Destination::Edge(Effect::Publish(Message::Standing(
                standing,
            ))));
        }
        stops::Out::Remember(standing) => to.push(Destination::Edge(Effect::KeepStops(standing))),
        stops::Out::StopEvent(event) => to.push(Destination::Edge(Effect::VehicleEvent(
            VehicleEvent::Stops(event),
        ))),
    }
}

fn route_vehicle(out: vehicle::Out, to: &mut Vec<Destination>) {
    match out {
        vehicle::Out::AutopilotCommand(fly) => {
            to.push(Destination::Autopilot(link::In::AutopilotCommand(fly)))
        }
        vehicle::Out::State(state) => {
            to.push(Destination::Sensor(sensor::In::State(state.clone())));
            to.push(Destination::Radio(radio::In::State(state.clone())));
            to.push(Destination::Mission(mission::In::State(state)));
        }
        vehicle::Out::Remember(memory) => to.push(Destination::Edge(Effect::Remember(memory))),
        vehicle::Out::Order(order) => to.push(Destination::Mission(mission::In::Order(order))),
        vehicle::Out::Publish(state) => {
            let (is_armed, control) = (state.is_armed, state.control);
            to.push(Destination::Edge(Effect::Publish(Message::State(state))));
            // That the autopilot is silent is said without having heard it.
            if control != Control::Silent {
                to.push(Destination::Health(health::In::State { is_armed }));
            }
        }
        vehicle::Out::SafetyEvent(event) => {
            to.push(Destination::Mission(mission::In::SafetyEvent(
                event.clone(),
            )));
            to.push(Destination::Edge(Effect::VehicleEvent(
                VehicleEvent::Vehicle(event),
            )));
        }
    }
}

fn route_mission(out: mission::Out, to: &mut Vec<Destination>) {
    match out {
        mission::Out::Command(decided, command) => {
            to.push(Destination::Vehicle(vehicle::In::Command(decided, command)));
        }
        mission::Out::Holds(holds) => to.push(Destination::Vehicle(vehicle::In::Holds(holds))),
        mission::Out::Accepted(run, revision) => {
            to.push(Destination::Vehicle(vehicle::In::Accepted(run, revision)));
        }
        mission::Out::Progress(mission) => {
            to.push(Destination::Radio(radio::In::Progress(mission.progress)));
            to.push(Destination::Edge(Effect::Publish(Message::Mission(
                mission,
            ))));
        }
        mission::Out::Remember(memory) => to.push(Destination::Edge(Effect::Remember(memory))),
        mission::Out::Measure(run) => to.push(Destination::Radio(radio::In::Measure(run))),
        mission::Out::MissionEvent(event) => to.push(Destination::Edge(Effect::VehicleEvent(
            VehicleEvent::Mission(event),
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Digest, Hello, OperatorId, State, TileRequest, VehicleId};

    /// Returns of whom a mission hears when a sender says a message.
    fn heard(sender: Sender, message: Message) -> Vec<Sender> {
        let mut to = Vec::new();
        route(Output::Edge(Event::Bus(sender, message)), &mut to);
        let heard = to.into_iter().filter_map(|to| match to {
            Destination::Mission(mission::In::Heard(by)) => Some(by),
            _ => None,
        });
        heard.collect()
    }

    #[test]
    fn an_operator_that_wants_looks_is_told_them_and_nobody_else() {
        let hello = |interest| Hello {
            interest,
            ..Hello::asking(Sender::Ground, Boot(1), 2, 3)
        };
        let asks = |sender, interest| {
            let mut to = Vec::new();
            let greeting = Message::Hello(hello(interest));
            route(Output::Edge(Event::Bus(sender, greeting)), &mut to);
            let is_asked = |of: &Destination| matches!(of, Destination::Sensor(sensor::In::Asked));
            to.iter().any(is_asked)
        };
        let operator = Sender::Operator(OperatorId(1));
        assert!(asks(operator, vec![Interest::Fleet, Interest::Looks]));
        assert!(!asks(operator, vec![Interest::Fleet]));
        assert!(!asks(Sender::Ground, vec![Interest::Looks]));
        assert!(!asks(Sender::Vehicle(VehicleId(2)), vec![Interest::Looks]));
    }

    #[test]
    fn a_state_that_says_that_the_autopilot_is_silent_is_no_sign_of_it() {
        let tells_health = |control| {
            let state = State {
                control,
                ..State::default()
            };
            let mut to = Vec::new();
            route(Output::Vehicle(vehicle::Out::Publish(state)), &mut to);
            let is_told =
                |of: &Destination| matches!(of, Destination::Health(health::In::State { .. }));
            to.iter().any(is_told)
        };
        assert!(tells_health(Control::Ours) && !tells_health(Control::Silent));
    }

    #[test]
    fn what_names_no_author_is_heard_of_whoever_says_it() {
        for sender in [
            Sender::Ground,
            Sender::Vehicle(VehicleId(2)),
            Sender::Operator(OperatorId(1)),
        ] {
            assert_eq!(heard(sender, Message::Digest(Digest::default())), [sender]);
            let want = TileRequest {
                layer: Default::default(),
                known: vec![],
            };
            assert_eq!(heard(sender, Message::Want(want)), [sender]);
        }
    }
}
