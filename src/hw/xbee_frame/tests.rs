//! Vectors from public documents and from the vendor's library, broken frames, and laws for any bytes.

use proptest::prelude::*;

use super::*;

const MODES: [ApiMode; 2] = [ApiMode::Plain, ApiMode::Escaped];

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace()
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

/// What is read out of pieces of bytes, in words, and what could not be.
fn read(mode: ApiMode, pieces: &[&[u8]]) -> (Vec<String>, BadFrames) {
    let (mut decoder, mut found) = (Decoder::new(mode), Vec::new());
    for piece in pieces {
        decoder.take(piece, |frame| found.push(format!("{frame:?}")));
    }
    (found, decoder.bad())
}

fn encoded(frame: &Frame<'_>, mode: ApiMode) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(frame, mode, &mut bytes).unwrap();
    bytes
}

/// A frame has these bytes in mode 1, and those in mode 2 (the same if there are none), and is read out of them.
fn check(plain: &str, escaped: &str, frame: Frame<'_>) {
    let escaped = if escaped.is_empty() { plain } else { escaped };
    for (mode, hex) in MODES.into_iter().zip([plain, escaped]) {
        assert_eq!(encoded(&frame, mode), bytes(hex), "{frame:?}");
        let (found, bad) = read(mode, &[&bytes(hex)]);
        assert_eq!(found, [format!("{frame:?}")]);
        assert_eq!(bad, BadFrames::default());
    }
}

const SERIAL: u64 = 0x0013_A200_40E6_6EBD;

#[test]
fn frames_of_public_documents_are_read_and_said() {
    let to = |id, to, payload| Frame::Transmit16 {
        id,
        to,
        options: 0,
        payload,
    };
    check(
        "7E 00 0A 01 01 50 01 00 48 65 6C 6C 6F B8",
        "",
        to(1, 0x5001, b"Hello"),
    );
    let heard = Frame::Receive16 {
        from: 0x1234,
        rssi_dbm: -94,
        options: 1,
        payload: b"TxData",
    };
    check("7E 00 0B 81 12 34 5E 01 54 78 44 61 74 61 93", "", heard);
    let data = bytes("00 00 00 00 00 00 00 FF FF FF FE 01 00 42 72 6F 61 64 63 61 73 74");
    let other = Frame::Other {
        kind: 0x10,
        data: &data,
    };
    check(
        "7E 00 17 10 00 00 00 00 00 00 00 FF FF FF FE 01 00 42 72 6F 61 64 63 61 73 74 60",
        "",
        other,
    );
    let error = Frame::CommandAnswer {
        id: 9,
        name: AtName(*b"RC"),
        status: 1,
        value: &[],
    };
    check("7E 00 05 88 09 52 43 01 D8", "", error);
    let remote = Frame::RemoteAnswer {
        id: 1,
        from64: 0x0013_A200_7040_7644,
        from16: 0xFFFE,
        name: AtName(*b"DB"),
        status: 4,
        value: &[],
    };
    check(
        "7E 00 0F 97 01 00 13 A2 00 70 40 76 44 FF FE 44 42 04 C1",
        "7E 00 0F 97 01 00 7D 33 A2 00 70 40 76 44 FF FE 44 42 04 C1",
        remote,
    );
    let status = Frame::TransmitStatus {
        id: 1,
        status: 0x7D,
    };
    check("7E 00 03 89 01 7D F8", "7E 00 03 89 01 7D 5D F8", status);
}

#[test]
fn an_example_of_escaping_is_sound_though_its_type_is_not_known() {
    for (mode, hex) in MODES
        .into_iter()
        .zip(["7E 00 02 23 11 CB", "7E 00 02 23 7D 31 CB"])
    {
        let (found, bad) = read(mode, &[&bytes(hex)]);
        assert_eq!(found, [""; 0]);
        assert_eq!(
            bad,
            BadFrames {
                unknown_type: 1,
                ..BadFrames::default()
            }
        );
    }
}

#[test]
fn frames_of_the_vendors_library_are_read_and_said() {
    let to_all = |id, payload| Frame::Transmit16 {
        id,
        to: 0xFFFF,
        options: 1,
        payload,
    };
    check(
        "7E 00 0A 01 00 FF FF 01 01 11 13 7D 7E DF",
        "7E 00 0A 01 00 FF FF 01 01 7D 31 7D 33 7D 5D 7D 5E DF",
        to_all(0, &[0x01, 0x11, 0x13, 0x7D, 0x7E]),
    );
    check(
        "7E 00 07 01 11 FF FF 01 61 62 2B",
        "7E 00 07 01 7D 31 FF FF 01 61 62 2B",
        to_all(0x11, b"ab"),
    );
    let long = Frame::Receive64 {
        from: SERIAL,
        rssi_dbm: -17,
        options: 2,
        payload: b"ab",
    };
    check(
        "7E 00 0D 80 00 13 A2 00 40 E6 6E BD 11 02 61 62 A3",
        "7E 00 0D 80 00 7D 33 A2 00 40 E6 6E BD 7D 31 02 61 62 A3",
        long,
    );
    let heard = Frame::Receive16 {
        from: 2,
        rssi_dbm: -61,
        options: 2,
        payload: &[0x74, 0x53, 1, 0x0A],
    };
    check("7E 00 09 81 00 02 3D 02 74 53 01 0A 6B", "", heard);
    check(
        "7E 00 03 89 01 00 75",
        "",
        Frame::TransmitStatus { id: 1, status: 0 },
    );
    check(
        "7E 00 03 89 01 02 73",
        "",
        Frame::TransmitStatus { id: 1, status: 2 },
    );
    check("7E 00 02 8A 00 75", "", Frame::ModemStatus(0));
    check("7E 00 02 8A 01 74", "", Frame::ModemStatus(1));
    let set = Frame::Command {
        id: 1,
        name: AtName(*b"MY"),
        value: &[0, 2],
    };
    check("7E 00 06 08 01 4D 59 00 02 4E", "", set);
    let ask = Frame::Command {
        id: 0x52,
        name: AtName(*b"NP"),
        value: &[],
    };
    check("7E 00 04 08 52 4E 50 07", "", ask);
    let answer = Frame::CommandAnswer {
        id: 0x52,
        name: AtName(*b"NP"),
        status: 0,
        value: &[0x64],
    };
    check("7E 00 06 88 52 4E 50 00 64 23", "", answer);
    let unknown = Frame::CommandAnswer {
        id: 0x52,
        name: AtName(*b"AO"),
        status: 2,
        value: &[],
    };
    check("7E 00 05 88 52 41 4F 02 93", "", unknown);
    let without = Frame::ReceiveWithoutRssi {
        from64: SERIAL,
        from16: 0xFFFE,
        options: 2,
        payload: b"ab",
    };
    check(
        "7E 00 0E 90 00 13 A2 00 40 E6 6E BD FF FE 02 61 62 A7",
        "7E 00 0E 90 00 7D 33 A2 00 40 E6 6E BD FF FE 02 61 62 A7",
        without,
    );
}

/// A frame that needs no escaping.
const STATUS: &str = "7E 00 03 89 01 00 75";

fn status_after(mode: ApiMode, garbage: &str) -> (usize, BadFrames) {
    let bytes = [bytes(garbage), bytes(STATUS)].concat();
    let (found, bad) = read(mode, &[&bytes]);
    let status = format!("{:?}", Frame::TransmitStatus { id: 1, status: 0 });
    (found.iter().filter(|frame| **frame == status).count(), bad)
}

#[test]
fn what_is_no_frame_is_counted_for_what_it_is_and_costs_no_other_one() {
    let bad = |checksum, length, unknown_type| BadFrames {
        checksum,
        length,
        unknown_type,
    };
    for (garbage, plain, escaped) in [
        ("7E 00 00 FF", bad(0, 1, 0), bad(0, 1, 0)),
        ("7E FF FF", bad(0, 1, 0), bad(0, 1, 0)),
        ("7E 01 01 81", bad(0, 1, 0), bad(0, 1, 0)),
        ("7E 00 01 8A 75", bad(0, 1, 0), bad(0, 1, 0)),
        ("7E 00 01 8A 76", bad(1, 0, 0), bad(1, 0, 0)),
        ("7E 00 01 23 DC", bad(0, 0, 1), bad(0, 0, 1)),
        ("7E 00 03 89 01 00 76", bad(1, 0, 0), bad(1, 0, 0)),
        ("7E 00 02 89 01 75", bad(0, 1, 0), bad(0, 1, 0)),
        ("7E 00 03 8A 00 00 75", bad(0, 1, 0), bad(0, 1, 0)),
        ("7E 00 02 23 05 D7", bad(0, 0, 1), bad(0, 0, 1)),
        ("4F 4B 0D 02 03", bad(0, 0, 0), bad(0, 0, 0)),
        ("7E", bad(0, 1, 0), bad(0, 0, 0)),
        ("7E 7E 7E 7E", bad(0, 4, 0), bad(0, 0, 0)),
    ] {
        assert_eq!(
            status_after(ApiMode::Plain, garbage),
            (1, plain),
            "{garbage} plain"
        );
        assert_eq!(
            status_after(ApiMode::Escaped, garbage),
            (1, escaped),
            "{garbage} escaped"
        );
    }
}

#[test]
fn in_mode_2_a_frame_that_is_cut_short_ends_where_the_next_one_begins() {
    for cut in ["7E 00 30 81 00", "7E 00 30 81 00 7D", "7E 00"] {
        let (count, bad) = status_after(ApiMode::Escaped, cut);
        assert_eq!((count, bad.length, bad.total()), (1, 1, 1), "{cut}");
    }
}

#[test]
fn in_mode_1_a_frame_that_was_taken_for_data_is_found_when_those_have_come() {
    let mut decoder = Decoder::new(ApiMode::Plain);
    let mut found = 0;
    let cut = bytes("7E 00 30 81 00");
    decoder.take(&[cut, bytes(STATUS)].concat(), |_| found += 1);
    assert_eq!(found, 0, "it is still taken for the data of the one before");
    decoder.take(&[0; 0x30], |_| found += 1);
    assert_eq!(found, 1);
}

#[test]
fn a_stream_of_the_other_mode_is_garbage_only_where_it_is_escaped() {
    let frame = Frame::Transmit16 {
        id: 5,
        to: 0xFFFF,
        options: 1,
        payload: &[0x7E, 0, 3, 0x11],
    };
    for (said, heard) in [
        (ApiMode::Plain, ApiMode::Escaped),
        (ApiMode::Escaped, ApiMode::Plain),
    ] {
        let bytes = [encoded(&frame, said), bytes(STATUS), bytes(STATUS)].concat();
        let (found, bad) = read(heard, &[&bytes]);
        assert!(
            !found.is_empty() && bad.total() > 0,
            "{said:?} as {heard:?}: {found:?}"
        );
    }
}

#[test]
fn a_frame_that_is_too_long_has_no_bytes() {
    let mut bytes = Vec::new();
    let payload = [7; DATA_MOST];
    let of = |length| Frame::Other {
        kind: 0x83,
        data: &payload[..length],
    };
    assert!(encode(&of(DATA_MOST - 1), ApiMode::Plain, &mut bytes).is_ok());
    let error = encode(&of(DATA_MOST), ApiMode::Plain, &mut Vec::new()).unwrap_err();
    assert_eq!(error.length, DATA_MOST + 1);
    let (found, _) = read(ApiMode::Plain, &[&bytes]);
    assert_eq!(found.len(), 1);
}

/// Bytes that frames are full of.
fn byte() -> impl Strategy<Value = u8> {
    let special = prop::sample::select(vec![0x7E, 0x7D, 0x11, 0x13, 0x00, 0x81, 0x89, 0x03]);
    prop_oneof![any::<u8>(), special]
}

fn some_bytes(most: usize) -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(byte(), 0..=most)
}

/// What a frame is made of.
type Parts = (u8, (u8, u64, u16, i16), Vec<u8>);

fn parts() -> impl Strategy<Value = Parts> {
    let numbers = (byte(), any::<u64>(), any::<u16>(), -255..=0_i16);
    (0..14_u8, numbers, some_bytes(116))
}

fn frame((which, (id, long, short, rssi_dbm), rest): &Parts) -> Frame<'_> {
    let (id, from64, from16, rssi_dbm, payload) = (*id, *long, *short, *rssi_dbm, rest.as_slice());
    let (options, status, value) = (id ^ 3, id ^ 0x7D, payload);
    let name = AtName([b'A' + id % 26, b'0' + id % 10]);
    match which {
        0 => Frame::Transmit64 {
            id,
            to: from64,
            options,
            payload,
        },
        1 => Frame::Transmit16 {
            id,
            to: from16,
            options,
            payload,
        },
        2 => Frame::Command { id, name, value },
        3 => Frame::QueuedCommand { id, name, value },
        4 => Frame::RemoteCommand {
            id,
            to64: from64,
            to16: from16,
            options,
            name,
            value,
        },
        5 => Frame::Receive64 {
            from: from64,
            rssi_dbm,
            options,
            payload,
        },
        6 => Frame::Receive16 {
            from: from16,
            rssi_dbm,
            options,
            payload,
        },
        7 => Frame::ReceiveWithoutRssi {
            from64,
            from16,
            options,
            payload,
        },
        8 => Frame::CommandAnswer {
            id,
            name,
            status,
            value,
        },
        9 => Frame::RemoteAnswer {
            id,
            from64,
            from16,
            name,
            status,
            value,
        },
        10 => Frame::TransmitStatus { id, status },
        11 => Frame::ModemStatus(status),
        12 => Frame::Other {
            kind: 0x82,
            data: payload,
        },
        _ => Frame::Other {
            kind: 0x8B,
            data: payload,
        },
    }
}

/// Cuts bytes into pieces of these lengths, over and over.
fn cut<'a>(mut bytes: &'a [u8], lengths: &[usize]) -> Vec<&'a [u8]> {
    let mut pieces = Vec::new();
    for length in lengths.iter().cycle() {
        let (piece, rest) = bytes.split_at((*length).min(bytes.len()));
        pieces.push(piece);
        bytes = rest;
        if rest.is_empty() {
            break;
        }
    }
    pieces
}

proptest! {
    #[test]
    fn frames_are_read_as_they_were_said_cut_anywhere(
        all in prop::collection::vec(parts(), 1..6),
        lengths in prop::collection::vec(1..40_usize, 1..6),
    ) {
        for mode in MODES {
            let frames: Vec<Frame<'_>> = all.iter().map(frame).collect();
            let bytes: Vec<u8> = frames.iter().flat_map(|frame| encoded(frame, mode)).collect();
            let (found, bad) = read(mode, &cut(&bytes, &lengths));
            let expected: Vec<String> = frames.iter().map(|frame| format!("{frame:?}")).collect();
            prop_assert_eq!(found, expected);
            prop_assert_eq!(bad, BadFrames::default());
        }
    }

    #[test]
    fn behind_garbage_a_frame_is_found_at_once_in_mode_2_and_within_the_longest_frame_in_mode_1(
        garbage in some_bytes(400),
        parts in parts(),
        lengths in prop::collection::vec(1..40_usize, 1..6),
    ) {
        let frame = frame(&parts);
        let expected = format!("{frame:?}");
        let mut bytes = [garbage.clone(), encoded(&frame, ApiMode::Escaped)].concat();
        let (found, _) = read(ApiMode::Escaped, &cut(&bytes, &lengths));
        prop_assert_eq!(found.last(), Some(&expected));
        let taken = |(found, bad): &(Vec<String>, BadFrames)| found.len() as u64 + bad.unknown_type + bad.length;
        let before = read(ApiMode::Plain, &[&garbage]);
        bytes = [garbage, encoded(&frame, ApiMode::Plain), vec![0; DATA_MOST + 4]].concat();
        let after = read(ApiMode::Plain, &cut(&bytes, &lengths));
        // The garbage may be a sound frame, of whatever type, together with a part of ours: then that one is taken.
        prop_assert!(after.0.contains(&expected) || taken(&after) > taken(&before));
    }

    #[test]
    fn any_bytes_are_read_alike_in_any_pieces_and_little_is_held(
        bytes in some_bytes(1200),
        lengths in prop::collection::vec(1..300_usize, 1..6),
    ) {
        for mode in MODES {
            let whole = read(mode, &[&bytes]);
            let (mut decoder, mut found) = (Decoder::new(mode), Vec::new());
            for piece in cut(&bytes, &lengths) {
                decoder.take(piece, |frame| found.push(format!("{frame:?}")));
                prop_assert!(decoder.held() <= 300 && decoder.begun.capacity() <= 300);
            }
            prop_assert_eq!((found, decoder.bad()), whole);
        }
    }
}
