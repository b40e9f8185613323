//! What changes with a vehicle, as lines for the people at ground stations.

use std::collections::BTreeSet;

use tomoswarm_proto::{MissionEnd, RunId, StandReason};

use super::readout::VehicleReport;
use crate::mavlink::dialect::MavSeverity;

/// A line for people.
pub(super) type Notice = (MavSeverity, String);

/// What was said last.
#[derive(Clone, Debug, Default)]
pub(super) struct Notices {
    stands_under: Option<StandReason>,
    end: Option<(RunId, MissionEnd)>,
    /// Whose troubles are known: the words may change while it lasts.
    troubles: BTreeSet<String>,
}

impl Notices {
    /// Returns what has changed.
    pub(super) fn changed(&mut self, report: &VehicleReport<'_>) -> Vec<Notice> {
        let mut out = Vec::new();
        let stands_under = report.state.stands_under;
        if stands_under != self.stands_under {
            self.stands_under = stands_under;
            out.push(stand_in_words(stands_under));
        }
        let end = report
            .mission
            .and_then(|mission| Some((mission.progress.run, mission.end?)));
        if end != self.end {
            self.end = end;
            out.extend(end.map(|(run, end)| {
                let text = format!("Mission of run {run} is over: {end}");
                (MavSeverity::MAV_SEVERITY_NOTICE, text)
            }));
        }
        if let Some(health) = report.health {
            self.troubles(&health.troubles, &mut out);
        }
        out
    }

    fn troubles(&mut self, all: &[String], out: &mut Vec<Notice>) {
        let who = |trouble: &String| {
            let (who, _) = trouble.split_once(": ").unwrap_or((trouble, ""));
            who.to_owned()
        };
        let is_new = |trouble: &&String| !self.troubles.contains(&who(trouble));
        let new = all.iter().filter(is_new);
        out.extend(new.map(|trouble| (MavSeverity::MAV_SEVERITY_WARNING, trouble.clone())));
        let now: BTreeSet<String> = all.iter().map(who).collect();
        let gone = self.troubles.difference(&now);
        out.extend(gone.map(|who| {
            let text = format!("{who}: in order again");
            (MavSeverity::MAV_SEVERITY_INFO, text)
        }));
        self.troubles = now;
    }
}

fn stand_in_words(reason: Option<StandReason>) -> Notice {
    use MavSeverity as Is;
    let (severity, text) = match reason {
        None => (Is::MAV_SEVERITY_NOTICE, "may go on"),
        Some(StandReason::Stop(name)) => {
            let text = format!("Emergency stop {name}");
            return (Is::MAV_SEVERITY_EMERGENCY, text);
        }
        Some(StandReason::Held) => (Is::MAV_SEVERITY_NOTICE, "stands by an order"),
        Some(StandReason::Remote) => (Is::MAV_SEVERITY_WARNING, "steered by remote control"),
        Some(StandReason::Autopilot) => (Is::MAV_SEVERITY_WARNING, "its autopilot acts by itself"),
        Some(StandReason::Battery) => (Is::MAV_SEVERITY_CRITICAL, "does not go on: battery is low"),
        Some(StandReason::NoPlace) => (Is::MAV_SEVERITY_CRITICAL, "stands: its place is not known"),
        Some(StandReason::Alone) => (Is::MAV_SEVERITY_WARNING, "stands: it hears nobody"),
        Some(StandReason::Blind) => (
            Is::MAV_SEVERITY_CRITICAL,
            "does not go on: range sensors are silent",
        ),
    };
    (severity, text.to_owned())
}
