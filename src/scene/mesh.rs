//! Triangle meshes: welding, splitting into pieces that hang together, telling closed from open, slicing.
//!
//! Casts no rays (that is parry's part) and knows no material.

use std::collections::BTreeMap;

use super::affine::{Xyz, cross, dot, sub};
use crate::geom::{Point, Segment};

/// Vertices nearer than about this are one vertex, metres.
const WELD_M: f64 = 1e-6;

/// Triangles over shared vertices, local frame, metres.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Mesh {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// One side of a triangle, by its two vertices in rising order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    ends: (u32, u32),
    triangle: usize,
    /// Whether the triangle runs along it from the lower to the higher vertex.
    forward: bool,
}

/// Where a level plane cuts a triangle: the solid lies to the left of from → to when normals point outward.
#[derive(Clone, Copy)]
struct Cut {
    from: Point,
    to: Point,
    from_side: (u32, u32),
    to_side: (u32, u32),
}

impl Mesh {
    /// Makes a mesh; triangles that name a missing vertex are left out.
    pub fn new(vertices: Vec<[f64; 3]>, mut triangles: Vec<[u32; 3]>) -> Mesh {
        triangles.retain(|corners| {
            corners
                .iter()
                .all(|index| (*index as usize) < vertices.len())
        });
        Mesh {
            vertices,
            triangles,
        }
    }

    /// Makes a mesh of some triangles over a list of points, of which it keeps those in use; all indices must
    /// be within the list.
    pub(super) fn using(points: &[Xyz], triangles: &[[u32; 3]]) -> Mesh {
        let mut new_index: BTreeMap<u32, u32> = BTreeMap::new();
        let mut vertices = Vec::new();
        let mut renumber = |old: u32| {
            *new_index.entry(old).or_insert_with(|| {
                vertices.push(points[old as usize]);
                (vertices.len() - 1) as u32
            })
        };
        let triangles = triangles
            .iter()
            .map(|corners| corners.map(&mut renumber))
            .collect();
        Mesh {
            vertices,
            triangles,
        }
    }

    /// Returns the vertices, metres.
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.vertices
    }

    /// Returns the triangles as indices into the vertices.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the corners of every triangle.
    pub fn corners(&self) -> impl Iterator<Item = [[f64; 3]; 3]> + '_ {
        self.triangles
            .iter()
            .map(|triangle| triangle.map(|index| self.vertices[index as usize]))
    }

    /// Returns the mesh with every vertex sent through a map.
    pub(super) fn map(&self, map: impl Fn(Xyz) -> Xyz) -> Mesh {
        Mesh {
            vertices: self.vertices.iter().map(|vertex| map(*vertex)).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// Splits the mesh into the pieces that hang together by common sides, each with whether it is closed:
    /// whether its triangles, turned consistently, leave no side without its neighbour.
    pub(super) fn pieces(&self) -> Vec<(Mesh, bool)> {
        let welded = self.welded();
        let mut groups = Groups::new(welded.triangles.len());
        let sides = welded.sides();
        for pair in sides.windows(2).filter(|pair| pair[0].ends == pair[1].ends) {
            groups.join(pair[0].triangle, pair[1].triangle);
        }
        let mut members: BTreeMap<usize, Vec<[u32; 3]>> = BTreeMap::new();
        for (index, triangle) in welded.triangles.iter().enumerate() {
            members
                .entry(groups.root(index))
                .or_default()
                .push(*triangle);
        }
        members
            .into_values()
            .map(|triangles| Mesh::using(&welded.vertices, &triangles).closed())
            .collect()
    }

    /// Returns the loops at which a level plane cuts a closed mesh, as corners in order.
    pub(super) fn loops_at(&self, height_m: f64) -> Vec<Vec<Point>> {
        let cuts = self.cuts_at(height_m);
        let mut waiting: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
        for (index, cut) in cuts.iter().enumerate() {
            waiting.entry(cut.from_side).or_default().push(index);
        }
        let mut used = vec![false; cuts.len()];
        let mut loops = Vec::new();
        for first in 0..cuts.len() {
            let mut corners = Vec::new();
            let mut next = Some(first);
            while let Some(index) = next.filter(|index| !used[*index]) {
                used[index] = true;
                corners.push(cuts[index].from);
                let following = waiting.get_mut(&cuts[index].to_side);
                next = following.and_then(|list| {
                    list.retain(|candidate| !used[*candidate]);
                    list.pop()
                });
            }
            if corners.len() >= 3 {
                loops.push(corners);
            }
        }
        loops
    }

    /// Returns the pieces at which a level plane cuts the mesh, in no order.
    pub(super) fn segments_at(&self, height_m: f64) -> impl Iterator<Item = Segment> + '_ {
        self.cut_triangles(height_m)
            .map(|cut| Segment::new(cut.from, cut.to))
    }

    fn cuts_at(&self, height_m: f64) -> Vec<Cut> {
        self.cut_triangles(height_m).collect()
    }

    fn cut_triangles(&self, height_m: f64) -> impl Iterator<Item = Cut> + '_ {
        self.triangles
            .iter()
            .filter_map(move |triangle| self.cut(*triangle, height_m))
    }

    /// A vertex at the very height counts as above, so that every closed mesh gives closed loops.
    fn cut(&self, triangle: [u32; 3], height_m: f64) -> Option<Cut> {
        let above = triangle.map(|index| self.vertices[index as usize][2] >= height_m);
        let count = above.iter().filter(|above| **above).count();
        if count == 0 || count == 3 {
            return None;
        }
        let odd = (0..3).find(|corner| above[*corner] == (count == 1))?;
        let [a, b, c] = [0, 1, 2].map(|step| triangle[(odd + step) % 3]);
        let (mut from_side, mut to_side) = ((a.min(b), a.max(b)), (a.min(c), a.max(c)));
        if count == 2 {
            std::mem::swap(&mut from_side, &mut to_side);
        }
        let (from, to) = (
            self.crossing(from_side, height_m),
            self.crossing(to_side, height_m),
        );
        Some(Cut {
            from,
            to,
            from_side,
            to_side,
        })
    }

    fn crossing(&self, side: (u32, u32), height_m: f64) -> Point {
        let (a, b) = (
            self.vertices[side.0 as usize],
            self.vertices[side.1 as usize],
        );
        let share = (height_m - a[2]) / (b[2] - a[2]);
        Point::new(a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))
    }

    /// Joins vertices at one place and drops triangles without an area.
    fn welded(&self) -> Mesh {
        let mut places: BTreeMap<[i64; 3], u32> = BTreeMap::new();
        let mut vertices: Vec<Xyz> = Vec::new();
        let mut index_of = Vec::with_capacity(self.vertices.len());
        for vertex in &self.vertices {
            let key = vertex.map(|part| libm::round(part / WELD_M) as i64);
            let index = *places.entry(key).or_insert_with(|| {
                vertices.push(*vertex);
                (vertices.len() - 1) as u32
            });
            index_of.push(index);
        }
        let renumbered = self
            .triangles
            .iter()
            .map(|corners| corners.map(|index| index_of[index as usize]));
        let triangles = renumbered
            .filter(|[a, b, c]| {
                let [p, q, r] = [a, b, c].map(|index| vertices[*index as usize]);
                let normal = cross(sub(q, p), sub(r, p));
                a != b && b != c && a != c && dot(normal, normal) > 0.0
            })
            .collect();
        Mesh {
            vertices,
            triangles,
        }
    }

    fn sides(&self) -> Vec<Side> {
        let mut sides = Vec::with_capacity(3 * self.triangles.len());
        for (triangle, [a, b, c]) in self.triangles.iter().enumerate() {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                sides.push(Side {
                    ends: (from.min(to), from.max(to)),
                    triangle,
                    forward: from < to,
                });
            }
        }
        sides.sort_unstable();
        sides
    }

    /// Returns whether the mesh is closed, after turning its triangles consistently where they were not.
    fn closed(mut self) -> (Mesh, bool) {
        let balanced = self.is_balanced() || {
            self.turn_consistently();
            self.is_balanced()
        };
        (self, balanced)
    }

    /// Returns whether every side is run along as often one way as the other.
    fn is_balanced(&self) -> bool {
        let sides = self.sides();
        sides.chunk_by(|a, b| a.ends == b.ends).all(|same| {
            let forward = same.iter().filter(|side| side.forward).count();
            2 * forward == same.len()
        })
    }

    fn turn_consistently(&mut self) {
        let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); self.triangles.len()];
        for same in self.sides().chunk_by(|a, b| a.ends == b.ends) {
            let [one, other] = same else { continue };
            let clash = one.forward == other.forward;
            neighbours[one.triangle].push((other.triangle, clash));
            neighbours[other.triangle].push((one.triangle, clash));
        }
        let mut turned: Vec<Option<bool>> = vec![None; self.triangles.len()];
        for start in 0..self.triangles.len() {
            let mut open = vec![(start, false)];
            while let Some((triangle, turn)) = open.pop() {
                if turned[triangle].is_some() {
                    continue;
                }
                turned[triangle] = Some(turn);
                open.extend(
                    neighbours[triangle]
                        .iter()
                        .map(|(next, clash)| (*next, turn != *clash)),
                );
            }
        }
        for (triangle, turn) in self.triangles.iter_mut().zip(turned) {
            if turn == Some(true) {
                triangle.swap(1, 2);
            }
        }
    }
}

/// Disjoint groups of the numbers 0..n.
pub(super) struct Groups {
    parent: Vec<usize>,
}

impl Groups {
    pub(super) fn new(count: usize) -> Groups {
        Groups {
            parent: (0..count).collect(),
        }
    }

    pub(super) fn root(&mut self, mut index: usize) -> usize {
        while self.parent[index] != index {
            self.parent[index] = self.parent[self.parent[index]];
            index = self.parent[index];
        }
        index
    }

    /// Joins two groups; the lower root stays, so that the order of the input is kept.
    pub(super) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Polygon;
    use crate::scene::primitive;

    fn block() -> Mesh {
        primitive::block([2.0, 4.0, 6.0]).mesh
    }

    fn soup(mesh: &Mesh) -> Mesh {
        let vertices: Vec<Xyz> = mesh.corners().flatten().collect();
        let triangles = (0..vertices.len() as u32 / 3)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
        Mesh::new(vertices, triangles)
    }

    #[test]
    fn a_block_is_closed_and_cut_into_its_outline() {
        for mesh in [block(), soup(&block())] {
            let pieces = mesh.pieces();
            assert_eq!(pieces.len(), 1);
            assert!(pieces[0].1);
            let loops = pieces[0].0.loops_at(0.5);
            assert_eq!(loops.len(), 1);
            assert!((Polygon::new(loops[0].clone()).area_m2() - 8.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_cut_through_the_very_corners_is_whole_or_nothing() {
        let (mesh, _) = block().pieces().remove(0);
        assert_eq!(mesh.loops_at(-3.0).len(), 0);
        assert!((Polygon::new(mesh.loops_at(3.0).remove(0)).area_m2() - 8.0).abs() < 1e-12);
        assert_eq!(mesh.loops_at(3.1).len(), 0);
    }

    #[test]
    fn triangles_turned_at_random_are_turned_back() {
        let mut mesh = block();
        for triangle in mesh.triangles.iter_mut().step_by(3) {
            triangle.swap(0, 1);
        }
        let (mesh, closed) = mesh.pieces().remove(0);
        assert!(closed);
        let area = Polygon::new(mesh.loops_at(0.0).remove(0)).area_m2();
        assert!((area.abs() - 8.0).abs() < 1e-12);
    }

    #[test]
    fn a_block_without_one_triangle_is_open() {
        let mut mesh = block();
        mesh.triangles.pop();
        assert!(!mesh.pieces()[0].1);
    }

    #[test]
    fn two_blocks_apart_are_two_pieces() {
        let (a, b) = (block(), block().map(|[x, y, z]| [x + 9.0, y, z]));
        let mut both = a.clone();
        let shift = both.vertices.len() as u32;
        both.vertices.extend(b.vertices());
        both.triangles.extend(
            b.triangles()
                .iter()
                .map(|corners| corners.map(|index| index + shift)),
        );
        let pieces = both.pieces();
        assert_eq!(pieces.len(), 2);
        for ((piece, closed), whole) in pieces.iter().zip([a, b]) {
            assert!(*closed);
            assert!(piece.corners().eq(whole.corners()));
        }
    }
}
