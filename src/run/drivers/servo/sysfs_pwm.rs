//! A channel of a PWM chip of the kernel, by the files below the chip's folder: export, period, pulse, enable, in this order. It
//! knows nothing of angles, and gives no pulse that it is not told.

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::hw::pulse::PERIOD;

/// The files of a channel may be written so long after it was exported: their owner is changed by another program (udev).
const WRITABLE_WITHIN: Duration = Duration::from_secs(2);
/// And this often it is tried.
const TRIED_EVERY: Duration = Duration::from_millis(20);

/// A channel of a chip.
pub(super) struct Chip {
    /// The folder of the chip.
    pub(super) folder: PathBuf,
    /// The number of the channel.
    pub(super) channel: usize,
}

impl Chip {
    /// Returns in words that it has no such channel, and which it has.
    fn without_channel(&self) -> String {
        let count = std::fs::read_to_string(self.folder.join("npwm"));
        let last = count
            .ok()
            .and_then(|count| count.trim().parse::<usize>().ok()?.checked_sub(1));
        let has = last.map(|last| format!("; it has 0 to {last}"));
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
        let folder = chip.folder.join(format!("pwm{}", chip.channel));
        if !folder.exists() {
            let exported = files.write(&chip.folder.join("export"), &chip.channel.to_string());
            match exported {
                // Somebody else was faster.
                Err(failed) if failed.error.kind() == io::ErrorKind::ResourceBusy => {}
                Err(failed) if failed.error.kind() == io::ErrorKind::InvalidInput => {
                    return Err(chip.without_channel());
                }
                Err(failed) if failed.error.kind() == io::ErrorKind::NotFound => {
                    return Err(
                        "it is no PWM chip; a folder such as /sys/class/pwm/pwmchip0 is needed, which has a file `export`"
                            .to_owned(),
                    );
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
        Ok(pwm)
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
    /// In words, which file cannot be written.
    pub(super) fn give(&self, files: &Files, pulse: Duration) -> Result<(), String> {
        files.write(&self.folder.join("duty_cycle"), &nanoseconds(pulse))?;
        files.write(&self.folder.join("enable"), "1")?;
        Ok(())
    }
}

fn nanoseconds(span: Duration) -> String {
    span.as_nanos().to_string()
}
