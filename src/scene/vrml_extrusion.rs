//! VRML97 Extrusion: a cross-section led along a spine, as triangles.
//!
//! The planes of the cross-sections stand as VRML97, 6.18 has them. Where the spine is closed there are no caps.
//! `ccw`, `solid` and `creaseAngle` are skipped, because every face is seen from both sides and none is smoothed.

use super::affine::{Affine, Xyz, add, cross, dot, sub};
use super::ears::ears;
use super::mesh::Mesh;
use super::primitive::{self, Parts, Solid};
use super::vrml::VrmlRefusal;
use super::vrml_parse::Parser;
use crate::geom::{Point, Polygon};

/// Points of one body: those of the cross-section times those of the spine.
const MAX_POINTS: usize = 500_000;
/// Corners of a cross-section that is not convex and has caps; cutting it takes the square of them.
const MAX_CORNERS: usize = 2_000;

/// What an Extrusion node says.
struct Body {
    section: Vec<[f64; 2]>,
    spine: Vec<Xyz>,
    scale: Vec<[f64; 2]>,
    turns: Vec<Affine>,
    has_begin_cap: bool,
    has_end_cap: bool,
    is_convex: bool,
}

/// The axes of a cross-section's plane: its own x, the way of the spine, its own z.
#[derive(Clone, Copy)]
struct Axes {
    x: Xyz,
    y: Xyz,
    z: Xyz,
}

impl Parser<'_, '_, '_> {
    /// Reads an Extrusion's body.
    pub(super) fn extrusion(&mut self) -> Result<Solid, VrmlRefusal> {
        let line = self.tokens.line();
        let mut body = Body {
            section: vec![
                [1.0, 1.0],
                [1.0, -1.0],
                [-1.0, -1.0],
                [-1.0, 1.0],
                [1.0, 1.0],
            ],
            spine: vec![[0.0; 3], [0.0, 1.0, 0.0]],
            scale: vec![[1.0; 2]],
            turns: vec![Affine::IDENTITY],
            has_begin_cap: true,
            has_end_cap: true,
            is_convex: true,
        };
        self.body("Extrusion", |parser, field| {
            match field {
                "crossSection" => {
                    body.section = parser.list(field, |parser| parser.pair("crossSection"))?
                }
                "spine" => body.spine = parser.list(field, |parser| parser.vector("spine"))?,
                "scale" => body.scale = parser.list(field, |parser| parser.shares("scale"))?,
                "orientation" => {
                    body.turns =
                        parser.list(field, |parser| Ok(parser.rotation("orientation")?[0]))?;
                }
                "beginCap" => body.has_begin_cap = parser.truth(field)?,
                "endCap" => body.has_end_cap = parser.truth(field)?,
                "convex" => body.is_convex = parser.truth(field)?,
                _ => return Ok(false),
            }
            Ok(true)
        })?;
        body.check()
            .and_then(|()| body.solid())
            .map_err(|reason| VrmlRefusal::at(line, reason))
    }

    fn pair(&mut self, field: &str) -> Result<[f64; 2], VrmlRefusal> {
        Ok([self.number(field)?, self.number(field)?])
    }

    fn shares(&mut self, field: &str) -> Result<[f64; 2], VrmlRefusal> {
        let pair = self.pair(field)?;
        match pair.iter().find(|share| **share < 0.0) {
            Some(share) => Err(self.refuse(format!("{share} for {field}; expected 0 or more"))),
            None => Ok(pair),
        }
    }
}

impl Body {
    fn check(&self) -> Result<(), String> {
        let points = self.spine.len().saturating_mul(self.section.len());
        if points > MAX_POINTS {
            return Err(format!(
                "an Extrusion of {} x {} = {points} points; expected at most {MAX_POINTS}",
                self.spine.len(),
                self.section.len()
            ));
        }
        if self.section.len() < 2 {
            return Err(
                "an Extrusion whose crossSection has under two points; expected more".into(),
            );
        }
        for (field, count) in [
            ("scale", self.scale.len()),
            ("orientation", self.turns.len()),
        ] {
            if count != 1 && count < self.spine.len() {
                let points = self.spine.len();
                return Err(format!(
                    "an Extrusion with {count} values of {field}; expected one, or {points} for the spine"
                ));
            }
        }
        Ok(())
    }

    fn solid(&self) -> Result<Solid, String> {
        let rings = self.rings()?;
        if let Some(solid) = self.prism(&rings) {
            return Ok(solid);
        }
        let corners = self.section.len() as u32;
        let mut triangles = Vec::new();
        for ring in 1..rings.len() as u32 {
            for corner in 1..corners {
                let (here, next) = (
                    (ring - 1) * corners + corner - 1,
                    (ring - 1) * corners + corner,
                );
                triangles.extend([
                    [here, next, next + corners],
                    [here, next + corners, here + corners],
                ]);
            }
        }
        let mut faces = triangles.len() / 2;
        let last = (rings.len() as u32 - 1) * corners;
        for (there, first) in [(self.has_begin_cap, 0), (self.has_end_cap, last)] {
            if there && !self.is_closed() {
                let cap = self.cap()?;
                faces += usize::from(!cap.is_empty());
                let turned = |[a, b, c]: [u32; 3]| if first == 0 { [a, c, b] } else { [a, b, c] };
                triangles.extend(
                    cap.into_iter()
                        .map(|cut| turned(cut).map(|corner| corner + first)),
                );
            }
        }
        let points: Vec<Xyz> = rings.concat();
        Ok(Solid {
            mesh: Mesh::using(&points, &triangles),
            faces,
            extrusions: Vec::new(),
        })
    }

    /// Returns the straight body with equal convex ends, if it is one.
    fn prism(&self, rings: &[Vec<Xyz>]) -> Option<Solid> {
        let ([begin, end], [from, to]) = (rings, self.spine.as_slice()) else {
            return None;
        };
        let along = sub(*to, *from);
        let are_equal = begin
            .iter()
            .zip(end)
            .all(|(one, other)| distance(add(*one, along), *other) < 1e-9);
        let is_whole =
            self.has_begin_cap && self.has_end_cap && self.section.first() == self.section.last();
        let outline: Vec<Point> = self
            .outline()
            .iter()
            .map(|[x, z]| Point::new(*z, *x))
            .collect();
        let polygon = Polygon::new(outline);
        if !are_equal || !is_whole || !polygon.is_convex() || polygon.area_m2() <= 0.0 {
            return None;
        }
        let ring = begin[..begin.len() - 1].to_vec();
        let (mesh, faces) = primitive::extruded(&ring, along, Parts::ALL);
        Some(Solid {
            mesh,
            faces,
            extrusions: vec![primitive::Extrusion { ring, along }],
        })
    }

    /// Returns the cross-section without its last point where that is the first again.
    fn outline(&self) -> &[[f64; 2]] {
        let is_ring = self.section.len() > 1 && self.section.first() == self.section.last();
        &self.section[..self.section.len() - usize::from(is_ring)]
    }

    fn is_closed(&self) -> bool {
        self.spine.first() == self.spine.last()
    }

    /// Cuts the cross-section into triangles, all turned as it runs.
    fn cap(&self) -> Result<Vec<[u32; 3]>, String> {
        let outline = self.outline();
        if self.is_convex || outline.len() <= 3 {
            return Ok((2..outline.len() as u32)
                .map(|corner| [0, corner - 1, corner])
                .collect());
        }
        if outline.len() > MAX_CORNERS {
            return Err(format!(
                "a crossSection of {} corners that is not convex; expected at most {MAX_CORNERS}",
                outline.len()
            ));
        }
        Ok(ears(outline))
    }

    /// Returns the cross-section's places at every point of the spine.
    fn rings(&self) -> Result<Vec<Vec<Xyz>>, String> {
        let axes = axes_along(&self.spine)?;
        let of = |index: usize, count: usize| if count == 1 { 0 } else { index };
        let ring = |(index, (at, axes)): (usize, (&Xyz, Axes))| {
            let scale = self.scale[of(index, self.scale.len())];
            let turn = &self.turns[of(index, self.turns.len())];
            let place = |[x, z]: &[f64; 2]| {
                add(
                    *at,
                    axes.place(turn.turn([x * scale[0], 0.0, z * scale[1]])),
                )
            };
            self.section.iter().map(place).collect()
        };
        Ok(self.spine.iter().zip(axes).enumerate().map(ring).collect())
    }
}

impl Axes {
    fn place(&self, [x, y, z]: Xyz) -> Xyz {
        add(
            add(self.x.map(|part| part * x), self.y.map(|part| part * y)),
            self.z.map(|part| part * z),
        )
    }
}

/// Returns the cross-section's axes at every point of a spine; points at one place share them.
fn axes_along(spine: &[Xyz]) -> Result<Vec<Axes>, String> {
    let mut places: Vec<Xyz> = Vec::new();
    let mut place_of = Vec::with_capacity(spine.len());
    for point in spine {
        if places.last() != Some(point) {
            places.push(*point);
        }
        place_of.push(places.len() - 1);
    }
    if places.len() < 2 {
        return Err("an Extrusion whose spine has under two places; expected more".into());
    }
    let neighbours = neighbours(&places);
    let normal =
        |(at, [before, after]): (&Xyz, &[Xyz; 2])| unit(cross(sub(*after, *at), sub(*before, *at)));
    let bends: Vec<Option<Xyz>> = places.iter().zip(&neighbours).map(normal).collect();
    let Some(mut z) = bends.iter().flatten().copied().next() else {
        let straight = straight_axes(sub(places[1], places[0]));
        return Ok(vec![straight; spine.len()]);
    };
    let mut axes = Vec::with_capacity(places.len());
    for ([before, after], bend) in neighbours.iter().zip(bends) {
        let next = bend.unwrap_or(z);
        z = if dot(next, z) < 0.0 {
            next.map(|part| -part)
        } else {
            next
        };
        let y = unit(sub(*after, *before)).unwrap_or([0.0, 1.0, 0.0]);
        axes.push(Axes {
            x: cross(y, z),
            y,
            z,
        });
    }
    Ok(place_of.into_iter().map(|place| axes[place]).collect())
}

/// Returns what lies before and after every place; around a closed spine the ends are neighbours.
fn neighbours(places: &[Xyz]) -> Vec<[Xyz; 2]> {
    let last = places.len() - 1;
    let is_closed = places.len() > 3 && places[0] == places[last];
    let of = |index: usize| match index {
        _ if is_closed && (index == 0 || index == last) => [places[last - 1], places[1]],
        0 => [places[0], places[1]],
        _ if index == last => [places[last - 1], places[last]],
        _ => [places[index - 1], places[index + 1]],
    };
    (0..places.len()).map(of).collect()
}

/// Turns the plane y = 0 the shortest way until it stands across a straight spine.
fn straight_axes(along: Xyz) -> Axes {
    let y = unit(along).unwrap_or([0.0, 1.0, 0.0]);
    let axis = cross([0.0, 1.0, 0.0], y);
    let angle_rad = libm::atan2(dot(axis, axis).sqrt(), y[1]);
    // Straight down there is no shortest way: about x.
    let axis = if dot(axis, axis) > 0.0 {
        axis
    } else {
        [1.0, 0.0, 0.0]
    };
    let turn = Affine::rotation(axis, angle_rad);
    Axes {
        x: turn.turn([1.0, 0.0, 0.0]),
        y,
        z: turn.turn([0.0, 0.0, 1.0]),
    }
}

/// Returns a vector of length one; `None` when there is no direction in it.
fn unit(vector: Xyz) -> Option<Xyz> {
    let length = dot(vector, vector).sqrt();
    (length > 1e-12).then(|| vector.map(|part| part / length))
}

fn distance(a: Xyz, b: Xyz) -> f64 {
    let way = sub(a, b);
    dot(way, way).sqrt()
}
