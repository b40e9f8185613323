//! Cheapest ways with turns, dear cells and escapes against Dijkstra's algorithm over the same states, written a second
//! time: all pairs of headings, costs in floating point, a list instead of a queue.

use super::*;
use crate::geom::{Angle, Lattice};
use crate::map::{CellRect, Merged};
use crate::plan::{Clearance, NoRoute, Rules, SearchGrid, TurningCost, shortest_cells};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::sync::Arc;
use tomoswarm_proto::{Boot, LayerId, TILE_CELLS, TileAddress, TileReport, VehicleId};

const SIDE: i32 = 11;
const CELL_M: f64 = 0.2;

type Place = (i32, i32);

/// The ground as the tests see it.
struct Ground {
    stones: BTreeSet<Place>,
    clearance_cells: f64,
    /// Wished clearance in cells, and what it costs more at a stone.
    wish: Option<(f64, f64)>,
}

impl Ground {
    fn distance_cells(&self, at: Place) -> f64 {
        let squares = self
            .stones
            .iter()
            .map(|(x, y)| f64::from((x - at.0).pow(2) + (y - at.1).pow(2)));
        squares.fold(f64::INFINITY, f64::min).sqrt()
    }

    fn is_open(&self, at: Place) -> bool {
        let inside = (0..SIDE).contains(&at.0) && (0..SIDE).contains(&at.1);
        inside
            && !self.stones.contains(&at)
            && self.distance_cells(at) >= self.clearance_cells - 1e-9
    }

    fn is_only_near(&self, at: Place) -> bool {
        (0..SIDE).contains(&at.0)
            && (0..SIDE).contains(&at.1)
            && !self.stones.contains(&at)
            && !self.is_open(at)
    }

    /// What a step into a cell costs, as a multiple of its length.
    fn times(&self, at: Place) -> f64 {
        let Some((wished_cells, extra)) = self.wish else {
            return 1.0;
        };
        let times = 1.0 + extra * (1.0 - self.distance_cells(at) / wished_cells).max(0.0);
        (times * 8.0).round() / 8.0
    }
}

/// Returns the least cost in cells.
fn dijkstra(ground: &Ground, from: Place, to: Place, rules: &Rules) -> Option<f64> {
    let escape = ground.is_only_near(from) && rules.escape_m > 0.0;
    let near_start =
        |at: Place| f64::from((at.0 - from.0).pow(2) + (at.1 - from.1).pow(2)).sqrt() * CELL_M;
    let escapes =
        |at: Place| escape && ground.is_only_near(at) && near_start(at) <= rules.escape_m + 1e-12;
    let enterable = |at: Place| ground.is_open(at) || escapes(at);
    if !enterable(from) || !ground.is_open(to) {
        return None;
    }
    let cells_per_rad = rules
        .turning
        .map_or(0.0, |turning| turning.cost_m_per_rad / CELL_M);
    // Directions in degrees; 999 = none yet.
    let mut known: BTreeMap<(Place, i32), f64> = BTreeMap::from([((from, 999), 0.0)]);
    let mut done: BTreeSet<(Place, i32)> = BTreeSet::new();
    loop {
        let open = known.iter().filter(|(state, _)| !done.contains(state));
        let ((at, heading), cost) = open
            .min_by(|a, b| a.1.total_cmp(b.1))
            .map(|(state, cost)| (*state, *cost))?;
        if at == to {
            return Some(cost);
        }
        done.insert((at, heading));
        for (dx, dy) in (-1..=1)
            .flat_map(|dx| (-1..=1).map(move |dy| (dx, dy)))
            .filter(|d| *d != (0, 0))
        {
            let next = (at.0 + dx, at.1 + dy);
            let slanted = dx != 0 && dy != 0;
            let corner = slanted && !(enterable((at.0 + dx, at.1)) && enterable((at.0, at.1 + dy)));
            if !enterable(next) || (slanted && !rules.diagonal) || (corner && !rules.cut_corners) {
                continue;
            }
            let direction = f64::from(dy).atan2(f64::from(dx)).to_degrees();
            let before = match (heading, rules.turning.and_then(|turning| turning.heading)) {
                (999, None) => direction,
                (999, Some(start)) => start.degrees(),
                (heading, _) => f64::from(heading),
            };
            let turn = (direction - before).abs() % 360.0;
            let turn_rad = turn.min(360.0 - turn) / 180.0 * PI;
            let times = if ground.is_open(next) {
                ground.times(next)
            } else {
                4.0
            };
            let new = cost + f64::from(dx * dx + dy * dy).sqrt() * times + turn_rad * cells_per_rad;
            // Without a price for turns all headings are one.
            let heading = if rules.turning.is_some() {
                direction.round() as i32
            } else {
                0
            };
            let best = known.entry((next, heading)).or_insert(f64::INFINITY);
            *best = best.min(new);
        }
    }
}

/// A map in which everything is free but the stones.
fn map_of(stones: &BTreeSet<Place>) -> Merged {
    let mut cells = [-17; TILE_CELLS];
    stones
        .iter()
        .for_each(|(x, y)| cells[(y * 32 + x) as usize] = 17);
    let mut map = Merged::new(Lattice::new(CELL_M), None);
    let layer = LayerId {
        vehicle: VehicleId(1),
        boot: Boot(1),
    };
    let address = TileAddress {
        slice: 0,
        x: 0,
        y: 0,
    };
    map.join(&TileReport {
        layer,
        address,
        revision: 1,
        cells: Arc::new(cells),
    })
    .unwrap();
    map
}

fn grid_of(ground: &Ground) -> SearchGrid {
    let area = CellRect::new(Cell::new(0, 0), Cell::new(SIDE - 1, SIDE - 1));
    let lattice = Lattice::new(CELL_M);
    let solid = |cell: Cell| ground.stones.contains(&(cell.x, cell.y));
    let mut grid =
        SearchGrid::of_cells(lattice, area, ground.clearance_cells * CELL_M, solid).unwrap();
    if let Some((wished_cells, extra)) = ground.wish {
        let mut clearance = Clearance::new(lattice, 0, area, 8.0 * CELL_M, false).unwrap();
        clearance.update(&map_of(&ground.stones), area);
        grid.prefer_clearance(&clearance, wished_cells * CELL_M, extra);
    }
    grid
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn ways_are_as_cheap_as_any_over_the_same_states(
        stones in proptest::collection::btree_set((0..SIDE, 0..SIDE), 0..45),
        clearance_cells in prop_oneof![Just(0.0), 0.5..2.5f64],
        wish in proptest::option::of((1.0..6.0f64, 0.1..3.0f64)),
        (diagonal, cut_corners) in (any::<bool>(), any::<bool>()),
        escape_m in prop_oneof![Just(0.0), 0.0..1.0f64],
        turning in proptest::option::of((0.0..1.5f64, proptest::option::of(-180.0..180.0f64))),
        from in (0..SIDE, 0..SIDE), to in (0..SIDE, 0..SIDE),
    ) {
        let ground = Ground { stones, clearance_cells, wish };
        let turning = turning.map(|(cost_m_per_rad, heading)| TurningCost {
            cost_m_per_rad,
            heading: heading.map(Angle::from_degrees),
        });
        let rules = Rules { diagonal, cut_corners, escape_m, turning };
        let grid = grid_of(&ground);
        let found = shortest_cells(&grid, Cell::new(from.0, from.1), Cell::new(to.0, to.1), &rules);
        match (found, dijkstra(&ground, from, to, &rules)) {
            (Ok(found), Some(cost)) => {
                prop_assert!((found.cost_cells - cost).abs() < 1e-6, "{} or {cost}", found.cost_cells);
                let ends = (found.cells[0], found.cells[found.cells.len() - 1]);
                prop_assert_eq!(ends, (Cell::new(from.0, from.1), Cell::new(to.0, to.1)));
                for cell in &found.cells {
                    let at = (cell.x, cell.y);
                    prop_assert!(ground.is_open(at) || ground.is_only_near(at) && ground.is_only_near(from));
                }
                if wish.is_none() && ground.is_open(from) {
                    let per_rad = turning.map_or(0.0, |turning| turning.cost_m_per_rad / CELL_M);
                    let sum = found.length_cells + per_rad * found.turned_rad;
                    prop_assert!((found.cost_cells - sum).abs() < 1e-6);
                }
            }
            (Err(NoRoute::Unreachable { .. }), None) => {}
            (Err(NoRoute::StartBarred), None) => prop_assert!(!ground.is_open(from)),
            (Err(NoRoute::GoalBarred), None) => prop_assert!(!ground.is_open(to)),
            (found, cost) => prop_assert!(false, "{found:?} but {cost:?}"),
        }
    }
}

#[test]
fn who_pays_for_turns_drives_a_detour_with_fewer() {
    let stones = [(2, 2), (3, 4), (5, 3), (6, 5), (7, 2)]
        .into_iter()
        .collect();
    let ground = Ground {
        stones,
        clearance_cells: 0.0,
        wish: None,
    };
    let grid = grid_of(&ground);
    let go = |cost_m_per_rad: f64| {
        let turning = TurningCost {
            cost_m_per_rad,
            heading: Some(Angle::from_degrees(0.0)),
        };
        let rules = Rules {
            turning: Some(turning),
            ..Rules::default()
        };
        shortest_cells(&grid, Cell::new(0, 3), Cell::new(10, 3), &rules).unwrap()
    };
    let (cheap, dear) = (go(0.0), go(1.0));
    assert!(dear.turned_rad < cheap.turned_rad - 0.1 && dear.length_cells > cheap.length_cells);
    assert!((go(f64::NAN).cost_cells - cheap.length_cells).abs() < 1e-9);
    assert!(go(1e300).cost_cells.is_finite());
}

#[test]
fn too_large_a_grid_is_not_searched_with_headings() {
    let area = CellRect::new(Cell::new(0, 0), Cell::new(1999, 999));
    let grid = SearchGrid::of_cells(Lattice::new(CELL_M), area, 0.0, |_| false).unwrap();
    let turning = Some(TurningCost {
        cost_m_per_rad: 0.1,
        heading: None,
    });
    let rules = Rules {
        turning,
        ..Rules::default()
    };
    let found = shortest_cells(&grid, Cell::new(0, 0), Cell::new(5, 5), &rules);
    assert!(matches!(found, Err(NoRoute::TooLargeToTurn { .. })));
}
