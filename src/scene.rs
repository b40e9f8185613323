//! The simulated world as data: VRML, shapes, ray casts, contact, attenuation of radio links.
//!
//! A scene stands still and is the same for everybody: vehicles, noise and fading belong to `sim`. Files are
//! opened elsewhere; their text comes in.

mod affine;
mod attenuation;
mod build;
mod cast;
mod contact;
mod cut;
mod ears;
mod mesh;
mod outline;
mod primitive;
mod view;
mod vrml;
mod vrml_extrusion;
mod vrml_fields;
mod vrml_geometry;
mod vrml_grid;
mod vrml_parse;
mod vrml_token;
mod vrml_tree;

#[cfg(test)]
mod tests;

pub use attenuation::Attenuation;
pub use build::{
    Circle, Footprint, Material, Object, Person, Post, Scene, SceneError, SceneParts, Shape,
};
pub use cast::{Hit, NearTriangle};
pub use cut::{CutForm, CutPiece, Cuts, LevelCut};
pub use mesh::Mesh;
pub use outline::Outline;
pub use view::{Camera, RayHit, Viewpoint};
pub use vrml::{
    InlineLoader, MAX_BYTES, MAX_LEVELS, Up, VrmlError, VrmlScene, VrmlShape, read_vrml,
};
