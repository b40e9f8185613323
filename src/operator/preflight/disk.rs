//! Whether a node's disk has room for a run: for its data, and for what its recordings may still grow by. Recordings give
//! way before data; one that has no room is shorter than its file says.

use tomoswarm_proto::{GroundReport, Health, RecordingHealth};

use super::{Check, CheckStatus, reported};

/// Room that a node must have for its data, MB.
const DATA_MB: u32 = 200;
/// By this name a ground station says that its disk has too little room.
pub const DISK_TROUBLE: &str = "disk";

/// Judges the disk of a vehicle; one that does not say its room is not known.
pub(super) fn disk(health: Option<&Health>) -> Check {
    let free = health.and_then(|health| Some((health.disk_free_mb?, health.recording)));
    reported(
        "disk",
        free,
        CheckStatus::Unknown,
        |(free_mb, recording)| disk_room(free_mb, recording),
    )
}

/// Judges the disk of a ground station, which looks at it once a second and says how much room there is only when that is too
/// little.
pub(super) fn of_ground(report: Option<&GroundReport>) -> Check {
    reported("disk", report, CheckStatus::NoGo, |report| {
        let short = report.troubles.iter().find(|words| is_disk_trouble(words));
        match short.and_then(|words| words.split_once(": ")) {
            Some((_, found)) => (false, found.to_owned()),
            None => (true, "enough for a run, else it would say so".to_owned()),
        }
    })
}

/// Returns whether a trouble of a ground station is that its disk has too little room.
pub(super) fn is_disk_trouble(words: &str) -> bool {
    (words.strip_prefix(DISK_TROUBLE)).is_some_and(|rest| rest.starts_with(": "))
}

/// Returns whether a disk with so much room, MB, suffices, and what was found, in words.
pub fn disk_room(free_mb: u32, recording: Option<RecordingHealth>) -> (bool, String) {
    let Some(RecordingHealth { used_mb, limit_mb }) = recording else {
        let found = format!("{free_mb} MB free, over {DATA_MB} MB needed");
        return (free_mb > DATA_MB, found);
    };
    let grows_mb = limit_mb.saturating_sub(used_mb);
    let needed_mb = DATA_MB.saturating_add(grows_mb);
    let found = format!(
        "{free_mb} MB free, over {needed_mb} MB needed: {DATA_MB} MB, and {grows_mb} MB for recordings ({used_mb} of {limit_mb} MB)"
    );
    (free_mb > needed_mb, found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_count_by_what_they_may_still_grow() {
        let check = |free_mb, recording: Option<(u32, u32)>, is_enough, expected: &str| {
            let recording =
                recording.map(|(used_mb, limit_mb)| RecordingHealth { used_mb, limit_mb });
            let expected = (is_enough, expected.to_owned());
            assert_eq!(disk_room(free_mb, recording), expected);
        };
        check(201, None, true, "201 MB free, over 200 MB needed");
        check(200, None, false, "200 MB free, over 200 MB needed");
        let needs_400 =
            "400 MB free, over 400 MB needed: 200 MB, and 200 MB for recordings (56 of 256 MB)";
        check(400, Some((56, 256)), false, needs_400);
        let is_full =
            "201 MB free, over 200 MB needed: 200 MB, and 0 MB for recordings (260 of 256 MB)";
        check(201, Some((260, 256)), true, is_full);
    }
}
