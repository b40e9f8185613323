//! Reads a recording from start to end, a record at a time, whatever its size. It needs no index, so a file that was
//! never ended is read up to its last whole chunk.

use std::collections::BTreeMap;
use std::io::Read;

use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::segment::words;

/// No record or chunk may be larger, bytes.
const LARGEST: usize = 64 << 20;
/// A file may have so many channels.
const CHANNELS: usize = 1024;
/// The file is read in pieces of this size, bytes.
const PIECE: usize = 64 << 10;

/// Why a file cannot be read on.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The system says no.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// It does not begin as an MCAP does.
    #[error("is no MCAP file")]
    NotMcap,
    /// It ends in the middle of something.
    #[error("ends unfinished at byte {offset}")]
    Truncated {
        /// Its length, bytes.
        offset: u64,
    },
    /// It is compressed, as no recording of ours is.
    #[error("is compressed with {0}; only recordings without compression are read")]
    Compressed(String),
    /// What stands there makes no sense.
    #[error("is damaged before byte {offset}: {reason}")]
    Damaged {
        /// What was read until then, bytes.
        offset: u64,
        /// What is wrong.
        reason: String,
    },
}

/// What stands in a file.
#[derive(Debug)]
pub enum RecordingContents {
    /// A word about the whole file.
    Metadata {
        /// Its name.
        name: String,
        /// What it says.
        values: BTreeMap<String, String>,
    },
    /// A message.
    Message {
        /// Of which channel.
        topic: String,
        /// Its bytes.
        data: Vec<u8>,
    },
}

/// Reads a file.
pub struct Reader<R> {
    source: R,
    reader: LinearReader,
    topics: BTreeMap<u16, String>,
    offset: u64,
}

impl<R: Read> Reader<R> {
    /// Reads from the start of a file.
    pub fn new(source: R) -> Reader<R> {
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LARGEST);
        Reader {
            source,
            reader: LinearReader::new_with_options(options),
            topics: BTreeMap::new(),
            offset: 0,
        }
    }

    /// Returns how much of the file has been read, bytes.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Returns what comes next; `None` at the end of a file that was ended in order.
    ///
    /// # Errors
    /// The file cannot be read on.
    pub fn next_found(&mut self) -> Result<Option<RecordingContents>, ReadError> {
        loop {
            let offset = self.offset;
            let damaged = |reason: String| ReadError::Damaged { offset, reason };
            let record = match self.reader.next_event() {
                None => return Ok(None),
                Some(Err(McapError::BadMagic)) if offset <= PIECE as u64 => {
                    return Err(ReadError::NotMcap);
                }
                Some(Err(McapError::UnexpectedEof)) if offset < mcap::MAGIC.len() as u64 => {
                    return Err(ReadError::NotMcap);
                }
                Some(Err(McapError::UnexpectedEof)) => return Err(ReadError::Truncated { offset }),
                Some(Err(McapError::UnsupportedCompression(name))) => {
                    return Err(ReadError::Compressed(name));
                }
                Some(Err(error)) => return Err(damaged(words(&error))),
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    let room = self.reader.insert(wanted.clamp(1, PIECE));
                    let read = read_some(&mut self.source, room)?;
                    self.reader.notify_read(read);
                    self.offset += read as u64;
                    continue;
                }
                Some(Ok(LinearReadEvent::Record { data, opcode })) => match opcode {
                    // The library's parser is given only what is needed here.
                    op::CHANNEL | op::MESSAGE | op::METADATA => {
                        mcap::parse_record(opcode, data).map_err(|error| damaged(words(&error)))?
                    }
                    _ => continue,
                },
            };
            match record {
                Record::Channel(channel) => {
                    self.topics.insert(channel.id, channel.topic);
                    if self.topics.len() > CHANNELS {
                        return Err(damaged(format!("it has more than {CHANNELS} channels")));
                    }
                }
                Record::Message { header, data } => {
                    let Some(topic) = self.topics.get(&header.channel_id) else {
                        return Err(damaged(format!(
                            "a message is of the unknown channel {}",
                            header.channel_id
                        )));
                    };
                    return Ok(Some(RecordingContents::Message {
                        topic: topic.clone(),
                        data: data.into_owned(),
                    }));
                }
                Record::Metadata(metadata) => {
                    return Ok(Some(RecordingContents::Metadata {
                        name: metadata.name,
                        values: metadata.metadata,
                    }));
                }
                _ => {}
            }
        }
    }
}

fn read_some(source: &mut impl Read, room: &mut [u8]) -> std::io::Result<usize> {
    loop {
        match source.read(room) {
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            other => return other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read_all(bytes: &[u8]) -> (usize, Option<ReadError>) {
        let (mut reader, mut count) = (Reader::new(bytes), 0);
        loop {
            match reader.next_found() {
                Ok(None) => return (count, None),
                Ok(Some(_)) => count += 1,
                Err(error) => return (count, Some(error)),
            }
        }
    }

    /// A file of four chunks with ten messages each.
    fn file() -> Vec<u8> {
        let mut writer = mcap::WriteOptions::new()
            .compression(None)
            .disable_seeking(true)
            .create(std::io::Cursor::new(Vec::new()))
            .unwrap();
        let channel = writer
            .add_channel(0, "/a", "json", &BTreeMap::new())
            .unwrap();
        for number in 0..40u32 {
            let time = u64::from(number);
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence: number,
                log_time: time,
                publish_time: time,
            };
            writer
                .write_to_known_channel(&header, b"{\"x\":1}")
                .unwrap();
            if number % 10 == 9 {
                writer.flush().unwrap();
            }
        }
        writer.finish().unwrap();
        writer.into_inner().into_inner()
    }

    #[test]
    fn a_file_cut_anywhere_is_read_up_to_the_last_whole_chunk() {
        let file = file();
        let (count, error) = read_all(&file);
        assert!(count == 40 && error.is_none(), "{count} {error:?}");
        let mut last = 0;
        for length in 0..file.len() {
            let (count, error) = read_all(&file[..length]);
            let error = error.unwrap();
            let expected = if length < 8 {
                "is no MCAP"
            } else {
                "ends unfinished"
            };
            assert!(error.to_string().starts_with(expected), "{length}: {error}");
            assert!(count >= last && count % 10 == 0);
            last = count;
        }
        assert_eq!(last, 40);
    }

    proptest! {
        #[test]
        fn a_damaged_file_is_refused_or_read_and_never_more(at in any::<prop::sample::Index>(), value in any::<u8>()) {
            let mut file = file();
            let at = at.index(file.len());
            file[at] = value;
            let (count, _) = read_all(&file);
            prop_assert!(count <= 40);
        }

        #[test]
        fn any_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            prop_assert!(read_all(&bytes).1.is_some());
            let framed = [mcap::MAGIC, &bytes].concat();
            prop_assert!(read_all(&framed).1.is_some());
        }
    }
}
