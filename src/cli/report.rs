//! What a run is reported as: the summary on the terminal, `summary.json`, and the data files.

use std::time::Duration;

use serde_json::{Value, json};

use super::counted::counted;
use super::error::CliError;
use super::folder::{FileFamily, OutputFolder};
use super::outputs::about;
use super::person_search::PersonSearch;
use super::recording::links_csv;
use super::samples_csv::samples_csv;
use super::tracks::write_tracks;
use crate::config::{Expect, LinksFile, SourceFile};
use crate::ground::imager::Subject;
use crate::node::mission::EndReason;
use crate::sim::bus::BytesByKind;
use crate::sim::{
    EMPTY_RUN, EndedMission, PlaceFate, RUN, RunOutcome, Scenario, ScenarioError, Silence,
    VisibleScene, narrowest_gap_m,
};
use crate::time::Time;
use crate::tomo::{
    Link, Reconstruction, WeightRows, npy_bytes, runs_along_a_side, side_tolerance_m,
};

/// All files that a run may leave behind.
pub(super) const FAMILY: FileFamily = FileFamily {
    names: FAMILY_NAMES,
    mark: Some(("summary.json", "\"made_from\": ")),
    has_folders: true,
};
const FAMILY_NAMES: &[&str] = &[
    "links.csv",
    "empty.csv",
    "samples.csv",
    "empty-samples.csv",
    "image.npy",
    "structure.npy",
    "image.png",
    "structure.png",
    "coverage.png",
    "links.png",
    "residuals.png",
    "deviation.png",
    "map.png",
    "track-1.waypoints",
    "track-2.waypoints",
    "track-3.waypoints",
    "track-4.waypoints",
    "track-5.waypoints",
    "track-6.waypoints",
    "track-7.waypoints",
    "track-8.waypoints",
    "run.log",
    "summary.json",
];

/// How much of what can be seen the map has found.
#[derive(Clone, Copy, Debug)]
struct SurfaceCoverage {
    found: usize,
    of: usize,
    /// The narrowest gap that a vehicle takes for sure, metres: what lies behind narrower ones is not asked of it.
    gap_m: f64,
}

impl SurfaceCoverage {
    fn in_words(self) -> String {
        let SurfaceCoverage { found, of, gap_m } = self;
        let percent = 100.0 * found as f64 / of as f64;
        format!(
            "seen              {percent:.1} % of the surfaces that can be seen from where a vehicle gets to for sure, through gaps of \
             {gap_m:.2} m and more: {found} of {of} cells\n"
        )
    }
}

/// The figures of a run.
#[derive(Debug)]
pub(super) struct RunFigures {
    seed: u64,
    made_from: Vec<SourceFile>,
    scene: String,
    vehicles: usize,
    finished: bool,
    failure: Option<String>,
    simulated_s: f64,
    wall_s: f64,
    samples: u64,
    links: usize,
    empty_links: usize,
    coverage: f64,
    collisions: usize,
    fence_breaches: usize,
    /// Contacts and breaches in words, as far as they are known one by one.
    mishaps: Vec<String>,
    min_separation_m: Option<f64>,
    scans: u64,
    events: u64,
    messages: u64,
    bus_bytes_by_kind: BytesByKind,
    bus_bytes_per_vehicle_s: f64,
    search: PersonSearch,
    /// Which solver was chosen for which image, where one was chosen.
    solvers: Vec<(&'static str, String)>,
    silences: Vec<Silence>,
    /// How the mission of each vehicle ended; empty for a sweep.
    missions: Vec<EndedMission>,
    /// How many of them were done.
    missions_done: usize,
    /// How each ended, in words.
    ends: Vec<String>,
    /// Of the cells of surfaces that can be seen, how many the map has found; `None` for a sweep.
    seen: Option<SurfaceCoverage>,
    /// Images that could not be made, with the reason.
    not_made: Vec<String>,
}

/// Returns which solver was chosen for the last images of a run.
fn solvers(outcome: &RunOutcome) -> Vec<(&'static str, String)> {
    let images = [
        ("change", &outcome.change),
        ("structure", &outcome.structure),
    ];
    let choice =
        |image: &Option<Reconstruction>| image.as_ref()?.choice.as_ref().map(|of| of.best.words());
    let chosen = images
        .into_iter()
        .filter_map(|(of, image)| Some((of, choice(image)?)));
    chosen.collect()
}

impl RunFigures {
    /// Gathers the figures of an outcome.
    ///
    /// # Errors
    /// The scene cannot be built.
    pub(super) fn new(
        scenario: &Scenario,
        outcome: &RunOutcome,
        seed: u64,
        wall: Duration,
    ) -> Result<RunFigures, ScenarioError> {
        Ok(RunFigures {
            seed,
            made_from: scenario.made_from.clone(),
            scene: scenario.sim().scene.name.clone(),
            vehicles: scenario.sim().vehicles.count,
            finished: outcome.finished,
            failure: failure(scenario, outcome),
            simulated_s: outcome.simulated.as_secs_f64(),
            wall_s: wall.as_secs_f64(),
            samples: outcome.samples,
            links: outcome.links.len(),
            empty_links: outcome.empty_links.len(),
            coverage: coverage(scenario, &outcome.links),
            collisions: outcome.collisions.len(),
            fence_breaches: outcome.fence_breaches,
            mishaps: mishaps(outcome),
            min_separation_m: outcome.min_separation_m,
            scans: outcome.counts.scans,
            events: outcome.counts.events,
            messages: outcome.counts.messages,
            bus_bytes_by_kind: outcome.bus_bytes_by_kind(),
            bus_bytes_per_vehicle_s: outcome.bus_bytes_per_vehicle_s(),
            search: PersonSearch::of(scenario, outcome),
            solvers: solvers(outcome),
            silences: outcome.silences.clone(),
            missions: outcome.missions.clone(),
            missions_done: missions_done(scenario, outcome),
            ends: ends(outcome),
            seen: seen(scenario, outcome)?,
            not_made: not_made(scenario, outcome),
        })
    }

    fn speed_factor(&self) -> f64 {
        self.simulated_s / self.wall_s.max(1e-9)
    }

    /// Returns the summary for a person.
    pub(super) fn text(&self) -> String {
        format!("{}{}", self.figures(), self.finds())
    }

    /// Returns the figures in lines.
    fn figures(&self) -> String {
        let separation = self
            .min_separation_m
            .map_or("-".to_owned(), |metres| format!("{metres:.2} m"));
        let outcome = match (&self.failure, self.finished) {
            (None, _) => "finished".to_owned(),
            (Some(why), true) => format!("FAILED: {why}"),
            (Some(why), false) => format!("NOT finished: {why}"),
        };
        // Those of a live swarm are not counted.
        let events = match self.events {
            0 => String::new(),
            count => format!(", {:.0} events/s", count as f64 / self.wall_s.max(1e-9)),
        };
        format!(
            "{} with {}, seed {}: {outcome}\n\
             mission time      {:.1} min simulated in {:.2} s ({:.0} x real time)\n\
             {}\
             collisions        {}; fence breaches {}; minimum separation {separation}\n\
             work              {:.0} scans/s{events} of wall time; {:.1} kB/s sent per vehicle\n",
            self.scene,
            counted(self.vehicles, "vehicle"),
            self.seed,
            self.simulated_s / 60.0,
            self.wall_s,
            self.speed_factor(),
            self.measured(),
            self.collisions,
            self.fence_breaches,
            self.scans as f64 / self.wall_s.max(1e-9),
            self.bus_bytes_per_vehicle_s / 1e3,
        )
    }

    /// Returns what was measured, or how every mission ended, in lines.
    fn measured(&self) -> String {
        if self.missions.is_empty() {
            return format!(
                "links measured    {} from {} samples ({} in the empty sweep), covering {:.0} % of the area\n",
                self.links,
                self.samples,
                self.empty_links,
                100.0 * self.coverage
            );
        }
        let line = |((vehicle, _), how): (&EndedMission, &String)| {
            format!("mission           vehicle {vehicle} {how}\n")
        };
        let done = self.missions_done;
        let of = self.missions.len();
        let lines: String = self.missions.iter().zip(&self.ends).map(line).collect();
        let lines = format!("missions done     {done} of {of}\n{lines}");
        let seen = self.seen.filter(|seen| seen.of > 0);
        let seen = seen.map_or(String::new(), SurfaceCoverage::in_words);
        lines + &seen
    }

    /// Returns what was found and what was not in lines.
    fn finds(&self) -> String {
        let mut text = String::new();
        for mishap in &self.mishaps {
            text += &format!("mishap            {mishap}\n");
        }
        let silences: String = self.silences.iter().map(silence_in_words).collect();
        text += &silences;
        text += &self.search.finds_in_words();
        if !self.solvers.is_empty() {
            let said = self
                .solvers
                .iter()
                .map(|(of, solver)| format!("{solver} ({of})"));
            text += &format!(
                "images by         {}\n",
                said.collect::<Vec<_>>().join(", ")
            );
        }
        for what in &self.not_made {
            text += &format!("not made          {what}\n");
        }
        text + &self.search.missed_in_words()
    }

    /// Writes the figures for a program as `summary.json`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn write(&self, folder: &mut OutputFolder) -> Result<(), CliError> {
        folder.write("summary.json", format!("{:#}\n", self.json()).as_bytes())
    }

    /// Returns the figures for a program.
    pub(super) fn json(&self) -> Value {
        let silence = |silence: &Silence| {
            let Silence { run, from, until } = silence;
            json!({ "run": run.0, "from_s": from.as_secs_f64(), "until_s": until.as_secs_f64() })
        };
        let mission = |((vehicle, end), how): (&EndedMission, &String)| {
            let at_s = end.as_ref().map(|(at, _)| at.as_secs_f64());
            json!({ "vehicle": vehicle.0, "ended_s": at_s, "how": how })
        };
        json!({
            "scene": self.scene,
            "seed": self.seed,
            "vehicles": self.vehicles,
            "finished": self.failure.is_none(),
            "failure": self.failure,
            "simulated_s": self.simulated_s,
            "wall_s": self.wall_s,
            "speed_factor": self.speed_factor(),
            "samples": self.samples,
            "links": self.links,
            "empty_links": self.empty_links,
            "coverage": self.coverage,
            "collisions": self.collisions,
            "fence_breaches": self.fence_breaches,
            "mishaps": self.mishaps,
            "min_separation_m": self.min_separation_m,
            "scans": self.scans,
            "events": (self.events > 0).then_some(self.events),
            "messages": self.messages,
            "bus_bytes": self.bus_bytes_by_kind.values().sum::<u64>(),
            "bus_bytes_by_kind": self.bus_bytes_by_kind,
            "bus_bytes_per_vehicle_s": self.bus_bytes_per_vehicle_s,
            "found": self.search.found_json(),
            "find_limit": self.search.limit_json(),
            "solvers": self.solvers.iter().map(|(of, solver)| (of.to_string(), json!(solver))).collect::<serde_json::Map<_, _>>(),
            "not_searched": self.search.why_not_json(),
            "persons": self.search.persons_json(),
            "visible_cells": self.seen.map(|seen| seen.of),
            "detected_cells": self.seen.map(|seen| seen.found),
            "narrowest_gap_m": self.seen.map(|seen| seen.gap_m),
            "silences": self.silences.iter().map(silence).collect::<Vec<_>>(),
            "missions": self.missions.iter().zip(&self.ends).map(mission).collect::<Vec<_>>(),
            "version": env!("CARGO_PKG_VERSION"),
            "made_from": self.made_from,
        })
    }
}

/// Returns why a run failed: it did not end, a contract was broken on the way, no vehicle did what it was asked, or nothing can
/// be imaged of what they measured. `None` when all is well.
pub(super) fn failure(scenario: &Scenario, outcome: &RunOutcome) -> Option<String> {
    why_failed(
        ended_badly(scenario, outcome).as_deref(),
        outcome.collisions.len(),
        outcome.fence_breaches,
    )
}

/// Returns whether a run ended as its file expects, and something was done or seen, whatever went wrong on the way.
pub(super) fn has_ended_well(scenario: &Scenario, outcome: &RunOutcome) -> bool {
    ended_badly(scenario, outcome).is_none()
}

/// Returns why a run did not end as it should.
fn ended_badly(scenario: &Scenario, outcome: &RunOutcome) -> Option<String> {
    let undone = || {
        if scenario.sim().expect != Expect::Finished {
            return None;
        }
        if scenario.sim().is_planned_by_ground() {
            let is_nothing_shown = outcome.change.is_none() && outcome.structure.is_none();
            return is_nothing_shown.then(|| {
                let why = why_not_made(outcome, Subject::Structure);
                format!("the sweep shows nothing: {why}")
            });
        }
        let is_done = outcome.missions.is_empty() || missions_done(scenario, outcome) > 0;
        (!is_done).then(|| "no vehicle did its mission".to_owned())
    };
    outcome.failure.clone().or_else(undone)
}

fn why_failed(failure: Option<&str>, collisions: usize, fence_breaches: usize) -> Option<String> {
    let counted = |count: usize, what: &str| (count > 0).then(|| format!("{what}: {count}"));
    let reasons: Vec<String> = [
        failure.map(str::to_owned),
        counted(collisions, "collisions"),
        counted(fence_breaches, "fence breaches"),
    ]
    .into_iter()
    .flatten()
    .collect();
    (!reasons.is_empty()).then(|| reasons.join("; "))
}

/// Returns how many missions were done to the end; of one that nothing else is to end that is a low battery.
fn missions_done(scenario: &Scenario, outcome: &RunOutcome) -> usize {
    let has_battery_end = scenario.sim().is_ended_by_battery();
    let is_done = |(_, end): &&EndedMission| match end {
        Some((_, EndReason::Done)) => true,
        Some((_, EndReason::BatteryLow)) => has_battery_end,
        Some(_) | None => false,
    };
    outcome.missions.iter().filter(is_done).count()
}

/// Returns that a sweep has heard nothing for long, in a line.
fn silence_in_words(silence: &Silence) -> String {
    let Silence { run, from, until } = silence;
    let sweep = match *run == EMPTY_RUN {
        true => "empty sweep",
        false => "sweep",
    };
    format!(
        "warning           the ground station has no beacon that a vehicle heard of another from {:.0} to {:.0} s, {:.1} min of the {sweep}\n",
        from.as_secs_f64(),
        until.as_secs_f64(),
        until.since(*from).as_secs_f64() / 60.0
    )
}

/// The most mishaps that a summary names one by one.
const MISHAPS: usize = 10;

/// Returns the first contacts and breaches of the fence in words.
fn mishaps(outcome: &RunOutcome) -> Vec<String> {
    let contacts = outcome.collisions.iter().map(|contact| contact.in_words());
    let breaches = outcome
        .breaches
        .iter()
        .map(|breach| format!("breach of the fence by {}", breach.in_words()));
    contacts.chain(breaches).take(MISHAPS).collect()
}

/// Returns how much of what can be seen vehicles have found that are not out for a sweep.
fn seen(
    scenario: &Scenario,
    outcome: &RunOutcome,
) -> Result<Option<SurfaceCoverage>, ScenarioError> {
    if scenario.sim().is_planned_by_ground() {
        return Ok(None);
    }
    let seen = VisibleScene::find(scenario)?;
    Ok(Some(SurfaceCoverage {
        found: seen.detected(outcome),
        of: seen.visible.cells.len(),
        gap_m: narrowest_gap_m(scenario.sim()),
    }))
}

/// Returns which images there are none of, and why.
fn not_made(scenario: &Scenario, outcome: &RunOutcome) -> Vec<String> {
    let mut list = Vec::new();
    if !scenario.sim().is_planned_by_ground() {
        return list;
    }
    if outcome.change.is_none() {
        let why = match scenario.sim().empty_sweep {
            true => why_not_made(outcome, Subject::Change),
            false => "what has changed is told only by an empty sweep (empty_sweep = true)",
        };
        list.push(format!("image: {why}"));
    }
    if outcome.structure.is_none() {
        let why = why_not_made(outcome, Subject::Structure);
        list.push(format!("structure: {why}"));
    }
    list
}

/// Returns why there is no image of a subject.
pub(super) fn why_not_made(outcome: &RunOutcome, subject: Subject) -> &str {
    let mut tried = outcome.not_made.iter();
    let reason = tried.find(|(of, _)| *of == subject);
    // Of a live run the ground station knows why.
    reason.map_or("the ground station has made none", |(_, why)| why)
}

/// Returns the share of the pixels that at least one link across the area looks at.
fn coverage(scenario: &Scenario, links: &[Link]) -> f64 {
    let settings = scenario.image(Subject::Structure);
    let tolerance_m = side_tolerance_m(links.iter(), settings.ring, settings.side_tolerance_m);
    let across = links.iter().filter(|link| {
        link.length_m() >= settings.shortest_link_m
            && !runs_along_a_side(link, settings.ring, tolerance_m)
    });
    let rows = WeightRows::rescaled(across.map(Link::segment), &settings.grid, settings.weights);
    let mut seen = vec![0.0; settings.grid.len()];
    rows.backward(&vec![1.0; rows.len()], &mut seen);
    seen.iter().filter(|weight| **weight > 0.0).count() as f64 / seen.len().max(1) as f64
}

/// Writes links, images as numbers, and the log.
///
/// # Errors
/// A file cannot be written.
pub(super) fn write_data(
    folder: &mut OutputFolder,
    scenario: &Scenario,
    outcome: &RunOutcome,
) -> Result<(), CliError> {
    let sim = scenario.sim();
    let imaging = LinksFile {
        area: sim.venue.area,
        as_measured: false,
        channel: None,
        reception: sim.radio.reception,
        imaging: sim.imaging,
    };
    let of_links = LinksFile {
        channel: Some(sim.venue.swarm.channel()),
        ..imaging.clone()
    };
    // A comment within the comments that are TOML.
    let about = format!("# # {}\n", about(&scenario.made_from));
    let links = |links| with_origin(links_csv(links, Some(&of_links)), &about);
    folder.write("links.csv", links(&outcome.links).as_bytes())?;
    if sim.empty_sweep {
        folder.write("empty.csv", links(&outcome.empty_links).as_bytes())?;
    }
    if let Some(measured) = &outcome.measured {
        let of_run = |run| {
            let samples = measured.iter().filter(move |sample| sample.run == run);
            with_origin(samples_csv(samples, &imaging), &about)
        };
        folder.write("samples.csv", of_run(RUN).as_bytes())?;
        if sim.empty_sweep {
            folder.write("empty-samples.csv", of_run(EMPTY_RUN).as_bytes())?;
        }
    }
    let images = [
        ("image", &outcome.change),
        ("structure", &outcome.structure),
    ];
    for (name, made) in images
        .iter()
        .filter_map(|(name, made)| made.as_ref().map(|made| (name, made)))
    {
        folder.write(&format!("{name}.npy"), &npy_bytes(&made.image))?;
    }
    write_tracks(folder, scenario.sim(), &outcome.tracks)?;
    folder.write("run.log", outcome.log.as_bytes())
}

/// Returns a file with what it was made from below the comments that it begins with.
fn with_origin(text: String, about: &str) -> String {
    let comments: usize = text
        .split_inclusive('\n')
        .take_while(|line| line.starts_with('#'))
        .map(str::len)
        .sum();
    let (head, rest) = text.split_at(comments);
    format!("{head}{about}{rest}")
}

/// Returns how each mission ended, with all that became of its places.
fn ends(outcome: &RunOutcome) -> Vec<String> {
    let words = |(vehicle, end): &EndedMission| {
        let own = outcome
            .places
            .iter()
            .filter(|place| place.vehicle == *vehicle);
        let fates: Vec<PlaceFate> = own.map(|place| place.fate).collect();
        ended(end.as_ref(), &fates)
    };
    outcome.missions.iter().map(words).collect()
}

/// Returns how a mission ended; `fates`: what became of its places, as far as that is known.
fn ended(end: Option<&(Time, EndReason)>, fates: &[PlaceFate]) -> String {
    let Some((at, end)) = end else {
        return "did not end".to_owned();
    };
    let minutes = at.as_secs_f64() / 60.0;
    let count = |wanted: PlaceFate| fates.iter().filter(|fate| **fate == wanted).count();
    let (given_up, no_way) = (count(PlaceFate::GivenUp), count(PlaceFate::NoWay));
    // The reason names what counts more, and only that.
    match end {
        EndReason::GaveUp(_) if given_up > 0 && no_way > 0 => format!(
            "gave up {given_up} of its {} places, and found that no way leads to {no_way}, after {minutes:.1} min",
            fates.len()
        ),
        _ => format!("{end} after {minutes:.1} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_collision_or_a_breach_fails_a_mission_that_ended() {
        let check = |failure, collisions, breaches, expected: Option<&str>| {
            assert_eq!(
                why_failed(failure, collisions, breaches).as_deref(),
                expected
            );
        };
        check(None, 0, 0, None);
        check(None, 2, 0, Some("collisions: 2"));
        check(None, 0, 1, Some("fence breaches: 1"));
        check(
            Some("time is up"),
            1,
            3,
            Some("time is up; collisions: 1; fence breaches: 3"),
        );
        check(Some("time is up"), 0, 0, Some("time is up"));
    }

    #[test]
    fn a_mission_without_places_does_not_give_up_some_of_them() {
        let output = |end: EndReason| ended(Some(&(Time::from_secs_f64(90.0), end)), &[]);
        assert_eq!(
            output(EndReason::NoRoom),
            "gave up (its peers never made room) after 1.5 min"
        );
        assert_eq!(
            output(EndReason::TooLarge),
            "gave up (its ground is too large to be searched) after 1.5 min"
        );
        assert_eq!(
            output(EndReason::GaveUp(2)),
            "gave up 2 of its places after 1.5 min"
        );
    }

    #[test]
    fn a_mission_that_ended_names_all_that_became_of_its_places() {
        use PlaceFate::{GivenUp, NoWay, Visited};
        let check = |end: EndReason, fates: &[PlaceFate], expected: &str| {
            let words = ended(Some(&(Time::from_secs_f64(90.0), end)), fates);
            assert_eq!(words, format!("{expected} after 1.5 min"));
        };
        check(
            EndReason::GaveUp(1),
            &[GivenUp, NoWay, Visited],
            "gave up 1 of its 3 places, and found that no way leads to 1,",
        );
        check(
            EndReason::GaveUp(2),
            &[GivenUp, GivenUp],
            "gave up 2 of its places",
        );
        check(
            EndReason::NoWay(1),
            &[NoWay, Visited],
            "found that no way leads to 1 of its places",
        );
    }

    #[test]
    fn what_is_seen_says_through_which_gaps() {
        let seen = SurfaceCoverage {
            found: 106,
            of: 106,
            gap_m: 1.2,
        };
        assert_eq!(
            seen.in_words(),
            "seen              100.0 % of the surfaces that can be seen from where a vehicle gets to for sure, through gaps of \
             1.20 m and more: 106 of 106 cells\n"
        );
    }
}
