//! A scene put together from shapes, materials and persons.
//!
//! Reads no configuration: names and figures come in as values.

use std::collections::{BTreeMap, BTreeSet};

use super::affine::{Xyz, add};
use super::cast::Surface;
use super::ears::ears;
use super::mesh::Mesh;
use super::primitive::{self, Parts};
use super::vrml::{VrmlShape, within_world};
use crate::geom::{Point, Polygon, Rect};

/// Corners of a person's outline.
const PERSON_SIDES: usize = 16;
/// Corners of an upright body's outline.
pub(super) const MAX_CORNERS: usize = 1000;
/// Where persons stand, metres.
const GROUND_M: f64 = 0.0;

/// What something is made of, for radio.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Material {
    /// Attenuation inside closed shapes, dB per metre.
    pub db_per_m: f64,
    /// Attenuation at each crossing of an open sheet, dB.
    pub db_per_crossing: f64,
}

/// The form of something, local frame, metres.
#[derive(Clone, PartialEq, Debug)]
pub enum Shape {
    /// An upright solid between two heights.
    Prism {
        /// Its outline: convex, counter-clockwise.
        footprint: Polygon,
        /// Its lower end.
        low_m: f64,
        /// Its upper end.
        high_m: f64,
    },
    /// Any surface, closed or open.
    Mesh(Mesh),
}

/// A person who stands on the ground (z = 0): an upright round post.
#[derive(Clone, PartialEq, Debug)]
pub struct Person {
    /// What the person is called in pictures and tables.
    pub name: String,
    /// Where the person stands, or begins to walk.
    pub at: Point,
    /// Where it walks from there, and the same way back, again and again; empty = it stands.
    pub path: Vec<Point>,
    /// Radius, metres.
    pub radius_m: f64,
    /// Height, metres.
    pub height_m: f64,
    /// Attenuation inside, dB per metre.
    pub db_per_m: f64,
}

/// One thing of a scene; a VRML shape whose surface falls apart gives several.
#[derive(Clone, PartialEq, Debug)]
pub struct Object {
    /// The DEF name by which its material was found, or else its outermost one, or "shape N".
    pub name: String,
    /// Its form.
    pub shape: Shape,
    /// What it is made of.
    pub material: Material,
    /// Whether it has an inside; prisms do, and meshes without a rim.
    pub closed: bool,
    /// The circle that its outline stands for, if that is round: range sensors hear the circle.
    pub round: Option<Circle>,
}

/// A circle of the plane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Circle {
    /// Its middle.
    pub centre: Point,
    /// Its radius, metres.
    pub radius_m: f64,
}

/// What a scene is built from.
#[derive(Clone, Copy, Debug)]
pub struct SceneParts<'a> {
    /// The shapes of a VRML file.
    pub shapes: &'a [VrmlShape],
    /// By how much the shapes are moved, metres; persons are not.
    pub offset_m: [f64; 3],
    /// Materials by DEF name; of several names around a shape the innermost counts.
    pub materials: &'a BTreeMap<String, Material>,
    /// The material of shapes without one.
    pub default_material: Material,
    /// Upright bodies that are not in the VRML file.
    pub posts: &'a [Post],
    /// Who stands in the scene.
    pub persons: &'a [Person],
}

/// The outline of an upright body.
#[derive(Clone, PartialEq, Debug)]
pub enum Footprint {
    /// Corners of a simple polygon, in either direction around it; at most 1000.
    Corners(Polygon),
    /// A circle.
    Round {
        /// Its middle.
        centre: Point,
        /// Its radius, metres.
        radius_m: f64,
    },
}

/// An upright body between two heights.
#[derive(Clone, PartialEq, Debug)]
pub struct Post {
    /// What it is called.
    pub name: String,
    /// Its outline.
    pub footprint: Footprint,
    /// Its lower end, metres.
    pub low_m: f64,
    /// Its upper end, metres.
    pub high_m: f64,
    /// What it is made of.
    pub material: Material,
}

/// Why no scene could be built.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum SceneError {
    /// A material is given to a name that the scene does not have.
    #[error(
        "a material is given to `{name}`, but the scene has no shape inside such a DEF; it has: {known}"
    )]
    UnknownName {
        /// The name.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// A figure is impossible.
    #[error("{what} of `{name}` is {value}; expected {expected}")]
    Impossible {
        /// Which thing.
        name: String,
        /// Which figure.
        what: &'static str,
        /// The figure.
        value: f64,
        /// What is possible.
        expected: &'static str,
    },
    /// Something lies too far out.
    #[error("`{name}` reaches over 1000 km from the origin after the offset; expected metres")]
    TooFar {
        /// Which thing.
        name: String,
    },
    /// Everything lies under the ground.
    #[error(
        "the highest point of the whole scene is at {high_m:.2} m, under the ground on which vehicles drive (z = 0); \
         expected some of it at z = 0 or above: see `up` and `offset_m`"
    )]
    Buried {
        /// Its highest point, metres.
        high_m: f64,
    },
    /// The surfaces could not be sorted for ray casts.
    #[error("the surfaces cannot be sorted for ray casts: {0}")]
    Surface(String),
}

/// Everything that stands in the simulated world.
#[derive(Clone, Debug)]
pub struct Scene {
    objects: Vec<Object>,
    bounds: Vec<BoundingBox>,
    pub(super) surface: Surface,
}

/// The upright box around an object.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct BoundingBox {
    pub(super) plan: Rect,
    pub(super) low_m: f64,
    pub(super) high_m: f64,
}

impl Scene {
    /// Builds a scene. No shapes and no persons make an empty one, which is allowed.
    ///
    /// # Errors
    /// A material for a name that the shapes do not have, an impossible figure, or a place out of the world.
    pub fn build(parts: &SceneParts<'_>) -> Result<Scene, SceneError> {
        check_names(parts)?;
        for (name, material) in parts.materials {
            check_material(name, *material)?;
        }
        check_material("default", parts.default_material)?;
        let mut objects = Vec::new();
        for (index, shape) in parts.shapes.iter().enumerate() {
            place(shape, index, parts, &mut objects)?;
        }
        for post in parts.posts {
            objects.push(raise(post)?);
        }
        for person in parts.persons {
            objects.push(stand(person)?);
        }
        let surface = Surface::over(&objects)?;
        let bounds = objects.iter().map(|object| object.shape.bounds()).collect();
        Ok(Scene {
            objects,
            bounds,
            surface,
        })
    }

    /// Returns all objects: the shapes in file order, then the persons.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// Returns the lowest and the highest coordinates of all that stands there, metres; `None` when nothing does.
    pub fn extent(&self) -> Option<([f64; 3], [f64; 3])> {
        let mut boxes = self.bounds.iter().map(
            |BoundingBox {
                 plan,
                 low_m,
                 high_m,
             }| {
                (
                    [plan.min.x_m, plan.min.y_m, *low_m],
                    [plan.max.x_m, plan.max.y_m, *high_m],
                )
            },
        );
        let first = boxes.next()?;
        Some(boxes.fold(first, |(low, high), (lower, higher)| {
            (
                [0, 1, 2].map(|axis| low[axis].min(lower[axis])),
                [0, 1, 2].map(|axis| high[axis].max(higher[axis])),
            )
        }))
    }

    /// Returns all objects with the boxes around them.
    pub(super) fn bounded(&self) -> impl Iterator<Item = (&Object, &BoundingBox)> {
        self.objects.iter().zip(&self.bounds)
    }
}

impl Shape {
    /// Returns the height of its lowest point, metres; infinite for a surface without points.
    pub fn lowest_m(&self) -> f64 {
        match self {
            Shape::Prism { low_m, .. } => *low_m,
            Shape::Mesh(mesh) => mesh
                .vertices()
                .iter()
                .fold(f64::INFINITY, |low_m, vertex| low_m.min(vertex[2])),
        }
    }

    /// Returns the surface as triangles.
    pub fn surface(&self) -> Mesh {
        match self {
            Shape::Mesh(mesh) => mesh.clone(),
            Shape::Prism {
                footprint,
                low_m,
                high_m,
            } => {
                let ring: Vec<Xyz> = footprint
                    .corners()
                    .iter()
                    .map(|corner| [corner.x_m, corner.y_m, *low_m])
                    .collect();
                primitive::extruded(&ring, [0.0, 0.0, high_m - low_m], Parts::ALL).0
            }
        }
    }

    fn bounds(&self) -> BoundingBox {
        let surface = self.surface();
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for vertex in surface.vertices() {
            for axis in 0..3 {
                low[axis] = low[axis].min(vertex[axis]);
                high[axis] = high[axis].max(vertex[axis]);
            }
        }
        let plan = Rect {
            min: Point::new(low[0], low[1]),
            max: Point::new(high[0], high[1]),
        };
        BoundingBox {
            plan,
            low_m: low[2],
            high_m: high[2],
        }
    }

    fn moved(&self, [x, y, z]: Xyz) -> Shape {
        match self {
            Shape::Mesh(mesh) => Shape::Mesh(mesh.map(|vertex| add(vertex, [x, y, z]))),
            Shape::Prism {
                footprint,
                low_m,
                high_m,
            } => {
                let move_corner = |corner: &Point| Point::new(corner.x_m + x, corner.y_m + y);
                let footprint = Polygon::new(footprint.corners().iter().map(move_corner).collect());
                Shape::Prism {
                    footprint,
                    low_m: low_m + z,
                    high_m: high_m + z,
                }
            }
        }
    }
}

/// Adds the objects that a VRML shape gives.
fn place(
    shape: &VrmlShape,
    index: usize,
    parts: &SceneParts<'_>,
    objects: &mut Vec<Object>,
) -> Result<(), SceneError> {
    let found = shape
        .names
        .iter()
        .rev()
        .find_map(|name| parts.materials.get_key_value(&**name));
    let name = match (found, shape.names.first()) {
        (Some((name, _)), _) => name.clone(),
        (None, Some(name)) => name.to_string(),
        (None, None) => format!("shape {}", index + 1),
    };
    let material = found.map_or(parts.default_material, |(_, material)| *material);
    let moved = shape.shape.moved(parts.offset_m);
    if !moved
        .surface()
        .vertices()
        .iter()
        .all(|vertex| within_world(*vertex))
    {
        return Err(SceneError::TooFar { name });
    }
    match moved {
        Shape::Prism { .. } => objects.push(Object {
            name,
            shape: moved,
            material,
            closed: true,
            round: None,
        }),
        Shape::Mesh(mesh) => {
            objects.extend(mesh.pieces().into_iter().map(|(piece, closed)| Object {
                name: name.clone(),
                shape: Shape::Mesh(piece),
                material,
                closed,
                round: None,
            }))
        }
    }
    Ok(())
}

fn stand(person: &Person) -> Result<Object, SceneError> {
    raise(&Post {
        name: person.name.clone(),
        footprint: Footprint::Round {
            centre: person.at,
            radius_m: person.radius_m,
        },
        low_m: GROUND_M,
        high_m: GROUND_M + person.height_m,
        material: Material {
            db_per_m: person.db_per_m,
            db_per_crossing: 0.0,
        },
    })
}

fn raise(post: &Post) -> Result<Object, SceneError> {
    let impossible = |what, value, expected| {
        Err(SceneError::Impossible {
            name: post.name.clone(),
            what,
            value,
            expected,
        })
    };
    let height_m = post.high_m - post.low_m;
    if !(height_m > 0.0 && height_m <= 100.0) {
        return impossible("height_m", height_m, "metres above 0, at most 100");
    }
    check_material(&post.name, post.material)?;
    let footprint = match &post.footprint {
        Footprint::Corners(polygon) if !(3..=MAX_CORNERS).contains(&polygon.corners().len()) => {
            let count = polygon.corners().len() as f64;
            return impossible(
                "number of corners",
                count,
                "3 to 1000 corners around a simple outline",
            );
        }
        Footprint::Corners(polygon) if polygon.area_m2() < 0.0 => {
            Polygon::new(polygon.corners().iter().rev().copied().collect())
        }
        Footprint::Corners(polygon) => polygon.clone(),
        Footprint::Round { radius_m, .. } if !(*radius_m > 0.0 && *radius_m <= 100.0) => {
            return impossible("radius_m", *radius_m, "metres above 0, at most 100");
        }
        Footprint::Round { centre, radius_m } => {
            let outline = primitive::round_outline(*radius_m, PERSON_SIDES);
            Polygon::new(
                outline
                    .map(|(x, y)| Point::new(centre.x_m + x, centre.y_m + y))
                    .collect(),
            )
        }
    };
    if !footprint
        .corners()
        .iter()
        .all(|corner| within_world([corner.x_m, corner.y_m, post.low_m]))
    {
        return Err(SceneError::TooFar {
            name: post.name.clone(),
        });
    }
    let shape = if footprint.is_convex() {
        Shape::Prism {
            footprint,
            low_m: post.low_m,
            high_m: post.high_m,
        }
    } else {
        Shape::Mesh(upright(&footprint, post.low_m, post.high_m))
    };
    let round = match post.footprint {
        Footprint::Round { centre, radius_m } => Some(Circle { centre, radius_m }),
        Footprint::Corners(_) => None,
    };
    Ok(Object {
        name: post.name.clone(),
        shape,
        material: post.material,
        closed: true,
        round,
    })
}

/// Returns the surface of an upright body with a simple counter-clockwise outline.
fn upright(footprint: &Polygon, low_m: f64, high_m: f64) -> Mesh {
    let corners = footprint.corners();
    let at = |height_m: f64| {
        corners
            .iter()
            .map(move |corner| [corner.x_m, corner.y_m, height_m])
    };
    let (count, outline): (u32, Vec<[f64; 2]>) = (
        corners.len() as u32,
        corners
            .iter()
            .map(|corner| [corner.x_m, corner.y_m])
            .collect(),
    );
    let mut triangles = Vec::new();
    for here in 0..count {
        let next = (here + 1) % count;
        triangles.extend([
            [here, next, next + count],
            [here, next + count, here + count],
        ]);
    }
    for [a, b, c] in ears(&outline) {
        triangles.extend([[a, c, b], [a + count, b + count, c + count]]);
    }
    Mesh::new(at(low_m).chain(at(high_m)).collect(), triangles)
}

fn check_material(name: &str, material: Material) -> Result<(), SceneError> {
    let figures = [
        ("db_per_m", material.db_per_m),
        ("db_per_crossing", material.db_per_crossing),
    ];
    match figures
        .iter()
        .find(|(_, value)| !(0.0..=1e4).contains(value))
    {
        Some((what, value)) => Err(SceneError::Impossible {
            name: name.to_string(),
            what,
            value: *value,
            expected: "dB from 0 to 10000",
        }),
        None => Ok(()),
    }
}

fn check_names(parts: &SceneParts<'_>) -> Result<(), SceneError> {
    let known: BTreeSet<&str> = parts
        .shapes
        .iter()
        .flat_map(|shape| shape.names.iter().map(|name| &**name))
        .collect();
    let Some(name) = parts
        .materials
        .keys()
        .find(|name| !known.contains(name.as_str()))
    else {
        return Ok(());
    };
    let mut list: Vec<&str> = known.iter().copied().take(20).collect();
    if list.len() < known.len() {
        list.push("…");
    }
    let known = if list.is_empty() {
        "no DEF names".to_string()
    } else {
        list.join(", ")
    };
    Err(SceneError::UnknownName {
        name: name.clone(),
        known,
    })
}
