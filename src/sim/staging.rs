//! A scene put together from its configuration, its shapes and who stands in it.
//!
//! The same for a simulation, for the referee and for pictures. Places no random persons and opens no files.

use crate::config::{self, SceneFile};
use crate::scene::{Footprint, Material, Person, Post, Scene, SceneError, SceneParts, VrmlShape};

/// Builds what a scene file describes, with its shapes and the persons given.
///
/// # Errors
/// A material for a name that no shape has, an impossible figure, a place out of the world, or a scene that lies
/// under the ground as a whole.
pub fn build(
    file: &SceneFile,
    shapes: &[VrmlShape],
    persons: &[Person],
) -> Result<Scene, SceneError> {
    let materials = file
        .materials
        .iter()
        .map(|(name, found)| (name.clone(), material(found)))
        .collect();
    let posts: Vec<Post> = file.objects.iter().map(post).collect();
    let scene = Scene::build(&SceneParts {
        shapes,
        offset_m: file.offset_m,
        materials: &materials,
        default_material: material(&file.default_material),
        posts: &posts,
        persons,
    })?;
    match scene.extent() {
        Some((_, high)) if high[2] < 0.0 => Err(SceneError::Buried { high_m: high[2] }),
        Some(_) | None => Ok(scene),
    }
}

/// Returns a person of a scene file.
pub fn person(person: &config::Person) -> Person {
    let config::Person {
        name,
        at,
        radius_m,
        height_m,
        db_per_m,
        path,
        speed_mps: _,
    } = person.clone();
    Person {
        name,
        at,
        path,
        radius_m,
        height_m,
        db_per_m,
    }
}

fn material(material: &config::MaterialSpec) -> Material {
    Material {
        db_per_m: material.db_per_m,
        db_per_crossing: material.db_per_crossing,
    }
}

fn post(object: &config::Object) -> Post {
    let footprint = match &object.outline {
        config::Outline::Polygon(polygon) => Footprint::Corners(polygon.clone()),
        config::Outline::Circle { centre, radius_m } => Footprint::Round {
            centre: *centre,
            radius_m: *radius_m,
        },
    };
    Post {
        name: object.name.clone(),
        footprint,
        low_m: object.bottom_m,
        high_m: object.top_m,
        material: material(&object.material),
    }
}
