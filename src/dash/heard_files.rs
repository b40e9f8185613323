//! The files of a run as far as it was heard, for a page beside which there is no store of a ground station: samples, links and
//! marks as `tomoswarm export` writes them, what lies where on the earth, and the venue. It makes text and writes nothing, and
//! has copies of what it needs, so that a thread can make a file while more is heard.

use serde_json::json;
use tomoswarm_proto::{Find, ImageSubject, Position, RunId, VehicleId};

use super::board::Board;
use super::geojson::Features;
use super::links::HeardLinks;
use super::marks::MarkState;
use super::run_files::{MARKS_HEADER, RunFiles, exported};
use crate::config::{Config, Venue, to_toml};
use crate::geom::Point;
use crate::tomo::{LinkBins, links_csv};

/// What was heard.
#[derive(Clone, Debug)]
pub struct HeardFiles {
    venue: Venue,
    links: HeardLinks,
    /// Where somebody truly stood, and in which run.
    marks: Vec<(RunId, Position)>,
    images: Vec<ImageFinds>,
    tracks: Vec<(VehicleId, Vec<Position>)>,
}

/// What was found in the newest image of a kind.
#[derive(Clone, Debug)]
struct ImageFinds {
    kind: &'static str,
    run: RunId,
    laps: u32,
    finds: Vec<Find>,
}

impl ImageFinds {
    fn of(board: &Board, subject: ImageSubject, kind: &'static str) -> Option<ImageFinds> {
        let image = board.image(subject)?.parts.get(&0)?;
        Some(ImageFinds {
            kind,
            run: image.run,
            laps: image.laps,
            finds: image.finds.clone(),
        })
    }
}

impl HeardFiles {
    /// Copies what is needed of the place, of marks, images and tracks, and of samples and links.
    pub fn new(venue: &Venue, board: &Board, links: &HeardLinks) -> HeardFiles {
        let is_stored = |state: MarkState| match state {
            MarkState::Stored | MarkState::TakingBack => true,
            MarkState::Asked => false,
        };
        let marks = board.marks().known();
        let marks = marks.filter(|(_, _, state)| is_stored(*state));
        let ids = board.view().vehicles().map(|(id, _)| id);
        let track = |id| Some((id, board.track(id)?.places().to_vec()));
        let structure = ImageFinds::of(board, ImageSubject::Structure, "structure");
        let change = ImageFinds::of(board, ImageSubject::Change, "change");
        HeardFiles {
            venue: venue.clone(),
            links: links.clone(),
            marks: marks.map(|(run, at, _)| (run, at)).collect(),
            images: structure.into_iter().chain(change).collect(),
            tracks: ids.filter_map(track).collect(),
        }
    }

    /// Returns a file of a run, or without a name which files there are.
    ///
    /// # Errors
    /// Nothing was heard of the run, or there is no such file; in words.
    pub fn exported(&self, run: RunId, name: Option<&str>) -> Result<Vec<u8>, String> {
        let source = match self.links.samples().left_out(run) {
            0 => "what this page's program has heard".to_owned(),
            count => format!("what this page's program has heard; {count} samples had no room"),
        };
        exported(self, &source, (run, name))
    }

    /// Returns the links of a run as a file of `tomoswarm image`.
    ///
    /// # Errors
    /// Nothing was heard of them; in words.
    pub fn links_file(&self, run: RunId) -> Result<String, String> {
        let links = self.links.measured(run);
        let text = (!links.is_empty()).then(|| links_csv(&links));
        text.ok_or_else(|| no_samples(run))
    }

    /// Returns the file of a name; `None` = there is none of that.
    fn made(&self, run: RunId, name: &str) -> Option<String> {
        let of_run = name.strip_prefix(&format!("run-{run}-"));
        match (of_run, name) {
            (Some("samples.csv"), _) => self.links.samples().csv(run),
            (Some("links.csv"), _) => self.links_file(run).ok(),
            (Some("marks.csv"), _) => self.marks(run),
            (None, "swarm.geojson") => Some(self.features(run)),
            (None, "venue.toml") => Some(to_toml(&Config::Venue(self.venue.clone()))),
            _ => None,
        }
    }

    fn stored_marks(&self, run: RunId) -> impl Iterator<Item = Position> {
        let all = self.marks.iter();
        all.filter(move |(of, _)| *of == run).map(|(_, at)| *at)
    }

    /// Returns where somebody truly stood; when that was marked is known to the ground station.
    fn marks(&self, run: RunId) -> Option<String> {
        let line = |at: Position| format!("{run},{},{},{},\n", at.x_m(), at.y_m(), at.z_m());
        let lines: String = self.stored_marks(run).map(line).collect();
        (!lines.is_empty()).then(|| format!("{MARKS_HEADER}\n{lines}"))
    }

    /// Returns area, fence, homes, finds of the newest images of a run, its marks, and where vehicles have been.
    fn features(&self, run: RunId) -> String {
        let mut features = Features::of_venue(&self.venue);
        for image in self.images.iter().filter(|image| image.run == run) {
            for (index, find) in image.finds.iter().enumerate() {
                let says = json!({
                    "what": "find", "run": run.0, "kind": image.kind, "laps": image.laps, "rank": index + 1,
                    "strength_db_per_m": f64::from(find.strength_udb_per_m) / 1e6,
                    "probability": find.probability.map(|share| share.fraction()),
                });
                features.place(says, find.at.into());
            }
        }
        for at in self.stored_marks(run) {
            features.place(json!({ "what": "mark", "run": run.0 }), at.into());
        }
        for (id, places) in &self.tracks {
            let points: Vec<Point> = places.iter().map(|at| Point::from(*at)).collect();
            features.track(json!({ "what": "track", "vehicle": id.0 }), &points);
        }
        features.text()
    }
}

impl RunFiles for HeardFiles {
    fn names(&self, run: RunId) -> Result<Vec<String>, String> {
        let of_run = ["links", "marks", "samples"].map(|kind| format!("run-{run}-{kind}.csv"));
        let is_there = [
            self.links.has(run),
            self.stored_marks(run).next().is_some(),
            self.links.samples().has(run),
        ];
        let mut names: Vec<String> = of_run
            .into_iter()
            .zip(is_there)
            .filter_map(|(name, is_there)| is_there.then_some(name))
            .collect();
        if names.is_empty() {
            return Err(format!("this page has heard nothing of run {run}"));
        }
        names.extend(["swarm.geojson", "venue.toml"].map(str::to_owned));
        Ok(names)
    }

    fn file(&self, run: RunId, name: &str) -> Result<Vec<u8>, String> {
        let names = self.names(run)?;
        let known = names.iter().any(|known| known == name);
        let text = self.made(run, name).filter(|_| known);
        text.map(String::into_bytes).ok_or_else(|| {
            format!(
                "there is no file {name:?} of run {run}; there are {}",
                names.join(", ")
            )
        })
    }

    fn links(&self, run: RunId) -> Result<LinkBins, String> {
        let bins = self.links.bins(run).cloned();
        bins.ok_or_else(|| no_samples(run))
    }
}

fn no_samples(run: RunId) -> String {
    format!("this page has heard no samples of run {run}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;
    use crate::dash::board::BoardInput;
    use crate::dash::links::LinkBook;
    use crate::geom::Lattice;
    use crate::operator::tests_support::{at, heard};
    use tomoswarm_proto::{Boot, Mark, Message, PoseReport, Sample, Samples, VehicleId};

    fn venue() -> Venue {
        let text = include_str!("../../configs/small.venue.toml");
        match config::read("venue.toml", text, &mut |path| Err(path.to_owned())).unwrap() {
            Config::Venue(venue) => venue,
            other => panic!("{other:?}"),
        }
    }

    fn batch() -> Samples {
        let pose = |x_m| PoseReport {
            at: Position::from_metres(x_m, 1.0, 0.0),
            ..PoseReport::default()
        };
        let sample = |sequence| Sample {
            sequence,
            heard_at_ns: sequence,
            transmitter: VehicleId(2),
            transmitter_pose: pose(1.0),
            receiver_pose: pose(4.0),
            channel: 11,
            power_dbm: 0,
            rssi_dbm: Some(-60),
        };
        Samples {
            vehicle: VehicleId(1),
            boot: Boot(1),
            run: RunId(2),
            samples: vec![sample(0), sample(1), sample(1)],
            lost: Vec::new(),
        }
    }

    #[test]
    fn what_was_heard_of_a_run_is_its_files_and_of_another_there_are_none() {
        let venue = venue();
        let mut board = Board::new(venue.hash(), Lattice::new(venue.cell_m));
        let mut links = LinkBook::default();
        links.take(&batch());
        let mark = Mark {
            run: RunId(2),
            at: Position::from_metres(3.2, 7.5, 0.0),
            stands: true,
        };
        board.take(at(1.0), &BoardInput::Heard(heard(Message::Mark(mark))));
        let files = HeardFiles::new(&venue, &board, links.heard());
        // What comes while a file is made is not in it, and changes nothing of it.
        let later = Samples {
            vehicle: VehicleId(3),
            ..batch()
        };
        links.take(&later);
        let names = files.names(RunId(2)).unwrap();
        let expected = [
            "run-2-links.csv",
            "run-2-marks.csv",
            "run-2-samples.csv",
            "swarm.geojson",
            "venue.toml",
        ];
        assert_eq!(names, expected);
        let text = |name: &str| String::from_utf8(files.file(RunId(2), name).unwrap()).unwrap();
        assert_eq!(
            text("run-2-marks.csv"),
            "run,x_m,y_m,z_m,marked\n2,3.2,7.5,0,\n"
        );
        assert_eq!(text("run-2-samples.csv").lines().count(), 3, "each once");
        assert_eq!(text("run-2-links.csv").lines().count(), 2);
        let features = text("swarm.geojson");
        assert!(features.contains(r#""what":"mark""#), "{features}");
        let read = config::read("venue.toml", &text("venue.toml"), &mut |path| {
            Err(path.to_owned())
        });
        assert!(matches!(read, Ok(Config::Venue(read)) if read.hash() == venue.hash()));
        for (run, name, reason) in [
            (1, "run-1-links.csv", "heard nothing of run 1"),
            (2, "run-1-links.csv", "there is no file"),
            (2, "../ground.sqlite", "there is no file"),
            (2, "run-2-change.npy", "there are run-2-links.csv, "),
        ] {
            let refused = files.file(RunId(run), name).unwrap_err();
            assert!(refused.contains(reason), "{name}: {refused}");
        }
    }
}
