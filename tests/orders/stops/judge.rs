//! What must be so in a world of emergency stops, whatever goes wrong in it: nobody drives under an open stop, everybody shows
//! it in time, and a lift alone moves nobody. Sees the vehicles from outside, tick by tick, and changes nothing.

use std::time::Duration;

use tomoswarm::time::Time;
use tomoswarm_proto::{Boot, VehicleId};

use super::{END_S, LIFT_S, STOP_S, TICK, at};

/// What a world has shown.
#[derive(Clone, Debug, Default)]
pub struct StopsTally {
    /// From the stop to when each vehicle that could be reached by bus showed it, less the seed's longest delay.
    pub by_bus: Vec<Duration>,
    /// From when each vehicle that heard by beacons alone could hear, in turns of the ring, and in time.
    pub by_beacons: Vec<(f64, Duration)>,
    /// Vehicles that were started anew under the stop.
    pub restarted: usize,
    /// Vehicles that drove when the stop was given.
    pub driving: usize,
    /// Vehicles that drove again after it was lifted.
    pub driving_again: usize,
}

impl StopsTally {
    /// Adds another world's.
    pub fn add(&mut self, other: &StopsTally) {
        self.by_bus.extend(&other.by_bus);
        self.by_beacons.extend(&other.by_beacons);
        self.restarted += other.restarted;
        self.driving += other.driving;
        self.driving_again += other.driving_again;
    }

    /// Returns the share of those who heard by beacons alone that did within three turns of the ring.
    pub fn within_three_turns(&self) -> f64 {
        let within = self
            .by_beacons
            .iter()
            .filter(|(turns, _)| *turns <= 3.0)
            .count();
        within as f64 / self.by_beacons.len().max(1) as f64
    }
}

/// What a world makes hard, for as long as it lasts.
#[derive(Clone, Debug)]
pub struct Hardships {
    /// The longest delay of a frame.
    pub longest: Duration,
    /// The share of the frames that are lost.
    pub loss: f64,
    /// Vehicles that are cut off the bus, by their places in the list, from when, and until when.
    pub cuts: Vec<(usize, Time, Time)>,
    /// By beacons alone: only this vehicle hears anyone by bus once the stop is given.
    pub only_by_bus: Option<usize>,
    /// A slot of the radios' ring.
    pub slot: Duration,
}

/// The vehicles at a moment.
#[derive(Clone, Debug)]
pub struct Seen {
    pub now: Time,
    pub vehicles: Vec<SeenVehicle>,
    /// Whether the operator has lifted the stop.
    pub is_lifted: bool,
    pub is_operator_dead: bool,
}

/// A vehicle at a moment.
#[derive(Clone, Copy, Debug)]
pub struct SeenVehicle {
    pub id: VehicleId,
    /// The start of its software, and when that was up.
    pub boot: Boot,
    pub up_from: Time,
    /// Whether it shows the stop as open.
    pub shows: bool,
    pub is_driving: bool,
}

/// The judge of one world.
pub struct Judge {
    hardships: Hardships,
    /// Which start of its software each vehicle has, and when that has shown the stop first.
    shown: Vec<(Boot, Option<Time>)>,
    tally: StopsTally,
}

impl Judge {
    /// Makes the judge of a world that is hard in this way.
    pub fn new(hardships: Hardships) -> Judge {
        Judge {
            hardships,
            shown: Vec::new(),
            tally: StopsTally::default(),
        }
    }

    /// Returns what the world has shown.
    pub fn tally(self) -> StopsTally {
        self.tally
    }

    /// Looks at the vehicles after a tick.
    ///
    /// # Errors
    /// What is not as it must be.
    pub fn look(&mut self, seen: &Seen) -> Result<(), String> {
        let driving = seen
            .vehicles
            .iter()
            .filter(|vehicle| vehicle.is_driving)
            .count();
        if seen.now == at(STOP_S) {
            self.tally.driving += driving;
        }
        if seen.now + TICK >= at(END_S) && seen.is_lifted {
            self.tally.driving_again += driving;
        }
        for (index, vehicle) in seen.vehicles.iter().enumerate() {
            self.note_shown(seen.now, index, vehicle);
            if vehicle.shows && vehicle.is_driving {
                return Err(format!("vehicle {} drives under an open stop", vehicle.id));
            }
            // Before it, the mission drove; after it was lifted only who is started anew drives.
            let is_second = index >= seen.vehicles.len().div_ceil(2);
            let has_shown = self.shown[index].1.is_some();
            if seen.is_lifted && is_second && vehicle.is_driving && has_shown {
                return Err(format!(
                    "vehicle {} moves after the lift without an operator's start",
                    vehicle.id
                ));
            }
        }
        if seen.now == at(LIFT_S - 0.1) {
            self.judge_reach(seen)
        } else {
            Ok(())
        }
    }

    fn note_shown(&mut self, now: Time, index: usize, vehicle: &SeenVehicle) {
        if index == self.shown.len() {
            self.shown.push((vehicle.boot, None));
        }
        let (boot, at_first) = &mut self.shown[index];
        if *boot != vehicle.boot {
            (*boot, *at_first) = (vehicle.boot, None);
            self.tally.restarted += usize::from(now >= at(STOP_S));
        }
        if vehicle.shows {
            at_first.get_or_insert(now);
        }
    }

    /// Looks who showed the stop when.
    fn judge_reach(&mut self, seen: &Seen) -> Result<(), String> {
        // Nobody heard of it before the operator died.
        if self.shown.iter().all(|(_, at)| at.is_none()) && seen.is_operator_dead {
            return Ok(());
        }
        for (index, vehicle) in seen.vehicles.iter().enumerate() {
            let Some(shown_at) = self.shown[index].1 else {
                return Err(format!("vehicle {} never heard of the stop", vehicle.id));
            };
            match self.hardships.only_by_bus {
                Some(only) if only == index => {}
                Some(only) => self.judge_by_beacons(vehicle, shown_at, only)?,
                None => self.judge_by_bus(index, vehicle, shown_at)?,
            }
        }
        Ok(())
    }

    /// Judges one that hears beacons alone, from when the one that is reached by bus has shown the stop.
    fn judge_by_beacons(
        &mut self,
        vehicle: &SeenVehicle,
        shown_at: Time,
        only: usize,
    ) -> Result<(), String> {
        let took = shown_at.since(self.shown[only].1.unwrap_or(at(STOP_S)));
        let turn_s = self.shown.len() as f64 * self.hardships.slot.as_secs_f64();
        self.tally
            .by_beacons
            .push((took.as_secs_f64() / turn_s, took));
        if took > Duration::from_secs(10) {
            return Err(format!(
                "vehicle {} heard by beacons after {took:?}",
                vehicle.id
            ));
        }
        Ok(())
    }

    /// Judges one that is reached by bus, from when it could be reached without a break.
    fn judge_by_bus(
        &mut self,
        index: usize,
        vehicle: &SeenVehicle,
        shown_at: Time,
    ) -> Result<(), String> {
        let Hardships {
            longest,
            loss,
            cuts,
            ..
        } = &self.hardships;
        let given = at(STOP_S);
        let bound = Duration::from_millis(300) + *longest;
        let cuts = cuts
            .iter()
            .filter(|(cut, from, until)| *cut == index && *from < given + bound && *until > given);
        let from = cuts
            .map(|(_, _, until)| *until)
            .chain([given])
            .max()
            .unwrap_or(given);
        let is_late_start = vehicle.up_from > given;
        let (from, bound) = match (from > given, is_late_start) {
            // What was cut off learns it from the next word of anyone, said once a second.
            (true, _) => (from.max(vehicle.up_from), Duration::from_secs(4)),
            (false, true) => (vehicle.up_from, bound + *longest),
            (false, false) => (given, bound),
        };
        let took = shown_at.since(from);
        if from == given && !is_late_start {
            self.tally.by_bus.push(took.saturating_sub(*longest));
        }
        if took > bound && shown_at > from {
            return Err(format!(
                "vehicle {} showed the stop after {took:?}, longest delay {longest:?}, loss {loss:.2}",
                vehicle.id
            ));
        }
        Ok(())
    }
}
