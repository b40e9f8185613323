//! Replaces a small file so that a power cut leaves the old one or the new one, whole.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Replaces a file, or makes it: the text is written beside it and takes its name once it is on disk.
///
/// # Errors
/// It cannot be written. The file is as it was, unless only the folder could not be brought to disk.
pub fn replace(path: &Path, text: &str) -> io::Result<()> {
    let fresh = beside(path);
    let mut file = File::create(&fresh)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    fs::rename(&fresh, path)?;
    // The rename itself must outlive a power cut as well.
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}

/// Returns where a file is written before it takes its name; one that is found there was never finished.
pub(super) fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".new");
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_what_was_left_unfinished_is_no_hindrance() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("boot");
        replace(&path, "1\n").unwrap();
        fs::write(beside(&path), "half of something lo").unwrap();
        replace(&path, "2\n").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "2\n");
        assert!(!beside(&path).exists());
        fs::create_dir(beside(&path)).unwrap();
        assert!(replace(&path, "3\n").is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "2\n", "as it was");
    }
}
