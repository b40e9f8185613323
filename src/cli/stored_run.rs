//! A run of a ground station's store, for the commands that read one: which runs there are, and how the ground station imaged
//! them. It opens no store and reads no sample.

use std::path::Path;

use tomoswarm_proto::RunId;

use super::error::CliError;
use crate::config::{self, Config, LinksFile};
use crate::store::ground::{Provenance, StoredRun};

/// Returns a run of those that a store holds; `path` is used in messages.
///
/// # Errors
/// It is not among them.
pub(super) fn run_of(path: &Path, runs: &[StoredRun], wanted: u32) -> Result<StoredRun, CliError> {
    let found = runs.iter().find(|run| run.run == RunId(wanted));
    found.copied().ok_or_else(|| CliError::Input {
        path: path.to_owned(),
        reason: format!("holds no run {wanted}; it holds {}", listed(runs)),
    })
}

/// Returns in words which runs a store holds.
pub(super) fn listed(runs: &[StoredRun]) -> String {
    let numbers: Vec<String> = runs.iter().map(|run| run.run.to_string()).collect();
    match numbers.as_slice() {
        [] => "no runs".to_owned(),
        [one] => format!("run {one}"),
        several => format!("runs {}", several.join(", ")),
    }
}

/// Returns how the ground station imaged a run: by its file at the last start before it closed the run, since it pools and
/// images anew what it has stored of an open one. `starts` are those of the store, the newest first. `None` = this version
/// cannot read that file.
pub(super) fn imaging_of(run: &StoredRun, starts: &[Provenance]) -> Option<LinksFile> {
    let is_in_time = |start: &&Provenance| {
        run.closed_utc_s
            .is_none_or(|closed_utc_s| start.started_utc_s <= closed_utc_s)
    };
    let start = starts.iter().find(is_in_time).or(starts.last())?;
    let mut venue = |_: &str| Ok(start.venue.clone());
    match config::read("the ground station's file", &start.config, &mut venue) {
        Ok(Config::Ground(file)) => Some(LinksFile {
            area: file.venue.area,
            as_measured: false,
            channel: None,
            reception: file.reception,
            imaging: file.imaging,
        }),
        Ok(
            Config::Venue(_)
            | Config::Scene(_)
            | Config::Sim(_)
            | Config::Experiment(_)
            | Config::Vehicle(_)
            | Config::Operator(_),
        )
        | Err(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = include_str!("../../configs/courtyard.ground.toml");

    fn start(started_utc_s: f64, config: &str) -> Provenance {
        Provenance {
            started_utc_s,
            version: String::new(),
            config: config.to_owned(),
            venue: include_str!("../../configs/courtyard.venue.toml").to_owned(),
            seed: None,
            note: None,
        }
    }

    fn run(run: u32, closed_utc_s: Option<f64>) -> StoredRun {
        StoredRun {
            run: RunId(run),
            empty: None,
            began_utc_s: 5.0,
            closed_utc_s,
        }
    }

    #[test]
    fn a_run_is_imaged_as_the_file_said_when_it_was_closed() {
        let with =
            |bin_m: &str| FILE.replace("[imaging]\n", &format!("[imaging]\nbin_m = {bin_m}\n"));
        let starts = [
            start(30.0, &with("0.75")),
            start(10.0, &with("1.25")),
            start(1.0, &with("2.0")),
        ];
        let bin_m = |closed_utc_s| {
            let file = imaging_of(&run(1, closed_utc_s), &starts).unwrap();
            assert_eq!(file.area.width_m(), 20.0);
            file.imaging.bin_m
        };
        let bins = [Some(0.5), Some(9.0), Some(20.0), Some(40.0), None].map(bin_m);
        assert_eq!(bins, [2.0, 2.0, 1.25, 0.75, 0.75]);
        assert_eq!(imaging_of(&run(1, None), &[]), None);
        assert_eq!(
            imaging_of(&run(1, None), &[start(1.0, "of another time")]),
            None
        );
    }

    #[test]
    fn a_run_that_is_not_there_is_refused_with_those_that_are() {
        let path = Path::new("swarm.db");
        let runs = [run(1, None), run(4, None)];
        assert_eq!(run_of(path, &runs, 4).unwrap(), runs[1]);
        for (count, expected) in [(0, "no runs"), (1, "run 1"), (2, "runs 1, 4")] {
            let refused = run_of(path, &runs[..count], 7).unwrap_err().to_string();
            let expected = format!("holds no run 7; it holds {expected}");
            assert!(refused.ends_with(&expected), "{refused}");
        }
    }
}
