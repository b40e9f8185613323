//! Whole pictures, decoded again and looked at from outside: only the frame's colour is known here, not the layout.

use proptest::prelude::*;

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
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut rgb).unwrap();
        assert_eq!(frame.color_type, png::ColorType::Rgb);
        let (width, height) = (frame.width as usize, frame.height as usize);
        let mut seen = Seen {
            width,
            height,
            rgb,
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
        colour: 3,
        label: Some("rover 1".to_string()),
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
    (0..8usize, points, coordinate(), ".{0,40}").prop_map(|(kind, points, radius_m, text)| {
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
            3 => Overlay::Track {
                points,
                colour: usize::MAX,
                label,
            },
            4 => Overlay::Dot { at, label },
            5 => Overlay::Home { at, label },
            6 => Overlay::Fence { polygon },
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
