//! VRML97 ElevationGrid: heights over a level grid, as triangles.
//!
//! A sheet without a thickness: nothing lies below it. Colours, normals and texture coordinates are skipped;
//! `ccw`, `solid` and `creaseAngle` too, because every face is seen from both sides and none is smoothed.

use super::affine::Xyz;
use super::mesh::Mesh;
use super::primitive::Solid;
use super::vrml::VrmlRefusal;
use super::vrml_parse::Parser;

/// Points of one grid; more than a scene may have triangles for.
const MAX_POINTS: usize = 500_000;

/// What an ElevationGrid node says.
struct Grid {
    columns: usize,
    rows: usize,
    spacing: [f64; 2],
    heights: Vec<f64>,
}

impl Parser<'_, '_, '_> {
    /// Reads an ElevationGrid's body.
    pub(super) fn elevation_grid(&mut self) -> Result<Solid, VrmlRefusal> {
        let line = self.tokens.line();
        let mut grid = Grid {
            columns: 0,
            rows: 0,
            spacing: [1.0; 2],
            heights: Vec::new(),
        };
        self.body("ElevationGrid", |parser, field| {
            match field {
                "xDimension" => grid.columns = parser.dimension(field)?,
                "zDimension" => grid.rows = parser.dimension(field)?,
                "xSpacing" => grid.spacing[0] = parser.length(field)?,
                "zSpacing" => grid.spacing[1] = parser.length(field)?,
                "height" => grid.heights = parser.list(field, |parser| parser.number("height"))?,
                _ => return Ok(false),
            }
            Ok(true)
        })?;
        grid.check()
            .map_err(|reason| VrmlRefusal::at(line, reason))?;
        Ok(grid.solid())
    }

    fn dimension(&mut self, field: &str) -> Result<usize, VrmlRefusal> {
        let count = self.whole(field)?;
        usize::try_from(count)
            .ok()
            .filter(|count| *count <= MAX_POINTS)
            .ok_or_else(|| self.refuse(format!("{count} for {field}; expected 0 to {MAX_POINTS}")))
    }
}

impl Grid {
    fn check(&self) -> Result<(), String> {
        let Grid {
            columns,
            rows,
            heights,
            ..
        } = self;
        let points = columns.saturating_mul(*rows);
        if points > MAX_POINTS {
            return Err(format!(
                "an ElevationGrid of {columns} x {rows} = {points} points; expected at most {MAX_POINTS}"
            ));
        }
        if points != heights.len() {
            return Err(format!(
                "an ElevationGrid with {} heights; expected {columns} x {rows} = {points}, one for each point",
                heights.len()
            ));
        }
        Ok(())
    }

    /// Puts the points in rows along x (VRML97, 6.17) and cuts every cell into two triangles, seen from +y
    /// counter-clockwise.
    fn solid(&self) -> Solid {
        let columns = self.columns.max(1);
        let point = |(index, height): (usize, &f64)| -> Xyz {
            let (column, row) = (index % columns, index / columns);
            [
                column as f64 * self.spacing[0],
                *height,
                row as f64 * self.spacing[1],
            ]
        };
        let points: Vec<Xyz> = self.heights.iter().enumerate().map(point).collect();
        let mut triangles = Vec::new();
        for row in 1..self.rows {
            for column in 1..self.columns {
                let far = (row * columns + column) as u32;
                let near = far - columns as u32;
                triangles.extend([[near - 1, far - 1, far], [near - 1, far, near]]);
            }
        }
        let faces = triangles.len() / 2;
        Solid {
            mesh: Mesh::using(&points, &triangles),
            faces,
            extrusions: Vec::new(),
        }
    }
}
