//! What a file of links says of itself in the comments above its columns: how its sweep was to be imaged. So the same
//! links give the same image wherever they are read. It knows no link.

use super::imaging::Imaging;
use super::keys::{Form, KeyEntry, Keyed, Keys, Writer, read_table};
use super::problem::Problems;
use super::radio::Reception;
use super::read_kind;
use super::section::Section;
use super::venue::Area;
use crate::geom::{Point, Rect};

/// The kind of file, as its first line says it.
const KIND: &str = "links";

/// How the links of a file are to be imaged.
#[derive(Clone, PartialEq, Debug)]
pub struct LinksFile {
    /// What is imaged.
    pub area: Rect,
    /// Whether they have what radios differ by, as they were measured; of samples that says nothing, which always have it.
    pub as_measured: bool,
    /// The channel of the radio on which they were measured; `None` = it is not known, or each sample says its own.
    pub channel: Option<u8>,
    /// How well the receivers heard.
    pub reception: Reception,
    /// How images are made.
    pub imaging: Imaging,
}

impl Keyed for LinksFile {
    fn keys(&mut self, to: &mut dyn Keys) {
        let LinksFile {
            area,
            as_measured,
            channel,
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
        to.form(
            &mut AsMeasured(as_measured),
            KeyEntry {
                name: "as_measured",
                left_out: "false",
                means: "the links have what radios differ by",
            },
        );
        to.form(
            &mut Channel(channel),
            KeyEntry {
                name: "channel",
                left_out: "not known",
                means: "channel of the radio",
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

/// Whether links are as they were measured; where they are not, nothing is written.
struct AsMeasured<'a>(&'a mut bool);

impl Form for AsMeasured<'_> {
    fn to_toml(&self) -> Option<String> {
        self.0.then(|| true.to_string())
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.0 = section.flag(key, false);
    }
}

/// The channel, if it is known; where it is not, nothing is written.
struct Channel<'a>(&'a mut Option<u8>);

impl Form for Channel<'_> {
    fn to_toml(&self) -> Option<String> {
        self.0.map(|channel| channel.to_string())
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let whole = || section.whole(key, 0, 0..=usize::from(u8::MAX));
        *self.0 = section
            .has(key)
            .then(whole)
            .and_then(|channel| u8::try_from(channel).ok());
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
                as_measured: false,
                channel: None,
                reception: Reception::default(),
                imaging: Imaging::default(),
            };
            read_table(&mut file, root);
            Some(file)
        })
    }
}
