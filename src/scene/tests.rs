//! Tests of the scene as a whole; those of one file stand in that file.

mod attenuation;
mod build;
mod castle;
mod contact;
mod cut;
mod vrml;
mod vrml_surfaces;

use std::collections::BTreeMap;

use super::{Material, Person, Scene, SceneParts, Up, VrmlError, VrmlScene, read_vrml};
use crate::geom::Point;

/// Reads the body of a VRML file with z up and without Inlines.
fn read(body: &str) -> Result<VrmlScene, VrmlError> {
    read_vrml(
        &format!("#VRML V2.0 utf8\n{body}"),
        "test.wrl",
        Up::Z,
        &mut |_| Err("not there".into()),
    )
}

/// Builds a scene of one material from the body of a VRML file, z up.
fn scene_of(body: &str, db_per_m: f64, persons: &[Person]) -> Scene {
    let read = read(body).unwrap();
    let parts = SceneParts {
        shapes: &read.shapes,
        offset_m: [0.0; 3],
        materials: &BTreeMap::new(),
        default_material: Material {
            db_per_m,
            db_per_crossing: 6.0,
        },
        posts: &[],
        persons,
    };
    Scene::build(&parts).unwrap()
}

fn person(x_m: f64, y_m: f64) -> Person {
    Person {
        name: "someone".into(),
        at: Point::new(x_m, y_m),
        path: Vec::new(),
        radius_m: 0.3,
        height_m: 1.8,
        db_per_m: 10.0,
    }
}

/// The bundled courtyard.
fn courtyard() -> &'static str {
    include_str!("../../scenes/courtyard.wrl")
}

/// Numbers from a fixed sequence, uniform in [0, 1): splitmix64.
struct Sequence(u64);

impl Sequence {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }
}
