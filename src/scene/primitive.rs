//! The solids that VRML gives by their measures, as triangles and, where they have parallel ends, as extrusions.
//!
//! In VRML's own frame: centred at the origin, the axis of round ones along y.

use std::f64::consts::TAU;

use super::affine::Xyz;
use super::mesh::Mesh;

/// Corners of a round outline.
pub(super) const ROUND_SIDES: usize = 32;

/// A flat convex ring moved along a vector.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Extrusion {
    /// The ring's corners, in order.
    pub(super) ring: Vec<Xyz>,
    /// From one end to the other.
    pub(super) along: Xyz,
}

/// A solid before it is placed in the world.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct Solid {
    /// Its surface.
    pub(super) mesh: Mesh,
    /// Polygons before triangulation.
    pub(super) faces: usize,
    /// Every way to see it as an extrusion; empty when it is none.
    pub(super) extrusions: Vec<Extrusion>,
}

/// Returns the corners of a regular outline with the area of a circle, as (x, y) around the origin.
pub(super) fn round_outline(radius_m: f64, sides: usize) -> impl Iterator<Item = (f64, f64)> {
    let step = TAU / sides as f64;
    let reach_m = radius_m * (step / libm::sin(step)).sqrt();
    (0..sides).map(move |corner| {
        let (sin, cos) = libm::sincos((corner as f64 + 0.5) * step);
        (reach_m * cos, reach_m * sin)
    })
}

/// Makes the surface of an upright or slanted prism with a convex ring; the ring must run
/// counter-clockwise seen against `along` for outward normals.
pub(super) fn extruded(ring: &[Xyz], along: Xyz, parts: Parts) -> (Mesh, usize) {
    let count = ring.len() as u32;
    let mut vertices = ring.to_vec();
    vertices.extend(ring.iter().map(|corner| super::affine::add(*corner, along)));
    let mut triangles = Vec::new();
    if parts.side {
        for here in 0..count {
            let next = (here + 1) % count;
            triangles.push([here, next, next + count]);
            triangles.push([here, next + count, here + count]);
        }
    }
    for corner in 1..count - 1 {
        if parts.bottom {
            triangles.push([0, corner + 1, corner]);
        }
        if parts.top {
            triangles.push([count, count + corner, count + corner + 1]);
        }
    }
    let sides = if parts.side { ring.len() } else { 0 };
    (
        Mesh::new(vertices, triangles),
        sides + usize::from(parts.bottom) + usize::from(parts.top),
    )
}

/// Which parts of a round solid's surface there are.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Parts {
    pub(super) bottom: bool,
    pub(super) side: bool,
    pub(super) top: bool,
}

impl Parts {
    /// The whole surface.
    pub(super) const ALL: Parts = Parts {
        bottom: true,
        side: true,
        top: true,
    };
}

/// Makes a Box from its size along x, y, z.
pub(super) fn block(size: Xyz) -> Solid {
    let half = size.map(|length| length / 2.0);
    let extrusions: Vec<Extrusion> = (0..3).map(|axis| block_along(half, axis)).collect();
    let (mesh, faces) = extruded(&extrusions[2].ring, extrusions[2].along, Parts::ALL);
    Solid {
        mesh,
        faces,
        extrusions,
    }
}

fn block_along(half: Xyz, axis: usize) -> Extrusion {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let corner = |sign_u: f64, sign_v: f64| {
        let mut at = [0.0; 3];
        (at[u], at[v], at[axis]) = (sign_u * half[u], sign_v * half[v], -half[axis]);
        at
    };
    let mut along = [0.0; 3];
    along[axis] = 2.0 * half[axis];
    Extrusion {
        ring: vec![
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ],
        along,
    }
}

/// Makes a Cylinder along y.
pub(super) fn cylinder(radius_m: f64, height_m: f64, parts: Parts) -> Solid {
    let ring = ring_about_y(radius_m, -height_m / 2.0);
    let along = [0.0, height_m, 0.0];
    let (mesh, faces) = extruded(&ring, along, parts);
    let extrusions = if parts == Parts::ALL {
        vec![Extrusion { ring, along }]
    } else {
        Vec::new()
    };
    Solid {
        mesh,
        faces,
        extrusions,
    }
}

/// Makes a Cone along y with its tip up; `parts.top` means nothing.
pub(super) fn cone(radius_m: f64, height_m: f64, parts: Parts) -> Solid {
    let mut vertices = ring_about_y(radius_m, -height_m / 2.0);
    let count = vertices.len() as u32;
    vertices.push([0.0, height_m / 2.0, 0.0]);
    let mut triangles = Vec::new();
    if parts.side {
        triangles.extend((0..count).map(|here| [here, (here + 1) % count, count]));
    }
    if parts.bottom {
        triangles.extend((1..count - 1).map(|corner| [0, corner + 1, corner]));
    }
    let faces = if parts.side { ROUND_SIDES } else { 0 } + usize::from(parts.bottom);
    Solid {
        mesh: Mesh::new(vertices, triangles),
        faces,
        extrusions: Vec::new(),
    }
}

/// Makes a Sphere of rings about y.
pub(super) fn sphere(radius_m: f64) -> Solid {
    let rings = ROUND_SIDES / 2 - 1;
    let count = ROUND_SIDES as u32;
    let mut vertices = vec![[0.0, -radius_m, 0.0], [0.0, radius_m, 0.0]];
    for ring in 1..=rings {
        let (sin, cos) = libm::sincos(ring as f64 / (rings + 1) as f64 * TAU / 2.0);
        vertices.extend(ring_about_y(radius_m * sin, -radius_m * cos));
    }
    let index = |ring: usize, corner: u32| 2 + ring as u32 * count + corner % count;
    let mut triangles = Vec::new();
    for corner in 0..count {
        triangles.push([0, index(0, corner + 1), index(0, corner)]);
        triangles.push([1, index(rings - 1, corner), index(rings - 1, corner + 1)]);
        for ring in 1..rings {
            let (a, b) = (index(ring - 1, corner), index(ring - 1, corner + 1));
            let (c, d) = (index(ring, corner + 1), index(ring, corner));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Solid {
        mesh: Mesh::new(vertices, triangles),
        faces: ROUND_SIDES * (rings + 1),
        extrusions: Vec::new(),
    }
}

/// Counter-clockwise seen from +y: z plays the part of x, x that of y.
fn ring_about_y(radius_m: f64, y: f64) -> Vec<Xyz> {
    round_outline(radius_m, ROUND_SIDES)
        .map(|(z, x)| [x, y, z])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::affine::{cross, dot};

    /// The volume inside a closed surface with outward normals (divergence theorem).
    fn volume_m3(mesh: &Mesh) -> f64 {
        mesh.corners()
            .map(|[a, b, c]| dot(a, cross(b, c)) / 6.0)
            .sum()
    }

    fn check(solid: &Solid, volume: f64, tolerance: f64) {
        let pieces = solid.mesh.pieces();
        assert!(
            pieces.len() == 1 && pieces[0].1,
            "the surface is not closed"
        );
        assert!(
            (volume_m3(&solid.mesh) / volume - 1.0).abs() < tolerance,
            "{}",
            volume_m3(&solid.mesh)
        );
    }

    #[test]
    fn solids_are_closed_and_hold_their_volume() {
        let pi = TAU / 2.0;
        check(&block([1.0, 2.0, 3.0]), 6.0, 1e-12);
        check(&cylinder(2.0, 3.0, Parts::ALL), 12.0 * pi, 1e-12);
        check(&cone(2.0, 3.0, Parts::ALL), 4.0 * pi, 1e-12);
        check(&sphere(2.0), 32.0 / 3.0 * pi, 0.01);
    }

    #[test]
    fn every_extrusion_gives_the_same_solid() {
        let solid = block([1.0, 2.0, 3.0]);
        for extrusion in &solid.extrusions {
            let (mesh, faces) = extruded(&extrusion.ring, extrusion.along, Parts::ALL);
            assert_eq!(faces, 6);
            assert!((volume_m3(&mesh) - 6.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_tube_is_open() {
        let tube = cylinder(
            1.0,
            1.0,
            Parts {
                top: false,
                ..Parts::ALL
            },
        );
        assert!(!tube.mesh.pieces()[0].1);
        assert!(tube.extrusions.is_empty());
    }
}
