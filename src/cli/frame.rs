//! One picture of a run for the terminal: the map, where everybody is and came from, what they do, and a legend. It is pure: a
//! picture is made of what is shown and a size; when it is drawn, and where, is decided elsewhere.
//!
//! Every letter of the terminal holds two pixels, one above the other (U+2580), and pixels are square; a letter that
//! holds a vehicle is the last digit of its id.

use std::collections::VecDeque;
use std::fmt::Write as _;

use tomoswarm_proto::VehicleId;

use super::screen::Size;
use crate::config::Venue;
use crate::draw::vehicle_colour;
use crate::geom::{Cell, Lattice, Point, Rect, Vector};
use crate::map::{CellRect, Merged, Occupancy, View};
use crate::node::mission::MissionStatus;
use crate::sim::VehicleSnapshot;

/// Lines of text below the picture.
const TEXT_ROWS: usize = 2;
/// A legend takes lines only from a picture that keeps so many.
const PICTURE_LINES: usize = 10;
/// The colour of letters on the picture.
const LETTER_COLOUR: u8 = 231;
/// A terminal smaller than this shows text only.
const LEAST: Size = Size {
    columns: 16,
    rows: 8,
};
/// Around the fence so much is shown as well, metres.
const MARGIN_M: f64 = 0.5;
/// A pixel looks at so many cells in a row at most.
const CELLS_LOOKED_AT: i32 = 12;

/// What a pixel shows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Pixel {
    /// Outside the fence.
    Outside,
    Unknown,
    Free,
    Occupied,
    Home,
    /// Where a vehicle came from.
    Track(VehicleId),
    /// Where it faces; behind its letter as well.
    Ahead(VehicleId),
}

impl Pixel {
    /// Returns the colour, of the 256 that terminals have; `None` = the terminal's own.
    fn colour(self) -> Option<u8> {
        match self {
            Pixel::Outside => None,
            Pixel::Unknown => Some(243),
            Pixel::Free => Some(255),
            Pixel::Occupied => Some(16),
            Pixel::Home => Some(150),
            Pixel::Track(vehicle) => Some(vehicle_colour(vehicle).terminal_track),
            Pixel::Ahead(vehicle) => Some(vehicle_colour(vehicle).terminal),
        }
    }
}

/// A vehicle as it is drawn.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct VehicleMarker {
    /// Where it is and what it does.
    pub vehicle: VehicleSnapshot,
    /// Where it came from.
    pub track: VecDeque<Point>,
}

/// A picture of one moment.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct RunFrame {
    /// Pixels in a row, and letters.
    columns: usize,
    /// Row-major from the top; two rows to a line of text.
    pixels: Vec<Pixel>,
    /// Vehicles: the line and column of their letter, and who it is.
    letters: Vec<(usize, usize, VehicleId)>,
    text: [String; TEXT_ROWS],
    /// Lines that say what signs and colours mean, as far as there is room for them.
    legend: Vec<String>,
}

/// Which part of the plane the pixels show.
#[derive(Clone, Copy, Debug)]
struct Scale {
    shown: Rect,
    columns: usize,
    rows: usize,
    /// Side of a pixel, metres.
    pixel_m: f64,
}

impl Scale {
    fn fit(shown: Rect, columns: usize, lines: usize) -> Scale {
        let (width_m, height_m) = (shown.max.x_m - shown.min.x_m, shown.max.y_m - shown.min.y_m);
        let (most_columns, most_rows) = (columns, 2 * lines);
        let pixel_m = (width_m / most_columns as f64).max(height_m / most_rows as f64);
        let count =
            |length_m: f64, most: usize| ((length_m / pixel_m).ceil() as usize).clamp(1, most);
        let rows = count(height_m, most_rows).next_multiple_of(2);
        Scale {
            shown,
            columns: count(width_m, most_columns),
            rows,
            pixel_m,
        }
    }

    /// Returns the place of a pixel, `None` when it is not shown.
    fn pixel_at(self, at: Point) -> Option<(usize, usize)> {
        let (right, down) = (
            (at.x_m - self.shown.min.x_m) / self.pixel_m,
            (self.shown.max.y_m - at.y_m) / self.pixel_m,
        );
        let is_shown = right >= 0.0 && down >= 0.0;
        let (column, row) = (right as usize, down as usize);
        (is_shown && column < self.columns && row < self.rows).then_some((column, row))
    }

    /// Returns the part of the plane that a pixel shows.
    fn part(self, column: usize, row: usize) -> Rect {
        let (west_m, north_m) = (
            self.shown.min.x_m + column as f64 * self.pixel_m,
            self.shown.max.y_m - row as f64 * self.pixel_m,
        );
        Rect::new(
            Point::new(west_m, north_m - self.pixel_m),
            Point::new(west_m + self.pixel_m, north_m),
        )
    }
}

impl RunFrame {
    /// Draws a moment; `None` when the terminal is too small for a picture.
    pub(super) fn new(
        venue: &Venue,
        map: &Merged,
        vehicles: &[VehicleMarker],
        first_line: String,
        size: Size,
    ) -> Option<RunFrame> {
        if size.columns < LEAST.columns || size.rows < LEAST.rows {
            return None;
        }
        let area = CellRect::around(map.lattice(), venue.fence.corners(), MARGIN_M)?;
        let lines = size.rows - TEXT_ROWS;
        let legend = legend(size.columns, lines.saturating_sub(PICTURE_LINES));
        let scale = Scale::fit(
            bounds(map.lattice(), area),
            size.columns,
            lines - legend.len(),
        );
        let view = map.view(0, area);
        let ground =
            (0..scale.rows).flat_map(|row| (0..scale.columns).map(move |column| (column, row)));
        let pixels = ground
            .map(|(column, row)| pixel(venue, &view, scale.part(column, row)))
            .collect();
        let text =
            [first_line, doings(vehicles)].map(|line| line.chars().take(size.columns).collect());
        let mut frame = RunFrame {
            columns: scale.columns,
            pixels,
            letters: Vec::new(),
            text,
            legend,
        };
        for home in venue.homes.iter().take(vehicles.len()) {
            frame.put(scale, *home, Pixel::Home);
        }
        for drawn in vehicles {
            let track = Pixel::Track(drawn.vehicle.id);
            drawn
                .track
                .iter()
                .for_each(|at| frame.put(scale, *at, track));
        }
        for drawn in vehicles {
            frame.put_vehicle(scale, &drawn.vehicle);
        }
        Some(frame)
    }

    fn put(&mut self, scale: Scale, at: Point, pixel: Pixel) {
        if let Some((column, row)) = scale.pixel_at(at) {
            self.pixels[row * self.columns + column] = pixel;
        }
    }

    fn put_vehicle(&mut self, scale: Scale, vehicle: &VehicleSnapshot) {
        let Some((column, row)) = scale.pixel_at(vehicle.at) else {
            return;
        };
        let line = row / 2;
        self.letters.push((line, column, vehicle.id));
        // Beside the letter, which is two pixels high.
        let ahead = Vector::polar(vehicle.heading, 1.0);
        let (right, down) = (
            column as f64 + 0.5 + ahead.x_m,
            (2 * line) as f64 + 1.0 - 1.5 * ahead.y_m,
        );
        let (right, down) = (right.floor(), down.floor());
        let is_shown =
            right >= 0.0 && down >= 0.0 && right < scale.columns as f64 && down < scale.rows as f64;
        if is_shown {
            self.pixels[down as usize * self.columns + right as usize] = Pixel::Ahead(vehicle.id);
        }
    }

    /// Returns the lines of the picture with colours, then those of the text and of the legend.
    pub(super) fn lines(&self) -> Vec<String> {
        let rows = self.pixels.len() / self.columns / 2;
        (0..rows)
            .map(|row| self.line(row))
            .chain(self.text.iter().chain(&self.legend).cloned())
            .collect()
    }

    fn line(&self, row: usize) -> String {
        let mut line = String::new();
        let mut colours = (None, None);
        for column in 0..self.columns {
            let (upper, lower) = self.pair(row, column);
            let vehicle = self
                .letters
                .iter()
                .rev()
                .find(|(at, of, ..)| (*at, *of) == (row, column));
            let (letter, wanted) = match vehicle {
                Some((_, _, vehicle)) => (letter_of(*vehicle), letter_colours(*vehicle)),
                // A pixel in the terminal's own colour can only be behind a letter, not the letter.
                None if upper == lower => (' ', (colours.0, upper.colour())),
                None if upper == Pixel::Outside => ('\u{2584}', (lower.colour(), None)),
                None => ('\u{2580}', (upper.colour(), lower.colour())),
            };
            set_colours(&mut line, &mut colours, wanted);
            line.push(letter);
        }
        line
    }

    /// Returns the pixels above and below of a letter.
    fn pair(&self, row: usize, column: usize) -> (Pixel, Pixel) {
        let at = |row: usize| self.pixels[row * self.columns + column];
        (at(2 * row), at(2 * row + 1))
    }
}

/// Changes the colours of letter and ground where they differ from those before.
fn set_colours(
    line: &mut String,
    before: &mut (Option<u8>, Option<u8>),
    wanted: (Option<u8>, Option<u8>),
) {
    let mut change = |now: Option<u8>, then: Option<u8>, kind: u8| {
        // Nothing can be done about a string that takes nothing more.
        let _ = match now {
            _ if now == then => Ok(()),
            Some(colour) => write!(line, "\x1b[{kind}8;5;{colour}m"),
            None => write!(line, "\x1b[{kind}9m"),
        };
    };
    change(wanted.0, before.0, 3);
    change(wanted.1, before.1, 4);
    *before = wanted;
}

/// Returns the letter that shows a vehicle: the last digit of its id.
fn letter_of(vehicle: VehicleId) -> char {
    char::from(b'0' + vehicle.0 % 10)
}

/// Returns the colours of a vehicle's letter and of what is behind it.
fn letter_colours(vehicle: VehicleId) -> (Option<u8>, Option<u8>) {
    (Some(LETTER_COLOUR), Pixel::Ahead(vehicle).colour())
}

/// Returns at most so many lines that say what the signs and colours mean. What has no room is left out, from the end.
fn legend(columns: usize, most_lines: usize) -> Vec<String> {
    let first = VehicleId(1);
    let entries = [
        (Pixel::Ahead(first), "vehicle, its front"),
        (Pixel::Track(first), "its track"),
        (Pixel::Occupied, "occupied"),
        (Pixel::Free, "free"),
        (Pixel::Unknown, "unknown"),
        (Pixel::Home, "home"),
    ];
    let mut lines: Vec<(usize, String)> = Vec::new();
    for (pixel, words) in entries {
        let wide = 3 + words.len();
        match lines.last_mut() {
            Some((used, line)) if *used + 2 + wide <= columns => {
                *used += 2 + wide;
                *line += &format!("  {}", legend_entry(pixel, words));
            }
            _ if wide <= columns => lines.push((wide, legend_entry(pixel, words))),
            _ => {}
        }
    }
    lines
        .into_iter()
        .take(most_lines)
        .map(|(_, line)| line)
        .collect()
}

/// Returns a sample of two letters, and words.
fn legend_entry(pixel: Pixel, words: &str) -> String {
    let mut entry = String::new();
    let mut colours = (None, None);
    if let Pixel::Ahead(vehicle) = pixel {
        set_colours(&mut entry, &mut colours, letter_colours(vehicle));
        entry.push(letter_of(vehicle));
        set_colours(&mut entry, &mut colours, (pixel.colour(), None));
        entry.push('\u{2580}');
    } else {
        set_colours(&mut entry, &mut colours, (None, pixel.colour()));
        entry.push_str("  ");
    }
    set_colours(&mut entry, &mut colours, (None, None));
    entry + " " + words
}

/// What everybody does, in the order of their ids.
fn doings(vehicles: &[VehicleMarker]) -> String {
    let word = |status: Option<MissionStatus>| match status {
        None => "off",
        Some(MissionStatus::Waiting) => "waits",
        Some(MissionStatus::Following) => "on its way",
        Some(MissionStatus::Held) => "holds",
        Some(MissionStatus::Returning) => "returns",
        Some(MissionStatus::Home) => "home",
    };
    let one =
        |drawn: &VehicleMarker| format!("{} {}", drawn.vehicle.id, word(drawn.vehicle.status));
    vehicles.iter().map(one).collect::<Vec<_>>().join("  ")
}

fn bounds(lattice: Lattice, area: CellRect) -> Rect {
    let half_m = lattice.cell_m() / 2.0;
    Rect::new(lattice.centre(area.low), lattice.centre(area.high)).shrunk(-half_m)
}

/// Judges what a pixel shows: something occupied is never lost, and unknown is what is unknown for the most part.
fn pixel(venue: &Venue, view: &View<'_>, part: Rect) -> Pixel {
    if !venue.fence.contains(part.centre()) {
        return Pixel::Outside;
    }
    let lattice = view.lattice();
    let inner = part.shrunk(1e-6 * (part.max.x_m - part.min.x_m));
    let (low, high) = (lattice.cell_at(inner.min), lattice.cell_at(inner.max));
    let step = |low: i32, high: i32| ((high - low) / CELLS_LOOKED_AT + 1) as usize;
    let (mut unknown, mut all) = (0, 0);
    for y in (low.y..=high.y).step_by(step(low.y, high.y)) {
        for x in (low.x..=high.x).step_by(step(low.x, high.x)) {
            all += 1;
            match view.occupancy(Cell::new(x, y)) {
                Occupancy::Occupied => return Pixel::Occupied,
                Occupancy::Unknown => unknown += 1,
                Occupancy::Free => {}
            }
        }
    }
    if 2 * unknown >= all {
        Pixel::Unknown
    } else {
        Pixel::Free
    }
}

#[cfg(test)]
mod tests;
