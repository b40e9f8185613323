//! A machine whose clock is ten years off, with certificates on.
//!
//! The clock is set for one process only: a small library that is loaded before the system's own answers for it. It is
//! compiled here by rustc, which is there wherever tests are built.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::swarm::{GROUND, Size, Swarm, vehicle};

/// What answers for the system: the date (clock 0) is ten years ahead, all other clocks are as they are.
const LIBRARY: &str = "
#[repr(C)] pub struct Timespec { seconds: i64, nanoseconds: i64 }
unsafe extern \"C\" { fn syscall(number: i64, ...) -> i64; }
const CLOCK_GETTIME: i64 = if cfg!(target_arch = \"x86_64\") { 228 } else { 113 };
#[unsafe(no_mangle)] pub unsafe extern \"C\" fn clock_gettime(clock: i32, at: *mut Timespec) -> i32 {
    let answer = unsafe { syscall(CLOCK_GETTIME, clock as i64, at) };
    if answer == 0 && clock == 0 { unsafe { (*at).seconds += 315_576_000 }; }
    answer as i32
}
";

fn library(folder: &Path) -> PathBuf {
    let (source, library) = (folder.join("late.rs"), folder.join("late.so"));
    std::fs::write(&source, LIBRARY).unwrap();
    let mut compiler = Command::new(option_env!("RUSTC").unwrap_or("rustc"));
    let flags = [
        "--edition",
        "2024",
        "--crate-type",
        "cdylib",
        "-C",
        "panic=abort",
        "-O",
        "-o",
    ];
    let run = compiler
        .args(flags)
        .args([&library, &source])
        .output()
        .unwrap();
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    library
}

#[test]
fn a_clock_ten_years_off_keeps_nobody_out_with_certificates() {
    let folder = tempfile::tempdir().unwrap();
    let library = library(folder.path());
    let mut swarm = Swarm::prepare(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    swarm.enroll();
    swarm.preload(vehicle(2), &library);
    swarm.run();
    swarm.begin();
    swarm.finish();
    // Its log is dated by its clock, the others' by the machine's.
    let year = |node| swarm.log_of(node)[..4].parse::<i32>().unwrap();
    assert_eq!(year(vehicle(2)), year(GROUND) + 10);
}
