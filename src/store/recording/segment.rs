//! One file of a recording: an MCAP with JSON messages, so that Foxglove and the public tools open it.
//!
//! Whole chunks are written at once, so a file of a killed process is good up to its last chunk. What the messages
//! mean is not known here.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::WriteOptions;
use mcap::records::{MessageHeader, Metadata};

use super::schema::Schema;
use crate::time::Time;

/// A chunk is written when it is larger than this, bytes.
const CHUNK: u64 = 512 << 10;

/// Why a recording cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {reason}", path.display())]
pub struct WriteError {
    /// The file or folder.
    pub path: PathBuf,
    /// Why.
    pub reason: String,
}

impl WriteError {
    pub(super) fn at(path: &Path, reason: impl ToString) -> WriteError {
        WriteError {
            path: path.to_owned(),
            reason: reason.to_string(),
        }
    }
}

/// A channel of the file.
struct Channel {
    id: u16,
    sequence: u32,
}

/// One file of a recording, being written.
pub(super) struct Segment {
    path: PathBuf,
    writer: mcap::Writer<BufWriter<File>>,
    channels: BTreeMap<String, Channel>,
    opened: Time,
}

impl Segment {
    /// Creates a file; what it is about comes first.
    pub(super) fn create(
        path: &Path,
        opened: Time,
        about: &[(&str, BTreeMap<String, String>)],
    ) -> Result<Segment, WriteError> {
        let fail = |reason: String| WriteError::at(path, reason);
        let file = File::create_new(path).map_err(|error| fail(error.to_string()))?;
        let options = WriteOptions::new()
            .compression(None)
            .profile("")
            .library(concat!("tomoswarm ", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK))
            .disable_seeking(true);
        let writer = options
            .create(BufWriter::new(file))
            .map_err(|error| fail(words(&error)))?;
        let mut segment = Segment {
            path: path.to_owned(),
            writer,
            channels: BTreeMap::new(),
            opened,
        };
        for (name, values) in about {
            segment.metadata(name, values.clone())?;
        }
        Ok(segment)
    }

    /// Returns when it was begun.
    pub(super) fn opened(&self) -> Time {
        self.opened
    }

    /// Returns the file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a word about the whole file.
    pub(super) fn metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<(), WriteError> {
        let metadata = Metadata {
            name: name.to_owned(),
            metadata,
        };
        self.writer
            .write_metadata(&metadata)
            .map_err(|error| WriteError::at(&self.path, words(&error)))
    }

    /// Writes a message.
    pub(super) fn message(
        &mut self,
        topic: &str,
        schema: Schema,
        now: Time,
        json: &str,
    ) -> Result<(), WriteError> {
        self.put(topic, schema, now, json)
            .map_err(|error| WriteError::at(&self.path, words(&error)))
    }

    fn put(&mut self, topic: &str, schema: Schema, now: Time, json: &str) -> mcap::McapResult<()> {
        if !self.channels.contains_key(topic) {
            let schema =
                self.writer
                    .add_schema(schema.name(), "jsonschema", schema.text().as_bytes())?;
            let id = self
                .writer
                .add_channel(schema, topic, "json", &BTreeMap::new())?;
            self.channels
                .insert(topic.to_owned(), Channel { id, sequence: 0 });
        }
        let Some(channel) = self.channels.get_mut(topic) else {
            return Ok(());
        };
        channel.sequence = channel.sequence.wrapping_add(1);
        let (time, channel_id, sequence) = (now.as_nanos(), channel.id, channel.sequence);
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: time,
            publish_time: time,
        };
        self.writer.write_to_known_channel(&header, json.as_bytes())
    }

    /// Writes out all that was handed in; returns the size of the file, bytes.
    pub(super) fn flush(&mut self) -> Result<u64, WriteError> {
        self.writer
            .flush()
            .map_err(|error| WriteError::at(&self.path, words(&error)))?;
        std::fs::metadata(&self.path)
            .map(|file| file.len())
            .map_err(|error| WriteError::at(&self.path, error))
    }

    /// Writes the index and closes the file.
    pub(super) fn finish(mut self) -> Result<(), WriteError> {
        self.flush()?;
        self.writer
            .finish()
            .map_err(|error| WriteError::at(&self.path, words(&error)))?;
        self.writer
            .into_inner()
            .into_inner()
            .map_err(|error| WriteError::at(&self.path, error.error()))?;
        Ok(())
    }
}

/// Returns what went wrong; the library's own words leave the system's reason out.
pub(super) fn words(error: &mcap::McapError) -> String {
    match error {
        mcap::McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}
