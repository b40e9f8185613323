//! The file of a vehicle's memory: a few lines of text with a check value, replaced as a whole.
//!
//! ```text
//!   tomoswarm vehicle memory 1
//!   ordered lease 5 holder 81985529216486895 revision 7 run 2
//!   planned lease 5 holder 81985529216486895
//!   check 9ae16a3b2f90404f
//! ```
//!
//! More to remember is more lines and a higher version; a later program reads the earlier versions. A folder without the
//! file is that of a vehicle that has obeyed nothing. Whatever else is found is refused and left as it is: to guess would
//! be to obey what was overruled.

use std::io;
use std::path::{Path, PathBuf};

use tomoswarm_proto::{Lease, Revision, RunId};

use crate::node::VehicleMemory;
use crate::node::memory::OrderEdition;
use crate::store::checked_file::{CheckedFile, CheckedFileError};
use crate::store::replace;

/// What the file is.
const FILE: CheckedFile = CheckedFile {
    title: "tomoswarm vehicle memory",
    version: 1,
    longest: 4096,
    holds: "the highest order that this vehicle has obeyed",
    remedy: "restore a copy, or remove it when no operator and no ground station of an older lease is at work",
};

/// A vehicle's memory on disk.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MemoryFile {
    path: PathBuf,
}

impl MemoryFile {
    /// Names the file; nothing is read or written yet.
    pub fn at(path: PathBuf) -> MemoryFile {
        MemoryFile { path }
    }

    /// Returns the file's path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads it; a vehicle without the file remembers nothing.
    ///
    /// # Errors
    /// It cannot be read, or is not what was written.
    pub fn read(&self) -> Result<VehicleMemory, CheckedFileError> {
        Ok(FILE.read(&self.path, parse)?.unwrap_or_default())
    }

    /// Writes it; after a power cut it is as before, or as written now.
    ///
    /// # Errors
    /// The system does not let it be written.
    pub fn write(&self, memory: &VehicleMemory) -> io::Result<()> {
        replace(&self.path, &text(memory))
    }
}

fn text(memory: &VehicleMemory) -> String {
    let VehicleMemory {
        ordered: OrderEdition {
            lease,
            revision,
            run,
        },
        planned,
    } = memory;
    FILE.seal(&format!(
        "ordered lease {} holder {} revision {revision} run {run}\nplanned lease {} holder {}\n",
        lease.number, lease.holder, planned.number, planned.holder
    ))
}

fn parse(lines: &str) -> Result<VehicleMemory, String> {
    content(lines).ok_or_else(|| "its lines are not those of version 1".to_owned())
}

/// Reads the lines of version 1.
fn content(lines: &str) -> Option<VehicleMemory> {
    let (ordered, planned) = lines.split_once('\n')?;
    let [number, holder, revision, run] = numbers(
        ordered.strip_prefix("ordered ")?,
        ["lease", "holder", "revision", "run"],
    )?;
    let order = OrderEdition {
        lease: Lease {
            number: u32::try_from(number).ok()?,
            holder,
        },
        revision: Revision(u32::try_from(revision).ok()?),
        run: RunId(u32::try_from(run).ok()?),
    };
    let [number, holder] = numbers(planned.strip_prefix("planned ")?, ["lease", "holder"])?;
    let planned = Lease {
        number: u32::try_from(number).ok()?,
        holder,
    };
    Some(VehicleMemory {
        ordered: order,
        planned,
    })
}

/// Reads numbers that stand behind their names, all of them and nothing else.
fn numbers<const COUNT: usize>(line: &str, names: [&str; COUNT]) -> Option<[u64; COUNT]> {
    let mut words = line.split(' ');
    let mut values = [0; COUNT];
    for (name, value) in names.into_iter().zip(&mut values) {
        words.next().filter(|word| *word == name)?;
        *value = words.next()?.parse().ok()?;
    }
    words.next().is_none().then_some(values)
}

#[cfg(test)]
pub(super) mod tests {
    use std::fs;

    use super::*;
    use crate::store::checked_file::fnv;
    use crate::store::durable::beside;
    use proptest::prelude::*;

    pub fn memory(number: u32, revision: u32) -> VehicleMemory {
        let lease = Lease {
            number,
            holder: 0x0123_4567_89ab_cdef,
        };
        let ordered = OrderEdition {
            lease,
            revision: Revision(revision),
            run: RunId(2),
        };
        VehicleMemory {
            ordered,
            planned: Lease {
                number: 4,
                holder: u64::MAX,
            },
        }
    }

    fn file() -> (tempfile::TempDir, MemoryFile) {
        let folder = tempfile::tempdir().unwrap();
        let file = MemoryFile::at(folder.path().join("memory"));
        (folder, file)
    }

    #[test]
    fn a_folder_of_before_has_obeyed_nothing_and_what_is_written_is_read() {
        let (_folder, file) = file();
        assert_eq!(file.read().unwrap(), VehicleMemory::default());
        for (number, revision) in [(5, 7), (5, 8), (u32::MAX, u32::MAX)] {
            file.write(&memory(number, revision)).unwrap();
            assert_eq!(file.read().unwrap(), memory(number, revision));
        }
    }

    proptest! {
        #[test]
        fn every_memory_is_read_as_it_was_written(
            ordered in any::<(u32, u64, u32, u32)>(),
            planned in any::<(u32, u64)>(),
        ) {
            let lease = Lease { number: ordered.0, holder: ordered.1 };
            let ordered = OrderEdition { lease, revision: Revision(ordered.2), run: RunId(ordered.3) };
            let memory = VehicleMemory { ordered, planned: Lease { number: planned.0, holder: planned.1 } };
            prop_assert_eq!(FILE.open(text(&memory).as_bytes()).map(parse), Ok(Ok(memory)));
        }
    }

    #[test]
    fn damage_at_every_byte_every_loss_and_every_addition_is_noticed() {
        let whole = text(&memory(5, 7)).into_bytes();
        let reads = |bytes: &[u8]| FILE.open(bytes).is_ok_and(|lines| parse(lines).is_ok());
        assert!(reads(&whole));
        for index in 0..whole.len() {
            for change in 1..=u8::MAX {
                let mut bytes = whole.clone();
                bytes[index] ^= change;
                assert!(
                    !reads(&bytes),
                    "byte {index}: {:?}",
                    String::from_utf8_lossy(&bytes)
                );
            }
            assert!(!reads(&whole[..index]), "cut after {index}");
            assert!(
                !reads(&[&whole[..index], b"0", &whole[index..]].concat()),
                "more at {index}"
            );
        }
        assert!(!reads(&[&whole[..], b"\n"].concat()));
    }

    #[test]
    fn what_cannot_be_read_is_said_with_its_path_and_what_was_expected() {
        let (_folder, file) = file();
        let path = file.path().display().to_string();
        let output = |bytes: &[u8]| {
            fs::write(file.path(), bytes).unwrap();
            let output = file.read().unwrap_err().to_string();
            assert!(output.starts_with(&path), "{output}");
            assert_eq!(fs::read(file.path()).unwrap(), bytes, "it is left as it is");
            output
        };
        assert!(output(b"").contains("damaged: it is empty; it holds the highest order"));
        assert!(output(&[0xff; 9]).contains("expected text"));
        assert!(output(&vec![b'a'; 10_000]).contains("10000 bytes, expected at most 4096"));
        assert!(output(b"tomoswarm vehicle memory 1\ncheck 0\n").contains("expected `check "));
        let with_check = |body: &str| format!("{body}check {:016x}\n", fnv(body.as_bytes()));
        let newer = output(with_check("tomoswarm vehicle memory 2\nopen 7\n").as_bytes());
        assert!(
            newer.ends_with("written by a newer tomoswarm (version 2, this one knows 1)"),
            "{newer}"
        );
        let older = output(with_check("tomoswarm vehicle memory 0\n").as_bytes());
        assert!(
            older.contains("expected `tomoswarm vehicle memory 1`"),
            "{older}"
        );
        let other = output(with_check("a shopping list\n").as_bytes());
        assert!(other.contains("found `a shopping list`"), "{other}");
        let lines = output(with_check("tomoswarm vehicle memory 1\nordered lease 1\n").as_bytes());
        assert!(lines.contains("not those of version 1"), "{lines}");
    }

    #[test]
    fn what_is_no_file_is_refused() {
        let (_folder, file) = file();
        fs::create_dir(file.path()).unwrap();
        assert!(matches!(file.read(), Err(CheckedFileError::Unread { .. })));
        assert!(file.write(&memory(1, 1)).is_err());
    }

    #[test]
    fn a_process_killed_between_writing_and_renaming_leaves_what_was_there() {
        let (_folder, file) = file();
        file.write(&memory(5, 7)).unwrap();
        let whole = text(&memory(6, 1));
        for length in 0..=whole.len() {
            fs::write(beside(file.path()), &whole[..length]).unwrap();
            assert_eq!(file.read().unwrap(), memory(5, 7));
        }
        file.write(&memory(7, 1)).unwrap();
        assert_eq!(file.read().unwrap(), memory(7, 1));
    }
}
