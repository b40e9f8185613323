//! QGroundControl's `.plan`: JSON of file version 1 with a mission of version 2, whose simple items have a frame, a
//! command and seven parameters (null = not given). What is written follows QGroundControl's own description of the format
//! (developer guide, "Plan File Format").

use serde_json::{Map, Value, json};

use super::item::{RawItem, is_on_the_planet, key_of, numbers, param_key};
use super::{MOST_ITEMS, MissionItem, Notes, Origin, WaypointFile};
use crate::geom::Geodetic;

/// Reads a whole file.
pub(super) fn read(text: &str, notes: &mut Notes, file: &mut WaypointFile) {
    let root: Value = match serde_json::from_str(text.trim_start_matches('\u{feff}')) {
        Ok(root) => root,
        Err(error) => {
            notes.add(
                error.line(),
                "",
                "",
                &format!("no valid JSON: {error}"),
                "a .plan of QGroundControl is JSON",
            );
            return;
        }
    };
    must_be(&root, "fileType", &Value::from("Plan"), notes);
    must_be(&root, "version", &Value::from(1), notes);
    let Some(mission) = root.get("mission").filter(|mission| mission.is_object()) else {
        notes.add(
            0,
            "mission",
            &text_of(root.get("mission")),
            "is no mission",
            "an object with \"items\"",
        );
        return;
    };
    must_be(mission, "mission.version", &Value::from(2), notes);
    file.home = home(mission.get("plannedHomePosition"), notes);
    let Some(items) = mission.get("items").and_then(Value::as_array) else {
        let value = text_of(mission.get("items"));
        notes.add(0, "mission.items", &value, "is no list", "a list of items");
        return;
    };
    if items.len() > MOST_ITEMS {
        let allowed = format!("at most {MOST_ITEMS} items are read");
        notes.add(
            0,
            "mission.items",
            &format!("{} items", items.len()),
            "are too many",
            &allowed,
        );
        return;
    }
    for (index, item) in items.iter().enumerate() {
        if notes.are_full() {
            return;
        }
        let origin = Origin {
            line: 0,
            path: format!("mission.items[{index}]"),
        };
        let raw = raw_item(item, origin, notes);
        if let Some((item, raw)) = raw.and_then(|raw| Some((raw.typed(notes)?, raw))) {
            file.push(item, raw.origin);
        }
    }
    name_jumps(items, file);
}

/// A jump of a plan names the item with that `doJumpId`; here it names it by its place in the list.
fn name_jumps(items: &[Value], file: &mut WaypointFile) {
    let id = |item: &Value| item.get("doJumpId").and_then(Value::as_u64);
    for item in &mut file.items {
        if let MissionItem::Jump { to, .. } = item
            && let Some(index) = items.iter().position(|item| id(item) == Some(*to as u64))
        {
            *to = index + 1;
        }
    }
}

/// Checks a field that can have one value only; the last part of the path is its name.
fn must_be(object: &Value, path: &str, expected: &Value, notes: &mut Notes) {
    let name = path.rsplit('.').next().unwrap_or(path);
    let found = object.get(name);
    if found != Some(expected) {
        let wrong = if found.is_some() {
            "is of another kind or version"
        } else {
            "is missing"
        };
        notes.add(
            0,
            path,
            &text_of(found),
            wrong,
            &format!("{expected} is needed"),
        );
    }
}

fn home(value: Option<&Value>, notes: &mut Notes) -> Option<Geodetic> {
    let value = value.filter(|value| !value.is_null())?;
    let numbers: Option<Vec<f64>> = value
        .as_array()
        .and_then(|list| list.iter().map(|number| number.as_f64()).collect());
    let place = match numbers.as_deref() {
        Some(&[latitude_deg, longitude_deg, altitude_m]) => Some(Geodetic {
            latitude_deg,
            longitude_deg,
            altitude_m,
        }),
        Some(_) | None => None,
    };
    let place = place.filter(|place| is_on_the_planet(*place));
    if place.is_none() {
        let allowed =
            "[latitude -90 to 90, longitude -180 to 180, altitude -10000 to 10000] is allowed";
        notes.add(
            0,
            "mission.plannedHomePosition",
            &text_of(Some(value)),
            "is no place",
            allowed,
        );
    }
    place.filter(|home| (home.latitude_deg, home.longitude_deg, home.altitude_m) != (0.0, 0.0, 0.0))
}

fn raw_item(item: &Value, origin: Origin, notes: &mut Notes) -> Option<RawItem> {
    let Some(fields) = item.as_object() else {
        notes.add(
            0,
            &origin.path,
            &text_of(Some(item)),
            "is no item",
            "an object of type \"SimpleItem\"",
        );
        return None;
    };
    if fields.get("type").and_then(Value::as_str) != Some("SimpleItem") {
        let (key, value) = (key_of(&origin, "type"), text_of(fields.get("type")));
        notes.add(
            0,
            &key,
            &value,
            "is not known",
            "only \"SimpleItem\" is read: no surveys or other patterns",
        );
        return None;
    }
    let frame = whole(fields, "frame", &origin, notes);
    let command = whole(fields, "command", &origin, notes);
    let params = params(fields.get("params"), &origin, notes);
    Some(RawItem {
        frame: frame?,
        command: command?,
        params: params?,
        origin,
    })
}

fn whole(
    fields: &Map<String, Value>,
    name: &str,
    origin: &Origin,
    notes: &mut Notes,
) -> Option<u32> {
    let number = fields
        .get(name)
        .and_then(Value::as_u64)
        .and_then(|number| u32::try_from(number).ok());
    if number.is_none() {
        let value = text_of(fields.get(name));
        notes.add(
            0,
            &key_of(origin, name),
            &value,
            "is no such number",
            "a whole number is needed",
        );
    }
    number
}

fn params(value: Option<&Value>, origin: &Origin, notes: &mut Notes) -> Option<[Option<f64>; 7]> {
    let Some(list) = value
        .and_then(Value::as_array)
        .filter(|list| list.len() == 7)
    else {
        let key = key_of(origin, "params");
        notes.add(
            0,
            &key,
            &text_of(value),
            "is no list of seven",
            "seven numbers or null",
        );
        return None;
    };
    let mut params = [None; 7];
    let mut are_numbers = true;
    for (index, (param, value)) in params.iter_mut().zip(list).enumerate() {
        *param = value.as_f64().filter(|number| number.is_finite());
        if param.is_none() && !value.is_null() {
            let key = param_key(origin, index);
            notes.add(
                0,
                &key,
                &text_of(Some(value)),
                "is no number",
                "a number or null",
            );
            are_numbers = false;
        }
    }
    are_numbers.then_some(params)
}

/// Writes a whole file. Speeds, fence and rally points, of which a mission here knows nothing, are those that QGroundControl
/// takes for none; the autopilot is ArduPilot's (firmware 3), the vehicle a rover (type 10).
pub(super) fn write(file: &WaypointFile) -> String {
    let home = file.home.map_or([0.0; 3], |home| {
        [home.latitude_deg, home.longitude_deg, home.altitude_m]
    });
    let item = |(index, item): (usize, &MissionItem)| {
        let (frame, command, params) = numbers(item);
        json!({
            "type": "SimpleItem",
            "autoContinue": true,
            "doJumpId": index + 1,
            "command": command,
            "frame": frame,
            "params": params,
        })
    };
    let items: Vec<Value> = file.items.iter().enumerate().map(item).collect();
    let plan = json!({
        "fileType": "Plan",
        "version": 1,
        "groundStation": "tomoswarm",
        "mission": {
            "version": 2,
            "firmwareType": 3,
            "vehicleType": 10,
            "globalPlanAltitudeMode": 1,
            "cruiseSpeed": 1,
            "hoverSpeed": 1,
            "plannedHomePosition": home,
            "items": items,
        },
        "geoFence": { "version": 2, "circles": [], "polygons": [] },
        "rallyPoints": { "version": 2, "points": [] },
    });
    format!("{plan:#}\n")
}

/// Returns what was found as text; short, however large it is.
fn text_of(value: Option<&Value>) -> String {
    match value {
        None => "nothing".to_owned(),
        Some(Value::Array(list)) if list.len() > 8 => format!("a list of {}", list.len()),
        Some(Value::Object(_)) => "an object".to_owned(),
        Some(value) => value.to_string(),
    }
}
