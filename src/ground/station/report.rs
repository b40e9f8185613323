//! What the station says of itself once a second, for operators and other grounds. It reads what the parts say of
//! themselves, and changes nothing.

use std::time::Duration;

use tomoswarm_proto::{Boot, GroundReport, Lease, RunId, StationPhase, VehicleId, fitted_troubles};

use super::execution::{ExecutionPhase, SweepExecution, SweepRun};
use super::leases::Leases;
use super::lost_vehicles::is_too_few;
use super::order_in_force::OrderInForce;
use super::run_registry::RunRegistry;
use crate::ground::fleet::Fleet;
use crate::ground::samples::SampleStore;
use crate::time::Time;

/// Vehicles named in one trouble at most.
const NAMED: usize = 12;
/// Vehicles take a plan within this time; who does not is worth a trouble.
const TAKEN_WITHIN: Duration = Duration::from_secs(3);

/// The parts of which something is reported, as they are now.
#[derive(Clone, Copy, Debug)]
pub(super) struct PartsToReport<'a> {
    pub now: Time,
    pub boot: Boot,
    pub leases: &'a Leases,
    pub fleet: &'a Fleet,
    pub samples: &'a SampleStore,
    pub order: OrderInForce,
    pub runs: &'a RunRegistry,
    pub execution: &'a SweepExecution,
    /// Messages of vehicles that are not expected.
    pub strangers: u64,
    /// What is wrong with the process, in words.
    pub of_process: &'a [String],
}

impl PartsToReport<'_> {
    /// Returns the report.
    pub(super) fn report(self) -> GroundReport {
        let of_run = self.run_under_way();
        let lease = match self.leases.holds() {
            true => self.leases.own(),
            false => Lease::default(),
        };
        let phase = self.execution.phase();
        let planned_for = self.execution.plans().members();
        let planned_for = planned_for.filter(|_| phase.sweep().is_some());
        GroundReport {
            boot: self.boot,
            lease,
            store: self.samples.store(),
            phase: station_phase(phase, self.runs.requested().is_some()),
            run: of_run.run,
            laps_done: count(of_run.laps_done),
            laps: count(of_run.laps),
            samples: self.samples.count(of_run.run),
            images: self.runs.runs().images(of_run.run),
            expected: self.fleet.members().map(|(id, _)| id).collect(),
            members: planned_for.map_or_else(|| self.fleet.present(), <[VehicleId]>::to_vec),
            lost: self.fleet.lost(),
            // Also while another ground station is obeyed, which alone brings that to an end.
            in_force: self.order.strongest_with(self.fleet.order_in_force()),
            runs: self.runs.runs().reports(|run| self.samples.count(run)),
            troubles: self.all_troubles(),
        }
    }

    /// Returns which run is reported: the sweep that is under way, or else the newest one, a sweep or one that is left to
    /// the vehicles.
    fn run_under_way(self) -> RunUnderWay {
        let phase = self.execution.phase();
        let sweep = phase.newest_sweep();
        let newest = sweep.map(SweepRun::run);
        let of_vehicles = self.runs.runs().newest_left_to_vehicles();
        let of_vehicles = of_vehicles.filter(|run| Some(*run) > newest);
        match (phase.sweep().is_some(), sweep, of_vehicles) {
            (false, _, Some(run)) => RunUnderWay {
                run,
                ..RunUnderWay::default()
            },
            (_, Some(sweep), _) => RunUnderWay {
                run: sweep.run(),
                laps_done: sweep.laps_done(),
                laps: match phase {
                    ExecutionPhase::Running { laps, .. } => laps.total(),
                    ExecutionPhase::Idle { .. }
                    | ExecutionPhase::Stopping { .. }
                    | ExecutionPhase::Planning { .. }
                    | ExecutionPhase::Closing { .. } => sweep.laps_done(),
                },
            },
            (_, None, _) => RunUnderWay::default(),
        }
    }

    /// Returns what is wrong with the sweep and with the process, as much of it as a message carries.
    fn all_troubles(self) -> Vec<String> {
        let own = self.troubles().in_words().into_iter();
        fitted_troubles(own.chain(self.of_process.iter().cloned()).collect())
    }

    fn troubles(self) -> Troubles {
        let phase = self.execution.phase();
        let is_waiting = self.runs.requested().is_some() || phase.sweep().is_some();
        let is_overdue = match phase {
            ExecutionPhase::Stopping { since, .. } | ExecutionPhase::Running { since, .. } => {
                self.now.since(*since) > TAKEN_WITHIN
            }
            ExecutionPhase::Idle { .. }
            | ExecutionPhase::Planning { .. }
            | ExecutionPhase::Closing { .. } => false,
        };
        let missing = self.execution.plans().missing();
        Troubles {
            obeyed: self.leases.stands_by().then(|| self.leases.highest()),
            lost: self.fleet.lost(),
            unheard: self
                .fleet
                .unheard()
                .into_iter()
                .filter(|_| is_waiting)
                .collect(),
            waits_for_more: matches!(phase, ExecutionPhase::Stopping { .. })
                && is_too_few(self.fleet),
            without_plan: missing.filter(|_| is_overdue).collect(),
            strangers: self.strangers,
            refused: self.samples.refused(),
            of_run: self.runs.runs().trouble(),
        }
    }
}

/// The run that is reported; run 0 = none.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
struct RunUnderWay {
    run: RunId,
    laps_done: usize,
    laps: usize,
}

/// What keeps the station from doing what is wanted.
#[derive(Clone, PartialEq, Debug, Default)]
struct Troubles {
    /// The lease of another ground that is stood by for.
    obeyed: Option<Lease>,
    lost: Vec<VehicleId>,
    /// Vehicles that are waited for and were not heard yet.
    unheard: Vec<VehicleId>,
    waits_for_more: bool,
    /// Vehicles that do not show their plans yet.
    without_plan: Vec<VehicleId>,
    /// Messages of vehicles that are not expected.
    strangers: u64,
    /// Samples for which there was no room.
    refused: u64,
    of_run: Option<String>,
}

impl Troubles {
    fn in_words(&self) -> Vec<String> {
        let obeyed = self.obeyed.map(|lease| {
            let Lease { number, holder } = lease;
            format!("stands by: ground {holder:016x} holds lease {number}")
        });
        let waits = "waits until enough vehicles are back".to_owned();
        let (strangers, refused) = (self.strangers, self.refused);
        let strangers = format!("{strangers} messages of strangers were passed over");
        let refused = format!("{refused} samples were not stored, for want of room");
        let words = [
            obeyed,
            named("not heard any more", &self.lost),
            named("not heard yet", &self.unheard),
            self.waits_for_more.then_some(waits),
            named("do not follow their plan yet", &self.without_plan),
            (self.strangers > 0).then_some(strangers),
            (self.refused > 0).then_some(refused),
            self.of_run.clone(),
        ];
        words.into_iter().flatten().collect()
    }
}

fn station_phase(phase: &ExecutionPhase, is_requested: bool) -> StationPhase {
    match phase {
        ExecutionPhase::Idle { .. } if is_requested => StationPhase::Waiting,
        ExecutionPhase::Idle { .. } => StationPhase::Idle,
        ExecutionPhase::Stopping { .. } => StationPhase::Stopping,
        ExecutionPhase::Planning { .. } => StationPhase::Planning,
        ExecutionPhase::Running { .. } => StationPhase::Running,
        ExecutionPhase::Closing { .. } => StationPhase::Closing,
    }
}

fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

/// Says something of vehicles; of none there is nothing to say.
fn named(what: &str, vehicles: &[VehicleId]) -> Option<String> {
    let ids: Vec<String> = vehicles
        .iter()
        .take(NAMED)
        .map(VehicleId::to_string)
        .collect();
    let more = vehicles.len().saturating_sub(NAMED);
    let rest = match more {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    (!ids.is_empty()).then(|| format!("{what}: vehicle {}{rest}", ids.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_trouble_is_said_in_words_and_none_when_there_is_none() {
        assert_eq!(Troubles::default().in_words(), [""; 0]);
        let troubles = Troubles {
            obeyed: Some(Lease {
                number: 4,
                holder: 0xab,
            }),
            lost: vec![VehicleId(3)],
            unheard: vec![VehicleId(4), VehicleId(5)],
            waits_for_more: true,
            without_plan: (1..=14).map(VehicleId).collect(),
            strangers: 6,
            refused: 7,
            of_run: Some("run 2 has failed: no way".to_owned()),
        };
        assert_eq!(
            troubles.in_words(),
            [
                "stands by: ground 00000000000000ab holds lease 4",
                "not heard any more: vehicle 3",
                "not heard yet: vehicle 4, 5",
                "waits until enough vehicles are back",
                "do not follow their plan yet: vehicle 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12 and 2 more",
                "6 messages of strangers were passed over",
                "7 samples were not stored, for want of room",
                "run 2 has failed: no way",
            ]
        );
    }

    #[test]
    fn a_requested_sweep_is_waited_for_only_while_none_is_under_way() {
        let idle = ExecutionPhase::default();
        assert_eq!(station_phase(&idle, false), StationPhase::Idle);
        assert_eq!(station_phase(&idle, true), StationPhase::Waiting);
    }
}
