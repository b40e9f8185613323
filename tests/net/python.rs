//! Scripts in Python: other people's programs that speak with this one.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::swarm::PROGRAM;

/// Returns a Python that has a module; `None` where there is none.
fn python(module: &str) -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/venv/bin/python");
    let found = [own, PathBuf::from("python3")];
    found.into_iter().find(|python| {
        let mut program = Command::new(python);
        let run = program.args(["-c", &format!("import {module}")]).output();
        run.is_ok_and(|run| run.status.success())
    })
}

/// Runs a script of `tests`, unless the module that it needs is missing.
pub fn run_script(script: &str, module: &str) {
    let Some(python) = python(module) else {
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: no Python with {module} (target/venv, see .ci/run)\n"),
        );
        return;
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let run = Command::new(python)
        .arg(root.join("tests").join(script))
        .current_dir(root)
        .env("TOMOSWARM", PROGRAM)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(
        run.status.success(),
        "{said}{}",
        String::from_utf8_lossy(&run.stderr)
    );
    assert!(said.contains("ok "), "it has tested nothing: {said}");
}
