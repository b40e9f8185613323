//! Measures what is kept up to date around changes: clearance and frontiers. Run: `cargo bench --bench plan`.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use tomoswarm::geom::{Cell, Lattice, Point, Polygon};
use tomoswarm::map::{CellRect, Merged};
use tomoswarm::plan::{
    Clearance, Distances, Frontiers, Rules, SearchGrid, route_along, shortest_cells,
};
use tomoswarm_proto::{Boot, LayerId, TILE_CELLS, TileAddress, TileReport, VehicleId};

/// Tiles along each side of the ground.
const TILES: i32 = 12;
const SIDE: i32 = 32 * TILES;
const HALF_WIDTH_M: f64 = 0.4;

fn main() {
    let mut map = Merged::new(Lattice::new(0.2), None);
    let tiles = (0..TILES * TILES).map(|number| (number % TILES, number / TILES));
    tiles.for_each(|(x, y)| write(&mut map, 1, x, y, |cell| ground(cell, 1)));
    let area = CellRect::new(Cell::new(0, 0), Cell::new(SIDE - 1, SIDE - 1));
    kept(&mut map, area);
    from_scratch(&map, area);
    many_goals(&map, area);
}

/// Changes one tile after the other, as scans do: the values of one strip of cells.
fn kept(map: &mut Merged, area: CellRect) {
    let lattice = map.lattice();
    let mut clearance = Clearance::new(lattice, 0, area, 1.6, true).expect("the area is small");
    let mut frontiers = Frontiers::new(lattice, 0, area, |_| true).expect("the area is small");
    clearance.update(map, area);
    frontiers.update(map, area);
    let (mut clearance_us, mut frontiers_us) = (Vec::new(), Vec::new());
    for change in 0..400_u32 {
        let (x, y) = ((change * 7) as i32 % TILES, (change * 5) as i32 % TILES);
        write(map, 2 + change, x, y, |cell| {
            let in_strip =
                cell.x.rem_euclid(32).abs_diff((change % 24) as i32) < 6 && cell.y % 32 < 12;
            ground(cell, if in_strip { u64::from(change) } else { 1 })
        });
        let changed = CellRect::new(
            Cell::new(32 * x, 32 * y),
            Cell::new(32 * x + 31, 32 * y + 31),
        );
        clearance_us.push(1e3 * ms(|| clearance.update(map, changed)));
        frontiers_us.push(1e3 * ms(|| frontiers.update(map, changed)));
    }
    println!(
        "per changed tile, {SIDE} x {SIDE} cells: clearance (reach 8 cells) {:.1} us",
        median(&mut clearance_us)
    );
    println!(
        "                                       frontiers {:.1} us",
        median(&mut frontiers_us)
    );
    println!(
        "{} frontier cells in {} clusters",
        frontiers
            .clusters()
            .map(|cluster| cluster.size())
            .sum::<usize>(),
        frontiers.clusters().count()
    );
    let mut grids: Vec<f64> = (0..21)
        .map(|_| {
            ms(|| {
                drop(black_box(SearchGrid::of_clearance(
                    &clearance,
                    area,
                    HALF_WIDTH_M,
                )))
            })
        })
        .collect();
    println!("a grid of kept clearance: {:.2} ms", median(&mut grids));
}

fn from_scratch(map: &Merged, area: CellRect) {
    let view = map.view(0, area);
    let mut grids: Vec<f64> = (0..21)
        .map(|_| {
            ms(|| {
                drop(black_box(SearchGrid::of_map(
                    &view,
                    area,
                    HALF_WIDTH_M,
                    false,
                )))
            })
        })
        .collect();
    println!("a grid of the map, inflated: {:.2} ms", median(&mut grids));
    let mut clearance: Vec<f64> = (0..9)
        .map(|_| {
            let mut fresh =
                Clearance::new(map.lattice(), 0, area, 1.6, true).expect("the area is small");
            ms(|| fresh.update(map, area))
        })
        .collect();
    println!("clearance from scratch: {:.2} ms", median(&mut clearance));
    let mut frontiers: Vec<f64> = (0..9)
        .map(|_| {
            let mut fresh =
                Frontiers::new(map.lattice(), 0, area, |_| true).expect("the area is small");
            ms(|| fresh.update(map, area))
        })
        .collect();
    println!("frontiers from scratch: {:.2} ms", median(&mut frontiers));
    let corners = [
        (2.0, 2.0),
        (70.0, 5.0),
        (75.0, 40.0),
        (66.0, 74.0),
        (30.0, 60.0),
        (3.0, 70.0),
    ];
    let fence = Polygon::new(
        corners
            .into_iter()
            .map(|(x_m, y_m)| Point::new(x_m, y_m))
            .collect(),
    );
    let empty =
        SearchGrid::of_cells(map.lattice(), area, 0.0, |_| false).expect("the area is small");
    let mut asked: Vec<f64> = (0..9)
        .map(|_| {
            let mut grid = empty.clone();
            ms(|| grid.close_where(|place| !fence.contains_disc(place, HALF_WIDTH_M)))
        })
        .collect();
    let mut swept: Vec<f64> = (0..9)
        .map(|_| {
            let mut grid = empty.clone();
            ms(|| grid.close_outside(&fence, HALF_WIDTH_M))
        })
        .collect();
    println!(
        "a fence: {:.2} ms cell by cell, {:.2} ms along its edges",
        median(&mut asked),
        median(&mut swept)
    );
}

fn many_goals(map: &Merged, area: CellRect) {
    let grid = SearchGrid::of_map(&map.view(0, area), area, 0.1, false).expect("the area is small");
    let rules = Rules::default();
    let all = || (0..SIDE * SIDE).map(|number| Cell::new(number % SIDE, number / SIDE));
    let reached_of = |from: &Distances| all().filter(|cell| from.cost_m(*cell).is_some()).count();
    let reached = |start: Cell| {
        Distances::from_start(&grid, start, &rules).map_or(0, |from| reached_of(&from))
    };
    let starts = (0..SIDE).map(|place| Cell::new(place, place));
    let start = starts
        .max_by_key(|start| reached(*start))
        .expect("there are cells");
    let mut times: Vec<f64> = (0..21)
        .map(|_| ms(|| drop(black_box(Distances::from_start(&grid, start, &rules)))))
        .collect();
    let distances = Distances::from_start(&grid, start, &rules).expect("the start is free");
    println!(
        "one search to all {} cells: {:.2} ms",
        reached_of(&distances),
        median(&mut times)
    );
    let goals = (0..SIDE).map(|number| Cell::new((number * 37) % SIDE, (number * 91) % SIDE));
    let middle = |cell: Cell| grid.lattice().centre(cell);
    let found: Vec<(Cell, Vec<Cell>)> = goals
        .filter_map(|goal| Some((goal, shortest_cells(&grid, start, goal, &rules).ok()?.cells)))
        .collect();
    let mut times: Vec<f64> = found
        .iter()
        .map(|(goal, cells)| {
            ms(|| {
                drop(black_box(route_along(
                    &grid,
                    middle(start),
                    cells,
                    middle(*goal),
                )))
            })
        })
        .collect();
    println!(
        "straightening one of {} ways: {:.3} ms",
        found.len(),
        median(&mut times)
    );
}

/// Joins a tile of the given values.
fn write(map: &mut Merged, revision: u32, x: i32, y: i32, value: impl Fn(Cell) -> i8) {
    let layer = LayerId {
        vehicle: VehicleId(1),
        boot: Boot(1),
    };
    let mut cells = [0; TILE_CELLS];
    for (index, cell) in cells.iter_mut().enumerate() {
        *cell = value(Cell::new(
            32 * x + (index % 32) as i32,
            32 * y + (index / 32) as i32,
        ));
    }
    let report = TileReport {
        layer,
        address: TileAddress { slice: 0, x, y },
        revision,
        cells: Arc::new(cells),
    };
    map.join(&report).expect("the map is small");
}

/// Ground with stones and patches that nobody has seen.
fn ground(cell: Cell, seed: u64) -> i8 {
    if cell.x + cell.y < 4 {
        return -17;
    }
    let patch = mix(seed, Cell::new(cell.x / 9, cell.y / 9)) % 100;
    match (patch < 8, mix(seed, cell) % 100 < 4) {
        (true, _) => 0,
        (false, true) => 17,
        (false, false) => -17,
    }
}

fn ms(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A hash of seed and cell.
fn mix(seed: u64, cell: Cell) -> u64 {
    let mut z = (seed << 40) ^ ((cell.x as u64) << 20) ^ cell.y as u64;
    z = (z ^ (z >> 30))
        .wrapping_add(0x9e37_79b9_7f4a_7c15)
        .wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
