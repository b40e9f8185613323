//! Where persons truly stood, and how far what an image names is from that: marks of a run, or a list of a researcher's own. It
//! reads text and writes nothing.

use serde_json::{Value, json};
use tomoswarm_proto::RunId;

use super::csv::{CsvHeader, nothing_in, numbered};
use super::recording::{RecordingError, wrong};
use crate::dash::run_files::MARKS_HEADER;
use crate::draw::Overlay;
use crate::geom::Point;
use crate::tomo::{Finds, Peak};

/// What such a file must hold.
const EXPECTED: &str = "the header x_m,y_m, optionally with run,z_m,marked";
/// How large a place is drawn, metres: about as a person.
const RADIUS_M: f64 = 0.25;

/// Where persons truly stood.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct TruePlaces {
    /// Of which run, as far as it is known.
    pub(super) run: Option<RunId>,
    /// The places, in the units of the recording.
    pub(super) places: Vec<Point>,
}

/// Returns whether a file is one of places: its header has what it needs and nothing else.
pub(super) fn is_list(text: &str) -> bool {
    numbered(text)
        .next()
        .is_some_and(|(number, line)| columns_of(number, line).is_ok())
}

/// Returns the header of places, and where x and y are.
fn columns_of(number: usize, line: &str) -> Result<(CsvHeader<'_>, [usize; 2]), RecordingError> {
    let header = CsvHeader::read(number, line, MARKS_HEADER, EXPECTED.to_owned())?;
    let columns = [header.needed("x_m")?, header.needed("y_m")?];
    Ok((header, columns))
}

/// Reads places, as `tomoswarm export` writes the marks of a run (`run-N-marks.csv`); of columns only `x_m` and `y_m` are
/// needed, in the units of the recording.
///
/// # Errors
/// The first line that is not as expected, marks of several runs, or no place.
pub(super) fn read_places(text: &str) -> Result<TruePlaces, RecordingError> {
    let mut lines = numbered(text);
    let Some((number, line)) = lines.next() else {
        return Err(wrong("1: ".into(), nothing_in(text), EXPECTED));
    };
    let (header, columns) = columns_of(number, line)?;
    let of_run = header.column("run");
    let (mut places, mut run) = (Vec::new(), None);
    for (number, line) in lines {
        let fields = header.fields(number, line)?;
        if let Some(column) = of_run.filter(|column| !fields.is_empty(*column)) {
            let own = RunId(fields.whole(column, 0, "a run")?);
            let first = *run.get_or_insert(own);
            if own != first {
                let expected = format!("marks of one run, {first} as in the line of the first");
                return Err(fields.mistake(format!("run {own}"), expected));
            }
        }
        places.push(fields.place(columns)?);
    }
    match places.is_empty() {
        true => Err(wrong(
            String::new(),
            "no place below the header",
            "one at least",
        )),
        false => Ok(TruePlaces { run, places }),
    }
}

/// Returns the places as a picture shows them, in a unit of so many metres.
pub(super) fn circles(places: &[Point], unit_m: f64) -> impl Iterator<Item = Overlay> {
    let radius_m = RADIUS_M / unit_m;
    places.iter().map(move |at| Overlay::Circle {
        at: *at,
        radius_m,
        label: None,
    })
}

/// The places that an image names.
pub(super) struct Named {
    word: &'static str,
    places: Vec<Point>,
}

impl Named {
    /// Takes finds, where they were searched, else peaks.
    pub(super) fn of(finds: Option<&Finds>, peaks: &[Peak]) -> Named {
        match finds {
            Some(finds) => Named {
                word: "find",
                places: finds.found.iter().map(|find| find.at).collect(),
            },
            None => Named {
                word: "peak",
                places: peaks.iter().map(|peak| peak.at).collect(),
            },
        }
    }

    /// Returns in words how far the nearest one is from where somebody stood.
    pub(super) fn words(&self, stood: Point, unit: &str) -> String {
        let nearest = match self.nearest(stood) {
            Some(away) => format!("the nearest {} is {away:.2} {unit} away", self.word),
            None => format!("no {}", self.word),
        };
        format!("marked ({}, {}): {nearest}", stood.x_m, stood.y_m)
    }

    /// Returns the same for all places, as the JSON output shows it.
    pub(super) fn json(&self, places: &[Point]) -> Value {
        let place = |at: &Point| json!({"x": at.x_m, "y": at.y_m, "nearest": self.nearest(*at)});
        json!({"of": self.word, "places": places.iter().map(place).collect::<Vec<_>>()})
    }

    fn nearest(&self, stood: Point) -> Option<f64> {
        let away = self.places.iter().map(|at| at.distance_to(stood));
        away.min_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_a_run_and_a_list_by_hand_are_read() {
        let expected = vec![Point::new(3.2, 7.5), Point::new(-1.0, 2.0)];
        for (text, run) in [
            (
                "run,x_m,y_m,z_m,marked\n2,3.2,7.5,0,2026-05-01T10:00:00Z\n2,-1,2,0,\n",
                Some(RunId(2)),
            ),
            ("# by hand\ny_m, x_m\n\n7.5, 3.2\n2,-1\n", None),
        ] {
            let places = expected.clone();
            assert_eq!(read_places(text).unwrap(), TruePlaces { run, places });
        }
    }

    #[test]
    fn what_is_no_list_of_places_is_refused_with_its_line() {
        for (text, reason) in [
            ("", "1: found an empty file"),
            ("x_m,y_m\n", "no place below the header"),
            ("x_m,z_m\n1,2\n", "no column \"y_m\""),
            ("x_m,y_m,who\n1,2,me\n", "the column \"who\""),
            ("x_m,y_m\n1,2\n1,NaN\n", "3: found \"NaN\""),
            ("x_m,y_m\n1,2,3\n", "2: found 3 fields"),
            (
                "run,x_m,y_m\n1,2,3\n2,2,3\n",
                "3: found run 2, expected marks of one run, 1",
            ),
        ] {
            let refused = read_places(text).unwrap_err().to_string();
            assert!(refused.contains(reason), "{text:?}: {refused}");
        }
    }

    #[test]
    fn the_nearest_of_what_is_named_counts() {
        let named = |places: &[(f64, f64)]| Named {
            word: "find",
            places: places.iter().map(|(x, y)| Point::new(*x, *y)).collect(),
        };
        let stood = Point::new(3.0, 7.0);
        let both = named(&[(9.0, 7.0), (3.0, 7.25)]);
        assert_eq!(
            both.words(stood, "m"),
            "marked (3, 7): the nearest find is 0.25 m away"
        );
        assert_eq!(both.json(&[stood])["places"][0]["nearest"], 0.25);
        assert_eq!(named(&[]).words(stood, "m"), "marked (3, 7): no find");
        assert_eq!(
            named(&[]).json(&[stood])["places"][0]["nearest"],
            Value::Null
        );
    }
}
