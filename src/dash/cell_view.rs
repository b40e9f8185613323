//! Which vehicles have seen a cell of the map, what each says of it, and since when its tile is known as it is. Of the map
//! it reads the layers (a vehicle's start writes one); it keeps a moment for each tile that the map has taken, so it is
//! bounded as that is.
//!
//! A moment is that at which this program heard the tile. What a tile said before it was heard first is not known: then the
//! vehicle may have seen it earlier.

use std::collections::BTreeMap;

use tomoswarm_proto::{LayerId, TileAddress, TileReport};

use super::board::Board;
use super::told::{CellWord, ToldCell, as_text};
use crate::geom::Point;
use crate::map::{Occupancy, address_of, index_in_tile};
use crate::time::Time;

/// Layers told of one cell at most, those that changed last.
const TOLD_MAX: usize = 40;

/// When a tile of a layer changed last.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct TileChange {
    at: Time,
    /// It had changed before it was heard first, nobody knows when.
    may_be_older: bool,
}

/// When the tiles of all layers changed last.
#[derive(Clone, Debug, Default)]
pub struct TileChanges {
    changes: BTreeMap<(LayerId, TileAddress), TileChange>,
}

impl TileChanges {
    /// Takes that the map has taken a tile.
    pub fn hear(&mut self, now: Time, report: &TileReport) {
        let key = (report.layer, report.address);
        let change = TileChange {
            at: now,
            may_be_older: report.revision > 1 && !self.changes.contains_key(&key),
        };
        self.changes.insert(key, change);
    }

    /// Returns how many bytes a copy of it takes, about.
    pub fn bytes(&self) -> usize {
        self.changes.len() * size_of::<((LayerId, TileAddress), TileChange)>()
    }
}

/// Returns what vehicles say of a cell, JSON: those whose tile changed last first; `slice`: of one slice of altitude, or of
/// all.
pub fn cell(now: Time, board: &Board, at: Point, slice: Option<i16>) -> String {
    let lattice = board.map().lattice();
    let cell = lattice.cell_at(at);
    let centre = lattice.centre(cell);
    let wanted = address_of(0, cell).map(|address| (address.x, address.y));
    let is_there = |address: &TileAddress| {
        wanted == Some((address.x, address.y)) && slice.is_none_or(|slice| slice == address.slice)
    };
    let changes = board.tile_changes().changes.iter();
    let mut told: Vec<(&TileChange, CellWord)> = changes
        .filter(|((_, address), _)| is_there(address))
        .filter_map(|((layer, address), change)| {
            let tile = board.map().layer(*layer)?.tile(*address)?;
            let value = tile.cells[index_in_tile(cell)];
            (value != 0).then(|| (change, told_by(now, *layer, (address.slice, value), change)))
        })
        .collect();
    told.sort_by_key(|(change, _)| std::cmp::Reverse(change.at));
    let left_out = told.len().saturating_sub(TOLD_MAX);
    let told = told.into_iter().take(TOLD_MAX).map(|(_, value)| value);
    as_text(&ToldCell {
        at: [centre.x_m, centre.y_m],
        at_s: now.as_secs_f64(),
        told: told.collect(),
        left_out,
    })
}

fn told_by(now: Time, layer: LayerId, (slice, value): (i16, i8), change: &TileChange) -> CellWord {
    let word = match Occupancy::of_value(value.into()) {
        Occupancy::Free => "free",
        Occupancy::Unknown => "unknown",
        Occupancy::Occupied => "occupied",
    };
    CellWord {
        vehicle: layer.vehicle.0,
        boot: layer.boot.0,
        slice,
        says: word,
        log_odds: f64::from(value) / 10.0,
        age_s: (now.since(change.at).as_secs_f64() * 10.0).round() / 10.0,
        may_be_older: change.may_be_older,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tomoswarm_proto::{Boot, Message, TILE_CELLS, VehicleId};

    use super::*;
    use crate::dash::board::BoardInput;
    use crate::geom::Lattice;
    use crate::operator::HeardMessage;
    use crate::operator::tests_support::{at, heard};
    use serde_json::{Value, json};

    /// A tile of a vehicle's start, of which one cell has a value.
    fn tile((vehicle, boot): (u8, u32), slice: i16, revision: u32, value: i8) -> HeardMessage {
        let mut cells = [0; TILE_CELLS];
        cells[2 * 32 + 5] = value;
        heard(Message::Tile(TileReport {
            layer: LayerId {
                vehicle: VehicleId(vehicle),
                boot: Boot(boot),
            },
            address: TileAddress { slice, x: 1, y: -1 },
            revision,
            cells: Arc::new(cells),
        }))
    }

    /// A place in that cell.
    const THERE: Point = Point {
        x_m: 3.75,
        y_m: -2.95,
    };

    fn told(board: &Board, now_s: f64, slice: Option<i16>) -> Vec<[String; 6]> {
        let text = cell(at(now_s), board, THERE, slice);
        let read: Value = serde_json::from_str(&text).unwrap();
        let keys = ["vehicle", "boot", "slice", "says", "age_s", "mayBeOlder"];
        let line = |of: &Value| keys.map(|key| of[key].to_string());
        read["told"].as_array().unwrap().iter().map(line).collect()
    }

    #[test]
    fn a_cell_names_who_has_seen_it_what_each_says_and_since_when() {
        let mut board = Board::new(7, Lattice::new(0.1));
        for (at_s, message) in [
            (1.0, tile((1, 1), 0, 1, 9)),
            (2.0, tile((2, 1), 0, 40, -17)),
            (3.0, tile((3, 1), 0, 1, 0)),
            (4.0, tile((1, 2), 0, 1, 4)),
            (5.0, tile((4, 1), 2, 1, 17)),
            // What is old or known changes nothing.
            (6.0, tile((2, 1), 0, 39, 17)),
            (6.0, tile((1, 1), 0, 1, 9)),
        ] {
            board.take(at(at_s), &BoardInput::Heard(message));
        }
        let rows = told(&board, 10.0, Some(0));
        let row = |of: [&str; 6]| of.map(str::to_owned);
        let of_others = [
            row(["1", "2", "0", "\"unknown\"", "6.0", "false"]),
            row(["2", "1", "0", "\"free\"", "8.0", "true"]),
            row(["1", "1", "0", "\"occupied\"", "9.0", "false"]),
        ];
        assert_eq!(rows, of_others);
        let above = row(["4", "1", "2", "\"occupied\"", "5.0", "false"]);
        let of_above = told(&board, 10.0, Some(2));
        assert_eq!((of_above.len(), &of_above[0]), (1, &above));
        let all = told(&board, 10.0, None);
        assert_eq!((all.len(), &all[0]), (4, &above));
        // It changes again, and from then on it is known when.
        board.take(at(11.0), &BoardInput::Heard(tile((2, 1), 0, 41, 17)));
        let newest = row(["2", "1", "0", "\"occupied\"", "1.0", "false"]);
        assert_eq!(told(&board, 12.0, Some(0))[0], newest);
    }

    #[test]
    fn beyond_the_map_nobody_says_anything_and_of_many_the_last_are_told() {
        let mut board = Board::new(7, Lattice::new(0.1));
        for boot in 1..=60 {
            let message = tile((1, boot), 0, 1, 9);
            board.take(at(f64::from(boot)), &BoardInput::Heard(message));
        }
        let read = |of: String| -> Value { serde_json::from_str(&of).unwrap() };
        let many = read(cell(at(60.0), &board, THERE, None));
        assert_eq!(many["told"].as_array().unwrap().len(), TOLD_MAX);
        assert_eq!(
            (&many["told"][0]["boot"], &many["leftOut"]),
            (&json!(60), &json!(20))
        );
        let far = read(cell(at(60.0), &board, Point::new(1e9, -1e9), None));
        assert_eq!(far["told"], json!([]));
    }
}
