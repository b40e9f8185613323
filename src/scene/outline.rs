//! What a scene looks like from above at one height: for pictures, for the truth, for radio.
//!
//! Draws nothing.

use i_overlay::core::fill_rule::FillRule;
use i_overlay::float::simplify::SimplifyShape;

use super::build::{Object, Scene, Shape};
use crate::geom::{Point, Polygon, Segment};

/// The cut through an object at a height.
#[derive(Clone, PartialEq, Debug)]
pub struct Outline {
    /// The object, by its place in [`Scene::objects`].
    pub object: usize,
    /// The object's name.
    pub name: String,
    /// Its border, counter-clockwise; an open sheet gives one polygon of two corners per straight piece.
    pub polygon: Polygon,
    /// What is not part of it inside the border, clockwise.
    pub holes: Vec<Polygon>,
    /// Attenuation inside, dB per metre; 0 for open sheets.
    pub db_per_m: f64,
}

impl Outline {
    /// Returns whether a point lies in the solid part.
    pub fn contains(&self, point: Point) -> bool {
        self.polygon.contains(point) && !self.holes.iter().any(|hole| hole.contains(point))
    }
}

/// A connected region of the plane: its border counter-clockwise, then its holes clockwise.
pub(super) type Region = Vec<Vec<Point>>;

impl Scene {
    /// Returns the outlines of everything that stands at a height, metres above z = 0, in object order.
    pub fn outlines(&self, height_m: f64) -> Vec<Outline> {
        let mut outlines = Vec::new();
        for (index, object) in self.objects().iter().enumerate() {
            for mut region in object.regions_at(height_m) {
                let holes = region.split_off(1.min(region.len()));
                let border = region.pop().unwrap_or_default();
                outlines.push(Outline {
                    object: index,
                    name: object.name.clone(),
                    polygon: Polygon::new(border),
                    holes: holes.into_iter().map(Polygon::new).collect(),
                    db_per_m: object.material.db_per_m,
                });
            }
            outlines.extend(object.sheet_at(height_m).into_iter().map(|piece| Outline {
                object: index,
                name: object.name.clone(),
                polygon: Polygon::new(vec![piece.from, piece.to]),
                holes: Vec::new(),
                db_per_m: 0.0,
            }));
        }
        outlines
    }
}

impl Object {
    /// Returns the regions that a closed object fills at a height; none for open sheets.
    pub(super) fn regions_at(&self, height_m: f64) -> Vec<Region> {
        match &self.shape {
            Shape::Prism {
                footprint,
                low_m,
                high_m,
            } => {
                if (*low_m..*high_m).contains(&height_m) {
                    return vec![vec![footprint.corners().to_vec()]];
                }
                Vec::new()
            }
            Shape::Mesh(mesh) if self.closed => union(&mesh.loops_at(height_m)),
            Shape::Mesh(_) => Vec::new(),
        }
    }

    /// Returns the straight pieces at which an open sheet is cut at a height; none for closed objects.
    pub(super) fn sheet_at(&self, height_m: f64) -> Vec<Segment> {
        match &self.shape {
            Shape::Mesh(mesh) if !self.closed => mesh.segments_at(height_m).collect(),
            Shape::Mesh(_) | Shape::Prism { .. } => Vec::new(),
        }
    }
}

/// Returns the connected regions that contours fill together (non-zero winding).
pub(super) fn union(contours: &[Vec<Point>]) -> Vec<Region> {
    if contours.is_empty() {
        return Vec::new();
    }
    let to_pair = |corner: &Point| [corner.x_m, corner.y_m];
    let source: Vec<Vec<[f64; 2]>> = contours
        .iter()
        .map(|contour| contour.iter().map(to_pair).collect())
        .collect();
    let regions = source.simplify_shape_as::<i64>(FillRule::NonZero);
    let to_points =
        |contour: Vec<[f64; 2]>| contour.iter().map(|[x, y]| Point::new(*x, *y)).collect();
    regions
        .into_iter()
        .map(|region| region.into_iter().map(to_points).collect())
        .collect()
}
