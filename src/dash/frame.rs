//! The bytes of the feed: frames of at most 8 kB from the server to a page, little endian.
//!
//! ```text
//!   kind u8 | flags u8 | count u16 | length u32 | time f64 | length bytes: count records, or text
//! ```
//!
//! `time` is the server's, seconds. Records are described by [`RecordLayout`]s, which both sides read: this side writes by
//! them, and `web/frames.js` is made of them. Texts are JSON; one that does not fit into a frame goes on in the next one of
//! its kind ([`GOES_ON`]). The cells of a tile are packed as on the bus ([`packed_cells`]).

use tomoswarm_proto::packed_cells;

use crate::time::Time;

/// A frame has at most this many bytes, header included.
pub const FRAME_BYTES_MAX: usize = 8192;
/// The bytes of a header.
pub const HEADER_BYTES: usize = 16;
/// Set in the flags of a text that goes on in the next frame of its kind.
pub const GOES_ON: u8 = 1;

/// What a frame holds.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
#[repr(u8)]
pub enum FrameKind {
    /// Text: what holds for the whole connection.
    Welcome = 1,
    /// Text: open stops, the seat, how orders fared.
    Orders = 2,
    /// Records: where vehicles are.
    States = 3,
    /// Text: the ground station.
    Ground = 4,
    /// Text: how one vehicle fares.
    Vehicle = 5,
    /// Text: the plan of one vehicle.
    Plan = 6,
    /// Records: tiles of the merged map.
    Tiles = 7,
    /// One record: pixels of an image.
    Stripe = 8,
    /// Text: what was found in an image.
    Finds = 9,
    /// Records: who hears whom.
    Radio = 10,
    /// Text: the plans against time.
    Timetable = 11,
    /// Text: what happened since the last one.
    Events = 12,
    /// Text: which moment is shown, of which span, and whether everything comes anew. Also says that the server lives.
    Moment = 13,
    /// Text: the marks of the span since the last ones.
    Markers = 14,
    /// Text: where one vehicle has been.
    Track = 15,
    /// Text: where somebody truly stands.
    Marks = 16,
    /// Text: what the range sensors of one vehicle heard of late.
    Look = 17,
    /// Text: how far vehicles are in the plans against time, and who waits for whom.
    Progress = 18,
    /// Text: the way that one vehicle is committed to.
    Way = 19,
}

impl FrameKind {
    /// All kinds.
    pub const ALL: [FrameKind; 19] = [
        FrameKind::Welcome,
        FrameKind::Orders,
        FrameKind::States,
        FrameKind::Ground,
        FrameKind::Vehicle,
        FrameKind::Plan,
        FrameKind::Tiles,
        FrameKind::Stripe,
        FrameKind::Finds,
        FrameKind::Radio,
        FrameKind::Timetable,
        FrameKind::Events,
        FrameKind::Moment,
        FrameKind::Markers,
        FrameKind::Track,
        FrameKind::Marks,
        FrameKind::Look,
        FrameKind::Progress,
        FrameKind::Way,
    ];
}

/// How a number of a record is written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FieldType {
    /// One byte.
    U8,
    /// Two bytes.
    U16,
    /// Four bytes.
    U32,
    /// Two bytes, two's complement.
    I16,
    /// Four bytes, two's complement.
    I32,
}

/// A number of a record.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Field {
    /// Its name, with its unit.
    pub name: &'static str,
    /// How it is written.
    pub kind: FieldType,
}

/// The numbers of a record, in order.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RecordLayout {
    /// The name that the page reads it by.
    pub name: &'static str,
    /// Its numbers.
    pub fields: &'static [Field],
}

const fn field(name: &'static str, kind: FieldType) -> Field {
    Field { name, kind }
}

/// Where one vehicle is and how it fares; a battery, a deviation and a number of samples that wait of 65,535 are not known.
pub const STATE: RecordLayout = RecordLayout {
    name: "STATE",
    fields: &[
        field("vehicle", FieldType::U8),
        field("mode", FieldType::U8),
        field("standsUnder", FieldType::U8),
        field("flags", FieldType::U8),
        field("x_mm", FieldType::I32),
        field("y_mm", FieldType::I32),
        field("z_mm", FieldType::I32),
        field("heading_urad100", FieldType::U16),
        field("sd_mm", FieldType::U16),
        field("speed_mmps", FieldType::U16),
        field("battery_permille", FieldType::U16),
        field("age_ms", FieldType::U32),
        field("waiting", FieldType::U16),
    ],
};

/// Where a tile of the merged map lies; `bytes` of packed cells follow.
pub const TILE: RecordLayout = RecordLayout {
    name: "TILE",
    fields: &[
        field("slice", FieldType::I16),
        field("x", FieldType::I32),
        field("y", FieldType::I32),
        field("bytes", FieldType::U16),
    ],
};

/// A part of an image; the mean of each pixel follows (i8), and its deviation (u8) if there is one.
pub const STRIPE: RecordLayout = RecordLayout {
    name: "STRIPE",
    fields: &[
        field("run", FieldType::U32),
        field("sequence", FieldType::U32),
        field("laps", FieldType::U32),
        field("subject", FieldType::U8),
        field("hasDeviation", FieldType::U8),
        field("columns", FieldType::U16),
        field("rows", FieldType::U16),
        field("first", FieldType::U32),
        field("pixels", FieldType::U16),
        field("least_x_mm", FieldType::I32),
        field("least_y_mm", FieldType::I32),
        field("greatest_x_mm", FieldType::I32),
        field("greatest_y_mm", FieldType::I32),
        field("meanStep_udb", FieldType::U32),
        field("deviationStep_udb", FieldType::U32),
        field("linksUsed", FieldType::U32),
        field("linksDropped", FieldType::U32),
    ],
};

/// Who hears whom: a receiver and a transmitter; a strength and an excess of -32,768 are not known.
pub const PAIR: RecordLayout = RecordLayout {
    name: "PAIR",
    fields: &[
        field("receiver", FieldType::U8),
        field("transmitter", FieldType::U8),
        field("rssi_dbm", FieldType::I16),
        field("loss_permille", FieldType::U16),
        field("excess_ddb", FieldType::I16),
        field("distance_mm", FieldType::U32),
        field("age_ms", FieldType::U32),
    ],
};

/// All layouts of records.
pub const LAYOUTS: [RecordLayout; 4] = [STATE, TILE, STRIPE, PAIR];

impl FieldType {
    /// Returns how many bytes it takes.
    pub const fn bytes(self) -> usize {
        match self {
            FieldType::U8 => 1,
            FieldType::U16 | FieldType::I16 => 2,
            FieldType::U32 | FieldType::I32 => 4,
        }
    }

    /// Returns its name in the page.
    pub const fn name(self) -> &'static str {
        match self {
            FieldType::U8 => "u8",
            FieldType::U16 => "u16",
            FieldType::U32 => "u32",
            FieldType::I16 => "i16",
            FieldType::I32 => "i32",
        }
    }

    /// Writes the nearest value that it can hold.
    fn put(self, value: i64, bytes: &mut Vec<u8>) {
        match self {
            FieldType::U8 => bytes.push(value.clamp(0, 0xff) as u8),
            FieldType::U16 => bytes.extend((value.clamp(0, 0xffff) as u16).to_le_bytes()),
            FieldType::U32 => bytes.extend((value.clamp(0, 0xffff_ffff) as u32).to_le_bytes()),
            FieldType::I16 => {
                let value = value.clamp(i64::from(i16::MIN), i64::from(i16::MAX));
                bytes.extend((value as i16).to_le_bytes());
            }
            FieldType::I32 => {
                let value = value.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
                bytes.extend((value as i32).to_le_bytes());
            }
        }
    }
}

impl RecordLayout {
    /// Returns how many bytes a record takes.
    pub fn bytes(&self) -> usize {
        self.fields.iter().map(|field| field.kind.bytes()).sum()
    }

    /// Returns a record with these numbers, in the order of the fields; what a field cannot hold becomes the nearest it can.
    pub fn record<const N: usize>(&self, values: [i64; N]) -> Vec<u8> {
        debug_assert_eq!(self.fields.len(), N, "{}", self.name);
        let mut bytes = Vec::with_capacity(self.bytes());
        for (field, value) in self.fields.iter().zip(values) {
            field.kind.put(value, &mut bytes);
        }
        bytes
    }
}

/// Returns a frame of records; the caller sees to it that they fit.
pub fn records(kind: FrameKind, now: Time, count: usize, body: &[u8]) -> Vec<u8> {
    debug_assert!(HEADER_BYTES + body.len() <= FRAME_BYTES_MAX);
    let mut bytes = Vec::with_capacity(HEADER_BYTES + body.len());
    bytes.extend([kind as u8, 0]);
    put_rest(&mut bytes, count, now, body);
    bytes
}

/// Returns the frames of a text, in the order in which they must be sent.
pub fn texts(kind: FrameKind, now: Time, text: &[u8]) -> Vec<Vec<u8>> {
    let pieces: Vec<&[u8]> = text.chunks(FRAME_BYTES_MAX - HEADER_BYTES).collect();
    let last = pieces.len().saturating_sub(1);
    let frame = |(index, piece): (usize, &&[u8])| {
        let mut bytes = vec![kind as u8, if index < last { GOES_ON } else { 0 }];
        put_rest(&mut bytes, 1, now, piece);
        bytes
    };
    pieces.iter().enumerate().map(frame).collect()
}

fn put_rest(bytes: &mut Vec<u8>, count: usize, now: Time, body: &[u8]) {
    bytes.extend((count as u16).to_le_bytes());
    bytes.extend((body.len() as u32).to_le_bytes());
    bytes.extend(now.as_secs_f64().to_le_bytes());
    bytes.extend(body);
}

/// Returns a tile with its cells.
pub fn tile(slice: i16, x: i32, y: i32, cells: &[i8; tomoswarm_proto::TILE_CELLS]) -> Vec<u8> {
    let packed = packed_cells(cells);
    let numbers = [i64::from(slice), x.into(), y.into(), packed.len() as i64];
    let mut bytes = TILE.record(numbers);
    bytes.extend(packed);
    bytes
}

/// Returns the page's side of the tables, as `web/frames.js` holds it.
pub fn page_source() -> String {
    let kinds: Vec<String> = FrameKind::ALL
        .iter()
        .map(|kind| format!("  {kind:?}: {},\n", *kind as u8))
        .collect();
    let layout = |layout: &RecordLayout| {
        let fields: Vec<String> = layout
            .fields
            .iter()
            .map(|field| format!("  [\"{}\", \"{}\"],\n", field.name, field.kind.name()))
            .collect();
        format!(
            "\nexport const {} = [\n{}];\n",
            layout.name,
            fields.concat()
        )
    };
    format!(
        "// What the frames of the feed hold. Made of the table in src/dash/frame.rs by its test; not to be edited.\n\n\
         export const HEADER_BYTES = {HEADER_BYTES};\nexport const GOES_ON = {GOES_ON};\nexport const KIND = {{\n{}}};\n{}",
        kinds.concat(),
        LAYOUTS.iter().map(layout).collect::<String>()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::TILE_CELLS;

    const FOLDER: &str = env!("CARGO_MANIFEST_DIR");

    /// The frames of `tests/data/dash/frames.txt`, which the page's own code reads in the browser's test.
    fn golden() -> Vec<(&'static str, Vec<u8>)> {
        let now = Time::from_secs_f64(12.5);
        let state = STATE.record([
            3, 1, 2, 7, -1500, 2_000_000, 0, 62_831, 50, 400, 870, 40, 12,
        ]);
        let cells: [i8; TILE_CELLS] = std::array::from_fn(|place| match place {
            0..32 => 17,
            32..40 => place as i8 - 36,
            _ => -17,
        });
        let stripe = [
            1, 2, 6, 1, 1, 2, 1, 0, 2, 0, 0, 4000, 2000, 10_000, 5000, 700, 3,
        ];
        let pair = PAIR.record([1, 2, -61, 250, -32_768, 4500, 300]);
        let stripe = [STRIPE.record(stripe), vec![251, 5], vec![9, 200]].concat();
        vec![
            ("states", records(FrameKind::States, now, 1, &state)),
            ("beat", records(FrameKind::States, now, 0, &[])),
            (
                "tile",
                records(FrameKind::Tiles, now, 1, &tile(-1, 2, -3, &cells)),
            ),
            ("pair", records(FrameKind::Radio, now, 1, &pair)),
            ("stripe", records(FrameKind::Stripe, now, 1, &stripe)),
            (
                "text",
                texts(
                    FrameKind::Vehicle,
                    now,
                    "{\"id\":1,\"text\":\"<ä>\"}".as_bytes(),
                )
                .concat(),
            ),
        ]
    }

    #[test]
    fn frames_are_these_bytes() {
        let hex = |bytes: &[u8]| {
            bytes
                .iter()
                .map(|byte| format!("{byte:02x}"))
                .collect::<String>()
        };
        let lines: Vec<String> = golden()
            .iter()
            .map(|(name, bytes)| format!("{name} {}\n", hex(bytes)))
            .collect();
        let path = format!("{FOLDER}/tests/data/dash/frames.txt");
        assert_eq!(lines.concat(), std::fs::read_to_string(path).unwrap());
    }

    #[test]
    fn the_page_reads_by_the_same_table() {
        let path = format!("{FOLDER}/web/frames.js");
        let held = std::fs::read_to_string(&path).unwrap_or_default();
        if held != page_source() {
            std::fs::write(&path, page_source()).unwrap();
            panic!("web/frames.js did not say what the table says, and was written anew");
        }
    }

    #[test]
    fn a_record_is_as_long_as_its_fields_and_holds_the_nearest_of_what_it_cannot() {
        assert_eq!(STATE.bytes(), 30);
        let bytes = TILE.record([i64::MIN, i64::MAX, -1, 70_000]);
        assert_eq!(
            bytes,
            [0, 128, 255, 255, 255, 127, 255, 255, 255, 255, 255, 255]
        );
    }

    #[test]
    fn a_long_text_goes_on_in_further_frames_and_none_is_too_long() {
        let text = "ä".repeat(10_000);
        let frames = texts(FrameKind::Plan, Time::ZERO, text.as_bytes());
        assert!(frames.iter().all(|frame| frame.len() <= FRAME_BYTES_MAX));
        let flags: Vec<u8> = frames.iter().map(|frame| frame[1]).collect();
        assert_eq!(flags, [GOES_ON, GOES_ON, 0]);
        let joined: Vec<u8> = frames
            .iter()
            .flat_map(|frame| &frame[HEADER_BYTES..])
            .copied()
            .collect();
        assert_eq!(joined, text.as_bytes());
        assert_eq!(texts(FrameKind::Plan, Time::ZERO, b"").len(), 0);
    }
}
