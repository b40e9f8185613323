//! Pictures of a small place as text: one letter for each pixel.

use std::sync::Arc;

use proptest::prelude::*;
use tomoswarm_proto::{LayerId, TileAddress, TileReport, VehicleId};

use super::*;
use crate::config;
use crate::geom::Angle;

const VENUE: &str = "kind = \"venue\"\nname = \"small\"\narea_m = [0.4, 0.4, 5.6, 3.6]\n\
    fence_m = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]]\nhomes_m = [[0.7, 0.7], [5.3, 3.3]]\n\
    [datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\naltitude_m = 0.0\n";

fn venue() -> Venue {
    match config::read("a.toml", VENUE, &mut |path| Err(path.to_owned())).unwrap() {
        config::Config::Venue(venue) => venue,
        other => panic!("{other:?}"),
    }
}

/// Known to be free west of x = 4.4, but for a wall from (3, 2) to the north and a stone at (1.9, 2.5).
fn map() -> Merged {
    let mut map = Merged::new(Lattice::new(0.2), None);
    let value = |at: Point| {
        let is_wall = (3.0..3.4).contains(&at.x_m) && at.y_m > 2.0;
        let is_stone = at.distance_to(Point::new(1.9, 2.5)) < 0.1;
        if is_wall || is_stone {
            17
        } else if at.x_m < 4.4 {
            -17
        } else {
            0
        }
    };
    let middle = |index: usize| {
        Point::new(
            0.2 * (index % 32) as f64 + 0.1,
            0.2 * (index / 32) as f64 + 0.1,
        )
    };
    let cells = Arc::new(std::array::from_fn(|index| value(middle(index))));
    let address = TileAddress {
        slice: 0,
        x: 0,
        y: 0,
    };
    map.join(&TileReport {
        layer: LayerId::default(),
        address,
        revision: 1,
        cells,
    })
    .unwrap();
    map
}

fn vehicle(
    id: u8,
    x_m: f64,
    y_m: f64,
    facing_deg: f64,
    status: Option<MissionStatus>,
) -> VehicleSnapshot {
    let heading = Angle::from_degrees(facing_deg);
    VehicleSnapshot {
        id: VehicleId(id),
        at: Point::new(x_m, y_m),
        heading,
        status,
    }
}

fn vehicles() -> Vec<VehicleMarker> {
    let track = (0..12)
        .map(|step| Point::new(0.7, 0.7 + 0.2 * f64::from(step)))
        .collect();
    let first = vehicle(1, 1.1, 2.9, 0.0, Some(MissionStatus::Following));
    let twelfth = vehicle(12, 5.0, 1.5, 90.0, None);
    vec![
        VehicleMarker {
            vehicle: first,
            track,
        },
        VehicleMarker {
            vehicle: twelfth,
            track: VecDeque::new(),
        },
    ]
}

fn frame(columns: usize, rows: usize) -> Option<RunFrame> {
    let line = "lap 1/2  3.0 min simulated".to_owned();
    RunFrame::new(&venue(), &map(), &vehicles(), line, Size { columns, rows })
}

/// The pixels, and the letters of the vehicles in the upper of their two.
fn drawn(frame: &RunFrame) -> Vec<String> {
    let letter = |index: usize, pixel: &Pixel| {
        let (row, column) = (index / frame.columns, index % frame.columns);
        let vehicle = frame
            .letters
            .iter()
            .find(|(at, of, ..)| (2 * at, *of) == (row, column));
        vehicle.map_or(
            match pixel {
                Pixel::Outside => ' ',
                Pixel::Unknown => '?',
                Pixel::Free => '.',
                Pixel::Occupied => '#',
                Pixel::Home => 'h',
                Pixel::Track(_) => '-',
                Pixel::Ahead(_) => '+',
            },
            |(.., vehicle)| letter_of(*vehicle),
        )
    };
    let letters: Vec<char> = frame
        .pixels
        .iter()
        .enumerate()
        .map(|(at, pixel)| letter(at, pixel))
        .collect();
    letters
        .chunks(frame.columns)
        .map(|row| row.iter().collect::<String>().trim_end().to_owned())
        .collect()
}

/// What is left of a line without its colours.
fn plain(line: &str) -> String {
    let mut parts = line.split('\u{1b}');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + part.split_once('m').unwrap().1)
}

#[test]
fn map_tracks_homes_and_vehicles_are_where_they_belong() {
    let frame = frame(40, 12).unwrap();
    let expected = [
        "",
        "",
        "  ?..........###...??????",
        "  ?..........###...??????",
        "  ?..........###...??????",
        "  ?..........###...???h??",
        "  ?..-1......###...??????",
        "  ?..-.+.#...###...??????",
        "  ?..-...#...###...??????",
        "  ?..-.......###...??+???",
        "  ?..-.............??2???",
        "  ?..-.............??????",
        "  ?..-.............??????",
        "  ?..-.............??????",
        "  ?..-.............??????",
        "  ?..-.............??????",
        "  ?................??????",
        "  ???????????????????????",
        "",
        "",
    ];
    assert_eq!(drawn(&frame), expected, "{:#?}", drawn(&frame));
    assert_eq!(
        frame.text,
        ["lap 1/2  3.0 min simulated", "1 on its way  12 off"]
    );
}

#[test]
fn a_stone_is_seen_however_coarse_the_picture() {
    for (columns, rows) in [(16, 8), (30, 9), (77, 23), (200, 60)] {
        let frame = frame(columns, rows).unwrap();
        let is_west = |index: usize| index % frame.columns < frame.columns * 3 / 8;
        let stones = frame
            .pixels
            .iter()
            .enumerate()
            .filter(|(at, pixel)| is_west(*at) && **pixel == Pixel::Occupied);
        assert!(stones.count() > 0, "{columns} x {rows}");
    }
}

#[test]
fn a_line_says_a_colour_only_where_it_changes() {
    let wall = frame(40, 12).unwrap();
    let lines = wall.lines();
    assert_eq!(lines.len(), 12);
    let count = |line: &str, what: &str| line.matches(what).count();
    assert!(
        lines.iter().all(|line| count(line, "\u{1b}") <= 24),
        "{lines:#?}"
    );
    assert!(
        lines
            .iter()
            .any(|line| line.contains("\u{1b}[38;5;231m\u{1b}[48;5;32m1")),
        "{lines:#?}"
    );
    assert!(
        lines.iter().any(|line| line.contains("\u{1b}[48;5;58m2")),
        "{lines:#?}"
    );
}

#[test]
fn a_legend_says_what_signs_and_colours_mean_as_far_as_there_is_room() {
    let legend = |columns, rows| -> Vec<String> {
        let lines = frame(columns, rows).unwrap().legend;
        lines.iter().map(|line| plain(line)).collect()
    };
    let whole =
        "1\u{2580} vehicle, its front     its track     occupied     free     unknown     home";
    assert_eq!(legend(80, 24), [whole]);
    assert_eq!(legend(80, 12), [""; 0]);
    assert_eq!(legend(60, 20).len(), 2);
    assert_eq!(legend(60, 13).len(), 1);
    assert_eq!(legend(16, 60).last().unwrap(), "   home");
    let shown = frame(80, 24).unwrap().lines();
    assert_eq!(plain(shown.last().unwrap()), whole);
}

#[test]
fn the_legend_has_the_colours_of_the_picture() {
    let frame = frame(80, 24).unwrap();
    let legend = frame.legend.concat();
    assert!(
        legend.starts_with("\u{1b}[38;5;231m\u{1b}[48;5;32m1\u{1b}[38;5;32m\u{1b}[49m\u{2580}")
    );
    for (colour, words) in [
        (111, "its track"),
        (16, "occupied"),
        (255, "free"),
        (243, "unknown"),
        (150, "home"),
    ] {
        let entry = format!("\u{1b}[48;5;{colour}m  \u{1b}[49m {words}");
        assert!(legend.contains(&entry), "{words} in {legend:?}");
    }
}

proptest! {
    #[test]
    fn a_picture_fits_its_terminal(columns in 0..300usize, rows in 0..120usize) {
        if let Some(frame) = frame(columns, rows) {
            let lines = frame.lines();
            prop_assert!(lines.len() <= rows);
            prop_assert!(lines.iter().all(|line| plain(line).chars().count() <= columns));
            prop_assert_eq!(frame.letters.len(), 2);
        } else {
            prop_assert!(columns < 16 || rows < 8);
        }
    }
}
