//! What a simulation can end with: refuses what none with these keys ever ends with, whatever its seed.
//!
//! It counts on nothing but what is sure: where something goes wrong, messages are lost or a battery runs low, vehicles may come
//! home or stand by themselves, and then nothing is refused.

use super::super::mission::{AfterSweep, Expect};
use super::super::section::Section;
use super::Sim;

/// Refuses an expectation that the end of the mission rules out.
pub(super) fn check_expected(root: &Section, sim: &Sim) {
    // An autopilot may have its own way home among what it stores.
    if sim.is_disturbed() || sim.has_low_battery() || sim.mission.is_of_one() {
        return;
    }
    let (wrong, allowed) = match (sim.expect, sim.end) {
        (Expect::Home, AfterSweep::Hold) => (
            "is never so with end = \"hold\": nobody sends the vehicles home",
            "end = \"return\" is needed for that, or \"held\" or \"finished\" here",
        ),
        (Expect::Held, AfterSweep::Return) => (
            "is never so with end = \"return\": all vehicles are sent home",
            "end = \"hold\" is needed for that, or \"home\" or \"finished\" here",
        ),
        (Expect::Finished, AfterSweep::Hold | AfterSweep::Return)
        | (Expect::Home, AfterSweep::Return)
        | (Expect::Held, AfterSweep::Hold) => return,
    };
    root.source.refuse("expect", wrong, allowed);
}

impl Sim {
    /// Returns whether something goes wrong on the way.
    fn is_disturbed(&self) -> bool {
        let bus = &self.bus;
        !self.faults.is_empty() || !bus.partitions.is_empty() || bus.drop_share > 0.0
    }

    /// Returns whether a battery may be low before the run is given up.
    fn has_low_battery(&self) -> bool {
        self.low_battery_after_s() < self.until_s
    }

    /// Returns after how long a battery is low at the earliest, seconds.
    pub fn low_battery_after_s(&self) -> f64 {
        let vehicles = &self.vehicles;
        let full_s = vehicles
            .endurance_driving_s
            .min(vehicles.endurance_resting_s);
        full_s * (1.0 - self.safety.battery_return)
    }

    /// Returns whether only a low battery ends the mission of a vehicle.
    pub fn is_ended_by_battery(&self) -> bool {
        use tomoswarm_proto::TaskKind::Patrol;
        matches!(
            self.task,
            Some(Patrol {
                rounds: 0,
                duration_ms: 0,
                ..
            })
        )
    }

    /// Returns whether the run is given up before anything can end the mission of a vehicle.
    pub fn is_endless(&self) -> bool {
        self.is_ended_by_battery() && !self.is_disturbed() && !self.has_low_battery()
    }
}
