//! "QGC WPL 110": a line that names the format, then a line of twelve fields for home and for each item.
//!
//! Fields are separated by tabs; blanks are taken as well, since some programs write them. Empty lines and lines that
//! begin with # are passed over.

use super::item::{COLUMNS, RawItem, numbers};
use super::{MOST_ITEMS, MissionItem, Notes, Origin, WaypointFile};
use crate::geom::Geodetic;

const HEADER: &str = "QGC WPL 110";
const FIELDS: &str = "index, current, frame, command, param1, param2, param3, param4, latitude, longitude, altitude, \
                      autocontinue";

/// Returns the line of an item in a file as we write it: after the header and home.
pub(super) fn origin_of(item: usize) -> Origin {
    Origin {
        line: item + 3,
        path: String::new(),
    }
}

/// Reads a whole file.
pub(super) fn read(text: &str, notes: &mut Notes, file: &mut WaypointFile) {
    let text = text.trim_start_matches('\u{feff}');
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(at, line)| (at + 1, line.trim()));
    let is_said = |line: &str| !line.is_empty() && !line.starts_with('#');
    let header = lines.find(|(_, line)| is_said(line)).unwrap_or((1, ""));
    if header
        .1
        .split_ascii_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        != HEADER
    {
        refuse_header(header, notes);
        return;
    }
    for (index, (line, fields)) in lines.filter(|(_, line)| is_said(line)).enumerate() {
        if index > MOST_ITEMS {
            notes.add(
                line,
                "index",
                &index.to_string(),
                "is too high",
                &format!("at most {MOST_ITEMS} items are read"),
            );
            return;
        }
        if notes.are_full() {
            return;
        }
        let Some(raw) = raw_item(line, fields, index, notes) else {
            continue;
        };
        if index == 0 {
            // All zeros: no home was known when the file was written.
            let home = raw.home(notes);
            file.home = home.filter(|home| {
                (home.latitude_deg, home.longitude_deg, home.altitude_m) != (0.0, 0.0, 0.0)
            });
        } else if let Some(item) = raw.typed(notes) {
            file.push(item, raw.origin);
        }
    }
}

fn refuse_header((line, found): (usize, &str), notes: &mut Notes) {
    let wrong = match found.strip_prefix("QGC WPL") {
        Some(_) => "is of another version",
        None => "is no waypoint file",
    };
    let allowed = format!("\"{HEADER}\" is the first line; a .plan begins with {{");
    notes.add(line, "line", found, wrong, &allowed);
}

/// Takes a line apart; `index` is what its first field must say.
fn raw_item(line: usize, text: &str, index: usize, notes: &mut Notes) -> Option<RawItem> {
    let fields: Vec<&str> = text.split_ascii_whitespace().take(13).collect();
    if fields.len() != 12 {
        notes.add(
            line,
            "line",
            text,
            "has not twelve fields",
            &format!("needed: {FIELDS}"),
        );
        return None;
    }
    let mut whole = |column: usize, name: &str, allowed: &str| {
        let number = fields[column].parse::<u32>().ok();
        if number.is_none() {
            notes.add(line, name, fields[column], "is no such number", allowed);
        }
        number
    };
    let number = whole(0, "index", "items are counted from 0");
    let flags = (
        whole(1, "current", "0 or 1"),
        whole(11, "autocontinue", "0 or 1"),
    );
    let (frame, command) = (
        whole(2, "frame", "a whole number"),
        whole(3, "command", "a whole number"),
    );
    if number.is_some_and(|number| number as usize != index) {
        let allowed = format!("items are counted from 0; {index} is the next");
        notes.add(line, "index", fields[0], "is out of order", &allowed);
    }
    for (name, field, flag) in [
        ("current", fields[1], flags.0),
        ("autocontinue", fields[11], flags.1),
    ] {
        if flag.is_some_and(|flag| flag > 1) {
            notes.add(line, name, field, "is no flag", "0 or 1");
        }
    }
    let mut params = [None; 7];
    let mut are_numbers = true;
    for (at, (param, field)) in params.iter_mut().zip(&fields[4..11]).enumerate() {
        *param = field
            .parse::<f64>()
            .ok()
            .filter(|number| number.is_finite());
        if param.is_none() {
            notes.add(line, COLUMNS[at], field, "is no number", "a finite number");
            are_numbers = false;
        }
    }
    let origin = Origin {
        line,
        path: String::new(),
    };
    are_numbers.then_some(RawItem {
        origin,
        frame: frame?,
        command: command?,
        params,
    })
}

/// Writes a whole file.
pub(super) fn write(file: &WaypointFile) -> String {
    let nowhere = Geodetic {
        latitude_deg: 0.0,
        longitude_deg: 0.0,
        altitude_m: 0.0,
    };
    let Geodetic {
        latitude_deg,
        longitude_deg,
        altitude_m,
    } = file.home.unwrap_or(nowhere);
    let home = (
        0,
        16,
        [0.0, 0.0, 0.0, 0.0, latitude_deg, longitude_deg, altitude_m],
    );
    let mut text = format!("{HEADER}\n");
    let items = file.items().iter().map(|item: &MissionItem| numbers(item));
    for (index, (frame, command, params)) in std::iter::once(home).chain(items).enumerate() {
        let current = u8::from(index == 0);
        let params = params.map(|number| number.to_string()).join("\t");
        text.push_str(&format!(
            "{index}\t{current}\t{frame}\t{command}\t{params}\t1\n"
        ));
    }
    text
}
