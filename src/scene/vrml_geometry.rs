//! VRML97 geometry nodes: IndexedFaceSet (cut into fans), Box, Cylinder, Cone, Sphere; ElevationGrid and Extrusion have
//! files of their own.
//!
//! Normals, colours, texture coordinates and crease angles are skipped; every face is seen from both sides.

use std::rc::Rc;

use super::affine::Xyz;
use super::mesh::Mesh;
use super::primitive::{self, Parts, Solid};
use super::vrml::VrmlRefusal;
use super::vrml_parse::{Named, Parser};
use super::vrml_token::Token;
use super::vrml_tree::NodeKind;

/// Numbers in one list.
const MAX_NUMBERS: usize = 6_000_000;

impl<'a> Parser<'a, '_, '_> {
    /// Reads a Shape's body; `None` when it has no geometry that we know.
    pub(super) fn shape(&mut self) -> Result<Option<NodeKind>, VrmlRefusal> {
        let mut solid = None;
        self.body("Shape", |parser, field| {
            let known = field == "geometry";
            if known {
                solid = parser.geometry()?;
            }
            Ok(known)
        })?;
        Ok(solid.map(|solid| NodeKind::Shape { solid }))
    }

    fn geometry(&mut self) -> Result<Option<Rc<Solid>>, VrmlRefusal> {
        match self.word("a geometry")? {
            "NULL" => Ok(None),
            "USE" => {
                let name = self.word("a name after USE")?;
                match self.named(name)? {
                    Named::Geometry(solid) => Ok(Some(solid)),
                    Named::Skipped => Ok(None),
                    Named::Open | Named::Node(_) | Named::Points(_) => {
                        Err(self.refuse(format!("`{name}` is no geometry; expected one")))
                    }
                }
            }
            "DEF" => {
                let name = self.word("a name after DEF")?;
                self.name(name, Named::Open);
                let node_type = self.word("a geometry after DEF and its name")?;
                let solid = self.geometry_node(node_type)?;
                self.name(name, solid.clone().map_or(Named::Skipped, Named::Geometry));
                Ok(solid)
            }
            node_type => self.geometry_node(node_type),
        }
    }

    fn geometry_node(&mut self, node_type: &str) -> Result<Option<Rc<Solid>>, VrmlRefusal> {
        let solid = match node_type {
            "IndexedFaceSet" => self.face_set()?,
            "Box" => self.block()?,
            "Cylinder" => self.round("Cylinder", "radius", primitive::cylinder)?,
            "Cone" => self.round("Cone", "bottomRadius", primitive::cone)?,
            "Sphere" => self.sphere()?,
            "ElevationGrid" => self.elevation_grid()?,
            "Extrusion" => self.extrusion()?,
            _ => {
                self.warn_skipped(node_type);
                self.skip_block(Token::OpenBrace)?;
                return Ok(None);
            }
        };
        Ok(Some(Rc::new(solid)))
    }

    fn block(&mut self) -> Result<Solid, VrmlRefusal> {
        let mut size = [2.0; 3];
        self.body("Box", |parser, field| {
            let known = field == "size";
            if known {
                size = [
                    parser.length(field)?,
                    parser.length(field)?,
                    parser.length(field)?,
                ];
            }
            Ok(known)
        })?;
        Ok(primitive::block(size))
    }

    fn round(
        &mut self,
        what: &str,
        radius_field: &str,
        make: fn(f64, f64, Parts) -> Solid,
    ) -> Result<Solid, VrmlRefusal> {
        let (mut radius_m, mut height_m, mut parts) = (1.0, 2.0, Parts::ALL);
        self.body(what, |parser, field| {
            match field {
                "height" => height_m = parser.length(field)?,
                "bottom" => parts.bottom = parser.truth(field)?,
                "side" => parts.side = parser.truth(field)?,
                "top" => parts.top = parser.truth(field)?,
                _ if field == radius_field => radius_m = parser.length(field)?,
                _ => return Ok(false),
            }
            Ok(true)
        })?;
        Ok(make(radius_m, height_m, parts))
    }

    fn sphere(&mut self) -> Result<Solid, VrmlRefusal> {
        let mut radius_m = 1.0;
        self.body("Sphere", |parser, field| {
            let known = field == "radius";
            if known {
                radius_m = parser.length(field)?;
            }
            Ok(known)
        })?;
        Ok(primitive::sphere(radius_m))
    }

    fn face_set(&mut self) -> Result<Solid, VrmlRefusal> {
        let line = self.tokens.line();
        let mut points = Rc::new(Vec::new());
        let mut corners: Vec<(i64, usize)> = Vec::new();
        self.body("IndexedFaceSet", |parser, field| {
            match field {
                "coord" => points = parser.coordinates()?,
                "coordIndex" => corners = parser.indices()?,
                _ => return Ok(false),
            }
            Ok(true)
        })?;
        let (triangles, faces, odd) = fans(&corners, points.len())?;
        if odd {
            self.reading.warn(
                "faces with under three corners are left out",
                &self.file,
                line,
            );
        }
        Ok(Solid {
            mesh: Mesh::using(&points, &triangles),
            faces,
            extrusions: Vec::new(),
        })
    }

    fn coordinates(&mut self) -> Result<Rc<Vec<Xyz>>, VrmlRefusal> {
        match self.word("a Coordinate node")? {
            "NULL" => Ok(Rc::default()),
            "USE" => {
                let name = self.word("a name after USE")?;
                match self.named(name)? {
                    Named::Points(points) => Ok(points),
                    Named::Open | Named::Node(_) | Named::Geometry(_) | Named::Skipped => {
                        Err(self.refuse(format!("`{name}` is no Coordinate node; expected one")))
                    }
                }
            }
            "DEF" => {
                let name = self.word("a name after DEF")?;
                self.name(name, Named::Open);
                let node_type = self.word("a Coordinate node after DEF and its name")?;
                let points = self.coordinate_node(node_type)?;
                self.name(name, Named::Points(points.clone()));
                Ok(points)
            }
            node_type => self.coordinate_node(node_type),
        }
    }

    fn coordinate_node(&mut self, node_type: &str) -> Result<Rc<Vec<Xyz>>, VrmlRefusal> {
        if node_type != "Coordinate" {
            return Err(self.refuse(format!("found `{node_type}`; expected a Coordinate node")));
        }
        let mut points = Vec::new();
        self.body("Coordinate", |parser, field| {
            let known = field == "point";
            if known {
                points = parser.list(field, |parser| parser.vector("point"))?;
            }
            Ok(known)
        })?;
        Ok(Rc::new(points))
    }

    fn indices(&mut self) -> Result<Vec<(i64, usize)>, VrmlRefusal> {
        self.list("coordIndex", |parser| {
            Ok((parser.whole("coordIndex")?, parser.tokens.line()))
        })
    }

    /// Reads one whole number.
    pub(super) fn whole(&mut self, field: &str) -> Result<i64, VrmlRefusal> {
        let word = self.word(&format!("a whole number for {field}"))?;
        word.parse::<i64>().map_err(|_| {
            self.refuse(format!(
                "found {}; expected a whole number for {field}",
                Token::Word(word)
            ))
        })
    }

    /// Reads one value, or several between brackets.
    pub(super) fn list<T>(
        &mut self,
        field: &str,
        mut value: impl FnMut(&mut Self) -> Result<T, VrmlRefusal>,
    ) -> Result<Vec<T>, VrmlRefusal> {
        if self.tokens.peek()? != Token::OpenBracket {
            return Ok(vec![value(self)?]);
        }
        self.expect(Token::OpenBracket)?;
        let mut values = Vec::new();
        while self.tokens.peek()? != Token::CloseBracket {
            if values.len() >= MAX_NUMBERS {
                return Err(self.refuse(format!(
                    "{field} has over {MAX_NUMBERS} values; expected fewer"
                )));
            }
            values.push(value(self)?);
        }
        self.expect(Token::CloseBracket)?;
        Ok(values)
    }

    pub(super) fn length(&mut self, field: &str) -> Result<f64, VrmlRefusal> {
        let length = self.number(field)?;
        if length > 0.0 {
            return Ok(length);
        }
        Err(self.refuse(format!("{length} for {field}; expected a number above 0")))
    }

    pub(super) fn truth(&mut self, field: &str) -> Result<bool, VrmlRefusal> {
        match self.word(&format!("TRUE or FALSE for {field}"))? {
            "TRUE" => Ok(true),
            "FALSE" => Ok(false),
            found => {
                let found = Token::Word(found);
                Err(self.refuse(format!("found {found}; expected TRUE or FALSE for {field}")))
            }
        }
    }
}

/// Cuts faces, given as indices with their lines and ended by −1, into fans of triangles. Gives the triangles,
/// the number of faces, and whether some face had too few corners to be one.
fn fans(
    corners: &[(i64, usize)],
    points: usize,
) -> Result<(Vec<[u32; 3]>, usize, bool), VrmlRefusal> {
    let (mut triangles, mut faces, mut odd) = (Vec::new(), 0, false);
    for face in corners.split(|(index, _)| *index == -1) {
        let mut fan = Vec::with_capacity(face.len());
        for (index, line) in face {
            match u32::try_from(*index) {
                Ok(index) if (index as usize) < points => fan.push(index),
                _ => {
                    let reason = format!(
                        "coordIndex {index}; expected −1 or one of the {points} points from 0"
                    );
                    return Err(VrmlRefusal::at(*line, reason));
                }
            }
        }
        odd |= fan.len() == 1 || fan.len() == 2;
        if fan.len() >= 3 {
            faces += 1;
            triangles.extend(fan[1..].windows(2).map(|pair| [fan[0], pair[0], pair[1]]));
        }
    }
    Ok((triangles, faces, odd))
}
