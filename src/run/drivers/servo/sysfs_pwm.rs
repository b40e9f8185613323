//! A channel of a PWM chip of the kernel, by the files below the chip's folder: export, period, polarity where it is the wrong
//! one, pulse, enable, in this order. It knows nothing of angles, and gives no pulse that it is not told.

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::hw::pulse::PERIOD;

/// The files of a channel may be written so long after it was exported: their owner is changed by another program (udev).
const WRITABLE_WITHIN: Duration = Duration::from_secs(2);
/// And this often it is tried.
const TRIED_EVERY: Duration = Duration::from_millis(20);

/// Of a folder without the file by which channels are asked for.
const NO_CHIP: &str = "it is no PWM chip; a folder such as /sys/class/pwm/pwmchip0 is needed, which has a file `export`";

/// A channel of a chip.
pub(super) struct Chip {
    /// The folder of the chip.
    pub(super) folder: PathBuf,
    /// The number of the channel.
    pub(super) channel: usize,
}

impl Chip {
    fn channel_folder(&self) -> PathBuf {
        self.folder.join(format!("pwm{}", self.channel))
    }

    /// Looks whether the channel could be opened, and writes nothing: what it gives now goes on.
    ///
    /// # Errors
    /// In words: there is no such channel, or which file may not be written.
    pub(super) fn could_be_opened(&self) -> Result<(), String> {
        let channel = self.channel_folder();
        if channel.is_dir() {
            let files = ["period", "duty_cycle", "enable"];
            return files
                .iter()
                .try_for_each(|file| may_be_written(&channel.join(file)).map_err(String::from));
        }
        may_be_written(&self.folder.join("export")).map_err(|failed| {
            match failed.error.kind() {
                io::ErrorKind::NotFound => NO_CHIP.to_owned(),
                _ => failed.into(),
            }
        })?;
        match self.last_channel().is_some_and(|last| self.channel > last) {
            true => Err(self.without_channel()),
            false => Ok(()),
        }
    }

    /// Returns the highest number of a channel that it has, if it says so.
    fn last_channel(&self) -> Option<usize> {
        let count = std::fs::read_to_string(self.folder.join("npwm")).ok()?;
        count.trim().parse::<usize>().ok()?.checked_sub(1)
    }

    /// Returns in words that it has no such channel, and which it has.
    fn without_channel(&self) -> String {
        let has = self
            .last_channel()
            .map(|last| format!("; it has 0 to {last}"));
        format!(
            "it has no channel {}{}",
            self.channel,
            has.unwrap_or_default()
        )
    }
}

/// Who takes what is written.
pub(super) enum Files {
    /// The kernel.
    Kernel,
    /// A test.
    #[cfg(test)]
    Recorded(super::tests::Recorder),
}

impl Files {
    fn write(&self, file: &Path, text: &str) -> Result<(), Failed> {
        let written = match self {
            Files::Kernel => OpenOptions::new()
                .write(true)
                .open(file)
                .and_then(|mut open| open.write_all(text.as_bytes())),
            #[cfg(test)]
            Files::Recorded(recorder) => recorder.write(file, text),
        };
        written.map_err(|error| Failed {
            file: file.to_owned(),
            error,
        })
    }
}

/// Opens a file of the kernel, which changes nothing before something is written.
fn may_be_written(file: &Path) -> Result<(), Failed> {
    let opened = OpenOptions::new().write(true).open(file);
    opened.map(drop).map_err(|error| Failed {
        file: file.to_owned(),
        error,
    })
}

/// A file that cannot be written.
struct Failed {
    file: PathBuf,
    error: io::Error,
}

impl From<Failed> for String {
    fn from(failed: Failed) -> String {
        let help = match failed.error.kind() {
            io::ErrorKind::PermissionDenied => "; who is in its group may write it (mostly gpio)",
            _ => "",
        };
        format!("{}: {}{help}", failed.file.display(), failed.error)
    }
}

/// A channel that is ready for pulses.
pub(super) struct SysfsPwm {
    folder: PathBuf,
}

impl SysfsPwm {
    /// Exports the channel and sets its period; `pause` waits, and says whether to give up.
    ///
    /// # Errors
    /// In words, which file cannot be written.
    pub(super) fn open(
        chip: &Chip,
        files: &Files,
        pause: impl Fn(Duration) -> bool,
    ) -> Result<SysfsPwm, String> {
        let folder = chip.channel_folder();
        if !folder.exists() {
            let exported = files.write(&chip.folder.join("export"), &chip.channel.to_string());
            match exported {
                // Somebody else was faster.
                Err(failed) if failed.error.kind() == io::ErrorKind::ResourceBusy => {}
                Err(failed) if failed.error.kind() == io::ErrorKind::InvalidInput => {
                    return Err(chip.without_channel());
                }
                Err(failed) if failed.error.kind() == io::ErrorKind::NotFound => {
                    return Err(NO_CHIP.to_owned());
                }
                other => other?,
            }
        }
        let pwm = SysfsPwm { folder };
        let mut waited = Duration::ZERO;
        while let Err(failed) = pwm.set_period(files) {
            let may_come = matches!(
                failed.error.kind(),
                io::ErrorKind::PermissionDenied | io::ErrorKind::NotFound
            );
            if !may_come || waited >= WRITABLE_WITHIN || pause(TRIED_EVERY) {
                return Err(failed.into());
            }
            waited += TRIED_EVERY;
        }
        pwm.set_polarity(files)?;
        Ok(pwm)
    }

    /// Sets that a pulse is high, where somebody has left it the other way round. Some chips take that only while they give
    /// none.
    fn set_polarity(&self, files: &Files) -> Result<(), Failed> {
        let file = self.folder.join("polarity");
        let is_inverted =
            std::fs::read_to_string(&file).is_ok_and(|polarity| polarity.trim() == "inversed");
        if !is_inverted {
            return Ok(());
        }
        files.write(&file, "normal").or_else(|_| {
            files.write(&self.folder.join("enable"), "0")?;
            files.write(&file, "normal")
        })
    }

    /// Sets the time from one pulse to the next; a longer pulse than that was left by somebody goes first.
    fn set_period(&self, files: &Files) -> Result<(), Failed> {
        let (file, period) = (self.folder.join("period"), nanoseconds(PERIOD));
        match files.write(&file, &period) {
            Err(failed) if failed.error.kind() == io::ErrorKind::InvalidInput => {
                files.write(&self.folder.join("duty_cycle"), "0")?;
                files.write(&file, &period)
            }
            other => other,
        }
    }

    /// Gives a pulse from now on.
    ///
    /// # Errors
    /// In words, which file cannot be written; of a pulse that the chip refuses also which one, and what to look at.
    pub(super) fn give(&self, files: &Files, pulse: Duration) -> Result<(), String> {
        let why = |failed: Failed| self.why_no_pulse(failed, pulse);
        files
            .write(&self.folder.join("duty_cycle"), &nanoseconds(pulse))
            .map_err(why)?;
        files.write(&self.folder.join("enable"), "1").map_err(why)
    }

    /// Returns in words why a pulse is not given.
    fn why_no_pulse(&self, failed: Failed, pulse: Duration) -> String {
        if failed.error.kind() != io::ErrorKind::InvalidInput {
            return failed.into();
        }
        format!(
            "{}: {}; pulse {} ns of {} ns: does another program set period?",
            failed.file.display(),
            failed.error,
            nanoseconds(pulse),
            nanoseconds(PERIOD)
        )
    }
}

fn nanoseconds(span: Duration) -> String {
    span.as_nanos().to_string()
}
