//! Serial ports of this machine, each for this process alone.

use std::io;
use std::path::Path;
use std::time::Duration;

use rustix::fs::{FlockOperation, Mode, OFlags};
use serial2::{SerialPort, StopBits};

/// How bytes go over a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct LineFormat {
    baud: u32,
    stop_bits: StopBits,
}

impl LineFormat {
    /// Of devices that say what they mean: one stop bit behind every byte.
    pub(super) fn of_device(baud: u32) -> LineFormat {
        let stop_bits = StopBits::One;
        LineFormat { baud, stop_bits }
    }

    /// Of an XBee: two stop bits. An S1 at 115,200 baud runs at 111,111, and loses bytes of a packet that come without a pause;
    /// what a module says has one stop bit, and is read alike.
    pub(super) fn of_xbee(baud: u32) -> LineFormat {
        let stop_bits = StopBits::Two;
        LineFormat { baud, stop_bits }
    }
}

/// Opens a port for this process alone. It is locked before anything is set: another program's port stays as it is. Who
/// reads it waits so long for bytes.
///
/// # Errors
/// It is not there, is no port, or is in use.
pub(super) fn open(port: &str, format: LineFormat, waits: Duration) -> io::Result<SerialPort> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let file = rustix::fs::open(Path::new(port), flags, Mode::empty())?;
    rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive)?;
    if !rustix::termios::isatty(&file) {
        return Err(rustix::io::Errno::NOTTY.into());
    }
    rustix::termios::ioctl_tiocexcl(&file)?;
    let mut port = SerialPort::from(file);
    set_format(&mut port, format)?;
    port.set_read_timeout(waits)?;
    port.set_write_timeout(waits)?;
    port.discard_input_buffer()?;
    Ok(port)
}

/// Sets how bytes go over a port.
///
/// # Errors
/// It has gone.
pub(super) fn set_format(port: &mut SerialPort, format: LineFormat) -> io::Result<()> {
    let mut settings = port.get_configuration()?;
    settings.set_raw();
    settings.set_baud_rate(format.baud)?;
    settings.set_stop_bits(format.stop_bits);
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
        // Who waits for bytes in vain asks nobody for words.
        io::ErrorKind::TimedOut => "it takes no bytes".to_owned(),
        _ if error.raw_os_error() == Some(rustix::io::Errno::NOTTY.raw_os_error()) => {
            "it is no serial port".to_owned()
        }
        _ if error.raw_os_error() == Some(rustix::io::Errno::IO.raw_os_error()) => {
            "it has gone".to_owned()
        }
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    use super::*;

    #[test]
    fn why_a_port_is_closed_is_said_with_what_helps() {
        use rustix::io::Errno;
        for (errno, expected) in [
            (
                Errno::ACCESS,
                "Permission denied (os error 13); who is in its group may open it (mostly dialout)",
            ),
            (
                Errno::PERM,
                "Operation not permitted (os error 1); who is in its group may open it (mostly dialout)",
            ),
            (
                Errno::NOENT,
                "No such file or directory (os error 2); a serial port is needed (ls /dev/serial/by-id)",
            ),
            (Errno::WOULDBLOCK, "another program uses it"),
            (Errno::BUSY, "another program uses it"),
            (Errno::ISDIR, "it is a directory, no serial port"),
            (Errno::NOTTY, "it is no serial port"),
            (Errno::IO, "it has gone"),
            (Errno::NXIO, "No such device or address (os error 6)"),
        ] {
            assert_eq!(in_words(&errno.into()), expected);
        }
        for (kind, expected) in [
            (io::ErrorKind::UnexpectedEof, "it has gone"),
            (io::ErrorKind::TimedOut, "it takes no bytes"),
        ] {
            assert_eq!(in_words(&kind.into()), expected);
        }
    }

    #[test]
    fn an_xbee_gets_two_stop_bits_at_whatever_baud_rate_and_other_devices_one() {
        let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&line).unwrap();
        unlockpt(&line).unwrap();
        let path = ptsname(&line, Vec::new()).unwrap();
        let port = |format| open(path.to_str().unwrap(), format, Duration::from_millis(1)).unwrap();
        let stops = |port: &SerialPort| port.get_configuration().unwrap().get_stop_bits().unwrap();
        let mut module = port(LineFormat::of_xbee(115_200));
        assert_eq!(stops(&module), StopBits::Two);
        set_format(&mut module, LineFormat::of_xbee(9_600)).unwrap();
        assert_eq!(stops(&module), StopBits::Two);
        drop(module);
        let device = port(LineFormat::of_device(115_200));
        assert_eq!(stops(&device), StopBits::One, "whoever had the port before");
    }
}
