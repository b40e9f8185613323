//! What a run of an experiment gave, in figures, and all runs as CSV. Nothing here depends on how fast the machine is.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use crate::cli::{person_search, report};
use crate::config::{Axis, Experiment};
use crate::geom::Point;
use crate::node::mission;
use crate::sim::visible;
use crate::sim::{EndedMission, NEAR_M, RunOutcome, SLICE, Scenario, VisibleScene, log};

/// How a run ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum RowEnd {
    /// As its file expects, and nothing went wrong on the way: `sim` says that it has finished.
    Finished,
    /// In another way, with a collision or a breach of the fence, or with nothing done.
    Failed,
    /// It could not begin with this seed.
    Refused,
    /// The program was at fault.
    Fault,
}

impl RowEnd {
    /// Returns the word for it.
    pub(super) fn word(self) -> &'static str {
        match self {
            RowEnd::Finished => "finished",
            RowEnd::Failed => "failed",
            RowEnd::Refused => "refused",
            RowEnd::Fault => "fault",
        }
    }
}

/// What a run gave.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct RunRow {
    /// Its number in the grid, from 0.
    pub(super) run: usize,
    /// How it ended.
    pub(super) end: RowEnd,
    /// Why it failed, as `sim` says it; empty when it did not.
    pub(super) why: String,
    /// How the mission ended, of the vehicle with the worst end; empty for a sweep.
    pub(super) mission: String,
    /// When the last mission ended, seconds of virtual time; the way home comes after it. `None` while one is under way, and
    /// for a sweep.
    pub(super) mission_s: Option<f64>,
    /// Contacts that the referee saw.
    pub(super) collisions: usize,
    /// Commands that led over the fence.
    pub(super) fence_breaches: usize,
    /// Virtual time at the end, seconds.
    pub(super) simulated_s: f64,
    /// Cells that are occupied in what the nodes know together at the end ([`RunOutcome::map`]).
    pub(super) occupied_cells: usize,
    /// Cells with a piece of surface that can be seen from where a vehicle can get to.
    pub(super) visible_cells: usize,
    /// How many of them the map has found.
    pub(super) detected_cells: usize,
    /// Those of the visible cells that were in range along the driven tracks.
    pub(super) route_cells: usize,
    /// How many of them the map has found.
    pub(super) route_detected_cells: usize,
    /// Places to visit that their vehicle can get to by the truth of the scene.
    pub(super) places_reachable: usize,
    /// How many of them it visited.
    pub(super) places_visited: usize,
    /// Of how many of them it was said that no way leads there.
    pub(super) false_no_way: usize,
    /// Length of all tracks together, metres.
    pub(super) path_m: f64,
    /// Smallest distance between a body and an object, metres; `None` in an empty scene.
    pub(super) clearance_m: Option<f64>,
    /// Persons of the scene, where they were searched in the change since an empty sweep.
    #[serde(default)]
    pub(super) persons: usize,
    /// How many of them were found within a metre, each by another find.
    #[serde(default)]
    pub(super) persons_found: usize,
    /// Finds that are none of them.
    #[serde(default)]
    pub(super) false_finds: usize,
    /// Persons of the scene who were to be searched and were not: the sweep was given up.
    #[serde(default)]
    pub(super) persons_unsearched: usize,
    /// Root mean square of how far the finds of persons are off, metres; `None` when nobody was found.
    #[serde(default)]
    pub(super) find_error_m: Option<f64>,
    /// Hash over the run's log.
    pub(super) log_hash: String,
}

impl RunRow {
    /// Makes the row of a run that came to no outcome.
    pub(super) fn without_figures(run: usize, end: RowEnd, why: String) -> RunRow {
        RunRow {
            run,
            end,
            why,
            mission: String::new(),
            mission_s: None,
            collisions: 0,
            fence_breaches: 0,
            simulated_s: 0.0,
            occupied_cells: 0,
            visible_cells: 0,
            detected_cells: 0,
            route_cells: 0,
            route_detected_cells: 0,
            places_reachable: 0,
            places_visited: 0,
            false_no_way: 0,
            path_m: 0.0,
            clearance_m: None,
            persons: 0,
            persons_found: 0,
            false_finds: 0,
            persons_unsearched: 0,
            find_error_m: None,
            log_hash: String::new(),
        }
    }

    /// Takes the figures of an outcome.
    pub(super) fn of(
        run: usize,
        scenario: &Scenario,
        outcome: &RunOutcome,
        seen: &VisibleScene,
    ) -> RunRow {
        let tracks = || outcome.tracks.iter().map(|(_, track)| track.as_slice());
        let route = seen.visible.along(&seen.scene, &seen.sight, tracks());
        let places = seen.count_places(&outcome.places);
        let (found, failure) = (outcome.found(), report::failure(scenario, outcome));
        let persons_when = |is_so: bool| if is_so { outcome.persons.len() } else { 0 };
        let is_searched = outcome.has_searched();
        let is_unsearched = person_search::is_wanted(scenario.sim()) && !is_searched;
        let errors_m: Vec<f64> = found
            .iter()
            .filter(|find| find.is_somebody())
            .filter_map(|find| find.error_m)
            .collect();
        let squares: f64 = errors_m.iter().map(|error_m| error_m * error_m).sum();
        let of_persons_m = outcome.errors_m().into_iter();
        let persons_found = of_persons_m.filter(|error_m| *error_m <= NEAR_M);
        RunRow {
            run,
            end: match failure {
                None => RowEnd::Finished,
                Some(_) => RowEnd::Failed,
            },
            why: failure.unwrap_or_default(),
            mission: worst_of(&outcome.missions),
            mission_s: last_of(&outcome.missions),
            collisions: outcome.collisions.len(),
            fence_breaches: outcome.fence_breaches,
            simulated_s: outcome.simulated.as_secs_f64(),
            occupied_cells: visible::occupied(&outcome.map, SLICE),
            visible_cells: seen.visible.cells.len(),
            detected_cells: seen.detected(outcome),
            route_cells: route.len(),
            route_detected_cells: visible::detected(&outcome.map, SLICE, &route),
            places_reachable: places.reachable,
            places_visited: places.visited,
            false_no_way: places.false_no_way,
            path_m: tracks()
                .map(length_m)
                .fold(0.0, |sum, length_m| sum + length_m),
            clearance_m: visible::least_clearance_m(&seen.lasting, seen.body, tracks()),
            persons: persons_when(is_searched),
            persons_found: persons_found.count(),
            false_finds: found.len() - errors_m.len(),
            persons_unsearched: persons_when(is_unsearched),
            find_error_m: (!errors_m.is_empty()).then(|| (squares / errors_m.len() as f64).sqrt()),
            log_hash: format!("{:016x}", log::hash(outcome.log.bytes().map(u64::from))),
        }
    }

    /// Returns the share of the visible cells that was found, 0 to 1; `None` when nothing can be seen.
    pub(super) fn share(&self) -> Option<f64> {
        share(self.detected_cells, self.visible_cells)
    }

    /// Returns the share of what was in range along the tracks that was found, 0 to 1; `None` when nothing was.
    pub(super) fn route_share(&self) -> Option<f64> {
        share(self.route_detected_cells, self.route_cells)
    }

    fn fields(&self) -> [String; 25] {
        let percent =
            |share: Option<f64>| share.map_or(String::new(), |share| format!("{share:.4}"));
        [
            self.end.word().to_owned(),
            quoted(&self.why),
            self.mission.clone(),
            self.mission_s
                .map_or(String::new(), |seconds| format!("{seconds:.1}")),
            self.collisions.to_string(),
            self.fence_breaches.to_string(),
            format!("{:.1}", self.simulated_s),
            self.occupied_cells.to_string(),
            self.visible_cells.to_string(),
            self.detected_cells.to_string(),
            percent(self.share()),
            self.route_cells.to_string(),
            self.route_detected_cells.to_string(),
            percent(self.route_share()),
            self.places_reachable.to_string(),
            self.places_visited.to_string(),
            self.false_no_way.to_string(),
            format!("{:.2}", self.path_m),
            self.clearance_m
                .map_or(String::new(), |metres| format!("{metres:.3}")),
            self.persons.to_string(),
            self.persons_found.to_string(),
            self.false_finds.to_string(),
            self.find_error_m
                .map_or(String::new(), |metres| format!("{metres:.3}")),
            self.persons_unsearched.to_string(),
            self.log_hash.clone(),
        ]
    }
}

const FIELDS: [&str; 25] = [
    "end",
    "why",
    "mission_end",
    "mission_s",
    "collisions",
    "fence_breaches",
    "simulated_s",
    "occupied_cells",
    "visible_cells",
    "detected_cells",
    "detected_share",
    "route_cells",
    "route_detected_cells",
    "route_detected_share",
    "places_reachable",
    "places_visited",
    "false_no_way",
    "path_m",
    "min_clearance_m",
    "persons",
    "persons_found",
    "false_finds",
    "find_error_m",
    "persons_unsearched",
    "log_hash",
];

/// How missions end, best first.
pub(super) const ENDS: [&str; 6] = [
    "done",
    "stopped",
    "no way",
    "gave up",
    "refused",
    "under way",
];

/// Returns the word for the worst end of all vehicles' missions; nothing when there are none, in a sweep.
fn worst_of(missions: &[EndedMission]) -> String {
    let rank = |(_, end): &EndedMission| match end.as_ref().map(|(_, end)| end) {
        Some(mission::EndReason::Done) => 0,
        Some(mission::EndReason::Stopped(_)) => 1,
        Some(mission::EndReason::NoWay(_)) => 2,
        Some(
            mission::EndReason::GaveUp(_)
            | mission::EndReason::NoRoom
            | mission::EndReason::TooLarge
            | mission::EndReason::NoPlace
            | mission::EndReason::Blind
            | mission::EndReason::BusLost
            | mission::EndReason::BatteryLow
            | mission::EndReason::Stalled
            | mission::EndReason::ShutIn { .. },
        ) => 3,
        Some(mission::EndReason::Refused(_)) => 4,
        None => 5,
    };
    let worst = missions.iter().map(rank).max();
    let word = worst.and_then(|worst| ENDS.get(worst).copied());
    word.unwrap_or_default().to_owned()
}

/// Returns when the last mission ended, seconds; `None` unless all have ended.
fn last_of(missions: &[EndedMission]) -> Option<f64> {
    let ends = missions
        .iter()
        .map(|(_, end)| Some(end.as_ref()?.0.as_secs_f64()));
    let ends: Vec<f64> = ends.collect::<Option<_>>()?;
    ends.into_iter().max_by(f64::total_cmp)
}

/// Returns which share a part is of something, 0 to 1; `None` of nothing.
pub(super) fn share(part: usize, of: usize) -> Option<f64> {
    (of > 0).then(|| part as f64 / of as f64)
}

fn length_m(track: &[Point]) -> f64 {
    // An empty sum of floats would be −0.
    track
        .windows(2)
        .fold(0.0, |sum, pair| sum + pair[0].distance_to(pair[1]))
}

/// Quotes a text for CSV where that is needed.
fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) {
        return format!(
            "\"{}\"",
            text.replace('"', "\"\"").replace(['\n', '\r'], " ")
        );
    }
    text.to_owned()
}

/// Returns all runs as CSV, a row each; `rows` are in grid order.
pub(super) fn csv(experiment: &Experiment, rows: &[RunRow]) -> String {
    let axes = Axis::ALL.map(Axis::word).join(",");
    let mut text = format!("run,{axes},{}\n", FIELDS.join(","));
    for row in rows {
        let values = Axis::ALL
            .map(|axis| experiment.name_of(row.run, axis))
            .join(",");
        // Writing into a string cannot fail.
        let _ = writeln!(text, "{},{values},{}", row.run, row.fields().join(","));
    }
    text
}
