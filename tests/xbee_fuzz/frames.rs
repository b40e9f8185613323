//! The reader of frames under bytes of any kind.

use tomoswarm::hw::xbee_frame::{ApiMode, AtName, BadFrames, Decoder, Frame, encode};

use crate::chance::Chance;

/// What the reader may hold, bytes.
const HELD_MOST: usize = 300;

/// Draws a byte, often one that means something.
fn byte(chance: &mut Chance) -> u8 {
    match chance.below(3) {
        0 => chance.one_of(&[
            0x7E, 0x7D, 0x11, 0x13, 0x00, 0x01, 0x81, 0x88, 0x89, 0x8A, 0x5E, 0x5D,
        ]),
        _ => chance.below(256) as u8,
    }
}

pub fn bytes(chance: &mut Chance, most: usize) -> Vec<u8> {
    (0..chance.below(most + 1)).map(|_| byte(chance)).collect()
}

/// Draws a frame that a module may say, with some bytes in it.
pub fn frame<'a>(chance: &mut Chance, bytes: &'a [u8]) -> Frame<'a> {
    let (id, status) = (
        chance.below(12) as u8,
        chance.one_of(&[0, 0, 0, 1, 2, 3, 4, 0x74]),
    );
    let (from, rssi_dbm) = (chance.below(5) as u16, -(chance.below(120) as i16));
    let (options, payload, value) = (2, bytes, bytes);
    let names = [
        *b"AP", *b"MY", *b"VR", *b"ID", *b"NP", *b"BD", *b"WR", *b"FR", *b"PP", *b"CN",
    ];
    let name = AtName(chance.one_of(&names));
    match chance.below(14) {
        0..3 => Frame::TransmitStatus { id, status },
        3..6 => Frame::CommandAnswer {
            id,
            name,
            status,
            value,
        },
        6 => Frame::ModemStatus(status),
        7 | 8 => Frame::Receive16 {
            from,
            rssi_dbm,
            options,
            payload,
        },
        9 => Frame::Receive64 {
            from: from.into(),
            rssi_dbm,
            options,
            payload,
        },
        10 => Frame::ReceiveWithoutRssi {
            from64: 7,
            from16: from,
            options,
            payload,
        },
        11 => Frame::Transmit16 {
            id,
            to: 0xFFFF,
            options,
            payload,
        },
        12 => Frame::RemoteCommand {
            id,
            to64: 7,
            to16: from,
            options,
            name,
            value,
        },
        _ => Frame::Command { id, name, value },
    }
}

/// Damages a byte, cuts the end off or says a piece twice.
pub fn damage(chance: &mut Chance, bytes: &mut Vec<u8>) {
    if bytes.is_empty() {
        return;
    }
    let at = chance.below(bytes.len());
    match chance.below(4) {
        0 => bytes.truncate(at),
        1 => bytes.extend_from_within(at..),
        _ => bytes[at] ^= 1 << chance.below(8),
    }
}

/// Frames, damaged ones and garbage.
fn stream(chance: &mut Chance, mode: ApiMode) -> Vec<u8> {
    let mut stream = Vec::new();
    for _ in 0..chance.below(8) {
        let content = bytes(chance, 40);
        let mut piece = Vec::new();
        match chance.below(4) {
            0 => piece = content,
            _ => encode(&frame(chance, &content), mode, &mut piece).unwrap(),
        }
        if chance.happens(0.3) {
            damage(chance, &mut piece);
        }
        stream.extend(piece);
    }
    stream
}

/// Reads bytes in pieces of at most so many; returns the frames, said again.
fn read(
    chance: &mut Chance,
    bytes: &[u8],
    mode: ApiMode,
    most: usize,
) -> (Vec<Vec<u8>>, BadFrames) {
    let (mut decoder, mut frames, mut rest) = (Decoder::new(mode), Vec::new(), bytes);
    while !rest.is_empty() {
        let (piece, more) = rest.split_at((1 + chance.below(most)).min(rest.len()));
        decoder.take(piece, |frame| {
            let mut said = Vec::new();
            encode(&frame, mode, &mut said).unwrap();
            frames.push(said);
        });
        assert!(decoder.held() <= HELD_MOST);
        rest = more;
    }
    (frames, decoder.bad())
}

pub fn any_bytes(chance: &mut Chance) {
    let mode = chance.one_of(&[ApiMode::Plain, ApiMode::Escaped]);
    let mut stream = stream(chance, mode);
    let whole = read(chance, &stream, mode, usize::MAX);
    let most = 1 + chance.below(30);
    assert_eq!(read(chance, &stream, mode, most), whole);
    // What was read is a part of what came; in mode 1 its bytes are the very same.
    if mode == ApiMode::Plain {
        let mut rest = stream.as_slice();
        for frame in &whole.0 {
            let at = rest
                .windows(frame.len())
                .position(|window| window == frame.as_slice());
            rest = &rest[at.expect("it came") + frame.len()..];
        }
    }
    // Behind all that a frame is found: in mode 2 at once, in mode 1 when what it may be taken for has come.
    let content = bytes(chance, 20);
    let last = frame(chance, &content);
    let mut said = Vec::new();
    encode(&last, mode, &mut said).unwrap();
    stream.extend(&said);
    if mode == ApiMode::Plain {
        stream.extend([0; HELD_MOST]);
    }
    let (frames, bad) = read(chance, &stream, mode, most);
    // What came may be a sound frame, of whatever type, together with a part of ours: then that one is taken.
    let taken =
        |frames: &[Vec<u8>], bad: BadFrames| frames.len() as u64 + bad.unknown_type + bad.length;
    assert!(frames.contains(&said) || taken(&frames, bad) > taken(&whole.0, whole.1));
    if mode == ApiMode::Escaped {
        assert_eq!(frames.last(), Some(&said));
    }
}
