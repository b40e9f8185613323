//! What lies outside the vehicles: the world with its bodies, the air between the radios, and where the range sensors
//! are pointed. Both runtimes ask it, the kernel in virtual time and the live world on real time.
//!
//! It keeps no queue and reads no clock: what will happen by itself is given with its moment, and handed back then.

use std::sync::Arc;
use std::time::Duration;

use tomoswarm_proto::{Beacon, VehicleId};

use super::air::{Air, Fate};
use super::noise::{Noise, Purpose};
use super::world::{Collision, PredictedContact, Stage, World};
use crate::geom::Angle;
use crate::node::sensor::Echo;
use crate::node::vehicle::{Fly, Telemetry};
use crate::plan::Pointing;
use crate::time::Time;

/// Telemetry comes this often.
pub const TELEMETRY_EVERY: Duration = Duration::from_millis(100);
/// Tracks are recorded this often.
pub const TRACK_EVERY: Duration = Duration::from_secs(1);

/// Gives when the telemetry of a vehicle comes for the first time: not all autopilots speak at the same moment.
pub fn first_telemetry(noise: Noise, vehicle: VehicleId) -> Time {
    Time::ZERO + TELEMETRY_EVERY.mul_f64(noise.uniform(Purpose::Start, &[u64::from(vehicle.0)]))
}

/// What happens by itself, later.
#[derive(Clone, PartialEq, Debug)]
pub enum Later {
    /// The range sensor of a vehicle has its reading.
    Echo {
        /// Index of the vehicle.
        vehicle: usize,
        /// The reading.
        echo: Echo,
    },
    /// A beacon has been sent to its end.
    AirEnds {
        /// Which one.
        number: u64,
    },
    /// Bodies touch, unless their motion changes before.
    Contact(PredictedContact),
}

/// What has happened.
#[derive(Clone, PartialEq, Debug)]
pub enum Happened {
    /// Nothing that anybody notices.
    Nothing,
    /// A vehicle gets a reading.
    Echo {
        /// Index of the vehicle.
        vehicle: usize,
        /// The reading.
        echo: Echo,
    },
    /// A beacon was lost because another one was on the air.
    Collided,
    /// A beacon was received.
    Heard {
        /// The bytes.
        frame: Arc<[u8]>,
        /// By whom (index of the vehicle), and how strongly, dBm.
        receivers: Vec<(usize, i16)>,
    },
    /// Bodies have touched.
    Collision(Collision),
}

/// What lies outside the vehicles.
pub struct Outside {
    world: World,
    air: Air,
    servos: Vec<Pointing>,
}

impl Outside {
    /// Takes a world with all its vehicles in place.
    pub fn new(world: World) -> Outside {
        let servos = vec![Pointing::new(world.mounts().clone()); world.vehicles()];
        Outside { world, air: Air::default(), servos }
    }

    /// Gives the world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Gives the smallest distance between the middles of two vehicles so far, metres; infinite for one alone.
    pub fn min_separation_m(&mut self, now: Time) -> f64 {
        self.world.min_separation_m(now)
    }

    /// Changes what stands in the world; contacts that were foreseen are void, these hold.
    pub fn set_stage(&mut self, stage: Stage, now: Time) -> Vec<PredictedContact> {
        self.world.set_stage(stage, now)
    }

    /// Gives what the autopilot of a vehicle reports.
    pub fn telemetry(&mut self, vehicle: usize, now: Time) -> Telemetry {
        self.world.telemetry(vehicle, now)
    }

    /// Gives the contacts that follow from what autopilots did by themselves; to be asked after their telemetry.
    pub fn foreseen(&mut self) -> Vec<PredictedContact> {
        self.world.foreseen()
    }

    /// Gives the battery of a vehicle a charge, 0 to 1.
    pub fn charge(&mut self, vehicle: usize, now: Time, charge: f64) {
        self.world.charge(vehicle, now, charge);
    }

    /// Lets the autopilot of a vehicle obey; gives the contacts that its new motion leads to.
    pub fn fly(&mut self, vehicle: usize, now: Time, fly: &Fly) -> Vec<PredictedContact> {
        self.world.fly(vehicle, now, fly)
    }

    /// Points the range sensor of a vehicle that reaches a direction (against its heading); its servo begins to turn.
    pub fn steer(&mut self, vehicle: usize, now: Time, beam: Angle) {
        self.servos[vehicle].steer(now.since(Time::ZERO), beam);
    }

    /// Lets the range sensor that was pointed last measure, wherever its servo stands; gives when the reading is there.
    pub fn ping(&self, vehicle: usize, now: Time, number: u64) -> (Time, Later) {
        let beam = self.servos[vehicle].beam(now.since(Time::ZERO));
        let (range_m, takes) = self.world.echo(vehicle, now, beam, number);
        (now + takes, Later::Echo { vehicle, echo: Echo { number, range_m } })
    }

    /// Lets the radio of a vehicle speak; gives when the beacon has been sent, or `None` when it does not fit into a
    /// frame.
    pub fn transmit(&mut self, vehicle: usize, now: Time, beacon: Beacon) -> Option<(Time, Later)> {
        let place = self.world.truth(vehicle, now).at;
        let (number, ends) = self.air.begin(now, vehicle, place, beacon)?;
        Some((ends, Later::AirEnds { number }))
    }

    /// Lets happen what was foreseen for this moment.
    pub fn happen(&mut self, now: Time, later: Later) -> Happened {
        match later {
            Later::Echo { vehicle, echo } => Happened::Echo { vehicle, echo },
            Later::AirEnds { number } => self.end_of_beacon(now, number),
            Later::Contact(touch) => self.world.touch(&touch).map_or(Happened::Nothing, Happened::Collision),
        }
    }

    fn end_of_beacon(&mut self, now: Time, number: u64) -> Happened {
        let sent = match self.air.end(now, number) {
            Fate::Clear(sent) => sent,
            Fate::Collided => return Happened::Collided,
            Fate::Unknown => return Happened::Nothing,
        };
        let others = (0..self.world.vehicles()).filter(|to| *to != sent.from);
        let receivers =
            others.filter_map(|to| Some((to, self.world.received_dbm(&sent, to, now)?))).collect();
        Happened::Heard { frame: sent.frame, receivers }
    }
}
