//! An autopilot that speaks MAVLink, on a thread of its own: keeps the connection open for ever, and carries bytes to the
//! driver and what that says to the link and the connection. What messages mean is the driver's matter
//! ([`crate::mavlink::autopilot_driver`]).
//!
//! ```text
//!   connection ─bytes─► reader ─► driver ─► Report, Ack ─► link; readings ─► range driver
//!   connection ◄─bytes─ writer ◄─ driver ◄─ command ────── link
//! ```

use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use tomoswarm_proto::{AutopilotHealth, Fix, Sender as Node};

use super::connection::{Connection, FromConnection};
use crate::autopilot::{NumberedCommand, VehicleKind};
use crate::config::{Craft, MavlinkConnection, MavlinkPlace, PoseSource, VehicleFile};
use crate::mavlink::autopilot_driver::{
    DriverOut, MavlinkDriver, MavlinkDriverSettings, PlaceSource, ServoPulse, SwitchSettings,
};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::frames::{DroppedFrames, FrameReader, FrameWriter, MavAddress};
use crate::mavlink::signing::{PER_SECOND, Signing, key_from_hex};
use crate::node::Event;
use crate::run::clock::Clock;
use crate::run::drivers::EventSink;
use crate::run::drivers::range::{AutopilotReadings, range_settings};
use crate::run::drivers::reopening::Reopening;
use crate::run::mailbox::lock;
use crate::run::mavlink_port::signing_clock;
use crate::store::{lost_thread, replace};
use crate::time::Time;

/// The thread sleeps no longer than this.
const NAP: Duration = Duration::from_millis(200);
/// The component of a companion computer.
pub(super) const COMPANION: u8 = 191;
/// So many bytes without a frame are no MAVLink.
const BYTES_OF_NO_FRAME: u64 = 2_000;
/// The time of signatures is on disk so far ahead of what was said, and is written when that is half used.
const TIME_AHEAD: u64 = 60 * PER_SECOND;
/// A time of signatures that could not be written is tried again after this, in its units.
const TIME_AGAIN: u64 = PER_SECOND;
/// The link number in signatures of ours.
const SIGNED_LINK: u8 = 1;

/// An autopilot and the thread that speaks with it; dropping it ends the thread.
pub(super) struct MavlinkAutopilot {
    inbox: Sender<Inbound>,
    said: Arc<Mutex<Said>>,
    thread: Option<JoinHandle<()>>,
}

/// What others may ask the thread for.
#[derive(Default)]
struct Said {
    /// What is wrong, in words.
    trouble: Option<String>,
    health: Option<AutopilotHealth>,
    /// The pulse by which its servo stands.
    given_pulse: Option<ServoPulse>,
    /// What is wrong with its servo, in words.
    servo_trouble: Option<String>,
}

enum Inbound {
    Command(NumberedCommand),
    Fix(Node, Fix),
    Pulse(ServoPulse),
    /// Of the connection with this number.
    Connection(u64, FromConnection),
    End,
}

/// What the thread has.
struct Work {
    settings: MavlinkConnection,
    driver: MavlinkDriver,
    reader: FrameReader,
    writer: FrameWriter,
    signing: Option<StoredSigning>,
    connection: Option<Connection>,
    /// Number of the newest connection.
    number: u64,
    reopening: Reopening,
    bytes: u64,
    frames: u64,
    clock: Clock,
    events: EventSink,
    /// Takes what range sensors on it measure.
    readings: Option<AutopilotReadings>,
    own: Sender<Inbound>,
    said: Arc<Mutex<Said>>,
}

impl MavlinkAutopilot {
    /// Begins to connect.
    ///
    /// # Errors
    /// No thread can be started, or the key of signatures cannot be read.
    pub(super) fn start(
        settings: &MavlinkConnection,
        file: &VehicleFile,
        clock: Clock,
        (events, readings): (&EventSink, Option<&AutopilotReadings>),
    ) -> io::Result<MavlinkAutopilot> {
        let own = MavAddress {
            system: settings.own_system as u8,
            component: COMPANION,
        };
        let venue = &file.venue;
        let driver = MavlinkDriver::new(MavlinkDriverSettings {
            own,
            system: settings.system as u8,
            kind: match file.flight.craft {
                Craft::Rover => VehicleKind::Rover,
                Craft::Copter => VehicleKind::Copter,
            },
            frame: EarthFrame::new(venue.datum.geodetic(), venue.x_axis_bearing()),
            place: match settings.place {
                MavlinkPlace::Global => PlaceSource::Global,
                MavlinkPlace::Local => PlaceSource::Local,
            },
            sets_origin: settings.sets_origin,
            place_sd_min_m: settings.place_sd_min_m,
            switch: (settings.remote_channel > 0).then_some(SwitchSettings {
                channel: settings.remote_channel as u8,
                hold_us: settings.remote_hold_us as u16,
                return_us: settings.remote_return_us as u16,
            }),
            arms_without_failsafes: settings.arms_without_failsafes,
            takes_fixes: file.pose.source == PoseSource::External,
            ranges: range_settings(file),
        });
        let signing = StoredSigning::open(&settings.key_file, Path::new(&file.state_dir))?;
        let (inbox, waiting) = channel();
        let said = Arc::<Mutex<Said>>::default();
        let mut work = Work {
            settings: settings.clone(),
            driver,
            reader: FrameReader::default(),
            writer: FrameWriter::new(own),
            signing,
            connection: None,
            number: 0,
            reopening: Reopening::default(),
            bytes: 0,
            frames: 0,
            clock,
            events: events.clone(),
            readings: readings.cloned(),
            own: inbox.clone(),
            said: said.clone(),
        };
        let thread = std::thread::Builder::new()
            .name("autopilot".to_owned())
            .spawn(move || work.run(&waiting))?;
        Ok(MavlinkAutopilot {
            inbox,
            said,
            thread: Some(thread),
        })
    }

    /// Tells the autopilot what the link wants.
    pub(super) fn command(&self, command: &NumberedCommand) {
        // A thread that has ended speaks with nobody.
        let _ = self.inbox.send(Inbound::Command(command.clone()));
    }

    /// Tells it where something outside has measured the vehicle to be.
    pub(super) fn fix(&self, from: Node, fix: Fix) {
        // As above.
        let _ = self.inbox.send(Inbound::Fix(from, fix));
    }

    /// Gives a servo on it a pulse.
    pub(super) fn give_pulse(&self, pulse: ServoPulse) {
        // As above.
        let _ = self.inbox.send(Inbound::Pulse(pulse));
    }

    /// Returns the pulse by which a servo on it stands.
    pub(super) fn given_pulse(&self) -> Option<ServoPulse> {
        lock(&self.said).given_pulse
    }

    /// Returns what is wrong with a servo on it, in words.
    pub(super) fn servo_trouble(&self) -> Option<String> {
        lock(&self.said).servo_trouble.clone()
    }

    /// Returns what is wrong, in words.
    pub(super) fn trouble(&self) -> Option<String> {
        lost_thread(self.thread.as_ref()).or_else(|| lock(&self.said).trouble.clone())
    }

    /// Returns what the autopilot has said of its health; `None` before it was heard.
    pub(super) fn health(&self) -> Option<AutopilotHealth> {
        lock(&self.said).health.clone()
    }
}

impl Drop for MavlinkAutopilot {
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
            let now = self.clock.now();
            self.keep_open(now);
            let opens_at = self.reopening.deadline().unwrap_or(Time::NEVER);
            let due = self.driver.deadline().min(opens_at);
            let is_deaf = self.connection.as_ref().is_some_and(Connection::is_deaf);
            let inbound = match inbox.recv_timeout(due.since(now).min(NAP)) {
                Ok(inbound) => Some(inbound),
                // Whatever its reader has said, also of its end, was there before it ended.
                Err(RecvTimeoutError::Timeout) if is_deaf => {
                    let why = "the thread that reads it has ended".to_owned();
                    let ended = FromConnection::Ended(why);
                    Some(Inbound::Connection(self.number, ended))
                }
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return,
            };
            let now = self.clock.now();
            let mut out = Vec::new();
            match inbound {
                Some(Inbound::End) => return,
                Some(Inbound::Command(command)) => self.driver.command(now, &command, &mut out),
                Some(Inbound::Pulse(pulse)) => self.driver.give_pulse(now, pulse, &mut out),
                Some(Inbound::Fix(from, fix)) => self.driver.hear_fix(now, from, &fix, &mut out),
                Some(Inbound::Connection(number, said)) if number == self.number => {
                    self.hear(now, said, &mut out);
                }
                // Of a connection that was given up.
                Some(Inbound::Connection(..)) | None => {}
            }
            if self.driver.deadline() <= now {
                self.driver.due(now, &mut out);
            }
            self.carry_out(now, out);
            self.tell_trouble(now);
        }
    }

    /// Opens the connection when it is closed and its time has come.
    fn keep_open(&mut self, now: Time) {
        if self.reopening.deadline().is_none_or(|at| now < at) {
            return;
        }
        self.number += 1;
        let (own, number) = (self.own.clone(), self.number);
        let told = move |said| {
            // A driver that has ended needs no more.
            let _ = own.send(Inbound::Connection(number, said));
        };
        let baud = self.settings.baud as u32;
        match Connection::open(&self.settings.endpoint, baud, told) {
            Ok(connection) => {
                self.connection = Some(connection);
                self.reopening.opened();
                self.driver.reconnected(now);
                (self.bytes, self.frames, self.reader) = (0, 0, FrameReader::default());
            }
            Err(error) => self.close(now, error.to_string()),
        }
    }

    fn close(&mut self, now: Time, why: String) {
        self.connection = None;
        self.reopening.gone(now, why, self.frames > 0);
    }

    fn hear(&mut self, now: Time, said: FromConnection, out: &mut Vec<DriverOut>) {
        let bytes = match said {
            FromConnection::Bytes(bytes) => bytes,
            FromConnection::Ended(why) => return self.close(now, why),
        };
        self.bytes += bytes.len() as u64;
        self.reader.push(&bytes);
        let mut signing = self.signing.as_mut().map(|stored| &mut stored.signing);
        while let Some(frame) = self.reader.next(signing.as_deref_mut()) {
            self.frames += 1;
            self.driver.hear(now, &frame, out);
        }
    }

    fn carry_out(&mut self, now: Time, out: Vec<DriverOut>) {
        let mut bytes = Vec::new();
        if let Some(stored) = &mut self.signing {
            stored.keep_ahead();
        }
        for said in out {
            match said {
                DriverOut::Say(message) => {
                    let signing = self.signing.as_mut().map(|stored| &mut stored.signing);
                    self.writer.write(&message, signing, &mut bytes);
                }
                DriverOut::Report(report) => (self.events)(Event::Report(report)),
                DriverOut::Ack(ack) => (self.events)(Event::Ack(ack)),
                DriverOut::Reading(reading) => {
                    if let Some(readings) = &self.readings {
                        readings.take(reading);
                    }
                }
                DriverOut::Text { text, warns: true } => tracing::warn!("autopilot: {text}"),
                DriverOut::Text { text, warns: false } => tracing::info!("autopilot: {text}"),
            }
        }
        if let (Some(connection), false) = (&mut self.connection, bytes.is_empty())
            && let Err(error) = connection.write(&bytes)
        {
            self.close(now, error.to_string());
        }
    }

    fn tell_trouble(&self, now: Time) {
        if let Some(readings) = &self.readings {
            readings.tell(self.driver.range_tallies());
        }
        let endpoint = self.settings.endpoint.in_words();
        let dropped = self.reader.dropped();
        let trouble = if let Some(why) = self.reopening.closed() {
            Some(format!("{endpoint}: {why}"))
        } else if let (0, Some(why)) = (self.frames, no_frame(&self.settings, dropped, self.bytes))
        {
            Some(why)
        } else {
            self.driver
                .trouble(now)
                .map(|trouble| format!("{endpoint}: {trouble}"))
        };
        *lock(&self.said) = Said {
            trouble,
            health: self.driver.health(now),
            given_pulse: self.driver.given_pulse(),
            servo_trouble: self
                .driver
                .servo_trouble(now)
                .map(|trouble| trouble.to_string()),
        };
    }
}

/// Returns why none of what was heard is understood, in words; `None` when next to nothing was heard.
pub(super) fn no_frame(
    settings: &MavlinkConnection,
    dropped: DroppedFrames,
    bytes: u64,
) -> Option<String> {
    let endpoint = settings.endpoint.in_words();
    if dropped.untrusted > 0 {
        return Some(format!(
            "{endpoint}: none of {} frames is signed with the key in {}",
            dropped.untrusted, settings.key_file
        ));
    }
    (bytes > BYTES_OF_NO_FRAME).then(|| {
        format!(
            "{endpoint}: {bytes} bytes and no MAVLink among them; is {} its baud rate?",
            settings.baud
        )
    })
}

/// Signatures, with their time on disk: a Raspberry Pi has no clock that survives a night.
pub(super) struct StoredSigning {
    pub(super) signing: Signing,
    path: PathBuf,
    /// The time that is surely on disk.
    stored: u64,
    /// A later one, and the thread that writes it.
    writing: Option<(u64, JoinHandle<io::Result<()>>)>,
    /// What could not be written is tried again then; 0 = it could.
    again_at: u64,
}

impl StoredSigning {
    /// Reads the key; `None` when none is named.
    ///
    /// # Errors
    /// The file cannot be read, or holds no key.
    pub(super) fn open(key_file: &str, state_dir: &Path) -> io::Result<Option<StoredSigning>> {
        if key_file.is_empty() {
            return Ok(None);
        }
        let text = std::fs::read_to_string(key_file)
            .map_err(|error| io::Error::new(error.kind(), format!("{key_file}: {error}")))?;
        let key = key_from_hex(&text).ok_or_else(|| {
            let why = format!("{key_file}: holds no key; expected 64 hexadecimal digits");
            io::Error::new(io::ErrorKind::InvalidData, why)
        })?;
        let path = state_dir.join("mavlink-time");
        let stored = std::fs::read_to_string(&path).ok();
        let stored = stored
            .and_then(|text| text.trim().parse::<u64>().ok())
            .unwrap_or(0);
        let mut signing = Signing::new(key, SIGNED_LINK, stored.saturating_add(1));
        signing.tick(signing_clock());
        let mut signing = StoredSigning {
            signing,
            path,
            stored,
            writing: None,
            again_at: 0,
        };
        signing.keep_ahead();
        Ok(Some(signing))
    }

    /// Sees to it that the time on disk is ahead of what is said: after a crash nothing is said twice. As long as it is ahead
    /// the next one is written beside: a vehicle whose driver waits for a disk brakes.
    pub(super) fn keep_ahead(&mut self) {
        self.signing.tick(signing_clock());
        let written = self.writing.take_if(|(_, writer)| writer.is_finished());
        self.take_written(written);
        let time = self.signing.time();
        if time + TIME_AHEAD / 2 < self.stored || time < self.again_at {
            return;
        }
        let (ahead, path) = (time + TIME_AHEAD, self.path.clone());
        if time >= self.stored {
            // It begins, or the machine's clock was set. No two write under one name.
            let written = self.writing.take();
            self.take_written(written);
            let written = replace(&path, &format!("{ahead}\n"));
            return self.note(ahead, written);
        }
        if self.writing.is_none() {
            let writer = std::thread::Builder::new()
                .name("autopilot time".to_owned())
                .spawn(move || replace(&path, &format!("{ahead}\n")));
            match writer {
                Ok(writer) => self.writing = Some((ahead, writer)),
                Err(error) => self.note(ahead, Err(error)),
            }
        }
    }

    /// Waits for a thread that has written, and notes what became of it.
    fn take_written(&mut self, written: Option<(u64, JoinHandle<io::Result<()>>)>) {
        if let Some((ahead, writer)) = written {
            let ended = || Err(io::Error::other("its thread has ended"));
            let written = writer.join().unwrap_or_else(|_| ended());
            self.note(ahead, written);
        }
    }

    /// Notes whether a time is on disk.
    fn note(&mut self, ahead: u64, written: io::Result<()>) {
        match written {
            Ok(()) => (self.stored, self.again_at) = (ahead, 0),
            Err(error) => {
                if self.again_at == 0 {
                    tracing::warn!("{}: {error}", self.path.display());
                }
                self.again_at = self.signing.time() + TIME_AGAIN;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_autopilot_whose_thread_has_ended_is_in_trouble() {
        let autopilot = MavlinkAutopilot {
            inbox: channel().0,
            said: Arc::default(),
            thread: Some(std::thread::spawn(|| {})),
        };
        while autopilot.trouble().is_none() {
            std::thread::yield_now();
        }
        let trouble = autopilot.trouble().unwrap();
        assert!(trouble.contains("its thread has ended"), "{trouble}");
    }

    #[test]
    fn a_time_of_signatures_counts_as_stored_only_when_it_is_on_disk() {
        let folder = tempfile::tempdir().unwrap();
        let (key, path) = (
            folder.path().join("key"),
            folder.path().join("mavlink-time"),
        );
        std::fs::write(&key, "a5".repeat(32)).unwrap();
        let in_the_way = folder.path().join("mavlink-time.new");
        std::fs::create_dir(&in_the_way).unwrap();
        let open = || StoredSigning::open(&key.display().to_string(), folder.path());
        let mut signing = open().unwrap().unwrap();
        assert_eq!(signing.stored, 0);
        assert!(!path.exists() && signing.again_at > signing.signing.time());
        std::fs::remove_dir(&in_the_way).unwrap();
        let on_disk = || std::fs::read_to_string(&path).unwrap_or_default();
        signing.again_at = signing.signing.time();
        signing.keep_ahead();
        assert!(signing.stored > signing.signing.time());
        assert_eq!(on_disk(), format!("{}\n", signing.stored));
        // What is still ahead is written beside, and counts when it is there.
        let before = signing.signing.time() + TIME_AHEAD / 4;
        signing.stored = before;
        while signing.stored == before {
            signing.keep_ahead();
        }
        assert_eq!(on_disk(), format!("{}\n", signing.stored));
        assert!(signing.stored > before && !in_the_way.exists());
        assert!(open().unwrap().unwrap().signing.time() > before);
    }
}
