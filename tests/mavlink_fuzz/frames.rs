//! The reader of frames under bytes of any kind.

use tomoswarm::mavlink::frames::{Content, Frame, FrameReader, FrameWriter, MavAddress, fitting};
use tomoswarm::mavlink::signing::Signing;

use crate::chance::Chance;
use crate::noise;

const FROM: MavAddress = MavAddress {
    system: 1,
    component: 1,
};

/// Reads bytes that come in pieces of at most so many.
fn read(
    chance: &mut Chance,
    bytes: &[u8],
    most: usize,
    mut signing: Option<Signing>,
) -> Vec<Frame> {
    let (mut reader, mut frames, mut rest) = (FrameReader::default(), Vec::new(), bytes);
    while !rest.is_empty() {
        let (piece, more) = rest.split_at((1 + chance.below(most)).min(rest.len()));
        reader.push(piece);
        frames.extend(std::iter::from_fn(|| reader.next(signing.as_mut())));
        rest = more;
    }
    frames
}

/// Compared as text, where a number that is none equals itself.
fn texts(frames: &[Frame]) -> Vec<String> {
    frames.iter().map(|frame| format!("{frame:?}")).collect()
}

/// Frames, damaged ones and garbage.
fn stream(chance: &mut Chance) -> Vec<u8> {
    let mut bytes = Vec::new();
    for index in 0..1 + chance.below(40) {
        let payload = noise::payload(chance);
        let mut piece = match chance.below(8) {
            0 => (0..chance.below(60))
                .map(|_| chance.below(256) as u8)
                .collect(),
            1 => vec![chance.one_of(&[0xFD, 0xFE]); 1 + chance.below(20)],
            2 | 3 => payload.framed_as_1(FROM, index as u8),
            _ => payload.framed(FROM, index as u8),
        };
        if !piece.is_empty() && chance.happens(0.2) {
            noise::damage(chance, &mut piece);
        }
        bytes.extend(piece);
    }
    bytes
}

pub fn any_bytes(chance: &mut Chance) {
    let bytes = stream(chance);
    let most = bytes.len().max(1);
    let whole = read(chance, &bytes, most, None);
    let small = 1 + chance.below(30);
    let in_pieces = read(chance, &bytes, small, None);
    assert_eq!(texts(&whole), texts(&in_pieces));
    // What was read is said in the same way again; our own reader knows no commands without a name.
    let (mut writer, mut said, mut contents) = (FrameWriter::new(FROM), Vec::new(), Vec::new());
    for frame in &whole {
        match &frame.content {
            Content::Message(message) => writer.write(message, None, &mut said),
            Content::EkfStatus(flags) => writer.write_ekf_status(*flags, None, &mut said),
            Content::UnknownCommand { command, .. } => {
                writer.write_unsupported(*command, FROM, None, &mut said);
                continue;
            }
        }
        contents.push(format!("{:?}", frame.content));
    }
    assert_eq!(noise::count_frames(&said), Some(whole.len()));
    let again = read(chance, &said, most, None);
    let again: Vec<String> = again
        .iter()
        .map(|frame| format!("{:?}", frame.content))
        .collect();
    assert_eq!(again, contents);
    let packet = 1 + chance.below(1500);
    let (mut at, mut packets) = (0, 0);
    while at < said.len() {
        at += fitting(&said[at..], packet);
        packets += 1;
        assert!(packets <= whole.len(), "a packet holds a frame at least");
    }
    let _ = fitting(&bytes, packet);
}

pub fn signed_bytes(chance: &mut Chance) {
    let signing = |key: u8| Signing::new([key; 32], 0, 1_000_000);
    let (mut ours, mut others) = (signing(1), signing(2));
    let (mut writer, mut stranger) = (FrameWriter::new(FROM), FrameWriter::new(FROM));
    let (mut bytes, mut said, mut earlier) = (Vec::new(), Vec::new(), Vec::new());
    for index in 0..1 + chance.below(30) {
        let payload = noise::payload(chance);
        let mut piece = Vec::new();
        match (chance.below(6), payload.message()) {
            (0, _) | (_, None) => piece = payload.framed(FROM, index as u8),
            (1, Some(message)) => stranger.write(&message, Some(&mut others), &mut piece),
            (2, Some(_)) if !earlier.is_empty() => {
                piece.clone_from(&earlier[chance.below(earlier.len())])
            }
            (_, Some(message)) => {
                if chance.happens(0.2) {
                    ours.tick(ours.time() + chance.below(7_000_000) as u64);
                }
                writer.write(&message, Some(&mut ours), &mut piece);
                said.push(format!("{message:?}"));
                earlier.push(piece.clone());
            }
        }
        // A flag, an identifier or a byte of the signature among them.
        if chance.happens(0.3) {
            noise::damage(chance, &mut piece);
        }
        bytes.extend(piece);
    }
    let most = 1 + chance.below(300);
    let believed = read(chance, &bytes, most, Some(signing(1)));
    let mut left = said.iter();
    for frame in &believed {
        let Content::Message(message) = &frame.content else {
            panic!("{frame:?}")
        };
        let text = format!("{message:?}");
        assert!(
            left.any(|said| *said == text),
            "nobody has said {text}, or it was believed twice"
        );
    }
}
