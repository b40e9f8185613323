//! Whole pictures, decoded again and looked at from outside: only the frame's colour is known here, not the layout.

use proptest::prelude::*;
use tomoswarm_proto::VehicleId;

use super::*;
use crate::geom::{PixelGrid, Point, Polygon, Rect};

type Colour = [u8; 3];

const FRAME: Colour = [32, 32, 38];
const PALEST: Colour = [255, 252, 210];
const DARKEST: Colour = [10, 8, 30];

/// A decoded picture and where its plot lies.
struct Seen {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
    /// First and last pixel column and row within the frame.
    plot: [usize; 4],
}

impl Seen {
    fn decode(bytes: &[u8]) -> Seen {
        let (width, pixels) = tests_support::decoded(bytes);
        let mut seen = Seen {
            width,
            height: pixels.len() / width,
            rgb: pixels.concat(),
            plot: [0; 4],
        };
        seen.plot = seen.find_plot();
        seen
    }

    fn at(&self, x: usize, y: usize) -> Colour {
        let start = (y * self.width + x) * 3;
        [self.rgb[start], self.rgb[start + 1], self.rgb[start + 2]]
    }

    /// The frame is the first long line from above; its left side leads down to its foot.
    fn find_plot(&self) -> [usize; 4] {
        let run = |x: usize, y: usize| {
            (x..self.width)
                .take_while(|x| self.at(*x, y) == FRAME)
                .count()
        };
        for y in 0..self.height {
            if let Some(x) = (0..self.width).find(|x| run(*x, y) >= 80) {
                let foot = (y..self.height)
                    .take_while(|y| self.at(x, *y) == FRAME)
                    .count();
                return [x + 1, x + run(x, y) - 2, y + 1, y + foot - 2];
            }
        }
        panic!("no frame found");
    }

    /// The colour at shares of the plot, from its left and from its bottom.
    fn share(&self, right: f64, up: f64) -> Colour {
        let [west, east, north, south] = self.plot;
        let along =
            |low: usize, high: usize, share: f64| low + (share * (high + 1 - low) as f64) as usize;
        self.at(
            along(west, east, right).min(east),
            along(north, south, 1.0 - up).min(south),
        )
    }

    /// How many pixels of the plot have a colour.
    fn count_in_plot(&self, colour: Colour) -> usize {
        let [west, east, north, south] = self.plot;
        (north..=south)
            .flat_map(|y| (west..=east).map(move |x| (x, y)))
            .filter(|(x, y)| self.at(*x, *y) == colour)
            .count()
    }

    fn count(&self, colour: Colour) -> usize {
        self.rgb.chunks(3).filter(|pixel| **pixel == colour).count()
    }
}

fn grid(width_m: f64, height_m: f64, columns: usize, rows: usize) -> PixelGrid {
    let area = Rect {
        min: Point::new(-2.0, 3.0),
        max: Point::new(-2.0 + width_m, 3.0 + height_m),
    };
    PixelGrid {
        area,
        columns,
        rows,
    }
}

fn spec(grid: PixelGrid, values: &[f64]) -> HeatMap<'_> {
    HeatMap {
        title: "test".to_string(),
        grid,
        values,
        unit: "dB/m",
        length_unit: "m",
        overlays: Vec::new(),
        range: None,
    }
}

fn heat(map: &HeatMap) -> Seen {
    Seen::decode(&Picture::heat(map).unwrap())
}

#[test]
fn a_hot_pixel_lies_where_it_belongs_with_north_up() {
    for (width_m, height_m, columns, rows) in
        [(10.0, 8.0, 10, 8), (30.0, 6.0, 15, 3), (2.0, 8.0, 3, 40)]
    {
        let hot = (columns - 2, rows - 1);
        let mut values = vec![0.0; columns * rows];
        values[hot.1 * columns + hot.0] = 3.0;
        let seen = heat(&spec(grid(width_m, height_m, columns, rows), &values));
        for row in 0..rows {
            for column in 0..columns {
                let right = (column as f64 + 0.5) / columns as f64;
                let colour = seen.share(right, (row as f64 + 0.5) / rows as f64);
                let expected = if (column, row) == hot {
                    PALEST
                } else {
                    DARKEST
                };
                assert_eq!(colour, expected, "column {column} row {row}");
            }
        }
        let [west, east, north, south] = seen.plot;
        let aspect = (east + 1 - west) as f64 / (south + 1 - north) as f64;
        assert!(
            (aspect / (width_m / height_m) - 1.0).abs() < 0.02,
            "{aspect}"
        );
    }
}

#[test]
fn an_outline_is_drawn_on_its_border_and_not_inside() {
    let values = [0.0; 100];
    let corners = [(0.0, 5.0), (4.0, 5.0), (4.0, 10.0), (0.0, 10.0)];
    let polygon = Polygon::new(corners.iter().map(|(x, y)| Point::new(*x, *y)).collect());
    let overlays = vec![Overlay::Outline {
        polygon,
        label: None,
    }];
    // The area runs from (-2, 3) to (8, 13).
    let seen = heat(&HeatMap {
        overlays,
        ..spec(grid(10.0, 10.0, 10, 10), &values)
    });
    let white = |right: f64, up: f64| {
        let near = [-0.002, 0.0, 0.002];
        near.iter().any(|by| {
            near.iter()
                .any(|to| seen.share(right + by, up + to)[0] > 200)
        })
    };
    for (right, up) in [(0.2, 0.5), (0.6, 0.3), (0.4, 0.2), (0.3, 0.7)] {
        assert!(white(right, up), "{right} {up}");
    }
    assert!(!white(0.4, 0.5) && !white(0.8, 0.5));
}

#[test]
fn a_value_that_is_no_number_is_seen_and_explained() {
    let whole = heat(&spec(grid(4.0, 4.0, 2, 2), &[0.0, 1.0, 2.0, 1.5]));
    for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let seen = heat(&spec(grid(4.0, 4.0, 2, 2), &[0.0, 1.0, 2.0, odd]));
        let [red, green, blue] = seen.share(0.75, 0.75);
        assert!(green > red && blue > red, "no colour of the map is teal");
        assert_eq!(
            seen.share(0.25, 0.75),
            PALEST,
            "the range comes from the finite values"
        );
        assert!(seen.height > whole.height, "the legend names it");
    }
}

#[test]
fn a_fine_image_shows_means_and_hides_no_hole() {
    let fine = 2000;
    let striped: Vec<f64> = (0..fine * fine)
        .map(|i| if i % 2 == 0 { 0.0 } else { 2.0 })
        .collect();
    let map = HeatMap {
        range: Some((0.0, 2.0)),
        ..spec(grid(5.0, 5.0, fine, fine), &striped)
    };
    let [red, green, _] = heat(&map).share(0.5, 0.5);
    assert!(
        red > 120 && red < 255 && green < 160,
        "half of the range, not an end"
    );
    let mut holed = vec![1.0; fine * fine];
    holed[1234 * fine + 777] = f64::NAN;
    let seen = heat(&spec(grid(5.0, 5.0, fine, fine), &holed));
    let [red, green, _] = seen.share(777.5 / 2000.0, 1234.5 / 2000.0);
    assert!(green > red);
}

#[test]
fn the_same_specification_gives_the_same_bytes() {
    let values: Vec<f64> = (0..600).map(|i| f64::from(i % 37)).collect();
    let points = (0..500)
        .map(|i| Point::new(f64::from(i % 29) / 4.0, f64::from(i % 31) / 4.0 + 3.0))
        .collect();
    let track = Overlay::Track {
        points,
        vehicle: VehicleId(4),
    };
    let map = HeatMap {
        overlays: vec![track],
        ..spec(grid(9.0, 7.0, 30, 20), &values)
    };
    assert_eq!(Picture::heat(&map), Picture::heat(&map.clone()));
}

#[test]
fn wrong_counts_and_sizes_are_refused() {
    let error = DrawError::ValueCount {
        columns: 2,
        rows: 3,
        got: 5,
    };
    assert_eq!(
        Picture::heat(&spec(grid(1.0, 1.0, 2, 3), &[0.0; 5])),
        Err(error)
    );
    assert!(Picture::heat(&spec(grid(1.0, 1.0, usize::MAX, 2), &[])).is_err());
    assert!(matches!(
        Picture::heat(&spec(grid(f64::NAN, 1.0, 1, 1), &[1.0])),
        Err(DrawError::AreaNotFinite { .. })
    ));
    let map = |cell_m: f64| Picture::occupancy(&occupancy(2, 1, cell_m, &[CellState::Free; 2]));
    assert_eq!(map(0.0), Err(DrawError::CellSize { cell_m: 0.0 }));
    assert!(map(f64::NAN).is_err() && map(1e-9).is_ok() && map(0.2).is_ok());
}

fn occupancy(columns: usize, rows: usize, cell_m: f64, cells: &[CellState]) -> OccupancyMap<'_> {
    let origin = Point::new(1.0, -4.0);
    OccupancyMap {
        title: "map".to_string(),
        origin,
        cell_m,
        columns,
        rows,
        cells,
        overlays: Vec::new(),
    }
}

#[test]
fn cells_lie_where_they_belong_with_north_up() {
    let mut cells = vec![CellState::Unknown; 12];
    cells[0] = CellState::Free;
    cells[11] = CellState::Occupied;
    let seen = Seen::decode(&Picture::occupancy(&occupancy(4, 3, 0.5, &cells)).unwrap());
    assert_eq!(seen.share(0.125, 1.0 / 6.0), [255, 255, 255]);
    assert!(
        seen.share(0.875, 5.0 / 6.0)
            .iter()
            .all(|channel| *channel < 60)
    );
    let unknown = seen.share(0.875, 1.0 / 6.0);
    assert!(unknown.iter().all(|channel| (120..230).contains(channel)));
}

#[test]
fn one_occupied_cell_among_millions_is_still_seen() {
    let side = 2500;
    let mut cells = vec![CellState::Free; side * side];
    cells[1700 * side + 333] = CellState::Occupied;
    let seen = Seen::decode(&Picture::occupancy(&occupancy(side, side, 0.1, &cells)).unwrap());
    assert!(seen.share(333.5 / 2500.0, 1700.5 / 2500.0)[0] < 60);
}

#[test]
fn odd_images_still_give_a_picture() {
    let equal = [-2.0; 12];
    let huge = [f64::MAX, f64::MIN, 0.0, 1.0, -f64::MIN_POSITIVE, 5e-324];
    for (grid, values) in [
        (grid(1.0, 1.0, 0, 0), &[][..]),
        (grid(0.0, 0.0, 0, 5), &[][..]),
        (grid(0.0, 0.0, 1, 1), &[1.0][..]),
        (grid(0.0, 9.0, 1, 1), &[1.0][..]),
        (grid(1.0, 1e6, 4, 3), &equal[..]),
        (grid(1e-9, 1e-9, 3, 2), &huge[..]),
        (grid(1e300, 1e280, 2, 3), &huge[..]),
        (grid(-4.0, -2.0, 2, 3), &huge[..]),
    ] {
        let seen = heat(&HeatMap {
            title: "ä ≤ 漢\n\t".repeat(40),
            unit: "",
            ..spec(grid, values)
        });
        assert!(seen.width <= 960 && seen.height <= 800);
        assert!(seen.count([255, 255, 255]) > 1000);
    }
}

fn track(vehicle: u8, ends: [(f64, f64); 2]) -> Overlay {
    Overlay::Track {
        points: ends.map(|(x_m, y_m)| Point::new(x_m, y_m)).to_vec(),
        vehicle: VehicleId(vehicle),
    }
}

/// Pictures of all kinds that show metres, 10 m from (-2, 3), with the same laid over them.
fn of_all_kinds(overlays: &[Overlay]) -> Vec<Seen> {
    let values = [0.0; 100];
    let image = HeatMap {
        overlays: overlays.to_vec(),
        ..spec(grid(10.0, 10.0, 10, 10), &values)
    };
    let cells = [CellState::Free; 100];
    let map = OccupancyMap {
        origin: Point::new(-2.0, 3.0),
        overlays: overlays.to_vec(),
        ..occupancy(10, 10, 1.0, &cells)
    };
    let plan = FloorPlan {
        title: "plan".to_string(),
        area: image.grid.area,
        materials: &[],
        shapes: &[],
        overlays: overlays.to_vec(),
    };
    let bytes = [
        Picture::heat(&image),
        Picture::occupancy(&map),
        Picture::floor(&plan),
    ];
    bytes.map(|bytes| Seen::decode(&bytes.unwrap())).into()
}

#[test]
fn a_vehicle_has_one_colour_in_every_kind_of_picture() {
    let (at, vehicle) = (Point::new(3.0, 5.0), VehicleId(2));
    for mark in [
        track(2, [(-1.0, 4.0), (7.0, 4.0)]),
        Overlay::Vehicle { at, vehicle },
        Overlay::Home { at, vehicle },
    ] {
        for seen in of_all_kinds(&[mark]) {
            for other in 1..=8 {
                let count = seen.count_in_plot(vehicle_colour(VehicleId(other)).rgb);
                assert_eq!(count > 15, other == 2, "{other}: {count} pixels");
            }
        }
    }
}

#[test]
fn tracks_that_lie_upon_each_other_all_stay_visible() {
    let lines = [
        [(-1.5, 5.0), (7.5, 5.0)],
        [(2.0, 3.5), (2.0, 12.5)],
        [(-1.5, 3.5), (7.5, 12.5)],
        [(-1.5, 12.5), (7.5, 3.5)],
        [(0.0, 4.0), (2.5, 11.5)],
        [(-1.5, 7.0), (7.5, 10.0)],
    ];
    for ends in lines {
        for last in [2, 3, 8] {
            let tracks: Vec<Overlay> = (1..=last).map(|vehicle| track(vehicle, ends)).collect();
            for seen in of_all_kinds(&tracks) {
                let count =
                    |vehicle: u8| seen.count_in_plot(vehicle_colour(VehicleId(vehicle)).rgb);
                let all: usize = (1..=last).map(count).sum();
                for vehicle in 1..=last {
                    let share = count(vehicle) as f64 / all as f64;
                    let least = 0.4 / f64::from(last);
                    assert!(share > least, "{ends:?}, {vehicle} of {last}: {share:.3}");
                }
            }
        }
    }
}

#[test]
fn a_track_beside_another_keeps_its_own_colour_throughout() {
    let alone = of_all_kinds(&[track(1, [(-1.5, 5.0), (7.5, 5.0)])]);
    let both = of_all_kinds(&[
        track(1, [(-1.5, 5.0), (7.5, 5.0)]),
        track(2, [(-1.5, 6.0), (7.5, 6.0)]),
    ]);
    let first = vehicle_colour(VehicleId(1)).rgb;
    for (alone, both) in alone.iter().zip(&both) {
        assert_eq!(alone.count_in_plot(first), both.count_in_plot(first));
    }
}

#[test]
fn what_lies_far_outside_is_not_in_the_legend() {
    let values = vec![1.0; 30 * 20];
    let plain = spec(grid(9.0, 7.0, 30, 20), &values);
    let with = |x_m: f64| {
        let person = Overlay::Circle {
            at: Point::new(x_m, 5.0),
            radius_m: 0.25,
            label: None,
        };
        let overlays = vec![person];
        Picture::heat(&HeatMap {
            overlays,
            ..plain.clone()
        })
    };
    assert!(with(500.0).unwrap() == Picture::heat(&plain).unwrap());
    // One just outside is shown, and the picture grows.
    assert!(with(8.0).unwrap() != Picture::heat(&plain).unwrap());
}

#[test]
fn a_cross_lies_on_the_pixel_that_it_names() {
    let mut values = vec![0.0; 30 * 20];
    for (column, row) in [(3, 2), (28, 18), (11, 17)] {
        values.fill(0.0);
        let hot = row * 30 + column;
        values[hot] = 1.0;
        let plain = spec(grid(9.0, 7.0, 30, 20), &values);
        let cross = Overlay::Cross {
            at: plain.grid.centre(hot),
            label: None,
        };
        let seen = heat(&HeatMap {
            overlays: vec![cross],
            ..plain
        });
        let up = (row as f64 + 0.5) / 20.0;
        assert_eq!(seen.share((column as f64 + 0.5) / 30.0, up), [70, 255, 130]);
    }
}

fn coordinate() -> impl Strategy<Value = f64> {
    let odd = vec![
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1e300,
        -1e300,
        1e12,
        0.0,
        5e-324,
    ];
    prop_oneof![4 => -3.0..9.0f64, 1 => proptest::sample::select(odd)]
}

fn overlay() -> impl Strategy<Value = Overlay> {
    let points = prop::collection::vec((coordinate(), coordinate()), 0..6);
    let given = (0..9usize, points, coordinate(), ".{0,40}", any::<u8>());
    given.prop_map(|(kind, points, radius_m, text, id)| {
        let vehicle = VehicleId(id);
        let points: Vec<Point> = points.into_iter().map(|(x, y)| Point::new(x, y)).collect();
        let at = points.first().copied().unwrap_or_default();
        let (label, polygon) = (Some(text), Polygon::new(points.clone()));
        match kind {
            0 => Overlay::Outline { polygon, label },
            1 => Overlay::Circle {
                at,
                radius_m,
                label,
            },
            2 => Overlay::Cross { at, label },
            3 => Overlay::Track { points, vehicle },
            4 => Overlay::Vehicle { at, vehicle },
            5 => Overlay::Home { at, vehicle },
            6 => Overlay::Viewpoint { at },
            7 => Overlay::Fence { polygon },
            _ => Overlay::Area {
                rect: Rect { min: at, max: at },
            },
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn no_overlay_and_no_value_breaks_a_picture(
        overlays in prop::collection::vec(overlay(), 0..8),
        values in prop::collection::vec(coordinate(), 6),
        low in coordinate(),
        high in coordinate(),
    ) {
        let map = HeatMap { overlays, range: Some((low, high)), ..spec(grid(9.0, 7.0, 3, 2), &values) };
        let seen = heat(&map);
        prop_assert!(seen.width <= 960 && seen.width >= 460);
    }
}
