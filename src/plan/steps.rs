//! The steps between neighbouring cells: which are allowed, what they cost, and which of them a search need not look at.
//!
//! Steps are numbered by direction: step k leads 45° · k to the left of east, so even ones are straight, odd ones
//! diagonal, and a step is also a heading. Costs are whole numbers (2³² = one side of a cell).

use crate::geom::Angle;

/// How one may drive over a grid.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rules {
    /// Whether diagonal steps are allowed.
    pub diagonal: bool,
    /// Whether a diagonal step may pass a barred cell at its side.
    pub cut_corners: bool,
    /// A start too near to something may be left through cells that are too near as well, up to this far from it,
    /// metres; 0 = refused.
    pub escape_m: f64,
    /// What turning costs; `None`: nothing.
    pub turning: Option<TurningCost>,
}

impl Default for Rules {
    fn default() -> Rules {
        Rules {
            diagonal: true,
            cut_corners: false,
            escape_m: 0.0,
            turning: None,
        }
    }
}

/// What turning costs, beside the length of the way. It makes a search several times dearer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TurningCost {
    /// Cost of a turn, metres of way per radian: from 0 to 64 cells; more counts as 64, less or not a number as 0.
    pub cost_m_per_rad: f64,
    /// Where the vehicle heads at the start; `None`: the first step costs no turn. At the goal any heading will do.
    pub heading: Option<Angle>,
}

impl TurningCost {
    /// Returns the turn before a first step, radians.
    pub(super) fn first_turn_rad(&self, step: usize) -> f64 {
        let direction = Angle::from_degrees(45.0 * step as f64);
        self.heading
            .map_or(0.0, |heading| (direction - heading).radians().abs())
    }
}

/// Cost of a step to one of the four nearest neighbours.
pub(super) const STRAIGHT: u64 = 1 << 32;
/// Cost of a diagonal step: √2 · 2³², rounded.
pub(super) const DIAGONAL: u64 = 6_074_001_000;
/// The eight steps, anticlockwise from east.
pub(super) const STEPS: [(i32, i32); 8] = [
    (1, 0),
    (1, 1),
    (0, 1),
    (-1, 1),
    (-1, 0),
    (-1, -1),
    (0, -1),
    (1, -1),
];
/// Instead of a step, for a cell where a way begins.
pub(super) const NO_STEP: usize = 8;

/// A step into a cell of level n costs (8 + n) / 8 of what it costs elsewhere.
pub(super) const LEVELS_PER_PRICE: u64 = 8;
/// The level of cells too near to something, where only leaving is allowed: four times the price. No level is higher,
/// so that no sum of costs over the largest grid exceeds 59 bits.
pub(super) const HIGHEST_LEVEL: u8 = 24;

/// The steps to look at, as a set of bits: by the step that led to a cell, and by which of the cells around are open.
pub(super) type Choices = [[u8; 256]; 9];

/// Every step that may be taken.
static ALL: [Choices; 3] = [choices(0, false), choices(1, false), choices(2, false)];
/// Only steps that can be part of a shortest way of which the diagonal steps come first (Harabor and Grastien 2011;
/// in fours, of which the ones along x come first): all other cells around are reached as cheaply past the cell.
/// Only right where every step costs its length.
static CANONICAL: [Choices; 3] = [choices(0, true), choices(1, true), choices(2, true)];

/// Returns the steps to look at; `canonical` leaves out what another way reaches as cheaply.
pub(super) fn steps_to_look_at(rules: &Rules, canonical: bool) -> &'static Choices {
    let kind = match (rules.diagonal, rules.cut_corners) {
        (false, _) => 0,
        (true, false) => 1,
        (true, true) => 2,
    };
    if canonical {
        &CANONICAL[kind]
    } else {
        &ALL[kind]
    }
}

/// Returns the cost of a step into a cell of a level.
#[inline]
pub(super) const fn price(step: usize, level: u8) -> u64 {
    let length = if step.is_multiple_of(2) {
        STRAIGHT
    } else {
        DIAGONAL
    };
    length / LEVELS_PER_PRICE * (LEVELS_PER_PRICE + level as u64)
}

/// Returns the least cost over so many columns and rows.
#[inline]
pub(super) fn least_cost(columns: u32, rows: u32, diagonal: bool) -> u64 {
    let (columns, rows) = (u64::from(columns), u64::from(rows));
    if diagonal {
        STRAIGHT * columns.abs_diff(rows) + DIAGONAL * columns.min(rows)
    } else {
        STRAIGHT * (columns + rows)
    }
}

/// `kind`: 0 = in fours, 1 = in eights, 2 = in eights past barred corners.
const fn choices(kind: u8, canonical: bool) -> Choices {
    let mut table = [[0; 256]; 9];
    let mut came_by = 0;
    while came_by < 9 {
        let mut open = 0;
        while open < 256 {
            let allowed = allowed(kind, open);
            table[came_by][open] = if canonical && came_by < NO_STEP {
                allowed & wanted(kind, came_by, open)
            } else {
                allowed
            };
            open += 1;
        }
        came_by += 1;
    }
    table
}

/// Returns whether the cell that lies in a direction is open.
#[inline]
const fn is_open(open: usize, step: usize) -> bool {
    open & bit(step) as usize != 0
}

/// Returns the bit of a direction; directions are counted round and round.
#[inline]
const fn bit(step: usize) -> u8 {
    1 << (step % 8)
}

/// Returns the steps that lead into open cells and past no barred corner.
const fn allowed(kind: u8, open: usize) -> u8 {
    let (mut steps, mut step) = (0, 0);
    while step < 8 {
        let corner = !(is_open(open, step + 1) && is_open(open, step + 7));
        let fits = step.is_multiple_of(2) || kind == 2 || (kind == 1 && !corner);
        if fits && is_open(open, step) {
            steps |= bit(step);
        }
        step += 1;
    }
    steps
}

/// Returns the steps that no other way makes needless.
const fn wanted(kind: u8, came_by: usize, open: usize) -> u8 {
    let ahead = bit(came_by);
    match (kind, came_by.is_multiple_of(2)) {
        (0, _) => ahead | wanted_in_fours(came_by, open),
        (_, true) => {
            // Beside the cell before (1), or beside the cell (2), something stands: then what lies behind it is
            // reached from here.
            let shade = if kind == 1 { 3 } else { 2 };
            let left = if is_open(open, came_by + shade) {
                0
            } else {
                bit(came_by + 1) | bit(came_by + 2)
            };
            let right = if is_open(open, came_by + 8 - shade) {
                0
            } else {
                bit(came_by + 7) | bit(came_by + 6)
            };
            ahead | left | right
        }
        (_, false) => {
            let left = if is_open(open, came_by + 3) {
                0
            } else {
                bit(came_by + 2)
            };
            let right = if is_open(open, came_by + 5) {
                0
            } else {
                bit(came_by + 6)
            };
            ahead | bit(came_by + 1) | bit(came_by + 7) | left | right
        }
    }
}

/// In fours, ways along x come before ways along y: who comes along y turns only where something stood in the way.
#[inline]
const fn wanted_in_fours(came_by: usize, open: usize) -> u8 {
    let (left, right) = (bit(came_by + 2), bit(came_by + 6));
    if came_by.is_multiple_of(4) {
        return left | right;
    }
    (if is_open(open, came_by + 3) { 0 } else { left })
        | (if is_open(open, came_by + 5) { 0 } else { right })
}
