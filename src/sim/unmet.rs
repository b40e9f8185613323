//! What was expected of a run and is not so at its end, in words that also say which limit ended it. It decides nothing:
//! when a run is over is the monitor's matter ([`super::run_monitor`]).

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::outcome::FleetCount;
use super::run_monitor::RunMonitor;
use crate::config::{AfterSweep, Expect, Sim};

/// Returns what was expected and is not so at the end; `is_time_up`: the run was given up at `until_s`.
pub(super) fn unmet(
    sim: &Sim,
    fleet: FleetCount,
    monitor: &RunMonitor,
    is_time_up: bool,
) -> Option<String> {
    let FleetCount { alive, home, held } = fleet;
    let limit = is_time_up.then(|| sim.until());
    let too_few = |count: usize, what: &str| {
        let when = limit.map_or(String::new(), |limit| format!(" when {}", given_up(limit)));
        (count < alive).then(|| format!("{what}: only {count} of {alive}{when}"))
    };
    match sim.expect {
        Expect::Finished if !monitor.is_done() => {
            let under_way = monitor.missions().iter().filter(|(_, end)| end.is_none());
            let ids: Vec<VehicleId> = under_way.map(|(id, _)| *id).collect();
            let missions_of = (!sim.is_planned_by_ground()).then_some(&ids[..]);
            Some(unended(missions_of, limit))
        }
        // Done, and on the way home when it was given up.
        Expect::Finished if is_time_up && sim.end == AfterSweep::Return => {
            too_few(home, "vehicles at home")
        }
        Expect::Finished => None,
        Expect::Home => too_few(home, "vehicles at home"),
        Expect::Held => too_few(held, "vehicles that hold"),
    }
}

/// Returns in words that a sweep, or the missions of these vehicles, did not end; `limit`: after how long the run was given
/// up, `None` when it ended for another reason.
pub fn unended(missions_of: Option<&[VehicleId]>, limit: Option<Duration>) -> String {
    let what = match missions_of {
        None => "the sweep".to_owned(),
        Some([id]) => format!("the mission of vehicle {id}"),
        Some(ids) => {
            let ids: Vec<String> = ids.iter().map(VehicleId::to_string).collect();
            format!("the missions of vehicles {}", ids.join(", "))
        }
    };
    match limit {
        None => format!("{what} did not end"),
        Some(limit) => format!("{what} did not end in time: {}", given_up(limit)),
    }
}

fn given_up(limit: Duration) -> String {
    format!(
        "the run was given up after {} s (until_s)",
        limit.as_secs_f64()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_did_not_end_says_after_how_long_it_was_given_up() {
        let ids = [VehicleId(1), VehicleId(3)];
        for (missions_of, limit_s, expected) in [
            (
                None,
                Some(60.0),
                "the sweep did not end in time: the run was given up after 60 s (until_s)",
            ),
            (None, None, "the sweep did not end"),
            (
                Some(&ids[..1]),
                Some(1.5),
                "the mission of vehicle 1 did not end in time: the run was given up after 1.5 s (until_s)",
            ),
            (
                Some(&ids[..]),
                None,
                "the missions of vehicles 1, 3 did not end",
            ),
        ] {
            let limit = limit_s.map(Duration::from_secs_f64);
            assert_eq!(unended(missions_of, limit), expected);
        }
    }
}
