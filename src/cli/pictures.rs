//! The pictures of a run: what changed, what stands there, what the range sensors saw.

use tomoswarm_proto::VehicleId;

use super::counted::counted;
use super::error::CliError;
use super::folder::OutputFolder;
use super::link_pictures::LinkPictures;
use super::outputs::{about, deviation_picture};
use crate::config::Venue;
use crate::draw::{CellState, HeatMap, OccupancyMap, Overlay, Picture, described};
use crate::geom::{Cell, Point};
use crate::ground::imager::Subject;
use crate::map::{CellRect, Merged, Occupancy};
use crate::scene::Person;
use crate::sim::{RunOutcome, Scenario};
#[cfg(feature = "net")]
use crate::tomo::{Extras, Imager};
use crate::tomo::{Find, Finds, Image, ImagingSettings, Peak, Reconstruction};

/// Draws a run: what changed, what stands there, and the map.
///
/// # Errors
/// A file cannot be written, or a picture cannot be made.
pub(super) fn write_pictures(
    folder: &mut OutputFolder,
    scenario: &Scenario,
    outcome: &RunOutcome,
) -> Result<(), CliError> {
    let about = about(&scenario.made_from);
    let mut write = |name: &str, png: Vec<u8>| folder.write(name, &described(png, &about));
    if let Some(change) = &outcome.change {
        let title = "What changed since the empty sweep";
        write("image.png", heat(title, change, truth(outcome, true))?)?;
    }
    if let Some(structure) = &outcome.structure {
        let title = "What stands there, from a fitted path loss";
        write(
            "structure.png",
            heat(title, structure, truth(outcome, false))?,
        )?;
    }
    for (name, png) in pictures_of_links(scenario, outcome)? {
        write(name, png)?;
    }
    write("map.png", map(scenario, outcome)?)
}

/// Returns of which image it is drawn what is behind it.
fn shown(outcome: &RunOutcome) -> Subject {
    match outcome.change {
        Some(_) => Subject::Change,
        None => Subject::Structure,
    }
}

/// Makes the image that is shown once more, of the links of the run, for what is behind it: stores keep images without their
/// links, and those of before without their deviation.
#[cfg(feature = "net")]
pub(super) fn add_links(scenario: &Scenario, outcome: &mut RunOutcome) {
    let subject = shown(outcome);
    let (made, empty) = match subject {
        Subject::Change => (&mut outcome.change, Some(&outcome.empty_links[..])),
        Subject::Structure => (&mut outcome.structure, None),
    };
    let Some(made) = made.as_mut().filter(|made| made.links.is_none()) else {
        return;
    };
    let extras = Extras {
        persons: true,
        links: true,
        deviation: made
            .deviation
            .is_none()
            .then_some(crate::ground::imager::MOST_BLOCKS),
        ..Extras::default()
    };
    let again = Imager::new(scenario.image(subject))
        .and_then(|mut imager| imager.update(&outcome.links, empty, extras));
    if let Ok(again) = again {
        made.links = again.links;
        made.deviation = made.deviation.take().or(again.deviation);
    }
}

/// Draws what is behind the image of the change, or without one that of the structure.
fn pictures_of_links(
    scenario: &Scenario,
    outcome: &RunOutcome,
) -> Result<Vec<(&'static str, Vec<u8>)>, CliError> {
    let subject = shown(outcome);
    let settings = scenario.image(subject);
    let made = outcome.change.as_ref().or(outcome.structure.as_ref());
    let Some((made, links)) = made.and_then(|made| Some((made, made.links.as_deref()?))) else {
        return Ok(Vec::new());
    };
    let of_links = LinkPictures {
        links,
        settings: &settings,
        unit: "m",
        by_empty_sweep: subject == Subject::Change,
    };
    let mut pictures = vec![
        ("coverage.png", of_links.coverage()?),
        ("links.png", of_links.losses()?),
        ("residuals.png", of_links.residuals()?),
    ];
    if let Some(values) = made.deviation.clone() {
        let grid = made.image.grid;
        let picture = deviation_picture(&Image { grid, values }, "m")?;
        pictures.push(("deviation.png", picture));
    }
    Ok(pictures)
}

pub(super) fn drawn(result: Result<Vec<u8>, crate::draw::DrawError>) -> Result<Vec<u8>, CliError> {
    result.map_err(|error| CliError::Fault(error.to_string()))
}

/// Pixels that may lie beyond the colours, a share of all.
const BEYOND_COLOURS: f64 = 0.002;
/// The colours end below the largest value only when it is so many times the value at their end.
const FAR_BEYOND: f64 = 1.5;

/// Returns the values at the ends of the colours of an image where a few pixels of its rim, specks at antennas, would take
/// them all up; `None` where the largest value is a good end. Nothing inside of the rim lies beyond.
pub(super) fn colour_range(image: &Image) -> Option<(f64, f64)> {
    let Image { grid, values } = image;
    let inner = grid
        .area
        .shrunk(ImagingSettings::for_area(grid.area).peaks.rim_m);
    let mut sorted: Vec<f64> = values
        .iter()
        .copied()
        .filter(|value| value.is_finite())
        .collect();
    sorted.sort_by(f64::total_cmp);
    let largest = *sorted.last()?;
    let beyond = (BEYOND_COLOURS * sorted.len() as f64) as usize;
    let usual = sorted[sorted.len() - 1 - beyond];
    let top = (0..values.len())
        .filter(|pixel| inner.contains(grid.centre(*pixel)) && values[*pixel].is_finite())
        .map(|pixel| values[pixel])
        .fold(usual, f64::max);
    (top > 0.0 && largest > FAR_BEYOND * top).then_some((0.0, top))
}

/// Returns the title of an image of so many links; where persons were searched, with how many finds of nobody there are in an
/// image, on the mean.
pub(super) fn heat_title(seen: &str, links: usize, finds: Option<&Finds>) -> String {
    let links = counted(links, "link");
    match finds {
        Some(finds) => format!(
            "{seen} ({links}, {} false finds expected)",
            finds.false_per_image
        ),
        None => format!("{seen} ({links})"),
    }
}

fn heat(title: &str, made: &Reconstruction, overlays: Vec<Overlay>) -> Result<Vec<u8>, CliError> {
    let Image { grid, values } = &made.image;
    let spec = HeatMap {
        title: heat_title(title, made.used, made.finds.as_ref()),
        grid: *grid,
        values,
        unit: "dB/m",
        length_unit: "m",
        overlays,
        range: colour_range(&made.image),
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
    overlays.extend(persons(&outcome.persons));
    if with_finds {
        let change = outcome.change.as_ref();
        overlays.extend(finds(change.and_then(|change| change.finds.as_ref())));
    }
    overlays
}

/// Returns the persons of a scene, by the names that the summary of a run has for them.
pub(super) fn persons(persons: &[Person]) -> impl Iterator<Item = Overlay> {
    persons.iter().flat_map(|person| {
        let walks = !person.path.is_empty();
        let way = walks.then(|| Overlay::Walk {
            points: [person.at].into_iter().chain(person.path.clone()).collect(),
        });
        let name = &person.name;
        let circle = Overlay::Circle {
            at: person.at,
            radius_m: person.radius_m,
            label: Some(if walks {
                format!("{name}, walking")
            } else {
                name.clone()
            }),
        };
        way.into_iter().chain([circle])
    })
}

/// Returns the homes of a venue: the first is vehicle 1's, and so on.
pub(super) fn homes(venue: &Venue) -> impl Iterator<Item = Overlay> {
    let ids = (1..=u8::MAX).map(VehicleId);
    venue
        .homes
        .iter()
        .zip(ids)
        .map(|(at, vehicle)| Overlay::Home { at: *at, vehicle })
}

/// Returns a probability in words; one that is nearly sure is not called sure.
fn percent(probability: f64) -> String {
    match probability {
        sure if sure > 0.9995 => "> 99.9 %".to_owned(),
        other => format!("{:.1} %", 100.0 * other),
    }
}

/// Returns the persons found in a change, numbered, with their probabilities.
fn finds(finds: Option<&Finds>) -> impl Iterator<Item = Overlay> {
    let found = finds.map_or(&[][..], |finds| &finds.found);
    let mark = |(index, find): (usize, &Find)| Overlay::Find {
        at: find.at,
        covariance_m2: find.covariance_m2,
        label: Some(format!("{} ({})", index + 1, percent(find.probability))),
    };
    found.iter().enumerate().map(mark)
}

/// Returns what is marked in an image: who was found in a change, and without an empty sweep the strong places.
pub(super) fn marks(found: Option<&Finds>, strong: &[Peak]) -> Vec<Overlay> {
    match found {
        Some(_) => finds(found).collect(),
        None => peaks(strong),
    }
}

/// Returns the peaks of an image, numbered, a faint one with a question mark.
fn peaks(peaks: &[Peak]) -> Vec<Overlay> {
    let mark = |(index, peak): (usize, &Peak)| Overlay::Cross {
        at: peak.at,
        label: Some(format!(
            "{}{}",
            index + 1,
            if peak.is_faint() { "?" } else { "" }
        )),
    };
    peaks.iter().enumerate().map(mark).collect()
}

fn tracks(outcome: &RunOutcome) -> Vec<Overlay> {
    let track = |(vehicle, points): &(VehicleId, Vec<Point>)| Overlay::Track {
        points: points.clone(),
        vehicle: *vehicle,
    };
    outcome.tracks.iter().map(track).collect()
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
    let title = "What the range sensors saw".to_owned();
    drawn(Picture::occupancy(&OccupancyMap {
        title,
        origin,
        cell_m,
        columns,
        rows,
        cells: &cells,
        overlays: map_overlays(scenario, outcome),
    }))
}

/// Returns what is laid over the map.
fn map_overlays(scenario: &Scenario, outcome: &RunOutcome) -> Vec<Overlay> {
    let venue = &scenario.sim().venue;
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
    // A person is an obstacle like any other for a range sensor; here it is said which of them are persons.
    overlays.extend(persons(&outcome.persons));
    overlays.extend(homes(venue).take(scenario.sim().vehicles.count));
    overlays.extend(outcome.tracks.iter().filter_map(|(vehicle, points)| {
        Some(Overlay::Vehicle {
            at: *points.last()?,
            vehicle: *vehicle,
        })
    }));
    overlays
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::load;
    use crate::draw::tests_support::decoded;
    use crate::draw::vehicle_colour;
    use crate::geom::{PixelGrid, Rect};
    use std::path::Path;

    /// A short mission of two rovers in a yard with a crate and a person.
    fn run() -> (Scenario, RunOutcome) {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/small.sim.toml");
        let loaded = load::load(Some(&file), None).unwrap();
        let scenario = load::scenario(loaded, Some(&file), Some(1)).unwrap();
        let outcome = scenario.run(&mut |_| true).unwrap();
        (scenario, outcome)
    }

    #[test]
    fn specks_at_antennas_do_not_set_the_colours_and_walls_do() {
        let area = Rect::new(Point::default(), Point::new(20.0, 20.0));
        let grid = PixelGrid {
            area,
            columns: 200,
            rows: 200,
        };
        let with = |places: &[(Point, f64, f64)]| {
            let mut image = Image::zeros(grid);
            for pixel in 0..grid.len() {
                for (at, radius_m, value) in places {
                    if grid.centre(pixel).distance_to(*at) <= *radius_m {
                        image.values[pixel] = *value;
                    }
                }
            }
            image
        };
        let person = (Point::new(8.0, 12.0), 0.25, 6.0);
        let speck = (Point::new(0.1, 7.0), 0.1, 90.0);
        let specks = [person, speck, (Point::new(13.0, 0.1), 0.1, 70.0)];
        assert_eq!(colour_range(&with(&specks)), Some((0.0, 6.0)));
        assert_eq!(colour_range(&with(&[person])), None);
        let wall_in_rim = (Point::new(1.0, 10.0), 0.9, 40.0);
        assert_eq!(colour_range(&with(&[person, wall_in_rim])), None);
        let few = with(&[person, (Point::new(0.1, 7.0), 0.1, 8.0)]);
        assert_eq!(colour_range(&few), None, "not far beyond");
        assert_eq!(colour_range(&with(&[])), None);
    }

    #[test]
    fn the_pictures_of_a_run_agree_about_vehicles_and_persons() {
        let (scenario, outcome) = run();
        let [change, structure] =
            [&outcome.change, &outcome.structure].map(|made| made.clone().unwrap());
        let pictures = [
            heat("change", &change, truth(&outcome, true)).unwrap(),
            heat("structure", &structure, truth(&outcome, false)).unwrap(),
            map(&scenario, &outcome).unwrap(),
        ];
        for picture in &pictures {
            let (_, shown) = decoded(picture);
            for vehicle in [1, 2] {
                let colour = vehicle_colour(VehicleId(vehicle)).rgb;
                let count = shown.iter().filter(|shown| **shown == colour).count();
                assert!(count > 500, "vehicle {vehicle}: {count} pixels");
            }
        }
        let circles = |overlays: Vec<Overlay>| -> Vec<Overlay> {
            let is_circle = |overlay: &Overlay| matches!(overlay, Overlay::Circle { .. });
            overlays.into_iter().filter(is_circle).collect()
        };
        let of_map = circles(map_overlays(&scenario, &outcome));
        assert_eq!(of_map, circles(truth(&outcome, true)));
        let Some(Overlay::Circle { at, label, .. }) = of_map.first() else {
            panic!("the map shows no person");
        };
        assert_eq!(
            (*at, label.as_deref(), of_map.len()),
            (Point::new(4.0, 4.0), Some("ada"), 1)
        );
    }

    #[cfg(feature = "net")]
    #[test]
    fn what_is_behind_an_image_of_a_store_is_drawn_as_of_one_that_was_just_made() {
        let (scenario, mut outcome) = run();
        let made = pictures_of_links(&scenario, &outcome).unwrap();
        let names: Vec<&str> = made.iter().map(|(name, _)| *name).collect();
        assert_eq!(
            names,
            [
                "coverage.png",
                "links.png",
                "residuals.png",
                "deviation.png"
            ]
        );
        outcome.change.as_mut().unwrap().links = None;
        add_links(&scenario, &mut outcome);
        assert!(pictures_of_links(&scenario, &outcome).unwrap() == made);
    }

    #[test]
    fn the_person_is_found_at_the_brightest_spot() {
        let (_, outcome) = run();
        let Image { grid, values } = &outcome.change.clone().unwrap().image;
        let brightest = (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b]));
        let off = outcome.found()[0].at - grid.centre(brightest.unwrap());
        assert!(
            off.x_m.abs() <= grid.dx_m() && off.y_m.abs() <= grid.dy_m(),
            "{off:?}"
        );
    }
}
