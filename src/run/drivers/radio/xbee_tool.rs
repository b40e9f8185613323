//! What a person does with a module on a serial line, without a vehicle: setting it up, and looking at its registers. Opens
//! the port, carries bytes, and closes it; what they mean is said by [`crate::hw::xbee_setup`] and
//! [`crate::hw::xbee_registers`].

use std::io;
use std::time::Duration;

use serial2::SerialPort;

use crate::hw::xbee_frame::{ApiMode, Decoder};
use crate::hw::xbee_registers::{Answer, ReadState, RegisterReads, Registers};
use crate::hw::xbee_setup::{SetupError, SetupOut, SetupSettings, XbeeSetup};
use crate::run::clock::Clock;
use crate::run::drivers::serial_port::{LineFormat, in_words, open, set_format};
use crate::time::Time;

/// Bytes are waited for so long.
const READ_FOR: Duration = Duration::from_millis(10);

/// Why a module was not set up or looked at.
#[derive(Debug, thiserror::Error)]
pub enum XbeeToolError {
    /// The port cannot be opened, or has gone.
    #[error("{port}: {why}")]
    Port {
        /// Which port.
        port: String,
        /// Why, in words.
        why: String,
    },
    /// The module is not as it should be.
    #[error("{port}: {why}")]
    Module {
        /// Which port.
        port: String,
        /// What is wrong.
        why: SetupError,
    },
    /// Nothing answers.
    #[error(
        "{port}: no module answers at {baud} baud; `tomoswarm xbee setup` finds one at any baud rate"
    )]
    Silent {
        /// Which port.
        port: String,
        /// The baud rate.
        baud: u32,
    },
}

/// Finds the module at a port, sets its registers and keeps them; `found` is told where it was, its baud rate and whether
/// it spoke frames. Returns what it says of itself then.
///
/// # Errors
/// The port cannot be used, nothing answers, or the module does not take what it is told.
pub fn set_up(
    port: &str,
    settings: SetupSettings,
    found: &mut dyn FnMut(u32, Option<ApiMode>),
) -> Result<Registers, XbeeToolError> {
    let broken = |error: io::Error| XbeeToolError::Port {
        port: port.to_owned(),
        why: in_words(&error),
    };
    let mut line = open(port, LineFormat::of_xbee(settings.baud), READ_FOR).map_err(broken)?;
    let clock = Clock::start();
    let mut out = Vec::new();
    let mut setup = XbeeSetup::begin(clock.now(), settings, &mut out);
    loop {
        for said in std::mem::take(&mut out) {
            match said {
                SetupOut::Baud(baud) => {
                    // What was said at the rate before is on its way.
                    line.flush().map_err(broken)?;
                    set_format(&mut line, LineFormat::of_xbee(baud)).map_err(broken)?;
                    line.discard_buffers().map_err(broken)?;
                }
                SetupOut::Write(bytes) => line.write_all(&bytes).map_err(broken)?,
                SetupOut::Found { baud, mode } => found(baud, mode),
                SetupOut::Ended(ended) => {
                    return ended.map_err(|why| XbeeToolError::Module {
                        port: port.to_owned(),
                        why,
                    });
                }
            }
        }
        if let Some(bytes) = read(&line).map_err(broken)? {
            setup.take(clock.now(), &bytes, &mut out);
        }
        setup.due(clock.now(), &mut out);
    }
}

/// Reads the registers of the module at a port.
///
/// # Errors
/// The port cannot be used, or nothing answers.
pub fn registers(port: &str, baud: u32) -> Result<Registers, XbeeToolError> {
    let broken = |error: io::Error| XbeeToolError::Port {
        port: port.to_owned(),
        why: in_words(&error),
    };
    let line = open(port, LineFormat::of_xbee(baud), READ_FOR).map_err(broken)?;
    let clock = Clock::start();
    let (mut bytes, mut state) = (Vec::new(), ReadState::Asked);
    let mut decoder = Decoder::new(ApiMode::Escaped);
    let mut reads = RegisterReads::begin(clock.now(), ApiMode::Escaped, &mut bytes);
    while state == ReadState::Asked {
        line.write_all(&bytes).map_err(broken)?;
        bytes.clear();
        let mut answers = Vec::new();
        if let Some(read) = read(&line).map_err(broken)? {
            decoder.take(&read, |frame| answers.extend(Answer::of(&frame)));
        }
        let now: Time = clock.now();
        for answer in answers {
            let mode = reads.mode();
            state = reads.hear(now, &answer, &mut bytes);
            if reads.mode() != mode {
                decoder.restart(reads.mode());
            }
        }
        if state == ReadState::Asked {
            state = reads.due(now, &mut bytes);
        }
    }
    match state {
        ReadState::Silent => Err(XbeeToolError::Silent {
            port: port.to_owned(),
            baud,
        }),
        ReadState::Asked | ReadState::Read => Ok(reads.found().clone()),
    }
}

/// Returns what has come within a moment; `None` = nothing.
fn read(line: &SerialPort) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = [0; 512];
    match line.read(&mut bytes) {
        Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
        Ok(count) => Ok(Some(bytes[..count].to_vec())),
        Err(error)
            if matches!(
                error.kind(),
                io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
            ) =>
        {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}
