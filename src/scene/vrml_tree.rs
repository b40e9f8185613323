//! The nodes of a VRML scene, and the walk over them that places every shape.
//!
//! Nodes lie in one flat list and name each other by index, so that dropping a deep tree needs no stack.
//! What a node would unfold to is counted when it is added, so that USE cannot make a small file huge.

use std::rc::Rc;
use std::sync::Arc;

use super::Shape;
use super::affine::{Affine, Xyz, add};
use super::primitive::{Extrusion, Solid};
use super::vrml::{MAX_LEVELS, VrmlError, VrmlRefusal, VrmlShape, within_world};
use crate::geom::{Point, Polygon};

/// Shapes of a scene, USE counted each time.
const MAX_SHAPES: usize = 20_000;
/// Triangles of a scene, USE counted each time.
const MAX_TRIANGLES: usize = 1_000_000;
/// Nodes of a scene, USE counted each time.
const MAX_NODES: usize = 1_000_000;

/// All nodes read so far.
#[derive(Default)]
pub(super) struct Tree {
    nodes: Vec<SceneNode>,
}

/// One node that can stand among children.
pub(super) struct SceneNode {
    /// Its DEF name.
    pub(super) name: Option<Arc<str>>,
    /// Where it stands.
    pub(super) file: Arc<str>,
    pub(super) line: usize,
    pub(super) kind: NodeKind,
    unfolded: Unfolded,
}

/// What a node is.
pub(super) enum NodeKind {
    /// A grouping node: children, placed by a map.
    Group { map: Affine, children: Vec<usize> },
    /// A shape with its geometry.
    Shape { solid: Rc<Solid> },
}

/// What a node becomes when every USE is written out.
#[derive(Clone, Copy, Default)]
struct Unfolded {
    levels: usize,
    nodes: usize,
    shapes: usize,
    triangles: usize,
}

impl Unfolded {
    fn with(self, child: Unfolded) -> Unfolded {
        Unfolded {
            levels: self.levels.max(child.levels + 1),
            nodes: self.nodes.saturating_add(child.nodes),
            shapes: self.shapes.saturating_add(child.shapes),
            triangles: self.triangles.saturating_add(child.triangles),
        }
    }

    fn check(self, line: usize) -> Result<(), VrmlRefusal> {
        let limits = [
            (self.levels, MAX_LEVELS, "levels of nodes"),
            (self.nodes, MAX_NODES, "nodes"),
            (self.shapes, MAX_SHAPES, "shapes"),
            (self.triangles, MAX_TRIANGLES, "triangles"),
        ];
        match limits.iter().find(|(count, limit, _)| count > limit) {
            Some((_, limit, what)) => Err(VrmlRefusal::at(
                line,
                format!("the scene has over {limit} {what}, with every USE counted"),
            )),
            None => Ok(()),
        }
    }
}

/// A node on the way to being walked: its place and the names around it.
struct Place {
    node: usize,
    map: Affine,
    names: Vec<Arc<str>>,
}

impl Tree {
    /// Adds a node whose children are there already, and returns its index.
    pub(super) fn add(
        &mut self,
        name: Option<Arc<str>>,
        file: &Arc<str>,
        line: usize,
        kind: NodeKind,
    ) -> Result<usize, VrmlRefusal> {
        let unfolded = self.unfold(&kind);
        unfolded.check(line)?;
        if self.nodes.len() >= MAX_NODES {
            return Err(VrmlRefusal::at(
                line,
                format!("the scene has over {MAX_NODES} nodes"),
            ));
        }
        self.nodes.push(SceneNode {
            name,
            file: file.clone(),
            line,
            kind,
            unfolded,
        });
        Ok(self.nodes.len() - 1)
    }

    /// Refuses roots that together unfold to too much.
    pub(super) fn check_roots(&self, roots: &[usize], line: usize) -> Result<(), VrmlRefusal> {
        self.unfold_all(roots).check(line)
    }

    fn unfold(&self, kind: &NodeKind) -> Unfolded {
        match kind {
            NodeKind::Group { children, .. } => self.unfold_all(children),
            NodeKind::Shape { solid } => {
                let triangles = solid.mesh.triangles().len();
                Unfolded {
                    levels: 1,
                    nodes: 1,
                    shapes: 1,
                    triangles,
                }
            }
        }
    }

    fn unfold_all(&self, children: &[usize]) -> Unfolded {
        let alone = Unfolded {
            levels: 1,
            nodes: 1,
            shapes: 0,
            triangles: 0,
        };
        children
            .iter()
            .fold(alone, |sum, child| sum.with(self.nodes[*child].unfolded))
    }

    /// Returns every shape below the roots in file order, placed by `map` and the transforms around it.
    pub(super) fn shapes(
        &self,
        roots: &[usize],
        map: &Affine,
    ) -> Result<Vec<VrmlShape>, VrmlError> {
        let mut shapes = Vec::new();
        let root = |node: &usize| Place {
            node: *node,
            map: *map,
            names: Vec::new(),
        };
        let mut open: Vec<Place> = roots.iter().rev().map(root).collect();
        while let Some(Place {
            node,
            map,
            mut names,
        }) = open.pop()
        {
            let node = &self.nodes[node];
            names.extend(node.name.clone());
            match &node.kind {
                NodeKind::Group {
                    map: inner,
                    children,
                } => {
                    let map = map.after(inner);
                    let below = |child: &usize| Place {
                        node: *child,
                        map,
                        names: names.clone(),
                    };
                    let useful = |child: &&usize| self.nodes[**child].unfolded.shapes > 0;
                    open.extend(children.iter().rev().filter(useful).map(below));
                }
                NodeKind::Shape { solid } => {
                    let shape = placed(solid, &map).ok_or_else(|| VrmlError {
                        file: node.file.to_string(),
                        line: node.line,
                        reason: "this shape reaches over 1000 km from the origin; expected metres"
                            .into(),
                    })?;
                    let triangles = solid.mesh.triangles().len();
                    shapes.push(VrmlShape {
                        names,
                        faces: solid.faces,
                        triangles,
                        shape,
                    });
                }
            }
        }
        Ok(shapes)
    }
}

/// Places a solid; upright extrusions become prisms. `None` when a vertex is out of the world.
fn placed(solid: &Solid, map: &Affine) -> Option<Shape> {
    let mesh = solid.mesh.map(|vertex| map.apply(vertex));
    if !mesh.vertices().iter().all(|vertex| within_world(*vertex)) {
        return None;
    }
    let prism = solid
        .extrusions
        .iter()
        .find_map(|extrusion| upright(extrusion, map));
    Some(prism.unwrap_or(Shape::Mesh(mesh)))
}

/// Returns the prism that an extrusion becomes when its ring lies level and its length stands upright.
fn upright(extrusion: &Extrusion, map: &Affine) -> Option<Shape> {
    let ring: Vec<Xyz> = extrusion
        .ring
        .iter()
        .map(|corner| map.apply(*corner))
        .collect();
    let along = map.turn(extrusion.along);
    let base = *ring.first()?;
    let tolerance_m = 1e-9
        * base
            .iter()
            .chain(&along)
            .fold(1.0, |largest: f64, part| largest.max(part.abs()));
    let level = ring
        .iter()
        .all(|corner| (corner[2] - base[2]).abs() <= tolerance_m);
    if !level || along[0].abs() > tolerance_m || along[1].abs() > tolerance_m {
        return None;
    }
    let top = add(base, along);
    let mut corners: Vec<Point> = ring
        .iter()
        .map(|corner| Point::new(corner[0], corner[1]))
        .collect();
    if Polygon::new(corners.clone()).area_m2() < 0.0 {
        corners.reverse();
    }
    let (low_m, high_m) = (base[2].min(top[2]), base[2].max(top[2]));
    Some(Shape::Prism {
        footprint: Polygon::new(corners),
        low_m,
        high_m,
    })
}
