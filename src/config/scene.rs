//! A simulated world: which shapes stand in it, what they do to radio, and who walks there. Names the
//! file of shapes (`.wrl`) without reading it, and says how random persons are placed without placing
//! them.

mod object;

use std::collections::BTreeMap;

pub use self::object::{Object, Outline};
use super::FileLine;
use super::forms::{FileName, Name, RequiredPlace, places};
use super::keys::{
    Form, KeyEntry, Keyed, Keys, List, Number, Numbers, Rowed, Whole, WordChoice, Words, quoted,
    read_table,
};
use super::section::{COORDINATE_M, Section};
use crate::geom::Point;

/// The largest attenuation that a material may have, dB/m (and dB per crossing).
const MOST_DB: f64 = 200.0;
/// Most places of a walk.
const WALK_PLACES: usize = 1000;

/// Which axis of the file of shapes points up.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Up {
    /// y is up, as VRML97 has it: (x, y, z) in the file is (x, −z, y) here.
    #[default]
    Y,
    /// z is up, as in the local frame.
    Z,
}

/// What a body does to radio that goes through it.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct MaterialSpec {
    /// Attenuation along the way inside, dB/m.
    pub db_per_m: f64,
    /// Attenuation of each crossing of the surface, dB; for open sheets, which have no inside.
    pub db_per_crossing: f64,
    /// Red, green and blue in pictures; `None`: one that is not taken yet.
    pub colour: Option<[u8; 3]>,
}

impl MaterialSpec {
    const NONE: MaterialSpec = MaterialSpec {
        db_per_m: 0.0,
        db_per_crossing: 0.0,
        colour: None,
    };
    const SOLID: MaterialSpec = MaterialSpec {
        db_per_m: 10.0,
        ..MaterialSpec::NONE
    };
}

/// An upright cylinder that stands for a person; not part of an empty sweep.
#[derive(Clone, PartialEq, Debug, Default)]
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
    /// Where the person walks from `at`, and the same way back, again and again; empty = nowhere.
    pub path: Vec<Point>,
    /// How fast, m/s.
    pub speed_mps: f64,
}

/// Persons whose places the simulator draws from the seed, uniformly in the area, within these rules.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
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
    pub materials: BTreeMap<String, MaterialSpec>,
    /// The material of shapes without an entry of their own.
    pub default_material: MaterialSpec,
    /// Persons who stand there in every run.
    pub persons: Vec<Person>,
    /// Upright bodies beside those of the file of shapes.
    pub objects: Vec<Object>,
    /// Persons placed by the seed, if any.
    pub random_persons: Option<RandomPersons>,
}

impl SceneFile {
    /// Returns the scene that a file of shapes alone makes, all else being left out.
    pub fn of_shapes(up: Up) -> SceneFile {
        SceneFile {
            name: "scene".to_owned(),
            wrl: None,
            up,
            offset_m: [0.0; 3],
            materials: BTreeMap::new(),
            default_material: MaterialSpec::SOLID,
            persons: Vec::new(),
            objects: Vec::new(),
            random_persons: None,
        }
    }

    /// Reads a scene; what is wrong is noted at the source.
    pub(super) fn read(root: &Section<'_>) -> SceneFile {
        let mut scene = SceneFile::of_shapes(Up::Y);
        read_table(&mut scene, root);
        for (index, object) in scene.objects.iter().enumerate() {
            if object.top_m <= object.bottom_m {
                let key = format!("object[{index}].top_m");
                root.refuse(&key, "is not above bottom_m", "a body needs a height");
            }
        }
        check_persons(root, &scene.persons);
        scene
    }

    /// Returns where its persons stand in the file: of who walks the path, otherwise the place.
    pub(super) fn lines_of_persons(&self, root: &Section<'_>) -> Vec<FileLine> {
        let line = |index: usize| {
            let keys = ["path_m", "at_m"].map(|key| format!("person[{index}].{key}"));
            let known = keys.iter().find(|key| root.source.is_known(key));
            root.source.line_of_key(known.unwrap_or(&keys[0]))
        };
        (0..self.persons.len()).map(line).collect()
    }
}

/// Refuses persons who walk nowhere, and two of one name: what is said of one would be taken for the other.
fn check_persons(root: &Section<'_>, persons: &[Person]) {
    for (index, person) in persons.iter().enumerate() {
        if !person.path.is_empty() && person.path.iter().all(|place| *place == person.at) {
            let rule = "a place other than at_m is needed, or no path_m for who stands still";
            root.refuse(&format!("person[{index}].path_m"), "leads nowhere", rule);
        }
        let is_same = |other: &&Person| other.name == person.name;
        let Some(other) = persons[..index].iter().position(|other| is_same(&other)) else {
            continue;
        };
        // A name that was left out is the number's: then the other one was given.
        let keys = [index, other].map(|index| format!("person[{index}].name"));
        let is_given = root.source.is_known(&keys[0]);
        let (key, of) = if is_given {
            (&keys[0], other)
        } else {
            (&keys[1], index)
        };
        let wrong = format!("is the name of person[{of}] as well");
        root.refuse(key, &wrong, "a name of its own is needed");
    }
}

impl WordChoice for Up {
    const WORDS: &'static [(&'static str, Up)] = &[("y", Up::Y), ("z", Up::Z)];
}

impl Keyed for SceneFile {
    fn keys(&mut self, to: &mut dyn Keys) {
        let SceneFile {
            name,
            wrl,
            up,
            offset_m,
            materials,
            default_material,
            persons,
            objects,
            random_persons,
        } = self;
        let means = "a plain name, part of the output folder's name";
        let mut plain = Name {
            name,
            default: "scene".to_owned(),
        };
        to.form(
            &mut plain,
            KeyEntry {
                name: "name",
                left_out: "scene",
                means,
            },
        );
        let means = "file of shapes, VRML97; see [../scenes/README.md](../scenes/README.md)";
        let mut file = FileName {
            name: wrl,
            needed: None,
        };
        to.form(
            &mut file,
            KeyEntry {
                name: "wrl",
                left_out: "",
                means,
            },
        );
        let mut offset = offset_m.to_vec();
        to.numbers(
            &mut offset,
            Numbers {
                name: "offset_m",
                default: &[0.0; 3],
                count: 3..=3,
                allowed: COORDINATE_M,
                means: "added to its coordinates once it stands upright (x, y, z)",
            },
        );
        *offset_m = [offset[0], offset[1], offset[2]];
        let means = "axis of the file of shapes that points up";
        to.word(
            up,
            Words {
                name: "up",
                default: Up::Y.word(),
                means,
            },
        );
        let left_out = "";
        let means = "for shapes under `DEF NAME`";
        to.named_tables(
            materials,
            KeyEntry {
                name: "material",
                left_out,
                means,
            },
        );
        let means = "for shapes without an entry";
        let mut table = MaterialTable {
            material: default_material,
            default: MaterialSpec::SOLID,
        };
        to.table(
            &mut table,
            KeyEntry {
                name: "default_material",
                left_out,
                means,
            },
        );
        let keys = |person: &mut Person, index, to: &mut dyn Keys| person.keys(index, to);
        let means = "upright cylinders; not there in an empty sweep";
        to.rows(
            &mut List {
                list: persons,
                keys,
            },
            Rowed {
                name: "person",
                most: 1000,
                means,
            },
        );
        let keys = |object: &mut Object, index, to: &mut dyn Keys| object.keys(index, to);
        let means = "upright bodies; the footprint is an outline or a circle";
        to.rows(
            &mut List {
                list: objects,
                keys,
            },
            Rowed {
                name: "object",
                most: 10_000,
                means,
            },
        );
        let means = "drawn from the seed";
        to.maybe_table(
            random_persons,
            KeyEntry {
                name: "random_persons",
                left_out: "none",
                means,
            },
        );
    }
}

/// A material with its defaults.
struct MaterialTable<'a> {
    material: &'a mut MaterialSpec,
    default: MaterialSpec,
}

impl Keyed for MaterialTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        let MaterialSpec {
            db_per_m,
            db_per_crossing,
            colour,
        } = &mut *self.material;
        to.number(
            db_per_m,
            Number {
                name: "db_per_m",
                default: self.default.db_per_m,
                allowed: 0.0..=MOST_DB,
                means: "attenuation inside a closed body",
            },
        );
        to.number(
            db_per_crossing,
            Number {
                name: "db_per_crossing",
                default: self.default.db_per_crossing,
                allowed: 0.0..=MOST_DB,
                means: "attenuation of each crossing of an open sheet",
            },
        );
        let left_out = "one not taken yet";
        let means = "`\"#rrggbb\"`, in the pictures of `tomoswarm scene`";
        to.form(
            &mut Colour(colour),
            KeyEntry {
                name: "colour",
                left_out,
                means,
            },
        );
    }
}

impl Keyed for MaterialSpec {
    fn keys(&mut self, to: &mut dyn Keys) {
        MaterialTable {
            material: self,
            default: MaterialSpec::NONE,
        }
        .keys(to);
    }
}

/// Red, green and blue.
struct Colour<'a>(&'a mut Option<[u8; 3]>);

impl Form for Colour<'_> {
    fn to_toml(&self) -> Option<String> {
        self.0
            .map(|[red, green, blue]| quoted(&format!("#{red:02x}{green:02x}{blue:02x}")))
    }

    fn read(&mut self, section: &Section<'_>, _: &'static str) {
        *self.0 = read_colour(section);
    }
}

/// Reads a colour as `#rrggbb`.
fn read_colour(section: &Section) -> Option<[u8; 3]> {
    let text = section.text("colour")?;
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6);
    let is_plain = |digits: &&str| digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let Some(number) = digits
        .filter(is_plain)
        .and_then(|digits| u32::from_str_radix(digits, 16).ok())
    else {
        section.refuse(
            "colour",
            "is no colour",
            "red, green and blue such as \"#8a5a2b\" are needed",
        );
        return None;
    };
    let [_, red, green, blue] = number.to_be_bytes();
    Some([red, green, blue])
}

/// Shows the keys that all persons have, with the same defaults.
fn person_keys(radius_m: &mut f64, height_m: &mut f64, db_per_m: &mut f64, to: &mut dyn Keys) {
    to.number(radius_m, Number::new("radius_m", 0.3, 0.05..=2.0, "radius"));
    to.number(height_m, Number::new("height_m", 1.8, 0.2..=3.0, "height"));
    to.number(
        db_per_m,
        Number::new("db_per_m", 10.0, 0.0..=MOST_DB, "attenuation inside"),
    );
}

impl Person {
    fn keys(&mut self, index: usize, to: &mut dyn Keys) {
        let Person {
            name,
            at,
            radius_m,
            height_m,
            db_per_m,
            path,
            speed_mps,
        } = self;
        let mut plain = Name {
            name,
            default: format!("person-{}", index + 1),
        };
        let left_out = "person-N";
        to.form(
            &mut plain,
            KeyEntry {
                name: "name",
                left_out,
                means: "a plain name",
            },
        );
        let means = "where the axis stands, `[x, y]`";
        to.form(
            &mut RequiredPlace(at),
            KeyEntry {
                name: "at_m",
                left_out: "needed",
                means,
            },
        );
        person_keys(radius_m, height_m, db_per_m, to);
        let means = "walks from `at_m` to these places, and the same way back, again and again";
        to.form(
            &mut WalkedPath(path),
            KeyEntry {
                name: "path_m",
                left_out: "stands still",
                means,
            },
        );
        let allowed = 0.05..=3.0;
        to.number(
            speed_mps,
            Number::new("speed_mps", 1.0, allowed, "speed of a walk"),
        );
    }
}

/// The places of a walk.
struct WalkedPath<'a>(&'a mut Vec<Point>);

impl Form for WalkedPath<'_> {
    fn to_toml(&self) -> Option<String> {
        (!self.0.is_empty()).then(|| places(self.0))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        if section.has(key) {
            *self.0 = section.required_points(key, 1..=WALK_PLACES);
        }
    }
}

impl Keyed for RandomPersons {
    fn keys(&mut self, to: &mut dyn Keys) {
        let RandomPersons {
            count,
            keep_from_border_m,
            keep_from_objects_m,
            apart_m,
            radius_m,
            height_m,
            db_per_m,
        } = self;
        to.whole(
            count,
            Whole {
                name: "count",
                default: 2,
                allowed: 0..=100,
                means: "how many",
            },
        );
        let means = "smallest distance of an axis from the area's border";
        to.number(
            keep_from_border_m,
            Number::new("keep_from_border_m", 2.0, 0.0..=500.0, means),
        );
        let means = "smallest distance of an axis from any shape";
        to.number(
            keep_from_objects_m,
            Number::new("keep_from_objects_m", 1.5, 0.0..=100.0, means),
        );
        let means = "smallest distance between two axes, those of fixed persons included";
        to.number(apart_m, Number::new("apart_m", 3.0, 0.0..=500.0, means));
        person_keys(radius_m, height_m, db_per_m, to);
    }
}
