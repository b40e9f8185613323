//! Where `tomoswarm image` finds a recording: in a file, in the folder of a run, or as a run of a ground station's store.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::error::CliError;
#[cfg(feature = "net")]
use super::imaging_comments::comments;
use super::read;
#[cfg(feature = "net")]
use super::samples_csv::sample_line;
use super::standard_output::complain;
#[cfg(feature = "net")]
use super::stored_run;
#[cfg(feature = "net")]
use crate::store::ground::GroundStore;
#[cfg(feature = "net")]
use crate::tomo::SAMPLES_HEADER;

/// The sweep of a run in its folder, and the empty one.
const SWEEP: &str = "links.csv";
const EMPTY: &str = "empty.csv";
/// The same, each beacon a line.
const SAMPLES: &str = "samples.csv";
const EMPTY_SAMPLES: &str = "empty-samples.csv";
/// The bytes with which a file of SQLite begins.
const DATABASE: &[u8; 16] = b"SQLite format 3\0";

/// Returns the recording of a sweep: the file itself, or that of a run's folder.
///
/// # Errors
/// A folder of something else.
pub(super) fn sweep_of(path: &Path) -> Result<PathBuf, CliError> {
    in_folder(path, SWEEP)
}

/// Returns the recording of an empty sweep: the file itself, the sweep of an earlier run in its folder, or the empty sweep
/// of the run that is imaged; of samples its samples, where it has any.
///
/// # Errors
/// A folder of something else, or of a run without an empty sweep.
pub(super) fn empty_of(path: &Path, imaged: &[PathBuf]) -> Result<PathBuf, CliError> {
    let real = |path: &Path| path.canonicalize().ok();
    let folder_of = |file: &PathBuf| match file.is_dir() {
        true => real(file),
        false => real(file).and_then(|file| file.parent().map(Path::to_owned)),
    };
    let is_same_run = path.is_dir() && imaged.iter().any(|file| folder_of(file) == real(path));
    let are_samples = |file: &PathBuf| file.file_name().is_some_and(|name| name == SAMPLES);
    if is_same_run && imaged.iter().all(are_samples) && path.join(EMPTY_SAMPLES).is_file() {
        return Ok(path.join(EMPTY_SAMPLES));
    }
    in_folder(path, if is_same_run { EMPTY } else { SWEEP })
}

fn in_folder(path: &Path, name: &str) -> Result<PathBuf, CliError> {
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    let file = path.join(name);
    if file.is_file() {
        return Ok(file);
    }
    Err(CliError::Input {
        path: path.to_owned(),
        reason: format!(
            "found a folder without {name}, expected a recording or the folder of a run"
        ),
    })
}

/// Returns the files that a recording is read from: the file itself, or of a run in a store the database with those that SQLite
/// has beside it.
pub(super) fn files_of(path: &Path) -> Vec<PathBuf> {
    #[cfg(feature = "net")]
    if let Some((store, _)) = stored(path) {
        let real = store.canonicalize().unwrap_or(store);
        let of = |ending: &str| {
            let mut name = real.clone().into_os_string();
            name.push(ending);
            PathBuf::from(name)
        };
        return Vec::from(["", "-wal", "-shm"].map(of));
    }
    vec![path.to_owned()]
}

/// Returns the text of a recording.
///
/// # Errors
/// It cannot be read, or is a whole store.
pub(super) fn text(path: &Path) -> Result<String, CliError> {
    let stored = stored(path);
    #[cfg(feature = "net")]
    if let Some((store, run)) = &stored {
        return samples_of(store, *run);
    }
    let named = stored.map_or_else(|| path.to_owned(), |(store, _)| store);
    if is_database(&named) {
        return Err(CliError::Input {
            reason: run_is_to_be_named(&named)?,
            path: named,
        });
    }
    let text = read::text(path)?;
    if is_cut_off(path, &text) {
        complain(&format!(
            "warning: {}: its last line has no end: the file may be cut off, and that line not be what was written",
            path.display()
        ));
    }
    Ok(text)
}

/// Returns whether a table ends within a line.
fn is_cut_off(path: &Path, text: &str) -> bool {
    let is_table = path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    is_table && !text.is_empty() && !text.ends_with(['\n', '\r'])
}

/// Returns whether a file begins as one of SQLite does.
fn is_database(path: &Path) -> bool {
    let mut begins = [0; DATABASE.len()];
    let is_read = path.is_file()
        && File::open(path).is_ok_and(|mut file| file.read_exact(&mut begins).is_ok());
    is_read && begins == *DATABASE
}

/// Says that one run of a store is to be named, and which there are.
///
/// # Errors
/// It is another database, or cannot be read.
#[cfg(feature = "net")]
fn run_is_to_be_named(path: &Path) -> Result<String, CliError> {
    let runs = GroundStore::open_to_read(path)?.runs()?;
    let example = runs
        .last()
        .map_or("N".to_owned(), |run| run.run.to_string());
    Ok(format!(
        "is the store of a ground station, which holds {}; name the run that is meant, such as {}:{example}",
        stored_run::listed(&runs),
        path.display()
    ))
}

/// Says that runs of a store are for other builds.
///
/// # Errors
/// None; builds with stores have some.
#[cfg(not(feature = "net"))]
fn run_is_to_be_named(_: &Path) -> Result<String, CliError> {
    Ok("is a database; runs of a store are read by the build that has stores".to_owned())
}

/// Returns store and run of a name such as `swarm.db:3`, when no file has this name.
fn stored(path: &Path) -> Option<(PathBuf, u32)> {
    let (store, run) = path.to_str()?.rsplit_once(':')?;
    let run = run.parse().ok()?;
    (!path.exists() && Path::new(store).is_file()).then(|| (PathBuf::from(store), run))
}

/// Returns the samples of a stored run as a recording, with how the ground station imaged it.
#[cfg(feature = "net")]
fn samples_of(path: &Path, run: u32) -> Result<String, CliError> {
    let store = GroundStore::open_to_read(path)?;
    let run = stored_run::run_of(path, &store.runs()?, run)?;
    let imaging = stored_run::imaging_of(&run, &store.provenance()?);
    if imaging.is_none() {
        complain(&format!(
            "warning: {}: this version cannot read the ground station's file in it: run {} is imaged as is usual for its links",
            path.display(),
            run.run
        ));
    }
    let mut text = comments(imaging.as_ref()) + SAMPLES_HEADER + "\n";
    store.each_sample(Some(run.run), |stored| sample_line(&mut text, &stored))?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use std::slice;

    use super::*;

    #[test]
    fn a_table_that_ends_within_a_line_is_cut_off_and_nothing_else_is() {
        let is_cut_off = |name: &str, text: &str| is_cut_off(Path::new(name), text);
        assert!(is_cut_off("links.csv", "a,b\n1,-8"));
        assert!(is_cut_off("LINKS.CSV", "a,b"));
        for whole in ["", "a,b\n", "a,b\r\n1,2\r\n", "a,b\r1,2\r"] {
            assert!(!is_cut_off("links.csv", whole), "{whole:?}");
        }
        assert!(!is_cut_off("links.json", "{}"), "it is refused by itself");
    }

    #[cfg(not(feature = "net"))]
    #[test]
    fn a_run_of_a_store_is_for_another_build_and_not_missing() {
        let root = tempfile::tempdir().unwrap();
        let store = root.path().join("swarm.db");
        let run = root.path().join("swarm.db:3");
        let said = |path: &Path| text(path).unwrap_err().to_string();
        assert!(said(&run).contains("No such file"), "{}", said(&run));
        std::fs::write(&store, [DATABASE.as_slice(), b"..."].concat()).unwrap();
        assert!(said(&run).contains("is a database"), "{}", said(&run));
    }

    #[cfg(feature = "net")]
    #[test]
    fn a_store_whose_run_is_imaged_is_not_written_over() {
        use clap::Parser;

        #[derive(Parser)]
        struct Program {
            #[command(flatten)]
            image: super::super::image::ImageCommand,
        }
        let root = tempfile::tempdir().unwrap();
        let named = |name: &str| root.path().join(name).display().to_string();
        std::fs::write(named("swarm.db"), "a database").unwrap();
        let (run, links) = (named("swarm.db:3"), named("links.csv"));
        for (option, name) in [
            ("--json", "swarm.db"),
            ("--npy", "swarm.db"),
            ("--png", "swarm.db-wal"),
            ("--coverage", "swarm.db-shm"),
        ] {
            let output = named(name);
            let (run, links, output) = (run.as_str(), links.as_str(), output.as_str());
            for inputs in [vec![run], vec![links, "--empty", run]] {
                let words = [vec!["image"], inputs, vec![option, output]].concat();
                let image = Program::parse_from(words).image;
                let said = image.run(&mut Vec::new()).unwrap_err().to_string();
                assert!(said.contains("is an input"), "{said}");
            }
        }
        let kept = std::fs::read_to_string(named("swarm.db")).unwrap();
        assert_eq!(kept, "a database");
        assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_is_the_sweep_of_its_run_and_of_the_imaged_run_the_empty_one() {
        let root = tempfile::tempdir().unwrap();
        let [one, two] = ["one", "two"].map(|name| root.path().join(name));
        for folder in [&one, &two] {
            std::fs::create_dir(folder).unwrap();
            std::fs::write(folder.join(SWEEP), "").unwrap();
        }
        std::fs::write(one.join(EMPTY), "").unwrap();
        assert_eq!(sweep_of(&one).unwrap(), one.join(SWEEP));
        for imaged in [one.clone(), one.join(SWEEP)] {
            assert_eq!(
                empty_of(&one, slice::from_ref(&imaged)).unwrap(),
                one.join(EMPTY)
            );
            assert_eq!(empty_of(&two, &[imaged]).unwrap(), two.join(SWEEP));
        }
        let samples = [one.join(SAMPLES)];
        std::fs::write(&samples[0], "").unwrap();
        assert_eq!(empty_of(&one, &samples).unwrap(), one.join(EMPTY));
        std::fs::write(one.join(EMPTY_SAMPLES), "").unwrap();
        assert_eq!(empty_of(&one, &samples).unwrap(), one.join(EMPTY_SAMPLES));
        let file = one.join("any.csv");
        assert_eq!(empty_of(&file, &[one]).unwrap(), file);
        let error = empty_of(&two, slice::from_ref(&two)).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("without empty.csv"), "{error}");
    }
}
