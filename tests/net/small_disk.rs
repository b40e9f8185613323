//! A disk of a few megabytes, where the machine mounts one for us.

use std::io::Write;
use std::path::Path;
use std::process::Command;

use rustix::process::geteuid;

/// A small file system in memory, as long as it is held.
pub struct SmallDisk<'a>(pub &'a Path);

impl<'a> SmallDisk<'a> {
    /// Makes one where the machine allows it; where it does not, that is said, past the harness, which shows nothing of a test
    /// that passes.
    pub fn mount(at: &'a Path, kb: u32) -> Option<SmallDisk<'a>> {
        std::fs::create_dir_all(at).unwrap();
        let disk = SmallDisk::try_mount(at, kb);
        if disk.is_none() {
            let test = std::thread::current();
            let test = test.name().unwrap_or("a test");
            let _ = std::io::stderr().write_fmt(format_args!(
                "skipped: {test}: this machine mounts no small disk for us (root is needed)\n"
            ));
        }
        disk
    }

    fn try_mount(at: &'a Path, kb: u32) -> Option<SmallDisk<'a>> {
        let may = geteuid().is_root()
            && run(
                "mount",
                &[
                    "-t",
                    "tmpfs",
                    "-o",
                    &format!("size={kb}k"),
                    "tmpfs",
                    at.to_str()?,
                ],
            );
        may.then_some(SmallDisk(at))
    }

    /// Lets it have more room.
    pub fn grow(&self, kb: u32) {
        assert!(run(
            "mount",
            &[
                "-o",
                &format!("remount,size={kb}k"),
                self.0.to_str().unwrap()
            ]
        ));
    }
}

impl Drop for SmallDisk<'_> {
    fn drop(&mut self) {
        run("umount", &["-l", self.0.to_str().unwrap()]);
    }
}

pub fn run(program: &str, arguments: &[&str]) -> bool {
    Command::new(program)
        .args(arguments)
        .output()
        .is_ok_and(|output| output.status.success())
}
