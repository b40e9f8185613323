//! What the station says of itself once a second, for operators and other grounds.

use tomoswarm_proto::{GroundReport, Message, OrderKind, StationPhase, VehicleId};

use super::{Out, Phase, Station};
use crate::sweep::Succession;

/// Vehicles named in one trouble at most.
const NAMED: usize = 12;

impl Station {
    pub(super) fn report(&self) -> Out {
        let sweep = self.phase.sweep().copied().or(self.last);
        let mission = self.newest_mission(sweep.map(|sweep| sweep.run));
        let sweep = sweep.filter(|_| mission.is_none() || self.phase != Phase::Idle);
        let mission = mission.filter(|_| sweep.is_none());
        let run = sweep.map(|sweep| sweep.run).or(mission).unwrap_or_default();
        let laps_done = sweep.map_or(0, |sweep| sweep.laps_done);
        let laps = match &self.phase {
            Phase::Running(sweep, laps) => sweep.laps_before + laps.len(),
            Phase::Idle | Phase::Planning(_) | Phase::Stopping(_) | Phase::Closing { .. } => {
                laps_done
            }
        };
        let count = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
        let planned_for = self
            .succession
            .as_ref()
            .filter(|_| self.phase.sweep().is_some());
        Out::Publish(Message::Report(GroundReport {
            boot: self.boot,
            lease: if self.leases.holds() {
                self.leases.own()
            } else {
                Default::default()
            },
            store: self.samples.store(),
            phase: self.station_phase(),
            run,
            laps_done: count(laps_done),
            laps: count(laps),
            samples: self.samples.count(run),
            images: self.pictures,
            expected: self.fleet.members().map(|(id, _)| id).collect(),
            members: planned_for
                .map_or_else(|| self.fleet.present(), |known| known.members().to_vec()),
            lost: self.fleet.lost(),
            // Also while another ground station is obeyed, which alone brings that to an end.
            in_force: self
                .standing
                .into_iter()
                .chain(self.fleet.standing())
                .reduce(OrderKind::stronger),
            runs: self.runs.reports(|run| self.samples.count(run)),
            troubles: self.troubles(),
        }))
    }

    fn station_phase(&self) -> StationPhase {
        match self.phase {
            Phase::Idle if self.wished.is_some() => StationPhase::Waiting,
            Phase::Idle => StationPhase::Idle,
            Phase::Planning(_) => StationPhase::Planning,
            Phase::Running(..) => StationPhase::Running,
            Phase::Stopping(_) => StationPhase::Stopping,
            Phase::Closing { .. } => StationPhase::Closing,
        }
    }

    fn troubles(&self) -> Vec<String> {
        let mut troubles = Vec::new();
        let mut say = |is_so: bool, words: String| {
            if is_so {
                troubles.push(words);
            }
        };
        let holder = self.leases.highest();
        say(
            self.leases.stands_by(),
            format!(
                "stands by: ground {:016x} holds lease {}",
                holder.holder, holder.number
            ),
        );
        let (lost, unheard) = (self.fleet.lost(), self.fleet.unheard());
        say(
            !lost.is_empty(),
            format!("not heard any more: {}", named(&lost)),
        );
        let is_waiting = self.wished.is_some() || self.phase.sweep().is_some();
        say(
            is_waiting && !unheard.is_empty(),
            format!("not heard yet: {}", named(&unheard)),
        );
        say(
            self.waits_for_more(),
            "waits until enough vehicles are back".to_owned(),
        );
        let missing: Vec<VehicleId> = self
            .succession
            .iter()
            .flat_map(Succession::missing)
            .collect();
        let is_under_way = matches!(self.phase, Phase::Stopping(_) | Phase::Running(..));
        say(
            is_under_way && !missing.is_empty(),
            format!("do not follow their plan yet: {}", named(&missing)),
        );
        say(
            self.strangers > 0,
            format!("{} messages of strangers were passed over", self.strangers),
        );
        let refused = self.samples.refused();
        say(
            refused > 0,
            format!("{refused} samples were not stored, for want of room"),
        );
        troubles.extend(self.runs.trouble());
        troubles
    }
}

fn named(vehicles: &[VehicleId]) -> String {
    let ids: Vec<String> = vehicles
        .iter()
        .take(NAMED)
        .map(VehicleId::to_string)
        .collect();
    let more = vehicles.len().saturating_sub(NAMED);
    let rest = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    format!("vehicle {}{rest}", ids.join(", "))
}
