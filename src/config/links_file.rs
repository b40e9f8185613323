//! What a file of links says of itself in the comments above its columns: how its sweep was to be imaged. So the same
//! links give the same image wherever they are read. It knows no link.

use super::imaging::Imaging;
use super::keys::{KeyEntry, Keyed, Keys, Writer, read_table};
use super::problem::Problems;
use super::radio::Reception;
use super::read_kind;
use super::venue::Area;
use crate::geom::{Point, Rect};

/// The kind of file, as its first line says it.
const KIND: &str = "links";

/// How the links of a file are to be imaged.
#[derive(Clone, PartialEq, Debug)]
pub struct LinksFile {
    /// What is imaged.
    pub area: Rect,
    /// How well the receivers heard.
    pub reception: Reception,
    /// How images are made.
    pub imaging: Imaging,
}

impl Keyed for LinksFile {
    fn keys(&mut self, to: &mut dyn Keys) {
        let LinksFile {
            area,
            reception,
            imaging,
        } = self;
        to.form(
            &mut Area(area),
            KeyEntry {
                name: "area_m",
                left_out: "needed",
                means: "`[x0, y0, x1, y1]`: what is imaged",
            },
        );
        reception.keys(to);
        to.table(
            imaging,
            KeyEntry {
                name: "imaging",
                left_out: "",
                means: "",
            },
        );
    }
}

impl LinksFile {
    /// Returns it as TOML: every key with its value, and with unit and meaning as a comment.
    pub fn written(&self) -> String {
        Writer::file(KIND, &mut self.clone())
    }

    /// Returns whether a text begins as one that [`LinksFile::written`] has returned.
    pub fn begins(text: &str) -> bool {
        text.lines()
            .next()
            .is_some_and(|line| line.trim() == format!("kind = \"{KIND}\""))
    }

    /// Reads it; `file_name` is used in messages.
    ///
    /// # Errors
    /// Every mistake.
    pub fn read(file_name: &str, text: &str) -> Result<LinksFile, Problems> {
        read_kind(file_name, text, KIND, |root| {
            let mut file = LinksFile {
                area: Rect::new(Point::default(), Point::default()),
                reception: Reception::default(),
                imaging: Imaging::default(),
            };
            read_table(&mut file, root);
            Some(file)
        })
    }
}
