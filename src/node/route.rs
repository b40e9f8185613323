//! Who hears whom inside a vehicle: the only place that knows.
//!
//! ```text
//!  range driver ─Echo─► sensor ──Scan──► map ──Tiles──► mission ──Command──► vehicle ─Fly─► autopilot driver
//!                         └──────Scan (reflex stop)────────────────────────► vehicle
//!  autopilot driver ─Telemetry─► vehicle ──State──► sensor, mission, radio, bus
//!  map ──Tiles──► bus                      bus ──peers' Tiles, Digest, Want──► map
//!  radio driver ─Heard─► radio ──Keep──► disk ──Kept──► outbox ──Samples──► bus
//!                                        disk ◄─Forget, Recall─ outbox      bus ──Have──► outbox
//!  bus ──Plan, peers' State and Mission──► mission ──Mission──► radio (its progress, in beacons), bus
//!  radio ──what peers' beacons tell──► mission, vehicle      bus ──whoever is heard──► mission
//!  bus ──Order, peers' State──► vehicle ──Order (once accepted)──► mission
//! ```

use tomoswarm_proto::{Beacon, Boot, Message, RunId, Sample, Sender};

use super::{map, mission, outbox, radio, sensor, vehicle};
use crate::geom::Angle;

/// What reaches a vehicle from outside.
#[derive(Clone, Debug)]
pub enum Event {
    /// The autopilot driver reports pose and motion.
    Telemetry(vehicle::Telemetry),
    /// The range driver answers a ping.
    Echo(sensor::Echo),
    /// The radio driver heard a beacon.
    Heard(radio::Heard),
    /// The bus delivered a message that another node said.
    Bus(Sender, Message),
    /// A sample is kept: it will be told again when it is recalled, also after a restart.
    Kept(Boot, RunId, Sample),
    /// A chunk of what was kept before, as recalled.
    Recalled(outbox::Recalled),
    /// There was no room for what was kept.
    Dropped(outbox::Dropped),
}

/// What a vehicle wants done outside.
#[derive(Clone, PartialEq, Debug)]
pub enum Effect {
    /// The autopilot shall move the vehicle.
    Fly(vehicle::Fly),
    /// The servo shall point the range sensor, relative to the heading.
    Steer(Angle),
    /// The range sensor shall measure.
    Ping(sensor::Ping),
    /// The radio shall send a beacon.
    Transmit(Beacon),
    /// The bus shall carry a message to the other nodes.
    Publish(Message),
    /// A sample shall be kept, on disk where there is one; it comes back as [`Event::Kept`].
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
        after: Option<outbox::Place>,
    },
    /// How the outbox fares, for the operator.
    Tally(outbox::Tally),
    /// Something worth a line in the log.
    Note(Note),
}

/// What a vehicle did or met, for logs and the operator.
#[derive(Clone, PartialEq, Debug)]
pub enum Note {
    /// The reflex or the envelope of the vehicle spoke.
    Vehicle(vehicle::Remark),
    /// The mission changed what it does.
    Mission(mission::Remark),
}

/// Whatever is said inside a vehicle or at its edge.
#[derive(Debug)]
pub(crate) enum Said {
    Edge(Event),
    Vehicle(vehicle::Out),
    Sensor(sensor::Out),
    Map(map::Out),
    Mission(mission::Out),
    Radio(radio::Out),
    Outbox(outbox::Out),
}

/// Where it goes.
#[derive(Debug)]
pub(crate) enum To {
    Vehicle(vehicle::In),
    Sensor(sensor::In),
    Map(map::In),
    Mission(mission::In),
    Radio(radio::In),
    Outbox(outbox::In),
    Edge(Effect),
}

/// Says where something goes; destinations are in the order in which they are told.
pub(crate) fn route(said: Said, to: &mut Vec<To>) {
    match said {
        Said::Edge(Event::Telemetry(telemetry)) => to.push(To::Vehicle(vehicle::In::Telemetry(telemetry))),
        Said::Edge(Event::Echo(echo)) => to.push(To::Sensor(sensor::In::Echo(echo))),
        Said::Edge(Event::Heard(heard)) => to.push(To::Radio(radio::In::Heard(heard))),
        Said::Edge(Event::Bus(sender, message)) => route_message(sender, message, to),
        Said::Edge(Event::Kept(boot, run, sample)) => {
            to.push(To::Outbox(outbox::In::Kept((boot, run, sample))));
        }
        Said::Edge(Event::Recalled(chunk)) => to.push(To::Outbox(outbox::In::Recalled(chunk))),
        Said::Edge(Event::Dropped(dropped)) => to.push(To::Outbox(outbox::In::Dropped(dropped))),
        Said::Vehicle(out) => route_vehicle(out, to),
        Said::Sensor(sensor::Out::Steer(beam)) => to.push(To::Edge(Effect::Steer(beam))),
        Said::Sensor(sensor::Out::Ping(ping)) => to.push(To::Edge(Effect::Ping(ping))),
        Said::Sensor(sensor::Out::Scan(scan)) => {
            to.push(To::Vehicle(vehicle::In::Scan(scan.clone())));
            to.push(To::Map(map::In::Scan(scan)));
        }
        Said::Map(map::Out::Tiles(tiles)) => {
            to.extend(tiles.into_iter().map(|tile| To::Mission(mission::In::Tile(tile))));
        }
        Said::Map(map::Out::Publish(message)) => to.push(To::Edge(Effect::Publish(message))),
        Said::Mission(out) => route_mission(out, to),
        Said::Radio(radio::Out::Transmit(beacon)) => to.push(To::Edge(Effect::Transmit(beacon))),
        Said::Radio(radio::Out::Sample(run, sample)) => {
            to.push(To::Edge(Effect::Keep(run, sample)));
        }
        Said::Radio(radio::Out::Peer(sighting)) => {
            to.push(To::Vehicle(vehicle::In::Sighted(sighting)));
            to.push(To::Mission(mission::In::Sighted(sighting)));
        }
        Said::Outbox(out) => to.push(To::Edge(outbox_effect(out))),
    }
}

fn outbox_effect(out: outbox::Out) -> Effect {
    match out {
        outbox::Out::Publish(samples) => Effect::Publish(Message::Samples(samples)),
        outbox::Out::Forget { boot, run, below } => Effect::Forget { boot, run, below },
        outbox::Out::Recall { after } => Effect::Recall { after },
        outbox::Out::Tally(tally) => Effect::Tally(tally),
    }
}

fn route_message(sender: Sender, message: Message, to: &mut Vec<To>) {
    to.push(To::Mission(mission::In::Heard(sender)));
    match message {
        Message::State(state) => {
            to.push(To::Vehicle(vehicle::In::Peer(state.clone())));
            to.push(To::Map(map::In::Peer(state.clone())));
            to.push(To::Mission(mission::In::Peer(state)));
        }
        Message::Tile(report) => to.push(To::Map(map::In::Tile(report))),
        Message::Digest(digest) => to.push(To::Map(map::In::Digest(digest))),
        Message::Want(want) => to.push(To::Map(map::In::Want(want))),
        Message::Plan(plan) => to.push(To::Mission(mission::In::Plan(plan))),
        Message::Mission(mission) => to.push(To::Mission(mission::In::Progress((&mission).into()))),
        Message::Order(order) => to.push(To::Vehicle(vehicle::In::Order(order))),
        Message::Have(have) => to.push(To::Outbox(outbox::In::Have(have))),
        // Samples are the ground's business, images operators'; beacons come by radio; greetings are the bus's. Nothing
        // is done yet about open stops and tasks.
        Message::Samples(_)
        | Message::Beacon(_)
        | Message::Hello(_)
        | Message::Health(_)
        | Message::Report(_)
        | Message::Standing(_)
        | Message::Task(_)
        | Message::Image(_) => {}
    }
}

fn route_vehicle(out: vehicle::Out, to: &mut Vec<To>) {
    match out {
        vehicle::Out::Fly(fly) => to.push(To::Edge(Effect::Fly(fly))),
        vehicle::Out::State(state) => {
            to.push(To::Sensor(sensor::In::State(state.clone())));
            to.push(To::Radio(radio::In::State(state.clone())));
            to.push(To::Mission(mission::In::State(state)));
        }
        vehicle::Out::Order(order) => to.push(To::Mission(mission::In::Order(order))),
        vehicle::Out::Publish(state) => to.push(To::Edge(Effect::Publish(Message::State(state)))),
        vehicle::Out::Remark(remark) => {
            to.push(To::Mission(mission::In::Remark(remark.clone())));
            to.push(To::Edge(Effect::Note(Note::Vehicle(remark))));
        }
    }
}

fn route_mission(out: mission::Out, to: &mut Vec<To>) {
    match out {
        mission::Out::Command(decided, command) => {
            to.push(To::Vehicle(vehicle::In::Command(decided, command)));
        }
        mission::Out::Holds(holds) => to.push(To::Vehicle(vehicle::In::Holds(holds))),
        mission::Out::Accepted(run, revision) => {
            to.push(To::Vehicle(vehicle::In::Accepted(run, revision)));
        }
        mission::Out::Progress(mission) => {
            to.push(To::Radio(radio::In::Progress(mission.progress)));
            to.push(To::Edge(Effect::Publish(Message::Mission(mission))));
        }
        mission::Out::Measure(run) => to.push(To::Radio(radio::In::Measure(run))),
        mission::Out::Remark(remark) => to.push(To::Edge(Effect::Note(Note::Mission(remark)))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Digest, OperatorId, VehicleId, Want};

    /// Returns of whom a mission hears when a sender says a message.
    fn heard(sender: Sender, message: Message) -> Vec<Sender> {
        let mut to = Vec::new();
        route(Said::Edge(Event::Bus(sender, message)), &mut to);
        let heard = to.into_iter().filter_map(|to| match to {
            To::Mission(mission::In::Heard(by)) => Some(by),
            _ => None,
        });
        heard.collect()
    }

    #[test]
    fn what_names_no_author_is_heard_of_whoever_says_it() {
        for sender in [Sender::Ground, Sender::Vehicle(VehicleId(2)), Sender::Operator(OperatorId(1))] {
            assert_eq!(heard(sender, Message::Digest(Digest::default())), [sender]);
            let want = Want { layer: Default::default(), known: vec![] };
            assert_eq!(heard(sender, Message::Want(want)), [sender]);
        }
    }
}
