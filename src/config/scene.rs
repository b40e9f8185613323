//! A simulated world: which shapes stand in it, what they do to radio, and who walks there. Names the
//! file of shapes (`.wrl`) without reading it, and says how random persons are placed without placing
//! them.

use std::collections::BTreeMap;

use super::outline::{CORNERS, simple_polygon};
use super::section::{COORDINATE_M, Section};
use crate::geom::{Point, Polygon};

/// The largest attenuation that a material may have, dB/m (and dB per crossing).
const MOST_DB: f64 = 200.0;

/// Which axis of the file of shapes points up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Up {
    /// y is up, as VRML97 has it: (x, y, z) in the file is (x, −z, y) here.
    Y,
    /// z is up, as in the local frame.
    Z,
}

/// What a body does to radio that goes through it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Material {
    /// Attenuation along the way inside, dB/m.
    pub db_per_m: f64,
    /// Attenuation of each crossing of the surface, dB; for open sheets, which have no inside.
    pub db_per_crossing: f64,
    /// Red, green and blue in pictures; `None`: one that is not taken yet.
    pub colour: Option<[u8; 3]>,
}

impl Material {
    const NONE: Material = Material { db_per_m: 0.0, db_per_crossing: 0.0, colour: None };
    const SOLID: Material = Material { db_per_m: 10.0, ..Material::NONE };
}

/// An upright cylinder that stands for a person; not part of an empty sweep.
#[derive(Clone, PartialEq, Debug)]
pub struct Person {
    /// A plain name.
    pub name: String,
    /// Where the axis stands, local frame.
    pub at: Point,
    /// Radius, metres.
    pub radius_m: f64,
    /// Height, metres, from z = 0.
    pub height_m: f64,
    /// Attenuation inside, dB/m.
    pub db_per_m: f64,
}

/// Persons whose places the simulator draws from the seed, uniformly in the area, within these rules.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RandomPersons {
    /// How many.
    pub count: usize,
    /// Smallest distance of an axis from the area's border, metres.
    pub keep_from_border_m: f64,
    /// Smallest distance of an axis from any shape, metres.
    pub keep_from_objects_m: f64,
    /// Smallest distance between two axes, metres; to the fixed persons too.
    pub apart_m: f64,
    /// Radius of each, metres.
    pub radius_m: f64,
    /// Height of each, metres.
    pub height_m: f64,
    /// Attenuation inside, dB/m.
    pub db_per_m: f64,
}

/// The footprint of an upright body.
#[derive(Clone, PartialEq, Debug)]
pub enum Outline {
    /// A simple polygon, convex or not, local frame.
    Polygon(Polygon),
    /// A circle, local frame.
    Circle {
        /// The middle.
        centre: Point,
        /// The radius, metres.
        radius_m: f64,
    },
}

/// An upright body with a constant footprint.
#[derive(Clone, PartialEq, Debug)]
pub struct Object {
    /// A plain name.
    pub name: String,
    /// The footprint.
    pub outline: Outline,
    /// Height of the underside, metres above z = 0.
    pub bottom_m: f64,
    /// Height of the top, metres above z = 0.
    pub top_m: f64,
    /// What it does to radio.
    pub material: Material,
}

/// What stands in a simulated world.
#[derive(Clone, PartialEq, Debug)]
pub struct SceneFile {
    /// A plain name, fit to be part of a file's name.
    pub name: String,
    /// The file of shapes, with the folder of the scene file before it; `None`: only the objects here.
    pub wrl: Option<String>,
    /// The upward axis of the file of shapes.
    pub up: Up,
    /// What is added to its coordinates after turning it upright (x, y, z), metres.
    pub offset_m: [f64; 3],
    /// Materials of its shapes, by DEF name.
    pub materials: BTreeMap<String, Material>,
    /// The material of shapes without an entry of their own.
    pub default_material: Material,
    /// Persons who stand there in every run.
    pub persons: Vec<Person>,
    /// Upright bodies beside those of the file of shapes.
    pub objects: Vec<Object>,
    /// Persons placed by the seed, if any.
    pub random_persons: Option<RandomPersons>,
}

impl SceneFile {
    /// Gives the scene that a file of shapes alone makes, all else being left out.
    pub fn of_shapes(up: Up) -> SceneFile {
        SceneFile {
            name: "scene".to_owned(),
            wrl: None,
            up,
            offset_m: [0.0; 3],
            materials: BTreeMap::new(),
            default_material: Material::SOLID,
            persons: Vec::new(),
            objects: Vec::new(),
            random_persons: None,
        }
    }

    /// Reads a scene; what is wrong is noted at the source.
    pub(super) fn read(root: &Section) -> SceneFile {
        let wrl = root.text("wrl").map(|path| super::beside(root.source.file(), &path));
        let offset = root.numbers("offset_m", &[0.0; 3], 3..=3, COORDINATE_M);
        let scene = SceneFile {
            name: root.name("name", "scene"),
            wrl,
            up: root.choice("up", Up::Y, &[("y", Up::Y), ("z", Up::Z)]),
            offset_m: [offset[0], offset[1], offset[2]],
            materials: root.entries("material").into_iter().map(read_material).collect(),
            default_material: read_default_material(root),
            persons: read_persons(root),
            objects: read_objects(root),
            random_persons: root.optional_section("random_persons").map(|section| read_random(&section)),
        };
        root.finish();
        scene
    }
}

fn material_of(section: &Section, default: Material) -> Material {
    Material {
        db_per_m: section.number("db_per_m", default.db_per_m, 0.0..=MOST_DB),
        db_per_crossing: section.number("db_per_crossing", default.db_per_crossing, 0.0..=MOST_DB),
        colour: read_colour(section),
    }
}

/// Reads a colour as `#rrggbb`.
fn read_colour(section: &Section) -> Option<[u8; 3]> {
    let text = section.text("colour")?;
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6);
    let is_plain = |digits: &&str| digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let Some(number) = digits.filter(is_plain).and_then(|digits| u32::from_str_radix(digits, 16).ok()) else {
        section.refuse("colour", "is no colour", "red, green and blue such as \"#8a5a2b\" are needed");
        return None;
    };
    let [_, red, green, blue] = number.to_be_bytes();
    Some([red, green, blue])
}

fn read_material((name, section): (String, Section)) -> (String, Material) {
    let material = material_of(&section, Material::NONE);
    section.finish();
    (name, material)
}

fn read_default_material(root: &Section) -> Material {
    let section = root.section("default_material");
    let material = material_of(&section, Material::SOLID);
    section.finish();
    material
}

fn read_persons(root: &Section) -> Vec<Person> {
    let read_person = |(index, section): (usize, Section)| {
        let person = Person {
            name: section.name("name", &format!("person-{}", index + 1)),
            at: section.required_point("at_m"),
            radius_m: section.number("radius_m", 0.3, 0.05..=2.0),
            height_m: section.number("height_m", 1.8, 0.2..=3.0),
            db_per_m: section.number("db_per_m", 10.0, 0.0..=MOST_DB),
        };
        section.finish();
        person
    };
    root.sections("person", 1000).into_iter().enumerate().map(read_person).collect()
}

fn read_random(section: &Section) -> RandomPersons {
    let persons = RandomPersons {
        count: section.whole("count", 2, 0..=100),
        keep_from_border_m: section.number("keep_from_border_m", 2.0, 0.0..=500.0),
        keep_from_objects_m: section.number("keep_from_objects_m", 1.5, 0.0..=100.0),
        apart_m: section.number("apart_m", 3.0, 0.0..=500.0),
        radius_m: section.number("radius_m", 0.3, 0.05..=2.0),
        height_m: section.number("height_m", 1.8, 0.2..=3.0),
        db_per_m: section.number("db_per_m", 10.0, 0.0..=MOST_DB),
    };
    section.finish();
    persons
}

fn read_objects(root: &Section) -> Vec<Object> {
    let read_object = |(index, section): (usize, Section)| {
        let object = Object {
            name: section.name("name", &format!("object-{}", index + 1)),
            outline: read_outline(&section),
            bottom_m: section.number("bottom_m", 0.0, -10.0..=500.0),
            top_m: section.number("top_m", 2.5, -10.0..=500.0),
            material: material_of(&section, Material::SOLID),
        };
        if object.top_m <= object.bottom_m {
            section.refuse("top_m", "is not above bottom_m", "a body needs a height");
        }
        section.finish();
        object
    };
    root.sections("object", 10_000).into_iter().enumerate().map(read_object).collect()
}

fn read_outline(section: &Section) -> Outline {
    if section.has("centre_m") || section.has("radius_m") {
        let centre = section.required_point("centre_m");
        let radius_m = section.required_number("radius_m", 0.01..=500.0);
        if section.has("outline_m") {
            section.refuse("outline_m", "stands beside a circle", "give outline_m, or centre_m and radius_m");
        }
        return Outline::Circle { centre, radius_m };
    }
    let corners = section.required_points("outline_m", CORNERS);
    if corners.is_empty() {
        return Outline::Polygon(Polygon::new(corners));
    }
    Outline::Polygon(simple_polygon(corners).unwrap_or_else(|wrong| {
        section.refuse("outline_m", &wrong, "corners in order around a simple outline are needed");
        Polygon::new(Vec::new())
    }))
}
