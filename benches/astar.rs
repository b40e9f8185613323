//! Measures searches over 400 × 400 cells. Run: `cargo bench --bench astar`.
#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use std::hint::black_box;
use std::time::Instant;

use tomoswarm::geom::{Angle, Cell, Lattice};
use tomoswarm::map::CellRect;
use tomoswarm::plan::{Rules, SearchGrid, TurningCost, shortest_cells, shortest_route};

const SIDE: i32 = 400;

fn main() {
    let rules = Rules::default();
    let serpentine =
        grid(|cell| cell.y % 4 == 2 && cell.x != if cell.y % 8 == 2 { 0 } else { SIDE - 1 });
    let mut times: Vec<f64> = (0..9).map(|_| search_ms(&serpentine, &rules).0).collect();
    let (_, expanded) = search_ms(&serpentine, &rules);
    println!(
        "serpentine: median {:.2} ms, {expanded} cells expanded",
        percentile(&mut times, 0.5)
    );
    let grids: Vec<SearchGrid> = (0..101)
        .map(|seed| grid(|cell| mix(seed, cell) % 100 < 22 && !is_end(cell)))
        .collect();
    let mut times: Vec<f64> = grids.iter().map(|grid| search_ms(grid, &rules).0).collect();
    let mut expanded: Vec<f64> = grids
        .iter()
        .map(|grid| search_ms(grid, &rules).1 as f64)
        .collect();
    let cells = percentile(&mut expanded, 0.5);
    println!(
        "22 % blocked: median {:.2} ms, {cells} cells expanded",
        percentile(&mut times, 0.5)
    );
    let solved = grids
        .iter()
        .filter(|grid| search_ms(grid, &rules).1 > 0)
        .count();
    println!("              {solved} of 101 have a way");
    println!(
        "              95 % under {:.2} ms",
        percentile(&mut times, 0.95)
    );
    let mut times: Vec<f64> = grids.iter().map(|grid| route_ms(grid, &rules)).collect();
    println!(
        "  with straightening: median {:.2} ms",
        percentile(&mut times, 0.5)
    );
    let turning = TurningCost {
        cost_m_per_rad: 0.1,
        heading: Some(Angle::from_degrees(90.0)),
    };
    let turning = Rules {
        turning: Some(turning),
        ..rules
    };
    let mut times: Vec<f64> = (0..9).map(|_| search_ms(&serpentine, &turning).0).collect();
    println!(
        "serpentine with turning: median {:.2} ms",
        percentile(&mut times, 0.5)
    );
    let mut times: Vec<f64> = grids
        .iter()
        .map(|grid| search_ms(grid, &turning).0)
        .collect();
    println!(
        "22 % blocked with turning: median {:.2} ms",
        percentile(&mut times, 0.5)
    );
    println!(
        "                           95 % under {:.2} ms",
        percentile(&mut times, 0.95)
    );
    let mut times: Vec<f64> = (0..9).map(inflate_ms).collect();
    println!(
        "making a grid, 22 % blocked, 3 cells clearance: median {:.2} ms",
        percentile(&mut times, 0.5)
    );
}

fn grid(solid: impl Fn(Cell) -> bool) -> SearchGrid {
    SearchGrid::of_cells(Lattice::new(0.2), area(), 0.0, solid).expect("the area is small")
}

fn area() -> CellRect {
    CellRect::new(Cell::new(0, 0), Cell::new(SIDE - 1, SIDE - 1))
}

/// Returns whether a cell is one of the two corners that are joined.
fn is_end(cell: Cell) -> bool {
    cell.x + cell.y <= 2 || cell.x + cell.y >= 2 * SIDE - 4
}

fn search_ms(grid: &SearchGrid, rules: &Rules) -> (f64, usize) {
    let start = Instant::now();
    let found = black_box(shortest_cells(
        grid,
        Cell::new(0, 0),
        Cell::new(SIDE - 2, SIDE - 1),
        rules,
    ));
    (
        start.elapsed().as_secs_f64() * 1e3,
        found.map_or(0, |found| found.expanded),
    )
}

fn route_ms(grid: &SearchGrid, rules: &Rules) -> f64 {
    let (from, to) = (
        grid.lattice().centre(Cell::new(0, 0)),
        grid.lattice().centre(Cell::new(SIDE - 2, SIDE - 1)),
    );
    let start = Instant::now();
    let _ = black_box(shortest_route(grid, from, to, rules));
    start.elapsed().as_secs_f64() * 1e3
}

fn inflate_ms(seed: u64) -> f64 {
    let start = Instant::now();
    let _ = black_box(SearchGrid::of_cells(
        Lattice::new(0.2),
        area(),
        0.6,
        |cell| mix(seed, cell) % 100 < 22,
    ));
    start.elapsed().as_secs_f64() * 1e3
}

fn percentile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
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
