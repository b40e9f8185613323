//! The level cut through a scene: the straight and round pieces that a level sensor has before it, sorted so that a question
//! touches only what is near, and which of them hang together as one solid.
//!
//! Says nothing about what is seen or heard; knows no direction of a sensor. Pieces inside of solids that overlap stay: what
//! stands before them hides them.

use std::sync::Arc;

use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::math::Vector as ParryVector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

use super::build::{Circle, Object, Scene, Shape};
use super::mesh::Groups;
use crate::geom::{Point, Rect, Segment, Vector};

/// Pieces nearer to each other than this hang together, metres: about a wavelength of ultrasound, for which a narrower gap
/// is none.
const JOINT_M: f64 = 0.01;
/// How many cuts are kept.
const CUTS: usize = 4;

/// The form of a piece, local frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum CutForm {
    /// A straight piece of an outline, or of an open sheet.
    Straight(Segment),
    /// A whole circle.
    Round(Circle),
}

/// A piece of what stands at a height.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CutPiece {
    /// Its form.
    pub form: CutForm,
    /// The solid that it belongs to.
    pub solid: usize,
}

/// What stands at a height.
#[derive(Clone, Debug)]
pub struct LevelCut {
    pieces: Vec<CutPiece>,
    tree: Bvh,
    solids: Vec<Hull>,
    /// The solids of each object; of one that does not reach this height, all of it seen from above.
    solids_of: Vec<Vec<usize>>,
}

/// The convex hull of some points and circles.
#[derive(Clone, Debug, Default)]
struct Hull {
    corners: Vec<Point>,
    circles: Vec<Circle>,
}

impl LevelCut {
    /// Cuts a scene at a height, metres above z = 0; what only touches the height from above or below is cut too.
    pub fn of(scene: &Scene, height_m: f64) -> LevelCut {
        let mut forms: Vec<(CutForm, usize)> = Vec::new();
        for (index, object) in scene.objects().iter().enumerate() {
            object.cut_into(height_m, &mut |form| forms.push((form, index)));
        }
        let boxes: Vec<Aabb> = forms.iter().map(|(form, _)| form.bounds()).collect();
        let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        let (solid_of, count) = joined(&forms, &tree);
        let mut solids = vec![Hull::default(); count];
        let mut solids_of = vec![Vec::new(); scene.objects().len()];
        for ((form, object), solid) in forms.iter().zip(&solid_of) {
            solids[*solid].add(*form);
            if !solids_of[*object].contains(solid) {
                solids_of[*object].push(*solid);
            }
        }
        for (object, own) in scene.objects().iter().zip(&mut solids_of) {
            if own.is_empty() {
                own.push(solids.len());
                solids.push(Hull::from_above(object));
            }
        }
        solids.iter_mut().for_each(Hull::keep_rim);
        let pieces = forms.into_iter().zip(solid_of);
        LevelCut {
            pieces: pieces
                .map(|((form, _), solid)| CutPiece { form, solid })
                .collect(),
            tree,
            solids,
            solids_of,
        }
    }

    /// Returns the pieces that may lie in a sector: within a distance of its tip, and between two directions less than half a
    /// turn apart, the left and the right one (unit vectors).
    pub fn in_sector(
        &self,
        tip: Point,
        [left, right]: [Vector; 2],
        reach_m: f64,
    ) -> impl Iterator<Item = &CutPiece> {
        // Outside are a box that lies left of the left edge, and one right of the right edge.
        let outward = [left.left(), -right.left()];
        let may_lie_in = move |node: &BvhNode| {
            let (low, high) = (node.mins(), node.maxs());
            let (mid_x, mid_y) = (
                (low.x + high.x) / 2.0 - tip.x_m,
                (low.y + high.y) / 2.0 - tip.y_m,
            );
            let (half_x, half_y) = ((high.x - low.x) / 2.0, (high.y - low.y) / 2.0);
            let (gap_x, gap_y) = (
                (mid_x.abs() - half_x).max(0.0),
                (mid_y.abs() - half_y).max(0.0),
            );
            let is_near = gap_x * gap_x + gap_y * gap_y <= reach_m * reach_m;
            is_near
                && outward.iter().all(|out| {
                    let least = out.x_m * mid_x + out.y_m * mid_y
                        - out.x_m.abs() * half_x
                        - out.y_m.abs() * half_y;
                    least <= 0.0
                })
        };
        self.tree
            .leaves(may_lie_in)
            .filter_map(|piece| self.pieces.get(piece as usize))
    }

    /// Returns half of the width of a solid across a direction (a unit vector), metres.
    pub fn half_width_m(&self, solid: usize, along: Vector) -> f64 {
        self.solids
            .get(solid)
            .map_or(0.0, |hull| hull.half_width_m(along))
    }

    /// Returns half of the width of an object (by its place in [`Scene::objects`]) across a direction, metres: of the widest
    /// of its solids at this height; of all of it where it does not reach this height.
    pub fn object_half_width_m(&self, object: usize, along: Vector) -> f64 {
        let own = self.solids_of.get(object).into_iter().flatten();
        own.map(|solid| self.half_width_m(*solid, along))
            .fold(0.0, f64::max)
    }
}

/// The cuts that were made last.
#[derive(Clone, Debug, Default)]
pub struct Cuts {
    kept: Vec<(f64, Arc<LevelCut>)>,
}

impl Cuts {
    /// Returns the cut at a height, metres; always of the same scene.
    pub fn at(&mut self, scene: &Scene, height_m: f64) -> Arc<LevelCut> {
        if let Some(place) = self.kept.iter().position(|(kept_m, _)| *kept_m == height_m) {
            // What was asked for last stays longest.
            self.kept[..=place].rotate_right(1);
        } else {
            self.kept.truncate(CUTS - 1);
            let cut = Arc::new(LevelCut::of(scene, height_m));
            self.kept.insert(0, (height_m, cut));
        }
        Arc::clone(&self.kept[0].1)
    }
}

impl CutForm {
    fn rect(self) -> Rect {
        match self {
            CutForm::Straight(piece) => Rect::new(piece.from, piece.to),
            CutForm::Round(Circle { centre, radius_m }) => {
                Rect::new(centre, centre).shrunk(-radius_m)
            }
        }
    }

    fn bounds(self) -> Aabb {
        let Rect { min, max } = self.rect();
        Aabb::new(
            ParryVector::new(min.x_m, min.y_m, 0.0),
            ParryVector::new(max.x_m, max.y_m, 0.0),
        )
    }

    /// Distance between two pieces, metres; 0 when they touch or overlap.
    fn distance_m(self, other: CutForm) -> f64 {
        match (self, other) {
            (CutForm::Straight(a), CutForm::Straight(b)) => a.distance_to(b),
            (CutForm::Straight(piece), CutForm::Round(circle))
            | (CutForm::Round(circle), CutForm::Straight(piece)) => {
                (piece.distance_to_point(circle.centre) - circle.radius_m).max(0.0)
            }
            (CutForm::Round(a), CutForm::Round(b)) => {
                (a.centre.distance_to(b.centre) - a.radius_m - b.radius_m).max(0.0)
            }
        }
    }
}

impl Object {
    /// Hands on the pieces of this object at a height.
    fn cut_into(&self, height_m: f64, each: &mut dyn FnMut(CutForm)) {
        match &self.shape {
            Shape::Prism {
                footprint,
                low_m,
                high_m,
            } => {
                if !(*low_m..=*high_m).contains(&height_m) {
                    return;
                }
                match self.round {
                    Some(circle) => each(CutForm::Round(circle)),
                    None => footprint
                        .edges()
                        .for_each(|edge| each(CutForm::Straight(edge))),
                }
            }
            Shape::Mesh(mesh) => mesh
                .segments_at(height_m)
                .for_each(|piece| each(CutForm::Straight(piece))),
        }
    }
}

/// Numbers the solids: pieces that touch, or nearly so, are of one. Returns the solid of each piece, and how many there are.
fn joined(forms: &[(CutForm, usize)], tree: &Bvh) -> (Vec<usize>, usize) {
    let mut groups = Groups::new(forms.len());
    for (index, (form, _)) in forms.iter().enumerate() {
        let near = form.bounds().loosened(JOINT_M);
        for other in tree.intersect_aabb(&near) {
            let other = other as usize;
            if other < index && form.distance_m(forms[other].0) <= JOINT_M {
                groups.join(index, other);
            }
        }
    }
    let mut number_of = vec![None; forms.len()];
    let mut count = 0;
    let solid_of = (0..forms.len())
        .map(|index| {
            *number_of[groups.root(index)].get_or_insert_with(|| {
                count += 1;
                count - 1
            })
        })
        .collect();
    (solid_of, count)
}

impl Hull {
    fn from_above(object: &Object) -> Hull {
        let mut hull = Hull::default();
        match (&object.shape, object.round) {
            (_, Some(circle)) => hull.circles.push(circle),
            (Shape::Prism { footprint, .. }, None) => {
                hull.corners.extend_from_slice(footprint.corners());
            }
            (Shape::Mesh(mesh), None) => {
                let corners = mesh.vertices().iter().map(|[x, y, _]| Point::new(*x, *y));
                hull.corners.extend(corners);
            }
        }
        hull
    }

    fn add(&mut self, form: CutForm) {
        match form {
            CutForm::Straight(piece) => self.corners.extend([piece.from, piece.to]),
            CutForm::Round(circle) => self.circles.push(circle),
        }
    }

    /// Drops the points that are no corners of the hull (Andrew's monotone chain).
    fn keep_rim(&mut self) {
        self.corners
            .sort_by(|a, b| a.x_m.total_cmp(&b.x_m).then(a.y_m.total_cmp(&b.y_m)));
        self.corners.dedup();
        if self.corners.len() < 3 {
            return;
        }
        let mut rim = chain(self.corners.iter());
        rim.extend(chain(self.corners.iter().rev()));
        self.corners = rim;
    }

    fn half_width_m(&self, along: Vector) -> f64 {
        let across = along.left();
        let offset = |point: &Point| across.x_m * point.x_m + across.y_m * point.y_m;
        let corners = self.corners.iter().map(|corner| (offset(corner), 0.0));
        let circles = self
            .circles
            .iter()
            .map(|circle| (offset(&circle.centre), circle.radius_m));
        let (low_m, high_m) = corners.chain(circles).fold(
            (f64::INFINITY, f64::NEG_INFINITY),
            |(low_m, high_m), (at_m, radius_m)| {
                (low_m.min(at_m - radius_m), high_m.max(at_m + radius_m))
            },
        );
        ((high_m - low_m) / 2.0).max(0.0)
    }
}

/// Returns the points of one half of a hull, without its last one; the points must be sorted.
fn chain<'a>(points: impl Iterator<Item = &'a Point>) -> Vec<Point> {
    let mut half: Vec<Point> = Vec::new();
    for point in points {
        while let [.., before, last] = half[..] {
            if (last - before).cross(*point - before) > 0.0 {
                break;
            }
            half.pop();
        }
        half.push(*point);
    }
    half.pop();
    half
}
