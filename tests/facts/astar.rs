//! Facts about shortest ways; cells are (row, column), and ways may cut corners where they are 8-connected.

use std::collections::BTreeSet;

use serde_json::{Value, json};
use tomoswarm::geom::{Bearing, Cell, Lattice, Vector};
use tomoswarm::map::CellRect;
use tomoswarm::plan::{NoRoute, Rules, SearchGrid, TurningCost, shortest_cells};

use super::fact::{Checked, Fact};

/// Checks a fact about a shortest way.
pub fn check(fact: &Fact) -> Checked {
    match () {
        () if fact.has("wall") => shut_off(fact),
        () if fact.has("turning_cost_per_rad") => with_turns(fact),
        () => among_obstacles(fact),
    }
}

fn grid(
    side: i32,
    cell_m: f64,
    clearance_m: f64,
    solid: impl Fn(Cell) -> bool,
) -> Result<SearchGrid, String> {
    let area = CellRect::new(Cell::new(0, 0), Cell::new(side - 1, side - 1));
    SearchGrid::of_cells(Lattice::new(cell_m), area, clearance_m, solid)
        .map_err(|error| error.to_string())
}

fn cell(fact: &Fact, key: &str) -> Result<Cell, String> {
    let [row, column] = fact.numbers(key)?;
    Ok(Cell::new(column as i32, row as i32))
}

/// A wall across the whole grid.
fn shut_off(fact: &Fact) -> Checked {
    let side = fact.whole("size")? as i32;
    let wall = fact.text("wall")?;
    let digits: String = wall.chars().filter(char::is_ascii_digit).collect();
    let column: i32 = digits
        .parse()
        .map_err(|_| format!("{wall} names no column"))?;
    let grid = grid(side, 1.0, 0.0, |cell| cell.x == column)?;
    let goal = Cell::new(side - 1, side - 1);
    match shortest_cells(
        &grid,
        Cell::new(0, 0),
        goal,
        &Rules {
            cut_corners: true,
            ..Rules::default()
        },
    ) {
        // All that can be reached was searched, and no more.
        Err(NoRoute::Unreachable { searched }) if searched == (column * side) as usize => {}
        other => return Err(format!("the way is {other:?}")),
    }
    fact.expect("path", json!([]))?;
    fact.expect("cost", json!("inf"))
}

/// Round a solid middle with one more cell closed; turns cost as well.
fn with_turns(fact: &Fact) -> Checked {
    let side = fact.whole("cells")? as i32;
    if fact.text("obstacles")? != "middle" {
        return Err("the obstacles are not known".to_owned());
    }
    let inner = 1..side - 1;
    let grid = grid(side, 1.0, 0.0, |cell| {
        (inner.contains(&cell.x) && inner.contains(&cell.y)) || (cell.y, cell.x) == (side - 1, 0)
    })?;
    let heading = Some(Bearing::from_degrees(fact.number("start_bearing_deg")?).angle());
    // Cells are a metre wide.
    let turning = TurningCost {
        cost_m_per_rad: fact.number("turning_cost_per_rad")?,
        heading,
    };
    let rules = Rules {
        diagonal: false,
        turning: Some(turning),
        ..Rules::default()
    };
    let found = shortest_cells(&grid, cell(fact, "start")?, cell(fact, "goal")?, &rules)
        .map_err(|error| error.to_string())?;
    let place = |cell: &Cell| json!([cell.y, cell.x]);
    let corners = found.cells.windows(3).filter(|three| {
        (three[1].x - three[0].x, three[1].y - three[0].y)
            != (three[2].x - three[1].x, three[2].y - three[1].y)
    });
    let last = found.cells.last().ok_or("the way is empty")?;
    let waypoints: Vec<Value> = corners
        .map(|three| place(&three[1]))
        .chain([place(last)])
        .collect();
    fact.expect("path", found.cells[1..].iter().map(place).collect())?;
    fact.expect("waypoints", Value::Array(waypoints))?;
    let before = found
        .cells
        .iter()
        .rev()
        .nth(1)
        .ok_or("the way has no step")?;
    let end = Vector::new(f64::from(last.x - before.x), f64::from(last.y - before.y)).angle();
    fact.expect("end_bearing_deg", json!(end.bearing().degrees()))?;
    fact.expect("cost", json!(found.cost_cells))
}

fn among_obstacles(fact: &Fact) -> Checked {
    let (side, per_m) = (fact.whole("cells")? as i32, fact.number("resolution")?);
    let (start, goal) = (cell(fact, "start")?, cell(fact, "goal")?);
    let solid = obstacles(fact.text("obstacles")?, side, start, goal)?;
    if solid.len() as i64 != fact.whole("obstacle_count")? {
        return Err(format!("there are {} obstacles", solid.len()));
    }
    let grid = grid(side, 1.0 / per_m, fact.number("closeness_m")?, |cell| {
        solid.contains(&(cell.y, cell.x))
    })?;
    let rules = Rules {
        cut_corners: true,
        ..Rules::default()
    };
    let found = shortest_cells(&grid, start, goal, &rules).map_err(|error| error.to_string())?;
    fact.expect("cost", json!(found.length_cells / per_m))
}

/// The obstacles by their recipe, as (row, column).
fn obstacles(
    kind: &str,
    side: i32,
    start: Cell,
    goal: Cell,
) -> Result<BTreeSet<(i32, i32)>, String> {
    match kind {
        "empty" => Ok(BTreeSet::new()),
        "walls" => Ok(walls(side)),
        "random" => Ok(scattered(side, start, goal)),
        other => Err(format!("the obstacles {other} are not known")),
    }
}

/// Four walls, each with a gap at the other end.
fn walls(side: i32) -> BTreeSet<(i32, i32)> {
    let gap = (side / 10).max(4);
    let wall = |number: i32| {
        let rows = if number % 2 == 1 {
            0..side - gap
        } else {
            gap..side
        };
        rows.map(move |row| (row, number * side / 5))
    };
    (1..=4).flat_map(wall).collect()
}

/// Half a percent of the cells, from a generator of random numbers that is part of the fact.
fn scattered(side: i32, start: Cell, goal: Cell) -> BTreeSet<(i32, i32)> {
    let mut state: i64 = 1;
    let mut next = || {
        state = (1_103_515_245 * state + 12_345) % (1 << 31);
        ((state >> 8) % i64::from(side)) as i32
    };
    let mut solid = BTreeSet::new();
    while (solid.len() as i32) < side * side / 200 {
        let place = (next(), next());
        let is_far = |end: Cell| (place.0 - end.y).abs().max((place.1 - end.x).abs()) > 5;
        if is_far(start) && is_far(goal) {
            solid.insert(place);
        }
    }
    solid
}
