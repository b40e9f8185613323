//! Files that a page saves on its browser's machine: what a host has of a run ([`RunFiles`]), and places as a mission of
//! QGroundControl. It makes text and writes nothing.

use serde_json::json;
use tomoswarm_proto::RunId;

use crate::config::{Venue, WaypointFile};
use crate::geom::Geodetic;
use crate::tomo::LinkBins;

/// Places farther away than this are none of a venue, metres.
const FARTHEST_M: f64 = 1e5;

/// The header of a file of marks.
pub const MARKS_HEADER: &str = "run,x_m,y_m,z_m,marked";

/// The files of runs as `tomoswarm export` writes them, by their names.
pub trait RunFiles {
    /// Returns the names of the files that there are of a run.
    ///
    /// # Errors
    /// There is no such run; in words.
    fn names(&self, run: RunId) -> Result<Vec<String>, String>;

    /// Returns what a file of a run holds.
    ///
    /// # Errors
    /// There is no such run or no such file, or it cannot be made; in words.
    fn file(&self, run: RunId, name: &str) -> Result<Vec<u8>, String>;

    /// Returns what a run has measured of links.
    ///
    /// # Errors
    /// There is no such run, or it cannot be read; in words.
    fn links(&self, run: RunId) -> Result<LinkBins, String>;
}

/// Returns what was asked for: a file, or without a name which files there are, and from where (JSON).
///
/// # Errors
/// [`RunFiles`].
pub fn exported(
    files: &(impl RunFiles + ?Sized),
    source: &str,
    (run, name): (RunId, Option<&str>),
) -> Result<Vec<u8>, String> {
    let Some(name) = name else {
        let names = files.names(run)?;
        let listed = json!({ "run": run.0, "from": source, "files": names });
        return Ok(listed.to_string().into_bytes());
    };
    files.file(run, name)
}

/// In which format a mission is saved.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MissionFormat {
    /// Text: QGC WPL 110 (`.waypoints`).
    Waypoints,
    /// JSON: a `.plan` of QGroundControl.
    Plan,
}

/// Returns places, x and y in metres, as a mission whose home is the first home of the venue.
///
/// # Errors
/// There are none, too many, or one that is nowhere near; in words.
pub fn waypoints(
    venue: &Venue,
    places: &[[f64; 2]],
    format: MissionFormat,
) -> Result<String, String> {
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
    let file = WaypointFile::of_track(place(home), &track)?;
    Ok(match format {
        MissionFormat::Waypoints => file.to_wpl(),
        MissionFormat::Plan => file.to_plan(),
    })
}

/// Returns the places of a mission, `.waypoints` or `.plan`, x and y in metres (JSON).
///
/// # Errors
/// All that is wrong with it, in words.
pub fn places_of(venue: &Venue, text: &str) -> Result<String, String> {
    let file = WaypointFile::read("the file", text).map_err(|problems| problems.to_string())?;
    let places = file.points(&venue.plane()).into_iter();
    let rounded = |metres: f64| (metres * 1e3).round() / 1e3;
    let places: Vec<[f64; 2]> = places
        .map(|(_, at)| [rounded(at.x_m), rounded(at.y_m)])
        .collect();
    match places.is_empty() {
        true => Err("the file: it leads to no place".to_owned()),
        false => Ok(json!(places).to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{self, Config};

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
        for (format, begins) in [
            (MissionFormat::Waypoints, "QGC WPL 110"),
            (MissionFormat::Plan, "{"),
        ] {
            let text = waypoints(&venue(), &[[1.0, 2.0], [5.0, 3.5]], format).unwrap();
            assert!(text.starts_with(begins), "{text}");
            let read = places_of(&venue(), &text).unwrap();
            assert_eq!(read, "[[1.0,2.0],[5.0,3.5]]", "{text}");
        }
    }

    #[test]
    fn what_is_no_mission_is_refused_with_what_is_wrong() {
        let home = "0\t1\t0\t16\t0\t0\t0\t0\t52\t4\t0\t1";
        for (text, reason) in [
            ("", "the file"),
            ("{\"fileType\": \"Plan\"}", "mission"),
            (&format!("QGC WPL 110\n{home}\n"), "is no mission"),
            (
                &format!("QGC WPL 110\n{home}\n1\t0\t2\t93\t5\t0\t0\t0\t0\t0\t0\t1\n"),
                "no place",
            ),
        ] {
            let refused = places_of(&venue(), text).unwrap_err();
            assert!(refused.contains(reason), "{text}: {refused}");
        }
    }

    #[test]
    fn no_place_a_place_nowhere_and_no_number_are_refused() {
        for places in [&[][..], &[[1.0, 1e9]], &[[f64::NAN, 0.0]]] {
            let saved = waypoints(&venue(), places, MissionFormat::Plan);
            assert!(saved.is_err(), "{places:?}");
        }
    }
}
