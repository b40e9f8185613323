//! One configuration given to the program: first to `check`, then to `sim`, and what became of it.

use std::path::Path;
use std::process::{Command, Output};

use super::configuration::Configuration;

/// What became of a configuration.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Verdict {
    /// `check` and `sim` refuse it.
    Refused,
    /// Everything was done.
    Finished,
    /// It ended otherwise, and says why.
    SaysWhy,
    /// It was cut off, and ends when it has more time.
    EndsLate,
    /// It goes on, however much time it has.
    NeverEnds,
    /// Something was touched that was to be heard.
    Contact,
    /// Something thin was touched, which nobody promises to hear.
    ThinContact,
    /// A fence was breached.
    Breach,
    /// Only one of `check` and `sim` takes it.
    CheckDiffers,
    /// The program panicked, or was stopped by an actor.
    Panic,
}

impl Verdict {
    /// Returns whether that must not be.
    pub fn is_wrong(self) -> bool {
        match self {
            Verdict::Refused
            | Verdict::Finished
            | Verdict::SaysWhy
            | Verdict::EndsLate
            | Verdict::ThinContact => false,
            Verdict::NeverEnds
            | Verdict::Contact
            | Verdict::Breach
            | Verdict::CheckDiffers
            | Verdict::Panic => true,
        }
    }

    /// Returns whether it was run.
    pub fn is_run(self) -> bool {
        self != Verdict::Refused
    }
}

/// A configuration that was tried.
pub struct Trial {
    pub kind: &'static str,
    pub verdict: Verdict,
    pub words: String,
}

/// Who was cut off has this long then, seconds.
const LATE_S: &str = "20000";
/// What is thinner than this is not promised to be heard in time at every speed that is drawn here, metres.
const THIN_M: f64 = 0.1;

impl Trial {
    /// Tries a configuration; one that goes wrong is left in a folder, if there is one.
    pub fn of(configuration: &Configuration, keep: Option<&Path>) -> Trial {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in configuration.files() {
            std::fs::write(folder.path().join(name), text).expect("a file");
        }
        let program = std::env::var_os("TOMOSWARM_FUZZ_PROGRAM")
            .unwrap_or_else(|| env!("CARGO_BIN_EXE_tomoswarm").into());
        let run = |arguments: &[&str]| {
            Command::new(&program)
                .args(arguments)
                .current_dir(folder.path())
                .output()
                .expect("the program runs")
        };
        let checked = run(&["check", "x.sim.toml"]);
        let simulate = ["sim", "x.sim.toml", "--no-pictures", "--out"];
        let ran = run(&[&simulate[..], &["out"]].concat());
        let out = folder.path().join("out");
        let (mut verdict, mut words) = judge(configuration, &checked, &ran, &out);
        if verdict == Verdict::NeverEnds {
            let ran = run(&[&simulate[..], &["late", "--until", LATE_S]].concat());
            let late = folder.path().join("late");
            (verdict, words) = judge(configuration, &checked, &ran, &late);
            if matches!(verdict, Verdict::Finished | Verdict::SaysWhy) {
                verdict = Verdict::EndsLate;
            }
        }
        if let Some(keep) = keep.filter(|_| verdict.is_wrong()) {
            let kept = keep.join(configuration.seed.to_string());
            std::fs::create_dir_all(&kept).expect("a folder to keep it");
            for (name, text) in configuration.files() {
                std::fs::write(kept.join(name), text).expect("a file");
            }
        }
        Trial {
            kind: configuration.kind,
            verdict,
            words,
        }
    }
}

fn judge(
    configuration: &Configuration,
    checked: &Output,
    ran: &Output,
    out: &Path,
) -> (Verdict, String) {
    let last_words = |output: &Output| {
        let text = String::from_utf8_lossy(&output.stderr);
        text.lines().rev().take(3).collect::<Vec<_>>().join(" | ")
    };
    let codes = (checked.status.code(), ran.status.code());
    match codes {
        (Some(2), Some(2)) => return (Verdict::Refused, last_words(checked)),
        (Some(0), Some(0 | 1)) => {}
        (Some(0), Some(2)) | (Some(2), Some(0 | 1)) => {
            return (Verdict::CheckDiffers, last_words(ran));
        }
        _ => return (Verdict::Panic, last_words(ran)),
    }
    let summary = std::fs::read_to_string(out.join("summary.json"));
    let Ok(summary) = summary.map_err(|error| error.to_string()).and_then(|text| {
        serde_json::from_str::<serde_json::Value>(&text).map_err(|error| error.to_string())
    }) else {
        return (Verdict::Panic, last_words(ran));
    };
    let why = summary["failure"].as_str().unwrap_or_default().to_owned();
    let count = |key: &str| summary[key].as_u64().unwrap_or(u64::MAX);
    let verdict = match () {
        () if count("collisions") > 0 && configuration.thinnest_m < THIN_M => Verdict::ThinContact,
        () if count("collisions") > 0 => Verdict::Contact,
        () if count("fence_breaches") > 0 => Verdict::Breach,
        () if why.contains("(until_s)") => Verdict::NeverEnds,
        () if why.is_empty() => Verdict::Finished,
        () => Verdict::SaysWhy,
    };
    (verdict, why)
}
