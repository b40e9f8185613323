//! Where answers go: pipes that nobody reads, full disks, terminals.

use std::fs::File;
use std::process::{Command, Stdio};

use super::program_runner::{ProgramOutput, ProgramRunner, output_of};

const RECORDING: &str = "tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm\n0,0,8,8,-50\n0,8,8,0,-51\n0,2,8,7,-52\n0,6,8,1,-50\n2,0,5,8,-51\n";

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

fn runner() -> ProgramRunner {
    let runner = ProgramRunner::new();
    runner.write("a.csv", RECORDING);
    runner
}

/// Runs the program through a shell, with the given words after its own command line.
fn in_shell(runner: &ProgramRunner, arguments: &[&str], rest: &str) -> ProgramOutput {
    let mut shell = Command::new("sh");
    shell.args([
        "-c",
        &format!("\"$0\" \"$@\" {rest}"),
        env!("CARGO_BIN_EXE_tomoswarm"),
    ]);
    shell
        .args(arguments)
        .current_dir(runner.path("."))
        .stdin(Stdio::null());
    output_of(shell)
}

#[test]
fn a_reader_who_leaves_changes_nothing() {
    let runner = runner();
    for arguments in ANSWERS {
        let ProgramOutput { code, err, .. } = runner.run(arguments);
        let printed = in_shell(&runner, arguments, "| true");
        assert_eq!(printed.err, err, "{arguments:?}");
        let mut program = runner.program(arguments);
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        program.stdout(writer);
        let printed = super::program_runner::output_of(program);
        assert_eq!((printed.code, printed.err), (code, err), "{arguments:?}");
    }
}

#[test]
fn what_check_prints_is_checked_again_from_any_folder_with_the_same_values() {
    let runner = runner();
    std::fs::create_dir(runner.path("below")).unwrap();
    let values = |printed: &ProgramOutput| -> Vec<String> {
        assert_eq!(printed.code, 0, "{printed:?}");
        printed
            .out
            .lines()
            .filter(|line| !line.starts_with('#'))
            .map(str::to_owned)
            .collect()
    };
    for file in ["small.sim.toml", "small.scene.toml", "small.venue.toml"] {
        let once = values(&runner.run(&["check", file]));
        assert!(once.len() > 5, "{once:?}");
        assert_eq!(
            values(&in_shell(&runner, &["check", file], "| \"$0\" check -")),
            once,
            "{file}"
        );
        let mut from_below = Command::new("sh");
        let piped = format!("\"$0\" check ../{file} | \"$0\" check -");
        from_below
            .args(["-c", &piped, env!("CARGO_BIN_EXE_tomoswarm")])
            .current_dir(runner.path("below"));
        assert_eq!(values(&output_of(from_below)).len(), once.len(), "{file}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn an_answer_that_cannot_be_written_is_reported() {
    let runner = runner();
    for arguments in &ANSWERS[..6] {
        let mut program = runner.program(arguments);
        program.stdout(File::options().write(true).open("/dev/full").unwrap());
        let output = program.stderr(Stdio::piped()).output().unwrap();
        let err = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {err}");
        assert!(
            err.contains("standard output: cannot be written: No space left"),
            "{arguments:?}: {err}"
        );
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_complaint_that_cannot_be_written_keeps_its_exit_code() {
    let runner = runner();
    for rest in ["2>/dev/full", "2>&-", ">&- 2>&- <&-"] {
        for arguments in [
            &["sim", "gone.toml"][..],
            &["image", "gone.csv"],
            &["check", "gone.toml"],
            &["fly"],
        ] {
            assert_eq!(
                in_shell(&runner, arguments, rest).code,
                2,
                "{arguments:?} {rest}"
            );
        }
    }
    assert_eq!(
        in_shell(
            &runner,
            &["sim", "small.sim.toml", "--out", "run"],
            ">&- 2>&- <&-"
        )
        .code,
        0
    );
    assert!(runner.path("run/summary.json").exists());
}

#[test]
#[cfg(target_os = "linux")]
fn a_device_is_written_and_not_replaced() {
    let runner = runner();
    let fifo = runner.path("pipe");
    if !Command::new("mkfifo")
        .arg(&fifo)
        .status()
        .is_ok_and(|status| status.success())
    {
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: there is no `mkfifo`\n"),
        );
        return;
    }
    let reader = std::thread::spawn(move || std::fs::read(fifo).unwrap());
    let printed = runner.run(&["image", "a.csv", "--npy", "/dev/null", "--json", "pipe"]);
    assert_eq!(printed.code, 0, "{printed:?}");
    let report: serde_json::Value = serde_json::from_slice(&reader.join().unwrap()).unwrap();
    assert!(report["peaks"].is_array());
    assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
    assert!(
        runner
            .names_in(".")
            .iter()
            .all(|name| !name.starts_with('.'))
    );
}

/// Runs a line on a terminal of 60 by 20 letters, `$PROGRAM` being the program; returns what the terminal was told, `None`
/// where no terminal can be made.
fn on_terminal(runner: &ProgramRunner, line: &str) -> Option<String> {
    let line = line.replace("$PROGRAM", env!("CARGO_BIN_EXE_tomoswarm"));
    let line = format!("stty rows 20 cols 60; touch begun; {line}; echo code $?");
    let mut script = Command::new("script");
    script
        .args(["-qec", &line, "/dev/null"])
        .current_dir(runner.path("."))
        .stdin(Stdio::null());
    let output = script.env("TERM", "xterm-256color").output().ok();
    if output.is_none() || !runner.path("begun").exists() {
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!(
                "skipped: there is no `script` to make a terminal, or it is another one\n"
            ),
        );
        return None;
    }
    output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// What the terminal was told before, while and after it was drawn on.
fn drawn(text: &str) -> (&str, &str, &str) {
    let (before, rest) = text
        .split_once("\u{1b}[?1049h")
        .expect("the terminal is taken over");
    let (drawn, after) = rest
        .split_once("\u{1b}[?25h\u{1b}[?1049l")
        .expect("the terminal is given back");
    (before, drawn, after)
}

#[test]
fn a_watched_run_draws_gives_the_terminal_back_and_changes_no_byte() {
    let runner = runner();
    assert_eq!(
        runner
            .run(&["sim", "small.sim.toml", "--out", "quiet"])
            .code,
        0
    );
    let Some(text) = on_terminal(
        &runner,
        "$PROGRAM sim small.sim.toml --watch --pace 500 --out shown",
    ) else {
        return;
    };
    let (before, drawn, after) = drawn(&text);
    assert!(
        !before.contains('\u{1b}') && !after.contains('\u{1b}'),
        "{text}"
    );
    assert!(
        drawn.contains('\u{2580}') && drawn.contains("2 on its way"),
        "{text}"
    );
    for words in [
        "vehicle, its front",
        "its track",
        "occupied",
        "free",
        "unknown",
        "home",
    ] {
        assert!(drawn.contains(&format!(" {words}")), "{words}: {text}");
    }
    assert!(
        drawn.contains("\u{1b}[20;1H") && !drawn.contains("\u{1b}[21;1H") && !drawn.contains('\n')
    );
    assert!(
        after.contains("small with 2 vehicles") && after.contains("code 0"),
        "{text}"
    );
    for name in [
        "run.log",
        "links.csv",
        "empty.csv",
        "image.npy",
        "image.png",
        "map.png",
    ] {
        assert_eq!(
            runner.read(&format!("quiet/{name}")),
            runner.read(&format!("shown/{name}")),
            "{name}"
        );
    }
}

#[test]
#[allow(
    clippy::disallowed_methods,
    reason = "the pace of another process is one of real time"
)]
fn a_watched_run_keeps_its_pace_and_draws_ten_times_a_second_at_most() {
    let runner = runner();
    let begun = std::time::Instant::now();
    let line = "$PROGRAM sim small.sim.toml --until 4 --no-pictures --watch --pace 2 --out shown";
    let Some(text) = on_terminal(&runner, line) else {
        return;
    };
    let took_s = begun.elapsed().as_secs_f64();
    assert!(took_s > 1.9, "{took_s} s for 4 s at twice the pace");
    let frames = drawn(&text).1.matches("\u{1b}[1;1H").count();
    assert!(
        (2..=1 + (10.0 * took_s) as usize).contains(&frames),
        "{frames} frames in {took_s} s"
    );
    assert!(text.contains("code 1"), "{text}");
}

#[test]
fn a_watched_run_that_is_asked_to_end_gives_the_terminal_back_and_writes_what_it_has() {
    let runner = runner();
    let line =
        "timeout --foreground -s INT 2 $PROGRAM sim small.sim.toml --watch --pace 0.1 --out shown";
    let Some(text) = on_terminal(&runner, line) else {
        return;
    };
    let (_, _, after) = drawn(&text);
    assert!(
        !after.contains('\u{1b}') && after.contains("NOT finished: it was asked to stop"),
        "{text}"
    );
    assert!(runner.path("shown/summary.json").exists());
}

#[test]
fn what_cannot_be_watched_is_refused_before_anything_is_run() {
    let runner = runner();
    runner.refused(
        &["sim", "small.sim.toml", "--watch"],
        &["--watch", "standard error is no terminal"],
    );
    runner.refused(
        &["sim", "small.sim.toml", "--watch", "--trials", "2"],
        &["--watch", "--trials"],
    );
    runner.refused(&["sim", "small.sim.toml", "--pace", "2"], &["--watch"]);
    for pace in ["0", "-1", "nan", "inf", "1e9", "fast"] {
        runner.refused(
            &["sim", "small.sim.toml", "--watch", "--pace", pace],
            &["--pace", pace],
        );
    }
    let line = "TERM=dumb $PROGRAM sim small.sim.toml --watch --out shown";
    let Some(text) = on_terminal(&runner, line) else {
        return;
    };
    assert!(
        text.contains("cannot move its cursor") && text.contains("code 2"),
        "{text}"
    );
    assert!(
        !text.contains('\u{1b}') && !runner.path("shown").exists(),
        "{text}"
    );
}

#[test]
fn progress_is_shown_on_a_terminal_only_and_changes_no_byte() {
    let runner = runner();
    let quiet = runner.run(&["sim", "small.sim.toml", "--out", "quiet"]);
    assert_eq!((quiet.code, quiet.err.as_str()), (0, ""));
    assert!(
        !quiet.out.contains('\u{1b}') && !quiet.out.contains('\r'),
        "{quiet:?}"
    );
    let Some(output) = on_terminal(&runner, "$PROGRAM sim small.sim.toml --out shown") else {
        return;
    };
    assert!(
        output.contains("\u{1b}[") && output.contains("lap "),
        "{output}"
    );
    for name in [
        "run.log",
        "links.csv",
        "empty.csv",
        "image.npy",
        "image.png",
        "map.png",
    ] {
        assert_eq!(
            runner.read(&format!("quiet/{name}")),
            runner.read(&format!("shown/{name}")),
            "{name}"
        );
    }
}
