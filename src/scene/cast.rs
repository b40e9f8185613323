//! Ray casts: what a beam meets first; and the triangles that may lie in a region.
//!
//! A beam here has no width. Surfaces are seen from both sides.

use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::BvhNode;
use parry3d_f64::query::{Ray, RayCast};
use parry3d_f64::shape::TriMesh;

use super::affine::{Xyz, cross, dot, sub};
use super::build::{Object, Scene, SceneError};

/// Where a ray meets a surface.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hit {
    /// From the ray's origin, metres.
    pub distance_m: f64,
    /// The surface's unit normal, on the side that the ray comes from.
    pub normal: [f64; 3],
    /// The object, by its place in [`Scene::objects`].
    pub object: usize,
}

/// A triangle of a scene's surface.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct NearTriangle {
    /// Its corners, metres.
    pub corners: [[f64; 3]; 3],
    /// The object, by its place in [`Scene::objects`].
    pub object: usize,
}

/// All triangles of a scene, sorted for ray casts.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    mesh: Option<TriMesh>,
    faces: Vec<Face>,
}

/// What is known of a triangle.
#[derive(Clone, Copy, Debug)]
struct Face {
    normal: Xyz,
    object: u32,
}

impl Surface {
    /// Sorts the surfaces of all objects.
    pub(super) fn over(objects: &[Object]) -> Result<Surface, SceneError> {
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        let mut faces = Vec::new();
        for (object, surface) in objects
            .iter()
            .map(|object| object.shape.surface())
            .enumerate()
        {
            let first = vertices.len() as u32;
            vertices.extend(
                surface
                    .vertices()
                    .iter()
                    .map(|[x, y, z]| Vector::new(*x, *y, *z)),
            );
            for (corners, triangle) in surface.corners().zip(surface.triangles()) {
                let Some(normal) = unit_normal(corners) else {
                    continue;
                };
                triangles.push(triangle.map(|index| index + first));
                faces.push(Face {
                    normal,
                    object: object as u32,
                });
            }
        }
        if triangles.is_empty() {
            return Ok(Surface { mesh: None, faces });
        }
        let mesh = TriMesh::new(vertices, triangles)
            .map_err(|error| SceneError::Surface(error.to_string()))?;
        Ok(Surface {
            mesh: Some(mesh),
            faces,
        })
    }
}

impl Scene {
    /// Returns the nearest surface that a ray meets, from either side, within `max_m`.
    ///
    /// `direction` is a unit vector, local frame; z is up. `None` when nothing is met.
    pub fn cast(&self, origin: [f64; 3], direction: [f64; 3], max_m: f64) -> Option<Hit> {
        let mesh = self.surface.mesh.as_ref()?;
        let ray = Ray::new(Vector::from_array(origin), Vector::from_array(direction));
        let slabs = Slabs::new(&ray);
        let leaf = |triangle, best_m| mesh.triangle(triangle).cast_local_ray(&ray, best_m, false);
        let (triangle, distance_m) =
            mesh.bvh()
                .find_best(max_m, |node: &BvhNode, _| slabs.entry_m(node), leaf)?;
        let face = self.surface.faces.get(triangle as usize)?;
        let along = dot(face.normal, direction);
        let normal = if along > 0.0 {
            face.normal.map(|part| -part)
        } else {
            face.normal
        };
        Some(Hit {
            distance_m,
            normal,
            object: face.object as usize,
        })
    }
}

impl Scene {
    /// Returns the triangles that may lie in a region: a convex one, by half-spaces that hold it (their outward normals, and
    /// how far along these from the origin of the frame they end, metres).
    pub fn triangles_within<'a>(
        &'a self,
        half_spaces: &'a [([f64; 3], f64)],
    ) -> impl Iterator<Item = NearTriangle> + 'a {
        let may_lie_in = |node: &BvhNode| {
            let (low, high) = (node.mins().to_array(), node.maxs().to_array());
            half_spaces.iter().all(|(outward, end_m)| {
                let nearest = [0, 1, 2].map(|axis| {
                    if outward[axis] > 0.0 {
                        low[axis]
                    } else {
                        high[axis]
                    }
                });
                dot(*outward, nearest) <= *end_m
            })
        };
        let mesh = self.surface.mesh.iter();
        mesh.flat_map(move |mesh| {
            let leaves = mesh.bvh().leaves(may_lie_in);
            leaves.filter_map(move |leaf| {
                let face = self.surface.faces.get(leaf as usize)?;
                let triangle = mesh.triangle(leaf);
                Some(NearTriangle {
                    corners: [triangle.a, triangle.b, triangle.c].map(|corner| corner.to_array()),
                    object: face.object as usize,
                })
            })
        })
    }
}

/// A ray made ready for many boxes: parry's own box test divides anew for every box, which costs a third of
/// the whole cast.
struct Slabs {
    origin: Vector,
    inverse: Vector,
}

impl Slabs {
    fn new(ray: &Ray) -> Slabs {
        // Large instead of infinite, so that 0 × inverse stays 0.
        let invert = |part: f64| {
            if part.abs() < 1e-300 {
                1e300
            } else {
                1.0 / part
            }
        };
        let Vector { x, y, z } = ray.dir;
        Slabs {
            origin: ray.origin,
            inverse: Vector::new(invert(x), invert(y), invert(z)),
        }
    }

    /// Returns where the ray enters a node's box, metres; the largest number when it misses. A hair of slack
    /// keeps flat boxes from being missed by rounding.
    fn entry_m(&self, node: &BvhNode) -> f64 {
        let one = (node.mins() - self.origin) * self.inverse;
        let other = (node.maxs() - self.origin) * self.inverse;
        let enters_m = one.min(other).max_element().max(0.0);
        let leaves_m = one.max(other).min_element();
        if enters_m <= leaves_m * (1.0 + 1e-12) {
            enters_m
        } else {
            f64::MAX
        }
    }
}

/// Returns a triangle's unit normal; `None` when it has no area.
fn unit_normal([a, b, c]: [Xyz; 3]) -> Option<Xyz> {
    let normal = cross(sub(b, a), sub(c, a));
    let length = dot(normal, normal).sqrt();
    (length > 0.0).then(|| normal.map(|part| part / length))
}
