//! Reads VRML97 scenes: the shapes of a `.wrl` file, placed in the local frame.
//!
//! Understood: Transform, Group, Collision (as Group), Inline, DEF/USE, and Shape with IndexedFaceSet, Box,
//! Cylinder, Cone, Sphere, ElevationGrid or Extrusion. Everything else is skipped, with one warning per node type. Colours,
//! lights, scripts and prototypes mean nothing here. Opens no file: the text comes in, and Inline asks a loader.
//!
//! Input is not trusted: nesting, size and the number of instances are limited, and whatever is refused is
//! refused with file, line and reason.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::Shape;
use super::affine::{Affine, Xyz};
use super::vrml_parse::Parser;
use super::vrml_tree::Tree;

/// Text of the scene and all its Inlines together, bytes.
pub const MAX_BYTES: usize = 64 << 20;
/// Nodes inside nodes, counted through USE and Inline.
pub const MAX_LEVELS: usize = 256;
/// Files asked for by Inline.
const MAX_FILES: usize = 256;
/// Node types, fields and more warned about before the warnings end.
const MAX_WARNINGS: usize = 100;

/// Which axis of the VRML world points up.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Up {
    /// VRML's own rule: y is up; VRML (x, y, z) becomes local (x, −z, y).
    #[default]
    Y,
    /// z is up, as many exporters write it: coordinates are taken as they are.
    Z,
}

impl Up {
    /// Returns the map from VRML coordinates to the local frame.
    fn map(self) -> Affine {
        match self {
            Up::Y => Affine::from_rows([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
            Up::Z => Affine::IDENTITY,
        }
    }
}

/// What a VRML file holds.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct VrmlScene {
    /// Every Shape with a geometry, in file order; one reached by USE counts each time.
    pub shapes: Vec<VrmlShape>,
    /// What was skipped, one line each, with file and line.
    pub warnings: Vec<String>,
}

/// One shape of a VRML file, in the local frame.
#[derive(Clone, PartialEq, Debug)]
pub struct VrmlShape {
    /// The DEF names around it, outermost first, its own last.
    pub names: Vec<Arc<str>>,
    /// Polygons as written in the file, before triangulation.
    pub faces: usize,
    /// Triangles of its surface.
    pub triangles: usize,
    /// Its form, metres.
    pub shape: Shape,
}

/// Why a VRML file was refused.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{file}:{line}: {reason}")]
pub struct VrmlError {
    /// The file, as named by the caller or by Inline.
    pub file: String,
    /// The line, from 1.
    pub line: usize,
    /// What is wrong and what was expected.
    pub reason: String,
}

/// Returns an Inline's text for its address, which is relative to the folder of the main file.
pub type InlineLoader<'a> = dyn FnMut(&str) -> Result<String, String> + 'a;

/// Reads a VRML97 text.
///
/// `file` names it in messages. `loader` is asked for every Inline; it decides which addresses it serves.
///
/// # Errors
/// The first thing that is wrong, with its place.
pub fn read_vrml(
    text: &str,
    file: &str,
    up: Up,
    loader: &mut InlineLoader<'_>,
) -> Result<VrmlScene, VrmlError> {
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
    let mut reading = VrmlReader::new(loader);
    let roots = reading
        .file(text, file, name, 0)
        .map_err(|refusal| refusal.into_error(file))?;
    let shapes = reading.tree.shapes(&roots, &up.map())?;
    Ok(VrmlScene {
        shapes,
        warnings: reading.warnings,
    })
}

/// Something refused at a line; the file is filled in by whoever knows it.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct VrmlRefusal {
    pub(super) file: Option<String>,
    pub(super) line: usize,
    pub(super) reason: String,
}

impl VrmlRefusal {
    /// Makes a refusal at a line of the file being read.
    pub(super) fn at(line: usize, reason: impl Into<String>) -> VrmlRefusal {
        VrmlRefusal {
            file: None,
            line,
            reason: reason.into(),
        }
    }

    fn into_error(self, file: &str) -> VrmlError {
        let file = self.file.unwrap_or_else(|| file.to_string());
        VrmlError {
            file,
            line: self.line,
            reason: self.reason,
        }
    }
}

/// What the parsers of a scene's files share.
pub(super) struct VrmlReader<'l> {
    pub(super) tree: Tree,
    warnings: Vec<String>,
    warned: BTreeSet<String>,
    loader: &'l mut dyn FnMut(&str) -> Result<String, String>,
    /// The addresses of the files being read, outermost first.
    open: Vec<String>,
    bytes: usize,
    files: usize,
}

impl<'l> VrmlReader<'l> {
    fn new(loader: &'l mut InlineLoader<'l>) -> VrmlReader<'l> {
        VrmlReader {
            tree: Tree::default(),
            warnings: Vec::new(),
            warned: BTreeSet::new(),
            loader,
            open: Vec::new(),
            bytes: 0,
            files: 0,
        }
    }

    /// Reads one file and returns its root nodes. `address` is relative to the folder of the main file.
    fn file(
        &mut self,
        text: &str,
        file: &str,
        address: &str,
        level: usize,
    ) -> Result<Vec<usize>, VrmlRefusal> {
        let fill = |refusal: VrmlRefusal| VrmlRefusal {
            file: refusal.file.or(Some(file.to_string())),
            ..refusal
        };
        self.bytes = self.bytes.saturating_add(text.len());
        if self.bytes > MAX_BYTES {
            let reason = format!(
                "the scene's text is over {} MiB; expected less",
                MAX_BYTES >> 20
            );
            return Err(fill(VrmlRefusal::at(1, reason)));
        }
        self.open.push(address.to_string());
        let roots = check_header(text).and_then(|()| Parser::new(text, file, level, self).roots());
        self.open.pop();
        roots.map_err(fill)
    }

    /// Loads the first of an Inline's addresses that can be had, and reads it.
    pub(super) fn inline(
        &mut self,
        urls: &[&str],
        line: usize,
        level: usize,
    ) -> Result<Vec<usize>, VrmlRefusal> {
        let mut last = VrmlRefusal::at(
            line,
            "this Inline has no url; expected the address of a VRML file",
        );
        for url in urls {
            self.files += 1;
            if self.files > MAX_FILES {
                return Err(VrmlRefusal::at(
                    line,
                    format!("over {MAX_FILES} files are asked for by Inline"),
                ));
            }
            let address = self.resolve(url);
            if self.open.contains(&address) {
                return Err(VrmlRefusal::at(
                    line,
                    format!("Inline of `{address}` inside itself, without end"),
                ));
            }
            match (self.loader)(&address) {
                Ok(text) => return self.file(&text, &address, &address, level),
                Err(reason) => {
                    last = VrmlRefusal::at(
                        line,
                        format!("Inline of `{address}` cannot be read: {reason}"),
                    );
                }
            }
        }
        Err(last)
    }

    /// Returns an address relative to the main file's folder for one relative to the file being read.
    fn resolve(&self, url: &str) -> String {
        if url.starts_with('/') || url.contains(':') {
            return url.to_string();
        }
        let folder = self
            .open
            .last()
            .and_then(|address| address.rsplit_once('/'))
            .map(|(folder, _)| folder);
        let mut parts: Vec<&str> = folder
            .map(|folder| folder.split('/').collect())
            .unwrap_or_default();
        for part in url.split('/') {
            match part {
                "." | "" => {}
                ".." if parts.last().is_some_and(|last| *last != "..") => drop(parts.pop()),
                _ => parts.push(part),
            }
        }
        parts.join("/")
    }

    /// Notes that nodes of a type are skipped; once for each type.
    pub(super) fn warn_skipped(&mut self, node_type: &str, file: &str, line: usize) {
        if self.warned.len() < MAX_WARNINGS && self.warned.insert(node_type.to_string()) {
            let shown: String = node_type.chars().take(60).collect();
            self.warnings
                .push(format!("{file}:{line}: {shown} nodes are skipped"));
        }
    }

    /// Notes something else, once for each `what`.
    pub(super) fn warn(&mut self, what: &str, file: &str, line: usize) {
        if self.warned.len() < MAX_WARNINGS && self.warned.insert(what.to_string()) {
            self.warnings.push(format!("{file}:{line}: {what}"));
        }
    }
}

fn check_header(text: &str) -> Result<(), VrmlRefusal> {
    const EXPECTED: &str = "expected the first line `#VRML V2.0 utf8`";
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim().is_empty() {
        return Err(VrmlRefusal::at(1, format!("the file is empty; {EXPECTED}")));
    }
    let line = text.lines().next().unwrap_or_default();
    let mut words = line.split_whitespace();
    if [words.next(), words.next(), words.next()] == [Some("#VRML"), Some("V2.0"), Some("utf8")] {
        return Ok(());
    }
    let shown: String = line.chars().take(40).collect();
    Err(VrmlRefusal::at(1, format!("found `{shown}`; {EXPECTED}")))
}

/// Returns a vertex if it lies within the world that is worked with (1000 km around the origin).
pub(super) fn within_world(vertex: Xyz) -> bool {
    vertex.iter().all(|part| part.abs() <= 1e6)
}
