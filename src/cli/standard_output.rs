//! What a command says on the terminal: its answer on standard output, what went wrong on standard error.
//!
//! A reader who has heard enough (`| head`) is no fault: the rest is dropped and the command goes on, so that its
//! exit code and its files do not depend on who listens. Nothing here panics when a terminal is gone or a disk full.

use std::fmt::Display;
use std::io::{self, Stdout, Write};

/// Standard output, until nobody listens any more.
#[derive(Debug)]
pub(crate) struct StandardOutput<W: Write = Stdout> {
    out: W,
    is_closed: bool,
}

impl StandardOutput {
    /// Answers on standard output.
    pub(crate) fn on_stdout() -> StandardOutput {
        StandardOutput {
            out: io::stdout(),
            is_closed: false,
        }
    }

    /// Returns whether the reader is known to have left.
    #[cfg(feature = "net")]
    pub(crate) fn is_closed(&self) -> bool {
        self.is_closed
    }
}

impl<W: Write> StandardOutput<W> {
    /// Takes a closed pipe for the end of all interest.
    fn unless_closed<T>(&mut self, result: io::Result<T>, otherwise: T) -> io::Result<T> {
        match result {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                self.is_closed = true;
                Ok(otherwise)
            }
            result => result,
        }
    }
}

impl<W: Write> Write for StandardOutput<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.is_closed {
            return Ok(bytes.len());
        }
        let result = self.out.write(bytes);
        self.unless_closed(result, bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.is_closed {
            return Ok(());
        }
        let result = self.out.flush();
        self.unless_closed(result, ())
    }
}

/// Says something on standard error, as one line that begins with the program's name.
pub(super) fn complain(what: &dyn Display) {
    // There is nowhere left to say that standard error is gone; the exit code still tells.
    let _ = writeln!(io::stderr(), "tomoswarm: {what}");
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pipe whose reader goes away after some bytes.
    struct Pipe {
        room: usize,
        then: io::ErrorKind,
        asked: usize,
    }

    impl Write for Pipe {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.asked += 1;
            if self.room == 0 {
                return Err(self.then.into());
            }
            let taken = bytes.len().min(self.room);
            self.room -= taken;
            Ok(taken)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_reader_who_left_is_not_asked_again() {
        let out = Pipe {
            room: 3,
            then: io::ErrorKind::BrokenPipe,
            asked: 0,
        };
        let mut answer = StandardOutput {
            out,
            is_closed: false,
        };
        assert!(answer.write_all(b"twelve bytes").is_ok());
        assert!(answer.write_all(b"more").is_ok());
        assert_eq!(answer.out.asked, 2);
    }

    #[test]
    fn a_full_disk_is_reported() {
        let out = Pipe {
            room: 3,
            then: io::ErrorKind::StorageFull,
            asked: 0,
        };
        let error = StandardOutput {
            out,
            is_closed: false,
        }
        .write_all(b"twelve bytes")
        .unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
    }
}
