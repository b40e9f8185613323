//! What is shown of the cells of the merged map: what is occupied, and how surely something is free. What a page draws alike is
//! sent alike; so what changes nothing that is seen goes to nobody, and tiles take fewer bytes.

use tomoswarm_proto::TILE_CELLS;

use crate::map::Occupancy;

/// From this value on, 0.1 log-odds, a cell is as surely free, or occupied, as a page draws one (`SURE` of `web/draw.js`).
const SURE: i8 = 17;

/// Returns the cells of a tile as they are shown, from their values in 0.1 log-odds.
pub(super) fn shown_cells(values: [i8; TILE_CELLS]) -> [i8; TILE_CELLS] {
    values.map(|value| match Occupancy::of_value(value.into()) {
        Occupancy::Occupied => SURE,
        Occupancy::Unknown => 0,
        Occupancy::Free => value.max(-SURE),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(value: i8) -> i8 {
        shown_cells([value; TILE_CELLS])[0]
    }

    #[test]
    fn cells_keep_what_they_are_and_how_surely_they_are_free() {
        for value in i8::MIN..=i8::MAX {
            let of = |value: i8| Occupancy::of_value(value.into());
            assert_eq!(of(shown(value)), of(value), "{value}");
            assert_eq!(shown(shown(value)), shown(value), "{value}");
        }
        let values = [9, 40, 8, -7, -8, -16, -17, -60];
        assert_eq!(values.map(shown), [17, 17, 0, 0, -8, -16, -17, -17]);
    }

    #[test]
    fn the_page_draws_by_the_same_limits() {
        let source = std::fs::read_to_string(format!("{}/web/draw.js", env!("CARGO_MANIFEST_DIR")));
        let source = source.unwrap();
        let limit = |name: &str| {
            let line = source
                .lines()
                .find(|line| line.contains(&format!("const {name} = ")));
            let number = line.and_then(|line| line.rsplit("= ").next()?.strip_suffix(';'));
            number.and_then(|number| number.parse::<i8>().ok())
        };
        let occupied = (i8::MIN..=i8::MAX).find(|value| shown(*value) == SURE);
        let free = (i8::MIN..=i8::MAX).rev().find(|value| shown(*value) < 0);
        assert_eq!(limit("OCCUPIED_FROM"), occupied);
        assert_eq!((limit("FREE_TO"), limit("SURE")), (free, Some(SURE)));
    }
}
