//! Processor time of the threads of a process.

use std::fs;
use std::time::{Duration, Instant};

/// Returns how long a process's threads were on a processor and how long they waited for one; of those with these names only,
/// of all when none are named.
fn times(process: u32, names: &[&str]) -> (Duration, Duration) {
    let threads = fs::read_dir(format!("/proc/{process}/task")).unwrap();
    let of_thread = |folder: std::path::PathBuf| {
        let name = fs::read_to_string(folder.join("comm")).ok()?;
        let is_meant = names.is_empty() || names.contains(&name.trim_end());
        let text = fs::read_to_string(folder.join("schedstat")).ok()?;
        let mut times_ns = text.split_whitespace().map(|number| number.parse().ok());
        let mut next = || Some(Duration::from_nanos(times_ns.next()??));
        is_meant.then_some((next()?, next()?))
    };
    threads
        .filter_map(|entry| of_thread(entry.unwrap().path()))
        .fold(Default::default(), |sum, one| {
            (sum.0 + one.0, sum.1 + one.1)
        })
}

/// Returns how long a process's threads have waited for a core, added up: others were on it.
pub fn waited_for_core(process: u32) -> Duration {
    times(process, &[]).1
}

/// Returns the share of a core that a process's threads take while time passes.
pub fn share_of_core(process: u32, names: &[&str], lasts: Duration) -> f64 {
    let (began, before) = (Instant::now(), times(process, names).0);
    std::thread::sleep(lasts);
    let taken = times(process, names).0 - before;
    taken.as_secs_f64() / began.elapsed().as_secs_f64()
}
