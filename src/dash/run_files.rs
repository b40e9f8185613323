//! Files that a page saves on its browser's machine: the links of a run as `tomoswarm export` and `tomoswarm image` have them, and
//! places as a mission of QGroundControl. It makes text and writes nothing.

use std::fmt::Write;

use crate::config::Venue;
use crate::config::WaypointFile;
use crate::geom::Geodetic;
use crate::tomo::Link;

/// The columns of a links file.
const LINKS_HEADER: &str = "tx_x_m,tx_y_m,rx_x_m,rx_y_m,packets,rssi_dbm,spots,misses,spread_db";
/// Places farther away than this are none of a venue, metres.
const FARTHEST_M: f64 = 1e5;

/// Returns a links file: one line per link, with an empty strength where no packet was heard.
pub fn links_csv(links: &[Link]) -> String {
    let mut text = format!("{LINKS_HEADER}\n");
    for link in links {
        let Link {
            from,
            to,
            packets,
            spots,
            misses,
            mean_dbm,
            spread_db,
        } = link;
        let heard = (*packets > 0).then(|| mean_dbm.to_string());
        let rssi = heard.unwrap_or_default();
        let ends = format!("{},{},{},{}", from.x_m, from.y_m, to.x_m, to.y_m);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{ends},{packets},{rssi},{spots},{misses},{spread_db}");
    }
    text
}

/// Returns places, x and y in metres, as a mission (QGC WPL 110) whose home is the first home of the venue.
///
/// # Errors
/// There are none, too many, or one that is nowhere near; in words.
pub fn waypoints(venue: &Venue, places: &[[f64; 2]]) -> Result<String, String> {
    let is_near = |at: &&[f64; 2]| at.iter().all(|metres| metres.abs() < FARTHEST_M);
    if let Some(far) = places.iter().find(|at| !is_near(at)) {
        return Err(format!(
            "({}, {}) is no place of this venue",
            far[0], far[1]
        ));
    }
    let plane = venue.plane();
    let place = |[x_m, y_m]: [f64; 2]| plane.to_earth([x_m, y_m, 0.0]);
    let home = venue.homes.first();
    let home = home.map_or([0.0, 0.0], |at| [at.x_m, at.y_m]);
    let track: Vec<Geodetic> = places.iter().map(|at| place(*at)).collect();
    Ok(WaypointFile::of_track(place(home), &track)?.to_wpl())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{self, Config};
    use crate::geom::Point;

    fn venue() -> Venue {
        let text = "kind = \"venue\"\nname = \"small\"\narea_m = [0.4, 0.4, 5.6, 3.6]\n\
            fence_m = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]]\nhomes_m = [[0.7, 0.7]]\n\
            [datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\naltitude_m = 0.0\n";
        match config::read("a.toml", text, &mut |path| Err(path.to_owned())).unwrap() {
            Config::Venue(venue) => venue,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn places_come_back_from_the_file_that_is_made_of_them() {
        let text = waypoints(&venue(), &[[1.0, 2.0], [5.0, 3.5]]).unwrap();
        let read = WaypointFile::read("a.waypoints", &text).unwrap();
        let points = read.points(&venue().plane());
        let near = |at: Point, x_m: f64, y_m: f64| at.distance_to(Point::new(x_m, y_m)) < 0.01;
        assert_eq!(points.len(), 2, "{text}");
        assert!(
            near(points[0].1, 1.0, 2.0) && near(points[1].1, 5.0, 3.5),
            "{points:?}"
        );
    }

    #[test]
    fn no_place_a_place_nowhere_and_no_number_are_refused() {
        for places in [&[][..], &[[1.0, 1e9]], &[[f64::NAN, 0.0]]] {
            assert!(waypoints(&venue(), places).is_err(), "{places:?}");
        }
    }

    #[test]
    fn a_link_that_was_not_heard_has_no_strength() {
        let heard = Link::fixed(Point::new(0.0, 1.0), Point::new(4.0, 1.5), 3, -61.5);
        let mut missed = heard;
        (missed.packets, missed.misses) = (0, 7);
        let text = links_csv(&[heard, missed]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "0,1,4,1.5,3,-61.5,1,0,0");
        assert_eq!(lines[2], "0,1,4,1.5,0,,1,7,0");
    }
}
