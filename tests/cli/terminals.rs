//! Where answers go: pipes that nobody reads, full disks, terminals.

use std::fs::File;
use std::process::{Command, Stdio};

use super::desk::{Desk, Said, said};

const RECORDING: &str = "tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm\n0,0,8,8,-50\n0,8,8,0,-51\n";

/// One command line of each kind that answers.
const ANSWERS: [&[&str]; 7] = [
    &["check", "small.sim.toml", "small.wrl"],
    &["plan", "small.sim.toml"],
    &["plan", "small.sim.toml", "--stops"],
    &["sim", "small.sim.toml"],
    &["sim", "small.sim.toml", "--trials", "1"],
    &["image", "a.csv"],
    &["sim", "--help"],
];

fn desk() -> Desk {
    let desk = Desk::new();
    desk.write("a.csv", RECORDING);
    desk
}

/// Runs the program through a shell, with the given words after its own command line.
fn in_shell(desk: &Desk, arguments: &[&str], rest: &str) -> Said {
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("\"$0\" \"$@\" {rest}"), env!("CARGO_BIN_EXE_tomoswarm")]);
    shell.args(arguments).current_dir(desk.path(".")).stdin(Stdio::null());
    said(shell)
}

#[test]
fn a_reader_who_leaves_changes_nothing() {
    let desk = desk();
    for arguments in ANSWERS {
        let Said { code, err, .. } = desk.run(arguments);
        let said = in_shell(&desk, arguments, "| true");
        assert_eq!(said.err, err, "{arguments:?}");
        let mut program = desk.program(arguments);
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        program.stdout(writer);
        let said = super::desk::said(program);
        assert_eq!((said.code, said.err), (code, err), "{arguments:?}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn an_answer_that_cannot_be_written_is_reported() {
    let desk = desk();
    for arguments in &ANSWERS[..6] {
        let mut program = desk.program(arguments);
        program.stdout(File::options().write(true).open("/dev/full").unwrap());
        let output = program.stderr(Stdio::piped()).output().unwrap();
        let err = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {err}");
        assert!(err.contains("standard output: cannot be written: No space left"), "{arguments:?}: {err}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_complaint_that_cannot_be_written_keeps_its_exit_code() {
    let desk = desk();
    for rest in ["2>/dev/full", "2>&-", ">&- 2>&- <&-"] {
        for arguments in
            [&["sim", "gone.toml"][..], &["image", "gone.csv"], &["check", "gone.toml"], &["fly"]]
        {
            assert_eq!(in_shell(&desk, arguments, rest).code, 2, "{arguments:?} {rest}");
        }
    }
    assert_eq!(in_shell(&desk, &["sim", "small.sim.toml", "--out", "run"], ">&- 2>&- <&-").code, 0);
    assert!(desk.path("run/summary.json").exists());
}

#[test]
#[cfg(target_os = "linux")]
fn a_device_is_written_and_not_replaced() {
    let desk = desk();
    let fifo = desk.path("pipe");
    if !Command::new("mkfifo").arg(&fifo).status().is_ok_and(|status| status.success()) {
        println!("skipped: there is no `mkfifo`");
        return;
    }
    let reader = std::thread::spawn(move || std::fs::read(fifo).unwrap());
    let said = desk.run(&["image", "a.csv", "--npy", "/dev/null", "--json", "pipe"]);
    assert_eq!(said.code, 0, "{said:?}");
    let report: serde_json::Value = serde_json::from_slice(&reader.join().unwrap()).unwrap();
    assert!(report["peaks"].is_array());
    assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
    assert!(desk.names_in(".").iter().all(|name| !name.starts_with('.')));
}

#[test]
fn progress_is_shown_on_a_terminal_only_and_changes_no_byte() {
    let desk = desk();
    let quiet = desk.run(&["sim", "small.sim.toml", "--out", "quiet"]);
    assert_eq!((quiet.code, quiet.err.as_str()), (0, ""));
    assert!(!quiet.out.contains('\u{1b}') && !quiet.out.contains('\r'), "{quiet:?}");
    let line = format!("{} sim small.sim.toml --out shown", env!("CARGO_BIN_EXE_tomoswarm"));
    let mut script = Command::new("script");
    script.args(["-qec", &line, "/dev/null"]).current_dir(desk.path(".")).stdin(Stdio::null());
    let Ok(output) = script.output() else {
        println!("skipped: there is no `script` to make a terminal");
        return;
    };
    if !desk.path("shown").exists() {
        println!("skipped: this `script` is another one");
        return;
    }
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("\u{1b}[") && text.contains("lap "), "{text}");
    for name in ["run.log", "links.csv", "empty.csv", "image.npy", "image.png", "map.png"] {
        assert_eq!(desk.read(&format!("quiet/{name}")), desk.read(&format!("shown/{name}")), "{name}");
    }
}
