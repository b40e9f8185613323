//! Serial ports of this machine, each for this process alone.

use std::io;
use std::path::Path;
use std::time::Duration;

use rustix::fs::{FlockOperation, Mode, OFlags};
use serial2::{SerialPort, StopBits};

/// Opens a port for this process alone. It is locked before anything is set: another program's port stays as it is. Who reads it
/// waits so long for bytes.
///
/// # Errors
/// It is not there, is no port, or is in use.
pub(super) fn open(port: &str, baud: u32, waits: Duration) -> io::Result<SerialPort> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let file = rustix::fs::open(Path::new(port), flags, Mode::empty())?;
    rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive)?;
    if !rustix::termios::isatty(&file) {
        return Err(rustix::io::Errno::NOTTY.into());
    }
    rustix::termios::ioctl_tiocexcl(&file)?;
    let mut port = SerialPort::from(file);
    set_baud(&mut port, baud)?;
    port.set_read_timeout(waits)?;
    port.set_write_timeout(waits)?;
    port.discard_input_buffer()?;
    Ok(port)
}

/// Sets the speed of a port, and two stop bits: every receiver takes bytes that come a little later, and an XBee of the first
/// series, whose clock is 3.6 % slow at 115,200 baud, loses those that follow each other at once.
///
/// # Errors
/// It has gone.
pub(super) fn set_baud(port: &mut SerialPort, baud: u32) -> io::Result<()> {
    let mut settings = port.get_configuration()?;
    settings.set_raw();
    settings.set_stop_bits(StopBits::Two);
    settings.set_baud_rate(baud)?;
    port.set_configuration(&settings)
}

/// Returns why a port is closed.
pub(super) fn in_words(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::WouldBlock | io::ErrorKind::ResourceBusy => {
            "another program uses it".to_owned()
        }
        io::ErrorKind::NotFound => {
            format!("{error}; a serial port is needed (ls /dev/serial/by-id)")
        }
        io::ErrorKind::PermissionDenied => {
            format!("{error}; who is in its group may open it (mostly dialout)")
        }
        io::ErrorKind::IsADirectory => "it is a directory, no serial port".to_owned(),
        io::ErrorKind::UnexpectedEof => "it has gone".to_owned(),
        _ if error.raw_os_error() == Some(rustix::io::Errno::NOTTY.raw_os_error()) => {
            "it is no serial port".to_owned()
        }
        _ if error.raw_os_error() == Some(rustix::io::Errno::IO.raw_os_error()) => {
            "it has gone".to_owned()
        }
        _ => error.to_string(),
    }
}
