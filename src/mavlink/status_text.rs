//! Lines of text for people at a ground station (<https://mavlink.io/en/messages/common.html#STATUSTEXT>).

use super::dialect::{MavMessage, MavSeverity, STATUSTEXT_DATA};

/// A text has room for so many bytes.
const ROOM: usize = 50;
/// The longest text that is told in pieces, bytes.
const LONGEST: usize = 4 * ROOM;

/// Returns a line of text; what does not fit is left out.
pub fn line(severity: MavSeverity, text: &str) -> MavMessage {
    let letters: String = text.chars().filter(char::is_ascii).take(ROOM).collect();
    piece(severity, &letters, 0, 0)
}

/// Returns a text in as many pieces as it needs, 200 bytes at most; `id` joins them and is not 0.
pub fn lines(severity: MavSeverity, text: &str, id: u16) -> Vec<MavMessage> {
    let letters: Vec<char> = text.chars().filter(char::is_ascii).take(LONGEST).collect();
    if letters.len() <= ROOM {
        return vec![line(severity, text)];
    }
    // One that fills its room has no end: a last piece that is shorter says so.
    let ends = letters.len().is_multiple_of(ROOM) && letters.len() < LONGEST;
    let pieces = letters.chunks(ROOM).map(|piece| piece.iter().collect());
    let all: Vec<String> = pieces.chain(ends.then(String::new)).collect();
    let numbered = all.iter().zip(0..);
    numbered
        .map(|(text, number)| piece(severity, text, id, number))
        .collect()
}

fn piece(severity: MavSeverity, text: &str, id: u16, chunk_seq: u8) -> MavMessage {
    MavMessage::STATUSTEXT(STATUSTEXT_DATA {
        severity,
        text: text.into(),
        id,
        chunk_seq,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_comes_in_pieces_of_which_the_last_is_shorter() {
        let pieces = |count: usize| {
            let all = lines(MavSeverity::MAV_SEVERITY_INFO, &"x".repeat(count), 7);
            let told = all.iter().map(|message| match message {
                MavMessage::STATUSTEXT(said) => {
                    let length = said.text.to_str().unwrap().len();
                    (said.id, said.chunk_seq, length)
                }
                other => panic!("{other:?}"),
            });
            told.collect::<Vec<_>>()
        };
        assert_eq!(pieces(50), [(0, 0, 50)]);
        assert_eq!(pieces(77), [(7, 0, 50), (7, 1, 27)]);
        assert_eq!(pieces(100), [(7, 0, 50), (7, 1, 50), (7, 2, 0)]);
        assert_eq!(pieces(900).len(), 4);
    }
}
