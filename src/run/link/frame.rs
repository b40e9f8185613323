//! Frames on a byte stream: a length, then so many bytes. It knows nothing of what they mean.

use std::io::{self, Read, Write};

/// Longest frame, bytes without its length.
pub const LIMIT: usize = 64 * 1024;

/// Why no frame came.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The other end has ended the connection between two frames.
    #[error("the other end has gone")]
    Gone,
    /// A frame says that it is longer than any may be.
    #[error("a frame of {length} bytes is longer than {LIMIT}")]
    TooLong {
        /// Length said.
        length: usize,
    },
    /// The connection ended or failed within a frame.
    #[error(transparent)]
    Broken(#[from] io::Error),
}

/// Reads one frame; waits for it as long as the stream does.
///
/// # Errors
/// [`FrameError`]; nothing more can be read from the stream then.
pub fn read_frame(stream: &mut impl Read) -> Result<Vec<u8>, FrameError> {
    let mut length = [0; 4];
    match stream.read(&mut length[..1]) {
        Ok(0) => return Err(FrameError::Gone),
        Ok(_) => stream.read_exact(&mut length[1..])?,
        Err(error) if error.kind() == io::ErrorKind::Interrupted => {
            stream.read_exact(&mut length)?
        }
        Err(error) => return Err(error.into()),
    }
    let length = usize::try_from(u32::from_le_bytes(length)).unwrap_or(usize::MAX);
    if length > LIMIT {
        return Err(FrameError::TooLong { length });
    }
    let mut frame = vec![0; length];
    stream.read_exact(&mut frame)?;
    Ok(frame)
}

/// Writes one frame with its length, at once.
///
/// # Errors
/// It is too long, or the stream fails; nothing more can be written then.
pub fn write_frame(stream: &mut impl Write, frame: &[u8]) -> io::Result<()> {
    let length = u32::try_from(frame.len())
        .ok()
        .filter(|_| frame.len() <= LIMIT);
    let Some(length) = length else {
        return Err(io::ErrorKind::InvalidInput.into());
    };
    let mut bytes = Vec::with_capacity(4 + frame.len());
    bytes.extend_from_slice(&length.to_le_bytes());
    bytes.extend_from_slice(frame);
    stream.write_all(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_frame_that_is_too_long_is_refused_before_it_is_read() {
        let mut bytes: &[u8] = &[0xff, 0xff, 0xff, 0xff, 1, 2, 3];
        assert!(matches!(
            read_frame(&mut bytes),
            Err(FrameError::TooLong {
                length: 0xffff_ffff
            })
        ));
        assert!(write_frame(&mut Vec::new(), &vec![0; LIMIT + 1]).is_err());
    }

    #[test]
    fn an_end_between_frames_is_no_failure_and_one_within_is() {
        let mut bytes = Vec::new();
        write_frame(&mut bytes, b"one").unwrap();
        let mut stream = &bytes[..];
        assert_eq!(read_frame(&mut stream).unwrap(), b"one");
        assert!(matches!(read_frame(&mut stream), Err(FrameError::Gone)));
        for cut in 1..bytes.len() {
            assert!(
                matches!(read_frame(&mut &bytes[..cut]), Err(FrameError::Broken(_))),
                "cut at {cut}"
            );
        }
    }

    proptest! {
        #[test]
        fn frames_come_as_they_were_written(frames in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..100), 0..10)) {
            let mut bytes = Vec::new();
            frames.iter().for_each(|frame| write_frame(&mut bytes, frame).unwrap());
            let mut stream = &bytes[..];
            for frame in &frames {
                prop_assert_eq!(&read_frame(&mut stream).unwrap(), frame);
            }
            prop_assert!(matches!(read_frame(&mut stream), Err(FrameError::Gone)));
        }
    }
}
