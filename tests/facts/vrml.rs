//! Facts about the shared scene; they run only where it lies beside the project. Points are VRML's (east, north, up).

use std::collections::BTreeMap;

use serde_json::{Value, json};
use tomoswarm::geom::Bearing;
use tomoswarm::scene::{Material, Post, Scene, SceneParts, Up, VrmlScene, VrmlShape, read_vrml};

use super::fact::{Checked, Fact};
use super::shared::shared_text;

/// Beyond this nothing is met, metres.
const FARTHEST_M: f64 = 1000.0;

/// Reads the fact's scene; `None` when it is not there.
fn scene(fact: &Fact) -> Result<Option<VrmlScene>, String> {
    let file = fact.text("file")?;
    let Some(text) = shared_text(&format!("data/vrml/{file}")) else {
        return Ok(None);
    };
    let read = read_vrml(
        &text,
        file,
        Up::Z,
        &mut |_| Err("nothing is inlined".into()),
    );
    read.map(Some).map_err(|error| error.to_string())
}

/// Checks a fact about what a scene consists of; false when the scene is not there.
pub fn check_counts(fact: &Fact) -> Result<bool, String> {
    let Some(scene) = scene(fact)? else {
        return Ok(false);
    };
    let faces: Vec<usize> = scene.shapes.iter().map(|shape| shape.faces).collect();
    if !fact.expects("objects") {
        return fact.expect("faces", json!(faces)).map(|()| true);
    }
    fact.expect("objects", json!(faces.len()))?;
    fact.expect("faces", json!(faces.iter().sum::<usize>()))?;
    let triangles: usize = scene.shapes.iter().map(|shape| shape.triangles).sum();
    fact.expect("triangles", json!(triangles)).map(|()| true)
}

/// Checks a fact about a ray; false when the scene is not there.
pub fn check_ray(fact: &Fact) -> Result<bool, String> {
    let Some(read) = scene(fact)? else {
        return Ok(false);
    };
    check_cast(fact, &read).map(|()| true)
}

/// Builds a scene of shapes and posts; what they are made of does not matter to rays.
pub fn scene_of(shapes: &[VrmlShape], posts: &[Post]) -> Result<Scene, String> {
    let parts = SceneParts {
        shapes,
        offset_m: [0.0; 3],
        materials: &BTreeMap::new(),
        default_material: Material::default(),
        posts,
        persons: &[],
    };
    Scene::build(&parts).map_err(|error| error.to_string())
}

fn check_cast(fact: &Fact, read: &VrmlScene) -> Checked {
    let scene = scene_of(&read.shapes, &[])?;
    let toward = Bearing::from_degrees(fact.number("bearing_deg")?)
        .angle()
        .radians();
    let hit = scene.cast(
        fact.numbers("xyz")?,
        [toward.cos(), toward.sin(), 0.0],
        FARTHEST_M,
    );
    fact.expect(
        "distance",
        hit.map_or(Value::Null, |hit| json!(hit.distance_m)),
    )
}
