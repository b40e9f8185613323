//! An XBee on a serial line, on two threads of its own: one reads the port and opens it anew for ever when it is gone, the
//! other lets the modem act. What bytes mean is the modem's matter ([`crate::hw::xbee_modem`]).
//!
//! ```text
//!   port ─bytes─► reader ─► modem ─► Heard, Unsent ─► radio actor
//!   port ◄─bytes─────────── modem ◄─ beacon ───────── radio actor
//! ```

use std::io;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use serial2::SerialPort;
use tomoswarm_proto::{Beacon, RadioHealth};

use super::EventSink;
use crate::config::{VehicleFile, XbeePort};
use crate::hw::xbee_modem::{ModemOut, XbeeModem};
use crate::hw::xbee_registers::ModuleSettings;
use crate::node::Event;
use crate::run::clock::Clock;
use crate::run::drivers::reopening::Reopening;
use crate::run::drivers::serial_port::{LineFormat, in_words, open};
use crate::run::mailbox::lock;
use crate::store::lost_thread;
use crate::time::Time;

/// A reader looks this often whether it shall end.
const READ_FOR: Duration = Duration::from_millis(50);
/// The modem's thread sleeps no longer than this.
const NAP: Duration = Duration::from_millis(500);

/// A module and the threads that speak with it; dropping it ends them.
pub(super) struct XbeeRadio {
    inbox: Sender<Inbound>,
    status: Arc<Mutex<RadioStatus>>,
    thread: Option<JoinHandle<()>>,
}

/// What others may ask for.
#[derive(Default)]
struct RadioStatus {
    /// What is wrong, in words.
    trouble: Option<String>,
    health: RadioHealth,
}

enum Inbound {
    Transmit(Beacon),
    /// Of the port with this number: bytes, or why it has gone.
    Port(u64, Result<Vec<u8>, io::Error>),
    End,
}

/// What the thread has.
struct Work {
    port: XbeePort,
    modem: XbeeModem,
    open: Option<OpenPort>,
    /// Number of the newest port.
    number: u64,
    reopening: Reopening,
    has_read: bool,
    clock: Clock,
    events: EventSink,
    own: Sender<Inbound>,
    status: Arc<Mutex<RadioStatus>>,
}

/// A port and the thread that reads it; dropping it closes the port.
struct OpenPort {
    port: Arc<SerialPort>,
    is_closed: Arc<Mutex<bool>>,
    reader: Option<JoinHandle<()>>,
}

impl XbeeRadio {
    /// Begins to look for the module.
    ///
    /// # Errors
    /// No thread can be started.
    pub(super) fn start(
        port: &XbeePort,
        file: &VehicleFile,
        clock: Clock,
        events: EventSink,
    ) -> io::Result<XbeeRadio> {
        let settings = ModuleSettings::of_venue(file.id, &file.venue, file.radio.power_dbm);
        let (inbox, waiting) = channel();
        let status = Arc::<Mutex<RadioStatus>>::default();
        let mut work = Work {
            port: port.clone(),
            modem: XbeeModem::new(settings).on_port(port),
            open: None,
            number: 0,
            reopening: Reopening::default(),
            has_read: false,
            clock,
            events,
            own: inbox.clone(),
            status: status.clone(),
        };
        let thread = std::thread::Builder::new()
            .name("radio".to_owned())
            .spawn(move || work.run(&waiting))?;
        Ok(XbeeRadio {
            inbox,
            status,
            thread: Some(thread),
        })
    }

    /// Sends a beacon.
    pub(super) fn transmit(&self, beacon: &Beacon) {
        // A thread that has ended speaks with nobody.
        let _ = self.inbox.send(Inbound::Transmit(beacon.clone()));
    }

    /// Returns what is wrong, in words.
    pub(super) fn trouble(&self) -> Option<String> {
        lost_thread(self.thread.as_ref()).or_else(|| lock(&self.status).trouble.clone())
    }

    /// Returns what it has done.
    pub(super) fn health(&self) -> RadioHealth {
        lock(&self.status).health
    }
}

impl Drop for XbeeRadio {
    fn drop(&mut self) {
        let _ = self.inbox.send(Inbound::End);
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has ended, too.
            let _ = thread.join();
        }
    }
}

impl Work {
    fn run(&mut self, inbox: &Receiver<Inbound>) {
        loop {
            let mut out = Vec::new();
            let now = self.clock.now();
            self.keep_open(now, &mut out);
            self.carry_out(now, out);
            let due = self.reopening.deadline().or_else(|| self.modem.deadline());
            let due = due.unwrap_or(Time::NEVER);
            let is_deaf = self.open.as_ref().is_some_and(OpenPort::is_deaf);
            let inbound = match inbox.recv_timeout(due.since(now).min(NAP)) {
                Ok(inbound) => Some(inbound),
                // Whatever its reader has said, also of its end, was there before it ended.
                Err(RecvTimeoutError::Timeout) if is_deaf => {
                    let why = io::Error::other("the thread that reads it has ended");
                    Some(Inbound::Port(self.number, Err(why)))
                }
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return,
            };
            let (now, mut out) = (self.clock.now(), Vec::new());
            match inbound {
                Some(Inbound::End) => return,
                Some(Inbound::Transmit(beacon)) => self.modem.send(now, beacon, &mut out),
                Some(Inbound::Port(number, Ok(bytes))) if number == self.number => {
                    self.has_read = true;
                    self.modem.take(now, &bytes, &mut out);
                }
                Some(Inbound::Port(number, Err(error))) if number == self.number => {
                    self.close(now, &error, &mut out);
                }
                // Of a port that was given up.
                Some(Inbound::Port(..)) | None => {}
            }
            self.modem.due(now, &mut out);
            self.carry_out(now, out);
            self.tell(now);
        }
    }

    /// Opens the port when it is closed and its time has come.
    fn keep_open(&mut self, now: Time, out: &mut Vec<ModemOut>) {
        if self.reopening.deadline().is_none_or(|at| now < at) {
            return;
        }
        self.number += 1;
        let (own, number) = (self.own.clone(), self.number);
        let told = move |said| {
            // A driver that has ended needs no more.
            let _ = own.send(Inbound::Port(number, said));
        };
        match OpenPort::open(&self.port, told) {
            Ok(open) => {
                (self.open, self.has_read) = (Some(open), false);
                self.reopening.opened();
                self.modem.opened(now, out);
            }
            Err(error) => self.close(now, &error, out),
        }
    }

    fn close(&mut self, now: Time, why: &io::Error, out: &mut Vec<ModemOut>) {
        self.open = None;
        self.reopening.gone(now, in_words(why), self.has_read);
        self.modem.closed(out);
    }

    fn carry_out(&mut self, now: Time, out: Vec<ModemOut>) {
        let mut failed = None;
        for said in out {
            match said {
                ModemOut::Write(bytes) => {
                    if let Some(open) = &self.open
                        && let Err(error) = open.port.write_all(&bytes)
                    {
                        failed = Some(error);
                    }
                }
                ModemOut::Heard(heard) => (self.events)(Event::Heard(heard)),
                ModemOut::Unsent(number) => (self.events)(Event::Unsent(number)),
            }
        }
        if let Some(error) = failed {
            let mut out = Vec::new();
            self.close(now, &error, &mut out);
            self.carry_out(now, out);
        }
    }

    fn tell(&self, now: Time) {
        let port = &self.port.port;
        let troubles = self.modem.troubles(now);
        let trouble = match self.reopening.closed() {
            Some(why) => Some(why.clone()),
            None => troubles.first().map(ToString::to_string),
        };
        *lock(&self.status) = RadioStatus {
            trouble: trouble.map(|trouble| format!("{port}: {trouble}")),
            health: self.modem.health(),
        };
    }
}

impl OpenPort {
    /// Opens a port; `told` gets its bytes and its end, on a thread of its own.
    fn open(
        port: &XbeePort,
        told: impl Fn(Result<Vec<u8>, io::Error>) + Send + 'static,
    ) -> io::Result<OpenPort> {
        let format = LineFormat::of_xbee(port.baud);
        let port = Arc::new(open(&port.port, format, READ_FOR)?);
        let is_closed = Arc::<Mutex<bool>>::default();
        let (read, is_over) = (port.clone(), is_closed.clone());
        let reader = std::thread::Builder::new()
            .name("radio bytes".to_owned())
            .spawn(move || listen(&read, &is_over, &told))?;
        Ok(OpenPort {
            port,
            is_closed,
            reader: Some(reader),
        })
    }

    /// Returns whether the thread that reads it has ended.
    fn is_deaf(&self) -> bool {
        self.reader.as_ref().is_some_and(JoinHandle::is_finished)
    }
}

impl Drop for OpenPort {
    fn drop(&mut self) {
        *lock(&self.is_closed) = true;
        if let Some(reader) = self.reader.take() {
            // A thread that panicked has ended, too.
            let _ = reader.join();
        }
    }
}

fn listen(port: &SerialPort, is_closed: &Mutex<bool>, told: &impl Fn(Result<Vec<u8>, io::Error>)) {
    let mut bytes = [0; 512];
    while !*lock(is_closed) {
        match port.read(&mut bytes) {
            Ok(0) => return told(Err(io::ErrorKind::UnexpectedEof.into())),
            Ok(count) => told(Ok(bytes[..count].to_vec())),
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
                ) => {}
            Err(error) => return told(Err(error)),
        }
    }
}

#[cfg(test)]
mod tests;
