//! What `tomoswarm scene` says of a scene, in a few lines for a person.

use super::load::LoadedScene;
use super::scene_pictures::SceneView;
use crate::config::MaterialSpec;
use crate::config::Up;
use crate::geom::Point;
use crate::scene::VrmlShape;

/// Names that are listed for one material.
const NAMES_SHOWN: usize = 12;
/// Objects and persons that are listed.
const LINES_SHOWN: usize = 50;

/// Describes a scene; begins with its name and ends in a line break.
pub(super) fn describe(depicted: &LoadedScene, look: &SceneView) -> String {
    let mut lines = vec![
        shapes_line(depicted),
        bodies_line(depicted),
        box_line(depicted),
    ];
    lines.extend(material_lines(depicted));
    lines.extend(object_lines(depicted));
    lines.extend(person_lines(depicted));
    lines.extend(place_line(depicted));
    lines.push(("plan", format!("plan.png: the cut at {} m", look.height_m)));
    let view = look.viewpoint(depicted);
    let [x, y, z] = view.at;
    let (yaw, pitch) = (view.yaw.degrees(), view.pitch_rad.to_degrees());
    lines.push((
        "view",
        format!(
            "view.png: from ({x:.2}, {y:.2}, {z:.2}), looking {yaw:.0}° from x, {pitch:.0}° above the horizon"
        ),
    ));
    let head = format!("scene {}\n", depicted.name);
    lines.iter().fold(head, |text, (name, value)| {
        text + &format!("  {name:<12} {value}\n")
    })
}

type Line = (&'static str, String);

fn shapes_line(depicted: &LoadedScene) -> Line {
    let list = &depicted.shapes.shapes;
    let (faces, triangles) = list.iter().fold((0, 0), |(faces, triangles), shape| {
        (faces + shape.faces, triangles + shape.triangles)
    });
    let up = match depicted.file.up {
        Up::Y => "y",
        Up::Z => "z",
    };
    let file = depicted
        .file
        .wrl
        .as_ref()
        .map(|file| format!(" from {file}"))
        .unwrap_or_default();
    (
        "shapes",
        format!(
            "{} shapes of {faces} faces, {triangles} triangles{file}, {up} up",
            list.len()
        ),
    )
}

fn bodies_line(depicted: &LoadedScene) -> Line {
    let objects = depicted.scene.objects();
    let closed = objects.iter().filter(|object| object.closed).count();
    (
        "bodies",
        format!("closed: {closed}, open sheets: {}", objects.len() - closed),
    )
}

fn box_line(depicted: &LoadedScene) -> Line {
    let text = match depicted.scene.extent() {
        Some((low, high)) => {
            let axis = |index: usize| format!("{:.2} to {:.2}", low[index], high[index]);
            format!("x {}, y {}, z {} m", axis(0), axis(1), axis(2))
        }
        None => "nothing stands there".to_owned(),
    };
    ("box", text)
}

fn material_lines(depicted: &LoadedScene) -> Vec<Line> {
    let file = &depicted.file;
    let name_of = |shape: &VrmlShape| {
        shape
            .names
            .iter()
            .rev()
            .find(|name| file.materials.contains_key(&***name))
            .cloned()
    };
    let of = |wanted: Option<&str>| -> Vec<&VrmlShape> {
        let is_of = |shape: &&VrmlShape| name_of(shape).as_deref() == wanted;
        depicted.shapes.shapes.iter().filter(is_of).collect()
    };
    let mut lines: Vec<Line> = Vec::new();
    for (name, material) in &file.materials {
        lines.push((
            "material",
            format!(
                "{name}: {}; {}",
                material_text(material),
                listed(&of(Some(name)))
            ),
        ));
    }
    let others = of(None);
    if !others.is_empty() {
        lines.push((
            "material",
            format!(
                "of others: {}; {}",
                material_text(&file.default_material),
                listed(&others)
            ),
        ));
    }
    lines
}

/// Returns the number of shapes and the innermost names of the first.
fn listed(shapes: &[&VrmlShape]) -> String {
    let named: Vec<&str> = shapes
        .iter()
        .filter_map(|shape| shape.names.last().map(|name| &**name))
        .collect();
    let mut shown: Vec<&str> = Vec::new();
    for name in named {
        if !shown.contains(&name) && shown.len() <= NAMES_SHOWN {
            shown.push(name);
        }
    }
    let is_cut = shown.len() > NAMES_SHOWN;
    shown.truncate(NAMES_SHOWN);
    let more = if is_cut { ", …" } else { "" };
    let plural = if shapes.len() == 1 { "shape" } else { "shapes" };
    format!(
        "{} {plural}: {}{more}",
        shapes.len(),
        if shown.is_empty() {
            "unnamed".into()
        } else {
            shown.join(", ")
        }
    )
}

fn object_lines(depicted: &LoadedScene) -> Vec<Line> {
    let objects = &depicted.file.objects;
    let line = |object: &crate::config::Object| {
        let (low_m, high_m) = (object.bottom_m, object.top_m);
        (
            "object",
            format!(
                "{}: {}, z {low_m} to {high_m} m",
                object.name,
                material_text(&object.material)
            ),
        )
    };
    shortened(objects.iter().map(line).collect(), "object")
}

fn person_lines(depicted: &LoadedScene) -> Vec<Line> {
    let line = |person: &crate::scene::Person| {
        let (name, radius_m, db_per_m) = (&person.name, person.radius_m, person.db_per_m);
        let at = Point::new(hundredths(person.at.x_m), hundredths(person.at.y_m));
        (
            "person",
            format!(
                "{name} at {}, radius {radius_m} m, {db_per_m} dB/m",
                place(&at)
            ),
        )
    };
    let mut lines = shortened(depicted.persons.iter().map(line).collect(), "person");
    if let (Some(random), None) = (&depicted.file.random_persons, &depicted.sim) {
        let text = format!(
            "{} more are placed by the seed of a simulation; they are not drawn",
            random.count
        );
        lines.push(("persons", text));
    }
    lines
}

fn hundredths(length_m: f64) -> f64 {
    (length_m * 100.0).round() / 100.0
}

/// Returns the first of many lines, and how many follow.
fn shortened(mut lines: Vec<Line>, name: &'static str) -> Vec<Line> {
    let more = lines.len().saturating_sub(LINES_SHOWN);
    lines.truncate(LINES_SHOWN);
    if more > 0 {
        lines.push((name, format!("and {more} more")));
    }
    lines
}

fn place_line(depicted: &LoadedScene) -> Option<Line> {
    let venue = &depicted.sim.as_ref()?.venue;
    let area = venue.area;
    let text = format!(
        "venue {}: area {} to {}, fence of {} corners, {} homes",
        venue.name,
        place(&area.min),
        place(&area.max),
        venue.fence.corners().len(),
        venue.homes.len()
    );
    Some(("place", text))
}

/// Describes what a body is made of.
fn material_text(material: &MaterialSpec) -> String {
    let colour = material
        .colour
        .map(|[red, green, blue]| format!(", #{red:02x}{green:02x}{blue:02x}"));
    let (inside, crossing) = (material.db_per_m, material.db_per_crossing);
    format!(
        "{inside} dB/m, {crossing} dB a crossing{}",
        colour.unwrap_or_default()
    )
}

/// Writes a place of the plane.
fn place(point: &Point) -> String {
    format!("({}, {})", point.x_m, point.y_m)
}
