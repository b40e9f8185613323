//! Shortest ways against Dijkstra's algorithm over an independent grid, and against published costs.

use super::*;
use crate::geom::{Bearing, Lattice};
use crate::map::CellRect;
use crate::plan::TurningCost;
use proptest::prelude::*;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

const SIDE: i32 = 24;

fn grid(side: i32, cell_m: f64, clearance_m: f64, solid: impl Fn(Cell) -> bool) -> SearchGrid {
    let area = CellRect::new(Cell::new(0, 0), Cell::new(side - 1, side - 1));
    SearchGrid::of_cells(Lattice::new(cell_m), area, clearance_m, solid).unwrap()
}

/// Dijkstra by repeated relaxation over all cells until nothing changes: slow and simple.
fn relaxed_length(
    solid: &BTreeSet<(i32, i32)>,
    from: (i32, i32),
    to: (i32, i32),
    rules: &Rules,
) -> Option<f64> {
    let open = |x: i32, y: i32| {
        (0..SIDE).contains(&x) && (0..SIDE).contains(&y) && !solid.contains(&(x, y))
    };
    let place = |x: i32, y: i32| (y * SIDE + x) as usize;
    let mut lengths = vec![f64::INFINITY; (SIDE * SIDE) as usize];
    lengths[place(from.0, from.1)] = 0.0;
    loop {
        let mut changed = false;
        for (x, y) in (0..SIDE)
            .flat_map(|x| (0..SIDE).map(move |y| (x, y)))
            .filter(|(x, y)| open(*x, *y))
        {
            for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
                let slanted = dx != 0 && dy != 0;
                let corner = slanted && !(open(x + dx, y) && open(x, y + dy));
                if !open(x + dx, y + dy)
                    || (slanted && !rules.diagonal)
                    || (corner && !rules.cut_corners)
                {
                    continue;
                }
                let length = lengths[place(x + dx, y + dy)] + f64::from(dx * dx + dy * dy).sqrt();
                if length < lengths[place(x, y)] - 1e-9 {
                    lengths[place(x, y)] = length;
                    changed = true;
                }
            }
        }
        if !changed {
            break;
        }
    }
    Some(lengths[place(to.0, to.1)]).filter(|length| length.is_finite())
}

proptest! {
    #[test]
    fn ways_are_as_short_as_any_and_steps_are_allowed(
        blocked in proptest::collection::btree_set((0..SIDE, 0..SIDE), 0..250),
        diagonal in any::<bool>(), cut_corners in any::<bool>(),
        from in (0..SIDE, 0..SIDE), to in (0..SIDE, 0..SIDE),
    ) {
        let solid: BTreeSet<(i32, i32)> = blocked.into_iter().filter(|c| *c != from && *c != to).collect();
        let rules = Rules { diagonal, cut_corners, ..Rules::default() };
        let grid = grid(SIDE, 0.2, 0.0, |cell| solid.contains(&(cell.x, cell.y)));
        let found = shortest_cells(&grid, Cell::new(from.0, from.1), Cell::new(to.0, to.1), &rules);
        match (found, relaxed_length(&solid, from, to, &rules)) {
            (Ok(found), Some(length)) => {
                prop_assert!((found.length_cells - length).abs() < 1e-6, "{} or {length}", found.length_cells);
                let walked: f64 = found.cells.windows(2).map(|pair| {
                    let (dx, dy) = (pair[1].x - pair[0].x, pair[1].y - pair[0].y);
                    assert!(dx.abs() <= 1 && dy.abs() <= 1 && (diagonal || dx * dy == 0));
                    f64::from(dx * dx + dy * dy).sqrt()
                }).sum();
                prop_assert!((walked - length).abs() < 1e-6);
                prop_assert!(found.cells.iter().all(|cell| !solid.contains(&(cell.x, cell.y))));
            }
            (Err(NoRoute::Unreachable { .. }), None) => {}
            (found, length) => prop_assert!(false, "{found:?} but {length:?}"),
        }
    }

    #[test]
    fn inflated_cells_are_those_nearer_than_the_clearance(
        blocked in proptest::collection::vec((0..SIDE, 0..SIDE), 0..80), clearance_cells in 0.0..4.0f64,
    ) {
        let grid = grid(SIDE, 0.2, clearance_cells * 0.2, |cell| blocked.contains(&(cell.x, cell.y)));
        for (x, y) in (0..SIDE).flat_map(|x| (0..SIDE).map(move |y| (x, y))) {
            let squares = blocked.iter().map(|(bx, by)| f64::from((bx - x) * (bx - x) + (by - y) * (by - y)));
            let nearest = squares.fold(f64::INFINITY, f64::min).sqrt();
            let near = nearest < clearance_cells - 1e-9 || nearest == 0.0;
            prop_assert_eq!(grid.passable(Cell::new(x, y)), !near, "{}, {}", x, y);
        }
    }
}

#[test]
fn too_large_a_grid_is_refused() {
    let area = CellRect::new(Cell::new(i32::MIN, i32::MIN), Cell::new(i32::MAX, i32::MAX));
    assert!(SearchGrid::of_cells(Lattice::new(0.2), area, 0.5, |_| false).is_err());
    let small = CellRect::new(Cell::new(0, 0), Cell::new(9, 9));
    assert!(SearchGrid::of_cells(Lattice::new(0.2), small, f64::NAN, |_| false).is_err());
    assert!(SearchGrid::of_cells(Lattice::new(0.2), small, 1e9, |_| false).is_err());
}

/// The obstacles that a fact describes in words, as (column, row) in the fact's own order (row index first).
fn obstacles(kind: &str, side: i32, from: [i32; 2], to: [i32; 2]) -> BTreeSet<[i32; 2]> {
    let mut solid = BTreeSet::new();
    match kind {
        "random" => {
            let mut state: i64 = 1;
            let mut next = || {
                state = (1_103_515_245 * state + 12_345) % (1 << 31);
                ((state >> 8) % i64::from(side)) as i32
            };
            while (solid.len() as i32) < side * side / 200 {
                let place = [next(), next()];
                let far =
                    |end: [i32; 2]| (place[0] - end[0]).abs().max((place[1] - end[1]).abs()) > 5;
                if far(from) && far(to) {
                    solid.insert(place);
                }
            }
        }
        "walls" => {
            let gap = (side / 10).max(4);
            for wall in 1..=4 {
                let rows = if wall % 2 == 1 {
                    0..side - gap
                } else {
                    gap..side
                };
                solid.extend(rows.map(|row| [row, wall * side / 5]));
            }
        }
        _ => {}
    }
    solid
}

fn facts() -> Option<Vec<Value>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/facts.json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: {} is not there", path.display());
        return None;
    };
    let all: Vec<Value> = serde_json::from_str(&text).unwrap();
    Some(
        all.into_iter()
            .filter(|fact| fact["area"] == "astar")
            .collect(),
    )
}

#[test]
fn costs_agree_with_the_recorded_facts() {
    let Some(facts) = facts() else { return };
    let mut checked = 0;
    for fact in facts.iter().filter(|fact| fact["inputs"]["cells"].is_i64()) {
        let (inputs, id) = (&fact["inputs"], fact["id"].as_str().unwrap());
        let end = |name: &str| [0, 1].map(|axis| inputs[name][axis].as_i64().unwrap() as i32);
        let (side, resolution) = (
            inputs["cells"].as_i64().unwrap() as i32,
            inputs["resolution"].as_f64().unwrap(),
        );
        let solid = obstacles(
            inputs["obstacles"].as_str().unwrap(),
            side,
            end("start"),
            end("goal"),
        );
        assert_eq!(
            solid.len() as i64,
            inputs["obstacle_count"].as_i64().unwrap(),
            "{id}"
        );
        let grid = grid(
            side,
            1.0 / resolution,
            inputs["closeness_m"].as_f64().unwrap(),
            |c| solid.contains(&[c.y, c.x]),
        );
        let cell = |[row, column]: [i32; 2]| Cell::new(column, row);
        let cost = |cut_corners: bool| {
            let rules = Rules {
                cut_corners,
                ..Rules::default()
            };
            shortest_cells(&grid, cell(end("start")), cell(end("goal")), &rules)
                .unwrap()
                .length_cells
                / resolution
        };
        let expected = fact["expected"]["cost"].as_f64().unwrap();
        assert!(
            (cost(true) - expected).abs() < 1e-6,
            "{id}: {} or {expected}",
            cost(true)
        );
        let uncut = match id {
            "astar-009" => 90.619,
            "astar-013" => 452.891,
            "astar-015" => 175.251,
            _ => expected,
        };
        assert!(
            (cost(false) - uncut).abs() < 6e-4,
            "{id} without cut corners: {}",
            cost(false)
        );
        checked += 1;
    }
    assert!(checked >= 6);
}

#[test]
fn a_four_connected_way_round_the_border_and_a_full_wall() {
    let Some(facts) = facts() else { return };
    let rules = Rules {
        diagonal: false,
        ..Rules::default()
    };
    let interior = |cell: Cell| (1..=8).contains(&cell.x) && (1..=8).contains(&cell.y);
    let round = grid(10, 1.0, 0.0, |cell| {
        interior(cell) || (cell.y, cell.x) == (9, 0)
    });
    let found = shortest_cells(&round, Cell::new(0, 0), Cell::new(9, 9), &rules).unwrap();
    let fact = facts.iter().find(|fact| fact["id"] == "astar-001").unwrap();
    let expected = &fact["expected"]["path"];
    let way: Vec<Value> = found.cells[1..]
        .iter()
        .map(|cell| serde_json::json!([cell.y, cell.x]))
        .collect();
    assert_eq!(&Value::Array(way), expected);
    let turning = TurningCost {
        cost_m_per_rad: fact["inputs"]["turning_cost_per_rad"].as_f64().unwrap(),
        heading: Some(
            Bearing::from_degrees(fact["inputs"]["start_bearing_deg"].as_f64().unwrap()).angle(),
        ),
    };
    let turns = Rules {
        turning: Some(turning),
        ..rules
    };
    let turned = shortest_cells(&round, Cell::new(0, 0), Cell::new(9, 9), &turns).unwrap();
    assert_eq!(turned.cells, found.cells);
    assert!((turned.cost_cells - fact["expected"]["cost"].as_f64().unwrap()).abs() < 1e-9);
    let wall = grid(50, 1.0, 0.0, |cell| cell.x == 20);
    let shut = shortest_cells(&wall, Cell::new(0, 0), Cell::new(49, 49), &Rules::default());
    assert_eq!(shut, Err(NoRoute::Unreachable { searched: 20 * 50 }));
}
