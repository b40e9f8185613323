//! A visit to an autopilot for its parameters, without a vehicle's process: opens the connection of its file, says and
//! hears what the visit does ([`crate::mavlink::parameter_visit`]), and closes it.

use std::io;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};

use super::connection::{Connection, FromConnection};
use super::mavlink::{COMPANION, StoredSigning, no_frame};
use crate::config::MavlinkConnection;
use crate::mavlink::dialect::MavMessage;
use crate::mavlink::frames::{AUTOPILOT, FrameReader, FrameWriter, MavAddress};
use crate::mavlink::parameter_visit::{ParameterVisit, VisitEnd};
use crate::run::clock::Clock;

/// Why there was no visit.
#[derive(Debug, thiserror::Error)]
pub enum VisitError {
    /// The key of signatures cannot be used.
    #[error(transparent)]
    Key(io::Error),
    /// There is no connection, or it has ended.
    #[error("{endpoint}: {why}")]
    Connection {
        /// Where it is, as in the file.
        endpoint: String,
        /// Why, in words.
        why: String,
    },
    /// What is heard is not understood.
    #[error("{0}")]
    NoFrame(String),
}

/// Reads the parameters of an autopilot, and sets some of them.
///
/// # Errors
/// It cannot be reached, or says nothing that can be understood.
pub fn visit(
    settings: &MavlinkConnection,
    state_dir: &Path,
    changes: Vec<(String, f32)>,
) -> Result<VisitEnd, VisitError> {
    let broken = |why: String| VisitError::Connection {
        endpoint: settings.endpoint.in_words(),
        why,
    };
    let mut signing =
        StoredSigning::open(&settings.key_file, state_dir).map_err(VisitError::Key)?;
    let (told, inbox) = channel();
    let tell = move |said| {
        // Who has ended the visit hears no more.
        let _ = told.send(said);
    };
    let mut connection = Connection::open(&settings.endpoint, settings.baud as u32, tell)
        .map_err(|error| broken(error.to_string()))?;
    let mut reader = FrameReader::default();
    let mut writer = FrameWriter::new(MavAddress {
        system: settings.own_system as u8,
        component: COMPANION,
    });
    let of = MavAddress {
        system: settings.system as u8,
        component: AUTOPILOT,
    };
    let clock = Clock::start();
    let (mut bytes, mut frames) = (0, 0_u64);
    let mut said = Vec::new();
    let mut visit = ParameterVisit::begin(clock.now(), of, changes, &mut said);
    loop {
        write(&mut connection, &mut writer, signing.as_mut(), &mut said)
            .map_err(|error| broken(error.to_string()))?;
        let mut end = None;
        match inbox.recv_timeout(visit.deadline().since(clock.now())) {
            Ok(FromConnection::Bytes(heard)) => {
                bytes += heard.len() as u64;
                reader.push(&heard);
                let mut signing = signing.as_mut().map(|stored| &mut stored.signing);
                while let (None, Some(frame)) = (&end, reader.next(signing.as_deref_mut())) {
                    frames += 1;
                    end = visit.hear(clock.now(), &frame, &mut said);
                }
            }
            Ok(FromConnection::Ended(why)) => return Err(broken(why)),
            Err(RecvTimeoutError::Disconnected) => return Err(broken("it was closed".to_owned())),
            Err(RecvTimeoutError::Timeout) => {}
        }
        match end.or_else(|| visit.due(clock.now(), &mut said)) {
            None => {}
            Some(end) if frames > 0 => return Ok(end),
            Some(end) => {
                let why = no_frame(settings, reader.dropped(), bytes);
                return why.map_or(Ok(end), |why| Err(VisitError::NoFrame(why)));
            }
        }
    }
}

fn write(
    connection: &mut Connection,
    writer: &mut FrameWriter,
    mut signing: Option<&mut StoredSigning>,
    said: &mut Vec<MavMessage>,
) -> io::Result<()> {
    let mut bytes = Vec::new();
    if let Some(stored) = &mut signing {
        stored.keep_ahead();
    }
    for message in said.drain(..) {
        let signing = signing.as_mut().map(|stored| &mut stored.signing);
        writer.write(&message, signing, &mut bytes);
    }
    if bytes.is_empty() {
        return Ok(());
    }
    connection.write(&bytes)
}
