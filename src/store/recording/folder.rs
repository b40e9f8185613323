//! The folder of a node's recording: `flight-000001.mcap`, `flight-000002.mcap` and so on, the oldest dropped when
//! all together are too large, or when the disk has less room than its reserve.

use std::fs;
use std::path::{Path, PathBuf};

use super::segment::WriteError;
use crate::store::DiskRoom;

/// Returns the name of a segment.
fn name(number: u64) -> String {
    format!("flight-{number:06}.mcap")
}

/// Returns the number of a segment's file, if it is one.
fn number(path: &Path) -> Option<u64> {
    let digits = path
        .file_name()?
        .to_str()?
        .strip_prefix("flight-")?
        .strip_suffix(".mcap")?;
    (digits.len() >= 6 && digits.bytes().all(|digit| digit.is_ascii_digit()))
        .then(|| digits.parse().ok())?
}

/// Lists the segments in a folder, oldest first.
pub(super) fn segments(folder: &Path) -> Result<Vec<(u64, PathBuf)>, WriteError> {
    let entries = fs::read_dir(folder).map_err(|error| WriteError::at(folder, error))?;
    let paths = entries.flatten().map(|entry| entry.path());
    let mut found: Vec<(u64, PathBuf)> = paths
        .filter_map(|path| Some((number(&path)?, path)))
        .collect();
    found.sort();
    Ok(found)
}

/// Returns the number and the path of the next segment, above every one that is there.
pub(super) fn next(folder: &Path, above: u64) -> Result<(u64, PathBuf), WriteError> {
    fs::create_dir_all(folder).map_err(|error| WriteError::at(folder, error))?;
    let last = segments(folder)?.last().map_or(0, |(number, _)| *number);
    let number = last.max(above) + 1;
    Ok((number, folder.join(name(number))))
}

/// What the segments of a folder take after some were dropped.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct RoomMade {
    /// All that are left, bytes.
    pub used_bytes: u64,
    /// What the disk still lacks, bytes.
    pub missing_bytes: u64,
}

/// Deletes the oldest segments of a folder until its disk has its reserve; without a folder nothing is done. For a node that
/// starts: its recordings have no room that it needs itself.
///
/// # Errors
/// The folder cannot be read, or a segment not deleted.
pub fn give_way(folder: &Path) -> Result<(), WriteError> {
    let missing_bytes = DiskRoom::of(folder).map_or(0, |room| room.missing_bytes(0));
    if missing_bytes > 0 {
        make_room(folder, u64::MAX, missing_bytes, &[])?;
    }
    Ok(())
}

/// Drops the oldest segments until all together are within `cap_bytes`, and the disk has got `missing_bytes`; those in `kept`
/// stay.
pub(super) fn make_room(
    folder: &Path,
    cap_bytes: u64,
    missing_bytes: u64,
    kept: &[&Path],
) -> Result<RoomMade, WriteError> {
    let sized = |(_, path): (u64, PathBuf)| {
        let bytes = fs::metadata(&path).map_or(0, |file| file.len());
        (path, bytes)
    };
    let found: Vec<(PathBuf, u64)> = segments(folder)?.into_iter().map(sized).collect();
    let mut made = RoomMade {
        used_bytes: found.iter().map(|(_, bytes)| bytes).sum(),
        missing_bytes,
    };
    for (path, bytes) in found
        .iter()
        .filter(|(path, _)| !kept.contains(&path.as_path()))
    {
        if made.used_bytes <= cap_bytes && made.missing_bytes == 0 {
            break;
        }
        fs::remove_file(path).map_err(|error| WriteError::at(path, error))?;
        made.used_bytes -= bytes;
        made.missing_bytes = made.missing_bytes.saturating_sub(*bytes);
    }
    Ok(made)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_go_first_and_foreign_files_stay() {
        let folder = tempfile::tempdir().unwrap();
        for index in [9, 10, 11] {
            fs::write(folder.path().join(name(index)), [0; 100]).unwrap();
        }
        fs::write(folder.path().join("flight-1.mcap"), [0; 900]).unwrap();
        fs::write(folder.path().join("notes.txt"), [0; 900]).unwrap();
        make_room(folder.path(), 250, 0, &[]).unwrap();
        let left: Vec<u64> = segments(folder.path())
            .unwrap()
            .into_iter()
            .map(|(number, _)| number)
            .collect();
        assert_eq!(left, [10, 11]);
        let newest = folder.path().join(name(11));
        make_room(folder.path(), 0, 0, &[&newest]).unwrap();
        assert_eq!(segments(folder.path()).unwrap(), [(11, newest)]);
        assert_eq!(next(folder.path(), 3).unwrap().0, 12);
        assert_eq!(next(folder.path(), 30).unwrap().0, 31);
        assert!(
            folder.path().join("notes.txt").exists()
                && folder.path().join("flight-1.mcap").exists()
        );
    }

    #[test]
    fn what_the_disk_lacks_is_made_of_the_oldest_and_never_of_those_that_are_written() {
        let check = |missing_bytes, expected: &[u64], used_bytes, lacks_bytes| {
            let folder = tempfile::tempdir().unwrap();
            for index in [1, 2, 3] {
                fs::write(folder.path().join(name(index)), [0; 100]).unwrap();
            }
            let newest = folder.path().join(name(3));
            let made = make_room(folder.path(), 1000, missing_bytes, &[&newest]).unwrap();
            let expected_made = RoomMade {
                used_bytes,
                missing_bytes: lacks_bytes,
            };
            assert_eq!(made, expected_made, "{missing_bytes}");
            let left = segments(folder.path()).unwrap();
            let left: Vec<u64> = left.into_iter().map(|(number, _)| number).collect();
            assert_eq!(left, expected, "{missing_bytes}");
        };
        check(0, &[1, 2, 3], 300, 0);
        check(1, &[2, 3], 200, 0);
        check(200, &[3], 100, 0);
        check(900, &[3], 100, 700);
    }
}
