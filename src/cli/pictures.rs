//! The pictures of a run: what changed, what stands there, what the range sensors saw.

use super::error::CliError;
use super::folder::OutputFolder;
use crate::config::Venue;
use crate::draw::{CellState, HeatMap, OccupancyMap, Overlay, Picture};
use crate::geom::{Cell, Point};
use crate::map::{CellRect, Merged, Occupancy};
use crate::sim::{RunOutcome, Scenario};
use crate::tomo::{Image, Reconstruction};

/// Draws a run: what changed, what stands there, and the map.
///
/// # Errors
/// A file cannot be written, or a picture cannot be made.
pub(super) fn write_pictures(
    folder: &mut OutputFolder,
    scenario: &Scenario,
    outcome: &RunOutcome,
) -> Result<(), CliError> {
    if let Some(change) = &outcome.change {
        let title = "What changed since the empty sweep";
        folder.write("image.png", &heat(title, change, truth(outcome, true))?)?;
    }
    if let Some(structure) = &outcome.structure {
        let title = "What stands there, from a fitted path loss";
        folder.write(
            "structure.png",
            &heat(title, structure, truth(outcome, false))?,
        )?;
    }
    folder.write("map.png", &map(scenario, outcome)?)
}

pub(super) fn drawn(result: Result<Vec<u8>, crate::draw::DrawError>) -> Result<Vec<u8>, CliError> {
    result.map_err(|error| CliError::Fault(error.to_string()))
}

fn heat(title: &str, made: &Reconstruction, overlays: Vec<Overlay>) -> Result<Vec<u8>, CliError> {
    let title = format!("{title} ({} links)", made.used);
    let Image { grid, values } = &made.image;
    let spec = HeatMap {
        title,
        grid: *grid,
        values,
        unit: "dB/m",
        length_unit: "m",
        overlays,
        range: None,
    };
    drawn(Picture::heat(&spec))
}

/// The truth and what was found, to be drawn over an image.
fn truth(outcome: &RunOutcome, with_finds: bool) -> Vec<Overlay> {
    let mut overlays = tracks(outcome);
    overlays.extend(outcome.outlines.iter().map(|outline| Overlay::Outline {
        polygon: outline.polygon.clone(),
        label: None,
    }));
    overlays.extend(outcome.persons.iter().map(|person| Overlay::Circle {
        at: person.at,
        radius_m: person.radius_m,
        label: Some(person.name.clone()),
    }));
    if with_finds {
        overlays.extend(outcome.found().iter().map(|find| Overlay::Cross {
            at: find.at,
            label: None,
        }));
    }
    overlays
}

fn tracks(outcome: &RunOutcome) -> Vec<Overlay> {
    let tracks = outcome.tracks.iter().enumerate();
    tracks
        .map(|(colour, (vehicle, points))| Overlay::Track {
            points: points.clone(),
            colour,
            label: Some(format!("vehicle {vehicle}")),
        })
        .collect()
}

/// The cells of a map as a picture shows them.
pub(super) struct CellGrid {
    /// The south-west corner of the first cell.
    pub origin: Point,
    /// Cells from west to east.
    pub columns: usize,
    /// Cells from south to north.
    pub rows: usize,
    /// Row-major, rows from south to north.
    pub cells: Vec<CellState>,
}

/// Returns the cells of a map's lowest slice within the fence of a venue.
pub(super) fn shown_cells(map: &Merged, venue: &Venue) -> CellGrid {
    let lattice = map.lattice();
    let known = map.extent(0);
    let fence = CellRect::around(lattice, venue.fence.corners(), 0.5);
    let area = fence
        .into_iter()
        .chain(known.filter(|_| fence.is_none()))
        .next();
    let area = area.unwrap_or(CellRect::covering(lattice, venue.area));
    let view = map.view(0, area);
    let (columns, rows) = (area.width_cells() as usize, area.height_cells() as usize);
    let mut cells = Vec::with_capacity(columns * rows);
    for y in area.low.y..=area.high.y {
        for x in area.low.x..=area.high.x {
            cells.push(match view.occupancy(Cell::new(x, y)) {
                Occupancy::Free => CellState::Free,
                Occupancy::Unknown => CellState::Unknown,
                Occupancy::Occupied => CellState::Occupied,
            });
        }
    }
    let middle = lattice.centre(area.low);
    let origin = Point::new(
        middle.x_m - lattice.cell_m() / 2.0,
        middle.y_m - lattice.cell_m() / 2.0,
    );
    CellGrid {
        origin,
        columns,
        rows,
        cells,
    }
}

fn map(scenario: &Scenario, outcome: &RunOutcome) -> Result<Vec<u8>, CliError> {
    let venue = &scenario.sim().venue;
    let cell_m = outcome.map.lattice().cell_m();
    let CellGrid {
        origin,
        columns,
        rows,
        cells,
    } = shown_cells(&outcome.map, venue);
    let mut overlays = vec![
        Overlay::Fence {
            polygon: venue.fence.clone(),
        },
        Overlay::Area { rect: venue.area },
    ];
    overlays.extend(tracks(outcome));
    overlays.extend(outcome.outlines.iter().map(|outline| Overlay::Outline {
        polygon: outline.polygon.clone(),
        label: None,
    }));
    overlays.extend(homes(scenario));
    overlays.extend(outcome.tracks.iter().filter_map(|(vehicle, points)| {
        Some(Overlay::Dot {
            at: *points.last()?,
            label: Some(vehicle.to_string()),
        })
    }));
    let title = "What the range sensors saw".to_owned();
    drawn(Picture::occupancy(&OccupancyMap {
        title,
        origin,
        cell_m,
        columns,
        rows,
        cells: &cells,
        overlays,
    }))
}

fn homes(scenario: &Scenario) -> Vec<Overlay> {
    let ids = scenario.sim().vehicle_ids();
    ids.filter_map(|id| {
        Some(Overlay::Home {
            at: scenario.sim().home(id)?,
            label: None,
        })
    })
    .collect()
}
