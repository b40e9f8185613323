//! The room that a disk has left, and the reserve of it that recordings leave free: samples, what was obeyed and the count
//! of starts come first. Writes and deletes nothing.

use std::path::Path;

use rustix::fs::statvfs;

/// Recordings leave so many bytes free.
const RESERVE_BYTES: u64 = 64 << 20;
/// On a small disk they leave this part of it free.
const RESERVE_PART: u64 = 8;

/// The room of the disk that holds a folder.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct DiskRoom {
    /// What a user may still write, bytes.
    pub free_bytes: u64,
    /// All of it, bytes.
    pub total_bytes: u64,
}

impl DiskRoom {
    /// Asks for the room of the disk that holds a folder or file; `None` when the system does not tell.
    pub fn of(path: &Path) -> Option<DiskRoom> {
        let room = statvfs(path).ok()?;
        Some(DiskRoom {
            free_bytes: room.f_bavail.saturating_mul(room.f_frsize),
            total_bytes: room.f_blocks.saturating_mul(room.f_frsize),
        })
    }

    /// Returns what is free, MB (2²⁰ bytes).
    pub fn free_mb(self) -> u32 {
        u32::try_from(self.free_bytes >> 20).unwrap_or(u32::MAX)
    }

    /// Returns what recordings leave free, bytes.
    pub fn reserve_bytes(self) -> u64 {
        RESERVE_BYTES.min(self.total_bytes / RESERVE_PART)
    }

    /// Returns how many bytes would have to be deleted so that the reserve, and so many bytes beside it, are free.
    pub fn missing_bytes(self, beside_bytes: u64) -> u64 {
        self.reserve_bytes()
            .saturating_add(beside_bytes)
            .saturating_sub(self.free_bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reserve_is_64_mib_and_an_eighth_of_a_small_disk() {
        let room = |free_bytes, total_bytes| DiskRoom {
            free_bytes,
            total_bytes,
        };
        let card = room(100 << 20, 32 << 30);
        assert_eq!((card.free_mb(), card.reserve_bytes()), (100, 64 << 20));
        assert_eq!(card.missing_bytes(0), 0);
        assert_eq!(card.missing_bytes(36 << 20), 0);
        assert_eq!(card.missing_bytes(40 << 20), 4 << 20);
        assert_eq!(room(1 << 20, 16 << 20).missing_bytes(0), 1 << 20);
        assert_eq!(room(0, 0).missing_bytes(0), 0);
    }

    #[test]
    fn a_folder_has_room_and_a_missing_one_says_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let room = DiskRoom::of(folder.path()).unwrap();
        assert!(room.free_bytes <= room.total_bytes && room.total_bytes > 0);
        assert_eq!(DiskRoom::of(&folder.path().join("no")), None);
    }
}
