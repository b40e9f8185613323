//! The table of an experiment: a line for every group of runs, and below it why some failed.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::row::{ENDS, RowEnd, RunRow, share};
use crate::config::{Axis, Experiment};

/// Reasons that are shown of a group.
const REASONS_SHOWN: usize = 3;

const HEAD: [&str; 21] = [
    "runs",
    "finished",
    "ends",
    "collided",
    "time/s",
    "mission/s",
    "cells",
    "seen/%",
    "least",
    "route/%",
    "least",
    "places",
    "visited/%",
    "false",
    "path/m",
    "clear/m",
    "fence",
    "found",
    "nobody",
    "off/m",
    "unsought",
];

const LEGEND: &str = "\
finished: runs that have not failed, as `sim` says it: not stopped by a limit, with something done, no collision and no
breach of the fence. ends: how missions ended, of each run the vehicle with the worst end. mission: when the last one ended, before the way
home. time, mission, cells, seen, route, path: means over the runs of a line. cells: occupied in the map at the end, which is
what the ground station and all vehicles whose software runs know together, whoever is off the bus. seen: share of the
surface visible from where a vehicle can get to that is occupied in the map, within one cell; route: the same of what was in
range along the driven tracks. places: places to visit that a vehicle can get to by the truth of the scene, of all runs
together; visited: share of them that was visited; false: how many of them were called places to which
no way leads. clear: least distance between a body and an object, persons who walk or enter later not among these. collided,
fence: runs with a contact, with a command over the fence. found: persons found within 1 m, each by a find of its own, of
all who were searched for in the change since an empty sweep; nobody: finds that are none of them; off: how far off the
places of those found are, the mean over runs of the root mean square; unsought: persons who were to be searched for in a sweep that was given up before that.
";

/// Returns the table of some runs in grid order, grouped by axes.
pub(super) fn text(experiment: &Experiment, rows: &[RunRow], by: &[Axis]) -> String {
    let groups = grouped(experiment, rows, by);
    let head: Vec<String> = by
        .iter()
        .map(|axis| axis.word())
        .chain(HEAD)
        .map(str::to_owned)
        .collect();
    let lines: Vec<Vec<String>> = groups
        .iter()
        .map(|(names, rows)| line(names, rows))
        .collect();
    let mut text = aligned(std::iter::once(&head).chain(&lines), by.len());
    text += LEGEND;
    for (names, rows) in &groups {
        for (why, count) in reasons(rows) {
            // Writing into a string cannot fail.
            let _ = writeln!(text, "{}: {count} × {why}", names.join(" "));
        }
    }
    let _ = writeln!(
        text,
        "{} of {} runs of {}",
        rows.len(),
        experiment.runs(),
        experiment.name()
    );
    text
}

/// Sorts runs into groups, in the order in which they come in the grid.
fn grouped<'a>(
    experiment: &Experiment,
    rows: &'a [RunRow],
    by: &[Axis],
) -> Vec<(Vec<String>, Vec<&'a RunRow>)> {
    let mut groups: BTreeMap<Vec<usize>, (Vec<String>, Vec<&RunRow>)> = BTreeMap::new();
    for row in rows {
        let names: Vec<String> = by
            .iter()
            .map(|axis| experiment.name_of(row.run, *axis).to_owned())
            .collect();
        let place = |(axis, name): (&Axis, &String)| {
            experiment
                .names(*axis)
                .iter()
                .position(|known| known == name)
        };
        let order = by
            .iter()
            .zip(&names)
            .map(|pair| place(pair).unwrap_or(usize::MAX))
            .collect();
        groups
            .entry(order)
            .or_insert_with(|| (names, Vec::new()))
            .1
            .push(row);
    }
    groups.into_values().collect()
}

fn line(names: &[String], rows: &[&RunRow]) -> Vec<String> {
    let count = |is: fn(&RunRow) -> bool| rows.iter().filter(|row| is(row)).count().to_string();
    let figures: Vec<&RunRow> = rows
        .iter()
        .copied()
        .filter(|row| has_figures(row))
        .collect();
    let all = |value: fn(&RunRow) -> Option<f64>| figures.iter().filter_map(move |row| value(row));
    let mean =
        |value: fn(&RunRow) -> Option<f64>, digits: usize| shown(mean_of(all(value)), digits);
    let least = |value: fn(&RunRow) -> Option<f64>, digits: usize| {
        shown(all(value).min_by(f64::total_cmp), digits)
    };
    let seen = |row: &RunRow| row.share().map(|share| 100.0 * share);
    let route = |row: &RunRow| row.route_share().map(|share| 100.0 * share);
    let sum = |value: fn(&RunRow) -> usize| figures.iter().map(|row| value(row)).sum::<usize>();
    let places = sum(|row| row.places_reachable);
    // Missions without places have no such figures.
    let of_places = |value: String| if places > 0 { value } else { "-".to_owned() };
    let (persons, nobodies) = (sum(|row| row.persons), sum(|row| row.false_finds));
    let unsearched = sum(|row| row.persons_unsearched);
    let of_finds = |value: String| match persons + nobodies + unsearched {
        0 => "-".to_owned(),
        _ => value,
    };
    let visited = share(sum(|row| row.places_visited), places).map(|share| 100.0 * share);
    let rest = [
        rows.len().to_string(),
        count(|row| row.end == RowEnd::Finished),
        ends(rows),
        count(|row| row.collisions > 0),
        mean(|row| Some(row.simulated_s), 0),
        mean(|row| row.mission_s, 0),
        mean(|row| Some(row.occupied_cells as f64), 1),
        mean(seen, 1),
        least(seen, 1),
        mean(route, 1),
        least(route, 1),
        of_places(places.to_string()),
        shown(visited, 1),
        of_places(sum(|row| row.false_no_way).to_string()),
        mean(|row| Some(row.path_m), 1),
        least(|row| row.clearance_m, 2),
        count(|row| row.fence_breaches > 0),
        of_finds(format!("{}/{persons}", sum(|row| row.persons_found))),
        of_finds(nobodies.to_string()),
        mean(|row| row.find_error_m, 2),
        of_finds(unsearched.to_string()),
    ];
    names.iter().cloned().chain(rest).collect()
}

/// Counts how missions ended, best first: "4 done + 1 no way".
fn ends(rows: &[&RunRow]) -> String {
    let count = |word: &str| rows.iter().filter(|row| row.mission == word).count();
    let counted = ENDS
        .iter()
        .map(|word| (count(word), word))
        .filter(|(count, _)| *count > 0);
    let words: Vec<String> = counted
        .map(|(count, word)| format!("{count} {word}"))
        .collect();
    if words.is_empty() {
        "-".to_owned()
    } else {
        words.join(" + ")
    }
}

fn has_figures(row: &RunRow) -> bool {
    match row.end {
        RowEnd::Finished | RowEnd::Failed => true,
        RowEnd::Refused | RowEnd::Fault => false,
    }
}

fn mean_of(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), value| {
        (sum + value, count + 1)
    });
    (count > 0).then(|| sum / count as f64)
}

fn shown(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

/// Counts why runs failed, the most frequent reasons first.
fn reasons<'a>(rows: &[&'a RunRow]) -> Vec<(&'a str, usize)> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for row in rows.iter().filter(|row| !row.why.is_empty()) {
        *counts.entry(&row.why).or_default() += 1;
    }
    let mut list: Vec<(&str, usize)> = counts.into_iter().collect();
    list.sort_by(|one, other| other.1.cmp(&one.1).then(one.0.cmp(other.0)));
    list.truncate(REASONS_SHOWN);
    list
}

/// Puts cells below each other: the first `words` columns to the left, numbers to the right.
fn aligned<'a>(lines: impl Iterator<Item = &'a Vec<String>>, words: usize) -> String {
    let lines: Vec<&Vec<String>> = lines.collect();
    let columns = lines.first().map_or(0, |line| line.len());
    let longest = |column: usize| {
        lines
            .iter()
            .map(|line| line[column].chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(longest).collect();
    let cell = |(column, (text, width)): (usize, (&String, &usize))| {
        if column < words {
            format!("{text:<width$}")
        } else {
            format!("{text:>width$}")
        }
    };
    let put = |line: &&Vec<String>| {
        line.iter()
            .zip(&widths)
            .enumerate()
            .map(cell)
            .collect::<Vec<_>>()
            .join("  ")
            + "\n"
    };
    lines.iter().map(put).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::read_experiment;

    const GRID: &str = "kind = \"experiment\"\nname = \"trial\"\nsim = \"a.sim.toml\"\nseeds = 2\n\
        [[mission]]\nname = \"zoo\"\nkind = \"search\"\n[[mission]]\nname = \"ant\"\nkind = \"square\"\n";

    fn row(run: usize, simulated_s: f64, why: &str) -> RunRow {
        let end = if why.is_empty() {
            RowEnd::Finished
        } else {
            RowEnd::Failed
        };
        let mut row = RunRow::without_figures(run, end, why.to_owned());
        (row.simulated_s, row.visible_cells, row.detected_cells) = (simulated_s, 10, 5 + run);
        row
    }

    #[test]
    fn groups_come_in_grid_order_with_their_means_and_reasons() {
        let experiment = read_experiment("e.toml", GRID).unwrap();
        let rows = [
            row(0, 10.0, ""),
            row(1, 30.0, "stuck"),
            row(2, 5.0, ""),
            row(3, 5.0, ""),
        ];
        let text = text(&experiment, &rows, &[Axis::Mission]);
        let lines: Vec<Vec<&str>> = text
            .lines()
            .map(|line| line.split_whitespace().collect())
            .collect();
        assert_eq!(lines[0][..4], ["mission", "runs", "finished", "ends"]);
        assert_eq!(
            lines[1],
            [
                "zoo", "2", "1", "-", "0", "20", "-", "0.0", "55.0", "50.0", "-", "-", "-", "-",
                "-", "0.0", "-", "0", "-", "-", "-", "-"
            ]
        );
        assert_eq!(lines[2][..7], ["ant", "2", "2", "-", "0", "5", "-"]);
        assert!(
            text.contains("zoo: 1 × stuck\n") && text.ends_with("4 of 4 runs of trial\n"),
            "{text}"
        );
    }

    #[test]
    fn runs_that_came_to_nothing_have_no_part_in_the_means() {
        let experiment = read_experiment("e.toml", GRID).unwrap();
        let rows = [
            row(0, 10.0, ""),
            RunRow::without_figures(1, RowEnd::Refused, "no room".to_owned()),
        ];
        let text = text(&experiment, &rows, &[Axis::Mission, Axis::Seed]);
        let whole = self::text(&experiment, &rows, &[Axis::Mission]);
        assert!(whole.lines().nth(1).unwrap().contains(" 10 "), "{whole}");
        assert_eq!(text.lines().take(3).count(), 3);
        assert!(text.contains("zoo 2: 1 × no room"), "{text}");
    }

    #[test]
    fn persons_are_summed_over_the_runs_of_a_line() {
        let experiment = read_experiment("e.toml", GRID).unwrap();
        let with_persons = |run: usize, found: usize, nobodies: usize, off_m: Option<f64>| RunRow {
            persons: 2,
            persons_found: found,
            false_finds: nobodies,
            find_error_m: off_m,
            ..row(run, 10.0, "")
        };
        let unsearched = RunRow {
            persons_unsearched: 2,
            ..row(3, 10.0, "time is up")
        };
        let rows = [
            with_persons(0, 2, 0, Some(0.1)),
            with_persons(1, 0, 3, None),
            with_persons(2, 1, 0, Some(0.3)),
            unsearched,
        ];
        let text = text(&experiment, &rows, &[Axis::Mission]);
        let ends = |line: usize| -> Vec<&str> {
            let words: Vec<&str> = text.lines().nth(line).unwrap().split_whitespace().collect();
            words[words.len() - 4..].to_vec()
        };
        assert_eq!(ends(1), ["2/4", "3", "0.10", "0"]);
        assert_eq!(ends(2), ["1/2", "0", "0.30", "2"]);
    }

    #[test]
    fn places_are_summed_over_the_runs_of_a_line() {
        let experiment = read_experiment("e.toml", GRID).unwrap();
        let with_places =
            |run: usize, reachable: usize, visited: usize, false_no_way: usize| RunRow {
                places_reachable: reachable,
                places_visited: visited,
                false_no_way,
                ..row(run, 10.0, "")
            };
        let rows = [
            with_places(0, 5, 5, 0),
            with_places(1, 3, 1, 2),
            with_places(2, 1, 1, 0),
            // All that there is cannot be got to.
            row(3, 10.0, ""),
        ];
        let text = text(&experiment, &rows, &[Axis::Mission, Axis::Seed]);
        let figures = |text: &str, line: usize| -> Vec<String> {
            let words = |line: &str| -> Vec<String> {
                line.split_whitespace().map(str::to_owned).collect()
            };
            let (head, line) = (
                words(text.lines().next().unwrap()),
                words(text.lines().nth(line).unwrap()),
            );
            let column = |name: &str| head.iter().position(|known| known == name).unwrap();
            ["places", "visited/%", "false"]
                .map(|name| line[column(name)].clone())
                .into()
        };
        assert_eq!(figures(&text, 2), ["3", "33.3", "2"]);
        assert_eq!(figures(&text, 4), ["-", "-", "-"]);
        let whole = self::text(&experiment, &rows, &[Axis::Mission]);
        assert_eq!(figures(&whole, 1), ["8", "75.0", "2"]);
        assert_eq!(figures(&whole, 2), ["1", "100.0", "0"]);
    }
}
